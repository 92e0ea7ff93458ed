//! The picture of `surefix compare`: rates by size of the fault; vertical levels and errors along the recording.

use super::counts::{Said, Summary, horizontal_vertical};
use super::registry::Tests;
use super::report::share;
use super::{Comparison, Plan};
use crate::campaign::figure::{self, Curve, Panel};

/// Colours of the curves, by the number of the monitor.
const COLOURS: [&str; 12] = [
    "#2980b9", "#c0392b", "#27ae60", "#8e44ad", "#e67e22", "#16a085", "#7f8c8d", "#d35400",
    "#2c3e50", "#f39c12", "#e84393", "#6c5ce7",
];
/// Most points of a curve over time; more epochs share a point, which shows the largest of their values.
const MAX_POINTS: usize = 240;

/// Which trials of a size are counted, of how many.
type Events = fn(&Summary) -> [u64; 2];

/// Shares by size, and vertical levels and errors along the recording.
pub fn picture(comparison: &Comparison) -> String {
    let mut panels = Vec::new();
    if let Some(plan) = &comparison.sweep {
        let shares: [(&str, Events); 4] = [
            ("fault detected", |s| [s.detected, s.in_use]),
            ("exactly the faulted satellites excluded", |s| {
                [s.excluded_rightly, s.in_use]
            }),
            ("something healthy excluded", |s| {
                [s.excluded_wrongly, s.epochs]
            }),
            ("served with an error above a level", |s| {
                [s.above_level, s.epochs]
            }),
        ];
        for (title, events) in shares {
            panels.push(Panel {
                title: title.into(),
                x_label: "size of the fault, m".into(),
                y_label: "of all trials, %".into(),
                curves: by_size(comparison, plan, events),
                ..Panel::default()
            });
        }
    }
    panels.push(Panel {
        title: "vertical level along the recording".into(),
        x_label: "time, s".into(),
        y_label: "VPL, m".into(),
        curves: along(comparison, |said| said.levels.ok().map(|l| l.vpl_m)),
        decades: [false, true],
        ..Panel::default()
    });
    panels.push(Panel {
        title: "vertical error of positions served".into(),
        x_label: "time, s".into(),
        y_label: "error, m".into(),
        curves: along(comparison, |said| {
            let error = said.error_enu_m.filter(|_| said.is_served())?;
            Some(horizontal_vertical(error)[1])
        }),
        ..Panel::default()
    });
    panels.push(Panel {
        title: "monitors".into(),
        curves: comparison
            .monitors
            .iter()
            .enumerate()
            .filter(|(_, monitor)| monitor.tests == Tests::Pseudoranges)
            .map(|(number, monitor)| Curve {
                name: monitor.title.to_owned(),
                ..curve(number, Vec::new())
            })
            .collect(),
        ..Panel::default()
    });
    let faults = match &comparison.sweep {
        Some(plan) if plan.faults > 1 => format!(", {} faults at a time", plan.faults),
        _ => String::new(),
    };
    let title = format!(
        "Monitors side by side on {}, {} epochs{faults}",
        comparison.recording, comparison.epochs
    );
    figure::page(&title, &panels, 2)
}

/// The curve of the monitor of a number, named in the legend alone.
fn curve(number: usize, points: Vec<(f64, f64)>) -> Curve {
    Curve {
        name: String::new(),
        points,
        colour: COLOURS[number % COLOURS.len()],
        dashed: !number.is_multiple_of(2),
    }
}

fn by_size(comparison: &Comparison, plan: &Plan, events: Events) -> Vec<Curve> {
    let monitors = comparison.monitors.iter().enumerate();
    monitors
        .filter_map(|(number, monitor)| {
            let shares = monitor.sweep.as_ref()?.iter().map(|s| {
                let [events, of] = events(s);
                share(events, of)
            });
            let points = plan.sizes_m.iter().copied().zip(shares).collect();
            Some(curve(number, points))
        })
        .collect()
}

/// A value along the recording; curves without any are left out.
fn along(comparison: &Comparison, value: impl Fn(&Said) -> Option<f64>) -> Vec<Curve> {
    let together = comparison.t_s.len().div_ceil(MAX_POINTS).max(1);
    let monitors = comparison.monitors.iter().enumerate();
    monitors
        .filter(|(_, monitor)| monitor.tests == Tests::Pseudoranges)
        .filter_map(|(number, _)| {
            let epochs = comparison.t_s.chunks(together);
            let points: Vec<(f64, f64)> = epochs
                .zip(comparison.series.said.chunks(together))
                .map(|(t_s, said)| {
                    let values = said.iter().filter_map(|said| value(said.get(number)?));
                    let largest = values.fold(f64::NAN, f64::max);
                    (t_s.first().copied().unwrap_or(f64::NAN), largest)
                })
                .collect();
            let any = points.iter().any(|(_, y)| y.is_finite());
            any.then(|| curve(number, points))
        })
        .collect()
}
