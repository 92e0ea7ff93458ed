//! ST LIS3MDL: magnetometer.
//!
//! | register | address | use |
//! |---|---|---|
//! | WHO_AM_I | 0x0F | 0x3D |
//! | CTRL_REG1 | 0x20 | performance, rate, test |
//! | CTRL_REG2 | 0x21 | range, software reset |
//! | CTRL_REG3 | 0x22 | continuous conversion |
//! | CTRL_REG4 | 0x23 | performance of z, low byte first |
//! | CTRL_REG5 | 0x24 | no update between the bytes of a number |
//! | STATUS_REG | 0x27 | new numbers, overrun |
//! | OUT_X_L to OUT_Z_H | 0x28 to 0x2D | the field |
//!
//! Each under its name in the register description of [LIS3MDL]; sensitivity in its magnetic
//! characteristics. Test of the sensor: [AN4602], self-test: at 12 gauss the answer to the coil is between 1
//! and 3 gauss in x and y, between 0.1 and 1 gauss in z. It needs a field that hardly changes and is done
//! until it has been passed once. A reading carries no sum, so its registers are read twice and must be the
//! same: a bit that flipped in one of the two is seen.

use embedded_hal::spi::SpiDevice;

use super::registers::Registers;
use super::supervision::{Due, Soundness, Supervision};
use super::{Fault, MagneticReading, Magnetometer, Supervised};

mod register {
    pub const WHO_AM_I: u8 = 0x0f;
    pub const CTRL_REG1: u8 = 0x20;
    pub const CTRL_REG2: u8 = 0x21;
    pub const CTRL_REG3: u8 = 0x22;
    pub const CTRL_REG4: u8 = 0x23;
    pub const CTRL_REG5: u8 = 0x24;
    pub const STATUS_REG: u8 = 0x27;
    pub const OUT_X_L: u8 = 0x28;
}

/// Bit 7 of the first byte: a read; bit 6: the address moves on by itself.
const READ: u8 = 0xc0;
const WHO_AM_I: u8 = 0x3d;
/// CTRL_REG2: software reset, cleared when it is done.
const SOFT_RESET: u8 = 0x04;
/// CTRL_REG1: low performance, 80 Hz, without and with the coil.
const TEST_OFF: u8 = 0x1c;
const TEST_ON: u8 = 0x1d;
/// CTRL_REG2: 12 gauss.
const TEST_RANGE: u8 = 0x40;
/// STATUS_REG: all three axes are new.
const ALL_NEW: u8 = 0x08;
/// STATUS_REG: numbers were written over before they were read.
const OVERRUN: u8 = 0x80;
/// Written and read back: ultra-high performance, 80 Hz, 4 gauss, continuous, whole numbers.
const CONFIGURATION: [(u8, u8); 5] = [
    (register::CTRL_REG1, 0x7c),
    (register::CTRL_REG2, 0x00),
    (register::CTRL_REG4, 0x0c),
    (register::CTRL_REG5, 0x40),
    (register::CTRL_REG3, 0x00),
];
const INTERVAL_NS: u32 = 12_500_000;
const RESET_NS: u64 = 10_000_000;
/// [AN4602] waits 20 ms before the test and 60 ms with the coil.
const SETTLE_NS: u64 = 40_000_000;
const COIL_NS: u64 = 60_000_000;
/// LSB per gauss at 12 gauss.
const TEST_LSB_PER_GAUSS: f64 = 2281.0;
/// Answer to the coil, gauss.
const TEST_GAUSS: [(f64, f64); 3] = [(1.0, 3.0), (1.0, 3.0), (0.1, 1.0)];
/// LSB per gauss at 4 gauss.
const LSB_PER_GAUSS: f64 = 6842.0;
const UT_PER_GAUSS: f64 = 100.0;

/// Driver of one part.
pub struct Lis3mdl<S> {
    registers: Registers<S>,
    supervision: Supervision,
    /// The test of the sensor was passed.
    is_tested: bool,
    without_coil: [i16; 3],
}

impl<S: SpiDevice> Lis3mdl<S> {
    /// Driver of the part behind a bus of SPI mode 3 and at most 10 MHz.
    pub fn new(spi: S) -> Self {
        Self {
            registers: Registers::new(spi),
            supervision: Supervision::new(INTERVAL_NS),
            is_tested: false,
            without_coil: [0; 3],
        }
    }

    fn read<const N: usize>(&mut self, address: u8) -> Result<[u8; N], Fault> {
        self.registers.read(READ | address)
    }

    fn field(&mut self) -> Result<[i16; 3], Fault> {
        Ok(axes(&self.read(register::OUT_X_L)?))
    }

    fn step(&mut self, now_ns: u64, step: u8) -> Result<(), Fault> {
        let wait_ns = match step {
            0 => {
                self.registers.write(register::CTRL_REG2, SOFT_RESET)?;
                RESET_NS
            }
            1 => {
                self.identify()?;
                if self.is_tested {
                    0
                } else {
                    self.registers.write(register::CTRL_REG1, TEST_OFF)?;
                    self.registers.write(register::CTRL_REG2, TEST_RANGE)?;
                    self.registers.write(register::CTRL_REG3, 0)?;
                    SETTLE_NS
                }
            }
            2 if !self.is_tested => {
                self.without_coil = self.field()?;
                self.registers.write(register::CTRL_REG1, TEST_ON)?;
                COIL_NS
            }
            3 if !self.is_tested => {
                self.judge_test()?;
                self.is_tested = true;
                0
            }
            2 | 3 => 0,
            4 => {
                for (address, value) in CONFIGURATION {
                    self.registers.write(address, value)?;
                }
                u64::from(INTERVAL_NS)
            }
            _ => {
                for (register, value) in CONFIGURATION {
                    self.expect(register, value)?;
                }
                // What was measured before the range changed is none of ours.
                self.field()?;
                self.supervision.started(now_ns);
                return Ok(());
            }
        };
        self.supervision.step_done(now_ns, step, wait_ns);
        Ok(())
    }

    fn expect(&mut self, register: u8, value: u8) -> Result<(), Fault> {
        let [read] = self.read(register)?;
        if read != value {
            let read = u16::from(read);
            return Err(Fault::Configuration { register, read });
        }
        Ok(())
    }

    /// Reads one register back: one that changed by itself would be a wrong number.
    fn check_configuration(&mut self) -> Result<(), Fault> {
        let (register, value) = self.supervision.to_check(&CONFIGURATION);
        self.expect(register, value)?;
        self.supervision.checked();
        Ok(())
    }

    fn identify(&mut self) -> Result<(), Fault> {
        match self.read(register::WHO_AM_I)? {
            [0x00] => return Err(Fault::Stuck { high: false }),
            [0xff] => return Err(Fault::Stuck { high: true }),
            [WHO_AM_I] => {}
            [other] => {
                let read = u16::from(other);
                return Err(Fault::WrongIdentity { read });
            }
        }
        let [range] = self.read(register::CTRL_REG2)?;
        if range & SOFT_RESET != 0 {
            return Err(Fault::ResetNotDone);
        }
        Ok(())
    }

    /// Whether the field of the coil was seen on each axis.
    fn judge_test(&mut self) -> Result<(), Fault> {
        let with_coil = self.field()?;
        let mut failed = 0;
        for (axis, ((with, without), (least, most))) in with_coil
            .into_iter()
            .zip(self.without_coil)
            .zip(TEST_GAUSS)
            .enumerate()
        {
            let answer = f64::from((i32::from(with) - i32::from(without)).unsigned_abs());
            let answer_gauss = answer / TEST_LSB_PER_GAUSS;
            if answer_gauss < least || answer_gauss > most {
                failed |= 1 << axis;
            }
        }
        if failed != 0 {
            return Err(Fault::SelfTest { status: failed });
        }
        Ok(())
    }

    fn measure(&mut self, now_ns: u64, time_ns: u64) -> Result<Option<MagneticReading>, Fault> {
        let all: [u8; 7] = self.read(register::STATUS_REG)?;
        if all == [0x00; 7] {
            return Err(Fault::Stuck { high: false });
        }
        if all == [0xff; 7] {
            return Err(Fault::Stuck { high: true });
        }
        let [status, data @ ..] = all;
        if status & ALL_NEW == 0 {
            return Err(Fault::Repeated);
        }
        let numbers = axes(&data);
        if self.field()? != numbers {
            return Err(Fault::Unconfirmed);
        }
        self.check_configuration()?;
        if status & OVERRUN != 0 {
            self.supervision.note(Fault::Overrun);
        }
        if numbers.iter().any(|number| number.unsigned_abs() >= 32_767) {
            return Err(Fault::OutOfRange);
        }
        self.supervision.reading(now_ns, Soundness::Sound, 0);
        Ok(Some(MagneticReading {
            time_ns,
            field_s_ut: numbers.map(|number| f64::from(number) / LSB_PER_GAUSS * UT_PER_GAUSS),
        }))
    }
}

/// Three numbers, low byte first.
fn axes(bytes: &[u8; 6]) -> [i16; 3] {
    let [a, b, c, d, e, f] = *bytes;
    [[a, b], [c, d], [e, f]].map(i16::from_le_bytes)
}

impl<S: SpiDevice> Supervised for Lis3mdl<S> {
    fn supervision(&self) -> &Supervision {
        &self.supervision
    }
}

impl<S: SpiDevice> Magnetometer for Lis3mdl<S> {
    fn service(
        &mut self,
        now_ns: u64,
        data_ready_ns: Option<u64>,
    ) -> Result<Option<MagneticReading>, Fault> {
        match (self.supervision.due(now_ns), data_ready_ns) {
            (Due::Step(step), _) => self.step(now_ns, step).map(|()| None),
            (Due::Nothing, _) => Ok(None),
            (Due::Reading, Some(time_ns)) => self.measure(now_ns, time_ns),
            (Due::Reading, None) => self.supervision.check_silence(now_ns).map(|()| None),
        }
        .map_err(|fault| self.supervision.fault(now_ns, fault))
    }
}
