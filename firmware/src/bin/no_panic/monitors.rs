//! `raim::monitors`: the face of the monitors of one epoch, and those behind it.

use crate::call::{call1, call2, call3};
use core::hint::black_box;
use surefix_core::gnss::solution::{RangeRates, SnapshotWorkspace, UsedRow};
use surefix_core::linalg::LinearModel;
use surefix_core::raim::araim::AraimParameters;
use surefix_core::raim::araim::support::{FaultRate, IntegritySupport};
use surefix_core::raim::consensus::ConsensusWorkspace;
use surefix_core::raim::consensus::suspicion::{self, Suspicions};
use surefix_core::raim::exclusion::RowSet;
use surefix_core::raim::igg3::{self, Igg3Config, Igg3Workspace};
use surefix_core::raim::monitors::araim::{AraimConfig, AraimMonitor, PseudorangeErrors};
use surefix_core::raim::monitors::consensus::{ConsensusConfig, ConsensusMonitor, ConsensusRule};
use surefix_core::raim::monitors::doppler::{DopplerConfig, DopplerMonitor};
use surefix_core::raim::monitors::residual::{ResidualConfig, ResidualMonitor};
use surefix_core::raim::monitors::rms::{RmsConfig, RmsMonitor, RmsRule};
use surefix_core::raim::monitors::robust::{RobustConfig, RobustMonitor};
use surefix_core::raim::monitors::vpl_mhss::{VplConfig, VplMonitor};
use surefix_core::raim::monitors::{self, EpochMonitor, MonitorEpoch, MonitorVerdict, NotTested};
use surefix_core::raim::reconstructed::{self, LevelConvention};
use surefix_core::raim::rms::{self, RmsComparison, RmsVariant};
use surefix_core::raim::vpl_mhss::{VplSeparation, VplTest};
use surefix_core::raim::{foim, ranco, s_ranco};

pub fn all() {
    let mut model = LinearModel::EMPTY;
    black_box(&mut model);
    let rows: &[UsedRow] = black_box(&[]);
    call2(MonitorEpoch::new, &model, rows);
    let mut remaining = LinearModel::EMPTY;
    call3(
        monitors::without_rows,
        &model,
        RowSet::EMPTY,
        &mut remaining,
    );
    call2(monitors::checked_levels, 1.0, 1.0);
    call1(MonitorVerdict::not_tested, NotTested::NotConverged);
    let Ok(epoch) = MonitorEpoch::new(&model, rows) else {
        return;
    };
    call1(|epoch| MonitorEpoch::model(&epoch).n, epoch);
    call1(|epoch| MonitorEpoch::rows(&epoch).len(), epoch);

    let mut residual = ResidualMonitor::EMPTY;
    let config = ResidualConfig {
        p_false_alarm: 1e-7,
        p_missed_detection: 1e-3,
        p_fault_free: 1e-7,
        max_faults: 3,
    };
    monitor(&mut residual, &config, &epoch);

    let mut doppler = DopplerMonitor::EMPTY;
    monitor(&mut doppler, &DopplerConfig::FREE_SKY, &epoch);
    let workspace = SnapshotWorkspace::EMPTY;
    call2(DopplerMonitor::assess_velocity, &mut doppler, &workspace);
    call2(DopplerMonitor::satellites, &doppler, RowSet::EMPTY.with(1));
    let mut rates = RangeRates::EMPTY;
    call2(SnapshotWorkspace::range_rates, &workspace, &mut rates);

    let mut araim = AraimMonitor::EMPTY;
    let rate = FaultRate::from_rate(black_box(1e-8), black_box(3600.0));
    let support = IntegritySupport {
        ura_m: 1.0,
        ure_m: 1.0,
        b_nom_m: 0.0,
        satellite: rate,
        constellation: rate,
    };
    let config = AraimConfig {
        parameters: AraimParameters::LPV_200,
        support: [support; 3],
        errors: PseudorangeErrors::Rows,
        excludes: true,
        exposure_s: 0.0,
    };
    monitor(&mut araim, &config, &epoch);
    call1(|araim| AraimMonitor::levels(araim).is_some(), &araim);

    let mut rms = RmsMonitor::EMPTY;
    for rule in [RmsRule::Printed, RmsRule::Corrected] {
        let config = RmsConfig {
            p_false_alarm: 1e-7,
            rule,
        };
        monitor(&mut rms, &config, &epoch);
    }

    let mut robust = RobustMonitor::EMPTY;
    let config = RobustConfig {
        estimator: Igg3Config::CORRECTED,
        levels: LevelConvention::CORRECTED,
    };
    monitor(&mut robust, &config, &epoch);
    call1(
        |robust| RobustMonitor::workspace(robust).weights().len(),
        &robust,
    );
    let mut vpl = VplMonitor::EMPTY;
    monitor(&mut vpl, &VplConfig::PRESET, &epoch);
    separations(&model);
    estimators(&model);

    let mut consensus = ConsensusMonitor::EMPTY;
    for rule in [
        ConsensusRule::Ranco,
        ConsensusRule::SRanco,
        ConsensusRule::Foim { gdop_limit: 15.0 },
    ] {
        let config = ConsensusConfig {
            rule,
            p_false_alarm: 1e-7,
            max_faults: 3,
        };
        monitor(&mut consensus, &config, &epoch);
    }
    call1(
        |consensus| ConsensusMonitor::suspicions(consensus).subsets,
        &consensus,
    );
    subsets(&model);
}

fn subsets(model: &LinearModel) {
    let mut workspace = ConsensusWorkspace::EMPTY;
    call2(ConsensusWorkspace::load, &mut workspace, model);
    call1(ConsensusWorkspace::clocks, &workspace);
    call1(ConsensusWorkspace::members, &workspace);
    call2(ConsensusWorkspace::leave_out, &mut workspace, RowSet::EMPTY);
    call2(ranco::consensus, &workspace, 5.0);
    call2(s_ranco::count, &mut workspace, 5.0);
    call3(foim::count, &mut workspace, 5.0, 15.0);
    let suspicions = black_box(workspace.suspicions());
    call1(
        |workspace| ConsensusWorkspace::suspicions(workspace).dropped,
        &workspace,
    );
    call1(|s| Suspicions::outliers(s).len(), suspicions);
    call1(|s| Suspicions::predictions(s).len(), suspicions);
    call2(Suspicions::share, suspicions, 1);
    call1(Suspicions::largest_share, suspicions);
    call2(Suspicions::above, suspicions, 0.5);
    call3(Suspicions::most_suspected, suspicions, 0.5, RowSet::EMPTY);
    call1(Suspicions::is_tested, suspicions);
    call2(suspicion::suspicion_threshold, 12, 4);
    call3(suspicion::outlier_factor, 1e-7, 12, 0.5);
}

fn separations(model: &LinearModel) {
    let mut separation = VplSeparation::EMPTY;
    call3(VplSeparation::configure, &mut separation, 1e-7, 1e-7);
    call2(VplSeparation::test, &mut separation, model);
    if let Ok(test) = separation.test(black_box(model)) {
        call1(VplTest::passes, &test);
        call1(VplTest::excluded, &test);
        call1(VplTest::excluded_as_printed, &test);
    }
    call1(
        |s| VplSeparation::levels_without_m(s).sum::<f64>(),
        &separation,
    );
    call1(VplSeparation::k_vertical, &separation);
    call1(VplSeparation::sigma_up_m, &separation);
    call2(VplSeparation::hpl_m, &separation, Some(3));
    call2(VplSeparation::position_enu_m, &separation, Some(3));
}

fn estimators(model: &LinearModel) {
    let mut workspace = Igg3Workspace::EMPTY;
    let config = Igg3Config::PRINTED;
    call1(Igg3Config::is_legal, &config);
    call3(igg3::weight, 1.0, 1.5, 5.0);
    call2(Igg3Workspace::least_squares, &mut workspace, model);
    call3(Igg3Workspace::estimate, &mut workspace, model, &config);
    call1(Igg3Workspace::untestable_row, &mut workspace);
    call1(|w| Igg3Workspace::weights(w).len(), &workspace);
    call1(|w| Igg3Workspace::standardised(w).len(), &workspace);
    call1(|w| Igg3Workspace::residuals_m(w).len(), &workspace);
    call3(reconstructed::posterior_factor, 1.0, 8, 4);
    if let Ok(robust) = workspace.estimate(model, black_box(&config)) {
        call3(
            LevelConvention::levels,
            &LevelConvention::PRINTED,
            &robust.fit,
            &robust.cofactor_enu_m2,
        );
    }
    call2(rms::compare, &[1.0; 48][..], RmsVariant::Signed);
    if let Ok(comparison) = rms::compare(black_box(&[1.0; 48]), black_box(RmsVariant::Absolute)) {
        call1(|c| RmsComparison::order(c).len(), &comparison);
        call1(|c| RmsComparison::rms(c).len(), &comparison);
    }
}

fn monitor<M: EpochMonitor>(monitor: &mut M, config: &M::Config, epoch: &MonitorEpoch<'_>) {
    call2(M::configure, monitor, config);
    let verdict = M::assess(black_box(monitor), black_box(epoch));
    call1(|verdict| MonitorVerdict::is_detected(&verdict), verdict);
}
