//! Levels from the spread of the residuals: with the posterior variance, and reconstructed after robust
//! estimation.
//!
//! In: weighted sum of squared residuals, numbers of rows and unknowns, cofactor matrix of the position. Out:
//! HPL and VPL.
//!
//! | symbol | code | unit | meaning |
//! |--------|------|------|---------|
//! | V'PV   | `sum_of_squares` | 1 | residuals squared over their variances; times the weight factors after robust estimation |
//! | m      | [`posterior_factor`] | 1 | √(V'PV/(n − t)): by how much the residuals exceed their sigmas |
//! | Q      | `cofactor_enu_m2` | m² | (AᵀPA)⁻¹, position block, east, north, up |
//! | K_H, K_V | `k_horizontal`, `k_vertical` | 1 | 6.18 and 5.33, risks 5e-9 and 1e-7 |
//!
//! Equations: [P3] (14) to (16) with the weights of least squares, (17) to (19) with the equivalent
//! weights of robust estimation ([`super::igg3`]): HPL = K_H m H, VPL = K_V m √Q_UU. Keys: docs/references.md.
//!
//! Departures, each a named choice ([`LevelConvention`]), since the printed text is ambiguous or unsafe:
//! - H: the text has the root sum of squares of east and north. 6.18 = √(−2 ln 5e-9) is the factor of a
//!   circular error whose sigma is that of one axis; [DO-229] multiplies the semi-major axis of the error
//!   ellipse. Default: the semi-major axis.
//! - n: the text divides by all rows. Rows of weight zero have no residual in the sum: default, only rows that
//!   count are counted.
//! - m: below 1 the residuals happen to be smaller than their sigmas, which says nothing about the
//!   position. Default: at least 1.
//!
//! **What these levels are not.** They carry no missed-detection probability: a fault that the residuals do
//! not show, or that robust estimation has taken for the truth, is not bounded. In one case of the reference
//! data the up error is 8.01 m against a level of 7.38 m. They help to keep a service available while somebody
//! else bounds the integrity risk. How often they fail on recordings: docs/algorithms/robust.md.

use nalgebra::Matrix3;

use super::monitors::{MonitorLevels, NoLevels, checked_levels};
use super::slope::semi_major_axis_m;

/// K_H of [P3] (14), 1: a circular error exceeds it with 5e-9.
pub const K_HORIZONTAL: f64 = 6.18;
/// K_V of [P3] (15), 1: a normal error exceeds it with 1e-7, both sides together.
pub const K_VERTICAL: f64 = 5.33;

/// What stands for the horizontal error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HorizontalSpread {
    /// √(Q_EE + Q_NN), [P3] (12).
    RootSumOfSquares,
    /// Semi-major axis of the error ellipse, [DO-229].
    SemiMajorAxis,
}

/// Which rows the posterior factor counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CountedRows {
    /// All, as [P3] (17) is printed.
    All,
    /// Those of a weight above zero.
    Kept,
}

/// How [P3] is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelConvention {
    /// K_H, 1.
    pub k_horizontal: f64,
    /// K_V, 1.
    pub k_vertical: f64,
    /// H.
    pub horizontal: HorizontalSpread,
    /// n.
    pub counted: CountedRows,
    /// Least m, 1.
    pub least_factor: f64,
}

impl LevelConvention {
    /// The letter of [P3].
    pub const PRINTED: Self = Self {
        k_horizontal: K_HORIZONTAL,
        k_vertical: K_VERTICAL,
        horizontal: HorizontalSpread::RootSumOfSquares,
        counted: CountedRows::All,
        least_factor: 0.0,
    };

    /// Semi-major axis, rows that count, posterior factor of at least 1.
    pub const CORRECTED: Self = Self {
        horizontal: HorizontalSpread::SemiMajorAxis,
        counted: CountedRows::Kept,
        least_factor: 1.0,
        ..Self::PRINTED
    };

    /// HPL and VPL, m. [P3] (14), (15), (18), (19)
    ///
    /// # Errors
    /// [`NoLevels::NoRedundancy`] when the rows that count are no more than the unknowns, whatever is
    /// divided by; [`NoLevels::NotFinite`].
    pub fn levels(
        &self,
        fit: &WeightedFit,
        cofactor_enu_m2: &Matrix3<f64>,
    ) -> Result<MonitorLevels, NoLevels> {
        if fit.rows_kept <= fit.unknowns {
            return Err(NoLevels::NoRedundancy);
        }
        let rows = match self.counted {
            CountedRows::All => fit.rows,
            CountedRows::Kept => fit.rows_kept,
        };
        let factor = posterior_factor(fit.sum_of_squares, rows, fit.unknowns)
            .ok_or(NoLevels::NoRedundancy)?;
        let factor = if factor < self.least_factor {
            self.least_factor
        } else {
            factor
        };
        let horizontal_m = match self.horizontal {
            HorizontalSpread::RootSumOfSquares => {
                libm::sqrt(cofactor_enu_m2.m11 + cofactor_enu_m2.m22)
            }
            HorizontalSpread::SemiMajorAxis => semi_major_axis_m(cofactor_enu_m2),
        };
        checked_levels(
            self.k_horizontal * factor * horizontal_m,
            self.k_vertical * factor * libm::sqrt(cofactor_enu_m2.m33),
        )
    }
}

/// How well rows fit a solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeightedFit {
    /// V'PV, 1.
    pub sum_of_squares: f64,
    /// Rows, those of weight zero among them.
    pub rows: usize,
    /// Rows of a weight above zero.
    pub rows_kept: usize,
    /// Unknowns that these rows determine.
    pub unknowns: usize,
}

/// m, [P3] (16) and (17); `None` without redundancy. NaN stays NaN.
pub fn posterior_factor(sum_of_squares: f64, rows: usize, unknowns: usize) -> Option<f64> {
    let redundancy = rows.checked_sub(unknowns).filter(|r| *r > 0)?;
    Some(libm::sqrt(sum_of_squares / redundancy as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIT: WeightedFit = WeightedFit {
        sum_of_squares: 16.0,
        rows: 12,
        rows_kept: 8,
        unknowns: 4,
    };

    #[test]
    fn each_reading_of_the_text_gives_its_own_level() {
        let cofactor = Matrix3::new(4.0, 0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 25.0);
        let printed = LevelConvention::PRINTED.levels(&FIT, &cofactor).unwrap();
        let m = 2.0_f64.sqrt();
        assert!((printed.hpl_m - 6.18 * m * 13.0_f64.sqrt()).abs() < 1e-12);
        assert!((printed.vpl_m - 5.33 * m * 5.0).abs() < 1e-12);
        let corrected = LevelConvention::CORRECTED.levels(&FIT, &cofactor).unwrap();
        assert!((corrected.hpl_m - 6.18 * 2.0 * 3.0).abs() < 1e-12);
        assert!((corrected.vpl_m - 5.33 * 2.0 * 5.0).abs() < 1e-12);
    }

    /// INT-130.
    #[test]
    fn a_lucky_fit_does_not_shrink_the_corrected_level() {
        let lucky = WeightedFit {
            sum_of_squares: 1e-6,
            ..FIT
        };
        let cofactor = Matrix3::identity();
        let corrected = LevelConvention::CORRECTED
            .levels(&lucky, &cofactor)
            .unwrap();
        assert!((corrected.vpl_m - 5.33).abs() < 1e-12);
        let printed = LevelConvention::PRINTED.levels(&lucky, &cofactor).unwrap();
        assert!(printed.vpl_m < 0.01);
    }

    /// INT-131.
    #[test]
    fn without_redundancy_among_the_rows_that_count_there_is_no_level() {
        for convention in [LevelConvention::PRINTED, LevelConvention::CORRECTED] {
            let spent = WeightedFit {
                rows_kept: 4,
                ..FIT
            };
            let none = convention.levels(&spent, &Matrix3::identity());
            assert_eq!(none, Err(NoLevels::NoRedundancy));
            let nan = WeightedFit {
                sum_of_squares: f64::NAN,
                ..FIT
            };
            let none = convention.levels(&nan, &Matrix3::identity());
            assert_eq!(none, Err(NoLevels::NotFinite));
        }
        assert_eq!(posterior_factor(1.0, 4, 4), None);
        assert_eq!(posterior_factor(1.0, 3, 4), None);
    }
}
