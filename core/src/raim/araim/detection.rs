//! The tests of measurements: solution separations against their thresholds, and the sum of squares.
//!
//! In: an evaluated epoch ([`Araim`]) and its pseudoranges, measured minus predicted. Out: [`Detection`].
//!
//! | symbol | code | unit | meaning |
//! |--------|------|------|---------|
//! | x⁽ᵏ⁾ − x⁽⁰⁾ | `separation_m` | m | solution without the satellites of mode k minus solution with all |
//! | τ      | `test_ratio` | 1 | largest of separation over threshold; above 1: a fault |
//! | χ²     | `sum_of_squares` | 1 | weighted sum of squared residuals |
//!
//! A fault that no mode explains can pass every separation; the sum of squares is the reference
//! algorithm's sanity check for it, with a threshold far above what the false-alert budget asks for.
//!
//! Source: [ARAIM-ADD] solution separation test, chi-square test. Keys: docs/references.md.

use super::subsets::Fit;
use super::{Araim, AraimError, Axis, SatelliteField};
use crate::stats::chi2;

/// False-alert probability of the sum of squares.
pub const P_FALSE_ALERT_CHI_SQUARE: f64 = 1e-8;

/// Result of the tests of an epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detection {
    /// Position minus the point of linearisation, east, north, up, m.
    pub position_enu_m: [f64; 3],
    /// Largest ratio of a separation to its threshold, 1; 0 without fault modes.
    pub test_ratio: f64,
    /// Index among [`Araim::subsets`] of the mode with that ratio.
    pub largest: usize,
    /// Weighted sum of squared residuals, weights for integrity, 1.
    pub sum_of_squares: f64,
    /// The same of the solution with weights for accuracy, 1: what the sanity check tests.
    pub sum_of_squares_accuracy: f64,
    /// Threshold of the sanity check; `None` without redundancy.
    pub chi_square_threshold: Option<f64>,
    /// Satellites minus unknowns.
    pub redundancy: usize,
}

impl Detection {
    /// Whether a separation exceeds its threshold. NaN does.
    pub fn separations_fail(&self) -> bool {
        !(self.test_ratio <= 1.0)
    }

    /// Whether the sum of squares exceeds its threshold. NaN does.
    pub fn chi_square_fails(&self) -> bool {
        self.chi_square_threshold
            .is_some_and(|threshold| !(self.sum_of_squares_accuracy <= threshold))
    }

    /// Whether the epoch must not be used as it is.
    pub fn is_detected(&self) -> bool {
        self.separations_fail() || self.chi_square_fails()
    }
}

impl Araim {
    /// Tests measurements of the evaluated epoch: measured minus predicted pseudoranges, one per satellite
    /// given to [`Araim::evaluate`], m. Gives the separation of every mode to `report`.
    ///
    /// # Errors
    /// [`AraimError::ResidualsMismatch`], [`AraimError::Satellite`] for a residual that is not finite, or
    /// beyond 1e9 m; [`AraimError::SingularGeometry`] when nothing is evaluated; [`AraimError::Stats`].
    #[inline(never)]
    pub fn test(
        &mut self,
        residual_m: &[f64],
        mut report: impl FnMut(usize, &[f64; 3]),
    ) -> Result<Detection, AraimError> {
        let fit = self.fit(residual_m)?;
        let mut detection = Detection {
            position_enu_m: fit.position_enu_m,
            test_ratio: 0.0,
            largest: 0,
            sum_of_squares: fit.sum_of_squares,
            sum_of_squares_accuracy: fit.sum_of_squares_accuracy,
            chi_square_threshold: None,
            redundancy: self.all_in_view.redundancy(),
        };
        if detection.redundancy > 0 {
            detection.chi_square_threshold = Some(chi2::upper_quantile(
                detection.redundancy as u32,
                P_FALSE_ALERT_CHI_SQUARE,
            )?);
        }
        let subsets = self.subsets.get(..self.count).unwrap_or(&[]);
        for (index, subset) in subsets.iter().enumerate() {
            if !self
                .all_in_view
                .leave_out(subset.excluded, &mut self.leave_out)
            {
                return Err(AraimError::SingularGeometry);
            }
            let (separation_m, _) = self.all_in_view.separation(&self.leave_out, &fit);
            report(index, &separation_m);
            if index == 0 {
                continue;
            }
            for axis in Axis::ALL {
                let threshold = axis.of(&subset.threshold_m);
                let size = libm::fabs(axis.of(&separation_m));
                // A separation that no measurement can cause is none: rounding over rounding is no test.
                if threshold <= MIN_THRESHOLD_M && size <= MIN_THRESHOLD_M {
                    continue;
                }
                let ratio = size / threshold;
                // A ratio that is no number stays the largest.
                if !(detection.test_ratio.is_nan() || ratio <= detection.test_ratio) {
                    detection.test_ratio = ratio;
                    detection.largest = index;
                }
            }
        }
        Ok(detection)
    }

    /// Position and residuals of measurements.
    pub(super) fn fit(&self, residual_m: &[f64]) -> Result<Fit, AraimError> {
        if self.count == 0 {
            return Err(AraimError::SingularGeometry);
        }
        if residual_m.len() != self.all_in_view.n() {
            return Err(AraimError::ResidualsMismatch {
                residuals: residual_m.len(),
                satellites: self.all_in_view.n(),
            });
        }
        for (index, value) in residual_m.iter().enumerate() {
            if !(libm::fabs(*value) <= 1e9) {
                return Err(AraimError::Satellite {
                    index,
                    field: SatelliteField::Residual,
                    value: *value,
                });
            }
        }
        Ok(self.all_in_view.fit(residual_m))
    }
}

/// Below it a separation is rounding.
const MIN_THRESHOLD_M: f64 = 1e-9;
