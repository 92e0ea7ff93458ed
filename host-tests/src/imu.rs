//! An inertial unit on a PC: what a configuration file says of it, its recordings, and their place in
//! the stream of bytes a board would see.
//!
//! | file | what it does |
//! |---|---|
//! | `imu/settings.rs` | section `[imu]` of a configuration file to an `InertialConfig` |
//! | `imu/units.rs` | sections `[[imu.unit]]`, and the recordings of several units as one |
//! | `imu/samples.rs` | a recording, CSV or surefix's own frames, to `ImuSample`s |
//! | `imu/interleave.rs` | samples and a receiver's bytes in the order of their times |

mod interleave;
mod samples;
mod settings;
mod units;

pub(crate) use interleave::frames;
pub use interleave::{Measured, Pending, interleave};
pub use samples::{Recorded, read};
pub use settings::latency_ns;
pub use settings::{ImuSettings, mounting_c_b_s};
pub use units::read_all;
