//! One-epoch integrity tests, exclusion and slope-based protection levels.
//!
//! In reading order: [`parity`] tests an epoch for a fault, [`thresholds`] says when a statistic is
//! too large, [`slope`] bounds what an undetected fault can do to the position, [`level`] adds the noise, [`exclusion`] finds the
//! faulty rows, [`bias`] tells how far one is off, [`ls`] is the same test computed the textbook's way, for comparison. [`gdop4`] tells what four satellites
//! alone are worth. [`araim`] bounds the
//! error against every likely fault by solution separation. [`monitors`] gives all of them, and those of other
//! sources, one face.
//!
//! A redundancy is the number of rows minus the number of unknowns. ERRATA of [P1]: with several
//! constellations it is n − 3 − (number of constellations).

pub mod araim;
pub mod bias;
pub mod bounded;
pub mod consensus;
pub mod exclusion;
pub mod foim;
pub mod gdop4;
pub mod igg3;
pub mod level;
pub mod ls;
pub mod monitors;
pub mod parity;
pub mod ranco;
pub mod reconstructed;
pub mod rms;
pub mod s_ranco;
pub mod slope;
pub mod thresholds;
pub mod vpl_mhss;

use crate::linalg::qr::QrError;

/// The statistic of an epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TestStatistic {
    /// Weighted sum of squared residuals: chi-square with `redundancy` degrees of freedom when no
    /// satellite is faulty, 1.
    pub sum_of_squares: f64,
    /// Rows minus unknowns, at least 1.
    pub redundancy: usize,
}

impl TestStatistic {
    /// Whether the statistic lies within the threshold; NaN does not.
    pub fn passes(&self, threshold: f64) -> bool {
        self.sum_of_squares <= threshold
    }
}

/// Why an epoch could not be tested.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RaimError {
    /// The epoch could not be factored.
    Factor(QrError),
    /// As many rows as unknowns: nothing is left to test with.
    NoRedundancy {
        /// Rows, and unknowns.
        n: usize,
    },
}

impl From<QrError> for RaimError {
    fn from(error: QrError) -> Self {
        Self::Factor(error)
    }
}
