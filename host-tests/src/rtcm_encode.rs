//! Domain types as RTCM 3 messages, by the library `rtcm-rs`: what a receiver would send.
//!
//! In: observation epochs, ephemerides, a station position. Out: frames with their CRC.
//! [`quantise`] gives an ephemeris exactly as its bits hold it. [`ephemeris_of`] and
//! [`observations_of`] are the way back, through the library's own decoder.
//!
//! Message and field numbers: [RTCM-10403.3]. Angles on the wire are semicircles.

use anyhow::{Context, Result, bail};
use rtcm_rs::Message;
use rtcm_rs::msg::{self, BdsSigId, GalSigId, GpsSigId};
use rtcm_rs::prelude::{MessageBuilder, MessageFrame};
use rtcm_rs::util::DataVec;
use surefix_core::consts::SPEED_OF_LIGHT_MPS;
use surefix_core::gnss::{
    Ephemeris, NavMessage, ObservationEpoch, Satellite, SatelliteObservation, Signal,
    SignalObservation, System,
};
use surefix_core::time::{
    BDT_WEEK_OFFSET, GPST_MINUS_BDT_S, GST_WEEK_OFFSET, GpsTime, NS_PER_S, NS_PER_WEEK,
    resolve_week,
};

/// π of the broadcast messages: what turns semicircles into radians. [IS-GPS-200] 20.3.3.4.3.
#[expect(
    clippy::approx_constant,
    reason = "the documents give these digits, and ephemerides are fitted with them"
)]
const PI: f64 = 3.141_592_653_589_8;
/// Metres in a light-millisecond, the unit of MSM ranges.
const LIGHT_MS_M: f64 = SPEED_OF_LIGHT_MPS / 1000.0;
/// Station identification in every message.
const STATION_ID: u16 = 1;
/// Steps of the BDS group delays in a second. [RTCM-10403.3] DF513: 0.1 ns.
const BDS_GROUP_DELAY_STEPS: f64 = 1e10;
/// SISA index sent for Galileo: 3.12 m. [GAL-OS-SIS-ICD] table 76.
const GALILEO_SISA_INDEX: u8 = 107;
/// One sigma that index stands for, m.
const GALILEO_SIGMA_M: f64 = 3.12;
/// URA index sent for GPS and BDS: 0.
const URA_INDEX: u8 = 0;
/// One sigma that index stands for, m. [IS-GPS-200] 20.3.3.3.1.3, [BDS-SIS-ICD-B1I] 5.2.4.
const URA_SIGMA_M: f64 = 2.0;

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

fn semicircles(angle_rad: f64) -> f64 {
    angle_rad / PI
}

fn semicircles_f32(angle_rad: f64) -> f32 {
    semicircles(angle_rad) as f32
}

/// The ephemeris message: 1019 (GPS), 1042 (BDS), 1046 (Galileo I/NAV) or 1045 (F/NAV).
fn ephemeris_message(e: &Ephemeris) -> Message {
    let own_toe = own_time(e.satellite.system(), e.toe);
    let own_toc = own_time(e.satellite.system(), e.toc);
    match e.message {
        NavMessage::GpsLnav => Message::Msg1019(msg::Msg1019T {
            gps_satellite_id: e.satellite.prn(),
            gps_week_number: e.toe.week().rem_euclid(1024) as u16,
            ura_index: URA_INDEX,
            code_on_l2_ind: 1,
            idot_sc_s: semicircles(e.idot_radps),
            iode: e.issue as u8,
            toc_s: own_toc.tow_s() as f32,
            af2_s_s2: e.af2_sps2 as f32,
            af1_s_s: e.af1_sps as f32,
            af0_s: e.af0_s,
            iodc: e.issue,
            crs_m: e.crs_m as f32,
            delta_n_sc_s: semicircles_f32(e.delta_n_radps),
            m0_sc: semicircles(e.m0_rad),
            cuc_rad: e.cuc_rad as f32,
            eccentricity: e.eccentricity,
            cus_rad: e.cus_rad as f32,
            sqrt_a_sqrt_m: e.sqrt_a,
            toe_s: own_toe.tow_s() as f32,
            cic_rad: e.cic_rad as f32,
            omega0_sc: semicircles(e.omega0_rad),
            cis_rad: e.cis_rad as f32,
            i0_sc: semicircles(e.i0_rad),
            crc_m: e.crc_m as f32,
            omega_sc: semicircles(e.argument_of_perigee_rad),
            omegadot_sc_s: semicircles(e.omega_dot_radps),
            tgd_s: e.group_delay_s[0] as f32,
            sv_health_ind: e.health as u8,
            l2_p_data_flag: 0,
            fit_interval_ind: 0,
        }),
        NavMessage::BdsD1D2 => Message::Msg1042(msg::Msg1042T {
            bds_satellite_id: e.satellite.prn(),
            bds_week_number: (own_toe.week() - BDT_WEEK_OFFSET) as u16,
            ura_index: URA_INDEX,
            idot_sc_s: semicircles(e.idot_radps),
            aode: e.issue as u8,
            toc_s: own_toc.tow_s() as f32,
            a2_s_s2: e.af2_sps2 as f32,
            a1_s_s: e.af1_sps,
            a0_s: e.af0_s,
            aodc: e.issue as u8,
            crs_m: e.crs_m as f32,
            delta_n_sc_s: semicircles_f32(e.delta_n_radps),
            m0_sc: semicircles(e.m0_rad),
            cuc_rad: e.cuc_rad as f32,
            eccentricity: e.eccentricity,
            cus_rad: e.cus_rad as f32,
            sqrt_a_sqrt_m: e.sqrt_a,
            toe_s: own_toe.tow_s() as f32,
            cic_rad: e.cic_rad as f32,
            omega0_sc: semicircles(e.omega0_rad),
            cis_rad: e.cis_rad as f32,
            i0_sc: semicircles(e.i0_rad),
            crc_m: e.crc_m as f32,
            omega_sc: semicircles(e.argument_of_perigee_rad),
            omegadot_sc_s: semicircles(e.omega_dot_radps),
            tgd1_s: e.group_delay_s[0] as f32,
            tgd2_s: e.group_delay_s[1] as f32,
            sv_health_flag: u8::from(e.health != 0),
        }),
        NavMessage::GalileoInav => Message::Msg1046(msg::Msg1046T {
            gal_satellite_id: e.satellite.prn(),
            gal_week_number: (e.toe.week() - GST_WEEK_OFFSET) as u16,
            iodnav: e.issue,
            sisa_e1_e5b_index: GALILEO_SISA_INDEX,
            idot_sc_s: semicircles_f32(e.idot_radps),
            toc_s: own_toc.tow_s() as f32,
            af2_s_s2: e.af2_sps2 as f32,
            af1_s_s: e.af1_sps,
            af0_s: e.af0_s,
            crs_m: e.crs_m as f32,
            delta_n_sc_s: semicircles_f32(e.delta_n_radps),
            m0_sc: semicircles(e.m0_rad),
            cuc_rad: e.cuc_rad as f32,
            eccentricity: e.eccentricity,
            cus_rad: e.cus_rad as f32,
            sqrt_a_sqrt_m: e.sqrt_a,
            toe_s: own_toe.tow_s() as f32,
            cic_rad: e.cic_rad as f32,
            omega0_sc: semicircles(e.omega0_rad),
            cis_rad: e.cis_rad as f32,
            i0_sc: semicircles(e.i0_rad),
            crc_m: e.crc_m as f32,
            omega_sc: semicircles(e.argument_of_perigee_rad),
            omegadot_sc_s: semicircles(e.omega_dot_radps),
            bgd_e1_e5a_s: e.group_delay_s[0] as f32,
            bgd_e1_e5b_s: e.group_delay_s[1] as f32,
            ..msg::Msg1046T::default()
        }),
        NavMessage::GalileoFnav => Message::Msg1045(msg::Msg1045T {
            gal_satellite_id: e.satellite.prn(),
            gal_week_number: (e.toe.week() - GST_WEEK_OFFSET) as u16,
            iodnav: e.issue,
            sisa_e1_e5a_index: GALILEO_SISA_INDEX,
            idot_sc_s: semicircles_f32(e.idot_radps),
            toc_s: own_toc.tow_s() as f32,
            af2_s_s2: e.af2_sps2 as f32,
            af1_s_s: e.af1_sps,
            af0_s: e.af0_s,
            crs_m: e.crs_m as f32,
            delta_n_sc_s: semicircles_f32(e.delta_n_radps),
            m0_sc: semicircles(e.m0_rad),
            cuc_rad: e.cuc_rad as f32,
            eccentricity: e.eccentricity,
            cus_rad: e.cus_rad as f32,
            sqrt_a_sqrt_m: e.sqrt_a,
            toe_s: own_toe.tow_s() as f32,
            cic_rad: e.cic_rad as f32,
            omega0_sc: semicircles(e.omega0_rad),
            cis_rad: e.cis_rad as f32,
            i0_sc: semicircles(e.i0_rad),
            crc_m: e.crc_m as f32,
            omega_sc: semicircles(e.argument_of_perigee_rad),
            omegadot_sc_s: semicircles(e.omega_dot_radps),
            bgd_e1_e5a_s: e.group_delay_s[0] as f32,
            ..msg::Msg1045T::default()
        }),
    }
}

/// Ephemeris frame of a receiver: 1019, 1042, 1046 or 1045.
pub fn encode_ephemeris(ephemeris: &Ephemeris) -> Result<Vec<u8>> {
    frame(&ephemeris_message(ephemeris)).with_context(|| format!("{}", ephemeris.satellite))
}

/// The ephemeris of a decoded message, with the domain types' units; `None` for other messages.
///
/// `reference_week` resolves the 10-bit week of GPS.
pub fn ephemeris_of(message: &Message, reference_week: i32) -> Option<Ephemeris> {
    // Harmonic corrections and rates come as f32, which holds their 24 bits or fewer exactly.
    let rad = |semicircles: f64| semicircles * PI;
    let f = f64::from;
    let bds_delay =
        |delay_s: f32| libm::round(f(delay_s) * BDS_GROUP_DELAY_STEPS) / BDS_GROUP_DELAY_STEPS;
    Some(match message {
        Message::Msg1019(m) => {
            let week = resolve_week(i32::from(m.gps_week_number), 1024, reference_week);
            Ephemeris {
                satellite: Satellite::new(System::Gps, m.gps_satellite_id)?,
                message: NavMessage::GpsLnav,
                toe: GpsTime::from_week_tow_s(week, m.toe_s as i64),
                toc: GpsTime::from_week_tow_s(week, m.toc_s as i64),
                toe_sow_s: f(m.toe_s),
                issue: u16::from(m.iode),
                sqrt_a: m.sqrt_a_sqrt_m,
                eccentricity: m.eccentricity,
                i0_rad: rad(m.i0_sc),
                idot_radps: rad(m.idot_sc_s),
                omega0_rad: rad(m.omega0_sc),
                omega_dot_radps: rad(m.omegadot_sc_s),
                argument_of_perigee_rad: rad(m.omega_sc),
                m0_rad: rad(m.m0_sc),
                delta_n_radps: rad(f(m.delta_n_sc_s)),
                cuc_rad: f(m.cuc_rad),
                cus_rad: f(m.cus_rad),
                crc_m: f(m.crc_m),
                crs_m: f(m.crs_m),
                cic_rad: f(m.cic_rad),
                cis_rad: f(m.cis_rad),
                af0_s: m.af0_s,
                af1_sps: f(m.af1_s_s),
                af2_sps2: f(m.af2_s_s2),
                group_delay_s: [f(m.tgd_s), 0.0],
                sigma_ura_m: Some(URA_SIGMA_M),
                health: u16::from(m.sv_health_ind),
            }
        }
        Message::Msg1042(m) => {
            let week = i32::from(m.bds_week_number);
            Ephemeris {
                satellite: Satellite::new(System::Bds, m.bds_satellite_id)?,
                message: NavMessage::BdsD1D2,
                toe: GpsTime::from_bdt(week, m.toe_s as i64),
                toc: GpsTime::from_bdt(week, m.toc_s as i64),
                toe_sow_s: f(m.toe_s),
                issue: u16::from(m.aode),
                sqrt_a: m.sqrt_a_sqrt_m,
                eccentricity: m.eccentricity,
                i0_rad: rad(m.i0_sc),
                idot_radps: rad(m.idot_sc_s),
                omega0_rad: rad(m.omega0_sc),
                omega_dot_radps: rad(m.omegadot_sc_s),
                argument_of_perigee_rad: rad(m.omega_sc),
                m0_rad: rad(m.m0_sc),
                delta_n_radps: rad(f(m.delta_n_sc_s)),
                cuc_rad: f(m.cuc_rad),
                cus_rad: f(m.cus_rad),
                crc_m: f(m.crc_m),
                crs_m: f(m.crs_m),
                cic_rad: f(m.cic_rad),
                cis_rad: f(m.cis_rad),
                af0_s: m.a0_s,
                af1_sps: m.a1_s_s,
                af2_sps2: f(m.a2_s_s2),
                group_delay_s: [bds_delay(m.tgd1_s), bds_delay(m.tgd2_s)],
                sigma_ura_m: Some(URA_SIGMA_M),
                health: u16::from(m.sv_health_flag),
            }
        }
        Message::Msg1046(m) => {
            let week = i32::from(m.gal_week_number);
            Ephemeris {
                satellite: Satellite::new(System::Galileo, m.gal_satellite_id)?,
                message: NavMessage::GalileoInav,
                toe: GpsTime::from_gst(week, m.toe_s as i64),
                toc: GpsTime::from_gst(week, m.toc_s as i64),
                toe_sow_s: f(m.toe_s),
                issue: m.iodnav,
                sqrt_a: m.sqrt_a_sqrt_m,
                eccentricity: m.eccentricity,
                i0_rad: rad(m.i0_sc),
                idot_radps: rad(f(m.idot_sc_s)),
                omega0_rad: rad(m.omega0_sc),
                omega_dot_radps: rad(m.omegadot_sc_s),
                argument_of_perigee_rad: rad(m.omega_sc),
                m0_rad: rad(m.m0_sc),
                delta_n_radps: rad(f(m.delta_n_sc_s)),
                cuc_rad: f(m.cuc_rad),
                cus_rad: f(m.cus_rad),
                crc_m: f(m.crc_m),
                crs_m: f(m.crs_m),
                cic_rad: f(m.cic_rad),
                cis_rad: f(m.cis_rad),
                af0_s: m.af0_s,
                af1_sps: m.af1_s_s,
                af2_sps2: f(m.af2_s_s2),
                group_delay_s: [f(m.bgd_e1_e5a_s), f(m.bgd_e1_e5b_s)],
                sigma_ura_m: Some(GALILEO_SIGMA_M),
                health: 0,
            }
        }
        Message::Msg1045(m) => {
            let week = i32::from(m.gal_week_number);
            Ephemeris {
                satellite: Satellite::new(System::Galileo, m.gal_satellite_id)?,
                message: NavMessage::GalileoFnav,
                toe: GpsTime::from_gst(week, m.toe_s as i64),
                toc: GpsTime::from_gst(week, m.toc_s as i64),
                toe_sow_s: f(m.toe_s),
                issue: m.iodnav,
                sqrt_a: m.sqrt_a_sqrt_m,
                eccentricity: m.eccentricity,
                i0_rad: rad(m.i0_sc),
                idot_radps: rad(f(m.idot_sc_s)),
                omega0_rad: rad(m.omega0_sc),
                omega_dot_radps: rad(m.omegadot_sc_s),
                argument_of_perigee_rad: rad(m.omega_sc),
                m0_rad: rad(m.m0_sc),
                delta_n_radps: rad(f(m.delta_n_sc_s)),
                cuc_rad: f(m.cuc_rad),
                cus_rad: f(m.cus_rad),
                crc_m: f(m.crc_m),
                crs_m: f(m.crs_m),
                cic_rad: f(m.cic_rad),
                cis_rad: f(m.cis_rad),
                af0_s: m.af0_s,
                af1_sps: m.af1_s_s,
                af2_sps2: f(m.af2_s_s2),
                group_delay_s: [f(m.bgd_e1_e5a_s), 0.0],
                sigma_ura_m: Some(GALILEO_SIGMA_M),
                health: 0,
            }
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

/// Phase-range lock time indicator DF407 of a time in lock. [RTCM-10403.3] table 3.5-75.
pub fn lock_time_indicator(lock_ms: u64) -> u16 {
    if lock_ms < 64 {
        return lock_ms as u16;
    }
    let doublings = (lock_ms / 32).ilog2().min(21);
    let steps = (lock_ms >> doublings) + 32 * u64::from(doublings);
    steps.min(704) as u16
}

/// One satellite's numbers in the units of MSM7.
struct MsmSatellite {
    prn: u8,
    rough_ms: u8,
    rough_1024ths: u16,
    rough_rate_mps: Option<i16>,
    cells: Vec<MsmCell>,
}

/// One signal's numbers in the units of MSM7.
struct MsmCell {
    signal: Signal,
    fine_range_ms: Option<f64>,
    fine_phase_ms: Option<f64>,
    lock: u16,
    cn0_dbhz: Option<f64>,
    fine_rate_mps: Option<f64>,
}

/// Splits one satellite's observations into rough and fine parts; `None` without a pseudorange.
fn msm_satellite(
    observation: &SatelliteObservation,
    lock_ms: impl Fn(Satellite) -> u64,
) -> Option<MsmSatellite> {
    let satellite = observation.satellite;
    let first = observation.signals.iter().find_map(|s| s.pseudorange_m)?;
    let rough = libm::round(first / LIGHT_MS_M * 1024.0);
    if !(0.0..254.0 * 1024.0).contains(&rough) {
        return None;
    }
    let rough_range_ms = rough / 1024.0;
    let rough_rate_mps = observation
        .signals
        .iter()
        .find_map(|s| s.range_rate_mps)
        .map(libm::round);
    let cells = observation
        .signals
        .iter()
        .map(|s| {
            let wavelength_m = s
                .signal
                .frequency_hz(satellite.system())
                .map(|frequency| SPEED_OF_LIGHT_MPS / frequency);
            let phase_m = s.carrier_phase_cycles.zip(wavelength_m).map(|(n, l)| n * l);
            MsmCell {
                signal: s.signal,
                fine_range_ms: s.pseudorange_m.map(|p| p / LIGHT_MS_M - rough_range_ms),
                fine_phase_ms: phase_m.map(|p| p / LIGHT_MS_M - rough_range_ms),
                lock: lock_time_indicator(lock_ms(satellite)),
                cn0_dbhz: s.cn0_dbhz.map(f64::from),
                fine_rate_mps: s.range_rate_mps.zip(rough_rate_mps).map(|(r, o)| r - o),
            }
        })
        .collect();
    Some(MsmSatellite {
        prn: satellite.prn(),
        rough_ms: (rough as u32 / 1024) as u8,
        rough_1024ths: (rough as u32 % 1024) as u16,
        rough_rate_mps: rough_rate_mps.map(|rate| rate as i16),
        cells,
    })
}

/// Fills an MSM7 message: the three systems' types have the same fields under different names.
macro_rules! msm7 {
    ($variant:ident, $message:ident, $data:ident, $signal:ident, $sig_id:ident, $time_field:ident,
     $time_ms:expr, $more:expr, $satellites:expr) => {{
        let mut satellite_data = DataVec::new();
        let mut signal_data = DataVec::new();
        for satellite in $satellites {
            satellite_data.push(msg::Msm57Sat {
                satellite_id: satellite.prn,
                gnss_satellite_rough_range_integer_ms: Some(satellite.rough_ms),
                reserved_8_4: 0,
                gnss_satellite_rough_range_mod1ms_ms: f64::from(satellite.rough_1024ths) / 1024.0,
                gnss_satellite_rough_phaserange_rates_m_s: satellite.rough_rate_mps,
            });
            for cell in &satellite.cells {
                signal_data.push(msg::$signal {
                    satellite_id: satellite.prn,
                    signal_id: $sig_id::new(
                        cell.signal.band() - b'0',
                        char::from(cell.signal.attribute()),
                    ),
                    gnss_signal_fine_pseudorange_ext_ms: cell.fine_range_ms,
                    gnss_signal_fine_phaserange_ext_ms: cell.fine_phase_ms,
                    gnss_phaserange_lock_time_ext_ind: cell.lock,
                    half_cycle_ambiguity_ind: 0,
                    gnss_signal_cnr_ext_dbhz: cell.cn0_dbhz,
                    gnss_signal_fine_phaserange_rate_m_s: cell.fine_rate_mps,
                });
            }
        }
        Message::$variant(msg::$message {
            reference_station_id: STATION_ID,
            $time_field: $time_ms,
            msm_multiple_message_flag: u8::from($more),
            data_segment: msg::$data {
                satellite_data,
                signal_data,
            },
            ..msg::$message::default()
        })
    }};
}

/// One epoch as MSM7 frames, one per constellation present, in the order GPS, Galileo, BDS; all but
/// the last announce that more follows.
///
/// `lock_ms` says how long a satellite has been tracked.
pub fn encode_epoch(
    epoch: &ObservationEpoch,
    lock_ms: impl Fn(Satellite) -> u64,
) -> Result<Vec<u8>> {
    let by_system = System::ALL.map(|system| {
        epoch
            .satellites
            .iter()
            .filter(|s| s.satellite.system() == system)
            .filter_map(|s| msm_satellite(s, &lock_ms))
            .collect::<Vec<_>>()
    });
    let last = by_system
        .iter()
        .rposition(|satellites| !satellites.is_empty());
    let mut bytes = Vec::new();
    for (system, satellites) in System::ALL.into_iter().zip(&by_system) {
        if satellites.is_empty() {
            continue;
        }
        let time_ms = (own_time(system, epoch.time).tow_ns() / 1_000_000) as u32;
        let more = last != Some(system.index());
        let message = match system {
            System::Gps => msm7!(
                Msg1077,
                Msg1077T,
                Msg1077Data,
                Msg1077Sig,
                GpsSigId,
                gps_epoch_time_ms,
                time_ms,
                more,
                satellites
            ),
            System::Galileo => msm7!(
                Msg1097,
                Msg1097T,
                Msg1097Data,
                Msg1097Sig,
                GalSigId,
                gal_epoch_time_ms,
                time_ms,
                more,
                satellites
            ),
            System::Bds => msm7!(
                Msg1127,
                Msg1127T,
                Msg1127Data,
                Msg1127Sig,
                BdsSigId,
                bds_epoch_time_ms,
                time_ms,
                more,
                satellites
            ),
        };
        bytes.extend(frame(&message).with_context(|| format!("MSM7 of {system:?}"))?);
    }
    Ok(bytes)
}

/// Observations of one MSM7 message.
#[derive(Clone, Debug, PartialEq)]
pub struct Msm7 {
    /// Constellation of the message.
    pub system: System,
    /// Time of week of the epoch, GPST, ns.
    pub tow_ns: i64,
    /// More messages of this epoch follow.
    pub more: bool,
    /// Every cell, in metres, cycles and m/s.
    pub observations: Vec<(Satellite, SignalObservation)>,
}

/// Observations of a decoded MSM7 message; `None` for other messages and unknown signals.
pub fn observations_of(message: &Message) -> Option<Msm7> {
    macro_rules! collect {
        ($system:expr, $m:expr, $time_field:ident) => {{
            let m = $m;
            let shift_ns = match $system {
                System::Bds => GPST_MINUS_BDT_S * NS_PER_S,
                System::Gps | System::Galileo => 0,
            };
            let tow_ns = (i64::from(m.$time_field) * 1_000_000 + shift_ns) % NS_PER_WEEK;
            let mut observations = Vec::new();
            for cell in m.data_segment.signal_data.iter() {
                let of_satellite = m
                    .data_segment
                    .satellite_data
                    .iter()
                    .find(|s| s.satellite_id == cell.satellite_id)?;
                let rough_ms = of_satellite
                    .gnss_satellite_rough_range_integer_ms
                    .map(|ms| f64::from(ms) + of_satellite.gnss_satellite_rough_range_mod1ms_ms);
                let metres = |fine_ms: Option<f64>| {
                    rough_ms
                        .zip(fine_ms)
                        .map(|(rough, fine)| (rough + fine) * LIGHT_MS_M)
                };
                let signal = Signal::new(
                    cell.signal_id.band() + b'0',
                    u8::try_from(cell.signal_id.attribute()).ok()?,
                )?;
                let mut observation = SignalObservation::new(signal);
                observation.pseudorange_m = metres(cell.gnss_signal_fine_pseudorange_ext_ms);
                observation.carrier_phase_cycles = metres(cell.gnss_signal_fine_phaserange_ext_ms)
                    .zip(signal.frequency_hz($system))
                    .map(|(metres, frequency)| metres / SPEED_OF_LIGHT_MPS * frequency);
                observation.range_rate_mps = of_satellite
                    .gnss_satellite_rough_phaserange_rates_m_s
                    .zip(cell.gnss_signal_fine_phaserange_rate_m_s)
                    .map(|(rough, fine)| f64::from(rough) + fine);
                observation.cn0_dbhz = cell.gnss_signal_cnr_ext_dbhz.map(|cn0| cn0 as f32);
                observations.push((Satellite::new($system, cell.satellite_id)?, observation));
            }
            Some(Msm7 {
                system: $system,
                tow_ns,
                more: m.msm_multiple_message_flag == 1,
                observations,
            })
        }};
    }
    match message {
        Message::Msg1077(m) => collect!(System::Gps, m, gps_epoch_time_ms),
        Message::Msg1097(m) => collect!(System::Galileo, m, gal_epoch_time_ms),
        Message::Msg1127(m) => collect!(System::Bds, m, bds_epoch_time_ms),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lock_time_indicator_follows_the_blocks_of_the_table() {
        // Lower edges of blocks in [RTCM-10403.3] table 3.5-75.
        for (lock_ms, indicator) in [
            (0, 0),
            (63, 63),
            (64, 64),
            (127, 95),
            (128, 96),
            (255, 127),
            (256, 128),
            (33_554_432, 672),
            (67_108_864, 704),
            (1 << 40, 704),
        ] {
            assert_eq!(lock_time_indicator(lock_ms), indicator, "{lock_ms} ms");
        }
    }
}
