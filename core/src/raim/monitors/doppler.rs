//! Doppler RAIM: the range rates of an epoch tested against each other, a faulty one taken out, the velocity
//! bounded.
//!
//! In: the range rates of a position's satellites. Out: a verdict of the common face, whose position is the
//! velocity and whose levels bound its error, in m/s.
//!
//! | symbol | code | shape | unit | frame | meaning |
//! |--------|------|-------|------|-------|---------|
//! | −u, 1  | `design` | n × 4 | 1 | enu | derivative by the velocity and by the clock drift |
//! | y      | `residual_m` | n | m/s | | measured − predicted for a receiver at rest |
//! | σ      | `sigma_m` | n | m/s | | of a range rate, times `sigma_factor` |
//!
//! Range rates are linear in velocity and clock drift with the rows that pseudoranges have in position and clock, so
//! that everything of residual RAIM applies as it is, with m/s for m: parity test [P1] (11) to (14), slope
//! [BROWN-1992], normalised residual [BAARDA-1968], re-test after the exclusion. [`super::residual`]
//! does it. What differs: one clock whatever the constellations, so that k systems leave k − 1 more rows to test
//! with, and no error that satellites share.
//!
//! Assumes: the position is right to hundreds of metres (100 m turn a line of sight by 5 µrad, 2 cm/s for a
//! satellite's 4 km/s; a position that passed its own test is much nearer); the errors of range rates are
//! normal and independent. Behind obstructions they are neither: choose `sigma_factor` from what the antenna
//! sees. What recordings show: docs/decisions/023-doppler-raim.md.

use super::residual::{ResidualConfig, ResidualMonitor};
use super::{ConfigureError, EpochMonitor, MonitorEpoch, MonitorVerdict, NotTested};
use crate::gnss::SatelliteSet;
use crate::gnss::solution::{RangeRates, SnapshotWorkspace};
use crate::raim::exclusion::RowSet;

/// Factors on the sigma of a range rate that mean something: from a hundredth to a hundred.
const SIGMA_FACTORS: core::ops::RangeInclusive<f64> = 0.01..=100.0;

/// What Doppler RAIM is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DopplerConfig {
    /// Risks, and how many range rates may be faulty at a time.
    pub test: ResidualConfig,
    /// Sigma of a range rate over that of [`crate::gnss::weights::range_rate_sigma_mps`], 0.01 to 100.
    pub sigma_factor: f64,
}

impl DopplerConfig {
    /// An antenna with a free sky: the risks of a non-precision approach for a single fault, the sigma of the
    /// model.
    pub const FREE_SKY: Self = Self {
        test: ResidualConfig {
            p_false_alarm: 3.3333e-7,
            p_missed_detection: 1e-3,
            p_fault_free: 1e-7,
            max_faults: 1,
        },
        sigma_factor: 1.0,
    };
}

/// Doppler RAIM, and its memory (21 kB).
#[derive(Clone, Debug)]
pub struct DopplerMonitor {
    residual: ResidualMonitor,
    /// `None` before it is configured.
    sigma_factor: Option<f64>,
    rates: RangeRates,
}

impl DopplerMonitor {
    /// Not configured.
    pub const EMPTY: Self = Self {
        residual: ResidualMonitor::EMPTY,
        sigma_factor: None,
        rates: RangeRates::EMPTY,
    };

    /// Looks at the range rates of the satellites of the last solution.
    pub fn assess_velocity(&mut self, workspace: &SnapshotWorkspace) -> MonitorVerdict {
        workspace.range_rates(&mut self.rates);
        self.test()
    }

    /// The satellites of rows of the last epoch.
    pub fn satellites(&self, rows: RowSet) -> SatelliteSet {
        let mut satellites = SatelliteSet::EMPTY;
        for (row, used) in self.rates.rows.iter().enumerate() {
            if rows.contains(row) {
                satellites.insert(used.satellite);
            }
        }
        satellites
    }

    /// Tests the rows taken in, with the sigmas of the configuration.
    fn test(&mut self) -> MonitorVerdict {
        let Some(factor) = self.sigma_factor else {
            return MonitorVerdict::not_tested(NotTested::NotConfigured);
        };
        let RangeRates { model, rows } = &mut self.rates;
        for (sigma_mps, row) in model.sigma_m.iter_mut().zip(rows.iter_mut()) {
            *sigma_mps *= factor;
            row.sigma.independent_m *= factor;
            row.sigma.common_m *= factor;
        }
        match MonitorEpoch::new(model, rows) {
            Ok(epoch) => self.residual.assess(&epoch),
            Err(why) => MonitorVerdict::not_tested(why),
        }
    }
}

impl EpochMonitor for DopplerMonitor {
    type Config = DopplerConfig;

    fn configure(&mut self, config: &DopplerConfig) -> Result<(), ConfigureError> {
        self.sigma_factor = None;
        if !SIGMA_FACTORS.contains(&config.sigma_factor) {
            return Err(ConfigureError::OutOfRange {
                name: "sigma_factor",
                value: config.sigma_factor,
            });
        }
        self.residual.configure(&config.test)?;
        self.sigma_factor = Some(config.sigma_factor);
        Ok(())
    }

    /// Rows of range rates, m/s, as [`SnapshotWorkspace::range_rates`] writes them.
    #[inline(never)]
    fn assess(&mut self, epoch: &MonitorEpoch<'_>) -> MonitorVerdict {
        self.rates.model.clone_from(epoch.model());
        self.rates.rows.clear();
        // No more rows than the epoch may have, so it fits.
        let _ = self.rates.rows.extend_from_slice(epoch.rows());
        self.test()
    }
}
