//! The sensors of the boards and their drivers. Three makes of inertial unit, so that each kind of transfer is
//! there: a burst of 32 bits, a FIFO, and a burst of 16 bits at twice the rate.

use super::{Bus, present};
use crate::drivers::adis::{self, Adis, Burst, Model};
use crate::drivers::bmp390::Bmp390;
use crate::drivers::icm42688::{self, AccelRange, GyroRange, Icm42688};
use crate::drivers::lis3mdl::Lis3mdl;
use crate::drivers::{Barometer, InertialUnit, Magnetometer};
use crate::sensors::Parts;
use static_cell::StaticCell;

const UNIT_0: adis::Config = adis::Config {
    model: Model::Adis16505_2,
    burst: Burst::Rates32,
    rate: adis::Rate::Hz200,
    is_active_high: true,
};
const UNIT_1: icm42688::Config = icm42688::Config {
    gyro: GyroRange::Dps500,
    accel: AccelRange::G16,
    rate: icm42688::Rate::Hz200,
};
const UNIT_2: adis::Config = adis::Config {
    model: Model::Adis16465_2,
    burst: Burst::Rates16,
    rate: adis::Rate::Hz400,
    is_active_high: true,
};

/// 1 MHz: the most for a burst of an ADIS part.
const BURST_BIT_NS: u32 = 1000;
/// 8 MHz.
const FAST_BIT_NS: u32 = 125;

/// Those that are there. For `init`, once.
pub fn parts() -> Parts<'static> {
    static FIRST: StaticCell<Adis<Bus>> = StaticCell::new();
    static SECOND: StaticCell<Icm42688<Bus>> = StaticCell::new();
    static THIRD: StaticCell<Adis<Bus>> = StaticCell::new();
    static BAROMETER: StaticCell<Bmp390<Bus>> = StaticCell::new();
    static MAGNETOMETER: StaticCell<Lis3mdl<Bus>> = StaticCell::new();

    let present = present();
    let bus = |part: u8, bit_ns| (present & (1 << part) != 0).then(|| Bus::new(part, bit_ns));
    let adis = |bus: Option<Bus>, config, place: &'static StaticCell<Adis<Bus>>| {
        let driver = Adis::new(bus?, config).ok()?;
        Some(place.init(driver) as &mut (dyn InertialUnit + Send))
    };
    let second = bus(1, FAST_BIT_NS).map(|bus| Icm42688::new(bus, UNIT_1));
    Parts {
        units: [
            adis(bus(0, BURST_BIT_NS), UNIT_0, &FIRST),
            second.map(|driver| SECOND.init(driver) as &mut (dyn InertialUnit + Send)),
            adis(bus(2, BURST_BIT_NS), UNIT_2, &THIRD),
        ],
        barometer: bus(3, FAST_BIT_NS)
            .map(|bus| BAROMETER.init(Bmp390::new(bus)) as &mut (dyn Barometer + Send)),
        magnetometer: bus(4, FAST_BIT_NS)
            .map(|bus| MAGNETOMETER.init(Lis3mdl::new(bus)) as &mut (dyn Magnetometer + Send)),
    }
}
