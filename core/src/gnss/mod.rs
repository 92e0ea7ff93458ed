//! Satellites: what was observed, where they were, what delays the signal, and the snapshot solution.

pub mod ephemeris;
pub mod klobuchar;
pub mod observation;
pub mod satellite;
pub mod signal;

pub use ephemeris::{Ephemeris, NavMessage};
pub use klobuchar::KlobucharParameters;
pub use observation::{ObservationEpoch, SatelliteObservation, SignalObservation};
pub use satellite::{Satellite, SatelliteSet, System};
pub use signal::Signal;
