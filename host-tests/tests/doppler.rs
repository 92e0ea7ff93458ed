//! Claims: Doppler RAIM raises false alerts as often as it is told; a fault of a range rate that it misses and a
//! velocity error above its level come together with at most P_MD; on recordings no alert comes without a step,
//! steps are found, the satellite that has one is taken out, and the velocity stays within its level; a velocity
//! whose range rates contradict each other is flagged.

mod common;
mod skies;

use skies::{Random, add_noise, rows_of, sky};
use surefix_core::config::Config;
use surefix_core::gnss::solution::RangeRates;
use surefix_core::raim::exclusion::RowSet;
use surefix_core::raim::monitors::doppler::{DopplerConfig, DopplerMonitor};
use surefix_core::raim::monitors::residual::ResidualConfig;
use surefix_core::raim::monitors::{EpochMonitor, MonitorEpoch, MonitorVerdict, Outcome};
use surefix_host_tests::campaign::binomial;
use surefix_host_tests::campaign::robust::recordings::{self, Place, Prepared};
use surefix_host_tests::replay::{self, ReplayOptions};

const SEED: u64 = 1;

fn monitor(config: &DopplerConfig) -> Box<DopplerMonitor> {
    let mut monitor = Box::new(DopplerMonitor::EMPTY);
    monitor.configure(config).unwrap();
    monitor
}

/// Probabilities large enough to be counted.
fn with_risks(p_false_alarm: f64, p_missed_detection: f64) -> DopplerConfig {
    DopplerConfig {
        test: ResidualConfig {
            p_false_alarm,
            p_missed_detection,
            ..DopplerConfig::FREE_SKY.test
        },
        ..DopplerConfig::FREE_SKY
    }
}

/// INT-144. 20,000 skies of 5 to 20 range rates: the 99 % interval of the rate holds the one allocated.
#[test]
fn int_144_false_alerts_of_doppler_raim_are_as_frequent_as_allocated() {
    const SKIES: u64 = 20_000;
    for p_false_alarm in [1e-2, 1e-3] {
        let mut random = Random(144);
        let mut monitor = monitor(&with_risks(p_false_alarm, 1e-4));
        let mut alerts = 0;
        for _ in 0..SKIES {
            let n = random.integer(5, 20);
            let mut model = sky(&mut random, n, 1);
            add_noise(&mut random, &mut model);
            let rows = rows_of(&model);
            let verdict = monitor.assess(&MonitorEpoch::new(&model, &rows).unwrap());
            alerts += u64::from(verdict.is_detected());
        }
        let [low, high] = binomial::clopper_pearson(alerts, SKIES, 0.99);
        println!("{p_false_alarm} allocated, {alerts} of {SKIES}: {low:.2e} to {high:.2e} (99 %)");
        assert!(low <= p_false_alarm && p_false_alarm <= high);
    }
}

/// INT-144. Faults of the size that the test misses most harmfully, on every row's turn: missed and with an error
/// above the level no more often than P_MD, by the lower end of the 99 % interval.
#[test]
fn int_144_a_missed_range_rate_fault_and_an_error_above_the_level_are_rarer_than_p_md() {
    const P_MD: f64 = 0.1;
    let mut random = Random(145);
    let mut monitor = monitor(&with_risks(1e-3, P_MD));
    let (mut trials, mut missed, mut harmful) = (0, 0, 0);
    for _ in 0..200 {
        let n = random.integer(6, 14);
        let healthy = sky(&mut random, n, 1);
        let rows = rows_of(&healthy);
        let faulty = random.integer(0, n - 1);
        // Where half of the faults are missed or so.
        let sigmas = 4.0 + 8.0 * random.uniform();
        for _ in 0..50 {
            let mut model = healthy.clone();
            for row in 0..n {
                model.residual_m[row] = model.sigma_m[row] * random.normal();
            }
            model.residual_m[faulty] += sigmas * model.sigma_m[faulty];
            let verdict = monitor.assess(&MonitorEpoch::new(&model, &rows).unwrap());
            trials += 1;
            if verdict.outcome == Outcome::Passed {
                missed += 1;
                harmful += u64::from(is_above(&verdict, [0.0; 3]));
            }
        }
    }
    let [low, high] = binomial::clopper_pearson(harmful, trials, 0.99);
    println!(
        "{trials} faults, {missed} missed, {harmful} with an error above the level: {low:.1e} to {high:.1e} (99 %)"
    );
    assert!(missed * 10 > trials, "{missed}");
    assert!(low <= P_MD);
}

/// Whether the velocity is farther from the true one than a level says.
fn is_above(verdict: &MonitorVerdict, true_mps: [f64; 3]) -> bool {
    let (Some([e, n, u]), Ok(levels)) = (verdict.position_enu_m, verdict.levels) else {
        return false;
    };
    let [true_e, true_n, true_u] = true_mps;
    (e - true_e).hypot(n - true_n) > levels.hpl_m || (u - true_u).abs() > levels.vpl_m
}

/// What became of the epochs of a recording.
#[derive(Debug, Default)]
struct Counts {
    epochs: u64,
    not_tested: u64,
    passed: u64,
    alerts: u64,
    excluded: u64,
    /// Another row than the faulty one, or more than it.
    wrong: u64,
    above: u64,
    largest_hvl_mps: f64,
    largest_error_mps: f64,
}

impl Counts {
    fn book(&mut self, verdict: &MonitorVerdict, faulty: RowSet, epoch: &Prepared) {
        self.epochs += 1;
        match verdict.outcome {
            Outcome::NotTested(_) => self.not_tested += 1,
            Outcome::Passed => self.passed += 1,
            Outcome::Detected => self.alerts += 1,
            Outcome::Excluded => {
                self.excluded += 1;
                self.wrong += u64::from(verdict.excluded != faulty);
            }
        }
        let (Ok(levels), Some(true_mps)) = (verdict.levels, epoch.velocity_enu_mps) else {
            return;
        };
        self.above += u64::from(is_above(verdict, true_mps));
        self.largest_hvl_mps = self.largest_hvl_mps.max(levels.hpl_m);
        let errors = verdict.position_enu_m.unwrap().into_iter().zip(true_mps);
        let error = errors.fold(0.0_f64, |so_far, (v, t)| so_far.max((v - t).abs()));
        self.largest_error_mps = self.largest_error_mps.max(error);
    }
}

/// Every epoch of a recording with a step on one range rate, drawn anew; 0 is none.
fn with_step(monitor: &mut DopplerMonitor, epochs: &[Prepared], step_mps: f64) -> Counts {
    let mut random = Random(146);
    let mut counts = Counts::default();
    for epoch in epochs {
        let RangeRates { model, rows } = &*epoch.rates;
        let mut model = model.clone();
        let faulty = random.integer(0, model.n - 1);
        model.residual_m[faulty] += if random.uniform() < 0.5 {
            step_mps
        } else {
            -step_mps
        };
        let verdict = monitor.assess(&MonitorEpoch::new(&model, rows).unwrap());
        counts.book(&verdict, RowSet::EMPTY.with(faulty), epoch);
    }
    counts
}

/// INT-145.
#[test]
fn int_145_steps_on_the_range_rates_of_recordings_are_found_and_the_right_satellite_goes() {
    let Some(data) = common::shared("data") else {
        return;
    };
    let places: [(Place, f64); 4] = [
        (recordings::ESBC, 1.0),
        (recordings::NAGOYA, 1.0),
        (recordings::FLIGHT, 1.0),
        (recordings::WALK, 15.0),
    ];
    for (place, sigma_factor) in places {
        let subject = recordings::read(&data, &place, &Config::PRESET, SEED).unwrap();
        let mut monitor = monitor(&DopplerConfig {
            sigma_factor,
            ..DopplerConfig::FREE_SKY
        });
        for step in [0.0, 0.2, 0.5, 1.0, 2.0, 5.0, 20.0] {
            let step_mps = step * sigma_factor;
            let counts = with_step(&mut monitor, &subject.epochs, step_mps);
            println!(
                "{}, sigma times {sigma_factor}, step {step_mps} m/s: {counts:?}",
                subject.name
            );
            assert_eq!(counts.above, 0, "{}", subject.name);
            assert_eq!(counts.wrong, 0, "{}", subject.name);
            let found = counts.alerts + counts.excluded;
            if step == 0.0 && sigma_factor == 1.0 {
                assert_eq!(counts.passed, counts.epochs, "{}", subject.name);
            }
            if step >= 2.0 && sigma_factor == 1.0 {
                assert_eq!(found, counts.epochs, "{}", subject.name);
                assert!(counts.excluded * 100 >= 95 * counts.epochs, "{counts:?}");
            }
        }
    }
}

/// INT-145. Where the sky is free no epoch is flagged; among obstructions range rates contradict each other often, and
/// are flagged where the test of the monitor fails that has the same sigma.
#[test]
fn int_145_a_velocity_whose_range_rates_contradict_each_other_is_flagged() {
    let flagged = |folder: &str, files: [&str; 2]| {
        let gnss = common::shared(&format!("data/{folder}/{}", files[0]))?;
        let mut options = ReplayOptions::new(gnss);
        options.nav = vec![common::shared(&format!("data/{folder}/{}", files[1]))?];
        let result = replay::run(&options, &mut |_, _| {}).unwrap();
        let with_velocity = |report: &&surefix_core::report::EpochReport| {
            report.fix.is_some_and(|fix| fix.velocity_enu_mps.is_some())
        };
        let reports = || result.reports.iter().filter(with_velocity);
        let flagged = reports().filter(|report| report.flags.range_rates_disagree);
        Some((flagged.count(), reports().count()))
    };
    let nagoya = flagged("matrtklib-static-2024", ["rover.obs", "base.nav"]);
    let walk = flagged(
        "walk0827-x20p-imu",
        ["derived_convbin.obs", "derived_convbin.nav"],
    );
    println!("flagged: nagoya {nagoya:?}, walk {walk:?}");
    if let (Some((free, _)), Some((obstructed, of))) = (nagoya, walk) {
        assert_eq!(free, 0);
        assert!(
            obstructed > of / 5 && obstructed < of,
            "{obstructed} of {of}"
        );
    }
}
