//! SPI1 as the bus of the sensors, one byte at a time and waited for. RM0433 50.4.9, 50.11.

use crate::board::ticks;
use embedded_hal::spi::{ErrorKind, ErrorType, Operation, SpiDevice};
use stm32h7::stm32h743::{GPIOD, GPIOF, Peripherals, SPI1};

/// Kernel clock of the bus: the internal oscillator, Hz. RM0433 8.7.19, SPI123SEL.
const KERNEL_HZ: u32 = 64_000_000;
const SPI123SEL_PER_CK: u32 = 4 << 12;
const SPI123SEL: u32 = 7 << 12;

const CR1_SPE: u32 = 1 << 0;
const CR1_CSTART: u32 = 1 << 9;
const CR1_SSI: u32 = 1 << 12;
const CFG1_DSIZE_8: u32 = 8 - 1;
const CFG1_MBR: u32 = 28;
/// Mode 3, which all parts speak, with a chip select by software and the pins held between transfers.
const CFG2: u32 = CFG2_MASTER | CFG2_CPHA | CFG2_CPOL | CFG2_SSM | CFG2_AFCNTR;
const CFG2_MASTER: u32 = 1 << 22;
const CFG2_CPHA: u32 = 1 << 24;
const CFG2_CPOL: u32 = 1 << 25;
const CFG2_SSM: u32 = 1 << 26;
const CFG2_AFCNTR: u32 = 1 << 31;
const SR_RXP: u32 = 1 << 0;
const SR_TXP: u32 = 1 << 1;
const SR_EOT: u32 = 1 << 3;
/// End of transfer, transmission filled, underrun, overrun, mode fault.
const IFCR_ALL: u32 = 0b11 << 3 | 0b11 << 5 | 1 << 9;

/// Longest time for a byte, CPU cycles: 200 µs, ten times that of a byte at 500 kHz.
const PATIENCE: u32 = 96_000;
/// CPU cycles in a microsecond.
const CYCLES_PER_US: u32 = 480;

/// Pins and clock.
pub fn start(chip: &Peripherals) {
    let clocks = &chip.RCC;
    // SAFETY: 4 is the peripheral clock, which is the internal oscillator after reset.
    clocks
        .d2ccip1r()
        .modify(|r, w| unsafe { w.bits(r.bits() & !SPI123SEL | SPI123SEL_PER_CK) });
    clocks.apb2enr().modify(|_, w| w.spi1en().set_bit());
    let _ = clocks.apb2enr().read();

    // High before they are outputs: no part is selected.
    // SAFETY: bits 0 to 15 of BSRR set pins.
    chip.GPIOD
        .bsrr()
        .write(|w| unsafe { w.bits(1 << 14 | 1 << 15) });
    // SAFETY: as above.
    chip.GPIOF.bsrr().write(|w| unsafe { w.bits(1 << 12) });
    // SAFETY: 5 is the alternate function of SPI1 on these pins, 0b10 alternate function, 0b01 output.
    unsafe {
        chip.GPIOA
            .afrl()
            .modify(|_, w| w.afr5().bits(5).afr6().bits(5));
        chip.GPIOB.afrl().modify(|_, w| w.afr5().bits(5));
        chip.GPIOA
            .moder()
            .modify(|_, w| w.moder5().bits(0b10).moder6().bits(0b10));
        chip.GPIOB.moder().modify(|_, w| w.moder5().bits(0b10));
        chip.GPIOD
            .moder()
            .modify(|_, w| w.moder14().bits(0b01).moder15().bits(0b01));
        chip.GPIOF.moder().modify(|_, w| w.moder12().bits(0b01));
    }
}

/// The parts that are there, a bit each: three units.
pub const fn present() -> u32 {
    0b111
}

/// A part on the bus, with a chip select of its own.
pub struct Bus {
    part: u8,
    /// Divider of the kernel clock, as the register has it.
    divider: u32,
}

impl Bus {
    /// The part of a number, with a clock of at least `bit_ns` per bit.
    pub const fn new(part: u8, bit_ns: u32) -> Self {
        // Dividers are 2 to 256 in powers of 2.
        let least = bit_ns as u64 * KERNEL_HZ as u64 / 1_000_000_000;
        let mut divider = 0;
        while divider < 7 && (2 << divider) < least {
            divider += 1;
        }
        Self { part, divider }
    }

    fn select(&self, is_selected: bool) {
        let (pin, is_on_d) = match self.part {
            0 => (14, true),
            1 => (15, true),
            _ => (12, false),
        };
        let bit = 1 << if is_selected { pin + 16 } else { pin };
        // SAFETY: BSRR changes this pin alone; the pin is the chip select of this part.
        unsafe {
            if is_on_d {
                (*GPIOD::ptr()).bsrr().write(|w| w.bits(bit));
            } else {
                (*GPIOF::ptr()).bsrr().write(|w| w.bits(bit));
            }
        }
    }
}

impl ErrorType for Bus {
    type Error = ErrorKind;
}

impl SpiDevice for Bus {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        let length: usize = operations
            .iter()
            .map(|operation| match operation {
                Operation::Read(read) => read.len(),
                Operation::Write(write) => write.len(),
                Operation::Transfer(read, write) => read.len().max(write.len()),
                Operation::TransferInPlace(both) => both.len(),
                Operation::DelayNs(_) => 0,
            })
            .sum();
        let length = u16::try_from(length).map_err(|_| ErrorKind::Other)?;
        let bus = Enabled::start(self.divider, length);
        self.select(true);
        let mut done = Ok(());
        for operation in operations {
            done = match operation {
                Operation::Read(read) => read.iter_mut().try_for_each(|byte| {
                    *byte = bus.exchange(0)?;
                    Ok(())
                }),
                Operation::Write(write) => write
                    .iter()
                    .try_for_each(|byte| bus.exchange(*byte).map(|_| ())),
                Operation::Transfer(read, write) => {
                    let length = read.len().max(write.len());
                    (0..length).try_for_each(|place| {
                        let sent = write.get(place).copied().unwrap_or(0);
                        let received = bus.exchange(sent)?;
                        if let Some(byte) = read.get_mut(place) {
                            *byte = received;
                        }
                        Ok(())
                    })
                }
                Operation::TransferInPlace(both) => both.iter_mut().try_for_each(|byte| {
                    *byte = bus.exchange(*byte)?;
                    Ok(())
                }),
                Operation::DelayNs(ns) => {
                    wait(ns.div_ceil(1000) * CYCLES_PER_US);
                    Ok(())
                }
            };
            if done.is_err() {
                break;
            }
        }
        let ended = if length > 0 && done.is_ok() {
            Enabled::wait_for(SR_EOT)
        } else {
            done
        };
        self.select(false);
        drop(bus);
        ended
    }
}

fn wait(cycles: u32) {
    let begin = ticks();
    while ticks().wrapping_sub(begin) < cycles {}
}

/// The controller while it is on; off when dropped.
struct Enabled {
    _owner: (),
}

impl Enabled {
    /// Registers of the bus.
    fn registers() -> &'static stm32h7::stm32h743::spi1::RegisterBlock {
        // SAFETY: the address of the peripheral, which the one task that talks to sensors uses.
        unsafe { &*SPI1::ptr() }
    }

    fn start(divider: u32, length: u16) -> Self {
        let spi = Self::registers();
        // SAFETY: values of the fields named above; the controller is off while they change.
        unsafe {
            spi.cfg1()
                .write(|w| w.bits(CFG1_DSIZE_8 | divider << CFG1_MBR));
            spi.cfg2().write(|w| w.bits(CFG2));
            spi.cr2().write(|w| w.bits(length.into()));
            spi.ifcr().write(|w| w.bits(IFCR_ALL));
            spi.cr1().write(|w| w.bits(CR1_SSI));
            spi.cr1().write(|w| w.bits(CR1_SSI | CR1_SPE));
            spi.cr1().write(|w| w.bits(CR1_SSI | CR1_SPE | CR1_CSTART));
        }
        Self { _owner: () }
    }

    /// Waits until one of `flags` is set.
    fn wait_for(flags: u32) -> Result<(), ErrorKind> {
        let begin = ticks();
        while Self::registers().sr().read().bits() & flags == 0 {
            if ticks().wrapping_sub(begin) > PATIENCE {
                return Err(ErrorKind::Other);
            }
        }
        Ok(())
    }

    /// A byte out and the one that comes in meanwhile.
    fn exchange(&self, byte: u8) -> Result<u8, ErrorKind> {
        let spi = Self::registers();
        Self::wait_for(SR_TXP)?;
        // SAFETY: an access of eight bits puts one byte into the FIFO. RM0433 50.4.13.
        unsafe { core::ptr::write_volatile(spi.txdr().as_ptr().cast::<u8>(), byte) };
        Self::wait_for(SR_RXP)?;
        // SAFETY: an access of eight bits takes one byte out of the FIFO.
        Ok(unsafe { core::ptr::read_volatile(spi.rxdr().as_ptr().cast::<u8>()) })
    }
}

impl Drop for Enabled {
    fn drop(&mut self) {
        let spi = Self::registers();
        // After its end, or after an error: what is under way is given up.
        // SAFETY: off, with the internal chip select high.
        unsafe { spi.cr1().write(|w| w.bits(CR1_SSI)) };
    }
}
