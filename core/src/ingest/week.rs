//! Which week it is: RTCM 3 observations carry a time of week only.
//!
//! The full week comes from a BDS or Galileo ephemeris (13 and 12 bits), else from the 10 bits of a
//! GPS ephemeris and a week the user gave, else it is provisional: the 10 bits as they are, or the
//! user's week, or 0. Never from the date of a build. Once an instant is known, each time of week is
//! the instant nearest to the last one, which carries the time across rollovers. A provisional week
//! that turns out wrong is corrected by a whole number of weeks, and everyone who stored a time is
//! told by how many.
//!
//! A week that is known may still turn out wrong: after days without observations the nearest instant
//! is not the right one, and a first ephemeris may have named a wrong week. Then ephemerides keep
//! naming another week. Three in a row of one mind, no two neighbours from one satellite, decide, if
//! the time of week is near theirs; the next epoch is in their week. What was stored stays: each
//! ephemeris names its own week.
//!
//! An ephemeris names the week it was sent in, [IS-GPS-200] 20.3.3.3.1.1, and some receivers write
//! the week of toe instead. The two differ within some hours of a rollover; an ephemeris of which
//! that cannot be told is believed only until a better one comes.

use crate::gnss::Satellite;
use crate::time::{GpsTime, NS_PER_S, NS_PER_WEEK, SECONDS_PER_WEEK, resolve_week};

/// How well the week is known, in ascending order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Knowledge {
    /// Time of week only.
    TimeOfWeek,
    /// Modulo 1024, perhaps off by one.
    Modulo1024OrNext,
    /// Modulo 1024.
    Modulo1024,
    /// From 10 bits and the user's week, perhaps off by one.
    ConfiguredOrNext,
    /// From a message that carries it, perhaps off by one.
    ReceivedOrNext,
    /// From 10 bits and the user's week.
    Configured,
    /// From a message that carries it.
    Received,
}

/// An ephemeris reaches this far beyond the week it is sent in: toe lies 2 h after the start of
/// transmission at most (GPS), or up to 4 h before it (Galileo, BDS); with a margin. s
const TOE_OVER_WEEK_END_S: i64 = 6 * 3600;

/// Toe of an ephemeris in use lies nearer to the present than this; of an old one, which says nothing
/// of the present week, it does not, modulo a week. ns
const TOE_NEAR_PRESENT_NS: i64 = TOE_OVER_WEEK_END_S * NS_PER_S;

/// So many ephemerides in a row have to contradict a known week.
const CONTRADICTIONS_BELIEVED: u8 = 3;

/// Nanoseconds of half a week.
const HALF_WEEK_NS: i64 = NS_PER_WEEK / 2;

/// Ephemerides in a row that agree on another week than the reference's.
#[derive(Clone, Copy, Debug)]
struct Contradiction {
    /// Toe of the last one.
    toe: GpsTime,
    /// The satellite of the last one.
    satellite: Satellite,
    /// How many, not counting those of the same satellite as the one before.
    times: u8,
}

/// Distance of two instants, ns.
fn apart_ns(a: GpsTime, b: GpsTime) -> u64 {
    a.ns().wrapping_sub(b.ns()).unsigned_abs()
}

/// Whether an ephemeris of this toe is in use at `time`.
fn is_near_toe(time: GpsTime, toe: GpsTime) -> bool {
    apart_ns(time, toe) < TOE_NEAR_PRESENT_NS.unsigned_abs()
}

/// What is known about the week.
#[derive(Clone, Copy, Debug)]
pub(super) struct WeekResolver {
    knowledge: Knowledge,
    /// An instant near the present one, right as far as `knowledge` goes.
    reference: Option<GpsTime>,
    /// Whether `reference` was an epoch given to the outside; else only its week may count.
    epochs_seen: bool,
    configured_week: Option<u16>,
    contradiction: Option<Contradiction>,
}

impl WeekResolver {
    pub(super) const EMPTY: Self = Self {
        knowledge: Knowledge::TimeOfWeek,
        reference: None,
        epochs_seen: false,
        configured_week: None,
        contradiction: None,
    };

    /// Takes the user's week.
    pub(super) fn configure(&mut self, reference_week: Option<u16>) {
        self.configured_week = reference_week;
    }

    /// Whether times are right modulo some weeks only.
    pub(super) fn is_unknown(&self) -> bool {
        self.knowledge < Knowledge::Configured
    }

    /// An instant near the present one.
    pub(super) fn reference(&self) -> Option<GpsTime> {
        self.reference
    }

    /// The instant of a time of week.
    pub(super) fn resolve(&self, tow_ns: i64) -> GpsTime {
        let Some(reference) = self.reference else {
            return GpsTime::from_week_tow_ns(i32::from(self.configured_week.unwrap_or(0)), tow_ns);
        };
        let nearest = GpsTime::nearest(tow_ns, reference);
        // An epoch stays where it was begun.
        if self.epochs_seen && nearest == reference {
            return nearest;
        }
        match self.contradiction {
            Some(other) if other.times >= CONTRADICTIONS_BELIEVED => {
                let contradicting = GpsTime::nearest(tow_ns, other.toe);
                if is_near_toe(contradicting, other.toe) {
                    contradicting
                } else {
                    nearest
                }
            }
            _ => nearest,
        }
    }

    /// The instant of an epoch whose sender may not have known the week.
    pub(super) fn resolve_provisional(&self, time: GpsTime) -> GpsTime {
        if self.is_unknown() {
            time
        } else {
            self.resolve(time.tow_ns())
        }
    }

    /// The instant of an inertial sample. It never tells the week: while that of the receiver is
    /// provisional, a sample has to lie in the same provisional week as the epochs around it.
    pub(super) fn resolve_sample(&self, time: GpsTime) -> GpsTime {
        match self.reference {
            Some(reference) if self.is_unknown() => GpsTime::nearest(time.tow_ns(), reference),
            _ => time,
        }
    }

    /// An epoch begins at `time`.
    pub(super) fn at_epoch(&mut self, time: GpsTime) {
        self.reference = Some(time);
        self.epochs_seen = true;
        // Kept while it may still grow; what the epoch followed, or what was old, has done its part.
        self.contradiction = self.contradiction.filter(|other| {
            let contradicting = GpsTime::nearest(time.tow_ns(), other.toe);
            contradicting != time && is_near_toe(contradicting, other.toe)
        });
    }

    /// A GPS ephemeris came, with its 10-bit week and toe. Tells by how many weeks everything before
    /// was wrong.
    pub(super) fn learn_gps_week(
        &mut self,
        satellite: Satellite,
        week_modulo_1024: u16,
        toe_s: u32,
    ) -> i32 {
        let truncated = i32::from(week_modulo_1024);
        let (week, certain, uncertain) = match self.configured_week {
            Some(near) => (
                resolve_week(truncated, 1024, i32::from(near)),
                Knowledge::Configured,
                Knowledge::ConfiguredOrNext,
            ),
            None => (
                truncated,
                Knowledge::Modulo1024,
                Knowledge::Modulo1024OrNext,
            ),
        };
        let toe = GpsTime::from_week_tow_s(week, i64::from(toe_s));
        self.learn_ephemeris(satellite, toe, toe_s, certain, uncertain)
    }

    /// An ephemeris came with its full week; `toe` is the instant in that week, `toe_s` its second
    /// there. Tells by how many weeks everything before was wrong.
    pub(super) fn learn_full_week(
        &mut self,
        satellite: Satellite,
        toe: GpsTime,
        toe_s: u32,
    ) -> i32 {
        let (certain, uncertain) = (Knowledge::Received, Knowledge::ReceivedOrNext);
        self.learn_ephemeris(satellite, toe, toe_s, certain, uncertain)
    }

    /// An ephemeris came in a native frame; `is_modulo_1024` if its sender may have known the week
    /// modulo 1024 only. Tells by how many weeks everything before was wrong.
    pub(super) fn learn_native_ephemeris(
        &mut self,
        satellite: Satellite,
        toe: GpsTime,
        is_modulo_1024: bool,
    ) -> i32 {
        let knowledge = if is_modulo_1024 {
            Knowledge::Modulo1024
        } else {
            Knowledge::ReceivedOrNext
        };
        self.compare(satellite, toe, knowledge);
        self.learn(toe, knowledge)
    }

    /// An epoch came with its full week. Tells by how many weeks everything before was wrong.
    pub(super) fn learn_epoch(&mut self, time: GpsTime) -> i32 {
        self.learn(time, Knowledge::Received)
    }

    fn learn_ephemeris(
        &mut self,
        satellite: Satellite,
        toe: GpsTime,
        toe_s: u32,
        certain: Knowledge,
        uncertain: Knowledge,
    ) -> i32 {
        let toe_s = i64::from(toe_s);
        let is_far_from_rollover =
            (TOE_OVER_WEEK_END_S..=SECONDS_PER_WEEK - TOE_OVER_WEEK_END_S).contains(&toe_s);
        let is_in_same_half = match self.reference {
            Some(present) if self.epochs_seen => {
                (toe_s < SECONDS_PER_WEEK / 2) == (present.tow_ns() < HALF_WEEK_NS)
            }
            _ => false,
        };
        if is_far_from_rollover || is_in_same_half {
            self.compare(satellite, toe, certain);
            self.learn(toe, certain)
        } else {
            // Taken for the week it was sent in, whatever the time in it.
            let week_start = toe.plus_ns(toe_s.wrapping_neg().wrapping_mul(NS_PER_S));
            self.learn(week_start.plus_ns(HALF_WEEK_NS), uncertain)
        }
    }

    /// Notes whether an ephemeris contradicts the week, if it is as good as what the week is from. A
    /// better one is believed at once.
    fn compare(&mut self, satellite: Satellite, toe: GpsTime, knowledge: Knowledge) {
        let Some(reference) = self.reference else {
            return;
        };
        if knowledge != self.knowledge {
            return;
        }
        let toe = match knowledge {
            Knowledge::Modulo1024 | Knowledge::Configured => {
                // Ten bits contradict by some weeks, never by an era.
                let eras =
                    resolve_week(toe.week(), 1024, reference.week()).wrapping_sub(toe.week());
                toe.plus_ns(i64::from(eras).wrapping_mul(NS_PER_WEEK))
            }
            _ => toe,
        };
        if apart_ns(toe, reference) <= HALF_WEEK_NS.unsigned_abs() {
            self.contradiction = None;
            return;
        }
        let times = match self.contradiction {
            Some(other) if !is_near_toe(toe, other.toe) => 1,
            Some(other) if other.satellite == satellite => other.times,
            Some(other) => other.times.saturating_add(1),
            None => 1,
        };
        self.contradiction = Some(Contradiction {
            toe,
            satellite,
            times,
        });
    }

    fn learn(&mut self, near: GpsTime, knowledge: Knowledge) -> i32 {
        let before = self.knowledge;
        if knowledge <= before {
            return 0;
        }
        self.knowledge = knowledge;
        self.contradiction = None;
        let Some(reference) = self.reference else {
            self.reference = Some(near);
            return 0;
        };
        if !self.epochs_seen {
            self.reference = Some(near);
            // The reference was an ephemeris, which may be some weeks old; that is no error. An era
            // is, and ephemerides of it may be stored.
            let eras = resolve_week(near.week(), 1024, reference.week()).wrapping_sub(near.week());
            let is_of_an_era = before <= Knowledge::Modulo1024;
            return if is_of_an_era { eras.wrapping_neg() } else { 0 };
        }
        let resolved = GpsTime::nearest(reference.tow_ns(), near);
        self.reference = Some(resolved);
        resolved.week().wrapping_sub(reference.week())
    }

    /// The full week of a GPS ephemeris, after [`WeekResolver::learn_gps_week`].
    pub(super) fn full_gps_week(&self, week_modulo_1024: u16) -> i32 {
        let truncated = i32::from(week_modulo_1024);
        match self.reference {
            Some(reference) => resolve_week(truncated, 1024, reference.week()),
            None => truncated,
        }
    }

    /// The instant of a toe or toc that came with its week of transmission. `named` is the instant in
    /// that week and `of_week_s` its second there. Near the end of a week the instant may belong to
    /// the next one, near its start to the one before; which, the present time tells.
    pub(super) fn near_week_end(&self, named: GpsTime, of_week_s: u32) -> GpsTime {
        let of_week_s = i64::from(of_week_s);
        let moved = if of_week_s < TOE_OVER_WEEK_END_S {
            named.plus_ns(NS_PER_WEEK)
        } else if of_week_s > SECONDS_PER_WEEK - TOE_OVER_WEEK_END_S {
            named.plus_ns(-NS_PER_WEEK)
        } else {
            return named;
        };
        match self.reference {
            Some(reference) if apart_ns(moved, reference) < apart_ns(named, reference) => moved,
            _ => named,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::System;

    fn at(week: i32, tow_s: i64) -> GpsTime {
        GpsTime::from_week_tow_s(week, tow_s)
    }

    fn satellite(prn: u8) -> Satellite {
        Satellite::new(System::Galileo, prn).unwrap()
    }

    fn learn_full(weeks: &mut WeekResolver, week: i32, toe_s: u32) -> i32 {
        weeks.learn_full_week(satellite(1), at(week, i64::from(toe_s)), toe_s)
    }

    #[test]
    fn galileo_or_bds_week_corrects_a_provisional_one() {
        let mut weeks = WeekResolver::EMPTY;
        let first = weeks.resolve(100_000 * NS_PER_S);
        assert_eq!(first, at(0, 100_000));
        weeks.at_epoch(first);
        assert_eq!(weeks.learn_gps_week(satellite(1), 986, 100_800), 986);
        assert!(weeks.is_unknown());
        assert_eq!(weeks.resolve(100_001 * NS_PER_S), at(986, 100_001));
        assert_eq!(learn_full(&mut weeks, 2010, 99_000), 1024);
        assert!(!weeks.is_unknown());
        assert_eq!(weeks.resolve(100_002 * NS_PER_S), at(2010, 100_002));
        assert_eq!(weeks.full_gps_week(985), 2009);
    }

    #[test]
    fn users_week_selects_the_era() {
        for (near, expected) in [(1800, 2010), (2300, 2010), (1000, 986)] {
            let mut weeks = WeekResolver::EMPTY;
            weeks.configure(Some(near));
            assert_eq!(weeks.learn_gps_week(satellite(1), 986, 100_800), 0);
            assert!(!weeks.is_unknown());
            assert_eq!(weeks.resolve(100_000 * NS_PER_S), at(expected, 100_000));
        }
    }

    #[test]
    fn time_of_week_goes_on_across_a_rollover() {
        let mut weeks = WeekResolver::EMPTY;
        learn_full(&mut weeks, 2009, 500_000);
        weeks.at_epoch(weeks.resolve(604_799 * NS_PER_S));
        assert_eq!(weeks.resolve(0), at(2010, 0));
    }

    #[test]
    fn week_of_transmission_before_a_rollover_is_not_the_week_of_toe() {
        // GPS sends toe 0 of the next week in the last two hours of a week.
        let mut weeks = WeekResolver::EMPTY;
        weeks.at_epoch(weeks.resolve(604_210 * NS_PER_S));
        assert_eq!(weeks.learn_gps_week(satellite(1), 985, 0), 985);
        assert_eq!(weeks.resolve(604_211 * NS_PER_S), at(985, 604_211));
        assert_eq!(weeks.near_week_end(at(985, 0), 0), at(986, 0));
        // Galileo's toe of the same week is certain.
        assert_eq!(learn_full(&mut weeks, 2009, 602_400), 1024);
        assert!(!weeks.is_unknown());
        assert_eq!(weeks.resolve(604_212 * NS_PER_S), at(2009, 604_212));
        assert_eq!(weeks.near_week_end(at(2009, 0), 0), at(2010, 0));
    }

    #[test]
    fn week_of_toe_written_for_that_of_transmission_is_corrected() {
        let mut weeks = WeekResolver::EMPTY;
        weeks.at_epoch(weeks.resolve(600_000 * NS_PER_S));
        assert_eq!(
            weeks.learn_gps_week(satellite(1), 1002, 0),
            1002,
            "off by one, and provisional"
        );
        assert!(weeks.is_unknown());
        assert_eq!(learn_full(&mut weeks, 2025, 597_600), 1023);
        assert!(!weeks.is_unknown());
        assert_eq!(weeks.resolve(600_001 * NS_PER_S), at(2025, 600_001));
        assert_eq!(weeks.near_week_end(at(2026, 0), 0), at(2026, 0));
    }

    #[test]
    fn toe_before_the_rollover_in_a_week_after_it() {
        let mut weeks = WeekResolver::EMPTY;
        learn_full(&mut weeks, 2009, 414_000);
        weeks.at_epoch(at(2009, 604_799));
        weeks.at_epoch(weeks.resolve(60 * NS_PER_S));
        assert_eq!(
            weeks.near_week_end(at(2010, 604_200), 604_200),
            at(2009, 604_200)
        );
        assert_eq!(
            weeks.near_week_end(at(2009, 604_200), 604_200),
            at(2009, 604_200)
        );
        assert_eq!(weeks.near_week_end(at(2010, 0), 0), at(2010, 0));
        assert_eq!(weeks.near_week_end(at(2009, 0), 0), at(2010, 0));
    }

    #[test]
    fn ephemeris_of_last_week_stays_old() {
        let mut weeks = WeekResolver::EMPTY;
        learn_full(&mut weeks, 2010, 300_000);
        weeks.at_epoch(at(2010, 300_000));
        assert_eq!(
            weeks.near_week_end(at(2009, 180_000), 180_000),
            at(2009, 180_000)
        );
    }

    #[test]
    fn before_the_first_epoch_only_an_era_is_an_error() {
        let mut weeks = WeekResolver::EMPTY;
        assert_eq!(weeks.learn_gps_week(satellite(1), 984, 100_800), 0);
        assert_eq!(learn_full(&mut weeks, 2010, 100_000), 1024);
        assert_eq!(weeks.resolve(100_000 * NS_PER_S), at(2010, 100_000));
        let mut weeks = WeekResolver::EMPTY;
        assert_eq!(
            weeks.learn_native_ephemeris(satellite(1), at(2009, 100_800), true),
            0
        );
        assert_eq!(
            weeks.learn_native_ephemeris(satellite(1), at(2010, 100_800), false),
            0
        );
        assert_eq!(weeks.learn_epoch(at(2010, 100_900)), 0);
        assert!(!weeks.is_unknown());
    }

    #[test]
    fn a_week_known_wrong_is_corrected_by_ephemerides_of_one_mind() {
        // Four days without observations: the nearest instant is a week early.
        let mut weeks = WeekResolver::EMPTY;
        learn_full(&mut weeks, 2420, 270_000);
        weeks.at_epoch(at(2420, 274_220));
        let resumed = weeks.resolve(15_020 * NS_PER_S);
        assert_eq!(resumed, at(2420, 15_020));
        weeks.at_epoch(resumed);
        for (prn, toe_s) in [(1, 12_600), (1, 13_200), (2, 12_600)] {
            assert_eq!(
                weeks.learn_full_week(satellite(prn), at(2421, toe_s), toe_s as u32),
                0
            );
            assert_eq!(weeks.resolve(15_021 * NS_PER_S), at(2420, 15_021));
        }
        assert_eq!(
            weeks.learn_full_week(satellite(3), at(2421, 12_600), 12_600),
            0
        );
        // The rest of an epoch stays with its beginning, the next one is right.
        assert_eq!(weeks.resolve(15_020 * NS_PER_S), at(2420, 15_020));
        let next = weeks.resolve(15_021 * NS_PER_S);
        assert_eq!(next, at(2421, 15_021));
        weeks.at_epoch(next);
        assert_eq!(weeks.resolve(15_022 * NS_PER_S), at(2421, 15_022));
    }

    #[test]
    fn neither_a_stray_nor_old_ephemerides_move_a_right_week() {
        let mut weeks = WeekResolver::EMPTY;
        learn_full(&mut weeks, 2420, 270_000);
        weeks.at_epoch(at(2420, 274_220));
        // One satellite is of another week, whatever it says how often.
        for _ in 0..9 {
            weeks.learn_full_week(satellite(9), at(2421, 270_000), 270_000);
        }
        assert_eq!(weeks.resolve(274_221 * NS_PER_S), at(2420, 274_221));
        // Two are, among others.
        for prn in [9, 10, 1, 9, 10, 1] {
            let week = 2420 + i32::from(prn > 5);
            weeks.learn_full_week(satellite(prn), at(week, 270_000), 270_000);
            assert_eq!(weeks.resolve(274_221 * NS_PER_S), at(2420, 274_221));
        }
        // A receiver sends what it had stored five days before.
        for prn in 1..=9 {
            weeks.learn_full_week(satellite(prn), at(2419, 440_000), 440_000);
        }
        assert_eq!(weeks.resolve(274_221 * NS_PER_S), at(2420, 274_221));
        weeks.at_epoch(at(2420, 274_221));
        // Which does not take effect when its time of week comes.
        assert_eq!(weeks.resolve(440_000 * NS_PER_S), at(2420, 440_000));
    }

    #[test]
    fn ten_bits_tell_weeks_but_no_era() {
        for configured in [None, Some(2040)] {
            let mut weeks = WeekResolver::EMPTY;
            weeks.configure(configured);
            weeks.learn_gps_week(satellite(1), 1023, 410_400);
            let era = weeks.reference().unwrap().week();
            // On into the next era.
            weeks.at_epoch(at(era, 604_799));
            weeks.at_epoch(at(era + 1, 100_000));
            for prn in 1..=5 {
                weeks.learn_gps_week(satellite(prn), 0, 100_800);
            }
            assert_eq!(weeks.resolve(100_001 * NS_PER_S), at(era + 1, 100_001));
            for prn in 1..=5 {
                weeks.learn_gps_week(satellite(prn), 1, 100_800);
            }
            assert_eq!(weeks.resolve(100_001 * NS_PER_S), at(era + 2, 100_001));
        }
    }
}
