//! What surefix says of an epoch, and its frame on the wire.
//!
//! The frame is fixed in length: every field is always there, and presence bits tell which of them
//! hold a value. The host turns it into a row of `epochs.csv`, whether it came from a PC or from a
//! board. Layout: docs/native-frame.md.

use crate::gnss::satellite::{Satellite, SatelliteSet};
use crate::gnss::{System, solution::SATELLITE_REASONS};
use crate::integrity::{
    InertialStatus, Integrity, Mode, NoBound, ProtectionLevel, Reason, Suspect, Verdict,
};
use crate::time::GpsTime;
use crate::wire::native::{self, Full, Kind, ReadError, Reader, Writer};

/// A position and what goes with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fix {
    /// Position, ECEF, m.
    pub r_e_m: [f64; 3],
    /// Geodetic latitude, WGS-84, degrees.
    pub lat_deg: f64,
    /// Longitude, degrees.
    pub lon_deg: f64,
    /// Height above the WGS-84 ellipsoid, m.
    pub h_m: f64,
    /// Velocity east, north, up, m/s; `None` where no Doppler was measured.
    pub velocity_enu_mps: Option<[f64; 3]>,
    /// Receiver clock minus each system's time, m, in the order of [`System::ALL`].
    pub clock_m: [Option<f64>; System::ALL.len()],
}

/// What the tightly coupled filter says besides the position; one sigma are its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Navigation {
    /// Velocity of the antenna against the Earth, ECEF, m/s.
    pub v_e_mps: [f64; 3],
    /// Rotation from body to ECEF, scalar first and not negative.
    pub q_e_b: [f64; 4],
    /// Roll, pitch, heading, degrees.
    pub roll_pitch_heading_deg: [f64; 3],
    /// Receiver clock bias, m, and drift, m/s.
    pub clock: [f64; 2],
    /// One sigma of the position, east, north, up, m.
    pub sigma_position_enu_m: [f64; 3],
    /// One sigma of the velocity, east, north, up, m/s.
    pub sigma_velocity_enu_mps: [f64; 3],
    /// One sigma of the attitude about east, north, up, degrees.
    pub sigma_attitude_enu_deg: [f64; 3],
    /// Fault-free horizontal and vertical level, m: what the filter's covariance alone bounds.
    pub fault_free_m: [f64; 2],
    /// Normalised innovation squared of the epoch, 1.
    pub nis: f64,
    /// Measurements in it: pseudoranges and range rates.
    pub nis_rows: u8,
}

/// What to know of an epoch besides its verdict.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ReportFlags {
    /// The receiver announced more messages for the epoch than arrived.
    pub incomplete: bool,
    /// Satellites or signals were left out because the epoch was full.
    pub overflow: bool,
    /// The week is not known yet.
    pub week_unknown: bool,
    /// Klobuchar was asked for and no parameters were received: no correction, larger sigma.
    pub no_broadcast_ionosphere: bool,
    /// The receiver reset its clock.
    pub clock_reset: bool,
    /// The receiver's own solution lay too far from the loosely coupled filter to be taken.
    pub fix_refused: bool,
    /// The range rates of the one-epoch solution contradict each other: its velocity is not to be relied on.
    pub range_rates_disagree: bool,
}

impl ReportFlags {
    /// Names in files, in the order of the bits.
    pub const NAMES: [&'static str; 7] = [
        "incomplete",
        "overflow",
        "week_unknown",
        "no_broadcast_ionosphere",
        "clock_reset",
        "fix_refused",
        "range_rates_disagree",
    ];

    /// One bit each, in the order of [`ReportFlags::NAMES`].
    pub const fn bits(self) -> u8 {
        self.incomplete as u8
            | (self.overflow as u8) << 1
            | (self.week_unknown as u8) << 2
            | (self.no_broadcast_ionosphere as u8) << 3
            | (self.clock_reset as u8) << 4
            | (self.fix_refused as u8) << 5
            | (self.range_rates_disagree as u8) << 6
    }

    /// Inverse of [`ReportFlags::bits`].
    pub const fn from_bits(bits: u8) -> Self {
        Self {
            incomplete: bits & 1 != 0,
            overflow: bits & 2 != 0,
            week_unknown: bits & 4 != 0,
            no_broadcast_ionosphere: bits & 8 != 0,
            clock_reset: bits & 16 != 0,
            fix_refused: bits & 32 != 0,
            range_rates_disagree: bits & 64 != 0,
        }
    }
}

/// Everything surefix says of one epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EpochReport {
    /// Time of the epoch; its week counts only without [`ReportFlags::week_unknown`].
    pub time: GpsTime,
    /// Since the first epoch of the stream, ns.
    pub since_first_ns: i64,
    /// Where the position comes from.
    pub mode: Mode,
    /// The position, if there is one.
    pub fix: Option<Fix>,
    /// What to think of it.
    pub verdict: Verdict,
    /// Satellites in the position.
    pub used: SatelliteSet,
    /// Satellites observed; of a receiver's own solution those it used.
    pub n_observed: u8,
    /// Satellites observed and not used, by reason, in the order of `SatelliteReason`.
    pub unused: [u8; SATELLITE_REASONS],
    /// What else to know.
    pub flags: ReportFlags,
    /// Root mean square of the pseudorange residuals of the one-epoch solution, m.
    pub residual_rms_m: Option<f64>,
    /// One sigma of the position without a fault, east, north, up, m: of the one-epoch solution where it
    /// passed its test, of the filter by its own covariance, of a receiver's own solution by its accuracy.
    pub sigma_enu_m: Option<[f64; 3]>,
    /// The satellite that most likely failed, where one did and it is observed.
    pub suspect: Option<Suspect>,
    /// What the filter says, if it says something.
    pub navigation: Option<Navigation>,
    /// What the inertial side does.
    pub inertial: InertialStatus,
}

/// Bytes of a report frame, header and CRC included.
pub const REPORT_FRAME_LENGTH: usize = PAYLOAD_LENGTH + native::HEADER_LEN + native::TRAILER_LEN;
/// Bytes of its payload.
const PAYLOAD_LENGTH: usize = 217 + SATELLITE_REASONS + 1 + NAVIGATION_LENGTH + SUSPECT_LENGTH;
/// Bytes of what the filter says in it.
const NAVIGATION_LENGTH: usize = 24 * 8 + 1;
/// Bytes of residuals, sigmas and the satellite that most likely failed.
const SUSPECT_LENGTH: usize = 4 * 8 + 2 + 3 * 8;

const HAS_FIX: u16 = 1 << 0;
const HAS_VELOCITY: u16 = 1 << 1;
const HAS_CLOCK: [u16; System::ALL.len()] = [1 << 2, 1 << 3, 1 << 4];
const HAS_VAL: u16 = 1 << 5;
const HAS_STATISTIC: u16 = 1 << 6;
const HAS_THRESHOLD: u16 = 1 << 7;
const HAS_NAVIGATION: u16 = 1 << 8;
const HAS_RESIDUALS: u16 = 1 << 9;
const HAS_SIGMA: u16 = 1 << 10;
const HAS_SUSPECT: u16 = 1 << 11;

/// Why a report payload was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReportError {
    /// The payload is too short, or holds a number that is not finite.
    Payload(ReadError),
    /// A number stands for no state, mode or reason.
    UnknownCode {
        /// The number.
        code: u8,
    },
}

impl From<ReadError> for ReportError {
    fn from(error: ReadError) -> Self {
        Self::Payload(error)
    }
}

/// Writes the report as one frame of [`Kind::Report`]; returns its length.
///
/// # Errors
/// [`Full`] when `out` is shorter than [`REPORT_FRAME_LENGTH`].
#[inline(never)]
pub fn encode(report: &EpochReport, out: &mut [u8]) -> Result<usize, Full> {
    native::encode(Kind::Report, out, |writer| write_payload(report, writer))
}

fn write_payload(report: &EpochReport, writer: &mut Writer<'_>) -> Result<(), Full> {
    let verdict = &report.verdict;
    let mut present = 0;
    if let Some(fix) = &report.fix {
        present |= HAS_FIX;
        if fix.velocity_enu_mps.is_some() {
            present |= HAS_VELOCITY;
        }
        for (clock, bit) in fix.clock_m.iter().zip(HAS_CLOCK) {
            if clock.is_some() {
                present |= bit;
            }
        }
    }
    if verdict.val_m.is_some() {
        present |= HAS_VAL;
    }
    if verdict.statistic.is_some() {
        present |= HAS_STATISTIC;
    }
    if verdict.threshold.is_some() {
        present |= HAS_THRESHOLD;
    }
    if report.navigation.is_some() {
        present |= HAS_NAVIGATION;
    }
    if report.residual_rms_m.is_some() {
        present |= HAS_RESIDUALS;
    }
    if report.sigma_enu_m.is_some() {
        present |= HAS_SIGMA;
    }
    if report.suspect.is_some() {
        present |= HAS_SUSPECT;
    }
    writer.put_u16(present)?;
    writer.put_u8(report.flags.bits())?;
    writer.put_u8(report.mode as u8)?;
    writer.put_u8(verdict.integrity as u8)?;
    writer.put_u8(verdict.reason as u8)?;
    writer.put_u8(report.n_observed)?;
    writer.put_i64(report.time.ns())?;
    writer.put_i64(report.since_first_ns)?;
    let fix = report.fix.unwrap_or(Fix {
        r_e_m: [0.0; 3],
        lat_deg: 0.0,
        lon_deg: 0.0,
        h_m: 0.0,
        velocity_enu_mps: None,
        clock_m: [None; System::ALL.len()],
    });
    for value in fix.r_e_m {
        writer.put_f64(value)?;
    }
    writer.put_f64(fix.lat_deg)?;
    writer.put_f64(fix.lon_deg)?;
    writer.put_f64(fix.h_m)?;
    for value in fix.velocity_enu_mps.unwrap_or([0.0; 3]) {
        writer.put_f64(value)?;
    }
    for value in fix.clock_m {
        writer.put_f64(value.unwrap_or(0.0))?;
    }
    for level in [verdict.hpl, verdict.vpl] {
        let (code, bound_m) = match level {
            ProtectionLevel::Bound(bound_m) => (0, bound_m),
            ProtectionLevel::Unavailable(why) => (1 + why as u8, 0.0),
        };
        writer.put_u8(code)?;
        writer.put_f64(bound_m)?;
    }
    writer.put_f64(verdict.hal_m)?;
    writer.put_f64(verdict.val_m.unwrap_or(0.0))?;
    writer.put_f64(verdict.statistic.unwrap_or(0.0))?;
    writer.put_f64(verdict.threshold.unwrap_or(0.0))?;
    for set in [report.used, verdict.excluded] {
        for mask in set.masks() {
            writer.put_u64(mask)?;
        }
    }
    for count in report.unused {
        writer.put_u8(count)?;
    }
    writer.put_u8(report.inertial as u8)?;
    match &report.navigation {
        Some(navigation) => write_navigation(navigation, writer)?,
        None => (0..NAVIGATION_LENGTH).try_for_each(|_| writer.put_u8(0))?,
    }
    writer.put_f64(report.residual_rms_m.unwrap_or(0.0))?;
    for value in report.sigma_enu_m.unwrap_or([0.0; 3]) {
        writer.put_f64(value)?;
    }
    let (system, prn, numbers) = match &report.suspect {
        Some(suspect) => (
            suspect.satellite.system() as u8,
            suspect.satellite.prn(),
            [suspect.bias_m, suspect.sigma_m, suspect.p_md],
        ),
        None => (0, 0, [0.0; 3]),
    };
    writer.put_u8(system)?;
    writer.put_u8(prn)?;
    numbers.into_iter().try_for_each(|n| writer.put_f64(n))
}

fn write_navigation(navigation: &Navigation, writer: &mut Writer<'_>) -> Result<(), Full> {
    // Taken apart by name, so that a new field cannot be forgotten here.
    let Navigation {
        v_e_mps,
        q_e_b,
        roll_pitch_heading_deg,
        clock,
        sigma_position_enu_m,
        sigma_velocity_enu_mps,
        sigma_attitude_enu_deg,
        fault_free_m,
        nis,
        nis_rows,
    } = navigation;
    for value in v_e_mps
        .iter()
        .chain(q_e_b)
        .chain(roll_pitch_heading_deg)
        .chain(clock)
        .chain(sigma_position_enu_m)
        .chain(sigma_velocity_enu_mps)
        .chain(sigma_attitude_enu_deg)
        .chain(fault_free_m)
    {
        writer.put_f64(*value)?;
    }
    writer.put_f64(*nis)?;
    writer.put_u8(*nis_rows)
}

/// Reads the payload of a [`Kind::Report`] frame.
///
/// # Errors
/// [`ReportError`] when it is too short, holds a number that is not finite, or an unknown code.
pub fn decode(payload: &[u8]) -> Result<EpochReport, ReportError> {
    let mut reader = Reader::new(payload);
    let present = reader.u16()?;
    let has = |bit: u16| present & bit != 0;
    let flags = ReportFlags::from_bits(reader.u8()?);
    let mode = coded(reader.u8()?, Mode::from_u8)?;
    let integrity = coded(reader.u8()?, Integrity::from_u8)?;
    let reason = coded(reader.u8()?, Reason::from_u8)?;
    let n_observed = reader.u8()?;
    let time = GpsTime::from_ns(reader.i64()?);
    let since_first_ns = reader.i64()?;
    let r_e_m = three(&mut reader)?;
    let [lat_deg, lon_deg, h_m] = three(&mut reader)?;
    let velocity_enu_mps = three(&mut reader)?;
    let clock_m = three(&mut reader)?;
    let hpl = level(&mut reader)?;
    let vpl = level(&mut reader)?;
    let hal_m = reader.f64()?;
    let val_m = reader.f64()?;
    let statistic = reader.f64()?;
    let threshold = reader.f64()?;
    let used = set(&mut reader)?;
    let excluded = set(&mut reader)?;
    let mut unused = [0; SATELLITE_REASONS];
    for count in &mut unused {
        *count = reader.u8()?;
    }
    let inertial = coded(reader.u8()?, InertialStatus::from_u8)?;
    let navigation = navigation(&mut reader)?;
    let residual_rms_m = reader.f64()?;
    let sigma_enu_m = three(&mut reader)?;
    let suspect = suspect(&mut reader, has(HAS_SUSPECT))?;
    let mut clocks = [None; System::ALL.len()];
    for ((clock, value), bit) in clocks.iter_mut().zip(clock_m).zip(HAS_CLOCK) {
        *clock = has(bit).then_some(value);
    }
    Ok(EpochReport {
        time,
        since_first_ns,
        mode,
        fix: has(HAS_FIX).then_some(Fix {
            r_e_m,
            lat_deg,
            lon_deg,
            h_m,
            velocity_enu_mps: has(HAS_VELOCITY).then_some(velocity_enu_mps),
            clock_m: clocks,
        }),
        verdict: Verdict {
            integrity,
            reason,
            hpl,
            vpl,
            hal_m,
            val_m: has(HAS_VAL).then_some(val_m),
            excluded,
            statistic: has(HAS_STATISTIC).then_some(statistic),
            threshold: has(HAS_THRESHOLD).then_some(threshold),
        },
        used,
        n_observed,
        unused,
        flags,
        residual_rms_m: has(HAS_RESIDUALS).then_some(residual_rms_m),
        sigma_enu_m: has(HAS_SIGMA).then_some(sigma_enu_m),
        suspect,
        navigation: has(HAS_NAVIGATION).then_some(navigation),
        inertial,
    })
}

fn coded<T>(code: u8, from: impl Fn(u8) -> Option<T>) -> Result<T, ReportError> {
    from(code).ok_or(ReportError::UnknownCode { code })
}

fn three(reader: &mut Reader<'_>) -> Result<[f64; 3], ReadError> {
    Ok([reader.f64()?, reader.f64()?, reader.f64()?])
}

fn navigation(reader: &mut Reader<'_>) -> Result<Navigation, ReadError> {
    Ok(Navigation {
        v_e_mps: three(reader)?,
        q_e_b: [reader.f64()?, reader.f64()?, reader.f64()?, reader.f64()?],
        roll_pitch_heading_deg: three(reader)?,
        clock: [reader.f64()?, reader.f64()?],
        sigma_position_enu_m: three(reader)?,
        sigma_velocity_enu_mps: three(reader)?,
        sigma_attitude_enu_deg: three(reader)?,
        fault_free_m: [reader.f64()?, reader.f64()?],
        nis: reader.f64()?,
        nis_rows: reader.u8()?,
    })
}

fn suspect(reader: &mut Reader<'_>, is_there: bool) -> Result<Option<Suspect>, ReportError> {
    let (system, prn) = (reader.u8()?, reader.u8()?);
    let [bias_m, sigma_m, p_md] = three(reader)?;
    if !is_there {
        return Ok(None);
    }
    let satellite = System::from_index(usize::from(system))
        .and_then(|system| Satellite::new(system, prn))
        .ok_or(ReportError::UnknownCode { code: prn })?;
    Ok(Some(Suspect {
        satellite,
        bias_m,
        sigma_m,
        p_md,
    }))
}

fn set(reader: &mut Reader<'_>) -> Result<SatelliteSet, ReadError> {
    Ok(SatelliteSet::from_masks([
        reader.u64()?,
        reader.u64()?,
        reader.u64()?,
    ]))
}

fn level(reader: &mut Reader<'_>) -> Result<ProtectionLevel, ReportError> {
    let code = reader.u8()?;
    let bound_m = reader.f64()?;
    if code == 0 {
        return Ok(ProtectionLevel::Bound(bound_m));
    }
    coded(code, |code| NoBound::from_u8(code.wrapping_sub(1))).map(ProtectionLevel::Unavailable)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::native::Frame;

    fn report() -> EpochReport {
        let mut used = SatelliteSet::EMPTY;
        used.insert(Satellite::new(System::Bds, 60).unwrap());
        used.insert(Satellite::new(System::Gps, 1).unwrap());
        let mut excluded = SatelliteSet::EMPTY;
        excluded.insert(Satellite::new(System::Galileo, 36).unwrap());
        EpochReport {
            time: GpsTime::from_week_tow_s(2420, 274_200),
            since_first_ns: -1,
            mode: Mode::Snapshot,
            fix: Some(Fix {
                r_e_m: [1.0, -2.0, 3.0],
                lat_deg: 4.0,
                lon_deg: -5.0,
                h_m: 6.0,
                velocity_enu_mps: Some([7.0, 8.0, 9.0]),
                clock_m: [Some(10.0), None, Some(-0.1)],
            }),
            verdict: Verdict {
                integrity: Integrity::Excluded,
                reason: Reason::None,
                hpl: ProtectionLevel::Bound(11.0),
                vpl: ProtectionLevel::Unavailable(NoBound::NotFinite),
                hal_m: 40.0,
                val_m: Some(35.0),
                excluded,
                statistic: Some(12.0),
                threshold: Some(13.0),
            },
            used,
            n_observed: 14,
            unused: [3; SATELLITE_REASONS],
            flags: ReportFlags::from_bits(0b10101),
            residual_rms_m: Some(1.25),
            sigma_enu_m: Some([0.75, 0.5, 2.5]),
            suspect: Some(Suspect {
                satellite: Satellite::new(System::Galileo, 36).unwrap(),
                bias_m: -41.5,
                sigma_m: 3.5,
                p_md: 1e-3,
            }),
            navigation: Some(Navigation {
                v_e_mps: [14.0, -15.0, 16.0],
                q_e_b: [0.5, -0.5, 0.5, -0.5],
                roll_pitch_heading_deg: [17.0, -18.0, 359.0],
                clock: [19.0, -20.0],
                sigma_position_enu_m: [21.0, 22.0, 23.0],
                sigma_velocity_enu_mps: [0.24, 0.25, 0.26],
                sigma_attitude_enu_deg: [0.27, 0.28, 0.29],
                fault_free_m: [30.0, 31.0],
                nis: 0.1 + 0.2,
                nis_rows: 24,
            }),
            inertial: InertialStatus::Running,
        }
    }

    #[test]
    fn a_report_comes_back_from_its_frame_as_it_was() {
        let mut none = report();
        none.fix = None;
        none.navigation = None;
        none.residual_rms_m = None;
        none.sigma_enu_m = None;
        none.suspect = None;
        none.inertial = InertialStatus::ImuSilent;
        none.verdict = Verdict::unavailable(Reason::TooFewSatellites, 556.0, None);
        for report in [report(), none] {
            let mut bytes = [0; REPORT_FRAME_LENGTH];
            assert_eq!(encode(&report, &mut bytes), Ok(REPORT_FRAME_LENGTH));
            let (frame, _) = Frame::parse(&bytes).unwrap();
            assert_eq!(decode(frame.payload()), Ok(report));
            for length in 0..PAYLOAD_LENGTH {
                assert!(decode(&frame.payload()[..length]).is_err());
            }
        }
    }

    #[test]
    fn a_report_with_a_number_for_no_state_is_refused() {
        let mut bytes = [0; REPORT_FRAME_LENGTH];
        encode(&report(), &mut bytes).unwrap();
        let (frame, _) = Frame::parse(&bytes).unwrap();
        let mut payload = [0; PAYLOAD_LENGTH];
        payload.copy_from_slice(frame.payload());
        let inertial = PAYLOAD_LENGTH - NAVIGATION_LENGTH - SUSPECT_LENGTH - 1;
        let suspect = PAYLOAD_LENGTH - 3 * 8 - 1;
        for place in [3, 4, 5, inertial, suspect] {
            let mut wrong = payload;
            wrong[place] = 200;
            assert_eq!(decode(&wrong), Err(ReportError::UnknownCode { code: 200 }));
        }
    }

    #[test]
    fn a_buffer_too_short_for_a_report_is_refused() {
        assert_eq!(
            encode(&report(), &mut [0; REPORT_FRAME_LENGTH - 1]),
            Err(Full)
        );
    }
}
