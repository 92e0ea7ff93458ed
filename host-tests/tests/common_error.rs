//! An error common to all satellites shows in no residual. Where it is large enough to carry the
//! position over its level, the monitor must not call the position usable.

mod common;

use nalgebra::Vector3;
use surefix_core::budget::{Ledger, NoCounter};
use surefix_core::config::Config;
use surefix_core::consts::SPEED_OF_LIGHT_MPS;
use surefix_core::frames::geodesy;
use surefix_core::gnss::satellite::SystemSet;
use surefix_core::gnss::{BroadcastIonosphere, EphemerisStore, ObservationEpoch, System};
use surefix_core::snapshot::SnapshotMonitor;
use surefix_host_tests::source::{Item, Recording};

/// Puts a step on every pseudorange of the chosen systems.
fn shifted(epoch: &ObservationEpoch, step_m: f64, systems: SystemSet) -> ObservationEpoch {
    let mut shifted = epoch.clone();
    for observation in &mut shifted.satellites {
        if systems.contains(observation.satellite.system()) {
            for signal in &mut observation.signals {
                signal.pseudorange_m = signal.pseudorange_m.map(|range_m| range_m + step_m);
            }
        }
    }
    shifted
}

/// INT-011. Steps of 1 µs to 100 ms on all satellites, and on those of one constellation, at 96 times
/// of a real day.
#[test]
fn no_common_step_gives_a_usable_position_with_its_error_above_a_level() {
    let folder = "data/esbc-2020-177/ESBC00DNK_R_20201770000_01D_";
    let (Some(gnss), Some(nav)) = (
        common::shared(&format!("{folder}30S_MO.crx.gz")),
        common::shared(&format!("{folder}MN.rnx.gz")),
    ) else {
        return;
    };
    let gps = SystemSet::EMPTY.with(System::Gps);
    let gps_bds = gps.with(System::Bds);
    for systems in [gps, gps_bds, SystemSet::ALL] {
        let config = Config {
            systems,
            ..Config::PRESET
        };
        let recording = Recording::read(&gnss, std::slice::from_ref(&nav), &config).unwrap();
        let truth_e = Vector3::from(recording.info.station.as_ref().unwrap().0);
        let llh = geodesy::to_llh(&truth_e).unwrap();
        let c_enu_e = geodesy::c_enu_e(llh.lat_rad, llh.lon_rad);
        let mut monitor = Box::new(SnapshotMonitor::EMPTY);
        monitor.configure(&config).unwrap();
        let mut store = Box::new(EphemerisStore::EMPTY);
        let mut ionosphere = BroadcastIonosphere::EMPTY;
        let (mut trials, mut usable, mut worst, mut number) = (0, 0, 0.0_f64, 0);
        for item in &recording.items {
            let epoch = match item {
                Item::Ephemeris(ephemeris) => {
                    let _ = store.insert(ephemeris);
                    continue;
                }
                Item::Klobuchar(parameters) => {
                    ionosphere.insert(*parameters);
                    continue;
                }
                Item::Epoch(epoch) => epoch,
                Item::ForFilter(_) => continue,
            };
            number += 1;
            if number % 30 != 0 {
                continue;
            }
            for step_s in [1e-6, 1e-5, 1e-4, 1e-3, -1e-3, 3e-3, 1e-2, -1e-2, 3e-2, 1e-1] {
                for faulty in [systems, gps] {
                    let epoch = shifted(epoch, step_s * SPEED_OF_LIGHT_MPS, faulty);
                    let assessment = monitor.assess(
                        &epoch,
                        &store,
                        &ionosphere,
                        &mut Ledger::EMPTY.clone(),
                        &mut NoCounter,
                    );
                    trials += 1;
                    let verdict = &assessment.verdict;
                    if !verdict.integrity.is_usable() {
                        continue;
                    }
                    usable += 1;
                    let solution = assessment.solution.unwrap();
                    let error = c_enu_e * (Vector3::from(solution.r_e_m) - truth_e);
                    let ratio_h = error.x.hypot(error.y) / verdict.hpl.bound_m().unwrap();
                    let ratio_v = error.z.abs() / verdict.vpl.bound_m().unwrap();
                    worst = worst.max(ratio_h).max(ratio_v);
                    assert!(
                        worst < 1.0,
                        "step {step_s} s on {faulty:?} of {systems:?} at {:?}: {ratio_h}, {ratio_v}",
                        epoch.time
                    );
                }
            }
        }
        eprintln!("{systems:?}: {trials} trials, {usable} usable, largest error/level {worst:.2}");
        assert_eq!(number, 2880);
        // A millisecond is what receivers jump by: it must stay usable.
        assert!(usable > trials / 5 && usable < trials);
    }
}
