//! How far an inertial solution drifts by itself, by the single-channel theory of Schuler's pendulum.
//!
//! In: noise of the unit, uncertainty of the start. Out: one sigma of a horizontal axis.
//!
//! A level platform at rest, one horizontal channel, with ω = √(g/R): the position answers after a
//! time τ
//!
//! | to                        | by                      |
//! |---------------------------|-------------------------|
//! | a velocity error          | sin ωτ / ω              |
//! | a tilt                    | g (1 − cos ωτ) / ω²     |
//! | an accelerometer bias     | (1 − cos ωτ) / ω²       |
//! | a gyroscope bias          | g (τ − sin ωτ / ω) / ω² |
//!
//! White noise and random walks are the same answers to what arrives all the time, squared and
//! integrated. [GROVES-2013] chapter 5 and [P0] say the same in other words. Left out: the turning of the
//! Earth under the platform, 4 % of an angle in ten minutes.

use super::trial::{Grade, Start};

/// Gravity, m/s², and radius of the Earth, m.
const G: f64 = 9.80;
const RADIUS_M: f64 = 6_371_000.0;

/// Steps of the integrals.
const STEPS: usize = 2000;

/// One sigma of a horizontal axis `t_s` after the start, m.
pub fn theory(grade: &Grade, start: &Start, t_s: f64) -> f64 {
    let omega = (G / RADIUS_M).sqrt();
    let to_velocity = |tau: f64| (omega * tau).sin() / omega;
    let to_acceleration = |tau: f64| (1.0 - (omega * tau).cos()) / (omega * omega);
    let to_tilt = |tau: f64| G * to_acceleration(tau);
    let to_rate = |tau: f64| G * (tau - to_velocity(tau)) / (omega * omega);
    // ∫ h(τ)² dτ by the middles of the steps.
    let power = |answer: &dyn Fn(f64) -> f64| {
        let step = t_s / STEPS as f64;
        let middles = (0..STEPS).map(|k| (k as f64 + 0.5) * step);
        middles.map(|tau| answer(tau).powi(2) * step).sum::<f64>()
    };
    let noise = &grade.noise;
    let [tilt, _] = start.attitude_rad;
    let variance = (start.position_m * (omega * t_s).cos()).powi(2)
        + (start.velocity_mps * to_velocity(t_s)).powi(2)
        + (tilt * to_tilt(t_s)).powi(2)
        + (grade.sigma_accel_bias * to_acceleration(t_s)).powi(2)
        + (grade.sigma_gyro_bias * to_rate(t_s)).powi(2)
        + noise.vrw.powi(2) * power(&to_velocity)
        + noise.arw.powi(2) * power(&to_tilt)
        + noise.accel_bias_walk.powi(2) * power(&to_acceleration)
        + noise.gyro_bias_walk.powi(2) * power(&to_rate);
    variance.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_drifts_are_those_of_a_flat_earth() {
        let start = Start {
            position_m: 0.0,
            velocity_mps: 0.1,
            attitude_rad: [1e-4, 0.0],
        };
        let grade = Grade::MEMS;
        let t = 10.0_f64;
        let noise = &grade.noise;
        let variance = (0.1 * t).powi(2)
            + (G * 1e-4 * t.powi(2) / 2.0).powi(2)
            + (grade.sigma_accel_bias * t.powi(2) / 2.0).powi(2)
            + (G * grade.sigma_gyro_bias * t.powi(3) / 6.0).powi(2)
            + noise.vrw.powi(2) * t.powi(3) / 3.0
            + (G * noise.arw).powi(2) * t.powi(5) / 20.0
            + noise.accel_bias_walk.powi(2) * t.powi(5) / 20.0
            + (G * noise.gyro_bias_walk).powi(2) * t.powi(7) / 252.0;
        let flat = variance.sqrt();
        assert!((theory(&grade, &start, t) / flat - 1.0).abs() < 1e-4);
    }
}
