//! Payloads of surefix's own frame: what each number means, and the exact inverse.
//!
//! Layouts: docs/native-frame.md. Decoding refuses, with a typed reason, whatever the domain type
//! must not hold: numbers that are not finite, names that do not exist, values no receiver or
//! satellite can mean. `decode(encode(x)) == x` for every legal `x`.

use crate::config::{Config, IonosphereModel, NoisePreset, TroposphereModel};
use crate::consts::{MAX_SATELLITES, MAX_SIGNALS};
use crate::gnss::observation::{EpochFlags, NotAdded};
use crate::gnss::satellite::SystemSet;
use crate::gnss::{
    Ephemeris, KlobucharParameters, NavMessage, ObservationEpoch, Satellite, SatelliteObservation,
    Signal, SignalObservation, System,
};
use crate::integrity::Phase;
use crate::time::GpsTime;
use crate::wire::native::{
    self, Full, HEADER_LEN, Kind, MAX_PAYLOAD, ReadError, Reader, TRAILER_LEN, Writer,
};

/// Why a payload of a right frame is refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PayloadError {
    /// It ends before its content does.
    Truncated,
    /// It goes on after its content.
    TrailingBytes {
        /// How many bytes are left over.
        left: usize,
    },
    /// A number is a NaN or an infinity.
    NotFinite,
    /// No such satellite.
    Satellite {
        /// System number.
        system: u8,
        /// Satellite number.
        prn: u8,
    },
    /// No such signal.
    Signal {
        /// RINEX band.
        band: u8,
        /// RINEX attribute.
        attribute: u8,
    },
    /// No such choice, or flag bits that mean nothing.
    Choice {
        /// The number found.
        number: u8,
    },
    /// A number is outside what it can mean.
    OutOfRange {
        /// The number found.
        value: f64,
    },
    /// A time outside GPS weeks −1 to [`MAX_WEEK`].
    Time {
        /// GPST, ns.
        ns: i64,
    },
    /// A group's number is not below the number of groups.
    Group {
        /// Number of the group.
        group: u8,
        /// Number of groups.
        groups: u8,
    },
    /// The configuration is not legal; see [`Config::check`] and
    /// [`InertialConfig::check`](crate::ins::InertialConfig::check).
    Configuration,
}

impl From<ReadError> for PayloadError {
    fn from(error: ReadError) -> Self {
        match error {
            ReadError::Truncated => Self::Truncated,
            ReadError::NotFinite => Self::NotFinite,
        }
    }
}

/// Highest GPS week a frame may name: that of the 13-bit week of [IS-GPS-705].
pub const MAX_WEEK: i32 = 8191;

/// Bytes of a group's payload before its first satellite.
const GROUP_HEADER_LEN: usize = 8 + 1 + 1 + 1 + 1;
/// Bytes of a satellite before its first signal.
const SATELLITE_HEADER_LEN: usize = 3;
/// Most bytes of one signal.
const MAX_SIGNAL_LEN: usize = 3 + 3 * 8 + 4;
/// Most bytes of one satellite.
const MAX_SATELLITE_LEN: usize = SATELLITE_HEADER_LEN + MAX_SIGNALS * MAX_SIGNAL_LEN;
/// Satellites that fit one group however many signals they have.
const SURE_PER_GROUP: usize = (MAX_PAYLOAD - GROUP_HEADER_LEN) / MAX_SATELLITE_LEN;

/// A buffer of this size holds the frames of any epoch.
pub const MAX_EPOCH_BYTES: usize = MAX_SATELLITES * MAX_SATELLITE_LEN
    + MAX_SATELLITES.div_ceil(SURE_PER_GROUP) * (HEADER_LEN + GROUP_HEADER_LEN + TRAILER_LEN);

const _: () = assert!(SURE_PER_GROUP >= 1);

const INCOMPLETE: u8 = 1;
const OVERFLOW: u8 = 2;
const WEEK_UNKNOWN: u8 = 4;
const CLOCK_RESET: u8 = 8;

const HAS_PSEUDORANGE: u8 = 1;
const HAS_PHASE: u8 = 2;
const HAS_RANGE_RATE: u8 = 4;
const HAS_CN0: u8 = 8;

/// Largest pseudorange, m, and largest carrier phase, cycles: far above any, far below where f64
/// stops telling millimetres.
pub(super) const MAX_RANGE: f64 = 1e10;
/// Largest range rate, m/s.
pub(super) const MAX_RATE_MPS: f64 = 1e6;
/// Largest carrier-to-noise density, dB-Hz: the field of MSM6 and MSM7 ends at 63.9375.
pub(super) const MAX_CN0_DBHZ: f32 = 100.0;

/// `value` if its magnitude is at most `limit`; NaN refuses.
pub(super) fn within(value: f64, limit: f64) -> Result<f64, PayloadError> {
    if value >= -limit && value <= limit {
        Ok(value)
    } else {
        Err(PayloadError::OutOfRange { value })
    }
}

pub(super) fn time(r: &mut Reader<'_>) -> Result<GpsTime, PayloadError> {
    let ns = r.i64()?;
    let time = GpsTime::from_ns(ns);
    // A provisional week may be 0, and a toe shortly before it.
    if (-1..=MAX_WEEK).contains(&time.week()) {
        Ok(time)
    } else {
        Err(PayloadError::Time { ns })
    }
}

pub(super) fn satellite(r: &mut Reader<'_>) -> Result<Satellite, PayloadError> {
    let (system, prn) = (r.u8()?, r.u8()?);
    System::from_index(system as usize)
        .and_then(|known| Satellite::new(known, prn))
        .ok_or(PayloadError::Satellite { system, prn })
}

pub(super) fn put_satellite(w: &mut Writer<'_>, satellite: Satellite) -> Result<(), Full> {
    w.put_u8(satellite.system() as u8)?;
    w.put_u8(satellite.prn())
}

pub(super) fn end(r: &Reader<'_>) -> Result<(), PayloadError> {
    match r.left() {
        0 => Ok(()),
        left => Err(PayloadError::TrailingBytes { left }),
    }
}

fn signal_len(signal: &SignalObservation) -> usize {
    let wide = signal.pseudorange_m.is_some() as usize
        + signal.carrier_phase_cycles.is_some() as usize
        + signal.range_rate_mps.is_some() as usize;
    3 + 8 * wide + 4 * signal.cn0_dbhz.is_some() as usize
}

fn satellite_len(observation: &SatelliteObservation) -> usize {
    let signals: usize = observation.signals.iter().map(signal_len).sum();
    SATELLITE_HEADER_LEN + signals
}

fn put_signal(w: &mut Writer<'_>, signal: &SignalObservation) -> Result<(), Full> {
    let mut presence = 0;
    for (bit, is_there) in [
        (HAS_PSEUDORANGE, signal.pseudorange_m.is_some()),
        (HAS_PHASE, signal.carrier_phase_cycles.is_some()),
        (HAS_RANGE_RATE, signal.range_rate_mps.is_some()),
        (HAS_CN0, signal.cn0_dbhz.is_some()),
    ] {
        if is_there {
            presence |= bit;
        }
    }
    w.put_bytes(&[signal.signal.band(), signal.signal.attribute(), presence])?;
    for value in [
        signal.pseudorange_m,
        signal.carrier_phase_cycles,
        signal.range_rate_mps,
    ]
    .into_iter()
    .flatten()
    {
        w.put_f64(value)?;
    }
    signal.cn0_dbhz.map_or(Ok(()), |cn0| w.put_f32(cn0))
}

fn signal(r: &mut Reader<'_>) -> Result<SignalObservation, PayloadError> {
    let (band, attribute, presence) = (r.u8()?, r.u8()?, r.u8()?);
    let signal = Signal::new(band, attribute).ok_or(PayloadError::Signal { band, attribute })?;
    if presence & !(HAS_PSEUDORANGE | HAS_PHASE | HAS_RANGE_RATE | HAS_CN0) != 0 {
        return Err(PayloadError::Choice { number: presence });
    }
    let mut observation = SignalObservation::new(signal);
    if presence & HAS_PSEUDORANGE != 0 {
        observation.pseudorange_m = Some(within(r.f64()?, MAX_RANGE)?);
    }
    if presence & HAS_PHASE != 0 {
        observation.carrier_phase_cycles = Some(within(r.f64()?, MAX_RANGE)?);
    }
    if presence & HAS_RANGE_RATE != 0 {
        observation.range_rate_mps = Some(within(r.f64()?, MAX_RATE_MPS)?);
    }
    if presence & HAS_CN0 != 0 {
        let cn0 = r.f32()?;
        if !(0.0..=MAX_CN0_DBHZ).contains(&cn0) {
            return Err(PayloadError::OutOfRange { value: cn0.into() });
        }
        observation.cn0_dbhz = Some(cn0);
    }
    Ok(observation)
}

/// How many of the satellites go into the next group.
fn group_size(satellites: &[SatelliteObservation]) -> usize {
    let mut len = GROUP_HEADER_LEN;
    satellites
        .iter()
        .take_while(|observation| {
            len = len.saturating_add(satellite_len(observation));
            len <= MAX_PAYLOAD
        })
        .count()
}

/// Writes the frames of one epoch, one after the other, to the start of `out`, and tells their
/// length together. [`MAX_EPOCH_BYTES`] hold any epoch.
pub fn encode_observations(epoch: &ObservationEpoch, out: &mut [u8]) -> Result<usize, Full> {
    let mut flags = 0;
    for (bit, is_set) in [
        (INCOMPLETE, epoch.flags.incomplete),
        (OVERFLOW, epoch.flags.overflow),
        (WEEK_UNKNOWN, epoch.flags.week_unknown),
        (CLOCK_RESET, epoch.flags.clock_reset),
    ] {
        if is_set {
            flags |= bit;
        }
    }
    let mut groups: u8 = 0;
    let mut rest: &[SatelliteObservation] = &epoch.satellites;
    for _ in 0..MAX_SATELLITES {
        groups = groups.saturating_add(1);
        rest = rest.get(group_size(rest)..).unwrap_or(&[]);
        if rest.is_empty() {
            break;
        }
    }

    let mut len = 0;
    let mut rest: &[SatelliteObservation] = &epoch.satellites;
    for group in 0..groups {
        let (now, later) = rest.split_at_checked(group_size(rest)).ok_or(Full)?;
        rest = later;
        let room = out.get_mut(len..).ok_or(Full)?;
        let written = native::encode(Kind::Observations, room, |w| {
            w.put_i64(epoch.time.ns())?;
            w.put_bytes(&[flags, group, groups, now.len() as u8])?;
            for observation in now {
                put_satellite(w, observation.satellite)?;
                w.put_u8(observation.signals.len() as u8)?;
                for signal in &observation.signals {
                    put_signal(w, signal)?;
                }
            }
            Ok(())
        })?;
        len = len.saturating_add(written);
    }
    Ok(len)
}

/// One frame of an epoch's observations: a view whose whole content was checked.
#[derive(Clone, Copy, Debug)]
pub struct ObservationGroup<'a> {
    /// Receiver time of the epoch, GPST.
    pub time: GpsTime,
    /// What the sender knew about the epoch.
    pub flags: EpochFlags,
    /// Number of this group, from 0.
    pub group: u8,
    /// Number of groups of the epoch.
    pub groups: u8,
    satellites: u8,
    content: Reader<'a>,
}

impl<'a> ObservationGroup<'a> {
    /// Checks everything a payload says.
    pub fn decode(payload: &'a [u8]) -> Result<Self, PayloadError> {
        let mut r = Reader::new(payload);
        let time = time(&mut r)?;
        let [bits, group, groups, satellites] = r.bytes()?;
        if bits & !(INCOMPLETE | OVERFLOW | WEEK_UNKNOWN | CLOCK_RESET) != 0 {
            return Err(PayloadError::Choice { number: bits });
        }
        if group >= groups {
            return Err(PayloadError::Group { group, groups });
        }
        let view = Self {
            time,
            flags: EpochFlags {
                incomplete: bits & INCOMPLETE != 0,
                overflow: bits & OVERFLOW != 0,
                week_unknown: bits & WEEK_UNKNOWN != 0,
                clock_reset: bits & CLOCK_RESET != 0,
            },
            group,
            groups,
            satellites,
            content: r,
        };
        view.each(|_, _| {})?;
        Ok(view)
    }

    /// Adds what the group holds to an epoch; `refused` hears of each observation that had no place.
    pub fn add_to(&self, epoch: &mut ObservationEpoch, mut refused: impl FnMut(NotAdded)) {
        // The content was read to its end once, so it can be again.
        let _ = self.each(|satellite, observation| {
            if let Err(reason) = epoch.add(satellite, observation) {
                refused(reason);
            }
        });
    }

    fn each(&self, mut take: impl FnMut(Satellite, SignalObservation)) -> Result<(), PayloadError> {
        let mut r = self.content;
        for _ in 0..self.satellites {
            let satellite = satellite(&mut r)?;
            for _ in 0..r.u8()? {
                take(satellite, signal(&mut r)?);
            }
        }
        end(&r)
    }
}

/// Writes one ephemeris as a frame.
pub fn encode_ephemeris(ephemeris: &Ephemeris, out: &mut [u8]) -> Result<usize, Full> {
    native::encode(Kind::Ephemeris, out, |w| {
        put_satellite(w, ephemeris.satellite)?;
        w.put_u8(ephemeris.message as u8)?;
        w.put_u8(ephemeris.sigma_ura_m.is_some() as u8)?;
        w.put_u16(ephemeris.issue)?;
        w.put_u16(ephemeris.health)?;
        w.put_i64(ephemeris.toe.ns())?;
        w.put_i64(ephemeris.toc.ns())?;
        for value in [
            ephemeris.toe_sow_s,
            ephemeris.sqrt_a,
            ephemeris.eccentricity,
            ephemeris.i0_rad,
            ephemeris.idot_radps,
            ephemeris.omega0_rad,
            ephemeris.omega_dot_radps,
            ephemeris.argument_of_perigee_rad,
            ephemeris.m0_rad,
            ephemeris.delta_n_radps,
            ephemeris.cuc_rad,
            ephemeris.cus_rad,
            ephemeris.crc_m,
            ephemeris.crs_m,
            ephemeris.cic_rad,
            ephemeris.cis_rad,
            ephemeris.af0_s,
            ephemeris.af1_sps,
            ephemeris.af2_sps2,
        ] {
            w.put_f64(value)?;
        }
        for delay_s in ephemeris.group_delay_s {
            w.put_f64(delay_s)?;
        }
        ephemeris.sigma_ura_m.map_or(Ok(()), |s| w.put_f64(s))
    })
}

/// Reads one ephemeris from a payload.
#[inline(never)]
pub fn decode_ephemeris(payload: &[u8]) -> Result<Ephemeris, PayloadError> {
    let mut r = Reader::new(payload);
    let satellite = satellite(&mut r)?;
    let number = r.u8()?;
    let message = match (satellite.system(), number) {
        (System::Gps, 0) => NavMessage::GpsLnav,
        (System::Galileo, 1) => NavMessage::GalileoInav,
        (System::Galileo, 2) => NavMessage::GalileoFnav,
        (System::Bds, 3) => NavMessage::BdsD1D2,
        _ => return Err(PayloadError::Choice { number }),
    };
    let has_sigma = match r.u8()? {
        0 => false,
        1 => true,
        number => return Err(PayloadError::Choice { number }),
    };
    let (issue, health) = (r.u16()?, r.u16()?);
    let (toe, toc) = (time(&mut r)?, time(&mut r)?);
    // Limits: what the broadcast fields can hold, rounded up; angles at most a whole turn.
    const TURN: f64 = core::f64::consts::TAU;
    let ephemeris = Ephemeris {
        satellite,
        message,
        toe,
        toc,
        issue,
        health,
        toe_sow_s: between(r.f64()?, 0.0, 604_800.0)?,
        sqrt_a: between(r.f64()?, 1.0, 8192.0)?,
        eccentricity: between(r.f64()?, 0.0, 0.5)?,
        i0_rad: within(r.f64()?, TURN)?,
        idot_radps: within(r.f64()?, 1e-3)?,
        omega0_rad: within(r.f64()?, TURN)?,
        omega_dot_radps: within(r.f64()?, 1e-3)?,
        argument_of_perigee_rad: within(r.f64()?, TURN)?,
        m0_rad: within(r.f64()?, TURN)?,
        delta_n_radps: within(r.f64()?, 1e-3)?,
        cuc_rad: within(r.f64()?, 1.0)?,
        cus_rad: within(r.f64()?, 1.0)?,
        crc_m: within(r.f64()?, 1e5)?,
        crs_m: within(r.f64()?, 1e5)?,
        cic_rad: within(r.f64()?, 1.0)?,
        cis_rad: within(r.f64()?, 1.0)?,
        af0_s: within(r.f64()?, 1.0)?,
        af1_sps: within(r.f64()?, 1e-3)?,
        af2_sps2: within(r.f64()?, 1e-3)?,
        group_delay_s: [within(r.f64()?, 1e-3)?, within(r.f64()?, 1e-3)?],
        sigma_ura_m: if has_sigma {
            Some(between(r.f64()?, 0.0, 1e5)?)
        } else {
            None
        },
    };
    end(&r)?;
    Ok(ephemeris)
}

/// `value` if it lies between the two; NaN refuses.
pub(super) fn between(value: f64, low: f64, high: f64) -> Result<f64, PayloadError> {
    if value >= low && value <= high {
        Ok(value)
    } else {
        Err(PayloadError::OutOfRange { value })
    }
}

/// Writes ionosphere parameters as a frame.
pub fn encode_klobuchar(parameters: &KlobucharParameters, out: &mut [u8]) -> Result<usize, Full> {
    native::encode(Kind::Klobuchar, out, |w| {
        w.put_u8(parameters.system as u8)?;
        for value in parameters.alpha.iter().chain(&parameters.beta) {
            w.put_f64(*value)?;
        }
        Ok(())
    })
}

/// Reads ionosphere parameters from a payload.
pub fn decode_klobuchar(payload: &[u8]) -> Result<KlobucharParameters, PayloadError> {
    let mut r = Reader::new(payload);
    let number = r.u8()?;
    let system = match System::from_index(number as usize) {
        Some(system @ (System::Gps | System::Bds)) => system,
        _ => return Err(PayloadError::Choice { number }),
    };
    let mut parameters = KlobucharParameters {
        system,
        alpha: [0.0; 4],
        beta: [0.0; 4],
    };
    // The fields are 8 bits wide: alpha at most 2^-17, beta at most 2^23 s per semicircle cubed.
    for value in &mut parameters.alpha {
        *value = within(r.f64()?, 1.0)?;
    }
    for value in &mut parameters.beta {
        *value = within(r.f64()?, 1e8)?;
    }
    end(&r)?;
    Ok(parameters)
}

/// Writes a configuration as a frame. An illegal one is written and refused when read.
pub fn encode_configuration(config: &Config, out: &mut [u8]) -> Result<usize, Full> {
    // Taken apart by name, so that a new field cannot be forgotten here.
    let Config {
        systems,
        mask_rad,
        phase,
        ionosphere,
        troposphere,
        noise,
        reference_week,
        max_exclusions,
    } = *config;
    native::encode(Kind::Configuration, out, |w| {
        w.put_bytes(&[
            systems.bits(),
            phase as u8,
            ionosphere as u8,
            troposphere as u8,
            noise as u8,
            max_exclusions,
            reference_week.is_some() as u8,
        ])?;
        w.put_u16(reference_week.unwrap_or(0))?;
        w.put_f64(mask_rad)
    })
}

/// Reads a configuration from a payload; what comes out passed [`Config::check`].
pub fn decode_configuration(payload: &[u8]) -> Result<Config, PayloadError> {
    let mut r = Reader::new(payload);
    let [
        systems,
        phase,
        ionosphere,
        troposphere,
        noise,
        max_exclusions,
        has_week,
    ] = r.bytes()?;
    let week = r.u16()?;
    let choice = |number| PayloadError::Choice { number };
    if SystemSet::from_bits(systems).bits() != systems {
        return Err(choice(systems));
    }
    let config = Config {
        systems: SystemSet::from_bits(systems),
        mask_rad: r.f64()?,
        phase: Phase::from_u8(phase).ok_or(choice(phase))?,
        ionosphere: match ionosphere {
            0 => IonosphereModel::None,
            1 => IonosphereModel::Klobuchar,
            2 => IonosphereModel::IonosphereFree,
            number => return Err(choice(number)),
        },
        troposphere: match troposphere {
            0 => TroposphereModel::None,
            1 => TroposphereModel::Saastamoinen,
            number => return Err(choice(number)),
        },
        noise: match noise {
            0 => NoisePreset::Elevation,
            1 => NoisePreset::Airborne,
            number => return Err(choice(number)),
        },
        reference_week: match (has_week, week) {
            (0, 0) => None,
            (1, week) if i32::from(week) <= MAX_WEEK => Some(week),
            (1, week) => return Err(PayloadError::OutOfRange { value: week.into() }),
            (number, _) => return Err(choice(number)),
        },
        max_exclusions,
    };
    end(&r)?;
    match config.check() {
        Ok(()) => Ok(config),
        Err(_) => Err(PayloadError::Configuration),
    }
}

/// Writes the frame that ends a stream.
pub fn encode_end_of_stream(out: &mut [u8]) -> Result<usize, Full> {
    native::encode(Kind::EndOfStream, out, |_| Ok(()))
}

/// Reads the payload that ends a stream: nothing.
pub(super) fn decode_end_of_stream(payload: &[u8]) -> Result<(), PayloadError> {
    end(&Reader::new(payload))
}
