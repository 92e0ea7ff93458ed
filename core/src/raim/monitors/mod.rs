//! One face for every monitor that looks at an epoch alone: an epoch in, a verdict out.
//!
//! In: the linearised epoch, and of each row its satellite, direction and sigmas. Out:
//! [`MonitorVerdict`]: whether a fault was seen, what was left out, where the position lies, and what
//! bounds its error or why nothing does. The monitors differ in what they assume and what they can
//! promise; the face is what lets one recording be given to all of them. No monitor keeps memory of
//! earlier epochs, and none relinearises: the rows are taken at a position near enough (the snapshot
//! solution moves by metres, which changes a direction by 1e-6).
//!
//! | monitor | file | what its levels promise |
//! |---|---|---|
//! | residual RAIM | [`residual`] | one fault missed with P_MD, noise on top |
//! | ARAIM | [`araim`] | every likely fault, with the integrity risk |
//! | IGG-III | [`robust`] | nothing beyond the noise of the rows that are left |
//! | RMS comparison | [`rms`] | no levels |
//! | VPL separation | [`vpl_mhss`] | one fault, of any size, in each axis |
//! | RANCO, S-RANCO, FOIM | [`consensus`] | no levels |
//! | Doppler RAIM | [`doppler`] | as residual RAIM, of the velocity |
//!
//! The default path of the product does not go through here: `snapshot.rs` solves, tests and
//! excludes by itself.

mod agreement;
pub mod araim;
pub mod consensus;
pub mod doppler;
pub mod residual;
pub mod rms;
pub mod robust;
pub mod vpl_mhss;

use super::exclusion::RowSet;
use crate::consts::{MAX_SATELLITES, MAX_UNKNOWNS};
use crate::gnss::solution::UsedRow;
use crate::linalg::LinearModel;
use crate::linalg::qr::QrError;
use crate::stats::StatsError;

/// An epoch as every monitor takes it. Rows of pseudoranges (m) or of range rates (m/s).
#[derive(Clone, Copy, Debug)]
pub struct MonitorEpoch<'a> {
    model: &'a LinearModel,
    rows: &'a [UsedRow],
}

impl<'a> MonitorEpoch<'a> {
    /// The rows of a model and what is known of each, in the same order
    /// ([`crate::gnss::solution::SnapshotWorkspace::used_rows`]).
    ///
    /// # Errors
    /// [`NotTested::RowsMismatch`].
    pub fn new(model: &'a LinearModel, rows: &'a [UsedRow]) -> Result<Self, NotTested> {
        if model.n == rows.len() && model.n <= MAX_SATELLITES && model.m <= MAX_UNKNOWNS {
            Ok(Self { model, rows })
        } else {
            Err(NotTested::RowsMismatch {
                model: model.n,
                rows: rows.len(),
            })
        }
    }

    /// The linearised epoch.
    pub const fn model(&self) -> &'a LinearModel {
        self.model
    }

    /// Satellite, direction and sigmas of each row.
    pub const fn rows(&self) -> &'a [UsedRow] {
        self.rows
    }
}

/// What came of the test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// Nothing was tested.
    NotTested(NotTested),
    /// No fault seen.
    Passed,
    /// A fault was seen, and what is left without [`MonitorVerdict::excluded`] agrees.
    Excluded,
    /// A fault was seen and not taken out: the position is not to be used.
    Detected,
}

/// Why an epoch could not be tested.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NotTested {
    /// The monitor has no configuration.
    NotConfigured,
    /// The model has another number of rows than satellites are described.
    RowsMismatch {
        /// Rows of the model.
        model: usize,
        /// Satellites described.
        rows: usize,
    },
    /// The epoch could not be factored: too few rows, a geometry that determines nothing, no numbers.
    Factor(QrError),
    /// Nothing left to test with.
    NoRedundancy {
        /// Rows.
        n: usize,
    },
    /// More rows than the monitor has room for, or fewer than it can work with.
    RowsOutOfRange {
        /// Rows.
        n: usize,
    },
    /// The iteration did not settle.
    NotConverged,
    /// A number of the epoch is out of its range, or no number.
    Number,
    /// A threshold could not be computed.
    Stats(StatsError),
    /// The faults that are likely enough to matter cannot all be monitored.
    FaultsNotMonitored,
}

impl From<QrError> for NotTested {
    fn from(error: QrError) -> Self {
        Self::Factor(error)
    }
}

/// Protection levels of a position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MonitorLevels {
    /// Horizontal, m.
    pub hpl_m: f64,
    /// Vertical, m.
    pub vpl_m: f64,
}

/// Why there are no levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoLevels {
    /// Nothing was tested.
    NotTested,
    /// A fault is in the position.
    FaultPresent,
    /// A fault on this row moves the position and shows in nothing that is tested.
    Untestable {
        /// The row.
        row: usize,
    },
    /// Without redundancy, after an exclusion or from the beginning.
    NoRedundancy,
    /// The integrity risk is spent on faults that are not monitored.
    NoIntegrityBudget,
    /// The arithmetic gave no finite number.
    NotFinite,
    /// This monitor gives none.
    NotOffered,
}

/// What a monitor says of an epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MonitorVerdict {
    /// What came of the test.
    pub outcome: Outcome,
    /// Rows found faulty and not used in the position.
    pub excluded: RowSet,
    /// Position minus the point of linearisation, east, north, up, m (or m/s); the one after the
    /// exclusion. `None` without a solution.
    pub position_enu_m: Option<[f64; 3]>,
    /// Bounds of its error.
    pub levels: Result<MonitorLevels, NoLevels>,
    /// The statistic that decided, in the monitor's own unit, before any exclusion.
    pub statistic: Option<f64>,
    /// What the statistic was compared with.
    pub threshold: Option<f64>,
}

impl MonitorVerdict {
    /// Nothing tested, no position.
    pub const fn not_tested(why: NotTested) -> Self {
        Self {
            outcome: Outcome::NotTested(why),
            excluded: RowSet::EMPTY,
            position_enu_m: None,
            levels: Err(NoLevels::NotTested),
            statistic: None,
            threshold: None,
        }
    }

    /// Whether a fault was seen, taken out or not.
    pub fn is_detected(&self) -> bool {
        matches!(self.outcome, Outcome::Detected | Outcome::Excluded)
    }
}

/// Levels, when both are numbers.
pub fn checked_levels(hpl_m: f64, vpl_m: f64) -> Result<MonitorLevels, NoLevels> {
    if hpl_m.is_finite() && vpl_m.is_finite() && hpl_m >= 0.0 && vpl_m >= 0.0 {
        Ok(MonitorLevels { hpl_m, vpl_m })
    } else {
        Err(NoLevels::NotFinite)
    }
}

/// Why a monitor could not be configured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ConfigureError {
    /// A number is out of its range.
    OutOfRange {
        /// Its name.
        name: &'static str,
        /// The value.
        value: f64,
    },
    /// A probability gives no threshold.
    Stats(StatsError),
}

impl From<StatsError> for ConfigureError {
    fn from(error: StatsError) -> Self {
        Self::Stats(error)
    }
}

/// A monitor that looks at an epoch alone. The value holds its memory: keep it in a `static`.
pub trait EpochMonitor {
    /// What has to be chosen.
    type Config;

    /// Checks a configuration and computes what is needed of it, once.
    ///
    /// # Errors
    /// [`ConfigureError`]; the monitor is then not configured.
    fn configure(&mut self, config: &Self::Config) -> Result<(), ConfigureError>;

    /// Looks at one epoch.
    fn assess(&mut self, epoch: &MonitorEpoch<'_>) -> MonitorVerdict;
}

/// Copies an epoch with the sigma of each row's whole error, that common to satellites included.
fn with_whole_sigmas(epoch: &MonitorEpoch<'_>, out: &mut LinearModel) {
    out.clone_from(epoch.model());
    for (sigma_m, row) in out.sigma_m.iter_mut().zip(epoch.rows()) {
        *sigma_m = row.sigma.total_m();
    }
}

/// Copies the rows that are not left out. A clock that loses all its rows loses its column, so that the
/// others stay solvable.
#[inline(never)]
pub fn without_rows(model: &LinearModel, left_out: RowSet, out: &mut LinearModel) {
    out.n = 0;
    out.m = 0;
    // Where each column goes; the position always stays.
    let mut present = [false; MAX_UNKNOWNS];
    let mut kept = 0;
    let rows = || {
        let given = model
            .design
            .iter()
            .zip(&model.residual_m)
            .zip(&model.sigma_m)
            .enumerate();
        given
            .take(model.n)
            .filter(move |(row, _)| !left_out.contains(*row))
            .map(|(_, row)| row)
    };
    for ((design, _), _) in rows() {
        for (present, entry) in present.iter_mut().zip(design) {
            // NaN stays, to be refused.
            *present |= *entry != 0.0;
        }
    }
    for present in present.iter_mut().take(3) {
        *present = true;
    }
    let places = out
        .design
        .iter_mut()
        .zip(&mut out.residual_m)
        .zip(&mut out.sigma_m);
    for (((design, residual_m), sigma_m), ((given, given_m), given_sigma_m)) in places.zip(rows()) {
        *design = [0.0; MAX_UNKNOWNS];
        let columns = given.iter().zip(present).take(model.m);
        for (entry, (value, _)) in design
            .iter_mut()
            .zip(columns.filter(|(_, present)| *present))
        {
            *entry = *value;
        }
        *residual_m = *given_m;
        *sigma_m = *given_sigma_m;
        kept += 1;
    }
    out.n = kept;
    out.m = present.iter().take(model.m).filter(|p| **p).count();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_without_rows_loses_its_column() {
        let mut model = LinearModel::EMPTY;
        (model.n, model.m) = (4, 5);
        for row in 0..4 {
            model.design[row][0] = row as f64 + 1.0;
            model.design[row][3 + usize::from(row == 1)] = 1.0;
            model.residual_m[row] = 10.0 * row as f64;
            model.sigma_m[row] = 1.0 + row as f64;
        }
        let mut out = LinearModel::EMPTY;
        without_rows(&model, RowSet::EMPTY.with(1), &mut out);
        assert_eq!((out.n, out.m), (3, 4));
        assert_eq!(out.design[1][..4], [3.0, 0.0, 0.0, 1.0]);
        assert_eq!((out.residual_m[1], out.sigma_m[1]), (20.0, 3.0));
        without_rows(&model, RowSet::EMPTY.with(0), &mut out);
        assert_eq!((out.n, out.m), (3, 5));
        assert_eq!(out.design[0][..5], [2.0, 0.0, 0.0, 0.0, 1.0]);
        without_rows(&model, RowSet::EMPTY, &mut out);
        assert_eq!(out.design[..4], model.design[..4]);
    }

    #[test]
    fn rows_and_their_descriptions_must_be_as_many() {
        let mut model = LinearModel::EMPTY;
        assert!(MonitorEpoch::new(&model, &[]).is_ok());
        model.n = 1;
        assert_eq!(
            MonitorEpoch::new(&model, &[]).err(),
            Some(NotTested::RowsMismatch { model: 1, rows: 0 })
        );
    }

    #[test]
    fn levels_that_are_no_numbers_are_none() {
        assert!(checked_levels(1.0, 2.0).is_ok());
        for (hpl_m, vpl_m) in [(f64::NAN, 1.0), (1.0, f64::INFINITY), (-1.0, 1.0)] {
            assert_eq!(checked_levels(hpl_m, vpl_m), Err(NoLevels::NotFinite));
        }
    }
}
