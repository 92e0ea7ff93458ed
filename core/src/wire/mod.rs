//! Bytes to checked messages and back. Knows layouts, nothing of navigation.
//!
//! The two-level rule: a *view* over bytes checks length and checksum once and then reads any
//! field ([`native::Frame`], [`bits::Bits`]); a small *value* type can hold only legal content.
//! What a view accepts and a value refuses is counted by reason.

pub mod bits;
pub mod broadcast;
pub mod counters;
pub mod crc;
pub mod native;
pub mod nmea;
pub mod rtcm3;
pub mod scanner;
pub mod ubx;

pub use counters::Counters;
pub use scanner::{Scanned, Scanner};
