//! Claims: every monitor of one epoch answers through the one face: it passes a healthy sky, takes a large
//! fault out, gives no level while one is in, and refuses what is no epoch.

mod skies;

use skies::{Random, add_noise, rows_of, sky};
use surefix_core::linalg::LinearModel;
use surefix_core::raim::araim::AraimParameters;
use surefix_core::raim::araim::support::{FaultRate, IntegritySupport};
use surefix_core::raim::exclusion::RowSet;
use surefix_core::raim::igg3::Igg3Config;
use surefix_core::raim::monitors::araim::{AraimConfig, AraimMonitor, PseudorangeErrors};
use surefix_core::raim::monitors::doppler::{DopplerConfig, DopplerMonitor};
use surefix_core::raim::monitors::residual::{ResidualConfig, ResidualMonitor};
use surefix_core::raim::monitors::rms::{RmsConfig, RmsMonitor, RmsRule};
use surefix_core::raim::monitors::robust::{RobustConfig, RobustMonitor};
use surefix_core::raim::monitors::vpl_mhss::{VplConfig, VplMonitor};
use surefix_core::raim::monitors::{
    ConfigureError, EpochMonitor, MonitorEpoch, NoLevels, NotTested, Outcome,
};
use surefix_core::raim::reconstructed::LevelConvention;

const RESIDUAL: ResidualConfig = ResidualConfig {
    p_false_alarm: 3.3333e-7,
    p_missed_detection: 1e-3,
    p_fault_free: 1e-7,
    max_faults: 1,
};

fn araim_config() -> AraimConfig {
    let support = IntegritySupport {
        ura_m: 1.0,
        ure_m: 1.0,
        b_nom_m: 0.5,
        satellite: FaultRate {
            p_instant: 1e-5,
            mean_duration_s: 3600.0,
        },
        constellation: FaultRate {
            p_instant: 0.0,
            mean_duration_s: 3600.0,
        },
    };
    AraimConfig {
        parameters: AraimParameters::LPV_200,
        support: [support; 3],
        errors: PseudorangeErrors::Rows,
        excludes: true,
        exposure_s: 0.0,
    }
}

/// What a monitor makes of 20 skies with and without a fault of 200 sigmas: not all give levels, and not all
/// pass every healthy one.
fn claims<M: EpochMonitor>(
    monitor: &mut M,
    config: &M::Config,
    gives_levels: bool,
    passes_healthy: usize,
) {
    let mut random = Random(5);
    let model = sky(&mut random, 12, 2);
    let rows = rows_of(&model);
    let epoch = MonitorEpoch::new(&model, &rows).unwrap();
    let untested = Outcome::NotTested(NotTested::NotConfigured);
    assert_eq!(monitor.assess(&epoch).outcome, untested);
    monitor.configure(config).unwrap();
    let mut passed = 0;
    for trial in 0..20 {
        // Three satellites of each constellation at least, so that every row can be tested.
        let mut model = sky(&mut random, 14, 1 + trial % 2);
        for row in 0..6 {
            let clock = if model.m == 5 { row % 2 } else { 0 };
            model.design[row][3..].fill(0.0);
            model.design[row][3 + clock] = 1.0;
        }
        add_noise(&mut random, &mut model);
        let rows = rows_of(&model);
        let healthy = monitor.assess(&MonitorEpoch::new(&model, &rows).unwrap());
        passed += usize::from(healthy.outcome == Outcome::Passed);
        assert_eq!(healthy.excluded.is_empty(), !healthy.is_detected());
        assert_eq!(healthy.levels.is_ok(), gives_levels);
        let reach_m = healthy.levels.map_or(30.0, |l| l.hpl_m + l.vpl_m);
        let faulty = random.integer(0, 13);
        model.residual_m[faulty] += 200.0 * model.sigma_m[faulty];
        let verdict = monitor.assess(&MonitorEpoch::new(&model, &rows).unwrap());
        assert!(verdict.is_detected());
        if verdict.outcome == Outcome::Excluded && healthy.outcome == Outcome::Passed {
            assert_eq!(verdict.excluded, RowSet::EMPTY.with(faulty));
            let position = verdict.position_enu_m.unwrap();
            let moved: f64 = position
                .iter()
                .zip(healthy.position_enu_m.unwrap())
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f64::max);
            assert!(moved < reach_m, "{moved}");
            assert_eq!(verdict.levels.is_ok(), gives_levels);
        } else if verdict.outcome == Outcome::Detected && gives_levels {
            assert_eq!(verdict.levels, Err(NoLevels::FaultPresent));
        }
        // Two rows too few to test anything, and no number.
        let mut poor = model.clone();
        poor.n = poor.m;
        let verdict = monitor.assess(&MonitorEpoch::new(&poor, &rows[..poor.n]).unwrap());
        assert!(matches!(verdict.outcome, Outcome::NotTested(_)));
        assert!(verdict.levels.is_err());
        let mut broken = model.clone();
        broken.residual_m[faulty] = f64::NAN;
        let verdict = monitor.assess(&MonitorEpoch::new(&broken, &rows).unwrap());
        assert!(matches!(verdict.outcome, Outcome::NotTested(_)));
        assert_eq!(
            (verdict.position_enu_m, verdict.levels.is_ok()),
            (None, false)
        );
    }
    assert!(passed >= passes_healthy, "{passed} healthy skies passed");
    let nothing = MonitorEpoch::new(&LinearModel::EMPTY, &[]).unwrap();
    assert!(matches!(
        monitor.assess(&nothing).outcome,
        Outcome::NotTested(_)
    ));
}

#[test]
fn residual_raim_answers_through_the_face() {
    let mut monitor = Box::new(ResidualMonitor::EMPTY);
    claims(&mut *monitor, &RESIDUAL, true, 20);
    for max_faults in [0, 4] {
        let refused = monitor.configure(&ResidualConfig {
            max_faults,
            ..RESIDUAL
        });
        assert!(matches!(refused, Err(ConfigureError::OutOfRange { .. })));
    }
}

#[test]
fn doppler_raim_answers_through_the_face() {
    let mut monitor = Box::new(DopplerMonitor::EMPTY);
    claims(&mut *monitor, &DopplerConfig::FREE_SKY, true, 20);
    for sigma_factor in [0.0, -1.0, 1e3, f64::NAN] {
        let refused = monitor.configure(&DopplerConfig {
            sigma_factor,
            ..DopplerConfig::FREE_SKY
        });
        assert!(matches!(refused, Err(ConfigureError::OutOfRange { .. })));
        let mut random = Random(6);
        let model = sky(&mut random, 8, 1);
        let epoch = MonitorEpoch::new(&model, &rows_of(&model)).map(|epoch| monitor.assess(&epoch));
        let untested = Outcome::NotTested(NotTested::NotConfigured);
        assert_eq!(epoch.unwrap().outcome, untested);
    }
}

#[test]
fn araim_answers_through_the_face() {
    static MONITOR: std::sync::Mutex<AraimMonitor> = std::sync::Mutex::new(AraimMonitor::EMPTY);
    let mut monitor = MONITOR.lock().unwrap();
    claims(&mut *monitor, &araim_config(), true, 20);
    let refused = monitor.configure(&AraimConfig {
        exposure_s: f64::NAN,
        ..araim_config()
    });
    assert!(matches!(refused, Err(ConfigureError::OutOfRange { .. })));
}

#[test]
fn robust_estimation_answers_through_the_face() {
    let mut monitor = Box::new(RobustMonitor::EMPTY);
    let config = RobustConfig {
        estimator: Igg3Config::CORRECTED,
        levels: LevelConvention::CORRECTED,
    };
    // Its weights take healthy rows of large leverage out, see docs/decisions/020-robust.md.
    claims(&mut *monitor, &config, true, 10);
    let refused = monitor.configure(&RobustConfig {
        levels: LevelConvention {
            k_vertical: f64::NAN,
            ..LevelConvention::CORRECTED
        },
        ..config
    });
    assert!(matches!(refused, Err(ConfigureError::OutOfRange { .. })));
}

#[test]
fn vpl_separation_answers_through_the_face() {
    let mut monitor = Box::new(VplMonitor::EMPTY);
    claims(&mut *monitor, &VplConfig::PRESET, true, 20);
    for p in [0.0, 1.0, f64::NAN] {
        let refused = monitor.configure(&VplConfig {
            p_false_alarm: p,
            ..VplConfig::PRESET
        });
        assert!(matches!(refused, Err(ConfigureError::Stats(_))));
    }
}

#[test]
fn rms_comparison_answers_through_the_face() {
    let mut monitor = Box::new(RmsMonitor::EMPTY);
    let config = RmsConfig {
        p_false_alarm: 3.3333e-7,
        rule: RmsRule::Corrected,
    };
    claims(&mut *monitor, &config, false, 20);
    let impossible = RmsConfig {
        p_false_alarm: 0.0,
        ..config
    };
    assert!(monitor.configure(&impossible).is_err());
}

/// With redundancy 1 the residuals have the same proportions whichever row failed.
#[test]
fn rms_comparison_names_nothing_with_one_redundant_row() {
    let mut random = Random(13);
    let mut monitor = Box::new(RmsMonitor::EMPTY);
    monitor
        .configure(&RmsConfig {
            p_false_alarm: 3.3333e-7,
            rule: RmsRule::Corrected,
        })
        .unwrap();
    for faulty in 0..5 {
        let mut model = sky(&mut random, 5, 1);
        model.residual_m[faulty] = 1e4;
        let rows = rows_of(&model);
        let verdict = monitor.assess(&MonitorEpoch::new(&model, &rows).unwrap());
        assert_eq!(
            (verdict.outcome, verdict.excluded),
            (Outcome::Detected, RowSet::EMPTY)
        );
    }
}

#[test]
fn araim_takes_the_highest_satellites_of_too_many() {
    let mut random = Random(8);
    let mut model = sky(&mut random, 32, 1);
    add_noise(&mut random, &mut model);
    let rows = rows_of(&model);
    let mut lowest = 0;
    for row in 0..32 {
        if rows[row].elevation_rad < rows[lowest].elevation_rad {
            lowest = row;
        }
    }
    static MONITOR: std::sync::Mutex<AraimMonitor> = std::sync::Mutex::new(AraimMonitor::EMPTY);
    let mut monitor = MONITOR.lock().unwrap();
    monitor.configure(&araim_config()).unwrap();
    let healthy = monitor.assess(&MonitorEpoch::new(&model, &rows).unwrap());
    assert_eq!(healthy.outcome, Outcome::Passed);
    model.residual_m[lowest] += 1e4;
    let verdict = monitor.assess(&MonitorEpoch::new(&model, &rows).unwrap());
    assert_eq!(verdict, healthy);
}
