//! Receiver bytes at the times at which a line would bring them, in the board's own time.
//!
//! What UART0 brings comes when the host gets round to it, which no deadline can be held against.
//! Here the whole stream lies in PSRAM before the start, each piece with the time at which its first bit
//! is on the line, and timer 0 interrupts when the FIFO of an STM32H743 would. Under `-icount` a run
//! repeats to the instruction.
//!
//! | word | content, little endian |
//! |---|---|
//! | 0 | [`MAGIC`] |
//! | 1 | ticks of the board's 25 MHz that stand for one second |
//! | 2 | time of one byte on the line, ticks / 256 |
//! | then, per piece, 2 | start, ticks since the board started, low word first |
//! | 1 | bytes; 0 ends the stream |
//! | … | the bytes, filled up to whole words |
//!
//! Sources: ARM DAI 0500 (AN500) memory map; ARM DDI 0479 (CMSDK) 4.1 timer.

use super::clock::ticks;
use core::ptr::{read_volatile, write_volatile};

const PSRAM: usize = 0x6000_0000;
/// "SFLN".
const MAGIC: u32 = u32::from_le_bytes(*b"SFLN");
const HEADER: usize = 12;

const TIMER0: usize = 0x4000_0000;
const CTRL: *mut u32 = TIMER0 as *mut u32;
const VALUE: *mut u32 = (TIMER0 + 4) as *mut u32;
const RELOAD: *mut u32 = (TIMER0 + 8) as *mut u32;
const INTCLEAR: *mut u32 = (TIMER0 + 12) as *mut u32;
const CTRL_ENABLE: u32 = 1 << 0;
const CTRL_INTERRUPT: u32 = 1 << 3;

/// Bytes that the hardware keeps until they are taken: the FIFO of an STM32H743's USART.
const FIFO: u64 = 16;
/// It interrupts when it holds this many, as the STM32H743's driver asks for …
const TOGETHER: u32 = 8;
/// … or when it holds one and the line has been silent for this many more.
const TIMEOUT: u32 = 2;
/// Longest time from a byte to its interrupt, bytes.
pub const RECEIVE_DELAY: u32 = TOGETHER + TIMEOUT;

fn word(at: usize) -> u32 {
    // SAFETY: `at` is a multiple of 4 in PSRAM (the stream ends within it), which nothing writes.
    unsafe { read_volatile(at as *const u32) }
}

fn set(register: *mut u32, value: u32) {
    // SAFETY: registers of timer 0, which nothing else uses.
    unsafe { write_volatile(register, value) }
}

/// Ticks of the board that stand for one second, if there is a stream.
pub fn ticks_per_second() -> Option<u32> {
    (word(PSRAM) == MAGIC).then(|| word(PSRAM + 4))
}

/// Bytes of the GNSS receiver.
pub struct Receiver {
    /// The next byte, or where its piece begins when none of it is left.
    at: usize,
    /// Bytes left of the piece.
    left: u32,
    /// When the next byte has come, ticks × 256.
    due: u64,
    /// Time of a byte, ticks × 256.
    step: u64,
    /// Ticks since the start, wider than the timer, and the timer then.
    now: u64,
    last_ticks: u32,
    overrun: bool,
}

impl Receiver {
    pub(super) fn start() -> Self {
        set(CTRL, 0);
        set(RELOAD, u32::MAX);
        set(VALUE, 1);
        if ticks_per_second().is_some() {
            set(CTRL, CTRL_ENABLE | CTRL_INTERRUPT);
        }
        Self {
            at: PSRAM + HEADER,
            left: 0,
            due: 0,
            step: u64::from(word(PSRAM + 8)),
            now: 0,
            last_ticks: ticks(),
            overrun: false,
        }
    }

    /// In the interrupt: acknowledges it and takes a byte that has come, until there is none.
    #[inline]
    pub fn take(&mut self) -> Option<u8> {
        set(INTCLEAR, 1);
        loop {
            if self.left == 0 && !self.next_piece() {
                set(CTRL, 0);
                return None;
            }
            let ticks = ticks();
            self.now += u64::from(ticks.wrapping_sub(self.last_ticks));
            self.last_ticks = ticks;
            let late = (self.now << 8).checked_sub(self.due);
            let Some(late) = late else {
                set(VALUE, self.ticks_to_interrupt());
                return None;
            };
            // SAFETY: a byte of the stream in PSRAM, which nothing writes.
            let byte = unsafe { read_volatile(self.at as *const u8) };
            self.at += 1;
            self.left -= 1;
            self.due += self.step;
            if late <= FIFO * self.step {
                return Some(byte);
            }
            self.overrun = true;
        }
    }

    /// Ticks until there is something to take, when there is nothing now. A line that goes on without a
    /// pause into the next piece interrupts here once more than it would.
    fn ticks_to_interrupt(&self) -> u32 {
        let together = self.left.min(TOGETHER);
        let timeout = if together < TOGETHER { TIMEOUT } else { 0 };
        let at = self.due + u64::from(together - 1 + timeout) * self.step;
        ((at - (self.now << 8)) >> 8) as u32 + 1
    }

    /// Goes on to the next piece; false after the last.
    fn next_piece(&mut self) -> bool {
        let header = self.at.next_multiple_of(4);
        self.left = word(header + 8);
        self.at = header + 12;
        let start = u64::from(word(header)) | u64::from(word(header + 4)) << 32;
        self.due = (start << 8) + self.step;
        self.left > 0
    }

    /// Whether a byte came before there was room for it, since the last call.
    #[inline]
    pub fn overrun(&mut self) -> bool {
        core::mem::take(&mut self.overrun)
    }
}
