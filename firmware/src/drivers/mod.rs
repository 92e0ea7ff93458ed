//! Sensors on a serial bus: registers to readings in units, and what went wrong.
//!
//! A driver is given a bus (`SpiDevice` of embedded-hal 1.0) and the time; it owns no clock, no pin and
//! no interrupt, and knows no board and no navigation. The caller calls `service` when the part's
//! data-ready line becomes active, and no later than [`Supervised::next_ns`] in any case: then a part
//! that is silent is noticed and a part that failed is started again. `service` never waits for longer
//! than a transfer and the pauses that the part asks for between transfers (some ten microseconds);
//! a reset that takes a quarter of a second is many short calls.
//!
//! | module | part |
//! |---|---|
//! | [`adis`] | Analog Devices ADIS16465, ADIS16470, ADIS16505: inertial units with a burst read |
//! | [`icm42688`] | TDK ICM-42688-P: inertial unit with a FIFO |
//! | [`bmp390`] | Bosch BMP390: barometer |
//! | [`lis3mdl`] | ST LIS3MDL: magnetometer |
//! | [`supervision`] | faults in a row, restarts, counters: what all drivers share |
//!
//! Another part is one more file that implements one of the three traits.

pub mod adis;
pub mod bmp390;
pub mod icm42688;
pub mod lis3mdl;
mod registers;
pub mod supervision;

use embedded_hal::spi::ErrorKind;
use surefix_core::ins::{ImuSample, MagneticSample, PressureSample, UnitSample};
use surefix_core::time::GpsTime;

use supervision::Supervision;
pub use supervision::{DriverCounters, Phase};

/// Most readings that one call of [`InertialUnit::service`] gives.
pub const MAX_READINGS: usize = 16;

/// Readings of one call, oldest first.
pub type Readings = heapless::Vec<InertialReading, MAX_READINGS>;

/// What an inertial unit measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InertialReading {
    /// When its interval ended, ns, on the clock of the caller.
    pub time_ns: u64,
    /// Length of the interval, ns: the nominal one of the part.
    pub interval_ns: u32,
    /// Mean angular rate against inertial space, axes of the unit, rad/s.
    pub omega_is_s_radps: [f64; 3],
    /// Mean specific force, axes of the unit, m/s².
    pub f_is_s_mps2: [f64; 3],
    /// Temperature of the part, °C, when it gives one.
    pub temperature_c: Option<f32>,
    /// Whether the part itself holds the reading for sound: none of its status bits is set and no axis is
    /// at the end of its numbers.
    pub is_valid: bool,
    /// Readings that the part made between the one given before and this one, as its counter says: nobody
    /// read them, or they were refused.
    pub missed: u32,
}

impl InertialReading {
    /// As the monitor takes it: increments over the interval that ended at `time`, which is
    /// [`InertialReading::time_ns`] on GNSS time.
    pub fn unit_sample(&self, time: GpsTime) -> UnitSample {
        let interval_s = f64::from(self.interval_ns) * 1e-9;
        UnitSample {
            sample: ImuSample {
                time,
                interval_ns: self.interval_ns,
                dtheta_is_s_rad: self.omega_is_s_radps.map(|rate| rate * interval_s),
                dv_is_s_mps: self.f_is_s_mps2.map(|force| force * interval_s),
            },
            is_valid: self.is_valid,
            temperature_c: self.temperature_c,
        }
    }
}

/// What a barometer measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PressureReading {
    /// When, ns, on the clock of the caller.
    pub time_ns: u64,
    /// Pressure, compensated, Pa.
    pub pressure_pa: f64,
    /// Temperature of the part, °C.
    pub temperature_c: f64,
}

impl PressureReading {
    /// As the monitor takes it, with [`PressureReading::time_ns`] on GNSS time.
    pub fn sample(&self, time: GpsTime) -> PressureSample {
        PressureSample {
            time,
            pressure_pa: self.pressure_pa,
            temperature_c: self.temperature_c,
        }
    }
}

/// What a magnetometer measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MagneticReading {
    /// When, ns, on the clock of the caller.
    pub time_ns: u64,
    /// Magnetic field, axes of the magnetometer, µT.
    pub field_s_ut: [f64; 3],
}

impl MagneticReading {
    /// As the monitor takes it, with [`MagneticReading::time_ns`] on GNSS time.
    pub fn sample(&self, time: GpsTime) -> MagneticSample {
        MagneticSample {
            time,
            field_s_ut: self.field_s_ut,
        }
    }
}

/// What went wrong in one call. Each is counted, and none gives a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The bus itself reports an error.
    Bus(ErrorKind),
    /// Every bit that came has this value: no part drives the line.
    Stuck {
        /// The bit.
        high: bool,
    },
    /// Another part answers, or none.
    WrongIdentity {
        /// What its identity register says.
        read: u16,
    },
    /// The part did not come out of its reset.
    ResetNotDone,
    /// The part's test of itself failed.
    SelfTest {
        /// Its result register.
        status: u16,
    },
    /// A register does not hold what was written into it, or a constant of the part is out of its range.
    Configuration {
        /// Which.
        register: u8,
        /// What it holds.
        read: u16,
    },
    /// The sum over a transfer does not match the one that came with it.
    Checksum {
        /// Over what came.
        computed: u16,
        /// That came.
        received: u16,
    },
    /// The part's counter says that this reading was given before, or its status that none is new.
    Repeated,
    /// The part's counter moved by other than the time that passed allows.
    Counter {
        /// By how much.
        step: u16,
    },
    /// What was read twice came differently: one of the two is wrong.
    Unconfirmed,
    /// What came has not the form of a reading.
    Malformed {
        /// The word that decides.
        word: u16,
    },
    /// The part had no room for its readings and dropped some.
    Overrun,
    /// No reading for longer than [`supervision::SILENT_INTERVALS`] intervals.
    Silent {
        /// Since the last, ns.
        since_ns: u64,
    },
    /// Measured outside the range that the part is made for.
    OutOfRange,
}

/// What all drivers can be asked.
pub trait Supervised {
    /// What the driver keeps of its part.
    fn supervision(&self) -> &Supervision;

    /// Whether it gives readings.
    fn phase(&self) -> Phase {
        self.supervision().phase()
    }

    /// When `service` is due at the latest, ns, on the clock of the caller: the next step of a start, or
    /// the end of the time within which a reading must come.
    fn next_ns(&self) -> u64 {
        self.supervision().next_ns()
    }

    /// What became of readings and starts since the driver was made.
    fn counters(&self) -> DriverCounters {
        self.supervision().counters()
    }

    /// Interval between readings, ns, as configured.
    fn interval_ns(&self) -> u32 {
        self.supervision().interval_ns()
    }
}

/// Samples with time, validity and temperature.
pub trait InertialUnit: Supervised {
    /// Does what is due: a step of the start, or reads what the part has.
    ///
    /// `data_ready_ns` is when the data-ready line became active, `None` when it is not. `readings` is
    /// emptied first; what stands in it after an error was read before the fault and is sound.
    ///
    /// # Errors
    /// What went wrong; it is counted. After [`supervision::FAULTS_IN_A_ROW`] calls in a row that failed
    /// the driver starts the part again by itself.
    fn service(
        &mut self,
        now_ns: u64,
        data_ready_ns: Option<u64>,
        readings: &mut Readings,
    ) -> Result<(), Fault>;
}

/// Pressure and temperature.
pub trait Barometer: Supervised {
    /// Does what is due, as [`InertialUnit::service`]; `Ok(None)` when there is no new reading.
    ///
    /// # Errors
    /// What went wrong; it is counted.
    fn service(
        &mut self,
        now_ns: u64,
        data_ready_ns: Option<u64>,
    ) -> Result<Option<PressureReading>, Fault>;
}

/// The magnetic field.
pub trait Magnetometer: Supervised {
    /// Does what is due, as [`InertialUnit::service`]; `Ok(None)` when there is no new reading.
    ///
    /// # Errors
    /// What went wrong; it is counted.
    fn service(
        &mut self,
        now_ns: u64,
        data_ready_ns: Option<u64>,
    ) -> Result<Option<MagneticReading>, Fault>;
}

/// What the bus itself reports.
fn bus(error: impl embedded_hal::spi::Error) -> Fault {
    Fault::Bus(error.kind())
}
