//! Thresholds and detectable fault sizes per redundancy, computed once when a monitor is configured.
//!
//! In: false-alarm and missed-detection probability of one test. Out, per redundancy k: the threshold
//! T with P(chi-square of k > T) = P_FA, and √λ with P(non-central chi-square of k, λ ≤ T) = P_MD, the
//! length in sigmas of the smallest parity bias that is missed no more often than P_MD.
//!
//! Equations: T [P1] (9) (ERRATA: P_FA is the probability without a fault), λ [BROWN-1992].
//! Keys: docs/references.md. Cost: about 1.5 million instructions on a Cortex-M7 for the whole table.

use crate::consts::MAX_SATELLITES;
use crate::linalg::qr::MIN_UNKNOWNS;
use crate::stats::{StatsError, chi2};

/// Largest redundancy of an epoch.
pub const MAX_REDUNDANCY: usize = MAX_SATELLITES - MIN_UNKNOWNS;

#[derive(Clone, Copy, Debug)]
struct Entry {
    threshold: f64,
    sqrt_noncentrality: f64,
}

/// Threshold and √λ per redundancy from 1 to [`MAX_REDUNDANCY`].
#[derive(Clone, Debug)]
pub struct RaimTable {
    count: usize,
    entries: [Entry; MAX_REDUNDANCY],
}

impl RaimTable {
    /// No entries: every look-up answers `None`.
    pub const EMPTY: Self = Self {
        count: 0,
        entries: [Entry {
            threshold: 0.0,
            sqrt_noncentrality: 0.0,
        }; MAX_REDUNDANCY],
    };

    /// Computes every entry; after an error the table is empty.
    ///
    /// # Errors
    /// [`StatsError::ProbabilityOutOfRange`] for a probability outside (0, 1);
    /// [`StatsError::NoSolution`] when `p_missed_detection` exceeds what the test passes without a
    /// fault; [`StatsError::NotConverged`].
    #[inline(never)]
    pub fn fill(&mut self, p_false_alarm: f64, p_missed_detection: f64) -> Result<(), StatsError> {
        self.count = 0;
        for (degrees_of_freedom, entry) in (1_u32..).zip(&mut self.entries) {
            let threshold = chi2::upper_quantile(degrees_of_freedom, p_false_alarm)?;
            let noncentrality =
                chi2::noncentrality(degrees_of_freedom, threshold, p_missed_detection)?;
            *entry = Entry {
                threshold,
                sqrt_noncentrality: libm::sqrt(noncentrality),
            };
        }
        self.count = MAX_REDUNDANCY;
        Ok(())
    }

    fn entry(&self, redundancy: usize) -> Option<&Entry> {
        self.entries
            .get(..self.count)
            .and_then(|entries| entries.get(redundancy.checked_sub(1)?))
    }

    /// T of this redundancy; `None` for 0, above the capacity, or before [`RaimTable::fill`].
    pub fn threshold(&self, redundancy: usize) -> Option<f64> {
        self.entry(redundancy).map(|entry| entry.threshold)
    }

    /// √λ of this redundancy; `None` as for [`RaimTable::threshold`].
    pub fn sqrt_noncentrality(&self, redundancy: usize) -> Option<f64> {
        self.entry(redundancy).map(|entry| entry.sqrt_noncentrality)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unfilled_table_and_an_unknown_redundancy_have_no_threshold() {
        let mut table = RaimTable::EMPTY;
        assert_eq!(table.threshold(1), None);
        table.fill(3.3333e-7, 1e-3).unwrap();
        assert!(table.threshold(1).is_some());
        assert_eq!(table.threshold(0), None);
        assert!(table.sqrt_noncentrality(MAX_REDUNDANCY).is_some());
        assert_eq!(table.sqrt_noncentrality(MAX_REDUNDANCY + 1), None);
        assert!(table.fill(0.0, 1e-3).is_err());
        assert_eq!(table.threshold(1), None);
    }
}
