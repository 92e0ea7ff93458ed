//! ADIS16465, ADIS16470 and ADIS16505 ([ADIS16465], [ADIS16470], [ADIS16505]).
//!
//! Registers of 16 bits at even addresses, two bytes each, low byte first; a read is answered in the next
//! transfer of 16 bits. Writing the high byte of GLOB_CMD starts a command. An inertial register pair
//! holds 32 bits in two's complement, low word first; the 16-bit number is its high word. A transfer that
//! is not a multiple of 16 bits is an error in DIAG_STAT, which reading clears.

use std::f64::consts::PI;

use super::{Fault, Faults, Motion, Part, line, rounded};

const DIAG_STAT: usize = 0x02;
const X_GYRO_LOW: usize = 0x04;
const TEMP_OUT: usize = 0x1c;
const DATA_CNTR: usize = 0x22;
const X_DELTANG_LOW: usize = 0x24;
const RANG_MDL: usize = 0x5e;
const MSC_CTRL: usize = 0x60;
const DEC_RATE: usize = 0x64;
const GLOB_CMD: usize = 0x68;
const PROD_ID: usize = 0x72;

/// Least time between transfers of 16 bits, ns.
const STALL_NS: u64 = 16_000;
const RESET_NS: u64 = 255_000_000;
const SELF_TEST_NS: u64 = 24_000_000;

/// Product, dash number, scales.
#[derive(Clone, Copy, Debug)]
struct Kind {
    product: u16,
    range_model: u16,
    lsb_per_dps: f64,
    lsb_per_mps2: f64,
    full_angle_deg: f64,
    full_velocity_mps: f64,
    has_burst_32: bool,
}

fn kind(product: u16, dash: u8) -> Kind {
    let (range_model, lsb_per_dps, full_angle_deg) = match dash {
        1 => (0x0003, 160.0, 360.0),
        2 => (0x0007, 40.0, 720.0),
        3 => (0x000f, 10.0, 2160.0),
        other => panic!("no ADIS{product}-{other}"),
    };
    let g = 9.806_65;
    let (lsb_per_mps2, full_velocity_mps, has_burst_32) = match product {
        16_465 => (4000.0 / g, 100.0, false),
        16_470 => (800.0 / g, 400.0, false),
        16_505 => (26_756_268.0 / 65_536.0, 100.0, true),
        other => panic!("no ADIS{other}"),
    };
    Kind {
        product,
        range_model,
        lsb_per_dps,
        lsb_per_mps2,
        full_angle_deg,
        full_velocity_mps,
        has_burst_32,
    }
}

/// One part.
pub struct Adis {
    kind: Kind,
    registers: [u8; 128],
    /// What the next transfer of 16 bits brings.
    answer: u16,
    /// Busy with a reset or a test until then.
    busy_until_ns: u64,
    next_sample_ns: u64,
    now_ns: u64,
    edge_ns: Option<u64>,
    last_edge_ns: u64,
    paused_ns: u64,
    stall_violations: u32,
    faults: Faults,
}

impl Adis {
    /// ADIS`product`-`dash` after power-up; the ADIS16470 has the range of dash 3.
    pub fn new(product: u16, dash: u8) -> Self {
        let mut part = Self {
            kind: kind(product, dash),
            registers: [0; 128],
            answer: 0,
            busy_until_ns: 0,
            next_sample_ns: 0,
            now_ns: 0,
            edge_ns: None,
            last_edge_ns: 0,
            paused_ns: u64::MAX,
            stall_violations: 0,
            faults: Faults::default(),
        };
        part.reset();
        part
    }

    /// Transfers that came too soon after the one before.
    pub fn stall_violations(&self) -> u32 {
        self.stall_violations
    }

    /// The supply fails for a moment: all registers as after power-up, and the counter begins again.
    pub fn brown_out(&mut self) {
        self.reset();
        self.busy_until_ns = self.now_ns + 310_000_000;
        self.next_sample_ns = self.busy_until_ns + self.interval_ns();
    }

    /// A register changes by itself.
    pub fn upset(&mut self, address: u8, value: u16) {
        self.set_word(usize::from(address), value);
    }

    fn word(&self, address: usize) -> u16 {
        u16::from_le_bytes([self.registers[address], self.registers[address + 1]])
    }

    fn set_word(&mut self, address: usize, value: u16) {
        let [low, high] = value.to_le_bytes();
        self.registers[address] = low;
        self.registers[address + 1] = high;
    }

    fn set_long(&mut self, address: usize, value: i32) {
        self.set_word(address, value as u16);
        self.set_word(address + 2, (value >> 16) as u16);
    }

    fn reset(&mut self) {
        self.registers = [0; 128];
        self.set_word(PROD_ID, self.kind.product);
        self.set_word(RANG_MDL, self.kind.range_model);
        self.set_word(MSC_CTRL, 0x00c1);
        self.edge_ns = None;
    }

    fn interval_ns(&self) -> u64 {
        (u64::from(self.word(DEC_RATE)) + 1) * 500_000
    }

    /// A byte is written.
    fn write(&mut self, address: usize, value: u8) {
        let word = address & !1;
        if self.faults.loses(word as u8) {
            return;
        }
        // Only control registers and the scratch registers take writes.
        if !(0x40..=0x6b).contains(&address) && !(0x76..=0x7b).contains(&address)
            || word == RANG_MDL
        {
            return;
        }
        self.registers[address] = value;
        if word == MSC_CTRL && !self.kind.has_burst_32 {
            self.registers[MSC_CTRL + 1] &= !0x03;
        }
        if word == DEC_RATE {
            self.next_sample_ns = self.now_ns + self.interval_ns();
        }
        if address == GLOB_CMD + 1 {
            self.command();
        }
    }

    fn command(&mut self) {
        let command = self.word(GLOB_CMD);
        self.set_word(GLOB_CMD, 0);
        if command & 0x80 != 0 {
            self.reset();
            self.busy_until_ns = self.now_ns + RESET_NS;
        } else if command & 0x04 != 0 {
            self.busy_until_ns = self.now_ns + SELF_TEST_NS;
            if self.faults.has(Fault::SelfTestFails) {
                self.set_word(DIAG_STAT, 0x0020);
            }
        }
        self.next_sample_ns = self.busy_until_ns + self.interval_ns();
    }

    fn read(&mut self, address: usize) -> u16 {
        let word = self.word(address & 0x7e);
        if address & 0x7e == DIAG_STAT {
            self.set_word(DIAG_STAT, 0);
        }
        if address & 0x7e == PROD_ID && self.faults.has(Fault::WrongId) {
            return word + 1;
        }
        word
    }

    /// The words of a burst, with their sum.
    fn burst(&mut self) -> Vec<u16> {
        let control = self.word(MSC_CTRL);
        let is_long = control & 0x0200 != 0;
        let first = if control & 0x0100 != 0 {
            X_DELTANG_LOW
        } else {
            X_GYRO_LOW
        };
        let mut words = vec![self.read(DIAG_STAT)];
        for axis in 0..6 {
            if is_long {
                words.push(self.word(first + 4 * axis));
            }
            words.push(self.word(first + 4 * axis + 2));
        }
        words.push(self.word(TEMP_OUT));
        words.push(self.word(DATA_CNTR));
        let sum = words
            .iter()
            .map(|word| (word >> 8) + (word & 0xff))
            .fold(0_u16, u16::wrapping_add);
        words.push(sum);
        self.edge_ns = None;
        words
    }

    fn sample(&mut self, time_ns: u64, motion: &Motion) {
        let interval_s = self.interval_ns() as f64 * 1e-9;
        for axis in 0..3 {
            let rate_dps = motion.omega_is_s_radps[axis] * 180.0 / PI;
            let force_mps2 = motion.f_is_s_mps2[axis];
            let longs = [
                (X_GYRO_LOW, rate_dps * self.kind.lsb_per_dps * 65_536.0),
                (
                    X_GYRO_LOW + 12,
                    force_mps2 * self.kind.lsb_per_mps2 * 65_536.0,
                ),
                (
                    X_DELTANG_LOW,
                    rate_dps * interval_s / self.kind.full_angle_deg * 2_147_483_648.0,
                ),
                (
                    X_DELTANG_LOW + 12,
                    force_mps2 * interval_s / self.kind.full_velocity_mps * 2_147_483_648.0,
                ),
            ];
            for (address, value) in longs {
                let value = if self.faults.has(Fault::Saturated) {
                    i32::MAX
                } else {
                    rounded(value, i32::MIN, i32::MAX)
                };
                self.set_long(address + 4 * axis, value);
            }
        }
        let temperature = rounded(motion.temperature_c * 10.0, -32_768, 32_767);
        self.set_word(TEMP_OUT, temperature as u16);
        let counter = self
            .word(DATA_CNTR)
            .wrapping_add(self.faults.counter_step());
        self.set_word(DATA_CNTR, counter);
        let mut status = self.word(DIAG_STAT);
        if self.faults.has(Fault::Overrun) {
            status |= 0x0002;
        }
        if self.faults.has(Fault::Failing) {
            status |= 0x0020;
        }
        self.set_word(DIAG_STAT, status);
        self.edge_ns = Some(time_ns);
        self.last_edge_ns = time_ns;
    }

    /// The answer to a transfer, without the wires.
    fn exchange(&mut self, mosi: &[u8], miso: &mut [u8]) {
        if !mosi.len().is_multiple_of(2) {
            let status = self.word(DIAG_STAT);
            self.set_word(DIAG_STAT, status | 0x0008);
        }
        if self.now_ns < self.busy_until_ns || self.faults.has(Fault::ResetStuck) {
            miso.fill(0);
            return;
        }
        let is_burst = mosi.len() > 2 && mosi[..2] == [GLOB_CMD as u8, 0];
        let mut burst = Vec::new();
        for (place, (sent, received)) in mosi
            .chunks_exact(2)
            .zip(miso.chunks_exact_mut(2))
            .enumerate()
        {
            let answer = match place.checked_sub(1) {
                Some(place) if is_burst => burst.get(place).copied().unwrap_or(0),
                _ => self.answer,
            };
            received.copy_from_slice(&answer.to_be_bytes());
            if is_burst {
                if place == 0 {
                    burst = self.burst();
                }
            } else if sent[0] & 0x80 != 0 {
                self.write(usize::from(sent[0] & 0x7f), sent[1]);
                self.answer = 0;
            } else {
                self.answer = self.read(usize::from(sent[0]));
            }
        }
    }
}

impl Part for Adis {
    fn transfer(&mut self, mosi: &[u8], miso: &mut [u8]) {
        if self.paused_ns < STALL_NS {
            self.stall_violations += 1;
        }
        self.paused_ns = 0;
        self.exchange(mosi, miso);
        self.faults.on_line(miso);
    }

    fn pause(&mut self, ns: u64) {
        self.paused_ns = self.paused_ns.saturating_add(ns);
    }

    fn advance(&mut self, now_ns: u64, motion: &Motion) {
        self.paused_ns = self
            .paused_ns
            .saturating_add(now_ns.saturating_sub(self.now_ns));
        self.now_ns = now_ns;
        if now_ns < self.busy_until_ns {
            return;
        }
        while self.next_sample_ns <= now_ns {
            let time_ns = self.next_sample_ns;
            if !self.faults.has(Fault::Silent) {
                self.sample(time_ns, motion);
            }
            self.next_sample_ns += self.interval_ns();
        }
    }

    fn next_ns(&self) -> u64 {
        self.next_sample_ns.max(self.busy_until_ns)
    }

    fn data_ready_ns(&self) -> Option<u64> {
        line(&self.faults, self.edge_ns, self.last_edge_ns)
    }

    fn faults(&mut self) -> &mut Faults {
        &mut self.faults
    }
}
