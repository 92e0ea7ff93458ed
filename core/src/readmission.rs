//! Satellites that the snapshot monitor has excluded, and when they come back.
//!
//! A satellite that one epoch excludes may pass the test of the next, while its fault goes on near the
//! threshold. So it stays out of all epochs until it has agreed for five minutes without a break with the
//! positions computed without it, the rule of the bank (`mhss/probation.rs`). While the bank runs, its list is
//! the one that counts.

use crate::gnss::SatelliteSet;
use crate::integrity::{Integrity, Reason};
use crate::mhss::Probation;
use crate::snapshot::{Assessment, SnapshotMonitor};
use crate::time::GpsTime;

/// Who is out, and who proves itself.
#[derive(Clone, Debug)]
pub(crate) struct Readmission {
    excluded: SatelliteSet,
    probation: Probation,
}

impl Readmission {
    /// Nobody is out.
    pub(crate) const NOBODY: Self = Self {
        excluded: SatelliteSet::EMPTY,
        probation: Probation::EMPTY,
    };

    /// Satellites to leave out.
    pub(crate) const fn excluded(&self) -> SatelliteSet {
        self.excluded
    }

    /// All times so far were of another week; who was on probation begins again.
    pub(crate) fn shift(&mut self) {
        self.probation.clear();
    }

    /// The bank ran: what it leaves out is left out, by its own rule, and after it stops until proven here.
    pub(crate) fn adopt(&mut self, excluded: SatelliteSet) {
        self.excluded = excluded;
        self.probation.clear();
    }

    /// An epoch was assessed without the satellites that are out.
    #[inline(never)]
    pub(crate) fn observe(
        &mut self,
        now: GpsTime,
        assessment: &Assessment,
        snapshot: &SnapshotMonitor,
    ) {
        let verdict = &assessment.verdict;
        let is_tested = verdict.integrity.is_usable()
            || matches!(
                verdict.reason,
                Reason::HplAboveLimit | Reason::VplAboveLimit
            );
        if verdict.integrity == Integrity::Alert {
            // Nothing is proved against positions that are not to be believed.
            self.probation.clear();
        } else if is_tested && let Some(solution) = &assessment.solution {
            let mut proved = SatelliteSet::EMPTY;
            for satellite in self.excluded.iter() {
                let Some(estimate) = snapshot.disagreement(satellite, solution) else {
                    continue;
                };
                if self.probation.observe(
                    now,
                    satellite,
                    estimate.bias_m,
                    estimate.sigma_m * estimate.sigma_m,
                ) {
                    proved.insert(satellite);
                }
            }
            for satellite in proved.iter() {
                self.excluded.remove(satellite);
            }
        }
        self.excluded = union(self.excluded, assessment.excluded_here);
    }
}

/// Satellites of either set.
pub(crate) fn union(mut of: SatelliteSet, others: SatelliteSet) -> SatelliteSet {
    for satellite in others.iter() {
        of.insert(satellite);
    }
    of
}

/// Satellites of one set that are not in the other.
pub(crate) fn without(mut of: SatelliteSet, others: SatelliteSet) -> SatelliteSet {
    for satellite in others.iter() {
        of.remove(satellite);
    }
    of
}
