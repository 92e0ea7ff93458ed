//! Range consensus (RANCO) [P4] 2.2 [SCHROTH-2008]: the subset that most other rows agree with names those that do not.
//!
//! In: an epoch in a [`ConsensusWorkspace`], and k. Out: [`RangeConsensus`].
//!
//! | symbol | code | unit | meaning |
//! |--------|------|------|---------|
//! | k | `factor` | 1 | sigmas of the prediction beyond which a row is an outlier |
//!
//! Every subset predicts the rows it does not use. The one with the most inliers is believed; of several the one
//! with the most outliers (it could tell of more rows), then the smallest sum of squared errors over their
//! variances. Keys: docs/references.md.
//!
//! **False alarms.** Take the subset that can tell of the most rows: which one that is depends on the geometry alone.
//! While it has no outlier, no subset has more inliers, and one with as many has no outlier either. So a healthy
//! epoch gets an outlier at most as often as one fixed subset does: (n − s) p_k, whatever hangs together.

use super::consensus::subsets::Subsets;
use super::consensus::{ConsensusWorkspace, Minimal, set_of};
use super::exclusion::RowSet;

/// The subset that is believed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeConsensus {
    /// Its members.
    pub members: RowSet,
    /// Rows beside the members that agree with it.
    pub inliers: usize,
    /// Rows that contradict it.
    pub outliers: RowSet,
    /// Over the inliers, squared errors over their variances.
    sum_of_squares: f64,
}

impl RangeConsensus {
    fn is_better_than(&self, other: &Self) -> bool {
        let (agree, contradict) = (self.inliers, self.outliers.len());
        let (other_agree, other_contradict) = (other.inliers, other.outliers.len());
        agree > other_agree
            || (agree == other_agree
                && (contradict > other_contradict
                    || (contradict == other_contradict
                        && self.sum_of_squares < other.sum_of_squares)))
    }
}

/// The consensus of the epoch; `None` where no subset predicts anything.
pub fn consensus(workspace: &ConsensusWorkspace, factor: f64) -> Option<RangeConsensus> {
    match workspace.clocks() {
        1 => search::<1>(workspace, factor),
        2 => search::<2>(workspace, factor),
        3 => search::<3>(workspace, factor),
        _ => None,
    }
}

#[inline(never)]
fn search<const CLOCKS: usize>(
    workspace: &ConsensusWorkspace,
    factor: f64,
) -> Option<RangeConsensus> {
    let rows = workspace.rows();
    let mut subsets = Subsets::new(rows.len(), workspace.members());
    let mut best: Option<RangeConsensus> = None;
    let mut minimal = Minimal::<CLOCKS>::EMPTY;
    while let Some(members) = subsets.next() {
        if !minimal.solve(rows, members) {
            continue;
        }
        let mut candidate = RangeConsensus {
            members: RowSet::EMPTY,
            inliers: 0,
            outliers: RowSet::EMPTY,
            sum_of_squares: 0.0,
        };
        minimal.each_other(rows, members, |row, prediction| {
            if prediction.is_outlier(factor * factor) {
                candidate.outliers = candidate.outliers.with(row);
            } else {
                candidate.inliers += 1;
                candidate.sum_of_squares += prediction.error_squared_m2 / prediction.variance_m2;
            }
        });
        if candidate.inliers + candidate.outliers.len() > 0
            && best.is_none_or(|best| candidate.is_better_than(&best))
        {
            candidate.members = set_of(members);
            best = Some(candidate);
        }
    }
    best
}
