//! The faults to monitor: events of satellites and constellations until what is left is unlikely.
//!
//! In: fault probabilities of satellites and constellations, P_THRES, F_C. Out: a list of modes, each the
//! set of satellites that its solution leaves out and the probability of the events it stands for.
//!
//! An event is a set of satellites and constellations that are faulty at once while the others are not;
//! its probability is ∏ p ∏ (1 − p). Events that make the same satellites faulty are one mode. An event
//! within one constellation and no more likely than F_C P_const is counted to the fault of the whole
//! constellation, whose solution leaves its satellites out as well (consolidation).
//!
//! Order and end: a mode more likely than P_THRES must be monitored. The others follow by the number of
//! satellites left out, then by index, until the probability that is left is at most P_THRES.
//!
//! Source: [ARAIM-ADD] fault modes; order and consolidation: docs/decisions/007-araim.md.
//! Cost: one pass over at most 3,682 events; 407 with two faults at a time.

use super::{
    AraimConstellation, AraimError, AraimParameters, AraimSatellite, MAX_ARAIM_SATELLITES,
    MAX_CONSTELLATIONS, MAX_MODES,
};

/// Most satellites and constellations that are faulty at once. More than the parameters ask for are counted
/// when fewer leave more than P_THRES.
pub const MAX_SIMULTANEOUS: usize = 3;

const MAX_ELEMENTS: usize = MAX_ARAIM_SATELLITES + MAX_CONSTELLATIONS;

const _: () = assert!(
    MAX_ARAIM_SATELLITES <= 32,
    "a satellite set is a 32-bit mask"
);

/// A set of satellites of the epoch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SatelliteSet {
    bits: u32,
}

impl SatelliteSet {
    /// No satellite.
    pub const EMPTY: Self = Self { bits: 0 };

    /// The satellites 0 to n − 1, at most 32.
    pub fn first(n: usize) -> Self {
        Self {
            bits: if n < 32 { (1 << n) - 1 } else { u32::MAX },
        }
    }

    /// This set and the satellite of this index; indices from 32 on change nothing.
    pub fn with(self, index: usize) -> Self {
        self.union(Self::only(index))
    }

    fn only(index: usize) -> Self {
        Self {
            bits: if index < 32 { 1 << index } else { 0 },
        }
    }

    /// Satellites of either.
    pub fn union(self, other: Self) -> Self {
        Self {
            bits: self.bits | other.bits,
        }
    }

    /// Satellites of this one that the other has not.
    pub fn without(self, other: Self) -> Self {
        Self {
            bits: self.bits & !other.bits,
        }
    }

    /// Whether the satellite is in the set.
    pub fn contains(self, index: usize) -> bool {
        self.bits & Self::only(index).bits != 0
    }

    /// Whether every satellite of the other set is in this one.
    pub fn contains_all(self, other: Self) -> bool {
        other.bits & !self.bits == 0
    }

    /// How many.
    pub fn len(self) -> usize {
        self.bits.count_ones() as usize
    }

    /// Whether there is none.
    pub fn is_empty(self) -> bool {
        self.bits == 0
    }

    /// The indices, ascending.
    pub fn iter(self) -> impl Iterator<Item = usize> {
        let mut rest = self.bits;
        core::iter::from_fn(move || {
            if rest == 0 {
                return None;
            }
            let index = rest.trailing_zeros();
            rest &= rest.wrapping_sub(1);
            Some(index as usize)
        })
    }

    /// Sorts sets by their number of satellites, then as lists of ascending indices.
    fn order(self) -> u64 {
        // Of two lists of one length the one with the smaller first difference comes first: the one that
        // holds the lowest index in which the sets differ.
        (u64::from(self.bits.count_ones()) << 32) | u64::from(!self.bits.reverse_bits())
    }
}

/// Satellites that may be faulty at once, and how likely that is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FaultMode {
    /// The satellites its solution leaves out.
    pub excluded: SatelliteSet,
    /// Probability that it is there at a given instant; 1 for the fault-free mode.
    pub p_instant: f64,
    /// Probability that it is there during the exposure.
    pub p_exposure: f64,
    /// Whether what it leaves determines the position.
    pub is_monitored: bool,
}

impl FaultMode {
    const EMPTY: Self = Self {
        excluded: SatelliteSet::EMPTY,
        p_instant: 0.0,
        p_exposure: 0.0,
        is_monitored: false,
    };
}

/// A satellite or a constellation that may be faulty.
#[derive(Clone, Copy, Debug)]
struct Element {
    satellites: SatelliteSet,
    /// p/(1 − p), at the instant and over the exposure.
    odds: [f64; 2],
}

impl Element {
    const EMPTY: Self = Self {
        satellites: SatelliteSet::EMPTY,
        odds: [0.0; 2],
    };
}

/// Satellites of a constellation, and the most an event within it may have to be counted to it.
#[derive(Clone, Copy, Debug)]
struct Group {
    satellites: SatelliteSet,
    consolidation_limit: f64,
}

/// The modes of an epoch.
#[derive(Clone, Debug)]
pub(super) struct ModeList {
    p_not_monitored: f64,
    count: usize,
    /// The first `count`; while events are listed, the last `wide_count` are those that leave a whole
    /// constellation out.
    modes: [FaultMode; MAX_MODES],
    wide_count: usize,
    elements: [Element; MAX_ELEMENTS],
    element_count: usize,
    /// Constellations in view, the first `group_count`.
    groups: [Group; MAX_CONSTELLATIONS],
    group_count: usize,
}

impl ModeList {
    /// No modes.
    pub(super) const EMPTY: Self = Self {
        p_not_monitored: 1.0,
        count: 0,
        modes: [FaultMode::EMPTY; MAX_MODES],
        wide_count: 0,
        elements: [Element::EMPTY; MAX_ELEMENTS],
        element_count: 0,
        groups: [Group {
            satellites: SatelliteSet::EMPTY,
            consolidation_limit: 0.0,
        }; MAX_CONSTELLATIONS],
        group_count: 0,
    };

    /// The modes, the fault-free one first.
    pub(super) fn modes(&self) -> &[FaultMode] {
        self.modes.get(..self.count).unwrap_or(&[])
    }

    /// The modes, to say which are monitored.
    pub(super) fn modes_mut(&mut self) -> &mut [FaultMode] {
        self.modes.get_mut(..self.count).unwrap_or(&mut [])
    }

    /// Probability, over the exposure, of the events that no mode stands for.
    pub(super) fn p_not_monitored(&self) -> f64 {
        self.p_not_monitored
    }

    /// Lists the modes. The satellites and constellations have been checked.
    ///
    /// # Errors
    /// [`AraimError::ModesExceedCapacity`], [`AraimError::FaultsTooLikely`].
    pub(super) fn enumerate(
        &mut self,
        satellites: &[AraimSatellite],
        constellations: &[AraimConstellation],
        parameters: &AraimParameters,
    ) -> Result<(), AraimError> {
        let p_fault_free = self.collect(satellites, constellations, parameters);
        for simultaneous in parameters.simultaneous_at_least..=MAX_SIMULTANEOUS {
            self.list(simultaneous, p_fault_free)?;
            self.append_wide();
            self.select(p_fault_free, parameters.p_threshold);
            if self.p_not_monitored <= parameters.p_threshold {
                return Ok(());
            }
        }
        Err(AraimError::FaultsTooLikely {
            p_not_monitored: self.p_not_monitored,
        })
    }

    /// Gathers what can be faulty; the probabilities that nothing is.
    fn collect(
        &mut self,
        satellites: &[AraimSatellite],
        constellations: &[AraimConstellation],
        parameters: &AraimParameters,
    ) -> [f64; 2] {
        self.element_count = 0;
        let mut p_fault_free = [1.0; 2];
        for (index, satellite) in satellites.iter().enumerate() {
            let set = SatelliteSet::only(index);
            let p = [
                satellite.p_fault,
                satellite.p_fault * (1.0 + satellite.exposure),
            ];
            self.add_element(set, p, &mut p_fault_free);
        }
        self.group_count = 0;
        for (index, constellation) in constellations.iter().enumerate() {
            let mut members = SatelliteSet::EMPTY;
            for (number, satellite) in satellites.iter().enumerate() {
                if satellite.constellation == index {
                    members = members.with(number);
                }
            }
            if members.is_empty() {
                continue;
            }
            let p_exposure = constellation.p_fault * (1.0 + constellation.exposure);
            let p = [constellation.p_fault, p_exposure];
            self.add_element(members, p, &mut p_fault_free);
            if let Some(group) = self.groups.get_mut(self.group_count) {
                *group = Group {
                    satellites: members,
                    consolidation_limit: parameters.consolidation_share * p_exposure,
                };
                self.group_count += 1;
            }
        }
        p_fault_free
    }

    /// What cannot be faulty is no element.
    fn add_element(&mut self, satellites: SatelliteSet, p: [f64; 2], p_fault_free: &mut [f64; 2]) {
        let [p_instant, p_exposure] = p;
        let [free_instant, free_exposure] = p_fault_free;
        if p_instant > 0.0
            && let Some(element) = self.elements.get_mut(self.element_count)
        {
            *element = Element {
                satellites,
                odds: [
                    p_instant / (1.0 - p_instant),
                    p_exposure / (1.0 - p_exposure),
                ],
            };
            self.element_count += 1;
            *free_instant *= 1.0 - p_instant;
            *free_exposure *= 1.0 - p_exposure;
        }
    }

    /// Every event of 1 to `simultaneous` elements, counted to its mode.
    fn list(&mut self, simultaneous: usize, p_fault_free: [f64; 2]) -> Result<(), AraimError> {
        self.count = 0;
        self.wide_count = 0;
        let elements = self.elements;
        let elements = elements.get(..self.element_count).unwrap_or(&[]);
        let none = (SatelliteSet::EMPTY, p_fault_free);
        let join = |(set, [instant, exposure]): (SatelliteSet, [f64; 2]), element: &Element| {
            let [odds_instant, odds_exposure] = element.odds;
            (
                set.union(element.satellites),
                [instant * odds_instant, exposure * odds_exposure],
            )
        };
        // One pass per size, so that the list comes out almost sorted.
        for size in 1..=simultaneous {
            let mut after_first = elements;
            while let Some((first, rest)) = after_first.split_first() {
                after_first = rest;
                let one = join(none, first);
                if size == 1 {
                    self.count_event(one)?;
                    continue;
                }
                let mut after_second = rest;
                while let Some((second, rest)) = after_second.split_first() {
                    after_second = rest;
                    let two = join(one, second);
                    if size == 2 {
                        self.count_event(two)?;
                        continue;
                    }
                    for third in rest {
                        self.count_event(join(two, third))?;
                    }
                }
            }
        }
        Ok(())
    }

    fn count_event(&mut self, (set, p): (SatelliteSet, [f64; 2])) -> Result<(), AraimError> {
        let [p_instant, p_exposure] = p;
        let mut excluded = set;
        let mut covers_a_constellation = false;
        for group in self.groups.iter().take(self.group_count) {
            if group.satellites.contains_all(set)
                && set != group.satellites
                && p_exposure <= group.consolidation_limit
            {
                excluded = group.satellites;
            }
            covers_a_constellation |= excluded.contains_all(group.satellites);
        }
        let mode = FaultMode {
            excluded,
            p_instant,
            p_exposure,
            is_monitored: false,
        };
        let free = MAX_MODES
            .wrapping_sub(self.count)
            .wrapping_sub(self.wide_count);
        if !covers_a_constellation {
            // The last place stays free for the fault-free mode.
            if free < 2 {
                return Err(AraimError::ModesExceedCapacity);
            }
            if let Some(place) = self.modes.get_mut(self.count) {
                *place = mode;
            }
            self.count += 1;
            return Ok(());
        }
        // Only through a constellation do two events make the same satellites faulty.
        let wide = self.modes.iter_mut().rev().take(self.wide_count);
        for known in wide {
            if known.excluded == excluded {
                known.p_instant += p_instant;
                known.p_exposure += p_exposure;
                return Ok(());
            }
        }
        if free < 2 {
            return Err(AraimError::ModesExceedCapacity);
        }
        if let Some(place) = self.modes.iter_mut().rev().nth(self.wide_count) {
            *place = mode;
        }
        self.wide_count += 1;
        Ok(())
    }

    /// Puts the modes that leave a constellation out after the others.
    fn append_wide(&mut self) {
        // From the front, so that none is overwritten before it is read.
        let from = MAX_MODES.wrapping_sub(self.wide_count);
        for index in 0..self.wide_count {
            let wide = self.modes.get(from.wrapping_add(index)).copied();
            if let (Some(wide), Some(place)) = (wide, self.modes.get_mut(self.count)) {
                *place = wide;
                self.count += 1;
            }
        }
    }

    /// Sorts, keeps what must be monitored, and puts the fault-free mode in front.
    fn select(&mut self, p_fault_free: [f64; 2], p_threshold: f64) {
        let [_, fault_free_exposure] = p_fault_free;
        let key = |mode: &FaultMode| {
            // The number of satellites needs six bits above bit 31.
            let optional = u64::from(mode.p_exposure <= p_threshold) << 63;
            optional | mode.excluded.order()
        };
        let listed = self.modes.get_mut(..self.count).unwrap_or(&mut []);
        insertion_sort(listed, key);
        let mut left = 1.0 - fault_free_exposure;
        let mut kept = 0;
        for mode in listed.iter() {
            if mode.p_exposure <= p_threshold && left <= p_threshold {
                break;
            }
            left -= mode.p_exposure;
            kept += 1;
        }
        let mut before = FaultMode {
            excluded: SatelliteSet::EMPTY,
            p_instant: 1.0,
            p_exposure: fault_free_exposure,
            is_monitored: false,
        };
        for mode in self.modes.iter_mut().take(kept + 1) {
            core::mem::swap(mode, &mut before);
        }
        self.count = kept + 1;
        // Rounding of a sum near one.
        self.p_not_monitored = if left > 0.0 { left } else { 0.0 };
    }

    /// The modes of `other` as a receiver sees them that no longer uses the satellites `gone`: what they
    /// leave out beyond those. Modes that become the same are one; those within `gone` are none. What
    /// `other` does not monitor is not taken over.
    pub(super) fn restrict(&mut self, other: &Self, gone: SatelliteSet) {
        self.count = 0;
        self.p_not_monitored = other.p_not_monitored;
        for mode in other.modes().iter().filter(|mode| mode.is_monitored) {
            let restricted = FaultMode {
                excluded: mode.excluded.without(gone),
                ..*mode
            };
            let listed = self.modes.get_mut(..self.count).unwrap_or(&mut []);
            let known = listed
                .iter_mut()
                .find(|mode| mode.excluded == restricted.excluded);
            match known {
                // The first is the fault-free one, whose probability counts as one already.
                Some(known) if known.excluded.is_empty() => {}
                Some(known) => {
                    known.p_instant += restricted.p_instant;
                    known.p_exposure += restricted.p_exposure;
                }
                None => {
                    if let Some(mode) = self.modes.get_mut(self.count) {
                        *mode = restricted;
                        self.count += 1;
                    }
                }
            }
        }
    }
}

/// In place, fast on what is almost sorted.
fn insertion_sort(modes: &mut [FaultMode], key: impl Fn(&FaultMode) -> u64) {
    let Some(first) = modes.first() else {
        return;
    };
    let mut largest_key = key(first);
    for end in 2..=modes.len() {
        let Some((last, sorted)) = modes.get_mut(..end).and_then(<[_]>::split_last_mut) else {
            return;
        };
        let moving_key = key(last);
        if largest_key <= moving_key {
            largest_key = moving_key;
            continue;
        }
        let moving = *last;
        let mut hole = last;
        for earlier in sorted.iter_mut().rev() {
            if key(earlier) <= moving_key {
                break;
            }
            *hole = *earlier;
            hole = earlier;
        }
        *hole = moving;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(indices: &[usize]) -> SatelliteSet {
        indices
            .iter()
            .fold(SatelliteSet::EMPTY, |set, i| set.with(*i))
    }

    #[test]
    fn sets_are_ordered_by_size_then_as_lists() {
        let sorted = [
            set(&[]),
            set(&[0]),
            set(&[1]),
            set(&[23]),
            set(&[0, 1]),
            set(&[0, 23]),
            set(&[1, 2]),
            set(&[0, 1, 31]),
            set(&[0, 2, 3]),
        ];
        for pair in sorted.windows(2) {
            assert!(pair[0].order() < pair[1].order(), "{pair:?}");
        }
        assert!(set(&[3, 7]).iter().eq([3, 7]));
        assert_eq!(set(&[40]), SatelliteSet::EMPTY);
        assert_eq!(SatelliteSet::first(32).len(), 32);
        assert_eq!(set(&[1, 2, 3]).without(set(&[2])), set(&[1, 3]));
    }

    #[test]
    fn sorting_puts_any_order_right() {
        let mut modes = [FaultMode::EMPTY; 40];
        for (i, mode) in modes.iter_mut().enumerate() {
            mode.p_instant = ((i * 23 + 7) % 40) as f64;
        }
        insertion_sort(&mut modes, |mode| mode.p_instant as u64);
        for (i, mode) in modes.iter().enumerate() {
            assert_eq!(mode.p_instant, i as f64);
        }
    }

    #[test]
    fn events_within_a_constellation_are_counted_to_its_fault() {
        let satellite = |i: usize| AraimSatellite {
            constellation: i / 2,
            p_fault: 1e-5,
            ..AraimSatellite::EMPTY
        };
        let satellites: std::vec::Vec<_> = (0..4).map(satellite).collect();
        let constellation = |p_fault| AraimConstellation {
            p_fault,
            exposure: 0.0,
        };
        let mut list = std::boxed::Box::new(ModeList::EMPTY);
        let systems = [constellation(1e-4), constellation(0.0)];
        list.enumerate(&satellites, &systems, &AraimParameters::LPV_200)
            .unwrap();
        let excluded: std::vec::Vec<_> = list.modes().iter().map(|mode| mode.excluded).collect();
        assert_eq!(
            excluded,
            [
                set(&[]),
                set(&[0]),
                set(&[1]),
                set(&[2]),
                set(&[3]),
                set(&[0, 1])
            ]
        );
        // Its own fault, alone or with one of its satellites, and both satellites without it.
        let others = (1.0 - 1e-5) * (1.0 - 1e-5);
        let wide = 1e-4 * (others + 2.0 * 1e-5 * (1.0 - 1e-5)) + (1.0 - 1e-4) * 1e-10;
        let p = list.modes()[5].p_instant;
        assert!((p / (wide * others) - 1.0).abs() < 1e-12, "{p}");
    }
}
