//! The bank as a textbook writes it: a dense filter per hypothesis, each with its own prediction and one
//! scalar update per measurement that it keeps. A peer of core's, in the same image, for few satellites.

use super::dense::{Matrix, PlainFilter, PlainRow, ZERO};
use nalgebra::Matrix3;

/// Most satellites.
pub const MAX: usize = 8;
const FILTERS: usize = 1 + MAX + MAX * (MAX - 1) / 2;

/// All filters, the main one first, then those without one satellite, then those without two.
pub struct DenseBank {
    phi: Matrix,
    noise: Matrix,
    product: Matrix,
    rows: [[PlainRow; 2]; MAX],
    filters: [PlainFilter; FILTERS],
}

impl DenseBank {
    pub const EMPTY: Self = Self {
        phi: ZERO,
        noise: ZERO,
        product: ZERO,
        rows: [[PlainRow::NONE; 2]; MAX],
        filters: [PlainFilter::EMPTY; FILTERS],
    };

    /// Φ and Q, and where all filters start from.
    pub fn start(&mut self, phi: &Matrix, noise: &Matrix, covariance: &Matrix) {
        self.phi = *phi;
        self.noise = *noise;
        for filter in &mut self.filters {
            filter.covariance = *covariance;
            filter.state.fill(0.0);
        }
    }

    /// Pseudorange and range rate of a satellite at the next epoch.
    pub fn set_rows(&mut self, satellite: usize, rows: [PlainRow; 2]) {
        self.rows[satellite] = rows;
    }

    pub fn main(&self) -> &PlainFilter {
        &self.filters[0]
    }

    /// The filter without the last two of `n` satellites.
    pub fn last_pair(&self, n: usize) -> &PlainFilter {
        &self.filters[n + n * (n - 1) / 2]
    }

    /// An epoch with `n` satellites: every filter, the tests of those without one satellite, the correction of
    /// the nominal. Gives the largest T + a, horizontal and vertical.
    #[inline(never)]
    pub fn epoch(&mut self, n: usize, c_enu_e: &Matrix3<f64>, quantiles: [f64; 2]) -> [f64; 2] {
        let mut filters = self.filters.iter_mut();
        let mut run = |without: [usize; 2]| {
            if let Some(filter) = filters.next() {
                filter.predict(&self.phi, &self.noise, &mut self.product);
                for (satellite, rows) in self.rows.iter().take(n).enumerate() {
                    if !without.contains(&satellite) {
                        rows.iter().for_each(|row| filter.take(row));
                    }
                }
            }
        };
        run([MAX; 2]);
        for one in 0..n {
            run([one, MAX]);
        }
        for one in 0..n {
            for other in one + 1..n {
                run([one, other]);
            }
        }
        let levels = self.levels(n, c_enu_e, quantiles);
        let [main, others @ ..] = &mut self.filters;
        for filter in others {
            for (entry, by) in filter.state.iter_mut().zip(&main.state) {
                *entry -= by;
            }
        }
        main.state.fill(0.0);
        levels
    }

    fn levels(&self, n: usize, c_enu_e: &Matrix3<f64>, quantiles: [f64; 2]) -> [f64; 2] {
        let [k_detection, k_missed] = quantiles;
        let [main, others @ ..] = &self.filters;
        let mut levels = [0.0; 2];
        for filter in others.iter().take(n) {
            let own = sigmas(c_enu_e, |i, j| filter.covariance[i][j]);
            let apart = sigmas(c_enu_e, |i, j| {
                filter.covariance[i][j] - main.covariance[i][j]
            });
            for (level, (own, apart)) in levels.iter_mut().zip(own.into_iter().zip(apart)) {
                let sum = k_missed * own + k_detection * apart;
                if sum > *level {
                    *level = sum;
                }
            }
        }
        levels
    }
}

/// Horizontal and vertical sigma of a covariance of the position.
fn sigmas(c_enu_e: &Matrix3<f64>, covariance: impl Fn(usize, usize) -> f64) -> [f64; 2] {
    let p = c_enu_e * Matrix3::from_fn(covariance) * c_enu_e.transpose();
    let half = 0.5 * (p.m11 - p.m22);
    let largest = 0.5 * (p.m11 + p.m22) + libm::sqrt(half * half + p.m12 * p.m12);
    [libm::sqrt(largest), libm::sqrt(p.m33)]
}
