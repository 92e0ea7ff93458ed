//! What the monitors are compared on: the epochs of a recording, or of a simulation.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use surefix_core::config::Config;

use crate::linearised::{Linearised, Lineariser};
use crate::replay::{TruthChoice, stands_at};
use crate::simulate::noise::normal;
use crate::source::{Item, Recording};
use crate::truth::{Truth, TruthArguments};

/// Stream of the random numbers that noise is drawn from.
const NOISE_STREAM: u64 = u64::MAX;

/// Where it is.
#[derive(Clone, Debug)]
pub struct Place {
    /// The recording.
    pub gnss: PathBuf,
    /// Navigation files.
    pub nav: Vec<PathBuf>,
    /// What to compare positions with.
    pub truth: TruthArguments,
    /// Recorded inertial units, for the product itself.
    pub imu: Vec<PathBuf>,
}

impl Place {
    /// A folder that `surefix simulate` wrote is its receiver and its truth, unless another is given.
    ///
    /// # Errors
    /// When a folder holds no recording of a receiver.
    pub fn within_folder(mut self) -> Result<Self> {
        if !self.gnss.is_dir() {
            return Ok(self);
        }
        let folder = self.gnss.clone();
        let file = |name: &str| Some(folder.join(name)).filter(|path| path.exists());
        let Some(gnss) = file("receiver.rtcm3").or_else(|| file("receiver.ubx")) else {
            bail!(
                "{} holds neither receiver.rtcm3 nor receiver.ubx: give a recording, or a folder that `surefix simulate` wrote",
                folder.display()
            );
        };
        self.gnss = gnss;
        let TruthArguments { truth, at, at_llh } = &mut self.truth;
        if truth.is_none() && at.is_none() && at_llh.is_none() {
            *truth = file("truth.csv");
        }
        if self.imu.is_empty() {
            self.imu.extend(file("imu.sfx"));
        }
        Ok(self)
    }
}

/// An epoch ready for every monitor.
#[derive(Clone, Debug)]
pub struct Epoch {
    /// Its rows.
    pub linearised: Linearised,
    /// Error of the point of linearisation, east, north, up, m.
    pub at_enu_m: Option<[f64; 3]>,
    /// True velocity east, north, up, m/s.
    pub velocity_enu_mps: Option<[f64; 3]>,
}

/// A recording, linearised.
#[derive(Clone, Debug)]
pub struct Subject {
    /// Name of the file.
    pub name: String,
    /// Its epochs that have a solution.
    pub epochs: Vec<Epoch>,
    /// Epochs without one.
    pub unsolved: u64,
    /// Where the truth is from.
    pub truth: Option<Truth>,
    /// Why there is none.
    pub truth_unused: Option<String>,
}

impl Subject {
    /// Reads a recording; with `noise_seed` white noise of the model's independent sigma is added to every row, for
    /// a recording of a simulator whose pseudoranges have none.
    ///
    /// # Errors
    /// When a file is unusable, or no epoch has a solution.
    pub fn read(place: &Place, config: &Config, noise_seed: Option<u64>) -> Result<Self> {
        let given = match place.truth.choice()? {
            TruthChoice::Given(truth) => Some(truth),
            TruthChoice::FromRecording => None,
        };
        let recording = Recording::read(&place.gnss, &place.nav, config)?;
        let mut lineariser = Lineariser::new(config);
        let mut linearised = Vec::new();
        let mut unsolved = 0;
        for item in &recording.items {
            match lineariser.take(item) {
                Some(Ok(epoch)) => linearised.push(epoch),
                Some(Err(_)) => unsolved += 1,
                None => {}
            }
        }
        if linearised.is_empty() {
            bail!(
                "none of {unsolved} epochs of {} has a position: give navigation data with --nav, and constellations it holds with --systems",
                place.gnss.display()
            );
        }
        let has_samples = !place.imu.is_empty()
            || recording
                .items
                .iter()
                .any(|i| matches!(i, Item::ForFilter(_)));
        let (truth, truth_unused) = match (given, &recording.info.station) {
            (Some(truth), _) => (Some(truth), None),
            (None, None) => (
                None,
                Some("the recording states no position of its antenna".into()),
            ),
            (None, Some(_)) if has_samples => (
                None,
                Some("an antenna with an inertial unit is not fixed".to_owned()),
            ),
            (None, Some((r_e_m, source))) => match standing(*r_e_m, source, &linearised) {
                Ok(truth) => (Some(truth), None),
                Err(why) => (None, Some(why)),
            },
        };
        if let Some(seed) = noise_seed {
            add_noise(&mut linearised, seed);
        }
        let known = truth.as_ref();
        Ok(Self {
            name: file_name(&place.gnss)?,
            epochs: linearised
                .into_iter()
                .map(|linearised| Epoch {
                    at_enu_m: known.and_then(|truth| linearised.error_enu_m(truth)),
                    velocity_enu_mps: known.and_then(|t| linearised.true_velocity_enu_mps(t)),
                    linearised,
                })
                .collect(),
            unsolved,
            truth,
            truth_unused,
        })
    }

    /// Fewest, median and most satellites of an epoch.
    pub fn satellites(&self) -> [usize; 3] {
        let numbers = self.epochs.iter().map(|e| e.linearised.rows.len());
        fewest_median_most(numbers.collect())
    }

    /// Median number of constellations of an epoch, each with a clock.
    pub fn constellations(&self) -> usize {
        let numbers = self.epochs.iter();
        let numbers = numbers.map(|e| e.linearised.model.m.saturating_sub(3));
        fewest_median_most(numbers.collect())[1]
    }
}

fn fewest_median_most(mut numbers: Vec<usize>) -> [usize; 3] {
    numbers.sort_unstable();
    let at = |index: usize| numbers.get(index).copied().unwrap_or(0);
    let last = numbers.len().saturating_sub(1);
    [at(0), at(numbers.len() / 2), at(last)]
}

fn standing(r_e_m: [f64; 3], source: &str, epochs: &[Linearised]) -> Result<Truth, String> {
    let truth = Truth::fixed(r_e_m, source);
    let distances = epochs
        .iter()
        .filter_map(|epoch| Truth::error_enu_m(r_e_m, epoch.r_e_m))
        .map(|[e, n, _]| e.hypot(n));
    stands_at(truth, distances)
}

fn add_noise(epochs: &mut [Linearised], seed: u64) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(NOISE_STREAM);
    for Linearised { model, rows, .. } in epochs {
        for (residual_m, row) in model.residual_m.iter_mut().zip(rows.iter()) {
            *residual_m += row.sigma.independent_m * normal(&mut random);
        }
    }
}

/// The name of a file; of one in a folder of a simulation that of the folder before it.
fn file_name(path: &Path) -> Result<String> {
    let name = path
        .file_name()
        .with_context(|| format!("{} is no file", path.display()))?
        .to_string_lossy();
    let folder = path.parent().and_then(Path::file_name);
    Ok(match folder {
        Some(folder) if name.starts_with("receiver.") => {
            format!("{}/{name}", folder.to_string_lossy())
        }
        _ => name.into_owned(),
    })
}
