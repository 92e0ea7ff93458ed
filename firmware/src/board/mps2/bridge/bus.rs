//! Requests to the host, and the `SpiDevice` made of them.

use super::files::File;
use crate::board::now_ns;
use core::cell::RefCell;
use cortex_m::interrupt::Mutex;
use embedded_hal::spi::{ErrorKind, ErrorType, Operation, SpiDevice};

/// Bytes before those of a transfer.
const HEADER: usize = 12;
/// Longest transaction, bytes.
const MAX_TRANSFER: usize = 512;

struct Pipes {
    request: File,
    response: File,
}

/// Used by two interrupts: an exchange must not be interrupted by another. No time passes in it.
static PIPES: Mutex<RefCell<Option<Pipes>>> = Mutex::new(RefCell::new(None));

/// Opens the pipes, in the order in which the host does.
pub fn start() {
    let pipes = File::create(c"spi-request")
        .zip(File::open(c"spi-response"))
        .map(|(request, response)| Pipes { request, response });
    if pipes.is_none() {
        defmt::error!("there is no host at the other end of the bus");
    }
    cortex_m::interrupt::free(|token| PIPES.borrow(token).replace(pipes));
}

/// A request with the bytes that follow its head, in place of which the answer comes; false when nobody
/// answers.
fn exchange(what: u8, part: u8, request: &mut [u8; HEADER + MAX_TRANSFER], length: usize) -> bool {
    let [low, high] = (length as u16).to_le_bytes();
    request[..4].copy_from_slice(&[what, part, low, high]);
    request[4..HEADER].copy_from_slice(&now_ns().to_le_bytes());
    cortex_m::interrupt::free(|token| {
        let mut pipes = PIPES.borrow(token).borrow_mut();
        let Some(pipes) = pipes.as_mut() else {
            return false;
        };
        let answer = match what {
            PRESENT => PRESENT_ANSWER,
            EDGES => EDGES_ANSWER,
            _ => length,
        };
        request
            .get(..HEADER + length)
            .is_some_and(|sent| pipes.request.write(sent))
            && request
                .get_mut(HEADER..HEADER + answer)
                .is_some_and(|answer| pipes.response.read(answer))
    })
}

const TRANSFER: u8 = b'T';
const EDGES: u8 = b'E';
const EDGES_ANSWER: usize = 12;
const PRESENT: u8 = b'P';
const PRESENT_ANSWER: usize = 4;

/// The parts that are there, a bit each.
pub fn present() -> u32 {
    let mut request = [0; HEADER + MAX_TRANSFER];
    if !exchange(PRESENT, 0, &mut request, 0) {
        return 0;
    }
    let parts = request[HEADER..].first_chunk();
    parts.map_or(0, |parts| u32::from_le_bytes(*parts))
}

/// Lines that became active, a bit each, and when one may become active next, ns.
pub fn edges() -> Option<(u32, u64)> {
    let mut request = [0; HEADER + MAX_TRANSFER];
    if !exchange(EDGES, 0, &mut request, 0) {
        return None;
    }
    let (lines, rest) = request[HEADER..].split_first_chunk()?;
    let next = rest.first_chunk()?;
    Some((u32::from_le_bytes(*lines), u64::from_le_bytes(*next)))
}

/// A part on the bus, with a chip select of its own.
pub struct Bus {
    part: u8,
    bit_ns: u32,
}

impl Bus {
    /// The part of a number, with a clock of `bit_ns` per bit.
    pub const fn new(part: u8, bit_ns: u32) -> Self {
        Self { part, bit_ns }
    }
}

/// Spends time, as a bus that is waited for does.
fn wait_ns(ns: u32) {
    let begin_ns = now_ns();
    while now_ns() - begin_ns < u64::from(ns) {}
}

impl ErrorType for Bus {
    type Error = ErrorKind;
}

impl SpiDevice for Bus {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        let mut bytes = [0; HEADER + MAX_TRANSFER];
        let (mut length, mut pause_ns) = (0, 0);
        for operation in operations.iter() {
            let (shifted, out): (usize, &[u8]) = match operation {
                Operation::Read(read) => (read.len(), &[]),
                Operation::Write(write) => (write.len(), write),
                Operation::Transfer(read, write) => (read.len().max(write.len()), write),
                Operation::TransferInPlace(both) => (both.len(), both),
                Operation::DelayNs(ns) => {
                    pause_ns += ns;
                    continue;
                }
            };
            let place = bytes
                .get_mut(HEADER + length..HEADER + length + shifted)
                .ok_or(ErrorKind::Other)?;
            place.iter_mut().zip(out).for_each(|(to, from)| *to = *from);
            length += shifted;
        }
        if !exchange(TRANSFER, self.part, &mut bytes, length) {
            return Err(ErrorKind::Other);
        }
        wait_ns(length as u32 * 8 * self.bit_ns + pause_ns);
        let mut rest = &bytes[HEADER..];
        for operation in operations.iter_mut() {
            let (shifted, into): (usize, &mut [u8]) = match operation {
                Operation::Read(read) => (read.len(), read),
                Operation::Write(write) => (write.len(), &mut []),
                Operation::Transfer(read, write) => (read.len().max(write.len()), read),
                Operation::TransferInPlace(both) => (both.len(), both),
                Operation::DelayNs(_) => continue,
            };
            into.iter_mut().zip(rest).for_each(|(to, from)| *to = *from);
            rest = rest.get(shifted..).unwrap_or_default();
        }
        Ok(())
    }
}
