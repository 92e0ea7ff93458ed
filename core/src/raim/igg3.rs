//! Robust least squares with the equivalent weights of IGG-III (Institute of Geodesy and Geophysics,
//! scheme III).
//!
//! In: a linearised epoch of any number of constellations. Out: the position with outlying rows weighted
//! down or out, which rows those are, and how well the others fit.
//!
//! | symbol | code | shape | unit | meaning |
//! |--------|------|-------|------|---------|
//! | V      | `residual_m` | n | m | predicted minus measured, [P3] (5) |
//! | σ_v    |      | n     | m    | s σ √S_ii, from the cofactors of the *original* weights |
//! | v̄      | `standardised` | n | 1 | V/σ_v |
//! | w      | `weights` | n | 1 | factor on the row's weight, 1 inside k₀, 0 beyond k₁ |
//! | s      | [`ResidualScale`] | 1 | 1 | 1, or the posterior factor of the iterate |
//!
//! Equations: [P3] (4) start, (6) solution with the weights P w, (7) weights with k₀ = 1.5, k₁ = 5; one
//! clock per constellation where (8) has one. Keys: docs/references.md.
//! The solution, the residuals and the weights are iterated until the position stands still.
//!
//! What the text leaves open, and what goes wrong:
//! - *Cofactors.* With those of the new weights a row that was weighted down would look better determined
//!   with each iteration. They are those of the original weights throughout.
//! - *Untestable rows.* A row whose error stays in no residual (S_ii below
//!   [`MIN_RESIDUAL_COFACTOR`]) keeps its weight.
//! - *Breakdown.* From a start that the fault has already moved, healthy rows can look worse than the
//!   faulty one. [`ZeroedRows`] caps how many get weight zero; what lies beyond k₁ over the cap keeps the
//!   factor k₀/|v̄|, which bounds its influence, and is reported ([`RobustSolution::kept_outliers`]).
//!   A constellation that loses all its rows is left out with its clock, and does not come back.
//!   When fewer rows are left than unknowns, or they determine no position, there is no solution.
//! - *The iteration* can circle between two sets of weights; after [`MAX_ITERATIONS`] it is given up.
//!
//! Assumes: fewer than half of the redundant rows are faulty, and the faults do not agree among themselves.
//! Nothing here proves that; there is no missed-detection probability ([`super::reconstructed`]).
//! Cost: one QR factorization per iteration, 3 to 30 iterations.

use nalgebra::Matrix3;

use super::exclusion::RowSet;
use super::reconstructed::{WeightedFit, posterior_factor};
use super::slope::{HARMLESS_LEVERAGE_M, MIN_RESIDUAL_COFACTOR, Sensitivity};
use crate::consts::{MAX_SATELLITES, MAX_UNKNOWNS};
use crate::linalg::LinearModel;
use crate::linalg::qr::{QrError, WhitenedQr};

/// Most solutions of an epoch.
pub const MAX_ITERATIONS: usize = 60;

/// σ_v of [P3] (7): what a residual is compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResidualScale {
    /// The sigma the model gives it, s = 1.
    Prior,
    /// That, times the posterior factor of the iterate where it is above 1: the rows set the scale
    /// themselves, and a fault that inflates it hides behind it.
    Posterior,
}

/// How many rows may get weight zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ZeroedRows {
    /// As many as the weight function says, as printed.
    Unlimited,
    /// At most half of the redundancy, rounded down, and at most so many.
    HalfOfRedundancy {
        /// At most.
        at_most: usize,
    },
}

/// What the estimator is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Igg3Config {
    /// Up to here a standardised residual leaves its row the full weight, 1.
    pub k0: f64,
    /// From here on it takes the row out, 1.
    pub k1: f64,
    /// What residuals are compared with.
    pub scale: ResidualScale,
    /// How many rows may go.
    pub zeroed: ZeroedRows,
    /// The position has settled when no unknown moves by more, m.
    pub tolerance_m: f64,
}

impl Igg3Config {
    /// k₀, k₁ of [P3] (7), no cap, settled to rounding.
    pub const PRINTED: Self = Self {
        k0: 1.5,
        k1: 5.0,
        scale: ResidualScale::Prior,
        zeroed: ZeroedRows::Unlimited,
        tolerance_m: 1e-12,
    };

    /// The same weights, at most half of the redundancy taken out, settled to a tenth of a millimetre.
    pub const CORRECTED: Self = Self {
        zeroed: ZeroedRows::HalfOfRedundancy {
            at_most: MAX_SATELLITES,
        },
        tolerance_m: 1e-4,
        ..Self::PRINTED
    };

    /// Whether the numbers make sense; NaN does not.
    pub fn is_legal(&self) -> bool {
        self.k0 > 0.0 && self.k1 > self.k0 && self.k1.is_finite() && self.tolerance_m > 0.0
    }
}

/// Why there is no robust solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Igg3Error {
    /// The configuration is not legal.
    Config,
    /// The epoch could not be factored with its original weights.
    Factor(QrError),
    /// As many rows as unknowns from the beginning.
    NoRedundancy {
        /// Rows.
        n: usize,
    },
    /// The rows that were left determine no position, or no more than that: too many got weight zero.
    Breakdown {
        /// Rows of weight zero.
        zeroed: usize,
    },
    /// The weights did not settle.
    NotConverged,
}

/// The robust solution of an epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobustSolution {
    /// Position minus the point of linearisation, east, north, up, m.
    pub position_enu_m: [f64; 3],
    /// (AᵀP̄A)⁻¹, position block, m².
    pub cofactor_enu_m2: Matrix3<f64>,
    /// How well the rows fit with their new weights.
    pub fit: WeightedFit,
    /// Rows of weight zero.
    pub zeroed: RowSet,
    /// Rows beyond k₁ that the cap kept in.
    pub kept_outliers: RowSet,
    /// Largest |v̄| of the rows that count, 1.
    pub largest_kept: f64,
    /// Solutions computed.
    pub iterations: usize,
}

/// The least-squares solution that robust estimation starts from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeastSquaresSolution {
    /// Position minus the point of linearisation, east, north, up, m.
    pub position_enu_m: [f64; 3],
    /// (AᵀPA)⁻¹, position block, m².
    pub cofactor_enu_m2: Matrix3<f64>,
    /// How well the rows fit.
    pub fit: WeightedFit,
}

/// Memory of the estimator, owned by the caller (12 kB).
#[derive(Clone, Debug)]
pub struct Igg3Workspace {
    n: usize,
    weighted: LinearModel,
    qr: WhitenedQr,
    sensitivity: Sensitivity,
    sigma_v_m: [f64; MAX_SATELLITES],
    weights: [f64; MAX_SATELLITES],
    standardised: [f64; MAX_SATELLITES],
    residual_m: [f64; MAX_SATELLITES],
}

/// IGG-III. [P3] (7); NaN has weight zero.
pub fn weight(standardised: f64, k0: f64, k1: f64) -> f64 {
    let size = libm::fabs(standardised);
    if size <= k0 {
        1.0
    } else if size <= k1 {
        let descent = (k1 - size) / (k1 - k0);
        k0 / size * descent * descent
    } else {
        0.0
    }
}

impl Igg3Workspace {
    /// Nothing estimated.
    pub const EMPTY: Self = Self {
        n: 0,
        weighted: LinearModel::EMPTY,
        qr: WhitenedQr::EMPTY,
        sensitivity: Sensitivity::EMPTY,
        sigma_v_m: [0.0; MAX_SATELLITES],
        weights: [0.0; MAX_SATELLITES],
        standardised: [0.0; MAX_SATELLITES],
        residual_m: [0.0; MAX_SATELLITES],
    };

    /// Weight factors w of the last iteration.
    pub fn weights(&self) -> &[f64] {
        self.weights.get(..self.n).unwrap_or(&[])
    }

    /// Standardised residuals v̄ of the last iteration; 0 for a row that cannot be tested.
    pub fn standardised(&self) -> &[f64] {
        self.standardised.get(..self.n).unwrap_or(&[])
    }

    /// Residuals of the last iteration, predicted minus measured, m.
    pub fn residuals_m(&self) -> &[f64] {
        self.residual_m.get(..self.n).unwrap_or(&[])
    }

    /// A row of the robust solution whose error moves the position and stays in no residual: no level bounds
    /// that. To be asked after [`Igg3Workspace::estimate`] gave a solution.
    #[inline(never)]
    pub fn untestable_row(&mut self) -> Option<usize> {
        self.sensitivity.fill(&mut self.qr);
        let kept = self.weights().iter().enumerate().filter(|(_, w)| **w > 0.0);
        let rows = self
            .sensitivity
            .leverage()
            .iter()
            .zip(self.sensitivity.residual_cofactor());
        kept.zip(rows)
            .find(|(_, (leverage, cofactor))| {
                // NaN cannot be tested.
                let is_testable = **cofactor >= MIN_RESIDUAL_COFACTOR;
                let moves = leverage
                    .iter()
                    .any(|shift_m| !(libm::fabs(*shift_m) <= HARMLESS_LEVERAGE_M));
                !is_testable && moves
            })
            .map(|((row, _), _)| row)
    }

    /// Least squares, and the sigmas of its residuals. [P3] (4)
    ///
    /// # Errors
    /// [`Igg3Error::Factor`], [`Igg3Error::NoRedundancy`].
    #[inline(never)]
    pub fn least_squares(
        &mut self,
        model: &LinearModel,
    ) -> Result<LeastSquaresSolution, Igg3Error> {
        self.n = 0;
        self.qr.factor(model).map_err(Igg3Error::Factor)?;
        if model.n <= model.m {
            return Err(Igg3Error::NoRedundancy { n: model.n });
        }
        self.sensitivity.fill(&mut self.qr);
        let rows = self.sigma_v_m.iter_mut().zip(&model.sigma_m);
        for ((sigma_v_m, sigma_m), cofactor) in rows.zip(self.sensitivity.residual_cofactor()) {
            // 0 marks what cannot be tested; NaN is that.
            *sigma_v_m = if *cofactor >= MIN_RESIDUAL_COFACTOR {
                sigma_m * libm::sqrt(*cofactor)
            } else {
                0.0
            };
        }
        self.n = model.n;
        self.weights = [1.0; MAX_SATELLITES];
        let [east, north, up, ..] = self.qr.estimate();
        Ok(LeastSquaresSolution {
            position_enu_m: [east, north, up],
            cofactor_enu_m2: position_cofactor(&self.qr),
            fit: WeightedFit {
                sum_of_squares: self.qr.sum_of_squares(),
                rows: model.n,
                rows_kept: model.n,
                unknowns: model.m,
            },
        })
    }

    /// Robust least squares. [P3] (6), (7)
    ///
    /// # Errors
    /// [`Igg3Error`].
    #[inline(never)]
    pub fn estimate(
        &mut self,
        model: &LinearModel,
        config: &Igg3Config,
    ) -> Result<RobustSolution, Igg3Error> {
        if !config.is_legal() {
            return Err(Igg3Error::Config);
        }
        let start = self.least_squares(model)?;
        let cap = match config.zeroed {
            ZeroedRows::Unlimited => model.n,
            ZeroedRows::HalfOfRedundancy { at_most } => {
                let half = model.n.saturating_sub(model.m) / 2;
                if half < at_most { half } else { at_most }
            }
        };
        let mut unknowns = Unknowns::all(model);
        let mut estimate = self.qr.estimate();
        let mut fit = start.fit;
        for iteration in 1..=MAX_ITERATIONS {
            self.look(model, &estimate, &unknowns, scale(config, &fit));
            let kept_outliers = self.reweigh(config, cap, &unknowns);
            unknowns.drop_empty(model, &self.weights);
            let zeroed = self.zeroed();
            let next = self.solve(model, &unknowns, &mut fit)?;
            if fit.rows_kept <= fit.unknowns {
                return Err(Igg3Error::Breakdown {
                    zeroed: zeroed.len(),
                });
            }
            let mut largest_m = 0.0;
            for ((new, old), kept) in next.iter().zip(&estimate).zip(unknowns.kept) {
                let moved_m = libm::fabs(new - old);
                // NaN never settles.
                if kept && !(moved_m <= largest_m) {
                    largest_m = moved_m;
                }
            }
            estimate = next;
            if largest_m <= config.tolerance_m {
                self.look(model, &estimate, &unknowns, scale(config, &fit));
                let [east, north, up, ..] = estimate;
                return Ok(RobustSolution {
                    position_enu_m: [east, north, up],
                    cofactor_enu_m2: position_cofactor(&self.qr),
                    fit,
                    zeroed,
                    kept_outliers,
                    largest_kept: self.largest_kept(),
                    iterations: iteration,
                });
            }
        }
        Err(Igg3Error::NotConverged)
    }

    /// Residuals at an estimate, and standardised.
    fn look(
        &mut self,
        model: &LinearModel,
        estimate: &[f64; MAX_UNKNOWNS],
        unknowns: &Unknowns,
        scale: f64,
    ) {
        let given = model.design.iter().zip(&model.residual_m);
        let places = self
            .residual_m
            .iter_mut()
            .zip(&mut self.standardised)
            .zip(&self.sigma_v_m);
        for (((residual_m, standardised), sigma_v_m), (design, measured_m)) in
            places.zip(given).take(model.n)
        {
            let mut predicted_m = 0.0;
            for (entry, x) in design.iter().zip(estimate) {
                predicted_m += entry * x;
            }
            *residual_m = predicted_m - measured_m;
            *standardised = if *sigma_v_m > 0.0 && unknowns.has_clock(design) {
                *residual_m / (scale * sigma_v_m)
            } else {
                0.0
            };
        }
    }

    /// New weight factors; the rows beyond k₁ that the cap keeps.
    fn reweigh(&mut self, config: &Igg3Config, cap: usize, unknowns: &Unknowns) -> RowSet {
        let mut kept_outliers = RowSet::EMPTY;
        // Rows of a constellation that has gone count against the cap.
        let gone = unknowns.gone.len();
        let room = cap.saturating_sub(gone);
        for (row, place) in self.weights.iter_mut().enumerate().take(self.n) {
            if unknowns.gone.contains(row) {
                *place = 0.0;
                continue;
            }
            let standardised = self.standardised.get(row).copied().unwrap_or(f64::NAN);
            *place = weight(standardised, config.k0, config.k1);
            if *place > 0.0 {
                continue;
            }
            let size = libm::fabs(standardised);
            let larger = self
                .standardised
                .iter()
                .enumerate()
                .take(self.n)
                .filter(|(other, value)| {
                    let other_size = libm::fabs(**value);
                    !unknowns.gone.contains(*other)
                        && (other_size > size || (other_size == size && *other < row))
                })
                .count();
            if larger >= room {
                *place = config.k0 / size;
                kept_outliers = kept_outliers.with(row);
            }
        }
        kept_outliers
    }

    fn zeroed(&self) -> RowSet {
        let mut zeroed = RowSet::EMPTY;
        for (row, weight) in self.weights().iter().enumerate() {
            if !(*weight > 0.0) {
                zeroed = zeroed.with(row);
            }
        }
        zeroed
    }

    fn largest_kept(&self) -> f64 {
        let mut largest = 0.0;
        for (weight, standardised) in self.weights().iter().zip(self.standardised()) {
            let size = libm::fabs(*standardised);
            if *weight > 0.0 && !(size <= largest) {
                largest = size;
            }
        }
        largest
    }

    /// Solves with the weight factors; the estimate in the columns of the epoch.
    fn solve(
        &mut self,
        model: &LinearModel,
        unknowns: &Unknowns,
        fit: &mut WeightedFit,
    ) -> Result<[f64; MAX_UNKNOWNS], Igg3Error> {
        let weighted = &mut self.weighted;
        weighted.n = 0;
        weighted.m = unknowns.count();
        let places = weighted
            .design
            .iter_mut()
            .zip(&mut weighted.residual_m)
            .zip(&mut weighted.sigma_m);
        let given = model
            .design
            .iter()
            .zip(&model.residual_m)
            .zip(&model.sigma_m)
            .zip(&self.weights)
            .take(model.n)
            .filter(|(_, weight)| **weight > 0.0);
        for (((design, residual_m), sigma_m), (((row, row_m), row_sigma_m), weight)) in
            places.zip(given)
        {
            *design = [0.0; MAX_UNKNOWNS];
            let columns = row.iter().zip(unknowns.kept).filter(|(_, kept)| *kept);
            for (entry, (value, _)) in design.iter_mut().zip(columns) {
                *entry = *value;
            }
            *residual_m = *row_m;
            *sigma_m = row_sigma_m / libm::sqrt(*weight);
            weighted.n += 1;
        }
        let zeroed = model.n.saturating_sub(weighted.n);
        let breakdown = Igg3Error::Breakdown { zeroed };
        self.qr.factor(weighted).map_err(|_| breakdown)?;
        *fit = WeightedFit {
            sum_of_squares: self.qr.sum_of_squares(),
            rows: model.n,
            rows_kept: weighted.n,
            unknowns: weighted.m,
        };
        let mut estimate = [0.0; MAX_UNKNOWNS];
        let columns = estimate
            .iter_mut()
            .zip(unknowns.kept)
            .filter(|(_, kept)| *kept);
        for ((entry, _), value) in columns.zip(self.qr.estimate()) {
            *entry = value;
        }
        Ok(estimate)
    }
}

/// s of an iterate.
fn scale(config: &Igg3Config, fit: &WeightedFit) -> f64 {
    match config.scale {
        ResidualScale::Prior => 1.0,
        ResidualScale::Posterior => {
            match posterior_factor(fit.sum_of_squares, fit.rows_kept, fit.unknowns) {
                Some(factor) if factor > 1.0 => factor,
                _ => 1.0,
            }
        }
    }
}

/// The columns still solved for, and the rows of constellations that are not.
struct Unknowns {
    kept: [bool; MAX_UNKNOWNS],
    gone: RowSet,
}

impl Unknowns {
    fn all(model: &LinearModel) -> Self {
        let mut kept = [false; MAX_UNKNOWNS];
        for place in kept.iter_mut().take(model.m) {
            *place = true;
        }
        Self {
            kept,
            gone: RowSet::EMPTY,
        }
    }

    fn count(&self) -> usize {
        self.kept.iter().filter(|kept| **kept).count()
    }

    /// Whether the clock of a row is solved for.
    fn has_clock(&self, design: &[f64; MAX_UNKNOWNS]) -> bool {
        design
            .iter()
            .zip(self.kept)
            .skip(3)
            .any(|(entry, kept)| kept && *entry != 0.0)
    }

    /// Drops the clocks whose rows have all lost their weight.
    fn drop_empty(&mut self, model: &LinearModel, weights: &[f64; MAX_SATELLITES]) {
        for column in 3..model.m {
            let rows = || {
                let rows = model.design.iter().zip(weights).take(model.n).enumerate();
                rows.filter(move |(_, (design, _))| {
                    design.get(column).is_some_and(|entry| *entry != 0.0)
                })
            };
            if rows().any(|(_, (_, weight))| *weight > 0.0) {
                continue;
            }
            if let Some(kept) = self.kept.get_mut(column) {
                *kept = false;
            }
            for (row, _) in rows() {
                self.gone = self.gone.with(row);
            }
        }
    }
}

/// Position block of R⁻¹R⁻ᵀ.
fn position_cofactor(qr: &WhitenedQr) -> Matrix3<f64> {
    let mut cofactor = Matrix3::zeros();
    for (i, a) in qr.r_inverse().iter().take(3).enumerate() {
        for (j, b) in qr.r_inverse().iter().take(3).enumerate() {
            let mut sum = 0.0;
            for (x, y) in a.iter().zip(b).take(qr.m()) {
                sum += x * y;
            }
            if let Some(entry) = cofactor.get_mut((i, j)) {
                *entry = sum;
            }
        }
    }
    cofactor
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten satellites of two constellations, directions spread over the sky, no errors.
    fn model() -> LinearModel {
        let mut model = LinearModel::EMPTY;
        (model.n, model.m) = (10, 5);
        for row in 0..10 {
            let azimuth = 2.4 * row as f64;
            let elevation: f64 = 0.2 + 0.13 * row as f64;
            model.design[row] = [
                -azimuth.sin() * elevation.cos(),
                -azimuth.cos() * elevation.cos(),
                -elevation.sin(),
                f64::from(u8::from(row % 2 == 0)),
                f64::from(u8::from(row % 2 == 1)),
                0.0,
            ];
        }
        model
    }

    #[test]
    fn weights_are_those_of_the_scheme_and_nan_has_none() {
        for (standardised, expected) in [
            (0.0, 1.0),
            (1.5, 1.0),
            (2.0, 0.551_020_408_163_265_3),
            (-3.0, 0.163_265_306_122_448_97),
            (4.0, 0.030_612_244_897_959_183),
            (5.0, 0.0),
            (-6.0, 0.0),
        ] {
            assert!((weight(standardised, 1.5, 5.0) - expected).abs() < 1e-15);
        }
        assert_eq!(weight(f64::NAN, 1.5, 5.0), 0.0);
    }

    #[test]
    fn an_outlier_is_taken_out_and_leaves_no_trace() {
        let mut workspace = Igg3Workspace::EMPTY;
        for row in 0..10 {
            let mut model = model();
            model.residual_m[row] = 300.0;
            let robust = workspace.estimate(&model, &Igg3Config::CORRECTED).unwrap();
            assert_eq!(robust.zeroed, RowSet::EMPTY.with(row));
            assert!(robust.position_enu_m.iter().all(|x| x.abs() < 1e-9));
            assert!(robust.kept_outliers.is_empty());
            assert_eq!((robust.fit.rows_kept, robust.fit.unknowns), (9, 5));
        }
    }

    /// INT-132.
    #[test]
    fn no_more_rows_than_the_cap_lose_all_their_weight() {
        let mut workspace = Igg3Workspace::EMPTY;
        let capped = Igg3Config {
            zeroed: ZeroedRows::HalfOfRedundancy { at_most: 1 },
            ..Igg3Config::CORRECTED
        };
        let (mut at_cap, mut with_outlier) = (0, 0);
        for (first, second) in (0..10).flat_map(|a| (0..a).map(move |b| (a, b))) {
            let mut model = model();
            model.residual_m[first] = 60.0;
            model.residual_m[second] = -40.0;
            for (config, cap) in [(Igg3Config::CORRECTED, 2), (capped, 1)] {
                let Ok(robust) = workspace.estimate(&model, &config) else {
                    continue;
                };
                assert!(robust.zeroed.len() <= cap, "{first}, {second}");
                at_cap += usize::from(robust.zeroed.len() == cap);
                with_outlier += usize::from(!robust.kept_outliers.is_empty());
            }
        }
        std::eprintln!("{at_cap} at the cap, {with_outlier} with an outlier");
        assert!(at_cap > 20 && with_outlier > 5);
    }

    #[test]
    fn a_constellation_that_loses_all_its_rows_is_left_out_with_its_clock() {
        let mut model = model();
        // Rows 0 and 2 alone are of a third constellation, and contradict each other.
        model.m = 6;
        for row in [0, 2] {
            model.design[row][3..].copy_from_slice(&[0.0, 0.0, 1.0]);
        }
        model.residual_m[0] = 300.0;
        let mut workspace = Igg3Workspace::EMPTY;
        let robust = workspace.estimate(&model, &Igg3Config::CORRECTED).unwrap();
        assert_eq!(robust.zeroed, RowSet::EMPTY.with(0).with(2));
        assert_eq!((robust.fit.rows_kept, robust.fit.unknowns), (8, 5));
        assert!(robust.position_enu_m.iter().all(|x| x.abs() < 1e-9));
        assert_eq!(workspace.untestable_row(), None);
    }

    #[test]
    fn a_row_that_alone_determines_a_direction_is_named() {
        let mut model = model();
        for row in 1..10 {
            // All the others on one cone around the zenith: up and the clocks are one.
            let azimuth = 0.7 * row as f64;
            model.design[row] = [
                -0.6 * azimuth.sin(),
                -0.6 * azimuth.cos(),
                -0.8,
                1.0,
                0.0,
                0.0,
            ];
        }
        (model.m, model.design[0][3], model.design[0][4]) = (4, 1.0, 0.0);
        let mut workspace = Igg3Workspace::EMPTY;
        workspace.estimate(&model, &Igg3Config::CORRECTED).unwrap();
        assert_eq!(workspace.untestable_row(), Some(0));
    }

    /// INT-133.
    #[test]
    fn what_cannot_be_estimated_is_refused() {
        let mut workspace = Igg3Workspace::EMPTY;
        let good = model();
        for (k0, k1, tolerance_m) in [
            (0.0, 5.0, 1e-4),
            (5.0, 5.0, 1e-4),
            (f64::NAN, 5.0, 1e-4),
            (1.5, f64::INFINITY, 1e-4),
            (1.5, 5.0, 0.0),
        ] {
            let config = Igg3Config {
                k0,
                k1,
                tolerance_m,
                ..Igg3Config::CORRECTED
            };
            let refused = workspace.estimate(&good, &config);
            assert_eq!(refused, Err(Igg3Error::Config));
        }
        let mut poor = model();
        poor.n = 5;
        let refused = workspace.estimate(&poor, &Igg3Config::CORRECTED);
        assert_eq!(refused, Err(Igg3Error::NoRedundancy { n: 5 }));
        assert!(workspace.weights().is_empty());
        for bad in [f64::NAN, f64::INFINITY] {
            let mut broken = model();
            broken.residual_m[4] = bad;
            assert!(workspace.estimate(&broken, &Igg3Config::CORRECTED).is_err());
            let mut broken = model();
            broken.sigma_m[4] = bad;
            assert!(workspace.estimate(&broken, &Igg3Config::CORRECTED).is_err());
        }
    }
}
