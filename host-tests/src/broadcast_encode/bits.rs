//! A row of bits that grows, most significant bit first.

use anyhow::{Result, bail};

use super::PI;

/// Bits in order of transmission.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Bits(Vec<bool>);

impl Bits {
    /// Adds an unsigned number.
    pub fn unsigned(&mut self, width: u32, value: u64) -> Result<&mut Self> {
        if width < 64 && value >> width != 0 {
            bail!("{value} does not fit {width} bits");
        }
        self.0
            .extend((0..width).rev().map(|place| value >> place & 1 == 1));
        Ok(self)
    }

    /// Adds a two's complement number of steps.
    pub fn signed(&mut self, width: u32, value: f64, step: f64) -> Result<&mut Self> {
        let steps = libm::round(value / step);
        let half = libm::ldexp(1.0, width as i32 - 1);
        // Written so that NaN is refused.
        if !(steps >= -half && steps < half) {
            bail!("{value} does not fit {width} bits with steps of {step}");
        }
        let kept = (steps as i64 as u64) & ((1 << width) - 1);
        self.unsigned(width, kept)
    }

    /// Adds an angle or its rate, radians, as semicircles.
    pub fn semicircles(&mut self, width: u32, angle_rad: f64, step: f64) -> Result<&mut Self> {
        self.signed(width, angle_rad / PI, step)
    }

    /// Adds an unsigned number of steps.
    pub fn steps(&mut self, width: u32, value: f64, step: f64) -> Result<&mut Self> {
        let steps = libm::round(value / step);
        if !(steps >= 0.0 && steps < libm::ldexp(1.0, width as i32)) {
            bail!("{value} does not fit {width} bits with steps of {step}");
        }
        self.unsigned(width, steps as u64)
    }

    /// Adds ones and zeros in turn up to a length.
    pub fn alternate_to(&mut self, length: usize) -> &mut Self {
        let mut bit = true;
        while self.0.len() < length {
            self.0.push(bit);
            bit = !bit;
        }
        self
    }

    /// Adds zeros up to a length.
    pub fn zeros_to(&mut self, length: usize) -> &mut Self {
        if self.0.len() < length {
            self.0.resize(length, false);
        }
        self
    }

    /// Adds other bits.
    pub fn extend(&mut self, bits: &[bool]) -> &mut Self {
        self.0.extend(bits);
        self
    }

    /// The bits.
    pub fn as_slice(&self) -> &[bool] {
        &self.0
    }
}

/// Up to 32 bits as a number.
pub fn number(bits: &[bool]) -> u32 {
    bits.iter().fold(0, |sum, bit| sum << 1 | u32::from(*bit))
}

/// CRC-24Q of a row of bits. [GAL-OS-SIS-ICD] 5.1.9.4.
pub fn crc24q(bits: &[bool]) -> u32 {
    bits.iter().fold(0, |remainder, bit| {
        let feedback = (remainder >> 23 & 1 == 1) != *bit;
        (remainder << 1 & 0xff_ffff) ^ if feedback { 0x86_4cfb } else { 0 }
    })
}
