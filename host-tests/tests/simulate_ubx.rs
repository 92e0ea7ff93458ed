//! The simulator's UBX bytes are those of a u-blox receiver: another library reads the simulated
//! observables from them, the navigation messages carry right codes and counts by checks written here,
//! and through core's own decoder they give the simulated ephemerides and place.

mod common;

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use surefix_core::budget::NoCounter;
use surefix_core::config::{Config, IonosphereModel, TroposphereModel};
use surefix_core::consts::SPEED_OF_LIGHT_MPS;
use surefix_core::gnss::klobuchar::KlobucharParameters;
use surefix_core::gnss::{Ephemeris, Satellite, System};
use surefix_core::ingest::{Event, Ingest};
use surefix_core::integrity::{Integrity, Mode};
use surefix_core::monitor::{Monitor, Ready};
use surefix_core::report::EpochReport;
use surefix_host_tests::broadcast_encode::{bch_check, crc24q, parity};
use surefix_host_tests::replay::{self, ReplayOptions};
use surefix_host_tests::rinex::read_unzipped;
use surefix_host_tests::simulate::atmosphere::Ionosphere;
use surefix_host_tests::simulate::disturbances::Disturbances;
use surefix_host_tests::simulate::flight::Flight;
use surefix_host_tests::simulate::inertial::board::{Radio, imu_bytes, receiver_bytes};
use surefix_host_tests::simulate::inertial::{Request, fly};
use surefix_host_tests::simulate::sky::Sky;
use surefix_host_tests::simulate::stream::Format;
use surefix_host_tests::simulate::{Args, epochs, simulate};
use ublox::proto27::{PacketRef, Proto27};
use ublox::{ParserBuilder, UbxPacket};

fn args(name: Flight, duration_s: f64) -> Args {
    Args {
        name,
        seed: 11,
        out: "unused".into(),
        rate_hz: 1.0,
        duration: Some(duration_s),
        noise_free: false,
        dual_frequency: true,
        no_troposphere: false,
        ionosphere: Ionosphere::None,
        receiver: Format::Ubx,
        faults: Vec::new(),
        disturbances: Disturbances::default(),
    }
}

/// One RXM-SFRBX as the ublox crate reads it, and the time of the epoch after it.
struct Message {
    gnss_id: u8,
    sv_id: u8,
    words: Vec<u32>,
    next_epoch_tow_s: f64,
}

/// Everything in a stream, by the ublox crate: the measurements of each epoch, and the messages.
#[expect(
    clippy::type_complexity,
    reason = "numbers as they stand in the message"
)]
fn peer(
    stream: &[u8],
) -> (
    Vec<(f64, u16, u8, Vec<(f64, f64, f32, [u8; 3], u16, u8, u8)>)>,
    Vec<Message>,
) {
    let mut parser = ParserBuilder::new()
        .with_protocol::<Proto27>()
        .with_vec_buffer();
    let mut packets = parser.consume_ubx(stream);
    let (mut measured, mut messages, mut waiting) = (Vec::new(), Vec::new(), Vec::new());
    while let Some(packet) = packets.next() {
        match packet.expect("every frame is whole") {
            UbxPacket::Proto27(PacketRef::RxmRawx(rawx)) => {
                let rows: Vec<_> = rawx
                    .measurements()
                    .map(|m| {
                        (
                            m.pr_mes(),
                            m.cp_mes(),
                            m.do_mes(),
                            [m.gnss_id(), m.sv_id(), m.reserved2()],
                            m.lock_time(),
                            m.cno(),
                            m.trk_stat().bits(),
                        )
                    })
                    .collect();
                assert_eq!(rows.len(), usize::from(rawx.num_meas()));
                assert_eq!((rawx.version(), rawx.leap_s()), (1, 18));
                for mut message in std::mem::take(&mut waiting) {
                    let message_ref: &mut Message = &mut message;
                    message_ref.next_epoch_tow_s = rawx.rcv_tow();
                    messages.push(message);
                }
                measured.push((rawx.rcv_tow(), rawx.week(), rawx.rec_stat().bits(), rows));
            }
            UbxPacket::Proto27(PacketRef::RxmSfrbx(sfrbx)) => waiting.push(Message {
                gnss_id: sfrbx.gnss_id(),
                sv_id: sfrbx.sv_id(),
                words: sfrbx.dwrd().collect(),
                next_epoch_tow_s: 0.0,
            }),
            other => panic!("no such message is written: {other:?}"),
        }
    }
    assert!(waiting.is_empty(), "messages come before the epoch");
    (measured, messages)
}

/// Numbers of [UBX-F9-HPG] 1.5.4 as the recordings have them.
fn numbers(satellite: Satellite, band: u8) -> [u8; 3] {
    let geo = matches!(satellite.prn(), 1..=5 | 59..=63);
    let (system, signal) = match (satellite.system(), band) {
        (System::Gps, b'1') => (0, 0),
        (System::Gps, _) => (0, 3),
        (System::Galileo, b'1') => (2, 0),
        (System::Galileo, _) => (2, 6),
        (System::Bds, b'2') => (3, u8::from(geo)),
        (System::Bds, _) => (3, if geo { 10 } else { 4 }),
    };
    [system, satellite.prn(), signal]
}

#[test]
fn the_ublox_crate_reads_the_simulated_observables() {
    for flight in [Flight::Approach, Flight::Static] {
        let args = args(flight, 70.0);
        let bytes = simulate(&args).unwrap().receiver;
        let (measured, _) = peer(&bytes);
        let simulated: Vec<_> = epochs(&args).unwrap().collect();
        assert_eq!(measured.len(), simulated.len());
        let mut compared = 0;
        for (k, ((tow_s, week, status, rows), epoch)) in measured.iter().zip(&simulated).enumerate()
        {
            let time = epoch.observations.time;
            assert_eq!((*tow_s, i32::from(*week)), (time.tow_s(), time.week()));
            assert!((tow_s - tow_s.round() + 0.002).abs() < 1e-9, "2 ms before");
            assert_eq!(*status, 1, "leap seconds known, no reset of the clock");
            let mut rows = rows.iter();
            for of_satellite in &epoch.observations.satellites {
                for s in &of_satellite.signals {
                    let satellite = of_satellite.satellite;
                    let (pr, cp, doppler, ids, lock_ms, cno, tracking) = rows.next().unwrap();
                    assert_eq!(*ids, numbers(satellite, s.signal.band()));
                    assert_eq!(Some(*pr), s.pseudorange_m);
                    assert_eq!(Some(*cp), s.carrier_phase_cycles);
                    let frequency = s.signal.frequency_hz(satellite.system()).unwrap();
                    let rate_mps = -f64::from(*doppler) * SPEED_OF_LIGHT_MPS / frequency;
                    // A float of some kHz has steps of 0.5 mHz.
                    assert!((rate_mps - s.range_rate_mps.unwrap()).abs() < 1e-4);
                    assert!((f32::from(*cno) - s.cn0_dbhz.unwrap()).abs() <= 0.5);
                    assert!(*lock_ms <= 64_500 && usize::from(*lock_ms) <= 1000 * k);
                    assert_eq!(*tracking, 0b111);
                    compared += 1;
                }
            }
            assert!(rows.next().is_none());
        }
        println!("{}: {compared} observations compared", flight.name());
        assert!(compared > 3000);
    }
}

/// Bits of a word that go into each bit of parity: D29*, D30* of the word before in front, then the 24
/// bits of data; the form of table 20-XIV of [IS-GPS-200] that receivers' software has long had.
const PARITY_MASKS: [u32; 6] = [
    0xbb1f_3480,
    0x5d8f_9a40,
    0xaec7_cd00,
    0x5763_e680,
    0x6bb1_f340,
    0x8b7a_89c0,
];

/// Data of the ten words, or `None` where a parity is wrong. `words` as in RXM-SFRBX.
fn lnav_data(words: &[u32]) -> Option<Vec<u32>> {
    let (mut d29, mut d30) = (0, 0);
    words
        .iter()
        .enumerate()
        .map(|(k, packed)| {
            // A word after D30* = 1 stands inverted, the two bits before it and its parity too.
            let word = if d30 == 1 { !packed } else { *packed };
            if word >> 30 != d29 << 1 | d30 {
                return None;
            }
            let data = if d30 == 1 { word ^ 0x3fff_ffc0 } else { word };
            let expected = PARITY_MASKS
                .iter()
                .fold(0, |sum, mask| sum << 1 | ((data & mask).count_ones() & 1));
            (d29, d30) = (word >> 1 & 1, word & 1);
            // Words 2 and 10 end in two zeros.
            let ended = !matches!(k, 1 | 9) || word & 3 == 0;
            (ended && word & 0x3f == expected).then_some(data >> 6 & 0xff_ffff)
        })
        .collect()
}

/// Remainder of a polynomial over two elements, bit by bit as in school.
fn remainder(bits: &[bool], generator: u64, degree: u32) -> u64 {
    bits.iter().fold(0, |rest, bit| {
        let rest = rest << 1 | u64::from(*bit);
        if rest >> degree & 1 == 1 {
            rest ^ generator
        } else {
            rest
        }
    })
}

fn bits_of(word: u32, width: u32) -> Vec<bool> {
    (0..width).rev().map(|k| word >> k & 1 == 1).collect()
}

fn value(bits: &[bool]) -> u64 {
    bits.iter().fold(0, |sum, bit| sum << 1 | u64::from(*bit))
}

/// Information of a BDS subframe, or `None` where a codeword is none.
fn bds_information(words: &[u32]) -> Option<Vec<bool>> {
    let mut information = Vec::new();
    for (k, word) in words.iter().enumerate() {
        let bits = bits_of(*word, 30);
        if word >> 30 != 0 {
            return None;
        }
        let codewords: Vec<Vec<bool>> = if k == 0 {
            information.extend(&bits[..26]);
            vec![bits[15..].to_vec()]
        } else {
            information.extend(&bits[..22]);
            vec![
                [&bits[..11], &bits[22..26]].concat(),
                [&bits[11..22], &bits[26..]].concat(),
            ]
        };
        if codewords.iter().any(|c| remainder(c, 0b1_0011, 4) != 0) {
            return None;
        }
    }
    Some(information)
}

/// Word of an I/NAV page, or `None` where its CRC is wrong.
fn inav_word(words: &[u32]) -> Option<Vec<bool>> {
    let bits: Vec<bool> = words.iter().flat_map(|word| bits_of(*word, 32)).collect();
    let (even, odd) = bits.split_at(128);
    // With its CRC behind it a row has no remainder.
    let covered = [&even[..114], &odd[..106]].concat();
    (remainder(&covered, 0x186_4cfb, 24) == 0).then(|| [&even[2..114], &odd[2..18]].concat())
}

/// Codes, counts of time and cadence of every message. A subframe of GPS comes 6.15 s to 7.15 s after its
/// count's beginning at 1 Hz, and so on: no earlier than its last bit, no later than the next epoch.
#[test]
fn navigation_messages_carry_right_codes_and_times_and_none_is_missing() {
    let (_, messages) = peer(&simulate(&args(Flight::Static, 120.0)).unwrap().receiver);
    let mut starts: BTreeMap<(u8, u8), Vec<f64>> = BTreeMap::new();
    let mut ends = Vec::new();
    let (mut subframes, mut types, mut pages) = (BTreeSet::new(), BTreeSet::new(), BTreeSet::new());
    for message in &messages {
        let geo = message.gnss_id == 3 && message.sv_id >= 59;
        let (start_s, length_s) = match message.gnss_id {
            0 => {
                let data = lnav_data(&message.words).expect("parity");
                assert_eq!(data[0] >> 16, 0x8b);
                let subframe = data[1] >> 2 & 7;
                subframes.insert((message.sv_id, u64::from(subframe)));
                let start_s = 6.0 * f64::from(data[1] >> 7) - 6.0;
                assert_eq!((start_s / 6.0) as u32 % 5 + 1, subframe);
                (start_s, 6.0)
            }
            2 => {
                let word = inav_word(&message.words).expect("CRC");
                let word_type = value(&word[..6]);
                types.insert((message.sv_id, word_type));
                let stated = match word_type {
                    0 => Some(value(&word[108..]) as f64),
                    5 => Some(value(&word[85..105]) as f64),
                    _ => None,
                };
                // Received within a second of its end.
                let start_s = ((message.next_epoch_tow_s - 0.15 - 1.0) / 2.0).floor() * 2.0 - 1.0;
                assert!(
                    stated.is_none_or(|tow_s| tow_s == start_s),
                    "{stated:?} {start_s}"
                );
                (start_s, 2.0)
            }
            _ => {
                let information = bds_information(&message.words).expect("BCH");
                assert_eq!(value(&information[..11]), 0b111_0001_0010);
                let subframe = value(&information[15..18]);
                let sow_s = value(&information[18..38]) as f64;
                if geo {
                    if subframe == 1 {
                        let page = value(&information[38..42]);
                        assert_eq!(page, (sow_s as u64 / 3) % 10 + 1);
                        pages.insert((message.sv_id, page));
                    }
                    (sow_s + 14.0 + 0.6 * (subframe - 1) as f64, 0.6)
                } else {
                    subframes.insert((message.sv_id + 100, subframe));
                    assert_eq!(sow_s as u64 / 6 % 5 + 1, subframe);
                    (sow_s + 14.0, 6.0)
                }
            }
        };
        let after_s = message.next_epoch_tow_s - start_s - length_s;
        assert!((0.14..1.16).contains(&after_s), "{after_s}");
        starts
            .entry((message.gnss_id, message.sv_id))
            .or_default()
            .push(start_s);
        ends.push(start_s + length_s);
    }
    for ((gnss_id, sv_id), starts) in &starts {
        let (length_s, at_least) = match gnss_id {
            0 => (6.0, 18),
            2 => (2.0, 57),
            _ if *sv_id >= 59 => (0.6, 190),
            _ => (6.0, 17),
        };
        assert!(
            starts.len() >= at_least,
            "{gnss_id} {sv_id} {}",
            starts.len()
        );
        for pair in starts.windows(2) {
            assert!((pair[1] - pair[0] - length_s).abs() < 1e-6);
        }
    }
    let satellites =
        |of: &BTreeSet<(u8, u64)>| of.iter().map(|(sv, _)| *sv).collect::<BTreeSet<_>>();
    for sv_id in satellites(&types) {
        for word_type in [0, 1, 2, 3, 4, 5, 63] {
            assert!(types.contains(&(sv_id, word_type)));
        }
    }
    assert_eq!(pages.len(), 10 * satellites(&pages).len());
    assert!(!pages.is_empty() && !types.is_empty() && !subframes.is_empty());
}

/// The encoder's codes against what satellites sent.
#[test]
fn codes_of_the_encoder_are_those_of_recorded_messages() {
    let mut compared = [0; 3];
    for name in [
        "data/walk0827-x20p-imu/gnss_1730.ubx",
        "data/besancon-f9-coldstart-nominal/16dBatt_no_interference_coldstart.ubx.gz",
    ] {
        let Some(path) = common::shared(name) else {
            continue;
        };
        let stream = read_unzipped(&path).unwrap();
        let mut parser = ParserBuilder::new()
            .with_protocol::<Proto27>()
            .with_vec_buffer();
        let mut packets = parser.consume_ubx(&stream);
        let mut of_recording = [0; 3];
        while let Some(packet) = packets.next() {
            let Ok(UbxPacket::Proto27(PacketRef::RxmSfrbx(sfrbx))) = packet else {
                continue;
            };
            let words: Vec<u32> = sfrbx.dwrd().collect();
            match (sfrbx.gnss_id(), sfrbx.reserved1(), words.len()) {
                (0, 0, 10) => {
                    let (mut d29, mut d30) = (false, false);
                    for packed in words {
                        let word = if d30 { !packed } else { packed };
                        let data = (if d30 { !word } else { word }) >> 6 & 0xff_ffff;
                        assert_eq!(word & 0x3f, parity(data, d29, d30));
                        (d29, d30) = (word & 2 != 0, word & 1 != 0);
                        of_recording[0] += 1;
                    }
                }
                (2, 1, 8) => {
                    let bits: Vec<bool> = words.iter().flat_map(|w| bits_of(*w, 32)).collect();
                    let covered = [&bits[..114], &bits[128..210]].concat();
                    assert_eq!(u64::from(crc24q(&covered)), value(&bits[210..234]));
                    of_recording[1] += 1;
                }
                // B3I carries D1 as B1I does.
                (3, 0 | 4, 10) => {
                    for word in &words[1..] {
                        let bits = bits_of(*word, 30);
                        let check = bch_check(&bits[..11]) << 4 | bch_check(&bits[11..22]);
                        assert_eq!(check, word & 0xff);
                        of_recording[2] += 1;
                    }
                }
                _ => {}
            }
        }
        println!("{name}: {of_recording:?} words of GPS, pages of Galileo, words of BDS");
        compared
            .iter_mut()
            .zip(of_recording)
            .for_each(|(all, one)| *all += one);
        assert!(of_recording[0] > 500 && of_recording[1] > 300);
    }
    assert!(compared == [0; 3] || compared[2] > 1000, "{compared:?}");
}

/// Everything core makes of a stream before and beside the epochs.
fn events(bytes: &[u8]) -> (Vec<Ephemeris>, Vec<KlobucharParameters>) {
    let mut ingest = Box::new(Ingest::EMPTY);
    let mut rest = bytes;
    let (mut ephemerides, mut ionosphere) = (Vec::new(), Vec::new());
    loop {
        let (used, event) = ingest.push(rest);
        rest = &rest[used..];
        match event {
            Event::Ephemeris(ephemeris) => ephemerides.push(ephemeris),
            Event::Klobuchar(parameters) => ionosphere.push(parameters),
            Event::Nothing if rest.is_empty() => return (ephemerides, ionosphere),
            _ => {}
        }
    }
}

/// INT-054. Bit by bit: what core decodes is what the sky broadcasts.
#[test]
fn core_decodes_the_simulated_ephemerides_and_ionosphere() {
    for ionosphere in [Ionosphere::Klobuchar, Ionosphere::KlobucharBds] {
        let mut args = args(Flight::Static, 100.0);
        args.ionosphere = ionosphere;
        let tracked: BTreeSet<Satellite> = epochs(&args)
            .unwrap()
            .last()
            .unwrap()
            .ephemerides
            .iter()
            .map(|e| e.satellite)
            .collect();
        let (ephemerides, parameters) = events(&simulate(&args).unwrap().receiver);
        let sky = Sky::new();
        let mut decoded = BTreeSet::new();
        for ephemeris in &ephemerides {
            let mut slots = sky.slots().iter();
            let slot = slots
                .find(|slot| slot.satellite == ephemeris.satellite)
                .unwrap();
            assert_eq!(*ephemeris, slot.broadcast(38), "{}", ephemeris.satellite);
            decoded.insert(ephemeris.satellite);
        }
        assert_eq!(decoded, tracked);
        let own = ionosphere.parameters().unwrap();
        assert!(parameters.contains(&own), "{parameters:?}");
    }
}

fn reports(bytes: &[u8], config: &Config) -> Vec<EpochReport> {
    let mut monitor = Box::new(Monitor::EMPTY);
    monitor.configure(config).unwrap();
    let mut reports = Vec::new();
    let mut rest = bytes;
    while !rest.is_empty() {
        let (used, ready) = monitor.push(rest);
        rest = &rest[used..];
        if ready == Some(Ready::Epoch) {
            reports.push(monitor.process(&mut NoCounter));
        }
    }
    while monitor.finish() == Ready::Epoch {
        reports.push(monitor.process(&mut NoCounter));
    }
    reports
}

/// As of the RTCM 3 stream: from the end of the first cycle of messages on within 1 cm. Three hours have
/// two changes of ephemeris.
#[test]
fn a_noise_free_fix_from_ubx_is_within_a_centimetre() {
    for (flight, dual_frequency, ionosphere, rate_hz, duration_s) in [
        (Flight::Approach, false, Ionosphere::None, 1.0, 240.0),
        (Flight::Static, true, Ionosphere::Klobuchar, 1.0, 90.0),
        (Flight::Static, false, Ionosphere::Klobuchar, 1.0, 140.0),
        (Flight::Static, false, Ionosphere::None, 0.05, 10_800.0),
    ] {
        let args = Args {
            noise_free: true,
            dual_frequency,
            ionosphere,
            rate_hz,
            ..args(flight, duration_s)
        };
        let config = Config {
            ionosphere: match (dual_frequency, ionosphere) {
                (true, _) => IonosphereModel::IonosphereFree,
                (false, Ionosphere::None) => IonosphereModel::None,
                (false, _) => IonosphereModel::Klobuchar,
            },
            troposphere: TroposphereModel::Saastamoinen,
            ..Config::PRESET
        };
        // Page 18 of subframe 4 comes after 84 s.
        let from_s = if config.ionosphere == IonosphereModel::Klobuchar {
            90.0
        } else {
            20.0
        };
        let reports = reports(&simulate(&args).unwrap().receiver, &config);
        let truth: Vec<_> = epochs(&args).unwrap().collect();
        assert_eq!(reports.len(), truth.len());
        let (mut worst_m, mut worst_mps, mut fixes): (f64, f64, _) = (0.0, 0.0, 0);
        for (report, truth) in reports.iter().zip(&truth) {
            assert_eq!(report.time, truth.observations.time);
            if (report.since_first_ns as f64) < from_s * 1e9 {
                continue;
            }
            assert_eq!(report.verdict.integrity, Integrity::Nominal);
            let fix = report.fix.expect("a full sky gives a position");
            let error = nalgebra::Vector3::from(fix.r_e_m) - truth.antenna.position_e_m;
            worst_m = worst_m.max(error.norm());
            let speed_mps = nalgebra::Vector3::from(fix.velocity_enu_mps.unwrap()).norm();
            worst_mps = worst_mps.max((speed_mps - truth.antenna.velocity_e_mps.norm()).abs());
            fixes += 1;
        }
        println!(
            "{} {rate_hz} Hz {ionosphere:?} dual {dual_frequency}: {fixes} fixes, position {:.2} mm, speed {:.3} mm/s",
            flight.name(),
            1e3 * worst_m,
            1e3 * worst_mps
        );
        assert!(fixes >= 50 && worst_m < 0.01, "{worst_m} m");
        assert!(worst_mps < 0.01, "{worst_mps} m/s");
    }
}

/// A flight with an inertial unit: the receiver measures 2 ms before the folder's epochs.
#[test]
fn the_receiver_of_a_flight_writes_ubx_too() {
    let flown = fly(&Request {
        duration_s: Some(60),
        noise_free: true,
        galileo: true,
        ..Request::new(Flight::Lpv200, 2)
    })
    .unwrap();
    let radio = Radio {
        dual_frequency: false,
        ionosphere: Ionosphere::None,
        troposphere: true,
        format: Format::Ubx,
    };
    let config = Config {
        ionosphere: IonosphereModel::None,
        ..Config::PRESET
    };
    let reports = reports(&receiver_bytes(&flown, &radio).unwrap(), &config);
    assert_eq!(reports.len(), flown.epochs.len());
    let mut worst_m: f64 = 0.0;
    for report in reports.iter().filter(|r| r.since_first_ns > 20_000_000_000) {
        let t_s = report.time.seconds_since(flown.start);
        assert!((t_s - t_s.round() + 0.002).abs() < 1e-9);
        let true_s = t_s - flown.clock.bias_s(t_s);
        let truth = flown.trajectory.state(true_s).r_eb_e;
        let fix = report.fix.expect("a full sky gives a position");
        worst_m = worst_m.max((nalgebra::Vector3::from(fix.r_e_m) - truth).norm());
    }
    println!("flight: position {:.2} mm", 1e3 * worst_m);
    assert!(worst_m < 0.01, "{worst_m} m");
}

/// Samples of the unit stand between the receiver's frames, so that tight mode follows the first position.
#[test]
fn a_flight_of_ubx_and_inertial_samples_is_flown_in_tight_mode() {
    let flown = fly(&Request {
        duration_s: Some(60),
        galileo: true,
        ..Request::new(Flight::Lpv200, 2)
    })
    .unwrap();
    let radio = Radio {
        dual_frequency: false,
        ionosphere: Ionosphere::None,
        troposphere: true,
        format: Format::Ubx,
    };
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("simulate_ubx");
    std::fs::create_dir_all(&folder).unwrap();
    let (gnss, imu) = (folder.join("receiver.ubx"), folder.join("imu.sfx"));
    std::fs::write(&gnss, receiver_bytes(&flown, &radio).unwrap()).unwrap();
    std::fs::write(&imu, imu_bytes(&flown).unwrap()).unwrap();
    let mut options = ReplayOptions::new(gnss);
    options.imu = vec![imu];
    options.config.ionosphere = IonosphereModel::None;
    let reports = replay::run(&options, &mut |_, _| {}).unwrap().reports;
    let tight = reports
        .iter()
        .filter(|report| report.mode == Mode::Tight)
        .count();
    println!("{tight} of {} epochs in tight mode", reports.len());
    assert_eq!(reports.len(), 61);
    assert!(tight >= 35, "{tight}");
}
