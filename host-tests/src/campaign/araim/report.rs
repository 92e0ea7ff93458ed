//! Tables of `surefix campaign araim`.

use std::fmt::Write as _;

use super::{
    ACCURACY_LIMIT_M, ALERT_LIMITS_M, AraimResult, CONSTELLATION_M, Counts, EMT_LIMIT_M,
    SetupResult,
};
use crate::campaign::binomial;

/// Tables in Markdown.
pub fn tables(result: &AraimResult) -> String {
    let [vertical_m, horizontal_m] = ALERT_LIMITS_M;
    let mut text = format!(
        "Seed {}, mask {:.0}°. LPV-200: VPL ≤ {vertical_m} m, HPL ≤ {horizontal_m} m, EMT ≤ {EMT_LIMIT_M} m, vertical σ for accuracy ≤ {ACCURACY_LIMIT_M} m.\n\n\
         | recording, satellites | setup | epochs | not tested | alerts | exclusions | LPV-200 available | VPL mean, largest, m | HPL | EMT | σ_acc | error above a level | largest error/level | largest separation/threshold |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
        result.seed, result.mask_deg,
    );
    for of in &result.results {
        let counts = &of.healthy;
        let means = [
            counts.vpl_m,
            counts.hpl_m,
            counts.emt_m,
            counts.sigma_accuracy_m,
        ]
        .map(|[sum, largest]| mean_largest(sum, largest, counts.bounded));
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {:.2} | {:.2} |",
            name(of),
            of.setup,
            counts.epochs,
            counts.not_tested,
            counts.alerts,
            exclusions(counts),
            binomial::percent(counts.available, counts.epochs, 0.99),
            means.join(" | "),
            counts.above_level,
            counts.largest_ratio,
            counts.largest_test_ratio,
        );
    }
    for of in &result.results {
        if !of.seen_without_fault.is_empty() {
            let _ = writeln!(
                text,
                "\n{}, {}: epochs with a separation above its threshold, the satellites taken out: {}.",
                name(of),
                of.setup,
                of.seen_without_fault.join("; ")
            );
        }
    }
    let _ = writeln!(
        text,
        "\nOne satellite wrong by so much, either sign, or all of the second constellation, each in its own way ({CONSTELLATION_M:.0} m, one sigma):\n\n\
         | recording, satellites | setup | fault | epochs | excluded | with healthy ones | in part | wrong one | alert | passed | error above a level | with levels |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|"
    );
    for of in &result.results {
        for fault in &of.faulted {
            let counts = &fault.counts;
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
                name(of),
                of.setup,
                fault.fault,
                counts.epochs,
                counts.excluded,
                counts.excluded_more,
                counts.excluded_part,
                counts.excluded_wrong,
                counts.alerts,
                counts.passed,
                counts.above_level,
                counts.bounded,
            );
        }
    }
    text
}

fn name(of: &SetupResult) -> String {
    let [least, most] = of.satellites;
    format!("{} {}, {least} to {most}", of.recording, of.systems)
}

fn exclusions(counts: &Counts) -> u64 {
    counts.excluded + counts.excluded_more + counts.excluded_part + counts.excluded_wrong
}

fn mean_largest(sum: f64, largest: f64, of: u64) -> String {
    format!("{:.1}, {largest:.1}", sum / of.max(1) as f64)
}
