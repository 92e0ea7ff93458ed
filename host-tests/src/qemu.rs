//! The emulated board: the firmware image in QEMU's mps2-an500, fed and read as a real one would be.
//!
//! ```text
//! bytes ──unix socket──► UART0 ┐            ┌ UART1 ──► frames, sentences ──► on_piece
//!                              │ Cortex-M7  ├ UART2 ──► defmt ──► log lines
//!   keeps its distance ◄───────┘            └ UART3 ──► acknowledgements, one per 256 bytes
//! ```
//!
//! Time on the board is an instruction count (`-icount`), so what it computes and what it costs do not
//! depend on the speed of this machine.

pub mod image;
mod log;
mod machine;
pub mod paced;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use surefix_core::wire::native::{Frame, FrameError, HEADER_LEN, Kind, TRAILER_LEN};

use crate::nmea::{self, Sentence};
use crate::replay::Executor;
use log::Log;
use machine::{Acknowledged, Machine, Port};

/// Bytes on their way that the board has not acknowledged: half of its ring, so that it never fills.
const WINDOW: u64 = 8192;
/// Bytes of an end-of-stream frame, the last of every stream.
const END_LENGTH: usize = HEADER_LEN + TRAILER_LEN;

/// How a run is done.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Longest time without any sign of life, on this machine's clock.
    pub silence: Duration,
    /// Whether to keep within what the board acknowledges. Without it the ring can overflow, as it
    /// can with a receiver in the field.
    pub flow_control: bool,
    /// Whether log lines go to standard error as they come; the last ones are kept in any case.
    pub print_log: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            silence: Duration::from_secs(60),
            flow_control: true,
            print_log: std::env::var_os("SUREFIX_LOG").is_some(),
        }
    }
}

/// What a run that came to its end was like.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Frames received, the end marker included.
    pub frames: u64,
    /// Bytes on the output UART that belonged to no frame and no sentence.
    pub stray_bytes: u64,
    /// Time it took on this machine.
    pub elapsed: Duration,
    /// The last lines of the board's log.
    pub log: Vec<String>,
}

/// Why a run came to no good end. Every message says what to do or look at.
#[derive(Debug, thiserror::Error)]
pub enum QemuError {
    /// QEMU is not there.
    #[error("cannot start qemu-system-arm ({0}): run `cargo xtask setup`")]
    NotStarted(#[source] std::io::Error),
    /// Sockets or files of the run.
    #[error("{what}: {error}")]
    Io {
        /// What was tried.
        what: &'static str,
        /// What came back.
        #[source]
        error: std::io::Error,
    },
    /// QEMU ended before it was told to.
    #[error("QEMU ended by itself ({status}): {stderr}{}", log_tail(.log))]
    Ended {
        /// Its exit status.
        status: String,
        /// What it said.
        stderr: String,
        /// The last lines of the board's log.
        log: Vec<String>,
    },
    /// The firmware withdrew its output: it panicked or faulted.
    #[error("the firmware failed and withdrew its output after {sent} input bytes{}", log_tail(.log))]
    Withdrawn {
        /// Bytes sent until then.
        sent: u64,
        /// How QEMU ended.
        status: String,
        /// The last lines of the board's log.
        log: Vec<String>,
    },
    /// Nothing moved for too long.
    #[error("the board has been silent for {} s, {acknowledged} of {total} input bytes taken{}", .silence.as_secs(), log_tail(.log))]
    Silent {
        /// How long.
        silence: Duration,
        /// Input bytes acknowledged.
        acknowledged: u64,
        /// Input bytes in all.
        total: u64,
        /// The last lines of the board's log.
        log: Vec<String>,
    },
}

fn log_tail(log: &[String]) -> String {
    if log.is_empty() {
        return "; its log is empty".to_owned();
    }
    format!("; its log ends:\n  {}", log.join("\n  "))
}

/// Streams `bytes` through the image `elf` and hands over every frame and every NMEA sentence it sends, header
/// and checksum included, until it says that the stream has ended. The last bytes must be an end-of-stream frame.
///
/// # Errors
/// [`QemuError`]; what was handed over before it stays handed over.
pub fn run(
    elf: &Path,
    bytes: &[u8],
    options: Options,
    on_piece: &mut dyn FnMut(&[u8]),
) -> Result<Outcome, QemuError> {
    let started = Instant::now();
    let mut machine = Machine::start(elf)?;
    let log = Log::follow(elf, machine.take(Port::Log), options.print_log)?;
    let acknowledged = Arc::new(Acknowledged::follow(machine.take(Port::Acknowledge)));
    let sender = machine::send(
        machine.take(Port::Receiver),
        bytes.to_vec(),
        &bytes[bytes.len().saturating_sub(END_LENGTH)..],
        options.flow_control.then_some(WINDOW),
        Arc::clone(&acknowledged),
    );
    let mut output = machine.take(Port::Output);

    let mut frames = FrameSplitter::default();
    let mut count = 0;
    let mut last_sign = (Instant::now(), 0);
    let mut chunk = [0; 4096];
    loop {
        match machine::read_some(&mut output, &mut chunk)? {
            machine::Read::Bytes(n) => {
                last_sign.0 = Instant::now();
                frames.buffer.extend_from_slice(&chunk[..n]);
            }
            machine::Read::Nothing => {
                let taken = acknowledged.bytes();
                if taken != last_sign.1 {
                    last_sign = (Instant::now(), taken);
                }
                if last_sign.0.elapsed() > options.silence {
                    return Err(QemuError::Silent {
                        silence: options.silence,
                        acknowledged: taken,
                        total: bytes.len() as u64,
                        log: log.last_lines(),
                    });
                }
            }
            machine::Read::Closed => {
                let (status, stderr) = machine.wait();
                return Err(QemuError::Ended {
                    status,
                    stderr,
                    log: log.last_lines(),
                });
            }
        }
        while let Some((kind, frame)) = frames.next() {
            if kind == Piece::Sentence {
                on_piece(&frame);
                continue;
            }
            count += 1;
            if kind == Piece::Frame(Some(Kind::OutputInvalid)) {
                on_piece(&frame);
                // The reset that follows ends QEMU (`-no-reboot`) once the log has been sent.
                let (status, _) = machine.wait();
                return Err(QemuError::Withdrawn {
                    sent: sender.sent(),
                    status,
                    log: log.last_lines(),
                });
            }
            on_piece(&frame);
            if kind == Piece::Frame(Some(Kind::EndOfStream)) {
                return Ok(Outcome {
                    frames: count,
                    stray_bytes: frames.stray,
                    elapsed: started.elapsed(),
                    log: log.last_lines(),
                });
            }
        }
    }
}

/// The monitor on the emulated board.
#[derive(Clone, Debug)]
pub struct QemuExecutor {
    elf: PathBuf,
}

impl QemuExecutor {
    /// Builds the firmware if it is missing or older than its sources.
    ///
    /// # Errors
    /// [`image::ImageError`].
    pub fn build() -> Result<Self, image::ImageError> {
        let elf = image::build("monitor", &[])?;
        Ok(Self { elf })
    }
}

impl Executor for QemuExecutor {
    fn run(&mut self, stream: &[u8], output: &mut dyn FnMut(&[u8])) -> anyhow::Result<()> {
        run(&self.elf, stream, Options::default(), output)?;
        Ok(())
    }
}

/// What a piece of the output is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Piece {
    /// A native frame, and its kind where that is known.
    Frame(Option<Kind>),
    /// An NMEA sentence.
    Sentence,
}

/// Cuts a byte stream into native frames and NMEA sentences; what belongs to neither is counted.
#[derive(Default)]
struct FrameSplitter {
    buffer: Vec<u8>,
    stray: u64,
}

impl FrameSplitter {
    fn next(&mut self) -> Option<(Piece, Vec<u8>)> {
        let mut start = 0;
        let found = loop {
            let rest = &self.buffer[start..];
            match Frame::parse(rest) {
                Ok((frame, length)) => break Some((Piece::Frame(frame.kind()), length)),
                Err(FrameError::Incomplete { .. }) => break None,
                Err(_) => match nmea::find(rest) {
                    Sentence::Whole(line) => break Some((Piece::Sentence, line.len())),
                    Sentence::Incomplete => break None,
                    Sentence::None => start += 1,
                },
            }
        };
        self.stray += start as u64;
        self.buffer.drain(..start);
        let (kind, length) = found?;
        Some((kind, self.buffer.drain(..length).collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use surefix_core::wire::native;

    #[test]
    fn frames_and_sentences_are_found_between_stray_bytes_and_across_reads() {
        let mut frame = [0; 32];
        let length = native::encode(Kind::Report, &mut frame, |w| w.put_u16(0x4653)).unwrap();
        let mut bytes = b"SSF noise".to_vec();
        bytes.extend_from_slice(&frame[..length]);
        bytes.push(b'S');
        bytes.extend_from_slice(&frame[..length]);
        let sentence = b"$GPGGA,*7A\r\n";
        bytes.extend_from_slice(sentence);
        // One that a frame cuts off.
        bytes.extend_from_slice(&sentence[..5]);
        bytes.extend_from_slice(&frame[..length]);
        bytes.extend_from_slice(sentence);

        let mut splitter = FrameSplitter::default();
        let (mut found, mut sentences) = (0, 0);
        for byte in bytes {
            splitter.buffer.push(byte);
            while let Some((kind, whole)) = splitter.next() {
                if kind == Piece::Sentence {
                    assert_eq!(whole, sentence);
                    sentences += 1;
                    continue;
                }
                let expected = Piece::Frame(Some(Kind::Report));
                assert_eq!((kind, &whole[..]), (expected, &frame[..length]));
                found += 1;
            }
        }
        assert_eq!((found, sentences, splitter.stray), (3, 2, 15));
    }
}
