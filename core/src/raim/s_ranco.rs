//! Suggestion range consensus (S-RANCO) [P4] 2.2 figure 4 [SCHROTH-2008]: how often each row contradicts the subsets.
//!
//! In: an epoch in a [`ConsensusWorkspace`], and k. Out: its [`super::consensus::suspicion::Suspicions`].
//!
//! | symbol | code | unit | meaning |
//! |--------|------|------|---------|
//! | k | `factor` | 1 | sigmas of the prediction beyond which a row is an outlier |
//!
//! Every subset that determines position and clocks is solved and predicts the rows it does not use. A subset with a
//! faulty member suspects healthy rows; over all subsets a faulty row is suspected more often than a healthy one.
//! From which share on: [`super::consensus::suspicion`]. Keys: docs/references.md.

use super::consensus::subsets::Subsets;
use super::consensus::{ConsensusWorkspace, Minimal};

/// Counts the suspicions of the epoch.
pub fn count(workspace: &mut ConsensusWorkspace, factor: f64) {
    let n = workspace.rows().len();
    workspace.suspicions.clear(n);
    match workspace.clocks() {
        1 => each_subset::<1>(workspace, factor),
        2 => each_subset::<2>(workspace, factor),
        3 => each_subset::<3>(workspace, factor),
        _ => {}
    }
}

#[inline(never)]
fn each_subset<const CLOCKS: usize>(workspace: &mut ConsensusWorkspace, factor: f64) {
    let mut minimal = Minimal::<CLOCKS>::EMPTY;
    let mut subsets = Subsets::new(workspace.rows().len(), workspace.members());
    while let Some(members) = subsets.next() {
        if workspace.is_left_out(members) {
            continue;
        }
        if minimal.solve(workspace.rows(), members) {
            workspace.suspect(members, &minimal, factor * factor);
        } else {
            workspace.suspicions.dropped += 1;
        }
    }
}
