//! Executed instructions of a monitor, as the emulated board measured them.
//!
//! `instructions.json` holds the rows `monitor/…` of what `cargo xtask bench --json FILE` wrote. The board measures random
//! skies of a few numbers of satellites and of one or two constellations; for an epoch the nearest of these is taken,
//! and said.

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};

const MEASURED: &str = include_str!("instructions.json");

/// A constellation more or less is as far as so many satellites more or less, the step between the smaller skies
/// measured: at 8 and 12 satellites the number of constellations decides.
const CONSTELLATION_AS_SATELLITES: u64 = 4;

/// The figures of a bench.
#[derive(Debug, Deserialize)]
pub struct Bench {
    rows: Vec<BenchRow>,
}

#[derive(Debug, Deserialize)]
struct BenchRow {
    stage: String,
    n_sats: Option<u64>,
    n_states: Option<u64>,
    instr_median: Option<u64>,
    instr_worst: Option<u64>,
    stack_b: Option<u64>,
}

/// Instructions of an epoch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Instructions {
    /// Satellites of the skies they were measured with.
    pub satellites: u64,
    /// Constellations of these, each with a clock.
    pub constellations: u64,
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
                    constellations: row.n_states?.checked_sub(3)?,
                    median: row.instr_median?,
                    worst: row.instr_worst?,
                    stack_b: row.stack_b?,
                })
            })
    }

    /// At the sky nearest to this, of two as near the one with as many constellations; `None` where the stage was not
    /// measured.
    pub fn nearest(
        &self,
        stage: &str,
        satellites: u64,
        constellations: u64,
    ) -> Option<Instructions> {
        self.of(stage).min_by_key(|row| {
            let clocks = row.constellations.abs_diff(constellations);
            let away = row.satellites.abs_diff(satellites) + CONSTELLATION_AS_SATELLITES * clocks;
            (away, clocks)
        })
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
    fn the_nearest_number_of_satellites_and_constellations_is_taken() {
        let row = |stage: &str, n: u64, states: u64, median: u64| {
            format!(
                "{{\"stage\":\"{stage}\",\"n_sats\":{n},\"n_states\":{states},\"instr_median\":{median},\"instr_worst\":{},\"stack_b\":0}}",
                2 * median
            )
        };
        let rows = [
            row("a", 8, 4, 10),
            row("b", 8, 4, 5),
            row("a", 12, 5, 20),
            row("a", 18, 5, 30),
        ]
        .join(",");
        let bench = Bench::parse(&format!("{{\"rows\":[{rows}]}}")).unwrap();
        let median = |stage: &str, n: u64, constellations: u64| {
            let nearest = bench.nearest(stage, n, constellations);
            nearest.map(|i| (i.satellites, i.constellations, i.median))
        };
        assert_eq!(median("a", 9, 1), Some((8, 1, 10)));
        assert_eq!(median("a", 11, 1), Some((8, 1, 10)));
        assert_eq!(median("a", 8, 2), Some((12, 2, 20)));
        assert_eq!(median("a", 17, 1), Some((18, 2, 30)));
        assert_eq!(median("b", 24, 2), Some((8, 1, 5)));
        assert_eq!(median("c", 8, 1), None);
        assert!(Bench::parse("[]").is_err());
    }

    #[test]
    fn every_monitor_of_the_registry_was_measured() {
        let bench = Bench::measured().unwrap();
        for entry in MONITORS.iter().filter(|entry| entry.looks_for_faults) {
            for stage in [entry.work.to_owned(), with_fault(entry.work)] {
                let skies = bench.of(&stage).map(|i| (i.satellites, i.constellations));
                let skies: Vec<(u64, u64)> = skies.collect();
                assert_eq!(skies, [(8, 1), (12, 2), (18, 2), (24, 2)], "{stage}");
            }
        }
    }
}
