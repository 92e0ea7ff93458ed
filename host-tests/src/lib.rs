//! Everything surefix does on a PC: replay, simulation, reports, and the tests of the core.

pub mod faults;
pub mod qemu;
pub mod report;
pub mod rinex;
pub mod rtcm_encode;
pub mod simulate;
