//! Drivers of sensors, behind a bus of which nothing is known.

use crate::call::{call1, call2};
use core::hint::black_box;
use embedded_hal::spi::{ErrorKind, ErrorType, Operation, SpiDevice};
use surefix_core::time::GpsTime;
use surefix_firmware::drivers::adis::{self, Adis};
use surefix_firmware::drivers::bmp390::Bmp390;
use surefix_firmware::drivers::icm42688::{self, Icm42688};
use surefix_firmware::drivers::lis3mdl::Lis3mdl;
use surefix_firmware::drivers::supervision::Supervision;
use surefix_firmware::drivers::{
    Barometer, InertialReading, InertialUnit, MagneticReading, Magnetometer, PressureReading,
    Readings, Supervised,
};

/// Any bytes, or an error.
struct MadeUp;

impl ErrorType for MadeUp {
    type Error = ErrorKind;
}

impl SpiDevice for MadeUp {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        for operation in operations {
            match operation {
                Operation::Read(bytes)
                | Operation::TransferInPlace(bytes)
                | Operation::Transfer(bytes, _) => bytes.fill_with(|| black_box(0)),
                Operation::Write(_) | Operation::DelayNs(_) => {}
            }
        }
        black_box(Ok(()))
    }
}

pub fn all() {
    let mut readings = Readings::new();
    let config = black_box(adis::Config {
        model: adis::Model::Adis16505_2,
        burst: adis::Burst::Rates32,
        rate: adis::Rate::Hz200,
        is_active_high: true,
    });
    if let Ok(mut unit) = Adis::new(MadeUp, config) {
        inertial(&mut unit, &mut readings);
    }
    let config = black_box(icm42688::Config {
        gyro: icm42688::GyroRange::Dps500,
        accel: icm42688::AccelRange::G8,
        rate: icm42688::Rate::Hz200,
    });
    inertial(&mut Icm42688::new(MadeUp, config), &mut readings);

    let mut barometer = Bmp390::new(MadeUp);
    asked(&barometer);
    black_box(
        black_box(&mut barometer)
            .service(black_box(0), black_box(Some(0)))
            .is_ok(),
    );
    let mut magnetometer = Lis3mdl::new(MadeUp);
    asked(&magnetometer);
    black_box(
        black_box(&mut magnetometer)
            .service(black_box(0), black_box(Some(0)))
            .is_ok(),
    );

    let time = GpsTime::from_ns(0);
    for reading in &readings {
        call2(InertialReading::unit_sample, reading, time);
    }
    let pressure = PressureReading {
        time_ns: 0,
        pressure_pa: 0.0,
        temperature_c: 0.0,
    };
    call2(PressureReading::sample, &pressure, time);
    let field = MagneticReading {
        time_ns: 0,
        field_s_ut: [0.0; 3],
    };
    call2(MagneticReading::sample, &field, time);
    call1(Supervision::new, 0);
}

fn inertial(unit: &mut impl InertialUnit, readings: &mut Readings) {
    asked(unit);
    // At any step of its start, or running.
    black_box(
        black_box(unit)
            .service(black_box(0), black_box(Some(0)), readings)
            .is_ok(),
    );
}

fn asked(unit: &impl Supervised) {
    black_box((
        unit.phase(),
        unit.next_ns(),
        unit.counters(),
        unit.interval_ns(),
    ));
}
