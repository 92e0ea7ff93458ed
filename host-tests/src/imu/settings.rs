//! What a configuration file says of an inertial unit.
//!
//! Section `[imu]` of the file of `--config`; every key of it stands in docs/examples. Angles of the
//! mounting turn the unit's axes into the body's (forward, right, down): first by the yaw about the
//! unit's z axis, then by the pitch about the y axis where it is then, then by the roll about the x
//! axis where that is then, each positive by the right-hand rule. So C^s_b = Rz(yaw) Ry(pitch) Rx(roll)
//! and C^b_s is its transpose: a unit upside down has roll 180, one whose x axis points to the left of
//! the vehicle and z down has yaw 90.

use anyhow::{Context, Result, bail};
use serde::Deserialize;
use surefix_core::ins::alignment::MagnetometerError;
use surefix_core::ins::{
    AttitudeStart, ClockNoise, InertialConfig, InertialConfigError, InertialNoise, InitialSigma,
    MAX_LATENCY_NS, Magnetometer, MeasurementFactors, SensorRange,
};

use super::units::UnitSettings;
use crate::simulate::inertial::sensors::Grade;

/// Standard gravity, m/s², by definition.
pub(super) const STANDARD_GRAVITY_MPS2: f64 = 9.806_65;
/// One degree per hour, rad/s.
const DEG_PER_H: f64 = core::f64::consts::PI / 180.0 / 3600.0;

/// Section `[imu]`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImuSettings {
    /// Nominal samples per second.
    pub(super) rate_hz: f64,
    /// Preset of noise and first biases.
    pub(super) grade: Grade,
    /// How long after its instant an epoch of the receiver arrives.
    receiver_latency_s: Option<f64>,
    pub(super) file: Option<FileSettings>,
    pub(super) mounting: Option<Mounting>,
    pub(super) lever_arm: LeverArm,
    pub(super) range: Range,
    pub(super) noise: Option<Noise>,
    clock: Clock,
    measurement: Option<Measurement>,
    start: Start,
    magnetometer: Option<MagnetometerSettings>,
    pub(super) sigma: Option<Sigma>,
    /// Units that vote, each with a recording of its own.
    #[serde(default, rename = "unit")]
    pub(super) units: Vec<UnitSettings>,
}

/// Section `[imu.file]`: what the columns of a CSV file mean.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FileSettings {
    pub(super) time: Column,
    pub(super) accelerometer: [Column; 3],
    pub(super) gyroscope: [Column; 3],
    pub(super) accelerometer_unit: AccelerometerUnit,
    pub(super) gyroscope_unit: GyroscopeUnit,
    pub(super) time_scale: TimeScale,
    pub(super) week: Option<u16>,
    #[serde(default)]
    pub(super) time_offset_s: f64,
}

/// A column: its number from 1, or its name in the first line.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(
    untagged,
    expecting = "a column number from 1, or a name of the first line"
)]
pub(super) enum Column {
    Number(usize),
    Name(String),
}

/// What accelerometer columns hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub(super) enum AccelerometerUnit {
    #[serde(rename = "g")]
    StandardGravity,
    #[serde(rename = "m/s2")]
    MetrePerSecondSquared,
    /// An increment.
    #[serde(rename = "m/s")]
    MetrePerSecond,
}

/// What gyroscope columns hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub(super) enum GyroscopeUnit {
    #[serde(rename = "deg/s")]
    DegreePerSecond,
    #[serde(rename = "rad/s")]
    RadianPerSecond,
    /// An increment.
    #[serde(rename = "deg")]
    Degree,
    /// An increment.
    #[serde(rename = "rad")]
    Radian,
}

/// What the time column counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum TimeScale {
    /// GPST as seconds since 1970-01-01, without leap seconds.
    GpstUnixS,
    /// GPST as seconds of the week given.
    GpstSow,
    /// Seconds of a scenario, which starts with the GPS week given, or 0; `time_offset_s` moves it to
    /// where it was flown.
    ScenarioS,
}

/// Section `[imu.mounting]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Mounting {
    roll_deg: f64,
    pitch_deg: f64,
    yaw_deg: f64,
}

/// Section `[imu.lever_arm]`: places in body axes against any one point.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LeverArm {
    pub(super) imu_m: [f64; 3],
    antenna_m: [f64; 3],
}

/// Section `[imu.range]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Range {
    rate_deg_per_s: f64,
    specific_force_g: f64,
}

/// Section `[imu.noise]`: what the data sheet says in place of the grade.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Noise {
    gyro_deg_per_s_sqrt_hz: Option<f64>,
    accel_ug_per_sqrt_hz: Option<f64>,
    gyro_bias_walk_deg_per_s_sqrt_s: Option<f64>,
    accel_bias_walk_ug_per_sqrt_s: Option<f64>,
}

/// Section `[imu.clock]`: the receiver's clock.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Clock {
    preset: ClockPreset,
    bias_psd_m2_per_s: Option<f64>,
    drift_psd_m2_per_s3: Option<f64>,
    drift_decay_per_s: Option<f64>,
    inter_system_psd_m2_per_s: Option<f64>,
}

/// Named receiver clocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum ClockPreset {
    /// A temperature-compensated crystal: h0 = 2e-19 s, h−2 = 2e-20 Hz.
    Tcxo,
    /// A crystal in an oven: h0 = 8e-20 s, h−2 = 4e-23 Hz.
    Ocxo,
}

/// Section `[imu.measurement]`: by how much the receiver's measurements scatter more than the error
/// model has it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Measurement {
    pseudorange_factor: Option<f64>,
    range_rate_factor: Option<f64>,
}

/// Section `[imu.start]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(tag = "attitude", rename_all = "lowercase", deny_unknown_fields)]
enum Start {
    Course {
        min_speed_mps: f64,
    },
    Given {
        roll_deg: f64,
        pitch_deg: f64,
        heading_deg: f64,
    },
    Gyrocompass {
        max_heading_sigma_deg: f64,
    },
    #[serde(rename = "magnetic_field")]
    MagneticField {},
    Automatic {
        min_speed_mps: f64,
        max_heading_sigma_deg: f64,
    },
}

/// Section `[imu.magnetometer]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct MagnetometerSettings {
    hard_iron_ut: [f64; 3],
    /// Rows; mounting included.
    soft_iron: [[f64; 3]; 3],
    declination_deg: f64,
    sigma_declination_deg: f64,
    declination_year: f64,
    dip_deg: f64,
    strength_ut: f64,
    sigma_ut: f64,
}

/// Section `[imu.sigma]`: what is known of the first state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Sigma {
    position_m: Option<f64>,
    velocity_mps: Option<f64>,
    roll_pitch_deg: Option<f64>,
    heading_deg: Option<f64>,
    pub(super) gyro_bias_deg_per_h: Option<f64>,
    pub(super) accel_bias_mg: Option<f64>,
    clock_bias_m: Option<f64>,
    clock_drift_mps: Option<f64>,
}

/// A latency of a receiver, ns.
///
/// # Errors
/// When it is negative, no number, or beyond the filter's history.
pub fn latency_ns(latency_s: f64) -> Result<u32> {
    let longest_s = MAX_LATENCY_NS as f64 / 1e9;
    if !(0.0..=longest_s).contains(&latency_s) {
        bail!(
            "a latency of {latency_s} s is not between 0 and {longest_s}: the filter keeps no longer history"
        );
    }
    Ok((latency_s * 1e9).round() as u32)
}

impl Mounting {
    /// C^b_s, rows.
    fn c_b_s(self) -> [[f64; 3]; 3] {
        let [(sr, cr), (sp, cp), (sy, cy)] =
            [self.roll_deg, self.pitch_deg, self.yaw_deg].map(|deg| libm::sincos(deg.to_radians()));
        // The transpose of Rz(yaw) Ry(pitch) Rx(roll).
        [
            [cy * cp, sy * cp, -sp],
            [cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr],
            [cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr],
        ]
    }
}

/// C^b_s of a mounting of these angles, degrees, as of section `[imu.mounting]`; rows.
pub fn mounting_c_b_s([roll_deg, pitch_deg, yaw_deg]: [f64; 3]) -> [[f64; 3]; 3] {
    Mounting {
        roll_deg,
        pitch_deg,
        yaw_deg,
    }
    .c_b_s()
}

impl ClockPreset {
    /// From the Allan variance coefficients, [BROWN-HWANG]: S_b = c² h0/2, S_d = c² 2π² h−2.
    fn noise(self) -> ClockNoise {
        let (bias_psd, drift_psd) = match self {
            Self::Tcxo => (0.009, 0.0355),
            Self::Ocxo => (0.0036, 7.1e-5),
        };
        ClockNoise {
            bias_psd,
            drift_psd,
            drift_decay_per_s: 0.0,
            // 0.3 m in an hour: what a receiver's signal paths drift against each other.
            inter_system_psd: 2.5e-5,
        }
    }
}

impl ImuSettings {
    pub(super) fn file(&self) -> Option<&FileSettings> {
        self.file.as_ref()
    }

    /// Nominal sample interval, ns.
    pub(super) fn interval_ns(&self) -> Result<u32> {
        let rate_hz = self.rate_hz;
        if !(50.0..=400.0).contains(&rate_hz) {
            bail!("[imu] rate_hz = {rate_hz} is not between 50 and 400");
        }
        Ok((1e9 / rate_hz).round() as u32)
    }

    /// How long after its instant an epoch of the receiver arrives, ns.
    ///
    /// # Errors
    /// When it is negative, no number, or beyond the filter's history.
    pub fn receiver_latency_ns(&self) -> Result<u32> {
        latency_ns(self.receiver_latency_s.unwrap_or(0.0)).context("[imu] receiver_latency_s")
    }

    /// What the monitor has to know.
    ///
    /// # Errors
    /// When a number is outside its range; the message names the key.
    pub fn inertial_config(&self) -> Result<InertialConfig> {
        let [
            arw,
            vrw,
            gyro_walk,
            accel_walk,
            gyro,
            accel_ug,
            level,
            heading,
        ] = self.grade.numbers();
        let accel = accel_ug / 1000.0;
        let noise = self.noise.unwrap_or_default();
        let sigma = self.sigma.unwrap_or_default();
        let measurement = self.measurement.unwrap_or_default();
        let micro_g = STANDARD_GRAVITY_MPS2 * 1e-6;
        // With the course the level is that of a moving vehicle, and the heading where it slips.
        let (start, level, heading) = match self.start {
            Start::Course { min_speed_mps } => {
                check_speed(min_speed_mps)?;
                (AttitudeStart::Course { min_speed_mps }, 2.0, 5.0)
            }
            Start::Gyrocompass {
                max_heading_sigma_deg,
            } => {
                let start = AttitudeStart::Gyrocompass {
                    max_heading_sigma_rad: max_heading_sigma_deg.to_radians(),
                };
                (start, 2.0, 5.0)
            }
            Start::MagneticField {} => {
                if self.magnetometer.is_none() {
                    bail!(
                        "[imu.start] attitude = \"magnetic_field\" needs a section [imu.magnetometer]"
                    );
                }
                (AttitudeStart::MagneticField, 2.0, 5.0)
            }
            Start::Automatic {
                min_speed_mps,
                max_heading_sigma_deg,
            } => {
                check_speed(min_speed_mps)?;
                let start = AttitudeStart::Automatic {
                    min_speed_mps,
                    max_heading_sigma_rad: max_heading_sigma_deg.to_radians(),
                };
                (start, 2.0, 5.0)
            }
            Start::Given {
                roll_deg,
                pitch_deg,
                heading_deg,
            } => {
                for (key, value) in [
                    ("roll_deg", roll_deg),
                    ("pitch_deg", pitch_deg),
                    ("heading_deg", heading_deg),
                ] {
                    if !(-360.0..=360.0).contains(&value) {
                        bail!("[imu.start] {key} = {value} is not between -360 and 360");
                    }
                }
                let roll_pitch_heading_rad =
                    [roll_deg, pitch_deg, heading_deg].map(f64::to_radians);
                let given = AttitudeStart::Given {
                    roll_pitch_heading_rad,
                };
                (given, level, heading)
            }
        };
        let mounting = self.mounting.unwrap_or(Mounting {
            roll_deg: 0.0,
            pitch_deg: 0.0,
            yaw_deg: 0.0,
        });
        let LeverArm { imu_m, antenna_m } = self.lever_arm;
        let level_rad = sigma.roll_pitch_deg.unwrap_or(level).to_radians();
        let clock = self.clock.preset.noise();
        let config = InertialConfig {
            interval_ns: self.interval_ns()?,
            c_b_s: mounting.c_b_s(),
            lever_arm_b_m: [
                antenna_m[0] - imu_m[0],
                antenna_m[1] - imu_m[1],
                antenna_m[2] - imu_m[2],
            ],
            noise: InertialNoise {
                arw: noise
                    .gyro_deg_per_s_sqrt_hz
                    .unwrap_or(arw / 60.0)
                    .to_radians(),
                vrw: noise.accel_ug_per_sqrt_hz.unwrap_or(vrw) * micro_g,
                gyro_bias_walk: noise
                    .gyro_bias_walk_deg_per_s_sqrt_s
                    .unwrap_or(gyro_walk / 3600.0)
                    .to_radians(),
                accel_bias_walk: noise.accel_bias_walk_ug_per_sqrt_s.unwrap_or(accel_walk)
                    * micro_g,
            },
            clock: ClockNoise {
                bias_psd: self.clock.bias_psd_m2_per_s.unwrap_or(clock.bias_psd),
                drift_psd: self.clock.drift_psd_m2_per_s3.unwrap_or(clock.drift_psd),
                drift_decay_per_s: self
                    .clock
                    .drift_decay_per_s
                    .unwrap_or(clock.drift_decay_per_s),
                inter_system_psd: self
                    .clock
                    .inter_system_psd_m2_per_s
                    .unwrap_or(clock.inter_system_psd),
            },
            measurement: MeasurementFactors {
                pseudorange: measurement.pseudorange_factor.unwrap_or(1.0),
                range_rate: measurement.range_rate_factor.unwrap_or(1.0),
            },
            range: SensorRange {
                rate_radps: self.range.rate_deg_per_s.to_radians(),
                specific_force_mps2: self.range.specific_force_g * STANDARD_GRAVITY_MPS2,
            },
            start,
            sigma: InitialSigma {
                position_m: sigma.position_m.unwrap_or(10.0),
                velocity_mps: sigma.velocity_mps.unwrap_or(0.5),
                attitude_ned_rad: [
                    level_rad,
                    level_rad,
                    sigma.heading_deg.unwrap_or(heading).to_radians(),
                ],
                gyro_bias_radps: sigma.gyro_bias_deg_per_h.unwrap_or(gyro) * DEG_PER_H,
                accel_bias_mps2: sigma.accel_bias_mg.unwrap_or(accel) * 1000.0 * micro_g,
                clock_bias_m: sigma.clock_bias_m.unwrap_or(30.0),
                clock_drift_mps: sigma.clock_drift_mps.unwrap_or(1.0),
            },
        };
        match config.check() {
            Ok(()) => Ok(config),
            Err(InertialConfigError::Interval { interval_ns }) => {
                bail!(
                    "[imu] rate_hz means samples every {interval_ns} ns: 2.5 to 20 ms are possible"
                )
            }
            Err(InertialConfigError::Mounting) => {
                bail!("[imu.mounting] holds an angle that is no number")
            }
            Err(InertialConfigError::HeadingLimit { value_rad }) => bail!(
                "[imu.start] max_heading_sigma_deg = {} is not between 0 and 30",
                value_rad.to_degrees()
            ),
            Err(InertialConfigError::LeverArm) => bail!(
                "[imu.lever_arm] puts the antenna more than 100 m from the unit: give both in metres, forward, right, down"
            ),
            Err(InertialConfigError::NotPositive { value }) => Err(anyhow::anyhow!(
                "{value} (in SI units) is not positive and finite"
            ))
            .context("[imu.noise], [imu.clock], [imu.measurement], [imu.range] or [imu.sigma]"),
        }
    }
}

impl ImuSettings {
    /// What the monitor has to know of a magnetometer, where there is one.
    ///
    /// # Errors
    /// When a number is outside its range.
    pub fn magnetometer(&self) -> Result<Option<Magnetometer>> {
        let Some(settings) = self.magnetometer else {
            return Ok(None);
        };
        let magnetometer = Magnetometer {
            hard_iron_s_ut: settings.hard_iron_ut,
            soft_iron_b_s: settings.soft_iron,
            declination_rad: settings.declination_deg.to_radians(),
            sigma_declination_rad: settings.sigma_declination_deg.to_radians(),
            declination_year: settings.declination_year,
            dip_rad: settings.dip_deg.to_radians(),
            strength_ut: settings.strength_ut,
            sigma_ut: settings.sigma_ut,
        };
        match magnetometer.check() {
            Ok(()) => Ok(Some(magnetometer)),
            Err(MagnetometerError::OutOfRange { value }) => bail!(
                "[imu.magnetometer] holds {value} (angles in radians): fields are in microtesla, angles in degrees, the year as 2026.5"
            ),
            Err(MagnetometerError::SoftIron { determinant }) => bail!(
                "[imu.magnetometer] soft_iron has the determinant {determinant}: give the matrix, by rows, that takes what the magnetometer reads without its hard iron to forward, right, down; near to a rotation"
            ),
        }
    }
}

fn check_speed(min_speed_mps: f64) -> Result<()> {
    if !(0.5..=100.0).contains(&min_speed_mps) {
        bail!(
            "[imu.start] min_speed_mps = {min_speed_mps} is not between 0.5 and 100: below, the course is noise"
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHOLE: &str = r#"
        rate_hz = 100
        grade = "mems"
        lever_arm = { imu_m = [1.0, 0.0, -0.5], antenna_m = [0.0, -0.25, -1.5] }
        range = { rate_deg_per_s = 2000, specific_force_g = 8 }
        clock = { preset = "tcxo" }
        start = { attitude = "course", min_speed_mps = 2.0 }
    "#;

    fn settings(more: &str) -> ImuSettings {
        toml::from_str(&format!("{WHOLE}\n{more}")).unwrap()
    }

    fn specific_force_b(mounting: &str, f_s: [f64; 3]) -> [f64; 3] {
        let config = settings(mounting).inertial_config().unwrap();
        config
            .c_b_s
            .map(|row| row[0] * f_s[0] + row[1] * f_s[1] + row[2] * f_s[2])
    }

    #[test]
    fn the_mounting_turns_what_the_unit_measures_into_body_axes() {
        let near = |a: [f64; 3], b: [f64; 3]| {
            assert!(
                a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12),
                "{a:?} {b:?}"
            );
        };
        // At rest a unit with z up measures +g along z; the body's down is where -g is.
        let upside_down = "mounting = { roll_deg = 180, pitch_deg = 0, yaw_deg = 0 }";
        near(
            specific_force_b(upside_down, [0.0, 0.0, 1.0]),
            [0.0, 0.0, -1.0],
        );
        near(
            specific_force_b(upside_down, [1.0, 0.0, 0.0]),
            [1.0, 0.0, 0.0],
        );
        // Unit's x to the left of the vehicle, y forward: a pull to the left is one along its x.
        let turned = "mounting = { roll_deg = 0, pitch_deg = 0, yaw_deg = 90 }";
        near(specific_force_b(turned, [1.0, 0.0, 0.0]), [0.0, -1.0, 0.0]);
        near(specific_force_b(turned, [0.0, 1.0, 0.0]), [1.0, 0.0, 0.0]);
        // To reach the body's x axis the unit's has to be raised: the unit looks down by 30°, and at
        // rest measures the reaction to gravity, up in the body, partly backwards.
        let nose_down = "mounting = { roll_deg = 0, pitch_deg = 30, yaw_deg = 0 }";
        let up = [-0.5, 0.0, -libm::sqrt(0.75)];
        near(specific_force_b(nose_down, up), [0.0, 0.0, -1.0]);
        // Yaw comes first, then the pitch about the turned axis.
        let both = "mounting = { roll_deg = 0, pitch_deg = 90, yaw_deg = 90 }";
        near(specific_force_b(both, [0.0, 0.0, 1.0]), [-1.0, 0.0, 0.0]);
        near(specific_force_b(both, [0.0, 1.0, 0.0]), [0.0, 0.0, 1.0]);
    }

    #[test]
    fn a_data_sheet_wins_over_the_grade() {
        let config = settings("").inertial_config().unwrap();
        assert_eq!(config.interval_ns, 10_000_000);
        assert_eq!(config.lever_arm_b_m, [-1.0, -0.25, -1.0]);
        let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-12, "{a} {b}");
        // The reference scenario with a MEMS unit says the same numbers.
        close(config.noise.arw, 8.726_646_259_971_647e-5);
        close(config.noise.vrw, 1.961_33e-3);
        close(config.noise.gyro_bias_walk, 2.802_391_220_286_335e-6);
        close(config.noise.accel_bias_walk, 1.700_575_144_508_671e-4);
        close(config.sigma.gyro_bias_radps, 2.424_068_405_547_68e-4);
        close(config.sigma.accel_bias_mps2, 4.903_325e-2);
        let sheet = settings(
            "noise = { gyro_deg_per_s_sqrt_hz = 0.0038, accel_ug_per_sqrt_hz = 70 }\nsigma = { gyro_bias_deg_per_h = 1000, heading_deg = 10 }",
        )
        .inertial_config()
        .unwrap();
        close(sheet.noise.arw, 0.0038_f64.to_radians());
        close(sheet.noise.vrw, 70e-6 * 9.806_65);
        assert_eq!(sheet.noise.gyro_bias_walk, config.noise.gyro_bias_walk);
        close(sheet.sigma.attitude_ned_rad[2], 10_f64.to_radians());
    }

    /// INT-123.
    #[test]
    fn int_123_a_receivers_latency_is_read_and_refused_beyond_the_history() {
        let latency = |more: &str| settings(more).receiver_latency_ns();
        assert_eq!(latency("").unwrap(), 0);
        assert_eq!(latency("receiver_latency_s = 0.12").unwrap(), 120_000_000);
        for wrong in ["-0.01", "0.401", "nan", "inf"] {
            let error = latency(&format!("receiver_latency_s = {wrong}")).unwrap_err();
            assert!(
                format!("{error:#}").contains("receiver_latency_s"),
                "{error:#}"
            );
        }
    }

    #[test]
    fn a_start_by_itself_needs_what_it_asks() {
        let start = |start: &str, more: &str| -> Result<AttitudeStart> {
            let text = WHOLE.replace(r#"attitude = "course", min_speed_mps = 2.0"#, start);
            let settings: ImuSettings = toml::from_str(&format!("{text}\n{more}"))?;
            settings.magnetometer()?;
            Ok(settings.inertial_config()?.start)
        };
        let compass = start(
            r#"attitude = "gyrocompass", max_heading_sigma_deg = 10"#,
            "",
        );
        assert!(matches!(
            compass.unwrap(),
            AttitudeStart::Gyrocompass { .. }
        ));
        let wide = start(
            r#"attitude = "gyrocompass", max_heading_sigma_deg = 50"#,
            "",
        );
        assert!(wide.unwrap_err().to_string().contains("between 0 and 30"));
        let magnetic = r#"attitude = "magnetic_field""#;
        let without = start(magnetic, "").unwrap_err().to_string();
        assert!(without.contains("[imu.magnetometer]"), "{without}");
        let calibrated = "[magnetometer]
            hard_iron_ut = [1, 2, 3]
            soft_iron = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
            declination_deg = 4.2
            sigma_declination_deg = 0.5
            declination_year = 2026.5
            dip_deg = 67
            strength_ut = 50
            sigma_ut = 0.5";
        assert!(matches!(
            start(magnetic, calibrated).unwrap(),
            AttitudeStart::MagneticField
        ));
        let mirrored = calibrated.replace("[0, 0, 1]", "[0, 0, -1]");
        let refused = start(magnetic, &mirrored).unwrap_err().to_string();
        assert!(refused.contains("soft_iron"), "{refused}");
        let automatic =
            r#"attitude = "automatic", min_speed_mps = 2.0, max_heading_sigma_deg = 10"#;
        assert!(matches!(
            start(automatic, "").unwrap(),
            AttitudeStart::Automatic { .. }
        ));
    }

    #[test]
    fn what_cannot_be_is_refused_with_its_key() {
        let refused = |more: &str, word: &str| {
            let error = settings(more).inertial_config().unwrap_err();
            assert!(format!("{error:#}").contains(word), "{error:#}");
        };
        refused(
            "mounting = { roll_deg = nan, pitch_deg = 0, yaw_deg = 0 }",
            "imu.mounting",
        );
        refused("noise = { accel_ug_per_sqrt_hz = -70 }", "imu.noise");
        let unknown = toml::from_str::<ImuSettings>(&format!("{WHOLE}\nnoise = {{ gyro = 3 }}"));
        let message = unknown.unwrap_err().to_string();
        assert!(
            message.contains("`gyro`") && message.contains("accel_ug_per_sqrt_hz"),
            "{message}"
        );
        let twenty = WHOLE.replace("= 100", "= 20");
        let twenty: ImuSettings = toml::from_str(&twenty).unwrap();
        assert!(
            twenty
                .inertial_config()
                .unwrap_err()
                .to_string()
                .contains("50 and 400")
        );
    }
}
