//! The filter without aids.
//!
//! What a barometer or a standstill says goes into every filter alike, main and all others: it is in the
//! sums of information that each of them is updated with, once, and dP = P_0n − P_00 stays right. An aid
//! that is wrong is then a fault that no filter without a satellite shows. It shows in the separation of
//! the main filter from the one that has all satellites and no aid, which is tested like those, and is one
//! more hypothesis of the levels: docs/decisions/017-aids.md.

use super::{Bank, Secondaries, SubFilters};
use crate::ekf::{EpochInformation, Filter};
use crate::mhss::separation::Separation;

impl<const K: usize, const M: usize> Bank<K, M> {
    /// What the aids say of this epoch; before [`Bank::admit`], at every epoch.
    pub fn aid(&mut self, information: &EpochInformation<M>) {
        self.aid.clone_from(information);
    }

    /// Begins the filter without aids at the first epoch that has one. After [`Bank::admit`], before the main
    /// filter is updated; true when it begins. It begins as a copy of the main one, which is exact: no filter
    /// has had an aid until then. It is kept for good: what an aid has left in the main filter stays there.
    pub fn monitor_aids(&mut self, main: &Filter<K, M>, sub: &mut SubFilters<K, M>) -> bool {
        let begins = self.aid.rows() > 0 && self.unaided.is_none();
        if begins {
            sub.unaided.clone_from(main);
            self.unaided = Some(Separation::ZERO);
        }
        begins
    }

    /// Updates the filter without aids, with the satellites alone.
    #[inline(never)]
    pub fn update_unaided(&mut self, sub: &mut SubFilters<K, M>) {
        if self.unaided.is_none() {
            return;
        }
        self.without.clear();
        for row in self.rows.iter().flatten() {
            self.without.add_row(row);
        }
        sub.unaided
            .update(&self.without, &mut self.update_workspace);
    }

    /// The test of the filter without aids, while it runs.
    pub const fn unaided_separation(&self) -> Option<&Separation> {
        self.unaided.as_ref()
    }

    /// Leaves the aids out of all that was: the filter without them becomes the main one and all others begin
    /// as copies of it. False when there is no such filter.
    #[inline(never)]
    pub fn exclude_aids(
        &mut self,
        main: &mut Filter<K, M>,
        sub: &mut SubFilters<K, M>,
        secondaries: &mut Secondaries<K, M>,
    ) -> bool {
        if self.unaided.take().is_none() {
            return false;
        }
        main.clone_from(&sub.unaided);
        self.aid.clear();
        self.begin_all(main, sub, secondaries);
        true
    }
}

impl<const K: usize, const M: usize> SubFilters<K, M> {
    /// The filter without aids, whether it runs or not.
    pub const fn unaided(&self) -> &Filter<K, M> {
        &self.unaided
    }
}
