//! The snapshot monitor: one epoch in, a position and a verdict on it out, no memory of earlier epochs
//! but where to start the iteration. Who was excluded before is told to it (`readmission.rs`).
//!
//! ```text
//! epoch ─► solution ─► detection ──passes──────────────────────────► levels ─► verdict
//!                          └─fails─► exclusion ─► solution without ─► detection ─┘
//! ```
//!
//! Why it tests, excludes and bounds as it does: docs/decisions/002-snapshot-monitor.md.
//! Levels: `raim/level.rs`.

use crate::budget::{CycleCounter, Ledger, STAGES, Stage};
use crate::config::{Config, ConfigError};
use crate::consts::{MAX_CLOCKS, MAX_SATELLITES, SPEED_OF_LIGHT_MPS};
use crate::gnss::solution::{
    SATELLITE_REASONS, SnapshotError, SnapshotSolution, SnapshotWorkspace,
};
use crate::gnss::{BroadcastIonosphere, EphemerisStore, ObservationEpoch, Satellite, SatelliteSet};
use crate::ins::AidUse;
use crate::integrity::{
    Integrity, NoBound, PhaseRequirements, ProtectionLevel, Reason, Suspect, Verdict,
};
use crate::linalg::LinearModel;
use crate::linalg::qr::WhitenedQr;
use crate::raim::bias::{self, BiasEstimate};
use crate::raim::exclusion::{self, ExclusionWorkspace, MAX_FAULTS};
use crate::raim::level::LevelFactors;
use crate::raim::slope::{NoLevel, Sensitivity};
use crate::raim::thresholds::RaimTable;
use crate::raim::{RaimError, TestStatistic, bounded, parity};
use crate::stats::StatsError;
use crate::time::{GpsTime, NS_PER_S};

mod height;

pub use height::{CalibratedHeight, HeightCalibration};

const _: () = assert!(MAX_FAULTS == 3, "Config::check knows the same limit");

/// Farthest a receiver clock may lie from GPST, m: 2 ms. Receivers steer it or let it jump within one
/// millisecond. A pseudorange error common to all satellites looks like a clock and shows in no
/// residual, but dates the satellites wrongly: at 800 m/s of range rate 2 ms are 1.6 m, 10 ms are 8 m,
/// beyond any level.
///
/// A receiver that lets its clock run measures at round instants of the true time, and its time tags say how
/// far the clock is off: they are no multiples of [`ROUND_NS`], and the clock has to lie near what is over.
pub const MAX_RECEIVER_CLOCK_M: f64 = 2.0e-3 * SPEED_OF_LIGHT_MPS;
/// Instants at which receivers measure, a divisor of the intervals of 1, 2, 4, 5, 8, 10 and 20 Hz, ns.
pub const ROUND_NS: i64 = 25_000_000;
/// Farthest the clocks against two systems may lie apart, m: 10 µs. The systems keep within 100 ns of
/// each other, receivers delay their signals differently by up to a few microseconds.
pub const MAX_INTER_SYSTEM_M: f64 = 1.0e-5 * SPEED_OF_LIGHT_MPS;

/// A barometer is calibrated against satellites with this redundancy at least.
const LEARNING_REDUNDANCY: usize = 2;

/// Why a monitor could not be configured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ConfigureError {
    /// A value is out of its range.
    Config(ConfigError),
    /// The risks of the phase of flight give no threshold.
    Stats(StatsError),
}

/// What the monitor says of one epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Assessment {
    /// The position, if there is one; after an exclusion the one without the excluded satellites.
    pub solution: Option<SnapshotSolution>,
    /// What to think of it.
    pub verdict: Verdict,
    /// Whether the range rates contradict each other, at the false-alarm probability of the position's test: the
    /// velocity is then not to be relied on. The position is tested by itself.
    pub range_rates_disagree: bool,
    /// Satellites found faulty at this epoch, those left out from the beginning not among them.
    pub excluded_here: SatelliteSet,
    /// Satellites observed.
    pub n_observed: u8,
    /// Satellites observed and not used, in the order of
    /// [`crate::gnss::solution::SatelliteReason`].
    pub unused: [u8; SATELLITE_REASONS],
    /// Root mean square of the residuals of the pseudoranges used, m.
    pub residual_rms_m: Option<f64>,
    /// One sigma of the position without a fault, east, north, up, m; only of one that passed its test.
    pub sigma_enu_m: Option<[f64; 3]>,
    /// The satellite of the solution tested last with the largest bias against the others, faulty or not.
    pub most_likely: Option<Suspect>,
}

/// How far the assessment of an epoch has come.
#[derive(Clone, Copy, Debug)]
struct Progress {
    time: GpsTime,
    solution: Option<SnapshotSolution>,
    test: Test,
    statistic: Option<f64>,
    threshold: Option<f64>,
    excluded: SatelliteSet,
    /// A height that may be used, unless it was found faulty.
    height: Option<CalibratedHeight>,
    hpl: ProtectionLevel,
    vpl: ProtectionLevel,
    residual_rms_m: Option<f64>,
    sigma_enu_m: Option<[f64; 3]>,
    most_likely: Option<Suspect>,
}

/// Levels of a position, and its spread without a fault.
#[derive(Clone, Copy, Debug)]
struct Levels {
    hpl_m: f64,
    vpl_m: f64,
    sigma_enu_m: [f64; 3],
}

/// Outcome of the consistency test.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Test {
    /// There is nothing to test, or nothing to test it with.
    Impossible(Reason),
    Passed,
    Failed,
    /// Failed at first, passed without the satellites excluded.
    PassedWithout,
}

/// Everything the snapshot monitor needs. Large: keep it in a `static` made from
/// [`SnapshotMonitor::EMPTY`].
pub struct SnapshotMonitor {
    config: Option<Config>,
    thresholds: RaimTable,
    factors: Option<LevelFactors>,
    workspace: SnapshotWorkspace,
    qr: WhitenedQr,
    sensitivity: Sensitivity,
    /// Whether `sensitivity` is of the solution in `workspace`.
    sensitivity_is_current: bool,
    exclusion: ExclusionWorkspace,
    independent_sigma_m: [f64; MAX_SATELLITES],
    common_errors_m: [[f64; MAX_SATELLITES]; 1],
    start: Option<[f64; 3]>,
    left_out: SatelliteSet,
    height: HeightCalibration,
    height_use: AidUse,
}

impl SnapshotMonitor {
    /// Not configured.
    pub const EMPTY: Self = Self {
        config: None,
        thresholds: RaimTable::EMPTY,
        factors: None,
        workspace: SnapshotWorkspace::EMPTY,
        qr: WhitenedQr::EMPTY,
        sensitivity: Sensitivity::EMPTY,
        sensitivity_is_current: false,
        exclusion: ExclusionWorkspace::EMPTY,
        independent_sigma_m: [1.0; MAX_SATELLITES],
        common_errors_m: [[0.0; MAX_SATELLITES]],
        start: None,
        left_out: SatelliteSet::EMPTY,
        height: HeightCalibration::EMPTY,
        height_use: AidUse::Off,
    };

    /// Checks a configuration and computes every threshold it needs, once.
    ///
    /// # Errors
    /// [`ConfigureError`]; the monitor is then not configured.
    pub fn configure(&mut self, config: &Config) -> Result<(), ConfigureError> {
        self.config = None;
        self.start = None;
        config.check().map_err(ConfigureError::Config)?;
        let requirements = config.phase.requirements();
        self.thresholds
            .fill(requirements.p_fa, requirements.p_md)
            .map_err(ConfigureError::Stats)?;
        self.factors = Some(
            LevelFactors::new(requirements.p_md, requirements.p_fault_free)
                .map_err(ConfigureError::Stats)?,
        );
        self.config = Some(*config);
        Ok(())
    }

    /// Takes a share of the false alerts of the phase of flight, where another opinion takes the rest. Without
    /// a configuration nothing happens.
    ///
    /// # Errors
    /// [`StatsError`] when the share gives no threshold.
    pub fn share_false_alerts(&mut self, share: f64) -> Result<(), StatsError> {
        let Some(config) = &self.config else {
            return Ok(());
        };
        let requirements = config.phase.requirements();
        self.thresholds
            .fill(share * requirements.p_fa, requirements.p_md)
    }

    /// Satellites that somebody else has found faulty are not used from now on.
    pub const fn leave_out(&mut self, satellites: SatelliteSet) {
        self.left_out = satellites;
    }

    /// The barometer, with its bias.
    pub const fn height(&self) -> &HeightCalibration {
        &self.height
    }

    /// The same, to be configured and given its samples.
    pub const fn height_mut(&mut self) -> &mut HeightCalibration {
        &mut self.height
    }

    /// What became of its height at the epoch assessed last.
    pub const fn height_use(&self) -> AidUse {
        self.height_use
    }

    /// The configuration in force.
    pub const fn config(&self) -> Option<&Config> {
        self.config.as_ref()
    }

    /// The satellites of the last solution, with their directions and sigmas.
    pub const fn workspace(&self) -> &SnapshotWorkspace {
        &self.workspace
    }

    /// The same, to look at the epoch's satellites from another place.
    pub const fn workspace_mut(&mut self) -> &mut SnapshotWorkspace {
        &mut self.workspace
    }

    /// How far a satellite that was left out is from what the position of the last epoch assessed, which passed its
    /// test, predicts for it.
    pub fn disagreement(
        &self,
        satellite: Satellite,
        solution: &SnapshotSolution,
    ) -> Option<BiasEstimate> {
        let (row, residual_m, sigma) = self.workspace.row_left_out(satellite, solution)?;
        bias::outside(&self.qr, &row, residual_m, sigma.total_m())
    }

    /// Assesses one epoch; the work of each stage is booked in `ledger`.
    #[inline(never)]
    pub fn assess(
        &mut self,
        epoch: &ObservationEpoch,
        store: &EphemerisStore,
        ionosphere: &BroadcastIonosphere,
        ledger: &mut Ledger,
        counter: &mut impl CycleCounter,
    ) -> Assessment {
        let Some(config) = self.config else {
            return Assessment {
                solution: None,
                verdict: Verdict::unavailable(Reason::NotConfigured, 0.0, None),
                range_rates_disagree: false,
                excluded_here: SatelliteSet::EMPTY,
                n_observed: 0,
                unused: [0; SATELLITE_REASONS],
                residual_rms_m: None,
                sigma_enu_m: None,
                most_likely: None,
            };
        };
        let requirements = config.phase.requirements();
        let mut progress = Progress {
            time: epoch.time,
            solution: None,
            test: Test::Impossible(Reason::None),
            statistic: None,
            threshold: None,
            excluded: self.left_out,
            height: self.height.height(epoch.time),
            hpl: ProtectionLevel::Unavailable(NoBound::NoPosition),
            vpl: ProtectionLevel::Unavailable(NoBound::NoPosition),
            residual_rms_m: None,
            sigma_enu_m: None,
            most_likely: None,
        };
        let mut verdict =
            Verdict::unavailable(Reason::None, requirements.hal_m, requirements.val_m);
        for stage in &STAGES {
            let begin = counter.now();
            match stage.stage {
                Stage::Solution => {
                    self.workspace.prepare(epoch, store, ionosphere, &config);
                    self.solve(&mut progress);
                }
                Stage::Detection => self.detect(&mut progress),
                Stage::Exclusion => self.exclude(&mut progress, config.max_exclusions),
                Stage::Levels => self.bound(&mut progress),
                Stage::Verdict => verdict = judge(&progress, &requirements),
                // Runs after the snapshot, in `monitor.rs`.
                Stage::Filter | Stage::Bank => continue,
            }
            ledger.charge(stage.stage, counter.now().wrapping_sub(begin));
        }
        let unused = progress
            .solution
            .map_or_else(|| self.workspace.unused(), |solution| solution.unused);
        self.judge_height(&progress);
        let mut excluded_here = progress.excluded;
        for satellite in self.left_out.iter() {
            excluded_here.remove(satellite);
        }
        Assessment {
            solution: progress.solution,
            verdict,
            range_rates_disagree: self.range_rates_disagree(&progress),
            excluded_here,
            n_observed: self.workspace.n_observed(),
            unused,
            residual_rms_m: progress.residual_rms_m,
            sigma_enu_m: progress.sigma_enu_m,
            most_likely: progress.most_likely,
        }
    }

    /// The satellite that most likely failed at the epoch assessed last, in the light of a verdict that
    /// may be another's: with an alert the one that agrees least with the others, else the excluded one
    /// with the largest bias for its sigma. `None` where nothing failed, or nothing can be said.
    pub fn suspect(&self, assessment: &Assessment, verdict: &Verdict) -> Option<Suspect> {
        if verdict.integrity == Integrity::Alert {
            return assessment.most_likely;
        }
        if verdict.excluded.is_empty() {
            return None;
        }
        let solution = assessment.solution.as_ref()?;
        let mut found = None;
        for satellite in verdict.excluded.iter() {
            let estimate = if solution.used.contains(satellite) {
                // Excluded by another opinion, at this epoch.
                self.workspace
                    .used_rows()
                    .enumerate()
                    .find(|(_, used)| used.satellite == satellite)
                    .and_then(|(row, used)| self.bias_of_row(row, used.sigma.common_m))
            } else {
                self.disagreement(satellite, solution)
            };
            found = self.likelier(found, satellite, estimate);
        }
        found.map(|(_, suspect)| suspect)
    }

    /// The satellite of the solution that agrees least with the others.
    fn most_likely(&self) -> Option<Suspect> {
        let mut found = None;
        for (row, used) in self.workspace.used_rows().enumerate() {
            let estimate = self.bias_of_row(row, used.sigma.common_m);
            found = self.likelier(found, used.satellite, estimate);
        }
        found.map(|(_, suspect)| suspect)
    }

    fn bias_of_row(&self, row: usize, common_m: f64) -> Option<BiasEstimate> {
        if !self.sensitivity_is_current {
            return None;
        }
        bias::of_row(self.workspace.model(), &self.sensitivity, row, common_m)
    }

    /// The one found so far, or this one.
    fn likelier(
        &self,
        found: Option<(f64, Suspect)>,
        satellite: Satellite,
        estimate: Option<BiasEstimate>,
    ) -> Option<(f64, Suspect)> {
        let (Some(estimate), Some(config)) = (estimate, &self.config) else {
            return found;
        };
        let square = estimate.square();
        if found.is_some_and(|(largest, _)| !(square > largest)) {
            return found;
        }
        let suspect = Suspect {
            satellite,
            bias_m: estimate.bias_m,
            sigma_m: estimate.sigma_m,
            p_md: config.phase.requirements().p_md,
        };
        Some((square, suspect))
    }

    /// What an epoch says of the barometer: its bias is learned from satellites that tested each other, and
    /// forgotten when they disagree, or when it is faulty itself.
    fn judge_height(&mut self, progress: &Progress) {
        if !self.height.is_on() {
            return;
        }
        let was_offered = self.height.height(progress.time).is_some();
        let uses_height = self.workspace.uses_height();
        self.height_use = match (was_offered, uses_height) {
            (true, _) if progress.height.is_none() => AidUse::Excluded,
            (true, true) => AidUse::Used,
            (true, false) => AidUse::Ready,
            (false, _) => AidUse::Waiting,
        };
        if self.height_use == AidUse::Excluded {
            self.height.forget();
        } else if !uses_height {
            match (progress.test, &progress.solution, progress.vpl.bound_m()) {
                (Test::Passed, Some(solution), Some(vpl_m))
                    if self.qr.n() >= self.qr.m() + LEARNING_REDUNDANCY =>
                {
                    self.height
                        .learn(progress.time, solution.llh.height_m, vpl_m);
                }
                (Test::Failed | Test::PassedWithout, ..) => self.height.forget(),
                _ => {}
            }
        }
    }

    /// Position without the satellites excluded so far.
    fn solve(&mut self, progress: &mut Progress) {
        self.sensitivity_is_current = false;
        self.workspace
            .offer_height(progress.height.map(|height| height.row));
        match self.workspace.solve(progress.excluded, self.start) {
            Ok(solution) => {
                self.start = Some(solution.r_e_m);
                progress.solution = Some(solution);
            }
            Err(error) => {
                self.start = None;
                progress.test = Test::Impossible(match error {
                    SnapshotError::TooFewSatellites { .. } => Reason::TooFewSatellites,
                    SnapshotError::BadGeometry => Reason::BadGeometry,
                    SnapshotError::NoConvergence => Reason::NoConvergence,
                    SnapshotError::ImplausiblePosition => Reason::ImplausiblePosition,
                });
            }
        }
    }

    /// Parity test of the solution.
    fn detect(&mut self, progress: &mut Progress) {
        let Some(solution) = &progress.solution else {
            return;
        };
        let clocks_are_plausible = are_plausible(&solution.clock_m, progress.time);
        progress.statistic = None;
        progress.threshold = None;
        progress.residual_rms_m = residual_rms_m(self.workspace.model());
        progress.test = match parity::test(self.workspace.model(), &mut self.qr) {
            Ok(statistic) => {
                let threshold = self.thresholds.threshold(statistic.redundancy);
                progress.statistic = Some(statistic.sum_of_squares);
                progress.threshold = threshold;
                let passes = threshold.is_some_and(|limit| statistic.passes(limit));
                // A single faulty satellite moves the clock too: exclusion comes before this doubt.
                match (passes, clocks_are_plausible) {
                    (false, _) => Test::Failed,
                    (true, false) => Test::Impossible(Reason::ImplausibleClock),
                    (true, true) => Test::Passed,
                }
            }
            Err(RaimError::NoRedundancy { .. }) => Test::Impossible(Reason::NoRedundancy),
            Err(_) => Test::Impossible(Reason::BadGeometry),
        };
    }

    /// Chi-square test of the range rates of the solution.
    fn range_rates_disagree(&self, progress: &Progress) -> bool {
        let fit = progress.solution.and_then(|solution| solution.rate_fit);
        fit.is_some_and(|fit| {
            let statistic = TestStatistic {
                sum_of_squares: fit.sum_of_squares,
                redundancy: fit.redundancy,
            };
            let threshold = self.thresholds.threshold(fit.redundancy);
            !threshold.is_some_and(|limit| statistic.passes(limit))
        })
    }

    /// After a failed test: the satellites that explain it, and the position without them.
    #[inline(never)]
    fn exclude(&mut self, progress: &mut Progress, max_exclusions: u8) {
        if progress.test != Test::Failed {
            return;
        }
        self.fill_sensitivity();
        progress.most_likely = self.most_likely();
        let found = exclusion::identify(
            &self.qr,
            &self.thresholds,
            max_exclusions as usize,
            &mut self.exclusion,
        );
        let Ok(found) = found else {
            return;
        };
        let mut without = *progress;
        for (row, used) in self.workspace.used_rows().enumerate() {
            if found.rows.contains(row) {
                without.excluded.insert(used.satellite);
            }
        }
        let satellites = self.workspace.used_rows().count();
        if self.workspace.uses_height() && found.rows.contains(satellites) {
            without.height = None;
        }
        let is_changed = without.excluded != progress.excluded || without.height != progress.height;
        self.solve(&mut without);
        if !is_changed || matches!(without.test, Test::Impossible(_)) {
            return;
        }
        self.detect(&mut without);
        if without.test == Test::Passed {
            // A height that is left out is no satellite.
            if without.excluded != progress.excluded {
                without.test = Test::PassedWithout;
            }
            *progress = without;
        }
    }

    /// Levels of a position that passed its test.
    #[inline(never)]
    fn bound(&mut self, progress: &mut Progress) {
        if progress.solution.is_none() {
            return;
        }
        let unavailable = match progress.test {
            Test::Impossible(Reason::ImplausibleClock) => Some(NoBound::FaultPresent),
            Test::Impossible(_) => Some(NoBound::NoRedundancy),
            Test::Failed => Some(NoBound::FaultPresent),
            Test::Passed | Test::PassedWithout => None,
        };
        let levels = match unavailable {
            Some(why) => Err(why),
            None => self.levels(progress.height.as_ref()),
        };
        if unavailable.is_none() {
            progress.most_likely = self.most_likely();
        }
        if let Ok(levels) = &levels {
            progress.sigma_enu_m =
                Some(levels.sigma_enu_m).filter(|sigma_m| sigma_m.iter().all(|s| s.is_finite()));
        }
        (progress.hpl, progress.vpl) = match levels {
            Ok(levels) => (
                ProtectionLevel::from_bound(levels.hpl_m),
                ProtectionLevel::from_bound(levels.vpl_m),
            ),
            Err(why) => (
                ProtectionLevel::Unavailable(why),
                ProtectionLevel::Unavailable(why),
            ),
        };
    }

    fn fill_sensitivity(&mut self) {
        self.sensitivity.fill(&mut self.qr);
        self.sensitivity_is_current = true;
    }

    fn levels(&mut self, height: Option<&CalibratedHeight>) -> Result<Levels, NoBound> {
        let redundancy = self.qr.n().saturating_sub(self.qr.m());
        let sqrt_noncentrality = self
            .thresholds
            .sqrt_noncentrality(redundancy)
            .ok_or(NoBound::NoRedundancy)?;
        self.fill_sensitivity();
        let height = height.filter(|_| self.workspace.uses_height());
        let height_row = self.qr.n().saturating_sub(1);
        let slope = match height {
            None => self.sensitivity.levels(sqrt_noncentrality),
            Some(height) => bounded::levels(
                &self.sensitivity,
                sqrt_noncentrality,
                height_row,
                height.bound_m / height.row.sigma_m,
            ),
        };
        let slope = slope.map_err(|error| match error {
            NoLevel::NoRedundancy => NoBound::NoRedundancy,
            NoLevel::Untestable { .. } => NoBound::Untestable,
            NoLevel::NotFinite => NoBound::NotFinite,
        })?;
        let places = self
            .independent_sigma_m
            .iter_mut()
            .zip(self.common_errors_m.iter_mut().flatten());
        for (row, (independent_m, common_m)) in self.workspace.used_rows().zip(places) {
            *independent_m = row.sigma.independent_m;
            *common_m = row.sigma.common_m;
        }
        if let Some(height) = height {
            let places = (
                self.independent_sigma_m.get_mut(height_row),
                self.common_errors_m
                    .first_mut()
                    .and_then(|row| row.get_mut(height_row)),
            );
            if let (Some(independent_m), Some(common_m)) = places {
                *independent_m = height.row.sigma_m;
                *common_m = 0.0;
            }
        }
        let mut covariance = self.sensitivity.position_covariance(
            self.workspace.model(),
            &self.independent_sigma_m,
            &self.common_errors_m,
        );
        if height.is_some() {
            // The height holds errors that its calibration shares with the satellites of now, with any sign.
            covariance *= 2.0;
        }
        let factors = self.factors.ok_or(NoBound::NotFinite)?;
        let [hpl_m, vpl_m] = factors.levels_m(&slope, &covariance);
        let variance_m2 = [covariance.m11, covariance.m22, covariance.m33];
        Ok(Levels {
            hpl_m,
            vpl_m,
            sigma_enu_m: variance_m2.map(libm::sqrt),
        })
    }
}

/// Root mean square of the residuals of a solution, m.
fn residual_rms_m(model: &LinearModel) -> Option<f64> {
    let residuals = || model.residual_m.iter().take(model.n);
    let mean_m2 = residuals().map(|r| r * r).sum::<f64>() / model.n as f64;
    // NaN without a row.
    Some(libm::sqrt(mean_m2)).filter(|rms_m| rms_m.is_finite())
}

/// How far a time tag lies beyond the nearest round instant, m of light.
fn beyond_round_m(time: GpsTime) -> f64 {
    let since_ns = time.tow_ns().rem_euclid(ROUND_NS);
    let beyond_ns = if since_ns > ROUND_NS / 2 {
        since_ns - ROUND_NS
    } else {
        since_ns
    };
    beyond_ns as f64 / NS_PER_S as f64 * SPEED_OF_LIGHT_MPS
}

/// Whether receiver clocks lie where a receiver with time tags like this one keeps them; NaN does not.
fn are_plausible(clock_m: &[Option<f64>; MAX_CLOCKS], time: GpsTime) -> bool {
    let beyond_m = beyond_round_m(time);
    let clocks = || clock_m.iter().copied().flatten();
    clocks().all(|a| {
        (libm::fabs(a) <= MAX_RECEIVER_CLOCK_M || libm::fabs(a - beyond_m) <= MAX_RECEIVER_CLOCK_M)
            && clocks().all(|b| libm::fabs(a - b) <= MAX_INTER_SYSTEM_M)
    })
}

/// What the test and the levels mean for the user.
fn judge(progress: &Progress, requirements: &PhaseRequirements) -> Verdict {
    let horizontal = progress.hpl.is_within(requirements.hal_m);
    let vertical = requirements
        .val_m
        .is_none_or(|val_m| progress.vpl.is_within(val_m));
    let (integrity, reason) = match progress.test {
        Test::Impossible(reason) => (Integrity::Unavailable, reason),
        Test::Failed => (Integrity::Alert, Reason::FaultNotIsolated),
        Test::Passed | Test::PassedWithout if !horizontal => {
            (Integrity::Unavailable, Reason::HplAboveLimit)
        }
        Test::Passed | Test::PassedWithout if !vertical => {
            (Integrity::Unavailable, Reason::VplAboveLimit)
        }
        Test::Passed if progress.excluded.is_empty() => (Integrity::Nominal, Reason::None),
        Test::Passed | Test::PassedWithout => (Integrity::Excluded, Reason::None),
    };
    Verdict {
        integrity,
        reason,
        hpl: progress.hpl,
        vpl: progress.vpl,
        hal_m: requirements.hal_m,
        val_m: requirements.val_m,
        excluded: progress.excluded,
        statistic: progress.statistic,
        threshold: progress.threshold,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrity::Phase;

    fn progress(test: Test, hpl_m: f64, vpl_m: f64) -> Progress {
        Progress {
            time: GpsTime::from_ns(0),
            solution: None,
            test,
            statistic: Some(1.0),
            threshold: Some(2.0),
            excluded: SatelliteSet::EMPTY,
            height: None,
            hpl: ProtectionLevel::from_bound(hpl_m),
            vpl: ProtectionLevel::from_bound(vpl_m),
            residual_rms_m: None,
            sigma_enu_m: None,
            most_likely: None,
        }
    }

    /// INT-001, INT-002.
    #[test]
    fn a_verdict_is_usable_only_with_levels_within_limits() {
        let limits = Phase::Lpv200.requirements();
        let state = |test, hpl_m, vpl_m| judge(&progress(test, hpl_m, vpl_m), &limits);
        let inside = state(Test::Passed, 39.0, 34.0);
        assert_eq!(
            (inside.integrity, inside.reason),
            (Integrity::Nominal, Reason::None)
        );
        let inside = state(Test::PassedWithout, 39.0, 34.0);
        assert_eq!(inside.integrity, Integrity::Excluded);
        for (hpl_m, vpl_m, reason) in [
            (40.0, 34.0, Reason::HplAboveLimit),
            (f64::NAN, 34.0, Reason::HplAboveLimit),
            (39.0, 35.0, Reason::VplAboveLimit),
            (39.0, f64::INFINITY, Reason::VplAboveLimit),
        ] {
            for test in [Test::Passed, Test::PassedWithout] {
                let outside = state(test, hpl_m, vpl_m);
                assert_eq!(outside.integrity, Integrity::Unavailable);
                assert_eq!(outside.reason, reason);
            }
        }
        assert_eq!(state(Test::Failed, 1.0, 1.0).integrity, Integrity::Alert);
        let untested = state(Test::Impossible(Reason::NoRedundancy), 1.0, 1.0);
        assert_eq!(untested.integrity, Integrity::Unavailable);
    }

    #[test]
    fn a_phase_without_vertical_guidance_does_not_ask_for_a_vertical_level() {
        let limits = Phase::Npa.requirements();
        let verdict = judge(&progress(Test::Passed, 500.0, f64::INFINITY), &limits);
        assert_eq!(verdict.integrity, Integrity::Nominal);
    }

    #[test]
    fn clocks_a_receiver_does_not_have_are_implausible() {
        let far_m = 1.001 * MAX_RECEIVER_CLOCK_M;
        let are_plausible =
            |clock_m: &[Option<f64>; MAX_CLOCKS]| are_plausible(clock_m, GpsTime::from_ns(0));
        assert!(are_plausible(&[None; MAX_CLOCKS]));
        assert!(are_plausible(&[
            Some(0.99 * MAX_RECEIVER_CLOCK_M),
            None,
            None
        ]));
        assert!(!are_plausible(&[Some(far_m), None, None]));
        assert!(!are_plausible(&[None, Some(-far_m), None]));
        assert!(are_plausible(&[
            Some(0.0),
            None,
            Some(0.99 * MAX_INTER_SYSTEM_M)
        ]));
        assert!(!are_plausible(&[
            Some(0.0),
            None,
            Some(1.01 * MAX_INTER_SYSTEM_M)
        ]));
        assert!(!are_plausible(&[Some(f64::NAN), None, None]));
    }

    #[test]
    fn clock_that_runs_has_to_lie_where_its_time_tags_say() {
        const MS_NS: i64 = 1_000_000;
        let at = |tow_ns: i64, clock_s: f64| {
            let time = GpsTime::from_week_tow_ns(2244, tow_ns);
            are_plausible(&[Some(clock_s * SPEED_OF_LIGHT_MPS), None, None], time)
        };
        // 4 ms late by its tags; 25 ms and its multiples are round.
        assert!(at(1_004 * MS_NS, 4.23e-3) && at(1_129 * MS_NS, 4.23e-3));
        assert!(at(1_004 * MS_NS, 1.9e-3) && at(1_004 * MS_NS, -1.9e-3));
        assert!(!at(1_004 * MS_NS, 6.1e-3) && !at(1_004 * MS_NS, -2.1e-3));
        assert!(!at(1_000 * MS_NS, 4.23e-3));
        assert!(at(998 * MS_NS, -3.9e-3) && !at(998 * MS_NS, 2.1e-3));
        assert!(!at(1_004 * MS_NS, f64::NAN));
    }
}
