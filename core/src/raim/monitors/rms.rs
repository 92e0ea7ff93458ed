//! RMS comparison through the common face: after a failed parity test it names what to take out.
//!
//! [P1] section 3 says which satellite failed, not whether one did: the parity test of section 1 decides that.
//! As printed every row above the threshold is taken out, healthy ones among them; corrected only the row
//! with the largest residual, if the rest passes the test again. With redundancy 1 nothing can be named, and
//! the corrected form names nothing. There are no levels. Limits: [`crate::raim::rms`].

use super::agreement::Agreement;
use super::{
    ConfigureError, EpochMonitor, MonitorEpoch, MonitorVerdict, NoLevels, NotTested, Outcome,
};
use crate::consts::MAX_SATELLITES;
use crate::raim::exclusion::RowSet;
use crate::raim::rms::{self, RmsVariant};

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

/// RMS comparison, and its memory (10 kB).
#[derive(Clone, Debug)]
pub struct RmsMonitor {
    rule: Option<RmsRule>,
    agreement: Agreement,
    residuals: [f64; MAX_SATELLITES],
}

impl RmsMonitor {
    /// Not configured.
    pub const EMPTY: Self = Self {
        rule: None,
        agreement: Agreement::EMPTY,
        residuals: [0.0; MAX_SATELLITES],
    };

    /// What the rule takes out of the epoch tested last.
    fn named(&mut self, rule: RmsRule, redundancy: usize) -> Option<RowSet> {
        self.agreement.qr.residuals(&mut self.residuals);
        let residuals = self.residuals.get(..self.agreement.qr.n())?;
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
}

impl EpochMonitor for RmsMonitor {
    type Config = RmsConfig;

    fn configure(&mut self, config: &RmsConfig) -> Result<(), ConfigureError> {
        self.rule = None;
        self.agreement
            .configure(config.p_false_alarm, P_MISSED_DETECTION)?;
        self.rule = Some(config.rule);
        Ok(())
    }

    #[inline(never)]
    fn assess(&mut self, epoch: &MonitorEpoch<'_>) -> MonitorVerdict {
        let Some(rule) = self.rule else {
            return MonitorVerdict::not_tested(NotTested::NotConfigured);
        };
        let (statistic, threshold) = match self.agreement.test(epoch.model(), RowSet::EMPTY) {
            Ok(tested) => tested,
            Err(why) => return MonitorVerdict::not_tested(why),
        };
        let mut verdict = MonitorVerdict {
            outcome: Outcome::Passed,
            excluded: RowSet::EMPTY,
            position_enu_m: Some(self.agreement.position_enu_m()),
            levels: Err(NoLevels::NotOffered),
            statistic: Some(statistic.sum_of_squares),
            threshold: Some(threshold),
        };
        if statistic.passes(threshold) {
            return verdict;
        }
        verdict.outcome = Outcome::Detected;
        if let Some(named) = self.named(rule, statistic.redundancy)
            && let Ok((statistic, threshold)) = self.agreement.test(epoch.model(), named)
            && statistic.passes(threshold)
        {
            verdict.outcome = Outcome::Excluded;
            verdict.excluded = named;
            verdict.position_enu_m = Some(self.agreement.position_enu_m());
        }
        verdict
    }
}
