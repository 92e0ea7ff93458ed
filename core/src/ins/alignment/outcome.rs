//! What an alignment found, or why it has not.

use crate::frames::geodesy::GeodesyError;
use crate::frames::rotation::Quaternion;

/// Where an attitude came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum AlignmentMode {
    /// There is none.
    None = 0,
    /// It was given.
    Given = 1,
    /// Roll and pitch from the specific force, heading from the course over ground.
    Course = 2,
    /// Kept from before tight mode ended.
    Kept = 3,
    /// At rest: roll and pitch from the specific force, heading from the rotation of the Earth.
    Gyrocompass = 4,
    /// Roll and pitch from the specific force, heading from the magnetic field.
    MagneticField = 5,
}

impl AlignmentMode {
    /// All, in the order of their numbers.
    pub const ALL: [Self; 6] = [
        Self::None,
        Self::Given,
        Self::Course,
        Self::Kept,
        Self::Gyrocompass,
        Self::MagneticField,
    ];

    /// The mode of a number in a frame.
    pub fn from_u8(number: u8) -> Option<Self> {
        Self::ALL.get(usize::from(number)).copied()
    }

    /// Name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Given => "given",
            Self::Course => "course",
            Self::Kept => "kept",
            Self::Gyrocompass => "gyrocompass",
            Self::MagneticField => "magnetic_field",
        }
    }
}

/// An attitude, and how well it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aligned {
    /// Rotation from body to ECEF.
    pub q_e_b: Quaternion,
    /// One sigma about local north, east, down, rad.
    pub sigma_ned_rad: [f64; 3],
    /// Where it came from.
    pub mode: AlignmentMode,
}

/// Why there is no attitude yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NotAligned {
    /// Too little time between epochs with velocity, or too much.
    Window,
    /// The samples do not cover the window.
    SamplesMissing {
        /// What they cover, s.
        covered_s: f64,
    },
    /// Too slow for a course.
    TooSlow {
        /// Horizontal speed, m/s.
        speed_mps: f64,
    },
    /// The accelerometers and the receiver do not feel the same force.
    ForceMismatch {
        /// Length of the one minus that of the other, m/s².
        difference_mps2: f64,
    },
    /// No local horizontal there.
    Position(GeodesyError),
    /// The attitude is no rotation: a number was not finite.
    NotFinite,
    /// Not at rest, by the samples or by the receiver.
    Moving,
    /// At rest, but not for long enough.
    RestTooShort {
        /// How long, s.
        duration_s: f64,
    },
    /// The heading would be too uncertain: too large a gyroscope bias, too slow for the velocity's noise, too
    /// near to a pole.
    HeadingTooUncertain {
        /// One sigma that it would have, rad.
        sigma_rad: f64,
    },
    /// What the gyroscopes feel is not the rotation of the Earth.
    EarthRateMismatch {
        /// Its length minus the Earth's, sigmas.
        length_sigmas: f64,
        /// Its angle against the specific force minus the Earth's, sigmas.
        angle_sigmas: f64,
    },
    /// No sample of a magnetometer that is configured and trusted.
    NoField,
    /// What the magnetometer feels is not the field of the Earth.
    FieldMismatch {
        /// Its strength minus that configured, sigmas.
        length_sigmas: f64,
        /// Its angle against the specific force minus that of the dip, sigmas.
        angle_sigmas: f64,
    },
}

/// The same without its numbers, for reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Obstacle {
    /// None: there is an attitude, or nothing has been tried.
    None = 0,
    /// [`NotAligned::Window`].
    Window = 1,
    /// [`NotAligned::SamplesMissing`].
    SamplesMissing = 2,
    /// [`NotAligned::TooSlow`].
    TooSlow = 3,
    /// [`NotAligned::ForceMismatch`].
    ForceMismatch = 4,
    /// [`NotAligned::Position`].
    Position = 5,
    /// [`NotAligned::NotFinite`].
    NotFinite = 6,
    /// [`NotAligned::Moving`].
    Moving = 7,
    /// [`NotAligned::RestTooShort`].
    RestTooShort = 8,
    /// [`NotAligned::HeadingTooUncertain`].
    HeadingTooUncertain = 9,
    /// [`NotAligned::EarthRateMismatch`].
    EarthRateMismatch = 10,
    /// [`NotAligned::NoField`].
    NoField = 11,
    /// [`NotAligned::FieldMismatch`].
    FieldMismatch = 12,
    /// The receiver has no position that a fault in it would have been seen in.
    NoTestedPosition = 13,
    /// There is an attitude, and the filter that started from it has not shown yet that it may be believed.
    NotEarned = 14,
}

impl Obstacle {
    /// All, in the order of their numbers.
    pub const ALL: [Self; 15] = [
        Self::None,
        Self::Window,
        Self::SamplesMissing,
        Self::TooSlow,
        Self::ForceMismatch,
        Self::Position,
        Self::NotFinite,
        Self::Moving,
        Self::RestTooShort,
        Self::HeadingTooUncertain,
        Self::EarthRateMismatch,
        Self::NoField,
        Self::FieldMismatch,
        Self::NoTestedPosition,
        Self::NotEarned,
    ];

    /// The obstacle of a number in a frame.
    pub fn from_u8(number: u8) -> Option<Self> {
        Self::ALL.get(usize::from(number)).copied()
    }

    /// Name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Window => "window",
            Self::SamplesMissing => "samples_missing",
            Self::TooSlow => "too_slow",
            Self::ForceMismatch => "force_mismatch",
            Self::Position => "position",
            Self::NotFinite => "not_finite",
            Self::Moving => "moving",
            Self::RestTooShort => "rest_too_short",
            Self::HeadingTooUncertain => "heading_too_uncertain",
            Self::EarthRateMismatch => "earth_rate_mismatch",
            Self::NoField => "no_field",
            Self::FieldMismatch => "field_mismatch",
            Self::NoTestedPosition => "no_tested_position",
            Self::NotEarned => "not_earned",
        }
    }
}

impl From<NotAligned> for Obstacle {
    fn from(why: NotAligned) -> Self {
        match why {
            NotAligned::Window => Self::Window,
            NotAligned::SamplesMissing { .. } => Self::SamplesMissing,
            NotAligned::TooSlow { .. } => Self::TooSlow,
            NotAligned::ForceMismatch { .. } => Self::ForceMismatch,
            NotAligned::Position(_) => Self::Position,
            NotAligned::NotFinite => Self::NotFinite,
            NotAligned::Moving => Self::Moving,
            NotAligned::RestTooShort { .. } => Self::RestTooShort,
            NotAligned::HeadingTooUncertain { .. } => Self::HeadingTooUncertain,
            NotAligned::EarthRateMismatch { .. } => Self::EarthRateMismatch,
            NotAligned::NoField => Self::NoField,
            NotAligned::FieldMismatch { .. } => Self::FieldMismatch,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_names_are_each_ones_own() {
        for (number, mode) in AlignmentMode::ALL.iter().enumerate() {
            assert_eq!(*mode as usize, number);
            assert_eq!(AlignmentMode::from_u8(number as u8), Some(*mode));
        }
        for (number, obstacle) in Obstacle::ALL.iter().enumerate() {
            assert_eq!(*obstacle as usize, number);
            assert_eq!(Obstacle::from_u8(number as u8), Some(*obstacle));
            let same = Obstacle::ALL.iter().filter(|o| o.name() == obstacle.name());
            assert_eq!(same.count(), 1);
        }
        assert_eq!(AlignmentMode::from_u8(6), None);
        assert_eq!(Obstacle::from_u8(15), None);
    }
}
