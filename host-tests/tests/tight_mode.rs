//! Tight mode through the whole monitor, by bytes: it takes over, it says why it cannot, it comes back,
//! and nothing that arrives makes a position usable whose error is above its level.

#[path = "tight_mode/flight.rs"]
mod flight;

use std::f64::consts::{FRAC_PI_2, PI};

use flight::{COURSE, Input, LENGTH_S, RANGE, Row, at, attitude_rad, epoch, run, unit};
use proptest::prelude::*;
use surefix_core::budget::NoCounter;
use surefix_core::gnss::{Satellite, System};
use surefix_core::ins::{AttitudeStart, ImuSample};
use surefix_core::integrity::{InertialStatus, Integrity, Mode, Phase, Reason};
use surefix_core::monitor::{Monitor, Ready};
use surefix_core::tight::TightMonitor;
use surefix_core::time::GpsTime;
use surefix_host_tests::replay::new_monitor;

/// Rows from an epoch that tight mode could serve again to the first that it does.
const RECOVERY: i64 = 3;

fn flight_with(change: impl FnMut(Input) -> Option<Input>) -> Vec<Row> {
    let inputs: Vec<Input> = flight::flight().into_iter().filter_map(change).collect();
    run(&unit(COURSE), &inputs)
}

/// The same, with a change of the samples only.
fn samples_with(mut change: impl FnMut(ImuSample, i64) -> Option<ImuSample>) -> Vec<Row> {
    flight_with(|input| match input {
        Input::Imu(sample) => change(sample, flight::ms_of(sample.time)).map(Input::Imu),
        other => Some(other),
    })
}

/// Without these times of the receiver, ms.
fn is_within(ms: i64, span: (i64, i64)) -> bool {
    ms > span.0 && ms <= span.1
}

fn row(rows: &[Row], second: i64) -> &Row {
    rows.iter().find(|row| row.ms == 1000 * second).unwrap()
}

/// The epoch that shows a gap: the one it is over at, unless the gap lies across it and is too short
/// there to be one.
fn first_epoch_to_show(from_ms: i64, to_ms: i64) -> i64 {
    let next = from_ms / 1000 + 1;
    if to_ms > 1000 * next && 1000 * next - from_ms <= 50 {
        next + 1
    } else {
        next
    }
}

fn is_usable(row: &Row) -> bool {
    row.report.verdict.integrity.is_usable()
}

/// Horizontal and vertical level, m.
fn levels_m(row: &Row) -> [f64; 2] {
    let verdict = &row.report.verdict;
    [verdict.hpl, verdict.vpl].map(|level| level.bound_m().unwrap())
}

fn is_tight(row: &Row) -> bool {
    row.report.mode == Mode::Tight
}

/// Tight mode serves every epoch but those between these seconds, both included.
fn assert_tight_but(rows: &[Row], from: i64, to: i64) {
    for row in rows.iter().filter(|row| row.ms >= 5000) {
        let second = row.ms.div_euclid(1000);
        if !(from..=to).contains(&second) {
            assert!(is_tight(row), "{} ms: {:?}", row.ms, row.report.inertial);
            assert_eq!(
                row.report.inertial,
                InertialStatus::Running,
                "{} ms",
                row.ms
            );
        }
    }
}

/// Tight mode ends at the epoch of second `from`, which says this; it is back for good when it can be
/// after second `to`, when all is well again.
fn assert_interrupted(rows: &[Row], from: i64, to: i64, why: InertialStatus) {
    let first = row(rows, from);
    assert_eq!(first.report.inertial, why);
    assert_eq!(first.report.mode, Mode::Snapshot);
    assert!(first.report.verdict.integrity.is_usable());
    assert_tight_but(rows, from, to + RECOVERY - 1);
    for row in rows
        .iter()
        .filter(|row| is_within(row.ms, (1000 * from, 1000 * to)))
    {
        assert!(
            !is_tight(row) && row.report.inertial != InertialStatus::Running,
            "{}",
            row.ms
        );
    }
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let all: Vec<f64> = values.collect();
    (all.iter().map(|value| value * value).sum::<f64>() / all.len() as f64).sqrt()
}

fn undisturbed() -> Vec<Row> {
    flight_with(Some)
}

/// INT-016.
#[test]
fn tight_mode_takes_over_after_one_window_and_is_no_worse_than_the_snapshot() {
    let rows = undisturbed();
    assert_eq!(rows.len() as i64, LENGTH_S + 1);
    let [first, second, third, fourth, ..] = &rows[..] else {
        panic!("{}", rows.len());
    };
    assert_eq!(first.report.inertial, InertialStatus::NoSample);
    assert_eq!(second.report.inertial, InertialStatus::Aligning);
    // Started from this epoch, it serves the next.
    assert_eq!(third.report.inertial, InertialStatus::Running);
    assert!(!is_tight(third) && is_tight(fourth));
    assert_tight_but(&rows, 0, 2);
    assert!(rows.iter().all(is_usable));

    let snapshot = flight_with(|input| (!matches!(input, Input::Imu(_))).then_some(input));
    assert!(
        snapshot
            .iter()
            .all(|row| row.report.mode == Mode::Snapshot && is_usable(row))
    );
    // The levels are the bank's; both opinions see the same.
    for row in rows.iter().filter(|row| is_tight(row)) {
        let ([h, v], [hpl_m, vpl_m]) = (row.error_m.unwrap(), levels_m(row));
        assert!(h < 0.5 * hpl_m && v < 0.5 * vpl_m, "{}", row.ms);
    }
    let position_m =
        |rows: &[Row], axis: usize| rms(rows.iter().skip(5).map(|row| row.error_m.unwrap()[axis]));
    let velocity_mps = |rows: &[Row]| {
        rms(rows
            .iter()
            .skip(5)
            .map(|row| row.velocity_error_mps.unwrap()))
    };
    for axis in [0, 1] {
        let (tight_m, snapshot_m) = (position_m(&rows, axis), position_m(&snapshot, axis));
        println!("axis {axis}: tight {tight_m} m, snapshot {snapshot_m} m");
        assert!(tight_m < 0.5 * snapshot_m);
    }
    println!(
        "velocity: {} m/s, {} m/s",
        velocity_mps(&rows),
        velocity_mps(&snapshot)
    );
    assert!(velocity_mps(&rows) < 0.8 * velocity_mps(&snapshot));
}

#[test]
fn a_given_attitude_needs_no_window() {
    let given = AttitudeStart::Given {
        roll_pitch_heading_rad: attitude_rad(1.0),
    };
    let rows = run(&unit(given), &flight::flight());
    assert_eq!(rows[1].report.inertial, InertialStatus::Running);
    assert!(rows[2..].iter().all(|row| is_tight(row) && is_usable(row)));
}

/// INT-016.
#[test]
fn a_wrong_attitude_ends_tight_mode_and_the_course_finds_the_right_one() {
    let [roll, pitch, heading] = attitude_rad(1.0);
    for wrong in [
        [roll, pitch, heading + FRAC_PI_2],
        [roll, pitch, heading - FRAC_PI_2],
        [roll + FRAC_PI_2, pitch, heading],
        [roll, pitch, heading + PI],
    ] {
        let given = AttitudeStart::Given {
            roll_pitch_heading_rad: wrong,
        };
        let rows = run(&unit(given), &flight::flight());
        let ended = rows
            .iter()
            .position(|row| row.report.inertial == InertialStatus::Unhealthy);
        let worst_m = rows
            .iter()
            .filter_map(|row| row.error_m)
            .map(|e| e[0])
            .fold(0.0, f64::max);
        println!("{wrong:?}: ended at epoch {ended:?}, worst {worst_m} m");
        let ended = ended.unwrap();
        assert!(ended <= 20, "{ended}");
        assert_tight_but(&rows, 0, ended as i64 + RECOVERY);
    }
}

/// INT-013.
#[test]
fn gaps_of_a_few_samples_are_bridged() {
    let sigma_deg = |rows: &[Row]| {
        let navigation = row(rows, 61).report.navigation.unwrap();
        navigation.sigma_attitude_enu_deg.iter().sum::<f64>()
    };
    let mut least_deg = sigma_deg(&undisturbed());
    for gap_ms in [10, 30, 50] {
        let rows = samples_with(|sample, ms| {
            (!is_within(ms, (60_500, 60_500 + gap_ms))).then_some(sample)
        });
        assert_tight_but(&rows, 0, 4);
        assert!(rows.iter().all(is_usable), "{gap_ms}");
        // What happened unseen makes the attitude less certain.
        assert!(sigma_deg(&rows) > 1.02 * least_deg, "{gap_ms}");
        least_deg = sigma_deg(&rows);
    }
}

/// Too slow for a course, always: the attitude as it was is all there is.
#[test]
fn without_a_course_the_last_attitude_is_used_again_while_it_is_recent() {
    let unit = unit(AttitudeStart::Course { min_speed_mps: 1e4 });
    for (gap_ms, comes_back) in [(300, true), (5_000, true), (15_000, false)] {
        let mut inputs = flight::flight();
        let third = inputs.iter().position(|input| input.ms() > 2000).unwrap();
        inputs.insert(third, Input::Bytes(flight::initial_state(2000)));
        inputs.retain(|input| match input {
            Input::Imu(_) => !is_within(input.ms(), (60_500, 60_500 + gap_ms)),
            _ => true,
        });
        let rows = run(&unit, &inputs);
        assert!(rows[..3].iter().all(|row| !is_tight(row)));
        assert!(rows[3..61].iter().all(is_tight));
        assert_eq!(row(&rows, 61).report.inertial, InertialStatus::ImuSilent);
        if comes_back {
            let back = row(&rows, 61 + gap_ms / 1000 + RECOVERY);
            assert!(is_tight(back), "{gap_ms}");
            let sigma_deg = back.report.navigation.unwrap().sigma_attitude_enu_deg;
            println!("{gap_ms} ms: {sigma_deg:?}");
            assert!(sigma_deg.iter().any(|sigma_deg| *sigma_deg > 2.0));
        } else {
            assert!(!rows[61..].iter().any(is_tight));
        }
        assert!(rows.iter().all(is_usable));
    }
}

/// INT-013.
#[test]
fn a_silent_unit_is_named_and_tight_mode_comes_back() {
    // From just after an epoch, within a second, and up to an epoch.
    for (from_ms, to_ms) in [
        (60_000, 60_100),
        (60_500, 60_600),
        (60_890, 60_990),
        (60_900, 61_000),
        (60_990, 61_090),
        (60_500, 61_500),
        (60_000, 61_000),
        (60_500, 70_500),
        (60_500, 120_500),
    ] {
        let rows = samples_with(|sample, ms| (!is_within(ms, (from_ms, to_ms))).then_some(sample));
        let first = first_epoch_to_show(from_ms, to_ms);
        let last = (to_ms + 999) / 1000;
        assert_interrupted(&rows, first, last, InertialStatus::ImuSilent);
        assert!(rows.iter().all(is_usable), "{from_ms} to {to_ms}");
        assert_eq!(rows.len() as i64, LENGTH_S + 1);
    }
}

/// INT-013.
#[test]
fn samples_at_the_end_of_the_range_are_named_when_they_last() {
    let saturated = |from_ms: i64, to_ms: i64, which: usize| {
        samples_with(|mut sample, ms| {
            if is_within(ms, (from_ms, to_ms)) {
                let dt_s = f64::from(sample.interval_ns) * 1e-9;
                match which {
                    0 => sample.dtheta_is_s_rad[1] = -RANGE.rate_radps * dt_s,
                    _ => sample.dv_is_s_mps[2] = RANGE.specific_force_mps2 * dt_s * 2.0,
                }
            }
            Some(sample)
        })
    };
    for which in [0, 1] {
        assert_tight_but(&saturated(60_500, 60_510, which), 0, 4);
        for (from_ms, to_ms) in [(60_500, 60_600), (60_890, 60_990), (60_500, 70_500)] {
            let rows = saturated(from_ms, to_ms, which);
            let (first, last) = (first_epoch_to_show(from_ms, to_ms), (to_ms + 999) / 1000);
            assert_interrupted(&rows, first, last, InertialStatus::ImuSaturated);
            assert!(rows.iter().all(is_usable));
        }
    }
}

/// INT-013.
#[test]
fn samples_that_are_no_numbers_are_named_when_they_last() {
    for bits in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let spoilt = |from_ms: i64, to_ms: i64| {
            samples_with(|mut sample, ms| {
                if is_within(ms, (from_ms, to_ms)) {
                    sample.dv_is_s_mps[0] = bits;
                }
                Some(sample)
            })
        };
        assert_tight_but(&spoilt(60_500, 60_510), 0, 4);
        for (from_ms, to_ms) in [(60_500, 60_600), (60_500, 70_500)] {
            let rows = spoilt(from_ms, to_ms);
            let (first, last) = (first_epoch_to_show(from_ms, to_ms), (to_ms + 999) / 1000);
            assert_interrupted(&rows, first, last, InertialStatus::ImuNotFinite);
            assert!(rows.iter().all(is_usable));
        }
        // From the very first sample.
        let rows = spoilt(0, 20_000);
        assert_eq!(row(&rows, 1).report.inertial, InertialStatus::ImuNotFinite);
        assert_interrupted(&rows, 1, 20, InertialStatus::ImuNotFinite);
    }
}

fn later(sample: ImuSample, by_ms: i64) -> ImuSample {
    ImuSample {
        time: sample.time.plus_ns(by_ms * 1_000_000),
        ..sample
    }
}

/// INT-013.
#[test]
fn time_that_runs_backwards_is_named_when_it_lasts() {
    let shifted = |from_ms: i64, to_ms: i64, by_ms: i64| {
        samples_with(|sample, ms| {
            let by_ms = if is_within(ms, (from_ms, to_ms)) {
                by_ms
            } else {
                0
            };
            Some(later(sample, by_ms))
        })
    };
    // One sample, whatever its time.
    for by_ms in [-20, -1000, -3_600_000] {
        assert_tight_but(&shifted(60_500, 60_510, by_ms), 0, 4);
    }
    for by_ms in [-1000, -3_600_000, 3_600_000] {
        for (from_ms, to_ms) in [(60_500, 61_500), (60_500, 80_500)] {
            let rows = shifted(from_ms, to_ms, by_ms);
            assert_interrupted(&rows, 61, (to_ms + 999) / 1000, InertialStatus::ImuTime);
            for row in rows.iter().filter(|row| is_within(row.ms, (61_000, to_ms))) {
                assert_eq!(
                    row.report.inertial,
                    InertialStatus::ImuTime,
                    "{by_ms} {}",
                    row.ms
                );
            }
            assert!(rows.iter().all(is_usable));
            assert_eq!(rows.len() as i64, LENGTH_S + 1, "{by_ms}");
        }
    }
    // For good: the unit and the receiver are never again of the same time.
    let rows = shifted(60_500, i64::MAX, -3_600_000);
    assert!(
        rows[61..]
            .iter()
            .all(|row| row.report.inertial == InertialStatus::ImuTime)
    );
    assert!(rows.iter().all(is_usable));
}

/// One sample that leaps far ahead: those after it are from before it.
#[test]
fn one_sample_from_the_future_ends_tight_mode_for_three_epochs_at_most() {
    for by_ms in [100, 1000, 10_000, 3_600_000] {
        let rows =
            samples_with(|sample, ms| Some(later(sample, if ms == 60_500 { by_ms } else { 0 })));
        assert_tight_but(&rows, 61, 61 + RECOVERY - 1);
        let status = row(&rows, 61).report.inertial;
        assert!(
            matches!(status, InertialStatus::ImuTime | InertialStatus::ImuSilent),
            "{status:?}"
        );
        assert!(rows.iter().all(is_usable));
        assert_eq!(rows.len() as i64, LENGTH_S + 1, "{by_ms}");
    }
}

/// INT-014.
#[test]
fn a_silent_receiver_is_told_at_the_times_its_epochs_were_due() {
    for (first, last) in [(60, 60), (60, 69), (60, 119)] {
        let rows = flight_with(|input| match input {
            Input::Epoch(epoch)
                if (1000 * first..=1000 * last).contains(&flight::ms_of(epoch.time)) =>
            {
                None
            }
            other => Some(other),
        });
        let times: Vec<i64> = rows.iter().map(|row| row.ms).collect();
        let expected: Vec<i64> = (0..=LENGTH_S).map(|second| 1000 * second).collect();
        assert_eq!(times, expected);
        assert_tight_but(&rows, 0, 4);
        for row in &rows {
            let second = row.ms / 1000;
            if !(first..=last).contains(&second) {
                assert!(is_usable(row), "{second}");
                continue;
            }
            assert_eq!(row.report.verdict.integrity, Integrity::Unavailable);
            assert_eq!(row.report.verdict.reason, Reason::ReceiverSilent);
            let [h, v] = row.error_m.unwrap();
            let [fault_free_h, fault_free_v] = row.report.navigation.unwrap().fault_free_m;
            assert!(h < fault_free_h && v < fault_free_v, "{second}: {h} {v}");
            // Half a second after it was due the nominal has long moved on.
            let clock_m = row.report.navigation.unwrap().clock[0];
            let expected_m = flight::clock_m(second as f64);
            assert!((clock_m - expected_m).abs() < 30.0, "{second}: {clock_m}");
            if second == first {
                // Not that of the epoch before: the drift of a second is 0.8 m.
                assert!((clock_m - expected_m).abs() < 0.4, "{second}: {clock_m}");
            }
            let heading_rad = row.report.navigation.unwrap().roll_pitch_heading_deg[2].to_radians();
            let expected_rad = attitude_rad(second as f64)[2];
            assert!((heading_rad - expected_rad).abs() < 0.02, "{second}");
        }
    }
}

/// INT-013, INT-014.
#[test]
fn when_both_are_silent_the_first_row_after_says_so() {
    for last in [70, 119] {
        let (from_ms, to_ms) = (60_500, 1000 * last + 500);
        // Together.
        let rows = flight_with(|input| (!is_within(input.ms(), (from_ms, to_ms))).then_some(input));
        let first = rows.iter().find(|row| row.ms > from_ms).unwrap();
        assert_eq!(first.report.inertial, InertialStatus::ImuSilent);
        assert_eq!(first.report.mode, Mode::Snapshot);
        assert_eq!(first.ms, 1000 * (last + 1));
        assert_tight_but(&rows, 60, last + RECOVERY);
        // The samples come back first: when they have gone on long enough to be believed.
        let rows = flight_with(|input| {
            let to_ms = if matches!(input, Input::Epoch(_)) {
                to_ms + 5000
            } else {
                to_ms
            };
            (!is_within(input.ms(), (from_ms, to_ms))).then_some(input)
        });
        for second in last + 1..=last + 5 {
            let report = &row(&rows, second).report;
            assert_eq!(report.inertial, InertialStatus::ImuSilent);
            assert_eq!(report.verdict.integrity, Integrity::Unavailable);
            assert_eq!(report.verdict.reason, Reason::ReceiverSilent);
            assert_eq!(report.mode, Mode::None);
        }
        assert!(
            rows.iter()
                .all(|row| !is_within(row.ms, (from_ms, 1000 * last)))
        );
        assert_tight_but(&rows, 60, last + 5 + RECOVERY);
        // The receiver comes back first.
        let rows = flight_with(|input| {
            let to_ms = if matches!(input, Input::Imu(_)) {
                to_ms + 5000
            } else {
                to_ms
            };
            (!is_within(input.ms(), (from_ms, to_ms))).then_some(input)
        });
        let first = rows.iter().find(|row| row.ms > from_ms).unwrap();
        assert_eq!(first.report.inertial, InertialStatus::ImuSilent);
        assert_eq!(first.report.mode, Mode::Snapshot);
        assert_eq!(first.ms, 1000 * (last + 1));
        assert_tight_but(&rows, 60, last + 6 + RECOVERY);
    }
}

/// INT-014. No byte comes that could say so: whoever has a clock asks.
#[test]
fn when_both_are_silent_a_clock_is_told_within_one_and_a_half_intervals() {
    let inputs = flight::flight();
    let mut monitor = new_monitor();
    let mut reports = Vec::new();
    let mut feed = |monitor: &mut Monitor, bytes: &[u8]| {
        let mut rest = bytes;
        loop {
            let (used, ready) = monitor.push(rest);
            rest = &rest[used..];
            match ready {
                Some(Ready::Epoch) => reports.push(monitor.process(&mut NoCounter)),
                _ if rest.is_empty() => break,
                _ => {}
            }
        }
    };
    feed(&mut monitor, &flight::preamble(&unit(COURSE)));
    for input in inputs.iter().filter(|input| input.ms() <= 60_500) {
        feed(&mut monitor, &input.bytes());
    }
    assert_eq!(monitor.tick(at(61_499)), None);
    for (now_ms, due_ms) in [(61_500, 61_000), (62_510, 62_000), (68_000, 67_000)] {
        assert_eq!(monitor.tick(at(now_ms)), Some(Ready::Epoch), "{now_ms}");
        let report = monitor.process(&mut NoCounter);
        assert_eq!(report.time, at(due_ms));
        assert_eq!(report.verdict.integrity, Integrity::Unavailable);
        assert_eq!(report.verdict.reason, Reason::ReceiverSilent);
        assert_eq!(report.inertial, InertialStatus::ImuSilent);
        assert_eq!(report.mode, Mode::None);
        assert_eq!(monitor.tick(at(now_ms)), None, "{now_ms}");
    }
    for input in inputs.iter().filter(|input| input.ms() > 68_500) {
        feed(&mut monitor, &input.bytes());
    }
    let first = reports.iter().find(|report| report.time > at(60_500));
    assert_eq!(first.unwrap().time, at(69_000));
    let last = reports.last().unwrap();
    assert_eq!(
        (last.mode, last.inertial),
        (Mode::Tight, InertialStatus::Running)
    );
}

/// INT-014.
#[test]
fn a_receiver_that_falls_silent_while_samples_are_saturated_is_told_all_the_same() {
    let rows = flight_with(|input| match input {
        Input::Epoch(epoch) if (63_000..=80_000).contains(&flight::ms_of(epoch.time)) => None,
        Input::Imu(mut sample) if is_within(flight::ms_of(sample.time), (60_500, 75_500)) => {
            sample.dv_is_s_mps[1] = 1.0;
            Some(Input::Imu(sample))
        }
        other => Some(other),
    });
    for second in 63..=80 {
        let report = &row(&rows, second).report;
        assert_eq!(report.verdict.reason, Reason::ReceiverSilent, "{second}");
        assert_eq!(report.inertial, InertialStatus::ImuSaturated, "{second}");
        assert_eq!(report.mode, Mode::None, "{second}");
    }
    assert_tight_but(&rows, 61, 81 + RECOVERY - 1);
}

#[test]
fn jumps_of_the_receiver_clock_do_not_move_the_position() {
    let undisturbed = undisturbed();
    // A millisecond, many, and what is no whole number of them.
    for jump_m in [
        299_792.458,
        -299_792.458,
        111_111.0,
        -4_000.0,
        1_500.0,
        -300.0,
    ] {
        let rows = flight_with(|input| match input {
            Input::Epoch(before) if before.time >= at(60_000) => Some(Input::Epoch(Box::new(
                epoch(flight::ms_of(before.time), jump_m),
            ))),
            other => Some(other),
        });
        assert_tight_but(&rows, 0, 4);
        assert!(rows.iter().all(is_usable), "{jump_m}");
        let moved_m = rows
            .iter()
            .zip(&undisturbed)
            .map(|(row, other)| distance_m(row, other))
            .fold(0.0, f64::max);
        println!("{jump_m} m: position moved by {moved_m} m");
        // By a millisecond the antenna itself moves on by 5 cm.
        assert!(moved_m < 0.15, "{jump_m}: {moved_m}");
    }
}

fn distance_m(a: &Row, b: &Row) -> f64 {
    let (a, b) = (a.report.fix.unwrap().r_e_m, b.report.fix.unwrap().r_e_m);
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b) * (a - b))
        .sum::<f64>()
        .sqrt()
}

/// An epoch without the satellites that are not wanted.
fn keeping(input: Input, span: (i64, i64), keep: impl Fn(Satellite) -> bool) -> Input {
    match input {
        Input::Epoch(mut epoch) if is_within(flight::ms_of(epoch.time), span) => {
            epoch.satellites.retain(|observed| keep(observed.satellite));
            Input::Epoch(epoch)
        }
        other => other,
    }
}

#[test]
fn constellations_come_and_go() {
    for system in System::ALL {
        for span in [(-1, 40_000), (40_000, 90_000)] {
            let rows = flight_with(|input| {
                Some(keeping(input, span, |satellite| {
                    satellite.system() != system
                }))
            });
            assert_tight_but(&rows, 0, 4);
            assert!(rows.iter().all(is_usable));
            let worst_m = rows[5..]
                .iter()
                .map(|row| row.error_m.unwrap()[0])
                .fold(0.0, f64::max);
            println!("without {system:?} in {span:?}: {worst_m} m");
            assert!(worst_m < 1.0, "{worst_m}");
        }
    }
}

/// INT-016.
#[test]
fn with_few_satellites_or_none_the_bank_bounds_what_the_filter_says() {
    for count in [4, 3, 2, 1, 0] {
        let mut kept: Vec<Satellite> = Vec::new();
        let rows = flight_with(|input| {
            if let Input::Epoch(epoch) = &input
                && kept.is_empty()
            {
                let gps = epoch.satellites.iter().map(|observed| observed.satellite);
                kept = gps
                    .filter(|satellite| satellite.system() == System::Gps)
                    .take(count)
                    .collect();
                assert_eq!(kept.len(), count);
            }
            Some(keeping(input, (59_999, 119_999), |satellite| {
                kept.contains(&satellite)
            }))
        });
        assert_tight_but(&rows, 0, 4);
        let mut worst_m: f64 = 0.0;
        let mut last_m = 0.0;
        for row in &rows[60..120] {
            // The snapshot has nothing to test with and abstains; what it says is no reason.
            let verdict = &row.report.verdict;
            assert_ne!(verdict.integrity, Integrity::Alert, "{count}");
            assert!(
                is_usable(row) || verdict.reason == Reason::HplAboveLimit,
                "{count} {:?}",
                verdict.reason
            );
            let [h, v] = row.error_m.unwrap();
            let [hpl_m, vpl_m] = levels_m(row);
            assert!(h < hpl_m && v < vpl_m, "{count}: {h} {v}");
            if count == 0 {
                assert!(hpl_m > last_m);
                last_m = hpl_m;
            }
            worst_m = worst_m.max(h);
        }
        println!("{count} satellites for a minute: {worst_m} m");
        // After a level above its limit the time to alert passes until one is told again.
        let settles = rows[60..120].iter().any(|row| !is_usable(row));
        let back = if settles { 130 } else { 120 };
        for row in &rows[120..back] {
            assert_eq!(row.report.verdict.reason, Reason::Settling, "{}", row.ms);
            let [h, v] = row.error_m.unwrap();
            let [hpl_m, vpl_m] = levels_m(row);
            assert!(h < hpl_m && v < vpl_m, "{count}: {h} {v}");
        }
        for row in rows[..60].iter().chain(&rows[back..]) {
            assert!(
                is_usable(row),
                "{count} {} {:?}",
                row.ms,
                row.report.verdict
            );
        }
    }
}

/// Adds to pseudoranges.
fn faulty(input: Input, span: (i64, i64), error_m: impl Fn(usize, Satellite) -> f64) -> Input {
    match input {
        Input::Epoch(mut epoch) if is_within(flight::ms_of(epoch.time), span) => {
            for (k, observed) in epoch.satellites.iter_mut().enumerate() {
                for signal in &mut observed.signals {
                    signal.pseudorange_m = signal
                        .pseudorange_m
                        .map(|range_m| range_m + error_m(k, observed.satellite));
                }
            }
            Input::Epoch(epoch)
        }
        other => other,
    }
}

/// INT-015.
#[test]
fn a_satellite_that_the_snapshot_excludes_does_not_enter_the_filter() {
    // There are more satellites than the bank has places for.
    let satellite = flight_with(Some)[10].report.used.iter().next().unwrap();
    let span = (60_000, 90_000);
    let rows = flight_with(|input| {
        Some(faulty(input, span, |_, of| {
            if of == satellite { 100.0 } else { 0.0 }
        }))
    });
    assert_tight_but(&rows, 0, 4);
    for row in &rows {
        // From then on it has to prove itself, for longer than the flight.
        let excluded = row.ms > span.0;
        assert_eq!(
            row.report.verdict.integrity == Integrity::Excluded,
            excluded,
            "{}",
            row.ms
        );
        if is_tight(row) {
            assert_eq!(row.report.used.contains(satellite), !excluded);
        }
        assert!(is_usable(row));
    }
    // It was taken out of all filters, with what it did before; 100 m of one satellite would be metres.
    let without = flight_with(|input| Some(keeping(input, span, |of| of != satellite)));
    for (row, other) in rows.iter().zip(&without) {
        assert!(distance_m(row, other) < 0.2, "{}", row.ms);
    }
}

/// INT-015.
#[test]
fn satellites_that_no_hypothesis_explains_enter_no_filter() {
    let span = (60_000, 70_000);
    let rows = flight_with(|input| {
        Some(faulty(input, span, |k, _| {
            if k % 2 == 0 { 70.0 * k as f64 } else { 0.0 }
        }))
    });
    assert_tight_but(&rows, 0, 4);
    for row in &rows {
        let alert = is_within(row.ms, span);
        // None of them was named: from the first epoch without them on two minutes must pass.
        let held = !alert && is_within(row.ms, (span.1, span.1 + 1000 + 120_000 - 1));
        assert_eq!(
            row.report.verdict.integrity == Integrity::Alert,
            alert || held,
            "{}",
            row.ms
        );
        assert_eq!(
            row.report.verdict.reason == Reason::AlertHeld,
            held,
            "{}",
            row.ms
        );
        // What is grossly wrong is kept from all filters.
        assert!(!is_tight(row) || row.report.used.len() < 24 || !alert);
        assert!(
            row.error_m.unwrap()[0] < 3.0,
            "{} {:?}",
            row.ms,
            row.error_m
        );
    }
    // Nor does one begin with an epoch that alerts.
    let rows = flight_with(|input| {
        Some(faulty(input, (-1, 20_000), |k, _| {
            if k % 2 == 0 { 70.0 * k as f64 } else { 0.0 }
        }))
    });
    assert!(
        rows[..21]
            .iter()
            .all(|row| !is_tight(row) && !is_usable(row))
    );
    assert_tight_but(&rows, 0, 21 + RECOVERY - 1);
}

/// An epoch given later than the samples of its time by more than the filter's history. INT-126.
#[test]
fn epochs_that_come_late_are_assessed_alone_and_end_tight_mode_when_they_go_on() {
    for (count, ends) in [(1, false), (3, false), (10, true)] {
        let mut inputs = flight::flight();
        for second in 60..60 + count {
            let from = inputs.iter().position(
                |input| matches!(input, Input::Epoch(epoch) if epoch.time == at(1000 * second)),
            );
            let late = inputs.remove(from.unwrap());
            inputs.insert(from.unwrap() + 45, late);
        }
        let rows = run(&unit(COURSE), &inputs);
        assert_eq!(rows.len() as i64, LENGTH_S + 1);
        for second in 60..63.min(60 + count) {
            let report = &row(&rows, second).report;
            assert_eq!(report.inertial, InertialStatus::EpochLate);
            assert_eq!(report.mode, Mode::Snapshot);
        }
        if ends {
            for second in 63..60 + count {
                assert_eq!(row(&rows, second).report.inertial, InertialStatus::ImuTime);
            }
            assert_tight_but(&rows, 60, 60 + count + RECOVERY - 1);
        } else {
            assert_tight_but(&rows, 60, 60 + count - 1);
        }
        assert!(rows.iter().all(is_usable));
    }
}

/// INT-014.
#[test]
fn an_epoch_from_the_past_is_no_epoch_and_the_one_that_was_due_is_missed() {
    for back_ms in [1000, 60_000, 3_600_000] {
        let rows = flight_with(|input| match input {
            Input::Epoch(mut epoch) if epoch.time == at(60_000) => {
                epoch.time = epoch.time.plus_ns(-back_ms * 1_000_000);
                Some(Input::Epoch(epoch))
            }
            other => Some(other),
        });
        assert_eq!(rows.len() as i64, LENGTH_S + 1);
        let missed = &row(&rows, 60).report;
        assert_eq!(missed.verdict.reason, Reason::ReceiverSilent);
        assert_eq!(missed.verdict.integrity, Integrity::Unavailable);
        assert_tight_but(&rows, 0, 2);
    }
}

/// The receiver is of another time than the unit from here on.
#[test]
fn a_receiver_whose_time_leaps_for_good_ends_tight_mode() {
    for leap_ms in [-3_600_000, 3_600_000] {
        let rows = flight_with(|input| match input {
            Input::Epoch(mut epoch) if epoch.time >= at(60_000) => {
                epoch.time = epoch.time.plus_ns(leap_ms * 1_000_000);
                Some(Input::Epoch(epoch))
            }
            other => Some(other),
        });
        // Three epochs may pass before a leap back is believed, three may be late.
        assert!(!rows[60..].iter().any(is_usable));
        for row in &rows[66..] {
            assert_eq!(row.report.inertial, InertialStatus::ImuTime, "{}", row.ms);
            assert_eq!(row.report.mode, Mode::None);
        }
        assert!(rows.len() as i64 <= LENGTH_S + 1);
    }
}

#[test]
fn samples_given_to_tight_mode_itself_may_be_anything() {
    let extreme = [
        f64::NAN,
        f64::INFINITY,
        -f64::MAX,
        f64::MAX,
        f64::MIN_POSITIVE,
        -0.0,
        1e300,
    ];
    let times = [i64::MIN, -1, 0, 1, i64::MAX, at(0).ns(), at(10).ns()];
    let mut monitor = Box::new(TightMonitor::EMPTY);
    for configured in [false, true] {
        if configured {
            monitor
                .configure(&unit(COURSE), &Phase::Npa.requirements())
                .unwrap();
        }
        for time in times {
            for value in extreme {
                for interval_ns in [0, 1, 10_000_000, u32::MAX] {
                    monitor.on_sample(&ImuSample {
                        time: GpsTime::from_ns(time),
                        interval_ns,
                        dtheta_is_s_rad: [value, 0.0, value],
                        dv_is_s_mps: [0.0, value, value],
                    });
                }
            }
        }
        assert!(!monitor.is_running());
        assert_eq!(monitor.status() == InertialStatus::Off, !configured);
    }
}

/// What may happen to a stream.
#[derive(Clone, Debug)]
enum Damage {
    Drop(usize),
    Twice(usize),
    Swap(usize, usize),
    Cut(usize, usize),
    Rates(usize, [f64; 3]),
    Time(usize, i64),
    Ranges(usize, f64),
}

fn damage() -> impl Strategy<Value = Damage> {
    let place = 0..2500_usize;
    let value = prop_oneof![
        any::<f64>(),
        prop_oneof![
            Just(f64::MAX),
            Just(-f64::MAX),
            Just(f64::NAN),
            Just(1e300),
            Just(5e-324)
        ],
        -0.1..0.1_f64,
    ];
    prop_oneof![
        place.clone().prop_map(Damage::Drop),
        place.clone().prop_map(Damage::Twice),
        (place.clone(), place.clone()).prop_map(|(a, b)| Damage::Swap(a, b)),
        (place.clone(), 0..60_usize).prop_map(|(a, b)| Damage::Cut(a, b)),
        (place.clone(), [value.clone(), value.clone(), value.clone()])
            .prop_map(|(a, b)| Damage::Rates(a, b)),
        (
            place.clone(),
            prop_oneof![any::<i64>(), -2_000_000_000..2_000_000_000_i64]
        )
            .prop_map(|(a, b)| Damage::Time(a, b)),
        (place, prop_oneof![value, 1e6..5e7_f64]).prop_map(|(a, b)| Damage::Ranges(a, b)),
    ]
}

fn do_damage(inputs: &mut Vec<Input>, damage: &Damage) {
    let length = inputs.len();
    match *damage {
        Damage::Drop(k) => drop(inputs.remove(k % length)),
        Damage::Twice(k) => inputs.insert(k % length, inputs[k % length].clone()),
        Damage::Swap(a, b) => inputs.swap(a % length, b % length),
        Damage::Cut(k, length_kept) => {
            let mut bytes = inputs[k % length].bytes();
            bytes.truncate(length_kept);
            inputs[k % length] = Input::Bytes(bytes);
        }
        Damage::Rates(k, values) => {
            // A hundred samples, so that they are not bridged.
            for input in inputs.iter_mut().skip(k % length).take(100) {
                if let Input::Imu(sample) = input {
                    sample.dtheta_is_s_rad = values;
                    sample.dv_is_s_mps = values;
                }
            }
        }
        Damage::Time(k, by_ns) => match &mut inputs[k % length] {
            Input::Imu(sample) => sample.time = sample.time.plus_ns(by_ns),
            Input::Epoch(epoch) => epoch.time = epoch.time.plus_ns(by_ns),
            Input::Bytes(_) => {}
        },
        Damage::Ranges(k, range_m) => {
            for input in inputs.iter_mut().skip(k % length).take(100) {
                *input = faulty(input.clone(), (i64::MIN, i64::MAX), |_, _| range_m);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    /// INT-016. `run` refuses usable verdicts without finite levels; errors of pseudoranges
    /// that are common to all satellites move the clock alone.
    #[test]
    fn no_damage_panics_or_makes_numbers_usable_that_are_none(
        damages in proptest::collection::vec(damage(), 1..12)
    ) {
        let mut inputs: Vec<Input> = flight::flight().into_iter().take(2400).collect();
        for damage in &damages {
            do_damage(&mut inputs, damage);
        }
        for row in flight::run_unchecked(&unit(COURSE), &inputs) {
            let report = &row.report;
            if is_usable(&row) {
                let fix = report.fix.unwrap();
                prop_assert!(fix.r_e_m.iter().all(|part| part.is_finite()));
                prop_assert!(report.verdict.hpl.bound_m().unwrap().is_finite());
                prop_assert!(report.verdict.vpl.bound_m().unwrap().is_finite());
            }
            prop_assert!(row.is_finite(), "{report:?}");
        }
    }
}
