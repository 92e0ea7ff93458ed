//! surefix on a Cortex-M7: what the images share.
//!
//! | module | what it does |
//! |---|---|
//! | [`ring`] | receiver interrupt to worker, lock-free |
//! | [`arrivals`] | when the bytes of the ring came |
//! | [`drivers`] | registers of inertial units, barometers and magnetometers to readings |
//! | [`sensors`] | data-ready lines to samples in the order in which they came |
//! | `board` | registers, memory, clocks and UARTs of the board chosen by feature |
//! | `samples` | with sensors: their samples with GPS time |
//! | `worker` | ring and samples to monitor to output |
//! | `recording` | with sensors on the emulated board: what the monitor was given |
//! | `fault` | panic and fault handlers: the output becomes invalid, then the chip resets |
//!
//! The application is `bin/monitor.rs`. On a PC only the first four exist, so that the whole
//! workspace checks there.
#![cfg_attr(target_os = "none", no_std)]

pub mod arrivals;
#[cfg(target_os = "none")]
pub mod board;
pub mod drivers;
#[cfg(target_os = "none")]
pub mod fault;
#[cfg(all(target_os = "none", feature = "spi-bridge"))]
pub mod recording;
pub mod ring;
#[cfg(all(target_os = "none", feature = "sensors"))]
pub mod samples;
pub mod sensors;
#[cfg(target_os = "none")]
pub mod worker;
