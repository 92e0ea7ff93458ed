//! What sigmas are multiplied with in levels, thresholds and margins.
//!
//! In: the probability that an error exceeds its level, and of a false alarm. Out: k_v, K, K' of
//! [`super`], per number of rows.

use crate::consts::MAX_SATELLITES;
use crate::stats::{StatsError, normal};

/// Factors on the sigmas; computed once.
#[derive(Clone, Debug)]
pub(super) struct VplFactors {
    pub k_vertical: f64,
    pub k_horizontal: f64,
    /// By the number of rows, from 1.
    k_detection: [f64; MAX_SATELLITES],
    k_exclusion: [f64; MAX_SATELLITES],
}

impl VplFactors {
    /// Factors of no probability: nothing is ever tested with them.
    pub const EMPTY: Self = Self {
        k_vertical: 0.0,
        k_horizontal: 0.0,
        k_detection: [0.0; MAX_SATELLITES],
        k_exclusion: [0.0; MAX_SATELLITES],
    };

    /// Factors of the probability that an error exceeds its level, and of a false alarm or a false exclusion
    /// in an epoch.
    pub fn fill(&mut self, p_level: f64, p_false_alarm: f64) -> Result<(), StatsError> {
        for probability in [p_level, p_false_alarm] {
            let is_probability = probability > 0.0 && probability < 1.0;
            if !is_probability {
                return Err(StatsError::ProbabilityOutOfRange { probability });
            }
        }
        self.k_vertical = normal::upper_quantile(0.5 * p_level)?;
        // Of two independent axes of the larger spread.
        self.k_horizontal = libm::sqrt(-2.0 * libm::log(p_level));
        let places = self.k_detection.iter_mut().zip(&mut self.k_exclusion);
        for (rows, (k_detection, k_exclusion)) in (1_u32..).zip(places) {
            let tail = 0.25 * p_false_alarm / f64::from(rows);
            *k_detection = normal::upper_quantile(tail)?;
            *k_exclusion = normal::upper_quantile(tail / f64::from(rows))?;
        }
        Ok(())
    }

    /// K of so many rows.
    pub fn detection(&self, rows: usize) -> f64 {
        of_rows(&self.k_detection, rows)
    }

    /// K' of so many rows.
    pub fn exclusion(&self, rows: usize) -> f64 {
        of_rows(&self.k_exclusion, rows)
    }
}

/// An entry of a table by the number of rows; infinite, so that nothing is found, where there is none.
fn of_rows(table: &[f64; MAX_SATELLITES], rows: usize) -> f64 {
    let factor = rows.checked_sub(1).and_then(|index| table.get(index));
    factor.copied().unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled() -> VplFactors {
        let mut factors = VplFactors::EMPTY;
        factors.fill(1e-7, 1e-5).unwrap();
        factors
    }

    #[test]
    fn k_vertical_of_1e_7_is_that_of_the_source() {
        assert!((filled().k_vertical - 5.33).abs() < 0.005);
    }

    #[test]
    fn more_rows_need_larger_factors_and_pairs_more_than_rows() {
        let factors = filled();
        for rows in 2..=MAX_SATELLITES {
            assert!(factors.detection(rows) > factors.detection(rows - 1));
            assert!(factors.exclusion(rows) > factors.detection(rows));
        }
        assert_eq!(factors.detection(0), f64::INFINITY);
        assert_eq!(factors.exclusion(MAX_SATELLITES + 1), f64::INFINITY);
    }

    #[test]
    fn what_is_no_probability_gives_no_factors() {
        let mut factors = VplFactors::EMPTY;
        for p in [0.0, 1.0, -1.0, 2.0, f64::NAN] {
            assert!(factors.fill(p, 1e-5).is_err());
            assert!(factors.fill(1e-7, p).is_err());
        }
    }
}
