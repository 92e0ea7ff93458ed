//! BDS D1 of MEO and IGSO satellites, subframes of 6 s, and D2 of GEO satellites, of 0.6 s.
//! [BDS-SIS-ICD-B1I] 5.
//!
//! Words are as a receiver passes them on after taking the interleaving of [BDS-SIS-ICD-B1I] 5.1.3
//! away: 22 bits of information and the check bits of both halves; the first word has 26 and one.
//! Almanac pages and the integrity of D2 are zeros.

use anyhow::{Result, bail};
use surefix_core::gnss::Ephemeris;
use surefix_core::gnss::klobuchar::KlobucharParameters;
use surefix_core::time::{BDT_WEEK_OFFSET, GpsTime};

use super::bits::{Bits, number};
use super::lnav::ionosphere_parameters;
use super::two_to_minus;

const PREAMBLE: u64 = 0b111_0001_0010;
/// Check bits of a codeword of BCH(15,11,1).
pub const BCH_CHECK_BITS: usize = 4;
/// Information of a subframe: 26 bits of its first word, 22 of the nine others.
const INFORMATION: usize = 26 + 9 * 22;
/// Information of a subframe 1 of D2 that has content: five words.
const INFORMATION_D2: usize = 26 + 4 * 22;

/// Remainder of eleven bits by x⁴ + x + 1. [BDS-SIS-ICD-B1I] 5.1.3.
pub fn bch_check(information: &[bool]) -> u32 {
    let shifted = information.iter().fold(0, |state: u32, bit| {
        let feedback = (state >> 3 & 1 == 1) != *bit;
        (state << 1 & 0xf) ^ if feedback { 0b0011 } else { 0 }
    });
    shifted & 0xf
}

/// Ten words of 30 bits from the information of a subframe.
fn words(information: &Bits) -> Result<[u32; 10]> {
    let bits = information.as_slice();
    if bits.len() != INFORMATION {
        bail!("{} bits of information are no subframe", bits.len());
    }
    let mut words = [0; 10];
    let (first, rest) = bits.split_at(26);
    // The first 15 bits have no code.
    words[0] = number(first) << 4 | bch_check(&first[15..]);
    for (word, bits) in words[1..].iter_mut().zip(rest.chunks_exact(22)) {
        let (left, right) = bits.split_at(11);
        *word = number(bits) << 8 | bch_check(left) << 4 | bch_check(right);
    }
    Ok(words)
}

/// Preamble, number of the subframe and second of week. `time` is BDT.
fn head(time: GpsTime, subframe: u64) -> Result<Bits> {
    let mut bits = Bits::default();
    bits.unsigned(11, PREAMBLE)?
        .unsigned(4, 0)?
        .unsigned(3, subframe)?
        .unsigned(20, (time.tow_ns() / 1_000_000_000) as u64)?;
    Ok(bits)
}

/// Seconds of the BDT week of a reference time.
fn sow_s(time: GpsTime) -> f64 {
    time.plus_ns(-14_000_000_000).tow_s()
}

fn week(time: GpsTime) -> Result<u64> {
    Ok(u64::try_from(time.week() - BDT_WEEK_OFFSET)? % 8192)
}

/// What is broadcast of the ionosphere: zeros where nothing is known of it.
fn ionosphere(bits: &mut Bits, parameters: Option<&KlobucharParameters>) -> Result<()> {
    match parameters {
        Some(parameters) => ionosphere_parameters(bits, parameters),
        None => bits.unsigned(64, 0).map(|_| ()),
    }
}

/// Subframe 1 to 5 of D1, begun at `time`, BDT. [BDS-SIS-ICD-B1I] 5.2.
pub fn d1(
    e: &Ephemeris,
    parameters: Option<&KlobucharParameters>,
    time: GpsTime,
    subframe: u64,
) -> Result<[u32; 10]> {
    let mut bits = head(time, subframe)?;
    match subframe {
        1 => {
            bits.unsigned(1, u64::from(e.health != 0))?
                .unsigned(5, u64::from(e.issue))?
                .unsigned(4, 0)?
                .unsigned(13, week(time)?)?
                .steps(17, sow_s(e.toc), 8.0)?
                .signed(10, e.group_delay_s[0], 1e-10)?
                .signed(10, e.group_delay_s[1], 1e-10)?;
            ionosphere(&mut bits, parameters)?;
            bits.signed(11, e.af2_sps2, two_to_minus(66))?
                .signed(24, e.af0_s, two_to_minus(33))?
                .signed(22, e.af1_sps, two_to_minus(50))?
                .unsigned(5, u64::from(e.issue))?;
        }
        2 => {
            let toe = toe_steps(e)?;
            bits.semicircles(16, e.delta_n_radps, two_to_minus(43))?
                .signed(18, e.cuc_rad, two_to_minus(31))?
                .semicircles(32, e.m0_rad, two_to_minus(31))?
                .steps(32, e.eccentricity, two_to_minus(33))?
                .signed(18, e.cus_rad, two_to_minus(31))?
                .signed(18, e.crc_m, two_to_minus(6))?
                .signed(18, e.crs_m, two_to_minus(6))?
                .steps(32, e.sqrt_a, two_to_minus(19))?
                .unsigned(2, toe >> 15)?;
        }
        3 => {
            bits.unsigned(15, toe_steps(e)? & 0x7fff)?
                .semicircles(32, e.i0_rad, two_to_minus(31))?
                .signed(18, e.cic_rad, two_to_minus(31))?
                .semicircles(24, e.omega_dot_radps, two_to_minus(43))?
                .signed(18, e.cis_rad, two_to_minus(31))?
                .semicircles(14, e.idot_radps, two_to_minus(43))?
                .semicircles(32, e.omega0_rad, two_to_minus(31))?
                .semicircles(32, e.argument_of_perigee_rad, two_to_minus(31))?
                .unsigned(1, 0)?;
        }
        _ => {
            // Pages 1 to 24, one per frame of 30 s.
            let page = time.tow_ns() / 30_000_000_000 % 24 + 1;
            bits.unsigned(1, 0)?.unsigned(7, page as u64)?;
        }
    }
    bits.zeros_to(INFORMATION);
    words(&bits)
}

fn toe_steps(e: &Ephemeris) -> Result<u64> {
    let mut bits = Bits::default();
    bits.steps(17, e.toe_sow_s, 8.0)?;
    Ok(u64::from(number(bits.as_slice())))
}

/// Subframe 1 to 5 of D2 in the frame of 3 s begun at `time`, BDT; subframe 1 has ten pages in turn.
/// [BDS-SIS-ICD-B1I] 5.3, figures 5-14-1 to 5-14-10.
pub fn d2(
    e: &Ephemeris,
    parameters: Option<&KlobucharParameters>,
    time: GpsTime,
    subframe: u64,
) -> Result<[u32; 10]> {
    let mut bits = head(time, subframe)?;
    if subframe == 1 {
        let page = (time.tow_ns() / 3_000_000_000 % 10) as usize;
        bits.unsigned(4, page as u64 + 1)?;
        bits.extend(page_of_d2(e, parameters, time, page)?.as_slice());
        if bits.as_slice().len() > INFORMATION_D2 {
            bail!("page {} of D2 is too long", page + 1);
        }
    }
    bits.zeros_to(INFORMATION);
    words(&bits)
}

/// What page `page`, from 0, of subframe 1 holds after its number.
fn page_of_d2(
    e: &Ephemeris,
    parameters: Option<&KlobucharParameters>,
    time: GpsTime,
    page: usize,
) -> Result<Bits> {
    let mut bits = Bits::default();
    match page {
        0 => {
            bits.unsigned(1, u64::from(e.health != 0))?
                .unsigned(5, u64::from(e.issue))?
                .unsigned(4, 0)?
                .unsigned(13, week(time)?)?
                .steps(17, sow_s(e.toc), 8.0)?
                .signed(10, e.group_delay_s[0], 1e-10)?
                .signed(10, e.group_delay_s[1], 1e-10)?;
            return Ok(bits);
        }
        1 => {
            ionosphere(&mut bits, parameters)?;
            return Ok(bits);
        }
        _ => {}
    }
    // From page 3 on the fields run through the pages, split where a page is full.
    let mut clock = Bits::default();
    clock
        .signed(24, e.af0_s, two_to_minus(33))?
        .signed(22, e.af1_sps, two_to_minus(50))?
        .signed(11, e.af2_sps2, two_to_minus(66))?
        .unsigned(5, u64::from(e.issue))?
        .semicircles(16, e.delta_n_radps, two_to_minus(43))?
        .signed(18, e.cuc_rad, two_to_minus(31))?
        .semicircles(32, e.m0_rad, two_to_minus(31))?
        .signed(18, e.cus_rad, two_to_minus(31))?
        .steps(32, e.eccentricity, two_to_minus(33))?
        .steps(32, e.sqrt_a, two_to_minus(19))?
        .signed(18, e.cic_rad, two_to_minus(31))?
        .signed(18, e.cis_rad, two_to_minus(31))?
        .steps(17, e.toe_sow_s, 8.0)?
        .semicircles(32, e.i0_rad, two_to_minus(31))?
        .signed(18, e.crc_m, two_to_minus(6))?
        .signed(18, e.crs_m, two_to_minus(6))?
        .semicircles(24, e.omega_dot_radps, two_to_minus(43))?
        .semicircles(32, e.omega0_rad, two_to_minus(31))?
        .semicircles(32, e.argument_of_perigee_rad, two_to_minus(31))?
        .semicircles(14, e.idot_radps, two_to_minus(43))?;
    // Page 3 begins after 38 reserved bits; how much of the fields pages 3 to 10 hold.
    let lengths = [28, 64, 64, 64, 64, 66, 64, 19];
    let before: usize = lengths.iter().take(page - 2).sum();
    let Some(part) = clock.as_slice().get(before..before + lengths[page - 2]) else {
        bail!("page {} of D2 has no content", page + 1);
    };
    if page == 2 {
        bits.zeros_to(38);
    }
    bits.extend(part);
    Ok(bits)
}
