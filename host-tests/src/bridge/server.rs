//! Pipes and requests. The form of a request is in firmware/src/board/mps2/bridge/mod.rs.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread::{self, JoinHandle};

use anyhow::{Context, Result, anyhow, bail};

use super::Sensors;

const REQUEST: &str = "spi-request";
const RESPONSE: &str = "spi-response";
/// The end: a request of this side to itself.
const QUIT: [u8; 12] = *b"Q\0\0\0\0\0\0\0\0\0\0\0";

/// A thread that answers the board.
pub struct Server {
    folder: PathBuf,
    thread: JoinHandle<Result<Served>>,
}

/// What a server leaves.
pub struct Served {
    /// The devices as the last request left them.
    pub sensors: Sensors,
    /// Transfers.
    pub transfers: u64,
    /// Times the board asked for edges.
    pub questions: u64,
}

impl Server {
    /// Makes the pipes in `folder`, in which the emulator must run.
    ///
    /// # Errors
    /// When they cannot be made.
    pub fn start(folder: &Path, sensors: Sensors) -> Result<Self> {
        let path = |name: &str| folder.join(name);
        let made = Command::new("mkfifo")
            .args([path(REQUEST), path(RESPONSE)])
            .status()
            .context("cannot run mkfifo")?;
        if !made.success() {
            bail!("mkfifo: {made}");
        }
        // Opened both ways, so that neither side waits for the other to open.
        let open = |name| {
            let mut options = OpenOptions::new();
            let file = options.read(true).write(true).open(path(name));
            file.with_context(|| format!("cannot open {name}"))
        };
        let (requests, responses) = (open(REQUEST)?, open(RESPONSE)?);
        let thread = thread::spawn(move || serve(requests, responses, sensors));
        Ok(Self {
            folder: folder.to_owned(),
            thread,
        })
    }

    /// Ends the thread once it has answered what was asked.
    ///
    /// # Errors
    /// When a request was none.
    pub fn finish(self) -> Result<Served> {
        let pipe = OpenOptions::new()
            .read(true)
            .write(true)
            .open(self.folder.join(REQUEST));
        pipe.and_then(|mut pipe| {
            pipe.write_all(&QUIT)?;
            // The pipe holds what was written only while somebody has it open.
            let served = self.thread.join();
            Ok(served)
        })
        .context("cannot end the server of the bus")?
        .map_err(|_| anyhow!("the server of the bus panicked"))?
    }
}

fn serve(mut requests: File, mut responses: File, mut sensors: Sensors) -> Result<Served> {
    let (mut transfers, mut questions) = (0, 0);
    loop {
        let mut head = [0; 12];
        requests.read_exact(&mut head)?;
        let [what, part, low, high, time @ ..] = head;
        let now_ns = u64::from_le_bytes(time);
        let mut mosi = vec![0; usize::from(u16::from_le_bytes([low, high]))];
        requests.read_exact(&mut mosi)?;
        let answer = match what {
            b'P' => sensors.present().to_le_bytes().to_vec(),
            b'T' => {
                transfers += 1;
                sensors.transfer(now_ns, part, &mosi)
            }
            b'E' => {
                questions += 1;
                let (active, next_ns) = sensors.edges(now_ns);
                [&active.to_le_bytes()[..], &next_ns.to_le_bytes()].concat()
            }
            b'Q' => {
                return Ok(Served {
                    sensors,
                    transfers,
                    questions,
                });
            }
            _ => bail!("a request that nobody knows: {head:02x?}"),
        };
        responses.write_all(&answer)?;
    }
}
