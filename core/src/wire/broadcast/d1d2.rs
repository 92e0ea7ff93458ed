//! BDS D1 (MEO, IGSO) and D2 (GEO): subframes of ten words of 30 bits in codes BCH(15, 11, 1).
//!
//! u-blox gives each word deinterleaved: the data bits of both codes, then the parity of the first and
//! of the second, below two bits of filling. The first half of word 1 has no code.
//! [BDS-SIS-ICD-B1I] 5.1.3, [UBX-F9K-INT] 3.11.1.4
//!
//! The code is perfect: every 15 bits are a code word or one bit away from one, and a receiver that
//! corrects makes a code word of anything. A right code therefore says nothing about two errors and
//! more, and one error is refused here, for a receiver that does not correct gives no reason to
//! believe in one rather than in two. Hence the rule of `mod.rs` that a part counts when it was
//! heard twice alike.

use super::ephemeris::{BroadcastEphemeris, BroadcastKlobuchar, Source};
use super::fields::{Fields, Packer, two_to_minus};
use super::slot::Slot;
use super::{Subframe, SubframeError, check_time, klobuchar};
use crate::wire::bits::Bits;

/// Remainder of 15 bits by X⁴ + X + 1: 0 for a code word. [BDS-SIS-ICD-B1I] 5.1.3
fn remainder(mut bits: u32) -> u32 {
    for shift in (0..11).rev() {
        if bits >> (shift + 4) & 1 != 0 {
            bits ^= 0b1_0011 << shift;
        }
    }
    bits
}

/// A subframe of either message.
pub(super) struct D1D2 {
    /// 1 to 5.
    pub(super) number: u32,
    /// Seconds of the BDT week at its beginning.
    pub(super) sow_s: u32,
    /// Data of words 2 to 10 behind the time: 186 bits.
    pub(super) data: [u8; 24],
}

impl D1D2 {
    /// Checks length, preamble, codes, number and time.
    pub(super) fn parse(subframe: &Subframe<'_>) -> Result<Self, SubframeError> {
        if subframe.words.len() != 40 {
            return Err(SubframeError::Length);
        }
        let mut first = 0;
        let mut sow_s = 0;
        let mut data = [0; 24];
        let mut packer = Packer::new(&mut data);
        for (i, word) in subframe.dwords().enumerate() {
            let (upper, lower) = (word >> 19 & 0x7FF, word >> 8 & 0x7FF);
            let is_right = if i == 0 {
                remainder(word & 0x7FFF) == 0
            } else {
                remainder(upper << 4 | word >> 4 & 0xF) == 0
                    && remainder(lower << 4 | word & 0xF) == 0
            };
            if !is_right {
                return Err(SubframeError::Parity);
            }
            match i {
                0 => first = word,
                1 => {
                    // [BDS-SIS-ICD-B1I] 5.2.4.2
                    sow_s = (first >> 4 & 0xFF) << 12 | upper << 1 | lower >> 10;
                    packer.put(u64::from(lower & 0x3FF), 10);
                }
                _ => packer.put(u64::from(upper << 11 | lower), 22),
            }
        }
        packer.end();
        // [BDS-SIS-ICD-B1I] 5.2.4.1
        if first >> 19 & 0x7FF != 0b111_0001_0010 {
            return Err(SubframeError::Preamble);
        }
        let number = first >> 12 & 7;
        if !(1..=5).contains(&number) {
            return Err(SubframeError::Number);
        }
        Ok(Self {
            number,
            sow_s: check_time(sow_s)?,
            data,
        })
    }

    /// Page of a subframe 1 of D2, and what it holds: 72 bits. [BDS-SIS-ICD-B1I] 5.3.2
    pub(super) fn page(&self) -> Result<(u32, [u8; 9]), SubframeError> {
        let mut f = Fields::new(Bits::new(&self.data), 0);
        let number = f.unsigned(4) as u32;
        if !(1..=10).contains(&number) {
            return Err(SubframeError::Number);
        }
        let mut page = [0; 9];
        let mut packer = Packer::new(&mut page);
        packer.put(f.unsigned(36), 36);
        packer.put(f.unsigned(36), 36);
        packer.end();
        Ok((number, page))
    }
}

/// The ionosphere of a D1 subframe 1. [BDS-SIS-ICD-B1I] 5.2.4.7, figure 5-8
pub(super) fn klobuchar_d1(slot: &Slot) -> BroadcastKlobuchar {
    klobuchar(
        &mut Fields::new(Bits::new(slot.part(0)), 60),
        Source::BdsD1D2,
    )
}

/// The ionosphere of page 2 of D2. [BDS-SIS-ICD-B1I] 5.3.3.2
pub(super) fn klobuchar_d2(slot: &Slot) -> BroadcastKlobuchar {
    klobuchar(
        &mut Fields::new(Bits::new(slot.part(1)), 0),
        Source::BdsD1D2,
    )
}

/// 0.1 ns. Divided, not multiplied by 1e-10, so that the nearest f64 to the decimal comes out.
fn group_delay_s(f: &mut Fields<'_>) -> f64 {
    f.signed(10) as f64 / 1e10
}

/// 2⁻⁶⁶ in two steps.
fn af2_sps2(f: &mut Fields<'_>) -> f64 {
    f.scaled(11, 33) * two_to_minus(33)
}

/// Subframes 1 to 3 of D1. [BDS-SIS-ICD-B1I] 5.2.4, figures 5-8 to 5-10
#[inline(never)]
pub(super) fn ephemeris_d1(slot: &Slot, satellite: u8) -> Option<BroadcastEphemeris> {
    let mut e = BroadcastEphemeris::ZERO;
    e.source = Source::BdsD1D2;
    e.satellite = satellite;

    let mut f = Fields::new(Bits::new(slot.part(0)), 0);
    e.health = f.unsigned(1) as u16;
    f.cursor.skip(5); // AODC
    e.accuracy_index = f.unsigned(4) as u8;
    e.week = f.unsigned(13) as u16;
    e.toc_s = f.unsigned(17) as u32 * 8;
    e.group_delay_s = [group_delay_s(&mut f), group_delay_s(&mut f)];
    f.cursor.skip(64); // ionosphere
    e.af2_sps2 = af2_sps2(&mut f);
    e.af0_s = f.scaled(24, 33);
    e.af1_sps = f.scaled(22, 50);
    e.issue = f.unsigned(5) as u16;
    let mut is_complete = f.is_complete;

    let mut f = Fields::new(Bits::new(slot.part(1)), 0);
    e.delta_n_scps = f.scaled(16, 43);
    e.cuc_rad = f.scaled(18, 31);
    e.m0_sc = f.scaled(32, 31);
    e.eccentricity = f.scaled_unsigned(32, 33);
    e.cus_rad = f.scaled(18, 31);
    e.crc_m = f.scaled(18, 6);
    e.crs_m = f.scaled(18, 6);
    e.sqrt_a = f.scaled_unsigned(32, 19);
    let toe_upper = f.unsigned(2);
    is_complete &= f.is_complete;

    let mut f = Fields::new(Bits::new(slot.part(2)), 0);
    e.toe_s = (toe_upper << 15 | f.unsigned(15)) as u32 * 8;
    e.i0_sc = f.scaled(32, 31);
    e.cic_rad = f.scaled(18, 31);
    e.omega_dot_scps = f.scaled(24, 43);
    e.cis_rad = f.scaled(18, 31);
    e.idot_scps = f.scaled(14, 43);
    e.omega0_sc = f.scaled(32, 31);
    e.argument_of_perigee_sc = f.scaled(32, 31);
    is_complete &= f.is_complete;
    is_complete.then_some(e)
}

/// The pages of a D2 subframe 1 one after the other, for fields that go over from one to the next.
struct Pages<'a> {
    slot: &'a Slot,
    f: Fields<'a>,
    is_complete: bool,
}

impl<'a> Pages<'a> {
    fn turn_to(&mut self, page: u32, position: usize) {
        self.is_complete &= self.f.is_complete;
        self.f = Fields::new(Bits::new(self.slot.part(page.saturating_sub(1))), position);
    }

    /// A signed field in units of 2 to the power −`exponent`, of which the next page has the last
    /// `lower` bits at its beginning.
    fn scaled_over(&mut self, upper: u32, lower: u32, next: u32, exponent: u32) -> f64 {
        let above = self.f.signed(upper);
        self.turn_to(next, 0);
        let value = above << (lower & 31) | self.f.unsigned(lower) as i64;
        value as f64 * two_to_minus(exponent)
    }
}

/// Pages 1 and 3 to 10 of subframe 1 of D2. [BDS-SIS-ICD-B1I] 5.3.2, 5.3.3.1, figures 5-13
#[inline(never)]
pub(super) fn ephemeris_d2(slot: &Slot, satellite: u8) -> Option<BroadcastEphemeris> {
    let mut e = BroadcastEphemeris::ZERO;
    e.source = Source::BdsD1D2;
    e.satellite = satellite;

    let mut pages = Pages {
        slot,
        f: Fields::new(Bits::new(slot.part(0)), 0),
        is_complete: true,
    };
    let p = &mut pages;
    e.health = p.f.unsigned(1) as u16;
    p.f.cursor.skip(5); // AODC
    e.accuracy_index = p.f.unsigned(4) as u8;
    e.week = p.f.unsigned(13) as u16;
    e.toc_s = p.f.unsigned(17) as u32 * 8;
    e.group_delay_s = [group_delay_s(&mut p.f), group_delay_s(&mut p.f)];
    p.turn_to(3, 38);
    e.af0_s = p.f.scaled(24, 33);
    e.af1_sps = p.scaled_over(4, 18, 4, 50);
    e.af2_sps2 = af2_sps2(&mut p.f);
    e.issue = p.f.unsigned(5) as u16;
    e.delta_n_scps = p.f.scaled(16, 43);
    e.cuc_rad = p.scaled_over(14, 4, 5, 31);
    e.m0_sc = p.f.scaled(32, 31);
    e.cus_rad = p.f.scaled(18, 31);
    let e_upper = p.f.unsigned(10);
    p.turn_to(6, 0);
    e.eccentricity = (e_upper << 22 | p.f.unsigned(22)) as f64 * two_to_minus(33);
    e.sqrt_a = p.f.scaled_unsigned(32, 19);
    e.cic_rad = p.scaled_over(10, 8, 7, 31);
    e.cis_rad = p.f.scaled(18, 31);
    e.toe_s = p.f.unsigned(17) as u32 * 8;
    e.i0_sc = p.scaled_over(21, 11, 8, 31);
    e.crc_m = p.f.scaled(18, 6);
    e.crs_m = p.f.scaled(18, 6);
    e.omega_dot_scps = p.scaled_over(19, 5, 9, 43);
    e.omega0_sc = p.f.scaled(32, 31);
    e.argument_of_perigee_sc = p.scaled_over(27, 5, 10, 31);
    e.idot_scps = p.f.scaled(14, 43);
    p.turn_to(10, 0);
    pages.is_complete.then_some(e)
}
