//! Regularised incomplete gamma functions P(a, x) and Q(a, x) of half-integer order a.
//!
//! In: twice the order (a whole number: the degrees of freedom of a chi-square variable), x ≥ 0.
//! Out: the lower or the upper part; each with its own relative accuracy, however small.
//!
//! Equations: [DLMF] 8.7 series → [`lower`] left of the order; [DLMF] 8.8 recurrence down to
//! Q(1/2, x) = erfc(√x) or Q(1, x) = e⁻ˣ → [`upper`] right of the order. On the other side each is one
//! minus the other, where that costs no digits. All terms are positive. Keys: docs/references.md.
//! Cost: at most a + 10√a terms.

use super::{StatsError, check_argument};

/// Largest twice-order: the central degrees of freedom and the terms of a non-central sum.
pub(super) const MAX_TWICE_ORDER: u32 = 20_000;

/// Terms of the series before it is given up; left of the order 10√a + 40 suffice.
const MAX_SERIES_TERMS: usize = 1_200;

/// xᵃ e⁻ˣ / Γ(a + 1), the step of the recurrences [DLMF] 8.8; x > 0, a ≥ −1/2.
pub(super) fn recurrence_step(a: f64, x: f64) -> f64 {
    libm::exp(a * libm::log(x) - x - libm::lgamma(a + 1.0))
}

/// P(a, x) with a = `twice_order`/2.
///
/// # Errors
/// [`StatsError::DegreesOfFreedomOutOfRange`] for order 0 or above 10,000,
/// [`StatsError::ArgumentOutOfRange`] for x negative or not finite.
pub fn lower(twice_order: u32, x: f64) -> Result<f64, StatsError> {
    let (a, x) = check(twice_order, x)?;
    if x < a {
        lower_by_series(a, x)
    } else {
        Ok(1.0 - upper_by_recurrence(twice_order, x))
    }
}

/// Q(a, x) with a = `twice_order`/2.
///
/// # Errors
/// As [`lower`].
pub fn upper(twice_order: u32, x: f64) -> Result<f64, StatsError> {
    let (a, x) = check(twice_order, x)?;
    if x < a {
        Ok(1.0 - lower_by_series(a, x)?)
    } else {
        Ok(upper_by_recurrence(twice_order, x))
    }
}

fn check(twice_order: u32, x: f64) -> Result<(f64, f64), StatsError> {
    if twice_order == 0 || twice_order > MAX_TWICE_ORDER {
        return Err(StatsError::DegreesOfFreedomOutOfRange {
            degrees_of_freedom: twice_order,
        });
    }
    Ok((0.5 * f64::from(twice_order), check_argument(x)?))
}

/// [DLMF] 8.7: P(a, x) = Σₖ x^(a+k) e⁻ˣ / Γ(a+k+1), for x < a.
fn lower_by_series(a: f64, x: f64) -> Result<f64, StatsError> {
    if x == 0.0 {
        return Ok(0.0);
    }
    let mut term = 1.0;
    let mut sum = 1.0;
    let mut order = a;
    for _ in 0..MAX_SERIES_TERMS {
        order += 1.0;
        term *= x / order;
        sum += term;
        if term <= sum * 1e-17 {
            return Ok(sum * recurrence_step(a, x));
        }
    }
    Err(StatsError::NotConverged)
}

/// [DLMF] 8.8 from the order down: Q(a, x) = Q(a−1, x) + x^(a−1) e⁻ˣ / Γ(a), for x ≥ a, where each
/// term is at most the one before.
fn upper_by_recurrence(twice_order: u32, x: f64) -> f64 {
    let steps = twice_order / 2;
    let is_half_integer = twice_order % 2 == 1;
    let mut sum = if is_half_integer {
        libm::erfc(libm::sqrt(x))
    } else {
        0.0
    };
    if steps > 0 {
        let mut order = 0.5 * f64::from(twice_order) - 1.0;
        let mut term = recurrence_step(order, x);
        for _ in 0..steps {
            sum += term;
            if term <= sum * 1e-17 {
                break;
            }
            term *= order / x;
            order -= 1.0;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_add_up_to_one_across_the_change_of_method() {
        for twice_order in [1, 2, 3, 7, 44, 45, 300, 1000, 20_000] {
            let a = 0.5 * f64::from(twice_order);
            for factor in [0.0, 1e-3, 0.5, 0.999_999, 1.0, 1.000_001, 1.5, 3.0] {
                let x = a * factor;
                let sum = lower(twice_order, x).unwrap() + upper(twice_order, x).unwrap();
                assert!((sum - 1.0).abs() < 1e-15, "{twice_order} {x} {sum}");
            }
            // The series and the recurrence meet at the order.
            let left = lower_by_series(a, a * (1.0 - 1e-15)).unwrap();
            let right = 1.0 - upper_by_recurrence(twice_order, a);
            assert!((left / right - 1.0).abs() < 1e-10, "{twice_order}");
        }
    }

    #[test]
    fn illegal_arguments_are_refused() {
        assert!(lower(0, 1.0).is_err());
        assert!(upper(MAX_TWICE_ORDER + 1, 1.0).is_err());
        for x in [-1.0, f64::NAN, f64::INFINITY] {
            assert!(lower(3, x).is_err());
            assert!(upper(3, x).is_err());
        }
    }
}
