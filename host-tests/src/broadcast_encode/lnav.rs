//! GPS LNAV: five subframes of ten words of 30 bits, 6 s each. [IS-GPS-200] 20.3.
//!
//! Subframes 1 to 3 are the ephemeris. Of the 25 pages of subframes 4 and 5 only page 18 has content,
//! the ionosphere; the others are those of dummy satellites, as are pages that are not used.

use anyhow::Result;
use surefix_core::gnss::Ephemeris;
use surefix_core::gnss::klobuchar::KlobucharParameters;
use surefix_core::time::GpsTime;

use super::bits::{Bits, number};
use super::two_to_minus;

/// First word's preamble. [IS-GPS-200] 20.3.3.1.
const PREAMBLE: u64 = 0x8b;
/// Data bits each bit of parity is made of, and which of D29*, D30* goes in. [IS-GPS-200] table 20-XIV.
const PARITY: [(bool, &[u8]); 6] = [
    (true, &[1, 2, 3, 5, 6, 10, 11, 12, 13, 14, 17, 18, 20, 23]),
    (false, &[2, 3, 4, 6, 7, 11, 12, 13, 14, 15, 18, 19, 21, 24]),
    (true, &[1, 3, 4, 5, 7, 8, 12, 13, 14, 15, 16, 19, 20, 22]),
    (false, &[2, 4, 5, 6, 8, 9, 13, 14, 15, 16, 17, 20, 21, 23]),
    (
        false,
        &[1, 3, 5, 6, 7, 9, 10, 14, 15, 16, 17, 18, 21, 22, 24],
    ),
    (true, &[3, 5, 6, 8, 9, 10, 11, 13, 15, 19, 22, 23, 24]),
];
/// Full cycle of the pages of subframes 4 and 5. [IS-GPS-200] 20.3.3.5.
const PAGES: i64 = 25;
/// Page of subframe 4 with the ionosphere, and the number of a satellite it carries instead of one.
const IONOSPHERE_PAGE: i64 = 18;
const IONOSPHERE_ID: u64 = 56;

/// Six bits of parity of 24 bits of data after a word that ended in `d29` and `d30`.
pub fn parity(data: u32, d29: bool, d30: bool) -> u32 {
    PARITY.iter().fold(0, |sum, (takes_d29, places)| {
        let last = if *takes_d29 { d29 } else { d30 };
        let bit = places
            .iter()
            .fold(last, |bit, place| bit != (data >> (24 - place) & 1 == 1));
        sum << 1 | u32::from(bit)
    })
}

/// Ten words as transmitted, 30 bits each, of the subframe that begins at `start`: `subframe` 1 to 5.
pub fn subframe(
    ephemeris: &Ephemeris,
    ionosphere: Option<&KlobucharParameters>,
    start: GpsTime,
    subframe: u64,
) -> Result<[u32; 10]> {
    let mut data = Bits::default();
    data.unsigned(8, PREAMBLE)?.zeros_to(24);
    // The count of 6 s that the next subframe begins with.
    let count = (start.plus_ns(6_000_000_000).tow_ns() / 6_000_000_000) as u64;
    data.unsigned(17, count)?
        .unsigned(2, 0)?
        .unsigned(3, subframe)?
        .zeros_to(48);
    let page = start.tow_ns() / 30_000_000_000 % PAGES + 1;
    match (subframe, ionosphere) {
        (1, _) => clock(&mut data, ephemeris, start)?,
        (2, _) => orbit(&mut data, ephemeris)?,
        (3, _) => plane(&mut data, ephemeris)?,
        (4, Some(parameters)) if page == IONOSPHERE_PAGE => {
            ionosphere_page(&mut data, parameters)?;
        }
        _ => {
            // [IS-GPS-200] 20.3.3.5.1.2: a dummy satellite.
            data.unsigned(2, 1)?.unsigned(6, 0)?.alternate_to(238);
        }
    }
    data.zeros_to(240);
    Ok(words(data.as_slice()))
}

/// Words with their parity; the last two bits of data of words 2 and 10 make the parity end in zeros.
fn words(data: &[bool]) -> [u32; 10] {
    let mut words = [0; 10];
    let (mut d29, mut d30) = (false, false);
    for (k, (word, bits)) in words.iter_mut().zip(data.chunks_exact(24)).enumerate() {
        let data = number(bits);
        let ends: &[u32] = if k == 1 || k == 9 {
            &[0, 1, 2, 3]
        } else {
            &[0]
        };
        let tried = ends
            .iter()
            .map(|end| (data | end, parity(data | end, d29, d30)));
        // Of the four ends one gives zeros: the last two equations differ in both bits.
        let (data, check) = tried
            .clone()
            .find(|(_, check)| check & 3 == 0)
            .filter(|_| ends.len() == 4)
            .unwrap_or((data, parity(data, d29, d30)));
        let sent = if d30 { !data & 0xff_ffff } else { data };
        *word = sent << 6 | check;
        (d29, d30) = (check & 2 != 0, check & 1 != 0);
    }
    words
}

/// [IS-GPS-200] 20.3.3.3, table 20-I.
fn clock(data: &mut Bits, e: &Ephemeris, start: GpsTime) -> Result<()> {
    let issue = u64::from(e.issue);
    data.unsigned(10, start.week().rem_euclid(1024) as u64)?
        .unsigned(2, 1)?
        .unsigned(4, 0)?
        .unsigned(6, u64::from(e.health))?
        .unsigned(2, issue >> 8)?
        .zeros_to(160)
        .signed(8, e.group_delay_s[0], two_to_minus(31))?
        .unsigned(8, issue & 0xff)?
        .steps(16, e.toc.tow_s(), 16.0)?
        .signed(8, e.af2_sps2, two_to_minus(55))?
        .signed(16, e.af1_sps, two_to_minus(43))?
        .signed(22, e.af0_s, two_to_minus(31))?;
    Ok(())
}

/// [IS-GPS-200] 20.3.3.4, table 20-II.
fn orbit(data: &mut Bits, e: &Ephemeris) -> Result<()> {
    data.unsigned(8, u64::from(e.issue & 0xff))?
        .signed(16, e.crs_m, two_to_minus(5))?
        .semicircles(16, e.delta_n_radps, two_to_minus(43))?
        .semicircles(32, e.m0_rad, two_to_minus(31))?
        .signed(16, e.cuc_rad, two_to_minus(29))?
        .steps(32, e.eccentricity, two_to_minus(33))?
        .signed(16, e.cus_rad, two_to_minus(29))?
        .steps(32, e.sqrt_a, two_to_minus(19))?
        .steps(16, e.toe_sow_s, 16.0)?
        .unsigned(6, 0)?;
    Ok(())
}

/// [IS-GPS-200] 20.3.3.4, table 20-II.
fn plane(data: &mut Bits, e: &Ephemeris) -> Result<()> {
    data.signed(16, e.cic_rad, two_to_minus(29))?
        .semicircles(32, e.omega0_rad, two_to_minus(31))?
        .signed(16, e.cis_rad, two_to_minus(29))?
        .semicircles(32, e.i0_rad, two_to_minus(31))?
        .signed(16, e.crc_m, two_to_minus(5))?
        .semicircles(32, e.argument_of_perigee_rad, two_to_minus(31))?
        .semicircles(24, e.omega_dot_radps, two_to_minus(43))?
        .unsigned(8, u64::from(e.issue & 0xff))?
        .semicircles(14, e.idot_radps, two_to_minus(43))?;
    Ok(())
}

/// Steps of α and β. [IS-GPS-200] table 20-X, [BDS-SIS-ICD-B1I] table 5-8.
pub const ALPHA_STEPS: [i32; 4] = [30, 27, 24, 24];
pub const BETA_STEPS: [i32; 4] = [-11, -14, -16, -16];

/// Eight parameters of the ionosphere, 8 bits each.
pub fn ionosphere_parameters(data: &mut Bits, parameters: &KlobucharParameters) -> Result<()> {
    let alpha = parameters.alpha.iter().zip(ALPHA_STEPS);
    for (value, power) in alpha.chain(parameters.beta.iter().zip(BETA_STEPS)) {
        data.signed(8, *value, two_to_minus(power))?;
    }
    Ok(())
}

/// [IS-GPS-200] 20.3.3.5.1.6 and .7: no more of UTC than the leap seconds, 18.
fn ionosphere_page(data: &mut Bits, parameters: &KlobucharParameters) -> Result<()> {
    data.unsigned(2, 1)?.unsigned(6, IONOSPHERE_ID)?;
    ionosphere_parameters(data, parameters)?;
    data.zeros_to(192)
        .unsigned(8, 18)?
        .unsigned(16, 0)?
        .unsigned(8, 18)?;
    Ok(())
}
