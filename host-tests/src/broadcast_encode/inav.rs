//! Galileo I/NAV on E1-B: pages of 2 s, an even and an odd part of 120 bits each. [GAL-OS-SIS-ICD] 4.3.
//!
//! Word types 1 to 5 are the ephemeris, the clock and the group delays, 0 the time; the places of the
//! other types are taken by dummy words, type 63.

use anyhow::Result;
use surefix_core::gnss::Ephemeris;
use surefix_core::time::{GST_WEEK_OFFSET, GpsTime};

use super::bits::{Bits, crc24q, number};
use super::two_to_minus;

/// Word types of the 15 pages of a subframe on E1-B. [GAL-OS-SIS-ICD] table 41, whose types 6 to 22
/// are dummies here.
const PAGES: [u64; 15] = [2, 4, 63, 63, 63, 63, 63, 63, 0, 0, 1, 3, 5, 0, 0];
/// Secondary synchronisation patterns in turn. [GAL-OS-SIS-ICD] 4.3.2.3.
const PATTERNS: [u64; 3] = [0x04, 0x2b, 0x2f];
/// SISA index sent: 3.12 m. [GAL-OS-SIS-ICD] table 76.
const SISA_INDEX: u64 = 107;

/// Page `page`, 0 to 14, of a subframe, begun at `start`, as eight words of 32 bits: both parts, each
/// filled up to 128 bits.
pub fn page(ephemeris: &Ephemeris, start: GpsTime, page: usize) -> Result<[u32; 8]> {
    let word_type = PAGES.get(page).copied().unwrap_or(63);
    let mut word = Bits::default();
    word.unsigned(6, word_type)?;
    fill(&mut word, ephemeris, start, word_type)?;
    word.zeros_to(128);
    let (first, last) = word.as_slice().split_at(112);

    let mut even = Bits::default();
    even.unsigned(2, 0b00)?.extend(first);
    let mut odd = Bits::default();
    // Reserved 1, search and rescue, spare: 40, 22 and 2 bits.
    odd.unsigned(2, 0b10)?.extend(last).zeros_to(82);
    let mut covered = even.clone();
    covered.extend(odd.as_slice());
    odd.unsigned(24, u64::from(crc24q(covered.as_slice())))?
        .unsigned(8, PATTERNS[page % 3])?;
    even.zeros_to(128).extend(odd.zeros_to(128).as_slice());
    let mut words = [0; 8];
    for (word, bits) in words.iter_mut().zip(even.as_slice().chunks_exact(32)) {
        *word = number(bits);
    }
    Ok(words)
}

/// [GAL-OS-SIS-ICD] 4.3.5, tables 43 to 55.
fn fill(word: &mut Bits, e: &Ephemeris, start: GpsTime, word_type: u64) -> Result<()> {
    let week = u64::try_from(start.week() - GST_WEEK_OFFSET)? % 4096;
    let tow_s = (start.tow_ns() / 1_000_000_000) as u64;
    let issue = u64::from(e.issue);
    match word_type {
        0 => word
            .unsigned(2, 0b10)?
            .zeros_to(96)
            .unsigned(12, week)?
            .unsigned(20, tow_s)?,
        1 => word
            .unsigned(10, issue)?
            .steps(14, e.toe_sow_s, 60.0)?
            .semicircles(32, e.m0_rad, two_to_minus(31))?
            .steps(32, e.eccentricity, two_to_minus(33))?
            .steps(32, e.sqrt_a, two_to_minus(19))?,
        2 => word
            .unsigned(10, issue)?
            .semicircles(32, e.omega0_rad, two_to_minus(31))?
            .semicircles(32, e.i0_rad, two_to_minus(31))?
            .semicircles(32, e.argument_of_perigee_rad, two_to_minus(31))?
            .semicircles(14, e.idot_radps, two_to_minus(43))?,
        3 => word
            .unsigned(10, issue)?
            .semicircles(24, e.omega_dot_radps, two_to_minus(43))?
            .semicircles(16, e.delta_n_radps, two_to_minus(43))?
            .signed(16, e.cuc_rad, two_to_minus(29))?
            .signed(16, e.cus_rad, two_to_minus(29))?
            .signed(16, e.crc_m, two_to_minus(5))?
            .signed(16, e.crs_m, two_to_minus(5))?
            .unsigned(8, SISA_INDEX)?,
        4 => word
            .unsigned(10, issue)?
            .unsigned(6, u64::from(e.satellite.prn()))?
            .signed(16, e.cic_rad, two_to_minus(29))?
            .signed(16, e.cis_rad, two_to_minus(29))?
            .steps(14, e.toc.tow_s(), 60.0)?
            .signed(31, e.af0_s, two_to_minus(34))?
            .signed(21, e.af1_sps, two_to_minus(46))?
            .signed(6, e.af2_sps2, two_to_minus(59))?,
        // No ionosphere of NeQuick's; everything healthy.
        5 => word
            .zeros_to(6 + 36 + 5)
            .signed(10, e.group_delay_s[0], two_to_minus(32))?
            .signed(10, e.group_delay_s[1], two_to_minus(32))?
            .unsigned(6, 0)?
            .unsigned(12, week)?
            .unsigned(20, tow_s)?,
        _ => word.alternate_to(128),
    };
    Ok(())
}
