//! Inertial samples between a receiver's bytes, in the order of their times.
//!
//! A sample up to the time at which an epoch arrives goes before the frame that completes the epoch, a later
//! one after it: what a board sees. An epoch arrives at its own time, from a receiver that answers at
//! once, or by its latency later. Which frame completes an epoch, and of what time, core's own decoder
//! says.

use std::ops::Range;

use anyhow::{Result, bail};
use surefix_core::config::Config;
use surefix_core::ingest::{Event, Ingest, encode_imu, encode_unit_sample};
use surefix_core::ins::{ImuSample, UnitSample};
use surefix_core::time::{GpsTime, NS_PER_WEEK};
use surefix_core::wire::crc::crc24q;
use surefix_core::wire::native::{self, Frame};
use surefix_core::wire::ubx;

/// A sample with a time and a frame.
pub trait Timed {
    /// End of its interval.
    fn time(&self) -> GpsTime;

    /// Writes its frame; tells its length.
    ///
    /// # Errors
    /// When it does not fit.
    fn encode(&self, out: &mut [u8]) -> Result<usize, native::Full>;
}

/// A sample of the only unit, or of one of those that vote.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Measured {
    /// Of the only one.
    Alone(ImuSample),
    /// Of the unit of a number.
    OfUnit(u8, UnitSample),
}

impl Timed for ImuSample {
    fn time(&self) -> GpsTime {
        self.time
    }

    fn encode(&self, out: &mut [u8]) -> Result<usize, native::Full> {
        encode_imu(self, out)
    }
}

impl Timed for Measured {
    fn time(&self) -> GpsTime {
        match self {
            Self::Alone(sample) => sample.time,
            Self::OfUnit(_, sample) => sample.sample.time,
        }
    }

    fn encode(&self, out: &mut [u8]) -> Result<usize, native::Full> {
        match self {
            Self::Alone(sample) => encode_imu(sample, out),
            Self::OfUnit(unit, sample) => encode_unit_sample(*unit, sample, out),
        }
    }
}

/// Samples that wait for their place, with the times at which they arrive.
///
/// They keep their order. One whose time runs backwards arrives where it stands, and so do those after
/// one whose time is ahead by itself: a wrong time shall not hold up the samples behind it.
#[derive(Clone, Debug)]
pub struct Pending<'a, T> {
    rest: &'a [T],
    latest: Option<GpsTime>,
    /// First and last time of an epoch.
    epochs: Option<(GpsTime, GpsTime)>,
    all: &'a [T],
}

impl<'a, T: Timed> Pending<'a, T> {
    /// All of a recording.
    pub fn new(samples: &'a [T]) -> Self {
        Self {
            rest: samples,
            latest: None,
            epochs: None,
            all: samples,
        }
    }

    /// Hands over what arrived up to `latency_ns` after the time of an epoch. With `week_unknown` only its
    /// time of week counts.
    pub fn release_until(
        &mut self,
        time: GpsTime,
        latency_ns: i64,
        week_unknown: bool,
        take: &mut dyn FnMut(&T),
    ) {
        let epoch_in_week_of = |sample: GpsTime| {
            if week_unknown {
                GpsTime::nearest(time.tow_ns(), sample)
            } else {
                time
            }
        };
        if let Some(first) = self.all.first() {
            let time = epoch_in_week_of(first.time());
            let from = self.epochs.map_or(time, |(from, _)| from.min(time));
            let to = self.epochs.map_or(time, |(_, to)| to.max(time));
            self.epochs = Some((from, to));
        }
        while let Some((sample, behind)) = self.rest.split_first() {
            let latest = self.latest.unwrap_or(sample.time().min(time));
            let arrival = match behind.first() {
                // Ahead by itself: the next one goes on where the last one was.
                Some(next) if next.time() < sample.time() && next.time() >= latest => next.time(),
                _ => latest.max(sample.time()),
            };
            if arrival > epoch_in_week_of(sample.time()).plus_ns(latency_ns) {
                return;
            }
            self.latest = Some(arrival);
            self.rest = behind;
            take(sample);
        }
    }

    /// Hands over what arrived after the last epoch.
    ///
    /// # Errors
    /// When samples and epochs are not of the same time.
    pub fn finish(mut self, take: &mut dyn FnMut(&T)) -> Result<()> {
        let times = || self.all.iter().map(Timed::time);
        if let (Some((from, to)), Some(first), Some(last)) =
            (self.epochs, times().min(), times().max())
            && (first > to || last < from)
        {
            let name = |time: GpsTime| format!("week {} {:.3} s", time.week(), time.tow_s());
            bail!(
                "the inertial samples are of GPS {} to {}, the receiver's epochs of {} to {}: give recordings of the same time, and check time_scale, week and time_offset_s in [imu.file]",
                name(first),
                name(last),
                name(from),
                name(to)
            );
        }
        self.rest.iter().for_each(take);
        self.rest = &[];
        Ok(())
    }
}

/// Where the frames of a stream are: every position is tried until one passes its checksum.
pub(crate) fn frames(bytes: &[u8]) -> Vec<Range<usize>> {
    let mut found = Vec::new();
    let mut start = 0;
    while let Some(rest) = bytes.get(start..).filter(|rest| !rest.is_empty()) {
        match frame_length(rest) {
            Some(length) => {
                found.push(start..start + length);
                start += length;
            }
            None => start += 1,
        }
    }
    found
}

/// Length of the frame these bytes start with.
fn frame_length(bytes: &[u8]) -> Option<usize> {
    match bytes {
        [0xd3, high, low, ..] if high & 0xfc == 0 => {
            let length = usize::from(*high) << 8 | usize::from(*low);
            let frame = bytes.get(..length + 6)?;
            let (content, crc) = frame.split_at(length + 3);
            let sent = crc.iter().fold(0, |sum, byte| sum << 8 | u32::from(*byte));
            (crc24q(content) == sent).then_some(frame.len())
        }
        [0xb5, 0x62, _, _, low, high, ..] => {
            let length = usize::from(u16::from_le_bytes([*low, *high]));
            let frame = bytes.get(..length + 8)?;
            let (content, sums) = frame.get(2..)?.split_at(length + 4);
            (ubx::checksum(content) == sums).then_some(frame.len())
        }
        [native::PREAMBLE_1, native::PREAMBLE_2, ..] => {
            Frame::parse(bytes).ok().map(|(_, length)| length)
        }
        _ => None,
    }
}

/// An epoch, and where the frame starts that completes it.
struct Cut {
    at: usize,
    time: GpsTime,
    week_unknown: bool,
}

/// The epochs of a stream, as a monitor with this configuration completes them.
fn cuts(bytes: &[u8], config: &Config) -> Vec<Cut> {
    let mut ingest = Box::new(Ingest::EMPTY);
    ingest.configure(config);
    let mut cuts: Vec<Cut> = Vec::new();
    let frames = frames(bytes);
    // After the last frame the stream ends.
    let ends = std::iter::once(bytes.len()..bytes.len());
    for frame in frames.into_iter().chain(ends) {
        let mut rest = bytes.get(frame.clone()).unwrap_or_default();
        let is_end = rest.is_empty();
        loop {
            let (used, mut event) = ingest.push(rest);
            rest = rest.get(used..).unwrap_or_default();
            if is_end && event == Event::Nothing {
                event = ingest.finish();
            }
            match event {
                Event::Nothing => break,
                Event::EndOfStream if is_end => break,
                Event::Configuration(sent) if ingest.counters().epochs == 0 => {
                    ingest.configure(&sent);
                }
                Event::WeekResolved { shift_weeks } => {
                    let shift_ns = i64::from(shift_weeks) * NS_PER_WEEK;
                    for cut in &mut cuts {
                        cut.time = cut.time.plus_ns(shift_ns);
                    }
                }
                Event::ReceiverFix(fix) => cuts.push(Cut {
                    at: frame.start,
                    time: fix.time,
                    week_unknown: false,
                }),
                Event::EpochReady => cuts.push(Cut {
                    at: frame.start,
                    time: ingest.epoch().time,
                    week_unknown: ingest.epoch().flags.week_unknown,
                }),
                _ => {}
            }
        }
    }
    cuts
}

/// Appends a recorded stream to `out`, with the samples in their places; `latency_ns` tells how long after
/// its instant the epoch of a number arrives. Epochs stay in their order: none overtakes another.
///
/// # Errors
/// When samples and epochs are not of the same time.
pub fn interleave<T: Timed>(
    bytes: &[u8],
    config: &Config,
    mut samples: Pending<'_, T>,
    mut latency_ns: impl FnMut(usize) -> i64,
    out: &mut Vec<u8>,
) -> Result<()> {
    let mut written = 0;
    for (number, cut) in cuts(bytes, config).into_iter().enumerate() {
        out.extend_from_slice(bytes.get(written..cut.at).unwrap_or_default());
        written = written.max(cut.at);
        let latency_ns = latency_ns(number);
        samples.release_until(cut.time, latency_ns, cut.week_unknown, &mut |sample| {
            put(sample, out);
        });
    }
    out.extend_from_slice(bytes.get(written..).unwrap_or_default());
    samples.finish(&mut |sample| put(sample, out))
}

fn put(sample: &impl Timed, out: &mut Vec<u8>) {
    let mut frame = [0; native::MAX_FRAME];
    // The longest frame holds a sample.
    if let Ok(length) = sample.encode(&mut frame) {
        out.extend_from_slice(&frame[..length]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(times_ms: &[i64]) -> Vec<ImuSample> {
        times_ms
            .iter()
            .map(|ms| ImuSample {
                time: GpsTime::from_ns(ms * 1_000_000),
                interval_ns: 10_000_000,
                dtheta_is_s_rad: [0.0; 3],
                dv_is_s_mps: [0.0; 3],
            })
            .collect()
    }

    /// Times released up to each epoch, and after the last.
    fn released(times_ms: &[i64], epochs_ms: &[i64], latency_ms: i64) -> Vec<Vec<i64>> {
        let samples = samples(times_ms);
        let mut pending = Pending::new(&samples);
        let mut groups = Vec::new();
        for epoch_ms in epochs_ms {
            let mut group = Vec::new();
            pending.release_until(
                GpsTime::from_ns(epoch_ms * 1_000_000),
                latency_ms * 1_000_000,
                false,
                &mut |sample| {
                    group.push(sample.time.ns() / 1_000_000);
                },
            );
            groups.push(group);
        }
        let mut group = Vec::new();
        pending
            .finish(&mut |sample| group.push(sample.time.ns() / 1_000_000))
            .unwrap();
        groups.push(group);
        groups
    }

    #[test]
    fn a_sample_of_the_epochs_time_comes_before_it() {
        let groups = released(&[90, 100, 110, 200, 210], &[100, 200], 0);
        assert_eq!(groups, [vec![90, 100], vec![110, 200], vec![210]]);
    }

    #[test]
    fn samples_of_later_instants_come_before_an_epoch_that_is_late() {
        let groups = released(&[90, 100, 110, 200, 210, 220], &[100, 200], 15);
        assert_eq!(groups, [vec![90, 100, 110], vec![200, 210], vec![220]]);
    }

    #[test]
    fn a_wrong_time_holds_nothing_up() {
        // One far ahead by itself, one far back, and time set back for good.
        let groups = released(&[90, 9000, 100, 110, 5, 120, 60, 70, 80], &[100, 120], 0);
        assert_eq!(
            groups,
            [vec![90, 9000, 100], vec![110, 5, 120, 60, 70, 80], vec![]]
        );
    }

    #[test]
    fn recordings_of_different_times_are_refused() {
        let samples = samples(&[10, 20]);
        let mut pending = Pending::new(&samples);
        pending.release_until(GpsTime::from_ns(5_000_000), 0, false, &mut |_| {});
        let error = pending.finish(&mut |_| {}).unwrap_err().to_string();
        assert!(
            error.contains("same time") && error.contains("time_scale"),
            "{error}"
        );
    }

    #[test]
    fn an_epoch_of_unknown_week_is_found_by_its_time_of_week() {
        let samples = samples(&[10, 20, 30]);
        let mut pending = Pending::new(&samples);
        let epoch = GpsTime::from_week_tow_ns(985, 20_000_000);
        let mut count = 0;
        pending.release_until(epoch, 0, true, &mut |_| count += 1);
        assert_eq!(count, 2);
    }
}
