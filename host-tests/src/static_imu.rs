//! `surefix static-imu`: the inertial unit that a fixed antenna could have had beside it.
//!
//! ```text
//! recording ──first and last epoch──┐
//! place, attitude, grade, seed ─────┴─► imu.sfx, UNIT.toml ─► surefix replay --imu … --config …
//! ```
//!
//! A recording of a fixed antenna seldom has inertial samples. A unit at rest measures the rotation of
//! the Earth and the reaction to gravity, both constant in its axes, and its own errors: biases, their
//! walks and white noise of a grade, [`sensors`](crate::simulate::inertial::sensors). The attitude that
//! `UNIT.toml` gives is off by a draw of what the grade is good for, as that of a real unit would be.
//! Its axes are the body's, and it stands where the antenna is.
//!
//! | file | content |
//! |---|---|
//! | `imu.sfx` | samples as surefix's own frames, from the first epoch to the last |
//! | `UNIT.toml` | section `[imu]` for `replay --config` |

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use nalgebra::{Matrix3, Vector3};
use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::SeedableRng;
use surefix_core::config::Config;
use surefix_core::frames::geodesy;
use surefix_core::ingest::encode_imu;
use surefix_core::ins::ImuSample;
use surefix_core::time::{GpsTime, NS_PER_S};

use crate::simulate::inertial::earth::{OMEGA_IE_RADPS, frame, gravity_e};
use crate::simulate::inertial::sensors::{Grade, UnitErrors, normal3};
use crate::simulate::inertial::trajectory::rotation;
use crate::source::{self, Item};

/// Random numbers of the unit, and those of the attitude it starts from.
const STREAM_UNIT: u64 = 1 << 32;
const STREAM_ATTITUDE: u64 = (1 << 32) + 1;
/// A place farther from the ellipsoid than this is no place of an antenna, m.
const MAX_HEIGHT_M: f64 = 20_000.0;

/// Arguments of `surefix static-imu`.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// Recording of the fixed antenna: what `replay --gnss` takes
    #[arg(long, value_name = "FILE")]
    pub gnss: PathBuf,
    /// RINEX navigation file, as for `replay`; may be given several times
    #[arg(long, value_name = "FILE")]
    pub nav: Vec<PathBuf>,
    /// Where the antenna is, ECEF, m [default: the position that the recording states for itself]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub at: Option<String>,
    /// Grade of the unit
    #[arg(long, value_enum, default_value = "tactical")]
    pub grade: Grade,
    /// Samples per second, 50 to 200, a whole number of nanoseconds apart
    #[arg(long, value_name = "HZ", default_value_t = 50)]
    pub rate_hz: u32,
    /// Roll, pitch and heading of the unit, degrees
    #[arg(
        long,
        value_name = "ROLL,PITCH,HEADING",
        default_value = "0,0,0",
        allow_hyphen_values = true
    )]
    pub attitude: String,
    /// A GPS week within 9 years of the data, for streams that state it modulo 1024
    #[arg(long, value_name = "WEEK")]
    pub reference_week: Option<u16>,
    /// Seed of biases, noise and the error of the attitude
    #[arg(long)]
    pub seed: u64,
    /// Directory to write imu.sfx and UNIT.toml to; made if absent
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// What to synthesise.
#[derive(Clone, Copy, Debug)]
pub struct Request {
    /// Where the unit is, ECEF, m.
    pub r_e_m: [f64; 3],
    /// Roll, pitch and heading that are told, degrees.
    pub attitude_deg: [f64; 3],
    /// Grade of the unit.
    pub grade: Grade,
    /// Samples per second.
    pub rate_hz: u32,
    /// Seed of its errors.
    pub seed: u64,
}

/// Three numbers of the command line.
///
/// # Errors
/// When they are not three numbers.
pub fn triple(name: &str, text: &str) -> Result<[f64; 3]> {
    let numbers: Option<Vec<f64>> = text
        .split(',')
        .map(|part| {
            part.trim()
                .parse()
                .ok()
                .filter(|value: &f64| value.is_finite())
        })
        .collect();
    match numbers.as_deref() {
        Some(&[a, b, c]) => Ok([a, b, c]),
        _ => bail!("{name} \"{text}\" is not three numbers separated by commas"),
    }
}

/// First and last epoch of a recording, and the place it states for itself.
///
/// # Errors
/// When the recording cannot be read or has no epoch.
pub fn span(
    gnss: &Path,
    nav: &[PathBuf],
    config: &Config,
) -> Result<(GpsTime, GpsTime, Option<[f64; 3]>)> {
    let mut times: Vec<(GpsTime, bool)> = Vec::new();
    let info = source::decode(gnss, nav, config, &mut |item| {
        if let Item::Epoch(epoch) = item {
            times.push((epoch.time, epoch.flags.week_unknown));
        }
    })?;
    let (Some(first), Some(last)) = (times.first(), times.last()) else {
        bail!(
            "{} holds no epoch: give a recording of a receiver",
            gnss.display()
        );
    };
    // The first epochs may come before their week is known; their time of week is right.
    let known = times.iter().find(|(_, unknown)| !unknown).unwrap_or(first);
    let start = GpsTime::nearest(first.0.tow_ns(), known.0);
    Ok((start, last.0, info.station.map(|(r_e_m, _)| r_e_m)))
}

/// Samples of a unit at rest, one after the other.
pub struct Samples {
    errors: UnitErrors,
    dtheta: Vector3<f64>,
    dv: Vector3<f64>,
    interval_ns: u32,
    time: GpsTime,
    end: GpsTime,
}

impl Samples {
    /// From a time on; the last sample ends at `end` or less than an interval later.
    ///
    /// # Errors
    /// When the request cannot be met; the message tells what to do.
    pub fn new(request: &Request, start: GpsTime, end: GpsTime) -> Result<Self> {
        let rate_hz = request.rate_hz;
        if !(50..=200).contains(&rate_hz) || NS_PER_S % i64::from(rate_hz) != 0 {
            bail!(
                "--rate-hz {rate_hz} is not between 50 and 200 with a whole number of nanoseconds: take 50, 100, 125 or 200"
            );
        }
        let llh = geodesy::to_llh(&Vector3::from(request.r_e_m))
            .ok()
            .filter(|llh| llh.height_m.abs() < MAX_HEIGHT_M)
            .ok_or_else(|| {
                anyhow!(
                    "--at {:?} is not a place on the Earth: give ECEF coordinates in metres",
                    request.r_e_m
                )
            })?;
        let (r_e, c_e_n) = frame(llh.lat_rad, llh.lon_rad, llh.height_m);
        let random = |stream| {
            let mut random = ChaCha20Rng::seed_from_u64(request.seed);
            random.set_stream(stream);
            random
        };
        let noise = request.grade.noise();
        let tilt_n = normal3(&mut random(STREAM_ATTITUDE))
            .component_mul(&Vector3::from(noise.attitude_ned_rad));
        let c_b_n = (rotation(&tilt_n) * c_n_b(request.attitude_deg)).transpose();
        let omega_ie_n = c_e_n.transpose() * Vector3::new(0.0, 0.0, OMEGA_IE_RADPS);
        let gravity_n = c_e_n.transpose() * gravity_e(&r_e);
        let interval_ns = NS_PER_S as u32 / rate_hz;
        let interval_s = 1.0 / f64::from(rate_hz);
        Ok(Self {
            errors: UnitErrors::new(noise, false, random(STREAM_UNIT)),
            dtheta: c_b_n * omega_ie_n * interval_s,
            dv: -(c_b_n * gravity_n) * interval_s,
            interval_ns,
            time: start,
            end,
        })
    }
}

impl Iterator for Samples {
    type Item = ImuSample;

    fn next(&mut self) -> Option<ImuSample> {
        if self.time >= self.end {
            return None;
        }
        self.time = self.time.plus_ns(self.interval_ns.into());
        let interval_s = f64::from(self.interval_ns) / NS_PER_S as f64;
        let (dtheta, dv) = self.errors.disturb(interval_s, self.dtheta, self.dv);
        Some(ImuSample {
            time: self.time,
            interval_ns: self.interval_ns,
            dtheta_is_s_rad: dtheta.into(),
            dv_is_s_mps: dv.into(),
        })
    }
}

/// Rotation from body to north, east, down.
fn c_n_b(attitude_deg: [f64; 3]) -> Matrix3<f64> {
    let [roll, pitch, heading] = attitude_deg.map(f64::to_radians);
    rotation(&(Vector3::z() * heading))
        * rotation(&(Vector3::y() * pitch))
        * rotation(&(Vector3::x() * roll))
}

/// Section `[imu]` for the unit; numbers of the grade are left to its name.
pub fn unit_toml(request: &Request) -> String {
    let Request {
        r_e_m: [x, y, z],
        attitude_deg: [roll, pitch, heading],
        grade,
        rate_hz,
        seed,
    } = request;
    format!(
        "# A unit at rest, synthesised for a fixed antenna at {x}, {y}, {z} (ECEF, m), seed {seed}.\n\
         # What the keys mean stands in docs/examples/car-adis16465.toml.\n\
         \n\
         [imu]\n\
         rate_hz = {rate_hz}\n\
         grade = \"{}\"\n\
         \n\
         [imu.lever_arm]\n\
         imu_m = [0.0, 0.0, 0.0]\n\
         antenna_m = [0.0, 0.0, 0.0]\n\
         \n\
         [imu.range]\n\
         rate_deg_per_s = 300.0\n\
         specific_force_g = 8.0\n\
         \n\
         [imu.clock]\n\
         preset = \"tcxo\"\n\
         \n\
         # As told; the true attitude is off by a draw of what the grade is good for.\n\
         [imu.start]\n\
         attitude = \"given\"\n\
         roll_deg = {roll:?}\n\
         pitch_deg = {pitch:?}\n\
         heading_deg = {heading:?}\n",
        grade.name()
    )
}

/// Writes `imu.sfx` and `UNIT.toml` into a directory, made if absent; gives the number of samples.
///
/// # Errors
/// As [`Samples::new`], and when a file cannot be written.
pub fn write(request: &Request, start: GpsTime, end: GpsTime, directory: &Path) -> Result<u64> {
    let samples = Samples::new(request, start, end)?;
    crate::replay::make_directory(directory)?;
    let path = directory.join("imu.sfx");
    let cannot = || format!("cannot write {}", path.display());
    let mut file = BufWriter::new(File::create(&path).with_context(cannot)?);
    let mut frame = [0; 512];
    let mut count = 0;
    for sample in samples {
        let length = encode_imu(&sample, &mut frame)
            .map_err(|error| anyhow!("a native frame did not encode: {error:?}"))?;
        file.write_all(&frame[..length]).with_context(cannot)?;
        count += 1;
    }
    file.flush().with_context(cannot)?;
    let path = directory.join("UNIT.toml");
    std::fs::write(&path, unit_toml(request))
        .with_context(|| format!("cannot write {}", path.display()))?;
    Ok(count)
}

/// Runs `surefix static-imu`.
///
/// # Errors
/// When the arguments or the recording are unusable; the message tells what to do.
pub fn run(args: &Args) -> Result<()> {
    let config = Config {
        reference_week: args.reference_week,
        ..Config::PRESET
    };
    let (start, end, station) = span(&args.gnss, &args.nav, &config)?;
    let r_e_m = match (&args.at, station) {
        (Some(text), _) => triple("--at", text)?,
        (None, Some(station)) => station,
        (None, None) => bail!(
            "{} does not say where its antenna is: give --at",
            args.gnss.display()
        ),
    };
    let request = Request {
        r_e_m,
        attitude_deg: triple("--attitude", &args.attitude)?,
        grade: args.grade,
        rate_hz: args.rate_hz,
        seed: args.seed,
    };
    let count = write(&request, start, end, &args.out)?;
    println!(
        "{count} samples from GPS week {} {:.3} s on, over {:.0} s: {} and {}",
        start.week(),
        start.tow_s(),
        end.seconds_since(start),
        args.out.join("imu.sfx").display(),
        args.out.join("UNIT.toml").display()
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(grade: Grade) -> Request {
        Request {
            r_e_m: [3_582_105.3, 532_589.7, 5_232_754.8],
            attitude_deg: [3.0, -2.0, 120.0],
            grade,
            rate_hz: 50,
            seed: 4,
        }
    }

    /// The mean of a minute turned back to north, east, down by the attitude that is told.
    fn mean_n(grade: Grade) -> (Vector3<f64>, Vector3<f64>) {
        let start = GpsTime::from_week_tow_s(2111, 345_600);
        let end = start.plus_ns(60 * NS_PER_S);
        let request = request(grade);
        let (mut rate, mut force, mut count) = (Vector3::zeros(), Vector3::zeros(), 0);
        for sample in Samples::new(&request, start, end).unwrap() {
            rate += Vector3::from(sample.dtheta_is_s_rad);
            force += Vector3::from(sample.dv_is_s_mps);
            count += 1;
        }
        assert_eq!(count, 3000);
        let c = c_n_b(request.attitude_deg) / 60.0;
        (c * rate, c * force)
    }

    #[test]
    fn at_rest_it_measures_the_turning_earth_and_its_support() {
        let (rate, force) = mean_n(Grade::Navigation);
        let latitude = geodesy::to_llh(&Vector3::from(request(Grade::Navigation).r_e_m))
            .unwrap()
            .lat_rad;
        let earth = Vector3::new(latitude.cos(), 0.0, -latitude.sin()) * OMEGA_IE_RADPS;
        // Normal gravity at 55.5° is 9.8155 m/s²; a tenth of a degree of heading mixes north and east.
        assert!((rate - earth).norm() < 5e-7, "{}", rate - earth);
        assert!(
            (force + Vector3::new(0.0, 0.0, 9.8155)).norm() < 0.01,
            "{force}"
        );
    }

    #[test]
    fn a_poorer_grade_errs_more() {
        let truth = Vector3::new(0.0, 0.0, -9.8155);
        let errors = [Grade::Navigation, Grade::Tactical, Grade::Mems]
            .map(|grade| (mean_n(grade).1 - truth).norm());
        assert!(errors.is_sorted(), "{errors:?}");
    }

    #[test]
    fn what_it_writes_of_itself_is_read_as_it_was_meant() {
        let request = request(Grade::Mems);
        let settings: crate::settings::Settings = toml::from_str(&unit_toml(&request)).unwrap();
        let unit = settings.imu.unwrap().inertial_config().unwrap();
        assert_eq!(unit.interval_ns, 20_000_000);
        let (read, meant) = (unit.noise, Grade::Mems.noise().density);
        assert!((read.arw / meant.arw - 1.0).abs() < 1e-12);
        assert!((read.accel_bias_walk / meant.accel_bias_walk - 1.0).abs() < 1e-12);
        assert_eq!(
            unit.start,
            surefix_core::ins::AttitudeStart::Given {
                roll_pitch_heading_rad: request.attitude_deg.map(f64::to_radians)
            }
        );
    }

    #[test]
    fn what_cannot_be_is_refused_with_the_next_step() {
        let time = GpsTime::from_week_tow_s(2111, 0);
        let refused = |request: Request| {
            let error = Samples::new(&request, time, time).err().unwrap();
            error.to_string()
        };
        let good = request(Grade::Mems);
        let rate = refused(Request {
            rate_hz: 60,
            ..good
        });
        assert!(rate.contains("100"), "{rate}");
        let place = refused(Request {
            r_e_m: [1.0, 2.0, 3.0],
            ..good
        });
        assert!(place.contains("ECEF"), "{place}");
    }
}
