//! Flights with an inertial unit: their files are what a scenario folder must be, they repeat with
//! their seed, faults are where they are said to be, and the byte streams tell the same flight.

mod common;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use clap::ValueEnum;
use nalgebra::Vector3;
use surefix_core::config::{Config, IonosphereModel, TroposphereModel};
use surefix_core::gnss::solution::SnapshotWorkspace;
use surefix_core::gnss::{BroadcastIonosphere, CorrectedEpoch, EphemerisStore, SatelliteSet};
use surefix_core::ingest::{Event, Ingest};
use surefix_host_tests::scenario;
use surefix_host_tests::simulate::atmosphere::Ionosphere;
use surefix_host_tests::simulate::flight::Flight;
use surefix_host_tests::simulate::inertial::board::{Radio, imu_bytes, receiver_bytes, unit};
use surefix_host_tests::simulate::inertial::folder::files;
use surefix_host_tests::simulate::inertial::measurements::{
    sigma_pseudorange_m, sigma_range_rate_mps,
};
use surefix_host_tests::simulate::inertial::sensors::Grade;
use surefix_host_tests::simulate::inertial::{Request, Scenario, fly};
use surefix_host_tests::simulate::sky::WEEK;
use surefix_host_tests::simulate::stream::Format;

const RADIO: Radio = Radio {
    dual_frequency: false,
    ionosphere: Ionosphere::None,
    troposphere: true,
    format: Format::Rtcm3,
};

/// Every flight with an inertial unit.
fn flights() -> impl Iterator<Item = Flight> {
    let all = Flight::value_variants().iter().copied();
    all.filter(|flight| *flight != Flight::Approach)
}

fn short(flight: Flight, duration_s: u32) -> Request {
    Request {
        duration_s: Some(duration_s),
        ..Request::new(flight, 3)
    }
}

/// Writes the folder of a flight where tests may write.
fn written(name: &str, scenario: &Scenario) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).unwrap();
    for (name, text) in files(scenario, Format::Rtcm3) {
        std::fs::write(folder.join(name), text).unwrap();
    }
    folder
}

/// Columns of a file and its rows, as text.
fn table(folder: &Path, name: &str) -> (String, Vec<Vec<String>>) {
    let text = std::fs::read_to_string(folder.join(name)).unwrap();
    assert!(text.is_ascii() && text.ends_with('\n'), "{name}");
    let mut lines = text.lines().map(str::to_owned);
    let header = lines.next().unwrap();
    let rows: Vec<Vec<String>> = lines
        .map(|line| line.split(',').map(str::to_owned).collect())
        .collect();
    let columns = header.split(',').count();
    assert!(rows.iter().all(|row| row.len() == columns), "{name}");
    (header, rows)
}

fn number(text: &str) -> f64 {
    text.parse().unwrap()
}

/// Significant digits of a decimal.
fn digits(text: &str) -> usize {
    let mantissa = text.split('e').next().unwrap();
    let all: String = mantissa.chars().filter(char::is_ascii_digit).collect();
    all.trim_start_matches('0').len()
}

const INIT_KEYS: [&str; 45] = [
    "t0",
    "imu_dt",
    "pos_x",
    "pos_y",
    "pos_z",
    "vel_x",
    "vel_y",
    "vel_z",
    "q_w",
    "q_x",
    "q_y",
    "q_z",
    "bg_x",
    "bg_y",
    "bg_z",
    "ba_x",
    "ba_y",
    "ba_z",
    "clk_b",
    "clk_d",
    "std_pos",
    "std_vel",
    "std_att_n",
    "std_att_e",
    "std_att_d",
    "std_bg",
    "std_ba",
    "std_clk_b",
    "std_clk_d",
    "arw",
    "vrw",
    "bg_rw",
    "ba_rw",
    "clk_s_b",
    "clk_s_d",
    "clk_beta",
    "p_fa",
    "p_md",
    "p_h0",
    "hal",
    "val",
    "detect_axes",
    "exclude",
    "hold_s",
    "mask_deg",
];

#[test]
fn every_flight_runs_and_its_folder_is_what_the_format_asks() {
    for flight in flights() {
        let duration_s = 5;
        let flown = fly(&short(flight, duration_s)).unwrap();
        let folder = written(&format!("flights-{}", flight.name()), &flown);

        let (header, imu) = table(&folder, "imu.csv");
        assert_eq!(header, "t_s,dth_x,dth_y,dth_z,dv_x,dv_y,dv_z");
        assert_eq!(imu.len() as u32, duration_s * 100);
        for (k, row) in imu.iter().enumerate() {
            assert!((number(&row[0]) - 0.01 * (k + 1) as f64).abs() < 1e-12);
            assert!(row.iter().all(|text| digits(text) <= 15));
            let sample = &flown.imu[k];
            let increments = sample.dtheta_is_s_rad.iter().chain(&sample.dv_is_s_mps);
            assert!(row[1..].iter().map(|t| number(t)).eq(increments.copied()));
        }

        let (header, gnss) = table(&folder, "gnss.csv");
        assert_eq!(
            header,
            "t_s,sys,prn,sx,sy,sz,svx,svy,svz,pr,rr,sigma_pr,sigma_rr,el"
        );
        let mut per_epoch = BTreeMap::new();
        for row in &gnss {
            // The very time of an inertial row, the first at 1 s.
            assert!(imu.iter().any(|sample| sample[0] == row[0]), "{}", row[0]);
            assert!(number(&row[0]) >= 1.0);
            assert!(row[1] == "C" || row[1] == "G");
            assert!(number(&row[13]) >= 5.0_f64.to_radians());
            assert!(row[3..].iter().all(|text| digits(text) <= 15));
            *per_epoch.entry(number(&row[0]) as u32).or_insert(0) += 1;
        }
        assert!(per_epoch.keys().copied().eq(1..=duration_s));
        assert!(per_epoch.values().all(|n| (12..=24).contains(n)));

        let (header, truth) = table(&folder, "truth.csv");
        assert_eq!(
            header,
            "t_s,px,py,pz,vx,vy,vz,qw,qx,qy,qz,clk_b,clk_d,bg_x,bg_y,bg_z,ba_x,ba_y,ba_z"
        );
        assert_eq!(truth.len() as u32, duration_s + 1);
        for (k, row) in truth.iter().enumerate() {
            assert_eq!(number(&row[0]), k as f64);
            let q: Vec<f64> = row[7..11].iter().map(|text| number(text)).collect();
            assert!(q[0] >= 0.0 && (q.iter().map(|v| v * v).sum::<f64>() - 1.0).abs() < 1e-13);
        }

        let (header, faults) = table(&folder, "faults.csv");
        assert_eq!(header, "sat,kind,mag,t0,t1,rr,period");
        assert!(faults.is_empty(), "none begins in the first seconds");

        let (header, init) = table(&folder, "init.csv");
        assert_eq!(header, "key,value");
        let mut keys: Vec<&str> = init.iter().map(|row| row[0].as_str()).collect();
        let mut expected = INIT_KEYS;
        keys.sort_unstable();
        expected.sort_unstable();
        assert_eq!(keys, expected);

        // The reader of scenario folders takes it and reads the numbers as they were.
        let read = scenario::Scenario::read(&folder).unwrap();
        assert_eq!(read.imu.len(), flown.imu.len());
        assert_eq!(read.epochs.len() as u32, duration_s);
        for (read, flown) in read.epochs.iter().zip(&flown.epochs[1..]) {
            assert_eq!(read.rows.len(), flown.rows.len());
            for (read, flown) in read.rows.iter().zip(&flown.rows) {
                let m = &flown.measurement;
                assert_eq!(read.satellite, m.satellite);
                assert_eq!(read.r_es_e_m, m.r_es_e_m);
                assert_eq!(read.v_es_e_mps, m.v_es_e_mps);
                assert_eq!(read.pseudorange_m, m.pseudorange_m);
                let rate = (read.range_rate_mps, read.sigma_range_rate_mps);
                assert_eq!(Some(rate), m.range_rate_mps);
            }
        }
        assert_eq!(read.init.r_eb_e_m, flown.initial.r_eb_e_m);
        assert_eq!(read.init.q_e_b, flown.initial.q_e_b);
        assert_eq!(read.init.arw, flown.grade.noise().density.arw);
    }
}

fn everything(request: &Request) -> Vec<Vec<u8>> {
    let flown = fly(request).unwrap();
    let mut all: Vec<Vec<u8>> = files(&flown, Format::Rtcm3)
        .into_iter()
        .map(|(_, text)| text.into_bytes())
        .collect();
    all.push(receiver_bytes(&flown, &RADIO).unwrap());
    all.push(imu_bytes(&flown).unwrap());
    all
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_seed_others() {
    let request = Request {
        imu_rate_hz: 200,
        gnss_rate_hz: 5,
        ..short(Flight::UavSurvey, 12)
    };
    let first = everything(&request);
    assert_eq!(first, everything(&request));
    let other = everything(&Request { seed: 4, ..request });
    for (k, (a, b)) in first.iter().zip(&other).enumerate() {
        // No fault, so the list of faults is the same.
        assert_eq!(a == b, k == 4, "file {k}");
    }
}

#[test]
fn a_flight_cut_short_is_the_beginning_of_the_whole() {
    let (whole, cut) = (short(Flight::Npa, 20), short(Flight::Npa, 9));
    let (whole, cut) = (fly(&whole).unwrap(), fly(&cut).unwrap());
    assert_eq!(whole.imu[..cut.imu.len()], cut.imu);
    for (a, b) in whole.epochs.iter().zip(&cut.epochs) {
        assert!(
            a.rows
                .iter()
                .map(|r| r.measurement)
                .eq(b.rows.iter().map(|r| r.measurement))
        );
    }
    assert_eq!(whole.initial, cut.initial);
}

/// The value and rate that a line of faults.csv promises, where chance has no part in it.
fn promised(fault: &[String], t_s: f64) -> Option<(f64, f64)> {
    let [magnitude, t0, t1, period] = [2, 3, 4, 6].map(|k| number(&fault[k]));
    if t_s < t0 || t_s >= t1 {
        return Some((0.0, 0.0));
    }
    let angle = core::f64::consts::TAU / period;
    match fault[1].as_str() {
        "step" => Some((magnitude, 0.0)),
        "ramp" => Some((magnitude * (t_s - t0), magnitude)),
        "osc" => Some((
            magnitude * (angle * (t_s - t0)).sin(),
            magnitude * angle * (angle * (t_s - t0)).cos(),
        )),
        _ => None,
    }
}

#[test]
fn faults_of_the_measurements_are_those_of_the_list() {
    let clean = short(Flight::Lpv200, 30);
    let faulty = Request {
        faults: [
            "G04:step:12:5:10",
            "C22:ramp:0.5:8:20:rr",
            "C38:osc:3:6:25:rr:7",
            "G07:noise:4:4:24",
            "C28:walk:2:10:30:rr",
        ]
        .iter()
        .map(|spec| spec.parse().unwrap())
        .collect(),
        ..clean.clone()
    };
    let (clean, faulty) = (fly(&clean).unwrap(), fly(&faulty).unwrap());
    assert_eq!(clean.imu, faulty.imu);
    let folder = written("flights-faulty", &faulty);
    let (_, faults) = table(&folder, "faults.csv");
    assert_eq!(faults.len(), 5);
    let mut random_values = Vec::new();
    for (clean, faulty) in clean.epochs.iter().zip(&faulty.epochs) {
        let t_s = clean.t_s;
        assert_eq!(clean.rows.len(), faulty.rows.len());
        for (clean, faulty) in clean.rows.iter().zip(&faulty.rows) {
            let (clean, faulty) = (&clean.measurement, &faulty.measurement);
            let name = clean.satellite.to_string();
            let value_m = faulty.pseudorange_m - clean.pseudorange_m;
            let rate_mps = faulty.range_rate_mps.unwrap().0 - clean.range_rate_mps.unwrap().0;
            let fault = faults.iter().find(|fault| fault[0] == name);
            match fault.map(|fault| (fault, promised(fault, t_s))) {
                None => assert_eq!((value_m, rate_mps), (0.0, 0.0), "{name}"),
                Some((fault, Some((m, mps)))) => {
                    let mps = if fault[5] == "1" { mps } else { 0.0 };
                    assert!((value_m - m).abs() < 3e-7, "{name} at {t_s}: {value_m}");
                    assert!(
                        (rate_mps - mps).abs() < 1e-10,
                        "{name} at {t_s}: {rate_mps}"
                    );
                }
                Some((fault, None)) => {
                    assert_eq!(rate_mps != 0.0, value_m != 0.0 && fault[5] == "1", "{name}");
                    random_values.push((name, value_m));
                }
            }
        }
    }
    let count = |name: &str| {
        let own = random_values.iter().filter(|(other, _)| other == name);
        own.filter(|(_, value_m)| *value_m != 0.0).count()
    };
    // A walk begins at zero.
    assert_eq!((count("G07"), count("C28")), (20, 19));
}

#[test]
fn a_flights_own_fault_is_in_its_list() {
    for (flight, spec) in [
        (Flight::NpaRamp, "G04,ramp,1,300,500,0"),
        (Flight::NpaStep, "G04,step,30,300,500,0"),
        (Flight::Lpv200Ramp, "G04,ramp,0.5,120,270,0"),
        (Flight::Lpv200Step, "G04,step,25,120,270,0"),
    ] {
        let folder = written("flights-own-fault", &fly(&Request::new(flight, 1)).unwrap());
        let (_, faults) = table(&folder, "faults.csv");
        assert_eq!(faults[0][..6].join(","), spec);
    }
}

#[test]
fn coasting_leaves_three_two_one_and_no_satellites_for_a_minute_each() {
    let flown = fly(&Request::new(Flight::Coasting, 1)).unwrap();
    for epoch in &flown.epochs {
        let expected = match epoch.t_s {
            t if (180.0..240.0).contains(&t) => 3,
            t if (240.0..300.0).contains(&t) => 2,
            t if (300.0..360.0).contains(&t) => 1,
            t if (360.0..420.0).contains(&t) => 0,
            _ => {
                assert!(epoch.rows.len() >= 12);
                continue;
            }
        };
        assert_eq!(epoch.rows.len(), expected, "at {} s", epoch.t_s);
    }
    assert_eq!(flown.reference.hold_ns, 120_000_000_000);
}

/// The next event of a stream.
fn next(ingest: &mut Ingest, rest: &mut &[u8]) -> Event {
    loop {
        if rest.is_empty() {
            return ingest.finish();
        }
        let (used, event) = ingest.push(rest);
        *rest = &rest[used..];
        if event != Event::Nothing {
            return event;
        }
    }
}

/// What decodes from the stream, epoch by epoch, corrected by the core with the flight's own broadcasts.
fn decoded(flown: &Scenario, radio: &Radio) -> Vec<CorrectedEpoch> {
    let config = Config {
        reference_week: Some(WEEK as u16),
        mask_rad: 0.0,
        ionosphere: if radio.dual_frequency {
            IonosphereModel::IonosphereFree
        } else {
            IonosphereModel::None
        },
        troposphere: if radio.troposphere {
            TroposphereModel::Saastamoinen
        } else {
            TroposphereModel::None
        },
        ..Config::PRESET
    };
    let bytes = receiver_bytes(flown, radio).unwrap();
    let mut ingest = Box::new(Ingest::EMPTY);
    ingest.configure(&config);
    let mut store = Box::new(EphemerisStore::EMPTY);
    let mut workspace = Box::new(SnapshotWorkspace::EMPTY);
    let mut epochs: Vec<CorrectedEpoch> = Vec::new();
    let mut rest = &bytes[..];
    loop {
        let event = next(&mut ingest, &mut rest);
        match event {
            Event::Ephemeris(ephemeris) => store.insert(&ephemeris).unwrap(),
            Event::EpochReady => {
                let truth = &flown.epochs[epochs.len()];
                let state = flown.trajectory.state(truth.t_s);
                let mut corrected = CorrectedEpoch::EMPTY;
                workspace.prepare(ingest.epoch(), &store, &BroadcastIonosphere::EMPTY, &config);
                workspace
                    .corrected(
                        state.r_eb_e.into(),
                        state.v_eb_e.into(),
                        SatelliteSet::EMPTY,
                        &mut corrected,
                    )
                    .unwrap();
                epochs.push(corrected);
            }
            Event::EndOfStream => return epochs,
            _ => {}
        }
    }
}

/// Pseudorange and range rate minus those of the geometry they come with.
fn remainders(
    row: &surefix_core::gnss::CorrectedMeasurement,
    r: &Vector3<f64>,
    v: &Vector3<f64>,
) -> (f64, f64) {
    let line = Vector3::from(row.r_es_e_m) - r;
    let approach_mps = line.normalize().dot(&(Vector3::from(row.v_es_e_mps) - v));
    let rate_mps = row.range_rate_mps.unwrap().0;
    (row.pseudorange_m - line.norm(), rate_mps - approach_mps)
}

/// Largest differences between the stream and the folder: m, m/s.
fn differences(flown: &Scenario, radio: &Radio) -> (f64, f64) {
    let epochs = decoded(flown, radio);
    assert_eq!(epochs.len(), flown.epochs.len());
    let mut worst: (f64, f64) = (0.0, 0.0);
    for (stream, folder) in epochs.iter().zip(&flown.epochs) {
        let state = flown.trajectory.state(folder.t_s);
        assert_eq!(stream.time.seconds_since(flown.start), folder.t_s);
        assert_eq!(stream.rows.len(), folder.rows.len());
        for row in &folder.rows {
            let satellite = row.measurement.satellite;
            let mut rows = stream.rows.iter();
            let other = rows.find(|other| other.satellite == satellite).unwrap();
            let a = remainders(&row.measurement, &state.r_eb_e, &state.v_eb_e);
            let b = remainders(other, &state.r_eb_e, &state.v_eb_e);
            worst = (
                worst.0.max((a.0 - b.0).abs()),
                worst.1.max((a.1 - b.1).abs()),
            );
        }
    }
    worst
}

/// The receiver measures when its own clock shows the second, which is up to 25 µs off: a few
/// millimetres of flight. Beside that there is the resolution of MSM7, and on range rates the change
/// of the tropospheric delay, which nobody corrects.
#[test]
fn the_receivers_stream_holds_the_measurements_of_the_folder() {
    for (flight, fault) in [
        (Flight::P4Flight, None),
        (Flight::Lpv200, Some("G04:ramp:0.5:20:100:rr")),
        (Flight::EnrouteTurn, None),
    ] {
        let request = Request {
            faults: fault.iter().map(|spec| spec.parse().unwrap()).collect(),
            ..short(flight, 130)
        };
        let flown = fly(&request).unwrap();
        let (air_m, air_mps) = differences(&flown, &RADIO);
        let vacuum = Radio {
            troposphere: false,
            ..RADIO
        };
        let (vacuum_m, vacuum_mps) = differences(&flown, &vacuum);
        println!(
            "{}: {air_m:.1e} m, {air_mps:.1e} m/s; in a vacuum {vacuum_m:.1e} m, {vacuum_mps:.1e} m/s",
            flight.name()
        );
        assert!(air_m < 0.01 && vacuum_m < 0.01, "{}", flight.name());
        assert!(vacuum_mps < 1e-3, "{}: {vacuum_mps} m/s", flight.name());
        assert!(air_mps < 0.05, "{}: {air_mps} m/s", flight.name());
    }
}

#[test]
fn two_signals_through_an_ionosphere_tell_the_same_flight() {
    let flown = fly(&Request {
        noise_free: true,
        faults: vec!["C22:step:9:10:40".parse().unwrap()],
        ..short(Flight::Evtol, 60)
    });
    let radio = Radio {
        dual_frequency: true,
        ionosphere: Ionosphere::Klobuchar,
        ..RADIO
    };
    let (range_m, _) = differences(&flown.unwrap(), &radio);
    println!("ionosphere-free: {range_m:.1e} m");
    assert!(range_m < 0.01, "{range_m}");
}

#[test]
fn the_inertial_stream_holds_the_samples_of_the_folder() {
    let flown = fly(&short(Flight::Coning, 6)).unwrap();
    let bytes = imu_bytes(&flown).unwrap();
    let mut ingest = Box::new(Ingest::EMPTY);
    let mut samples = Vec::new();
    let mut rest = &bytes[..];
    loop {
        match next(&mut ingest, &mut rest) {
            Event::Inertial(said) => {
                assert!(samples.is_empty());
                assert_eq!(said, unit(&flown));
                assert_eq!(said.check(), Ok(()));
            }
            Event::Imu(sample) => samples.push(sample),
            Event::EndOfStream => break,
            _ => {}
        }
    }
    assert_eq!(samples.len(), flown.imu.len());
    assert_eq!(samples, flown.imu);
}

/// Grades are those of the reference scenarios, and sigmas theirs within 1.5 %.
#[test]
fn grades_and_sigmas_are_those_of_the_reference_scenarios() {
    let Some(folder) = common::shared("scenarios") else {
        return;
    };
    for (name, grade) in [
        ("coast_nav_3", Grade::Navigation),
        ("flight004_nav", Grade::Navigation),
        ("npa_tac_ramp", Grade::Tactical),
        ("flight004_mems_step", Grade::Mems),
    ] {
        let scenario = scenario::Scenario::read(&folder.join(name)).unwrap();
        let (init, noise) = (&scenario.init, grade.noise());
        let [north, east, down] = init.sigma_attitude_ned_rad;
        let [own_north, own_east, own_down] = noise.attitude_ned_rad;
        for (theirs, ours) in [
            (init.arw, noise.density.arw),
            (init.vrw, noise.density.vrw),
            (init.gyro_bias_walk, noise.density.gyro_bias_walk),
            (init.accel_bias_walk, noise.density.accel_bias_walk),
            (init.sigma_gyro_bias_radps, noise.gyro_bias_radps),
            (north, own_north),
            (east, own_east),
            (down, own_down),
        ] {
            assert!(
                (ours / theirs - 1.0).abs() < 1e-12,
                "{name}: {theirs} {ours}"
            );
        }
        let (_, rows) = table(&folder.join(name), "gnss.csv");
        let satellites = scenario.epochs.iter().flat_map(|epoch| &epoch.rows);
        let mut worst: f64 = 0.0;
        for (row, satellite) in rows.iter().zip(satellites) {
            let elevation_rad = number(&row[13]);
            let pr = sigma_pseudorange_m(satellite.satellite, elevation_rad);
            let rr = sigma_range_rate_mps(elevation_rad);
            worst = worst.max((pr / satellite.sigma_pseudorange_m - 1.0).abs());
            assert!((rr / satellite.sigma_range_rate_mps - 1.0).abs() < 1e-6);
        }
        println!(
            "{name}: pseudorange sigmas differ by at most {:.2} %",
            100.0 * worst
        );
        assert!(worst < 0.015, "{name}: {worst}");
    }
}

#[test]
fn what_does_not_go_together_is_refused() {
    for (request, word) in [
        (Request::new(Flight::Approach, 1), "lpv200"),
        (short(Flight::Npa, 601), "600"),
        (short(Flight::Npa, 0), "--duration"),
        (
            Request {
                imu_rate_hz: 70,
                ..short(Flight::Npa, 5)
            },
            "--imu-rate-hz",
        ),
        (
            Request {
                gnss_rate_hz: 3,
                ..short(Flight::Npa, 5)
            },
            "--rate-hz",
        ),
        (
            Request {
                faults: vec!["G05:step:50:0:10".parse().unwrap()],
                ..short(Flight::Npa, 5)
            },
            "in view are G03",
        ),
    ] {
        let message = fly(&request).err().unwrap().to_string();
        assert!(message.contains(word), "{message}");
    }
}

/// Runs the command, which must succeed.
fn surefix(arguments: &[&str]) {
    let output = Command::new(env!("CARGO_BIN_EXE_surefix"))
        .args(arguments)
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{message}");
}

#[test]
fn the_command_writes_a_folder_that_the_scenario_command_runs() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("flights-command");
    let out = folder.to_str().unwrap();
    let simulate = [
        "simulate", "static", "--imu", "mems", "--rate", "50", "--seed", "9",
    ];
    surefix(&[&simulate[..], &["--duration", "8", "--out", out]].concat());
    for file in ["receiver.rtcm3", "imu.sfx", "scenario.toml"] {
        assert!(folder.join(file).metadata().unwrap().len() > 0, "{file}");
    }
    let text = std::fs::read_to_string(folder.join("scenario.toml")).unwrap();
    let said: toml::Table = text.parse().unwrap();
    assert_eq!(said["imu"].as_str(), Some("mems"));
    assert_eq!(said["imu_rate_hz"].as_integer(), Some(50));
    surefix(&["scenario", out, "--out", out]);
    let (_, results) = table(&folder, "result.csv");
    assert_eq!(results.len(), 8);
}

/// The whole way: bytes of receiver and unit through the monitor, positions against truth.csv.
#[test]
fn the_monitor_flies_tight_on_the_streams() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("flights-streams");
    let out = folder.to_str().unwrap();
    let file = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    surefix(&[
        "simulate",
        "lpv200",
        "--duration",
        "120",
        "--seed",
        "5",
        "--out",
        out,
    ]);
    surefix(&[
        "replay",
        "--gnss",
        &file("receiver.rtcm3"),
        "--imu",
        &file("imu.sfx"),
        "--truth",
        &file("truth.csv"),
        "--out",
        out,
    ]);
    let (header, epochs) = table(&folder, "epochs.csv");
    let column = |name: &str| header.split(',').position(|column| column == name).unwrap();
    assert_eq!(epochs.len(), 121);
    let (_, truth) = table(&folder, "truth.csv");
    let mut tight = 0;
    let mut worst_m: f64 = 0.0;
    for (epoch, truth) in epochs.iter().zip(&truth) {
        assert_eq!(epoch[column("t_s")], truth[0]);
        let place = ["x_m", "y_m", "z_m"].map(|name| number(&epoch[column(name)]));
        let true_place = [1, 2, 3].map(|k| number(&truth[k]));
        let error = Vector3::from(place) - Vector3::from(true_place);
        worst_m = worst_m.max(error.norm());
        tight += usize::from(epoch[column("mode")] == "tight");
    }
    println!("{tight} of 121 epochs tight, largest error {worst_m:.2} m");
    assert!(tight >= 115, "{tight}");
    assert!(worst_m < 6.0, "{worst_m}");
}
