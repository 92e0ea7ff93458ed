//! Three inertial units: what the vote finds, what it never does, and what it gives.
//!
//! The whole campaign: `surefix campaign voting`, docs/campaigns.md. Here a seeded part of it, and what holds
//! for any samples.

use std::sync::Arc;

use proptest::prelude::*;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use surefix_core::budget::NoCounter;
use surefix_core::config::Config;
use surefix_core::ins::{
    AttitudeStart, ClockNoise, ImuSample, InertialConfig, InertialNoise, InitialSigma, MAX_UNITS,
    MeasurementFactors, SensorRange, UnitConfig, UnitSample, UnitState, UnitTolerance, Voting,
    VotingMode,
};
use surefix_core::integrity::InertialStatus;
use surefix_core::monitor::{Monitor, Ready};
use surefix_core::time::GpsTime;
use surefix_host_tests::campaign::voting::flight::{Flight, Scene};
use surefix_host_tests::campaign::voting::{GRADES, plain, watch};
use surefix_host_tests::simulate::inertial::sensors::Grade;
use surefix_host_tests::simulate::inertial::unit_faults::UnitFaultKind;

const INTERVAL_NS: u32 = 10_000_000;

/// INT-085: every kind of fault on every unit is isolated, and no other unit is; here from one onset before a
/// turn with each grade.
#[test]
fn int_085_every_kind_of_fault_isolates_its_unit_with_every_grade() {
    for (grade, onset_s) in [
        (Grade::Navigation, 170.0),
        (Grade::Tactical, 110.0),
        (Grade::Mems, 110.0),
    ] {
        let scene = Scene::of(grade).unwrap();
        let mut before = Flight::new(&scene, 11, false).unwrap();
        before.fly(onset_s, |_| false).unwrap();
        for kind in UnitFaultKind::ALL {
            for unit in 0..MAX_UNITS {
                let fault = plain(grade, kind, unit, onset_s);
                let found = watch(&before, grade, fault, 60.0, [0.0; 2]).unwrap();
                assert!(found.isolated_s.is_some(), "{found:?}");
                assert!(!found.wrong, "{found:?}");
            }
        }
    }
}

/// INT-086: healthy units are not isolated: two flights of each grade. Ten hours: the campaign.
#[test]
fn int_086_healthy_units_are_not_isolated() {
    for grade in GRADES {
        let scene: Arc<Scene> = Scene::of(grade).unwrap();
        for seed in [1, 5] {
            let mut flight = Flight::new(&scene, seed, false).unwrap();
            let end_s = scene.duration_s.into();
            let lost = flight.fly(end_s, |found| found.mode != VotingMode::Three);
            assert!(!lost.unwrap(), "{grade:?} {seed}: {:?}", flight.finding());
        }
    }
}

/// INT-087: what a navigator makes of the vote with a fault is no worse than without by more than a tenth and
/// 20 cm, coasting for a minute too, where the faulty unit alone is far off.
#[test]
fn int_087_a_navigator_on_the_vote_hardly_notices_a_fault() {
    let scene = Scene::of(Grade::Tactical).unwrap();
    let onset_s = 110.0;
    let mut before = Flight::new(&scene, 3, true).unwrap();
    before.fly(onset_s, |_| false).unwrap();
    let mut healthy = before.clone();
    healthy.coast();
    healthy.fly(onset_s + 60.0, |_| false).unwrap();
    let healthy_m = healthy.voted.worst_m;
    for kind in [UnitFaultKind::Step, UnitFaultKind::Stuck] {
        let fault = plain(Grade::Tactical, kind, 1, onset_s);
        let found = watch(&before, Grade::Tactical, fault, 60.0, healthy_m).unwrap();
        for (voted_m, healthy_m) in found.voted_m.iter().zip(healthy_m) {
            assert!(*voted_m <= 1.1 * healthy_m + 0.2, "{found:?}");
        }
    }
    let fault = plain(Grade::Tactical, UnitFaultKind::Stuck, 1, onset_s);
    let found = watch(&before, Grade::Tactical, fault, 60.0, healthy_m).unwrap();
    assert!(found.alone_m[1] > 3.0 * found.voted_m[1], "{found:?}");
}

fn config() -> UnitConfig {
    UnitConfig {
        interval_ns: INTERVAL_NS,
        c_b_s: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        lever_arm_b_m: [0.0; 3],
        noise: InertialNoise {
            arw: 3e-5,
            vrw: 5e-4,
            gyro_bias_walk: 1e-7,
            accel_bias_walk: 3e-5,
        },
        range: SensorRange {
            rate_radps: 5.0,
            specific_force_mps2: 100.0,
        },
        tolerance: UnitTolerance {
            gyro_bias_radps: 5e-6,
            accel_bias_mps2: 1e-2,
            scale: 3e-4,
            timing_s: 1e-4,
        },
    }
}

fn three() -> Box<Voting> {
    let mut voting = Box::new(Voting::EMPTY);
    voting.begin(INTERVAL_NS).unwrap();
    for unit in 0..3 {
        voting.add(unit, &config()).unwrap();
    }
    voting
}

/// A sample at rest with a little of its own, so that no axis repeats itself.
fn at_rest(random: &mut ChaCha8Rng, k: i64) -> UnitSample {
    let mut small = |scale: f64| {
        let uniform = f64::from(random.next_u32()) / f64::from(u32::MAX) - 0.5;
        uniform * scale * 3.0
    };
    UnitSample {
        sample: ImuSample {
            time: GpsTime::from_ns(k * i64::from(INTERVAL_NS)),
            interval_ns: INTERVAL_NS,
            dtheta_is_s_rad: [small(3e-6), small(3e-6), small(3e-6)],
            dv_is_s_mps: [small(5e-5), small(5e-5), small(5e-5) - 0.098],
        },
        is_valid: true,
        temperature_c: None,
    }
}

/// Runs 20 s of samples that `change` may change; gives the output and what became of the units.
fn run(
    seed: u64,
    order: [u8; 3],
    mut change: impl FnMut(u8, i64, &mut UnitSample) -> bool,
) -> (Vec<ImuSample>, [UnitState; 3], VotingMode) {
    let mut voting = three();
    let mut random = [0, 1, 2].map(|unit| {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(unit);
        random
    });
    let mut output = Vec::new();
    for k in 1..=2000 {
        let mut samples = [0, 1, 2].map(|unit| at_rest(&mut random[unit], k));
        for unit in order {
            let sample = &mut samples[usize::from(unit)];
            if change(unit, k, sample) {
                voting.take(unit.into(), sample);
                output.extend(std::iter::from_fn(|| voting.next_sample()));
            }
        }
    }
    let states = [0, 1, 2].map(|unit| voting.unit(unit).0);
    (output, states, voting.mode())
}

/// Numbers a broken unit may give.
fn absurd() -> impl Strategy<Value = f64> {
    prop_oneof![
        Just(f64::NAN),
        Just(f64::INFINITY),
        Just(f64::NEG_INFINITY),
        Just(f64::MAX),
        -1e6..1e6_f64,
        -0.04..0.04_f64,
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// INT-088: whatever one unit gives from some time on, nothing of it reaches the output.
    #[test]
    fn int_088_absurd_samples_of_one_unit_never_reach_the_output(
        faulty in 0..3_u8,
        axis in 0..6_usize,
        from in 300..1500_i64,
        values in proptest::collection::vec(absurd(), 1..20),
    ) {
        let (output, states, _) = run(7, [0, 1, 2], |unit, k, sample| {
            if unit == faulty && k >= from {
                let value = values[k as usize % values.len()];
                let s = &mut sample.sample;
                if axis < 3 {
                    s.dtheta_is_s_rad[axis] = value;
                } else {
                    s.dv_is_s_mps[axis - 3] = value;
                }
            }
            true
        });
        for sample in &output {
            for (value, rest) in sample
                .dtheta_is_s_rad
                .iter()
                .chain(&sample.dv_is_s_mps)
                .zip([0.0, 0.0, 0.0, 0.0, 0.0, -0.098])
            {
                prop_assert!((value - rest).abs() < 1e-3, "{sample:?} {states:?}");
            }
        }
        prop_assert!(output.len() >= 1_990, "{}", output.len());
        for unit in (0..3).filter(|unit| *unit != usize::from(faulty)) {
            prop_assert_eq!(states[unit], UnitState::Used);
        }
    }

    /// INT-089: the order in which units' samples of the same time arrive changes not a bit.
    #[test]
    fn int_089_any_order_of_arrival_gives_the_same_bits(
        seed in any::<u64>(),
        step in prop_oneof![Just(0.0), 1e-6..1e-4_f64],
    ) {
        let of = |order| run(seed, order, |unit, k, sample| {
            if unit == 1 && k > 700 {
                sample.sample.dtheta_is_s_rad[2] += step;
            }
            true
        });
        let first = of([0, 1, 2]);
        for order in [[2, 1, 0], [1, 0, 2], [1, 2, 0]] {
            prop_assert_eq!(&of(order), &first);
        }
    }

    /// INT-089: units that exchange their places exchange their states, and the output stays.
    #[test]
    fn int_089_exchanged_units_exchange_their_states(seed in any::<u64>(), step in 1e-6..1e-4_f64) {
        let of = |places: [usize; 3]| {
            let mut voting = three();
            let mut output = Vec::new();
            let mut random = [0, 1, 2].map(|unit| {
                let mut random = ChaCha8Rng::seed_from_u64(seed);
                random.set_stream(unit);
                random
            });
            for k in 1..=1500 {
                for unit in 0..3 {
                    let mut sample = at_rest(&mut random[unit], k);
                    if unit == 0 && k > 700 {
                        sample.sample.dv_is_s_mps[0] += step;
                    }
                    voting.take(places[unit], &sample);
                    output.extend(std::iter::from_fn(|| voting.next_sample()));
                }
            }
            (output, places.map(|place| voting.unit(place)))
        };
        let (output, states) = of([0, 1, 2]);
        for places in [[1, 2, 0], [2, 1, 0], [0, 2, 1]] {
            let (other, other_states) = of(places);
            prop_assert_eq!(other_states, states);
            prop_assert_eq!(other.len(), output.len());
            for (a, b) in output.iter().zip(&other) {
                for axis in 0..3 {
                    prop_assert!((a.dtheta_is_s_rad[axis] - b.dtheta_is_s_rad[axis]).abs() < 1e-12);
                    prop_assert!((a.dv_is_s_mps[axis] - b.dv_is_s_mps[axis]).abs() < 1e-12);
                }
            }
        }
    }

    /// INT-090: times of any kind of one unit stop neither the others nor the output.
    #[test]
    fn int_090_any_times_of_one_unit_do_not_hold_up_the_others(
        faulty in 0..3_u8,
        from in 300..1500_i64,
        shifts in proptest::collection::vec(-2_000_000_000_000..2_000_000_000_000_i64, 1..10),
    ) {
        let (output, _, mode) = run(9, [0, 1, 2], |unit, k, sample| {
            if unit == faulty && k >= from {
                let shift_ns = shifts[k as usize % shifts.len()];
                sample.sample.time = sample.sample.time.plus_ns(shift_ns);
            }
            true
        });
        prop_assert!(output.len() >= 1_980, "{} {mode:?}", output.len());
        let last = output.last().unwrap().time.ns();
        prop_assert!(last >= 19_900_000_000, "{last}");
    }
}

fn voted() -> InertialConfig {
    InertialConfig {
        interval_ns: INTERVAL_NS,
        c_b_s: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        lever_arm_b_m: [0.0; 3],
        noise: config().noise,
        clock: ClockNoise {
            bias_psd: 0.009,
            drift_psd: 0.0355,
            drift_decay_per_s: 0.0,
            inter_system_psd: 2.5e-5,
        },
        measurement: MeasurementFactors::ONE,
        range: config().range,
        start: AttitudeStart::Course { min_speed_mps: 2.0 },
        sigma: InitialSigma {
            position_m: 10.0,
            velocity_mps: 0.5,
            attitude_ned_rad: [0.01, 0.01, 0.05],
            gyro_bias_radps: 5e-6,
            accel_bias_mps2: 1e-2,
            clock_bias_m: 30.0,
            clock_drift_mps: 1.0,
        },
    }
}

/// INT-091: two units that disagree end tight mode, and the report says why; an agreement of a minute ends that.
#[test]
fn int_091_two_units_that_disagree_are_in_the_report() {
    let mut monitor = Box::new(Monitor::EMPTY);
    monitor.configure(&Config::PRESET).unwrap();
    assert!(monitor.configure_unit(0, &config()).is_err());
    monitor.configure_inertial(&voted()).unwrap();
    for unit in [0, 2] {
        monitor.configure_unit(unit, &config()).unwrap();
    }
    let mut random = [1, 2].map(ChaCha8Rng::seed_from_u64);
    for k in 1..=2000 {
        for (place, unit) in [(0, 0), (1, 2)] {
            let mut sample = at_rest(&mut random[place], k);
            if unit == 2 && k > 1000 {
                sample.sample.dtheta_is_s_rad[1] += 1e-4;
            }
            let ready = monitor.on_unit_sample(unit, &sample);
            assert_eq!(ready, None);
        }
    }
    assert_eq!(monitor.voting().mode(), VotingMode::Disagree);
    assert_eq!(monitor.tight().status(), InertialStatus::ImuDisagree);
    let now = GpsTime::from_ns(2000 * i64::from(INTERVAL_NS));
    // Nothing was due: there is no epoch yet. The report of the next says it.
    assert_eq!(monitor.tick(now), None::<Ready>);
    let report = monitor.process(&mut NoCounter);
    assert_eq!(report.inertial, InertialStatus::ImuDisagree);
    let inertial = monitor.inertial_report(&report).unwrap();
    assert_eq!(inertial.voting, VotingMode::Disagree);
    for k in 2001..=9000 {
        for (place, unit) in [(0, 0), (1, 2)] {
            let sample = at_rest(&mut random[place], k);
            let _ = monitor.on_unit_sample(unit, &sample);
        }
    }
    assert_eq!(monitor.voting().mode(), VotingMode::Two);
}

/// INT-092: a single unit, and the samples of one that does not vote, are what they were without a vote.
#[test]
fn int_092_without_a_vote_samples_pass_as_they_are() {
    let mut with_number = Box::new(Monitor::EMPTY);
    with_number.configure(&Config::PRESET).unwrap();
    with_number.configure_inertial(&voted()).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(4);
    for k in 1..=500 {
        let sample = at_rest(&mut random, k);
        let _ = with_number.on_unit_sample(0, &sample);
        let _ = with_number.on_unit_sample(1, &sample);
    }
    assert_eq!(with_number.counters().imu_used, 500);
    assert_eq!(with_number.voting().mode(), VotingMode::Off);
}
