//! Bit fields, most significant bit first, as RTCM 3 packs them.
//!
//! Bit 0 is the highest bit of the first byte. Every read is checked against the length and
//! answers `None` beyond it.

/// Widest field that can be read at once, bits.
pub const MAX_WIDTH: u32 = 57;

/// A view of bytes as bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bits<'a> {
    bytes: &'a [u8],
}

impl<'a> Bits<'a> {
    /// The bits of these bytes.
    pub const fn new(bytes: &'a [u8]) -> Self {
        Self { bytes }
    }

    /// Number of bits.
    pub const fn len(&self) -> usize {
        self.bytes.len().saturating_mul(8)
    }

    /// Whether there is none.
    pub const fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// The unsigned number in bits `offset .. offset + width`; `None` beyond the end, and for a
    /// width of 0 or above [`MAX_WIDTH`].
    #[inline]
    pub fn unsigned(&self, offset: usize, width: u32) -> Option<u64> {
        if width == 0 || width > MAX_WIDTH || offset.checked_add(width as usize)? > self.len() {
            return None;
        }
        let from = self.bytes.get(offset / 8..)?;
        let word = match from.first_chunk::<8>() {
            Some(chunk) => u64::from_be_bytes(*chunk),
            None => {
                // The last seven bytes: what lies beyond them is shifted out below.
                let mut padded = [0_u8; 8];
                padded
                    .iter_mut()
                    .zip(from)
                    .for_each(|(to, byte)| *to = *byte);
                u64::from_be_bytes(padded)
            }
        };
        let skipped = (offset % 8) as u32;
        Some((word << skipped) >> ((64 - width) & 63))
    }

    /// The two's complement number in bits `offset .. offset + width`.
    #[inline]
    pub fn signed(&self, offset: usize, width: u32) -> Option<i64> {
        let raw = self.unsigned(offset, width)?;
        let unused = (64 - width) & 63;
        Some(((raw << unused) as i64) >> unused)
    }

    /// The sign and magnitude number in bits `offset .. offset + width`; both zeros give 0.
    #[inline]
    pub fn sign_magnitude(&self, offset: usize, width: u32) -> Option<i64> {
        let raw = self.unsigned(offset, width)?;
        let sign = 1_u64 << ((width - 1) & 63);
        let magnitude = (raw & (sign - 1)) as i64;
        Some(if raw & sign == 0 {
            magnitude
        } else {
            -magnitude
        })
    }
}

/// Reads fields one after the other.
#[derive(Clone, Copy, Debug)]
pub struct BitCursor<'a> {
    bits: Bits<'a>,
    position: usize,
}

impl<'a> BitCursor<'a> {
    /// Starts at bit `position`.
    pub const fn new(bits: Bits<'a>, position: usize) -> Self {
        Self { bits, position }
    }

    /// The next bit to be read.
    pub const fn position(&self) -> usize {
        self.position
    }

    /// Passes over `width` bits.
    pub fn skip(&mut self, width: usize) {
        self.position = self.position.saturating_add(width);
    }

    /// The next `width` bits, unsigned.
    #[inline]
    pub fn unsigned(&mut self, width: u32) -> Option<u64> {
        let value = self.bits.unsigned(self.position, width)?;
        self.skip(width as usize);
        Some(value)
    }

    /// The next `width` bits, two's complement.
    #[inline]
    pub fn signed(&mut self, width: u32) -> Option<i64> {
        let value = self.bits.signed(self.position, width)?;
        self.skip(width as usize);
        Some(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_across_bytes_come_out_most_significant_first() {
        let bits = Bits::new(&[0b1010_0101, 0b1100_0011, 0xFF]);
        assert_eq!(bits.unsigned(0, 4), Some(0b1010));
        assert_eq!(bits.unsigned(4, 8), Some(0b0101_1100));
        assert_eq!(bits.unsigned(0, 24), Some(0xA5_C3FF));
        assert_eq!(bits.unsigned(23, 1), Some(1));
        assert_eq!(bits.unsigned(8, 2), Some(0b11));
    }

    #[test]
    fn every_width_and_offset_agrees_with_a_bit_by_bit_reader() {
        let bytes: std::vec::Vec<u8> = (0..24_u32)
            .map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8)
            .collect();
        let bits = Bits::new(&bytes);
        for offset in 0..bytes.len() * 8 + 2 {
            for width in 0..=MAX_WIDTH + 1 {
                let legal =
                    (1..=MAX_WIDTH).contains(&width) && offset + width as usize <= bytes.len() * 8;
                let expected = legal.then(|| {
                    (offset..offset + width as usize).fold(0_u64, |value, bit| {
                        value << 1 | u64::from(bytes[bit / 8] >> (7 - bit % 8) & 1)
                    })
                });
                assert_eq!(bits.unsigned(offset, width), expected, "{offset} {width}");
            }
        }
    }

    #[test]
    fn signs_of_both_kinds() {
        let bits = Bits::new(&[0b1000_0011, 0b0000_0011]);
        assert_eq!(bits.signed(0, 8), Some(-125));
        assert_eq!(bits.signed(8, 8), Some(3));
        assert_eq!(bits.sign_magnitude(0, 8), Some(-3));
        assert_eq!(bits.sign_magnitude(8, 8), Some(3));
        assert_eq!(bits.sign_magnitude(0, 1), Some(0));
        assert_eq!(bits.signed(0, 1), Some(-1));
    }

    #[test]
    fn nothing_is_read_beyond_the_end() {
        let bits = Bits::new(&[0xFF]);
        assert_eq!(bits.unsigned(0, 9), None);
        assert_eq!(bits.unsigned(8, 1), None);
        assert_eq!(bits.unsigned(usize::MAX, 8), None);
        let mut cursor = BitCursor::new(bits, 0);
        assert_eq!(cursor.unsigned(5), Some(31));
        assert_eq!(cursor.unsigned(5), None);
        assert_eq!(cursor.signed(3), Some(-1));
    }
}
