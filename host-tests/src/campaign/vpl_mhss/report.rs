//! Tables and pictures of `surefix campaign vpl-mhss`.

use std::fmt::Write as _;

use super::{LevelRow, SIGMA_M, SizePoint, SkyResult, VplResult};
use crate::campaign::binomial::percent;
use crate::campaign::figure::{self, Curve, Panel};

/// Sizes of error in the tables, m.
const SHOWN_M: [f64; 12] = [
    0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 15.0, 20.0, 25.0, 30.0, 40.0,
];

/// Mean of figure 7 of [P4] at a mask of 5°, m.
const FIGURE_7_MEAN_M: f64 = 18.87;

/// Tables in Markdown.
pub fn tables(result: &VplResult) -> String {
    let mut text = String::new();
    for sky in &result.skies {
        let _ = writeln!(
            text,
            "### {}, mask {:.0}°\n\n{}; {} to {} in view, {:.1} on average; sigma {SIGMA_M} m; {} trials, seed {}.\n",
            sky.sky,
            sky.mask_deg,
            sky.about,
            sky.satellites[0],
            sky.satellites[1],
            sky.mean_satellites,
            result.trials,
            result.seed,
        );
        sizes(sky, &mut text);
        healthy(sky, &mut text);
    }
    levels(&result.levels, &mut text);
    text
}

fn share(events: u64, of: u64) -> f64 {
    100.0 * events as f64 / of.max(1) as f64
}

fn sizes(sky: &SkyResult, text: &mut String) {
    *text += "| error, m | epochs | detected, % | right one out, % | healthy one out, % | as printed: right one out, % | healthy one out, % | VPL of all, mean (least, most), m | smallest without one, mean, m |\n|---|---|---|---|---|---|---|---|---|\n";
    for point in sky.sizes.iter().filter(|p| SHOWN_M.contains(&p.size_m)) {
        let percent = |events| share(events, point.epochs);
        let _ = writeln!(
            text,
            "| {:.0} | {} | {:.2} | {:.2} | {:.2} | {:.1} | {:.1} | {:.1} ({:.1}, {:.1}) | {:.1} |",
            point.size_m,
            point.epochs,
            percent(point.detected),
            percent(point.with_margin.right),
            percent(point.with_margin.wrong),
            percent(point.as_printed.right),
            percent(point.as_printed.wrong),
            point.full.mean_m(),
            point.full.least_m,
            point.full.most_m,
            point.smallest.mean_m(),
        );
    }
    text.push('\n');
}

fn healthy(sky: &SkyResult, text: &mut String) {
    *text += "| healthy epochs | alarms asked for | alarms, % (99 %) | satellite out, % (99 %) | as printed: satellite out |\n|---|---|---|---|---|\n";
    for row in &sky.healthy {
        let percent = |events| percent(events, row.epochs, 0.99);
        let _ = writeln!(
            text,
            "| {} | {:.1e} | {} | {} | {:.1} % |",
            row.epochs,
            row.p_false_alarm,
            percent(row.alarms),
            percent(row.with_margin),
            share(row.as_printed, row.epochs),
        );
    }
    text.push('\n');
}

fn levels(rows: &[LevelRow], text: &mut String) {
    let _ = writeln!(
        text,
        "### Levels without a fault\n\nBroadcast sky, six hours. Each row is scaled to the printed mean at 5°, {FIGURE_7_MEAN_M} m, which takes the sigma at the zenith that it tells.\n\n| VPL, m: least, mean, most | where | sigma | at the zenith, m | mask 5° | mask 10° |\n|---|---|---|---|---|---|\n| [P4] figure 7 | world | | | 11.6, 18.9, 32.7 | 11.4, 21.3, 36.3 |"
    );
    for row in rows {
        let scale = FIGURE_7_MEAN_M / row.levels[0].mean_m();
        let cells = row.levels.map(|levels| {
            [levels.least_m, levels.mean_m(), levels.most_m]
                .map(|level_m| format!("{:.1}", scale * level_m))
                .join(", ")
        });
        let _ = writeln!(
            text,
            "| {} | {} | {} | {scale:.2} | {} |",
            row.kind,
            row.place,
            row.law,
            cells.join(" | "),
        );
    }
    text.push('\n');
}

/// What is left out by size of the error, and the levels: figure 9.
pub fn figure(result: &VplResult) -> String {
    let mut panels = Vec::new();
    for sky in &result.skies {
        let curve = |name: &str, colour, dashed, value: &dyn Fn(&SizePoint) -> f64| Curve {
            name: name.to_owned(),
            points: sky.sizes.iter().map(|p| (p.size_m, value(p))).collect(),
            colour,
            dashed,
        };
        let of = |events, point: &SizePoint| share(events, point.epochs);
        let name = format!("{}, mask {:.0}°", sky.sky, sky.mask_deg);
        panels.push(Panel {
            title: format!("{name}: which satellite is left out"),
            x_label: "error of one satellite, m".into(),
            y_label: "epochs, %".into(),
            curves: vec![
                curve("right one, with margin", "#2980b9", false, &|p| {
                    of(p.with_margin.right, p)
                }),
                curve("healthy one, with margin", "#c0392b", false, &|p| {
                    of(p.with_margin.wrong, p)
                }),
                curve("right one, as printed", "#2980b9", true, &|p| {
                    of(p.as_printed.right, p)
                }),
                curve("healthy one, as printed", "#c0392b", true, &|p| {
                    of(p.as_printed.wrong, p)
                }),
            ],
            ..Panel::default()
        });
        panels.push(Panel {
            title: format!("{name}: vertical levels"),
            x_label: "error of one satellite, m".into(),
            y_label: "VPL, mean, m".into(),
            curves: vec![
                curve("all satellites", "#555", false, &|p| p.full.mean_m()),
                curve("smallest without one", "#27ae60", false, &|p| {
                    p.smallest.mean_m()
                }),
            ],
            ..Panel::default()
        });
    }
    figure::page(
        "VPL-based solution separation: one satellite with an error of 0 to 40 m",
        &panels,
        2,
    )
}
