//! What is measured of inertial navigation: a sample, a second, and an epoch of one filter.

use super::measure::{RUNS, Row, require};
use super::sky::{self, Random};
use core::hint::black_box;
use static_cell::ConstStaticCell;
use surefix_core::consts::OMEGA_EARTH_WGS84_RADPS;
use surefix_core::ekf::layout::{BLOCKS, FIRST_OFFSET};
use surefix_core::ekf::navigator::Navigator;
use surefix_core::gnss::{CorrectedEpoch, CorrectedMeasurement, Satellite, System};
use surefix_core::ins::{
    AttitudeStart, ClockNoise, ImuSample, Increment, InertialConfig, InertialNoise, InitialSigma,
    InitialState, Intake, MAX_UNITS, MeasurementFactors, Mechanisation, SensorRange, UnitConfig,
    UnitSample, UnitTolerance, Voting, VotingMode, gravity,
};
use surefix_core::tight::{CLOCKS, JOINT};
use surefix_core::time::{GpsTime, NS_PER_S};

/// A unit of a good MEMS grade at 100 Hz, forward of and below the antenna.
pub const UNIT: InertialConfig = InertialConfig {
    interval_ns: 10_000_000,
    c_b_s: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    lever_arm_b_m: [-0.5, 0.1, -0.8],
    noise: InertialNoise {
        arw: 4.4e-5,
        vrw: 1e-3,
        gyro_bias_walk: 1e-6,
        accel_bias_walk: 1e-4,
    },
    clock: ClockNoise {
        bias_psd: 0.009,
        drift_psd: 0.0355,
        drift_decay_per_s: 0.01,
        inter_system_psd: 1e-4,
    },
    measurement: MeasurementFactors::ONE,
    range: SensorRange {
        rate_radps: 10.0,
        specific_force_mps2: 100.0,
    },
    start: AttitudeStart::Course { min_speed_mps: 2.0 },
    sigma: InitialSigma {
        position_m: 10.0,
        velocity_mps: 0.5,
        attitude_ned_rad: [0.01; 3],
        gyro_bias_radps: 1e-4,
        accel_bias_mps2: 0.01,
        clock_bias_m: 30.0,
        clock_drift_mps: 1.0,
    },
};
/// Samples per epoch at 100 Hz.
pub const SAMPLES_PER_EPOCH: usize = 100;
/// States of the navigator's filter.
const STATES: usize = 3 * BLOCKS + CLOCKS;
/// Satellites of the rows of an epoch.
const SATELLITES: [usize; 5] = [6, 8, 12, 16, 24];
/// Distance to a satellite, m.
const RANGE_M: f64 = 22_000e3;

const STATE: InitialState = InitialState {
    time: sky::TIME,
    r_eb_e_m: sky::RECEIVER_E_M,
    v_eb_e_mps: [30.0, 20.0, 10.0],
    q_e_b: [0.5, 0.5, 0.5, 0.5],
    gyro_bias_radps: [0.0; 3],
    accel_bias_mps2: [0.0; 3],
    clock_bias_m: 0.0,
    clock_drift_mps: 0.0,
};

static MECHANISATION: ConstStaticCell<Mechanisation> = ConstStaticCell::new(Mechanisation::EMPTY);
static INTAKE: ConstStaticCell<Intake> = ConstStaticCell::new(Intake::EMPTY);
static VOTING: ConstStaticCell<Voting> = ConstStaticCell::new(Voting::EMPTY);
static NAVIGATOR: ConstStaticCell<Navigator<CLOCKS, JOINT>> =
    ConstStaticCell::new(Navigator::EMPTY);
static EPOCH: ConstStaticCell<CorrectedEpoch> = ConstStaticCell::new(CorrectedEpoch::EMPTY);

/// Measures every stage and prints its rows.
#[inline(never)]
pub fn all() {
    let mut random = Random::new(5);
    samples(&mut random);
    vote(&mut random);
    epochs(&mut random);
}

/// What a sample integrates: shaking about rest.
fn increment(random: &mut Random) -> Increment {
    let dt_s = 1e-9 * f64::from(UNIT.interval_ns);
    let gravity = gravity::gravity_e(&sky::RECEIVER_E_M.into());
    // The attitude of the start turns the axes around: x of the body is y of the frame, and so on.
    let held = [-gravity.y, -gravity.z, -gravity.x];
    let turning = [0.0, OMEGA_EARTH_WGS84_RADPS, 0.0];
    Increment {
        dtheta_b: turning
            .map(|rate| dt_s * (rate + 0.3 * random.normal()))
            .into(),
        dv_b: held.map(|force| dt_s * (force + random.normal())).into(),
        dt_s,
    }
}

/// A sample that ends `number` intervals after the start.
fn sample(random: &mut Random, number: i64) -> ImuSample {
    let increment = increment(random);
    ImuSample {
        time: sky::TIME.plus_ns(number * i64::from(UNIT.interval_ns)),
        interval_ns: UNIT.interval_ns,
        dtheta_is_s_rad: increment.dtheta_b.into(),
        dv_is_s_mps: increment.dv_b.into(),
    }
}

/// The mechanisation, the intake, and both.
#[inline(never)]
fn samples(random: &mut Random) {
    let (mechanisation, intake) = (MECHANISATION.take(), INTAKE.take());
    require(mechanisation.start(&STATE).is_ok(), "no start");
    intake.configure(&UNIT);
    let (mut alone, mut taken_in, mut both) = (Row::new(), Row::new(), Row::new());
    for run in 0..RUNS as i64 {
        let first = sample(random, 2 * run + 1);
        let mut increment = None;
        taken_in.run(|| {
            if let Ok(Some(taken)) = intake.take(black_box(&first)) {
                increment = Some(taken.increment);
            }
        });
        let Some(increment) = increment else {
            require(false, "a sample was not taken");
            return;
        };
        alone.run(|| {
            black_box(mechanisation.step(black_box(&increment)));
        });
        let next = sample(random, 2 * run + 2);
        both.run(|| {
            if let Ok(Some(taken)) = intake.take(black_box(&next)) {
                black_box(mechanisation.step(&taken.increment));
            }
        });
    }
    alone.print("ins/mechanisation", None, None);
    taken_in.print("ins/intake", None, None);
    both.print("ins/intake+mechanisation", None, None);
}

/// One of three units that vote.
const VOTER: UnitConfig = UnitConfig {
    interval_ns: UNIT.interval_ns,
    c_b_s: UNIT.c_b_s,
    lever_arm_b_m: [0.2, -0.1, 0.1],
    noise: UNIT.noise,
    range: UNIT.range,
    tolerance: UnitTolerance {
        gyro_bias_radps: 1e-4,
        accel_bias_mps2: 0.01,
        scale: 1e-3,
        timing_s: 1e-4,
    },
};

/// Three samples of the same time, one of each unit, to one of the vote.
#[inline(never)]
fn vote(random: &mut Random) {
    let voting = VOTING.take();
    require(voting.begin(UNIT.interval_ns).is_ok(), "no vote");
    for unit in 0..MAX_UNITS as u8 {
        require(voting.add(unit, &VOTER).is_ok(), "no unit");
    }
    let mut row = Row::new();
    let dt_s = 1e-9 * f64::from(UNIT.interval_ns);
    let root_s = libm::sqrt(dt_s);
    for number in 1..=RUNS as i64 {
        let samples = [(); MAX_UNITS].map(|()| {
            let mut noise = |density: f64| density * root_s * random.normal();
            let dtheta_is_s_rad = [(); 3].map(|()| noise(UNIT.noise.arw));
            let mut dv_is_s_mps = [(); 3].map(|()| noise(UNIT.noise.vrw));
            dv_is_s_mps[2] -= 9.8 * dt_s;
            UnitSample {
                sample: ImuSample {
                    time: sky::TIME.plus_ns(number * i64::from(UNIT.interval_ns)),
                    interval_ns: UNIT.interval_ns,
                    dtheta_is_s_rad,
                    dv_is_s_mps,
                },
                is_valid: true,
                temperature_c: None,
            }
        });
        row.run(|| {
            for (unit, sample) in black_box(&samples).iter().enumerate() {
                voting.take(unit, sample);
                black_box(voting.next_sample());
            }
        });
    }
    require(voting.mode() == VotingMode::Three, "a unit was isolated");
    row.print("ins/vote", None, None);
}

/// The navigator of the monitor: the samples of a second, and an epoch of one filter.
#[inline(never)]
fn epochs(random: &mut Random) {
    let (navigator, epoch) = (NAVIGATOR.take(), EPOCH.take());
    let mut second = Row::new();
    for n in SATELLITES {
        let mut whole = Row::new();
        let started = navigator.start(&UNIT, &STATE).is_ok();
        require(started, "no start");
        for seconds in 1..=RUNS as i64 {
            let time = sky::TIME.plus_ns(seconds * NS_PER_S);
            let increments = [(); SAMPLES_PER_EPOCH].map(|()| increment(random));
            second.run(|| {
                for increment in black_box(&increments) {
                    navigator.step(increment, time);
                }
            });
            let antenna = navigator.antenna(time);
            observe(random, n, time, antenna.r_e_m, antenna.v_e_mps, epoch);
            let mut rows = 0;
            whole.run(|| {
                let at = navigator.predict(time);
                for (index, measurement) in epoch.rows.iter().enumerate() {
                    let offset = FIRST_OFFSET + index % 3;
                    navigator.add(measurement, &at, (offset < CLOCKS).then_some(offset));
                }
                rows = navigator.update().map_or(0, |summary| summary.rows);
            });
            require(rows == 2 * n as u32, "a row was not used");
        }
        whole.print("navigator/epoch", Some(n), Some(STATES));
    }
    second.print("navigator/second", None, None);
}

/// Fills an epoch with what `n` satellites in random directions would measure, and noise.
fn observe(
    random: &mut Random,
    n: usize,
    time: GpsTime,
    r_e_m: [f64; 3],
    v_e_mps: [f64; 3],
    epoch: &mut CorrectedEpoch,
) {
    epoch.time = time;
    epoch.rows.clear();
    for prn in 1..=n as u8 {
        let Some(satellite) = Satellite::new(System::Gps, prn) else {
            continue;
        };
        let u = sky::direction(random);
        let mut r_es_e_m = r_e_m;
        let mut range_rate_mps = 0.1 * random.normal();
        for ((satellite, u), v) in r_es_e_m.iter_mut().zip(u).zip(v_e_mps) {
            *satellite += RANGE_M * u;
            range_rate_mps -= u * v;
        }
        let _ = epoch.rows.push(CorrectedMeasurement {
            satellite,
            r_es_e_m,
            v_es_e_mps: [0.0; 3],
            pseudorange_m: RANGE_M + 3.0 * random.normal(),
            sigma_pseudorange_m: 3.0,
            range_rate_mps: Some((range_rate_mps, 0.1)),
        });
    }
}
