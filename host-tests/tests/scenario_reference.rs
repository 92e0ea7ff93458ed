//! Scenario folders through the reference model and through the monitor: both give the reference results
//! of ../shared/scenarios at every epoch, tests, levels and exclusions included.
//!
//! Beside them: the command, the files it writes, what it refuses.

mod common;

use std::path::{Path, PathBuf};
use std::process::Command;

use surefix_host_tests::qemu::image;
use surefix_host_tests::reference;
use surefix_host_tests::replay::Machine;
use surefix_host_tests::scenario::{ResultFile, Scenario, run};

/// Scenarios that must be there.
const SCENARIOS: [&str; 7] = [
    "coast_nav_3",
    "flight004_mems_step",
    "flight004_nav",
    "npa_tac_ramp",
    "seed000_ramp_rr_tac",
    "seed000_ramp_tac",
    "static_perfect",
];

fn expected(folder: &Path) -> ResultFile {
    ResultFile::read(&folder.join("reference/result.csv")).unwrap()
}

/// The same satellites are excluded, they and the first detection at most `slack` epochs apart, the same
/// satellites are in the bank, and tests exist for the same.
fn assert_the_same_decisions(name: &str, result: &ResultFile, expected: &ResultFile, slack: usize) {
    let (ours, theirs) = (result.first_detection(), expected.first_detection());
    assert_eq!(ours.is_some(), theirs.is_some(), "{name}");
    if let (Some(ours), Some(theirs)) = (ours, theirs) {
        assert!(ours.abs_diff(theirs) <= slack, "{name}: {ours} {theirs}");
    }
    let (ours, theirs) = (result.exclusions(), expected.exclusions());
    assert_eq!(ours.len(), theirs.len(), "{name}: {ours:?} {theirs:?}");
    for ((ours, excluded), (theirs, satellite)) in ours.iter().zip(&theirs) {
        assert_eq!(excluded, satellite, "{name}");
        assert!(ours.abs_diff(*theirs) <= slack, "{name}: {ours} {theirs}");
    }
    let largest = result.compare(expected).unwrap();
    assert!(
        largest.unmatched_tests <= 2 * slack * theirs.len(),
        "{name}"
    );
    // The reference results count the satellites of the bank before the exclusion of that epoch.
    assert!(largest.counts <= (1 + slack) * theirs.len(), "{name}");
}

/// Ten to a hundred times what was measured, and far below what the monitor must keep.
/// INT-019.
#[test]
fn the_reference_model_gives_the_reference_results() {
    let Some(folder) = common::shared("scenarios") else {
        return;
    };
    for name in SCENARIOS {
        let folder = folder.join(name);
        let result = reference::run(&Scenario::read(&folder).unwrap());
        let expected = expected(&folder);
        let largest = result.compare(&expected).unwrap();
        println!("{name}: {largest:?}");
        assert_the_same_decisions(name, &result, &expected, 0);
        assert!(largest.statistic_m < 1e-4, "{name}");
        assert!(largest.threshold_relative < 1e-5, "{name}");
        assert!(largest.hpl_relative < 1e-5, "{name}");
        assert!(largest.vpl_relative < 1e-5, "{name}");
        assert!(largest.position_m < 1e-4, "{name}");
        assert!(largest.velocity_mps < 1e-4, "{name}");
        assert!(largest.attitude_rad < 1e-5, "{name}");
        assert!(largest.clock_bias_m < 1e-4, "{name}");
        assert!(largest.clock_drift_mps < 1e-4, "{name}");
        assert!(largest.hpl0_relative < 1e-5, "{name}");
    }
}

/// Position, clock and statistics to a centimetre (1 mm where everything is perfect), velocity to 2 mm/s,
/// attitude to 1e-5 rad, thresholds to 0.2 %, levels to 0.1 %, decisions to an epoch.
/// INT-019.
#[test]
fn the_monitor_gives_the_reference_results() {
    let Some(folder) = common::shared("scenarios") else {
        return;
    };
    for name in SCENARIOS {
        let folder = folder.join(name);
        let scenario = Scenario::read(&folder).unwrap();
        let outcome = run::run(&scenario, Machine::Host, &mut |_| {}).unwrap();
        assert_eq!(outcome.without_solution, 0, "{name}");
        assert!(outcome.losses.is_empty(), "{name}: {:?}", outcome.losses);
        assert_eq!(outcome.reports.len(), scenario.epochs.len(), "{name}");
        let expected = expected(&folder);
        let largest = outcome.result.compare(&expected).unwrap();
        println!("{name}: {largest:?}");
        assert_the_same_decisions(name, &outcome.result, &expected, 1);
        assert!(largest.statistic_m <= 1e-2, "{name}");
        assert!(largest.threshold_relative <= 2e-3, "{name}");
        assert!(largest.hpl_relative <= 1e-3, "{name}");
        assert!(largest.vpl_relative <= 1e-3, "{name}");
        let limit_m = if name == "static_perfect" { 1e-3 } else { 1e-2 };
        assert!(largest.position_m <= limit_m, "{name}");
        assert!(largest.clock_bias_m <= limit_m, "{name}");
        assert!(largest.velocity_mps <= 2e-3, "{name}");
        assert!(largest.clock_drift_mps <= 2e-3, "{name}");
        assert!(largest.attitude_rad <= 1e-5, "{name}");
        assert!(largest.hpl0_relative <= 1e-4, "{name}");
    }
}

/// The emulated Cortex-M7 writes the same bytes; it sends the same reports where it keeps its deadlines, of
/// which this machine knows none.
/// INT-019.
#[test]
fn the_board_writes_the_same_result() {
    let Some(folder) = common::shared("scenarios/static_perfect") else {
        return;
    };
    if let Some(missing) = image::missing() {
        eprintln!("SKIPPED: {missing}");
        return;
    }
    let mut scenario = Scenario::read(&folder).unwrap();
    scenario.epochs.truncate(20);
    let here = run::run(&scenario, Machine::Host, &mut |_| {}).unwrap();
    let there = run::run(&scenario, Machine::Qemu, &mut |_| {}).unwrap();
    assert_eq!(there.without_solution, 0);
    assert_eq!(here.result.to_text(), there.result.to_text());
    assert!(here.result.rows.iter().all(|row| row.n_sats == 14));
    for epoch in &mut scenario.epochs {
        epoch.rows.truncate(5);
    }
    let here = run::run(&scenario, Machine::Host, &mut |_| {}).unwrap();
    let there = run::run(&scenario, Machine::Qemu, &mut |_| {}).unwrap();
    assert!(here.reports == there.reports);
}

/// On the emulated Cortex-M7 too a fault is detected, isolated and excluded, at the same epoch and by the same
/// bits; five epochs later the same filters go on.
#[test]
fn the_board_excludes_the_same_satellite() {
    let Some(folder) = common::shared("scenarios/seed000_ramp_tac") else {
        return;
    };
    if let Some(missing) = image::missing() {
        eprintln!("SKIPPED: {missing}");
        return;
    }
    let mut scenario = Scenario::read(&folder).unwrap();
    let whole = run::run(&scenario, Machine::Host, &mut |_| {}).unwrap();
    let [(excluded_at, _)] = whole.result.exclusions()[..] else {
        panic!("one exclusion: {:?}", whole.result.exclusions());
    };
    scenario.epochs.truncate(excluded_at + 1 + 5);
    let here = run::run(&scenario, Machine::Host, &mut |_| {}).unwrap();
    let begin = std::time::Instant::now();
    let there = run::run(&scenario, Machine::Qemu, &mut |_| {}).unwrap();
    println!(
        "{} epochs on the board in {:.0} s",
        there.reports.len(),
        begin.elapsed().as_secs_f64()
    );
    assert_eq!(there.without_solution, 0);
    assert!(there.losses.is_empty(), "{:?}", there.losses);
    assert_eq!(there.result.exclusions(), whole.result.exclusions());
    assert!(there.result.first_detection() <= Some(excluded_at));
    assert_eq!(here.result.to_text(), there.result.to_text());
    assert!(here.reports == there.reports);
}

/// A scenario of three seconds at rest, written by hand.
fn small_scenario(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let mut init = String::from("key,value\n");
    for line in [
        "t0,0 imu_dt,0.01 pos_x,6378137 pos_y,0 pos_z,0 vel_x,0 vel_y,0 vel_z,0",
        "q_w,1 q_x,0 q_y,0 q_z,0 bg_x,0 bg_y,0 bg_z,0 ba_x,0 ba_y,0 ba_z,0 clk_b,0 clk_d,0",
        "std_pos,10 std_vel,0.5 std_att_n,1e-3 std_att_e,1e-3 std_att_d,1e-2",
        "std_bg,1e-6 std_ba,1e-3 std_clk_b,30 std_clk_d,1 arw,1e-6 vrw,1e-4 bg_rw,0 ba_rw,0",
        "clk_s_b,0.01 clk_s_d,0.04 clk_beta,0 p_fa,1e-7 p_md,1e-3 p_h0,1e-7 hal,556 val,50",
        "detect_axes,h exclude,1 hold_s,0 mask_deg,5",
    ] {
        init += &(line.replace(' ', "\n") + "\n");
    }
    let mut imu = String::from("t_s,dth_x,dth_y,dth_z,dv_x,dv_y,dv_z\n");
    for k in 1..=300 {
        imu += &format!("{},0,0,7.292115e-7,0.0978,0,0\n", f64::from(k) / 100.0);
    }
    let mut gnss = String::from("t_s,sys,prn,sx,sy,sz,svx,svy,svz,pr,rr,sigma_pr,sigma_rr,el\n");
    for t_s in 1..=3 {
        for (satellite, [x, y, z]) in [
            ("G,3", [2.6e7, 1e6, 0.0]),
            ("G,12", [2.2e7, 1.2e7, 3e6]),
            ("C,20", [2.2e7, -1.2e7, 3e6]),
            ("G,1", [2.2e7, 0.0, 1.3e7]),
            ("E,7", [2.2e7, 0.0, -1.3e7]),
        ] {
            let range = (x - 6_378_137.0_f64).hypot(y).hypot(z);
            gnss += &format!("{t_s},{satellite},{x},{y},{z},0,0,0,{range},0,1,0.05,0.9\n");
        }
    }
    for (file, text) in [("init.csv", init), ("imu.csv", imu), ("gnss.csv", gnss)] {
        std::fs::write(folder.join(file), text).unwrap();
    }
    folder
}

fn surefix(arguments: &[&Path]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_surefix"))
        .arg("scenario")
        .args(arguments)
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    (output.status.code(), message)
}

#[test]
fn the_command_writes_one_row_per_epoch() {
    let folder = small_scenario("scenario-written");
    let out = folder.join("out");
    let (code, message) = surefix(&[&folder, Path::new("--out"), &out]);
    assert_eq!(code, Some(0), "{message}");
    let text = std::fs::read_to_string(out.join("result.csv")).unwrap();
    let mut lines = text.lines();
    assert_eq!(
        lines.next().unwrap(),
        "t_s,px,py,pz,vx,vy,vz,qw,qx,qy,qz,clk_b,clk_d,hpl,vpl,hpl0,detected,excluded,n_sats,\
         d_C20,T_C20,d_E07,T_E07,d_G01,T_G01,d_G03,T_G03,d_G12,T_G12"
    );
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), 3);
    for (row, time) in rows.iter().zip(["1", "2", "3"]) {
        assert_eq!(row.len(), 29);
        assert_eq!(row[0], time);
        assert_eq!(row[16..19], ["0", "-", "5"]);
    }
    let result = ResultFile::read(&out.join("result.csv")).unwrap();
    for row in &result.rows {
        // A horizontal level above the fault-free one, and every satellite's threshold above its statistic.
        assert!(row.hpl_m > row.hpl0_m && row.vpl_m > 0.0, "{row:?}");
        assert!(row.tests.iter().all(|[d, t]| d < t), "{row:?}");
    }
    assert_eq!(result.to_text(), text, "numbers read back as they are");
    let [x, y, z] = result.rows[2].r_eb_e_m;
    assert!((x - 6_378_137.0).hypot(y).hypot(z) < 1.0);
}

#[test]
fn a_folder_that_cannot_be_used_is_refused_with_file_line_and_column() {
    let refused = |name: &str, file: &str, from: &str, to: &str, words: &[&str]| {
        let folder = small_scenario(name);
        let path = folder.join(file);
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains(from));
        std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
        let (code, message) = surefix(&[&folder, Path::new("--out"), &folder.join("out")]);
        assert_eq!(code, Some(2), "{message}");
        for word in words {
            assert!(message.contains(word), "{message}");
        }
    };
    refused(
        "scenario-number",
        "imu.csv",
        "0.02,0,0,7",
        "0.02,0,x,7",
        &["imu.csv, line 3, column dth_y", "\"x\" is not a number"],
    );
    refused(
        "scenario-order",
        "imu.csv",
        "\n0.05,",
        "\n0.03,",
        &["imu.csv, line 6, column t_s", "does not come after"],
    );
    refused(
        "scenario-column",
        "gnss.csv",
        "sigma_rr",
        "sigma",
        &["gnss.csv", "no column sigma_rr"],
    );
    refused(
        "scenario-satellite",
        "gnss.csv",
        "1,G,12",
        "1,G,33",
        &["gnss.csv, line 3, column prn", "1 to 32"],
    );
    refused(
        "scenario-twice",
        "gnss.csv",
        "1,G,12",
        "1,G,3",
        &["gnss.csv, line 3", "G03 occurs twice at 1 s"],
    );
    refused(
        "scenario-key",
        "init.csv",
        "std_vel,0.5\n",
        "",
        &["init.csv", "no line for std_vel"],
    );
    refused(
        "scenario-value",
        "init.csv",
        "p_fa,1e-7",
        "p_fa,2",
        &["init.csv, line", "p_fa", "between 0 and 1"],
    );
    let folder = small_scenario("scenario-one-sample");
    let imu = std::fs::read_to_string(folder.join("imu.csv")).unwrap();
    let first: Vec<&str> = imu.lines().take(2).collect();
    std::fs::write(folder.join("imu.csv"), first.join("\n")).unwrap();
    let (code, message) = surefix(&[&folder, Path::new("--out"), &folder.join("out")]);
    assert_eq!(code, Some(2), "{message}");
    assert!(
        message.contains("imu.csv holds a single sample: give the samples"),
        "{message}"
    );
    let missing = Path::new(env!("CARGO_TARGET_TMPDIR")).join("scenario-missing");
    let (code, message) = surefix(&[&missing, Path::new("--out"), &missing]);
    assert_eq!(code, Some(2));
    assert!(
        message.contains("is no directory: give a scenario folder"),
        "{message}"
    );
}
