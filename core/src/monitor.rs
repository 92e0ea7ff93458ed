//! The façade: bytes in, one report per epoch out. Owns all state.
//!
//! ```text
//! bytes ─ push() ─► ingest ─► ephemeris store, ObservationEpoch
//!                                   │ Ready::Epoch
//!                     process() ◄───┘  solution → detection → exclusion → levels → verdict
//!                         └─► EpochReport
//! ```
//!
//! A `Monitor` is large (see `cargo xtask bench`): it lives in a `static` made from
//! [`Monitor::EMPTY`] and is configured in place.

use crate::budget::{CycleCounter, Ledger, STAGES, Stage};
use crate::config::{Config, ConfigError};
use crate::frames::geodesy;
use crate::gnss::klobuchar::KlobucharParameters;
use crate::gnss::solution::{SnapshotError, SnapshotSolution, SnapshotWorkspace};
use crate::gnss::store::EphemerisStore;
use crate::gnss::{ObservationEpoch, SatelliteSet, System, solution};
use crate::ingest::{Event, Ingest};
use crate::integrity::{Integrity, Mode, NoBound, ProtectionLevel, Reason, Verdict};
use crate::raim::exclusion::{Exclusion, Isolation};
use crate::raim::parity::{ParityError, ParityWorkspace};
use crate::raim::table::{RaimTable, TableError};
use crate::report::{EpochReport, Fix, ReportFlags};
use crate::stats::normal;
use crate::time::GpsTime;
use crate::wire::counters::Counters;

/// What [`Monitor::push`] stopped for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ready {
    /// An observation epoch is complete: call [`Monitor::process`].
    Epoch,
    /// The sender says that no more bytes come.
    EndOfStream,
}
