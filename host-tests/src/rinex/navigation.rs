//! RINEX 3 and 4 navigation files: the broadcast ephemerides of GPS LNAV, Galileo I/NAV and F/NAV,
//! BDS D1 and D2, and the Klobuchar parameters of the header or of ION records.
//!
//! In: the text of a file. Out: [`NavigationFile`], every ephemeris with the time it was
//! transmitted, in the order of that time.
//!
//! | RINEX | becomes |
//! |---|---|
//! | epoch line | `toc`, from GPST, GST or BDT to GPST |
//! | toe, seconds of week | `toe`: the instant nearest to toc with that time of week, so that no convention of week numbers matters |
//! | transmission time, seconds of week | the instant nearest to toe with that time of week |
//! | SV accuracy, SISA, m | `sigma_ura_m`; `None` for −1 (no prediction) and from 6144 m on (use at own risk) |
//! | Galileo data sources | bit 8 F/NAV, bit 9 I/NAV (which clock); without them bits 0, 2 I/NAV, else bit 1 F/NAV |
//!
//! Sources: [RINEX-3.05] tables A6, A8, A14; the record headers of version 4 after [RINEX-4.01].

use std::collections::BTreeMap;

use surefix_core::gnss::klobuchar::KlobucharParameters;
use surefix_core::gnss::{Ephemeris, NavMessage, Satellite, System};
use surefix_core::time::{GPST_MINUS_BDT_S, GpsTime, NS_PER_S};

use super::RinexError;
use super::fields::{calendar, columns, integer, label, number, satellite};

/// URA from which a satellite is to be used at one's own risk, m. [IS-GPS-200] 20.3.3.3.1.3, N = 15.
const NO_ACCURACY_M: f64 = 6144.0;

/// From here on a transmission time means "not known". [RINEX-3.05] table A6: 0.9999E+09.
const UNKNOWN_TRANSMISSION_S: f64 = 0.9e9;

/// How long before toe GPS starts to transmit an ephemeris, s. [IS-GPS-200] 20.3.4.4, table 20-XII.
const GPS_AHEAD_OF_TOE_S: i64 = 7_200;

/// An ephemeris and the time its message was transmitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedEphemeris {
    /// When it was transmitted; a replay may use it from here on.
    pub transmitted: GpsTime,
    /// The ephemeris.
    pub ephemeris: Ephemeris,
}

/// What a navigation file holds.
#[derive(Clone, Debug, Default)]
pub struct NavigationFile {
    /// Ephemerides in order of transmission, those of equal time in the order of the file.
    pub ephemerides: Vec<TimedEphemeris>,
    /// Ionosphere parameters with the time they were transmitted, `None` for those of the header,
    /// which belong to the whole file.
    pub klobuchar: Vec<(Option<GpsTime>, KlobucharParameters)>,
    /// Records of constellations or message types that are not used, by name ("R", "G CNAV").
    pub other_records: BTreeMap<String, u64>,
    /// Records that could not be read.
    pub bad_records: u64,
}

impl NavigationFile {
    /// Reads the whole file.
    pub fn parse(text: &str) -> Result<Self, RinexError> {
        let mut file = Self::default();
        let mut lines = text.lines().peekable();
        let mut version = 0.0;
        let mut read = 0;
        let mut ended = false;
        let mut header_terms: BTreeMap<String, [f64; 4]> = BTreeMap::new();
        for line in lines.by_ref() {
            read += 1;
            match label(line) {
                "RINEX VERSION / TYPE" => version = number(line, 0, 9).unwrap_or(0.0),
                "IONOSPHERIC CORR" => {
                    let terms = [5, 17, 29, 41].map(|at| number(line, at, at + 12));
                    if let [Some(a), Some(b), Some(c), Some(d)] = terms {
                        // BDS may give one set per satellite: the first stands for all.
                        header_terms
                            .entry(columns(line, 0, 4).trim().to_owned())
                            .or_insert([a, b, c, d]);
                    }
                }
                "END OF HEADER" => {
                    ended = true;
                    break;
                }
                _ => {}
            }
        }
        if !ended {
            return Err(RinexError::Broken {
                line: read,
                cause: "the file ends before END OF HEADER".into(),
            });
        }
        for (system, alpha, beta) in [(System::Gps, "GPSA", "GPSB"), (System::Bds, "BDSA", "BDSB")]
        {
            if let (Some(alpha), Some(beta)) = (header_terms.get(alpha), header_terms.get(beta)) {
                file.klobuchar.push((
                    None,
                    KlobucharParameters {
                        system,
                        alpha: *alpha,
                        beta: *beta,
                    },
                ));
            }
        }

        while let Some(line) = lines.next() {
            if line.trim().is_empty() {
                continue;
            }
            let (kind, message, first) = if let Some(frame) = line.strip_prefix("> ") {
                let mut words = frame.split_whitespace();
                let kind = words.next().unwrap_or_default();
                let message = words.nth(1).unwrap_or_default();
                let Some(first) = lines.next_if(|l| !l.starts_with('>')) else {
                    file.bad_records += 1;
                    continue;
                };
                (kind, message, first)
            } else if version >= 4.0 {
                file.bad_records += 1;
                continue;
            } else {
                ("EPH", "", line)
            };
            let mut record = vec![first];
            while let Some(more) = lines.next_if(|l| l.starts_with("   ") || l.trim().is_empty()) {
                record.push(more);
            }
            match kind {
                "EPH" => file.add_ephemeris(message, &record),
                "ION" => file.add_ionosphere(line, message, &record),
                other => *file.other_records.entry(other.to_owned()).or_default() += 1,
            }
        }
        file.ephemerides.sort_by_key(|e| e.transmitted);
        Ok(file)
    }

    fn add_ephemeris(&mut self, message: &str, record: &[&str]) {
        let Some(first) = record.first() else { return };
        let satellite = match satellite(columns(first, 0, 3)) {
            Ok(Some(satellite)) => satellite,
            Ok(None) => {
                let name = columns(first, 0, 1).to_owned();
                *self.other_records.entry(name).or_default() += 1;
                return;
            }
            Err(()) => {
                self.bad_records += 1;
                return;
            }
        };
        let used = matches!(
            (satellite.system(), message),
            (_, "")
                | (System::Gps, "LNAV")
                | (System::Galileo, "INAV" | "FNAV")
                | (System::Bds, "D1" | "D2")
        );
        if !used {
            let name = format!("{} {message}", satellite.system().letter());
            *self.other_records.entry(name).or_default() += 1;
            return;
        }
        match timed_ephemeris(satellite, message, record) {
            Some(timed) => self.ephemerides.push(timed),
            None => self.bad_records += 1,
        }
    }

    /// An ION record of RINEX 4: the legacy Klobuchar messages of GPS and BDS.
    fn add_ionosphere(&mut self, frame: &str, message: &str, record: &[&str]) {
        let source = satellite(columns(frame, 6, 9));
        let system = match (source, message) {
            (Ok(Some(source)), "LNAV") if source.system() == System::Gps => System::Gps,
            (Ok(Some(source)), "D1D2" | "D1" | "D2") if source.system() == System::Bds => {
                System::Bds
            }
            _ => {
                let name = format!("ION {message}");
                *self.other_records.entry(name).or_default() += 1;
                return;
            }
        };
        let value = |line: usize, from: usize| {
            record
                .get(line)
                .and_then(|text| number(text, from, from + 19))
        };
        let places = [
            (0, 23),
            (0, 42),
            (0, 61),
            (1, 4),
            (1, 23),
            (1, 42),
            (1, 61),
            (2, 4),
        ];
        let terms: Option<Vec<f64>> = places.iter().map(|(l, c)| value(*l, *c)).collect();
        let time = record.first().and_then(|line| epoch(line, system));
        match (terms.as_deref(), time) {
            (Some(&[a0, a1, a2, a3, b0, b1, b2, b3]), Some(time)) => self.klobuchar.push((
                Some(time),
                KlobucharParameters {
                    system,
                    alpha: [a0, a1, a2, a3],
                    beta: [b0, b1, b2, b3],
                },
            )),
            _ => self.bad_records += 1,
        }
    }
}

/// The calendar epoch of a record's first line, from the system's own time to GPST.
fn epoch(line: &str, system: System) -> Option<GpsTime> {
    let time = calendar(
        integer(line, 4, 8)?,
        integer(line, 9, 11)?,
        integer(line, 12, 14)?,
        integer(line, 15, 17)?,
        integer(line, 18, 20)?,
        columns(line, 21, 23),
    )?;
    Some(match system {
        System::Gps | System::Galileo => time,
        System::Bds => time.plus_ns(GPST_MINUS_BDT_S * NS_PER_S),
    })
}

/// Seconds of the system's own week as nanoseconds of the GPS week, not reduced.
fn to_gps_week_ns(sow_s: f64, system: System) -> i64 {
    let own_ns = (sow_s * NS_PER_S as f64).round() as i64;
    match system {
        System::Gps | System::Galileo => own_ns,
        System::Bds => own_ns + GPST_MINUS_BDT_S * NS_PER_S,
    }
}

/// A whole number from 0 to 65535 as printed in a floating-point field.
fn word(value: f64) -> Option<u16> {
    (value.fract() == 0.0 && (0.0..65_536.0).contains(&value)).then_some(value as u16)
}

fn timed_ephemeris(
    satellite: Satellite,
    rinex4_message: &str,
    record: &[&str],
) -> Option<TimedEphemeris> {
    let system = satellite.system();
    let first = record.first()?;
    // Field `column` of broadcast orbit line `line`, both as the tables of [RINEX-3.05] count them.
    let orbit =
        |line: usize, column: usize| number(record.get(line)?, 19 * column - 15, 19 * column + 4);
    let clock = |column: usize| number(first, 4 + 19 * column, 23 + 19 * column);

    let toc = epoch(first, system)?;
    let toe_sow_s = orbit(3, 1)?;
    if !(0.0..=604_800.0).contains(&toe_sow_s) {
        return None;
    }
    let toe = GpsTime::nearest(to_gps_week_ns(toe_sow_s, system), toc);

    let message = match (system, rinex4_message) {
        (System::Gps, _) => NavMessage::GpsLnav,
        (System::Bds, _) => NavMessage::BdsD1D2,
        (System::Galileo, "INAV") => NavMessage::GalileoInav,
        (System::Galileo, "FNAV") => NavMessage::GalileoFnav,
        (System::Galileo, _) => {
            let sources = orbit(5, 2).and_then(word)?;
            let (fnav_clock, inav_clock) = (sources & 1 << 8 != 0, sources & 1 << 9 != 0);
            let (fnav_data, inav_data) = (sources & 0b010 != 0, sources & 0b101 != 0);
            match (fnav_clock, inav_clock, fnav_data, inav_data) {
                (true, false, _, _) | (false, false, true, false) => NavMessage::GalileoFnav,
                // Simulators are seen to name both data sources and no clock: E1 is what is tracked.
                (false, true, _, _) | (false, false, _, true) => NavMessage::GalileoInav,
                // Both clocks or no source at all: whose clock this is cannot be known.
                (true, true, _, _) | (false, false, false, false) => return None,
            }
        }
    };

    let (group_delay_s, transmission) = match system {
        System::Gps => ([orbit(6, 3)?, 0.0], orbit(7, 1)),
        System::Galileo => ([orbit(6, 3)?, orbit(6, 4).unwrap_or(0.0)], orbit(7, 1)),
        System::Bds => ([orbit(6, 3)?, orbit(6, 4)?], orbit(7, 1)),
    };
    let transmitted = match transmission {
        Some(sow_s) if sow_s.abs() < UNKNOWN_TRANSMISSION_S => {
            GpsTime::nearest(to_gps_week_ns(sow_s, system), toe)
        }
        _ => match system {
            System::Gps => toe.plus_ns(-GPS_AHEAD_OF_TOE_S * NS_PER_S),
            System::Galileo | System::Bds => toe,
        },
    };

    let accuracy_m = orbit(6, 1)?;
    Some(TimedEphemeris {
        transmitted,
        ephemeris: Ephemeris {
            satellite,
            message,
            toe,
            toc,
            toe_sow_s,
            issue: word(orbit(1, 1)?)?,
            crs_m: orbit(1, 2)?,
            delta_n_radps: orbit(1, 3)?,
            m0_rad: orbit(1, 4)?,
            cuc_rad: orbit(2, 1)?,
            eccentricity: orbit(2, 2)?,
            cus_rad: orbit(2, 3)?,
            sqrt_a: orbit(2, 4)?,
            cic_rad: orbit(3, 2)?,
            omega0_rad: orbit(3, 3)?,
            cis_rad: orbit(3, 4)?,
            i0_rad: orbit(4, 1)?,
            crc_m: orbit(4, 2)?,
            argument_of_perigee_rad: orbit(4, 3)?,
            omega_dot_radps: orbit(4, 4)?,
            idot_radps: orbit(5, 1)?,
            af0_s: clock(1)?,
            af1_sps: clock(2)?,
            af2_sps2: clock(3)?,
            group_delay_s,
            sigma_ura_m: (0.0..NO_ACCURACY_M)
                .contains(&accuracy_m)
                .then_some(accuracy_m),
            health: word(orbit(6, 2)?)?,
        },
    })
}
