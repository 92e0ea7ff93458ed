//! The bank: one filter per satellite left out, one per pair.
//!
//! In: the shared transition, the rows of an epoch, the main filter. Out: separations, levels, which
//! satellite is isolated; the main filter is replaced when a satellite is excluded.
//!
//! | filter | without | stored in | how many |
//! |---|---|---|---|
//! | F00 | none | the navigator | 1 |
//! | F0n | n | [`SubFilters`] | N |
//! | Fnm | n and m | [`Secondaries`] | N (N − 1) / 2 |
//!
//! Besides these one for each constellation that is left out (`bank/constellations.rs`), and one without
//! aids (`bank/aids.rs`).
//!
//! The information of an epoch without one or two satellites is summed up from parts (those before,
//! between and after), never subtracted from the whole. Births, held satellites, deaths and exclusion:
//! docs/decisions/006-filter-bank.md. Equations: [P0] (26)-(32).

use heapless::Vec;
use nalgebra::Matrix3;

use super::separation::{self, Separation, SeparationQuantiles, Variances};
use crate::consts::MAX_CLOCKS;
use crate::ekf::filter::PredictWorkspace;
use crate::ekf::{
    EpochInformation, ErrorState, Filter, MeasurementRow, Transition, UpdateWorkspace,
};
use crate::gnss::{Satellite, SatelliteSet};
use crate::time::GpsTime;

mod aids;
mod constellations;
mod isolation;
mod places;

pub(crate) use isolation::residual;
pub use isolation::{Explanation, PostfitLimits};

/// Most satellites in the bank.
pub const MAX_BANK: usize = 24;
/// Pairs of them.
pub const MAX_PAIRS: usize = MAX_BANK * (MAX_BANK - 1) / 2;

/// Where the filter without the satellites of two different places is stored.
const fn pair(a: usize, b: usize) -> usize {
    let (low, high) = if a < b { (a, b) } else { (b, a) };
    low * (2 * MAX_BANK - low - 1) / 2 + high - low - 1
}

const _: () = assert!(pair(0, 1) == 0 && pair(MAX_BANK - 1, MAX_BANK - 2) == MAX_PAIRS - 1);

/// Filters that leave one satellite out, by the satellite's place, and those without a whole constellation.
#[derive(Clone, Debug)]
pub struct SubFilters<const K: usize, const M: usize> {
    filters: [Filter<K, M>; MAX_BANK],
    constellations: [Filter<K, M>; MAX_CLOCKS],
    /// Without any aid.
    unaided: Filter<K, M>,
}

impl<const K: usize, const M: usize> SubFilters<K, M> {
    /// Empty.
    pub const EMPTY: Self = Self {
        filters: [const { Filter::EMPTY }; MAX_BANK],
        constellations: [const { Filter::EMPTY }; MAX_CLOCKS],
        unaided: Filter::EMPTY,
    };
}

/// Filters that leave two satellites out, by the pair of places. The largest part of the bank: a memory of
/// its own on a microcontroller.
#[derive(Clone, Debug)]
pub struct Secondaries<const K: usize, const M: usize> {
    filters: [Filter<K, M>; MAX_PAIRS],
}

impl<const K: usize, const M: usize> Secondaries<K, M> {
    /// Empty.
    pub const EMPTY: Self = Self {
        filters: [const { Filter::EMPTY }; MAX_PAIRS],
    };
}

/// A satellite of an epoch with its rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BankRow<const M: usize> {
    /// Which satellite.
    pub satellite: Satellite,
    /// Its linearised measurements.
    pub row: MeasurementRow<M>,
}

/// An epoch as the bank takes it.
#[derive(Clone, Copy, Debug)]
pub struct BankEpoch<'a, const M: usize> {
    /// When.
    pub time: GpsTime,
    /// Its satellites.
    pub rows: &'a [BankRow<M>],
    /// How long the filters of a satellite that vanished are kept, ns.
    pub hold_ns: i64,
}

/// What the separations are tested against.
#[derive(Clone, Copy, Debug)]
pub struct Criterion<'a> {
    /// Quantiles of the allocated risks.
    pub quantiles: &'a SeparationQuantiles,
    /// Test the vertical separation too.
    pub vertical: bool,
    /// Rotation from ECEF to the local horizontal.
    pub c_enu_e: &'a Matrix3<f64>,
}

/// A satellite with a place in the bank.
#[derive(Clone, Copy, Debug)]
struct Member {
    satellite: Satellite,
    /// Its place: number of its sub-filter.
    place: usize,
    /// First epoch without it, if it is missing.
    missing_since: Option<GpsTime>,
    /// Whether its filters began at this epoch.
    is_new: bool,
    separation: Separation,
}

/// What the bank says of an epoch, before any exclusion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BankVerdict {
    /// At least one test failed.
    pub detected: bool,
    /// The satellite that the secondary filters single out.
    pub isolated: Option<Satellite>,
    /// One sigma of the main filter's position, horizontal and vertical, m.
    pub sigma_m: [f64; 2],
    /// Largest T + a over the sub-filters, horizontal and vertical, m; 0 for an empty bank.
    pub level_m: [f64; 2],
    /// Largest d + a: how far off the position may be while a fault is present, m.
    pub alerted_level_m: [f64; 2],
    /// Fault-free level of the main filter, m.
    pub fault_free_m: [f64; 2],
}

impl BankVerdict {
    /// Takes a sub-filter's test in.
    fn take(&mut self, of: &Separation, vertical: bool) {
        self.detected |= of.is_failed(vertical);
        for axis in 0..2 {
            raise(&mut self.level_m, axis, &of.threshold_m, &of.uncertainty_m);
            raise(
                &mut self.alerted_level_m,
                axis,
                &of.statistic_m,
                &of.uncertainty_m,
            );
        }
    }
}

/// What a filter says of its position, m²: horizontal and vertical.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OwnVariances {
    /// Variances after the update.
    pub left: Variances,
    /// What the update took from them; horizontally from both directions together.
    pub taken: Variances,
}

/// Variances of positions and separations, beyond those of the filters, m²: horizontal and vertical.
pub trait ExtraNoise {
    /// Of the main filter; asked first.
    fn main(&mut self, own: &OwnVariances) -> Variances;
    /// Of the filter without the satellite of a place, and of its separation from the main one.
    fn sub(&mut self, place: usize, own: &OwnVariances) -> [Variances; 2];
    /// Of the filter without a constellation, and of its separation from the main one.
    fn constellation(&mut self, constellation: usize, own: &OwnVariances) -> [Variances; 2];
    /// Of the filter without any aid, and of its separation from the main one.
    fn unaided(&mut self, own: &OwnVariances) -> [Variances; 2];
    /// Of the separation of the filter without two satellites from that without the first.
    fn pair(&self, base: usize, other: usize) -> Variances;
}

/// The filters know of all noise.
#[derive(Clone, Copy, Debug)]
pub struct WhiteNoise;

impl ExtraNoise for WhiteNoise {
    fn main(&mut self, _: &OwnVariances) -> Variances {
        [0.0; 2]
    }

    fn sub(&mut self, _: usize, _: &OwnVariances) -> [Variances; 2] {
        [[0.0; 2]; 2]
    }

    fn constellation(&mut self, _: usize, _: &OwnVariances) -> [Variances; 2] {
        [[0.0; 2]; 2]
    }

    fn unaided(&mut self, _: &OwnVariances) -> [Variances; 2] {
        [[0.0; 2]; 2]
    }

    fn pair(&self, _: usize, _: usize) -> Variances {
        [0.0; 2]
    }
}

/// Everything of the bank but its filters.
#[derive(Clone, Debug)]
pub struct Bank<const K: usize, const M: usize> {
    /// In the order of their first use.
    members: Vec<Member, MAX_BANK>,
    excluded: SatelliteSet,
    /// The member that was excluded at the last epoch.
    leaving: Option<Member>,
    /// Constellations with a filter of their own, by their numbers.
    constellations: [Option<Separation>; MAX_CLOCKS],
    /// Of the filter without any aid, while it runs.
    unaided: Option<Separation>,
    /// What the aids say of this epoch: in all filters but that one.
    aid: EpochInformation<M>,
    /// Satellites that were excluded once and taken back.
    readmitted: SatelliteSet,
    /// The filters of the pairs missed an epoch.
    pairs_are_dropped: bool,
    /// Rows of the members present at this epoch, in the order of the members.
    rows: [Option<MeasurementRow<M>>; MAX_BANK],
    n_unmonitored: u8,
    /// Information of each member's row, none for one that is missing.
    own: [EpochInformation<M>; MAX_BANK],
    /// Information of the members from each on to the last.
    after: [EpochInformation<M>; MAX_BANK + 1],
    predicted: Predictions,
    before: EpochInformation<M>,
    between: EpochInformation<M>,
    without: EpochInformation<M>,
    predict_workspace: PredictWorkspace,
    update_workspace: UpdateWorkspace<K, M>,
}

impl<const K: usize, const M: usize> Bank<K, M> {
    /// No satellite.
    pub const EMPTY: Self = Self {
        members: Vec::new(),
        excluded: SatelliteSet::EMPTY,
        leaving: None,
        constellations: [None; MAX_CLOCKS],
        unaided: None,
        aid: EpochInformation::ZERO,
        readmitted: SatelliteSet::EMPTY,
        pairs_are_dropped: false,
        rows: [None; MAX_BANK],
        n_unmonitored: 0,
        own: [const { EpochInformation::ZERO }; MAX_BANK],
        after: [const { EpochInformation::ZERO }; MAX_BANK + 1],
        predicted: Predictions::NONE,
        before: EpochInformation::ZERO,
        between: EpochInformation::ZERO,
        without: EpochInformation::ZERO,
        predict_workspace: PredictWorkspace::EMPTY,
        update_workspace: UpdateWorkspace::EMPTY,
    };

    /// Forgets every satellite.
    pub fn clear(&mut self) {
        self.members.clear();
        self.excluded = SatelliteSet::EMPTY;
        self.leaving = None;
        self.constellations = [None; MAX_CLOCKS];
        self.unaided = None;
        self.aid.clear();
        self.readmitted = SatelliteSet::EMPTY;
        self.pairs_are_dropped = false;
        self.rows = [None; MAX_BANK];
        self.n_unmonitored = 0;
    }

    /// Satellites in the bank, those held included.
    pub fn len(&self) -> usize {
        self.members.len()
    }

    /// Whether no satellite is in the bank.
    pub fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// Satellites excluded so far.
    pub const fn excluded(&self) -> SatelliteSet {
        self.excluded
    }

    /// Satellites of the last epoch that found no place: they are in no filter.
    pub const fn n_unmonitored(&self) -> u8 {
        self.n_unmonitored
    }

    /// The satellites in the bank, those held included.
    pub fn satellites(&self) -> SatelliteSet {
        let mut satellites = SatelliteSet::EMPTY;
        for member in &self.members {
            satellites.insert(member.satellite);
        }
        satellites
    }

    /// The tests of the last epoch: the satellites in the bank in the order of their first use, then the
    /// one that was excluded after them.
    pub fn separations(&self) -> impl Iterator<Item = (Satellite, &Separation)> {
        self.members
            .iter()
            .chain(&self.leaving)
            .map(|member| (member.satellite, &member.separation))
    }

    /// The filter without a satellite of the bank.
    pub fn sub_filter<'a>(
        &self,
        without: Satellite,
        sub: &'a SubFilters<K, M>,
    ) -> Option<&'a Filter<K, M>> {
        sub.filters.get(self.place_of(without)?)
    }

    /// The filter without two satellites of the bank.
    pub fn secondary<'a>(
        &self,
        without: [Satellite; 2],
        secondaries: &'a Secondaries<K, M>,
    ) -> Option<&'a Filter<K, M>> {
        let [one, other] = without;
        if one == other {
            return None;
        }
        let at = pair(self.place_of(one)?, self.place_of(other)?);
        secondaries.filters.get(at)
    }

    fn place_of(&self, satellite: Satellite) -> Option<usize> {
        let mut members = self.members.iter();
        let member = members.find(|member| member.satellite == satellite);
        member.map(|member| member.place)
    }

    /// Carries all filters but the main one to the epoch.
    #[inline(never)]
    pub fn predict(
        &mut self,
        transition: &Transition,
        sub: &mut SubFilters<K, M>,
        secondaries: &mut Secondaries<K, M>,
    ) {
        self.predict_sub(transition, sub);
        let workspace = &mut self.predict_workspace;
        for (at, member) in self.members.iter().enumerate() {
            for other in self.members.iter().skip(at + 1) {
                if let Some(filter) = secondaries.filters.get_mut(pair(member.place, other.place)) {
                    filter.predict(transition, workspace);
                }
            }
        }
    }

    /// Carries the filters without one satellite or one constellation to the epoch.
    #[inline(never)]
    pub fn predict_sub(&mut self, transition: &Transition, sub: &mut SubFilters<K, M>) {
        let workspace = &mut self.predict_workspace;
        for (filter, constellation) in sub.constellations.iter_mut().zip(&self.constellations) {
            if constellation.is_some() {
                filter.predict(transition, workspace);
            }
        }
        if self.unaided.is_some() {
            sub.unaided.predict(transition, workspace);
        }
        for member in &self.members {
            if let Some(filter) = sub.filters.get_mut(member.place) {
                filter.predict(transition, workspace);
            }
        }
    }

    /// Takes in the satellites of an epoch, after [`Bank::predict`] and before the main filter is
    /// updated: those that are new begin as copies, those missing for `hold_ns` are removed. Excluded
    /// satellites and those beyond the bank's capacity are passed over.
    ///
    /// `information` becomes that of all members present: what the main filter is to be updated with.
    #[inline(never)]
    pub fn admit(
        &mut self,
        epoch: &BankEpoch<'_, M>,
        main: &Filter<K, M>,
        sub: &mut SubFilters<K, M>,
        secondaries: &mut Secondaries<K, M>,
        information: &mut EpochInformation<M>,
    ) {
        let BankEpoch {
            time,
            rows,
            hold_ns,
        } = *epoch;
        self.leaving = None;
        self.members.retain_mut(|member| {
            member.is_new = false;
            if rows.iter().any(|row| row.satellite == member.satellite) {
                member.missing_since = None;
                return true;
            }
            let since = *member.missing_since.get_or_insert(time);
            time.ns().wrapping_sub(since.ns()) < hold_ns
        });
        self.n_unmonitored = 0;
        for row in rows {
            let is_member = |member: &Member| member.satellite == row.satellite;
            if self.excluded.contains(row.satellite) || self.members.iter().any(is_member) {
                continue;
            }
            if !self.begin(row.satellite, main, sub, secondaries) {
                self.n_unmonitored = self.n_unmonitored.saturating_add(1);
            }
        }
        self.rows = [None; MAX_BANK];
        for (member, place) in self.members.iter().zip(&mut self.rows) {
            *place = rows
                .iter()
                .find(|row| row.satellite == member.satellite)
                .map(|row| row.row);
        }
        self.sum_up(information);
    }

    /// Gives a satellite a place; false when there is none.
    fn begin(
        &mut self,
        satellite: Satellite,
        main: &Filter<K, M>,
        sub: &mut SubFilters<K, M>,
        secondaries: &mut Secondaries<K, M>,
    ) -> bool {
        let is_free = |place: &usize| self.members.iter().all(|member| member.place != *place);
        let Some(place) = (0..MAX_BANK).find(is_free) else {
            return false;
        };
        for member in &self.members {
            let copy = sub.filters.get(member.place);
            let own = secondaries.filters.get_mut(pair(member.place, place));
            if let (Some(copy), Some(own)) = (copy, own) {
                own.clone_from(copy);
            }
        }
        if let Some(own) = sub.filters.get_mut(place) {
            own.clone_from(main);
        }
        self.members
            .push(Member {
                satellite,
                place,
                missing_since: None,
                is_new: true,
                separation: Separation::ZERO,
            })
            .is_ok()
    }

    /// Sums of the rows from each member on to the last.
    fn sum_up(&mut self, information: &mut EpochInformation<M>) {
        let n = self.members.len();
        for (own, row) in self.own.iter_mut().zip(&self.rows).take(n) {
            own.clear();
            if let Some(row) = row {
                own.add_row(row);
            }
        }
        // What the aids say is in each sum once, for each ends with this one.
        if let Some(none) = self.after.get_mut(n) {
            none.clone_from(&self.aid);
        }
        for (at, own) in self.own.iter().enumerate().take(n).rev() {
            if let Some([place, next, ..]) = self.after.get_mut(at..) {
                place.set_sum(next, own);
            }
        }
        if let Some(all) = self.after.first() {
            information.clone_from(all);
        }
    }

    /// Updates all filters but the main one.
    #[inline(never)]
    pub fn update(&mut self, sub: &mut SubFilters<K, M>, secondaries: &mut Secondaries<K, M>) {
        let Self {
            members,
            own,
            after,
            before,
            between,
            without,
            update_workspace,
            ..
        } = self;
        before.clear();
        for (at, (member, own_row)) in members.iter().zip(own.iter()).enumerate() {
            let Some(rest) = after.get(at + 1) else {
                break;
            };
            without.set_sum(before, rest);
            if let Some(filter) = sub.filters.get_mut(member.place) {
                filter.update(without, update_workspace);
            }
            between.clone_from(before);
            let others = members.iter().zip(own.iter()).enumerate().skip(at + 1);
            for (other_at, (other, other_row)) in others {
                let Some(rest) = after.get(other_at + 1) else {
                    break;
                };
                without.set_sum(between, rest);
                if let Some(filter) = secondaries.filters.get_mut(pair(member.place, other.place)) {
                    filter.update(without, update_workspace);
                }
                between.add(other_row);
            }
            before.add(own_row);
        }
    }

    /// Updates the filters without one satellite alone; those of the pairs miss the epoch and must be
    /// [`Bank::drop_pairs`]ped.
    #[inline(never)]
    pub fn update_sub(&mut self, sub: &mut SubFilters<K, M>) {
        self.before.clear();
        for (at, (member, own)) in self.members.iter().zip(&self.own).enumerate() {
            let Some(rest) = self.after.get(at + 1) else {
                break;
            };
            self.without.set_sum(&self.before, rest);
            if let Some(filter) = sub.filters.get_mut(member.place) {
                filter.update(&self.without, &mut self.update_workspace);
            }
            self.before.add(own);
        }
    }

    /// Tests every sub-filter against the main filter, which has been updated, and looks for the one
    /// satellite that explains what it finds. All errors of measurements are taken for white.
    #[inline(never)]
    pub fn test(
        &mut self,
        criterion: &Criterion<'_>,
        main: &Filter<K, M>,
        sub: &SubFilters<K, M>,
        secondaries: &Secondaries<K, M>,
    ) -> BankVerdict {
        self.assess(criterion, &mut WhiteNoise, main, sub, secondaries)
    }

    /// The same with `noise` beyond what the filters know of; constellations that have a filter are tested too.
    #[inline(never)]
    pub fn assess(
        &mut self,
        criterion: &Criterion<'_>,
        noise: &mut impl ExtraNoise,
        main: &Filter<K, M>,
        sub: &SubFilters<K, M>,
        secondaries: &Secondaries<K, M>,
    ) -> BankVerdict {
        let Criterion {
            quantiles,
            vertical,
            c_enu_e,
        } = *criterion;
        let others =
            self.constellations.iter().flatten().count() + usize::from(self.unaided.is_some());
        let k_detection = quantiles.detection(self.members.len() + others);
        let predicted = &self.predicted;
        let own = own_variances(main, predicted.main, c_enu_e);
        let sigma = separation::sigmas_of(own.left, noise.main(&own));
        let mut verdict = BankVerdict {
            detected: false,
            isolated: None,
            level_m: [0.0; 2],
            alerted_level_m: [0.0; 2],
            sigma_m: sigma,
            fault_free_m: sigma.map(|sigma| sigma * quantiles.fault_free()),
        };
        let compare =
            |filter: &Filter<K, M>, own: Variances, extra: Variances, between: Variances| {
                let spread = separation::spread(main, filter, c_enu_e);
                let sigma_m = separation::sigmas_of(own, extra);
                Separation {
                    statistic_m: spread.distance_m,
                    threshold_m: separation::widened(spread.sigma_m, between)
                        .map(|sigma| sigma * k_detection),
                    uncertainty_m: sigma_m.map(|sigma| sigma * quantiles.missed()),
                    sigma_m,
                }
            };
        for member in &mut self.members {
            let Some(filter) = sub.filters.get(member.place) else {
                continue;
            };
            let before = predicted.sub.get(member.place).copied();
            let own = own_variances(filter, before.unwrap_or([0.0; 2]), c_enu_e);
            let [extra, between] = noise.sub(member.place, &own);
            member.separation = compare(filter, own.left, extra, between);
            verdict.take(&member.separation, vertical);
        }
        let filters = sub.constellations.iter().zip(&mut self.constellations);
        for ((constellation, (filter, place)), before) in
            filters.enumerate().zip(predicted.constellations)
        {
            if let Some(place) = place {
                let own = own_variances(filter, before, c_enu_e);
                let [extra, between] = noise.constellation(constellation, &own);
                *place = compare(filter, own.left, extra, between);
                verdict.take(place, vertical);
            }
        }
        if let Some(place) = &mut self.unaided {
            let own = own_variances(&sub.unaided, predicted.unaided, c_enu_e);
            let [extra, between] = noise.unaided(&own);
            *place = compare(&sub.unaided, own.left, extra, between);
            verdict.take(place, vertical);
        }
        if verdict.detected && !self.pairs_are_dropped {
            verdict.isolated = self.isolate(criterion, noise, sub, secondaries);
        }
        verdict
    }

    /// The one satellite whose own test fails and without which no second one is suspect.
    #[inline(never)]
    fn isolate(
        &self,
        criterion: &Criterion<'_>,
        noise: &impl ExtraNoise,
        sub: &SubFilters<K, M>,
        secondaries: &Secondaries<K, M>,
    ) -> Option<Satellite> {
        let Criterion {
            quantiles,
            vertical,
            c_enu_e,
        } = *criterion;
        let k_isolation = quantiles.detection(self.members.len().checked_sub(1)?);
        let mut found = None;
        for member in &self.members {
            let without = sub.filters.get(member.place)?;
            let is_quiet = self
                .members
                .iter()
                .filter(|other| other.place != member.place)
                .all(|other| {
                    let filter = secondaries.filters.get(pair(member.place, other.place));
                    filter.is_some_and(|filter| {
                        let between = noise.pair(member.place, other.place);
                        if separation::is_surely_quiet(
                            without,
                            filter,
                            c_enu_e,
                            between,
                            k_isolation,
                        ) {
                            return true;
                        }
                        let spread = separation::spread(without, filter, c_enu_e);
                        let second = Separation {
                            statistic_m: spread.distance_m,
                            threshold_m: separation::widened(spread.sigma_m, between)
                                .map(|sigma| sigma * k_isolation),
                            ..Separation::ZERO
                        };
                        !second.is_failed(vertical)
                    })
                });
            if !is_quiet {
                continue;
            }
            // A second one that explains it as well leaves it open.
            if found.is_some() {
                return None;
            }
            found = Some(member);
        }
        found
            .filter(|member| member.separation.is_failed(vertical))
            .map(|member| member.satellite)
    }

    /// Leaves a satellite out from now on: its sub-filter becomes the main one, its secondaries become
    /// the sub-filters, and new secondaries begin as their copies. False when it is not in the bank.
    #[inline(never)]
    pub fn exclude(
        &mut self,
        satellite: Satellite,
        main: &mut Filter<K, M>,
        sub: &mut SubFilters<K, M>,
        secondaries: &mut Secondaries<K, M>,
    ) -> bool {
        let Some(leaving) = self.remove(satellite, main, sub, secondaries) else {
            return false;
        };
        // They had the satellite until now, with whatever was wrong with it; that of its own constellation never.
        self.begin_constellations(satellite.system(), main, sub);
        if self.unaided.is_some() {
            sub.unaided.clone_from(main);
        }
        self.leaving = Some(leaving);
        self.excluded.insert(satellite);
        self.readmitted.remove(satellite);
        true
    }

    /// Takes a satellite out of every filter: no filter holds anything of it afterwards.
    fn remove(
        &mut self,
        satellite: Satellite,
        main: &mut Filter<K, M>,
        sub: &mut SubFilters<K, M>,
        secondaries: &mut Secondaries<K, M>,
    ) -> Option<Member> {
        let is_it = |member: &Member| member.satellite == satellite;
        let at = self.members.iter().position(is_it)?;
        let leaving = self.members.remove(at);
        let mut row = None;
        for place in self.rows.iter_mut().skip(at).rev() {
            core::mem::swap(place, &mut row);
        }
        let place = leaving.place;
        if let Some(filter) = sub.filters.get(place) {
            main.clone_from(filter);
        }
        for member in &self.members {
            let copy = secondaries.filters.get(pair(place, member.place));
            let own = sub.filters.get_mut(member.place);
            if let (Some(copy), Some(own)) = (copy, own) {
                own.clone_from(copy);
            }
        }
        self.begin_secondaries(sub, secondaries);
        Some(leaving)
    }

    /// All secondary filters begin as copies of the sub-filters, each of the satellite that was used first.
    fn begin_secondaries(&self, sub: &SubFilters<K, M>, secondaries: &mut Secondaries<K, M>) {
        for (at, member) in self.members.iter().enumerate() {
            for other in self.members.iter().skip(at + 1) {
                let copy = sub.filters.get(member.place);
                let own = secondaries.filters.get_mut(pair(member.place, other.place));
                if let (Some(copy), Some(own)) = (copy, own) {
                    own.clone_from(copy);
                }
            }
        }
    }

    /// The nominal was corrected: all filters are now errors of the corrected one.
    #[inline(never)]
    pub fn rereference(
        &self,
        correction: &ErrorState<K>,
        sub: &mut SubFilters<K, M>,
        secondaries: &mut Secondaries<K, M>,
    ) {
        for (filter, constellation) in sub.constellations.iter_mut().zip(&self.constellations) {
            if constellation.is_some() {
                filter.rereference(correction);
            }
        }
        if self.unaided.is_some() {
            sub.unaided.rereference(correction);
        }
        for (at, member) in self.members.iter().enumerate() {
            if let Some(filter) = sub.filters.get_mut(member.place) {
                filter.rereference(correction);
            }
            if self.pairs_are_dropped {
                continue;
            }
            for other in self.members.iter().skip(at + 1) {
                if let Some(filter) = secondaries.filters.get_mut(pair(member.place, other.place)) {
                    filter.rereference(correction);
                }
            }
        }
    }
}

/// Variances of positions before the update, m²: of both horizontal directions together, and vertical.
#[derive(Clone, Debug)]
struct Predictions {
    main: Variances,
    sub: [Variances; MAX_BANK],
    constellations: [Variances; MAX_CLOCKS],
    unaided: Variances,
}

impl Predictions {
    const NONE: Self = Self {
        main: [0.0; 2],
        sub: [[0.0; 2]; MAX_BANK],
        constellations: [[0.0; 2]; MAX_CLOCKS],
        unaided: [0.0; 2],
    };
}

fn own_variances<const K: usize, const M: usize>(
    filter: &Filter<K, M>,
    before: Variances,
    c_enu_e: &Matrix3<f64>,
) -> OwnVariances {
    let (left, now) = separation::position_variances_and_traces(filter, c_enu_e);
    let ([before_h, before_v], [now_h, now_v]) = (before, now);
    let taken = [before_h - now_h, before_v - now_v];
    OwnVariances {
        left,
        taken: taken.map(|taken| if taken > 0.0 { taken } else { 0.0 }),
    }
}

/// Raises a level of an axis to `of + and` if that is higher; what is no number makes it infinite.
fn raise(level_m: &mut [f64; 2], axis: usize, of: &[f64; 2], and: &[f64; 2]) {
    let (Some(level), Some(of), Some(and)) = (level_m.get_mut(axis), of.get(axis), and.get(axis))
    else {
        return;
    };
    let sum = of + and;
    if sum > *level {
        *level = sum;
    } else if sum.is_nan() {
        *level = f64::INFINITY;
    }
}

#[cfg(test)]
mod recording_tests;
#[cfg(test)]
mod tests;
