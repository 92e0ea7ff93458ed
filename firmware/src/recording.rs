//! What the monitor was given, as a stream that gives the same reports when it is replayed.
//!
//! A sample that comes in the middle of a receiver's frame takes effect before that frame does. It is written
//! before it, too: the bytes of a frame wait here until they are whole.

use crate::board::File;
use surefix_core::ingest::{encode_magnetic_field, encode_pressure, encode_unit_sample};
use surefix_core::ins::{MagneticSample, PressureSample, UnitSample};
use surefix_core::wire::native::{Full, MAX_FRAME};
use surefix_core::wire::scanner;

/// Bytes that wait: the longest frame, what may follow it in the monitor's buffer, and a piece.
const WAITING: usize = 2 * scanner::MAX_FRAME;
/// Bytes written together.
const TOGETHER: usize = 4096;

/// The file and what waits for it.
pub struct Recording {
    file: Option<File>,
    waiting: heapless::Vec<u8, WAITING>,
    together: heapless::Vec<u8, TOGETHER>,
    is_whole: bool,
}

impl Recording {
    /// To no file.
    pub const EMPTY: Self = Self {
        file: None,
        waiting: heapless::Vec::new(),
        together: heapless::Vec::new(),
        is_whole: false,
    };

    /// To a file, if there is one.
    pub fn start(&mut self, file: Option<File>) {
        self.is_whole = file.is_some();
        self.file = file;
    }

    /// The monitor took these bytes, and nothing has followed yet from the last `in_hand`.
    pub fn bytes(&mut self, bytes: &[u8], in_hand: usize) {
        self.is_whole &= self.waiting.extend_from_slice(bytes).is_ok();
        let done = self.waiting.len().saturating_sub(in_hand);
        let left = self.waiting.len() - done;
        for begin in (0..done).step_by(TOGETHER) {
            let end = done.min(begin + TOGETHER);
            if self.together.len() + end - begin > TOGETHER {
                self.flush();
            }
            let part = self.waiting.get(begin..end).unwrap_or_default();
            self.is_whole &= self.together.extend_from_slice(part).is_ok();
        }
        self.waiting.copy_within(done.., 0);
        self.waiting.truncate(left);
    }

    /// The monitor was given a sample of a unit.
    pub fn unit(&mut self, unit: u8, sample: &UnitSample) {
        self.frame(|frame| encode_unit_sample(unit, sample, frame));
    }

    /// The monitor was given a sample of the barometer.
    pub fn pressure(&mut self, sample: &PressureSample) {
        self.frame(|frame| encode_pressure(sample, frame));
    }

    /// The monitor was given a sample of the magnetometer.
    pub fn magnetic_field(&mut self, sample: &MagneticSample) {
        self.frame(|frame| encode_magnetic_field(sample, frame));
    }

    fn frame(&mut self, encode: impl FnOnce(&mut [u8]) -> Result<usize, Full>) {
        let mut frame = [0; MAX_FRAME];
        let length = encode(&mut frame).unwrap_or(0);
        self.is_whole &= length > 0;
        if self.together.len() + length > TOGETHER {
            self.flush();
        }
        let frame = frame.get(..length).unwrap_or_default();
        self.is_whole &= self.together.extend_from_slice(frame).is_ok();
    }

    fn flush(&mut self) {
        let file = self.file.as_mut();
        self.is_whole &= file.is_some_and(|file| file.write(&self.together));
        self.together.clear();
    }

    /// Writes what waits; whether the file holds everything.
    pub fn finish(&mut self) -> bool {
        self.bytes(&[], 0);
        self.flush();
        self.is_whole
    }
}
