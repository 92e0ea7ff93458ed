//! Registers of eight bits behind a byte of address: what three of the four drivers speak.

use embedded_hal::spi::{Operation, SpiDevice};

use super::{Fault, bus};

/// A bus with such a part on it.
pub(super) struct Registers<S> {
    spi: S,
}

impl<S: SpiDevice> Registers<S> {
    pub(super) fn new(spi: S) -> Self {
        Self { spi }
    }

    /// Reads registers that follow each other; `command` is the address with the part's bits for it.
    pub(super) fn read<const N: usize>(&mut self, command: u8) -> Result<[u8; N], Fault> {
        let mut bytes = [0; N];
        self.spi
            .transaction(&mut [Operation::Write(&[command]), Operation::Read(&mut bytes)])
            .map_err(bus)?;
        Ok(bytes)
    }

    /// Writes one register.
    pub(super) fn write(&mut self, command: u8, value: u8) -> Result<(), Fault> {
        self.spi.write(&[command, value]).map_err(bus)
    }
}
