//! IGG-III through the common face: rows of weight zero are excluded, levels reconstructed.
//!
//! In: an epoch. A row's sigma is that of its whole error, as [P3] (3) adds it up. Out: the robust position;
//! levels by [`LevelConvention`]. What is assumed, and that the level is no integrity bound:
//! [`crate::raim::igg3`], [`crate::raim::reconstructed`].
//!
//! There are no levels while a row beyond k₁ is kept in, nor while a row moves the position and shows in no
//! residual.

use super::{
    ConfigureError, EpochMonitor, MonitorEpoch, MonitorVerdict, NoLevels, NotTested, Outcome,
    with_whole_sigmas,
};
use crate::linalg::LinearModel;
use crate::raim::exclusion::RowSet;
use crate::raim::igg3::{Igg3Config, Igg3Error, Igg3Workspace};
use crate::raim::reconstructed::LevelConvention;

/// What robust estimation is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobustConfig {
    /// Weights and iteration.
    pub estimator: Igg3Config,
    /// How the levels are read.
    pub levels: LevelConvention,
}

/// Robust estimation, and its memory (15 kB).
#[derive(Clone, Debug)]
pub struct RobustMonitor {
    config: Option<RobustConfig>,
    model: LinearModel,
    workspace: Igg3Workspace,
}

impl RobustMonitor {
    /// Not configured.
    pub const EMPTY: Self = Self {
        config: None,
        model: LinearModel::EMPTY,
        workspace: Igg3Workspace::EMPTY,
    };

    /// What the face does not show: weights, residuals.
    pub const fn workspace(&self) -> &Igg3Workspace {
        &self.workspace
    }
}

impl EpochMonitor for RobustMonitor {
    type Config = RobustConfig;

    fn configure(&mut self, config: &RobustConfig) -> Result<(), ConfigureError> {
        self.config = None;
        if !config.estimator.is_legal() {
            return Err(ConfigureError::OutOfRange {
                name: "k0, k1 or tolerance_m",
                value: config.estimator.k1,
            });
        }
        let LevelConvention {
            k_horizontal,
            k_vertical,
            least_factor,
            ..
        } = config.levels;
        for (name, value, is_legal) in [
            ("k_horizontal", k_horizontal, k_horizontal > 0.0),
            ("k_vertical", k_vertical, k_vertical > 0.0),
            ("least_factor", least_factor, least_factor >= 0.0),
        ] {
            if !(is_legal && value.is_finite()) {
                return Err(ConfigureError::OutOfRange { name, value });
            }
        }
        self.config = Some(*config);
        Ok(())
    }

    #[inline(never)]
    fn assess(&mut self, epoch: &MonitorEpoch<'_>) -> MonitorVerdict {
        let Some(config) = self.config else {
            return MonitorVerdict::not_tested(NotTested::NotConfigured);
        };
        with_whole_sigmas(epoch, &mut self.model);
        let robust = match self.workspace.estimate(&self.model, &config.estimator) {
            Ok(robust) => robust,
            Err(error) => return self.without(error),
        };
        let largest = self.workspace.standardised().iter().fold(0.0, |so_far, v| {
            let size = libm::fabs(*v);
            // NaN is the largest.
            if size <= so_far { so_far } else { size }
        });
        let outcome = if !robust.kept_outliers.is_empty() {
            Outcome::Detected
        } else if robust.zeroed.is_empty() {
            Outcome::Passed
        } else {
            Outcome::Excluded
        };
        let levels = if outcome == Outcome::Detected {
            Err(NoLevels::FaultPresent)
        } else if let Some(row) = self.workspace.untestable_row() {
            Err(NoLevels::Untestable { row })
        } else {
            config.levels.levels(&robust.fit, &robust.cofactor_enu_m2)
        };
        MonitorVerdict {
            outcome,
            excluded: robust.zeroed,
            position_enu_m: Some(robust.position_enu_m),
            levels,
            statistic: Some(largest),
            threshold: Some(config.estimator.k1),
        }
    }
}

impl RobustMonitor {
    /// The verdict where there is no robust solution.
    fn without(&mut self, error: Igg3Error) -> MonitorVerdict {
        match error {
            Igg3Error::Config => MonitorVerdict::not_tested(NotTested::NotConfigured),
            Igg3Error::Factor(error) => MonitorVerdict::not_tested(NotTested::Factor(error)),
            Igg3Error::NoRedundancy { n } => {
                MonitorVerdict::not_tested(NotTested::NoRedundancy { n })
            }
            Igg3Error::NotConverged => MonitorVerdict::not_tested(NotTested::NotConverged),
            // Rows contradict each other, and robust estimation cannot say which to believe.
            Igg3Error::Breakdown { .. } => MonitorVerdict {
                outcome: Outcome::Detected,
                excluded: RowSet::EMPTY,
                position_enu_m: self
                    .workspace
                    .least_squares(&self.model)
                    .ok()
                    .map(|start| start.position_enu_m),
                levels: Err(NoLevels::FaultPresent),
                statistic: None,
                threshold: None,
            },
        }
    }
}
