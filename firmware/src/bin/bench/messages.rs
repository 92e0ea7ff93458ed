//! RTCM 3 and UBX frames to decode. Layouts: [RTCM-3] tables 3.5-78 to 3.5-91 (MSM7), 3.5-21 (1019);
//! [UBX-F9-HPG] UBX-RXM-RAWX.

use super::sky::Random;
use surefix_core::wire::crc::crc24q;
use surefix_core::wire::ubx;

/// Longest frame.
pub const CAPACITY: usize = 1029;

struct Bits<'a> {
    bytes: &'a mut [u8; CAPACITY],
    position: usize,
}

impl Bits<'_> {
    fn put(&mut self, value: u64, width: usize) {
        for bit in (0..width).rev() {
            if value >> bit & 1 != 0
                && let Some(byte) = self.bytes.get_mut(self.position / 8)
            {
                *byte |= 0x80 >> (self.position % 8);
            }
            self.position += 1;
        }
    }
}

fn frame(out: &mut [u8; CAPACITY], fill: impl FnOnce(&mut Bits<'_>)) -> usize {
    *out = [0; CAPACITY];
    let mut bits = Bits {
        bytes: out,
        position: 24,
    };
    fill(&mut bits);
    let length = bits.position.div_ceil(8) - 3;
    out[0] = 0xD3;
    out[1] = (length >> 8) as u8;
    out[2] = length as u8;
    let crc = crc24q(&out[..3 + length]).to_be_bytes();
    out[3 + length..6 + length].copy_from_slice(&crc[1..]);
    6 + length
}

/// A 1077 with `n` satellites, each with one signal; the last message of its epoch.
pub fn msm7(random: &mut Random, n: usize, tow_ms: u32, out: &mut [u8; CAPACITY]) -> usize {
    frame(out, |bits| {
        bits.put(1077, 12);
        bits.put(1, 12);
        bits.put(u64::from(tow_ms), 30);
        bits.put(0, 1 + 3 + 7 + 2 + 2 + 1 + 3);
        bits.put(!0 << (64 - n), 64);
        bits.put(1 << 30, 32); // 1C
        bits.put(!0, n);
        let mut column = |bits: &mut Bits<'_>, width: usize, from: f64, span: f64| {
            for _ in 0..n {
                bits.put((from + span * random.unit()) as u64, width);
            }
        };
        column(bits, 8, 68.0, 12.0);
        column(bits, 4, 0.0, 0.0);
        column(bits, 10, 0.0, 1023.0);
        column(bits, 14, 0.0, 800.0);
        column(bits, 20, 0.0, 100_000.0);
        column(bits, 24, 0.0, 1_000_000.0);
        column(bits, 10, 400.0, 100.0);
        column(bits, 1, 0.0, 0.0);
        column(bits, 10, 480.0, 300.0);
        column(bits, 15, 0.0, 1000.0);
    })
}

/// A 1019 of satellite `prn`.
pub fn gps_ephemeris(random: &mut Random, prn: u8, out: &mut [u8; CAPACITY]) -> usize {
    frame(out, |bits| {
        bits.put(1019, 12);
        bits.put(u64::from(prn), 6);
        bits.put(2200 % 1024, 10);
        bits.put(0, 4 + 2 + 14);
        bits.put(7, 8); // IODE
        bits.put(345_600 / 16, 16); // toc
        bits.put(0, 8);
        bits.put(3, 16);
        bits.put(1000, 22);
        bits.put(7, 10); // IODC
        bits.put((1000.0 * random.unit()) as u64, 16); // Crs
        bits.put(12_000, 16);
        bits.put((1e9 * random.unit()) as u64, 32); // M0
        bits.put(500, 16);
        bits.put(80_000_000, 32); // e
        bits.put(4000, 16);
        bits.put(2_702_009_958, 32); // √A of 26,560 km
        bits.put(345_600 / 16, 16); // toe
        bits.put(20, 16);
        bits.put((1e9 * random.unit()) as u64, 32); // Ω0
        bits.put(30, 16);
        bits.put(656_000_000, 32); // i0
        bits.put(6000, 16);
        bits.put(400_000_000, 32); // ω
        bits.put((1 << 24) - 23_000, 24);
        bits.put(100, 14);
        bits.put(5, 8);
        bits.put(0, 6 + 1 + 1);
    })
}

/// Room for an RXM-RAWX with 48 measurements.
pub const UBX_CAPACITY: usize = 8 + 16 + 48 * 32;

/// A frame of UBX with content that is there already, `length` bytes from the seventh on.
fn ubx_frame(message: [u8; 2], length: usize, out: &mut [u8; UBX_CAPACITY]) -> usize {
    out[..2].copy_from_slice(&ubx::PREAMBLE);
    out[2..4].copy_from_slice(&message);
    out[4..6].copy_from_slice(&(length as u16).to_le_bytes());
    let sum = ubx::checksum(&out[2..6 + length]);
    out[6 + length..8 + length].copy_from_slice(&sum);
    8 + length
}

/// An RXM-RAWX with `n` satellites, GPS up to 32 and Galileo beyond, each with one signal.
pub fn rawx(random: &mut Random, n: usize, tow_s: f64, out: &mut [u8; UBX_CAPACITY]) -> usize {
    *out = [0; UBX_CAPACITY];
    out[6..14].copy_from_slice(&tow_s.to_le_bytes());
    out[14..16].copy_from_slice(&2200_u16.to_le_bytes());
    out[17] = n as u8;
    out[18] = 1;
    out[19] = 1;
    for (k, m) in out[22..].chunks_exact_mut(32).take(n).enumerate() {
        let range_m = 2.1e7 + 4e6 * random.unit();
        m[..8].copy_from_slice(&range_m.to_le_bytes());
        m[8..16].copy_from_slice(&(range_m * 5.25).to_le_bytes());
        m[16..20].copy_from_slice(&(3000.0 * random.unit() as f32).to_le_bytes());
        m[20] = if k < 32 { 0 } else { 2 };
        m[21] = 1 + (k % 32) as u8;
        m[26] = 45;
        m[30] = 0b111;
    }
    ubx_frame(ubx::RXM_RAWX, 16 + 32 * n, out)
}
