//! Lines on EXTI 11, 13, 14 and 15; TIM2 as the clock that stamps them and wakes the drivers.

use crate::sensors::Line;
use core::sync::atomic::{AtomicU32, Ordering};
use stm32h7::stm32h743::{EXTI, Peripherals, TIM2};

/// Lines: data-ready of units 0, 1, 2, and the time pulse.
const UNITS: [u32; 3] = [1 << 11, 1 << 13, 1 << 14];
const TIME_PULSE: u32 = 1 << 15;
const ALL: u32 = UNITS[0] | UNITS[1] | UNITS[2] | TIME_PULSE;

/// Clock of TIM2: twice that of APB1, Hz; and of its counter. RM0433 8.5.6.
const TIMER_HZ: u32 = 240_000_000;
const COUNT_HZ: u32 = 10_000_000;
/// Length of a count, ns.
const COUNT_NS: u64 = 100;

const CR1_CEN: u32 = 1 << 0;
const DIER_CC1IE: u32 = 1 << 1;
const EGR_UG: u32 = 1 << 0;

/// Longest time that the alarm is set for, ns.
const LONGEST_NS: u64 = 10_000_000_000;
/// An alarm nearer than this may be over before it is set, ns.
const NEAREST_NS: u64 = 2_000;

/// Times that the counter has gone through half of its 32 bits.
static HALVES: AtomicU32 = AtomicU32::new(0);

fn counter() -> u32 {
    // SAFETY: reading the counter has no side effect.
    unsafe { (*TIM2::ptr()).cnt().read().bits() }
}

/// Notes that another half of the counter has gone by: every edge and every alarm does, and there is one
/// within [`LONGEST_NS`]. Two that do at once note the same.
fn count_halves() {
    let halves = HALVES.load(Ordering::Relaxed);
    if counter() >> 31 != halves & 1 {
        HALVES.store(halves.wrapping_add(1), Ordering::Relaxed);
    }
}

/// Time since the start, ns; does not wrap.
pub fn now_ns() -> u64 {
    // Read first: a counter that reaches the next half meanwhile still counts up from this one.
    let halves = HALVES.load(Ordering::Relaxed);
    let count = counter() ^ ((halves & 1) << 31);
    ((u64::from(halves) << 31) + u64::from(count)) * COUNT_NS
}

pub(super) fn start(chip: &Peripherals) -> (Edges, Alarm) {
    chip.RCC.apb1lenr().modify(|_, w| w.tim2en().set_bit());
    let _ = chip.RCC.apb1lenr().read();
    let timer = &chip.TIM2;
    // SAFETY: a prescaler of 24, a counter of 32 bits, an interrupt at compare 1.
    unsafe {
        timer.psc().write(|w| w.bits(TIMER_HZ / COUNT_HZ - 1));
        timer.arr().write(|w| w.bits(u32::MAX));
        timer.egr().write(|w| w.bits(EGR_UG));
        timer.sr().write(|w| w.bits(0));
        timer.dier().write(|w| w.bits(DIER_CC1IE));
        timer.cr1().write(|w| w.bits(CR1_CEN));
    }
    // Ports E (4) and F (5) of the lines; pins are inputs after this, pulled nowhere.
    // SAFETY: fields of four bits each, a port per line.
    unsafe {
        chip.SYSCFG
            .exticr3()
            .modify(|r, w| w.bits(r.bits() & !0xf000 | 4 << 12));
        chip.SYSCFG
            .exticr4()
            .modify(|r, w| w.bits(r.bits() & !0xfff0 | 4 << 4 | 5 << 8 | 5 << 12));
        chip.GPIOE
            .moder()
            .modify(|_, w| w.moder11().bits(0).moder13().bits(0));
        chip.GPIOF
            .moder()
            .modify(|_, w| w.moder14().bits(0).moder15().bits(0));
        chip.EXTI.rtsr1().modify(|r, w| w.bits(r.bits() | ALL));
        chip.EXTI.cpuimr1().modify(|r, w| w.bits(r.bits() | ALL));
    }
    let mut alarm = Alarm { _owner: () };
    alarm.set(0);
    (Edges { _owner: () }, alarm)
}

/// Lines that become active.
pub struct Edges {
    _owner: (),
}

impl Edges {
    /// In the interrupt: takes a line that became active and acknowledges it, until there is none.
    pub fn take(&mut self) -> Option<Line> {
        count_halves();
        // SAFETY: the pending register is this type's alone.
        let exti = unsafe { &*EXTI::ptr() };
        let pending = exti.cpupr1().read().bits() & ALL;
        let lowest = pending & pending.wrapping_neg();
        // SAFETY: writing a one clears that line; an edge that comes afterwards sets it again.
        exti.cpupr1().write(|w| unsafe { w.bits(lowest) });
        match UNITS.iter().position(|line| *line == lowest) {
            Some(unit) => Some(Line::Unit(unit as u8)),
            None if lowest == TIME_PULSE => Some(Line::TimePulse),
            None => None,
        }
    }
}

/// Interrupts the sampler when a driver wants to be served.
pub struct Alarm {
    _owner: (),
}

impl Alarm {
    /// Acknowledges the alarm and sets the next: at a time, ns on the clock of the board; again within seconds
    /// in any case.
    pub fn set(&mut self, at_ns: u64) {
        count_halves();
        let now_ns = now_ns();
        let latest_ns = now_ns.saturating_add(LONGEST_NS);
        let at_ns = at_ns.min(latest_ns).max(now_ns + NEAREST_NS);
        // SAFETY: TIM2 has no other user but readers of its counter; the counts wrap with it.
        unsafe {
            let timer = &*TIM2::ptr();
            timer.ccr1().write(|w| w.bits((at_ns / COUNT_NS) as u32));
            timer.sr().write(|w| w.bits(0));
        }
    }
}
