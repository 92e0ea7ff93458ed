//! From data-ready lines to samples in the order in which they came.
//!
//! ```text
//! data-ready, time pulse ─► stamp (interrupt) ─► Edge ─► Sampler: driver reads the part ─► Arrival ─► worker
//! receiver bytes ─────────► receive (interrupt) ───────────────────────────────► ring ──────────────► worker
//! ```
//!
//! The interrupt notes when a line became active and how many bytes of the receiver had come by then: the
//! place in the stream at which the sample belongs. A transfer takes its time, and the worker may be busy
//! with an epoch; what the monitor is given depends on neither. Both queues are lock-free and bounded; what
//! finds them full is counted.

use core::sync::atomic::{AtomicU32, Ordering};

use crate::drivers::{DriverCounters, InertialReading, InertialUnit, Phase, Readings};
use surefix_core::ins::unit::MAX_UNITS;

/// Edges between interrupt and sampler: one of each line and each unit's transfer to spare.
pub const EDGES: usize = 16;
/// Arrivals between sampler and worker: three units at 400 Hz for 50 ms.
pub const ARRIVALS: usize = 64;

/// What became active.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line {
    /// Data-ready of a unit.
    Unit(u8),
    /// The receiver's time pulse.
    TimePulse,
    /// None: it is time to look after a driver.
    Due,
}

/// A line that became active.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// Which.
    pub line: Line,
    /// When, ns on the clock of the board.
    pub time_ns: u64,
    /// Bytes of the receiver that had come by then, modulo 2³².
    pub place: u32,
}

/// Something for the worker, and where it belongs in the stream of the receiver's bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// Bytes that had come before it, modulo 2³².
    pub place: u32,
    /// What.
    pub what: Arrived,
}

/// What arrived.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Arrived {
    /// A unit gave a reading.
    Reading {
        /// Number of the unit.
        unit: u8,
        /// What it measured.
        reading: InertialReading,
    },
    /// A second of the receiver began.
    TimePulse {
        /// When, ns on the clock of the board.
        time_ns: u64,
    },
}

/// What the worker takes next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// At most so many bytes, at least one.
    Bytes(usize),
    /// The first arrival.
    Arrival,
    /// There is nothing.
    Nothing,
}

/// What comes first: bytes from place `taken` on, of which those before `written` are there, or an arrival at
/// `arrival`. `written` must have been read before the queue of arrivals was looked at: what arrives later
/// belongs behind those bytes.
pub fn next(taken: u32, written: u32, arrival: Option<u32>) -> Next {
    let waiting = written.wrapping_sub(taken);
    let before_arrival = match arrival {
        // Places wrap: half of all lie behind.
        Some(place) if place.wrapping_sub(taken).wrapping_sub(1) >= 1 << 31 => {
            return Next::Arrival;
        }
        Some(place) => place.wrapping_sub(taken).min(waiting),
        None => waiting,
    };
    match before_arrival {
        0 => Next::Nothing,
        bytes => Next::Bytes(bytes as usize),
    }
}

/// Edges and arrivals that found their queue full.
#[derive(Debug)]
pub struct Lost {
    edges: AtomicU32,
    arrivals: AtomicU32,
}

impl Lost {
    /// None.
    pub const NONE: Self = Self {
        edges: AtomicU32::new(0),
        arrivals: AtomicU32::new(0),
    };

    /// An edge. For the one interrupt that writes edges.
    pub fn add_edge(&self) {
        add(&self.edges);
    }

    /// An arrival. For the one task that writes arrivals.
    pub fn add_arrival(&self) {
        add(&self.arrivals);
    }

    /// Edges, arrivals.
    pub fn counts(&self) -> (u32, u32) {
        let count = |counter: &AtomicU32| counter.load(Ordering::Relaxed);
        (count(&self.edges), count(&self.arrivals))
    }
}

fn add(counter: &AtomicU32) {
    let count = counter.load(Ordering::Relaxed);
    counter.store(count.saturating_add(1), Ordering::Relaxed);
}

/// A driver that a task may own.
pub type Unit = &'static mut (dyn InertialUnit + Send);

/// The units on the bus.
pub struct Sampler<U = Unit> {
    units: [Option<U>; MAX_UNITS],
    readings: Readings,
}

/// What a driver may be, by value or by reference.
pub trait AsUnit {
    /// The driver.
    fn as_unit(&mut self) -> &mut dyn InertialUnit;
    /// The driver, to look at.
    fn peek(&self) -> &dyn InertialUnit;
}

impl AsUnit for Unit {
    fn as_unit(&mut self) -> &mut dyn InertialUnit {
        &mut **self
    }

    fn peek(&self) -> &dyn InertialUnit {
        &**self
    }
}

impl<U: AsUnit> Sampler<U> {
    /// Of the units that are there.
    pub const fn new(units: [Option<U>; MAX_UNITS]) -> Self {
        Self {
            units,
            readings: Readings::new(),
        }
    }

    /// Does what an edge asks for, with the board's clock at `now_ns`, and gives what came of it.
    pub fn take(&mut self, edge: &Edge, now_ns: u64, give: &mut impl FnMut(Arrival)) {
        match edge.line {
            Line::TimePulse => give(Arrival {
                place: edge.place,
                what: Arrived::TimePulse {
                    time_ns: edge.time_ns,
                },
            }),
            Line::Unit(unit) => self.service(unit, edge, Some(edge.time_ns), now_ns, give),
            Line::Due => {
                for unit in 0..MAX_UNITS {
                    let is_due = self.units.get(unit).and_then(Option::as_ref);
                    if is_due.is_some_and(|driver| driver.peek().next_ns() <= now_ns) {
                        self.service(unit as u8, edge, None, now_ns, give);
                    }
                }
            }
        }
    }

    fn service(
        &mut self,
        unit: u8,
        edge: &Edge,
        data_ready_ns: Option<u64>,
        now_ns: u64,
        give: &mut impl FnMut(Arrival),
    ) {
        let Some(Some(driver)) = self.units.get_mut(usize::from(unit)) else {
            return;
        };
        // Counted by the driver; what was read before the fault is sound.
        let _ = driver
            .as_unit()
            .service(now_ns, data_ready_ns, &mut self.readings);
        for reading in &self.readings {
            give(Arrival {
                place: edge.place,
                what: Arrived::Reading {
                    unit,
                    reading: *reading,
                },
            });
        }
    }

    /// When the first driver wants to be looked after, ns on the clock of the board.
    pub fn next_ns(&self) -> Option<u64> {
        let units = self.units.iter().flatten();
        units.map(|driver| driver.peek().next_ns()).min()
    }

    /// How each unit is and what became of its readings.
    pub fn states(&self) -> [Option<(Phase, DriverCounters)>; MAX_UNITS] {
        let state = |driver: &U| (driver.peek().phase(), driver.peek().counters());
        self.units.each_ref().map(|unit| unit.as_ref().map(state))
    }
}
