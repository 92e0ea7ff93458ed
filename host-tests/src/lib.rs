//! Everything surefix does on a PC: replay, simulation, reports, and the tests of the core.

pub mod aiding;
pub mod araim;
pub mod bridge;
pub mod broadcast_encode;
pub mod calibrate;
pub mod campaign;
pub mod compare;
pub mod consistency;
pub mod faults;
pub mod fixes;
pub mod hybrid;
pub mod imu;
pub mod latency;
pub mod linearised;
pub mod mutate;
pub mod nmea;
pub mod output;
pub mod parts;
pub mod qemu;
pub mod real_time;
pub mod reference;
pub mod replay;
pub mod report;
pub mod rinex;
pub mod rtcm_encode;
pub mod scenario;
pub mod settings;
pub mod simulate;
pub mod source;
pub mod static_imu;
pub mod track;
pub mod truth;
pub mod ubx_encode;

/// The example of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
pub struct ReadmeDoctests;
