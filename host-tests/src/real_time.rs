//! `surefix real-time`: a flight through the emulated board in the board's own time, with its deadlines.
//!
//! ```text
//! flight ─► receiver bytes, inertial samples ─► one serial line ─► board ─► reports, and when each was sent
//!                                                     └─► monitor on this machine ─► the same reports?
//! ```
//!
//! | file | what it does |
//! |---|---|
//! | `real_time/line.rs` | when each byte is there |
//! | `real_time/sensors.rs` | units on the board's bus in place of the samples on the line |
//! | `real_time/told.rs` | what the board tells of its times |

pub mod line;
pub mod sensors;
mod told;

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use anyhow::{Context, Result, anyhow, bail};
use indicatif::{ProgressBar, ProgressDrawTarget};
use surefix_core::budget::STAGES;
use surefix_core::config::Config;
use surefix_core::inertial_report::InertialReport;
use surefix_core::ingest::{
    encode_configuration, encode_end_of_stream, encode_inertial, encode_unit,
};
use surefix_core::ins::InertialConfig;
use surefix_core::integrity::{Mode, Reason};
use surefix_core::report::EpochReport;
use surefix_core::wire::Counters;
use surefix_core::wire::native::{Frame, Full, HEADER_LEN, Kind, MAX_FRAME, TRAILER_LEN};

use crate::faults::FaultSpec;
use crate::nmea::{self, Sentence};
use crate::qemu::image;
use crate::qemu::paced::{self, INSTRUCTIONS_PER_TICK, TICKS_PER_SECOND};
use crate::replay::{Executor, HostExecutor, OutputReader};
use crate::simulate::atmosphere::Ionosphere;
use crate::simulate::flight::Flight;
use crate::simulate::inertial::{self, Scenario, board};
use crate::simulate::sky;
use crate::simulate::stream::Format;
use line::{BAUD, Line, merge, pieces};
use sensors::{CLOCK_PPM, Compared, FLIGHT_HZ, Fleet, UnitFault, configs};
use told::Told;
pub use told::{ToldSensors, ToldUnit};

/// Factor between the two clocks that are run.
const SLOW_DOWN: u64 = 10;

/// A flight through the emulated board in the board's own time: are its answers there in time?
///
/// Bytes of the receiver and inertial samples come over one serial line of 921,600 Bd, each at its time. With
/// --units samples come from units on the board's bus instead: ADIS16505 and ICM-42688-P at 200 Hz, ADIS16465 at
/// 400 Hz, each at its data-ready line; what the monitor was given is then held against what they held. The board executes 250 million instructions a second. Exit code 1 when a deadline was missed, or the
/// reports are not those of this machine; with --slow, when a report that came late says it may be used.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// A flight that carries an inertial unit
    #[arg(long, value_enum, default_value_t = Flight::Npa)]
    pub flight: Flight,
    /// Seed of everything random
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Length, minutes; a flight is as long as it is
    #[arg(long, default_value_t = 10.0)]
    pub minutes: f64,
    /// Inertial samples per second
    #[arg(long, default_value_t = 200)]
    pub imu_rate_hz: u32,
    /// Receiver epochs per second
    #[arg(long, default_value_t = 10)]
    pub rate_hz: u32,
    /// GPS and BDS without Galileo: 20 satellites
    #[arg(long)]
    pub no_galileo: bool,
    /// Fault on a satellite beside the flight's own, `SAT:KIND:MAG:T0:T1[:rr][:PERIOD]`
    #[arg(long = "fault", value_name = "SPEC")]
    pub faults: Vec<FaultSpec>,
    /// A tenth of the clock: 25 million instructions a second
    #[arg(long, conflicts_with = "units")]
    pub slow: bool,
    /// Inertial units on the board's bus, 1 to 3, in place of the samples on the line
    #[arg(long, default_value_t = 0, conflicts_with = "imu_rate_hz")]
    pub units: usize,
    /// What the receiver writes
    #[arg(long, value_enum, default_value_t = Format::Rtcm3)]
    pub format: Format,
    /// Fault of a unit on the bus, `UNIT:silent|stuck:T0:T1`
    #[arg(long = "unit-fault", value_name = "SPEC", requires = "units")]
    pub unit_faults: Vec<UnitFault>,
    /// Nothing comes over the line from T0 to T1, s from the first epoch, neither epochs nor samples: what does the
    /// board say by its own clock?
    #[arg(long, value_name = "T0:T1", conflicts_with_all = ["units", "slow"])]
    pub silence: Option<Silence>,
}

impl Default for Args {
    fn default() -> Self {
        Self {
            flight: Flight::Npa,
            seed: 1,
            minutes: 10.0,
            imu_rate_hz: 200,
            rate_hz: 10,
            no_galileo: false,
            faults: Vec::new(),
            slow: false,
            units: 0,
            format: Format::Rtcm3,
            unit_faults: Vec::new(),
            silence: None,
        }
    }
}

/// A time without a byte on the line, s from the first epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Silence {
    /// Its begin.
    pub from_s: f64,
    /// Its end.
    pub to_s: f64,
}

impl Silence {
    fn holds(&self, since_first_s: f64) -> bool {
        (self.from_s..self.to_s).contains(&since_first_s)
    }
}

impl FromStr for Silence {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text.split_once(':').and_then(|(from, to)| {
            Some(Self {
                from_s: from.parse().ok()?,
                to_s: to.parse().ok()?,
            })
        });
        parsed
            .filter(|silence| silence.from_s > 0.0 && silence.to_s > silence.from_s)
            .filter(|silence| silence.to_s.is_finite())
            .ok_or_else(|| format!("\"{text}\" is no span of time: give seconds as 20:25"))
    }
}

/// What a run was like.
#[derive(Clone, Debug)]
pub struct Outcome {
    args: Args,
    /// What the board said of each epoch.
    pub reports: Vec<EpochReport>,
    /// Satellites that had a filter of their own in the bank, per report of which it was a part.
    pub in_bank: Vec<usize>,
    /// What this machine said.
    pub expected: Vec<EpochReport>,
    /// Whether all that the board sent is what this machine sent, byte for byte.
    pub is_same: bool,
    /// From the last byte of an epoch until its report was sent, per report, s.
    pub latencies_s: Vec<f64>,
    /// From the instant of an epoch until its report was sent, per report, s.
    pub ages_s: Vec<f64>,
    /// Longest time from the last byte until work on the epoch began, s.
    pub worst_wait_s: f64,
    /// Bytes of the longest answer to an epoch.
    pub answer_bytes: usize,
    /// Most work of each stage, in what the whole clock would have executed in the time it took.
    pub worst_work: Vec<u32>,
    /// Reports with the bank in which there was no time for the filters of the pairs.
    pub pairs_dropped: usize,
    /// Deadlines missed, by the board's own count.
    pub deadline_misses: u32,
    /// Bytes of the stream that found the ring full.
    pub bytes_lost: u32,
    /// Deepest stack, bytes.
    pub stack_bytes: u32,
    /// Most bytes that waited in the ring.
    pub most_waiting: u32,
    /// Part of the board's time in which it worked.
    pub load: f64,
    /// What was said of the inertial side with each report.
    pub inertial: Vec<Option<InertialReport>>,
    /// With units on the bus: what became of them.
    pub on_bus: Option<OnBus>,
    /// Everything the board sent before the end of the stream.
    pub output: Vec<u8>,
    /// The last lines of the board's log.
    pub log: Vec<String>,
    /// Time on this machine.
    pub elapsed: Duration,
}

/// What became of units on the bus.
#[derive(Clone, Debug)]
pub struct OnBus {
    /// Of lines and times, as the board tells.
    pub sensors: ToldSensors,
    /// Of each unit, as its driver tells.
    pub units: Vec<ToldUnit>,
    /// What the monitor was given against what the units held.
    pub compared: Compared,
    /// Samples that each unit made.
    pub made: Vec<usize>,
    /// Transfers on the bus.
    pub transfers: u64,
    /// What the monitor was given, as a stream.
    pub recording: Vec<u8>,
}

/// The flight on its line.
fn prepare(args: &Args) -> Result<(Scenario, Line)> {
    let seconds = args.minutes * 60.0;
    if !(1.0..=3600.0).contains(&seconds) {
        bail!("--minutes {} is not between 1/60 and 60", args.minutes);
    }
    let scenario = inertial::fly(&inertial::Request {
        imu_rate_hz: if args.units > 0 {
            FLIGHT_HZ
        } else {
            args.imu_rate_hz
        },
        gnss_rate_hz: args.rate_hz,
        duration_s: Some(seconds as u32),
        galileo: !args.no_galileo,
        faults: args.faults.clone(),
        ..inertial::Request::new(args.flight, args.seed)
    })?;
    let radio = board::Radio {
        dual_frequency: false,
        ionosphere: Ionosphere::Klobuchar,
        troposphere: true,
        format: args.format,
    };
    let config = Config {
        reference_week: Some(sky::WEEK as u16),
        ..Config::PRESET
    };
    let mut frame = [0; MAX_FRAME];
    let native = |length: Result<usize, _>, frame: &[u8]| match length {
        Ok(length) => Ok(frame[..length].to_vec()),
        Err(surefix_core::wire::native::Full) => bail!("a native frame did not encode"),
    };
    let length = encode_configuration(&config, &mut frame);
    let head = native(length, &frame)?;
    let length = encode_end_of_stream(&mut frame);
    let end = native(length, &frame)?;

    let receiver = pieces(&board::receiver_bytes(&scenario, &radio)?, &config);
    let mut samples = pieces(&board::imu_bytes(&scenario)?, &config);
    // The first says what the unit is, which must be known before the first epoch.
    let mut unit = samples.remove(0).bytes;
    if args.units > 0 {
        samples.clear();
        unit = fleet_frames(&scenario, args.units)?;
    }
    let mut all = merge(samples, receiver);
    let first = all.first_mut().context("there is nothing to send")?;
    first.bytes.splice(0..0, [head, unit].concat());
    if let Some(last) = all.last_mut() {
        last.bytes.extend(end);
    }
    if let Some(silence) = args.silence {
        let first = scenario.start;
        let (head, tail) = all.split_at(1);
        let spoken = tail[..tail.len() - 1]
            .iter()
            .filter(|piece| !silence.holds(piece.due.seconds_since(first)));
        let spoken = head.iter().chain(spoken).chain(tail.last());
        all = spoken.cloned().collect();
    }
    let mut line = Line::new(all, if args.slow { SLOW_DOWN } else { 1 })?;
    if args.units > 0 {
        line.ppm = CLOCK_PPM;
    }
    Ok((scenario, line))
}

/// What the monitor must know of the units on the bus.
fn fleet_frames(scenario: &Scenario, count: usize) -> Result<Vec<u8>> {
    let unit = InertialConfig {
        interval_ns: 5_000_000,
        ..board::unit(scenario)
    };
    let full = |Full| anyhow!("a native frame did not encode");
    let mut frame = [0; MAX_FRAME];
    let length = encode_inertial(&unit, &mut frame).map_err(full)?;
    let mut frames = frame[..length].to_vec();
    // One unit alone has nobody to vote with.
    let voters = if count > 1 { count } else { 0 };
    for (number, config) in configs(scenario, voters).iter().enumerate() {
        let length = encode_unit(number as u8, config, &mut frame).map_err(full)?;
        frames.extend(&frame[..length]);
    }
    Ok(frames)
}

/// Flies, on the board and on this machine.
///
/// # Errors
/// When the flight cannot be simulated, or the emulator cannot be run.
pub fn fly(args: &Args, progress: &mut dyn FnMut(u64)) -> Result<Outcome> {
    let has_bus = args.units > 0;
    let feature = if has_bus { "spi-bridge" } else { "real-time" };
    let elf = image::build("monitor", &[feature])?;
    let (scenario, line) = prepare(args)?;
    let fleet = has_bus.then(|| Fleet::new(&scenario, &line, args.units, &args.unit_faults));
    let (fleet, sensors) = fleet.transpose()?.unzip();
    let there = paced::run(&elf, &line.memory()?, sensors, progress)?;
    let given = if has_bus {
        there.recording.clone()
    } else {
        line.bytes()
    };
    let mut here = Vec::new();
    HostExecutor.run(&given, &mut |bytes| here.extend_from_slice(bytes))?;

    let told = Told::read(&there.told, TICKS_PER_SECOND)
        .with_context(|| format!("the board did not finish; its log ends: {:#?}", there.log))?;
    let (end, answer_bytes) = before_end(&there.output)?;
    let on_bus = fleet
        .map(|fleet| on_bus(&fleet, &told, &there))
        .transpose()?;
    let read = |bytes: &[u8]| {
        let mut reader = OutputReader::default();
        reader.push(bytes);
        reader
    };
    let (board, host) = (read(&there.output[..end]), read(&here));
    if board.reports.len() != told.epochs.len() {
        bail!(
            "the board sent {} reports and tells of {}",
            board.reports.len(),
            told.epochs.len()
        );
    }
    let is_same = match args.silence {
        None => is_same(&there.output[..end], &here, on_bus.as_ref()),
        Some(silence) => {
            // This machine has no clock: it is told of a silence by what comes after, and told of none of it.
            let before =
                |report: &&EpochReport| report.since_first_ns as f64 / 1e9 < silence.from_s;
            let count = host.reports.iter().filter(before).count();
            count > 0 && board.reports.get(..count) == host.reports.get(..count)
        }
    };
    let seconds = |ticks: u64| ticks as f64 / line.ticks_per_second as f64;
    let ages_s = board.reports.iter().zip(&told.epochs);
    let ages_s = ages_s
        .map(|(report, epoch)| seconds(epoch.sent) - seconds(line.ticks(report.time)))
        .collect();
    Ok(Outcome {
        args: args.clone(),
        is_same,
        latencies_s: told
            .epochs
            .iter()
            .map(|e| seconds(e.sent - line.came(e.came)))
            .collect(),
        ages_s,
        worst_wait_s: told
            .epochs
            .iter()
            .map(|e| seconds(e.begun - line.came(e.came)))
            .fold(0.0, f64::max),
        answer_bytes,
        worst_work: told.worst_work,
        pairs_dropped: board
            .banks
            .iter()
            .flatten()
            .filter(|bank| bank.pairs_dropped)
            .count(),
        deadline_misses: told.deadline_misses,
        bytes_lost: board.counters.map_or(0, |c| c.receiver_bytes_lost),
        stack_bytes: told.stack_bytes,
        most_waiting: told.most_waiting,
        load: told.busy as f64 / told.epochs.last().map_or(1, |e| e.sent) as f64,
        in_bank: board
            .banks
            .iter()
            .flatten()
            .map(|bank| bank.tests.len())
            .collect(),
        on_bus,
        inertial: board.inertial,
        output: there.output[..end].to_vec(),
        reports: board.reports,
        expected: host.reports,
        log: there.log,
        elapsed: there.elapsed,
    })
}

fn on_bus(fleet: &Fleet, told: &Told, there: &paced::Outcome) -> Result<OnBus> {
    let sensors = told
        .sensors
        .context("the board tells nothing of its sensors")?;
    if !sensors.is_recorded {
        bail!("the board could not record all that its monitor was given");
    }
    Ok(OnBus {
        sensors,
        units: told.units.clone(),
        compared: fleet.compare(&there.recording)?,
        made: fleet.made(),
        transfers: there.served.as_ref().map_or(0, |served| served.transfers),
        recording: there.recording.clone(),
    })
}

/// Whether the board sent what this machine sent, byte for byte. Samples of the bus reach this machine's monitor
/// as frames, which it counts as such: in the counters alone they are taken off.
fn is_same(there: &[u8], here: &[u8], on_bus: Option<&OnBus>) -> bool {
    let samples = on_bus.map_or(0, |on_bus| on_bus.compared.samples as u32);
    let split = |bytes: &[u8]| {
        let length = HEADER_LEN + 4 * Counters::COUNT + TRAILER_LEN;
        let (before, frame) = bytes.split_at_checked(bytes.len().checked_sub(length)?)?;
        let (frame, _) = Frame::parse(frame).ok()?;
        Some((before.to_vec(), Counters::decode(frame.payload()).ok()?))
    };
    let (Some((there, counters)), Some((here, mut expected))) = (split(there), split(here)) else {
        return false;
    };
    expected.native_frames -= samples;
    expected.imu_samples -= samples;
    there == here && counters == expected
}

/// Bytes before the end-of-stream frame, and of the longest answer to an epoch.
fn before_end(output: &[u8]) -> Result<(usize, usize)> {
    let (mut at, mut begun, mut longest) = (0, 0, 0);
    let mut has_reported = false;
    loop {
        if let Sentence::Whole(line) = nmea::find(&output[at..]) {
            at += line.len();
            longest = longest.max(at - begun);
            continue;
        }
        let Ok((frame, length)) = Frame::parse(&output[at..]) else {
            break;
        };
        // An answer is the tests of the bank, the report, the sentences.
        if has_reported {
            begun = at;
        }
        match frame.kind() {
            Some(Kind::EndOfStream) => return Ok((at, longest)),
            Some(Kind::OutputInvalid) => bail!("the firmware failed and withdrew its output"),
            _ => {}
        }
        at += length;
        has_reported = frame.kind() == Some(Kind::Report);
    }
    bail!("the board's output has no end");
}

impl Outcome {
    /// The time an answer may take, s.
    pub fn deadline_s(&self) -> f64 {
        1.0 / f64::from(self.args.rate_hz)
    }

    /// Reports that the board took back because they were late.
    pub fn withdrawn(&self) -> usize {
        let is_late = |report: &&EpochReport| report.verdict.reason == Reason::DeadlineMissed;
        self.reports.iter().filter(is_late).count()
    }

    /// Reports that say they may be used and were sent after the next epoch was due.
    pub fn late_and_usable(&self) -> usize {
        let reports = self.reports.iter().zip(&self.latencies_s);
        reports
            .filter(|(report, latency_s)| {
                report.verdict.integrity.is_usable() && **latency_s > self.deadline_s()
            })
            .count()
    }

    /// Reports of epochs within the silence that was asked for.
    pub fn of_silence(&self) -> Vec<&EpochReport> {
        let within = |report: &&EpochReport| {
            let since_s = report.since_first_ns as f64 / 1e9;
            self.args
                .silence
                .is_some_and(|silence| silence.holds(since_s))
        };
        self.reports.iter().filter(within).collect()
    }

    /// Whether every epoch of the silence has its report, and none may be used.
    fn tells_silence(&self) -> bool {
        let Some(silence) = self.args.silence else {
            return true;
        };
        let told = self.of_silence();
        let due = (silence.to_s - silence.from_s) * f64::from(self.args.rate_hz);
        // Those at both ends may fall on either side.
        (told.len() as f64 - due).abs() <= 1.0
            && told.iter().all(|report| {
                report.verdict.reason == Reason::ReceiverSilent
                    && !report.verdict.integrity.is_usable()
            })
    }

    /// Whether what was to be shown is shown: with its whole clock the board's answers are those of this
    /// machine, and on their line before the next epoch is due; cut to a tenth none that is late is usable.
    pub fn holds(&self) -> bool {
        let line_s = self.answer_bytes as f64 * 10.0 / BAUD as f64;
        let is_in_time = self.deadline_misses == 0
            && self.withdrawn() == 0
            && self.is_same
            && self.tells_silence()
            && worst(&self.ages_s) + line_s < self.deadline_s();
        let is_true = self.on_bus.as_ref().is_none_or(OnBus::holds);
        self.late_and_usable() == 0 && is_true && (self.args.slow || is_in_time)
    }
}

impl OnBus {
    /// Whether nothing was invented and nothing lost on the way.
    pub fn holds(&self) -> bool {
        let told = &self.sensors;
        self.compared.samples > 0
            && self.compared.invented == 0
            && (told.edges_lost, told.samples_lost) == (0, 0)
    }
}

impl fmt::Display for OnBus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (told, compared) = (&self.sensors, &self.compared);
        for (unit, made) in self.units.iter().zip(&self.made) {
            writeln!(
                f,
                "unit {}                         {} samples made, {} read, {} invalid, {} missed; silent {} times, started {} times, {}",
                unit.number,
                made,
                unit.readings,
                unit.invalid,
                unit.missed,
                unit.silent,
                unit.starts,
                if unit.is_running {
                    "runs"
                } else {
                    "does not run"
                }
            )?;
        }
        writeln!(
            f,
            "samples to the monitor         {}, {} invalid, {} that no unit held; {:.3} bits and {:.1} us off at most",
            compared.samples,
            compared.invalid,
            compared.invented,
            compared.worst_bits,
            compared.worst_time_ns as f64 / 1000.0,
        )?;
        writeln!(
            f,
            "time of samples                {} pulses, {} missing, {} refused; {} samples held over, {} without a time",
            told.pulses,
            told.pulses_missing,
            told.pulses_refused,
            told.held_over,
            told.without_time,
        )?;
        writeln!(
            f,
            "bus                            {} transfers; {} samples waiting at most, {} edges and {} samples lost",
            self.transfers, told.most_waiting, told.edges_lost, told.samples_lost,
        )
    }
}

fn worst(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let args = &self.args;
        let rate = TICKS_PER_SECOND * INSTRUCTIONS_PER_TICK / 1_000_000;
        let rate = if args.slow { rate / SLOW_DOWN } else { rate };
        writeln!(
            f,
            "{}, {} min, {} epochs a second and {} over one line of {BAUD} Bd; {rate} M instructions a second",
            args.flight.name(),
            args.minutes,
            args.rate_hz,
            match args.units {
                0 => format!("{} inertial samples", args.imu_rate_hz),
                units => format!("{units} units on the bus; the receiver"),
            },
        )?;
        if args.slow {
            writeln!(
                f,
                "work is counted as what the whole clock would have executed in the time it took"
            )?;
        }
        let used = self.reports.iter().map(|r| r.used.len());
        let tight = self
            .reports
            .iter()
            .filter(|r| r.mode == Mode::Tight)
            .count();
        let usable = self
            .reports
            .iter()
            .filter(|r| r.verdict.integrity.is_usable())
            .count();
        writeln!(
            f,
            "reports                        {}, {tight} of them of the filter, up to {} satellites",
            self.reports.len(),
            used.max().unwrap_or(0),
        )?;
        let filled = self.in_bank.iter().max().copied().unwrap_or(0);
        let is_filled = self.in_bank.iter().filter(|n| **n == filled).count();
        writeln!(
            f,
            "reports with the bank          {}, {is_filled} of them with {filled} satellites in it, {} without pairs",
            self.in_bank.len(),
            self.pairs_dropped,
        )?;
        writeln!(
            f,
            "usable                         {usable}; on this machine {}",
            {
                let expected = self.expected.iter();
                expected.filter(|r| r.verdict.integrity.is_usable()).count()
            }
        )?;
        writeln!(
            f,
            "deadlines missed               {}, reports taken back for it {}, usable ones sent late {}",
            self.deadline_misses,
            self.withdrawn(),
            self.late_and_usable(),
        )?;
        let ms = 1000.0;
        writeln!(
            f,
            "report after the last byte     {:.2} ms at most, of which waiting {:.2} ms; {:.0} ms are allowed",
            ms * worst(&self.latencies_s),
            ms * self.worst_wait_s,
            ms * self.deadline_s(),
        )?;
        writeln!(
            f,
            "report after the epoch         {:.2} ms at most, the line included",
            ms * worst(&self.ages_s),
        )?;
        let line_s = self.answer_bytes as f64 * 10.0 / BAUD as f64;
        writeln!(
            f,
            "an answer to an epoch          {} bytes at most: {:.1} ms more on a line of that speed",
            self.answer_bytes,
            ms * line_s,
        )?;
        for (stage, work) in STAGES.iter().zip(&self.worst_work) {
            writeln!(
                f,
                "work of {:<22} {work} instructions at most; {} are allowed",
                stage.name, stage.budget
            )?;
        }
        writeln!(
            f,
            "load                           {:.1} %",
            100.0 * self.load
        )?;
        writeln!(
            f,
            "receiver ring                  {} bytes waiting at most, {} lost",
            self.most_waiting, self.bytes_lost
        )?;
        writeln!(
            f,
            "stack                          {} bytes",
            self.stack_bytes
        )?;
        if let Some(on_bus) = &self.on_bus {
            write!(f, "{on_bus}")?;
        }
        writeln!(
            f,
            "bytes of this machine          {}",
            match (self.is_same, args.silence) {
                (false, _) => "different",
                (true, None) => "the same",
                (true, Some(_)) => "reports the same up to the silence",
            }
        )?;
        write!(
            f,
            "took                           {:.0} s",
            self.elapsed.as_secs_f64()
        )
    }
}

impl Args {
    /// Runs `surefix real-time`; whether what was to be shown is shown.
    ///
    /// # Errors
    /// As [`fly`].
    pub fn run(&self) -> Result<bool> {
        if let Some(missing) = image::missing() {
            bail!("{missing}");
        }
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        bar.set_message("bytes sent by the board");
        let outcome = fly(self, &mut |sent| bar.set_position(sent))?;
        bar.finish_and_clear();
        println!("{outcome}");
        if self.slow || !outcome.holds() {
            for line in outcome.log.iter().rev().take(20).rev() {
                println!("board: {line}");
            }
        }
        Ok(outcome.holds())
    }
}
