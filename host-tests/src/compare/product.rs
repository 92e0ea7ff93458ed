//! surefix itself in the comparison: a replay of the same recording with the same faults.
//!
//! It is no monitor of one epoch alone: it remembers whom it excluded and holds an alert, and with an inertial unit its
//! filters remember more. So it takes part where a recording runs from its beginning to its end, and not in a
//! sweep, whose trials are single epochs. Its faults are on the pseudoranges. What it says of epochs without a fault is
//! counted from a replay without any: after a fault it keeps the satellite out for a while, which is no false alert.

use std::collections::BTreeMap;

use anyhow::{Context, Result};
use surefix_core::gnss::SatelliteSet;
use surefix_core::integrity::{Integrity, Mode, NoBound, ProtectionLevel, Reason, Verdict};
use surefix_core::raim::monitors::MonitorLevels;

use super::counts::{Answer, Said};
use super::subject::Subject;
use crate::faults::FaultSpec;
use crate::replay::{self, ReplayOptions, TruthChoice};

/// Its name on the command line and in files.
pub const NAME: &str = "surefix";
/// In `epochs.csv`, its replay without the faults of the command line.
pub const CLEAN_NAME: &str = "surefix_clean";

/// What it said, and what it was.
pub struct Product {
    /// In tables.
    pub title: &'static str,
    /// Of each epoch of the subject.
    pub said: Vec<Said>,
}

/// Replays the recording with these faults.
///
/// # Errors
/// As [`replay::run`].
pub fn run(
    options: &ReplayOptions,
    faults: &[FaultSpec],
    subject: &Subject,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<Product> {
    let mut options = options.clone();
    options.faults = faults.to_vec();
    options.truth = match &subject.truth {
        Some(truth) => TruthChoice::Given(truth.clone()),
        None => TruthChoice::FromRecording,
    };
    let result = replay::run(&options, &mut |reports, all| {
        progress(reports.len() as u64, all);
    })
    .context("replay for the row \"surefix\"; --monitors leaves it out")?;
    let mut by_time: BTreeMap<i64, Said> = BTreeMap::new();
    for (report, error_enu_m) in result.reports.iter().zip(&result.errors_enu_m) {
        let said = said(&report.verdict, report.fix.is_some(), *error_enu_m);
        by_time.insert(report.time.ns(), said);
    }
    let is_tight = result
        .reports
        .iter()
        .any(|report| report.mode == Mode::Tight);
    Ok(Product {
        title: if is_tight {
            "surefix, filter bank and snapshot"
        } else {
            "surefix, snapshot"
        },
        said: subject
            .epochs
            .iter()
            .map(|epoch| by_time.remove(&epoch.linearised.time.ns()))
            .map(|said| said.unwrap_or_else(|| Said::nothing("no_report")))
            .collect(),
    })
}

/// Why a position that was tested has no level, in the words of the monitors beside it where they have one.
const fn no_bound(why: NoBound) -> &'static str {
    match why {
        NoBound::NoPosition => "no_position",
        NoBound::NoRedundancy => "no_redundancy",
        NoBound::Untestable => "untestable",
        NoBound::FaultPresent => "fault_present",
        NoBound::NotFinite => "not_finite",
        NoBound::DeadlineMissed => "deadline_missed",
        NoBound::RiskSpent => "no_integrity_budget",
        NoBound::AlertHeld => "alert_held",
        NoBound::NoRawData => "no_raw_data",
    }
}

fn said(verdict: &Verdict, has_position: bool, error_enu_m: Option<[f64; 3]>) -> Said {
    // A level above its limit, or none, is no matter of the test: the monitors beside it know no limits.
    let is_tested = matches!(
        verdict.reason,
        Reason::HplAboveLimit | Reason::VplAboveLimit
    );
    let levels = match (verdict.hpl, verdict.vpl) {
        (ProtectionLevel::Bound(hpl_m), ProtectionLevel::Bound(vpl_m)) => {
            Ok(MonitorLevels { hpl_m, vpl_m })
        }
        (ProtectionLevel::Unavailable(why), _) | (_, ProtectionLevel::Unavailable(why))
            if is_tested =>
        {
            Err(no_bound(why))
        }
        _ => Err(verdict.reason.name()),
    };
    let answer = match verdict.integrity {
        Integrity::Alert => Answer::Detected,
        _ if !has_position && is_tested => Answer::NotTested("no_position"),
        _ if !has_position => Answer::NotTested(verdict.reason.name()),
        Integrity::Excluded => Answer::Excluded,
        Integrity::Nominal => Answer::Passed,
        Integrity::Unavailable if levels.is_err() && !is_tested => {
            Answer::NotTested(verdict.reason.name())
        }
        Integrity::Unavailable if verdict.excluded.is_empty() => Answer::Passed,
        Integrity::Unavailable => Answer::Excluded,
    };
    Said {
        answer,
        excluded: verdict.excluded,
        not_in_use: SatelliteSet::EMPTY,
        error_enu_m,
        levels,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(reason: Reason, hpl: ProtectionLevel) -> Said {
        let verdict = Verdict {
            integrity: Integrity::Unavailable,
            reason,
            hpl,
            vpl: ProtectionLevel::Bound(9.0),
            hal_m: 40.0,
            val_m: None,
            excluded: SatelliteSet::EMPTY,
            statistic: Some(1.0),
            threshold: Some(2.0),
        };
        said(&verdict, true, None)
    }

    #[test]
    fn a_level_above_its_limit_or_missing_is_no_test_that_was_not_done() {
        let above = of(Reason::HplAboveLimit, ProtectionLevel::Bound(50.0));
        assert_eq!(above.answer, Answer::Passed);
        assert_eq!(above.levels.unwrap().hpl_m, 50.0);
        let untestable = ProtectionLevel::Unavailable(NoBound::Untestable);
        let missing = of(Reason::HplAboveLimit, untestable);
        assert_eq!(
            (missing.answer, missing.levels),
            (Answer::Passed, Err("untestable"))
        );
        let not_tested = of(Reason::NoRedundancy, untestable);
        assert_eq!(not_tested.answer, Answer::NotTested("no_redundancy"));
        assert_eq!(not_tested.levels, Err("no_redundancy"));
    }
}
