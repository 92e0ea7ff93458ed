//! The report of an epoch as four NMEA 0183 sentences, for what reads nothing else: chart plotters,
//! autopilots, loggers.
//!
//! | sentence | what it tells |
//! |---|---|
//! | GGA | time, position, quality 1 (6 where no satellite is in it), satellites used, height |
//! | RMC | time, date, position, speed, course, status, mode, navigational status |
//! | GST | residuals and one sigma of the position |
//! | GBS | one sigma of the position, the satellite that most likely failed, its bias |
//!
//! **A position that must not be used is not there.** Unless the verdict says `nominal` or `excluded`, GGA has quality
//! 0, RMC status V and mode N, and position, height, speed, course and sigmas are empty in all four: what
//! looks at none of the flags finds nothing to steer by. The navigational status tells why:
//!
//! | status | when |
//! |---|---|
//! | S, safe | usable |
//! | U, unsafe | alert, or a level above its limit |
//! | C, caution | a position, and nothing vouches for it |
//! | V, not valid | no position |
//!
//! Sources: [NMEA-0183] 6.3 and [IEC-61162-1] 8.3 for fields, talkers, status; satellite, system and signal
//! numbers as of NMEA 0183 version 4.11.
//!
//! Departures, each because nothing here knows better: HDOP, axes of the error ellipse and magnetic variation
//! are empty; there is no geoid, so that the height is the one above the ellipsoid with a separation of 0.0, the
//! sum of both being what it is everywhere; GBS's expected errors are one sigma, as receivers have it, not the
//! standard's effect of the bias, which of an excluded satellite would be zero and read as perfect; signal 0
//! is all signals. Time is that of the epoch, rounded to 10 ms.

use crate::gnss::{SatelliteSet, System};
use crate::integrity::{Integrity, Reason};
use crate::report::{EpochReport, Fix};
use crate::time::{self, GpsTime, NS_PER_S};
use crate::wire::native::Full;
use crate::wire::nmea::{self, Angle, Fields, MAX_SENTENCE_LENGTH};

/// Bytes that the sentences of an epoch take at most.
pub const MAX_SENTENCES_BYTES: usize = 4 * MAX_SENTENCE_LENGTH;

/// Slower than this a course is the noise of the velocity, m/s: it is left empty.
pub const SLOWEST_COURSE_MPS: f64 = 0.1;

/// One knot is 1852 m in an hour.
const KNOTS_PER_MPS: f64 = 3600.0 / 1852.0;
/// Largest values of fields, so that no sentence passes its 82 characters.
const LARGEST_HEIGHT_M: u32 = 999_999;
const LARGEST_SPEED_KN: u32 = 9999;
const LARGEST_SIGMA_M: u32 = 9999;
const LARGEST_BIAS_M: u32 = 999_999;
/// What time is rounded to, ns.
const HUNDREDTH_NS: i64 = NS_PER_S / 100;

/// What of a position can be printed and may be used.
#[derive(Clone, Copy)]
struct Position {
    latitude: Angle,
    longitude: Angle,
    height_m: f64,
    /// Speed, knots, and course, degrees from north.
    speed_kn: Option<f64>,
    course_deg: Option<f64>,
}

/// Time of day and date in UTC.
#[derive(Clone, Copy)]
struct Clock {
    time: [u8; 4],
    date: [u8; 3],
}

/// Writes GGA, RMC, GST and GBS one behind the other; returns their length in bytes.
///
/// # Errors
/// [`Full`] when `out` is too short; [`MAX_SENTENCES_BYTES`] is always enough.
#[inline(never)]
pub fn encode(report: &EpochReport, out: &mut [u8]) -> Result<usize, Full> {
    let talker = talker(&report.used);
    let position = position(report);
    let clock = clock(report);
    let mut end: usize = 0;
    let mut put = |formatter: [u8; 3], fill: &dyn Fn(&mut Fields<'_>) -> Result<(), Full>| {
        let room = out.get_mut(end..).ok_or(Full)?;
        end = end.saturating_add(nmea::write(room, talker, formatter, fill)?);
        Ok(())
    };
    put(*b"GGA", &|fields| gga(fields, report, position, clock))?;
    put(*b"RMC", &|fields| rmc(fields, report, position, clock))?;
    put(*b"GST", &|fields| gst(fields, report, position, clock))?;
    put(*b"GBS", &|fields| gbs(fields, report, position, clock))?;
    Ok(end)
}

/// GN for a position of several constellations, or of none; else that of the one. [NMEA-0183] table 4
fn talker(used: &SatelliteSet) -> [u8; 2] {
    match used.masks().map(|mask| mask != 0) {
        [true, false, false] => *b"GP",
        [false, true, false] => *b"GA",
        [false, false, true] => *b"GB",
        _ => *b"GN",
    }
}

fn position(report: &EpochReport) -> Option<Position> {
    let fix: &Fix = report.fix.as_ref()?;
    if !report.verdict.integrity.is_usable() || !fix.h_m.is_finite() {
        return None;
    }
    let [east_mps, north_mps, _] = fix.velocity_enu_mps.unwrap_or([f64::NAN; 3]);
    let speed_mps = libm::sqrt(east_mps * east_mps + north_mps * north_mps);
    // Written so that NaN has no course.
    let is_moving = speed_mps >= SLOWEST_COURSE_MPS && speed_mps.is_finite();
    let course_deg = is_moving.then(|| course_deg(east_mps, north_mps));
    Some(Position {
        latitude: Angle::latitude(fix.lat_deg)?,
        longitude: Angle::longitude(fix.lon_deg)?,
        height_m: fix.h_m,
        speed_kn: Some(speed_mps * KNOTS_PER_MPS),
        course_deg,
    })
}

/// From north to east, degrees, 0 to what still prints below 360.00.
fn course_deg(east: f64, north: f64) -> f64 {
    let deg = libm::atan2(east, north).to_degrees();
    let deg = if deg < 0.0 { deg + 360.0 } else { deg };
    if deg < 359.995 { deg } else { 0.0 }
}

/// `None` while the week is not known: leap seconds and date hang on it.
fn clock(report: &EpochReport) -> Option<Clock> {
    if report.flags.week_unknown {
        return None;
    }
    let hundredths = report
        .time
        .ns()
        .saturating_add(HUNDREDTH_NS / 2)
        .div_euclid(HUNDREDTH_NS);
    let utc = time::utc(GpsTime::from_ns(hundredths.wrapping_mul(HUNDREDTH_NS)));
    Some(Clock {
        time: [
            utc.hour,
            utc.minute,
            (utc.ns_of_minute / NS_PER_S) as u8,
            (utc.ns_of_minute % NS_PER_S / HUNDREDTH_NS) as u8,
        ],
        date: [utc.day, utc.month, utc.year.rem_euclid(100) as u8],
    })
}

fn gga(
    fields: &mut Fields<'_>,
    report: &EpochReport,
    position: Option<Position>,
    clock: Option<Clock>,
) -> Result<(), Full> {
    fields.time(clock.map(|clock| clock.time))?;
    fields.latitude(position.map(|position| position.latitude))?;
    fields.longitude(position.map(|position| position.longitude))?;
    let quality = match position {
        None => 0,
        Some(_) if report.used.is_empty() => 6,
        Some(_) => 1,
    };
    fields.integer(quality, 1)?;
    fields.integer(report.used.len() as u64, 2)?;
    fields.empty()?;
    let height_m = position.map(|position| position.height_m);
    fields.fixed(height_m, 3, LARGEST_HEIGHT_M)?;
    fields.letter(Some(b'M'))?;
    fields.fixed(height_m.map(|_| 0.0), 1, 0)?;
    fields.letter(Some(b'M'))?;
    fields.empties(2)
}

fn rmc(
    fields: &mut Fields<'_>,
    report: &EpochReport,
    position: Option<Position>,
    clock: Option<Clock>,
) -> Result<(), Full> {
    fields.time(clock.map(|clock| clock.time))?;
    let (status, mode) = match position {
        None => (b'V', b'N'),
        Some(_) if report.used.is_empty() => (b'A', b'E'),
        Some(_) => (b'A', b'A'),
    };
    fields.letter(Some(status))?;
    fields.latitude(position.map(|position| position.latitude))?;
    fields.longitude(position.map(|position| position.longitude))?;
    let speed_kn = position.and_then(|position| position.speed_kn);
    fields.fixed(speed_kn, 2, LARGEST_SPEED_KN)?;
    let course_deg = position.and_then(|position| position.course_deg);
    fields.fixed(course_deg, 2, 360)?;
    fields.date(clock.map(|clock| clock.date))?;
    fields.empties(2)?;
    fields.letter(Some(mode))?;
    let is_unsafe = report.verdict.integrity == Integrity::Alert
        || matches!(
            report.verdict.reason,
            Reason::HplAboveLimit | Reason::VplAboveLimit
        );
    fields.letter(Some(match position {
        Some(_) => b'S',
        None if is_unsafe => b'U',
        None if report.fix.is_some() => b'C',
        None => b'V',
    }))
}

/// A sigma or a probability; nothing where it is none.
fn not_negative(value: f64) -> Option<f64> {
    (value >= 0.0).then_some(value)
}

/// One sigma of latitude, longitude and height.
fn sigmas(
    fields: &mut Fields<'_>,
    report: &EpochReport,
    position: Option<Position>,
) -> Result<(), Full> {
    let sigma_m = report.sigma_enu_m.filter(|_| position.is_some());
    let [east_m, north_m, up_m] = sigma_m.unwrap_or([f64::NAN; 3]);
    [north_m, east_m, up_m]
        .into_iter()
        .try_for_each(|sigma_m| fields.fixed(not_negative(sigma_m), 3, LARGEST_SIGMA_M))
}

fn gst(
    fields: &mut Fields<'_>,
    report: &EpochReport,
    position: Option<Position>,
    clock: Option<Clock>,
) -> Result<(), Full> {
    fields.time(clock.map(|clock| clock.time))?;
    let rms_m = report.residual_rms_m.and_then(not_negative);
    fields.fixed(rms_m, 3, LARGEST_SIGMA_M)?;
    fields.empties(3)?;
    sigmas(fields, report, position)
}

fn gbs(
    fields: &mut Fields<'_>,
    report: &EpochReport,
    position: Option<Position>,
    clock: Option<Clock>,
) -> Result<(), Full> {
    fields.time(clock.map(|clock| clock.time))?;
    sigmas(fields, report, position)?;
    // An excluded satellite that is observed no more has a name and no bias.
    let excluded = || report.verdict.excluded.iter().next();
    let suspect = report.suspect.as_ref();
    let Some(satellite) = suspect.map(|s| s.satellite).or_else(excluded) else {
        return fields.empties(6);
    };
    fields.integer(u64::from(satellite.prn()), 2)?;
    fields.fixed(suspect.and_then(|s| not_negative(s.p_md)), 5, 1)?;
    fields.fixed(suspect.map(|s| s.bias_m), 2, LARGEST_BIAS_M)?;
    fields.fixed(
        suspect.and_then(|s| not_negative(s.sigma_m)),
        2,
        LARGEST_SIGMA_M,
    )?;
    fields.letter(Some(match satellite.system() {
        System::Gps => b'1',
        System::Galileo => b'3',
        System::Bds => b'4',
    }))?;
    fields.letter(Some(b'0'))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::Satellite;
    use crate::gnss::solution::SATELLITE_REASONS;
    use crate::integrity::{InertialStatus, Mode, ProtectionLevel, Suspect, Verdict};
    use crate::report::ReportFlags;
    use std::string::String;
    use std::vec::Vec;

    fn satellite(system: System, prn: u8) -> Satellite {
        Satellite::new(system, prn).unwrap()
    }

    fn report() -> EpochReport {
        let mut verdict = Verdict::unavailable(Reason::None, 40.0, Some(35.0));
        verdict.integrity = Integrity::Nominal;
        verdict.hpl = ProtectionLevel::Bound(11.0);
        verdict.vpl = ProtectionLevel::Bound(17.0);
        let mut used = SatelliteSet::EMPTY;
        for prn in 1..=9 {
            used.insert(satellite(System::Gps, prn));
        }
        EpochReport {
            time: GpsTime::from_week_tow_ns(2420, 274_200 * NS_PER_S + 104_999_999),
            since_first_ns: 0,
            mode: Mode::Snapshot,
            fix: Some(Fix {
                r_e_m: [0.0; 3],
                lat_deg: 55.5,
                lon_deg: -8.25,
                h_m: 43.123_6,
                velocity_enu_mps: Some([-30.0, 40.0, 1.0]),
                clock_m: [None; 3],
            }),
            verdict,
            used,
            n_observed: 9,
            unused: [0; SATELLITE_REASONS],
            flags: ReportFlags::default(),
            residual_rms_m: Some(0.75),
            sigma_enu_m: Some([0.5, 0.625, 1.5]),
            suspect: None,
            navigation: None,
            inertial: InertialStatus::Off,
        }
    }

    fn sentences(report: &EpochReport) -> Vec<String> {
        let mut out = [0; MAX_SENTENCES_BYTES];
        let length = encode(report, &mut out).unwrap();
        let text = String::from_utf8(out[..length].to_vec()).unwrap();
        let without_sum = |line: &str| line[..line.len() - 3].into();
        let lines: Vec<String> = text.split_terminator("\r\n").map(without_sum).collect();
        assert_eq!(lines.len(), 4);
        lines
    }

    fn field(line: &str, number: usize) -> &str {
        line.split(',').nth(number).unwrap()
    }

    #[test]
    fn an_epoch_is_four_sentences() {
        assert_eq!(
            sentences(&report()),
            [
                "$GPGGA,040942.10,5530.0000000,N,00815.0000000,W,1,09,,43.124,M,0.0,M,,",
                "$GPRMC,040942.10,A,5530.0000000,N,00815.0000000,W,97.19,323.13,270526,,,A,S",
                "$GPGST,040942.10,0.750,,,,0.625,0.500,1.500",
                "$GPGBS,040942.10,0.625,0.500,1.500,,,,,,",
            ]
        );
    }

    #[test]
    fn the_failed_satellite_has_its_bias_in_gbs() {
        let mut report = report();
        report.verdict.integrity = Integrity::Excluded;
        for (satellite, tail) in [
            (satellite(System::Gps, 4), "04,0.00100,-41.50,3.25,1,0"),
            (satellite(System::Galileo, 36), "36,0.00100,-41.50,3.25,3,0"),
            (satellite(System::Bds, 63), "63,0.00100,-41.50,3.25,4,0"),
        ] {
            report.suspect = Some(Suspect {
                satellite,
                bias_m: -41.5,
                sigma_m: 3.25,
                p_md: 1e-3,
            });
            let [_, rmc, _, gbs] = &sentences(&report)[..] else {
                panic!()
            };
            assert_eq!(
                *gbs,
                std::format!("$GPGBS,040942.10,0.625,0.500,1.500,{tail}")
            );
            assert!(rmc.ends_with(",A,S"), "{rmc}");
        }
        report.suspect = None;
        report.verdict.excluded.insert(satellite(System::Bds, 7));
        assert!(sentences(&report)[3].ends_with(",07,,,,4,0"));
    }

    /// INT-055.
    #[test]
    fn a_position_that_must_not_be_used_is_not_there() {
        let mut without_fix = report();
        without_fix.fix = None;
        let mut not_finite = report();
        not_finite.fix.as_mut().unwrap().lat_deg = f64::NAN;
        let mut beyond = report();
        beyond.fix.as_mut().unwrap().lon_deg = 181.0;
        let mut alert = report();
        alert.verdict.integrity = Integrity::Alert;
        alert.verdict.reason = Reason::FaultNotIsolated;
        let unavailable = |reason| {
            let mut report = report();
            report.verdict.integrity = Integrity::Unavailable;
            report.verdict.reason = reason;
            report
        };
        for (report, status) in [
            (alert, "U"),
            (unavailable(Reason::HplAboveLimit), "U"),
            (unavailable(Reason::VplAboveLimit), "U"),
            (unavailable(Reason::NoRedundancy), "C"),
            (unavailable(Reason::DeadlineMissed), "C"),
            (unavailable(Reason::ReceiverSilent), "C"),
            (without_fix, "V"),
            (not_finite, "C"),
            (beyond, "C"),
        ] {
            let [gga, rmc, gst, gbs] = &sentences(&report)[..] else {
                panic!()
            };
            assert_eq!(*gga, "$GPGGA,040942.10,,,,,0,09,,,M,,M,,");
            assert_eq!(
                *rmc,
                std::format!("$GPRMC,040942.10,V,,,,,,,270526,,,N,{status}")
            );
            assert_eq!(*gst, "$GPGST,040942.10,0.750,,,,,,");
            assert_eq!(*gbs, "$GPGBS,040942.10,,,,,,,,,");
        }
    }

    #[test]
    fn the_talker_is_that_of_the_satellites_used() {
        let talker_of = |systems: &[System]| {
            let mut report = report();
            report.used = SatelliteSet::EMPTY;
            for system in systems {
                report.used.insert(satellite(*system, 5));
            }
            String::from(&sentences(&report)[0][1..3])
        };
        assert_eq!(talker_of(&[System::Gps]), "GP");
        assert_eq!(talker_of(&[System::Galileo]), "GA");
        assert_eq!(talker_of(&[System::Bds]), "GB");
        assert_eq!(talker_of(&[System::Gps, System::Bds]), "GN");
        assert_eq!(talker_of(&System::ALL), "GN");
        assert_eq!(talker_of(&[]), "GN");
    }

    #[test]
    fn a_position_without_satellites_is_estimated() {
        let mut report = report();
        report.used = SatelliteSet::EMPTY;
        let lines = sentences(&report);
        assert_eq!((field(&lines[0], 6), field(&lines[0], 7)), ("6", "00"));
        assert!(lines[1].ends_with(",E,S"));
    }

    #[test]
    fn times_roll_over_at_midnight_at_the_week_and_at_a_leap_second() {
        let time_and_date = |time: GpsTime| {
            let mut report = report();
            report.time = time;
            let rmc = sentences(&report).remove(1);
            std::format!("{} {}", field(&rmc, 1), field(&rmc, 9))
        };
        let midnight = GpsTime::from_week_tow_s(2420, 4 * 86_400 + 18);
        assert_eq!(time_and_date(midnight), "000000.00 280526");
        assert_eq!(
            time_and_date(midnight.plus_ns(-5_000_000)),
            "000000.00 280526"
        );
        assert_eq!(
            time_and_date(midnight.plus_ns(-5_000_001)),
            "235959.99 270526"
        );
        let week = GpsTime::from_week_tow_s(2421, 0);
        assert_eq!(time_and_date(week), "235942.00 300526");
        let leap = GpsTime::from_week_tow_s(1930, 18);
        assert_eq!(
            time_and_date(leap.plus_ns(-NS_PER_S / 2)),
            "235960.50 311216"
        );
        assert_eq!(time_and_date(leap), "000000.00 010117");
        time_and_date(GpsTime::from_ns(i64::MIN));
        time_and_date(GpsTime::from_ns(i64::MAX));

        let mut report = report();
        report.flags.week_unknown = true;
        for line in sentences(&report) {
            assert_eq!(field(&line, 1), "");
        }
        assert_eq!(field(&sentences(&report)[1], 9), "");
    }

    #[test]
    fn a_course_is_there_only_when_something_moves() {
        let speed_and_course = |velocity| {
            let mut report = report();
            report.fix.as_mut().unwrap().velocity_enu_mps = velocity;
            let rmc = sentences(&report).remove(1);
            std::format!("{} {}", field(&rmc, 7), field(&rmc, 8))
        };
        assert_eq!(speed_and_course(None), " ");
        assert_eq!(speed_and_course(Some([0.0; 3])), "0.00 ");
        assert_eq!(speed_and_course(Some([0.0, 0.0999, 5.0])), "0.19 ");
        assert_eq!(speed_and_course(Some([0.0, 10.0, 0.0])), "19.44 0.00");
        assert_eq!(speed_and_course(Some([10.0, 0.0, 0.0])), "19.44 90.00");
        assert_eq!(speed_and_course(Some([0.0, -10.0, 0.0])), "19.44 180.00");
        assert_eq!(speed_and_course(Some([-1e-9, 10.0, 0.0])), "19.44 0.00");
        assert_eq!(speed_and_course(Some([f64::NAN, 10.0, 0.0])), " ");
        assert_eq!(speed_and_course(Some([1e200, 0.0, 0.0])), " ");
    }

    #[test]
    fn the_longest_sentences_fit() {
        let mut report = report();
        report.used = SatelliteSet::from_masks([u64::MAX >> 16; 3]);
        report.fix = Some(Fix {
            r_e_m: [0.0; 3],
            lat_deg: -89.999,
            lon_deg: -179.999,
            h_m: -999_999.0,
            velocity_enu_mps: Some([-5143.0, 1.0, 0.0]),
            clock_m: [None; 3],
        });
        report.residual_rms_m = Some(9999.0);
        report.sigma_enu_m = Some([9999.0; 3]);
        report.suspect = Some(Suspect {
            satellite: satellite(System::Bds, 63),
            bias_m: -999_999.0,
            sigma_m: 9999.0,
            p_md: 1e-3,
        });
        let lengths: Vec<usize> = sentences(&report).iter().map(|s| s.len() + 5).collect();
        assert_eq!(lengths[1..], [MAX_SENTENCE_LENGTH, 60, MAX_SENTENCE_LENGTH]);
        let mut out = [0; MAX_SENTENCES_BYTES];
        let whole = encode(&report, &mut out).unwrap();
        for size in 0..whole {
            assert_eq!(encode(&report, &mut out[..size]), Err(Full), "{size}");
        }
        assert_eq!(encode(&report, &mut out[..whole]), Ok(whole));
    }
}
