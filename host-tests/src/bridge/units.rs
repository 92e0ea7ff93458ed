//! The parts of a flight: register models that feel it, and their own record of what they felt.

use std::sync::{Arc, Mutex};

use super::Device;
use super::motion::{BoardClock, Felt};
use crate::parts::{Fault, Motion, Part};

/// What a part was given to measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    /// When its interval ended, ns on the board's clock.
    pub ready_ns: u64,
    /// What it measured over it.
    pub motion: Motion,
}

/// A fault of a part during a time.
#[derive(Clone, Copy, Debug)]
pub struct TimedFault {
    /// What is wrong.
    pub fault: Fault,
    /// From when on, ns on the board's clock.
    pub from_ns: u64,
    /// Until when.
    pub until_ns: u64,
}

/// What happened to a part, for whoever looks afterwards.
pub type Record = Arc<Mutex<Vec<Held>>>;

/// A register model in a flight.
pub struct Flown<P> {
    part: P,
    clock: BoardClock,
    felt: Arc<Felt>,
    interval_ns: u64,
    faults: Vec<TimedFault>,
    /// Which of these are there now.
    active: Vec<bool>,
    /// Since when the data-ready line has been active without an edge, ns.
    stuck_ns: Option<u64>,
    record: Record,
}

impl<P: Part> Flown<P> {
    /// A part whose intervals have this length, ns.
    pub fn new(
        part: P,
        clock: BoardClock,
        felt: Arc<Felt>,
        interval_ns: u64,
        faults: Vec<TimedFault>,
    ) -> (Self, Record) {
        let record = Record::default();
        let flown = Self {
            part,
            clock,
            felt,
            interval_ns,
            active: vec![false; faults.len()],
            faults,
            stuck_ns: None,
            record: Arc::clone(&record),
        };
        (flown, record)
    }

    /// What the flight is like over the interval that ends at `now_ns`.
    fn motion(&self, now_ns: u64) -> Motion {
        let end = self.clock.gps(now_ns);
        let begin = self.clock.gps(now_ns.saturating_sub(self.interval_ns));
        let (omega_is_s_radps, f_is_s_mps2) = self.felt.mean(begin, end);
        Motion {
            omega_is_s_radps,
            f_is_s_mps2,
            ..Motion::REST
        }
    }
}

impl<P: Part + Send> Device for Flown<P> {
    fn transfer(&mut self, mosi: &[u8], miso: &mut [u8]) {
        self.part.transfer(mosi, miso);
    }

    fn advance(&mut self, now_ns: u64) {
        let is_active = |fault: &TimedFault| (fault.from_ns..fault.until_ns).contains(&now_ns);
        let active: Vec<bool> = self.faults.iter().map(is_active).collect();
        if active != self.active {
            let faults = self.part.faults();
            faults.clear();
            for fault in self.faults.iter().filter(|fault| is_active(fault)) {
                faults.set(fault.fault);
            }
            let is_stuck = faults.has(Fault::StuckDataReady { active: true });
            self.stuck_ns = is_stuck.then_some(now_ns);
            self.active = active;
        }
        let is_sample = self.part.next_ns() <= now_ns;
        let motion = self.motion(now_ns);
        self.part.advance(now_ns, &motion);
        if is_sample && let Ok(mut record) = self.record.lock() {
            record.push(Held {
                ready_ns: now_ns,
                motion,
            });
        }
    }

    fn ready_ns(&self) -> Option<u64> {
        self.stuck_ns.or_else(|| self.part.data_ready_ns())
    }

    fn next_ns(&self) -> u64 {
        self.part.next_ns()
    }
}
