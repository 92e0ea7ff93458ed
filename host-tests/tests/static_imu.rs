//! A fixed antenna gets an inertial unit, and with it filter and bank.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn surefix(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_surefix"))
        .args(arguments)
        .output()
        .unwrap()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Five minutes of a simulated receiver that does not move, every 5 s, and where it is.
fn receiver(name: &str) -> (PathBuf, PathBuf) {
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&directory);
    let out = directory.join("receiver");
    let output = surefix(&[
        "simulate",
        "static",
        "--seed",
        "5",
        "--duration",
        "300",
        "--rate-hz",
        "0.2",
        "--out",
        text(&out),
    ]);
    assert!(output.status.success(), "{output:?}");
    (directory, out.join("receiver.rtcm3"))
}

/// Columns of `epochs.csv` by name, and the rows.
fn epochs(out: &Path) -> (Vec<String>, Vec<Vec<String>>) {
    let csv = std::fs::read_to_string(out.join("epochs.csv")).unwrap();
    let mut lines = csv
        .lines()
        .map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    (lines.next().unwrap(), lines.collect())
}

#[test]
fn a_fixed_antenna_is_replayed_with_a_unit_of_every_grade_and_its_bank_is_told() {
    let (directory, gnss) = receiver("static-imu");
    for (grade, rate) in [("navigation", "50"), ("tactical", "100"), ("mems", "200")] {
        let unit = directory.join(grade);
        let output = surefix(&[
            "static-imu",
            "--gnss",
            text(&gnss),
            "--grade",
            grade,
            "--rate-hz",
            rate,
            "--attitude",
            "2,-1,250",
            "--seed",
            "3",
            "--out",
            text(&unit),
        ]);
        assert!(output.status.success(), "{output:?}");
        let out = directory.join(format!("{grade}-replay"));
        let output = surefix(&[
            "replay",
            "--gnss",
            text(&gnss),
            "--imu",
            text(&unit.join("imu.sfx")),
            "--config",
            text(&unit.join("UNIT.toml")),
            "--ionosphere",
            "none",
            "--print",
            "nothing",
            "--out",
            text(&out),
        ]);
        assert!(output.status.success(), "{output:?}");
        let (columns, rows) = epochs(&out);
        let place = |name: &str| columns.iter().position(|column| column == name).unwrap();
        let of = |row: &[String], name: &str| row[place(name)].clone();
        let tight = rows.iter().filter(|row| of(row, "mode") == "tight").count();
        assert!(tight >= 57, "{grade}: {tight} of {}", rows.len());
        assert!(rows.iter().all(|row| of(row, "integrity") == "nominal"));
        // The truth of the attitude is within three sigmas of what UNIT.toml says; the filter began there.
        let last = rows.last().unwrap();
        let roll: f64 = of(last, "roll_deg").parse().unwrap();
        assert!((roll - 2.0).abs() < 2.0, "{grade}: roll {roll}");
        // Columns of the bank stand last, in fours, sorted by satellite, and hold tests.
        let first = place("n_bank");
        assert_eq!(
            columns[first..first + 7].join(","),
            "n_bank,n_unmonitored,uncertainty_h_m,uncertainty_v_m,opinions,p_unmonitored,pairs_dropped"
        );
        let names: Vec<&str> = columns[first + 7..]
            .chunks(4)
            .map(|four| {
                let name = four[0].strip_prefix("d_h_").unwrap();
                let expected = ["d_h", "t_h", "d_v", "t_v"].map(|what| format!("{what}_{name}"));
                assert_eq!(four, expected);
                name
            })
            .collect();
        let (constellations, names) = {
            let is_letter = |name: &&str| name.len() == 1;
            names.into_iter().partition::<Vec<&str>, _>(is_letter)
        };
        assert!(names.is_sorted() && names.len() >= 12, "{names:?}");
        assert_eq!(constellations, ["C", "E", "G"]);
        let n_bank: usize = of(last, "n_bank").parse().unwrap();
        let tested = names
            .iter()
            .filter(|name| !of(last, &format!("t_h_{name}")).is_empty())
            .count();
        assert!(tested >= 8 && tested <= n_bank, "{tested} of {n_bank}");
        let page = std::fs::read_to_string(out.join("report.html")).unwrap();
        assert!(page.contains("\"bank\":{") && page.contains("\"stanford\":null"));
    }
}

#[test]
fn what_no_unit_can_be_synthesised_for_is_refused_with_the_next_step() {
    let (directory, gnss) = receiver("static-imu-refused");
    let out = directory.join("unit");
    let refused = |more: &[&str], words: &[&str]| {
        let mut arguments = vec![
            "static-imu",
            "--gnss",
            text(&gnss),
            "--seed",
            "1",
            "--out",
            text(&out),
        ];
        arguments.extend(more);
        let output = surefix(&arguments);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
    };
    refused(&["--rate-hz", "400"], &["--rate-hz 400", "50"]);
    refused(&["--at", "55.5,8.5,60"], &["--at", "ECEF"]);
    refused(&["--at", "1,2"], &["--at", "three numbers"]);
    refused(&["--attitude", "north"], &["--attitude", "three numbers"]);
}
