//! Groups of corrected measurements to epochs.

use super::assembler::{LateEpochs, Outcome};
use super::{CorrectedGroup, Event};
use crate::gnss::CorrectedEpoch;
use crate::wire::Counters;
use crate::wire::counters::count;

/// The corrected epoch being put together. It and the receiver's epoch know nothing of each other.
#[derive(Clone, Debug)]
pub(super) struct CorrectedAssembler {
    epoch: CorrectedEpoch,
    /// A group is missing in `epoch`.
    is_incomplete: bool,
    /// More groups of `epoch` are expected.
    is_open: bool,
    /// The time of `epoch` is one that was received.
    has_time: bool,
    /// The group that comes next.
    next_group: u8,
    late: LateEpochs,
}

impl CorrectedAssembler {
    pub(super) const EMPTY: Self = Self {
        epoch: CorrectedEpoch::EMPTY,
        is_incomplete: false,
        is_open: false,
        has_time: false,
        next_group: 0,
        late: LateEpochs::NONE,
    };

    pub(super) const fn epoch(&self) -> &CorrectedEpoch {
        &self.epoch
    }

    pub(super) const fn is_incomplete(&self) -> bool {
        self.is_incomplete
    }

    /// Ends an epoch that waits for more; tells whether there was one.
    pub(super) fn close_incomplete(&mut self, counters: &mut Counters) -> bool {
        if !self.is_open {
            return false;
        }
        self.is_incomplete = true;
        self.close(counters);
        true
    }

    fn close(&mut self, counters: &mut Counters) {
        self.is_open = false;
        count(&mut counters.epochs);
        if self.is_incomplete {
            count(&mut counters.epochs_incomplete);
        }
    }

    pub(super) fn take(&mut self, group: &CorrectedGroup<'_>, counters: &mut Counters) -> Outcome {
        let is_of_open_epoch = self.is_open && group.time == self.epoch.time;
        if !is_of_open_epoch {
            if self.has_time && group.time <= self.epoch.time {
                // As with a receiver's epochs: late ones are dropped, a sender that went back for good
                // is followed.
                if group.time == self.epoch.time || !self.late.note(group.time) {
                    count(&mut counters.messages_too_late);
                    return Outcome::Used;
                }
                if !self.is_open {
                    count(&mut counters.time_restarts);
                }
            }
            if self.close_incomplete(counters) {
                return Outcome::FirstGives(Event::CorrectedEpochReady);
            }
            self.epoch.time = group.time;
            self.epoch.rows.clear();
            self.is_incomplete = false;
            self.is_open = true;
            self.has_time = true;
            self.next_group = 0;
        }
        self.late = LateEpochs::NONE;
        if group.group < self.next_group {
            count(&mut counters.messages_too_late);
            return Outcome::Used;
        }
        self.is_incomplete |= group.group > self.next_group;
        self.next_group = group.group.saturating_add(1);
        let rows = &mut self.epoch.rows;
        group.for_each(|row| {
            if rows.iter().any(|known| known.satellite == row.satellite) {
                count(&mut counters.duplicate_observations);
            } else if rows.push(row).is_err() {
                count(&mut counters.satellites_lost);
            }
        });
        if self.next_group < group.groups {
            return Outcome::Used;
        }
        self.close(counters);
        Outcome::UsedGives(Event::CorrectedEpochReady)
    }
}
