//! Intervals for averages of chi-square numbers.

use surefix_core::stats::normal;

/// An interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Its ends.
    pub low: f64,
    /// Its ends.
    pub high: f64,
}

impl Interval {
    /// Whether a value lies in it; NaN does not.
    pub fn contains(&self, value: f64) -> bool {
        value >= self.low && value <= self.high
    }
}

/// Where the average of `samples` independent chi-square numbers, each of `degrees` degrees of freedom,
/// lies with probability `confidence`: both tails alike.
///
/// Quantiles by Wilson and Hilferty, [AS] 26.4.17: good to 4e-4 of themselves from 120 degrees
/// of freedom in all, which is what `samples * degrees` must reach.
pub fn chi_square_interval(degrees: f64, samples: f64, confidence: f64) -> Interval {
    let all = degrees * samples;
    let z = normal::upper_quantile((1.0 - confidence) / 2.0).unwrap_or(f64::NAN);
    let spread = 2.0 / (9.0 * all);
    let quantile = |z: f64| degrees * (1.0 - spread + z * spread.sqrt()).powi(3);
    Interval {
        low: quantile(-z),
        high: quantile(z),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_those_of_exact_quantiles() {
        let interval = chi_square_interval(2.0, 60.0, 0.99);
        // 120 degrees of freedom, 0.5 % and 99.5 %: [AS] table 26.8.
        let (low, high) = (83.8516 / 60.0, 163.6482 / 60.0);
        assert!((interval.high / high - 1.0).abs() < 4e-4);
        assert!((interval.low / low - 1.0).abs() < 4e-4);
        assert!(!interval.contains(f64::NAN));
    }
}
