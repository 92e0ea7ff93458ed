//! How often each row is an outlier of a prediction, and from which share on it is suspected.
//!
//! In: predictions of the subsets. Out: counts per row; T_SV and k.
//!
//! | symbol | code | unit | meaning |
//! |--------|------|------|---------|
//! | f_i    | [`Suspicions::share`] | 1 | outliers among the predictions of row i |
//! | T_SV   | [`suspicion_threshold`] | 1 | share above which a row is suspected |
//! | s      | `members` | 1 | members of a subset |
//! | p_k    | | 1 | probability that a normal number exceeds k of its sigmas |
//! | k      | [`outlier_factor`] | 1 | sigmas of a prediction beyond which it is missed |
//!
//! Source: S-RANCO counts suspicions and compares them with T_SV [P4] 2.2, figures 4 and 10; the paper gives
//! no value. Derivation, docs/decisions/022-consensus.md:
//!
//! - *T_SV separates.* Beside one faulty row a healthy one is predicted wrongly by the subsets that hold the faulty
//!   one: of those without itself a share of s/(n − 1). The faulty row is predicted wrongly by all that can see
//!   its fault. T_SV is that share. Beside several faulty rows healthy ones exceed it, too, and come
//!   after them in order.
//! - *k keeps false alarms.* Each prediction error has its own sigma, so that the expected share of a healthy row in
//!   a healthy epoch is p_k however the subsets hang together. By Markov's inequality P(f_i > T_SV) ≤ p_k/T_SV,
//!   and the epoch's false-alarm probability is at most n p_k/T_SV: k = Q⁻¹(P_FA T_SV/(2n)).
//!
//! Keys: docs/references.md. Assumes normal errors, independent between rows, of the sigmas given.

use crate::consts::MAX_SATELLITES;
use crate::raim::exclusion::RowSet;
use crate::stats::{StatsError, normal};

/// The suspicions of an epoch.
#[derive(Clone, Debug)]
pub struct Suspicions {
    n: usize,
    outliers: [u32; MAX_SATELLITES],
    predictions: [u32; MAX_SATELLITES],
    /// Subsets that predicted.
    pub subsets: u32,
    /// Subsets that did not: they determine nothing, or their geometry was too poor.
    pub dropped: u32,
}

impl Suspicions {
    /// Of no epoch.
    pub const EMPTY: Self = Self {
        n: 0,
        outliers: [0; MAX_SATELLITES],
        predictions: [0; MAX_SATELLITES],
        subsets: 0,
        dropped: 0,
    };

    pub(crate) fn clear(&mut self, n: usize) {
        *self = Self { n, ..Self::EMPTY };
    }

    /// One prediction of a row.
    #[inline]
    pub(crate) fn book(&mut self, row: usize, is_outlier: bool) {
        if let (Some(predictions), Some(outliers)) =
            (self.predictions.get_mut(row), self.outliers.get_mut(row))
        {
            *predictions += 1;
            *outliers += u32::from(is_outlier);
        }
    }

    /// How often each row was an outlier.
    pub fn outliers(&self) -> &[u32] {
        self.outliers.get(..self.n).unwrap_or(&[])
    }

    /// How often each row was predicted well enough to tell.
    pub fn predictions(&self) -> &[u32] {
        self.predictions.get(..self.n).unwrap_or(&[])
    }

    /// Outliers among the predictions of a row; 0 for one that none predicts.
    pub fn share(&self, row: usize) -> f64 {
        match (self.outliers().get(row), self.predictions().get(row)) {
            (Some(outliers), Some(predictions)) if *predictions > 0 => {
                f64::from(*outliers) / f64::from(*predictions)
            }
            _ => 0.0,
        }
    }

    /// The largest share of a row.
    pub fn largest_share(&self) -> f64 {
        (0..self.n).fold(0.0, |largest, row| {
            let share = self.share(row);
            if share > largest { share } else { largest }
        })
    }

    /// Rows whose share exceeds a threshold.
    pub fn above(&self, threshold: f64) -> RowSet {
        // Shares that are equal as fractions are not told apart by rounding.
        let limit = threshold + 1e-9;
        let suspected = (0..self.n).filter(|row| self.share(*row) > limit);
        suspected.fold(RowSet::EMPTY, RowSet::with)
    }

    /// Of the rows above a threshold the one of the largest share that is not in a set; of equals the first.
    pub fn most_suspected(&self, threshold: f64, beside: RowSet) -> Option<usize> {
        let mut most: Option<(usize, f64)> = None;
        for row in self.above(threshold).iter() {
            let share = self.share(row);
            if !beside.contains(row) && most.is_none_or(|(_, largest)| share > largest) {
                most = Some((row, share));
            }
        }
        most.map(|(row, _)| row)
    }

    /// Whether any row was predicted.
    pub fn is_tested(&self) -> bool {
        self.predictions()
            .iter()
            .any(|predictions| *predictions > 0)
    }
}

/// T_SV: of the subsets of so many members without a given row, the share that holds a given other one. 1 where
/// all do.
pub fn suspicion_threshold(n: usize, members: usize) -> f64 {
    if n > members + 1 {
        members as f64 / (n - 1) as f64
    } else {
        1.0
    }
}

/// k: the sigmas of a prediction beyond which a row is its outlier, so that in a healthy epoch a share of
/// one of `rows` rows exceeds `share` with at most the given probability.
///
/// # Errors
/// [`StatsError::ProbabilityOutOfRange`].
pub fn outlier_factor(p_false_alarm: f64, rows: usize, share: f64) -> Result<f64, StatsError> {
    normal::upper_quantile(p_false_alarm * share / (2.0 * rows as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threshold_is_the_share_of_subsets_that_hold_a_given_row() {
        // C(n − 2, s − 1)/C(n − 1, s).
        assert!((suspicion_threshold(12, 4) - 120.0 / 330.0).abs() < 1e-15);
        assert!((suspicion_threshold(8, 5) - 15.0 / 21.0).abs() < 1e-15);
        for n in [0, 4, 5] {
            assert_eq!(suspicion_threshold(n, 4), 1.0);
        }
    }

    #[test]
    fn shares_at_the_threshold_are_not_above_it() {
        let mut suspicions = Suspicions::EMPTY;
        suspicions.clear(3);
        for prediction in 0..11 {
            suspicions.book(0, prediction < 4);
            suspicions.book(1, prediction < 5);
        }
        let threshold = suspicion_threshold(12, 4);
        let above = suspicions.above(threshold);
        assert_eq!(above, RowSet::EMPTY.with(1));
        assert_eq!(suspicions.most_suspected(threshold, RowSet::EMPTY), Some(1));
        assert_eq!(suspicions.most_suspected(0.0, above), Some(0));
        assert_eq!(suspicions.most_suspected(threshold, above), None);
        assert_eq!(suspicions.share(2), 0.0);
        assert!((suspicions.largest_share() - 5.0 / 11.0).abs() < 1e-15);
        assert!(suspicions.is_tested());
        assert!(suspicions.above(f64::NAN).is_empty());
    }

    #[test]
    fn factor_spends_the_false_alarms_on_every_row() {
        let k = outlier_factor(1e-6, 10, 0.4).unwrap();
        let p_k = 2.0 * normal::upper_tail(k).unwrap();
        assert!((10.0 * p_k / 0.4 / 1e-6 - 1.0).abs() < 1e-9);
        assert!(outlier_factor(f64::NAN, 10, 0.4).is_err());
        assert!(outlier_factor(1e-6, 0, 0.4).is_err());
    }
}
