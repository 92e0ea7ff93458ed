//! Timers that stand for the interrupts of the lines: the first of the dual timer comes when a line may become
//! active, the second when a driver wants to be served.
//!
//! Source: ARM DDI 0479 (CMSDK) 4.2 dual timer.

use super::bus;
use crate::board::mps2::clock::{self, TICK_NS};
use crate::board::now_ns;
use crate::sensors::Line;
use core::ptr::{read_volatile, write_volatile};

const LINES: usize = 0x4000_2000;
const ALARM: usize = 0x4000_2020;

const LOAD: usize = 0x00;
const CONTROL: usize = 0x08;
const INTCLR: usize = 0x0C;
const MIS: usize = 0x14;

const ONE_SHOT: u32 = 1 << 0;
const BITS_32: u32 = 1 << 1;
const INTERRUPT: u32 = 1 << 5;
const ENABLE: u32 = 1 << 7;

/// Longest time that a timer is set for, ns: the clock of the board must be looked at again before half of
/// its 32 bits have gone by.
const LONGEST_NS: u64 = 10_000_000_000;
/// When the host does not answer, it is asked again after this, ns.
const NO_ANSWER_NS: u64 = 100_000_000;

fn write(timer: usize, register: usize, value: u32) {
    // SAFETY: a register of the dual timer, which nothing else uses; each half has one owner.
    unsafe { write_volatile((timer + register) as *mut u32, value) }
}

fn is_pending(timer: usize) -> bool {
    // SAFETY: reading the masked interrupt status has no side effect.
    let is_pending = unsafe { read_volatile((timer + MIS) as *const u32) } & 1 != 0;
    if is_pending {
        write(timer, INTCLR, 1);
    }
    is_pending
}

/// Interrupts at a time, or at once when it has passed.
fn set(timer: usize, at_ns: u64) {
    let wait_ns = at_ns.saturating_sub(now_ns()).min(LONGEST_NS);
    let ticks = wait_ns.div_ceil(TICK_NS).max(1);
    write(timer, CONTROL, 0);
    write(timer, INTCLR, 1);
    write(timer, LOAD, ticks as u32);
    write(timer, CONTROL, ONE_SHOT | BITS_32 | INTERRUPT | ENABLE);
}

/// Lines that become active.
pub struct Edges {
    /// A bit for each that was not taken yet.
    active: u32,
}

impl Edges {
    pub(super) fn start() -> Self {
        set(LINES, 0);
        Self { active: 0 }
    }

    /// In the interrupt: acknowledges it and takes a line, until there is none.
    pub fn take(&mut self) -> Option<Line> {
        clock::count_halves();
        // The sampler runs after every interrupt of these timers, and looks who wants to be served.
        let _ = is_pending(ALARM);
        if self.active == 0 && is_pending(LINES) {
            let (active, next_ns) = bus::edges().unwrap_or((0, now_ns() + NO_ANSWER_NS));
            self.active = active;
            set(LINES, next_ns);
        }
        // One line at a time, the lowest first; a number that is none is passed over.
        while self.active != 0 {
            let number = self.active.trailing_zeros();
            self.active &= self.active - 1;
            match number {
                0..=2 => return Some(Line::Unit(number as u8)),
                3 => return Some(Line::Barometer),
                4 => return Some(Line::Magnetometer),
                31 => return Some(Line::TimePulse),
                _ => {}
            }
        }
        None
    }
}

/// Interrupts when a driver wants to be served.
pub struct Alarm {
    _owner: (),
}

impl Alarm {
    pub(super) fn start() -> Self {
        set(ALARM, 0);
        Self { _owner: () }
    }

    /// At a time, ns on the clock of the board; again within seconds in any case.
    pub fn set(&mut self, at_ns: u64) {
        set(ALARM, at_ns);
    }
}
