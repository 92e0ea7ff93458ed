//! What the bank of filters says of an epoch, and its frame on the wire, which goes out before the
//! epoch's report. Layout: docs/native-frame.md.

use heapless::Vec;

use crate::consts::MAX_CLOCKS;
use crate::gnss::{Satellite, SatelliteSet, System};
use crate::integrity::Opinions;
use crate::mhss::{Bank, BankVerdict, MAX_BANK};
use crate::report::ReportError;
use crate::time::GpsTime;
use crate::wire::native::{self, Full, Kind, ReadError, Reader, Writer};

/// The test of one sub-filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BankTest {
    /// The satellite that the sub-filter leaves out.
    pub satellite: Satellite,
    /// Statistic, horizontal and vertical, m; `None` where it is not finite, which fails the test.
    pub statistic_m: [Option<f64>; 2],
    /// Threshold, horizontal and vertical, m; 0 where there is nothing to test, `None` where it is not
    /// finite.
    pub threshold_m: [Option<f64>; 2],
}

/// The test of the filter without a constellation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstellationTest {
    /// The constellation that is left out.
    pub system: System,
    /// As of [`BankTest`].
    pub statistic_m: [Option<f64>; 2],
    /// As of [`BankTest`].
    pub threshold_m: [Option<f64>; 2],
}

/// The tests of an epoch. Of a satellite that is excluded at it the test that failed; the others, in a scenario
/// folder, as they were before the exclusion, in a recording as they are after it.
#[derive(Clone, Debug, PartialEq)]
pub struct BankReport {
    /// Time of the epoch.
    pub time: GpsTime,
    /// At least one test failed.
    pub detected: bool,
    /// Protection level of the bank, horizontal and vertical, m; `None` where it is not finite.
    pub level_m: [Option<f64>; 2],
    /// Level while a fault is present, m.
    pub alerted_level_m: [Option<f64>; 2],
    /// Satellites excluded so far, this epoch's included.
    pub excluded: SatelliteSet,
    /// Satellites observed that are in no filter for want of room.
    pub n_unmonitored: u8,
    /// The sub-filters.
    pub tests: Vec<BankTest, MAX_BANK>,
    /// The filters without a constellation.
    pub constellations: Vec<ConstellationTest, MAX_CLOCKS>,
    /// How this opinion and the snapshot's stand to each other, where there are two.
    pub opinions: Option<Opinions>,
    /// There was no time for the filters of the pairs: nothing can be isolated.
    pub pairs_dropped: bool,
    /// Probability of the faults that no filter stands for, charged to the integrity risk, 1.
    pub p_unmonitored: f64,
}

/// Longest frame, bytes.
pub const BANK_FRAME_LENGTH: usize = native::HEADER_LEN + MAX_PAYLOAD_LENGTH + native::TRAILER_LEN;
const MAX_PAYLOAD_LENGTH: usize =
    HEAD_LENGTH + MAX_BANK * TEST_LENGTH + TAIL_LENGTH + MAX_CLOCKS * (TEST_LENGTH - 1);
const TAIL_LENGTH: usize = 1 + 1 + 8 + 1;
/// Number that stands for no opinions.
const NO_OPINIONS: u8 = 255;
const HEAD_LENGTH: usize = 8 + 1 + 1 + 4 * 8 + 3 * 8 + 1 + 1;
const TEST_LENGTH: usize = 2 + 1 + 4 * 8;

const _: () = assert!(MAX_PAYLOAD_LENGTH <= native::MAX_PAYLOAD);

impl BankReport {
    /// No test.
    pub const EMPTY: Self = Self {
        time: GpsTime::from_ns(0),
        detected: false,
        level_m: [None; 2],
        alerted_level_m: [None; 2],
        excluded: SatelliteSet::EMPTY,
        n_unmonitored: 0,
        tests: Vec::new(),
        constellations: Vec::new(),
        opinions: None,
        pairs_dropped: false,
        p_unmonitored: 0.0,
    };

    /// Takes what a bank found.
    pub fn fill<const K: usize, const M: usize>(
        &mut self,
        time: GpsTime,
        verdict: &BankVerdict,
        bank: &Bank<K, M>,
        p_unmonitored: f64,
        opinions: Option<Opinions>,
    ) {
        let finite = |level: f64| level.is_finite().then_some(level);
        self.time = time;
        self.detected = verdict.detected;
        self.level_m = verdict.level_m.map(finite);
        self.alerted_level_m = verdict.alerted_level_m.map(finite);
        self.excluded = bank.excluded();
        self.n_unmonitored = bank.n_unmonitored();
        self.tests.clear();
        for (satellite, separation) in bank.separations() {
            // As many as the bank has places.
            let _ = self.tests.push(BankTest {
                satellite,
                statistic_m: separation.statistic_m.map(finite),
                threshold_m: separation.threshold_m.map(finite),
            });
        }
        self.constellations.clear();
        for (system, separation) in bank.constellation_separations() {
            // As many as there are constellations.
            let _ = self.constellations.push(ConstellationTest {
                system,
                statistic_m: separation.statistic_m.map(finite),
                threshold_m: separation.threshold_m.map(finite),
            });
        }
        self.opinions = opinions;
        self.pairs_dropped = bank.pairs_are_dropped();
        self.p_unmonitored = p_unmonitored;
    }

    /// Writes the report as one frame of [`Kind::Bank`]; returns its length.
    ///
    /// # Errors
    /// [`Full`] when `out` is shorter than [`BANK_FRAME_LENGTH`] and the frame does not fit.
    #[inline(never)]
    pub fn encode(&self, out: &mut [u8]) -> Result<usize, Full> {
        native::encode(Kind::Bank, out, |writer| self.write(writer))
    }

    fn write(&self, writer: &mut Writer<'_>) -> Result<(), Full> {
        let levels = self.level_m.iter().chain(&self.alerted_level_m);
        let present = levels.clone().zip(0..).fold(0_u8, |bits, (level, bit)| {
            bits | (level.is_some() as u8) << bit
        });
        writer.put_i64(self.time.ns())?;
        writer.put_u8(self.detected as u8)?;
        writer.put_u8(present)?;
        for level in levels {
            writer.put_f64(level.unwrap_or(0.0))?;
        }
        for mask in self.excluded.masks() {
            writer.put_u64(mask)?;
        }
        writer.put_u8(self.n_unmonitored)?;
        writer.put_u8(u8::try_from(self.tests.len()).map_err(|_| Full)?)?;
        for test in &self.tests {
            writer.put_u8(test.satellite.system() as u8)?;
            writer.put_u8(test.satellite.prn())?;
            put_four(writer, test.statistic_m, test.threshold_m)?;
        }
        writer.put_u8(self.opinions.map_or(NO_OPINIONS, |opinions| opinions as u8))?;
        writer.put_u8(self.pairs_dropped as u8)?;
        writer.put_f64(self.p_unmonitored)?;
        writer.put_u8(u8::try_from(self.constellations.len()).map_err(|_| Full)?)?;
        for test in &self.constellations {
            writer.put_u8(test.system as u8)?;
            put_four(writer, test.statistic_m, test.threshold_m)?;
        }
        Ok(())
    }

    /// Reads the payload of a [`Kind::Bank`] frame.
    ///
    /// # Errors
    /// [`ReportError`] when it is too short, names more tests than a bank has, a satellite that does not
    /// exist, or holds a number that is not finite.
    pub fn decode(payload: &[u8]) -> Result<Self, ReportError> {
        let mut reader = Reader::new(payload);
        let mut report = Self::EMPTY;
        report.time = GpsTime::from_ns(reader.i64()?);
        report.detected = reader.u8()? != 0;
        (report.level_m, report.alerted_level_m) = four(&mut reader)?;
        report.excluded = SatelliteSet::from_masks([reader.u64()?, reader.u64()?, reader.u64()?]);
        report.n_unmonitored = reader.u8()?;
        let tests = reader.u8()?;
        for _ in 0..tests {
            let (system, prn) = (reader.u8()?, reader.u8()?);
            let satellite = System::from_index(usize::from(system))
                .and_then(|system| Satellite::new(system, prn))
                .ok_or(ReportError::UnknownCode { code: prn })?;
            let (statistic_m, threshold_m) = four(&mut reader)?;
            let test = BankTest {
                satellite,
                statistic_m,
                threshold_m,
            };
            if report.tests.push(test).is_err() {
                return Err(ReportError::UnknownCode { code: tests });
            }
        }
        let opinions = reader.u8()?;
        report.opinions = match opinions {
            NO_OPINIONS => None,
            code => Some(Opinions::from_u8(code).ok_or(ReportError::UnknownCode { code })?),
        };
        report.pairs_dropped = reader.u8()? != 0;
        report.p_unmonitored = reader.f64()?;
        let constellations = reader.u8()?;
        for _ in 0..constellations {
            let code = reader.u8()?;
            let system =
                System::from_index(usize::from(code)).ok_or(ReportError::UnknownCode { code })?;
            let (statistic_m, threshold_m) = four(&mut reader)?;
            let test = ConstellationTest {
                system,
                statistic_m,
                threshold_m,
            };
            if report.constellations.push(test).is_err() {
                return Err(ReportError::UnknownCode {
                    code: constellations,
                });
            }
        }
        Ok(report)
    }
}

/// Two pairs of numbers, horizontal and vertical.
type Four = ([Option<f64>; 2], [Option<f64>; 2]);

/// A byte that tells which are there, then all four.
fn put_four(
    writer: &mut Writer<'_>,
    first: [Option<f64>; 2],
    second: [Option<f64>; 2],
) -> Result<(), Full> {
    let values = first.iter().chain(&second);
    let present = values.clone().zip(0..).fold(0_u8, |bits, (value, bit)| {
        bits | (value.is_some() as u8) << bit
    });
    writer.put_u8(present)?;
    for value in values {
        writer.put_f64(value.unwrap_or(0.0))?;
    }
    Ok(())
}

fn four(reader: &mut Reader<'_>) -> Result<Four, ReadError> {
    let present = reader.u8()?;
    let mut bit = 1;
    let mut next = || -> Result<Option<f64>, ReadError> {
        let value = reader.f64()?;
        let is_there = present & bit != 0;
        bit <<= 1;
        Ok(is_there.then_some(value))
    };
    Ok(([next()?, next()?], [next()?, next()?]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::native::Frame;

    #[test]
    fn a_report_of_the_bank_comes_back_as_it_was() {
        let mut report = BankReport {
            time: GpsTime::from_week_tow_s(2400, 17),
            detected: true,
            level_m: [Some(3.5), None],
            alerted_level_m: [None, Some(7.25)],
            n_unmonitored: 3,
            opinions: Some(Opinions::BankOnly),
            pairs_dropped: true,
            p_unmonitored: 2.5e-8,
            ..BankReport::EMPTY
        };
        for system in System::ALL {
            report
                .constellations
                .push(ConstellationTest {
                    system,
                    statistic_m: [Some(1.5), None],
                    threshold_m: [None, Some(2.5)],
                })
                .unwrap();
        }
        report
            .excluded
            .insert(Satellite::new(System::Galileo, 30).unwrap());
        for prn in 1..=MAX_BANK as u8 {
            let test = BankTest {
                satellite: Satellite::new(System::Bds, prn).unwrap(),
                statistic_m: [Some(f64::from(prn)), None],
                threshold_m: [Some(0.0), Some(-0.5)],
            };
            report.tests.push(test).unwrap();
            let mut bytes = [0; BANK_FRAME_LENGTH];
            let length = report.encode(&mut bytes).unwrap();
            let (frame, used) = Frame::parse(&bytes).unwrap();
            assert_eq!((used, frame.kind()), (length, Some(Kind::Bank)));
            assert_eq!(BankReport::decode(frame.payload()), Ok(report.clone()));
            assert!(BankReport::decode(&frame.payload()[..frame.payload().len() - 1]).is_err());
        }
    }
}
