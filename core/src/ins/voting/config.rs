//! What must be known of each of several inertial units.
//!
//! A vote compares what units measure, so that besides noise it has to be known how far healthy units
//! may lie apart: first biases, scale factors with misalignments, time stamps.

use crate::ins::sample::{INTERVAL_NS, MAX_LEVER_ARM_M, is_rotation};
use crate::ins::{InertialConfigError, InertialNoise, SensorRange};

/// Largest scale error or misalignment that is one of a measuring instrument.
const MAX_SCALE: f64 = 0.1;
/// Time stamps that are off by more than this cannot be compared, s.
const MAX_TIMING_S: f64 = 0.02;

/// What a healthy unit may be off by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitTolerance {
    /// One sigma of the first bias of a gyroscope, rad/s.
    pub gyro_bias_radps: f64,
    /// One sigma of the first bias of an accelerometer, m/s².
    pub accel_bias_mps2: f64,
    /// One sigma of the scale factor and of the misalignment of its axes, as a ratio.
    pub scale: f64,
    /// Most that its time stamps are off by, s.
    pub timing_s: f64,
}

/// One of several units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitConfig {
    /// Nominal sample interval, ns; 2.5 to 20 ms.
    pub interval_ns: u32,
    /// Rotation from the unit's axes to the body's (C^b_s), rows of the matrix.
    pub c_b_s: [[f64; 3]; 3],
    /// From the point of the body for which the vote speaks to the unit, body axes, m.
    pub lever_arm_b_m: [f64; 3],
    /// Noise of the sensors.
    pub noise: InertialNoise,
    /// Range of the sensors; a sample at or beyond it is saturated.
    pub range: SensorRange,
    /// What it may be off by while healthy.
    pub tolerance: UnitTolerance,
}

impl UnitConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`InertialConfigError`], the first found.
    pub fn check(&self) -> Result<(), InertialConfigError> {
        if !INTERVAL_NS.contains(&self.interval_ns) {
            return Err(InertialConfigError::Interval {
                interval_ns: self.interval_ns,
            });
        }
        if !is_rotation(&self.c_b_s) {
            return Err(InertialConfigError::Mounting);
        }
        let [x, y, z] = self.lever_arm_b_m;
        if !(x * x + y * y + z * z <= MAX_LEVER_ARM_M * MAX_LEVER_ARM_M) {
            return Err(InertialConfigError::LeverArm);
        }
        let UnitTolerance {
            gyro_bias_radps,
            accel_bias_mps2,
            scale,
            timing_s,
        } = self.tolerance;
        // Noise is what the thresholds are made of: there is no vote between units without.
        let positive = [
            self.noise.arw,
            self.noise.vrw,
            self.range.rate_radps,
            self.range.specific_force_mps2,
        ];
        let not_negative = [
            self.noise.gyro_bias_walk,
            self.noise.accel_bias_walk,
            gyro_bias_radps,
            accel_bias_mps2,
            scale,
            timing_s,
            MAX_SCALE - scale,
            MAX_TIMING_S - timing_s,
        ];
        for value in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(InertialConfigError::NotPositive { value });
            }
        }
        for value in not_negative {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(InertialConfigError::NotPositive { value });
            }
        }
        Ok(())
    }
}
