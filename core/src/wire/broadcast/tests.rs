//! Messages encoded here, by other means than they are decoded.

use std::string::String;
use std::vec;
use std::vec::Vec;

use super::*;

// Numbers of the orbit as broadcast, of every size and sign.
const M0: i64 = -1_234_567_891;
const DELTA_N: i64 = 12_345;
const ECCENTRICITY: i64 = 0x8123_4567;
const SQRT_A: i64 = 0xA10D_1234;
const OMEGA0: i64 = 2_047_483_647;
const I0: i64 = 660_000_001;
const OMEGA: i64 = -2_000_000_003;
const OMEGA_DOT: i64 = -8_388_000;
const IDOT: i64 = -8_001;
const CUC: i64 = -32_001;
const CUS: i64 = 31_003;
const CRC: i64 = 30_007;
const CRS: i64 = -29_009;
const CIC: i64 = -5;
const CIS: i64 = 7;

fn scale(raw: i64, exponent: i32) -> f64 {
    raw as f64 * 2_f64.powi(exponent)
}

/// Bits as a text, most significant first.
fn bits(fields: &[(i64, usize)]) -> String {
    let one = |(value, width): &(i64, usize)| {
        let text = std::format!("{value:064b}");
        String::from(&text[64 - width..])
    };
    fields.iter().map(one).collect()
}

fn number(bits: &str) -> u32 {
    u32::from_str_radix(bits, 2).unwrap()
}

fn bytes(words: impl IntoIterator<Item = u32>) -> Vec<u8> {
    words.into_iter().flat_map(u32::to_le_bytes).collect()
}

/// Parity of 24 source bits, the masks as receivers' software commonly writes [IS-GPS-200] table 20-XIV.
fn lnav_parity(d: u32, d29: u32, d30: u32) -> u32 {
    [
        (0xEC7CD2, d29),
        (0x763E69, d30),
        (0xBB1F34, d29),
        (0x5D8F9A, d30),
        (0xAEC7CD, d30),
        (0x2DEA27, d29),
    ]
    .iter()
    .fold(0, |p, (mask, star)| {
        p << 1 | (((d & mask).count_ones() & 1) ^ star)
    })
}

/// A subframe as transmitted, then each word inverted when D30* is 1; `content` has 190 bits.
fn lnav(number_of: i64, tow_count: i64, alert: bool, content: &str) -> Vec<u8> {
    assert_eq!(content.len(), 190);
    let all = [
        bits(&[(0x8B, 8), (0x1234, 16)]),
        bits(&[
            (tow_count, 17),
            (i64::from(alert), 1),
            (0, 1),
            (number_of, 3),
            (0, 2),
        ]),
        String::from(content),
        String::from("00"),
    ]
    .concat();
    let (mut d29, mut d30) = (0, 0);
    bytes((0..10).map(|i| {
        let mut d = number(&all[24 * i..24 * i + 24]);
        if i == 1 || i == 9 {
            let solves = |t: &u32| lnav_parity(d | t, d29, d30) & 3 == 0;
            d |= (0..4).find(solves).unwrap();
        }
        let parity = lnav_parity(d, d29, d30);
        let sent = (if d30 == 1 { !d & 0xFF_FFFF } else { d }) << 6 | parity;
        let delivered = if d30 == 1 { !sent & 0x3FFF_FFFF } else { sent };
        (d29, d30) = (sent >> 1 & 1, sent & 1);
        delivered
    }))
}

/// Subframes 1 to 3 of an issue.
fn lnav_ephemeris(issue: i64, tow_count: i64, alert: bool) -> [Vec<u8>; 3] {
    let first = bits(&[
        (900, 10),
        (1, 2),
        (3, 4),
        (0b10_0001, 6),
        (2, 2), // week, code, URA, health, IODC
        (1, 1),
        (0x55_5555, 23),
        (0xAA_AAAA, 24),
        (0x55_5555, 24),
        (0xAAAA, 16), // reserved
        (-11, 8),
        (issue, 8),
        (36_000 / 16, 16),
        (-3, 8),
        (-1234, 16),
        (-2_000_001, 22), // TGD, toc, af
    ]);
    let second = bits(&[
        (issue, 8),
        (CRS, 16),
        (DELTA_N, 16),
        (M0, 32),
        (CUC, 16),
        (ECCENTRICITY, 32),
        (CUS, 16),
        (SQRT_A, 32),
        (36_016 / 16, 16),
        (1, 1),
        (0b10101, 5),
    ]);
    let third = bits(&[
        (CIC, 16),
        (OMEGA0, 32),
        (CIS, 16),
        (I0, 32),
        (CRC, 16),
        (OMEGA, 32),
        (OMEGA_DOT, 24),
        (issue, 8),
        (IDOT, 14),
    ]);
    [
        lnav(1, tow_count, alert, &first),
        lnav(2, tow_count + 1, alert, &second),
        lnav(3, tow_count + 2, alert, &third),
    ]
}

/// CRC-24Q bit by bit. [GAL-OS-SIS-ICD] 5.1.9.4
fn crc24(bits: &str) -> i64 {
    bits.bytes().fold(0, |crc, bit| {
        let out = crc >> 23 ^ i64::from(bit == b'1');
        (crc << 1 & 0xFF_FFFF) ^ (out * 0x86_4CFB)
    })
}

/// A page with a word of 128 bits.
fn inav(word: &str) -> Vec<u8> {
    assert_eq!(word.len(), 128);
    let even = ["00", &word[..112]].concat();
    let odd = ["10", &word[112..], &bits(&[(0x5A5A_5A5A, 64)])].concat();
    let crc = bits(&[(crc24(&[&even[..], &odd].concat()), 24)]);
    let page = [
        even,
        bits(&[(0, 14)]),
        odd,
        crc,
        bits(&[(0xC3, 8), (0, 14)]),
    ]
    .concat();
    bytes((0..8).map(|i| number(&page[32 * i..32 * i + 32])))
}

/// Words 1 to 5 of an issue.
fn inav_ephemeris(issue: i64, satellite: i64, tow_s: i64) -> [Vec<u8>; 5] {
    [
        bits(&[
            (1, 6),
            (issue, 10),
            (36_000 / 60, 14),
            (M0, 32),
            (ECCENTRICITY, 32),
            (SQRT_A, 32),
            (3, 2),
        ]),
        bits(&[
            (2, 6),
            (issue, 10),
            (OMEGA0, 32),
            (I0, 32),
            (OMEGA, 32),
            (IDOT, 14),
            (3, 2),
        ]),
        bits(&[
            (3, 6),
            (issue, 10),
            (OMEGA_DOT, 24),
            (DELTA_N, 16),
            (CUC, 16),
            (CUS, 16),
            (CRC, 16),
            (CRS, 16),
            (107, 8),
        ]),
        bits(&[
            (4, 6),
            (issue, 10),
            (satellite, 6),
            (CIC, 16),
            (CIS, 16),
            (36_060 / 60, 14),
            (-1_000_000_007, 31),
            (-1_000_003, 21),
            (-31, 6),
            (3, 2),
        ]),
        bits(&[
            (5, 6),
            (0x2AA, 11),
            (0x555, 11),
            (0x1555, 14),
            (0b10101, 5),
            (-511, 10),
            (333, 10),
            (1, 2),
            (2, 2),
            (0, 1),
            (1, 1),
            (1234, 12),
            (tow_s, 20),
            (0x2A_AAAA, 23),
        ]),
    ]
    .map(|word| inav(&word))
}

/// Parity of 11 bits by the shift register of [BDS-SIS-ICD-B1I] figure 5-2.
fn bch(bits: &[u8]) -> u32 {
    bits.iter().fold(0, |register, bit| {
        let feedback = register >> 3 ^ u32::from(*bit == b'1');
        (register << 1 & 0xF) ^ (feedback * 0b0011)
    })
}

/// A subframe of BDS; fields stand at their bits from 1 to 300, parity and what is left are filled in.
fn bds(number_of: i64, sow_s: i64, fields: &[(usize, usize, i64)]) -> Vec<u8> {
    let mut all = [b'1'; 301];
    let head = [
        (1, 11, 0b111_0001_0010),
        (12, 4, 0),
        (16, 3, number_of),
        (19, 8, sow_s >> 12),
        (31, 12, sow_s),
    ];
    for (start, width, value) in head.iter().chain(fields) {
        all[*start..start + width].copy_from_slice(bits(&[(*value, *width)]).as_bytes());
    }
    bytes((0..10).map(|i| {
        let word = &all[30 * i + 1..30 * i + 31];
        let information = number(std::str::from_utf8(&word[..22]).unwrap());
        if i == 0 {
            number(std::str::from_utf8(&word[..26]).unwrap()) << 4 | bch(&word[15..26])
        } else {
            information << 8 | bch(&word[..11]) << 4 | bch(&word[11..22])
        }
    }))
}

/// Subframes 1 to 3 of D1. [BDS-SIS-ICD-B1I] figures 5-8 to 5-10
fn d1_ephemeris(sow_s: i64, aode: i64) -> [Vec<u8>; 3] {
    let toe = 36_008 / 8;
    [
        bds(
            1,
            sow_s,
            &[
                (43, 1, 1),
                (44, 5, 9),
                (49, 4, 2), // SatH1, AODC, URAI
                (61, 13, 1025),
                (74, 9, (36_000 / 8) >> 8),
                (91, 8, 36_000 / 8), // week, toc
                (99, 10, -133),
                (109, 4, 77 >> 6),
                (121, 6, 77), // TGD1, TGD2
                (127, 8, 35),
                (135, 8, -28),
                (151, 8, 29),
                (159, 8, -44), // α
                (167, 6, 63 >> 2),
                (181, 2, 63),
                (183, 8, -23),
                (191, 8, 42),
                (199, 4, -29 >> 4),
                (211, 4, -29), // β
                (215, 11, -513),
                (226, 7, -4_000_001 >> 17),
                (241, 17, -4_000_001), // a2, a0
                (258, 5, 1_000_001 >> 17),
                (271, 17, 1_000_001),
                (288, 5, aode), // a1, AODE
            ],
        ),
        bds(
            2,
            (sow_s + 6) % 604_800,
            &[
                (43, 10, DELTA_N >> 6),
                (61, 6, DELTA_N),
                (67, 16, CUC >> 2),
                (91, 2, CUC),
                (93, 20, M0 >> 12),
                (121, 12, M0),
                (133, 10, ECCENTRICITY >> 22),
                (151, 22, ECCENTRICITY),
                (181, 18, CUS),
                (199, 4, CRC >> 14),
                (211, 14, CRC),
                (225, 8, CRS >> 10),
                (241, 10, CRS),
                (251, 12, SQRT_A >> 20),
                (271, 20, SQRT_A),
                (291, 2, toe >> 15),
            ],
        ),
        bds(
            3,
            (sow_s + 12) % 604_800,
            &[
                (43, 10, toe >> 5),
                (61, 5, toe),
                (66, 17, I0 >> 15),
                (91, 15, I0),
                (106, 7, CIC >> 11),
                (121, 11, CIC),
                (132, 11, OMEGA_DOT >> 13),
                (151, 13, OMEGA_DOT),
                (164, 9, CIS >> 9),
                (181, 9, CIS),
                (190, 13, IDOT >> 1),
                (211, 1, IDOT),
                (212, 21, OMEGA0 >> 11),
                (241, 11, OMEGA0),
                (252, 11, OMEGA >> 21),
                (271, 21, OMEGA),
            ],
        ),
    ]
}

/// Pages 1 to 10 of D2, which begin at bit 47. [BDS-SIS-ICD-B1I] figures 5-13
fn d2_ephemeris(sow_s: i64, aode: i64) -> Vec<Vec<u8>> {
    let toe = 36_008 / 8;
    let (toc, a0, a1) = (36_000 / 8, -4_000_001, 1_000_001);
    let pages: [&[(usize, usize, i64)]; 10] = [
        &[
            (47, 1, 1),
            (48, 5, 9),
            (61, 4, 2),
            (65, 13, 1025),
            (78, 5, toc >> 12),
            (91, 12, toc),
            (103, 10, -133),
            (121, 10, 77),
        ],
        &[
            (47, 6, 35 >> 2),
            (61, 2, 35),
            (63, 8, -28),
            (71, 8, 29),
            (79, 4, -44 >> 4),
            (91, 4, -44),
            (95, 8, 63),
            (103, 8, -23),
            (111, 2, 42 >> 6),
            (121, 6, 42),
            (127, 8, -29),
        ],
        &[(101, 12, a0 >> 12), (121, 12, a0), (133, 4, a1 >> 18)],
        &[
            (47, 6, a1 >> 12),
            (61, 12, a1),
            (73, 10, -513 >> 1),
            (91, 1, -513),
            (92, 5, aode),
            (97, 16, DELTA_N),
            (121, 14, CUC >> 4),
        ],
        &[
            (47, 4, CUC),
            (51, 2, M0 >> 30),
            (61, 22, M0 >> 8),
            (91, 8, M0),
            (99, 14, CUS >> 4),
            (121, 4, CUS),
            (125, 10, ECCENTRICITY >> 22),
        ],
        &[
            (47, 6, ECCENTRICITY >> 16),
            (61, 16, ECCENTRICITY),
            (77, 6, SQRT_A >> 26),
            (91, 22, SQRT_A >> 4),
            (121, 4, SQRT_A),
            (125, 10, CIC >> 8),
        ],
        &[
            (47, 6, CIC >> 2),
            (61, 2, CIC),
            (63, 18, CIS),
            (81, 2, toe >> 15),
            (91, 15, toe),
            (106, 7, I0 >> 25),
            (121, 14, I0 >> 11),
        ],
        &[
            (47, 6, I0 >> 5),
            (61, 5, I0),
            (66, 17, CRC >> 1),
            (91, 1, CRC),
            (92, 18, CRS),
            (110, 3, OMEGA_DOT >> 21),
            (121, 16, OMEGA_DOT >> 5),
        ],
        &[
            (47, 5, OMEGA_DOT),
            (52, 1, OMEGA0 >> 31),
            (61, 22, OMEGA0 >> 9),
            (91, 9, OMEGA0),
            (100, 13, OMEGA >> 19),
            (121, 14, OMEGA >> 5),
        ],
        &[(47, 5, OMEGA), (52, 1, IDOT >> 13), (61, 13, IDOT)],
    ];
    (1..)
        .zip(pages)
        .map(|(page, fields)| {
            bds(
                1,
                (sow_s + 3 * (page - 1)) % 604_800,
                &[&[(43, 4, page)], fields].concat(),
            )
        })
        .collect()
}

/// What all messages hold of the orbit; `angle` and `metre` are the exponents of the harmonic terms.
fn assert_orbit(e: &BroadcastEphemeris, angle: i32, metre: i32) {
    let expected = [
        (e.sqrt_a, SQRT_A, -19),
        (e.eccentricity, ECCENTRICITY, -33),
        (e.m0_sc, M0, -31),
        (e.omega0_sc, OMEGA0, -31),
        (e.i0_sc, I0, -31),
        (e.argument_of_perigee_sc, OMEGA, -31),
        (e.delta_n_scps, DELTA_N, -43),
        (e.omega_dot_scps, OMEGA_DOT, -43),
        (e.idot_scps, IDOT, -43),
        (e.cuc_rad, CUC, angle),
        (e.cus_rad, CUS, angle),
        (e.cic_rad, CIC, angle),
        (e.cis_rad, CIS, angle),
        (e.crc_m, CRC, metre),
        (e.crs_m, CRS, metre),
    ];
    for (i, (value, raw, exponent)) in expected.into_iter().enumerate() {
        assert_eq!(value, scale(raw, exponent), "field {i}");
    }
}

/// A message of a satellite: what is sent, and how.
#[derive(Clone, Copy)]
struct Sender {
    gnss_id: u8,
    sv_id: u8,
    sig_id: u8,
}

const GPS: Sender = Sender {
    gnss_id: 0,
    sv_id: 7,
    sig_id: 0,
};
const GALILEO: Sender = Sender {
    gnss_id: 2,
    sv_id: 11,
    sig_id: 1,
};
const BDS_D1: Sender = Sender {
    gnss_id: 3,
    sv_id: 23,
    sig_id: 0,
};
const BDS_D2: Sender = Sender {
    gnss_id: 3,
    sv_id: 59,
    sig_id: 1,
};

impl Sender {
    fn to(self, collector: &mut Collector, words: &[u8]) -> Result<Collected, SubframeError> {
        collector.take(&Subframe {
            gnss_id: self.gnss_id,
            sv_id: self.sv_id,
            sig_id: self.sig_id,
            words,
        })
    }

    /// Sends parts; the ephemerides that came, with the part they came at.
    fn all(self, collector: &mut Collector, parts: &[Vec<u8>]) -> Vec<(usize, BroadcastEphemeris)> {
        let ephemeris = |(i, words): (usize, &Vec<u8>)| {
            Some((i, self.to(collector, words).unwrap().ephemeris?))
        };
        parts.iter().enumerate().filter_map(ephemeris).collect()
    }
}

#[test]
fn lnav_gives_what_was_sent() {
    let mut collector = Collector::EMPTY;
    let given = GPS.all(&mut collector, &lnav_ephemeris(0x5A, 6000, false));
    let [(2, e)] = given[..] else {
        panic!("{given:?}")
    };
    assert_orbit(&e, -29, -5);
    assert_eq!((e.source, e.satellite, e.week), (Source::GpsLnav, 7, 900));
    assert_eq!((e.toe_s, e.toc_s, e.issue), (36_016, 36_000, 0x5A));
    assert_eq!((e.accuracy_index, e.health), (3, 0b10_0001));
    assert_eq!(e.af0_s, scale(-2_000_001, -31));
    assert_eq!(e.af1_sps, scale(-1234, -43));
    assert_eq!(e.af2_sps2, scale(-3, -55));
    assert_eq!(e.group_delay_s, [scale(-11, -31), 0.0]);
}

#[test]
fn inav_gives_what_was_sent() {
    let mut collector = Collector::EMPTY;
    let given = GALILEO.all(&mut collector, &inav_ephemeris(777, 11, 36_100));
    let [(4, e)] = given[..] else {
        panic!("{given:?}")
    };
    assert_orbit(&e, -29, -5);
    assert_eq!(
        (e.source, e.satellite, e.week),
        (Source::GalileoInav, 11, 1234)
    );
    assert_eq!((e.toe_s, e.toc_s, e.issue), (36_000, 36_060, 777));
    // E5b health 1, valid; E1-B health 2, without guarantee.
    assert_eq!((e.accuracy_index, e.health), (107, 1 << 7 | 2 << 1 | 1));
    assert_eq!(e.af0_s, scale(-1_000_000_007, -34));
    assert_eq!(e.af1_sps, scale(-1_000_003, -46));
    assert_eq!(e.af2_sps2, scale(-31, -59));
    assert_eq!(e.group_delay_s, [scale(-511, -32), scale(333, -32)]);
}

#[test]
fn d1_and_d2_give_what_was_sent() {
    for (sender, parts, last, at_klobuchar) in [
        (BDS_D1, Vec::from(d1_ephemeris(36_000, 17)), 2, 0),
        (BDS_D2, d2_ephemeris(36_000, 17), 9, 1),
    ] {
        let mut collector = Collector::EMPTY;
        assert_eq!(sender.all(&mut collector, &parts), [], "heard once");
        let given = sender.all(&mut collector, &parts);
        let [(at, e)] = given[..] else {
            panic!("{given:?}")
        };
        assert_eq!(at, last);
        assert_orbit(&e, -31, -6);
        assert_eq!(
            (e.source, e.satellite, e.week),
            (Source::BdsD1D2, sender.sv_id, 1025)
        );
        assert_eq!((e.toe_s, e.toc_s, e.issue), (36_008, 36_000, 17));
        assert_eq!((e.accuracy_index, e.health), (2, 1));
        assert_eq!(e.af0_s, scale(-4_000_001, -33));
        assert_eq!(e.af1_sps, scale(1_000_001, -50));
        assert_eq!(e.af2_sps2, scale(-513, -66));
        assert_eq!(e.group_delay_s, [-13.3e-9, 7.7e-9]);

        let klobuchar = sender
            .to(&mut collector, &parts[at_klobuchar])
            .unwrap()
            .klobuchar
            .unwrap();
        assert_eq!(klobuchar.source, Source::BdsD1D2);
        let alpha = [(35, -30), (-28, -27), (29, -24), (-44, -24)];
        let beta = [(63, 11), (-23, 14), (42, 16), (-29, 16)];
        assert_eq!(
            klobuchar.alpha,
            alpha.map(|(raw, exponent)| scale(raw, exponent))
        );
        assert_eq!(
            klobuchar.beta,
            beta.map(|(raw, exponent)| scale(raw, exponent))
        );
    }
}

#[test]
fn the_ionosphere_of_gps_is_page_18_of_subframe_4() {
    let page = |id: i64| {
        let raw = [10, 23, -119, -120, 100, -101, 3, -128];
        let mut fields = vec![(1, 2), (id, 6)];
        fields.extend(raw.map(|raw| (raw, 8)));
        fields.extend([(0, 57), (0, 57), (0, 4)]);
        lnav(4, 6003, false, &bits(&fields))
    };
    let mut collector = Collector::EMPTY;
    let klobuchar = GPS
        .to(&mut collector, &page(56))
        .unwrap()
        .klobuchar
        .unwrap();
    assert_eq!(klobuchar.source, Source::GpsLnav);
    assert_eq!(
        klobuchar.alpha,
        [
            scale(10, -30),
            scale(23, -27),
            scale(-119, -24),
            scale(-120, -24)
        ]
    );
    assert_eq!(
        klobuchar.beta,
        [
            scale(100, 11),
            scale(-101, 14),
            scale(3, 16),
            scale(-128, 16)
        ]
    );
    assert_eq!(GPS.to(&mut collector, &page(57)), Ok(Collected::NOTHING));
}

/// INT-054
#[test]
fn no_single_bit_makes_another_ephemeris() {
    let cases = [
        (GPS, Vec::from(lnav_ephemeris(0x5A, 6000, false)), 1),
        (GALILEO, Vec::from(inav_ephemeris(777, 11, 36_100)), 1),
        (BDS_D1, Vec::from(d1_ephemeris(36_000, 17)), 2),
        (BDS_D2, d2_ephemeris(36_000, 17), 2),
    ];
    for (sender, parts, rounds) in cases {
        let sent = parts.iter().cycle().take(parts.len() * rounds).cloned();
        let sent: Vec<Vec<u8>> = sent.collect();
        let right = sender
            .all(&mut Collector { ..Collector::EMPTY }, &sent)
            .pop()
            .unwrap()
            .1;
        let (mut n_refused, mut n_filling) = (0, 0);
        for (part, bit) in (0..sent.len()).flat_map(|p| (0..sent[p].len() * 8).map(move |b| (p, b)))
        {
            let mut damaged = sent.clone();
            damaged[part][bit / 8] ^= 1 << (bit % 8);
            let mut collector = Collector::EMPTY;
            for (i, words) in damaged.iter().enumerate() {
                match sender.to(&mut collector, words) {
                    Ok(collected) => {
                        n_filling += usize::from(i == part);
                        assert!(
                            collected.ephemeris.is_none_or(|e| e == right),
                            "part {part} bit {bit}"
                        );
                    }
                    Err(error) => {
                        assert_eq!(i, part, "{error:?}");
                        n_refused += 1;
                    }
                }
            }
        }
        // Filling, tails and what no code covers; of BDS the four reserved bits of word 1 too.
        let filling = match sender.gnss_id {
            0 => 20,
            2 => 8 + 6 + 8 + 8 + 6,
            _ => 20 + 4,
        };
        assert_eq!(
            (n_filling, n_refused),
            (
                sent.len() * filling,
                sent.iter().map(|w| w.len() * 8).sum::<usize>() - sent.len() * filling
            )
        );
    }
}

/// INT-054
#[test]
fn parts_of_different_issues_are_not_put_together() {
    // GPS: each part of the new issue in turn; all of it gives the new one, as early as it is whole.
    let (old, new) = (
        lnav_ephemeris(1, 6000, false),
        lnav_ephemeris(2, 6005, false),
    );
    let mut collector = Collector::EMPTY;
    assert_eq!(GPS.all(&mut collector, &old).len(), 1);
    assert_eq!(GPS.all(&mut collector, &new[2..]), []);
    assert_eq!(GPS.all(&mut collector, &new[..1]), []);
    let given = GPS.all(&mut collector, &new[1..2]);
    assert_eq!(given.iter().map(|(_, e)| e.issue).collect::<Vec<_>>(), [2]);
    assert_eq!(
        GPS.all(&mut collector, &new[..2]),
        [],
        "a repetition before its last part"
    );
    assert_eq!(GPS.all(&mut collector, &new).len(), 1);

    // Galileo: words 1 to 4, and word 5 after old and new ones.
    let (old, new) = (inav_ephemeris(1, 11, 36_000), inav_ephemeris(2, 11, 36_030));
    for swapped in 0..4 {
        let mut collector = Collector::EMPTY;
        let mut mixed = old.clone();
        mixed[swapped] = new[swapped].clone();
        assert_eq!(
            GALILEO.all(&mut collector, &mixed),
            [],
            "word {}",
            swapped + 1
        );
    }
    let mut collector = Collector::EMPTY;
    assert_eq!(GALILEO.all(&mut collector, &old).len(), 1);
    // Word 5 was heard with the old issue.
    assert_eq!(GALILEO.all(&mut collector, &new[..4]), []);
    assert_eq!(GALILEO.all(&mut collector, &new[4..]).len(), 1);
    // A second word 5 without any of 1 to 4 between them is of no issue.
    assert_eq!(GALILEO.all(&mut collector, &new[4..]), []);
    assert_eq!(GALILEO.all(&mut collector, &new[..4]), []);

    // BDS: of one pass only, and every part twice alike.
    type Pass = fn(i64, i64) -> Vec<Vec<u8>>;
    let d1: Pass = |sow_s, aode| Vec::from(d1_ephemeris(sow_s, aode));
    for (sender, pass) in [(BDS_D1, d1), (BDS_D2, d2_ephemeris as Pass)] {
        let mut collector = Collector::EMPTY;
        assert_eq!(sender.all(&mut collector, &pass(36_000, 1)), []);
        let all_but_first = &pass(36_030, 1)[1..];
        assert_eq!(sender.all(&mut collector, all_but_first), []);
        assert_eq!(sender.all(&mut collector, &pass(36_060, 1)).len(), 1);
        // Another issue counts when it was heard twice.
        assert_eq!(sender.all(&mut collector, &pass(36_090, 2)), []);
        assert_eq!(sender.all(&mut collector, &pass(36_120, 2)).len(), 1);
        // Over the end of the week.
        assert_eq!(sender.all(&mut collector, &pass(604_800 - 3, 2)).len(), 1);
    }
}

#[test]
fn both_signals_of_a_satellite_fill_one_message() {
    let e5b = Sender {
        sig_id: 5,
        ..GALILEO
    };
    let words = inav_ephemeris(1, 11, 36_000);
    let mut collector = Collector::EMPTY;
    assert_eq!(GALILEO.all(&mut collector, &words[..2]), []);
    assert_eq!(e5b.all(&mut collector, &words[2..]).len(), 1);

    let b3i = Sender {
        sig_id: 4,
        ..BDS_D1
    };
    let parts = d1_ephemeris(36_000, 1);
    let mut collector = Collector::EMPTY;
    assert_eq!(BDS_D1.all(&mut collector, &parts), []);
    assert_eq!(b3i.all(&mut collector, &parts).len(), 1);
}

#[test]
fn after_a_long_silence_a_satellite_begins_anew() {
    for (gap, expected) in [(3600, 1), (3606, 0)] {
        let parts = lnav_ephemeris(1, (604_800 - 1800) / 6, false);
        let mut collector = Collector::EMPTY;
        assert_eq!(GPS.all(&mut collector, &parts[..2]), []);
        // Over the end of the week.
        let third = lnav_ephemeris(1, (604_800 - 1800 + 6 + gap - 12 - 604_800) / 6, false);
        assert_eq!(
            GPS.all(&mut collector, &third[2..]).len(),
            expected,
            "{gap} s"
        );
    }
    // Galileo: only some words tell the time.
    let (old, new) = (inav_ephemeris(1, 11, 36_000), inav_ephemeris(1, 11, 39_601));
    let mut collector = Collector::EMPTY;
    assert_eq!(GALILEO.all(&mut collector, &old).len(), 1);
    assert_eq!(GALILEO.all(&mut collector, &new), []);
    assert_eq!(GALILEO.all(&mut collector, &new).len(), 1);
}

#[test]
fn the_alert_flag_takes_the_accuracy_away_and_gives_it_back() {
    let mut collector = Collector::EMPTY;
    let index = |collector: &mut Collector, alert: bool| {
        GPS.all(collector, &lnav_ephemeris(1, 6000, alert))
            .pop()
            .unwrap()
            .1
            .accuracy_index
    };
    assert_eq!(index(&mut collector, false), 3);
    assert_eq!(index(&mut collector, true), 15);
    assert_eq!(index(&mut collector, false), 3);
}

#[test]
fn the_satellite_heard_least_recently_gives_way() {
    let mut collector = Collector::EMPTY;
    let parts = lnav_ephemeris(1, 6000, false);
    let d1 = d1_ephemeris(36_000, 1);
    let gps = |sv_id: u8| Sender { sv_id, ..GPS };
    let bds = |sv_id: u8| Sender { sv_id, ..BDS_D1 };
    assert_eq!(gps(1).all(&mut collector, &parts[..2]), []);
    assert_eq!(gps(2).all(&mut collector, &parts[..2]), []);
    for sv_id in 1..MAX_COLLECTED as u8 - 1 {
        assert_eq!(bds(sv_id).all(&mut collector, &d1[..1]), []);
    }
    // All slots are taken; satellite 1 is heard again, then one more satellite comes.
    assert_eq!(gps(1).all(&mut collector, &parts[..1]), []);
    assert_eq!(bds(63).all(&mut collector, &d1[..1]), []);
    assert_eq!(gps(1).all(&mut collector, &parts[2..]).len(), 1);
    assert_eq!(gps(2).all(&mut collector, &parts[2..]), []);

    collector.clear();
    assert_eq!(gps(1).all(&mut collector, &parts[2..]), []);
    assert_eq!(gps(1).all(&mut collector, &parts[..2]).len(), 1);
}

#[test]
fn what_is_no_message_is_refused_with_its_cause() {
    let gps = lnav_ephemeris(1, 6000, false);
    let galileo = inav_ephemeris(1, 11, 36_000);
    let d2 = d2_ephemeris(36_000, 1);
    let zeros = bits(&[(0, 57), (0, 57), (0, 57), (0, 19)]);
    let word_0 =
        |mark: i64, tow_s: i64| inav(&bits(&[(0, 6), (mark, 2), (0, 50), (0, 50), (tow_s, 20)]));
    let mut other_preamble = inav_ephemeris(1, 11, 36_000)[0].clone();
    other_preamble.rotate_left(16);
    let refused = [
        (
            Sender { gnss_id: 6, ..GPS },
            gps[0].clone(),
            SubframeError::Unsupported,
        ),
        (
            Sender { sig_id: 3, ..GPS },
            gps[0].clone(),
            SubframeError::Unsupported,
        ),
        (
            Sender {
                sig_id: 3,
                ..GALILEO
            },
            galileo[0].clone(),
            SubframeError::Unsupported,
        ),
        (
            Sender { sv_id: 0, ..GPS },
            gps[0].clone(),
            SubframeError::Satellite,
        ),
        (
            Sender { sv_id: 33, ..GPS },
            gps[0].clone(),
            SubframeError::Satellite,
        ),
        (
            Sender {
                sv_id: 255,
                ..BDS_D1
            },
            d2[0].clone(),
            SubframeError::Satellite,
        ),
        (
            Sender {
                sv_id: 12,
                ..GALILEO
            },
            galileo[3].clone(),
            SubframeError::Satellite,
        ),
        (GPS, gps[0][..36].to_vec(), SubframeError::Length),
        (GPS, vec![], SubframeError::Length),
        (GALILEO, galileo[0][..28].to_vec(), SubframeError::Length),
        (BDS_D2, d2[0][..39].to_vec(), SubframeError::Length),
        (GPS, vec![0; 40], SubframeError::Preamble),
        (BDS_D1, vec![0; 40], SubframeError::Preamble),
        (GALILEO, vec![0; 32], SubframeError::Preamble),
        (GALILEO, other_preamble, SubframeError::Preamble),
        (GPS, vec![0xFF; 40], SubframeError::Parity),
        (BDS_D1, vec![0x01; 40], SubframeError::Parity),
        (GPS, lnav(6, 6000, false, &zeros), SubframeError::Number),
        (GPS, lnav(0, 6000, false, &zeros), SubframeError::Number),
        (BDS_D1, bds(6, 36_000, &[]), SubframeError::Number),
        (
            BDS_D2,
            bds(1, 36_000, &[(43, 4, 11)]),
            SubframeError::Number,
        ),
        (BDS_D2, bds(1, 36_000, &[(43, 4, 0)]), SubframeError::Number),
        (GPS, lnav(1, 100_800, false, &zeros), SubframeError::Time),
        (BDS_D1, bds(1, 604_800, &[]), SubframeError::Time),
        (GALILEO, word_0(2, 604_800), SubframeError::Time),
    ];
    for (i, (sender, words, error)) in refused.into_iter().enumerate() {
        assert_eq!(
            sender.to(&mut Collector { ..Collector::EMPTY }, &words),
            Err(error),
            "case {i}"
        );
    }
    let mut collector = Collector::EMPTY;
    // The time of word 0 counts where it is marked as one.
    assert_eq!(
        GALILEO.to(&mut collector, &word_0(1, 604_800)),
        Ok(Collected::NOTHING)
    );
    for number in [4, 5] {
        assert_eq!(
            BDS_D1.to(&mut collector, &bds(number, 36_000, &[])),
            Ok(Collected::NOTHING)
        );
    }
    assert_eq!(
        BDS_D2.to(&mut collector, &bds(2, 36_000, &[])),
        Ok(Collected::NOTHING)
    );
}

#[test]
fn a_ninth_word_of_a_page_is_filling() {
    let mut collector = Collector::EMPTY;
    let nine = inav_ephemeris(1, 11, 36_000).map(|words| [&words[..], &[1, 2, 3, 4]].concat());
    assert_eq!(GALILEO.all(&mut collector, &nine).len(), 1);
}

#[test]
fn an_alert_page_holds_no_word() {
    let word = bits(&[(1, 6), (1, 10), (0, 56), (0, 56)]);
    let even = ["01", &word[..112]].concat();
    let odd = ["11", &word[112..], &bits(&[(0, 64)])].concat();
    let crc = bits(&[(crc24(&[&even[..], &odd].concat()), 24)]);
    let page = [even, bits(&[(0, 14)]), odd, crc, bits(&[(0, 22)])].concat();
    let words = bytes((0..8).map(|i| number(&page[32 * i..32 * i + 32])));
    let mut collector = Collector::EMPTY;
    assert_eq!(GALILEO.to(&mut collector, &words), Ok(Collected::NOTHING));
    let others = inav_ephemeris(1, 11, 36_000);
    assert_eq!(
        GALILEO.all(&mut collector, &others[1..]),
        [],
        "word 1 was not in it"
    );
}

#[test]
fn a_message_of_zeros_is_no_ephemeris() {
    let zeros = bits(&[(0, 57), (0, 57), (0, 57), (0, 19)]);
    let mut collector = Collector::EMPTY;
    for part in 1..3 {
        assert_eq!(
            GPS.to(&mut collector, &lnav(part, 6000 + part, false, &zeros)),
            Ok(Collected::NOTHING)
        );
    }
    assert_eq!(
        GPS.to(&mut collector, &lnav(3, 6003, false, &zeros)),
        Err(SubframeError::IllegalValue)
    );
    // It does not stand in the way of a right one.
    assert_eq!(
        GPS.all(&mut collector, &lnav_ephemeris(9, 6005, false))
            .len(),
        1
    );
}

/// Random bits. [KNUTH-2] 3.3.4, the multiplier of MMIX.
struct Random(u64);

impl Random {
    fn bits(&mut self, n: usize) -> String {
        let one = |_| {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            if self.0 >> 63 == 0 { '0' } else { '1' }
        };
        (0..n).map(one).collect()
    }

    /// `n` bits with `fixed` from bit `at` on.
    fn around(&mut self, n: usize, at: usize, fixed: &str) -> String {
        let mut text = self.bits(n);
        text.replace_range(at..at + fixed.len(), fixed);
        text
    }
}

#[test]
fn any_content_under_right_codes_is_refused_or_legal() {
    let mut random = Random(1);
    let mut given = [0; 4];
    let mut refused = [0; 4];
    for round in 0..300 {
        let issue = bits(&[(round, 8)]);
        let lnav = [
            lnav(1, 6000, false, &random.around(190, 120, &issue)),
            lnav(2, 6001, false, &random.around(190, 0, &issue)),
            lnav(3, 6002, false, &random.around(190, 168, &issue)),
        ];
        let inav = [1, 2, 3, 4, 5].map(|word| {
            let head = bits(&[(word, 6), (round, 10)]);
            let satellite = if word == 4 {
                bits(&[(11, 6)])
            } else {
                String::new()
            };
            inav(&random.around(128, 0, &[head, satellite].concat()))
        });
        let mut field = |start: usize, end: usize| {
            (
                start,
                end - start,
                i64::from_str_radix(&random.bits(end - start), 2).unwrap(),
            )
        };
        let mut rest = || -> Vec<_> {
            let words = (2..10).map(|i| (30 * i + 1, 30 * i + 23));
            let words = words.map(|(start, end)| field(start, end));
            words.collect()
        };
        let d1 = [1, 2, 3].map(|number| bds(number, 36_000 + 6 * (number - 1), &rest()));
        let d2: Vec<_> = (1..=10)
            .map(|page| {
                let fields = [rest(), vec![(43, 4, page)]].concat();
                bds(1, 36_000 + 3 * (page - 1), &fields)
            })
            .collect();
        let messages = [
            (GPS, Vec::from(lnav)),
            (GALILEO, Vec::from(inav)),
            (BDS_D1, [d1.clone(), d1].concat()),
            (BDS_D2, [d2.clone(), d2].concat()),
        ];
        for (i, (sender, parts)) in messages.into_iter().enumerate() {
            let mut collector = Collector::EMPTY;
            for words in parts {
                match sender.to(&mut collector, &words) {
                    Ok(Collected {
                        ephemeris: Some(e), ..
                    }) => {
                        given[i] += 1;
                        assert!(
                            e.toe_s < 604_800 && e.toc_s < 604_800 && e.sqrt_a >= 1.0,
                            "{e:?}"
                        );
                    }
                    Ok(_) => {}
                    Err(error) => {
                        let may_be = [SubframeError::IllegalValue, SubframeError::Time];
                        assert!(may_be.contains(&error), "{error:?}");
                        refused[i] += 1;
                    }
                }
            }
        }
    }
    assert!(
        given.iter().chain(&refused).all(|n| *n > 30),
        "{given:?} {refused:?}"
    );
}
