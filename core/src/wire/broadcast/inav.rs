//! Galileo I/NAV: a page of two halves, 120 bits each, that carries a word of 128.
//!
//! u-blox gives the even half in the first four words and the odd one in the next four, each followed
//! by filling; receivers of generation 8 add a ninth word ([UBX-F9K-INT] 3.11.1.5, and recordings). The checksum covers both halves but for the
//! last field and the tails. [GAL-OS-SIS-ICD] 4.3.2, 5.1.9.4

use super::ephemeris::{BroadcastEphemeris, Source};
use super::fields::{Fields, Packer};
use super::slot::Slot;
use super::{Subframe, SubframeError, check_time};
use crate::wire::bits::{BitCursor, Bits};
use crate::wire::crc::crc24q;

/// Bits that the checksum covers, even and odd half.
const COVERED: [usize; 2] = [114, 82];

/// A word of a page whose checksum is right.
pub(super) struct Inav {
    /// Type of the word.
    pub(super) number: u32,
    /// The word, its type included.
    pub(super) data: [u8; 16],
    /// Galileo time of week, s, where the word has it.
    pub(super) tow_s: Option<u32>,
}

impl Inav {
    /// Checks length, order of the halves and checksum. `None` for alert pages, which hold no words.
    pub(super) fn parse(subframe: &Subframe<'_>) -> Result<Option<Self>, SubframeError> {
        if !matches!(subframe.words.len(), 32 | 36) {
            return Err(SubframeError::Length);
        }
        let mut page = [0; 32];
        let bytes = subframe.dwords().flat_map(u32::to_be_bytes);
        page.iter_mut().zip(bytes).for_each(|(to, byte)| *to = byte);
        let page = Bits::new(&page);
        let bits = |at: usize, width: u32| page.unsigned(at, width).unwrap_or(0);
        if (bits(0, 1), bits(128, 1)) != (0, 1) {
            return Err(SubframeError::Preamble);
        }

        // 196 bits: four zeros before them change nothing of a sum that begins with zero.
        let mut covered = [0; 25];
        let mut packer = Packer::new(&mut covered);
        packer.put(0, 4);
        packer.put(bits(0, 57), 57);
        packer.put(bits(57, 57), 57);
        packer.put(bits(128, 41), 41);
        packer.put(bits(169, 41), 41);
        packer.end();
        if u64::from(crc24q(&covered)) != bits(128 + COVERED[1], 24) {
            return Err(SubframeError::Checksum);
        }
        if bits(1, 1) != 0 || bits(129, 1) != 0 {
            return Ok(None);
        }

        let mut data = [0; 16];
        let mut packer = Packer::new(&mut data);
        packer.put(bits(2, 56), 56);
        packer.put(bits(58, 56), 56);
        packer.put(bits(130, 16), 16);
        packer.end();
        let word = Bits::new(&data);
        let number = word.unsigned(0, 6).unwrap_or(0) as u32;
        // [GAL-OS-SIS-ICD] tables 42, 47, 48
        let tow_at = match number {
            0 if word.unsigned(6, 2) == Some(2) => Some(108),
            5 => Some(85),
            6 => Some(105),
            _ => None,
        };
        let tow_s = match tow_at.and_then(|at| word.unsigned(at, 20)) {
            Some(tow_s) => Some(check_time(tow_s as u32)?),
            None => None,
        };
        Ok(Some(Self {
            number,
            data,
            tow_s,
        }))
    }

    /// IODnav of words 1 to 4.
    pub(super) fn issue(&self) -> Option<u16> {
        let issue = Bits::new(&self.data).unsigned(6, 10)? as u16;
        (1..=4).contains(&self.number).then_some(issue)
    }

    /// The satellite that word 4 names.
    pub(super) fn satellite(&self) -> Option<u8> {
        let satellite = Bits::new(&self.data).unsigned(16, 6)? as u8;
        (self.number == 4).then_some(satellite)
    }
}

/// The ephemeris when words 1 to 4 are of one issue and word 5 was sent with it.
/// [GAL-OS-SIS-ICD] 5.1.9.2, tables 43 to 47
#[inline(never)]
pub(super) fn ephemeris(slot: &Slot, satellite: u8) -> Option<BroadcastEphemeris> {
    let mut e = BroadcastEphemeris::ZERO;
    e.source = Source::GalileoInav;
    e.satellite = satellite;
    e.issue = slot.issue_of_word_5;
    let mut is_complete = true;

    let issue = |f: &mut Fields<'_>| {
        f.cursor.skip(6);
        f.unsigned(10) as u16
    };
    let mut f = Fields::new(Bits::new(slot.part(0)), 0);
    is_complete &= issue(&mut f) == e.issue;
    e.toe_s = f.unsigned(14) as u32 * 60;
    e.m0_sc = f.scaled(32, 31);
    e.eccentricity = f.scaled_unsigned(32, 33);
    e.sqrt_a = f.scaled_unsigned(32, 19);
    is_complete &= f.is_complete;

    let mut f = Fields::new(Bits::new(slot.part(1)), 0);
    is_complete &= issue(&mut f) == e.issue;
    e.omega0_sc = f.scaled(32, 31);
    e.i0_sc = f.scaled(32, 31);
    e.argument_of_perigee_sc = f.scaled(32, 31);
    e.idot_scps = f.scaled(14, 43);
    is_complete &= f.is_complete;

    let mut f = Fields::new(Bits::new(slot.part(2)), 0);
    is_complete &= issue(&mut f) == e.issue;
    e.omega_dot_scps = f.scaled(24, 43);
    e.delta_n_scps = f.scaled(16, 43);
    e.cuc_rad = f.scaled(16, 29);
    e.cus_rad = f.scaled(16, 29);
    e.crc_m = f.scaled(16, 5);
    e.crs_m = f.scaled(16, 5);
    e.accuracy_index = f.unsigned(8) as u8;
    is_complete &= f.is_complete;

    let mut f = Fields::new(Bits::new(slot.part(3)), 0);
    is_complete &= issue(&mut f) == e.issue;
    f.cursor.skip(6); // satellite
    e.cic_rad = f.scaled(16, 29);
    e.cis_rad = f.scaled(16, 29);
    e.toc_s = f.unsigned(14) as u32 * 60;
    e.af0_s = f.scaled(31, 34);
    e.af1_sps = f.scaled(21, 46);
    e.af2_sps2 = f.scaled(6, 59);
    is_complete &= f.is_complete;

    let mut f = Fields {
        cursor: BitCursor::new(Bits::new(slot.part(4)), 6 + 41), // ionosphere
        is_complete,
    };
    e.group_delay_s = [f.scaled(10, 32), f.scaled(10, 32)];
    let (e5b_health, e1_health) = (f.unsigned(2), f.unsigned(2));
    let (e5b_invalid, e1_invalid) = (f.unsigned(1), f.unsigned(1));
    e.health = (e5b_health << 7 | e5b_invalid << 6 | e1_health << 1 | e1_invalid) as u16;
    e.week = f.unsigned(12) as u16;
    f.is_complete.then_some(e)
}
