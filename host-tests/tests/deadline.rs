//! An answer that takes too long is taken back; a fault that was found stays an alert.

use std::path::PathBuf;

use surefix_core::budget::{CycleCounter, EPOCH_BUDGET, NoCounter};
use surefix_core::config::Config;
use surefix_core::integrity::{Integrity, NoBound, ProtectionLevel, Reason};
use surefix_core::monitor::{Monitor, Ready};
use surefix_core::report::EpochReport;
use surefix_host_tests::simulate::{self, atmosphere::Ionosphere, flight::Flight, stream::Format};

/// A clock on which every stage takes longer than a whole epoch may.
struct Slow {
    now: u32,
}

impl CycleCounter for Slow {
    fn now(&mut self) -> u32 {
        self.now = self.now.wrapping_add(EPOCH_BUDGET + 1);
        self.now
    }
}

/// Twenty seconds of a fixed receiver, with a step of 300 m on G04 in the second half.
fn stream() -> Vec<u8> {
    simulate::simulate(&simulate::Args {
        name: Flight::Static,
        seed: 3,
        out: PathBuf::new(),
        rate_hz: 1.0,
        duration: Some(20.0),
        noise_free: false,
        dual_frequency: false,
        no_troposphere: false,
        ionosphere: Ionosphere::Klobuchar,
        receiver: Format::Rtcm3,
        faults: vec!["G04:step:300:10:100".parse().unwrap()],
        disturbances: simulate::disturbances::Disturbances::default(),
    })
    .unwrap()
    .receiver
}

fn reports(bytes: &[u8], counter: &mut impl CycleCounter) -> (Vec<EpochReport>, u32) {
    let mut monitor = Box::new(Monitor::EMPTY);
    let config = Config {
        max_exclusions: 0,
        ..Config::PRESET
    };
    monitor.configure(&config).unwrap();
    let mut reports = Vec::new();
    let mut rest = bytes;
    loop {
        let (used, ready) = monitor.push(rest);
        rest = &rest[used..];
        match ready {
            Some(Ready::Epoch) => reports.push(monitor.process(counter)),
            Some(Ready::EndOfStream) => break,
            None if rest.is_empty() => break,
            None => {}
        }
    }
    (reports, monitor.ledger().deadline_misses())
}

/// INT-008.
#[test]
fn an_epoch_over_budget_is_unavailable_without_levels_and_an_alert_stays_one() {
    let bytes = stream();
    let (in_time, misses) = reports(&bytes, &mut NoCounter);
    assert_eq!(misses, 0);
    let (late, misses) = reports(&bytes, &mut Slow { now: 0 });
    assert_eq!(misses as usize, late.len());
    assert_eq!(late.len(), in_time.len());
    let (mut withdrawn, mut alerts) = (0, 0);
    for (late, in_time) in late.iter().zip(&in_time) {
        let verdict = &late.verdict;
        for level in [verdict.hpl, verdict.vpl] {
            assert_eq!(level, ProtectionLevel::Unavailable(NoBound::DeadlineMissed));
        }
        if in_time.verdict.integrity == Integrity::Alert {
            assert_eq!(verdict.integrity, Integrity::Alert);
            assert_eq!(verdict.reason, Reason::FaultNotIsolated);
            alerts += 1;
        } else {
            assert_eq!(in_time.verdict.integrity, Integrity::Nominal);
            assert_eq!(verdict.integrity, Integrity::Unavailable);
            assert_eq!(verdict.reason, Reason::DeadlineMissed);
            withdrawn += 1;
        }
    }
    assert!(withdrawn >= 10 && alerts >= 10, "{withdrawn}, {alerts}");
}

/// INT-008. Whoever runs the monitor knows how long its bytes waited.
#[test]
fn a_report_that_cannot_be_sent_in_time_is_taken_back_and_counted_once() {
    let mut monitor = Box::new(Monitor::EMPTY);
    monitor.configure(&Config::PRESET).unwrap();
    let bytes = stream();
    let (mut rest, mut epochs) = (&bytes[..], 0);
    loop {
        let (used, ready) = monitor.push(rest);
        rest = &rest[used..];
        match ready {
            Some(Ready::Epoch) if epochs % 2 == 0 => {
                let mut report = monitor.process(&mut NoCounter);
                monitor.miss_deadline(&mut report);
                epochs += 1;
                assert_eq!(
                    report.verdict.vpl,
                    ProtectionLevel::Unavailable(NoBound::DeadlineMissed)
                );
                assert!(!report.verdict.integrity.is_usable());
            }
            Some(Ready::Epoch) => {
                // Late by its own work already: no second miss.
                let mut report = monitor.process(&mut Slow { now: 0 });
                monitor.miss_deadline(&mut report);
                epochs += 1;
            }
            _ if rest.is_empty() => break,
            _ => {}
        }
    }
    assert!(epochs >= 20);
    assert_eq!(monitor.ledger().deadline_misses(), epochs);
    assert_eq!(monitor.epoch_interval_ns(), Some(1_000_000_000));
}
