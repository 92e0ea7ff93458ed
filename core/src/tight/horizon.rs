//! Samples that wait for the epoch they may lie behind: the filter's horizon lags, its epochs do not.
//!
//! ```text
//! intake ─► held samples ──up to the horizon──► nominal, alignment
//!                 └─────── all of them ───────► navigation now
//! ```
//!
//! An epoch of the receiver arrives some time after its instant, and samples of later instants before it.
//! The nominal shall stand at the epoch's instant when it is taken. So a sample is carried on at
//! once only while no epoch can come before it, which is until shortly before the next is due; a later
//! one waits for the epoch, but no longer than [`MAX_LATENCY_NS`] as samples count time. Every sample
//! goes through once and in its order, whatever epochs do: with an epoch that comes in time the filter
//! does what it would have done had it come at once, to the bit. docs/decisions/019-latency.md.

use heapless::Deque;

use super::TightMonitor;
use crate::ekf::navigator::AntennaState;
use crate::ins::Taken;
use crate::ins::mechanisation::Increment;
use crate::tight::{CLOCKS, UNSEEN_FORCE_MPS2, UNSEEN_RATE_RADPS};
use crate::time::{GpsTime, NS_PER_S};

/// Latest that an epoch may come after its instant and still be taken by the filter, ns.
pub const MAX_LATENCY_NS: i64 = 400_000_000;
/// Samples wait from this long before an epoch is due, ns: receivers move the labels of their epochs by a
/// millisecond or two to follow their clock.
const EARLY_NS: i64 = 10_000_000;
/// Increments held: [`MAX_LATENCY_NS`] at 400 Hz, and some to spare for bridged gaps. With more the oldest go
/// on early, so that an epoch may be too late sooner.
const CAPACITY: usize = 168;

/// Increments of a sample, or of a gap before one.
#[derive(Clone, Copy, Debug)]
struct Held {
    increment: Increment,
    /// End of it.
    time: GpsTime,
    /// A gap that was filled.
    is_bridge: bool,
}

/// How far samples are carried on at once.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Limit {
    /// All of them: epochs do not come late.
    None,
    /// An epoch may be of any instant.
    Unknown,
    /// The next epoch is due then.
    Due(GpsTime),
}

/// What waits, and until when.
#[derive(Debug)]
pub(super) struct Horizon {
    held: Deque<Held, CAPACITY>,
    limit: Limit,
    /// End of the last increment that was carried on.
    reached: Option<GpsTime>,
    /// Epochs that came when the nominal had passed them.
    too_late: u32,
}

/// What the time of epochs and samples has to say for a report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HorizonState {
    /// Increments that wait.
    pub held: u16,
    /// How far the newest of them is ahead of the nominal, ns.
    pub held_ns: i64,
    /// Epochs, since the unit was configured, that came too late for the filter.
    pub too_late: u32,
}

impl Horizon {
    /// Nothing waits, and nothing will.
    pub(super) const EMPTY: Self = Self {
        held: Deque::new(),
        limit: Limit::None,
        reached: None,
        too_late: 0,
    };

    /// A unit was configured.
    pub(super) fn restart(&mut self) {
        self.held.clear();
        self.limit = Limit::None;
        self.reached = None;
        self.too_late = 0;
    }

    /// End of the last increment carried on: where the nominal stands, or the alignment.
    pub(super) const fn reached(&self) -> Option<GpsTime> {
        self.reached
    }

    /// The samples begin anew at `time`; nothing waits then.
    pub(super) fn begin_at(&mut self, time: Option<GpsTime>) {
        self.reached = time;
    }

    /// An epoch came too late.
    pub(super) fn note_too_late(&mut self) {
        self.too_late = self.too_late.saturating_add(1);
    }

    /// All times so far were wrong by this much, ns.
    pub(super) fn shift(&mut self, by_ns: i64) {
        for held in self.held.iter_mut() {
            held.time = held.time.plus_ns(by_ns);
        }
        self.reached = self.reached.map(|time| time.plus_ns(by_ns));
        if let Limit::Due(due) = &mut self.limit {
            *due = due.plus_ns(by_ns);
        }
    }

    /// The oldest, if it ends at `until` or before.
    fn take_until(&mut self, until: GpsTime) -> Option<Held> {
        if self.held.front()?.time > until {
            return None;
        }
        self.held.pop_front()
    }

    /// Up to when increments need not wait any longer, the newest of them ending at `newest`.
    fn passable(&self, newest: GpsTime) -> GpsTime {
        let oldest = newest.plus_ns(-MAX_LATENCY_NS);
        match self.limit {
            Limit::None => newest,
            Limit::Unknown => oldest,
            Limit::Due(due) => oldest.max(due.plus_ns(-EARLY_NS)),
        }
    }
}

impl TightMonitor {
    /// When the next epoch is due, as far as that is known; to be told before a sample is given. From the
    /// first such call on samples wait for epochs.
    pub(crate) fn expect(&mut self, due: Option<GpsTime>) {
        // The epochs of a scenario folder are where its samples are.
        self.horizon.limit = match due {
            _ if self.reference.is_some() => Limit::None,
            Some(due) => Limit::Due(due),
            None => Limit::Unknown,
        };
    }

    /// Takes increments that follow those before; carries on what need not wait.
    pub(super) fn hold(&mut self, taken: &Taken) {
        if let Some(bridge) = &taken.bridge {
            self.put(Held {
                increment: bridge.increment,
                time: taken.time.plus_ns(-taken.interval_ns),
                is_bridge: true,
            });
        }
        self.put(Held {
            increment: taken.increment,
            time: taken.time,
            is_bridge: false,
        });
        self.release(self.horizon.passable(taken.time));
    }

    fn put(&mut self, held: Held) {
        if self.horizon.held.is_full()
            && let Some(oldest) = self.horizon.held.pop_front()
        {
            self.carry(&oldest);
        }
        // There is room now.
        let _ = self.horizon.held.push_back(held);
    }

    /// Carries on what ends at `until` or before.
    pub(super) fn release(&mut self, until: GpsTime) {
        for _ in 0..CAPACITY {
            let Some(held) = self.horizon.take_until(until) else {
                return;
            };
            self.carry(&held);
        }
    }

    /// Carries on everything: what comes does not follow from it.
    pub(super) fn release_all(&mut self) {
        self.release(GpsTime::from_ns(i64::MAX));
    }

    fn carry(&mut self, held: &Held) {
        self.step(&held.increment, held.time);
        self.horizon.reached = Some(held.time);
        if held.is_bridge {
            if self.is_running() {
                let gap_s = held.increment.dt_s;
                self.navigator
                    .add_uncertainty(UNSEEN_RATE_RADPS * gap_s, UNSEEN_FORCE_MPS2 * gap_s);
            }
        } else if let Limit::Due(due) = self.horizon.limit {
            self.remember(due);
        }
    }

    /// The antenna at the end of the newest sample, as the nominal has it when the samples that wait are
    /// carried on too: for a consumer that needs it now and not at the instant of the last epoch. No
    /// monitor has tested it, and no level bounds it. `None` while the filter does not run.
    ///
    /// Takes as much time as the samples that wait: at most 168 steps of the mechanisation.
    pub fn navigation_now(&self) -> Option<AntennaState<CLOCKS>> {
        if !self.is_running() {
            return None;
        }
        let held = self.horizon.held.iter();
        Some(
            self.navigator
                .carried_over(held.map(|held| (&held.increment, held.time))),
        )
    }

    /// What waits for an epoch, and how many epochs came too late.
    pub fn horizon(&self) -> HorizonState {
        let newest = self.horizon.held.back().map(|held| held.time);
        let held_ns = newest
            .zip(self.horizon.reached)
            .map_or(0, |(newest, reached)| {
                newest.ns().saturating_sub(reached.ns())
            });
        HorizonState {
            held: u16::try_from(self.horizon.held.len()).unwrap_or(u16::MAX),
            held_ns,
            too_late: self.horizon.too_late,
        }
    }
}

const _: () = assert!(CAPACITY as i64 * 2_500_000 > MAX_LATENCY_NS && MAX_LATENCY_NS < NS_PER_S);
