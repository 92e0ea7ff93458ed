//! Epochs that arrive late are applied at their own time: late or not, the filter says the same.

use surefix_core::integrity::{InertialStatus, Mode, Reason};
use surefix_host_tests::latency::{Arrival, Course, LateFlight, Said, Setting, rms_and_worst};

/// The bound on what latency may cost: 2 cm and a hundredth.
fn is_as_good(late_m: f64, at_once_m: f64) -> bool {
    late_m <= at_once_m + 0.02 + 0.01 * at_once_m
}

fn at_once(flight: &LateFlight, with_bank: bool) -> Said {
    let setting = Setting {
        arrival: Arrival::After(0),
        known_ms: None,
        with_bank,
    };
    flight.run(&setting).unwrap()
}

#[test]
fn probe() {
    for course in Course::ALL {
        for hz in [1, 4, 10] {
            let flight = LateFlight::new(course, 90, hz, 100, 1).unwrap();
            let base = at_once(&flight, false);
            println!(
                "{course:?} {hz} Hz at once: {:?} {:?}",
                rms_and_worst(&base.at_epochs),
                rms_and_worst(&base.now)
            );
            for arrival in [
                Arrival::After(50),
                Arrival::After(120),
                Arrival::After(300),
                Arrival::Between(50, 300),
                Arrival::Growing(4),
                Arrival::Worse {
                    ms: 50,
                    span_s: (40, 50),
                    worse_ms: 800,
                },
            ] {
                let setting = Setting {
                    arrival,
                    known_ms: None,
                    with_bank: false,
                };
                let late = flight.run(&setting).unwrap();
                let same = base
                    .reports
                    .iter()
                    .zip(&late.reports)
                    .take_while(|(a, b)| a == b)
                    .count();
                let last = late.inertial.last().unwrap().timing;
                let r3 = |x: [f64; 2]| format!("{:.3} {:.3}", x[0], x[1]);
                let silent = late
                    .reports
                    .iter()
                    .filter(|r| r.verdict.reason == Reason::ReceiverSilent)
                    .count();
                let tight = late
                    .reports
                    .iter()
                    .filter(|r| r.mode == Mode::Tight)
                    .count();
                println!(
                    "  {arrival:?}: {} reports, {} at once, {same} same, silent {silent} tight {tight} late {:?}; {:?} {:?}",
                    late.reports.len(),
                    base.reports.len(),
                    last.horizon,
                    rms_and_worst(&late.at_epochs),
                    rms_and_worst(&late.now)
                );
            }
        }
    }
    let _ = InertialStatus::Running;
    let _ = is_as_good(0.0, 0.0);
}
