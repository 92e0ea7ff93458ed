//! Executed instructions of a monitor, as the emulated board measured them.
//!
//! `instructions.json` holds the rows `monitor/…` of what `cargo xtask bench --json FILE` wrote. The board measures random
//! skies of a few numbers of satellites; for an epoch the nearest of these numbers is taken, and said.

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};

const MEASURED: &str = include_str!("instructions.json");

/// The figures of a bench.
#[derive(Debug, Deserialize)]
pub struct Bench {
    rows: Vec<BenchRow>,
}

#[derive(Debug, Deserialize)]
struct BenchRow {
    stage: String,
    n_sats: Option<u64>,
    instr_median: Option<u64>,
    instr_worst: Option<u64>,
    stack_b: Option<u64>,
}

/// Instructions of an epoch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Instructions {
    /// Satellites of the skies they were measured with.
    pub satellites: u64,
    /// Median of those skies.
    pub median: u64,
    /// Worst of them.
    pub worst: u64,
    /// Stack, bytes.
    pub stack_b: u64,
}

impl Bench {
    /// The figures that came with the program.
    ///
    /// # Errors
    /// When they are no figures of a bench.
    pub fn measured() -> Result<Self> {
        Self::parse(MEASURED).context("instructions.json")
    }

    fn parse(text: &str) -> Result<Self> {
        serde_json::from_str(text).context("not as `cargo xtask bench --json` writes it")
    }

    /// What a stage executed with each number of satellites.
    pub fn of(&self, stage: &str) -> impl Iterator<Item = Instructions> {
        self.rows
            .iter()
            .filter(move |row| row.stage == stage)
            .filter_map(|row| {
                Some(Instructions {
                    satellites: row.n_sats?,
                    median: row.instr_median?,
                    worst: row.instr_worst?,
                    stack_b: row.stack_b?,
                })
            })
    }

    /// At the number of satellites nearest to this; `None` where the stage was not measured.
    pub fn nearest(&self, stage: &str, satellites: u64) -> Option<Instructions> {
        self.of(stage)
            .min_by_key(|row| row.satellites.abs_diff(satellites))
    }
}

/// The stage of a monitor at an epoch with a fault.
pub fn with_fault(stage: &str) -> String {
    format!("{stage}/fault")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::registry::MONITORS;

    #[test]
    fn the_nearest_number_of_satellites_is_taken() {
        let row = |stage: &str, n: u64, median: u64| {
            format!(
                "{{\"stage\":\"{stage}\",\"n_sats\":{n},\"instr_median\":{median},\"instr_worst\":{},\"stack_b\":0}}",
                2 * median
            )
        };
        let rows = [row("a", 8, 10), row("b", 8, 5), row("a", 12, 20)].join(",");
        let bench = Bench::parse(&format!("{{\"rows\":[{rows}]}}")).unwrap();
        let median =
            |stage: &str, n: u64| bench.nearest(stage, n).map(|i| (i.satellites, i.median));
        assert_eq!(median("a", 9), Some((8, 10)));
        assert_eq!(median("a", 24), Some((12, 20)));
        assert_eq!(median("b", 24), Some((8, 5)));
        assert_eq!(median("c", 8), None);
        assert!(Bench::parse("[]").is_err());
    }

    #[test]
    fn every_monitor_of_the_registry_was_measured() {
        let bench = Bench::measured().unwrap();
        for entry in MONITORS.iter().filter(|entry| entry.looks_for_faults) {
            for stage in [entry.work.to_owned(), with_fault(entry.work)] {
                let satellites: Vec<u64> = bench.of(&stage).map(|i| i.satellites).collect();
                assert_eq!(satellites, [8, 12, 18, 24], "{stage}");
            }
        }
    }
}
