//! What is known of every satellite of an epoch, and its frame on the wire, which goes out after the
//! epoch's report. For pictures and for whoever looks for a cause: no verdict depends on it.
//!
//! Numbers are scaled integers, as fine as a picture needs. Layout: docs/native-frame.md.

use heapless::Vec;

use crate::consts::{MAX_CLOCKS, MAX_SATELLITES};
use crate::gnss::solution::{SATELLITE_REASONS, SatelliteReason, SnapshotWorkspace};
use crate::gnss::{ObservationEpoch, Satellite, SatelliteObservation, System};
use crate::report::{EpochReport, ReportError};
use crate::time::GpsTime;
use crate::wire::native::{self, Full, Kind, Reader, Writer};

/// What became of a satellite that was observed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SatelliteUse {
    /// It is in the position.
    Used,
    /// It could be used and is not in the position: there is none, or the filter had no room for it.
    NotInPosition,
    /// It is left out.
    LeftOut(SatelliteReason),
}

impl SatelliteUse {
    /// Name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Used => "used",
            Self::NotInPosition => "not_in_position",
            Self::LeftOut(reason) => reason.name(),
        }
    }

    const fn code(self) -> u8 {
        match self {
            Self::Used => 0,
            Self::NotInPosition => 1,
            Self::LeftOut(reason) => 2 + reason as u8,
        }
    }

    fn from_code(code: u8) -> Option<Self> {
        match code.checked_sub(2) {
            None if code == 0 => Some(Self::Used),
            None => Some(Self::NotInPosition),
            Some(reason) => SatelliteReason::ALL
                .get(usize::from(reason))
                .map(|reason| Self::LeftOut(*reason)),
        }
    }
}

/// One satellite of an epoch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SatelliteRow {
    /// Which satellite.
    pub satellite: Satellite,
    /// What became of it.
    pub fate: SatelliteUse,
    /// Azimuth from north to east, 0 to 35999, and elevation, 0.01°; `None` where its place is not known.
    pub direction_cdeg: Option<(u16, i16)>,
    /// Measured minus predicted pseudorange at the epoch's position, of satellites in it and of those
    /// excluded from it, mm; beyond 2 147 km it stays there.
    pub residual_mm: Option<i32>,
    /// C/N0 of the signal measured, else of the first that has one, 0.25 dB-Hz.
    pub cn0_quarter_dbhz: Option<u8>,
}

/// The satellites of an epoch, in the order of their observations.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SatelliteReport {
    /// Time of the epoch.
    pub time: GpsTime,
    /// The satellites observed.
    pub rows: Vec<SatelliteRow, MAX_SATELLITES>,
}

/// Longest frame, bytes.
pub const SATELLITE_FRAME_LENGTH: usize =
    native::HEADER_LEN + HEAD_LENGTH + MAX_SATELLITES * ROW_LENGTH + native::TRAILER_LEN;
const HEAD_LENGTH: usize = 8 + 1;
const ROW_LENGTH: usize = 2 + 1 + 2 + 2 + 4 + 1;
const _: () = assert!(SATELLITE_FRAME_LENGTH <= native::MAX_FRAME);

const HAS_DIRECTION: u8 = 1 << 5;
const HAS_RESIDUAL: u8 = 1 << 6;
const HAS_CN0: u8 = 1 << 7;
/// What is left of the byte for [`SatelliteUse`].
const FATE: u8 = HAS_DIRECTION - 1;
const _: () = assert!(2 + SATELLITE_REASONS <= FATE as usize + 1);

impl SatelliteReport {
    /// No satellite.
    pub const EMPTY: Self = Self {
        time: GpsTime::from_ns(0),
        rows: Vec::new(),
    };

    /// Takes the satellites of an epoch that `workspace` has prepared and `report` tells of.
    #[inline(never)]
    pub fn fill(
        &mut self,
        epoch: &ObservationEpoch,
        workspace: &SnapshotWorkspace,
        report: &EpochReport,
    ) {
        self.time = report.time;
        self.rows.clear();
        for observation in &epoch.satellites {
            let satellite = observation.satellite;
            let excluded = report.verdict.excluded.contains(satellite);
            let fate = if report.used.contains(satellite) {
                SatelliteUse::Used
            } else if excluded {
                SatelliteUse::LeftOut(SatelliteReason::FaultExcluded)
            } else {
                workspace
                    .reason_left_out(satellite)
                    .map_or(SatelliteUse::NotInPosition, SatelliteUse::LeftOut)
            };
            let is_compared = excluded || fate == SatelliteUse::Used;
            let residual_mm = report
                .fix
                .as_ref()
                .filter(|_| is_compared)
                .and_then(|fix| residual_m(workspace, satellite, fix.r_e_m, &fix.clock_m))
                .map(|residual_m| libm::rint(residual_m * 1e3) as i32);
            // As many as an epoch has room for.
            let _ = self.rows.push(SatelliteRow {
                satellite,
                fate,
                direction_cdeg: workspace.direction_rad(satellite).and_then(direction_cdeg),
                residual_mm,
                cn0_quarter_dbhz: cn0_dbhz(workspace, observation)
                    .map(|cn0_dbhz| libm::rint(f64::from(cn0_dbhz) * 4.0) as u8),
            });
        }
    }

    /// Writes the report as one frame of [`Kind::Satellites`]; returns its length.
    ///
    /// # Errors
    /// [`Full`] when `out` is shorter than [`SATELLITE_FRAME_LENGTH`] and the frame does not fit.
    #[inline(never)]
    pub fn encode(&self, out: &mut [u8]) -> Result<usize, Full> {
        native::encode(Kind::Satellites, out, |writer| self.write(writer))
    }

    fn write(&self, writer: &mut Writer<'_>) -> Result<(), Full> {
        writer.put_i64(self.time.ns())?;
        writer.put_u8(u8::try_from(self.rows.len()).map_err(|_| Full)?)?;
        for row in &self.rows {
            let mut present = row.fate.code();
            for (bit, is_there) in [
                (HAS_DIRECTION, row.direction_cdeg.is_some()),
                (HAS_RESIDUAL, row.residual_mm.is_some()),
                (HAS_CN0, row.cn0_quarter_dbhz.is_some()),
            ] {
                if is_there {
                    present |= bit;
                }
            }
            let (azimuth, elevation) = row.direction_cdeg.unwrap_or((0, 0));
            writer.put_u8(row.satellite.system() as u8)?;
            writer.put_u8(row.satellite.prn())?;
            writer.put_u8(present)?;
            writer.put_u16(azimuth)?;
            writer.put_bytes(&elevation.to_le_bytes())?;
            writer.put_bytes(&row.residual_mm.unwrap_or(0).to_le_bytes())?;
            writer.put_u8(row.cn0_quarter_dbhz.unwrap_or(0))?;
        }
        Ok(())
    }

    /// Reads the payload of a [`Kind::Satellites`] frame.
    ///
    /// # Errors
    /// [`ReportError`] when it is too short, names more satellites than an epoch has, one that does not
    /// exist, a fate that is none, or a direction that is none.
    pub fn decode(payload: &[u8]) -> Result<Self, ReportError> {
        let mut reader = Reader::new(payload);
        let mut report = Self::EMPTY;
        report.time = GpsTime::from_ns(reader.i64()?);
        let count = reader.u8()?;
        for _ in 0..count {
            let (system, prn, present) = (reader.u8()?, reader.u8()?, reader.u8()?);
            let unknown = |code| ReportError::UnknownCode { code };
            let satellite = System::from_index(usize::from(system))
                .and_then(|system| Satellite::new(system, prn))
                .ok_or(unknown(prn))?;
            let fate = SatelliteUse::from_code(present & FATE).ok_or(unknown(present))?;
            let azimuth = reader.u16()?;
            let elevation = i16::from_le_bytes(reader.bytes()?);
            let residual_mm = i32::from_le_bytes(reader.bytes()?);
            let cn0 = reader.u8()?;
            let has = |bit: u8| present & bit != 0;
            if has(HAS_DIRECTION)
                && (azimuth >= FULL_TURN || elevation.unsigned_abs() > RIGHT_ANGLE)
            {
                return Err(unknown(present));
            }
            let row = SatelliteRow {
                satellite,
                fate,
                direction_cdeg: has(HAS_DIRECTION).then_some((azimuth, elevation)),
                residual_mm: has(HAS_RESIDUAL).then_some(residual_mm),
                cn0_quarter_dbhz: has(HAS_CN0).then_some(cn0),
            };
            report.rows.push(row).map_err(|_| unknown(count))?;
        }
        Ok(report)
    }
}

/// In hundredths of a degree.
const FULL_TURN: u16 = 36_000;
const RIGHT_ANGLE: u16 = 9_000;

/// Azimuth and elevation in hundredths of a degree; `None` where one is no number.
fn direction_cdeg([azimuth_rad, elevation_rad]: [f64; 2]) -> Option<(u16, i16)> {
    if !azimuth_rad.is_finite() || !elevation_rad.is_finite() {
        return None;
    }
    let turn = f64::from(FULL_TURN);
    let azimuth = libm::rint(azimuth_rad.to_degrees() * 100.0);
    let wrapped = azimuth - turn * libm::floor(azimuth / turn);
    let elevation = libm::rint(elevation_rad.to_degrees() * 100.0);
    Some((wrapped as u16, elevation as i16))
}

/// Measured minus predicted pseudorange at a position with its clocks, m, if it is a number.
fn residual_m(
    workspace: &SnapshotWorkspace,
    satellite: Satellite,
    r_e_m: [f64; 3],
    clock_m: &[Option<f64>; MAX_CLOCKS],
) -> Option<f64> {
    let clock_m = clock_m.get(satellite.system().index()).copied().flatten()?;
    let residual_m = workspace.range_residual_m(satellite, r_e_m)? - clock_m;
    residual_m.is_finite().then_some(residual_m)
}

fn cn0_dbhz(workspace: &SnapshotWorkspace, observation: &SatelliteObservation) -> Option<f32> {
    let measured = workspace.cn0_dbhz(observation.satellite);
    let mut signals = observation.signals.iter();
    measured.or_else(|| signals.find_map(|signal| signal.cn0_dbhz))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::native::Frame;

    fn report() -> SatelliteReport {
        let mut report = SatelliteReport {
            time: GpsTime::from_week_tow_s(2400, 17),
            ..SatelliteReport::EMPTY
        };
        let fates = [SatelliteUse::Used, SatelliteUse::NotInPosition]
            .into_iter()
            .chain(SatelliteReason::ALL.map(SatelliteUse::LeftOut));
        for (fate, prn) in fates.cycle().zip(1..=MAX_SATELLITES as u8) {
            let row = SatelliteRow {
                satellite: Satellite::new(System::Bds, prn).unwrap(),
                fate,
                direction_cdeg: (prn % 2 == 0).then_some((35_999, -9_000 + i16::from(prn))),
                residual_mm: (prn % 3 == 0).then_some(i32::MIN + i32::from(prn)),
                cn0_quarter_dbhz: (prn % 5 == 0).then_some(prn),
            };
            report.rows.push(row).unwrap();
        }
        report
    }

    #[test]
    fn satellites_come_back_as_they_were() {
        let report = report();
        let mut bytes = [0; SATELLITE_FRAME_LENGTH];
        assert_eq!(report.encode(&mut bytes), Ok(SATELLITE_FRAME_LENGTH));
        let (frame, _) = Frame::parse(&bytes).unwrap();
        assert_eq!(frame.kind(), Some(Kind::Satellites));
        assert_eq!(SatelliteReport::decode(frame.payload()), Ok(report.clone()));
        for length in 0..frame.payload().len() {
            assert!(SatelliteReport::decode(&frame.payload()[..length]).is_err());
        }
        assert_eq!(
            report.encode(&mut bytes[..SATELLITE_FRAME_LENGTH - 1]),
            Err(Full)
        );
    }

    #[test]
    fn what_stands_for_nothing_is_refused() {
        let mut bytes = [0; SATELLITE_FRAME_LENGTH];
        report().encode(&mut bytes).unwrap();
        let (frame, _) = Frame::parse(&bytes).unwrap();
        // System, number, fate, azimuth and elevation of the second satellite, which has a direction; then the count.
        let second = HEAD_LENGTH + ROW_LENGTH;
        for (place, wrong) in [
            (second, 3),
            (second + 1, 64),
            (second + 2, FATE),
            (second + 4, 0x8D),
            (second + 6, 0x80),
            (8, MAX_SATELLITES as u8 + 1),
        ] {
            let mut payload = frame.payload().to_vec();
            payload[place] = wrong;
            assert!(SatelliteReport::decode(&payload).is_err(), "byte {place}");
        }
    }

    #[test]
    fn a_direction_is_within_a_turn() {
        let quarter = core::f64::consts::FRAC_PI_2;
        assert_eq!(direction_cdeg([-quarter, quarter]), Some((27_000, 9_000)));
        assert_eq!(direction_cdeg([4.0 * quarter, 0.0]), Some((0, 0)));
        assert_eq!(direction_cdeg([-1e-9, -1e-9]), Some((0, 0)));
        assert_eq!(direction_cdeg([f64::NAN, 0.0]), None);
    }
}
