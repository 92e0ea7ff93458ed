//! `surefix replay`: a recording through the monitor, on this machine or on the emulated board.
//!
//! ```text
//! files ─► source ─► bytes ─► Executor (Monitor here, or in QEMU) ─► bytes ─► reports ─► output
//! ```
//!
//! Both executors take the same bytes and give the same kind of bytes back; what reads them does not
//! know who made them.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde::Serialize;
use surefix_core::bank_report::BankReport;
use surefix_core::budget::NoCounter;
use surefix_core::config::Config;
use surefix_core::inertial_report::InertialReport;
use surefix_core::ins::AidsConfig;
use surefix_core::integrity::Integrity;
use surefix_core::monitor::{Monitor, Ready};
use surefix_core::report::{self, EpochReport};
use surefix_core::satellite_report::SatelliteReport;
use surefix_core::sentences;
use surefix_core::tight::{BankMemory, MonitorFastFilters, MonitorSecondaries};
use surefix_core::wire::counters::Counters;
use surefix_core::wire::native::{self, Frame, FrameError, Kind};

use crate::aiding;
use crate::faults::FaultSpec;
use crate::fixes::FixOptions;
use crate::imu::{self, ImuSettings};
use crate::nmea::{self, Sentence};
use crate::output::{self, Summary};
use crate::qemu::QemuExecutor;
use crate::source::{self, RecordingInfo};
use crate::truth::Truth;

/// Runs a monitor over a stream of bytes.
pub trait Executor {
    /// Sends all of `stream` to a fresh monitor and gives every piece of what it sends back to
    /// `output`, in order.
    ///
    /// # Errors
    /// When the monitor cannot be run to the end of the stream.
    fn run(&mut self, stream: &[u8], output: &mut dyn FnMut(&[u8])) -> Result<()>;
}

/// The monitor in this process.
#[derive(Clone, Copy, Debug, Default)]
pub struct HostExecutor;

impl Executor for HostExecutor {
    fn run(&mut self, stream: &[u8], output: &mut dyn FnMut(&[u8])) -> Result<()> {
        let mut monitor = new_monitor();
        let mut filters = BankFilters::new();
        let mut bank = Box::new(BankReport::EMPTY);
        let mut satellites = Box::new(SatelliteReport::EMPTY);
        let mut frame = [0; native::MAX_FRAME];
        let mut rest = stream;
        loop {
            let (used, ready) = monitor.push(rest);
            rest = rest.get(used..).unwrap_or_default();
            match ready {
                Some(Ready::Epoch) => {
                    let report = monitor.process_with(&mut NoCounter, Some(filters.memory()));
                    if monitor.bank_report(&mut bank) {
                        match bank.encode(&mut frame) {
                            Ok(length) => output(&frame[..length]),
                            Err(native::Full) => {
                                bail!("the tests of a bank do not fit their frame")
                            }
                        }
                    }
                    match report::encode(&report, &mut frame) {
                        Ok(length) => output(&frame[..length]),
                        Err(native::Full) => bail!("a report does not fit its frame"),
                    }
                    match sentences::encode(&report, &mut frame) {
                        Ok(length) => output(&frame[..length]),
                        Err(native::Full) => bail!("the sentences of an epoch do not fit"),
                    }
                    if let Some(inertial) = monitor.inertial_report(&report) {
                        match inertial.encode(&mut frame) {
                            Ok(length) => output(&frame[..length]),
                            Err(native::Full) => {
                                bail!("the inertial side of an epoch does not fit its frame")
                            }
                        }
                    }
                    if monitor.satellite_report(&report, &mut satellites) {
                        match satellites.encode(&mut frame) {
                            Ok(length) => output(&frame[..length]),
                            Err(native::Full) => {
                                bail!("the satellites of an epoch do not fit their frame")
                            }
                        }
                    }
                }
                Some(Ready::EndOfStream) => break,
                None if rest.is_empty() => bail!("the stream has no end frame"),
                None => {}
            }
        }
        let mut counters = [0; native::MAX_FRAME];
        if let Ok(length) = monitor.counters().encode(&mut counters) {
            output(&counters[..length]);
        }
        Ok(())
    }
}

/// A monitor on the heap.
pub fn new_monitor() -> Box<Monitor> {
    Box::new(Monitor::EMPTY)
}

/// The filters of a bank on the heap.
#[derive(Debug)]
pub struct BankFilters {
    fast: Box<MonitorFastFilters>,
    secondaries: Box<MonitorSecondaries>,
}

impl BankFilters {
    /// For one monitor.
    pub fn new() -> Self {
        Self {
            fast: Box::new(MonitorFastFilters::EMPTY),
            secondaries: Box::new(MonitorSecondaries::EMPTY),
        }
    }

    /// As a monitor takes them.
    pub fn memory(&mut self) -> BankMemory<'_> {
        BankMemory {
            fast: &mut self.fast,
            secondaries: &mut self.secondaries,
        }
    }
}

impl Default for BankFilters {
    fn default() -> Self {
        Self::new()
    }
}

/// Puts a monitor's output together from pieces of any size.
#[derive(Clone, Debug, Default)]
pub struct OutputReader {
    pending: Vec<u8>,
    /// Reports, in order.
    pub reports: Vec<EpochReport>,
    /// What the bank of filters found, for each report; `None` where it did not run.
    pub banks: Vec<Option<Box<BankReport>>>,
    /// The satellites of each report's epoch; `None` where the receiver sent no observations.
    pub satellites: Vec<Option<Box<SatelliteReport>>>,
    /// The inertial side at each report's epoch; `None` without an inertial unit.
    pub inertial: Vec<Option<InertialReport>>,
    /// Of the epoch whose report comes next.
    bank: Option<Box<BankReport>>,
    /// NMEA sentences, in order, with their line ends.
    pub sentences: String,
    /// What the monitor counted, when it has said so.
    pub counters: Option<Counters>,
    /// Frames that could not be read, and bytes between frames.
    pub damaged: u64,
}

impl OutputReader {
    /// Takes a piece.
    pub fn push(&mut self, piece: &[u8]) {
        self.pending.extend_from_slice(piece);
        let mut start = 0;
        while start < self.pending.len() {
            let rest = &self.pending[start..];
            match Frame::parse(rest) {
                Ok((frame, length)) => {
                    let understood = match frame.kind() {
                        Some(Kind::Report) => report::decode(frame.payload())
                            .map(|report| self.take(report))
                            .is_ok_and(|it_fits| it_fits),
                        Some(Kind::Bank) => BankReport::decode(frame.payload())
                            .map(|bank| self.bank = Some(Box::new(bank)))
                            .is_ok(),
                        Some(Kind::Satellites) => SatelliteReport::decode(frame.payload())
                            .map(|satellites| self.take_satellites(satellites))
                            .is_ok_and(|it_fits| it_fits),
                        Some(Kind::InertialReport) => InertialReport::decode(frame.payload())
                            .map(|inertial| self.take_inertial(inertial))
                            .is_ok_and(|it_fits| it_fits),
                        Some(Kind::Counters) => Counters::decode(frame.payload())
                            .map(|counters| self.counters = Some(counters))
                            .is_ok(),
                        _ => true,
                    };
                    if !understood {
                        self.damaged += 1;
                    }
                    start += length;
                }
                Err(FrameError::Incomplete { .. }) => break,
                Err(_) => match nmea::find(rest) {
                    Sentence::Whole(line) => {
                        self.sentences.push_str(line);
                        start += line.len();
                    }
                    Sentence::Incomplete => break,
                    Sentence::None => {
                        self.damaged += 1;
                        start += 1;
                    }
                },
            }
        }
        self.pending.drain(..start);
    }

    /// Takes a report with what the bank found before it; tells whether the two are of one epoch.
    fn take(&mut self, report: EpochReport) -> bool {
        let bank = self.bank.take();
        let it_fits = bank.as_ref().is_none_or(|bank| bank.time == report.time);
        self.banks.push(bank.filter(|_| it_fits));
        self.satellites.push(None);
        self.inertial.push(None);
        self.reports.push(report);
        it_fits
    }

    /// Takes the inertial side at the epoch whose report came last; tells whether it is of it.
    fn take_inertial(&mut self, inertial: InertialReport) -> bool {
        match (self.reports.last(), self.inertial.last_mut()) {
            (Some(report), Some(place @ None)) if report.time == inertial.time => {
                *place = Some(inertial);
                true
            }
            _ => false,
        }
    }

    /// Takes the satellites of the epoch whose report came last; tells whether they are of it.
    fn take_satellites(&mut self, satellites: SatelliteReport) -> bool {
        match (self.reports.last(), self.satellites.last_mut()) {
            (Some(report), Some(place @ None)) if report.time == satellites.time => {
                *place = Some(Box::new(satellites));
                true
            }
            _ => false,
        }
    }
}

/// Where the monitor runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Machine {
    /// In this process.
    Host,
    /// On the emulated Cortex-M7.
    Qemu,
}

/// A fixed antenna's positions lie so near to where it is, horizontally, m: several times what a
/// single-frequency receiver errs by, half of what a short walk covers.
pub const FIXED_WITHIN_M: f64 = 10.0;

/// Where the truth comes from.
#[derive(Clone, Debug)]
pub enum TruthChoice {
    /// Given: a fixed point or a track.
    Given(Truth),
    /// The position the recording states for itself, if it does and its antenna was fixed: no inertial
    /// sample came, and at most a quarter of the positions lie farther than [`FIXED_WITHIN_M`] from it.
    FromRecording,
}

/// Everything a replay needs.
#[derive(Clone, Debug)]
pub struct ReplayOptions {
    /// The recording.
    pub gnss: PathBuf,
    /// RINEX navigation files.
    pub nav: Vec<PathBuf>,
    /// What to compare with.
    pub truth: TruthChoice,
    /// The monitor's configuration.
    pub config: Config,
    /// Recordings of inertial units: none, of one, or of each that votes.
    pub imu: Vec<PathBuf>,
    /// What a configuration file says of it.
    pub imu_settings: Option<ImuSettings>,
    /// The aids.
    pub aids: AidsConfig,
    /// Recording of a barometer.
    pub barometer: Option<PathBuf>,
    /// Faults to put on it.
    pub faults: Vec<FaultSpec>,
    /// What to change of the receiver's own solutions.
    pub fixes: FixOptions,
    /// Seed of the random faults.
    pub seed: u64,
    /// Where to run.
    pub machine: Machine,
}

impl ReplayOptions {
    /// A recording with the preset configuration, on this machine.
    pub fn new(gnss: impl Into<PathBuf>) -> Self {
        Self {
            gnss: gnss.into(),
            nav: Vec::new(),
            truth: TruthChoice::FromRecording,
            config: Config::PRESET,
            imu: Vec::new(),
            imu_settings: None,
            aids: AidsConfig::NONE,
            barometer: None,
            faults: Vec::new(),
            fixes: FixOptions::default(),
            seed: 1,
            machine: Machine::Host,
        }
    }
}

/// What came out of a replay.
#[derive(Clone, Debug)]
pub struct ReplayResult {
    /// One report per epoch.
    pub reports: Vec<EpochReport>,
    /// What the bank of filters found at each, where it ran.
    pub banks: Vec<Option<Box<BankReport>>>,
    /// The satellites of each, where the receiver sent observations.
    pub satellites: Vec<Option<Box<SatelliteReport>>>,
    /// The inertial side at each, where there is an inertial unit.
    pub inertial: Vec<Option<InertialReport>>,
    /// NMEA sentences, four per epoch.
    pub sentences: String,
    /// Error of each, east, north, up, m.
    pub errors_enu_m: Vec<Option<[f64; 3]>>,
    /// Everything that can be said in short.
    pub summary: Summary,
    /// What the recording was.
    pub info: RecordingInfo,
    /// What the monitor counted.
    pub counters: Counters,
    /// Lost input by cause, from reading the file and from the monitor.
    pub losses: BTreeMap<String, u64>,
    /// Why the position the recording states for itself is not the truth, if it states one.
    pub truth_unused: Option<String>,
}

/// Losses that cost an epoch or a part of one.
const COSTLY: [&str; 16] = [
    "rtcm_bad_crc",
    "native_bad_crc",
    "native_too_long",
    "native_refused",
    "cut_off_frames",
    "rtcm_empty",
    "rtcm_truncated",
    "rtcm_too_many_cells",
    "rtcm_illegal_value",
    "satellites_lost",
    "epochs_incomplete",
    "messages_too_late",
    "rinex_bad_epochs",
    "rinex_bad_lines",
    "output_damaged",
    "epochs_not_reported",
];

impl ReplayResult {
    /// Whether input was lost that cost an epoch or a part of one, or there was no epoch at all.
    pub fn lost_epochs(&self) -> bool {
        self.reports.is_empty() || COSTLY.iter().any(|name| self.losses.contains_key(*name))
    }
}

/// The position a recording states for itself as the truth, or why it is none: a header holds one point,
/// right or wrong, of a moving antenna too.
///
/// Epochs with an alert or with a fault put on them are not judged: what moves there is not the antenna.
fn own_position(
    (r_e_m, source): &([f64; 3], String),
    has_samples: bool,
    reports: &[EpochReport],
    faults: &[FaultSpec],
) -> Result<Truth, String> {
    if has_samples {
        return Err(format!(
            "{source} is not taken as the truth, as an antenna with an inertial unit is not fixed"
        ));
    }
    let truth = Truth::fixed(*r_e_m, source.clone());
    let is_judged = |report: &&EpochReport| {
        let t_s = output::t_s(report);
        let is_faulty = faults.iter().any(|f| (f.t0_s..=f.t1_s).contains(&t_s));
        report.verdict.integrity != Integrity::Alert && !is_faulty
    };
    let judged = reports
        .iter()
        .filter(is_judged)
        .filter_map(|report| Truth::error_enu_m(*r_e_m, report.fix?.r_e_m))
        .map(|[e, n, _]| e.hypot(n));
    stands_at(truth, judged)
}

/// A fixed point as the truth, or why it is none: too many positions lie too far from it, given their horizontal
/// distances, m.
///
/// # Errors
/// Why, in words.
pub fn stands_at(truth: Truth, distances_m: impl Iterator<Item = f64>) -> Result<Truth, String> {
    let (mut far, mut all) = (0, 0);
    for distance_m in distances_m {
        all += 1;
        far += usize::from(distance_m > FIXED_WITHIN_M);
    }
    if 4 * far > all {
        return Err(format!(
            "{} is not taken as the truth, as {far} of {all} positions lie more than {FIXED_WITHIN_M} m from it",
            truth.source
        ));
    }
    Ok(truth)
}

/// Replays a recording in memory; `progress` sees the reports so far, as they come, and hears how many
/// epochs there are in all.
///
/// # Errors
/// When an input is unusable, or the emulator cannot be run; the message tells what to do.
pub fn run(
    options: &ReplayOptions,
    progress: &mut dyn FnMut(&[EpochReport], u64),
) -> Result<ReplayResult> {
    if let Err(error) = options.config.check() {
        bail!("the configuration is not legal: {error:?}");
    }
    let imu = (!options.imu.is_empty())
        .then(|| imu::read_all(&options.imu, options.imu_settings.as_ref()))
        .transpose()?;
    let stream = source::stream_with(
        &options.gnss,
        &options.nav,
        &options.config,
        &options.faults,
        options.seed,
        imu.as_ref(),
        &options.fixes,
    )?;
    let pressures = options.barometer.as_deref().map(aiding::read).transpose()?;
    let bytes = if options.aids == AidsConfig::NONE && pressures.is_none() {
        stream.bytes
    } else {
        let pressures = pressures.unwrap_or_default();
        aiding::with_aids(&stream.bytes, &options.config, &options.aids, &pressures)?
    };
    let mut info = stream.info;
    if let Some(imu) = &imu {
        info.imu_samples = (imu.samples.len() + imu.unit_samples.len()) as u64;
        if imu.bad_lines > 0 {
            info.losses.insert("imu_bad_lines".into(), imu.bad_lines);
        }
    }
    let mut reader = OutputReader::default();
    let mut executor: Box<dyn Executor> = match options.machine {
        Machine::Host => Box::new(HostExecutor),
        Machine::Qemu => Box::new(QemuExecutor::build()?),
    };
    executor.run(&bytes, &mut |piece| {
        reader.push(piece);
        progress(&reader.reports, info.epochs);
    })?;

    let mut losses = info.losses.clone();
    let counters = reader.counters.unwrap_or(Counters::ZERO);
    for (cause, count) in source::losses(&counters) {
        // The file was decoded without the padding; only the monitor knows what became of samples.
        if stream.is_padded && !cause.starts_with("imu_") {
            continue;
        }
        let slot = losses.entry(cause).or_default();
        *slot = count.max(*slot);
    }
    let unread = reader.damaged + reader.pending.len() as u64;
    let missing = info.epochs.saturating_sub(reader.reports.len() as u64);
    for (cause, count) in [("output_damaged", unread), ("epochs_not_reported", missing)] {
        if count > 0 {
            losses.insert(cause.into(), count);
        }
    }

    let own = match (&options.truth, &info.station) {
        (TruthChoice::FromRecording, Some(station)) => {
            let has_samples = counters.imu_samples > 0;
            Some(own_position(
                station,
                has_samples,
                &reader.reports,
                &options.faults,
            ))
        }
        _ => None,
    };
    let (truth, truth_unused) = match (&options.truth, own) {
        (TruthChoice::Given(truth), _) => (Some(truth.clone()), None),
        (TruthChoice::FromRecording, Some(Ok(truth))) => (Some(truth), None),
        (TruthChoice::FromRecording, Some(Err(why))) => (None, Some(why)),
        (TruthChoice::FromRecording, None) => (None, None),
    };
    let errors_enu_m = output::errors_enu_m(&reader.reports, truth.as_ref());
    let summary = output::summarize(
        &reader.reports,
        &reader.banks,
        &errors_enu_m,
        truth.as_ref(),
    );
    Ok(ReplayResult {
        reports: reader.reports,
        banks: reader.banks,
        satellites: reader.satellites,
        inertial: reader.inertial,
        sentences: reader.sentences,
        errors_enu_m,
        summary,
        info,
        counters,
        losses,
        truth_unused,
    })
}

/// `summary.json`: the summary, and what belongs to the input.
#[derive(Serialize)]
struct SummaryFile<'a> {
    surefix: &'static str,
    input: InputSummary<'a>,
    config: ConfigSummary,
    #[serde(flatten)]
    summary: &'a Summary,
    #[serde(skip_serializing_if = "Option::is_none")]
    truth_unused: Option<&'a str>,
    bad_frames: &'a BTreeMap<String, u64>,
    skipped: &'a BTreeMap<String, u64>,
    counters: BTreeMap<&'static str, u32>,
}

#[derive(Serialize)]
struct InputSummary<'a> {
    gnss: String,
    nav: Vec<String>,
    format: &'a str,
    imu: Vec<String>,
    imu_samples: u64,
    faults: Vec<String>,
    seed: u64,
}

#[derive(Serialize)]
struct ConfigSummary {
    systems: String,
    mask_deg: f64,
    phase: &'static str,
    ionosphere: String,
    troposphere: String,
    noise: String,
    reference_week: Option<u16>,
    max_exclusions: u8,
}

/// Makes the directory to write to, unless it is there.
///
/// # Errors
/// When it cannot be made.
pub fn make_directory(directory: &Path) -> Result<()> {
    std::fs::create_dir_all(directory).with_context(|| {
        format!(
            "cannot make the directory {}: give another --out",
            directory.display()
        )
    })
}

/// Everything [`write`] may write.
const FILES: [&str; 9] = [
    "epochs.csv",
    "satellites.csv",
    "inertial.csv",
    "sentences.nmea",
    "errors.csv",
    "summary.json",
    "track.kml",
    "track.gpx",
    "report.html",
];

/// Writes `epochs.csv`, `satellites.csv`, `inertial.csv` (with a unit), `sentences.nmea`, `errors.csv` (with a truth), `summary.json`, `track.kml`, `track.gpx`
/// and `report.html` into `directory`, in place of those of an earlier replay.
///
/// # Errors
/// When the directory or a file cannot be written.
pub fn write(options: &ReplayOptions, result: &ReplayResult, directory: &Path) -> Result<()> {
    make_directory(directory)?;
    // All first, so that files of two replays never stand side by side, whatever fails below.
    for path in FILES.map(|name| directory.join(name)) {
        if path.exists() {
            std::fs::remove_file(&path)
                .with_context(|| format!("cannot remove {}", path.display()))?;
        }
    }
    let put = |name: &str, text: &str| {
        let path = directory.join(name);
        std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))
    };
    let create = |name: &str, write: &dyn Fn(&mut BufWriter<File>) -> std::io::Result<()>| {
        let path = directory.join(name);
        File::create(&path)
            .map(BufWriter::new)
            .and_then(|mut file| write(&mut file).and_then(|()| file.flush()))
            .with_context(|| format!("cannot write {}", path.display()))
    };
    let reports = &result.reports;
    let name = options
        .gnss
        .file_name()
        .map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    create("epochs.csv", &|file| {
        output::write_epochs(file, reports, &result.banks)
    })?;
    create("satellites.csv", &|file| {
        output::write_satellites(file, reports, &result.satellites)
    })?;
    if result.inertial.iter().any(Option::is_some) {
        create("inertial.csv", &|file| {
            output::write_inertial(file, reports, &result.inertial)
        })?;
    }
    create("track.kml", &|file| output::write_kml(file, &name, reports))?;
    create("track.gpx", &|file| output::write_gpx(file, &name, reports))?;
    put("sentences.nmea", &result.sentences)?;
    if result.summary.truth.is_some() {
        put(
            "errors.csv",
            &output::errors_csv(&result.reports, &result.errors_enu_m),
        )?;
    }
    let names = |paths: &[PathBuf]| -> Vec<String> {
        paths
            .iter()
            .map(|path| path.display().to_string())
            .collect()
    };
    let config = &options.config;
    let systems = surefix_core::gnss::System::ALL
        .iter()
        .filter(|system| config.systems.contains(**system))
        .map(|system| system.letter())
        .collect();
    let file = SummaryFile {
        surefix: env!("CARGO_PKG_VERSION"),
        input: InputSummary {
            gnss: options.gnss.display().to_string(),
            nav: names(&options.nav),
            format: &result.info.format,
            imu: names(&options.imu),
            imu_samples: result.info.imu_samples,
            faults: options.faults.iter().map(|f| f.to_string()).collect(),
            seed: options.seed,
        },
        config: ConfigSummary {
            systems,
            mask_deg: config.mask_rad.to_degrees(),
            phase: config.phase.name(),
            ionosphere: format!("{:?}", config.ionosphere),
            troposphere: format!("{:?}", config.troposphere),
            noise: format!("{:?}", config.noise),
            reference_week: config.reference_week,
            max_exclusions: config.max_exclusions,
        },
        summary: &result.summary,
        truth_unused: result.truth_unused.as_deref(),
        bad_frames: &result.losses,
        skipped: &result.info.skipped,
        counters: result.counters.rows().collect(),
    };
    put(
        "summary.json",
        &(serde_json::to_string_pretty(&file)? + "\n"),
    )?;
    crate::report::write(directory)?;
    Ok(())
}
