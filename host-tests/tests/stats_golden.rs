//! Claim: tails and quantiles are right to 1e-9 relative down to tails of 1e-12.
//!
//! Against `../shared/golden` where it is present, and against `vectors/stats_mpmath.csv` always.

use serde_json::Value;
use surefix_core::stats::{chi2, normal};

fn golden(name: &str) -> Option<Value> {
    let path = format!("{}/../../shared/golden/{name}", env!("CARGO_MANIFEST_DIR"));
    match std::fs::read_to_string(&path) {
        Ok(text) => Some(serde_json::from_str(&text).unwrap()),
        Err(_) => {
            eprintln!("SKIPPED: {name}: ../shared is absent");
            None
        }
    }
}

fn number(value: &Value, key: &str) -> f64 {
    value[key]
        .as_f64()
        .unwrap_or_else(|| panic!("{key} in {value}"))
}

/// Relative difference; a value of zero is compared absolutely.
fn difference(value: f64, expected: f64) -> f64 {
    if expected == 0.0 {
        value.abs()
    } else {
        (value / expected - 1.0).abs()
    }
}

#[test]
fn normal_tails_and_quantiles_are_the_golden_ones() {
    let Some(file) = golden("gauss_tail.json") else {
        return;
    };
    let mut worst: f64 = 0.0;
    for row in file["qinv"].as_array().unwrap() {
        let k = normal::upper_quantile(number(row, "p")).unwrap();
        worst = worst.max(difference(k, number(row, "k")));
    }
    for row in file["q"].as_array().unwrap() {
        let q = normal::upper_tail(number(row, "k")).unwrap();
        worst = worst.max(difference(q, number(row, "q")));
    }
    println!("worst relative difference {worst:e}");
    assert!(worst < 1e-12);
}

#[test]
fn chi_square_thresholds_are_the_golden_ones() {
    let Some(file) = golden("chi2_thresholds.json") else {
        return;
    };
    let mut worst: f64 = 0.0;
    for row in file["values"].as_array().unwrap() {
        let dof = number(row, "dof") as u32;
        let threshold = chi2::upper_quantile(dof, number(row, "p_fa")).unwrap();
        worst = worst.max(difference(threshold, number(row, "threshold")));
    }
    println!("worst relative difference {worst:e}");
    assert!(worst < 1e-12);
}

#[test]
fn noncentralities_are_the_golden_ones() {
    let Some(file) = golden("slope_max_hpl.json") else {
        return;
    };
    let (p_fa, p_md) = (number(&file, "p_fa"), number(&file, "p_md"));
    let mut worst: f64 = 0.0;
    for row in file["lambda_table"].as_array().unwrap() {
        let dof = number(row, "dof") as u32;
        let threshold = chi2::upper_quantile(dof, p_fa).unwrap();
        let lambda = chi2::noncentrality(dof, threshold, p_md).unwrap();
        worst = worst.max(difference(lambda, number(row, "lam")));
    }
    println!("worst relative difference {worst:e}");
    assert!(worst < 1e-9);
}

#[test]
fn deep_tails_are_those_of_sixty_digit_arithmetic() {
    let text = include_str!("../vectors/stats_mpmath.csv");
    let mut compared = 0;
    let mut worst = std::collections::BTreeMap::<String, f64>::new();
    for line in text
        .lines()
        .filter(|line| !line.starts_with('#') && !line.starts_with("quantity"))
    {
        let fields: Vec<&str> = line.split(',').collect();
        let [quantity, k, lambda, argument, expected] = fields[..] else {
            panic!("five fields: {line}");
        };
        let k: u32 = k.parse().unwrap();
        let lambda: f64 = lambda.parse().unwrap();
        let argument: f64 = argument.parse().unwrap();
        let expected: f64 = expected.parse().unwrap();
        let value = match quantity.split(':').collect::<Vec<_>>()[..] {
            ["central_lower"] => chi2::lower_tail(k, argument),
            ["central_upper"] => chi2::upper_tail(k, argument),
            ["noncentral_lower"] => chi2::noncentral_lower_tail(k, lambda, argument),
            ["noncentral_upper"] => chi2::noncentral_upper_tail(k, lambda, argument),
            ["central_upper_quantile"] => chi2::upper_quantile(k, argument),
            ["noncentrality", p_md] => chi2::noncentrality(k, argument, p_md.parse().unwrap()),
            ["normal_quantile"] => normal::upper_quantile(argument),
            ["normal_tail"] => normal::upper_tail(argument),
            _ => panic!("unknown quantity: {line}"),
        };
        let value = value.unwrap_or_else(|error| panic!("{error:?} for {line}"));
        let off = difference(value, expected);
        assert!(off < 1e-9, "{line}: {value:e}, {off:e} off");
        let quantity = quantity.split(':').next().unwrap().to_owned();
        let entry = worst.entry(quantity).or_default();
        *entry = entry.max(off);
        compared += 1;
    }
    println!("{compared} values, worst relative differences {worst:?}");
    assert!(compared > 250);
}
