//! `surefix campaign`: many trials of one question, counted.
//!
//! | name | a trial | file |
//! |---|---|---|
//! | `alignment` | a start in each mode of alignment, its error against its sigma | `alignment.rs` |
//! | `esbc-steps` | steps on satellites of a day of recording | `steps.rs` |
//! | `filter-consistency` | flights of two minutes with each grade of inertial unit: normalised errors and innovations squared of the navigator, [`crate::consistency`] | |
//! | `recording-faults` | a replay of ESBC, walk or drive with an inertial unit and faults one after the other | `recording_faults.rs` |
//! | `seed-ramp` | the ramp of [P0] 2.3 with each grade, with and without it on the range rate | `seed_ramp.rs` |
//! | `seed-sweep` | every kind and size of fault on the same satellite | `seed_sweep.rs` |
//! | `seed-monte-carlo` | a space-time point of [P0]; 120 of them are a flight with a fault | `monte_carlo.rs` |
//! | `false-alerts` | a run without a fault, noise white or correlated | `false_alerts.rs` |
//! | `double-faults` | two satellites at fault | `double_faults.rs` |
//! | `time-to-alert` | ramps on the hardest satellite in each phase of flight | `time_to_alert.rs` |
//! | `consensus` | random skies and six hours of GPS, by RANCO, S-RANCO and FOIM | `consensus/` |
//! | `robust` | recordings with two faulty satellites, by least squares and by robust estimation | `robust/` |
//! | `vpl-mhss` | an error of each size on each satellite of a GPS sky of six hours: which one is left out | `vpl_mhss/` |
//! | `araim` | recordings by ARAIM, as measured and with a satellite or a constellation at fault | `araim/` |
//! | `aids` | outages without and with a barometer, or with standstills recognised | `aids.rs` |
//! | `latency` | flights whose receiver is late, beside the same that is not | `latency.rs` |
//! | `wide-headings` | a flight from a heading of each sigma | `wide_headings.rs` |
//! | `voting` | three inertial units, a fault of one, none, or of rising size | `voting.rs` |
//! | `constellation-faults` | a flight with each fault of a constellation | `double_faults.rs` |
//!
//! The campaigns of the filter bank drive core's navigator and bank directly: `flown.rs` the truth,
//! `sky.rs` which satellites, `errors.rs` noise and faults, `rig.rs` the code under test, `trial.rs` one
//! flight scored epoch by epoch. `outcome.rs` adds up trials and shards, `binomial.rs` says how sure
//! a count is, `figure.rs` draws.

pub mod aids;
pub mod alignment;
pub mod araim;
pub mod binomial;
pub mod consensus;
pub mod double_faults;
pub mod errors;
pub mod false_alerts;
pub mod figure;
pub mod flown;
pub mod gps_hours;
pub mod latency;
pub mod monte_carlo;
pub mod outcome;
pub mod recording_faults;
pub mod rig;
pub mod robust;
pub mod seed_ramp;
pub mod seed_sweep;
pub mod sky;
pub mod steps;
pub mod time_to_alert;
pub mod trial;
pub mod voting;
pub mod vpl_mhss;
pub mod wide_headings;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde::Serialize;

pub use steps::{CampaignResult, Cell, MAGNITUDES_M, StepsOptions, esbc, merge, steps, table};

use crate::consistency::study::{self, Study};
use outcome::Campaign;

/// Trials of `filter-consistency` unless told otherwise.
const CONSISTENCY_TRIALS: u64 = 200;

/// Result of `filter-consistency`.
#[derive(Serialize)]
struct ConsistencyResult {
    campaign: &'static str,
    seed: u64,
    studies: Vec<Study>,
}

fn filter_consistency(args: &Args) -> Result<()> {
    let studies = study::studies(args.seed, args.trials.unwrap_or(CONSISTENCY_TRIALS))?;
    print!("{}", study::table(&studies, 0.99));
    let result = ConsistencyResult {
        campaign: "filter-consistency",
        seed: args.seed,
        studies,
    };
    std::fs::write(&args.out, serde_json::to_string_pretty(&result)? + "\n")
        .with_context(|| format!("cannot write {}", args.out.display()))?;
    println!("written: {}", args.out.display());
    Ok(())
}

/// Constellations of a campaign unless told otherwise: those it is accepted with.
const DEFAULT_SYSTEMS: &str = "GC";

/// Arguments of `surefix campaign`.
#[derive(Clone, Debug, clap::Args)]
#[command(mut_arg("systems", |systems| systems.help(format!(
    "Constellations to use, letters of G (GPS), E (Galileo), C (BDS) [default: {DEFAULT_SYSTEMS}]"
))))]
pub struct Args {
    /// Name of the campaign (alignment, esbc-steps, filter-consistency, recording-faults, seed-ramp, seed-sweep, seed-monte-carlo, false-alerts, double-faults, constellation-faults, time-to-alert, voting, aids, latency, wide-headings, robust, vpl-mhss, consensus, araim), or `merge` to add results of shards
    pub name: String,
    /// Results to merge
    pub files: Vec<PathBuf>,
    /// Trials, at least 1, by default as many as the campaign is meant to have: esbc-steps every satellite at
    /// every time of day, seed-monte-carlo 8000 points
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    pub trials: Option<u64>,
    /// Seed of everything random
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Run shard I of K, I from 1
    #[arg(long, value_name = "I/K")]
    pub shard: Option<String>,
    /// Directory with the recording ESBC; those of recording-faults, robust, vpl-mhss and araim lie beside it
    #[arg(
        long,
        value_name = "DIR",
        default_value = "../shared/data/esbc-2020-177"
    )]
    pub data: PathBuf,
    #[command(flatten)]
    /// The monitor's settings
    pub settings: crate::settings::Settings,
    /// JSON file to write
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
}

/// Checks a campaign that runs whole, and gives the directory of all recordings.
///
/// # Errors
/// When it is asked for in parts, or the result cannot be written.
fn undivided(args: &Args) -> Result<&Path> {
    check_out(&args.out)?;
    if args.name == "merge" {
        bail!("results of this campaign are not merged: give it more --trials instead");
    }
    if args.shard.is_some() {
        bail!(
            "{} has no shards: give runs of different --seed instead",
            args.name
        );
    }
    Ok(args.data.parent().unwrap_or(Path::new(".")))
}

/// # Errors
/// When settings of the monitor are given to a campaign that has its own.
fn without_settings(args: &Args) -> Result<()> {
    if args.settings == crate::settings::Settings::default() {
        return Ok(());
    }
    bail!(
        "{} has settings of its own: leave out --systems, --mask-deg, --phase and the other settings of the monitor",
        args.name
    )
}

/// `surefix campaign`.
///
/// # Errors
/// When the arguments or the files are unusable; the message tells what to do.
pub fn run(args: &Args) -> Result<()> {
    if let Some(file) = args.files.first().filter(|_| args.name != "merge") {
        bail!("{} is for `merge` alone: leave it out", file.display());
    }
    let name = match args.name.as_str() {
        "merge" => campaign_of(args.files.first().context("no result to merge")?)?,
        name => name.to_owned(),
    };
    if bank_campaign::<alignment::Alignment>(&name, args)?
        || bank_campaign::<wide_headings::WideHeadings>(&name, args)?
        || bank_campaign::<seed_ramp::SeedRamp>(&name, args)?
        || bank_campaign::<seed_sweep::SeedSweep>(&name, args)?
        || bank_campaign::<monte_carlo::MonteCarlo>(&name, args)?
        || bank_campaign::<false_alerts::FalseAlerts>(&name, args)?
        || bank_campaign::<double_faults::DoubleFaults>(&name, args)?
        || bank_campaign::<double_faults::ConstellationFaults>(&name, args)?
        || bank_campaign::<time_to_alert::TimeToAlert>(&name, args)?
        || bank_campaign::<latency::Latency>(&name, args)?
        || bank_campaign::<voting::VotingCampaign>(&name, args)?
    {
        return Ok(());
    }
    let result = match name.as_str() {
        "esbc-steps" if args.name == "merge" => {
            check_out(&args.out)?;
            let results: Result<Vec<CampaignResult>> = args.files.iter().map(|f| read(f)).collect();
            merge(&results?)?
        }
        "esbc-steps" => {
            check_out(&args.out)?;
            let mut settings = args.settings.clone();
            settings
                .systems
                .get_or_insert_with(|| DEFAULT_SYSTEMS.into());
            let config = settings.config()?;
            let recording = esbc(&args.data, &config)?;
            let mut options = StepsOptions::new(config, args.seed);
            options.trials = args.trials;
            if let Some(shard) = &args.shard {
                options.shard = parse_shard(shard)?;
            }
            steps(&recording, &options)?
        }
        "filter-consistency" => {
            undivided(args)?;
            return filter_consistency(args);
        }
        "robust" => {
            let data = undivided(args)?;
            let trials = args.trials.unwrap_or(robust::TRIALS);
            let config = args.settings.config()?;
            return robust::run(data, &config, trials, args.seed, &args.out);
        }
        "consensus" => {
            let data = undivided(args)?;
            without_settings(args)?;
            let trials = args.trials.unwrap_or(consensus::TRIALS);
            return consensus::run(data, trials, args.seed, &args.out);
        }
        "vpl-mhss" => {
            let data = undivided(args)?;
            without_settings(args)?;
            let trials = args.trials.unwrap_or(vpl_mhss::TRIALS);
            return vpl_mhss::run(data, trials, args.seed, &args.out);
        }
        "araim" => {
            let data = undivided(args)?;
            let trials = args.trials.unwrap_or(araim::FAULTED_EPOCHS);
            let config = args.settings.config()?;
            return araim::run(data, &config, trials, args.seed, &args.out);
        }
        "aids" => {
            let data = undivided(args)?;
            without_settings(args)?;
            let trials = args.trials.unwrap_or(aids::TRIALS);
            return aids::run(data, args.seed, trials, &args.out);
        }
        "recording-faults" => {
            let data = undivided(args)?;
            let trials = args.trials.unwrap_or(recording_faults::TRIALS);
            let phase = args.settings.phase.as_ref();
            let phase = phase.map(|_| args.settings.config()).transpose()?;
            let phase = phase.map(|config| config.phase);
            return recording_faults::run(data, phase, trials, args.seed, &args.out);
        }
        other => {
            bail!(
                "there is no campaign \"{other}\": take alignment, esbc-steps, filter-consistency, recording-faults, seed-ramp, seed-sweep, seed-monte-carlo, false-alerts, double-faults, constellation-faults, time-to-alert, voting, aids, latency, wide-headings, robust, vpl-mhss, consensus, araim, or merge"
            )
        }
    };
    std::fs::write(&args.out, serde_json::to_string_pretty(&result)? + "\n")
        .with_context(|| format!("cannot write {}", args.out.display()))?;
    print!("{}", table(&result));
    println!("written: {}", args.out.display());
    Ok(())
}

/// Runs or merges a campaign of the bank if it is the one asked for.
fn bank_campaign<C: Campaign>(name: &str, args: &Args) -> Result<bool> {
    if name != C::NAME {
        return Ok(false);
    }
    check_out(&args.out)?;
    if args.name == "merge" {
        outcome::merge_files::<C>(&args.files, &args.out)?;
        return Ok(true);
    }
    let shard = args.shard.as_deref().map_or(Ok((0, 1)), parse_shard)?;
    let trials = args.trials.unwrap_or(C::TRIALS);
    let result = outcome::run::<C>(args.seed, trials, shard)?;
    outcome::write::<C>(&result, &args.out)?;
    Ok(true)
}

/// The name of the campaign a result is of.
fn campaign_of(path: &Path) -> Result<String> {
    #[derive(serde::Deserialize)]
    struct Named {
        campaign: String,
    }
    let text =
        std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    serde_json::from_str::<Named>(&text)
        .map(|named| named.campaign)
        .with_context(|| format!("{} is no campaign result", path.display()))
}

/// Refuses a file that could not be written, before the trials take their minutes.
fn check_out(file: &Path) -> Result<()> {
    // The parent of a bare file name is the empty path.
    let parent = file.parent().filter(|p| !p.as_os_str().is_empty());
    if file.is_dir() || parent.is_some_and(|parent| !parent.is_dir()) {
        bail!(
            "cannot write {}: give a file in a directory that exists with --out",
            file.display()
        );
    }
    Ok(())
}

/// Prints tables; writes a result, its tables beside it, and its picture.
fn write_result(out: &Path, result: &impl Serialize, tables: String, figure: String) -> Result<()> {
    print!("{tables}");
    let json = serde_json::to_string_pretty(result)? + "\n";
    for (path, text) in [
        (out.to_owned(), json),
        (out.with_extension("md"), tables),
        (out.with_extension("svg"), figure),
    ] {
        std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
        println!("written: {}", path.display());
    }
    Ok(())
}

fn read(path: &Path) -> Result<CampaignResult> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    serde_json::from_str(&text).with_context(|| format!("{} is no campaign result", path.display()))
}

fn parse_shard(text: &str) -> Result<(u64, u64)> {
    let parts = text.split_once('/').and_then(|(i, k)| {
        let (i, k): (u64, u64) = (i.parse().ok()?, k.parse().ok()?);
        (i >= 1 && i <= k).then_some((i - 1, k))
    });
    parts.with_context(|| {
        format!("--shard \"{text}\" is not I/K with I from 1 to K, for example 2/8")
    })
}
