//! Robust estimation on recordings with two faulty satellites: `surefix campaign robust`.
//!
//! [P3] section 3: in two windows of the recording (epochs 545 to 645 and 1708 to 1808 of 2880, scaled where
//! it is shorter) two satellites drawn at random get errors of 5 to 100 m, either sign, drawn anew at each epoch.
//! Each epoch is solved by least squares and by robust estimation; position errors, levels and what they
//! fail to bound are counted over the whole recording, once per trial. Then (figure 6) one satellite gets 5 to
//! 100 m at the first epoch of the first window.
//!
//! Every epoch is linearised once, at its solution without faults, and a fault is a number added to a row: at
//! 100 m the curvature left out is below a millimetre. Sigmas are those of the whole error, as [P3] (3) adds
//! them up. `recordings.rs` reads, `report.rs` prints and draws.

pub mod recordings;
pub mod report;

use std::path::Path;

use anyhow::Result;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::Serialize;
use surefix_core::config::Config;
use surefix_core::gnss::{Satellite, System};
use surefix_core::linalg::LinearModel;
use surefix_core::raim::igg3::{
    Igg3Config, Igg3Error, Igg3Workspace, LeastSquaresSolution, ResidualScale, RobustSolution,
};
use surefix_core::raim::monitors::{MonitorLevels, NoLevels};
use surefix_core::raim::reconstructed::LevelConvention;

use crate::simulate::noise::uniform;
use recordings::{Prepared, Subject};

/// Trials unless told otherwise.
pub const TRIALS: u64 = 20;
/// Windows of [P3] with a fault, first and last epoch from 1, of [`EPOCHS_OF_A_DAY`].
pub const WINDOWS: [[usize; 2]; 2] = [[545, 645], [1708, 1808]];
/// Epochs of the recording of [P3].
pub const EPOCHS_OF_A_DAY: usize = 2880;
/// Satellites faulted in a window.
pub const FAULTED: usize = 2;
/// Smallest and largest size of a fault, m: those of figure 6.
pub const SIZES_M: [f64; 2] = [5.0, 100.0];
/// Step of the sweep, m.
pub const SWEEP_STEP_M: f64 = 5.0;
/// Vertical alert limit of LPV-200, m: what [P3] holds levels against.
pub const VERTICAL_LIMIT_M: f64 = 35.0;
/// Horizontal alert limit of LPV-200, m.
pub const HORIZONTAL_LIMIT_M: f64 = 40.0;

/// A way to estimate and to bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Method {
    /// In the tables.
    pub name: &'static str,
    /// `None` is least squares.
    pub estimator: Option<Igg3Config>,
    /// The levels.
    pub levels: LevelConvention,
}

/// Least squares and robust estimation, each as printed and as corrected.
pub const METHODS: [Method; 5] = [
    Method {
        name: "least squares, levels as printed",
        estimator: None,
        levels: LevelConvention::PRINTED,
    },
    Method {
        name: "least squares, levels corrected",
        estimator: None,
        levels: LevelConvention::CORRECTED,
    },
    Method {
        name: "robust, as printed",
        estimator: Some(Igg3Config::PRINTED),
        levels: LevelConvention::PRINTED,
    },
    Method {
        name: "robust, corrected",
        estimator: Some(Igg3Config::CORRECTED),
        levels: LevelConvention::CORRECTED,
    },
    Method {
        name: "robust, corrected, residuals scaled by their own spread",
        estimator: Some(Igg3Config {
            scale: ResidualScale::Posterior,
            ..Igg3Config::CORRECTED
        }),
        levels: LevelConvention::CORRECTED,
    },
];

/// What became of the epochs of a method, of one kind (with a fault, or without).
#[derive(Clone, Debug, Default, Serialize)]
pub struct Counts {
    /// Epochs.
    pub epochs: u64,
    /// With a position.
    pub solved: u64,
    /// With levels.
    pub bounded: u64,
    /// Levels within both alert limits of LPV-200.
    pub within_limits: u64,
    /// Vertical level within its limit.
    pub vertical_within: u64,
    /// Horizontal or vertical error above its level.
    pub above_level: u64,
    /// Horizontal error above its level.
    pub above_hpl: u64,
    /// Vertical error above its level.
    pub above_vpl: u64,
    /// A healthy row has weight zero.
    pub healthy_out: u64,
    /// A faulted row has a weight.
    pub faulted_in: u64,
    /// Too many rows of weight zero.
    pub breakdown: u64,
    /// The weights did not settle.
    pub not_converged: u64,
    /// A row beyond k₁ was kept in.
    pub outlier_kept: u64,
    /// Sum and maximum of the vertical level, m.
    pub vpl_sum_m: f64,
    /// Maximum of the vertical level, m.
    pub vpl_max_m: f64,
    /// Sum of solutions computed.
    pub iterations: u64,
}

/// Position errors of a method over a recording.
#[derive(Clone, Debug, Serialize)]
pub struct Accuracy {
    /// 95 % of the absolute error, east, north, up, m.
    pub p95_m: [f64; 3],
    /// Root mean square, east, north, up, m.
    pub rms_m: [f64; 3],
}

/// A method on a recording.
#[derive(Clone, Debug, Serialize)]
pub struct MethodResult {
    /// Its name.
    pub method: &'static str,
    /// Over all epochs that have a position.
    pub accuracy: Accuracy,
    /// Over those with a fault.
    pub accuracy_with_fault: Accuracy,
    /// Epochs without a fault, once.
    pub healthy: Counts,
    /// Epochs with a fault, of all trials.
    pub faulted: Counts,
}

/// A size of the sweep.
#[derive(Clone, Debug, Serialize)]
pub struct SweepPoint {
    /// Size of the fault, m.
    pub size_m: f64,
    /// Vertical level of each method, m.
    pub vpl_m: Vec<Option<f64>>,
    /// Vertical error of each method, m.
    pub up_error_m: Vec<Option<f64>>,
    /// Of the same fault on every satellite in turn: how many, and per method how often an error is above its
    /// level.
    pub satellites: u64,
    /// See there.
    pub above_level: Vec<u64>,
    /// Per method, how often the vertical level is within its limit.
    pub vertical_within: Vec<u64>,
}

/// An epoch of the first trial, for the picture.
#[derive(Clone, Debug)]
pub struct SeriesPoint {
    /// From 1.
    pub epoch: usize,
    /// Vertical level of each method, m.
    pub vpl_m: Vec<Option<f64>>,
    /// Vertical error of each method, m.
    pub up_error_m: Vec<Option<f64>>,
}

/// A recording.
#[derive(Clone, Debug, Serialize)]
pub struct SubjectResult {
    /// Its name.
    pub recording: String,
    /// What it is, in words.
    pub about: &'static str,
    /// Epochs with a solution.
    pub epochs: usize,
    /// Satellites of an epoch, least and most.
    pub satellites: [usize; 2],
    /// First and last epoch of each window, from 1.
    pub windows: [[usize; 2]; 2],
    /// Of each method.
    pub methods: Vec<MethodResult>,
    /// The satellite of the sweep.
    pub sweep_satellite: String,
    /// By size.
    pub sweep: Vec<SweepPoint>,
    /// Of the first trial.
    #[serde(skip)]
    pub series: Vec<SeriesPoint>,
}

/// Result of the campaign.
#[derive(Clone, Debug, Serialize)]
pub struct RobustResult {
    /// Its name.
    pub campaign: &'static str,
    /// Seed.
    pub seed: u64,
    /// Trials of each recording.
    pub trials: u64,
    /// By recording.
    pub subjects: Vec<SubjectResult>,
}

/// A position with levels, and what was left out.
struct Answer {
    error_enu_m: [f64; 3],
    levels: Result<MonitorLevels, NoLevels>,
    robust: Option<RobustSolution>,
}

/// What one method makes of an epoch.
fn answer(
    method: &Method,
    model: &LinearModel,
    at_enu_m: [f64; 3],
    workspace: &mut Igg3Workspace,
) -> Result<Answer, Igg3Error> {
    let moved = |by: [f64; 3]| core::array::from_fn(|k| at_enu_m[k] + by[k]);
    match &method.estimator {
        None => {
            let start: LeastSquaresSolution = workspace.least_squares(model)?;
            Ok(Answer {
                error_enu_m: moved(start.position_enu_m),
                levels: method.levels.levels(&start.fit, &start.cofactor_enu_m2),
                robust: None,
            })
        }
        Some(config) => {
            let robust = workspace.estimate(model, config)?;
            let levels = if !robust.kept_outliers.is_empty() {
                Err(NoLevels::FaultPresent)
            } else if let Some(row) = workspace.untestable_row() {
                Err(NoLevels::Untestable { row })
            } else {
                method.levels.levels(&robust.fit, &robust.cofactor_enu_m2)
            };
            Ok(Answer {
                error_enu_m: moved(robust.position_enu_m),
                levels,
                robust: Some(robust),
            })
        }
    }
}

/// Whether the horizontal and the vertical error are above their levels.
fn above([east, north, up]: [f64; 3], levels: &MonitorLevels) -> [bool; 2] {
    [east.hypot(north) > levels.hpl_m, up.abs() > levels.vpl_m]
}

impl Counts {
    fn book(&mut self, answer: &Result<Answer, Igg3Error>, faulted: &[usize], rows: usize) {
        self.epochs += 1;
        let answer = match answer {
            Ok(answer) => answer,
            Err(error) => {
                self.breakdown += u64::from(matches!(error, Igg3Error::Breakdown { .. }));
                self.not_converged += u64::from(*error == Igg3Error::NotConverged);
                return;
            }
        };
        self.solved += 1;
        if let Some(robust) = &answer.robust {
            let out = |row: usize| robust.zeroed.contains(row);
            let healthy_out = (0..rows).any(|row| out(row) && !faulted.contains(&row));
            self.healthy_out += u64::from(healthy_out);
            self.faulted_in += u64::from(faulted.iter().any(|row| !out(*row)));
            self.outlier_kept += u64::from(!robust.kept_outliers.is_empty());
            self.iterations += robust.iterations as u64;
        }
        let Ok(levels) = &answer.levels else {
            return;
        };
        self.bounded += 1;
        let vertical = levels.vpl_m < VERTICAL_LIMIT_M;
        self.vertical_within += u64::from(vertical);
        self.within_limits += u64::from(vertical && levels.hpl_m < HORIZONTAL_LIMIT_M);
        let [horizontal, vertical] = above(answer.error_enu_m, levels);
        self.above_hpl += u64::from(horizontal);
        self.above_vpl += u64::from(vertical);
        self.above_level += u64::from(horizontal || vertical);
        self.vpl_sum_m += levels.vpl_m;
        self.vpl_max_m = self.vpl_max_m.max(levels.vpl_m);
    }
}

/// Errors of a method.
#[derive(Clone, Default)]
struct Errors([Vec<f64>; 3]);

impl Errors {
    fn push(&mut self, error_enu_m: [f64; 3]) {
        for (list, error) in self.0.iter_mut().zip(error_enu_m) {
            list.push(error);
        }
    }

    fn accuracy(mut self) -> Accuracy {
        let rms_m = core::array::from_fn(|k| {
            let squares: f64 = self.0[k].iter().map(|e| e * e).sum();
            (squares / self.0[k].len().max(1) as f64).sqrt()
        });
        let p95_m = core::array::from_fn(|k| {
            let list = &mut self.0[k];
            list.iter_mut().for_each(|e| *e = e.abs());
            list.sort_by(f64::total_cmp);
            let index = (0.95 * list.len() as f64).ceil() as usize;
            list.get(index.saturating_sub(1))
                .copied()
                .unwrap_or(f64::NAN)
        });
        Accuracy { p95_m, rms_m }
    }
}

/// The windows of a recording of so many epochs, from 1.
pub fn windows(epochs: usize) -> [[usize; 2]; 2] {
    if epochs >= WINDOWS[1][1] {
        return WINDOWS;
    }
    let scaled = |epoch: usize| (epoch * epochs).div_ceil(EPOCHS_OF_A_DAY).max(1);
    WINDOWS.map(|[first, last]| [scaled(first), scaled(last)])
}

/// Two satellites used at every epoch of a window.
fn draw(
    prepared: &[Prepared],
    [first, last]: [usize; 2],
    random: &mut ChaCha8Rng,
) -> Vec<Satellite> {
    let window = &prepared[first - 1..last];
    let mut always: Vec<Satellite> = window[0].rows.iter().map(|row| row.satellite).collect();
    always.retain(|satellite| {
        window
            .iter()
            .all(|epoch| epoch.row_of(*satellite).is_some())
    });
    let mut drawn = Vec::new();
    while drawn.len() < FAULTED && !always.is_empty() {
        let index = (random.next_u64() % always.len() as u64) as usize;
        drawn.push(always.swap_remove(index));
    }
    drawn
}

/// The epochs of a trial with a fault: number from 0, rows, model.
fn faulted_epochs(
    prepared: &[Prepared],
    windows: [[usize; 2]; 2],
    seed: u64,
    trial: u64,
) -> Vec<(usize, Vec<usize>, Box<LinearModel>)> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(trial);
    let mut epochs = Vec::new();
    for window in windows {
        let satellites = draw(prepared, window, &mut random);
        for number in window[0] - 1..window[1] {
            let epoch = &prepared[number];
            let mut model = epoch.model.clone();
            let mut rows = Vec::new();
            for satellite in &satellites {
                let [least, most] = SIZES_M;
                let size_m = least + (most - least) * uniform(&mut random);
                let sign = if uniform(&mut random) < 0.5 {
                    -1.0
                } else {
                    1.0
                };
                if let Some(row) = epoch.row_of(*satellite) {
                    model.residual_m[row] += sign * size_m;
                    rows.push(row);
                }
            }
            epochs.push((number, rows, model));
        }
    }
    epochs
}

/// Runs the campaign on the recordings in a folder; writes its result and beside it tables and a picture.
///
/// # Errors
/// When a recording is absent or unusable, or a file cannot be written.
pub fn run(data: &Path, config: &Config, trials: u64, seed: u64, out: &Path) -> Result<()> {
    let subjects = recordings::subjects(data, config, seed, false)?;
    let result = RobustResult {
        campaign: "robust",
        seed,
        trials,
        subjects: subjects
            .iter()
            .map(|subject| assess(subject, trials, seed))
            .collect(),
    };
    super::write_result(
        out,
        &result,
        report::tables(&result),
        report::figure(&result),
    )
}

/// The experiments of [P3] on one recording.
pub fn assess(subject: &Subject, trials: u64, seed: u64) -> SubjectResult {
    let prepared = &subject.epochs;
    let windows = windows(prepared.len());
    let mut workspace = Box::new(Igg3Workspace::EMPTY);
    let mut healthy = vec![Counts::default(); METHODS.len()];
    let mut faulted = vec![Counts::default(); METHODS.len()];
    let mut errors = vec![Errors::default(); METHODS.len()];
    let mut errors_with_fault = vec![Errors::default(); METHODS.len()];
    let mut series = Vec::new();

    // Without a fault everything is the same in every trial.
    let mut clean: Vec<Vec<Option<[f64; 3]>>> = Vec::new();
    for (number, epoch) in prepared.iter().enumerate() {
        let mut point = SeriesPoint::new(number);
        let mut positions = Vec::new();
        for (method, counts) in METHODS.iter().zip(&mut healthy) {
            let answer = answer(method, &epoch.model, epoch.at_enu_m, &mut workspace);
            counts.book(&answer, &[], epoch.rows.len());
            point.push(&answer);
            positions.push(answer.ok().map(|answer| answer.error_enu_m));
        }
        clean.push(positions);
        series.push(point);
    }
    for trial in 0..trials {
        let mut touched = vec![false; prepared.len()];
        for (number, rows, model) in faulted_epochs(prepared, windows, seed, trial) {
            touched[number] = true;
            let epoch = &prepared[number];
            let mut point = SeriesPoint::new(number);
            for (k, method) in METHODS.iter().enumerate() {
                let answer = answer(method, &model, epoch.at_enu_m, &mut workspace);
                faulted[k].book(&answer, &rows, epoch.rows.len());
                point.push(&answer);
                if let Ok(answer) = &answer {
                    errors[k].push(answer.error_enu_m);
                    errors_with_fault[k].push(answer.error_enu_m);
                }
            }
            if trial == 0 {
                series[number] = point;
            }
        }
        for (positions, _) in clean.iter().zip(touched).filter(|(_, touched)| !touched) {
            for (errors, position) in errors.iter_mut().zip(positions) {
                if let Some(error_enu_m) = position {
                    errors.push(*error_enu_m);
                }
            }
        }
    }

    let methods = METHODS
        .iter()
        .zip(healthy.into_iter().zip(faulted))
        .zip(errors.into_iter().zip(errors_with_fault))
        .map(
            |((method, (healthy, faulted)), (all, with_fault))| MethodResult {
                method: method.name,
                accuracy: all.accuracy(),
                accuracy_with_fault: with_fault.accuracy(),
                healthy,
                faulted,
            },
        )
        .collect();
    let rows = || prepared.iter().map(|epoch| epoch.rows.len());
    let (sweep_satellite, sweep) = sweep(&prepared[windows[0][0] - 1], &mut workspace);
    SubjectResult {
        recording: subject.name.to_owned(),
        about: subject.about,
        epochs: prepared.len(),
        satellites: [rows().min().unwrap_or(0), rows().max().unwrap_or(0)],
        windows,
        methods,
        sweep_satellite,
        sweep,
        series,
    }
}

impl SeriesPoint {
    fn new(number: usize) -> Self {
        Self {
            epoch: number + 1,
            vpl_m: Vec::new(),
            up_error_m: Vec::new(),
        }
    }

    fn push(&mut self, answer: &Result<Answer, Igg3Error>) {
        let answer = answer.as_ref().ok();
        let level = answer.and_then(|answer| answer.levels.ok());
        self.vpl_m.push(level.map(|levels| levels.vpl_m));
        self.up_error_m
            .push(answer.map(|answer| answer.error_enu_m[2]));
    }
}

/// [P3] figure 6: a growing fault at one epoch, on G02 if it is there, else on the first GPS satellite; and the
/// same on every satellite in turn.
fn sweep(epoch: &Prepared, workspace: &mut Igg3Workspace) -> (String, Vec<SweepPoint>) {
    let of_gps = || {
        let rows = epoch.rows.iter().map(|row| row.satellite);
        rows.filter(|satellite| satellite.system() == System::Gps)
    };
    let chosen = of_gps()
        .find(|satellite| satellite.prn() == 2)
        .or_else(|| of_gps().next());
    let steps = (SIZES_M[1] / SWEEP_STEP_M) as usize;
    let points = (0..=steps)
        .map(|step| {
            let size_m = SWEEP_STEP_M * step as f64;
            let mut point = SweepPoint {
                size_m,
                vpl_m: Vec::new(),
                up_error_m: Vec::new(),
                satellites: epoch.rows.len() as u64,
                above_level: vec![0; METHODS.len()],
                vertical_within: vec![0; METHODS.len()],
            };
            for (row, used) in epoch.rows.iter().enumerate() {
                let mut model = epoch.model.clone();
                model.residual_m[row] += size_m;
                for (k, method) in METHODS.iter().enumerate() {
                    let answer = answer(method, &model, epoch.at_enu_m, workspace).ok();
                    let levels = answer.as_ref().and_then(|answer| answer.levels.ok());
                    if let (Some(answer), Some(levels)) = (&answer, &levels) {
                        let [horizontal, vertical] = above(answer.error_enu_m, levels);
                        point.above_level[k] += u64::from(horizontal || vertical);
                        point.vertical_within[k] += u64::from(levels.vpl_m < VERTICAL_LIMIT_M);
                    }
                    if Some(used.satellite) == chosen {
                        point.vpl_m.push(levels.map(|levels| levels.vpl_m));
                        point
                            .up_error_m
                            .push(answer.map(|answer| answer.error_enu_m[2]));
                    }
                }
            }
            point
        })
        .collect();
    let name = chosen.map_or_else(String::new, |satellite| {
        format!("{}{:02}", satellite.system().letter(), satellite.prn())
    });
    (name, points)
}
