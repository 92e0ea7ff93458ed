//! Sensors on SPI1, their data-ready lines, and the clock that stamps them.
//!
//! | signal | pin | connector of the board |
//! |---|---|---|
//! | SCK, MISO, MOSI | PA5, PA6, PB5 | D13, D12, D11 |
//! | chip selects of units 0, 1, 2 | PD14, PD15, PF12 | D10, D9, D8 |
//! | data-ready of units 0, 1, 2 | PE11, PE13, PF14 | D5, D3, D4 |
//! | time pulse of the receiver | PF15 | D2 |
//!
//! All lines interrupt on their rising edge, in the one interrupt of EXTI lines 10 to 15.
//!
//! Sources: RM0433 50 (SPI), 20 (EXTI), 12.3 (SYSCFG), 43 (TIM2), 11 (GPIO); DS12110 alternate functions;
//! UM2407 (board). It has not run on a board yet.

mod edges;
mod spi;

pub use edges::{Alarm, Edges, now_ns};
pub use spi::{Bus, present};

use stm32h7::stm32h743::Peripherals;

/// Pins, clocks and registers of bus, lines and clock. For `init`, once.
pub(super) fn start(chip: &Peripherals) -> (Edges, Alarm) {
    chip.RCC.ahb4enr().modify(|_, w| {
        w.gpioaen()
            .set_bit()
            .gpioben()
            .set_bit()
            .gpioden()
            .set_bit()
            .gpioeen()
            .set_bit()
            .gpiofen()
            .set_bit()
    });
    // Reading back makes sure the clocks run before the first access. RM0433 8.5.11.
    let _ = chip.RCC.ahb4enr().read();
    spi::start(chip);
    edges::start(chip)
}
