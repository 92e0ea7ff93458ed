//! Payload of what is known of one of several inertial units.
//!
//! Layout: docs/native-frame.md.

use super::inertial::{finite, put_all};
use super::payload::{PayloadError, end};
use crate::ins::{InertialNoise, MAX_UNITS, SensorRange, UnitConfig, UnitTolerance};
use crate::wire::native::{self, Full, HEADER_LEN, Kind, Reader, TRAILER_LEN};

/// Bytes of a frame with what is known of one of several units.
pub const UNIT_FRAME_LENGTH: usize = HEADER_LEN + 1 + 4 + (9 + 3 + 4 + 2 + 4) * 8 + TRAILER_LEN;

/// Writes what is known of the unit of a number as a frame of [`UNIT_FRAME_LENGTH`] bytes. An illegal
/// configuration is written and refused when read.
///
/// # Errors
/// [`Full`] when `out` is shorter.
pub fn encode_unit(number: u8, config: &UnitConfig, out: &mut [u8]) -> Result<usize, Full> {
    // Taken apart by name, so that a new field cannot be forgotten here.
    let UnitConfig {
        interval_ns,
        c_b_s,
        lever_arm_b_m,
        noise,
        range,
        tolerance,
    } = config;
    native::encode(Kind::Unit, out, |w| {
        w.put_u8(number)?;
        w.put_u32(*interval_ns)?;
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
                range.rate_radps,
                range.specific_force_mps2,
                tolerance.gyro_bias_radps,
                tolerance.accel_bias_mps2,
                tolerance.scale,
                tolerance.timing_s,
            ],
        )
    })
}

/// Reads the number of a unit and what is known of it; what comes out passed [`UnitConfig::check`].
///
/// # Errors
/// [`PayloadError`]: wrong length, a unit there cannot be, a number that is not finite;
/// [`PayloadError::Configuration`] where the check refuses.
#[inline(never)]
pub fn decode_unit(payload: &[u8]) -> Result<(u8, UnitConfig), PayloadError> {
    let mut r = Reader::new(payload);
    let number = r.u8()?;
    if usize::from(number) >= MAX_UNITS {
        let value = number.into();
        return Err(PayloadError::OutOfRange { value });
    }
    let interval_ns = r.u32()?;
    let c_b_s = [finite(&mut r)?, finite(&mut r)?, finite(&mut r)?];
    let lever_arm_b_m = finite(&mut r)?;
    let [arw, vrw, gyro_bias_walk, accel_bias_walk] = finite(&mut r)?;
    let [rate_radps, specific_force_mps2] = finite(&mut r)?;
    let [gyro_bias_radps, accel_bias_mps2, scale, timing_s] = finite(&mut r)?;
    end(&r)?;
    let config = UnitConfig {
        interval_ns,
        c_b_s,
        lever_arm_b_m,
        noise: InertialNoise {
            arw,
            vrw,
            gyro_bias_walk,
            accel_bias_walk,
        },
        range: SensorRange {
            rate_radps,
            specific_force_mps2,
        },
        tolerance: UnitTolerance {
            gyro_bias_radps,
            accel_bias_mps2,
            scale,
            timing_s,
        },
    };
    match config.check() {
        Ok(()) => Ok((number, config)),
        Err(_) => Err(PayloadError::Configuration),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::native::Frame;

    fn unit() -> UnitConfig {
        UnitConfig {
            interval_ns: 5_000_000,
            c_b_s: [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
            lever_arm_b_m: [0.25, -0.5, 0.125],
            noise: InertialNoise {
                arw: 1e-4,
                vrw: 2e-3,
                gyro_bias_walk: 3e-6,
                accel_bias_walk: 4e-5,
            },
            range: SensorRange {
                rate_radps: 5.0,
                specific_force_mps2: 60.0,
            },
            tolerance: UnitTolerance {
                gyro_bias_radps: 7e-4,
                accel_bias_mps2: 0.08,
                scale: 9e-3,
                timing_s: 1e-3,
            },
        }
    }

    #[test]
    fn what_is_written_reads_back() {
        let mut out = [0; UNIT_FRAME_LENGTH];
        assert_eq!(encode_unit(2, &unit(), &mut out), Ok(UNIT_FRAME_LENGTH));
        let (frame, _) = Frame::parse(&out).unwrap();
        assert_eq!(decode_unit(frame.payload()), Ok((2, unit())));
        for cut in 0..frame.payload().len() {
            assert!(decode_unit(&frame.payload()[..cut]).is_err());
        }
        assert_eq!(encode_unit(2, &unit(), &mut out[1..]), Err(Full));
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let refused = |number: u8, change: fn(&mut UnitConfig)| {
            let mut config = unit();
            change(&mut config);
            let mut out = [0; UNIT_FRAME_LENGTH];
            encode_unit(number, &config, &mut out).unwrap();
            let (frame, _) = Frame::parse(&out).unwrap();
            assert!(decode_unit(frame.payload()).is_err(), "{config:?}");
        };
        refused(3, |_| {});
        refused(0, |unit| unit.interval_ns = 2_000_000);
        refused(0, |unit| unit.c_b_s[0][1] = -1.0);
        refused(0, |unit| unit.lever_arm_b_m[0] = 101.0);
        refused(0, |unit| unit.noise.arw = 0.0);
        refused(0, |unit| unit.noise.vrw = f64::NAN);
        refused(0, |unit| unit.tolerance.scale = 0.2);
        refused(0, |unit| unit.tolerance.timing_s = -1e-3);
    }
}
