//! One stream of bytes in, checked frames out: UBX, RTCM 3 and native frames in any mixture, with
//! NMEA lines and noise between, in chunks of any size.
//!
//! Every position of the stream is tried as the start of a frame until one passes its checksum;
//! after a false start the search goes on with the very next byte, so a good frame that begins
//! inside a damaged one is found. What comes out depends on the bytes alone, not on how they were
//! cut into chunks.
//!
//! Cost: each byte of a frame goes through a checksum once. A false start costs one checksum more, of
//! at most 1034 bytes; in noise one byte in 2¹⁴ starts one (preamble and six zero bits). A false start
//! of UBX, one byte in 2¹⁶, may cost 2416 bytes, and wait for them; of RXM-RAWX, whose length is held against
//! its count, 8184.
//!
//! An RTCM 3 frame is `0xD3`, six reserved bits (zero), a 10-bit length, that many bytes, and the
//! CRC-24Q of all of it. [RTCM-3] 4.2

use super::counters::{Counters, count};
use super::crc::crc24q;
use super::native::{self, FrameError};
use super::ubx;

/// First byte of an RTCM 3 frame.
const RTCM_PREAMBLE: u8 = 0xD3;
/// First byte of a UBX frame.
const UBX_PREAMBLE: u8 = ubx::PREAMBLE[0];
/// Bytes before the content of an RTCM 3 frame.
const RTCM_HEADER_LEN: usize = 3;
/// Bytes after it.
const RTCM_TRAILER_LEN: usize = 3;
/// Longest RTCM 3 frame, bytes.
pub const RTCM_MAX_FRAME: usize = RTCM_HEADER_LEN + 1023 + RTCM_TRAILER_LEN;

/// Longest frame of any kind, bytes.
pub const MAX_FRAME: usize = ubx::MAX_FRAME;
const _: () = assert!(MAX_FRAME >= native::MAX_FRAME && MAX_FRAME >= RTCM_MAX_FRAME);

/// The longest frame, and two of the others: while one of these is held the next arrives, and what is
/// left is moved to the front after so many bytes at the earliest.
const CAPACITY: usize = MAX_FRAME + 2 * native::MAX_FRAME;

/// Longest text between `$` or `!` and its line end that is taken for an NMEA line, bytes. NMEA 0183
/// says 82 in all; receivers send longer ones.
const MAX_LINE: u16 = 250;

/// A frame that passed its checks.
#[derive(Clone, Copy, Debug)]
pub enum Scanned<'a> {
    /// The content of an RTCM 3 frame, which starts with the message number.
    Rtcm3(&'a [u8]),
    /// A native frame.
    Native(native::Frame<'a>),
    /// A frame of a u-blox receiver.
    Ubx(ubx::Frame<'a>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Found {
    Rtcm3 { len: usize },
    Native { len: usize },
    Ubx { len: usize },
}

/// What the bytes from some position on are.
enum Start {
    Frame(Found),
    NotYet,
    False,
}

/// The scanner with its buffer.
#[derive(Clone, Debug)]
pub struct Scanner {
    buffer: [u8; CAPACITY],
    /// First byte not used yet.
    start: usize,
    /// End of the bytes received.
    end: usize,
    /// The frame at `start`, if one was found and not released.
    found: Option<Found>,
    /// Length of the NMEA line that ends at `start`, 0 outside of one.
    line_len: u16,
    /// No more bytes will come.
    ended: bool,
}

impl Scanner {
    /// Nothing received.
    pub const EMPTY: Self = Self {
        buffer: [0; CAPACITY],
        start: 0,
        end: 0,
        found: None,
        line_len: 0,
        ended: false,
    };

    /// Takes as many of the bytes as there is room for, and tells how many. With no frame held there
    /// is always room for one at least.
    pub fn feed(&mut self, bytes: &[u8]) -> usize {
        self.ended = false;
        if self.start == self.end {
            self.start = 0;
            self.end = 0;
        } else if self.end == CAPACITY && self.start > 0 {
            self.buffer.copy_within(self.start.min(CAPACITY).., 0);
            self.end = CAPACITY.saturating_sub(self.start);
            self.start = 0;
        }
        let Some(room) = self.buffer.get_mut(self.end..) else {
            return 0;
        };
        let taken = if bytes.len() < room.len() {
            bytes.len()
        } else {
            room.len()
        };
        room.iter_mut()
            .zip(bytes)
            .for_each(|(to, byte)| *to = *byte);
        self.end = self.end.saturating_add(taken);
        taken
    }

    /// Bytes taken that belong to no frame yet, nor are known to belong to none.
    pub fn bytes_in_hand(&self) -> usize {
        self.unused().len()
    }

    /// The stream ends: a frame that is not complete now never will be.
    pub fn end(&mut self) {
        self.ended = true;
    }

    /// Goes on to the next frame and tells whether there is one; stays at one that was not released.
    pub fn find(&mut self, counters: &mut Counters) -> bool {
        if self.found.is_some() {
            return true;
        }
        while let Some((&byte, _)) = self.unused().split_first() {
            match self.start_here(byte, counters) {
                Start::Frame(found) => {
                    match found {
                        Found::Rtcm3 { .. } => count(&mut counters.rtcm_frames),
                        Found::Native { .. } => count(&mut counters.native_frames),
                        Found::Ubx { .. } => count(&mut counters.ubx_frames),
                    }
                    self.leave_line(counters);
                    self.found = Some(found);
                    return true;
                }
                Start::NotYet if !self.ended => return false,
                Start::NotYet => {
                    count(&mut counters.cut_off_frames);
                    self.pass(byte, counters);
                }
                Start::False => self.pass(byte, counters),
            }
        }
        if self.ended {
            self.leave_line(counters);
        }
        false
    }

    /// The frame [`Scanner::find`] found.
    pub fn frame(&self) -> Option<Scanned<'_>> {
        let unused = self.unused();
        match self.found? {
            Found::Rtcm3 { len } => unused
                .get(RTCM_HEADER_LEN..len.saturating_sub(RTCM_TRAILER_LEN))
                .map(Scanned::Rtcm3),
            Found::Native { len } => {
                native::Frame::from_checked(unused.get(..len)?).map(Scanned::Native)
            }
            Found::Ubx { len } => ubx::Frame::from_checked(unused.get(..len)?).map(Scanned::Ubx),
        }
    }

    /// Done with the frame [`Scanner::find`] found.
    pub fn release(&mut self) {
        if let Some(Found::Rtcm3 { len } | Found::Native { len } | Found::Ubx { len }) =
            self.found.take()
        {
            self.start = self.start.saturating_add(len);
        }
    }

    fn unused(&self) -> &[u8] {
        self.buffer.get(self.start..self.end).unwrap_or(&[])
    }

    /// Whether a frame starts with the first unused byte, which is `byte`.
    fn start_here(&self, byte: u8, counters: &mut Counters) -> Start {
        match byte {
            RTCM_PREAMBLE => self.rtcm3_here(counters),
            native::PREAMBLE_1 => self.native_here(counters),
            UBX_PREAMBLE => self.ubx_here(counters),
            _ => Start::False,
        }
    }

    fn rtcm3_here(&self, counters: &mut Counters) -> Start {
        let unused = self.unused();
        let Some(&high) = unused.get(1) else {
            return Start::NotYet;
        };
        if high & 0b1111_1100 != 0 {
            count(&mut counters.rtcm_reserved_bits);
            return Start::False;
        }
        let Some(&low) = unused.get(2) else {
            return Start::NotYet;
        };
        let len = RTCM_HEADER_LEN + u16::from_be_bytes([high, low]) as usize + RTCM_TRAILER_LEN;
        match unused.get(..len) {
            None => Start::NotYet,
            // The remainder of a frame together with its checksum is zero.
            Some(frame) if crc24q(frame) == 0 => Start::Frame(Found::Rtcm3 { len }),
            Some(_) => {
                count(&mut counters.rtcm_bad_crc);
                Start::False
            }
        }
    }

    fn native_here(&self, counters: &mut Counters) -> Start {
        match native::Frame::parse(self.unused()) {
            Ok((_, len)) => Start::Frame(Found::Native { len }),
            Err(FrameError::Incomplete { .. }) => Start::NotYet,
            Err(error) => {
                match error {
                    FrameError::Version { .. } => count(&mut counters.native_other_version),
                    FrameError::TooLong { .. } => count(&mut counters.native_too_long),
                    FrameError::BadCrc => count(&mut counters.native_bad_crc),
                    FrameError::NoPreamble | FrameError::Incomplete { .. } => {}
                }
                Start::False
            }
        }
    }

    fn ubx_here(&self, counters: &mut Counters) -> Start {
        match ubx::Frame::parse(self.unused()) {
            Ok((_, len)) => Start::Frame(Found::Ubx { len }),
            Err(ubx::FrameError::Incomplete) => Start::NotYet,
            Err(error) => {
                match error {
                    ubx::FrameError::TooLong { .. } => count(&mut counters.ubx_too_long),
                    ubx::FrameError::BadLength { .. } => count(&mut counters.ubx_bad_length),
                    ubx::FrameError::BadChecksum => count(&mut counters.ubx_bad_checksum),
                    ubx::FrameError::NoPreamble | ubx::FrameError::Incomplete => {}
                }
                Start::False
            }
        }
    }

    /// Passes over one byte that starts no frame: part of an NMEA line, or noise.
    fn pass(&mut self, byte: u8, counters: &mut Counters) {
        self.start = self.start.saturating_add(1);
        match byte {
            b'$' | b'!' => {
                self.leave_line(counters);
                self.line_len = 1;
            }
            b'\n' if self.line_len > 0 => {
                self.line_len = 0;
                count(&mut counters.nmea_lines);
            }
            b' '..=b'~' | b'\r' if self.line_len > 0 && self.line_len < MAX_LINE => {
                self.line_len = self.line_len.saturating_add(1);
            }
            // The line feed after a carriage return that ended nothing, and everything else.
            _ => {
                self.leave_line(counters);
                count(&mut counters.noise_bytes);
            }
        }
    }

    /// What looked like an NMEA line has no end: its bytes were noise.
    fn leave_line(&mut self, counters: &mut Counters) {
        counters.noise_bytes = counters.noise_bytes.saturating_add(self.line_len.into());
        self.line_len = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::native::{Kind, encode};
    use std::vec::Vec;

    fn rtcm3(content: &[u8]) -> Vec<u8> {
        let mut frame = std::vec![
            RTCM_PREAMBLE,
            (content.len() >> 8) as u8,
            content.len() as u8
        ];
        frame.extend(content);
        let crc = crc24q(&frame);
        frame.extend(&crc.to_be_bytes()[1..]);
        frame
    }

    fn native_frame(byte: u8) -> Vec<u8> {
        let mut out = [0; native::MAX_FRAME];
        let len = encode(Kind::Report, &mut out, |w| w.put_bytes(&[byte; 40])).unwrap();
        out[..len].to_vec()
    }

    fn ubx_frame(message: [u8; 2], payload: &[u8]) -> Vec<u8> {
        let mut frame = ubx::PREAMBLE.to_vec();
        frame.extend(message);
        frame.extend((payload.len() as u16).to_le_bytes());
        frame.extend(payload);
        let sums = ubx::checksum(&frame[2..]);
        frame.extend(sums);
        frame
    }

    /// The contents found when the stream arrives in chunks of the given size, and the counts.
    fn scan(stream: &[u8], chunk: usize) -> (Vec<Vec<u8>>, Counters) {
        let (mut scanner, mut counters) = (Scanner::EMPTY, Counters::ZERO);
        let mut contents = Vec::new();
        let mut drain = |scanner: &mut Scanner, counters: &mut Counters| {
            while scanner.find(counters) {
                contents.push(match scanner.frame().unwrap() {
                    Scanned::Rtcm3(content) => content.to_vec(),
                    Scanned::Native(frame) => frame.payload().to_vec(),
                    Scanned::Ubx(frame) => frame.payload.to_vec(),
                });
                scanner.release();
            }
        };
        for mut bytes in stream.chunks(chunk) {
            while !bytes.is_empty() {
                bytes = &bytes[scanner.feed(bytes)..];
                drain(&mut scanner, &mut counters);
            }
        }
        scanner.end();
        drain(&mut scanner, &mut counters);
        (contents, counters)
    }

    #[test]
    fn mixed_stream_gives_the_same_in_chunks_of_any_size() {
        let mut stream = b"\xd3noise$GPGGA,1,2*33\r\n".to_vec();
        stream.extend(rtcm3(&[1; 19]));
        stream.extend(native_frame(2));
        stream.extend(b"$PUBX,SF,SF\x01\xff\xff");
        stream.extend(rtcm3(&[3; 1023]));
        stream.extend(rtcm3(&[]));
        stream.extend(b"SF\x02SF\x01\x02\xff\xff$GPTXT");
        stream.extend(rtcm3(&[4; 700]));
        stream.extend(ubx_frame([1, 7], &[6; 92]));
        stream.extend(ubx_frame([0x0A, 0x31], &[7; 2408]));
        stream.extend([0xB5, 0x62, 0x02, 0x15, 0x31, 0x00]);
        stream.extend([0xB5, 0x62, 0x01, 0x35, 0xF1, 0x1F]);
        let mut damaged = ubx_frame([1, 7], &[6; 92]);
        damaged[50] ^= 4;
        stream.extend(&damaged);
        stream.extend(ubx_frame([1, 7], &[]));
        stream.extend(&rtcm3(&[5; 19])[..10]);
        let (contents, counters) = scan(&stream, stream.len());
        assert_eq!(contents.len(), 8);
        assert_eq!(contents[1], [2; 40]);
        assert_eq!((counters.rtcm_frames, counters.native_frames), (4, 1));
        assert_eq!(counters.nmea_lines, 1);
        assert_eq!(counters.native_other_version, 1);
        assert_eq!(counters.native_too_long, 2);
        assert_eq!(counters.rtcm_reserved_bits, 1);
        assert_eq!(counters.cut_off_frames, 1);
        assert_eq!(counters.ubx_frames, 3);
        assert_eq!(
            [
                counters.ubx_bad_checksum,
                counters.ubx_bad_length,
                counters.ubx_too_long
            ],
            [1, 1, 1]
        );
        assert_eq!(counters.noise_bytes, 6 + 14 + 9 + 6 + 6 + 6 + 100 + 10);
        for chunk in (1..70).chain([1000, 1029, 1034, 2067, 2068, 2069, 8183, 8184, 8185]) {
            assert_eq!(
                scan(&stream, chunk),
                (contents.clone(), counters),
                "{chunk}"
            );
        }
    }

    #[test]
    fn good_frame_inside_a_damaged_one_is_found() {
        let inner = rtcm3(&[7; 100]);
        let mut outer = std::vec![RTCM_PREAMBLE, 0x01, 0xFF, 0x12];
        outer.extend(&inner);
        outer.extend([0; 600]);
        let (contents, counters) = scan(&outer, 64);
        assert_eq!(contents, [std::vec![7; 100]]);
        assert_eq!(counters.rtcm_bad_crc, 1);
        assert_eq!(counters.noise_bytes, 4 + 600);
    }

    #[test]
    fn held_frame_stays_while_more_bytes_come() {
        let (mut scanner, mut counters) = (Scanner::EMPTY, Counters::ZERO);
        let first = rtcm3(&[1; 1023]);
        assert_eq!(scanner.feed(&first), first.len());
        assert!(scanner.find(&mut counters));
        let more = scanner.feed(&[0xAA; 2 * CAPACITY]);
        assert_eq!(more, CAPACITY - first.len());
        assert_eq!(scanner.feed(&[0xAA; 5000]), 0, "full while it holds");
        assert!(scanner.find(&mut counters));
        assert!(matches!(scanner.frame(), Some(Scanned::Rtcm3(content)) if content == [1; 1023]));
        scanner.release();
        assert!(!scanner.find(&mut counters));
        assert_eq!(
            (counters.rtcm_frames, counters.noise_bytes),
            (1, more as u32)
        );
    }
}
