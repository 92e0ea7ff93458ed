//! From arrivals to what the monitor is given: samples with GPS time.

use core::cell::Cell;

use crate::board;
use crate::sensors::{Arrival, Arrived, Lost, State};
use cortex_m::interrupt::Mutex;
use heapless::spsc::Consumer;
use surefix_core::ins::{
    MAX_UNITS, MagneticSample, PressureSample, SampleClock, SampleClockCounters, UnitSample,
};
use surefix_core::time::GpsTime;

/// Edges and arrivals that found no room.
pub static LOST: Lost = Lost::none();

/// How the units are, as of the last time that a driver was served.
pub static UNITS: Mutex<Cell<[Option<State>; MAX_UNITS]>> =
    Mutex::new(Cell::new([None; MAX_UNITS]));

/// A sample with its time.
pub enum Timed {
    /// Of an inertial unit: its number, the sample, and when it was ready, ns on the clock of the board.
    Unit(u8, UnitSample, u64),
    /// Of the barometer.
    Pressure(PressureSample),
    /// Of the magnetometer.
    MagneticField(MagneticSample),
}

/// Arrivals and the clock that times them.
pub struct Samples {
    arrivals: Consumer<'static, Arrival>,
    clock: SampleClock,
    most_waiting: u32,
}

impl Samples {
    /// Of this queue.
    pub const fn new(arrivals: Consumer<'static, Arrival>) -> Self {
        Self {
            arrivals,
            clock: SampleClock::EMPTY,
            most_waiting: 0,
        }
    }

    /// Place of the first arrival in the stream of the receiver's bytes.
    pub fn first_place(&mut self) -> Option<u32> {
        self.most_waiting = self.most_waiting.max(self.arrivals.len() as u32);
        self.arrivals.peek().map(|arrival| arrival.place)
    }

    /// Takes the first arrival; `None` when it is nothing for the monitor: a pulse, or a sample whose time is
    /// not known, which is counted.
    pub fn take(&mut self) -> Option<Timed> {
        match self.arrivals.dequeue()?.what {
            Arrived::TimePulse { time_ns } => {
                self.clock.pulse(time_ns);
                None
            }
            Arrived::Inertial { unit, reading } => {
                let mut sample = reading.unit_sample(self.clock.time(reading.time_ns).ok()?);
                // As in a frame: what is no temperature is none.
                sample.temperature_c = sample
                    .temperature_c
                    .filter(|celsius| (-273.0..=300.0).contains(celsius));
                Some(Timed::Unit(unit, sample, reading.time_ns))
            }
            Arrived::Pressure(reading) => Some(Timed::Pressure(PressureSample {
                time: self.clock.time(reading.time_ns).ok()?,
                pressure_pa: reading.pressure_pa,
                temperature_c: reading.temperature_c,
            })),
            Arrived::MagneticField(reading) => Some(Timed::MagneticField(MagneticSample {
                time: self.clock.time(reading.time_ns).ok()?,
                field_s_ut: reading.field_s_ut,
            })),
        }
    }

    /// An epoch of the receiver, of which the last byte came at `came_ns`, ns on the clock of the board.
    pub fn epoch(&mut self, time: GpsTime, came_ns: u64) {
        self.clock.epoch(time, came_ns);
    }

    /// What became of pulses and times.
    pub const fn clock(&self) -> SampleClockCounters {
        self.clock.counters()
    }

    /// Most arrivals that waited.
    pub const fn most_waiting(&self) -> u32 {
        self.most_waiting
    }
}

/// The clock of the board when its ticks stood at `ticks`, less than half of their range ago, ns.
pub fn at_ticks(ticks: u32) -> u64 {
    let (now_ns, now) = (board::now_ns(), board::ticks());
    let rate = u64::from(board::ticks_per_second().unwrap_or(u32::MAX));
    now_ns.saturating_sub(u64::from(now.wrapping_sub(ticks)) * 1_000_000_000 / rate)
}

/// The ticks when the clock of the board stood at `time_ns`, modulo 2³².
pub fn ticks_at(time_ns: u64) -> u32 {
    let age_ns = board::now_ns().saturating_sub(time_ns);
    let rate = u64::from(board::ticks_per_second().unwrap_or(0));
    // Ages are far below the 38 s at which this would wrap.
    board::ticks().wrapping_sub((age_ns.wrapping_mul(rate) / 1_000_000_000) as u32)
}
