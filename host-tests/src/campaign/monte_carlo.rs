//! The Monte Carlo experiment of [P0] 2.3: 8,000 space-time points with a fault every 120 of them:
//! `surefix campaign seed-monte-carlo`.
//!
//! A point is an epoch. Every [`POINTS`] of them are one flight at a place and time of its own, with the six
//! BDS satellites of the worst geometry there, after a minute in which the filter settles. In each flight one
//! satellite fails at some epoch and stays so to the end: in every second flight the one that is
//! hardest to test, as in [P0], otherwise any. Kind and size are drawn: [`KINDS`], sizes evenly on a
//! logarithmic scale, with its rate on the range rate or not, with each grade of inertial unit in turn.
//!
//! | class of a point | meaning |
//! |---|---|
//! | normal | no fault, no failed test |
//! | timely | fault; detected now or before, or it was excluded |
//! | latent | fault, not detected, horizontal error within level and alert limit |
//! | missed | fault, not detected, horizontal error above the alert limit for longer than the time to alert |
//! | false | no fault so far, a test failed |

use std::collections::BTreeMap;

use anyhow::{Context, Result};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng};
use serde::{Deserialize, Serialize};
use surefix_core::gnss::{Satellite, System};
use surefix_core::integrity::Phase;

use super::binomial::{clopper_pearson, percent};
use super::flown::{FlightPlan, Flown};
use super::outcome::{Campaign, Outcome};
use super::rig::{Rig, RigSetup};
use super::seed_ramp::GRADES;
use super::sky;
use super::trial::{Trial, left_out};
use crate::faults::{FaultKind, FaultSpec};
use crate::simulate::inertial::motion::Motion;
use crate::simulate::inertial::trajectory::Anchor;
use crate::simulate::noise::uniform;

/// Points of a flight.
pub const POINTS: u64 = 120;
/// Before the first point, s.
pub const SETTLED_S: usize = 60;
/// Most points before the fault begins.
pub const LATEST_ONSET: u64 = 100;
/// The last point to have a fault at the earliest.
const EARLIEST_ONSET: u64 = 20;
/// Kinds of faults with their least and largest sizes: m, m/s, m, m/√s, m.
pub const KINDS: [(FaultKind, [f64; 2]); 5] = [
    (FaultKind::Step, [2.0, 2000.0]),
    (FaultKind::Ramp, [0.05, 50.0]),
    (FaultKind::Noise, [2.0, 200.0]),
    (FaultKind::Walk, [0.5, 50.0]),
    (FaultKind::Oscillation, [2.0, 200.0]),
];
/// Confidence of intervals.
pub const CONFIDENCE: f64 = 0.99;

/// A flight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FlightRecord {
    /// Points by class: normal, timely, latent, missed, false.
    pub points: [u64; 5],
    /// Kind of the fault.
    pub kind: String,
    /// Its size.
    pub magnitude: f64,
    /// Grade of the inertial unit.
    pub grade: String,
    /// From onset to the first failed test, s.
    pub detection_s: Option<usize>,
    /// The faulty satellite was excluded, a healthy one was.
    pub excluded: [bool; 2],
    /// The horizontal error passed the alert limit with no test failed within the time to alert: with
    /// exclusion, and in the same flight with nothing excluded.
    pub missed: [bool; 2],
    /// The horizontal error passed the alert limit at all, alerted or not; the same two.
    pub passed_limit: [bool; 2],
    /// Points whose tests passed, and of those with an error above the level.
    pub usable: [u64; 2],
    /// Largest error over its level of a point whose tests passed.
    pub largest_ratio: f64,
    /// Points with a failed test and without exclusion, and of those above the level of alerted epochs.
    pub alerted: [u64; 2],
    /// Mean level, m.
    pub level_m: f64,
}

/// The campaign.
pub struct MonteCarlo {
    seed: u64,
    trials: u64,
    rig: Rig<2, 8>,
}

/// A flight at a random place where six BDS satellites meet the requirement.
fn flight(random: &mut ChaCha8Rng) -> (Flown, Vec<Satellite>) {
    let mut between = |low: f64, high: f64| low + (high - low) * uniform(random);
    loop {
        let turn_deg = between(-90.0, 90.0);
        let flown = Flown::new(&FlightPlan {
            motion: Motion::level(between(0.0, 360.0), between(60.0, 240.0))
                .turn(20.0, 50.0, turn_deg, 5.0)
                .turn(100.0, 140.0, -turn_deg, 5.0),
            anchor: Anchor {
                at_s: 0,
                latitude_deg: between(-65.0, 65.0),
                longitude_deg: between(-180.0, 180.0),
                height_m: between(500.0, 11_000.0),
            },
            tow_s: libm::floor(between(0.0, 500_000.0)) as i64,
            duration_s: SETTLED_S as u32 + POINTS as u32,
            rate_hz: 50,
        });
        let bds: Vec<Satellite> = flown
            .always_seen()
            .into_iter()
            .filter(|satellite| satellite.system() == System::Bds)
            .collect();
        let middle = &flown.epochs[flown.epochs.len() / 2];
        if let Some(six) = sky::worst_six(middle, &bds) {
            return (flown, six);
        }
    }
}

impl Campaign for MonteCarlo {
    const NAME: &'static str = "seed-monte-carlo";
    const TRIALS: u64 = 8000;
    type Record = FlightRecord;

    fn prepare(seed: u64, trials: u64) -> Result<Self> {
        Ok(Self {
            seed,
            trials,
            rig: Rig::new(),
        })
    }

    fn pieces(trials: u64) -> u64 {
        trials.div_ceil(POINTS)
    }

    fn piece(&mut self, number: u64) -> Result<Vec<FlightRecord>> {
        let points = POINTS.min(self.trials - number * POINTS);
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(number);
        let (flown, six) = flight(&mut random);
        let any = six[(random.next_u64() % 6) as usize];
        let onset =
            EARLIEST_ONSET + random.next_u64() % (LATEST_ONSET - EARLIEST_ONSET) * points / POINTS;
        let onset_s = SETTLED_S + onset as usize;
        let hardest = sky::hardest(&flown.epochs[onset_s], &six).context("no hardest satellite")?;
        let (kind, [least, largest]) = KINDS[(random.next_u64() % 5) as usize];
        let grade = GRADES[(number % 3) as usize];
        let fault = FaultSpec {
            satellite: if number.is_multiple_of(2) {
                hardest
            } else {
                any
            },
            kind,
            magnitude: least * libm::pow(largest / least, uniform(&mut random)),
            t0_s: onset_s as f64,
            t1_s: f64::INFINITY,
            on_range_rate: random.next_u64() & 1 == 0,
            period_s: 10.0 + 50.0 * uniform(&mut random),
        };
        let seed = random.next_u64();
        let mut trial = Trial::new(&flown, &six, RigSetup::seed(grade), seed);
        trial.faults.push(fault);
        let duration_s = SETTLED_S + points as usize;
        let mut record = fly(&mut self.rig, &trial, duration_s)?;
        trial.setup.exclude = false;
        let watched = fly(&mut self.rig, &trial, duration_s)?;
        record.missed[1] = watched.missed[0];
        record.passed_limit[1] = watched.passed_limit[0];
        Ok(vec![record])
    }

    fn report(outcome: &Outcome<FlightRecord>) -> String {
        report(outcome)
    }
}

fn fly(rig: &mut Rig<2, 8>, trial: &Trial<'_>, duration_s: usize) -> Result<FlightRecord> {
    let fault = trial.faults.first().context("no fault")?;
    let phase = Phase::Npa.requirements();
    let (hal_m, time_to_alert_s) = (phase.hal_m, phase.time_to_alert_s as usize);
    let onset_s = fault.t0_s as usize;
    let mut record = FlightRecord {
        points: [0; 5],
        kind: format!("{:?}", fault.kind).to_lowercase(),
        magnitude: fault.magnitude,
        grade: trial.setup.grade.name().into(),
        detection_s: None,
        excluded: [false; 2],
        missed: [false; 2],
        passed_limit: [false; 2],
        usable: [0; 2],
        largest_ratio: 0.0,
        alerted: [0; 2],
        level_m: 0.0,
    };
    let mut above_limit_s = 0;
    trial.fly(rig, duration_s, |epoch, _| {
        let [error_m, level_m] = [epoch.error_m[0], epoch.level_m[0]];
        let is_usable = epoch.is_usable();
        let is_faulty = epoch.t_s >= onset_s;
        if let Some(explanation) = epoch.excluded {
            for satellite in left_out(explanation, trial.satellites) {
                let is_right = is_faulty && satellite == fault.satellite;
                record.excluded[usize::from(!is_right)] = true;
            }
        }
        if is_faulty && !is_usable && record.detection_s.is_none() {
            record.detection_s = Some(epoch.t_s - onset_s);
        }
        if epoch.t_s <= SETTLED_S {
            return true;
        }
        record.level_m += level_m / (duration_s - SETTLED_S) as f64;
        record.passed_limit[0] |= error_m > hal_m;
        above_limit_s = if error_m > hal_m && is_usable {
            above_limit_s + 1
        } else {
            0
        };
        let is_missed = above_limit_s > time_to_alert_s;
        record.missed[0] |= is_missed;
        let class = match (is_faulty, is_usable) {
            (false, true) => 0,
            (false, false) => 4,
            (true, _) if is_missed => 3,
            (true, _) if record.detection_s.is_some() => 1,
            (true, _) => 2,
        };
        record.points[class] += 1;
        if is_usable {
            record.usable[0] += 1;
            record.usable[1] += u64::from(!(error_m <= level_m));
            record.largest_ratio = record.largest_ratio.max(epoch.ratio(1));
        } else if epoch.excluded.is_none() {
            record.alerted[0] += 1;
            record.alerted[1] += u64::from(!(error_m <= epoch.alerted_level_m[0]));
        }
        true
    })?;
    Ok(record)
}

/// Everything counted over all flights.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Totals {
    /// Flights, each with a fault.
    pub flights: u64,
    /// Points by class.
    pub points: [u64; 5],
    /// Faults detected.
    pub detected: u64,
    /// Faults whose satellite was excluded, and with a healthy one excluded.
    pub excluded: [u64; 2],
    /// Faults missed although the error passed the alert limit: with exclusion, and without.
    pub missed: [u64; 2],
    /// Faults whose error passed the alert limit at some point; the same two.
    pub passed_limit: [u64; 2],
    /// Usable points, and of those above the level.
    pub usable: [u64; 2],
    /// Alerted points, and of those above the alerted level.
    pub alerted: [u64; 2],
    /// Largest error over its level of a usable point.
    pub largest_ratio: f64,
}

/// Counts flights.
pub fn totals<'a>(of: impl Iterator<Item = &'a FlightRecord>) -> Totals {
    let mut sum = Totals::default();
    for record in of {
        sum.flights += 1;
        for (total, count) in sum.points.iter_mut().zip(record.points) {
            *total += count;
        }
        sum.detected += u64::from(record.detection_s.is_some());
        for k in 0..2 {
            sum.missed[k] += u64::from(record.missed[k]);
            sum.passed_limit[k] += u64::from(record.passed_limit[k]);
            sum.excluded[k] += u64::from(record.excluded[k]);
            sum.usable[k] += record.usable[k];
            sum.alerted[k] += record.alerted[k];
        }
        sum.largest_ratio = sum.largest_ratio.max(record.largest_ratio);
    }
    sum
}

fn report(outcome: &Outcome<FlightRecord>) -> String {
    let all = totals(outcome.of());
    let points: u64 = all.points.iter().sum();
    let confidence = 100.0 * CONFIDENCE;
    let mut text = format!(
        "{points} space-time points in {} flights with a fault each, seed {}; {confidence:.0} % intervals of Clopper and Pearson.\n\n\
         | points | normal | timely | latent | missed | false |\n|---|---|---|---|---|---|\n| here | {} | {} | {} | {} | {} |\n| [P0] table 1 | 7049 | 770 | | 0 | 1 |\n\n",
        all.flights,
        outcome.seed,
        all.points[0],
        all.points[1],
        all.points[2],
        all.points[3],
        all.points[4]
    );
    let healthy = all.points[0] + all.points[4];
    let upper = |events: u64, of: u64| clopper_pearson(events, of, CONFIDENCE)[1];
    text += &format!(
        "| what | of | count | share, % |\n|---|---|---|---|\n\
         | false alert | {healthy} points without a fault | {} | {} |\n\
         | fault detected | {} faults | {} | {} |\n\
         | its satellite excluded | {} detected | {} | {} |\n\
         | a healthy one excluded | {} faults | {} | {} |\n\
         | missed, error past the alert limit | {} faults that passed it | {} | {} |\n\
         | the same with nothing excluded | {} faults that passed it | {} | {} |\n\
         | usable, error above max(HPL, hpl0) | {} usable points | {} | {} |\n\
         | alerted, error above max(d + a) | {} alerted points | {} | {} |\n\n\
         Largest error over its level of a usable point: {:.2}. The points of a flight hang together, so that the intervals of points are too narrow; of whole flights: with an error above the level 0 to {:.2} % ({} of {}).\n\n",
        all.points[4],
        percent(all.points[4], healthy, CONFIDENCE),
        all.flights,
        all.detected,
        percent(all.detected, all.flights, CONFIDENCE),
        all.detected,
        all.excluded[0],
        percent(all.excluded[0], all.detected, CONFIDENCE),
        all.flights,
        all.excluded[1],
        percent(all.excluded[1], all.flights, CONFIDENCE),
        all.passed_limit[0],
        all.missed[0],
        percent(all.missed[0], all.passed_limit[0], CONFIDENCE),
        all.passed_limit[1],
        all.missed[1],
        percent(all.missed[1], all.passed_limit[1], CONFIDENCE),
        all.usable[0],
        all.usable[1],
        percent(all.usable[1], all.usable[0], CONFIDENCE),
        all.alerted[0],
        all.alerted[1],
        percent(all.alerted[1], all.alerted[0], CONFIDENCE),
        all.largest_ratio,
        100.0
            * upper(
                outcome.of().filter(|r| r.usable[1] > 0).count() as u64,
                all.flights
            ),
        outcome.of().filter(|r| r.usable[1] > 0).count(),
        all.flights
    );
    text += "| kind | faults | detected | right satellite out | healthy out | usable above the level | would pass the alert limit with nothing excluded |\n|---|---|---|---|---|---|---|\n";
    let mut kinds: BTreeMap<&str, Vec<&FlightRecord>> = BTreeMap::new();
    for record in outcome.of() {
        kinds.entry(&record.kind).or_default().push(record);
    }
    for (kind, records) in kinds {
        let of = totals(records.iter().copied());
        text += &format!(
            "| {kind} | {} | {} | {} | {} | {} | {} |\n",
            of.flights,
            of.detected,
            of.excluded[0],
            of.excluded[1],
            of.usable[1],
            of.passed_limit[1]
        );
    }
    text
}
