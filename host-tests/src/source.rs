//! An input file becomes what a monitor takes: bytes, with the ephemerides in their causal places.
//!
//! | input | becomes |
//! |---|---|
//! | RTCM 3, nothing added | the bytes as recorded |
//! | RTCM 3 with faults or navigation files | decoded by core's own `Ingest`, sent again as native frames |
//! | RINEX observations | native frames: exact numbers, one group of frames per epoch |
//! | native frames | the bytes as they are |
//! | RTKLIB positions | native frames of fixes |
//! | any of these with a recorded inertial unit | the same, with its samples between, in the order of their times |
//!
//! An ephemeris of a navigation file goes before the first epoch that is not earlier than its
//! transmission; those transmitted before the first epoch go up front, as in a receiver that had
//! been running. What a file is, its content says.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use surefix_core::config::Config;
use surefix_core::gnss::klobuchar::KlobucharParameters;
use surefix_core::gnss::{CorrectedEpoch, Ephemeris, ObservationEpoch};
use surefix_core::ingest::{
    Event, Ingest, MAX_EPOCH_BYTES, encode_aids, encode_configuration, encode_corrected_epoch,
    encode_end_of_stream, encode_ephemeris, encode_imu, encode_inertial, encode_initial_state,
    encode_klobuchar, encode_magnetic_field, encode_magnetometer, encode_observations,
    encode_pressure, encode_receiver_latency, encode_reference_model, encode_unit,
    encode_unit_sample,
};
use surefix_core::ins::{
    AidsConfig, ImuSample, InertialConfig, InitialState, MagneticSample, Magnetometer,
    PressureSample, ReferenceModel, UnitConfig, UnitSample,
};
use surefix_core::time::{GpsTime, NS_PER_S, NS_PER_WEEK};
use surefix_core::wire::counters::Counters;
use surefix_core::wire::crc::crc24q;
use surefix_core::wire::{native, scanner, ubx};

use crate::faults::{FaultCoverage, FaultInjector, FaultSpec};
use crate::fixes::{self, FixOptions};
use crate::imu::{self, Measured, Pending, Recorded};
use crate::rinex::{
    self, Content, NavigationFile, ObservationCounts, ObservationReader, TimedEphemeris,
};

/// What arrives, in the order of arrival.
#[derive(Clone, Debug)]
pub enum Item {
    /// A broadcast ephemeris.
    Ephemeris(Box<Ephemeris>),
    /// Ionosphere parameters.
    Klobuchar(KlobucharParameters),
    /// An observation epoch.
    Epoch(Box<ObservationEpoch>),
    /// What only a filter takes.
    ForFilter(FilterInput),
}

/// What a filter takes besides what a receiver sends.
#[derive(Clone, Debug)]
pub enum FilterInput {
    /// What is known of an inertial unit.
    Unit(Box<InertialConfig>),
    /// An inertial sample.
    Sample(ImuSample),
    /// What is known of the unit of a number, of those that vote.
    VotingUnit(u8, Box<UnitConfig>),
    /// A sample of the unit of a number.
    UnitSample(u8, UnitSample),
    /// The aids there are.
    Aids(AidsConfig),
    /// A sample of a barometer.
    Pressure(PressureSample),
    /// A sample of a magnetometer.
    MagneticField(MagneticSample),
    /// How long after its instant an epoch arrives at the least, ns.
    Latency(u32),
    /// What is known of a magnetometer.
    Magnetometer(Box<Magnetometer>),
    /// A state to start from.
    State(Box<InitialState>),
    /// The requirements of a scenario.
    Model(Box<ReferenceModel>),
    /// An epoch of corrected measurements.
    Corrected(Box<CorrectedEpoch>),
}

/// What a recording was, besides its items.
#[derive(Clone, Debug, Default)]
pub struct RecordingInfo {
    /// Its format, in words.
    pub format: String,
    /// Where the antenna was according to the file, ECEF, m, and which part of the file says so.
    pub station: Option<([f64; 3], String)>,
    /// Epochs.
    pub epochs: u64,
    /// Epochs of these that are the receiver's own solutions.
    pub fixes: u64,
    /// Samples of a unit that were put between.
    pub imu_samples: u64,
    /// Losses that cost epochs or parts of them, by cause.
    pub losses: BTreeMap<String, u64>,
    /// What was passed over because surefix does not use it.
    pub skipped: BTreeMap<String, u64>,
}

/// A recording held in memory, decoded once.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    /// What arrived.
    pub items: Vec<Item>,
    /// What it was.
    pub info: RecordingInfo,
}

/// The bytes to send to a monitor.
#[derive(Clone, Debug)]
pub struct Stream {
    /// From a Configuration frame to an EndOfStream frame.
    pub bytes: Vec<u8>,
    /// What they were made from.
    pub info: RecordingInfo,
    /// Zeros stand between the recording and the end frame, which the monitor counts as noise.
    pub is_padded: bool,
}

/// What content was recognised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Rinex,
    Rtcm3,
    Ubx,
    Native,
}

/// More than the longest frame of any kind.
const FILLER_BYTES: usize = 2 * scanner::MAX_FRAME;

/// How far into a file frames are looked for.
const SEARCHED_BYTES: usize = 1 << 20;

fn has_rtcm3_frame(bytes: &[u8]) -> bool {
    let searched = &bytes[..bytes.len().min(SEARCHED_BYTES)];
    searched.iter().enumerate().any(|(k, byte)| {
        *byte == 0xd3
            && bytes.get(k..k + 3).is_some_and(|head| {
                let length = usize::from(head[1] & 0x03) << 8 | usize::from(head[2]);
                head[1] & 0xfc == 0
                    && bytes.get(k..k + 6 + length).is_some_and(|frame| {
                        let (content, crc) = frame.split_at(3 + length);
                        let sent = crc.iter().fold(0, |sum, b| sum << 8 | u32::from(*b));
                        crc24q(content) == sent
                    })
            })
    })
}

fn has_native_frame(bytes: &[u8]) -> bool {
    let searched = &bytes[..bytes.len().min(SEARCHED_BYTES)];
    searched
        .windows(2)
        .enumerate()
        .any(|(k, pair)| pair == b"SF" && native::Frame::parse(&bytes[k..]).is_ok())
}

/// Whether there are observations or navigation messages of a u-blox receiver.
fn has_ubx_frame(bytes: &[u8]) -> bool {
    find_ubx(bytes, |message| {
        message == ubx::RXM_RAWX || message == ubx::RXM_SFRBX
    })
}

/// Whether there is a UBX frame of a wanted message.
fn find_ubx(bytes: &[u8], is_wanted: impl Fn([u8; 2]) -> bool) -> bool {
    let searched = &bytes[..bytes.len().min(SEARCHED_BYTES)];
    searched.windows(2).enumerate().any(|(k, pair)| {
        pair == ubx::PREAMBLE
            && ubx::Frame::parse(&bytes[k..]).is_ok_and(|(frame, _)| is_wanted(frame.message))
    })
}

fn recognise(bytes: &[u8], path: &Path) -> Result<Format> {
    let name = path.display();
    if bytes.is_empty() {
        bail!("{name} is empty: give a recording");
    }
    if rinex::looks_like_rinex(bytes) {
        return Ok(Format::Rinex);
    }
    // RAWX first: a u-blox receiver may pass on RTCM 3 of a reference station.
    if has_ubx_frame(bytes) {
        return Ok(Format::Ubx);
    }
    if has_rtcm3_frame(bytes) {
        return Ok(Format::Rtcm3);
    }
    if has_native_frame(bytes) {
        return Ok(Format::Native);
    }
    if find_ubx(bytes, |_| true) {
        return Ok(Format::Ubx);
    }
    let next = "give u-blox UBX, RTCM 3, or RINEX 3 or 4 observations (plain, .gz or .crx)";
    if bytes.starts_with(&[0x1f, 0x9d]) {
        bail!("{name} is compressed with Unix compress (.Z): expand it with `uncompress` first");
    }
    if bytes.starts_with(b"PK\x03\x04") {
        bail!("{name} is a ZIP archive: unpack it first");
    }
    let head = &bytes[..bytes.len().min(1000)];
    if head
        .windows(3)
        .any(|w| w.starts_with(b"$G") && w[2].is_ascii_uppercase())
    {
        bail!("{name} looks like NMEA, which holds positions but no observations: {next}");
    }
    let start: String = String::from_utf8_lossy(&bytes[..bytes.len().min(40)])
        .chars()
        .map(|c| if c.is_control() { '.' } else { c })
        .collect();
    bail!("{name} is no recording surefix knows; it starts with \"{start}\": {next}");
}

/// Navigation files, merged and in order of transmission.
#[derive(Clone, Debug, Default)]
struct Navigation {
    ephemerides: Vec<TimedEphemeris>,
    klobuchar: Vec<(Option<GpsTime>, KlobucharParameters)>,
    next_ephemeris: usize,
    next_klobuchar: usize,
}

impl Navigation {
    fn read(paths: &[PathBuf], info: &mut RecordingInfo) -> Result<Self> {
        let mut all = Self::default();
        for path in paths {
            let name = path.display();
            let bytes = rinex::read_argument("--nav", "a RINEX navigation file", path)?;
            if !rinex::looks_like_rinex(&bytes) {
                bail!("{name} is no RINEX file: --nav takes RINEX 3 or 4 navigation files");
            }
            let (text, content) = rinex::text_of(bytes).with_context(|| format!("{name}"))?;
            if content != Content::Navigation {
                bail!(
                    "{name} is a RINEX observation file: give it as --gnss, and the navigation file as --nav"
                );
            }
            let file = NavigationFile::parse(&text).with_context(|| format!("{name}"))?;
            if file.bad_records > 0 {
                *info.losses.entry("nav_bad_records".into()).or_default() += file.bad_records;
            }
            for (record, count) in file.other_records {
                *info.skipped.entry(format!("nav {record}")).or_default() += count;
            }
            all.ephemerides.extend(file.ephemerides);
            all.klobuchar.extend(file.klobuchar);
        }
        all.ephemerides.sort_by_key(|e| e.transmitted);
        all.klobuchar.sort_by_key(|k| k.0);
        Ok(all)
    }

    /// Hands over what was transmitted up to `time` and not handed over before.
    fn release_until(&mut self, time: GpsTime, take: &mut dyn FnMut(Item)) {
        while let Some((at, parameters)) = self.klobuchar.get(self.next_klobuchar)
            && at.is_none_or(|at| at <= time)
        {
            take(Item::Klobuchar(*parameters));
            self.next_klobuchar += 1;
        }
        while let Some(timed) = self.ephemerides.get(self.next_ephemeris)
            && timed.transmitted <= time
        {
            take(Item::Ephemeris(Box::new(timed.ephemeris)));
            self.next_ephemeris += 1;
        }
    }
}

/// Decodes a recording item by item.
///
/// # Errors
/// When a file cannot be read or is not what its place asks for; the message tells what to do.
pub fn decode(
    gnss: &Path,
    nav: &[PathBuf],
    config: &Config,
    take: &mut dyn FnMut(Item),
) -> Result<RecordingInfo> {
    let bytes = fixes::read(gnss, config, &FixOptions::default())?;
    decode_bytes(bytes, gnss, nav, config, take)
}

fn decode_bytes(
    bytes: Vec<u8>,
    gnss: &Path,
    nav: &[PathBuf],
    config: &Config,
    take: &mut dyn FnMut(Item),
) -> Result<RecordingInfo> {
    let format = recognise(&bytes, gnss)?;
    let mut info = RecordingInfo::default();
    let mut navigation = Navigation::read(nav, &mut info)?;
    match format {
        Format::Rinex => decode_rinex(bytes, gnss, &mut navigation, &mut info, take)?,
        Format::Rtcm3 | Format::Ubx | Format::Native => {
            decode_frames(&bytes, config, &mut navigation, &mut info, take);
            info.format = frames_format(format).into();
            if format == Format::Ubx {
                // A station in the stream of a u-blox receiver is the one that sends it corrections.
                info.station = None;
            }
        }
    }
    Ok(info)
}

fn frames_format(format: Format) -> &'static str {
    match format {
        Format::Rtcm3 => "RTCM 3",
        Format::Ubx => "u-blox UBX",
        Format::Native => "surefix native frames",
        Format::Rinex => "RINEX",
    }
}

fn decode_rinex(
    bytes: Vec<u8>,
    path: &Path,
    navigation: &mut Navigation,
    info: &mut RecordingInfo,
    take: &mut dyn FnMut(Item),
) -> Result<()> {
    let name = path.display();
    let (text, content) = rinex::text_of(bytes).with_context(|| format!("{name}"))?;
    if content == Content::Navigation {
        bail!(
            "{name} is a RINEX navigation file: give it as --nav, and the observation file as --gnss"
        );
    }
    if navigation.ephemerides.is_empty() {
        bail!(
            "{name} is a RINEX observation file and holds no ephemerides: give a navigation file of the same time with --nav"
        );
    }
    let mut reader = ObservationReader::new(&text).with_context(|| format!("{name}"))?;
    let header = reader.header();
    info.format = format!("RINEX {}", header.version);
    info.station = header
        .approximate_position_m
        .map(|r_e_m| (r_e_m, "RINEX header APPROX POSITION XYZ".into()));
    let mut epoch = ObservationEpoch::EMPTY;
    while reader.next_epoch(&mut epoch) {
        navigation.release_until(epoch.time, take);
        take(Item::Epoch(Box::new(epoch.clone())));
    }
    let ObservationCounts {
        epochs,
        other_systems,
        events,
        bad_epochs,
        bad_lines,
        bad_fields,
        no_room,
    } = reader.counts().clone();
    if epochs == 0 {
        bail!("{name} holds no epoch that can be read: give another recording");
    }
    info.epochs = epochs;
    for (cause, count) in [
        ("rinex_bad_epochs", bad_epochs),
        ("rinex_bad_lines", bad_lines),
        ("rinex_bad_fields", bad_fields),
    ] {
        if count > 0 {
            info.losses.insert(cause.into(), count);
        }
    }
    for (what, count) in [("signals beyond six", no_room), ("events", events)] {
        if count > 0 {
            info.skipped.insert(format!("obs {what}"), count);
        }
    }
    for (letter, count) in other_systems {
        info.skipped.insert(format!("obs {letter}"), count);
    }
    Ok(())
}

/// Decodes frames with core's own decoder, so that nothing is read twice in two ways.
fn decode_frames(
    bytes: &[u8],
    config: &Config,
    navigation: &mut Navigation,
    info: &mut RecordingInfo,
    take: &mut dyn FnMut(Item),
) {
    let mut ingest = Box::new(Ingest::EMPTY);
    ingest.configure(config);
    let mut items = Vec::new();
    let mut rest = bytes;
    let mut ended = false;
    while !ended {
        let event = if rest.is_empty() {
            ingest.finish()
        } else {
            let (used, event) = ingest.push(rest);
            rest = rest.get(used..).unwrap_or_default();
            event
        };
        match event {
            Event::Nothing => {}
            Event::Configuration(sent) => {
                // As in a monitor: only before the first epoch.
                if ingest.counters().epochs == 0 {
                    ingest.configure(&sent);
                }
            }
            Event::EndOfStream => ended = rest.is_empty(),
            Event::Ephemeris(ephemeris) => items.push(Item::Ephemeris(Box::new(ephemeris))),
            Event::Klobuchar(parameters) => items.push(Item::Klobuchar(parameters)),
            Event::StationPosition(r_e_m) => {
                info.station = Some((r_e_m, "RTCM 1005/1006 station position".into()));
            }
            Event::WeekResolved { shift_weeks } => {
                for item in &mut items {
                    shift(
                        item,
                        i64::from(shift_weeks) * NS_PER_WEEK,
                        ingest.epoch().time,
                    );
                }
            }
            // Counted; no one but a monitor takes it.
            Event::ReceiverFix(_) => {}
            Event::EpochReady => items.push(Item::Epoch(Box::new(ingest.epoch().clone()))),
            Event::Inertial(unit) => {
                items.push(Item::ForFilter(FilterInput::Unit(Box::new(unit))));
            }
            Event::ReceiverLatency(latency_ns) => {
                items.push(Item::ForFilter(FilterInput::Latency(latency_ns)));
            }
            Event::Imu(sample) => items.push(Item::ForFilter(FilterInput::Sample(sample))),
            Event::Unit { unit, config } => {
                items.push(Item::ForFilter(FilterInput::VotingUnit(
                    unit,
                    Box::new(config),
                )));
            }
            Event::UnitSample { unit, sample } => {
                items.push(Item::ForFilter(FilterInput::UnitSample(unit, sample)));
            }
            Event::Aids(aids) => items.push(Item::ForFilter(FilterInput::Aids(aids))),
            Event::Pressure(sample) => items.push(Item::ForFilter(FilterInput::Pressure(sample))),
            Event::MagneticField(sample) => {
                items.push(Item::ForFilter(FilterInput::MagneticField(sample)));
            }
            Event::InitialState(state) => {
                items.push(Item::ForFilter(FilterInput::State(Box::new(state))));
            }
            Event::Magnetometer(known) => {
                items.push(Item::ForFilter(FilterInput::Magnetometer(Box::new(known))));
            }
            Event::ReferenceModel(model) => {
                items.push(Item::ForFilter(FilterInput::Model(Box::new(model))));
            }
            Event::CorrectedEpochReady => {
                let epoch = Box::new(ingest.corrected_epoch().clone());
                items.push(Item::ForFilter(FilterInput::Corrected(epoch)));
            }
        }
    }
    let counters = *ingest.counters();
    info.fixes = u64::from(counters.fixes_used);
    info.epochs = u64::from(counters.epochs) + info.fixes;
    info.losses.extend(losses(&counters));
    for item in items {
        if let Item::Epoch(epoch) = &item {
            navigation.release_until(epoch.time, take);
        }
        take(item);
    }
}

/// Moves everything an item says of time, `present` being right already.
fn shift(item: &mut Item, ns: i64, present: GpsTime) {
    match item {
        Item::Ephemeris(ephemeris) => {
            ephemeris.toe = ephemeris.toe.plus_ns(ns);
            ephemeris.toc = ephemeris.toc.plus_ns(ns);
        }
        Item::Epoch(epoch) => epoch.time = epoch.time.plus_ns(ns),
        Item::ForFilter(input) => {
            let time = match input {
                FilterInput::Sample(sample) => &mut sample.time,
                FilterInput::UnitSample(_, sample) => &mut sample.sample.time,
                FilterInput::Pressure(sample) => &mut sample.time,
                FilterInput::MagneticField(sample) => &mut sample.time,
                // What has no time, or one that no receiver gave.
                FilterInput::Unit(_)
                | FilterInput::Aids(_)
                | FilterInput::Latency(_)
                | FilterInput::Magnetometer(_)
                | FilterInput::VotingUnit(..)
                | FilterInput::State(_)
                | FilterInput::Model(_)
                | FilterInput::Corrected(_) => return,
            };
            // One from before the first epoch has the week its sender gave it.
            let apart = |time: GpsTime| time.ns().abs_diff(present.ns());
            let moved = time.plus_ns(ns);
            if apart(moved) < apart(*time) {
                *time = moved;
            }
        }
        Item::Klobuchar(_) => {}
    }
}

/// Counters of what was used or is of no concern to surefix; every other one that is not zero
/// means that input was lost.
const NO_LOSS: [&str; 28] = [
    "rtcm_frames",
    "native_frames",
    "ubx_frames",
    "nmea_lines",
    "rtcm_unsupported",
    "rtcm_unknown",
    "ubx_unsupported",
    "rawx_without_week",
    "rawx_used",
    "subframes_unsupported",
    "subframes_used",
    "observations_of_other_systems",
    "observations_of_another_source",
    "msm_used",
    "msm_skipped",
    "ephemerides",
    "imu_samples",
    "imu_used",
    "imu_stretched",
    "unknown_satellites",
    "unknown_signals",
    "invalid_pseudoranges",
    "signals_lost",
    "fixes_used",
    "fixes_held_back",
    "fixes_beside_observations",
    "fixes_without_date",
    "epochs",
];

/// The counters that mean lost input, by name.
pub fn losses(counters: &Counters) -> BTreeMap<String, u64> {
    counters
        .rows()
        .filter(|(name, count)| *count > 0 && !NO_LOSS.contains(name))
        .map(|(name, count)| (name.to_owned(), u64::from(count)))
        .collect()
}

impl Recording {
    /// Decodes a recording and holds all of it.
    ///
    /// # Errors
    /// As [`decode`].
    pub fn read(gnss: &Path, nav: &[PathBuf], config: &Config) -> Result<Self> {
        let mut items = Vec::new();
        let info = decode(gnss, nav, config, &mut |item| items.push(item))?;
        Ok(Self { items, info })
    }
}

/// Writes items as native frames, with faults on the epochs.
struct FrameWriter {
    bytes: Vec<u8>,
    faults: FaultInjector,
    coverage: FaultCoverage,
    first: Option<GpsTime>,
    buffer: Vec<u8>,
}

impl FrameWriter {
    fn new(config: &Config, faults: &[FaultSpec], seed: u64) -> Result<Self> {
        let mut writer = Self {
            bytes: Vec::new(),
            faults: FaultInjector::new(faults, seed),
            coverage: FaultCoverage::new(faults),
            first: None,
            buffer: vec![0; MAX_EPOCH_BYTES.max(native::MAX_FRAME)],
        };
        writer.append(|out| encode_configuration(config, out));
        Ok(writer)
    }

    fn append(&mut self, encode: impl FnOnce(&mut [u8]) -> Result<usize, native::Full>) {
        // The buffer holds the largest epoch, so nothing is ever too long for it.
        if let Ok(length) = encode(&mut self.buffer) {
            self.bytes.extend_from_slice(&self.buffer[..length]);
        }
    }

    fn write(&mut self, item: Item) {
        match item {
            Item::Ephemeris(ephemeris) => self.append(|out| encode_ephemeris(&ephemeris, out)),
            Item::Klobuchar(parameters) => self.append(|out| encode_klobuchar(&parameters, out)),
            Item::ForFilter(input) => self.append(|out| match input {
                FilterInput::Unit(unit) => encode_inertial(&unit, out),
                FilterInput::Sample(sample) => encode_imu(&sample, out),
                FilterInput::VotingUnit(unit, config) => encode_unit(unit, &config, out),
                FilterInput::UnitSample(unit, sample) => encode_unit_sample(unit, &sample, out),
                FilterInput::Aids(aids) => encode_aids(&aids, out),
                FilterInput::Pressure(sample) => encode_pressure(&sample, out),
                FilterInput::MagneticField(sample) => encode_magnetic_field(&sample, out),
                FilterInput::Latency(latency_ns) => encode_receiver_latency(latency_ns, out),
                FilterInput::Magnetometer(known) => encode_magnetometer(&known, out),
                FilterInput::State(state) => encode_initial_state(&state, out),
                FilterInput::Model(model) => encode_reference_model(&model, out),
                FilterInput::Corrected(epoch) => encode_corrected_epoch(&epoch, out),
            }),
            Item::Epoch(mut epoch) => {
                let first = *self.first.get_or_insert(epoch.time);
                let since_ns = epoch.time.ns() - first.ns();
                let t_s = since_ns as f64 / NS_PER_S as f64;
                self.coverage.see(&epoch, t_s);
                self.faults.apply(&mut epoch, t_s);
                self.append(|out| encode_observations(&epoch, out));
            }
        }
    }

    fn finish(mut self) -> Vec<u8> {
        self.append(encode_end_of_stream);
        self.bytes
    }
}

fn two_units(gnss: &Path) -> anyhow::Error {
    anyhow!(
        "{} holds inertial samples itself: leave out --imu",
        gnss.display()
    )
}

/// Whether a stream has inertial samples of its own.
fn is_sample(item: &Item) -> bool {
    matches!(
        item,
        Item::ForFilter(FilterInput::Sample(_) | FilterInput::UnitSample(..))
    )
}

impl From<Measured> for FilterInput {
    fn from(measured: Measured) -> Self {
        match measured {
            Measured::Alone(sample) => Self::Sample(sample),
            Measured::OfUnit(unit, sample) => Self::UnitSample(unit, sample),
        }
    }
}

/// Makes the bytes to send to a monitor; `imu` is what a unit measured meanwhile.
///
/// # Errors
/// As [`decode`], when a fault touches no epoch, and when the unit's recording is of another time.
pub fn stream(
    gnss: &Path,
    nav: &[PathBuf],
    config: &Config,
    faults: &[FaultSpec],
    seed: u64,
    imu: Option<&Recorded>,
) -> Result<Stream> {
    stream_with(gnss, nav, config, faults, seed, imu, &FixOptions::default())
}

/// The same of a recording whose fixes are changed on the way.
///
/// # Errors
/// As [`stream`], and where there are no fixes to change.
pub fn stream_with(
    gnss: &Path,
    nav: &[PathBuf],
    config: &Config,
    faults: &[FaultSpec],
    seed: u64,
    imu: Option<&Recorded>,
    fixes: &FixOptions,
) -> Result<Stream> {
    let mut writer = FrameWriter::new(config, faults, seed)?;
    if let Some(imu) = imu {
        writer.append(|out| encode_inertial(&imu.unit, out));
        if imu.receiver_latency_ns > 0 {
            writer.append(|out| encode_receiver_latency(imu.receiver_latency_ns, out));
        }
        if let Some(magnetometer) = &imu.magnetometer {
            writer.append(|out| encode_magnetometer(magnetometer, out));
        }
        for (unit, config) in &imu.units {
            writer.append(|out| encode_unit(*unit, config, out));
        }
    }
    let latency_ns = imu.map_or(0, |imu| i64::from(imu.receiver_latency_ns));
    let measured = imu.map(Recorded::measured);
    let mut pending = measured.as_deref().map(Pending::new);
    let raw = fixes::read(gnss, config, fixes)?;
    let format = recognise(&raw, gnss)?;
    if format != Format::Rinex && nav.is_empty() && faults.is_empty() {
        // As recorded; decoded beside that for the station's position and the number of epochs.
        let mut has_samples = false;
        let info = decode_bytes(raw.clone(), gnss, nav, config, &mut |item| {
            has_samples |= is_sample(&item);
        })?;
        match pending {
            Some(_) if has_samples => return Err(two_units(gnss)),
            Some(pending) => {
                imu::interleave(&raw, config, pending, |_| latency_ns, &mut writer.bytes)?;
            }
            None => writer.bytes.extend_from_slice(&raw),
        }
        let is_padded = info.losses.contains_key("cut_off_frames");
        if is_padded {
            // What looks like the head of a frame at the end would take the end frame for its
            // content.
            writer.bytes.extend_from_slice(&[0; FILLER_BYTES]);
        }
        return Ok(Stream {
            bytes: writer.finish(),
            info,
            is_padded,
        });
    }
    let mut has_samples = false;
    let info = decode_bytes(raw, gnss, nav, config, &mut |item| {
        has_samples |= is_sample(&item);
        if let (Item::Epoch(epoch), Some(pending)) = (&item, &mut pending) {
            let flags = epoch.flags;
            pending.release_until(epoch.time, latency_ns, flags.week_unknown, &mut |sample| {
                writer.write(Item::ForFilter((*sample).into()));
            });
        }
        writer.write(item);
    })?;
    if info.fixes > 0 {
        bail!(
            "{} holds the receiver's own solutions and no observations: leave out --nav and --fault",
            gnss.display()
        );
    }
    if let Some(pending) = pending {
        if has_samples {
            return Err(two_units(gnss));
        }
        pending.finish(&mut |sample| {
            writer.write(Item::ForFilter((*sample).into()));
        })?;
    }
    writer.coverage.check()?;
    Ok(Stream {
        bytes: writer.finish(),
        info,
        is_padded: false,
    })
}
