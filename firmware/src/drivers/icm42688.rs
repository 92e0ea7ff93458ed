//! TDK ICM-42688-P: inertial unit with a FIFO of time-stamped packets.
//!
//! | register | bank, address | use |
//! |---|---|---|
//! | DEVICE_CONFIG | 0, 0x11 | software reset |
//! | INT_CONFIG | 0, 0x14 | interrupt pin: push-pull, active high, pulsed |
//! | FIFO_CONFIG | 0, 0x16 | FIFO keeps the newest |
//! | TEMP_DATA1 to GYRO_DATA_Z0 | 0, 0x1D to 0x2A | the newest reading |
//! | INT_STATUS, FIFO_COUNTH, FIFO_COUNTL | 0, 0x2D to 0x2F | reset done, FIFO full; packets in the FIFO |
//! | FIFO_DATA | 0, 0x30 | the packets |
//! | SIGNAL_PATH_RESET | 0, 0x4B | empties the FIFO |
//! | INTF_CONFIG0 | 0, 0x4C | high byte first, count in packets, no I2C |
//! | PWR_MGMT0 | 0, 0x4E | both sensors in low-noise mode |
//! | GYRO_CONFIG0, ACCEL_CONFIG0 | 0, 0x4F, 0x50 | range and rate |
//! | FIFO_CONFIG1 to 3 | 0, 0x5F to 0x61 | what is in a packet; threshold |
//! | INT_CONFIG1, INT_SOURCE0 | 0, 0x64, 0x65 | pins work; FIFO threshold to INT1 |
//! | FIFO_LOST_PKT0, 1 | 0, 0x6C, 0x6D | packets for which there was no room |
//! | SELF_TEST_CONFIG | 0, 0x70 | forces that move the sensors |
//! | WHO_AM_I | 0, 0x75 | 0x47 |
//! | REG_BANK_SEL | all, 0x76 | bank |
//! | XG_ST_DATA, YG_, ZG_ | 1, 0x5F to 0x61 | answer of the gyroscopes to the test at the factory |
//! | XA_ST_DATA, YA_, ZA_ | 2, 0x3B to 0x3D | the same of the accelerometers |
//!
//! Each under its name in the register maps of user banks 0, 1 and 2 of [ICM-42688-P]; packets in the
//! section on the FIFO (packet 3); clock and temperature in sections 4.10 and 4.13.
//!
//! The part sends no sum. So the newest packet is compared with the data registers, which hold the same
//! reading: a bit that flipped in one of the two is seen, unless the same flipped in both. A packet that
//! is not the newest, because the call came late, has nothing to be compared with and is given as not
//! valid. The time stamp of a packet, microseconds, tells whether readings are missing; its low bits and
//! the temperature's are used for nothing finer.
//!
//! The test of the sensors follows the maker's driver: the answer to the test's forces, of all three axes,
//! is between half and one and a half of what it was at the factory. It needs a part that hardly moves
//! and is done until it has been passed once.

use core::f64::consts::PI;

use embedded_hal::spi::SpiDevice;

use super::registers::Registers;
use super::supervision::{Due, Soundness, Supervision};
use super::{Fault, InertialReading, InertialUnit, MAX_READINGS, Readings, Supervised};

mod register {
    pub const DEVICE_CONFIG: u8 = 0x11;
    pub const INT_CONFIG: u8 = 0x14;
    pub const FIFO_CONFIG: u8 = 0x16;
    pub const TEMP_DATA1: u8 = 0x1d;
    pub const ACCEL_DATA_X1: u8 = 0x1f;
    pub const INT_STATUS: u8 = 0x2d;
    pub const FIFO_DATA: u8 = 0x30;
    pub const SIGNAL_PATH_RESET: u8 = 0x4b;
    pub const INTF_CONFIG0: u8 = 0x4c;
    pub const PWR_MGMT0: u8 = 0x4e;
    pub const GYRO_CONFIG0: u8 = 0x4f;
    pub const ACCEL_CONFIG0: u8 = 0x50;
    pub const FIFO_CONFIG1: u8 = 0x5f;
    pub const FIFO_CONFIG2: u8 = 0x60;
    pub const FIFO_CONFIG3: u8 = 0x61;
    pub const INT_CONFIG1: u8 = 0x64;
    pub const INT_SOURCE0: u8 = 0x65;
    pub const FIFO_LOST_PKT0: u8 = 0x6c;
    pub const SELF_TEST_CONFIG: u8 = 0x70;
    pub const WHO_AM_I: u8 = 0x75;
    pub const REG_BANK_SEL: u8 = 0x76;
    /// Bank 1.
    pub const XG_ST_DATA: u8 = 0x5f;
    /// Bank 2.
    pub const XA_ST_DATA: u8 = 0x3b;
}

/// Bit 7 of the first byte: a read.
const READ: u8 = 0x80;
const WHO_AM_I: u8 = 0x47;
/// DEVICE_CONFIG: software reset.
const SOFT_RESET: u8 = 0x01;
/// INT_STATUS: the reset is done.
const RESET_DONE: u8 = 0x10;
/// INT_STATUS: the FIFO was full.
const FIFO_FULL: u8 = 0x02;
/// SIGNAL_PATH_RESET: empty the FIFO.
const FIFO_FLUSH: u8 = 0x02;
/// PWR_MGMT0: gyroscopes and accelerometers in low-noise mode.
const LOW_NOISE: u8 = 0x0f;
/// SELF_TEST_CONFIG: supply of the accelerometers' test and all six axes.
const TEST_ALL: u8 = 0x7f;
/// GYRO_CONFIG0 and ACCEL_CONFIG0 during the test: 250 °/s and 2 g (the code is 3 for both), 1 kHz.
const TEST_RANGE: u8 = 3 << 5 | 0x06;
/// Header of a packet with accelerations, rates and time stamp: bits 6, 5 and 3.
const HEADER: u8 = 0x68;
/// The header's two lowest bits tell of a change of rate.
const HEADER_MASK: u8 = 0xfc;
/// What stands for an axis that has no new number.
const NO_NUMBER: i16 = i16::MIN;
/// Packets of 16 bytes in a FIFO of 2 kB.
const MAX_PACKETS: u16 = 128;
const PACKET_LEN: usize = 16;

/// A software reset takes 1 ms.
const RESET_NS: u64 = 2_000_000;
/// The gyroscopes need 45 ms, and the maker's driver waits 60 ms before the test.
const SETTLE_NS: u64 = 60_000_000;
/// The maker's driver waits 200 ms for the answer to the test's forces.
const TEST_NS: u64 = 200_000_000;
/// The first reading at another range and rate.
const CONFIGURED_NS: u64 = 60_000_000;

/// Answer of a sensor with the factory's code 1, LSB at the range of the test.
const TEST_BASE_LSB: f64 = 2620.0;
/// Each further code is one per cent more.
const TEST_PER_CODE: f64 = 1.01;
/// Bounds of the answer against the one at the factory.
const TEST_RATIO: (f64, f64) = (0.5, 1.5);
/// Bounds where the factory left no code: 60 °/s; 50 mg to 1200 mg.
const TEST_GYRO_LSB: (f64, f64) = (60.0 * 32_768.0 / 250.0, f64::INFINITY);
const TEST_ACCEL_LSB: (f64, f64) = (0.05 * 16_384.0, 1.2 * 16_384.0);

const DEGREE_RAD: f64 = PI / 180.0;
/// Standard gravity.
const G_MPS2: f64 = 9.806_65;
/// Temperature in a packet (4.13): LSB per °C, and at zero.
const PACKET_TEMPERATURE: (f64, f64) = (2.07, 25.0);
/// Temperature in the data registers (4.13).
const REGISTER_TEMPERATURE: (f64, f64) = (132.48, 25.0);
/// The two must agree to this, °C.
const TEMPERATURE_AGREES_C: f64 = 1.5;

/// Range of the gyroscopes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GyroRange {
    /// 2000 °/s.
    Dps2000 = 0,
    /// 1000 °/s.
    Dps1000 = 1,
    /// 500 °/s.
    Dps500 = 2,
    /// 250 °/s.
    Dps250 = 3,
    /// 125 °/s.
    Dps125 = 4,
}

/// Range of the accelerometers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AccelRange {
    /// 16 g.
    G16 = 0,
    /// 8 g.
    G8 = 1,
    /// 4 g.
    G4 = 2,
    /// 2 g.
    G2 = 3,
}

/// How often, and the code of GYRO_ODR and ACCEL_ODR.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rate {
    /// 200 Hz.
    Hz200 = 0x07,
    /// 100 Hz.
    Hz100 = 0x08,
    /// 500 Hz.
    Hz500 = 0x0f,
}

impl Rate {
    const fn interval_us(self) -> u32 {
        match self {
            Self::Hz100 => 10_000,
            Self::Hz200 => 5_000,
            Self::Hz500 => 2_000,
        }
    }
}

/// How the part is to work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// Range of the gyroscopes.
    pub gyro: GyroRange,
    /// Range of the accelerometers.
    pub accel: AccelRange,
    /// How often.
    pub rate: Rate,
}

impl Config {
    /// What the registers must hold, in the order in which they are written.
    const fn registers(&self) -> [(u8, u8); 11] {
        [
            // Big endian both, count in packets, I2C off.
            (register::INTF_CONFIG0, 0x73),
            (register::INT_CONFIG, 0x03),
            // Bit 4 must be cleared for the pins to work.
            (register::INT_CONFIG1, 0x00),
            (register::INT_SOURCE0, 0x04),
            (
                register::GYRO_CONFIG0,
                (self.gyro as u8) << 5 | self.rate as u8,
            ),
            (
                register::ACCEL_CONFIG0,
                (self.accel as u8) << 5 | self.rate as u8,
            ),
            // Accelerations, rates and temperature; the threshold again whenever it is passed.
            (register::FIFO_CONFIG1, 0x27),
            (register::FIFO_CONFIG2, 0x01),
            (register::FIFO_CONFIG3, 0x00),
            (register::FIFO_CONFIG, 0x40),
            (register::PWR_MGMT0, LOW_NOISE),
        ]
    }

    fn rate_per_lsb_radps(&self) -> f64 {
        let range_dps = f64::from(2000_u16 >> self.gyro as u8);
        range_dps * DEGREE_RAD / 32_768.0
    }

    fn force_per_lsb_mps2(&self) -> f64 {
        let range_g = f64::from(16_u16 >> self.accel as u8);
        range_g * G_MPS2 / 32_768.0
    }
}

/// What a packet holds.
#[derive(Clone, Copy, PartialEq)]
struct Packet {
    /// Accelerations, then rates.
    axes: [i16; 6],
    temperature_c: f64,
    time_stamp: u16,
}

/// Driver of one part.
pub struct Icm42688<S> {
    registers: Registers<S>,
    config: Config,
    supervision: Supervision,
    /// The test of the sensors was passed.
    is_tested: bool,
    /// Six axes without the test's forces.
    without_forces: [i16; 6],
    /// Time stamp of the last reading given, µs.
    last_time_stamp: Option<u16>,
    /// FIFO_LOST_PKT when it was last read.
    lost: u16,
}

impl<S: SpiDevice> Icm42688<S> {
    /// Driver of the part behind a bus of SPI mode 0 or 3 and at most 24 MHz.
    pub fn new(spi: S, config: Config) -> Self {
        Self {
            registers: Registers::new(spi),
            config,
            supervision: Supervision::new(config.rate.interval_us() * 1000),
            is_tested: false,
            without_forces: [0; 6],
            last_time_stamp: None,
            lost: 0,
        }
    }

    fn read<const N: usize>(&mut self, address: u8) -> Result<[u8; N], Fault> {
        self.registers.read(READ | address)
    }

    fn write(&mut self, address: u8, value: u8) -> Result<(), Fault> {
        self.registers.write(address, value)
    }

    /// The start, one step a call.
    fn step(&mut self, now_ns: u64, step: u8) -> Result<(), Fault> {
        let wait_ns = match step {
            0 => {
                self.last_time_stamp = None;
                self.lost = 0;
                self.write(register::REG_BANK_SEL, 0)?;
                self.write(register::DEVICE_CONFIG, SOFT_RESET)?;
                RESET_NS
            }
            1 => {
                self.identify()?;
                self.write(register::PWR_MGMT0, LOW_NOISE)?;
                self.write(register::GYRO_CONFIG0, TEST_RANGE)?;
                self.write(register::ACCEL_CONFIG0, TEST_RANGE)?;
                if self.is_tested { 0 } else { SETTLE_NS }
            }
            2 if !self.is_tested => {
                self.without_forces = self.axes()?;
                self.write(register::SELF_TEST_CONFIG, TEST_ALL)?;
                TEST_NS
            }
            3 if !self.is_tested => {
                self.judge_test()?;
                self.is_tested = true;
                self.write(register::SELF_TEST_CONFIG, 0)?;
                0
            }
            2 | 3 => 0,
            4 => {
                for (address, value) in self.config.registers() {
                    self.write(address, value)?;
                }
                CONFIGURED_NS
            }
            _ => {
                for (register, value) in self.config.registers() {
                    self.expect(register, value)?;
                }
                self.write(register::SIGNAL_PATH_RESET, FIFO_FLUSH)?;
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

    /// Reads one register back: a range that changed by itself would be a wrong scale.
    fn check_configuration(&mut self) -> Result<(), Fault> {
        let (register, value) = self.supervision.to_check(&self.config.registers());
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
        let [status] = self.read(register::INT_STATUS)?;
        if status & RESET_DONE == 0 {
            return Err(Fault::ResetNotDone);
        }
        Ok(())
    }

    /// The six axes of the data registers.
    fn axes(&mut self) -> Result<[i16; 6], Fault> {
        let bytes: [u8; 12] = self.read(register::ACCEL_DATA_X1)?;
        Ok(axes(&bytes))
    }

    /// Compares the answer to the test's forces with the one at the factory.
    fn judge_test(&mut self) -> Result<(), Fault> {
        let with_forces = self.axes()?;
        self.write(register::REG_BANK_SEL, 2)?;
        let [ax, ay, az] = self.read(register::XA_ST_DATA)?;
        self.write(register::REG_BANK_SEL, 1)?;
        let [gx, gy, gz] = self.read(register::XG_ST_DATA)?;
        self.write(register::REG_BANK_SEL, 0)?;
        let mut failed = 0;
        for (sensor, (codes, absolute)) in [
            ([ax, ay, az], TEST_ACCEL_LSB),
            ([gx, gy, gz], TEST_GYRO_LSB),
        ]
        .into_iter()
        .enumerate()
        {
            for (axis, code) in codes.into_iter().enumerate() {
                let place = 3 * sensor + axis;
                let with = with_forces.get(place).copied().unwrap_or(0);
                let without = self.without_forces.get(place).copied().unwrap_or(0);
                let answer = f64::from((i32::from(with) - i32::from(without)).unsigned_abs());
                if !is_answer(answer, code, absolute) {
                    failed |= 1 << place;
                }
            }
        }
        if failed != 0 {
            return Err(Fault::SelfTest { status: failed });
        }
        Ok(())
    }

    fn read_fifo(
        &mut self,
        now_ns: u64,
        time_ns: u64,
        readings: &mut Readings,
    ) -> Result<(), Fault> {
        let [status, high, low] = self.read(register::INT_STATUS)?;
        let count = u16::from_be_bytes([high, low]);
        if count == 0 {
            return Err(self.nothing_new()?);
        }
        if [status, high, low] == [0xff; 3] {
            return Err(Fault::Stuck { high: true });
        }
        if count > MAX_PACKETS {
            return Err(Fault::Malformed { word: count });
        }
        let lost = if status & FIFO_FULL == 0 {
            None
        } else {
            self.supervision.note(Fault::Overrun);
            Some(self.newly_lost()?)
        };
        let interval_ns = u64::from(self.supervision.interval_ns());
        let mut lost = lost;
        let now = u64::from(count);
        for place in (0..now).take(MAX_READINGS) {
            let packet = self.packet()?;
            let newer = now - 1 - place;
            let missed = self.missed(packet.time_stamp, lost.take())?;
            let soundness = if newer > 0 {
                Soundness::Doubtful
            } else {
                self.confirm(&packet)?;
                self.check_configuration()?;
                packet.soundness()
            };
            let reading = self.reading(
                time_ns.saturating_sub(newer * interval_ns),
                &packet,
                soundness,
                missed,
            );
            self.last_time_stamp = Some(packet.time_stamp);
            self.supervision.reading(now_ns, soundness, missed);
            // At most sixteen into an empty list of sixteen.
            let _ = readings.push(reading);
        }
        Ok(())
    }

    /// The FIFO is empty, or nothing drives the line.
    fn nothing_new(&mut self) -> Result<Fault, Fault> {
        let [identity] = self.read(register::WHO_AM_I)?;
        Ok(if identity == WHO_AM_I {
            Fault::Repeated
        } else {
            Fault::Stuck { high: false }
        })
    }

    /// Packets lost since this was last asked.
    fn newly_lost(&mut self) -> Result<u16, Fault> {
        let lost = u16::from_le_bytes(self.read(register::FIFO_LOST_PKT0)?);
        let newly = lost.wrapping_sub(self.lost);
        self.lost = lost;
        Ok(newly)
    }

    /// The next packet of the FIFO.
    fn packet(&mut self) -> Result<Packet, Fault> {
        let bytes: [u8; PACKET_LEN] = self.read(register::FIFO_DATA)?;
        let [header, data @ .., temperature, time_high, time_low] = bytes;
        if header & HEADER_MASK != HEADER {
            let word = u16::from(header);
            return Err(Fault::Malformed { word });
        }
        let axes = axes(&data);
        if axes.contains(&NO_NUMBER) {
            let word = NO_NUMBER.cast_unsigned();
            return Err(Fault::Malformed { word });
        }
        let (per_c, zero_c) = PACKET_TEMPERATURE;
        Ok(Packet {
            axes,
            temperature_c: f64::from(temperature.cast_signed()) / per_c + zero_c,
            time_stamp: u16::from_be_bytes([time_high, time_low]),
        })
    }

    /// Readings between the last one given and this one: as many as were lost, else by the time stamps.
    fn missed(&mut self, time_stamp: u16, lost: Option<u16>) -> Result<u32, Fault> {
        let (Some(before), None) = (self.last_time_stamp, lost) else {
            return Ok(lost.map_or(0, u32::from));
        };
        let step = time_stamp.wrapping_sub(before);
        if step == 0 {
            return Err(Fault::Repeated);
        }
        let interval_us = self.config.rate.interval_us();
        let elapsed_us = u32::from(step);
        let intervals = (elapsed_us + interval_us / 2) / interval_us;
        // The stamps count a clock that is off by some per cent (4.10).
        if intervals == 0 || (intervals * interval_us).abs_diff(elapsed_us) > interval_us / 4 {
            // The next is held against this one: either may be the wrong one.
            self.last_time_stamp = Some(time_stamp);
            return Err(Fault::Counter { step });
        }
        Ok(intervals - 1)
    }

    /// Compares the newest packet with the data registers.
    fn confirm(&mut self, packet: &Packet) -> Result<(), Fault> {
        let [t1, t0, data @ ..]: [u8; 14] = self.read(register::TEMP_DATA1)?;
        let (per_c, zero_c) = REGISTER_TEMPERATURE;
        let temperature_c = f64::from(i16::from_be_bytes([t1, t0])) / per_c + zero_c;
        let difference_c = temperature_c - packet.temperature_c;
        if axes(&data) != packet.axes
            || !(-TEMPERATURE_AGREES_C..TEMPERATURE_AGREES_C).contains(&difference_c)
        {
            return Err(Fault::Unconfirmed);
        }
        Ok(())
    }

    fn reading(
        &self,
        time_ns: u64,
        packet: &Packet,
        soundness: Soundness,
        missed: u32,
    ) -> InertialReading {
        let rate = self.config.rate_per_lsb_radps();
        let force = self.config.force_per_lsb_mps2();
        let [ax, ay, az, gx, gy, gz] = packet.axes.map(f64::from);
        InertialReading {
            time_ns,
            interval_ns: self.supervision.interval_ns(),
            omega_is_s_radps: [gx, gy, gz].map(|axis| axis * rate),
            f_is_s_mps2: [ax, ay, az].map(|axis| axis * force),
            temperature_c: Some(packet.temperature_c as f32),
            is_valid: soundness == Soundness::Sound,
            missed,
        }
    }
}

impl Packet {
    /// Whether no axis is at the end of its range.
    fn soundness(&self) -> Soundness {
        if self.axes.iter().any(|axis| axis.unsigned_abs() >= 32_767) {
            Soundness::Doubtful
        } else {
            Soundness::Sound
        }
    }
}

/// Six numbers, high byte first.
fn axes(bytes: &[u8; 12]) -> [i16; 6] {
    let [a, b, c, d, e, f, g, h, i, j, k, l] = *bytes;
    [[a, b], [c, d], [e, f], [g, h], [i, j], [k, l]].map(i16::from_be_bytes)
}

/// Whether a sensor answered the test's force as at the factory.
fn is_answer(answer_lsb: f64, code: u8, absolute_lsb: (f64, f64)) -> bool {
    if code == 0 {
        let (least, most) = absolute_lsb;
        return answer_lsb >= least && answer_lsb <= most;
    }
    let mut factory_lsb = TEST_BASE_LSB;
    for _ in 1..code {
        factory_lsb *= TEST_PER_CODE;
    }
    let ratio = answer_lsb / factory_lsb;
    let (least, most) = TEST_RATIO;
    ratio > least && ratio < most
}

impl<S: SpiDevice> Supervised for Icm42688<S> {
    fn supervision(&self) -> &Supervision {
        &self.supervision
    }
}

impl<S: SpiDevice> InertialUnit for Icm42688<S> {
    fn service(
        &mut self,
        now_ns: u64,
        data_ready_ns: Option<u64>,
        readings: &mut Readings,
    ) -> Result<(), Fault> {
        readings.clear();
        match (self.supervision.due(now_ns), data_ready_ns) {
            (Due::Step(step), _) => self.step(now_ns, step),
            (Due::Nothing, _) => Ok(()),
            (Due::Reading, Some(time_ns)) => self.read_fifo(now_ns, time_ns, readings),
            (Due::Reading, None) => self.supervision.check_silence(now_ns),
        }
        .map_err(|fault| self.supervision.fault(now_ns, fault))
    }
}
