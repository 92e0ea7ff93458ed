//! Navigation messages bit by bit, as satellites broadcast them and receivers pass them on.
//!
//! In: an ephemeris, and the instant at which a subframe or page begins. Out: its words.
//!
//! | message | of | file | source |
//! |---|---|---|---|
//! | LNAV | GPS | `lnav.rs` | [IS-GPS-200] 20.3 |
//! | I/NAV | Galileo E1-B | `inav.rs` | [GAL-OS-SIS-ICD] 4.3 |
//! | D1, D2 | BDS B1I | `beidou.rs` | [BDS-SIS-ICD-B1I] 5 |
//!
//! `schedule.rs` knows when each is sent. This is the other half of the receiver's decoder and shares
//! nothing with it: written from the documents, held against recordings in `tests/simulate_ubx.rs`.

mod beidou;
mod bits;
mod inav;
mod lnav;
mod schedule;

pub use beidou::{BCH_CHECK_BITS, bch_check};
pub use bits::crc24q;
pub use lnav::parity;
pub use schedule::{Sent, sent_between};

/// π of the broadcast messages: what turns semicircles into radians. [IS-GPS-200] 20.3.3.4.3.
#[expect(
    clippy::approx_constant,
    reason = "the documents give these digits, and ephemerides are fitted with them"
)]
const PI: f64 = 3.141_592_653_589_8;

/// Two to a negative power.
fn two_to_minus(power: i32) -> f64 {
    libm::ldexp(1.0, -power)
}
