//! What the tests of the drivers take of them: lines, regions and branches, with the places left out.

use std::fs;
use std::path::{Path, PathBuf};

use crate::process;
use crate::workspace::Workspace;
use crate::{Failure, Result};

/// Branches are counted by the nightly compiler only.
const TOOLCHAIN: &str = "+nightly";
const SOURCES: &str = "firmware/src/drivers";

/// Builds the tests of the drivers with counters in them, runs them, and prints what they took.
pub fn run(workspace: &Workspace) -> Result {
    let folder = workspace.target_dir.join("coverage");
    let profiles = folder.join("profiles");
    // Those of another build would not fit.
    let _ = fs::remove_dir_all(&profiles);
    let tools = tools(workspace)?;

    let mut tests = process::command(workspace, "cargo");
    tests
        .args([TOOLCHAIN, "test", "--package", "surefix-host-tests"])
        .args(["--test", "drivers"])
        .env("CARGO_TARGET_DIR", &folder)
        .env(
            "RUSTFLAGS",
            "-C instrument-coverage -Z coverage-options=branch",
        )
        .env("LLVM_PROFILE_FILE", profiles.join("%p-%m.profraw"));
    succeed(&mut tests, "read what the tests say")?;

    let merged = folder.join("drivers.profdata");
    let mut merge = process::command(workspace, tools.join("llvm-profdata"));
    merge.arg("merge").arg("--sparse").arg("--output");
    merge.arg(&merged).args(files(&profiles, "profraw"));
    succeed(&mut merge, "remove the folder target/coverage")?;

    let binary = newest_test(&folder.join("debug/deps"))?;
    let sources = workspace.root.join(SOURCES);
    for what in [
        &["report", "--show-branch-summary"][..],
        &["show", "--show-branches=count", "--show-regions"][..],
    ] {
        let mut show = process::command(workspace, tools.join("llvm-cov"));
        show.args(what).arg("--instr-profile").arg(&merged);
        show.arg(&binary).arg("--sources").arg(&sources);
        if what[0] == "report" {
            succeed(&mut show, "read what llvm-cov says")?;
        } else if let Some(text) = process::output(&mut show) {
            let file = folder.join("drivers.txt");
            fs::write(&file, text).map_err(|error| {
                Failure::new(
                    format!("{}: {error}", file.display()),
                    "make the target directory writable",
                )
            })?;
            println!("line by line: {}", file.display());
        }
    }
    Ok(())
}

/// The folder of llvm-profdata and llvm-cov that fit the compiler.
fn tools(workspace: &Workspace) -> Result<PathBuf> {
    let next = "rustup toolchain install nightly --component llvm-tools";
    let root = process::output(process::command(workspace, "rustc").args([
        TOOLCHAIN,
        "--print",
        "target-libdir",
    ]))
    .ok_or_else(|| Failure::new("there is no nightly toolchain", next))?;
    let tools = Path::new(&root).with_file_name("bin");
    if tools.join("llvm-cov").exists() {
        Ok(tools)
    } else {
        Err(Failure::new("the nightly toolchain has no llvm-cov", next))
    }
}

fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|found| found == extension))
        .collect()
}

/// The test binary that was built last.
fn newest_test(folder: &Path) -> Result<PathBuf> {
    fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            name.starts_with("drivers-") && path.extension().is_none()
        })
        .max_by_key(|path| path.metadata().and_then(|data| data.modified()).ok())
        .ok_or_else(|| {
            Failure::new(
                format!("no test of the drivers in {}", folder.display()),
                "remove the folder target/coverage and try again",
            )
        })
}

fn succeed(command: &mut std::process::Command, next: &str) -> Result {
    let succeeded = command.status().is_ok_and(|status| status.success());
    if succeeded {
        Ok(())
    } else {
        Err(Failure::new(format!("{command:?} failed"), next))
    }
}
