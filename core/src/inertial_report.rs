//! What is known of the inertial side at an epoch, and its frame on the wire, which goes out after the
//! epoch's report where an inertial unit is configured. What of it touches the verdict stands in the
//! report itself. Layout: docs/native-frame.md.
//!
//! One struct per theme, so that each is filled in one place.

use crate::ins::alignment::{AlignmentMode, Obstacle};
use crate::ins::{AidUse, HorizonState, MAX_UNITS, UnitFault, UnitState, VotingMode};
use crate::report::ReportError;
use crate::time::GpsTime;
use crate::wire::native::{self, Full, Kind, Reader, Writer};

/// How the attitude was found and how well it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlignmentPart {
    /// Where the attitude that the filter started from came from; [`AlignmentMode::None`] before it starts.
    pub mode: AlignmentMode,
    /// One sigma about local north, east, down, as the filter has it, rad; `None` while it does not run.
    pub sigma_ned_rad: Option<[f64; 3]>,
    /// Why there is none, or why the filter that has one is not believed yet.
    pub obstacle: Obstacle,
}

impl AlignmentPart {
    const LENGTH: usize = 1 + 1 + 1 + 3 * 4;

    fn write(&self, writer: &mut Writer<'_>) -> Result<(), Full> {
        writer.put_u8(self.mode as u8)?;
        writer.put_u8(self.obstacle as u8)?;
        writer.put_u8(self.sigma_ned_rad.is_some().into())?;
        for sigma_rad in self.sigma_ned_rad.unwrap_or([0.0; 3]) {
            writer.put_f32(sigma_rad as f32)?;
        }
        Ok(())
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, ReportError> {
        let code = reader.u8()?;
        let mode = AlignmentMode::from_u8(code).ok_or(ReportError::UnknownCode { code })?;
        let code = reader.u8()?;
        let obstacle = Obstacle::from_u8(code).ok_or(ReportError::UnknownCode { code })?;
        let is_there = flag(reader)?;
        let mut sigma_ned_rad = [0.0; 3];
        for sigma_rad in &mut sigma_ned_rad {
            *sigma_rad = reader.f32()?.into();
        }
        Ok(Self {
            mode,
            sigma_ned_rad: is_there.then_some(sigma_ned_rad),
            obstacle,
        })
    }
}

/// One unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnitPart {
    /// What becomes of its samples.
    pub state: UnitState,
    /// Why they are not used.
    pub fault: UnitFault,
}

impl UnitPart {
    /// No unit.
    pub const ABSENT: Self = Self {
        state: UnitState::Absent,
        fault: UnitFault::None,
    };

    const LENGTH: usize = 1 + 1;

    fn write(&self, writer: &mut Writer<'_>) -> Result<(), Full> {
        writer.put_u8(self.state as u8)?;
        writer.put_u8(self.fault as u8)
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, ReportError> {
        let code = reader.u8()?;
        let state = UnitState::from_u8(code).ok_or(ReportError::UnknownCode { code })?;
        let code = reader.u8()?;
        let fault = UnitFault::from_u8(code).ok_or(ReportError::UnknownCode { code })?;
        Ok(Self { state, fault })
    }
}

/// Where the antenna is at the end of the newest sample: the filter's nominal carried over the samples that
/// wait for their epoch. No monitor has tested it, and no level bounds it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NavigationNow {
    /// When.
    pub time: GpsTime,
    /// Position, ECEF, m.
    pub r_e_m: [f64; 3],
    /// Velocity against the Earth, ECEF, m/s.
    pub v_e_mps: [f64; 3],
    /// Rotation from body to ECEF, scalar first and not negative.
    pub q_e_b: [f64; 4],
}

impl NavigationNow {
    const LENGTH: usize = 8 + 10 * 8;

    fn write(&self, writer: &mut Writer<'_>) -> Result<(), Full> {
        writer.put_i64(self.time.ns())?;
        let all = self.r_e_m.iter().chain(&self.v_e_mps).chain(&self.q_e_b);
        for value in all {
            writer.put_f64(*value)?;
        }
        Ok(())
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, ReportError> {
        let mut now = Self {
            time: GpsTime::from_ns(reader.i64()?),
            r_e_m: [0.0; 3],
            v_e_mps: [0.0; 3],
            q_e_b: [0.0; 4],
        };
        let all = now
            .r_e_m
            .iter_mut()
            .chain(&mut now.v_e_mps)
            .chain(&mut now.q_e_b);
        for value in all {
            *value = reader.f64()?;
        }
        Ok(now)
    }
}

/// In the place of a position that is not there.
const NOWHERE: NavigationNow = NavigationNow {
    time: GpsTime::from_ns(0),
    r_e_m: [0.0; 3],
    v_e_mps: [0.0; 3],
    q_e_b: [0.0; 4],
};

/// How late the receiver was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimingPart {
    /// Time of the newest sample minus that of the epoch when it was processed, ns.
    pub lead_of_samples_ns: Option<i64>,
    /// Latency that a missing epoch is waited for, ns: as it was configured, or as late as epochs came.
    pub latency_ns: i64,
    /// What waits for an epoch, and how many epochs came too late.
    pub horizon: HorizonState,
    /// Where the antenna is now; `None` while the filter does not run.
    pub now: Option<NavigationNow>,
}

impl TimingPart {
    const LENGTH: usize = 1 + 8 + 8 + 2 + 4 + 1 + NavigationNow::LENGTH;

    fn write(&self, writer: &mut Writer<'_>) -> Result<(), Full> {
        writer.put_u8(self.lead_of_samples_ns.is_some().into())?;
        writer.put_i64(self.lead_of_samples_ns.unwrap_or(0))?;
        writer.put_i64(self.latency_ns)?;
        writer.put_u16(self.horizon.held)?;
        writer.put_u32(self.horizon.too_late)?;
        writer.put_u8(self.now.is_some().into())?;
        self.now.unwrap_or(NOWHERE).write(writer)
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, ReportError> {
        let is_there = flag(reader)?;
        let lead_ns = reader.i64()?;
        let latency_ns = reader.i64()?;
        let horizon = HorizonState {
            held: reader.u16()?,
            too_late: reader.u32()?,
        };
        let is_running = flag(reader)?;
        let now = NavigationNow::read(reader)?;
        Ok(Self {
            lead_of_samples_ns: is_there.then_some(lead_ns),
            latency_ns,
            horizon,
            now: is_running.then_some(now),
        })
    }
}

/// The aids.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AidsPart {
    /// That the vehicle stands, in the filters.
    pub standstill: AidUse,
    /// The barometer's climb, in the filters.
    pub climb: AidUse,
    /// The barometer's height, in the snapshot solution.
    pub height: AidUse,
    /// Height of the antenna above the ellipsoid minus pressure altitude, m, once it is known.
    pub height_bias_m: Option<f64>,
}

impl AidsPart {
    const LENGTH: usize = 3 + 1 + 4;

    fn write(&self, writer: &mut Writer<'_>) -> Result<(), Full> {
        for aid in [self.standstill, self.climb, self.height] {
            writer.put_u8(aid as u8)?;
        }
        writer.put_u8(self.height_bias_m.is_some().into())?;
        writer.put_f32(self.height_bias_m.unwrap_or(0.0) as f32)
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, ReportError> {
        let mut aid = || {
            let code = reader.u8()?;
            AidUse::from_u8(code).ok_or(ReportError::UnknownCode { code })
        };
        let (standstill, climb, height) = (aid()?, aid()?, aid()?);
        let is_there = flag(reader)?;
        let bias_m = f64::from(reader.f32()?);
        Ok(Self {
            standstill,
            climb,
            height,
            height_bias_m: is_there.then_some(bias_m),
        })
    }
}

/// The inertial side at an epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InertialReport {
    /// Time of the epoch.
    pub time: GpsTime,
    /// The attitude.
    pub alignment: AlignmentPart,
    /// How many units the samples rest on.
    pub voting: VotingMode,
    /// The units, in the order of their numbers.
    pub units: [UnitPart; MAX_UNITS],
    /// How late the receiver was.
    pub timing: TimingPart,
    /// The aids.
    pub aids: AidsPart,
}

/// Length of its frame, bytes.
pub const INERTIAL_REPORT_FRAME_LENGTH: usize = native::HEADER_LEN
    + 8
    + AlignmentPart::LENGTH
    + 1
    + MAX_UNITS * UnitPart::LENGTH
    + TimingPart::LENGTH
    + AidsPart::LENGTH
    + native::TRAILER_LEN;

impl InertialReport {
    /// Writes it as one frame of [`Kind::InertialReport`]; returns its length.
    ///
    /// # Errors
    /// [`Full`] when `out` is shorter than [`INERTIAL_REPORT_FRAME_LENGTH`].
    #[inline(never)]
    pub fn encode(&self, out: &mut [u8]) -> Result<usize, Full> {
        native::encode(Kind::InertialReport, out, |writer| {
            writer.put_i64(self.time.ns())?;
            self.alignment.write(writer)?;
            writer.put_u8(self.voting as u8)?;
            for unit in &self.units {
                unit.write(writer)?;
            }
            self.timing.write(writer)?;
            self.aids.write(writer)
        })
    }

    /// Reads the payload of a [`Kind::InertialReport`] frame.
    ///
    /// # Errors
    /// [`ReportError`] when it is too short or too long, or a code in it is none.
    pub fn decode(payload: &[u8]) -> Result<Self, ReportError> {
        let mut reader = Reader::new(payload);
        let time = GpsTime::from_ns(reader.i64()?);
        let alignment = AlignmentPart::read(&mut reader)?;
        let code = reader.u8()?;
        let voting = VotingMode::from_u8(code).ok_or(ReportError::UnknownCode { code })?;
        let mut units = [UnitPart::ABSENT; MAX_UNITS];
        for unit in &mut units {
            *unit = UnitPart::read(&mut reader)?;
        }
        let timing = TimingPart::read(&mut reader)?;
        let aids = AidsPart::read(&mut reader)?;
        if reader.left() > 0 {
            return Err(ReportError::UnknownCode { code: 0 });
        }
        Ok(Self {
            time,
            alignment,
            voting,
            units,
            timing,
            aids,
        })
    }
}

fn flag(reader: &mut Reader<'_>) -> Result<bool, ReportError> {
    match reader.u8()? {
        0 => Ok(false),
        1 => Ok(true),
        code => Err(ReportError::UnknownCode { code }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::native::Frame;

    fn report() -> InertialReport {
        InertialReport {
            time: GpsTime::from_week_tow_s(2400, 17),
            alignment: AlignmentPart {
                mode: AlignmentMode::Course,
                sigma_ned_rad: Some([0.25, 0.5, 1.0]),
                obstacle: Obstacle::NotEarned,
            },
            voting: VotingMode::One,
            units: [
                UnitPart {
                    state: UnitState::Used,
                    fault: UnitFault::None,
                },
                UnitPart {
                    state: UnitState::Isolated,
                    fault: UnitFault::Drift,
                },
                UnitPart::ABSENT,
            ],
            timing: TimingPart {
                lead_of_samples_ns: Some(-3_000_000),
                latency_ns: 120_000_000,
                horizon: HorizonState {
                    held: 12,
                    too_late: 70_000,
                },
                now: Some(NavigationNow {
                    time: GpsTime::from_week_tow_s(2400, 18),
                    r_e_m: [6.4e6, -1.0, 2.5],
                    v_e_mps: [16.0, 0.1, -3.0],
                    q_e_b: [0.5, -0.5, 0.5, -0.5],
                }),
            },
            aids: AidsPart {
                standstill: AidUse::Used,
                climb: AidUse::Refused,
                height: AidUse::Ready,
                height_bias_m: Some(-17.5),
            },
        }
    }

    #[test]
    fn what_is_written_reads_back() {
        let mut out = [0; INERTIAL_REPORT_FRAME_LENGTH];
        let length = report().encode(&mut out).unwrap();
        assert_eq!(length, INERTIAL_REPORT_FRAME_LENGTH);
        let (frame, _) = Frame::parse(&out).unwrap();
        assert_eq!(InertialReport::decode(frame.payload()), Ok(report()));
        let short = report().encode(&mut [0; INERTIAL_REPORT_FRAME_LENGTH - 1]);
        assert_eq!(short, Err(Full));
    }

    #[test]
    fn codes_that_are_none_and_other_lengths_are_refused() {
        let mut out = [0; INERTIAL_REPORT_FRAME_LENGTH];
        report().encode(&mut out).unwrap();
        let (frame, _) = Frame::parse(&out).unwrap();
        let payload = frame.payload();
        for cut in 0..payload.len() {
            assert!(InertialReport::decode(&payload[..cut]).is_err());
        }
        for place in [8, 9, 10, 23, 24, 25] {
            let mut wrong = payload.to_vec();
            wrong[place] = 200;
            let unknown = ReportError::UnknownCode { code: 200 };
            assert_eq!(InertialReport::decode(&wrong), Err(unknown));
        }
        let mut long = payload.to_vec();
        long.push(0);
        assert!(InertialReport::decode(&long).is_err());
    }
}
