//! Samples in any order and of any content become increments without gap or overlap, or a fault that
//! says why not; every sample is accounted for.

use proptest::prelude::*;
use surefix_core::ins::intake::MAX_BRIDGE_NS;
use surefix_core::ins::{
    AttitudeStart, ClockNoise, ImuSample, InertialConfig, InertialNoise, InitialSigma, Intake,
    IntakeFault, MeasurementFactors, SensorRange, Taken,
};
use surefix_core::time::GpsTime;

const T: i64 = 10_000_000;

const CONFIG: InertialConfig = InertialConfig {
    interval_ns: T as u32,
    // The unit's x axis points to the right, its y axis back.
    c_b_s: [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
    lever_arm_b_m: [0.0; 3],
    noise: InertialNoise {
        arw: 1e-5,
        vrw: 1e-4,
        gyro_bias_walk: 0.0,
        accel_bias_walk: 0.0,
    },
    clock: ClockNoise {
        bias_psd: 0.0,
        drift_psd: 0.0,
        drift_decay_per_s: 0.0,
        inter_system_psd: 0.0,
    },
    measurement: MeasurementFactors::ONE,
    range: SensorRange {
        rate_radps: 10.0,
        specific_force_mps2: 100.0,
    },
    start: AttitudeStart::Course { min_speed_mps: 3.0 },
    sigma: InitialSigma {
        position_m: 1.0,
        velocity_mps: 1.0,
        attitude_ned_rad: [0.1; 3],
        gyro_bias_radps: 0.0,
        accel_bias_mps2: 0.0,
        clock_bias_m: 1.0,
        clock_drift_mps: 1.0,
    },
};

fn intake() -> Intake {
    assert_eq!(CONFIG.check(), Ok(()));
    let mut intake = Intake::EMPTY;
    intake.configure(&CONFIG);
    intake
}

/// A sample of constant rates over its interval; `x` tells one content from another.
fn at(time_ns: i64, x: f64) -> ImuSample {
    sample(time_ns, T as u32, x)
}

fn sample(time_ns: i64, interval_ns: u32, x: f64) -> ImuSample {
    let dt_s = f64::from(interval_ns) * 1e-9;
    ImuSample {
        time: GpsTime::from_ns(time_ns),
        interval_ns,
        dtheta_is_s_rad: [x * dt_s, 0.0, 0.0],
        dv_is_s_mps: [0.0, 0.0, -9.8 * dt_s],
    }
}

fn taken(intake: &mut Intake, sample: &ImuSample) -> Taken {
    intake.take(sample).unwrap().unwrap()
}

#[test]
fn samples_on_time_pass_unchanged_in_body_axes() {
    let mut intake = intake();
    for k in 1..=10 {
        // A unit at rest without noise repeats its content at full intervals.
        let one = taken(&mut intake, &at(k * T, 0.5));
        assert_eq!((one.bridge, one.interval_ns), (None, T));
        assert_eq!(one.increment.dt_s, 0.01);
        let dtheta: [f64; 3] = one.increment.dtheta_b.into();
        assert_eq!(dtheta, [0.0, 0.5 * 0.01, 0.0]);
        let dv: [f64; 3] = one.increment.dv_b.into();
        assert_eq!(dv, [0.0, 0.0, -9.8 * 0.01]);
    }
    let counters = intake.counters();
    assert_eq!(
        (counters.used, counters.stretched, counters.missing),
        (10, 0, 0)
    );
}

/// INT-027.
#[test]
fn the_same_sample_read_twice_is_used_once() {
    let mut intake = intake();
    taken(&mut intake, &at(T, 0.5));
    assert_eq!(intake.take(&at(T, 0.5)), Ok(None));
    assert_eq!(intake.take(&at(T, 0.7)), Ok(None));
    assert_eq!(intake.take(&at(T + T / 2, 0.5)), Ok(None));
    assert_eq!(intake.take(&at(T + T * 79 / 100, 0.5)), Ok(None));
    assert_eq!(intake.counters().repeated, 4);
    // At eight tenths, or with another content, it is another sample.
    assert_eq!(
        taken(&mut intake, &at(T + T * 8 / 10, 0.5)).interval_ns,
        T * 8 / 10
    );
    assert_eq!(taken(&mut intake, &at(T * 2, 0.6)).interval_ns, T / 5);
    assert_eq!(intake.counters().stretched, 2);
}

#[test]
fn jitter_of_the_time_stamps_stretches_the_increments() {
    let mut intake = intake();
    taken(&mut intake, &at(T, 0.5));
    let one = taken(&mut intake, &at(T * 5 / 2, 0.6));
    assert_eq!((one.bridge, one.interval_ns), (None, T * 3 / 2));
    assert!((one.increment.dtheta_b.y - 0.6 * 0.015).abs() < 1e-15);
    assert!((one.increment.dv_b.z + 9.8 * 0.015).abs() < 1e-15);
    // Half a per cent is not worth counting, but the length is that of the clock.
    let two = taken(&mut intake, &at(T * 5 / 2 + T + T / 200, 0.6));
    assert_eq!(two.interval_ns, T + T / 200);
    assert_eq!(intake.counters().stretched, 1);
}

/// INT-027.
#[test]
fn missing_samples_are_bridged_by_the_mean_of_both_sides() {
    for missing in 1..=5 {
        let mut intake = intake();
        taken(&mut intake, &at(T, 0.4));
        let one = taken(&mut intake, &at(T * (2 + missing), 0.8));
        let bridge = one.bridge.unwrap();
        assert_eq!(
            (bridge.interval_ns, i64::from(bridge.samples)),
            (missing * T, missing)
        );
        assert_eq!(one.interval_ns, T);
        let expected = 0.6 * 0.01 * missing as f64;
        assert!((bridge.increment.dtheta_b.y - expected).abs() < 1e-15);
        assert!((one.increment.dtheta_b.y - 0.008).abs() < 1e-15);
        assert_eq!(i64::from(intake.counters().missing), missing);
        assert_eq!(
            intake.last_time(),
            Some(GpsTime::from_ns(T * (2 + missing)))
        );
    }
}

/// INT-027.
#[test]
fn longer_silence_is_a_fault_and_a_new_beginning() {
    let mut intake = intake();
    taken(&mut intake, &at(T, 0.4));
    let fault = intake.take(&at(T * 8, 0.4));
    assert_eq!(fault, Err(IntakeFault::Silent { missing_ns: 6 * T }));
    assert_eq!(taken(&mut intake, &at(T * 9, 0.4)).interval_ns, T);
    // A minute is silence, more is another time.
    let fault = intake.take(&at(T * 6009, 0.4));
    assert_eq!(
        fault,
        Err(IntakeFault::Silent {
            missing_ns: 5999 * T
        })
    );
    let fault = intake.take(&at(T * 12_010, 0.4));
    assert_eq!(fault, Err(IntakeFault::Time { step_ns: 6001 * T }));
    assert_eq!(taken(&mut intake, &at(T * 12_011, 0.4)).interval_ns, T);
}

/// INT-027.
#[test]
fn few_unusable_samples_are_bridged_and_many_are_a_fault_at_once() {
    let nan = |k: i64| ImuSample {
        dv_is_s_mps: [0.0, f64::NAN, 0.0],
        ..at(k * T, 0.4)
    };
    let full = |k: i64| at(k * T, 10.0);
    type Unusable<'a> = (&'a dyn Fn(i64) -> ImuSample, IntakeFault);
    let cases: [Unusable; 3] = [
        (&nan, IntakeFault::NotFinite { missing_ns: 6 * T }),
        (&full, IntakeFault::Saturated { missing_ns: 6 * T }),
        (
            &|k| sample(k * T, 0, 0.0),
            IntakeFault::Time { step_ns: 6 * T },
        ),
    ];
    for (bad, fault) in cases {
        let mut intake = intake();
        taken(&mut intake, &at(T, 0.4));
        for k in 2..=6 {
            assert_eq!(intake.take(&bad(k)), Ok(None));
        }
        let one = taken(&mut intake, &at(7 * T, 0.4));
        assert_eq!(one.bridge.unwrap().interval_ns, 5 * T);
        for k in 8..=12 {
            assert_eq!(intake.take(&bad(k)), Ok(None));
        }
        assert_eq!(intake.take(&bad(13)), Err(fault));
        // Once is enough; the next sample of use begins, with its own interval.
        for k in 14..=30 {
            assert_eq!(intake.take(&bad(k)), Ok(None));
        }
        let one = taken(&mut intake, &at(31 * T, 0.4));
        assert_eq!((one.bridge, one.interval_ns), (None, T));
        let counters = intake.counters();
        assert_eq!(
            counters.not_finite + counters.saturated + counters.bad_interval,
            28
        );
    }
}

/// INT-027.
#[test]
fn a_fault_names_what_made_the_most_of_the_gap() {
    let nan = |k: i64| ImuSample {
        dtheta_is_s_rad: [f64::INFINITY; 3],
        ..at(k * T, 0.4)
    };
    let mut intake = intake();
    taken(&mut intake, &at(T, 0.4));
    assert_eq!(intake.take(&nan(2)), Ok(None));
    assert!(matches!(
        intake.take(&at(20 * T, 0.4)),
        Err(IntakeFault::Silent { .. })
    ));
    for k in [21, 22, 23, 24] {
        assert_eq!(intake.take(&nan(k)), Ok(None));
    }
    assert!(matches!(
        intake.take(&at(28 * T, 0.4)),
        Err(IntakeFault::NotFinite { .. })
    ));
}

/// INT-027.
#[test]
fn late_samples_are_dropped_until_time_itself_went_back() {
    let mut intake = intake();
    taken(&mut intake, &at(100 * T, 0.4));
    // Out of order by one: never a fault.
    for _ in 0..100 {
        assert_eq!(intake.take(&at(99 * T, 0.7)), Ok(None));
    }
    for k in 1..=5 {
        assert_eq!(intake.take(&at(k * T, 0.7)), Ok(None));
    }
    // The old time goes on: those five were stragglers.
    taken(&mut intake, &at(101 * T, 0.4));
    for k in 1..=5 {
        assert_eq!(intake.take(&at(k * T, 0.7)), Ok(None));
    }
    let fault = intake.take(&at(6 * T, 0.7));
    assert_eq!(fault, Err(IntakeFault::Time { step_ns: -95 * T }));
    // The new time is begun by the sample that showed it: what follows joins on to it.
    let one = taken(&mut intake, &at(8 * T, 0.7));
    assert_eq!(one.bridge.map(|bridge| bridge.interval_ns), Some(T));
    assert_eq!(intake.counters().late, 111);
}

#[test]
fn unconfigured_intake_uses_nothing() {
    let mut intake = Intake::EMPTY;
    assert_eq!(intake.take(&at(T, 0.4)), Ok(None));
    assert_eq!(intake.counters().bad_interval, 1);
    assert_eq!(intake.last_time(), None);
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        12 => -0.02..0.02_f64,
        1 => Just(0.0),
        1 => Just(f64::NAN),
        1 => Just(f64::INFINITY),
        1 => Just(f64::MAX),
        1 => Just(-5e-324),
        1 => any::<f64>(),
    ]
}

/// Time against that of the sample before.
fn step() -> impl Strategy<Value = i64> {
    prop_oneof![
        12 => Just(T),
        1 => Just(0),
        4 => 0..2 * T,
        3 => 0..12 * T,
        3 => -8 * T..0,
        1 => -100 * T..100_000 * T,
        1 => any::<i64>(),
    ]
}

fn interval() -> impl Strategy<Value = u32> {
    prop_oneof![12 => Just(T as u32), 2 => 0..(3 * T as u32), 1 => any::<u32>()]
}

fn samples() -> impl Strategy<Value = Vec<ImuSample>> {
    let one = (
        step(),
        interval(),
        [number(), number(), number()],
        [number(), number(), number()],
    );
    prop::collection::vec(one, 1..200).prop_map(|parts| {
        let mut time_ns = 0_i64;
        parts
            .into_iter()
            .map(|(step_ns, interval_ns, dtheta_is_s_rad, dv_is_s_mps)| {
                time_ns = time_ns.wrapping_add(step_ns);
                ImuSample {
                    time: GpsTime::from_ns(time_ns),
                    interval_ns,
                    dtheta_is_s_rad,
                    dv_is_s_mps,
                }
            })
            .collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    /// INT-027.
    #[test]
    fn lengths_add_up_to_what_elapsed_whatever_comes(samples in samples()) {
        let mut intake = intake();
        // Where the increments so far reach to; none before the first and after a fault that no
        // usable sample showed.
        let mut reach: Option<i64> = None;
        let mut given = 0_u32;
        for sample in &samples {
            let before = intake.last_time();
            match intake.take(sample) {
                Ok(Some(taken)) => {
                    given += 1;
                    prop_assert_eq!(taken.time, sample.time);
                    prop_assert_eq!(intake.last_time(), Some(sample.time));
                    prop_assert!(before.is_none_or(|before| sample.time > before));
                    let bridged_ns = taken.bridge.map_or(0, |bridge| bridge.interval_ns);
                    prop_assert!((0..=MAX_BRIDGE_NS).contains(&bridged_ns));
                    let length_ns = bridged_ns + taken.interval_ns;
                    if let Some(reach) = reach {
                        prop_assert_eq!(sample.time.ns() - reach, length_ns);
                    } else {
                        prop_assert_eq!(length_ns, i64::from(sample.interval_ns));
                    }
                    reach = Some(sample.time.ns());
                    let bridge = taken.bridge.map(|bridge| (bridge.increment, bridge.interval_ns));
                    let own = Some((taken.increment, taken.interval_ns));
                    for (increment, length_ns) in bridge.into_iter().chain(own) {
                        prop_assert!(length_ns > 0);
                        prop_assert_eq!(increment.dt_s, length_ns as f64 / 1e9);
                        // Within the range of the sensors, turned by the mounting.
                        let bound = increment.dt_s * (1.0 + 1e-12);
                        prop_assert!(increment.dtheta_b.iter().all(|x| x.abs() <= 10.0 * bound));
                        prop_assert!(increment.dv_b.iter().all(|x| x.abs() <= 100.0 * bound));
                    }
                }
                Ok(None) => prop_assert_eq!(intake.last_time(), before),
                Err(_) => {
                    prop_assert_eq!(intake.last_time(), Some(sample.time));
                    let finite = sample
                        .dtheta_is_s_rad
                        .iter()
                        .chain(&sample.dv_is_s_mps)
                        .all(|x| x.is_finite());
                    // A beginning is usable: what follows it shows whether the intake thinks so too.
                    let mut probe = intake;
                    let next = probe.take(&at(sample.time.ns().wrapping_add(3 * T), 0.123));
                    let continues = matches!(next, Ok(Some(Taken { bridge: Some(_), .. })));
                    prop_assert!(finite || !continues);
                    reach = continues.then_some(sample.time.ns());
                }
            }
        }
        let counters = intake.counters();
        prop_assert_eq!(counters.used, given);
        // Every sample is counted once.
        let accounted = counters.used
            + counters.repeated
            + counters.late
            + counters.not_finite
            + counters.saturated
            + counters.bad_interval
            + counters.begun;
        prop_assert_eq!(accounted, u32::try_from(samples.len()).unwrap());
    }
}
