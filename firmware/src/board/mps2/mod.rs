//! QEMU's mps2-an500: a Cortex-M7 with double-precision FPU, CMSDK timers and UARTs.
//!
//! | QEMU `-serial` | base | use |
//! |---|---|---|
//! | 0 | 0x40004000 | receiver bytes in, unless they come from memory (line.rs) |
//! | 1 | 0x40005000 | output frames, NMEA sentences between them |
//! | 2 | 0x40006000 | defmt log |
//! | 3 | 0x40007000 | acknowledgements for the replaying host; in real time when epochs were done |
//!
//! Sensors are in a process of the host (bridge/).
//!
//! Sources: ARM DAI 0500 (AN500) memory map; ARM DDI 0479 (CMSDK) 4.3 UART, 4.1 timer.

#[cfg(feature = "sensors")]
mod bridge;
mod clock;
#[cfg(feature = "real-time")]
mod line;
mod markers;
mod uart;

#[cfg(feature = "sensors")]
pub use bridge::{Alarm, Bus, Edges, File, present, recording};
#[cfg(feature = "sensors")]
pub use clock::now_ns;
pub use clock::{Cycles, instructions, ticks};
#[cfg(feature = "real-time")]
pub use line::{RECEIVE_DELAY, Receiver, ticks_per_second};
pub use markers::{bench_begin, bench_end};
pub use uart::{Acknowledge, BAUD, Transmitter};
#[cfg(not(feature = "real-time"))]
pub use uart::{RECEIVE_DELAY, Receiver};

use super::{Ports, Vector, protection, start_listening, vector_table};
use cortex_m_rt as _; // the reset code and the vectors

/// Priority bits of the NVIC that RTIC may use.
pub const NVIC_PRIO_BITS: u8 = 3;

/// The interrupts of the application.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub enum Interrupt {
    /// A byte of the receiver: UART0 RX.
    #[cfg(not(feature = "real-time"))]
    RECEIVER = 0,
    /// A byte of the receiver: timer 0.
    #[cfg(feature = "real-time")]
    RECEIVER = 8,
    /// A line of a sensor, and the alarm of the drivers: the dual timer.
    #[cfg(feature = "sensors")]
    SENSORS = 10,
    /// Pended by software to serve the drivers: the line of the SPI controllers, which are not used.
    #[cfg(feature = "sensors")]
    SAMPLER = 11,
    /// Pended by software to run the worker: the line of the Ethernet chip, which is not used.
    WORKER = 13,
}
pub use Interrupt as interrupt;

// SAFETY: the numbers are NVIC lines of the board, below the 32 of the vector table.
unsafe impl cortex_m::interrupt::InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
    }
}

/// The vectors after the exceptions.
// SAFETY: the name is the one cortex-m-rt keeps, the section the one it places after the
// exceptions; every entry is a handler.
#[unsafe(link_section = ".vector_table.interrupts")]
#[unsafe(no_mangle)]
pub static __INTERRUPTS: [Vector; 32] = vector_table(Interrupt::RECEIVER, Interrupt::WORKER);

/// Starts protection, timer and UARTs. For `init`, once.
pub fn start() -> Ports {
    // SAFETY: `init` runs once with interrupts masked, and no other code holds the peripherals.
    let mut core = unsafe { cortex_m::Peripherals::steal() };
    protection::start(&mut core.MPU);
    clock::start();
    start_listening(&mut core.SYST);
    #[cfg(feature = "sensors")]
    let (edges, alarm) = bridge::start();
    Ports {
        receiver: Receiver::start(),
        output: Transmitter::start(uart::OUTPUT),
        acknowledge: Acknowledge::start(),
        cycles: Cycles::start(),
        #[cfg(feature = "sensors")]
        edges,
        #[cfg(feature = "sensors")]
        alarm,
        #[cfg(feature = "sensors")]
        parts: super::parts::parts(),
    }
}

/// Does the work of an epoch. A host that sends as fast as it can waits meanwhile: the instructions of its
/// bytes' interrupts are no work of the epoch, and would be more of it the busier that machine is.
#[cfg(not(feature = "real-time"))]
pub fn undisturbed<R>(work: impl FnOnce() -> R) -> R {
    cortex_m::peripheral::NVIC::mask(Interrupt::RECEIVER);
    let result = work();
    // SAFETY: no critical section rests on the mask, which was off before.
    unsafe { cortex_m::peripheral::NVIC::unmask(Interrupt::RECEIVER) };
    result
}

/// Does the work of an epoch; bytes come meanwhile, as they do on a line.
#[cfg(feature = "real-time")]
pub fn undisturbed<R>(work: impl FnOnce() -> R) -> R {
    work()
}

/// No rate: a host replays faster than real time, and how long a byte waits says nothing.
#[cfg(not(feature = "real-time"))]
pub const fn ticks_per_second() -> Option<u32> {
    None
}

/// The log port; defmt's logger owns it.
pub(super) fn log_output() -> Transmitter {
    Transmitter::start(uart::LOG)
}

/// The output port, for a handler that never returns to whoever owned it.
pub fn emergency_output() -> Transmitter {
    Transmitter::start(uart::OUTPUT)
}
