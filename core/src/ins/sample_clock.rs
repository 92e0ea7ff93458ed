//! When a sample was, in GPS time: from the clock of the board, by the receiver's time pulse.
//!
//! In: pulses and epochs of the receiver, each with the reading of the board's clock when it came.
//! Out: GPS time of any other reading, or the reason there is none.
//!
//! | symbol | code          | unit | meaning                                                    |
//! |--------|---------------|------|------------------------------------------------------------|
//! | t      | `local_ns`    | ns   | reading of the board's clock                               |
//! | t_p    | `pulse_ns`    | ns   | reading at the last pulse that was believed                |
//! | N      | `second`      | s    | GPS second that this pulse marks                           |
//! | r      | `rate`        | ns/s | what the board's clock advances in a second of GPS time    |
//! | T, t_a |               |      | time of an epoch, and the reading when its last byte came  |
//!
//! A sample read at t was at N + (t − t_p) / r. A pulse says exactly when a second begins, not which one; an
//! epoch says which, not when it began: its bytes come somewhat after T. With the age of the answer
//! below a second, N is the one whole number in T − (t_a − t_p) / r + (−[`EARLIEST_NS`], 1 s − [`EARLIEST_NS`]).
//! r is the mean of the last [`RATE_PULSES`] intervals, weighted to the newest.
//!
//! Nothing here reads a clock. Times of the board are compared, never wrapped: 64 bits of ns last for 584 years.
//!
//! Assumes: pulses at whole seconds of GPS time (for a u-blox receiver CFG-TP with the time grid GPS); an epoch
//! is complete at the board within 0.99 s of its own time; the board's clock is right to 200 ppm. Each is
//! tested against the others: what contradicts is refused and counted, and believed only when it has come
//! three times in a row.

use crate::time::{GpsTime, NS_PER_S, NS_PER_WEEK};

/// Longest time from a pulse to a sample that is still timed by it, ns. With r known to 2 ppm the time is
/// then wrong by 0.12 ms at most, 12 mm at 100 m/s.
pub const HOLD_OVER_NS: i64 = 60 * NS_PER_S;
/// From here on after the last pulse the time is called held over, ns.
pub const PULSE_IS_MISSING_NS: i64 = 3 * NS_PER_S / 2;
/// Intervals between pulses that the rate is the mean of.
pub const RATE_PULSES: u32 = 8;
/// An epoch may seem to come before its own time by this much, ns: receivers label epochs by clocks of
/// their own, which are set to within a millisecond.
pub const EARLIEST_NS: i64 = 10_000_000;

/// Error of a board's clock at which its pulses are believed, ns per second: 200 ppm, …
const RATE_TOLERANCE_NS: f64 = 200_000.0;
/// … and once the rate has been seen [`SETTLED`] times 20 ppm of that, …
const SETTLED_TOLERANCE_NS: f64 = 20_000.0;
/// … beside what an interrupt takes, ns.
const JITTER_NS: f64 = 20_000.0;
/// Intervals after which the rate is known well.
const SETTLED: u32 = 4;
/// Pulses, or epochs, that contradict what is known and agree among themselves until they are believed.
const IN_A_ROW: u8 = 3;
/// Epochs that name the same second before it is believed at first.
const FIRST_IN_A_ROW: u8 = 2;

/// Nominal rate, ns of the board's clock per second.
const NOMINAL_RATE: f64 = NS_PER_S as f64;

/// Why a sample has no time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoTime {
    /// No pulse has come.
    NoPulse,
    /// No epoch has told yet which second the pulses mark.
    NotNumbered,
    /// The last pulse is too far away.
    TooFar {
        /// From the pulse to the sample, ns.
        since_pulse_ns: i64,
    },
}

/// How the time stands at some instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleClockState {
    /// There is none.
    None(NoTime),
    /// Timed by the pulse of this second.
    Locked,
    /// By an older one: pulses are missing.
    HeldOver,
}

/// What became of pulses, epochs and samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SampleClockCounters {
    /// Pulses believed.
    pub pulses: u32,
    /// Pulses that never came between two that did.
    pub missing: u32,
    /// Pulses at a time at which none can be: not believed.
    pub refused: u32,
    /// Times that pulses went on elsewhere: a new beginning.
    pub restarts: u32,
    /// Epochs that name another second than the one believed.
    pub contradicted: u32,
    /// Times that the second was named, or named anew.
    pub numbered: u32,
    /// Samples timed while pulses were missing.
    pub held_over: u32,
    /// Samples without a time: not used.
    pub without_time: u32,
}

impl SampleClockCounters {
    const ZERO: Self = Self {
        pulses: 0,
        missing: 0,
        refused: 0,
        restarts: 0,
        contradicted: 0,
        numbered: 0,
        held_over: 0,
        without_time: 0,
    };
}

/// Something that contradicts what is known, and how often it came in a row.
#[derive(Clone, Copy, Debug)]
struct Claim<T> {
    what: T,
    times: u8,
}

/// The state between pulses.
#[derive(Clone, Copy, Debug)]
pub struct SampleClock {
    pulse_ns: Option<u64>,
    second: Option<i64>,
    rate: f64,
    /// Intervals that the rate is made of.
    intervals: u32,
    /// A pulse that was refused.
    other_pulse: Option<Claim<u64>>,
    /// The second that epochs give to the last pulse, when it is not the one believed.
    other_second: Option<Claim<i64>>,
    counters: SampleClockCounters,
}

impl SampleClock {
    /// No pulse has come.
    pub const EMPTY: Self = Self {
        pulse_ns: None,
        second: None,
        rate: NOMINAL_RATE,
        intervals: 0,
        other_pulse: None,
        other_second: None,
        counters: SampleClockCounters::ZERO,
    };

    /// The receiver's pulse came when the board's clock stood at `local_ns`.
    pub fn pulse(&mut self, local_ns: u64) {
        let Some(last_ns) = self.pulse_ns else {
            self.begin(local_ns);
            return;
        };
        let Some((seconds, interval)) = self.whole_seconds(last_ns, local_ns, self.tolerance())
        else {
            self.refuse_pulse(local_ns);
            return;
        };
        self.pulse_ns = Some(local_ns);
        self.second = self.second.map(|second| second.saturating_add(seconds));
        if let Some(claim) = &mut self.other_second {
            claim.what = claim.what.saturating_add(seconds);
        }
        self.intervals = self.intervals.saturating_add(1).min(RATE_PULSES);
        self.rate += (interval - self.rate) / f64::from(self.intervals);
        self.other_pulse = None;
        count(&mut self.counters.pulses, 1);
        count(&mut self.counters.missing, (seconds - 1) as u32);
    }

    /// An epoch of the receiver, of time `time`; its last byte came when the board's clock stood at
    /// `local_ns`.
    pub fn epoch(&mut self, time: GpsTime, local_ns: u64) {
        let Some(since_pulse_ns) = self.since_pulse_ns(local_ns) else {
            return;
        };
        if since_pulse_ns.saturating_abs() > HOLD_OVER_NS {
            return;
        }
        let at_pulse_ns = time.ns().saturating_sub(since_pulse_ns);
        // Rounded up: the answer is older than its epoch.
        let second = at_pulse_ns
            .saturating_sub(EARLIEST_NS)
            .saturating_add(NS_PER_S - 1)
            .div_euclid(NS_PER_S);
        let needed = match self.second {
            Some(believed) if believed == second => {
                self.other_second = None;
                return;
            }
            // The receiver has learned the week.
            Some(believed) if second.saturating_sub(believed) % (NS_PER_WEEK / NS_PER_S) == 0 => 1,
            Some(_) => IN_A_ROW,
            None => FIRST_IN_A_ROW,
        };
        if self.second.is_some() {
            count(&mut self.counters.contradicted, 1);
        }
        let times = match self.other_second {
            Some(claim) if claim.what == second => claim.times.saturating_add(1),
            _ => 1,
        };
        if times < needed {
            self.other_second = Some(Claim {
                what: second,
                times,
            });
            return;
        }
        self.second = Some(second);
        self.other_second = None;
        count(&mut self.counters.numbered, 1);
    }

    /// GPS time of a sample that was when the board's clock stood at `local_ns`.
    ///
    /// # Errors
    /// [`NoTime`]; the sample is of no use, and is counted.
    pub fn time(&mut self, local_ns: u64) -> Result<GpsTime, NoTime> {
        let state = self.state(local_ns);
        match (state, self.second, self.since_pulse_ns(local_ns)) {
            (SampleClockState::None(why), ..) => {
                count(&mut self.counters.without_time, 1);
                Err(why)
            }
            (state, Some(second), Some(since_pulse_ns)) => {
                let is_held_over = state == SampleClockState::HeldOver;
                count(&mut self.counters.held_over, u32::from(is_held_over));
                let second_ns = second.saturating_mul(NS_PER_S);
                Ok(GpsTime::from_ns(second_ns.saturating_add(since_pulse_ns)))
            }
            (_, None, _) | (_, _, None) => Err(NoTime::NotNumbered),
        }
    }

    /// How the time stands when the board's clock stands at `local_ns`.
    pub fn state(&self, local_ns: u64) -> SampleClockState {
        let Some(since_pulse_ns) = self.since_pulse_ns(local_ns) else {
            return SampleClockState::None(NoTime::NoPulse);
        };
        let away_ns = since_pulse_ns.saturating_abs();
        if away_ns > HOLD_OVER_NS {
            SampleClockState::None(NoTime::TooFar { since_pulse_ns })
        } else if self.second.is_none() {
            SampleClockState::None(NoTime::NotNumbered)
        } else if away_ns > PULSE_IS_MISSING_NS {
            SampleClockState::HeldOver
        } else {
            SampleClockState::Locked
        }
    }

    /// What became of everything so far.
    pub const fn counters(&self) -> SampleClockCounters {
        self.counters
    }

    /// How much the board's clock is too fast, parts in a million; 0 before the second pulse.
    pub fn rate_error_ppm(&self) -> f64 {
        (self.rate / NOMINAL_RATE - 1.0) * 1e6
    }

    /// From the last pulse to a reading of the board's clock, ns of GPS time.
    fn since_pulse_ns(&self, local_ns: u64) -> Option<i64> {
        let pulse_ns = self.pulse_ns?;
        // Saturates: 2^53 ns are 104 days, further than anything is timed.
        let local = if local_ns >= pulse_ns {
            local_ns.wrapping_sub(pulse_ns) as f64
        } else {
            -(pulse_ns.wrapping_sub(local_ns) as f64)
        };
        Some(libm::round(local * (NS_PER_S as f64 / self.rate)) as i64)
    }

    /// Error of an interval between pulses that is believed, ns per second.
    fn tolerance(&self) -> f64 {
        if self.intervals >= SETTLED {
            SETTLED_TOLERANCE_NS
        } else {
            RATE_TOLERANCE_NS
        }
    }

    /// Whole seconds between two pulses and the length of one by the board's clock, ns; `None` when it is no
    /// whole number of them, or more than is bridged.
    fn whole_seconds(&self, from_ns: u64, to_ns: u64, tolerance: f64) -> Option<(i64, f64)> {
        let elapsed = to_ns.checked_sub(from_ns)? as f64;
        let seconds = libm::round(elapsed / self.rate);
        let most = (HOLD_OVER_NS / NS_PER_S) as f64;
        let is_whole = libm::fabs(elapsed - seconds * self.rate) <= JITTER_NS + seconds * tolerance;
        (is_whole && seconds >= 1.0 && seconds <= most).then(|| (seconds as i64, elapsed / seconds))
    }

    /// A pulse where none can be: believed when those after it agree with it.
    fn refuse_pulse(&mut self, local_ns: u64) {
        let agrees = |claim: &Claim<u64>| {
            self.whole_seconds(claim.what, local_ns, RATE_TOLERANCE_NS)
                .is_some()
        };
        let times = match self.other_pulse.filter(agrees) {
            Some(claim) => claim.times.saturating_add(1),
            None => 1,
        };
        if times >= IN_A_ROW {
            count(&mut self.counters.restarts, 1);
            self.begin(local_ns);
            return;
        }
        count(&mut self.counters.refused, 1);
        self.other_pulse = Some(Claim {
            what: local_ns,
            times,
        });
    }

    /// From a pulse that is believed without one before it. Which second it marks is not known.
    fn begin(&mut self, local_ns: u64) {
        let mut counters = self.counters;
        count(&mut counters.pulses, 1);
        *self = Self {
            pulse_ns: Some(local_ns),
            counters,
            ..Self::EMPTY
        };
    }
}

fn count(counter: &mut u32, by: u32) {
    *counter = counter.saturating_add(by);
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    /// A board's clock against GPS time: where it stood at second 1000, and how fast it is.
    struct Board {
        at_1000_ns: u64,
        ppm: f64,
    }

    const FAST: Board = Board {
        at_1000_ns: 123_456_789_012,
        ppm: 37.0,
    };

    impl Board {
        fn local(&self, gps_s: f64) -> u64 {
            let since_ns = (gps_s - 1000.0) * 1e9 * (1.0 + self.ppm * 1e-6);
            self.at_1000_ns.saturating_add_signed(since_ns as i64)
        }
    }

    fn gps(seconds: f64) -> GpsTime {
        GpsTime::from_ns((seconds * 1e9) as i64)
    }

    /// Pulses, and ten epochs a second that come 30 ms late.
    fn run(clock: &mut SampleClock, board: &Board, seconds: core::ops::Range<i32>) {
        for second in seconds {
            let second = f64::from(second);
            clock.pulse(board.local(second));
            for tenth in 0..10 {
                let epoch = second + 0.1 * f64::from(tenth);
                clock.epoch(gps(epoch), board.local(epoch + 0.03));
            }
        }
    }

    fn error_ns(clock: &mut SampleClock, board: &Board, at_s: f64) -> i64 {
        let time = clock.time(board.local(at_s)).unwrap();
        time.ns() - gps(at_s).ns()
    }

    /// INT-083.
    #[test]
    fn samples_are_timed_to_a_microsecond_by_a_clock_that_runs_fast() {
        for ppm in [-150.0, 0.0, 37.0, 150.0] {
            let board = Board { ppm, ..FAST };
            let mut clock = SampleClock::EMPTY;
            run(&mut clock, &board, 1000..1020);
            for at_s in [1019.001, 1019.5, 1019.999, 1020.3] {
                let error_ns = error_ns(&mut clock, &board, at_s);
                assert!(error_ns.abs() < 1000, "{ppm}, {at_s}: {error_ns}");
            }
            assert!((clock.rate_error_ppm() - ppm).abs() < 0.01);
            let counters = clock.counters();
            assert_eq!((counters.pulses, counters.refused), (20, 0));
            assert_eq!((counters.numbered, counters.contradicted), (1, 0));
        }
    }

    /// INT-083.
    #[test]
    fn epochs_of_any_age_below_a_second_name_the_same_second() {
        for age_s in [-0.009, 0.0, 0.005, 0.12, 0.5, 0.98] {
            let mut clock = SampleClock::EMPTY;
            for second in 1000..1005 {
                let second = f64::from(second);
                clock.pulse(FAST.local(second));
                for tenth in 0..10 {
                    // Those that have come before the next pulse; what is later belongs behind it.
                    let came_s = second + 0.1 * f64::from(tenth) + 0.013;
                    clock.epoch(gps(came_s - age_s), FAST.local(came_s));
                }
            }
            assert!(error_ns(&mut clock, &FAST, 1004.7).abs() < 1000, "{age_s}");
            assert_eq!(clock.counters().contradicted, 0, "{age_s}");
        }
    }

    /// INT-083.
    #[test]
    fn there_is_no_time_before_a_pulse_and_an_epoch() {
        let mut clock = SampleClock::EMPTY;
        clock.epoch(gps(1000.0), FAST.local(1000.0));
        assert_eq!(clock.time(FAST.local(1000.0)), Err(NoTime::NoPulse));
        clock.pulse(FAST.local(1001.0));
        assert_eq!(clock.time(FAST.local(1001.0)), Err(NoTime::NotNumbered));
        clock.epoch(gps(1001.0), FAST.local(1001.1));
        assert_eq!(clock.time(FAST.local(1001.1)), Err(NoTime::NotNumbered));
        clock.epoch(gps(1001.1), FAST.local(1001.2));
        assert!(clock.time(FAST.local(1001.3)).is_ok());
        assert_eq!(clock.counters().without_time, 3);
    }

    /// INT-083.
    #[test]
    fn a_lost_pulse_is_bridged_and_told_and_a_lost_minute_ends_the_time() {
        let mut clock = SampleClock::EMPTY;
        run(&mut clock, &FAST, 1000..1010);
        assert_eq!(clock.state(FAST.local(1010.4)), SampleClockState::Locked);
        assert_eq!(clock.state(FAST.local(1010.6)), SampleClockState::HeldOver);
        assert!(error_ns(&mut clock, &FAST, 1068.9).abs() < 120_000);
        assert_eq!(clock.counters().held_over, 1);
        let too_far = clock.time(FAST.local(1069.1));
        assert!(matches!(too_far, Err(NoTime::TooFar { .. })));
        // A pulse after seven that were lost.
        run(&mut clock, &FAST, 1017..1018);
        assert_eq!(clock.counters().missing, 7);
        assert!(error_ns(&mut clock, &FAST, 1017.5).abs() < 1000);
    }

    /// INT-083.
    #[test]
    fn a_pulse_that_jumps_is_refused_and_one_that_stays_there_is_a_new_beginning() {
        let mut clock = SampleClock::EMPTY;
        run(&mut clock, &FAST, 1000..1010);
        clock.pulse(FAST.local(1010.3));
        clock.pulse(FAST.local(1_010.000_1));
        assert_eq!(clock.counters().refused, 2);
        run(&mut clock, &FAST, 1011..1012);
        assert!(error_ns(&mut clock, &FAST, 1011.5).abs() < 1000);

        for second in 1012..1015 {
            clock.pulse(FAST.local(f64::from(second) + 0.3));
        }
        assert_eq!(clock.counters().restarts, 1);
        let state = clock.state(FAST.local(1014.4));
        assert_eq!(state, SampleClockState::None(NoTime::NotNumbered));
    }

    /// INT-083.
    #[test]
    fn one_epoch_does_not_change_the_second_and_three_do() {
        let mut clock = SampleClock::EMPTY;
        run(&mut clock, &FAST, 1000..1005);
        let wrong = |clock: &mut SampleClock, at_s: f64| {
            clock.epoch(gps(at_s - 3.0), FAST.local(at_s + 0.03));
        };
        wrong(&mut clock, 1004.1);
        wrong(&mut clock, 1004.2);
        clock.epoch(gps(1004.3), FAST.local(1004.33));
        assert!(error_ns(&mut clock, &FAST, 1004.4).abs() < 1000);
        assert_eq!(clock.counters().contradicted, 2);
        for at_s in [1004.4, 1004.5, 1004.6] {
            wrong(&mut clock, at_s);
        }
        let error_ns = error_ns(&mut clock, &FAST, 1004.7);
        assert!((error_ns + 3_000_000_000).abs() < 1000, "{error_ns}");
    }

    /// INT-083.
    #[test]
    fn a_week_that_becomes_known_is_taken_at_once() {
        let mut clock = SampleClock::EMPTY;
        run(&mut clock, &FAST, 1000..1003);
        let week = GpsTime::from_ns(2420 * NS_PER_WEEK);
        let epoch = gps(1002.95).plus_ns(week.ns());
        clock.epoch(epoch, FAST.local(1002.98));
        let time = clock.time(FAST.local(1002.99)).unwrap();
        assert!((time.ns() - week.ns() - gps(1002.99).ns()).abs() < 1000);
    }

    /// INT-083.
    #[test]
    fn absurd_input_gives_no_time_or_one_near_a_pulse_and_no_panic() {
        let readings = [0, 1, 1_000_000_000, u64::MAX / 2, u64::MAX - 1, u64::MAX];
        let times = [i64::MIN, -1, 0, 1, i64::MAX].map(GpsTime::from_ns);
        let mut clock = SampleClock::EMPTY;
        let mut pulses = Vec::new();
        for turn in 0..2000_usize {
            let reading = readings[turn * 7 % readings.len()].wrapping_add(turn as u64);
            match turn % 3 {
                0 => {
                    clock.pulse(reading);
                    pulses.push(reading);
                }
                1 => clock.epoch(times[turn * 5 % times.len()], reading),
                _ => {
                    if clock.time(reading).is_ok() {
                        let near = |pulse: &u64| pulse.abs_diff(reading) < 61_000_000_000;
                        assert!(pulses.iter().any(near), "{reading}");
                    }
                }
            }
            assert!(clock.rate_error_ppm().abs() < 1000.0);
        }
    }
}
