//! A scenario folder in memory.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use surefix_core::gnss::{Satellite, System};

use super::table::Table;

/// What a navigator may read of a scenario.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// `init.csv`.
    pub init: Init,
    /// `imu.csv`, times ascending.
    pub imu: Vec<ImuRow>,
    /// `gnss.csv`, times ascending.
    pub epochs: Vec<GnssEpoch>,
}

/// Increments over `(t_s − imu_dt, t_s]`, body axes: forward, right, down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuRow {
    /// End of the interval, s.
    pub t_s: f64,
    /// Integral of the angular rate against inertial space, rad.
    pub dtheta_ib_b_rad: [f64; 3],
    /// Integral of the specific force, m/s.
    pub dv_ib_b_mps: [f64; 3],
}

/// The satellites of one time.
#[derive(Clone, Debug, PartialEq)]
pub struct GnssEpoch {
    /// Time, s.
    pub t_s: f64,
    /// Satellites in the order of the file.
    pub rows: Vec<GnssRow>,
}

/// One satellite of an epoch.
#[derive(Clone, Debug, PartialEq)]
pub struct GnssRow {
    /// Which satellite.
    pub satellite: Satellite,
    /// Satellite at transmission, ECEF of reception, m.
    pub r_es_e_m: [f64; 3],
    /// Its velocity against the Earth, m/s.
    pub v_es_e_mps: [f64; 3],
    /// Pseudorange, m.
    pub pseudorange_m: f64,
    /// Range rate, m/s.
    pub range_rate_mps: f64,
    /// One sigma of the pseudorange, m.
    pub sigma_pseudorange_m: f64,
    /// One sigma of the range rate, m/s.
    pub sigma_range_rate_mps: f64,
}

/// `init.csv`.
#[derive(Clone, Debug, PartialEq)]
pub struct Init {
    /// Start, s.
    pub t0_s: f64,
    /// Interval of the inertial unit, s.
    pub imu_dt_s: f64,
    /// Position, ECEF, m.
    pub r_eb_e_m: [f64; 3],
    /// Velocity against the Earth, ECEF, m/s.
    pub v_eb_e_mps: [f64; 3],
    /// Rotation from body to ECEF, scalar first.
    pub q_e_b: [f64; 4],
    /// Gyroscope bias, rad/s.
    pub gyro_bias_radps: [f64; 3],
    /// Accelerometer bias, m/s².
    pub accel_bias_mps2: [f64; 3],
    /// Clock bias, m.
    pub clock_bias_m: f64,
    /// Clock drift, m/s.
    pub clock_drift_mps: f64,
    /// One sigma of the position, per axis, m.
    pub sigma_position_m: f64,
    /// One sigma of the velocity, per axis, m/s.
    pub sigma_velocity_mps: f64,
    /// One sigma of the attitude about north, east, down, rad.
    pub sigma_attitude_ned_rad: [f64; 3],
    /// One sigma of the gyroscope bias, rad/s.
    pub sigma_gyro_bias_radps: f64,
    /// One sigma of the accelerometer bias, m/s².
    pub sigma_accel_bias_mps2: f64,
    /// One sigma of the clock bias, m.
    pub sigma_clock_bias_m: f64,
    /// One sigma of the clock drift, m/s.
    pub sigma_clock_drift_mps: f64,
    /// Angle random walk, rad/√s.
    pub arw: f64,
    /// Velocity random walk, m/s/√s.
    pub vrw: f64,
    /// Random walk of the gyroscope bias, rad/s/√s.
    pub gyro_bias_walk: f64,
    /// Random walk of the accelerometer bias, m/s²/√s.
    pub accel_bias_walk: f64,
    /// Spectral density of the clock bias, m²/s.
    pub clock_bias_psd: f64,
    /// Spectral density of the clock drift, (m/s)²/s.
    pub clock_drift_psd: f64,
    /// Decay of the clock drift, 1/s; 0 for a random walk.
    pub clock_decay_per_s: f64,
    /// False-alert probability per sample.
    pub p_fa: f64,
    /// Missed-detection probability.
    pub p_md: f64,
    /// Fault-free integrity risk.
    pub p_h0: f64,
    /// Horizontal alert limit, m.
    pub hal_m: f64,
    /// Vertical alert limit, m.
    pub val_m: f64,
    /// Test the vertical separation too.
    pub detect_vertical: bool,
    /// Exclude satellites that were isolated.
    pub exclude: bool,
    /// How long the filters of a satellite that vanished are kept, s.
    pub hold_s: f64,
}

/// Two times nearer than this are the same, s: a tenth of the shortest interval of an inertial unit.
pub const SAME_TIME_S: f64 = 2.5e-4;

impl Scenario {
    /// Reads a folder.
    ///
    /// # Errors
    /// When a file is missing, a field is not what it must be, or times do not ascend; the message
    /// tells file, line and column.
    pub fn read(directory: &Path) -> Result<Self> {
        if !directory.is_dir() {
            bail!(
                "{} is no directory: give a scenario folder with imu.csv, gnss.csv and init.csv",
                directory.display()
            );
        }
        let init = Init::read(&directory.join("init.csv"))?;
        let imu = read_imu(&directory.join("imu.csv"), init.t0_s)?;
        let epochs = read_gnss(&directory.join("gnss.csv"), init.t0_s)?;
        Ok(Self { init, imu, epochs })
    }

    /// Names of every satellite that occurs, sorted.
    pub fn satellites(&self) -> Vec<String> {
        let rows = self.epochs.iter().flat_map(|epoch| &epoch.rows);
        let mut names: Vec<String> = rows.map(|row| row.satellite.to_string()).collect();
        names.sort();
        names.dedup();
        names
    }
}

fn read_imu(path: &Path, t0_s: f64) -> Result<Vec<ImuRow>> {
    let table = Table::read(path)?;
    let time = table.column("t_s")?;
    let dtheta = table.columns(["dth_x", "dth_y", "dth_z"])?;
    let dv = table.columns(["dv_x", "dv_y", "dv_z"])?;
    let mut rows = Vec::new();
    let mut last_s = t0_s;
    for row in table.rows() {
        let t_s = row.number(time)?;
        if t_s <= last_s {
            bail!("{}: {t_s} does not come after {last_s}", row.place(time));
        }
        last_s = t_s;
        rows.push(ImuRow {
            t_s,
            dtheta_ib_b_rad: row.numbers(dtheta)?,
            dv_ib_b_mps: row.numbers(dv)?,
        });
    }
    if rows.len() < 2 {
        bail!(
            "{} holds {}: give the samples from t0 of init.csv to the last epoch of gnss.csv, one per imu_dt",
            path.display(),
            if rows.is_empty() {
                "no sample"
            } else {
                "a single sample"
            }
        );
    }
    Ok(rows)
}

fn read_gnss(path: &Path, t0_s: f64) -> Result<Vec<GnssEpoch>> {
    let table = Table::read(path)?;
    let [time, system, number] = table.columns(["t_s", "sys", "prn"])?;
    let position = table.columns(["sx", "sy", "sz"])?;
    let velocity = table.columns(["svx", "svy", "svz"])?;
    let [pseudorange, range_rate] = table.columns(["pr", "rr"])?;
    let sigmas = table.columns(["sigma_pr", "sigma_rr"])?;
    let mut epochs: Vec<GnssEpoch> = Vec::new();
    for row in table.rows() {
        let t_s = row.number(time)?;
        let last_s = epochs.last().map_or(t0_s, |epoch| epoch.t_s);
        if t_s < last_s || (epochs.is_empty() && t_s <= t0_s) {
            bail!("{}: {t_s} does not come after {last_s}", row.place(time));
        }
        let letter = row.text(system)?;
        let Some(constellation) = System::ALL
            .into_iter()
            .find(|system| system.letter().to_string() == letter)
        else {
            bail!(
                "{}: \"{letter}\" is none of C (BDS), G (GPS), E (Galileo)",
                row.place(system)
            );
        };
        let prn = row.text(number)?;
        let satellite = prn.parse().ok();
        let Some(satellite) = satellite.and_then(|prn| Satellite::new(constellation, prn)) else {
            bail!(
                "{}: \"{prn}\" is not a number from 1 to {}",
                row.place(number),
                constellation.max_prn()
            );
        };
        if epochs.last().is_none_or(|epoch| epoch.t_s != t_s) {
            let rows = Vec::new();
            epochs.push(GnssEpoch { t_s, rows });
        }
        let Some(epoch) = epochs.last_mut() else {
            continue;
        };
        if epoch.rows.iter().any(|other| other.satellite == satellite) {
            bail!("{}: {satellite} occurs twice at {t_s} s", row.place(number));
        }
        epoch.rows.push(GnssRow {
            satellite,
            r_es_e_m: row.numbers(position)?,
            v_es_e_mps: row.numbers(velocity)?,
            pseudorange_m: row.number(pseudorange)?,
            range_rate_mps: row.number(range_rate)?,
            sigma_pseudorange_m: row.positive(sigmas[0])?,
            sigma_range_rate_mps: row.positive(sigmas[1])?,
        });
    }
    if epochs.is_empty() {
        bail!("{} holds no epoch", path.display());
    }
    Ok(epochs)
}

/// `key,value` pairs and where they came from.
struct Pairs {
    path: PathBuf,
    pairs: BTreeMap<String, (usize, String)>,
}

impl Pairs {
    fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("cannot read {}", path.display()))?;
        let mut pairs = BTreeMap::new();
        for (k, line) in text.lines().enumerate() {
            let line = line.trim();
            if line.is_empty() || (k == 0 && line == "key,value") {
                continue;
            }
            let Some((key, value)) = line.split_once(',') else {
                bail!(
                    "{}, line {}: \"{line}\" is not key,value",
                    path.display(),
                    k + 1
                );
            };
            let (key, value) = (key.trim().to_string(), value.trim().to_string());
            if pairs.insert(key.clone(), (k + 1, value)).is_some() {
                bail!("{}, line {}: {key} occurs twice", path.display(), k + 1);
            }
        }
        let path = path.into();
        Ok(Self { path, pairs })
    }

    fn text(&self, key: &str) -> Result<(String, &str)> {
        match self.pairs.get(key) {
            Some((line, value)) => Ok((
                format!("{}, line {line}, {key}", self.path.display()),
                value,
            )),
            None => bail!("{}: there is no line for {key}", self.path.display()),
        }
    }

    fn number(&self, key: &str) -> Result<f64> {
        let (place, text) = self.text(key)?;
        match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => bail!("{place}: \"{text}\" is not a finite number"),
        }
    }

    fn checked(&self, key: &str, is_legal: fn(f64) -> bool, must: &str) -> Result<f64> {
        let value = self.number(key)?;
        if !is_legal(value) {
            let (place, text) = self.text(key)?;
            bail!("{place}: \"{text}\" must be {must}");
        }
        Ok(value)
    }

    fn positive(&self, key: &str) -> Result<f64> {
        self.checked(key, |value| value > 0.0, "above 0")
    }

    fn not_negative(&self, key: &str) -> Result<f64> {
        self.checked(key, |value| value >= 0.0, "0 or above")
    }

    fn probability(&self, key: &str) -> Result<f64> {
        self.checked(key, |p| p > 0.0 && p < 1.0, "between 0 and 1")
    }

    fn numbers<const N: usize>(&self, stem: &str, ends: [&str; N]) -> Result<[f64; N]> {
        let mut values = [0.0; N];
        for (value, end) in values.iter_mut().zip(ends) {
            *value = self.number(&format!("{stem}_{end}"))?;
        }
        Ok(values)
    }

    fn choice(&self, key: &str, no: &str, yes: &str) -> Result<bool> {
        let (place, text) = self.text(key)?;
        match text {
            text if text == no => Ok(false),
            text if text == yes => Ok(true),
            _ => bail!("{place}: \"{text}\" is neither {no} nor {yes}"),
        }
    }
}

impl Init {
    /// Reads `init.csv`.
    ///
    /// # Errors
    /// When a key is missing or its value is not what it must be.
    pub fn read(path: &Path) -> Result<Self> {
        let pairs = Pairs::read(path)?;
        let axes = ["x", "y", "z"];
        let q_e_b = pairs.numbers("q", ["w", "x", "y", "z"])?;
        let norm = q_e_b.iter().map(|q| q * q).sum::<f64>().sqrt();
        if (norm - 1.0).abs() > 1e-6 {
            bail!(
                "{}: the attitude q_w to q_z is no unit quaternion: its norm is {norm}",
                path.display()
            );
        }
        Ok(Self {
            t0_s: pairs.number("t0")?,
            imu_dt_s: pairs.positive("imu_dt")?,
            r_eb_e_m: pairs.numbers("pos", axes)?,
            v_eb_e_mps: pairs.numbers("vel", axes)?,
            q_e_b,
            gyro_bias_radps: pairs.numbers("bg", axes)?,
            accel_bias_mps2: pairs.numbers("ba", axes)?,
            clock_bias_m: pairs.number("clk_b")?,
            clock_drift_mps: pairs.number("clk_d")?,
            sigma_position_m: pairs.positive("std_pos")?,
            sigma_velocity_mps: pairs.positive("std_vel")?,
            sigma_attitude_ned_rad: [
                pairs.positive("std_att_n")?,
                pairs.positive("std_att_e")?,
                pairs.positive("std_att_d")?,
            ],
            sigma_gyro_bias_radps: pairs.not_negative("std_bg")?,
            sigma_accel_bias_mps2: pairs.not_negative("std_ba")?,
            sigma_clock_bias_m: pairs.positive("std_clk_b")?,
            sigma_clock_drift_mps: pairs.positive("std_clk_d")?,
            arw: pairs.not_negative("arw")?,
            vrw: pairs.not_negative("vrw")?,
            gyro_bias_walk: pairs.not_negative("bg_rw")?,
            accel_bias_walk: pairs.not_negative("ba_rw")?,
            clock_bias_psd: pairs.not_negative("clk_s_b")?,
            clock_drift_psd: pairs.not_negative("clk_s_d")?,
            clock_decay_per_s: pairs.not_negative("clk_beta")?,
            p_fa: pairs.probability("p_fa")?,
            p_md: pairs.probability("p_md")?,
            p_h0: pairs.probability("p_h0")?,
            hal_m: pairs.positive("hal")?,
            val_m: pairs.positive("val")?,
            detect_vertical: pairs.choice("detect_axes", "h", "hv")?,
            exclude: pairs.choice("exclude", "0", "1")?,
            hold_s: pairs.not_negative("hold_s")?,
        })
    }
}
