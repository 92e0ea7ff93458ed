//! BMP390 ([BMP390]).
//!
//! Registers of eight bits; a read has bit 7 of its address set, and its first byte means nothing. The
//! trimming coefficients are those of no real part; their CRC stands before them. What the part measures
//! is found from pressure and temperature by solving the data sheet's compensation backwards.

use super::{Fault, Faults, Motion, Part, line};

const ERR_REG: usize = 0x02;
const STATUS: usize = 0x03;
const DATA_0: usize = 0x04;
const EVENT: usize = 0x10;
const INT_CTRL: usize = 0x19;
const PWR_CTRL: usize = 0x1b;
const ODR: usize = 0x1d;
const TRIMMING: usize = 0x30;
const CMD: usize = 0x7e;

const RESET_NS: u64 = 2_000_000;

/// Coefficients as integers: T1 to T3, P1 to P11.
#[derive(Clone, Copy, Debug)]
struct Coefficients {
    t1: u16,
    t2: u16,
    t3: i8,
    p1: i16,
    p2: i16,
    p3: i8,
    p4: i8,
    p5: u16,
    p6: u16,
    p7: i8,
    p8: i8,
    p9: i16,
    p10: i8,
    p11: i8,
}

const COEFFICIENTS: Coefficients = Coefficients {
    t1: 27_504,
    t2: 19_180,
    t3: -7,
    p1: 123,
    p2: -1500,
    p3: 10,
    p4: 3,
    p5: 24_480,
    p6: 30_000,
    p7: -8,
    p8: -6,
    p9: 3000,
    p10: 20,
    p11: -60,
};

impl Coefficients {
    fn bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        bytes.extend(self.t1.to_le_bytes());
        bytes.extend(self.t2.to_le_bytes());
        bytes.extend(self.t3.to_le_bytes());
        bytes.extend(self.p1.to_le_bytes());
        bytes.extend(self.p2.to_le_bytes());
        bytes.extend(self.p3.to_le_bytes());
        bytes.extend(self.p4.to_le_bytes());
        bytes.extend(self.p5.to_le_bytes());
        bytes.extend(self.p6.to_le_bytes());
        bytes.extend(self.p7.to_le_bytes());
        bytes.extend(self.p8.to_le_bytes());
        bytes.extend(self.p9.to_le_bytes());
        bytes.extend(self.p10.to_le_bytes());
        bytes.extend(self.p11.to_le_bytes());
        bytes
    }

    fn temperature_c(&self, raw: u32) -> f64 {
        let above = f64::from(raw) - f64::from(self.t1) * 256.0;
        above * (f64::from(self.t2) * 2.0_f64.powi(-30))
            + above.powi(2) * (f64::from(self.t3) * 2.0_f64.powi(-48))
    }

    fn pressure_pa(&self, raw: u32, t: f64) -> f64 {
        let scaled = |value: f64, exponent: i32| value * 2.0_f64.powi(-exponent);
        let offset = f64::from(self.p5) * 8.0
            + scaled(f64::from(self.p6), 6) * t
            + scaled(f64::from(self.p7), 8) * t.powi(2)
            + scaled(f64::from(self.p8), 15) * t.powi(3);
        let slope = scaled(f64::from(self.p1) - 16_384.0, 20)
            + scaled(f64::from(self.p2) - 16_384.0, 29) * t
            + scaled(f64::from(self.p3), 32) * t.powi(2)
            + scaled(f64::from(self.p4), 37) * t.powi(3);
        let square = scaled(f64::from(self.p9), 48) + scaled(f64::from(self.p10), 48) * t;
        let cube = scaled(f64::from(self.p11), 65);
        let raw = f64::from(raw);
        offset + slope * raw + square * raw.powi(2) + cube * raw.powi(3)
    }
}

/// The 24-bit number at which a falling or rising function comes nearest to a value.
fn solve(function: impl Fn(u32) -> f64, value: f64) -> u32 {
    let (mut low, mut high) = (0, 0x00ff_ffff);
    let rises = function(high) > function(low);
    while high - low > 1 {
        let middle = u32::midpoint(low, high);
        if (function(middle) < value) == rises {
            low = middle;
        } else {
            high = middle;
        }
    }
    let off = |raw| (function(raw) - value).abs();
    if off(low) < off(high) { low } else { high }
}

fn crc(bytes: &[u8]) -> u8 {
    // Bit by bit through a register of eight bits, polynomial x⁸ + x⁴ + x³ + x² + 1.
    let mut register = 0xff_u8;
    for byte in bytes {
        for bit in (0..8).rev() {
            let feedback = (register >> 7) ^ ((byte >> bit) & 1);
            register = (register << 1) ^ (0x1d * feedback);
        }
    }
    !register
}

/// One part.
pub struct Bmp390 {
    registers: [u8; 128],
    /// NVM_PAR_T1 to NVM_PAR_P11.
    trimming: [u8; 21],
    busy_until_ns: u64,
    next_sample_ns: u64,
    now_ns: u64,
    edge_ns: Option<u64>,
    last_edge_ns: u64,
    faults: Faults,
}

impl Default for Bmp390 {
    fn default() -> Self {
        Self::new()
    }
}

impl Bmp390 {
    /// A part after power-up.
    pub fn new() -> Self {
        let mut trimming = [0; 21];
        trimming.copy_from_slice(&COEFFICIENTS.bytes());
        Self::with_trimming(trimming)
    }

    /// A part with these coefficients; what it measures is still made with the others.
    pub fn with_trimming(trimming: [u8; 21]) -> Self {
        let mut part = Self {
            registers: [0; 128],
            trimming,
            busy_until_ns: 0,
            next_sample_ns: u64::MAX,
            now_ns: 0,
            edge_ns: None,
            last_edge_ns: 0,
            faults: Faults::default(),
        };
        part.reset();
        part
    }

    /// What one step of the pressure's number is worth where the part is, Pa.
    pub fn resolution_pa(motion: &Motion) -> f64 {
        let (pressure, temperature) = raw(motion);
        let t = COEFFICIENTS.temperature_c(temperature);
        (COEFFICIENTS.pressure_pa(pressure + 1, t) - COEFFICIENTS.pressure_pa(pressure, t)).abs()
    }

    /// A register changes by itself.
    pub fn upset(&mut self, address: u8, value: u8) {
        self.registers[usize::from(address)] = value;
    }

    fn reset(&mut self) {
        self.registers = [0; 128];
        self.registers[0] = 0x60;
        self.registers[1] = 0x01;
        self.registers[STATUS] = 0x10;
        self.registers[DATA_0 + 2] = 0x80;
        self.registers[DATA_0 + 5] = 0x80;
        self.registers[EVENT] = 0x01;
        self.registers[0x1c] = 0x02;
        self.registers[TRIMMING] = crc(&self.trimming);
        self.registers[TRIMMING + 1..TRIMMING + 22].copy_from_slice(&self.trimming);
        self.edge_ns = None;
        self.next_sample_ns = u64::MAX;
    }

    fn interval_ns(&self) -> u64 {
        5_000_000 << (self.registers[ODR] & 0x1f)
    }

    fn write(&mut self, address: usize, value: u8) {
        if self.faults.loses(address as u8) {
            return;
        }
        match address {
            CMD if value == 0xb6 => {
                if self.faults.has(Fault::ResetStuck) {
                    self.registers[EVENT] = 0;
                } else {
                    self.reset();
                    self.busy_until_ns = self.now_ns + RESET_NS;
                }
                if self.faults.has(Fault::SelfTestFails) {
                    self.registers[ERR_REG] = 0x01;
                }
            }
            INT_CTRL..=0x1f => self.registers[address] = value,
            _ => {}
        }
        let power = self.registers[PWR_CTRL];
        self.next_sample_ns = if power & 0x03 == 0x03 && power >> 4 & 0x03 == 0x03 {
            self.now_ns + self.interval_ns()
        } else {
            u64::MAX
        };
    }

    fn read(&mut self, address: usize) -> u8 {
        let value = self.registers[address];
        match address {
            0x00 if self.faults.has(Fault::WrongId) => return 0x50,
            TRIMMING if self.faults.has(Fault::BadTrimming) => return value ^ 0x04,
            EVENT => self.registers[EVENT] = 0,
            // Reading the last byte of each number ends that it is new.
            0x06 => self.registers[STATUS] &= !0x20,
            0x09 => {
                self.registers[STATUS] &= !0x40;
                self.edge_ns = None;
            }
            _ => {}
        }
        value
    }

    fn sample(&mut self, time_ns: u64, motion: &Motion) {
        let (mut pressure, mut temperature) = raw(motion);
        if self.faults.has(Fault::NoNumber) {
            (pressure, temperature) = (0x80_0000, 0x80_0000);
        }
        if self.faults.has(Fault::Saturated) {
            pressure = 0;
        }
        self.registers[DATA_0..DATA_0 + 3].copy_from_slice(&pressure.to_le_bytes()[..3]);
        self.registers[DATA_0 + 3..DATA_0 + 6].copy_from_slice(&temperature.to_le_bytes()[..3]);
        self.registers[STATUS] |= 0x60;
        if self.faults.has(Fault::Failing) {
            self.registers[ERR_REG] = 0x01;
        }
        if self.registers[INT_CTRL] & 0x40 != 0 {
            self.edge_ns = Some(time_ns);
            self.last_edge_ns = time_ns;
        }
    }
}

/// The numbers of pressure and temperature.
fn raw(motion: &Motion) -> (u32, u32) {
    let temperature = solve(|raw| COEFFICIENTS.temperature_c(raw), motion.temperature_c);
    let t = COEFFICIENTS.temperature_c(temperature);
    let pressure = solve(|raw| COEFFICIENTS.pressure_pa(raw, t), motion.pressure_pa);
    (pressure, temperature)
}

impl Part for Bmp390 {
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
            } else {
                // The first byte means nothing.
                for (offset, byte) in received.iter_mut().skip(1).enumerate() {
                    *byte = self.read((address + offset) & 0x7f);
                }
            }
        }
        self.faults.on_line(miso);
    }

    fn advance(&mut self, now_ns: u64, motion: &Motion) {
        self.now_ns = now_ns;
        while self.next_sample_ns <= now_ns {
            let time_ns = self.next_sample_ns;
            if !self.faults.has(Fault::Silent) {
                self.sample(time_ns, motion);
            }
            self.next_sample_ns += self.interval_ns();
        }
    }

    fn next_ns(&self) -> u64 {
        self.next_sample_ns
    }

    fn data_ready_ns(&self) -> Option<u64> {
        line(&self.faults, self.edge_ns, self.last_edge_ns)
    }

    fn faults(&mut self) -> &mut Faults {
        &mut self.faults
    }
}
