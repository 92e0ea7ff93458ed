//! Filters without a whole constellation.
//!
//! A fault of a constellation (its orbits, its time) shows in the separation of the main filter from one
//! that has none of its satellites. There is such a filter for every constellation in the bank as long as
//! another one is there; with one constellation alone nothing could be told.

use super::{Bank, SubFilters};
use crate::consts::MAX_CLOCKS;
use crate::ekf::Filter;
use crate::gnss::System;

impl<const K: usize, const M: usize> Bank<K, M> {
    /// Begins filters for the constellations that have satellites in the bank, beside others, and ends
    /// those of constellations that are alone or gone. After [`Bank::admit`], before the main filter is
    /// updated. Gives the constellations whose filters begin now.
    ///
    /// A filter begins as a copy of the main one. That is exact where the main one holds nothing of
    /// the constellation; where it does, as when a second constellation appears, the filter is blind for a
    /// fault from before.
    pub fn monitor_constellations(
        &mut self,
        main: &Filter<K, M>,
        sub: &mut SubFilters<K, M>,
    ) -> [bool; MAX_CLOCKS] {
        let mut has_members = [false; MAX_CLOCKS];
        for member in &self.members {
            if let Some(place) = has_members.get_mut(member.satellite.system().index()) {
                *place = true;
            }
        }
        let several = has_members.iter().filter(|has| **has).count() > 1;
        let mut begun = [false; MAX_CLOCKS];
        let filters = sub.constellations.iter_mut().zip(&mut self.constellations);
        for ((has_members, (filter, place)), begins) in
            has_members.into_iter().zip(filters).zip(&mut begun)
        {
            if !(several && has_members) {
                *place = None;
            } else if place.is_none() {
                filter.clone_from(main);
                *place = Some(super::Separation::ZERO);
                *begins = true;
            }
        }
        begun
    }

    /// The filters without a constellation other than this one begin anew as copies of the main one.
    pub(super) fn begin_constellations(
        &self,
        but: System,
        main: &Filter<K, M>,
        sub: &mut SubFilters<K, M>,
    ) {
        let places = System::ALL.into_iter().zip(&self.constellations);
        for (own, (system, place)) in sub.constellations.iter_mut().zip(places) {
            if place.is_some() && system != but {
                own.clone_from(main);
            }
        }
    }

    /// Updates the filters without a constellation, each with the satellites of the others.
    #[inline(never)]
    pub fn update_constellations(&mut self, sub: &mut SubFilters<K, M>) {
        let filters = sub.constellations.iter_mut().zip(&self.constellations);
        for ((filter, place), system) in filters.zip(System::ALL) {
            if place.is_none() {
                continue;
            }
            self.without.clone_from(&self.aid);
            for (member, row) in self.members.iter().zip(&self.rows) {
                if let Some(row) = row
                    && member.satellite.system() != system
                {
                    self.without.add_row(row);
                }
            }
            filter.update(&self.without, &mut self.update_workspace);
        }
    }

    /// The tests of the filters without a constellation.
    pub fn constellation_separations(&self) -> impl Iterator<Item = (System, &super::Separation)> {
        let filters = System::ALL.into_iter().zip(&self.constellations);
        filters.filter_map(|(system, separation)| Some((system, separation.as_ref()?)))
    }
}

impl<const K: usize, const M: usize> SubFilters<K, M> {
    /// The filter without a constellation, whether it runs or not.
    pub fn constellation(&self, system: System) -> Option<&Filter<K, M>> {
        self.constellations.get(system.index())
    }
}

const _: () = assert!(System::ALL.len() == MAX_CLOCKS);
