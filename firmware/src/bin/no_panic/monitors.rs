//! `raim::monitors`: the face of the monitors of one epoch, and those behind it.

use crate::call::{call1, call2, call3};
use core::hint::black_box;
use surefix_core::gnss::solution::UsedRow;
use surefix_core::linalg::LinearModel;
use surefix_core::raim::araim::AraimParameters;
use surefix_core::raim::araim::support::{FaultRate, IntegritySupport};
use surefix_core::raim::exclusion::RowSet;
use surefix_core::raim::monitors::araim::{AraimConfig, AraimMonitor};
use surefix_core::raim::monitors::residual::{ResidualConfig, ResidualMonitor};
use surefix_core::raim::monitors::{self, EpochMonitor, MonitorEpoch, MonitorVerdict, NotTested};

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
        exposure_s: 0.0,
    };
    monitor(&mut araim, &config, &epoch);
}

fn monitor<M: EpochMonitor>(monitor: &mut M, config: &M::Config, epoch: &MonitorEpoch<'_>) {
    call2(M::configure, monitor, config);
    let verdict = M::assess(black_box(monitor), black_box(epoch));
    call1(|verdict| MonitorVerdict::is_detected(&verdict), verdict);
}
