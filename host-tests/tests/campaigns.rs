//! Short seeded versions of the campaigns of the filter bank; in full: docs/campaigns.md.
//!
//! Seeds are fixed: a test gives the same counts on every machine.

use surefix_core::integrity::Phase;
use surefix_host_tests::campaign::double_faults::{
    ConstellationFaults, DURATION_S, DoubleFaults, ONSET_S,
};
use surefix_host_tests::campaign::false_alerts::{self, FalseAlerts, SATELLITES};
use surefix_host_tests::campaign::monte_carlo::{self, MonteCarlo};
use surefix_host_tests::campaign::outcome::{self, Campaign, Outcome, merge};
use surefix_host_tests::campaign::rig::BankModel;
use surefix_host_tests::campaign::seed_ramp::{FaultRecord, SeedRamp};
use surefix_host_tests::campaign::seed_sweep::{self, SeedSweep};
use surefix_host_tests::campaign::time_to_alert::{TimeToAlert, is_late};
use surefix_host_tests::faults::FaultKind;

fn run<C: Campaign>(trials: u64) -> Outcome<C::Record> {
    let outcome = outcome::run::<C>(1, trials, (0, 1)).unwrap();
    println!("{}", C::report(&outcome));
    outcome
}

/// The ramp of [P0] with three grades of unit, on the pseudorange alone and on both observables.
/// INT-040.
#[test]
fn the_ramp_of_the_seed_is_found_and_its_satellite_excluded() {
    let outcome = run::<SeedRamp>(4);
    assert_eq!(outcome.records.len(), 24);
    for record in outcome.of() {
        assert!(
            record.right && !record.wrong && !record.false_alert,
            "{record:?}"
        );
        assert_eq!((record.above_level, record.above_alerted_level), (0, 0));
        // Far from the 556 m of the alert limit, within the 10 s to alert of the phase.
        assert!(record.largest_usable_error_m < 40.0, "{record:?}");
        let limit_s = if record.on_range_rate { 15 } else { 22 };
        assert!(
            record.detection_s.is_some_and(|s| s <= limit_s),
            "{record:?}"
        );
        assert!(record.isolation_s.is_some_and(|s| s <= 40), "{record:?}");
    }
}

/// All kinds and sizes of faults on the same satellite.
/// INT-040.
#[test]
fn faults_of_every_kind_and_size_leave_no_usable_epoch_above_the_level() {
    let outcome = run::<SeedSweep>(2);
    for record in outcome.of() {
        let fault = &record.fault;
        assert!(!fault.wrong && !fault.false_alert, "{record:?}");
        assert_eq!(fault.above_level, 0, "{record:?}");
    }
    for (kind, magnitude) in [(FaultKind::Step, 20.0), (FaultKind::Ramp, 0.5)] {
        for fault in seed_sweep::of(&outcome, kind, magnitude, false) {
            assert!(fault.right, "{kind:?} {magnitude}: {fault:?}");
        }
    }
}

/// Of [P0]'s 8,000 points the first 2,400.
/// INT-041.
#[test]
fn no_fault_is_missed_and_no_healthy_satellite_excluded_at_points_all_over_the_earth() {
    let outcome = run::<MonteCarlo>(2400);
    let totals = monte_carlo::totals(outcome.of());
    assert_eq!(totals.points.iter().sum::<u64>(), 2400);
    assert_eq!(totals.flights, 20);
    let [_, timely, _, missed, false_alerts] = totals.points;
    assert!(timely > 500);
    assert_eq!((missed, false_alerts, totals.missed), (0, 0, [0; 2]));
    assert_eq!((totals.excluded[1], totals.usable[1]), (0, 0));
}

/// White noise taken for white at 1e-2; too few runs for what is rarer.
/// INT-042.
#[test]
fn false_alerts_are_as_frequent_as_allocated() {
    let white = false_alerts::cases()[0];
    let outcome = FalseAlerts::runs(1, 64, &[white]).unwrap();
    println!("{}", FalseAlerts::report(&outcome));
    for n in SATELLITES {
        false_alerts::check(&outcome, n, &white, &[1e-2]).unwrap();
    }
}

/// With noise correlated over any time taken for what the product takes it for.
/// INT-042.
#[test]
fn correlated_noise_raises_no_false_alerts_and_no_error_above_a_level() {
    let product = |case: &false_alerts::Case| case.bank == BankModel::PRODUCT;
    let cases: Vec<_> = false_alerts::cases().into_iter().filter(product).collect();
    assert_eq!(cases.len(), 6);
    let outcome = FalseAlerts::runs(1, 8, &cases).unwrap();
    println!("{}", FalseAlerts::report(&outcome));
    for case in &cases {
        for n in SATELLITES {
            false_alerts::check(&outcome, n, case, &false_alerts::P_FA).unwrap();
        }
    }
}

/// Pairs by both banks; a pair may stay an alert or undetected, but no position that may be used is worse
/// than its level, and no healthy satellite is excluded by itself.
/// INT-043.
#[test]
fn two_satellites_at_fault_leave_no_usable_epoch_above_the_level() {
    let outcome = run::<DoubleFaults>(10);
    for record in outcome.of() {
        let fate = &record.fate;
        assert!(!fate.false_alert && fate.healthy_out == 0, "{record:?}");
        assert_eq!(fate.usable[1], 0, "{record:?}");
    }
    let isolated = outcome.of().filter(|r| r.fate.faulty == [2, 2]).count();
    assert!(isolated * 10 >= outcome.records.len() * 8, "{isolated}");
}

/// The product's bank. A ramp of time that the offset between the constellations takes up raises no alert
/// and moves no position.
/// INT-044.
#[test]
fn a_constellation_at_fault_leaves_no_usable_epoch_above_the_level() {
    let outcome = run::<ConstellationFaults>(3);
    for record in outcome.of().filter(|r| r.bank == BankModel::PRODUCT) {
        assert_eq!(record.fate.usable[1], 0, "{record:?}");
        assert!(!record.fate.false_alert, "{record:?}");
        if record.fault == "Bds time 0.05 m/s" {
            let all = (DURATION_S - ONSET_S + 1) as u64;
            assert_eq!(record.fate.usable[0], all, "{record:?}");
        }
    }
}

/// Ramps on the hardest satellite at 40 places and times, with exclusion and without.
/// INT-064.
#[test]
fn in_every_phase_of_flight_a_ramp_is_told_before_its_error_passes_the_limit() {
    let outcome = run::<TimeToAlert>(40);
    for phase in Phase::ALL {
        let limit_s = phase.requirements().time_to_alert_s;
        let of = || outcome.of().filter(|r| r.phase == phase.name());
        // Without exclusion the error goes on past the limit: there was something to be told.
        let passed = of().filter(|r| r.available && !r.excludes && r.passed_s.is_some());
        assert!(passed.count() >= 20, "{phase:?}");
        for record in of().filter(|r| r.available) {
            assert_eq!(is_late(record, limit_s), [false; 2], "{record:?}");
            assert!(record.told_s.is_some(), "{record:?}");
            assert!(record.largest_usable < 1.0, "{record:?}");
            assert!(!record.wrong && record.above_level == 0, "{record:?}");
        }
        assert!(of().all(|r| !r.false_alert));
    }
}

#[test]
fn shards_together_are_the_whole() {
    let whole: Outcome<FaultRecord> = outcome::run::<SeedRamp>(7, 3, (0, 1)).unwrap();
    let shards = [0, 1].map(|k| outcome::run::<SeedRamp>(7, 3, (k, 2)).unwrap());
    assert_eq!(merge(&shards).unwrap().records, whole.records);
    assert!(merge(&[shards[0].clone(), shards[0].clone()]).is_err());
}
