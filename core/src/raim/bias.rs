//! How far a satellite's pseudorange is off, told by the other satellites.
//!
//! In: a factored epoch. Out: measured minus predicted pseudorange of one satellite, the prediction made
//! without it, and one sigma of that.
//!
//! | symbol | code                | unit | meaning                                                    |
//! |--------|---------------------|------|------------------------------------------------------------|
//! | r_i    | `residual_m`        | m    | residual of row i of a least-squares solution with it      |
//! | S_ii   | `residual_cofactor` | 1    | share of a row's error that stays in its residual          |
//! | g      | `design`            | 1    | row of a satellite that is not in the solution             |
//! | P      |                     | m²   | cofactor R⁻¹R⁻ᵀ of the solution's unknowns                 |
//!
//! Equations: of a row of the solution r_i/S_ii ± σ_i/√S_ii, the estimate of a shift of one observation
//! [BAARDA-1968], which is what the solution without it predicts wrongly; of a satellite outside
//! y − g·x ± √(σ² + gᵀPg). Both are the same number. Keys: docs/references.md.
//! Assumes: one faulty satellite. The error that satellites share (the ionosphere's zenith delay) is taken
//! for one that they do not, which makes sigma too large rather than too small.

use super::slope::{MIN_RESIDUAL_COFACTOR, Sensitivity};
use crate::consts::MAX_UNKNOWNS;
use crate::linalg::LinearModel;
use crate::linalg::qr::WhitenedQr;

/// A bias and how well it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BiasEstimate {
    /// Measured minus predicted pseudorange, m.
    pub bias_m: f64,
    /// One sigma of it, m.
    pub sigma_m: f64,
}

impl BiasEstimate {
    /// Square of the bias over its sigma: how likely it is that this is the satellite.
    pub fn square(&self) -> f64 {
        let ratio = self.bias_m / self.sigma_m;
        ratio * ratio
    }

    fn checked(bias_m: f64, variance_m2: f64) -> Option<Self> {
        let sigma_m = libm::sqrt(variance_m2);
        let is_known = bias_m.is_finite() && sigma_m.is_finite() && sigma_m > 0.0;
        is_known.then_some(Self { bias_m, sigma_m })
    }
}

/// Of row `row` of the solution; `None` where a fault on it shows in no residual. `common_m` is one
/// sigma of its error beside the independent one it is weighted with.
pub fn of_row(
    model: &LinearModel,
    sensitivity: &Sensitivity,
    row: usize,
    common_m: f64,
) -> Option<BiasEstimate> {
    let cofactor = *sensitivity.residual_cofactor().get(row)?;
    let (residual_m, sigma_m) = (model.residual_m.get(row)?, model.sigma_m.get(row)?);
    // Written so that NaN is none.
    let is_testable = cofactor >= MIN_RESIDUAL_COFACTOR;
    if !is_testable {
        return None;
    }
    BiasEstimate::checked(
        residual_m / cofactor,
        sigma_m * sigma_m / cofactor + common_m * common_m,
    )
}

/// Of a satellite that is not in the solution `qr` is of: `residual_m` is its measured minus predicted
/// pseudorange, clock out, `sigma_m` one sigma of its own error.
pub fn outside(
    qr: &WhitenedQr,
    design: &[f64; MAX_UNKNOWNS],
    residual_m: f64,
    sigma_m: f64,
) -> Option<BiasEstimate> {
    let m = qr.m();
    if m == 0 {
        return None;
    }
    // gᵀPg = |R⁻ᵀg|².
    let mut predicted_m2 = 0.0;
    for column in 0..m {
        let mut sum = 0.0;
        for (g, row) in design.iter().zip(qr.r_inverse()).take(m) {
            sum += g * row.get(column).copied().unwrap_or(f64::NAN);
        }
        predicted_m2 += sum * sum;
    }
    BiasEstimate::checked(residual_m, sigma_m * sigma_m + predicted_m2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raim::parity;

    /// Seven satellites of one constellation, directions spread over the sky.
    fn model() -> LinearModel {
        let mut model = LinearModel::EMPTY;
        let sky = [
            (0.3, 0.1),
            (0.5, 1.2),
            (0.9, 2.0),
            (1.2, 3.1),
            (0.2, 4.0),
            (0.7, 5.0),
            (0.4, 5.9),
        ];
        let rows = model
            .design
            .iter_mut()
            .zip(&mut model.residual_m)
            .zip(&mut model.sigma_m);
        for (k, ((elevation, azimuth), ((design, residual_m), sigma_m))) in
            sky.iter().zip(rows).enumerate()
        {
            let (se, ce) = libm::sincos(*elevation);
            let (sa, ca) = libm::sincos(*azimuth);
            *design = [-ce * sa, -ce * ca, -se, 1.0, 0.0, 0.0];
            *residual_m = 0.7 * libm::sin(3.0 * k as f64);
            *sigma_m = 1.0 + 0.3 * k as f64;
        }
        model.n = 7;
        model.m = 4;
        model
    }

    fn without(model: &LinearModel, left_out: usize) -> LinearModel {
        let mut less = model.clone();
        for row in left_out..model.n - 1 {
            less.design[row] = model.design[row + 1];
            less.residual_m[row] = model.residual_m[row + 1];
            less.sigma_m[row] = model.sigma_m[row + 1];
        }
        less.n -= 1;
        less
    }

    /// Takes the estimate out of the residuals, as the monitor's models have it.
    fn solved(model: &mut LinearModel, qr: &mut WhitenedQr) {
        parity::test(model, qr).unwrap();
        let estimate = qr.estimate();
        for (design, residual_m) in model.design.iter().zip(&mut model.residual_m).take(model.n) {
            *residual_m -= design.iter().zip(estimate).map(|(a, x)| a * x).sum::<f64>();
        }
        parity::test(model, qr).unwrap();
    }

    /// INT-056. The two forms agree, and find a bias that was put on a satellite.
    #[test]
    fn a_bias_is_the_same_with_the_satellite_in_the_solution_and_outside() {
        for faulty in 0..7 {
            let mut all = model();
            all.residual_m[faulty] += 50.0;
            let (design, measured_m, sigma_m) = (
                all.design[faulty],
                all.residual_m[faulty],
                all.sigma_m[faulty],
            );
            let mut qr = WhitenedQr::EMPTY;
            let others = without(&all, faulty);
            parity::test(&others, &mut qr).unwrap();
            let predicted_m: f64 = design.iter().zip(qr.estimate()).map(|(a, x)| a * x).sum();
            let beside = outside(&qr, &design, measured_m - predicted_m, sigma_m).unwrap();

            solved(&mut all, &mut qr);
            let mut sensitivity = Sensitivity::EMPTY;
            sensitivity.fill(&mut qr);
            let inside = of_row(&all, &sensitivity, faulty, 0.0).unwrap();
            assert!((inside.bias_m - beside.bias_m).abs() < 1e-9);
            assert!((inside.sigma_m - beside.sigma_m).abs() < 1e-9);
            assert!(
                (inside.bias_m - 50.0).abs() < 3.0 * inside.sigma_m,
                "{inside:?}"
            );
            let largest = (0..7).filter_map(|row| of_row(&all, &sensitivity, row, 0.0));
            let largest = largest.map(|b| b.square()).fold(0.0, f64::max);
            assert_eq!(inside.square(), largest);
            let wider = of_row(&all, &sensitivity, faulty, 4.0).unwrap();
            assert!((wider.sigma_m.powi(2) - inside.sigma_m.powi(2) - 16.0).abs() < 1e-9);
        }
    }

    #[test]
    fn what_cannot_be_told_is_not_told() {
        let mut all = model();
        let mut qr = WhitenedQr::EMPTY;
        assert_eq!(outside(&qr, &all.design[0], 1.0, 1.0), None);
        solved(&mut all, &mut qr);
        let mut sensitivity = Sensitivity::EMPTY;
        assert_eq!(of_row(&all, &sensitivity, 0, 0.0), None);
        sensitivity.fill(&mut qr);
        assert_eq!(of_row(&all, &sensitivity, 7, 0.0), None);
        all.residual_m[0] = f64::NAN;
        assert_eq!(of_row(&all, &sensitivity, 0, 0.0), None);
        assert_eq!(outside(&qr, &all.design[0], f64::INFINITY, 1.0), None);
        assert_eq!(outside(&qr, &all.design[0], 1.0, f64::NAN), None);
    }
}
