//! The ephemerides received so far, and which of them to use.
//!
//! Two per satellite and message: around a change of issue the older one may lie nearer. The table
//! lives in a `static`; nothing in it is older than what the stream brought, because nothing else is
//! ever put in.

use heapless::Vec;

use super::orbit::{self, OrbitError};
use super::{Ephemeris, NavMessage, Satellite, System};
use crate::time::{GpsTime, NS_PER_S, NS_PER_WEEK};

/// Why there is no ephemeris for a satellite.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EphemerisReason {
    /// None was received.
    Missing,
    /// All received are too far from the time asked for.
    Stale,
    /// The one received last says the satellite is not healthy.
    Unhealthy,
    /// The broadcaster gives no prediction of accuracy.
    NoAccuracy,
}

/// Largest distance from toe for GPS, ns: half of the four-hour fit interval.
/// [IS-GPS-200] 20.3.3.4.3.1 and table 20-XII.
pub const MAX_AGE_GPS_NS: i64 = 2 * 3600 * NS_PER_S;
/// Largest distance from toe for Galileo, ns: the longest nominal validity of a message. [GAL-OS-SDD]
pub const MAX_AGE_GALILEO_NS: i64 = 4 * 3600 * NS_PER_S;
/// Largest distance from toe for BDS, ns: twice the hour between updates [BDS-SIS-ICD-B1I] 5.2.4.
pub const MAX_AGE_BDS_NS: i64 = 2 * 3600 * NS_PER_S;

/// Largest distance between the time of use and toe, ns.
pub const fn max_age_ns(system: System) -> i64 {
    match system {
        System::Gps => MAX_AGE_GPS_NS,
        System::Galileo => MAX_AGE_GALILEO_NS,
        System::Bds => MAX_AGE_BDS_NS,
    }
}

/// Ephemerides kept of one satellite and message.
const DEPTH: usize = 2;
/// GPS, Galileo I/NAV, Galileo F/NAV, BDS.
const SLOTS: usize = Satellite::COUNT + GALILEO as usize;
const GPS: u8 = System::Gps.max_prn();
const GALILEO: u8 = System::Galileo.max_prn();

/// In order of arrival, the last received at the end.
type Slot = Vec<Ephemeris, DEPTH>;

/// Ephemerides of all satellites.
pub struct EphemerisStore {
    slots: [Slot; SLOTS],
}

/// The slot of a satellite and message, `None` when the message is not one of that system.
const fn slot_index(satellite: Satellite, message: NavMessage) -> Option<usize> {
    let place = (satellite.prn() - 1) as usize;
    match (satellite.system(), message) {
        (System::Gps, NavMessage::GpsLnav) => Some(place),
        (System::Galileo, NavMessage::GalileoInav) => Some(GPS as usize + place),
        (System::Galileo, NavMessage::GalileoFnav) => Some(GPS as usize + GALILEO as usize + place),
        (System::Bds, NavMessage::BdsD1D2) => Some(GPS as usize + 2 * GALILEO as usize + place),
        _ => None,
    }
}

/// Why an ephemeris was not taken in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum NotStored {
    /// The message does not belong to the satellite's system.
    WrongMessage,
    /// Its numbers are no orbit.
    Orbit(OrbitError),
}

impl EphemerisStore {
    /// Nothing received.
    pub const EMPTY: Self = Self {
        slots: [const { Slot::new() }; SLOTS],
    };

    /// Takes in an ephemeris as the one received last of its satellite and message. It replaces one
    /// of the same toe, else the older one.
    ///
    /// # Errors
    /// [`NotStored`] when it cannot be computed with; the store stays as it was.
    pub fn insert(&mut self, ephemeris: &Ephemeris) -> Result<(), NotStored> {
        orbit::check(ephemeris).map_err(NotStored::Orbit)?;
        let slot = slot_index(ephemeris.satellite, ephemeris.message)
            .and_then(|index| self.slots.get_mut(index))
            .ok_or(NotStored::WrongMessage)?;
        slot.retain(|known| known.toe != ephemeris.toe);
        if let [older, newer] = slot.as_mut_slice() {
            *older = *newer;
            *newer = *ephemeris;
        } else {
            // Fewer than two are there, so it fits.
            let _ = slot.push(*ephemeris);
        }
        Ok(())
    }

    /// The ephemeris of one message to use at `time`: of those received the one whose toe is
    /// nearest, if the one received last says the satellite is healthy and of known accuracy.
    ///
    /// # Errors
    /// [`EphemerisReason`], unhealthy before stale before accuracy.
    pub fn select(
        &self,
        satellite: Satellite,
        message: NavMessage,
        time: GpsTime,
    ) -> Result<&Ephemeris, EphemerisReason> {
        let slot = slot_index(satellite, message)
            .and_then(|index| self.slots.get(index))
            .ok_or(EphemerisReason::Missing)?;
        let last = slot.last().ok_or(EphemerisReason::Missing)?;
        if last.health != 0 {
            return Err(EphemerisReason::Unhealthy);
        }
        let age_ns =
            |ephemeris: &Ephemeris| time.ns().wrapping_sub(ephemeris.toe.ns()).unsigned_abs();
        // The later received wins a tie, as it comes last.
        let mut nearest = last;
        for ephemeris in slot {
            if ephemeris.health == 0 && age_ns(ephemeris) < age_ns(nearest) {
                nearest = ephemeris;
            }
        }
        if age_ns(nearest) > max_age_ns(satellite.system()).unsigned_abs() {
            return Err(EphemerisReason::Stale);
        }
        if last.sigma_ura_m.is_none() || nearest.sigma_ura_m.is_none() {
            return Err(EphemerisReason::NoAccuracy);
        }
        Ok(nearest)
    }

    /// As [`EphemerisStore::select`], of the first message in `preference` that gives one. Only a
    /// missing or stale message lets the next one stand in: what is broadcast as unhealthy stays out.
    ///
    /// # Errors
    /// The reason of the first message that was not merely missing, else [`EphemerisReason::Missing`].
    pub fn select_preferred(
        &self,
        satellite: Satellite,
        preference: &[NavMessage],
        time: GpsTime,
    ) -> Result<&Ephemeris, EphemerisReason> {
        let mut reason = EphemerisReason::Missing;
        for message in preference {
            match self.select(satellite, *message, time) {
                Ok(ephemeris) => return Ok(ephemeris),
                Err(EphemerisReason::Missing) => {}
                Err(EphemerisReason::Stale) => reason = EphemerisReason::Stale,
                Err(refused) => return Err(refused),
            }
        }
        Err(reason)
    }

    /// Moves every ephemeris by whole weeks: for those received before the week was known.
    pub fn shift_weeks(&mut self, weeks: i32) {
        let shift_ns = i64::from(weeks).wrapping_mul(NS_PER_WEEK);
        for ephemeris in self.slots.iter_mut().flatten() {
            ephemeris.toe = ephemeris.toe.plus_ns(shift_ns);
            ephemeris.toc = ephemeris.toc.plus_ns(shift_ns);
        }
    }

    /// Forgets everything, in place.
    pub fn clear(&mut self) {
        for slot in &mut self.slots {
            slot.clear();
        }
    }

    /// Number of ephemerides held.
    pub fn len(&self) -> usize {
        self.slots.iter().map(|slot| slot.len()).sum()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.slots.iter().all(|slot| slot.is_empty())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::orbit::tests::example;

    fn hours(hours: i64) -> i64 {
        hours * 3600 * NS_PER_S
    }

    fn store_with(ephemerides: &[Ephemeris]) -> std::boxed::Box<EphemerisStore> {
        let mut store = std::boxed::Box::new(EphemerisStore::EMPTY);
        for ephemeris in ephemerides {
            store.insert(ephemeris).unwrap();
        }
        store
    }

    fn moved(mut ephemeris: Ephemeris, by_ns: i64) -> Ephemeris {
        ephemeris.toe = ephemeris.toe.plus_ns(by_ns);
        ephemeris.toc = ephemeris.toc.plus_ns(by_ns);
        ephemeris
    }

    #[test]
    fn every_slot_is_its_own() {
        let mut store = std::boxed::Box::new(EphemerisStore::EMPTY);
        for satellite in (0..Satellite::COUNT).filter_map(Satellite::from_index) {
            let mut ephemeris = example(satellite);
            store.insert(&ephemeris).unwrap();
            if satellite.system() == System::Galileo {
                ephemeris.message = NavMessage::GalileoFnav;
                store.insert(&ephemeris).unwrap();
            }
        }
        assert_eq!(store.len(), SLOTS);
        for satellite in (0..Satellite::COUNT).filter_map(Satellite::from_index) {
            let ephemeris = example(satellite);
            let found = store
                .select(satellite, ephemeris.message, ephemeris.toe)
                .unwrap();
            assert_eq!(found.satellite, satellite);
        }
    }

    #[test]
    fn the_nearest_toe_is_used_and_the_oldest_dropped() {
        let satellite = Satellite::new(System::Gps, 5).unwrap();
        let first = example(satellite);
        let (second, third) = (moved(first, hours(2)), moved(first, hours(4)));
        let mut store = store_with(&[first, second]);
        let at = |store: &EphemerisStore, after_ns| {
            store
                .select(satellite, NavMessage::GpsLnav, first.toe.plus_ns(after_ns))
                .map(|ephemeris| ephemeris.toe)
        };
        assert_eq!(at(&store, hours(1) - 1), Ok(first.toe));
        assert_eq!(at(&store, hours(1) + 1), Ok(second.toe));
        assert_eq!(at(&store, hours(4)), Ok(second.toe));
        assert_eq!(at(&store, hours(4) + 1), Err(EphemerisReason::Stale));
        store.insert(&third).unwrap();
        assert_eq!(at(&store, -hours(1)), Err(EphemerisReason::Stale));
        // Received again, the same toe takes one place, not two.
        store.insert(&third).unwrap();
        assert_eq!(at(&store, hours(2)), Ok(second.toe));
    }

    /// INT-009.
    #[test]
    fn the_last_received_decides_on_health() {
        let satellite = Satellite::new(System::Bds, 21).unwrap();
        let healthy = example(satellite);
        let mut sick = moved(healthy, hours(1));
        sick.health = 1;
        let mut store = store_with(&[healthy, sick]);
        let select = |store: &EphemerisStore| {
            store
                .select(satellite, NavMessage::BdsD1D2, healthy.toe)
                .map(|ephemeris| ephemeris.toe)
        };
        assert_eq!(select(&store), Err(EphemerisReason::Unhealthy));
        // Healthy again, an older toe must not bring the sick one back.
        store.insert(&moved(healthy, hours(-1))).unwrap();
        assert_eq!(select(&store), Ok(healthy.toe.plus_ns(hours(-1))));
        sick = healthy;
        sick.sigma_ura_m = None;
        store.insert(&sick).unwrap();
        assert_eq!(select(&store), Err(EphemerisReason::NoAccuracy));
    }

    /// INT-009.
    #[test]
    fn an_unhealthy_message_lets_no_other_stand_in() {
        let satellite = Satellite::new(System::Galileo, 14).unwrap();
        let mut inav = example(satellite);
        let mut fnav = inav;
        fnav.message = NavMessage::GalileoFnav;
        let preference = [NavMessage::GalileoInav, NavMessage::GalileoFnav];
        let select = |store: &EphemerisStore| {
            store
                .select_preferred(satellite, &preference, inav.toe)
                .map(|ephemeris| ephemeris.message)
        };
        assert_eq!(select(&store_with(&[])), Err(EphemerisReason::Missing));
        assert_eq!(select(&store_with(&[fnav])), Ok(NavMessage::GalileoFnav));
        assert_eq!(
            select(&store_with(&[fnav, inav])),
            Ok(NavMessage::GalileoInav)
        );
        let old = moved(inav, -hours(5));
        assert_eq!(select(&store_with(&[old])), Err(EphemerisReason::Stale));
        inav.health = 48;
        assert_eq!(
            store_with(&[fnav, inav])
                .select_preferred(satellite, &preference, inav.toe)
                .map(|ephemeris| ephemeris.message),
            Err(EphemerisReason::Unhealthy)
        );
    }

    #[test]
    fn weeks_learnt_later_move_what_was_stored() {
        let satellite = Satellite::new(System::Gps, 5).unwrap();
        let truth = example(satellite);
        let mut store = store_with(&[moved(truth, -3 * NS_PER_WEEK)]);
        let select = |store: &EphemerisStore| {
            store
                .select(satellite, NavMessage::GpsLnav, truth.toe)
                .copied()
        };
        assert_eq!(select(&store), Err(EphemerisReason::Stale));
        store.shift_weeks(3);
        assert_eq!(select(&store), Ok(truth));
    }

    #[test]
    fn numbers_that_are_no_orbit_and_foreign_messages_stay_out() {
        let mut store = std::boxed::Box::new(EphemerisStore::EMPTY);
        let mut ephemeris = example(Satellite::new(System::Gps, 5).unwrap());
        ephemeris.message = NavMessage::BdsD1D2;
        assert_eq!(store.insert(&ephemeris), Err(NotStored::WrongMessage));
        ephemeris.message = NavMessage::GpsLnav;
        ephemeris.eccentricity = -0.1;
        assert_eq!(
            store.insert(&ephemeris),
            Err(NotStored::Orbit(OrbitError::Eccentricity))
        );
        assert!(store.is_empty());
    }
}
