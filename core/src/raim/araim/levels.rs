//! Thresholds of the separations and the levels that bound the position error.
//!
//! In: solutions of the modes, risks. Out: thresholds, HPL and VPL, effective monitor threshold.
//!
//! | symbol | code | unit | meaning |
//! |--------|------|------|---------|
//! | K_fa   | `k_false_alert_*` | 1 | Q⁻¹(P_FA/(2 N)) vertically, Q⁻¹(P_FA/(4 N)) per horizontal direction, P_FA per sample, N monitored fault modes |
//! | T_k    | `threshold_m` | m | K_fa σ_ss,k + b_ss,k |
//! | PL     | | m | root of 2 Q((PL − b₀)/σ₀) + Σ p_k Q̄((PL − T_k − b_k)/σ_k) = target |
//! | Q̄      | | 1 | Q for a non-negative argument, else 1 |
//! | target | | 1 | PHMI of the direction per sample, less its share of the unmonitored faults |
//!
//! Source: [ARAIM-ADD] thresholds, protection levels, EMT. Keys: docs/references.md.
//! The root is exact to [`LEVEL_TOLERANCE_M`] and never below it: the level returned has been seen to keep
//! the risk. Cost: 7 to 15 evaluations of about 300 instructions per mode and direction.

use super::subsets::SubsetSolution;
use super::{AraimError, AraimParameters, Axis};
use crate::stats::{StatsError, normal};

/// Most a level lies above the root, m.
pub const LEVEL_TOLERANCE_M: f64 = 1e-6;

/// Share of P_EMT that still counts where priors are compared with tolerance: the probability of a
/// single fault is P_sat times that of no other fault, just below P_sat.
pub const EMT_PRIOR_TOLERANCE: f64 = 0.999;

/// Most evaluations of a root search; bisection from 1e6 m to the tolerance needs 40.
const MAX_EVALUATIONS: usize = 200;

/// Beyond it Q is below 1e-43 and no risk.
const NEGLIGIBLE_TAIL: f64 = 14.0;

/// What is known of the error bound of an epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AraimLevels {
    /// Vertical protection level, m.
    pub vpl_m: f64,
    /// Horizontal protection level, m: the root of the sum of squares of the next two.
    pub hpl_m: f64,
    /// Level of the east error, m.
    pub level_east_m: f64,
    /// Level of the north error, m.
    pub level_north_m: f64,
    /// Largest vertical threshold among the modes of at least P_EMT, m; 0 if there is none.
    pub emt_m: f64,
    /// The same among those of at least [`EMT_PRIOR_TOLERANCE`] P_EMT, m.
    pub emt_prior_tolerant_m: f64,
    /// Spread of the position error for accuracy, east, north, up, m.
    pub sigma_accuracy_enu_m: [f64; 3],
    /// Probability of the faults that no mode monitors, over the exposure.
    pub p_not_monitored: f64,
    /// Factor of the horizontal thresholds, 1; 0 without fault modes.
    pub k_false_alert_horizontal: f64,
    /// Factor of the vertical thresholds, 1.
    pub k_false_alert_vertical: f64,
    /// Modes found likely enough, the fault-free one included.
    pub modes_enumerated: usize,
    /// Those of them whose satellites left determine the position.
    pub modes_monitored: usize,
}

/// Sets the threshold of every solution; K_fa horizontally and vertically.
pub(super) fn set_thresholds(
    subsets: &mut [SubsetSolution],
    parameters: &AraimParameters,
) -> Result<[f64; 2], AraimError> {
    let faults = subsets.len().saturating_sub(1);
    if faults == 0 {
        return Ok([0.0; 2]);
    }
    let tests = faults as f64 * parameters.samples_continuity;
    let horizontal = normal::upper_quantile(parameters.p_false_alert_horizontal / (4.0 * tests))?;
    let vertical = normal::upper_quantile(parameters.p_false_alert_vertical / (2.0 * tests))?;
    for subset in subsets {
        let factors = [horizontal, horizontal, vertical];
        let terms = subset
            .sigma_separation_m
            .iter()
            .zip(&subset.bias_separation_m)
            .zip(factors);
        for (threshold, ((sigma, bias), factor)) in subset.threshold_m.iter_mut().zip(terms) {
            *threshold = factor * sigma + bias;
        }
    }
    Ok([horizontal, vertical])
}

/// Largest vertical threshold of the fault modes of at least this probability; 0 if there is none.
pub(super) fn effective_monitor_threshold(subsets: &[SubsetSolution], p_least: f64) -> f64 {
    let mut largest = 0.0;
    for subset in subsets.iter().skip(1) {
        let threshold = Axis::Up.of(&subset.threshold_m);
        // NaN is the largest.
        if subset.p_instant >= p_least && !(threshold <= largest) {
            largest = threshold;
        }
    }
    largest
}

/// Risk at a level, and its derivative, of what can hide there.
fn risk(subsets: &[SubsetSolution], axis: Axis, level_m: f64) -> Result<[f64; 2], StatsError> {
    let mut sum = 0.0;
    let mut slope = 0.0;
    for (index, subset) in subsets.iter().enumerate() {
        let sigma = axis.of(&subset.sigma_m);
        let offset = axis.of(&subset.threshold_m) + axis.of(&subset.bias_m);
        let argument = (level_m - offset) / sigma;
        // Both tails of the fault-free error; Q̄ of the one tail of a fault that was not detected.
        let (p, is_bounded) = if index == 0 {
            (2.0, true)
        } else {
            (subset.p_instant, argument >= 0.0)
        };
        if !is_bounded {
            sum += p;
        } else if !(argument > NEGLIGIBLE_TAIL) {
            sum += p * normal::upper_tail(argument)?;
            slope -= p * normal::density(argument) / sigma;
        }
    }
    Ok([sum, slope])
}

/// The level at which the risk falls to the target.
///
/// Newton's method on the logarithm of the risk, which is concave enough to overshoot to the side of less
/// risk and return from there; where it does not, or Q̄ jumps, bisection.
pub(super) fn protection_level(
    subsets: &[SubsetSolution],
    axis: Axis,
    target: f64,
) -> Result<f64, AraimError> {
    let none = AraimError::NoLevel { axis };
    let fault_free = subsets.first().ok_or(none)?;
    let sigma = axis.of(&fault_free.sigma_m);
    // Fault-free risk alone keeps the level above this.
    let mut low = axis.of(&fault_free.bias_m) + sigma * normal::upper_quantile(0.5 * target)?;
    let mut high = f64::INFINITY;
    let mut reach = sigma;
    let mut probe = low;
    let mut slow = 0;
    for _ in 0..MAX_EVALUATIONS {
        let width = high - low;
        if width <= LEVEL_TOLERANCE_M {
            return Ok(high);
        }
        let [at, slope] = risk(subsets, axis, probe)?;
        if at <= target {
            high = probe;
        } else if at > target {
            low = probe;
        } else {
            return Err(none);
        }
        let step = libm::log(at / target) * at / -slope;
        if high == f64::INFINITY {
            // Not bracketed yet: follow Newton, but neither stand still nor leap.
            let is_usable = step > 0.5 * reach && step < 4.0 * reach;
            probe = low + if is_usable { step } else { reach };
            reach *= 2.0;
            continue;
        }
        slow = if high - low > 0.5 * width {
            slow + 1
        } else {
            0
        };
        let mut next = probe + step;
        // Converged on one side: look just across the root for the other end of the bracket.
        if libm::fabs(step) < 0.25 * LEVEL_TOLERANCE_M {
            let across = 0.5 * LEVEL_TOLERANCE_M;
            next = probe + if at <= target { -across } else { across };
        }
        probe = if slow < 4 && next > low && next < high {
            next
        } else {
            slow = 0;
            0.5 * (low + high)
        };
    }
    Err(none)
}
