//! The large statics, and where they lie.

use crate::ring::Ring;
use static_cell::ConstStaticCell;
use surefix_core::monitor::Monitor;

/// Receiver bytes the ring holds: 178 ms at 921,600 baud.
pub const RECEIVED_CAPACITY: usize = 16384;

/// Receiver bytes between interrupt and worker.
pub static RECEIVED: Ring<RECEIVED_CAPACITY> = Ring::empty();

/// All state of surefix; one task takes it.
// SAFETY: the section is a data section that the board fills before `main` (h743/start.rs).
#[cfg_attr(feature = "board-h743", unsafe(link_section = ".axisram"))]
pub static MONITOR: ConstStaticCell<Monitor> = ConstStaticCell::new(Monitor::EMPTY);
