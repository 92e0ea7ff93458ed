//! Claims: the closed-form GDOP of four satellites is the golden one and that of an inverse; what the
//! printed formula gives is something else.

mod skies;

use serde_json::Value;
use skies::{Random, sky};
use surefix_core::linalg::LinearModel;
use surefix_core::linalg::qr::WhitenedQr;
use surefix_core::raim::gdop4::{self, Gdop4Error, LEAST_DETERMINANT};

/// GDOP² as the trace of the inverse of HᵀH.
fn inverted(model: &LinearModel, qr: &mut WhitenedQr) -> Option<f64> {
    qr.factor(model).ok()?;
    Some(qr.r_inverse().iter().flatten().map(|x| x * x).sum())
}

fn directions(model: &LinearModel) -> [[f64; 3]; 4] {
    std::array::from_fn(|row| std::array::from_fn(|axis| model.design[row][axis]))
}

#[test]
fn closed_form_gdop_is_the_golden_one() {
    let path = format!(
        "{}/../../shared/golden/gdop4.json",
        env!("CARGO_MANIFEST_DIR")
    );
    let Ok(text) = std::fs::read_to_string(&path) else {
        eprintln!("SKIPPED: gdop4.json: ../shared is absent");
        return;
    };
    let file: Value = serde_json::from_str(&text).unwrap();
    let cases = file["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 20);
    let mut worst: f64 = 0.0;
    for case in cases {
        let number = |value: &Value| value.as_f64().unwrap();
        let h = &case["H"];
        let directions = std::array::from_fn(|row| {
            assert_eq!(number(&h[row][3]), 1.0);
            std::array::from_fn(|axis| number(&h[row][axis]))
        });
        let gdop = gdop4::gdop(&directions).unwrap();
        for name in ["gdop_closed", "gdop_direct"] {
            let difference = (gdop / number(&case[name]) - 1.0).abs();
            assert!(difference < 1e-9, "{name}: {gdop}");
            worst = worst.max(difference);
        }
        let without_root = gdop * gdop / number(&case["ratio_without_sqrt"]);
        assert!((without_root - 1.0).abs() < 1e-9);
        if let Some(printed) = case["gdop_printed_c"].as_f64() {
            assert!((gdop / printed - 1.0).abs() > 1e-3);
        }
    }
    println!("20 cases, worst relative difference {worst:e}");
}

#[test]
fn closed_form_gdop_is_that_of_an_inverse() {
    let mut random = Random(4);
    let mut qr = WhitenedQr::EMPTY;
    let (mut compared, mut worst, mut worst_good): (usize, f64, f64) = (0, 0.0, 0.0);
    for _ in 0..20_000 {
        let mut model = sky(&mut random, 4, 1);
        model.sigma_m = LinearModel::EMPTY.sigma_m;
        let (Ok(gdop), Some(squared)) =
            (gdop4::gdop(&directions(&model)), inverted(&model, &mut qr))
        else {
            continue;
        };
        compared += 1;
        let difference = (gdop / squared.sqrt() - 1.0).abs();
        // Rounding of det(H Hᵀ) is 1e-14 whatever its size; HHᵀ has the trace 8.
        let determinant = qr
            .r_inverse()
            .iter()
            .enumerate()
            .take(4)
            .map(|(k, row)| 1.0 / (row[k] * row[k]))
            .product::<f64>();
        worst = worst.max(difference * determinant);
        if gdop < 50.0 {
            worst_good = worst_good.max(difference);
        }
    }
    println!(
        "{compared} skies: worst relative difference {worst_good:e} for GDOP below 50; times the \
         determinant, {worst:e} for all"
    );
    assert!(compared > 19_900);
    assert!(worst < 1e-13);
    assert!(worst_good < 1e-9);
    assert!(worst / LEAST_DETERMINANT < 1e-3, "digits at the limit");
}

#[test]
fn a_sky_that_flattens_is_refused_before_its_gdop_is_wrong() {
    // Four on a cone, one lifted off it by less and less.
    let mut qr = WhitenedQr::EMPTY;
    let mut refused = 0;
    for step in 0..60 {
        let lift = 0.3 * 10.0_f64.powf(-f64::from(step) / 6.0);
        let mut model = LinearModel::EMPTY;
        (model.n, model.m) = (4, 4);
        for (row, design) in model.design.iter_mut().enumerate().take(4) {
            let azimuth = 0.3 + 1.7 * row as f64;
            let up = if row == 0 { 0.5 + lift } else { 0.5 };
            let across = (1.0_f64 - up * up).sqrt();
            *design = [
                across * azimuth.sin(),
                across * azimuth.cos(),
                up,
                1.0,
                0.0,
                0.0,
            ];
        }
        match gdop4::gdop(&directions(&model)) {
            Ok(gdop) => {
                assert_eq!(refused, 0, "{lift}");
                let expected = inverted(&model, &mut qr).unwrap().sqrt();
                assert!((gdop / expected - 1.0).abs() < 1e-3, "{lift}: {gdop}");
            }
            Err(Gdop4Error::Degenerate { determinant }) => {
                assert!(determinant.abs() < 1e-9);
                refused += 1;
            }
            Err(error) => panic!("{error:?}"),
        }
    }
    assert!(refused > 20);
}
