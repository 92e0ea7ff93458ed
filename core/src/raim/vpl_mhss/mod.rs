//! Vertical protection levels of all satellites and of all but one: the set that leaves out the faulty one
//! has the smallest.
//!
//! In: a factored epoch, its sensitivities, residuals. Out: [`VplTest`]: the level of the full set, whether
//! it is larger than healthy satellites can make it, and which satellite to leave out, if that is certain.
//!
//! | symbol | code | unit | meaning |
//! |--------|------|------|---------|
//! | g, d, r | `gain_enu_m`, `cofactor`, `residual` | m, 1, 1 | leverage, S_ii, whitened residual of a row |
//! | S_ij   | `shared` | 1 | entry of the projector onto the residuals, −q_i·q_j |
//! | s_i    | `separation_m` | m | height of all minus height without i: g_i r_i/d_i |
//! | s_ij   | | m | height without i minus height without i and j |
//! | σ_i, σ_ij | `sigma_m` | m | spread of the height without i, without i and j |
//! | VPL    | `vpl_m` | m | of all: max_i abs(s_i) + k_v σ_i; without i: max_j abs(s_ij) + k_v σ_ij |
//! | k_v    | `k_vertical` | 1 | Q⁻¹(p/2); 5.33 for 1e-7 |
//! | K      | `k_detection` | 1 | Q⁻¹(P/4N), P the false-alarm probability |
//! | K'     | `k_exclusion` | 1 | Q⁻¹(P/4N²) |
//!
//! Source: [P4] 2.1, (2) to (6); rows left out by rank-one updates, Sherman and Morrison [GOLUB-VANLOAN]. Keys:
//! docs/references.md. Derivation of threshold and margin: docs/decisions/021-vpl-separation.md.
//!
//! Departures. Weights are 1/σ² and the separation in (5) is the measured one (ERRATA). A set's level is the
//! largest over its own hypotheses "one of its satellites is faulty", which bounds the error under each. As
//! printed the set of smallest level wins: without a fault that is another than the full one in up to half of
//! all epochs. Here the full set fails if its level exceeds T = max_i (k_v σ_i + K σ(s_i)), which N normal
//! variables do with at most P/2. Satellite i is left out only if the level shrinks by more than a *margin*:
//! with j the hypothesis that sets the full set's level,
//!
//! margin = k_v (σ_j − σ_ij) + K' σ(s_j − s_ij), for j = i: k_v (σ_i − max σ_ij) + K' σ(s_i), at least 0,
//!
//! because the set without i has at least abs(s_ij) + k_v σ_ij, and N² normal variables exceed K' with at
//! most P/2. What remains must pass its own T.
//!
//! Assumes: errors independent between satellites, sigmas that bound them, one faulty satellite. Sees only
//! what moves the height: a fault without leverage on it is neither detected nor of consequence there.
//! Cost: N²/2 pairs, each one division and some 50 operations, and a root where a level grows.

mod factors;
mod leave_out;

use super::slope::{Sensitivity, semi_major_axis_m};
use super::{RaimError, parity};
use crate::consts::MAX_SATELLITES;
use crate::linalg::LinearModel;
use crate::linalg::qr::WhitenedQr;
use crate::stats::StatsError;
use factors::VplFactors;
use leave_out::{LeftOut, Row, all_pairs, are_testable, moves, shared};
use nalgebra::{Matrix3, Vector3};

/// A set that lacks one satellite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Without {
    /// Row of that satellite.
    pub row: usize,
    /// Vertical level of the set, m.
    pub vpl_m: f64,
    /// What healthy satellites of the set keep it below, m.
    pub threshold_m: f64,
    /// By how much it has to lie below the level of the full set, m.
    pub margin_m: f64,
}

/// What the levels of an epoch say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VplTest {
    /// Vertical level of the full set, m.
    pub vpl_m: f64,
    /// T: what healthy satellites keep it below, m.
    pub threshold_m: f64,
    /// A row that moves the position and whose fault separates nothing: the level does not cover it.
    pub untestable: Option<usize>,
    /// The set of the smallest level, if any has one.
    pub smallest: Option<Without>,
}

impl VplTest {
    /// Whether the full set is as healthy satellites leave it; NaN is not.
    pub fn passes(&self) -> bool {
        self.vpl_m <= self.threshold_m && self.excluded().is_none()
    }

    /// The row to leave out: the level shrinks by more than the margin, and the rest passes.
    pub fn excluded(&self) -> Option<usize> {
        let without = self.smallest?;
        let is_certain =
            self.vpl_m - without.vpl_m > without.margin_m && without.vpl_m <= without.threshold_m;
        is_certain.then_some(without.row)
    }

    /// The row that the printed rule leaves out: that of the smallest level, if it is smaller than that of the
    /// full set. [P4] 2.1
    pub fn excluded_as_printed(&self) -> Option<usize> {
        let without = self.smallest?;
        (without.vpl_m < self.vpl_m).then_some(without.row)
    }
}

/// Levels of all sets, and their memory (13 kB).
#[derive(Clone, Debug)]
pub struct VplSeparation {
    factors: VplFactors,
    qr: WhitenedQr,
    sensitivity: Sensitivity,
    residuals: [f64; MAX_SATELLITES],
    n: usize,
    rows: [Row; MAX_SATELLITES],
    covariance_enu_m2: Matrix3<f64>,
}

impl VplSeparation {
    /// Nothing computed; without [`VplSeparation::configure`] every epoch fails its test.
    pub const EMPTY: Self = Self {
        factors: VplFactors::EMPTY,
        qr: WhitenedQr::EMPTY,
        sensitivity: Sensitivity::EMPTY,
        residuals: [0.0; MAX_SATELLITES],
        n: 0,
        rows: [Row::EMPTY; MAX_SATELLITES],
        covariance_enu_m2: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    };

    /// Computes the factors of the probability that an error exceeds its level under any of the hypotheses,
    /// and of a false alarm or false exclusion in an epoch.
    ///
    /// # Errors
    /// [`StatsError`] for a probability outside (0, 1).
    #[inline(never)]
    pub fn configure(&mut self, p_level: f64, p_false_alarm: f64) -> Result<(), StatsError> {
        self.factors.fill(p_level, p_false_alarm)
    }

    /// Factors the epoch and computes the levels of all sets. After [`RaimError::NoRedundancy`] the position is
    /// there, and nothing to test it with.
    ///
    /// # Errors
    /// [`RaimError`].
    #[inline(never)]
    pub fn test(&mut self, model: &LinearModel) -> Result<VplTest, RaimError> {
        self.n = 0;
        parity::test(model, &mut self.qr)?;
        self.sensitivity.fill(&mut self.qr);
        self.qr.residuals(&mut self.residuals);
        self.n = self.qr.n();
        self.covariance_enu_m2 = Matrix3::zeros();
        for leverage in self.sensitivity.leverage() {
            let gain = Vector3::from(*leverage);
            self.covariance_enu_m2 += gain * gain.transpose();
        }
        let given = self
            .sensitivity
            .leverage()
            .iter()
            .zip(self.sensitivity.residual_cofactor());
        let places = self.rows.iter_mut().zip(&self.residuals);
        for ((row, residual), (leverage, cofactor)) in places.zip(given) {
            *row = Row::new(*leverage, *cofactor, *residual, self.covariance_enu_m2.m33);
        }
        let k_vertical = self.factors.k_vertical;
        if let Some(rows) = self.rows.get_mut(..self.n) {
            match self.qr.m() {
                4 => all_pairs::<4>(rows, self.qr.thin_q(), k_vertical),
                5 => all_pairs::<5>(rows, self.qr.thin_q(), k_vertical),
                _ => all_pairs::<6>(rows, self.qr.thin_q(), k_vertical),
            }
        }
        Ok(self.conclude())
    }

    fn rows(&self) -> &[Row] {
        self.rows.get(..self.n).unwrap_or(&[])
    }

    fn row(&self, index: usize) -> Option<&Row> {
        self.rows().get(index)
    }

    /// S_ij.
    fn shared(&self, first: usize, second: usize) -> f64 {
        let thin_q = self.qr.thin_q();
        let (Some(a), Some(b)) = (thin_q.get(first), thin_q.get(second)) else {
            return f64::NAN;
        };
        match self.qr.m() {
            4 => shared::<4>(a, b),
            5 => shared::<5>(a, b),
            _ => shared::<6>(a, b),
        }
    }

    /// The hypotheses that a set of satellites is tested against, with their rows: of all, or of all but `out`.
    fn hypotheses(&self, out: Option<usize>) -> impl Iterator<Item = (usize, LeftOut)> + '_ {
        let lacking = out.and_then(|index| Some((index, self.row(index)?)));
        let rows = self.rows().iter().enumerate();
        rows.filter_map(move |(index, row)| match lacking {
            None => row.is_testable.then(|| (index, row.alone())),
            Some((missing, _)) if missing == index => None,
            Some((missing, lacking)) => {
                let shared = self.shared(missing, index);
                let determinant = lacking.cofactor * row.cofactor - shared * shared;
                are_testable(lacking, row, determinant).then(|| (index, row.given(lacking, shared)))
            }
        })
    }

    /// Variance of the height of all, or of all but `out`.
    fn variance_m2(&self, out: Option<usize>) -> f64 {
        out.map_or(self.covariance_enu_m2.m33, |index| {
            self.row(index).map_or(f64::NAN, |row| row.variance_m2)
        })
    }

    /// T of all, or of all but `out`.
    fn threshold_m(&self, out: Option<usize>) -> f64 {
        let rows = self.n.saturating_sub(usize::from(out.is_some()));
        let k_detection = self.factors.detection(rows);
        let variance_m2 = self.variance_m2(out);
        let mut threshold_m = 0.0;
        for (_, hypothesis) in self.hypotheses(out) {
            let sigma_m = hypothesis.separation_sigma_m();
            let spread_m = libm::sqrt(variance_m2 + sigma_m * sigma_m);
            let healthy_m = self.factors.k_vertical * spread_m + k_detection * sigma_m;
            if healthy_m > threshold_m {
                threshold_m = healthy_m;
            }
        }
        threshold_m
    }

    fn conclude(&self) -> VplTest {
        let mut test = VplTest {
            vpl_m: 0.0,
            threshold_m: self.threshold_m(None),
            untestable: None,
            smallest: None,
        };
        let mut worst = 0;
        let mut smallest: Option<(usize, f64)> = None;
        for (index, row) in self.rows().iter().enumerate() {
            if !row.is_testable {
                if moves(&row.gain_enu_m) && test.untestable.is_none() {
                    test.untestable = Some(index);
                }
                continue;
            }
            let [_, _, separation_m] = row.alone().separation_enu_m();
            let level_m =
                libm::fabs(separation_m) + self.factors.k_vertical * libm::sqrt(row.variance_m2);
            let is_smaller = level_m <= test.vpl_m;
            if !is_smaller {
                test.vpl_m = level_m;
                worst = index;
            }
            // Infinite and NaN are no levels.
            let is_smallest = smallest.is_none_or(|(_, least_m)| row.vpl_m < least_m);
            if row.vpl_m > 0.0 && row.vpl_m < f64::INFINITY && is_smallest {
                smallest = Some((index, row.vpl_m));
            }
        }
        test.smallest = smallest.and_then(|(row, vpl_m)| {
            Some(Without {
                row,
                vpl_m,
                threshold_m: self.threshold_m(Some(row)),
                margin_m: self.margin_m(row, worst)?,
            })
        });
        test
    }

    /// By how much the level without `out` has to be below that of all, which hypothesis `worst` sets.
    fn margin_m(&self, out: usize, worst: usize) -> Option<f64> {
        let (lacking, row) = (self.row(out)?, self.row(worst)?);
        let sigma_m = libm::sqrt(row.variance_m2);
        let (remaining_m, separation_sigma_m) = if out == worst {
            (
                libm::sqrt(lacking.largest_variance_m2),
                lacking.alone().separation_sigma_m(),
            )
        } else {
            let shared = self.shared(out, worst);
            let hypothesis = row.given(lacking, shared);
            let [_, _, gain] = hypothesis.gain_enu_m;
            let [_, _, ratio] = row.gain_ratio_enu_m;
            let ratio_without = gain * hypothesis.inverse_cofactor;
            // s_j − s_ij as a sum of the two residuals' errors, whose covariance is S.
            let (own, other) = (
                ratio - ratio_without,
                ratio_without * shared / lacking.cofactor,
            );
            let variance_m2 = own * own * row.cofactor
                + 2.0 * own * other * shared
                + other * other * lacking.cofactor;
            let remaining_m2 = lacking.variance_m2 + gain * ratio_without;
            (libm::sqrt(remaining_m2), libm::sqrt(variance_m2))
        };
        let margin_m = self.factors.k_vertical * (sigma_m - remaining_m)
            + self.factors.exclusion(self.n) * separation_sigma_m;
        // NaN stays, and excludes nothing.
        Some(if margin_m < 0.0 { 0.0 } else { margin_m })
    }

    /// k_v.
    pub fn k_vertical(&self) -> f64 {
        self.factors.k_vertical
    }

    /// Spread of the height of all satellites, m.
    pub fn sigma_up_m(&self) -> f64 {
        libm::sqrt(self.covariance_enu_m2.m33)
    }

    /// Vertical level of the set without each row, m; infinite where it has none.
    pub fn levels_without_m(&self) -> impl Iterator<Item = f64> + '_ {
        self.rows().iter().map(|row| {
            if row.is_testable && row.vpl_m > 0.0 {
                row.vpl_m
            } else {
                f64::INFINITY
            }
        })
    }

    /// Horizontal level of all, or of all but `out`, m, by the same rule as the vertical one: separation plus
    /// √(−2 ln p) times the semi-major axis. [P4] has none.
    #[inline(never)]
    pub fn hpl_m(&self, out: Option<usize>) -> f64 {
        let mut covariance_enu_m2 = self.covariance_enu_m2;
        let add = |hypothesis: &LeftOut, to: Matrix3<f64>| {
            let gain = Vector3::from(hypothesis.gain_enu_m);
            to + gain * gain.transpose() * hypothesis.inverse_cofactor
        };
        if let Some(lacking) = out.and_then(|index| self.row(index)) {
            covariance_enu_m2 = add(&lacking.alone(), covariance_enu_m2);
        }
        let mut hpl_m = 0.0;
        for (_, hypothesis) in self.hypotheses(out) {
            let [east, north, _] = hypothesis.separation_enu_m();
            let semi_major_m = semi_major_axis_m(&add(&hypothesis, covariance_enu_m2));
            let level_m =
                libm::sqrt(east * east + north * north) + self.factors.k_horizontal * semi_major_m;
            let is_smaller = level_m <= hpl_m;
            if !is_smaller {
                hpl_m = level_m;
            }
        }
        hpl_m
    }

    /// Position of all, or of all but `out`, minus the point of linearisation, m.
    pub fn position_enu_m(&self, out: Option<usize>) -> [f64; 3] {
        let [east, north, up, ..] = self.qr.estimate();
        let mut position = [east, north, up];
        if let Some(row) = out.and_then(|index| self.row(index)) {
            let separation = row.alone().separation_enu_m();
            for (entry, separation) in position.iter_mut().zip(separation) {
                *entry -= separation;
            }
        }
        position
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nine directions, one clock, sigma 1 m; residuals of small errors.
    fn epoch() -> LinearModel {
        let mut model = LinearModel::EMPTY;
        (model.n, model.m) = (9, 4);
        for row in 0..9 {
            let azimuth = 2.4 * row as f64;
            let elevation = 0.2 + 0.14 * ((row * 4) % 9) as f64;
            model.design[row][0] = -azimuth.sin() * elevation.cos();
            model.design[row][1] = -azimuth.cos() * elevation.cos();
            model.design[row][2] = -elevation.sin();
            model.design[row][3] = 1.0;
            model.residual_m[row] = 0.5 * (3.0 * row as f64).sin();
        }
        model
    }

    fn configured() -> VplSeparation {
        let mut separation = VplSeparation::EMPTY;
        separation.configure(1e-7, 1e-5).unwrap();
        separation
    }

    #[test]
    fn a_large_error_is_left_out_whichever_row_it_is_on() {
        let mut separation = configured();
        for row in 0..9 {
            for bias_m in [-80.0, 80.0] {
                let mut model = epoch();
                let healthy = separation.test(&model).unwrap();
                assert!(healthy.passes(), "{healthy:?}");
                assert_eq!(healthy.excluded(), None);
                model.residual_m[row] += bias_m;
                let test = separation.test(&model).unwrap();
                assert_eq!(test.excluded(), Some(row), "{test:?}");
                assert!(!test.passes());
            }
        }
    }

    #[test]
    fn the_height_without_the_faulty_row_does_not_know_of_it() {
        let mut separation = configured();
        let mut positions = [0.0, 60.0].map(|bias_m| {
            let mut model = epoch();
            model.residual_m[4] += bias_m;
            separation.test(&model).unwrap();
            let levels = [
                separation.hpl_m(Some(4)),
                separation.levels_without_m().nth(4).unwrap(),
            ];
            (separation.position_enu_m(Some(4)), levels)
        });
        let (expected, levels) = positions[0];
        for (found, expected) in positions[1].0.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12);
        }
        for (found, expected) in positions[1].1.iter_mut().zip(levels) {
            assert!((*found - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn one_redundant_row_detects_and_leaves_nothing_out() {
        let mut separation = configured();
        let mut model = epoch();
        model.n = 5;
        assert!(separation.test(&model).unwrap().passes());
        model.residual_m[0] += 1000.0;
        let test = separation.test(&model).unwrap();
        assert!(!test.passes());
        assert_eq!(test.smallest, None);
        assert!(
            separation
                .levels_without_m()
                .all(|level| level == f64::INFINITY)
        );
    }

    #[test]
    fn without_redundancy_there_is_a_position_and_no_test() {
        let mut separation = configured();
        let mut model = epoch();
        model.n = 4;
        assert_eq!(
            separation.test(&model),
            Err(RaimError::NoRedundancy { n: 4 })
        );
        assert!(separation.position_enu_m(None).iter().all(|x| *x != 0.0));
    }

    #[test]
    fn what_was_not_configured_passes_nothing() {
        let mut separation = VplSeparation::EMPTY;
        let test = separation.test(&epoch()).unwrap();
        assert!(test.vpl_m > test.threshold_m && !test.passes());
    }

    #[test]
    fn levels_that_are_no_numbers_exclude_nothing() {
        let without = Without {
            row: 3,
            vpl_m: 1.0,
            threshold_m: 10.0,
            margin_m: 1.0,
        };
        let test = VplTest {
            vpl_m: 20.0,
            threshold_m: 10.0,
            untestable: None,
            smallest: Some(without),
        };
        assert_eq!(test.excluded(), Some(3));
        for spoil in [
            |t: &mut Without| t.vpl_m = f64::NAN,
            |t: &mut Without| t.threshold_m = f64::NAN,
            |t: &mut Without| t.margin_m = f64::NAN,
        ] {
            let mut spoiled = without;
            spoil(&mut spoiled);
            let smallest = Some(spoiled);
            assert_eq!(VplTest { smallest, ..test }.excluded(), None);
        }
        for vpl_m in [f64::NAN, f64::INFINITY] {
            assert!(!VplTest { vpl_m, ..test }.passes());
        }
    }
}
