//! The monitors that are compared: one entry each.
//!
//! An entry says what a monitor is called, what it promises, how it is configured for a phase of flight, and under
//! which names the emulated board measured its work. A new monitor is one more entry of [`MONITORS`].

use anyhow::{Result, anyhow, bail};
use surefix_core::consts::MAX_SATELLITES;
use surefix_core::integrity::{Phase, PhaseRequirements};
use surefix_core::linalg::qr::WhitenedQr;
use surefix_core::raim::araim::{AraimParameters, MAX_ARAIM_SATELLITES};
use surefix_core::raim::exclusion::{MAX_FAULTS, RowSet};
use surefix_core::raim::foim::GDOP_LIMIT;
use surefix_core::raim::igg3::Igg3Config;
use surefix_core::raim::monitors::araim::{AraimConfig, AraimMonitor, PseudorangeErrors};
use surefix_core::raim::monitors::consensus::{ConsensusConfig, ConsensusMonitor, ConsensusRule};
use surefix_core::raim::monitors::doppler::{DopplerConfig, DopplerMonitor};
use surefix_core::raim::monitors::residual::{ResidualConfig, ResidualMonitor};
use surefix_core::raim::monitors::rms::{RmsConfig, RmsMonitor, RmsRule};
use surefix_core::raim::monitors::robust::{RobustConfig, RobustMonitor};
use surefix_core::raim::monitors::vpl_mhss::{VplConfig, VplMonitor};
use surefix_core::raim::monitors::{EpochMonitor, MonitorEpoch, MonitorVerdict, NoLevels, Outcome};
use surefix_core::raim::reconstructed::LevelConvention;

/// A configured monitor of any kind.
pub trait Configured {
    /// Looks at one epoch.
    fn assess(&mut self, epoch: &MonitorEpoch<'_>) -> MonitorVerdict;
}

impl<M: EpochMonitor> Configured for M {
    fn assess(&mut self, epoch: &MonitorEpoch<'_>) -> MonitorVerdict {
        EpochMonitor::assess(self, epoch)
    }
}

/// A configured monitor with its size.
pub struct Made {
    /// It.
    pub monitor: Box<dyn Configured>,
    /// Its memory, bytes.
    pub memory_b: usize,
}

/// What a monitor tests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tests {
    /// Pseudoranges, and the position by them.
    Pseudoranges,
    /// Range rates, and the velocity by them: a fault is one with `rr`, and m are m/s. No part of a sweep.
    RangeRates,
}

/// A monitor.
pub struct Entry {
    /// On the command line and in files.
    pub name: &'static str,
    /// In tables.
    pub title: &'static str,
    /// What it tests.
    pub tests: Tests,
    /// Probability of an alert at a healthy epoch that it is configured for; `None` where it states none.
    pub p_false_alert: fn(&PhaseRequirements) -> Option<f64>,
    /// Whether it tests for faults at all.
    pub looks_for_faults: bool,
    /// Most faults at a time that it can take out; 0: it takes none out.
    pub excludes: usize,
    /// Whether it gives levels.
    pub has_levels: bool,
    /// Configured for a phase of flight.
    pub make: fn(Phase) -> Result<Made>,
    /// Its rows of `cargo xtask bench`: this of an epoch without a fault, with `/fault` behind it of one with a fault.
    pub work: &'static str,
    /// Most satellites it takes; of more it takes the highest, and neither uses nor tests the others.
    pub most_satellites: usize,
}

/// Least squares alone: what every monitor has to be better than.
struct Unmonitored(WhitenedQr);

impl Configured for Unmonitored {
    fn assess(&mut self, epoch: &MonitorEpoch<'_>) -> MonitorVerdict {
        if let Err(error) = self.0.factor(epoch.model()) {
            return MonitorVerdict::not_tested(error.into());
        }
        let [east, north, up, ..] = self.0.estimate();
        MonitorVerdict {
            outcome: Outcome::Passed,
            excluded: RowSet::EMPTY,
            position_enu_m: Some([east, north, up]),
            levels: Err(NoLevels::NotOffered),
            statistic: None,
            threshold: None,
        }
    }
}

/// All of them, the product's default path behind least squares without any.
pub const MONITORS: &[Entry] = &[
    Entry {
        name: "none",
        title: "least squares, no monitor",
        tests: Tests::Pseudoranges,
        p_false_alert: |_| Some(0.0),
        looks_for_faults: false,
        excludes: 0,
        has_levels: false,
        make: |_| {
            Ok(Made {
                monitor: Box::new(Unmonitored(WhitenedQr::EMPTY)),
                memory_b: size_of::<Unmonitored>(),
            })
        },
        work: "monitor/none",
        most_satellites: MAX_SATELLITES,
    },
    Entry {
        name: "residual",
        title: "residual RAIM",
        tests: Tests::Pseudoranges,
        p_false_alert: |phase| Some(phase.p_fa),
        looks_for_faults: true,
        excludes: MAX_FAULTS,
        has_levels: true,
        make: |phase| made(ResidualMonitor::EMPTY, &residual(phase)),
        work: "monitor/residual",
        most_satellites: MAX_SATELLITES,
    },
    Entry {
        name: "rms",
        title: "RMS comparison",
        tests: Tests::Pseudoranges,
        p_false_alert: |phase| Some(phase.p_fa),
        looks_for_faults: true,
        excludes: 1,
        has_levels: false,
        make: |phase| {
            made(
                RmsMonitor::EMPTY,
                &RmsConfig {
                    p_false_alarm: phase.requirements().p_fa,
                    rule: RmsRule::Corrected,
                },
            )
        },
        work: "monitor/rms",
        most_satellites: MAX_SATELLITES,
    },
    Entry {
        name: "igg3",
        title: "IGG-III, reconstructed levels",
        tests: Tests::Pseudoranges,
        // The weights take out what lies beyond five sigmas of a residual, and healthy rows of large leverage.
        p_false_alert: |_| None,
        looks_for_faults: true,
        excludes: MAX_SATELLITES,
        has_levels: true,
        make: |_| {
            made(
                RobustMonitor::EMPTY,
                &RobustConfig {
                    estimator: Igg3Config::CORRECTED,
                    levels: LevelConvention::CORRECTED,
                },
            )
        },
        work: "monitor/igg3",
        most_satellites: MAX_SATELLITES,
    },
    Entry {
        name: "araim",
        title: "ARAIM",
        tests: Tests::Pseudoranges,
        p_false_alert: |_| {
            let p = AraimParameters::LPV_200;
            Some(p.p_false_alert_vertical + p.p_false_alert_horizontal)
        },
        looks_for_faults: true,
        excludes: 2,
        has_levels: true,
        make: |_| {
            made(
                AraimMonitor::EMPTY,
                // The errors of the rows, as the others have them.
                &AraimConfig {
                    errors: PseudorangeErrors::Rows,
                    ..AraimConfig::LPV_200_V3
                },
            )
        },
        work: "monitor/araim",
        most_satellites: MAX_ARAIM_SATELLITES,
    },
    Entry {
        name: "vpl_mhss",
        title: "VPL separation",
        tests: Tests::Pseudoranges,
        p_false_alert: |phase| Some(phase.p_fa),
        looks_for_faults: true,
        excludes: 1,
        has_levels: true,
        make: |phase| {
            made(
                VplMonitor::EMPTY,
                &VplConfig {
                    p_false_alarm: phase.requirements().p_fa,
                    ..VplConfig::PRESET
                },
            )
        },
        work: "monitor/vpl_mhss",
        most_satellites: MAX_SATELLITES,
    },
    Entry {
        name: "ranco",
        title: "RANCO",
        tests: Tests::Pseudoranges,
        p_false_alert: |phase| Some(phase.p_fa),
        looks_for_faults: true,
        excludes: MAX_FAULTS,
        has_levels: false,
        make: |phase| consensus(phase, ConsensusRule::Ranco),
        work: "monitor/ranco",
        most_satellites: MAX_SATELLITES,
    },
    Entry {
        name: "s_ranco",
        title: "S-RANCO",
        tests: Tests::Pseudoranges,
        p_false_alert: |phase| Some(phase.p_fa),
        looks_for_faults: true,
        excludes: MAX_FAULTS,
        has_levels: false,
        make: |phase| consensus(phase, ConsensusRule::SRanco),
        work: "monitor/s_ranco",
        most_satellites: MAX_SATELLITES,
    },
    Entry {
        name: "foim",
        title: "FOIM",
        tests: Tests::Pseudoranges,
        p_false_alert: |phase| Some(phase.p_fa),
        looks_for_faults: true,
        excludes: MAX_FAULTS,
        has_levels: false,
        make: |phase| {
            let gdop_limit = GDOP_LIMIT;
            consensus(phase, ConsensusRule::Foim { gdop_limit })
        },
        work: "monitor/foim",
        most_satellites: MAX_SATELLITES,
    },
    Entry {
        name: "doppler",
        title: "Doppler RAIM, m/s",
        tests: Tests::RangeRates,
        p_false_alert: |phase| Some(phase.p_fa),
        looks_for_faults: true,
        excludes: MAX_FAULTS,
        has_levels: true,
        make: |phase| {
            made(
                DopplerMonitor::EMPTY,
                &DopplerConfig {
                    test: residual(phase),
                    ..DopplerConfig::FREE_SKY
                },
            )
        },
        work: "monitor/doppler",
        most_satellites: MAX_SATELLITES,
    },
];

fn made<M: EpochMonitor + 'static>(empty: M, config: &M::Config) -> Result<Made> {
    let mut monitor = Box::new(empty);
    monitor
        .configure(config)
        .map_err(|error| anyhow!("a monitor refuses its configuration: {error:?}"))?;
    Ok(Made {
        monitor,
        memory_b: size_of::<M>(),
    })
}

fn residual(phase: Phase) -> ResidualConfig {
    let phase = phase.requirements();
    ResidualConfig {
        p_false_alarm: phase.p_fa,
        p_missed_detection: phase.p_md,
        p_fault_free: phase.p_fault_free,
        max_faults: MAX_FAULTS,
    }
}

fn consensus(phase: Phase, rule: ConsensusRule) -> Result<Made> {
    made(
        ConsensusMonitor::EMPTY,
        &ConsensusConfig {
            rule,
            p_false_alarm: phase.requirements().p_fa,
            max_faults: MAX_FAULTS,
        },
    )
}

/// The entries of the names on the command line, in the order of [`MONITORS`]; all without a name.
///
/// # Errors
/// When a name is none of a monitor's.
pub fn chosen(names: &[String]) -> Result<Vec<&'static Entry>> {
    let known = || MONITORS.iter().map(|entry| entry.name);
    if let Some(name) = names.iter().find(|name| known().all(|k| k != *name)) {
        let known: Vec<&str> = known().chain([super::product::NAME]).collect();
        bail!(
            "--monitors \"{name}\" does not exist: take some of {}, with commas between",
            known.join(", ")
        );
    }
    let is_chosen = |entry: &&Entry| names.is_empty() || names.iter().any(|n| n == entry.name);
    Ok(MONITORS.iter().filter(is_chosen).collect())
}
