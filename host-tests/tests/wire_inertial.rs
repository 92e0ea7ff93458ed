//! What a filter takes comes back from its native frames as it was, bit for bit, is refused when it
//! is nonsense, and leaves the receiver's epochs alone.

use proptest::prelude::*;
use surefix_core::consts::MAX_SATELLITES;
use surefix_core::gnss::{
    CorrectedEpoch, CorrectedMeasurement, ObservationEpoch, Satellite, Signal, SignalObservation,
};
use surefix_core::ingest::{
    self, CorrectedGroup, Event, IMU_FRAME_LENGTH, Ingest, MAX_CORRECTED_EPOCH_BYTES,
    MAX_EPOCH_BYTES, PayloadError,
};
use surefix_core::ins::{
    AttitudeStart, ClockNoise, ImuSample, InertialConfig, InertialNoise, InitialSigma,
    InitialState, MagneticSample, MeasurementFactors, PressureSample, ReferenceModel, SensorRange,
    UnitSample,
};
use surefix_core::time::{GpsTime, NS_PER_S, NS_PER_WEEK};
use surefix_core::wire::Counters;
use surefix_core::wire::native::{Frame, Full, Kind, MAX_FRAME};

fn time() -> impl Strategy<Value = GpsTime> {
    (0..NS_PER_WEEK * 8192).prop_map(GpsTime::from_ns)
}

fn three(limit: f64) -> impl Strategy<Value = [f64; 3]> {
    proptest::array::uniform3(-limit..limit)
}

fn sample() -> impl Strategy<Value = ImuSample> {
    let number = prop_oneof![
        -1.0..1.0,
        Just(-0.0),
        Just(f64::MAX),
        Just(f64::NEG_INFINITY)
    ];
    let numbers = proptest::array::uniform6(number);
    (time(), 1_u32..=1_000_000_000, numbers).prop_map(|(time, interval_ns, n)| ImuSample {
        time,
        interval_ns,
        dtheta_is_s_rad: [n[0], n[1], n[2]],
        dv_is_s_mps: [n[3], n[4], n[5]],
    })
}

fn config() -> impl Strategy<Value = InertialConfig> {
    let start = prop_oneof![
        (0.0..50.0).prop_map(|min_speed_mps| AttitudeStart::Course { min_speed_mps }),
        three(6.0).prop_map(|roll_pitch_heading_rad| AttitudeStart::Given {
            roll_pitch_heading_rad
        }),
        (1e-3..0.5).prop_map(|max_heading_sigma_rad| AttitudeStart::Gyrocompass {
            max_heading_sigma_rad
        }),
        Just(AttitudeStart::MagneticField),
        (0.0..50.0, 1e-3..0.5).prop_map(|(min_speed_mps, max_heading_sigma_rad)| {
            AttitudeStart::Automatic {
                min_speed_mps,
                max_heading_sigma_rad,
            }
        }),
    ];
    let positive = proptest::array::uniform9(1e-9..1e3);
    let not_negative = proptest::array::uniform10(prop_oneof![Just(0.0), 1e-12..1.0]);
    let angle = -3.0..3.0_f64;
    (
        2_500_000_u32..=20_000_000,
        angle,
        three(50.0),
        start,
        positive,
        not_negative,
    )
        .prop_map(|(interval_ns, angle, lever_arm_b_m, start, p, n)| {
            let (sin, cos) = angle.sin_cos();
            InertialConfig {
                interval_ns,
                c_b_s: [[cos, -sin, 0.0], [0.0, 0.0, -1.0], [sin, cos, 0.0]],
                lever_arm_b_m,
                noise: InertialNoise {
                    arw: n[0],
                    vrw: n[1],
                    gyro_bias_walk: n[2],
                    accel_bias_walk: n[3],
                },
                clock: ClockNoise {
                    bias_psd: n[4],
                    drift_psd: n[5],
                    drift_decay_per_s: n[6],
                    inter_system_psd: n[7],
                },
                measurement: MeasurementFactors {
                    pseudorange: p[7],
                    range_rate: p[8],
                },
                range: SensorRange {
                    rate_radps: p[0],
                    specific_force_mps2: p[1],
                },
                start,
                sigma: InitialSigma {
                    position_m: p[2],
                    velocity_mps: p[3],
                    attitude_ned_rad: [p[4], p[5], p[6]],
                    gyro_bias_radps: n[8],
                    accel_bias_mps2: n[9],
                    clock_bias_m: p[7],
                    clock_drift_mps: p[8],
                },
            }
        })
}

fn initial_state() -> impl Strategy<Value = InitialState> {
    let quaternion = proptest::array::uniform4(-1.0..1.0_f64)
        .prop_map(|q| {
            let norm = q.iter().map(|part| part * part).sum::<f64>().sqrt();
            q.map(|part| part / norm)
        })
        .prop_filter("has a direction", |q| q[0].is_finite());
    let biases = (three(10.0), three(10.0));
    let clock = (-1e9..1e9, -1e5..1e5);
    (time(), three(7e6), three(1e4), quaternion, biases, clock).prop_map(
        |(time, r_eb_e_m, v_eb_e_mps, q_e_b, biases, clock)| InitialState {
            time,
            r_eb_e_m,
            v_eb_e_mps,
            q_e_b,
            gyro_bias_radps: biases.0,
            accel_bias_mps2: biases.1,
            clock_bias_m: clock.0,
            clock_drift_mps: clock.1,
        },
    )
}

fn unit_sample() -> impl Strategy<Value = (u8, UnitSample)> {
    let temperature = proptest::option::of(-200.0..200.0_f32);
    (0..3_u8, sample(), any::<bool>(), temperature).prop_map(
        |(unit, sample, is_valid, temperature_c)| {
            let sample = UnitSample {
                sample,
                is_valid,
                temperature_c,
            };
            (unit, sample)
        },
    )
}

fn pressure() -> impl Strategy<Value = PressureSample> {
    (time(), 50.0..150_000.0, -200.0..200.0).prop_map(|(time, pressure_pa, temperature_c)| {
        PressureSample {
            time,
            pressure_pa,
            temperature_c,
        }
    })
}

fn magnetic_field() -> impl Strategy<Value = MagneticSample> {
    (time(), three(6e3)).prop_map(|(time, field_s_ut)| MagneticSample { time, field_s_ut })
}

fn reference_model() -> impl Strategy<Value = ReferenceModel> {
    (
        proptest::array::uniform3(1e-12..0.999),
        (0.1..1e5, 0.1..1e5),
        any::<[bool; 2]>(),
        0..NS_PER_WEEK,
    )
        .prop_map(|(p, limits, choices, hold_ns)| ReferenceModel {
            p_fa: p[0],
            p_md: p[1],
            p_h0: p[2],
            hal_m: limits.0,
            val_m: limits.1,
            detect_vertical: choices[0],
            exclude: choices[1],
            hold_ns,
        })
}

fn row() -> impl Strategy<Value = CorrectedMeasurement> {
    (
        0..Satellite::COUNT,
        three(5e7),
        three(1e4),
        (-1e9..1e9, 1e-6..1e5),
        proptest::option::of((-1e5..1e5, 1e-6..1e5)),
    )
        .prop_map(
            |(satellite, r_es_e_m, v_es_e_mps, range, rate)| CorrectedMeasurement {
                satellite: Satellite::from_index(satellite).unwrap(),
                r_es_e_m,
                v_es_e_mps,
                pseudorange_m: range.0,
                sigma_pseudorange_m: range.1,
                range_rate_mps: rate,
            },
        )
}

fn corrected_epoch() -> impl Strategy<Value = CorrectedEpoch> {
    (time(), proptest::collection::vec(row(), 0..=MAX_SATELLITES)).prop_map(|(time, rows)| {
        let mut epoch = CorrectedEpoch::EMPTY;
        epoch.time = time;
        for row in rows {
            if epoch
                .rows
                .iter()
                .all(|known| known.satellite != row.satellite)
            {
                epoch.rows.push(row).unwrap();
            }
        }
        epoch
    })
}

fn frame_of(encode: impl Fn(&mut [u8]) -> Result<usize, Full>) -> Vec<u8> {
    let mut out = vec![0; MAX_CORRECTED_EPOCH_BYTES];
    let len = encode(&mut out).unwrap();
    assert_eq!(encode(&mut vec![0; len - 1]), Err(Full), "{len} bytes do");
    out.truncate(len);
    out
}

/// Checks that every payload of one frame comes back, that no shorter or longer one is taken, and
/// that one with a wrong byte is refused or means just what it says.
fn check<T: PartialEq + std::fmt::Debug>(
    value: &T,
    kind: Kind,
    encode: impl Fn(&T, &mut [u8]) -> Result<usize, Full>,
    decode: impl Fn(&[u8]) -> Result<T, PayloadError>,
    (place, byte): (usize, u8),
) -> Result<(), TestCaseError> {
    let bytes = frame_of(|out| encode(value, out));
    let (frame, used) = Frame::parse(&bytes).unwrap();
    prop_assert_eq!((used, frame.kind()), (bytes.len(), Some(kind)));
    let decoded = decode(frame.payload());
    prop_assert_eq!(decoded.as_ref(), Ok(value));
    for cut in 0..frame.payload().len() {
        prop_assert!(decode(&frame.payload()[..cut]).is_err(), "cut to {cut}");
    }
    let mut payload = frame.payload().to_vec();
    payload.push(0);
    prop_assert_eq!(
        decode(&payload),
        Err(PayloadError::TrailingBytes { left: 1 })
    );
    payload.pop();
    let place = place % payload.len();
    payload[place] = byte;
    if let Ok(changed) = decode(&payload) {
        let again = frame_of(|out| encode(&changed, out));
        prop_assert_eq!(Frame::parse(&again).unwrap().0.payload(), &payload[..]);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn single_frames_come_back(
        sample in sample(),
        config in config(),
        state in initial_state(),
        model in reference_model(),
        unit in unit_sample(),
        pressure in pressure(),
        field in magnetic_field(),
        change in any::<(usize, u8)>(),
    ) {
        check(&sample, Kind::Imu, ingest::encode_imu, ingest::decode_imu, change)?;
        check(&config, Kind::Inertial, ingest::encode_inertial, ingest::decode_inertial, change)?;
        check(&state, Kind::InitialState, ingest::encode_initial_state, ingest::decode_initial_state, change)?;
        check(&unit, Kind::UnitSample, |of, out| ingest::encode_unit_sample(of.0, &of.1, out), ingest::decode_unit_sample, change)?;
        check(&pressure, Kind::Pressure, ingest::encode_pressure, ingest::decode_pressure, change)?;
        check(&field, Kind::MagneticField, ingest::encode_magnetic_field, ingest::decode_magnetic_field, change)?;
        check(&model, Kind::ReferenceModel, ingest::encode_reference_model, ingest::decode_reference_model, change)?;
    }

    #[test]
    fn corrected_epochs_come_back(epoch in corrected_epoch(), change in any::<(usize, u8)>()) {
        let bytes = frame_of(|out| ingest::encode_corrected_epoch(&epoch, out));
        let (given, events, counters) = run(&bytes);
        prop_assert_eq!(given.corrected.len(), 1);
        let (back, is_incomplete) = &given.corrected[0];
        prop_assert_eq!((back.time, &back.rows, *is_incomplete), (epoch.time, &epoch.rows, false));
        prop_assert!(events.is_empty());
        prop_assert_eq!((counters.epochs, counters.epochs_incomplete, counters.native_refused), (1, 0, 0));

        let (frame, _) = Frame::parse(&bytes).unwrap();
        for cut in 0..frame.payload().len() {
            prop_assert!(CorrectedGroup::decode(&frame.payload()[..cut]).is_err());
        }
        let mut payload = frame.payload().to_vec();
        let place = change.0 % payload.len();
        payload[place] = change.1;
        if let Ok(group) = CorrectedGroup::decode(&payload) {
            group.for_each(|row| assert!(row.sigma_pseudorange_m > 0.0));
        }
    }
}

/// Epochs as they were when ready.
#[derive(Default)]
struct Given {
    received: Vec<ObservationEpoch>,
    corrected: Vec<(CorrectedEpoch, bool)>,
}

/// What a stream gives: epochs, all other events, the counters.
fn run(stream: &[u8]) -> (Given, Vec<Event>, Counters) {
    let mut ingest = Box::new(Ingest::EMPTY);
    let (mut given, mut events) = (Given::default(), Vec::new());
    let mut bytes = stream;
    loop {
        let (used, mut event) = ingest.push(bytes);
        bytes = &bytes[used..];
        if event == Event::Nothing {
            event = ingest.finish();
        }
        match event {
            Event::EpochReady => given.received.push(ingest.epoch().clone()),
            Event::CorrectedEpochReady => given.corrected.push((
                ingest.corrected_epoch().clone(),
                ingest.corrected_is_incomplete(),
            )),
            Event::EndOfStream if bytes.is_empty() => break,
            event => events.push(event),
        }
    }
    (given, events, *ingest.counters())
}

fn imu(time: GpsTime) -> (ImuSample, Vec<u8>) {
    let sample = ImuSample {
        time,
        interval_ns: 10_000_000,
        dtheta_is_s_rad: [1e-4, -2e-4, 3e-4],
        dv_is_s_mps: [0.01, -0.02, -0.098],
    };
    (sample, frame_of(|out| ingest::encode_imu(&sample, out)))
}

/// A stream of native frames, each by itself.
fn frames(mut stream: &[u8]) -> Vec<&[u8]> {
    let mut frames = Vec::new();
    while !stream.is_empty() {
        let (_, len) = Frame::parse(stream).unwrap();
        let (frame, rest) = stream.split_at(len);
        frames.push(frame);
        stream = rest;
    }
    frames
}

fn native_epoch(time: GpsTime, week_unknown: bool) -> Vec<u8> {
    let mut epoch = ObservationEpoch::EMPTY;
    epoch.restart(time);
    epoch.flags.week_unknown = week_unknown;
    for index in 0..40 {
        for attribute in *b"CSLXW" {
            let mut observation = SignalObservation::new(Signal::new(b'1', attribute).unwrap());
            observation.pseudorange_m = Some(2e7 + index as f64);
            let satellite = Satellite::from_index(index).unwrap();
            epoch.add(satellite, observation).unwrap();
        }
    }
    let mut out = vec![0; MAX_EPOCH_BYTES];
    let len = ingest::encode_observations(&epoch, &mut out).unwrap();
    out.truncate(len);
    out
}

#[test]
fn samples_between_the_messages_of_an_epoch_leave_it_as_it_is() {
    let time = GpsTime::from_week_tow_s(2010, 100);
    let stream = [
        native_epoch(time, false),
        native_epoch(time.plus_ns(NS_PER_S), false),
    ]
    .concat();
    let (alone, _, _) = run(&stream);
    // Samples earlier than, at, and far later than the epoch, between any two of its messages.
    let mut mixed = Vec::new();
    let mut samples = Vec::new();
    for (turn, frame) in frames(&stream).into_iter().enumerate() {
        mixed.extend(frame);
        for offset_ns in [-NS_PER_S, 0, 5 * NS_PER_S, turn as i64] {
            let (sample, bytes) = imu(time.plus_ns(offset_ns));
            samples.push(Event::Imu(sample));
            mixed.extend(bytes);
        }
    }
    let (with_samples, events, counters) = run(&mixed);
    assert_eq!(alone.received.len(), 2);
    assert_eq!(with_samples.received, alone.received);
    assert!(
        with_samples
            .received
            .iter()
            .all(|epoch| !epoch.flags.incomplete)
    );
    assert_eq!(events, samples);
    assert_eq!(counters.imu_samples as usize, samples.len());
    assert_eq!(
        (counters.epochs_incomplete, counters.messages_too_late),
        (0, 0)
    );
}

#[test]
fn a_sample_lies_in_the_provisional_week_of_the_receiver_until_the_week_is_known() {
    let at = |week, tow_s| GpsTime::from_week_tow_s(week, tow_s);
    let stream = [
        native_epoch(at(985, 100), true),
        imu(at(2009, 101)).1,
        native_epoch(at(2009, 102), false),
        imu(at(2009, 103)).1,
    ]
    .concat();
    let (given, events, _) = run(&stream);
    assert_eq!(given.received.len(), 2);
    assert_eq!(
        events,
        [
            Event::Imu(imu(at(985, 101)).0),
            Event::WeekResolved { shift_weeks: 1024 },
            Event::Imu(imu(at(2009, 103)).0),
        ]
    );
}

/// A sample that is no number is no damage of the wire: the monitor has to hear of it.
#[test]
fn a_failed_sensor_is_heard_of_and_other_nonsense_is_refused_and_counted() {
    let (mut sample, _) = imu(GpsTime::from_week_tow_s(2010, 100));
    sample.dv_is_s_mps[1] = f64::NAN;
    let (_, events, _) = run(&frame_of(|out| ingest::encode_imu(&sample, out)));
    let [Event::Imu(heard)] = events[..] else {
        panic!("{events:?}");
    };
    assert!(heard.dv_is_s_mps[1].is_nan() && heard.time == sample.time);

    let without_interval = ImuSample {
        interval_ns: 0,
        ..sample
    };
    let out_of_time = ImuSample {
        time: GpsTime::from_ns(i64::MAX),
        ..sample
    };
    let nonsense = [without_interval, out_of_time]
        .iter()
        .flat_map(|sample| frame_of(|out| ingest::encode_imu(sample, out)))
        .collect::<Vec<_>>();
    assert_eq!(nonsense.len(), 2 * IMU_FRAME_LENGTH);
    let (_, events, counters) = run(&nonsense);
    assert!(events.is_empty());
    assert_eq!((counters.native_refused, counters.imu_samples), (2, 0));
}

#[test]
fn what_no_unit_no_state_and_no_requirement_can_be_is_refused() {
    let refuses = |payload: &[u8], place: usize, value: f64| {
        let mut payload = payload.to_vec();
        payload[place..place + 8].copy_from_slice(&value.to_le_bytes());
        payload
    };
    let config = InertialConfig {
        interval_ns: 10_000_000,
        c_b_s: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        lever_arm_b_m: [0.0; 3],
        noise: InertialNoise {
            arw: 1e-4,
            vrw: 1e-3,
            gyro_bias_walk: 1e-6,
            accel_bias_walk: 1e-5,
        },
        clock: ClockNoise {
            bias_psd: 0.01,
            drift_psd: 0.04,
            drift_decay_per_s: 0.0,
            inter_system_psd: 0.0,
        },
        measurement: MeasurementFactors::ONE,
        range: SensorRange {
            rate_radps: 10.0,
            specific_force_mps2: 100.0,
        },
        start: AttitudeStart::Course { min_speed_mps: 2.0 },
        sigma: InitialSigma {
            position_m: 10.0,
            velocity_mps: 0.5,
            attitude_ned_rad: [0.01; 3],
            gyro_bias_radps: 1e-4,
            accel_bias_mps2: 0.01,
            clock_bias_m: 30.0,
            clock_drift_mps: 1.0,
        },
    };
    let bytes = frame_of(|out| ingest::encode_inertial(&config, out));
    let payload = Frame::parse(&bytes).unwrap().0.payload();
    assert_eq!(ingest::decode_inertial(payload), Ok(config));
    // The first element of the mounting doubled: no rotation.
    assert_eq!(
        ingest::decode_inertial(&refuses(payload, 29, 2.0)),
        Err(PayloadError::Configuration)
    );
    assert_eq!(
        ingest::decode_inertial(&refuses(payload, 29, f64::NAN)),
        Err(PayloadError::NotFinite)
    );
    // An angle where only a speed is: it would be lost without a word.
    assert_eq!(
        ingest::decode_inertial(&refuses(payload, 13, 0.5)),
        Err(PayloadError::OutOfRange { value: 0.5 })
    );

    let state = InitialState {
        time: GpsTime::from_ns(0),
        r_eb_e_m: [4e6, 0.0, 5e6],
        v_eb_e_mps: [0.0; 3],
        q_e_b: [1.0, 0.0, 0.0, 0.0],
        gyro_bias_radps: [0.0; 3],
        accel_bias_mps2: [0.0; 3],
        clock_bias_m: 0.0,
        clock_drift_mps: 0.0,
    };
    let bytes = frame_of(|out| ingest::encode_initial_state(&state, out));
    let payload = Frame::parse(&bytes).unwrap().0.payload();
    assert_eq!(ingest::decode_initial_state(payload), Ok(state));
    assert_eq!(
        ingest::decode_initial_state(&refuses(payload, 56, 0.9)),
        Err(PayloadError::OutOfRange { value: 0.9 * 0.9 })
    );

    let model = ReferenceModel {
        p_fa: 3.33e-7,
        p_md: 1e-3,
        p_h0: 1e-7,
        hal_m: 556.0,
        val_m: 50.0,
        detect_vertical: true,
        exclude: false,
        hold_ns: 0,
    };
    let bytes = frame_of(|out| ingest::encode_reference_model(&model, out));
    let payload = Frame::parse(&bytes).unwrap().0.payload();
    assert_eq!(ingest::decode_reference_model(payload), Ok(model));
    for (place, value) in [(9, 0.0), (17, 1.0), (33, 0.0), (41, -1.0)] {
        assert_eq!(
            ingest::decode_reference_model(&refuses(payload, place, value)),
            Err(PayloadError::OutOfRange { value })
        );
    }
}

fn corrected(time: GpsTime, rows: usize) -> Vec<u8> {
    let mut epoch = CorrectedEpoch::EMPTY;
    epoch.time = time;
    for index in 0..rows {
        let row = CorrectedMeasurement {
            satellite: Satellite::from_index(index).unwrap(),
            r_es_e_m: [2e7, index as f64, 1e7],
            v_es_e_mps: [1.0, 2.0, 3.0],
            pseudorange_m: 2.1e7,
            sigma_pseudorange_m: 1.0,
            range_rate_mps: Some((-100.0, 0.1)),
        };
        epoch.rows.push(row).unwrap();
    }
    frame_of(|out| ingest::encode_corrected_epoch(&epoch, out))
}

#[test]
fn a_full_corrected_epoch_fits_the_buffer_it_is_said_to_fit() {
    assert_eq!(
        corrected(GpsTime::from_ns(0), MAX_SATELLITES).len(),
        MAX_CORRECTED_EPOCH_BYTES
    );
}

#[test]
fn a_corrected_epoch_that_lacks_a_group_says_so() {
    let time = GpsTime::from_week_tow_s(0, 10);
    let whole = corrected(time, 40);
    let groups = frames(&whole);
    assert_eq!(groups.len(), 4);
    for missing in 0..groups.len() {
        let mut left = groups.clone();
        left.remove(missing);
        let (given, _, counters) = run(&left.concat());
        assert_eq!(given.corrected.len(), 1);
        let (epoch, is_incomplete) = &given.corrected[0];
        assert!(*is_incomplete && epoch.rows.len() < 40, "group {missing}");
        assert_eq!(counters.epochs_incomplete, 1);
    }
    // Cut short by the next epoch, which loses nothing.
    let next = corrected(time.plus_ns(NS_PER_S), 40);
    let (given, _, _) = run(&[&groups[..3].concat()[..], &next].concat());
    let rows: Vec<_> = given
        .corrected
        .iter()
        .map(|(epoch, is_incomplete)| (epoch.rows.len(), *is_incomplete))
        .collect();
    assert_eq!(rows, [(36, true), (40, false)]);
}

#[test]
fn old_and_repeated_corrected_groups_are_dropped_and_counted() {
    let at = |tow_s| GpsTime::from_week_tow_s(0, tow_s);
    let second = corrected(at(11), 20);
    let groups = frames(&second);
    let stream = [
        &corrected(at(10), 5)[..],
        groups[0],
        groups[0],
        groups[1],
        groups[1],
        &corrected(at(10), 5),
        &corrected(at(12), 5),
    ]
    .concat();
    let (given, _, counters) = run(&stream);
    let rows: Vec<_> = given
        .corrected
        .iter()
        .map(|(epoch, is_incomplete)| (epoch.time.tow_s(), epoch.rows.len(), *is_incomplete))
        .collect();
    assert_eq!(
        rows,
        [(10.0, 5, false), (11.0, 20, false), (12.0, 5, false)]
    );
    assert_eq!(counters.messages_too_late, 3);
}

#[test]
fn corrected_and_received_epochs_do_not_end_each_other() {
    let time = GpsTime::from_week_tow_s(2010, 100);
    let (received, corrected) = (native_epoch(time, false), corrected(time, 20));
    assert_eq!((frames(&received).len(), frames(&corrected).len()), (3, 2));
    let mut mixed = Vec::new();
    for (a, b) in frames(&received).iter().zip(frames(&corrected)) {
        mixed.extend_from_slice(a);
        mixed.extend_from_slice(b);
    }
    for frame in frames(&received).iter().skip(2) {
        mixed.extend_from_slice(frame);
    }
    let (given, _, counters) = run(&mixed);
    assert_eq!((given.received.len(), given.corrected.len()), (1, 1));
    assert!(!given.received[0].flags.incomplete && !given.corrected[0].1);
    assert_eq!(counters.epochs_incomplete, 0);
    // The end of the stream gives out both.
    let half = [frames(&received)[0], frames(&corrected)[0]].concat();
    let mut out = [0; MAX_FRAME];
    let len = ingest::encode_end_of_stream(&mut out).unwrap();
    for end in [&out[..len], &[]] {
        let (given, _, counters) = run(&[&half, end].concat());
        assert_eq!((given.received.len(), given.corrected.len()), (1, 1));
        assert_eq!(counters.epochs_incomplete, 2);
    }
}
