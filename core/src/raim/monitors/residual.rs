//! Residual RAIM through the common face: parity test, exclusion beyond doubt, slope levels.
//!
//! The same test, exclusion and levels as the product's default path (`snapshot.rs`), on the rows of one
//! linearisation. Sources and assumptions: [`crate::raim::parity`], [`crate::raim::exclusion`],
//! [`crate::raim::level`].

use super::agreement::Agreement;
use super::{
    ConfigureError, EpochMonitor, MonitorEpoch, MonitorLevels, MonitorVerdict, NoLevels, NotTested,
    Outcome, checked_levels,
};
use crate::consts::MAX_SATELLITES;
use crate::raim::exclusion::{self, ExclusionWorkspace, MAX_FAULTS, RowSet};
use crate::raim::level::LevelFactors;
use crate::raim::slope::{NoLevel, Sensitivity};

/// What residual RAIM is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResidualConfig {
    /// False-alarm probability of an epoch's test.
    pub p_false_alarm: f64,
    /// Missed-detection probability of the fault that the levels reckon with.
    pub p_missed_detection: f64,
    /// Risk of the fault-free level.
    pub p_fault_free: f64,
    /// Most rows excluded, and most simultaneous faults reckoned with, 1 to [`MAX_FAULTS`].
    pub max_faults: usize,
}

/// Residual RAIM, and its memory (16 kB).
#[derive(Clone, Debug)]
pub struct ResidualMonitor {
    agreement: Agreement,
    factors: Option<LevelFactors>,
    max_faults: usize,
    sensitivity: Sensitivity,
    exclusion: ExclusionWorkspace,
    independent_sigma_m: [f64; MAX_SATELLITES],
    common_errors_m: [[f64; MAX_SATELLITES]; 1],
}

impl ResidualMonitor {
    /// Not configured.
    pub const EMPTY: Self = Self {
        agreement: Agreement::EMPTY,
        factors: None,
        max_faults: 1,
        sensitivity: Sensitivity::EMPTY,
        exclusion: ExclusionWorkspace::EMPTY,
        independent_sigma_m: [1.0; MAX_SATELLITES],
        common_errors_m: [[0.0; MAX_SATELLITES]],
    };

    /// Levels of the rows tested last.
    fn levels(
        &mut self,
        epoch: &MonitorEpoch<'_>,
        left_out: RowSet,
    ) -> Result<MonitorLevels, NoLevels> {
        let Agreement {
            thresholds,
            remaining,
            qr,
        } = &mut self.agreement;
        let redundancy = qr.n().saturating_sub(qr.m());
        let sqrt_noncentrality = thresholds
            .sqrt_noncentrality(redundancy)
            .ok_or(NoLevels::NoRedundancy)?;
        self.sensitivity.fill(qr);
        let kept = || {
            let rows = epoch.rows().iter().enumerate();
            rows.filter(move |(row, _)| !left_out.contains(*row))
        };
        let slope = self
            .sensitivity
            .levels(sqrt_noncentrality)
            .map_err(|error| match error {
                NoLevel::NoRedundancy => NoLevels::NoRedundancy,
                // Counted among the rows left: tell which of the epoch's it is.
                NoLevel::Untestable { row } => NoLevels::Untestable {
                    row: kept().nth(row).map_or(row, |(given, _)| given),
                },
                NoLevel::NotFinite => NoLevels::NotFinite,
            })?;
        let places = self
            .independent_sigma_m
            .iter_mut()
            .zip(self.common_errors_m.iter_mut().flatten());
        for ((_, row), (independent_m, common_m)) in kept().zip(places) {
            *independent_m = row.sigma.independent_m;
            *common_m = row.sigma.common_m;
        }
        let covariance = self.sensitivity.position_covariance(
            remaining,
            &self.independent_sigma_m,
            &self.common_errors_m,
        );
        let factors = self.factors.ok_or(NoLevels::NotTested)?;
        let [hpl_m, vpl_m] = factors.levels_m(&slope, &covariance);
        checked_levels(hpl_m, vpl_m)
    }
}

impl EpochMonitor for ResidualMonitor {
    type Config = ResidualConfig;

    fn configure(&mut self, config: &ResidualConfig) -> Result<(), ConfigureError> {
        self.factors = None;
        if !(1..=MAX_FAULTS).contains(&config.max_faults) {
            return Err(ConfigureError::OutOfRange {
                name: "max_faults",
                value: config.max_faults as f64,
            });
        }
        self.agreement
            .configure(config.p_false_alarm, config.p_missed_detection)?;
        self.factors = Some(LevelFactors::new(
            config.p_missed_detection,
            config.p_fault_free,
        )?);
        self.max_faults = config.max_faults;
        Ok(())
    }

    #[inline(never)]
    fn assess(&mut self, epoch: &MonitorEpoch<'_>) -> MonitorVerdict {
        if self.factors.is_none() {
            return MonitorVerdict::not_tested(NotTested::NotConfigured);
        }
        let (statistic, threshold) = match self.agreement.test(epoch.model(), RowSet::EMPTY) {
            Ok(tested) => tested,
            Err(why) => {
                let mut verdict = MonitorVerdict::not_tested(why);
                if let NotTested::NoRedundancy { .. } = why {
                    verdict.position_enu_m = Some(self.agreement.position_enu_m());
                    verdict.levels = Err(NoLevels::NoRedundancy);
                }
                return verdict;
            }
        };
        let mut verdict = MonitorVerdict {
            outcome: Outcome::Passed,
            excluded: RowSet::EMPTY,
            position_enu_m: Some(self.agreement.position_enu_m()),
            levels: Err(NoLevels::FaultPresent),
            statistic: Some(statistic.sum_of_squares),
            threshold: Some(threshold),
        };
        if statistic.passes(threshold) {
            verdict.levels = self.levels(epoch, RowSet::EMPTY);
            return verdict;
        }
        verdict.outcome = Outcome::Detected;
        self.sensitivity.fill(&mut self.agreement.qr);
        let found = exclusion::identify(
            &self.agreement.qr,
            &self.agreement.thresholds,
            self.max_faults,
            &mut self.exclusion,
        );
        if let Ok(found) = found
            && let Ok((statistic, threshold)) = self.agreement.test(epoch.model(), found.rows)
            && statistic.passes(threshold)
        {
            verdict.outcome = Outcome::Excluded;
            verdict.excluded = found.rows;
            verdict.position_enu_m = Some(self.agreement.position_enu_m());
            verdict.levels = self.levels(epoch, found.rows);
        }
        verdict
    }
}
