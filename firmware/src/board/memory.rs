//! The large statics, and where they lie.

use crate::arrivals::{Arrivals, EVERY};
use crate::ring::Ring;
use static_cell::ConstStaticCell;
use surefix_core::bank_report::BankReport;
use surefix_core::monitor::Monitor;
use surefix_core::satellite_report::SatelliteReport;
use surefix_core::tight::{MonitorFastFilters, MonitorSecondaries};

/// Receiver bytes the ring holds: 178 ms at 921,600 baud.
pub const RECEIVED_CAPACITY: usize = 16384;

/// Receiver bytes between interrupt and worker.
pub static RECEIVED: Ring<RECEIVED_CAPACITY> = Ring::empty();

/// When they came. Twice what a full ring has: the bytes that the worker has in hand are older.
pub static ARRIVED: Arrivals<{ 2 * RECEIVED_CAPACITY / EVERY as usize }> = Arrivals::empty();

/// All state of surefix but the filters of the bank; one task takes it.
// SAFETY: the section is a data section that the board fills before `main` (h743/start.rs).
#[cfg_attr(feature = "board-h743", unsafe(link_section = ".d2sram"))]
static MONITOR: ConstStaticCell<Monitor> = ConstStaticCell::new(Monitor::EMPTY);

/// What the bank found at an epoch, on its way out.
// SAFETY: as for the section of `MONITOR`.
#[cfg_attr(feature = "board-h743", unsafe(link_section = ".d2sram"))]
static BANK: ConstStaticCell<BankReport> = ConstStaticCell::new(BankReport::EMPTY);

/// The satellites of an epoch, on their way out.
// SAFETY: as for the section of `MONITOR`.
#[cfg_attr(feature = "board-h743", unsafe(link_section = ".d2sram"))]
static SATELLITES: ConstStaticCell<SatelliteReport> = ConstStaticCell::new(SatelliteReport::EMPTY);

/// F00 and F0n: beside the stack in the fastest memory.
static FAST: ConstStaticCell<MonitorFastFilters> = ConstStaticCell::new(MonitorFastFilters::EMPTY);

/// The secondary filters. A cell that is not taken and empty filters are zeros, and so no load for the
/// flash: where the section is the board's own, it holds zeros before `main` (h743/start.rs).
// SAFETY: as for the section of `MONITOR`.
#[cfg_attr(feature = "board-h743", unsafe(link_section = ".axisram"))]
static SECONDARIES: ConstStaticCell<MonitorSecondaries> =
    ConstStaticCell::new(MonitorSecondaries::EMPTY);

/// Bytes on their way to a recording.
#[cfg(feature = "spi-bridge")]
static RECORDING: ConstStaticCell<crate::recording::Recording> =
    ConstStaticCell::new(crate::recording::Recording::EMPTY);

/// The memory that one task takes.
pub struct Memory {
    /// All state of surefix but the filters of the bank.
    pub monitor: &'static mut Monitor,
    /// F00 and F0n.
    pub fast: &'static mut MonitorFastFilters,
    /// The secondary filters.
    pub secondaries: &'static mut MonitorSecondaries,
    /// What the bank found at an epoch.
    pub bank: &'static mut BankReport,
    /// The satellites of an epoch.
    pub satellites: &'static mut SatelliteReport,
    /// Bytes on their way to a recording.
    #[cfg(feature = "spi-bridge")]
    pub recording: &'static mut crate::recording::Recording,
}

impl Memory {
    /// Everything; `None` when it was taken before.
    pub fn take() -> Option<Self> {
        Some(Self {
            monitor: MONITOR.try_take()?,
            fast: FAST.try_take()?,
            secondaries: SECONDARIES.try_take()?,
            bank: BANK.try_take()?,
            satellites: SATELLITES.try_take()?,
            #[cfg(feature = "spi-bridge")]
            recording: RECORDING.try_take()?,
        })
    }
}
