//! Short seeded versions of the campaigns of the filter bank; in full: docs/campaigns.md.
//!
//! Seeds are fixed: a test gives the same counts on every machine.

use surefix_host_tests::campaign::outcome::{self, Campaign, Outcome, merge};
use surefix_host_tests::campaign::seed_ramp::{FaultRecord, SeedRamp};

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

#[test]
fn shards_together_are_the_whole() {
    let whole: Outcome<FaultRecord> = outcome::run::<SeedRamp>(7, 3, (0, 1)).unwrap();
    let shards = [0, 1].map(|k| outcome::run::<SeedRamp>(7, 3, (k, 2)).unwrap());
    assert_eq!(merge(&shards).unwrap().records, whole.records);
    assert!(merge(&[shards[0].clone(), shards[0].clone()]).is_err());
}
