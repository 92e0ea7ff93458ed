//! LIS3MDL ([LIS3MDL]).
//!
//! Registers of eight bits; bit 7 of the first byte is a read, bit 6 moves the address on. Low byte first.
//! Reading the last byte of the field ends that it is new; a number that was not read before the next
//! came is an overrun. The coil of the self-test adds a field of its own.

use super::{Fault, Faults, Motion, Part, line, rounded};

const WHO_AM_I: usize = 0x0f;
const CTRL_REG1: usize = 0x20;
const CTRL_REG2: usize = 0x21;
const CTRL_REG3: usize = 0x22;
const CTRL_REG5: usize = 0x24;
const STATUS_REG: usize = 0x27;
const OUT_X_L: usize = 0x28;
const OUT_Z_H: usize = 0x2d;

/// The coil's field, gauss.
const COIL_GAUSS: [f64; 3] = [2.0, 1.8, 0.5];

/// One part.
pub struct Lis3mdl {
    registers: [u8; 128],
    next_sample_ns: u64,
    now_ns: u64,
    edge_ns: Option<u64>,
    last_edge_ns: u64,
    faults: Faults,
}

impl Default for Lis3mdl {
    fn default() -> Self {
        Self::new()
    }
}

impl Lis3mdl {
    /// A part after power-up.
    pub fn new() -> Self {
        let mut part = Self {
            registers: [0; 128],
            next_sample_ns: u64::MAX,
            now_ns: 0,
            edge_ns: None,
            last_edge_ns: 0,
            faults: Faults::default(),
        };
        part.reset();
        part
    }

    /// A register changes by itself.
    pub fn upset(&mut self, address: u8, value: u8) {
        self.registers[usize::from(address)] = value;
    }

    fn reset(&mut self) {
        self.registers = [0; 128];
        self.registers[WHO_AM_I] = 0x3d;
        self.registers[CTRL_REG1] = 0x10;
        self.registers[CTRL_REG3] = 0x03;
        self.edge_ns = None;
        self.next_sample_ns = u64::MAX;
    }

    /// 0.625 Hz and on, doubled with each code.
    fn interval_ns(&self) -> u64 {
        1_600_000_000 >> (self.registers[CTRL_REG1] >> 2 & 0x07)
    }

    fn write(&mut self, address: usize, value: u8) {
        if self.faults.loses(address as u8) || !(CTRL_REG1..=CTRL_REG5).contains(&address) {
            return;
        }
        self.registers[address] = value;
        if address == CTRL_REG2 && value & 0x04 != 0 && !self.faults.has(Fault::ResetStuck) {
            self.reset();
        }
        self.next_sample_ns = if self.registers[CTRL_REG3] & 0x03 == 0 {
            self.now_ns + self.interval_ns()
        } else {
            u64::MAX
        };
    }

    fn read(&mut self, address: usize) -> u8 {
        let value = self.registers[address];
        match address {
            WHO_AM_I if self.faults.has(Fault::WrongId) => return 0x40,
            OUT_Z_H => {
                self.registers[STATUS_REG] = 0;
                self.edge_ns = None;
            }
            _ => {}
        }
        value
    }

    fn sample(&mut self, time_ns: u64, motion: &Motion) {
        let lsb_per_gauss = match self.registers[CTRL_REG2] >> 5 & 0x03 {
            0 => 6842.0,
            1 => 3421.0,
            2 => 2281.0,
            _ => 1711.0,
        };
        for axis in 0..3 {
            let mut gauss = motion.field_s_ut[axis] / 100.0;
            if self.registers[CTRL_REG1] & 0x01 != 0 {
                let is_dead = axis == 1 && self.faults.has(Fault::SelfTestFails);
                gauss += if is_dead {
                    0.1
                } else if self.faults.has(Fault::SelfTestTooStrong) {
                    3.5
                } else {
                    COIL_GAUSS[axis]
                };
            }
            let mut number = rounded(gauss * lsb_per_gauss, -32_768, 32_767) as i16;
            if self.faults.has(Fault::Saturated) {
                number = i16::MIN;
            }
            let place = OUT_X_L + 2 * axis;
            self.registers[place..place + 2].copy_from_slice(&number.to_le_bytes());
        }
        let is_unread = self.registers[STATUS_REG] & 0x08 != 0;
        self.registers[STATUS_REG] = if is_unread || self.faults.has(Fault::Overrun) {
            0xff
        } else {
            0x0f
        };
        self.edge_ns = Some(time_ns);
        self.last_edge_ns = time_ns;
    }
}

impl Part for Lis3mdl {
    fn transfer(&mut self, mosi: &[u8], miso: &mut [u8]) {
        miso.fill(0);
        if let (Some((&command, sent)), Some((_, received))) =
            (mosi.split_first(), miso.split_first_mut())
        {
            let address = usize::from(command & 0x3f);
            let moves_on = usize::from(command & 0x40 != 0);
            if command & 0x80 == 0 {
                for (offset, &value) in sent.iter().enumerate() {
                    self.write((address + offset * moves_on) & 0x3f, value);
                }
            } else {
                for (offset, byte) in received.iter_mut().enumerate() {
                    *byte = self.read((address + offset * moves_on) & 0x3f);
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
