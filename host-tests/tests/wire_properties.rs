//! Whatever happens to a valid stream on its way, nothing panics, and every observation that comes out
//! is one of the undamaged stream's: same satellite, signal, time of week and values.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::OnceLock;

use proptest::prelude::*;
use rtcm_rs::msg::{
    BdsSigId, GpsSigId, Msg1019T, Msg1077Data, Msg1077Sig, Msg1077T, Msg1124Data, Msg1124Sig,
    Msg1124T, Msm46Sat, Msm57Sat,
};
use rtcm_rs::{Message, MessageBuilder};
use surefix_core::gnss::{ObservationEpoch, Satellite, Signal, SignalObservation, System};
use surefix_core::ingest::{self, Event, Ingest, MAX_EPOCH_BYTES};
use surefix_core::time::GpsTime;
use surefix_core::wire::Counters;

fn rtcm3(message: Message) -> Vec<u8> {
    MessageBuilder::new()
        .build_message(&message)
        .unwrap()
        .to_vec()
}

/// MSM7 of GPS and MSM4 of BDS of one epoch, encoded by rtcm-rs.
fn rtcm3_epoch(tow_ms: u32, seed: u32) -> Vec<Vec<u8>> {
    let value = |i: u32, range: u32| f64::from((i + seed).wrapping_mul(2_654_435_761) % range);
    let mut gps = Msg1077Data::default();
    for prn in [3_u8, 8, 17, 32] {
        let i = u32::from(prn);
        gps.satellite_data.push(Msm57Sat {
            satellite_id: prn,
            gnss_satellite_rough_range_integer_ms: Some(68 + prn % 20),
            reserved_8_4: 0,
            gnss_satellite_rough_range_mod1ms_ms: value(i, 1024) / 1024.0,
            gnss_satellite_rough_phaserange_rates_m_s: Some(-500 + 30 * i as i16),
        });
        for (band, attribute) in [(1, 'C'), (2, 'W')] {
            gps.signal_data.push(Msg1077Sig {
                satellite_id: prn,
                signal_id: GpsSigId::new(band, attribute),
                gnss_signal_fine_pseudorange_ext_ms: (prn != 8 || band == 1)
                    .then(|| value(i * 7 + u32::from(band), 1 << 19) / f64::from(1 << 29)),
                gnss_signal_fine_phaserange_ext_ms: Some(
                    value(i * 11, 1 << 23) / f64::from(1_u32 << 31),
                ),
                gnss_phaserange_lock_time_ext_ind: 300,
                half_cycle_ambiguity_ind: 0,
                gnss_signal_cnr_ext_dbhz: Some(30.0 + value(i * 3, 320) / 16.0),
                gnss_signal_fine_phaserange_rate_m_s: Some(value(i * 13, 10_000) / 1e4),
            });
        }
    }
    let mut bds = Msg1124Data::default();
    for prn in [2_u8, 19, 36] {
        let i = u32::from(prn);
        bds.satellite_data.push(Msm46Sat {
            satellite_id: prn,
            gnss_satellite_rough_range_integer_ms: Some(80 + prn % 40),
            gnss_satellite_rough_range_mod1ms_ms: value(i, 1024) / 1024.0,
        });
        bds.signal_data.push(Msg1124Sig {
            satellite_id: prn,
            signal_id: BdsSigId::new(2, 'I'),
            gnss_signal_fine_pseudorange_ms: Some(value(i * 5, 1 << 14) / f64::from(1 << 24)),
            gnss_signal_fine_phaserange_ms: Some(value(i * 17, 1 << 21) / f64::from(1 << 29)),
            gnss_phaserange_lock_time_ind: 9,
            half_cycle_ambiguity_ind: 1,
            gnss_signal_cnr_dbhz: Some(30 + prn % 20),
        });
    }
    vec![
        rtcm3(Message::Msg1077(Msg1077T {
            gps_epoch_time_ms: tow_ms,
            msm_multiple_message_flag: 1,
            data_segment: gps,
            ..Default::default()
        })),
        rtcm3(Message::Msg1124(Msg1124T {
            bds_epoch_time_ms: (tow_ms + 604_800_000 - 14_000) % 604_800_000,
            msm_multiple_message_flag: 0,
            data_segment: bds,
            ..Default::default()
        })),
    ]
}

fn native_epoch(tow_s: i64, seed: u8) -> Vec<u8> {
    let mut epoch = ObservationEpoch::EMPTY;
    epoch.restart(GpsTime::from_week_tow_s(2010, tow_s));
    for index in (0..Satellite::COUNT).step_by(9) {
        for (band, attribute) in [(b'1', b'C'), (b'5', b'Q'), (b'7', b'X')] {
            let mut observation = SignalObservation::new(Signal::new(band, attribute).unwrap());
            observation.pseudorange_m = Some(2.1e7 + index as f64 * 1.1 + f64::from(band));
            observation.carrier_phase_cycles = Some(1.1e8 / f64::from(seed + 1));
            observation.range_rate_mps = (index % 2 == 0).then_some(-0.1 * f64::from(seed));
            observation.cn0_dbhz = Some(40.25);
            let satellite = Satellite::from_index(index).unwrap();
            epoch.add(satellite, observation).unwrap();
        }
    }
    let mut out = vec![0; MAX_EPOCH_BYTES];
    let len = ingest::encode_observations(&epoch, &mut out).unwrap();
    out[..len].to_vec()
}

/// The pieces of a stream in which every kind of frame occurs, with NMEA and noise between.
fn pieces() -> &'static Vec<Vec<u8>> {
    static PIECES: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    PIECES.get_or_init(|| {
        let mut pieces = Vec::new();
        let recording = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
            .join("../../shared/data/rtcm3-str1-week-rollover-2018/week-rollover-STR17.rtcm3");
        match std::fs::read(recording) {
            // 20 s of a receiver, cut anywhere.
            Ok(stream) => pieces.extend(stream[..39_000].chunks(1300).map(<[u8]>::to_vec)),
            Err(_) => eprintln!("SKIPPED: the recording of ../shared is absent from the stream"),
        }
        for k in 0..12_u32 {
            // Across the rollover of the GPS week.
            let tow_ms = (604_795_000 + k * 1000) % 604_800_000;
            pieces.extend(rtcm3_epoch(tow_ms, k * 1000));
            pieces.push(
                b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n".to_vec(),
            );
            if k % 4 == 1 {
                pieces.push(rtcm3(Message::Msg1019(Msg1019T {
                    gps_satellite_id: 3,
                    gps_week_number: 985,
                    toe_s: 597_600.0,
                    toc_s: 597_600.0,
                    sqrt_a_sqrt_m: 5153.7,
                    ..Default::default()
                })));
            }
            if k % 3 == 2 {
                pieces.push(b"\xd3\x00noise\xffSF\x01\x02\xd3".to_vec());
            }
        }
        for k in 0..6 {
            pieces.push(native_epoch(3600 + i64::from(k), k as u8));
        }
        pieces
    })
}

/// Satellite, signal, time of week.
type Key = (usize, Signal, i64);
/// Bits of the values.
type Values = (Option<u64>, Option<u64>, Option<u64>, Option<u32>);

#[derive(PartialEq, Debug)]
struct Outcome {
    observations: Vec<(Key, Values)>,
    epochs: usize,
    ephemerides: usize,
    counters: Counters,
}

fn run(stream: &[u8], mut chunk_sizes: impl Iterator<Item = usize>) -> Outcome {
    let mut ingest = Box::new(Ingest::EMPTY);
    let mut outcome = Outcome {
        observations: Vec::new(),
        epochs: 0,
        ephemerides: 0,
        counters: Counters::ZERO,
    };
    let mut take = |event: Event, ingest: &Ingest| match event {
        Event::EpochReady => {
            outcome.epochs += 1;
            let epoch = ingest.epoch();
            for satellite in &epoch.satellites {
                for o in &satellite.signals {
                    let key = (satellite.satellite.index(), o.signal, epoch.time.tow_ns());
                    let values = (
                        o.pseudorange_m.map(f64::to_bits),
                        o.carrier_phase_cycles.map(f64::to_bits),
                        o.range_rate_mps.map(f64::to_bits),
                        o.cn0_dbhz.map(f32::to_bits),
                    );
                    outcome.observations.push((key, values));
                }
            }
        }
        Event::Ephemeris(_) => outcome.ephemerides += 1,
        _ => {}
    };
    let mut rest = stream;
    while !rest.is_empty() {
        let size = chunk_sizes
            .next()
            .unwrap_or(rest.len())
            .clamp(1, rest.len());
        let (mut chunk, later) = rest.split_at(size);
        rest = later;
        loop {
            let (used, event) = ingest.push(chunk);
            chunk = &chunk[used..];
            if event == Event::Nothing {
                assert!(chunk.is_empty(), "all bytes are used");
                break;
            }
            take(event, &ingest);
        }
    }
    let mut calls = 0;
    loop {
        let event = ingest.finish();
        calls += 1;
        assert!(calls < 100, "the end comes");
        if event == Event::EndOfStream {
            break;
        }
        take(event, &ingest);
    }
    outcome.counters = *ingest.counters();
    outcome
}

fn undamaged() -> &'static BTreeMap<Key, Values> {
    static MAP: OnceLock<BTreeMap<Key, Values>> = OnceLock::new();
    MAP.get_or_init(|| {
        let stream = pieces().concat();
        let outcome = run(&stream, std::iter::repeat(stream.len()));
        let count = outcome.observations.len();
        let map: BTreeMap<_, _> = outcome.observations.into_iter().collect();
        assert_eq!(map.len(), count, "nothing twice in the undamaged stream");
        assert!(map.len() > 400 && outcome.ephemerides >= 3 && outcome.epochs >= 18);
        assert_eq!(outcome.counters.invalid_pseudoranges, 12 + count_invalid());
        map
    })
}

/// Invalid pseudoranges of the recording's part, known from a run over it alone.
fn count_invalid() -> u32 {
    let recording: Vec<u8> = pieces()
        .iter()
        .take_while(|piece| piece.len() == 1300)
        .flatten()
        .copied()
        .collect();
    run(&recording, std::iter::repeat(1300))
        .counters
        .invalid_pseudoranges
}

#[derive(Clone, Debug)]
enum Damage {
    /// One bit changes.
    Flip { at: usize, bit: u8 },
    /// Bytes are lost.
    Delete { at: usize, len: usize },
    /// Bytes come in.
    Insert { at: usize, bytes: Vec<u8> },
    /// A part comes twice.
    Duplicate { at: usize, len: usize },
    /// Two parts change places.
    Swap { at: usize, len: usize },
    /// The rest is lost.
    Cut { at: usize },
}

fn damage() -> impl Strategy<Value = Damage> {
    let at = any::<usize>;
    prop_oneof![
        4 => (at(), 0_u8..8).prop_map(|(at, bit)| Damage::Flip { at, bit }),
        2 => (at(), 1_usize..3000).prop_map(|(at, len)| Damage::Delete { at, len }),
        2 => (at(), proptest::collection::vec(prop_oneof![any::<u8>(), Just(0xD3), Just(0x53), Just(0x46), Just(0)], 1..1500))
            .prop_map(|(at, bytes)| Damage::Insert { at, bytes }),
        2 => (at(), 1_usize..20_000).prop_map(|(at, len)| Damage::Duplicate { at, len }),
        2 => (at(), 1_usize..5000).prop_map(|(at, len)| Damage::Swap { at, len }),
        1 => at().prop_map(|at| Damage::Cut { at }),
    ]
}

fn apply(stream: &mut Vec<u8>, damage: &Damage) {
    if stream.is_empty() {
        return;
    }
    let n = stream.len();
    let range = |at: usize, len: usize| (at % n)..(at % n + len).min(n);
    match damage {
        Damage::Flip { at, bit } => stream[at % n] ^= 1 << bit,
        Damage::Delete { at, len } => drop(stream.drain(range(*at, *len))),
        Damage::Insert { at, bytes } => {
            let at = at % n;
            stream.splice(at..at, bytes.iter().copied());
        }
        Damage::Duplicate { at, len } => {
            let part = stream[range(*at, *len)].to_vec();
            let at = (at % n + part.len()).min(n);
            stream.splice(at..at, part);
        }
        Damage::Swap { at, len } => {
            let first = range(*at, *len);
            let second = first.end..(first.end + len).min(n);
            let swapped = [&stream[second.clone()], &stream[first.clone()]].concat();
            stream.splice(first.start..second.end, swapped);
        }
        Damage::Cut { at } => stream.truncate(at % n),
    }
}

/// Every observation is one of the undamaged stream's.
fn assert_all_known(outcome: &Outcome) -> Result<(), TestCaseError> {
    let known = undamaged();
    for (key, values) in &outcome.observations {
        prop_assert_eq!(known.get(key), Some(values), "{:?}", key);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    /// INT-005.
    #[test]
    fn damaged_streams_give_no_observation_that_was_not_sent(
        damages in proptest::collection::vec(damage(), 0..12),
        chunks in proptest::collection::vec(1_usize..2500, 1..40),
    ) {
        let mut stream = pieces().concat();
        for damage in &damages {
            apply(&mut stream, damage);
        }
        let outcome = run(&stream, chunks.iter().copied().cycle());
        assert_all_known(&outcome)?;
        // The same in one piece.
        prop_assert_eq!(run(&stream, std::iter::empty()), outcome);
    }

    /// INT-005.
    #[test]
    fn pieces_in_any_order_give_no_observation_that_was_not_sent(
        order in proptest::collection::vec(any::<usize>(), 0..80),
    ) {
        let stream: Vec<u8> = order
            .iter()
            .flat_map(|index| &pieces()[index % pieces().len()])
            .copied()
            .collect();
        assert_all_known(&run(&stream, std::iter::repeat(311)))?;
    }

    /// INT-005.
    #[test]
    fn noise_never_panics(noise in proptest::collection::vec(any::<u8>(), 0..6000)) {
        let outcome = run(&noise, std::iter::repeat(97));
        prop_assert_eq!(outcome.observations.len(), 0);
        // Every byte is accounted for, unless chance wrote a line.
        let counters = outcome.counters;
        let is_all_noise = counters.noise_bytes as usize == noise.len();
        prop_assert!(is_all_noise || counters.nmea_lines > 0);
    }

    /// INT-005. Frames with right checksums around any content.
    #[test]
    fn any_content_of_a_right_frame_never_panics(
        contents in proptest::collection::vec((0_usize..20, proptest::collection::vec(any::<u8>(), 0..1023), any::<bool>()), 1..12),
    ) {
        const NUMBERS: [u16; 20] = [
            1005, 1006, 1019, 1042, 1045, 1046, 1071, 1074, 1075, 1076, 1077, 1087, 1094, 1097,
            1117, 1124, 1125, 1126, 1127, 1137,
        ];
        let mut stream = Vec::new();
        for (number, content, is_sparse) in contents {
            let mut content = content;
            if content.len() >= 22 {
                let number = NUMBERS[number];
                content[0] = (number >> 4) as u8;
                content[1] = (number << 4) as u8 | content[1] & 0xF;
                // Masks with few bits, so that cells fit; a time within the week.
                if is_sparse {
                    content[3] &= 0x3F;
                    content[9..17].fill(0x10);
                    content[17..22].fill(0x08);
                }
            }
            stream.extend([0xD3, (content.len() >> 8) as u8, content.len() as u8]);
            stream.extend(&content);
            let frame_at = stream.len() - content.len() - 3;
            let crc = surefix_core::wire::crc::crc24q(&stream[frame_at..]);
            stream.extend(&crc.to_be_bytes()[1..]);
        }
        let whole = run(&stream, std::iter::empty());
        prop_assert_eq!(run(&stream, std::iter::repeat(13)), whole);
    }
}

#[test]
fn undamaged_stream_gives_what_was_encoded() {
    let known = undamaged();
    // From the encoder's side: G03 1C of the first epoch.
    let key = (
        Satellite::new(System::Gps, 3).unwrap().index(),
        Signal::C1C,
        604_795_000_000_000,
    );
    let (pseudorange, _, rate, _) = known[&key];
    let value = |i: u32, range: u32| f64::from(i.wrapping_mul(2_654_435_761) % range);
    let ms = 71.0 + value(3, 1024) / 1024.0 + value(22, 1 << 19) / f64::from(1 << 29);
    assert_eq!(pseudorange, Some((ms * 299_792.458_f64).to_bits()));
    let rate_mps = f64::from_bits(rate.unwrap());
    assert!((rate_mps - (-410.0 + value(39, 10_000) / 1e4)).abs() < 1e-9);
}
