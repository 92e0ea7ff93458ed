//! CMSDK UARTs. ARM DDI 0479, 4.3.
//!
//! QEMU's model takes one byte and tells the host side to wait until it is read: a slow guest
//! throttles, it never overruns. The overrun bit is read all the same, as on a real board.

use core::ptr::{read_volatile, write_volatile};

#[cfg(not(feature = "real-time"))]
const RECEIVER: usize = 0x4000_4000;
pub(super) const OUTPUT: usize = 0x4000_5000;
pub(super) const LOG: usize = 0x4000_6000;
const ACKNOWLEDGE: usize = 0x4000_7000;

const DATA: usize = 0x00;
const STATE: usize = 0x04;
const CTRL: usize = 0x08;
#[cfg(not(feature = "real-time"))]
const INTSTATUS: usize = 0x0C;
const BAUDDIV: usize = 0x10;

const STATE_TX_FULL: u32 = 1 << 0;
#[cfg(not(feature = "real-time"))]
const STATE_RX_FULL: u32 = 1 << 1;
#[cfg(not(feature = "real-time"))]
const STATE_RX_OVERRUN: u32 = 1 << 3;
const CTRL_TX_ENABLE: u32 = 1 << 0;
#[cfg(not(feature = "real-time"))]
const CTRL_RX_ENABLE: u32 = 1 << 1;
#[cfg(not(feature = "real-time"))]
const CTRL_RX_INTERRUPT: u32 = 1 << 3;
#[cfg(not(feature = "real-time"))]
const INTSTATUS_RX: u32 = 1 << 1;
/// Speed of the lines that an emulated board stands for, Bd: those of the STM32H743.
pub const BAUD: u32 = 921_600;
/// A byte interrupts at once.
#[cfg(not(feature = "real-time"))]
pub const RECEIVE_DELAY: u32 = 0;
/// The least divider the hardware allows: the emulated line has no speed.
const FASTEST: u32 = 16;

#[inline]
fn read(base: usize, register: usize) -> u32 {
    // SAFETY: `base` is one of the four UARTs above and `register` one of its five registers.
    unsafe { read_volatile((base + register) as *const u32) }
}

#[inline]
fn write(base: usize, register: usize, value: u32) {
    // SAFETY: as in `read`; the values written only drive the UART.
    unsafe { write_volatile((base + register) as *mut u32, value) }
}

/// Bytes of the GNSS receiver.
#[cfg(not(feature = "real-time"))]
pub struct Receiver {
    _owner: (),
}

#[cfg(not(feature = "real-time"))]
impl Receiver {
    pub(super) fn start() -> Self {
        write(RECEIVER, BAUDDIV, FASTEST);
        write(RECEIVER, CTRL, CTRL_RX_ENABLE | CTRL_RX_INTERRUPT);
        Self { _owner: () }
    }

    /// In the interrupt: acknowledges it and takes a byte, until there is none.
    #[inline]
    pub fn take(&mut self) -> Option<u8> {
        write(RECEIVER, INTSTATUS, INTSTATUS_RX);
        (read(RECEIVER, STATE) & STATE_RX_FULL != 0).then(|| read(RECEIVER, DATA) as u8)
    }

    /// Whether the hardware lost a byte since the last call.
    #[inline]
    pub fn overrun(&mut self) -> bool {
        let lost = read(RECEIVER, STATE) & STATE_RX_OVERRUN != 0;
        if lost {
            write(RECEIVER, STATE, STATE_RX_OVERRUN);
        }
        lost
    }
}

/// A UART that sends.
pub struct Transmitter {
    base: usize,
}

impl Transmitter {
    pub(super) fn start(base: usize) -> Self {
        write(base, BAUDDIV, FASTEST);
        write(base, CTRL, CTRL_TX_ENABLE);
        Self { base }
    }

    /// Sends all bytes, waiting for room.
    pub fn send(&mut self, bytes: &[u8]) {
        for byte in bytes {
            while read(self.base, STATE) & STATE_TX_FULL != 0 {}
            write(self.base, DATA, u32::from(*byte));
        }
    }

    /// Waits until the last byte has left.
    pub fn flush(&mut self) {
        while read(self.base, STATE) & STATE_TX_FULL != 0 {}
    }
}

/// Bytes of the stream that one acknowledgement stands for.
const BYTES_PER_ACKNOWLEDGEMENT: u32 = 256;

/// One byte out for every 256 taken from the ring. A receiver in the field knows nothing of it; the
/// host that replays a day in a minute keeps its distance by it.
pub struct Acknowledge {
    port: Transmitter,
    pending: u32,
}

impl Acknowledge {
    pub(super) fn start() -> Self {
        Self {
            port: Transmitter::start(ACKNOWLEDGE),
            pending: 0,
        }
    }

    /// In real time, where nobody listens to acknowledgements: a line of numbers, after a letter that
    /// says what they are.
    #[cfg(feature = "real-time")]
    pub fn tell(&mut self, what: u8, numbers: &[u32]) {
        self.port.send(&[what, numbers.len() as u8]);
        for number in numbers {
            self.port.send(&number.to_le_bytes());
        }
    }

    /// `count` more bytes were taken from the ring.
    pub fn taken(&mut self, count: usize) {
        if cfg!(feature = "real-time") {
            return;
        }
        self.pending += count as u32;
        while self.pending >= BYTES_PER_ACKNOWLEDGEMENT {
            self.pending -= BYTES_PER_ACKNOWLEDGEMENT;
            self.port.send(b"+");
        }
    }
}
