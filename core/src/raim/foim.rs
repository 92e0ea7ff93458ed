//! Fast optimal subset selection integrity monitoring (FOIM) [P4] 2.2 figure 5: S-RANCO without subsets of poor geometry.
//!
//! In: an epoch in a [`ConsensusWorkspace`], k, and the largest GDOP. Out: its
//! [`super::consensus::suspicion::Suspicions`].
//!
//! | symbol | code | unit | meaning |
//! |--------|------|------|---------|
//! | k | `factor` | 1 | sigmas of the prediction beyond which a row is an outlier |
//! | Thr_GDOP | `gdop_limit` | 1 | largest dilution of a subset that predicts |
//! | E_ij | `pairs` | 1 | e_i·e_j + 1 of every pair of rows, formed once |
//!
//! Equations: [P4] (7), GDOP in closed form (8) to (12), [`super::gdop4`]: a subset above the limit is dropped before
//! it is solved. A row that is then a member of no subset comes back with the one of the smallest GDOP that
//! it is a member of (the paper's "green channel"). Keys: docs/references.md.
//!
//! Departures: the closed form is one of four satellites and one clock. With more clocks a subset is solved first
//! and the limit is held against its position dilution, which saves the predictions alone.

use super::consensus::subsets::Subsets;
use super::consensus::{ConsensusWorkspace, Minimal};
use super::gdop4;
use crate::consts::MAX_SATELLITES;

/// Thr_GDOP, unless told otherwise. Under random skies it keeps 70 % of the subsets, as [P4] (16) reckons; what it
/// changes of the verdicts: docs/decisions/022-consensus.md.
pub const GDOP_LIMIT: f64 = 15.0;

/// Counts the suspicions of the epoch.
pub fn count(workspace: &mut ConsensusWorkspace, factor: f64, gdop_limit: f64) {
    let n = workspace.rows().len();
    workspace.suspicions.clear(n);
    match workspace.clocks() {
        1 => {
            workspace.multiply_pairs();
            each_subset::<1>(workspace, factor, gdop_limit);
        }
        2 => each_subset::<2>(workspace, factor, gdop_limit),
        3 => each_subset::<3>(workspace, factor, gdop_limit),
        _ => {}
    }
}

/// GDOP² of four members by the closed form; `None` for what has none.
#[inline(always)]
fn gdop_squared(workspace: &ConsensusWorkspace, members: &[usize]) -> Option<f64> {
    let &[first, second, third, fourth] = members else {
        return None;
    };
    let of_first = workspace.pairs.get(first)?;
    let of_second = workspace.pairs.get(second)?;
    gdop4::gdop_squared(&[
        *of_first.get(second)?,
        *of_first.get(third)?,
        *of_first.get(fourth)?,
        *of_second.get(third)?,
        *of_second.get(fourth)?,
        *workspace.pairs.get(third)?.get(fourth)?,
    ])
    .ok()
}

/// The dilution of a subset, which with more than one clock is solved then; `None` for what has none.
#[inline(always)]
fn dilution_squared<const CLOCKS: usize>(
    workspace: &ConsensusWorkspace,
    members: &[usize],
    minimal: &mut Minimal<CLOCKS>,
) -> Option<f64> {
    if CLOCKS == 1 {
        gdop_squared(workspace, members)
    } else if minimal.solve(workspace.rows(), members) {
        Some(minimal.position_dilution_squared())
    } else {
        None
    }
}

/// Solves a subset within the limit; false for one that is not.
#[inline(always)]
fn admit<const CLOCKS: usize>(
    workspace: &ConsensusWorkspace,
    members: &[usize],
    limit_squared: f64,
    minimal: &mut Minimal<CLOCKS>,
) -> bool {
    let dilution_squared = dilution_squared(workspace, members, minimal);
    dilution_squared.is_some_and(|squared| squared <= limit_squared)
        && (CLOCKS > 1 || minimal.solve(workspace.rows(), members))
}

#[inline(never)]
fn each_subset<const CLOCKS: usize>(
    workspace: &mut ConsensusWorkspace,
    factor: f64,
    gdop_limit: f64,
) {
    let limit_squared = gdop_limit * gdop_limit;
    let mut is_member = [false; MAX_SATELLITES];
    let mut minimal = Minimal::<CLOCKS>::EMPTY;
    let mut subsets = Subsets::new(workspace.rows().len(), workspace.members());
    while let Some(members) = subsets.next() {
        if workspace.is_left_out(members) {
            continue;
        }
        if !admit(workspace, members, limit_squared, &mut minimal) {
            workspace.suspicions.dropped += 1;
            continue;
        }
        mark(&mut is_member, members);
        workspace.suspect(members, &minimal, factor * factor);
    }
    for row in 0..workspace.rows().len() {
        if is_member.get(row) == Some(&false) && !workspace.is_left_out(&[row]) {
            admit_best::<CLOCKS>(workspace, row, factor, &mut is_member);
        }
    }
}

#[inline(always)]
fn mark(is_member: &mut [bool; MAX_SATELLITES], members: &[usize]) {
    for member in members {
        if let Some(is_member) = is_member.get_mut(*member) {
            *is_member = true;
        }
    }
}

/// The subset of the smallest dilution that the row is a member of predicts after all. All its members then have a
/// subset, so that it is not admitted again for another of them.
#[inline(never)]
fn admit_best<const CLOCKS: usize>(
    workspace: &mut ConsensusWorkspace,
    row: usize,
    factor: f64,
    is_member: &mut [bool; MAX_SATELLITES],
) {
    let mut best_squared = f64::INFINITY;
    let mut best = [0; super::consensus::MAX_MEMBERS];
    let mut minimal = Minimal::<CLOCKS>::EMPTY;
    let size = workspace.members();
    let mut subsets = Subsets::new(workspace.rows().len(), size);
    while let Some(members) = subsets.next() {
        if !members.contains(&row) || workspace.is_left_out(members) {
            continue;
        }
        let dilution_squared = dilution_squared(workspace, members, &mut minimal);
        if let Some(squared) = dilution_squared
            && squared < best_squared
        {
            best_squared = squared;
            for (place, member) in best.iter_mut().zip(members) {
                *place = *member;
            }
        }
    }
    if best_squared < f64::INFINITY
        && let Some(members) = best.get(..size)
        && minimal.solve(workspace.rows(), members)
    {
        mark(is_member, members);
        workspace.suspicions.dropped -= 1;
        workspace.suspect(members, &minimal, factor * factor);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::LinearModel;

    /// Three on the horizon, one overhead, one between.
    const SKY: [[f64; 3]; 5] = [
        [1.0, 0.0, 0.0],
        [-0.5, 0.866_025_403_784_438_6, 0.0],
        [-0.5, -0.866_025_403_784_438_6, 0.0],
        [0.0, 0.0, 1.0],
        [0.6, 0.0, 0.8],
    ];

    #[test]
    fn a_subset_that_is_the_best_of_several_rows_predicts_once() {
        let mut model = LinearModel::EMPTY;
        (model.n, model.m) = (SKY.len(), 4);
        for (row, [east, north, up]) in SKY.into_iter().enumerate() {
            model.design[row][..4].copy_from_slice(&[east, north, up, 1.0]);
            model.residual_m[row] = 0.0;
            model.sigma_m[row] = 1.0;
        }
        let mut workspace = ConsensusWorkspace::EMPTY;
        workspace.load(&model).unwrap();
        // No subset is within this limit: four rows come back with the first four, the last one with its own best.
        count(&mut workspace, 3.0, 0.1);
        let suspicions = workspace.suspicions();
        assert_eq!((suspicions.subsets, suspicions.dropped), (2, 3));
        assert_eq!(suspicions.predictions().iter().sum::<u32>(), 2);
        assert_eq!(suspicions.predictions()[4], 1);
    }
}
