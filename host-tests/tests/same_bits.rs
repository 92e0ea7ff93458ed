//! Whole recordings give the same `epochs.csv`, satellites and `sentences.nmea` on this machine and on the
//! emulated Cortex-M7, byte for byte: what replays here show is true there.

mod common;

use std::path::Path;
use std::process::Command;

use surefix_core::config::{Config, IonosphereModel};
use surefix_core::gnss::System;
use surefix_core::gnss::satellite::SystemSet;
use surefix_core::integrity::{Integrity, Mode, Phase, Reason};
use surefix_core::report::EpochReport;
use surefix_core::wire::ubx;
use surefix_host_tests::hybrid;
use surefix_host_tests::output::epochs_csv;
use surefix_host_tests::qemu::image;
use surefix_host_tests::replay::{self, Machine, ReplayOptions, ReplayResult, TruthChoice};
use surefix_host_tests::settings::Settings;
use surefix_host_tests::simulate::{self, atmosphere::Ionosphere, flight::Flight, stream::Format};
use surefix_host_tests::truth::Truth;

/// Replays on both machines, compares the files, and gives the result of this one; `None`, said
/// aloud, where there is no emulator.
fn on_both(mut options: ReplayOptions) -> Option<ReplayResult> {
    if let Some(missing) = image::missing() {
        eprintln!("SKIPPED: {missing}");
        return None;
    }
    options.machine = Machine::Host;
    let here = replay::run(&options, &mut |_, _| {}).unwrap();
    options.machine = Machine::Qemu;
    let there = replay::run(&options, &mut |_, _| {}).unwrap();
    let [here_csv, there_csv] =
        [&here, &there].map(|result| epochs_csv(&result.reports, &result.banks));
    for (number, (a, b)) in here_csv.lines().zip(there_csv.lines()).enumerate() {
        assert_eq!(a, b, "line {} of epochs.csv", number + 1);
    }
    assert_eq!(here_csv.len(), there_csv.len());
    assert!(here.sentences == there.sentences, "sentences.nmea");
    assert_eq!(here.sentences.lines().count(), 4 * here.reports.len());
    assert_eq!(here.counters, there.counters);
    // A receiver's own solution names no satellite.
    let has_observations = here.counters.fixes_used == 0;
    assert_eq!(
        here.satellites.iter().any(Option::is_some),
        has_observations
    );
    for (k, (a, b)) in here.satellites.iter().zip(&there.satellites).enumerate() {
        assert_eq!(a, b, "epoch {k}");
    }
    assert_eq!(here.satellites.len(), there.satellites.len());
    eprintln!(
        "{}: {} epochs, {} bytes of epochs.csv, equal on both machines",
        options.gnss.display(),
        here.reports.len(),
        here_csv.len()
    );
    Some(here)
}

fn gps_bds() -> Config {
    Config {
        systems: SystemSet::EMPTY.with(System::Gps).with(System::Bds),
        ..Config::PRESET
    }
}

/// INT-007.
#[test]
fn four_hours_at_esbjerg() {
    let folder = "data/esbc-2020-177";
    let Some(gnss) = common::shared(&format!("{folder}/ESBC_2020177_0000-0400.rnx")) else {
        return;
    };
    let nav = common::shared(&format!("{folder}/ESBC00DNK_R_20201770000_01D_MN.rnx.gz"));
    let mut options = ReplayOptions::new(gnss);
    options.nav.extend(nav);
    options.config = gps_bds();
    if let Some(result) = on_both(options) {
        assert_eq!(result.summary.epochs_with_position, 480);
    }
}

/// INT-007.
#[test]
fn rtcm3_across_a_week_rollover() {
    let Some(gnss) = common::shared("data/rtcm3-str1-week-rollover-2018/week-rollover-STR24.rtcm3")
    else {
        return;
    };
    let mut options = ReplayOptions::new(gnss);
    options.config = gps_bds();
    if let Some(result) = on_both(options) {
        assert_eq!(result.summary.epochs, 1134);
    }
}

/// INT-007. The flight of `cargo xtask demo`.
#[test]
fn an_approach_with_a_faulty_satellite() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("same_bits_approach");
    simulate::run(&simulate::Args {
        name: Flight::Approach,
        seed: 1,
        out: folder.clone(),
        rate_hz: 1.0,
        duration: None,
        noise_free: false,
        dual_frequency: false,
        no_troposphere: false,
        ionosphere: Ionosphere::Klobuchar,
        receiver: Format::Rtcm3,
        faults: vec!["G04:ramp:0.5:90:200".parse().unwrap()],
        disturbances: simulate::disturbances::Disturbances::default(),
    })
    .unwrap();
    let mut options = ReplayOptions::new(folder.join("receiver.rtcm3"));
    options.config = Config {
        phase: Phase::Lpv200,
        ..Config::PRESET
    };
    let Some(result) = on_both(options) else {
        return;
    };
    let excluded: Vec<String> = result
        .reports
        .iter()
        .filter(|report| report.verdict.integrity == Integrity::Excluded)
        .flat_map(|report| {
            report
                .verdict
                .excluded
                .iter()
                .map(|s| s.to_string())
                .collect::<Vec<_>>()
        })
        .collect();
    assert!(excluded.len() > 60, "{excluded:?}");
    assert!(excluded.iter().all(|name| name == "G04"), "{excluded:?}");
}

/// A simulated flight as a board would get it: RTCM 3 and inertial samples in the order of their times.
fn flight(name: &str, folder: &str, more: &[&str]) -> ReplayOptions {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("same_bits_{folder}"));
    let done = Command::new(env!("CARGO_BIN_EXE_surefix"))
        .args(["simulate", name, "--seed", "2", "--out"])
        .arg(&folder)
        .args(more)
        .output()
        .unwrap();
    assert!(done.status.success(), "{done:?}");
    let mut options = ReplayOptions::new(folder.join("receiver.rtcm3"));
    options.imu = vec![folder.join("imu.sfx")];
    options.truth = TruthChoice::Given(Truth::read(&folder.join("truth.csv")).unwrap());
    options
}

/// INT-007. The filter, an exclusion by the snapshot, and the whole of a filter's report.
#[test]
fn an_approach_with_an_inertial_unit() {
    let Some(result) = on_both(flight("lpv200_step", "lpv200_step", &["--duration", "180"])) else {
        return;
    };
    let tight = result
        .reports
        .iter()
        .filter(|report| report.mode == Mode::Tight)
        .count();
    assert!(tight > 170, "{tight}");
    assert_eq!(result.summary.errors.epochs_with_error_above_level, 0);
}

/// INT-007, INT-125. Epochs at 10 Hz, three of them on their way at any time.
#[test]
fn a_flight_whose_epochs_arrive_late() {
    let more = ["--duration", "15", "--rate-hz", "10"];
    let late = [&more[..], &["--latency", "0.3"]].concat();
    let Some(result) = on_both(flight("drive", "drive_late", &late)) else {
        return;
    };
    let at_once = replay::run(&flight("drive", "drive_at_once", &more), &mut |_, _| {}).unwrap();
    assert_eq!(result.reports, at_once.reports);
    let timing = result.inertial.last().unwrap().unwrap().timing;
    assert_eq!(
        (timing.latency_ns, timing.horizon.too_late),
        (300_000_000, 0)
    );
    assert!(tight_epochs(&result) > 140);
}

/// INT-007. Three, two, one satellite, none: the filter goes on and says that it is not to be trusted.
#[test]
fn a_flight_that_coasts() {
    let Some(result) = on_both(flight("coasting", "coasting", &[])) else {
        return;
    };
    let coasting = result
        .reports
        .iter()
        .filter(|report| report.mode == Mode::Tight && report.used.len() <= 3)
        .count();
    assert!(coasting >= 4 * 59, "{coasting}");
    assert_eq!(result.summary.errors.epochs_with_error_above_level, 0);
}

fn example(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../docs/examples")
        .join(name)
}

fn tight_epochs(result: &ReplayResult) -> usize {
    let tight = |report: &&EpochReport| report.mode == Mode::Tight;
    result.reports.iter().filter(tight).count()
}

/// INT-007. RINEX frames at 4 Hz with a recorded unit at 152 Hz between.
#[test]
fn a_walk_with_an_inertial_unit() {
    let folder = "data/walk0827-x20p-imu";
    let Some(gnss) = common::shared(&format!("{folder}/derived_convbin.obs")) else {
        return;
    };
    let settings = Settings::read(&example("walk-adis16465.toml")).unwrap();
    let mut options = ReplayOptions::new(gnss);
    let shared = |name: &str| common::shared(&format!("{folder}/{name}"));
    options.nav.extend(shared("derived_convbin.nav"));
    options.imu = shared("derived_imu_gpst_unfiltered.csv")
        .into_iter()
        .collect();
    options.config = settings.config().unwrap();
    options.imu_settings = settings.imu;
    if let Some(result) = on_both(options) {
        assert!(tight_epochs(&result) > 400);
    }
}

/// INT-007. RTCM 3 synthesised along a drive, with its recorded unit; satellites go and come back.
#[test]
fn a_drive_that_loses_its_satellites() {
    let folder = "data/drive0708-adis16465-rtk";
    let Some(track) = common::shared(&format!("{folder}/gnss_1934_sf.pos")) else {
        return;
    };
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join("same_bits_hybrid");
    let shared = |name: &str| common::shared(name).unwrap();
    let hybrid = hybrid::synthesise(&hybrid::Args {
        track,
        imu: shared(&format!("{folder}/derived_imu_gpst_unfiltered.csv")),
        config: example("car-adis16465.toml"),
        nav: shared("data/esbc-2020-177/ESBC00DNK_R_20201770000_01D_MN.rnx.gz"),
        satellites: 12,
        drop: vec!["3:70:90".parse().unwrap(), "0:100:115".parse().unwrap()],
        rate_hz: 1,
        duration: Some(120.0),
        seed: 1,
        out: out.clone(),
    })
    .unwrap();
    hybrid::write(&hybrid, &out).unwrap();
    let mut options = ReplayOptions::new(out.join("receiver.rtcm3"));
    options.imu = vec![out.join("imu.sfx")];
    options.config.ionosphere = IonosphereModel::None;
    if let Some(result) = on_both(options) {
        assert!(tight_epochs(&result) > 60);
    }
}

/// INT-007. A receiver's own solutions at 4 Hz, with the drive's recorded unit, and two outages.
#[test]
fn a_drive_that_is_loosely_coupled() {
    let folder = "data/drive0708-adis16465-rtk";
    let Some(track) = common::shared(&format!("{folder}/gnss_1934_sf.pos")) else {
        return;
    };
    // The first two minutes and a half: the text's head, and so many lines.
    let text = std::fs::read_to_string(track).unwrap();
    let head: Vec<&str> = text.lines().take(600).collect();
    let short = Path::new(env!("CARGO_TARGET_TMPDIR")).join("same_bits_drive.pos");
    std::fs::write(&short, head.join("\n")).unwrap();
    let samples = common::shared(&format!("{folder}/derived_imu_gpst_unfiltered.csv")).unwrap();
    let text = std::fs::read_to_string(samples).unwrap();
    let lines: Vec<&str> = text.lines().take(15_000).collect();
    let unit = Path::new(env!("CARGO_TARGET_TMPDIR")).join("same_bits_drive.csv");
    std::fs::write(&unit, lines.join("\n")).unwrap();
    let settings = Settings::read(&example("car-adis16465.toml")).unwrap();
    let mut options = ReplayOptions::new(short);
    options.imu = vec![unit];
    options.config = settings.config().unwrap();
    options.imu_settings = settings.imu;
    options.fixes.outages = vec!["60:70".parse().unwrap(), "110:120".parse().unwrap()];
    let Some(result) = on_both(options) else {
        return;
    };
    let coasting = |report: &&EpochReport| {
        report.mode == Mode::Loose && report.verdict.reason == Reason::ReceiverSilent
    };
    assert!(result.reports.iter().filter(coasting).count() >= 80);
    assert!(result.counters.fixes_used > 450);
}

/// INT-007. NAV-PVT of a receiver whose observations are taken out, with the walk's unit.
#[test]
fn a_walk_by_nav_pvt_alone() {
    let folder = "data/walk0827-x20p-imu";
    let Some(gnss) = common::shared(&format!("{folder}/gnss_1730.ubx")) else {
        return;
    };
    let bytes = std::fs::read(gnss).unwrap();
    let mut kept = Vec::new();
    for (start, _) in bytes
        .windows(2)
        .enumerate()
        .filter(|(_, pair)| *pair == ubx::PREAMBLE)
    {
        if let Ok((frame, length)) = ubx::Frame::parse(&bytes[start..])
            && frame.message == ubx::NAV_PVT
        {
            kept.extend_from_slice(&bytes[start..start + length]);
        }
    }
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("same_bits_nav_pvt.ubx");
    std::fs::write(&path, kept).unwrap();
    let settings = Settings::read(&example("walk-adis16465.toml")).unwrap();
    let mut options = ReplayOptions::new(path);
    options.imu = common::shared(&format!("{folder}/derived_imu_gpst_unfiltered.csv"))
        .into_iter()
        .collect();
    options.config = settings.config().unwrap();
    options.imu_settings = settings.imu;
    if let Some(result) = on_both(options) {
        assert_eq!(result.counters.fixes_used, 516);
        assert!(
            result
                .reports
                .iter()
                .all(|report| report.mode == Mode::Loose)
        );
    }
}

/// INT-007.
#[test]
fn a_walk_with_a_u_blox_receiver() {
    let Some(gnss) = common::shared("data/walk0827-x20p-imu/gnss_1730.ubx") else {
        return;
    };
    if let Some(result) = on_both(ReplayOptions::new(gnss)) {
        assert_eq!(result.counters.rawx_used, 536);
        assert!(result.counters.ephemerides > 10);
    }
}

/// INT-007.
#[test]
fn a_cold_start_of_a_u_blox_receiver() {
    let Some(gnss) = common::shared(
        "data/besancon-f9-coldstart-nominal/16dBatt_no_interference_coldstart.ubx.gz",
    ) else {
        return;
    };
    if let Some(result) = on_both(ReplayOptions::new(gnss)) {
        assert_eq!(result.counters.rawx_used, 562);
    }
}

/// INT-007.
#[test]
fn a_simulated_sky_through_a_u_blox_receiver() {
    let Some(gnss) = common::shared(
        "data/instinct-spirent-f9p-ubx/Spirent_ublox-F9P_static_duration-15min_sys-GPS-GAL_iono-Klobuchar_tropo-Saastamoinen.ubx",
    ) else {
        return;
    };
    if let Some(result) = on_both(ReplayOptions::new(gnss)) {
        assert_eq!(result.counters.rawx_used, 1600);
    }
}
