//! One satellite of one epoch: which signals, when they left, from where, and with which clock.
//!
//! In: the observations of a satellite and the ephemerides received. Out: a [`Measurement`], all of
//! a row of the solution that does not depend on where the receiver is, or a [`SatelliteReason`].
//!
//! | symbol | code           | unit | meaning                                                    |
//! |--------|----------------|------|------------------------------------------------------------|
//! | P      | pseudorange_m  | m    | as measured, or the ionosphere-free combination            |
//! | Δt     | clock_m        | m    | c (Δt_sv + Δt_r − T_gd), to be added to P                  |
//! | r_s    | r_e_m          | m    | satellite at transmission, in the Earth-fixed frame of then|
//! | θ      | angle          | rad  | Earth rotation while the signal travels                    |
//!
//! Equations: [IS-GPS-200] 20.3.3.3.3.1 (transmission time t = t_rx − P/c − Δt), 20.3.3.4.3.3.2
//! (frame of reception) → `range_geometry()`. The receiver's clock does not enter: P and the time
//! tag hold the same error.

use core::ops::RangeInclusive;

use super::clock::{group_delay_s, ionosphere_free_factors, polynomial};
use super::orbit::position_velocity;
use super::signal::FREQUENCY_L1_HZ;
use super::store::{EphemerisReason, EphemerisStore};
use super::{Ephemeris, NavMessage, Satellite, SatelliteObservation, Signal, System};
use crate::consts::{OMEGA_EARTH_RADPS, SPEED_OF_LIGHT_MPS};
use crate::time::GpsTime;

/// Why a satellite that was observed is not in the solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum SatelliteReason {
    /// No ephemeris was received.
    NoEphemeris = 0,
    /// The ephemerides received are too old or too new.
    StaleEphemeris = 1,
    /// The broadcast says it is not healthy.
    Unhealthy = 2,
    /// The broadcast gives no accuracy.
    NoAccuracy = 3,
    /// It stands below the elevation mask.
    BelowMask = 4,
    /// None of the signals in use has a pseudorange.
    NoPseudorange = 5,
    /// The pseudorange is no distance to a navigation satellite.
    ImplausiblePseudorange = 6,
    /// Its system was not chosen.
    SystemNotSelected = 7,
    /// Two frequencies are asked for and it has one.
    NoSignalPair = 8,
    /// It was excluded as faulty.
    FaultExcluded = 9,
    /// It is the only one of its system: it gives its own clock and nothing else.
    AloneInSystem = 10,
}

/// Number of [`SatelliteReason`]s.
pub const SATELLITE_REASONS: usize = 11;

impl SatelliteReason {
    /// Every reason, in the order of its number.
    pub const ALL: [Self; SATELLITE_REASONS] = [
        Self::NoEphemeris,
        Self::StaleEphemeris,
        Self::Unhealthy,
        Self::NoAccuracy,
        Self::BelowMask,
        Self::NoPseudorange,
        Self::ImplausiblePseudorange,
        Self::SystemNotSelected,
        Self::NoSignalPair,
        Self::FaultExcluded,
        Self::AloneInSystem,
    ];

    /// Name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NoEphemeris => "no_ephemeris",
            Self::StaleEphemeris => "stale_ephemeris",
            Self::Unhealthy => "unhealthy",
            Self::NoAccuracy => "no_accuracy",
            Self::BelowMask => "below_mask",
            Self::NoPseudorange => "no_pseudorange",
            Self::ImplausiblePseudorange => "implausible_pseudorange",
            Self::SystemNotSelected => "system_not_selected",
            Self::NoSignalPair => "no_signal_pair",
            Self::FaultExcluded => "fault_excluded",
            Self::AloneInSystem => "alone_in_system",
        }
    }
}

impl From<EphemerisReason> for SatelliteReason {
    fn from(reason: EphemerisReason) -> Self {
        match reason {
            EphemerisReason::Missing => Self::NoEphemeris,
            EphemerisReason::Stale => Self::StaleEphemeris,
            EphemerisReason::Unhealthy => Self::Unhealthy,
            EphemerisReason::NoAccuracy => Self::NoAccuracy,
        }
    }
}

/// Pseudoranges taken for distances to a satellite, m: from half the height of the lowest orbit to
/// beyond the highest, widened by receiver clocks up to 30 ms off.
pub const PLAUSIBLE_PSEUDORANGE_M: RangeInclusive<f64> = 1.0e7..=6.0e7;
/// Range rates taken for real, m/s: orbital speed of a user and a receiver clock off by 10⁻⁵.
pub const PLAUSIBLE_RANGE_RATE_MPS: RangeInclusive<f64> = -1.2e4..=1.2e4;

/// A signal or a pair of them, and the messages whose clock goes with it, best first.
struct Choice {
    first: Signal,
    second: Option<Signal>,
    messages: &'static [NavMessage],
}

const fn signal(name: &[u8; 2]) -> Signal {
    match Signal::new(name[0], name[1]) {
        Some(signal) => signal,
        None => Signal::C1C,
    }
}

const fn single(name: &[u8; 2], messages: &'static [NavMessage]) -> Choice {
    Choice {
        first: signal(name),
        second: None,
        messages,
    }
}

const fn pair(first: &[u8; 2], second: &[u8; 2], messages: &'static [NavMessage]) -> Choice {
    Choice {
        first: signal(first),
        second: Some(signal(second)),
        messages,
    }
}

const LNAV: &[NavMessage] = &[NavMessage::GpsLnav];
const BDS: &[NavMessage] = &[NavMessage::BdsD1D2];
/// E1 alone: I/NAV first, each with its own BGD. F/NAV tells the health of E5a, not of E1: on it alone a
/// satellite whose E1 is not healthy is left to the consistency test.
const INAV_FIRST: &[NavMessage] = &[NavMessage::GalileoInav, NavMessage::GalileoFnav];
/// E1 with E5b: F/NAV does not carry BGD(E1,E5b).
const INAV_ONLY: &[NavMessage] = &[NavMessage::GalileoInav];
/// E1 with E5a: F/NAV is made for it; I/NAV carries both delays and serves too.
const FNAV_FIRST: &[NavMessage] = &[NavMessage::GalileoFnav, NavMessage::GalileoInav];

/// L1 C/A, else L1 P(Y).
const GPS_SINGLE: &[Choice] = &[
    single(b"1C", LNAV),
    single(b"1W", LNAV),
    single(b"1P", LNAV),
];
/// P(Y) on both carriers first: the clock is made for it, and L1 C/A differs from it by a delay LNAV
/// does not carry. L5 is in no pair: nor does LNAV carry a delay for L5.
const GPS_PAIRS: &[Choice] = &[
    pair(b"1W", b"2W", LNAV),
    pair(b"1P", b"2P", LNAV),
    pair(b"1C", b"2W", LNAV),
    pair(b"1C", b"2L", LNAV),
    pair(b"1C", b"2S", LNAV),
    pair(b"1C", b"2X", LNAV),
    pair(b"1C", b"2P", LNAV),
];
/// Pilot, pilot and data, data.
const GALILEO_SINGLE: &[Choice] = &[
    single(b"1C", INAV_FIRST),
    single(b"1X", INAV_FIRST),
    single(b"1B", INAV_FIRST),
];
const GALILEO_PAIRS: &[Choice] = &[
    pair(b"1C", b"5Q", FNAV_FIRST),
    pair(b"1X", b"5X", FNAV_FIRST),
    pair(b"1C", b"5X", FNAV_FIRST),
    pair(b"1B", b"5I", FNAV_FIRST),
    pair(b"1C", b"7Q", INAV_ONLY),
    pair(b"1X", b"7X", INAV_ONLY),
    pair(b"1C", b"7X", INAV_ONLY),
    pair(b"1B", b"7I", INAV_ONLY),
];
/// B1I, by in-phase or combined tracking; B3I, whose ionosphere is 1.5 times that of L1, for receivers of
/// the modern signals. B1C and B2a have no group delay in the messages decoded.
const BDS_SINGLE: &[Choice] = &[
    single(b"2I", BDS),
    single(b"2X", BDS),
    single(b"6I", BDS),
    single(b"6X", BDS),
];
/// B3I first: all BDS satellites have it, B2I only the second generation.
const BDS_PAIRS: &[Choice] = &[
    pair(b"2I", b"6I", BDS),
    pair(b"2X", b"6X", BDS),
    pair(b"2I", b"7I", BDS),
    pair(b"2X", b"7X", BDS),
];

const fn choices(system: System, ionosphere_free: bool) -> &'static [Choice] {
    match (system, ionosphere_free) {
        (System::Gps, false) => GPS_SINGLE,
        (System::Gps, true) => GPS_PAIRS,
        (System::Galileo, false) => GALILEO_SINGLE,
        (System::Galileo, true) => GALILEO_PAIRS,
        (System::Bds, false) => BDS_SINGLE,
        (System::Bds, true) => BDS_PAIRS,
    }
}

/// What a satellite gives to a solution, before it is known where the receiver is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurement {
    /// Which satellite.
    pub satellite: Satellite,
    /// As measured, or combined, m.
    pub pseudorange_m: f64,
    /// Range rate of the first signal that has one, m/s.
    pub range_rate_mps: Option<f64>,
    /// C/N0 of the first signal, dB-Hz.
    pub cn0_dbhz: Option<f32>,
    /// Satellite clock to add to the pseudorange: polynomial, relativity, group delay, m.
    pub clock_m: f64,
    /// Satellite clock drift to add to the range rate, m/s.
    pub clock_drift_mps: f64,
    /// Antenna at transmission, in the Earth-fixed frame of that instant, m.
    pub r_e_m: [f64; 3],
    /// Its velocity relative to that frame, m/s.
    pub v_e_mps: [f64; 3],
    /// One sigma of the signal in space as broadcast, m.
    pub sigma_ura_m: f64,
    /// By how much the combination multiplies noise, 1 for a single signal.
    pub noise_factor: f64,
    /// (f of L1 / f of the signal)² to scale an ionospheric delay of L1, 0 when combined away.
    pub ionosphere_scale: f64,
}

/// The pseudorange of a signal, if one was measured.
fn pseudorange(observation: &SatelliteObservation, signal: Signal) -> Option<f64> {
    observation.signal(signal)?.pseudorange_m
}

/// The pseudoranges of a choice, if all of it was measured.
fn observed(observation: &SatelliteObservation, choice: &Choice) -> Option<[f64; 2]> {
    let first_m = pseudorange(observation, choice.first)?;
    match choice.second {
        None => Some([first_m, first_m]),
        Some(second) => Some([first_m, pseudorange(observation, second)?]),
    }
}

/// The measurement of one satellite at receiver time `time`, or why there is none.
///
/// # Errors
/// [`SatelliteReason`]: no ephemeris to use, no pseudorange of a signal in use, or one that is no
/// distance.
pub fn measure(
    observation: &SatelliteObservation,
    time: GpsTime,
    store: &EphemerisStore,
    ionosphere_free: bool,
) -> Result<Measurement, SatelliteReason> {
    let satellite = observation.satellite;
    let mut reason = if ionosphere_free
        && choices(satellite.system(), false)
            .iter()
            .any(|choice| observed(observation, choice).is_some())
    {
        SatelliteReason::NoSignalPair
    } else {
        SatelliteReason::NoPseudorange
    };
    for choice in choices(satellite.system(), ionosphere_free) {
        let Some(pseudoranges_m) = observed(observation, choice) else {
            continue;
        };
        match store.select_preferred(satellite, choice.messages, time) {
            Ok(ephemeris) => {
                let combination = Combination::new(ephemeris, choice, pseudoranges_m)?;
                let mut measurement = combination.measurement(ephemeris, time)?;
                measurement.range_rate_mps = range_rate(observation, choice);
                measurement.cn0_dbhz = observation
                    .signal(choice.first)
                    .and_then(|signal| signal.cn0_dbhz);
                return Ok(measurement);
            }
            Err(refused) => reason = refused.into(),
        }
    }
    Err(reason)
}

fn range_rate(observation: &SatelliteObservation, choice: &Choice) -> Option<f64> {
    [Some(choice.first), choice.second]
        .into_iter()
        .flatten()
        .filter_map(|signal| observation.signal(signal)?.range_rate_mps)
        .find(|rate_mps| PLAUSIBLE_RANGE_RATE_MPS.contains(rate_mps))
}

/// One signal or two, as one pseudorange with one group delay.
struct Combination {
    pseudorange_m: f64,
    group_delay_s: f64,
    noise_factor: f64,
    ionosphere_scale: f64,
}

impl Combination {
    fn new(
        ephemeris: &Ephemeris,
        choice: &Choice,
        [first_m, second_m]: [f64; 2],
    ) -> Result<Self, SatelliteReason> {
        let system = ephemeris.satellite.system();
        let carrier = |signal: Signal| {
            let frequency_hz = signal.frequency_hz(system)?;
            Some((frequency_hz, group_delay_s(ephemeris, signal)?))
        };
        let (first_hz, first_s) = carrier(choice.first).ok_or(SatelliteReason::NoSignalPair)?;
        if !PLAUSIBLE_PSEUDORANGE_M.contains(&first_m)
            || !PLAUSIBLE_PSEUDORANGE_M.contains(&second_m)
        {
            return Err(SatelliteReason::ImplausiblePseudorange);
        }
        let Some(second) = choice.second else {
            let ratio = FREQUENCY_L1_HZ / first_hz;
            return Ok(Self {
                pseudorange_m: first_m,
                group_delay_s: first_s,
                noise_factor: 1.0,
                ionosphere_scale: ratio * ratio,
            });
        };
        let (second_hz, second_s) = carrier(second).ok_or(SatelliteReason::NoSignalPair)?;
        let [first, other] = ionosphere_free_factors(first_hz, second_hz);
        Ok(Self {
            pseudorange_m: first * first_m + other * second_m,
            group_delay_s: first * first_s + other * second_s,
            noise_factor: libm::sqrt(first * first + other * other),
            ionosphere_scale: 0.0,
        })
    }

    fn measurement(
        &self,
        ephemeris: &Ephemeris,
        time: GpsTime,
    ) -> Result<Measurement, SatelliteReason> {
        if !PLAUSIBLE_PSEUDORANGE_M.contains(&self.pseudorange_m) {
            return Err(SatelliteReason::ImplausiblePseudorange);
        }
        let transit_s = self.pseudorange_m / SPEED_OF_LIGHT_MPS;
        let since_toc_s = time.seconds_since(ephemeris.toc) - transit_s;
        let first_guess = polynomial(ephemeris, since_toc_s);
        let clock = polynomial(ephemeris, since_toc_s - first_guess.offset_s);
        let since_toe_s = time.seconds_since(ephemeris.toe) - transit_s - clock.offset_s;
        // A checked ephemeris has an orbit; one that has none is as good as none.
        let orbit =
            position_velocity(ephemeris, since_toe_s).map_err(|_| SatelliteReason::NoEphemeris)?;
        // Relativity and group delay move the instant of transmission too, by less than 0.2 µs:
        // half a millimetre along the orbit.
        let late_s = orbit.relativity_s - self.group_delay_s;
        let [x, y, z] = orbit.r_e_m;
        let [vx, vy, vz] = orbit.v_e_mps;
        Ok(Measurement {
            satellite: ephemeris.satellite,
            pseudorange_m: self.pseudorange_m,
            range_rate_mps: None,
            cn0_dbhz: None,
            clock_m: SPEED_OF_LIGHT_MPS * (clock.offset_s + late_s),
            clock_drift_mps: SPEED_OF_LIGHT_MPS * (clock.rate_sps + orbit.relativity_rate_sps),
            r_e_m: [x - vx * late_s, y - vy * late_s, z - vz * late_s],
            v_e_mps: orbit.v_e_mps,
            sigma_ura_m: ephemeris.sigma_ura_m.ok_or(SatelliteReason::NoAccuracy)?,
            noise_factor: self.noise_factor,
            ionosphere_scale: self.ionosphere_scale,
        })
    }
}

/// The straight line from a receiver to a satellite, in the Earth-fixed frame of reception.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeGeometry {
    /// Its length, m.
    pub range_m: f64,
    /// Its direction, receiver to satellite, 1.
    pub line_of_sight_e: [f64; 3],
    /// Earth rotation while the signal travelled, rad.
    pub angle: f64,
}

/// Turns a vector of the frame of transmission into the frame of reception.
///
/// cos θ ≈ 1 − θ²/2 and sin θ ≈ θ − θ³/6 are exact to the last bit: θ is below 10⁻⁴.
pub(super) fn rotated(angle: f64, [x, y, z]: [f64; 3]) -> [f64; 3] {
    let square = angle * angle;
    let cos = 1.0 - 0.5 * square;
    let sin = angle * (1.0 - square / 6.0);
    [cos * x + sin * y, cos * y - sin * x, z]
}

/// Range and direction from receiver `r_eb_e` to a satellite at `r_es_e` in the frame of transmission.
pub fn range_geometry(r_es_e: [f64; 3], r_eb_e: [f64; 3]) -> RangeGeometry {
    let [xs, ys, zs] = r_es_e;
    let [xb, yb, zb] = r_eb_e;
    let (dx, dy, dz) = (xs - xb, ys - yb, zs - zb);
    // The first-order formula is good to a millimetre, which is all the travel time needs.
    let near_m = libm::sqrt(dx * dx + dy * dy + dz * dz)
        + OMEGA_EARTH_RADPS / SPEED_OF_LIGHT_MPS * (xs * yb - ys * xb);
    let angle = OMEGA_EARTH_RADPS * near_m / SPEED_OF_LIGHT_MPS;
    let [xs, ys, zs] = rotated(angle, r_es_e);
    let (dx, dy, dz) = (xs - xb, ys - yb, zs - zb);
    let range_m = libm::sqrt(dx * dx + dy * dy + dz * dz);
    let inverse = 1.0 / range_m;
    RangeGeometry {
        range_m,
        line_of_sight_e: [dx * inverse, dy * inverse, dz * inverse],
        angle,
    }
}

/// The part of a range rate that a receiver at rest sees, and the factor by which its own velocity
/// along the line of sight enters.
///
/// ρ̇ = (u·v_s − u·v_b) / (1 + u·(v_s + ω × r_s)/c): the satellite is seen where it was, and how long
/// ago changes at the rate ρ̇/c. Without the denominator the rate is off by 3 mm/s.
pub fn satellite_range_rate(measurement: &Measurement, geometry: &RangeGeometry) -> (f64, f64) {
    let [ux, uy, uz] = geometry.line_of_sight_e;
    let [vx, vy, vz] = rotated(geometry.angle, measurement.v_e_mps);
    let [x, y, _] = rotated(geometry.angle, measurement.r_e_m);
    let along_mps = ux * vx + uy * vy + uz * vz;
    let turning_mps = OMEGA_EARTH_RADPS * (uy * x - ux * y);
    let factor = 1.0 / (1.0 + (along_mps + turning_mps) / SPEED_OF_LIGHT_MPS);
    (along_mps * factor, factor)
}

/// Pseudorange a receiver at `r_eb_e` would measure of this satellite, m, with its clock `clock_m`
/// ahead of system time and `delay_m` of atmosphere.
pub fn predicted_pseudorange_m(
    measurement: &Measurement,
    r_eb_e: [f64; 3],
    clock_m: f64,
    delay_m: f64,
) -> f64 {
    range_geometry(measurement.r_e_m, r_eb_e).range_m + clock_m - measurement.clock_m + delay_m
}

/// Range rate a receiver at `r_eb_e` moving at `v_eb_e` would measure, m/s, with its clock gaining
/// `drift_mps` on system time.
pub fn predicted_range_rate_mps(
    measurement: &Measurement,
    r_eb_e: [f64; 3],
    v_eb_e: [f64; 3],
    drift_mps: f64,
) -> f64 {
    let geometry = range_geometry(measurement.r_e_m, r_eb_e);
    let (at_rest_mps, factor) = satellite_range_rate(measurement, &geometry);
    let [ux, uy, uz] = geometry.line_of_sight_e;
    let [vx, vy, vz] = v_eb_e;
    at_rest_mps - factor * (ux * vx + uy * vy + uz * vz) + drift_mps - measurement.clock_drift_mps
}
