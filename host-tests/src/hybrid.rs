//! `surefix hybrid`: a recorded inertial unit beside a receiver that is synthesised along the recorded
//! track of its antenna.
//!
//! ```text
//! track (.pos), samples ──moved to the day of──► broadcast ephemerides (RINEX)
//!        └─► signal path of the simulator, clock, white noise ─► receiver.rtcm3, imu.sfx, truth.csv
//! ```
//!
//! Samples, vibrations and mounting are real; pseudoranges and range rates are those that the antenna
//! would have measured under the real orbits, so the truth is known and satellites can be taken away
//! at will. The noise is that of the error model, white, and there is no ionosphere: replay with
//! `--ionosphere none`. The whole is moved in time so that as many satellites as possible are seen by
//! the track all the time; what the unit feels of the Earth does not depend on the time.
//!
//! | file | content |
//! |---|---|
//! | `receiver.rtcm3` | as of `surefix simulate` |
//! | `imu.sfx` | what is known of the unit, and its samples, as surefix's own frames |
//! | `truth.csv` | antenna ten times a second: `t_s,week,tow_s,x_m,y_m,z_m,vx_mps,vy_mps,vz_mps` |

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::{Context, Result, anyhow, bail};
use nalgebra::Vector3;
use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::SeedableRng;
use surefix_core::config::NoisePreset;
use surefix_core::gnss::weights::{
    IonosphereResidual, RowConditions, pseudorange_sigma, range_rate_sigma_mps,
};
use surefix_core::gnss::{Ephemeris, NavMessage, ObservationEpoch, SignalObservation};
use surefix_core::ingest::{encode_imu, encode_inertial};
use surefix_core::time::{GpsTime, NS_PER_S};

use crate::imu::{self, Recorded};
use crate::rinex::{self, NavigationFile};
use crate::rtcm_encode::quantise;
use crate::settings::Settings;
use crate::simulate::atmosphere::Ionosphere;
use crate::simulate::flight::AntennaState;
use crate::simulate::inertial::clock::ReceiverClock;
use crate::simulate::noise::normal;
use crate::simulate::receiver::{Epoch, cn0_dbhz};
use crate::simulate::signal_path::{Platform, SignalPath, channels};
use crate::simulate::stream::{Format, Stream};
use crate::track::Track;

/// Satellites are taken from this elevation on, degrees: above the usual mask with room for a slope.
const MIN_ELEVATION_DEG: f64 = 12.0;
/// Farthest from its toe that an ephemeris is used, s, as receivers do.
const MAX_AGE_S: f64 = 7200.0;
/// Starting times that are tried, s apart.
const START_STEP_S: i64 = 900;
/// Half the step of the difference quotient of ranges, s.
const STEP_S: f64 = 0.01;
/// Rows of `truth.csv` lie so far apart, ns.
const TRUTH_STEP_NS: i64 = 100_000_000;
/// Random numbers of the clock, apart from those of the satellites.
const STREAM_CLOCK: u64 = 1 << 32;

/// Arguments of `surefix hybrid`.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// Recorded track of the antenna: RTKLIB .pos with velocities
    #[arg(long, value_name = "FILE")]
    pub track: PathBuf,
    /// Recording of the inertial unit
    #[arg(long, value_name = "FILE")]
    pub imu: PathBuf,
    /// Settings in TOML with a section [imu]
    #[arg(long, value_name = "FILE")]
    pub config: PathBuf,
    /// RINEX navigation file; its orbits are flown under, at whatever time of its day fits best
    #[arg(long, value_name = "FILE")]
    pub nav: PathBuf,
    /// Most satellites the receiver tracks
    #[arg(long, value_name = "N", default_value_t = 12)]
    pub satellites: usize,
    /// Tracks N satellites only from T0 to T1, seconds from the first epoch; may be given several times
    #[arg(long, value_name = "N:T0:T1")]
    pub drop: Vec<Reduction>,
    /// Epochs per second; the rows of the track must fall on them
    #[arg(long, default_value_t = 1)]
    pub rate_hz: u32,
    /// Length in seconds [default: that of the track]
    #[arg(long, value_name = "SECONDS")]
    pub duration: Option<f64>,
    /// Seed of noise and clock
    #[arg(long)]
    pub seed: u64,
    /// Directory to write to; made if absent
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// A time with fewer satellites.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reduction {
    /// How many are left.
    pub satellites: usize,
    /// From here on, s from the first epoch.
    pub from_s: f64,
    /// Up to here, itself not included, s.
    pub to_s: f64,
}

impl FromStr for Reduction {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> Result<Self> {
        let wrong = || anyhow!("\"{text}\" is not N:T0:T1, for example 3:100:160");
        let words: Vec<&str> = text.split(':').collect();
        let &[satellites, from_s, to_s] = words.as_slice() else {
            return Err(wrong());
        };
        let reduction = Self {
            satellites: satellites.parse().map_err(|_| wrong())?,
            from_s: from_s.parse().map_err(|_| wrong())?,
            to_s: to_s.parse().map_err(|_| wrong())?,
        };
        if reduction.from_s < reduction.to_s {
            Ok(reduction)
        } else {
            Err(wrong())
        }
    }
}

/// What was synthesised.
pub struct Hybrid {
    /// `receiver.rtcm3`.
    pub receiver: Vec<u8>,
    /// `imu.sfx`.
    pub imu: Vec<u8>,
    /// The track where it was moved to.
    pub track: Track,
    /// First epoch.
    pub start: GpsTime,
    /// From the first epoch to the last, s.
    pub duration_s: f64,
    /// Epochs of the receiver, those without a satellite too.
    pub epochs: usize,
    /// Names of the satellites; a reduction leaves the first.
    pub satellites: Vec<String>,
}

/// The antenna on its track, with a clock.
struct Carrier<'a> {
    track: &'a Track,
    start: GpsTime,
    clock: ReceiverClock,
}

impl Platform for Carrier<'_> {
    fn antenna(&self, true_s: f64) -> AntennaState {
        let (r_e, v_e) = self.track.state(self.start, true_s);
        AntennaState {
            position_e_m: r_e,
            velocity_e_mps: v_e,
        }
    }

    fn clock_bias_s(&self, receiver_s: f64) -> f64 {
        self.clock.bias_s(receiver_s)
    }
}

/// A tracked satellite.
struct Tracked {
    ephemeris: Ephemeris,
    random: ChaCha20Rng,
    since: Option<GpsTime>,
}

/// Ephemerides of one day, one message per satellite and reference time, as their bits hold them.
fn ephemerides(path: &Path) -> Result<Vec<Ephemeris>> {
    let bytes = rinex::read_unzipped(path)?;
    let (text, _) = rinex::text_of(bytes).with_context(|| path.display().to_string())?;
    let file = NavigationFile::parse(&text).with_context(|| path.display().to_string())?;
    let all: Vec<Ephemeris> = file
        .ephemerides
        .iter()
        .map(|timed| timed.ephemeris)
        .filter(|e| e.health == 0 && e.message != NavMessage::GalileoFnav)
        .filter(|e| e.sigma_ura_m.is_some())
        .collect();
    if all.is_empty() {
        bail!(
            "{} holds no ephemeris that can be used: give a RINEX navigation file",
            path.display()
        );
    }
    Ok(all)
}

/// The ephemeris of every satellite whose reference time is nearest.
fn nearest(all: &[Ephemeris], time: GpsTime) -> Vec<Ephemeris> {
    let mut chosen: Vec<Ephemeris> = Vec::new();
    for ephemeris in all {
        let age_s = |e: &Ephemeris| time.seconds_since(e.toe).abs();
        if age_s(ephemeris) > MAX_AGE_S {
            continue;
        }
        match chosen
            .iter_mut()
            .find(|other| other.satellite == ephemeris.satellite)
        {
            Some(other) if age_s(ephemeris) < age_s(other) => *other = *ephemeris,
            Some(_) => {}
            None => chosen.push(*ephemeris),
        }
    }
    chosen.sort_by_key(|e| e.satellite.index());
    chosen
}

/// Satellites seen by the track from its first to its last second, when it starts at `start`.
fn seen(all: &[Ephemeris], track: &Track, start: GpsTime) -> Vec<Ephemeris> {
    let duration_s = track.duration_s();
    let middle = start.plus_ns((duration_s * 0.5e9) as i64);
    let (r_e, _) = track.state(track.first(), 0.0);
    let up = r_e.normalize();
    let mut chosen = nearest(all, middle);
    chosen.retain(|ephemeris| {
        [0.0, 0.5, 1.0].into_iter().all(|share| {
            let (r_e, _) = track.state(track.first(), share * duration_s);
            let since_toe_s = start.seconds_since(ephemeris.toe) + share * duration_s;
            let r_es_e =
                crate::simulate::orbit::position_frozen_e(ephemeris, since_toe_s, since_toe_s);
            let line = (r_es_e - r_e).normalize();
            // A fifth of a degree between the vertical and the radius does not matter.
            libm::asin(line.dot(&up)).to_degrees() >= MIN_ELEVATION_DEG
        })
    });
    chosen
}

/// The start, of those tried, at which most satellites are seen; the first of equals.
fn best_start(all: &[Ephemeris], track: &Track) -> (GpsTime, Vec<Ephemeris>) {
    let first = all.iter().map(|e| e.toe).min().unwrap_or(track.first());
    let last = all.iter().map(|e| e.toe).max().unwrap_or(first);
    // Where the track's times lie within a second stays as it is.
    let fraction_ns = track.first().ns().rem_euclid(NS_PER_S);
    let mut best = (first, Vec::new());
    let mut start = first.plus_ns(fraction_ns - first.ns().rem_euclid(NS_PER_S));
    while start < last {
        let chosen = seen(all, track, start);
        if chosen.len() > best.1.len() {
            best = (start, chosen);
        }
        start = start.plus_ns(START_STEP_S * NS_PER_S);
    }
    best
}

/// Orders satellites so that any beginning is spread over the sky: the highest, then always the one
/// farthest from all before.
fn spread(chosen: Vec<Ephemeris>, way: &SignalPath<'_, Carrier<'_>>) -> Vec<Ephemeris> {
    let mut left: Vec<(Ephemeris, Vector3<f64>, f64)> = chosen
        .into_iter()
        .map(|ephemeris| {
            let ray = way.path(&ephemeris, way.start, 0.0).ray;
            let (sin, cos) = (libm::sin(ray.elevation_rad), libm::cos(ray.elevation_rad));
            let line = Vector3::new(
                cos * libm::sin(ray.azimuth_rad),
                cos * libm::cos(ray.azimuth_rad),
                sin,
            );
            (ephemeris, line, -sin)
        })
        .collect();
    let mut order = Vec::new();
    while let Some(next) = (0..left.len()).min_by(|a, b| left[*a].2.total_cmp(&left[*b].2)) {
        let (ephemeris, line, _) = left.remove(next);
        for other in &mut left {
            let cosine = other.1.dot(&line);
            other.2 = if order.is_empty() {
                cosine
            } else {
                other.2.max(cosine)
            };
        }
        order.push(ephemeris);
    }
    order
}

/// Synthesises in memory.
///
/// # Errors
/// When a file cannot be read or they do not go together; the message tells what to do.
pub fn synthesise(args: &Args) -> Result<Hybrid> {
    if !(1..=10).contains(&args.rate_hz) {
        bail!("--rate-hz {} is not between 1 and 10", args.rate_hz);
    }
    if let Some(duration_s) = args.duration.filter(|s| !(*s > 0.0)) {
        bail!("--duration {duration_s} is not more than 0");
    }
    let recorded = Track::read(&args.track, 0.0)?;
    let settings = Settings::read(&args.config)?;
    let samples = imu::read(&args.imu, settings.imu.as_ref())?;
    let all = ephemerides(&args.nav)?;
    let (start, chosen) = best_start(&all, &recorded);
    if chosen.len() < args.satellites {
        bail!(
            "at no time of {} are {} satellites seen by the track: ask for {} with --satellites",
            args.nav.display(),
            args.satellites,
            chosen.len()
        );
    }
    let shift_ns = start.ns() - recorded.first().ns();
    let track = recorded.moved(shift_ns);
    let duration_s = match args.duration {
        Some(duration_s) if duration_s < track.duration_s() => duration_s,
        _ => track.duration_s(),
    };
    let end = recorded.first().plus_ns((duration_s * 1e9) as i64);
    let imu = imu_bytes(&samples, shift_ns, end)?;

    let interval_ns = NS_PER_S / i64::from(args.rate_hz);
    let interval_s = interval_ns as f64 / NS_PER_S as f64;
    let count = (duration_s / interval_s) as usize + 1;
    let random = |stream| {
        let mut random = ChaCha20Rng::seed_from_u64(args.seed);
        random.set_stream(stream);
        random
    };
    let carrier = Carrier {
        track: &track,
        start,
        clock: ReceiverClock::new(random(STREAM_CLOCK), interval_s, count),
    };
    let way = SignalPath {
        platform: &carrier,
        start,
        troposphere: true,
    };
    let chosen = chosen.iter().map(quantise).collect();
    let mut tracked: Vec<Tracked> = spread(chosen, &way)
        .into_iter()
        .take(args.satellites)
        .map(|ephemeris| Tracked {
            ephemeris,
            random: random(1 + ephemeris.satellite.index() as u64),
            since: None,
        })
        .collect();
    let satellites = tracked
        .iter()
        .map(|t| t.ephemeris.satellite.to_string())
        .collect();
    let mut stream = Stream::new(Format::Rtcm3, Ionosphere::None, false);
    for number in 0..count {
        let label = start.plus_ns(number as i64 * interval_ns);
        let t_s = number as f64 * interval_s;
        let left = args
            .drop
            .iter()
            .filter(|reduction| (reduction.from_s..reduction.to_s).contains(&t_s))
            .map(|reduction| reduction.satellites)
            .min()
            .unwrap_or(args.satellites);
        stream.push(&epoch(&way, &mut tracked, left, label))?;
    }
    Ok(Hybrid {
        receiver: stream.bytes,
        imu,
        start,
        duration_s,
        epochs: count,
        satellites,
        track: track.clone(),
    })
}

/// One epoch of the receiver with the first `left` of its satellites.
fn epoch(
    way: &SignalPath<'_, Carrier<'_>>,
    tracked: &mut [Tracked],
    left: usize,
    label: GpsTime,
) -> Epoch {
    let mut epoch = Epoch {
        observations: ObservationEpoch::EMPTY,
        ephemerides: Vec::new(),
        lock_ms: Vec::new(),
        antenna: way.antenna(label, 0.0),
    };
    epoch.observations.restart(label);
    for (place, tracked) in tracked.iter_mut().enumerate() {
        // Drawn also when unseen, so that noise does not depend on what was taken away.
        let (code, rate) = (normal(&mut tracked.random), normal(&mut tracked.random));
        if place >= left {
            tracked.since = None;
            continue;
        }
        let since = *tracked.since.get_or_insert(label);
        let ephemeris = &tracked.ephemeris;
        let Some(channel) = channels(ephemeris.satellite.system(), false).pop() else {
            continue;
        };
        let elevation_rad = way.path(ephemeris, label, 0.0).ray.elevation_rad;
        let sin_elevation = libm::sin(elevation_rad);
        let sigma = pseudorange_sigma(
            NoisePreset::Elevation,
            &RowConditions {
                satellite: ephemeris.satellite,
                elevation_rad,
                sin_elevation,
                sigma_ura_m: ephemeris.sigma_ura_m.unwrap_or(0.0),
                noise_factor: 1.0,
                ionosphere_scale: 1.0,
                ionosphere: IonosphereResidual::None,
                geomagnetic_latitude_rad: 0.0,
                troposphere: true,
            },
        );
        let range_m = |after_s| way.clean_range_m(ephemeris, &channel, label, after_s);
        let rate_mps = (range_m(STEP_S) - range_m(-STEP_S)) / (2.0 * STEP_S);
        let mut observation = SignalObservation::new(channel.signal);
        observation.pseudorange_m = Some(range_m(0.0) + sigma.total_m() * code);
        observation.range_rate_mps = Some(rate_mps + range_rate_sigma_mps(sin_elevation) * rate);
        observation.cn0_dbhz = Some(cn0_dbhz(elevation_rad));
        // An epoch holds more satellites than are tracked.
        let _ = epoch.observations.add(ephemeris.satellite, observation);
        epoch.ephemerides.push(*ephemeris);
        epoch
            .lock_ms
            .push(((label.ns() - since.ns()) / 1_000_000) as u64);
    }
    epoch
}

/// What is known of the unit, and its samples up to a time of the recording.
fn imu_bytes(recorded: &Recorded, shift_ns: i64, end: GpsTime) -> Result<Vec<u8>> {
    let mut frame = [0; 512];
    let refused = |error| anyhow!("a native frame did not encode: {error:?}");
    let length = encode_inertial(&recorded.unit, &mut frame).map_err(refused)?;
    let mut bytes = frame[..length].to_vec();
    for sample in recorded.samples.iter().filter(|s| s.time <= end) {
        let mut moved = *sample;
        moved.time = sample.time.plus_ns(shift_ns);
        let length = encode_imu(&moved, &mut frame).map_err(refused)?;
        bytes.extend(&frame[..length]);
    }
    Ok(bytes)
}

/// `truth.csv` of a track from a time on, ten rows a second.
///
/// # Errors
/// Never: what is written to is memory.
pub fn truth_csv(track: &Track, start: GpsTime, duration_s: f64) -> Result<String> {
    let mut csv = "t_s,week,tow_s,x_m,y_m,z_m,vx_mps,vy_mps,vz_mps\n".to_owned();
    let rows = (duration_s * 1e9) as i64 / TRUTH_STEP_NS;
    for row in 0..=rows {
        let since_ns = row * TRUTH_STEP_NS;
        let time = start.plus_ns(since_ns);
        let t_s = since_ns as f64 / NS_PER_S as f64;
        let (r, v) = track.state(start, t_s);
        let ([x, y, z], [vx, vy, vz]): ([f64; 3], [f64; 3]) = (r.into(), v.into());
        writeln!(
            csv,
            "{t_s},{},{},{x},{y},{z},{vx},{vy},{vz}",
            time.week(),
            time.tow_s()
        )?;
    }
    Ok(csv)
}

/// Writes the files into a directory, made if absent.
///
/// # Errors
/// When one cannot be written.
pub fn write(hybrid: &Hybrid, directory: &Path) -> Result<()> {
    crate::replay::make_directory(directory)?;
    let truth = truth_csv(&hybrid.track, hybrid.start, hybrid.duration_s)?;
    let files: [(&str, &[u8]); 3] = [
        ("receiver.rtcm3", &hybrid.receiver),
        ("imu.sfx", &hybrid.imu),
        ("truth.csv", truth.as_bytes()),
    ];
    for (name, content) in files {
        let path = directory.join(name);
        std::fs::write(&path, content)
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

/// Runs `surefix hybrid`.
///
/// # Errors
/// As [`synthesise`] and [`write()`].
pub fn run(args: &Args) -> Result<()> {
    let hybrid = synthesise(args)?;
    write(&hybrid, &args.out)?;
    println!(
        "{} epochs from GPS week {} {:.3} s on, {} in {}",
        hybrid.epochs,
        hybrid.start.week(),
        hybrid.start.tow_s(),
        hybrid.satellites.join("+"),
        args.out.display()
    );
    Ok(())
}
