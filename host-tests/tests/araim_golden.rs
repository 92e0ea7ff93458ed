//! Claims: every golden ARAIM case comes out as computed elsewhere: levels to 1 mm, spreads and thresholds
//! to 1e-6 m, the same modes and unmonitored probability; the tests of its measurements too; the published
//! worked example to its printed digits; the error model that made the cases.

mod common;

use std::collections::BTreeMap;

use serde_json::Value;
use surefix_core::raim::araim::support::{
    FaultRate, IntegritySupport, galileo_user_sigma_m, gps_user_sigma_m,
};
use surefix_core::raim::araim::{Araim, AraimConstellation, AraimParameters, AraimSatellite};
use surefix_host_tests::araim::evaluate_text;

fn golden() -> Option<String> {
    common::shared("golden/araim_cases.json").map(|path| std::fs::read_to_string(path).unwrap())
}

fn cases(text: &str) -> Vec<Value> {
    let document: Value = serde_json::from_str(text).unwrap();
    document["cases"].as_array().unwrap().clone()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(number).collect()
}

fn distance(a: &Value, b: &Value) -> f64 {
    let (a, b) = (numbers(a), numbers(b));
    assert_eq!(a.len(), b.len());
    let differences = a.iter().zip(&b).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, f64::max)
}

/// Largest difference per group of cases and quantity.
#[derive(Default)]
struct Worst(BTreeMap<(String, String), f64>);

impl Worst {
    fn see(&mut self, group: &str, name: &str, difference: f64, limit: f64, case: &str) {
        assert!(
            difference <= limit,
            "{case}: {name} differs by {difference:e}"
        );
        let entry = self
            .0
            .entry((group.to_owned(), name.to_owned()))
            .or_default();
        *entry = entry.max(difference);
    }
}

impl Drop for Worst {
    fn drop(&mut self) {
        for ((group, name), difference) in &self.0 {
            println!("{group:16} {name:20} {difference:.1e}");
        }
    }
}

#[test]
fn every_golden_case_is_reproduced() {
    let Some(text) = golden() else { return };
    let outcomes = serde_json::to_value(evaluate_text(&text).unwrap()).unwrap();
    let cases = cases(&text);
    assert_eq!(outcomes.as_array().unwrap().len(), cases.len());
    let mut worst = Worst::default();
    for (case, outcome) in cases.iter().zip(outcomes.as_array().unwrap()) {
        let id = case["id"].as_str().unwrap();
        assert_eq!(outcome["id"], id);
        assert_eq!(outcome["error"], Value::Null, "{id}");
        let group = id.split_once("__").map_or(id, |(_, profile)| profile);
        let (expected, result) = (&case["expected"], &outcome["result"]);
        for name in [
            "vpl",
            "hpl",
            "pl_e",
            "pl_n",
            "emt",
            "emt_prior_tolerant",
            "sig_acc_v",
        ] {
            let difference = (number(&expected[name]) - number(&result[name])).abs();
            worst.see(group, name, difference, 1e-3, id);
        }
        let difference = distance(&expected["sigma_acc_enu"], &result["sigma_acc_enu"]);
        worst.see(group, "sigma_acc_enu", difference, 1e-3, id);
        for name in ["k_fa_h", "k_fa_v"] {
            let difference = (number(&expected[name]) - number(&result[name])).abs();
            worst.see(group, name, difference, 1e-12, id);
        }
        // The difference of 1 and a sum: rounding of 1e-16 is 1e-8 of it.
        let p = number(&result["p_not_monitored"]);
        let difference = (p / number(&expected["p_not_monitored"]) - 1.0).abs();
        worst.see(group, "p_not_monitored", difference, 1e-8, id);
        for name in ["n_subsets", "n_monitorable"] {
            assert_eq!(expected[name], result[name], "{id}");
        }
        let subsets = expected["subsets"].as_array().unwrap();
        assert_eq!(subsets.len(), result["subsets"].as_array().unwrap().len());
        for (expected, result) in subsets.iter().zip(result["subsets"].as_array().unwrap()) {
            assert_eq!(expected["excluded"], result["excluded"], "{id}");
            for name in ["sigma", "sigma_ss", "bias", "bias_ss", "threshold"] {
                let difference = distance(&expected[name], &result[name]);
                worst.see(group, name, difference, 1e-6, id);
            }
            for name in ["p_fault_inst", "p_fault_exp"] {
                let ratio = number(&expected[name]) / number(&result[name]);
                worst.see(group, name, (ratio - 1.0).abs(), 1e-12, id);
            }
        }
    }
}

#[test]
fn measurements_are_tested_as_elsewhere_and_their_fault_is_excluded() {
    let Some(text) = golden() else { return };
    let outcomes = serde_json::to_value(evaluate_text(&text).unwrap()).unwrap();
    let mut worst = Worst::default();
    let mut excluded = 0;
    for (case, outcome) in cases(&text).iter().zip(outcomes.as_array().unwrap()) {
        let id = case["id"].as_str().unwrap();
        let Some(tests) = case["measurement_tests"].as_array() else {
            continue;
        };
        for (expected, result) in tests
            .iter()
            .zip(outcome["measurement_tests"].as_array().unwrap())
        {
            worst.see(
                "tests",
                "x0",
                distance(&expected["x0"], &result["x0"]),
                1e-9,
                id,
            );
            let separations = expected["separation"].as_array().unwrap();
            for (expected, result) in separations
                .iter()
                .zip(result["separation"].as_array().unwrap())
            {
                worst.see("tests", "separation", distance(expected, result), 1e-9, id);
            }
            for name in [
                "max_test_ratio",
                "wsse_int",
                "wsse_acc_weighted",
                "chi2_threshold_1e_8",
            ] {
                let expected = number(&expected[name]);
                let difference = (number(&result[name]) - expected).abs() / expected;
                worst.see("tests", name, difference, 1e-9, id);
            }
            for name in ["argmax_subset", "detected", "dof"] {
                assert_eq!(expected[name], result[name], "{id}");
            }
            if expected["kind"] == "fault" {
                let found = result["exclusion"]["excluded"].as_array().unwrap();
                assert_eq!(found, &[expected["fault_sat"].clone()], "{id}");
                // Fewer satellites and a share of the risk cost level.
                let (before, after) = (&case["expected"]["vpl"], &result["exclusion"]["vpl"]);
                assert!(number(after) > number(before), "{id}");
                excluded += 1;
            } else {
                assert_eq!(result["exclusion"], Value::Null, "{id}");
            }
        }
    }
    assert_eq!(excluded, 14);
}

fn example(case: &Value) -> (Vec<AraimSatellite>, Vec<AraimConstellation>) {
    let systems = case["systems"].as_array().unwrap();
    let n = case["sats"].as_array().unwrap().len();
    let satellite = |i: usize| AraimSatellite {
        design_enu: numbers(&case["G"][i])[..3].try_into().unwrap(),
        constellation: systems
            .iter()
            .position(|s| *s == case["sats"][i]["sys"])
            .unwrap(),
        variance_integrity_m2: number(&case["var_int"][i]),
        variance_accuracy_m2: number(&case["var_acc"][i]),
        bias_integrity_m: number(&case["bnom_int"][i]),
        bias_accuracy_m: number(&case["bnom_acc"][i]),
        p_fault: number(&case["p_sat"][i]),
        exposure: 0.0,
    };
    let constellation = |i: usize| AraimConstellation {
        p_fault: number(&case["p_const"][i]),
        exposure: 0.0,
    };
    (
        (0..n).map(satellite).collect(),
        (0..systems.len()).map(constellation).collect(),
    )
}

/// Q and its inverse by other means than core's.
fn upper_tail(x: f64) -> f64 {
    0.5 * libm::erfc(x / std::f64::consts::SQRT_2)
}

fn upper_quantile(p: f64) -> f64 {
    let (mut low, mut high) = (-10.0, 40.0);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if upper_tail(middle) > p {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// The half-interval search of the publication, which ends when its bracket is 5 cm wide and reports the
/// upper end.
fn published_search(araim: &Araim, axis: usize, target: f64) -> f64 {
    let terms: Vec<(f64, f64, f64)> = araim
        .subsets()
        .iter()
        .enumerate()
        .map(|(k, subset)| {
            (
                if k == 0 { 2.0 } else { subset.p_instant },
                subset.threshold_m[axis] + subset.bias_m[axis],
                subset.sigma_m[axis],
            )
        })
        .collect();
    let reach = |share: f64| {
        let levels = terms
            .iter()
            .map(|(p, offset, sigma)| offset + sigma * upper_quantile((share / p).min(1.0)));
        levels.fold(f64::MIN, f64::max)
    };
    let (mut low, mut high) = (reach(target), reach(target / terms.len() as f64));
    while high - low > 5e-2 {
        let middle = 0.5 * (low + high);
        let risk: f64 = terms
            .iter()
            .map(|(p, offset, sigma)| p * upper_tail((middle - offset) / sigma))
            .sum();
        if risk > target {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// The publication lists single faults, which leave less than P_THRES, and counts nothing to a constellation.
#[test]
fn the_published_example_comes_out_to_its_printed_digits() {
    let Some(text) = golden() else { return };
    let case = &cases(&text)[0];
    let published = &case["published"]["add_v3"];
    let (satellites, constellations) = example(case);
    let parameters = AraimParameters {
        simultaneous_at_least: 1,
        ..AraimParameters::LPV_200
    };
    let mut araim = Box::new(Araim::EMPTY);
    let levels = araim
        .evaluate(&satellites, &constellations, &parameters)
        .unwrap();
    assert_eq!(levels.modes_monitored, 13);
    let printed = |x: f64, digits: usize| format!("{x:.digits$}");
    let share = 1.0 - levels.p_not_monitored / 1e-7;
    let search = |axis, phmi: f64| published_search(&araim, axis, phmi * share);
    let vpl = search(2, 9.8e-8);
    let hpl = search(0, 1e-9).hypot(search(1, 1e-9));
    println!("exact {levels:?}; searched as published: VPL {vpl}, HPL {hpl}");
    assert_eq!(printed(vpl, 1), printed(number(&published["VPL"]), 1));
    assert_eq!(
        printed(levels.vpl_m, 1),
        printed(number(&published["VPL"]), 1)
    );
    assert_eq!(printed(hpl, 1), printed(number(&published["HPL"]), 1));
    assert_eq!(
        printed(levels.emt_m, 1),
        printed(number(&published["EMT"]), 1)
    );
    let sigma = levels.sigma_accuracy_enu_m[2];
    assert_eq!(
        printed(sigma, 2),
        printed(number(&published["sigma_acc_v"]), 2)
    );
    assert_eq!(
        printed(levels.k_false_alert_vertical, 4),
        printed(number(&published["k_fa_3"]), 4)
    );
    // The exact roots lie within the bracket.
    assert!(levels.vpl_m <= vpl && vpl - levels.vpl_m < 0.05);
    assert!(levels.hpl_m <= hpl && hpl - levels.hpl_m < 0.08);
    // As printed, within the half digit of their four or five.
    for (name, got) in [
        (
            "sigma3_const_excl",
            [11, 12].map(|k: usize| araim.subsets()[k].sigma_m[2]),
        ),
        (
            "sigma_ss3",
            [11, 12].map(|k| araim.subsets()[k].sigma_separation_m[2]),
        ),
        ("b3", [11, 12].map(|k| araim.subsets()[k].bias_m[2])),
    ] {
        for (got, published) in got.iter().zip(numbers(&published[name])) {
            assert!((got - published).abs() < 6e-4, "{name} {got} {published}");
        }
    }
}

#[test]
fn the_error_model_of_the_cases_is_that_of_the_support_data() {
    let Some(text) = golden() else { return };
    let mut seen = 0;
    for case in cases(&text) {
        for (i, satellite) in case["sats"].as_array().unwrap().iter().enumerate() {
            let Some(elevation_deg) = satellite["el_deg"].as_f64() else {
                continue;
            };
            let elevation = elevation_deg.to_radians();
            let user = match satellite["sys"].as_str().unwrap() {
                "GPS" => gps_user_sigma_m(elevation),
                _ => galileo_user_sigma_m(elevation),
            };
            let never = FaultRate::from_rate(0.0, 3600.0);
            let support = IntegritySupport {
                ura_m: 0.75,
                ure_m: 0.5,
                b_nom_m: 0.75,
                satellite: never,
                constellation: never,
            };
            let made = support.satellite(0, [0.0, 0.0, -1.0], elevation, user, 0.0);
            if case["profile"] == "A_addv3_lpv200" {
                let expected = number(&case["var_int"][i]);
                assert!(
                    (made.variance_integrity_m2 - expected).abs() < 1e-12,
                    "{satellite}"
                );
                let expected = number(&case["var_acc"][i]);
                assert!(
                    (made.variance_accuracy_m2 - expected).abs() < 1e-12,
                    "{satellite}"
                );
                seen += 1;
            }
        }
    }
    assert!(seen > 150, "{seen}");
}
