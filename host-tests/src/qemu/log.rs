//! The board's defmt log, decoded with the format strings of the image.

use std::collections::VecDeque;
use std::io::Read;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use defmt_decoder::{DecodeError, Table};

use super::QemuError;

/// Lines kept for error messages and tests.
const KEPT: usize = 200;

/// Decodes a whole log.
pub fn decode(elf: &Path, bytes: &[u8]) -> Vec<String> {
    let table = std::fs::read(elf)
        .ok()
        .and_then(|image| Table::parse(&image).ok().flatten());
    let Some(table) = table else {
        return vec!["(the log cannot be decoded)".to_owned()];
    };
    let mut decoder = table.new_stream_decoder();
    decoder.received(bytes);
    let mut lines = Vec::new();
    loop {
        match decoder.decode() {
            Ok(frame) => lines.push(frame.display(false).to_string()),
            Err(DecodeError::UnexpectedEof) => return lines,
            Err(DecodeError::Malformed) => lines.push("(a torn log frame)".to_owned()),
        }
    }
}

/// The log of a running board.
pub struct Log {
    lines: Arc<Mutex<VecDeque<String>>>,
    reader: JoinHandle<()>,
}

impl Log {
    /// Decodes what comes from the log UART until it closes.
    pub fn follow(elf: &Path, mut stream: UnixStream, print: bool) -> Result<Self, QemuError> {
        let image = std::fs::read(elf).map_err(|error| QemuError::Io {
            what: "cannot read the firmware image",
            error,
        })?;
        let lines = Arc::new(Mutex::new(VecDeque::new()));
        let kept = Arc::clone(&lines);
        let reader = thread::spawn(move || {
            let keep = |line: String| {
                if print {
                    eprintln!("board: {line}");
                }
                let mut kept = kept.lock().expect("no user of the lock panics");
                if kept.len() == KEPT {
                    kept.pop_front();
                }
                kept.push_back(line);
            };
            let table = match Table::parse(&image) {
                Ok(Some(table)) => table,
                Ok(None) => return keep("(the image has no defmt section)".to_owned()),
                Err(error) => return keep(format!("(the log cannot be decoded: {error})")),
            };
            let mut decoder = table.new_stream_decoder();
            let mut chunk = [0; 1024];
            while let Ok(count @ 1..) = stream.read(&mut chunk) {
                decoder.received(&chunk[..count]);
                loop {
                    match decoder.decode() {
                        Ok(frame) => keep(frame.display(false).to_string()),
                        Err(DecodeError::UnexpectedEof) => break,
                        Err(DecodeError::Malformed) => keep("(a torn log frame)".to_owned()),
                    }
                }
            }
        });
        Ok(Self { lines, reader })
    }

    /// The last lines. Waits a moment for a log whose board has ended.
    pub fn last_lines(&self) -> Vec<String> {
        let deadline = Instant::now() + Duration::from_millis(300);
        while !self.reader.is_finished() && Instant::now() < deadline {
            thread::sleep(Duration::from_millis(10));
        }
        let lines = self.lines.lock().expect("no user of the lock panics");
        lines.iter().cloned().collect()
    }
}
