//! Whether rows agree: the parity test of what is not left out, for the monitors that find faults another way.

use super::{NotTested, without_rows};
use crate::linalg::LinearModel;
use crate::linalg::qr::WhitenedQr;
use crate::raim::exclusion::RowSet;
use crate::raim::thresholds::RaimTable;
use crate::raim::{RaimError, TestStatistic, parity};
use crate::stats::StatsError;

/// The test, its thresholds and its memory (9 kB).
#[derive(Clone, Debug)]
pub(super) struct Agreement {
    pub(super) thresholds: RaimTable,
    /// The rows tested last, and their factorization.
    pub(super) remaining: LinearModel,
    pub(super) qr: WhitenedQr,
}

impl Agreement {
    /// Without thresholds.
    pub(super) const EMPTY: Self = Self {
        thresholds: RaimTable::EMPTY,
        remaining: LinearModel::EMPTY,
        qr: WhitenedQr::EMPTY,
    };

    /// Computes the thresholds.
    pub(super) fn configure(
        &mut self,
        p_false_alarm: f64,
        p_missed_detection: f64,
    ) -> Result<(), StatsError> {
        self.thresholds.fill(p_false_alarm, p_missed_detection)
    }

    /// Tests the rows that are not left out; the statistic and its threshold.
    pub(super) fn test(
        &mut self,
        model: &LinearModel,
        left_out: RowSet,
    ) -> Result<(TestStatistic, f64), NotTested> {
        without_rows(model, left_out, &mut self.remaining);
        let statistic =
            parity::test(&self.remaining, &mut self.qr).map_err(|error| match error {
                RaimError::Factor(error) => NotTested::Factor(error),
                RaimError::NoRedundancy { n } => NotTested::NoRedundancy { n },
            })?;
        let threshold = self
            .thresholds
            .threshold(statistic.redundancy)
            .ok_or(NotTested::NotConfigured)?;
        Ok((statistic, threshold))
    }

    /// Least squares of the rows tested last, east, north, up, m.
    pub(super) fn position_enu_m(&self) -> [f64; 3] {
        let [east, north, up, ..] = self.qr.estimate();
        [east, north, up]
    }
}
