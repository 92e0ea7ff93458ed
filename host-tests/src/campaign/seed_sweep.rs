//! Every kind of fault in every size on the satellite of the seed's experiment: `surefix campaign seed-sweep`.
//!
//! Flight, satellites and onset are those of [`super::seed_ramp`], the unit is tactical. A trial is a
//! seed and flies all of [`FAULTS`], each on the pseudorange alone and, where it has a rate, on the range
//! rate too.

use anyhow::Result;
use serde::{Deserialize, Serialize};

use super::binomial::clopper_pearson;
use super::figure::{Curve, Panel, page};
use super::outcome::{Campaign, Outcome};
use super::rig::{Rig, RigSetup};
use super::seed_ramp::{DURATION_S, FaultRecord, OneClock, SeedFlight, fly, row};
use super::trial::Trial;
use crate::faults::FaultKind;
use crate::simulate::inertial::sensors::Grade;

/// Kinds and sizes: m, m/s, m, m/√s, m.
pub const FAULTS: [(FaultKind, &[f64]); 5] = [
    (FaultKind::Step, &[5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0]),
    (FaultKind::Ramp, &[0.1, 0.2, 0.5, 1.0, 2.0, 5.0]),
    (FaultKind::Noise, &[5.0, 10.0, 20.0, 50.0]),
    (FaultKind::Walk, &[0.5, 1.0, 2.0, 5.0, 10.0]),
    (FaultKind::Oscillation, &[5.0, 10.0, 20.0, 50.0]),
];

/// A fault of the sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SweepRecord {
    /// Kind of the fault.
    pub kind: String,
    /// Its size.
    pub magnitude: f64,
    /// What became of it.
    #[serde(flatten)]
    pub fault: FaultRecord,
}

/// The campaign.
pub struct SeedSweep {
    seed: u64,
    flight: SeedFlight,
    rig: OneClock,
}

fn name(kind: FaultKind) -> String {
    format!("{kind:?}").to_lowercase()
}

impl Campaign for SeedSweep {
    const NAME: &'static str = "seed-sweep";
    const TRIALS: u64 = 20;
    type Record = SweepRecord;

    fn prepare(seed: u64, _: u64) -> Result<Self> {
        Ok(Self {
            seed,
            flight: SeedFlight::new(DURATION_S, 100)?,
            rig: Rig::new(),
        })
    }

    fn piece(&mut self, number: u64) -> Result<Vec<SweepRecord>> {
        let Self { seed, flight, rig } = self;
        let mut records = Vec::new();
        for (kind, sizes) in FAULTS {
            for magnitude in sizes.iter().copied() {
                for on_range_rate in [false, true] {
                    // A step has no rate.
                    if kind == FaultKind::Step && on_range_rate {
                        continue;
                    }
                    let mut trial = Trial::new(
                        &flight.flown,
                        &flight.six,
                        RigSetup::seed(Grade::Tactical),
                        seed.wrapping_add(number),
                    );
                    trial
                        .faults
                        .push(flight.fault(kind, magnitude, on_range_rate));
                    records.push(SweepRecord {
                        kind: name(kind),
                        magnitude,
                        fault: fly(rig, &trial, DURATION_S)?,
                    });
                }
            }
        }
        Ok(records)
    }

    fn report(outcome: &Outcome<SweepRecord>) -> String {
        let flight =
            SeedFlight::new(DURATION_S, 50).map_or_else(|_| String::new(), |f| f.describe());
        let mut text = format!(
            "Faults from 211 s to 340 s, tactical unit, {} seeds from {} on; median (least to largest). {flight}\n",
            outcome.trials, outcome.seed
        );
        for (kind, sizes) in FAULTS {
            text += &format!(
                "\n| {} | on | detected after, s | excluded after, s | error at detection, else largest, m | level there, m | largest error of a usable epoch, m | right satellite | wrong | false alerts | usable epochs above the level | alerted above d + a |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n",
                name(kind)
            );
            for magnitude in sizes {
                for on_range_rate in [false, true] {
                    let of = of(outcome, kind, *magnitude, on_range_rate);
                    if !of.is_empty() {
                        let on = if on_range_rate { "both" } else { "pseudorange" };
                        text += &row(&of, &magnitude.to_string(), on);
                    }
                }
            }
        }
        text
    }

    fn figures(outcome: &Outcome<SweepRecord>) -> Result<Vec<(&'static str, String)>> {
        let mut panels = Vec::new();
        for (kind, sizes) in FAULTS {
            let mut detected = Vec::new();
            let mut delays = Vec::new();
            for (on_range_rate, colour, on) in [
                (false, "#2166ac", "on the pseudorange"),
                (true, "#b2182b", "on both"),
            ] {
                let of_size = |size: f64| of(outcome, kind, size, on_range_rate);
                let curve = |name: String, points: Vec<(f64, f64)>, dashed| Curve {
                    name,
                    points,
                    colour,
                    dashed,
                };
                let share = |pick: fn(&FaultRecord) -> bool, end: Option<usize>| {
                    let point = |size: &f64| {
                        let of = of_size(*size);
                        let (k, n) = (of.iter().filter(|r| pick(r)).count(), of.len());
                        let share = match end {
                            None => k as f64 / n as f64,
                            Some(end) => clopper_pearson(k as u64, n as u64, 0.95)[end],
                        };
                        (*size, if n == 0 { f64::NAN } else { share })
                    };
                    sizes.iter().map(point).collect::<Vec<_>>()
                };
                if of_size(sizes[0]).is_empty() {
                    continue;
                }
                let is_detected: fn(&FaultRecord) -> bool = |r| r.detection_s.is_some();
                detected.push(curve(
                    format!("detected, {on}"),
                    share(is_detected, None),
                    false,
                ));
                for end in [0, 1] {
                    let ends = share(is_detected, Some(end));
                    detected.push(curve("95 % interval".into(), ends, true));
                }
                let median = |size: &f64| {
                    let mut seconds: Vec<usize> = of_size(*size)
                        .iter()
                        .filter_map(|r| r.detection_s)
                        .collect();
                    seconds.sort_unstable();
                    let middle = seconds.get(seconds.len() / 2);
                    (*size, middle.map_or(f64::NAN, |s| *s as f64))
                };
                let points = sizes.iter().map(median).collect();
                delays.push(curve(format!("median, {on}"), points, false));
            }
            for (curves, y_label) in [(detected, "share detected"), (delays, "detected after, s")] {
                panels.push(Panel {
                    title: name(kind),
                    x_label: "size: m, m/s or m/√s".into(),
                    y_label: y_label.into(),
                    curves,
                    ..Panel::default()
                });
            }
        }
        let title = "Detection against the size of the fault, seed's geometry, tactical unit";
        Ok(vec![("detection", page(title, &panels, 2))])
    }
}

/// The records of a fault.
pub fn of(
    outcome: &Outcome<SweepRecord>,
    kind: FaultKind,
    magnitude: f64,
    on_range_rate: bool,
) -> Vec<&FaultRecord> {
    outcome
        .of()
        .filter(|record| {
            record.kind == name(kind)
                && record.magnitude == magnitude
                && record.fault.on_range_rate == on_range_rate
        })
        .map(|record| &record.fault)
        .collect()
}
