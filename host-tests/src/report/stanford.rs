//! Error against level, counted in cells: the diagram of Stanford, for runs of any length.
//!
//! ```text
//! level │ unavailable      ╱ unavailable
//!       │                ╱   and misleading
//! limit │──────────────╱────────────────────
//!       │  normal    ╱ mis- │ hazardously
//!       │ operation╱ leading│ misleading
//!       └────────╱──────────┴────────── error
//! ```
//!
//! Epochs with a position, an error and a level that are not at alert: an alert misleads nobody. Cells are
//! [`PER_DECADE`] to a factor of ten on both axes, apart for errors above the level, so that none of these
//! hides in a cell on the diagonal.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::table::Row;

/// Cells to a factor of ten.
pub const PER_DECADE: f64 = 32.0;
/// Smaller errors are drawn as this, m.
const LEAST_M: f64 = 1e-3;

/// Which part of the diagram an epoch lies in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Region {
    /// Error within the level, level within the limit.
    Normal,
    /// Level above the limit, error within the level.
    Unavailable,
    /// Error above the level, neither above the limit.
    Misleading,
    /// Level and error above the limit, error above the level.
    UnavailableMisleading,
    /// Error above the limit and the level within it.
    Hazardous,
}

impl Region {
    /// The part of an epoch; without a limit only the first and the third exist. NaN is hazardous.
    pub fn of(error_m: f64, level_m: f64, limit_m: Option<f64>) -> Self {
        let limit_m = limit_m.unwrap_or(f64::INFINITY);
        match (error_m <= level_m, level_m <= limit_m) {
            (true, true) => Self::Normal,
            (true, false) => Self::Unavailable,
            (false, true) if error_m <= limit_m => Self::Misleading,
            (false, true) => Self::Hazardous,
            (false, false) if level_m > limit_m => Self::UnavailableMisleading,
            (false, false) => Self::Hazardous,
        }
    }
}

/// A diagram.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Diagram {
    /// Epochs in the parts, in the order of [`Region`].
    pub regions: [usize; 5],
    /// Epochs with an error that are at alert.
    pub alerted: usize,
    /// Epochs with an error, without a level, not at alert.
    pub without_level: usize,
    /// Cell of the error, cell of the level, whether the error is above: epochs.
    pub cells: BTreeMap<(i32, i32, bool), usize>,
    /// Last alert limit, m.
    pub limit_m: Option<f64>,
}

fn cell(value_m: f64) -> i32 {
    (value_m.max(LEAST_M).log10() * PER_DECADE).floor() as i32
}

impl Diagram {
    /// Counts the epochs of one axis.
    pub fn new(
        rows: &[Row],
        error: fn(&Row) -> Option<f64>,
        level: fn(&Row) -> Option<f64>,
        limit: fn(&Row) -> Option<f64>,
    ) -> Self {
        let mut diagram = Self {
            limit_m: rows.iter().rev().find_map(limit),
            ..Self::default()
        };
        for row in rows {
            let Some(error_m) = error(row) else { continue };
            if row.integrity == "alert" {
                diagram.alerted += 1;
                continue;
            }
            let Some(level_m) = level(row) else {
                diagram.without_level += 1;
                continue;
            };
            let region = Region::of(error_m, level_m, limit(row));
            diagram.regions[region as usize] += 1;
            let key = (cell(error_m), cell(level_m), error_m > level_m);
            *diagram.cells.entry(key).or_default() += 1;
        }
        diagram
    }

    /// For the page's script.
    pub fn pack(&self) -> Value {
        let cells: Vec<i64> = self
            .cells
            .iter()
            .flat_map(|((error, level, above), count)| {
                [
                    i64::from(*error),
                    i64::from(*level),
                    i64::from(*above),
                    *count as i64,
                ]
            })
            .collect();
        json!({
            "per": PER_DECADE,
            "cells": cells,
            "regions": self.regions,
            "alerted": self.alerted,
            "without": self.without_level,
            "limit": self.limit_m,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_epoch_lies_in_one_part() {
        let limit = Some(40.0);
        for (error, level, limit, region) in [
            (1.0, 7.0, limit, Region::Normal),
            (7.0, 7.0, limit, Region::Normal),
            (1.0, 50.0, limit, Region::Unavailable),
            (45.0, 50.0, limit, Region::Unavailable),
            (8.0, 7.0, limit, Region::Misleading),
            (40.0, 7.0, limit, Region::Misleading),
            (41.0, 7.0, limit, Region::Hazardous),
            (60.0, 50.0, limit, Region::UnavailableMisleading),
            (1.0, 700.0, None, Region::Normal),
            (800.0, 700.0, None, Region::Misleading),
            (f64::NAN, 7.0, limit, Region::Hazardous),
            (1.0, f64::NAN, limit, Region::Hazardous),
        ] {
            assert_eq!(Region::of(error, level, limit), region, "{error} {level}");
        }
    }

    #[test]
    fn cells_are_logarithmic_and_have_a_floor() {
        assert_eq!(cell(1.0), 0);
        assert_eq!(cell(10.0), 32);
        assert_eq!(cell(0.999), -1);
        assert_eq!(cell(0.0), -96);
    }
}
