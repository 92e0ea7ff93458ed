//! Observation epochs as MSM7 messages 1077, 1097 and 1127.

use anyhow::{Context, Result};
use rtcm_rs::Message;
use rtcm_rs::msg::{self, BdsSigId, GalSigId, GpsSigId};
use rtcm_rs::util::DataVec;
use surefix_core::consts::SPEED_OF_LIGHT_MPS;
use surefix_core::gnss::{
    ObservationEpoch, Satellite, SatelliteObservation, Signal, SignalObservation, System,
};
use surefix_core::time::{GPST_MINUS_BDT_S, NS_PER_S, NS_PER_WEEK};

use super::{STATION_ID, frame, own_time};

/// Metres in a light-millisecond, the unit of MSM ranges.
const LIGHT_MS_M: f64 = SPEED_OF_LIGHT_MPS / 1000.0;

/// Phase-range lock time indicator DF407 of a time in lock. [RTCM-3] table 3.5-75.
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
        // Lower edges of blocks in [RTCM-3] table 3.5-75.
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
