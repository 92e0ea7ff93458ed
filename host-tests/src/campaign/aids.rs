//! `surefix campaign aids`: what a barometer and recognised standstills are worth while no satellite is there.
//!
//! A trial is a flight with a seed of its own, flown twice with the same noise, without the aid and with it;
//! the receiver falls silent at a time and stays so. The day's air and the errors of the barometer are
//! drawn by the seed too.

use std::path::Path;

use anyhow::{Context, Result};
use serde::Serialize;
use surefix_core::ins::{AidsConfig, BarometerModel, ZeroVelocityModel};
use surefix_core::integrity::Phase;

use crate::aiding::{AidedRow, Air, fly_aided, pressures};
use crate::simulate::flight::Flight;
use crate::simulate::inertial::sensors::Grade;
use crate::simulate::inertial::{Request, fly};

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

/// All of it.
#[derive(Serialize)]
struct AidsResult {
    campaign: &'static str,
    seed: u64,
    cases: Vec<CaseResult>,
}

/// Runs the campaign, prints its table and writes its result.
///
/// # Errors
/// As [`run_case`], or when `out` cannot be written.
pub fn run(seed: u64, trials: u64, out: &Path) -> Result<()> {
    let cases: Result<Vec<CaseResult>> = CASES
        .iter()
        .map(|case| {
            let result = run_case(case, seed, trials)?;
            print!("{}", lines(&result));
            Ok(result)
        })
        .collect();
    let result = AidsResult {
        campaign: "aids",
        seed,
        cases: cases?,
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
