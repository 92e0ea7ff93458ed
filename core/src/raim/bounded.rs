//! Levels where one row may hold an error that comes together with the fault of another.
//!
//! In: slopes of an epoch, the row that may be off, and by how much at the most. Out: the slope levels for one
//! faulty row beside it.
//!
//! | symbol | code      | unit | meaning                                                              |
//! |--------|-----------|------|----------------------------------------------------------------------|
//! | β      | `beta`    | 1    | largest error of row b over its sigma                                |
//! | S_bb   |           | 1    | its residual cofactor                                                |
//! | a_b    | leverage  | m    | shift of the position per sigma of it                                |
//!
//! Equations: with p = P_i f + P_b β' and abs(β') ≤ β a fault f of row i is missed with more than P_MD only while
//! abs(P_i f + P_b β') ≤ √λ, so √S_ii abs(f) ≤ √λ + √S_bb β, and the position is shifted by at most
//!
//! ```text
//! slope_i (√λ + √S_bb β) + |a_b| β
//! ```
//!
//! Derivation: docs/decisions/017-aids.md. It holds for a fault of row b itself, which β is then a part of.

use super::slope::{NoLevel, Sensitivity, SlopeLevels};

/// [`Sensitivity::levels`] where the error of `row` is up to `beta` of its sigmas beside one faulty row.
///
/// # Errors
/// [`NoLevel`], also where there is no such row.
pub fn levels(
    sensitivity: &Sensitivity,
    sqrt_noncentrality: f64,
    row: usize,
    beta: f64,
) -> Result<SlopeLevels, NoLevel> {
    let (Some(cofactor), Some([east, north, up])) = (
        sensitivity.residual_cofactor().get(row),
        sensitivity.leverage().get(row),
    ) else {
        return Err(NoLevel::Untestable { row });
    };
    // Rounding can leave a cofactor of nothing below nothing.
    let shown = libm::sqrt(if *cofactor < 0.0 { 0.0 } else { *cofactor });
    let mut levels = sensitivity.levels(sqrt_noncentrality + shown * beta)?;
    levels.hpl_m += beta * libm::sqrt(east * east + north * north);
    levels.vpl_m += beta * libm::fabs(*up);
    if levels.hpl_m.is_finite() && levels.vpl_m.is_finite() {
        Ok(levels)
    } else {
        Err(NoLevel::NotFinite)
    }
}

#[cfg(test)]
mod tests {
    use std::vec;

    use super::*;
    use crate::consts::MAX_UNKNOWNS;
    use crate::linalg::LinearModel;
    use crate::linalg::qr::WhitenedQr;

    const DIRECTIONS: [[f64; 3]; 5] = [
        [0.94, 0.0, 0.341],
        [-0.47, 0.814, 0.341],
        [-0.42, -0.84, 0.343],
        [0.1, 0.05, 0.994],
        [0.5, 0.5, 0.707],
    ];

    /// Satellites and a height of 3 m.
    fn model(satellites: usize) -> LinearModel {
        let mut model = LinearModel::EMPTY;
        for (k, [e, n, u]) in DIRECTIONS.into_iter().take(satellites).enumerate() {
            model.design[k] = [0.0; MAX_UNKNOWNS];
            model.design[k][..4].copy_from_slice(&[-e, -n, -u, 1.0]);
            model.sigma_m[k] = 1.5;
        }
        model.design[satellites] = [0.0; MAX_UNKNOWNS];
        model.design[satellites][2] = 1.0;
        model.sigma_m[satellites] = 3.0;
        (model.n, model.m) = (satellites + 1, 4);
        model
    }

    /// What errors do: length of the parity vector, shift horizontal and vertical.
    fn shown(model: &LinearModel, errors_m: &[(usize, f64)]) -> [f64; 3] {
        let mut model = model.clone();
        for (row, error_m) in errors_m {
            model.residual_m[*row] += error_m;
        }
        let mut qr = WhitenedQr::EMPTY;
        qr.factor(&model).unwrap();
        let [e, n, u, ..] = qr.estimate();
        [qr.sum_of_squares().sqrt(), e.hypot(n), u.abs()]
    }

    #[test]
    fn no_fault_beside_a_bounded_error_is_missed_and_beyond_the_level() {
        const LAMBDA: f64 = 8.0;
        for satellites in [4, 5] {
            let model = model(satellites);
            let mut qr = WhitenedQr::EMPTY;
            qr.factor(&model).unwrap();
            let mut sensitivity = Sensitivity::EMPTY;
            sensitivity.fill(&mut qr);
            for beta in [0.0, 1.0, 5.33] {
                let levels = super::levels(&sensitivity, LAMBDA, satellites, beta).unwrap();
                let (mut worst_h, mut worst_v) = (0.0_f64, 0.0_f64);
                for row in 0..=satellites {
                    for share in [-1.0, -0.5, 0.0, 0.5, 1.0] {
                        let bounded_m = share * beta * 3.0;
                        for step in -4000_i32..=4000 {
                            let fault_m = 0.1 * f64::from(step);
                            // The height's own fault holds the bounded error already.
                            let errors = if row == satellites {
                                vec![(row, fault_m)]
                            } else {
                                vec![(row, fault_m), (satellites, bounded_m)]
                            };
                            let [parity, h, v] = shown(&model, &errors);
                            if parity <= LAMBDA {
                                (worst_h, worst_v) = (worst_h.max(h), worst_v.max(v));
                            }
                        }
                    }
                }
                assert!(worst_h <= levels.hpl_m + 1e-9, "{worst_h} {levels:?}");
                assert!(worst_v <= levels.vpl_m + 1e-9, "{worst_v} {levels:?}");
                // With one degree of freedom the bound is reached by the faults of a satellite.
                if satellites == 4 && levels.horizontal_row != satellites {
                    assert!(worst_h > 0.9 * levels.hpl_m, "{worst_h} {levels:?}");
                }
            }
        }
    }

    #[test]
    fn row_that_is_not_there_has_no_level() {
        let error = super::levels(&Sensitivity::EMPTY, 8.0, 4, 1.0);
        assert_eq!(error, Err(NoLevel::Untestable { row: 4 }));
    }
}
