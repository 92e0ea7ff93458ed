//! A campaign's trials, run and added up.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// A campaign: numbered pieces of work that do not depend on each other.
pub trait Campaign: Sized {
    /// Name on the command line.
    const NAME: &'static str;
    /// Trials unless told otherwise.
    const TRIALS: u64;
    /// What a piece leaves.
    type Record: Serialize + DeserializeOwned + Clone;

    /// What all pieces share.
    ///
    /// # Errors
    /// When it cannot be made.
    fn prepare(seed: u64, trials: u64) -> Result<Self>;

    /// How many pieces so many trials are.
    fn pieces(trials: u64) -> u64 {
        trials
    }

    /// A piece; depends on nothing but the seed and its number.
    ///
    /// # Errors
    /// When the code under test gives up.
    fn piece(&mut self, number: u64) -> Result<Vec<Self::Record>>;

    /// Tables to read, in Markdown.
    fn report(outcome: &Outcome<Self::Record>) -> String;

    /// Pictures: what to add to the name of the result, and an SVG.
    ///
    /// # Errors
    /// When a flight that is to be drawn cannot be flown.
    fn figures(_: &Outcome<Self::Record>) -> Result<Vec<(&'static str, String)>> {
        Ok(Vec::new())
    }
}

/// The records of a campaign or of shards of one.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Outcome<R> {
    /// Name of the campaign.
    pub campaign: String,
    /// Seed.
    pub seed: u64,
    /// Trials of all shards together.
    pub trials: u64,
    /// Shards in it, and of how many.
    pub shards: Vec<(u64, u64)>,
    /// Number of its piece, and the record.
    pub records: Vec<(u64, R)>,
}

impl<R: Clone> Outcome<R> {
    /// The records.
    pub fn of(&self) -> impl Iterator<Item = &R> + Clone {
        self.records.iter().map(|(_, record)| record)
    }
}

/// Runs a shard.
///
/// # Errors
/// As [`Campaign::piece`].
pub fn run<C: Campaign>(seed: u64, trials: u64, shard: (u64, u64)) -> Result<Outcome<C::Record>> {
    let mut campaign = C::prepare(seed, trials)?;
    let (index, of) = shard;
    let numbers: Vec<u64> = (0..C::pieces(trials)).filter(|n| n % of == index).collect();
    let bar =
        ProgressBar::with_draw_target(Some(numbers.len() as u64), ProgressDrawTarget::stderr());
    bar.set_style(ProgressStyle::with_template(
        "{bar:40} {pos}/{len}, {eta} left",
    )?);
    let mut records = Vec::new();
    for number in numbers {
        let piece = campaign
            .piece(number)
            .with_context(|| format!("{} {number} with seed {seed}", C::NAME))?;
        records.extend(piece.into_iter().map(|record| (number, record)));
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(Outcome {
        campaign: C::NAME.into(),
        seed,
        trials,
        shards: vec![shard],
        records,
    })
}

/// Adds the results of shards.
///
/// # Errors
/// When they are of different campaigns, seeds or numbers of trials, or a shard occurs twice.
pub fn merge<R: Clone>(results: &[Outcome<R>]) -> Result<Outcome<R>> {
    let (first, rest) = results.split_first().context("no result to merge")?;
    let mut whole = first.clone();
    for result in rest {
        if (&result.campaign, result.seed, result.trials)
            != (&whole.campaign, whole.seed, whole.trials)
        {
            bail!("results of different campaigns, seeds or numbers of trials cannot be merged");
        }
        if result
            .shards
            .iter()
            .any(|shard| whole.shards.contains(shard))
        {
            bail!("a shard was given twice");
        }
        whole.shards.extend(&result.shards);
        whole.records.extend(result.records.iter().cloned());
    }
    whole.shards.sort_unstable();
    whole.records.sort_by_key(|(number, _)| *number);
    Ok(whole)
}

/// Writes a result with its tables and pictures beside it, and prints the tables.
///
/// # Errors
/// When a file cannot be written.
pub fn write<C: Campaign>(outcome: &Outcome<C::Record>, out: &Path) -> Result<()> {
    let put = |path: PathBuf, text: &str| {
        std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
        println!("written: {}", path.display());
        Ok::<(), anyhow::Error>(())
    };
    let report = C::report(outcome);
    println!("{report}");
    put(out.to_owned(), &(serde_json::to_string(outcome)? + "\n"))?;
    put(out.with_extension("md"), &report)?;
    for (name, svg) in C::figures(outcome)? {
        let stem = out.file_stem().unwrap_or_default().to_string_lossy();
        put(out.with_file_name(format!("{stem}-{name}.svg")), &svg)?;
    }
    Ok(())
}

/// Reads results of shards, adds them and writes the whole.
///
/// # Errors
/// As [`merge`] and [`write()`], or when a file is no result of this campaign.
pub fn merge_files<C: Campaign>(files: &[PathBuf], out: &Path) -> Result<()> {
    let results: Result<Vec<Outcome<C::Record>>> = files
        .iter()
        .map(|path| {
            let text = std::fs::read_to_string(path)
                .with_context(|| format!("cannot read {}", path.display()))?;
            serde_json::from_str(&text)
                .with_context(|| format!("{} is no result of {}", path.display(), C::NAME))
        })
        .collect();
    write::<C>(&merge(&results?)?, out)
}
