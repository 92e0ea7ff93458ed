//! Values of RTCM 3 and UBX to domain types.

use super::payload::{MAX_CN0_DBHZ, MAX_RANGE, MAX_RATE_MPS};
use super::week::WeekResolver;
use crate::consts::SPEED_OF_LIGHT_MPS;
use crate::gnss::{
    Ephemeris, KlobucharParameters, NavMessage, Satellite, Signal, SignalObservation, System,
};
use crate::time::{GpsTime, NS_PER_S};
use crate::wire::broadcast::BroadcastKlobuchar;
use crate::wire::rtcm3::signals::rinex_name;
use crate::wire::rtcm3::{BroadcastEphemeris, Cell, Constellation, Source};
use crate::wire::ubx::{Measurement, Rawx};

/// π of the interface documents, which angles in semicircles are to be multiplied with.
/// [IS-GPS-200] 20.3.3.4.3.3, [GAL-OS-SIS-ICD] 5.1.1, [BDS-SIS-ICD-B1I] 5.2.4.
#[expect(
    clippy::approx_constant,
    reason = "the documents give these digits, and ephemerides are fitted with them"
)]
const PI_BROADCAST: f64 = 3.141_592_653_589_8;

/// Light travels this far in a millisecond, m.
const METRES_PER_MS: f64 = crate::consts::SPEED_OF_LIGHT_MPS / 1000.0;

/// 2⁻²⁹ and 2⁻³¹, exact.
const TWO_TO_MINUS_29: f64 = 1.0 / (1_u64 << 29) as f64;
const TWO_TO_MINUS_31: f64 = 1.0 / (1_u64 << 31) as f64;

/// The system of a constellation surefix navigates with.
pub(super) const fn system_of(constellation: Constellation) -> Option<System> {
    match constellation {
        Constellation::Gps => Some(System::Gps),
        Constellation::Galileo => Some(System::Galileo),
        Constellation::Bds => Some(System::Bds),
        _ => None,
    }
}

/// Why a cell of an MSM is no observation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NoObservation {
    UnknownSatellite,
    UnknownSignal,
    InvalidPseudorange,
    OtherSystem,
}

/// One cell of an MSM as an observation.
///
/// The range in milliseconds is exact in f64 (an integer of less than 2³⁷ times a power of two);
/// one multiplication with c/1000 makes metres of it, one with f/1000 makes cycles.
pub(super) fn observation(
    system: System,
    constellation: Constellation,
    cell: &Cell,
) -> Result<(Satellite, SignalObservation), NoObservation> {
    let satellite =
        Satellite::new(system, cell.satellite).ok_or(NoObservation::UnknownSatellite)?;
    let signal = rinex_name(constellation, cell.signal)
        .and_then(|[band, attribute]| Signal::new(band, attribute))
        .ok_or(NoObservation::UnknownSignal)?;
    let pseudorange = cell.pseudorange.ok_or(NoObservation::InvalidPseudorange)?;
    let mut observation = SignalObservation::new(signal);
    observation.pseudorange_m = Some(pseudorange as f64 * TWO_TO_MINUS_29 * METRES_PER_MS);
    observation.carrier_phase_cycles = match (cell.phase_range, signal.frequency_hz(system)) {
        (Some(range), Some(frequency_hz)) => {
            Some(range as f64 * TWO_TO_MINUS_31 * (frequency_hz / 1000.0))
        }
        _ => None,
    };
    observation.range_rate_mps = cell.phase_range_rate.map(|rate| f64::from(rate) / 1e4);
    observation.cn0_dbhz = cell
        .carrier_to_noise
        .map(|sixteenths| f32::from(sixteenths) / 16.0);
    Ok((satellite, observation))
}

/// Names of a system's signals by the sigId of UBX. [UBX-F9-HPG] 1.5.4, names as in [RINEX-3.05] tables
/// 4 to 9.
const fn ubx_signal(system: System, sig_id: u8) -> Option<[u8; 2]> {
    Some(match (system, sig_id) {
        (System::Gps, 0) => *b"1C",
        (System::Gps, 3) => *b"2L",
        (System::Gps, 4) => *b"2S",
        (System::Gps, 6) => *b"5I",
        (System::Gps, 7) => *b"5Q",
        (System::Galileo, 0) => *b"1C",
        (System::Galileo, 1) => *b"1B",
        (System::Galileo, 3) => *b"5I",
        (System::Galileo, 4) => *b"5Q",
        (System::Galileo, 5) => *b"7I",
        (System::Galileo, 6) => *b"7Q",
        (System::Galileo, 8) => *b"6B",
        (System::Galileo, 9) => *b"6C",
        (System::Galileo, 10) => *b"6A",
        // Two numbers for one signal: with the D1 message, and with the D2 message of a GEO.
        (System::Bds, 0 | 1) => *b"2I",
        (System::Bds, 2 | 3) => *b"7I",
        (System::Bds, 4 | 10) => *b"6I",
        (System::Bds, 5) => *b"1P",
        (System::Bds, 6) => *b"1D",
        (System::Bds, 7) => *b"5P",
        (System::Bds, 8) => *b"5D",
        _ => return None,
    })
}

/// The system of a gnssId surefix navigates with.
pub(super) const fn ubx_system(gnss_id: u8) -> Option<System> {
    match gnss_id {
        0 => Some(System::Gps),
        2 => Some(System::Galileo),
        3 => Some(System::Bds),
        _ => None,
    }
}

/// One measurement of RXM-RAWX as an observation.
///
/// The range rate is −λD, in f64 from the f32 of the message. A number beyond what
/// [`crate::ingest::encode_observations`] can carry is none.
pub(super) fn ubx_observation(
    measurement: &Measurement,
) -> Result<(Satellite, SignalObservation), NoObservation> {
    let system = ubx_system(measurement.gnss_id).ok_or(NoObservation::OtherSystem)?;
    let satellite =
        Satellite::new(system, measurement.sv_id).ok_or(NoObservation::UnknownSatellite)?;
    let signal = ubx_signal(system, measurement.sig_id)
        .and_then(|[band, attribute]| Signal::new(band, attribute))
        .ok_or(NoObservation::UnknownSignal)?;
    let is_range = |value: &f64| *value > 0.0 && *value <= MAX_RANGE;
    let pseudorange_m = measurement
        .pseudorange_m
        .filter(is_range)
        .ok_or(NoObservation::InvalidPseudorange)?;
    let mut observation = SignalObservation::new(signal);
    observation.pseudorange_m = Some(pseudorange_m);
    observation.carrier_phase_cycles = measurement
        .carrier_phase_cycles
        .filter(|cycles| libm::fabs(*cycles) <= MAX_RANGE);
    observation.range_rate_mps = measurement
        .doppler_hz
        .zip(signal.frequency_hz(system))
        .map(|(doppler_hz, frequency_hz)| {
            -f64::from(doppler_hz) * (SPEED_OF_LIGHT_MPS / frequency_hz)
        })
        .filter(|rate_mps| libm::fabs(*rate_mps) <= MAX_RATE_MPS);
    observation.cn0_dbhz = measurement
        .cn0_dbhz
        .map(f32::from)
        .filter(|cn0_dbhz| *cn0_dbhz <= MAX_CN0_DBHZ);
    Ok((satellite, observation))
}

/// Receiver time of RXM-RAWX, to the nanosecond.
pub(super) fn ubx_time(rawx: &Rawx<'_>) -> GpsTime {
    // At most 6.1e14 ns: exact in f64 and far inside i64.
    let tow_ns = libm::rint(rawx.tow_s * NS_PER_S as f64) as i64;
    GpsTime::from_week_tow_ns(i32::from(rawx.week), tow_ns)
}

/// Ionosphere parameters of a navigation message; their units are those of the domain already.
pub(super) const fn klobuchar(broadcast: &BroadcastKlobuchar) -> KlobucharParameters {
    KlobucharParameters {
        system: system_of_source(broadcast.source),
        alpha: broadcast.alpha,
        beta: broadcast.beta,
    }
}

const fn system_of_source(source: Source) -> System {
    match source {
        Source::GpsLnav => System::Gps,
        Source::BdsD1D2 => System::Bds,
        Source::GalileoFnav | Source::GalileoInav => System::Galileo,
    }
}

/// One sigma of an accuracy index of GPS or BDS, m; `None` for 15, no prediction of accuracy.
///
/// The nominal values, as RINEX has them: 2^(1 + N/2) to one decimal up to N = 6, 2^(N − 2) above.
/// [IS-GPS-200] 20.3.3.3.1.3, [BDS-SIS-ICD-B1I] 5.2.4.5
const fn ura_m(index: u8) -> Option<f64> {
    Some(match index {
        0 => 2.0,
        1 => 2.8,
        2 => 4.0,
        3 => 5.7,
        4 => 8.0,
        5 => 11.3,
        6 => 16.0,
        7 => 32.0,
        8 => 64.0,
        9 => 128.0,
        10 => 256.0,
        11 => 512.0,
        12 => 1024.0,
        13 => 2048.0,
        14 => 4096.0,
        _ => return None,
    })
}

/// One sigma of a SISA index of Galileo, m; `None` for 126 to 254 (spare) and 255 (no prediction of
/// accuracy available). [GAL-OS-SIS-ICD] 5.1.12, table 89
fn sisa_m(index: u8) -> Option<f64> {
    // In centimetres, so that each value is the nearest f64 to its decimal.
    let index = u32::from(index);
    let cm = match index {
        0..=49 => index,
        50..=74 => 50 + (index - 50) * 2,
        75..=99 => 100 + (index - 75) * 4,
        100..=125 => 200 + (index - 100) * 16,
        _ => return None,
    };
    Some(f64::from(cm) / 100.0)
}

/// What a broadcast ephemeris is without its week: the satellite and the message, or the satellite
/// number nobody has.
pub(super) fn satellite_of(broadcast: &BroadcastEphemeris) -> Option<(Satellite, NavMessage)> {
    let (system, message) = match broadcast.source {
        Source::GpsLnav => (System::Gps, NavMessage::GpsLnav),
        Source::BdsD1D2 => (System::Bds, NavMessage::BdsD1D2),
        Source::GalileoFnav => (System::Galileo, NavMessage::GalileoFnav),
        Source::GalileoInav => (System::Galileo, NavMessage::GalileoInav),
    };
    Some((Satellite::new(system, broadcast.satellite)?, message))
}

/// The instant of toe or toc in the week the ephemeris names; for GPS the week is `gps_week`.
fn in_named_week(broadcast: &BroadcastEphemeris, gps_week: i32, of_week_s: u32) -> GpsTime {
    let (week, seconds) = (i32::from(broadcast.week), i64::from(of_week_s));
    match broadcast.source {
        Source::GpsLnav => GpsTime::from_week_tow_s(gps_week, seconds),
        Source::BdsD1D2 => GpsTime::from_bdt(week, seconds),
        Source::GalileoFnav | Source::GalileoInav => GpsTime::from_gst(week, seconds),
    }
}

/// Lets the resolver learn the week from an ephemeris of `satellite`, and tells by how many weeks
/// everything before was wrong.
pub(super) fn learn_week(
    broadcast: &BroadcastEphemeris,
    satellite: Satellite,
    weeks: &mut WeekResolver,
) -> i32 {
    match broadcast.source {
        Source::GpsLnav => weeks.learn_gps_week(satellite, broadcast.week, broadcast.toe_s),
        _ => weeks.learn_full_week(
            satellite,
            in_named_week(broadcast, 0, broadcast.toe_s),
            broadcast.toe_s,
        ),
    }
}

/// A broadcast ephemeris in SI units and radians, at the instants it means.
#[inline(never)]
pub(super) fn ephemeris(
    broadcast: &BroadcastEphemeris,
    satellite: Satellite,
    message: NavMessage,
    weeks: &WeekResolver,
) -> Ephemeris {
    let gps_week = weeks.full_gps_week(broadcast.week);
    let instant = |of_week_s: u32| {
        weeks.near_week_end(in_named_week(broadcast, gps_week, of_week_s), of_week_s)
    };
    Ephemeris {
        satellite,
        message,
        toe: instant(broadcast.toe_s),
        toc: instant(broadcast.toc_s),
        toe_sow_s: f64::from(broadcast.toe_s),
        issue: broadcast.issue,
        sqrt_a: broadcast.sqrt_a,
        eccentricity: broadcast.eccentricity,
        i0_rad: broadcast.i0_sc * PI_BROADCAST,
        idot_radps: broadcast.idot_scps * PI_BROADCAST,
        omega0_rad: broadcast.omega0_sc * PI_BROADCAST,
        omega_dot_radps: broadcast.omega_dot_scps * PI_BROADCAST,
        argument_of_perigee_rad: broadcast.argument_of_perigee_sc * PI_BROADCAST,
        m0_rad: broadcast.m0_sc * PI_BROADCAST,
        delta_n_radps: broadcast.delta_n_scps * PI_BROADCAST,
        cuc_rad: broadcast.cuc_rad,
        cus_rad: broadcast.cus_rad,
        crc_m: broadcast.crc_m,
        crs_m: broadcast.crs_m,
        cic_rad: broadcast.cic_rad,
        cis_rad: broadcast.cis_rad,
        af0_s: broadcast.af0_s,
        af1_sps: broadcast.af1_sps,
        af2_sps2: broadcast.af2_sps2,
        group_delay_s: broadcast.group_delay_s,
        sigma_ura_m: match broadcast.source {
            Source::GpsLnav | Source::BdsD1D2 => ura_m(broadcast.accuracy_index),
            Source::GalileoFnav | Source::GalileoInav => sisa_m(broadcast.accuracy_index),
        },
        health: broadcast.health,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accuracy_indices_have_the_values_of_their_documents() {
        assert_eq!(ura_m(0), Some(2.0));
        assert_eq!(ura_m(14), Some(4096.0));
        assert_eq!(ura_m(15), None);
        assert_eq!(sisa_m(49), Some(0.49));
        assert_eq!(sisa_m(74), Some(0.98));
        assert_eq!(sisa_m(99), Some(1.96));
        assert_eq!(sisa_m(107), Some(3.12));
        assert_eq!(sisa_m(125), Some(6.0));
        assert_eq!(sisa_m(126), None);
        assert_eq!(sisa_m(255), None);
    }

    #[test]
    fn cell_becomes_metres_cycles_and_metres_per_second() {
        let cell = Cell {
            satellite: 5,
            signal: 2,
            pseudorange: Some(70 << 29 | 1),
            phase_range: Some(70 << 31),
            phase_range_rate: Some(-6_543_211),
            carrier_to_noise: Some(45 << 4 | 8),
            lock_time: 0,
            half_cycle_ambiguity: false,
        };
        let (satellite, o) = observation(System::Gps, Constellation::Gps, &cell).unwrap();
        assert_eq!((satellite.prn(), o.signal), (5, Signal::C1C));
        // 70 ms of light and the smallest step, 0.558 mm.
        let step_m = o.pseudorange_m.unwrap() - 70.0 * 299_792.458;
        assert!((step_m - 0.000_558_4).abs() < 1e-8);
        assert_eq!(o.carrier_phase_cycles, Some(70.0 * 1_575_420.0));
        assert_eq!(o.range_rate_mps, Some(-654.3211));
        assert_eq!(o.cn0_dbhz, Some(45.5));

        let invalid = Cell {
            pseudorange: None,
            ..cell
        };
        assert_eq!(
            observation(System::Gps, Constellation::Gps, &invalid),
            Err(NoObservation::InvalidPseudorange)
        );
        let stranger = Cell {
            satellite: 33,
            ..cell
        };
        assert_eq!(
            observation(System::Gps, Constellation::Gps, &stranger),
            Err(NoObservation::UnknownSatellite)
        );
    }
}
