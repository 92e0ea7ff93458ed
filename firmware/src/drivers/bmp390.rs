//! Bosch BMP390: barometer.
//!
//! | register | address | use |
//! |---|---|---|
//! | CHIP_ID | 0x00 | 0x60 |
//! | ERR_REG | 0x02 | fatal, command and configuration errors |
//! | STATUS | 0x03 | pressure and temperature are new |
//! | DATA_0 to DATA_5 | 0x04 to 0x09 | pressure, temperature: 24 bits, low byte first |
//! | EVENT | 0x10 | the part was reset |
//! | INT_CTRL | 0x19 | interrupt pin: push-pull, active high, new data |
//! | PWR_CTRL | 0x1B | both on, normal mode |
//! | OSR, ODR, CONFIG | 0x1C, 0x1D, 0x1F | oversampling, rate, no filter |
//! | sum, NVM_PAR_T1 to NVM_PAR_P11 | 0x30; 0x31 to 0x45 | trimming coefficients, CRC over them |
//! | CMD | 0x7E | software reset |
//!
//! Each under its name in the register description of [BMP390]; the compensation in double precision is its
//! appendix, computation formulae. A read has one byte of no meaning before the first register (digital
//! interfaces, SPI read). The CRC of the coefficients is not in the data sheet but in the maker's test
//! program [BMP3-API] (polynomial 0x1D, begun and ended with 0xFF). A reading carries no sum, so its
//! registers are read twice and must be the same: a bit that flipped in one of the two is seen.

use embedded_hal::spi::SpiDevice;

use super::registers::Registers;
use super::supervision::{Due, Soundness, Supervision};
use super::{Barometer, Fault, PressureReading, Supervised};

mod register {
    pub const CHIP_ID: u8 = 0x00;
    pub const ERR_REG: u8 = 0x02;
    pub const DATA_0: u8 = 0x04;
    pub const EVENT: u8 = 0x10;
    pub const INT_CTRL: u8 = 0x19;
    pub const PWR_CTRL: u8 = 0x1b;
    pub const OSR: u8 = 0x1c;
    pub const ODR: u8 = 0x1d;
    pub const CONFIG: u8 = 0x1f;
    pub const TRIMMING: u8 = 0x30;
    pub const CMD: u8 = 0x7e;
}

/// Bit 7 of the first byte: a read.
const READ: u8 = 0x80;
const CHIP_ID: u8 = 0x60;
const SOFT_RESET: u8 = 0xb6;
/// EVENT: power-up or reset since it was last read.
const RESET_DETECTED: u8 = 0x01;
/// STATUS: pressure and temperature are new.
const BOTH_NEW: u8 = 0x60;
/// What both numbers are before the first measurement.
const NO_DATA: u32 = 0x80_0000;
/// Written and read back: pressure eight times oversampled, 50 Hz, no filter.
const CONFIGURATION: [(u8, u8); 5] = [
    (register::INT_CTRL, 0x42),
    (register::OSR, 0x03),
    (register::ODR, 0x02),
    (register::CONFIG, 0x00),
    (register::PWR_CTRL, 0x33),
];
const INTERVAL_NS: u32 = 20_000_000;
/// The part takes 2 ms.
const RESET_NS: u64 = 10_000_000;
/// Range of the part, Pa and °C.
const PRESSURE_PA: (f64, f64) = (30_000.0, 125_000.0);
const TEMPERATURE_C: (f64, f64) = (-40.0, 85.0);

/// Driver of one part.
pub struct Bmp390<S> {
    registers: Registers<S>,
    supervision: Supervision,
    trimming: Trimming,
}

impl<S: SpiDevice> Bmp390<S> {
    /// Driver of the part behind a bus of SPI mode 0 or 3 and at most 10 MHz.
    pub fn new(spi: S) -> Self {
        Self {
            registers: Registers::new(spi),
            supervision: Supervision::new(INTERVAL_NS),
            trimming: Trimming::new(&[0; TRIMMING_LEN]),
        }
    }

    /// `M` is one more than `N`: the byte of no meaning.
    fn read<const N: usize, const M: usize>(&mut self, address: u8) -> Result<[u8; N], Fault> {
        const { assert!(M == N + 1) };
        let bytes: [u8; M] = self.registers.read(READ | address)?;
        let mut registers = [0; N];
        for (register, byte) in registers.iter_mut().zip(bytes.iter().skip(1)) {
            *register = *byte;
        }
        Ok(registers)
    }

    fn step(&mut self, now_ns: u64, step: u8) -> Result<(), Fault> {
        let wait_ns = match step {
            0 => {
                self.registers.write(register::CMD, SOFT_RESET)?;
                RESET_NS
            }
            1 => {
                self.identify()?;
                self.read_trimming()?;
                for (address, value) in CONFIGURATION {
                    self.registers.write(address, value)?;
                }
                u64::from(INTERVAL_NS)
            }
            _ => {
                for (register, value) in CONFIGURATION {
                    self.expect(register, value)?;
                }
                self.supervision.started(now_ns);
                return Ok(());
            }
        };
        self.supervision.step_done(now_ns, step, wait_ns);
        Ok(())
    }

    fn expect(&mut self, register: u8, value: u8) -> Result<(), Fault> {
        let [read] = self.read::<1, 2>(register)?;
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
        match self.read::<1, 2>(register::CHIP_ID)? {
            [0x00] => return Err(Fault::Stuck { high: false }),
            [0xff] => return Err(Fault::Stuck { high: true }),
            [CHIP_ID] => {}
            [other] => {
                let read = u16::from(other);
                return Err(Fault::WrongIdentity { read });
            }
        }
        let [event] = self.read::<1, 2>(register::EVENT)?;
        if event & RESET_DETECTED == 0 {
            return Err(Fault::ResetNotDone);
        }
        let [errors] = self.read::<1, 2>(register::ERR_REG)?;
        if errors != 0 {
            let status = u16::from(errors);
            return Err(Fault::SelfTest { status });
        }
        Ok(())
    }

    fn read_trimming(&mut self) -> Result<(), Fault> {
        let [sum, bytes @ ..] =
            self.read::<{ TRIMMING_LEN + 1 }, { TRIMMING_LEN + 2 }>(register::TRIMMING)?;
        let (computed, received) = (u16::from(crc(&bytes)), u16::from(sum));
        if computed != received {
            return Err(Fault::Checksum { computed, received });
        }
        self.trimming = Trimming::new(&bytes);
        Ok(())
    }

    fn measure(&mut self, now_ns: u64, time_ns: u64) -> Result<Option<PressureReading>, Fault> {
        let all: [u8; 8] = self.read::<8, 9>(register::ERR_REG)?;
        if all == [0x00; 8] {
            return Err(Fault::Stuck { high: false });
        }
        if all == [0xff; 8] {
            return Err(Fault::Stuck { high: true });
        }
        let [errors, status, data @ ..] = all;
        if errors != 0 {
            let word = u16::from(errors);
            return Err(Fault::Malformed { word });
        }
        if status & BOTH_NEW != BOTH_NEW {
            return Err(Fault::Repeated);
        }
        if self.read::<6, 7>(register::DATA_0)? != data {
            return Err(Fault::Unconfirmed);
        }
        self.check_configuration()?;
        let [p0, p1, p2, t0, t1, t2] = data;
        let pressure = u32::from_le_bytes([p0, p1, p2, 0]);
        let temperature = u32::from_le_bytes([t0, t1, t2, 0]);
        if pressure == NO_DATA && temperature == NO_DATA {
            return Err(Fault::Malformed { word: 0x8000 });
        }
        let (pressure_pa, temperature_c) = self.trimming.compensate(pressure, temperature);
        if !is_within(pressure_pa, PRESSURE_PA) || !is_within(temperature_c, TEMPERATURE_C) {
            return Err(Fault::OutOfRange);
        }
        self.supervision.reading(now_ns, Soundness::Sound, 0);
        Ok(Some(PressureReading {
            time_ns,
            pressure_pa,
            temperature_c,
        }))
    }
}

/// No for a number that is none.
fn is_within(value: f64, (least, most): (f64, f64)) -> bool {
    value >= least && value <= most
}

/// Bytes of coefficients.
const TRIMMING_LEN: usize = 21;

/// Coefficients of the compensation, as floating-point numbers.
#[derive(Clone, Copy, Debug)]
struct Trimming {
    t: [f64; 3],
    p: [f64; 11],
}

impl Trimming {
    fn new(bytes: &[u8; TRIMMING_LEN]) -> Self {
        let [
            t1_low,
            t1_high,
            t2_low,
            t2_high,
            t3,
            p1_low,
            p1_high,
            p2_low,
            p2_high,
            p3,
            p4,
            p5_low,
            p5_high,
            p6_low,
            p6_high,
            p7,
            p8,
            p9_low,
            p9_high,
            p10,
            p11,
        ] = *bytes;
        let unsigned = |low, high| f64::from(u16::from_le_bytes([low, high]));
        let signed = |low, high| f64::from(i16::from_le_bytes([low, high]));
        let short = |byte: u8| f64::from(byte.cast_signed());
        Self {
            t: [
                unsigned(t1_low, t1_high) * two_to(8),
                unsigned(t2_low, t2_high) / two_to(30),
                short(t3) / two_to(48),
            ],
            p: [
                (signed(p1_low, p1_high) - two_to(14)) / two_to(20),
                (signed(p2_low, p2_high) - two_to(14)) / two_to(29),
                short(p3) / two_to(32),
                short(p4) / two_to(37),
                unsigned(p5_low, p5_high) * two_to(3),
                unsigned(p6_low, p6_high) / two_to(6),
                short(p7) / two_to(8),
                short(p8) / two_to(15),
                signed(p9_low, p9_high) / two_to(48),
                short(p10) / two_to(48),
                short(p11) / two_to(65),
            ],
        }
    }

    /// Pressure, Pa, and temperature, °C.
    fn compensate(&self, pressure: u32, temperature: u32) -> (f64, f64) {
        let [t1, t2, t3] = self.t;
        let [p1, p2, p3, p4, p5, p6, p7, p8, p9, p10, p11] = self.p;
        let from_t1 = f64::from(temperature) - t1;
        let t = from_t1 * t2 + from_t1 * from_t1 * t3;
        let raw = f64::from(pressure);
        let offset = p5 + p6 * t + p7 * (t * t) + p8 * (t * t * t);
        let linear = raw * (p1 + p2 * t + p3 * (t * t) + p4 * (t * t * t));
        let bent = raw * raw * (p9 + p10 * t) + raw * raw * raw * p11;
        (offset + linear + bent, t)
    }
}

/// 2 to the power of `exponent`, at most 65.
const fn two_to(exponent: u32) -> f64 {
    (1_u128 << exponent) as f64
}

/// CRC of the coefficients.
fn crc(bytes: &[u8]) -> u8 {
    let mut crc = 0xff_u8;
    for byte in bytes {
        crc ^= byte;
        for _ in 0..8 {
            let carry = crc & 0x80 != 0;
            crc <<= 1;
            if carry {
                crc ^= 0x1d;
            }
        }
    }
    crc ^ 0xff
}

impl<S: SpiDevice> Supervised for Bmp390<S> {
    fn supervision(&self) -> &Supervision {
        &self.supervision
    }
}

impl<S: SpiDevice> Barometer for Bmp390<S> {
    fn service(
        &mut self,
        now_ns: u64,
        data_ready_ns: Option<u64>,
    ) -> Result<Option<PressureReading>, Fault> {
        match (self.supervision.due(now_ns), data_ready_ns) {
            (Due::Step(step), _) => self.step(now_ns, step).map(|()| None),
            (Due::Nothing, _) => Ok(None),
            (Due::Reading, Some(time_ns)) => self.measure(now_ns, time_ns),
            (Due::Reading, None) => self.supervision.check_silence(now_ns).map(|()| None),
        }
        .map_err(|fault| self.supervision.fault(now_ns, fault))
    }
}
