//! The bytes a board in a simulated flight would see.
//!
//! The receiver's stream is made the long way: signals from the broadcast orbits through the atmosphere
//! to the antenna, satellite clocks and group delays, MSM7 with Doppler. What a scenario folder holds
//! is put on top: the same noise and faults on the same satellites, at the same epochs.

use std::sync::Arc;

use anyhow::{Result, anyhow};
use nalgebra::Matrix3;
use rand_chacha::ChaCha20Rng;
use surefix_core::consts::SPEED_OF_LIGHT_MPS;
use surefix_core::gnss::{ObservationEpoch, Satellite, SignalObservation};
use surefix_core::ingest::{
    encode_imu, encode_inertial, encode_receiver_latency, encode_unit, encode_unit_sample,
};
use surefix_core::ins::{AttitudeStart, InertialConfig, MeasurementFactors, SensorRange};
use surefix_core::time::{GpsTime, NS_PER_S};

use super::clock::CLOCK_NOISE;
use super::trajectory::matrix;
use super::unit_faults::UnitFaultSpec;
use super::units::{FlyingUnit, TrueUnit, UnitPlan};
use super::{Scenario, random};
use crate::simulate::atmosphere::{Ionosphere, ionosphere_m};
use crate::simulate::disturbances::on_carrier;
use crate::simulate::flight::{AntennaState, Flight};
use crate::simulate::inertial::measurements::Row;
use crate::simulate::noise::normal;
use crate::simulate::receiver::{self, PHASE_SIGMA_M, cn0_dbhz};
use crate::simulate::signal_path::{Channel, Platform, SignalPath};
use crate::simulate::stream::{Format, Stream};

/// Random numbers of carrier phases and second signals.
const STREAM_RECEIVER: u64 = (1 << 32) + 3;
/// Beyond every flight here: 500 °/s and 20 g.
const SENSOR_RANGE: SensorRange = SensorRange {
    rate_radps: 500.0 * core::f64::consts::PI / 180.0,
    specific_force_mps2: 20.0 * 9.806_65,
};
/// Half the step of the difference quotient of ranges, s.
const STEP_S: f64 = 0.01;

/// What lies between satellites and receiver, and which signals it tracks.
#[derive(Clone, Copy, Debug)]
pub struct Radio {
    /// Two signals per satellite.
    pub dual_frequency: bool,
    /// The ionosphere.
    pub ionosphere: Ionosphere,
    /// The troposphere of Saastamoinen.
    pub troposphere: bool,
    /// What the receiver writes, and so which signals it tracks.
    pub format: Format,
}

/// A flight at one epoch, with what jumps have put on its clock by then.
struct Flown<'a> {
    scenario: &'a Scenario,
    jumped_s: f64,
}

impl Platform for Flown<'_> {
    fn antenna(&self, true_s: f64) -> AntennaState {
        let state = self.scenario.trajectory.state(true_s);
        AntennaState {
            position_e_m: state.r_eb_e,
            velocity_e_mps: state.v_eb_e,
        }
    }

    fn clock_bias_s(&self, receiver_s: f64) -> f64 {
        self.scenario.clock.bias_s(receiver_s) + self.jumped_s
    }
}

/// `receiver.rtcm3` or `receiver.ubx`: epochs labelled with the receiver's own time, from t = 0 on.
///
/// A u-blox receiver measures 2 ms earlier, with the noise and faults of the folder's epoch.
///
/// # Errors
/// When a message does not encode.
pub fn receiver_bytes(scenario: &Scenario, radio: &Radio) -> Result<Vec<u8>> {
    let asked = &scenario.request.disturbances;
    let flight = scenario.request.flight;
    let fixed = matches!(flight, Flight::Static | Flight::StaticPerfect);
    let mut stream = Stream::new(radio.format, radio.ionosphere, fixed);
    let mut random = random(scenario.request.seed, STREAM_RECEIVER);
    let mut tracked: Vec<(Satellite, GpsTime)> = Vec::new();
    let mut before_s = None;
    for epoch in &scenario.epochs {
        let flown = Flown {
            scenario,
            jumped_s: asked.jumped_s(epoch.t_s),
        };
        let way = SignalPath {
            platform: &flown,
            start: scenario.start,
            troposphere: radio.troposphere,
        };
        let since_start_ns = libm::round(epoch.t_s * 1e9) as i64;
        let label = scenario
            .start
            .plus_ns(since_start_ns + radio.format.label_offset_ns());
        let in_view = |satellite| {
            epoch
                .rows
                .iter()
                .any(|row| row.measurement.satellite == satellite)
        };
        tracked.retain(|(satellite, _)| in_view(*satellite));
        let mut sent = receiver::Epoch {
            observations: ObservationEpoch::EMPTY,
            ephemerides: Vec::new(),
            lock_ms: Vec::new(),
            antenna: way.antenna(label, 0.0),
        };
        sent.observations.restart(label);
        let reset = asked.clock_was_set(before_s.replace(epoch.t_s), epoch.t_s);
        sent.observations.flags.clock_reset = reset;
        for row in &epoch.rows {
            let satellite = row.measurement.satellite;
            let since = match tracked.iter().find(|(known, _)| *known == satellite) {
                Some((_, since)) => *since,
                None => {
                    tracked.push((satellite, label));
                    label
                }
            };
            let channels = radio
                .format
                .channels(satellite.system(), radio.dual_frequency);
            for (number, channel) in channels.iter().enumerate() {
                let errors = if number == 0 {
                    (row.noise.0 + row.fault.0, row.noise.1 + row.fault.1)
                } else {
                    second_signal(scenario, row, &mut random)
                };
                let errors = (errors.0 + row.multipath_m[number], errors.1);
                let observation = observe(&way, radio, row, channel, label, errors, &mut random);
                // Fits: fewer satellites are above the mask than an epoch holds.
                let _ = sent.observations.add(satellite, observation);
            }
            sent.ephemerides.push(row.ephemeris);
            sent.lock_ms
                .push(((label.ns() - since.ns()) / 1_000_000) as u64);
        }
        stream.push(&sent)?;
    }
    Ok(stream.bytes)
}

/// What a board has to be told of the unit: its grade, and the attitude that `init.csv` starts from.
pub fn unit(scenario: &Scenario) -> InertialConfig {
    let initial = &scenario.initial;
    let c_n_b = scenario.truth[0].state.c_e_n.transpose() * matrix(&initial.q_e_b);
    InertialConfig {
        interval_ns: NS_PER_S as u32 / scenario.request.imu_rate_hz,
        c_b_s: Matrix3::identity().into(),
        lever_arm_b_m: [0.0; 3],
        noise: scenario.grade.noise().density,
        clock: CLOCK_NOISE,
        measurement: MeasurementFactors::ONE,
        range: SENSOR_RANGE,
        start: AttitudeStart::Given {
            roll_pitch_heading_rad: [
                libm::atan2(c_n_b[(2, 1)], c_n_b[(2, 2)]),
                -libm::asin(c_n_b[(2, 0)]),
                libm::atan2(c_n_b[(1, 0)], c_n_b[(0, 0)]),
            ],
        },
        sigma: scenario.sigma,
    }
}

/// A native frame that says how late the receiver's epochs arrive.
///
/// # Errors
/// When it does not fit.
pub fn latency_bytes(latency_ns: u32) -> Result<Vec<u8>> {
    let mut frame = [0; 32];
    let length = encode_receiver_latency(latency_ns, &mut frame)
        .map_err(|error| anyhow!("a native frame did not encode: {error:?}"))?;
    Ok(frame[..length].to_vec())
}

/// `imu.sfx`: a native frame that says what the unit is, and one per sample.
///
/// # Errors
/// When a frame does not fit.
pub fn imu_bytes(scenario: &Scenario) -> Result<Vec<u8>> {
    let mut frame = [0; 512];
    let refused = |error| anyhow!("a native frame did not encode: {error:?}");
    let length = encode_inertial(&unit(scenario), &mut frame).map_err(refused)?;
    let mut bytes = frame[..length].to_vec();
    for sample in &scenario.imu {
        let length = encode_imu(sample, &mut frame).map_err(refused)?;
        bytes.extend(&frame[..length]);
    }
    Ok(bytes)
}

/// `units.sfx`: native frames that say what the vote of three units gives and what each is, and their samples
/// in the order of their times.
///
/// # Errors
/// When a frame does not fit.
pub fn units_bytes(scenario: &Scenario, faults: &[UnitFaultSpec]) -> Result<Vec<u8>> {
    let mut frame = [0; 512];
    let refused = |error| anyhow!("a native frame did not encode: {error:?}");
    let length = encode_inertial(&unit(scenario), &mut frame).map_err(refused)?;
    let mut bytes = frame[..length].to_vec();
    let trajectory = Arc::new(scenario.trajectory.clone());
    let mut flying = Vec::new();
    for (number, plan) in UnitPlan::three().into_iter().enumerate() {
        let config = plan.config(scenario.grade);
        let length = encode_unit(number as u8, &config, &mut frame).map_err(refused)?;
        bytes.extend(&frame[..length]);
        let truth = Arc::new(TrueUnit::new(&trajectory, plan, scenario.duration_s));
        let seed = scenario.request.seed;
        let mut unit = FlyingUnit::new(&truth, number, scenario.grade, scenario.start, seed);
        unit.faults = faults.to_vec();
        flying.push(unit);
    }
    loop {
        let next = flying
            .iter()
            .enumerate()
            .filter_map(|(number, unit)| Some((unit.next_end_ns()?, number)))
            .min();
        let Some((_, number)) = next else {
            return Ok(bytes);
        };
        if let Some(sample) = flying[number].sample() {
            let length = encode_unit_sample(number as u8, &sample, &mut frame).map_err(refused)?;
            bytes.extend(&frame[..length]);
        }
    }
}

/// Errors of the second signal: noise of its own and the fault of the first.
fn second_signal(scenario: &Scenario, row: &Row, random: &mut ChaCha20Rng) -> (f64, f64) {
    let measured = &row.measurement;
    let scale = if scenario.noise_free { 0.0 } else { 1.0 };
    let sigma_mps = measured.range_rate_mps.map_or(0.0, |(_, sigma)| sigma);
    (
        row.fault.0 + scale * measured.sigma_pseudorange_m * normal(random),
        row.fault.1 + scale * sigma_mps * normal(random),
    )
}

/// One signal as the receiver measures it.
fn observe(
    way: &SignalPath<'_, Flown<'_>>,
    radio: &Radio,
    row: &Row,
    channel: &Channel,
    label: GpsTime,
    errors: (f64, f64),
    random: &mut ChaCha20Rng,
) -> SignalObservation {
    let ephemeris = &row.ephemeris;
    let path = way.path(ephemeris, label, 0.0);
    let clean_m = way.clean_range_m(ephemeris, channel, label, 0.0);
    let before_m = way.clean_range_m(ephemeris, channel, label, -STEP_S);
    let after_m = way.clean_range_m(ephemeris, channel, label, STEP_S);
    let delay_m = ionosphere_m(radio.ionosphere, &path.ray, label, channel.frequency_hz)
        + on_carrier(row.ionosphere_error_m, channel.frequency_hz);
    let wavelength_m = SPEED_OF_LIGHT_MPS / channel.frequency_hz;
    let scale = if way.platform.scenario.noise_free {
        0.0
    } else {
        1.0
    };
    let phase_m = clean_m - delay_m + scale * PHASE_SIGMA_M * normal(random);

    let mut observation = SignalObservation::new(channel.signal);
    observation.pseudorange_m = Some(clean_m + delay_m + errors.0);
    observation.carrier_phase_cycles = Some(phase_m / wavelength_m);
    observation.range_rate_mps = Some((after_m - before_m) / (2.0 * STEP_S) + errors.1);
    observation.cn0_dbhz = Some(cn0_dbhz(row.elevation_rad));
    observation
}
