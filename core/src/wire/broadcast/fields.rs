//! Fields of broadcast messages in order, and the bits of their words one after the other.

use crate::wire::bits::{BitCursor, Bits};

/// 2 to the power −`exponent`, exact.
pub(in crate::wire) const fn two_to_minus(exponent: u32) -> f64 {
    1.0 / (1_u64 << (exponent & 63)) as f64
}

/// Reads fields in order; the first that is missing makes the rest missing.
pub(in crate::wire) struct Fields<'a> {
    pub(in crate::wire) cursor: BitCursor<'a>,
    pub(in crate::wire) is_complete: bool,
}

impl<'a> Fields<'a> {
    /// The fields from bit `position` on.
    pub(in crate::wire) const fn new(bits: Bits<'a>, position: usize) -> Self {
        Self {
            cursor: BitCursor::new(bits, position),
            is_complete: true,
        }
    }

    pub(in crate::wire) fn unsigned(&mut self, width: u32) -> u64 {
        let value = self.cursor.unsigned(width);
        self.is_complete &= value.is_some();
        value.unwrap_or(0)
    }

    pub(in crate::wire) fn signed(&mut self, width: u32) -> i64 {
        let value = self.cursor.signed(width);
        self.is_complete &= value.is_some();
        value.unwrap_or(0)
    }

    /// A signed field in units of 2 to the power −`exponent`.
    pub(in crate::wire) fn scaled(&mut self, width: u32, exponent: u32) -> f64 {
        self.signed(width) as f64 * two_to_minus(exponent)
    }

    /// An unsigned field in units of 2 to the power −`exponent`.
    pub(in crate::wire) fn scaled_unsigned(&mut self, width: u32, exponent: u32) -> f64 {
        self.unsigned(width) as f64 * two_to_minus(exponent)
    }
}

/// Writes fields of up to 57 bits one after the other, the last byte filled up with zeros.
pub(super) struct Packer<'a> {
    bytes: core::slice::IterMut<'a, u8>,
    held: u64,
    n_held: u32,
}

impl<'a> Packer<'a> {
    /// Writes from the first bit of `bytes` on; what does not fit is dropped.
    pub(super) fn new(bytes: &'a mut [u8]) -> Self {
        Self {
            bytes: bytes.iter_mut(),
            held: 0,
            n_held: 0,
        }
    }

    /// The low `width` bits of `value`.
    pub(super) fn put(&mut self, value: u64, width: u32) {
        let width = if width < 57 { width } else { 57 };
        // At most 7 bits are held, so that 64 is never passed.
        self.held = self.held << width | value & ((1 << width) - 1);
        self.n_held += width;
        while self.n_held >= 8 {
            self.n_held -= 8;
            if let Some(byte) = self.bytes.next() {
                *byte = (self.held >> (self.n_held & 63)) as u8;
            }
        }
    }

    /// Fills up the last byte.
    pub(super) fn end(mut self) {
        let missing = (8 - self.n_held) % 8;
        self.put(0, missing);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_packed_is_read_back() {
        let widths = [57, 1, 22, 24, 7, 57, 0, 3, 57];
        let mut bytes = [0xA5; 32];
        let value = |i: usize| 0x9E37_79B9_7F4A_7C15_u64.rotate_left(7 * i as u32);
        let mut packer = Packer::new(&mut bytes);
        for (i, width) in widths.into_iter().enumerate() {
            packer.put(value(i), width);
        }
        packer.end();
        let mut cursor = BitCursor::new(Bits::new(&bytes), 0);
        for (i, width) in widths.into_iter().enumerate().filter(|(_, w)| *w != 0) {
            assert_eq!(cursor.unsigned(width), Some(value(i) & ((1 << width) - 1)));
        }
        assert_eq!(cursor.unsigned(4), Some(0), "filled up with zeros");
        assert_eq!(bytes[29], 0xA5, "and no further");
        let mut short = [0; 2];
        let mut packer = Packer::new(&mut short);
        packer.put(0x12_3456, 24);
        packer.end();
        assert_eq!(short, [0x12, 0x34]);
    }
}
