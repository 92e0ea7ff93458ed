//! Subframes and pages of recordings, found by the `ublox` crate, give the ephemerides that RTKLIB
//! wrote into the navigation files beside them, and no damage gives another.

mod common;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use common::shared;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use surefix_core::gnss::orbit::position_velocity;
use surefix_core::gnss::{Ephemeris, NavMessage, Satellite, System};
use surefix_core::time::GpsTime;
use surefix_core::wire::broadcast::{
    BroadcastEphemeris, BroadcastKlobuchar, Collected, Collector, Source, Subframe, SubframeError,
};
use surefix_host_tests::rinex::{NavigationFile, read_unzipped, text_of};
use ublox::proto27::{PacketRef, Proto27};
use ublox::{ParserBuilder, UbxPacket};

/// π as the interface documents and RTKLIB have it.
#[expect(clippy::approx_constant, reason = "the documents give these digits")]
const PI_BROADCAST: f64 = 3.141_592_653_589_8;

/// What is in one RXM-SFRBX.
#[derive(Clone, Debug)]
struct Recorded {
    gnss_id: u8,
    sv_id: u8,
    sig_id: u8,
    words: Vec<u8>,
}

impl Recorded {
    fn subframe(&self) -> Subframe<'_> {
        Subframe {
            gnss_id: self.gnss_id,
            sv_id: self.sv_id,
            sig_id: self.sig_id,
            words: &self.words,
        }
    }
}

/// The RXM-SFRBX of a recording, in order.
fn recorded(path: &Path) -> Vec<Recorded> {
    let bytes = read_unzipped(path).unwrap();
    let mut parser = ParserBuilder::new()
        .with_protocol::<Proto27>()
        .with_vec_buffer();
    let mut out = Vec::new();
    let mut packets = parser.consume_ubx(&bytes);
    while let Some(packet) = packets.next() {
        if let Ok(UbxPacket::Proto27(PacketRef::RxmSfrbx(sfrbx))) = packet {
            out.push(Recorded {
                gnss_id: sfrbx.gnss_id(),
                sv_id: sfrbx.sv_id(),
                sig_id: sfrbx.reserved1(),
                words: sfrbx.dwrd().flat_map(u32::to_le_bytes).collect(),
            });
        }
    }
    out
}

/// What becomes of a subframe that nothing was heard before.
fn alone(one: &Recorded) -> Result<Collected, SubframeError> {
    let mut collector = Collector::EMPTY;
    collector.take(&one.subframe())
}

/// What a collector makes of a recording.
#[derive(Default)]
struct Heard {
    /// Every ephemeris that differs from those before it.
    ephemerides: Vec<BroadcastEphemeris>,
    /// How often one was given.
    n_given: usize,
    klobuchar: Vec<BroadcastKlobuchar>,
    refused: BTreeMap<(u8, u8, &'static str), usize>,
}

fn name_of(error: SubframeError) -> &'static str {
    match error {
        SubframeError::Unsupported => "unsupported",
        SubframeError::Satellite => "satellite",
        SubframeError::Length => "length",
        SubframeError::Parity => "parity",
        SubframeError::Checksum => "checksum",
        SubframeError::Preamble => "preamble",
        SubframeError::Number => "number",
        SubframeError::Time => "time",
        SubframeError::IllegalValue => "illegal value",
    }
}

fn hear(recording: &[Recorded]) -> Heard {
    let mut collector = Collector::EMPTY;
    let mut heard = Heard::default();
    for one in recording {
        match collector.take(&one.subframe()) {
            Ok(Collected {
                ephemeris,
                klobuchar,
            }) => {
                if let Some(ephemeris) = ephemeris {
                    heard.n_given += 1;
                    if !heard.ephemerides.contains(&ephemeris) {
                        heard.ephemerides.push(ephemeris);
                    }
                }
                heard.klobuchar.extend(klobuchar);
            }
            Err(error) => {
                *heard
                    .refused
                    .entry((one.gnss_id, one.sig_id, name_of(error)))
                    .or_default() += 1;
            }
        }
    }
    heard
}

fn satellite_of(e: &BroadcastEphemeris) -> Satellite {
    let system = match e.source {
        Source::GpsLnav => System::Gps,
        Source::GalileoInav | Source::GalileoFnav => System::Galileo,
        Source::BdsD1D2 => System::Bds,
    };
    Satellite::new(system, e.satellite).unwrap()
}

fn message_of(e: &BroadcastEphemeris) -> NavMessage {
    match e.source {
        Source::GpsLnav => NavMessage::GpsLnav,
        Source::GalileoInav => NavMessage::GalileoInav,
        Source::GalileoFnav => NavMessage::GalileoFnav,
        Source::BdsD1D2 => NavMessage::BdsD1D2,
    }
}

/// Week and second of the week of an instant, in the week count of the message.
fn in_own_week(e: &BroadcastEphemeris, time: GpsTime) -> (i32, u32) {
    let own = match e.source {
        Source::BdsD1D2 => time.plus_ns(-14_000_000_000),
        _ => time,
    };
    let week = match e.source {
        Source::GpsLnav => own.week() % 1024,
        Source::BdsD1D2 => own.week() - 1356,
        _ => own.week() - 1024,
    };
    (week, own.tow_s() as u32)
}

/// Compares every field; the file has twelve digits.
fn assert_same(o: &BroadcastEphemeris, file: &Ephemeris, what: &str) -> usize {
    let pi = PI_BROADCAST;
    let fields = [
        (o.sqrt_a, file.sqrt_a, "sqrt_a"),
        (o.eccentricity, file.eccentricity, "eccentricity"),
        (o.i0_sc * pi, file.i0_rad, "i0"),
        (o.idot_scps * pi, file.idot_radps, "idot"),
        (o.omega0_sc * pi, file.omega0_rad, "omega0"),
        (o.omega_dot_scps * pi, file.omega_dot_radps, "omega_dot"),
        (
            o.argument_of_perigee_sc * pi,
            file.argument_of_perigee_rad,
            "argument_of_perigee",
        ),
        (o.m0_sc * pi, file.m0_rad, "m0"),
        (o.delta_n_scps * pi, file.delta_n_radps, "delta_n"),
        (o.cuc_rad, file.cuc_rad, "cuc"),
        (o.cus_rad, file.cus_rad, "cus"),
        (o.crc_m, file.crc_m, "crc"),
        (o.crs_m, file.crs_m, "crs"),
        (o.cic_rad, file.cic_rad, "cic"),
        (o.cis_rad, file.cis_rad, "cis"),
        (o.af0_s, file.af0_s, "af0"),
        (o.af1_sps, file.af1_sps, "af1"),
        (o.af2_sps2, file.af2_sps2, "af2"),
        (o.group_delay_s[0], file.group_delay_s[0], "group delay 1"),
        (o.group_delay_s[1], file.group_delay_s[1], "group delay 2"),
    ];
    for (ours, theirs, name) in fields {
        assert!(
            (ours - theirs).abs() <= 5.1e-12 * theirs.abs(),
            "{what} {name}: {ours:e} {theirs:e}"
        );
    }
    assert_eq!(f64::from(o.toe_s), file.toe_sow_s, "{what} toe");
    let (week, toc_s) = in_own_week(o, file.toc);
    assert_eq!(o.toc_s, toc_s, "{what} toc");
    assert_eq!(i32::from(o.week), week, "{what} week");
    // RTKLIB writes a number made of toe where BDS has AODE.
    let issue = match o.source {
        Source::BdsD1D2 => (o.toe_s / 720 % 240) as u16,
        _ => o.issue,
    };
    assert_eq!(issue, file.issue, "{what} issue");
    assert_eq!(o.health, file.health, "{what} health");
    // [GAL-OS-SIS-ICD] table 89; [IS-GPS-200] 20.3.3.3.1.3, of which the recordings have the first few.
    let index = f64::from(o.accuracy_index);
    let sigma_m = match (o.source, o.accuracy_index) {
        (Source::GalileoInav, 0..50) => Some(0.01 * index),
        (Source::GalileoInav, 50..75) => Some(0.5 + 0.02 * (index - 50.0)),
        (Source::GalileoInav, 75..100) => Some(1.0 + 0.04 * (index - 75.0)),
        (Source::GalileoInav, 100..126) => Some(2.0 + 0.16 * (index - 100.0)),
        (Source::GalileoInav, _) => None,
        (_, n) => [2.0, 2.8, 4.0, 5.7].get(usize::from(n)).copied(),
    };
    match (sigma_m, file.sigma_ura_m) {
        (Some(ours), Some(theirs)) => assert!((ours - theirs).abs() < 1e-9, "{what} accuracy"),
        (ours, theirs) => assert_eq!(ours, theirs, "{what} accuracy"),
    }
    fields.len() + 6
}

#[derive(Debug, Default, PartialEq, Eq)]
struct Matched {
    by_system: BTreeMap<char, usize>,
    fields: usize,
    /// Ephemerides that the file does not have.
    only_ours: Vec<String>,
    /// Records of the file that were not collected.
    only_file: Vec<String>,
}

fn compare(heard: &Heard, file: &NavigationFile) -> Matched {
    let mut matched = Matched::default();
    let mut found = BTreeSet::new();
    for ours in &heard.ephemerides {
        let satellite = satellite_of(ours);
        let what = format!("{satellite} {}", ours.toe_s);
        let record = file.ephemerides.iter().find(|record| {
            let e = &record.ephemeris;
            (e.satellite, e.message, e.toe_sow_s)
                == (satellite, message_of(ours), f64::from(ours.toe_s))
        });
        match record {
            Some(record) => {
                matched.fields += assert_same(ours, &record.ephemeris, &what);
                *matched
                    .by_system
                    .entry(satellite.system().letter())
                    .or_default() += 1;
                found.insert(what);
            }
            None => matched.only_ours.push(what),
        }
    }
    for record in &file.ephemerides {
        let e = &record.ephemeris;
        let what = format!("{} {}", e.satellite, e.toe_sow_s);
        if e.message != NavMessage::GalileoFnav && !found.contains(&what) {
            matched.only_file.push(what);
        }
    }
    matched.only_ours.sort();
    matched.only_file.sort();
    matched
}

fn navigation(path: &Path) -> NavigationFile {
    let (text, _) = text_of(read_unzipped(path).unwrap()).unwrap();
    NavigationFile::parse(&text).unwrap()
}

/// INT-054
#[test]
fn a_simulated_sky_of_gps_and_galileo_is_collected_as_in_its_navigation_file() {
    let stem = "data/instinct-spirent-f9p-ubx/Spirent_ublox-F9P_static_duration-15min_sys-GPS-GAL_\
                iono-Klobuchar_tropo-Saastamoinen";
    let ubx = shared(&format!("{stem}.ubx"));
    let nav = shared(&format!("{stem}.nav"));
    let (Some(ubx), Some(nav)) = (ubx, nav) else {
        return;
    };
    let recording = recorded(&ubx);
    assert_eq!(recording.len(), 6702, "RXM-SFRBX of the recording");
    let heard = hear(&recording);
    let file = navigation(&nav);
    let matched = compare(&heard, &file);
    println!(
        "{matched:?}, given {} times, refused {:?}",
        heard.n_given, heard.refused
    );
    assert_eq!(matched.by_system, BTreeMap::from([('E', 28), ('G', 19)]));
    assert!(
        matched.only_ours.is_empty() && matched.only_file.is_empty(),
        "{matched:?}"
    );
    // Two subframes of GPS have words that do not go together: RTKLIB does not look.
    let refused = [
        ((0, 0, "parity"), 2),
        ((0, 6, "unsupported"), 1169),
        ((2, 3, "unsupported"), 690),
    ];
    assert_eq!(heard.refused, BTreeMap::from(refused));

    let [(None, expected)] = file.klobuchar[..] else {
        panic!("{:?}", file.klobuchar);
    };
    assert_eq!(
        heard.klobuchar.len(),
        8,
        "page 18 of subframe 4 comes every 12.5 min"
    );
    for klobuchar in &heard.klobuchar {
        assert_eq!(klobuchar.source, Source::GpsLnav);
        let ours = klobuchar.alpha.iter().chain(&klobuchar.beta);
        for (ours, theirs) in ours.zip(expected.alpha.iter().chain(&expected.beta)) {
            // Four digits in the header.
            assert!(
                (ours - theirs).abs() <= 5.1e-4 * theirs.abs(),
                "{ours:e} {theirs:e}"
            );
        }
    }
}

/// INT-054
#[test]
fn a_walk_among_obstructions_is_collected_as_in_its_navigation_file() {
    let folder = "data/walk0827-x20p-imu";
    let ubx = shared(&format!("{folder}/gnss_1730.ubx"));
    let nav = shared(&format!("{folder}/derived_convbin.nav"));
    let (Some(ubx), Some(nav)) = (ubx, nav) else {
        return;
    };
    let recording = recorded(&ubx);
    let heard = hear(&recording);
    let matched = compare(&heard, &navigation(&nav));
    println!(
        "{matched:?}, given {} times, refused {:?}",
        heard.n_given, heard.refused
    );
    assert_eq!(
        matched.by_system,
        BTreeMap::from([('C', 6), ('E', 5), ('G', 4)])
    );
    // Of E08 and E14 the file has F/NAV, and no I/NAV.
    assert_eq!(matched.only_ours, ["E08 408000", "E14 408000"]);
    // Heard once, and so not confirmed.
    assert_eq!(matched.only_file, ["C22 406800", "C44 406800"]);
    // Every word is a code word, and the time is beyond the week: what a code is worth that a
    // receiver corrects with.
    assert_eq!(heard.refused.get(&(3, 4, "time")), Some(&1));
    let mut klobuchar: Vec<_> = heard
        .klobuchar
        .iter()
        .filter(|k| k.source == Source::BdsD1D2)
        .collect();
    assert!(klobuchar.len() > 10, "{}", klobuchar.len());
    klobuchar.dedup();
    assert_eq!(
        klobuchar.len(),
        1,
        "every satellite sends the same: {klobuchar:?}"
    );
}

/// In SI units and radians, in weeks of an era that does not matter.
fn in_si(e: &BroadcastEphemeris) -> Ephemeris {
    let instant = |of_week_s: u32| GpsTime::from_week_tow_s(2000, i64::from(of_week_s));
    Ephemeris {
        satellite: satellite_of(e),
        message: message_of(e),
        toe: instant(e.toe_s),
        toc: instant(e.toc_s),
        toe_sow_s: f64::from(e.toe_s),
        issue: e.issue,
        sqrt_a: e.sqrt_a,
        eccentricity: e.eccentricity,
        i0_rad: e.i0_sc * PI_BROADCAST,
        idot_radps: e.idot_scps * PI_BROADCAST,
        omega0_rad: e.omega0_sc * PI_BROADCAST,
        omega_dot_radps: e.omega_dot_scps * PI_BROADCAST,
        argument_of_perigee_rad: e.argument_of_perigee_sc * PI_BROADCAST,
        m0_rad: e.m0_sc * PI_BROADCAST,
        delta_n_radps: e.delta_n_scps * PI_BROADCAST,
        cuc_rad: e.cuc_rad,
        cus_rad: e.cus_rad,
        crc_m: e.crc_m,
        crs_m: e.crs_m,
        cic_rad: e.cic_rad,
        cis_rad: e.cis_rad,
        af0_s: e.af0_s,
        af1_sps: e.af1_sps,
        af2_sps2: e.af2_sps2,
        group_delay_s: e.group_delay_s,
        sigma_ura_m: None,
        health: e.health,
    }
}

/// INT-054
#[test]
fn a_cold_start_gives_issues_that_join() {
    let Some(ubx) =
        shared("data/besancon-f9-coldstart-nominal/16dBatt_no_interference_coldstart.ubx.gz")
    else {
        return;
    };
    let heard = hear(&recorded(&ubx));
    assert_eq!(heard.refused, BTreeMap::new());
    let of = |source| heard.ephemerides.iter().filter(move |e| e.source == source);
    assert_eq!(
        (of(Source::GpsLnav).count(), of(Source::GalileoInav).count()),
        (9, 19)
    );
    // 2025-04-25: week 2363 of GPS, 1339 of Galileo.
    assert!(of(Source::GpsLnav).all(|e| i32::from(e.week) == 2363 % 1024));
    assert!(of(Source::GalileoInav).all(|e| e.week == 2363 - 1024));

    // Seven satellites of Galileo changed to the next issue: both put them at the same place.
    let mut n_joined = 0;
    for before in of(Source::GalileoInav) {
        let after = of(Source::GalileoInav)
            .find(|e| e.satellite == before.satellite && e.issue == before.issue + 1);
        let Some(after) = after else { continue };
        let since_s = f64::from(after.toe_s) - f64::from(before.toe_s);
        let r = position_velocity(&in_si(before), since_s).unwrap().r_e_m;
        let s = position_velocity(&in_si(after), 0.0).unwrap().r_e_m;
        let apart_m = r
            .iter()
            .zip(s)
            .map(|(r, s)| (r - s) * (r - s))
            .sum::<f64>()
            .sqrt();
        assert!(apart_m < 0.5, "E{:02}: {apart_m} m", before.satellite);
        let clock_s = before.af0_s + before.af1_sps * since_s - after.af0_s;
        assert!(
            clock_s.abs() < 1e-9,
            "E{:02}: {clock_s:e} s",
            before.satellite
        );
        n_joined += 1;
    }
    assert_eq!(n_joined, 7);
}

/// Two bits of one code of a word of BDS are wrong, and the receiver corrects what it takes for one.
fn damage_and_correct(random: &mut ChaCha8Rng, words: &mut [u8]) {
    // Division by X⁴ + X + 1. [BDS-SIS-ICD-B1I] 5.1.3
    let is_code = |code: u32| {
        let divided = |left: u32, at: u32| left ^ ((left >> at & 1) * (0b10011 << (at - 4)));
        (4..15).rev().fold(code, divided) == 0
    };
    let begin = 4 * (1 + random.next_u32() as usize % 9);
    let bytes: &mut [u8; 4] = (&mut words[begin..begin + 4]).try_into().unwrap();
    let word = u32::from_le_bytes(*bytes);
    // The two codes of a word: 11 bits and 4 of parity each.
    let (data_at, parity_at) = [(19, 4), (8, 0)][random.next_u32() as usize % 2];
    let code = (word >> data_at & 0x7FF) << 4 | word >> parity_at & 0xF;
    assert!(is_code(code), "{code:b}");
    let first = random.next_u32() % 15;
    let second = (first + 1 + random.next_u32() % 14) % 15;
    let received = code ^ 1 << first ^ 1 << second;
    let corrected = (0..15).map(|bit| received ^ 1 << bit);
    let [code] = corrected.filter(|code| is_code(*code)).collect::<Vec<_>>()[..] else {
        panic!("the code is perfect");
    };
    let rest = word & !(0x7FF << data_at | 0xF << parity_at);
    *bytes = (rest | (code >> 4) << data_at | (code & 0xF) << parity_at).to_le_bytes();
}

/// INT-054
#[test]
fn damage_gives_no_other_ephemeris() {
    let stem = "data/instinct-spirent-f9p-ubx/Spirent_ublox-F9P_static_duration-15min_sys-GPS-GAL_\
                iono-Klobuchar_tropo-Saastamoinen";
    for path in [
        format!("{stem}.ubx"),
        "data/walk0827-x20p-imu/gnss_1730.ubx".to_owned(),
    ] {
        let Some(ubx) = shared(&path) else { continue };
        let recording = recorded(&ubx);
        let right = hear(&recording).ephemerides;
        let mut random = ChaCha8Rng::seed_from_u64(1);
        // By constellation: damaged, and not refused although another subframe came.
        let mut counts = BTreeMap::<u8, [usize; 2]>::new();
        for _ in 0..20 {
            let mut damaged = recording.clone();
            for one in &mut damaged {
                let is_read = !matches!(alone(one), Err(SubframeError::Unsupported));
                if !is_read || !random.next_u32().is_multiple_of(20) {
                    continue;
                }
                let before = one.words.clone();
                if one.gnss_id == 3 {
                    damage_and_correct(&mut random, &mut one.words);
                } else {
                    // Up to three bits of the 30 of a word.
                    let word = 4 * (random.next_u32() as usize % (one.words.len() / 4));
                    for _ in 0..1 + random.next_u32() % 3 {
                        let bit = random.next_u32() as usize % 30;
                        one.words[word + bit / 8] ^= 1 << (bit % 8);
                    }
                }
                let taken = alone(one);
                if one.words != before {
                    let [n_damaged, n_taken] = counts.entry(one.gnss_id).or_default();
                    *n_damaged += 1;
                    *n_taken += usize::from(taken.is_ok());
                }
            }
            let heard = hear(&damaged);
            assert!(heard.ephemerides.len() > right.len() / 2, "{path}");
            for e in &heard.ephemerides {
                assert!(right.contains(e), "{path}: {} {e:?}", satellite_of(e));
            }
        }
        println!("{path}: {counts:?}");
        let refuses_all = |[damaged, taken]: [usize; 2]| damaged > 50 && taken == 0;
        assert!(refuses_all(counts[&0]), "GPS: {counts:?}");
        // What is not covered by the checksum is taken.
        let [damaged, taken] = counts[&2];
        assert!(damaged > 100 && taken * 3 < damaged, "Galileo: {counts:?}");
        // Of BDS every error is taken but where it makes a time that is none.
        if let Some([damaged, taken]) = counts.get(&3) {
            assert!(*damaged > 50 && taken * 10 > damaged * 9, "BDS: {counts:?}");
        }
    }
}

/// INT-054
#[test]
fn receivers_of_generation_8_are_read() {
    let folder = "data/ubx-parser-corpus";
    let Some(bds) = shared(&format!("{folder}/swift_rxm_sfrbx_bds.ubx")) else {
        return;
    };
    let recording = recorded(&bds);
    assert_eq!(recording.len(), 13);
    let heard = hear(&recording);
    assert_eq!((heard.n_given, heard.refused.len()), (0, 0), "heard once");
    // Subframes 1 to 3 of C25 are there; the same again is what a second signal would send.
    let heard = hear(&[&recording[..], &recording].concat());
    let [e] = heard.ephemerides[..] else {
        panic!("{:?}", heard.ephemerides);
    };
    assert_eq!((e.source, e.satellite, e.week), (Source::BdsD1D2, 25, 735));
    assert_eq!((e.toe_s, e.toc_s, e.issue), (460_800, 460_800, 1));
    // A medium orbit of BDS: 27,906 km.
    assert!((e.sqrt_a - 27_906_000_f64.sqrt()).abs() < 1.0, "{e:?}");
    assert!((e.i0_sc * 180.0 - 55.0).abs() < 1.0, "{e:?}");
    let Some(galileo) = shared(&format!("{folder}/swift_rxm_sfrbx_gal.ubx")) else {
        return;
    };
    let heard = hear(&recorded(&galileo));
    assert!(heard.refused.is_empty(), "{:?}", heard.refused);
    let [e] = heard.ephemerides[..] else {
        panic!("{:?}", heard.ephemerides);
    };
    assert_eq!(
        (e.source, e.satellite, e.week),
        (Source::GalileoInav, 8, 1066)
    );
    assert_eq!((e.toe_s, e.toc_s, e.issue), (135_000, 135_000, 97));
    assert!((e.sqrt_a - 29_600_000_f64.sqrt()).abs() < 1.0, "{e:?}");
    let Some(gps) = shared(&format!("{folder}/swift_rxm_sfrbx_gps.ubx")) else {
        return;
    };
    let heard = hear(&recorded(&gps));
    println!(
        "{} {:?} {:?}",
        heard.ephemerides.len(),
        heard.refused,
        heard.klobuchar
    );
}
