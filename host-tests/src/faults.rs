//! Faults put on the pseudoranges of a recording.
//!
//! | kind | f(t), m, for T0 ≤ t < T1 | rate with `rr`, m/s | source |
//! |---|---|---|---|
//! | step | MAG | 0 | [P0] (1) |
//! | ramp | MAG·(t − T0) | MAG | [P0] (2) |
//! | noise | MAG·n, n normal and white, mean 0 | difference quotient | [P0] (3) with η = 0 |
//! | walk | sum of MAG·√Δt·n over the epochs | difference quotient | [P0] (4) |
//! | osc | MAG·sin(2π(t − T0)/PERIOD) | its derivative | [P0] (5), period 2π s unless given |
//!
//! t in seconds from the first epoch. A fault is on all signals of the satellite alike; the carrier
//! phase stays as it was. The random kinds depend on the seed, the satellite and the number of the
//! fault alone, so the same command gives the same fault.

use core::f64::consts::TAU;
use std::str::FromStr;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use surefix_core::gnss::{ObservationEpoch, Satellite, SatelliteSet, System};

use crate::simulate::noise::normal;

/// The five models.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultKind {
    /// A constant.
    Step,
    /// A constant rate.
    Ramp,
    /// White noise.
    Noise,
    /// A random walk.
    Walk,
    /// A sine.
    Oscillation,
}

/// One fault on one satellite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultSpec {
    /// Which satellite.
    pub satellite: Satellite,
    /// Which model.
    pub kind: FaultKind,
    /// m, m/s, m, m/√s, m in the order of [`FaultKind`].
    pub magnitude: f64,
    /// Start, s from the first epoch.
    pub t0_s: f64,
    /// End, s from the first epoch; not part of the fault.
    pub t1_s: f64,
    /// Whether its rate is on the range rates too.
    pub on_range_rate: bool,
    /// Period of an oscillation, s.
    pub period_s: f64,
}

/// Why a fault specification is refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "fault \"{spec}\": {cause}; the form is SAT:KIND:MAG:T0:T1[:rr][:PERIOD], for example G05:step:50:600:1200"
)]
pub struct FaultSpecError {
    spec: String,
    cause: String,
}

impl FromStr for FaultSpec {
    type Err = FaultSpecError;

    fn from_str(spec: &str) -> Result<Self, Self::Err> {
        let refuse = |cause: String| FaultSpecError {
            spec: spec.to_owned(),
            cause,
        };
        let mut parts = spec.split(':');
        let mut next = |name: &str| {
            parts
                .next()
                .filter(|part| !part.is_empty())
                .ok_or_else(|| refuse(format!("{name} is missing")))
        };
        let (name, kind) = (next("the satellite")?, next("the kind")?);
        let numbers = [next("the magnitude")?, next("T0")?, next("T1")?];

        let satellite = parse_satellite(name).ok_or_else(|| {
            refuse(format!(
                "\"{name}\" is no satellite of GPS (G01 to G32), Galileo (E01 to E36) or BDS (C01 to C63)"
            ))
        })?;
        let kind = match kind {
            "step" => FaultKind::Step,
            "ramp" => FaultKind::Ramp,
            "noise" => FaultKind::Noise,
            "walk" => FaultKind::Walk,
            "osc" => FaultKind::Oscillation,
            other => {
                return Err(refuse(format!(
                    "\"{other}\" is none of step, ramp, noise, walk, osc"
                )));
            }
        };
        let number = |text: &str| {
            text.parse::<f64>()
                .ok()
                .filter(|value| value.is_finite())
                .ok_or_else(|| refuse(format!("\"{text}\" is no number")))
        };
        let [magnitude, t0_s, t1_s] = [
            number(numbers[0])?,
            number(numbers[1])?,
            number(numbers[2])?,
        ];
        if t1_s <= t0_s {
            return Err(refuse(format!("it ends at {t1_s} s, before it starts")));
        }
        let mut on_range_rate = false;
        let mut period_s = None;
        for part in parts {
            match part {
                "rr" if !on_range_rate && period_s.is_none() => on_range_rate = true,
                text if kind == FaultKind::Oscillation && period_s.is_none() => {
                    let value = number(text)?;
                    if value <= 0.0 {
                        return Err(refuse(format!("the period {value} s is not positive")));
                    }
                    period_s = Some(value);
                }
                text => return Err(refuse(format!("\"{text}\" is too much"))),
            }
        }
        Ok(Self {
            satellite,
            kind,
            magnitude,
            t0_s,
            t1_s,
            on_range_rate,
            period_s: period_s.unwrap_or(TAU),
        })
    }
}

impl core::fmt::Display for FaultSpec {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let kind = match self.kind {
            FaultKind::Step => "step",
            FaultKind::Ramp => "ramp",
            FaultKind::Noise => "noise",
            FaultKind::Walk => "walk",
            FaultKind::Oscillation => "osc",
        };
        let (satellite, magnitude) = (self.satellite, self.magnitude);
        write!(
            f,
            "{satellite}:{kind}:{magnitude}:{}:{}",
            self.t0_s, self.t1_s
        )?;
        if self.on_range_rate {
            write!(f, ":rr")?;
        }
        if self.kind == FaultKind::Oscillation {
            write!(f, ":{}", self.period_s)?;
        }
        Ok(())
    }
}

/// The satellite of a name like G05.
pub fn parse_satellite(name: &str) -> Option<Satellite> {
    let mut letters = name.chars();
    let system = System::from_letter(letters.next()?)?;
    let digits = letters.as_str();
    if digits.len() != 2 || !digits.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    Satellite::new(system, digits.parse().ok()?)
}

/// A fault with what the random kinds remember.
#[derive(Clone, Debug)]
struct RunningFault {
    spec: FaultSpec,
    random: ChaCha8Rng,
    /// Time and value at the last epoch of the fault.
    last: Option<(f64, f64)>,
}

impl RunningFault {
    /// Value in m and rate in m/s at `t_s`, `None` while the fault is not active.
    fn at(&mut self, t_s: f64) -> Option<(f64, f64)> {
        let spec = &self.spec;
        if !(t_s >= spec.t0_s && t_s < spec.t1_s) {
            return None;
        }
        let since_s = t_s - spec.t0_s;
        let (last_s, last_m) = self.last.unwrap_or((spec.t0_s, 0.0));
        let step_s = t_s - last_s;
        let quotient = |value_m: f64| {
            if step_s > 0.0 {
                (value_m - last_m) / step_s
            } else {
                0.0
            }
        };
        let (value_m, rate_mps) = match spec.kind {
            FaultKind::Step => (spec.magnitude, 0.0),
            FaultKind::Ramp => (spec.magnitude * since_s, spec.magnitude),
            FaultKind::Noise => {
                let value_m = spec.magnitude * normal(&mut self.random);
                (value_m, quotient(value_m))
            }
            FaultKind::Walk => {
                let increment = libm::sqrt(step_s.max(0.0)) * normal(&mut self.random);
                let value_m = last_m + spec.magnitude * increment;
                (value_m, quotient(value_m))
            }
            FaultKind::Oscillation => {
                let angle = TAU * since_s / spec.period_s;
                (
                    spec.magnitude * libm::sin(angle),
                    spec.magnitude * TAU / spec.period_s * libm::cos(angle),
                )
            }
        };
        self.last = Some((t_s, value_m));
        Some((value_m, rate_mps))
    }
}

/// Puts faults on epochs, which must come in order of time.
#[derive(Clone, Debug)]
pub struct FaultInjector {
    faults: Vec<RunningFault>,
}

impl FaultInjector {
    /// Ready for the first epoch.
    pub fn new(specs: &[FaultSpec], seed: u64) -> Self {
        let faults = specs
            .iter()
            .enumerate()
            .map(|(number, spec)| {
                let mut random = ChaCha8Rng::seed_from_u64(seed);
                random.set_stream((number as u64) << 8 | spec.satellite.index() as u64);
                RunningFault {
                    spec: *spec,
                    random,
                    last: None,
                }
            })
            .collect();
        Self { faults }
    }

    /// The faults active at `t_s` seconds from the first epoch: satellite, m, and m/s on the range rate.
    pub fn values(&mut self, t_s: f64) -> impl Iterator<Item = (Satellite, f64, f64)> + '_ {
        self.faults.iter_mut().filter_map(move |fault| {
            let (value_m, rate_mps) = fault.at(t_s)?;
            let rate_mps = if fault.spec.on_range_rate {
                rate_mps
            } else {
                0.0
            };
            Some((fault.spec.satellite, value_m, rate_mps))
        })
    }

    /// Adds the faults active at `t_s` seconds from the first epoch.
    pub fn apply(&mut self, epoch: &mut ObservationEpoch, t_s: f64) {
        for (satellite, value_m, rate_mps) in self.values(t_s) {
            let observed = epoch
                .satellites
                .iter_mut()
                .filter(|s| s.satellite == satellite);
            for signal in observed.flat_map(|s| &mut s.signals) {
                if let Some(pseudorange_m) = &mut signal.pseudorange_m {
                    *pseudorange_m += value_m;
                }
                if let Some(range_rate_mps) = &mut signal.range_rate_mps {
                    *range_rate_mps += rate_mps;
                }
            }
        }
    }
}

/// Finds the faults of which no epoch shows anything: a satellite never in view, or times outside the
/// recording.
#[derive(Clone, Debug)]
pub struct FaultCoverage {
    without_effect: Vec<FaultSpec>,
    in_view: SatelliteSet,
}

impl FaultCoverage {
    /// Before the first epoch.
    pub fn new(specs: &[FaultSpec]) -> Self {
        Self {
            without_effect: specs.to_vec(),
            in_view: SatelliteSet::EMPTY,
        }
    }

    /// Takes note of an epoch at `t_s` seconds from the first.
    pub fn see(&mut self, epoch: &ObservationEpoch, t_s: f64) {
        for observation in &epoch.satellites {
            if observation
                .signals
                .iter()
                .all(|s| s.pseudorange_m.is_none())
            {
                continue;
            }
            self.in_view.insert(observation.satellite);
            self.without_effect.retain(|fault| {
                fault.satellite != observation.satellite || t_s < fault.t0_s || t_s >= fault.t1_s
            });
        }
    }

    /// After the last epoch.
    ///
    /// # Errors
    /// When a fault touched no epoch.
    pub fn check(&self) -> Result<(), FaultWithoutEffect> {
        let Some(fault) = self.without_effect.first() else {
            return Ok(());
        };
        let names: Vec<String> = self.in_view.iter().map(|s| s.to_string()).collect();
        Err(FaultWithoutEffect {
            fault: *fault,
            in_view: if names.is_empty() {
                "no satellites".into()
            } else {
                names.join(" ")
            },
        })
    }
}

/// A fault that touched nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "the fault on {} touches no epoch: the satellite is not in view from {} s to {} s; in view are {in_view}",
    fault.satellite, fault.t0_s, fault.t1_s
)]
pub struct FaultWithoutEffect {
    fault: FaultSpec,
    in_view: String,
}
