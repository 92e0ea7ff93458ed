//! From command line and configuration file to a [`Config`].
//!
//! A configuration file is TOML; every key is optional and a flag on the command line wins:
//!
//! ```toml
//! systems = "GC"             # letters of G, E, C
//! mask_deg = 10.0
//! phase = "lpv200"           # oceanic enroute terminal npa lnav_vnav apv1 lpv lpv200 apv2
//! noise = "elevation"        # or airborne
//! ionosphere = "klobuchar"   # or none, iono_free
//! troposphere = "saastamoinen"  # or none
//! reference_week = 2009      # GPS week of the data, for RTCM streams that state it modulo 1024
//! max_exclusions = 2
//! ```
//!
//! and sections `[imu]` for an inertial unit: docs/examples, `imu/settings.rs`, and `[aids]` for its aids:
//! `aiding/settings.rs`.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use serde::Deserialize;
use surefix_core::config::{Config, ConfigError, IonosphereModel, NoisePreset, TroposphereModel};
use surefix_core::gnss::System;
use surefix_core::gnss::satellite::SystemSet;
use surefix_core::integrity::Phase;

use crate::aiding::AidsSettings;
use crate::imu::ImuSettings;

/// What can be set, from a file or from the command line.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, clap::Args)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Constellations to use, letters of G (GPS), E (Galileo), C (BDS) [default: GEC]
    #[arg(long, value_name = "LETTERS")]
    pub systems: Option<String>,
    /// Elevation mask in degrees [default: 10]
    #[arg(long, value_name = "DEGREES")]
    pub mask_deg: Option<f64>,
    /// Phase of flight: oceanic, enroute, terminal, npa, lnav_vnav, apv1, lpv, lpv200, apv2 [default: npa]
    #[arg(long, value_name = "NAME")]
    pub phase: Option<String>,
    /// Error model: elevation or airborne [default: elevation]
    #[arg(long, value_name = "PRESET")]
    pub noise: Option<String>,
    /// Ionosphere: none, klobuchar or iono_free [default: klobuchar]
    #[arg(long, value_name = "MODEL")]
    pub ionosphere: Option<String>,
    /// Troposphere: none or saastamoinen [default: saastamoinen]
    #[arg(long, value_name = "MODEL")]
    pub troposphere: Option<String>,
    /// A GPS week within 9 years of the data, for streams that state it modulo 1024
    #[arg(long, value_name = "WEEK")]
    pub reference_week: Option<u16>,
    /// Most satellites taken out in one epoch, 0 to 3 [default: 3]
    #[arg(long, value_name = "N")]
    pub max_exclusions: Option<u8>,
    /// The inertial unit.
    #[arg(skip)]
    pub imu: Option<ImuSettings>,
    /// The aids.
    #[arg(skip)]
    pub aids: Option<AidsSettings>,
}

/// The element of a list of names, or a sentence that lists them.
fn choose<T: Copy>(what: &str, name: &str, choices: &[(&str, T)]) -> Result<T> {
    choices
        .iter()
        .find(|(choice, _)| *choice == name)
        .map(|(_, value)| *value)
        .ok_or_else(|| {
            let names: Vec<&str> = choices.iter().map(|(choice, _)| *choice).collect();
            anyhow!(
                "{what} \"{name}\" does not exist: take one of {}",
                names.join(", ")
            )
        })
}

impl Settings {
    /// Reads a configuration file.
    ///
    /// # Errors
    /// When it cannot be read or has a key or value that means nothing.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("cannot read the configuration file {}", path.display()))?;
        toml::from_str(&text)
            .with_context(|| format!("{} is no surefix configuration", path.display()))
    }

    /// These settings, and those of the file where these have none.
    ///
    /// # Errors
    /// As [`Settings::read`].
    pub fn over_file(self, file: Option<&PathBuf>) -> Result<Self> {
        let file = file.map(|path| Self::read(path)).transpose()?;
        let file = file.unwrap_or_default();
        Ok(Self {
            systems: self.systems.or(file.systems),
            mask_deg: self.mask_deg.or(file.mask_deg),
            phase: self.phase.or(file.phase),
            noise: self.noise.or(file.noise),
            ionosphere: self.ionosphere.or(file.ionosphere),
            troposphere: self.troposphere.or(file.troposphere),
            reference_week: self.reference_week.or(file.reference_week),
            max_exclusions: self.max_exclusions.or(file.max_exclusions),
            imu: self.imu.or(file.imu),
            aids: self.aids.or(file.aids),
        })
    }

    /// The preset with these settings.
    ///
    /// # Errors
    /// When a name does not exist or a number is outside its range.
    pub fn config(&self) -> Result<Config> {
        let mut config = Config::PRESET;
        if let Some(letters) = &self.systems {
            config.systems = SystemSet::EMPTY;
            for letter in letters.chars() {
                let system = System::from_letter(letter).ok_or_else(|| {
                    anyhow!("--systems \"{letters}\": '{letter}' is none of G (GPS), E (Galileo), C (BDS)")
                })?;
                config.systems = config.systems.with(system);
            }
        }
        if let Some(mask_deg) = self.mask_deg {
            config.mask_rad = mask_deg.to_radians();
        }
        if let Some(name) = &self.phase {
            let phases = Phase::ALL.map(|phase| (phase.name(), phase));
            config.phase = choose("the phase of flight", name, &phases)?;
        }
        if let Some(name) = &self.noise {
            let presets = [
                ("elevation", NoisePreset::Elevation),
                ("airborne", NoisePreset::Airborne),
            ];
            config.noise = choose("the error model", name, &presets)?;
        }
        if let Some(name) = &self.ionosphere {
            let models = [
                ("none", IonosphereModel::None),
                ("klobuchar", IonosphereModel::Klobuchar),
                ("iono_free", IonosphereModel::IonosphereFree),
            ];
            config.ionosphere = choose("the ionosphere model", name, &models)?;
        }
        if let Some(name) = &self.troposphere {
            let models = [
                ("none", TroposphereModel::None),
                ("saastamoinen", TroposphereModel::Saastamoinen),
            ];
            config.troposphere = choose("the troposphere model", name, &models)?;
        }
        if self.reference_week.is_some() {
            config.reference_week = self.reference_week;
        }
        if let Some(max_exclusions) = self.max_exclusions {
            config.max_exclusions = max_exclusions;
        }
        match config.check() {
            Ok(()) => Ok(config),
            Err(ConfigError::NoSystem) => {
                bail!("--systems names no constellation: take letters of G, E, C")
            }
            Err(ConfigError::MaskOutOfRange { mask_rad }) => bail!(
                "the elevation mask {}° is not between 0° and 60°",
                mask_rad.to_degrees()
            ),
            Err(ConfigError::TooManyExclusions { max_exclusions }) => {
                bail!(
                    "--max-exclusions {max_exclusions} is more than 3, which the search is built for"
                )
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_win_over_the_file_and_the_file_over_the_preset() {
        let file: Settings = toml::from_str("systems = \"GC\"\nphase = \"lpv200\"\n").unwrap();
        assert_eq!(file.phase.as_deref(), Some("lpv200"));
        let config = file.config().unwrap();
        assert_eq!(config.phase, Phase::Lpv200);
        assert!(!config.systems.contains(System::Galileo));
        assert_eq!(config.mask_rad, Config::PRESET.mask_rad);
        assert!(toml::from_str::<Settings>("speed = 3").is_err());
    }

    #[test]
    fn names_and_numbers_that_mean_nothing_are_refused_with_what_does() {
        let refused = |settings: Settings| settings.config().unwrap_err().to_string();
        let phase = refused(Settings {
            phase: Some("landing".into()),
            ..Settings::default()
        });
        assert!(phase.contains("lpv200"), "{phase}");
        let systems = refused(Settings {
            systems: Some("GR".into()),
            ..Settings::default()
        });
        assert!(systems.contains("'R'"), "{systems}");
        let mask = refused(Settings {
            mask_deg: Some(f64::NAN),
            ..Settings::default()
        });
        assert!(mask.contains("60"), "{mask}");
    }
}
