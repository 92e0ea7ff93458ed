//! The range rates of an epoch: velocity, its spread, and the rows that a monitor tests.
//!
//! In: the satellites of the last position. Out: velocity and clock drift by weighted least squares, and the
//! same rows as a linear model.
//!
//! | symbol | code         | unit | frame | meaning                                               |
//! |--------|--------------|------|-------|-------------------------------------------------------|
//! | u      | direction_e  | 1    | e     | receiver to satellite, times the factor of its rate   |
//! | y      | value_mps    | m/s  |       | measured − predicted for a receiver at rest, drift left in |
//! | σ      | sigma_mps    | m/s  |       | one sigma of the range rate                           |
//!
//! Equations: y = −u·v + drift + error, linear in the velocity, so that nothing is iterated; what a receiver
//! at rest sees and the factor: [`satellite_range_rate`]. One oscillator drifts against all systems
//! alike: one clock whatever the constellations. Sigmas: `weights.rs`.

use heapless::Vec;
use nalgebra::{Matrix3, Vector3};

use super::{Normals, SnapshotWorkspace, UsedRow};
use crate::consts::{MAX_SATELLITES, MAX_UNKNOWNS};
use crate::frames::geodesy;
use crate::gnss::measurement::{range_geometry, satellite_range_rate};
use crate::gnss::weights::{RowSigma, range_rate_sigma_mps};
use crate::linalg::LinearModel;

/// Velocity and clock drift have so many unknowns.
const UNKNOWNS: usize = 4;

/// A range rate of the last position's satellites.
struct Rate {
    used: UsedRow,
    direction_e: [f64; 3],
    value_mps: f64,
    sigma_mps: f64,
}

/// How well range rates agree with the velocity by them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RateFit {
    /// Weighted sum of squared residuals: chi-square with `redundancy` degrees of freedom when no range rate
    /// is faulty, 1.
    pub sum_of_squares: f64,
    /// Range rates beyond four, at least 1.
    pub redundancy: usize,
}

/// Velocity and clock drift of an epoch.
pub(super) struct RateSolution {
    pub v_e_mps: Vector3<f64>,
    pub clock_drift_mps: f64,
    /// `None` without redundancy.
    pub fit: Option<RateFit>,
}

/// The range rates of an epoch, linearised at rest: an estimate from them is the velocity itself.
#[derive(Clone, Debug)]
pub struct RangeRates {
    /// Derivatives by the velocity (east, north, up) and by the clock drift; m/s where it says m.
    pub model: LinearModel,
    /// Of which satellite each row is, and its sigma, m/s where it says m.
    pub rows: Vec<UsedRow, MAX_SATELLITES>,
}

impl RangeRates {
    /// No rows.
    pub const EMPTY: Self = Self {
        model: LinearModel::EMPTY,
        rows: Vec::new(),
    };
}

impl SnapshotWorkspace {
    /// The range rates of the satellites used; none without a position.
    fn rates(&self) -> impl Iterator<Item = Rate> + '_ {
        let seen = self.sky_at.into_iter();
        seen.flat_map(move |r_e| {
            self.used().filter_map(move |row| {
                let rate_mps = row.measurement.range_rate_mps?;
                let geometry = range_geometry(row.measurement.r_e_m, r_e);
                let (at_rest_mps, factor) = satellite_range_rate(&row.measurement, &geometry);
                let sigma_mps = range_rate_sigma_mps(row.sky.sin_elevation);
                Some(Rate {
                    used: UsedRow {
                        sigma: RowSigma {
                            independent_m: sigma_mps,
                            common_m: 0.0,
                        },
                        ..row.described()
                    },
                    direction_e: geometry.line_of_sight_e.map(|u| u * factor),
                    value_mps: rate_mps + row.measurement.clock_drift_mps - at_rest_mps,
                    sigma_mps,
                })
            })
        })
    }

    /// The range rates as normal equations, their sum of weighted squares, and how many they are; `None` with
    /// fewer than four.
    fn rate_normals(&self) -> Option<(Normals, f64, usize)> {
        let mut normals = Normals::ZERO;
        let mut sum_of_squares = 0.0;
        let mut count = 0;
        for rate in self.rates() {
            let weight = 1.0 / (rate.sigma_mps * rate.sigma_mps);
            normals.add(rate.direction_e, 0, rate.value_mps, weight);
            sum_of_squares += weight * rate.value_mps * rate.value_mps;
            count += 1;
        }
        (count >= UNKNOWNS).then_some((normals, sum_of_squares, count))
    }

    /// Velocity and receiver clock drift from the range rates of the rows used.
    pub(super) fn velocity(&self) -> Option<RateSolution> {
        let (normals, sum_of_squares, count) = self.rate_normals()?;
        let estimate = normals.solve()?;
        let redundancy = count.saturating_sub(UNKNOWNS);
        Some(RateSolution {
            v_e_mps: Vector3::from(estimate.position),
            clock_drift_mps: estimate.clocks.first().copied().flatten()?,
            fit: (redundancy > 0).then(|| RateFit {
                // Rounding leaves 1e-5 of it where the clock drifts by 3 km/s, and a threshold is above 20.
                sum_of_squares: sum_of_squares - normals.explained(&estimate),
                redundancy,
            }),
        })
    }

    /// One sigma of the velocity east, north, up by the model of the range rates, m/s; `None` where there is
    /// none.
    pub fn velocity_sigma_enu_mps(&self) -> Option<[f64; 3]> {
        let c_enu_e = self.c_enu_e()?;
        let covariance = Matrix3::from(self.rate_normals()?.0.covariance()?);
        let [[e, ..], [_, n, _], [.., u]] = (c_enu_e * covariance * c_enu_e.transpose()).into();
        Some([libm::sqrt(e), libm::sqrt(n), libm::sqrt(u)])
    }

    /// The range rates of the last solution as rows, for [`crate::raim::monitors::doppler`]. None without a
    /// position.
    pub fn range_rates(&self, out: &mut RangeRates) {
        let RangeRates { model, rows } = out;
        model.n = 0;
        model.m = 0;
        rows.clear();
        let Some(c_enu_e) = self.c_enu_e() else {
            return;
        };
        let places = model
            .design
            .iter_mut()
            .zip(&mut model.residual_m)
            .zip(&mut model.sigma_m);
        for (rate, ((design, residual_mps), sigma_mps)) in self.rates().zip(places) {
            let [east, north, up] = (c_enu_e * Vector3::from(rate.direction_e)).into();
            *design = [0.0; MAX_UNKNOWNS];
            for (entry, value) in design.iter_mut().zip([-east, -north, -up, 1.0]) {
                *entry = value;
            }
            *residual_mps = rate.value_mps;
            *sigma_mps = rate.sigma_mps;
            // As many rows as the model has, so it fits.
            let _ = rows.push(rate.used);
        }
        model.n = rows.len();
        model.m = UNKNOWNS;
    }

    fn c_enu_e(&self) -> Option<Matrix3<f64>> {
        let llh = geodesy::to_llh(&Vector3::from(self.sky_at?)).ok()?;
        Some(geodesy::c_enu_e(llh.lat_rad, llh.lon_rad))
    }
}
