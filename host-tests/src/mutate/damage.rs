//! Ways to damage a stream.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng as _;
use surefix_core::wire::crc::{crc24q, crc32};
use surefix_core::wire::ubx;

/// One kind of damage; where it strikes is drawn when it does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Damage {
    /// A bit changes.
    Flip,
    /// Bytes change.
    Overwrite,
    /// Bytes are lost.
    Delete,
    /// Bytes come in.
    Insert,
    /// Heads of frames come in.
    InsertHead,
    /// A part comes twice.
    Duplicate,
    /// Two parts change places.
    Swap,
    /// The rest is lost.
    Cut,
    /// The length field of a frame changes.
    Length,
    /// The content of a frame changes, and its checksum is made right again.
    Repair,
}

/// A number below `n`, 0 for 0.
pub fn below(random: &mut ChaCha8Rng, n: usize) -> usize {
    // The bias of a remainder does not matter here.
    (random.next_u64() % (n.max(1) as u64)) as usize
}

impl Damage {
    /// Draws one; single bits are what a line does most.
    pub fn draw(random: &mut ChaCha8Rng) -> Self {
        match below(random, 14) {
            0..3 => Self::Flip,
            3 | 4 => Self::Overwrite,
            5 => Self::Delete,
            6 => Self::Insert,
            7 => Self::InsertHead,
            8 => Self::Duplicate,
            9 => Self::Swap,
            10 => Self::Cut,
            11 => Self::Length,
            _ => Self::Repair,
        }
    }

    /// Whether frames that were never sent pass their checksum afterwards.
    pub const fn repairs_checksums(self) -> bool {
        matches!(self, Self::Repair)
    }

    /// Does it.
    pub fn apply(self, stream: &mut Vec<u8>, random: &mut ChaCha8Rng) {
        let n = stream.len();
        if n == 0 {
            return;
        }
        let at = below(random, n);
        let length = (1 + below(random, 4000)).min(n - at);
        match self {
            Self::Flip => stream[at] ^= 1 << below(random, 8),
            Self::Overwrite => {
                let length = length.min(40);
                random.fill_bytes(&mut stream[at..at + length]);
            }
            Self::Delete => drop(stream.drain(at..at + length)),
            Self::Insert => {
                let mut bytes = vec![0; length];
                random.fill_bytes(&mut bytes);
                stream.splice(at..at, bytes);
            }
            Self::InsertHead => {
                let heads: [&[u8]; 7] = [
                    &[0xB5, 0x62, 0x02, 0x15, 0x30, 0x00],
                    &[0xB5, 0x62, 0x02, 0x13, 0x30, 0x00],
                    &[0xB5, 0x62, 0x01, 0x07, 0xF0, 0x1F],
                    &[0xD3, 0x03, 0xFF],
                    &[0xD3, 0x00, 0x13],
                    b"SF\x01\x02\x00\x04",
                    b"$GNGGA,",
                ];
                let head = heads[below(random, heads.len())];
                stream.splice(at..at, head.iter().copied());
            }
            Self::Duplicate => {
                let part = stream[at..at + length].to_vec();
                stream.splice(at..at, part);
            }
            Self::Swap => {
                let second = at + length..(at + 2 * length).min(n);
                let swapped = [&stream[second.clone()], &stream[at..at + length]].concat();
                stream.splice(at..second.end, swapped);
            }
            Self::Cut => stream.truncate(at),
            Self::Length => {
                let bit = below(random, 16);
                if let Some(frame) = Frame::at_or_after(stream, at) {
                    stream[frame.length_at + bit / 8] ^= 1 << (bit % 8);
                }
            }
            Self::Repair => {
                if let Some(frame) = Frame::at_or_after(stream, at) {
                    for _ in 0..=below(random, 4) {
                        let k = frame.content.start + below(random, frame.content.len());
                        stream[k] ^= (1 + below(random, 255)) as u8;
                    }
                    frame.repair(stream);
                }
            }
        }
    }
}

#[derive(Clone, Copy)]
enum Protocol {
    Ubx,
    Rtcm3,
    Native,
}

/// A frame with a right checksum, as positions in the stream.
struct Frame {
    protocol: Protocol,
    start: usize,
    length_at: usize,
    content: core::ops::Range<usize>,
}

impl Frame {
    fn at_or_after(stream: &[u8], at: usize) -> Option<Self> {
        (at..stream.len()).find_map(|start| Self::at(stream, start))
    }

    fn at(stream: &[u8], start: usize) -> Option<Self> {
        let rest = stream.get(start..)?;
        let (protocol, length_at, content) = match rest {
            [0xB5, 0x62, _, _, low, high, ..] => {
                let length = usize::from(u16::from_le_bytes([*low, *high]));
                (Protocol::Ubx, 4, 6..6 + length)
            }
            [0xD3, high, low, ..] if high & 0xFC == 0 => {
                let length = usize::from(u16::from_be_bytes([*high, *low]));
                (Protocol::Rtcm3, 1, 3..3 + length)
            }
            [b'S', b'F', 1, _, low, high, ..] => {
                let length = usize::from(u16::from_le_bytes([*low, *high]));
                (Protocol::Native, 4, 6..6 + length)
            }
            _ => return None,
        };
        let frame = Self {
            protocol,
            start,
            length_at: start + length_at,
            content: start + content.start..start + content.end,
        };
        let is_right = !frame.content.is_empty()
            && frame.checksum(stream).is_some_and(|sum| {
                stream
                    .get(frame.content.end..)
                    .is_some_and(|s| s.starts_with(&sum))
            });
        is_right.then_some(frame)
    }

    fn checksum(&self, stream: &[u8]) -> Option<Vec<u8>> {
        Some(match self.protocol {
            Protocol::Ubx => ubx::checksum(stream.get(self.start + 2..self.content.end)?).to_vec(),
            Protocol::Rtcm3 => {
                crc24q(stream.get(self.start..self.content.end)?).to_be_bytes()[1..].to_vec()
            }
            Protocol::Native => crc32(stream.get(self.start + 2..self.content.end)?)
                .to_le_bytes()
                .to_vec(),
        })
    }

    fn repair(&self, stream: &mut [u8]) {
        if let Some(sum) = self.checksum(stream) {
            stream[self.content.end..self.content.end + sum.len()].copy_from_slice(&sum);
        }
    }
}
