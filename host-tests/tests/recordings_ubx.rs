//! Recordings of u-blox receivers, replayed whole from their own bytes.

mod common;

use std::path::PathBuf;

use surefix_core::config::{Config, IonosphereModel};
use surefix_core::gnss::System;
use surefix_core::gnss::satellite::SystemSet;
use surefix_core::integrity::Integrity;
use surefix_host_tests::replay::{self, ReplayOptions, ReplayResult, TruthChoice};
use surefix_host_tests::truth::Truth;

/// Where the simulator of the recording put the antenna.
const SPIRENT_AT_M: [f64; 3] = [-481_819.313_5, 5_507_219.953_8, 3_170_373.735_4];

fn spirent() -> Option<PathBuf> {
    common::shared(
        "data/instinct-spirent-f9p-ubx/Spirent_ublox-F9P_static_duration-15min_sys-GPS-GAL_iono-Klobuchar_tropo-Saastamoinen.ubx",
    )
}

fn run(options: &ReplayOptions) -> ReplayResult {
    replay::run(options, &mut |_, _| {}).unwrap()
}

/// Errors horizontal and vertical from `from_s` on, each in order.
fn errors_from(result: &ReplayResult, truth: &Truth, from_s: f64) -> [Vec<f64>; 2] {
    let mut errors = [Vec::new(), Vec::new()];
    for report in &result.reports {
        let Some(fix) = report.fix else { continue };
        let since_s = report.since_first_ns as f64 / 1e9;
        let Some(at) = truth
            .at(report.time, report.since_first_ns)
            .filter(|_| since_s >= from_s)
        else {
            continue;
        };
        let [e, n, u] = Truth::error_enu_m(at, fix.r_e_m).unwrap();
        errors[0].push(e.hypot(n));
        errors[1].push(u.abs());
    }
    errors
        .iter_mut()
        .for_each(|list| list.sort_by(f64::total_cmp));
    errors
}

fn percentile_95(sorted: &[f64]) -> f64 {
    sorted[sorted.len() * 95 / 100]
}

/// No usable position whose error is above its level.
fn assert_bounded(result: &ReplayResult) {
    assert_eq!(
        result
            .summary
            .errors
            .epochs_with_error_above_level_and_usable,
        0
    );
}

/// INT-052.
#[test]
fn a_walk_is_positioned_once_four_ephemerides_are_complete() {
    let Some(walk) = common::shared("data/walk0827-x20p-imu/gnss_1730.ubx") else {
        return;
    };
    let mut options = ReplayOptions::new(walk.clone());
    options.truth = TruthChoice::Given(Truth::read(&walk).unwrap());
    let result = run(&options);
    let summary = &result.summary;
    let first = result
        .reports
        .iter()
        .position(|report| report.fix.is_some())
        .unwrap();
    eprintln!(
        "walk: {} of {} positions, the first after {} s; H95 {:.2}, V95 {:.2} m against RTK; largest error/level {:.2}, {:.2}; {:?}",
        summary.epochs_with_position,
        summary.epochs,
        first as f64 / 4.0,
        summary.errors.h95_m.unwrap(),
        summary.errors.v95_m.unwrap(),
        summary.errors.largest_error_over_hpl.unwrap(),
        summary.errors.largest_error_over_vpl.unwrap(),
        summary.integrity,
    );
    assert_eq!(summary.epochs, 536);
    // From the first position on every epoch has one; until then ephemerides are what lacks.
    assert!(
        result.reports[first..]
            .iter()
            .all(|report| report.fix.is_some())
    );
    assert!(first < 4 * 32, "{first}");
    assert!(summary.errors.h95_m.unwrap() < 10.0 && summary.errors.v95_m.unwrap() < 12.0);
    assert_eq!(summary.errors.epochs_with_error_above_level, 0);
    assert_eq!((summary.alerts, summary.exclusions.len()), (0, 0));
    assert!(!result.lost_epochs());
}

/// INT-052.
#[test]
fn a_simulator_s_sky_is_positioned_within_a_metre_and_acquisition_never_misleads() {
    let Some(spirent) = spirent() else { return };
    let truth = Truth::fixed(SPIRENT_AT_M, "simulator");
    let gps = SystemSet::EMPTY.with(System::Gps);
    for (name, systems, ionosphere, mask_deg, from_s, h95_m) in [
        (
            "GPS, 5 degrees",
            gps,
            IonosphereModel::Klobuchar,
            5.0_f64,
            0.0,
            Some(1.0),
        ),
        (
            "two frequencies, 5 degrees",
            SystemSet::ALL,
            IonosphereModel::IonosphereFree,
            5.0,
            0.0,
            Some(1.0),
        ),
        (
            "GPS, 10 degrees",
            gps,
            IonosphereModel::Klobuchar,
            10.0,
            0.0,
            None,
        ),
        (
            "all on one frequency",
            SystemSet::ALL,
            IonosphereModel::Klobuchar,
            10.0,
            0.0,
            None,
        ),
    ] {
        let mut options = ReplayOptions::new(spirent.clone());
        options.truth = TruthChoice::Given(truth.clone());
        options.config = Config {
            systems,
            ionosphere,
            mask_rad: mask_deg.to_radians(),
            ..Config::PRESET
        };
        let result = run(&options);
        let [h, v] = errors_from(&result, &truth, from_s);
        eprintln!(
            "Spirent, {name}: {} positions, H95 {:.2}, V95 {:.2}, largest {:.2} m; {:?}",
            h.len(),
            percentile_95(&h),
            percentile_95(&v),
            h[h.len() - 1],
            result.summary.integrity,
        );
        // Of 1644 messages 44 are from before the time is known.
        assert_eq!(
            (result.summary.epochs, result.counters.rawx_without_week),
            (1600, 44)
        );
        assert!(h.len() > 900, "{name}");
        assert!(
            h95_m.is_none_or(|limit| percentile_95(&h) <= limit),
            "{name}"
        );
        assert_bounded(&result);
        let far = result.reports.iter().filter(|report| {
            report.verdict.integrity.is_usable()
                && report.fix.is_some_and(|fix| {
                    let [e, n, u] = Truth::error_enu_m(SPIRENT_AT_M, fix.r_e_m).unwrap();
                    e.hypot(n).max(u.abs()) > 25.0
                })
        });
        assert_eq!(far.count(), 0, "{name}: a usable position far off");
    }
}

/// INT-052.
#[test]
fn a_cold_start_gives_epochs_from_the_first_known_week_to_a_cut_off_frame() {
    let Some(recording) = common::shared(
        "data/besancon-f9-coldstart-nominal/16dBatt_no_interference_coldstart.ubx.gz",
    ) else {
        return;
    };
    let result = run(&ReplayOptions::new(recording));
    let counters = &result.counters;
    assert_eq!((counters.rawx_without_week, counters.rawx_used), (20, 562));
    // The file ends within a frame.
    let losses: Vec<_> = result.losses.iter().collect();
    assert_eq!(result.losses.get("cut_off_frames"), Some(&1), "{losses:?}");
    assert!(
        !result.losses.contains_key("ubx_bad_checksum"),
        "{losses:?}"
    );
    let weeks: Vec<i32> = result
        .reports
        .iter()
        .map(|report| report.time.week())
        .collect();
    assert!(weeks.iter().all(|week| *week == 2363), "no epoch of week 0");
    let ascending = result.reports.is_sorted_by(|a, b| a.time < b.time);
    assert!(
        ascending
            && result
                .reports
                .iter()
                .all(|report| !report.flags.week_unknown)
    );
    let with_position = result
        .reports
        .iter()
        .filter(|report| report.fix.is_some())
        .count();
    let count = |integrity| {
        let reports = result.reports.iter();
        reports
            .filter(|report| report.verdict.integrity == integrity)
            .count()
    };
    eprintln!(
        "Besancon: {} epochs, {with_position} positions, {} nominal, {} excluded, {} alert, {} unavailable",
        weeks.len(),
        count(Integrity::Nominal),
        count(Integrity::Excluded),
        count(Integrity::Alert),
        count(Integrity::Unavailable),
    );
    assert!(with_position > 540);
    // GPS pseudoranges of this receiver saw up and down by 15 m, each satellite for itself.
    assert!(count(Integrity::Alert) > 0);
}
