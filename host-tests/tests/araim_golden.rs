//! Claims: every golden ARAIM case comes out as computed elsewhere: levels to 1 mm, spreads and thresholds
//! to 1e-6 m, the same modes and unmonitored probability; the tests of its measurements too; the published
//! worked example to its printed digits; the error model that made the cases.

mod common;

use std::collections::BTreeMap;

use serde_json::{Value, json};
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

    /// The largest of every quantity.
    fn over_all(&self) -> String {
        let mut largest: BTreeMap<&str, f64> = BTreeMap::new();
        for ((_, name), difference) in &self.0 {
            let entry = largest.entry(name).or_default();
            *entry = entry.max(*difference);
        }
        let words = largest.iter().map(|(name, x)| format!("{name} {x:.1e}"));
        format!(
            "largest differences: {}",
            words.collect::<Vec<_>>().join(", ")
        )
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
    let mut modes = 0;
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
        modes += subsets.len();
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
    println!("{} cases, {modes} modes: the same subsets", cases.len());
    println!("{}", worst.over_all());
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

/// Every place of a value that holds no other, with its name in error messages.
fn leaves(name: &str, value: &Value, found: &mut Vec<String>) {
    match value {
        Value::Object(fields) => {
            for (key, value) in fields {
                let name = match name {
                    "" => key.clone(),
                    _ => format!("{name}.{key}"),
                };
                leaves(&name, value, found);
            }
        }
        Value::Array(list) => {
            for (index, value) in list.iter().enumerate() {
                leaves(&format!("{name}[{index}]"), value, found);
            }
        }
        _ => found.push(name.to_owned()),
    }
}

/// The place of a name that [`leaves`] made.
fn place<'a>(case: &'a mut Value, name: &str) -> &'a mut Value {
    let pointer = format!("/{}", name.replace(['.', '['], "/").replace(']', ""));
    case.pointer_mut(&pointer).unwrap()
}

/// Each number and name of a case in turn becomes something else: an error names the case and that field, or
/// the case has a result all the same; the case beside it always has its own.
#[test]
fn every_field_of_a_case_may_be_wrong_and_is_named() {
    const READ: [&str; 13] = [
        "systems",
        "sats",
        "G",
        "var_int",
        "var_acc",
        "bnom_int",
        "bnom_acc",
        "p_sat",
        "p_const",
        "tau_sat",
        "tau_const",
        "params",
        "id",
    ];
    let Some(text) = golden() else { return };
    let all = cases(&text);
    let good = all
        .iter()
        .find(|case| case["id"] == "DUAL12__A_addv3_lpv200")
        .unwrap();
    let beside = all
        .iter()
        .find(|case| case["id"] == "GPS06__A_addv3_lpv200")
        .unwrap();
    let id = good["id"].as_str().unwrap();
    let wrong = [
        json!(null),
        json!("text"),
        json!("@NaN"),
        json!("@-Infinity"),
        json!("@1e999"),
        json!([]),
        json!({}),
        json!(true),
        json!(-1.0),
        json!(0.0),
        json!(1e300),
    ];
    let outcome_of = |case: &Value| {
        let text = json!({ "cases": [case, beside] }).to_string();
        let text = text
            .replace("\"@NaN\"", "NaN")
            .replace("\"@-Infinity\"", "-Infinity")
            .replace("\"@1e999\"", "1e999");
        serde_json::to_value(evaluate_text(&text).unwrap()).unwrap()
    };
    let right = outcome_of(good);
    let mut found = Vec::new();
    leaves("", good, &mut found);
    let (mut tried, mut refused) = (0, 0);
    for field in &found {
        let root = field.split(['.', '[']).next().unwrap();
        // Elevation and azimuth of a satellite are for the reader.
        let is_read = READ.contains(&root) && !field.contains("_deg");
        // One wrong value is enough where none is read.
        let values = if is_read || root == "measurement_tests" {
            &wrong[..]
        } else {
            &wrong[..1]
        };
        for (kind, value) in values.iter().enumerate() {
            let mut bad = good.clone();
            *place(&mut bad, field) = value.clone();
            let outcomes = outcome_of(&bad);
            tried += 1;
            assert_eq!(outcomes[1], right[1], "{field} {value}");
            let (outcome, error) = (&outcomes[0], outcomes[0]["error"].as_str());
            assert_eq!(outcome.get("result").is_some(), error.is_none());
            if root == "measurement_tests" {
                assert_eq!(outcome["result"], right[0]["result"], "{field}");
                continue;
            }
            if !is_read {
                assert_eq!(outcome, &right[0], "{field}");
                continue;
            }
            // What is no finite number, and no name, cannot be taken for one.
            let is_name = field == "id" || root == "systems" || field.ends_with(".sys");
            let is_nothing = kind < 8 && !(is_name && (1..=4).contains(&kind));
            if is_nothing {
                let error = error.unwrap_or_else(|| panic!("{field} {value} was taken"));
                assert!(
                    error.contains(&format!("field {field} ")),
                    "{field}: {error}"
                );
                let case = if field == "id" { "#0" } else { id };
                assert!(error.starts_with(&format!("case {case}: ")), "{error}");
            }
            if let Some(error) = error {
                refused += 1;
                assert!(error.contains("field "), "{error}");
            }
        }
    }
    println!(
        "{} fields, {tried} wrong values, {refused} refused",
        found.len()
    );
    assert!(found.len() > 200 && refused > 1000);
}
