//! A sample of one of several inertial units.

use super::ImuSample;

/// Most inertial units of a monitor.
pub const MAX_UNITS: usize = 3;

/// What one of several units gave: a sample in that unit's axes, and what the unit says of itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitSample {
    /// The increments.
    pub sample: ImuSample,
    /// False when the unit's own status says that it failed; the increments are then no measurement.
    pub is_valid: bool,
    /// Temperature of the unit, °C, where it tells it.
    pub temperature_c: Option<f32>,
}
