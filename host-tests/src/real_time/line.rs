//! The bytes of a flight on one serial line, each piece at the time at which it can be there.
//!
//! An inertial sample is there at its own time, what the receiver says of an epoch at the time of the
//! epoch, what comes before the first epoch with it. Where two are due at once the sample goes first; a
//! piece that finds the line busy waits.

use anyhow::{Result, bail};
use surefix_core::config::Config;
use surefix_core::ingest::{Event, Ingest};
use surefix_core::time::GpsTime;

use crate::imu::frames;
use crate::qemu::paced::{MOST_BYTES, TICKS_PER_SECOND};

/// Speed of the line, Bd; ten bits make a byte. The same as the STM32H743's (firmware: board/h743/uart.rs).
pub const BAUD: u64 = 921_600;
/// Longest time from a byte to its interrupt, bytes (firmware: board/mps2/line.rs).
const RECEIVE_DELAY: u64 = 10;
/// Time the board has for its start, s.
pub const START_S: f64 = 0.1;

/// Frames that are due together.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    /// When.
    pub due: GpsTime,
    /// What.
    pub bytes: Vec<u8>,
}

/// A stream cut into frames, each with the time at which it is due: its own, or that of what follows.
pub fn pieces(bytes: &[u8], config: &Config) -> Vec<Piece> {
    let mut ingest = Box::new(Ingest::EMPTY);
    ingest.configure(config);
    let mut pieces: Vec<(Option<GpsTime>, Vec<u8>)> = Vec::new();
    for frame in frames(bytes) {
        let content = &bytes[frame];
        let (mut rest, mut due) = (content, None);
        loop {
            let (used, event) = ingest.push(rest);
            rest = &rest[used..];
            match event {
                Event::Nothing => break,
                Event::Imu(sample) => due = Some(sample.time),
                Event::EpochReady => due = Some(ingest.epoch().time),
                Event::CorrectedEpochReady => due = Some(ingest.corrected_epoch().time),
                _ => {}
            }
        }
        pieces.push((due, content.to_vec()));
        // What came before, and has no time, belongs to this.
        let open = pieces.iter_mut().rev().skip(1);
        for (earlier, _) in open.take_while(|(earlier, _)| due.is_some() && earlier.is_none()) {
            *earlier = due;
        }
    }
    let last = pieces.iter().rev().find_map(|(due, _)| *due);
    let last = last.unwrap_or(GpsTime::from_ns(0));
    let timed = pieces.into_iter().map(|(due, bytes)| Piece {
        due: due.unwrap_or(last),
        bytes,
    });
    timed.collect()
}

/// Two sequences of pieces as one; of those due at once `first` goes first.
pub fn merge(first: Vec<Piece>, second: Vec<Piece>) -> Vec<Piece> {
    let mut both = [first, second].concat();
    // Stable: neither changes its own order.
    both.sort_by_key(|piece| piece.due);
    both
}

/// A stream with its times.
#[derive(Clone, Debug)]
pub struct Line {
    pieces: Vec<Piece>,
    /// Time of the first piece.
    pub start: GpsTime,
    /// Ticks of the board that stand for a second.
    pub ticks_per_second: u64,
    /// How much the board's clock is too fast, parts in a million.
    pub ppm: f64,
}

impl Line {
    /// On a board whose clock is cut to a part: everything comes that many times as fast, which is the
    /// same to it.
    pub fn new(pieces: Vec<Piece>, slow_down: u64) -> Result<Self> {
        let Some(start) = pieces.first().map(|piece| piece.due) else {
            bail!("there is nothing to send");
        };
        Ok(Self {
            pieces,
            start,
            ticks_per_second: TICKS_PER_SECOND / slow_down,
            ppm: 0.0,
        })
    }

    /// Everything, in order.
    pub fn bytes(&self) -> Vec<u8> {
        let pieces = self.pieces.iter().map(|piece| piece.bytes.as_slice());
        pieces.collect::<Vec<_>>().concat()
    }

    /// When a time is, in ticks since the board started.
    pub fn ticks(&self, time: GpsTime) -> u64 {
        let since_s = time.seconds_since(self.start) * (1.0 + self.ppm * 1e-6) + START_S;
        (since_s * self.ticks_per_second as f64) as u64
    }

    /// A time at which the last byte of an epoch had not come yet, or came, by the interrupt that told of
    /// it.
    pub fn came(&self, interrupt: u64) -> u64 {
        interrupt - RECEIVE_DELAY * 10 * self.ticks_per_second / BAUD
    }

    /// The memory of the board before it starts.
    ///
    /// # Errors
    /// When the stream is longer than that.
    pub fn memory(&self) -> Result<Vec<u8>> {
        let byte_256 = 256 * 10 * self.ticks_per_second / BAUD;
        let mut memory = b"SFLN".to_vec();
        memory.extend((self.ticks_per_second as u32).to_le_bytes());
        memory.extend((byte_256 as u32).to_le_bytes());
        let mut free = 0;
        for piece in &self.pieces {
            let start = self.ticks(piece.due).max(free);
            free = start + (piece.bytes.len() as u64 * byte_256).div_ceil(256);
            memory.extend(start.to_le_bytes());
            memory.extend((piece.bytes.len() as u32).to_le_bytes());
            memory.extend(&piece.bytes);
            memory.resize(memory.len().next_multiple_of(4), 0);
        }
        memory.extend([0; 12]);
        if memory.len() > MOST_BYTES {
            bail!(
                "the stream takes {} bytes and the board's memory holds {MOST_BYTES}: give fewer --minutes",
                memory.len()
            );
        }
        Ok(memory)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(milliseconds: i64, bytes: &[u8]) -> Piece {
        Piece {
            due: GpsTime::from_ns(milliseconds * 1_000_000),
            bytes: bytes.to_vec(),
        }
    }

    #[test]
    fn samples_go_first_and_each_side_keeps_its_order() {
        let samples = vec![piece(5, b"a"), piece(10, b"b"), piece(15, b"c")];
        let receiver = vec![piece(10, b"E"), piece(10, b"F")];
        let line = Line::new(merge(samples, receiver), 1).unwrap();
        assert_eq!(line.bytes(), b"abEFc");
    }

    #[test]
    fn a_piece_waits_for_the_line_and_starts_a_word() {
        let line = Line::new(vec![piece(0, &[1; 9]), piece(0, &[2; 4])], 10).unwrap();
        let memory = line.memory().unwrap();
        let word = |at: usize| u32::from_le_bytes(memory[at..at + 4].try_into().unwrap());
        let (rate, byte_256) = (2_500_000, 6944);
        assert_eq!((word(4), word(8)), (rate, byte_256));
        assert_eq!((word(12), word(16), word(20)), (rate / 10, 0, 9));
        let second = 24 + 12;
        let busy = (9 * byte_256).div_ceil(256);
        assert_eq!((word(second), word(second + 8)), (rate / 10 + busy, 4));
        assert_eq!(memory[second + 12..second + 16], [2; 4]);
        assert_eq!(word(second + 24), 0, "the end");
    }
}
