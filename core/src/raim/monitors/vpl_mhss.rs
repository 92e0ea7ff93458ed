//! VPL-based solution separation through the common face: the satellite whose absence makes the vertical
//! level smallest is left out.
//!
//! In: an epoch. A row's sigma is that of its whole error, that common to satellites included. Out: levels over
//! the hypotheses of one faulty satellite each. The statistic is the vertical level of all satellites, m.
//! Thresholds and margin, and what is assumed: [`crate::raim::vpl_mhss`].

use super::{
    ConfigureError, EpochMonitor, MonitorEpoch, MonitorVerdict, NoLevels, NotTested, Outcome,
    checked_levels, with_whole_sigmas,
};
use crate::linalg::LinearModel;
use crate::raim::RaimError;
use crate::raim::exclusion::RowSet;
use crate::raim::vpl_mhss::VplSeparation;

/// What VPL-based solution separation is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VplConfig {
    /// Probability that the error exceeds the level under a hypothesis.
    pub p_level: f64,
    /// Probability that healthy satellites raise an alarm or that one of them is left out, in an epoch.
    pub p_false_alarm: f64,
}

impl VplConfig {
    /// k_v = 5.33 as in [P4] 2.1; the false-alarm probability of a sample that receivers of navigation have
    /// [DO-229].
    pub const PRESET: Self = Self {
        p_level: 1e-7,
        p_false_alarm: 3.3333e-7,
    };
}

/// VPL-based solution separation, and its memory (16 kB).
#[derive(Clone, Debug)]
pub struct VplMonitor {
    is_configured: bool,
    model: LinearModel,
    separation: VplSeparation,
}

impl VplMonitor {
    /// Not configured.
    pub const EMPTY: Self = Self {
        is_configured: false,
        model: LinearModel::EMPTY,
        separation: VplSeparation::EMPTY,
    };
}

impl EpochMonitor for VplMonitor {
    type Config = VplConfig;

    fn configure(&mut self, config: &VplConfig) -> Result<(), ConfigureError> {
        self.is_configured = false;
        self.separation
            .configure(config.p_level, config.p_false_alarm)?;
        self.is_configured = true;
        Ok(())
    }

    #[inline(never)]
    fn assess(&mut self, epoch: &MonitorEpoch<'_>) -> MonitorVerdict {
        if !self.is_configured {
            return MonitorVerdict::not_tested(NotTested::NotConfigured);
        }
        with_whole_sigmas(epoch, &mut self.model);
        let test = match self.separation.test(&self.model) {
            Ok(test) => test,
            Err(RaimError::Factor(error)) => {
                return MonitorVerdict::not_tested(NotTested::Factor(error));
            }
            Err(RaimError::NoRedundancy { n }) => {
                return MonitorVerdict {
                    position_enu_m: Some(self.separation.position_enu_m(None)),
                    levels: Err(NoLevels::NoRedundancy),
                    ..MonitorVerdict::not_tested(NotTested::NoRedundancy { n })
                };
            }
        };
        let out = test.excluded();
        let (outcome, levels) = match (out, test.untestable, test.smallest) {
            (Some(_), _, Some(without)) => (
                Outcome::Excluded,
                checked_levels(self.separation.hpl_m(out), without.vpl_m),
            ),
            _ if !test.passes() => (Outcome::Detected, Err(NoLevels::FaultPresent)),
            (_, Some(row), _) => (Outcome::Passed, Err(NoLevels::Untestable { row })),
            _ => (
                Outcome::Passed,
                checked_levels(self.separation.hpl_m(None), test.vpl_m),
            ),
        };
        MonitorVerdict {
            outcome,
            excluded: out.map_or(RowSet::EMPTY, |row| RowSet::EMPTY.with(row)),
            position_enu_m: Some(self.separation.position_enu_m(out)),
            levels,
            statistic: Some(test.vpl_m),
            threshold: Some(test.threshold_m),
        }
    }
}
