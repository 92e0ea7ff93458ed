//! Steps on satellites of a day of recording: `surefix campaign esbc-steps`.
//!
//! Steps of [`MAGNITUDES_M`] at [`TIMES_OF_DAY`] times: on each satellite in turn, and on two and three at
//! once, drawn with random signs, as many trials. The recording is decoded once; at each time the
//! monitor assesses the epoch anew for every trial, so a trial costs one epoch's work.

use std::path::Path;

use anyhow::{Context, Result, bail};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};
use surefix_core::budget::{Ledger, NoCounter};
use surefix_core::config::Config;
use surefix_core::gnss::{
    BroadcastIonosphere, EphemerisStore, ObservationEpoch, Satellite, SatelliteSet,
};
use surefix_core::integrity::Integrity;
use surefix_core::snapshot::{Assessment, SnapshotMonitor};

use crate::source::{Item, Recording};
use crate::truth::Truth;

/// Sizes of the steps, m.
pub const MAGNITUDES_M: [f64; 5] = [12.0, 30.0, 50.0, 100.0, 300.0];
/// Times of day at which faults are put on, evenly spaced.
pub const TIMES_OF_DAY: usize = 20;
/// Most satellites faulted at once.
pub const MAX_FAULTED: usize = 3;

/// What became of the trials of one kind.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// Satellites faulted at once.
    pub faulted: usize,
    /// Size of the step, m.
    pub magnitude_m: f64,
    /// Trials.
    pub trials: u64,
    /// A satellite was excluded or an alert raised.
    pub detected: u64,
    /// Exactly the faulted satellites were excluded.
    pub excluded_rightly: u64,
    /// Some of the faulted satellites and no other were excluded.
    pub excluded_partly: u64,
    /// A healthy satellite was excluded.
    pub excluded_wrongly: u64,
    /// A healthy satellite was excluded and a faulted one kept.
    pub wrong_out_right_in: u64,
    /// An alert, nothing excluded.
    pub alerts: u64,
    /// Neither excluded nor alerted.
    pub missed: u64,
    /// Missed, and an error above its level.
    pub missed_above_level: u64,
    /// An error above its level without an alert, missed or not.
    pub above_level: u64,
    /// Largest error over its level without an alert.
    pub largest_ratio: f64,
}

impl Cell {
    fn add(&mut self, other: &Self) {
        self.trials += other.trials;
        self.detected += other.detected;
        self.excluded_rightly += other.excluded_rightly;
        self.excluded_partly += other.excluded_partly;
        self.excluded_wrongly += other.excluded_wrongly;
        self.wrong_out_right_in += other.wrong_out_right_in;
        self.alerts += other.alerts;
        self.missed += other.missed;
        self.missed_above_level += other.missed_above_level;
        self.above_level += other.above_level;
        if other.largest_ratio > self.largest_ratio {
            self.largest_ratio = other.largest_ratio;
        }
    }

    /// Books one trial.
    fn book(
        &mut self,
        faulted: &SatelliteSet,
        assessment: &Assessment,
        truth: &Truth,
        epoch: &ObservationEpoch,
    ) {
        let verdict = &assessment.verdict;
        let excluded = &verdict.excluded;
        let healthy_out = excluded.iter().any(|s| !faulted.contains(s));
        let faulted_in = faulted.iter().any(|s| !excluded.contains(s));
        let alert = verdict.integrity == Integrity::Alert;
        let detected = alert || !excluded.is_empty();
        self.trials += 1;
        self.detected += u64::from(detected);
        self.alerts += u64::from(alert);
        self.missed += u64::from(!detected);
        self.excluded_wrongly += u64::from(healthy_out);
        self.wrong_out_right_in += u64::from(healthy_out && faulted_in);
        if !excluded.is_empty() && !healthy_out {
            if faulted_in {
                self.excluded_partly += 1;
            } else {
                self.excluded_rightly += 1;
            }
        }
        let error = assessment
            .solution
            .zip(truth.at(epoch.time, 0))
            .and_then(|(solution, true_e_m)| Truth::error_enu_m(true_e_m, solution.r_e_m));
        let Some([east, north, up]) = error else {
            return;
        };
        let ratios = [
            verdict.hpl.bound_m().map(|level| east.hypot(north) / level),
            verdict.vpl.bound_m().map(|level| up.abs() / level),
        ];
        if alert {
            return;
        }
        let largest = ratios.into_iter().flatten().fold(0.0, f64::max);
        if largest > self.largest_ratio {
            self.largest_ratio = largest;
        }
        if largest > 1.0 {
            self.above_level += 1;
            self.missed_above_level += u64::from(!detected);
        }
    }
}

/// Result of a campaign or of a shard of one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CampaignResult {
    /// Name of the campaign.
    pub campaign: String,
    /// Seed.
    pub seed: u64,
    /// Shards in it, and of how many.
    pub shards: Vec<(u64, u64)>,
    /// Counts.
    pub cells: Vec<Cell>,
    /// Epochs assessed without a fault at the same times, and how many of them were detected.
    pub fault_free: (u64, u64),
}

/// What to run.
#[derive(Clone, Debug)]
pub struct StepsOptions {
    /// The monitor's configuration.
    pub config: Config,
    /// Seed of the draws.
    pub seed: u64,
    /// Most trials per cell; `None` for each satellite at each time once.
    pub trials: Option<u64>,
    /// This shard of so many.
    pub shard: (u64, u64),
    /// Times of day.
    pub times: usize,
}

impl StepsOptions {
    /// The whole campaign.
    pub fn new(config: Config, seed: u64) -> Self {
        Self {
            config,
            seed,
            trials: None,
            shard: (0, 1),
            times: TIMES_OF_DAY,
        }
    }
}

/// The state a monitor would have at an epoch of a recording.
struct Bench {
    monitor: Box<SnapshotMonitor>,
    store: Box<EphemerisStore>,
    ionosphere: BroadcastIonosphere,
}

impl Bench {
    fn new(config: &Config) -> Result<Self> {
        let mut monitor = Box::new(SnapshotMonitor::EMPTY);
        if let Err(error) = monitor.configure(config) {
            bail!("the configuration is not legal: {error:?}");
        }
        Ok(Self {
            monitor,
            store: Box::new(EphemerisStore::EMPTY),
            ionosphere: BroadcastIonosphere::EMPTY,
        })
    }

    fn assess(&mut self, epoch: &ObservationEpoch) -> Assessment {
        let mut ledger = Ledger::EMPTY;
        self.monitor.assess(
            epoch,
            &self.store,
            &self.ionosphere,
            &mut ledger,
            &mut NoCounter,
        )
    }
}

/// Steps on satellites of a recording.
///
/// # Errors
/// When the recording has no epochs or states no position to compare with.
pub fn steps(recording: &Recording, options: &StepsOptions) -> Result<CampaignResult> {
    let Some((station_e_m, source)) = &recording.info.station else {
        bail!("the recording states no position of its antenna to compare with");
    };
    let truth = Truth::fixed(*station_e_m, source.clone());
    let epochs = recording
        .items
        .iter()
        .filter(|item| matches!(item, Item::Epoch(_)))
        .count();
    if options.times == 0 || epochs < options.times {
        bail!(
            "{epochs} epochs are too few for {} times of day",
            options.times
        );
    }
    // The middle of each of the equal parts of the recording.
    let chosen: Vec<usize> = (0..options.times)
        .map(|k| (2 * k + 1) * epochs / (2 * options.times))
        .collect();

    let mut result = CampaignResult {
        campaign: "esbc-steps".into(),
        seed: options.seed,
        shards: vec![options.shard],
        cells: (1..=MAX_FAULTED)
            .flat_map(|faulted| {
                MAGNITUDES_M.map(|magnitude_m| Cell {
                    faulted,
                    magnitude_m,
                    ..Cell::default()
                })
            })
            .collect(),
        fault_free: (0, 0),
    };
    let mut bench = Bench::new(&options.config)?;
    let mut number = 0;
    let mut trial = 0;
    for item in &recording.items {
        match item {
            Item::Ephemeris(ephemeris) => {
                let _ = bench.store.insert(ephemeris);
            }
            Item::Klobuchar(parameters) => {
                bench.ionosphere.insert(*parameters);
            }
            Item::Epoch(epoch) => {
                if chosen.contains(&number) {
                    at_epoch(&mut bench, epoch, &truth, options, &mut trial, &mut result);
                }
                number += 1;
            }
            Item::ForFilter(_) => {}
        }
    }
    Ok(result)
}

fn at_epoch(
    bench: &mut Bench,
    epoch: &ObservationEpoch,
    truth: &Truth,
    options: &StepsOptions,
    trial: &mut u64,
    result: &mut CampaignResult,
) {
    let healthy = bench.assess(epoch);
    let Some(solution) = healthy.solution else {
        return;
    };
    if *trial == 0 || options.shard.0 == 0 {
        result.fault_free.0 += 1;
        let detected =
            healthy.verdict.integrity == Integrity::Alert || !healthy.verdict.excluded.is_empty();
        result.fault_free.1 += u64::from(detected);
    }
    let used: Vec<Satellite> = solution.used.iter().collect();
    for (k, satellite) in used.iter().enumerate() {
        let this_trial = *trial;
        *trial += 1;
        let is_over = options.trials.is_some_and(|trials| this_trial >= trials);
        if is_over || this_trial % options.shard.1 != options.shard.0 {
            continue;
        }
        for faulted in 1..=MAX_FAULTED {
            // Depends on the trial alone, so that shards together make the whole.
            let mut random = ChaCha8Rng::seed_from_u64(options.seed);
            random.set_stream(this_trial << 8 | faulted as u64);
            let faults = draw(&used, k, *satellite, faulted, &mut random);
            for magnitude_m in MAGNITUDES_M {
                let mut faulty = epoch.clone();
                for (satellite, sign) in &faults {
                    add_step(&mut faulty, *satellite, sign * magnitude_m);
                }
                let mut set = SatelliteSet::EMPTY;
                for (satellite, _) in &faults {
                    set.insert(*satellite);
                }
                let assessment = bench.assess(&faulty);
                let cell = result
                    .cells
                    .iter_mut()
                    .find(|c| c.faulted == faulted && c.magnitude_m == magnitude_m);
                if let Some(cell) = cell {
                    cell.book(&set, &assessment, truth, epoch);
                }
            }
        }
    }
}

/// The satellites of a trial and the signs of their steps: the one in turn, a positive step, alone;
/// otherwise others drawn beside it, and signs.
fn draw(
    used: &[Satellite],
    turn: usize,
    satellite: Satellite,
    faulted: usize,
    random: &mut ChaCha8Rng,
) -> Vec<(Satellite, f64)> {
    if faulted == 1 {
        return vec![(satellite, 1.0)];
    }
    let mut rest: Vec<Satellite> = used.to_vec();
    let mut chosen = vec![rest.remove(turn)];
    while chosen.len() < faulted && !rest.is_empty() {
        let index = (random.next_u64() % rest.len() as u64) as usize;
        chosen.push(rest.remove(index));
    }
    chosen
        .into_iter()
        .map(|satellite| {
            let sign = if random.next_u64() & 1 == 0 {
                1.0
            } else {
                -1.0
            };
            (satellite, sign)
        })
        .collect()
}

fn add_step(epoch: &mut ObservationEpoch, satellite: Satellite, step_m: f64) {
    let observed = epoch
        .satellites
        .iter_mut()
        .filter(|s| s.satellite == satellite);
    for pseudorange_m in observed
        .flat_map(|s| &mut s.signals)
        .filter_map(|signal| signal.pseudorange_m.as_mut())
    {
        *pseudorange_m += step_m;
    }
}

/// A table to read.
pub fn table(result: &CampaignResult) -> String {
    let mut text = format!(
        "{} seed {}: without a fault {} of {} epochs detected\n",
        result.campaign, result.seed, result.fault_free.1, result.fault_free.0
    );
    text += "faulted  step m  trials  detected %  rightly %  partly %  wrongly %  wrong out, right in  alert %  missed %  missed above level  above level  largest error/level\n";
    for cell in &result.cells {
        let share = |count: u64| 100.0 * count as f64 / cell.trials.max(1) as f64;
        text += &format!(
            "{:>7}  {:>6}  {:>6}  {:>10.2}  {:>9.2}  {:>8.2}  {:>9.2}  {:>19}  {:>7.2}  {:>8.2}  {:>18}  {:>11}  {:>19.3}\n",
            cell.faulted,
            cell.magnitude_m,
            cell.trials,
            share(cell.detected),
            share(cell.excluded_rightly),
            share(cell.excluded_partly),
            share(cell.excluded_wrongly),
            cell.wrong_out_right_in,
            share(cell.alerts),
            share(cell.missed),
            cell.missed_above_level,
            cell.above_level,
            cell.largest_ratio,
        );
    }
    text
}

/// Adds the results of shards.
///
/// # Errors
/// When they are of different campaigns or seeds, or a shard occurs twice.
pub fn merge(results: &[CampaignResult]) -> Result<CampaignResult> {
    let (first, rest) = results.split_first().context("no result to merge")?;
    let mut whole = first.clone();
    for result in rest {
        if (&result.campaign, result.seed) != (&whole.campaign, whole.seed) {
            bail!("results of different campaigns or seeds cannot be merged");
        }
        if result
            .shards
            .iter()
            .any(|shard| whole.shards.contains(shard))
        {
            bail!("a shard was given twice");
        }
        whole.shards.extend(&result.shards);
        whole.fault_free.0 += result.fault_free.0;
        whole.fault_free.1 += result.fault_free.1;
        for cell in &result.cells {
            let same =
                |c: &&mut Cell| c.faulted == cell.faulted && c.magnitude_m == cell.magnitude_m;
            match whole.cells.iter_mut().find(same) {
                Some(sum) => sum.add(cell),
                None => whole.cells.push(cell.clone()),
            }
        }
    }
    Ok(whole)
}

/// The day of recording at Esbjerg in a directory.
pub fn esbc(directory: &Path, config: &Config) -> Result<Recording> {
    let observations = directory.join("ESBC00DNK_R_20201770000_01D_30S_MO.crx.gz");
    let navigation = directory.join("ESBC00DNK_R_20201770000_01D_MN.rnx.gz");
    Recording::read(&observations, &[navigation], config)
        .context("the recording ESBC, 2020 day 177, is needed: tell where it is with --data")
}
