//! The error-state Kalman filter, made for a bank: a filter knows no nominal trajectory, only how far
//! it believes the one nominal to be off.
//!
//! ```text
//! IMU steps ─► process ─► Transition ───┐ once per epoch, shared by all filters
//! corrected epoch ─► information ───────┤
//!                                       ▼
//!                     Filter: predict(&Transition), update(&EpochInformation)
//! ```

#[cfg(test)]
mod dense;
pub mod filter;
pub mod information;
mod joint;
pub mod layout;
pub mod navigator;
pub mod process;

pub mod transition;
pub mod update;

pub use filter::{ErrorState, Filter, Unhealthy};
pub use information::{EpochInformation, MeasurementRow};

pub use navigator::{AntennaState, Navigator};
pub use process::{LeverState, ProcessAccumulator};
pub use transition::Transition;
pub use update::{UpdateSummary, UpdateWorkspace};
