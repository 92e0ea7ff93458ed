//! The verdict on one epoch, and every reason it can have.

use crate::gnss::{Satellite, SatelliteSet};

/// May the position be used?
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Integrity {
    /// Monitored, no fault, levels within limits.
    Nominal = 0,
    /// As nominal, with a faulty satellite excluded.
    Excluded = 1,
    /// A fault is present and not excluded: do not use.
    Alert = 2,
    /// No trustworthy level, or a level above its limit: do not use.
    Unavailable = 3,
}

/// Where the position comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Mode {
    /// No position.
    None = 0,
    /// One epoch's pseudoranges.
    Snapshot = 1,
    /// The tightly coupled filter.
    Tight = 2,
    /// The receiver's own solution, alone or in the loosely coupled filter.
    Loose = 3,
}

/// What the inertial side does, and why it does not serve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum InertialStatus {
    /// No inertial unit is configured.
    Off = 0,
    /// No sample has arrived yet.
    NoSample = 1,
    /// Samples arrive; position, velocity or attitude to start from are not known yet.
    Aligning = 2,
    /// The filter runs.
    Running = 3,
    /// Samples stopped, or there was a gap too long to bridge.
    ImuSilent = 4,
    /// Samples at the end of the sensors' range for too long.
    ImuSaturated = 5,
    /// Samples that are no numbers for too long.
    ImuNotFinite = 6,
    /// Time of the samples ran backwards, or away from that of the receiver.
    ImuTime = 7,
    /// The covariance or the state of the filter became unusable.
    Unhealthy = 8,
    /// The receiver's epoch came after samples that are later by more than one interval.
    EpochLate = 9,
    /// Inertial units differ, and none of them explains it alone.
    ImuDisagree = 10,
}

/// Why a verdict is what it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Reason {
    /// Nothing to explain.
    None = 0,
    /// Fewer usable satellites than unknowns.
    TooFewSatellites = 1,
    /// As many satellites as unknowns: a position, but nothing to test it with.
    NoRedundancy = 2,
    /// The satellites' directions leave a direction undetermined.
    BadGeometry = 3,
    /// The least-squares iteration did not settle.
    NoConvergence = 4,
    /// The position lies outside the space a user of satellites can be in.
    ImplausiblePosition = 5,
    /// The test failed and no set of satellites explains it clearly enough to exclude it.
    FaultNotIsolated = 6,
    /// The horizontal protection level exceeds the alert limit.
    HplAboveLimit = 7,
    /// The vertical protection level exceeds the alert limit.
    VplAboveLimit = 8,
    /// The epoch took longer than its budget.
    DeadlineMissed = 9,
    /// The monitor has not been configured.
    NotConfigured = 10,
    /// The receiver clock lies farther from the systems' times than a receiver lets it, or the
    /// systems' clocks lie too far apart: an error common to all satellites, which no residual shows.
    ImplausibleClock = 11,
    /// The receiver gave no epoch when one was due; the position is the filter's own.
    ReceiverSilent = 12,
    /// The position is the filter's own, and nothing tests it.
    NotMonitored = 13,
    /// Hypotheses without a filter have spent the integrity risk: there is no level, as after a fault of two
    /// satellites at once or of a constellation.
    RiskSpent = 14,
    /// A test failed not long ago, and no satellite was excluded for it.
    AlertHeld = 15,
    /// The levels have not been within their limits for long enough since one was not.
    Settling = 16,
    /// The receiver gives its own solution and no observations: nothing tests it.
    NoRawData = 17,
}

/// Why there is no protection level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum NoBound {
    /// There is no position to bound.
    NoPosition = 0,
    /// Without redundancy a fault on one satellite moves the position unseen.
    NoRedundancy = 1,
    /// One satellite cannot be tested: a fault on it does not show in the residuals.
    Untestable = 2,
    /// A detected fault was not excluded.
    FaultPresent = 3,
    /// The arithmetic gave no finite number.
    NotFinite = 4,
    /// The answer came too late to be one.
    DeadlineMissed = 5,
    /// Faults that no filter stands for are likelier than the integrity risk allows.
    RiskSpent = 6,
    /// A detected fault is no longer seen, and was not excluded.
    AlertHeld = 7,
    /// There are no observations that a position could be tested with.
    NoRawData = 8,
}

impl NoBound {
    /// The cause of a number in a report frame.
    pub const fn from_u8(number: u8) -> Option<Self> {
        Some(match number {
            0 => Self::NoPosition,
            1 => Self::NoRedundancy,
            2 => Self::Untestable,
            3 => Self::FaultPresent,
            4 => Self::NotFinite,
            5 => Self::DeadlineMissed,
            6 => Self::RiskSpent,
            7 => Self::AlertHeld,
            8 => Self::NoRawData,
            _ => return None,
        })
    }
}

/// A protection level, or why there is none. There is no number that means "none".
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ProtectionLevel {
    /// The bound, m.
    Bound(f64),
    /// No bound could be computed.
    Unavailable(NoBound),
}

impl ProtectionLevel {
    /// A bound, or `Unavailable` when the number is not finite.
    pub fn from_bound(bound_m: f64) -> Self {
        if bound_m.is_finite() {
            Self::Bound(bound_m)
        } else {
            Self::Unavailable(NoBound::NotFinite)
        }
    }

    /// True only for a finite bound below the limit; NaN and `Unavailable` both answer no.
    pub fn is_within(self, alert_limit_m: f64) -> bool {
        matches!(self, Self::Bound(level_m) if level_m.is_finite() && level_m < alert_limit_m)
    }

    /// The bound, m.
    pub fn bound_m(self) -> Option<f64> {
        match self {
            Self::Bound(level_m) => Some(level_m),
            Self::Unavailable(_) => None,
        }
    }
}

/// The satellite that most likely failed, and by how much.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Suspect {
    /// Which.
    pub satellite: Satellite,
    /// Measured minus predicted pseudorange, predicted by the other satellites of the epoch, m.
    pub bias_m: f64,
    /// One sigma of it, m.
    pub sigma_m: f64,
    /// Probability of a missed detection that the tests of the phase are made for, 1.
    pub p_md: f64,
}

/// The verdict on one epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verdict {
    /// May the position be used?
    pub integrity: Integrity,
    /// Why.
    pub reason: Reason,
    /// Horizontal protection level.
    pub hpl: ProtectionLevel,
    /// Vertical protection level.
    pub vpl: ProtectionLevel,
    /// Horizontal alert limit, m.
    pub hal_m: f64,
    /// Vertical alert limit, m; `None` where the phase has none.
    pub val_m: Option<f64>,
    /// Satellites excluded as faulty at this epoch.
    pub excluded: SatelliteSet,
    /// Test statistic (weighted sum of squared residuals) of the satellites used, 1.
    pub statistic: Option<f64>,
    /// Its threshold, 1.
    pub threshold: Option<f64>,
}

impl Verdict {
    /// No position, for this reason.
    pub const fn unavailable(reason: Reason, hal_m: f64, val_m: Option<f64>) -> Self {
        Self {
            integrity: Integrity::Unavailable,
            reason,
            hpl: ProtectionLevel::Unavailable(NoBound::NoPosition),
            vpl: ProtectionLevel::Unavailable(NoBound::NoPosition),
            hal_m,
            val_m,
            excluded: SatelliteSet::EMPTY,
            statistic: None,
            threshold: None,
        }
    }
}

impl Verdict {
    /// The verdict on another position than the one it was made for, `separation_m` away (horizontal,
    /// vertical, m): both levels grow by the way between the two, and are compared with the limits
    /// again. Whatever bounds the one error bounds the other so.
    pub fn moved_by(&self, separation_m: [f64; 2]) -> Self {
        let [horizontal_m, vertical_m] = separation_m;
        let mut moved = *self;
        let grown = |level: ProtectionLevel, by_m: f64| match level {
            ProtectionLevel::Bound(bound_m) => ProtectionLevel::from_bound(bound_m + by_m),
            unavailable @ ProtectionLevel::Unavailable(_) => unavailable,
        };
        moved.hpl = grown(self.hpl, horizontal_m);
        moved.vpl = grown(self.vpl, vertical_m);
        if !self.integrity.is_usable() {
            return moved;
        }
        let vertical_is_within = self.val_m.is_none_or(|val_m| moved.vpl.is_within(val_m));
        if !moved.hpl.is_within(self.hal_m) {
            moved.integrity = Integrity::Unavailable;
            moved.reason = Reason::HplAboveLimit;
        } else if !vertical_is_within {
            moved.integrity = Integrity::Unavailable;
            moved.reason = Reason::VplAboveLimit;
        }
        moved
    }
}

impl Integrity {
    /// Name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nominal => "nominal",
            Self::Excluded => "excluded",
            Self::Alert => "alert",
            Self::Unavailable => "unavailable",
        }
    }

    /// The state of a number in a report frame.
    pub const fn from_u8(number: u8) -> Option<Self> {
        Some(match number {
            0 => Self::Nominal,
            1 => Self::Excluded,
            2 => Self::Alert,
            3 => Self::Unavailable,
            _ => return None,
        })
    }

    /// Whether the position may be used.
    pub const fn is_usable(self) -> bool {
        matches!(self, Self::Nominal | Self::Excluded)
    }
}

impl Mode {
    /// Name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Snapshot => "snapshot",
            Self::Tight => "tight",
            Self::Loose => "loose",
        }
    }

    /// The mode of a number in a report frame.
    pub const fn from_u8(number: u8) -> Option<Self> {
        Some(match number {
            0 => Self::None,
            1 => Self::Snapshot,
            2 => Self::Tight,
            3 => Self::Loose,
            _ => return None,
        })
    }
}

impl InertialStatus {
    /// Every status, in the order of its number in a report frame.
    pub const ALL: [Self; 11] = [
        Self::Off,
        Self::NoSample,
        Self::Aligning,
        Self::Running,
        Self::ImuSilent,
        Self::ImuSaturated,
        Self::ImuNotFinite,
        Self::ImuTime,
        Self::Unhealthy,
        Self::EpochLate,
        Self::ImuDisagree,
    ];

    /// Name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::NoSample => "no_sample",
            Self::Aligning => "aligning",
            Self::Running => "running",
            Self::ImuSilent => "imu_silent",
            Self::ImuSaturated => "imu_saturated",
            Self::ImuNotFinite => "imu_not_finite",
            Self::ImuTime => "imu_time",
            Self::Unhealthy => "unhealthy",
            Self::EpochLate => "epoch_late",
            Self::ImuDisagree => "imu_disagree",
        }
    }

    /// The status of a number in a report frame.
    pub fn from_u8(number: u8) -> Option<Self> {
        Self::ALL.get(number as usize).copied()
    }
}

impl Reason {
    /// Every reason, in the order of its number in a report frame.
    pub const ALL: [Self; 18] = [
        Self::None,
        Self::TooFewSatellites,
        Self::NoRedundancy,
        Self::BadGeometry,
        Self::NoConvergence,
        Self::ImplausiblePosition,
        Self::FaultNotIsolated,
        Self::HplAboveLimit,
        Self::VplAboveLimit,
        Self::DeadlineMissed,
        Self::NotConfigured,
        Self::ImplausibleClock,
        Self::ReceiverSilent,
        Self::NotMonitored,
        Self::RiskSpent,
        Self::AlertHeld,
        Self::Settling,
        Self::NoRawData,
    ];

    /// Name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::TooFewSatellites => "too_few_satellites",
            Self::NoRedundancy => "no_redundancy",
            Self::BadGeometry => "bad_geometry",
            Self::NoConvergence => "no_convergence",
            Self::ImplausiblePosition => "implausible_position",
            Self::FaultNotIsolated => "fault_not_isolated",
            Self::HplAboveLimit => "hpl_above_limit",
            Self::VplAboveLimit => "vpl_above_limit",
            Self::DeadlineMissed => "deadline_missed",
            Self::NotConfigured => "not_configured",
            Self::ImplausibleClock => "implausible_clock",
            Self::ReceiverSilent => "receiver_silent",
            Self::NotMonitored => "not_monitored",
            Self::RiskSpent => "risk_spent",
            Self::AlertHeld => "alert_held",
            Self::Settling => "settling",
            Self::NoRawData => "no_raw_data",
        }
    }

    /// The reason of a number in a report frame.
    pub fn from_u8(number: u8) -> Option<Self> {
        Self::ALL.get(number as usize).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_that_is_no_number_is_never_within_a_limit() {
        assert!(ProtectionLevel::Bound(3.0).is_within(4.0));
        assert!(!ProtectionLevel::Bound(4.0).is_within(4.0));
        assert!(!ProtectionLevel::Bound(f64::NAN).is_within(f64::INFINITY));
        assert!(!ProtectionLevel::from_bound(f64::INFINITY).is_within(f64::INFINITY));
        assert!(!ProtectionLevel::Unavailable(NoBound::NoPosition).is_within(f64::INFINITY));
    }

    /// INT-016.
    #[test]
    fn a_verdict_moved_to_another_position_has_levels_wider_by_the_way() {
        let mut verdict = Verdict::unavailable(Reason::None, 40.0, Some(35.0));
        verdict.integrity = Integrity::Nominal;
        verdict.hpl = ProtectionLevel::Bound(10.0);
        verdict.vpl = ProtectionLevel::Bound(20.0);
        let near = verdict.moved_by([1.0, 2.0]);
        assert_eq!(near.hpl, ProtectionLevel::Bound(11.0));
        assert_eq!(near.vpl, ProtectionLevel::Bound(22.0));
        assert_eq!(near.integrity, Integrity::Nominal);
        for (way, reason) in [
            ([30.0, 0.0], Reason::HplAboveLimit),
            ([0.0, 15.0], Reason::VplAboveLimit),
            ([f64::NAN, 0.0], Reason::HplAboveLimit),
        ] {
            let far = verdict.moved_by(way);
            assert_eq!(far.integrity, Integrity::Unavailable);
            assert_eq!(far.reason, reason);
        }
        verdict.integrity = Integrity::Alert;
        verdict.reason = Reason::FaultNotIsolated;
        let alert = verdict.moved_by([100.0, 0.0]);
        assert_eq!(alert.integrity, Integrity::Alert);
        assert_eq!(alert.reason, Reason::FaultNotIsolated);
    }

    #[test]
    fn numbers_in_frames_come_back_as_what_they_were() {
        for reason in Reason::ALL {
            assert_eq!(Reason::from_u8(reason as u8), Some(reason));
        }
        assert_eq!(Reason::from_u8(Reason::ALL.len() as u8), None);
        for status in InertialStatus::ALL {
            assert_eq!(InertialStatus::from_u8(status as u8), Some(status));
        }
    }
}
