//! Tight mode on recordings: a walk with its own pseudoranges, and a drive with those that its antenna
//! would have measured under real orbits. The tables of docs/recordings.md come from here:
//!
//! ```text
//! cargo test -p surefix-host-tests --test recordings_inertial -- --nocapture --test-threads 1
//! ```

mod common;

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use surefix_core::config::{Config, IonosphereModel};
use surefix_core::frames::geodesy;
use surefix_core::gnss::solution::SnapshotWorkspace;
use surefix_core::gnss::{
    BroadcastIonosphere, CorrectedEpoch, CorrectedMeasurement, EphemerisStore, SatelliteSet, System,
};
use surefix_core::integrity::{Integrity, Mode, Reason};
use surefix_core::report::EpochReport;
use surefix_core::time::GpsTime;
use surefix_host_tests::hybrid::{self, Hybrid, Reduction};
use surefix_host_tests::replay::{self, ReplayOptions, ReplayResult};
use surefix_host_tests::settings::Settings;
use surefix_host_tests::source::{Item, Recording};
use surefix_host_tests::track::Track;

use common::shared;

/// Height of the geoid on the walk, as the receiver told it, m.
const GEOID_M: f64 = -21.39;

fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../docs/examples")
        .join(name)
}

/// Errors of position, m, and velocity, m/s, east, north, up; `None` without a position or a velocity.
fn errors(report: &EpochReport, track: &Track) -> Option<([f64; 3], [f64; 3])> {
    let fix = report.fix.as_ref()?;
    let velocity = fix.velocity_enu_mps?;
    let (r_e, v_e) = track.state(report.time, 0.0);
    let llh = geodesy::to_llh(&r_e).unwrap();
    let c_enu_e = geodesy::c_enu_e(llh.lat_rad, llh.lon_rad);
    let position = c_enu_e * (Vector3::from(fix.r_e_m) - r_e);
    let velocity = Vector3::from(velocity) - c_enu_e * v_e;
    Some((position.into(), velocity.into()))
}

/// Root of the mean square of numbers.
fn rms(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let count = values.clone().count() as f64;
    (values.map(|x| x * x).sum::<f64>() / count).sqrt()
}

/// East, north, up of many.
fn rms_enu(errors: &[[f64; 3]]) -> [f64; 3] {
    core::array::from_fn(|k| rms(errors.iter().map(|e| e[k])))
}

fn walk() -> Option<(ReplayOptions, Track)> {
    let folder = "data/walk0827-x20p-imu";
    let gnss = shared(&format!("{folder}/derived_convbin.obs"))?;
    let mut options = ReplayOptions::new(gnss);
    options
        .nav
        .extend(shared(&format!("{folder}/derived_convbin.nav")));
    let settings = Settings::read(&example("walk-adis16465.toml")).unwrap();
    options.config = settings.config().unwrap();
    options.imu = shared(&format!("{folder}/derived_imu_gpst_unfiltered.csv"))
        .into_iter()
        .collect();
    options.imu_settings = settings.imu;
    let track = shared(&format!("{folder}/gnss_1730_sf.pos"))?;
    Some((options, Track::read(&track, GEOID_M).unwrap()))
}

/// Removes the mean that a receiver clock or its drift is, weighted, and pushes what is left, in sigmas.
fn scatter(residuals: &[(f64, f64)], out: &mut Vec<f64>) {
    let n = residuals.len() as f64;
    if n < 3.0 {
        return;
    }
    let weight = residuals.iter().map(|(_, sigma)| sigma.powi(-2));
    let weights: f64 = weight.clone().sum();
    let sum: f64 = residuals.iter().zip(weight).map(|((r, _), w)| r * w).sum();
    // A mean taken out leaves the scatter smaller.
    let grow = (n / (n - 1.0)).sqrt();
    out.extend(
        residuals
            .iter()
            .map(|(r, sigma)| grow * (r - sum / weights) / sigma),
    );
}

/// Time, measurements, place and velocity of the antenna.
type TakeEpoch<'a> = dyn FnMut(GpsTime, &CorrectedEpoch, Vector3<f64>, Vector3<f64>) + 'a;

/// Gives the measurements of each epoch, corrected for the antenna's place and velocity on the track.
fn along_the_track(options: &ReplayOptions, track: &Track, take: &mut TakeEpoch<'_>) {
    let recording = Recording::read(&options.gnss, &options.nav, &options.config).unwrap();
    let mut store = EphemerisStore::EMPTY;
    let ionosphere = BroadcastIonosphere::EMPTY;
    let mut workspace = Box::new(SnapshotWorkspace::EMPTY);
    let mut corrected = CorrectedEpoch::EMPTY;
    for item in &recording.items {
        let epoch = match item {
            Item::Ephemeris(ephemeris) => {
                let _ = store.insert(ephemeris);
                continue;
            }
            Item::Epoch(epoch) => epoch,
            _ => continue,
        };
        workspace.prepare(epoch, &store, &ionosphere, &options.config);
        let (r_e, v_e) = track.state(epoch.time, 0.0);
        workspace
            .corrected(r_e.into(), v_e.into(), SatelliteSet::EMPTY, &mut corrected)
            .unwrap();
        take(epoch.time, &corrected, r_e, v_e);
    }
}

/// INT-017. The factors of the example are what the recording scatters against the RTK track once the clock of
/// each epoch, or its drift, is taken out.
#[test]
fn the_noise_of_the_walk_is_measured() {
    let Some((options, track)) = walk() else {
        return;
    };
    let (mut codes, mut rates) = (Vec::new(), Vec::new());
    along_the_track(&options, &track, &mut |_, corrected, r_e, v_e| {
        let line = |row: &CorrectedMeasurement| Vector3::from(row.r_es_e_m) - r_e;
        for system in System::ALL {
            let of_system: Vec<(f64, f64)> = corrected
                .rows
                .iter()
                .filter(|row| row.satellite.system() == system)
                .map(|row| {
                    (
                        row.pseudorange_m - line(row).norm(),
                        row.sigma_pseudorange_m,
                    )
                })
                .collect();
            scatter(&of_system, &mut codes);
        }
        let drifts: Vec<(f64, f64)> = corrected
            .rows
            .iter()
            .filter_map(|row| {
                let (rate_mps, sigma_mps) = row.range_rate_mps?;
                let relative = Vector3::from(row.v_es_e_mps) - v_e;
                Some((rate_mps - line(row).normalize().dot(&relative), sigma_mps))
            })
            .collect();
        scatter(&drifts, &mut rates);
    });
    let (code, rate) = (rms(codes.iter().copied()), rms(rates.iter().copied()));
    eprintln!(
        "walk: {} pseudoranges scatter {code:.2}, {} range rates {rate:.2} times the model's sigma",
        codes.len(),
        rates.len()
    );
    let factors = options
        .imu_settings
        .unwrap()
        .inertial_config()
        .unwrap()
        .measurement;
    assert!((rate / factors.range_rate - 1.0).abs() < 0.2, "{rate}");
    assert!((code / factors.pseudorange - 1.0).abs() < 0.2, "{code}");
}

/// With two frequencies the walk raises alerts without a fault put on it. They are no false ones: at each, a
/// satellite is off by many metres against the others of its constellation on the RTK track.
#[test]
fn the_alerts_of_the_walk_are_reflections() {
    let Some((options, track)) = walk() else {
        return;
    };
    let result = replay::run(&options, &mut |_, _| {}).unwrap();
    let is_alert = |time| {
        let report = result.reports.iter().find(|report| report.time == time);
        report.is_some_and(|report| {
            // An alert that is held says nothing of its epoch.
            let verdict = &report.verdict;
            verdict.integrity == Integrity::Alert && verdict.reason != Reason::AlertHeld
        })
    };
    let mut alerts = 0;
    along_the_track(&options, &track, &mut |time, corrected, r_e, _| {
        if !is_alert(time) {
            return;
        }
        let (mut farthest_m, mut farthest) = (0.0, String::new());
        for system in System::ALL {
            let mut off_m: Vec<(f64, String)> = corrected
                .rows
                .iter()
                .filter(|row| row.satellite.system() == system)
                .map(|row| {
                    let range_m = (Vector3::from(row.r_es_e_m) - r_e).norm();
                    (row.pseudorange_m - range_m, row.satellite.to_string())
                })
                .collect();
            off_m.sort_by(|a, b| a.0.total_cmp(&b.0));
            let Some((middle_m, _)) = off_m.get(off_m.len() / 2).cloned() else {
                continue;
            };
            for (clock_m, name) in off_m {
                if (clock_m - middle_m).abs() > f64::abs(farthest_m) {
                    (farthest_m, farthest) = (clock_m - middle_m, name);
                }
            }
        }
        println!("{:.2} s: {farthest} {farthest_m:+.1} m", time.tow_s());
        assert!(farthest_m.abs() > 10.0, "{farthest} {farthest_m}");
        alerts += 1;
    });
    assert!((1..=20).contains(&alerts), "{alerts}");
}

/// INT-017. Against RTK: tight not worse than the snapshot solution, better in velocity.
#[test]
fn a_walk_against_rtk() {
    let Some((mut options, track)) = walk() else {
        return;
    };
    println!(
        "| walk | E | N | U, m | horizontal | scatter E | N | U, m | velocity E | N | U, m/s |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    for ionosphere in [IonosphereModel::Klobuchar, IonosphereModel::IonosphereFree] {
        options.config.ionosphere = ionosphere;
        let tight = replay::run(&options, &mut |_, _| {}).unwrap();
        let alone = ReplayOptions {
            imu: Vec::new(),
            imu_settings: None,
            ..options.clone()
        };
        let snapshot = replay::run(&alone, &mut |_, _| {}).unwrap();
        // The header holds one point of the walk.
        assert_eq!(
            (&tight.summary.truth, &snapshot.summary.truth),
            (&None, &None)
        );
        // Where both have a position, from the first tight one on.
        let (mut of_tight, mut of_snapshot) = (Vec::new(), Vec::new());
        let (mut nis, mut rows) = (0.0, 0.0);
        for report in tight.reports.iter().filter(|r| r.mode == Mode::Tight) {
            let beside = snapshot.reports.iter().find(|s| s.time == report.time);
            let Some(beside) = beside.and_then(|s| errors(s, &track)) else {
                continue;
            };
            of_tight.push(errors(report, &track).unwrap());
            of_snapshot.push(beside);
            if let Some(navigation) = &report.navigation {
                nis += navigation.nis;
                rows += f64::from(navigation.nis_rows);
            }
        }
        let figures = |of: &[([f64; 3], [f64; 3])]| {
            let (position, velocity): (Vec<_>, Vec<_>) = of.iter().copied().unzip();
            let mean: [f64; 3] = core::array::from_fn(|k| {
                position.iter().map(|e: &[f64; 3]| e[k]).sum::<f64>() / position.len() as f64
            });
            let scatter: Vec<[f64; 3]> = position
                .iter()
                .map(|e| core::array::from_fn(|k| e[k] - mean[k]))
                .collect();
            (rms_enu(&position), rms_enu(&scatter), rms_enu(&velocity))
        };
        let mut all = Vec::new();
        for (name, of) in [("snapshot", &of_snapshot), ("tight", &of_tight)] {
            let (p, s, v) = figures(of);
            println!(
                "| {name}, {ionosphere:?} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {:.3} | {:.3} | {:.3} |",
                p[0],
                p[1],
                p[2],
                p[0].hypot(p[1]),
                s[0],
                s[1],
                s[2],
                v[0],
                v[1],
                v[2]
            );
            all.push((p, s, v));
        }
        println!(
            "{} epochs, innovations squared {:.2} per row",
            of_tight.len(),
            nis / rows
        );
        let [(p0, s0, v0), (p1, s1, v1)] = all[..] else {
            panic!()
        };
        assert!(of_tight.len() > 400);
        assert!((0..3).all(|k| v1[k] < v0[k]), "velocity {v1:?} {v0:?}");
        assert!((0..3).all(|k| s1[k] < s0[k]), "scatter {s1:?} {s0:?}");
        assert!(p1[2] < p0[2], "height {p1:?} {p0:?}");
        if ionosphere == options_of_example() {
            assert!(p1[0].hypot(p1[1]) < p0[0].hypot(p0[1]), "{p1:?} {p0:?}");
            assert!((0.7..1.4).contains(&(nis / rows)), "{}", nis / rows);
        }
        never_beyond_the_level(&tight, &track);
    }
}

fn options_of_example() -> IonosphereModel {
    let settings = Settings::read(&example("walk-adis16465.toml")).unwrap();
    settings.config().unwrap().ionosphere
}

/// No position that may be used errs by more than its level.
fn never_beyond_the_level(result: &ReplayResult, track: &Track) {
    for report in &result.reports {
        let usable = matches!(
            report.verdict.integrity,
            Integrity::Nominal | Integrity::Excluded
        );
        let Some(([e, n, u], _)) = errors(report, track).filter(|_| usable) else {
            continue;
        };
        let (hpl_m, vpl_m) = (report.verdict.hpl.bound_m(), report.verdict.vpl.bound_m());
        let at = report.time.tow_s();
        assert!(
            hpl_m.is_some_and(|hpl_m| e.hypot(n) <= hpl_m),
            "{at}: {e} {n}"
        );
        assert!(vpl_m.is_some_and(|vpl_m| u.abs() <= vpl_m), "{at}: {u}");
    }
}

/// Windows in which satellites are taken away, s from the first epoch: 60 s each, 60 s of full sky
/// between, in which the car drives.
const WINDOWS_S: [(f64, f64); 4] = [
    (100.0, 160.0),
    (220.0, 280.0),
    (340.0, 400.0),
    (460.0, 520.0),
];
/// Satellites of the full sky.
const FULL_SKY: usize = 12;

fn drive(satellites: usize) -> Option<(ReplayOptions, Hybrid)> {
    let folder = "data/drive0708-adis16465-rtk";
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("hybrid-{satellites}"));
    let drop = WINDOWS_S.map(|(from_s, to_s)| Reduction {
        satellites,
        from_s,
        to_s,
    });
    let hybrid = hybrid::synthesise(&hybrid::Args {
        track: shared(&format!("{folder}/gnss_1934_sf.pos"))?,
        imu: shared(&format!("{folder}/derived_imu_gpst_unfiltered.csv"))?,
        config: example("car-adis16465.toml"),
        nav: shared("data/esbc-2020-177/ESBC00DNK_R_20201770000_01D_MN.rnx.gz")?,
        satellites: FULL_SKY,
        drop: drop.to_vec(),
        rate_hz: 1,
        duration: None,
        seed: 1,
        out: out.clone(),
    })
    .unwrap();
    hybrid::write(&hybrid, &out).unwrap();
    let mut options = ReplayOptions::new(out.join("receiver.rtcm3"));
    options.imu = vec![out.join("imu.sfx")];
    options.config = Config {
        ionosphere: IonosphereModel::None,
        ..Config::PRESET
    };
    Some((options, hybrid))
}

/// INT-018. A real unit with satellites taken away: the filter knows how wrong it is, and never calls a
/// position usable that errs by more than its level.
///
/// The ends of 4 windows with 6 numbers of satellites are 144 errors over their own sigma; were they
/// normal with that sigma, one beyond 4 would come up in 1 of 110 such tests.
#[test]
fn a_drive_loses_its_satellites() {
    println!(
        "| satellites | horizontal max | rms, m | sigma | vertical max | rms, m | sigma | velocity max | rms, m/s | sigma | largest error/sigma |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    for satellites in [12, 4, 3, 2, 1, 0] {
        let Some((options, hybrid)) = drive(satellites) else {
            return;
        };
        let result = replay::run(&options, &mut |_, _| {}).unwrap();
        let track = &hybrid.track;
        let (mut h, mut v, mut speed) = (Vec::new(), Vec::new(), Vec::new());
        let mut ends = Vec::new();
        let mut worst = 0.0_f64;
        let mut bounded = 0;
        for (from_s, to_s) in WINDOWS_S {
            let mut rows = 0;
            for report in &result.reports {
                let t_s = report.time.seconds_since(hybrid.start);
                if !(from_s..to_s).contains(&t_s) {
                    continue;
                }
                rows += 1;
                assert_eq!(report.mode, Mode::Tight, "{satellites} at {t_s}");
                let (position, velocity) = errors(report, track).unwrap();
                h.push(position[0].hypot(position[1]));
                v.push(position[2]);
                speed.push(rms(velocity.iter().copied()) * 3_f64.sqrt());
                let verdict = &report.verdict;
                assert_ne!(verdict.integrity, Integrity::Alert, "at {t_s}");
                bounded += usize::from(verdict.hpl.bound_m().is_some());
                if satellites == 0 {
                    assert_eq!(verdict.reason, Reason::ReceiverSilent, "at {t_s}");
                }
                if t_s < to_s - 1.5 {
                    continue;
                }
                let navigation = report.navigation.as_ref().unwrap();
                let sigma = (
                    navigation.sigma_position_enu_m,
                    navigation.sigma_velocity_enu_mps,
                );
                ends.push(sigma);
                for k in 0..3 {
                    worst = worst
                        .max((position[k] / sigma.0[k]).abs())
                        .max((velocity[k] / sigma.1[k]).abs());
                }
            }
            assert_eq!(rows, 60, "{satellites} from {from_s}");
        }
        assert_eq!(ends.len(), WINDOWS_S.len());
        let max = |of: &[f64]| of.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
        let all = |of: &[f64]| rms(of.iter().copied());
        let sigma_h = rms(ends.iter().map(|(p, _)| p[0].hypot(p[1])));
        let sigma_v = rms(ends.iter().map(|(p, _)| p[2]));
        let sigma_speed = rms(ends
            .iter()
            .map(|(_, v)| (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()));
        println!(
            "| {satellites} | {:.2} | {:.2} | {sigma_h:.2} | {:.2} | {:.2} | {sigma_v:.2} | {:.3} | {:.3} | {sigma_speed:.3} | {worst:.2} |",
            max(&h),
            all(&h),
            max(&v),
            all(&v),
            max(&speed),
            all(&speed)
        );
        assert!(worst < 4.0, "{satellites}: {worst}");
        // As long as the receiver speaks the bank bounds what it says.
        assert_eq!(
            bounded,
            if satellites == 0 { 0 } else { 240 },
            "{satellites}"
        );
        never_beyond_the_level(&result, track);
        // A minute of full sky later it is what it was.
        let last = result
            .reports
            .iter()
            .rfind(|report| report.mode == Mode::Tight && report.used.len() == FULL_SKY)
            .unwrap();
        let ([e, n, u], _) = errors(last, track).unwrap();
        assert!(
            e.hypot(n) < 1.5 && u.abs() < 3.0,
            "{satellites}: {e} {n} {u}"
        );
    }
}

/// Root mean square and mean of heading minus course of the track, degrees, where the track is at least this
/// fast; and how many epochs that is.
fn heading_against_course(
    reports: &[EpochReport],
    track: &Track,
    min_speed_mps: f64,
) -> (f64, f64, usize) {
    let differences: Vec<f64> = reports
        .iter()
        .filter_map(|report| {
            let [.., heading_deg] = report.navigation.as_ref()?.roll_pitch_heading_deg;
            let (r_e, v_e) = track.state(report.time, 0.0);
            let llh = geodesy::to_llh(&r_e).unwrap();
            let v = geodesy::c_enu_e(llh.lat_rad, llh.lon_rad) * v_e;
            let course_deg = v.x.atan2(v.y).to_degrees();
            (v.x.hypot(v.y) >= min_speed_mps)
                .then(|| (heading_deg - course_deg + 540.0).rem_euclid(360.0) - 180.0)
        })
        .collect();
    let mean = differences.iter().sum::<f64>() / differences.len() as f64;
    (rms(differences.iter().copied()), mean, differences.len())
}

/// INT-100. From a cold start, no attitude given, the walk and the drive find theirs from the course as soon as they move
/// fast enough; the heading then follows the course of the RTK track, and no usable epoch errs by more than its level.
#[test]
fn int_100_recordings_align_from_a_cold_start() {
    let Some((walk_options, walk_track)) = walk() else {
        return;
    };
    let Some((drive_options, hybrid)) = drive(FULL_SKY) else {
        return;
    };
    let mut by_ubx = walk_options.clone();
    by_ubx.gnss = shared("data/walk0827-x20p-imu/gnss_1730.ubx").unwrap();
    by_ubx.nav = Vec::new();
    println!(
        "| recording | first tested position, s | and fast enough, s | tight from, s | heading sigma then, ° | after a minute | heading minus course, mean, ° | rms | epochs | speed from, m/s |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let cases = [
        ("walk, RINEX", walk_options, &walk_track, 1.0),
        ("walk, UBX", by_ubx, &walk_track, 1.0),
        ("drive", drive_options, &hybrid.track, 3.0),
    ];
    for (name, options, track, min_speed_mps) in cases {
        let result = replay::run(&options, &mut |_, _| {}).unwrap();
        let first = result.reports.first().unwrap().time;
        let since = |report: &EpochReport| report.time.seconds_since(first);
        let is_tested = |report: &EpochReport| {
            report.verdict.hpl.bound_m().is_some() && report.verdict.vpl.bound_m().is_some()
        };
        let tested = result.reports.iter().find(|r| is_tested(r)).unwrap();
        let fast = result.reports.iter().find(|report| {
            let velocity = report.fix.and_then(|fix| fix.velocity_enu_mps);
            is_tested(report) && velocity.is_some_and(|[e, n, _]| e.hypot(n) >= min_speed_mps)
        });
        let tight: Vec<EpochReport> = result
            .reports
            .iter()
            .filter(|report| report.mode == Mode::Tight)
            .copied()
            .collect();
        let start = tight.first().unwrap();
        let sigma_deg = |at_s: f64| {
            let report = tight.iter().find(|r| since(r) >= since(start) + at_s);
            report.map_or(f64::NAN, |r| {
                let [.., up_deg] = r.navigation.as_ref().unwrap().sigma_attitude_enu_deg;
                up_deg
            })
        };
        let (rms_deg, mean_deg, epochs) = heading_against_course(&tight, track, min_speed_mps);
        println!(
            "| {name} | {:.1} | {:.1} | {:.1} | {:.1} | {:.1} | {mean_deg:.1} | {rms_deg:.1} | {epochs} | {min_speed_mps} |",
            since(tested),
            since(fast.unwrap()),
            since(start),
            sigma_deg(0.0),
            sigma_deg(60.0),
        );
        never_beyond_the_level(&result, track);
        // A window of a second, of which the first may be refused, and the epoch after it.
        assert!(since(start) <= since(fast.unwrap()) + 5.0, "{name}");
        // A walker sways: docs/recordings.md.
        let (largest_mean, largest_rms) = if name == "drive" {
            (3.0, 5.0)
        } else {
            (15.0, 40.0)
        };
        assert!(mean_deg.abs() < largest_mean, "{name}: {mean_deg}");
        assert!(rms_deg < largest_rms, "{name}: {rms_deg}");
    }
}
