//! How epochs are put together: when they end, what is dropped, what is flagged, what is counted.

use rtcm_rs::msg::{
    BdsSigId, GalSigId, GloSigId, GpsSigId, Msg1019T, Msg1042T, Msg1074Data, Msg1074Sig, Msg1074T,
    Msg1084Data, Msg1084Sig, Msg1084T, Msg1094Data, Msg1094Sig, Msg1094T, Msg1124Data, Msg1124Sig,
    Msg1124T, Msm46Sat,
};
use rtcm_rs::{Message, MessageBuilder};
use surefix_core::budget::NoCounter;
use surefix_core::config::Config;
use surefix_core::consts::MAX_SATELLITES;
use surefix_core::gnss::{
    KlobucharParameters, ObservationEpoch, Satellite, Signal, SignalObservation, System,
};
use surefix_core::ingest::{self, Event, Ingest, MAX_EPOCH_BYTES};
use surefix_core::ins::ImuSample;
use surefix_core::monitor::{Monitor, Ready};
use surefix_core::report::EpochReport;
use surefix_core::time::GpsTime;
use surefix_core::wire::Counters;
use surefix_core::wire::native::{Frame, MAX_FRAME};
use surefix_host_tests::source::{Item, Recording};

const GPS_SIGNALS: [(u8, char); 7] = [
    (1, 'C'),
    (1, 'W'),
    (2, 'W'),
    (2, 'L'),
    (2, 'S'),
    (5, 'I'),
    (5, 'Q'),
];

/// One MSM4 of a system with pseudoranges of 70 ms on every cell.
macro_rules! msm4 {
    ($variant:ident, $message:ident, $data:ident, $sig:ident, $id:ident, $epoch:ident,
     $tow:expr, $more:expr, $satellites:expr, $signals:expr) => {{
        let mut data = $data::default();
        for satellite_id in $satellites {
            data.satellite_data.push(Msm46Sat {
                satellite_id,
                gnss_satellite_rough_range_integer_ms: Some(70),
                gnss_satellite_rough_range_mod1ms_ms: 0.5,
            });
            for (band, attribute) in $signals {
                data.signal_data.push($sig {
                    satellite_id,
                    signal_id: $id::new(band, attribute),
                    gnss_signal_fine_pseudorange_ms: Some(0.0),
                    ..Default::default()
                });
            }
        }
        let message = Message::$variant($message {
            $epoch: $tow,
            msm_multiple_message_flag: $more as u8,
            data_segment: data,
            ..Default::default()
        });
        MessageBuilder::new()
            .build_message(&message)
            .unwrap()
            .to_vec()
    }};
}

fn gps(
    tow_ms: u32,
    more: bool,
    satellites: impl IntoIterator<Item = u8>,
    signals: usize,
) -> Vec<u8> {
    msm4!(
        Msg1074,
        Msg1074T,
        Msg1074Data,
        Msg1074Sig,
        GpsSigId,
        gps_epoch_time_ms,
        tow_ms,
        more,
        satellites,
        GPS_SIGNALS.into_iter().take(signals)
    )
}

fn galileo(tow_ms: u32, more: bool, satellites: impl IntoIterator<Item = u8>) -> Vec<u8> {
    msm4!(
        Msg1094,
        Msg1094T,
        Msg1094Data,
        Msg1094Sig,
        GalSigId,
        gal_epoch_time_ms,
        tow_ms,
        more,
        satellites,
        [(1, 'C')]
    )
}

fn bds(bdt_ms: u32, more: bool, satellites: impl IntoIterator<Item = u8>) -> Vec<u8> {
    msm4!(
        Msg1124,
        Msg1124T,
        Msg1124Data,
        Msg1124Sig,
        BdsSigId,
        bds_epoch_time_ms,
        bdt_ms,
        more,
        satellites,
        [(2, 'I')]
    )
}

fn glonass(more: bool) -> Vec<u8> {
    let mut data = Msg1084Data::default();
    data.satellite_data.push(Msm46Sat {
        satellite_id: 1,
        ..Default::default()
    });
    data.signal_data.push(Msg1084Sig {
        satellite_id: 1,
        signal_id: GloSigId::new(1, 'C'),
        ..Default::default()
    });
    let message = Message::Msg1084(Msg1084T {
        msm_multiple_message_flag: u8::from(more),
        data_segment: data,
        ..Default::default()
    });
    MessageBuilder::new()
        .build_message(&message)
        .unwrap()
        .to_vec()
}

/// What a stream gives: epochs as they were when ready, all other events, the counters.
fn run(stream: &[u8]) -> (Vec<ObservationEpoch>, Vec<Event>, Counters) {
    let mut ingest = Box::new(Ingest::EMPTY);
    let (mut epochs, mut events) = (Vec::new(), Vec::new());
    let mut bytes = stream;
    loop {
        let (used, mut event) = ingest.push(bytes);
        bytes = &bytes[used..];
        if event == Event::Nothing {
            event = ingest.finish();
        }
        match event {
            Event::EpochReady => epochs.push(ingest.epoch().clone()),
            Event::EndOfStream if bytes.is_empty() => break,
            event => events.push(event),
        }
    }
    (epochs, events, *ingest.counters())
}

fn tows(epochs: &[ObservationEpoch]) -> Vec<f64> {
    epochs.iter().map(|epoch| epoch.time.tow_s()).collect()
}

#[test]
fn a_later_epoch_ends_one_that_waits_and_loses_nothing() {
    let stream = [
        gps(1000, true, 1..=8, 1),
        // The rest of second 1 is lost.
        gps(2000, true, 1..=7, 1),
        galileo(2000, true, 1..=5),
        bds(604_788_000, false, 6..=9),
    ]
    .concat();
    let (epochs, _, counters) = run(&stream);
    assert_eq!(tows(&epochs), [1.0, 2.0]);
    assert!(epochs[0].flags.incomplete && !epochs[1].flags.incomplete);
    assert_eq!(epochs[0].satellites.len(), 8);
    assert_eq!(epochs[1].satellites.len(), 7 + 5 + 4);
    assert_eq!((counters.epochs, counters.epochs_incomplete), (2, 1));
}

#[test]
fn a_message_of_another_system_ends_the_epoch() {
    let stream = [
        gps(1000, true, 1..=8, 1),
        glonass(true),
        galileo(1000, true, 1..=5),
        glonass(false),
        gps(2000, false, 1..=8, 1),
    ]
    .concat();
    let (epochs, _, counters) = run(&stream);
    assert_eq!(tows(&epochs), [1.0, 2.0]);
    assert!(epochs.iter().all(|epoch| !epoch.flags.incomplete));
    assert_eq!(epochs[0].satellites.len(), 13);
    assert_eq!(counters.msm_skipped, 2);
}

#[test]
fn inertial_samples_between_the_messages_of_an_epoch_change_nothing() {
    let messages = [
        gps(100_000, true, [1, 2], 1),
        galileo(100_000, true, [3, 4]),
        bds(86_000, false, [5, 6]),
        gps(101_000, true, [1, 2], 1),
        bds(87_000, false, [5, 6]),
    ];
    let sample = ImuSample {
        time: GpsTime::from_week_tow_s(2010, 100),
        interval_ns: 10_000_000,
        dtheta_is_s_rad: [0.0; 3],
        dv_is_s_mps: [0.0; 3],
    };
    let mut out = [0; MAX_FRAME];
    let len = ingest::encode_imu(&sample, &mut out).unwrap();
    let mixed: Vec<u8> = messages
        .iter()
        .flat_map(|message| [message, &out[..len], &out[..len]].concat())
        .collect();
    let (alone, _, _) = run(&messages.concat());
    let (epochs, events, counters) = run(&mixed);
    assert_eq!((epochs.len(), epochs[0].satellites.len()), (2, 6));
    assert_eq!(epochs, alone);
    assert_eq!(events.len(), 2 * messages.len());
    assert_eq!((counters.imu_samples, counters.epochs_incomplete), (10, 0));
}

#[test]
fn older_and_repeated_epochs_are_dropped_and_counted() {
    let stream = [
        gps(5000, false, 1..=8, 1),
        gps(5000, false, 1..=9, 1),
        gps(4000, false, 1..=8, 1),
        galileo(4000, false, 1..=8),
        gps(6000, false, 1..=8, 1),
    ]
    .concat();
    let (epochs, _, counters) = run(&stream);
    assert_eq!(tows(&epochs), [5.0, 6.0]);
    assert_eq!(counters.messages_too_late, 3);
    assert_eq!(counters.time_restarts, 0);
}

#[test]
fn a_receiver_that_goes_back_in_time_for_good_is_followed() {
    let mut stream = gps(500_000_000, false, 1..=8, 1);
    for k in 0..100 {
        stream.extend(gps(400_000_000 + k * 1000, false, 1..=8, 1));
    }
    let (epochs, _, counters) = run(&stream);
    assert_eq!(epochs.len(), 1 + 98);
    assert_eq!(counters.messages_too_late, 2);
    assert_eq!(counters.time_restarts, 1);
    assert_eq!(epochs[1].time.tow_s(), 400_002.0);
}

#[test]
fn one_wrong_time_costs_two_epochs() {
    // Whether the wrong message is the whole of its epoch or leaves it waiting for more.
    for is_whole in [true, false] {
        let mut stream = Vec::new();
        for second in 100..110 {
            let wrong = u32::from(second == 103) * 7_200_000;
            stream.extend(gps(second * 1000 + wrong, !is_whole, 1..=8, 1));
            if !is_whole {
                stream.extend(galileo(second * 1000, true, 1..=5));
                stream.extend(bds(second * 1000 - 14_000, false, 6..=9));
            }
        }
        let (epochs, _, counters) = run(&stream);
        let first_right = if is_whole { 106 } else { 105 };
        let mut expected = vec![100.0, 101.0, 102.0, 7303.0];
        expected.extend((first_right..110).map(f64::from));
        assert_eq!(tows(&epochs), expected);
        let satellites = if is_whole { 8 } else { 17 };
        assert!(
            epochs[4..]
                .iter()
                .all(|epoch| !epoch.flags.incomplete && epoch.satellites.len() == satellites)
        );
        // 104 and 105; or two messages of 103 and three of 104.
        assert_eq!(counters.messages_too_late, if is_whole { 2 } else { 2 + 3 });
        assert_eq!(counters.time_restarts, 1);
    }
}

#[test]
fn repeated_and_reordered_messages_do_not_turn_time_back() {
    let mut stream = Vec::new();
    for second in 100..103 {
        stream.extend(gps(second * 1000, false, 1..=8, 1));
    }
    for second in [
        102, 102, 102, 102, 101, 101, 101, 101, 100, 100, 101, 102, 99, 98, 97, 96,
    ] {
        stream.extend(gps(second * 1000, false, 1..=8, 1));
    }
    for second in [103, 101, 102, 104, 102, 103, 105, 103, 104] {
        stream.extend(gps(second * 1000, false, 1..=8, 1));
    }
    let (epochs, _, counters) = run(&stream);
    assert_eq!(tows(&epochs), [100.0, 101.0, 102.0, 103.0, 104.0, 105.0]);
    assert_eq!(counters.messages_too_late, 16 + 6);
    assert_eq!(counters.time_restarts, 0);
}

#[test]
fn what_does_not_fit_is_flagged_and_counted() {
    let stream = [
        gps(1000, true, 1..=32, 1),
        galileo(1000, false, 1..=20),
        gps(2000, false, [3, 4], 7),
    ]
    .concat();
    let (epochs, _, counters) = run(&stream);
    assert_eq!(epochs[0].satellites.len(), MAX_SATELLITES);
    assert!(epochs[0].flags.overflow && epochs[1].flags.overflow);
    assert_eq!(counters.satellites_lost, 4);
    assert_eq!(epochs[1].satellites[1].signals.len(), 6);
    assert_eq!(counters.signals_lost, 2);
}

#[test]
fn bds_seconds_that_are_not_bdt_are_not_believed() {
    let stream = [
        gps(100_000, true, 1..=8, 1),
        // GPST where BDT belongs.
        bds(100_000, false, 6..=9),
        gps(101_000, true, 1..=8, 1),
        bds(87_000, false, 6..=9),
    ]
    .concat();
    let (epochs, _, counters) = run(&stream);
    assert_eq!(tows(&epochs), [100.0, 101.0]);
    assert_eq!(counters.bds_time_contradicted, 1);
    assert!(epochs[0].flags.incomplete);
    assert_eq!(epochs[0].satellites.len(), 8);
    assert_eq!(epochs[1].satellites.len(), 12);
}

#[test]
fn the_end_of_the_stream_gives_out_what_waits() {
    let (epochs, _, counters) = run(&gps(1000, true, 1..=8, 1));
    assert_eq!(tows(&epochs), [1.0]);
    assert!(epochs[0].flags.incomplete);
    assert_eq!(counters.epochs, 1);

    // A native frame that ends the stream does the same.
    let mut stream = gps(1000, true, 1..=8, 1);
    let mut out = [0; MAX_FRAME];
    let len = ingest::encode_end_of_stream(&mut out).unwrap();
    stream.extend(&out[..len]);
    let mut ingest = Box::new(Ingest::EMPTY);
    let (used, event) = ingest.push(&stream);
    assert_eq!((used, event), (stream.len(), Event::EpochReady));
    assert_eq!(ingest.push(&[]), (0, Event::EndOfStream));
    assert_eq!(ingest.push(&[]), (0, Event::Nothing));
}

fn bds_ephemeris(satellite: u8, bdt_week: u16, toe_s: u32) -> Vec<u8> {
    let message = Message::Msg1042(Msg1042T {
        bds_satellite_id: satellite,
        bds_week_number: bdt_week,
        toe_s: toe_s as f32,
        toc_s: toe_s as f32,
        sqrt_a_sqrt_m: 5282.6,
        ura_index: 0,
        ..Default::default()
    });
    MessageBuilder::new()
        .build_message(&message)
        .unwrap()
        .to_vec()
}

fn gps_ephemeris(satellite: u8, week_modulo_1024: u16, toe_s: u32) -> Vec<u8> {
    let message = Message::Msg1019(Msg1019T {
        gps_satellite_id: satellite,
        gps_week_number: week_modulo_1024,
        toe_s: toe_s as f32,
        toc_s: toe_s as f32,
        sqrt_a_sqrt_m: 5153.6,
        ..Default::default()
    });
    MessageBuilder::new()
        .build_message(&message)
        .unwrap()
        .to_vec()
}

#[test]
fn after_days_without_observations_time_finds_its_week_again() {
    let mut stream = bds_ephemeris(1, 2420 - 1356, 270_000);
    stream.extend(gps(274_220_000, false, 1..=8, 1));
    // More than half a week later.
    for second in 15_020..15_030 {
        stream.extend(gps(second * 1000, true, 1..=8, 1));
        let satellite = (second % 5) as u8 + 1;
        stream.extend(bds_ephemeris(satellite, 2421 - 1356, 10_800));
        stream.extend(galileo(second * 1000, false, 1..=5));
    }
    let (epochs, events, counters) = run(&stream);
    let weeks: Vec<_> = epochs.iter().map(|epoch| epoch.time.week()).collect();
    // Nearest to the last epoch is a week before. The third epoch there is followed, and in the
    // middle of it the third ephemeris tells the week, which the next epoch takes up.
    assert_eq!(weeks[..2], [2420; 2]);
    assert_eq!(weeks[2..], [2421; 7]);
    assert_eq!(epochs[1].time.tow_s(), 15_022.0);
    assert_eq!(epochs[2].time.tow_s(), 15_023.0);
    assert!(epochs.iter().all(|epoch| !epoch.flags.incomplete));
    assert!(epochs[1..].iter().all(|epoch| epoch.satellites.len() == 13));
    assert_eq!(counters.epochs_incomplete, 0);
    // What is stored names its own week and is not to be moved.
    assert!(
        events
            .iter()
            .all(|event| matches!(event, Event::Ephemeris(_)))
    );
}

#[test]
fn a_wrong_first_week_is_left_again() {
    let mut stream = bds_ephemeris(1, 2430 - 1356, 270_000);
    for second in 274_220..274_240 {
        stream.extend(gps(second * 1000, false, 1..=8, 1));
        let satellite = (second % 5) as u8 + 1;
        stream.extend(bds_ephemeris(satellite, 2420 - 1356, 270_000));
    }
    let (epochs, _, counters) = run(&stream);
    let weeks: Vec<_> = epochs.iter().map(|epoch| epoch.time.week()).collect();
    assert_eq!(weeks[..3], [2430; 3]);
    assert_eq!(weeks[3..], [2420; 15]);
    assert_eq!(counters.time_restarts, 1);
}

/// What a monitor makes of a stream, and how many configurations it refused.
fn monitored(stream: &[u8]) -> (Vec<EpochReport>, u32) {
    let mut monitor = Box::new(Monitor::EMPTY);
    let mut reports = Vec::new();
    let mut rest = stream;
    loop {
        let (used, ready) = monitor.push(rest);
        rest = &rest[used..];
        match ready {
            Some(Ready::Epoch) => reports.push(monitor.process(&mut NoCounter)),
            Some(Ready::EndOfStream) => {}
            None => return (reports, monitor.refused_configurations()),
        }
    }
}

#[test]
fn a_refused_configuration_does_not_tell_the_week() {
    let configuration = |reference_week| {
        let mut out = [0; MAX_FRAME];
        let config = Config {
            reference_week,
            ..Config::PRESET
        };
        let len = ingest::encode_configuration(&config, &mut out).unwrap();
        out[..len].to_vec()
    };
    let stream = |first, second| {
        [
            configuration(first),
            gps(302_500_000, false, 1..=8, 1),
            configuration(second),
            gps_ephemeris(7, 985, 302_400),
            gps(302_501_000, false, 1..=8, 1),
        ]
        .concat()
    };
    for (first, second, week) in [
        (None, Some(2010), 985),
        (Some(2010), Some(1000), 2009),
        (Some(2010), None, 2009),
    ] {
        let (reports, refused) = monitored(&stream(first, second));
        assert_eq!(refused, 1);
        assert_eq!(reports[1].time.week(), week);
        assert_eq!(reports[1].flags.week_unknown, first.is_none());
    }
}

#[test]
fn a_recording_is_decoded_with_the_week_of_its_configuration_frames() {
    let configuration = |week| {
        let mut out = [0; MAX_FRAME];
        let config = Config {
            reference_week: Some(week),
            ..Config::PRESET
        };
        let len = ingest::encode_configuration(&config, &mut out).unwrap();
        out[..len].to_vec()
    };
    let bytes = [
        configuration(2300),
        gps(302_500_000, false, 1..=8, 1),
        configuration(1000),
        gps_ephemeris(7, 985, 302_400),
        gps(302_501_000, false, 1..=8, 1),
    ]
    .concat();
    let path = std::env::temp_dir().join(format!("surefix-weeks-{}.rtcm3", std::process::id()));
    std::fs::write(&path, bytes).unwrap();
    let recording = Recording::read(&path, &[], &Config::PRESET);
    std::fs::remove_file(&path).unwrap();
    let weeks: Vec<_> = recording
        .unwrap()
        .items
        .iter()
        .filter_map(|item| match item {
            Item::Epoch(epoch) => Some(epoch.time.week()),
            _ => None,
        })
        .collect();
    assert_eq!(weeks, [2009, 2009]);
}

#[test]
fn a_bds_ephemeris_tells_the_week_and_moves_what_was_provisional() {
    let stream = [
        gps(302_500_000, false, 1..=8, 1),
        bds_ephemeris(11, 653, 302_400),
        gps(302_501_000, false, 1..=8, 1),
    ]
    .concat();
    let (epochs, events, _) = run(&stream);
    assert_eq!(
        (epochs[0].time.week(), epochs[0].flags.week_unknown),
        (0, true)
    );
    assert_eq!(
        (epochs[1].time.week(), epochs[1].flags.week_unknown),
        (2009, false)
    );
    assert_eq!(events[0], Event::WeekResolved { shift_weeks: 2009 });
    let Event::Ephemeris(ephemeris) = &events[1] else {
        panic!("{events:?}");
    };
    assert_eq!(
        ephemeris.satellite,
        Satellite::new(System::Bds, 11).unwrap()
    );
    assert_eq!(ephemeris.toe, GpsTime::from_week_tow_s(2009, 302_414));
    assert_eq!(ephemeris.toe_sow_s, 302_400.0);
    assert_eq!(ephemeris.sigma_ura_m, Some(2.0));
}

fn native_epoch(time: GpsTime, week_unknown: bool) -> Vec<u8> {
    let mut epoch = ObservationEpoch::EMPTY;
    epoch.restart(time);
    epoch.flags.week_unknown = week_unknown;
    for index in 0..40 {
        for (band, attribute) in GPS_SIGNALS.into_iter().take(6) {
            let signal = Signal::new(b'0' + band, attribute as u8).unwrap();
            let mut observation = SignalObservation::new(signal);
            observation.pseudorange_m = Some(2e7 + index as f64);
            let satellite = Satellite::from_index(index).unwrap();
            epoch.add(satellite, observation).unwrap();
        }
    }
    let mut out = vec![0; MAX_EPOCH_BYTES];
    let len = ingest::encode_observations(&epoch, &mut out).unwrap();
    out[..len].to_vec()
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

#[test]
fn a_native_epoch_that_lacks_a_group_is_incomplete() {
    let time = GpsTime::from_week_tow_s(2010, 100);
    let whole = native_epoch(time, false);
    let groups = frames(&whole);
    assert!(groups.len() > 2);
    let (epochs, _, _) = run(&whole);
    assert_eq!(epochs.len(), 1);
    assert!(!epochs[0].flags.incomplete && !epochs[0].flags.week_unknown);
    assert_eq!(epochs[0].satellites.len(), 40);
    for missing in 0..groups.len() {
        let mut left = groups.clone();
        left.remove(missing);
        let (epochs, _, counters) = run(&left.concat());
        assert_eq!(epochs.len(), 1);
        assert!(epochs[0].flags.incomplete, "group {missing}");
        assert!(epochs[0].satellites.len() < 40);
        assert_eq!(counters.epochs_incomplete, 1);
    }
    // A group twice adds nothing.
    let mut twice = groups.clone();
    twice.insert(1, groups[0]);
    let (epochs, _, counters) = run(&twice.concat());
    assert!(!epochs[0].flags.incomplete);
    assert_eq!(counters.messages_too_late, 1);
}

#[test]
fn provisional_weeks_of_a_resent_stream_are_corrected_like_those_of_the_first() {
    let stream = [
        native_epoch(GpsTime::from_week_tow_s(985, 100), true),
        native_epoch(GpsTime::from_week_tow_s(2009, 101), false),
        native_epoch(GpsTime::from_week_tow_s(2009, 102), false),
    ]
    .concat();
    let (epochs, events, _) = run(&stream);
    assert!(epochs[0].flags.week_unknown && !epochs[1].flags.week_unknown);
    assert_eq!(events, [Event::WeekResolved { shift_weeks: 1024 }]);
    assert_eq!(epochs[2].time, GpsTime::from_week_tow_s(2009, 102));
}

#[test]
fn other_native_frames_are_events_and_nonsense_is_counted() {
    let mut stream = Vec::new();
    let mut out = [0; MAX_FRAME];
    let config = Config {
        reference_week: Some(2010),
        ..Config::PRESET
    };
    let len = ingest::encode_configuration(&config, &mut out).unwrap();
    stream.extend(&out[..len]);
    let parameters = KlobucharParameters {
        system: System::Gps,
        alpha: [1e-8, 0.0, -6e-8, 6e-8],
        beta: [9e4, 0.0, -2e5, 7e4],
    };
    let len = ingest::encode_klobuchar(&parameters, &mut out).unwrap();
    stream.extend(&out[..len]);
    let len = Counters::ZERO.encode(&mut out).unwrap();
    stream.extend(&out[..len]);
    let illegal = Config {
        max_exclusions: 4,
        ..config
    };
    let len = ingest::encode_configuration(&illegal, &mut out).unwrap();
    stream.extend(&out[..len]);

    let (epochs, events, counters) = run(&stream);
    assert!(epochs.is_empty());
    assert_eq!(
        events,
        [Event::Configuration(config), Event::Klobuchar(parameters)]
    );
    assert_eq!(counters.native_frames, 4);
    assert_eq!(counters.native_unknown_kind, 1);
    assert_eq!(counters.native_refused, 1);
}
