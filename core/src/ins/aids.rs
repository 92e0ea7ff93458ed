//! What is known of the aids of an inertial unit: a barometer, and that the vehicle stops.
//!
//! | symbol | code        | unit | meaning                                                          |
//! |--------|-------------|------|------------------------------------------------------------------|
//! | σ      | `sigma_m`   | m    | noise of one height of the barometer, white from one second to the next |
//! | d      | `drift_mps` | m/s  | rate at which its bias changes: weather, and the slope of pressure on the way |
//! | s      | `scale`     | 1    | relative error of a height difference: the air is not the standard one |
//! | τ      | `memory_s`  | s    | how long such a rate or scale error lasts                        |
//!
//! Why none of them is used unless it is configured: docs/decisions/017-aids.md.

/// Errors of a barometer as a height meter. Its bias needs no number: it is found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BarometerModel {
    /// Noise of one height, one sigma, m.
    pub sigma_m: f64,
    /// Rate at which the bias changes, one sigma, m/s.
    pub drift_mps: f64,
    /// Relative error of a difference of heights, one sigma, 1.
    pub scale: f64,
    /// How long a rate or a scale error lasts, s.
    pub memory_s: f64,
}

impl BarometerModel {
    /// A good sensor behind a static port: 0.3 m, 8 m an hour of weather and as much again of the way, 5 % for
    /// 15 K of difference from the standard atmosphere.
    pub const PRESET: Self = Self {
        sigma_m: 0.3,
        drift_mps: 5.0e-3,
        scale: 0.05,
        memory_s: 60.0,
    };
}

/// When a vehicle is taken to stand, and how still it then is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZeroVelocityModel {
    /// Velocity of the antenna of a vehicle that stands, one sigma per axis, m/s.
    pub sigma_mps: f64,
    /// Largest spread of the specific force over a second, all axes together, m/s².
    pub force_spread_mps2: f64,
    /// Largest spread of the angular rate over a second, all axes together, rad/s.
    pub rate_spread_radps: f64,
}

impl ZeroVelocityModel {
    /// A road vehicle with its engine running.
    pub const PRESET: Self = Self {
        sigma_mps: 0.02,
        force_spread_mps2: 0.1,
        rate_spread_radps: 0.01,
    };
}

/// The aids there are.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AidsConfig {
    /// A barometer.
    pub barometer: Option<BarometerModel>,
    /// Standstills are recognised. Not for aircraft: docs/decisions/017-aids.md.
    pub zero_velocity: Option<ZeroVelocityModel>,
}

/// What became of an aid at an epoch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum AidUse {
    /// It is not configured.
    #[default]
    Off = 0,
    /// It has nothing to say: no sample, no standstill, no bias yet.
    Waiting = 1,
    /// It could have been used.
    Ready = 2,
    /// It was used.
    Used = 3,
    /// It contradicts the filter and was not used.
    Refused = 4,
    /// It was found to be wrong, and has yet to prove itself.
    Excluded = 5,
}

impl AidUse {
    /// All, in the order of their numbers.
    pub const ALL: [Self; 6] = [
        Self::Off,
        Self::Waiting,
        Self::Ready,
        Self::Used,
        Self::Refused,
        Self::Excluded,
    ];

    /// That of a number in a frame.
    pub fn from_u8(number: u8) -> Option<Self> {
        Self::ALL.get(usize::from(number)).copied()
    }

    /// Name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Waiting => "waiting",
            Self::Ready => "ready",
            Self::Used => "used",
            Self::Refused => "refused",
            Self::Excluded => "excluded",
        }
    }
}

/// A number of an [`AidsConfig`] that is out of its range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AidsConfigError {
    /// The number given.
    pub value: f64,
}

/// Least and largest sigma of a height, m.
const SIGMA_M: [f64; 2] = [0.01, 100.0];
/// Largest drift, m/s.
const MAX_DRIFT_MPS: f64 = 1.0;
/// Largest error of scale.
const MAX_SCALE: f64 = 0.5;
/// Longest memory, s.
const MAX_MEMORY_S: f64 = 3600.0;
/// Least and largest velocity of a vehicle that stands, m/s.
const STILL_MPS: [f64; 2] = [1.0e-3, 0.5];
/// Largest spread of specific forces of a vehicle that stands, m/s².
const MAX_FORCE_SPREAD_MPS2: f64 = 2.0;
/// Largest spread of angular rates of a vehicle that stands, rad/s.
const MAX_RATE_SPREAD_RADPS: f64 = 0.2;

impl AidsConfig {
    /// No aid.
    pub const NONE: Self = Self {
        barometer: None,
        zero_velocity: None,
    };

    /// Checks every range.
    ///
    /// # Errors
    /// [`AidsConfigError`], the first found; NaN is out of any range.
    pub fn check(&self) -> Result<(), AidsConfigError> {
        let between = |value: f64, [least, largest]: [f64; 2]| {
            if value >= least && value <= largest {
                Ok(())
            } else {
                Err(AidsConfigError { value })
            }
        };
        if let Some(barometer) = &self.barometer {
            between(barometer.sigma_m, SIGMA_M)?;
            between(barometer.drift_mps, [0.0, MAX_DRIFT_MPS])?;
            between(barometer.scale, [0.0, MAX_SCALE])?;
            between(barometer.memory_s, [0.0, MAX_MEMORY_S])?;
        }
        if let Some(still) = &self.zero_velocity {
            between(still.sigma_mps, STILL_MPS)?;
            between(
                still.force_spread_mps2,
                [f64::MIN_POSITIVE, MAX_FORCE_SPREAD_MPS2],
            )?;
            between(
                still.rate_spread_radps,
                [f64::MIN_POSITIVE, MAX_RATE_SPREAD_RADPS],
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOTH: AidsConfig = AidsConfig {
        barometer: Some(BarometerModel::PRESET),
        zero_velocity: Some(ZeroVelocityModel::PRESET),
    };

    #[test]
    fn presets_are_legal_and_numbers_out_of_range_are_not() {
        assert_eq!(BOTH.check(), Ok(()));
        assert_eq!(AidsConfig::NONE.check(), Ok(()));
        for wrong in [f64::NAN, -1.0, f64::INFINITY, 1.0e9] {
            let baro = BarometerModel::PRESET;
            let still = ZeroVelocityModel::PRESET;
            let of_barometer = [
                BarometerModel {
                    sigma_m: wrong,
                    ..baro
                },
                BarometerModel {
                    drift_mps: wrong,
                    ..baro
                },
                BarometerModel {
                    scale: wrong,
                    ..baro
                },
                BarometerModel {
                    memory_s: wrong,
                    ..baro
                },
            ];
            for barometer in of_barometer.map(Some) {
                assert!(AidsConfig { barometer, ..BOTH }.check().is_err());
            }
            let of_standstills = [
                ZeroVelocityModel {
                    sigma_mps: wrong,
                    ..still
                },
                ZeroVelocityModel {
                    force_spread_mps2: wrong,
                    ..still
                },
                ZeroVelocityModel {
                    rate_spread_radps: wrong,
                    ..still
                },
            ];
            for zero_velocity in of_standstills.map(Some) {
                assert!(
                    AidsConfig {
                        zero_velocity,
                        ..BOTH
                    }
                    .check()
                    .is_err()
                );
            }
        }
    }
}
