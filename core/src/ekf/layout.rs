//! The states of a filter, their order and their signs: written here, and nowhere else.
//!
//! | block | states | unit | the entry is |
//! |---|---|---|---|
//! | [`POSITION`] | δr, antenna, ECEF | m | estimate − truth |
//! | [`VELOCITY`] | δv, antenna, ECEF | m/s | estimate − truth |
//! | [`ATTITUDE`] | ψ, ECEF, with Ĉ = (I + \[ψ×\]) C | rad | estimate − truth |
//! | [`GYRO_BIAS`] | δb_g, body | rad/s | truth − estimate |
//! | [`ACCEL_BIAS`] | δb_a, body | m/s² | truth − estimate |
//! | clocks | bias, drift, then one offset per extra constellation | m, m/s, m | estimate − truth |
//!
//! A filter's state is an error of the one nominal trajectory: feedback subtracts the entries of the
//! first three blocks and the clocks from the nominal and adds the biases. A measurement's innovation
//! is predicted minus measured. [P0] (6)-(8), (14)-(24), as corrected in
//! docs/decisions/005-tight-filter.md.
//!
//! The joint block of a measurement is position, velocity and clocks, in this order: [`JOINT_NAVIGATION`]
//! entries and one per clock.

/// Block of the position.
pub const POSITION: usize = 0;
/// Block of the velocity.
pub const VELOCITY: usize = 1;
/// Block of the attitude.
pub const ATTITUDE: usize = 2;
/// Block of the gyroscope biases.
pub const GYRO_BIAS: usize = 3;
/// Block of the accelerometer biases.
pub const ACCEL_BIAS: usize = 4;
/// Number of blocks.
pub const BLOCKS: usize = 5;
/// Pairs of different blocks.
pub const PAIRS: usize = BLOCKS * (BLOCKS - 1) / 2;
/// Navigation states in the joint block of a measurement.
pub const JOINT_NAVIGATION: usize = 6;

/// Clock column of the bias.
pub const CLOCK_BIAS: usize = 0;
/// Clock column of the drift.
pub const CLOCK_DRIFT: usize = 1;
/// First clock column of an offset between systems.
pub const FIRST_OFFSET: usize = 2;

/// Most entries of a joint block: position, velocity and four clock states.
pub const MAX_JOINT: usize = JOINT_NAVIGATION + 4;

/// Where the pair (i, j), i < j, of blocks is stored: 01 02 03 04 12 13 14 23 24 34.
pub(crate) const fn pair(i: usize, j: usize) -> usize {
    i * (2 * BLOCKS - i - 1) / 2 + j - i - 1
}

const _: () = {
    assert!(pair(0, 1) == 0 && pair(0, 4) == 3 && pair(1, 2) == 4 && pair(2, 3) == 7);
    assert!(pair(2, 4) == 8 && pair(3, 4) == PAIRS - 1);
};
