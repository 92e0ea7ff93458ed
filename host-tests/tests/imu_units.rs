//! Three units in files of their own vote as they do in one stream.

use std::path::{Path, PathBuf};
use std::process::Command;

use surefix_core::ins::UnitConfig;
use surefix_core::ins::voting::UnitState;
use surefix_host_tests::imu::{self, Recorded};
use surefix_host_tests::replay::{self, ReplayOptions, ReplayResult};
use surefix_host_tests::settings::Settings;

/// The example, with columns of increments, which lose no bit.
fn example() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/examples/three-units.toml");
    let text = std::fs::read_to_string(path).unwrap();
    let timing = "tolerance = { timing_s = 50e-6 }";
    text.replace("m/s2", "m/s")
        .replace("rad/s", "rad")
        .replace("imu_m = [0.2,", &format!("{timing}\nimu_m = [0.2,"))
        .replace("imu_m = [-0.15,", &format!("{timing}\nimu_m = [-0.15,"))
}

fn settings(folder: &Path, text: &str) -> Settings {
    let path = folder.join("units.toml");
    std::fs::write(&path, text).unwrap();
    Settings::read(&path).unwrap()
}

/// A minute of a flight in which unit 1 lies from 30 s on.
fn flown(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    let output = Command::new(env!("CARGO_BIN_EXE_surefix"))
        .args(["simulate", "lpv200_ramp", "--seed", "3", "--duration", "60"])
        .args(["--imu", "mems", "--units", "--imu-fault", "1:step:5:30:60"])
        .arg("--out")
        .arg(&folder)
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    folder
}

/// Writes a file per unit.
fn split(recorded: &Recorded, folder: &Path) -> Vec<PathBuf> {
    let write = |unit: u8| {
        let mut text = "tow_s,f_x,f_y,f_z,w_x,w_y,w_z\n".to_owned();
        for (_, sample) in recorded.unit_samples.iter().filter(|(of, _)| *of == unit) {
            let sample = &sample.sample;
            let tow_ns = sample.time.tow_ns();
            text += &format!("{}.{:09}", tow_ns / 1_000_000_000, tow_ns % 1_000_000_000);
            for value in sample.dv_is_s_mps.iter().chain(&sample.dtheta_is_s_rad) {
                text += &format!(",{value:e}");
            }
            text.push('\n');
        }
        let path = folder.join(format!("unit-{unit}.csv"));
        std::fs::write(&path, text).unwrap();
        path
    };
    (0..3).map(write).collect()
}

fn replayed(folder: &Path, imu: Vec<PathBuf>, settings: Settings) -> ReplayResult {
    let mut options = ReplayOptions::new(folder.join("receiver.rtcm3"));
    options.imu = imu;
    options.imu_settings = settings.imu;
    replay::run(&options, &mut |_, _| {}).unwrap()
}

#[test]
fn three_files_vote_as_one_stream_does() {
    let folder = flown("imu-units");
    let stream = folder.join("units.sfx");
    let together = imu::read(&stream, None).unwrap();
    let files = split(&together, &folder);
    let whole = settings(&folder, &example());
    let apart = imu::read_all(&files, whole.imu.as_ref()).unwrap();
    assert_eq!(apart.unit_samples.len(), together.unit_samples.len());
    for ((of, read), (unit, sent)) in apart.unit_samples.iter().zip(&together.unit_samples) {
        assert_eq!((of, read.sample), (unit, sent.sample));
    }
    for ((_, read), (_, sent)) in apart.units.iter().zip(&together.units) {
        let numbers = |config: &UnitConfig| {
            let mut all: Vec<f64> = config.c_b_s.iter().flatten().copied().collect();
            all.extend(config.lever_arm_b_m);
            all.extend([config.noise.arw, config.noise.vrw, config.tolerance.scale]);
            all.extend([config.tolerance.gyro_bias_radps, config.range.rate_radps]);
            all.push(config.tolerance.accel_bias_mps2);
            all
        };
        for (read, sent) in numbers(read).iter().zip(numbers(sent)) {
            assert!((read - sent).abs() < 1e-12, "{read} {sent}");
        }
        assert_eq!(read.interval_ns, sent.interval_ns);
    }

    let (alone, _) = whole_without_units();
    let by_stream = replayed(&folder, vec![stream], settings(&folder, &alone));
    let by_files = replayed(&folder, files, whole);
    assert_eq!(by_files.reports.len(), by_stream.reports.len());
    let mut tight = 0;
    for (one, other) in by_files.reports.iter().zip(&by_stream.reports) {
        assert_eq!(one.inertial, other.inertial);
        assert_eq!(one.fix.is_some(), other.fix.is_some());
        if let (Some(one), Some(other)) = (&one.fix, &other.fix) {
            let apart_m = (0..3)
                .map(|k| (one.r_e_m[k] - other.r_e_m[k]).abs())
                .fold(0.0, f64::max);
            assert!(apart_m < 1e-8, "{apart_m}");
        }
        tight += usize::from(one.navigation.is_some());
    }
    assert!(tight > 20, "{tight}");
    let last = by_files.inertial.last().unwrap().unwrap();
    assert_ne!(last.units[1].state, UnitState::Used);
    assert_eq!(last.units[0].state, UnitState::Used);
    assert_eq!(last.units[2].state, UnitState::Used);
}

/// The example without its units, and the sections of these.
fn whole_without_units() -> (String, String) {
    let text = example();
    let at = text.find("[[imu.unit]]\n").unwrap();
    (text[..at].to_owned(), text[at..].to_owned())
}

#[test]
fn what_does_not_fit_is_refused_with_the_next_step() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("imu-units-refused");
    std::fs::create_dir_all(&folder).unwrap();
    let csv = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let header = "tow_s,f_x,f_y,f_z,w_x,w_y,w_z\n";
    let good = csv("good.csv", &format!("{header}1.00,0,0,-9.8,0,0,0\n"));
    let empty = csv("empty.csv", header);
    let (imu, units) = whole_without_units();
    let refused = |files: &[&PathBuf], text: &str, words: &[&str]| {
        let settings = settings(&folder, text).imu;
        let files: Vec<PathBuf> = files.iter().map(|path| (*path).clone()).collect();
        let error = imu::read_all(&files, settings.as_ref()).unwrap_err();
        let message = format!("{error:#}");
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
    };
    let three = [&good, &good, &good];
    refused(&three, &imu, &["3 --imu", "0 sections [[imu.unit]]"]);
    refused(&three[..2], &example(), &["2 --imu", "3 sections"]);
    refused(&three[..1], &example(), &["1 times", "two or three"]);
    refused(&[&good; 4], &example(), &["4 times"]);
    let last_empty = [&good, &good, &empty];
    refused(&last_empty, &example(), &["empty.csv", "no line"]);
    let wrong = |from: &str, to: &str| imu.clone() + &units.replace(from, to);
    let far = wrong("[0.0, -0.2, -0.1]", "[0.0, -200.0, -0.1]");
    refused(&three, &far, &["number 2", "100 m"]);
    let scale = wrong("scale = 2e-3", "scale = 0.5");
    refused(&three, &scale, &["number 2", "scale at most 0.1"]);
    let rate = wrong("rate_hz = 200", "rate_hz = 2000");
    refused(&three, &rate, &["number 1", "rate_hz"]);
    let none = imu::read_all(&[good.clone(), good.clone()], None).unwrap_err();
    assert!(none.to_string().contains("[[imu.unit]]"), "{none}");
}
