//! Two opinions on an epoch, the snapshot's and the bank's, made into one verdict.
//!
//! The worse opinion holds. The snapshot has a vote only when it can test: with four satellites or fewer, or in
//! bad geometry, it abstains, and the bank alone decides, so that coasting stays possible. Levels come from the
//! bank; where it has none to give, as after a fault of two satellites, or none within the limits, as where leaving a
//! satellite out leaves no position, a tested snapshot's serve, wider by the way between the two positions.

use super::{Integrity, NoBound, ProtectionLevel, Reason, Verdict};
use crate::gnss::SatelliteSet;

/// What the bank says of an epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BankOpinion {
    /// A test failed and no exclusion explains it.
    pub is_alerted: bool,
    /// Satellites that the bank has excluded.
    pub excluded: SatelliteSet,
    /// Horizontal and vertical level, m, where there is one.
    pub levels_m: [Option<f64>; 2],
}

/// How the two opinions stand to each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Opinions {
    /// Both see the same: no fault, or one that both have taken out or not.
    Agree = 0,
    /// The snapshot cannot test this epoch.
    SnapshotAbstains = 1,
    /// The bank sees a fault that the snapshot does not.
    BankOnly = 2,
    /// The snapshot sees a fault that the bank does not.
    SnapshotOnly = 3,
}

impl Opinions {
    /// Every one, in the order of its number in a frame.
    pub const ALL: [Self; 4] = [
        Self::Agree,
        Self::SnapshotAbstains,
        Self::BankOnly,
        Self::SnapshotOnly,
    ];

    /// Name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Agree => "agree",
            Self::SnapshotAbstains => "snapshot_abstains",
            Self::BankOnly => "bank_only",
            Self::SnapshotOnly => "snapshot_only",
        }
    }

    /// The opinions of a number in a frame.
    pub fn from_u8(number: u8) -> Option<Self> {
        Self::ALL.get(usize::from(number)).copied()
    }
}

/// What the snapshot's vote is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Vote {
    Abstains,
    /// Tested and passed, maybe after an exclusion.
    Passed,
    /// A fault that no exclusion explains.
    Fault,
    /// No test, but a reason not to trust the epoch.
    Objects,
}

fn vote(snapshot: &Verdict) -> Vote {
    match (snapshot.integrity, snapshot.reason) {
        (Integrity::Alert, _) => Vote::Fault,
        (Integrity::Nominal | Integrity::Excluded, _) => Vote::Passed,
        (Integrity::Unavailable, Reason::HplAboveLimit | Reason::VplAboveLimit) => Vote::Passed,
        (
            Integrity::Unavailable,
            Reason::TooFewSatellites
            | Reason::NoRedundancy
            | Reason::BadGeometry
            | Reason::NoConvergence,
        ) => Vote::Abstains,
        (
            Integrity::Unavailable,
            Reason::None
            | Reason::ImplausiblePosition
            | Reason::FaultNotIsolated
            | Reason::DeadlineMissed
            | Reason::NotConfigured
            | Reason::ImplausibleClock
            | Reason::ReceiverSilent
            | Reason::NotMonitored
            | Reason::RiskSpent
            | Reason::AlertHeld
            | Reason::Settling
            | Reason::NoRawData,
        ) => Vote::Objects,
    }
}

/// The verdict on the filter's position. `separation_m` is the way from the snapshot's position, horizontal and
/// vertical.
pub fn combine(
    snapshot: &Verdict,
    bank: &BankOpinion,
    separation_m: Option<[f64; 2]>,
) -> (Verdict, Opinions) {
    let vote = vote(snapshot);
    let seen_by_snapshot_alone = snapshot
        .excluded
        .iter()
        .any(|satellite| !bank.excluded.contains(satellite));
    let opinions = match (vote, bank.is_alerted) {
        (Vote::Abstains, _) => Opinions::SnapshotAbstains,
        (Vote::Passed, true) => Opinions::BankOnly,
        (Vote::Fault | Vote::Objects, false) => Opinions::SnapshotOnly,
        (Vote::Passed, false) if seen_by_snapshot_alone => Opinions::SnapshotOnly,
        (Vote::Passed, false) | (Vote::Fault | Vote::Objects, true) => Opinions::Agree,
    };
    let mut verdict = *snapshot;
    verdict.excluded = bank.excluded;
    for satellite in snapshot.excluded.iter() {
        verdict.excluded.insert(satellite);
    }
    let without_levels = |mut verdict: Verdict, integrity, reason, why| {
        verdict.integrity = integrity;
        verdict.reason = reason;
        verdict.hpl = ProtectionLevel::Unavailable(why);
        verdict.vpl = ProtectionLevel::Unavailable(why);
        verdict
    };
    if bank.is_alerted || vote == Vote::Fault {
        let alert = without_levels(
            verdict,
            Integrity::Alert,
            Reason::FaultNotIsolated,
            NoBound::FaultPresent,
        );
        return (alert, opinions);
    }
    if vote == Vote::Objects {
        let reason = snapshot.reason;
        let refused = without_levels(
            verdict,
            Integrity::Unavailable,
            reason,
            NoBound::FaultPresent,
        );
        return (refused, opinions);
    }
    // A snapshot that still used what the bank has taken out at this epoch bounds nothing.
    let is_fresh = bank
        .excluded
        .iter()
        .all(|satellite| snapshot.excluded.contains(satellite));
    let moved = separation_m
        .filter(|_| vote == Vote::Passed && is_fresh)
        .map(|separation_m| snapshot.moved_by(separation_m));
    let is_within = |verdict: &Verdict| {
        verdict.hpl.is_within(verdict.hal_m)
            && verdict
                .val_m
                .is_none_or(|val_m| verdict.vpl.is_within(val_m))
    };
    let mut of_bank = verdict;
    if let [Some(hpl_m), Some(vpl_m)] = bank.levels_m {
        of_bank.hpl = ProtectionLevel::from_bound(hpl_m);
        of_bank.vpl = ProtectionLevel::from_bound(vpl_m);
    }
    let has_levels = bank.levels_m.iter().all(Option::is_some);
    match moved {
        _ if has_levels && is_within(&of_bank) => verdict = of_bank,
        Some(moved) if !has_levels || is_within(&moved) => {
            verdict.hpl = moved.hpl;
            verdict.vpl = moved.vpl;
        }
        _ if has_levels => verdict = of_bank,
        _ => {
            let refused = without_levels(
                verdict,
                Integrity::Unavailable,
                Reason::RiskSpent,
                NoBound::RiskSpent,
            );
            return (refused, opinions);
        }
    }
    let vertical_is_within = verdict
        .val_m
        .is_none_or(|val_m| verdict.vpl.is_within(val_m));
    (verdict.integrity, verdict.reason) = if !verdict.hpl.is_within(verdict.hal_m) {
        (Integrity::Unavailable, Reason::HplAboveLimit)
    } else if !vertical_is_within {
        (Integrity::Unavailable, Reason::VplAboveLimit)
    } else if verdict.excluded.is_empty() {
        (Integrity::Nominal, Reason::None)
    } else {
        (Integrity::Excluded, Reason::None)
    };
    (verdict, opinions)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::{Satellite, System};

    const QUIET: BankOpinion = BankOpinion {
        is_alerted: false,
        excluded: SatelliteSet::EMPTY,
        levels_m: [Some(8.0), Some(12.0)],
    };

    fn snapshot(integrity: Integrity, reason: Reason) -> Verdict {
        let mut verdict = Verdict::unavailable(reason, 40.0, Some(35.0));
        verdict.integrity = integrity;
        if integrity.is_usable() {
            verdict.hpl = ProtectionLevel::Bound(20.0);
            verdict.vpl = ProtectionLevel::Bound(30.0);
        }
        verdict
    }

    fn set(prn: u8) -> SatelliteSet {
        let mut set = SatelliteSet::EMPTY;
        set.insert(Satellite::new(System::Gps, prn).unwrap());
        set
    }

    /// INT-028.
    #[test]
    fn a_snapshot_that_cannot_test_leaves_the_verdict_to_the_bank() {
        for reason in [
            Reason::TooFewSatellites,
            Reason::NoRedundancy,
            Reason::BadGeometry,
            Reason::NoConvergence,
        ] {
            let (verdict, opinions) =
                combine(&snapshot(Integrity::Unavailable, reason), &QUIET, None);
            assert_eq!(opinions, Opinions::SnapshotAbstains);
            assert_eq!(verdict.integrity, Integrity::Nominal);
            assert_eq!(verdict.hpl, ProtectionLevel::Bound(8.0));
        }
    }

    /// INT-028.
    #[test]
    fn the_worse_opinion_holds_and_is_visible() {
        let passed = snapshot(Integrity::Nominal, Reason::None);
        let failed = snapshot(Integrity::Alert, Reason::FaultNotIsolated);
        let alerted = BankOpinion {
            is_alerted: true,
            ..QUIET
        };
        for (snapshot, bank, opinions) in [
            (passed, alerted, Opinions::BankOnly),
            (failed, QUIET, Opinions::SnapshotOnly),
            (failed, alerted, Opinions::Agree),
        ] {
            let (verdict, found) = combine(&snapshot, &bank, Some([0.0; 2]));
            assert_eq!(found, opinions);
            assert_eq!(verdict.integrity, Integrity::Alert);
            assert_eq!(
                verdict.hpl,
                ProtectionLevel::Unavailable(NoBound::FaultPresent)
            );
        }
        let (verdict, opinions) = combine(&passed, &QUIET, Some([0.0; 2]));
        assert_eq!(
            (verdict.integrity, opinions),
            (Integrity::Nominal, Opinions::Agree)
        );
    }

    #[test]
    fn what_the_snapshot_objects_to_is_not_usable() {
        for reason in [Reason::ImplausibleClock, Reason::ImplausiblePosition] {
            let objects = snapshot(Integrity::Unavailable, reason);
            let (verdict, opinions) = combine(&objects, &QUIET, None);
            assert_eq!(verdict.integrity, Integrity::Unavailable);
            assert_eq!((verdict.reason, opinions), (reason, Opinions::SnapshotOnly));
        }
    }

    #[test]
    fn satellites_that_either_took_out_are_named() {
        let mut excluded = snapshot(Integrity::Excluded, Reason::None);
        excluded.excluded = set(3);
        let bank = BankOpinion {
            excluded: set(7),
            ..QUIET
        };
        let (verdict, opinions) = combine(&excluded, &bank, Some([0.0; 2]));
        assert_eq!(verdict.integrity, Integrity::Excluded);
        assert_eq!(verdict.excluded.len(), 2);
        assert_eq!(opinions, Opinions::SnapshotOnly);
    }

    #[test]
    fn without_levels_of_the_bank_a_tested_snapshot_serves() {
        let bank = BankOpinion {
            levels_m: [None; 2],
            ..QUIET
        };
        let passed = snapshot(Integrity::Nominal, Reason::None);
        let (verdict, _) = combine(&passed, &bank, Some([1.0, 2.0]));
        assert_eq!(verdict.integrity, Integrity::Nominal);
        assert_eq!(verdict.hpl, ProtectionLevel::Bound(21.0));
        assert_eq!(verdict.vpl, ProtectionLevel::Bound(32.0));
        let abstains = snapshot(Integrity::Unavailable, Reason::NoRedundancy);
        let (verdict, _) = combine(&abstains, &bank, Some([1.0, 2.0]));
        assert_eq!(verdict.integrity, Integrity::Unavailable);
        assert_eq!(verdict.reason, Reason::RiskSpent);
    }

    #[test]
    fn levels_above_a_limit_are_not_available() {
        let passed = snapshot(Integrity::Nominal, Reason::None);
        for (levels_m, reason) in [
            ([Some(40.0), Some(1.0)], Reason::HplAboveLimit),
            ([Some(1.0), Some(35.0)], Reason::VplAboveLimit),
            ([Some(f64::NAN), Some(1.0)], Reason::HplAboveLimit),
        ] {
            let bank = BankOpinion { levels_m, ..QUIET };
            let (verdict, _) = combine(&passed, &bank, None);
            assert_eq!(verdict.integrity, Integrity::Unavailable);
            assert_eq!(verdict.reason, reason);
        }
    }

    #[test]
    fn numbers_in_frames_come_back_as_what_they_were() {
        for opinions in Opinions::ALL {
            assert_eq!(Opinions::from_u8(opinions as u8), Some(opinions));
        }
        assert_eq!(Opinions::from_u8(4), None);
    }
}
