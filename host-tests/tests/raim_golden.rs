//! Claims: parity and least-squares statistic are the golden ones and agree on any sky; the parity
//! matrix is the root of the projector; slopes, HPL and VPL are the golden ones.

#![expect(
    clippy::needless_range_loop,
    reason = "matrices are compared by the formula's indices"
)]

mod skies;

use serde_json::Value;
use skies::{Random, add_noise, sky};
use surefix_core::consts::MAX_SATELLITES;
use surefix_core::linalg::LinearModel;
use surefix_core::linalg::qr::WhitenedQr;
use surefix_core::raim::slope::{NoLevel, Sensitivity, semi_major_axis_m};
use surefix_core::raim::thresholds::RaimTable;
use surefix_core::raim::{RaimError, ls, parity};

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

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|number| number.as_f64().unwrap())
        .collect()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

/// Difference relative to the larger of the expected value and `floor`.
fn difference(value: f64, expected: f64, floor: f64) -> f64 {
    (value - expected).abs() / expected.abs().max(floor)
}

/// The model of a golden case with these sigmas.
fn model_of(case: &Value, sigma_m: &[f64]) -> LinearModel {
    let mut model = LinearModel::EMPTY;
    model.n = case["n"].as_u64().unwrap() as usize;
    model.m = 4;
    for (row, given) in model.design.iter_mut().zip(case["H"].as_array().unwrap()) {
        row[..4].copy_from_slice(&numbers(given));
    }
    if let Some(y) = case.get("y") {
        model.residual_m[..model.n].copy_from_slice(&numbers(y));
    }
    model.sigma_m[..model.n].copy_from_slice(sigma_m);
    model
}

#[test]
fn parity_and_least_squares_give_the_golden_statistic() {
    let Some(file) = golden("parity_identity.json") else {
        return;
    };
    let mut qr = WhitenedQr::EMPTY;
    let mut workspace = ls::LeastSquaresWorkspace::EMPTY;
    let mut worst: f64 = 0.0;
    for case in file["cases"].as_array().unwrap() {
        let n = case["n"].as_u64().unwrap() as usize;
        for (sigma_m, sse, x) in [
            (vec![1.0; n], "sse", "x_ls"),
            (numbers(&case["sigma"]), "wsse", "x_wls"),
        ] {
            let model = model_of(case, &sigma_m);
            let statistic = parity::test(&model, &mut qr).unwrap();
            assert_eq!(statistic.redundancy, n - 4);
            let expected = number(&case[sse]);
            worst = worst.max(difference(statistic.sum_of_squares, expected, 0.0));
            let textbook = ls::test(&model, &mut workspace).unwrap();
            assert_eq!(textbook.redundancy, n - 4);
            worst = worst.max(difference(textbook.sum_of_squares, expected, 0.0));
            for (estimate, expected) in qr.estimate().iter().zip(numbers(&case[x])) {
                worst = worst.max(difference(*estimate, expected, 1.0));
            }
        }

        // Unweighted: residuals, and S against the projector made of the parity matrix.
        let model = model_of(case, &vec![1.0; n]);
        qr.factor(&model).unwrap();
        ls::test(&model, &mut workspace).unwrap();
        let mut residuals = [0.0; MAX_SATELLITES];
        qr.residuals(&mut residuals);
        let expected = numbers(&case["residual"]);
        for i in 0..n {
            worst = worst.max(difference(residuals[i], expected[i], 1.0));
            worst = worst.max(difference(workspace.residuals()[i], expected[i], 1.0));
        }
        let projector = projector_of(&qr);
        for i in 0..n {
            for (j, expected) in numbers(&case["S"][i]).into_iter().enumerate() {
                worst = worst.max(difference(projector[i][j], expected, 1.0));
                worst = worst.max(difference(workspace.projector()[i][j], expected, 1.0));
            }
        }
    }
    println!("worst difference {worst:e}");
    assert!(worst < 1e-9);
}

/// PᵀP of the parity matrix P.
fn projector_of(qr: &WhitenedQr) -> [[f64; MAX_SATELLITES]; MAX_SATELLITES] {
    let mut projector = [[0.0; MAX_SATELLITES]; MAX_SATELLITES];
    let mut row = [0.0; MAX_SATELLITES];
    let mut rows = 0;
    while qr.parity_matrix_row(rows, &mut row) {
        for i in 0..qr.n() {
            for j in 0..qr.n() {
                projector[i][j] += row[i] * row[j];
            }
        }
        rows += 1;
    }
    assert_eq!(rows, qr.n() - qr.m());
    projector
}

#[test]
fn slopes_and_levels_are_the_golden_ones() {
    let Some(file) = golden("slope_max_hpl.json") else {
        return;
    };
    let mut table = RaimTable::EMPTY;
    table
        .fill(number(&file["p_fa"]), number(&file["p_md"]))
        .unwrap();
    let mut qr = WhitenedQr::EMPTY;
    let mut sensitivity = Sensitivity::EMPTY;
    let mut worst: f64 = 0.0;
    let mut worst_ill: f64 = 0.0;
    for case in file["cases"].as_array().unwrap() {
        let n = case["n"].as_u64().unwrap() as usize;
        let sigma_m = number(&case["sigma"]);
        let weighted = &case["weighted"];
        // The golden slopes are per metre when unweighted, per sigma when weighted.
        for (sigmas_m, expected, slope_unit) in [
            (vec![sigma_m; n], case, sigma_m),
            (numbers(&weighted["sigma_i"]), weighted, 1.0),
        ] {
            let model = model_of(case, &sigmas_m);
            parity::test(&model, &mut qr).unwrap();
            sensitivity.fill(&mut qr);
            let levels = sensitivity
                .levels(table.sqrt_noncentrality(n - 4).unwrap())
                .unwrap();
            worst = worst.max(difference(levels.hpl_m, number(&expected["hpl"]), 0.0));
            worst = worst.max(difference(levels.vpl_m, number(&expected["vpl"]), 0.0));
            let horizontal = numbers(&expected["h_slope"]);
            let vertical = numbers(&expected["v_slope"]);
            for i in 0..n {
                let [east, north, up] = sensitivity.leverage()[i];
                let root = sensitivity.residual_cofactor()[i].sqrt() * slope_unit;
                let h = (east * east + north * north).sqrt() / root;
                worst = worst.max(difference(h, horizontal[i], 0.0));
                // A vertical slope near zero is the difference of larger numbers.
                worst_ill = worst_ill.max(difference(up.abs() / root, vertical[i], 0.0));
            }
            if std::ptr::eq(expected, case) {
                assert_eq!(
                    levels.horizontal_row as u64,
                    case["i_hmax"].as_u64().unwrap()
                );
            }
        }
    }
    println!("worst difference {worst:e}, of single vertical slopes {worst_ill:e}");
    assert!(worst < 1e-9);
    assert!(worst_ill < 1e-6);
}

#[test]
fn both_tests_agree_on_random_skies() {
    let mut random = Random(1);
    let mut qr = WhitenedQr::EMPTY;
    let mut workspace = ls::LeastSquaresWorkspace::EMPTY;
    let mut sensitivity = Sensitivity::EMPTY;
    let mut worst: f64 = 0.0;
    let mut compared = 0;
    for _ in 0..3000 {
        let clocks = random.integer(1, 3);
        let n = random.integer(4 + clocks, 48);
        let mut model = sky(&mut random, n, clocks);
        add_noise(&mut random, &mut model);
        // Leave out what is nearly undetermined: there the normal equations have lost the digits.
        let Ok(statistic) = parity::test(&model, &mut qr) else {
            continue;
        };
        if qr.condition_squared() > 1e6 {
            continue;
        }
        // Residuals of a settled solution, as the monitor has them: the estimate is taken out.
        let estimate = qr.estimate();
        for i in 0..n {
            model.residual_m[i] -= (0..model.m)
                .map(|j| model.design[i][j] * estimate[j])
                .sum::<f64>();
        }
        let settled = parity::test(&model, &mut qr).unwrap();
        assert!(
            difference(settled.sum_of_squares, statistic.sum_of_squares, 0.0) < 1e-6,
            "the estimate does not matter"
        );
        let textbook = ls::test(&model, &mut workspace).unwrap();
        worst = worst.max(difference(
            textbook.sum_of_squares,
            settled.sum_of_squares,
            0.0,
        ));
        sensitivity.fill(&mut qr);
        let projector = projector_of(&qr);
        for i in 0..n {
            assert!((projector[i][i] - sensitivity.residual_cofactor()[i]).abs() < 1e-12);
            for j in 0..n {
                assert!((projector[i][j] - workspace.projector()[i][j]).abs() < 1e-9);
            }
        }
        compared += 1;
    }
    println!("{compared} skies, worst difference {worst:e}");
    assert!(compared > 2500);
    assert!(worst < 1e-10);
}

#[test]
fn a_fault_shifts_the_position_by_its_leverage() {
    let mut random = Random(2);
    let mut qr = WhitenedQr::EMPTY;
    let mut sensitivity = Sensitivity::EMPTY;
    for _ in 0..200 {
        let clocks = random.integer(1, 3);
        let n = random.integer(6 + clocks, 30);
        let mut model = sky(&mut random, n, clocks);
        add_noise(&mut random, &mut model);
        if qr.factor(&model).is_err() || qr.condition_squared() > 1e6 {
            continue;
        }
        sensitivity.fill(&mut qr);
        let before = qr.estimate();
        let row = random.integer(0, n - 1);
        model.residual_m[row] += 50.0;
        qr.factor(&model).unwrap();
        let after = qr.estimate();
        for axis in 0..3 {
            let expected = 50.0 / model.sigma_m[row] * sensitivity.leverage()[row][axis];
            assert!((after[axis] - before[axis] - expected).abs() < 1e-7);
        }
    }
}

#[test]
fn covariance_without_common_errors_is_that_of_least_squares() {
    let mut random = Random(3);
    let model = sky(&mut random, 12, 2);
    let mut qr = WhitenedQr::EMPTY;
    let mut sensitivity = Sensitivity::EMPTY;
    qr.factor(&model).unwrap();
    sensitivity.fill(&mut qr);
    let covariance = sensitivity.position_covariance(&model, &model.sigma_m, &[]);
    for i in 0..3 {
        for j in 0..3 {
            let expected: f64 = (0..5)
                .map(|k| qr.r_inverse()[i][k] * qr.r_inverse()[j][k])
                .sum();
            assert!((covariance[(i, j)] - expected).abs() < 1e-12);
        }
    }
    // The semi-major axis is the largest spread over all directions.
    let largest = (0..3600)
        .map(|step| {
            let (sine, cosine) = (f64::from(step) * 0.05_f64.to_radians()).sin_cos();
            (covariance.m11 * cosine * cosine
                + 2.0 * covariance.m12 * sine * cosine
                + covariance.m22 * sine * sine)
                .sqrt()
        })
        .fold(0.0, f64::max);
    assert!((semi_major_axis_m(&covariance) / largest - 1.0).abs() < 1e-6);

    // An error common to all rows of one clock moves that clock and nothing else; one that grows
    // towards the horizon moves the position.
    let none = [0.0; MAX_SATELLITES];
    let mut common_m = [[0.0; MAX_SATELLITES]; 1];
    for i in 0..12 {
        common_m[0][i] = 5.0 * model.design[i][3];
    }
    let clock_only = sensitivity.position_covariance(&model, &none, &common_m);
    assert!(clock_only.norm() < 1e-20);
    for i in 0..12 {
        common_m[0][i] = 2.0 / (0.2 - model.design[i][2]);
    }
    let shifted = sensitivity.position_covariance(&model, &none, &common_m);
    let mut moved = model.clone();
    moved.residual_m = common_m[0];
    qr.factor(&moved).unwrap();
    let shift = qr.estimate();
    for i in 0..3 {
        for j in 0..3 {
            assert!((shifted[(i, j)] - shift[i] * shift[j]).abs() < 1e-9);
        }
    }
    assert!(shifted.m33 > 1e-3);
}

#[test]
fn what_cannot_be_seen_has_no_level_unless_it_is_harmless() {
    let mut random = Random(4);
    let mut qr = WhitenedQr::EMPTY;
    let mut sensitivity = Sensitivity::EMPTY;
    assert_eq!(sensitivity.levels(8.0), Err(NoLevel::NoRedundancy));

    let model = sky(&mut random, 4, 1);
    assert_eq!(
        parity::test(&model, &mut qr),
        Err(RaimError::NoRedundancy { n: 4 })
    );
    sensitivity.fill(&mut qr);
    assert_eq!(sensitivity.levels(8.0), Err(NoLevel::NoRedundancy));

    // A satellite alone in its constellation only sets that clock.
    let mut model = sky(&mut random, 10, 1);
    let with_one_clock = {
        let mut nine = model.clone();
        nine.n = 9;
        qr.factor(&nine).unwrap();
        sensitivity.fill(&mut qr);
        sensitivity.levels(8.0).unwrap()
    };
    model.m = 5;
    model.design[9][3] = 0.0;
    model.design[9][4] = 1.0;
    qr.factor(&model).unwrap();
    sensitivity.fill(&mut qr);
    assert!(sensitivity.residual_cofactor()[9] < 1e-14);
    let levels = sensitivity.levels(8.0).unwrap();
    assert!((levels.hpl_m / with_one_clock.hpl_m - 1.0).abs() < 1e-12);
    assert!((levels.vpl_m / with_one_clock.vpl_m - 1.0).abs() < 1e-12);

    // All satellites but one on a cone around the zenith: only that one tells height from clock.
    let mut model = sky(&mut random, 10, 1);
    for i in 0..9 {
        let azimuth = i as f64;
        model.design[i] = [
            -0.8 * azimuth.sin(),
            -0.8 * azimuth.cos(),
            -0.6,
            1.0,
            0.0,
            0.0,
        ];
    }
    qr.factor(&model).unwrap();
    sensitivity.fill(&mut qr);
    assert_eq!(sensitivity.levels(8.0), Err(NoLevel::Untestable { row: 9 }));
}
