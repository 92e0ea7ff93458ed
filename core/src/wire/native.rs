//! surefix's own frame, the same in both directions: exact numbers under a checksum.
//!
//! | bytes | field |
//! |---|---|
//! | 2 | `0x53 0x46`, "SF" |
//! | 1 | version, 1 |
//! | 1 | kind |
//! | 2 | payload length, little endian |
//! | n | payload, at most [`MAX_PAYLOAD`] |
//! | 4 | CRC-32 (ISO HDLC) over version to payload, little endian |
//!
//! Numbers are little endian, f64 and f32 their IEEE 754 bits; what is not finite is refused when
//! read. The payloads are described in docs/native-frame.md; which domain type they mean is known to
//! `ingest` and `report` alone.

use super::crc::crc32;

/// First byte of a frame.
pub const PREAMBLE_1: u8 = 0x53;
/// Second byte of a frame.
pub const PREAMBLE_2: u8 = 0x46;
/// Version this code writes and reads.
pub const VERSION: u8 = 1;
/// Versions lie below this, so that the letters SF in a text are not taken for a frame.
const VERSION_END: u8 = 16;
/// Bytes before the payload.
pub const HEADER_LEN: usize = 6;
/// Bytes after the payload.
pub const TRAILER_LEN: usize = 4;
/// Longest payload, bytes. Long enough for a report, short enough that a false start delays little;
/// an epoch of observations takes several frames.
pub const MAX_PAYLOAD: usize = 1024;
/// Longest frame, bytes.
pub const MAX_FRAME: usize = HEADER_LEN + MAX_PAYLOAD + TRAILER_LEN;

/// What a frame carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Kind {
    /// A configuration, into the monitor.
    Configuration = 1,
    /// Observations of an epoch or of a group of its satellites, into the monitor.
    Observations = 2,
    /// A broadcast ephemeris, into the monitor.
    Ephemeris = 3,
    /// Ionosphere parameters, into the monitor.
    Klobuchar = 4,
    /// The stream ends, into the monitor; empty.
    EndOfStream = 5,
    /// What is known of the inertial unit, into the monitor.
    Inertial = 6,
    /// An inertial sample, into the monitor.
    Imu = 7,
    /// A state to start from, into the monitor.
    InitialState = 8,
    /// Corrected measurements of an epoch or of a group of its satellites, into the monitor.
    CorrectedObservations = 9,
    /// The requirements of a scenario, into the monitor.
    ReferenceModel = 10,
    /// A sample of one of several inertial units, into the monitor.
    UnitSample = 11,
    /// A sample of a barometer, into the monitor.
    Pressure = 12,
    /// A sample of a magnetometer, into the monitor.
    MagneticField = 13,
    /// The aids there are, into the monitor.
    Aids = 15,
    /// How late the receiver's epochs arrive, into the monitor.
    ReceiverLatency = 34,
    /// What is known of one of several inertial units, into the monitor.
    Unit = 14,
    /// What the monitor says of an epoch.
    Report = 16,
    /// How much input was lost and why, out of the monitor.
    Counters = 17,
    /// The sender has failed and withdraws its output: nothing it sent may be used any longer; empty.
    OutputInvalid = 18,
    /// The tests of the bank of filters at an epoch, before its report.
    Bank = 19,
    /// The satellites of an epoch, after its report.
    Satellites = 20,
    /// The inertial side at an epoch, after its report.
    InertialReport = 21,
    /// What is known of a magnetometer and of the field where it is, into the monitor.
    Magnetometer = 32,
    /// The receiver's own solution, into the monitor.
    ReceiverFix = 33,
}

impl Kind {
    /// The kind of a number in a frame.
    pub const fn from_u8(number: u8) -> Option<Self> {
        Some(match number {
            1 => Self::Configuration,
            2 => Self::Observations,
            3 => Self::Ephemeris,
            4 => Self::Klobuchar,
            5 => Self::EndOfStream,
            6 => Self::Inertial,
            7 => Self::Imu,
            8 => Self::InitialState,
            9 => Self::CorrectedObservations,
            10 => Self::ReferenceModel,
            11 => Self::UnitSample,
            12 => Self::Pressure,
            13 => Self::MagneticField,
            15 => Self::Aids,
            34 => Self::ReceiverLatency,
            14 => Self::Unit,
            16 => Self::Report,
            17 => Self::Counters,
            18 => Self::OutputInvalid,
            19 => Self::Bank,
            20 => Self::Satellites,
            21 => Self::InertialReport,
            32 => Self::Magnetometer,
            33 => Self::ReceiverFix,
            _ => return None,
        })
    }
}

/// The output buffer or the frame is full.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Full;

/// Why a number could not be read from a payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadError {
    /// The payload ends before the number does.
    Truncated,
    /// A NaN or an infinity.
    NotFinite,
}

/// Why bytes are not a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// More bytes are needed; `needed` counts from the first byte, as far as it is known.
    Incomplete {
        /// Bytes needed in all.
        needed: usize,
    },
    /// The first three bytes are not the preamble and a version.
    NoPreamble,
    /// Another version.
    Version {
        /// The version found.
        version: u8,
    },
    /// The length field names more than [`MAX_PAYLOAD`].
    TooLong {
        /// The length found.
        payload_len: u16,
    },
    /// The checksum is not that of the content.
    BadCrc,
}

/// A view of one frame whose length, version and checksum are right. The kind may be one that is
/// not known here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    kind: u8,
    payload: &'a [u8],
}

impl<'a> Frame<'a> {
    /// Length in bytes of the frame that starts at `bytes`, as far as it can be told without its end:
    /// checks preamble, version and length field.
    pub fn expected_len(bytes: &[u8]) -> Result<usize, FrameError> {
        let incomplete = FrameError::Incomplete { needed: HEADER_LEN };
        // Byte by byte, so that a false start is known for one as soon as it can be.
        match bytes.first() {
            Some(&PREAMBLE_1) => {}
            Some(_) => return Err(FrameError::NoPreamble),
            None => return Err(incomplete),
        }
        match bytes.get(1) {
            Some(&PREAMBLE_2) => {}
            Some(_) => return Err(FrameError::NoPreamble),
            None => return Err(incomplete),
        }
        match bytes.get(2) {
            Some(&VERSION) => {}
            Some(&version) if version < VERSION_END => return Err(FrameError::Version { version }),
            Some(_) => return Err(FrameError::NoPreamble),
            None => return Err(incomplete),
        }
        let (Some(&low), Some(&high)) = (bytes.get(4), bytes.get(5)) else {
            return Err(incomplete);
        };
        let payload_len = u16::from_le_bytes([low, high]);
        if payload_len as usize > MAX_PAYLOAD {
            return Err(FrameError::TooLong { payload_len });
        }
        Ok(HEADER_LEN + payload_len as usize + TRAILER_LEN)
    }

    /// The frame at the start of `bytes`, and its length in bytes.
    pub fn parse(bytes: &'a [u8]) -> Result<(Self, usize), FrameError> {
        let needed = Self::expected_len(bytes)?;
        let frame = bytes
            .get(..needed)
            .ok_or(FrameError::Incomplete { needed })?;
        let (content, crc) = frame
            .split_last_chunk::<TRAILER_LEN>()
            .ok_or(FrameError::Incomplete { needed })?;
        let covered = content.get(2..).ok_or(FrameError::NoPreamble)?;
        if crc32(covered) != u32::from_le_bytes(*crc) {
            return Err(FrameError::BadCrc);
        }
        let view = Self::from_checked(frame).ok_or(FrameError::Incomplete { needed })?;
        Ok((view, needed))
    }

    /// The view of a whole frame that [`Frame::parse`] accepted before.
    pub(super) fn from_checked(frame: &'a [u8]) -> Option<Self> {
        let (content, _) = frame.split_last_chunk::<TRAILER_LEN>()?;
        Some(Self {
            kind: *content.get(3)?,
            payload: content.get(HEADER_LEN..)?,
        })
    }

    /// What the frame carries; `None` for a kind that is not known here.
    pub const fn kind(&self) -> Option<Kind> {
        Kind::from_u8(self.kind)
    }

    /// The number of the kind as it stands in the frame.
    pub const fn kind_number(&self) -> u8 {
        self.kind
    }

    /// The payload.
    pub const fn payload(&self) -> &'a [u8] {
        self.payload
    }

    /// A reader at the start of the payload.
    pub const fn reader(&self) -> Reader<'a> {
        Reader::new(self.payload)
    }
}

/// Writes numbers into a buffer one after the other.
#[derive(Debug)]
pub struct Writer<'a> {
    out: &'a mut [u8],
    len: usize,
}

impl<'a> Writer<'a> {
    /// Starts at the beginning of `out`.
    pub const fn new(out: &'a mut [u8]) -> Self {
        Self { out, len: 0 }
    }

    /// Bytes written.
    pub const fn len(&self) -> usize {
        self.len
    }

    /// Whether nothing was written.
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Appends bytes as they are.
    pub fn put_bytes(&mut self, bytes: &[u8]) -> Result<(), Full> {
        let end = self.len.checked_add(bytes.len()).ok_or(Full)?;
        let place = self.out.get_mut(self.len..end).ok_or(Full)?;
        place
            .iter_mut()
            .zip(bytes)
            .for_each(|(to, byte)| *to = *byte);
        self.len = end;
        Ok(())
    }

    /// Appends a byte.
    pub fn put_u8(&mut self, value: u8) -> Result<(), Full> {
        self.put_bytes(&[value])
    }

    /// Appends a u16.
    pub fn put_u16(&mut self, value: u16) -> Result<(), Full> {
        self.put_bytes(&value.to_le_bytes())
    }

    /// Appends a u32.
    pub fn put_u32(&mut self, value: u32) -> Result<(), Full> {
        self.put_bytes(&value.to_le_bytes())
    }

    /// Appends a u64.
    pub fn put_u64(&mut self, value: u64) -> Result<(), Full> {
        self.put_bytes(&value.to_le_bytes())
    }

    /// Appends an i64.
    pub fn put_i64(&mut self, value: i64) -> Result<(), Full> {
        self.put_bytes(&value.to_le_bytes())
    }

    /// Appends the bits of an f64. A NaN or an infinity can be written but will not be read.
    pub fn put_f64(&mut self, value: f64) -> Result<(), Full> {
        self.put_u64(value.to_bits())
    }

    /// Appends the bits of an f32. A NaN or an infinity can be written but will not be read.
    pub fn put_f32(&mut self, value: f32) -> Result<(), Full> {
        self.put_u32(value.to_bits())
    }
}

/// Reads numbers from a payload one after the other.
#[derive(Clone, Copy, Debug)]
pub struct Reader<'a> {
    rest: &'a [u8],
}

impl<'a> Reader<'a> {
    /// Starts at the beginning of `payload`.
    pub const fn new(payload: &'a [u8]) -> Self {
        Self { rest: payload }
    }

    /// Bytes not read yet.
    pub const fn left(&self) -> usize {
        self.rest.len()
    }

    /// The next `N` bytes as they are.
    pub fn bytes<const N: usize>(&mut self) -> Result<[u8; N], ReadError> {
        let (chunk, rest) = self
            .rest
            .split_first_chunk::<N>()
            .ok_or(ReadError::Truncated)?;
        self.rest = rest;
        Ok(*chunk)
    }

    /// A byte.
    pub fn u8(&mut self) -> Result<u8, ReadError> {
        self.bytes().map(u8::from_le_bytes)
    }

    /// A u16.
    pub fn u16(&mut self) -> Result<u16, ReadError> {
        self.bytes().map(u16::from_le_bytes)
    }

    /// A u32.
    pub fn u32(&mut self) -> Result<u32, ReadError> {
        self.bytes().map(u32::from_le_bytes)
    }

    /// A u64.
    pub fn u64(&mut self) -> Result<u64, ReadError> {
        self.bytes().map(u64::from_le_bytes)
    }

    /// An i64.
    pub fn i64(&mut self) -> Result<i64, ReadError> {
        self.bytes().map(i64::from_le_bytes)
    }

    /// A finite f64.
    pub fn f64(&mut self) -> Result<f64, ReadError> {
        let value = f64::from_bits(self.u64()?);
        if value.is_finite() {
            Ok(value)
        } else {
            Err(ReadError::NotFinite)
        }
    }

    /// A finite f32.
    pub fn f32(&mut self) -> Result<f32, ReadError> {
        let value = f32::from_bits(self.u32()?);
        if value.is_finite() {
            Ok(value)
        } else {
            Err(ReadError::NotFinite)
        }
    }
}

/// Writes one frame to the start of `out` and tells its length in bytes; `fill` writes the payload.
///
/// Nothing in `out` is to be used when it does not fit.
pub fn encode(
    kind: Kind,
    out: &mut [u8],
    fill: impl FnOnce(&mut Writer<'_>) -> Result<(), Full>,
) -> Result<usize, Full> {
    let header = out.get_mut(..HEADER_LEN).ok_or(Full)?;
    let mut writer = Writer::new(header);
    writer.put_bytes(&[PREAMBLE_1, PREAMBLE_2, VERSION, kind as u8])?;

    let room = out.get_mut(HEADER_LEN..).ok_or(Full)?;
    let longest = if room.len() < MAX_PAYLOAD {
        room.len()
    } else {
        MAX_PAYLOAD
    };
    let mut writer = Writer::new(room.get_mut(..longest).ok_or(Full)?);
    fill(&mut writer)?;
    let payload_len = writer.len();

    let length = out.get_mut(4..HEADER_LEN).ok_or(Full)?;
    Writer::new(length).put_u16(payload_len as u16)?;
    let end = HEADER_LEN + payload_len;
    let crc = crc32(out.get(2..end).ok_or(Full)?);
    Writer::new(out.get_mut(end..).ok_or(Full)?).put_u32(crc)?;
    Ok(end + TRAILER_LEN)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(out: &mut [u8]) -> Result<usize, Full> {
        encode(Kind::Report, out, |w| {
            w.put_u8(7)?;
            w.put_u16(0x1234)?;
            w.put_i64(-5)?;
            w.put_f64(0.1)?;
            w.put_f32(-2.5)
        })
    }

    #[test]
    fn what_was_written_is_read() {
        let mut out = [0; 64];
        let len = sample(&mut out).unwrap();
        let (frame, used) = Frame::parse(&out).unwrap();
        assert_eq!((frame.kind(), used), (Some(Kind::Report), len));
        let mut r = frame.reader();
        assert_eq!(r.u8(), Ok(7));
        assert_eq!(r.u16(), Ok(0x1234));
        assert_eq!(r.i64(), Ok(-5));
        assert_eq!(r.f64(), Ok(0.1));
        assert_eq!(r.f32(), Ok(-2.5));
        assert_eq!((r.left(), r.u8()), (0, Err(ReadError::Truncated)));
    }

    #[test]
    fn bytes_of_the_layout_are_these() {
        // The checksum is zlib's crc32 of 01 05 00 00, computed with Python's zlib.
        let mut out = [0; 10];
        assert_eq!(encode(Kind::EndOfStream, &mut out, |_| Ok(())), Ok(10));
        assert_eq!(out[..6], [0x53, 0x46, 1, 5, 0, 0]);
        assert_eq!(
            u32::from_le_bytes([out[6], out[7], out[8], out[9]]),
            0x9F33_7A92
        );
    }

    #[test]
    fn any_flipped_bit_is_noticed() {
        let mut out = [0; 64];
        let len = sample(&mut out).unwrap();
        for bit in 0..len * 8 {
            let mut damaged = out;
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert!(Frame::parse(&damaged[..len]).is_err(), "bit {bit}");
        }
        for cut in 0..len {
            assert!(matches!(
                Frame::parse(&out[..cut]),
                Err(FrameError::Incomplete { .. })
            ));
        }
    }

    #[test]
    fn too_small_a_buffer_is_refused_at_every_size() {
        let mut out = [0; 64];
        let len = sample(&mut out).unwrap();
        for size in 0..len {
            assert_eq!(sample(&mut out[..size]), Err(Full));
        }
        let mut big = [0; MAX_FRAME + 100];
        let too_long = encode(Kind::Report, &mut big, |w| {
            (0..=MAX_PAYLOAD).try_for_each(|_| w.put_u8(0))
        });
        assert_eq!(too_long, Err(Full));
        assert_eq!(
            Frame::parse(&[0x53, 0x46, 1, 2, 0x01, 0x04]),
            Err(FrameError::TooLong { payload_len: 1025 })
        );
    }

    #[test]
    fn numbers_that_are_none_are_not_read() {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let bytes = value.to_le_bytes();
            assert_eq!(Reader::new(&bytes).f64(), Err(ReadError::NotFinite));
            let bytes = (value as f32).to_le_bytes();
            assert_eq!(Reader::new(&bytes).f32(), Err(ReadError::NotFinite));
        }
    }
}
