//! Epochs that arrive late are applied at their own time: late or not, the monitor says the same. What comes
//! too late is counted, flagged, and in no filter.

#[path = "tight_mode/flight.rs"]
mod flight;

use flight::{COURSE, Input, LENGTH_S, Row, at, run, unit};
use proptest::prelude::*;
use surefix_core::budget::NoCounter;
use surefix_core::ingest::encode_receiver_latency;
use surefix_core::integrity::{InertialStatus, Mode, Reason};
use surefix_core::monitor::Ready;
use surefix_host_tests::latency::{Arrival, Course, LateFlight, Said, Setting, rms_and_worst};
use surefix_host_tests::replay::new_monitor;

const DURATION_S: u32 = 90;

fn setting(arrival: Arrival) -> Setting {
    Setting {
        arrival,
        known_ms: None,
        with_bank: false,
    }
}

fn at_once(flight: &LateFlight) -> Said {
    flight.run(&setting(Arrival::After(0))).unwrap()
}

/// What latency may cost: 2 cm and a hundredth.
fn is_as_good(late_m: f64, at_once_m: f64) -> bool {
    late_m <= at_once_m + 0.02 + 0.01 * at_once_m
}

/// The same reports, and positions now that are nearly as good.
fn assert_as_at_once(late: &Said, at_once: &Said, name: &str) {
    assert_eq!(late.reports.len(), at_once.reports.len(), "{name}");
    for (late, at_once) in late.reports.iter().zip(&at_once.reports) {
        assert_eq!(late, at_once, "{name}");
    }
    let timing = late.inertial.last().unwrap().timing;
    assert_eq!(timing.horizon.too_late, 0, "{name}");
    assert_eq!(late.now.len(), at_once.now.len(), "{name}");
    let errors_m = [rms_and_worst(&late.now), rms_and_worst(&at_once.now)];
    let [[rms_m, worst_m], [rms_at_once_m, worst_at_once_m]] = errors_m;
    println!(
        "{name}: now {rms_m:.3} m, at once {rms_at_once_m:.3} m, worst {worst_m:.3} m, {worst_at_once_m:.3} m"
    );
    assert!(is_as_good(rms_m, rms_at_once_m), "{name}");
    assert!(is_as_good(worst_m, worst_at_once_m), "{name}");
}

/// INT-123.
#[test]
fn int_123_a_latency_is_taken_before_the_first_epoch_and_refused_after_it() {
    let frame = |latency_ns: u32| {
        let mut out = [0; 32];
        let length = encode_receiver_latency(latency_ns, &mut out).unwrap();
        out[..length].to_vec()
    };
    let mut monitor = new_monitor();
    let mut feed = |bytes: &[u8]| {
        let mut rest = bytes;
        while !rest.is_empty() {
            let (used, ready) = monitor.push(rest);
            rest = &rest[used..];
            if ready == Some(Ready::Epoch) {
                let report = monitor.process(&mut NoCounter);
                let inertial = monitor.inertial_report(&report).unwrap();
                assert_eq!(inertial.timing.latency_ns, 120_000_000);
            }
        }
        (
            monitor.refused_configurations(),
            monitor.counters().native_refused,
        )
    };
    feed(&flight::preamble(&unit(COURSE)));
    assert_eq!(feed(&frame(120_000_000)), (0, 0));
    assert_eq!(feed(&frame(400_000_001)), (0, 1));
    let inputs = flight::flight();
    assert_eq!(feed(&inputs[0].bytes()), (0, 1));
    assert_eq!(feed(&frame(200_000_000)), (1, 1));
    for input in &inputs[1..=202] {
        feed(&input.bytes());
    }
}

/// INT-125, INT-128. 16 m/s and 100 m/s, receivers at 1, 4 and 10 Hz.
#[test]
fn int_125_an_epoch_that_is_late_is_applied_at_its_own_time() {
    for course in Course::ALL {
        for gnss_hz in [1, 4, 10] {
            let flight = LateFlight::new(course, DURATION_S, gnss_hz, 100, 1).unwrap();
            let at_once = at_once(&flight);
            let tight = at_once.reports.iter().filter(|r| r.mode == Mode::Tight);
            assert_eq!(tight.count(), at_once.reports.len() - 2);
            for arrival in [
                Arrival::After(50),
                Arrival::After(120),
                Arrival::After(300),
                Arrival::Growing(4),
            ] {
                let late = flight.run(&setting(arrival)).unwrap();
                let name = format!("{}, {gnss_hz} Hz, {arrival:?}", course.name());
                assert_as_at_once(&late, &at_once, &name);
            }
            // Uniformly from 50 to 300 ms, of which the monitor has been told.
            let known = Setting {
                known_ms: Some(300),
                ..setting(Arrival::Between(50, 300))
            };
            let late = flight.run(&known).unwrap();
            assert_as_at_once(&late, &at_once, &format!("{}, {known:?}", course.name()));
        }
    }
}

/// INT-125. With the filters of the bank, whose verdicts are in the reports.
#[test]
fn int_125_the_bank_says_the_same_of_late_epochs() {
    for (course, gnss_hz) in [(Course::Car, 4), (Course::Aircraft, 1)] {
        let flight = LateFlight::new(course, 40, gnss_hz, 100, 2).unwrap();
        let with_bank = |arrival| {
            let with_bank = true;
            flight
                .run(&Setting {
                    with_bank,
                    ..setting(arrival)
                })
                .unwrap()
        };
        let at_once = with_bank(Arrival::After(0));
        for ms in [50, 120, 300] {
            let late = with_bank(Arrival::After(ms));
            assert_as_at_once(
                &late,
                &at_once,
                &format!("{course:?}, {gnss_hz} Hz, {ms} ms"),
            );
        }
    }
}

/// INT-125. The fastest samples and epochs, at the end of the history.
#[test]
fn int_125_eight_epochs_of_a_fast_receiver_may_be_on_their_way() {
    let flight = LateFlight::new(Course::Aircraft, 40, 20, 400, 3).unwrap();
    let at_once = at_once(&flight);
    let late = flight.run(&setting(Arrival::After(390))).unwrap();
    assert_as_at_once(&late, &at_once, "20 Hz, 390 ms");
    let held = late.inertial.iter().map(|i| i.timing.horizon.held).max();
    assert_eq!(held, Some(156));
    let late = flight.run(&setting(Arrival::After(400))).unwrap();
    assert_as_at_once(&late, &at_once, "20 Hz, 400 ms");
}

/// INT-126.
#[test]
fn int_126_an_epoch_beyond_the_history_is_counted_and_flagged_and_in_no_filter() {
    for course in Course::ALL {
        for gnss_hz in [1_usize, 4, 10] {
            let flight = LateFlight::new(course, DURATION_S, gnss_hz as u32, 100, 1).unwrap();
            let at_once = at_once(&flight);
            let arrival = Arrival::Worse {
                ms: 50,
                span_s: (40, 50),
                worse_ms: 800,
            };
            let late = flight.run(&setting(arrival)).unwrap();
            // As if nothing were to come, until it does.
            assert_eq!(
                late.reports[..40 * gnss_hz],
                at_once.reports[..40 * gnss_hz]
            );
            let (mut told, mut ended) = (0, false);
            for report in &late.reports {
                let t_s = flight.t_s(report.time);
                if !(40.0..50.0).contains(&t_s) || report.verdict.reason == Reason::ReceiverSilent {
                    continue;
                }
                // Late epochs are those of the snapshot alone.
                assert_eq!(report.mode, Mode::Snapshot, "{t_s}");
                let why = report.inertial;
                assert!(
                    matches!(why, InertialStatus::EpochLate | InertialStatus::ImuTime),
                    "{t_s}: {why:?}"
                );
                ended |= why == InertialStatus::ImuTime;
                told += 1;
            }
            assert_eq!(told, 10 * gnss_hz);
            assert!(ended);
            let counted = late.inertial.last().unwrap().timing.horizon.too_late as usize;
            assert!(
                (10 * gnss_hz..=10 * gnss_hz + 10).contains(&counted),
                "{counted}"
            );
            // And back it comes, by itself.
            for report in &late.reports {
                let t_s = flight.t_s(report.time);
                if t_s >= 53.5 {
                    assert_eq!(report.inertial, InertialStatus::Running, "{t_s}");
                    assert_eq!(report.mode, Mode::Tight, "{t_s}");
                }
            }
        }
    }
}

/// INT-126. What is learnt of the latency is not forgotten before the next epoch.
#[test]
fn int_126_a_latency_that_jumps_costs_a_few_epochs_and_not_the_filter() {
    for gnss_hz in [1, 4, 10, 20] {
        let flight = LateFlight::new(Course::Aircraft, 60, gnss_hz, 100, 1).unwrap();
        let arrival = Arrival::Worse {
            ms: 0,
            span_s: (30, 60),
            worse_ms: 300,
        };
        let late = flight.run(&setting(arrival)).unwrap();
        let too_late = late.inertial.last().unwrap().timing.horizon.too_late;
        println!("{gnss_hz} Hz: {too_late} too late");
        // Those of 300 ms at the most, after which it is known.
        assert!(too_late <= 3 * gnss_hz / 10, "{too_late}");
        for report in late.reports.iter().skip(2) {
            assert_ne!(report.inertial, InertialStatus::ImuTime);
            let t_s = flight.t_s(report.time);
            if t_s >= 30.4 {
                assert_eq!(report.inertial, InertialStatus::Running, "{t_s}");
                assert_eq!(report.mode, Mode::Tight, "{t_s}");
            }
        }
        // Nothing is told twice.
        let times: Vec<i64> = late.reports.iter().map(|r| r.time.ns()).collect();
        let silent = late
            .reports
            .iter()
            .filter(|r| r.verdict.reason == Reason::ReceiverSilent);
        assert!(silent.count() <= too_late as usize + 1, "{times:?}");
    }
}

/// The inputs of a flight, the epoch of each second so many milliseconds late; epochs keep their order.
fn arriving(inputs: Vec<Input>, latency_ms: impl Fn(i64) -> i64) -> Vec<Input> {
    let (mut samples, mut epochs) = (Vec::new(), Vec::new());
    for input in inputs {
        if matches!(input, Input::Epoch(_)) {
            epochs.push(input);
        } else {
            samples.push(input);
        }
    }
    let mut all = Vec::new();
    let mut samples = samples.into_iter().peekable();
    for epoch in epochs {
        let arrival_ms = epoch.ms() + latency_ms(epoch.ms() / 1000);
        while let Some(sample) = samples.next_if(|sample| sample.ms() <= arrival_ms) {
            all.push(sample);
        }
        all.push(epoch);
    }
    all.extend(samples);
    all
}

fn reports(rows: &[Row]) -> Vec<surefix_core::report::EpochReport> {
    rows.iter().map(|row| row.report).collect()
}

/// INT-127. The silence of a receiver that was late is told later by its latency, and says the same.
#[test]
fn int_127_silence_is_told_by_the_latency_later_and_tells_the_same() {
    let silent = |input: &Input| !matches!(input, Input::Epoch(epoch) if (at(60_000)..at(70_000)).contains(&epoch.time));
    let flight = || {
        flight::flight()
            .into_iter()
            .filter(silent)
            .collect::<Vec<_>>()
    };
    let at_once = run(&unit(COURSE), &flight());
    let told = at_once
        .iter()
        .filter(|row| row.report.verdict.reason == Reason::ReceiverSilent)
        .count();
    assert_eq!(told, 10);
    for ms in [50, 120, 300, 400] {
        let late = run(&unit(COURSE), &arriving(flight(), |_| ms));
        assert_eq!(reports(&late), reports(&at_once), "{ms}");
    }
}

/// INT-126. What a later epoch has overtaken is no epoch any more; its silence has been told.
#[test]
fn int_126_an_epoch_that_another_overtakes_is_in_no_filter() {
    let mut inputs = flight::flight();
    let place = |inputs: &[Input], second: i64| {
        inputs.iter().position(
            |input| matches!(input, Input::Epoch(epoch) if epoch.time == at(1000 * second)),
        )
    };
    let overtaken = inputs.remove(place(&inputs, 60).unwrap());
    // 200 ms after the next, which is itself 100 ms late.
    let next = place(&inputs, 61).unwrap();
    let late = inputs.remove(next);
    inputs.insert(next + 10, late);
    inputs.insert(next + 31, overtaken);
    let rows = run(&unit(COURSE), &inputs);
    assert_eq!(rows.len() as i64, LENGTH_S + 1);
    for (second, row) in rows.iter().enumerate() {
        assert_eq!(row.ms, 1000 * second as i64);
        if second == 60 {
            assert_eq!(row.report.verdict.reason, Reason::ReceiverSilent);
        } else if second >= 3 {
            assert_eq!(row.report.inertial, InertialStatus::Running, "{second}");
            assert_eq!(row.report.mode, Mode::Tight, "{second}");
            assert!(row.report.verdict.integrity.is_usable(), "{second}");
        }
    }
}

/// A unit that falls silent while an epoch is on its way.
#[test]
fn a_gap_of_the_samples_ends_tight_mode_whatever_is_on_its_way() {
    for ms in [0, 120, 300] {
        for (from_ms, to_ms) in [(60_100, 60_300), (59_900, 60_100), (60_500, 61_100)] {
            let mut inputs = arriving(flight::flight(), |_| ms);
            inputs.retain(|input| {
                !(matches!(input, Input::Imu(_)) && input.ms() > from_ms && input.ms() <= to_ms)
            });
            let rows = run(&unit(COURSE), &inputs);
            assert_eq!(rows.len() as i64, LENGTH_S + 1);
            let named = rows
                .iter()
                .find(|row| row.report.inertial == InertialStatus::ImuSilent);
            let named = named.unwrap();
            assert!((59_000..=62_000).contains(&named.ms), "{ms}: {}", named.ms);
            assert_eq!(named.report.mode, Mode::Snapshot);
            for row in rows.iter().filter(|row| row.ms >= 66_000) {
                assert_eq!(
                    row.report.inertial,
                    InertialStatus::Running,
                    "{ms}: {}",
                    row.ms
                );
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, failure_persistence: None, ..ProptestConfig::default() })]

    /// INT-126. Every row is checked: what is usable is within its level, and all numbers are finite.
    #[test]
    fn int_126_no_latency_makes_a_position_usable_that_is_not(
        latencies in proptest::collection::vec(
            prop_oneof![4 => 0..400_i64, 1 => 400..3_000_i64],
            LENGTH_S as usize + 1,
        ),
    ) {
        let latency_ms = |second: i64| latencies[second as usize] / 10 * 10;
        let rows = run(&unit(COURSE), &arriving(flight::flight(), latency_ms));
        let reported = rows.iter().filter(|row| row.report.verdict.reason != Reason::ReceiverSilent);
        prop_assert_eq!(reported.count() as i64, LENGTH_S + 1);
    }
}
