//! Analog Devices ADIS16465, ADIS16470 and ADIS16505: inertial units with a burst read.
//!
//! The three share one register map ([ADIS16465], [ADIS16470], [ADIS16505]: user register memory map); they
//! differ in identity, scales and in whether a burst can carry 32 bits per axis.
//!
//! | register | address | use | data sheet, heading |
//! |---|---|---|---|
//! | DIAG_STAT | 0x02 | what failed; cleared by reading | Status and error flag indicators |
//! | DATA_CNTR | 0x22 | readings since power-up, in the burst | Data update counter |
//! | FILT_CTRL | 0x5C | no filter beside the decimation | Filter control register |
//! | RANG_MDL | 0x5E | range of the gyroscopes (not ADIS16470) | Range identifier |
//! | MSC_CTRL | 0x60 | data-ready polarity, what a burst carries | Miscellaneous control register |
//! | DEC_RATE | 0x64 | 2000 Hz / (DEC_RATE + 1), averaged | Decimation filter |
//! | GLOB_CMD | 0x68 | software reset, test of the sensors; read: burst | Global commands; burst read function |
//! | PROD_ID | 0x72 | the number in the part's name | Product identification |
//!
//! A transfer of 16 bits is followed by a pause, the stall time ([ADIS16505] timing specifications:
//! 16 µs); the answer to a read comes with the next transfer. A burst is one transfer without pauses, of
//! at most 1 MHz. Its sum is that of its bytes, 16 bits: it shows every single flipped bit, and of two
//! flipped bits all but those that cancel: equal places of two bytes, one up, one down.
//!
//! Scales: [ADIS16505] and its siblings, gyroscope, accelerometer and delta-angle data formats. For the
//! accelerometers of the ADIS16505 sources differ by up to half a per cent; this is the figure of the
//! maker's driver [ADI-NO-OS] for 32 bits.
//!
//! The time of a reading is that of its data-ready edge; the delay of the part's filters (some
//! milliseconds, its data sheet) is not taken off.

use core::f64::consts::PI;

use embedded_hal::spi::{Operation, SpiDevice};

use super::supervision::{Due, Soundness, Supervision};
use super::{Fault, InertialReading, InertialUnit, Readings, Supervised, bus};

mod register {
    pub const DIAG_STAT: u8 = 0x02;
    pub const FILT_CTRL: u8 = 0x5c;
    pub const RANG_MDL: u8 = 0x5e;
    pub const MSC_CTRL: u8 = 0x60;
    pub const DEC_RATE: u8 = 0x64;
    pub const GLOB_CMD: u8 = 0x68;
    pub const PROD_ID: u8 = 0x72;
}

/// Bit 7 of the first byte: a write of the byte that follows.
const WRITE: u8 = 0x80;
/// MSC_CTRL: point of percussion and linear acceleration compensated, as delivered.
const MSC_COMPENSATED: u16 = 0x00c0;
/// MSC_CTRL: data-ready is active high.
const MSC_ACTIVE_HIGH: u16 = 0x0001;
/// MSC_CTRL: a burst carries increments.
const MSC_BURST_SEL: u16 = 0x0100;
/// MSC_CTRL: a burst carries 32 bits per axis.
const MSC_BURST32: u16 = 0x0200;
/// GLOB_CMD: test of the sensors.
const SELF_TEST: u16 = 0x0004;
/// GLOB_CMD: software reset.
const SOFTWARE_RESET: u16 = 0x0080;

/// Pause between transfers of 16 bits, ns.
const STALL_NS: u32 = 16_000;
/// The longest of the three needs 255 ms after a software reset and 310 ms after power-up.
const RESET_NS: u64 = 310_000_000;
/// The longest of the three needs 24 ms.
const SELF_TEST_NS: u64 = 30_000_000;
/// MSC_CTRL is in effect after 200 µs, DEC_RATE and FILT_CTRL after 30 µs.
const UPDATE_NS: u64 = 300_000;
/// Rate of the part before decimation, Hz.
const INTERNAL_HZ: u32 = 2000;

/// Of so many readings one comes with a register read back: it takes almost as long as a burst.
const CHECK_EVERY: u8 = 8;

/// Command and ten words.
const BURST_16_LEN: usize = 22;
/// Command and sixteen words.
const BURST_32_LEN: usize = 34;

/// The low word of a pair that does not send it: a 16-bit number is the upper half of one of 32 bits, so
/// that what it stands for lies up to one LSB above it, half an LSB on average.
const HALF: u16 = 0x8000;
/// Bits below those of a 16-bit number.
const LOW_WORD: f64 = 65_536.0;
const DEGREE_RAD: f64 = PI / 180.0;
/// Standard gravity, as the data sheets scale by.
const G_MPS2: f64 = 9.806_65;

/// Which part it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// ADIS16465-1: 125 °/s, 8 g.
    Adis16465_1,
    /// ADIS16465-2: 500 °/s, 8 g.
    Adis16465_2,
    /// ADIS16465-3: 2000 °/s, 8 g.
    Adis16465_3,
    /// ADIS16470: 2000 °/s, 40 g.
    Adis16470,
    /// ADIS16505-1: 125 °/s, 78.4 m/s².
    Adis16505_1,
    /// ADIS16505-2: 500 °/s, 78.4 m/s².
    Adis16505_2,
    /// ADIS16505-3: 2000 °/s, 78.4 m/s².
    Adis16505_3,
}

/// Range of the gyroscopes: the dash number.
#[derive(Clone, Copy)]
enum Range {
    Dps125,
    Dps500,
    Dps2000,
}

impl Model {
    fn range(self) -> Range {
        match self {
            Self::Adis16465_1 | Self::Adis16505_1 => Range::Dps125,
            Self::Adis16465_2 | Self::Adis16505_2 => Range::Dps500,
            Self::Adis16465_3 | Self::Adis16470 | Self::Adis16505_3 => Range::Dps2000,
        }
    }

    /// PROD_ID.
    fn product_id(self) -> u16 {
        match self {
            Self::Adis16465_1 | Self::Adis16465_2 | Self::Adis16465_3 => 16_465,
            Self::Adis16470 => 16_470,
            Self::Adis16505_1 | Self::Adis16505_2 | Self::Adis16505_3 => 16_505,
        }
    }

    /// RANG_MDL, where the part has one.
    fn range_model(self) -> Option<u16> {
        match (self, self.range()) {
            (Self::Adis16470, _) => None,
            (_, Range::Dps125) => Some(0x0003),
            (_, Range::Dps500) => Some(0x0007),
            (_, Range::Dps2000) => Some(0x000f),
        }
    }

    fn has_burst_32(self) -> bool {
        self.product_id() == 16_505
    }

    /// Of the 16-bit number: 160, 40 and 10 LSB per °/s.
    fn rate_per_lsb_radps(self) -> f64 {
        DEGREE_RAD
            / match self.range() {
                Range::Dps125 => 160.0,
                Range::Dps500 => 40.0,
                Range::Dps2000 => 10.0,
            }
    }

    /// Of the 16-bit number: 4000 and 800 LSB per g; the ADIS16505 is specified with 26 756 268 LSB per m/s²
    /// of the 32-bit number.
    fn force_per_lsb_mps2(self) -> f64 {
        match self.product_id() {
            16_505 => LOW_WORD / 26_756_268.0,
            16_470 => G_MPS2 / 800.0,
            _ => G_MPS2 / 4000.0,
        }
    }

    /// Of the 16-bit number: the largest increment of angle is 360°, 720° or 2160°.
    fn dtheta_per_lsb_rad(self) -> f64 {
        DEGREE_RAD / 32_768.0
            * match self.range() {
                Range::Dps125 => 360.0,
                Range::Dps500 => 720.0,
                Range::Dps2000 => 2160.0,
            }
    }
}

/// Of the 16-bit number: the largest increment of velocity of the ADIS16505 is 100 m/s.
const DV_PER_LSB_MPS: f64 = 100.0 / 32_768.0;

/// What a burst carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Burst {
    /// Rates and forces of 16 bits: every part.
    Rates16,
    /// Rates and forces of 32 bits: ADIS16505.
    Rates32,
    /// Increments of angle and velocity of 32 bits, integrated in the part at 2000 Hz: ADIS16505.
    Increments32,
}

/// How often.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rate {
    /// 200 Hz.
    Hz200,
    /// 400 Hz.
    Hz400,
}

impl Rate {
    const fn hz(self) -> u32 {
        match self {
            Self::Hz200 => 200,
            Self::Hz400 => 400,
        }
    }

    const fn interval_ns(self) -> u32 {
        1_000_000_000 / self.hz()
    }

    /// DEC_RATE.
    const fn decimation(self) -> u16 {
        (INTERNAL_HZ / self.hz() - 1) as u16
    }
}

/// How the part is to work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// Which it is.
    pub model: Model,
    /// What a burst carries.
    pub burst: Burst,
    /// How often.
    pub rate: Rate,
    /// Whether data-ready is active high.
    pub is_active_high: bool,
}

impl Config {
    /// What the registers must hold.
    fn registers(&self) -> [(u8, u16); 3] {
        [
            (register::MSC_CTRL, self.misc_control()),
            (register::FILT_CTRL, 0),
            (register::DEC_RATE, self.rate.decimation()),
        ]
    }

    fn misc_control(&self) -> u16 {
        let burst = match self.burst {
            Burst::Rates16 => 0,
            Burst::Rates32 => MSC_BURST32,
            Burst::Increments32 => MSC_BURST32 | MSC_BURST_SEL,
        };
        let polarity = if self.is_active_high {
            MSC_ACTIVE_HIGH
        } else {
            0
        };
        MSC_COMPENSATED | polarity | burst
    }
}

/// The part has no such burst.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoBurst32;

/// Driver of one part.
pub struct Adis<S> {
    spi: S,
    config: Config,
    supervision: Supervision,
    /// The part's test of its sensors was passed: motion can make a later one fail.
    is_tested: bool,
    /// Counter and time of the last reading given, ns.
    last: Option<(u16, u64)>,
    /// Readings since a register was read back.
    since_check: u8,
}

impl<S: SpiDevice> Adis<S> {
    /// Driver of the part behind a bus of SPI mode 3 and at most 1 MHz.
    ///
    /// # Errors
    /// [`NoBurst32`] when the model cannot send what is configured.
    pub fn new(spi: S, config: Config) -> Result<Self, NoBurst32> {
        if config.burst != Burst::Rates16 && !config.model.has_burst_32() {
            return Err(NoBurst32);
        }
        Ok(Self {
            spi,
            config,
            supervision: Supervision::new(config.rate.interval_ns()),
            is_tested: false,
            last: None,
            since_check: 0,
        })
    }

    /// One transfer of 16 bits and the pause after it.
    fn exchange(&mut self, mut word: [u8; 2]) -> Result<u16, Fault> {
        self.spi
            .transaction(&mut [
                Operation::TransferInPlace(&mut word),
                Operation::DelayNs(STALL_NS),
            ])
            .map_err(bus)?;
        Ok(u16::from_be_bytes(word))
    }

    fn read_register(&mut self, address: u8) -> Result<u16, Fault> {
        self.exchange([address, 0])?;
        self.exchange([0, 0])
    }

    /// Low byte, then high byte.
    fn write_register(&mut self, address: u8, value: u16) -> Result<(), Fault> {
        let [high, low] = value.to_be_bytes();
        self.exchange([WRITE | address, low])?;
        self.exchange([WRITE | (address + 1), high])?;
        Ok(())
    }

    fn expect(&mut self, register: u8, value: u16) -> Result<(), Fault> {
        let read = self.read_register(register)?;
        if read != value {
            return Err(Fault::Configuration { register, read });
        }
        Ok(())
    }

    /// The start, one step a call.
    fn step(&mut self, now_ns: u64, step: u8) -> Result<(), Fault> {
        let wait_ns = match step {
            0 => {
                self.last = None;
                self.write_register(register::GLOB_CMD, SOFTWARE_RESET)?;
                RESET_NS
            }
            1 => {
                self.identify()?;
                // Clears what the bus did to the part before it was asked anything.
                self.read_register(register::DIAG_STAT)?;
                if self.is_tested {
                    0
                } else {
                    self.write_register(register::GLOB_CMD, SELF_TEST)?;
                    SELF_TEST_NS
                }
            }
            2 => {
                let status = self.read_register(register::DIAG_STAT)?;
                if status != 0 {
                    return Err(Fault::SelfTest { status });
                }
                self.is_tested = true;
                for (register, value) in self.config.registers() {
                    self.write_register(register, value)?;
                }
                UPDATE_NS
            }
            _ => {
                for (register, value) in self.config.registers() {
                    self.expect(register, value)?;
                }
                self.supervision.started(now_ns);
                return Ok(());
            }
        };
        self.supervision.step_done(now_ns, step, wait_ns);
        Ok(())
    }

    fn identify(&mut self) -> Result<(), Fault> {
        match self.read_register(register::PROD_ID)? {
            0x0000 => return Err(Fault::Stuck { high: false }),
            0xffff => return Err(Fault::Stuck { high: true }),
            read if read != self.config.model.product_id() => {
                return Err(Fault::WrongIdentity { read });
            }
            _ => {}
        }
        match self.config.model.range_model() {
            Some(range) => self.expect(register::RANG_MDL, range),
            None => Ok(()),
        }
    }

    fn read(&mut self, now_ns: u64, time_ns: u64, readings: &mut Readings) -> Result<(), Fault> {
        let mut buffer = [0_u8; BURST_32_LEN];
        buffer[0] = register::GLOB_CMD;
        let burst = if self.config.burst == Burst::Rates16 {
            buffer.split_at_mut(BURST_16_LEN).0
        } else {
            &mut buffer[..]
        };
        self.spi
            .transaction(&mut [
                Operation::TransferInPlace(&mut *burst),
                Operation::DelayNs(STALL_NS),
            ])
            .map_err(bus)?;

        let answer = burst.split_at(2).1;
        if answer.iter().all(|byte| *byte == 0x00) {
            return Err(Fault::Stuck { high: false });
        }
        if answer.iter().all(|byte| *byte == 0xff) {
            return Err(Fault::Stuck { high: true });
        }
        let (summed, sum) = answer.split_at(answer.len().saturating_sub(2));
        let computed = summed
            .iter()
            .fold(0_u16, |sum, byte| sum.wrapping_add(u16::from(*byte)));
        let received = words(sum).next().unwrap_or(0);
        if computed != received {
            return Err(Fault::Checksum { computed, received });
        }
        self.take(now_ns, time_ns, summed, readings)
    }

    /// Words whose sum is right.
    fn take(
        &mut self,
        now_ns: u64,
        time_ns: u64,
        summed: &[u8],
        readings: &mut Readings,
    ) -> Result<(), Fault> {
        let mut words = words(summed);
        let mut word = || words.next().unwrap_or(0);
        let status = word();
        let mut axes = [0_i32; 6];
        for axis in &mut axes {
            let (low, high) = match self.config.burst {
                Burst::Rates16 => (HALF, word()),
                Burst::Rates32 | Burst::Increments32 => (word(), word()),
            };
            *axis = (i32::from(high.cast_signed()) << 16) | i32::from(low);
        }
        let temperature = word().cast_signed();
        let counter = word();
        let missed = self.missed(counter, time_ns)?;
        self.check_configuration()?;

        let is_at_end = axes.iter().any(|axis| {
            let high = *axis >> 16;
            high == i32::from(i16::MAX) || high == i32::from(i16::MIN)
        });
        let soundness = match (status, is_at_end) {
            (0, false) => Soundness::Sound,
            (0, true) => Soundness::Doubtful,
            _ => Soundness::Failing,
        };
        let interval_ns = self.config.rate.interval_ns();
        let model = self.config.model;
        let (rate, force) = match self.config.burst {
            Burst::Rates16 | Burst::Rates32 => {
                (model.rate_per_lsb_radps(), model.force_per_lsb_mps2())
            }
            Burst::Increments32 => {
                let per_s = f64::from(self.config.rate.hz());
                (model.dtheta_per_lsb_rad() * per_s, DV_PER_LSB_MPS * per_s)
            }
        };
        let [x_rate, y_rate, z_rate, x_force, y_force, z_force] =
            axes.map(|axis| f64::from(axis) / LOW_WORD);
        let reading = InertialReading {
            time_ns,
            interval_ns,
            omega_is_s_radps: [x_rate, y_rate, z_rate].map(|axis| axis * rate),
            f_is_s_mps2: [x_force, y_force, z_force].map(|axis| axis * force),
            temperature_c: Some(f32::from(temperature) / 10.0),
            is_valid: soundness == Soundness::Sound,
            missed,
        };
        self.last = Some((counter, time_ns));
        self.supervision.reading(now_ns, soundness, missed);
        // One reading into an empty list of sixteen.
        let _ = readings.push(reading);
        Ok(())
    }

    /// Reads one register back every eighth time: a register that changed by itself would be a wrong number.
    fn check_configuration(&mut self) -> Result<(), Fault> {
        if self.since_check < CHECK_EVERY {
            self.since_check += 1;
            return Ok(());
        }
        let (register, value) = self.supervision.to_check(&self.config.registers());
        self.expect(register, value)?;
        self.supervision.checked();
        self.since_check = 1;
        Ok(())
    }

    /// Readings between the last one given and this one, by the part's counter and the time that passed.
    fn missed(&mut self, counter: u16, time_ns: u64) -> Result<u32, Fault> {
        let Some((last, last_ns)) = self.last else {
            return Ok(0);
        };
        let step = counter.wrapping_sub(last);
        if step == 0 {
            return Err(Fault::Repeated);
        }
        let interval_ns = u64::from(self.config.rate.interval_ns());
        let elapsed_ns = time_ns.saturating_sub(last_ns);
        let counted_ns = u64::from(step).saturating_mul(interval_ns);
        // Jitter of a call that came late, and the part's clock.
        let allowed_ns = interval_ns + interval_ns / 2 + elapsed_ns / 16;
        if counted_ns.abs_diff(elapsed_ns) > allowed_ns {
            // The next is held against this one: either may be the wrong one.
            self.last = Some((counter, time_ns));
            return Err(Fault::Counter { step });
        }
        Ok(u32::from(step) - 1)
    }
}

/// Words of 16 bits, high byte first.
fn words(bytes: &[u8]) -> impl Iterator<Item = u16> + '_ {
    bytes
        .as_chunks::<2>()
        .0
        .iter()
        .map(|word| u16::from_be_bytes(*word))
}

impl<S: SpiDevice> Supervised for Adis<S> {
    fn supervision(&self) -> &Supervision {
        &self.supervision
    }
}

impl<S: SpiDevice> InertialUnit for Adis<S> {
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
            (Due::Reading, Some(time_ns)) => self.read(now_ns, time_ns, readings),
            (Due::Reading, None) => self.supervision.check_silence(now_ns),
        }
        .map_err(|fault| self.supervision.fault(now_ns, fault))
    }
}
