//! Flights whose receiver's epochs arrive late, and how far the positions are from the truth then.
//!
//! The flight, its samples and its epochs are the same whenever they arrive; the bytes of an epoch only
//! come behind the samples of later instants. Two positions are compared with the truth: the report of an
//! epoch, at the epoch's instant, and the position now, ten times in a second, at the sample's.

use anyhow::{Result, anyhow, bail};
use nalgebra::Vector3;
use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};
use surefix_core::budget::NoCounter;
use surefix_core::config::Config;
use surefix_core::inertial_report::InertialReport;
use surefix_core::ingest::{
    decode_imu, encode_configuration, encode_end_of_stream, encode_inertial,
    encode_receiver_latency,
};
use surefix_core::integrity::{Mode, Phase};
use surefix_core::monitor::{Monitor, Ready};
use surefix_core::report::EpochReport;
use surefix_core::time::GpsTime;
use surefix_core::wire::native::{Frame, Full, Kind, MAX_FRAME};

use crate::imu::{Pending, frames, interleave};
use crate::replay::{BankFilters, new_monitor};
use crate::simulate::atmosphere::Ionosphere;
use crate::simulate::flight::Flight;
use crate::simulate::inertial::board::{Radio, receiver_bytes, unit};
use crate::simulate::inertial::catalogue::{Plan, over_threshold};
use crate::simulate::inertial::motion::Motion;
use crate::simulate::inertial::sensors::Grade;
use crate::simulate::inertial::{Request, Scenario, fly_plan};
use crate::simulate::sky::WEEK;
use crate::simulate::stream::Format;

/// Errors count from here on, s: the filter has converged.
const COUNTED_FROM_S: f64 = 20.0;
/// Between two positions now, ns.
const NOW_EVERY_NS: i64 = 100_000_000;
/// Random numbers of latencies.
const STREAM_LATENCY: u64 = (1 << 32) + 40;

/// How the vehicle moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Course {
    /// A car at 16 m/s, 58 km/h, in corners, braking and over a bridge, with a MEMS unit.
    Car,
    /// An aircraft at 100 m/s in turns of 3 to 6 °/s, climbing and descending, with a tactical unit.
    Aircraft,
}

impl Course {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Car, Self::Aircraft];

    /// In words, for tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Car => "car, 16 m/s",
            Self::Aircraft => "aircraft, 100 m/s",
        }
    }

    fn plan(self, duration_s: u32) -> Plan {
        let (grade, motion, above_m) = match self {
            Self::Car => {
                let motion = Motion::level(20.0, 16.0)
                    .turn(22.0, 28.0, 90.0, 1.5)
                    .accelerate(32.0, 36.0, -8.0, 1.0)
                    .accelerate(38.0, 44.0, 8.0, 1.0)
                    .slope(46.0, 49.0, 3.0)
                    .slope(54.0, 57.0, -3.0)
                    .slope(62.0, 64.0, 0.0)
                    .turn(66.0, 72.0, -90.0, 1.5)
                    .turn(76.0, 82.0, -90.0, 1.5);
                (Grade::Mems, motion.without_bank(), 0.0)
            }
            Self::Aircraft => {
                let motion = Motion::level(340.0, 100.0)
                    .turn(22.0, 42.0, 90.0, 3.0)
                    .slope(44.0, 50.0, 8.0)
                    .slope(56.0, 62.0, -6.0)
                    .turn(64.0, 79.0, -90.0, 3.0)
                    .slope(80.0, 86.0, 0.0);
                (Grade::Tactical, motion, 800.0)
            }
        };
        let anchor = over_threshold(0, above_m);
        Plan::new(duration_s, grade, Phase::Npa, motion, anchor)
    }
}

/// When epochs arrive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Arrival {
    /// So long after their instants, ms.
    After(i64),
    /// Uniformly between these, ms after their instants.
    Between(i64, i64),
    /// At once at first, and by so many milliseconds later in each second.
    Growing(i64),
    /// So long after their instants, ms, but these seconds of the flight later still.
    Worse {
        /// Latency, ms.
        ms: i64,
        /// First and last second, the last not included.
        span_s: (i64, i64),
        /// Latency meanwhile, ms.
        worse_ms: i64,
    },
}

/// A flight with all that arrives.
pub struct LateFlight {
    scenario: Scenario,
    receiver: Vec<u8>,
    config: Config,
    gnss_hz: u32,
    seed: u64,
}

/// How a monitor is run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting {
    /// When epochs arrive.
    pub arrival: Arrival,
    /// What the monitor is told of it, ms.
    pub known_ms: Option<u32>,
    /// With the bank of filters.
    pub with_bank: bool,
}

/// A position, and how far it is from the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Erring {
    /// Of which time.
    pub time: GpsTime,
    /// Distance from the truth, m.
    pub error_m: f64,
}

/// What a monitor said.
#[derive(Clone, Debug)]
pub struct Said {
    /// The reports.
    pub reports: Vec<EpochReport>,
    /// The inertial side of each.
    pub inertial: Vec<InertialReport>,
    /// Errors of the positions of epochs in tight mode.
    pub at_epochs: Vec<Erring>,
    /// Errors of the positions now.
    pub now: Vec<Erring>,
}

/// Root mean square and the largest, m.
pub fn rms_and_worst(errors: &[Erring]) -> [f64; 2] {
    let squares: f64 = errors.iter().map(|e| e.error_m * e.error_m).sum();
    let worst = errors.iter().map(|e| e.error_m).fold(0.0, f64::max);
    [(squares / errors.len().max(1) as f64).sqrt(), worst]
}

impl LateFlight {
    /// Flies.
    ///
    /// # Errors
    /// When the rates do not fit each other.
    pub fn new(
        course: Course,
        duration_s: u32,
        gnss_hz: u32,
        imu_hz: u32,
        seed: u64,
    ) -> Result<Self> {
        let request = Request {
            imu_rate_hz: imu_hz,
            gnss_rate_hz: gnss_hz,
            duration_s: Some(duration_s),
            ..Request::new(Flight::Drive, seed)
        };
        let scenario = fly_plan(&request, course.plan(duration_s))?;
        let radio = Radio {
            dual_frequency: false,
            ionosphere: Ionosphere::None,
            troposphere: true,
            format: Format::Rtcm3,
        };
        let receiver = receiver_bytes(&scenario, &radio)?;
        let config = Config {
            reference_week: Some(WEEK as u16),
            ionosphere: surefix_core::config::IonosphereModel::None,
            ..Config::PRESET
        };
        Ok(Self {
            scenario,
            receiver,
            config,
            gnss_hz,
            seed,
        })
    }

    /// How late epoch number `k` is, ns, for all of them.
    fn latencies(&self, arrival: Arrival) -> impl FnMut(usize) -> i64 {
        let mut random = ChaCha20Rng::seed_from_u64(self.seed);
        random.set_stream(STREAM_LATENCY);
        let per_second = i64::from(self.gnss_hz);
        move |k| {
            let second = k as i64 / per_second;
            1_000_000
                * match arrival {
                    Arrival::After(ms) => ms,
                    Arrival::Between(from_ms, to_ms) => {
                        from_ms + i64::from(random.next_u32()) % (to_ms - from_ms + 1)
                    }
                    Arrival::Growing(per_second_ms) => second * per_second_ms,
                    Arrival::Worse {
                        ms,
                        span_s: (from_s, to_s),
                        worse_ms,
                    } => {
                        if (from_s..to_s).contains(&second) {
                            worse_ms
                        } else {
                            ms
                        }
                    }
                }
        }
    }

    /// Everything a board would get, in its order.
    ///
    /// # Errors
    /// When a frame does not fit.
    pub fn stream(&self, setting: &Setting) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let mut frame = [0; MAX_FRAME];
        let put = |length: Result<usize, Full>, frame: &[u8], out: &mut Vec<u8>| {
            let length = length.map_err(|Full| anyhow!("a native frame did not encode"))?;
            out.extend_from_slice(&frame[..length]);
            Ok::<(), anyhow::Error>(())
        };
        let length = encode_configuration(&self.config, &mut frame);
        put(length, &frame, &mut bytes)?;
        let length = encode_inertial(&unit(&self.scenario), &mut frame);
        put(length, &frame, &mut bytes)?;
        if let Some(known_ms) = setting.known_ms {
            let length = encode_receiver_latency(known_ms * 1_000_000, &mut frame);
            put(length, &frame, &mut bytes)?;
        }
        interleave(
            &self.receiver,
            &self.config,
            Pending::new(&self.scenario.imu),
            self.latencies(setting.arrival),
            &mut bytes,
        )?;
        let length = encode_end_of_stream(&mut frame);
        put(length, &frame, &mut bytes)?;
        Ok(bytes)
    }

    fn erring(&self, time: GpsTime, r_e_m: [f64; 3]) -> Option<Erring> {
        let t_s = time.seconds_since(self.scenario.start);
        let is_counted = t_s >= COUNTED_FROM_S && t_s <= f64::from(self.scenario.duration_s);
        let truth = self.scenario.trajectory.state(t_s).r_eb_e;
        is_counted.then(|| Erring {
            time,
            error_m: (Vector3::from(r_e_m) - truth).norm(),
        })
    }

    /// Runs a monitor over the flight.
    ///
    /// # Errors
    /// When a frame does not fit.
    pub fn run(&self, setting: &Setting) -> Result<Said> {
        let stream = self.stream(setting)?;
        let mut monitor = new_monitor();
        let mut filters = setting.with_bank.then(BankFilters::new);
        let mut said = Said {
            reports: Vec::new(),
            inertial: Vec::new(),
            at_epochs: Vec::new(),
            now: Vec::new(),
        };
        for place in frames(&stream) {
            let frame = &stream[place];
            let mut rest = frame;
            loop {
                let (used, ready) = monitor.push(rest);
                rest = &rest[used..];
                match ready {
                    Some(Ready::Epoch) => self.take(&mut monitor, filters.as_mut(), &mut said)?,
                    Some(Ready::EndOfStream) => return Ok(said),
                    None if rest.is_empty() => break,
                    None => {}
                }
            }
            if let Ok((frame, _)) = Frame::parse(frame)
                && frame.kind() == Some(Kind::Imu)
                && let Ok(sample) = decode_imu(frame.payload())
                && (sample.time.ns() - self.scenario.start.ns()) % NOW_EVERY_NS == 0
                && let Some(now) = monitor.navigation_now()
            {
                if now.time != sample.time {
                    bail!("the position now is not of the newest sample");
                }
                said.now.extend(self.erring(now.time, now.r_e_m));
            }
        }
        bail!("the stream has no end frame")
    }

    fn take(
        &self,
        monitor: &mut Monitor,
        filters: Option<&mut BankFilters>,
        said: &mut Said,
    ) -> Result<()> {
        let memory = filters.map(BankFilters::memory);
        let report = monitor.process_with(&mut NoCounter, memory);
        let Some(inertial) = monitor.inertial_report(&report) else {
            bail!("no word of the inertial side");
        };
        if report.mode == Mode::Tight
            && let Some(fix) = report.fix
        {
            said.at_epochs.extend(self.erring(report.time, fix.r_e_m));
        }
        said.reports.push(report);
        said.inertial.push(inertial);
        Ok(())
    }

    /// Second of the flight of a time.
    pub fn t_s(&self, time: GpsTime) -> f64 {
        time.seconds_since(self.scenario.start)
    }
}
