//! `cargo xtask demo`: an approach with an inertial unit and a faulted satellite, flown through the
//! emulated Cortex-M7.
//!
//! A thin layer over three commands anyone can type; each is printed before it runs.

use std::fs;

use crate::checks::checked;
use crate::process::command;
use crate::workspace::Workspace;
use crate::{Failure, Result, images, setup};

/// The command of the PC, for cargo.
const SUREFIX: [&str; 4] = ["--package", "surefix-host-tests", "--bin", "surefix"];

/// Where the demo writes, inside the workspace.
const FOLDER: &str = "out/demo";

/// A ramp of 0.5 m/s on the pseudorange of one satellite, from 90 s after the start to 200 s. The
/// simulator puts it into the bytes the receiver sends.
const FAULT: &str = "G04:ramp:0.5:90:200";

/// Simulates, streams the bytes into the board, and ends with the report's path.
pub fn run(workspace: &Workspace) -> Result {
    setup::run(workspace)?;
    println!("demo: building the firmware and the surefix command");
    checked(images::build_command(workspace).args(["--bin", images::APPLICATION]))?;
    checked(
        command(workspace, "cargo")
            .args(["build", "--locked"])
            .args(SUREFIX),
    )?;

    surefix(
        workspace,
        &[
            "simulate", "lpv200", "--seed", "1", "--fault", FAULT, "--out", FOLDER,
        ],
    )?;
    let receiver = format!("{FOLDER}/receiver.rtcm3");
    let unit = format!("{FOLDER}/imu.sfx");
    let truth = format!("{FOLDER}/truth.csv");
    let results = format!("{FOLDER}/results");
    surefix(
        workspace,
        &[
            "replay",
            "--gnss",
            &receiver,
            "--imu",
            &unit,
            "--truth",
            &truth,
            "--phase",
            "lpv200",
            "--ionosphere",
            "none",
            "--on",
            "qemu",
            "--out",
            &results,
        ],
    )?;

    let report = workspace.root.join(&results).join("report.html");
    let report = fs::canonicalize(&report).map_err(|error| {
        Failure::new(
            format!(
                "the replay has left no report at {}: {error}",
                report.display()
            ),
            format!("run `cargo surefix report {results}` and read what it says"),
        )
    })?;
    println!("demo: open {}", report.display());
    Ok(())
}

/// `cargo surefix real-time`, after set-up.
pub fn real_time(workspace: &Workspace, arguments: &[&str]) -> Result {
    setup::run(workspace)?;
    surefix(workspace, &[&["real-time"], arguments].concat())
}

/// One `cargo surefix` command, shown first.
fn surefix(workspace: &Workspace, arguments: &[&str]) -> Result {
    println!("xtask: cargo surefix {}", arguments.join(" "));
    checked(
        command(workspace, "cargo")
            .args(["run", "--quiet", "--locked"])
            .args(SUREFIX)
            .arg("--")
            .args(arguments),
    )
}
