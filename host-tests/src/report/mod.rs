//! `surefix report DIR`: the run in DIR as one HTML file that needs nothing else.
//!
//! Reads `epochs.csv`, and `satellites.csv`, `errors.csv` and `summary.json` where they are there; writes
//! `report.html` beside them. Style, script and data are inside the file; it opens without a
//! network. Every epoch is in it: where a screen has fewer columns than the run has epochs, a column
//! shows the smallest and the largest value of the epochs it stands for.

mod bank;
mod data;
mod figures;
mod satellites;
mod stanford;
mod table;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde_json::Value;

use figures::{Axis, Figures, STATES, figures};
use table::Table;

pub use stanford::Region;

const PAGE: &str = include_str!("report.html");
const EMPTY_PAGE: &str = include_str!("empty.html");
const STYLE: &str = include_str!("report.css");
/// Parts of one function, in this order.
const SCRIPT: &str = concat!(
    "\"use strict\";\n(() => {\n",
    include_str!("script/data.js"),
    include_str!("script/panel.js"),
    include_str!("script/lines.js"),
    include_str!("script/satellites.js"),
    include_str!("script/track.js"),
    include_str!("script/sky.js"),
    include_str!("script/bank.js"),
    include_str!("script/stanford.js"),
    include_str!("script/page.js"),
    include_str!("script/moving.js"),
    "})();"
);

/// Rows of a table in the page; how many more there are is said below it.
const TABLE_ROWS: usize = 100;

/// Arguments of `surefix report`.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// Directory that `surefix replay` wrote.
    pub dir: PathBuf,
}

/// Runs `surefix report`: writes `report.html` into the directory and says where.
pub fn run(args: &Args) -> Result<()> {
    let path = write(&args.dir)?;
    println!("{}", path.display());
    Ok(())
}

/// Writes `report.html` into a directory that `replay` wrote; gives its path.
///
/// # Errors
/// When `epochs.csv` is missing or damaged, `summary.json` is no JSON, or the report cannot be written.
pub fn write(directory: &Path) -> Result<PathBuf> {
    let table = Table::read(directory)?;
    let summary_path = directory.join("summary.json");
    let summary: Option<Value> = if summary_path.exists() {
        let text = std::fs::read_to_string(&summary_path)
            .with_context(|| format!("cannot read {}", summary_path.display()))?;
        let summary = serde_json::from_str(&text)
            .with_context(|| format!("{} is no JSON", summary_path.display()))?;
        Some(summary)
    } else {
        None
    };
    let name = directory
        .canonicalize()
        .ok()
        .and_then(|path| path.file_name().map(|n| n.to_string_lossy().into_owned()))
        .unwrap_or_else(|| directory.display().to_string());
    let path = directory.join("report.html");
    std::fs::write(&path, page(&name, &table, summary.as_ref()))
        .with_context(|| format!("cannot write {}", path.display()))?;
    Ok(path)
}

/// The whole page.
fn page(name: &str, table: &Table, summary: Option<&Value>) -> String {
    let Some(first) = table.rows.first() else {
        return empty_page(name, summary);
    };
    let figures = figures(table);
    // `</` would end the element the data stand in.
    let data = data::pack(table).to_string().replace("</", "<\\/");
    let start = first.week.zip(first.tow_s).map_or_else(
        || "time unknown".to_owned(),
        |(week, tow_s)| {
            format!(
                "first epoch {} GPST (week {week}, {tow_s} s)",
                gpst(week, tow_s)
            )
        },
    );
    let parts = [
        ("{{title}}", escape(name)),
        ("{{style}}", STYLE.to_owned()),
        (
            "{{run}}",
            format!(
                "{} · {} epochs over {} · surefix {}",
                escape(&start),
                figures.epochs,
                duration(figures.duration_s),
                env!("CARGO_PKG_VERSION")
            ),
        ),
        ("{{verdicts}}", verdicts(&figures)),
        ("{{brief}}", brief(&figures)),
        ("{{figures}}", figure_table(&figures, table.has_errors)),
        ("{{stretches}}", stretch_table(&figures)),
        ("{{exclusions}}", exclusion_table(&figures)),
        ("{{summary}}", summary_table(summary)),
        ("{{data}}", data),
        ("{{script}}", SCRIPT.to_owned()),
    ];
    fill(PAGE, &parts)
}

/// The page of a run without an epoch: that it has none, and what was counted.
fn empty_page(name: &str, summary: Option<&Value>) -> String {
    fill(
        EMPTY_PAGE,
        &[
            ("{{title}}", escape(name)),
            ("{{style}}", STYLE.to_owned()),
            (
                "{{run}}",
                format!("no epoch · surefix {}", env!("CARGO_PKG_VERSION")),
            ),
            ("{{summary}}", summary_table(summary)),
        ],
    )
}

/// A template with its parts in their places.
fn fill(template: &str, parts: &[(&str, String)]) -> String {
    // One pass over the template, so that nothing inserted is taken for a place to insert.
    let mut page = String::with_capacity(template.len() + 1_000_000);
    let mut rest = template;
    while let Some(start) = rest.find("{{") {
        let (before, from) = rest.split_at(start);
        page.push_str(before);
        let part = parts.iter().find(|(mark, _)| from.starts_with(mark));
        match part {
            Some((mark, content)) => {
                page.push_str(content);
                rest = &from[mark.len()..];
            }
            None => {
                page.push_str("{{");
                rest = &from[2..];
            }
        }
    }
    page.push_str(rest);
    page
}

/// A name of a file format as words.
fn words(name: &str) -> String {
    name.replace("hpl_", "HPL_")
        .replace("vpl_", "VPL_")
        .replace('_', " ")
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// Calendar date and time of a GPS week and time of week, without leap seconds.
fn gpst(week: f64, tow_s: f64) -> String {
    // Days since 0000-03-01, where years end with their leap day and eras of 400 years repeat.
    let seconds = week * 604_800.0 + tow_s;
    let days = (seconds / 86_400.0).floor();
    let of_day = (seconds - days * 86_400.0).floor() as i64;
    let z = days as i64 + 723125;
    let era = z.div_euclid(146_097);
    let doe = z.rem_euclid(146_097);
    let yoe = (doe - doe / 1460 + doe / 36_524 - doe / 146_096) / 365;
    let doy = doe - (365 * yoe + yoe / 4 - yoe / 100);
    let mp = (5 * doy + 2) / 153;
    let day = doy - (153 * mp + 2) / 5 + 1;
    let month = if mp < 10 { mp + 3 } else { mp - 9 };
    let year = yoe + era * 400 + i64::from(month <= 2);
    format!(
        "{year:04}-{month:02}-{day:02} {:02}:{:02}:{:02}",
        of_day / 3600,
        of_day / 60 % 60,
        of_day % 60
    )
}

fn duration(seconds: f64) -> String {
    let whole = seconds.round() as i64;
    match (whole / 3600, whole / 60 % 60, whole % 60) {
        (0, 0, s) => format!("{s} s"),
        (0, m, 0) => format!("{m} min"),
        (0, m, s) => format!("{m} min {s} s"),
        (h, 0, 0) => format!("{h} h"),
        (h, m, 0) => format!("{h} h {m} min"),
        (h, m, s) => format!("{h} h {m} min {s} s"),
    }
}

/// Time from the first epoch as the pictures write it.
fn clock(seconds: f64) -> String {
    let whole = seconds.floor() as i64;
    let tenths = ((seconds - seconds.floor()) * 10.0).floor() as i64;
    let fraction = if tenths == 0 {
        String::new()
    } else {
        format!(".{tenths}")
    };
    format!(
        "{:02}:{:02}:{:02}{fraction}",
        whole / 3600,
        whole / 60 % 60,
        whole % 60
    )
}

fn percent(part: usize, whole: usize) -> String {
    let share = 100.0 * part as f64 / whole as f64;
    // Never rounded to all or nothing.
    if part != whole && share > 99.99 {
        "> 99.99 %".to_owned()
    } else if part != 0 && share < 0.01 {
        "< 0.01 %".to_owned()
    } else {
        format!("{share:.2} %")
    }
}

fn verdicts(figures: &Figures) -> String {
    let meaning = [
        "monitored, no fault",
        "faulty satellite out",
        "fault present, do not use",
        "no level within limits",
    ];
    let mut html = String::new();
    for ((state, count), meaning) in STATES.iter().zip(figures.states).zip(meaning) {
        let none = if count == 0 { " none" } else { "" };
        let _ = write!(
            html,
            "<div class=\"verdict {state}{none}\"><span class=\"name\">{state}</span>\
             <span class=\"count\">{count}</span>\
             <span class=\"share\">{}</span><span class=\"meaning\">{meaning}</span></div>",
            percent(count, figures.epochs)
        );
    }
    html
}

/// When satellites were excluded and when the position was not to be used, in a line each.
fn brief(figures: &Figures) -> String {
    const SHOWN: usize = 6;
    let list = |mut entries: Vec<String>| {
        let hidden = entries.len().saturating_sub(SHOWN);
        entries.truncate(SHOWN);
        let mut text = if entries.is_empty() {
            "none".to_owned()
        } else {
            entries.join(" · ")
        };
        if hidden > 0 {
            let _ = write!(text, " · and {hidden} more below");
        }
        text
    };
    let exclusions = figures
        .exclusions
        .iter()
        .map(|(name, from_s, to_s, _)| {
            format!(
                "<b>{}</b> {}–{}",
                escape(name),
                clock(*from_s),
                clock(*to_s)
            )
        })
        .collect();
    let in_state = |state: &str| {
        figures
            .stretches
            .iter()
            .filter(|stretch| stretch.integrity == state)
            .map(|stretch| {
                let reason = words(&stretch.reason);
                let (from, to) = (clock(stretch.from_s), clock(stretch.to_s));
                format!("{from}–{to} {}", escape(&reason))
            })
            .collect()
    };
    format!(
        "<dl><dt>excluded</dt><dd>{}</dd><dt>alert</dt><dd>{}</dd><dt>unavailable</dt><dd>{}</dd></dl>",
        list(exclusions),
        list(in_state("alert")),
        list(in_state("unavailable"))
    )
}

fn metres(value: Option<f64>) -> String {
    match value {
        Some(value) if value.abs() < 100.0 => format!("{value:.2}"),
        Some(value) => format!("{value:.0}"),
        None => "–".to_owned(),
    }
}

fn figure_table(figures: &Figures, has_errors: bool) -> String {
    let (h, v) = (&figures.horizontal, &figures.vertical);
    let mut html = String::from(
        "<table class=\"figures\"><thead><tr><th></th><th>horizontal</th><th>vertical</th><th></th>\
         </tr></thead><tbody>",
    );
    let mut row = |name: &str, get: &dyn Fn(&Axis) -> String, unit: &str| {
        let _ = write!(
            html,
            "<tr><th>{name}</th><td>{}</td><td>{}</td><td class=\"unit\">{unit}</td></tr>",
            get(h),
            get(v)
        );
    };
    if has_errors {
        row("error, 95 %", &|a| metres(a.error_95_m), "m");
        row("error, largest", &|a| metres(a.error_max_m), "m");
    }
    row(
        "protection level, median",
        &|a| metres(a.level_median_m),
        "m",
    );
    row("protection level, largest", &|a| metres(a.level_max_m), "m");
    row("alert limit", &|a| metres(a.limit_m), "m");
    if has_errors {
        row("error / level, largest", &|a| metres(a.ratio_max), "1");
        row("error above level", &|a| a.exceeded.to_string(), "epochs");
    }
    let usable = figures.states[0] + figures.states[1];
    let _ = write!(
        html,
        "<tr><th>positions</th><td colspan=\"2\">{} of {}</td><td class=\"unit\">epochs</td></tr>\
         <tr><th>available</th><td colspan=\"2\">{}</td><td class=\"unit\"></td></tr>",
        figures.positions,
        figures.epochs,
        percent(usable, figures.epochs)
    );
    html.push_str("</tbody></table>");
    if !has_errors {
        html.push_str("<p class=\"note\">No truth was given: errors are not known.</p>");
    }
    html
}

fn more(html: &mut String, total: usize) {
    if total > TABLE_ROWS {
        let _ = write!(
            html,
            "<p class=\"note\">{} more rows are in epochs.csv.</p>",
            total - TABLE_ROWS
        );
    }
}

fn stretch_table(figures: &Figures) -> String {
    let mut html = String::from(
        "<table><thead><tr><th>from</th><th>to</th><th>epochs</th><th>integrity</th><th>reason</th>\
         <th>excluded</th></tr></thead><tbody>",
    );
    for stretch in figures.stretches.iter().take(TABLE_ROWS) {
        let _ = write!(
            html,
            "<tr><td>{}</td><td>{}</td><td class=\"num\">{}</td>\
             <td><span class=\"tag {state}\">{state}</span></td><td>{}</td><td>{}</td></tr>",
            clock(stretch.from_s),
            clock(stretch.to_s),
            stretch.epochs,
            escape(&words(&stretch.reason)),
            escape(&stretch.excluded.join(" ")),
            state = escape(&stretch.integrity),
        );
    }
    html.push_str("</tbody></table>");
    more(&mut html, figures.stretches.len());
    html
}

fn exclusion_table(figures: &Figures) -> String {
    if figures.exclusions.is_empty() {
        return "<p class=\"note\">No satellite was excluded.</p>".to_owned();
    }
    let mut html = String::from(
        "<table><thead><tr><th>satellite</th><th>from</th><th>to</th><th>epochs</th></tr></thead><tbody>",
    );
    for (satellite, from_s, to_s, epochs) in figures.exclusions.iter().take(TABLE_ROWS) {
        let _ = write!(
            html,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td class=\"num\">{epochs}</td></tr>",
            escape(satellite),
            clock(*from_s),
            clock(*to_s)
        );
    }
    html.push_str("</tbody></table>");
    more(&mut html, figures.exclusions.len());
    html
}

/// `summary.json`, one row per value, its path as the name.
fn summary_table(summary: Option<&Value>) -> String {
    let Some(summary) = summary else {
        return "<p class=\"note\">There is no summary.json in this directory.</p>".to_owned();
    };
    let mut rows = Vec::new();
    flatten("", summary, &mut rows);
    let mut html = String::from("<table><tbody>");
    for (name, value) in rows.iter().take(TABLE_ROWS) {
        let _ = write!(
            html,
            "<tr><th>{}</th><td class=\"num\">{}</td></tr>",
            escape(name),
            escape(value)
        );
    }
    html.push_str("</tbody></table>");
    if rows.len() > TABLE_ROWS {
        let _ = write!(
            html,
            "<p class=\"note\">{} more values are in summary.json.</p>",
            rows.len() - TABLE_ROWS
        );
    }
    html
}

fn flatten(name: &str, value: &Value, rows: &mut Vec<(String, String)>) {
    let inner = |key: &str| {
        let key = words(key);
        if name.is_empty() {
            key
        } else {
            format!("{name} › {key}")
        }
    };
    match value {
        Value::Object(map) => {
            // Intervals have tables of their own.
            let shown = map
                .iter()
                .filter(|(key, _)| *key != "alert_intervals" && *key != "exclusions");
            for (key, value) in shown {
                flatten(&inner(key), value, rows);
            }
        }
        Value::Array(values) if values.iter().any(|v| v.is_object() || v.is_array()) => {
            for (k, value) in values.iter().enumerate() {
                flatten(&inner(&(k + 1).to_string()), value, rows);
            }
        }
        Value::Array(values) => {
            let texts: Vec<String> = values.iter().map(plain).collect();
            rows.push((name.to_owned(), texts.join(", ")));
        }
        other => rows.push((name.to_owned(), plain(other))),
    }
}

fn plain(value: &Value) -> String {
    match value {
        Value::Null => "–".to_owned(),
        Value::String(text) => text.clone(),
        Value::Number(number) => match number.as_f64() {
            Some(v) if v.fract() != 0.0 => {
                let rounded = format!("{v:.4}");
                if v.abs() < 1e-3 {
                    format!("{v:.3e}")
                } else {
                    rounded
                }
            }
            _ => number.to_string(),
        },
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gps_time_has_the_dates_of_the_calendar() {
        assert_eq!(gpst(0.0, 0.0), "1980-01-06 00:00:00");
        assert_eq!(gpst(2110.0, 432_000.0), "2020-06-19 00:00:00");
        assert_eq!(gpst(2251.0, 518_399.9), "2023-03-03 23:59:59");
        assert_eq!(gpst(1050.0, 345_600.0), "2000-02-24 00:00:00");
        assert_eq!(
            gpst(1050.0, 4.0 * 86_400.0 + 5.0 * 86_400.0),
            "2000-02-29 00:00:00"
        );
    }

    #[test]
    fn a_share_is_never_rounded_to_all_or_nothing() {
        assert_eq!(percent(86_399, 86_400), "> 99.99 %");
        assert_eq!(percent(1, 86_400), "< 0.01 %");
        assert_eq!(percent(86_400, 86_400), "100.00 %");
        assert_eq!(percent(0, 10), "0.00 %");
    }
}
