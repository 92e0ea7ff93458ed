//! `surefix campaign aids`: what a barometer and recognised standstills are worth while no satellite is there.
//!
//! A trial is a flight with a seed of its own, flown twice with the same noise, without the aid and with it;
//! the receiver falls silent at a time and stays so. The day's air and the errors of the barometer are
//! drawn by the seed too. The recorded drive is flown once, under a receiver that was synthesised along its
//! track and loses all satellites for a minute again and again, with a barometer synthesised from the
//! track's height.

use std::path::Path;

use anyhow::{Context, Result};
use serde::Serialize;
use surefix_core::config::IonosphereModel;
use surefix_core::ins::{AidUse, AidsConfig, BarometerModel, ZeroVelocityModel};
use surefix_core::integrity::Phase;
use surefix_core::time::GpsTime;

use crate::aiding::{self, AidedRow, Air, fly_aided, pressures};
use crate::hybrid::{self, Reduction};
use crate::replay::{self, ReplayOptions, ReplayResult, TruthChoice};
use crate::simulate::flight::{Flight, geodetic_from_ecef};
use crate::simulate::inertial::sensors::Grade;
use crate::simulate::inertial::{Request, fly};
use crate::truth::Truth;

/// Trials of each row of a table unless told otherwise.
pub const TRIALS: u64 = 10;
/// Into an outage, s.
pub const AFTER_S: [u32; 3] = [10, 30, 60];

/// An aid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Aid {
    /// The barometer.
    Barometer,
    /// Standstills.
    ZeroVelocity,
}

impl Aid {
    /// Its configuration.
    pub fn config(self) -> AidsConfig {
        match self {
            Self::Barometer => AidsConfig {
                barometer: Some(BarometerModel::PRESET),
                ..AidsConfig::NONE
            },
            Self::ZeroVelocity => AidsConfig {
                zero_velocity: Some(ZeroVelocityModel::PRESET),
                ..AidsConfig::NONE
            },
        }
    }
}

/// An outage on a flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// What is done then.
    pub what: &'static str,
    /// Which flight.
    pub flight: Flight,
    /// With which unit.
    pub grade: Grade,
    /// Second of the last epoch before it.
    pub last_s: u32,
    /// Length of the outage, s.
    pub length_s: u32,
    /// The aid.
    pub aid: Aid,
}

/// Level flight, climb, descent, turns; standing on a mast and at a light.
pub const CASES: [Case; 10] = [
    case(
        "level, 100 m/s",
        Flight::P4Flight,
        Grade::Mems,
        260,
        Aid::Barometer,
    ),
    case(
        "level, 100 m/s",
        Flight::P4Flight,
        Grade::Tactical,
        260,
        Aid::Barometer,
    ),
    case(
        "climb, 20° at 100 m/s",
        Flight::P4Flight,
        Grade::Mems,
        358,
        Aid::Barometer,
    ),
    case(
        "lines and half turns, 20 m/s",
        Flight::UavSurvey,
        Grade::Mems,
        120,
        Aid::Barometer,
    ),
    case(
        "glide path, 70 m/s",
        Flight::Lpv200,
        Grade::Tactical,
        150,
        Aid::Barometer,
    ),
    case(
        "glide path, 70 m/s",
        Flight::Lpv200,
        Grade::Mems,
        150,
        Aid::Barometer,
    ),
    case(
        "standing",
        Flight::Static,
        Grade::Mems,
        120,
        Aid::ZeroVelocity,
    ),
    case(
        "standing",
        Flight::Static,
        Grade::Tactical,
        120,
        Aid::ZeroVelocity,
    ),
    case(
        "standing",
        Flight::Static,
        Grade::Navigation,
        120,
        Aid::ZeroVelocity,
    ),
    Case {
        length_s: 25,
        ..case(
            "stop at a light",
            Flight::Drive,
            Grade::Mems,
            124,
            Aid::ZeroVelocity,
        )
    },
];

const fn case(what: &'static str, flight: Flight, grade: Grade, last_s: u32, aid: Aid) -> Case {
    Case {
        what,
        flight,
        grade,
        last_s,
        length_s: 60,
        aid,
    }
}

/// Errors at a time into the outage, m.
#[derive(Clone, Debug, Serialize)]
pub struct ErrorsAfter {
    /// Into the outage, s.
    pub after_s: u32,
    /// Root mean square of horizontal and vertical errors without the aid.
    pub rms_without_m: [f64; 2],
    /// The same with it.
    pub rms_with_m: [f64; 2],
    /// Largest with it.
    pub largest_with_m: [f64; 2],
    /// Root mean square of the vertical error with the aid over the filter's sigma.
    pub vertical_over_sigma: f64,
}

/// A row of the table.
#[derive(Clone, Debug, Serialize)]
pub struct CaseResult {
    /// What was done.
    pub what: &'static str,
    /// Grade of the unit.
    pub grade: &'static str,
    /// The aid.
    pub aid: Aid,
    /// Trials.
    pub trials: u64,
    /// Errors into the outage.
    pub errors: Vec<ErrorsAfter>,
    /// Usable epochs with an error above a level, without and with the aid.
    pub misleading: u64,
}

/// Both flights of a trial.
///
/// # Errors
/// When the flight cannot be simulated or the monitor cannot be run.
pub fn trial(case: &Case, seed: u64) -> Result<[Vec<AidedRow>; 2]> {
    let mut request = Request::new(case.flight, seed);
    request.grade = Some(case.grade);
    request.duration_s = Some(case.last_s + case.length_s + 1);
    let mut scenario = fly(&request)?;
    scenario
        .epochs
        .retain(|epoch| epoch.t_s <= f64::from(case.last_s));
    let air = Air::of_day(seed);
    let samples = match case.aid {
        Aid::Barometer => pressures(&scenario, &air, seed, None),
        Aid::ZeroVelocity => Vec::new(),
    };
    let flown = |aids: &AidsConfig| fly_aided(&scenario, Phase::Npa, true, aids, &samples);
    Ok([flown(&AidsConfig::NONE)?, flown(&case.aid.config())?])
}

/// Horizontal and vertical error and the vertical sigma at a second of a flight, m.
pub fn error_at(rows: &[AidedRow], second: u32) -> Option<[f64; 3]> {
    let row = rows
        .iter()
        .find(|row| (row.t_s - f64::from(second)).abs() < 0.01)?;
    let [e, n, u] = row.error_enu_m?;
    let [_, _, sigma_m] = row.report.navigation?.sigma_position_enu_m;
    Some([e.hypot(n), u.abs(), sigma_m])
}

/// Trials of a case.
///
/// # Errors
/// As [`trial`], or when a flight has no position where one is asked for.
pub fn run_case(case: &Case, seed: u64, trials: u64) -> Result<CaseResult> {
    let after = AFTER_S.iter().filter(|after_s| **after_s <= case.length_s);
    let mut sums = vec![[[0.0; 3]; 2]; after.clone().count()];
    let mut largest = vec![[0.0_f64; 2]; sums.len()];
    let mut misleading = 0;
    for number in 0..trials {
        let flown = trial(case, seed + number)?;
        for (which, rows) in flown.iter().enumerate() {
            misleading += rows.iter().filter(|row| row.misleads()).count() as u64;
            for (place, after_s) in after.clone().enumerate() {
                let second = case.last_s + after_s;
                let [h, v, sigma] = error_at(rows, second).with_context(|| {
                    format!("{}: no position {after_s} s into the outage", case.what)
                })?;
                let sum = &mut sums[place][which];
                sum[0] += h * h;
                sum[1] += v * v;
                sum[2] += (v / sigma) * (v / sigma);
                if which == 1 {
                    largest[place] = [largest[place][0].max(h), largest[place][1].max(v)];
                }
            }
        }
    }
    let rms = |sum: f64| (sum / trials as f64).sqrt();
    let errors = after.zip(sums).zip(largest);
    Ok(CaseResult {
        what: case.what,
        grade: case.grade.name(),
        aid: case.aid,
        trials,
        errors: errors
            .map(|((after_s, [without, with]), largest_with_m)| ErrorsAfter {
                after_s: *after_s,
                rms_without_m: [rms(without[0]), rms(without[1])],
                rms_with_m: [rms(with[0]), rms(with[1])],
                largest_with_m,
                vertical_over_sigma: rms(with[2]),
            })
            .collect(),
        misleading,
    })
}

/// Outages of the drive begin at these seconds.
pub const DRIVE_OUTAGES_S: [f64; 10] = [
    120.0, 240.0, 360.0, 480.0, 600.0, 720.0, 840.0, 960.0, 1080.0, 1200.0,
];

/// The drive without and with aids: errors over its outages.
#[derive(Clone, Debug, Serialize)]
pub struct DriveResult {
    /// Which aids.
    pub aids: &'static str,
    /// Outages.
    pub outages: usize,
    /// After 10, 30, 60 s: root mean square of horizontal and vertical errors, m.
    pub rms_m: [[f64; 2]; 3],
    /// The largest, m.
    pub largest_m: [[f64; 2]; 3],
    /// Usable epochs with an error above a level.
    pub misleading: usize,
    /// Epochs at which a standstill was used.
    pub standstills: usize,
}

/// The drive in a directory of recordings; `work` is written to.
///
/// # Errors
/// When the recording is not there or cannot be replayed.
pub fn drive(data: &Path, examples: &Path, work: &Path, seed: u64) -> Result<Vec<DriveResult>> {
    let recording = data.join("drive0708-adis16465-rtk");
    let drop = DRIVE_OUTAGES_S.map(|from_s| Reduction {
        satellites: 0,
        from_s,
        to_s: from_s + 61.0,
    });
    let hybrid = hybrid::synthesise(&hybrid::Args {
        track: recording.join("gnss_1934_sf.pos"),
        imu: recording.join("derived_imu_gpst_unfiltered.csv"),
        config: examples.join("car-adis16465.toml"),
        nav: data.join("esbc-2020-177/ESBC00DNK_R_20201770000_01D_MN.rnx.gz"),
        satellites: 12,
        drop: drop.to_vec(),
        rate_hz: 1,
        duration: None,
        seed,
        out: work.to_path_buf(),
    })?;
    hybrid::write(&hybrid, work)?;
    let samples = Air::of_day(seed).samples(hybrid.start, hybrid.duration_s, seed, None, |t_s| {
        geodetic_from_ecef(&hybrid.track.state(hybrid.start, t_s).0).2
    });
    let pressure_file = work.join("barometer.csv");
    std::fs::write(&pressure_file, aiding::csv(&samples))?;
    let (barometer, still) = (Aid::Barometer.config(), Aid::ZeroVelocity.config());
    let both = AidsConfig {
        zero_velocity: still.zero_velocity,
        ..barometer
    };
    [
        ("none", AidsConfig::NONE),
        ("barometer", barometer),
        ("standstill", still),
        ("both", both),
    ]
    .into_iter()
    .map(|(name, aids)| {
        let mut options = ReplayOptions::new(work.join("receiver.rtcm3"));
        options.imu = vec![work.join("imu.sfx")];
        options.config.ionosphere = IonosphereModel::None;
        options.truth = TruthChoice::Given(Truth::read(&work.join("truth.csv"))?);
        options.aids = aids;
        options.barometer = aids.barometer.map(|_| pressure_file.clone());
        let result = replay::run(&options, &mut |_, _| {})?;
        Ok(drive_result(name, &result, hybrid.start, hybrid.duration_s))
    })
    .collect()
}

fn drive_result(
    aids: &'static str,
    result: &ReplayResult,
    start: GpsTime,
    duration_s: f64,
) -> DriveResult {
    let rows: Vec<AidedRow> = result
        .reports
        .iter()
        .zip(&result.errors_enu_m)
        .zip(&result.inertial)
        .map(|((report, error_enu_m), inertial)| AidedRow {
            t_s: report.time.seconds_since(start),
            error_enu_m: *error_enu_m,
            report: *report,
            inertial: *inertial,
        })
        .collect();
    let outages = DRIVE_OUTAGES_S
        .iter()
        .filter(|from_s| **from_s + 70.0 < duration_s);
    let (mut squares, mut largest_m) = ([[0.0; 2]; 3], [[0.0_f64; 2]; 3]);
    let mut count = 0;
    for from_s in outages {
        let errors = AFTER_S.map(|after_s| {
            // The last epoch is a second before the outage.
            let at_s = from_s - 1.0 + f64::from(after_s);
            rows.iter()
                .find(|row| (row.t_s - at_s).abs() < 0.3)
                .and_then(|row| row.error_enu_m)
        });
        let [Some(a), Some(b), Some(c)] = errors else {
            continue;
        };
        count += 1;
        for (place, [e, n, u]) in [a, b, c].into_iter().enumerate() {
            let both = [e.hypot(n), u.abs()];
            for axis in 0..2 {
                squares[place][axis] += both[axis] * both[axis];
                largest_m[place][axis] = largest_m[place][axis].max(both[axis]);
            }
        }
    }
    let used = |row: &&AidedRow| {
        row.inertial
            .is_some_and(|inertial| inertial.aids.standstill == AidUse::Used)
    };
    DriveResult {
        aids,
        outages: count,
        rms_m: squares.map(|of| of.map(|square: f64| (square / count as f64).sqrt())),
        largest_m,
        misleading: rows.iter().filter(|row| row.misleads()).count(),
        standstills: rows.iter().filter(used).count(),
    }
}

/// Lines of the table of the drive.
pub fn drive_lines(result: &DriveResult) -> String {
    let places = AFTER_S.iter().zip(result.rms_m).zip(result.largest_m);
    places
        .map(|((after_s, [h, v]), [hm, vm])| {
            format!(
                "| drive0708 | {} | {after_s} s | {} | {h:.2} | {hm:.2} | {v:.2} | {vm:.2} | {} | {} |\n",
                result.aids, result.outages, result.standstills, result.misleading
            )
        })
        .collect()
}

/// All of it.
#[derive(Serialize)]
struct AidsResult {
    campaign: &'static str,
    seed: u64,
    cases: Vec<CaseResult>,
    drive: Vec<DriveResult>,
}

/// Runs the campaign, prints its table and writes its result.
///
/// # Errors
/// As [`run_case`], or when `out` cannot be written.
pub fn run(data: &Path, seed: u64, trials: u64, out: &Path) -> Result<()> {
    let cases: Result<Vec<CaseResult>> = CASES
        .iter()
        .map(|case| {
            let result = run_case(case, seed, trials)?;
            print!("{}", lines(&result));
            Ok(result)
        })
        .collect();
    let cases = cases?;
    let drive = if data.join("drive0708-adis16465-rtk").exists() {
        let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/examples");
        let work = out.with_extension("drive");
        let results = drive(data, &examples, &work, seed)?;
        results
            .iter()
            .for_each(|result| print!("{}", drive_lines(result)));
        results
    } else {
        println!("{} holds no drive: left out", data.display());
        Vec::new()
    };
    let result = AidsResult {
        campaign: "aids",
        seed,
        cases,
        drive,
    };
    std::fs::write(out, serde_json::to_string_pretty(&result)? + "\n")
        .with_context(|| format!("cannot write {}", out.display()))?;
    println!("written: {}", out.display());
    Ok(())
}

/// Lines of the table.
pub fn lines(result: &CaseResult) -> String {
    let aid = match result.aid {
        Aid::Barometer => "barometer",
        Aid::ZeroVelocity => "standstill",
    };
    let line = |errors: &ErrorsAfter| {
        let [h0, v0] = errors.rms_without_m;
        let [h1, v1] = errors.rms_with_m;
        let [hm, vm] = errors.largest_with_m;
        format!(
            "| {} | {} | {aid} | {} s | {h0:.2} | {h1:.2} | {hm:.2} | {v0:.2} | {v1:.2} | {vm:.2} | {:.2} |\n",
            result.what, result.grade, errors.after_s, errors.vertical_over_sigma
        )
    };
    result.errors.iter().map(line).collect()
}
