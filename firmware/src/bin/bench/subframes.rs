//! Navigation messages to decode, as u-blox receivers give them, of random content but for what must
//! be legal. Layouts: [IS-GPS-200] 20.3.3, [GAL-OS-SIS-ICD] 4.3.2, [BDS-SIS-ICD-B1I] 5.1.3, 5.2.

use super::sky::Random;
use surefix_core::wire::crc::crc24q;

/// Words of a subframe, or of a page with 8 bytes that are none of it.
pub type Words = [u8; 40];

/// Length of a page.
pub const PAGE: usize = 32;

fn random_bits(random: &mut Random, width: u32) -> u32 {
    (random.unit() * f64::from(1_u32 << width)) as u32
}

fn put(words: [u32; 10], out: &mut Words) {
    let bytes = words.into_iter().flat_map(u32::to_le_bytes);
    out.iter_mut().zip(bytes).for_each(|(to, byte)| *to = byte);
}

/// Subframe 1, 2 or 3 of LNAV.
pub fn lnav(random: &mut Random, number: u32, out: &mut Words) {
    const ISSUE: u32 = 7 << 16;
    const TIME: u32 = 345_600 / 16;
    let mut data = [0; 10].map(|_| random_bits(random, 24));
    data[0] = 0x8B << 16;
    data[1] = (57_600 + number) << 7 | number << 2;
    match number {
        1 => data[7] = ISSUE | TIME,
        2 => (data[2], data[9]) = (ISSUE, TIME << 8),
        _ => data[9] = ISSUE,
    }
    // D29* of a word that the receiver has inverted so that D30* is 0. [IS-GPS-200] table 20-XIV
    let mut star = 0;
    put(
        data.map(|data| {
            let row = |parity: u32, (mask, star): (u32, u32)| {
                parity << 1 | ((data & mask).count_ones() & 1) ^ star
            };
            let rows = [
                (0xEC_7CD2, star),
                (0x76_3E69, 0),
                (0xBB_1F34, star),
                (0x5D_8F9A, 0),
                (0xAE_C7CD, 0),
                (0x2D_EA27, star),
            ];
            let parity = rows.into_iter().fold(0, row);
            star = (parity >> 1 ^ parity) & 1;
            data << 6 | parity
        }),
        out,
    );
}

/// The page with word 1, 2, 3, 4 or 5 of I/NAV, of satellite `prn`.
pub fn inav(random: &mut Random, number: u32, prn: u8, out: &mut Words) {
    const TIME: u128 = 345_600 / 60;
    let word = (0..4).fold(0, |word: u128, _| {
        word << 32 | u128::from(random_bits(random, 31))
    });
    // Type, issue, then toe of word 1 and satellite of word 4; toc of word 4 and the time of word 5.
    let mut word = word & ((1 << 112) - 1) | u128::from(number) << 122 | 7 << 112;
    let mut set = |value: u128, width: u32, at: u32| {
        let shift = 128 - at - width;
        word = word & !(((1 << width) - 1) << shift) | value << shift;
    };
    match number {
        1 => set(TIME, 14, 16),
        4 => {
            set(u128::from(prn), 6, 16);
            set(TIME, 14, 54);
        }
        5 => set(TIME * 60, 20, 85),
        _ => {}
    }
    let even = word >> 16; // two bits, even and nominal, are 0
    let odd = 1 << 81 | (word & 0xFFFF) << 64;
    let mut covered = [0; 25];
    // 114 bits and 82 of them, behind four zeros.
    covered[..16].copy_from_slice(&(even << 10 | odd >> 72).to_be_bytes());
    covered[16..].copy_from_slice(&(odd << 56).to_be_bytes()[..9]);
    let crc = u128::from(crc24q(&covered));
    let page = [even << 14, odd << 46 | crc << 22].map(u128::to_be_bytes);
    let mut words = [0; 10];
    let (chunks, _) = page.as_flattened().as_chunks::<4>();
    for (to, chunk) in words.iter_mut().zip(chunks) {
        *to = u32::from_be_bytes(*chunk);
    }
    put(words, out);
}

/// Subframe 1, 2 or 3 of D1; `pass` counts those sent before.
pub fn d1(random: &mut Random, number: u32, pass: u32, out: &mut Words) {
    let sow_s = 345_600 + 30 * pass + 6 * (number - 1);
    let mut data = [0; 10].map(|_| random_bits(random, 22));
    data[0] = 0b111_0001_0010 << 11; // one code only
    data[1] = data[1] & 0x3FF | (sow_s & 0xFFF) << 10;
    match number {
        1 => data[2] &= !0x1FF, // the upper bits of toc
        2 => data[9] &= !0b11,  // and of toe
        _ => {}
    }
    // Remainder by X⁴ + X + 1 of 11 bits and four zeros.
    let code = |data: u32| {
        let divided = |left: u32, at: u32| left ^ ((left >> at & 1) * (0b1_0011 << (at - 4)));
        (4..15).rev().fold((data & 0x7FF) << 4, divided)
    };
    let mut words = data.map(|data| data << 8 | code(data >> 11) << 4 | code(data));
    let head = number << 8 | sow_s >> 12;
    words[0] = 0b111_0001_0010 << 19 | head << 4 | code(head);
    put(words, out);
}
