//! USART3 both ways and USART2 out, with their FIFOs. RM0433 48.5, 48.7.

use super::clock::APB1_HZ;
use stm32h7::stm32h743::{Peripherals, USART2, USART3, usart1};

/// Line speed, Bd.
pub const BAUD: u32 = 921_600;

/// The receiver interrupts when its FIFO holds this many bytes …
const RECEIVE_TOGETHER: u32 = 8;
/// … or when there is one and the line has been silent for this many more.
const RECEIVE_TIMEOUT: u32 = 2;
/// Longest time from a byte to its interrupt, bytes.
pub const RECEIVE_DELAY: u32 = RECEIVE_TOGETHER + RECEIVE_TIMEOUT;

/// Pins, clocks and registers of both UARTs.
pub(super) fn start(chip: &Peripherals) {
    chip.RCC.ahb4enr().modify(|_, w| w.gpioden().set_bit());
    chip.RCC
        .apb1lenr()
        .modify(|_, w| w.usart2en().set_bit().usart3en().set_bit());
    // Reading back makes sure the clocks run before the first access. RM0433 8.5.11.
    let _ = chip.RCC.apb1lenr().read();

    // Alternate function 7 on PD5, PD8, PD9. DS12110 table 11.
    let pins = &chip.GPIOD;
    // SAFETY: 7 is an alternate function of each of the pins.
    pins.afrl().modify(|_, w| unsafe { w.afr5().bits(7) });
    // SAFETY: as above.
    pins.afrh()
        .modify(|_, w| unsafe { w.afr8().bits(7).afr9().bits(7) });
    // SAFETY: 0b10 is "alternate function".
    pins.moder().modify(|_, w| unsafe {
        w.moder5()
            .bits(0b10)
            .moder8()
            .bits(0b10)
            .moder9()
            .bits(0b10)
    });

    enable(&chip.USART2, false);
    enable(&chip.USART3, true);
}

fn enable(uart: &usart1::RegisterBlock, receives: bool) {
    // SAFETY: the divider is that of the line speed, within the register's 16 bits.
    uart.brr()
        .write(|w| unsafe { w.bits((APB1_HZ + BAUD / 2) / BAUD) });
    // SAFETY: 0b010 is a threshold of half the 16 bytes.
    uart.cr3().write(|w| {
        unsafe { w.rxftcfg().bits(0b010) };
        w.rxftie().bit(receives)
    });
    // SAFETY: a time in bits, within the register's 24.
    uart.rtor()
        .write(|w| unsafe { w.rto().bits(10 * RECEIVE_TIMEOUT) });
    uart.cr2().write(|w| w.rtoen().bit(receives));
    uart.cr1().write(|w| {
        w.fifoen().set_bit();
        w.te().set_bit();
        w.re().bit(receives);
        w.rtoie().bit(receives)
    });
    uart.cr1().modify(|_, w| w.ue().set_bit());
}

#[derive(Clone, Copy)]
enum Port {
    /// USART3: receiver bytes in, output frames out.
    ReceiverAndOutput,
    /// USART2: the log.
    Log,
}

impl Port {
    #[inline(always)]
    fn registers(self) -> &'static usart1::RegisterBlock {
        // SAFETY: the addresses of the peripherals. The receiver uses the receive side alone, each
        // transmitter its transmit side, and no register is read-modify-written after `start`.
        unsafe {
            match self {
                Self::ReceiverAndOutput => &*USART3::ptr(),
                Self::Log => &*USART2::ptr(),
            }
        }
    }
}

/// Bytes of the GNSS receiver.
pub struct Receiver {
    _owner: (),
}

impl Receiver {
    pub(super) fn new() -> Self {
        Self { _owner: () }
    }

    /// In the interrupt: takes a byte, until there is none.
    #[inline]
    pub fn take(&mut self) -> Option<u8> {
        let uart = Port::ReceiverAndOutput.registers();
        uart.icr().write(|w| w.rtocf().clear_bit_by_one());
        (uart.isr().read().rxne().bit_is_set()).then(|| uart.rdr().read().bits() as u8)
    }

    /// Whether the hardware lost a byte since the last call.
    #[inline]
    pub fn overrun(&mut self) -> bool {
        let uart = Port::ReceiverAndOutput.registers();
        let lost = uart.isr().read().ore().bit_is_set();
        if lost {
            uart.icr().write(|w| w.orecf().clear_bit_by_one());
        }
        lost
    }
}

/// A UART that sends.
pub struct Transmitter {
    port: Port,
}

impl Transmitter {
    pub(super) fn output() -> Self {
        Self {
            port: Port::ReceiverAndOutput,
        }
    }

    pub(super) fn log() -> Self {
        Self { port: Port::Log }
    }

    /// Sends all bytes, waiting for room.
    pub fn send(&mut self, bytes: &[u8]) {
        let uart = self.port.registers();
        for byte in bytes {
            while uart.isr().read().txe().bit_is_clear() {}
            // SAFETY: eight data bits fit the register.
            uart.tdr().write(|w| unsafe { w.bits(u32::from(*byte)) });
        }
    }

    /// Waits until the last byte has left.
    pub fn flush(&mut self) {
        while self.port.registers().isr().read().tc().bit_is_clear() {}
    }
}

/// No receiver in the field listens to acknowledgements.
pub struct Acknowledge;

impl Acknowledge {
    /// `count` more bytes were taken from the ring.
    pub fn taken(&mut self, _count: usize) {}
}
