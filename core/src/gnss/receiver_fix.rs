//! A position and a velocity that the receiver computed itself, of satellites that are not told.

use crate::frames::geodesy::Llh;
use crate::time::GpsTime;

/// What a receiver's solution is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum FixQuality {
    /// Code ranges.
    Code = 1,
    /// Code ranges with differential corrections.
    Differential = 2,
    /// Carrier phases, ambiguities estimated as real numbers.
    Float = 3,
    /// Carrier phases, ambiguities fixed to integers.
    Fixed = 4,
}

impl FixQuality {
    /// The quality of a number in a frame.
    pub const fn from_u8(number: u8) -> Option<Self> {
        Some(match number {
            1 => Self::Code,
            2 => Self::Differential,
            3 => Self::Float,
            4 => Self::Fixed,
            _ => return None,
        })
    }
}

/// The velocity of a receiver's solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixVelocity {
    /// North, east, down, m/s.
    pub ned_mps: [f64; 3],
    /// One sigma per axis by the receiver's own estimate, m/s.
    pub accuracy_mps: f64,
}

/// A receiver's solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixSolution {
    /// What it is made of.
    pub quality: FixQuality,
    /// The antenna on WGS-84.
    pub llh: Llh,
    /// One sigma of the horizontal position by the receiver's own estimate, both axes together, m.
    pub horizontal_accuracy_m: f64,
    /// One sigma of the height likewise, m.
    pub vertical_accuracy_m: f64,
    /// The velocity, where the receiver has one.
    pub velocity: Option<FixVelocity>,
}

/// What a receiver says of itself at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReceiverFix {
    /// When.
    pub time: GpsTime,
    /// Satellites it used.
    pub satellites: u8,
    /// Its solution in three dimensions, if it has one that it stands by.
    pub solution: Option<FixSolution>,
}
