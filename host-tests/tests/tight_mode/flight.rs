//! A short flight with an inertial unit, and what the monitor says of it.
//!
//! The track is a formula, so that the truth is known at any instant: east at constant speed, north
//! and up in sines; the nose along the velocity, the wings banked so that the turn is coordinated.
//! Signals reach the antenna along the simulator's broadcast orbits, without an atmosphere.

#![allow(
    dead_code,
    reason = "each test that includes this module uses its part of it"
)]

use std::f64::consts::TAU;
use std::sync::OnceLock;

use nalgebra::{Matrix3, Vector3};
use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::SeedableRng;
use surefix_core::config::{Config, IonosphereModel, TroposphereModel};
use surefix_core::consts::{OMEGA_EARTH_WGS84_RADPS, SPEED_OF_LIGHT_MPS};
use surefix_core::frames::rotation;
use surefix_core::gnss::{Ephemeris, ObservationEpoch, Signal, SignalObservation, System};
use surefix_core::inertial_report::InertialReport;
use surefix_core::ingest::{
    MAX_EPOCH_BYTES, encode_configuration, encode_end_of_stream, encode_ephemeris, encode_imu,
    encode_inertial, encode_initial_state, encode_observations,
};
use surefix_core::ins::gravity::gravity_e;
use surefix_core::ins::{
    AttitudeStart, ClockNoise, ImuSample, InertialConfig, InertialNoise, InitialSigma,
    InitialState, MeasurementFactors, SensorRange,
};
use surefix_core::report::EpochReport;
use surefix_core::time::{GpsTime, NS_PER_S};
use surefix_host_tests::replay::{Executor, HostExecutor, OutputReader};
use surefix_host_tests::simulate::flight::{THRESHOLD, c_e_enu, ecef_from_geodetic};
use surefix_host_tests::simulate::noise::normal;
use surefix_host_tests::simulate::orbit::{clock_offset_s, position_frozen_e};
use surefix_host_tests::simulate::sky::{Sky, WEEK, issue_at};

/// Between samples, ms.
pub const STEP_MS: i64 = 10;
const MS: i64 = NS_PER_S / 1000;
const MASK_RAD: f64 = 0.15;
/// One sigma of pseudoranges, m, and range rates, m/s.
const SIGMA_M: f64 = 0.7;
const SIGMA_MPS: f64 = 0.05;
/// Errors of the unit: biases, and white noise per sample.
const GYRO_BIAS_RADPS: [f64; 3] = [4e-5, -3e-5, 5e-5];
const ACCEL_BIAS_MPS2: [f64; 3] = [0.012, -0.01, 0.015];
const ARW: f64 = 3e-5;
const VRW: f64 = 3e-4;
/// Clock of the receiver, m and m/s.
const CLOCK_M: f64 = 1_000.0;
const DRIFT_MPS: f64 = 0.8;

/// Ends of the sensors.
pub const RANGE: SensorRange = SensorRange {
    rate_radps: 4.0,
    specific_force_mps2: 60.0,
};

/// The instant so many milliseconds into the flight.
pub fn at(milliseconds: i64) -> GpsTime {
    GpsTime::from_week_tow_s(WEEK, 274_200).plus_ns(milliseconds * MS)
}

/// Milliseconds into the flight.
pub fn ms_of(time: GpsTime) -> i64 {
    (time.ns() - at(0).ns()) / MS
}

/// The unit and the clock, with this start.
pub fn unit(start: AttitudeStart) -> InertialConfig {
    InertialConfig {
        interval_ns: (STEP_MS * MS) as u32,
        c_b_s: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        lever_arm_b_m: [0.0; 3],
        noise: InertialNoise {
            arw: ARW,
            vrw: VRW,
            gyro_bias_walk: 1e-7,
            accel_bias_walk: 1e-5,
        },
        clock: ClockNoise {
            bias_psd: 0.01,
            drift_psd: 0.001,
            drift_decay_per_s: 0.0,
            inter_system_psd: 1e-6,
        },
        measurement: MeasurementFactors::ONE,
        range: RANGE,
        start,
        sigma: InitialSigma {
            position_m: 3.0,
            velocity_mps: 0.2,
            attitude_ned_rad: [0.01, 0.01, 0.02],
            gyro_bias_radps: 5e-5,
            accel_bias_mps2: 0.02,
            clock_bias_m: 5.0,
            clock_drift_mps: 0.5,
        },
    }
}

/// From the course over ground.
pub const COURSE: AttitudeStart = AttitudeStart::Course { min_speed_mps: 5.0 };

/// Position, velocity, acceleration in east, north, up of the runway.
fn track(t_s: f64) -> [Vector3<f64>; 3] {
    let sine = |size: f64, period_s: f64| {
        let w = TAU / period_s;
        let (s, c) = (w * t_s).sin_cos();
        [size * s, size * w * c, -size * w * w * s]
    };
    let [north, north_rate, north_rate_2] = sine(200.0, 40.0);
    let [up, up_rate, up_rate_2] = sine(20.0, 23.0);
    [
        Vector3::new(40.0 * t_s, north, 300.0 + up),
        Vector3::new(40.0, north_rate, up_rate),
        Vector3::new(0.0, north_rate_2, up_rate_2),
    ]
}

fn to_e() -> (Vector3<f64>, Matrix3<f64>) {
    let (lat_deg, lon_deg, h_m) = THRESHOLD;
    (
        ecef_from_geodetic(lat_deg, lon_deg, h_m),
        c_e_enu(lat_deg, lon_deg),
    )
}

/// Position, velocity, acceleration over the Earth.
pub fn state_e(t_s: f64) -> [Vector3<f64>; 3] {
    let (origin, c) = to_e();
    let [r, v, a] = track(t_s).map(|x| c * x);
    [origin + r, v, a]
}

/// Roll, pitch, heading against the axes at the runway, rad.
pub fn attitude_rad(t_s: f64) -> [f64; 3] {
    let [_, v, a] = track(t_s);
    let heading = v.x.atan2(v.y);
    let pitch = v.z.atan2(v.x.hypot(v.y));
    let right = a.x * heading.cos() - a.y * heading.sin();
    [(right / 9.8).atan(), pitch, heading]
}

fn c_e_b(t_s: f64) -> Matrix3<f64> {
    let c_enu_ned = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
    to_e().1 * c_enu_ned * rotation::c_n_b(&attitude_rad(t_s))
}

/// Body to axes that do not turn and are those of the Earth at t = 0.
fn c_i_b(t_s: f64) -> Matrix3<f64> {
    let (s, c) = (OMEGA_EARTH_WGS84_RADPS * t_s).sin_cos();
    Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0) * c_e_b(t_s)
}

/// True increments over (`from_s`, `to_s`].
fn increments(from_s: f64, to_s: f64) -> (Vector3<f64>, Vector3<f64>) {
    let turn = c_i_b(from_s).transpose() * c_i_b(to_s);
    let [w, x, y, z] = rotation::from_matrix(&turn).unwrap();
    let v = Vector3::new(x, y, z);
    let dtheta = v * (2.0 * v.norm().atan2(w) / v.norm());
    let middle_s = 0.5 * (from_s + to_s);
    let [r, v, a] = state_e(middle_s);
    let omega = Vector3::new(0.0, 0.0, OMEGA_EARTH_WGS84_RADPS);
    let force_e = a + omega.cross(&v) * 2.0 - gravity_e(&r);
    (
        dtheta,
        c_e_b(middle_s).transpose() * force_e * (to_s - from_s),
    )
}

/// Something that arrives.
#[derive(Clone, Debug)]
pub enum Input {
    /// A sample.
    Imu(ImuSample),
    /// An epoch of the receiver.
    Epoch(Box<ObservationEpoch>),
    /// Anything else.
    Bytes(Vec<u8>),
}

impl Input {
    /// When, ms into the flight; bytes have no time.
    pub fn ms(&self) -> i64 {
        match self {
            Self::Imu(sample) => ms_of(sample.time),
            Self::Epoch(epoch) => ms_of(epoch.time),
            Self::Bytes(_) => 0,
        }
    }

    /// The bytes of it.
    pub fn bytes(&self) -> Vec<u8> {
        match self {
            Self::Imu(sample) => frame(|out| encode_imu(sample, out).unwrap()),
            Self::Epoch(epoch) => frame(|out| encode_observations(epoch, out).unwrap()),
            Self::Bytes(bytes) => bytes.clone(),
        }
    }
}

/// A frame of what fits an epoch.
pub fn frame(encode: impl FnOnce(&mut [u8]) -> usize) -> Vec<u8> {
    let mut out = vec![0; MAX_EPOCH_BYTES];
    let length = encode(&mut out);
    out.truncate(length);
    out
}

fn broadcasts() -> &'static [Ephemeris] {
    static ALL: OnceLock<Vec<Ephemeris>> = OnceLock::new();
    ALL.get_or_init(|| {
        let of = |system| issue_at(system, at(0));
        Sky::new()
            .slots()
            .iter()
            .map(|slot| slot.broadcast(of(slot.satellite.system())))
            .collect()
    })
}

/// The receiver's clock, m, at a time of the flight.
pub fn clock_m(t_s: f64) -> f64 {
    CLOCK_M + DRIFT_MPS * t_s
}

/// What a receiver whose clock is `jump_m` farther off measures at an instant of its clock.
pub fn epoch(label_ms: i64, jump_m: f64) -> ObservationEpoch {
    let mut random = ChaCha20Rng::seed_from_u64(label_ms as u64);
    let label = at(label_ms);
    let mut epoch = ObservationEpoch::EMPTY;
    epoch.restart(label);
    for ephemeris in broadcasts() {
        let noise = [(); 2].map(|()| normal(&mut random));
        let range = |after_s: f64| range_m(ephemeris, label_ms, after_s, jump_m);
        let (range_m, elevation_rad) = range(0.0);
        if elevation_rad < MASK_RAD {
            continue;
        }
        let signal = match ephemeris.satellite.system() {
            System::Bds => Signal::C2I,
            _ => Signal::C1C,
        };
        let mut observation = SignalObservation::new(signal);
        observation.pseudorange_m = Some(range_m + SIGMA_M * noise[0]);
        let rate = (range(0.01).0 - range(-0.01).0) / 0.02;
        observation.range_rate_mps = Some(rate + SIGMA_MPS * noise[1]);
        observation.cn0_dbhz = Some(45.0);
        epoch.add(ephemeris.satellite, observation).unwrap();
    }
    epoch
}

/// Pseudorange, m, and elevation, rad.
fn range_m(ephemeris: &Ephemeris, label_ms: i64, after_s: f64, jump_m: f64) -> (f64, f64) {
    let label_s = label_ms as f64 / 1000.0 + after_s;
    let bias_s = (CLOCK_M + DRIFT_MPS * label_s + jump_m) / SPEED_OF_LIGHT_MPS;
    let [antenna, ..] = state_e(label_s - bias_s);
    let since_toe_s = at(label_ms).seconds_since(ephemeris.toe) + after_s - bias_s;
    let since_toc_s = at(label_ms).seconds_since(ephemeris.toc) + after_s - bias_s;
    let (mut flight_s, mut line) = (0.075, Vector3::zeros());
    for _ in 0..5 {
        line = position_frozen_e(ephemeris, since_toe_s - flight_s, since_toe_s) - antenna;
        flight_s = line.norm() / SPEED_OF_LIGHT_MPS;
    }
    let [first, second] = ephemeris.group_delay_s;
    let group_delay_s = match ephemeris.satellite.system() {
        System::Galileo => second,
        System::Gps | System::Bds => first,
    };
    let satellite_s =
        clock_offset_s(ephemeris, since_toc_s - flight_s, since_toe_s - flight_s) - group_delay_s;
    let up = to_e().1.transpose() * line;
    (
        SPEED_OF_LIGHT_MPS * (flight_s + bias_s - satellite_s),
        (up.z / up.norm()).asin(),
    )
}

/// The frame of a true state.
pub fn initial_state(ms: i64) -> Vec<u8> {
    let t_s = ms as f64 / 1000.0;
    let [r_e, v_e, _] = state_e(t_s);
    let state = InitialState {
        time: at(ms),
        r_eb_e_m: r_e.into(),
        v_eb_e_mps: v_e.into(),
        q_e_b: rotation::from_matrix(&c_e_b(t_s)).unwrap(),
        gyro_bias_radps: [0.0; 3],
        accel_bias_mps2: [0.0; 3],
        clock_bias_m: CLOCK_M + DRIFT_MPS * t_s,
        clock_drift_mps: DRIFT_MPS,
    };
    frame(|out| encode_initial_state(&state, out).unwrap())
}

/// Sample number `k`, from 1 on.
pub fn sample(k: i64) -> ImuSample {
    let dt_s = STEP_MS as f64 / 1000.0;
    let mut random = ChaCha20Rng::seed_from_u64(k as u64 + (1 << 40));
    let (mut dtheta, mut dv) = increments((k - 1) as f64 * dt_s, k as f64 * dt_s);
    let mut disturb = |true_value: &mut Vector3<f64>, bias: [f64; 3], density: f64| {
        *true_value += Vector3::from(bias) * dt_s;
        for part in true_value.iter_mut() {
            *part += density * dt_s.sqrt() * normal(&mut random);
        }
    };
    disturb(&mut dtheta, GYRO_BIAS_RADPS, ARW);
    disturb(&mut dv, ACCEL_BIAS_MPS2, VRW);
    ImuSample {
        time: at(k * STEP_MS),
        interval_ns: (STEP_MS * MS) as u32,
        dtheta_is_s_rad: dtheta.into(),
        dv_is_s_mps: dv.into(),
    }
}

/// Length of the flight, s.
pub const LENGTH_S: i64 = 140;

/// Everything in the order of time, samples before the epoch of their end.
pub fn flight() -> Vec<Input> {
    static FLIGHT: OnceLock<Vec<Input>> = OnceLock::new();
    FLIGHT
        .get_or_init(|| {
            let mut inputs = Vec::new();
            for second in 0..=LENGTH_S {
                inputs.push(Input::Epoch(Box::new(epoch(1000 * second, 0.0))));
                let per_second = 1000 / STEP_MS;
                if second < LENGTH_S {
                    let samples = second * per_second + 1..=(second + 1) * per_second;
                    inputs.extend(samples.map(|k| Input::Imu(sample(k))));
                }
            }
            inputs
        })
        .clone()
}

/// The configuration of all flights.
pub fn config() -> Config {
    Config {
        ionosphere: IonosphereModel::None,
        troposphere: TroposphereModel::None,
        ..Config::PRESET
    }
}

/// The frames before the first input.
pub fn preamble(unit: &InertialConfig) -> Vec<u8> {
    let mut stream = frame(|out| encode_configuration(&config(), out).unwrap());
    stream.extend(frame(|out| encode_inertial(unit, out).unwrap()));
    for ephemeris in broadcasts() {
        stream.extend(frame(|out| encode_ephemeris(ephemeris, out).unwrap()));
    }
    stream
}

/// The reports of these inputs, which are checked: a usable position has finite levels, and its error is
/// within them.
pub fn run(unit: &InertialConfig, inputs: &[Input]) -> Vec<Row> {
    let rows = run_unchecked(unit, inputs);
    for row in &rows {
        row.check();
    }
    rows
}

/// The same with what is known of the inertial side at each.
pub fn run_with_inertial(
    unit: &InertialConfig,
    inputs: &[Input],
) -> (Vec<Row>, Vec<Option<InertialReport>>) {
    let reader = read(unit, inputs);
    let rows: Vec<Row> = reader.reports.into_iter().map(Row::new).collect();
    for row in &rows {
        row.check();
    }
    (rows, reader.inertial)
}

/// The same without the checks, for inputs of another time or place than the flight.
pub fn run_unchecked(unit: &InertialConfig, inputs: &[Input]) -> Vec<Row> {
    let reader = read(unit, inputs);
    reader.reports.into_iter().map(Row::new).collect()
}

fn read(unit: &InertialConfig, inputs: &[Input]) -> OutputReader {
    let mut stream = preamble(unit);
    for input in inputs {
        stream.extend(input.bytes());
    }
    stream.extend(frame(|out| encode_end_of_stream(out).unwrap()));
    let mut reader = OutputReader::default();
    HostExecutor
        .run(&stream, &mut |piece| reader.push(piece))
        .unwrap();
    assert_eq!(reader.damaged, 0);
    reader
}

/// A report and how far it is from the truth.
#[derive(Clone, Debug)]
pub struct Row {
    /// The report.
    pub report: EpochReport,
    /// When, ms into the flight.
    pub ms: i64,
    /// Horizontal and vertical error, m.
    pub error_m: Option<[f64; 2]>,
    /// Error of the velocity, m/s.
    pub velocity_error_mps: Option<f64>,
}

impl Row {
    fn new(report: EpochReport) -> Self {
        let ms = ms_of(report.time);
        let [r_e, v_e, _] = state_e(ms as f64 / 1000.0);
        let to_enu = to_e().1.transpose();
        let error_m = report.fix.map(|fix| {
            let error = to_enu * (Vector3::from(fix.r_e_m) - r_e);
            [error.x.hypot(error.y), error.z.abs()]
        });
        let velocity_error_mps = report
            .fix
            .and_then(|fix| fix.velocity_enu_mps)
            .map(|v| (Vector3::from(v) - to_enu * v_e).norm());
        Self {
            report,
            ms,
            error_m,
            velocity_error_mps,
        }
    }

    fn check(&self) {
        let verdict = &self.report.verdict;
        if verdict.integrity.is_usable() {
            let [h, v] = self.error_m.expect("a usable verdict has a position");
            let (hpl, vpl) = (verdict.hpl.bound_m(), verdict.vpl.bound_m());
            let ms = self.ms;
            assert!(h <= hpl.unwrap() && v <= vpl.unwrap(), "{ms} ms: {h} {v}");
        }
        assert!(self.is_finite(), "{:?}", self.report);
    }

    /// Whether every number of a position and of what is told of the filter is one.
    pub fn is_finite(&self) -> bool {
        let fix = self.report.fix.is_none_or(|fix| {
            let velocity = fix.velocity_enu_mps.unwrap_or_default();
            fix.r_e_m
                .iter()
                .chain(&velocity)
                .all(|part| part.is_finite())
                && fix.clock_m.iter().flatten().all(|part| part.is_finite())
        });
        let navigation = self.report.navigation.is_none_or(|navigation| {
            [
                &navigation.v_e_mps[..],
                &navigation.q_e_b,
                &navigation.roll_pitch_heading_deg,
                &navigation.clock,
                &navigation.sigma_position_enu_m,
                &navigation.sigma_velocity_enu_mps,
                &navigation.sigma_attitude_enu_deg,
                &navigation.fault_free_m,
                &[navigation.nis],
            ]
            .into_iter()
            .flatten()
            .all(|part| part.is_finite())
        });
        fix && navigation
    }
}
