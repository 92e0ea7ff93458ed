//! The experiment of [P0] 2.3: a ramp of 0.63 m/s on the satellite that is hardest to test, of the six BDS
//! satellites with the worst geometry: `surefix campaign seed-ramp`.
//!
//! The paper's ramp begins 11 s after its start and lasts 129 s. Here the filter has settled for 200 s
//! before, as in the reference scenarios `seed000`. A trial flies all three grades of inertial unit, with
//! the ramp on the pseudorange alone and on the range rate too, the same noise each time.

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};
use surefix_core::gnss::{Satellite, System};

use super::figure::{Curve, Panel, page};
use super::flown::{FlightPlan, Flown};
use super::outcome::{Campaign, Outcome};
use super::rig::{Rig, RigSetup};
use super::sky;
use super::trial::{Trial, left_out};
use crate::faults::{FaultKind, FaultSpec};
use crate::simulate::inertial::motion::Motion;
use crate::simulate::inertial::sensors::Grade;
use crate::simulate::inertial::trajectory::Anchor;

/// Grades of the inertial unit.
pub const GRADES: [Grade; 3] = [Grade::Navigation, Grade::Tactical, Grade::Mems];
/// Rate of the ramp, m/s.
pub const RAMP_MPS: f64 = 0.63;
/// When it begins, s.
pub const ONSET_S: usize = 211;
/// How long it lasts, s.
pub const LENGTH_S: usize = 129;
/// Length of the flight, s.
pub const DURATION_S: usize = 345;
/// Horizontal alert limit of the non-precision approach, m.
pub const HAL_M: f64 = 556.0;

/// The navigator of one clock.
pub type OneClock = Rig<2, 8>;

/// The flight, its six satellites, and the one to be faulted.
#[derive(Clone, Debug)]
pub struct SeedFlight {
    /// The truth.
    pub flown: Flown,
    /// The six.
    pub six: Vec<Satellite>,
    /// The hardest of them when the fault begins.
    pub hardest: Satellite,
}

impl SeedFlight {
    /// As the reference scenarios: 220 m/s at 9 km from 40° N 116° E, two gentle turns.
    ///
    /// # Errors
    /// When no six satellites meet the requirement.
    pub fn new(duration_s: usize, rate_hz: u32) -> Result<Self> {
        let motion = Motion::level(28.0, 220.0)
            .turn(60.0, 95.0, 45.0, 5.0)
            .turn(130.0, 160.0, -40.0, 5.0);
        let flown = Flown::new(&FlightPlan {
            motion,
            anchor: Anchor {
                at_s: 0,
                latitude_deg: 40.0,
                longitude_deg: 116.3,
                height_m: 9000.0,
            },
            tow_s: 274_200,
            duration_s: duration_s as u32,
            rate_hz,
        });
        let bds: Vec<Satellite> = flown
            .always_seen()
            .into_iter()
            .filter(|satellite| satellite.system() == System::Bds)
            .collect();
        let onset = &flown.epochs[ONSET_S.min(duration_s)];
        let six = sky::worst_six(onset, &bds).context("no six BDS satellites to fly with")?;
        let hardest = sky::hardest(onset, &six).context("no satellite is the hardest")?;
        Ok(Self {
            flown,
            six,
            hardest,
        })
    }

    /// What its fault does to a trial of it.
    pub fn fault(&self, kind: FaultKind, magnitude: f64, on_range_rate: bool) -> FaultSpec {
        FaultSpec {
            satellite: self.hardest,
            kind,
            magnitude,
            t0_s: ONSET_S as f64,
            t1_s: (ONSET_S + LENGTH_S) as f64,
            on_range_rate,
            period_s: 20.0,
        }
    }
}

impl SeedFlight {
    /// Which satellites, and how bad they are.
    pub fn describe(&self) -> String {
        let onset = &self.flown.epochs[ONSET_S.min(self.flown.duration_s())];
        let six: Vec<String> = self.six.iter().map(|s| s.to_string()).collect();
        format!(
            "Satellites {}, GDOP {:.1}; the fault is on {}.",
            six.join(" "),
            sky::gdop(onset, &self.six),
            self.hardest
        )
    }
}

/// What became of one fault.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FaultRecord {
    /// Grade of the inertial unit.
    pub grade: String,
    /// Whether the fault's rate was on the range rate.
    pub on_range_rate: bool,
    /// From onset to the first failed test, s.
    pub detection_s: Option<usize>,
    /// From onset to the exclusion, s.
    pub isolation_s: Option<usize>,
    /// Whether the faulty satellite was excluded.
    pub right: bool,
    /// Whether a healthy one was.
    pub wrong: bool,
    /// A test failed before the onset.
    pub false_alert: bool,
    /// Horizontal error at the first failed test, or the largest where none failed, m.
    pub error_m: f64,
    /// Horizontal level there, m.
    pub level_m: f64,
    /// Largest horizontal error of an epoch whose tests passed, from the onset on, m.
    pub largest_usable_error_m: f64,
    /// Largest error over its level of an epoch whose tests passed, in the whole flight.
    pub largest_ratio: f64,
    /// Epochs whose tests passed with an error above the level.
    pub above_level: u64,
    /// Epochs with a failed test and an error above the level of alerted epochs.
    pub above_alerted_level: u64,
}

/// Flies one fault and looks at what became of it.
///
/// # Errors
/// As [`Trial::fly`].
pub fn fly(rig: &mut OneClock, trial: &Trial<'_>, duration_s: usize) -> Result<FaultRecord> {
    let fault = trial.faults.first().context("no fault to fly")?;
    let mut record = FaultRecord {
        grade: trial.setup.grade.name().into(),
        on_range_rate: fault.on_range_rate,
        detection_s: None,
        isolation_s: None,
        right: false,
        wrong: false,
        false_alert: false,
        error_m: 0.0,
        level_m: 0.0,
        largest_usable_error_m: 0.0,
        largest_ratio: 0.0,
        above_level: 0,
        above_alerted_level: 0,
    };
    let onset_s = fault.t0_s as usize;
    trial.fly(rig, duration_s, |epoch, _| {
        let [error_m, level_m] = [epoch.error_m[0], epoch.level_m[0]];
        let is_usable = epoch.is_usable();
        let since_s = epoch.t_s.checked_sub(onset_s);
        let Some(since_s) = since_s else {
            record.false_alert |= !is_usable;
            return true;
        };
        if !is_usable && record.detection_s.is_none() {
            record.detection_s = Some(since_s);
            record.error_m = error_m;
            record.level_m = level_m;
        }
        if is_usable && record.detection_s.is_none() && error_m > record.error_m {
            record.error_m = error_m;
            record.level_m = level_m;
        }
        if let Some(excluded) = epoch.excluded {
            record.isolation_s.get_or_insert(since_s);
            for satellite in left_out(excluded, trial.satellites) {
                record.right |= satellite == fault.satellite;
                record.wrong |= satellite != fault.satellite;
            }
        }
        if is_usable {
            record.largest_usable_error_m = record.largest_usable_error_m.max(error_m);
            record.largest_ratio = record.largest_ratio.max(epoch.ratio(1));
            record.above_level += u64::from(error_m > level_m);
        } else if epoch.excluded.is_none() {
            record.above_alerted_level += u64::from(error_m > epoch.alerted_level_m[0]);
        }
        true
    })?;
    Ok(record)
}

/// The campaign.
pub struct SeedRamp {
    seed: u64,
    flight: SeedFlight,
    rig: OneClock,
}

/// The paper's ramp.
fn ramp(flight: &SeedFlight, grade: Grade, on_range_rate: bool, seed: u64) -> Trial<'_> {
    let mut trial = Trial::new(&flight.flown, &flight.six, RigSetup::seed(grade), seed);
    let fault = flight.fault(FaultKind::Ramp, RAMP_MPS, on_range_rate);
    trial.faults.push(fault);
    trial
}

impl Campaign for SeedRamp {
    const NAME: &'static str = "seed-ramp";
    const TRIALS: u64 = 20;
    type Record = FaultRecord;

    fn prepare(seed: u64, _: u64) -> Result<Self> {
        Ok(Self {
            seed,
            flight: SeedFlight::new(DURATION_S, 100)?,
            rig: Rig::new(),
        })
    }

    fn piece(&mut self, number: u64) -> Result<Vec<FaultRecord>> {
        let seed = self.seed.wrapping_add(number);
        let mut records = Vec::new();
        for grade in GRADES {
            for on_range_rate in [false, true] {
                let trial = ramp(&self.flight, grade, on_range_rate, seed);
                records.push(fly(&mut self.rig, &trial, DURATION_S)?);
            }
        }
        Ok(records)
    }

    fn report(outcome: &Outcome<FaultRecord>) -> String {
        let flight =
            SeedFlight::new(DURATION_S, 50).map_or_else(|_| String::new(), |f| f.describe());
        let mut text = format!(
            "Ramp of {RAMP_MPS} m/s for {LENGTH_S} s, {} seeds from {} on; median (least to largest). {flight}\n\n\
             | unit | ramp on | detected after, s | excluded after, s | error at detection, m | level there, m | largest error of a usable epoch, m | right satellite | wrong | false alerts | usable epochs above the level | alerted above d + a |\n\
             |---|---|---|---|---|---|---|---|---|---|---|---|\n",
            outcome.trials, outcome.seed
        );
        for grade in GRADES {
            for on_range_rate in [false, true] {
                let of: Vec<&FaultRecord> = outcome
                    .of()
                    .filter(|r| r.grade == grade.name() && r.on_range_rate == on_range_rate)
                    .collect();
                text += &row(
                    &of,
                    grade.name(),
                    if on_range_rate { "both" } else { "pseudorange" },
                );
            }
        }
        text += "\n[P0]: detected 2 s after the onset; its figure does not tell sigma, unit or geometry.\n";
        text
    }

    fn figures(outcome: &Outcome<FaultRecord>) -> Result<Vec<(&'static str, String)>> {
        let mut campaign = Self::prepare(outcome.seed, outcome.trials)?;
        let (figure3, figure4) = campaign.draw()?;
        Ok(vec![("figure3", figure3), ("figure4", figure4)])
    }
}

/// A row of numbers of the same kind of fault.
pub fn row(of: &[&FaultRecord], first: &str, second: &str) -> String {
    let n = of.len();
    let count = |is: fn(&FaultRecord) -> bool| of.iter().filter(|r| is(r)).count();
    let seconds = |of_record: fn(&FaultRecord) -> Option<usize>| {
        let found: Vec<f64> = of
            .iter()
            .filter_map(|r| of_record(r).map(|s| s as f64))
            .collect();
        let never = n - found.len();
        let mut text = spread(found, 0);
        if never > 0 {
            text += &format!(", {never} never");
        }
        text
    };
    format!(
        "| {first} | {second} | {} | {} | {} | {} | {} | {} of {n} | {} | {} | {} | {} |\n",
        seconds(|r| r.detection_s),
        seconds(|r| r.isolation_s),
        spread(of.iter().map(|r| r.error_m).collect(), 2),
        spread(of.iter().map(|r| r.level_m).collect(), 2),
        spread(of.iter().map(|r| r.largest_usable_error_m).collect(), 2),
        count(|r| r.right),
        count(|r| r.wrong),
        count(|r| r.false_alert),
        of.iter().map(|r| r.above_level).sum::<u64>(),
        of.iter().map(|r| r.above_alerted_level).sum::<u64>(),
    )
}

/// `median (least to largest)`.
pub fn spread(mut values: Vec<f64>, digits: usize) -> String {
    values.sort_by(f64::total_cmp);
    let (Some(least), Some(largest)) = (values.first(), values.last()) else {
        return "-".into();
    };
    let median = values[values.len() / 2];
    format!("{median:.digits$} ({least:.digits$} to {largest:.digits$})")
}

/// How far the drawing of the sub-filters goes, s: beyond, thresholds are too small to be seen.
const FIGURE_4_S: f64 = 60.0;

/// What is drawn of one sub-filter: separation, threshold, level.
#[derive(Clone, Debug, Default)]
struct Lines {
    statistic: Vec<(f64, f64)>,
    threshold: Vec<(f64, f64)>,
    level: Vec<(f64, f64)>,
}

impl SeedRamp {
    /// [P0]'s figures 3 and 4 for the first seed, a tactical unit, the ramp on both observables, monitored
    /// without exclusion so that the separations can be seen to the end.
    fn draw(&mut self) -> Result<(String, String)> {
        let Self { seed, flight, rig } = self;
        let flight = &*flight;
        let mut error = [Vec::new(), Vec::new()];
        let mut level = Vec::new();
        let mut fault = Vec::new();
        let mut of: Vec<Lines> = vec![Lines::default(); flight.six.len()];
        for (number, exclude) in [false, true].into_iter().enumerate() {
            let mut trial = ramp(flight, Grade::Tactical, true, *seed);
            trial.setup.exclude = exclude;
            trial.fly(rig, DURATION_S, |epoch, rig| {
                // The paper's time: its ramp begins at 11 s.
                let Some(t_s) = epoch.t_s.checked_sub(ONSET_S - 11) else {
                    return true;
                };
                let t_s = t_s as f64;
                error[number].push((t_s, epoch.error_m[0]));
                if exclude {
                    return true;
                }
                let is_near = t_s <= FIGURE_4_S;
                level.push((t_s, epoch.level_m[0]));
                let is_on = epoch.t_s >= ONSET_S && epoch.t_s < ONSET_S + LENGTH_S;
                let since_s = epoch.t_s as f64 - ONSET_S as f64;
                fault.push((t_s, if is_on { RAMP_MPS * since_s } else { 0.0 }));
                for (satellite, separation) in rig.bank().separations().filter(|_| is_near) {
                    let Some(at) = flight.six.iter().position(|s| *s == satellite) else {
                        continue;
                    };
                    let lines = &mut of[at];
                    let [d, t, a] = [
                        separation.statistic_m[0],
                        separation.threshold_m[0],
                        separation.uncertainty_m[0],
                    ];
                    lines.statistic.push((t_s, d));
                    lines.threshold.push((t_s, t));
                    lines.level.push((t_s, t + a));
                }
                true
            })?;
        }
        let curve = |name: &str, points: Vec<(f64, f64)>, colour, dashed| Curve {
            name: name.into(),
            points,
            colour,
            dashed,
        };
        let onset = vec![(11.0, "ramp begins".to_owned())];
        let [watched, excluded] = error;
        let figure3 = page(
            &format!("Ramp of {RAMP_MPS} m/s on {}", flight.hardest),
            &[
                Panel {
                    title: "the fault".into(),
                    x_label: "time, s".into(),
                    y_label: "on the pseudorange, m".into(),
                    curves: vec![curve("fault", fault, "#b2182b", false)],
                    marks: onset.clone(),
                    ..Panel::default()
                },
                Panel {
                    title: format!("horizontal error and level (alert limit {HAL_M} m)"),
                    x_label: "time, s".into(),
                    y_label: "m".into(),
                    curves: vec![
                        curve("level max(HPL, hpl0)", level, "#111", true),
                        curve("error, nothing excluded", watched, "#b2182b", false),
                        curve("error with exclusion", excluded, "#2166ac", false),
                    ],
                    marks: onset.clone(),
                    ..Panel::default()
                },
            ],
            2,
        );
        let panels: Vec<Panel> = of
            .into_iter()
            .zip(&flight.six)
            .map(|(lines, satellite)| Panel {
                title: format!(
                    "without {satellite}{}",
                    if *satellite == flight.hardest {
                        ", the faulty one"
                    } else {
                        ""
                    }
                ),
                x_label: "time, s".into(),
                y_label: "m".into(),
                curves: vec![
                    curve("separation d", lines.statistic, "#b2182b", false),
                    curve("threshold T", lines.threshold, "#2166ac", true),
                    curve("level T + a", lines.level, "#111", true),
                ],
                marks: onset.clone(),
                ..Panel::default()
            })
            .collect();
        let figure4 = page(
            &format!(
                "Every sub-filter while {} ramps away at {RAMP_MPS} m/s",
                flight.hardest
            ),
            &panels,
            2,
        );
        Ok((figure3, figure4))
    }
}
