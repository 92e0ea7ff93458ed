//! Multiple-hypothesis solution separation: a bank of filters, each without one or two satellites.
//!
//! ```text
//! one transition, one epoch ─► F00 (all), F0n (without n), Fnm (without n and m)
//!                                └─ separations against thresholds ─► detection ─► isolation ─► exclusion
//!                                └─ covariances ─► protection levels
//! ```
//!
//! All filters are errors of one nominal trajectory. [P0] (26)-(32) as corrected in
//! docs/decisions/006-filter-bank.md.

pub mod bank;
pub mod correlated;
mod least_squares;
pub mod probation;
pub mod protection;
pub mod selection;
pub mod separation;

pub use bank::{
    Bank, BankEpoch, BankRow, BankVerdict, Criterion, Explanation, MAX_BANK, PostfitLimits,
    Secondaries, SubFilters,
};
pub use correlated::{CorrelatedBound, CorrelatedRow};
pub use probation::Probation;
pub use protection::{BankAllocation, FaultPriors, LevelForm};
pub use separation::{Separation, SeparationQuantiles};
