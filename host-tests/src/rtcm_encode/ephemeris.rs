//! Ephemerides as messages 1019, 1042, 1045 and 1046, and back.
//!
//! Harmonic corrections and rates are f32 in the library, which holds their 24 bits or fewer exactly.

use anyhow::{Context, Result};
use rtcm_rs::Message;
use rtcm_rs::msg;
use rtcm_rs::prelude::MessageFrame;
use surefix_core::gnss::{Ephemeris, NavMessage, Satellite, System};
use surefix_core::time::{BDT_WEEK_OFFSET, GST_WEEK_OFFSET, GpsTime, resolve_week};

use super::{frame, own_time};

/// π of the broadcast messages: what turns semicircles into radians. [IS-GPS-200] 20.3.3.4.3.
#[expect(
    clippy::approx_constant,
    reason = "the documents give these digits, and ephemerides are fitted with them"
)]
const PI: f64 = 3.141_592_653_589_8;
/// Steps of the BDS group delays in a second. [RTCM-3] DF513: 0.1 ns.
const BDS_GROUP_DELAY_STEPS: f64 = 1e10;
/// SISA index sent for Galileo: 3.12 m. [GAL-OS-SIS-ICD] table 76.
const GALILEO_SISA_INDEX: u8 = 107;
/// One sigma that index stands for, m.
const GALILEO_SIGMA_M: f64 = 3.12;
/// URA index sent for GPS and BDS: 0.
const URA_INDEX: u8 = 0;
/// One sigma that index stands for, m. [IS-GPS-200] 20.3.3.3.1.3, [BDS-SIS-ICD-B1I] 5.2.4.
const URA_SIGMA_M: f64 = 2.0;

fn semicircles(angle_rad: f64) -> f64 {
    angle_rad / PI
}

/// A message with the orbit's fields, which have the same name and type in all four, and others.
macro_rules! message_of {
    ($variant:ident($type:ident), $e:ident, { $($others:tt)* }) => {
        Message::$variant(msg::$type {
            toc_s: own_time($e.satellite.system(), $e.toc).tow_s() as f32,
            crs_m: $e.crs_m as f32,
            delta_n_sc_s: semicircles($e.delta_n_radps) as f32,
            m0_sc: semicircles($e.m0_rad),
            cuc_rad: $e.cuc_rad as f32,
            eccentricity: $e.eccentricity,
            cus_rad: $e.cus_rad as f32,
            sqrt_a_sqrt_m: $e.sqrt_a,
            toe_s: own_time($e.satellite.system(), $e.toe).tow_s() as f32,
            cic_rad: $e.cic_rad as f32,
            omega0_sc: semicircles($e.omega0_rad),
            cis_rad: $e.cis_rad as f32,
            i0_sc: semicircles($e.i0_rad),
            crc_m: $e.crc_m as f32,
            omega_sc: semicircles($e.argument_of_perigee_rad),
            omegadot_sc_s: semicircles($e.omega_dot_radps),
            $($others)*
        })
    };
}

fn message(e: &Ephemeris) -> Message {
    match e.message {
        NavMessage::GpsLnav => message_of!(Msg1019(Msg1019T), e, {
            gps_satellite_id: e.satellite.prn(),
            gps_week_number: e.toe.week().rem_euclid(1024) as u16,
            ura_index: URA_INDEX,
            code_on_l2_ind: 1,
            idot_sc_s: semicircles(e.idot_radps),
            iode: e.issue as u8,
            iodc: e.issue,
            af2_s_s2: e.af2_sps2 as f32,
            af1_s_s: e.af1_sps as f32,
            af0_s: e.af0_s,
            tgd_s: e.group_delay_s[0] as f32,
            sv_health_ind: e.health as u8,
            ..msg::Msg1019T::default()
        }),
        NavMessage::BdsD1D2 => message_of!(Msg1042(Msg1042T), e, {
            bds_satellite_id: e.satellite.prn(),
            bds_week_number: (own_time(System::Bds, e.toe).week() - BDT_WEEK_OFFSET) as u16,
            ura_index: URA_INDEX,
            idot_sc_s: semicircles(e.idot_radps),
            aode: e.issue as u8,
            aodc: e.issue as u8,
            a2_s_s2: e.af2_sps2 as f32,
            a1_s_s: e.af1_sps,
            a0_s: e.af0_s,
            tgd1_s: e.group_delay_s[0] as f32,
            tgd2_s: e.group_delay_s[1] as f32,
            sv_health_flag: u8::from(e.health != 0),
        }),
        NavMessage::GalileoInav => message_of!(Msg1046(Msg1046T), e, {
            gal_satellite_id: e.satellite.prn(),
            gal_week_number: (e.toe.week() - GST_WEEK_OFFSET) as u16,
            iodnav: e.issue,
            sisa_e1_e5b_index: GALILEO_SISA_INDEX,
            idot_sc_s: semicircles(e.idot_radps) as f32,
            af2_s_s2: e.af2_sps2 as f32,
            af1_s_s: e.af1_sps,
            af0_s: e.af0_s,
            bgd_e1_e5a_s: e.group_delay_s[0] as f32,
            bgd_e1_e5b_s: e.group_delay_s[1] as f32,
            ..msg::Msg1046T::default()
        }),
        NavMessage::GalileoFnav => message_of!(Msg1045(Msg1045T), e, {
            gal_satellite_id: e.satellite.prn(),
            gal_week_number: (e.toe.week() - GST_WEEK_OFFSET) as u16,
            iodnav: e.issue,
            sisa_e1_e5a_index: GALILEO_SISA_INDEX,
            idot_sc_s: semicircles(e.idot_radps) as f32,
            af2_s_s2: e.af2_sps2 as f32,
            af1_s_s: e.af1_sps,
            af0_s: e.af0_s,
            bgd_e1_e5a_s: e.group_delay_s[0] as f32,
            ..msg::Msg1045T::default()
        }),
    }
}

/// Ephemeris frame of a receiver: 1019, 1042, 1046 or 1045.
pub fn encode_ephemeris(ephemeris: &Ephemeris) -> Result<Vec<u8>> {
    frame(&message(ephemeris)).with_context(|| format!("{}", ephemeris.satellite))
}

/// An ephemeris with the orbit's fields of a message, and others.
macro_rules! ephemeris_from {
    ($m:ident, { $($others:tt)* }) => {
        Ephemeris {
            toe_sow_s: f64::from($m.toe_s),
            sqrt_a: $m.sqrt_a_sqrt_m,
            eccentricity: $m.eccentricity,
            i0_rad: $m.i0_sc * PI,
            idot_radps: f64::from($m.idot_sc_s) * PI,
            omega0_rad: $m.omega0_sc * PI,
            omega_dot_radps: $m.omegadot_sc_s * PI,
            argument_of_perigee_rad: $m.omega_sc * PI,
            m0_rad: $m.m0_sc * PI,
            delta_n_radps: f64::from($m.delta_n_sc_s) * PI,
            cuc_rad: f64::from($m.cuc_rad),
            cus_rad: f64::from($m.cus_rad),
            crc_m: f64::from($m.crc_m),
            crs_m: f64::from($m.crs_m),
            cic_rad: f64::from($m.cic_rad),
            cis_rad: f64::from($m.cis_rad),
            $($others)*
        }
    };
}

/// The ephemeris of a decoded message in the units of the domain; `None` for other messages.
///
/// `reference_week` resolves the 10-bit week of GPS.
pub fn ephemeris_of(message: &Message, reference_week: i32) -> Option<Ephemeris> {
    let bds_delay_s = |delay_s: f32| {
        libm::round(f64::from(delay_s) * BDS_GROUP_DELAY_STEPS) / BDS_GROUP_DELAY_STEPS
    };
    Some(match message {
        Message::Msg1019(m) => {
            let week = resolve_week(i32::from(m.gps_week_number), 1024, reference_week);
            ephemeris_from!(m, {
                satellite: Satellite::new(System::Gps, m.gps_satellite_id)?,
                message: NavMessage::GpsLnav,
                toe: GpsTime::from_week_tow_s(week, m.toe_s as i64),
                toc: GpsTime::from_week_tow_s(week, m.toc_s as i64),
                issue: u16::from(m.iode),
                af0_s: m.af0_s,
                af1_sps: f64::from(m.af1_s_s),
                af2_sps2: f64::from(m.af2_s_s2),
                group_delay_s: [f64::from(m.tgd_s), 0.0],
                sigma_ura_m: Some(URA_SIGMA_M),
                health: u16::from(m.sv_health_ind),
            })
        }
        Message::Msg1042(m) => {
            let week = i32::from(m.bds_week_number);
            ephemeris_from!(m, {
                satellite: Satellite::new(System::Bds, m.bds_satellite_id)?,
                message: NavMessage::BdsD1D2,
                toe: GpsTime::from_bdt(week, m.toe_s as i64),
                toc: GpsTime::from_bdt(week, m.toc_s as i64),
                issue: u16::from(m.aode),
                af0_s: m.a0_s,
                af1_sps: m.a1_s_s,
                af2_sps2: f64::from(m.a2_s_s2),
                group_delay_s: [bds_delay_s(m.tgd1_s), bds_delay_s(m.tgd2_s)],
                sigma_ura_m: Some(URA_SIGMA_M),
                health: u16::from(m.sv_health_flag),
            })
        }
        Message::Msg1046(m) => {
            let week = i32::from(m.gal_week_number);
            ephemeris_from!(m, {
                satellite: Satellite::new(System::Galileo, m.gal_satellite_id)?,
                message: NavMessage::GalileoInav,
                toe: GpsTime::from_gst(week, m.toe_s as i64),
                toc: GpsTime::from_gst(week, m.toc_s as i64),
                issue: m.iodnav,
                af0_s: m.af0_s,
                af1_sps: m.af1_s_s,
                af2_sps2: f64::from(m.af2_s_s2),
                group_delay_s: [f64::from(m.bgd_e1_e5a_s), f64::from(m.bgd_e1_e5b_s)],
                sigma_ura_m: Some(GALILEO_SIGMA_M),
                health: 0,
            })
        }
        Message::Msg1045(m) => {
            let week = i32::from(m.gal_week_number);
            ephemeris_from!(m, {
                satellite: Satellite::new(System::Galileo, m.gal_satellite_id)?,
                message: NavMessage::GalileoFnav,
                toe: GpsTime::from_gst(week, m.toe_s as i64),
                toc: GpsTime::from_gst(week, m.toc_s as i64),
                issue: m.iodnav,
                af0_s: m.af0_s,
                af1_sps: m.af1_s_s,
                af2_sps2: f64::from(m.af2_s_s2),
                group_delay_s: [f64::from(m.bgd_e1_e5a_s), 0.0],
                sigma_ura_m: Some(GALILEO_SIGMA_M),
                health: 0,
            })
        }
        _ => return None,
    })
}

/// The ephemeris with every field as its bits hold it; the broadcast accuracy is set.
///
/// # Panics
/// When a field lies outside its range on the wire: the simulator's own elements never do.
pub fn quantise(ephemeris: &Ephemeris) -> Ephemeris {
    let bytes =
        encode_ephemeris(ephemeris).expect("elements of the simulated sky fit their fields");
    let frame = MessageFrame::new(&bytes).expect("the library reads its own frame");
    ephemeris_of(&frame.get_message(), ephemeris.toe.week()).expect("the message is an ephemeris")
}
