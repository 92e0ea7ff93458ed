//! Tails, quantiles and non-centrality of the chi-square distribution.
//!
//! In: degrees of freedom k, non-centrality λ, an argument or a probability.
//! Out: P(X ≤ x) and P(X > x) for X = Σ (zᵢ + μᵢ)², zᵢ standard normal, λ = Σ μᵢ²; the x of a given
//! tail; the λ at which a test of threshold T misses a fault with a given probability.
//!
//! | symbol | code                 | unit | meaning                              |
//! |--------|----------------------|------|--------------------------------------|
//! | k      | `degrees_of_freedom` | 1    | number of squares, redundancy        |
//! | λ      | `noncentrality`      | 1    | squared length of the mean           |
//! | wⱼ     | `weight`             | 1    | Poisson weight e^(−λ/2) (λ/2)ʲ/j!    |
//!
//! Equations: [AS] 26.4 central → [`lower_tail`], [`upper_tail`]; [AS] 26.4 non-central as
//! a Poisson mixture of central ones → [`noncentral_lower_tail`], [`noncentral_upper_tail`];
//! [AS] 26.4.17 (Wilson and Hilferty) starting value → [`upper_quantile`]. Keys: docs/references.md.
//! Accuracy: 1e-10 relative down to tails of 1e-12 (host-tests/tests/stats_golden.rs).
//! Cost: 50 to 200 terms per non-central value at the λ of RAIM, at most 7,000.

use super::{StatsError, check_argument, check_probability, gamma, normal};

/// Most degrees of freedom.
pub const MAX_DEGREES_OF_FREEDOM: u32 = 1_000;

/// Largest non-centrality.
pub const MAX_NONCENTRALITY: f64 = 10_000.0;

/// Most steps of a root search. Bisection alone would need about 60 per factor of 2^60.
const MAX_STEPS: usize = 200;

/// Most doublings when a root is bracketed.
const MAX_DOUBLINGS: usize = 64;

/// P(X ≤ x), X central chi-square.
///
/// # Errors
/// [`StatsError::DegreesOfFreedomOutOfRange`], [`StatsError::ArgumentOutOfRange`].
pub fn lower_tail(degrees_of_freedom: u32, x: f64) -> Result<f64, StatsError> {
    check_degrees(degrees_of_freedom)?;
    gamma::lower(degrees_of_freedom, 0.5 * check_argument(x)?)
}

/// P(X > x), X central chi-square.
///
/// # Errors
/// As [`lower_tail`].
pub fn upper_tail(degrees_of_freedom: u32, x: f64) -> Result<f64, StatsError> {
    check_degrees(degrees_of_freedom)?;
    gamma::upper(degrees_of_freedom, 0.5 * check_argument(x)?)
}

/// The x with P(X > x) = p, X central chi-square: the threshold of a test with false-alarm
/// probability p.
///
/// # Errors
/// [`StatsError::DegreesOfFreedomOutOfRange`], [`StatsError::ProbabilityOutOfRange`],
/// [`StatsError::NotConverged`].
pub fn upper_quantile(degrees_of_freedom: u32, p: f64) -> Result<f64, StatsError> {
    noncentral_upper_quantile(degrees_of_freedom, 0.0, p)
}

/// P(X ≤ x), X non-central chi-square: the probability that a fault of non-centrality λ stays below
/// the threshold x.
///
/// # Errors
/// [`StatsError::DegreesOfFreedomOutOfRange`], [`StatsError::NoncentralityOutOfRange`],
/// [`StatsError::ArgumentOutOfRange`], [`StatsError::NotConverged`].
pub fn noncentral_lower_tail(
    degrees_of_freedom: u32,
    noncentrality: f64,
    x: f64,
) -> Result<f64, StatsError> {
    check_degrees(degrees_of_freedom)?;
    check_noncentrality(noncentrality)?;
    check_argument(x)?;
    Ok(lower_with_slopes(degrees_of_freedom, noncentrality, x)?.tail)
}

/// P(X > x), X non-central chi-square.
///
/// # Errors
/// As [`noncentral_lower_tail`].
pub fn noncentral_upper_tail(
    degrees_of_freedom: u32,
    noncentrality: f64,
    x: f64,
) -> Result<f64, StatsError> {
    check_degrees(degrees_of_freedom)?;
    check_noncentrality(noncentrality)?;
    check_argument(x)?;
    Ok(upper_with_slope(degrees_of_freedom, noncentrality, x)?.tail)
}

/// The x with P(X > x) = p, X non-central chi-square.
///
/// # Errors
/// [`StatsError::DegreesOfFreedomOutOfRange`], [`StatsError::NoncentralityOutOfRange`],
/// [`StatsError::ProbabilityOutOfRange`], [`StatsError::NotConverged`].
pub fn noncentral_upper_quantile(
    degrees_of_freedom: u32,
    noncentrality: f64,
    p: f64,
) -> Result<f64, StatsError> {
    check_degrees(degrees_of_freedom)?;
    check_noncentrality(noncentrality)?;
    let p = check_probability(p)?;
    // [AS] 26.4.17 for the central variable, scaled to the first two moments of the non-central one
    // (Patnaik). Only a start: the search below does not depend on its quality.
    let z = normal::upper_quantile(p)?;
    let mean = f64::from(degrees_of_freedom) + noncentrality;
    let scale = (mean + noncentrality) / mean;
    let ninth = 2.0 * scale / (9.0 * mean);
    let root = 1.0 - ninth + z * libm::sqrt(ninth);
    let guess = mean * root * root * root;

    let lower_side = p > 0.5;
    let target = if lower_side { 1.0 - p } else { p };
    let tail = |x: f64| {
        if lower_side {
            lower_with_slopes(degrees_of_freedom, noncentrality, x)
        } else {
            upper_with_slope(degrees_of_freedom, noncentrality, x)
        }
    };
    let mut high = if guess > mean {
        2.0 * guess
    } else {
        2.0 * mean
    };
    for _ in 0..MAX_DOUBLINGS {
        let reached = tail(high)?.tail;
        if (reached < target) != lower_side {
            break;
        }
        high *= 2.0;
    }
    find_root(target, lower_side, guess, high, |x| {
        let at = tail(x)?;
        Ok((at.tail, at.slope_in_x))
    })
}

/// The non-centrality λ at which P(X ≤ `threshold`) = `p_missed`: the smallest squared fault, in
/// sigmas of the parity space, that the test misses no more often than that.
///
/// # Errors
/// [`StatsError::DegreesOfFreedomOutOfRange`], [`StatsError::ArgumentOutOfRange`],
/// [`StatsError::ProbabilityOutOfRange`]; [`StatsError::NoSolution`] when even without a fault the
/// statistic lies below the threshold less often than `p_missed`;
/// [`StatsError::NoncentralityOutOfRange`] when λ would exceed [`MAX_NONCENTRALITY`];
/// [`StatsError::NotConverged`].
pub fn noncentrality(
    degrees_of_freedom: u32,
    threshold: f64,
    p_missed: f64,
) -> Result<f64, StatsError> {
    check_degrees(degrees_of_freedom)?;
    check_argument(threshold)?;
    check_probability(p_missed)?;
    let without_fault = lower_tail(degrees_of_freedom, threshold)?;
    if without_fault < p_missed {
        return Err(StatsError::NoSolution {
            probability: p_missed,
        });
    }
    if without_fault == p_missed {
        return Ok(0.0);
    }
    // One degree of freedom: √λ = √T + Q⁻¹(p_missed) but for the far side of the interval. More
    // degrees need a smaller √λ, less than √k away.
    let z = normal::upper_quantile(p_missed)?;
    let root = libm::sqrt(threshold) + z;
    let guess = root * root;
    let mut high = if guess > 1.0 { guess } else { 1.0 };
    for _ in 0..MAX_DOUBLINGS {
        check_noncentrality(high)?;
        if lower_with_slopes(degrees_of_freedom, high, threshold)?.tail < p_missed {
            break;
        }
        high *= 1.5;
    }
    find_root(p_missed, false, guess, high, |noncentrality| {
        let at = lower_with_slopes(degrees_of_freedom, noncentrality, threshold)?;
        Ok((at.tail, at.slope_in_noncentrality))
    })
}

/// A tail and its derivatives.
struct Tail {
    tail: f64,
    slope_in_x: f64,
    slope_in_noncentrality: f64,
}

/// [AS] 26.4 summed from a term beyond the last that counts down to the first: in that direction
/// [DLMF] 8.8 only adds, and neither the weights nor the central tails underflow on the way.
fn lower_with_slopes(
    degrees_of_freedom: u32,
    noncentrality: f64,
    x: f64,
) -> Result<Tail, StatsError> {
    let half_lambda = 0.5 * noncentrality;
    let half_x = 0.5 * x;
    if half_x == 0.0 {
        return Ok(Tail {
            tail: 0.0,
            slope_in_x: 0.0,
            slope_in_noncentrality: 0.0,
        });
    }
    // Largest term: at λ/2 where the central tails are about 1 (x above λ), at √(λx)/2 where they fall.
    let smaller = if half_lambda < half_x {
        half_lambda
    } else {
        half_x
    };
    let order = 0.5 * f64::from(degrees_of_freedom);
    let mut last = past_last_term(libm::sqrt(half_lambda * smaller));
    // Near x = 0 a step that far out underflows, and so would every sum started from it; there the
    // terms fall so fast that fewer do (checked below). At most 14 halvings.
    while last > 0 && gamma::recurrence_step(order + f64::from(last), half_x) < 1e-280 {
        last /= 2;
    }

    let mut weight = poisson(half_lambda, last);
    let mut central = gamma::lower(degrees_of_freedom + 2 * last, half_x)?;
    let mut step = gamma::recurrence_step(order + f64::from(last), half_x);
    let outermost = weight * central;
    let mut sums = Sums::EMPTY;
    for j in (0..=last).rev() {
        let j = f64::from(j);
        let step_below = step * (order + j) / half_x;
        sums.add(weight, central, step_below, step);
        if j > 0.0 {
            weight *= j / half_lambda;
            central += step_below;
            step = step_below;
        }
    }

    // What lies beyond `last` is at most a geometric series: wⱼ₊₁/wⱼ = (λ/2)/(j+1), and the central
    // tails fall at least by (x/2)/(k/2+j+1) ([DLMF] 8.7 term by term).
    let next = f64::from(last) + 1.0;
    let fall = half_x / (order + next);
    let ratio = half_lambda / next * if fall < 1.0 { fall } else { 1.0 };
    check_neglected(outermost * ratio, (1.0 - ratio) * sums.tail)?;
    Ok(Tail {
        tail: sums.tail,
        slope_in_x: 0.5 * sums.steps_below,
        slope_in_noncentrality: -0.5 * sums.steps,
    })
}

/// The same mixture of upper tails, summed upwards, where [DLMF] 8.8 only adds.
fn upper_with_slope(
    degrees_of_freedom: u32,
    noncentrality: f64,
    x: f64,
) -> Result<Tail, StatsError> {
    let half_lambda = 0.5 * noncentrality;
    let half_x = 0.5 * x;
    if half_x == 0.0 {
        return Ok(Tail {
            tail: 1.0,
            slope_in_x: 0.0,
            slope_in_noncentrality: 0.0,
        });
    }
    let larger = if half_lambda > half_x {
        half_lambda
    } else {
        half_x
    };
    let largest_term = libm::sqrt(half_lambda * larger);
    let first = before_first_term(largest_term);
    let last = past_last_term(largest_term);
    let order = 0.5 * f64::from(degrees_of_freedom);

    let mut weight = poisson(half_lambda, first);
    let mut central = gamma::upper(degrees_of_freedom + 2 * first, half_x)?;
    let mut step = gamma::recurrence_step(order + f64::from(first), half_x);
    let innermost = weight * central;
    let mut outermost = innermost;
    let mut sums = Sums::EMPTY;
    for j in first..=last {
        let j = f64::from(j);
        let step_below = step * (order + j) / half_x;
        sums.add(weight, central, step_below, step);
        outermost = weight * central;
        weight *= half_lambda / (j + 1.0);
        central += step;
        step *= half_x / (order + j + 1.0);
    }

    // Below `first` the terms fall, so that all of them weigh less than `first` times the innermost;
    // beyond `last` the weights alone are a geometric series, the central tails at most 1.
    check_neglected(f64::from(first) * innermost, sums.tail)?;
    let ratio = half_lambda / (f64::from(last) + 1.0);
    check_neglected(outermost * ratio, (1.0 - ratio) * sums.tail)?;
    Ok(Tail {
        tail: sums.tail,
        slope_in_x: -0.5 * sums.steps_below,
        slope_in_noncentrality: 0.5 * sums.steps,
    })
}

/// The running sums of a mixture.
struct Sums {
    /// Σ wⱼ · central tail of k + 2j degrees.
    tail: f64,
    /// Twice the density: Σ wⱼ · 2 · central density of k + 2j degrees.
    steps_below: f64,
    /// Twice the density of k + 2 degrees, which is twice the slope in λ.
    steps: f64,
}

impl Sums {
    const EMPTY: Self = Self {
        tail: 0.0,
        steps_below: 0.0,
        steps: 0.0,
    };

    fn add(&mut self, weight: f64, central: f64, step_below: f64, step: f64) {
        self.tail += weight * central;
        self.steps_below += weight * step_below;
        self.steps += weight * step;
    }
}

/// Poisson weight e^(−h) hʲ/j!.
fn poisson(half_lambda: f64, j: u32) -> f64 {
    if half_lambda > 0.0 {
        gamma::recurrence_step(f64::from(j), half_lambda)
    } else if j == 0 {
        1.0
    } else {
        0.0
    }
}

/// A term 12 standard deviations of a Poisson variable beyond the largest: e^(−72) of it.
fn past_last_term(largest: f64) -> u32 {
    if largest > 0.0 {
        (largest + 12.0 * libm::sqrt(largest + 1.0) + 30.0) as u32
    } else {
        0
    }
}

/// The same distance before the largest, or 0.
fn before_first_term(largest: f64) -> u32 {
    // `as` saturates negative numbers at 0.
    (largest - 12.0 * libm::sqrt(largest + 1.0) - 30.0) as u32
}

/// Refuses a sum that left out more than 1e-13 of itself. A sum that underflowed to zero passes.
fn check_neglected(neglected: f64, sum: f64) -> Result<(), StatsError> {
    if neglected <= 1e-13 * sum {
        Ok(())
    } else {
        Err(StatsError::NotConverged)
    }
}

/// The x in (0, `high`) at which a monotone positive function has the value `target`: Newton's
/// method on the logarithm, which is nearly linear in the tails, with bisection where Newton leaves
/// the bracket. `function` gives value and derivative.
fn find_root(
    target: f64,
    is_rising: bool,
    guess: f64,
    high: f64,
    function: impl Fn(f64) -> Result<(f64, f64), StatsError>,
) -> Result<f64, StatsError> {
    let mut low = 0.0;
    let mut high = high;
    let mut x = if guess > low && guess < high {
        guess
    } else {
        0.5 * high
    };
    for _ in 0..MAX_STEPS {
        let (value, slope) = function(x)?;
        if value == target {
            return Ok(x);
        }
        if (value < target) == is_rising {
            low = x;
        } else {
            high = x;
        }
        let newton = x - (libm::log(value) - libm::log(target)) * value / slope;
        let next = if newton > low && newton < high {
            newton
        } else {
            0.5 * (low + high)
        };
        let change = libm::fabs(next - x);
        x = next;
        if change <= 1e-13 * x {
            return Ok(x);
        }
    }
    Err(StatsError::NotConverged)
}

fn check_degrees(degrees_of_freedom: u32) -> Result<(), StatsError> {
    if (1..=MAX_DEGREES_OF_FREEDOM).contains(&degrees_of_freedom) {
        Ok(())
    } else {
        Err(StatsError::DegreesOfFreedomOutOfRange { degrees_of_freedom })
    }
}

fn check_noncentrality(noncentrality: f64) -> Result<(), StatsError> {
    if (0.0..=MAX_NONCENTRALITY).contains(&noncentrality) {
        Ok(())
    } else {
        Err(StatsError::NoncentralityOutOfRange { noncentrality })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_degrees_of_freedom_are_an_exponential() {
        for x in [1e-12, 0.1, 1.0, 2.0, 30.0, 600.0] {
            let exact = libm::exp(-0.5 * x);
            assert!((upper_tail(2, x).unwrap() / exact - 1.0).abs() < 1e-14);
            let exact = -libm::expm1(-0.5 * x);
            assert!((lower_tail(2, x).unwrap() / exact - 1.0).abs() < 1e-13);
        }
    }

    #[test]
    fn quantile_undoes_tail_for_any_mixture() {
        for k in [1, 2, 3, 10, 44, 1000] {
            for lambda in [0.0, 1e-3, 5.0, 90.0, 2500.0, 10_000.0] {
                for p in [1e-12, 3.33e-7, 0.01, 0.4, 0.5, 0.7, 0.999_999] {
                    let x = noncentral_upper_quantile(k, lambda, p).unwrap();
                    let reached = noncentral_upper_tail(k, lambda, x).unwrap();
                    assert!((reached / p - 1.0).abs() < 1e-9, "{k} {lambda} {p} {x}");
                    let below = noncentral_lower_tail(k, lambda, x).unwrap();
                    assert!((below / (1.0 - p) - 1.0).abs() < 1e-9, "{k} {lambda} {p}");
                }
            }
        }
    }

    #[test]
    fn noncentrality_gives_the_missed_detection_asked_for() {
        for k in 1..=44 {
            for p_fa in [1e-9, 3.3333e-7, 1e-3] {
                for p_md in [1e-12, 1e-7, 1e-3, 0.5] {
                    let threshold = upper_quantile(k, p_fa).unwrap();
                    let lambda = noncentrality(k, threshold, p_md).unwrap();
                    let missed = noncentral_lower_tail(k, lambda, threshold).unwrap();
                    assert!((missed / p_md - 1.0).abs() < 1e-9, "{k} {p_fa} {p_md}");
                }
            }
        }
    }

    #[test]
    fn illegal_arguments_are_refused_by_cause() {
        use StatsError::*;
        assert!(matches!(
            upper_tail(0, 1.0),
            Err(DegreesOfFreedomOutOfRange { .. })
        ));
        assert!(matches!(
            lower_tail(1, f64::NAN),
            Err(ArgumentOutOfRange { .. })
        ));
        assert!(matches!(
            lower_tail(1, -1.0),
            Err(ArgumentOutOfRange { .. })
        ));
        for p in [0.0, 1.0, f64::NAN, -1.0] {
            assert!(matches!(
                upper_quantile(3, p),
                Err(ProbabilityOutOfRange { .. })
            ));
            assert!(matches!(
                noncentrality(3, 20.0, p),
                Err(ProbabilityOutOfRange { .. })
            ));
        }
        for lambda in [-1.0, f64::NAN, 10_001.0] {
            assert!(matches!(
                noncentral_lower_tail(3, lambda, 1.0),
                Err(NoncentralityOutOfRange { .. })
            ));
        }
        assert!(matches!(noncentrality(3, 0.1, 0.5), Err(NoSolution { .. })));
        assert!(matches!(
            noncentrality(1, 1e6, 1e-3),
            Err(NoncentralityOutOfRange { .. })
        ));
    }
}
