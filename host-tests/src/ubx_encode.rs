//! Observations and navigation messages as UBX frames: what a u-blox receiver of generation 9 or 10
//! would send.
//!
//! Layouts: [UBX-F9-HPG] RXM-RAWX version 1 and RXM-SFRBX version 2. How words of GPS and BDS
//! are put into RXM-SFRBX it leaves open; here it is as the recordings of ZED-F9P and X20P have it.

use anyhow::{Result, bail};
use surefix_core::consts::SPEED_OF_LIGHT_MPS;
use surefix_core::gnss::{ObservationEpoch, Satellite, Signal, SignalObservation, System};
use surefix_core::time::{GpsTime, leap_seconds};

use crate::simulate::receiver::{PHASE_SIGMA_M, RANGE_RATE_SIGMA_MPS, thermal_sigma_m};

/// Class of receiver manager messages.
const CLASS_RXM: u8 = 0x02;
const ID_RAWX: u8 = 0x15;
const ID_SFRBX: u8 = 0x13;
/// Longest lock time there is a number for, ms.
const MAX_LOCK_MS: u64 = 64_500;

/// A frame: header, payload and Fletcher's sums. [UBX-F9-HPG] 3.2, 3.4.
pub fn frame(class: u8, id: u8, payload: &[u8]) -> Result<Vec<u8>> {
    let length = u16::try_from(payload.len())?;
    let mut bytes = vec![0xb5, 0x62, class, id];
    bytes.extend(length.to_le_bytes());
    bytes.extend(payload);
    let (a, b) = bytes[2..].iter().fold((0_u8, 0_u8), |(a, b), byte| {
        let a = a.wrapping_add(*byte);
        (a, b.wrapping_add(a))
    });
    bytes.extend([a, b]);
    Ok(bytes)
}

/// Number of a system. [UBX-F9-HPG] 1.5.2.
fn gnss_id(system: System) -> u8 {
    match system {
        System::Gps => 0,
        System::Galileo => 2,
        System::Bds => 3,
    }
}

/// Number of a signal. [UBX-F9-HPG] 1.5.4, and B3I of receivers that track it. GEO have D2 on both.
fn signal_id(satellite: Satellite, signal: Signal) -> Option<u8> {
    let geo = satellite.is_bds_geo();
    match (satellite.system(), signal.band(), signal.attribute()) {
        (System::Gps, b'1', b'C') | (System::Galileo, b'1', b'C') => Some(0),
        (System::Gps, b'2', b'L') => Some(3),
        (System::Galileo, b'7', b'Q') => Some(6),
        (System::Bds, b'2', b'I') => Some(u8::from(geo)),
        (System::Bds, b'6', b'I') => Some(if geo { 10 } else { 4 }),
        _ => None,
    }
}

/// Signal whose navigation message a satellite's frames are of: L1 C/A, E1-B, B1I.
fn message_signal_id(satellite: Satellite) -> u8 {
    match satellite.system() {
        System::Gps => 0,
        System::Galileo => 1,
        System::Bds => u8::from(satellite.is_bds_geo()),
    }
}

/// The smallest code n with `unit`·2ⁿ not below a standard deviation.
fn deviation_code(sigma: f64, unit: f64) -> u8 {
    (0..15)
        .find(|n| unit * f64::from(1 << n) >= sigma)
        .unwrap_or(15)
}

/// RXM-RAWX of an epoch. `lock_ms` says how long a satellite has been tracked.
///
/// # Errors
/// When a signal has no number, or an epoch too many.
pub fn rawx(epoch: &ObservationEpoch, lock_ms: impl Fn(Satellite) -> u64) -> Result<Vec<u8>> {
    let mut measurements = Vec::new();
    let mut count = 0_u8;
    for of_satellite in &epoch.satellites {
        for observation in &of_satellite.signals {
            let lock_ms = lock_ms(of_satellite.satellite).min(MAX_LOCK_MS) as u16;
            measurement(
                &mut measurements,
                of_satellite.satellite,
                observation,
                lock_ms,
            )?;
            count = match count.checked_add(1) {
                Some(count) => count,
                None => bail!("more than 255 measurements in one epoch"),
            };
        }
    }
    let reset = if epoch.flags.clock_reset { 0b10 } else { 0b00 };
    let mut payload = epoch.time.tow_s().to_le_bytes().to_vec();
    payload.extend(u16::try_from(epoch.time.week())?.to_le_bytes());
    payload.extend([
        i8::try_from(leap_seconds(epoch.time))? as u8,
        count,
        // Leap seconds are known.
        0b01 | reset,
        1,
        0,
        0,
    ]);
    payload.extend(measurements);
    frame(CLASS_RXM, ID_RAWX, &payload)
}

/// The 32 bytes of one measurement.
fn measurement(
    bytes: &mut Vec<u8>,
    satellite: Satellite,
    observation: &SignalObservation,
    lock_ms: u16,
) -> Result<()> {
    let system = satellite.system();
    let signal = observation.signal;
    let (Some(signal_id), Some(frequency_hz)) =
        (signal_id(satellite, signal), signal.frequency_hz(system))
    else {
        bail!("{satellite} {signal} is no signal of a u-blox receiver");
    };
    let wavelength_m = SPEED_OF_LIGHT_MPS / frequency_hz;
    let cn0_dbhz = observation.cn0_dbhz.map_or(0.0, f64::from);
    // Back from the density to the elevation it was made of, receiver.rs.
    let elevation_rad = libm::asin(((cn0_dbhz - 36.0) / 13.0).clamp(0.0, 1.0));
    let doppler_hz = observation.range_rate_mps.map(|rate| -rate / wavelength_m);
    let code = observation.pseudorange_m;
    let phase = observation.carrier_phase_cycles;

    bytes.extend(code.unwrap_or(0.0).to_le_bytes());
    bytes.extend(phase.unwrap_or(0.0).to_le_bytes());
    bytes.extend((doppler_hz.unwrap_or(0.0) as f32).to_le_bytes());
    bytes.extend([gnss_id(system), satellite.prn(), signal_id, 0]);
    bytes.extend(lock_ms.to_le_bytes());
    bytes.extend([
        libm::round(cn0_dbhz) as u8,
        deviation_code(thermal_sigma_m(elevation_rad), 0.01),
        deviation_code(PHASE_SIGMA_M / wavelength_m, 0.004),
        deviation_code(RANGE_RATE_SIGMA_MPS / wavelength_m, 0.002),
        // Pseudorange valid; phase valid and its half cycle.
        u8::from(code.is_some()) | if phase.is_some() { 0b110 } else { 0 },
        0,
    ]);
    Ok(())
}

/// RXM-SFRBX of one subframe or page. Words of GPS are as transmitted.
///
/// # Errors
/// When there are too many words.
pub fn sfrbx(satellite: Satellite, channel: u8, words: &[u32]) -> Result<Vec<u8>> {
    let system = satellite.system();
    let mut payload = vec![
        gnss_id(system),
        satellite.prn(),
        message_signal_id(satellite),
        0,
        u8::try_from(words.len())?,
        channel,
        2,
        0,
    ];
    // The last word before a subframe ends in two zeros.
    let mut before = 0_u32;
    for word in words {
        let packed = match system {
            System::Gps => {
                let with_last_bits = (before & 3) << 30 | word;
                if before & 1 == 1 {
                    !with_last_bits
                } else {
                    with_last_bits
                }
            }
            System::Galileo | System::Bds => *word,
        };
        before = *word;
        payload.extend(packed.to_le_bytes());
    }
    frame(CLASS_RXM, ID_SFRBX, &payload)
}

/// What was sent by this time is received and passed on at `time`: the way from the farthest GEO takes
/// 0.14 s.
pub fn sent_by(time: GpsTime) -> GpsTime {
    time.plus_ns(-150_000_000)
}
