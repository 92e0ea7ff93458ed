//! A QEMU process with its four UARTs on unix sockets.

use std::fs;
use std::io::{ErrorKind, Read as _, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use super::QemuError;

/// Time QEMU gets to open its sockets.
const START_TIME: Duration = Duration::from_secs(30);
/// How long a read waits before the caller looks around.
const READ_TIME: Duration = Duration::from_millis(200);
/// Stream bytes that one acknowledgement stands for (firmware: board/mps2/uart.rs).
const BYTES_PER_ACKNOWLEDGEMENT: u64 = 256;

/// The UARTs, in the order of QEMU's `-serial` options.
#[derive(Clone, Copy)]
pub enum Port {
    Receiver = 0,
    Output = 1,
    Log = 2,
    Acknowledge = 3,
}

const PORTS: usize = 4;

/// A running QEMU; dropped, it is gone, and so is its folder.
pub struct Machine {
    process: Child,
    ports: [Option<UnixStream>; PORTS],
    folder: PathBuf,
}

fn io(what: &'static str) -> impl FnOnce(std::io::Error) -> QemuError {
    move |error| QemuError::Io { what, error }
}

impl Machine {
    /// Boots an image.
    pub fn start(elf: &Path) -> Result<Self, QemuError> {
        let folder = fresh_folder().map_err(io("cannot make a folder for the sockets"))?;
        let mut listeners = Vec::new();
        let mut command = Command::new("qemu-system-arm");
        command
            .args(["-machine", "mps2-an500", "-display", "none"])
            .args(["-monitor", "none", "-no-reboot"])
            // 64 ns of the board's time per instruction: its 25 MHz timer counts instructions. The
            // clock sleeps when the board does, so that an idle board costs this machine nothing.
            .args(["-icount", "shift=6"])
            .arg("-kernel")
            .arg(elf);
        for index in 0..PORTS {
            let path = folder.join(format!("uart{index}"));
            listeners.push(UnixListener::bind(&path).map_err(io("cannot make a socket"))?);
            let mut socket = format!("socket,id=uart{index},path={}", path.display());
            if index == Port::Receiver as usize {
                // The UART takes a byte at a time. A multiplexer in between buffers 32, so that QEMU
                // does not go to sleep and wake for each: three times as fast.
                socket.push_str(",mux=on");
            }
            command.args(["-chardev", &socket, "-serial"]);
            command.arg(format!("chardev:uart{index}"));
        }
        // A multiplexer looks for an escape character; no byte has this value.
        command.args(["-echr", "256"]);
        let stderr = fs::File::create(folder.join("stderr")).map_err(io("cannot make a file"))?;
        let process = command
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(stderr)
            .spawn();
        let mut machine = match process {
            Ok(process) => Self {
                process,
                ports: [const { None }; PORTS],
                folder,
            },
            Err(error) => {
                let _ = fs::remove_dir_all(&folder);
                return Err(QemuError::NotStarted(error));
            }
        };
        let deadline = Instant::now() + START_TIME;
        for (index, listener) in listeners.iter().enumerate() {
            machine.ports[index] = Some(machine.accept(listener, deadline)?);
        }
        Ok(machine)
    }

    fn accept(
        &mut self,
        listener: &UnixListener,
        deadline: Instant,
    ) -> Result<UnixStream, QemuError> {
        listener
            .set_nonblocking(true)
            .map_err(io("cannot use a socket"))?;
        loop {
            match listener.accept() {
                Ok((stream, _)) => {
                    stream
                        .set_nonblocking(false)
                        .map_err(io("cannot use a socket"))?;
                    return Ok(stream);
                }
                Err(error) if error.kind() != ErrorKind::WouldBlock => {
                    return Err(io("cannot use a socket")(error));
                }
                Err(_) => {}
            }
            let ended = self.process.try_wait().ok().flatten().is_some();
            if ended || Instant::now() > deadline {
                let (status, stderr) = self.wait();
                return Err(QemuError::Ended {
                    status,
                    stderr,
                    log: Vec::new(),
                });
            }
            thread::sleep(Duration::from_millis(2));
        }
    }

    /// The socket of a UART, once.
    pub fn take(&mut self, port: Port) -> UnixStream {
        self.ports[port as usize]
            .take()
            .expect("each port has one user")
    }

    /// Waits a moment for the end, then forces it; exit status and what QEMU said.
    pub fn wait(&mut self) -> (String, String) {
        let deadline = Instant::now() + Duration::from_secs(5);
        let status = loop {
            match self.process.try_wait() {
                Ok(Some(status)) => break status.to_string(),
                Ok(None) if Instant::now() < deadline => thread::sleep(Duration::from_millis(5)),
                _ => {
                    let _ = self.process.kill();
                    break "it had to be killed".to_owned();
                }
            }
        };
        let said = fs::read_to_string(self.folder.join("stderr")).unwrap_or_default();
        (status, said.trim().to_owned())
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// A folder of our own with a short path: socket paths end at about 100 bytes.
pub(super) fn fresh_folder() -> std::io::Result<PathBuf> {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    let long = std::env::temp_dir();
    let base = if long.as_os_str().len() > 60 {
        PathBuf::from("/tmp")
    } else {
        long
    };
    loop {
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let folder = base.join(format!("surefix-{}-{number}", std::process::id()));
        match fs::create_dir(&folder) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            other => return other.map(|()| folder),
        }
    }
}

/// What a read brought.
pub enum Read {
    Bytes(usize),
    Nothing,
    Closed,
}

/// Reads what there is, waiting a moment at most.
pub fn read_some(stream: &mut UnixStream, chunk: &mut [u8]) -> Result<Read, QemuError> {
    stream
        .set_read_timeout(Some(READ_TIME))
        .map_err(io("cannot use a socket"))?;
    match stream.read(chunk) {
        Ok(0) => Ok(Read::Closed),
        Ok(n) => Ok(Read::Bytes(n)),
        Err(error) => match error.kind() {
            ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted => {
                Ok(Read::Nothing)
            }
            ErrorKind::ConnectionReset => Ok(Read::Closed),
            _ => Err(io("cannot read the board's output")(error)),
        },
    }
}

/// Input bytes that the board has acknowledged.
pub struct Acknowledged {
    state: Arc<(Mutex<(u64, bool)>, Condvar)>,
}

impl Acknowledged {
    /// Counts what comes from the acknowledging UART until it closes.
    pub fn follow(mut stream: UnixStream) -> Self {
        let state = Arc::new((Mutex::new((0, false)), Condvar::new()));
        let shared = Arc::clone(&state);
        thread::spawn(move || {
            let mut chunk = [0; 256];
            loop {
                let count = stream.read(&mut chunk).unwrap_or(0);
                let mut inner = shared.0.lock().expect("no user of the lock panics");
                inner.0 += count as u64 * BYTES_PER_ACKNOWLEDGEMENT;
                inner.1 = count == 0;
                shared.1.notify_all();
                if count == 0 {
                    return;
                }
            }
        });
        Self { state }
    }

    /// How many.
    pub fn bytes(&self) -> u64 {
        self.state.0.lock().expect("no user of the lock panics").0
    }

    /// Waits until more than `bytes` are acknowledged; false when there will be no more.
    fn wait_beyond(&self, bytes: u64) -> bool {
        let mut inner = self.state.0.lock().expect("no user of the lock panics");
        while inner.0 <= bytes {
            if inner.1 {
                return false;
            }
            inner = self
                .state
                .1
                .wait(inner)
                .expect("no user of the lock panics");
        }
        true
    }
}

/// A thread that sends; it ends with the machine.
pub struct Sender {
    sent: Arc<AtomicU64>,
}

impl Sender {
    /// Bytes given to the socket so far.
    pub fn sent(&self) -> u64 {
        self.sent.load(Ordering::Relaxed)
    }
}

/// How long the board takes nothing before a stream without flow control counts as told.
const QUIET: Duration = Duration::from_millis(500);
/// Ends of a stream sent together: more bytes than the frame of a receiver that was cut off still waits
/// for, fewer than the ring has room for.
const ENDS: usize = 400;

/// Sends `bytes`, at most `window` of them ahead of the acknowledgements.
///
/// Without a window the board loses what its ring has no room for, and that may be the end of the stream:
/// `end`, a frame, is sent again each time that the board has been quiet.
pub fn send(
    mut stream: UnixStream,
    bytes: Vec<u8>,
    end: &[u8],
    window: Option<u64>,
    acknowledged: Arc<Acknowledged>,
) -> Sender {
    let sent = Arc::new(AtomicU64::new(0));
    let counter = Arc::clone(&sent);
    let ends = end.repeat(ENDS);
    thread::spawn(move || {
        let mut rest = bytes.as_slice();
        let mut done = 0;
        while !rest.is_empty() {
            let mut count = rest.len().min(4096);
            if let Some(window) = window {
                if done >= window && !acknowledged.wait_beyond(done - window) {
                    return;
                }
                let room = (acknowledged.bytes() + window).saturating_sub(done);
                count = count.min(room as usize);
            }
            // The machine may go first.
            if stream.write_all(&rest[..count]).is_err() {
                return;
            }
            rest = &rest[count..];
            done += count as u64;
            counter.store(done, Ordering::Relaxed);
        }
        let mut taken = acknowledged.bytes();
        // Keeps the UART connected until the machine goes.
        let _ = stream.set_read_timeout(window.is_none().then_some(QUIET));
        while let Err(error) = stream.read(&mut [0]) {
            if !matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) {
                return;
            }
            let before = std::mem::replace(&mut taken, acknowledged.bytes());
            if taken == before && stream.write_all(&ends).is_err() {
                return;
            }
        }
    });
    Sender { sent }
}
