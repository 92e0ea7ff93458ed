//! In the board's own time: answers are there before the next epoch is, and one that is not says so.

use surefix_core::integrity::{InertialStatus, Mode, Reason};
use surefix_core::report::EpochReport;
use surefix_host_tests::qemu::image;
use surefix_host_tests::real_time::{self, Args, Outcome, Silence};

/// A flight through the board; `None`, said aloud, where there is no emulator.
fn fly(args: &Args) -> Option<Outcome> {
    if let Some(missing) = image::missing() {
        eprintln!("SKIPPED: {missing}");
        return None;
    }
    let outcome = real_time::fly(args, &mut |_| {}).unwrap();
    println!("{outcome}\n{:#?}", outcome.log);
    Some(outcome)
}

/// INT-008, INT-007. The short form of `surefix real-time`.
#[test]
fn no_deadline_is_missed_and_the_bytes_are_those_of_this_machine() {
    let Some(outcome) = fly(&Args {
        minutes: 0.4,
        ..Args::default()
    }) else {
        return;
    };
    assert!(outcome.holds());
    assert_eq!(outcome.reports.len(), 241);
    let tight = |report: &&EpochReport| report.mode == Mode::Tight;
    assert!(outcome.reports.iter().filter(tight).count() > 230);
    let with_24 = outcome.in_bank.iter().filter(|n| **n == 24).count();
    assert!(with_24 > 200, "{with_24}");
    assert_eq!(outcome.bytes_lost, 0);
}

/// INT-008.
#[test]
fn with_a_tenth_of_the_clock_pairs_are_shed_and_nothing_is_usable() {
    let Some(outcome) = fly(&Args {
        minutes: 0.2,
        slow: true,
        ..Args::default()
    }) else {
        return;
    };
    assert!(outcome.holds());
    // The filters of the pairs are shed, so that the board keeps up and loses no byte. What is left is over
    // the budgets of its stages, and every report says so.
    assert_eq!(outcome.bytes_lost, 0);
    assert!(outcome.pairs_dropped > 100, "{}", outcome.pairs_dropped);
    assert_eq!(outcome.withdrawn(), outcome.reports.len());
    assert_eq!(outcome.deadline_misses as usize, outcome.reports.len());
}

/// INT-150. Receiver and inertial unit fall silent together: no byte says so, the board's clock does.
#[test]
fn int_150_a_silent_line_is_told_within_an_interval_by_the_boards_own_clock() {
    let silence = Silence {
        from_s: 6.0,
        to_s: 9.0,
    };
    let Some(outcome) = fly(&Args {
        minutes: 0.25,
        no_galileo: true,
        silence: Some(silence),
        ..Args::default()
    }) else {
        return;
    };
    assert!(outcome.holds());
    let told = outcome.of_silence();
    assert!((29..=31).contains(&told.len()), "{}", told.len());
    assert_eq!(told.last().unwrap().inertial, InertialStatus::ImuSilent);
    // Half an interval after it was due, and what the timer and the work take.
    let silent = outcome.reports.iter().zip(&outcome.ages_s);
    let silent = silent.filter(|(report, _)| report.verdict.reason == Reason::ReceiverSilent);
    for (report, age_s) in silent {
        assert!((0.05..0.075).contains(age_s), "{report:?} {age_s}");
    }
    let after = outcome.reports.last().unwrap();
    assert!(after.verdict.integrity.is_usable(), "{after:?}");
}
