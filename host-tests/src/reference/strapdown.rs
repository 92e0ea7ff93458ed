//! Strapdown navigation in ECEF from increments of angle and velocity.
//!
//! Two-sample coning and sculling: Savage's form with the increments of this interval and the one
//! before.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::earth::{gravity, omega_ie};

/// Estimates of everything the error state has an entry for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nominal {
    /// Position, ECEF, m.
    pub r: Vector3<f64>,
    /// Velocity against the Earth, ECEF, m/s.
    pub v: Vector3<f64>,
    /// Rotation from body to ECEF.
    pub c: Matrix3<f64>,
    /// Gyroscope bias, rad/s.
    pub bg: Vector3<f64>,
    /// Accelerometer bias, m/s².
    pub ba: Vector3<f64>,
    /// Clock bias, m, and drift, m/s.
    pub clock: [f64; 2],
}

/// What the sensors integrated over an interval, biases included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Increment {
    /// Angle, rad.
    pub dtheta: Vector3<f64>,
    /// Velocity, m/s.
    pub dv: Vector3<f64>,
    /// Length of the interval, s.
    pub dt: f64,
}

/// Strapdown navigation.
#[derive(Clone, Debug)]
pub struct Strapdown {
    /// The solution.
    pub nominal: Nominal,
    /// Increments of the interval before, corrected by the biases of then; 0 at the start.
    previous: (Vector3<f64>, Vector3<f64>),
}

/// What the error state's transition needs of an interval.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// Specific force of the interval times its length, ECEF, m/s.
    pub dv_e: Vector3<f64>,
    /// Attitude before the interval.
    pub c_before: Matrix3<f64>,
}

/// Rotation by a vector.
pub fn rotation(phi: Vector3<f64>) -> Matrix3<f64> {
    Rotation3::from_scaled_axis(phi).into_inner()
}

impl Strapdown {
    /// Starts from a solution.
    pub fn new(nominal: Nominal) -> Self {
        let previous = (Vector3::zeros(), Vector3::zeros());
        Self { nominal, previous }
    }

    /// Takes the increments of one interval.
    pub fn step(&mut self, increment: &Increment) -> Step {
        let dt = increment.dt;
        let n = &mut self.nominal;
        let dtheta = increment.dtheta - n.bg * dt;
        let dv = increment.dv - n.ba * dt;
        let (dtheta_1, dv_1) = self.previous;
        self.previous = (dtheta, dv);

        let coning = dtheta_1.cross(&dtheta) / 12.0;
        let rotated = dtheta.cross(&dv) / 2.0;
        let sculling = (dtheta_1.cross(&dv) + dv_1.cross(&dtheta)) / 12.0;
        let dv_b = dv + rotated + sculling;

        let c_before = n.c;
        // The Earth turns by half its angle until the middle of the interval.
        let half_turn = rotation(-omega_ie() * (dt / 2.0));
        let dv_e = half_turn * c_before * dv_b;
        let r_middle = n.r + n.v * (dt / 2.0);
        // Coriolis with the velocity of the middle of the interval, from a step of half length.
        let other = |v: &Vector3<f64>| gravity(&r_middle) - 2.0 * omega_ie().cross(v);
        let v_middle = n.v + (dv_e + other(&n.v) * dt) / 2.0;
        let v = n.v + dv_e + other(&v_middle) * dt;
        n.r += (n.v + v) * (dt / 2.0);
        n.v = v;
        n.c = rotation(-omega_ie() * dt) * c_before * rotation(dtheta + coning);
        Step { dv_e, c_before }
    }
}
