//! All monitors on the same epochs with the same faults.
//!
//! A fault is a number added to a row of the linearised epoch, measured minus predicted, after the linearisation: every
//! monitor gets the same rows to the bit. Put on the pseudorange instead, the point of linearisation would move by
//! metres; at 100 m that changes a row by less than a millimetre.

use anyhow::{Result, anyhow, bail};
use surefix_core::gnss::SatelliteSet;
use surefix_core::gnss::solution::UsedRow;
use surefix_core::integrity::{Phase, PhaseRequirements};
use surefix_core::linalg::LinearModel;
use surefix_core::raim::monitors::MonitorEpoch;

use super::counts::{Counts, Said, Summary};
use super::registry::{Configured, Entry};
use super::subject::{Epoch, Subject};
use super::sweep::Trial;
use crate::faults::{FaultInjector, FaultSpec};
use crate::linearised::row_of;

/// A monitor of the registry with its counts.
pub struct Contestant {
    /// Its entry.
    pub entry: &'static Entry,
    /// Its memory, bytes.
    pub memory_b: usize,
    monitor: Box<dyn Configured>,
}

impl Contestant {
    /// Configured for a phase of flight.
    ///
    /// # Errors
    /// When it refuses the configuration.
    pub fn new(entry: &'static Entry, phase: Phase) -> Result<Self> {
        let made = (entry.make)(phase)?;
        Ok(Self {
            entry,
            memory_b: made.memory_b,
            monitor: made.monitor,
        })
    }

    fn says(
        &mut self,
        model: &LinearModel,
        rows: &[UsedRow],
        at_enu_m: Option<[f64; 3]>,
    ) -> Result<Said> {
        let epoch = MonitorEpoch::new(model, rows)
            .map_err(|error| anyhow!("an epoch is no epoch of a monitor: {error:?}"))?;
        Ok(Said::new(&self.monitor.assess(&epoch), rows, at_enu_m))
    }
}

/// The epochs of a recording as they are, with the faults of the command line on some of them.
#[derive(Clone, Debug)]
pub struct Series {
    /// Of each epoch, what is faulted.
    pub faulted: Vec<SatelliteSet>,
    /// Of each epoch, what each monitor said.
    pub said: Vec<Vec<Said>>,
}

impl Series {
    /// Puts what one more monitor said beside the others; `None` where it said nothing.
    pub fn add(&mut self, said: Vec<Option<Said>>) {
        for (others, said) in self.said.iter_mut().zip(said) {
            others.push(said.unwrap_or_else(|| Said::nothing("no_report")));
        }
    }

    /// Counts of the monitor of a number over the epochs with or without a fault.
    pub fn counts(&self, monitor: usize, faulted: bool, limits: &PhaseRequirements) -> Summary {
        let mut counts = Counts::default();
        for (set, said) in self.faulted.iter().zip(&self.said) {
            if set.is_empty() != faulted
                && let Some(said) = said.get(monitor)
            {
                counts.book(said, set, limits);
            }
        }
        counts.summary()
    }
}

/// Runs the monitors over all epochs.
///
/// # Errors
/// When a fault touches no row of an epoch.
pub fn series(
    subject: &Subject,
    contestants: &mut [Contestant],
    faults: &[FaultSpec],
    seed: u64,
    progress: &mut dyn FnMut(),
) -> Result<Series> {
    let mut injector = FaultInjector::new(faults, seed);
    let mut touched = vec![false; faults.len()];
    let mut series = Series {
        faulted: Vec::new(),
        said: Vec::new(),
    };
    for Epoch {
        linearised,
        at_enu_m,
    } in &subject.epochs
    {
        let mut model = linearised.model.clone();
        let mut faulted = SatelliteSet::EMPTY;
        for (satellite, value_m, _) in injector.values(linearised.t_s()) {
            let Some(row) = row_of(&linearised.rows, satellite) else {
                continue;
            };
            model.residual_m[row] += value_m;
            faulted.insert(satellite);
        }
        for (touched, fault) in touched.iter_mut().zip(faults) {
            let is_active = (fault.t0_s..fault.t1_s).contains(&linearised.t_s());
            *touched |= is_active && faulted.contains(fault.satellite);
        }
        let said: Result<Vec<Said>> = contestants
            .iter_mut()
            .map(|contestant| contestant.says(&model, &linearised.rows, *at_enu_m))
            .collect();
        series.said.push(said?);
        series.faulted.push(faulted);
        progress();
    }
    if let Some((fault, _)) = faults.iter().zip(touched).find(|(_, touched)| !touched) {
        bail!(
            "the fault {fault} touches no epoch: the satellite is in no solution from {} s to {} s; in the first are {}",
            fault.t0_s,
            fault.t1_s,
            names(subject)
        );
    }
    Ok(series)
}

fn names(subject: &Subject) -> String {
    let first = subject.epochs.iter().take(1);
    let names: Vec<String> = first
        .flat_map(|epoch| &epoch.linearised.rows)
        .map(|row| row.satellite.to_string())
        .collect();
    names.join(" ")
}

/// Runs every trial with a fault of each size; by size, then by monitor.
///
/// # Errors
/// None that a recording can cause.
pub fn sweep(
    subject: &Subject,
    contestants: &mut [Contestant],
    sizes_m: &[f64],
    trials: &[Trial],
    limits: &PhaseRequirements,
    progress: &mut dyn FnMut(),
) -> Result<Vec<Vec<Summary>>> {
    let mut by_size = Vec::new();
    for size_m in sizes_m {
        let mut counts = vec![Counts::default(); contestants.len()];
        for trial in trials {
            let Epoch {
                linearised,
                at_enu_m,
            } = &subject.epochs[trial.epoch];
            let mut model = linearised.model.clone();
            let mut faulted = SatelliteSet::EMPTY;
            for (row, sign) in &trial.rows {
                model.residual_m[*row] += sign * size_m;
                // A fault of no size is none.
                if *size_m > 0.0 {
                    faulted.insert(linearised.rows[*row].satellite);
                }
            }
            for (contestant, counts) in contestants.iter_mut().zip(&mut counts) {
                let said = contestant.says(&model, &linearised.rows, *at_enu_m)?;
                counts.book(&said, &faulted, limits);
            }
            progress();
        }
        by_size.push(counts.into_iter().map(Counts::summary).collect());
    }
    Ok(by_size)
}
