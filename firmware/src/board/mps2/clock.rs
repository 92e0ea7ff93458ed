//! CMSDK timer 1 as a free-running counter at the 25 MHz of the board.
//!
//! With QEMU's `-icount shift=6` one instruction takes 64 ns of virtual time, so
//! instructions = ticks × 40 / 64, exact because an instruction is longer than a tick. In real time
//! (line.rs) the shift is 2: 4 ns, 250 million instructions a second, of which a tick counts ten.

use core::ptr::{read_volatile, write_volatile};
#[cfg(feature = "sensors")]
use core::sync::atomic::{AtomicU32, Ordering};
use surefix_core::budget::CycleCounter;

const TIMER1: usize = 0x4000_1000;
const CTRL: *mut u32 = TIMER1 as *mut u32;
const VALUE: *mut u32 = (TIMER1 + 4) as *mut u32;
const RELOAD: *mut u32 = (TIMER1 + 8) as *mut u32;

pub(super) fn start() {
    // SAFETY: registers of timer 1, which nothing else uses.
    unsafe {
        write_volatile(CTRL, 0);
        write_volatile(RELOAD, u32::MAX);
        write_volatile(VALUE, u32::MAX);
        write_volatile(CTRL, 1);
    }
}

/// Ticks of 25 MHz since the start, modulo 2³².
#[inline(always)]
pub fn ticks() -> u32 {
    // SAFETY: reading the value register has no side effect.
    u32::MAX - unsafe { read_volatile(VALUE) }
}

/// Times that the ticks have gone through half of their 32 bits.
#[cfg(feature = "sensors")]
static HALVES: AtomicU32 = AtomicU32::new(0);

/// Notes that another half of the ticks has gone by. For the one interrupt that comes more often than that.
#[cfg(feature = "sensors")]
pub(super) fn count_halves() {
    let halves = HALVES.load(Ordering::Relaxed);
    if ticks() >> 31 != halves & 1 {
        HALVES.store(halves.wrapping_add(1), Ordering::Relaxed);
    }
}

/// Time since the start, ns; does not wrap.
#[cfg(feature = "sensors")]
pub fn now_ns() -> u64 {
    // Read first: ticks that reach the next half meanwhile still count up from this one.
    let halves = HALVES.load(Ordering::Relaxed);
    let ticks = ticks() ^ ((halves & 1) << 31);
    ((u64::from(halves) << 31) + u64::from(ticks)) * TICK_NS
}

/// Virtual time of an instruction, ns.
const INSTRUCTION_NS: u64 = if cfg!(feature = "real-time") { 4 } else { 64 };
/// Virtual time of a tick, ns.
pub(super) const TICK_NS: u64 = 40;
#[cfg(feature = "real-time")]
const TICKS_PER_SECOND: u64 = 1_000_000_000 / TICK_NS;

/// Executed instructions in a number of ticks.
pub const fn instructions(ticks: u64) -> u64 {
    ticks * TICK_NS / INSTRUCTION_NS
}

/// Work that a tick stands for: its instructions. In real time with a clock that is cut the instructions
/// that the whole clock would have executed, so that core's budgets are the same part of an epoch.
fn work(ticks: u64) -> u64 {
    #[cfg(feature = "real-time")]
    if let Some(rate) = super::ticks_per_second() {
        return instructions(ticks) * (TICKS_PER_SECOND / u64::from(rate).max(1));
    }
    instructions(ticks)
}

/// The cycle counter handed to core, in executed instructions.
#[derive(Clone, Copy, Debug)]
pub struct Cycles {
    last_ticks: u32,
    /// Ticks counted so far; wider than the timer, so that the scaled count wraps at 2³² too.
    ticks: u64,
}

impl Cycles {
    pub(super) fn start() -> Self {
        Self {
            last_ticks: ticks(),
            ticks: 0,
        }
    }
}

impl CycleCounter for Cycles {
    #[inline]
    fn now(&mut self) -> u32 {
        let now = ticks();
        self.ticks = self
            .ticks
            .wrapping_add(u64::from(now.wrapping_sub(self.last_ticks)));
        self.last_ticks = now;
        work(self.ticks) as u32
    }
}
