//! Real recordings, replayed whole: accuracy, levels, verdicts, times.

mod common;

use std::path::PathBuf;

use surefix_core::budget::{Ledger, NoCounter};
use surefix_core::config::{Config, IonosphereModel, NoisePreset};
use surefix_core::gnss::satellite::SystemSet;
use surefix_core::gnss::{BroadcastIonosphere, EphemerisStore, System};
use surefix_core::integrity::{Integrity, Phase};
use surefix_core::snapshot::SnapshotMonitor;
use surefix_core::time::NS_PER_S;
use surefix_host_tests::campaign::{self, StepsOptions};
use surefix_host_tests::replay::{self, ReplayOptions, ReplayResult};
use surefix_host_tests::source::{Item, Recording};

fn gps_bds() -> Config {
    Config {
        systems: SystemSet::EMPTY.with(System::Gps).with(System::Bds),
        ..Config::PRESET
    }
}

fn esbc() -> Option<(PathBuf, PathBuf)> {
    let folder = "data/esbc-2020-177/ESBC00DNK_R_20201770000_01D_";
    Some((
        common::shared(&format!("{folder}30S_MO.crx.gz"))?,
        common::shared(&format!("{folder}MN.rnx.gz"))?,
    ))
}

fn run(options: &ReplayOptions) -> ReplayResult {
    replay::run(options, &mut |_, _| {}).unwrap()
}

fn print(name: &str, result: &ReplayResult) {
    let summary = &result.summary;
    let errors = &summary.errors;
    eprintln!(
        "{name}: {} of {} positions, H95 {:.2} m, V95 {:.2} m, largest {:.2}, {:.2} m; median HPL {:.2}, VPL {:.2} m; largest error/level {:.3}, {:.3}; {:?}",
        summary.epochs_with_position,
        summary.epochs,
        errors.h95_m.unwrap(),
        errors.v95_m.unwrap(),
        errors.max_error_h_m.unwrap(),
        errors.max_error_v_m.unwrap(),
        summary.median_hpl_m.unwrap(),
        summary.median_vpl_m.unwrap(),
        errors.largest_error_over_hpl.unwrap(),
        errors.largest_error_over_vpl.unwrap(),
        summary.integrity,
    );
}

/// INT-010.
#[test]
fn a_day_at_esbjerg_is_accurate_bounded_and_free_of_alerts() {
    let Some((observations, navigation)) = esbc() else {
        return;
    };
    let mut options = ReplayOptions::new(observations);
    options.nav = vec![navigation];
    options.config = gps_bds();
    let result = run(&options);
    print("ESBC GPS+BDS", &result);
    let summary = &result.summary;
    assert_eq!((summary.epochs, summary.epochs_with_position), (2880, 2880));
    assert!(!result.lost_epochs() && result.losses.is_empty());
    assert_eq!(
        summary.truth.as_deref(),
        Some("RINEX header APPROX POSITION XYZ")
    );
    assert!(summary.errors.h95_m.unwrap() <= 1.9);
    assert!(summary.errors.v95_m.unwrap() <= 1.6);
    assert_eq!((summary.alerts, summary.exclusions.len()), (0, 0));
    assert_eq!(summary.integrity.get("nominal"), Some(&2880));
    assert_eq!(summary.errors.epochs_with_error_above_level, 0);
    assert!(summary.median_hpl_m.unwrap() <= 12.0);
    assert!(summary.median_vpl_m.unwrap() <= 25.0);
    assert!(
        result
            .reports
            .iter()
            .all(|r| { r.fix.is_some_and(|fix| fix.velocity_enu_mps.is_some()) })
    );

    for (name, config) in [
        ("ESBC GPS+BDS+Galileo", Config::PRESET),
        (
            "ESBC GPS+BDS ionosphere-free",
            Config {
                ionosphere: IonosphereModel::IonosphereFree,
                ..gps_bds()
            },
        ),
        (
            "ESBC GPS+BDS airborne preset",
            Config {
                noise: NoisePreset::Airborne,
                ..gps_bds()
            },
        ),
    ] {
        options.config = config;
        let beside = run(&options);
        print(name, &beside);
        assert_eq!(beside.summary.epochs_with_position, 2880);
        assert_eq!(beside.summary.errors.epochs_with_error_above_level, 0);
    }
}

/// INT-010.
#[test]
fn rtcm3_bytes_across_a_week_rollover_give_positions_from_their_own_ephemerides() {
    let folder = "data/rtcm3-str1-week-rollover-2018/week-rollover-STR24.rtcm3";
    let Some(recording) = common::shared(folder) else {
        return;
    };
    let mut options = ReplayOptions::new(recording);
    options.config = gps_bds();
    let result = run(&options);
    print("STR24 GPS+BDS", &result);
    let summary = &result.summary;
    assert_eq!(summary.epochs, 1134);
    assert!(summary.epochs_with_position >= 1130);
    assert!(summary.errors.h95_m.unwrap() <= 1.2);
    assert!(summary.errors.v95_m.unwrap() <= 3.0);
    assert_eq!(summary.errors.epochs_with_error_above_level, 0);
    assert_eq!((summary.alerts, summary.exclusions.len()), (0, 0));
    assert!(!result.lost_epochs(), "{:?}", result.losses);
    // No broadcast ionosphere in the stream: said of every position. No Doppler: no velocity.
    for report in result.reports.iter().filter(|r| r.fix.is_some()) {
        assert!(report.flags.no_broadcast_ionosphere);
        assert!(report.fix.unwrap().velocity_enu_mps.is_none());
    }
    // 2018-07-14 23:50:09 on; the week is 2009 up to the rollover and 2010 from it.
    let steps = result
        .reports
        .windows(2)
        .map(|w| w[1].since_first_ns - w[0].since_first_ns);
    assert!(steps.into_iter().all(|ns| ns == NS_PER_S));
    let last = result.reports.last().unwrap();
    assert_eq!(last.time.week(), 2010);
    for report in result.reports.iter().filter(|r| !r.flags.week_unknown) {
        let before = report.time.tow_ns() > 600_000 * NS_PER_S;
        assert_eq!(report.time.week(), if before { 2009 } else { 2010 });
    }
}

#[test]
fn every_system_keeps_its_time_across_a_week_rollover() {
    let folder = "data/rtcm3-str1-week-rollover-2018/week-rollover-STR17.rtcm3";
    let Some(recording) = common::shared(folder) else {
        return;
    };
    let config = Config {
        reference_week: Some(2010),
        ..Config::PRESET
    };
    let recording = Recording::read(&recording, &[], &config).unwrap();
    let epochs: Vec<_> = recording
        .items
        .iter()
        .filter_map(|item| match item {
            Item::Epoch(epoch) => Some(epoch),
            _ => None,
        })
        .collect();
    assert_eq!(epochs.len(), 1126);
    for pair in epochs.windows(2) {
        assert_eq!(pair[1].time.ns() - pair[0].time.ns(), NS_PER_S);
    }
    // BDT reaches its rollover 14 s after GPST; those epochs have their BDS satellites too.
    for epoch in &epochs {
        assert!(!epoch.flags.incomplete);
        for system in System::ALL {
            let n = epoch
                .satellites
                .iter()
                .filter(|s| s.satellite.system() == system)
                .count();
            assert!(n >= 5, "{system:?} at {:?}: {n}", epoch.time);
        }
    }
}

/// INT-003. A short version; the whole is `surefix campaign esbc-steps`.
#[test]
fn steps_on_a_real_sky_are_found_and_the_right_satellites_taken_out() {
    let Some((observations, navigation)) = esbc() else {
        return;
    };
    let config = gps_bds();
    let recording = Recording::read(&observations, &[navigation], &config).unwrap();
    let mut options = StepsOptions::new(config, 1);
    options.times = 5;
    let result = campaign::steps(&recording, &options).unwrap();
    eprintln!("{}", campaign::table(&result));
    assert_eq!(result.fault_free, (5, 0));
    for cell in &result.cells {
        assert!(cell.trials >= 60);
        if cell.magnitude_m >= 30.0 {
            assert_eq!((cell.missed_above_level, cell.excluded_wrongly), (0, 0));
        }
        if cell.faulted == 1 && cell.magnitude_m >= 50.0 {
            assert!(cell.detected as f64 >= 0.95 * cell.trials as f64);
        }
        if cell.magnitude_m >= 100.0 {
            assert_eq!((cell.missed, cell.above_level), (0, 0));
            assert_eq!(cell.wrong_out_right_in, 0);
        }
    }

    // Two shards together are the whole.
    let shards: Vec<_> = (0..2)
        .map(|k| {
            let mut options = options.clone();
            options.shard = (k, 2);
            campaign::steps(&recording, &options).unwrap()
        })
        .collect();
    let mut merged = campaign::merge(&shards).unwrap();
    for (cell, whole) in merged.cells.iter_mut().zip(&result.cells) {
        // The iteration starts where the trial before ended, so the last digits may differ.
        assert!((cell.largest_ratio - whole.largest_ratio).abs() < 1e-6);
        cell.largest_ratio = whole.largest_ratio;
    }
    assert_eq!(merged.cells, result.cells);
}

/// Limits and risks differ by phase, and so do the thresholds where risks do.
/// INT-063.
#[test]
fn a_day_at_esbjerg_raises_no_alert_in_any_phase_of_flight() {
    let Some((observations, navigation)) = esbc() else {
        return;
    };
    for phase in Phase::ALL {
        let options = ReplayOptions {
            nav: vec![navigation.clone()],
            config: Config { phase, ..gps_bds() },
            ..ReplayOptions::new(&observations)
        };
        let result = run(&options);
        print(phase.name(), &result);
        assert_eq!(result.reports.len(), 2880);
        for report in &result.reports {
            assert_ne!(report.verdict.integrity, Integrity::Alert);
            assert!(report.verdict.excluded.is_empty());
        }
    }
}

/// [P1] section 2 puts six impulses of 3σ = 12 m on a day of
/// GPS at a reference station, one every 200 epochs. Here likewise, on the highest satellite; sigma
/// is the model's, not the paper's 4 m, and P_FA that of the phase of flight.
#[test]
fn six_impulses_of_12_m_are_found_and_nothing_else() {
    let Some((observations, navigation)) = esbc() else {
        return;
    };
    let config = Config {
        systems: SystemSet::EMPTY.with(System::Gps),
        ..Config::PRESET
    };
    let recording = Recording::read(&observations, &[navigation], &config).unwrap();
    let mut monitor = Box::new(SnapshotMonitor::EMPTY);
    monitor.configure(&config).unwrap();
    let mut store = Box::new(EphemerisStore::EMPTY);
    let mut ionosphere = BroadcastIonosphere::EMPTY;
    let (mut number, mut found) = (0, Vec::new());
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
        let mut epoch = (**epoch).clone();
        let mut assess = |epoch: &_| {
            let mut ledger = Ledger::EMPTY;
            let assessment =
                monitor.assess(epoch, &store, &ionosphere, &mut ledger, &mut NoCounter);
            let highest = monitor
                .workspace()
                .used_rows()
                .max_by(|a, b| a.elevation_rad.total_cmp(&b.elevation_rad))
                .unwrap();
            (assessment, highest)
        };
        let is_impulse = number % 200 == 0 && (200..=1200).contains(&number);
        if is_impulse {
            let (_, highest) = assess(&epoch);
            eprintln!(
                "epoch {number}: 12 m on {}, model sigma {:.2} m, P_FA {:e}",
                highest.satellite,
                highest.sigma.independent_m,
                config.phase.requirements().p_fa
            );
            let observed = epoch
                .satellites
                .iter_mut()
                .find(|s| s.satellite == highest.satellite)
                .unwrap();
            for signal in &mut observed.signals {
                signal.pseudorange_m = signal.pseudorange_m.map(|pr_m| pr_m + 12.0);
            }
        }
        let (assessment, _) = assess(&epoch);
        let verdict = &assessment.verdict;
        if verdict.integrity == Integrity::Alert || !verdict.excluded.is_empty() {
            found.push(number);
        }
        number += 1;
    }
    assert_eq!(number, 2880);
    assert_eq!(found, [200, 400, 600, 800, 1000, 1200]);
}
