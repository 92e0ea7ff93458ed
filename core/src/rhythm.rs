//! When the receiver is expected to give an epoch, by the time of the inertial samples.
//!
//! A receiver that falls silent sends nothing that could say so; the samples that go on do. An epoch
//! is missing when half an interval has passed since it should have arrived, which is one and a half intervals
//! after the one before where epochs come at once, and later by the receiver's latency where they do not. The
//! latency is what the user says or the epochs show, the larger of the two. The time of samples is believed
//! when they and the epochs were of the same time at the last epoch, and after a leap or a pause when
//! they have gone on for as long again: an epoch that does come shows which of the two it was.

use crate::ins::MAX_LATENCY_NS;
use crate::time::{GpsTime, NS_PER_S};

/// Intervals between epochs that are taken for a rhythm, ns: 20 Hz to one epoch a minute.
const INTERVALS_NS: core::ops::RangeInclusive<i64> = 50_000_000..=60 * NS_PER_S;
/// A step from one sample to the next that is no leap, ns; half an interval of the epochs is none either.
const MAX_STEP_NS: i64 = 50_000_000;
/// Samples and epochs are of the same time when they lie no farther apart than this, ns, where the
/// interval of the epochs is not known.
const SAME_TIME_NS: i64 = NS_PER_S;

/// A latency that was seen is forgotten at this rate, ns in a second: neither soon enough to miss the next
/// epoch of a receiver whose latency jumps about, nor so slowly that one late epoch counts for minutes.
const FORGOTTEN_NS_PER_S: i64 = 10_000_000;

/// When epochs came and samples come.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rhythm {
    /// Last epoch of the receiver.
    last: Option<GpsTime>,
    /// Last time at which an epoch was due, was missed, and this was told.
    told: Option<GpsTime>,
    /// Last three intervals between epochs, ns; 0 where there is none.
    elapsed_ns: [i64; 3],
    /// Time of the last sample.
    heard: Option<GpsTime>,
    /// Time of the first sample since a leap.
    begun: GpsTime,
    /// The samples were of the time of the epochs at the last epoch.
    in_step: bool,
    /// The receiver's latency as the user has it, ns.
    known_latency_ns: i64,
    /// How far the samples were ahead of epochs when these came, ns: the most, less what is forgotten.
    seen_latency_ns: i64,
}

impl Rhythm {
    /// Nothing has come yet.
    pub(crate) const UNKNOWN: Self = Self {
        last: None,
        told: None,
        elapsed_ns: [0; 3],
        heard: None,
        begun: GpsTime::from_ns(0),
        in_step: false,
        known_latency_ns: 0,
        seen_latency_ns: 0,
    };

    /// Epochs come at least so late, ns; no more than the filter's history reaches back.
    pub(crate) fn know_latency(&mut self, latency_ns: i64) {
        self.known_latency_ns = latency_ns.clamp(0, MAX_LATENCY_NS);
    }

    /// How late epochs come, ns, by the time of the samples: as the user has it, or later where they did.
    pub(crate) fn latency_ns(&self) -> i64 {
        self.known_latency_ns.max(self.seen_latency_ns)
    }

    /// The receiver gave an epoch.
    pub(crate) fn epoch(&mut self, time: GpsTime) {
        let elapsed_ns = self.last.map(|last| since(time, last));
        if let Some(elapsed_ns) = elapsed_ns.filter(|ns| INTERVALS_NS.contains(ns)) {
            let [_, second, third] = self.elapsed_ns;
            self.elapsed_ns = [second, third, elapsed_ns];
        }
        self.last = Some(time);
        // What was told missing stays so when an epoch from before it comes at last.
        self.told = self
            .told
            .filter(|told| (1..=SAME_TIME_NS).contains(&since(*told, time)));
        let ahead_ns = self.interval_ns().unwrap_or(SAME_TIME_NS);
        let behind_ns = ahead_ns.max(MAX_LATENCY_NS);
        let late_ns = self.heard.map(|heard| since(heard, time));
        self.in_step = late_ns.is_some_and(|ns| (-ahead_ns..=behind_ns).contains(&ns));
        self.see_latency(late_ns.filter(|_| self.in_step), elapsed_ns.unwrap_or(0));
    }

    /// An epoch came `late_ns` after its instant, and this long after the one before.
    fn see_latency(&mut self, late_ns: Option<i64>, elapsed_ns: i64) {
        let elapsed_ns = elapsed_ns.clamp(0, *INTERVALS_NS.end());
        let forgotten_ns = elapsed_ns / (NS_PER_S / FORGOTTEN_NS_PER_S);
        self.seen_latency_ns = self
            .seen_latency_ns
            .saturating_sub(forgotten_ns)
            .max(late_ns.unwrap_or(0))
            .clamp(0, MAX_LATENCY_NS);
    }

    /// The interval between epochs, ns: of the last three the middle one, so that neither a gap nor an
    /// epoch out of turn is a rhythm; of fewer the longest.
    pub(crate) fn interval_ns(&self) -> Option<i64> {
        let [a, b, c] = self.elapsed_ns;
        let middle = a.min(b).max(a.max(b).min(c));
        let known = if a > 0 { middle } else { b.max(c) };
        (known > 0).then_some(known)
    }

    /// When the next epoch is due.
    pub(crate) fn due(&self) -> Option<GpsTime> {
        let from = self.told.or(self.last)?;
        Some(from.plus_ns(self.interval_ns()?))
    }

    /// A sample came, of whatever content. Gives the time at which an epoch was due and has not come
    /// for half an interval and the latency, once; after a pause of the samples the latest such time alone.
    pub(crate) fn sample(&mut self, now: GpsTime) -> Option<GpsTime> {
        let interval_ns = self.interval_ns();
        let half_ns = interval_ns.unwrap_or(0) / 2;
        let follows = self
            .heard
            .replace(now)
            .is_some_and(|heard| (1..=MAX_STEP_NS.max(half_ns)).contains(&since(now, heard)));
        if !follows {
            self.begun = now;
        }
        let is_believed =
            self.in_step && since(now, self.begun) >= interval_ns?.saturating_add(half_ns);
        if is_believed { self.missed(now) } else { None }
    }

    /// The time at which an epoch was due and had not come half an interval and the latency later, by a
    /// clock that is believed; each time once, and of several the latest alone.
    pub(crate) fn missed(&mut self, now: GpsTime) -> Option<GpsTime> {
        let (due, interval_ns) = (self.due()?, self.interval_ns()?);
        let waiting_ns = since(now, due)
            .saturating_sub(interval_ns / 2)
            .saturating_sub(self.latency_ns());
        if waiting_ns < 0 {
            return None;
        }
        let passed_ns = waiting_ns.checked_rem(interval_ns)?;
        let due = due.plus_ns(waiting_ns.wrapping_sub(passed_ns));
        self.told = Some(due);
        Some(due)
    }

    /// The week of the epochs became known.
    pub(crate) fn shift(&mut self, by_ns: i64) {
        self.last = self.last.map(|time| time.plus_ns(by_ns));
        self.told = self.told.map(|time| time.plus_ns(by_ns));
        self.heard = self.heard.map(|time| time.plus_ns(by_ns));
        self.begun = self.begun.plus_ns(by_ns);
    }
}

fn since(time: GpsTime, earlier: GpsTime) -> i64 {
    time.ns().saturating_sub(earlier.ns())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn at(milliseconds: i64) -> GpsTime {
        GpsTime::from_ns(1_000_000_000_000_000_000 + milliseconds * 1_000_000)
    }

    /// Samples at 100 Hz over (`from`, `to`] with these epochs among them, ms; what was told, and when.
    fn run(rhythm: &mut Rhythm, from: i64, to: i64, epochs: &[i64]) -> Vec<(i64, i64)> {
        let mut told = Vec::new();
        for now in (from + 10..=to).step_by(10) {
            if let Some(due) = rhythm.sample(at(now)) {
                told.push(((due.ns() - at(0).ns()) / 1_000_000, now));
            }
            if epochs.contains(&now) {
                rhythm.epoch(at(now));
            }
        }
        told
    }

    const TEN: [i64; 10] = [1000, 2000, 3000, 4000, 5000, 6000, 7000, 8000, 9000, 10_000];

    /// INT-014.
    #[test]
    fn a_silent_receiver_is_missed_after_one_and_a_half_intervals() {
        let mut rhythm = Rhythm::UNKNOWN;
        assert_eq!(run(&mut rhythm, 0, 11_490, &TEN), []);
        let told = run(&mut rhythm, 11_490, 14_000, &[]);
        assert_eq!(told, [(11_000, 11_500), (12_000, 12_500), (13_000, 13_500)]);
        assert_eq!(rhythm.due(), Some(at(14_000)));
        // And all is well again with the first epoch.
        assert_eq!(run(&mut rhythm, 14_000, 15_400, &[14_100]), []);
    }

    /// The same; the epochs come so many milliseconds after their instants.
    fn run_late(
        rhythm: &mut Rhythm,
        from: i64,
        to: i64,
        epochs: &[i64],
        late: i64,
    ) -> Vec<(i64, i64)> {
        let mut told = Vec::new();
        for now in (from + 10..=to).step_by(10) {
            if let Some(due) = rhythm.sample(at(now)) {
                told.push(((due.ns() - at(0).ns()) / 1_000_000, now));
            }
            if epochs.contains(&(now - late)) {
                rhythm.epoch(at(now - late));
            }
        }
        told
    }

    /// INT-127.
    #[test]
    fn int_127_a_receiver_that_is_late_is_missed_later_by_its_latency() {
        for late in [50, 300, 400] {
            let mut rhythm = Rhythm::UNKNOWN;
            let told = run_late(&mut rhythm, 0, 14_000, &TEN, late);
            let expected = [11_000, 12_000, 13_000].map(|due| (due, due + 500 + late));
            let before_end = expected.into_iter().filter(|(_, when)| *when <= 14_000);
            assert!(told.into_iter().eq(before_end), "{late}");
        }
        // Told beforehand: nothing needs to be learnt.
        let mut rhythm = Rhythm::UNKNOWN;
        rhythm.know_latency(200_000_000);
        run(&mut rhythm, 0, 10_000, &TEN);
        let told = run(&mut rhythm, 10_000, 12_000, &[]);
        assert_eq!(told, [(11_000, 11_700)]);
    }

    /// INT-127.
    #[test]
    fn int_127_a_latency_that_was_seen_once_is_forgotten_in_half_a_minute() {
        let mut rhythm = Rhythm::UNKNOWN;
        run(&mut rhythm, 0, 10_000, &TEN);
        run_late(&mut rhythm, 10_000, 11_990, &[11_000], 300);
        assert_eq!(rhythm.latency_ns(), 300_000_000);
        let on_time: Vec<i64> = (12_000..=60_000).step_by(1000).collect();
        let mut last_ns = rhythm.latency_ns();
        for second in 11..60 {
            let from = 1000 * second + 990;
            run(&mut rhythm, from, from + 1000, &on_time);
            let now_ns = rhythm.latency_ns();
            assert!(last_ns - now_ns <= FORGOTTEN_NS_PER_S, "{second}");
            last_ns = now_ns;
        }
        assert_eq!(last_ns, 0);
        // No epoch is waited for longer than it could be used.
        run_late(&mut rhythm, 60_990, 63_000, &[62_000], 800);
        assert_eq!(rhythm.latency_ns(), MAX_LATENCY_NS);
        rhythm.know_latency(i64::MAX);
        assert_eq!(rhythm.latency_ns(), MAX_LATENCY_NS);
    }

    /// A tenth of a second between epochs, three of which are told missing before they come.
    #[test]
    fn what_was_told_missing_is_not_told_again_when_it_comes_at_last() {
        let mut rhythm = Rhythm::UNKNOWN;
        let epochs: Vec<i64> = (100..=2000).step_by(100).collect();
        assert_eq!(run(&mut rhythm, 0, 2000, &epochs), []);
        let late: Vec<i64> = (2100..=4000).step_by(100).collect();
        let told = run_late(&mut rhythm, 2000, 4000, &late, 300);
        assert_eq!(told, [(2100, 2150), (2200, 2250), (2300, 2350)]);
    }

    #[test]
    fn one_gap_and_one_epoch_out_of_turn_are_no_rhythm() {
        for stranger in [10_100, 10_900] {
            let mut rhythm = Rhythm::UNKNOWN;
            run(&mut rhythm, 0, 10_000, &TEN);
            let told = run(
                &mut rhythm,
                10_000,
                14_000,
                &[stranger, 11_000, 12_000, 13_000],
            );
            assert_eq!(told, [], "{stranger}");
        }
        let mut rhythm = Rhythm::UNKNOWN;
        run(&mut rhythm, 0, 20_000, &TEN);
        run(&mut rhythm, 20_000, 21_490, &[20_000, 21_000]);
        assert_eq!(run(&mut rhythm, 21_490, 22_600, &[]), [(22_000, 22_500)]);
    }

    #[test]
    fn a_slower_rhythm_is_learnt_after_two_intervals() {
        let mut rhythm = Rhythm::UNKNOWN;
        run(&mut rhythm, 0, 10_000, &TEN);
        let slow: Vec<i64> = (12_000..40_000).step_by(2000).collect();
        let told = run(&mut rhythm, 10_000, 40_000, &slow);
        assert_eq!(told, [(11_000, 11_500), (13_000, 13_500)]);
    }

    #[test]
    fn samples_of_another_time_miss_no_epoch() {
        for offset in [-3_600_000, -20_000, 20_000, 3_600_000] {
            let mut rhythm = Rhythm::UNKNOWN;
            for now in (10..=60_000).step_by(10) {
                assert_eq!(rhythm.sample(at(now + offset)), None);
                if now % 1000 == 0 {
                    rhythm.epoch(at(now));
                }
            }
        }
    }

    #[test]
    fn a_sample_that_leaps_misses_no_epoch_and_a_pause_of_both_is_told_once() {
        let mut rhythm = Rhythm::UNKNOWN;
        run(&mut rhythm, 0, 10_000, &TEN);
        for leap in [-3_600_000, 10_000, 3_600_000] {
            assert_eq!(run(&mut rhythm, leap + 10_000, leap + 11_000, &[]), []);
            assert_eq!(run(&mut rhythm, 10_000, 12_400, &[11_000, 12_000]), []);
        }
        // Both silent for a minute: the latest alone is told, and then each in its time.
        let told = run(&mut rhythm, 72_400, 75_600, &[]);
        assert_eq!(told, [(73_000, 73_910), (74_000, 74_500), (75_000, 75_500)]);
    }

    #[test]
    fn without_a_rhythm_nothing_is_missed() {
        let mut rhythm = Rhythm::UNKNOWN;
        assert_eq!(run(&mut rhythm, 0, 100_000, &[1000]), []);
        assert_eq!(rhythm.due(), None);
        for extreme in [i64::MIN, i64::MAX, 0, i64::MIN, i64::MAX] {
            rhythm.sample(GpsTime::from_ns(extreme));
            rhythm.epoch(GpsTime::from_ns(extreme));
        }
    }
}
