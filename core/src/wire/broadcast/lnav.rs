//! GPS LNAV: subframes of ten words of 24 data bits and 6 of parity.
//!
//! u-blox inverts a word, its parity too, when D30* is 1, so that the data bits are those of the source
//! ([UBX-F9K-INT] 3.11.1; that the parity goes along is what recordings of three generations of
//! receivers show). The parity equations hold for D29*, D30* and a word as for their inverse: what is left
//! of them is D30* = 0 and D29* + D30* for D29*, and that sum of the word before is the same
//! inverted or not. The two upper bits of each word are filling. [IS-GPS-200] 20.3.5.2, table 20-XIV

use super::ephemeris::{BroadcastEphemeris, BroadcastKlobuchar, Source};
use super::fields::{Fields, Packer};
use super::slot::Slot;
use super::{Subframe, SubframeError, check_time, klobuchar};
use crate::wire::bits::Bits;

/// The bits of a word, D29* uppermost, whose sum is even when D30* is 0, for D25 to D30.
/// [IS-GPS-200] table 20-XIV
const PARITY: [u32; 6] = [
    equation(
        true,
        [1, 2, 3, 5, 6, 10, 11, 12, 13, 14, 17, 18, 20, 23, 25],
    ),
    equation(
        false,
        [2, 3, 4, 6, 7, 11, 12, 13, 14, 15, 18, 19, 21, 24, 26],
    ),
    equation(true, [1, 3, 4, 5, 7, 8, 12, 13, 14, 15, 16, 19, 20, 22, 27]),
    equation(
        false,
        [2, 4, 5, 6, 8, 9, 13, 14, 15, 16, 17, 20, 21, 23, 28],
    ),
    equation(
        false,
        [1, 3, 5, 6, 7, 9, 10, 14, 15, 16, 17, 18, 21, 22, 24, 29],
    ),
    equation(true, [3, 5, 6, 8, 9, 10, 11, 13, 15, 19, 22, 23, 24, 30]),
];

const fn equation<const N: usize>(with_d29: bool, bits: [u32; N]) -> u32 {
    let mut mask = if with_d29 { 1 << 31 } else { 0 };
    let mut rest: &[u32] = &bits;
    while let [bit, more @ ..] = rest {
        mask |= 1 << ((30 - *bit) & 31);
        rest = more;
    }
    mask
}

/// Subframe 1 to 5, and what it holds.
pub(super) struct Lnav {
    /// 1 to 5.
    pub(super) number: u32,
    /// Beginning of the next subframe, s of week.
    pub(super) tow_s: u32,
    /// The alert flag of the hand-over word.
    pub(super) is_alert: bool,
    /// Data of words 3 to 10.
    pub(super) data: [u8; 24],
}

impl Lnav {
    /// Checks length, preamble, parity and hand-over word.
    pub(super) fn parse(subframe: &Subframe<'_>) -> Result<Self, SubframeError> {
        if subframe.words.len() != 40 {
            return Err(SubframeError::Length);
        }
        let (mut preamble, mut hand_over) = (0, 0);
        let mut data = [0; 24];
        let mut packer = Packer::new(&mut data);
        // D29 and D30 of the last word of a subframe are zeros. [IS-GPS-200] 20.3.3
        let mut sum_before = 0;
        for (i, word) in subframe.dwords().enumerate() {
            let word = word & 0x3FFF_FFFF | sum_before << 31;
            let is_odd = |mask: &u32| !(word & mask).count_ones().is_multiple_of(2);
            if PARITY.iter().any(is_odd) {
                return Err(SubframeError::Parity);
            }
            sum_before = (word >> 1 ^ word) & 1;
            let source = word >> 6 & 0xFF_FFFF;
            match i {
                0 => preamble = source >> 16,
                1 => hand_over = source,
                _ => packer.put(u64::from(source), 24),
            }
        }
        packer.end();
        // [IS-GPS-200] 20.3.3.1
        if preamble != 0x8B {
            return Err(SubframeError::Preamble);
        }
        // [IS-GPS-200] 20.3.3.2
        let number = hand_over >> 2 & 7;
        if !(1..=5).contains(&number) {
            return Err(SubframeError::Number);
        }
        Ok(Self {
            number,
            tow_s: check_time((hand_over >> 7) * 6)?,
            is_alert: hand_over >> 6 & 1 != 0,
            data,
        })
    }

    /// The ionosphere of subframe 4, page 18, whose number as of a satellite is 56.
    /// [IS-GPS-200] 20.3.3.5.1.7, tables 20-V and 20-X
    pub(super) fn klobuchar(&self) -> Option<BroadcastKlobuchar> {
        let mut f = Fields::new(Bits::new(&self.data), 2);
        (self.number == 4 && f.unsigned(6) == 56).then(|| klobuchar(&mut f, Source::GpsLnav))
    }
}

/// The ephemeris when subframes 1 to 3 are of one issue: the low byte of IODC is IODE of both others.
/// [IS-GPS-200] 20.3.3.4.1, tables 20-I, 20-II, 20-III
#[inline(never)]
pub(super) fn ephemeris(slot: &Slot, satellite: u8) -> Option<BroadcastEphemeris> {
    let mut e = BroadcastEphemeris::ZERO;
    e.source = Source::GpsLnav;
    e.satellite = satellite;

    let mut f = Fields::new(Bits::new(slot.part(0)), 0);
    e.week = f.unsigned(10) as u16;
    f.cursor.skip(2); // codes on L2
    e.accuracy_index = f.unsigned(4) as u8;
    e.health = f.unsigned(6) as u16;
    f.cursor.skip(2 + 1 + 87); // upper bits of IODC, L2 P data flag, reserved
    e.group_delay_s = [f.scaled(8, 31), 0.0];
    e.issue = f.unsigned(8) as u16; // low byte of IODC
    e.toc_s = f.unsigned(16) as u32 * 16;
    e.af2_sps2 = f.scaled(8, 55);
    e.af1_sps = f.scaled(16, 43);
    e.af0_s = f.scaled(22, 31);
    let mut is_complete = f.is_complete;

    let mut f = Fields::new(Bits::new(slot.part(1)), 0);
    let iode_2 = f.unsigned(8) as u16;
    e.crs_m = f.scaled(16, 5);
    e.delta_n_scps = f.scaled(16, 43);
    e.m0_sc = f.scaled(32, 31);
    e.cuc_rad = f.scaled(16, 29);
    e.eccentricity = f.scaled_unsigned(32, 33);
    e.cus_rad = f.scaled(16, 29);
    e.sqrt_a = f.scaled_unsigned(32, 19);
    e.toe_s = f.unsigned(16) as u32 * 16;
    is_complete &= f.is_complete;

    let mut f = Fields::new(Bits::new(slot.part(2)), 0);
    e.cic_rad = f.scaled(16, 29);
    e.omega0_sc = f.scaled(32, 31);
    e.cis_rad = f.scaled(16, 29);
    e.i0_sc = f.scaled(32, 31);
    e.crc_m = f.scaled(16, 5);
    e.argument_of_perigee_sc = f.scaled(32, 31);
    e.omega_dot_scps = f.scaled(24, 43);
    let iode_3 = f.unsigned(8) as u16;
    e.idot_scps = f.scaled(14, 43);
    is_complete &= f.is_complete;

    // With the alert flag the accuracy may be worse than the index says. [IS-GPS-200] 20.3.3.2
    if slot.is_alert {
        e.accuracy_index = 15;
    }
    (is_complete && e.issue == iode_2 && e.issue == iode_3).then_some(e)
}
