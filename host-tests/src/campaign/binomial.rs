//! How sure a count of events is.
//!
//! | symbol | code | meaning |
//! |---|---|---|
//! | k, n | `events`, `of` | so many of so many independent trials |
//! | I_x(a, b) | `incomplete_beta` | regularised incomplete beta function |
//!
//! The interval is that of Clopper and Pearson: its ends are the probabilities at which k or more, or k or
//! fewer, events have half of what the confidence leaves; P(X ≥ k) = I_p(k, n − k + 1). [AS] 26.5.24.
//! It never has less than its confidence. Epochs of one run are no independent trials: [`Clustered`]
//! takes the spread from whole runs.

use surefix_core::stats::normal;

/// Terms of the continued fraction; it settles in O(√max(a, b)) of them.
const MAX_TERMS: usize = 10_000;

/// I_x(a, b) by the continued fraction [AS] 26.5.8, evaluated from the front (Lentz).
fn incomplete_beta(a: f64, b: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    if x >= 1.0 {
        return 1.0;
    }
    // The fraction converges fast below the mean only.
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - incomplete_beta(b, a, 1.0 - x);
    }
    let log_front = libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b)
        + a * libm::log(x)
        + b * libm::log1p(-x);
    let not_zero = |value: f64| if value.abs() < 1e-300 { 1e-300 } else { value };
    let (mut c, mut d) = (1.0, 1.0 / not_zero(1.0 - (a + b) * x / (a + 1.0)));
    let mut fraction = d;
    for term in 1..MAX_TERMS {
        let m = term as f64;
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        let mut factor = 1.0;
        for coefficient in [even, odd] {
            d = 1.0 / not_zero(1.0 + coefficient * d);
            c = not_zero(1.0 + coefficient / c);
            factor = c * d;
            fraction *= factor;
        }
        if (factor - 1.0).abs() < 1e-14 {
            break;
        }
    }
    libm::exp(log_front) * fraction / a
}

/// Where a falling or rising probability meets `wanted`, by halving.
fn solve(wanted: f64, of: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    let rises = of(1.0) > of(0.0);
    // Relative accuracy for small probabilities too.
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if (of(middle) < wanted) == rises {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// The interval of Clopper and Pearson for a probability of which `events` of `of` trials were seen.
pub fn clopper_pearson(events: u64, of: u64, confidence: f64) -> [f64; 2] {
    let tail = 0.5 * (1.0 - confidence);
    let (k, n) = (events as f64, of as f64);
    if of == 0 {
        return [0.0, 1.0];
    }
    let low = if events == 0 {
        0.0
    } else {
        solve(tail, |p| incomplete_beta(k, n - k + 1.0, p))
    };
    let high = if events == of {
        1.0
    } else {
        solve(1.0 - tail, |p| incomplete_beta(k + 1.0, n - k, p))
    };
    [low, high]
}

/// Events among epochs of several runs, where what happens in a run hangs together.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Clustered {
    /// Runs.
    pub runs: u64,
    /// Epochs of all runs.
    pub epochs: u64,
    /// Events in all runs.
    pub events: u64,
    /// Runs with an event.
    pub runs_with_events: u64,
    /// Events per epoch.
    pub rate: f64,
    /// Standard error of the rate.
    pub standard_error: f64,
}

impl Clustered {
    /// Of the events and epochs of each run: r = Σk/Σn, and the error of a ratio of means,
    /// √(R/(R − 1) Σ (k − r n)²)/Σn.
    pub fn new(runs: impl Iterator<Item = (u64, u64)> + Clone) -> Self {
        let mut sum = Self::default();
        for (events, epochs) in runs.clone() {
            sum.runs += 1;
            sum.epochs += epochs;
            sum.events += events;
            sum.runs_with_events += u64::from(events > 0);
        }
        let (n, of) = (sum.epochs.max(1) as f64, sum.runs as f64);
        sum.rate = sum.events as f64 / n;
        let squares: f64 = runs
            .map(|(events, epochs)| {
                let residual = events as f64 - sum.rate * epochs as f64;
                residual * residual
            })
            .sum();
        sum.standard_error = if sum.runs < 2 {
            f64::INFINITY
        } else {
            libm::sqrt(squares * of / (of - 1.0)) / n
        };
        sum
    }

    /// What the rate is larger than with this confidence; 0 where nothing was seen.
    pub fn lower_bound(&self, confidence: f64) -> f64 {
        let z = normal::upper_quantile(1.0 - confidence).unwrap_or(f64::NAN);
        (self.rate - z * self.standard_error).max(0.0)
    }
}

/// A probability with its interval, in percent: `12.5 (9.1 to 16.6)`.
pub fn percent(events: u64, of: u64, confidence: f64) -> String {
    let [low, high] = clopper_pearson(events, of, confidence);
    format!(
        "{:.3} ({:.3} to {:.3})",
        100.0 * events as f64 / of.max(1) as f64,
        100.0 * low,
        100.0 * high
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// P(X ≥ k) summed term by term.
    fn upper_tail(k: u64, n: u64, p: f64) -> f64 {
        (k..=n)
            .map(|j| {
                let (j, n) = (j as f64, n as f64);
                let ways =
                    libm::lgamma(n + 1.0) - libm::lgamma(j + 1.0) - libm::lgamma(n - j + 1.0);
                libm::exp(ways + j * libm::log(p) + (n - j) * libm::log1p(-p))
            })
            .sum()
    }

    #[test]
    fn ends_leave_half_of_the_doubt_on_each_side() {
        for (k, n) in [(1, 10), (3, 8), (7, 8), (40, 200), (2, 8000)] {
            let [low, high] = clopper_pearson(k, n, 0.99);
            assert!((upper_tail(k, n, low) - 0.005).abs() < 1e-9, "{k} of {n}");
            assert!((1.0 - upper_tail(k + 1, n, high) - 0.005).abs() < 1e-9);
        }
    }

    #[test]
    fn nothing_seen_bounds_a_probability_from_above() {
        let [low, high] = clopper_pearson(0, 8000, 0.95);
        assert_eq!(low, 0.0);
        // 1 − 0.025^(1/n).
        assert!((high - (1.0 - 0.025_f64.powf(1.0 / 8000.0))).abs() < 1e-12);
        assert_eq!(clopper_pearson(5, 5, 0.95)[1], 1.0);
        assert_eq!(clopper_pearson(0, 0, 0.95), [0.0, 1.0]);
    }

    #[test]
    fn the_spread_is_that_of_runs() {
        // Ten runs of 100 epochs; two of them full of events.
        let runs = (0..10).map(|run| (if run < 2 { 100 } else { 0 }, 100));
        let sum = Clustered::new(runs);
        assert_eq!((sum.runs, sum.epochs, sum.events), (10, 1000, 200));
        assert_eq!(sum.runs_with_events, 2);
        // √(p (1 − p)/(R − 1)): the epochs count for nothing.
        let expected = (0.2 * 0.8 / 9.0_f64).sqrt();
        assert!((sum.standard_error - expected).abs() < 1e-12);
        assert!(sum.lower_bound(0.99) < 0.01);
        assert_eq!(
            Clustered::new((0..10).map(|_| (0, 9))).lower_bound(0.99),
            0.0
        );
    }
}
