//! A part as an `SpiDevice`.

use std::cell::RefCell;
use std::rc::Rc;

use embedded_hal::spi::{Error, ErrorKind, ErrorType, Operation, SpiDevice};

use super::Part;

/// The wires to a part that the test holds as well.
pub struct Bus<P>(Rc<RefCell<P>>);

impl<P: Part> Bus<P> {
    /// Wires to a part.
    pub fn new(part: &Rc<RefCell<P>>) -> Self {
        Self(Rc::clone(part))
    }
}

/// The error of a bus that is at fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusError;

impl Error for BusError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Overrun
    }
}

impl<P> ErrorType for Bus<P> {
    type Error = BusError;
}

impl<P: Part> SpiDevice for Bus<P> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), BusError> {
        let mut part = self.0.borrow_mut();
        if part.faults().is_bus_error() {
            return Err(BusError);
        }
        let mut mosi = Vec::new();
        let mut pause_ns = 0;
        for operation in operations.iter() {
            match operation {
                Operation::Read(bytes) => mosi.resize(mosi.len() + bytes.len(), 0),
                Operation::Write(bytes) => mosi.extend_from_slice(bytes),
                Operation::TransferInPlace(bytes) => mosi.extend_from_slice(bytes),
                Operation::Transfer(read, write) => {
                    let end = mosi.len() + read.len().max(write.len());
                    mosi.extend_from_slice(write);
                    mosi.resize(end, 0);
                }
                Operation::DelayNs(ns) => pause_ns += u64::from(*ns),
            }
        }
        let mut miso = vec![0; mosi.len()];
        part.transfer(&mosi, &mut miso);
        part.pause(pause_ns);
        let mut rest = miso.as_slice();
        for operation in operations.iter_mut() {
            let (length, into): (usize, Option<&mut [u8]>) = match operation {
                Operation::Read(bytes) => (bytes.len(), Some(bytes)),
                Operation::Write(bytes) => (bytes.len(), None),
                Operation::TransferInPlace(bytes) => (bytes.len(), Some(bytes)),
                Operation::Transfer(read, write) => (read.len().max(write.len()), Some(read)),
                Operation::DelayNs(_) => (0, None),
            };
            let (these, after) = rest.split_at(length);
            if let Some(into) = into {
                into.copy_from_slice(&these[..into.len()]);
            }
            rest = after;
        }
        Ok(())
    }
}
