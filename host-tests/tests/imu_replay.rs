//! A recorded unit enters the stream where its samples belong, and changes nothing the receiver sent.

mod common;

use std::path::{Path, PathBuf};

use surefix_core::config::Config;
use surefix_core::gnss::ObservationEpoch;
use surefix_core::ingest::{Event, Ingest, encode_imu, encode_inertial};
use surefix_core::ins::ImuSample;
use surefix_core::time::GpsTime;
use surefix_core::wire::native::MAX_FRAME;
use surefix_host_tests::faults::FaultSpec;
use surefix_host_tests::imu::{self, Recorded};
use surefix_host_tests::settings::Settings;
use surefix_host_tests::source;

use common::shared;

fn example(name: &str) -> Settings {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../docs/examples")
        .join(name);
    Settings::read(&path).unwrap()
}

/// What a monitor takes from a stream, in order.
enum Taken {
    Unit,
    Sample(ImuSample),
    Epoch(Box<ObservationEpoch>),
}

fn taken(bytes: &[u8]) -> Vec<Taken> {
    let mut ingest = Box::new(Ingest::EMPTY);
    let (mut all, mut rest) = (Vec::new(), bytes);
    loop {
        let (used, event) = ingest.push(rest);
        rest = &rest[used..];
        match event {
            Event::Configuration(config) => ingest.configure(&config),
            Event::Inertial(_) => all.push(Taken::Unit),
            Event::Imu(sample) => all.push(Taken::Sample(sample)),
            Event::EpochReady => all.push(Taken::Epoch(Box::new(ingest.epoch().clone()))),
            Event::EndOfStream => return all,
            Event::Nothing => assert!(!rest.is_empty(), "the end is told"),
            _ => {}
        }
    }
}

fn epochs(all: &[Taken]) -> Vec<&ObservationEpoch> {
    all.iter()
        .filter_map(|taken| match taken {
            Taken::Epoch(epoch) => Some(&**epoch),
            _ => None,
        })
        .collect()
}

/// Checks the order, and that receiver and unit lost nothing. Tells how many epochs there are.
fn check_order(with: &[u8], without: &[u8], samples: &[ImuSample]) -> usize {
    let (with, without) = (taken(with), taken(without));
    let first = with
        .iter()
        .position(|taken| matches!(taken, Taken::Unit))
        .unwrap();
    assert_eq!(first, 0, "the unit is known before anything happens");
    let tow = |time: GpsTime| time.tow_ns();
    let mut seen = 0;
    for taken in &with {
        match taken {
            Taken::Unit => {}
            Taken::Sample(sample) => {
                // The week may be provisional as long as the receiver's is.
                assert_eq!(
                    (tow(sample.time), sample.dv_is_s_mps, sample.dtheta_is_s_rad),
                    (
                        tow(samples[seen].time),
                        samples[seen].dv_is_s_mps,
                        samples[seen].dtheta_is_s_rad
                    )
                );
                seen += 1;
            }
            Taken::Epoch(epoch) => {
                let at = tow(epoch.time);
                assert!(seen == 0 || tow(samples[seen - 1].time) <= at);
                assert!(seen == samples.len() || tow(samples[seen].time) > at);
            }
        }
    }
    assert_eq!(seen, samples.len());
    assert_eq!(epochs(&with), epochs(&without));
    epochs(&with).len()
}

/// A unit at rest at 100 Hz, from half a second before a time on.
fn at_rest(from: GpsTime, seconds: i64) -> Recorded {
    let samples = (0..seconds * 100)
        .map(|k| ImuSample {
            time: from.plus_ns(k * 10_000_000 - 500_000_000),
            interval_ns: 10_000_000,
            dtheta_is_s_rad: [k as f64 * 1e-9, 0.0, 0.0],
            dv_is_s_mps: [0.0, 0.0, -0.098],
        })
        .collect();
    Recorded {
        unit: example("car-adis16465.toml")
            .imu
            .unwrap()
            .inertial_config()
            .unwrap(),
        magnetometer: None,
        samples,
        receiver_latency_ns: 0,
        units: Vec::new(),
        unit_samples: Vec::new(),
        bad_lines: 0,
    }
}

/// A simulated approach as RTCM 3, and the time of its first epoch.
fn simulated(name: &str) -> (PathBuf, GpsTime) {
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&directory);
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_surefix"))
        .args(["simulate", "approach", "--seed", "7", "--out"])
        .arg(&directory)
        .output()
        .unwrap();
    assert!(output.status.success());
    let truth = std::fs::read_to_string(directory.join("truth.csv")).unwrap();
    let row: Vec<&str> = truth.lines().nth(1).unwrap().split(',').collect();
    let tow_s: f64 = row[2].parse().unwrap();
    let time = GpsTime::from_week_tow_s(row[1].parse().unwrap(), tow_s as i64);
    (directory.join("receiver.rtcm3"), time)
}

#[test]
fn samples_stand_in_the_order_of_their_times_between_recorded_bytes() {
    let (gnss, first) = simulated("imu-rtcm3");
    let unit = at_rest(first, 242);
    let config = Config::PRESET;
    let stream = |imu| {
        source::stream(&gnss, &[], &config, &[], 1, imu)
            .unwrap()
            .bytes
    };
    let count = check_order(&stream(Some(&unit)), &stream(None), &unit.samples);
    assert_eq!(count, 241);
}

#[test]
fn noise_and_damage_between_the_frames_move_no_sample() {
    let (gnss, first) = simulated("imu-damaged");
    let mut bytes = std::fs::read(&gnss).unwrap();
    // Text, a false start that promises 1023 bytes, and a wrong byte in a message.
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x40;
    let mut damaged = b"$GNGGA,not much*00\r\n\xd3\x03\xff".to_vec();
    damaged.extend(&bytes);
    std::fs::write(&gnss, &damaged).unwrap();
    let unit = at_rest(first, 242);
    let config = Config::PRESET;
    let stream = |imu| {
        source::stream(&gnss, &[], &config, &[], 1, imu)
            .unwrap()
            .bytes
    };
    let count = check_order(&stream(Some(&unit)), &stream(None), &unit.samples);
    assert!((240..=241).contains(&count), "{count}");
}

#[test]
fn samples_stand_in_the_order_of_their_times_when_epochs_are_sent_again() {
    let (gnss, first) = simulated("imu-faults");
    let unit = at_rest(first, 242);
    let config = Config::PRESET;
    let satellite = {
        let without = source::stream(&gnss, &[], &config, &[], 1, None).unwrap();
        epochs(&taken(&without.bytes))[50].satellites[0].satellite
    };
    let fault: FaultSpec = format!("{satellite}:step:30:50:60").parse().unwrap();
    let stream = |imu| {
        source::stream(&gnss, &[], &config, &[fault], 1, imu)
            .unwrap()
            .bytes
    };
    let count = check_order(&stream(Some(&unit)), &stream(None), &unit.samples);
    assert_eq!(count, 241);
}

#[test]
fn a_unit_of_another_day_is_refused() {
    let (gnss, first) = simulated("imu-other-day");
    let unit = at_rest(first.plus_ns(86_400_000_000_000), 10);
    let error = source::stream(&gnss, &[], &Config::PRESET, &[], 1, Some(&unit)).unwrap_err();
    let message = error.to_string();
    assert!(
        message.contains("same time") && message.contains("time_scale"),
        "{message}"
    );
}

#[test]
fn a_stream_of_samples_is_a_recording_too() {
    let unit = at_rest(GpsTime::from_week_tow_s(2300, 100), 2);
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("imu.sfx");
    let mut frame = [0; MAX_FRAME];
    let mut bytes = Vec::new();
    for sample in &unit.samples {
        let len = encode_imu(sample, &mut frame).unwrap();
        bytes.extend(&frame[..len]);
    }
    std::fs::write(&path, &bytes).unwrap();
    let error = imu::read(&path, None).unwrap_err();
    assert!(format!("{error:#}").contains("[imu]"), "{error:#}");
    let settings = example("walk-adis16465.toml").imu.unwrap();
    let read = imu::read(&path, Some(&settings)).unwrap();
    assert_eq!((read.samples, read.bad_lines), (unit.samples.clone(), 0));
    assert_eq!(read.unit, settings.inertial_config().unwrap());

    // It may say itself what the unit is; one byte is wrong.
    let len = encode_inertial(&unit.unit, &mut frame).unwrap();
    bytes[200] ^= 1;
    std::fs::write(&path, [&frame[..len], &bytes].concat()).unwrap();
    let read = imu::read(&path, None).unwrap();
    assert_eq!((read.samples.len(), read.bad_lines), (199, 1));
    assert_eq!(read.unit, unit.unit);
}

/// The mounting of an example, checked with gravity: at rest a unit measures the reaction to it, which
/// is upwards; down is the body's third axis.
fn rest_b(recording: &str, example_name: &str, seconds: f64) -> Option<[f64; 3]> {
    let path = shared(&format!("data/{recording}/derived_imu_gpst_unfiltered.csv"))?;
    let settings = example(example_name).imu.unwrap();
    let recorded = imu::read(&path, Some(&settings)).unwrap();
    assert_eq!(recorded.bad_lines, 0);
    let first = recorded.samples[0].time;
    let (mut dv, mut over_s) = ([0.0; 3], 0.0);
    for sample in &recorded.samples {
        if sample.time.seconds_since(first) < seconds {
            for (sum, value) in dv.iter_mut().zip(sample.dv_is_s_mps) {
                *sum += value;
            }
            over_s += f64::from(sample.interval_ns) * 1e-9;
        }
    }
    let f_s = dv.map(|sum| sum / over_s);
    let f_b = recorded
        .unit
        .c_b_s
        .map(|row| row[0] * f_s[0] + row[1] * f_s[1] + row[2] * f_s[2]);
    println!(
        "{recording}: {f_b:.3?} m/s² at rest, {} samples",
        recorded.samples.len()
    );
    Some(f_b)
}

#[test]
fn the_units_of_both_recordings_stand_upright_at_rest() {
    // The places have no name; the unit was not calibrated: 0.15 m/s² of bias, 2° of level.
    for (recording, example) in [
        ("walk0827-x20p-imu", "walk-adis16465.toml"),
        ("drive0708-adis16465-rtk", "car-adis16465.toml"),
    ] {
        let Some([forward, right, down]) = rest_b(recording, example, 5.0) else {
            continue;
        };
        assert!(
            forward.abs() < 0.35 && right.abs() < 0.35,
            "{forward} {right}"
        );
        assert!((down + 9.8).abs() < 0.15, "{down}");
    }
}

/// A car drives where it points: while it speeds up, the unit measures it along the body's x axis, and
/// in a bend to the right along its y axis.
#[test]
fn the_car_speeds_up_forwards_and_turns_sidewards() {
    let Some(track) = shared("data/drive0708-adis16465-rtk/gnss_1934_sf.pos") else {
        return;
    };
    let Some(path) = shared("data/drive0708-adis16465-rtk/derived_imu_gpst_unfiltered.csv") else {
        return;
    };
    let settings = example("car-adis16465.toml").imu.unwrap();
    let recorded = imu::read(&path, Some(&settings)).unwrap();
    let text = std::fs::read_to_string(track).unwrap();
    let rows: Vec<(f64, f64, f64)> = text
        .lines()
        .filter(|line| !line.starts_with('%'))
        .map(|line| {
            let words: Vec<&str> = line.split_whitespace().collect();
            let clock: Vec<f64> = words[1].split(':').map(|w| w.parse().unwrap()).collect();
            let second_of_day = clock[0] * 3600.0 + clock[1] * 60.0 + clock[2];
            (
                second_of_day,
                words[15].parse().unwrap(),
                words[16].parse().unwrap(),
            )
        })
        .collect();
    // Mean of both over each second around an epoch in motion.
    let mut sums = [[0.0; 2]; 2];
    let mut squares = [0.0; 2];
    let mut next = 0;
    for window in rows.windows(5) {
        let [before, _, now, _, after] = window else {
            continue;
        };
        let speed = now.1.hypot(now.2);
        if speed < 5.0 {
            continue;
        }
        let course = |row: &(f64, f64, f64)| row.2.atan2(row.1);
        let turn = (course(after) - course(before)).sin().asin();
        let step_s = after.0 - before.0;
        let forward = (after.1.hypot(after.2) - before.1.hypot(before.2)) / step_s;
        let right = speed * turn / step_s;
        let of_day = |sample: &ImuSample| sample.time.tow_s() % 86_400.0;
        while next < recorded.samples.len() && of_day(&recorded.samples[next]) < before.0 {
            next += 1;
        }
        let (mut dv, mut over_s) = ([0.0; 3], 0.0);
        for sample in &recorded.samples[next..] {
            if of_day(sample) > after.0 {
                break;
            }
            for (sum, value) in dv.iter_mut().zip(sample.dv_is_s_mps) {
                *sum += value;
            }
            over_s += f64::from(sample.interval_ns) * 1e-9;
        }
        let f_b = recorded
            .unit
            .c_b_s
            .map(|row| (row[0] * dv[0] + row[1] * dv[1] + row[2] * dv[2]) / over_s);
        for (k, truth) in [forward, right].into_iter().enumerate() {
            squares[k] += truth * truth;
            for (sum, measured) in sums[k].iter_mut().zip(f_b) {
                *sum += truth * measured;
            }
        }
    }
    // Regression of what was measured along x and y on what the track says of each.
    let slope = |k: usize, axis: usize| sums[k][axis] / squares[k];
    println!(
        "forward: {:.2} along x, {:.2} along y; right: {:.2} along x, {:.2} along y",
        slope(0, 0),
        slope(0, 1),
        slope(1, 0),
        slope(1, 1)
    );
    assert!((0.8..1.2).contains(&slope(0, 0)) && (0.8..1.2).contains(&slope(1, 1)));
    assert!(slope(0, 1).abs() < 0.25 && slope(1, 0).abs() < 0.25);
}

#[test]
fn the_walk_is_replayed_from_rinex_with_its_unit() {
    let folder = "data/walk0827-x20p-imu";
    let (Some(gnss), Some(nav), Some(path)) = (
        shared(&format!("{folder}/derived_convbin.obs")),
        shared(&format!("{folder}/derived_convbin.nav")),
        shared(&format!("{folder}/derived_imu_gpst_unfiltered.csv")),
    ) else {
        return;
    };
    let settings = example("walk-adis16465.toml");
    let config = settings.config().unwrap();
    let unit = imu::read(&path, settings.imu.as_ref()).unwrap();
    let nav = [nav];
    let stream = |imu| {
        source::stream(&gnss, &nav, &config, &[], 1, imu)
            .unwrap()
            .bytes
    };
    let count = check_order(&stream(Some(&unit)), &stream(None), &unit.samples);
    assert_eq!((count, unit.samples.len()), (536, 20_455));
}
