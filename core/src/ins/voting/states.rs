//! What the vote says: a state of every unit, why one is isolated, and how many are left.

/// What becomes of the samples of one unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum UnitState {
    /// There is none.
    Absent = 0,
    /// Its samples are used.
    Used = 1,
    /// None of its samples could be used.
    Silent = 2,
    /// Its samples come and are not used: [`UnitFault`] says why.
    Isolated = 3,
}

impl UnitState {
    /// All, in the order of their numbers.
    pub const ALL: [Self; 4] = [Self::Absent, Self::Used, Self::Silent, Self::Isolated];

    /// The state of a number in a frame.
    pub fn from_u8(number: u8) -> Option<Self> {
        Self::ALL.get(usize::from(number)).copied()
    }

    /// Name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Absent => "absent",
            Self::Used => "used",
            Self::Silent => "silent",
            Self::Isolated => "isolated",
        }
    }
}

/// Why a unit is not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum UnitFault {
    /// It is.
    None = 0,
    /// Its own status says that it failed.
    Status = 1,
    /// No samples.
    Silent = 2,
    /// Samples that are no numbers.
    NotFinite = 3,
    /// Samples at the end of the range.
    Saturated = 4,
    /// Times that ran backwards or leapt.
    Time = 5,
    /// An axis that gives the same again and again while other units do not.
    Stuck = 6,
    /// More noise than it and the others have.
    Noise = 7,
    /// It differs from both others over up to a second.
    Difference = 8,
    /// It differs from both others over longer: what grows slowly.
    Drift = 9,
    /// Its measurements come as those of another time.
    Delay = 10,
}

impl UnitFault {
    /// All, in the order of their numbers.
    pub const ALL: [Self; 11] = [
        Self::None,
        Self::Status,
        Self::Silent,
        Self::NotFinite,
        Self::Saturated,
        Self::Time,
        Self::Stuck,
        Self::Noise,
        Self::Difference,
        Self::Drift,
        Self::Delay,
    ];

    /// The fault of a number in a frame.
    pub fn from_u8(number: u8) -> Option<Self> {
        Self::ALL.get(usize::from(number)).copied()
    }

    /// Name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Status => "status",
            Self::Silent => "silent",
            Self::NotFinite => "not_finite",
            Self::Saturated => "saturated",
            Self::Time => "time",
            Self::Stuck => "stuck",
            Self::Noise => "noise",
            Self::Difference => "difference",
            Self::Drift => "drift",
            Self::Delay => "delay",
        }
    }

    /// Whether the unit itself showed it, without a comparison.
    pub(super) const fn is_its_own(self) -> bool {
        matches!(
            self,
            Self::Status | Self::Silent | Self::NotFinite | Self::Saturated | Self::Time
        )
    }
}

/// How many units the output rests on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum VotingMode {
    /// No vote is configured.
    Off = 0,
    /// No unit is left: there is no output.
    NoUnit = 1,
    /// One unit, and nothing to compare it with.
    One = 2,
    /// Two: a difference is seen, and not who is wrong.
    Two = 3,
    /// Three.
    Three = 4,
    /// Units differ and none explains it: there is no output until they agree again.
    Disagree = 5,
}

impl VotingMode {
    /// All, in the order of their numbers.
    pub const ALL: [Self; 6] = [
        Self::Off,
        Self::NoUnit,
        Self::One,
        Self::Two,
        Self::Three,
        Self::Disagree,
    ];

    /// The mode of a number in a frame.
    pub fn from_u8(number: u8) -> Option<Self> {
        Self::ALL.get(usize::from(number)).copied()
    }

    /// Name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::NoUnit => "no_unit",
            Self::One => "one",
            Self::Two => "two",
            Self::Three => "three",
            Self::Disagree => "disagree",
        }
    }
}
