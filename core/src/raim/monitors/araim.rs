//! ARAIM through the common face: separations against thresholds, exclusion with its risk, levels.
//!
//! In: an epoch, integrity support data per constellation. The error of a pseudorange is the one the epoch
//! gives to its row, common part included, for integrity and accuracy alike, or that of the support data with
//! airborne equipment of two frequencies: [`PseudorangeErrors`]. Nominal bias and fault probabilities are those of
//! the support data. Sources and assumptions: [`crate::raim::araim`].
//!
//! With more than [`MAX_ARAIM_SATELLITES`] rows the highest satellites are taken: the others are
//! neither used nor tested, and not excluded.

use super::{
    ConfigureError, EpochMonitor, MonitorEpoch, MonitorVerdict, NoLevels, NotTested, Outcome,
    checked_levels,
};
use crate::consts::{MAX_CLOCKS, MAX_SATELLITES};
use crate::gnss::solution::UsedRow;
use crate::raim::araim::levels::AraimLevels;
use crate::raim::araim::modes::SatelliteSet;
use crate::raim::araim::support::{IntegritySupport, user_sigma_m};
use crate::raim::araim::{
    Araim, AraimConstellation, AraimError, AraimParameters, AraimSatellite, MAX_ARAIM_SATELLITES,
};
use crate::raim::exclusion::RowSet;

/// Whose error model weighs the rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PseudorangeErrors {
    /// The rows' own, for integrity and accuracy alike.
    Rows,
    /// σ_URA for integrity, σ_URE for accuracy, with troposphere, and multipath and noise of airborne equipment in
    /// the ionosphere-free combination. [BLANCH-2015] Only for rows that are such combinations.
    Support,
}

/// What ARAIM is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AraimConfig {
    /// Risks, and how faults are monitored.
    pub parameters: AraimParameters,
    /// Integrity support data of each constellation, in the order of [`crate::gnss::System::ALL`].
    pub support: [IntegritySupport; MAX_CLOCKS],
    /// Errors of the pseudoranges.
    pub errors: PseudorangeErrors,
    /// Whether a fault is taken out. Without, the whole integrity risk is the position's of all satellites,
    /// and its levels are smaller.
    pub excludes: bool,
    /// Exposure, s; 0 counts faults at the instant alone (version 3).
    pub exposure_s: f64,
}

impl AraimConfig {
    /// LPV-200 with the baseline algorithm, version 3, excluding, the errors those of the support data.
    pub const LPV_200_V3: Self = Self {
        parameters: AraimParameters::LPV_200,
        support: IntegritySupport::BASELINE,
        errors: PseudorangeErrors::Support,
        excludes: true,
        exposure_s: 0.0,
    };
}

/// ARAIM, and its memory (202 kB).
#[derive(Clone, Debug)]
pub struct AraimMonitor {
    config: Option<AraimConfig>,
    araim: Araim,
    scratch: Araim,
    satellites: [AraimSatellite; MAX_ARAIM_SATELLITES],
    residual_m: [f64; MAX_ARAIM_SATELLITES],
    /// The row of each satellite.
    row: [usize; MAX_ARAIM_SATELLITES],
    n: usize,
    levels: Option<AraimLevels>,
}

impl AraimMonitor {
    /// Not configured.
    pub const EMPTY: Self = Self {
        config: None,
        araim: Araim::EMPTY,
        scratch: Araim::EMPTY,
        satellites: [AraimSatellite::EMPTY; MAX_ARAIM_SATELLITES],
        residual_m: [0.0; MAX_ARAIM_SATELLITES],
        row: [0; MAX_ARAIM_SATELLITES],
        n: 0,
        levels: None,
    };

    /// What the face does not show of the last epoch, no exclusion made: accuracy, effective monitor threshold.
    pub const fn levels(&self) -> Option<&AraimLevels> {
        self.levels.as_ref()
    }

    /// The satellites of the epoch as ARAIM takes them, the highest where there are too many.
    fn take_in(&mut self, epoch: &MonitorEpoch<'_>, config: &AraimConfig) {
        self.n = 0;
        let limit_rad = lowest_taken_rad(epoch.rows());
        let model = epoch.model();
        let given = model.design.iter().zip(&model.residual_m);
        let places = self
            .satellites
            .iter_mut()
            .zip(&mut self.residual_m)
            .zip(&mut self.row);
        let chosen = epoch
            .rows()
            .iter()
            .zip(given)
            .enumerate()
            // NaN is taken, to be refused.
            .filter(|(_, (used, _))| !(used.elevation_rad < limit_rad))
            .filter_map(|(row, (used, given))| {
                let support = config.support.get(used.satellite.system().index())?;
                Some((row, used, given, support))
            });
        for (((satellite, residual_m), place), (row, used, (design, given_m), support)) in
            places.zip(chosen)
        {
            let [east, north, up, ..] = *design;
            let system = used.satellite.system();
            *satellite = support.satellite(
                system.index(),
                [east, north, up],
                used.elevation_rad,
                user_sigma_m(system, used.elevation_rad),
                config.exposure_s,
            );
            if config.errors == PseudorangeErrors::Rows {
                let sigma_m = used.sigma.total_m();
                satellite.variance_integrity_m2 = sigma_m * sigma_m;
                satellite.variance_accuracy_m2 = sigma_m * sigma_m;
            }
            *residual_m = *given_m;
            *place = row;
            self.n += 1;
        }
    }

    fn rows_of(&self, satellites: SatelliteSet) -> RowSet {
        let mut rows = RowSet::EMPTY;
        for (index, row) in self.row.iter().enumerate().take(self.n) {
            if satellites.contains(index) {
                rows = rows.with(*row);
            }
        }
        rows
    }
}

/// The elevation from which on satellites are taken, so that no more than there is room for are.
fn lowest_taken_rad(rows: &[UsedRow]) -> f64 {
    if rows.len() <= MAX_ARAIM_SATELLITES {
        return f64::NEG_INFINITY;
    }
    let mut elevations = [f64::NEG_INFINITY; MAX_SATELLITES];
    for (place, row) in elevations.iter_mut().zip(rows) {
        *place = row.elevation_rad;
    }
    // The elevation that fewer than MAX_ARAIM_SATELLITES others exceed.
    let mut lowest = f64::NEG_INFINITY;
    for candidate in elevations.iter().take(rows.len()) {
        let not_lower = elevations.iter().filter(|e| *e >= candidate).count();
        if not_lower >= MAX_ARAIM_SATELLITES && *candidate > lowest {
            lowest = *candidate;
        }
    }
    lowest
}

fn why_not(error: AraimError) -> NotTested {
    match error {
        AraimError::SatellitesOutOfRange { satellites }
        | AraimError::TooFewSatellites { satellites, .. } => {
            NotTested::RowsOutOfRange { n: satellites }
        }
        AraimError::Stats(error) => NotTested::Stats(error),
        AraimError::ModesExceedCapacity
        | AraimError::FaultsTooLikely { .. }
        | AraimError::NoIntegrityBudget { .. } => NotTested::FaultsNotMonitored,
        AraimError::SingularGeometry => {
            NotTested::Factor(crate::linalg::qr::QrError::BadGeometry {
                condition: f64::INFINITY,
            })
        }
        AraimError::ConstellationsOutOfRange { .. }
        | AraimError::Satellite { .. }
        | AraimError::Constellation { .. }
        | AraimError::Parameter { .. }
        | AraimError::ResidualsMismatch { .. }
        | AraimError::NoLevel { .. } => NotTested::Number,
    }
}

impl EpochMonitor for AraimMonitor {
    type Config = AraimConfig;

    fn configure(&mut self, config: &AraimConfig) -> Result<(), ConfigureError> {
        self.config = None;
        // Written so that NaN refuses; what is left is checked with each epoch.
        if !(config.exposure_s >= 0.0 && config.exposure_s <= 1e6) {
            return Err(ConfigureError::OutOfRange {
                name: "exposure_s",
                value: config.exposure_s,
            });
        }
        self.config = Some(*config);
        Ok(())
    }

    #[inline(never)]
    fn assess(&mut self, epoch: &MonitorEpoch<'_>) -> MonitorVerdict {
        self.levels = None;
        let Some(config) = self.config else {
            return MonitorVerdict::not_tested(NotTested::NotConfigured);
        };
        self.take_in(epoch, &config);
        let none = AraimConstellation {
            p_fault: 0.0,
            exposure: 0.0,
        };
        let mut constellations = [none; MAX_CLOCKS];
        for (constellation, support) in constellations.iter_mut().zip(&config.support) {
            *constellation = support.constellation(config.exposure_s);
        }
        let satellites = self.satellites.get(..self.n).unwrap_or(&[]);
        let residual_m = self.residual_m.get(..self.n).unwrap_or(&[]);
        let evaluated = if config.excludes {
            self.araim
                .evaluate_with_exclusion(satellites, &constellations, &config.parameters)
        } else {
            self.araim
                .evaluate(satellites, &constellations, &config.parameters)
        };
        self.levels = evaluated.ok();
        let levels = match evaluated {
            Ok(levels) => checked_levels(levels.hpl_m, levels.vpl_m),
            Err(AraimError::NoIntegrityBudget { .. }) => Err(NoLevels::NoIntegrityBudget),
            Err(error) => return MonitorVerdict::not_tested(why_not(error)),
        };
        let detection = match self.araim.test(residual_m, |_, _| {}) {
            Ok(detection) => detection,
            Err(error) => return MonitorVerdict::not_tested(why_not(error)),
        };
        let mut verdict = MonitorVerdict {
            outcome: Outcome::Passed,
            excluded: RowSet::EMPTY,
            position_enu_m: Some(detection.position_enu_m),
            levels,
            statistic: Some(detection.test_ratio),
            threshold: Some(1.0),
        };
        if detection.redundancy == 0 {
            verdict.outcome = Outcome::NotTested(NotTested::NoRedundancy { n: self.n });
            verdict.levels = Err(NoLevels::NoRedundancy);
            return verdict;
        }
        if !detection.is_detected() {
            return verdict;
        }
        verdict.outcome = Outcome::Detected;
        verdict.levels = Err(NoLevels::FaultPresent);
        if !config.excludes {
            return verdict;
        }
        let found = self.araim.exclude(
            satellites,
            &config.parameters,
            residual_m,
            &mut self.scratch,
        );
        if let Ok(found) = found {
            verdict.outcome = Outcome::Excluded;
            verdict.excluded = self.rows_of(found.excluded);
            verdict.position_enu_m = Some(found.remaining.position_enu_m);
            verdict.levels = checked_levels(found.levels.hpl_m, found.levels.vpl_m);
        }
        verdict
    }
}
