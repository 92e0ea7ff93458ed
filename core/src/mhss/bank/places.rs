//! Who has a place in the bank: what a recording needs beyond births and deaths.

use nalgebra::Matrix3;

use super::{Bank, MAX_BANK, Secondaries, SubFilters};
use crate::ekf::{Filter, MeasurementRow};
use crate::gnss::{Satellite, SatelliteSet, System};
use crate::mhss::protection::{FaultPriors, Hypothesis};
use crate::mhss::separation::position_variances_and_traces;
use crate::time::GpsTime;

impl<const K: usize, const M: usize> Bank<K, M> {
    /// Whether a satellite has a place.
    pub fn has(&self, satellite: Satellite) -> bool {
        self.place_of(satellite).is_some()
    }

    /// The satellite that has been missing longest, and since when, if one is held.
    pub fn missing_longest(&self) -> Option<(Satellite, GpsTime)> {
        let mut longest: Option<(Satellite, GpsTime)> = None;
        for member in &self.members {
            if let Some(since) = member.missing_since
                && longest.is_none_or(|(_, earliest)| since.ns() < earliest.ns())
            {
                longest = Some((member.satellite, since));
            }
        }
        longest
    }

    /// Number of pairs of satellites in the bank.
    pub fn pairs(&self) -> u32 {
        let n = u32::try_from(self.members.len()).unwrap_or(u32::MAX);
        n.saturating_mul(n.saturating_sub(1)) / 2
    }

    /// Filters without one satellite, one constellation, and two satellites where those have not been dropped.
    pub fn filters(&self) -> u32 {
        let n = self.members.len()
            + self.constellations.iter().flatten().count()
            + usize::from(self.unaided.is_some());
        let pairs = if self.pairs_are_dropped {
            0
        } else {
            self.pairs()
        };
        u32::try_from(n).unwrap_or(u32::MAX).saturating_add(pairs)
    }

    /// The filters of the pairs miss this epoch for want of time: until [`Bank::begin_pairs`] nothing is
    /// isolated, excluded or evicted by them.
    pub const fn drop_pairs(&mut self) {
        self.pairs_are_dropped = true;
    }

    /// The filters of the pairs begin anew as copies of those without one satellite, after
    /// [`Bank::predict_sub`]. They are blind for two faults of before.
    pub fn begin_pairs(&mut self, sub: &SubFilters<K, M>, secondaries: &mut Secondaries<K, M>) {
        self.begin_secondaries(sub, secondaries);
        self.pairs_are_dropped = false;
    }

    /// Whether the filters of the pairs missed an epoch and have not begun anew.
    pub const fn pairs_are_dropped(&self) -> bool {
        self.pairs_are_dropped
    }

    /// Takes a satellite's place away without calling it faulty: F00 ← F0n, so that no filter holds anything
    /// of it afterwards and no fault of it can hide in the main filter. The secondaries begin anew, as after an
    /// exclusion. After [`Bank::predict`], before [`Bank::admit`].
    #[inline(never)]
    pub fn evict(
        &mut self,
        satellite: Satellite,
        main: &mut Filter<K, M>,
        sub: &mut SubFilters<K, M>,
        secondaries: &mut Secondaries<K, M>,
    ) -> Option<usize> {
        if self.pairs_are_dropped {
            return None;
        }
        let member = self.remove(satellite, main, sub, secondaries)?;
        Some(member.place)
    }

    /// A satellite without a place was found faulty by somebody else.
    pub fn note_excluded(&mut self, satellite: Satellite) {
        if !self.has(satellite) {
            self.excluded.insert(satellite);
            self.readmitted.remove(satellite);
        }
    }

    /// All filters begin anew: who was excluded stays so, who was taken back is remembered.
    pub fn restart(&mut self) {
        let (excluded, readmitted) = (self.excluded, self.readmitted);
        self.clear();
        self.excluded = excluded;
        self.readmitted = readmitted;
    }

    /// All times so far were wrong by this much, ns.
    pub fn shift(&mut self, by_ns: i64) {
        for member in &mut self.members {
            member.missing_since = member.missing_since.map(|since| since.plus_ns(by_ns));
        }
    }

    /// Keeps satellites that are missing as long as what they left in the main filter can be seen: as long as
    /// a threshold is above `worth_m`.
    pub fn hold_on(&mut self, now: GpsTime, hold_ns: i64, worth_m: f64) {
        for member in &mut self.members {
            let is_worth = |threshold_m: &f64| !(*threshold_m <= worth_m);
            let ends = |since: GpsTime| now.ns().saturating_sub(since.ns()) >= hold_ns;
            if member.missing_since.is_some_and(ends)
                && member.separation.threshold_m.iter().any(is_worth)
            {
                member.missing_since = Some(now);
            }
        }
    }

    /// The place of a satellite.
    pub fn place(&self, satellite: Satellite) -> Option<usize> {
        self.place_of(satellite)
    }

    /// Leaves a satellite out while the filters of the pairs are young, copies made at an exclusion shortly
    /// before: those without it hold what it did until then, which may have been its fault already. The filter
    /// without it, which does not, becomes the main one and all others begin as copies of it. False when it is
    /// not in the bank.
    #[inline(never)]
    pub fn exclude_alone(
        &mut self,
        satellite: Satellite,
        main: &mut Filter<K, M>,
        sub: &mut SubFilters<K, M>,
        secondaries: &mut Secondaries<K, M>,
    ) -> bool {
        let is_excluded = self.exclude(satellite, main, sub, secondaries);
        if is_excluded {
            self.begin_all(main, sub, secondaries);
        }
        is_excluded
    }

    /// Leaves two satellites out: the filter without both becomes the main one and all others begin as
    /// copies of it. False when one is not in the bank.
    #[inline(never)]
    pub fn exclude_two(
        &mut self,
        satellites: [Satellite; 2],
        main: &mut Filter<K, M>,
        sub: &mut SubFilters<K, M>,
        secondaries: &mut Secondaries<K, M>,
    ) -> bool {
        let Some(filter) = self.secondary(satellites, secondaries) else {
            return false;
        };
        main.clone_from(filter);
        self.retain(|satellite| !satellites.contains(&satellite));
        for satellite in satellites {
            self.excluded.insert(satellite);
            self.readmitted.remove(satellite);
        }
        self.begin_all(main, sub, secondaries);
        true
    }

    /// Leaves a constellation out: the filter without it becomes the main one and all others begin as copies
    /// of it. False when it has no filter.
    #[inline(never)]
    pub fn exclude_constellation(
        &mut self,
        system: System,
        main: &mut Filter<K, M>,
        sub: &mut SubFilters<K, M>,
        secondaries: &mut Secondaries<K, M>,
    ) -> bool {
        let at = system.index();
        let (Some(filter), Some(Some(_))) =
            (sub.constellations.get(at), self.constellations.get(at))
        else {
            return false;
        };
        main.clone_from(filter);
        for member in &self.members {
            if member.satellite.system() == system {
                self.excluded.insert(member.satellite);
                self.readmitted.remove(member.satellite);
            }
        }
        self.retain(|satellite| satellite.system() != system);
        self.begin_all(main, sub, secondaries);
        true
    }

    /// Keeps these satellites, each with its row.
    fn retain(&mut self, keep: impl Fn(Satellite) -> bool) {
        let mut rows = [None; MAX_BANK];
        let members = self.members.iter().zip(&self.rows);
        let kept = members.filter(|(member, _)| keep(member.satellite));
        for (place, (_, row)) in rows.iter_mut().zip(kept) {
            *place = *row;
        }
        self.rows = rows;
        self.members.retain(|member| keep(member.satellite));
    }

    /// All filters begin as copies of the main one.
    pub(super) fn begin_all(
        &mut self,
        main: &Filter<K, M>,
        sub: &mut SubFilters<K, M>,
        secondaries: &mut Secondaries<K, M>,
    ) {
        for member in &self.members {
            if let Some(own) = sub.filters.get_mut(member.place) {
                own.clone_from(main);
            }
        }
        for (own, place) in sub.constellations.iter_mut().zip(&self.constellations) {
            if place.is_some() {
                own.clone_from(main);
            }
        }
        if self.unaided.is_some() {
            sub.unaided.clone_from(main);
        }
        self.begin_secondaries(sub, secondaries);
        self.pairs_are_dropped = false;
    }

    /// An excluded satellite may have a place again.
    pub fn readmit(&mut self, satellite: Satellite) {
        if self.excluded.contains(satellite) {
            self.excluded.remove(satellite);
            self.readmitted.insert(satellite);
        }
    }

    /// Satellites that were excluded once and taken back.
    pub const fn readmitted(&self) -> SatelliteSet {
        self.readmitted
    }

    fn prior(&self, satellite: Satellite, priors: &FaultPriors) -> f64 {
        if self.readmitted.contains(satellite) {
            priors.readmitted
        } else {
            priors.satellite
        }
    }

    /// Prior of a constellation: with satellites that were taken back that of such a satellite at least, for
    /// they may have been excluded with it.
    fn constellation_prior(&self, system: System, priors: &FaultPriors) -> f64 {
        let own = priors.constellation.get(system.index()).copied();
        let own = own.unwrap_or(1.0);
        let was_excluded = self
            .readmitted
            .iter()
            .any(|satellite| satellite.system() == system);
        if was_excluded && priors.readmitted > own {
            priors.readmitted
        } else {
            own
        }
    }

    /// The hypotheses that have a filter, with their prior probabilities.
    pub fn hypotheses<'a>(
        &'a self,
        priors: &'a FaultPriors,
    ) -> impl Iterator<Item = Hypothesis<'a>> {
        let satellites = self.members.iter().map(|member| Hypothesis {
            separation: &member.separation,
            probability: self.prior(member.satellite, priors),
        });
        let constellations = self.constellation_separations();
        let constellations = constellations.map(|(system, separation)| Hypothesis {
            separation,
            probability: self.constellation_prior(system, priors),
        });
        let unaided = self.unaided.iter().map(|separation| Hypothesis {
            separation,
            probability: priors.aids,
        });
        satellites.chain(constellations).chain(unaided)
    }

    /// Probability of the faults that no filter stands for: two satellites at once, a constellation and a
    /// satellite of another, two constellations, an aid and any of these, GPS as a whole where it is alone. That another constellation is
    /// faulty as a whole cannot be told where it is alone, and is not reckoned with there, as
    /// receiver-autonomous monitoring does not.
    pub fn p_unmonitored(&self, priors: &FaultPriors) -> f64 {
        // Σ_{i<j} p_i p_j by running sums.
        let (mut sum, mut pairs) = (0.0, 0.0);
        for member in &self.members {
            let prior = self.prior(member.satellite, priors);
            pairs += prior * sum;
            sum += prior;
        }
        let mut of_systems = 0.0;
        for (system, _) in self.constellation_separations() {
            let prior = self.constellation_prior(system, priors);
            let others = self
                .members
                .iter()
                .filter(|member| member.satellite.system() != system);
            let of_others: f64 = others
                .map(|member| self.prior(member.satellite, priors))
                .sum();
            pairs += prior * (of_others + of_systems);
            of_systems += prior;
        }
        if self.unaided.is_some() {
            pairs += priors.aids * (sum + of_systems);
        }
        let gps = System::Gps.index();
        let gps_is_alone = self.constellations.get(gps).is_none_or(Option::is_none);
        let of_gps = priors.constellation.get(gps).copied().unwrap_or(0.0);
        pairs + if gps_is_alone { of_gps } else { 0.0 }
    }

    /// Notes how uncertain every filter that is tested is before the update. After [`Bank::admit`].
    #[inline(never)]
    pub fn note_predictions(
        &mut self,
        main: &Filter<K, M>,
        sub: &SubFilters<K, M>,
        c_enu_e: &Matrix3<f64>,
    ) {
        let of = |filter: &Filter<K, M>| position_variances_and_traces(filter, c_enu_e).1;
        self.predicted.main = of(main);
        for member in &self.members {
            let place = self.predicted.sub.get_mut(member.place);
            if let (Some(place), Some(filter)) = (place, sub.filters.get(member.place)) {
                *place = of(filter);
            }
        }
        let places = self.predicted.constellations.iter_mut();
        for (place, (filter, runs)) in
            places.zip(sub.constellations.iter().zip(&self.constellations))
        {
            if runs.is_some() {
                *place = of(filter);
            }
        }
        if self.unaided.is_some() {
            self.predicted.unaided = of(&sub.unaided);
        }
    }

    /// Places whose filters began at this epoch.
    pub fn begun(&self) -> impl Iterator<Item = usize> + '_ {
        let new = self.members.iter().filter(|member| member.is_new);
        new.map(|member| member.place)
    }

    /// The satellites of the epoch that have a place, with it and their rows.
    pub fn present(&self) -> impl Iterator<Item = (usize, Satellite, &MeasurementRow<M>)> {
        let members = self.members.iter().zip(&self.rows);
        members.filter_map(|(member, row)| Some((member.place, member.satellite, row.as_ref()?)))
    }

    /// Does the same to all filters but the main one, as when the receiver clock jumps.
    pub fn for_each_filter(
        &self,
        sub: &mut SubFilters<K, M>,
        secondaries: &mut Secondaries<K, M>,
        mut change: impl FnMut(&mut Filter<K, M>),
    ) {
        for (filter, place) in sub.constellations.iter_mut().zip(&self.constellations) {
            if place.is_some() {
                change(filter);
            }
        }
        if self.unaided.is_some() {
            change(&mut sub.unaided);
        }
        for (at, member) in self.members.iter().enumerate() {
            if let Some(filter) = sub.filters.get_mut(member.place) {
                change(filter);
            }
            for other in self.members.iter().skip(at + 1) {
                let pair = super::pair(member.place, other.place);
                if let Some(filter) = secondaries.filters.get_mut(pair) {
                    change(filter);
                }
            }
        }
    }
}
