//! What a u-blox receiver says of its own position: NAV-PVT with carrier-phase ambiguities resolved, fixed
//! or float, which is good to centimetres or decimetres.

use anyhow::{Result, bail};
use surefix_core::frames::geodesy::{self, Llh};
use surefix_core::time::{GpsTime, NS_PER_S};
use ublox::nav_pvt::common::NavPvtFlags;
use ublox::proto27::{PacketRef, Proto27};
use ublox::{ParserBuilder, UbxPacket};

use super::TrackRow;

/// GPST − UTC, s; the day is all that is taken from UTC, so that a few more do no harm.
const LEAP_S: i64 = 18;

/// Bytes that cannot be in a text.
pub(super) fn looks_like_ubx(bytes: &[u8]) -> bool {
    bytes
        .windows(4)
        .any(|head| head == [0xb5, 0x62, 0x01, 0x07])
}

/// Times and positions of every NAV-PVT with resolved ambiguities.
///
/// # Errors
/// When there is none.
pub(super) fn rows(bytes: &[u8]) -> Result<Vec<TrackRow>> {
    let mut parser = ParserBuilder::new()
        .with_protocol::<Proto27>()
        .with_vec_buffer();
    let mut packets = parser.consume_ubx(bytes);
    let (mut rows, mut without) = (Vec::new(), 0_u32);
    while let Some(packet) = packets.next() {
        let Ok(UbxPacket::Proto27(PacketRef::NavPvt(pvt))) = packet else {
            continue;
        };
        let resolved = NavPvtFlags::CARR_SOLN_FLOAT | NavPvtFlags::CARR_SOLN_FIXED;
        if !pvt.flags().contains(NavPvtFlags::GPS_FIX_OK) || !pvt.flags().intersects(resolved) {
            without += 1;
            continue;
        }
        let Some(time) = time_of(
            [pvt.year().into(), pvt.month().into(), pvt.day().into()],
            [pvt.hour(), pvt.min(), pvt.sec()],
            pvt.itow(),
        ) else {
            without += 1;
            continue;
        };
        let r_e = geodesy::to_ecef(&Llh {
            lat_rad: pvt.latitude().to_radians(),
            lon_rad: pvt.longitude().to_radians(),
            height_m: pvt.height_above_ellipsoid(),
        });
        rows.push((time.ns(), r_e.into()));
    }
    if rows.is_empty() {
        bail!(
            "{without} NAV-PVT in the UBX file and none with resolved carrier-phase ambiguities: a position \
             of code ranges is no truth for another one"
        );
    }
    Ok(rows)
}

/// iTOW tells the instant within a week, the date in UTC which week.
fn time_of(
    [year, month, day]: [i64; 3],
    [hour, minute, second]: [u8; 3],
    itow_ms: u32,
) -> Option<GpsTime> {
    let near = crate::rinex::calendar(
        year,
        month,
        day,
        hour.into(),
        minute.into(),
        &second.to_string(),
    )?;
    let tow_ns = i64::from(itow_ms) * (NS_PER_S / 1000);
    Some(GpsTime::nearest(tow_ns, near.plus_ns(LEAP_S * NS_PER_S)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn week_is_that_of_the_date_at_either_end_of_a_week() {
        // 2025-08-30 is a Saturday.
        let end = time_of([2025, 8, 30], [23, 59, 41], 604_799_000);
        assert_eq!(end, Some(GpsTime::from_week_tow_s(2381, 604_799)));
        let start = time_of([2025, 8, 30], [23, 59, 42], 0);
        assert_eq!(start, Some(GpsTime::from_week_tow_s(2382, 0)));
    }

    #[test]
    fn file_without_a_resolved_position_is_no_truth() {
        assert!(rows(&[0xb5, 0x62, 0x01, 0x07, 0, 0, 8, 25]).is_err());
        assert!(!looks_like_ubx(b"t_s,x_m,y_m,z_m\n"));
    }
}
