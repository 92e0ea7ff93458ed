//! STM32H743ZI on a NUCLEO-H743ZI2: a Cortex-M7 at 480 MHz with double-precision FPU.
//!
//! | port | pins | use |
//! |---|---|---|
//! | USART3 | PD9 in, PD8 out, to the ST-Link's serial port | receiver bytes in, output frames out |
//! | USART2 | PD5 out, Zio connector | defmt log |
//! | SPI1 and lines | sensors/ | with the feature `sensors`: inertial units |
//!
//! Sources: RM0433 (reference manual), DS12110 (data sheet, alternate functions), UM2407 (board).
//! The image links and its sections are checked; it has not run on a board yet.

mod clock;
#[cfg(feature = "sensors")]
mod sensors;
mod start;
mod uart;

pub use clock::{Cycles, ticks, ticks_per_second};
#[cfg(feature = "sensors")]
pub use sensors::{Alarm, Bus, Edges, now_ns, present};
pub use uart::{Acknowledge, BAUD, RECEIVE_DELAY, Receiver, Transmitter};

use super::{Ports, Vector, protection, start_listening, vector_table};
use cortex_m_rt as _; // the reset code and the vectors

/// Priority bits of the NVIC. RM0433 19.1.
pub const NVIC_PRIO_BITS: u8 = 4;

/// The interrupts of the application. RM0433 table 147.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub enum Interrupt {
    /// A byte of the receiver: USART3.
    RECEIVER = 39,
    /// A line of a sensor: EXTI 10 to 15.
    #[cfg(feature = "sensors")]
    SENSORS = 40,
    /// Serves the drivers: TIM2, and pended by software.
    #[cfg(feature = "sensors")]
    SAMPLER = 28,
    /// Pended by software to run the worker: the line of HDMI-CEC, which is not used.
    WORKER = 94,
}
pub use Interrupt as interrupt;

// SAFETY: the numbers are NVIC lines of the chip, below the 150 of the vector table.
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
pub static __INTERRUPTS: [Vector; 150] = vector_table(Interrupt::RECEIVER, Interrupt::WORKER);

/// Starts protection, caches, clocks, cycle counter and UARTs. For `init`, once.
pub fn start() -> Ports {
    // SAFETY: `init` runs once with interrupts masked, and no other code holds the peripherals.
    let (mut core, chip) = unsafe {
        (
            cortex_m::Peripherals::steal(),
            stm32h7::stm32h743::Peripherals::steal(),
        )
    };
    protection::start(&mut core.MPU);
    core.SCB.enable_icache();
    core.SCB.enable_dcache(&mut core.CPUID);
    clock::start(&chip);
    clock::start_counter(&mut core);
    start_listening(&mut core.SYST);
    uart::start(&chip);
    #[cfg(feature = "sensors")]
    let (edges, alarm) = sensors::start(&chip);
    Ports {
        receiver: Receiver::new(),
        output: Transmitter::output(),
        acknowledge: Acknowledge,
        cycles: Cycles,
        #[cfg(feature = "sensors")]
        edges,
        #[cfg(feature = "sensors")]
        alarm,
        #[cfg(feature = "sensors")]
        parts: super::parts::parts(),
    }
}

/// Does the work of an epoch; bytes come meanwhile.
pub fn undisturbed<R>(work: impl FnOnce() -> R) -> R {
    work()
}

/// The log port.
pub(super) fn log_output() -> Transmitter {
    Transmitter::log()
}

/// The output port, for a handler that never returns to whoever owned it.
pub fn emergency_output() -> Transmitter {
    Transmitter::output()
}
