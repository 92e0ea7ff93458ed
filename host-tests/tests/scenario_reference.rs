//! The reference model against the reference results of ../shared/scenarios.

mod common;

use surefix_host_tests::reference;
use surefix_host_tests::scenario::{ResultFile, Scenario};

/// Scenarios that must be there.
const SCENARIOS: [&str; 7] = [
    "coast_nav_3",
    "flight004_mems_step",
    "flight004_nav",
    "npa_tac_ramp",
    "seed000_ramp_rr_tac",
    "seed000_ramp_tac",
    "static_perfect",
];

/// Ten to a hundred times what was measured, and far below what the core must keep.
#[test]
fn the_reference_model_gives_the_reference_results() {
    let Some(folder) = common::shared("scenarios") else {
        return;
    };
    for name in SCENARIOS {
        let scenario = Scenario::read(&folder.join(name)).unwrap();
        let expected = ResultFile::read(&folder.join(name).join("reference/result.csv")).unwrap();
        let largest = reference::run(&scenario).compare(&expected).unwrap();
        println!("{name}: {largest:?}");
        assert!(largest.position_m < 1e-4, "{name}");
        assert!(largest.velocity_mps < 1e-4, "{name}");
        assert!(largest.attitude_rad < 1e-5, "{name}");
        assert!(largest.clock_bias_m < 1e-4, "{name}");
        assert!(largest.clock_drift_mps < 1e-4, "{name}");
        assert!(largest.hpl0_relative < 1e-5, "{name}");
    }
}
