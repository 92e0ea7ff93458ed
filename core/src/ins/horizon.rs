//! Increments that wait for the epoch they may lie behind, in the order of their times.
//!
//! | symbol | code | unit | meaning |
//! |---|---|---|---|
//! | t_n | `newest` | ns | end of the newest increment |
//! | t_d | `Limit::Due` | ns | instant of the next epoch, as far as it is known |
//! | L | [`MAX_LATENCY_NS`] | ns | latest that an epoch may come after its instant |
//! | e | [`EARLY_NS`] | ns | earliest that an epoch may lie before t_d |
//!
//! An increment is passed on at once when it ends at max(t_n − L, t_d − e) or before: no epoch of an
//! earlier instant is to be expected, or none that would still be taken. An epoch of instant t that comes
//! passes on what ends at t or before, and what comes after it stays. So each increment goes through once
//! and in its order, and no memory grows. docs/decisions/019-latency.md.
//!
//! Assumes: increments follow each other in time (`intake.rs`); who takes them empties this when they
//! do not.

use heapless::Deque;

use super::mechanisation::Increment;
use super::{MagneticSample, PressureSample, Taken};
use crate::time::{GpsTime, NS_PER_S};

/// Latest that an epoch may come after its instant and still be taken by the filter, ns.
pub const MAX_LATENCY_NS: i64 = 400_000_000;
/// Increments wait from this long before an epoch is due, ns: receivers move the labels of their epochs by a
/// millisecond or two to follow their clock.
const EARLY_NS: i64 = 10_000_000;
/// Increments held: [`MAX_LATENCY_NS`] at 400 Hz, and some to spare for bridged gaps. With more the oldest go
/// on early, so that an epoch may be too late sooner.
pub(crate) const CAPACITY: usize = 168;

const _: () = assert!(CAPACITY as i64 * 2_500_000 > MAX_LATENCY_NS && MAX_LATENCY_NS < NS_PER_S);

/// Samples of a magnetometer and a barometer held: [`MAX_LATENCY_NS`] at 100 Hz and 50 Hz, and some to spare.
const AIDING: usize = 64;

/// Increments of a sample, or of a gap before one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Held {
    /// The increments.
    pub increment: Increment,
    /// End of them.
    pub time: GpsTime,
    /// A gap that was filled.
    pub is_bridge: bool,
}

impl Held {
    /// What a used sample brings: a bridged gap before it, and itself.
    pub(crate) fn of(taken: &Taken) -> [Option<Self>; 2] {
        let bridge = taken.bridge.map(|bridge| Self {
            increment: bridge.increment,
            time: taken.time.plus_ns(-taken.interval_ns),
            is_bridge: true,
        });
        let own = Self {
            increment: taken.increment,
            time: taken.time,
            is_bridge: false,
        };
        [bridge, Some(own)]
    }
}

/// A sample that belongs to where the increments before its time have brought the nominal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Aiding {
    /// Of a magnetometer.
    Field(MagneticSample),
    /// Of a barometer.
    Pressure(PressureSample),
}

impl Aiding {
    const fn time(&self) -> GpsTime {
        match self {
            Self::Field(sample) => sample.time,
            Self::Pressure(sample) => sample.time,
        }
    }
}

/// How far increments are passed on at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Limit {
    /// All of them: epochs do not come late.
    None,
    /// An epoch may be of any instant.
    Unknown,
    /// The next epoch is of this instant.
    Due(GpsTime),
}

/// What waits, and for what.
#[derive(Clone, Debug)]
pub(crate) struct Horizon {
    held: Deque<Held, CAPACITY>,
    /// What was measured after `reached`.
    aiding: Deque<Aiding, AIDING>,
    limit: Limit,
    /// End of the last increment that was passed on.
    reached: Option<GpsTime>,
    /// Epochs that came when the nominal had passed them.
    too_late: u32,
}

const _: () = assert!(core::mem::size_of::<Horizon>() <= 14_800);

/// What waits for an epoch, and what came too late.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HorizonState {
    /// Increments that wait.
    pub held: u16,
    /// Epochs, since the unit was configured, that came too late for the filter.
    pub too_late: u32,
}

impl Horizon {
    /// Nothing waits, and nothing will.
    pub(crate) const EMPTY: Self = Self {
        held: Deque::new(),
        aiding: Deque::new(),
        limit: Limit::None,
        reached: None,
        too_late: 0,
    };

    /// Begins anew, as for another unit.
    pub(crate) fn restart(&mut self) {
        self.held.clear();
        self.aiding.clear();
        self.limit = Limit::None;
        self.reached = None;
        self.too_late = 0;
    }

    /// Sets how far increments are passed on at once.
    pub(crate) fn set_limit(&mut self, limit: Limit) {
        self.limit = limit;
    }

    /// When the next epoch is due, if increments wait for it.
    pub(crate) const fn due(&self) -> Option<GpsTime> {
        match self.limit {
            Limit::Due(due) => Some(due),
            Limit::None | Limit::Unknown => None,
        }
    }

    /// End of the last increment passed on: where the nominal stands, or the alignment.
    pub(crate) const fn reached(&self) -> Option<GpsTime> {
        self.reached
    }

    /// The samples begin anew at `time`; nothing waits then.
    pub(crate) fn begin_at(&mut self, time: Option<GpsTime>) {
        self.held.clear();
        self.aiding.clear();
        self.reached = time;
    }

    /// An epoch came too late.
    pub(crate) fn note_too_late(&mut self) {
        self.too_late = self.too_late.saturating_add(1);
    }

    /// What waits, from the oldest on.
    pub(crate) fn held(&self) -> impl Iterator<Item = &Held> {
        self.held.iter()
    }

    /// For a report.
    pub(crate) fn state(&self) -> HorizonState {
        HorizonState {
            held: u16::try_from(self.held.len()).unwrap_or(u16::MAX),
            too_late: self.too_late,
        }
    }

    /// All times so far were wrong by this much, ns.
    pub(crate) fn shift(&mut self, by_ns: i64) {
        for held in self.held.iter_mut() {
            held.time = held.time.plus_ns(by_ns);
        }
        for aiding in self.aiding.iter_mut() {
            let time = match aiding {
                Aiding::Field(sample) => &mut sample.time,
                Aiding::Pressure(sample) => &mut sample.time,
            };
            *time = time.plus_ns(by_ns);
        }
        self.reached = self.reached.map(|time| time.plus_ns(by_ns));
        if let Limit::Due(due) = &mut self.limit {
            *due = due.plus_ns(by_ns);
        }
    }

    /// Takes one more; gives the oldest in its place when there is no room.
    pub(crate) fn put(&mut self, held: Held) -> Option<Held> {
        let oldest = if self.held.is_full() {
            self.pass_oldest()
        } else {
            None
        };
        // There is room now.
        let _ = self.held.push_back(held);
        oldest
    }

    /// Passes on the oldest, if it ends at `until` or before.
    pub(crate) fn pass(&mut self, until: GpsTime) -> Option<Held> {
        if self.held.front()?.time > until {
            return None;
        }
        self.pass_oldest()
    }

    fn pass_oldest(&mut self) -> Option<Held> {
        let oldest = self.held.pop_front()?;
        self.reached = Some(oldest.time);
        Some(oldest)
    }

    /// Takes a sample that waits for the increments up to its time; gives back one that need not wait, or
    /// the oldest where there is no room.
    pub(crate) fn put_aiding(&mut self, aiding: Aiding) -> Option<Aiding> {
        let is_reached = self.reached.is_none_or(|reached| aiding.time() <= reached);
        // One that waits is not overtaken.
        if self.aiding.is_empty() && (self.held.is_empty() || is_reached) {
            return Some(aiding);
        }
        let oldest = if self.aiding.is_full() {
            self.aiding.pop_front()
        } else {
            None
        };
        // There is room now.
        let _ = self.aiding.push_back(aiding);
        oldest
    }

    /// Passes on the oldest such sample, if the increments have come to its time.
    pub(crate) fn pass_aiding(&mut self) -> Option<Aiding> {
        if Some(self.aiding.front()?.time()) > self.reached {
            return None;
        }
        self.aiding.pop_front()
    }

    /// Up to when increments need not wait any longer, the newest of them ending at `newest`.
    pub(crate) fn passable(&self, newest: GpsTime) -> GpsTime {
        let oldest = newest.plus_ns(-MAX_LATENCY_NS);
        match self.limit {
            Limit::None => newest,
            Limit::Unknown => oldest,
            Limit::Due(due) => oldest.max(due.plus_ns(-EARLY_NS)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use std::vec::Vec;

    fn at(milliseconds: i64) -> GpsTime {
        GpsTime::from_ns(1_000_000_000_000_000_000 + milliseconds * 1_000_000)
    }

    fn ending_at(milliseconds: i64) -> Held {
        Held {
            increment: Increment {
                dtheta_b: Vector3::zeros(),
                dv_b: Vector3::zeros(),
                dt_s: 0.01,
            },
            time: at(milliseconds),
            is_bridge: false,
        }
    }

    fn ms(held: &Held) -> i64 {
        (held.time.ns() - at(0).ns()) / 1_000_000
    }

    /// Times passed on while these arrive.
    fn passed(horizon: &mut Horizon, arriving: impl Iterator<Item = i64>) -> Vec<i64> {
        let mut all = Vec::new();
        for milliseconds in arriving {
            all.extend(horizon.put(ending_at(milliseconds)).iter().map(ms));
            let until = horizon.passable(at(milliseconds));
            while let Some(held) = horizon.pass(until) {
                all.push(ms(&held));
            }
        }
        all
    }

    #[test]
    fn what_ends_before_an_epoch_is_due_does_not_wait_and_what_ends_later_does() {
        let mut horizon = Horizon::EMPTY;
        horizon.set_limit(Limit::Due(at(1000)));
        let arriving = (10..=1300).step_by(10);
        assert!(
            passed(&mut horizon, arriving)
                .into_iter()
                .eq((10..=990).step_by(10))
        );
        assert_eq!(horizon.reached(), Some(at(990)));
        assert_eq!(horizon.state().held, 31);
        // The epoch comes, of the instant it was due at.
        assert_eq!(horizon.pass(at(1000)).as_ref().map(ms), Some(1000));
        assert_eq!(horizon.pass(at(1000)), None);
        assert_eq!(horizon.held().next().map(ms), Some(1010));
    }

    /// INT-124.
    #[test]
    fn int_124_nothing_waits_longer_than_an_epoch_may_be_late() {
        for limit in [Limit::Unknown, Limit::Due(at(1000))] {
            let mut horizon = Horizon::EMPTY;
            horizon.set_limit(limit);
            let all = passed(&mut horizon, (10..=5000).step_by(10));
            assert!(all.into_iter().eq((10..=4600).step_by(10)), "{limit:?}");
        }
        let mut horizon = Horizon::EMPTY;
        let all = passed(&mut horizon, (10..=50).step_by(10));
        assert_eq!(all, [10, 20, 30, 40, 50]);
    }

    /// INT-124.
    #[test]
    fn int_124_a_full_history_passes_on_its_oldest_and_loses_nothing() {
        let mut horizon = Horizon::EMPTY;
        horizon.set_limit(Limit::Unknown);
        // A kilohertz: more than there is room for.
        let all = passed(&mut horizon, 1..=1000);
        let waiting: Vec<i64> = horizon.held().map(ms).collect();
        assert_eq!(waiting.len(), CAPACITY);
        assert!(all.into_iter().chain(waiting).eq(1..=1000));
    }

    #[test]
    fn what_was_measured_waits_for_the_increments_up_to_its_time() {
        let field = |milliseconds: i64| {
            Aiding::Field(MagneticSample {
                time: at(milliseconds),
                field_s_ut: [milliseconds as f64, 0.0, 0.0],
            })
        };
        let mut horizon = Horizon::EMPTY;
        // Nothing waits: nor does a field.
        assert_eq!(horizon.put_aiding(field(5)), Some(field(5)));
        horizon.set_limit(Limit::Due(at(100)));
        passed(&mut horizon, (10..=200).step_by(10));
        assert_eq!(horizon.put_aiding(field(85)), Some(field(85)));
        for milliseconds in [105, 115, 125] {
            assert_eq!(horizon.put_aiding(field(milliseconds)), None);
        }
        assert_eq!(horizon.pass_aiding(), None);
        while horizon.pass(at(120)).is_some() {}
        assert_eq!(horizon.pass_aiding(), Some(field(105)));
        assert_eq!(horizon.pass_aiding(), Some(field(115)));
        assert_eq!(horizon.pass_aiding(), None);
        // More than there is room for: the oldest go early, and none is lost.
        let all = 200..300;
        let early: Vec<_> = all
            .clone()
            .filter_map(|ms| horizon.put_aiding(field(ms)))
            .collect();
        passed(&mut horizon, std::iter::once(1000));
        while horizon.pass(at(1000)).is_some() {}
        let rest: Vec<_> = std::iter::from_fn(|| horizon.pass_aiding()).collect();
        let expected = std::iter::once(125).chain(all).map(field);
        assert!(early.into_iter().chain(rest).eq(expected));
    }

    #[test]
    fn times_at_the_ends_of_all_times_do_no_harm() {
        let mut horizon = Horizon::EMPTY;
        for limit in [
            Limit::Due(GpsTime::from_ns(i64::MIN)),
            Limit::Due(GpsTime::from_ns(i64::MAX)),
            Limit::Unknown,
        ] {
            horizon.set_limit(limit);
            for time in [i64::MIN, i64::MAX, 0] {
                horizon.put(Held {
                    time: GpsTime::from_ns(time),
                    ..ending_at(0)
                });
                let until = horizon.passable(GpsTime::from_ns(time));
                horizon.pass(until);
                horizon.shift(time);
            }
        }
    }
}
