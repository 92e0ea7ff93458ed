//! When a satellite sends which subframe or page.
//!
//! | message | unit | cycle | begins at |
//! |---|---|---|---|
//! | LNAV | subframe, 6 s | frame of 5, 30 s | GPST seconds of week that are multiples of 30 |
//! | I/NAV, E1-B | page, 2 s | subframe of 15, 30 s | one second later, [GAL-OS-SIS-ICD] table 41 |
//! | D1 | subframe, 6 s | frame of 5, 30 s | multiples of 30 in BDT |
//! | D2 | subframe, 0.6 s | ten frames of 5, 30 s | multiples of 30 in BDT |

use anyhow::Result;
use surefix_core::gnss::klobuchar::KlobucharParameters;
use surefix_core::gnss::{Ephemeris, Satellite, System};
use surefix_core::time::{GPST_MINUS_BDT_S, GpsTime, NS_PER_S};

use super::{beidou, inav, lnav};

/// In all four messages the ephemeris is complete after this long, and is of one issue from beginning
/// to end, ns.
const CYCLE_NS: i64 = 30 * NS_PER_S;

/// One subframe or page as sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sent {
    /// When its first bit left the satellite, GPST.
    pub start: GpsTime,
    /// When its last bit did.
    pub end: GpsTime,
    /// Its words: ten of 30 bits (GPS as transmitted, BDS without interleaving), or eight of 32
    /// (Galileo).
    pub words: Vec<u32>,
}

/// Length of what a satellite sends at a time, and offset of its beginning, ns.
fn rhythm(satellite: Satellite) -> (i64, i64) {
    match satellite.system() {
        System::Gps => (6 * NS_PER_S, 0),
        System::Galileo => (2 * NS_PER_S, NS_PER_S),
        System::Bds if satellite.is_bds_geo() => (600_000_000, GPST_MINUS_BDT_S * NS_PER_S),
        System::Bds => (6 * NS_PER_S, GPST_MINUS_BDT_S * NS_PER_S),
    }
}

/// What a satellite finished sending after `after` and up to `until`.
///
/// `ephemeris_at` tells what it broadcasts in the 30 s that begin at an instant. Parameters of the
/// ionosphere are sent in the messages of the system they belong to.
///
/// # Errors
/// When there is no ephemeris, or a number does not fit its field.
pub fn sent_between(
    satellite: Satellite,
    after: GpsTime,
    until: GpsTime,
    ionosphere: Option<&KlobucharParameters>,
    mut ephemeris_at: impl FnMut(GpsTime) -> Result<Ephemeris>,
) -> Result<Vec<Sent>> {
    let (length_ns, offset_ns) = rhythm(satellite);
    let number = |time: GpsTime| (time.ns() - offset_ns).div_euclid(length_ns);
    let ionosphere = ionosphere.filter(|parameters| parameters.system == satellite.system());
    let mut all = Vec::new();
    // Number n ends where n + 1 begins.
    for k in number(after)..number(until) {
        let start = GpsTime::from_ns(k * length_ns + offset_ns);
        let of_cycle = k.rem_euclid(CYCLE_NS / length_ns);
        let cycle = start.plus_ns(-of_cycle * length_ns);
        let ephemeris = ephemeris_at(cycle)?;
        let subframe = of_cycle.rem_euclid(5) as u64 + 1;
        let bdt = |time: GpsTime| time.plus_ns(-GPST_MINUS_BDT_S * NS_PER_S);
        let words = match satellite.system() {
            System::Gps => lnav::subframe(&ephemeris, ionosphere, start, subframe)?.to_vec(),
            System::Galileo => inav::page(&ephemeris, start, of_cycle as usize)?.to_vec(),
            System::Bds if satellite.is_bds_geo() => {
                let frame = start.plus_ns(-(of_cycle % 5) * length_ns);
                beidou::d2(&ephemeris, ionosphere, bdt(frame), subframe)?.to_vec()
            }
            System::Bds => beidou::d1(&ephemeris, ionosphere, bdt(start), subframe)?.to_vec(),
        };
        all.push(Sent {
            start,
            end: start.plus_ns(length_ns),
            words,
        });
    }
    Ok(all)
}
