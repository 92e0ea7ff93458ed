//! How long an alert and an exclusion last, through the monitor's bytes.

use std::path::PathBuf;

use surefix_core::budget::NoCounter;
use surefix_core::config::{Config, IonosphereModel};
use surefix_core::integrity::{AlertState, Integrity, NoBound, ProtectionLevel, Reason};
use surefix_core::mhss::probation::PROOF_NS;
use surefix_core::monitor::{Monitor, Ready};
use surefix_core::report::EpochReport;
use surefix_core::time::NS_PER_S;
use surefix_host_tests::simulate::disturbances::Disturbances;
use surefix_host_tests::simulate::stream::Format;
use surefix_host_tests::simulate::{self, atmosphere::Ionosphere, flight::Flight};

/// A fixed receiver with a fault.
fn stream(rate_hz: f64, duration_s: f64, fault: &str) -> Vec<u8> {
    simulate::simulate(&simulate::Args {
        name: Flight::Static,
        seed: 3,
        out: PathBuf::new(),
        rate_hz,
        duration: Some(duration_s),
        noise_free: false,
        dual_frequency: false,
        no_troposphere: false,
        ionosphere: Ionosphere::None,
        faults: vec![fault.parse().unwrap()],
        receiver: Format::Rtcm3,
        disturbances: Disturbances::default(),
    })
    .unwrap()
    .receiver
}

fn monitor(max_exclusions: u8) -> Box<Monitor> {
    let mut monitor = Box::new(Monitor::EMPTY);
    let config = Config {
        ionosphere: IonosphereModel::None,
        max_exclusions,
        ..Config::PRESET
    };
    monitor.configure(&config).unwrap();
    monitor
}

/// What is told of each epoch, and its time since the first, s.
fn told(monitor: &mut Monitor, bytes: &[u8]) -> Vec<(f64, EpochReport)> {
    let mut reports = Vec::new();
    let mut take = |report: EpochReport| {
        reports.push((report.since_first_ns as f64 / NS_PER_S as f64, report));
    };
    let mut rest = bytes;
    while !rest.is_empty() {
        let (used, ready) = monitor.push(rest);
        rest = &rest[used..];
        if ready == Some(Ready::Epoch) {
            take(monitor.process(&mut NoCounter));
        }
    }
    while monitor.finish() == Ready::Epoch {
        take(monitor.process(&mut NoCounter));
    }
    reports
}

/// INT-060.
#[test]
fn an_alert_is_told_at_its_epoch_and_held_for_two_minutes_at_every_rate() {
    for rate_hz in [1.0, 4.0, 5.0, 10.0] {
        let bytes = stream(rate_hz, 140.0, "G04:step:300:10:15");
        let mut monitor = monitor(0);
        let reports = told(&mut monitor, &bytes);
        assert_eq!(reports.len(), (140.0 * rate_hz) as usize + 1);
        for (t_s, report) in &reports {
            let verdict = &report.verdict;
            let is_faulty = (10.0..15.0).contains(t_s);
            let is_held = (15.0..135.0).contains(t_s);
            let expected = if is_faulty {
                (Integrity::Alert, Reason::FaultNotIsolated)
            } else if is_held {
                (Integrity::Alert, Reason::AlertHeld)
            } else {
                (Integrity::Nominal, Reason::None)
            };
            assert_eq!((verdict.integrity, verdict.reason), expected, "{t_s}");
            let level = match (is_faulty, is_held) {
                (true, _) => Some(NoBound::FaultPresent),
                (_, true) => Some(NoBound::AlertHeld),
                _ => None,
            };
            for found in [verdict.hpl, verdict.vpl] {
                match level {
                    Some(why) => assert_eq!(found, ProtectionLevel::Unavailable(why), "{t_s}"),
                    None => assert!(found.bound_m().is_some(), "{t_s}"),
                }
            }
        }
        assert_eq!(monitor.alert_state(), AlertState::Nominal);
    }
}

/// INT-062.
#[test]
fn a_satellite_that_one_epoch_excludes_is_out_of_the_next_until_it_has_proved_itself() {
    let proof_s = PROOF_NS as f64 / NS_PER_S as f64;
    for (rate_hz, fault, faulty_s) in [
        (1.0, "G04:step:300:20:40", 20.0..40.0),
        // Too short to be seen twice.
        (1.0, "G04:step:300:20:21", 20.0..21.0),
        (4.0, "G04:step:-60:20:30", 20.0..30.0),
    ] {
        let bytes = stream(rate_hz, 400.0, fault);
        let reports = told(&mut monitor(3), &bytes);
        let satellite = "G04";
        for (t_s, report) in &reports {
            // The epoch with which it has proved itself was assessed without it.
            let is_out = (faulty_s.start..=faulty_s.end + proof_s).contains(t_s);
            let expected = if is_out {
                Integrity::Excluded
            } else {
                Integrity::Nominal
            };
            assert_eq!(report.verdict.integrity, expected, "{fault} {t_s}");
            let used = report.used.iter().any(|used| used.to_string() == satellite);
            assert_eq!(used, !is_out, "{fault} {t_s}");
            let excluded: Vec<String> = report
                .verdict
                .excluded
                .iter()
                .map(|excluded| excluded.to_string())
                .collect();
            assert_eq!(
                excluded,
                if is_out { vec![satellite] } else { vec![] },
                "{t_s}"
            );
        }
    }
}

/// A ramp that is still small when it is found disagrees while it grows: it does not prove the satellite. INT-062.
#[test]
fn a_satellite_whose_fault_goes_on_stays_out() {
    let bytes = stream(1.0, 700.0, "G04:ramp:0.05:20:701");
    let reports = told(&mut monitor(3), &bytes);
    let first = reports
        .iter()
        .position(|(_, report)| report.verdict.integrity == Integrity::Excluded)
        .unwrap();
    for (t_s, report) in &reports[first..] {
        assert_eq!(report.verdict.integrity, Integrity::Excluded, "{t_s}");
    }
}

/// An answer that is not sent is an epoch without one; what was told before it stays. INT-060.
#[test]
fn an_answer_not_sent_in_time_costs_its_epoch_alone() {
    let bytes = stream(1.0, 20.0, "G04:step:300:10:11");
    let mut monitor = monitor(0);
    let mut rest = &bytes[..];
    let mut states = Vec::new();
    while !rest.is_empty() {
        let (used, ready) = monitor.push(rest);
        rest = &rest[used..];
        if ready == Some(Ready::Epoch) {
            let mut report = monitor.process(&mut NoCounter);
            let is_late = states.len() == 5 || states.len() == 10 || states.len() == 12;
            if is_late {
                monitor.miss_deadline(&mut report);
            }
            states.push((monitor.alert_state(), report.verdict.integrity));
        }
    }
    for (k, state) in states.iter().enumerate() {
        let expected = match k {
            5 => (AlertState::Interrupted, Integrity::Unavailable),
            ..10 => (AlertState::Nominal, Integrity::Nominal),
            _ => (AlertState::Alert, Integrity::Alert),
        };
        assert_eq!(*state, expected, "{k}");
    }
}
