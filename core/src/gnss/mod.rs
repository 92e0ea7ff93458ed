//! Satellites: what was observed, where they were, what delays the signal, and the snapshot solution.

pub mod atmosphere;
pub mod clock;
pub mod corrected;
pub mod ephemeris;
pub mod klobuchar;
pub mod measurement;
mod normals;
pub mod observation;
pub mod orbit;
pub mod receiver_fix;
pub mod satellite;
pub mod signal;
mod sky;
pub mod solution;
pub mod store;
pub mod weights;

pub use corrected::{CorrectedEpoch, CorrectedMeasurement};
pub use ephemeris::{Ephemeris, NavMessage};
pub use klobuchar::{BroadcastIonosphere, KlobucharParameters};
pub use observation::{ObservationEpoch, SatelliteObservation, SignalObservation};
pub use receiver_fix::{FixQuality, FixSolution, FixVelocity, ReceiverFix};
pub use satellite::{Satellite, SatelliteSet, System};
pub use signal::Signal;
pub use store::{EphemerisReason, EphemerisStore};
