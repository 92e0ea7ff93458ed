//! surefix-core: an integrity monitor for satellite and inertial navigation that runs whole on a
//! microcontroller.
//!
//! The same bytes give the same bits on a PC and on a Cortex-M7: no allocation, no `std`, no
//! unsafe code, every loop bounded by a capacity, every function of mathematics from `libm`.
//!
//! In reading order, which is the order in which data flows:
//!
//! | module | what it does |
//! |---|---|
//! | [`consts`], [`time`], [`linalg`], [`stats`], [`frames`] | numbers: sourced constants, GNSS time, small QR, tails and quantiles, geodesy |
//! | [`wire`] | bytes to checked messages (UBX, RTCM 3, surefix's own frame, navigation messages), and what is sent: frames, NMEA |
//! | [`gnss`] | satellites: observation epochs, broadcast orbits and clocks, atmosphere, sigmas, the snapshot solution |
//! | [`ins`] | inertial samples to position, velocity and attitude |
//! | [`ekf`] | the error-state filter: shared transition, compressed update, the tightly coupled navigator |
//! | [`mhss`] | the bank of filters without one and two satellites: detection, isolation, exclusion, levels |
//! | [`raim`] | one-epoch tests, exclusion, slope-based protection levels; ARAIM |
//! | [`integrity`] | phases of flight, reasons, the verdict, how long an alert lasts |
//! | [`config`] | what a user chooses before the first byte |
//! | [`ingest`], [`report`], [`bank_report`], [`satellite_report`], [`inertial_report`], [`sentences`] | checked messages to domain types; verdict, tests of the bank, satellites and inertial side to output messages; the verdict as NMEA |
//! | [`budget`] | the stages of an epoch and what each may cost |
//! | [`snapshot`] | an epoch alone: solution, tests, exclusion, levels |
//! | [`tight`] | inertial samples and epochs to a solution of the filter, and when not |
//! | [`monitor`] | the façade that owns all state |
#![no_std]
#![forbid(unsafe_code)]
#![deny(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing
)]

#[cfg(test)]
extern crate std;

pub mod bank_report;
pub mod budget;
pub mod config;
pub mod consts;
pub mod ekf;
pub mod frames;
pub mod gnss;
pub mod inertial_report;
pub mod ingest;
pub mod ins;
pub mod integrity;
pub mod linalg;
pub mod mhss;
pub mod monitor;
pub mod raim;
mod readmission;
pub mod report;
mod rhythm;
pub mod satellite_report;
pub mod sentences;
pub mod snapshot;
pub mod stats;
pub mod tight;
pub mod time;
pub mod wire;
