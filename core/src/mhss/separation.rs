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
use crate::ekf::Filter;
use crate::ekf::layout::POSITION;
use crate::stats::{StatsError, normal};

/// A variance of a separation below this is rounding, m²: the two filters have used the same
/// measurements, and there is nothing to test.
const MIN_VARIANCE_M2: f64 = 1.0e-10;

/// Distance of two positions and one sigma of it, horizontally along the direction in which it is
/// largest, and vertically.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Distance, m.
    pub distance_m: [f64; 2],
    /// One sigma, m; 0 where the filters know the same.
    pub sigma_m: [f64; 2],
}

/// Horizontal and vertical one sigma of a position, m; horizontally in the worst direction.
pub fn sigmas_m<const K: usize, const M: usize>(
    filter: &Filter<K, M>,
    c_enu_e: &Matrix3<f64>,
) -> [f64; 2] {
    let [horizontal, vertical] = variances(&position_covariance(filter), c_enu_e);
    [root(horizontal, 0.0), root(vertical, 0.0)]
}

fn position_covariance<const K: usize, const M: usize>(filter: &Filter<K, M>) -> Matrix3<f64> {
    let [xx, xy, xz, yy, yz, zz] = filter.block(POSITION);
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

/// Largest eigenvalue of the horizontal part, and the vertical variance.
fn variances(p_e: &Matrix3<f64>, c_enu_e: &Matrix3<f64>) -> [f64; 2] {
    let p = c_enu_e * p_e * c_enu_e.transpose();
    let half = 0.5 * (p.m11 - p.m22);
    let largest = 0.5 * (p.m11 + p.m22) + libm::sqrt(half * half + p.m12 * p.m12);
    [largest, p.m33]
}

/// Root of a variance, 0 where it is not more than `floor`.
fn root(variance: f64, floor: f64) -> f64 {
    if variance > floor {
        libm::sqrt(variance)
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
    let [from, to] = [more, less].map(|filter| {
        let [position, ..] = filter.state().navigation;
        Vector3::from(position)
    });
    let way = c_enu_e * (from - to);
    let [horizontal, vertical] = variances(
        &(position_covariance(less) - position_covariance(more)),
        c_enu_e,
    );
    Spread {
        distance_m: [libm::sqrt(way.x * way.x + way.y * way.y), libm::fabs(way.z)],
        sigma_m: [
            root(horizontal, MIN_VARIANCE_M2),
            root(vertical, MIN_VARIANCE_M2),
        ],
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
}

impl Separation {
    /// No separation.
    pub const ZERO: Self = Self {
        statistic_m: [0.0; 2],
        threshold_m: [0.0; 2],
        uncertainty_m: [0.0; 2],
    };

    /// Whether the test of an axis fails: 0 horizontal, 1 vertical. Where there is nothing to test it
    /// does not; a statistic that is no number fails.
    pub fn fails(&self, axis: usize) -> bool {
        let both = self.statistic_m.get(axis).zip(self.threshold_m.get(axis));
        both.is_some_and(|(statistic, threshold)| {
            *threshold > 0.0 && !(*statistic <= *threshold) || statistic.is_nan()
        })
    }
}

/// Quantiles for every number of satellites in the bank, computed once.
#[derive(Clone, Copy, Debug)]
pub struct SeparationQuantiles {
    /// Q⁻¹(P_FA / 2N) at N − 1.
    detection: [f64; MAX_BANK],
    /// Q⁻¹(P_MD).
    missed: f64,
    /// Q⁻¹(P_H0 / 2).
    fault_free: f64,
}

impl SeparationQuantiles {
    /// Not computed.
    pub const EMPTY: Self = Self {
        detection: [f64::INFINITY; MAX_BANK],
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
