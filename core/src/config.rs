//! What a user chooses before the first byte.

use crate::gnss::satellite::SystemSet;
use crate::integrity::Phase;

/// How the ionosphere is taken out of a pseudorange.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum IonosphereModel {
    /// Not at all: for simulations without one.
    None = 0,
    /// Single frequency with the broadcast Klobuchar parameters; with none received there is no
    /// correction, a larger sigma, and a flag.
    Klobuchar = 1,
    /// Ionosphere-free combination of two frequencies.
    IonosphereFree = 2,
}

/// How the troposphere is taken out of a pseudorange.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum TroposphereModel {
    /// Not at all: for simulations without one.
    None = 0,
    /// Saastamoinen zenith delay in the standard atmosphere.
    Saastamoinen = 1,
}

/// Named error models; each sigma and its source stand in `gnss/weights.rs`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum NoisePreset {
    /// The default: elevation model of [P3] (3) for a good antenna on open ground, with the
    /// broadcast accuracy and the residual atmosphere of single-frequency use.
    Elevation = 0,
    /// Conservative airborne models of [DO-229] appendix J: multipath, noise, residual troposphere
    /// and Klobuchar ionosphere, broadcast URA as it is.
    Airborne = 1,
}

/// Everything a monitor must be told. There is no default for what affects integrity but the named
/// presets; [`Config::PRESET`] is the one the `surefix` command starts from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Constellations to use.
    pub systems: SystemSet,
    /// Elevation mask, rad.
    pub mask_rad: f64,
    /// Phase of flight.
    pub phase: Phase,
    /// Ionosphere.
    pub ionosphere: IonosphereModel,
    /// Troposphere.
    pub troposphere: TroposphereModel,
    /// Error model.
    pub noise: NoisePreset,
    /// A GPS week within 9 years of the data, for streams that carry only the 10-bit GPS week.
    pub reference_week: Option<u16>,
    /// Most satellites taken out as faulty in one epoch, 0 to 3.
    pub max_exclusions: u8,
}

impl Config {
    /// Single-frequency GPS, Galileo and BDS above 10° on a non-precision approach.
    pub const PRESET: Self = Self {
        systems: SystemSet::ALL,
        mask_rad: 10.0 * core::f64::consts::PI / 180.0,
        phase: Phase::Npa,
        ionosphere: IonosphereModel::Klobuchar,
        troposphere: TroposphereModel::Saastamoinen,
        noise: NoisePreset::Elevation,
        reference_week: None,
        max_exclusions: 3,
    };
}

/// What is wrong with a configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ConfigError {
    /// No constellation was chosen.
    NoSystem,
    /// The mask is not between 0° and 60°.
    MaskOutOfRange {
        /// The mask given, rad.
        mask_rad: f64,
    },
    /// More exclusions than the search is built for.
    TooManyExclusions {
        /// The number given.
        max_exclusions: u8,
    },
}

impl Config {
    /// Checks every range; a running monitor has a legal configuration.
    pub fn check(&self) -> Result<(), ConfigError> {
        if self.systems.is_empty() {
            return Err(ConfigError::NoSystem);
        }
        // Written so that NaN refuses.
        if !(self.mask_rad >= 0.0 && self.mask_rad <= core::f64::consts::FRAC_PI_3) {
            return Err(ConfigError::MaskOutOfRange {
                mask_rad: self.mask_rad,
            });
        }
        if self.max_exclusions > 3 {
            return Err(ConfigError::TooManyExclusions {
                max_exclusions: self.max_exclusions,
            });
        }
        Ok(())
    }
}
