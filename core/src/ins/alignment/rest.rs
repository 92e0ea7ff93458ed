//! Whether the unit stands still, by its own samples, and their means since it does.
//!
//! In: increments as they come. Out: mean specific force and angular rate over the time at rest, or since
//! when it moves. Whether the receiver agrees is for the caller to ask: a unit cannot tell rest from smooth
//! motion at constant velocity.
//!
//! | symbol | code                    | unit         | frame | meaning                                     |
//! |--------|-------------------------|--------------|-------|---------------------------------------------|
//! | f̄, ω̄  | `force_b`, `rate_b`     | m/s², rad/s  | b     | means since rest began                      |
//! | T      | `duration_s`            | s            |       | how long that is                            |
//! | s_f, s_ω |                       | m/s², rad/s  |       | scatter of samples in a window, all axes    |
//! | N_f, N_ω | `noise.vrw`, `noise.arw` |           |       | white noise of the unit                     |
//!
//! A window of [`WINDOW_S`] is one of rest when its samples scatter no more than three times the unit's
//! white noise and a floor, its mean force is as long as gravity and its mean rate as short as a bias, each
//! within [`SIGMAS`] sigmas; and when its means are those of the windows before it. The last is what sees
//! slow tilting: the difference of two means knows nothing of the bias. Derived here.
//! Assumes: what turns the unit by less than [`FORCE_FLOOR_MPS2`] over g within a window (50 µrad), and
//! ever so slowly, is not seen.

use super::UnitErrors;
use crate::ins::Increment;
use nalgebra::Vector3;

/// Length of a window, s.
const WINDOW_S: f64 = 1.0;
/// Deviations up to this many sigmas are chance: of three axes one window in 65,000 is taken for motion.
const SIGMAS: f64 = 5.0;
/// Scatter of specific force that a vehicle at rest may have whatever its unit's noise, m/s²: an idling
/// engine, people who get in.
const SCATTER_FORCE_MPS2: f64 = 0.05;
/// The same of the rate, rad/s.
const SCATTER_RATE_RADPS: f64 = 0.003;
/// Mean gravity, m/s², and how far it lies from that anywhere near the ground.
const GRAVITY_MPS2: f64 = 9.806;
/// See [`GRAVITY_MPS2`].
const GRAVITY_SPREAD_MPS2: f64 = 0.05;
/// Rotation of the Earth and what a vehicle on its springs still turns in a window, rad/s.
const RATE_SPREAD_RADPS: f64 = 5.0e-4;
/// Means of windows may differ by this besides their noise, m/s².
const FORCE_FLOOR_MPS2: f64 = 5.0e-4;
/// The same, rad/s.
const RATE_FLOOR_RADPS: f64 = 5.0e-5;

const ZERO: Vector3<f64> = Vector3::new(0.0, 0.0, 0.0);

/// Sums of one window.
#[derive(Clone, Copy, Debug)]
struct Window {
    dv_b: Vector3<f64>,
    dtheta_b: Vector3<f64>,
    force_squared: f64,
    rate_squared: f64,
    length_s: f64,
    samples: f64,
}

impl Window {
    const EMPTY: Self = Self {
        dv_b: ZERO,
        dtheta_b: ZERO,
        force_squared: 0.0,
        rate_squared: 0.0,
        length_s: 0.0,
        samples: 0.0,
    };

    fn add(&mut self, increment: &Increment) {
        let per_s = 1.0 / increment.dt_s;
        self.dv_b += increment.dv_b;
        self.dtheta_b += increment.dtheta_b;
        self.force_squared += increment.dv_b.norm_squared() * per_s;
        self.rate_squared += increment.dtheta_b.norm_squared() * per_s;
        self.length_s += increment.dt_s;
        self.samples += 1.0;
    }
}

/// How long the unit has been at rest, and its means.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rest {
    window: Window,
    dv_b: Vector3<f64>,
    dtheta_b: Vector3<f64>,
    length_s: f64,
}

impl Rest {
    pub(super) const NONE: Self = Self {
        window: Window::EMPTY,
        dv_b: ZERO,
        dtheta_b: ZERO,
        length_s: 0.0,
    };

    /// Takes an increment; true when it ends a window of rest, false when one of motion, `None` else.
    pub(super) fn add(&mut self, increment: &Increment, unit: &UnitErrors) -> Option<bool> {
        if !(increment.dt_s > 0.0) {
            return None;
        }
        self.window.add(increment);
        if self.window.length_s < WINDOW_S - 0.5 * increment.dt_s {
            return None;
        }
        let window = core::mem::replace(&mut self.window, Window::EMPTY);
        let is_at_rest = self.is_still(&window, unit);
        if is_at_rest {
            self.dv_b += window.dv_b;
            self.dtheta_b += window.dtheta_b;
            self.length_s += window.length_s;
        } else {
            *self = Self::NONE;
        }
        Some(is_at_rest)
    }

    fn is_still(&self, window: &Window, unit: &UnitErrors) -> bool {
        let noise = &unit.noise;
        let (length_s, samples) = (window.length_s, window.samples);
        let dt_s = length_s / samples;
        let (force_b, rate_b) = (window.dv_b / length_s, window.dtheta_b / length_s);
        // Mean squares about the mean, all three axes together.
        let force_scatter = window.force_squared / length_s - force_b.norm_squared();
        let rate_scatter = window.rate_squared / length_s - rate_b.norm_squared();
        let scatter_limit = |density: f64, floor: f64| {
            let white = 3.0 * density;
            3.0 * (white * white / dt_s + floor * floor)
        };
        // Of one axis, and of the largest of three: √3.
        let chance = |sigma: f64| SIGMAS * sigma;
        let white = |density: f64| density / libm::sqrt(length_s);
        let force_length = force_b.norm();
        let mut is_still = force_scatter <= scatter_limit(noise.vrw, SCATTER_FORCE_MPS2)
            && rate_scatter <= scatter_limit(noise.arw, SCATTER_RATE_RADPS)
            && libm::fabs(force_length - GRAVITY_MPS2)
                <= GRAVITY_SPREAD_MPS2 + chance(unit.accel_bias_mps2 + white(noise.vrw))
            && rate_b.norm() <= RATE_SPREAD_RADPS + chance(unit.gyro_bias_radps + white(noise.arw));
        if self.length_s > 0.0 {
            let (mean_force_b, mean_rate_b) = self.means();
            // Of a difference of two means, and what the bias walked since the middle of the longer one.
            let spread = |density: f64, walk: f64| {
                density * libm::sqrt(1.0 / length_s + 1.0 / self.length_s)
                    + walk * libm::sqrt(self.length_s)
            };
            is_still = is_still
                && (force_b - mean_force_b).norm()
                    <= FORCE_FLOOR_MPS2 + chance(spread(noise.vrw, noise.accel_bias_walk))
                && (rate_b - mean_rate_b).norm()
                    <= RATE_FLOOR_RADPS + chance(spread(noise.arw, noise.gyro_bias_walk));
        }
        is_still
    }

    /// Mean specific force, m/s², and rate, rad/s; of no use before there was a window.
    pub(super) fn means(&self) -> (Vector3<f64>, Vector3<f64>) {
        (self.dv_b / self.length_s, self.dtheta_b / self.length_s)
    }

    /// How long it has been at rest, s: whole windows.
    pub(super) const fn duration_s(&self) -> f64 {
        self.length_s
    }

    /// One sigma of the mean specific force, per axis, m/s²: bias, the mean of its walk, noise.
    pub(super) fn sigma_force_mps2(&self, unit: &UnitErrors) -> f64 {
        let noise = &unit.noise;
        self.sigma(unit.accel_bias_mps2, noise.accel_bias_walk, noise.vrw)
    }

    /// The same of the mean rate, rad/s.
    pub(super) fn sigma_rate_radps(&self, unit: &UnitErrors) -> f64 {
        let noise = &unit.noise;
        self.sigma(unit.gyro_bias_radps, noise.gyro_bias_walk, noise.arw)
    }

    /// A random walk has a mean over T of variance walk² T/3.
    fn sigma(&self, bias: f64, walk: f64, density: f64) -> f64 {
        let t_s = self.length_s;
        libm::sqrt(bias * bias + walk * walk * t_s / 3.0 + density * density / t_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ins::InertialNoise;

    const TACTICAL: UnitErrors = UnitErrors {
        noise: InertialNoise {
            arw: 2.9e-5,
            vrw: 4.9e-4,
            gyro_bias_walk: 8.4e-8,
            accel_bias_walk: 2.8e-5,
        },
        gyro_bias_radps: 4.8e-6,
        accel_bias_mps2: 0.0098,
    };

    fn sample(force_x: f64, rate_x: f64) -> Increment {
        Increment {
            dtheta_b: Vector3::new(rate_x, 5e-5, -5e-5) * 0.01,
            dv_b: Vector3::new(force_x, 0.2, -9.8) * 0.01,
            dt_s: 0.01,
        }
    }

    /// Whole windows of which the last was one of rest, s.
    fn rested(seconds: i32, of: impl Fn(f64) -> Increment) -> f64 {
        let mut rest = Rest::NONE;
        for k in 0..seconds * 100 {
            rest.add(&of(f64::from(k) * 0.01), &TACTICAL);
        }
        rest.duration_s()
    }

    #[test]
    fn a_unit_that_stands_rests_since_its_first_window() {
        assert!((rested(20, |_| sample(0.1, 0.0)) - 20.0).abs() < 1e-6);
        let shaken = |t: f64| sample(0.1 + 0.04 * libm::sin(100.0 * t), 0.0);
        assert!((rested(20, shaken) - 20.0).abs() < 1e-6);
    }

    #[test]
    fn what_moves_does_not_rest() {
        assert_eq!(rested(20, |t| sample(libm::sin(7.0 * t), 0.0)), 0.0);
        assert_eq!(rested(20, |t| sample(0.1, 0.05 * libm::sin(7.0 * t))), 0.0);
        // Turning, falling, no numbers.
        assert_eq!(rested(20, |_| sample(0.1, 0.01)), 0.0);
        assert_eq!(rested(20, |_| sample(5.0, 0.0)), 0.0);
        assert_eq!(rested(20, |_| sample(f64::NAN, 0.0)), 0.0);
        assert_eq!(rested(20, |_| sample(0.1, f64::INFINITY)), 0.0);
    }

    #[test]
    fn slow_tilting_ends_rest_though_every_window_is_quiet() {
        // 0.1 mrad/s; a gyroscope bias hides it, gravity does not.
        let tilting = |t: f64| sample(0.1 + 9.8 * 1e-4 * t, 1e-4);
        assert!(rested(60, tilting) < 10.0);
    }

    #[test]
    fn the_means_are_of_the_time_at_rest_only() {
        let mut rest = Rest::NONE;
        for k in 0..1000 {
            let force_x = if k < 500 {
                3.0 * libm::sin(f64::from(k))
            } else {
                0.3
            };
            rest.add(&sample(force_x, 0.0), &TACTICAL);
        }
        assert!((rest.duration_s() - 5.0).abs() < 1e-6);
        let (force_b, rate_b) = rest.means();
        assert!((force_b - Vector3::new(0.3, 0.2, -9.8)).norm() < 1e-9);
        assert!((rate_b - Vector3::new(0.0, 5e-5, -5e-5)).norm() < 1e-12);
    }
}
