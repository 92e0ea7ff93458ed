//! Tight mode by itself; through the whole monitor: host-tests/tests/tight_mode.rs.

use super::*;
use crate::ins::{
    AttitudeStart, ClockNoise, InertialNoise, InitialSigma, MeasurementFactors, SensorRange,
};
use crate::integrity::Phase;
use std::boxed::Box;

/// INT-013.
#[test]
fn counters_tell_why_no_sample_could_be_used() {
    let zero = IntakeCounters::ZERO;
    assert_eq!(silence(None, zero), InertialStatus::NoSample);
    let used = IntakeCounters { used: 7, ..zero };
    assert_eq!(silence(None, used), InertialStatus::ImuSilent);
    type Count = fn(&mut IntakeCounters) -> &mut u32;
    let causes: [(Count, InertialStatus); 4] = [
        (|c| &mut c.saturated, InertialStatus::ImuSaturated),
        (|c| &mut c.not_finite, InertialStatus::ImuNotFinite),
        (|c| &mut c.late, InertialStatus::ImuTime),
        (|c| &mut c.bad_interval, InertialStatus::ImuTime),
    ];
    for (count, status) in causes {
        let mut now = used;
        *count(&mut now) += 1;
        assert_eq!(silence(Some(used), now), status);
        assert_eq!(silence(None, now), status);
        // What was counted before the last epoch explains nothing.
        assert_eq!(silence(Some(now), now), InertialStatus::ImuSilent);
    }
}

const UNIT: InertialConfig = InertialConfig {
    interval_ns: 10_000_000,
    c_b_s: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    lever_arm_b_m: [0.0; 3],
    noise: InertialNoise {
        arw: 1e-4,
        vrw: 1e-3,
        gyro_bias_walk: 0.0,
        accel_bias_walk: 0.0,
    },
    clock: ClockNoise {
        bias_psd: 0.1,
        drift_psd: 0.1,
        drift_decay_per_s: 0.0,
        inter_system_psd: 0.0,
    },
    measurement: MeasurementFactors::ONE,
    range: SensorRange {
        rate_radps: 10.0,
        specific_force_mps2: 100.0,
    },
    start: AttitudeStart::Course { min_speed_mps: 5.0 },
    sigma: InitialSigma {
        position_m: 1.0,
        velocity_mps: 0.1,
        attitude_ned_rad: [0.01; 3],
        gyro_bias_radps: 0.0,
        accel_bias_mps2: 0.0,
        clock_bias_m: 1.0,
        clock_drift_mps: 0.1,
    },
};

fn at(milliseconds: i64) -> GpsTime {
    GpsTime::from_week_tow_ns(2400, milliseconds * 1_000_000)
}

fn running() -> Box<TightMonitor> {
    let mut tight = Box::new(TightMonitor::EMPTY);
    tight.configure(&UNIT, &Phase::Npa.requirements()).unwrap();
    let state = InitialState {
        time: at(0),
        r_eb_e_m: [6_378_137.0, 0.0, 0.0],
        v_eb_e_mps: [0.0; 3],
        q_e_b: [1.0, 0.0, 0.0, 0.0],
        gyro_bias_radps: [0.0; 3],
        accel_bias_mps2: [0.0; 3],
        clock_bias_m: 0.0,
        clock_drift_mps: 0.0,
    };
    tight.start(&state);
    tight
}

fn feed(tight: &mut TightMonitor, from: i64, to: i64) {
    for milliseconds in (from + 10..=to).step_by(10) {
        tight.on_sample(&ImuSample {
            time: at(milliseconds),
            interval_ns: 10_000_000,
            dtheta_is_s_rad: [0.0; 3],
            dv_is_s_mps: [0.0981, 0.0, 0.0],
        });
    }
}

/// INT-013.
#[test]
fn why_tight_mode_ended_is_told_once_whatever_came_after() {
    let mut tight = running();
    feed(&mut tight, 0, 500);
    feed(&mut tight, 700, 1000);
    tight.meets(at(1000));
    tight.align(at(1000), None, &[0.1; 3]);
    assert_eq!(tight.status(), InertialStatus::Aligning);
    assert_eq!(tight.tell(), InertialStatus::ImuSilent);
    assert_eq!(tight.tell(), InertialStatus::Aligning);
    // The first cause is the cause.
    tight.lose(InertialStatus::ImuSaturated);
    tight.lose(InertialStatus::ImuSilent);
    assert_eq!(tight.tell(), InertialStatus::ImuSaturated);
}

/// INT-016.
#[test]
fn a_filter_that_contradicts_tested_satellites_three_times_is_given_up() {
    let mut tight = running();
    feed(&mut tight, 0, 1000);
    tight.meets(at(1000)).unwrap();
    let at_epoch = tight.navigator.predict(at(1000));
    let good = tight.finish(&at_epoch).unwrap();
    let mut inconsistent = good;
    inconsistent.navigation.nis = 1.01e3;
    inconsistent.navigation.nis_rows = 10;
    let mut no_number = good;
    no_number.navigation.nis = f64::NAN;
    let [near, far] = [[1.0, 1.0], [1e3, 1.0]];
    let levels_m = [5.0, 5.0];
    for (separation_m, solution) in [
        (far, &good),
        ([1.0, 1e3], &good),
        ([f64::NAN, 1.0], &good),
        (near, &inconsistent),
        (near, &no_number),
    ] {
        let mut tight = running();
        assert!(tight.compare(separation_m, levels_m, solution));
        assert!(tight.compare(separation_m, levels_m, solution));
        // One epoch in between that agrees, and the count begins anew.
        assert!(tight.compare(near, levels_m, &good));
        assert!(tight.compare(separation_m, levels_m, solution));
        assert!(tight.compare(separation_m, levels_m, solution));
        assert!(!tight.compare(separation_m, levels_m, solution));
        assert_eq!(tight.status(), InertialStatus::Unhealthy);
        assert_eq!(tight.last_attitude, None);
    }
}

#[test]
fn the_antenna_of_a_due_epoch_is_kept_until_it_is_told() {
    let mut tight = running();
    feed(&mut tight, 0, 990);
    tight.remember(at(1000));
    assert!(tight.remembered.is_none());
    feed(&mut tight, 990, 1000);
    tight.remember(at(1000));
    let then = tight.remembered.unwrap();
    feed(&mut tight, 1000, 1500);
    tight.remember(at(1000));
    assert_eq!(tight.remembered, Some(then));
    let told = tight.on_silence(at(1000), at(1500)).unwrap();
    assert_eq!(told.r_e_m, then.r_e_m);
    assert!(told.used.is_empty() && told.clock_m.iter().all(Option::is_none));
    assert_eq!(tight.navigator.time(), at(1500));
    assert!(tight.on_silence(at(1000), at(1500)).is_none());
}

#[test]
fn when_the_week_becomes_known_the_filter_goes_on() {
    let week_ns = 604_800_000_000_000;
    let mut tight = running();
    feed(&mut tight, 0, 1000);
    tight.meets(at(1000)).unwrap();
    tight.shift(1024 * week_ns);
    assert_eq!(tight.navigator.time(), at(1000).plus_ns(1024 * week_ns));
    for milliseconds in (1010..=2000).step_by(10) {
        tight.on_sample(&ImuSample {
            time: at(milliseconds).plus_ns(1024 * week_ns),
            interval_ns: 10_000_000,
            dtheta_is_s_rad: [0.0; 3],
            dv_is_s_mps: [0.0981, 0.0, 0.0],
        });
    }
    assert_eq!(tight.intake().counters().used, 200);
    assert!(tight.meets(at(2000).plus_ns(1024 * week_ns)).is_some());
    assert_eq!(tight.tell(), InertialStatus::Running);
}

#[test]
fn the_clock_of_the_antenna_is_that_of_its_time() {
    let mut tight = running();
    tight.navigator.reset_clock(1, 50.0, 1.0);
    feed(&mut tight, 0, 1500);
    // No epoch has brought the clock forward yet.
    for (milliseconds, expected_m) in [(1000, 50.0), (1500, 75.0), (1510, 75.5)] {
        let [bias_m, ..] = tight.navigator.antenna(at(milliseconds)).clock;
        assert!(
            (bias_m - expected_m).abs() < 1e-9,
            "{milliseconds}: {bias_m}"
        );
    }
    let [bias_m, ..] = tight.navigator.predict(at(1510)).clock;
    assert!((bias_m - 75.5).abs() < 1e-9, "{bias_m}");
}

#[test]
fn an_attitude_from_the_future_is_none() {
    let mut tight = running();
    feed(&mut tight, 0, 1000);
    tight.lose(InertialStatus::ImuSilent);
    let (_, when) = tight.last_attitude.unwrap();
    assert_eq!(when, at(1000));
    assert!(tight.recent_attitude(at(1000)).is_some());
    assert!(tight.recent_attitude(at(11_000)).is_some());
    assert!(tight.recent_attitude(at(11_001)).is_none());
    assert!(tight.recent_attitude(at(999)).is_none());
}

/// INT-128.
#[test]
fn int_128_the_position_now_is_the_nominal_carried_over_what_waits() {
    let (mut late, mut at_once) = (running(), running());
    late.expect(Some(at(1000)));
    for (from, to) in [(0, 500), (500, 1000), (1000, 1290)] {
        feed(&mut late, from, to);
        feed(&mut at_once, from, to);
        let expected = at_once.navigator.antenna(at(to));
        assert_eq!(late.navigation_now(), Some(expected));
        assert_eq!(at_once.navigation_now(), Some(expected));
    }
    assert_eq!(late.navigator.time(), at(990));
    assert_eq!(late.horizon().held, 30);
    // The epoch comes: the nominal goes on to it, and now stays now.
    late.meets(at(1000)).unwrap();
    assert_eq!(late.navigator.time(), at(1000));
    assert_eq!(late.navigation_now().map(|now| now.time), Some(at(1290)));
    late.lose(InertialStatus::ImuSilent);
    assert_eq!(late.navigation_now(), None);
}

/// INT-126.
#[test]
fn int_126_an_epoch_that_the_nominal_has_passed_is_counted_and_not_met() {
    let mut tight = running();
    tight.expect(Some(at(1000)));
    feed(&mut tight, 0, 1420);
    // 400 ms before the newest sample, and a sample or two for epochs between samples.
    assert_eq!(tight.navigator.time(), at(1020));
    assert!(tight.meets(at(1000)).is_some());
    assert_eq!(tight.horizon().too_late, 0);
    feed(&mut tight, 1420, 1430);
    for (count, milliseconds) in [(1, 1000), (2, 900), (3, 0)] {
        assert!(tight.meets(at(milliseconds)).is_none());
        assert_eq!(tight.status(), InertialStatus::EpochLate);
        assert_eq!(tight.horizon().too_late, count);
    }
    // The next one is in time.
    assert!(tight.meets(at(1400)).is_some());
    assert_eq!(tight.status(), InertialStatus::Running);
}

/// Late for a second and more, and more than three times: then receiver and unit are of different times.
#[test]
fn a_fast_receiver_may_be_late_for_a_second_before_the_filter_is_given_up() {
    let mut tight = running();
    feed(&mut tight, 0, 5000);
    for milliseconds in (1000..2000).step_by(100) {
        assert!(tight.meets(at(milliseconds)).is_none());
        assert_eq!(tight.status(), InertialStatus::EpochLate, "{milliseconds}");
    }
    assert!(tight.meets(at(2000)).is_none());
    assert_eq!(tight.status(), InertialStatus::ImuTime);
}

/// A state that is given is carried on by the samples after it, those that wait included.
#[test]
fn a_state_that_is_given_late_goes_on_from_its_own_time() {
    let mut tight = running();
    tight.expect(None);
    feed(&mut tight, 0, 300);
    let state = InitialState {
        time: at(100),
        r_eb_e_m: [6_378_137.0, 5.0, 0.0],
        v_eb_e_mps: [0.0; 3],
        q_e_b: [1.0, 0.0, 0.0, 0.0],
        gyro_bias_radps: [0.0; 3],
        accel_bias_mps2: [0.0; 3],
        clock_bias_m: 0.0,
        clock_drift_mps: 0.0,
    };
    tight.start(&state);
    assert_eq!(tight.navigator.time(), at(100));
    assert_eq!(tight.navigation_now().map(|now| now.time), Some(at(300)));
    tight.meets(at(200)).unwrap();
    assert_eq!(tight.navigator.time(), at(200));
}

/// A snapshot solution of a receiver at rest where [`running`] stands.
fn standing() -> SnapshotSolution {
    let r_e_m = [6_378_137.0, 0.0, 0.0];
    SnapshotSolution {
        r_e_m,
        llh: geodesy::to_llh(&r_e_m.into()).unwrap(),
        clock_m: [Some(0.0); 3],
        velocity_enu_mps: Some([0.01, -0.02, 0.03]),
        clock_drift_mps: Some(0.0),
        rate_fit: None,
        used: SatelliteSet::EMPTY,
        n_observed: 8,
        unused: [0; crate::gnss::solution::SATELLITE_REASONS],
        no_broadcast_ionosphere: false,
        steps: 1,
    }
}

/// Epochs every ten seconds over a silence of the unit from 1 s to `silent_s`; then three with samples.
fn after_a_silence(start: AttitudeStart, silent_s: i64) -> Box<TightMonitor> {
    let mut tight = running();
    let unit = InertialConfig { start, ..UNIT };
    tight.config = Some(unit);
    feed(&mut tight, 0, 1000);
    tight.lose(InertialStatus::ImuSilent);
    let solution = standing();
    let tested = TestedSolution {
        solution: &solution,
        levels_m: [5.0, 8.0],
    };
    for second in (10..=silent_s).step_by(10) {
        tight.meets(at(1000 * second));
        tight.align(at(1000 * second), Some(&tested), &[0.05; 3]);
        assert!(!tight.is_running());
    }
    for second in silent_s + 1..=silent_s + 3 {
        feed(&mut tight, 1000 * (second - 1), 1000 * second);
        if !tight.is_running() {
            tight.meets(at(1000 * second));
            tight.align(at(1000 * second), Some(&tested), &[0.05; 3]);
        }
    }
    tight
}

/// INT-101.
#[test]
fn int_101_a_unit_at_rest_comes_back_by_the_heading_that_it_was_given() {
    let given = AttitudeStart::Given {
        roll_pitch_heading_rad: [0.0; 3],
    };
    let tight = after_a_silence(given, 300);
    assert_eq!(tight.status(), InertialStatus::Running);
    assert_eq!(tight.alignment_mode(), AlignmentMode::Kept);
    let [north, east, heading] = tight.sigma_attitude_ned_rad().unwrap();
    // Levelled anew, the heading widened.
    assert!(north < 0.01 && east < 0.01 && (heading - 0.3).abs() < 1e-3);
    // Where nobody said that it is mounted on what does not turn, nobody saw whether it did.
    let course = AttitudeStart::Course { min_speed_mps: 5.0 };
    let tight = after_a_silence(course, 300);
    assert!(!tight.is_running());
    assert_eq!(tight.obstacle(), Obstacle::TooSlow);
    // It is kept for ten seconds, of which the alignment needs the last two.
    let tight = after_a_silence(course, 8);
    assert!(tight.is_running());
}

/// INT-101.
#[test]
fn int_101_a_filter_that_has_not_earned_it_keeps_no_attitude() {
    let mut tight = running();
    tight.earned = Earned::start(AlignmentMode::MagneticField, &[0.01; 3]);
    feed(&mut tight, 0, 1000);
    assert!(tight.is_running() && !tight.has_earned());
    assert_eq!(tight.tell(), InertialStatus::Aligning);
    assert!(tight.excluded().is_empty());
    tight.lose(InertialStatus::ImuSilent);
    assert_eq!(tight.last_attitude, None);
}

/// INT-101.
#[test]
fn int_101_a_long_alert_keeps_an_attitude_that_was_earned_and_no_other() {
    for mode in [AlignmentMode::MagneticField, AlignmentMode::Given] {
        let mut tight = running();
        tight.earned = Earned::start(mode, &[0.01; 3]);
        feed(&mut tight, 0, 1000);
        let is_earned = tight.has_earned();
        assert_eq!(is_earned, mode == AlignmentMode::Given);
        tight.recording.alert_ns = i64::MAX;
        tight.end_long_alert(true);
        assert_eq!(tight.status(), InertialStatus::Unhealthy);
        assert_eq!(tight.last_attitude.is_some(), is_earned);
    }
}
