//! The loosely coupled filter on recordings: a drive through simulated outages against its RTK track, and a
//! walk whose receiver's observations are taken out of the stream. The tables of docs/recordings.md come from
//! here:
//!
//! ```text
//! cargo test -p surefix-host-tests --test recordings_loose -- --nocapture --test-threads 1
//! ```

mod common;

use std::path::{Path, PathBuf};

use surefix_core::config::Config;
use surefix_core::ins::BarometerModel;
use surefix_core::integrity::{InertialStatus, Integrity, Mode, Reason};
use surefix_core::wire::ubx;
use surefix_host_tests::aiding::{self, Air};
use surefix_host_tests::fixes::{self, Outage};
use surefix_host_tests::output;
use surefix_host_tests::replay::{self, ReplayOptions, ReplayResult, TruthChoice};
use surefix_host_tests::settings::Settings;
use surefix_host_tests::truth::Truth;

const DRIVE: &str = "data/drive0708-adis16465-rtk";
const WALK: &str = "data/walk0827-x20p-imu";

/// Length of an outage, s.
const OUTAGE_S: f64 = 10.0;
/// Errors are told so long after the last fix, s.
const AFTER_S: [f64; 4] = [1.0, 2.0, 5.0, 10.0];
/// Between fixes of both recordings, s.
const FIX_S: f64 = 0.25;

fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../docs/examples")
        .join(name)
}

/// A recording of fixes and samples, with what a configuration file says of the unit.
fn recording(gnss: PathBuf, imu: PathBuf, settings: &str, truth: &Path) -> ReplayOptions {
    let settings = Settings::read(&example(settings)).unwrap();
    let mut options = ReplayOptions::new(gnss);
    options.config = Config {
        phase: options.config.phase,
        ..settings.config().unwrap()
    };
    options.imu = vec![imu];
    options.imu_settings = settings.imu;
    options.truth = TruthChoice::Given(Truth::read(truth).unwrap());
    options
}

fn drive() -> Option<ReplayOptions> {
    let track = common::shared(&format!("{DRIVE}/gnss_1934_sf.pos"))?;
    let imu = common::shared(&format!("{DRIVE}/derived_imu_gpst_unfiltered.csv"))?;
    Some(recording(track.clone(), imu, "car-adis16465.toml", &track))
}

/// The walk's receiver without RXM-RAWX and RXM-SFRBX: as one that sends NAV-PVT only.
fn walk() -> Option<ReplayOptions> {
    let gnss = common::shared(&format!("{WALK}/gnss_1730.ubx"))?;
    let imu = common::shared(&format!("{WALK}/derived_imu_gpst_unfiltered.csv"))?;
    let bytes = std::fs::read(&gnss).unwrap();
    let (mut kept, mut rest) = (Vec::new(), &bytes[..]);
    while !rest.is_empty() {
        let length = match ubx::Frame::parse(rest) {
            Ok((frame, length)) => {
                if ![ubx::RXM_RAWX, ubx::RXM_SFRBX].contains(&frame.message) {
                    kept.extend_from_slice(&rest[..length]);
                }
                length
            }
            Err(_) => {
                kept.push(rest[0]);
                1
            }
        };
        rest = &rest[length..];
    }
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("walk_nav_pvt.ubx");
    std::fs::write(&path, kept).unwrap();
    Some(recording(path, imu, "walk-adis16465.toml", &gnss))
}

/// Horizontal and vertical error and sigma of an epoch, m.
#[derive(Clone, Copy, Debug)]
struct Errors {
    error_m: [f64; 2],
    sigma_m: [f64; 2],
}

/// The epoch at a time since the first, which is as the fixes are, to a few ms.
fn at(result: &ReplayResult, t_s: f64) -> Option<Errors> {
    let k = result
        .reports
        .iter()
        .position(|report| (output::t_s(report) - t_s).abs() < 0.02)?;
    let [e, n, u] = result.errors_enu_m[k]?;
    let report = &result.reports[k];
    assert_eq!(report.mode, Mode::Loose);
    let [sigma_e, sigma_n, sigma_u] = report.sigma_enu_m?;
    Some(Errors {
        error_m: [e.hypot(n), u.abs()],
        sigma_m: [sigma_e.hypot(sigma_n), sigma_u],
    })
}

/// Root mean square, largest and sigma of an axis over the outages.
fn summary(all: &[Errors], axis: usize) -> [f64; 3] {
    let rms = |of: &dyn Fn(&Errors) -> f64| {
        (all.iter().map(|e| of(e).powi(2)).sum::<f64>() / all.len() as f64).sqrt()
    };
    let largest = all.iter().map(|e| e.error_m[axis]).fold(0.0, f64::max);
    [
        rms(&|e| e.error_m[axis]),
        largest,
        rms(&|e| e.sigma_m[axis]),
    ]
}

/// Errors after each time without fixes, as a table; outages of [`OUTAGE_S`] that begin at these times.
fn through_outages(mut options: ReplayOptions, from_s: &[f64]) -> Vec<Vec<Errors>> {
    options.fixes.outages = from_s
        .iter()
        .map(|from_s| Outage {
            from_s: from_s - 0.5 * FIX_S,
            to_s: from_s + OUTAGE_S - 0.5 * FIX_S,
        })
        .collect();
    let result = replay::run(&options, &mut |_, _| {}).unwrap();
    for report in &result.reports {
        assert_eq!(report.verdict.integrity, Integrity::Unavailable);
    }
    let withheld = result
        .reports
        .iter()
        .filter(|report| report.verdict.reason == Reason::ReceiverSilent)
        .count();
    assert!(withheld >= from_s.len() * (OUTAGE_S / FIX_S) as usize);
    eprintln!("| after, s | horizontal rms, m | max | sigma | vertical rms, m | max | sigma |");
    let table: Vec<Vec<Errors>> = AFTER_S
        .iter()
        .map(|after_s| {
            let all: Vec<Errors> = from_s
                .iter()
                .map(|from_s| at(&result, from_s + after_s - FIX_S).expect("coasts"))
                .collect();
            let [h, v] = [summary(&all, 0), summary(&all, 1)];
            eprintln!(
                "| {after_s} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} |",
                h[0], h[1], h[2], v[0], v[1], v[2]
            );
            all
        })
        .collect();
    table
}

/// INT-121. Ten outages of a drive: the error against the withheld RTK positions is within four sigma, and
/// small.
#[test]
fn int_121_a_drive_coasts_through_ten_outages() {
    let Some(options) = drive() else {
        return;
    };
    let from_s: Vec<f64> = (0..10).map(|k| 60.0 + 45.0 * f64::from(k)).collect();
    let table = through_outages(options, &from_s);
    for all in &table {
        for errors in all {
            for axis in 0..2 {
                let (error_m, sigma_m) = (errors.error_m[axis], errors.sigma_m[axis]);
                assert!(error_m < 4.0 * sigma_m, "{errors:?}");
            }
        }
    }
    for (all, [h_m, v_m]) in table
        .iter()
        .zip([[0.15, 0.05], [0.3, 0.1], [1.3, 0.25], [5.0, 0.8]])
    {
        let [[h, ..], [v, ..]] = [summary(all, 0), summary(all, 1)];
        assert!(h < h_m && v < v_m, "{h} {v}");
    }
}

/// A barometer of an ordinary day along the drive's heights.
fn with_barometer(mut options: ReplayOptions, track: &Path, seed: u64) -> ReplayOptions {
    let text = std::fs::read_to_string(track).unwrap();
    let fixes = fixes::pos_fixes(&text, None).unwrap();
    let heights: Vec<(f64, f64)> = fixes
        .iter()
        .map(|fix| {
            let since_s = fix.time.seconds_since(fixes[0].time);
            (since_s, fix.solution.unwrap().llh.height_m)
        })
        .collect();
    let height_m = |t_s: f64| {
        let k = heights.partition_point(|(at_s, _)| *at_s <= t_s).max(1);
        let ((from_s, from_m), (to_s, to_m)) = (heights[k - 1], heights[k.min(heights.len() - 1)]);
        if to_s > from_s {
            from_m + (to_m - from_m) * (t_s - from_s) / (to_s - from_s)
        } else {
            from_m
        }
    };
    let length_s = heights[heights.len() - 1].0;
    let samples = Air::of_day(seed).samples(fixes[0].time, length_s, seed, None, height_m);
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("drive_barometer_{seed}.csv"));
    std::fs::write(&path, aiding::csv(&samples)).unwrap();
    options.barometer = Some(path);
    options.aids.barometer = Some(BarometerModel::PRESET);
    options
}

/// INT-122. A barometer holds the height through the same outages, on three ordinary days: 10 s after the last fix
/// the error is smaller than without, and so is what is told of it.
#[test]
fn int_122_a_barometer_holds_the_height_of_the_drive() {
    let (Some(options), Some(track)) = (
        drive(),
        common::shared(&format!("{DRIVE}/gnss_1934_sf.pos")),
    ) else {
        return;
    };
    let from_s: Vec<f64> = (0..10).map(|k| 60.0 + 45.0 * f64::from(k)).collect();
    let without = through_outages(options.clone(), &from_s);
    let [without_m, _, without_sigma_m] = summary(&without[3], 1);
    for seed in 1..=3 {
        let with = through_outages(with_barometer(options.clone(), &track, seed), &from_s);
        let [rms_m, _, sigma_m] = summary(&with[3], 1);
        assert!(rms_m < 0.8 * without_m, "{rms_m} {without_m}");
        assert!(sigma_m < 0.8 * without_sigma_m, "{sigma_m}");
        for errors in with.iter().flatten() {
            assert!(errors.error_m[1] < 4.0 * errors.sigma_m[1], "{errors:?}");
        }
    }
}

/// INT-121. With every fix the filter follows them to centimetres, and its sigma says so.
#[test]
fn int_121_with_every_fix_the_drive_is_followed() {
    let Some(options) = drive() else {
        return;
    };
    let result = replay::run(&options, &mut |_, _| {}).unwrap();
    let summary = &result.summary.errors;
    let [h95_m, v95_m] = [summary.h95_m.unwrap(), summary.v95_m.unwrap()];
    eprintln!("drive: 95 % within {h95_m:.3} m and {v95_m:.3} m");
    assert!(h95_m < 0.05 && v95_m < 0.05);
    let running = result
        .reports
        .iter()
        .filter(|report| report.inertial == InertialStatus::Running);
    assert!(running.count() > 1900);
    assert!(
        result
            .reports
            .iter()
            .all(|report| !report.flags.fix_refused)
    );
}

/// INT-122. The walk by NAV-PVT alone, through outages of a few seconds of standing and walking.
#[test]
fn int_122_a_walk_by_nav_pvt_alone() {
    let Some(options) = walk() else {
        return;
    };
    let result = replay::run(&options, &mut |_, _| {}).unwrap();
    assert_eq!(result.counters.fixes_used, 516);
    assert_eq!(result.counters.fixes_held_back, 20);
    assert_eq!(result.counters.rawx_used + result.counters.epochs, 0);
    let summary = &result.summary.errors;
    let [h95_m, v95_m] = [summary.h95_m.unwrap(), summary.v95_m.unwrap()];
    eprintln!("walk: 95 % within {h95_m:.3} m and {v95_m:.3} m");
    assert!(h95_m < 0.2 && v95_m < 0.3);
    for report in &result.reports {
        assert_eq!(report.verdict.integrity, Integrity::Unavailable);
        assert_eq!(report.mode, Mode::Loose);
    }
    let table = through_outages(options, &[25.0, 45.0, 65.0, 85.0, 105.0]);
    for errors in table.iter().flatten() {
        for axis in 0..2 {
            assert!(
                errors.error_m[axis] < 4.0 * errors.sigma_m[axis],
                "{errors:?}"
            );
        }
    }
}

/// INT-117. With its observations in the stream the walk is what it is without NAV-PVT.
#[test]
fn int_117_nav_pvt_beside_observations_changes_nothing() {
    let (Some(gnss), Some(imu)) = (
        common::shared(&format!("{WALK}/gnss_1730.ubx")),
        common::shared(&format!("{WALK}/derived_imu_gpst_unfiltered.csv")),
    ) else {
        return;
    };
    let with = recording(gnss.clone(), imu, "walk-adis16465.toml", &gnss);
    let bytes = std::fs::read(&gnss).unwrap();
    let (mut kept, mut rest) = (Vec::new(), &bytes[..]);
    while !rest.is_empty() {
        let length = match ubx::Frame::parse(rest) {
            Ok((frame, length)) if frame.message == ubx::NAV_PVT => length,
            _ => {
                kept.push(rest[0]);
                1
            }
        };
        rest = &rest[length..];
    }
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("walk_without_nav_pvt.ubx");
    std::fs::write(&path, kept).unwrap();
    let mut without = with.clone();
    without.gnss = path;
    let [with, without] =
        [with, without].map(|options| replay::run(&options, &mut |_, _| {}).unwrap());
    assert_eq!(with.reports, without.reports);
    assert_eq!(with.counters.fixes_used, 0);
    assert_eq!(
        with.counters.fixes_beside_observations + with.counters.fixes_held_back,
        536
    );
}
