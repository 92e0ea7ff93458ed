//! Tables and files of `surefix compare`.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context, Result};
use surefix_core::gnss::SatelliteSet;

use super::counts::{CONFIDENCE, LevelSummary, Said, Summary, horizontal_vertical};
use super::instructions::Instructions;
use super::picture;
use super::product;
use super::registry::Tests;
use super::{Comparison, MonitorResult, Plan};
use crate::campaign::binomial::percent;

/// Prints nothing; writes everything.
///
/// # Errors
/// When a file cannot be written.
pub fn write(comparison: &Comparison, directory: &Path) -> Result<()> {
    let json = serde_json::to_string_pretty(comparison)? + "\n";
    for (name, text) in [
        ("comparison.md", tables(comparison)),
        ("comparison.csv", counts_csv(comparison)),
        ("comparison.json", json),
        ("comparison.svg", picture::picture(comparison)),
        ("epochs.csv", epochs_csv(comparison)),
    ] {
        let path = directory.join(name);
        std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

/// Rows as a table in Markdown whose columns stand under each other.
fn markdown(head: &[&str], rows: &[Vec<String>]) -> String {
    let width = |column: usize| {
        let cells = rows.iter().filter_map(|row| row.get(column));
        let lengths = cells.map(|cell| cell.chars().count());
        lengths
            .chain([head[column].chars().count()])
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..head.len()).map(width).collect();
    let line = |cells: &mut dyn Iterator<Item = String>| {
        let padded: Vec<String> = cells
            .zip(&widths)
            .map(|(cell, width)| format!("{cell:<width$}"))
            .collect();
        format!("| {} |\n", padded.join(" | "))
    };
    let mut text = line(&mut head.iter().map(ToString::to_string));
    text += &line(&mut widths.iter().map(|width| "-".repeat(*width)));
    for row in rows {
        text += &line(&mut row.iter().cloned());
    }
    text + "\n"
}

/// Tables in Markdown.
pub fn tables(comparison: &Comparison) -> String {
    let [fewest, median, most] = comparison.satellites;
    let mut text = format!(
        "### {}\n\n{} epochs, {fewest} to {most} satellites, median {median}; phase of flight {}",
        comparison.recording, comparison.epochs, comparison.phase
    );
    if comparison.unsolved > 0 {
        let _ = write!(
            text,
            "; {} epochs without a position left out",
            comparison.unsolved
        );
    }
    if comparison.noise_added {
        let _ = write!(
            text,
            "; white noise of one sigma added, seed {}",
            comparison.seed
        );
    }
    match (&comparison.truth, &comparison.truth_unused) {
        (Some(source), _) => {
            let _ = writeln!(text, "; errors against {source}.\n");
        }
        (None, why) => {
            let why = why.as_deref().unwrap_or("there is no truth");
            let _ = writeln!(
                text,
                "; no errors, as {why}: give --truth, --at or --at-llh.\n"
            );
        }
    }
    let monitors = &comparison.monitors;
    let _ = writeln!(text, "Epochs without a fault:\n");
    text += &healthy(monitors);
    if !comparison.faults.is_empty() {
        let _ = writeln!(
            text,
            "Epochs with a fault, {}:\n",
            comparison.faults.join(", ")
        );
        text += &faulted(monitors);
    }
    text += &levels(monitors);
    for monitor in monitors.iter().filter(|m| m.most_satellites < most) {
        let _ = writeln!(
            text,
            "{} has room for {} satellites and takes the highest: the others are neither used nor tested. Where all faults of an epoch or a trial are on such satellites it is counted as not in use, {} times here, and is in no share of detections or right exclusions.\n",
            monitor.title,
            monitor.most_satellites,
            not_in_use(monitor)
        );
    }
    if let Some(plan) = &comparison.sweep {
        text += &sweep(plan, monitors, comparison.seed);
    }
    text += &cost(monitors);
    text
}

/// Epochs and trials whose faults are all on satellites that the monitor has no room for.
fn not_in_use(monitor: &MonitorResult) -> u64 {
    let with_fault = monitor.with_fault.iter();
    let summaries = with_fault.chain(monitor.sweep.iter().flatten());
    summaries.map(|s| s.not_in_use).sum()
}

/// Events in percent.
pub(super) fn share(events: u64, of: u64) -> f64 {
    100.0 * events as f64 / of.max(1) as f64
}

fn of(events: u64, all: u64) -> String {
    if all == 0 {
        "-".into()
    } else {
        format!("{events}")
    }
}

fn metres(value: Option<f64>) -> String {
    value.map_or("-".into(), |m| format!("{m:.2}"))
}

fn causes(counts: &std::collections::BTreeMap<&'static str, u64>) -> String {
    let causes: Vec<String> = counts.iter().map(|(why, n)| format!("{n} {why}")).collect();
    if causes.is_empty() {
        "0".into()
    } else {
        causes.join(", ")
    }
}

fn healthy(monitors: &[MonitorResult]) -> String {
    let rows: Vec<Vec<String>> = monitors
        .iter()
        .map(|monitor| {
            let s = &monitor.without_fault;
            vec![
                monitor.title.into(),
                s.epochs.to_string(),
                causes(&s.not_tested),
                s.detected.to_string(),
                percent(s.detected, s.epochs, CONFIDENCE),
                monitor
                    .p_false_alert
                    .map_or("-".into(), |p| format!("{:.1e}", 100.0 * p)),
                s.excluded_wrongly.to_string(),
                metres(s.error_h95_m),
                metres(s.error_v95_m),
            ]
        })
        .collect();
    markdown(
        &[
            "monitor",
            "epochs",
            "not tested",
            "false alerts",
            "in % (95 % interval)",
            "set to, %",
            "healthy out",
            "H 95 %, m",
            "V 95 %, m",
        ],
        &rows,
    )
}

fn faulted(monitors: &[MonitorResult]) -> String {
    let rows: Vec<Vec<String>> = monitors
        .iter()
        .filter_map(|monitor| {
            let s = monitor.with_fault.as_ref()?;
            Some(vec![
                monitor.title.into(),
                s.epochs.to_string(),
                causes(&s.not_tested),
                s.not_in_use.to_string(),
                percent(s.detected, s.in_use, CONFIDENCE),
                s.excluded_rightly.to_string(),
                s.excluded_partly.to_string(),
                s.excluded_wrongly.to_string(),
                s.still_held.to_string(),
                s.served.to_string(),
                metres(s.error_h95_m),
                metres(s.error_v95_m),
            ])
        })
        .collect();
    markdown(
        &[
            "monitor",
            "epochs",
            "not tested",
            "not in use",
            "detected, % (95 % interval)",
            "rightly out",
            "partly out",
            "healthy out",
            "still held",
            "served",
            "H 95 %, m",
            "V 95 %, m",
        ],
        &rows,
    )
}

fn levels(monitors: &[MonitorResult]) -> String {
    let three = |level: &LevelSummary| {
        [level.mean_m, level.p95_m, level.max_m]
            .map(metres)
            .join(", ")
    };
    let row = |monitor: &MonitorResult, kind: &str, s: &Summary| {
        // An alert limit is one of a position.
        let is_of_position = monitor.tests == Tests::Pseudoranges;
        let diagram = |parts: &[u64; 5]| {
            if !is_of_position {
                return "-".to_owned();
            }
            let [normal, unavailable, rest @ ..] = parts;
            format!("{normal}, {unavailable}, {}", rest.iter().sum::<u64>())
        };
        vec![
            monitor.title.to_owned(),
            kind.to_owned(),
            s.with_levels.to_string(),
            causes(&s.without_levels),
            three(&s.hpl),
            three(&s.vpl),
            of(s.above_hpl, s.compared),
            of(s.above_vpl, s.compared),
            diagram(&s.stanford_horizontal),
            diagram(&s.stanford_vertical),
        ]
    };
    let mut rows = Vec::new();
    for monitor in monitors {
        // What gives none at all says so in the comparison of the algorithms.
        let offered = |s: &Summary| s.without_levels.get("not_offered") != Some(&s.epochs);
        if offered(&monitor.without_fault) {
            rows.push(row(monitor, "no fault", &monitor.without_fault));
        }
        if let Some(s) = monitor.with_fault.as_ref().filter(|s| offered(s)) {
            rows.push(row(monitor, "fault", s));
        }
    }
    let table = markdown(
        &[
            "levels",
            "epochs",
            "with levels",
            "without",
            "HPL mean, 95 %, largest, m",
            "VPL mean, 95 %, largest, m",
            "error above HPL",
            "above VPL",
            "horizontally normal, unavailable, misleading",
            "vertically",
        ],
        &rows,
    );
    format!(
        "Levels, and served positions whose error they do not bound; the last two columns against the alert limits of the phase:\n\n{table}"
    )
}

fn sweep(plan: &Plan, monitors: &[MonitorResult], seed: u64) -> String {
    let which = if plan.in_turn {
        "on every satellite in turn".to_owned()
    } else {
        format!(
            "on {} of the satellites, drawn at random with seed {seed}, of either sign",
            plan.faults
        )
    };
    let swept: Vec<(&MonitorResult, &Vec<Summary>)> = monitors
        .iter()
        .filter_map(|m| Some((m, m.sweep.as_ref()?)))
        .collect();
    let mut head = vec!["fault, m"];
    head.extend(swept.iter().map(|(monitor, _)| monitor.title));
    let rows: Vec<Vec<String>> = plan
        .sizes_m
        .iter()
        .enumerate()
        .map(|(k, size_m)| {
            let cells = swept.iter().map(|(_, sizes)| {
                let s = &sizes[k];
                format!(
                    "{:.0} {:.0} {:.0} {}",
                    share(s.detected, s.in_use),
                    share(s.excluded_rightly, s.in_use),
                    share(s.excluded_wrongly, s.epochs),
                    of(s.above_level, s.compared)
                )
            });
            std::iter::once(format!("{size_m}")).chain(cells).collect()
        })
        .collect();
    format!(
        "A fault {which}, {} trials of each size: detected %, rightly excluded %, something healthy excluded %, and trials served with an error above a level:\n\n{}",
        plan.trials,
        markdown(&head, &rows)
    )
}

fn cost(monitors: &[MonitorResult]) -> String {
    let executed = |instructions: Option<Instructions>| {
        instructions.map_or("-".into(), |i| format!("{}, {}", i.median, i.worst))
    };
    let stack = |monitor: &MonitorResult| {
        let measured = monitor
            .instructions
            .iter()
            .chain(&monitor.instructions_with_fault);
        let most = measured.map(|i| i.stack_b).max();
        most.map_or("-".into(), |b| b.to_string())
    };
    let rows: Vec<Vec<String>> = monitors
        .iter()
        .filter(|monitor| monitor.instructions.is_some())
        .map(|monitor| {
            let skies = monitor.instructions.map(measured_with);
            vec![
                monitor.title.into(),
                executed(monitor.instructions),
                executed(monitor.instructions_with_fault),
                stack(monitor),
                skies.unwrap_or("-".into()),
                monitor.memory_b.map_or("-".into(), |b| b.to_string()),
            ]
        })
        .collect();
    let table = markdown(
        &[
            "monitor",
            "instructions without a fault",
            "with one",
            "stack, bytes",
            "measured with",
            "memory, bytes",
        ],
        &rows,
    );
    format!(
        "Executed instructions of an epoch on the emulated board (`cargo xtask bench`, median and worst of its own random skies), of the skies it measured the nearest to the median number of satellites and of constellations here:\n\n{table}"
    )
}

/// The skies of a figure, in words.
fn measured_with(instructions: Instructions) -> String {
    let constellations = match instructions.constellations {
        1 => "one constellation".to_owned(),
        2 => "two constellations".to_owned(),
        more => format!("{more} constellations"),
    };
    format!("{} satellites, {constellations}", instructions.satellites)
}

/// A field that may be empty.
fn field(value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| value.to_string())
}

/// One row per monitor and kind of epoch.
fn counts_csv(comparison: &Comparison) -> String {
    let mut text = "monitor,kind,size_m,epochs,tested,not_in_use,detected,detection_low,detection_high,excluded,rightly,partly,wrongly,still_held,served,with_levels,hpl_mean_m,hpl_p95_m,hpl_max_m,vpl_mean_m,vpl_p95_m,vpl_max_m,compared,above_hpl,above_vpl,above_level,error_h95_m,error_v95_m\n".to_owned();
    let mut row = |name: &str, kind: &str, size_m: Option<f64>, s: &Summary| {
        let [low, high] = s.detection_rate.interval;
        let levels = |level: &LevelSummary| {
            [level.mean_m, level.p95_m, level.max_m]
                .map(field)
                .join(",")
        };
        let _ = writeln!(
            text,
            "{name},{kind},{},{},{},{},{},{low},{high},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}",
            field(size_m),
            s.epochs,
            s.tested,
            s.not_in_use,
            s.detected,
            s.excluded,
            s.excluded_rightly,
            s.excluded_partly,
            s.excluded_wrongly,
            s.still_held,
            s.served,
            s.with_levels,
            levels(&s.hpl),
            levels(&s.vpl),
            s.compared,
            s.above_hpl,
            s.above_vpl,
            s.above_level,
            field(s.error_h95_m),
            field(s.error_v95_m),
        );
    };
    for monitor in &comparison.monitors {
        row(monitor.name, "without_fault", None, &monitor.without_fault);
        if let Some(summary) = &monitor.with_fault {
            row(monitor.name, "with_fault", None, summary);
        }
        let sizes = comparison.sweep.iter().flat_map(|plan| &plan.sizes_m);
        for (size_m, summary) in sizes.zip(monitor.sweep.iter().flatten()) {
            row(monitor.name, "sweep", Some(*size_m), summary);
        }
    }
    text
}

fn satellites(set: &SatelliteSet) -> String {
    let names: Vec<String> = set.iter().map(|s| s.to_string()).collect();
    names.join("+")
}

/// One row per epoch and monitor, and behind them those of surefix itself without the faults.
fn epochs_csv(comparison: &Comparison) -> String {
    let mut text =
        "t_s,faulted,monitor,answer,excluded,hpl_m,vpl_m,error_h_m,error_v_m\n".to_owned();
    let mut row = |t_s: &f64, faulted: &SatelliteSet, name: &str, said: &Said| {
        let levels = said.levels.ok();
        let error = said.error_enu_m.map(horizontal_vertical);
        let _ = writeln!(
            text,
            "{t_s},{},{name},{},{},{},{},{},{}",
            satellites(faulted),
            said.answer.name(),
            satellites(&said.excluded),
            field(levels.map(|l| l.hpl_m)),
            field(levels.map(|l| l.vpl_m)),
            field(error.map(|[h, _]| h)),
            field(error.map(|[_, v]| v)),
        );
    };
    let series = &comparison.series;
    let epochs = comparison.t_s.iter().zip(&series.faulted).zip(&series.said);
    for ((t_s, faulted), said) in epochs {
        for (monitor, said) in comparison.monitors.iter().zip(said) {
            row(t_s, faulted.of(monitor.tests), monitor.name, said);
        }
    }
    for (t_s, said) in comparison.t_s.iter().zip(&series.clean) {
        row(t_s, &SatelliteSet::EMPTY, product::CLEAN_NAME, said);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_a_table_stand_under_each_other() {
        let rows = [vec!["one".to_owned(), "2".to_owned()]];
        let text = markdown(&["a", "long"], &rows);
        assert_eq!(text, "| a   | long |\n| --- | ---- |\n| one | 2    |\n\n");
    }

    #[test]
    fn a_figure_says_what_it_was_measured_with() {
        let of = |satellites, constellations| {
            measured_with(Instructions {
                satellites,
                constellations,
                median: 1,
                worst: 2,
                stack_b: 3,
            })
        };
        assert_eq!(of(12, 2), "12 satellites, two constellations");
        assert_eq!(of(8, 1), "8 satellites, one constellation");
    }
}
