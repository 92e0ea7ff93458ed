//! Least-squares residual test, computed as the textbook does it: with the full projector.
//!
//! In: a linearised epoch. Out: the same statistic as [`super::parity::test`]. It is the cross-check of
//! the parity test and the other side of the cost comparison of [P1] section 2; the monitor uses
//! the parity test.
//!
//! | symbol | code        | shape | unit | meaning                            |
//! |--------|-------------|-------|------|------------------------------------|
//! | H, y   | `design`, `measured` | n × m, n | 1 | rows divided by their sigmas |
//! | S      | `projector` | n × n | 1    | I − H (HᵀH)⁻¹ Hᵀ                   |
//! | w      | `residuals` | n     | 1    | S y                                |
//!
//! Equations: [P1] (4) estimate, (5) projector and residuals, (7) sum of squares. Keys:
//! docs/references.md. Accuracy: (HᵀH)⁻¹ squares the condition number, so that digits go twice as fast
//! as in the QR factorization.

use super::{RaimError, TestStatistic};
use crate::consts::{MAX_SATELLITES, MAX_UNKNOWNS};
use crate::linalg::LinearModel;
use crate::linalg::qr::{CONDITION_LIMIT, QrError};

/// Memory of the test, owned by the caller (24 kB).
#[derive(Clone, Debug)]
pub struct LeastSquaresWorkspace {
    n: usize,
    design: [[f64; MAX_UNKNOWNS]; MAX_SATELLITES],
    measured: [f64; MAX_SATELLITES],
    gain: [[f64; MAX_UNKNOWNS]; MAX_SATELLITES],
    projector: [[f64; MAX_SATELLITES]; MAX_SATELLITES],
    residuals: [f64; MAX_SATELLITES],
}

impl LeastSquaresWorkspace {
    /// Nothing tested.
    pub const EMPTY: Self = Self {
        n: 0,
        design: [[0.0; MAX_UNKNOWNS]; MAX_SATELLITES],
        measured: [0.0; MAX_SATELLITES],
        gain: [[0.0; MAX_UNKNOWNS]; MAX_SATELLITES],
        projector: [[0.0; MAX_SATELLITES]; MAX_SATELLITES],
        residuals: [0.0; MAX_SATELLITES],
    };

    /// S, n × n of the rows and columns; what lies beyond is not defined.
    pub fn projector(&self) -> &[[f64; MAX_SATELLITES]] {
        self.projector.get(..self.n).unwrap_or(&[])
    }

    /// Whitened residuals w, n entries.
    pub fn residuals(&self) -> &[f64] {
        self.residuals.get(..self.n).unwrap_or(&[])
    }
}

/// Tests an epoch. [P1] (4), (5), (7)
///
/// # Errors
/// [`RaimError`], by the same rules as the factorization of the parity test.
#[inline(never)]
pub fn test(
    model: &LinearModel,
    workspace: &mut LeastSquaresWorkspace,
) -> Result<TestStatistic, RaimError> {
    workspace.n = 0;
    let (n, m) = (model.n, model.m);
    if n < m || n > MAX_SATELLITES {
        return Err(QrError::RowsOutOfRange { n }.into());
    }
    let sum_of_squares = match m {
        4 => test_fixed::<4>(model, workspace)?,
        5 => test_fixed::<5>(model, workspace)?,
        6 => test_fixed::<6>(model, workspace)?,
        _ => return Err(QrError::UnknownsOutOfRange { m }.into()),
    };
    workspace.n = n;
    if n == m {
        return Err(RaimError::NoRedundancy { n });
    }
    Ok(TestStatistic {
        sum_of_squares,
        redundancy: n - m,
    })
}

#[expect(
    clippy::indexing_slicing,
    reason = "the textbook's indices; rows of MAX_UNKNOWNS entries, indices below M ≤ MAX_UNKNOWNS"
)]
#[inline(never)]
fn test_fixed<const M: usize>(
    model: &LinearModel,
    workspace: &mut LeastSquaresWorkspace,
) -> Result<f64, QrError> {
    let n = model.n;
    let LeastSquaresWorkspace {
        design,
        measured,
        gain,
        projector,
        residuals,
        ..
    } = workspace;

    // Whiten, and HᵀH.
    let mut normal = [[0.0; MAX_UNKNOWNS]; MAX_UNKNOWNS];
    let whitened = design.iter_mut().zip(measured.iter_mut());
    let given = model
        .design
        .iter()
        .zip(&model.residual_m)
        .zip(&model.sigma_m);
    for (index, ((row, y), ((design, residual_m), sigma_m))) in
        whitened.zip(given).take(n).enumerate()
    {
        let weight = 1.0 / sigma_m;
        if !(weight > 0.0 && weight < f64::INFINITY) {
            return Err(QrError::SigmaNotPositive { row: index });
        }
        for j in 0..M {
            row[j] = design[j] * weight;
        }
        *y = residual_m * weight;
        for i in 0..M {
            for j in 0..M {
                normal[i][j] += row[i] * row[j];
            }
        }
    }
    let inverse = invert::<M>(&normal)?;

    // H (HᵀH)⁻¹.
    for (gain_row, row) in gain.iter_mut().zip(design.iter()).take(n) {
        for j in 0..M {
            let mut sum = 0.0;
            for k in 0..M {
                sum += row[k] * inverse[k][j];
            }
            gain_row[j] = sum;
        }
    }

    // S = I − H (HᵀH)⁻¹ Hᵀ, w = S y, SSE = w·w.
    let mut sum_of_squares = 0.0;
    let rows = projector.iter_mut().zip(gain.iter()).zip(residuals);
    for (i, ((projector_row, gain_row), residual)) in rows.take(n).enumerate() {
        let mut sum = 0.0;
        let columns = projector_row.iter_mut().zip(design.iter()).zip(&*measured);
        for (j, ((entry, row), y)) in columns.take(n).enumerate() {
            let mut product = 0.0;
            for k in 0..M {
                product += gain_row[k] * row[k];
            }
            *entry = if i == j { 1.0 - product } else { -product };
            sum += *entry * y;
        }
        *residual = sum;
        sum_of_squares += sum * sum;
    }
    if sum_of_squares.is_finite() {
        Ok(sum_of_squares)
    } else {
        Err(QrError::NotFinite)
    }
}

/// Inverse of a positive definite matrix by Gauss-Jordan elimination; pivots on the diagonal are
/// stable there.
#[expect(
    clippy::indexing_slicing,
    clippy::needless_range_loop,
    reason = "the textbook's indices, all below M ≤ MAX_UNKNOWNS"
)]
#[inline(always)]
fn invert<const M: usize>(
    matrix: &[[f64; MAX_UNKNOWNS]; MAX_UNKNOWNS],
) -> Result<[[f64; MAX_UNKNOWNS]; MAX_UNKNOWNS], QrError> {
    let mut work = *matrix;
    let mut norm = 0.0;
    for i in 0..M {
        for j in 0..M {
            norm += work[i][j] * work[i][j];
        }
    }
    for k in 0..M {
        let pivot = work[k][k];
        // Positive in exact arithmetic; NaN refuses.
        if !(pivot > 0.0 && pivot < f64::INFINITY) {
            return Err(if pivot <= 0.0 {
                QrError::BadGeometry {
                    condition: f64::INFINITY,
                }
            } else {
                QrError::NotFinite
            });
        }
        let inverse_pivot = 1.0 / pivot;
        for j in 0..M {
            work[k][j] *= inverse_pivot;
        }
        work[k][k] = inverse_pivot;
        for i in 0..M {
            if i != k {
                let factor = work[i][k];
                for j in 0..M {
                    if j != k {
                        work[i][j] -= factor * work[k][j];
                    }
                }
                work[i][k] = -factor * inverse_pivot;
            }
        }
    }
    let mut inverse_norm = 0.0;
    for i in 0..M {
        for j in 0..M {
            inverse_norm += work[i][j] * work[i][j];
        }
    }
    // The condition of HᵀH is the square of that of H.
    let condition = libm::sqrt(libm::sqrt(norm * inverse_norm));
    if condition <= CONDITION_LIMIT {
        Ok(work)
    } else if condition.is_nan() {
        Err(QrError::NotFinite)
    } else {
        Err(QrError::BadGeometry { condition })
    }
}
