//! The dense filter: prediction and scalar updates of a full covariance.

use nalgebra::{SMatrix, SVector, Vector3};

/// States.
pub const STATES: usize = 17;

/// Where the states stand.
pub mod at {
    /// Position.
    pub const POS: usize = 0;
    /// Velocity.
    pub const VEL: usize = 3;
    /// Attitude.
    pub const ATT: usize = 6;
    /// Gyroscope bias.
    pub const BG: usize = 9;
    /// Accelerometer bias.
    pub const BA: usize = 12;
    /// Clock bias.
    pub const CLK_B: usize = 15;
    /// Clock drift.
    pub const CLK_D: usize = 16;
}

/// Error state.
pub type ErrorState = SVector<f64, STATES>;
/// Its covariance.
pub type Covariance = SMatrix<f64, STATES, STATES>;
/// Matrix that takes an error state to a later time.
pub type Transition = SMatrix<f64, STATES, STATES>;

/// One scalar measurement: z = predicted − measured = h x + noise of variance `variance`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row<const N: usize = STATES> {
    /// Row of the measurement matrix.
    pub h: SVector<f64, N>,
    /// Predicted minus measured.
    pub z: f64,
    /// Variance of the noise.
    pub variance: f64,
}

/// The filter.
#[derive(Clone, Debug, PartialEq)]
pub struct DenseFilter<const N: usize = STATES> {
    /// Error state; 0 after each feedback.
    pub x: SVector<f64, N>,
    /// Covariance.
    pub p: SMatrix<f64, N, N>,
}

impl<const N: usize> DenseFilter<N> {
    /// x ← Φ x, P ← Φ P Φᵀ + Q.
    pub fn predict(&mut self, phi: &SMatrix<f64, N, N>, q: &SMatrix<f64, N, N>) {
        self.x = phi * self.x;
        self.p = phi * self.p * phi.transpose() + q;
        self.p = (self.p + self.p.transpose()) / 2.0;
    }

    /// One scalar update with the optimal gain.
    pub fn update(&mut self, row: &Row<N>) {
        let innovation = row.z - row.h.dot(&self.x);
        let ph = self.p * row.h;
        let s = row.h.dot(&ph) + row.variance;
        let gain = ph / s;
        self.x += gain * innovation;
        self.p -= gain * ph.transpose();
        self.p = (self.p + self.p.transpose()) / 2.0;
    }
}

/// The rows of one satellite: pseudorange, then range rate, at the antenna's position, velocity and
/// clock.
pub fn rows(
    (r, v): (&Vector3<f64>, &Vector3<f64>),
    clock: [f64; 2],
    satellite: &Satellite,
) -> [Row; 2] {
    let difference = r - satellite.r;
    let range = difference.norm();
    let e = difference / range;
    let w = v - satellite.v;
    let rate = e.dot(&w);
    let mut pseudorange = ErrorState::zeros();
    pseudorange.fixed_rows_mut::<3>(at::POS).copy_from(&e);
    pseudorange[at::CLK_B] = 1.0;
    let mut range_rate = ErrorState::zeros();
    let turn = (w - e * rate) / range;
    range_rate.fixed_rows_mut::<3>(at::POS).copy_from(&turn);
    range_rate.fixed_rows_mut::<3>(at::VEL).copy_from(&e);
    range_rate[at::CLK_D] = 1.0;
    [
        Row {
            h: pseudorange,
            z: range + clock[0] - satellite.pseudorange,
            variance: satellite.sigmas[0].powi(2),
        },
        Row {
            h: range_rate,
            z: rate + clock[1] - satellite.range_rate,
            variance: satellite.sigmas[1].powi(2),
        },
    ]
}

/// One satellite of an epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Satellite {
    /// Position at transmission, ECEF of reception, m.
    pub r: Vector3<f64>,
    /// Velocity against the Earth, m/s.
    pub v: Vector3<f64>,
    /// Pseudorange, m.
    pub pseudorange: f64,
    /// Range rate, m/s.
    pub range_rate: f64,
    /// One sigma of the two, m and m/s.
    pub sigmas: [f64; 2],
}
