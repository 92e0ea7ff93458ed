//! 480 MHz from the 8 MHz clock that the ST-Link puts out, and the cycle counter.
//!
//! | clock | MHz | from |
//! |---|---|---|
//! | HSE | 8 | ST-Link MCO, bypass |
//! | PLL1 reference | 2 | HSE / 4 |
//! | PLL1 VCO | 960 | × 480 |
//! | CPU | 480 | PLL1 P, VCO / 2 |
//! | AXI, AHB, AXI SRAM | 240 | CPU / 2 |
//! | APB1 (USART2, USART3) | 120 | AHB / 2 |

use cortex_m::peripheral::DWT;
use stm32h7::stm32h743::Peripherals;
use surefix_core::budget::CycleCounter;

/// Clock of the UARTs, Hz.
pub(super) const APB1_HZ: u32 = 120_000_000;

/// Raises the core voltage, then the clock. RM0433 6.6.2 (voltage scaling), 8.5 (clocks), 4.3.8
/// (flash wait states).
pub(super) fn start(chip: &Peripherals) {
    let (power, clocks, flash) = (&chip.PWR, &chip.RCC, &chip.FLASH);

    // The LDO supplies the core; the register takes one write after power-on.
    power
        .cr3()
        .modify(|_, w| w.scuen().set_bit().ldoen().set_bit().bypass().clear_bit());
    while power.csr1().read().actvosrdy().bit_is_clear() {}
    // VOS1 first, then the overdrive to VOS0 that 480 MHz needs.
    // SAFETY: 0b11 is VOS1, a value of the field.
    power.d3cr().modify(|_, w| unsafe { w.vos().bits(0b11) });
    while power.d3cr().read().vosrdy().bit_is_clear() {}
    clocks.apb4enr().modify(|_, w| w.syscfgen().set_bit());
    chip.SYSCFG.pwrcr().modify(|_, w| w.oden().set_bit());
    while power.d3cr().read().vosrdy().bit_is_clear() {}

    clocks
        .cr()
        .modify(|_, w| w.hsebyp().set_bit().hseon().set_bit());
    while clocks.cr().read().hserdy().bit_is_clear() {}

    // SAFETY: source 2 is HSE, divider 4 gives the 2 MHz reference.
    clocks
        .pllckselr()
        .modify(|_, w| unsafe { w.pllsrc().bits(2).divm1().bits(4) });
    // SAFETY: range 1 is 2 to 4 MHz; the wide VCO is bit value 0.
    clocks.pllcfgr().modify(|_, w| unsafe {
        w.pll1rge()
            .bits(1)
            .pll1vcosel()
            .clear_bit()
            .pll1fracen()
            .clear_bit()
            .divp1en()
            .set_bit()
            .divq1en()
            .clear_bit()
            .divr1en()
            .clear_bit()
    });
    // SAFETY: multiplier 480 and divider 2, each written as one less.
    clocks
        .pll1divr()
        .write(|w| unsafe { w.divn1().bits(480 - 1).divp1().bits(2 - 1) });
    clocks.cr().modify(|_, w| w.pll1on().set_bit());
    while clocks.cr().read().pll1rdy().bit_is_clear() {}

    // Dividers and wait states before the switch.
    // SAFETY: 0b1000 divides the bus by 2, 0b100 divides the peripheral buses by 2, 0 leaves the CPU.
    clocks
        .d1cfgr()
        .modify(|_, w| unsafe { w.d1cpre().bits(0).hpre().bits(0b1000).d1ppre().bits(0b100) });
    // SAFETY: as above.
    clocks
        .d2cfgr()
        .modify(|_, w| unsafe { w.d2ppre1().bits(0b100).d2ppre2().bits(0b100) });
    // SAFETY: as above.
    clocks
        .d3cfgr()
        .modify(|_, w| unsafe { w.d3ppre().bits(0b100) });
    // SAFETY: 4 wait states and signal delay 2 are what 240 MHz at VOS0 needs.
    flash
        .acr()
        .write(|w| unsafe { w.latency().bits(4).wrhighfreq().bits(2) });
    while flash.acr().read().latency().bits() != 4 {}

    // SAFETY: 3 is PLL1 P.
    clocks.cfgr().modify(|_, w| unsafe { w.sw().bits(3) });
    while clocks.cfgr().read().sws().bits() != 3 {}
}

/// CPU clock, Hz.
const CPU_HZ: u32 = 480_000_000;

/// CPU cycles, modulo 2³²: nine seconds.
#[inline]
pub fn ticks() -> u32 {
    DWT::cycle_count()
}

/// Ticks in a second.
pub const fn ticks_per_second() -> Option<u32> {
    Some(CPU_HZ)
}

/// Starts the DWT's cycle counter.
pub(super) fn start_counter(core: &mut cortex_m::Peripherals) {
    core.DCB.enable_trace();
    DWT::unlock();
    core.DWT.enable_cycle_counter();
}

/// The cycle counter handed to core: CPU cycles at 480 MHz.
#[derive(Clone, Copy, Debug)]
pub struct Cycles;

impl CycleCounter for Cycles {
    #[inline]
    fn now(&mut self) -> u32 {
        DWT::cycle_count()
    }
}
