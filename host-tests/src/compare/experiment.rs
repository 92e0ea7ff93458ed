//! All monitors on the same epochs with the same faults.
//!
//! A fault is a number added to a row of the linearised epoch, measured minus predicted, after the linearisation: every
//! monitor gets the same rows to the bit. Put on the pseudorange instead, the point of linearisation would move by
//! metres; at 100 m that changes a row by less than a millimetre.

use anyhow::{Result, anyhow, bail};
use surefix_core::gnss::solution::UsedRow;
use surefix_core::gnss::{Satellite, SatelliteSet};
use surefix_core::integrity::{Phase, PhaseRequirements};
use surefix_core::linalg::LinearModel;
use surefix_core::raim::monitors::MonitorEpoch;

use super::counts::{AtFault, Counts, Said, Summary};
use super::registry::{Configured, Entry, Tests};
use super::subject::Subject;
use super::sweep::Trial;
use crate::faults::{FaultInjector, FaultSpec};
use crate::linearised::{Linearised, row_of};

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
        Ok(Said {
            not_in_use: all_but_highest(rows, self.entry.most_satellites),
            ..Said::new(&self.monitor.assess(&epoch), rows, at_enu_m)
        })
    }
}

/// The satellites that are left where only so many of the highest are taken.
fn all_but_highest(rows: &[UsedRow], taken: usize) -> SatelliteSet {
    let mut descending: Vec<&UsedRow> = rows.iter().collect();
    descending.sort_by(|a, b| b.elevation_rad.total_cmp(&a.elevation_rad));
    let mut left = SatelliteSet::EMPTY;
    for row in descending.iter().skip(taken) {
        left.insert(row.satellite);
    }
    left
}

/// The rows of an epoch with faults on them.
struct Faulty {
    model: Box<LinearModel>,
    rates: LinearModel,
    faulted: Faulted,
}

/// Satellites with a faulty pseudorange, and with a faulty range rate.
#[derive(Clone, Copy, Debug)]
pub struct Faulted {
    /// Of pseudoranges.
    pub pseudoranges: SatelliteSet,
    /// Of range rates.
    pub range_rates: SatelliteSet,
}

impl Faulted {
    /// What a monitor that tests these should find.
    pub const fn of(&self, tests: Tests) -> &SatelliteSet {
        match tests {
            Tests::Pseudoranges => &self.pseudoranges,
            Tests::RangeRates => &self.range_rates,
        }
    }
}

impl Faulty {
    fn new(epoch: &Linearised, faults: impl Iterator<Item = (Satellite, f64, f64)>) -> Self {
        let mut faulty = Self {
            model: epoch.model.clone(),
            rates: epoch.rates.model.clone(),
            faulted: Faulted {
                pseudoranges: SatelliteSet::EMPTY,
                range_rates: SatelliteSet::EMPTY,
            },
        };
        for (satellite, value_m, rate_mps) in faults {
            // A fault of no size, as a ramp is where it begins, is none.
            if value_m != 0.0
                && let Some(row) = row_of(&epoch.rows, satellite)
            {
                faulty.model.residual_m[row] += value_m;
                faulty.faulted.pseudoranges.insert(satellite);
            }
            if rate_mps != 0.0
                && let Some(row) = row_of(&epoch.rates.rows, satellite)
            {
                faulty.rates.residual_m[row] += rate_mps;
                faulty.faulted.range_rates.insert(satellite);
            }
        }
        faulty
    }
}

/// The epochs of a recording as they are, with the faults of the command line on some of them.
#[derive(Clone, Debug)]
pub struct Series {
    /// Of each epoch, what is faulted.
    pub faulted: Vec<Faulted>,
    /// Of each epoch, the satellites whose faults began earlier.
    pub before: Vec<SatelliteSet>,
    /// Of each epoch, what each monitor said.
    pub said: Vec<Vec<Said>>,
    /// Of each epoch, what surefix itself said of the recording without the faults; empty where there are none.
    pub clean: Vec<Said>,
}

impl Series {
    /// Puts behind the others what surefix itself said of each epoch.
    pub fn push(&mut self, said: Vec<Said>) {
        for (others, said) in self.said.iter_mut().zip(said) {
            others.push(said);
        }
    }

    /// Counts of the monitor of a number over the epochs with or without a fault of what it tests.
    pub fn counts(
        &self,
        monitor: usize,
        tests: Tests,
        faulted: bool,
        limits: &PhaseRequirements,
    ) -> Summary {
        let said = self.said.iter().map(|said| said.get(monitor));
        let at_fault = self.faulted.iter().map(|f| AtFault::now(*f.of(tests)));
        counted(said.zip(at_fault), faulted, limits)
    }

    /// Counts of surefix itself, the last: with faults, as above, but what it still holds is known; without, over the
    /// same epochs of the recording without any.
    pub fn counts_of_product(&self, faulted: bool, limits: &PhaseRequirements) -> Summary {
        let at_fault = self.faulted.iter().zip(&self.before);
        let at_fault = at_fault.map(|(faulted, before)| AtFault {
            now: faulted.pseudoranges,
            before: *before,
        });
        if faulted || self.clean.is_empty() {
            let said = self.said.iter().map(|said| said.last());
            counted(said.zip(at_fault), faulted, limits)
        } else {
            counted(self.clean.iter().map(Some).zip(at_fault), faulted, limits)
        }
    }
}

fn counted<'a>(
    epochs: impl Iterator<Item = (Option<&'a Said>, AtFault)>,
    faulted: bool,
    limits: &PhaseRequirements,
) -> Summary {
    let mut counts = Counts::default();
    for (said, at_fault) in epochs {
        if at_fault.now.is_empty() != faulted
            && let Some(said) = said
        {
            counts.book(said, &at_fault, limits);
        }
    }
    counts.summary()
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
        before: Vec::new(),
        said: Vec::new(),
        clean: Vec::new(),
    };
    for epoch in &subject.epochs {
        let linearised = &epoch.linearised;
        let t_s = linearised.t_s();
        let faulty = Faulty::new(linearised, injector.values(t_s));
        for (touched, fault) in touched.iter_mut().zip(faults) {
            let is_active = (fault.t0_s..fault.t1_s).contains(&t_s);
            *touched |= is_active && row_of(&linearised.rows, fault.satellite).is_some();
        }
        let said: Result<Vec<Said>> = contestants
            .iter_mut()
            .map(|contestant| match contestant.entry.tests {
                Tests::Pseudoranges => {
                    contestant.says(&faulty.model, &linearised.rows, epoch.at_enu_m)
                }
                Tests::RangeRates => {
                    // What it estimates is the velocity itself.
                    let against = epoch.velocity_enu_mps.map(|v| v.map(|v_mps| -v_mps));
                    contestant.says(&faulty.rates, &linearised.rates.rows, against)
                }
            })
            .collect();
        series.said.push(said?);
        series.faulted.push(faulty.faulted);
        let mut before = SatelliteSet::EMPTY;
        for fault in faults.iter().filter(|fault| fault.t0_s < t_s) {
            before.insert(fault.satellite);
        }
        series.before.push(before);
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

/// Runs every trial with a fault of each size; by size, then by monitor. A monitor of range rates has
/// no part in it.
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
            let epoch = &subject.epochs[trial.epoch];
            let rows = &epoch.linearised.rows;
            let faults = trial
                .rows
                .iter()
                .map(|(row, sign)| (rows[*row].satellite, sign * size_m, 0.0));
            let faulty = Faulty::new(&epoch.linearised, faults);
            for (contestant, counts) in contestants.iter_mut().zip(&mut counts) {
                if contestant.entry.tests == Tests::Pseudoranges {
                    let said = contestant.says(&faulty.model, rows, epoch.at_enu_m)?;
                    let at_fault = AtFault::now(faulty.faulted.pseudoranges);
                    counts.book(&said, &at_fault, limits);
                }
            }
            progress();
        }
        by_size.push(counts.into_iter().map(Counts::summary).collect());
    }
    Ok(by_size)
}

#[cfg(test)]
mod tests {
    use super::*;
    use surefix_core::gnss::System;
    use surefix_core::gnss::weights::RowSigma;

    #[test]
    fn of_too_many_satellites_the_lowest_are_not_in_use() {
        let row = |(prn, elevation_rad): (u8, f64)| UsedRow {
            satellite: Satellite::new(System::Gps, prn).unwrap(),
            elevation_rad,
            azimuth_rad: 0.0,
            sigma: RowSigma {
                independent_m: 1.0,
                common_m: 0.0,
            },
        };
        let rows = [(1, 0.3), (2, 1.2), (3, 0.2), (4, 0.7)].map(row);
        let left = all_but_highest(&rows, 2);
        assert!(left.contains(rows[0].satellite) && left.contains(rows[2].satellite));
        assert_eq!(left.len(), 2);
        assert!(all_but_highest(&rows, 4).is_empty());
    }
}
