//! Transition matrix and process noise of the error state over the time between two epochs.

use nalgebra::{Matrix3, Vector3};

use super::earth::{gravity_gradient, omega_ie};
use super::filter::{Covariance, Transition, at};
use super::skew;

/// Spectral densities, see `init.csv`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Angle random walk, rad/√s.
    pub arw: f64,
    /// Velocity random walk, m/s/√s.
    pub vrw: f64,
    /// Random walk of the gyroscope bias, rad/s/√s.
    pub gyro_bias_walk: f64,
    /// Random walk of the accelerometer bias, m/s²/√s.
    pub accel_bias_walk: f64,
    /// Clock bias, m²/s, and drift, (m/s)²/s.
    pub clock_psd: [f64; 2],
    /// Decay of the clock drift, 1/s.
    pub clock_decay: f64,
}

/// Φ and Q over any number of substeps.
#[derive(Clone, Debug, PartialEq)]
pub struct Accumulator {
    /// Transition matrix.
    pub phi: Transition,
    /// Process noise.
    pub q: Covariance,
}

/// The error state's F: x' = F x + noise.
pub fn dynamics(
    r: &Vector3<f64>,
    c: &Matrix3<f64>,
    f_e: &Vector3<f64>,
    clock_decay: f64,
) -> Transition {
    let mut f = Transition::zeros();
    let omega = skew(&omega_ie());
    let mut block = |row: usize, column: usize, m: &Matrix3<f64>| {
        f.fixed_view_mut::<3, 3>(row, column).copy_from(m);
    };
    block(at::POS, at::VEL, &Matrix3::identity());
    block(at::VEL, at::POS, &gravity_gradient(r));
    block(at::VEL, at::VEL, &(-2.0 * omega));
    block(at::VEL, at::ATT, &-skew(f_e));
    block(at::VEL, at::BA, c);
    block(at::ATT, at::ATT, &-omega);
    block(at::ATT, at::BG, c);
    f[(at::CLK_B, at::CLK_D)] = 1.0;
    f[(at::CLK_D, at::CLK_D)] = -clock_decay;
    f
}

impl Noise {
    /// The spectral density of the error state. White noise of equal axes looks the same from every
    /// attitude: C (σ² I) Cᵀ = σ² I.
    pub fn density(&self) -> Covariance {
        let squares = [
            (at::VEL, self.vrw),
            (at::ATT, self.arw),
            (at::BG, self.gyro_bias_walk),
            (at::BA, self.accel_bias_walk),
        ];
        let mut density = Covariance::zeros();
        for (start, sigma) in squares {
            for k in start..start + 3 {
                density[(k, k)] = sigma * sigma;
            }
        }
        density[(at::CLK_B, at::CLK_B)] = self.clock_psd[0];
        density[(at::CLK_D, at::CLK_D)] = self.clock_psd[1];
        density
    }
}

impl Accumulator {
    /// No time has passed.
    pub fn identity() -> Self {
        Self {
            phi: Transition::identity(),
            q: Covariance::zeros(),
        }
    }

    /// Adds a substep: second-order Φ, trapezoidal Q.
    pub fn add(&mut self, f: &Transition, density: &Covariance, dt: f64) {
        let step = Transition::identity() + f * dt + f * f * (dt * dt / 2.0);
        let noise = (density + step * density * step.transpose()) * (dt / 2.0);
        self.phi = step * self.phi;
        self.q = step * self.q * step.transpose() + noise;
    }
}
