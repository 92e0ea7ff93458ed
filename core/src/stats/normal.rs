//! Upper tail Q of the standard normal distribution and its inverse.
//!
//! In: an argument, or a probability. Out: the tail probability, or the argument that has it.
//!
//! | symbol | code | unit | meaning |
//! |--------|------|------|---------|
//! | Q(x)   | [`upper_tail`] | 1 | P(Z > x), Z standard normal |
//! | Q⁻¹(p) | [`upper_quantile`] | 1 | the x with Q(x) = p |
//!
//! Equations: Q(x) = erfc(x/√2)/2, [DLMF] 7.2 with the density [AS] 26.2; starting value of the
//! quantile [AS] 26.2.23, improved by Halley's method. Keys: docs/references.md.
//! Accuracy: 1e-13 relative for probabilities down to 1e-300; where the quantile itself passes zero, at
//! p = 1/2, 1e-16 absolute (host-tests/tests/stats_golden.rs).

use super::{StatsError, check_probability};
use core::f64::consts::FRAC_1_SQRT_2;

/// 1/√(2π).
const FRAC_1_SQRT_TAU: f64 = 0.398_942_280_401_432_7;

/// Halley steps of the quantile. The starting value is good to 4.5e-4 and each step multiplies the
/// number of right digits by three, so that two reach rounding; the third is margin.
const HALLEY_STEPS: usize = 3;

/// Density of the standard normal distribution. [AS] 26.2.
pub fn density(x: f64) -> f64 {
    FRAC_1_SQRT_TAU * libm::exp(-0.5 * x * x)
}

/// Q(x) = P(Z > x); infinities have their limits 0 and 1.
///
/// # Errors
/// [`StatsError::ArgumentOutOfRange`] for NaN.
pub fn upper_tail(x: f64) -> Result<f64, StatsError> {
    if x.is_nan() {
        return Err(StatsError::ArgumentOutOfRange { argument: x });
    }
    Ok(tail(x))
}

fn tail(x: f64) -> f64 {
    0.5 * libm::erfc(x * FRAC_1_SQRT_2)
}

/// Q⁻¹(p): the x with P(Z > x) = p. Negative for p above one half.
///
/// # Errors
/// [`StatsError::ProbabilityOutOfRange`] for p outside (0, 1), below 1e-300, or NaN.
pub fn upper_quantile(p: f64) -> Result<f64, StatsError> {
    let p = check_probability(p)?;
    if p == 0.5 {
        Ok(0.0)
    } else if p < 0.5 {
        Ok(quantile_of_small(p))
    } else {
        // 1 − p is exact here (Sterbenz), nothing is lost by going through the other tail.
        Ok(-quantile_of_small(1.0 - p))
    }
}

/// Quantile for p in (0, 1/2).
fn quantile_of_small(p: f64) -> f64 {
    // [AS] 26.2.23, coefficients c0..c2 and d1..d3.
    let t = libm::sqrt(-2.0 * libm::log(p));
    let mut x = t
        - (2.515_517 + t * (0.802_853 + t * 0.010_328))
            / (1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308)));
    for _ in 0..HALLEY_STEPS {
        // Halley's method for Q(x) − p with Q' = −φ and Q'' = xφ.
        let newton = (tail(x) - p) / density(x);
        x += newton / (1.0 - 0.5 * x * newton);
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantile_undoes_tail_from_the_far_left_to_the_far_right() {
        let mut x = -8.0;
        while x < 37.0 {
            let p = upper_tail(x).unwrap();
            // Left of −4 the probability itself is rounded to 1.
            let tolerance = if x < -4.0 { 1e-1 } else { 1e-11 };
            if p < 1.0 {
                assert!((upper_quantile(p).unwrap() - x).abs() < tolerance, "{x}");
            }
            x += 0.173;
        }
    }

    #[test]
    fn what_is_no_probability_is_refused() {
        for p in [0.0, 1.0, -0.1, 1.1, 1e-301, f64::NAN, f64::INFINITY] {
            assert!(matches!(
                upper_quantile(p),
                Err(StatsError::ProbabilityOutOfRange { .. })
            ));
        }
        assert!(upper_tail(f64::NAN).is_err());
        assert_eq!(upper_tail(f64::INFINITY), Ok(0.0));
        assert_eq!(upper_tail(f64::NEG_INFINITY), Ok(1.0));
        assert_eq!(upper_quantile(0.5), Ok(0.0));
    }
}
