//! Protection levels by slope, and the spread of the position without a fault.
//!
//! In: a factored epoch ([`WhitenedQr`]), √λ of the test ([`super::thresholds`]). Out: how far the
//! position moves per unit of each row, how visible each row is, HPL and VPL.
//!
//! | symbol | code                | shape | unit | frame | meaning                                         |
//! |--------|---------------------|-------|------|-------|-------------------------------------------------|
//! | A      | `leverage`          | n × 3 | m    | enu   | shift of the position per sigma of error in a row |
//! | S_ii   | `residual_cofactor` | n     | 1    |       | share of a row's error that stays in its residual |
//! | slope  |                     | n     | m    | enu   | √(A_E² + A_N²)/√S_ii, and abs(A_U)/√S_ii         |
//! | P      |                     | 3 × 3 | m²   | enu   | covariance of the position without a fault      |
//!
//! Equations: slopes and HPL = slope_max · √λ (sigma is 1 after whitening) [BROWN-1992]; S_ii from the
//! projector of [P1] (5), as 1 − |row i of Q₁|². Keys: docs/references.md.
//! Assumes: one faulty row. The level bounds the shift by the fault alone, as [BROWN-1992] defines it;
//! the caller adds the fault-free part from [`Sensitivity::position_covariance`] as its phase asks.

use crate::consts::{MAX_SATELLITES, MAX_UNKNOWNS};
use crate::linalg::LinearModel;
use crate::linalg::qr::WhitenedQr;
use nalgebra::Matrix3;

/// Smallest S_ii of a row that counts as testable. Rounding leaves 1e-15 in S_ii, so that seven digits
/// of the slope are right here; the slope itself is 10,000 times the leverage and no level for
/// navigation.
pub const MIN_RESIDUAL_COFACTOR: f64 = 1e-8;

/// A row that moves the position by less than this, per sigma, cannot harm it whatever its fault: a
/// satellite that is alone in its constellation only sets that clock, m.
pub const HARMLESS_LEVERAGE_M: f64 = 1e-10;

/// Leverage and visibility of every row.
#[derive(Clone, Debug)]
pub struct Sensitivity {
    n: usize,
    redundancy: usize,
    leverage: [[f64; 3]; MAX_SATELLITES],
    residual_cofactor: [f64; MAX_SATELLITES],
}

/// Slope-based levels of one epoch, and the rows that set them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlopeLevels {
    /// Horizontal protection level, m.
    pub hpl_m: f64,
    /// Vertical protection level, m.
    pub vpl_m: f64,
    /// Row of the largest horizontal slope.
    pub horizontal_row: usize,
    /// Row of the largest vertical slope.
    pub vertical_row: usize,
}

/// Why there is no level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NoLevel {
    /// Nothing is factored, or no row is redundant.
    NoRedundancy,
    /// A fault on this row moves the position and shows in no residual.
    Untestable {
        /// The row.
        row: usize,
    },
    /// The arithmetic gave no finite number.
    NotFinite,
}

impl Sensitivity {
    /// Nothing known.
    pub const EMPTY: Self = Self {
        n: 0,
        redundancy: 0,
        leverage: [[0.0; 3]; MAX_SATELLITES],
        residual_cofactor: [0.0; MAX_SATELLITES],
    };

    /// Forms the thin Q of `qr` and from it the sensitivities; empty when nothing is factored.
    #[inline(never)]
    pub fn fill(&mut self, qr: &mut WhitenedQr) {
        self.n = 0;
        self.redundancy = 0;
        qr.form_thin_q();
        match qr.m() {
            4 => self.fill_fixed::<4>(qr),
            5 => self.fill_fixed::<5>(qr),
            6 => self.fill_fixed::<6>(qr),
            _ => return,
        }
        self.n = qr.thin_q().len();
        self.redundancy = self.n.saturating_sub(qr.m());
    }

    #[expect(
        clippy::indexing_slicing,
        reason = "formula by indices; rows of MAX_UNKNOWNS entries, indices below M ≤ MAX_UNKNOWNS"
    )]
    #[inline(never)]
    fn fill_fixed<const M: usize>(&mut self, qr: &WhitenedQr) {
        let r_inverse: &[[f64; MAX_UNKNOWNS]; MAX_UNKNOWNS] = qr.r_inverse();
        let rows = self
            .leverage
            .iter_mut()
            .zip(&mut self.residual_cofactor)
            .zip(qr.thin_q());
        for ((leverage, residual_cofactor), q) in rows {
            let mut shown = 1.0;
            for entry in q.iter().take(M) {
                shown -= entry * entry;
            }
            *residual_cofactor = shown;
            for axis in 0..3 {
                let mut sum = 0.0;
                for k in 0..M {
                    // R⁻¹ is upper triangular.
                    if k >= axis {
                        sum += r_inverse[axis][k] * q[k];
                    }
                }
                leverage[axis] = sum;
            }
        }
    }

    /// Shift of the position in east, north, up per sigma of error in each row, m.
    pub fn leverage(&self) -> &[[f64; 3]] {
        self.leverage.get(..self.n).unwrap_or(&[])
    }

    /// S_ii of each row, 0 to 1 but for rounding.
    pub fn residual_cofactor(&self) -> &[f64] {
        self.residual_cofactor.get(..self.n).unwrap_or(&[])
    }

    /// HPL and VPL by the largest slope. [BROWN-1992]
    ///
    /// # Errors
    /// [`NoLevel`].
    #[inline(never)]
    pub fn levels(&self, sqrt_noncentrality: f64) -> Result<SlopeLevels, NoLevel> {
        if self.redundancy == 0 {
            return Err(NoLevel::NoRedundancy);
        }
        // Squares are compared; only the largest has its root taken.
        let (mut horizontal, mut vertical) = (0.0, 0.0);
        let (mut horizontal_row, mut vertical_row) = (0, 0);
        let rows = self.leverage().iter().zip(self.residual_cofactor());
        for (row, ([east, north, up], residual_cofactor)) in rows.enumerate() {
            let horizontal_shift = east * east + north * north;
            let vertical_shift = up * up;
            // NaN is not testable.
            let is_testable = *residual_cofactor >= MIN_RESIDUAL_COFACTOR;
            if !is_testable {
                if horizontal_shift + vertical_shift <= HARMLESS_LEVERAGE_M * HARMLESS_LEVERAGE_M {
                    continue;
                }
                return Err(NoLevel::Untestable { row });
            }
            let visibility = 1.0 / residual_cofactor;
            let slope = horizontal_shift * visibility;
            if slope > horizontal {
                horizontal = slope;
                horizontal_row = row;
            }
            let slope = vertical_shift * visibility;
            if slope > vertical {
                vertical = slope;
                vertical_row = row;
            }
        }
        let levels = SlopeLevels {
            hpl_m: libm::sqrt(horizontal) * sqrt_noncentrality,
            vpl_m: libm::sqrt(vertical) * sqrt_noncentrality,
            horizontal_row,
            vertical_row,
        };
        if levels.hpl_m.is_finite() && levels.vpl_m.is_finite() {
            Ok(levels)
        } else {
            Err(NoLevel::NotFinite)
        }
    }

    /// Covariance of the position in east, north, up when no satellite is faulty, m²:
    ///
    /// P = Σᵢ aᵢaᵢᵀ (σ_independent,i/σᵢ)² + Σ_c s_c s_cᵀ with s_c = Σᵢ aᵢ c_i/σᵢ,
    ///
    /// where aᵢ is the leverage of row i, σᵢ the sigma it was weighted with in `model`,
    /// `independent_sigma_m` the part of its error that no other row shares, and each of
    /// `common_errors_m` the one-sigma errors that one cause (the ionosphere's zenith delay) makes in
    /// all rows together.
    pub fn position_covariance(
        &self,
        model: &LinearModel,
        independent_sigma_m: &[f64; MAX_SATELLITES],
        common_errors_m: &[[f64; MAX_SATELLITES]],
    ) -> Matrix3<f64> {
        let mut covariance = Matrix3::zeros();
        let rows = self.leverage().iter().zip(&model.sigma_m);
        for ((leverage, sigma_m), independent_m) in rows.zip(independent_sigma_m) {
            let scale = independent_m / sigma_m;
            add_outer_product(&mut covariance, leverage, scale * scale);
        }
        for errors_m in common_errors_m {
            let mut shift = [0.0; 3];
            let rows = self.leverage().iter().zip(&model.sigma_m);
            for ((leverage, sigma_m), error_m) in rows.zip(errors_m) {
                for (sum, per_sigma) in shift.iter_mut().zip(leverage) {
                    *sum += per_sigma * (error_m / sigma_m);
                }
            }
            add_outer_product(&mut covariance, &shift, 1.0);
        }
        covariance
    }
}

fn add_outer_product(sum: &mut Matrix3<f64>, vector: &[f64; 3], weight: f64) {
    for (column, b) in sum.column_iter_mut().zip(vector) {
        for (entry, a) in column.into_iter().zip(vector) {
            *entry += weight * a * b;
        }
    }
}

/// Semi-major axis of the horizontal error ellipse of a covariance in east, north, up: the largest
/// one-sigma error in any horizontal direction, m. Square root of the larger eigenvalue of the
/// horizontal block; NaN when the covariance is not one.
pub fn semi_major_axis_m(covariance: &Matrix3<f64>) -> f64 {
    let (east, north, mixed) = (covariance.m11, covariance.m22, covariance.m12);
    let mean = 0.5 * (east + north);
    let half_difference = 0.5 * (east - north);
    libm::sqrt(mean + libm::sqrt(half_difference * half_difference + mixed * mixed))
}
