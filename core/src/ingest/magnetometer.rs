//! Payload of what is known of a magnetometer.
//!
//! Layout: docs/native-frame.md. The rules are those of `payload.rs`.

use super::payload::{PayloadError, end};
use crate::ins::Magnetometer;
use crate::wire::native::{self, Full, Kind, Reader, Writer};

fn put_all(w: &mut Writer<'_>, values: &[f64]) -> Result<(), Full> {
    values.iter().try_for_each(|value| w.put_f64(*value))
}

fn three(r: &mut Reader<'_>) -> Result<[f64; 3], PayloadError> {
    Ok([r.f64()?, r.f64()?, r.f64()?])
}

/// Writes what is known of a magnetometer as a frame. An illegal configuration is written and refused when
/// read.
///
/// # Errors
/// [`Full`] when `out` is too short.
pub fn encode_magnetometer(magnetometer: &Magnetometer, out: &mut [u8]) -> Result<usize, Full> {
    // Taken apart by name, so that a new field cannot be forgotten here.
    let Magnetometer {
        hard_iron_s_ut,
        soft_iron_b_s,
        declination_rad,
        sigma_declination_rad,
        declination_year,
        dip_rad,
        strength_ut,
        sigma_ut,
    } = magnetometer;
    native::encode(Kind::Magnetometer, out, |w| {
        put_all(w, hard_iron_s_ut)?;
        for row in soft_iron_b_s {
            put_all(w, row)?;
        }
        put_all(
            w,
            &[
                *declination_rad,
                *sigma_declination_rad,
                *declination_year,
                *dip_rad,
                *strength_ut,
                *sigma_ut,
            ],
        )
    })
}

/// Reads what is known of a magnetometer; what comes out passed [`Magnetometer::check`].
///
/// # Errors
/// [`PayloadError`], with [`PayloadError::Configuration`] where the check refuses.
pub fn decode_magnetometer(payload: &[u8]) -> Result<Magnetometer, PayloadError> {
    let mut r = Reader::new(payload);
    let magnetometer = Magnetometer {
        hard_iron_s_ut: three(&mut r)?,
        soft_iron_b_s: [three(&mut r)?, three(&mut r)?, three(&mut r)?],
        declination_rad: r.f64()?,
        sigma_declination_rad: r.f64()?,
        declination_year: r.f64()?,
        dip_rad: r.f64()?,
        strength_ut: r.f64()?,
        sigma_ut: r.f64()?,
    };
    end(&r)?;
    match magnetometer.check() {
        Ok(()) => Ok(magnetometer),
        Err(_) => Err(PayloadError::Configuration),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::native::Frame;

    const CALIBRATED: Magnetometer = Magnetometer {
        hard_iron_s_ut: [12.0, -7.0, 30.0],
        soft_iron_b_s: [[0.0, 1.1, 0.0], [-0.9, 0.0, 0.02], [0.0, 0.03, 1.0]],
        declination_rad: 0.05,
        sigma_declination_rad: 0.005,
        declination_year: 2026.0,
        dip_rad: 1.1,
        strength_ut: 48.0,
        sigma_ut: 0.5,
    };

    #[test]
    fn what_is_written_reads_back_and_what_cannot_be_is_refused() {
        let mut out = [0; 256];
        encode_magnetometer(&CALIBRATED, &mut out).unwrap();
        let (frame, _) = Frame::parse(&out).unwrap();
        let payload = frame.payload();
        assert_eq!(decode_magnetometer(payload), Ok(CALIBRATED));
        for cut in 0..payload.len() {
            assert!(decode_magnetometer(&payload[..cut]).is_err());
        }
        for place in (0..payload.len()).step_by(8) {
            for value in [f64::NAN, 1e9, -1e9] {
                let mut wrong = payload.to_vec();
                wrong[place..place + 8].copy_from_slice(&value.to_le_bytes());
                assert!(decode_magnetometer(&wrong).is_err(), "{place} {value}");
            }
        }
    }
}
