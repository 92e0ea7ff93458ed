//! Protection levels from the slope of a missed fault and the noise on top of it.
//!
//! In: slope levels and the fault-free covariance of an epoch ([`super::slope`]), risks. Out: HPL, VPL.
//!
//! | symbol | code | unit | meaning |
//! |--------|------|------|---------|
//! | slope √λ | `slope` | m | shift by the largest fault the test misses with P_MD [BROWN-1992] |
//! | σ      | `sigma_horizontal_m`, `sigma_vertical_m` | m | fault-free error, errors common to satellites included |
//! | K_md   | `k_missed_horizontal`, `k_missed_vertical` | 1 | √(−2 ln P_MD) (circle), Q⁻¹(P_MD/2) |
//! | K_ff   | `k_fault_free` | 1 | Q⁻¹(p/2), p the fault-free risk |
//!
//! Level = max(slope √λ + K_md σ, K_ff σ). The slope alone, as [BROWN-1992] has it, leaves out the noise on
//! top of the fault; with K_md σ the probability of a missed fault *and* an error above the level is at
//! most P_MD for every size of the fault: derivation in docs/decisions/002-snapshot-monitor.md.

use nalgebra::Matrix3;

use super::slope::{SlopeLevels, semi_major_axis_m};
use crate::stats::{StatsError, normal};

/// Factors on the fault-free sigmas; computed once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelFactors {
    k_fault_free: f64,
    k_missed_horizontal: f64,
    k_missed_vertical: f64,
}

impl LevelFactors {
    /// Factors of a missed-detection and a fault-free risk.
    ///
    /// # Errors
    /// [`StatsError`] for a probability outside (0, 1).
    pub fn new(p_missed_detection: f64, p_fault_free: f64) -> Result<Self, StatsError> {
        Ok(Self {
            k_fault_free: normal::upper_quantile(0.5 * p_fault_free)?,
            k_missed_vertical: normal::upper_quantile(0.5 * p_missed_detection)?,
            k_missed_horizontal: libm::sqrt(-2.0 * libm::log(p_missed_detection)),
        })
    }

    /// HPL and VPL, m; NaN where an input is.
    pub fn levels_m(&self, slope: &SlopeLevels, covariance_enu_m2: &Matrix3<f64>) -> [f64; 2] {
        let sigma_horizontal_m = semi_major_axis_m(covariance_enu_m2);
        let sigma_vertical_m = libm::sqrt(covariance_enu_m2.m33);
        [
            larger(
                slope.hpl_m + self.k_missed_horizontal * sigma_horizontal_m,
                self.k_fault_free * sigma_horizontal_m,
            ),
            larger(
                slope.vpl_m + self.k_missed_vertical * sigma_vertical_m,
                self.k_fault_free * sigma_vertical_m,
            ),
        ]
    }
}

/// The larger of two levels; NaN if either is.
fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_larger_of_two_levels_is_nan_when_one_is() {
        assert!(larger(f64::NAN, 1.0).is_nan());
        assert!(larger(1.0, f64::NAN).is_nan());
        assert_eq!(larger(2.0, 1.0), 2.0);
        assert_eq!(larger(1.0, 2.0), 2.0);
    }

    #[test]
    fn impossible_risks_are_refused() {
        for p in [0.0, 2.0, -1.0, f64::NAN] {
            assert!(LevelFactors::new(p, 1e-7).is_err());
            assert!(LevelFactors::new(1e-3, p).is_err());
        }
    }
}
