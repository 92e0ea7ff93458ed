//! What is measured of the monitors of one epoch behind their common face: the same skies for each, without a
//! fault and with one, from the rows to the verdict with its exclusion and its levels. Doppler RAIM, whose rows have one
//! clock, is given these as well.

use super::measure::{RUNS, Row, require};
use super::sky::{Random, model};
use core::hint::black_box;
use static_cell::ConstStaticCell;
use surefix_core::consts::MAX_SATELLITES;
use surefix_core::gnss::solution::UsedRow;
use surefix_core::gnss::weights::RowSigma;
use surefix_core::gnss::{Satellite, System};
use surefix_core::linalg::LinearModel;
use surefix_core::raim::foim::GDOP_LIMIT;
use surefix_core::raim::igg3::Igg3Config;
use surefix_core::raim::monitors::araim::{AraimConfig, AraimMonitor, PseudorangeErrors};
use surefix_core::raim::monitors::consensus::{ConsensusConfig, ConsensusMonitor, ConsensusRule};
use surefix_core::raim::monitors::doppler::{DopplerConfig, DopplerMonitor};
use surefix_core::raim::monitors::residual::{ResidualConfig, ResidualMonitor};
use surefix_core::raim::monitors::rms::{RmsConfig, RmsMonitor, RmsRule};
use surefix_core::raim::monitors::robust::{RobustConfig, RobustMonitor};
use surefix_core::raim::monitors::vpl_mhss::{VplConfig, VplMonitor};
use surefix_core::raim::monitors::{EpochMonitor, MonitorEpoch, Outcome};
use surefix_core::raim::reconstructed::LevelConvention;

/// Satellites and constellations.
const SKIES: [(usize, usize); 4] = [(8, 1), (12, 2), (18, 2), (24, 2)];
/// On the last row, m.
const FAULT_M: f64 = 60.0;

const RESIDUAL: ResidualConfig = ResidualConfig {
    p_false_alarm: 3.3333e-7,
    p_missed_detection: 1e-3,
    p_fault_free: 1e-7,
    max_faults: 3,
};
const RMS: RmsConfig = RmsConfig {
    p_false_alarm: 3.3333e-7,
    rule: RmsRule::Corrected,
};
const ROBUST: RobustConfig = RobustConfig {
    estimator: Igg3Config::CORRECTED,
    levels: LevelConvention::CORRECTED,
};
const ARAIM: AraimConfig = AraimConfig {
    errors: PseudorangeErrors::Rows,
    ..AraimConfig::LPV_200_V3
};

/// Measures every row and prints it.
#[inline(never)]
pub fn all() {
    static RESIDUAL_MONITOR: ConstStaticCell<ResidualMonitor> =
        ConstStaticCell::new(ResidualMonitor::EMPTY);
    static RMS_MONITOR: ConstStaticCell<RmsMonitor> = ConstStaticCell::new(RmsMonitor::EMPTY);
    static ROBUST_MONITOR: ConstStaticCell<RobustMonitor> =
        ConstStaticCell::new(RobustMonitor::EMPTY);
    static ARAIM_MONITOR: ConstStaticCell<AraimMonitor> = ConstStaticCell::new(AraimMonitor::EMPTY);
    static DOPPLER_MONITOR: ConstStaticCell<DopplerMonitor> =
        ConstStaticCell::new(DopplerMonitor::EMPTY);
    static VPL_MONITOR: ConstStaticCell<VplMonitor> = ConstStaticCell::new(VplMonitor::EMPTY);
    static CONSENSUS_MONITOR: ConstStaticCell<ConsensusMonitor> =
        ConstStaticCell::new(ConsensusMonitor::EMPTY);
    let residual = ["monitor/residual", "monitor/residual/fault"];
    measured(RESIDUAL_MONITOR.take(), &RESIDUAL, residual);
    measured(
        RMS_MONITOR.take(),
        &RMS,
        ["monitor/rms", "monitor/rms/fault"],
    );
    let robust = ["monitor/igg3", "monitor/igg3/fault"];
    measured(ROBUST_MONITOR.take(), &ROBUST, robust);
    let araim = ["monitor/araim", "monitor/araim/fault"];
    measured(ARAIM_MONITOR.take(), &ARAIM, araim);
    let doppler = ["monitor/doppler", "monitor/doppler/fault"];
    measured(DOPPLER_MONITOR.take(), &DopplerConfig::FREE_SKY, doppler);
    let vpl = ["monitor/vpl_mhss", "monitor/vpl_mhss/fault"];
    measured(VPL_MONITOR.take(), &VplConfig::PRESET, vpl);
    let monitor = CONSENSUS_MONITOR.take();
    let gdop_limit = GDOP_LIMIT;
    for (rule, stages) in [
        (
            ConsensusRule::Ranco,
            ["monitor/ranco", "monitor/ranco/fault"],
        ),
        (
            ConsensusRule::SRanco,
            ["monitor/s_ranco", "monitor/s_ranco/fault"],
        ),
        (
            ConsensusRule::Foim { gdop_limit },
            ["monitor/foim", "monitor/foim/fault"],
        ),
    ] {
        let config = ConsensusConfig {
            rule,
            p_false_alarm: 3.3333e-7,
            max_faults: 3,
        };
        measured(monitor, &config, stages);
    }
}

/// Prints the rows of one monitor.
fn measured<M: EpochMonitor>(monitor: &mut M, config: &M::Config, [clean, faulted]: [&str; 2]) {
    require(monitor.configure(config).is_ok(), "no configuration");
    // Anew for each monitor: all see the same skies.
    let mut random = Random::new(13);
    let mut rows = LinearModel::EMPTY;
    for (n, clocks) in SKIES {
        let (mut healthy, mut with_fault) = (Row::new(), Row::new());
        for _ in 0..RUNS {
            model(&mut random, n, clocks, &mut rows);
            let used = used_rows(&rows, clocks);
            let used = &used[..n];
            healthy.run(|| assess(monitor, &rows, used));
            rows.residual_m[n - 1] += FAULT_M;
            with_fault.run(|| assess(monitor, &rows, used));
        }
        healthy.print(clean, Some(n), Some(3 + clocks));
        with_fault.print(faulted, Some(n), Some(3 + clocks));
    }
}

#[inline(never)]
fn assess<M: EpochMonitor>(monitor: &mut M, model: &LinearModel, used: &[UsedRow]) {
    let Ok(epoch) = MonitorEpoch::new(black_box(model), black_box(used)) else {
        return require(false, "no epoch");
    };
    let verdict = black_box(monitor.assess(&epoch));
    // That the weights of robust estimation do not settle is an answer, too.
    let is_tested = !matches!(verdict.outcome, Outcome::NotTested(_));
    require(is_tested || verdict.levels.is_err(), "no verdict");
}

/// What the rows of a random sky belong to.
fn used_rows(model: &LinearModel, clocks: usize) -> [UsedRow; MAX_SATELLITES] {
    core::array::from_fn(|row| {
        let [east, north, up, ..] = model.design[row];
        let system = System::ALL[row % clocks];
        UsedRow {
            satellite: Satellite::new(system, (row / clocks) as u8 + 1).unwrap_or(FIRST),
            elevation_rad: libm::asin(-up),
            azimuth_rad: libm::atan2(-east, -north),
            sigma: RowSigma {
                independent_m: model.sigma_m[row],
                common_m: 0.0,
            },
        }
    })
}

const FIRST: Satellite = match Satellite::new(System::Gps, 1) {
    Some(satellite) => satellite,
    None => panic!("G01 exists"),
};
