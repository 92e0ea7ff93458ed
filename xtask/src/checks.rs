//! `cargo xtask test`: every check and every test, in the order of what fails soonest.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use crate::process::command;
use crate::stages::Stages;
use crate::workspace::{TARGET, Workspace};
use crate::{Failure, Result, bench, documentation, images, rules, setup};

/// Runs all stages and closes with one summary.
pub fn run(workspace: &Workspace) -> Result {
    let mut stages = Stages::start();
    if !stages.run("setup", || setup::run_with_browser(workspace)) {
        return stages.verdict();
    }
    if setup::has_component(workspace, "rustfmt") {
        stages.run("format", || cargo(workspace, &["fmt", "--all", "--check"]));
    } else {
        stages.leave_out("format", "this toolchain has no rustfmt");
    }
    stages.run("same bits: no std in the maths", || {
        rules::same_bits(workspace)
    });
    stages.run("core: no_std, no unsafe", || {
        rules::core_is_closed(workspace)
    });
    lint(workspace, &mut stages);
    images::check(workspace, &mut stages);
    stages.run("instructions under their bars", || bench::check(workspace));
    let mut totals = Totals::default();
    stages.run("tests", || tests(workspace, &mut totals));
    stages.run("documentation", || documentation::check(workspace));

    println!("== summary");
    print!("{}", stages.table());
    if !workspace.has_recordings() {
        println!(
            "  ../shared is absent: the tests that read recordings have said SKIPPED and passed"
        );
    }
    for name in &totals.failures {
        println!("  failed: {name}");
    }
    println!("  {totals}; {:.0} s in all", stages.took().as_secs_f64());
    stages.verdict()
}

/// The workspace as the PC sees it, and the firmware as each board sees it.
fn lint(workspace: &Workspace, stages: &mut Stages) {
    if !setup::has_component(workspace, "clippy") {
        stages.leave_out("clippy", "this toolchain has no clippy");
        return;
    }
    stages.run("clippy: PC", || {
        cargo(
            workspace,
            &[
                "clippy",
                "--locked",
                "--workspace",
                "--all-targets",
                "--",
                "-D",
                "warnings",
            ],
        )
    });
    let boards = images::BOARDS.map(|board| (board.name, board.features));
    let others = [
        ("real time", &["--features", "real-time"][..]),
        ("SPI bridge", &["--features", "spi-bridge"]),
    ];
    for (name, features) in boards.into_iter().chain(others) {
        stages.run(&format!("clippy: {name}"), || {
            let mut call = command(workspace, "cargo");
            call.args(["clippy", "--locked", "--target", TARGET])
                .args(["--package", "surefix-core", "--package", "surefix-firmware"])
                .args(features)
                .args(["--", "-D", "warnings"]);
            checked(&mut call)
        });
    }
}

/// Unit, integration and documentation tests of the whole workspace, in one host profile.
fn tests(workspace: &Workspace, totals: &mut Totals) -> Result {
    let mut call = command(workspace, "cargo");
    call.args(["test", "--locked", "--workspace", "--no-fail-fast"]);
    let mut child = call
        .stdout(Stdio::piped())
        .spawn()
        .map_err(|error| not_run(&call, &error.to_string()))?;
    // Passed on line by line, so that nothing of the tests' own output is lost to the totals.
    if let Some(out) = child.stdout.take() {
        for line in BufReader::new(out).split(b'\n') {
            let Ok(line) = line else { break };
            let line = String::from_utf8_lossy(&line);
            println!("{line}");
            totals.add(&line);
        }
    }
    let status = child
        .wait()
        .map_err(|error| not_run(&call, &error.to_string()))?;
    if !status.success() {
        return Err(not_run(&call, &status.to_string()));
    }
    if totals.passed == 0 {
        return Err(Failure::new("no test has run", "look at the lines above"));
    }
    Ok(())
}

/// `cargo` with its output shown.
pub fn cargo(workspace: &Workspace, arguments: &[&str]) -> Result {
    checked(command(workspace, "cargo").args(arguments))
}

/// Runs a command with its output shown; its failure is an error that repeats the command.
pub fn checked(call: &mut Command) -> Result {
    match call.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(not_run(call, &status.to_string())),
        Err(error) => Err(not_run(call, &error.to_string())),
    }
}

/// A command that did not do its work, and how to repeat it alone.
pub fn not_run(call: &Command, why: &str) -> Failure {
    let words: Vec<String> = std::iter::once(call.get_program())
        .chain(call.get_args())
        .map(|word| word.to_string_lossy().into_owned())
        .collect();
    let line = words.join(" ");
    Failure::new(
        format!("`{line}`: {why}"),
        format!("mend what it prints; `{line}` repeats this stage alone"),
    )
}

/// Sums over the result lines of all test programs.
#[derive(Debug, Default, PartialEq, Eq)]
struct Totals {
    passed: u64,
    failed: u64,
    ignored: u64,
    /// Names of the tests that failed.
    failures: Vec<String>,
}

impl Totals {
    /// Adds `test NAME ... FAILED` and `test result: ok. 6 passed; 0 failed; 1 ignored; …`,
    /// ignores any other line.
    fn add(&mut self, line: &str) {
        let failure = line
            .strip_prefix("test ")
            .and_then(|rest| rest.strip_suffix(" ... FAILED"));
        self.failures.extend(failure.map(str::to_owned));
        let Some((_, counts)) = line
            .strip_prefix("test result: ")
            .and_then(|rest| rest.split_once(". "))
        else {
            return;
        };
        for part in counts.split("; ") {
            let Some((number, word)) = part.trim().split_once(' ') else {
                continue;
            };
            let Ok(number) = number.parse::<u64>() else {
                continue;
            };
            match word {
                "passed" => self.passed += number,
                "failed" => self.failed += number,
                "ignored" => self.ignored += number,
                _ => {}
            }
        }
    }
}

impl std::fmt::Display for Totals {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(
            f,
            "tests: {} passed, {} failed, {} ignored",
            self.passed, self.failed, self.ignored
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn result_lines_are_summed_and_others_ignored() {
        let mut totals = Totals::default();
        totals.add("test result: ok. 6 passed; 0 failed; 1 ignored; 0 measured; 2 filtered out; finished in 0.06s");
        totals.add("test result: FAILED. 3 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out; finished in 1.00s");
        totals.add("test some::name ... ok");
        totals.add("test other::name ... FAILED");
        totals.add("test result: 5 passed");
        let expected = Totals {
            passed: 9,
            failed: 2,
            ignored: 1,
            failures: vec!["other::name".to_owned()],
        };
        assert_eq!(totals, expected);
    }
}
