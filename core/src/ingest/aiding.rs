//! Payloads of samples of several inertial units, of a barometer, of a magnetometer, and of what is known of
//! the aids.
//!
//! Layouts: docs/native-frame.md. As in `inertial.rs` the increments of a sample may be no numbers;
//! those of the other sensors are within what the atmosphere and the Earth's field can be.

use super::inertial::{decode_imu_fields, put_imu_fields};
use super::payload::{PayloadError, between, end, time, within};
use crate::ins::{
    AidsConfig, BarometerModel, MAX_UNITS, MagneticSample, PressureSample, UnitSample,
    ZeroVelocityModel,
};
use crate::wire::native::{self, Full, HEADER_LEN, Kind, Reader, TRAILER_LEN};

/// Bytes of a frame with one sample of one of several units.
pub const UNIT_SAMPLE_FRAME_LENGTH: usize = HEADER_LEN + 2 + 4 + 60 + TRAILER_LEN;

const IS_VALID: u8 = 1;
const HAS_TEMPERATURE: u8 = 2;

/// Coldest and hottest sensor, °C.
const TEMPERATURE_C: [f64; 2] = [-273.15, 300.0];
/// Least and greatest pressure, Pa: 50 km up, and far below the Dead Sea.
const PRESSURE_PA: [f64; 2] = [50.0, 150_000.0];
/// Strongest field, µT: a hundred times the Earth's, the end of every such sensor.
const MAX_FIELD_UT: f64 = 6_000.0;

/// Writes a sample of the unit of a number as a frame of [`UNIT_SAMPLE_FRAME_LENGTH`] bytes.
///
/// # Errors
/// [`Full`] when `out` is shorter.
pub fn encode_unit_sample(unit: u8, sample: &UnitSample, out: &mut [u8]) -> Result<usize, Full> {
    native::encode(Kind::UnitSample, out, |w| {
        let mut flags = 0;
        for (bit, is_set) in [
            (IS_VALID, sample.is_valid),
            (HAS_TEMPERATURE, sample.temperature_c.is_some()),
        ] {
            if is_set {
                flags |= bit;
            }
        }
        w.put_u8(unit)?;
        w.put_u8(flags)?;
        w.put_f32(sample.temperature_c.unwrap_or(0.0))?;
        put_imu_fields(&sample.sample, w)
    })
}

/// Reads the number of a unit and its sample. The increments may be no numbers.
///
/// # Errors
/// [`PayloadError`]: wrong length, a unit there cannot be, flags that are none, a temperature or a time
/// out of range, an interval of 0 or over 1 s.
pub fn decode_unit_sample(payload: &[u8]) -> Result<(u8, UnitSample), PayloadError> {
    let mut r = Reader::new(payload);
    let (unit, flags) = (r.u8()?, r.u8()?);
    if usize::from(unit) >= MAX_UNITS || flags & !(IS_VALID | HAS_TEMPERATURE) != 0 {
        let value = if usize::from(unit) >= MAX_UNITS {
            unit
        } else {
            flags
        };
        return Err(PayloadError::OutOfRange {
            value: value.into(),
        });
    }
    let [coldest, hottest] = TEMPERATURE_C;
    let temperature_c = r.f32()?;
    let has_temperature = flags & HAS_TEMPERATURE != 0;
    if has_temperature {
        between(temperature_c.into(), coldest, hottest)?;
    } else if temperature_c.to_bits() != 0 {
        return Err(PayloadError::OutOfRange {
            value: temperature_c.into(),
        });
    }
    let sample = decode_imu_fields(&mut r)?;
    end(&r)?;
    Ok((
        unit,
        UnitSample {
            sample,
            is_valid: flags & IS_VALID != 0,
            temperature_c: has_temperature.then_some(temperature_c),
        },
    ))
}

/// Writes a sample of a barometer as a frame.
///
/// # Errors
/// [`Full`] when `out` is too short.
pub fn encode_pressure(sample: &PressureSample, out: &mut [u8]) -> Result<usize, Full> {
    native::encode(Kind::Pressure, out, |w| {
        w.put_i64(sample.time.ns())?;
        w.put_f64(sample.pressure_pa)?;
        w.put_f64(sample.temperature_c)
    })
}

/// Reads a sample of a barometer.
///
/// # Errors
/// [`PayloadError`]: wrong length, a time, a pressure (50 to 150 000 Pa) or a temperature out of range.
pub fn decode_pressure(payload: &[u8]) -> Result<PressureSample, PayloadError> {
    let mut r = Reader::new(payload);
    let [least, greatest] = PRESSURE_PA;
    let [coldest, hottest] = TEMPERATURE_C;
    let sample = PressureSample {
        time: time(&mut r)?,
        pressure_pa: between(r.f64()?, least, greatest)?,
        temperature_c: between(r.f64()?, coldest, hottest)?,
    };
    end(&r)?;
    Ok(sample)
}

const HAS_BAROMETER: u8 = 1;
const HAS_ZERO_VELOCITY: u8 = 2;

/// Writes the aids there are as a frame. Illegal ones are written and refused when read.
///
/// # Errors
/// [`Full`] when `out` is too short.
pub fn encode_aids(aids: &AidsConfig, out: &mut [u8]) -> Result<usize, Full> {
    let barometer = aids.barometer.map_or([0.0; 4], |barometer| {
        let BarometerModel {
            sigma_m,
            drift_mps,
            scale,
            memory_s,
        } = barometer;
        [sigma_m, drift_mps, scale, memory_s]
    });
    let zero_velocity = aids.zero_velocity.map_or([0.0; 3], |still| {
        let ZeroVelocityModel {
            sigma_mps,
            force_spread_mps2,
            rate_spread_radps,
        } = still;
        [sigma_mps, force_spread_mps2, rate_spread_radps]
    });
    native::encode(Kind::Aids, out, |w| {
        let mut flags = 0;
        if aids.barometer.is_some() {
            flags |= HAS_BAROMETER;
        }
        if aids.zero_velocity.is_some() {
            flags |= HAS_ZERO_VELOCITY;
        }
        w.put_u8(flags)?;
        barometer
            .iter()
            .chain(&zero_velocity)
            .try_for_each(|value| w.put_f64(*value))
    })
}

/// Reads the aids there are; what comes out passed [`AidsConfig::check`].
///
/// # Errors
/// [`PayloadError`]: wrong length, flags that are none, numbers of an aid that is not there, with
/// [`PayloadError::Configuration`] where the check refuses.
pub fn decode_aids(payload: &[u8]) -> Result<AidsConfig, PayloadError> {
    let mut r = Reader::new(payload);
    let flags = r.u8()?;
    if flags & !(HAS_BAROMETER | HAS_ZERO_VELOCITY) != 0 {
        return Err(PayloadError::Choice { number: flags });
    }
    let [sigma_m, drift_mps, scale, memory_s] = [r.f64()?, r.f64()?, r.f64()?, r.f64()?];
    let [sigma_mps, force_spread_mps2, rate_spread_radps] = [r.f64()?, r.f64()?, r.f64()?];
    end(&r)?;
    let barometer = [sigma_m, drift_mps, scale, memory_s];
    let zero_velocity = [sigma_mps, force_spread_mps2, rate_spread_radps];
    for (bit, values) in [
        (HAS_BAROMETER, barometer.as_slice()),
        (HAS_ZERO_VELOCITY, zero_velocity.as_slice()),
    ] {
        // Room for what is not there, and nothing else.
        if flags & bit == 0
            && let Some(value) = values.iter().find(|value| value.to_bits() != 0)
        {
            return Err(PayloadError::OutOfRange { value: *value });
        }
    }
    let aids = AidsConfig {
        barometer: (flags & HAS_BAROMETER != 0).then_some(BarometerModel {
            sigma_m,
            drift_mps,
            scale,
            memory_s,
        }),
        zero_velocity: (flags & HAS_ZERO_VELOCITY != 0).then_some(ZeroVelocityModel {
            sigma_mps,
            force_spread_mps2,
            rate_spread_radps,
        }),
    };
    match aids.check() {
        Ok(()) => Ok(aids),
        Err(_) => Err(PayloadError::Configuration),
    }
}

/// Writes a sample of a magnetometer as a frame.
///
/// # Errors
/// [`Full`] when `out` is too short.
pub fn encode_magnetic_field(sample: &MagneticSample, out: &mut [u8]) -> Result<usize, Full> {
    native::encode(Kind::MagneticField, out, |w| {
        w.put_i64(sample.time.ns())?;
        sample
            .field_s_ut
            .iter()
            .try_for_each(|part| w.put_f64(*part))
    })
}

/// Reads a sample of a magnetometer.
///
/// # Errors
/// [`PayloadError`]: wrong length, a time out of range, a field beyond 6 000 µT.
pub fn decode_magnetic_field(payload: &[u8]) -> Result<MagneticSample, PayloadError> {
    let mut r = Reader::new(payload);
    let time = time(&mut r)?;
    let mut field_s_ut = [0.0; 3];
    for part in &mut field_s_ut {
        *part = within(r.f64()?, MAX_FIELD_UT)?;
    }
    end(&r)?;
    Ok(MagneticSample { time, field_s_ut })
}
