//! Small fixed-capacity linear algebra that can say no.

pub mod block3;
pub mod qr;

use crate::consts::{MAX_SATELLITES, MAX_UNKNOWNS};

/// A linearised epoch: residual = design × unknowns + error, one row per satellite.
///
/// Rows `0..n` and columns `0..m` count; the rest is not read. Columns: east, north, up of the
/// position, then one per receiver clock, in the order of [`crate::gnss::System::ALL`] among the
/// constellations present.
#[derive(Clone, Debug)]
pub struct LinearModel {
    /// Satellites, at most [`MAX_SATELLITES`].
    pub n: usize,
    /// Unknowns, at most [`MAX_UNKNOWNS`].
    pub m: usize,
    /// Derivatives of the pseudorange, n × m: −u_E, −u_N, −u_U (u from user to satellite), then 1 in
    /// the clock column of the satellite's constellation, 0 in the others.
    pub design: [[f64; MAX_UNKNOWNS]; MAX_SATELLITES],
    /// Measured minus predicted pseudorange, n, m.
    pub residual_m: [f64; MAX_SATELLITES],
    /// One-sigma error of each pseudorange, n, m, positive.
    pub sigma_m: [f64; MAX_SATELLITES],
}

impl LinearModel {
    /// No rows.
    pub const EMPTY: Self = Self {
        n: 0,
        m: 0,
        design: [[0.0; MAX_UNKNOWNS]; MAX_SATELLITES],
        residual_m: [0.0; MAX_SATELLITES],
        sigma_m: [1.0; MAX_SATELLITES],
    };
}
