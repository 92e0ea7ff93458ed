//! The receiver's own solution: from NAV-PVT, and as surefix's own frame of kind 33.
//!
//! Layout: docs/native-frame.md.

use super::payload::{PayloadError, end, time, within};
use crate::frames::geodesy::Llh;
use crate::gnss::{FixQuality, FixSolution, FixVelocity, ReceiverFix};
use crate::time::{GpsTime, NS_PER_S, NS_PER_WEEK, start_of_day};
use crate::wire::native::{self, Full, HEADER_LEN, Kind, Reader, TRAILER_LEN};
use crate::wire::ubx::{self, NavPvt, pvt::Carrier};

use core::f64::consts::{FRAC_PI_2, PI};

/// Bytes of the longest frame of a receiver fix.
pub const RECEIVER_FIX_FRAME_LENGTH: usize =
    HEADER_LEN + 8 + 1 + 1 + 5 * 8 + 1 + 4 * 8 + TRAILER_LEN;

/// Largest height above the ellipsoid and depth below it, m.
const MAX_HEIGHT_M: f64 = 1.0e5;
/// Largest velocity along an axis, m/s.
const MAX_VELOCITY_MPS: f64 = 2.0e3;
/// Accuracies beyond this tell nothing, m or m/s.
const MAX_ACCURACY: f64 = 1.0e4;

/// Writes a receiver's solution as a frame of at most [`RECEIVER_FIX_FRAME_LENGTH`] bytes.
///
/// # Errors
/// [`Full`] when `out` is too short.
pub fn encode_receiver_fix(fix: &ReceiverFix, out: &mut [u8]) -> Result<usize, Full> {
    let ReceiverFix {
        time,
        satellites,
        solution,
    } = fix;
    native::encode(Kind::ReceiverFix, out, |w| {
        w.put_i64(time.ns())?;
        w.put_u8(*satellites)?;
        let Some(FixSolution {
            quality,
            llh,
            horizontal_accuracy_m,
            vertical_accuracy_m,
            velocity,
        }) = solution
        else {
            return w.put_u8(0);
        };
        w.put_u8(*quality as u8)?;
        for value in [
            llh.lat_rad,
            llh.lon_rad,
            llh.height_m,
            *horizontal_accuracy_m,
            *vertical_accuracy_m,
        ] {
            w.put_f64(value)?;
        }
        w.put_u8(velocity.is_some() as u8)?;
        let Some(FixVelocity {
            ned_mps,
            accuracy_mps,
        }) = velocity
        else {
            return Ok(());
        };
        for value in ned_mps {
            w.put_f64(*value)?;
        }
        w.put_f64(*accuracy_mps)
    })
}

/// Reads a receiver's solution from a payload.
///
/// # Errors
/// [`PayloadError`]: wrong length, a time outside the weeks there are, a quality there is not, a number no
/// receiver can mean.
pub fn decode_receiver_fix(payload: &[u8]) -> Result<ReceiverFix, PayloadError> {
    let mut r = Reader::new(payload);
    let time = time(&mut r)?;
    let satellites = r.u8()?;
    let solution = match r.u8()? {
        0 => None,
        number => {
            let quality = FixQuality::from_u8(number).ok_or(PayloadError::Choice { number })?;
            Some(solution(&mut r, quality)?)
        }
    };
    end(&r)?;
    Ok(ReceiverFix {
        time,
        satellites,
        solution,
    })
}

fn solution(r: &mut Reader<'_>, quality: FixQuality) -> Result<FixSolution, PayloadError> {
    let llh = Llh {
        lat_rad: within(r.f64()?, FRAC_PI_2)?,
        lon_rad: within(r.f64()?, PI)?,
        height_m: within(r.f64()?, MAX_HEIGHT_M)?,
    };
    let horizontal_accuracy_m = accuracy(r.f64()?)?;
    let vertical_accuracy_m = accuracy(r.f64()?)?;
    let velocity = match r.u8()? {
        0 => None,
        1 => Some(FixVelocity {
            ned_mps: [
                within(r.f64()?, MAX_VELOCITY_MPS)?,
                within(r.f64()?, MAX_VELOCITY_MPS)?,
                within(r.f64()?, MAX_VELOCITY_MPS)?,
            ],
            accuracy_mps: accuracy(r.f64()?)?,
        }),
        number => return Err(PayloadError::Choice { number }),
    };
    Ok(FixSolution {
        quality,
        llh,
        horizontal_accuracy_m,
        vertical_accuracy_m,
        velocity,
    })
}

fn accuracy(value: f64) -> Result<f64, PayloadError> {
    if value > 0.0 && value <= MAX_ACCURACY {
        Ok(value)
    } else {
        Err(PayloadError::OutOfRange { value })
    }
}

/// What NAV-PVT says. The date tells the week, the time of week the instant.
///
/// A position whose accuracy is 0 or tells nothing is none; a velocity likewise.
///
/// # Errors
/// [`ubx::PayloadError::WeekUnknown`] without a date.
pub fn receiver_fix(pvt: &NavPvt) -> Result<ReceiverFix, ubx::PayloadError> {
    let day = pvt
        .date_utc
        .and_then(|(year, month, day)| start_of_day(year, month, day))
        .ok_or(ubx::PayloadError::WeekUnknown)?;
    // No instant of the day is farther than half a week from its noon, leap seconds or not.
    let noon = day.plus_ns(NS_PER_WEEK / 14);
    let tow_ns = i64::from(pvt.itow_ms) * (NS_PER_S / 1000);
    let metres = |millimetres: u32| f64::from(millimetres) / 1e3;
    let is_known = |value: &f64| *value > 0.0 && *value <= MAX_ACCURACY;
    let velocity = Some(metres(pvt.speed_accuracy_mmps))
        .filter(is_known)
        .map(|accuracy_mps| FixVelocity {
            ned_mps: pvt.velocity_ned_mmps.map(|mmps| f64::from(mmps) / 1e3),
            accuracy_mps,
        });
    let accuracies = [pvt.horizontal_accuracy_mm, pvt.vertical_accuracy_mm].map(metres);
    let [horizontal_accuracy_m, vertical_accuracy_m] = accuracies;
    let is_solution = pvt.is_position() && accuracies.iter().all(is_known);
    Ok(ReceiverFix {
        time: GpsTime::nearest(tow_ns, noon),
        satellites: pvt.satellites,
        solution: is_solution.then(|| FixSolution {
            quality: match (pvt.carrier, pvt.is_differential) {
                (Carrier::Fixed, _) => FixQuality::Fixed,
                (Carrier::Float, _) => FixQuality::Float,
                (Carrier::None, true) => FixQuality::Differential,
                (Carrier::None, false) => FixQuality::Code,
            },
            llh: Llh {
                lat_rad: (f64::from(pvt.lat_e7) / 1e7).to_radians(),
                lon_rad: (f64::from(pvt.lon_e7) / 1e7).to_radians(),
                height_m: f64::from(pvt.height_mm) / 1e3,
            },
            horizontal_accuracy_m,
            vertical_accuracy_m,
            velocity,
        }),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::ubx::pvt::FixType;

    const FIX: ReceiverFix = ReceiverFix {
        time: GpsTime::from_week_tow_s(2381, 408_639),
        satellites: 17,
        solution: Some(FixSolution {
            quality: FixQuality::Float,
            llh: Llh {
                lat_rad: 0.7,
                lon_rad: -1.8,
                height_m: 1580.0,
            },
            horizontal_accuracy_m: 0.2,
            vertical_accuracy_m: 0.3,
            velocity: Some(FixVelocity {
                ned_mps: [1.0, -2.0, 0.1],
                accuracy_mps: 0.05,
            }),
        }),
    };

    const PVT: NavPvt = NavPvt {
        itow_ms: 604_799_750,
        date_utc: Some((2025, 8, 30)),
        fix_type: FixType::ThreeDimensional,
        fix_ok: true,
        is_differential: true,
        carrier: Carrier::Fixed,
        invalid_llh: false,
        satellites: 21,
        lon_e7: -1_051_474_483,
        lat_e7: 400_966_268,
        height_mm: 1_580_084,
        horizontal_accuracy_mm: 14,
        vertical_accuracy_mm: 10,
        velocity_ned_mmps: [-1200, 340, -5],
        speed_accuracy_mmps: 83,
    };

    fn written(fix: &ReceiverFix) -> std::vec::Vec<u8> {
        let mut out = [0; RECEIVER_FIX_FRAME_LENGTH];
        let length = encode_receiver_fix(fix, &mut out).unwrap();
        out[HEADER_LEN..length - TRAILER_LEN].to_vec()
    }

    #[test]
    fn a_fix_comes_back_from_its_frame_bit_for_bit() {
        let mut fix = FIX;
        for _ in 0..3 {
            assert_eq!(decode_receiver_fix(&written(&fix)), Ok(fix));
            match &mut fix.solution {
                Some(solution) if solution.velocity.is_some() => solution.velocity = None,
                solution => *solution = None,
            }
        }
        let mut short = [0; RECEIVER_FIX_FRAME_LENGTH - 1];
        assert_eq!(encode_receiver_fix(&FIX, &mut short), Err(Full));
    }

    /// INT-115. What no receiver can mean is refused when read: nothing of it comes to a filter.
    #[test]
    fn int_115_absurd_numbers_of_a_fix_are_refused() {
        let with = |change: &dyn Fn(&mut FixSolution)| {
            let mut fix = FIX;
            if let Some(solution) = &mut fix.solution {
                change(solution);
            }
            decode_receiver_fix(&written(&fix))
        };
        for bad in [f64::NAN, f64::INFINITY, -1e9, 1e9] {
            assert!(with(&|s| s.llh.lat_rad = bad).is_err());
            assert!(with(&|s| s.llh.lon_rad = bad).is_err());
            assert!(with(&|s| s.llh.height_m = bad).is_err());
            assert!(with(&|s| s.horizontal_accuracy_m = bad).is_err());
            assert!(with(&|s| s.vertical_accuracy_m = bad).is_err());
            let velocity = FixVelocity {
                ned_mps: [0.0, bad, 0.0],
                accuracy_mps: 1.0,
            };
            assert!(with(&|s| s.velocity = Some(velocity)).is_err());
            let velocity = FixVelocity {
                ned_mps: [0.0; 3],
                accuracy_mps: bad,
            };
            assert!(with(&|s| s.velocity = Some(velocity)).is_err());
        }
        assert!(with(&|s| s.horizontal_accuracy_m = 0.0).is_err());
        let mut payload = written(&FIX);
        payload[9] = 5;
        assert_eq!(
            decode_receiver_fix(&payload),
            Err(PayloadError::Choice { number: 5 })
        );
        payload[9] = 4;
        for cut in 0..payload.len() {
            assert!(decode_receiver_fix(&payload[..cut]).is_err(), "{cut}");
        }
        payload.push(0);
        assert!(decode_receiver_fix(&payload).is_err());
    }

    #[test]
    fn nav_pvt_becomes_a_fix_in_units() {
        let fix = receiver_fix(&PVT).unwrap();
        assert_eq!(fix.time.week(), 2381);
        assert_eq!(fix.time.tow_ns(), 604_799_750_000_000);
        let solution = fix.solution.unwrap();
        assert_eq!(solution.quality, FixQuality::Fixed);
        assert_eq!(solution.llh.lat_rad.to_degrees(), 40.096_626_8);
        assert_eq!(solution.llh.height_m, 1580.084);
        assert_eq!(solution.horizontal_accuracy_m, 0.014);
        let velocity = solution.velocity.unwrap();
        assert_eq!(velocity.ned_mps, [-1.2, 0.34, -0.005]);
    }

    #[test]
    fn week_is_that_of_the_date_at_either_end_of_a_week() {
        // 18 s before midnight in UTC of Saturday the next GPS week begins.
        let begun = NavPvt { itow_ms: 0, ..PVT };
        let time = receiver_fix(&begun).unwrap().time;
        assert_eq!(time, GpsTime::from_week_tow_s(2382, 0));
        let dateless = NavPvt {
            date_utc: None,
            ..PVT
        };
        let none = Err(ubx::PayloadError::WeekUnknown);
        assert_eq!(receiver_fix(&dateless), none);
        let no_day = NavPvt {
            date_utc: Some((2025, 2, 30)),
            ..PVT
        };
        assert_eq!(receiver_fix(&no_day), none);
    }

    #[test]
    fn a_fix_without_an_accuracy_is_none() {
        let without = NavPvt {
            horizontal_accuracy_mm: u32::MAX,
            ..PVT
        };
        assert_eq!(receiver_fix(&without).unwrap().solution, None);
        let blind = NavPvt {
            speed_accuracy_mmps: 0,
            ..PVT
        };
        let solution = receiver_fix(&blind).unwrap().solution.unwrap();
        assert_eq!(solution.velocity, None);
    }
}
