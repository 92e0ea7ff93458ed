//! Claims: on recordings ARAIM raises no alert without a fault and bounds the error; a satellite wrong by 30 m or more
//! is excluded or alerted, or harms nobody; so is a whole constellation.
//!
//! The short form of `surefix campaign araim`: four hours of the day, faults in 60 epochs.

mod common;

use surefix_core::config::Config;
use surefix_host_tests::campaign::araim::{self, report};

const SEED: u64 = 1;
const FAULTED_EPOCHS: u64 = 60;

/// INT-146.
#[test]
fn int_146_araim_on_recordings_raises_no_alert_without_a_fault_and_lets_none_do_harm() {
    let Some(data) = common::shared("data") else {
        return;
    };
    let result = araim::assess(&data, &Config::PRESET, FAULTED_EPOCHS, SEED, true).unwrap();
    println!("{}", report::tables(&result));
    assert_eq!(result.results.len(), 20);
    for of in &result.results {
        let name = format!("{} {} {}", of.recording, of.systems, of.setup);
        let healthy = &of.healthy;
        assert_eq!(healthy.not_tested, 0, "{name}");
        assert_eq!(healthy.above_level, 0, "{name}");
        // The baseline takes 0.5 m for an orbit and smoothed code: one epoch of these fails it.
        let least = if of.setup.starts_with("baseline") {
            healthy.epochs - healthy.epochs / 100
        } else {
            healthy.epochs
        };
        assert!(healthy.passed >= least, "{name}: {}", healthy.passed);
        let dual = of.setup != "one frequency, broadcast accuracy";
        for fault in &of.faulted {
            let (counts, name) = (&fault.counts, format!("{name} {}", fault.fault));
            assert_eq!(counts.above_level, 0, "{name}");
            assert_eq!(counts.excluded_wrong, 0, "{name}");
            if dual {
                assert_eq!(counts.passed, 0, "{name}");
            }
            if dual && !of.setup.ends_with("detection only") {
                let right = counts.excluded + counts.excluded_more;
                assert!(right * 10 >= counts.epochs * 9, "{name}: {right}");
            }
        }
        if dual && of.systems == "GE" {
            assert!(healthy.available * 4 > healthy.epochs * 3, "{name}");
        }
    }
}
