//! VPL-based solution separation on GPS skies of six hours: `surefix campaign vpl-mhss`.
//!
//! [P4] section 3.2: figure 7 states the vertical level without a fault at elevation masks of 5° and 10°,
//! figure 9 how often an error of 0 to 40 m on one satellite is found. Here each satellite in turn has
//! an error of each size, of either sign, at every minute of six hours, on top of noise that is drawn once per
//! satellite and epoch; and healthy epochs are counted for false exclusions. The rule as printed (the set
//! of smallest level wins) and the rule with a margin ([`surefix_core::raim::vpl_mhss`]) see the same epochs.
//!
//! [P4] states neither its almanac nor its sigma. Skies: that of the simulator ([`super::gps_hours`]) and that of a
//! day (`sky.rs`), which has more satellites. The sigma is what the position errors and dilutions of
//! precision of [P4] say together, [`SIGMA_M`]. `report.rs` prints and draws.

pub mod report;
pub mod sky;

use std::path::Path;

use anyhow::Result;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::Serialize;
use surefix_core::raim::RaimError;
use surefix_core::raim::monitors::vpl_mhss::VplConfig;
use surefix_core::raim::vpl_mhss::{VplSeparation, VplTest};

use super::gps_hours::{self, DURATION_S, PLACE, SkyEpoch};
use crate::simulate::noise::uniform;
use sky::BroadcastSky;

/// Trials unless told otherwise.
pub const TRIALS: u64 = 20;
/// Sigma of a pseudorange, m: [P4] 3.2 has 0.987 m of height at a VDOP of 1.129 (0.87 m), and
/// 0.532 m by 0.594 m at an HDOP of 0.876 (0.91 m).
pub const SIGMA_M: f64 = 0.9;
/// Masks of figure 7, degrees.
pub const MASKS_DEG: [f64; 2] = [5.0, 10.0];
/// Largest error of figure 9, m.
pub const LARGEST_M: u32 = 40;
/// Between epochs, s.
const STEP_S: u32 = 60;
/// Healthy epochs per geometry and trial.
const HEALTHY_DRAWS: u64 = 50;
/// The probability that acceptance of a false exclusion is stated with.
pub const P_ACCEPTED: f64 = 1e-3;
/// Latitudes and longitudes of the world's grid are so far apart, degrees.
const GRID_DEG: usize = 10;

/// How often a rule leaves out which satellite.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Exclusions {
    /// The faulty one.
    pub right: u64,
    /// A healthy one.
    pub wrong: u64,
}

impl Exclusions {
    fn book(&mut self, excluded: Option<usize>, faulty: Option<usize>) {
        if excluded.is_some() {
            let is_right = excluded == faulty;
            self.right += u64::from(is_right);
            self.wrong += u64::from(!is_right);
        }
    }

    /// Of either kind.
    pub fn total(&self) -> u64 {
        self.right + self.wrong
    }
}

/// Smallest, largest and mean of levels.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Levels {
    /// Levels, by their weights.
    weight: f64,
    sum_m: f64,
    /// Smallest, m.
    pub least_m: f64,
    /// Largest, m.
    pub most_m: f64,
}

impl Default for Levels {
    fn default() -> Self {
        Self {
            weight: 0.0,
            sum_m: 0.0,
            least_m: f64::INFINITY,
            most_m: 0.0,
        }
    }
}

impl Levels {
    fn book(&mut self, level_m: f64, weight: f64) {
        if level_m.is_finite() {
            self.weight += weight;
            self.sum_m += weight * level_m;
            self.least_m = self.least_m.min(level_m);
            self.most_m = self.most_m.max(level_m);
        }
    }

    /// Mean, m.
    pub fn mean_m(&self) -> f64 {
        self.sum_m / self.weight
    }
}

/// An error of one size.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct SizePoint {
    /// Its size, m.
    pub size_m: f64,
    /// Epochs with it, one per satellite and geometry.
    pub epochs: u64,
    /// The level exceeds its threshold, or a satellite is left out.
    pub detected: u64,
    /// By the rule with a margin.
    pub with_margin: Exclusions,
    /// By the smallest level alone.
    pub as_printed: Exclusions,
    /// Level of all satellites.
    pub full: Levels,
    /// Smallest level of a set that lacks one.
    pub smallest: Levels,
}

/// Epochs without a fault.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Healthy {
    /// The monitor's probability of a false alarm.
    pub p_false_alarm: f64,
    /// Epochs.
    pub epochs: u64,
    /// The level exceeds its threshold, or a satellite is left out.
    pub alarms: u64,
    /// By the rule with a margin.
    pub with_margin: u64,
    /// By the smallest level alone.
    pub as_printed: u64,
}

/// Levels of one kind, without a fault.
#[derive(Clone, Debug, Serialize)]
pub struct LevelRow {
    /// Where.
    pub place: &'static str,
    /// How sigma depends on elevation.
    pub law: &'static str,
    /// What is called level.
    pub kind: &'static str,
    /// By mask of [`MASKS_DEG`], over place and time, for a sigma of 1 m at the zenith.
    pub levels: [Levels; 2],
}

/// A sky above a mask.
#[derive(Clone, Debug, Serialize)]
pub struct SkyResult {
    /// Name of the sky.
    pub sky: &'static str,
    /// What it is.
    pub about: String,
    /// Elevation mask, degrees.
    pub mask_deg: f64,
    /// Satellites: least, most.
    pub satellites: [usize; 2],
    /// Mean number of satellites.
    pub mean_satellites: f64,
    /// By size of the error.
    pub sizes: Vec<SizePoint>,
    /// By probability of a false alarm.
    pub healthy: Vec<Healthy>,
}

/// Result of the campaign.
#[derive(Clone, Debug, Serialize)]
pub struct VplResult {
    /// Its name.
    pub campaign: &'static str,
    /// Seed.
    pub seed: u64,
    /// Trials.
    pub trials: u64,
    /// Sigma of a pseudorange, m.
    pub sigma_m: f64,
    /// By sky and mask.
    pub skies: Vec<SkyResult>,
    /// Figure 7, on the broadcast sky.
    pub levels: Vec<LevelRow>,
}

fn separation(p_false_alarm: f64) -> Box<VplSeparation> {
    let mut separation = Box::new(VplSeparation::EMPTY);
    if let Err(error) = separation.configure(VplConfig::PRESET.p_level, p_false_alarm) {
        unreachable!("the probabilities are constants: {error:?}");
    }
    separation
}

/// A sky above a mask, for the experiments.
pub struct GpsSky {
    /// In the tables.
    pub name: &'static str,
    /// What it is.
    pub about: String,
    /// Elevation mask, degrees.
    pub mask_deg: f64,
    /// Epochs of six hours, all rows of [`SIGMA_M`].
    pub epochs: Vec<SkyEpoch>,
}

impl GpsSky {
    /// The slots that every simulation flies under.
    pub fn simulated(mask_deg: f64, step_s: u32) -> Self {
        let mut epochs = gps_hours::epochs(mask_deg, step_s);
        for epoch in &mut epochs {
            epoch.model.sigma_m.fill(SIGMA_M);
        }
        Self {
            name: "24 slots",
            about: "the nominal constellation of the simulator".into(),
            mask_deg,
            epochs,
        }
    }

    /// What was broadcast on a day.
    pub fn broadcast(sky: &BroadcastSky, mask_deg: f64, step_s: u32) -> Self {
        let times = (0..DURATION_S).step_by(step_s as usize).map(f64::from);
        Self {
            name: "broadcast",
            about: format!(
                "what GPS broadcast on 25 June 2020, {} satellites",
                sky.satellites()
            ),
            mask_deg,
            epochs: times
                .map(|t_s| sky.epoch(t_s, PLACE, mask_deg, |_| SIGMA_M))
                .collect(),
        }
    }
}

/// The experiments of [P4] on one sky.
pub fn assess(sky: &GpsSky, trials: u64, seed: u64) -> SkyResult {
    let counts = || sky.epochs.iter().map(|epoch| epoch.model.n);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    SkyResult {
        sky: sky.name,
        about: sky.about.clone(),
        mask_deg: sky.mask_deg,
        satellites: [counts().min().unwrap_or(0), counts().max().unwrap_or(0)],
        mean_satellites: counts().sum::<usize>() as f64 / sky.epochs.len() as f64,
        sizes: sizes(&sky.epochs, trials, &mut random),
        healthy: [P_ACCEPTED, VplConfig::PRESET.p_false_alarm]
            .map(|p| healthy(&sky.epochs, p, trials, &mut random))
            .to_vec(),
    }
}

/// Every size of error on every satellite.
fn sizes(epochs: &[SkyEpoch], trials: u64, random: &mut ChaCha8Rng) -> Vec<SizePoint> {
    let mut separation = separation(VplConfig::PRESET.p_false_alarm);
    let mut points: Vec<SizePoint> = (0..=LARGEST_M)
        .map(|size_m| SizePoint {
            size_m: f64::from(size_m),
            ..SizePoint::default()
        })
        .collect();
    for _ in 0..trials {
        for epoch in epochs {
            for faulty in 0..epoch.model.n {
                let mut model = epoch.noisy(random);
                let sign = if uniform(random) < 0.5 { -1.0 } else { 1.0 };
                let without_m = model.residual_m[faulty];
                for point in &mut points {
                    model.residual_m[faulty] = without_m + sign * point.size_m;
                    if let Ok(test) = separation.test(&model) {
                        point.book(&test, faulty);
                    }
                }
            }
        }
    }
    points
}

impl SizePoint {
    fn book(&mut self, test: &VplTest, faulty: usize) {
        self.epochs += 1;
        self.detected += u64::from(!test.passes());
        self.with_margin.book(test.excluded(), Some(faulty));
        self.as_printed
            .book(test.excluded_as_printed(), Some(faulty));
        self.full.book(test.vpl_m, 1.0);
        let smallest = test.smallest.map_or(f64::NAN, |without| without.vpl_m);
        self.smallest.book(smallest, 1.0);
    }
}

fn healthy(
    epochs: &[SkyEpoch],
    p_false_alarm: f64,
    trials: u64,
    random: &mut ChaCha8Rng,
) -> Healthy {
    let mut separation = separation(p_false_alarm);
    let mut healthy = Healthy {
        p_false_alarm,
        epochs: 0,
        alarms: 0,
        with_margin: 0,
        as_printed: 0,
    };
    for epoch in epochs {
        for _ in 0..trials * HEALTHY_DRAWS {
            let Ok(test) = separation.test(&epoch.noisy(random)) else {
                break;
            };
            healthy.epochs += 1;
            healthy.alarms += u64::from(!test.passes());
            healthy.with_margin += u64::from(test.excluded().is_some());
            healthy.as_printed += u64::from(test.excluded_as_printed().is_some());
        }
    }
    healthy
}

/// What can be called the vertical level of an epoch without a fault.
const KINDS: [&str; 3] = [
    "k_v σ_v of all",
    "largest over one left out, no errors",
    "largest over one left out, errors of one sigma",
];

/// How a sigma may depend on elevation: its exponent of 1/sin E.
const LAWS: [(&str, i32); 2] = [("constant", 0), ("1/sin E", 1)];

/// Levels without a fault by place, law and kind.
pub fn levels(sky: &BroadcastSky, step_s: u32, seed: u64) -> Vec<LevelRow> {
    let mut separation = separation(VplConfig::PRESET.p_false_alarm);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut rows = Vec::new();
    let (_, _, height_m) = PLACE;
    let world: Vec<_> = (-80..=80)
        .step_by(GRID_DEG)
        .flat_map(|latitude| {
            (-180..180)
                .step_by(GRID_DEG)
                .map(move |longitude| (f64::from(latitude), f64::from(longitude), height_m))
        })
        .collect();
    // The world is large enough to look less often.
    for (place, places, step_s) in [
        ("place of [P4]", &[PLACE][..], step_s),
        ("world", &world[..], 10 * step_s),
    ] {
        for (law, exponent) in LAWS {
            let mut levels = [[Levels::default(); 2]; KINDS.len()];
            for at in places {
                // Parallels are shorter towards the poles.
                let weight = libm::cos(at.0.to_radians());
                for t_s in (0..DURATION_S).step_by(step_s as usize) {
                    for (mask, mask_deg) in MASKS_DEG.into_iter().enumerate() {
                        let epoch = sky.epoch(f64::from(t_s), *at, mask_deg, |sin_elevation| {
                            sin_elevation.powi(-exponent)
                        });
                        let found = kinds_m(&epoch, &mut separation, &mut random);
                        for (levels, level_m) in levels.iter_mut().zip(found) {
                            levels[mask].book(level_m, weight);
                        }
                    }
                }
            }
            rows.extend(KINDS.iter().zip(levels).map(|(kind, levels)| LevelRow {
                place,
                law,
                kind,
                levels,
            }));
        }
    }
    rows
}

/// Levels of the kinds of [`KINDS`]; NaN where there is none.
fn kinds_m(
    epoch: &SkyEpoch,
    separation: &mut VplSeparation,
    random: &mut ChaCha8Rng,
) -> [f64; KINDS.len()] {
    let level_m = |test: Result<VplTest, RaimError>| match test {
        Ok(test) if test.untestable.is_none() => test.vpl_m,
        _ => f64::NAN,
    };
    let without_errors_m = level_m(separation.test(&epoch.model));
    let alone_m = separation.k_vertical() * separation.sigma_up_m();
    let with_errors_m = level_m(separation.test(&epoch.noisy(random)));
    [alone_m, without_errors_m, with_errors_m]
}

/// Runs the campaign on the simulator's sky and on that of a day; writes its result and beside it tables
/// and a picture.
///
/// # Errors
/// When the navigation file is absent or unusable, or a file cannot be written.
pub fn run(data: &Path, trials: u64, seed: u64, out: &Path) -> Result<()> {
    let sky = BroadcastSky::read(data)?;
    let skies = MASKS_DEG.map(|mask_deg| GpsSky::broadcast(&sky, mask_deg, STEP_S));
    let slots = MASKS_DEG.map(|mask_deg| GpsSky::simulated(mask_deg, STEP_S));
    let result = VplResult {
        campaign: "vpl-mhss",
        seed,
        trials,
        sigma_m: SIGMA_M,
        skies: skies
            .iter()
            .chain(&slots)
            .map(|sky| assess(sky, trials, seed))
            .collect(),
        levels: levels(&sky, STEP_S, seed),
    };
    super::write_result(
        out,
        &result,
        report::tables(&result),
        report::figure(&result),
    )
}
