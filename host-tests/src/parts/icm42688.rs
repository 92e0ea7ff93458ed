//! ICM-42688-P ([ICM-42688-P]).
//!
//! Registers of eight bits in five banks that share REG_BANK_SEL; a read has bit 7 of its address set and
//! moves on by itself, except at FIFO_DATA. A FIFO of 2 kB holds packets of 16 bytes: header,
//! accelerations, rates, temperature, time stamp; when it is full the oldest is lost and counted. Reading
//! an empty FIFO gives ones. A software reset sets RESET_DONE, and reading INT_STATUS clears it.

use std::collections::VecDeque;
use std::f64::consts::PI;

use super::{Fault, Faults, Motion, Part, line, rounded};

const DEVICE_CONFIG: usize = 0x11;
const FIFO_CONFIG: usize = 0x16;
const TEMP_DATA1: usize = 0x1d;
const GYRO_DATA_Z0: usize = 0x2a;
const INT_STATUS: usize = 0x2d;
const FIFO_COUNTH: usize = 0x2e;
const FIFO_COUNTL: usize = 0x2f;
const FIFO_DATA: usize = 0x30;
const SIGNAL_PATH_RESET: usize = 0x4b;
const INTF_CONFIG0: usize = 0x4c;
const PWR_MGMT0: usize = 0x4e;
const GYRO_CONFIG0: usize = 0x4f;
const ACCEL_CONFIG0: usize = 0x50;
const FIFO_CONFIG1: usize = 0x5f;
const INT_SOURCE0: usize = 0x65;
const FIFO_LOST_PKT0: usize = 0x6c;
const FIFO_LOST_PKT1: usize = 0x6d;
const SELF_TEST_CONFIG: usize = 0x70;
const WHO_AM_I: usize = 0x75;
const REG_BANK_SEL: usize = 0x76;

/// Values of bank 0 after a reset that are not zero.
const DEFAULTS: [(usize, u8); 10] = [
    (0x13, 0x05),
    (INTF_CONFIG0, 0x30),
    (0x4d, 0x91),
    (GYRO_CONFIG0, 0x06),
    (ACCEL_CONFIG0, 0x06),
    (0x51, 0x16),
    (0x52, 0x11),
    (0x54, 0x23),
    (0x64, 0x10),
    (INT_SOURCE0, 0x10),
];
/// Packets of 16 bytes in 2 kB.
const FIFO_PACKETS: usize = 128;
const RESET_NS: u64 = 1_000_000;
/// The factory's codes of the self-test, x to z: accelerometers, gyroscopes.
const ACCEL_CODES: [u8; 3] = [80, 90, 100];
const GYRO_CODES: [u8; 3] = [120, 60, 1];

/// One part.
pub struct Icm42688 {
    banks: [[u8; 128]; 5],
    bank: usize,
    fifo: VecDeque<[u8; 16]>,
    lost: u16,
    /// Bits of INT_STATUS that reading clears.
    status: u8,
    time_stamp_us: u64,
    busy_until_ns: u64,
    next_sample_ns: u64,
    now_ns: u64,
    edge_ns: Option<u64>,
    last_edge_ns: u64,
    has_codes: bool,
    faults: Faults,
}

impl Default for Icm42688 {
    fn default() -> Self {
        Self::new()
    }
}

impl Icm42688 {
    /// A part after power-up.
    pub fn new() -> Self {
        let mut part = Self {
            banks: [[0; 128]; 5],
            bank: 0,
            fifo: VecDeque::new(),
            lost: 0,
            status: 0,
            time_stamp_us: 0,
            busy_until_ns: 0,
            next_sample_ns: 0,
            now_ns: 0,
            edge_ns: None,
            last_edge_ns: 0,
            has_codes: true,
            faults: Faults::default(),
        };
        part.reset();
        part
    }

    /// A part in which the factory left no codes of the self-test.
    pub fn without_codes() -> Self {
        let mut part = Self::new();
        part.has_codes = false;
        part.reset();
        part
    }

    /// A register changes by itself.
    pub fn upset(&mut self, address: u8, value: u8) {
        self.banks[0][usize::from(address)] = value;
    }

    fn reset(&mut self) {
        self.banks = [[0; 128]; 5];
        for (address, value) in DEFAULTS {
            self.banks[0][address] = value;
        }
        for bank in &mut self.banks {
            bank[WHO_AM_I] = 0x47;
        }
        if self.has_codes {
            self.banks[1][0x5f..0x62].copy_from_slice(&GYRO_CODES);
            self.banks[2][0x3b..0x3e].copy_from_slice(&ACCEL_CODES);
        }
        self.bank = 0;
        self.fifo.clear();
        self.lost = 0;
        self.status = 0x10;
        self.edge_ns = None;
        self.next_sample_ns = u64::MAX;
    }

    fn register(&self, address: usize) -> u8 {
        self.banks[0][address]
    }

    /// None while a sensor is off or the rate is none of those that are modelled.
    fn interval_ns(&self) -> Option<u64> {
        if self.register(PWR_MGMT0) & 0x0f != 0x0f {
            return None;
        }
        match self.register(GYRO_CONFIG0) & 0x0f {
            0x06 => Some(1_000_000),
            0x07 => Some(5_000_000),
            0x08 => Some(10_000_000),
            0x0f => Some(2_000_000),
            _ => None,
        }
    }

    fn write(&mut self, address: usize, value: u8) {
        if address == REG_BANK_SEL {
            self.bank = usize::from(value & 0x07).min(4);
            return;
        }
        if self.faults.loses(address as u8) {
            return;
        }
        let is_read_only = self.bank == 0 && (TEMP_DATA1..=FIFO_DATA).contains(&address);
        if is_read_only || address == WHO_AM_I {
            return;
        }
        self.banks[self.bank][address] = value;
        if self.bank != 0 {
            return;
        }
        match address {
            DEVICE_CONFIG if value & 0x01 != 0 && !self.faults.has(Fault::ResetStuck) => {
                self.reset();
                self.busy_until_ns = self.now_ns + RESET_NS;
            }
            DEVICE_CONFIG => self.status &= !0x10,
            SIGNAL_PATH_RESET => {
                if value & 0x02 != 0 {
                    self.fifo.clear();
                    self.edge_ns = None;
                }
                self.banks[0][SIGNAL_PATH_RESET] = 0;
            }
            PWR_MGMT0 | GYRO_CONFIG0 => {
                self.next_sample_ns = match self.interval_ns() {
                    Some(interval_ns) => self.now_ns + interval_ns,
                    None => u64::MAX,
                };
            }
            _ => {}
        }
    }

    fn read(&mut self, address: usize) -> u8 {
        if address == REG_BANK_SEL {
            return self.bank as u8;
        }
        if self.bank != 0 {
            return self.banks[self.bank][address];
        }
        let count = self.fifo.len() as u16
            * if self.register(INTF_CONFIG0) & 0x40 == 0 {
                16
            } else {
                1
            };
        let [mut high, mut low] = count.to_be_bytes();
        if self.register(INTF_CONFIG0) & 0x20 == 0 {
            (high, low) = (low, high);
        }
        match address {
            WHO_AM_I if self.faults.has(Fault::WrongId) => 0x44,
            INT_STATUS => std::mem::take(&mut self.status),
            FIFO_COUNTH => high,
            FIFO_COUNTL => low,
            FIFO_LOST_PKT0 => self.lost as u8,
            FIFO_LOST_PKT1 => (self.lost >> 8) as u8,
            _ => self.register(address),
        }
    }

    /// Bytes of the FIFO; a packet that is read in part stays.
    fn read_fifo(&mut self, into: &mut [u8]) {
        into.fill(0xff);
        for bytes in into.chunks_mut(16) {
            if bytes.len() == 16 {
                if let Some(packet) = self.fifo.pop_front() {
                    bytes.copy_from_slice(&packet);
                }
            } else if let Some(packet) = self.fifo.front() {
                bytes.copy_from_slice(&packet[..bytes.len()]);
            }
        }
        if self.fifo.is_empty() {
            self.edge_ns = None;
        }
    }

    /// What the test's forces add, LSB, for accelerations and rates.
    fn test_answer(&self) -> [f64; 6] {
        let on = self.register(SELF_TEST_CONFIG);
        let mut answer = [0.0; 6];
        let codes = ACCEL_CODES.into_iter().chain(GYRO_CODES);
        for (place, code) in codes.enumerate() {
            // Gyroscopes are bits 0 to 2, accelerometers 3 to 5 and their supply bit 6.
            let (is_on, config) = if place < 3 {
                let is_on = on & 1 << (3 + place) != 0 && on & 0x40 != 0;
                (is_on, self.register(ACCEL_CONFIG0))
            } else {
                (on & 1 << (place - 3) != 0, self.register(GYRO_CONFIG0))
            };
            if is_on {
                // The codes are for the range of code 3.
                let range = 2.0_f64.powi(i32::from(config >> 5) - 3);
                let factory = if self.has_codes {
                    2620.0 * 1.01_f64.powi(i32::from(code) - 1)
                } else if place < 3 {
                    0.5 * 16_384.0
                } else {
                    100.0 * 32_768.0 / 250.0
                };
                answer[place] = factory * range;
            }
        }
        if self.faults.has(Fault::SelfTestFails) {
            answer[3] *= 0.1;
        }
        if self.faults.has(Fault::SelfTestTooStrong) {
            answer[0] *= 3.0;
        }
        answer
    }

    /// Accelerations and rates as the part rounds them.
    fn measured(&self, motion: &Motion) -> [i16; 6] {
        let accel_lsb = 32_768.0 / f64::from(16_u8 >> (self.register(ACCEL_CONFIG0) >> 5));
        let gyro_lsb = 32_768.0 / (2000.0 / f64::from(1_u8 << (self.register(GYRO_CONFIG0) >> 5)));
        let answer = self.test_answer();
        let mut axes = [0; 6];
        for axis in 0..3 {
            let force_g = motion.f_is_s_mps2[axis] / 9.806_65;
            let rate_dps = motion.omega_is_s_radps[axis] * 180.0 / PI;
            let accel = rounded(force_g * accel_lsb + answer[axis], -32_767, 32_767);
            let gyro = rounded(rate_dps * gyro_lsb + answer[axis + 3], -32_767, 32_767);
            (axes[axis], axes[axis + 3]) = (accel as i16, gyro as i16);
        }
        if self.faults.has(Fault::Saturated) {
            axes = [32_767; 6];
        }
        if self.faults.has(Fault::NoNumber) {
            axes[3] = i16::MIN;
        }
        axes
    }

    fn sample(&mut self, time_ns: u64, interval_ns: u64, motion: &Motion) {
        let axes = self.measured(motion);
        let above_c = motion.temperature_c - 25.0;
        let temperature = rounded(above_c * 132.48, -32_768, 32_767) as i16;
        let packet_temperature = rounded(above_c * 2.07, -128, 127) as i8;
        self.time_stamp_us += u64::from(self.faults.counter_step()) * interval_ns / 1000;
        let stamp = (self.time_stamp_us as u16).to_be_bytes();

        let mut data = Vec::from(temperature.to_be_bytes());
        for axis in axes {
            data.extend(axis.to_be_bytes());
        }
        self.banks[0][TEMP_DATA1..=GYRO_DATA_Z0].copy_from_slice(&data);
        self.status |= 0x08;

        let is_streaming = self.register(FIFO_CONFIG) >> 6 == 1;
        let wants_both = self.register(FIFO_CONFIG1) & 0x07 == 0x07;
        if !is_streaming || !wants_both {
            return;
        }
        let mut packet = [0; 16];
        packet[0] = 0x68;
        packet[1..13].copy_from_slice(&data[2..]);
        packet[13] = packet_temperature as u8;
        packet[14..].copy_from_slice(&stamp);
        if self.fifo.len() == FIFO_PACKETS {
            self.fifo.pop_front();
            self.lost = self.lost.wrapping_add(1);
            self.status |= 0x02;
        }
        self.fifo.push_back(packet);
        self.status |= 0x04;
        if self.register(INT_SOURCE0) & 0x04 != 0 {
            self.edge_ns = Some(time_ns);
            self.last_edge_ns = time_ns;
        }
    }
}

impl Part for Icm42688 {
    fn transfer(&mut self, mosi: &[u8], miso: &mut [u8]) {
        miso.fill(0);
        if let (Some((&command, sent)), Some((_, received))) =
            (mosi.split_first(), miso.split_first_mut())
            && self.now_ns >= self.busy_until_ns
        {
            let address = usize::from(command & 0x7f);
            if command & 0x80 == 0 {
                if let Some(&value) = sent.first() {
                    self.write(address, value);
                }
            } else if self.bank == 0 && address == FIFO_DATA {
                self.read_fifo(received);
            } else {
                for (offset, byte) in received.iter_mut().enumerate() {
                    *byte = self.read((address + offset) & 0x7f);
                }
            }
        }
        self.faults.on_line(miso);
    }

    fn advance(&mut self, now_ns: u64, motion: &Motion) {
        self.now_ns = now_ns;
        while let Some(interval_ns) = self.interval_ns()
            && self.next_sample_ns <= now_ns
        {
            let time_ns = self.next_sample_ns;
            if !self.faults.has(Fault::Silent) {
                self.sample(time_ns, interval_ns, motion);
            }
            self.next_sample_ns += interval_ns;
        }
    }

    fn next_ns(&self) -> u64 {
        match self.interval_ns() {
            Some(_) => self.next_sample_ns,
            None => u64::MAX,
        }
    }

    fn data_ready_ns(&self) -> Option<u64> {
        line(&self.faults, self.edge_ns, self.last_edge_ns)
    }

    fn faults(&mut self) -> &mut Faults {
        &mut self.faults
    }
}
