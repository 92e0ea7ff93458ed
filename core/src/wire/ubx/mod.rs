//! UBX, the protocol of u-blox receivers: raw measurements and the subframes they were sent.
//!
//! A frame is `B5 62`, class, identifier, a 16-bit length, that many bytes, and two sums modulo 256
//! over class to content, little endian throughout. [UBX-F9-HPG] 3.2, 3.4
//!
//! | message | class, identifier | what is read |
//! |---|---|---|
//! | RXM-RAWX | `02 15` | the observations of an epoch, all in one message |
//! | RXM-SFRBX | `02 13` | words of a navigation message, see [`super::broadcast`] |
//! | NAV-PVT | `01 07` | the receiver's own position and velocity |
//!
//! Every other message is passed over and counted.

pub mod pvt;
pub mod rawx;
pub mod sfrbx;

pub use pvt::NavPvt;
pub use rawx::{Measurement, Rawx};

/// The two bytes a frame starts with.
pub const PREAMBLE: [u8; 2] = [0xB5, 0x62];
/// Bytes before the content.
pub const HEADER_LEN: usize = 6;
/// Bytes after it.
pub const TRAILER_LEN: usize = 2;
/// Longest content that is looked at, bytes: RXM-RAWX with the 255 measurements its count can say.
pub const MAX_PAYLOAD: usize = rawx::HEADER_LEN + 255 * rawx::MEASUREMENT_LEN;
/// Longest content of another message that is taken for a frame, bytes: NAV-SIG of 150 signals. A damaged length
/// makes the scanner wait for so many bytes at most, a second or two of a receiver's output; a longer message
/// is passed over as noise.
pub const MAX_OTHER_PAYLOAD: usize = 8 + 150 * 16;
/// Longest frame, bytes.
pub const MAX_FRAME: usize = HEADER_LEN + MAX_PAYLOAD + TRAILER_LEN;

/// Class and identifier of RXM-RAWX.
pub const RXM_RAWX: [u8; 2] = [0x02, 0x15];
/// Class and identifier of RXM-SFRBX.
pub const RXM_SFRBX: [u8; 2] = [0x02, 0x13];
/// Class and identifier of NAV-PVT.
pub const NAV_PVT: [u8; 2] = [0x01, 0x07];

/// A frame whose checksum is right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Class and identifier.
    pub message: [u8; 2],
    /// Its content.
    pub payload: &'a [u8],
}

/// Why there is no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// The bytes do not start with the preamble.
    NoPreamble,
    /// So far it looks like a frame; more bytes are needed.
    Incomplete,
    /// The length field says more than any message has.
    TooLong {
        /// What it says.
        length: usize,
    },
    /// The length field cannot be that of this message.
    BadLength {
        /// What it says.
        length: usize,
    },
    /// The checksum is wrong.
    BadChecksum,
}

/// Why the content of a right frame is refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PayloadError {
    /// Shorter or longer than what it announces.
    Length,
    /// A version of the message that is not known here.
    Version {
        /// The version found.
        version: u8,
    },
    /// The time of week is none.
    TimeOfWeek {
        /// What it says, s.
        tow_s: f64,
    },
    /// The receiver does not know the week yet.
    WeekUnknown,
    /// A number is outside what it can mean.
    OutOfRange,
}

/// The two sums of [UBX-F9-HPG] 3.4, after RFC 1145.
#[inline(never)]
pub fn checksum(bytes: &[u8]) -> [u8; 2] {
    let (mut a, mut b) = (0_u8, 0_u8);
    for byte in bytes {
        a = a.wrapping_add(*byte);
        b = b.wrapping_add(a);
    }
    [a, b]
}

impl<'a> Frame<'a> {
    /// The frame that starts with the first of these bytes, and its length.
    ///
    /// The length of a message that is used is held against its first bytes, so that one damaged there
    /// does not make the scanner wait for thousands of bytes that belong to others.
    pub fn parse(bytes: &'a [u8]) -> Result<(Self, usize), FrameError> {
        for (byte, expected) in bytes.iter().zip(PREAMBLE) {
            if *byte != expected {
                return Err(FrameError::NoPreamble);
            }
        }
        let Some((&[_, _, class, id, low, high], rest)) = bytes.split_first_chunk::<HEADER_LEN>()
        else {
            return Err(FrameError::Incomplete);
        };
        let length = usize::from(u16::from_le_bytes([low, high]));
        let message = [class, id];
        let longest = if message == RXM_RAWX {
            MAX_PAYLOAD
        } else {
            MAX_OTHER_PAYLOAD
        };
        if length > longest {
            return Err(FrameError::TooLong { length });
        }
        let is_possible = match message {
            // Empty, it asks for the message.
            RXM_RAWX if length > 0 => rawx::length_is_possible(length, rest),
            RXM_SFRBX if length > 0 => sfrbx::length_is_possible(length, rest),
            _ => true,
        };
        if !is_possible {
            return Err(FrameError::BadLength { length });
        }
        let (Some(payload), Some(summed), Some(sent)) = (
            rest.get(..length),
            bytes.get(2..HEADER_LEN.saturating_add(length)),
            rest.get(length..length.saturating_add(TRAILER_LEN)),
        ) else {
            return Err(FrameError::Incomplete);
        };
        if checksum(summed) != sent {
            return Err(FrameError::BadChecksum);
        }
        Ok((Self { message, payload }, HEADER_LEN + length + TRAILER_LEN))
    }

    /// The frame in bytes that [`Frame::parse`] has accepted.
    pub fn from_checked(bytes: &'a [u8]) -> Option<Self> {
        let (&[_, _, class, id, low, high], rest) = bytes.split_first_chunk::<HEADER_LEN>()?;
        let length = usize::from(u16::from_le_bytes([low, high]));
        Some(Self {
            message: [class, id],
            payload: rest.get(..length)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    pub(super) fn frame(message: [u8; 2], payload: &[u8]) -> Vec<u8> {
        let mut bytes = PREAMBLE.to_vec();
        bytes.extend(message);
        bytes.extend((payload.len() as u16).to_le_bytes());
        bytes.extend(payload);
        let sums = checksum(&bytes[2..]);
        bytes.extend(sums);
        bytes
    }

    #[test]
    fn poll_request_of_the_interface_description_passes() {
        // CFG-RATE polled: a frame every u-blox user has seen in u-center.
        let bytes = [0xB5, 0x62, 0x06, 0x08, 0x00, 0x00, 0x0E, 0x30];
        let (frame, length) = Frame::parse(&bytes).unwrap();
        assert_eq!((frame.message, frame.payload, length), ([6, 8], &[][..], 8));
    }

    #[test]
    fn every_cut_is_incomplete_and_every_flipped_bit_is_refused() {
        let bytes = frame([0x01, 0x07], &[0x5A; 92]);
        for cut in 0..bytes.len() {
            assert_eq!(Frame::parse(&bytes[..cut]), Err(FrameError::Incomplete));
        }
        for bit in 0..8 * bytes.len() {
            let mut damaged = bytes.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert!(Frame::parse(&damaged).is_err(), "{bit}");
        }
    }

    #[test]
    fn impossible_length_is_refused_before_its_bytes_arrive() {
        let long = [0xB5, 0x62, 0x01, 0x35, 0x69, 0x09];
        assert_eq!(
            Frame::parse(&long),
            Err(FrameError::TooLong { length: 2409 })
        );
        let mut head = std::vec![0xB5, 0x62, 0x02, 0x15, 0x31, 0x00];
        assert_eq!(
            Frame::parse(&head),
            Err(FrameError::BadLength { length: 49 }),
            "not 16 and a multiple of 32"
        );
        head[4] = 0x30;
        assert_eq!(Frame::parse(&head), Err(FrameError::Incomplete));
        head.extend([0; 11]);
        head.push(2);
        assert_eq!(
            Frame::parse(&head),
            Err(FrameError::BadLength { length: 48 }),
            "room for one measurement, and two announced"
        );
    }
}
