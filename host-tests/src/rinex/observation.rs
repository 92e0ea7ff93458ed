//! RINEX 3 and 4 observation files, one epoch at a time.
//!
//! | RINEX | becomes | unit |
//! |---|---|---|
//! | C | `pseudorange_m` | m, as printed |
//! | L | `carrier_phase_cycles` | cycles, as printed |
//! | D | `range_rate_mps` = −(c/f)·D | m/s; RINEX counts an approaching satellite positive |
//! | S | `cn0_dbhz` | dB-Hz, as printed |
//!
//! A blank and 0.0 both mean "not measured" ([RINEX-3.05] table A3). An epoch's time is turned into
//! GPST digit by digit.

use std::collections::BTreeMap;

use surefix_core::consts::SPEED_OF_LIGHT_MPS;
use surefix_core::gnss::observation::NotAdded;
use surefix_core::gnss::{ObservationEpoch, Satellite, Signal, SignalObservation, System};
use surefix_core::time::{GPST_MINUS_BDT_S, GpsTime, NS_PER_S};

use super::RinexError;
use super::fields::{calendar, columns, integer, label, number, satellite};

/// Width of one observation: F14.3 and two flags.
const FIELD: usize = 16;

/// What no receiver measures: m, cycles. Beyond it a field is broken, not far away.
const MAX_RANGE: f64 = 1e10;
/// Largest Doppler, Hz: 1000 km/s at the highest carrier.
const MAX_DOPPLER_HZ: f64 = 5e6;
/// Largest carrier-to-noise density, dB-Hz; receivers that print other units have none.
const MAX_CN0_DBHZ: f64 = 100.0;

/// Columns of one signal's observations in a satellite's line.
#[derive(Clone, Copy, Debug)]
struct SignalColumns {
    signal: Signal,
    /// c/f, m.
    wavelength_m: Option<f64>,
    code: Option<usize>,
    phase: Option<usize>,
    doppler: Option<usize>,
    strength: Option<usize>,
}

/// Time scale of the epoch lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TimeScale {
    /// GPST, and GST and QZSST, which count the same seconds.
    Gps,
    /// BDT.
    Bds,
}

/// What the header says.
#[derive(Clone, Debug, Default)]
pub struct ObservationHeader {
    /// Version, as printed.
    pub version: f64,
    /// `APPROX POSITION XYZ`, m, ECEF; `None` when absent or the origin.
    pub approximate_position_m: Option<[f64; 3]>,
    /// `ANTENNA: DELTA H/E/N`, m. Not applied.
    pub antenna_delta_hen_m: Option<[f64; 3]>,
    /// Observation codes by system letter, in column order.
    pub codes: BTreeMap<char, Vec<String>>,
}

/// What was skipped, and what could not be read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ObservationCounts {
    /// Epochs yielded.
    pub epochs: u64,
    /// Satellite lines of constellations surefix does not use, by RINEX letter.
    pub other_systems: BTreeMap<char, u64>,
    /// Event records between epochs.
    pub events: u64,
    /// Epochs whose line could not be read; their satellites are lost.
    pub bad_epochs: u64,
    /// Satellite lines that could not be read.
    pub bad_lines: u64,
    /// Fields that are no number, or one no receiver measures.
    pub bad_fields: u64,
    /// Signals or satellites that an epoch has no room for.
    pub no_room: u64,
}

/// Reads epochs from the text of an observation file.
pub struct ObservationReader<'t> {
    lines: std::iter::Peekable<std::str::Lines<'t>>,
    header: ObservationHeader,
    scale: TimeScale,
    columns: [Vec<SignalColumns>; 3],
    counts: ObservationCounts,
}

impl<'t> ObservationReader<'t> {
    /// Reads the header.
    pub fn new(text: &'t str) -> Result<Self, RinexError> {
        let mut header = ObservationHeader::default();
        let mut lines = text.lines().peekable();
        let mut system_letter = 'G';
        let mut time_scale = String::new();
        let mut last_codes = ' ';
        let mut number_of_lines = 0;
        let mut ended = false;
        for line in lines.by_ref() {
            number_of_lines += 1;
            match label(line) {
                "RINEX VERSION / TYPE" => {
                    header.version = number(line, 0, 9).unwrap_or(0.0);
                    system_letter = line.chars().nth(40).unwrap_or('G');
                }
                "APPROX POSITION XYZ" => {
                    header.approximate_position_m =
                        triple(line).filter(|xyz| xyz.iter().any(|x| *x != 0.0));
                }
                "ANTENNA: DELTA H/E/N" => header.antenna_delta_hen_m = triple(line),
                "TIME OF FIRST OBS" => time_scale = columns(line, 48, 51).trim().to_owned(),
                "SYS / # / OBS TYPES" => read_codes(line, &mut last_codes, &mut header.codes),
                "END OF HEADER" => {
                    ended = true;
                    break;
                }
                _ => {}
            }
        }
        if !ended {
            return Err(RinexError::Broken {
                line: number_of_lines,
                cause: "the file ends before END OF HEADER".into(),
            });
        }
        let scale = match (time_scale.as_str(), system_letter) {
            ("GPS" | "GAL" | "QZS" | "IRN", _) | ("", 'G' | 'E' | 'M' | 'J' | 'I' | 'S' | ' ') => {
                TimeScale::Gps
            }
            ("BDT" | "BDS", _) | ("", 'C') => TimeScale::Bds,
            (other, _) => {
                return Err(RinexError::Unsupported(format!(
                    "the epochs are in the time scale \"{other}\": GPS, GAL, QZS, IRN and BDT are read; convert the file to GPS time"
                )));
            }
        };
        let mut reader = Self {
            lines,
            header,
            scale,
            columns: Default::default(),
            counts: ObservationCounts::default(),
        };
        reader.lay_out_columns();
        Ok(reader)
    }

    /// What the header says.
    pub fn header(&self) -> &ObservationHeader {
        &self.header
    }

    /// What was skipped so far.
    pub fn counts(&self) -> &ObservationCounts {
        &self.counts
    }

    fn lay_out_columns(&mut self) {
        for system in System::ALL {
            let codes = self.header.codes.get(&system.letter());
            let mut signals: Vec<SignalColumns> = Vec::new();
            for (index, code) in codes.into_iter().flatten().enumerate() {
                let &[kind, band, attribute] = code.as_bytes() else {
                    continue;
                };
                // RINEX 3.02 names B1I "1I"; every other version names it "2I".
                let band = match (system, band, attribute) {
                    (System::Bds, b'1', b'I' | b'Q') => b'2',
                    (System::Bds, b'1', b'X') if self.header.version < 3.03 => b'2',
                    _ => band,
                };
                let Some(signal) = Signal::new(band, attribute) else {
                    continue;
                };
                let place = match signals.iter().position(|s| s.signal == signal) {
                    Some(place) => place,
                    None => {
                        signals.push(SignalColumns {
                            signal,
                            wavelength_m: signal
                                .frequency_hz(system)
                                .map(|f_hz| SPEED_OF_LIGHT_MPS / f_hz),
                            code: None,
                            phase: None,
                            doppler: None,
                            strength: None,
                        });
                        signals.len() - 1
                    }
                };
                match kind {
                    b'C' => signals[place].code = Some(index),
                    b'L' => signals[place].phase = Some(index),
                    b'D' => signals[place].doppler = Some(index),
                    b'S' => signals[place].strength = Some(index),
                    // X (channel number) and I (ionosphere) are no measurements of the signal.
                    _ => {}
                }
            }
            self.columns[system.index()] = signals;
        }
    }

    /// Fills `epoch` with the next epoch; false at the end of the file.
    pub fn next_epoch(&mut self, epoch: &mut ObservationEpoch) -> bool {
        while let Some(line) = self.lines.next() {
            if !line.starts_with('>') {
                if !line.trim().is_empty() {
                    self.counts.bad_lines += 1;
                }
                continue;
            }
            let flag = columns(line, 29, 32).trim().parse().unwrap_or(0_u8);
            let count = integer(line, 32, 35).and_then(|n| usize::try_from(n).ok());
            if flag > 1 {
                self.counts.events += 1;
                self.skip_event(count.unwrap_or(0));
                continue;
            }
            let (Some(time), Some(count)) = (self.epoch_time(line), count) else {
                self.counts.bad_epochs += 1;
                self.skip_event(usize::MAX);
                continue;
            };
            epoch.restart(time);
            // Flag 1: power failed since the last epoch.
            epoch.flags.clock_reset = flag == 1;
            for _ in 0..count {
                if self.lines.peek().is_none_or(|next| next.starts_with('>')) {
                    epoch.flags.incomplete = true;
                    self.counts.bad_lines += 1;
                    break;
                }
                if let Some(line) = self.lines.next() {
                    self.add_satellite(line, epoch);
                }
            }
            self.counts.epochs += 1;
            return true;
        }
        false
    }

    /// Skips up to `count` records, never past the next epoch line; header lines among them count.
    fn skip_event(&mut self, count: usize) {
        let mut last_codes = ' ';
        let mut changed = false;
        for _ in 0..count {
            let Some(record) = self.lines.next_if(|next| !next.starts_with('>')) else {
                break;
            };
            if label(record) == "SYS / # / OBS TYPES" {
                read_codes(record, &mut last_codes, &mut self.header.codes);
                changed = true;
            }
        }
        if changed {
            self.lay_out_columns();
        }
    }

    fn epoch_time(&self, line: &str) -> Option<GpsTime> {
        let mut seconds = columns(line, 18, 29).trim().to_owned();
        // RINEX 4.02 appends five more digits of the second.
        let more = columns(line, 57, 62).trim();
        if self.header.version >= 4.02 && more.len() == 5 {
            seconds.push_str(more);
        }
        let time = calendar(
            integer(line, 2, 6)?,
            integer(line, 7, 9)?,
            integer(line, 10, 12)?,
            integer(line, 13, 15)?,
            integer(line, 16, 18)?,
            &seconds,
        )?;
        Some(match self.scale {
            TimeScale::Gps => time,
            TimeScale::Bds => time.plus_ns(GPST_MINUS_BDT_S * NS_PER_S),
        })
    }

    fn add_satellite(&mut self, line: &str, epoch: &mut ObservationEpoch) {
        let satellite: Satellite = match satellite(columns(line, 0, 3)) {
            Ok(Some(satellite)) => satellite,
            Ok(None) => {
                let letter = line.chars().next().unwrap_or(' ');
                *self.counts.other_systems.entry(letter).or_default() += 1;
                return;
            }
            Err(()) => {
                self.counts.bad_lines += 1;
                return;
            }
        };
        let bad_fields = &mut self.counts.bad_fields;
        let mut field = |index: Option<usize>, limit: f64| -> Option<f64> {
            let from = 3 + FIELD * index?;
            let value = number(line, from, from + 14).filter(|value| value.abs() <= limit);
            if value.is_none() && !columns(line, from, from + 14).trim().is_empty() {
                *bad_fields += 1;
            }
            value.filter(|value| *value != 0.0)
        };
        for places in &self.columns[satellite.system().index()] {
            let observation = SignalObservation {
                signal: places.signal,
                pseudorange_m: field(places.code, MAX_RANGE),
                carrier_phase_cycles: field(places.phase, MAX_RANGE),
                range_rate_mps: places.wavelength_m.and_then(|wavelength_m| {
                    Some(-wavelength_m * field(places.doppler, MAX_DOPPLER_HZ)?)
                }),
                cn0_dbhz: field(places.strength, MAX_CN0_DBHZ)
                    .filter(|cn0| *cn0 > 0.0)
                    .map(|cn0| cn0 as f32),
            };
            let measured = observation.pseudorange_m.is_some()
                || observation.carrier_phase_cycles.is_some()
                || observation.range_rate_mps.is_some();
            if !measured {
                continue;
            }
            match epoch.add(satellite, observation) {
                Ok(()) => {}
                Err(NotAdded::Duplicate) => self.counts.bad_lines += 1,
                Err(NotAdded::SatellitesFull | NotAdded::SignalsFull) => self.counts.no_room += 1,
            }
        }
    }
}

fn triple(line: &str) -> Option<[f64; 3]> {
    Some([
        number(line, 0, 14)?,
        number(line, 14, 28)?,
        number(line, 28, 42)?,
    ])
}

/// One line of `SYS / # / OBS TYPES`; a blank first column continues the system before.
fn read_codes(line: &str, last_system: &mut char, codes: &mut BTreeMap<char, Vec<String>>) {
    let letter = line.chars().next().unwrap_or(' ');
    if letter != ' ' {
        *last_system = letter;
        codes.insert(letter, Vec::new());
    }
    let list = codes.entry(*last_system).or_default();
    list.extend(columns(line, 6, 60).split_whitespace().map(str::to_owned));
}
