//! Recordings of inertial units.
//!
//! A CSV file has one sample per line. Rates become increments over the time since the line before,
//! at most one and a half nominal intervals: over a gap nothing is known, and the monitor has to see
//! that it is there. Times are read as decimals, not as binary fractions, so that no nanosecond is lost.

use std::path::Path;

use anyhow::{Context, Result, bail};
use surefix_core::ingest::{Event, Ingest};
use surefix_core::ins::{ImuSample, InertialConfig, Magnetometer, UnitConfig, UnitSample};
use surefix_core::time::{GpsTime, NS_PER_S};
use surefix_core::wire::native::Frame;

use super::Measured;
use super::settings::{
    AccelerometerUnit, Column, FileSettings, GyroscopeUnit, ImuSettings, STANDARD_GRAVITY_MPS2,
    TimeScale,
};
use crate::rinex::read_argument;

/// 1980-01-06 as seconds since 1970-01-01.
const GPS_EPOCH_UNIX_S: i64 = 315_964_800;

/// A recording of a unit.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// What is known of the unit.
    pub unit: InertialConfig,
    /// What is known of a magnetometer beside it.
    pub magnetometer: Option<Magnetometer>,
    /// Its samples, in the order of the file.
    pub samples: Vec<ImuSample>,
    /// How long after its instant an epoch of the receiver beside it arrives, ns.
    pub receiver_latency_ns: u32,
    /// The units that vote, with their numbers; `unit` is then what the vote gives.
    pub units: Vec<(u8, UnitConfig)>,
    /// Their samples, in the order of the file; there are then no others.
    pub unit_samples: Vec<(u8, UnitSample)>,
    /// Lines or frames that could not be read.
    pub bad_lines: u64,
}

/// Reads a recording: CSV as `settings` describe it, or surefix's own frames, which may say
/// themselves what is known of the unit; `settings` win.
///
/// # Errors
/// When it cannot be read, the settings do not fit it, or it holds no sample; the message tells what
/// to do.
pub fn read(path: &Path, settings: Option<&ImuSettings>) -> Result<Recorded> {
    let bytes = read_argument("--imu", "a recording of an inertial unit", path)?;
    if holds_frames(&bytes) {
        return read_frames(&bytes, settings).with_context(|| format!("{}", path.display()));
    }
    let Some(settings) = settings else {
        bail!(
            "--imu {}: say what the unit is in a section [imu] of the file of --config; docs/examples holds such files",
            path.display()
        );
    };
    let unit = settings.inertial_config()?;
    let (samples, bad_lines) = read_csv_file(path, &String::from_utf8_lossy(&bytes), settings)?;
    Ok(Recorded {
        unit,
        magnetometer: settings.magnetometer()?,
        samples,
        receiver_latency_ns: settings.receiver_latency_ns()?,
        units: Vec::new(),
        unit_samples: Vec::new(),
        bad_lines,
    })
}

/// Whether a file holds surefix's own frames and no text.
fn holds_frames(bytes: &[u8]) -> bool {
    bytes
        .windows(2)
        .take(4096)
        .enumerate()
        .any(|(k, pair)| pair == b"SF" && Frame::parse(bytes.get(k..).unwrap_or_default()).is_ok())
}

/// The text of a CSV file.
///
/// # Errors
/// When it cannot be read, or holds frames.
pub(super) fn csv_text(path: &Path) -> Result<String> {
    let bytes = read_argument("--imu", "a recording of an inertial unit", path)?;
    if holds_frames(&bytes) {
        bail!(
            "--imu {}: surefix's own frames hold all units in one file; give it alone, without sections [[imu.unit]]",
            path.display()
        );
    }
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// The samples of the text of a CSV file, and the number of lines without one.
///
/// # Errors
/// When the settings do not fit it, or it holds no sample.
pub(super) fn read_csv_file(
    path: &Path,
    text: &str,
    settings: &ImuSettings,
) -> Result<(Vec<ImuSample>, u64)> {
    let name = path.display();
    let Some(file) = settings.file() else {
        bail!(
            "--imu {name}: say what its columns hold in a section [imu.file]; docs/examples holds such files"
        );
    };
    read_csv(text, file, settings.interval_ns()?).with_context(|| format!("{name}"))
}

impl Recorded {
    /// Every sample.
    pub fn measured(&self) -> Vec<Measured> {
        let alone = self.samples.iter().copied().map(Measured::Alone);
        let of_units = self.unit_samples.iter();
        alone
            .chain(of_units.map(|(unit, sample)| Measured::OfUnit(*unit, *sample)))
            .collect()
    }
}

fn read_frames(bytes: &[u8], settings: Option<&ImuSettings>) -> Result<Recorded> {
    let mut unit = settings.map(ImuSettings::inertial_config).transpose()?;
    let mut latency_ns = settings.map(ImuSettings::receiver_latency_ns).transpose()?;
    let mut ingest = Box::new(Ingest::EMPTY);
    let magnetometer = settings.map(ImuSettings::magnetometer).transpose()?;
    let mut magnetometer = magnetometer.flatten();
    let (mut samples, mut rest) = (Vec::new(), bytes);
    let (mut units, mut unit_samples) = (Vec::new(), Vec::new());
    loop {
        let (used, mut event) = ingest.push(rest);
        rest = rest.get(used..).unwrap_or_default();
        if event == Event::Nothing {
            event = ingest.finish();
        }
        match event {
            Event::Imu(sample) => samples.push(sample),
            Event::Unit { unit, config } => units.push((unit, config)),
            Event::UnitSample { unit, sample } => unit_samples.push((unit, sample)),
            Event::Inertial(said) => {
                unit.get_or_insert(said);
            }
            Event::ReceiverLatency(said_ns) => {
                latency_ns.get_or_insert(said_ns);
            }
            Event::Magnetometer(said) => {
                magnetometer.get_or_insert(said);
            }
            Event::EpochReady | Event::CorrectedEpochReady => {
                bail!("it holds observations too: give the whole stream as --gnss, without --imu")
            }
            Event::EndOfStream if rest.is_empty() => break,
            _ => {}
        }
    }
    let counters = ingest.counters();
    let bad_lines = [
        counters.native_bad_crc,
        counters.native_refused,
        counters.cut_off_frames,
    ];
    if samples.is_empty() && unit_samples.is_empty() {
        bail!("it holds no inertial sample: give a recording of an inertial unit");
    }
    if !samples.is_empty() && !unit_samples.is_empty() {
        bail!("it holds samples with and without the number of their unit: give one or the other");
    }
    let Some(unit) = unit else {
        bail!("it does not say what the unit is: add a section [imu] to the file of --config");
    };
    Ok(Recorded {
        unit,
        magnetometer,
        samples,
        receiver_latency_ns: latency_ns.unwrap_or(0),
        units,
        unit_samples,
        bad_lines: bad_lines.into_iter().map(u64::from).sum(),
    })
}

/// Places of the columns: time, accelerometer, gyroscope.
struct Places([usize; 7]);

impl Places {
    fn find(file: &FileSettings, first_line: &str) -> Result<Self> {
        let header: Vec<&str> = first_line.split(',').map(str::trim).collect();
        let mut places = [0; 7];
        let columns = std::iter::once(&file.time)
            .chain(&file.accelerometer)
            .chain(&file.gyroscope);
        for (place, column) in places.iter_mut().zip(columns) {
            *place = match column {
                Column::Number(0) => bail!("[imu.file]: columns are numbered from 1, not from 0"),
                Column::Number(number) => number - 1,
                Column::Name(name) => match header.iter().position(|word| word == name) {
                    Some(place) => place,
                    None => bail!(
                        "line 1: there is no column \"{name}\", which [imu.file] names; it reads \"{}\": give one of its names, or the column's number",
                        clip(first_line)
                    ),
                },
            };
        }
        Ok(Self(places))
    }

    /// The words of a line, or what is wrong with it.
    fn numbers(&self, line: &str) -> Result<(i64, [f64; 6]), String> {
        let words: Vec<&str> = line.split(',').map(str::trim).collect();
        let mut found = self.0.iter().map(|place| {
            words.get(*place).copied().ok_or_else(|| {
                format!(
                    "has {} columns, and column {} is asked for",
                    words.len(),
                    place + 1
                )
            })
        });
        let time = found.next().unwrap_or(Ok(""))?;
        let time_ns =
            decimal_ns(time).ok_or_else(|| format!("\"{}\" is no time in seconds", clip(time)))?;
        let mut values = [0.0; 6];
        for (value, word) in values.iter_mut().zip(found) {
            let word = word?;
            // Not a number is what a failed sensor gives; the monitor has to hear of it.
            *value = word
                .parse()
                .map_err(|_| format!("\"{}\" is no number", clip(word)))?;
        }
        Ok((time_ns, values))
    }
}

fn clip(text: &str) -> String {
    text.chars().take(60).collect()
}

/// Nanoseconds of a decimal number of seconds; digits beyond the ninth are cut off.
fn decimal_ns(text: &str) -> Option<i64> {
    let (is_negative, digits) = match text.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, text),
    };
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    if whole.is_empty() || !fraction.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    if !whole.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let padded: String = fraction
        .chars()
        .chain("000000000".chars())
        .take(9)
        .collect();
    let ns = whole
        .parse::<i64>()
        .ok()?
        .checked_mul(NS_PER_S)?
        .checked_add(padded.parse().ok()?)?;
    Some(if is_negative { -ns } else { ns })
}

fn read_csv(text: &str, file: &FileSettings, nominal_ns: u32) -> Result<(Vec<ImuSample>, u64)> {
    let zero = match (file.time_scale, file.week) {
        (TimeScale::GpstUnixS, None) => GpsTime::from_ns(-GPS_EPOCH_UNIX_S * NS_PER_S),
        (TimeScale::GpstSow, Some(week)) => GpsTime::from_week_tow_s(week.into(), 0),
        (TimeScale::ScenarioS, week) => GpsTime::from_week_tow_s(week.unwrap_or(0).into(), 0),
        (TimeScale::GpstSow, None) => {
            bail!("[imu.file] time_scale = \"gpst_sow\" counts from the start of a week: give week")
        }
        (TimeScale::GpstUnixS, Some(_)) => {
            bail!(
                "[imu.file] time_scale = \"gpst_unix_s\" names every instant by itself: leave out week"
            )
        }
    };
    if !(-1e6..=1e6).contains(&file.time_offset_s) {
        bail!(
            "[imu.file] time_offset_s = {} is not a number of seconds",
            file.time_offset_s
        );
    }
    let offset_ns = (file.time_offset_s * 1e9).round() as i64;
    let accelerometer = match file.accelerometer_unit {
        AccelerometerUnit::StandardGravity => (STANDARD_GRAVITY_MPS2, true),
        AccelerometerUnit::MetrePerSecondSquared => (1.0, true),
        AccelerometerUnit::MetrePerSecond => (1.0, false),
    };
    let gyroscope = match file.gyroscope_unit {
        GyroscopeUnit::DegreePerSecond => (1_f64.to_radians(), true),
        GyroscopeUnit::RadianPerSecond => (1.0, true),
        GyroscopeUnit::Degree => (1_f64.to_radians(), false),
        GyroscopeUnit::Radian => (1.0, false),
    };
    if accelerometer.1 != gyroscope.1 {
        bail!(
            "[imu.file]: one of accelerometer_unit and gyroscope_unit is that of a rate, the other that of an increment: take g or m/s2 with deg/s or rad/s, or m/s with deg or rad"
        );
    }
    let is_rate = gyroscope.1;

    let places = Places::find(file, text.lines().next().unwrap_or_default())?;
    let longest_ns = i64::from(nominal_ns) + i64::from(nominal_ns) / 2;
    let (mut samples, mut bad_lines, mut first_bad) = (Vec::new(), 0, None);
    let mut last: Option<GpsTime> = None;
    for (index, line) in text.lines().enumerate() {
        if line.trim().is_empty() {
            continue;
        }
        let (time_ns, [fx, fy, fz, wx, wy, wz]) = match places.numbers(line) {
            Ok(numbers) => numbers,
            // The names of the columns.
            Err(_) if index == 0 => continue,
            Err(wrong) => {
                bad_lines += 1;
                first_bad.get_or_insert(format!("line {}: {wrong}", index + 1));
                continue;
            }
        };
        let time = zero.plus_ns(time_ns).plus_ns(offset_ns);
        let since_last_ns = last.map_or(0, |last| time.ns().saturating_sub(last.ns()));
        last = Some(time);
        // The first sample, and one that is not later than the one before it, took the usual time.
        let interval_ns = match since_last_ns {
            ..=0 => nominal_ns,
            longer if longer > longest_ns => {
                if is_rate {
                    longest_ns as u32
                } else {
                    nominal_ns
                }
            }
            step => step as u32,
        };
        let over_s = if is_rate {
            f64::from(interval_ns) / NS_PER_S as f64
        } else {
            1.0
        };
        samples.push(ImuSample {
            time,
            interval_ns,
            dtheta_is_s_rad: [wx, wy, wz].map(|value| value * gyroscope.0 * over_s),
            dv_is_s_mps: [fx, fy, fz].map(|value| value * accelerometer.0 * over_s),
        });
    }
    let first_bad = first_bad.unwrap_or_else(|| "it is empty".into());
    if samples.is_empty() {
        bail!("no line holds a sample ({first_bad}): check the columns in [imu.file]");
    }
    if bad_lines > samples.len() as u64 {
        bail!("{bad_lines} lines hold no sample ({first_bad}): check the columns in [imu.file]");
    }
    if file.time_scale == TimeScale::GpstUnixS && samples.iter().all(|s| s.time.ns() < 0) {
        bail!(
            "[imu.file] time_scale = \"gpst_unix_s\" counts seconds from 1970, and these would lie before GPS time began in 1980: for seconds of a GPS week give \"gpst_sow\" and week, for those of a scenario \"scenario_s\""
        );
    }
    Ok((samples, bad_lines))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(text: &str) -> FileSettings {
        toml::from_str(text).unwrap()
    }

    const RATES: &str = "time = 1\naccelerometer = [2, 3, 4]\ngyroscope = [5, 6, 7]\n\
        accelerometer_unit = \"g\"\ngyroscope_unit = \"deg/s\"\n";

    #[test]
    fn decimals_lose_no_nanosecond() {
        assert_eq!(
            decimal_ns("1756402240.961000001"),
            Some(1_756_402_240_961_000_001)
        );
        assert_eq!(decimal_ns("-0.5"), Some(-500_000_000));
        assert_eq!(decimal_ns("7"), Some(7_000_000_000));
        for nonsense in ["", ".", "-", "1e3", "nan", "1.2.3", "t_s", "99999999999999"] {
            assert_eq!(decimal_ns(nonsense), None, "{nonsense}");
        }
    }

    #[test]
    fn rates_become_increments_and_a_gap_stays_one() {
        let settings = file(&format!(
            "{RATES}time_scale = \"gpst_unix_s\"\ntime_offset_s = -0.125\n"
        ));
        let text = "315964801.000,0,0,1,180,0,0\n\
                    315964801.008,0,0,1,180,0,0\n\
                    315964801.020,0,0,1,180,0,0\n\
                    315964803.000,0,0,1,180,0,0\n\
                    315964802.990,0,0,nan,180,0,0\n\
                    half a li\n";
        let (samples, bad) = read_csv(text, &settings, 10_000_000).unwrap();
        let steps: Vec<_> = samples
            .iter()
            .map(|s| (s.time.ns() / 1_000_000, s.interval_ns / 1_000_000))
            .collect();
        assert_eq!(
            steps,
            [(875, 10), (883, 8), (895, 12), (2875, 15), (2865, 10)]
        );
        let angle = |k: usize| samples[k].dtheta_is_s_rad[0] / core::f64::consts::PI;
        assert!((angle(1) - 0.008).abs() < 1e-15 && (angle(3) - 0.015).abs() < 1e-15);
        assert!((samples[2].dv_is_s_mps[2] - 9.806_65 * 0.012).abs() < 1e-15);
        assert!(samples[4].dv_is_s_mps[2].is_nan());
        assert_eq!(bad, 1);
    }

    #[test]
    fn increments_of_a_scenario_are_taken_as_they_are() {
        let settings = file(
            "time = \"t_s\"\naccelerometer = [\"dv_x\", \"dv_y\", \"dv_z\"]\n\
             gyroscope = [\"dth_x\", \"dth_y\", \"dth_z\"]\n\
             accelerometer_unit = \"m/s\"\ngyroscope_unit = \"rad\"\ntime_scale = \"scenario_s\"\n",
        );
        let text = "t_s,dth_x,dth_y,dth_z,dv_x,dv_y,dv_z\n\
                    0.01,1e-5,2e-5,3e-5,4e-2,5e-2,6e-2\n0.02,0,0,0,0,0,0\n";
        let (samples, bad) = read_csv(text, &settings, 10_000_000).unwrap();
        assert_eq!((samples.len(), bad), (2, 0));
        assert_eq!(samples[0].time, GpsTime::from_ns(10_000_000));
        assert_eq!(samples[0].dtheta_is_s_rad, [1e-5, 2e-5, 3e-5]);
        assert_eq!(samples[0].dv_is_s_mps, [4e-2, 5e-2, 6e-2]);
        let renamed = text.replace("dv_y", "speed");
        let error = read_csv(&renamed, &settings, 10_000_000)
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("line 1") && error.contains("dv_y"),
            "{error}"
        );
    }

    #[test]
    fn settings_that_do_not_fit_are_refused_with_the_next_step() {
        let refused = |more: &str, text: &str, words: &[&str]| {
            let error = read_csv(text, &file(&format!("{RATES}{more}")), 10_000_000);
            let message = error.unwrap_err().to_string();
            assert!(words.iter().all(|word| message.contains(word)), "{message}");
        };
        let line = "1,0,0,1,0,0,0\n";
        refused("time_scale = \"gpst_sow\"\n", line, &["week"]);
        refused(
            "time_scale = \"gpst_unix_s\"\nweek = 7\n",
            line,
            &["leave out week"],
        );
        let scenario = "time_scale = \"scenario_s\"\n";
        refused(scenario, "", &["empty"]);
        refused(
            scenario,
            "a,b\n1,2\n3,4\n",
            &["line 2", "2 columns", "column 3"],
        );
        refused(scenario, "t\n1,0,0,x,0,0,0\n", &["line 2", "\"x\""]);
        refused(
            "time_scale = \"gpst_unix_s\"\n",
            "1,0,0,1,0,0,0\n2,0,0,1,0,0,0\n",
            &["1980", "time_scale", "gpst_sow", "scenario_s"],
        );
        let mixed = RATES.replace("deg/s", "deg") + scenario;
        let message = read_csv(line, &file(&mixed), 10_000_000)
            .unwrap_err()
            .to_string();
        assert!(message.contains("increment"), "{message}");
    }
}
