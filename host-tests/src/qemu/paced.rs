//! The emulated board in its own time: the stream lies in its memory and reaches the firmware when a
//! line would bring it, so that a run repeats to the instruction (firmware: board/mps2/line.rs).
//!
//! What it sends goes to files, which always take it: nothing on this machine can hold the board up.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use super::{QemuError, log, machine};
use crate::bridge::Sensors;
use crate::bridge::server::{Served, Server};

/// Bytes the board's memory has room for.
pub const MOST_BYTES: usize = 16 << 20;
/// Virtual time of an instruction, ns, as a power of two: 250 million instructions a second.
const SHIFT: &str = "shift=2,sleep=off";
/// Ticks of the board's clock in a second of its time.
pub const TICKS_PER_SECOND: u64 = 25_000_000;
/// Instructions in a tick.
pub const INSTRUCTIONS_PER_TICK: u64 = 10;
/// Longest time without output, on this machine's clock.
const SILENCE: Duration = Duration::from_secs(120);

/// What a run left behind.
pub struct Outcome {
    /// What the board sent.
    pub output: Vec<u8>,
    /// What it told of its times.
    pub told: Vec<u8>,
    /// What its monitor was given, when it has sensors.
    pub recording: Vec<u8>,
    /// The sensors, when it has some.
    pub served: Option<Served>,
    /// Its log.
    pub log: Vec<String>,
    /// Time it took on this machine.
    pub elapsed: Duration,
}

struct Run {
    process: Child,
    folder: PathBuf,
}

impl Drop for Run {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
        let _ = fs::remove_dir_all(&self.folder);
    }
}

fn io(what: &'static str) -> impl FnOnce(std::io::Error) -> QemuError {
    move |error| QemuError::Io { what, error }
}

fn bus(error: anyhow::Error) -> QemuError {
    QemuError::Io {
        what: "the bus of the sensors",
        error: std::io::Error::other(error),
    }
}

/// Boots `elf` with `stream` in its memory and `sensors` at its lines, for an image that looks for them, and
/// waits until the board resets; `progress` sees how many bytes it has sent.
///
/// # Errors
/// [`QemuError`]; a board that withdraws its output is no error here, its frame is in the output.
pub fn run(
    elf: &Path,
    stream: &[u8],
    sensors: Option<Sensors>,
    progress: &mut dyn FnMut(u64),
) -> Result<Outcome, QemuError> {
    let started = Instant::now();
    let folder = machine::fresh_folder().map_err(io("cannot make a folder for the run"))?;
    let file = |name: &str| folder.join(name);
    let mut command = Command::new("qemu-system-arm");
    command
        .args(["-machine", "mps2-an500", "-display", "none"])
        .args(["-monitor", "none", "-no-reboot", "-icount", SHIFT])
        .arg("-kernel")
        .arg(elf)
        .arg("-device")
        .arg(format!(
            "loader,file={},addr=0x60000000,force-raw=on",
            file("stream").display()
        ))
        .args(["-serial", "null"]);
    for name in ["output", "log", "told"] {
        command
            .args(["-chardev"])
            .arg(format!("file,id={name},path={}", file(name).display()));
        command.args(["-serial", &format!("chardev:{name}")]);
    }
    let mut server = None;
    if let Some(sensors) = sensors {
        server = Some(Server::start(&folder, sensors).map_err(bus)?);
        command
            .args(["-semihosting-config", "enable=on,target=native"])
            .current_dir(&folder);
    }
    let prepared = fs::write(file("stream"), stream).and_then(|()| File::create(file("stderr")));
    let process = prepared
        .map_err(io("cannot make a file"))
        .and_then(|stderr| {
            command
                .stdin(Stdio::null())
                .stdout(Stdio::null())
                .stderr(stderr)
                .spawn()
                .map_err(QemuError::NotStarted)
        });
    let mut run = match process {
        Ok(process) => Run {
            process,
            folder: folder.clone(),
        },
        Err(error) => {
            let _ = fs::remove_dir_all(&folder);
            return Err(error);
        }
    };

    let mut last = (Instant::now(), 0);
    let status = loop {
        match run.process.try_wait() {
            Ok(Some(status)) => break status,
            Ok(None) => {}
            Err(error) => return Err(io("cannot wait for QEMU")(error)),
        }
        let sent = fs::metadata(file("output")).map_or(0, |metadata| metadata.len());
        if sent != last.1 {
            last = (Instant::now(), sent);
            progress(sent);
        }
        if last.0.elapsed() > SILENCE {
            return Err(QemuError::Silent {
                silence: SILENCE,
                acknowledged: 0,
                total: stream.len() as u64,
                log: log::decode(elf, &fs::read(file("log")).unwrap_or_default()),
            });
        }
        thread::sleep(Duration::from_millis(20));
    };
    let served = server.map(Server::finish).transpose().map_err(bus)?;
    let read = |name: &str| fs::read(file(name)).map_err(io("cannot read what the board sent"));
    let log = log::decode(elf, &read("log")?);
    if !status.success() {
        let stderr = fs::read_to_string(file("stderr")).unwrap_or_default();
        return Err(QemuError::Ended {
            status: status.to_string(),
            stderr: stderr.trim().to_owned(),
            log,
        });
    }
    Ok(Outcome {
        output: read("output")?,
        told: read("told")?,
        recording: match served {
            Some(_) => read("recording")?,
            None => Vec::new(),
        },
        served,
        log,
        elapsed: started.elapsed(),
    })
}
