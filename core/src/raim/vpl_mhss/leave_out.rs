//! Leaving out one satellite, and one more, by rank-one updates of the solution with all.
//!
//! In: leverage, S_ii and residual of each row, Q₁. Out: separations and spreads without a row, and the level of
//! each set that lacks one. Symbols: [`super`].
//!
//! Without row i the others have g_j' = g_j − S_ij g_i/d_i, r_j' = r_j − S_ij r_i/d_i,
//! d_j' = d_j − S_ij²/d_i: Sherman and Morrison [GOLUB-VANLOAN]. Leaving out j as well moves the position by
//! g_j' r_j'/d_j' and adds g_j'g_j'ᵀ/d_j' to its covariance. Equal to solving anew to 1e-9
//! (`host-tests/tests/vpl_mhss.rs`).

use crate::consts::MAX_UNKNOWNS;
use crate::raim::slope::{HARMLESS_LEVERAGE_M, MIN_RESIDUAL_COFACTOR};

/// What is known of a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    pub gain_enu_m: [f64; 3],
    pub cofactor: f64,
    residual: f64,
    /// The rest determines a position.
    pub is_testable: bool,
    /// g/d and r/d.
    pub gain_ratio_enu_m: [f64; 3],
    residual_ratio: f64,
    /// Variance of the height without it.
    pub variance_m2: f64,
    /// Level of the set without it, over the hypotheses seen so far.
    pub vpl_m: f64,
    /// Largest σ_ij² of these.
    pub largest_variance_m2: f64,
}

/// A hypothesis of a set: this one of its rows is left out.
#[derive(Clone, Copy, Debug)]
pub(super) struct LeftOut {
    pub gain_enu_m: [f64; 3],
    residual: f64,
    /// 1/d.
    pub inverse_cofactor: f64,
}

impl LeftOut {
    pub fn separation_enu_m(&self) -> [f64; 3] {
        let step = self.residual * self.inverse_cofactor;
        self.gain_enu_m.map(|gain| gain * step)
    }

    pub fn separation_sigma_m(&self) -> f64 {
        let [_, _, up] = self.gain_enu_m;
        libm::fabs(up) * libm::sqrt(self.inverse_cofactor)
    }
}

impl Row {
    pub const EMPTY: Self = Self {
        gain_enu_m: [0.0; 3],
        cofactor: 0.0,
        residual: 0.0,
        is_testable: false,
        gain_ratio_enu_m: [0.0; 3],
        residual_ratio: 0.0,
        variance_m2: 0.0,
        vpl_m: 0.0,
        largest_variance_m2: 0.0,
    };

    pub fn new(gain_enu_m: [f64; 3], cofactor: f64, residual: f64, variance_m2: f64) -> Self {
        // NaN is not testable.
        let is_testable = cofactor >= MIN_RESIDUAL_COFACTOR;
        let inverse = if is_testable { 1.0 / cofactor } else { 0.0 };
        let [_, _, up] = gain_enu_m;
        Self {
            gain_enu_m,
            cofactor,
            residual,
            is_testable,
            gain_ratio_enu_m: gain_enu_m.map(|gain| gain * inverse),
            residual_ratio: residual * inverse,
            variance_m2: variance_m2 + up * up * inverse,
            vpl_m: 0.0,
            largest_variance_m2: 0.0,
        }
    }

    /// Leverage and residual in the set that lacks `out`.
    pub fn given(&self, out: &Self, shared: f64) -> LeftOut {
        let mut gain_enu_m = self.gain_enu_m;
        for (gain, ratio) in gain_enu_m.iter_mut().zip(&out.gain_ratio_enu_m) {
            *gain -= shared * ratio;
        }
        let cofactor = self.cofactor - shared * shared / out.cofactor;
        LeftOut {
            gain_enu_m,
            residual: self.residual - shared * out.residual_ratio,
            inverse_cofactor: 1.0 / cofactor,
        }
    }

    pub fn alone(&self) -> LeftOut {
        LeftOut {
            gain_enu_m: self.gain_enu_m,
            residual: self.residual,
            inverse_cofactor: 1.0 / self.cofactor,
        }
    }

    /// Enters a hypothesis of the set without this row; NaN stays. Squares are compared first: most hypotheses
    /// set no level, and a root is dear.
    #[inline(always)]
    fn enter(&mut self, separation_m: f64, variance_m2: f64, k_vertical: f64) {
        if variance_m2 > self.largest_variance_m2 {
            self.largest_variance_m2 = variance_m2;
        }
        let room_m = self.vpl_m - separation_m;
        let is_smaller = room_m >= 0.0 && room_m * room_m >= k_vertical * k_vertical * variance_m2;
        if !is_smaller && !self.vpl_m.is_nan() {
            self.vpl_m = separation_m + k_vertical * libm::sqrt(variance_m2);
        }
    }
}

/// Whether the position without two rows is determined.
pub(super) fn are_testable(first: &Row, second: &Row, determinant: f64) -> bool {
    let least = |row: &Row| determinant >= MIN_RESIDUAL_COFACTOR * row.cofactor;
    first.is_testable && second.is_testable && least(first) && least(second)
}

/// Whether a fault of this leverage moves the position; NaN does.
pub(super) fn moves(gain_enu_m: &[f64; 3]) -> bool {
    let [east, north, up] = gain_enu_m;
    let is_harmless =
        east * east + north * north + up * up <= HARMLESS_LEVERAGE_M * HARMLESS_LEVERAGE_M;
    !is_harmless
}

/// Enters "first and second are left out" into the sets that lack one of them.
#[inline(always)]
fn pair(first: &mut Row, second: &mut Row, shared: f64, k_vertical: f64) {
    let determinant = first.cofactor * second.cofactor - shared * shared;
    if !are_testable(first, second, determinant) {
        // No level where a satellite that matters cannot be left out as well.
        if first.is_testable && moves(&second.given(first, shared).gain_enu_m) {
            first.vpl_m = f64::INFINITY;
        }
        if second.is_testable && moves(&first.given(second, shared).gain_enu_m) {
            second.vpl_m = f64::INFINITY;
        }
        return;
    }
    let inverse = 1.0 / determinant;
    let gain_of = |row: &Row, out: &Row| {
        let ([_, _, up], [_, _, ratio]) = (row.gain_enu_m, out.gain_ratio_enu_m);
        up - shared * ratio
    };
    let residual_of = |row: &Row, out: &Row| row.residual - shared * out.residual_ratio;
    let gain = gain_of(second, first);
    let weight = first.cofactor * inverse;
    // The same position whichever is left out first.
    let variance_m2 = first.variance_m2 + gain * gain * weight;
    let without_first_m = gain * residual_of(second, first) * weight;
    let without_second_m =
        gain_of(first, second) * residual_of(first, second) * (second.cofactor * inverse);
    first.enter(libm::fabs(without_first_m), variance_m2, k_vertical);
    second.enter(libm::fabs(without_second_m), variance_m2, k_vertical);
}

pub(super) fn all_pairs<const M: usize>(
    rows: &mut [Row],
    thin_q: &[[f64; MAX_UNKNOWNS]],
    k_vertical: f64,
) {
    let (mut rows, mut thin_q) = (rows, thin_q);
    while let (Some((first, others)), Some((q, other_q))) = (
        core::mem::take(&mut rows).split_first_mut(),
        thin_q.split_first(),
    ) {
        for (second, q_second) in others.iter_mut().zip(other_q) {
            pair(first, second, shared::<M>(q, q_second), k_vertical);
        }
        (rows, thin_q) = (others, other_q);
    }
}

/// S_ij of two rows of Q₁.
#[inline(always)]
pub(super) fn shared<const M: usize>(a: &[f64; MAX_UNKNOWNS], b: &[f64; MAX_UNKNOWNS]) -> f64 {
    let mut product = 0.0;
    for (a, b) in a.iter().zip(b).take(M) {
        product += a * b;
    }
    -product
}
