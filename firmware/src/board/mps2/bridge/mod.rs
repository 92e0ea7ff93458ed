//! Sensors that live in a process of the host: what stands for a bus and its parts on an emulated board.
//!
//! No sensor can be attached to QEMU's SPI controllers. One transaction (chip select low to high) becomes a
//! request, the answer what the part shifted out; so do the lines. Requests go through one named pipe and
//! answers through another, both opened by semihosting, while the board's own time stands still; what the
//! transfer would take on a wire the driver waits for afterwards. Each carries
//! that time, and the models on the host advance to it: under `-icount` a run repeats to the instruction.
//!
//! | bytes | request, little endian |
//! |---|---|
//! | 1 | `P` which parts are there, `T` transfer, `E` which lines became active |
//! | 1 | number of the part of a transfer, else 0 |
//! | 2 | n, bytes of a transfer, else 0 |
//! | 8 | time, ns on the clock of the board |
//! | n | what the board shifts out |
//!
//! The answer to `P` is a u32 with a bit for each part, that to `T` n bytes. That to `E` is a u32 with a bit for each line that became active since the
//! last such request, by its number, and a u64: the time at which a line may become active next.
//!
//! | line, part | |
//! |---|---|
//! | 0, 1, 2 | inertial units |
//! | 3 | barometer |
//! | 4 | magnetometer |
//! | 31 | time pulse of the receiver |
//!
//! | file | what it does |
//! |---|---|
//! | `files.rs` | files of the host |
//! | `bus.rs` | requests; `SpiDevice` |
//! | `edges.rs` | timers that stand for the interrupts of the lines |
//!
//! Host: `host-tests/src/bridge/`.

mod bus;
mod edges;
mod files;

pub use bus::{Bus, present};
pub use edges::{Alarm, Edges};
pub use files::File;

/// Time stands still while the host writes: what the monitor was given, for a replay.
pub fn recording() -> Option<File> {
    File::create(c"recording")
}

/// Opens the pipes and starts the timers. For `init`, once.
pub(super) fn start() -> (Edges, Alarm) {
    bus::start();
    (Edges::start(), Alarm::start())
}
