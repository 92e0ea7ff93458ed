//! Several units recorded one by one: sections `[[imu.unit]]` of a configuration file, a CSV file for each.
//!
//! Section `[imu]` then describes what the vote gives, at the point `[imu.lever_arm]` calls `imu_m`, and each
//! unit as far as its own section is silent; a unit with a grade of its own has the noise and biases of that. Units are numbered from 0 in the order of the sections and files.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use serde::Deserialize;
use surefix_core::ins::{InertialConfig, InertialConfigError, MAX_UNITS, UnitConfig, UnitSample};

use super::samples::{Recorded, csv_text, read, read_csv_file};
use super::settings::{FileSettings, ImuSettings, Mounting, Noise, Range};
use crate::simulate::inertial::sensors::Grade;

/// By how much time stamps of separate recordings are off unless the file says otherwise, s.
const TIMING_S: f64 = 1e-3;

/// A section `[[imu.unit]]`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct UnitSettings {
    rate_hz: Option<f64>,
    grade: Option<Grade>,
    /// Where it is, as in `[imu.lever_arm]`.
    imu_m: Option<[f64; 3]>,
    file: Option<FileSettings>,
    mounting: Option<Mounting>,
    range: Option<Range>,
    noise: Option<Noise>,
    #[serde(default)]
    tolerance: Tolerance,
}

/// What a healthy unit may be off by, where the grade does not fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Tolerance {
    gyro_bias_deg_per_h: Option<f64>,
    accel_bias_mg: Option<f64>,
    scale: Option<f64>,
    timing_s: Option<f64>,
}

impl UnitSettings {
    /// Section `[imu]` as it reads for this unit alone.
    fn over(&self, imu: &ImuSettings) -> ImuSettings {
        let mut own = imu.clone();
        own.units.clear();
        own.rate_hz = self.rate_hz.unwrap_or(imu.rate_hz);
        own.grade = self.grade.unwrap_or(imu.grade);
        own.lever_arm.imu_m = self.imu_m.unwrap_or(imu.lever_arm.imu_m);
        own.file = self.file.clone().or_else(|| imu.file.clone());
        own.mounting = self.mounting.or(imu.mounting);
        own.range = self.range.unwrap_or(imu.range);
        // What [imu] says of noise and biases is of its grade: a unit of another grade starts from its own.
        own.noise = self.noise.or(imu.noise.filter(|_| self.grade.is_none()));
        let mut sigma = imu.sigma.unwrap_or_default();
        if self.grade.is_some() {
            (sigma.gyro_bias_deg_per_h, sigma.accel_bias_mg) = (None, None);
        }
        let Tolerance {
            gyro_bias_deg_per_h,
            accel_bias_mg,
            ..
        } = self.tolerance;
        sigma.gyro_bias_deg_per_h = gyro_bias_deg_per_h.or(sigma.gyro_bias_deg_per_h);
        sigma.accel_bias_mg = accel_bias_mg.or(sigma.accel_bias_mg);
        own.sigma = Some(sigma);
        own
    }

    /// What the vote has to know, of a unit that by itself would be `alone`, `own` in words.
    fn config(
        &self,
        imu: &ImuSettings,
        own: &ImuSettings,
        alone: &InertialConfig,
    ) -> Result<UnitConfig> {
        let [unit, body] = [own.lever_arm.imu_m, imu.lever_arm.imu_m];
        let config = UnitConfig {
            interval_ns: alone.interval_ns,
            c_b_s: alone.c_b_s,
            lever_arm_b_m: [unit[0] - body[0], unit[1] - body[1], unit[2] - body[2]],
            noise: alone.noise,
            range: alone.range,
            tolerance: surefix_core::ins::UnitTolerance {
                gyro_bias_radps: alone.sigma.gyro_bias_radps,
                accel_bias_mps2: alone.sigma.accel_bias_mps2,
                scale: self.tolerance.scale.unwrap_or(own.grade.scale()),
                timing_s: self.tolerance.timing_s.unwrap_or(TIMING_S),
            },
        };
        match config.check() {
            Ok(()) => Ok(config),
            Err(InertialConfigError::LeverArm) => {
                bail!("imu_m is more than 100 m from that of [imu.lever_arm]: give both in metres")
            }
            Err(error) => bail!(
                "the vote cannot use it ({error:?}): noise and tolerance have to be positive, scale at most 0.1, timing_s at most 0.02"
            ),
        }
    }
}

/// Reads the recordings of `--imu`: one, or a CSV file for each unit that votes.
///
/// # Errors
/// When one cannot be read, there are more files than units can vote, or not as many as sections
/// `[[imu.unit]]`; the message tells what to do.
pub fn read_all(paths: &[PathBuf], settings: Option<&ImuSettings>) -> Result<Recorded> {
    let sections = settings.map_or(&[][..], |settings| &settings.units);
    if let ([path], []) = (paths, sections) {
        return read(path, settings);
    }
    let Some(settings) = settings else {
        bail!(
            "several --imu: say what the units are in sections [imu] and [[imu.unit]] of the file of --config; docs/examples/three-units.toml is one"
        );
    };
    if !(2..=MAX_UNITS).contains(&paths.len()) {
        bail!(
            "--imu is given {} times: two or three units vote, each in a file of its own",
            paths.len()
        );
    }
    if sections.len() != paths.len() {
        bail!(
            "{} --imu and {} sections [[imu.unit]]: give one of each for every unit, in the same order",
            paths.len(),
            sections.len()
        );
    }
    // What the vote gives is in body axes.
    let mut voted = settings.clone();
    voted.mounting = None;
    let mut recorded = Recorded {
        unit: voted.inertial_config()?,
        magnetometer: settings.magnetometer()?,
        samples: Vec::new(),
        receiver_latency_ns: settings.receiver_latency_ns()?,
        units: Vec::new(),
        unit_samples: Vec::new(),
        bad_lines: 0,
    };
    let mut of_units = Vec::new();
    for (number, (path, section)) in (0_u8..).zip(paths.iter().zip(sections)) {
        let name = || format!("[[imu.unit]] number {number} (--imu {})", path.display());
        let own = section.over(settings);
        let alone = own.inertial_config().with_context(name)?;
        let config = section.config(settings, &own, &alone).with_context(name)?;
        let text = csv_text(path)?;
        let (samples, bad_lines) = read_csv_file(path, &text, &own)?;
        recorded.units.push((number, config));
        recorded.bad_lines += bad_lines;
        of_units.push(samples.into_iter().map(|sample| UnitSample {
            sample,
            is_valid: true,
            temperature_c: None,
        }));
    }
    recorded.unit_samples = merged(of_units.into_iter().map(Iterator::collect).collect());
    Ok(recorded)
}

/// All samples in the order in which they arrive, those of each unit in their own order: one whose time runs
/// backwards arrives with the one before it.
fn merged(of_units: Vec<Vec<UnitSample>>) -> Vec<(u8, UnitSample)> {
    let mut all = Vec::new();
    for (number, samples) in (0_u8..).zip(of_units) {
        let mut latest_ns = i64::MIN;
        for sample in samples {
            latest_ns = latest_ns.max(sample.sample.time.ns());
            all.push((latest_ns, number, sample));
        }
    }
    // Stable, so that no unit's samples change places.
    all.sort_by_key(|(arrival_ns, number, _)| (*arrival_ns, *number));
    all.into_iter()
        .map(|(_, number, sample)| (number, sample))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use surefix_core::ins::ImuSample;
    use surefix_core::time::GpsTime;

    #[test]
    fn units_arrive_in_the_order_of_their_times_and_keep_their_own() {
        let unit = |times: &[i64]| {
            let sample = |ns: &i64| UnitSample {
                sample: ImuSample {
                    time: GpsTime::from_ns(*ns),
                    interval_ns: 10_000_000,
                    dtheta_is_s_rad: [0.0; 3],
                    dv_is_s_mps: [0.0; 3],
                },
                is_valid: true,
                temperature_c: None,
            };
            times.iter().map(sample).collect::<Vec<_>>()
        };
        let order: Vec<_> = merged(vec![unit(&[10, 20, 5, 30]), unit(&[10, 15, 25])])
            .iter()
            .map(|(number, sample)| (*number, sample.sample.time.ns()))
            .collect();
        assert_eq!(
            order,
            [(0, 10), (1, 10), (1, 15), (0, 20), (0, 5), (1, 25), (0, 30)]
        );
    }
}
