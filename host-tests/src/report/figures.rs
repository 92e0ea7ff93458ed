//! The figures at the head of the report, computed from the rows themselves.

use super::data::satellite_ranges;
use super::table::{Row, Table};

/// Figures of one axis: horizontal or vertical.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// 95th percentile of the error, m.
    pub error_95_m: Option<f64>,
    /// Largest error, m.
    pub error_max_m: Option<f64>,
    /// Median protection level, m.
    pub level_median_m: Option<f64>,
    /// Largest protection level, m.
    pub level_max_m: Option<f64>,
    /// Largest ratio of error to level.
    pub ratio_max: Option<f64>,
    /// Epochs said to be usable whose error exceeds the level.
    pub exceeded: usize,
    /// Last alert limit, m.
    pub limit_m: Option<f64>,
}

/// A stretch of epochs with one state and reason.
#[derive(Clone, Debug, PartialEq)]
pub struct Stretch {
    /// Time of the first epoch, s.
    pub from_s: f64,
    /// Time of the last epoch, s.
    pub to_s: f64,
    /// Epochs.
    pub epochs: usize,
    /// nominal, excluded, alert or unavailable.
    pub integrity: String,
    /// Why.
    pub reason: String,
    /// Satellites excluded at some epoch of it.
    pub excluded: Vec<String>,
}

/// Everything the head and the tables say.
#[derive(Clone, Debug, PartialEq)]
pub struct Figures {
    /// Rows.
    pub epochs: usize,
    /// Rows with a position.
    pub positions: usize,
    /// Rows per state: nominal, excluded, alert, unavailable.
    pub states: [usize; 4],
    /// Horizontal.
    pub horizontal: Axis,
    /// Vertical.
    pub vertical: Axis,
    /// From the first to the last epoch, s.
    pub duration_s: f64,
    /// State by time.
    pub stretches: Vec<Stretch>,
    /// Satellite, first and last time, epochs of each exclusion.
    pub exclusions: Vec<(String, f64, f64, usize)>,
}

/// States in the order of [`Figures::states`].
pub const STATES: [&str; 4] = ["nominal", "excluded", "alert", "unavailable"];

/// The value below or at which `share` of the values lie (nearest rank).
fn percentile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let rank = (share * values.len() as f64).ceil() as usize;
    values.get(rank.saturating_sub(1)).copied()
}

fn axis(
    rows: &[Row],
    error: fn(&Row) -> Option<f64>,
    level: fn(&Row) -> Option<f64>,
    limit: fn(&Row) -> Option<f64>,
) -> Axis {
    let errors: Vec<f64> = rows.iter().filter_map(error).collect();
    let levels: Vec<f64> = rows.iter().filter_map(level).collect();
    let usable = |row: &&Row| row.integrity == STATES[0] || row.integrity == STATES[1];
    let pairs: Vec<(f64, f64)> = rows
        .iter()
        .filter(usable)
        .filter_map(|row| error(row).zip(level(row)))
        .collect();
    Axis {
        error_95_m: percentile(errors.clone(), 0.95),
        error_max_m: percentile(errors, 1.0),
        level_median_m: percentile(levels.clone(), 0.5),
        level_max_m: percentile(levels, 1.0),
        ratio_max: percentile(pairs.iter().map(|(e, l)| e / l).collect(), 1.0),
        exceeded: pairs.iter().filter(|(e, l)| e > l).count(),
        limit_m: rows.iter().rev().find_map(limit),
    }
}

fn stretches(rows: &[Row]) -> Vec<Stretch> {
    let mut stretches: Vec<Stretch> = Vec::new();
    for row in rows {
        let same = stretches
            .last_mut()
            .filter(|last| last.integrity == row.integrity && last.reason == row.reason);
        let stretch = match same {
            Some(last) => last,
            None => {
                stretches.push(Stretch {
                    from_s: row.t_s,
                    to_s: row.t_s,
                    epochs: 0,
                    integrity: row.integrity.clone(),
                    reason: row.reason.clone(),
                    excluded: Vec::new(),
                });
                let end = stretches.len() - 1;
                &mut stretches[end]
            }
        };
        stretch.to_s = row.t_s;
        stretch.epochs += 1;
        for name in &row.excluded {
            if !stretch.excluded.contains(name) {
                stretch.excluded.push(name.clone());
            }
        }
    }
    stretches
}

/// Computes the figures of a table.
pub fn figures(table: &Table) -> Figures {
    let rows = &table.rows;
    let count = |state: &str| rows.iter().filter(|row| row.integrity == state).count();
    let mut exclusions: Vec<(String, f64, f64, usize)> = satellite_ranges(rows)
        .into_iter()
        .flat_map(|(name, _, excluded)| {
            excluded
                .into_iter()
                .map(move |[from, to]| (name.clone(), rows[from].t_s, rows[to - 1].t_s, to - from))
        })
        .collect();
    exclusions.sort_by(|a, b| a.1.total_cmp(&b.1));
    Figures {
        epochs: rows.len(),
        positions: rows.iter().filter(|row| row.r_e_m.is_some()).count(),
        states: STATES.map(count),
        horizontal: axis(
            rows,
            Row::horizontal_error_m,
            |row| row.hpl_m,
            |row| row.hal_m,
        ),
        vertical: axis(
            rows,
            Row::vertical_error_m,
            |row| row.vpl_m,
            |row| row.val_m,
        ),
        duration_s: rows[rows.len() - 1].t_s - rows[0].t_s,
        stretches: stretches(rows),
        exclusions,
    }
}
