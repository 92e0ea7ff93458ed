//! What an inertial unit gives, and what must be known of it.
//!
//! Densities are those of the continuous white noise: an angle random walk of `arw` rad/√s makes an
//! angle uncertain by `arw`·√t after t seconds. Model: [P0] (6)-(8), as corrected in
//! docs/decisions/005-tight-filter.md.

use super::alignment::MAX_HEADING_SIGMA_RAD;
use crate::time::GpsTime;

/// One sample: what gyroscopes and accelerometers integrated over `(time − interval, time]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuSample {
    /// End of the interval.
    pub time: GpsTime,
    /// Length of the interval, ns.
    pub interval_ns: u32,
    /// Integral of the angular rate against inertial space, in the unit's axes, rad.
    pub dtheta_is_s_rad: [f64; 3],
    /// Integral of the specific force, in the unit's (turning) axes, m/s.
    pub dv_is_s_mps: [f64; 3],
}

/// White noise and bias random walks of a unit, per axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InertialNoise {
    /// Angle random walk, rad/√s.
    pub arw: f64,
    /// Velocity random walk, m/s/√s.
    pub vrw: f64,
    /// Random walk of the gyroscope bias, rad/s/√s.
    pub gyro_bias_walk: f64,
    /// Random walk of the accelerometer bias, m/s²/√s.
    pub accel_bias_walk: f64,
}

/// Noise of the receiver clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockNoise {
    /// Spectral density of the bias, m²/s.
    pub bias_psd: f64,
    /// Spectral density of the drift, (m/s)²/s.
    pub drift_psd: f64,
    /// Decay of the drift, 1/s; 0 for a random walk.
    pub drift_decay_per_s: f64,
    /// Spectral density of the offsets between systems, m²/s.
    pub inter_system_psd: f64,
}

/// Largest magnitudes a unit can measure, per axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorRange {
    /// Angular rate, rad/s.
    pub rate_radps: f64,
    /// Specific force, m/s².
    pub specific_force_mps2: f64,
}

/// What the measurements of this receiver, where it is, scatter in a filter against the model of
/// `gnss/weights.rs`: factors on one sigma.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasurementFactors {
    /// On pseudoranges.
    pub pseudorange: f64,
    /// On range rates.
    pub range_rate: f64,
}

impl MeasurementFactors {
    /// As the model says.
    pub const ONE: Self = Self {
        pseudorange: 1.0,
        range_rate: 1.0,
    };
}

/// Where the first attitude comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AttitudeStart {
    /// Roll and pitch from the accelerometers, heading from the course over ground as soon as it is
    /// moving at this speed: for vehicles that move where they point.
    Course {
        /// Least horizontal speed, m/s.
        min_speed_mps: f64,
    },
    /// Known: attitude of the body against north, east, down at the first position.
    Given {
        /// Roll, pitch, heading, rad.
        roll_pitch_heading_rad: [f64; 3],
    },
    /// At rest: roll and pitch from the accelerometers, heading from the rotation of the Earth. For units of
    /// tactical grade and better.
    Gyrocompass {
        /// Largest one sigma of the heading to start with, rad.
        max_heading_sigma_rad: f64,
    },
    /// Roll and pitch from the accelerometers, heading from the field that the magnetometer feels, at rest or in
    /// motion. Nothing is told of the filter before motion has confirmed the heading.
    MagneticField,
    /// From the course when it is moving at this speed, at rest from the rotation of the Earth where the unit is
    /// good enough, else from the magnetic field where there is a magnetometer: whatever comes first.
    Automatic {
        /// Least horizontal speed for a course, m/s.
        min_speed_mps: f64,
        /// Largest one sigma of a heading by the rotation of the Earth, rad.
        max_heading_sigma_rad: f64,
    },
}

/// Everything to be known of an inertial unit, its mounting and the receiver's clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InertialConfig {
    /// Nominal sample interval, ns; 2.5 to 20 ms.
    pub interval_ns: u32,
    /// Rotation from the unit's axes to the body's (C^b_s), rows of the matrix.
    pub c_b_s: [[f64; 3]; 3],
    /// From the unit to the antenna, body axes, m.
    pub lever_arm_b_m: [f64; 3],
    /// Noise of the sensors.
    pub noise: InertialNoise,
    /// Noise of the receiver clock.
    pub clock: ClockNoise,
    /// Noise of the receiver's measurements.
    pub measurement: MeasurementFactors,
    /// Range of the sensors; a sample at or beyond it is saturated.
    pub range: SensorRange,
    /// Where the first attitude comes from.
    pub start: AttitudeStart,
    /// One sigma of what the filter starts from; position and velocity are those of the snapshot
    /// solution at least.
    pub sigma: InitialSigma,
}

/// One sigma of an initial state, per axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InitialSigma {
    /// Position, m.
    pub position_m: f64,
    /// Velocity, m/s.
    pub velocity_mps: f64,
    /// Attitude about local north, east, down, rad: of one that is given; with the course, what is added to its own
    /// sigma for side-slip and for vibration. Other alignments say by themselves how well they are.
    pub attitude_ned_rad: [f64; 3],
    /// Gyroscope bias, rad/s.
    pub gyro_bias_radps: f64,
    /// Accelerometer bias, m/s².
    pub accel_bias_mps2: f64,
    /// Clock bias, m.
    pub clock_bias_m: f64,
    /// Clock drift, m/s.
    pub clock_drift_mps: f64,
}

/// A state to start from, as a scenario gives it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InitialState {
    /// When.
    pub time: GpsTime,
    /// Position, ECEF, m.
    pub r_eb_e_m: [f64; 3],
    /// Velocity against the Earth, ECEF, m/s.
    pub v_eb_e_mps: [f64; 3],
    /// Rotation from body to ECEF, scalar first.
    pub q_e_b: [f64; 4],
    /// Gyroscope bias, rad/s: measured minus true.
    pub gyro_bias_radps: [f64; 3],
    /// Accelerometer bias, m/s²: measured minus true.
    pub accel_bias_mps2: [f64; 3],
    /// Receiver clock minus system time, m.
    pub clock_bias_m: f64,
    /// Its rate, m/s.
    pub clock_drift_mps: f64,
}

/// Requirements of a scenario folder, which is run by the reference model: white noise, no gate, no
/// snapshot opinion, no re-admission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceModel {
    /// False-alert probability per sample.
    pub p_fa: f64,
    /// Missed-detection probability.
    pub p_md: f64,
    /// Fault-free integrity risk per sample.
    pub p_h0: f64,
    /// Horizontal alert limit, m.
    pub hal_m: f64,
    /// Vertical alert limit, m.
    pub val_m: f64,
    /// Test the vertical separation too.
    pub detect_vertical: bool,
    /// Exclude satellites that were isolated.
    pub exclude: bool,
    /// How long the filters of a satellite that vanished are kept, ns.
    pub hold_ns: i64,
}

/// What is wrong with an [`InertialConfig`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InertialConfigError {
    /// The interval is not between 2.5 and 20 ms.
    Interval {
        /// The interval given, ns.
        interval_ns: u32,
    },
    /// The mounting is not a rotation: its rows are not orthonormal to 1e-6, or it mirrors.
    Mounting,
    /// A lever arm longer than 100 m.
    LeverArm,
    /// A limit for the sigma of a heading that is not between 0 and 30°.
    HeadingLimit {
        /// The number given, rad.
        value_rad: f64,
    },
    /// A density, decay, range or sigma that is negative, not finite, or zero where it must not be.
    NotPositive {
        /// The number given.
        value: f64,
    },
}

/// Shortest and longest nominal sample interval, ns: 400 to 50 Hz.
pub const INTERVAL_NS: core::ops::RangeInclusive<u32> = 2_500_000..=20_000_000;
/// Longest lever arm, m.
pub const MAX_LEVER_ARM_M: f64 = 100.0;

impl InertialConfig {
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
        if let AttitudeStart::Gyrocompass {
            max_heading_sigma_rad: value_rad,
        }
        | AttitudeStart::Automatic {
            max_heading_sigma_rad: value_rad,
            ..
        } = self.start
            && !(value_rad > 0.0 && value_rad <= MAX_HEADING_SIGMA_RAD)
        {
            return Err(InertialConfigError::HeadingLimit { value_rad });
        }
        let InertialNoise {
            arw,
            vrw,
            gyro_bias_walk,
            accel_bias_walk,
        } = self.noise;
        let sigma = &self.sigma;
        let [north, east, down] = sigma.attitude_ned_rad;
        let positive = [
            self.measurement.pseudorange,
            self.measurement.range_rate,
            self.range.rate_radps,
            self.range.specific_force_mps2,
            sigma.position_m,
            sigma.velocity_mps,
            north,
            east,
            down,
            sigma.clock_bias_m,
            sigma.clock_drift_mps,
        ];
        let not_negative = [
            arw,
            vrw,
            gyro_bias_walk,
            accel_bias_walk,
            self.clock.bias_psd,
            self.clock.drift_psd,
            self.clock.drift_decay_per_s,
            self.clock.inter_system_psd,
            sigma.gyro_bias_radps,
            sigma.accel_bias_mps2,
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

/// Rows orthonormal to 1e-6 and right-handed; NaN is not.
pub(crate) fn is_rotation(c: &[[f64; 3]; 3]) -> bool {
    let [a, b, d] = *c;
    let dot = |u: [f64; 3], v: [f64; 3]| {
        let ([u0, u1, u2], [v0, v1, v2]) = (u, v);
        u0 * v0 + u1 * v1 + u2 * v2
    };
    let cross = |u: [f64; 3], v: [f64; 3]| {
        let ([u0, u1, u2], [v0, v1, v2]) = (u, v);
        [u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0]
    };
    let near = |value: f64, expected: f64| libm::fabs(value - expected) <= 1e-6;
    near(dot(a, a), 1.0)
        && near(dot(b, b), 1.0)
        && near(dot(a, b), 0.0)
        && near(dot(cross(a, b), d), 1.0)
        && near(dot(d, d), 1.0)
}
