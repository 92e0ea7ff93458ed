//! The `surefix` command keeps its contract: exit codes, messages that name the next step, files.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use surefix_host_tests::rtcm_encode;

fn surefix(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_surefix"))
        .args(arguments)
        .output()
        .unwrap()
}

/// A fresh directory of this test run.
fn directory(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Exit code 2, nothing on standard output, and a message with these words.
fn refused(arguments: &[&str], words: &[&str]) {
    let output = surefix(arguments);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
    assert!(output.stdout.is_empty());
    for word in words {
        assert!(message.contains(word), "{arguments:?}: {message}");
    }
}

/// A simulated recording with its truth.
fn simulated(name: &str) -> (PathBuf, PathBuf, PathBuf) {
    let directory = directory(name);
    let flight = directory.join("flight");
    let output = surefix(&[
        "simulate",
        "approach",
        "--seed",
        "7",
        "--out",
        text(&flight),
    ]);
    assert!(output.status.success());
    (
        flight.join("receiver.rtcm3"),
        flight.join("truth.csv"),
        directory.join("out"),
    )
}

#[test]
fn unusable_arguments_are_refused_with_the_next_step() {
    let directory = directory("cli-refused");
    let out = directory.join("out");
    let out = text(&out);
    let readme = Path::new(env!("CARGO_MANIFEST_DIR")).join("../README.md");
    let readme = text(&readme);
    let missing = directory.join("missing.obs");
    refused(
        &["replay", "--gnss", text(&missing), "--out", out],
        &["--gnss", "missing.obs", "give the path", "cannot read"],
    );
    refused(
        &["replay", "--gnss", readme, "--out", out],
        &["README.md", "RTCM 3", "RINEX"],
    );
    let ubx = directory.join("a.ubx");
    // An empty poll of RXM-RAWX after a byte of noise; the sums by hand.
    std::fs::write(&ubx, [7, 0xb5, 0x62, 0x02, 0x15, 0, 0, 0x17, 0x47]).unwrap();
    let (code, _, message) = replay(&ubx, Path::new(out), &[]);
    assert_eq!(code, Some(1), "{message}");
    assert!(message.contains("RXM-RAWX and RXM-SFRBX"), "{message}");
    let empty = directory.join("empty");
    std::fs::write(&empty, []).unwrap();
    refused(
        &["replay", "--gnss", text(&empty), "--out", out],
        &["empty"],
    );
    for (fault, word) in [
        ("G05:step:50", "T0"),
        ("X05:step:50:0:10", "no satellite"),
        ("G05:jump:50:0:10", "step, ramp, noise, walk, osc"),
    ] {
        refused(
            &["replay", "--gnss", readme, "--fault", fault, "--out", out],
            &[word, "SAT:KIND:MAG:T0:T1"],
        );
    }
    for (flag, value, word) in [
        ("--systems", "GX", "'X'"),
        ("--phase", "landing", "lpv200"),
        ("--mask-deg", "75", "60"),
        ("--ionosphere", "thick", "klobuchar"),
        ("--at", "1,2", "three numbers"),
        ("--at-llh", "100,2,3", "latitude"),
        ("--truth", "no-such-truth.csv", "no-such-truth.csv"),
        ("--config", "no-such.toml", "no-such.toml"),
        ("--max-exclusions", "9", "3"),
    ] {
        refused(
            &["replay", "--gnss", readme, flag, value, "--out", out],
            &[word],
        );
    }
    refused(&["replay", "--gnss", readme], &["--out"]);
    refused(&["campaign", "nothing", "--out", out], &["esbc-steps"]);
}

#[test]
fn rinex_observations_without_ephemerides_ask_for_them() {
    let directory = directory("cli-nav");
    let observations = directory.join("a.obs");
    let header = [
        (
            "     3.04           OBSERVATION DATA    M",
            "RINEX VERSION / TYPE",
        ),
        ("G    1 C1C", "SYS / # / OBS TYPES"),
        ("", "END OF HEADER"),
    ];
    let lines = header.map(|(content, label)| format!("{content:<60}{label}\n"));
    let body = "> 2024 02 29 23 59 30.0000000  0  1\nG05  20000000.123\n";
    std::fs::write(&observations, lines.concat() + body).unwrap();
    let out = directory.join("out");
    let arguments = ["replay", "--gnss", text(&observations), "--out", text(&out)];
    refused(&arguments, &["--nav"]);
    let twice = [&arguments[..], &["--nav", text(&observations)]].concat();
    refused(&twice, &["a.obs", "--gnss"]);
}

#[test]
fn a_replay_writes_the_files_of_the_contract() {
    let (recording, truth, out) = simulated("cli-files");
    let output = surefix(&[
        "replay",
        "--gnss",
        text(&recording),
        "--truth",
        text(&truth),
        "--phase",
        "lpv200",
        "--ionosphere",
        "none",
        "--out",
        text(&out),
    ]);
    assert_eq!(output.status.code(), Some(0));
    assert!(
        output.stderr.is_empty(),
        "no progress bar without a terminal"
    );

    let epochs = std::fs::read_to_string(out.join("epochs.csv")).unwrap();
    let mut lines = epochs.lines();
    let header = lines.next().unwrap();
    let contract = "t_s,week,tow_s,x_m,y_m,z_m,lat_deg,lon_deg,h_m,ve_mps,vn_mps,vu_mps,n_sats,mode,\
                    integrity,reason,hpl_m,vpl_m,hal_m,val_m,excluded,stat,threshold";
    assert!(header.starts_with(contract), "{header}");
    let columns = header.split(',').count();
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), 241);
    assert!(rows.iter().all(|row| row.len() == columns));
    assert_eq!((rows[0][0], rows[1][0], rows[240][0]), ("0", "1", "240"));
    assert!(
        rows.iter()
            .all(|row| row[13] == "snapshot" && row[14] == "nominal")
    );
    assert!(rows.iter().all(|row| row[18] == "40" && row[19] == "35"));

    let summary = std::fs::read_to_string(out.join("summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    assert_eq!(summary["epochs"], 241);
    assert_eq!(summary["epochs_with_position"], 241);
    assert_eq!(summary["epochs_with_error_above_level"], 0);
    assert_eq!(summary["alerts"], 0);
    assert!(summary["h95_m"].as_f64().unwrap() < 2.0);
    assert_eq!(summary["availability"]["lpv200"], 1.0);
    assert_eq!(summary["bad_frames"], serde_json::json!({}));

    let errors = std::fs::read_to_string(out.join("errors.csv")).unwrap();
    assert_eq!(errors.lines().count(), 242);
    let report = surefix(&["report", text(&out)]);
    assert!(report.status.success() && out.join("report.html").exists());
}

#[test]
fn a_fault_on_recorded_bytes_is_excluded_until_its_satellite_has_proved_itself() {
    let (recording, truth, out) = simulated("cli-fault");
    let arguments = [
        "replay",
        "--gnss",
        text(&recording),
        "--truth",
        text(&truth),
        "--ionosphere",
        "none",
        "--out",
        text(&out),
    ];
    assert_eq!(surefix(&arguments).status.code(), Some(0));
    let clean = std::fs::read_to_string(out.join("epochs.csv")).unwrap();
    let column = |line: &str, k: usize| line.split(',').nth(k).unwrap().to_owned();
    let satellite = column(clean.lines().nth(1).unwrap(), 24)
        .split('+')
        .next()
        .unwrap()
        .to_owned();

    let fault = format!("{satellite}:step:80:60:120");
    let faulted = [&arguments[..], &["--fault", &fault]].concat();
    assert_eq!(surefix(&faulted).status.code(), Some(0));
    let epochs = std::fs::read_to_string(out.join("epochs.csv")).unwrap();
    let mut differ = 0;
    for (k, (line, before)) in epochs.lines().zip(clean.lines()).skip(1).enumerate() {
        if k < 60 {
            // Decoded, sent again as native frames: the same numbers.
            assert_eq!(line, before, "epoch {k}");
        } else {
            // The fault ends at 120 s; the flight before five minutes of agreement have passed.
            assert_eq!(
                (column(line, 14).as_str(), column(line, 20)),
                ("excluded", satellite.clone())
            );
            assert!(!column(line, 24).split('+').any(|used| used == satellite));
            let moved = [3, 4, 5].map(|c| {
                let x = |line| column(line, c).parse::<f64>().unwrap();
                x(line) - x(before)
            });
            assert!(moved.iter().all(|m| m.abs() < 5.0), "epoch {k}: {moved:?}");
            differ += 1;
        }
    }
    assert_eq!(differ, 181);
    let summary = std::fs::read_to_string(out.join("summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    let exclusion = &summary["exclusions"][0];
    assert_eq!(exclusion["satellite"], satellite.as_str());
    assert_eq!(
        (&exclusion["from_s"], &exclusion["to_s"]),
        (&60.0.into(), &240.0.into())
    );
}

#[test]
fn damaged_input_finishes_with_exit_code_1_and_its_causes() {
    let (recording, _, out) = simulated("cli-damaged");
    let mut bytes = std::fs::read(&recording).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x40;
    let damaged = recording.with_file_name("damaged.rtcm3");
    std::fs::write(&damaged, bytes).unwrap();
    let output = surefix(&["replay", "--gnss", text(&damaged), "--out", text(&out)]);
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(said.contains("input: "), "{said}");
    let summary = std::fs::read_to_string(out.join("summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    assert!(summary["bad_frames"]["rtcm_bad_crc"].as_u64().unwrap() >= 1);
}

#[test]
fn settings_of_a_file_hold_unless_a_flag_says_otherwise() {
    let (recording, _, out) = simulated("cli-config");
    let config = recording.with_file_name("settings.toml");
    std::fs::write(&config, "systems = \"G\"\nphase = \"apv1\"\n").unwrap();
    let arguments = [
        "replay",
        "--gnss",
        text(&recording),
        "--config",
        text(&config),
        "--phase",
        "terminal",
        "--out",
        text(&out),
    ];
    assert_eq!(surefix(&arguments).status.code(), Some(0));
    let epochs = std::fs::read_to_string(out.join("epochs.csv")).unwrap();
    let row: Vec<&str> = epochs.lines().nth(100).unwrap().split(',').collect();
    assert_eq!((row[18], row[19]), ("1852", ""));
    assert!(
        row[24]
            .split('+')
            .all(|satellite| satellite.starts_with('G'))
    );
    std::fs::write(&config, "sytems = \"G\"\n").unwrap();
    refused(&arguments, &["settings.toml", "sytems"]);
}

/// Exit code, standard output and standard error of a replay.
fn replay(recording: &Path, out: &Path, more: &[&str]) -> (Option<i32>, String, String) {
    let arguments = ["replay", "--gnss", text(recording), "--out", text(out)];
    let output = surefix(&[&arguments[..], more].concat());
    let said = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (
        output.status.code(),
        said(&output.stdout),
        said(&output.stderr),
    )
}

/// The files in `out` are those of one replay; gives its summary.
fn whole(out: &Path) -> serde_json::Value {
    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&read("summary.json")).unwrap();
    let rows = read("epochs.csv").lines().count() - 1;
    assert_eq!(summary["epochs"], rows);
    assert_eq!(out.join("errors.csv").exists(), !summary["truth"].is_null());
    let says_empty = read("report.html").contains("There is no epoch in this run");
    assert_eq!(says_empty, rows == 0);
    summary
}

/// A unit at rest, one sample each 10 ms around the first three seconds of a simulated flight.
fn unit_at_rest(truth: &Path) -> String {
    let truth = std::fs::read_to_string(truth).unwrap();
    let row: Vec<&str> = truth.lines().nth(1).unwrap().split(',').collect();
    let tow_s: u32 = row[2].parse().unwrap();
    (0..300)
        .map(|k| format!("{}.{:02}0,0,0,1,0,0,0\n", tow_s + k / 100, k % 100))
        .collect()
}

const UNIT: &str = r#"
[imu]
rate_hz = 100
grade = "tactical"
[imu.file]
time = 1
accelerometer = [2, 3, 4]
gyroscope = [5, 6, 7]
accelerometer_unit = "g"
gyroscope_unit = "deg/s"
time_scale = "gpst_sow"
week = WEEK
[imu.lever_arm]
imu_m = [0, 0, 0]
antenna_m = [0, 0, -1]
[imu.range]
rate_deg_per_s = 500
specific_force_g = 8
[imu.clock]
preset = "tcxo"
[imu.start]
attitude = "course"
min_speed_mps = 2
"#;

#[test]
fn an_inertial_unit_is_told_of_in_the_configuration_and_replayed_beside_the_receiver() {
    let (recording, truth, out) = simulated("cli-imu");
    let directory = out.parent().unwrap();
    let lines = unit_at_rest(&truth);
    let row = std::fs::read_to_string(&truth).unwrap();
    let week = row
        .lines()
        .nth(1)
        .unwrap()
        .split(',')
        .nth(1)
        .unwrap()
        .to_owned();
    let (imu, config) = (directory.join("imu.csv"), directory.join("unit.toml"));
    std::fs::write(&imu, lines.clone() + "not a sample\n").unwrap();
    std::fs::write(&config, UNIT.replace("WEEK", &week)).unwrap();
    let both = ["--imu", text(&imu), "--config", text(&config)];

    let (code, stdout, message) = replay(&recording, &out, &both);
    assert_eq!(code, Some(0), "{message}");
    assert!(stdout.contains("imu_bad_lines 1"), "{stdout}");
    let summary = whole(&out);
    assert_eq!(summary["input"]["imu_samples"], 300);
    assert_eq!(summary["counters"]["imu_samples"], 300);
    assert_eq!(summary["epochs_with_position"], 241);

    let arguments = ["replay", "--gnss", text(&recording), "--out", text(&out)];
    let refused_with = |unit: &str, samples: &str, words: &[&str]| {
        std::fs::write(&config, unit.replace("WEEK", &week)).unwrap();
        std::fs::write(&imu, samples).unwrap();
        refused(&[&arguments[..], &both].concat(), words);
    };
    refused_with(
        &UNIT.replace("rate_hz", "rate"),
        &lines,
        &["unit.toml", "line 3", "`rate`", "rate_hz", "lever_arm"],
    );
    refused_with(
        &UNIT.replace("tactical", "best"),
        &lines,
        &["unit.toml", "`best`", "navigation"],
    );
    refused_with(
        &UNIT.replace("\"deg/s\"", "\"rpm\""),
        &lines,
        &["unit.toml", "`rpm`", "rad/s"],
    );
    refused_with(
        &UNIT.replace("= 100", "= 1000"),
        &lines,
        &["rate_hz = 1000", "400"],
    );
    refused_with(
        &UNIT.replace("time = 1", "time = \"t\""),
        &lines,
        &["imu.csv", "line 1", "\"t\""],
    );
    refused_with(
        &UNIT.replace("7]", "9]"),
        &lines,
        &["imu.csv", "line 2", "7 columns", "column 9"],
    );
    refused_with(
        &UNIT.replace("week = WEEK", "week = 1000"),
        &lines,
        &["week 1000", "same time", "time_offset_s"],
    );
    refused_with(
        &UNIT.replace("[imu.file]", "[imu.files]"),
        &lines,
        &["`files`", "`file`"],
    );
    refused_with(
        "mask_deg = 10\n",
        &lines,
        &["imu.csv", "[imu]", "docs/examples"],
    );
    refused_with(UNIT, "", &["imu.csv", "empty", "[imu.file]"]);
    let missing = directory.join("missing.csv");
    refused(
        &[&arguments[..], &["--imu", text(&missing)]].concat(),
        &["missing.csv", "cannot read"],
    );
}

#[test]
fn a_position_the_recording_states_is_the_truth_for_a_fixed_antenna_only() {
    let station = "RTCM 1005/1006 station position";
    let directory = directory("cli-own-position");
    let (flight, out) = (directory.join("flight"), directory.join("out"));
    let simulate = ["simulate", "static", "--seed", "7", "--duration", "60"];
    let made = surefix(&[&simulate[..], &["--out", text(&flight)]].concat());
    assert!(made.status.success());
    let (fixed, truth) = (flight.join("receiver.rtcm3"), flight.join("truth.csv"));
    let first_row = |truth: &Path| -> Vec<String> {
        let rows = std::fs::read_to_string(truth).unwrap();
        let row = rows.lines().nth(1).unwrap();
        row.split(',').map(str::to_owned).collect()
    };
    let (code, stdout, message) = replay(&fixed, &out, &["--print", "nothing"]);
    assert_eq!(code, Some(0), "{message}");
    assert!(stdout.contains("errors against RTCM 1005"), "{stdout}");
    let summary = whole(&out);
    assert_eq!(summary["truth"], station);
    assert!(summary["truth_unused"].is_null());

    // A fault that moves every position is no motion of the antenna; four satellites raise no alert.
    let four = ["--systems", "G", "--mask-deg", "35"];
    assert_eq!(replay(&fixed, &out, &four).0, Some(0));
    let used = std::fs::read_to_string(out.join("epochs.csv")).unwrap();
    let used = used.lines().nth(1).unwrap().split(',').nth(24).unwrap();
    let fault = format!("{}:step:5000:0:61", used.split('+').next().unwrap());
    let more = [&four[..], &["--fault", &fault]].concat();
    assert_eq!(replay(&fixed, &out, &more).0, Some(0));
    let summary = whole(&out);
    assert_eq!(
        (&summary["truth"], &summary["alerts"]),
        (&station.into(), &0.into())
    );
    assert!(summary["max_error_h_m"].as_f64().unwrap() > 100.0);

    let not_used = |recording: &Path, more: &[&str], why: &str| {
        let (code, stdout, message) = replay(recording, &out, more);
        assert_eq!(code, Some(0), "{message}");
        let line = stdout.lines().find(|line| line.starts_with("errors: "));
        let line = line.unwrap_or_else(|| panic!("{stdout}"));
        assert!(line.contains(station) && line.contains(why), "{line}");
        assert!(line.ends_with("; give --truth, --at or --at-llh"), "{line}");
        let summary = whole(&out);
        assert!(summary["truth"].is_null() && summary["h95_m"].is_null());
        assert_eq!(summary["epochs_with_error_above_level"], 0);
        let unused = summary["truth_unused"].as_str().unwrap();
        assert!(line.contains(unused), "{unused}");
    };
    let (imu, config) = (directory.join("imu.csv"), directory.join("unit.toml"));
    std::fs::write(&imu, unit_at_rest(&truth)).unwrap();
    std::fs::write(&config, UNIT.replace("WEEK", &first_row(&truth)[1])).unwrap();
    let both = ["--imu", text(&imu), "--config", text(&config)];
    not_used(&fixed, &both, "inertial unit");
    let given = [&both[..], &["--truth", text(&truth)]].concat();
    assert_eq!(replay(&fixed, &out, &given).0, Some(0));
    assert_eq!(whole(&out)["truth"], text(&truth));

    // A flight that states where it began.
    let (recording, truth, _) = simulated("cli-own-position-flight");
    let row = first_row(&truth);
    let begin = [3, 4, 5].map(|k| row[k].parse().unwrap());
    let stated = rtcm_encode::encode_station(begin).unwrap();
    let moving = directory.join("moving.rtcm3");
    let bytes = std::fs::read(&recording).unwrap();
    std::fs::write(&moving, [stated, bytes].concat()).unwrap();
    not_used(&moving, &[], "positions lie more than 10 m from it");
}

#[test]
fn what_became_of_the_inertial_samples_is_told() {
    let (recording, truth, out) = simulated("cli-imu-losses");
    let directory = out.parent().unwrap();
    let row = std::fs::read_to_string(&truth).unwrap();
    let week = row.lines().nth(1).unwrap().split(',').nth(1).unwrap();
    let at_rest = unit_at_rest(&truth);
    let mut lines: Vec<String> = at_rest.lines().map(str::to_owned).collect();
    assert_eq!(lines.len(), 300);
    // No two counts alike. From the end, so that the places stay: one comes three times, half a second of
    // silence, five in the wrong order, four turning at 600 deg/s, three without a number, four missing.
    for _ in 0..2 {
        lines.insert(280, lines[280].clone());
    }
    lines.drain(200..250);
    for k in 0..5 {
        lines.swap(150 + 5 * k, 151 + 5 * k);
    }
    for line in &mut lines[100..104] {
        *line = line.replace("0,0,1,0,0,0", "0,0,1,0,600,0");
    }
    for line in &mut lines[60..63] {
        *line = line.replace("0,0,1,", "0,0,nan,");
    }
    lines.drain(20..24);
    let (imu, config) = (directory.join("imu.csv"), directory.join("unit.toml"));
    std::fs::write(&imu, lines.join("\n")).unwrap();
    std::fs::write(&config, UNIT.replace("WEEK", week)).unwrap();
    let both = ["--imu", text(&imu), "--config", text(&config)];
    let (code, stdout, message) = replay(&recording, &out, &both);
    assert_eq!(code, Some(0), "{message}");

    let summary = whole(&out);
    let counters = [
        ("imu_samples", 248, false),
        // All but those repeated, late, saturated, not finite, and the one after the silence.
        ("imu_used", 233, false),
        // A sample that comes too early covers the one in whose place it stands, and that after both less.
        ("imu_stretched", 10, false),
        ("imu_repeated", 2, true),
        ("imu_late", 5, true),
        // Those that are gone, not finite or saturated.
        ("imu_missing", 11, true),
        ("imu_not_finite", 3, true),
        ("imu_saturated", 4, true),
        ("imu_bad_interval", 0, false),
        ("imu_begun", 1, true),
    ];
    for (name, count, is_loss) in counters {
        assert_eq!(summary["counters"][name], count, "{name}");
        let line = format!("input: {name} {count}\n");
        assert_eq!(stdout.contains(&line), is_loss, "{name}: {stdout}");
        let cause = &summary["bad_frames"][name];
        assert_eq!(cause == count, is_loss, "{name}: {cause}");
    }
}

#[test]
fn a_recording_without_an_epoch_finishes_with_exit_code_1_and_its_counters() {
    let (recording, _, out) = simulated("cli-no-epoch");
    assert_eq!(replay(&recording, &out, &[]).0, Some(0));
    assert!(whole(&out)["epochs"].as_u64().unwrap() > 0);
    // A message of type 1 without content, twice, the second with a wrong checksum.
    let frame = [0xd3, 0x00, 0x02, 0x00, 0x10];
    let crc = surefix_core::wire::crc::crc24q(&frame).to_be_bytes();
    let right = [&frame[..], &crc[1..]].concat();
    let wrong = [&frame[..], &[!crc[1], crc[2], crc[3]]].concat();
    let empty = recording.with_file_name("no-epoch.rtcm3");
    std::fs::write(&empty, [right, wrong].concat()).unwrap();
    // Into the directory of the replay before.
    let (code, said, message) = replay(&empty, &out, &[]);
    assert_eq!(code, Some(1), "{message}");
    assert!(message.contains("holds no observation epoch"), "{message}");
    assert!(said.contains("input: rtcm_bad_crc 1"), "{said}");
    let summary = whole(&out);
    assert_eq!(summary["epochs"], 0);
    assert_eq!(summary["counters"]["rtcm_frames"], 1);
    assert_eq!(summary["counters"]["rtcm_bad_crc"], 1);
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("rtcm bad crc") && !page.contains("{{"));
}

#[test]
fn every_recording_of_the_corpora_ends_with_its_counters() {
    corpus_ends_with_its_counters("rtcm3-parser-corpus", "rtcm_frames", 40);
    corpus_ends_with_its_counters("ubx-parser-corpus", "ubx_frames", 40);
}

/// Every file is replayed, or has no frame of any kind and is refused.
fn corpus_ends_with_its_counters(name: &str, frames: &str, more_than: usize) {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../shared/data")
        .join(name);
    let Ok(entries) = std::fs::read_dir(&corpus) else {
        eprintln!("SKIPPED: {name}: ../shared is absent");
        return;
    };
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension != "md"));
    files.sort();
    // One directory for all, so that nothing of one may be left to the next.
    let out = directory("cli-corpus").join("out");
    let (mut without_epoch, mut with_losses, mut refused) = (0, 0, 0);
    for file in &files {
        let (code, _, message) = replay(file, &out, &["--print", "nothing"]);
        if code == Some(2) {
            let why = [
                "holds positions but no observations",
                "no recording surefix knows",
            ];
            assert!(why.iter().any(|why| message.contains(why)), "{message}");
            refused += 1;
            continue;
        }
        assert!(matches!(code, Some(0 | 1)), "{}: {message}", file.display());
        let summary = whole(&out);
        assert_eq!(summary["input"]["gnss"], text(file));
        assert!(summary["counters"][frames].as_u64().unwrap() > 0);
        if summary["epochs"] == 0 {
            assert_eq!(code, Some(1), "{}", file.display());
            assert!(message.contains("holds no observation epoch"), "{message}");
            without_epoch += 1;
        } else if code == Some(1) {
            assert_ne!(summary["bad_frames"], serde_json::json!({}));
            with_losses += 1;
        }
    }
    println!(
        "{name}: {} files, {refused} without a frame, {without_epoch} without an epoch, {with_losses} with epochs and losses",
        files.len()
    );
    assert!(files.len() > more_than && without_epoch > 0 && refused <= 4);
}

#[test]
fn a_fault_that_touches_no_epoch_is_refused_with_the_satellites_in_view() {
    let (recording, _, out) = simulated("cli-fault-nowhere");
    let arguments = ["replay", "--gnss", text(&recording), "--out", text(&out)];
    let in_view = |fault: &str| {
        refused(
            &[&arguments[..], &["--fault", fault]].concat(),
            &[
                "touches no epoch",
                fault.split(':').next().unwrap(),
                " G",
                " E",
                " C",
            ],
        );
    };
    // C63 is in no simulated sky; G04 is in view, but not after the end at 240 s.
    in_view("C63:step:50:60:120");
    in_view("G04:step:50:241:300");
    // The one that touches something does not cover up for the one that does not.
    refused(
        &[
            &arguments[..],
            &[
                "--fault",
                "G04:step:50:60:120",
                "--fault",
                "C63:step:50:60:120",
            ],
        ]
        .concat(),
        &["C63", "touches no epoch"],
    );
    assert_eq!(
        replay(&recording, &out, &["--fault", "G04:step:50:240:300"]).0,
        Some(0)
    );
}

#[test]
fn what_only_contains_two_bytes_of_ubx_is_not_called_ubx() {
    let directory = directory("cli-not-ubx");
    let out = directory.join("out");
    let png = directory.join("picture.png");
    let head = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR";
    // Sync bytes of UBX with a length that fits and sums that do not.
    let bytes = [&head[..], &[0xb5, 0x62, 0x02, 0x15, 0, 0, 0x17, 0x48]].concat();
    std::fs::write(&png, bytes).unwrap();
    let (code, _, message) = replay(&png, &out, &[]);
    assert_eq!(code, Some(2));
    assert!(
        message.contains("no recording surefix knows") && message.contains("starts with"),
        "{message}"
    );
}

#[test]
fn what_the_operating_system_says_is_said_once() {
    let directory = directory("cli-once");
    let missing = directory.join("missing.obs");
    let (_, _, message) = replay(&missing, &directory.join("out"), &[]);
    let words = std::fs::read(&missing).unwrap_err().to_string();
    assert_eq!(message.matches(&words).count(), 1, "{message}");
}

#[test]
fn counts_and_lengths_of_nothing_are_refused() {
    let directory = directory("cli-nothing");
    let out = directory.join("out.json");
    let campaign = ["campaign", "esbc-steps", "--out", text(&out)];
    refused(
        &[&campaign[..], &["--trials", "0"]].concat(),
        &["--trials", "0"],
    );
    let out = directory.join("flight");
    let simulate = ["simulate", "approach", "--seed", "1", "--out", text(&out)];
    for duration in ["0", "-5", "NaN", "inf"] {
        refused(
            &[&simulate[..], &["--duration", duration]].concat(),
            &["--duration", "more than 0"],
        );
    }
    assert!(!out.exists());
}

#[test]
fn a_place_that_cannot_be_written_is_refused_before_any_work() {
    let directory = directory("cli-out");
    let file = directory.join("file");
    std::fs::write(&file, "").unwrap();
    let (below, missing) = (file.join("out"), directory.join("missing.obs"));
    // The input is missing too: the message shows what was looked at first.
    refused(
        &["replay", "--gnss", text(&missing), "--out", text(&below)],
        &["cannot make the directory", "--out"],
    );
    let (json, nowhere) = (below.join("steps.json"), text(&missing));
    refused(
        &[
            "campaign",
            "esbc-steps",
            "--data",
            nowhere,
            "--out",
            text(&json),
        ],
        &["steps.json", "--out"],
    );
}

#[test]
fn a_campaign_names_the_constellations_it_takes_by_itself() {
    let help = |command| String::from_utf8(surefix(&[command, "--help"]).stdout).unwrap();
    assert!(help("campaign").contains("[default: GC]"));
    assert!(!help("campaign").contains("[default: GEC]"));
    assert!(help("replay").contains("[default: GEC]"));
}
