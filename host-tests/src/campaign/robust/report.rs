//! Tables and pictures of `surefix campaign robust`.

use std::fmt::Write as _;

use super::{Accuracy, Counts, RobustResult, SubjectResult, VERTICAL_LIMIT_M, WINDOWS};
use crate::campaign::figure::{self, Curve, Panel};

/// The methods that the pictures show: least squares as printed, robust as printed and corrected.
const SHOWN: [(usize, &str, &str); 3] = [
    (0, "least squares, as printed", "#c0392b"),
    (2, "robust, as printed", "#2980b9"),
    (3, "robust, corrected", "#27ae60"),
];

/// Tables in Markdown.
pub fn tables(result: &RobustResult) -> String {
    let mut text = String::new();
    for subject in &result.subjects {
        let _ = writeln!(
            text,
            "### {}: {}\n\n{} epochs, {} to {} satellites; faults at epochs {} to {} and {} to {}, {} trials, seed {}.\n",
            subject.recording,
            subject.about,
            subject.epochs,
            subject.satellites[0],
            subject.satellites[1],
            subject.windows[0][0],
            subject.windows[0][1],
            subject.windows[1][0],
            subject.windows[1][1],
            result.trials,
            result.seed,
        );
        positions(subject, &mut text);
        levels(subject, &mut text);
        sweep(subject, &mut text);
    }
    text
}

fn numbers(accuracy: &Accuracy) -> String {
    let cells = |values: [f64; 3]| values.map(|v| format!("{v:.2}")).join(" | ");
    format!("{} | {}", cells(accuracy.p95_m), cells(accuracy.rms_m))
}

fn positions(subject: &SubjectResult, text: &mut String) {
    *text += "| position error, m | E 95 % | N 95 % | U 95 % | E RMS | N RMS | U RMS |\n|---|---|---|---|---|---|---|\n";
    // Levels do not change a position.
    for k in [0, 2, 3, 4] {
        let Some(method) = subject.methods.get(k) else {
            continue;
        };
        let name = method.method.trim_end_matches(", levels as printed");
        let _ = writeln!(text, "| {name} | {} |", numbers(&method.accuracy));
        let _ = writeln!(
            text,
            "| {name}, epochs with a fault | {} |",
            numbers(&method.accuracy_with_fault)
        );
    }
    text.push('\n');
}

fn levels(subject: &SubjectResult, text: &mut String) {
    let _ = writeln!(
        text,
        "| levels | epochs | no position | outlier kept | no level | VPL < {VERTICAL_LIMIT_M} m | VPL mean, max m | error above HPL | above VPL | healthy satellite out | faulted one in | mean iterations |\n|---|---|---|---|---|---|---|---|---|---|---|---|"
    );
    for method in &subject.methods {
        for (kind, counts) in [("no fault", &method.healthy), ("fault", &method.faulted)] {
            let _ = writeln!(text, "| {}, {kind} | {} |", method.method, cells(counts));
        }
    }
    text.push('\n');
}

fn cells(counts: &Counts) -> String {
    let bounded = counts.bounded.max(1) as f64;
    format!(
        "{} | {} | {} | {} | {} | {:.1}, {:.1} | {} | {} | {} | {} | {:.1}",
        counts.epochs,
        counts.epochs - counts.solved,
        counts.outlier_kept,
        counts.solved - counts.bounded,
        counts.vertical_within,
        counts.vpl_sum_m / bounded,
        counts.vpl_max_m,
        counts.above_hpl,
        counts.above_vpl,
        counts.healthy_out,
        counts.faulted_in,
        counts.iterations as f64 / counts.solved.max(1) as f64,
    )
}

fn sweep(subject: &SubjectResult, text: &mut String) {
    let _ = writeln!(
        text,
        "One fault at epoch {}, on {} (VPL and up error, m), and on each of the {} satellites in turn (how often an error is above its level):\n\n| fault, m | least squares VPL | up error | robust as printed VPL | up error | robust corrected VPL | up error | above, least squares | above, robust printed | above, robust corrected |\n|---|---|---|---|---|---|---|---|---|---|",
        subject.windows[0][0],
        subject.sweep_satellite,
        subject.sweep.first().map_or(0, |point| point.satellites),
    );
    let number = |value: Option<f64>| value.map_or_else(|| "none".into(), |v| format!("{v:.1}"));
    for point in &subject.sweep {
        let _ = write!(text, "| {:.0} |", point.size_m);
        for (k, _, _) in SHOWN {
            let level = point.vpl_m.get(k).copied().flatten();
            let error = point.up_error_m.get(k).copied().flatten();
            let _ = write!(text, " {} | {} |", number(level), number(error));
        }
        for (k, _, _) in SHOWN {
            let _ = write!(
                text,
                " {} |",
                point.above_level.get(k).copied().unwrap_or(0)
            );
        }
        text.push('\n');
    }
    text.push('\n');
}

/// Vertical levels of the first trial along the recording, and of the growing fault.
pub fn figure(result: &RobustResult) -> String {
    let mut panels = Vec::new();
    for subject in &result.subjects {
        let last = subject.epochs as f64;
        let mut curves: Vec<Curve> = SHOWN
            .iter()
            .map(|(k, name, colour)| Curve {
                name: (*name).to_owned(),
                points: subject
                    .series
                    .iter()
                    .map(|point| {
                        let level = point.vpl_m.get(*k).copied().flatten();
                        (point.epoch as f64, level.unwrap_or(f64::NAN))
                    })
                    .collect(),
                colour,
                dashed: false,
            })
            .collect();
        curves.push(limit([0.0, last]));
        panels.push(Panel {
            title: format!("{}: two satellites faulted, first trial", subject.recording),
            x_label: "epoch".into(),
            y_label: "VPL, m".into(),
            curves,
            ..Panel::default()
        });
        let mut curves: Vec<Curve> = SHOWN
            .iter()
            .map(|(k, name, colour)| Curve {
                name: (*name).to_owned(),
                points: subject
                    .sweep
                    .iter()
                    .map(|point| {
                        let level = point.vpl_m.get(*k).copied().flatten();
                        (point.size_m, level.unwrap_or(f64::NAN))
                    })
                    .collect(),
                colour,
                dashed: false,
            })
            .collect();
        curves.push(limit([0.0, super::SIZES_M[1]]));
        panels.push(Panel {
            title: format!(
                "{}: a fault on {} at epoch {}",
                subject.recording, subject.sweep_satellite, subject.windows[0][0]
            ),
            x_label: "size of the fault, m".into(),
            y_label: "VPL, m".into(),
            curves,
            ..Panel::default()
        });
    }
    let [[a, b], [c, d]] = WINDOWS;
    let title = format!(
        "Vertical levels by residuals, before and after robust estimation (faults at epochs {a} to {b} and {c} to {d} of 2880, scaled)"
    );
    figure::page(&title, &panels, 2)
}

fn limit(from_to: [f64; 2]) -> Curve {
    Curve {
        name: format!("alert limit of LPV-200, {VERTICAL_LIMIT_M} m"),
        points: from_to.map(|x| (x, VERTICAL_LIMIT_M)).to_vec(),
        colour: "#555",
        dashed: true,
    }
}
