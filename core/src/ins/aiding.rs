//! Samples of the sensors that help an inertial unit: a barometer, a magnetometer.

use crate::time::GpsTime;

/// What a barometer measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PressureSample {
    /// When.
    pub time: GpsTime,
    /// Static pressure, Pa.
    pub pressure_pa: f64,
    /// Temperature of the sensor, °C.
    pub temperature_c: f64,
}

/// What a magnetometer measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MagneticSample {
    /// When.
    pub time: GpsTime,
    /// Flux density in the magnetometer's axes, µT.
    pub field_s_ut: [f64; 3],
}
