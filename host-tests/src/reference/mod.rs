//! The reference model, slow and by the textbook: one strapdown solution and a bank of dense filters of
//! 17 states, each on its own, that take a scenario folder and say what `result.csv` should hold.
//!
//! It shares no code with the core, which computes the same with blocks, compressed epochs and
//! shared transitions. Where the two agree, neither has the other's slip.
//!
//! | symbol | meaning |
//! |---|---|
//! | dr, dv | position, velocity: estimate minus truth, ECEF |
//! | ψ | attitude: Ĉ = (I + [ψ×]) C |
//! | db_g, db_a | biases: truth minus estimate, body axes |
//! | dc_b, dc_d | clock bias and drift: estimate minus truth |
//!
//! The state corrects an estimate by taking dr, dv, ψ and the clock off and adding the biases.
//!
//! Choices that the model leaves open, and that the reference results of ../shared/scenarios bear out
//! to micrometres: gravity at the position of the middle of an interval, Coriolis with its mean
//! velocity, the body axes of an interval's start turned by half the Earth's angle; a substep's
//! specific force is the sum of the velocity increments in ECEF, sculling included, over its length,
//! its attitude the one before the sample that starts in its middle.

pub mod bank;
pub mod double;
pub mod earth;
pub mod filter;
pub mod navigator;
pub mod separation;
pub mod strapdown;
pub mod transition;

pub use bank::Bank;
pub use filter::{Covariance, DenseFilter, ErrorState, Row, STATES};
pub use navigator::{Navigator, run};
pub use strapdown::{Increment, Nominal, Strapdown};
pub use transition::{Accumulator, Noise};

use nalgebra::{Matrix3, Vector3};

/// The matrix of a cross product: [a×] b = a × b.
pub fn skew(a: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0)
}
