//! Parity-vector test of one epoch.
//!
//! In: a linearised epoch. Out: its statistic, and the factorization that estimate, levels and
//! exclusion go on from.
//!
//! | symbol | code | shape | unit | meaning |
//! |--------|------|-------|------|---------|
//! | p      | [`WhitenedQr::parity`] | n − m | 1 | parity vector, the last rows of Qᵀ times z |
//! | SSE    | `sum_of_squares` | 1 | 1 | p·p, equal to the squared residuals of least squares |
//!
//! Equations: [P1] (11) to (14) with the parity matrix taken from a QR factorization (ERRATA: no inverse
//! is needed, p = Vz is (n − m) × 1), rows divided by their sigmas; equivalence with the residuals
//! [BROWN-1992]. Keys: docs/references.md.

use super::{RaimError, TestStatistic};
use crate::linalg::LinearModel;
use crate::linalg::qr::WhitenedQr;

/// Tests an epoch. `qr` holds the factorization afterwards, also when the error is
/// [`RaimError::NoRedundancy`]: the estimate is then there, only nothing to test it with.
///
/// # Errors
/// [`RaimError`].
#[inline(never)]
pub fn test(model: &LinearModel, qr: &mut WhitenedQr) -> Result<TestStatistic, RaimError> {
    qr.factor(model)?;
    statistic(qr)
}

/// The statistic of an epoch that is already factored, as the last iteration of a solution leaves it.
///
/// # Errors
/// [`RaimError::NoRedundancy`].
pub fn statistic(qr: &WhitenedQr) -> Result<TestStatistic, RaimError> {
    let redundancy = qr.n().saturating_sub(qr.m());
    if redundancy == 0 {
        return Err(RaimError::NoRedundancy { n: qr.n() });
    }
    Ok(TestStatistic {
        sum_of_squares: qr.sum_of_squares(),
        redundancy,
    })
}
