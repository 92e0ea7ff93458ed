//! defmt's logger: frames in rzcobs, through a ring, on the log UART.
//!
//! A task or interrupt that logs only fills the ring; `idle` sends. Interrupts are masked while one
//! frame is put into the ring, so frames never mix and no receiver byte waits for a log line. What
//! finds no room is dropped and counted; the decoder on the host drops the frame it tears and goes
//! on with the next.

use super::{Transmitter, log_output};
use crate::ring::Ring;
use core::cell::UnsafeCell;
use defmt::Encoder;

static LOG: Ring<4096> = Ring::empty();

/// Log bytes that found no room.
pub fn lost() -> u32 {
    LOG.lost()
}

/// Whether all that was logged has been sent.
pub fn is_empty() -> bool {
    LOG.is_empty()
}

/// The reading end of the log: sends it.
pub struct LogSender {
    port: Transmitter,
}

impl LogSender {
    /// The reading end. For `idle`, and for handlers that never return to it.
    pub fn start() -> Self {
        Self { port: log_output() }
    }

    /// Sends what is in the ring.
    pub fn drain(&mut self) {
        let mut chunk = [0; 32];
        loop {
            let count = LOG.pop(&mut chunk);
            if count == 0 {
                return;
            }
            self.port.send(chunk.get(..count).unwrap_or_default());
        }
    }
}

#[defmt::global_logger]
struct RingLogger;

struct State {
    encoder: Encoder,
    /// Whether interrupts were on before `acquire`.
    unmask: bool,
}

struct Shared(UnsafeCell<State>);
// SAFETY: one core, and the state is touched only between `acquire` and `release`, while interrupts
// are masked.
unsafe impl Sync for Shared {}

static STATE: Shared = Shared(UnsafeCell::new(State {
    encoder: Encoder::new(),
    unmask: false,
}));

fn put(bytes: &[u8]) {
    bytes.iter().for_each(|byte| LOG.push(*byte));
}

// SAFETY: `acquire` masks interrupts, so no second frame starts before `release`. A fault handler
// that logs while a frame is open starts a new one and never returns to the open one.
unsafe impl defmt::Logger for RingLogger {
    fn acquire() {
        let unmask = cortex_m::register::primask::read().is_active();
        cortex_m::interrupt::disable();
        // SAFETY: interrupts are masked, and the open frame of a faulting task is abandoned.
        let state = unsafe { &mut *STATE.0.get() };
        state.unmask = unmask;
        state.encoder.start_frame(put);
    }

    unsafe fn flush() {
        // `idle` sends; waiting here would hold the receiver up.
    }

    unsafe fn release() {
        // SAFETY: called after `acquire`, interrupts still masked.
        let state = unsafe { &mut *STATE.0.get() };
        state.encoder.end_frame(put);
        if state.unmask {
            // SAFETY: they were on before `acquire`.
            unsafe { cortex_m::interrupt::enable() };
        }
    }

    unsafe fn write(bytes: &[u8]) {
        // SAFETY: called between `acquire` and `release`, interrupts masked.
        let state = unsafe { &mut *STATE.0.get() };
        state.encoder.write(bytes, put);
    }
}
