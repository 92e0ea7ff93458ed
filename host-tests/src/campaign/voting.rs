//! `surefix campaign voting`: what three units see of a fault of one of them.
//!
//! | part | a piece | what it asks |
//! |---|---|---|
//! | faults | a grade and a time of onset: every kind on every unit from there | detected, isolated, how fast; navigation error with and without the fault, and of the faulty unit alone |
//! | healthy | a flight without a fault | false isolations in ten hours |
//! | sweep | a grade and a draw: every kind at rising sizes | the smallest fault that is isolated |
//!
//! `voting/flight.rs` flies, `voting/tables.rs` writes. Sizes of faults are told in what white noise leaves in a
//! mean over a second, one sigma: the angle or velocity random walk.

pub mod flight;
mod tables;

use std::collections::HashMap;
use std::sync::Arc;

use anyhow::Result;
use serde::{Deserialize, Serialize};
use surefix_core::ins::{MAX_UNITS, UnitState, VotingMode};

use super::outcome::{Campaign, Outcome};
use crate::simulate::inertial::sensors::Grade;
use crate::simulate::inertial::unit_faults::{UnitFaultKind, UnitFaultSpec};
use flight::{Finding, Flight, Scene};

/// Grades, in order.
pub const GRADES: [Grade; 3] = [Grade::Navigation, Grade::Tactical, Grade::Mems];
/// Times of onset.
pub const ONSETS: u64 = 20;
/// First onset, and how long before the end the last is, s.
const MARGIN_S: [f64; 2] = [60.0, 180.0];
/// Navigation errors count for so long after the onset, s.
const NAVIGATION_S: f64 = 60.0;
/// A fault is watched for so long, s.
const WATCH_S: f64 = 180.0;
/// Hours of healthy flight per grade.
const HEALTHY_H: f64 = 10.0;
/// Standard gravity, m/s²: what an accelerometer's scale error acts on in level flight.
const GRAVITY_MPS2: f64 = 9.806_65;
/// Axes of faults: gyroscope z, accelerometer z.
const AXES: [usize; 2] = [2, 5];

/// What a piece left.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Record {
    /// A fault, watched.
    Fault(FaultRecord),
    /// A healthy flight.
    Healthy {
        /// Grade.
        grade: String,
        /// Length, s.
        duration_s: f64,
        /// Times a unit ceased to be used.
        isolations: u32,
        /// Whether units disagreed.
        disagreed: bool,
    },
    /// One size of a fault.
    Sweep {
        /// Grade.
        grade: String,
        /// Kind.
        kind: UnitFaultKind,
        /// Place of the axis.
        axis: usize,
        /// Size in the unit of the table.
        size: f64,
        /// Seconds until it was isolated.
        isolated_s: Option<f64>,
        /// Another unit was isolated.
        wrong: bool,
    },
}

/// A fault of one unit, and what became of it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FaultRecord {
    /// Grade.
    pub grade: String,
    /// Kind.
    pub kind: UnitFaultKind,
    /// Which unit.
    pub unit: usize,
    /// Onset, s.
    pub onset_s: f64,
    /// Seconds until any unit ceased to be used, or units disagreed.
    pub detected_s: Option<f64>,
    /// Seconds until the faulty unit ceased to be used.
    pub isolated_s: Option<f64>,
    /// What it was called.
    pub cause: String,
    /// Another unit ceased to be used.
    pub wrong: bool,
    /// Largest position errors, m, over a minute: with satellites, and coasting without.
    pub voted_m: [f64; 2],
    /// The same without the fault.
    pub healthy_m: [f64; 2],
    /// The same of the faulty unit alone.
    pub alone_m: [f64; 2],
}

/// A piece of work.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Piece {
    Faults(usize, u64),
    Healthy(usize, u64),
    Sweep(usize, u64),
}

/// The campaign.
pub struct VotingCampaign {
    seed: u64,
    pieces: Vec<Piece>,
    scenes: HashMap<usize, Arc<Scene>>,
}

/// A plain fault of each kind: far above what is seen, far below what a sensor's range ends at.
pub fn plain(grade: Grade, kind: UnitFaultKind, unit: usize, onset_s: f64) -> UnitFaultSpec {
    let density = grade.noise().density;
    let (magnitude, axis) = match kind {
        UnitFaultKind::Step => (30.0 * density.arw, 2),
        UnitFaultKind::Drift => (1.5 * density.arw, 2),
        UnitFaultKind::Scale => (50.0 * density.vrw / GRAVITY_MPS2, 5),
        UnitFaultKind::Stuck => (0.0, 0),
        UnitFaultKind::Noise => (5.0, 4),
        UnitFaultKind::Silence => (0.0, 2),
        UnitFaultKind::Offset => (0.02, 2),
    };
    UnitFaultSpec {
        unit,
        kind,
        magnitude,
        t0_s: onset_s,
        t1_s: f64::INFINITY,
        axis,
    }
}

/// Sizes of a sweep, how an SI magnitude is made of one, and how long it is watched, s.
pub fn sizes(grade: Grade, kind: UnitFaultKind, axis: usize) -> (&'static [f64], f64, f64) {
    let density = grade.noise().density;
    let sigma = if axis < 3 { density.arw } else { density.vrw };
    match kind {
        UnitFaultKind::Step => (
            &[1.0, 2.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 48.0],
            sigma,
            30.0,
        ),
        UnitFaultKind::Drift => (&[0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64], sigma, 120.0),
        UnitFaultKind::Scale => (
            &[2.0, 4.0, 8.0, 12.0, 16.0, 24.0, 48.0],
            sigma / GRAVITY_MPS2,
            30.0,
        ),
        UnitFaultKind::Noise => (&[1.5, 2.0, 2.5, 3.0, 4.0], 1.0, 10.0),
        UnitFaultKind::Offset => (&[0.001, 0.002, 0.005, 0.01, 0.02, 0.05], 1.0, 120.0),
        UnitFaultKind::Stuck | UnitFaultKind::Silence => (&[], 1.0, 0.0),
    }
}

/// Kinds and axes of a sweep.
pub const SWEPT: [(UnitFaultKind, usize); 8] = [
    (UnitFaultKind::Step, AXES[0]),
    (UnitFaultKind::Step, AXES[1]),
    (UnitFaultKind::Drift, AXES[0]),
    (UnitFaultKind::Drift, AXES[1]),
    (UnitFaultKind::Scale, AXES[1]),
    (UnitFaultKind::Noise, AXES[0]),
    (UnitFaultKind::Noise, AXES[1]),
    (UnitFaultKind::Offset, AXES[0]),
];

fn is_out(finding: &Finding, unit: usize) -> bool {
    finding.units[unit].0 != UnitState::Used
}

fn anything(finding: &Finding) -> bool {
    finding.mode != VotingMode::Three
}

/// A fault from a flight that is healthy so far; navigators run where the flight has them.
///
/// # Errors
/// When a navigator gives up.
pub fn watch(
    before: &Flight,
    grade: Grade,
    fault: UnitFaultSpec,
    watch_s: f64,
    healthy_m: [f64; 2],
) -> Result<FaultRecord> {
    let mut flight = before.clone();
    flight.fail(fault);
    let onset_s = fault.t0_s;
    if flight.navigates {
        flight.coast();
    }
    let unit = fault.unit;
    let mut detected_s = None;
    let mut isolated = None;
    let mut wrong = false;
    let mut look = |finding: &Finding| {
        if anything(finding) {
            detected_s.get_or_insert(finding.t_s - onset_s);
        }
        wrong |= (0..MAX_UNITS).any(|other| other != unit && is_out(finding, other));
        if is_out(finding, unit) {
            isolated.get_or_insert((finding.t_s - onset_s, finding.units[unit].1));
        }
        is_out(finding, unit)
    };
    if flight.navigates {
        flight.fly(onset_s + NAVIGATION_S, |finding| {
            look(finding);
            false
        })?;
        flight.navigates = false;
    }
    if !look(&flight.finding()) {
        flight.fly(onset_s + watch_s, look)?;
    }
    // What it is called may become clearer with the seconds.
    if isolated.is_some() {
        let end_s = flight.t_s() + 2.0;
        flight.fly(end_s, |_| false)?;
    }
    Ok(FaultRecord {
        grade: grade.name().into(),
        kind: fault.kind,
        unit,
        onset_s,
        detected_s,
        isolated_s: isolated.map(|(t_s, _)| t_s),
        cause: isolated.map_or("", |(_, cause)| cause.name()).into(),
        wrong,
        voted_m: flight.voted.worst_m,
        healthy_m,
        alone_m: flight
            .alone
            .get(unit)
            .map_or([0.0; 2], |alone| alone.worst_m),
    })
}

/// All plain faults on all units from one onset.
///
/// # Errors
/// When a navigator gives up.
pub fn faults(
    scene: &Arc<Scene>,
    seed: u64,
    onset_s: f64,
    navigates: bool,
) -> Result<Vec<FaultRecord>> {
    let mut before = Flight::new(scene, seed, navigates)?;
    before.fly(onset_s, |_| false)?;
    let mut healthy = before.clone();
    let mut healthy_m = [0.0; 2];
    if navigates {
        healthy.coast();
        healthy.fly(onset_s + NAVIGATION_S, |_| false)?;
        healthy_m = healthy.voted.worst_m;
    }
    let mut records = Vec::new();
    for kind in UnitFaultKind::ALL {
        for unit in 0..MAX_UNITS {
            let fault = plain(scene.grade, kind, unit, onset_s);
            records.push(watch(&before, scene.grade, fault, WATCH_S, healthy_m)?);
        }
    }
    Ok(records)
}

/// The time of an onset.
pub fn onset_s(scene: &Scene, number: u64) -> f64 {
    let [first, last] = MARGIN_S;
    let span_s = f64::from(scene.duration_s) - first - last;
    (first + span_s * number as f64 / (ONSETS - 1) as f64).round()
}

/// A flight without a fault.
///
/// # Errors
/// When a configuration is refused.
pub fn healthy(scene: &Arc<Scene>, seed: u64) -> Result<Record> {
    let mut flight = Flight::new(scene, seed, false)?;
    let mut was_out = [false; MAX_UNITS];
    let (mut isolations, mut disagreed) = (0, false);
    flight.fly(scene.duration_s.into(), |finding| {
        disagreed |= finding.mode == VotingMode::Disagree;
        for (unit, was_out) in was_out.iter_mut().enumerate() {
            let out = is_out(finding, unit);
            isolations += u32::from(out && !*was_out);
            *was_out = out;
        }
        false
    })?;
    Ok(Record::Healthy {
        grade: scene.grade.name().into(),
        duration_s: scene.duration_s.into(),
        isolations,
        disagreed,
    })
}

/// Every size of every kind from one onset.
fn sweep(scene: &Arc<Scene>, seed: u64, trial: u64) -> Result<Vec<Record>> {
    let mut before = Flight::new(scene, seed, false)?;
    let onset_s = onset_s(scene, trial % ONSETS);
    before.fly(onset_s, |_| false)?;
    let mut records = Vec::new();
    for (kind, axis) in SWEPT {
        let (all, si, watch_s) = sizes(scene.grade, kind, axis);
        for size in all {
            let fault = UnitFaultSpec {
                unit: (trial % MAX_UNITS as u64) as usize,
                kind,
                magnitude: size * si,
                t0_s: onset_s,
                t1_s: f64::INFINITY,
                axis,
            };
            let found = watch(&before, scene.grade, fault, watch_s, [0.0; 2])?;
            records.push(Record::Sweep {
                grade: scene.grade.name().into(),
                kind,
                axis,
                size: *size,
                isolated_s: found.isolated_s,
                wrong: found.wrong,
            });
        }
    }
    Ok(records)
}

impl VotingCampaign {
    fn list(trials: u64) -> Vec<Piece> {
        let mut pieces = Vec::new();
        for grade in 0..GRADES.len() {
            // The shortest flight is 480 s.
            let flights = (HEALTHY_H * 3600.0 / 480.0).ceil() as u64;
            pieces.extend((0..ONSETS).map(|onset| Piece::Faults(grade, onset)));
            pieces.extend((0..flights).map(|flight| Piece::Healthy(grade, flight)));
            pieces.extend((0..trials).map(|trial| Piece::Sweep(grade, trial)));
        }
        pieces
    }

    fn scene(&mut self, grade: usize) -> Result<Arc<Scene>> {
        if let Some(scene) = self.scenes.get(&grade) {
            return Ok(Arc::clone(scene));
        }
        let scene = Scene::of(GRADES[grade])?;
        self.scenes.insert(grade, Arc::clone(&scene));
        Ok(scene)
    }
}

impl Campaign for VotingCampaign {
    const NAME: &'static str = "voting";
    /// Draws of the sweep.
    const TRIALS: u64 = 60;
    type Record = Record;

    fn prepare(seed: u64, trials: u64) -> Result<Self> {
        Ok(Self {
            seed,
            pieces: Self::list(trials),
            scenes: HashMap::new(),
        })
    }

    fn pieces(trials: u64) -> u64 {
        Self::list(trials).len() as u64
    }

    fn piece(&mut self, number: u64) -> Result<Vec<Record>> {
        let piece = self.pieces[number as usize];
        let seed = self.seed.wrapping_mul(1_000_003).wrapping_add(number);
        match piece {
            Piece::Faults(grade, onset) => {
                let scene = self.scene(grade)?;
                let onset_s = onset_s(&scene, onset);
                let records = faults(&scene, seed, onset_s, true)?;
                Ok(records.into_iter().map(Record::Fault).collect())
            }
            Piece::Healthy(grade, _) => Ok(vec![healthy(&self.scene(grade)?, seed)?]),
            Piece::Sweep(grade, trial) => sweep(&self.scene(grade)?, seed, trial),
        }
    }

    fn report(outcome: &Outcome<Record>) -> String {
        tables::report(outcome)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_read_back_so_that_shards_can_be_merged() {
        let record = Record::Sweep {
            grade: "mems".into(),
            kind: UnitFaultKind::Offset,
            axis: 2,
            size: 0.001,
            isolated_s: None,
            wrong: false,
        };
        let text = serde_json::to_string(&record).unwrap();
        let read: Record = serde_json::from_str(&text).unwrap();
        assert_eq!(serde_json::to_string(&read).unwrap(), text);
    }

    #[test]
    fn every_kind_has_pieces_for_every_grade() {
        let pieces = VotingCampaign::list(2);
        for grade in 0..GRADES.len() {
            let of = |wanted: fn(Piece, usize) -> bool| {
                pieces.iter().filter(|p| wanted(**p, grade)).count() as u64
            };
            assert_eq!(
                of(|p, g| matches!(p, Piece::Faults(of, _) if of == g)),
                ONSETS
            );
            assert_eq!(of(|p, g| matches!(p, Piece::Sweep(of, _) if of == g)), 2);
            let flights = of(|p, g| matches!(p, Piece::Healthy(of, _) if of == g));
            assert!(flights as f64 * 480.0 >= HEALTHY_H * 3600.0);
        }
    }
}
