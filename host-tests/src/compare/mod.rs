//! `surefix compare`: every monitor of one epoch on the same recording with the same faults.
//!
//! ```text
//! recording ─► subject: linearised epochs ─┬─► experiment: each epoch to every monitor ─► counts ─┐
//!              faults of the command line ─┤                                                      ├─► report
//!              sweep: sizes and trials ────┴─► the same, one fault size after the other ─► counts ─┘
//! ```
//!
//! | file written | content |
//! |---|---|
//! | `comparison.md` | the tables as printed |
//! | `comparison.csv` | counts, levels and errors: a row per monitor and kind of epoch (without a fault, with one, each size of the sweep) |
//! | `comparison.json` | the same, with what was compared and how |
//! | `comparison.svg` | rates by size of the fault; vertical levels and errors along the recording |
//! | `epochs.csv` | a row per epoch and monitor: what was faulted, the answer, what was excluded, levels, errors; with `--fault`, behind these a row per epoch of `surefix_clean`: surefix itself on the recording without the faults, from which its epochs without a fault are counted |
//!
//! `registry.rs` lists the monitors, `product.rs` puts surefix itself beside them, `instructions.rs` says what an
//! epoch of each executes on the emulated board.

pub mod counts;
pub mod experiment;
pub mod instructions;
pub mod picture;
pub mod product;
pub mod registry;
pub mod report;
pub mod subject;
pub mod sweep;

use std::path::PathBuf;

use anyhow::{Result, bail};
use serde::Serialize;
use surefix_core::consts::MAX_SATELLITES;
use surefix_core::integrity::PhaseRequirements;

use crate::faults::FaultSpec;
use crate::replay::{self, ReplayOptions};
use crate::settings::Settings;
use crate::truth::TruthArguments;
use counts::Summary;
use experiment::{Contestant, Series};
use instructions::{Bench, Instructions};
use registry::Tests;
use subject::{Place, Subject};
use sweep::Sizes;

/// Most satellites faulted at a time in a sweep.
const MAX_SIMULTANEOUS: u8 = 3;

/// All monitors side by side on one recording with the same faults
///
/// Each epoch is linearised once and given to every monitor: residual RAIM, RMS comparison, robust estimation, ARAIM
/// and the others. Counted are detections, right and wrong exclusions, false alerts, levels, and what they fail to
/// bound; what an epoch costs is told as the emulated board measured it. A fault is added to the rows after the
/// linearisation. surefix itself stands beside them as a replay, outside the sweep; its alerts without a fault are those of
/// a replay without any.
///
/// Try it on a simulation:
///
///   surefix simulate static --seed 1 --out sky
///   surefix compare --gnss sky --ionosphere none --sweep 0:5:60 --out compared
#[derive(Clone, Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// A recording as `surefix replay` takes it (RTCM 3, UBX, RINEX observations), or a folder that
    /// `surefix simulate` wrote
    #[arg(long, value_name = "FILE|DIR")]
    pub gnss: PathBuf,
    /// RINEX 3 or 4 navigation file; may be given several times
    #[arg(long, value_name = "FILE")]
    pub nav: Vec<PathBuf>,
    /// Recording of an inertial unit, for surefix itself, as `surefix replay` takes it: its filter bank then takes
    /// part; may be given several times
    #[arg(long, value_name = "FILE")]
    pub imu: Vec<PathBuf>,
    #[command(flatten)]
    /// What positions are compared with
    pub truth: TruthArguments,
    #[command(flatten)]
    /// The settings of the solution, and the phase of flight
    pub settings: Settings,
    /// Settings in TOML; flags win over it
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Monitors to compare, with commas between [default: all]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub monitors: Vec<String>,
    /// Fault to put on a satellite: `SAT:KIND:MAG:T0:T1[:rr][:PERIOD]`, KIND one of step, ramp, noise,
    /// walk, osc; may be given several times
    #[arg(long, value_name = "SPEC", allow_hyphen_values = true)]
    pub fault: Vec<String>,
    /// Sizes of faults to try on single epochs, m, for example 0:5:100
    #[arg(long, value_name = "FROM:STEP:TO", allow_hyphen_values = true)]
    pub sweep: Option<String>,
    /// Satellites faulted at a time in the sweep, each by the same size of either sign
    #[arg(long, value_name = "1..3", default_value_t = 1, requires = "sweep",
        value_parser = clap::value_parser!(u8).range(1..=i64::from(MAX_SIMULTANEOUS)))]
    pub faults: u8,
    /// Trials of each size: an epoch and satellites drawn at random. With --in-turn epochs, evenly over the recording
    #[arg(long, default_value_t = 200, requires = "sweep", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub trials: u64,
    /// Every satellite of an epoch in turn, in place of satellites drawn at random
    #[arg(long, requires = "sweep")]
    pub in_turn: bool,
    /// Seed of everything random
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Adds white noise of the model's sigma to every row: for a simulator's recording whose pseudoranges have no
    /// errors. surefix itself is then left out
    #[arg(long)]
    pub add_noise: bool,
    /// Directory to write comparison.md, comparison.csv, comparison.json, comparison.svg and epochs.csv to
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// The sweep that was run.
#[derive(Clone, Debug, Serialize)]
pub struct Plan {
    /// Sizes, m.
    pub sizes_m: Vec<f64>,
    /// Satellites faulted at a time.
    pub faults: u8,
    /// Trials of each size.
    pub trials: usize,
    /// Every satellite in turn instead of drawn at random.
    pub in_turn: bool,
}

/// What became of a monitor.
#[derive(Clone, Debug, Serialize)]
pub struct MonitorResult {
    /// On the command line.
    pub name: &'static str,
    /// In tables.
    pub title: &'static str,
    /// What it tests.
    #[serde(skip)]
    pub tests: Tests,
    /// Memory, bytes; not of surefix itself, which is more than this test.
    pub memory_b: Option<usize>,
    /// Most satellites it takes; of more the highest.
    pub most_satellites: usize,
    /// Probability of an alert at a healthy epoch that it is configured for.
    pub p_false_alert: Option<f64>,
    /// Of an epoch without a fault.
    pub instructions: Option<Instructions>,
    /// Of an epoch with a fault.
    pub instructions_with_fault: Option<Instructions>,
    /// Epochs of the recording without a fault.
    pub without_fault: Summary,
    /// Epochs of the recording with one.
    pub with_fault: Option<Summary>,
    /// By size.
    pub sweep: Option<Vec<Summary>>,
}

/// Everything that came out.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Version.
    pub surefix: &'static str,
    /// Name of the recording.
    pub recording: String,
    /// Phase of flight whose risks and limits are used.
    pub phase: &'static str,
    /// Epochs with a solution.
    pub epochs: usize,
    /// Epochs without.
    pub unsolved: u64,
    /// Fewest, median and most satellites of an epoch.
    pub satellites: [usize; 3],
    /// Where the truth is from.
    pub truth: Option<String>,
    /// Why there is none.
    pub truth_unused: Option<String>,
    /// White noise was added to the rows.
    pub noise_added: bool,
    /// Faults of the recording.
    pub faults: Vec<String>,
    /// Seed.
    pub seed: u64,
    /// The sweep.
    pub sweep: Option<Plan>,
    /// By monitor.
    pub monitors: Vec<MonitorResult>,
    /// What each said of each epoch.
    #[serde(skip)]
    pub series: Series,
    /// Times of the epochs, s.
    #[serde(skip)]
    pub t_s: Vec<f64>,
    /// Alert limits.
    #[serde(skip)]
    pub limits: PhaseRequirements,
}

/// Runs `surefix compare`: prints the tables and writes the files.
///
/// # Errors
/// When arguments or files are unusable; the message says what to do.
pub fn run(args: &Args, progress: &mut dyn FnMut(u64, u64)) -> Result<Comparison> {
    replay::make_directory(&args.out)?;
    let comparison = compare(args, progress)?;
    report::write(&comparison, &args.out)?;
    Ok(comparison)
}

/// The same in memory.
///
/// # Errors
/// As [`run`].
pub fn compare(args: &Args, progress: &mut dyn FnMut(u64, u64)) -> Result<Comparison> {
    let faults: Result<Vec<FaultSpec>, _> = args.fault.iter().map(|s| s.parse()).collect();
    let faults = faults?;
    let sizes = args.sweep.as_ref().map(|text| text.parse::<Sizes>());
    let sizes = sizes.transpose()?;
    if args.in_turn && args.faults != 1 {
        bail!("--in-turn goes through single faults: leave out --faults, or --in-turn");
    }
    let mut names = args.monitors.clone();
    let with_product = names.is_empty() || names.iter().any(|name| name == product::NAME);
    if with_product && args.add_noise && !names.is_empty() {
        bail!(
            "--add-noise changes rows and no recording: leave surefix out of --monitors, or --add-noise out"
        );
    }
    let with_product = with_product && !args.add_noise;
    let only_product = names.len() == 1 && with_product;
    names.retain(|name| name != product::NAME);
    let entries = if only_product {
        Vec::new()
    } else {
        registry::chosen(&names)?
    };
    if sizes.is_some() && entries.iter().all(|e| e.tests != Tests::Pseudoranges) {
        bail!(
            "--sweep has nothing to sweep: its trials are single epochs with a fault on pseudoranges, surefix itself runs from the beginning of a recording to its end, and Doppler RAIM tests range rates; leave out --sweep, or add another monitor to --monitors, for example residual"
        );
    }
    let place = Place {
        gnss: args.gnss.clone(),
        nav: args.nav.clone(),
        truth: args.truth.clone(),
        imu: args.imu.clone(),
    }
    .within_folder()?;
    let settings = args.settings.clone().over_file(args.config.as_ref())?;
    let config = settings.config()?;
    let limits = config.phase.requirements();
    let subject = Subject::read(&place, &config, args.add_noise.then_some(args.seed))?;
    let contestants: Result<Vec<Contestant>> = entries
        .iter()
        .map(|entry| Contestant::new(entry, config.phase))
        .collect();
    let mut contestants = contestants?;

    let trials = match (&sizes, args.in_turn) {
        (None, _) => Vec::new(),
        (Some(_), true) => sweep::in_turn(&subject.epochs, args.trials),
        (Some(_), false) => {
            sweep::drawn(&subject.epochs, args.faults.into(), args.trials, args.seed)
        }
    };
    let sizes_m = sizes.map(|Sizes(sizes_m)| sizes_m);
    let all = subject.epochs.len() + sizes_m.as_ref().map_or(0, |s| s.len() * trials.len());
    let mut done = 0;
    let mut step = || {
        done += 1;
        progress(done, all as u64);
    };
    let mut series = experiment::series(&subject, &mut contestants, &faults, args.seed, &mut step)?;
    let by_size = sizes_m
        .as_ref()
        .map(|sizes_m| {
            experiment::sweep(
                &subject,
                &mut contestants,
                sizes_m,
                &trials,
                &limits,
                &mut step,
            )
        })
        .transpose()?;
    let bench = Bench::measured()?;
    let satellites = subject.satellites();
    let constellations = subject.constellations() as u64;
    let any_fault = !faults.is_empty();
    let mut monitors: Vec<MonitorResult> = contestants
        .iter()
        .enumerate()
        .map(|(k, contestant)| {
            let entry = contestant.entry;
            let measured = |stage: &str| bench.nearest(stage, satellites[1] as u64, constellations);
            MonitorResult {
                name: entry.name,
                title: entry.title,
                tests: entry.tests,
                memory_b: Some(contestant.memory_b),
                most_satellites: entry.most_satellites,
                p_false_alert: (entry.p_false_alert)(&limits),
                instructions: measured(entry.work),
                instructions_with_fault: measured(&instructions::with_fault(entry.work)),
                without_fault: series.counts(k, entry.tests, false, &limits),
                with_fault: any_fault.then(|| series.counts(k, entry.tests, true, &limits)),
                sweep: by_size
                    .as_ref()
                    .filter(|_| entry.tests == Tests::Pseudoranges)
                    .map(|sizes| sizes.iter().map(|size| size[k].clone()).collect()),
            }
        })
        .collect();
    if with_product {
        let mut options = ReplayOptions::new(place.gnss.clone());
        options.nav.clone_from(&place.nav);
        options.config = config;
        options.imu.clone_from(&place.imu);
        options.imu_settings.clone_from(&settings.imu);
        options.seed = args.seed;
        let clean = product::run(&options, &[], &subject, progress)?;
        if any_fault {
            series.clean = clean.said;
            series.push(product::run(&options, &faults, &subject, progress)?.said);
        } else {
            series.push(clean.said);
        }
        let without_fault = series.counts_of_product(false, &limits);
        let with_fault = any_fault.then(|| series.counts_of_product(true, &limits));
        monitors.push(MonitorResult {
            name: product::NAME,
            title: clean.title,
            tests: Tests::Pseudoranges,
            memory_b: None,
            most_satellites: MAX_SATELLITES,
            p_false_alert: None,
            instructions: None,
            instructions_with_fault: None,
            without_fault,
            with_fault,
            sweep: None,
        });
    }
    Ok(Comparison {
        surefix: env!("CARGO_PKG_VERSION"),
        recording: subject.name.clone(),
        phase: config.phase.name(),
        epochs: subject.epochs.len(),
        unsolved: subject.unsolved,
        satellites,
        truth: subject.truth.as_ref().map(|truth| truth.source.clone()),
        truth_unused: subject.truth_unused.clone(),
        noise_added: args.add_noise,
        faults: faults.iter().map(ToString::to_string).collect(),
        seed: args.seed,
        sweep: sizes_m.map(|sizes_m| Plan {
            sizes_m,
            faults: args.faults,
            trials: trials.len(),
            in_turn: args.in_turn,
        }),
        monitors,
        t_s: subject.epochs.iter().map(|e| e.linearised.t_s()).collect(),
        series,
        limits,
    })
}
