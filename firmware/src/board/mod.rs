//! The board, chosen by feature. Every board offers the same names:
//!
//! | name | what it is |
//! |---|---|
//! | `NVIC_PRIO_BITS`, `Interrupt`, `interrupt` | what RTIC asks a device crate for; interrupts are named after their use |
//! | `start()` | clocks and UARTs on, code protected; hands out [`Ports`] |
//! | `Receiver` | bytes from the GNSS receiver, interrupt-driven |
//! | `Transmitter` | bytes out, waiting for room |
//! | `Acknowledge` | tells a sender that honours it how much was taken |
//! | `Cycles` | the cycle counter handed to core |
//! | `ticks()`, `ticks_per_second()` | a clock for the age of answers, wraps; no rate where time is not kept |
//! | `undisturbed()` | does the work of an epoch, without interrupts that are not a line's |
//! | `BAUD` | speed of the lines, on which bytes come and answers leave |
//! | `RECEIVE_DELAY` | longest time from a byte to its interrupt, bytes |
//! | `Bus`, `present()` | with sensors: `SpiDevice` of the part of a number; which are there |
//! | `Edges` | with sensors: lines that became active, interrupt-driven |
//! | `Alarm` | with sensors: interrupts when a driver wants to be served |
//! | `now_ns()` | with sensors: a clock that does not wrap, for their samples |
//! | `emergency_output()` | the output port for handlers that never return |

#[cfg(feature = "board-mps2")]
mod mps2;
#[cfg(feature = "board-mps2")]
pub use mps2::*;

#[cfg(feature = "board-h743")]
mod h743;
#[cfg(feature = "board-h743")]
pub use h743::*;

pub mod log;
pub mod memory;
#[cfg(feature = "sensors")]
mod parts;
mod protection;
pub mod stack;

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;

/// The devices of a started board, each with one owner.
pub struct Ports {
    /// Bytes of the GNSS receiver.
    pub receiver: Receiver,
    /// The output frames, with sentences between them.
    pub output: Transmitter,
    /// Flow control towards a host that replays faster than real time.
    pub acknowledge: Acknowledge,
    /// The cycle counter.
    pub cycles: Cycles,
    /// Lines of the sensors that become active.
    #[cfg(feature = "sensors")]
    pub edges: Edges,
    /// Interrupts when a driver wants to be served.
    #[cfg(feature = "sensors")]
    pub alarm: Alarm,
    /// The sensors.
    #[cfg(feature = "sensors")]
    pub parts: crate::sensors::Parts<'static>,
}

/// Interrupts of the system timer in a second: what a silent receiver is noticed later by.
const LISTENED_HZ: u32 = 100;

/// Starts the system timer, where time is kept.
fn start_listening(timer: &mut SYST) {
    let Some(reload) = ticks_per_second().and_then(|rate| (rate / LISTENED_HZ).checked_sub(1))
    else {
        return;
    };
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(reload);
    timer.clear_current();
    timer.enable_interrupt();
    timer.enable_counter();
}

/// One entry of the vector table.
#[derive(Clone, Copy)]
#[repr(C)]
pub union Vector {
    handler: unsafe extern "C" fn(),
    reserved: u32,
}

unsafe extern "C" {
    fn RECEIVER();
    fn WORKER();
    #[cfg(feature = "sensors")]
    fn SENSORS();
    #[cfg(feature = "sensors")]
    fn SAMPLER();
    fn DefaultHandler();
}

/// A table that sends the interrupts of the application to their handlers and all others to
/// cortex-m-rt's default handler.
const fn vector_table<const N: usize>(receiver: Interrupt, worker: Interrupt) -> [Vector; N] {
    let mut table = [Vector {
        handler: DefaultHandler,
    }; N];
    table[receiver as usize] = Vector { handler: RECEIVER };
    table[worker as usize] = Vector { handler: WORKER };
    #[cfg(feature = "sensors")]
    {
        table[Interrupt::SENSORS as usize] = Vector { handler: SENSORS };
        table[Interrupt::SAMPLER as usize] = Vector { handler: SAMPLER };
    }
    table
}
