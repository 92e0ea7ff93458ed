//! Tails and quantiles of the normal and the chi-square distribution, central and non-central.
//!
//! Every probability is a tail computed as a sum of positive terms, never as one minus a number
//! near one, so that it keeps its relative accuracy where integrity risks live (1e-7 and below).

pub mod chi2;
pub mod gamma;
pub mod normal;

/// Why a probability or a quantile could not be computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StatsError {
    /// A probability outside the open interval (0, 1), or below 1e-300, or NaN.
    ProbabilityOutOfRange {
        /// The number given.
        probability: f64,
    },
    /// Degrees of freedom outside 1 to [`chi2::MAX_DEGREES_OF_FREEDOM`].
    DegreesOfFreedomOutOfRange {
        /// The number given.
        degrees_of_freedom: u32,
    },
    /// A non-centrality that is negative, above [`chi2::MAX_NONCENTRALITY`], or NaN.
    NoncentralityOutOfRange {
        /// The number given.
        noncentrality: f64,
    },
    /// An argument that is NaN, infinite, or negative where the variable cannot be.
    ArgumentOutOfRange {
        /// The number given.
        argument: f64,
    },
    /// No argument has this probability: the tail is already smaller without any non-centrality.
    NoSolution {
        /// The probability asked for.
        probability: f64,
    },
    /// The iteration did not settle within its bound.
    NotConverged,
}

/// Smallest probability a quantile is computed for; below it densities lose digits to underflow.
pub const MIN_PROBABILITY: f64 = 1e-300;

/// Refuses what is no probability strictly between nothing and certainty; NaN refuses.
fn check_probability(probability: f64) -> Result<f64, StatsError> {
    if (MIN_PROBABILITY..1.0).contains(&probability) {
        Ok(probability)
    } else {
        Err(StatsError::ProbabilityOutOfRange { probability })
    }
}

/// Refuses what no chi-square variable can be; NaN refuses.
fn check_argument(argument: f64) -> Result<f64, StatsError> {
    if argument >= 0.0 && argument.is_finite() {
        Ok(argument)
    } else {
        Err(StatsError::ArgumentOutOfRange { argument })
    }
}
