//! Are the errors of the tightly coupled navigator as large as it believes?
//!
//! Flights with a known truth, sensors and measurements drawn from the model the filter assumes, many
//! trials. The truth is integrated by the textbook strapdown of [`crate::reference`], the navigator is
//! the core's.

pub mod drift;
pub mod flight;
pub mod sky;
pub mod statistics;
pub mod study;
pub mod trial;

pub use flight::{Flight, Motion};
pub use sky::Sky;
pub use statistics::{Interval, chi_square_interval};
pub use study::{Block, EPOCHS_S, Study, studies};
pub use trial::{Assessment, Grade, Setup, Start, Trial};
