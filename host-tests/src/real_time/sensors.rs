//! Units on the bus of the emulated board during a flight, and whether what its monitor was given is what they
//! held.

use std::sync::Arc;

use anyhow::{Result, anyhow, bail};
use surefix_core::ingest::decode_unit_sample;
use surefix_core::ins::{InertialNoise, SensorRange, UnitConfig, UnitSample, UnitTolerance};
use surefix_core::time::NS_PER_S;
use surefix_core::wire::native::{Frame, Kind};

use super::line::{Line, START_S};
use crate::bridge::motion::{BoardClock, Felt};
use crate::bridge::units::{Flown, Record, TimedFault};
use crate::bridge::{Device, Sensors};
use crate::imu::frames;
use crate::parts::adis::Adis;
use crate::parts::icm42688::Icm42688;
use crate::parts::{Fault, Part};
use crate::simulate::inertial::{self, Scenario};

/// Error of the board's clock, parts in a million: one that must be found.
pub const CLOCK_PPM: f64 = 23.0;
/// Rate at which a flight is simulated for the units, Hz; between its samples they feel the mean.
pub const FLIGHT_HZ: u32 = 400;
/// Difference of the seeds of two units.
const NEXT_UNIT: u64 = 1000;

/// Degree per second, rad/s, and standard gravity, m/s².
const DEG: f64 = core::f64::consts::PI / 180.0;
const G: f64 = 9.806_65;

/// What is on the bus (firmware: board/mps2/bridge/parts.rs): interval, ns, and the least significant bit of a
/// rate, rad/s, and of a force, m/s².
const MAKES: [Make; 3] = [
    // ADIS16505-2, burst of 32 bits.
    Make {
        interval_ns: 5_000_000,
        lsb: [DEG / 40.0 / 65_536.0, 1.0 / 26_756_268.0],
    },
    // ICM-42688-P, FIFO of 16 bits, 500 °/s and 16 g.
    Make {
        interval_ns: 5_000_000,
        lsb: [DEG / 65.5, G / 2048.0],
    },
    // ADIS16465-2, burst of 16 bits.
    Make {
        interval_ns: 2_500_000,
        lsb: [DEG / 40.0, G / 4000.0],
    },
];

struct Make {
    interval_ns: u64,
    lsb: [f64; 2],
}

/// What the vote is told of the first `count` units: the grade of the flight and what the numbers of each make
/// take as noise, mounted as the body is.
pub fn configs(scenario: &Scenario, count: usize) -> Vec<UnitConfig> {
    let grade = scenario.grade.noise();
    let configs = MAKES.iter().take(count).map(|make| {
        // A number that is rounded is off by its bit / √12, anew with each sample.
        let root_s = (make.interval_ns as f64 * 1e-9).sqrt();
        let [rate, force] = make.lsb.map(|lsb| lsb / 12.0_f64.sqrt() * root_s);
        UnitConfig {
            interval_ns: make.interval_ns as u32,
            c_b_s: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            lever_arm_b_m: [0.0; 3],
            noise: InertialNoise {
                arw: grade.density.arw.hypot(rate),
                vrw: grade.density.vrw.hypot(force),
                ..grade.density
            },
            range: SensorRange {
                rate_radps: 500.0 * DEG,
                specific_force_mps2: 78.0,
            },
            tolerance: UnitTolerance {
                gyro_bias_radps: grade.gyro_bias_radps,
                accel_bias_mps2: grade.accel_bias_mps2,
                scale: scenario.grade.scale(),
                timing_s: 50e-6,
            },
        }
    });
    configs.collect()
}

/// A fault of a unit: `UNIT:KIND:T0:T1`, kinds `silent`, `stuck` (data-ready), s since the start of the flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitFault {
    unit: usize,
    fault: Fault,
    from_s: f64,
    until_s: f64,
}

impl std::str::FromStr for UnitFault {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> Result<Self> {
        let parts: Vec<&str> = text.split(':').collect();
        let [unit, kind, from, until] = parts[..] else {
            bail!("`{text}` is not UNIT:KIND:T0:T1");
        };
        Ok(Self {
            unit: unit.parse()?,
            fault: match kind {
                "silent" => Fault::Silent,
                "stuck" => Fault::StuckDataReady { active: true },
                _ => bail!("`{kind}` is neither silent nor stuck"),
            },
            from_s: from.parse()?,
            until_s: until.parse()?,
        })
    }
}

/// The units of a flight and their records.
pub struct Fleet {
    clock: BoardClock,
    records: Vec<Record>,
}

/// What a recording says of the units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Compared {
    /// Samples in it.
    pub samples: usize,
    /// Samples that no unit held so: a value is off by more than half a bit, or there was none at that time.
    pub invented: usize,
    /// Samples that the part did not hold for sound.
    pub invalid: usize,
    /// Worst difference of a value, bits.
    pub worst_bits: f64,
    /// Worst error of a sample's time, ns.
    pub worst_time_ns: u64,
}

impl Fleet {
    /// `count` units that feel the flight `scenario`, which was simulated at [`FLIGHT_HZ`].
    ///
    /// # Errors
    /// When there are not so many, or a flight cannot be simulated.
    pub fn new(
        scenario: &Scenario,
        line: &Line,
        count: usize,
        faults: &[UnitFault],
    ) -> Result<(Self, Sensors)> {
        if !(1..=MAKES.len()).contains(&count) {
            bail!("--units {count} is not between 1 and {}", MAKES.len());
        }
        let clock = BoardClock {
            start: line.start,
            at_start_ns: (START_S * 1e9) as u64,
            ppm: line.ppm,
        };
        // Whole seconds of GPS time from the next on.
        let first_s = scenario.start.ns().div_euclid(NS_PER_S) + 1;
        let pulses = (0..i64::from(scenario.duration_s)).map(|second| {
            let time = scenario.start;
            let to_pulse_ns = (first_s + second) * NS_PER_S - time.ns();
            clock.local_ns(time.plus_ns(to_pulse_ns))
        });
        let mut sensors = Sensors::new(pulses);
        let mut records = Vec::new();
        for (number, make) in MAKES.iter().enumerate().take(count) {
            let own;
            let samples = if number == 0 {
                &scenario.imu
            } else {
                // The same track, felt by another unit.
                let mut request = scenario.request.clone();
                request.seed += number as u64 * NEXT_UNIT;
                own = inertial::fly(&request)?;
                &own.imu
            };
            let felt = Arc::new(Felt::new(scenario.start, samples));
            let local_ns = |s: f64| clock.local_ns(scenario.start.plus_ns((s * 1e9) as i64));
            let own_faults = faults.iter().filter(|fault| fault.unit == number);
            let own_faults = own_faults.map(|fault| TimedFault {
                fault: fault.fault,
                from_ns: local_ns(fault.from_s),
                until_ns: local_ns(fault.until_s),
            });
            let connected = Connect {
                clock,
                felt,
                interval_ns: make.interval_ns,
                faults: own_faults.collect(),
            };
            let (device, record) = match number {
                0 => connected.device(Adis::new(16_505, 2)),
                1 => connected.device(Icm42688::new()),
                _ => connected.device(Adis::new(16_465, 2)),
            };
            sensors.connect(number as u8, device);
            records.push(record);
        }
        Ok((Self { clock, records }, sensors))
    }

    /// Holds what the monitor was given against what the units held.
    ///
    /// # Errors
    /// When the recording has a frame of a sample that is none.
    pub fn compare(&self, recording: &[u8]) -> Result<Compared> {
        let mut compared = Compared::default();
        let records: Vec<_> = self
            .records
            .iter()
            .map(|record| record.lock().map(|record| record.clone()))
            .collect::<Result<_, _>>()
            .map_err(|_| anyhow!("the server of the bus panicked"))?;
        for frame in frames(recording) {
            let Ok((frame, _)) = Frame::parse(&recording[frame]) else {
                continue;
            };
            if frame.kind() != Some(Kind::UnitSample) {
                continue;
            }
            let (unit, sample) = decode_unit_sample(frame.payload())
                .map_err(|error| anyhow!("a sample of the recording: {error:?}"))?;
            compared.samples += 1;
            if !sample.is_valid {
                compared.invalid += 1;
                continue;
            }
            let Some(make) = MAKES.get(usize::from(unit)) else {
                bail!("there is no unit {unit}");
            };
            let ready_ns = self.clock.local_ns(sample.sample.time);
            let held = &records[usize::from(unit)];
            let after = held.partition_point(|held| held.ready_ns < ready_ns);
            let near = after.saturating_sub(1)..(after + 1).min(held.len());
            let Some(nearest) = held[near]
                .iter()
                .min_by_key(|held| held.ready_ns.abs_diff(ready_ns))
            else {
                compared.invented += 1;
                continue;
            };
            let time_ns = nearest.ready_ns.abs_diff(ready_ns);
            let bits = bits_apart(&sample, make, nearest.motion);
            compared.worst_bits = compared.worst_bits.max(bits);
            compared.worst_time_ns = compared.worst_time_ns.max(time_ns);
            // A little more than half: angles of 2^-16 bits are rounded as numbers, too.
            if !(bits < 0.51) || time_ns > make.interval_ns / 2 {
                compared.invented += 1;
            }
        }
        Ok(compared)
    }

    /// Samples that each unit made.
    pub fn made(&self) -> Vec<usize> {
        let length = |record: &Record| record.lock().map_or(0, |record| record.len());
        self.records.iter().map(length).collect()
    }
}

struct Connect {
    clock: BoardClock,
    felt: Arc<Felt>,
    interval_ns: u64,
    faults: Vec<TimedFault>,
}

impl Connect {
    fn device(self, part: impl Part + Send + 'static) -> (Box<dyn Device>, Record) {
        let (flown, record) =
            Flown::new(part, self.clock, self.felt, self.interval_ns, self.faults);
        (Box::new(flown), record)
    }
}

/// Worst difference between a sample and what its unit held, least significant bits.
fn bits_apart(sample: &UnitSample, make: &Make, motion: crate::parts::Motion) -> f64 {
    let interval_s = f64::from(sample.sample.interval_ns) * 1e-9;
    let kinds = [
        (
            sample.sample.dtheta_is_s_rad,
            motion.omega_is_s_radps,
            make.lsb[0],
        ),
        (sample.sample.dv_is_s_mps, motion.f_is_s_mps2, make.lsb[1]),
    ];
    let mut worst = 0.0_f64;
    for (increments, means, lsb) in kinds {
        for (increment, mean) in increments.iter().zip(means) {
            let apart = (increment / interval_s - mean).abs() / lsb;
            worst = if apart > worst || apart.is_nan() {
                apart
            } else {
                worst
            };
        }
    }
    worst
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_of_a_unit_is_read_or_refused() {
        let fault: UnitFault = "2:silent:4:6.5".parse().unwrap();
        assert_eq!((fault.unit, fault.fault), (2, Fault::Silent));
        assert_eq!((fault.from_s, fault.until_s), (4.0, 6.5));
        for text in ["2:silent:4", "x:silent:1:2", "0:loud:1:2", "0:stuck:1:b"] {
            assert!(text.parse::<UnitFault>().is_err(), "{text}");
        }
    }
}
