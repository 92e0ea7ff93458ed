//! The shared transition Φ and process noise Q of one epoch, in blocks.
//!
//! Only rows that are not trivial are stored: position and velocity depend on everything, the
//! attitude on itself and the gyroscope biases, the biases on themselves.

use super::layout::{ATTITUDE, BLOCKS, GYRO_BIAS, PAIRS, POSITION, VELOCITY};
use crate::linalg::block3::{Block, IDENTITY, Symmetric, ZERO};

/// A symmetric 15×15 matrix in blocks: a covariance of the navigation states, or their noise.
#[derive(Clone, Debug, PartialEq)]
pub struct NavigationCovariance {
    /// Blocks on the diagonal.
    pub diagonal: [Symmetric; BLOCKS],
    /// Blocks above it, by rows: 01 02 03 04 12 13 14 23 24 34.
    pub off_diagonal: [Block; PAIRS],
}

impl NavigationCovariance {
    /// All zero.
    pub const ZERO: Self = Self {
        diagonal: [[0.0; 6]; BLOCKS],
        off_diagonal: [ZERO; PAIRS],
    };
}

/// Rows of the transition matrix that are not trivial.
#[derive(Clone, Debug, PartialEq)]
pub struct NavigationTransition {
    /// Row of the position: all five blocks.
    pub position: [Block; BLOCKS],
    /// Row of the velocity: all five blocks.
    pub velocity: [Block; BLOCKS],
    /// Row of the attitude: attitude and gyroscope biases.
    pub attitude: [Block; 2],
}

impl NavigationTransition {
    /// Nothing moves.
    pub const IDENTITY: Self = Self {
        position: [IDENTITY, ZERO, ZERO, ZERO, ZERO],
        velocity: [ZERO, IDENTITY, ZERO, ZERO, ZERO],
        attitude: [IDENTITY, ZERO],
    };
}

/// Transition and noise of the clock states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockTransition {
    /// Bias per drift, s.
    pub bias_per_drift_s: f64,
    /// Drift per drift, 1.
    pub decay: f64,
    /// Noise of the bias, m².
    pub bias_var: f64,
    /// Noise common to bias and drift, m²/s.
    pub bias_drift_cov: f64,
    /// Noise of the drift, m²/s².
    pub drift_var: f64,
    /// Noise of each offset between systems, m².
    pub offset_var: f64,
}

impl ClockTransition {
    /// Nothing moves.
    pub const IDENTITY: Self = Self {
        bias_per_drift_s: 0.0,
        decay: 1.0,
        bias_var: 0.0,
        bias_drift_cov: 0.0,
        drift_var: 0.0,
        offset_var: 0.0,
    };
}

/// What all filters are propagated with, once per epoch.
#[derive(Clone, Debug, PartialEq)]
pub struct Transition {
    /// Φ of the navigation states.
    pub phi: NavigationTransition,
    /// Q of the navigation states.
    pub noise: NavigationCovariance,
    /// Φ and Q of the clocks.
    pub clock: ClockTransition,
}

impl Transition {
    /// Nothing moves.
    pub const IDENTITY: Self = Self {
        phi: NavigationTransition::IDENTITY,
        noise: NavigationCovariance::ZERO,
        clock: ClockTransition::IDENTITY,
    };
}

const _: () = assert!(POSITION == 0 && VELOCITY == 1 && ATTITUDE + 1 == GYRO_BIAS);
