//! Faults on recordings with an inertial unit: `surefix campaign recording-faults`.
//!
//! | recording | receiver | inertial unit | truth |
//! |---|---|---|---|
//! | `esbc` | fixed, 4 h, 30 s | at rest, synthesised, 50 Hz | the station's position |
//! | `walk` | carried, 134 s, 4 Hz, one frequency | recorded | RTK |
//! | `drive` | synthesised along the track, 549 s, 1 Hz | recorded | the track |
//! | `few` | the same with six satellites of three constellations from 70 s on | recorded | the track |
//!
//! Each is replayed as it is, and then as often as there are trials with faults one after the other, each on
//! another satellite that the clean replay uses all the time; with all constellations and without Galileo, as
//! 30 satellites do not fit the bank's 24 places and 20 do. A fault is judged from its beginning to its end, and
//! errors also after it until the next begins.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::Serialize;
use surefix_core::config::IonosphereModel;
use surefix_core::gnss::{Satellite, SatelliteSet};
use surefix_core::integrity::{Integrity, Phase, Reason};
use surefix_core::report::EpochReport;

use crate::faults::{FaultKind, FaultSpec};
use crate::hybrid::{self, Reduction};
use crate::output;
use crate::replay::{self, ReplayOptions, ReplayResult, TruthChoice};
use crate::report::Region;
use crate::settings::Settings;
use crate::simulate::inertial::sensors::Grade;
use crate::static_imu;
use crate::track::Track;
use crate::truth::Truth;

/// Replays with faults of each recording unless told otherwise.
pub const TRIALS: u64 = 4;
/// Height of the geoid on the walk, as the receiver told it, m: its track is above mean sea level.
const WALK_GEOID_M: f64 = -21.39;
/// The most satellites that the drive's track sees all the time.
const DRIVE_SATELLITES: usize = 22;

/// What a satellite is faulted with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    kind: FaultKind,
    /// Largest size during the fault, m.
    pub size_m: f64,
}

/// The faults, in turn: those that have to be found first, then a small one.
pub const SHAPES: [Shape; 6] = [
    Shape::new(FaultKind::Step, 30.0),
    Shape::new(FaultKind::Ramp, 60.0),
    Shape::new(FaultKind::Step, 100.0),
    Shape::new(FaultKind::Step, 50.0),
    Shape::new(FaultKind::Oscillation, 60.0),
    Shape::new(FaultKind::Step, 15.0),
];

impl Shape {
    const fn new(kind: FaultKind, size_m: f64) -> Self {
        Self { kind, size_m }
    }

    fn name(self) -> String {
        let kind = match self.kind {
            FaultKind::Step => "step",
            FaultKind::Ramp => "ramp to",
            FaultKind::Noise => "noise",
            FaultKind::Walk => "walk",
            FaultKind::Oscillation => "swing of",
        };
        format!("{kind} {} m", self.size_m)
    }

    fn fault(self, satellite: Satellite, t0_s: f64, length_s: f64) -> FaultSpec {
        FaultSpec {
            satellite,
            kind: self.kind,
            magnitude: match self.kind {
                FaultKind::Ramp => self.size_m / length_s,
                _ => self.size_m,
            },
            t0_s,
            t1_s: t0_s + length_s,
            on_range_rate: false,
            period_s: length_s,
        }
    }
}

/// A recording ready to be replayed.
#[derive(Clone, Debug)]
pub struct Subject {
    /// `esbc`, `walk`, `drive`, `few`.
    pub name: &'static str,
    /// With everything but the constellations and the faults.
    pub options: ReplayOptions,
    /// From the bank's first epoch to the first fault, s.
    pub settle_s: f64,
    /// Length of a fault, s.
    pub length_s: f64,
    /// From its end to the beginning of the next, s.
    pub pause_s: f64,
}

/// Where the recordings are, and a directory for what is synthesised.
#[derive(Clone, Copy, Debug)]
pub struct Folders<'a> {
    /// The folders of the recordings.
    pub data: &'a Path,
    /// The examples of unit settings.
    pub examples: &'a Path,
    /// To write to.
    pub work: &'a Path,
}

/// Four hours at Esbjerg with a tactical unit at rest.
///
/// # Errors
/// When the recording is absent or unusable.
pub fn esbc(folders: &Folders<'_>, seed: u64) -> Result<Subject> {
    at_esbjerg(folders, seed, "ESBC_2020177_0000-0400.rnx")
}

/// The whole day.
///
/// # Errors
/// When the recording is absent or unusable.
pub fn esbc_day(folders: &Folders<'_>, seed: u64) -> Result<Subject> {
    at_esbjerg(folders, seed, "ESBC00DNK_R_20201770000_01D_30S_MO.crx.gz")
}

fn at_esbjerg(folders: &Folders<'_>, seed: u64, file: &str) -> Result<Subject> {
    let data = folders.data.join("esbc-2020-177");
    let mut options = ReplayOptions::new(data.join(file));
    options.nav = vec![data.join("ESBC00DNK_R_20201770000_01D_MN.rnx.gz")];
    let (start, end, station) = static_imu::span(&options.gnss, &options.nav, &options.config)?;
    let r_e_m = station.context("the recording does not state its position")?;
    let request = static_imu::Request {
        r_e_m,
        attitude_deg: [0.0; 3],
        grade: Grade::Tactical,
        rate_hz: 50,
        seed,
    };
    let work = folders.work.join("esbc");
    static_imu::write(&request, start, end, &work)?;
    options.imu = vec![work.join("imu.sfx")];
    options.imu_settings = Settings::read(&work.join("UNIT.toml"))?.imu;
    options.truth = TruthChoice::Given(Truth::fixed(r_e_m, "RINEX header APPROX POSITION XYZ"));
    Ok(Subject {
        name: "esbc",
        options,
        settle_s: 900.0,
        length_s: 900.0,
        pause_s: 900.0,
    })
}

/// The walk, whose heights are put on the ellipsoid. One frequency, as the second takes its GPS
/// satellites away and makes reflections three times as large.
///
/// # Errors
/// When the recording is absent or unusable.
pub fn walk(folders: &Folders<'_>) -> Result<Subject> {
    let data = folders.data.join("walk0827-x20p-imu");
    let mut options = ReplayOptions::new(data.join("derived_convbin.obs"));
    options.nav = vec![data.join("derived_convbin.nav")];
    let settings = Settings::read(&folders.examples.join("walk-adis16465.toml"))?;
    options.config = settings.config()?;
    options.config.ionosphere = IonosphereModel::Klobuchar;
    options.imu = vec![data.join("derived_imu_gpst_unfiltered.csv")];
    options.imu_settings = settings.imu;
    let track = Track::read(&data.join("gnss_1730_sf.pos"), WALK_GEOID_M)?;
    let work = folders.work.join("walk");
    replay::make_directory(&work)?;
    let path = work.join("truth.csv");
    std::fs::write(
        &path,
        hybrid::truth_csv(&track, track.first(), track.duration_s())?,
    )
    .with_context(|| format!("cannot write {}", path.display()))?;
    options.truth = TruthChoice::Given(Truth::read(&path)?);
    Ok(Subject {
        name: "walk",
        options,
        settle_s: 20.0,
        length_s: 20.0,
        pause_s: 20.0,
    })
}

/// The drive with the receiver that its antenna would have had.
fn on_the_drive(
    folders: &Folders<'_>,
    name: &'static str,
    change: &dyn Fn(&mut hybrid::Args),
) -> Result<Subject> {
    let data = folders.data.join("drive0708-adis16465-rtk");
    let work = folders.work.join(name);
    let mut args = hybrid::Args {
        track: data.join("gnss_1934_sf.pos"),
        imu: data.join("derived_imu_gpst_unfiltered.csv"),
        config: folders.examples.join("car-adis16465.toml"),
        nav: folders
            .data
            .join("esbc-2020-177/ESBC00DNK_R_20201770000_01D_MN.rnx.gz"),
        satellites: DRIVE_SATELLITES,
        drop: Vec::new(),
        rate_hz: 1,
        duration: None,
        seed: 1,
        out: work.clone(),
    };
    change(&mut args);
    hybrid::write(&hybrid::synthesise(&args)?, &work)?;
    let mut options = ReplayOptions::new(work.join("receiver.rtcm3"));
    options.imu = vec![work.join("imu.sfx")];
    options.config.ionosphere = IonosphereModel::None;
    options.truth = TruthChoice::Given(Truth::read(&work.join("truth.csv"))?);
    Ok(Subject {
        name,
        options,
        settle_s: 30.0,
        length_s: 60.0,
        pause_s: 30.0,
    })
}

/// The drive under as many satellites as its track sees all the time.
///
/// # Errors
/// When the recording is absent or unusable.
pub fn drive(folders: &Folders<'_>, seed: u64) -> Result<Subject> {
    on_the_drive(folders, "drive", &|args| args.seed = seed)
}

/// The drive with twelve satellites, of which six of three constellations are left from 70 s on. One fault
/// in each replay: an alert outlasts it, as nobody can tell which satellite it was.
///
/// # Errors
/// When the recording is absent or unusable.
pub fn few(folders: &Folders<'_>, seed: u64) -> Result<Subject> {
    let subject = on_the_drive(folders, "few", &|args| {
        args.seed = seed;
        args.satellites = 12;
        args.drop = vec![Reduction {
            satellites: 6,
            from_s: 70.0,
            to_s: f64::INFINITY,
        }];
    })?;
    Ok(Subject {
        settle_s: 130.0,
        pause_s: f64::INFINITY,
        ..subject
    })
}

/// What became of a replay.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Run {
    /// Name of the recording.
    pub recording: String,
    /// Letters of the constellations.
    pub systems: String,
    /// 0 without faults.
    pub trial: u64,
    /// Epochs.
    pub epochs: usize,
    /// Epochs in which the bank ran.
    pub with_bank: usize,
    /// Epochs in which the bank had no place for a satellite.
    pub over_capacity: usize,
    /// Epochs that said that the position may be used.
    pub usable: usize,
    /// Epochs at alert, without those at which it was held.
    pub alerts: usize,
    /// Epochs with an excluded satellite that no fault was put on.
    pub wrong: usize,
    /// Usable epochs with an error above its level.
    pub above_level: usize,
    /// Largest error over level of a usable epoch, horizontal and vertical.
    pub largest_ratio: [f64; 2],
    /// Epochs in the parts of the diagram of Stanford: normal, unavailable, misleading, both,
    /// hazardously misleading; horizontal and vertical.
    pub stanford: [[usize; 5]; 2],
    /// The faults.
    pub faults: Vec<Found>,
}

/// What became of a fault.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Found {
    /// As `replay --fault` takes it.
    pub fault: String,
    /// What it is, in words.
    pub shape: String,
    /// Largest size, m.
    pub size_m: f64,
    /// The bank had a filter without the satellite when the fault began.
    pub in_bank: bool,
    /// From the beginning to the first alert or exclusion, s.
    pub detected_s: Option<f64>,
    /// How the opinions stood to each other then.
    pub opinions: Option<&'static str>,
    /// A test of the bank failed at some epoch of it.
    pub bank_detected: bool,
    /// From the beginning to the exclusion of the satellite, s.
    pub excluded_s: Option<f64>,
    /// Epochs at alert.
    pub alerts: usize,
    /// Epochs with a healthy satellite excluded.
    pub wrong: usize,
    /// Usable epochs with an error above its level, up to the next fault.
    pub above_level: usize,
    /// Largest horizontal and vertical error of a usable epoch, m.
    pub largest_error_m: [f64; 2],
}

/// Error and level over each other, horizontal and vertical, of an epoch with both.
fn ratios(report: &EpochReport, error: Option<[f64; 3]>) -> [Option<(f64, f64)>; 2] {
    let Some([e, n, u]) = error else {
        return [None; 2];
    };
    let verdict = &report.verdict;
    [
        verdict.hpl.bound_m().map(|level| (e.hypot(n), level)),
        verdict.vpl.bound_m().map(|level| (u.abs(), level)),
    ]
}

fn is_above(report: &EpochReport, error: Option<[f64; 3]>) -> bool {
    let above = |pair: &Option<(f64, f64)>| pair.is_some_and(|(error, level)| !(error <= level));
    report.verdict.integrity.is_usable() && ratios(report, error).iter().any(above)
}

/// An opinion sees a fault at this epoch; an alert that is held says nothing of it.
fn is_alerted(report: &EpochReport) -> bool {
    let verdict = &report.verdict;
    verdict.integrity == Integrity::Alert && verdict.reason != Reason::AlertHeld
}

/// One recording with some constellations.
struct Bench<'a> {
    subject: &'a Subject,
    systems: &'a str,
}

impl Bench<'_> {
    fn replay(&self, faults: &[FaultSpec]) -> Result<(ReplayOptions, ReplayResult)> {
        let mut options = self.subject.options.clone();
        let settings = Settings {
            systems: Some(self.systems.to_owned()),
            ..Settings::default()
        };
        options.config.systems = settings.config()?.systems;
        options.faults = faults.to_vec();
        let result = replay::run(&options, &mut |_, _| {})?;
        Ok((options, result))
    }

    /// Faults one after the other, each on a satellite that the clean replay uses throughout.
    fn faults(&self, clean: &ReplayResult, trial: u64, seed: u64) -> Vec<(Shape, FaultSpec)> {
        let mut random = ChaCha20Rng::seed_from_u64(seed);
        random.set_stream(trial << 8 | u64::from(self.subject.name.as_bytes()[0]));
        let Subject {
            settle_s,
            length_s,
            pause_s,
            ..
        } = *self.subject;
        let times: Vec<f64> = clean.reports.iter().map(output::t_s).collect();
        let first = clean.banks.iter().position(Option::is_some);
        let (Some(first), Some(last)) =
            (first, clean.reports.iter().rposition(|r| r.fix.is_some()))
        else {
            return Vec::new();
        };
        let mut faults: Vec<(Shape, FaultSpec)> = Vec::new();
        let mut t0_s = times[first] + settle_s;
        // Trials begin with different faults.
        let mut turn = trial as usize;
        while t0_s + length_s <= times[last] {
            let mut all_time = SatelliteSet::from_masks([u64::MAX; 3]);
            for (report, t_s) in clean.reports.iter().zip(&times) {
                if (t0_s..t0_s + length_s).contains(t_s) {
                    let (now, before) = (report.used.masks(), all_time.masks());
                    all_time = SatelliteSet::from_masks([0, 1, 2].map(|k| now[k] & before[k]));
                }
            }
            let free: Vec<Satellite> = all_time
                .iter()
                .filter(|satellite| faults.iter().all(|(_, f)| f.satellite != *satellite))
                .collect();
            if !free.is_empty() {
                let satellite = free[(random.next_u64() % free.len() as u64) as usize];
                let shape = SHAPES[turn % SHAPES.len()];
                faults.push((shape, shape.fault(satellite, t0_s, length_s)));
                turn += 1;
            }
            t0_s += length_s + pause_s;
        }
        faults
    }

    fn judge(&self, result: &ReplayResult, trial: u64, faults: &[(Shape, FaultSpec)]) -> Run {
        let mut run = Run {
            recording: self.subject.name.to_owned(),
            systems: self.systems.to_owned(),
            trial,
            epochs: result.reports.len(),
            with_bank: result.banks.iter().flatten().count(),
            over_capacity: result
                .banks
                .iter()
                .flatten()
                .filter(|bank| bank.n_unmonitored > 0)
                .count(),
            ..Run::default()
        };
        for (report, error) in result.reports.iter().zip(&result.errors_enu_m) {
            let verdict = &report.verdict;
            let t_s = output::t_s(report);
            run.usable += usize::from(verdict.integrity.is_usable());
            run.alerts += usize::from(is_alerted(report));
            run.wrong += usize::from(is_wrong(report, faults, t_s));
            run.above_level += usize::from(is_above(report, *error));
            let limits = [Some(verdict.hal_m), verdict.val_m];
            for (axis, pair) in ratios(report, *error).into_iter().enumerate() {
                let Some((error, level)) = pair else { continue };
                if verdict.integrity.is_usable() {
                    run.largest_ratio[axis] = run.largest_ratio[axis].max(error / level);
                }
                if verdict.integrity != Integrity::Alert {
                    run.stanford[axis][Region::of(error, level, limits[axis]) as usize] += 1;
                }
            }
        }
        run.faults = (0..faults.len())
            .map(|k| self.found(result, faults, k))
            .collect();
        run
    }

    fn found(&self, result: &ReplayResult, faults: &[(Shape, FaultSpec)], k: usize) -> Found {
        let (shape, fault) = &faults[k];
        let next_s = faults.get(k + 1).map_or(f64::INFINITY, |(_, f)| f.t0_s);
        let mut found = Found {
            fault: fault.to_string(),
            shape: shape.name(),
            size_m: shape.size_m,
            in_bank: false,
            detected_s: None,
            opinions: None,
            bank_detected: false,
            excluded_s: None,
            alerts: 0,
            wrong: 0,
            above_level: 0,
            largest_error_m: [0.0; 2],
        };
        let epochs = result.reports.iter().zip(&result.banks);
        for ((report, bank), error) in epochs.zip(&result.errors_enu_m) {
            let t_s = output::t_s(report);
            if t_s < fault.t0_s {
                let tests = bank.iter().flat_map(|bank| &bank.tests);
                found.in_bank = tests
                    .into_iter()
                    .any(|test| test.satellite == fault.satellite);
                continue;
            }
            if t_s >= next_s {
                break;
            }
            found.above_level += usize::from(is_above(report, *error));
            if report.verdict.integrity.is_usable() {
                for (largest, pair) in found.largest_error_m.iter_mut().zip(ratios(report, *error))
                {
                    *largest = largest.max(pair.map_or(0.0, |(error, _)| error));
                }
            }
            if t_s >= fault.t1_s {
                continue;
            }
            let verdict = &report.verdict;
            let is_out = verdict.excluded.contains(fault.satellite);
            let is_alert = is_alerted(report);
            if (is_out || is_alert) && found.detected_s.is_none() {
                found.detected_s = Some(t_s - fault.t0_s);
                let opinions = bank.as_deref().and_then(|bank| bank.opinions);
                found.opinions = opinions.map(|opinions| opinions.name());
            }
            if is_out {
                found.excluded_s.get_or_insert(t_s - fault.t0_s);
            }
            found.bank_detected |= bank.as_deref().is_some_and(|bank| bank.detected);
            found.alerts += usize::from(is_alert);
            found.wrong += usize::from(is_wrong(report, faults, t_s));
        }
        found
    }
}

/// Whether a satellite is out that had no fault so far: once out, it has to prove itself first.
fn is_wrong(report: &EpochReport, faults: &[(Shape, FaultSpec)], t_s: f64) -> bool {
    let was_faulty = |satellite| {
        faults
            .iter()
            .any(|(_, f)| f.satellite == satellite && f.t0_s <= t_s)
    };
    report.verdict.excluded.iter().any(|s| !was_faulty(s))
}

/// Replays a recording without faults and with them. `reports` is where to write what each replay gave.
///
/// # Errors
/// When it cannot be replayed or written.
pub fn study(
    subject: &Subject,
    systems: &str,
    trials: u64,
    seed: u64,
    reports: Option<&Path>,
) -> Result<Vec<Run>> {
    let bench = Bench { subject, systems };
    let write = |trial: u64, options: &ReplayOptions, result: &ReplayResult| {
        let Some(reports) = reports else {
            return Ok(());
        };
        let name = if trial == 0 {
            "clean".into()
        } else {
            format!("faults-{trial}")
        };
        let directory = reports.join(format!("{}-{systems}-{name}", subject.name));
        replay::write(options, result, &directory)
    };
    let (options, clean) = bench.replay(&[])?;
    write(0, &options, &clean)?;
    let mut runs = vec![bench.judge(&clean, 0, &[])];
    for trial in 1..=trials {
        let faults = bench.faults(&clean, trial, seed);
        if faults.is_empty() {
            break;
        }
        let specs: Vec<FaultSpec> = faults.iter().map(|(_, fault)| *fault).collect();
        let (options, result) = bench.replay(&specs)?;
        write(trial, &options, &result)?;
        runs.push(bench.judge(&result, trial, &faults));
    }
    Ok(runs)
}

/// Constellations to replay with. The walk has no BDS satellites, and of GPS four, which test nothing; the few
/// are of all three.
pub fn constellations(subject: &Subject) -> &'static [&'static str] {
    match subject.name {
        "walk" | "few" => &["GEC"],
        _ => &["GEC", "GC"],
    }
}

/// Two tables: the replays as they are, and the faults by recording and kind.
pub fn table(runs: &[Run]) -> String {
    let mut text = String::from(
        "recording  systems  faults  epochs  bank  over capacity  usable  alerts  wrongly out  above level  error/level h, v  normal h, v  unavailable  misleading  hazardous\n",
    );
    for run in runs {
        let [h, v] = run.stanford;
        let _ = writeln!(
            text,
            "{:>9}  {:>7}  {:>6}  {:>6}  {:>4}  {:>13}  {:>6}  {:>6}  {:>11}  {:>11}  {:>8.2} {:>7.2}  {:>5} {:>5}  {:>5} {:>5}  {:>4} {:>5}  {:>4} {:>4}",
            run.recording,
            run.systems,
            run.faults.len(),
            run.epochs,
            run.with_bank,
            run.over_capacity,
            run.usable,
            run.alerts,
            run.wrong,
            run.above_level,
            run.largest_ratio[0],
            run.largest_ratio[1],
            h[0],
            v[0],
            h[1],
            v[1],
            h[2] + h[3],
            v[2] + v[3],
            h[4],
            v[4]
        );
    }
    let mut cells: BTreeMap<(String, String, usize), Vec<&Found>> = BTreeMap::new();
    for run in runs {
        for found in &run.faults {
            let place = SHAPES.iter().position(|shape| shape.name() == found.shape);
            let key = (
                run.recording.clone(),
                run.systems.clone(),
                place.unwrap_or(SHAPES.len()),
            );
            cells.entry(key).or_default().push(found);
        }
    }
    text += "\nrecording  systems        fault  trials  in bank  found  by the bank  excluded  wrongly out  above level  median, largest s to find  largest error h, v m\n";
    for ((recording, systems, _), found) in &cells {
        let count = |is: fn(&Found) -> bool| found.iter().filter(|f| is(f)).count();
        let mut delays: Vec<f64> = found.iter().filter_map(|f| f.detected_s).collect();
        let seconds = |share, delays: &mut Vec<f64>| {
            output::quantile(delays, share).map_or("-".into(), |s| format!("{s:.1}"))
        };
        let largest = |axis: usize| {
            found
                .iter()
                .map(|f| f.largest_error_m[axis])
                .fold(0.0, f64::max)
        };
        let _ = writeln!(
            text,
            "{recording:>9}  {systems:>7}  {:>11}  {:>6}  {:>7}  {:>5}  {:>11}  {:>8}  {:>11}  {:>11}  {:>12} {:>12}  {:>11.2} {:>8.2}",
            found[0].shape,
            found.len(),
            count(|f| f.in_bank),
            count(|f| f.detected_s.is_some()),
            count(|f| f.bank_detected),
            count(|f| f.excluded_s.is_some()),
            count(|f| f.wrong > 0),
            found.iter().map(|f| f.above_level).sum::<usize>(),
            seconds(0.5, &mut delays),
            seconds(1.0, &mut delays),
            largest(0),
            largest(1),
        );
    }
    text
}

/// Result of the campaign.
#[derive(Serialize)]
struct Outcome {
    campaign: &'static str,
    seed: u64,
    runs: Vec<Run>,
}

/// Runs the campaign on all of them and writes `out` and, in a directory of its name without the ending, the
/// replays with their reports.
///
/// # Errors
/// When a recording is absent or unusable, or a file cannot be written.
pub fn run(data: &Path, phase: Option<Phase>, trials: u64, seed: u64, out: &Path) -> Result<()> {
    let work: PathBuf = out.with_extension("");
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/examples");
    let folders = Folders {
        data,
        examples: &examples,
        work: &work,
    };
    let needed = || {
        format!(
            "the recordings ESBC, walk and drive are needed in {}: tell where ESBC is with --data",
            data.display()
        )
    };
    let mut subjects = [
        esbc(&folders, seed).with_context(needed)?,
        walk(&folders).with_context(needed)?,
        drive(&folders, seed).with_context(needed)?,
        few(&folders, seed).with_context(needed)?,
    ];
    let mut runs = Vec::new();
    for subject in &mut subjects {
        subject.options.config.phase = phase.unwrap_or(subject.options.config.phase);
        for systems in constellations(subject) {
            runs.extend(study(subject, systems, trials, seed, Some(&work))?);
        }
    }
    print!("{}", table(&runs));
    let outcome = Outcome {
        campaign: "recording-faults",
        seed,
        runs,
    };
    std::fs::write(out, serde_json::to_string_pretty(&outcome)? + "\n")
        .with_context(|| format!("cannot write {}", out.display()))?;
    println!("written: {}, replays in {}", out.display(), work.display());
    Ok(())
}
