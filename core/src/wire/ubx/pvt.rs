//! NAV-PVT: the receiver's own position, velocity and time. [UBX-F9-HPG] UBX-NAV-PVT, [UBX-M8] UBX-NAV-PVT

use super::PayloadError;

/// Bytes of the message.
pub const LENGTH: usize = 92;

/// Bits of valid.
const VALID_DATE: u8 = 1 << 0;

/// Bits of flags.
const FIX_OK: u8 = 1 << 0;
const DIFFERENTIAL: u8 = 1 << 1;
const CARRIER_SHIFT: u32 = 6;

/// Bits of flags3.
const INVALID_LLH: u8 = 1 << 0;

const MS_PER_WEEK: u32 = 604_800_000;

/// Largest magnitudes: latitude and longitude, 1e-7 degrees.
const MAX_LATITUDE_E7: u32 = 900_000_000;
/// See [`MAX_LATITUDE_E7`].
const MAX_LONGITUDE_E7: u32 = 1_800_000_000;
/// Height, mm: a receiver that is not licensed for more gives none above 80 km.
const MAX_HEIGHT_MM: u32 = 100_000_000;
/// Velocity, mm/s, likewise: 500 m/s is what it is built for.
const MAX_VELOCITY_MMPS: u32 = 2_000_000;

/// What the receiver says its solution is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FixType {
    /// None.
    None,
    /// Dead reckoning alone.
    DeadReckoning,
    /// Satellites, with a height that is assumed.
    TwoDimensional,
    /// Satellites.
    ThreeDimensional,
    /// Satellites and dead reckoning.
    Combined,
    /// Time alone, of a receiver that was told where it is.
    TimeOnly,
}

/// What became of the carrier phase ambiguities.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Carrier {
    /// The solution is of code ranges.
    None,
    /// Estimated as real numbers.
    Float,
    /// Fixed to integers.
    Fixed,
}

/// The message, as integers of the receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NavPvt {
    /// Time of the GPS week, rounded to ms.
    pub itow_ms: u32,
    /// Year, month, day in UTC, where the receiver holds them valid.
    pub date_utc: Option<(u16, u8, u8)>,
    /// What the solution is.
    pub fix_type: FixType,
    /// The receiver holds its solution within the limits it was configured with.
    pub fix_ok: bool,
    /// Differential corrections were applied.
    pub is_differential: bool,
    /// Ambiguities.
    pub carrier: Carrier,
    /// Longitude, latitude and height are no solution.
    pub invalid_llh: bool,
    /// Satellites used.
    pub satellites: u8,
    /// Longitude, 1e-7 degrees.
    pub lon_e7: i32,
    /// Latitude, 1e-7 degrees.
    pub lat_e7: i32,
    /// Height above the ellipsoid, mm.
    pub height_mm: i32,
    /// Estimated horizontal accuracy, mm.
    pub horizontal_accuracy_mm: u32,
    /// Estimated vertical accuracy, mm.
    pub vertical_accuracy_mm: u32,
    /// Velocity north, east, down, mm/s.
    pub velocity_ned_mmps: [i32; 3],
    /// Estimated accuracy of the speed, mm/s.
    pub speed_accuracy_mmps: u32,
}

impl NavPvt {
    /// Reads the message.
    ///
    /// # Errors
    /// [`PayloadError::Length`]; [`PayloadError::TimeOfWeek`] beyond a week; [`PayloadError::OutOfRange`] for
    /// a fix type without a meaning, or numbers of a valid solution that no receiver can mean.
    pub fn parse(payload: &[u8]) -> Result<Self, PayloadError> {
        if payload.len() != LENGTH {
            return Err(PayloadError::Length);
        }
        let itow_ms = u32_at(payload, 0)?;
        if itow_ms >= MS_PER_WEEK {
            return Err(PayloadError::TimeOfWeek {
                tow_s: f64::from(itow_ms) / 1000.0,
            });
        }
        let [year_low, year_high, month, day] = bytes_at(payload, 4)?;
        let [valid] = bytes_at(payload, 11)?;
        let [fix_type, flags, _flags2, satellites] = bytes_at(payload, 20)?;
        let [flags3] = bytes_at(payload, 78)?;
        let pvt = Self {
            itow_ms,
            date_utc: (valid & VALID_DATE != 0).then_some((
                u16::from_le_bytes([year_low, year_high]),
                month,
                day,
            )),
            fix_type: match fix_type {
                0 => FixType::None,
                1 => FixType::DeadReckoning,
                2 => FixType::TwoDimensional,
                3 => FixType::ThreeDimensional,
                4 => FixType::Combined,
                5 => FixType::TimeOnly,
                _ => return Err(PayloadError::OutOfRange),
            },
            fix_ok: flags & FIX_OK != 0,
            is_differential: flags & DIFFERENTIAL != 0,
            carrier: match flags >> CARRIER_SHIFT {
                0 => Carrier::None,
                1 => Carrier::Float,
                2 => Carrier::Fixed,
                _ => return Err(PayloadError::OutOfRange),
            },
            invalid_llh: flags3 & INVALID_LLH != 0,
            satellites,
            lon_e7: i32_at(payload, 24)?,
            lat_e7: i32_at(payload, 28)?,
            height_mm: i32_at(payload, 32)?,
            horizontal_accuracy_mm: u32_at(payload, 40)?,
            vertical_accuracy_mm: u32_at(payload, 44)?,
            velocity_ned_mmps: [
                i32_at(payload, 48)?,
                i32_at(payload, 52)?,
                i32_at(payload, 56)?,
            ],
            speed_accuracy_mmps: u32_at(payload, 68)?,
        };
        if pvt.is_position() && !pvt.is_possible() {
            return Err(PayloadError::OutOfRange);
        }
        Ok(pvt)
    }

    /// Whether there is a position of satellites in three dimensions that the receiver stands by.
    pub const fn is_position(&self) -> bool {
        matches!(self.fix_type, FixType::ThreeDimensional | FixType::Combined)
            && self.fix_ok
            && !self.invalid_llh
    }

    fn is_possible(&self) -> bool {
        let [north, east, down] = self.velocity_ned_mmps.map(i32::unsigned_abs);
        self.lat_e7.unsigned_abs() <= MAX_LATITUDE_E7
            && self.lon_e7.unsigned_abs() <= MAX_LONGITUDE_E7
            && self.height_mm.unsigned_abs() <= MAX_HEIGHT_MM
            && north.max(east).max(down) <= MAX_VELOCITY_MMPS
    }
}

fn bytes_at<const N: usize>(payload: &[u8], at: usize) -> Result<[u8; N], PayloadError> {
    payload
        .get(at..)
        .and_then(|rest| rest.first_chunk::<N>())
        .copied()
        .ok_or(PayloadError::Length)
}

fn u32_at(payload: &[u8], at: usize) -> Result<u32, PayloadError> {
    bytes_at(payload, at).map(u32::from_le_bytes)
}

fn i32_at(payload: &[u8], at: usize) -> Result<i32, PayloadError> {
    bytes_at(payload, at).map(i32::from_le_bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    /// A fix in Colorado, ambiguities fixed.
    fn payload() -> Vec<u8> {
        let mut bytes = std::vec![0; LENGTH];
        let mut put = |at: usize, field: &[u8]| bytes[at..at + field.len()].copy_from_slice(field);
        put(0, &243_039_750_u32.to_le_bytes());
        put(4, &2025_u16.to_le_bytes());
        put(6, &[8, 28, 17, 30, 21, 0x37]);
        put(20, &[3, 0x83, 0xea, 21]);
        put(24, &(-1_051_474_483_i32).to_le_bytes());
        put(28, &400_966_268_i32.to_le_bytes());
        put(32, &1_580_084_i32.to_le_bytes());
        put(36, &1_601_474_i32.to_le_bytes());
        put(40, &14_u32.to_le_bytes());
        put(44, &10_u32.to_le_bytes());
        put(48, &(-1200_i32).to_le_bytes());
        put(52, &340_i32.to_le_bytes());
        put(56, &(-5_i32).to_le_bytes());
        put(68, &83_u32.to_le_bytes());
        bytes
    }

    #[test]
    fn fields_are_read_from_their_places() {
        let pvt = NavPvt::parse(&payload()).unwrap();
        assert_eq!(
            pvt,
            NavPvt {
                itow_ms: 243_039_750,
                date_utc: Some((2025, 8, 28)),
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
            }
        );
        assert!(pvt.is_position());
    }

    #[test]
    fn what_the_receiver_does_not_stand_by_is_no_position() {
        for (at, value) in [(20, 0), (20, 1), (20, 2), (20, 5), (21, 0x82), (78, 1)] {
            let mut bytes = payload();
            bytes[at] = value;
            assert!(!NavPvt::parse(&bytes).unwrap().is_position(), "{at}");
        }
        let mut bytes = payload();
        bytes[20] = 4;
        assert!(NavPvt::parse(&bytes).unwrap().is_position());
        bytes[11] = 0x36;
        assert_eq!(NavPvt::parse(&bytes).unwrap().date_utc, None);
    }

    #[test]
    fn lengths_times_and_numbers_that_cannot_be_are_refused() {
        let bytes = payload();
        for length in [0, 84, 91] {
            let cut = NavPvt::parse(&bytes[..length]);
            assert_eq!(cut, Err(PayloadError::Length));
        }
        let mut late = bytes.clone();
        late[..4].copy_from_slice(&MS_PER_WEEK.to_le_bytes());
        assert_eq!(
            NavPvt::parse(&late),
            Err(PayloadError::TimeOfWeek { tow_s: 604_800.0 })
        );
        for (at, field) in [
            (24, 1_800_000_001_i32),
            (28, -900_000_001),
            (32, i32::MIN),
            (48, i32::MAX),
            (56, -2_000_001),
        ] {
            let mut wrong = bytes.clone();
            wrong[at..at + 4].copy_from_slice(&field.to_le_bytes());
            assert_eq!(NavPvt::parse(&wrong), Err(PayloadError::OutOfRange), "{at}");
        }
        for (at, value) in [(20, 6), (20, 255), (21, 0xc1)] {
            let mut wrong = bytes.clone();
            wrong[at] = value;
            assert_eq!(NavPvt::parse(&wrong), Err(PayloadError::OutOfRange), "{at}");
        }
    }
}
