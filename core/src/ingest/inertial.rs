//! Payloads of what a filter takes besides a receiver's messages: inertial samples and what is known
//! of their unit, corrected measurements, a state to start from, the reference model.
//!
//! Layouts: docs/native-frame.md. The rules are those of `payload.rs`, but for one: the increments
//! of a sample may be NaN or infinite. A sensor that fails gives such numbers, and the monitor has to
//! say so, not the wire to lose them.

use super::payload::{
    MAX_RANGE, MAX_RATE_MPS, PayloadError, between, end, put_satellite, satellite, time, within,
};
use crate::consts::MAX_SATELLITES;
use crate::gnss::{CorrectedEpoch, CorrectedMeasurement};
use crate::ins::{
    AttitudeStart, ClockNoise, ImuSample, InertialConfig, InertialNoise, InitialSigma,
    InitialState, MeasurementFactors, ReferenceModel, SensorRange,
};
use crate::time::{GpsTime, NS_PER_S, NS_PER_WEEK};
use crate::wire::native::{self, Full, HEADER_LEN, Kind, MAX_PAYLOAD, Reader, TRAILER_LEN, Writer};

/// Bytes of a frame with one inertial sample.
pub const IMU_FRAME_LENGTH: usize = HEADER_LEN + 8 + 4 + 6 * 8 + TRAILER_LEN;

/// Bytes of a group's payload before its first row.
const GROUP_HEADER_LEN: usize = 8 + 1 + 1 + 1;
/// Most bytes of one row.
const MAX_ROW_LEN: usize = 2 + 1 + 10 * 8;
/// Rows of a group, those without a range rate too.
const ROWS_PER_GROUP: usize = (MAX_PAYLOAD - GROUP_HEADER_LEN) / MAX_ROW_LEN;

/// A buffer of this size holds the frames of any corrected epoch.
pub const MAX_CORRECTED_EPOCH_BYTES: usize = MAX_SATELLITES * MAX_ROW_LEN
    + MAX_SATELLITES.div_ceil(ROWS_PER_GROUP) * (HEADER_LEN + GROUP_HEADER_LEN + TRAILER_LEN);

const HAS_RANGE_RATE: u8 = 1;

const START_COURSE: u8 = 0;
const START_GIVEN: u8 = 1;
const START_GYROCOMPASS: u8 = 2;
const START_MAGNETIC_FIELD: u8 = 3;
const START_AUTOMATIC: u8 = 4;

const DETECT_VERTICAL: u8 = 1;
const EXCLUDE: u8 = 2;

/// Longest interval of a sample, s: a pause of the unit, not one step of it.
const MAX_SAMPLE_INTERVAL_NS: u32 = NS_PER_S as u32;
/// Largest coordinate of a place, m: beyond the satellites.
const MAX_PLACE_M: f64 = 1e8;
/// Largest velocity of a satellite or a user, m/s.
const MAX_VELOCITY_MPS: f64 = 1e5;
/// Largest bias of a gyroscope, rad/s, and of an accelerometer, m/s²: no sensor at all.
const MAX_BIAS: f64 = 100.0;
/// Largest one sigma of a measurement, m or m/s.
const MAX_SIGMA: f64 = 1e6;
/// Largest alert limit, m.
const MAX_LIMIT_M: f64 = 1e6;
/// How far the square of a quaternion's norm may lie from 1.
const MAX_NORM_ERROR: f64 = 1e-6;

fn three(r: &mut Reader<'_>, limit: f64) -> Result<[f64; 3], PayloadError> {
    Ok([
        within(r.f64()?, limit)?,
        within(r.f64()?, limit)?,
        within(r.f64()?, limit)?,
    ])
}

pub(super) fn finite<const N: usize>(r: &mut Reader<'_>) -> Result<[f64; N], PayloadError> {
    let mut values = [0.0; N];
    for value in &mut values {
        *value = r.f64()?;
    }
    Ok(values)
}

/// Room for the angles of an attitude that is given, and nothing else.
fn unused(r: &mut Reader<'_>, count: usize) -> Result<(), PayloadError> {
    for _ in 0..count {
        let bits = r.u64()?;
        if bits != 0 {
            let value = f64::from_bits(bits);
            return Err(PayloadError::OutOfRange { value });
        }
    }
    Ok(())
}

pub(super) fn put_all(w: &mut Writer<'_>, values: &[f64]) -> Result<(), Full> {
    values.iter().try_for_each(|value| w.put_f64(*value))
}

fn positive(value: f64, limit: f64) -> Result<f64, PayloadError> {
    if value > 0.0 && value <= limit {
        Ok(value)
    } else {
        Err(PayloadError::OutOfRange { value })
    }
}

/// Writes an inertial sample as a frame of [`IMU_FRAME_LENGTH`] bytes.
///
/// # Errors
/// [`Full`] when `out` is shorter.
pub fn encode_imu(sample: &ImuSample, out: &mut [u8]) -> Result<usize, Full> {
    native::encode(Kind::Imu, out, |w| put_imu_fields(sample, w))
}

pub(super) fn put_imu_fields(sample: &ImuSample, w: &mut Writer<'_>) -> Result<(), Full> {
    w.put_i64(sample.time.ns())?;
    w.put_u32(sample.interval_ns)?;
    put_all(w, &sample.dtheta_is_s_rad)?;
    put_all(w, &sample.dv_is_s_mps)
}

/// Reads an inertial sample from a payload. Its increments may be no numbers.
///
/// # Errors
/// [`PayloadError`]: wrong length, a time outside the weeks there are, an interval of 0 or over 1 s.
pub fn decode_imu(payload: &[u8]) -> Result<ImuSample, PayloadError> {
    let mut r = Reader::new(payload);
    let sample = decode_imu_fields(&mut r)?;
    end(&r)?;
    Ok(sample)
}

pub(super) fn decode_imu_fields(r: &mut Reader<'_>) -> Result<ImuSample, PayloadError> {
    let time = time(r)?;
    let interval_ns = r.u32()?;
    if interval_ns == 0 || interval_ns > MAX_SAMPLE_INTERVAL_NS {
        let value = interval_ns.into();
        return Err(PayloadError::OutOfRange { value });
    }
    let mut sample = ImuSample {
        time,
        interval_ns,
        dtheta_is_s_rad: [0.0; 3],
        dv_is_s_mps: [0.0; 3],
    };
    for value in sample
        .dtheta_is_s_rad
        .iter_mut()
        .chain(&mut sample.dv_is_s_mps)
    {
        *value = f64::from_bits(r.u64()?);
    }
    Ok(sample)
}

/// Writes what is known of an inertial unit as a frame. An illegal configuration is written and
/// refused when read.
///
/// # Errors
/// [`Full`] when `out` is too short.
pub fn encode_inertial(config: &InertialConfig, out: &mut [u8]) -> Result<usize, Full> {
    // Taken apart by name, so that a new field cannot be forgotten here.
    let InertialConfig {
        interval_ns,
        c_b_s,
        lever_arm_b_m,
        noise,
        clock,
        measurement,
        range,
        start,
        sigma,
    } = config;
    native::encode(Kind::Inertial, out, |w| {
        w.put_u32(*interval_ns)?;
        match start {
            AttitudeStart::Course { min_speed_mps } => {
                w.put_u8(START_COURSE)?;
                put_all(w, &[*min_speed_mps, 0.0, 0.0])?;
            }
            AttitudeStart::Given {
                roll_pitch_heading_rad,
            } => {
                w.put_u8(START_GIVEN)?;
                put_all(w, roll_pitch_heading_rad)?;
            }
            AttitudeStart::Gyrocompass {
                max_heading_sigma_rad,
            } => {
                w.put_u8(START_GYROCOMPASS)?;
                put_all(w, &[*max_heading_sigma_rad, 0.0, 0.0])?;
            }
            AttitudeStart::MagneticField => {
                w.put_u8(START_MAGNETIC_FIELD)?;
                put_all(w, &[0.0; 3])?;
            }
            AttitudeStart::Automatic {
                min_speed_mps,
                max_heading_sigma_rad,
            } => {
                w.put_u8(START_AUTOMATIC)?;
                put_all(w, &[*min_speed_mps, *max_heading_sigma_rad, 0.0])?;
            }
        }
        for row in c_b_s {
            put_all(w, row)?;
        }
        put_all(w, lever_arm_b_m)?;
        put_all(
            w,
            &[
                noise.arw,
                noise.vrw,
                noise.gyro_bias_walk,
                noise.accel_bias_walk,
                clock.bias_psd,
                clock.drift_psd,
                clock.drift_decay_per_s,
                clock.inter_system_psd,
                range.rate_radps,
                range.specific_force_mps2,
                sigma.position_m,
                sigma.velocity_mps,
            ],
        )?;
        put_all(w, &sigma.attitude_ned_rad)?;
        put_all(
            w,
            &[
                sigma.gyro_bias_radps,
                sigma.accel_bias_mps2,
                sigma.clock_bias_m,
                sigma.clock_drift_mps,
                measurement.pseudorange,
                measurement.range_rate,
            ],
        )
    })
}

/// Reads what is known of an inertial unit; what comes out passed [`InertialConfig::check`].
///
/// # Errors
/// [`PayloadError`], with [`PayloadError::Configuration`] where the check refuses.
#[inline(never)]
pub fn decode_inertial(payload: &[u8]) -> Result<InertialConfig, PayloadError> {
    let mut r = Reader::new(payload);
    let interval_ns = r.u32()?;
    let start = match r.u8()? {
        START_COURSE => {
            let min_speed_mps = between(r.f64()?, 0.0, MAX_VELOCITY_MPS)?;
            unused(&mut r, 2)?;
            AttitudeStart::Course { min_speed_mps }
        }
        START_GYROCOMPASS => {
            let [max_heading_sigma_rad] = finite(&mut r)?;
            unused(&mut r, 2)?;
            AttitudeStart::Gyrocompass {
                max_heading_sigma_rad,
            }
        }
        START_MAGNETIC_FIELD => {
            unused(&mut r, 3)?;
            AttitudeStart::MagneticField
        }
        START_AUTOMATIC => {
            let min_speed_mps = between(r.f64()?, 0.0, MAX_VELOCITY_MPS)?;
            let [max_heading_sigma_rad] = finite(&mut r)?;
            unused(&mut r, 1)?;
            AttitudeStart::Automatic {
                min_speed_mps,
                max_heading_sigma_rad,
            }
        }
        START_GIVEN => AttitudeStart::Given {
            roll_pitch_heading_rad: three(&mut r, core::f64::consts::TAU)?,
        },
        number => return Err(PayloadError::Choice { number }),
    };
    let c_b_s = [finite(&mut r)?, finite(&mut r)?, finite(&mut r)?];
    let lever_arm_b_m = finite(&mut r)?;
    let [arw, vrw, gyro_bias_walk, accel_bias_walk] = finite(&mut r)?;
    let [bias_psd, drift_psd, drift_decay_per_s, inter_system_psd] = finite(&mut r)?;
    let [rate_radps, specific_force_mps2] = finite(&mut r)?;
    let [position_m, velocity_mps] = finite(&mut r)?;
    let attitude_ned_rad = finite(&mut r)?;
    let [
        gyro_bias_radps,
        accel_bias_mps2,
        clock_bias_m,
        clock_drift_mps,
    ] = finite(&mut r)?;
    let [pseudorange, range_rate] = finite(&mut r)?;
    end(&r)?;
    let config = InertialConfig {
        interval_ns,
        c_b_s,
        lever_arm_b_m,
        noise: InertialNoise {
            arw,
            vrw,
            gyro_bias_walk,
            accel_bias_walk,
        },
        clock: ClockNoise {
            bias_psd,
            drift_psd,
            drift_decay_per_s,
            inter_system_psd,
        },
        measurement: MeasurementFactors {
            pseudorange,
            range_rate,
        },
        range: SensorRange {
            rate_radps,
            specific_force_mps2,
        },
        start,
        sigma: InitialSigma {
            position_m,
            velocity_mps,
            attitude_ned_rad,
            gyro_bias_radps,
            accel_bias_mps2,
            clock_bias_m,
            clock_drift_mps,
        },
    };
    match config.check() {
        Ok(()) => Ok(config),
        Err(_) => Err(PayloadError::Configuration),
    }
}

/// Writes a state to start from as a frame.
///
/// # Errors
/// [`Full`] when `out` is too short.
pub fn encode_initial_state(state: &InitialState, out: &mut [u8]) -> Result<usize, Full> {
    native::encode(Kind::InitialState, out, |w| {
        w.put_i64(state.time.ns())?;
        put_all(w, &state.r_eb_e_m)?;
        put_all(w, &state.v_eb_e_mps)?;
        put_all(w, &state.q_e_b)?;
        put_all(w, &state.gyro_bias_radps)?;
        put_all(w, &state.accel_bias_mps2)?;
        put_all(w, &[state.clock_bias_m, state.clock_drift_mps])
    })
}

/// Reads a state to start from.
///
/// # Errors
/// [`PayloadError`]: wrong length, a number outside what it can mean, a quaternion that is no rotation.
pub fn decode_initial_state(payload: &[u8]) -> Result<InitialState, PayloadError> {
    let mut r = Reader::new(payload);
    let state = InitialState {
        time: time(&mut r)?,
        r_eb_e_m: three(&mut r, MAX_PLACE_M)?,
        v_eb_e_mps: three(&mut r, MAX_VELOCITY_MPS)?,
        q_e_b: finite(&mut r)?,
        gyro_bias_radps: three(&mut r, MAX_BIAS)?,
        accel_bias_mps2: three(&mut r, MAX_BIAS)?,
        clock_bias_m: within(r.f64()?, MAX_RANGE)?,
        clock_drift_mps: within(r.f64()?, MAX_RATE_MPS)?,
    };
    end(&r)?;
    let norm2: f64 = state.q_e_b.iter().map(|part| part * part).sum();
    if libm::fabs(norm2 - 1.0) <= MAX_NORM_ERROR {
        Ok(state)
    } else {
        Err(PayloadError::OutOfRange { value: norm2 })
    }
}

/// Writes the requirements of a scenario as a frame, which asks for the reference model.
///
/// # Errors
/// [`Full`] when `out` is too short.
pub fn encode_reference_model(model: &ReferenceModel, out: &mut [u8]) -> Result<usize, Full> {
    native::encode(Kind::ReferenceModel, out, |w| {
        let mut choices = 0;
        if model.detect_vertical {
            choices |= DETECT_VERTICAL;
        }
        if model.exclude {
            choices |= EXCLUDE;
        }
        w.put_u8(choices)?;
        w.put_i64(model.hold_ns)?;
        put_all(
            w,
            &[model.p_fa, model.p_md, model.p_h0, model.hal_m, model.val_m],
        )
    })
}

/// Reads the requirements of a scenario.
///
/// # Errors
/// [`PayloadError`]: wrong length, a probability not between 0 and 1, a limit that is none, a hold
/// that is negative or over a week.
pub fn decode_reference_model(payload: &[u8]) -> Result<ReferenceModel, PayloadError> {
    let mut r = Reader::new(payload);
    let choices = r.u8()?;
    if choices & !(DETECT_VERTICAL | EXCLUDE) != 0 {
        return Err(PayloadError::Choice { number: choices });
    }
    let hold_ns = r.i64()?;
    if !(0..=NS_PER_WEEK).contains(&hold_ns) {
        let value = hold_ns as f64;
        return Err(PayloadError::OutOfRange { value });
    }
    let mut probability = || {
        let value = r.f64()?;
        if value > 0.0 && value < 1.0 {
            Ok(value)
        } else {
            Err(PayloadError::OutOfRange { value })
        }
    };
    let (p_fa, p_md, p_h0) = (probability()?, probability()?, probability()?);
    let model = ReferenceModel {
        p_fa,
        p_md,
        p_h0,
        hal_m: positive(r.f64()?, MAX_LIMIT_M)?,
        val_m: positive(r.f64()?, MAX_LIMIT_M)?,
        detect_vertical: choices & DETECT_VERTICAL != 0,
        exclude: choices & EXCLUDE != 0,
        hold_ns,
    };
    end(&r)?;
    Ok(model)
}

/// Writes the frames of one corrected epoch, one after the other, to the start of `out`, and tells
/// their length together. [`MAX_CORRECTED_EPOCH_BYTES`] hold any epoch.
///
/// # Errors
/// [`Full`] when `out` is too short.
pub fn encode_corrected_epoch(epoch: &CorrectedEpoch, out: &mut [u8]) -> Result<usize, Full> {
    // An epoch without rows is one group without rows.
    let groups = match epoch.rows.len().div_ceil(ROWS_PER_GROUP) {
        0 => 1,
        groups => groups,
    };
    let mut len: usize = 0;
    for group in 0..groups {
        let rows = epoch
            .rows
            .iter()
            .skip(group.saturating_mul(ROWS_PER_GROUP))
            .take(ROWS_PER_GROUP);
        let room = out.get_mut(len..).ok_or(Full)?;
        let written = native::encode(Kind::CorrectedObservations, room, |w| {
            w.put_i64(epoch.time.ns())?;
            w.put_bytes(&[group as u8, groups as u8, rows.len() as u8])?;
            for row in rows {
                put_satellite(w, row.satellite)?;
                w.put_u8(if row.range_rate_mps.is_some() {
                    HAS_RANGE_RATE
                } else {
                    0
                })?;
                put_all(w, &row.r_es_e_m)?;
                put_all(w, &row.v_es_e_mps)?;
                put_all(w, &[row.pseudorange_m, row.sigma_pseudorange_m])?;
                if let Some((rate_mps, sigma_mps)) = row.range_rate_mps {
                    put_all(w, &[rate_mps, sigma_mps])?;
                }
            }
            Ok(())
        })?;
        len = len.saturating_add(written);
    }
    Ok(len)
}

/// One frame of a corrected epoch: a view whose whole content was checked.
#[derive(Clone, Copy, Debug)]
pub struct CorrectedGroup<'a> {
    /// Time of the measurements.
    pub time: GpsTime,
    /// Number of this group, from 0.
    pub group: u8,
    /// Number of groups of the epoch.
    pub groups: u8,
    rows: u8,
    content: Reader<'a>,
}

impl<'a> CorrectedGroup<'a> {
    /// Checks everything a payload says.
    ///
    /// # Errors
    /// [`PayloadError`], the first found.
    pub fn decode(payload: &'a [u8]) -> Result<Self, PayloadError> {
        let mut r = Reader::new(payload);
        let time = time(&mut r)?;
        let [group, groups, rows] = r.bytes()?;
        if group >= groups {
            return Err(PayloadError::Group { group, groups });
        }
        let view = Self {
            time,
            group,
            groups,
            rows,
            content: r,
        };
        view.each(|_| {})?;
        Ok(view)
    }

    /// Hands over every row, in the order of the sender.
    pub fn for_each(&self, take: impl FnMut(CorrectedMeasurement)) {
        // The content was read to its end once, so it can be again.
        let _ = self.each(take);
    }

    fn each(&self, mut take: impl FnMut(CorrectedMeasurement)) -> Result<(), PayloadError> {
        let mut r = self.content;
        for _ in 0..self.rows {
            take(row(&mut r)?);
        }
        end(&r)
    }
}

fn row(r: &mut Reader<'_>) -> Result<CorrectedMeasurement, PayloadError> {
    let satellite = satellite(r)?;
    let has_range_rate = match r.u8()? {
        0 => false,
        HAS_RANGE_RATE => true,
        number => return Err(PayloadError::Choice { number }),
    };
    Ok(CorrectedMeasurement {
        satellite,
        r_es_e_m: three(r, MAX_PLACE_M)?,
        v_es_e_mps: three(r, MAX_VELOCITY_MPS)?,
        pseudorange_m: within(r.f64()?, MAX_RANGE)?,
        sigma_pseudorange_m: positive(r.f64()?, MAX_SIGMA)?,
        range_rate_mps: if has_range_rate {
            Some((
                within(r.f64()?, MAX_RATE_MPS)?,
                positive(r.f64()?, MAX_SIGMA)?,
            ))
        } else {
            None
        },
    })
}
