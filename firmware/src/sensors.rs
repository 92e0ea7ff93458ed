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

use crate::drivers::{
    Barometer, DriverCounters, InertialReading, InertialUnit, MagneticReading, Magnetometer, Phase,
    PressureReading, Readings,
};
use surefix_core::ins::MAX_UNITS;

/// Edges between interrupt and sampler: one of each line and each unit's transfer to spare.
pub const EDGES: usize = 16;
/// Arrivals between sampler and worker: three units at 400 Hz for 50 ms.
pub const ARRIVALS: usize = 64;

/// What became active.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line {
    /// Data-ready of a unit.
    Unit(u8),
    /// Data-ready of the barometer.
    Barometer,
    /// Data-ready of the magnetometer.
    Magnetometer,
    /// The receiver's time pulse.
    TimePulse,
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
    Inertial {
        /// Number of the unit.
        unit: u8,
        /// What it measured.
        reading: InertialReading,
    },
    /// The barometer gave a reading.
    Pressure(PressureReading),
    /// The magnetometer gave a reading.
    MagneticField(MagneticReading),
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
    pub const fn none() -> Self {
        Self {
            edges: AtomicU32::new(0),
            arrivals: AtomicU32::new(0),
        }
    }

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

/// The parts on the bus, each with its driver; any of them may be missing.
#[derive(Default)]
pub struct Parts<'a> {
    /// Inertial units, by their number.
    pub units: [Option<&'a mut (dyn InertialUnit + Send)>; MAX_UNITS],
    /// A barometer.
    pub barometer: Option<&'a mut (dyn Barometer + Send)>,
    /// A magnetometer.
    pub magnetometer: Option<&'a mut (dyn Magnetometer + Send)>,
}

/// Phase and counters of a driver.
pub type State = (Phase, DriverCounters);

/// Serves the drivers: what the task between interrupt and worker does.
pub struct Sampler<'a> {
    parts: Parts<'a>,
    readings: Readings,
}

impl<'a> Sampler<'a> {
    /// Of these parts.
    pub const fn new(parts: Parts<'a>) -> Self {
        Self {
            parts,
            readings: Readings::new(),
        }
    }

    /// Does what an edge asks for, with the board's clock at `now_ns`, and gives what came of it.
    pub fn take(&mut self, edge: &Edge, now_ns: u64, give: &mut impl FnMut(Arrival)) {
        let mut give = |what| {
            give(Arrival {
                place: edge.place,
                what,
            });
        };
        let at_ns = Some(edge.time_ns);
        match edge.line {
            Line::TimePulse => give(Arrived::TimePulse {
                time_ns: edge.time_ns,
            }),
            Line::Unit(unit) => self.unit(unit, at_ns, now_ns, &mut give),
            Line::Barometer => self.barometer(at_ns, now_ns, &mut give),
            Line::Magnetometer => self.magnetometer(at_ns, now_ns, &mut give),
        }
    }

    /// Serves the drivers that want it without an edge, with the board's clock at `now_ns` and after `place`
    /// bytes of the receiver.
    pub fn look_after(&mut self, place: u32, now_ns: u64, give: &mut impl FnMut(Arrival)) {
        let mut give = |what| give(Arrival { place, what });
        for unit in 0..MAX_UNITS as u8 {
            self.unit(unit, None, now_ns, &mut give);
        }
        self.barometer(None, now_ns, &mut give);
        self.magnetometer(None, now_ns, &mut give);
    }

    /// Without an edge a driver is served only when it is due. What goes wrong is counted by the driver.
    fn unit(
        &mut self,
        unit: u8,
        data_ready_ns: Option<u64>,
        now_ns: u64,
        give: &mut impl FnMut(Arrived),
    ) {
        let Some(Some(driver)) = self.parts.units.get_mut(usize::from(unit)) else {
            return;
        };
        if data_ready_ns.is_none() && driver.next_ns() > now_ns {
            return;
        }
        // What was read before a fault is sound.
        let _ = driver.service(now_ns, data_ready_ns, &mut self.readings);
        for reading in &self.readings {
            give(Arrived::Inertial {
                unit,
                reading: *reading,
            });
        }
    }

    fn barometer(
        &mut self,
        data_ready_ns: Option<u64>,
        now_ns: u64,
        give: &mut impl FnMut(Arrived),
    ) {
        let Some(driver) = &mut self.parts.barometer else {
            return;
        };
        if data_ready_ns.is_none() && driver.next_ns() > now_ns {
            return;
        }
        if let Ok(Some(reading)) = driver.service(now_ns, data_ready_ns) {
            give(Arrived::Pressure(reading));
        }
    }

    fn magnetometer(
        &mut self,
        data_ready_ns: Option<u64>,
        now_ns: u64,
        give: &mut impl FnMut(Arrived),
    ) {
        let Some(driver) = &mut self.parts.magnetometer else {
            return;
        };
        if data_ready_ns.is_none() && driver.next_ns() > now_ns {
            return;
        }
        if let Ok(Some(reading)) = driver.service(now_ns, data_ready_ns) {
            give(Arrived::MagneticField(reading));
        }
    }

    /// When the first driver wants to be served, ns on the clock of the board.
    pub fn next_ns(&self) -> Option<u64> {
        let units = self.parts.units.iter().flatten();
        let barometer = self.parts.barometer.iter();
        let magnetometer = self.parts.magnetometer.iter();
        let due = units
            .map(|driver| driver.next_ns())
            .chain(barometer.map(|driver| driver.next_ns()))
            .chain(magnetometer.map(|driver| driver.next_ns()));
        due.min()
    }

    /// How each unit is, and what became of its readings.
    pub fn units(&self) -> [Option<State>; MAX_UNITS] {
        let units = self.parts.units.each_ref();
        units.map(|unit| {
            let driver = unit.as_ref()?;
            Some((driver.phase(), driver.counters()))
        })
    }
}
