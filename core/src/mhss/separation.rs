//! How far two filters are apart, and how far noise alone may carry them apart.
//!
//! In: two filters, one with all the measurements of the other and more. Out: [`Spread`], and with the
//! quantiles a statistic, its threshold and its share of a protection level.
//!
//! | symbol | code                | unit | frame | meaning                                          |
//! |--------|---------------------|------|-------|--------------------------------------------------|
//! | dX     | distance            | m    | enu   | horizontal or vertical distance of the positions |
//! | dP     | sigma (its root)    | m    | enu   | covariance of dX: P of the smaller set − P of all|
//! | T      | threshold           | m    |       | √λ(dP) Q⁻¹(P_FA / 2N)                            |
//! | a      | uncertainty         | m    |       | √λ(P) Q⁻¹(P_MD)                                  |
//!
//! Equations: [P0] (27) in the form that holds for an optimal gain, (28), (29), (31), with Q⁻¹ where
//! erf⁻¹ is printed and the positions turned to the local horizontal first.

use nalgebra::{Matrix3, Vector3};

use super::bank::MAX_BANK;
use crate::consts::MAX_CLOCKS;
use crate::ekf::Filter;
use crate::ekf::layout::POSITION;
use crate::stats::{StatsError, normal};

/// A variance of a separation below this is rounding, m²: the two filters have used the same
/// measurements, and there is nothing to test.
const MIN_VARIANCE_M2: f64 = 1.0e-10;

/// Rounding of a square and of what it is compared with, with a wide margin.
const SURE: f64 = 1e-9;

/// Distance of two positions and one sigma of it, horizontally along the direction in which it is
/// largest, and vertically.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Distance, m.
    pub distance_m: [f64; 2],
    /// One sigma, m; 0 where the filters know the same, infinite where they know nothing.
    pub sigma_m: [f64; 2],
}

/// Variances of a position or a separation, m²: horizontal, in the worst direction, and vertical.
pub type Variances = [f64; 2];

/// Variances of a filter's position.
pub fn position_variances<const K: usize, const M: usize>(
    filter: &Filter<K, M>,
    c_enu_e: &Matrix3<f64>,
) -> Variances {
    variances(&position_covariance(filter), c_enu_e)
}

/// The same, and the variances of both horizontal directions together, and vertical.
pub(super) fn position_variances_and_traces<const K: usize, const M: usize>(
    filter: &Filter<K, M>,
    c_enu_e: &Matrix3<f64>,
) -> (Variances, Variances) {
    let p_e = position_covariance(filter);
    let largest = variances(&p_e, c_enu_e);
    let [_, up] = largest;
    (largest, [p_e.trace() - up, up])
}

/// One sigma of a position, m, from its filter's variance and what comes on top of it. Infinite where that is
/// no variance.
pub fn sigmas_of(own: Variances, extra: Variances) -> [f64; 2] {
    let ([own_h, own_v], [extra_h, extra_v]) = (own, extra);
    [own_h + extra_h, own_v + extra_v].map(|variance| {
        if variance >= 0.0 {
            libm::sqrt(variance)
        } else {
            f64::INFINITY
        }
    })
}

/// One sigma of a separation with a variance on top; 0 stays 0 where nothing comes on top.
pub fn widened(sigma_m: [f64; 2], extra: Variances) -> [f64; 2] {
    let ([h, v], [extra_h, extra_v]) = (sigma_m, extra);
    [(h, extra_h), (v, extra_v)].map(|(sigma, extra)| {
        if extra == 0.0 {
            sigma
        } else {
            let variance = sigma * sigma + extra;
            if variance.is_nan() {
                f64::INFINITY
            } else {
                libm::sqrt(variance)
            }
        }
    })
}

/// Horizontal and vertical one sigma of a position, m; horizontally in the worst direction. Infinite where
/// the variance is none.
pub fn sigmas_m<const K: usize, const M: usize>(
    filter: &Filter<K, M>,
    c_enu_e: &Matrix3<f64>,
) -> [f64; 2] {
    sigmas_of(position_variances(filter, c_enu_e), [0.0; 2])
}

fn position_covariance<const K: usize, const M: usize>(filter: &Filter<K, M>) -> Matrix3<f64> {
    let [xx, xy, xz, yy, yz, zz] = filter.block(POSITION);
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

/// East-east, east-north, north-north and up-up of a covariance: of the turned matrix only what is needed.
fn turned(p_e: &Matrix3<f64>, c_enu_e: &Matrix3<f64>) -> [f64; 4] {
    let [east, north, up] = [0, 1, 2].map(|axis| c_enu_e.row(axis).transpose());
    let (of_east, of_north) = (p_e * east, p_e * north);
    [
        of_east.dot(&east),
        of_east.dot(&north),
        of_north.dot(&north),
        up.dot(&(p_e * up)),
    ]
}

/// Largest eigenvalue of the horizontal part, and the vertical variance.
fn variances(p_e: &Matrix3<f64>, c_enu_e: &Matrix3<f64>) -> [f64; 2] {
    let [ee, en, nn, uu] = turned(p_e, c_enu_e);
    let half = 0.5 * (ee - nn);
    let largest = 0.5 * (ee + nn) + libm::sqrt(half * half + en * en);
    [largest, uu]
}

/// Whether a separation, with the variance `extra` on top, is below `quantile` sigmas on both axes by more than
/// rounding. Found without a root and from the vertical direction alone: the largest horizontal variance is at
/// least the mean of both. False where that does not decide it.
pub(super) fn is_surely_quiet<const K: usize, const M: usize>(
    more: &Filter<K, M>,
    less: &Filter<K, M>,
    c_enu_e: &Matrix3<f64>,
    extra: Variances,
    quantile: f64,
) -> bool {
    let [way_x, way_y, way_z] = between(more, less).into();
    let (x, y, z) = (c_enu_e.m31, c_enu_e.m32, c_enu_e.m33);
    let up = x * way_x + y * way_y + z * way_z;
    let whole = way_x * way_x + way_y * way_y + way_z * way_z;
    let mut difference = less.block(POSITION);
    for (entry, of_more) in difference.iter_mut().zip(more.block(POSITION)) {
        *entry -= of_more;
    }
    let [xx, xy, xz, yy, yz, zz] = difference;
    let vertical =
        x * (x * xx + 2.0 * (y * xy + z * xz)) + y * (y * yy + 2.0 * z * yz) + z * z * zz;
    let horizontal = 0.5 * (xx + yy + zz - vertical);
    let [extra_h, extra_v] = extra;
    let is_below = |square: f64, variance: f64, extra: f64| {
        let limit = quantile * quantile * (variance + extra);
        variance > MIN_VARIANCE_M2 && limit.is_finite() && square + SURE * whole <= limit
    };
    is_below(whole - up * up, horizontal, extra_h) && is_below(up * up, vertical, extra_v)
}

/// From the position of `less` to that of `more`.
fn between<const K: usize, const M: usize>(
    more: &Filter<K, M>,
    less: &Filter<K, M>,
) -> Vector3<f64> {
    let [from, to] = [more, less].map(|filter| {
        let [position, ..] = filter.state().navigation;
        Vector3::from(position)
    });
    from - to
}

/// One sigma of a separation, 0 where there is nothing to test, infinite where its variance is no number.
fn sigma_of_separation(variance: f64) -> f64 {
    if variance > MIN_VARIANCE_M2 {
        libm::sqrt(variance)
    } else if variance.is_nan() {
        f64::INFINITY
    } else {
        0.0
    }
}

/// The spread of `less`, which lacks some of the measurements of `more`.
pub fn spread<const K: usize, const M: usize>(
    more: &Filter<K, M>,
    less: &Filter<K, M>,
    c_enu_e: &Matrix3<f64>,
) -> Spread {
    let way = c_enu_e * between(more, less);
    let difference = position_covariance(less) - position_covariance(more);
    Spread {
        distance_m: [libm::sqrt(way.x * way.x + way.y * way.y), libm::fabs(way.z)],
        sigma_m: variances(&difference, c_enu_e).map(sigma_of_separation),
    }
}

/// One sub-filter's test and its share of the levels, horizontal and vertical.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Separation {
    /// Statistic d, m.
    pub statistic_m: [f64; 2],
    /// Threshold T, m; 0 where there is nothing to test.
    pub threshold_m: [f64; 2],
    /// Uncertainty a of the sub-filter, m.
    pub uncertainty_m: [f64; 2],
    /// One sigma of the sub-filter's position, m.
    pub sigma_m: [f64; 2],
}

impl Separation {
    /// No separation.
    pub const ZERO: Self = Self {
        statistic_m: [0.0; 2],
        threshold_m: [0.0; 2],
        uncertainty_m: [0.0; 2],
        sigma_m: [0.0; 2],
    };

    /// Whether the horizontal test fails, or the vertical one where that counts.
    pub fn is_failed(&self, vertical: bool) -> bool {
        self.fails(0) || vertical && self.fails(1)
    }

    /// Whether the test of an axis fails: 0 horizontal, 1 vertical. Where there is nothing to test it
    /// does not; what is not finite fails.
    pub fn fails(&self, axis: usize) -> bool {
        let both = self.statistic_m.get(axis).zip(self.threshold_m.get(axis));
        both.is_some_and(|(statistic, threshold)| {
            *threshold > 0.0 && !(*statistic <= *threshold)
                || !statistic.is_finite()
                || !threshold.is_finite()
        })
    }
}

/// Most tests of an epoch: one per satellite, one per constellation.
pub const MAX_TESTS: usize = MAX_BANK + MAX_CLOCKS;

/// Quantiles for every number of tests in the bank, computed once.
#[derive(Clone, Copy, Debug)]
pub struct SeparationQuantiles {
    /// Q⁻¹(P_FA / 2N) at N − 1.
    detection: [f64; MAX_TESTS],
    /// Q⁻¹(P_MD).
    missed: f64,
    /// Q⁻¹(P_H0 / 2).
    fault_free: f64,
}

impl SeparationQuantiles {
    /// Not computed.
    pub const EMPTY: Self = Self {
        detection: [f64::INFINITY; MAX_TESTS],
        missed: f64::INFINITY,
        fault_free: f64::INFINITY,
    };

    /// For a false-alert probability per sample, a missed-detection probability and a fault-free risk.
    ///
    /// # Errors
    /// [`StatsError`] when one of them is no probability; nothing has changed then.
    pub fn fill(&mut self, p_fa: f64, p_md: f64, p_h0: f64) -> Result<(), StatsError> {
        let mut filled = Self::EMPTY;
        for (n, quantile) in (1_u8..).zip(&mut filled.detection) {
            *quantile = normal::upper_quantile(p_fa / (2.0 * f64::from(n)))?;
        }
        filled.missed = normal::upper_quantile(p_md)?;
        filled.fault_free = normal::upper_quantile(0.5 * p_h0)?;
        *self = filled;
        Ok(())
    }

    /// Q⁻¹(P_FA / 2N); infinite for a number of satellites that no bank has.
    pub fn detection(&self, n: usize) -> f64 {
        self.detection
            .get(n.wrapping_sub(1))
            .copied()
            .unwrap_or(f64::INFINITY)
    }

    /// Q⁻¹(P_MD).
    pub const fn missed(&self) -> f64 {
        self.missed
    }

    /// Q⁻¹(P_H0 / 2).
    pub const fn fault_free(&self) -> f64 {
        self.fault_free
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type TestFilter = Filter<2, 8>;

    fn filter(position: [f64; 3], block: [f64; 6]) -> TestFilter {
        let mut filter = TestFilter::EMPTY;
        let mut blocks = [[0.0; 6]; 5];
        blocks[POSITION] = block;
        filter.start(&blocks, &[0.0; 2]);
        let mut moved = *filter.state();
        moved.navigation[POSITION] = position.map(|x| -x);
        filter.rereference(&moved);
        filter
    }

    #[test]
    fn sigma_is_that_of_the_worst_horizontal_direction() {
        // [2 1; 1 2] has the eigenvalues 1 and 3.
        let less = filter([3.0, 4.0, -2.0], [4.0, 1.0, 0.0, 4.0, 0.0, 9.0]);
        let more = filter([0.0; 3], [2.0, 0.0, 0.0, 2.0, 0.0, 5.0]);
        let spread = spread(&more, &less, &Matrix3::identity());
        assert_eq!(spread.distance_m, [5.0, 2.0]);
        assert!((spread.sigma_m[0] - 3.0_f64.sqrt()).abs() < 1e-15);
        assert_eq!(spread.sigma_m[1], 2.0);
        let own = sigmas_m(&less, &Matrix3::identity());
        assert_eq!(own, [5.0_f64.sqrt(), 3.0]);
    }

    #[test]
    fn what_is_surely_quiet_passes_its_test() {
        let identity = Matrix3::identity();
        let more = filter([0.0; 3], [0.0; 6]);
        let quiet = |position: [f64; 3], block: [f64; 6], extra: Variances| {
            let less = filter(position, block);
            let surely = is_surely_quiet(&more, &less, &identity, extra, 2.0);
            let spread = spread(&more, &less, &identity);
            let separation = Separation {
                statistic_m: spread.distance_m,
                threshold_m: widened(spread.sigma_m, extra).map(|sigma| 2.0 * sigma),
                ..Separation::ZERO
            };
            assert!(!surely || !separation.is_failed(true));
            surely
        };
        // Two sigmas are √10 or more horizontally and 6 vertically.
        let block = [4.0, 1.0, 0.0, 1.0, 0.0, 9.0];
        assert!(quiet([3.0, 0.9, 5.9], block, [0.0; 2]));
        assert!(!quiet([3.0, 1.1, 5.9], block, [0.0; 2]));
        assert!(quiet([3.0, 1.1, 5.9], block, [1.0, 0.0]));
        assert!(!quiet([3.0, 0.9, 6.1], block, [0.0; 2]));
        assert!(quiet([3.0, 0.9, 6.1], block, [0.0, 1.0]));
        assert!(!quiet([0.0; 3], [0.0; 6], [1.0; 2]));
        for bad in [f64::NAN, f64::INFINITY] {
            assert!(!quiet([bad, 0.0, 0.0], block, [0.0; 2]));
            assert!(!quiet([0.0; 3], [bad; 6], [0.0; 2]));
            assert!(!quiet([0.0; 3], block, [bad; 2]));
        }
    }

    #[test]
    fn positions_are_turned_to_the_local_horizontal() {
        // East, north and up are y, z and x: at latitude and longitude 0.
        let c_enu_e = Matrix3::new(0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0);
        let less = filter([7.0, 3.0, 4.0], [9.0, 0.0, 0.0, 4.0, 0.0, 1.0]);
        let spread = spread(&filter([0.0; 3], [0.0; 6]), &less, &c_enu_e);
        assert_eq!(spread.distance_m, [5.0, 7.0]);
        assert_eq!(spread.sigma_m, [2.0, 3.0]);
    }

    #[test]
    fn a_test_fails_above_its_threshold_and_on_what_is_no_number() {
        let test = |statistic: f64, threshold: f64| {
            let separation = Separation {
                statistic_m: [0.0, statistic],
                threshold_m: [1.0, threshold],
                ..Separation::ZERO
            };
            assert!(!separation.fails(0) && !separation.fails(2));
            separation.fails(1)
        };
        assert!(!test(1.0, 1.0));
        assert!(test(1.1, 1.0));
        assert!(!test(1.1, 0.0));
        for bad in [f64::NAN, f64::INFINITY] {
            assert!(test(bad, 1.0) && test(bad, 0.0) && test(0.0, bad));
        }
    }

    #[test]
    fn a_covariance_that_is_none_has_no_finite_sigma() {
        let none = filter([1.0, 0.0, 0.0], [f64::NAN; 6]);
        let negative = filter([1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, -1.0, 0.0, -1.0]);
        let known = filter([0.0; 3], [1.0, 0.0, 0.0, 1.0, 0.0, 1.0]);
        let identity = Matrix3::identity();
        assert_eq!(spread(&known, &none, &identity).sigma_m, [f64::INFINITY; 2]);
        assert_eq!(sigmas_m(&none, &identity), [f64::INFINITY; 2]);
        assert_eq!(sigmas_m(&negative, &identity), [f64::INFINITY; 2]);
        assert_eq!(spread(&known, &negative, &identity).sigma_m, [0.0; 2]);
    }

    #[test]
    fn quantiles_are_those_of_the_allocated_risks() {
        let mut quantiles = SeparationQuantiles::EMPTY;
        assert_eq!(quantiles.detection(1), f64::INFINITY);
        quantiles.fill(3.33e-7, 1e-3, 1e-7).unwrap();
        // [P0]'s numbers with Q⁻¹ in place of erf⁻¹.
        assert!((quantiles.detection(8) - 5.48).abs() < 5e-3);
        assert!((quantiles.missed() - 3.090).abs() < 5e-4);
        assert!((quantiles.fault_free() - 5.327).abs() < 5e-4);
        for n in 1..MAX_BANK {
            assert!(quantiles.detection(n) < quantiles.detection(n + 1));
        }
        assert_eq!(quantiles.detection(0), f64::INFINITY);
        assert_eq!(quantiles.detection(MAX_TESTS + 1), f64::INFINITY);
        let before = quantiles.detection(8);
        for (p_fa, p_md, p_h0) in [(0.0, 0.1, 0.1), (0.1, 1.0, 0.1), (0.1, 0.1, f64::NAN)] {
            assert!(quantiles.fill(p_fa, p_md, p_h0).is_err());
        }
        assert_eq!(quantiles.detection(8), before);
    }
}
