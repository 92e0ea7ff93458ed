//! Domain types as RTCM 3 messages, by the library `rtcm-rs`: what a receiver would send.
//!
//! In: observation epochs, ephemerides, a station position. Out: frames with their CRC.
//! [`quantise`] gives an ephemeris exactly as its bits hold it. [`ephemeris_of`] and
//! [`observations_of`] are the way back, through the library's own decoder.
//!
//! Message and field numbers: [RTCM-3]. Angles on the wire are semicircles.

mod ephemeris;
mod msm;

use anyhow::{Result, bail};
use rtcm_rs::Message;
use rtcm_rs::msg;
use rtcm_rs::prelude::MessageBuilder;
use surefix_core::gnss::System;
use surefix_core::time::{GPST_MINUS_BDT_S, GpsTime, NS_PER_S};

pub use ephemeris::{encode_ephemeris, ephemeris_of, quantise};
pub use msm::{Msm7, encode_epoch, lock_time_indicator, observations_of};

/// Station identification in every message.
const STATION_ID: u16 = 1;

/// The frame of one message.
fn frame(message: &Message) -> Result<Vec<u8>> {
    match MessageBuilder::new().build_message(message) {
        Ok(bytes) => Ok(bytes.to_vec()),
        Err(error) => bail!(
            "RTCM message {:?} did not encode: {error:?}",
            message.number()
        ),
    }
}

/// Time of a system's own week: BDT for BDS.
fn own_time(system: System, time: GpsTime) -> GpsTime {
    match system {
        System::Gps | System::Galileo => time,
        System::Bds => time.plus_ns(-GPST_MINUS_BDT_S * NS_PER_S),
    }
}

/// Antenna position frame 1006, m, for a receiver that does not move; resolution 0.1 mm.
pub fn encode_station(position_e_m: [f64; 3]) -> Result<Vec<u8>> {
    let [x, y, z] = position_e_m;
    frame(&Message::Msg1006(msg::Msg1006T {
        reference_station_id: STATION_ID,
        gps_flag: 1,
        galileo_flag: 1,
        antenna_ref_point_ecef_x_m: x,
        antenna_ref_point_ecef_y_m: y,
        antenna_ref_point_ecef_z_m: z,
        ..msg::Msg1006T::default()
    }))
}
