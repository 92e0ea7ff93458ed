//! RANCO, S-RANCO and FOIM under random skies and six hours of GPS: `surefix campaign consensus`.
//!
//! | question | function |
//! |---|---|
//! | Does FOIM give the verdict of S-RANCO? | [`compare`], random skies of 6 to 24 satellites, half of them healthy |
//! | Does T_SV keep the false-alarm probability? | [`false_alarms`], healthy skies |
//! | What bias is found? ([P4] figure 9 has it for another algorithm) | [`sweep`], each satellite of the six hours in turn |
//! | How do the counts look? ([P4] figure 10) | [`counts`], one epoch with one, two and three biases |
//! | Two and three biases at once | [`several`], satellites drawn at random |
//!
//! Every epoch is linearised at the true place, errors are normal with the sigmas given, a bias is a number added to a
//! row. The six hours are those of [`super::vpl_mhss`]. `skies.rs` draws random skies, `report.rs` prints and draws.

pub mod report;
pub mod skies;

use std::path::Path;

use anyhow::{Context, Result};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::Serialize;
use surefix_core::gnss::solution::UsedRow;
use surefix_core::linalg::LinearModel;
use surefix_core::raim::consensus::suspicion::suspicion_threshold;
use surefix_core::raim::exclusion::RowSet;
use surefix_core::raim::foim::GDOP_LIMIT;
use surefix_core::raim::monitors::consensus::{ConsensusConfig, ConsensusMonitor, ConsensusRule};
use surefix_core::raim::monitors::{EpochMonitor, MonitorEpoch, MonitorVerdict, Outcome};

use super::gps_hours::SkyEpoch;
use super::vpl_mhss::GpsSky;
use super::vpl_mhss::sky::BroadcastSky;
use skies::{drawn_rows, signed_size_m};

/// Random skies of one constellation unless told otherwise; of two and three a tenth.
pub const TRIALS: u64 = 10_000;
/// Fewest and most satellites of a random sky.
pub const SATELLITES: [usize; 2] = [6, 24];
/// Most faults under random skies, and most reckoned with there. In the six hours the monitors reckon with as many
/// as there are.
pub const MOST_FAULTS: usize = 3;
/// Largest bias, m. [P4] 3.2
pub const LARGEST_M: f64 = 40.0;
/// Step of the sweep, m.
pub const STEP_M: f64 = 2.0;
/// Sizes of two and three biases, m.
pub const SIZES_M: [f64; 6] = [10.0, 15.0, 20.0, 30.0, 40.0, 60.0];
/// Time between the epochs of the six hours, s.
pub const EVERY_S: u32 = 300;
/// False-alarm probabilities of the sweep: what healthy epochs may cost in [P4]'s experiments, and the product's.
pub const P_FALSE_ALARM: [f64; 2] = [1e-3, 3.3333e-7];
/// Where the bound of the false alarms is measured, because the others are too rare.
pub const P_MEASURED: f64 = 0.05;
/// Numbers of satellites under which it is.
pub const MEASURED_SATELLITES: [usize; 5] = [6, 8, 10, 12, 16];
/// Members of a subset of one constellation.
const MEMBERS: usize = 4;
/// Elevation mask, degrees.
pub const MASK_DEG: f64 = 5.0;

/// The algorithms.
pub const METHODS: [(&str, ConsensusRule); 3] = [
    ("RANCO", ConsensusRule::Ranco),
    ("S-RANCO", ConsensusRule::SRanco),
    (
        "FOIM",
        ConsensusRule::Foim {
            gdop_limit: GDOP_LIMIT,
        },
    ),
];
const S_RANCO: usize = 1;
const FOIM: usize = 2;

/// What became of epochs of one kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Tally {
    /// Epochs.
    pub epochs: u64,
    /// A fault was seen.
    pub detected: u64,
    /// The faulty rows and no other were excluded.
    pub right: u64,
    /// Some of the faulty rows and no other.
    pub partly: u64,
    /// A healthy row was excluded.
    pub wrong: u64,
}

impl Tally {
    fn book(&mut self, verdict: &MonitorVerdict, faulty: RowSet) {
        self.epochs += 1;
        self.detected += u64::from(verdict.is_detected());
        if verdict.outcome != Outcome::Excluded {
        } else if verdict.excluded == faulty {
            self.right += 1;
        } else if faulty.contains_all(verdict.excluded) {
            self.partly += 1;
        } else {
            self.wrong += 1;
        }
    }
}

/// Random skies of one kind.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Comparison {
    /// Constellations.
    pub constellations: usize,
    /// By number of faults, 0 to 3.
    pub by_faults: [Compared; 4],
    /// By number of satellites.
    pub by_satellites: Vec<(usize, Compared)>,
}

/// Verdicts under the same skies.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Compared {
    /// Skies.
    pub skies: u64,
    /// FOIM has the outcome of S-RANCO, and excludes the same rows.
    pub same: u64,
    /// Subsets, and those of them that FOIM drops.
    pub subsets: u64,
    /// Dropped by FOIM.
    pub dropped: u64,
    /// Of each method.
    pub tallies: [Tally; 3],
}

impl Compared {
    fn add(&mut self, other: &Self) {
        self.skies += other.skies;
        self.same += other.same;
        self.subsets += other.subsets;
        self.dropped += other.dropped;
        for (sum, tally) in self.tallies.iter_mut().zip(&other.tallies) {
            sum.epochs += tally.epochs;
            sum.detected += tally.detected;
            sum.right += tally.right;
            sum.partly += tally.partly;
            sum.wrong += tally.wrong;
        }
    }
}

impl Comparison {
    /// All its skies.
    pub fn total(&self) -> Compared {
        let mut total = Compared::default();
        for compared in &self.by_faults {
            total.add(compared);
        }
        total
    }
}

/// Healthy skies of one number of satellites.
#[derive(Clone, Debug, Serialize)]
pub struct FalseAlarms {
    /// Satellites.
    pub satellites: usize,
    /// Skies.
    pub skies: u64,
    /// A row was suspected, by each method.
    pub suspected: [u64; 3],
    /// A fault was seen, by each method.
    pub detected: [u64; 3],
}

/// Epochs with biases of one size.
#[derive(Clone, Debug, Serialize)]
pub struct SizePoint {
    /// The size, m.
    pub size_m: f64,
    /// Of each method.
    pub tallies: [Tally; 3],
}

/// The counts of an epoch.
#[derive(Clone, Debug, Serialize)]
pub struct Counts {
    /// Since the start of the six hours, s.
    pub t_s: f64,
    /// Name and bias, m, of each satellite.
    pub satellites: Vec<(String, f64)>,
    /// T_SV as a share.
    pub threshold: f64,
    /// Outliers and predictions of each satellite by S-RANCO.
    pub s_ranco: Vec<(u32, u32)>,
    /// And by FOIM.
    pub foim: Vec<(u32, u32)>,
    /// What FOIM excludes.
    pub excluded: Vec<String>,
}

/// Everything.
#[derive(Clone, Debug, Serialize)]
pub struct ConsensusResult {
    /// `consensus`.
    pub campaign: &'static str,
    /// Seed.
    pub seed: u64,
    /// Skies of one constellation.
    pub trials: u64,
    /// By number of constellations, one to three.
    pub comparisons: Vec<Comparison>,
    /// By number of satellites.
    pub false_alarms: Vec<FalseAlarms>,
    /// Satellites of the six hours, fewest and most.
    pub satellites: [usize; 2],
    /// Single biases, by false-alarm probability.
    pub sweeps: Vec<(f64, Vec<SizePoint>)>,
    /// Two and three biases.
    pub several: Vec<(usize, Vec<SizePoint>)>,
    /// One, two and three biases at one epoch.
    pub counts: Vec<Counts>,
}

/// The three monitors.
struct Monitors([Box<ConsensusMonitor>; 3]);

impl Monitors {
    fn new(p_false_alarm: f64, max_faults: usize) -> Result<Self> {
        let monitor = |rule| {
            let mut monitor = Box::new(ConsensusMonitor::EMPTY);
            let config = ConsensusConfig {
                rule,
                p_false_alarm,
                max_faults,
            };
            match monitor.configure(&config) {
                Ok(()) => Ok(monitor),
                Err(error) => Err(anyhow::anyhow!("{rule:?} is not configured: {error:?}")),
            }
        };
        let [(_, first), (_, second), (_, third)] = METHODS;
        Ok(Self([monitor(first)?, monitor(second)?, monitor(third)?]))
    }

    fn assess(&mut self, model: &LinearModel, rows: &[UsedRow]) -> Result<[MonitorVerdict; 3]> {
        let epoch = MonitorEpoch::new(model, rows)
            .map_err(|why| anyhow::anyhow!("rows and model differ: {why:?}"))?;
        let [first, second, third] = &mut self.0;
        Ok([
            first.assess(&epoch),
            second.assess(&epoch),
            third.assess(&epoch),
        ])
    }
}

fn stream(seed: u64, number: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(number);
    random
}

/// Verdicts of the three under the same random skies. Every other one is healthy, the others have one, two
/// and three faults of up to [`LARGEST_M`], either sign, in turn.
///
/// # Errors
/// When a monitor is not configured.
pub fn compare(seed: u64, trials: u64, constellations: usize) -> Result<Comparison> {
    let mut monitors = Monitors::new(P_FALSE_ALARM[0], MOST_FAULTS)?;
    let [fewest, most] = SATELLITES;
    // One row more than unknowns at least.
    let fewest = fewest.max(4 + constellations);
    let mut comparison = Comparison {
        constellations,
        by_satellites: (fewest..=most).map(|n| (n, Compared::default())).collect(),
        ..Comparison::default()
    };
    for trial in 0..trials {
        let random = &mut stream(seed, trial);
        let place = trial as usize % comparison.by_satellites.len();
        let n = fewest + place;
        // Kinds and numbers of satellites go round together.
        let round = trial as usize / comparison.by_satellites.len();
        let faults = if round.is_multiple_of(2) {
            0
        } else {
            1 + (round / 2) % MOST_FAULTS
        };
        let sky = skies::sky(random, n, constellations);
        let mut model = sky.noisy(random);
        let faulty = drawn_rows(random, n, faults);
        for row in &faulty {
            model.residual_m[*row] += signed_size_m(random, [0.0, LARGEST_M]);
        }
        let faulty = faulty.into_iter().fold(RowSet::EMPTY, RowSet::with);
        let verdicts = monitors.assess(&model, &sky.rows)?;
        let (s_ranco, foim) = (&verdicts[S_RANCO], &verdicts[FOIM]);
        let is_same = s_ranco.outcome == foim.outcome && s_ranco.excluded == foim.excluded;
        let suspicions = monitors.0[FOIM].suspicions();
        let mut compared = Compared {
            skies: 1,
            same: u64::from(is_same),
            subsets: u64::from(suspicions.subsets + suspicions.dropped),
            dropped: u64::from(suspicions.dropped),
            ..Compared::default()
        };
        for (tally, verdict) in compared.tallies.iter_mut().zip(&verdicts) {
            tally.book(verdict, faulty);
        }
        comparison.by_faults[faults].add(&compared);
        comparison.by_satellites[place].1.add(&compared);
    }
    Ok(comparison)
}

/// Healthy skies with a false-alarm probability large enough to be measured.
///
/// # Errors
/// When a monitor is not configured.
pub fn false_alarms(seed: u64, trials: u64) -> Result<Vec<FalseAlarms>> {
    let mut monitors = Monitors::new(P_MEASURED, MOST_FAULTS)?;
    let mut all = Vec::new();
    for n in MEASURED_SATELLITES {
        let mut counted = FalseAlarms {
            satellites: n,
            skies: trials,
            suspected: [0; 3],
            detected: [0; 3],
        };
        for trial in 0..trials {
            let random = &mut stream(seed, (n as u64) << 32 | trial);
            let sky = skies::sky(random, n, 1);
            let verdicts = monitors.assess(&sky.noisy(random), &sky.rows)?;
            for (k, verdict) in verdicts.iter().enumerate() {
                // The threshold tells what decided: the suspicions, or the parity test.
                let threshold = if k == 0 {
                    0.0
                } else {
                    suspicion_threshold(n, MEMBERS)
                };
                let is_suspected = verdict.is_detected() && verdict.threshold == Some(threshold);
                counted.suspected[k] += u64::from(is_suspected);
                counted.detected[k] += u64::from(verdict.is_detected());
            }
        }
        all.push(counted);
    }
    Ok(all)
}

/// One bias on each satellite of each epoch in turn.
///
/// # Errors
/// When a monitor is not configured.
pub fn sweep(seed: u64, epochs: &[SkyEpoch], p_false_alarm: f64) -> Result<Vec<SizePoint>> {
    let mut monitors = Monitors::new(p_false_alarm, 1)?;
    let steps = (LARGEST_M / STEP_M) as usize;
    let mut points = Vec::new();
    for step in 0..=steps {
        let mut point = SizePoint {
            size_m: STEP_M * step as f64,
            tallies: [Tally::default(); 3],
        };
        for (number, epoch) in epochs.iter().enumerate() {
            // The same noise for every size.
            let random = &mut stream(seed, number as u64);
            for row in 0..epoch.model.n {
                let mut model = epoch.noisy(random);
                model.residual_m[row] += point.size_m;
                let faulty = if step == 0 {
                    RowSet::EMPTY
                } else {
                    RowSet::EMPTY.with(row)
                };
                let verdicts = monitors.assess(&model, &epoch.rows)?;
                for (tally, verdict) in point.tallies.iter_mut().zip(&verdicts) {
                    tally.book(verdict, faulty);
                }
            }
        }
        points.push(point);
    }
    Ok(points)
}

/// So many biases of one size, either sign, on satellites drawn as often as an epoch has some.
///
/// # Errors
/// When a monitor is not configured.
pub fn several(seed: u64, epochs: &[SkyEpoch], count: usize) -> Result<Vec<SizePoint>> {
    let mut monitors = Monitors::new(P_FALSE_ALARM[0], count)?;
    let mut points = Vec::new();
    for size_m in SIZES_M {
        let mut point = SizePoint {
            size_m,
            tallies: [Tally::default(); 3],
        };
        for (number, epoch) in epochs.iter().enumerate() {
            let random = &mut stream(seed, number as u64);
            for _ in 0..epoch.model.n {
                let mut model = epoch.noisy(random);
                let faulty = drawn_rows(random, epoch.model.n, count);
                for row in &faulty {
                    model.residual_m[*row] += signed_size_m(random, [size_m, size_m]);
                }
                let faulty = faulty.into_iter().fold(RowSet::EMPTY, RowSet::with);
                let verdicts = monitors.assess(&model, &epoch.rows)?;
                for (tally, verdict) in point.tallies.iter_mut().zip(&verdicts) {
                    tally.book(verdict, faulty);
                }
            }
        }
        points.push(point);
    }
    Ok(points)
}

/// The counts of the epoch with the most satellites, with biases on the first of them.
///
/// # Errors
/// When a monitor is not configured.
pub fn counts(seed: u64, epochs: &[SkyEpoch], biases_m: &[f64]) -> Result<Counts> {
    // Reckoning with one fault they count once.
    let mut monitors = Monitors::new(P_FALSE_ALARM[0], 1)?;
    let epoch = epochs
        .iter()
        .max_by_key(|epoch| epoch.model.n)
        .context("six hours without an epoch")?;
    let mut model = epoch.noisy(&mut stream(seed, 0));
    // Every third row: satellites are in order of name, and neighbours often in one plane.
    for (row, bias_m) in (1..).step_by(3).zip(biases_m) {
        model.residual_m[row] += bias_m;
    }
    monitors.assess(&model, &epoch.rows)?;
    let verdicts = Monitors::new(P_FALSE_ALARM[0], biases_m.len())?.assess(&model, &epoch.rows)?;
    let counted = |method: usize| {
        let suspicions = monitors.0[method].suspicions();
        let outliers = suspicions.outliers().iter().copied();
        outliers
            .zip(suspicions.predictions().iter().copied())
            .collect()
    };
    let name = |row: &UsedRow| {
        let satellite = row.satellite;
        format!("{}{:02}", satellite.system().letter(), satellite.prn())
    };
    let bias_of = |row: usize| {
        let place = row.checked_sub(1).filter(|behind| behind % 3 == 0);
        place
            .and_then(|behind| biases_m.get(behind / 3))
            .copied()
            .unwrap_or(0.0)
    };
    let rows = || epoch.rows.iter().enumerate();
    Ok(Counts {
        t_s: epoch.t_s,
        satellites: rows().map(|(k, row)| (name(row), bias_of(k))).collect(),
        threshold: suspicion_threshold(epoch.model.n, MEMBERS),
        s_ranco: counted(S_RANCO),
        foim: counted(FOIM),
        excluded: rows()
            .filter(|(k, _)| verdicts[FOIM].excluded.contains(*k))
            .map(|(_, row)| name(row))
            .collect(),
    })
}

/// All of it.
///
/// # Errors
/// As its parts.
pub fn assess(trials: u64, seed: u64, epochs: &[SkyEpoch]) -> Result<ConsensusResult> {
    let few = (trials / 10).max(1);
    let numbers = || epochs.iter().map(|epoch| epoch.model.n);
    Ok(ConsensusResult {
        campaign: "consensus",
        seed,
        trials,
        comparisons: vec![
            compare(seed, trials, 1)?,
            compare(seed, few, 2)?,
            compare(seed, few, 3)?,
        ],
        false_alarms: false_alarms(seed, trials)?,
        satellites: [numbers().min().unwrap_or(0), numbers().max().unwrap_or(0)],
        sweeps: P_FALSE_ALARM
            .into_iter()
            .map(|p| Ok((p, sweep(seed, epochs, p)?)))
            .collect::<Result<_>>()?,
        several: [2, 3]
            .into_iter()
            .map(|count| Ok((count, several(seed, epochs, count)?)))
            .collect::<Result<_>>()?,
        counts: vec![
            counts(seed, epochs, &[30.0])?,
            counts(seed, epochs, &[30.0, -25.0])?,
            counts(seed, epochs, &[30.0, -25.0, 40.0])?,
        ],
    })
}

/// Runs the campaign under the sky that GPS broadcast, which lies in a folder; writes its result and beside it
/// tables and a picture.
///
/// # Errors
/// When the sky is absent, a monitor is not configured or a file cannot be written.
pub fn run(data: &Path, trials: u64, seed: u64, out: &Path) -> Result<()> {
    let sky = GpsSky::broadcast(&BroadcastSky::read(data)?, MASK_DEG, EVERY_S);
    let result = assess(trials, seed, &sky.epochs)?;
    let figure = report::figure(&result);
    super::write_result(out, &result, report::tables(&result), figure)
}
