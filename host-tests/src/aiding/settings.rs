//! Section `[aids]` of a configuration file.
//!
//! ```toml
//! [aids.barometer]       # every number may be left out
//! sigma_m = 0.3          # noise of one height
//! drift_mps = 0.005      # rate at which the bias changes
//! scale = 0.05           # relative error of a height difference
//! memory_s = 60.0        # how long a rate or scale error lasts
//!
//! [aids.zero_velocity]   # for vehicles that stand still, never for aircraft in the air
//! sigma_mps = 0.02
//! force_spread_mps2 = 0.1
//! rate_spread_deg_per_s = 0.6
//! ```

use anyhow::{Result, bail};
use serde::Deserialize;
use surefix_core::ins::{AidsConfig, BarometerModel, ZeroVelocityModel};

/// Section `[aids]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AidsSettings {
    barometer: Option<Barometer>,
    zero_velocity: Option<ZeroVelocity>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Barometer {
    sigma_m: Option<f64>,
    drift_mps: Option<f64>,
    scale: Option<f64>,
    memory_s: Option<f64>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct ZeroVelocity {
    sigma_mps: Option<f64>,
    force_spread_mps2: Option<f64>,
    rate_spread_deg_per_s: Option<f64>,
}

impl AidsSettings {
    /// What the monitor has to know.
    ///
    /// # Errors
    /// When a number is outside its range.
    pub fn config(&self) -> Result<AidsConfig> {
        let aids = AidsConfig {
            barometer: self.barometer.map(|given| {
                let preset = BarometerModel::PRESET;
                BarometerModel {
                    sigma_m: given.sigma_m.unwrap_or(preset.sigma_m),
                    drift_mps: given.drift_mps.unwrap_or(preset.drift_mps),
                    scale: given.scale.unwrap_or(preset.scale),
                    memory_s: given.memory_s.unwrap_or(preset.memory_s),
                }
            }),
            zero_velocity: self.zero_velocity.map(|given| {
                let preset = ZeroVelocityModel::PRESET;
                ZeroVelocityModel {
                    sigma_mps: given.sigma_mps.unwrap_or(preset.sigma_mps),
                    force_spread_mps2: given.force_spread_mps2.unwrap_or(preset.force_spread_mps2),
                    rate_spread_radps: given
                        .rate_spread_deg_per_s
                        .map_or(preset.rate_spread_radps, f64::to_radians),
                }
            }),
        };
        match aids.check() {
            Ok(()) => Ok(aids),
            Err(error) => bail!(
                "[aids] holds {}, which is out of range: sigma_m 0.01 to 100, drift_mps 0 to 1, scale 0 to 0.5, memory_s 0 to 3600, sigma_mps 0.001 to 0.5, force_spread_mps2 to 2, rate_spread_deg_per_s to 11",
                error.value
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_becomes_a_configuration() {
        let read = |text: &str| toml::from_str::<AidsSettings>(text).unwrap().config();
        assert_eq!(read("").unwrap(), AidsConfig::NONE);
        let both = read("[barometer]\nsigma_m = 0.5\n[zero_velocity]\n").unwrap();
        assert_eq!(both.barometer.unwrap().sigma_m, 0.5);
        assert_eq!(both.zero_velocity, Some(ZeroVelocityModel::PRESET));
        let error = read("[barometer]\nsigma_m = -1.0\n")
            .unwrap_err()
            .to_string();
        assert!(error.contains("-1"), "{error}");
        assert!(toml::from_str::<AidsSettings>("[barometer]\nqnh = 1013.0\n").is_err());
    }
}
