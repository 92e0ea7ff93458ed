//! RMS comparison through the common face: after a failed parity test it names what to take out.
//!
//! [P1] section 3 says which satellite failed, not whether one did: the parity test of section 1 decides that.
//! As printed every row above the threshold is taken out, healthy ones among them; corrected only the row
//! with the largest residual, if the rest passes the test again. With redundancy 1 nothing can be named, and
//! the corrected form names nothing. There are no levels. Limits: [`crate::raim::rms`].

use super::{
    ConfigureError, EpochMonitor, MonitorEpoch, MonitorVerdict, NoLevels, NotTested, Outcome,
    without_rows,
};
use crate::consts::MAX_SATELLITES;
use crate::linalg::LinearModel;
use crate::linalg::qr::WhitenedQr;
use crate::raim::exclusion::RowSet;
use crate::raim::rms::{self, RmsVariant};
use crate::raim::thresholds::RaimTable;
use crate::raim::{RaimError, TestStatistic, parity};

/// Which rows are taken out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RmsRule {
    /// All above the threshold of the signed residuals, as printed.
    Printed,
    /// The largest in size alone.
    Corrected,
}

/// What RMS comparison is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RmsConfig {
    /// False-alarm probability of the parity test.
    pub p_false_alarm: f64,
    /// Which rows are taken out.
    pub rule: RmsRule,
}

/// The missed-detection probability that the table of thresholds is filled with; no level uses it.
const P_MISSED_DETECTION: f64 = 1e-3;

/// RMS comparison, and its memory (9 kB).
#[derive(Clone, Debug)]
pub struct RmsMonitor {
    rule: Option<RmsRule>,
    thresholds: RaimTable,
    remaining: LinearModel,
    qr: WhitenedQr,
    residuals: [f64; MAX_SATELLITES],
}

impl RmsMonitor {
    /// Not configured.
    pub const EMPTY: Self = Self {
        rule: None,
        thresholds: RaimTable::EMPTY,
        remaining: LinearModel::EMPTY,
        qr: WhitenedQr::EMPTY,
        residuals: [0.0; MAX_SATELLITES],
    };

    fn test(
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

    /// What the rule takes out of the epoch tested last.
    fn named(&mut self, rule: RmsRule, redundancy: usize) -> Option<RowSet> {
        self.qr.residuals(&mut self.residuals);
        let residuals = self.residuals.get(..self.qr.n())?;
        match rule {
            RmsRule::Printed => rms::compare(residuals, RmsVariant::Signed)
                .ok()
                .map(|comparison| comparison.flagged),
            RmsRule::Corrected if redundancy < 2 => None,
            RmsRule::Corrected => rms::compare(residuals, RmsVariant::Absolute)
                .ok()
                .map(|comparison| RowSet::EMPTY.with(comparison.largest)),
        }
    }

    fn position_enu_m(&self) -> [f64; 3] {
        let [east, north, up, ..] = self.qr.estimate();
        [east, north, up]
    }
}

impl EpochMonitor for RmsMonitor {
    type Config = RmsConfig;

    fn configure(&mut self, config: &RmsConfig) -> Result<(), ConfigureError> {
        self.rule = None;
        self.thresholds
            .fill(config.p_false_alarm, P_MISSED_DETECTION)?;
        self.rule = Some(config.rule);
        Ok(())
    }

    #[inline(never)]
    fn assess(&mut self, epoch: &MonitorEpoch<'_>) -> MonitorVerdict {
        let Some(rule) = self.rule else {
            return MonitorVerdict::not_tested(NotTested::NotConfigured);
        };
        let (statistic, threshold) = match self.test(epoch.model(), RowSet::EMPTY) {
            Ok(tested) => tested,
            Err(why) => return MonitorVerdict::not_tested(why),
        };
        let mut verdict = MonitorVerdict {
            outcome: Outcome::Passed,
            excluded: RowSet::EMPTY,
            position_enu_m: Some(self.position_enu_m()),
            levels: Err(NoLevels::NotOffered),
            statistic: Some(statistic.sum_of_squares),
            threshold: Some(threshold),
        };
        if statistic.passes(threshold) {
            return verdict;
        }
        verdict.outcome = Outcome::Detected;
        if let Some(named) = self.named(rule, statistic.redundancy)
            && let Ok((statistic, threshold)) = self.test(epoch.model(), named)
            && statistic.passes(threshold)
        {
            verdict.outcome = Outcome::Excluded;
            verdict.excluded = named;
            verdict.position_enu_m = Some(self.position_enu_m());
        }
        verdict
    }
}
