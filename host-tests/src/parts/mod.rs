//! Sensors on a serial bus, register by register: what drivers are tested against.
//!
//! Each part is written from its data sheet, not from the driver: registers with their values after a
//! reset, pages and banks, what reading and writing does, numbers as the part rounds them, counters, the
//! data-ready line. The physical world comes in as a [`Motion`]; what can go wrong as a [`Fault`].
//!
//! | module | part |
//! |---|---|
//! | [`adis`] | ADIS16465, ADIS16470, ADIS16505 |
//! | [`icm42688`] | ICM-42688-P |
//! | [`bmp390`] | BMP390 |
//! | [`lis3mdl`] | LIS3MDL |
//! | [`bus`] | a part as an `SpiDevice` of embedded-hal |
//! | [`faults`] | what can be wrong with a part and its wires |

pub mod adis;
pub mod bmp390;
pub mod bus;
pub mod faults;
pub mod icm42688;
pub mod lis3mdl;

pub use bus::Bus;
pub use faults::{Fault, Faults};

/// What the world does to the parts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Mean angular rate against inertial space, axes of the part, rad/s.
    pub omega_is_s_radps: [f64; 3],
    /// Mean specific force, axes of the part, m/s².
    pub f_is_s_mps2: [f64; 3],
    /// Temperature of the part, °C.
    pub temperature_c: f64,
    /// Static pressure, Pa.
    pub pressure_pa: f64,
    /// Magnetic field, axes of the part, µT.
    pub field_s_ut: [f64; 3],
}

impl Motion {
    /// At rest and level, 25 °C, sea level, a field of middle latitudes.
    pub const REST: Self = Self {
        omega_is_s_radps: [0.0; 3],
        f_is_s_mps2: [0.0, 0.0, -9.806_65],
        temperature_c: 25.0,
        pressure_pa: 101_325.0,
        field_s_ut: [20.0, 0.0, 44.0],
    };
}

/// A part on the bus.
pub trait Part {
    /// Chip select low, these bytes both ways, chip select high.
    fn transfer(&mut self, mosi: &[u8], miso: &mut [u8]);

    /// Time that the master leaves before the next transfer, ns.
    fn pause(&mut self, _ns: u64) {}

    /// Lets the part's time run on to `now_ns`: the samples that fall due measure `motion`.
    fn advance(&mut self, now_ns: u64, motion: &Motion);

    /// When the next sample falls due, ns; `u64::MAX` while none does.
    fn next_ns(&self) -> u64;

    /// When the data-ready line became active, ns; `None` while it is not.
    fn data_ready_ns(&self) -> Option<u64>;

    /// Whether the data-ready line is active.
    fn data_ready(&self) -> bool {
        self.data_ready_ns().is_some()
    }

    /// What is wrong with it.
    fn faults(&mut self) -> &mut Faults;
}

/// The data-ready line after its faults.
fn line(faults: &Faults, edge_ns: Option<u64>, last_ns: u64) -> Option<u64> {
    if faults.has(Fault::StuckDataReady { active: false }) {
        None
    } else if faults.has(Fault::StuckDataReady { active: true }) {
        Some(last_ns)
    } else {
        edge_ns
    }
}

/// The nearest whole number, kept within what a register holds.
fn rounded(value: f64, least: i32, most: i32) -> i32 {
    value.round().clamp(f64::from(least), f64::from(most)) as i32
}
