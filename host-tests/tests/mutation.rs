//! Damaged streams: nothing invented, nothing panics. The short, seeded form of `surefix mutate`.

mod common;

use std::path::PathBuf;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use surefix_host_tests::mutate::{self, Subject, Tally};
use surefix_host_tests::rinex::read_unzipped;
use surefix_host_tests::simulate::disturbances::Disturbances;
use surefix_host_tests::simulate::stream::Format;
use surefix_host_tests::simulate::{Args, atmosphere::Ionosphere, flight::Flight, simulate};

/// INT-053.
#[test]
fn damaged_recordings_give_nothing_that_was_not_sent() {
    let mut subjects = Vec::new();
    for name in [
        "data/walk0827-x20p-imu/gnss_1730.ubx",
        "data/besancon-f9-coldstart-nominal/16dBatt_no_interference_coldstart.ubx.gz",
        "data/ubx-parser-corpus/F9T-L2-5min.ubx.gz",
        "data/ubx-parser-corpus/swift_rxm_sfrbx_bds.ubx",
        "data/ubx-parser-corpus/swift_rxm_sfrbx_gps.ubx",
        "data/ubx-parser-corpus/swift_rxm_sfrbx_glo.ubx",
        "data/ubx-parser-corpus/pyubx2_pygpsdata-RXMRAWX.log",
        "data/ubx-parser-corpus/pyubx2_pygpsdata-MIXED.log",
        "data/rtcm3-str1-week-rollover-2018/week-rollover-STR24.rtcm3",
        "data/rtcm3-str1-week-rollover-2018/week-rollover-STR17.rtcm3",
        "data/rtcm3-parser-corpus/msm7.rtcm",
        "data/rtcm3-parser-corpus/eph.rtcm",
        "data/rtcm3-parser-corpus/mixed-msm-legacy.rtcm",
    ] {
        if let Some(path) = common::shared(name) {
            subjects.push(Subject::new(name, read_unzipped(&path).unwrap()));
        }
    }
    damage(&subjects, 40_000);
}

/// INT-053.
#[test]
fn a_damaged_line_of_two_receivers_gives_nothing_that_was_not_sent() {
    let simulated = |receiver: Format| {
        let args = Args {
            name: Flight::Approach,
            seed: 1,
            out: PathBuf::new(),
            rate_hz: 1.0,
            duration: Some(120.0),
            noise_free: false,
            dual_frequency: true,
            no_troposphere: false,
            ionosphere: Ionosphere::Klobuchar,
            receiver,
            faults: Vec::new(),
            disturbances: Disturbances::default(),
        };
        simulate(&args).unwrap().receiver
    };
    let (ubx, rtcm3) = (simulated(Format::Ubx), simulated(Format::Rtcm3));
    // Parts of one between parts of the other, cut anywhere, with lines of NMEA between.
    let mut mixed = Vec::new();
    let parts = |stream: &[u8]| {
        stream
            .chunks(stream.len() / 60)
            .map(<[u8]>::to_vec)
            .collect::<Vec<_>>()
    };
    for (a, b) in parts(&ubx).into_iter().zip(parts(&rtcm3)) {
        mixed.extend(a);
        mixed.extend(b"$GNTXT,01,01,02,between*00\r\n");
        mixed.extend(b);
    }
    let subjects = [
        Subject::new("UBX", ubx),
        Subject::new("RTCM 3", rtcm3),
        Subject::new("mixed", mixed),
    ];
    damage(&subjects, 3_000);
}

fn damage(subjects: &[Subject], cases: u64) {
    if subjects.is_empty() {
        return;
    }
    let mut tally = Tally::default();
    for seed in 0..cases {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let subject = &subjects[mutate::below(&mut random, subjects.len())];
        if let Err(error) = mutate::case(subject, &mut random, &mut tally) {
            panic!("{}, seed {seed}: {error:#}", subject.name);
        }
    }
    eprintln!(
        "{} damaged streams, {:.0} MB: {} observations, {} ephemerides, all of them sent; lost {:?}",
        tally.cases,
        tally.bytes as f64 / 1e6,
        tally.observations,
        tally.ephemerides,
        tally.lost
    );
    assert!(tally.observations > 100 * cases && tally.ephemerides > cases / 4);
}
