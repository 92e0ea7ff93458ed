//! What is measured of range consensus: the verdict of a healthy epoch by RANCO, S-RANCO and FOIM under the same skies.

use super::measure::{Of, RUNS, Row, require};
use super::sky::{Random, model};
use core::hint::black_box;
use core::mem::size_of;
use static_cell::ConstStaticCell;
use surefix_core::gnss::solution::UsedRow;
use surefix_core::gnss::weights::RowSigma;
use surefix_core::gnss::{Satellite, System};
use surefix_core::linalg::LinearModel;
use surefix_core::raim::foim::GDOP_LIMIT;
use surefix_core::raim::monitors::consensus::{ConsensusConfig, ConsensusMonitor, ConsensusRule};
use surefix_core::raim::monitors::{EpochMonitor, MonitorEpoch, MonitorVerdict};

/// Satellites and constellations.
const SKIES: [(usize, usize); 8] = [
    (6, 1),
    (8, 1),
    (10, 1),
    (12, 1),
    (16, 1),
    (20, 1),
    (24, 1),
    (12, 2),
];
const MOST: usize = 24;
/// From so many satellites on, a third of the skies: an epoch is millions of instructions.
const MANY: usize = 20;

const METHODS: [(&str, ConsensusRule); 3] = [
    ("consensus/ranco", ConsensusRule::Ranco),
    ("consensus/s_ranco", ConsensusRule::SRanco),
    (
        "consensus/foim",
        ConsensusRule::Foim {
            gdop_limit: GDOP_LIMIT,
        },
    ),
];

static MODEL: ConstStaticCell<LinearModel> = ConstStaticCell::new(LinearModel::EMPTY);
static MONITOR: ConstStaticCell<ConsensusMonitor> = ConstStaticCell::new(ConsensusMonitor::EMPTY);

/// Measures every row and prints it.
#[inline(never)]
pub fn all() {
    let (epoch, monitor) = (MODEL.take(), MONITOR.take());
    let Some(satellite) = Satellite::new(System::Gps, 1) else {
        return;
    };
    let mut rows = [UsedRow {
        satellite,
        elevation_rad: 0.5,
        azimuth_rad: 0.0,
        sigma: RowSigma::default(),
    }; MOST];
    for (stage, rule) in METHODS {
        let config = ConsensusConfig {
            rule,
            p_false_alarm: 3.3333e-7,
            max_faults: 3,
        };
        require(monitor.configure(&config).is_ok(), "not configured");
        let mut random = Random::new(11);
        for (n, clocks) in SKIES {
            let mut figures = Row::new();
            for _ in 0..if n < MANY { RUNS } else { RUNS / 3 } {
                model(&mut random, n, clocks, epoch);
                for (row, sigma_m) in rows.iter_mut().zip(&epoch.sigma_m) {
                    row.sigma.independent_m = *sigma_m;
                }
                let mut verdict = None;
                let seen = rows.get(..n).unwrap_or(&[]);
                figures.run(|| verdict = assess(monitor, black_box(epoch), black_box(seen)));
                require(verdict.is_some_and(|v| !v.is_detected()), "no verdict");
            }
            figures.print_of(
                stage,
                &Of {
                    n_sats: Some(n),
                    n_states: Some(3 + clocks),
                    ram_b: Some(size_of::<ConsensusMonitor>()),
                    ..Of::default()
                },
            );
        }
    }
}

#[inline(never)]
fn assess(
    monitor: &mut ConsensusMonitor,
    model: &LinearModel,
    rows: &[UsedRow],
) -> Option<MonitorVerdict> {
    let epoch = MonitorEpoch::new(model, rows).ok()?;
    Some(monitor.assess(&epoch))
}
