//! Least squares of the pseudoranges of an epoch: position, and one clock per constellation.
//!
//! | symbol | code     | shape | meaning                                                    |
//! |--------|----------|-------|------------------------------------------------------------|
//! | a_i    | design   | D     | row over its sigma: clock, offsets, position (ECEF)        |
//! | N      | matrix   | D × D | Σ a_i a_iᵀ = L D Lᵀ                                        |
//!
//! Clocks come first, so that rank that is missing shows in the pivots of the position and a clock
//! without a satellite of its own leaves the others alone.

#![expect(
    clippy::indexing_slicing,
    reason = "indices are below the fixed sizes by the loops' bounds; the no-panic image is the judge"
)]

use crate::consts::MAX_CLOCKS;
use crate::ekf::MeasurementRow;
use crate::ekf::layout::{CLOCK_BIAS, FIRST_OFFSET, JOINT_NAVIGATION};

/// Unknowns: clocks first (one per constellation), then the position.
pub(super) const UNKNOWNS: usize = MAX_CLOCKS + 3;
/// Where the position begins.
pub(super) const POSITION: usize = MAX_CLOCKS;
/// A pivot below this part of its diagonal entry is rank that is missing.
const RANK_TOLERANCE: f64 = 1.0e-9;
/// A row with less redundancy than this cannot be left out.
pub(super) const MIN_LEFT: f64 = 1.0e-6;

/// The normal equations and their factors.
#[derive(Clone, Debug)]
pub(super) struct Normals {
    /// Lower triangle; after `factor` the unit lower factor below the diagonal.
    matrix: [[f64; UNKNOWNS]; UNKNOWNS],
    /// Inverse pivots, 0 where rank is missing.
    inverse: [f64; UNKNOWNS],
}

impl Normals {
    pub const ZERO: Self = Self {
        matrix: [[0.0; UNKNOWNS]; UNKNOWNS],
        inverse: [0.0; UNKNOWNS],
    };

    pub fn add(&mut self, design: &[f64; UNKNOWNS]) {
        for i in 0..UNKNOWNS {
            for j in 0..=i {
                self.matrix[i][j] += design[i] * design[j];
            }
        }
    }

    /// L D Lᵀ in place; false when the position is not determined. A clock without a satellite of its own
    /// has no pivot and stays where it is.
    pub fn factor(&mut self) -> bool {
        let mut is_whole = true;
        let diagonal: [f64; UNKNOWNS] = core::array::from_fn(|i| self.matrix[i][i]);
        for k in 0..UNKNOWNS {
            let column: [f64; UNKNOWNS] = core::array::from_fn(|i| self.matrix[i][k]);
            let is_there = column[k] > RANK_TOLERANCE * diagonal[k] && column[k].is_finite();
            let inverse = if is_there { 1.0 / column[k] } else { 0.0 };
            is_whole &= is_there || k < POSITION;
            self.inverse[k] = inverse;
            for i in k + 1..UNKNOWNS {
                let factor = column[i] * inverse;
                for j in k + 1..=i {
                    self.matrix[i][j] -= factor * column[j];
                }
                self.matrix[i][k] = factor;
            }
        }
        is_whole
    }

    /// Solves for a right-hand side.
    pub fn solve(&self, right: &[f64; UNKNOWNS]) -> [f64; UNKNOWNS] {
        let mut x = *right;
        for i in 0..UNKNOWNS {
            for j in 0..i {
                x[i] -= self.matrix[i][j] * x[j];
            }
        }
        for i in (0..UNKNOWNS).rev() {
            x[i] *= self.inverse[i];
            for j in i + 1..UNKNOWNS {
                x[i] -= self.matrix[j][i] * x[j];
            }
        }
        x
    }
}

/// The pseudorange of a satellite over its sigma; `None` where that is none.
pub(super) fn whitened<const M: usize>(row: &MeasurementRow<M>) -> Option<[f64; UNKNOWNS]> {
    let root = libm::sqrt(row.weight);
    if !(root > 0.0 && root.is_finite()) {
        return None;
    }
    let column = |at: usize| row.pseudorange.get(at).copied().unwrap_or(0.0) * root;
    Some([
        column(JOINT_NAVIGATION + CLOCK_BIAS),
        column(JOINT_NAVIGATION + FIRST_OFFSET),
        column(JOINT_NAVIGATION + FIRST_OFFSET + 1),
        column(0),
        column(1),
        column(2),
    ])
}

const _: () = assert!(MAX_CLOCKS == 3);

pub(super) fn dot(a: &[f64; UNKNOWNS], b: &[f64; UNKNOWNS]) -> f64 {
    let mut sum = 0.0;
    for i in 0..UNKNOWNS {
        sum += a[i] * b[i];
    }
    sum
}
