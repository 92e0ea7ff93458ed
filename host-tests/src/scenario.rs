//! Scenario folders and result files.
//!
//! A folder holds `imu.csv`, `gnss.csv` and `init.csv`, all a navigator may read, and for scoring
//! `truth.csv`. One `result.csv` comes out, one row per epoch of `gnss.csv`.

pub mod folder;
pub mod result;
pub mod run;
pub mod table;

pub use folder::{GnssEpoch, GnssRow, ImuRow, Init, Scenario};
pub use result::{Differences, ResultFile, ResultRow};
