//! Tables of the campaign, in Markdown.

use std::fmt::Write as _;

use super::{FaultRecord, GRADES, Record, SWEPT, sizes};
use crate::campaign::binomial::clopper_pearson;
use crate::campaign::outcome::Outcome;
use crate::simulate::inertial::sensors::Grade;
use crate::simulate::inertial::unit_faults::{AXES, UnitFaultKind};

/// Confidence of every interval.
const CONFIDENCE: f64 = 0.95;
/// A fault is called detectable when it is isolated with this probability at least.
const DETECTABLE: f64 = 0.9;

/// The value below which a share of them lies.
fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let place = (share * values.len() as f64).ceil() as usize;
    values
        .get(place.saturating_sub(1))
        .copied()
        .unwrap_or(f64::NAN)
}

pub(super) fn report(outcome: &Outcome<Record>) -> String {
    let mut text = String::new();
    let faults: Vec<&FaultRecord> = outcome
        .of()
        .filter_map(|record| match record {
            Record::Fault(fault) => Some(fault),
            _ => None,
        })
        .collect();
    plain_faults(&mut text, &faults);
    navigation(&mut text, &faults);
    healthy(&mut text, outcome);
    smallest(&mut text, outcome);
    text
}

fn plain_faults(text: &mut String, faults: &[&FaultRecord]) {
    let _ = writeln!(
        text,
        "| grade | fault | trials | detected | isolated | another isolated | time to isolate, s: median | 95 % | longest | called |\n|---|---|---|---|---|---|---|---|---|---|"
    );
    for grade in GRADES {
        for kind in UnitFaultKind::ALL {
            let of = || {
                faults
                    .iter()
                    .filter(move |f| f.grade == grade.name() && f.kind == kind)
            };
            let count = of().count();
            if count == 0 {
                continue;
            }
            let detected = of().filter(|f| f.detected_s.is_some()).count();
            let wrong = of().filter(|f| f.wrong).count();
            let mut times: Vec<f64> = of().filter_map(|f| f.isolated_s).collect();
            let isolated = times.len();
            let mut causes: Vec<(String, usize)> = Vec::new();
            for fault in of().filter(|f| f.isolated_s.is_some()) {
                match causes.iter_mut().find(|(name, _)| *name == fault.cause) {
                    Some((_, count)) => *count += 1,
                    None => causes.push((fault.cause.clone(), 1)),
                }
            }
            causes.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
            let causes: Vec<String> = causes
                .into_iter()
                .map(|(name, count)| format!("{name} {count}"))
                .collect();
            let _ = writeln!(
                text,
                "| {} | {} | {count} | {detected} | {isolated} | {wrong} | {:.2} | {:.2} | {:.2} | {} |",
                grade.name(),
                kind.name(),
                quantile(&mut times, 0.5),
                quantile(&mut times, 0.95),
                quantile(&mut times, 1.0),
                causes.join(", ")
            );
        }
    }
    text.push('\n');
}

fn navigation(text: &mut String, faults: &[&FaultRecord]) {
    let _ = writeln!(
        text,
        "| grade | fault | largest position error in the minute after the onset, m, with satellites: voted without the fault | voted | the faulty unit alone | coasting: voted without the fault | voted | the faulty unit alone |\n|---|---|---|---|---|---|---|---|"
    );
    for grade in GRADES {
        for kind in UnitFaultKind::ALL {
            let of = || {
                faults
                    .iter()
                    .filter(move |f| f.grade == grade.name() && f.kind == kind)
            };
            if of().count() == 0 {
                continue;
            }
            let mut cells = Vec::new();
            for place in [0, 1] {
                for pick in [
                    |f: &FaultRecord| f.healthy_m,
                    |f: &FaultRecord| f.voted_m,
                    |f: &FaultRecord| f.alone_m,
                ] {
                    let mut values: Vec<f64> = of().map(|f| pick(f)[place]).collect();
                    let (median, worst) = (quantile(&mut values, 0.5), quantile(&mut values, 1.0));
                    cells.push(format!("{median:.2} (at most {worst:.2})"));
                }
            }
            let _ = writeln!(
                text,
                "| {} | {} | {} |",
                grade.name(),
                kind.name(),
                cells.join(" | ")
            );
        }
    }
    text.push('\n');
}

fn healthy(text: &mut String, outcome: &Outcome<Record>) {
    let _ = writeln!(
        text,
        "| grade | healthy flight, h | flights | false isolations | disagreements | false isolations per hour, at most, with 95 % |\n|---|---|---|---|---|---|"
    );
    for grade in GRADES {
        let (mut hours, mut flights, mut isolations, mut disagreements) = (0.0, 0, 0, 0);
        for record in outcome.of() {
            if let Record::Healthy {
                grade: name,
                duration_s,
                isolations: more,
                disagreed,
            } = record
                && name == grade.name()
            {
                hours += duration_s / 3600.0;
                flights += 1;
                isolations += more;
                disagreements += u32::from(*disagreed);
            }
        }
        if flights == 0 {
            continue;
        }
        // Exact for a Poisson variable of which none was seen; else told as seen.
        let bound = if isolations == 0 {
            format!("{:.2}", -f64::ln(1.0 - CONFIDENCE) / hours)
        } else {
            "seen".into()
        };
        let _ = writeln!(
            text,
            "| {} | {hours:.1} | {flights} | {isolations} | {disagreements} | {bound} |",
            grade.name()
        );
    }
    text.push('\n');
}

/// A size in words.
fn told(grade: Grade, kind: UnitFaultKind, axis: usize, size: f64) -> String {
    let (_, si, _) = sizes(grade, kind, axis);
    let magnitude = size * si;
    let per_h = magnitude.to_degrees() * 3600.0;
    let mg = magnitude / 9.806_65e-3;
    match (kind, axis < 3) {
        (UnitFaultKind::Step, true) => format!("{per_h:.3} °/h"),
        (UnitFaultKind::Step, false) => format!("{mg:.4} mg"),
        (UnitFaultKind::Drift, true) => format!("{:.4} °/h per s", per_h),
        (UnitFaultKind::Drift, false) => format!("{:.5} mg per s", mg),
        (UnitFaultKind::Scale, _) => format!("{:.0} ppm", magnitude * 1e6),
        (UnitFaultKind::Offset, _) => format!("{:.0} ms", magnitude * 1e3),
        _ => format!("× {size}"),
    }
}

fn smallest(text: &mut String, outcome: &Outcome<Record>) {
    let _ = writeln!(
        text,
        "| grade | fault | axis | within, s | smallest that is isolated with 90 % | isolated there (95 % interval) | median, s | another isolated, all sizes |\n|---|---|---|---|---|---|---|---|"
    );
    for grade in GRADES {
        for (kind, axis) in SWEPT {
            let (all, _, watch_s) = sizes(grade, kind, axis);
            let of = |wanted: f64| {
                outcome.of().filter_map(move |record| match record {
                    Record::Sweep {
                        grade: name,
                        kind: k,
                        axis: a,
                        size,
                        isolated_s,
                        wrong,
                    } if name == grade.name() && *k == kind && *a == axis && *size == wanted => {
                        Some((*isolated_s, *wrong))
                    }
                    _ => None,
                })
            };
            let wrong: usize = all
                .iter()
                .map(|size| of(*size).filter(|(_, wrong)| *wrong).count())
                .sum();
            let found = all.iter().find_map(|size| {
                let count = of(*size).count() as u64;
                let mut times: Vec<f64> = of(*size).filter_map(|(t_s, _)| t_s).collect();
                let seen = times.len() as u64;
                let [low, high] = clopper_pearson(seen, count, CONFIDENCE);
                (count > 0 && low >= DETECTABLE).then(|| {
                    format!(
                        "{} | {seen} of {count} ({:.0} to {:.0} %) | {:.1}",
                        told(grade, kind, axis, *size),
                        100.0 * low,
                        100.0 * high,
                        quantile(&mut times, 0.5)
                    )
                })
            });
            let most = all.last().copied().unwrap_or(f64::NAN);
            let none = || {
                let count = of(most).count();
                let seen = of(most).filter(|(t_s, _)| t_s.is_some()).count();
                format!(
                    "above {} | {seen} of {count} there | ",
                    told(grade, kind, axis, most)
                )
            };
            if of(most).count() == 0 {
                continue;
            }
            let _ = writeln!(
                text,
                "| {} | {} | {} | {watch_s:.0} | {} | {wrong} |",
                grade.name(),
                kind.name(),
                AXES[axis],
                found.unwrap_or_else(none)
            );
        }
    }
}
