//! ARAIM on the measurements of recordings: `surefix campaign araim`.
//!
//! Each epoch of a recording goes to the monitor as it was measured, then, in some of them, with a fault: one
//! satellite drawn at random wrong by 30, 40 or 50 m, either sign, or every satellite of the second constellation wrong
//! in its own way (30 m, one sigma). Counted are alerts without a fault, exclusions right and wrong, faults that pass,
//! errors against the truth above a level, and in how many epochs without a fault LPV-200 is available. Epochs are
//! linearised once, at their snapshot solution: a fault is a number added to a row.
//!
//! A simulator's pseudoranges have no errors: noise of the sigma for accuracy is added to them.
//! `report.rs` prints.

pub mod report;

use std::path::Path;

use anyhow::{Context, Result};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::Serialize;
use surefix_core::config::{Config, IonosphereModel, NoisePreset};
use surefix_core::gnss::System;
use surefix_core::linalg::LinearModel;
use surefix_core::raim::araim::support::{IntegritySupport, user_sigma_m};
use surefix_core::raim::araim::{AraimParameters, MAX_ARAIM_SATELLITES};
use surefix_core::raim::exclusion::RowSet;
use surefix_core::raim::monitors::araim::{AraimConfig, AraimMonitor, PseudorangeErrors};
use surefix_core::raim::monitors::{EpochMonitor, MonitorEpoch, MonitorVerdict, Outcome};

use super::robust::recordings::{self, Place, Prepared, Subject};
use crate::simulate::noise::{normal, uniform};

/// Alert limits of LPV-200, vertical and horizontal, m.
pub const ALERT_LIMITS_M: [f64; 2] = [35.0, 40.0];
/// Largest effective monitor threshold of LPV-200, m.
pub const EMT_LIMIT_M: f64 = 15.0;
/// Largest vertical spread for accuracy of LPV-200, m.
pub const ACCURACY_LIMIT_M: f64 = 1.87;
/// Sizes of a satellite's fault, m.
pub const SIZES_M: [f64; 3] = [30.0, 40.0, 50.0];
/// Spread of the faults of a constellation's satellites, m.
pub const CONSTELLATION_M: f64 = 30.0;
/// Epochs of a recording that get faults, unless told otherwise.
pub const FAULTED_EPOCHS: u64 = 600;

/// How pseudoranges are made and what ARAIM is told.
#[derive(Clone, Copy, Debug)]
pub struct Setup {
    /// In the tables.
    pub name: &'static str,
    /// One frequency or two.
    pub ionosphere: IonosphereModel,
    /// What ARAIM is told.
    pub araim: AraimConfig,
}

/// Version 3 as its studies have it, with exclusion and without; version 4.2 with what is committed; one frequency
/// with the models of the rows.
pub const SETUPS: [Setup; 4] = [
    Setup {
        name: "baseline",
        ionosphere: IonosphereModel::IonosphereFree,
        araim: AraimConfig::LPV_200_V3,
    },
    Setup {
        name: "baseline, detection only",
        ionosphere: IonosphereModel::IonosphereFree,
        araim: AraimConfig {
            excludes: false,
            ..AraimConfig::LPV_200_V3
        },
    },
    Setup {
        name: "committed, exposure 150 s",
        ionosphere: IonosphereModel::IonosphereFree,
        araim: AraimConfig {
            parameters: AraimParameters {
                samples_integrity: 25.0,
                samples_continuity: 25.0,
                ..AraimParameters::LPV_200
            },
            support: IntegritySupport::COMMITTED,
            exposure_s: 150.0,
            ..AraimConfig::LPV_200_V3
        },
    },
    Setup {
        name: "one frequency, broadcast accuracy",
        ionosphere: IonosphereModel::Klobuchar,
        araim: AraimConfig {
            support: IntegritySupport::COMMITTED,
            errors: PseudorangeErrors::Rows,
            ..AraimConfig::LPV_200_V3
        },
    },
];

/// The recordings: `short` takes four hours of the day.
pub fn places(short: bool) -> Vec<Place> {
    let esbc = if short {
        recordings::ESBC_FOUR_HOURS
    } else {
        recordings::ESBC
    };
    let with_galileo = |place: Place| place.as_measured([System::Gps, System::Galileo]);
    vec![
        with_galileo(esbc),
        esbc,
        with_galileo(recordings::NAGOYA),
        recordings::NAGOYA,
        with_galileo(recordings::FLIGHT),
    ]
}

/// What became of epochs of one kind.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Counts {
    /// Epochs.
    pub epochs: u64,
    /// Not tested.
    pub not_tested: u64,
    /// No fault seen.
    pub passed: u64,
    /// A fault seen and not taken out.
    pub alerts: u64,
    /// All faulted rows taken out, and no row but those.
    pub excluded: u64,
    /// All faulted rows taken out, and healthy ones with them.
    pub excluded_more: u64,
    /// Some of the faulted rows taken out, and no healthy one.
    pub excluded_part: u64,
    /// A healthy row taken out and a faulted one left in; or any taken out without a fault.
    pub excluded_wrong: u64,
    /// With levels.
    pub bounded: u64,
    /// Of those, position errors above a level.
    pub above_level: u64,
    /// LPV-200 available: levels, effective monitor threshold and accuracy within their limits.
    pub available: u64,
    /// Sum and largest of the vertical level, m.
    pub vpl_m: [f64; 2],
    /// Sum and largest of the horizontal level, m.
    pub hpl_m: [f64; 2],
    /// Sum and largest of the effective monitor threshold, m.
    pub emt_m: [f64; 2],
    /// Sum and largest of the vertical spread for accuracy, m.
    pub sigma_accuracy_m: [f64; 2],
    /// Largest position error over its level.
    pub largest_ratio: f64,
    /// Largest separation over its threshold.
    pub largest_test_ratio: f64,
}

fn add([sum, largest]: &mut [f64; 2], value: f64) {
    *sum += value;
    *largest = largest.max(value);
}

impl Counts {
    fn book(
        &mut self,
        verdict: &MonitorVerdict,
        monitor: &AraimMonitor,
        faulted: RowSet,
        at_enu_m: [f64; 3],
    ) {
        self.epochs += 1;
        match verdict.outcome {
            Outcome::NotTested(_) => self.not_tested += 1,
            Outcome::Passed => self.passed += 1,
            Outcome::Detected => self.alerts += 1,
            Outcome::Excluded => {
                let has_all = verdict.excluded.contains_all(faulted) && !faulted.is_empty();
                match (has_all, faulted.contains_all(verdict.excluded)) {
                    (true, true) => self.excluded += 1,
                    (true, false) => self.excluded_more += 1,
                    (false, true) => self.excluded_part += 1,
                    (false, false) => self.excluded_wrong += 1,
                }
            }
        }
        if let Some(ratio) = verdict.statistic {
            self.largest_test_ratio = self.largest_test_ratio.max(ratio);
        }
        let (Ok(levels), Some(position_enu_m)) = (verdict.levels, verdict.position_enu_m) else {
            return;
        };
        self.bounded += 1;
        add(&mut self.vpl_m, levels.vpl_m);
        add(&mut self.hpl_m, levels.hpl_m);
        let [east, north, up]: [f64; 3] = core::array::from_fn(|k| at_enu_m[k] + position_enu_m[k]);
        let ratio = (east.hypot(north) / levels.hpl_m).max(up.abs() / levels.vpl_m);
        self.above_level += u64::from(!(ratio <= 1.0));
        self.largest_ratio = self.largest_ratio.max(ratio);
        let Some(whole) = monitor.levels() else {
            return;
        };
        let [_, _, sigma_m] = whole.sigma_accuracy_enu_m;
        // A satellite's own 1e-5 counts as 1e-5.
        let emt_m = whole.emt_prior_tolerant_m;
        add(&mut self.emt_m, emt_m);
        add(&mut self.sigma_accuracy_m, sigma_m);
        let [vertical_m, horizontal_m] = ALERT_LIMITS_M;
        let is_available = levels.vpl_m <= vertical_m
            && levels.hpl_m <= horizontal_m
            && emt_m <= EMT_LIMIT_M
            && sigma_m <= ACCURACY_LIMIT_M;
        self.available += u64::from(is_available);
    }
}

/// A kind of fault, and what became of the epochs that had it.
#[derive(Clone, Debug, Serialize)]
pub struct FaultResult {
    /// In the tables.
    pub fault: String,
    /// Its epochs.
    pub counts: Counts,
}

/// A setup on a recording.
#[derive(Clone, Debug, Serialize)]
pub struct SetupResult {
    /// Its name.
    pub setup: &'static str,
    /// Name of the recording.
    pub recording: &'static str,
    /// Letters of the constellations.
    pub systems: String,
    /// Satellites of an epoch, least and most.
    pub satellites: [usize; 2],
    /// Every epoch without a fault.
    pub healthy: Counts,
    /// Those of them in which a fault was seen: number from 1, separation over threshold, satellites taken out.
    pub seen_without_fault: Vec<String>,
    /// Some with one.
    pub faulted: Vec<FaultResult>,
}

/// Result of the campaign.
#[derive(Clone, Debug, Serialize)]
pub struct AraimResult {
    /// Its name.
    pub campaign: &'static str,
    /// Seed.
    pub seed: u64,
    /// Elevation mask, degrees.
    pub mask_deg: f64,
    /// Each setup on each recording.
    pub results: Vec<SetupResult>,
}

/// Runs the campaign on the recordings in a folder; writes its result and a table beside it.
///
/// # Errors
/// When a recording is absent or unusable, or a file cannot be written.
pub fn run(data: &Path, config: &Config, trials: u64, seed: u64, out: &Path) -> Result<()> {
    let result = assess(data, config, trials, seed, false)?;
    let tables = report::tables(&result);
    print!("{tables}");
    let json = serde_json::to_string_pretty(&result)? + "\n";
    for (path, text) in [(out.to_owned(), json), (out.with_extension("md"), tables)] {
        std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
        println!("written: {}", path.display());
    }
    Ok(())
}

/// Every setup on every recording, with faults in `trials` epochs of each.
///
/// # Errors
/// When a recording is absent or unusable.
pub fn assess(
    data: &Path,
    config: &Config,
    trials: u64,
    seed: u64,
    short: bool,
) -> Result<AraimResult> {
    let mut monitor = Box::new(AraimMonitor::EMPTY);
    let mut results = Vec::new();
    for place in places(short) {
        let mut read: Option<(IonosphereModel, Subject)> = None;
        for setup in &SETUPS {
            if read.as_ref().is_none_or(|(of, _)| *of != setup.ionosphere) {
                let config = Config {
                    ionosphere: setup.ionosphere,
                    noise: NoisePreset::Airborne,
                    ..*config
                };
                read = Some((
                    setup.ionosphere,
                    recordings::read(data, &place, &config, seed)?,
                ));
            }
            let Some((_, subject)) = &read else {
                continue;
            };
            results.push(setup_on(
                &mut monitor,
                setup,
                &place,
                subject,
                trials,
                seed,
            )?);
        }
    }
    Ok(AraimResult {
        campaign: "araim",
        seed,
        mask_deg: config.mask_rad.to_degrees(),
        results,
    })
}

fn setup_on(
    monitor: &mut AraimMonitor,
    setup: &Setup,
    place: &Place,
    subject: &Subject,
    trials: u64,
    seed: u64,
) -> Result<SetupResult> {
    monitor
        .configure(&setup.araim)
        .map_err(|error| anyhow::anyhow!("ARAIM takes no such configuration: {error:?}"))?;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut healthy = Counts::default();
    let mut seen_without_fault = Vec::new();
    let mut faulted: Vec<FaultResult> = SIZES_M
        .iter()
        .map(|size_m| format!("{size_m:.0} m"))
        .chain([format!("all of {}", place.systems[1].letter())])
        .map(|fault| FaultResult {
            fault,
            counts: Counts::default(),
        })
        .collect();
    let every = (subject.epochs.len() / (trials.max(1) as usize)).max(1);
    for (number, epoch) in subject.epochs.iter().enumerate() {
        let mut model = epoch.model.clone();
        if place.is_simulated() {
            add_noise(&mut model, epoch, &setup.araim, &mut random);
        }
        let mut look = |model: &LinearModel, faulted: RowSet, counts: &mut Counts| {
            let given = MonitorEpoch::new(model, &epoch.rows).ok()?;
            let verdict = monitor.assess(&given);
            counts.book(&verdict, monitor, faulted, epoch.at_enu_m);
            Some(verdict)
        };
        if let Some(verdict) = look(&model, RowSet::EMPTY, &mut healthy)
            && verdict.is_detected()
        {
            seen_without_fault.push(seen(number, &verdict, epoch));
        }
        if number % every != 0 {
            continue;
        }
        let taken = taken(epoch);
        for (kind, result) in faulted.iter_mut().enumerate() {
            let mut model = model.clone();
            let rows = match SIZES_M.get(kind) {
                Some(size_m) => {
                    let row = taken[(random.next_u64() % taken.len() as u64) as usize];
                    let is_down = uniform(&mut random) < 0.5;
                    model.residual_m[row] += if is_down { -size_m } else { *size_m };
                    RowSet::EMPTY.with(row)
                }
                None => {
                    let of_second =
                        |row: &&usize| epoch.rows[**row].satellite.system() == place.systems[1];
                    let mut rows = RowSet::EMPTY;
                    for row in taken.iter().filter(of_second) {
                        model.residual_m[*row] += CONSTELLATION_M * normal(&mut random);
                        rows = rows.with(*row);
                    }
                    rows
                }
            };
            let _ = look(&model, rows, &mut result.counts);
        }
    }
    let rows = || subject.epochs.iter().map(|epoch| epoch.rows.len());
    Ok(SetupResult {
        setup: setup.name,
        recording: place.name,
        systems: place.systems.iter().map(|system| system.letter()).collect(),
        satellites: [rows().min().unwrap_or(0), rows().max().unwrap_or(0)],
        healthy,
        seen_without_fault,
        faulted,
    })
}

fn seen(number: usize, verdict: &MonitorVerdict, epoch: &Prepared) -> String {
    let satellites: Vec<String> = verdict
        .excluded
        .iter()
        .filter_map(|row| epoch.rows.get(row))
        .map(|row| {
            let elevation_deg = row.elevation_rad.to_degrees();
            let (letter, prn) = (row.satellite.system().letter(), row.satellite.prn());
            format!("{letter}{prn:02} at {elevation_deg:.0}°")
        })
        .collect();
    let ratio = verdict.statistic.unwrap_or(f64::NAN);
    format!("{} ({ratio:.2}): {}", number + 1, satellites.join(" "))
}

/// The rows that the monitor takes: the highest where there are too many.
fn taken(epoch: &Prepared) -> Vec<usize> {
    let mut rows: Vec<usize> = (0..epoch.rows.len()).collect();
    let elevation = |row: usize| epoch.rows[row].elevation_rad;
    rows.sort_by(|a, b| elevation(*b).total_cmp(&elevation(*a)));
    rows.truncate(MAX_ARAIM_SATELLITES);
    rows
}

/// Errors of one sigma for accuracy.
fn add_noise(
    model: &mut LinearModel,
    epoch: &Prepared,
    config: &AraimConfig,
    random: &mut ChaCha8Rng,
) {
    for (residual_m, row) in model.residual_m.iter_mut().zip(&epoch.rows) {
        let system = row.satellite.system();
        let sigma_m = match config.errors {
            PseudorangeErrors::Rows => row.sigma.independent_m,
            PseudorangeErrors::Support => config.support[system.index()]
                .satellite(
                    system.index(),
                    [0.0; 3],
                    row.elevation_rad,
                    user_sigma_m(system, row.elevation_rad),
                    0.0,
                )
                .variance_accuracy_m2
                .sqrt(),
        };
        *residual_m += sigma_m * normal(random);
    }
}
