//! The NMEA sentences of a replay, read by the `nmea` crate and by pynmea2, say what `epochs.csv` says, to the
//! printed digits; and whatever a report holds, its sentences are sentences.

mod common;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use nmea::sentences::{FaaMode, FixType, parse_gga, parse_gst, parse_rmc, rmc::RmcStatusOfFix};
use proptest::prelude::*;
use serde_json::Value;
use surefix_core::config::{Config, IonosphereModel};
use surefix_core::gnss::satellite::SystemSet;
use surefix_core::gnss::solution::SATELLITE_REASONS;
use surefix_core::gnss::{Satellite, SatelliteSet, System};
use surefix_core::integrity::{
    InertialStatus, Integrity, Mode, Phase, ProtectionLevel, Reason, Suspect, Verdict,
};
use surefix_core::report::{EpochReport, Fix, ReportFlags};
use surefix_core::sentences::{self, MAX_SENTENCES_BYTES};
use surefix_core::time::{self, GpsTime, NS_PER_S};
use surefix_core::wire::nmea::MAX_SENTENCE_LENGTH;
use surefix_host_tests::replay::{self, ReplayOptions, TruthChoice};
use surefix_host_tests::simulate::{self, atmosphere::Ionosphere, flight::Flight};
use surefix_host_tests::truth::Truth;

/// What a reader understood of an epoch, or what it should have.
#[derive(Clone, Debug, Default, PartialEq)]
struct Read {
    numbers: BTreeMap<&'static str, Option<f64>>,
    texts: BTreeMap<&'static str, String>,
}

/// Numbers, and half of the last digit printed.
const NUMBERS: [(&str, f64); 20] = [
    ("time_s", 0.005),
    ("lat_deg", 0.5e-7 / 60.0),
    ("lon_deg", 0.5e-7 / 60.0),
    ("quality", 0.0),
    ("n_sats", 0.0),
    ("h_m", 0.000_5),
    ("separation_m", 0.0),
    ("speed_kn", 0.005),
    ("course_deg", 0.005),
    ("rms_m", 0.000_5),
    ("sigma_lat_m", 0.000_5),
    ("sigma_lon_m", 0.000_5),
    ("sigma_h_m", 0.000_5),
    ("error_lat_m", 0.000_5),
    ("error_lon_m", 0.000_5),
    ("error_h_m", 0.000_5),
    ("satellite", 0.0),
    ("p_md", 0.000_005),
    ("bias_m", 0.005),
    ("sigma_bias_m", 0.005),
];

/// Rows of `epochs.csv` by the names of their columns.
fn rows(text: &str) -> Vec<BTreeMap<&str, &str>> {
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    lines
        .map(|line| names.iter().copied().zip(line.split(',')).collect())
        .collect()
}

/// What the sentences of a row must say.
fn expected(row: &BTreeMap<&str, &str>) -> Read {
    let number = |name: &str| row[name].parse::<f64>().ok();
    let is_usable = matches!(row["integrity"], "nominal" | "excluded");
    let usable = |name: &str| number(name).filter(|_| is_usable);
    let mut read = Read::default();
    let mut put = |name, value| read.numbers.insert(name, value);
    let week = row["week"].parse().ok();
    let utc = week.map(|week: i32| {
        let tow_ns = (number("tow_s").unwrap() * NS_PER_S as f64).round() as i64;
        time::utc(GpsTime::from_week_tow_ns(week, tow_ns))
    });
    put(
        "time_s",
        utc.map(|utc| {
            let minutes = f64::from(utc.hour) * 60.0 + f64::from(utc.minute);
            minutes * 60.0 + utc.ns_of_minute as f64 / NS_PER_S as f64
        }),
    );
    put("lat_deg", usable("lat_deg"));
    put("lon_deg", usable("lon_deg"));
    put("h_m", usable("h_m"));
    put("separation_m", usable("h_m").map(|_| 0.0));
    let n_sats = number("n_sats").unwrap();
    put("n_sats", Some(n_sats));
    let mode = match (is_usable, n_sats > 0.0) {
        (false, _) => "N",
        (true, false) => "E",
        (true, true) => "A",
    };
    let quality = match mode {
        "N" => 0.0,
        "E" => 6.0,
        _ => 1.0,
    };
    put("quality", Some(quality));
    let velocity_mps = usable("ve_mps").zip(usable("vn_mps"));
    let speed_mps = velocity_mps.map(|(east, north)| east.hypot(north));
    put("speed_kn", speed_mps.map(|mps| mps * 3600.0 / 1852.0));
    let course_deg = velocity_mps.map(|(east, north)| east.atan2(north).to_degrees());
    let is_moving = speed_mps.is_some_and(|mps| mps >= sentences::SLOWEST_COURSE_MPS);
    put(
        "course_deg",
        course_deg
            .filter(|_| is_moving)
            .map(|deg| deg.rem_euclid(360.0)),
    );
    put("rms_m", number("residual_rms_m"));
    for (names, column) in [
        (["sigma_lat_m", "error_lat_m"], "sigma_n_m"),
        (["sigma_lon_m", "error_lon_m"], "sigma_e_m"),
        (["sigma_h_m", "error_h_m"], "sigma_u_m"),
    ] {
        for name in names {
            put(name, usable(column));
        }
    }
    let suspect = [row["suspect"], row["excluded"].split('+').next().unwrap()];
    let satellite = suspect.into_iter().find(|name| *name != "-");
    put(
        "satellite",
        satellite.map(|name| name[1..].parse().unwrap()),
    );
    put("p_md", number("p_md"));
    put("bias_m", number("bias_m"));
    put("sigma_bias_m", number("sigma_bias_m"));

    let date = utc.map(|utc| format!("{:04}-{:02}-{:02}", utc.year, utc.month, utc.day));
    let is_unsafe = matches!(row["reason"], "hpl_above_limit" | "vpl_above_limit");
    let status = match row["integrity"] {
        _ if is_usable => "S",
        "alert" => "U",
        _ if is_unsafe => "U",
        _ if row["lat_deg"].is_empty() => "V",
        _ => "C",
    };
    let systems: std::collections::BTreeSet<char> = row["used"]
        .split('+')
        .filter_map(|name| name.chars().next())
        .filter(|letter| *letter != '-')
        .collect();
    let talker = match systems.into_iter().collect::<String>().as_str() {
        "G" => "GP",
        "E" => "GA",
        "C" => "GB",
        _ => "GN",
    };
    for (name, text) in [
        ("talker", talker),
        ("date", date.as_deref().unwrap_or("")),
        ("status", if is_usable { "A" } else { "V" }),
        ("mode", mode),
        ("navigational", status),
    ] {
        read.texts.insert(name, text.into());
    }
    read
}

/// The field of a sentence, by its number.
fn field(line: &str, number: usize) -> &str {
    let content = line.split('*').next().unwrap();
    content.split(',').nth(number).unwrap()
}

/// Four sentences as the `nmea` crate reads them; it does not understand a GBS with errors in it, nor the
/// navigational status of version 4.1, which are taken from between the commas.
fn by_the_nmea_crate(lines: &[&str]) -> Read {
    let [gga, rmc, gst, gbs] = lines else {
        panic!("{lines:?}");
    };
    let parse = |line| {
        let sentence = nmea::parse_nmea_sentence(line).unwrap();
        assert_eq!(sentence.checksum, sentence.calc_checksum(), "{line}");
        sentence
    };
    let mut read = Read::default();
    let talker = parse(gga).talker_id.to_owned();
    assert!(lines.iter().all(|line| parse(line).talker_id == talker));
    read.texts.insert("talker", talker);
    let seconds = |time: String| -> f64 {
        let parts: Vec<f64> = time.split(':').map(|part| part.parse().unwrap()).collect();
        parts[0] * 3600.0 + parts[1] * 60.0 + parts[2]
    };

    let data = parse_gga(parse(gga)).unwrap();
    let time_s = data.fix_time.map(|time| seconds(time.to_string()));
    let mut put = |name, value| read.numbers.insert(name, value);
    put("time_s", time_s);
    put("lat_deg", data.latitude);
    put("lon_deg", data.longitude);
    put("h_m", data.altitude.map(f64::from));
    put("separation_m", data.geoid_separation.map(f64::from));
    put("n_sats", data.fix_satellites.map(f64::from));
    put(
        "quality",
        match data.fix_type {
            Some(FixType::Invalid) => Some(0.0),
            Some(FixType::Gps) => Some(1.0),
            Some(FixType::Estimated) => Some(6.0),
            _ => None,
        },
    );
    assert_eq!(data.hdop, None);

    let data = parse_rmc(parse(rmc)).unwrap();
    assert_eq!(data.fix_time.map(|time| seconds(time.to_string())), time_s);
    assert_eq!(
        (data.lat, data.lon),
        (read.numbers["lat_deg"], read.numbers["lon_deg"])
    );
    let mut put = |name, value: Option<f32>| read.numbers.insert(name, value.map(f64::from));
    put("speed_kn", data.speed_over_ground);
    put("course_deg", data.true_course);
    let date = data.fix_date.map(|date| date.to_string());
    read.texts.insert("date", date.unwrap_or_default());
    let status = match data.status_of_fix {
        RmcStatusOfFix::Autonomous => "A",
        RmcStatusOfFix::Invalid => "V",
        RmcStatusOfFix::Differential => "D",
    };
    let mode = match data.faa_mode {
        Some(FaaMode::Autonomous) => "A",
        Some(FaaMode::Estimated) => "E",
        Some(FaaMode::DataNotValid) => "N",
        _ => "",
    };
    for (name, text) in [
        ("status", status),
        ("mode", mode),
        ("navigational", field(rmc, 13)),
    ] {
        read.texts.insert(name, text.into());
    }

    let data = parse_gst(parse(gst)).unwrap();
    assert_eq!(data.time.map(|time| seconds(time.to_string())), time_s);
    let mut put = |name, value: Option<f32>| read.numbers.insert(name, value.map(f64::from));
    put("rms_m", data.rms_sd);
    put("sigma_lat_m", data.lat_sd);
    put("sigma_lon_m", data.long_sd);
    put("sigma_h_m", data.alt_sd);
    assert_eq!(data.ellipse_semi_major_sd, None);

    for (number, name) in [
        (2, "error_lat_m"),
        (3, "error_lon_m"),
        (4, "error_h_m"),
        (5, "satellite"),
        (6, "p_md"),
        (7, "bias_m"),
        (8, "sigma_bias_m"),
    ] {
        read.numbers.insert(name, field(gbs, number).parse().ok());
    }
    assert_eq!(field(gbs, 1), field(gga, 1));
    read
}

/// A Python with pynmea2, in an environment of its own below the target directory; `None`, said aloud,
/// where there is none to be had.
fn python() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("pynmea2");
    let python = folder.join("bin/python");
    let succeeds = |command: &mut Command| match command.output() {
        Ok(output) if output.status.success() => Ok(()),
        Ok(output) => Err(String::from_utf8_lossy(&output.stderr).trim().to_owned()),
        Err(error) => Err(error.to_string()),
    };
    let is_there = || succeeds(Command::new(&python).args(["-c", "import pynmea2"])).is_ok();
    if !is_there() {
        let made = succeeds(Command::new("python3").args(["-m", "venv"]).arg(&folder));
        let installed = made.and_then(|()| {
            succeeds(Command::new(&python).args([
                "-m",
                "pip",
                "install",
                "--quiet",
                "--disable-pip-version-check",
                "--no-input",
                "pynmea2==1.19.0",
            ]))
        });
        if let Err(why) = installed {
            eprintln!(
                "SKIPPED: pynmea2 cannot be installed, the sentences have one reader less: {why}"
            );
            return None;
        }
    }
    is_there().then_some(python)
}

/// The epochs of a file as pynmea2 reads them.
fn by_pynmea2(python: &Path, file: &Path) -> Vec<Read> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/sentences/read.py");
    let done = Command::new(python).arg(script).arg(file).output().unwrap();
    assert!(
        done.status.success(),
        "{}",
        String::from_utf8_lossy(&done.stderr)
    );
    let text = String::from_utf8(done.stdout).unwrap();
    let lines: Vec<Value> = text
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let (epochs, rest) = lines.as_chunks::<4>();
    assert!(rest.is_empty());
    let read = |[gga, rmc, gst, gbs]: &[Value; 4]| {
        let types = [gga, rmc, gst, gbs].map(|line| line["type"].as_str().unwrap());
        assert_eq!(types, ["GGA", "RMC", "GST", "GBS"]);
        for line in [rmc, gst, gbs] {
            assert_eq!(line["timestamp"], gga["timestamp"]);
        }
        assert_eq!(rmc["latitude"], gga["latitude"]);
        assert_eq!(rmc["longitude"], gga["longitude"]);
        let mut read = Read::default();
        for (name, line, field) in [
            ("time_s", gga, "timestamp"),
            ("lat_deg", gga, "latitude"),
            ("lon_deg", gga, "longitude"),
            ("quality", gga, "gps_qual"),
            ("n_sats", gga, "num_sats"),
            ("h_m", gga, "altitude"),
            ("separation_m", gga, "geo_sep"),
            ("speed_kn", rmc, "spd_over_grnd"),
            ("course_deg", rmc, "true_course"),
            ("rms_m", gst, "rms"),
            ("sigma_lat_m", gst, "std_dev_latitude"),
            ("sigma_lon_m", gst, "std_dev_longitude"),
            ("sigma_h_m", gst, "std_dev_altitude"),
            ("error_lat_m", gbs, "lat_err"),
            ("error_lon_m", gbs, "lon_err"),
            ("error_h_m", gbs, "alt_err"),
            ("satellite", gbs, "sat_prn_num_f"),
            ("p_md", gbs, "pro_miss"),
            ("bias_m", gbs, "est_bias"),
            ("sigma_bias_m", gbs, "est_bias_dev"),
        ] {
            read.numbers.insert(name, line[field].as_f64());
        }
        for (name, line, field) in [
            ("talker", gga, "talker"),
            ("date", rmc, "datestamp"),
            ("status", rmc, "status"),
            ("mode", rmc, "mode_indicator"),
            ("navigational", rmc, "nav_status"),
        ] {
            let text = line[field].as_str().unwrap_or_default();
            read.texts.insert(name, text.to_owned());
        }
        read
    };
    epochs.iter().map(read).collect()
}

fn assert_same(read: &Read, expected: &Read, what: &str) {
    assert_eq!(read.texts, expected.texts, "{what}");
    for (name, half_digit) in NUMBERS {
        let far = match (read.numbers[name], expected.numbers[name]) {
            (None, None) => 0.0,
            (Some(read), Some(expected)) => {
                let turn = match name {
                    "course_deg" => 360.0,
                    "time_s" => 86_400.0,
                    _ => f64::INFINITY,
                };
                let difference = (read - expected).abs();
                let difference = difference.min(turn - difference);
                // The nmea crate has some numbers in single precision.
                let digits = match name {
                    "lat_deg" | "lon_deg" => 1e-14,
                    _ => 1.2e-7,
                };
                difference - half_digit - digits * expected.abs()
            }
            _ => f64::INFINITY,
        };
        assert!(
            far <= 1e-9 * half_digit,
            "{what}, {name}: {:?} instead of {:?}",
            read.numbers[name],
            expected.numbers[name]
        );
    }
}

/// Replays, reads what was written with both readers, and gives the rows' expectations.
fn read_back(options: &ReplayOptions, name: &str) -> Vec<Read> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("sentences_{name}"));
    let result = replay::run(options, &mut |_, _| {}).unwrap();
    replay::write(options, &result, &folder).unwrap();
    let csv = std::fs::read_to_string(folder.join("epochs.csv")).unwrap();
    let file = folder.join("sentences.nmea");
    let text = std::fs::read_to_string(&file).unwrap();
    let expected: Vec<Read> = rows(&csv).iter().map(expected).collect();
    assert!(!expected.is_empty());
    let lines: Vec<&str> = text.split_inclusive("\r\n").collect();
    let (epochs, rest) = lines.as_chunks::<4>();
    assert_eq!((epochs.len(), rest.len()), (expected.len(), 0));
    for (k, (lines, expected)) in epochs.iter().zip(&expected).enumerate() {
        assert_same(
            &by_the_nmea_crate(lines),
            expected,
            &format!("{name}, epoch {k}"),
        );
    }
    let readers = match python() {
        Some(python) => {
            let epochs = by_pynmea2(&python, &file);
            assert_eq!(epochs.len(), expected.len());
            for (k, (read, expected)) in epochs.iter().zip(&expected).enumerate() {
                assert_same(read, expected, &format!("{name}, epoch {k}, pynmea2"));
            }
            "nmea, pynmea2"
        }
        None => "nmea",
    };
    let longest = epochs.iter().map(|lines| lines.concat().len()).max();
    println!(
        "{name}: {} epochs, {:.1} bytes each, {} at most; read by {readers}",
        expected.len(),
        text.len() as f64 / expected.len() as f64,
        longest.unwrap(),
    );
    expected
}

fn approach(name: &str, faults: &[&str]) -> ReplayOptions {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("sentences_of_{name}"));
    simulate::run(&simulate::Args {
        receiver: simulate::stream::Format::Rtcm3,
        disturbances: simulate::disturbances::Disturbances::default(),
        name: Flight::Approach,
        seed: 1,
        out: folder.clone(),
        rate_hz: 1.0,
        duration: None,
        noise_free: false,
        dual_frequency: false,
        no_troposphere: false,
        ionosphere: Ionosphere::Klobuchar,
        faults: faults.iter().map(|fault| fault.parse().unwrap()).collect(),
    })
    .unwrap();
    let mut options = ReplayOptions::new(folder.join("receiver.rtcm3"));
    options.config.phase = Phase::Lpv200;
    options
}

/// INT-055, INT-056. The bias of the satellite that was taken out is the one that was put on it.
#[test]
fn an_approach_with_a_ramp_on_a_satellite() {
    let epochs = read_back(&approach("ramp", &["G04:ramp:0.5:90:200"]), "ramp");
    let (mut excluded, mut worst) = (0, 0.0_f64);
    for (t_s, epoch) in epochs.iter().enumerate() {
        let number = |name| epoch.numbers[name];
        if let (Some(bias_m), Some(sigma_m)) = (number("bias_m"), number("sigma_bias_m")) {
            assert_eq!(number("satellite"), Some(4.0), "{t_s} s");
            // It stays out for five minutes after its ramp has ended.
            let ramp_s = if t_s < 200 { t_s as f64 - 90.0 } else { 0.0 };
            let true_m = 0.5 * ramp_s;
            worst = worst.max((bias_m - true_m).abs() / sigma_m);
            excluded += 1;
        }
    }
    println!("{excluded} epochs with a bias, at most {worst:.2} sigma from the ramp");
    assert!(excluded > 60 && worst < 4.0, "{excluded}, {worst}");
}

/// INT-055. Nothing may be excluded: an alert, a suspect, and nothing to steer by.
#[test]
fn an_approach_with_faults_that_cannot_be_told_apart() {
    let faults = [
        "G04:step:60:60:200",
        "G07:step:-45:60:200",
        "G10:step:80:60:200",
        "G12:step:-70:60:200",
    ];
    let mut options = approach("alert", &[]);
    options.config.systems = SystemSet::EMPTY.with(System::Gps);
    options.config.max_exclusions = 0;
    options.faults = faults.iter().map(|fault| fault.parse().unwrap()).collect();
    let epochs = read_back(&options, "alert");
    let alerts = epochs
        .iter()
        .filter(|epoch| epoch.texts["navigational"] == "U")
        .count();
    let suspects = epochs
        .iter()
        .filter(|epoch| epoch.numbers["bias_m"].is_some())
        .count();
    println!("{alerts} epochs called unsafe, {suspects} with a suspect");
    assert!(alerts > 60 && suspects > 60, "{alerts}, {suspects}");
}

/// INT-055. With the filter, an exclusion, and coasting.
#[test]
fn flights_with_an_inertial_unit() {
    for (name, more) in [
        ("lpv200_step", &["--duration", "180"][..]),
        ("coasting", &[]),
    ] {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("sentences_of_{name}"));
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
        let epochs = read_back(&options, name);
        let usable = epochs
            .iter()
            .filter(|epoch| epoch.texts["status"] == "A")
            .count();
        assert!(usable > 100, "{name}: {usable}");
    }
}

/// INT-055.
#[test]
fn recordings() {
    let gps_bds = Config {
        systems: SystemSet::EMPTY.with(System::Gps).with(System::Bds),
        ..Config::PRESET
    };
    let folder = "data/esbc-2020-177";
    if let Some(gnss) = common::shared(&format!("{folder}/ESBC_2020177_0000-0400.rnx")) {
        let nav = common::shared(&format!("{folder}/ESBC00DNK_R_20201770000_01D_MN.rnx.gz"));
        let mut options = ReplayOptions::new(gnss);
        options.nav.extend(nav);
        options.config = gps_bds;
        assert_eq!(read_back(&options, "esbjerg").len(), 480);
    }
    let rollover = "data/rtcm3-str1-week-rollover-2018/week-rollover-STR24.rtcm3";
    if let Some(gnss) = common::shared(rollover) {
        let mut options = ReplayOptions::new(gnss);
        options.config = gps_bds;
        options.config.ionosphere = IonosphereModel::None;
        let epochs = read_back(&options, "rollover");
        let dates: std::collections::BTreeSet<_> =
            epochs.iter().map(|e| &e.texts["date"]).collect();
        // None while the week is not known.
        let dates: Vec<&str> = dates.into_iter().map(String::as_str).collect();
        assert_eq!(dates, ["", "2018-07-14", "2018-07-15"]);
    }
}

fn any_satellite() -> impl Strategy<Value = Satellite> {
    (0..Satellite::COUNT).prop_map(|index| Satellite::from_index(index).unwrap())
}

/// A number of a usual size, or anything at all.
fn number(size: f64) -> impl Strategy<Value = f64> {
    prop_oneof![3 => -size..size, 1 => prop::num::f64::ANY]
}

fn numbers(size: f64) -> impl Strategy<Value = [f64; 3]> {
    [number(size), number(size), number(size)]
}

fn any_fix() -> impl Strategy<Value = Option<Fix>> {
    let parts = (
        number(95.0),
        number(185.0),
        number(1.1e6),
        prop::option::of(numbers(6000.0)),
    );
    prop::option::of(
        parts.prop_map(|(lat_deg, lon_deg, h_m, velocity_enu_mps)| Fix {
            r_e_m: [0.0; 3],
            lat_deg,
            lon_deg,
            h_m,
            velocity_enu_mps,
            clock_m: [None; 3],
        }),
    )
}

fn any_suspect() -> impl Strategy<Value = Option<Suspect>> {
    let parts = (any_satellite(), number(1.1e6), number(1.1e4), number(1.0));
    prop::option::of(
        parts.prop_map(|(satellite, bias_m, sigma_m, p_md)| Suspect {
            satellite,
            bias_m,
            sigma_m,
            p_md,
        }),
    )
}

prop_compose! {
    fn any_report()(
        ns in prop_oneof![any::<i64>(), 0..1_900_000_000_000_000_000_i64],
        fix in any_fix(),
        integrity in 0..4_u8,
        reason in 0..Reason::ALL.len(),
        masks in any::<[[u64; 3]; 2]>(),
        flags in any::<u8>(),
        residual_rms_m in prop::option::of(number(1.1e4)),
        sigma_enu_m in prop::option::of(numbers(1.1e4)),
        suspect in any_suspect(),
    ) -> EpochReport {
        let mut verdict = Verdict::unavailable(Reason::ALL[reason], 40.0, None);
        verdict.integrity = Integrity::from_u8(integrity).unwrap();
        verdict.hpl = ProtectionLevel::Bound(1.0);
        verdict.excluded = SatelliteSet::from_masks(masks[1]);
        EpochReport {
            time: GpsTime::from_ns(ns),
            since_first_ns: 0,
            mode: Mode::Snapshot,
            fix,
            verdict,
            used: SatelliteSet::from_masks(masks[0]),
            n_observed: 0,
            unused: [0; SATELLITE_REASONS],
            flags: ReportFlags::from_bits(flags),
            residual_rms_m,
            sigma_enu_m,
            suspect,
            navigation: None,
            inertial: InertialStatus::Off,
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// INT-056. Four sentences, each with its checksum, of printable ASCII and at most 82 characters; and a
    /// position only where the verdict lets it be used.
    #[test]
    fn any_report_gives_sentences(report in any_report()) {
        let mut out = [0; MAX_SENTENCES_BYTES];
        let length = sentences::encode(&report, &mut out).unwrap();
        let text = std::str::from_utf8(&out[..length]).unwrap();
        let lines: Vec<&str> = text.split_inclusive("\r\n").collect();
        prop_assert_eq!(lines.len(), 4);
        for (line, fields) in lines.iter().zip([14, 13, 8, 10]) {
            prop_assert!(line.len() <= MAX_SENTENCE_LENGTH, "{}", line);
            let content = line.strip_prefix('$').and_then(|line| line.strip_suffix("\r\n")).unwrap();
            prop_assert!(content.bytes().all(|byte| byte.is_ascii_graphic()), "{}", line);
            let (content, sum) = content.rsplit_once('*').unwrap();
            let expected = content.bytes().fold(0, |sum, byte| sum ^ byte);
            prop_assert_eq!(sum, format!("{expected:02X}"));
            prop_assert_eq!(content.split(',').count(), 1 + fields, "{}", line);
            prop_assert!(nmea::parse_nmea_sentence(line).is_ok(), "{}", line);
        }
        let has_position = !field(lines[0], 2).is_empty();
        prop_assert!(!has_position || report.verdict.integrity.is_usable());
        prop_assert_eq!(field(lines[0], 6) != "0", has_position);
        prop_assert_eq!(field(lines[1], 2) == "A", has_position);
        prop_assert_eq!(field(lines[1], 13) == "S", has_position);
        prop_assert_eq!(field(lines[1], 3).is_empty(), !has_position);
        prop_assert!(has_position || field(lines[2], 6).is_empty());
    }
}
