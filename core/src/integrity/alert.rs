//! What the user is told, epoch after epoch: alert, exclusion and unavailability that do not flap.
//!
//! In: the verdict on each epoch by itself. Out: the same verdict, or one that is worse because of what was
//! before. Going to `alert` or `unavailable` takes no time at all: the time to alert belongs to detection and
//! transport. Coming back takes proof:
//!
//! | from | to usable when |
//! |---|---|
//! | nothing was usable yet | the first usable verdict |
//! | an epoch missed: receiver silent, deadline | the next usable verdict |
//! | unavailable: no level, or one above its limit | verdicts were usable for the time to alert, 10 s at most, without one that was not |
//! | alert, and a satellite was excluded since the last test that failed | the verdict is usable: the cause is named and gone; with a level above its limit it is `unavailable` |
//! | alert, otherwise | tests passed for [`HOLD_NS`] without one that failed; with levels above their limit it is unavailable then |
//!
//! Why: docs/decisions/011-alerts.md. `unavailable` does not end an alert, it cannot tell that the fault is gone.

use super::{Integrity, NoBound, PhaseRequirements, ProtectionLevel, Reason, Verdict};
use crate::gnss::SatelliteSet;
use crate::time::{GpsTime, NS_PER_S};

/// How long tests must pass after an alert whose cause was not named, ns. [DO-229] counts 30 independent samples
/// an hour for RAIM: two minutes apart two tests are independent, and a fault that stayed has been missed twice.
pub const HOLD_NS: i64 = 120 * NS_PER_S;
/// Longest time from one usable verdict to the next that counts, ns, as on probation: an epoch a minute.
const MAX_BREAK_NS: i64 = 60 * NS_PER_S;
/// Longest time a level must have been within its limit after it was not, ns.
const MAX_SETTLE_NS: i64 = 10 * NS_PER_S;

/// What the user has been told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum AlertState {
    /// No position has been usable yet.
    Starting = 0,
    /// Usable.
    Nominal = 1,
    /// Usable without the satellites excluded.
    Excluded = 2,
    /// The last epoch did not come, or its answer came too late; nothing speaks against the next one.
    Interrupted = 3,
    /// No level, or one above its limit, and since then not long enough within.
    Unavailable = 4,
    /// A fault that is not excluded, and since then not long enough without.
    Alert = 5,
}

/// What an epoch by itself says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum AlertEvent {
    /// Usable, with all satellites.
    Passed = 0,
    /// Usable without the satellites excluded, which were out when a test last failed.
    PassedWithout = 1,
    /// Usable without a satellite that was in when a test last failed.
    Isolated = 2,
    /// The same with a level above its limit.
    IsolatedAboveLimit = 3,
    /// A test failed, and no satellite could be named.
    Fault = 4,
    /// No test, no level, or a level above its limit.
    NoLevel = 5,
    /// No epoch, or no answer in time.
    Missed = 6,
    /// A test passed, and a level is above its limit.
    AboveLimit = 7,
}

impl AlertState {
    /// Every state, in the order of its number.
    pub const ALL: [Self; 6] = [
        Self::Starting,
        Self::Nominal,
        Self::Excluded,
        Self::Interrupted,
        Self::Unavailable,
        Self::Alert,
    ];

    /// The state after an event, where verdicts have been usable for `usable_ns` by now, and after a level above its
    /// limit must have been for `settle_ns`.
    pub const fn after(self, event: AlertEvent, usable_ns: i64, settle_ns: i64) -> Self {
        use AlertEvent::{
            AboveLimit, Fault, Isolated, IsolatedAboveLimit, Missed, NoLevel, Passed, PassedWithout,
        };
        use AlertState::{Alert, Excluded, Interrupted, Nominal, Starting, Unavailable};
        match (self, event) {
            (Starting | Nominal | Excluded | Interrupted | Unavailable | Alert, Fault) => Alert,

            (Starting | Nominal | Excluded | Interrupted, Passed) => Nominal,
            (Starting | Nominal | Excluded | Interrupted, PassedWithout | Isolated) => Excluded,
            (Starting, NoLevel | AboveLimit | IsolatedAboveLimit | Missed) => Starting,
            (Nominal | Excluded | Interrupted, NoLevel | AboveLimit | IsolatedAboveLimit) => {
                Unavailable
            }
            (Nominal | Excluded | Interrupted, Missed) => Interrupted,

            (Unavailable, Passed) if usable_ns >= settle_ns => Nominal,
            (Unavailable, PassedWithout | Isolated) if usable_ns >= settle_ns => Excluded,
            (
                Unavailable,
                Passed | PassedWithout | Isolated | AboveLimit | IsolatedAboveLimit | NoLevel
                | Missed,
            ) => Unavailable,

            (Alert, Isolated) => Excluded,
            (Alert, IsolatedAboveLimit) => Unavailable,
            (Alert, Passed) if usable_ns >= HOLD_NS => Nominal,
            (Alert, PassedWithout) if usable_ns >= HOLD_NS => Excluded,
            (Alert, AboveLimit) if usable_ns >= HOLD_NS => Unavailable,
            (Alert, Passed | PassedWithout | AboveLimit | NoLevel | Missed) => Alert,
        }
    }
}

/// The state and what it takes to leave it.
#[derive(Clone, Copy, Debug)]
pub struct Alerts {
    state: AlertState,
    settle_ns: i64,
    /// How long verdicts have been usable since what led to the state.
    usable_ns: i64,
    /// Time of the last usable verdict since then.
    last_usable: Option<GpsTime>,
    /// Satellites excluded by the last epoch.
    excluded: SatelliteSet,
    /// Satellites that were out when a test last failed.
    out_at_fault: SatelliteSet,
}

impl Alerts {
    /// Nothing has been told yet.
    pub const STARTING: Self = Self {
        state: AlertState::Starting,
        settle_ns: MAX_SETTLE_NS,
        usable_ns: 0,
        last_usable: None,
        excluded: SatelliteSet::EMPTY,
        out_at_fault: SatelliteSet::EMPTY,
    };

    /// Takes over what a phase of flight asks. What has been told stays.
    pub fn configure(&mut self, requirements: &PhaseRequirements) {
        let settle_ns = (requirements.time_to_alert_s * NS_PER_S as f64) as i64;
        self.settle_ns = settle_ns.clamp(0, MAX_SETTLE_NS);
    }

    /// What the user has been told.
    pub const fn state(&self) -> AlertState {
        self.state
    }

    /// All times so far were wrong by this much, ns.
    pub fn shift(&mut self, by_ns: i64) {
        self.last_usable = self.last_usable.map(|time| time.plus_ns(by_ns));
    }

    /// The verdict on the epoch at `now` by itself becomes the one that is told.
    pub fn step(&mut self, verdict: &mut Verdict, now: GpsTime) {
        let event = self.event(verdict);
        self.count(event, now);
        let before = self.state;
        self.state = before.after(event, self.usable_ns, self.settle_ns);
        if before == AlertState::Alert && self.state == AlertState::Unavailable {
            // What proved that the fault is gone was not within the limits.
            self.usable_ns = 0;
            self.last_usable = None;
        }
        match self.state {
            AlertState::Alert if event != AlertEvent::Fault => {
                verdict.integrity = Integrity::Alert;
                verdict.reason = Reason::AlertHeld;
                // With a fault as likely as it is now, a bound that reckons with rare ones does not hold.
                for level in [&mut verdict.hpl, &mut verdict.vpl] {
                    if let ProtectionLevel::Bound(_) = level {
                        *level = ProtectionLevel::Unavailable(NoBound::AlertHeld);
                    }
                }
            }
            AlertState::Unavailable if verdict.integrity.is_usable() => {
                verdict.integrity = Integrity::Unavailable;
                verdict.reason = Reason::Settling;
            }
            AlertState::Starting
            | AlertState::Nominal
            | AlertState::Excluded
            | AlertState::Interrupted
            | AlertState::Unavailable
            | AlertState::Alert => {}
        }
    }

    /// The answer to the last epoch, which was stepped already, is not told after all.
    pub fn miss(&mut self) {
        self.state = self
            .state
            .after(AlertEvent::Missed, self.usable_ns, self.settle_ns);
    }

    fn event(&mut self, verdict: &Verdict) -> AlertEvent {
        let is_new = |satellite| !self.out_at_fault.contains(satellite);
        let event = match (verdict.integrity, verdict.reason) {
            (Integrity::Nominal, _) => AlertEvent::Passed,
            (Integrity::Excluded, _) if verdict.excluded.iter().any(is_new) => AlertEvent::Isolated,
            (Integrity::Excluded, _) => AlertEvent::PassedWithout,
            (Integrity::Alert, _) => AlertEvent::Fault,
            (Integrity::Unavailable, Reason::ReceiverSilent | Reason::DeadlineMissed) => {
                AlertEvent::Missed
            }
            (Integrity::Unavailable, Reason::HplAboveLimit | Reason::VplAboveLimit)
                if verdict.excluded.iter().any(is_new) =>
            {
                AlertEvent::IsolatedAboveLimit
            }
            (Integrity::Unavailable, Reason::HplAboveLimit | Reason::VplAboveLimit)
                if verdict.statistic.is_some() && verdict.threshold.is_some() =>
            {
                AlertEvent::AboveLimit
            }
            (Integrity::Unavailable, _) => AlertEvent::NoLevel,
        };
        match event {
            AlertEvent::Fault => {
                // What this epoch excludes may be what made its test fail; what the one before did is not.
                self.out_at_fault = self.excluded;
                self.excluded = verdict.excluded;
            }
            AlertEvent::Missed => {
                for satellite in verdict.excluded.iter() {
                    self.excluded.insert(satellite);
                }
            }
            AlertEvent::Passed
            | AlertEvent::PassedWithout
            | AlertEvent::Isolated
            | AlertEvent::IsolatedAboveLimit
            | AlertEvent::AboveLimit
            | AlertEvent::NoLevel => self.excluded = verdict.excluded,
        }
        event
    }

    fn count(&mut self, event: AlertEvent, now: GpsTime) {
        let forgets = match (self.state, event) {
            (_, AlertEvent::Fault | AlertEvent::IsolatedAboveLimit) => true,
            // A fault is not gone because nothing can be tested, nor back.
            (AlertState::Alert, AlertEvent::NoLevel) | (_, AlertEvent::Missed) => return,
            (
                AlertState::Starting
                | AlertState::Nominal
                | AlertState::Excluded
                | AlertState::Interrupted
                | AlertState::Unavailable,
                AlertEvent::NoLevel | AlertEvent::AboveLimit,
            ) => true,
            // Its test has passed.
            (AlertState::Alert, AlertEvent::AboveLimit) => false,
            (_, AlertEvent::Passed | AlertEvent::PassedWithout | AlertEvent::Isolated) => false,
        };
        if forgets {
            self.usable_ns = 0;
            self.last_usable = None;
            return;
        }
        let elapsed_ns = self
            .last_usable
            .replace(now)
            .map_or(0, |last| now.ns().saturating_sub(last.ns()));
        if (0..=MAX_BREAK_NS).contains(&elapsed_ns) {
            self.usable_ns = self.usable_ns.saturating_add(elapsed_ns);
        } else {
            self.usable_ns = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::{Satellite, System};
    use crate::integrity::Phase;
    use std::vec::Vec;

    const LEVEL_M: f64 = 10.0;

    fn set(prns: &[u8]) -> SatelliteSet {
        let mut set = SatelliteSet::EMPTY;
        for prn in prns {
            set.insert(Satellite::new(System::Gps, *prn).unwrap());
        }
        set
    }

    /// A level above its limit ends an alert when tests have passed long enough, and settles then.
    #[test]
    fn passed_tests_count_though_a_level_is_above_its_limit() {
        let mut alerts = Alerts::STARTING;
        alerts.configure(&Phase::Lpv200.requirements());
        let at = |s: i64| GpsTime::from_week_tow_s(2400, s);
        let mut failed = fault(&[]);
        alerts.step(&mut failed, at(0));
        let mut tell = |s: i64, statistic: Option<f64>, integrity: Integrity| {
            let mut epoch = if integrity.is_usable() {
                nominal()
            } else {
                no_level()
            };
            epoch.statistic = statistic;
            epoch.threshold = Some(30.0);
            alerts.step(&mut epoch, at(s));
            (epoch.integrity, epoch.reason)
        };
        // Untested ones prove nothing.
        for s in 1..=300 {
            assert_eq!(tell(s, None, Integrity::Unavailable).0, Integrity::Alert);
        }
        for s in 301..=420 {
            assert_eq!(
                tell(s, Some(1.0), Integrity::Unavailable).0,
                Integrity::Alert,
                "{s}"
            );
        }
        let above = (Integrity::Unavailable, Reason::HplAboveLimit);
        assert_eq!(tell(421, Some(1.0), Integrity::Unavailable), above);
        let settling = (Integrity::Unavailable, Reason::Settling);
        for s in 422..428 {
            assert_eq!(tell(s, Some(1.0), Integrity::Nominal), settling, "{s}");
        }
        assert_eq!(
            tell(428, Some(1.0), Integrity::Nominal).0,
            Integrity::Nominal
        );
    }

    fn verdict(integrity: Integrity, reason: Reason, excluded: &[u8]) -> Verdict {
        let mut verdict = Verdict::unavailable(reason, 40.0, Some(35.0));
        verdict.integrity = integrity;
        verdict.excluded = set(excluded);
        if integrity.is_usable() {
            verdict.hpl = ProtectionLevel::Bound(LEVEL_M);
            verdict.vpl = ProtectionLevel::Bound(LEVEL_M);
        }
        verdict
    }

    fn nominal() -> Verdict {
        verdict(Integrity::Nominal, Reason::None, &[])
    }

    fn without(prns: &[u8]) -> Verdict {
        verdict(Integrity::Excluded, Reason::None, prns)
    }

    fn fault(prns: &[u8]) -> Verdict {
        verdict(Integrity::Alert, Reason::FaultNotIsolated, prns)
    }

    fn no_level() -> Verdict {
        verdict(Integrity::Unavailable, Reason::HplAboveLimit, &[])
    }

    fn silent() -> Verdict {
        verdict(Integrity::Unavailable, Reason::ReceiverSilent, &[])
    }

    /// A machine for a phase, and what it says.
    struct Rig {
        alerts: Alerts,
    }

    impl Rig {
        fn new(phase: Phase) -> Self {
            let mut alerts = Alerts::STARTING;
            alerts.configure(&phase.requirements());
            Self { alerts }
        }

        fn tell(&mut self, t_s: f64, raw: Verdict) -> (Integrity, Reason) {
            let told = self.told(t_s, raw);
            (told.integrity, told.reason)
        }

        fn told(&mut self, t_s: f64, mut verdict: Verdict) -> Verdict {
            let now = GpsTime::from_ns(libm::round(t_s * 1e9) as i64);
            self.alerts.step(&mut verdict, now);
            verdict
        }
    }

    const NOMINAL: (Integrity, Reason) = (Integrity::Nominal, Reason::None);
    const EXCLUDED: (Integrity, Reason) = (Integrity::Excluded, Reason::None);
    const FAULT: (Integrity, Reason) = (Integrity::Alert, Reason::FaultNotIsolated);
    const HELD: (Integrity, Reason) = (Integrity::Alert, Reason::AlertHeld);
    const SETTLING: (Integrity, Reason) = (Integrity::Unavailable, Reason::Settling);

    /// INT-060. Every pair, by properties that the table of the match does not repeat.
    #[test]
    fn no_event_makes_a_state_better_than_it_says() {
        use AlertEvent::{
            Fault, Isolated, IsolatedAboveLimit, Missed, NoLevel, Passed, PassedWithout,
        };
        let events = [
            Passed,
            PassedWithout,
            Isolated,
            IsolatedAboveLimit,
            Fault,
            NoLevel,
            Missed,
        ];
        let usable = |state| matches!(state, AlertState::Nominal | AlertState::Excluded);
        for state in AlertState::ALL {
            for event in events {
                for usable_ns in [0, HOLD_NS - 1, HOLD_NS, i64::MAX] {
                    let next = state.after(event, usable_ns, MAX_SETTLE_NS);
                    let says_usable = matches!(event, Passed | PassedWithout | Isolated);
                    assert!(!usable(next) || says_usable, "{state:?} {event:?}");
                    assert!(
                        event != Fault || next == AlertState::Alert,
                        "{state:?} {event:?}"
                    );
                    let is_named = matches!(event, Isolated | IsolatedAboveLimit);
                    if state == AlertState::Alert && !is_named && usable_ns < HOLD_NS {
                        assert_eq!(next, AlertState::Alert, "{event:?}");
                    }
                    if usable(next) {
                        let has_excluded = event != Passed;
                        assert_eq!(next == AlertState::Excluded, has_excluded);
                    }
                    assert!(next != AlertState::Starting || state == AlertState::Starting);
                    // More proof never makes a state worse.
                    let later = state.after(event, i64::MAX, MAX_SETTLE_NS);
                    assert!(!usable(next) || usable(later));
                }
            }
        }
    }

    /// INT-060.
    #[test]
    fn the_first_usable_verdict_is_told_at_once() {
        let mut rig = Rig::new(Phase::Lpv200);
        let level = (Integrity::Unavailable, Reason::HplAboveLimit);
        let silence = (Integrity::Unavailable, Reason::ReceiverSilent);
        assert_eq!(rig.tell(0.0, no_level()), level);
        assert_eq!(rig.tell(1.0, silent()), silence);
        assert_eq!(rig.tell(2.0, nominal()), NOMINAL);
    }

    /// INT-060. At every rate.
    #[test]
    fn an_alert_is_told_at_once_and_held_until_tests_have_passed_long_enough() {
        for rate_hz in [1.0, 4.0, 5.0, 10.0] {
            let mut rig = Rig::new(Phase::Npa);
            let mut t_s = 0.0;
            assert_eq!(rig.tell(t_s, nominal()), NOMINAL);
            t_s += 1.0 / rate_hz;
            assert_eq!(rig.tell(t_s, fault(&[])), FAULT);
            // It flickers once: the time begins anew.
            for _ in 0..(60.0 * rate_hz) as u32 {
                t_s += 1.0 / rate_hz;
                let told = rig.told(t_s, nominal());
                assert_eq!((told.integrity, told.reason), HELD);
                for level in [told.hpl, told.vpl] {
                    assert_eq!(level, ProtectionLevel::Unavailable(NoBound::AlertHeld));
                }
            }
            t_s += 1.0 / rate_hz;
            assert_eq!(rig.tell(t_s, fault(&[])), FAULT);
            let mut held = 0;
            loop {
                t_s += 1.0 / rate_hz;
                let told = rig.told(t_s, nominal());
                if (told.integrity, told.reason) == NOMINAL {
                    assert_eq!(told.hpl, ProtectionLevel::Bound(LEVEL_M));
                    break;
                }
                assert_eq!((told.integrity, told.reason), HELD);
                held += 1;
                assert!(held < 10_000);
            }
            // From the first epoch that passed to the one that is told.
            assert_eq!(f64::from(held) / rate_hz, HOLD_NS as f64 / 1e9);
        }
    }

    /// INT-060.
    #[test]
    fn an_alert_ends_when_its_satellite_is_excluded() {
        let mut rig = Rig::new(Phase::Npa);
        rig.tell(0.0, nominal());
        assert_eq!(rig.tell(1.0, fault(&[])), FAULT);
        assert_eq!(rig.tell(2.0, nominal()), HELD);
        assert_eq!(rig.tell(3.0, without(&[4])), EXCLUDED);
        assert_eq!(rig.tell(4.0, without(&[4])), EXCLUDED);
        // A second fault is not explained by the satellite that was out before it.
        assert_eq!(rig.tell(5.0, fault(&[4])), FAULT);
        assert_eq!(rig.tell(6.0, without(&[4])), HELD);
        assert_eq!(rig.tell(7.0, without(&[4, 7])), EXCLUDED);
        // A level above its limit is not usable, and no alert.
        rig.tell(7.1, fault(&[4, 7]));
        let mut wide = no_level();
        assert_eq!(rig.tell(7.2, wide), HELD);
        wide.excluded = set(&[4, 7, 9]);
        let above = (Integrity::Unavailable, Reason::HplAboveLimit);
        assert_eq!(rig.tell(7.3, wide), above);
        for tenth in 0..100 {
            let t_s = 8.0 + 0.1 * f64::from(tenth);
            assert_eq!(rig.tell(t_s, without(&[4, 7, 9])), SETTLING);
        }
        assert_eq!(rig.tell(18.0, without(&[4, 7, 9])), EXCLUDED);
        // Taken back: nothing is told of it.
        assert_eq!(rig.tell(19.0, nominal()), NOMINAL);
    }

    /// INT-060. One opinion may exclude a satellite at an epoch at which the other still used it.
    #[test]
    fn a_satellite_excluded_while_the_test_still_fails_ends_the_alert() {
        let mut rig = Rig::new(Phase::Npa);
        rig.tell(0.0, nominal());
        assert_eq!(rig.tell(1.0, fault(&[4])), FAULT);
        assert_eq!(rig.tell(2.0, without(&[4])), EXCLUDED);
        // Failed once more without it: it was not that one alone.
        rig.tell(10.0, fault(&[4, 7]));
        rig.tell(11.0, fault(&[4, 7]));
        assert_eq!(rig.tell(12.0, without(&[4, 7])), HELD);
        // What was excluded at an epoch whose answer came too late is known too.
        let mut late = Rig::new(Phase::Npa);
        late.tell(0.0, nominal());
        late.tell(
            1.0,
            verdict(Integrity::Unavailable, Reason::DeadlineMissed, &[4]),
        );
        late.tell(2.0, fault(&[4]));
        assert_eq!(late.tell(3.0, without(&[4])), HELD);
    }

    /// INT-060.
    #[test]
    fn an_untested_epoch_does_not_end_an_alert() {
        let mut rig = Rig::new(Phase::Npa);
        rig.tell(0.0, fault(&[]));
        for second in 1..1000 {
            let raw = if second % 2 == 0 {
                no_level()
            } else {
                silent()
            };
            let levels = [raw.hpl, raw.vpl];
            let told = rig.told(f64::from(second), raw);
            assert_eq!((told.integrity, told.reason), HELD);
            assert_eq!([told.hpl, told.vpl], levels);
        }
        assert_eq!(rig.tell(1000.0, nominal()), HELD);
    }

    /// INT-060.
    #[test]
    fn a_level_must_stay_within_its_limit_before_it_is_told() {
        for phase in Phase::ALL {
            let mut rig = Rig::new(phase);
            rig.tell(0.0, nominal());
            rig.tell(1.0, no_level());
            rig.tell(2.0, nominal());
            rig.tell(3.0, no_level());
            let told = (4..100).map(|second| rig.tell(f64::from(second), nominal()));
            let told: Vec<_> = told.collect();
            let settling = told.iter().filter(|told| **told == SETTLING).count();
            let expected = phase.requirements().time_to_alert_s.min(10.0);
            assert_eq!(settling as f64, expected, "{phase:?}");
            assert!(told[settling..].iter().all(|told| *told == NOMINAL));
        }
        // The level is told beside it.
        let mut rig = Rig::new(Phase::Npa);
        rig.tell(0.0, nominal());
        rig.tell(1.0, no_level());
        assert_eq!(
            rig.told(2.0, without(&[4])).hpl,
            ProtectionLevel::Bound(LEVEL_M)
        );
        assert_eq!(rig.tell(12.0, without(&[4])), EXCLUDED);
    }

    /// INT-060.
    #[test]
    fn an_epoch_missed_costs_that_epoch_alone() {
        let mut rig = Rig::new(Phase::Npa);
        rig.tell(0.0, nominal());
        rig.tell(1.0, silent());
        assert_eq!(rig.alerts.state(), AlertState::Interrupted);
        assert_eq!(rig.tell(2.0, nominal()), NOMINAL);
        rig.alerts.miss();
        assert_eq!(rig.alerts.state(), AlertState::Interrupted);
        assert_eq!(rig.tell(3.0, without(&[4])), EXCLUDED);
        // Nor does it end or prolong what was before.
        rig.tell(4.0, no_level());
        rig.alerts.miss();
        assert_eq!(rig.tell(5.0, nominal()), SETTLING);
        rig.tell(6.0, fault(&[]));
        rig.alerts.miss();
        assert_eq!(rig.alerts.state(), AlertState::Alert);
        assert_eq!(rig.tell(7.0, nominal()), HELD);
    }

    /// INT-061. Time that leaps, stands still or runs backwards proves nothing.
    #[test]
    fn leaps_of_time_do_not_shorten_an_alert() {
        let hold_s = HOLD_NS as f64 / 1e9;
        for leap_s in [61.0, 3600.0, 604_800.0, -1.0, -604_800.0, 0.0] {
            let mut rig = Rig::new(Phase::Npa);
            let mut t_s = 1e6;
            rig.tell(t_s, fault(&[]));
            for _ in 0..100 {
                t_s += 1.0;
                assert_eq!(rig.tell(t_s, nominal()), HELD);
            }
            t_s += leap_s;
            assert_eq!(rig.tell(t_s, nominal()), HELD, "{leap_s}");
            let already_s = if leap_s == 0.0 { 99.0 } else { 0.0 };
            let mut held_s = 0.0;
            loop {
                t_s += 1.0;
                if rig.tell(t_s, nominal()) == NOMINAL {
                    break;
                }
                held_s += 1.0;
                assert!(held_s < 1000.0);
            }
            assert_eq!(held_s + 1.0, hold_s - already_s, "{leap_s}");
        }
        // The ends of the scale do not overflow.
        let mut rig = Rig::new(Phase::Npa);
        for ns in [i64::MIN, i64::MAX, 0, i64::MAX, i64::MIN] {
            let mut verdict = nominal();
            rig.alerts.step(&mut verdict, GpsTime::from_ns(ns));
        }
        assert_eq!(rig.alerts.state(), AlertState::Nominal);
    }

    /// INT-061.
    #[test]
    fn a_week_that_becomes_known_is_no_leap() {
        let mut rig = Rig::new(Phase::Npa);
        let week_s = 604_800.0;
        rig.tell(0.0, fault(&[]));
        for second in 1..=60 {
            assert_eq!(rig.tell(f64::from(second), nominal()), HELD);
        }
        rig.alerts.shift((week_s * 1e9) as i64);
        for second in 61..=120 {
            assert_eq!(rig.tell(week_s + f64::from(second), nominal()), HELD);
        }
        assert_eq!(rig.tell(week_s + 121.0, nominal()), NOMINAL);
    }

    /// INT-061.
    #[test]
    fn an_epoch_a_minute_is_enough_and_one_in_two_is_not() {
        let mut slow = Rig::new(Phase::Npa);
        slow.tell(0.0, fault(&[]));
        assert_eq!(slow.tell(60.0, nominal()), HELD);
        assert_eq!(slow.tell(120.0, nominal()), HELD);
        assert_eq!(slow.tell(180.0, nominal()), NOMINAL);
        let mut slower = Rig::new(Phase::Npa);
        slower.tell(0.0, fault(&[]));
        for minutes in 1..100 {
            assert_eq!(slower.tell(120.0 * f64::from(minutes), nominal()), HELD);
        }
    }
}
