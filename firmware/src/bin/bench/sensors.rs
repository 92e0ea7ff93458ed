//! What is measured of sensors on a bus: a sample through its driver, through the queue, and its time.
//!
//! The bus is a few registers in memory that answer as a healthy part does, so that a transfer costs what it
//! takes to copy its bytes: neither semihosting nor the time on the wire is in the figures.

use super::measure::{Of, RUNS, Row, require};
use core::convert::Infallible;
use core::hint::black_box;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use heapless::spsc::Queue;
use surefix_core::ins::{MAX_UNITS, SampleClock};
use surefix_core::time::GpsTime;
use surefix_firmware::drivers::adis::{self, Adis, Burst, Model};
use surefix_firmware::drivers::icm42688::{self, AccelRange, GyroRange, Icm42688};
use surefix_firmware::drivers::{InertialUnit, Phase, Readings};
use surefix_firmware::sensors::{ARRIVALS, Arrival, Edge, Line, Parts, Sampler};

const INTERVAL_NS: u64 = 5_000_000;

/// Everything.
#[inline(never)]
pub fn all() {
    adis("drivers/adis_burst_32", Model::Adis16505_2, Burst::Rates32);
    adis("drivers/adis_burst_16", Model::Adis16465_2, Burst::Rates16);
    icm();
    queue();
    clock();
}

fn adis(stage: &str, model: Model, burst: Burst) {
    let config = adis::Config {
        model,
        burst,
        rate: adis::Rate::Hz200,
        is_active_high: true,
    };
    let Ok(mut driver) = Adis::new(AdisMemory::of(model), config) else {
        require(false, "the part has no such burst");
        return;
    };
    driver_row(stage, &mut driver, size_of::<Adis<()>>());
}

fn icm() {
    let mut driver = Icm42688::new(IcmMemory::new(), ICM);
    driver_row(
        "drivers/icm42688_fifo",
        &mut driver,
        size_of::<Icm42688<()>>(),
    );
}

const ICM: icm42688::Config = icm42688::Config {
    gyro: GyroRange::Dps500,
    accel: AccelRange::G16,
    rate: icm42688::Rate::Hz200,
};

/// Runs the start of a driver to its end and gives the time.
fn start(driver: &mut dyn InertialUnit, readings: &mut Readings) -> u64 {
    let mut now_ns = 0;
    for _ in 0..20 {
        if driver.phase() == Phase::Running {
            break;
        }
        now_ns = driver.next_ns();
        let _ = driver.service(now_ns, None, readings);
    }
    require(driver.phase() == Phase::Running, "the part does not start");
    now_ns
}

fn driver_row(stage: &str, driver: &mut dyn InertialUnit, ram_b: usize) {
    let mut readings = Readings::new();
    let mut now_ns = start(driver, &mut readings);
    let mut row = Row::new();
    for _ in 0..RUNS {
        now_ns += INTERVAL_NS;
        row.run(|| {
            let _ = driver.service(black_box(now_ns), Some(now_ns), &mut readings);
        });
        let is_read = readings.first().is_some_and(|reading| reading.is_valid);
        require(is_read, "a driver gives no reading");
    }
    row.print_of(
        stage,
        &Of {
            ram_b: Some(ram_b),
            ..Of::default()
        },
    );
}

/// From an edge to what the worker takes, beside the driver.
fn queue() {
    let mut queue: Queue<Arrival, ARRIVALS> = Queue::new();
    let (mut arrived, mut arrivals) = queue.split();
    let mut driver = Icm42688::new(IcmMemory::new(), ICM);
    let mut now_ns = start(&mut driver, &mut Readings::new());
    let mut units = [const { None }; MAX_UNITS];
    units[0] = Some(&mut driver as &mut (dyn InertialUnit + Send));
    let mut sampler = Sampler::new(Parts {
        units,
        ..Parts::default()
    });
    let mut row = Row::new();
    for _ in 0..RUNS {
        now_ns += INTERVAL_NS;
        let edge = Edge {
            line: Line::Unit(0),
            time_ns: now_ns,
            place: 0,
        };
        let mut taken = None;
        row.run(|| {
            sampler.take(black_box(&edge), now_ns, &mut |arrival| {
                let _ = arrived.enqueue(arrival);
            });
            taken = arrivals.dequeue();
        });
        require(taken.is_some(), "nothing came through the queue");
    }
    row.print_of(
        "sensors/driver+queue",
        &Of {
            ram_b: Some(size_of::<Queue<Arrival, ARRIVALS>>()),
            ..Of::default()
        },
    );
}

/// The time of a sample.
fn clock() {
    let mut clock = SampleClock::EMPTY;
    for second in 0..10 {
        let local_ns = 1_000_000_000 + second * 1_000_020_000;
        clock.pulse(local_ns);
        for tenth in 0..2 {
            let since_ns = second * 1_000_000_000 + tenth * 100_000_000;
            clock.epoch(
                GpsTime::from_ns(since_ns as i64),
                local_ns + tenth * 100_000_000 + 20_000_000,
            );
        }
    }
    let mut row = Row::new();
    for run in 0..RUNS {
        let local_ns = 10_000_180_000 + run as u64 * INTERVAL_NS;
        let mut time = None;
        row.run(|| time = clock.time(black_box(local_ns)).ok());
        require(time.is_some(), "a sample has no time");
    }
    row.print_of(
        "ins/sample_clock",
        &Of {
            ram_b: Some(size_of::<SampleClock>()),
            ..Of::default()
        },
    );
}

/// The operations of a transaction one after the other, with what `answer` makes of each byte sent.
fn transact(operations: &mut [Operation<'_, u8>], mut answer: impl FnMut(u8) -> u8) {
    for operation in operations {
        match operation {
            Operation::Read(read) => read.iter_mut().for_each(|byte| *byte = answer(0)),
            Operation::Write(write) => write.iter().for_each(|byte| {
                answer(*byte);
            }),
            Operation::TransferInPlace(both) => {
                both.iter_mut().for_each(|byte| *byte = answer(*byte));
            }
            Operation::Transfer(read, write) => {
                let sent = write.iter().copied().chain(core::iter::repeat(0));
                read.iter_mut()
                    .zip(sent)
                    .for_each(|(byte, sent)| *byte = answer(sent));
            }
            Operation::DelayNs(_) => {}
        }
    }
}

/// Registers of an ADIS part, and bursts with a counter.
struct AdisMemory {
    registers: [u8; 128],
    answer: [u8; 2],
    counter: u16,
}

impl AdisMemory {
    fn of(model: Model) -> Self {
        let product: u16 = match model {
            Model::Adis16465_2 => 16_465,
            _ => 16_505,
        };
        let mut registers = [0; 128];
        registers[0x72..0x74].copy_from_slice(&product.to_le_bytes());
        registers[0x5e] = 0x07;
        Self {
            registers,
            answer: [0; 2],
            counter: 0,
        }
    }

    /// The answer to a burst of a length.
    fn burst(&mut self, length: usize) -> [u8; 34] {
        self.counter = self.counter.wrapping_add(1);
        let mut bytes = [0; 34];
        for (place, byte) in bytes.iter_mut().enumerate().skip(4).take(length - 10) {
            *byte = (7 * place) as u8;
        }
        bytes[length - 4..length - 2].copy_from_slice(&self.counter.to_be_bytes());
        let sum = bytes[2..length - 2]
            .iter()
            .fold(0_u16, |sum, byte| sum.wrapping_add(u16::from(*byte)));
        bytes[length - 2..length].copy_from_slice(&sum.to_be_bytes());
        bytes
    }

    fn word(&mut self, [address, value]: [u8; 2]) -> [u8; 2] {
        let now = self.answer;
        let place = usize::from(address & 0x7f);
        if address & 0x80 != 0 {
            self.registers[place] = value;
            self.answer = [0; 2];
        } else {
            self.answer = [self.registers[place | 1], self.registers[place & !1]];
        }
        now
    }
}

impl ErrorType for AdisMemory {
    type Error = Infallible;
}

impl SpiDevice for AdisMemory {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        let bytes: [u8; 34] = match operations.first() {
            Some(Operation::TransferInPlace([address, value])) => {
                let mut bytes = [0; 34];
                bytes[..2].copy_from_slice(&self.word([*address, *value]));
                bytes
            }
            Some(Operation::TransferInPlace(burst)) => self.burst(burst.len()),
            _ => return Ok(()),
        };
        let mut next = bytes.iter();
        transact(operations, |_| next.next().copied().unwrap_or(0));
        Ok(())
    }
}

/// Registers of an ICM-42688-P, and a FIFO with one packet whenever it is asked.
struct IcmMemory {
    registers: [u8; 128],
    time_us: u16,
}

/// Axes and temperature of a packet and of the data registers.
const AXES: [u8; 12] = [0, 40, 0, 50, 8, 0, 0, 3, 0, 2, 0, 1];

impl IcmMemory {
    fn new() -> Self {
        let mut registers = [0; 128];
        registers[0x75] = 0x47;
        // The reset is done; a packet waits.
        registers[0x2d..0x30].copy_from_slice(&[0x14, 0, 1]);
        registers[0x1f..0x2b].copy_from_slice(&AXES);
        Self {
            registers,
            time_us: 0,
        }
    }
}

impl ErrorType for IcmMemory {
    type Error = Infallible;
}

impl SpiDevice for IcmMemory {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        if let Some(Operation::Write([command, value])) = operations.first() {
            let address = usize::from(*command & 0x7f);
            self.registers[address] = *value;
            // The sensors answer to the forces of the test.
            if address == SELF_TEST_CONFIG {
                let shift = if *value == 0 { 0 } else { TEST_ANSWER };
                for (place, byte) in self.registers[0x1f..0x2b].iter_mut().enumerate() {
                    *byte = AXES[place] + if place % 2 == 0 { shift } else { 0 };
                }
            }
            return Ok(());
        }
        let Some(Operation::Write([command])) = operations.first() else {
            return Ok(());
        };
        let mut packet = [0; 16];
        let address = usize::from(*command & 0x7f);
        let bytes = if address == FIFO_DATA {
            self.time_us = self.time_us.wrapping_add(5000);
            packet[0] = 0x68;
            packet[1..13].copy_from_slice(&AXES);
            packet[14..].copy_from_slice(&self.time_us.to_be_bytes());
            &packet[..]
        } else {
            &self.registers[address..]
        };
        let mut next = core::iter::once(&0).chain(bytes);
        transact(operations, |_| next.next().copied().unwrap_or(0));
        Ok(())
    }
}

const FIFO_DATA: usize = 0x30;
const SELF_TEST_CONFIG: usize = 0x70;
/// High byte of an answer that passes the test.
const TEST_ANSWER: u8 = 32;
