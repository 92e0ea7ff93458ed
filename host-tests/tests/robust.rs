//! Claims: with two faulty satellites robust estimation keeps the position and the vertical level where they
//! were; least squares does neither; how often the reconstructed level fails to bound is what the
//! documentation says.
//!
//! The short form of `surefix campaign robust`: four hours instead of the day, four trials.

mod common;

use surefix_core::config::Config;
use surefix_host_tests::campaign::robust::{self, RobustResult, recordings, report};

const TRIALS: u64 = 4;
const SEED: u64 = 1;

/// INT-136.
#[test]
fn int_136_robust_estimation_restores_position_and_level_and_its_failures_are_counted() {
    let Some(data) = common::shared("data") else {
        return;
    };
    let subjects = recordings::subjects(&data, &Config::PRESET, SEED, true).unwrap();
    let result = RobustResult {
        campaign: "robust",
        seed: SEED,
        trials: TRIALS,
        subjects: subjects
            .iter()
            .map(|subject| robust::assess(subject, TRIALS, SEED))
            .collect(),
    };
    let tables = report::tables(&result);
    eprintln!("{tables}");
    assert_eq!(result.subjects.len(), 3);
    for subject in &result.subjects {
        let name = &subject.recording;
        let [printed, _, robust_printed, robust, _] = &subject.methods[..] else {
            panic!("five methods");
        };
        // Position: in the epochs with a fault, up.
        let before = printed.accuracy_with_fault.rms_m[2];
        let after = robust.accuracy_with_fault.rms_m[2];
        assert!(after < 0.5 * before, "{name}: {before} m, {after} m");
        // Level: faults carry least squares over the limit, robust estimation is within it.
        let share =
            |counts: &robust::Counts| counts.vertical_within as f64 / counts.epochs.max(1) as f64;
        assert!(share(&robust.faulted) > share(&printed.faulted), "{name}");
        assert!(share(&robust.healthy) > 0.9, "{name}");
        // Every epoch has one of the outcomes.
        for counts in [&robust.healthy, &robust.faulted, &robust_printed.faulted] {
            assert_eq!(
                counts.epochs,
                counts.solved + counts.breakdown + counts.not_converged
            );
            assert!(counts.bounded + counts.outlier_kept <= counts.solved);
            assert!(counts.above_level <= counts.above_hpl + counts.above_vpl);
        }
        // Without a fault the corrected level bounds.
        assert_eq!(robust.healthy.above_level, 0, "{name}");
        // A level that grows with the fault before, and hardly after.
        let last = subject.sweep.last().unwrap();
        let before = last.vpl_m[0].unwrap();
        assert!(before > robust::VERTICAL_LIMIT_M, "{name}");
        assert!(last.vpl_m[3].unwrap() < 0.5 * before, "{name}");
    }
    let svg = report::figure(&result);
    assert_eq!(svg.matches("class=\"title\"").count(), 6);
    assert!(!svg.contains("NaN"));
}

#[test]
fn windows_of_a_short_recording_are_those_of_the_day_scaled() {
    assert_eq!(robust::windows(2880), robust::WINDOWS);
    assert_eq!(robust::windows(1808), robust::WINDOWS);
    assert_eq!(robust::windows(480), [[91, 108], [285, 302]]);
    let [[_, _], [_, last]] = robust::windows(100);
    assert!(last <= 100);
}
