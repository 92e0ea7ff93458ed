//! Tables and pictures of `surefix campaign consensus`.

use std::fmt::Write as _;

use super::{
    Compared, Comparison, ConsensusResult, Counts, METHODS, P_FALSE_ALARM, P_MEASURED, SizePoint,
    Tally,
};
use crate::campaign::binomial;
use crate::campaign::figure::{self, Curve, Panel};

const COLOURS: [&str; 3] = ["#c0392b", "#2980b9", "#27ae60"];
const CONFIDENCE: f64 = 0.99;

/// Tables in Markdown.
pub fn tables(result: &ConsensusResult) -> String {
    let mut text = String::new();
    for comparison in &result.comparisons {
        compared(comparison, &mut text);
    }
    false_alarms(result, &mut text);
    for (p_false_alarm, points) in &result.sweeps {
        let _ = writeln!(
            text,
            "One bias on each satellite in turn, six hours of GPS, {} to {} satellites, P_FA {p_false_alarm:.2e}; detected / rightly excluded / a healthy one out, %:\n",
            result.satellites[0], result.satellites[1]
        );
        sizes(points, three, &mut text);
    }
    for (count, points) in &result.several {
        let _ = writeln!(
            text,
            "{count} biases of one size and either sign, six hours of GPS, P_FA {:.2e}; detected / rightly excluded / some of them excluded / a healthy one out, %:\n",
            P_FALSE_ALARM[0]
        );
        sizes(points, four, &mut text);
    }
    for counts in &result.counts {
        suspicions(counts, &mut text);
    }
    text
}

fn share(part: u64, of: u64) -> f64 {
    100.0 * part as f64 / of.max(1) as f64
}

fn compared(comparison: &Comparison, text: &mut String) {
    let _ = writeln!(
        text,
        "Random skies of {} to {} satellites of {} constellation(s), P_FA {:.2e}. FOIM has the verdict of S-RANCO, % (99 % interval); detected / rightly excluded / a healthy one out, %:\n\n| faults | skies | same verdict | RANCO | S-RANCO | FOIM |\n|---|---|---|---|---|---|",
        comparison.by_satellites.first().map_or(0, |(n, _)| *n),
        comparison.by_satellites.last().map_or(0, |(n, _)| *n),
        comparison.constellations,
        P_FALSE_ALARM[0]
    );
    let row = |name: &str, compared: &Compared, text: &mut String| {
        let cells: Vec<String> = compared.tallies.iter().map(three).collect();
        let _ = writeln!(
            text,
            "| {name} | {} | {} | {} |",
            compared.skies,
            binomial::percent(compared.same, compared.skies, CONFIDENCE),
            cells.join(" | ")
        );
    };
    for (faults, compared) in comparison.by_faults.iter().enumerate() {
        row(&faults.to_string(), compared, text);
    }
    row("all", &comparison.total(), text);
    let _ = writeln!(
        text,
        "\n| satellites | skies | same verdict | subsets dropped by FOIM |\n|---|---|---|---|"
    );
    for (n, compared) in &comparison.by_satellites {
        let _ = writeln!(
            text,
            "| {n} | {} | {:.1} | {:.0} % |",
            compared.skies,
            share(compared.same, compared.skies),
            share(compared.dropped, compared.subsets)
        );
    }
    text.push('\n');
}

fn three(tally: &Tally) -> String {
    format!(
        "{:.1} / {:.1} / {:.2}",
        share(tally.detected, tally.epochs),
        share(tally.right, tally.epochs),
        share(tally.wrong, tally.epochs)
    )
}

fn false_alarms(result: &ConsensusResult, text: &mut String) {
    let _ = writeln!(
        text,
        "Healthy skies, P_FA {P_MEASURED} per epoch, half of it ({}) for the suspicions: epochs with a suspicion, % (99 % interval):\n\n| satellites | skies | RANCO | S-RANCO | FOIM | detected by FOIM, parity test included |\n|---|---|---|---|---|---|",
        0.5 * P_MEASURED
    );
    for counted in &result.false_alarms {
        let cells: Vec<String> = counted
            .suspected
            .iter()
            .map(|suspected| binomial::percent(*suspected, counted.skies, CONFIDENCE))
            .collect();
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} |",
            counted.satellites,
            counted.skies,
            cells.join(" | "),
            binomial::percent(counted.detected[2], counted.skies, CONFIDENCE)
        );
    }
    text.push('\n');
}

fn four(tally: &Tally) -> String {
    format!(
        "{:.1} / {:.1} / {:.1} / {:.2}",
        share(tally.detected, tally.epochs),
        share(tally.right, tally.epochs),
        share(tally.partly, tally.epochs),
        share(tally.wrong, tally.epochs)
    )
}

/// A row for each size of a bias, a cell for each algorithm.
fn sizes(points: &[SizePoint], cell: fn(&Tally) -> String, text: &mut String) {
    let names = METHODS.map(|(name, _)| name).join(" | ");
    let _ = writeln!(text, "| bias, m | cases | {names} |\n|---|---|---|---|---|");
    for point in points {
        let cells: Vec<String> = point.tallies.iter().map(cell).collect();
        let _ = writeln!(
            text,
            "| {:.0} | {} | {} |",
            point.size_m,
            point.tallies[0].epochs,
            cells.join(" | ")
        );
    }
    text.push('\n');
}

fn suspicions(counts: &Counts, text: &mut String) {
    let _ = writeln!(
        text,
        "Counts at {:.0} s, T_SV {:.0} % of the predictions; FOIM excludes {}:\n\n| satellite | bias, m | S-RANCO | of T_SV | FOIM | of T_SV |\n|---|---|---|---|---|---|",
        counts.t_s,
        100.0 * counts.threshold,
        if counts.excluded.is_empty() {
            "nothing".into()
        } else {
            counts.excluded.join(", ")
        }
    );
    let both = counts.s_ranco.iter().zip(&counts.foim);
    for ((name, bias_m), (s_ranco, foim)) in counts.satellites.iter().zip(both) {
        let cell = |(outliers, predictions): &(u32, u32)| {
            let limit = counts.threshold * f64::from(*predictions);
            format!("{outliers} of {predictions} | {limit:.1}")
        };
        let _ = writeln!(
            text,
            "| {name} | {bias_m:.0} | {} | {} |",
            cell(s_ranco),
            cell(foim)
        );
    }
    text.push('\n');
}

fn curve(name: String, points: Vec<(f64, f64)>, colour: &'static str, dashed: bool) -> Curve {
    Curve {
        name,
        points,
        colour,
        dashed,
    }
}

/// Detection and exclusion by size, counts, and the share of equal verdicts.
pub fn figure(result: &ConsensusResult) -> String {
    let mut panels = Vec::new();
    let rates = |title: String, points: &[SizePoint]| {
        let mut curves = Vec::new();
        for (k, (name, _)) in METHODS.iter().enumerate() {
            let of = |part: fn(&Tally) -> u64| {
                let point = |point: &SizePoint| {
                    let tally = &point.tallies[k];
                    (point.size_m, share(part(tally), tally.epochs))
                };
                points.iter().map(point).collect()
            };
            let colour = COLOURS[k];
            curves.push(curve(
                format!("{name}, detected"),
                of(|tally| tally.detected),
                colour,
                true,
            ));
            curves.push(curve(
                format!("{name}, rightly excluded"),
                of(|tally| tally.right),
                colour,
                false,
            ));
        }
        Panel {
            title,
            x_label: "bias, m".into(),
            y_label: "epochs, %".into(),
            curves,
            ..Panel::default()
        }
    };
    for (p_false_alarm, points) in &result.sweeps {
        panels.push(rates(format!("one bias, P_FA {p_false_alarm:.2e}"), points));
    }
    for (count, points) in &result.several {
        panels.push(rates(format!("{count} biases"), points));
    }
    for counts in &result.counts {
        let share_of = |counted: &[(u32, u32)]| {
            let share = |(k, (outliers, predictions)): (usize, &(u32, u32))| {
                let of = f64::from((*predictions).max(1));
                (k as f64 + 1.0, 100.0 * f64::from(*outliers) / of)
            };
            counted.iter().enumerate().map(share).collect::<Vec<_>>()
        };
        let last = counts.satellites.len() as f64;
        let limit = 100.0 * counts.threshold;
        let biased: Vec<&str> = counts
            .satellites
            .iter()
            .filter(|(_, bias_m)| *bias_m != 0.0)
            .map(|(name, _)| name.as_str())
            .collect();
        panels.push(Panel {
            title: format!("suspicions with a bias on {}", biased.join(", ")),
            x_label: "satellite, in order of name".into(),
            y_label: "outliers among predictions, %".into(),
            curves: vec![
                curve(
                    "S-RANCO".into(),
                    share_of(&counts.s_ranco),
                    COLOURS[1],
                    true,
                ),
                curve("FOIM".into(), share_of(&counts.foim), COLOURS[2], false),
                curve(
                    "T_SV".into(),
                    vec![(1.0, limit), (last, limit)],
                    "#888888",
                    true,
                ),
            ],
            ..Panel::default()
        });
    }
    let by_satellites = |comparison: &Comparison| {
        let point =
            |(n, compared): &(usize, Compared)| (*n as f64, share(compared.same, compared.skies));
        comparison.by_satellites.iter().map(point).collect()
    };
    panels.push(Panel {
        title: "FOIM has the verdict of S-RANCO".into(),
        x_label: "satellites".into(),
        y_label: "random skies, %".into(),
        curves: result
            .comparisons
            .iter()
            .zip(COLOURS)
            .map(|(comparison, colour)| {
                let name = format!("{} constellation(s)", comparison.constellations);
                curve(name, by_satellites(comparison), colour, false)
            })
            .collect(),
        ..Panel::default()
    });
    figure::page("RANCO, S-RANCO and FOIM", &panels, 2)
}
