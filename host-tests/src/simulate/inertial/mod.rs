//! Flights with an inertial unit: `surefix simulate NAME --seed N --out DIR`.
//!
//! | file | content |
//! |---|---|
//! | `imu.csv`, `gnss.csv`, `init.csv`, `truth.csv`, `faults.csv` | a scenario folder |
//! | `receiver.rtcm3` or `receiver.ubx` | the receiver of the same flight: same track, clock, noise and faults |
//! | `imu.sfx` | native frames: what the unit is, and the samples of `imu.csv` |
//! | `units.sfx` | with `--units`: native frames of three units that vote, each with errors of its own, faults of `--imu-fault` |
//! | `scenario.toml` | what was simulated |
//!
//! Read in this order: `profile.rs` smooth functions of time, `motion.rs` a vehicle's velocity and
//! attitude, `trajectory.rs` its track and true increments, `catalogue.rs` the flights; then the
//! errors in `sensors.rs`, `clock.rs`, `measurements.rs`; and the output in `board.rs`, `folder.rs`.

pub mod board;
pub mod catalogue;
pub mod clock;
pub mod earth;
pub mod folder;
pub mod measurements;
pub mod motion;
pub mod profile;
pub mod sensors;
pub mod trajectory;
pub mod unit_faults;
pub mod units;

use anyhow::{Result, bail};
use nalgebra::Vector3;
use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::SeedableRng;
use surefix_core::consts::SPEED_OF_LIGHT_MPS;
use surefix_core::ins::sample::{ImuSample, InitialSigma, InitialState, ReferenceModel};
use surefix_core::time::{GpsTime, NS_PER_S};

use super::START_TOW_S;
use super::disturbances::Disturbances;
use super::flight::Flight;
use super::noise::normal;
use super::sky::WEEK;
use crate::faults::FaultSpec;
use catalogue::Plan;
use clock::ReceiverClock;
use measurements::{Epoch, Measurer};
use sensors::{Grade, UnitErrors, normal3};
use trajectory::{State, Trajectory, quaternion, rotation};

/// Streams of random numbers; those of satellites begin at 1.
const STREAM_UNIT: u64 = 1 << 32;
const STREAM_INITIAL: u64 = (1 << 32) + 1;
const STREAM_CLOCK: u64 = (1 << 32) + 2;

/// What to simulate.
#[derive(Clone, Debug)]
pub struct Request {
    /// Which flight.
    pub flight: Flight,
    /// Draws everything random.
    pub seed: u64,
    /// Grade of the inertial unit; the flight's own unless given.
    pub grade: Option<Grade>,
    /// Inertial samples per second.
    pub imu_rate_hz: u32,
    /// Receiver epochs per second.
    pub gnss_rate_hz: u32,
    /// Length, s; the whole flight unless given.
    pub duration_s: Option<u32>,
    /// No noise and no bias; the initial state is still off by its sigmas.
    pub noise_free: bool,
    /// Galileo beside GPS and BDS.
    pub galileo: bool,
    /// Faults beside the flight's own.
    pub faults: Vec<FaultSpec>,
    /// Outages beside the flight's own, clock jumps, errors correlated in time.
    pub disturbances: Disturbances,
}

impl Request {
    /// A flight as it is meant.
    pub fn new(flight: Flight, seed: u64) -> Self {
        Self {
            flight,
            seed,
            grade: None,
            imu_rate_hz: 100,
            gnss_rate_hz: 1,
            duration_s: None,
            noise_free: false,
            galileo: false,
            faults: Vec::new(),
            disturbances: Disturbances::default(),
        }
    }
}

/// One row of the truth.
#[derive(Clone, Copy, Debug)]
pub struct TruthRow {
    /// Since the start, s.
    pub t_s: f64,
    /// Position, velocity, attitude.
    pub state: State,
    /// Receiver clock: bias, m, and drift, m/s.
    pub clock: (f64, f64),
    /// Gyroscope bias, rad/s.
    pub gyro_bias_radps: Vector3<f64>,
    /// Accelerometer bias, m/s².
    pub accel_bias_mps2: Vector3<f64>,
}

/// A simulated flight.
pub struct Scenario {
    /// What was asked for.
    pub request: Request,
    /// Grade of the inertial unit.
    pub grade: Grade,
    /// Whether all noise is left out.
    pub noise_free: bool,
    /// Time zero.
    pub start: GpsTime,
    /// Length, s.
    pub duration_s: u32,
    /// Every fault.
    pub faults: Vec<FaultSpec>,
    /// The true track.
    pub trajectory: Trajectory,
    /// The true receiver clock, without the jumps asked for.
    pub clock: ReceiverClock,
    /// Inertial samples, errors included.
    pub imu: Vec<ImuSample>,
    /// Receiver epochs from t = 0 on; a scenario folder leaves the first out.
    pub epochs: Vec<Epoch>,
    /// Truth once per second from t = 0 on.
    pub truth: Vec<TruthRow>,
    /// What a filter starts from.
    pub initial: InitialState,
    /// One sigma of it.
    pub sigma: InitialSigma,
    /// Requirements of the flight.
    pub reference: ReferenceModel,
}

/// The nearest number of 15 significant digits, which is what scenario files hold.
pub fn fifteen_digits(value: f64) -> f64 {
    format!("{value:.14e}").parse().unwrap_or(value)
}

fn random(seed: u64, stream: u64) -> ChaCha20Rng {
    let mut random = ChaCha20Rng::seed_from_u64(seed);
    random.set_stream(stream);
    random
}

/// Simulates a flight.
///
/// # Errors
/// When the rates do not fit each other, the flight is shorter than asked for, it carries no inertial
/// unit, or a fault touches nothing.
pub fn fly(request: &Request) -> Result<Scenario> {
    let name = request.flight.name();
    let Some(plan) = catalogue::plan(request.flight)? else {
        bail!(
            "{name} has no inertial unit; take lpv200 for an approach with one, or leave --imu and --imu-rate-hz out"
        );
    };
    fly_plan(request, plan)
}

/// Simulates a flight that is in no catalogue; of the one asked for only the name is taken.
///
/// # Errors
/// As [`fly`].
pub(crate) fn fly_plan(request: &Request, plan: Plan) -> Result<Scenario> {
    let name = request.flight.name();
    let imu_hz = request.imu_rate_hz;
    if !(50..=400).contains(&imu_hz) || NS_PER_S % i64::from(imu_hz) != 0 {
        bail!(
            "--imu-rate-hz {imu_hz} is not between 50 and 400 with a whole number of nanoseconds"
        );
    }
    let gnss_hz = request.gnss_rate_hz;
    if !(1..=50).contains(&gnss_hz) || !imu_hz.is_multiple_of(gnss_hz) || 1000 % gnss_hz != 0 {
        bail!(
            "--rate-hz {gnss_hz} does not divide {imu_hz} samples and 1000 ms: epochs must coincide with inertial samples"
        );
    }
    let duration_s = request.duration_s.unwrap_or(plan.duration_s);
    if duration_s == 0 || duration_s > plan.duration_s {
        bail!(
            "--duration {duration_s} is not between 1 and {} s, the length of {name}",
            plan.duration_s
        );
    }
    request.disturbances.check(f64::from(duration_s))?;
    build(request, plan, duration_s)
}

fn build(request: &Request, plan: Plan, duration_s: u32) -> Result<Scenario> {
    let (imu_hz, gnss_hz) = (request.imu_rate_hz, request.gnss_rate_hz);
    let grade = request.grade.unwrap_or(plan.grade);
    let noise_free = request.noise_free || plan.noise_free;
    let start = GpsTime::from_week_tow_s(WEEK, START_TOW_S);
    let mut faults = plan.faults;
    // A flight cut short has those of its own faults that begin in it.
    faults.retain(|fault| fault.t0_s <= f64::from(duration_s));
    faults.extend(&request.faults);

    let trajectory = Trajectory::new(plan.motion, &plan.anchor, duration_s, imu_hz);
    let unit_random = random(request.seed, STREAM_UNIT);
    let mut unit = UnitErrors::new(grade.noise(), noise_free, unit_random);
    let clock = ReceiverClock::new(
        random(request.seed, STREAM_CLOCK),
        1.0 / f64::from(gnss_hz),
        (duration_s * gnss_hz) as usize,
    );
    let mut measurer = Measurer::new(
        start,
        request.seed,
        noise_free,
        request.galileo,
        &plan.outages,
        &faults,
        &request.disturbances,
    );

    let interval_ns = NS_PER_S as u32 / imu_hz;
    let samples = (duration_s * imu_hz) as usize;
    let mut imu = Vec::with_capacity(samples);
    let (mut epochs, mut truth) = (Vec::new(), Vec::new());
    for k in 0..=samples {
        if k > 0 {
            let (dtheta, dv) = trajectory.increments(k);
            let (dtheta, dv) = unit.disturb(1.0 / f64::from(imu_hz), dtheta, dv);
            imu.push(ImuSample {
                time: start.plus_ns(k as i64 * i64::from(interval_ns)),
                interval_ns,
                dtheta_is_s_rad: dtheta.map(fifteen_digits).into(),
                dv_is_s_mps: dv.map(fifteen_digits).into(),
            });
        }
        if k % (imu_hz / gnss_hz) as usize == 0 {
            let t_s = trajectory.time_s(k);
            let state = trajectory.state(t_s);
            let mut clock_now = clock.at_step(epochs.len());
            clock_now.0 += SPEED_OF_LIGHT_MPS * request.disturbances.jumped_s(t_s);
            epochs.push(measurer.measure(t_s, &state, clock_now));
            if k % imu_hz as usize == 0 {
                truth.push(TruthRow {
                    t_s,
                    state,
                    clock: clock_now,
                    gyro_bias_radps: unit.gyro_bias_radps,
                    accel_bias_mps2: unit.accel_bias_mps2,
                });
            }
        }
    }
    measurer.check()?;
    let sigma = initial_sigma(grade);
    let initial = initial_state(start, &truth[0], &sigma, request.seed);
    Ok(Scenario {
        request: request.clone(),
        grade,
        noise_free,
        start,
        duration_s,
        faults,
        trajectory,
        clock,
        imu,
        epochs,
        truth,
        initial,
        sigma,
        reference: plan.reference,
    })
}

/// How far a filter's start may be off.
pub(crate) fn initial_sigma(grade: Grade) -> InitialSigma {
    let noise = grade.noise();
    InitialSigma {
        position_m: 10.0,
        velocity_mps: 0.5,
        attitude_ned_rad: noise.attitude_ned_rad,
        gyro_bias_radps: noise.gyro_bias_radps,
        accel_bias_mps2: noise.accel_bias_mps2,
        clock_bias_m: 30.0,
        clock_drift_mps: 1.0,
    }
}

/// The truth with a draw of the initial sigmas on it; biases are taken for zero.
pub(crate) fn initial_state(
    start: GpsTime,
    truth: &TruthRow,
    sigma: &InitialSigma,
    seed: u64,
) -> InitialState {
    let mut random = random(seed, STREAM_INITIAL);
    let State {
        r_eb_e,
        v_eb_e,
        c_e_b,
        c_e_n,
    } = truth.state;
    let tilt_n = normal3(&mut random).component_mul(&Vector3::from(sigma.attitude_ned_rad));
    InitialState {
        time: start,
        r_eb_e_m: (r_eb_e + normal3(&mut random) * sigma.position_m).into(),
        v_eb_e_mps: (v_eb_e + normal3(&mut random) * sigma.velocity_mps).into(),
        q_e_b: quaternion(&(rotation(&(c_e_n * tilt_n)) * c_e_b)),
        gyro_bias_radps: [0.0; 3],
        accel_bias_mps2: [0.0; 3],
        clock_bias_m: truth.clock.0 + normal(&mut random) * sigma.clock_bias_m,
        clock_drift_mps: truth.clock.1 + normal(&mut random) * sigma.clock_drift_mps,
    }
}
