//! A list of timed stages: each announced, each judged, none hiding the failure of another.

use std::fmt::Write;
use std::time::{Duration, Instant};

use crate::{Failure, Result};

/// How a stage ended.
enum Outcome {
    Passed,
    LeftOut(String),
    Failed,
}

struct Stage {
    name: String,
    outcome: Outcome,
    took: Duration,
}

/// Stages run so far.
pub struct Stages {
    started: Instant,
    done: Vec<Stage>,
}

impl Stages {
    /// Starts the clock.
    pub fn start() -> Self {
        Self {
            started: Instant::now(),
            done: Vec::new(),
        }
    }

    /// Runs one stage; its failure is printed at once and remembered. True when it passed.
    pub fn run(&mut self, name: &str, stage: impl FnOnce() -> Result) -> bool {
        println!("== {name}");
        let started = Instant::now();
        let result = stage();
        let took = started.elapsed();
        let passed = result.is_ok();
        let outcome = match result {
            Ok(()) => Outcome::Passed,
            Err(failure) => {
                println!("{failure}");
                Outcome::Failed
            }
        };
        let word = if passed { "ok" } else { "FAILED" };
        println!("-- {name}: {word} ({:.1} s)", took.as_secs_f64());
        self.done.push(Stage {
            name: name.to_owned(),
            outcome,
            took,
        });
        passed
    }

    /// Notes a stage that cannot run here, and why.
    pub fn leave_out(&mut self, name: &str, reason: &str) {
        println!("-- {name}: LEFT OUT, {reason}");
        self.done.push(Stage {
            name: name.to_owned(),
            outcome: Outcome::LeftOut(reason.to_owned()),
            took: Duration::ZERO,
        });
    }

    /// One line per stage.
    pub fn table(&self) -> String {
        let mut table = String::new();
        for stage in &self.done {
            let (word, note) = match &stage.outcome {
                Outcome::Passed => ("ok", String::new()),
                Outcome::Failed => ("FAILED", String::new()),
                Outcome::LeftOut(reason) => ("left out", format!("  {reason}")),
            };
            let seconds = stage.took.as_secs_f64();
            let _ = writeln!(
                table,
                "  {:<36} {word:<8} {seconds:7.1} s{note}",
                stage.name
            );
        }
        table
    }

    /// Time since the start.
    pub fn took(&self) -> Duration {
        self.started.elapsed()
    }

    /// An error when any stage has failed.
    pub fn verdict(&self) -> Result {
        let failed: Vec<&str> = self
            .done
            .iter()
            .filter(|stage| matches!(stage.outcome, Outcome::Failed))
            .map(|stage| stage.name.as_str())
            .collect();
        if failed.is_empty() {
            return Ok(());
        }
        Err(Failure::new(
            format!("failed: {}", failed.join(", ")),
            "read the lines printed under those stages above",
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_stage_is_in_the_verdict_and_later_ones_still_run() {
        let mut stages = Stages::start();
        assert!(stages.run("first", || Ok(())));
        assert!(!stages.run("second", || Err(Failure::new("broken", "mend it"))));
        let mut ran = false;
        stages.run("third", || {
            ran = true;
            Ok(())
        });
        stages.leave_out("fourth", "no tool");
        assert!(ran);
        assert!(stages.verdict().unwrap_err().what.contains("second"));
        assert_eq!(stages.table().lines().count(), 4);
    }

    #[test]
    fn what_was_left_out_is_no_failure() {
        let mut stages = Stages::start();
        stages.leave_out("only", "no tool");
        assert!(stages.verdict().is_ok());
    }
}
