//! The simulator: a sky, a flight, a receiver, and the RTCM 3 or UBX bytes it would send.
//!
//! `surefix simulate NAME --seed N --out DIR` writes
//!
//! | file | content |
//! |---|---|
//! | `receiver.rtcm3` | MSM7 1077, 1097, 1127 per epoch, ephemerides 1019, 1042, 1045, 1046, station 1006 |
//! | or `receiver.ubx` | RXM-RAWX per epoch, RXM-SFRBX per subframe or page |
//! | `truth.csv` | antenna position and velocity in Earth-fixed axes, one row per epoch |
//! | `scenario.toml` | what was simulated |
//!
//! These are the files of a receiver alone; `inertial` adds flights with an inertial unit, the
//! files of a scenario folder, and `barometer.csv`, what a barometer beside the unit measures.

pub mod atmosphere;
pub mod disturbances;
pub mod flight;
pub mod inertial;
pub mod noise;
pub mod orbit;
pub mod receiver;
pub mod signal_path;
pub mod sky;
pub mod stream;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use surefix_core::time::GpsTime;

use crate::aiding;
use crate::faults::{FaultCoverage, FaultInjector, FaultKind, FaultSpec};
use atmosphere::Ionosphere;
use disturbances::Disturbances;
use flight::Flight;
use inertial::sensors::Grade;
use inertial::unit_faults::UnitFaultSpec;
use receiver::{Conditions, Epoch, Receiver};
use stream::{Format, Stream};

/// Time of week of the first epoch, s: ten minutes past a reference time of the ephemerides.
pub(crate) const START_TOW_S: i64 = 274_200;
/// Longest simulation, s.
const MAX_DURATION_S: f64 = 172_800.0;

/// Arguments of `surefix simulate`.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// Which flight.
    pub name: Flight,
    /// Seed of everything random.
    #[arg(long)]
    pub seed: u64,
    /// Directory to write to; made if absent.
    #[arg(long)]
    pub out: PathBuf,
    /// Epochs per second.
    #[arg(long, default_value_t = 1.0, allow_negative_numbers = true)]
    pub rate_hz: f64,
    /// Length in seconds; the approach is 240 s, a fixed receiver 600 s unless told otherwise. Flights
    /// with an inertial unit can be cut short.
    #[arg(long, allow_negative_numbers = true)]
    pub duration: Option<f64>,
    /// No noise, multipath or signal-in-space error.
    #[arg(long)]
    pub noise_free: bool,
    /// A second signal per satellite: L2, E5b, B3I.
    #[arg(long)]
    pub dual_frequency: bool,
    /// A vacuum: no troposphere.
    #[arg(long)]
    pub no_troposphere: bool,
    /// Ionosphere; its parameters are sent in surefix's own frame, as MSM streams carry none.
    #[arg(long, value_enum, default_value_t = Ionosphere::None)]
    pub ionosphere: Ionosphere,
    /// What the receiver writes.
    #[arg(long, value_enum, default_value_t = Format::Rtcm3)]
    pub receiver: Format,
    /// Fault on a satellite, `SAT:KIND:MAG:T0:T1[:rr][:PERIOD]`, for example G05:step:50:60:180.
    #[arg(long = "fault", value_name = "SPEC")]
    pub faults: Vec<FaultSpec>,
    /// Outages, clock jumps, errors correlated in time.
    #[command(flatten)]
    pub disturbances: Disturbances,
}

/// Arguments of `surefix simulate` as they are given: those of a receiver, and an inertial unit.
#[derive(Clone, Debug, clap::Args)]
pub struct Command {
    #[command(flatten)]
    args: Args,
    /// Grade of the inertial unit, if not the flight's own; makes `static` a flight with one.
    #[arg(long, value_enum)]
    imu: Option<Grade>,
    /// Inertial samples per second: 50 to 400, 100 unless told otherwise.
    #[arg(long, alias = "rate", value_name = "HZ")]
    imu_rate_hz: Option<u32>,
    /// How long after its instant an epoch of the receiver arrives, s: at most 0.4. It is put into imu.sfx, and
    /// replay with --imu delays the epochs by it
    #[arg(
        long,
        value_name = "S",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    latency: f64,
    /// Galileo too in a flight with an inertial unit, which has GPS and BDS: 26 satellites and more in
    /// place of 20
    #[arg(long)]
    galileo: bool,
    /// Three inertial units that vote, in units.sfx: at 100, 200 and 125 samples per second, each mounted in its
    /// own way
    #[arg(long)]
    units: bool,
    /// Fault of one of them: `UNIT:KIND:MAG:T0:T1[:AXIS]`, KIND one of step, drift, scale, stuck, noise,
    /// silence, offset; may be given several times
    #[arg(
        long,
        value_name = "SPEC",
        requires = "units",
        allow_hyphen_values = true
    )]
    imu_fault: Vec<UnitFaultSpec>,
}

/// What a simulation produced.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulation {
    /// `receiver.rtcm3` or `receiver.ubx`.
    pub receiver: Vec<u8>,
    /// `truth.csv`.
    pub truth_csv: String,
    /// `scenario.toml`.
    pub scenario_toml: String,
    /// Number of epochs.
    pub epochs: usize,
}

/// The conditions that arguments ask for.
pub fn conditions(args: &Args) -> Conditions {
    Conditions {
        seed: args.seed,
        noise_free: args.noise_free,
        dual_frequency: args.dual_frequency,
        ionosphere: args.ionosphere,
        troposphere: !args.no_troposphere,
        format: args.receiver,
    }
}

/// Label of the first epoch.
fn first_epoch(args: &Args) -> GpsTime {
    let start = GpsTime::from_week_tow_s(sky::WEEK, START_TOW_S);
    start.plus_ns(args.receiver.label_offset_ns())
}

/// The receiver that arguments ask for.
fn receiver_of(args: &Args) -> Result<Receiver> {
    if !(0.01..=50.0).contains(&args.rate_hz) {
        bail!("--rate-hz {} is not between 0.01 and 50", args.rate_hz);
    }
    let Some(track) = args.name.track() else {
        bail!(
            "{} carries an inertial unit; its receiver alone is not simulated",
            args.name.name()
        );
    };
    let duration_s = args.duration.unwrap_or(track.usual_duration_s());
    // Written so that NaN is refused.
    if !(duration_s > 0.0 && duration_s <= MAX_DURATION_S) {
        bail!("--duration {duration_s} is not more than 0 and at most {MAX_DURATION_S} s");
    }
    args.disturbances.check(duration_s)?;
    let interval_ms = libm::round(1000.0 / args.rate_hz) as i64;
    Ok(Receiver::new(
        track,
        conditions(args),
        &args.disturbances,
        first_epoch(args),
        duration_s,
        interval_ms * 1_000_000,
    ))
}

/// The epochs that arguments ask for, faults included, before encoding.
pub fn epochs(args: &Args) -> Result<impl Iterator<Item = Epoch>> {
    Ok(faulty(args, receiver_of(args)?))
}

/// Epochs with the faults of the arguments.
fn faulty(args: &Args, receiver: impl Iterator<Item = Epoch>) -> impl Iterator<Item = Epoch> {
    let start = first_epoch(args);
    let mut injector = FaultInjector::new(&args.faults, args.seed);
    receiver.map(move |mut epoch| {
        let t_s = epoch.observations.time.seconds_since(start);
        injector.apply(&mut epoch.observations, t_s);
        epoch
    })
}

/// Simulates in memory.
pub fn simulate(args: &Args) -> Result<Simulation> {
    let mut simulation = Simulation {
        receiver: Vec::new(),
        truth_csv: "t_s,week,tow_s,x_m,y_m,z_m,vx_mps,vy_mps,vz_mps\n".to_owned(),
        scenario_toml: String::new(),
        epochs: 0,
    };
    let mut stream = Stream::new(args.receiver, args.ionosphere, args.name == Flight::Static);
    let mut first = None;
    let mut coverage = FaultCoverage::new(&args.faults);
    let mut receiver = receiver_of(args)?;
    for epoch in faulty(args, receiver.by_ref()) {
        let time = epoch.observations.time;
        let start = *first.get_or_insert(time);
        stream.push(&epoch)?;
        truth_row(&mut simulation.truth_csv, &epoch, time.seconds_since(start))?;
        simulation.epochs += 1;
        coverage.see(&epoch.observations, time.seconds_since(start));
    }
    coverage.check()?;
    receiver.check()?;
    simulation.receiver = stream.bytes;
    simulation.scenario_toml = scenario_toml(args, simulation.epochs);
    Ok(simulation)
}

fn truth_row(csv: &mut String, epoch: &Epoch, t_s: f64) -> Result<()> {
    let time = epoch.observations.time;
    let (p, v) = (epoch.antenna.position_e_m, epoch.antenna.velocity_e_mps);
    writeln!(
        csv,
        "{t_s},{},{},{},{},{},{},{},{}",
        time.week(),
        time.tow_s(),
        p.x,
        p.y,
        p.z,
        v.x,
        v.y,
        v.z
    )?;
    Ok(())
}

fn scenario_toml(args: &Args, epochs: usize) -> String {
    let (latitude_deg, longitude_deg, height_m) = flight::THRESHOLD;
    let own_multipath = if args.disturbances.multipath.is_some() {
        String::new()
    } else {
        format!(
            "multipath_sigma_m = \"0.13 + 0.53 exp(-elevation/10 deg)\"   # Gauss-Markov, DO-229 J.2.4\n\
             multipath_tau_s = {}\n",
            receiver::MULTIPATH_TAU_S
        )
    };
    let noise = if args.noise_free {
        "noise_free = true\n".to_owned()
    } else {
        format!(
            "noise_free = false\n\
             signal_in_space_sigma_m = {}   # one constant per satellite\n\
             thermal_sigma_m = \"0.36 - 0.21 sin(elevation)\"   # white, DO-229 J.2.4\n\
             {own_multipath}\
             range_rate_sigma_mps = {}\n\
             phase_sigma_m = {}\n",
            receiver::SIGNAL_IN_SPACE_SIGMA_M,
            receiver::RANGE_RATE_SIGMA_MPS,
            receiver::PHASE_SIGMA_M,
        )
    };
    let faults: Vec<String> = args.faults.iter().map(fault_table).collect();
    let faults = faults.join(", ");
    let disturbances = args.disturbances.scenario_lines();
    format!(
        "# Written by `surefix simulate`; the same arguments give the same files.\n\
         flight = \"{}\"\n\
         seed = {}\n\
         epochs = {epochs}\n\
         rate_hz = {}\n\
         first_epoch = {{ week = {}, tow_s = {} }}   # GPST\n\
         threshold = {{ lat_deg = {latitude_deg}, lon_deg = {longitude_deg}, h_m = {height_m} }}\n\
         tracking_mask_deg = {}\n\
         signals = \"{}\"\n\
         ionosphere = \"{}\"\n\
         troposphere = \"{}\"\n\
         {noise}\
         faults = [{faults}]   # T0 and T1 in s from the first epoch\n\
         {disturbances}\
         \n\
         [files]\n\
         receiver = \"{}\"   # {}\n\
         truth = \"truth.csv\"   # antenna at the instant of each measurement, Earth-fixed axes\n",
        args.name.name(),
        args.seed,
        args.rate_hz,
        sky::WEEK,
        first_epoch(args).tow_s(),
        receiver::TRACKING_MASK_DEG,
        match (args.dual_frequency, args.receiver) {
            (false, _) => "GPS 1C, Galileo 1C, BDS 2I",
            (true, Format::Rtcm3) => "GPS 1C 2W, Galileo 1C 7Q, BDS 2I 6I",
            (true, Format::Ubx) => "GPS 1C 2L, Galileo 1C 7Q, BDS 2I 6I",
        },
        match args.ionosphere {
            Ionosphere::None => "none",
            Ionosphere::Klobuchar => "Klobuchar, GPS form",
            Ionosphere::KlobucharBds => "Klobuchar, BDS form",
        },
        if args.no_troposphere {
            "none"
        } else {
            "Saastamoinen, standard atmosphere, relative humidity 0.7"
        },
        args.receiver.file(),
        args.receiver.content(),
    )
}

/// A fault as an inline table.
fn fault_table(fault: &FaultSpec) -> String {
    let (kind, unit) = match fault.kind {
        FaultKind::Step => ("step", "m"),
        FaultKind::Ramp => ("ramp", "mps"),
        FaultKind::Noise => ("noise", "m"),
        FaultKind::Walk => ("walk", "m_per_sqrt_s"),
        FaultKind::Oscillation => ("osc", "m"),
    };
    format!(
        "{{ satellite = \"{}\", kind = \"{kind}\", magnitude_{unit} = {}, t0_s = {}, t1_s = {}, \
         on_range_rate = {} }}",
        fault.satellite, fault.magnitude, fault.t0_s, fault.t1_s, fault.on_range_rate
    )
}

/// Runs `surefix simulate`.
pub fn run(args: &Args) -> Result<()> {
    let simulation = simulate(args)?;
    write(
        &args.out,
        &[
            (args.receiver.file(), &simulation.receiver),
            ("truth.csv", simulation.truth_csv.as_bytes()),
            ("scenario.toml", simulation.scenario_toml.as_bytes()),
        ],
    )?;
    println!(
        "{}: {} epochs, {} bytes in {}",
        args.name.name(),
        simulation.epochs,
        simulation.receiver.len(),
        args.out.join(args.receiver.file()).display()
    );
    Ok(())
}

impl Command {
    /// Runs `surefix simulate`.
    ///
    /// # Errors
    /// When the arguments do not go together, or a file cannot be written.
    pub fn run(&self) -> Result<()> {
        let has_unit = self.imu.is_some() || self.imu_rate_hz.is_some() || self.units;
        if self.args.name.track().is_some() && !has_unit {
            if self.latency != 0.0 {
                bail!("--latency is that of a receiver beside an inertial unit: give --imu too");
            }
            return run(&self.args);
        }
        let scenario = inertial::fly(&self.request()?)?;
        let radio = inertial::board::Radio {
            dual_frequency: self.args.dual_frequency,
            ionosphere: self.args.ionosphere,
            troposphere: !self.args.no_troposphere,
            format: self.args.receiver,
        };
        let receiver = inertial::board::receiver_bytes(&scenario, &radio)?;
        let latency_ns = crate::imu::latency_ns(self.latency).context("--latency")?;
        let mut imu = inertial::board::imu_bytes(&scenario)?;
        if latency_ns > 0 {
            imu.extend(inertial::board::latency_bytes(latency_ns)?);
        }
        let folder = inertial::folder::files(&scenario, self.args.receiver);
        let mut files: Vec<(&str, &[u8])> = folder
            .iter()
            .map(|(name, text)| (*name, text.as_bytes()))
            .collect();
        files.push((self.args.receiver.file(), &receiver));
        files.push(("imu.sfx", &imu));
        let units = self
            .units
            .then(|| inertial::board::units_bytes(&scenario, &self.imu_fault))
            .transpose()?;
        if let Some(units) = &units {
            files.push(("units.sfx", units));
        }
        let seed = self.args.seed;
        let air = aiding::Air::of_day(seed);
        let barometer = aiding::csv(&aiding::pressures(&scenario, &air, seed, None));
        files.push(("barometer.csv", barometer.as_bytes()));
        write(&self.args.out, &files)?;
        println!(
            "{}: {} s, {} inertial samples ({}), {} receiver epochs in {}",
            self.args.name.name(),
            scenario.duration_s,
            scenario.imu.len(),
            scenario.grade.name(),
            scenario.epochs.len(),
            self.args.out.display()
        );
        Ok(())
    }

    /// The flight asked for.
    fn request(&self) -> Result<inertial::Request> {
        let args = &self.args;
        let whole = |name: &str, value: f64| {
            // Casting saturates; NaN becomes 0, which no flight takes.
            let number = value as u32;
            if f64::from(number) != value {
                bail!(
                    "{name} {value} is no whole number, which a flight with an inertial unit needs"
                );
            }
            Ok(number)
        };
        Ok(inertial::Request {
            grade: self.imu,
            imu_rate_hz: self.imu_rate_hz.unwrap_or(100),
            gnss_rate_hz: whole("--rate-hz", args.rate_hz)?,
            duration_s: args.duration.map(|d| whole("--duration", d)).transpose()?,
            noise_free: args.noise_free,
            galileo: self.galileo,
            faults: args.faults.clone(),
            disturbances: args.disturbances.clone(),
            ..inertial::Request::new(args.name, args.seed)
        })
    }
}

/// Writes files into a directory, made if absent.
fn write(directory: &Path, files: &[(&str, &[u8])]) -> Result<()> {
    crate::replay::make_directory(directory)?;
    for (name, content) in files {
        let path = directory.join(name);
        std::fs::write(&path, content)
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}
