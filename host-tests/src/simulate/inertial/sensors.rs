//! Grades of inertial units, and the errors of one unit of a grade.
//!
//! An increment over Δt reads ∫(true + bias) dt + density·√Δt·n, n normal and white; a bias starts at
//! its one-sigma times n and walks by its density·√Δt·n per sample. Model: [P0] (6)-(8).

use nalgebra::Vector3;
use rand_chacha::ChaCha20Rng;
use surefix_core::ins::sample::InertialNoise;

use crate::simulate::noise::normal;

/// One degree, rad.
const DEG: f64 = core::f64::consts::PI / 180.0;
/// One degree per hour, rad/s.
const DEG_PER_H: f64 = DEG / 3600.0;
/// One degree per root hour, rad/√s.
const DEG_PER_ROOT_H: f64 = DEG / 60.0;
/// One micro-g, m/s².
const MICRO_G: f64 = 9.806_65e-6;

/// A grade of inertial unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Grade {
    /// 0.01 °/h, 50 µg, 0.002 °/√h
    Navigation,
    /// 1 °/h, 1 mg, 0.1 °/√h
    Tactical,
    /// 50 °/h, 5 mg, 0.3 °/√h
    Mems,
}

/// What a grade promises.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GradeNoise {
    /// White noise and bias walks.
    pub density: InertialNoise,
    /// One sigma of the gyroscope bias at the start, rad/s.
    pub gyro_bias_radps: f64,
    /// One sigma of the accelerometer bias at the start, m/s².
    pub accel_bias_mps2: f64,
    /// One sigma of the initial attitude about north, east, down, rad.
    pub attitude_ned_rad: [f64; 3],
}

impl Grade {
    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Navigation => "navigation",
            Self::Tactical => "tactical",
            Self::Mems => "mems",
        }
    }

    /// White noise: °/√h, µg/√Hz; walks, an instability over √s: °/h/√s, µg/√s; first biases: °/h, µg;
    /// first attitude: level and heading, °. Those of the reference scenarios.
    pub const fn numbers(self) -> [f64; 8] {
        match self {
            Self::Navigation => [0.002, 10.0, 0.001 / 60.0, 3.0 / 60.0, 0.01, 50.0, 0.02, 0.1],
            Self::Tactical => [0.1, 50.0, 0.3 / 17.3, 50.0 / 17.3, 1.0, 1000.0, 0.1, 0.5],
            Self::Mems => [
                0.3,
                200.0,
                10.0 / 17.3,
                300.0 / 17.3,
                50.0,
                5000.0,
                0.5,
                2.0,
            ],
        }
    }

    /// One sigma of scale factors and misalignments, as a ratio: 10, 300 and 2000 ppm.
    pub const fn scale(self) -> f64 {
        match self {
            Self::Navigation => 1e-5,
            Self::Tactical => 3e-4,
            Self::Mems => 2e-3,
        }
    }

    /// Its densities and initial errors in SI units.
    pub fn noise(self) -> GradeNoise {
        let [arw, vrw, gyro_walk, accel_walk, gyro, accel, level, heading] = self.numbers();
        GradeNoise {
            density: InertialNoise {
                arw: arw * DEG_PER_ROOT_H,
                vrw: vrw * MICRO_G,
                gyro_bias_walk: gyro_walk * DEG_PER_H,
                accel_bias_walk: accel_walk * MICRO_G,
            },
            gyro_bias_radps: gyro * DEG_PER_H,
            accel_bias_mps2: accel * MICRO_G,
            attitude_ned_rad: [level * DEG, level * DEG, heading * DEG],
        }
    }
}

/// The errors of one unit as time goes on.
#[derive(Clone, Debug)]
pub struct UnitErrors {
    random: ChaCha20Rng,
    noise: GradeNoise,
    perfect: bool,
    /// Gyroscope bias now, rad/s.
    pub gyro_bias_radps: Vector3<f64>,
    /// Accelerometer bias now, m/s².
    pub accel_bias_mps2: Vector3<f64>,
}

/// Three normal numbers.
pub fn normal3(random: &mut ChaCha20Rng) -> Vector3<f64> {
    Vector3::from([(); 3].map(|()| normal(random)))
}

impl UnitErrors {
    /// Draws a unit; a perfect one has no errors.
    pub fn new(noise: GradeNoise, perfect: bool, mut random: ChaCha20Rng) -> Self {
        let scale = if perfect { 0.0 } else { 1.0 };
        Self {
            gyro_bias_radps: normal3(&mut random) * (scale * noise.gyro_bias_radps),
            accel_bias_mps2: normal3(&mut random) * (scale * noise.accel_bias_mps2),
            random,
            noise,
            perfect,
        }
    }

    /// Puts the errors of one interval on true increments.
    pub fn disturb(
        &mut self,
        interval_s: f64,
        dtheta: Vector3<f64>,
        dv: Vector3<f64>,
    ) -> (Vector3<f64>, Vector3<f64>) {
        if self.perfect {
            return (dtheta, dv);
        }
        let InertialNoise {
            arw,
            vrw,
            gyro_bias_walk,
            accel_bias_walk,
        } = self.noise.density;
        let root_s = libm::sqrt(interval_s);
        let random = &mut self.random;
        let gyro_before = self.gyro_bias_radps;
        let accel_before = self.accel_bias_mps2;
        self.gyro_bias_radps += normal3(random) * (gyro_bias_walk * root_s);
        self.accel_bias_mps2 += normal3(random) * (accel_bias_walk * root_s);
        // The bias of an interval is the mean of its ends.
        let gyro_bias = (gyro_before + self.gyro_bias_radps) * 0.5;
        let accel_bias = (accel_before + self.accel_bias_mps2) * 0.5;
        (
            dtheta + gyro_bias * interval_s + normal3(random) * (arw * root_s),
            dv + accel_bias * interval_s + normal3(random) * (vrw * root_s),
        )
    }
}
