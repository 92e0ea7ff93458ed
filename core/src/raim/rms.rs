//! RMS comparison: which residual stands out, by the spread of four neighbours in order of size.
//!
//! In: the residuals of a least-squares solution, all of one sigma. Out: the order of the residuals, the
//! group of four with the smallest root mean square, its mean as a threshold, and which residuals
//! exceed it. No matrix is needed, which is what [P1] proposes it for.
//!
//! | symbol | code | unit | meaning |
//! |--------|------|------|---------|
//! | w      | `residuals` | as given | least-squares residuals, measured minus predicted |
//! | RMS    | `rms` | same | of four neighbours in descending order, n − 3 groups |
//! |        | `threshold` | same | mean of the group with the smallest RMS |
//!
//! Source: [P1] section 3 (sorting, groups, threshold). Keys: docs/references.md.
//!
//! **Limits.** Provided because the source has it; never on the default path.
//! - As printed the threshold is the mean of a group that lies in the middle of the residuals, so that its own
//!   larger members exceed it: healthy rows are flagged in every epoch, faulted or not.
//! - Sorted with their signs ([`RmsVariant::Signed`], the letter of the text), a negative bias comes last
//!   and is not flagged at all.
//! - With redundancy 1 the residuals have the same proportions whichever row failed, so that nothing
//!   computed from them can name it: figure 5 of [P1] shows the one sky in which the guess is right.
//! - It has no false-alarm or missed-detection probability, and no level.
//!
//! What can be kept of it is [`RmsComparison::largest`] by absolute value, excluded alone, after the
//! parity test has seen a fault, and only if the rest passes that test again; that is what
//! `monitors/rms.rs` does in its corrected form. The normalised residual ([`super::exclusion`])
//! is right more often for the same price (`host-tests/tests/robust_golden.rs` counts both).

use super::exclusion::RowSet;
use crate::consts::MAX_SATELLITES;

/// Residuals of a group. [P1] section 3
pub const GROUP: usize = 4;

const MAX_GROUPS: usize = MAX_SATELLITES - GROUP + 1;

/// What is sorted, and about what the root mean square is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RmsVariant {
    /// The residuals with their signs, about zero: as printed.
    Signed,
    /// Their absolute values, about zero.
    Absolute,
    /// Their absolute values, about the mean of the group: the text calls RMS the closeness to the mean.
    AbsoluteAboutMean,
}

/// Why residuals cannot be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RmsError {
    /// Fewer than a group, or more than there is room for.
    RowsOutOfRange {
        /// Rows given.
        n: usize,
    },
    /// A residual is no number.
    NotFinite {
        /// Its row.
        row: usize,
    },
}

/// The comparison of one epoch.
#[derive(Clone, Debug, PartialEq)]
pub struct RmsComparison {
    n: usize,
    order: [usize; MAX_SATELLITES],
    rms: [f64; MAX_GROUPS],
    /// Place in the order where the group with the smallest RMS begins.
    pub group_start: usize,
    /// Mean of that group.
    pub threshold: f64,
    /// Rows above the threshold: more than the faulty one, see the head of the module.
    pub flagged: RowSet,
    /// The first row of the order.
    pub largest: usize,
}

impl RmsComparison {
    /// Rows in descending order of what the variant sorts.
    pub fn order(&self) -> &[usize] {
        self.order.get(..self.n).unwrap_or(&[])
    }

    /// Root mean square of each group, n − 3.
    pub fn rms(&self) -> &[f64] {
        let groups = (self.n + 1).saturating_sub(GROUP);
        self.rms.get(..groups).unwrap_or(&[])
    }
}

/// Compares the residuals of an epoch. [P1] section 3
///
/// # Errors
/// [`RmsError`].
#[inline(never)]
pub fn compare(residuals: &[f64], variant: RmsVariant) -> Result<RmsComparison, RmsError> {
    let n = residuals.len();
    if !(GROUP..=MAX_SATELLITES).contains(&n) {
        return Err(RmsError::RowsOutOfRange { n });
    }
    let mut sorted = [(0_usize, 0.0_f64); MAX_SATELLITES];
    for (row, residual) in residuals.iter().enumerate() {
        if !residual.is_finite() {
            return Err(RmsError::NotFinite { row });
        }
        let value = match variant {
            RmsVariant::Signed => *residual,
            RmsVariant::Absolute | RmsVariant::AbsoluteAboutMean => libm::fabs(*residual),
        };
        // Insertion, largest first; of equals the first stays first.
        let mut entry = (row, value);
        let mut displaced = false;
        for place in sorted.iter_mut().take(row) {
            if displaced || entry.1 > place.1 {
                core::mem::swap(place, &mut entry);
                displaced = true;
            }
        }
        if let Some(place) = sorted.get_mut(row) {
            *place = entry;
        }
    }
    let sorted = sorted.get(..n).unwrap_or(&[]);

    let mut comparison = RmsComparison {
        n,
        order: [0; MAX_SATELLITES],
        rms: [0.0; MAX_GROUPS],
        group_start: 0,
        threshold: 0.0,
        flagged: RowSet::EMPTY,
        largest: 0,
    };
    for (place, (row, _)) in comparison.order.iter_mut().zip(sorted) {
        *place = *row;
    }
    comparison.largest = comparison.order.first().copied().unwrap_or(0);
    let mut smallest = f64::INFINITY;
    for (start, (place, group)) in comparison
        .rms
        .iter_mut()
        .zip(sorted.windows(GROUP))
        .enumerate()
    {
        let values = || group.iter().map(|(_, value)| value);
        let mean = values().sum::<f64>() / GROUP as f64;
        let about = match variant {
            RmsVariant::Signed | RmsVariant::Absolute => 0.0,
            RmsVariant::AbsoluteAboutMean => mean,
        };
        let squares: f64 = values().map(|v| (v - about) * (v - about)).sum();
        *place = libm::sqrt(squares / GROUP as f64);
        if *place < smallest {
            smallest = *place;
            comparison.group_start = start;
            comparison.threshold = mean;
        }
    }
    for (row, value) in sorted {
        if *value > comparison.threshold {
            comparison.flagged = comparison.flagged.with(*row);
        }
    }
    Ok(comparison)
}

#[cfg(test)]
mod tests {
    use super::*;

    const RESIDUALS: [f64; 7] = [1.0, -2.0, -30.0, 2.5, 0.5, 1.5, 2.0];

    #[test]
    fn the_largest_in_size_comes_first_whatever_its_sign() {
        let absolute = compare(&RESIDUALS, RmsVariant::Absolute).unwrap();
        assert_eq!(absolute.order(), [2, 3, 1, 6, 5, 0, 4]);
        assert_eq!((absolute.largest, absolute.group_start), (2, 3));
        assert_eq!(absolute.rms().len(), 4);
        assert!((absolute.threshold - 1.25).abs() < 1e-15);
    }

    #[test]
    fn as_printed_a_negative_bias_is_not_flagged_and_healthy_rows_are() {
        let printed = compare(&RESIDUALS, RmsVariant::Signed).unwrap();
        assert!(!printed.flagged.contains(2));
        assert!(printed.flagged.len() > 1);
        let healthy = compare(&[0.1, 0.2, 0.3, 0.4, 0.5], RmsVariant::Signed).unwrap();
        assert!(!healthy.flagged.is_empty());
    }

    #[test]
    fn what_cannot_be_compared_is_refused() {
        for n in [0, 3, MAX_SATELLITES + 1] {
            let refused = compare(&[1.0; MAX_SATELLITES + 1][..n], RmsVariant::Absolute);
            assert_eq!(refused, Err(RmsError::RowsOutOfRange { n }));
        }
        let refused = compare(&[1.0, 2.0, f64::NAN, 3.0], RmsVariant::Absolute);
        assert_eq!(refused, Err(RmsError::NotFinite { row: 2 }));
        assert!(compare(&[1.0; MAX_SATELLITES], RmsVariant::AbsoluteAboutMean).is_ok());
    }
}
