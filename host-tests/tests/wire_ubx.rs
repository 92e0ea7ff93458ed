//! The UBX decoder against an independent one (the crate ublox) and against RINEX files that RTKLIB made of
//! the same recordings.

mod common;

use std::collections::BTreeMap;

use surefix_core::gnss::{ObservationEpoch, SignalObservation};
use surefix_core::ingest::{Event, Ingest, receiver_fix};
use surefix_core::time::GpsTime;
use surefix_core::wire::ubx::pvt::Carrier;
use surefix_core::wire::{Counters, ubx};
use surefix_host_tests::mutate::Known;
use surefix_host_tests::rinex::{self, ObservationReader, read_unzipped};
use surefix_host_tests::simulate::disturbances::Disturbances;
use surefix_host_tests::simulate::stream::Format;
use surefix_host_tests::simulate::{Args, atmosphere::Ionosphere, flight::Flight, simulate};
use ublox::nav_pvt::common::NavPvtFlags;
use ublox::proto27::{PacketRef, Proto27};
use ublox::{ParserBuilder, UbxPacket};

const WALK: &str = "data/walk0827-x20p-imu/gnss_1730.ubx";
const SPIRENT: &str = "data/instinct-spirent-f9p-ubx/Spirent_ublox-F9P_static_duration-15min_sys-GPS-GAL_iono-Klobuchar_tropo-Saastamoinen";
const BESANCON: &str =
    "data/besancon-f9-coldstart-nominal/16dBatt_no_interference_coldstart.ubx.gz";
const F9T: &str = "data/ubx-parser-corpus/F9T-L2-5min.ubx.gz";
const F9H: &str = "data/ubx-parser-corpus/swift_rxm_rawx.ubx";
const M8: &str = "data/ubx-parser-corpus/swift_rxm_sfrbx_glo.ubx";

fn decode(stream: &[u8]) -> (Vec<ObservationEpoch>, Counters) {
    let mut ingest = Box::new(Ingest::EMPTY);
    let mut epochs = Vec::new();
    let mut rest = stream;
    loop {
        let (used, event) = ingest.push(rest);
        rest = &rest[used..];
        match event {
            Event::EpochReady => epochs.push(ingest.epoch().clone()),
            Event::Nothing if rest.is_empty() => break,
            _ => {}
        }
    }
    while ingest.finish() != Event::EndOfStream {}
    (epochs, *ingest.counters())
}

/// Measurements with a valid pseudorange by the ublox crate, per message, with gnssId, svId, sigId.
fn peer(stream: &[u8]) -> Vec<(f64, u16, Vec<[u8; 3]>)> {
    let mut parser = ParserBuilder::new()
        .with_protocol::<Proto27>()
        .with_vec_buffer();
    let mut packets = parser.consume_ubx(stream);
    let mut messages = Vec::new();
    while let Some(packet) = packets.next() {
        if let Ok(UbxPacket::Proto27(PacketRef::RxmRawx(rawx))) = packet {
            let measured = rawx
                .measurements()
                .filter(|m| m.trk_stat().bits() & 1 != 0)
                .map(|m| [m.gnss_id(), m.sv_id(), m.reserved2()])
                .collect();
            messages.push((rawx.rcv_tow(), rawx.week(), measured));
        }
    }
    messages
}

/// INT-051.
#[test]
fn every_observation_is_what_the_ublox_crate_reads_and_none_is_missing() {
    for (name, expected) in [
        (WALK, 536),
        (&format!("{SPIRENT}.ubx"), 1600),
        (BESANCON, 562),
        (F9T, 299),
        (F9H, 2),
        (M8, 69),
    ] {
        let Some(path) = common::shared(name) else {
            continue;
        };
        let stream = read_unzipped(&path).unwrap();
        let (epochs, counters) = decode(&stream);
        assert_eq!(epochs.len(), expected, "{name}");
        // Values: every observation is one of those the crate reads.
        let known = Known::of_frames_with_a_right_sum(&stream);
        let ours = Known::of(&stream);
        let mut observations = 0;
        for sent in ours.observations() {
            assert!(known.contains(sent), "{name}: {sent:?}");
            observations += 1;
        }
        // Numbers: none that is navigated with is missing.
        let messages: Vec<_> = peer(&stream).into_iter().filter(|m| m.1 != 0).collect();
        assert_eq!(messages.len(), expected, "{name}");
        for (epoch, (tow_s, week, measured)) in epochs.iter().zip(&messages) {
            let time = GpsTime::from_week_tow_ns((*week).into(), (tow_s * 1e9).round() as i64);
            assert_eq!(epoch.time, time, "{name}");
            let navigated = measured
                .iter()
                .filter(|[gnss_id, ..]| [0, 2, 3].contains(gnss_id));
            let signals: usize = epoch.satellites.iter().map(|s| s.signals.len()).sum();
            assert_eq!(signals, navigated.count(), "{name} at {tow_s} s");
        }
        assert_eq!(
            counters.signals_lost + counters.satellites_lost,
            0,
            "{name}"
        );
        assert_eq!(counters.duplicate_observations, 0, "{name}");
        eprintln!(
            "{name}: {} epochs, {observations} different observations, all as the ublox crate reads them",
            epochs.len()
        );
    }
}

/// INT-120. The receiver's own solutions are what the ublox crate reads of them, and none is missing.
#[test]
fn int_120_every_nav_pvt_is_what_the_ublox_crate_reads() {
    for (name, at_least) in [(WALK, 536), (&format!("{SPIRENT}.ubx"), 0), (BESANCON, 0)] {
        let Some(path) = common::shared(name) else {
            continue;
        };
        let stream = read_unzipped(&path).unwrap();
        let mut ours = Vec::new();
        for start in stream
            .windows(4)
            .enumerate()
            .filter(|(_, head)| head[..2] == ubx::PREAMBLE && head[2..] == ubx::NAV_PVT)
            .map(|(start, _)| start)
        {
            if let Ok((frame, _)) = ubx::Frame::parse(&stream[start..]) {
                ours.push(ubx::NavPvt::parse(frame.payload).unwrap());
            }
        }
        let mut parser = ParserBuilder::new()
            .with_protocol::<Proto27>()
            .with_vec_buffer();
        let mut packets = parser.consume_ubx(&stream);
        let (mut theirs, mut positions) = (0, 0);
        while let Some(packet) = packets.next() {
            let Ok(UbxPacket::Proto27(PacketRef::NavPvt(pvt))) = packet else {
                continue;
            };
            let our = ours[theirs];
            theirs += 1;
            assert_eq!(our.itow_ms, pvt.itow());
            if let Some(date) = our.date_utc {
                assert_eq!(date, (pvt.year(), pvt.month(), pvt.day()));
            }
            assert_eq!(our.satellites, pvt.num_satellites());
            assert_eq!(our.fix_ok, pvt.flags().contains(NavPvtFlags::GPS_FIX_OK));
            assert_eq!(
                our.is_differential,
                pvt.flags().contains(NavPvtFlags::DIFF_SOLN)
            );
            let of_carrier = match our.carrier {
                Carrier::None => NavPvtFlags::empty(),
                Carrier::Float => NavPvtFlags::CARR_SOLN_FLOAT,
                Carrier::Fixed => NavPvtFlags::CARR_SOLN_FIXED,
            };
            let both = NavPvtFlags::CARR_SOLN_FLOAT | NavPvtFlags::CARR_SOLN_FIXED;
            assert_eq!((pvt.flags() & both).bits(), of_carrier.bits());
            if !our.is_position() {
                continue;
            }
            positions += 1;
            let fix = receiver_fix(&our).unwrap();
            assert_eq!(fix.time.tow_ns(), i64::from(pvt.itow()) * 1_000_000);
            let solution = fix.solution.unwrap();
            let near = |a: f64, b: f64| (a - b).abs() <= 1e-9 * b.abs().max(1.0);
            assert!(near(solution.llh.lat_rad.to_degrees(), pvt.latitude()));
            assert!(near(solution.llh.lon_rad.to_degrees(), pvt.longitude()));
            assert!(near(solution.llh.height_m, pvt.height_above_ellipsoid()));
            assert!(near(
                solution.horizontal_accuracy_m,
                pvt.horizontal_accuracy()
            ));
            assert!(near(solution.vertical_accuracy_m, pvt.vertical_accuracy()));
            let velocity = solution.velocity.unwrap();
            let [north, east, down] = velocity.ned_mps;
            assert!(near(north, pvt.vel_north()));
            assert!(near(east, pvt.vel_east()));
            assert!(near(down, pvt.vel_down()));
            assert!(near(velocity.accuracy_mps, pvt.speed_accuracy()));
        }
        assert_eq!(ours.len(), theirs, "{name}");
        assert!(positions >= at_least, "{name}: {positions}");
        eprintln!(
            "{name}: {theirs} NAV-PVT, {positions} with a position, as the ublox crate reads them"
        );
    }
}

/// INT-051. A reference station's observations on the line of a u-blox receiver are never taken for its own: not
/// before it knows the week, and not when it is silent.
#[test]
fn a_reference_station_on_the_line_gives_no_epoch() {
    let simulated = |name: Flight, receiver: Format| {
        let args = Args {
            name,
            seed: 1,
            out: std::path::PathBuf::new(),
            rate_hz: 1.0,
            duration: Some(20.0),
            noise_free: false,
            dual_frequency: false,
            no_troposphere: false,
            ionosphere: Ionosphere::None,
            receiver,
            faults: Vec::new(),
            disturbances: Disturbances::default(),
        };
        simulate(&args).unwrap().receiver
    };
    let station = simulated(Flight::Static, Format::Rtcm3);
    let rover = simulated(Flight::Approach, Format::Ubx);
    let (of_station, _) = decode(&station);
    let (of_rover, _) = decode(&rover);
    assert!(of_station.len() == 21 && of_rover.len() == 21);
    // RXM-RAWX before the week is known: a head without a measurement.
    let mut content = vec![0; 16];
    content[..8].copy_from_slice(&18.0_f64.to_le_bytes());
    content[13] = 1;
    let mut ignorant = ubx::PREAMBLE.to_vec();
    ignorant.extend(ubx::RXM_RAWX);
    ignorant.extend(16_u16.to_le_bytes());
    ignorant.extend(content);
    let sum = ubx::checksum(&ignorant[2..]);
    ignorant.extend(sum);
    let (epochs, counters) = decode(&[&ignorant[..], &station].concat());
    assert_eq!((epochs.len(), counters.rawx_without_week), (0, 1));
    assert!(counters.observations_of_another_source > 20);
    // The station first: its epochs end with the first of the rover, and come back with nothing.
    let (epochs, _) = decode(&[&station[..], &rover, &station].concat());
    assert_eq!(epochs.len(), 42);
    assert_eq!(epochs[21..], of_rover);
}

/// Observations by satellite and carrier; RTKLIB has names of its own for the channels of a signal.
fn by_carrier(epoch: &ObservationEpoch) -> BTreeMap<(String, u64), SignalObservation> {
    epoch
        .satellites
        .iter()
        .flat_map(|s| s.signals.iter().map(move |o| (s.satellite, *o)))
        .filter_map(|(satellite, o)| {
            let frequency_hz = o.signal.frequency_hz(satellite.system())?;
            Some(((satellite.to_string(), frequency_hz as u64), o))
        })
        .collect()
}

/// INT-051.
#[test]
fn observations_are_those_of_rinex_files_that_rtklib_made() {
    for (stream, obs, at_least) in [
        (
            WALK.to_owned(),
            "data/walk0827-x20p-imu/derived_convbin.obs".to_owned(),
            25_000,
        ),
        (format!("{SPIRENT}.ubx"), format!("{SPIRENT}.obs"), 25_000),
    ] {
        let (Some(stream), Some(obs)) = (common::shared(&stream), common::shared(&obs)) else {
            continue;
        };
        let (epochs, _) = decode(&read_unzipped(&stream).unwrap());
        let times: BTreeMap<i64, &ObservationEpoch> = epochs
            .iter()
            .map(|epoch| (epoch.time.ns() / 1_000_000, epoch))
            .collect();
        let (text, _) = rinex::text_of(read_unzipped(&obs).unwrap()).unwrap();
        let mut reader = ObservationReader::new(&text).unwrap();
        let mut theirs = ObservationEpoch::EMPTY;
        let (mut compared, mut absent, mut dopplers) = (0, 0, 0);
        while reader.next_epoch(&mut theirs) {
            let ours = by_carrier(times[&(theirs.time.ns() / 1_000_000)]);
            for (key, their) in by_carrier(&theirs) {
                let Some(their_m) = their.pseudorange_m else {
                    continue;
                };
                // RTKLIB writes pseudoranges without their validity bit too.
                let Some(our) = ours.get(&key) else {
                    absent += 1;
                    continue;
                };
                assert!(
                    (our.pseudorange_m.unwrap() - their_m).abs() <= 0.000_51,
                    "{key:?}"
                );
                if let (Some(our), Some(their)) = (our.range_rate_mps, their.range_rate_mps) {
                    // To 0.5 mHz of Doppler.
                    assert!((our - their).abs() < 0.000_2, "{key:?}");
                    dopplers += 1;
                }
                assert_eq!(our.cn0_dbhz, their.cn0_dbhz, "{key:?}");
                compared += 1;
            }
        }
        eprintln!(
            "{}: {compared} pseudoranges and {dopplers} range rates equal, {absent} without their validity bit",
            obs.display()
        );
        assert!(compared > at_least && dopplers > at_least && absent * 50 < compared);
    }
}
