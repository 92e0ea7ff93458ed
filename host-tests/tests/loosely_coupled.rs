//! The loosely coupled filter through the whole monitor: a simulated flight by its receiver's own solutions.
//! Recordings: recordings_loose.rs.

#[path = "tight_mode/flight.rs"]
mod flight;

use std::f64::consts::FRAC_PI_2;

use flight::{COURSE, Input, Row, at, attitude_rad, frame, ms_of, run, sample, state_e, unit};
use nalgebra::Vector3;
use proptest::prelude::*;
use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::SeedableRng;
use surefix_core::frames::geodesy;
use surefix_core::gnss::{FixQuality, FixSolution, FixVelocity, ReceiverFix};
use surefix_core::ingest::encode_receiver_fix;
use surefix_core::ins::AttitudeStart;
use surefix_core::integrity::{InertialStatus, Integrity, Mode, NoBound, ProtectionLevel, Reason};
use surefix_host_tests::simulate::noise::normal;

/// One sigma of the simulated receiver per axis, m, and of its velocity, m/s.
const SIGMA_M: f64 = 0.02;
const SIGMA_MPS: f64 = 0.05;
/// Between fixes, ms.
const FIX_MS: i64 = 250;
/// The first fix that counts, ms: five seconds after the first of all.
const FIRST_MS: i64 = 5000;

/// What a receiver with fixed ambiguities says, off by this much, east, north, up, m.
fn fix(ms: i64, off_enu_m: [f64; 3]) -> ReceiverFix {
    let mut random = ChaCha20Rng::seed_from_u64(ms as u64 + (1 << 50));
    let mut noise = |sigma: f64| Vector3::from([(); 3].map(|()| sigma * normal(&mut random)));
    let [r_e, v_e, _] = state_e(ms as f64 / 1000.0);
    let place = geodesy::to_llh(&r_e).unwrap();
    let c_enu_e = geodesy::c_enu_e(place.lat_rad, place.lon_rad);
    let error = noise(SIGMA_M) + Vector3::from(off_enu_m);
    let velocity = c_enu_e * v_e + noise(SIGMA_MPS);
    ReceiverFix {
        time: at(ms),
        satellites: 14,
        solution: Some(FixSolution {
            quality: FixQuality::Fixed,
            llh: geodesy::to_llh(&(r_e + c_enu_e.transpose() * error)).unwrap(),
            horizontal_accuracy_m: SIGMA_M * 2.0_f64.sqrt(),
            vertical_accuracy_m: SIGMA_M,
            velocity: Some(FixVelocity {
                ned_mps: [velocity.y, velocity.x, -velocity.z],
                accuracy_mps: SIGMA_MPS,
            }),
        }),
    }
}

fn bytes(fix: &ReceiverFix) -> Vec<u8> {
    frame(|out| encode_receiver_fix(fix, out).unwrap())
}

/// Samples and fixes of some seconds, each fix as `change` leaves it.
fn flight_of(
    seconds: i64,
    mut change: impl FnMut(ReceiverFix) -> Option<ReceiverFix>,
) -> Vec<Input> {
    let mut inputs = Vec::new();
    for ms in (0..=1000 * seconds).step_by(flight::STEP_MS as usize) {
        if ms > 0 {
            inputs.push(Input::Imu(sample(ms / flight::STEP_MS)));
        }
        if ms % FIX_MS == 0
            && let Some(fix) = change(fix(ms, [0.0; 3]))
        {
            inputs.push(Input::Bytes(bytes(&fix)));
        }
    }
    inputs
}

/// Nothing may be steered by.
fn is_withheld(row: &Row) -> bool {
    let verdict = &row.report.verdict;
    let no_level = |level| matches!(level, ProtectionLevel::Unavailable(_));
    verdict.integrity == Integrity::Unavailable && no_level(verdict.hpl) && no_level(verdict.vpl)
}

fn is_running(row: &Row) -> bool {
    row.report.inertial == InertialStatus::Running && row.report.navigation.is_some()
}

/// INT-116. A position that nothing tests is told with its sigma and never as usable.
#[test]
fn int_116_a_position_without_raw_data_is_unavailable_at_every_epoch() {
    let rows = run(&unit(COURSE), &flight_of(60, Some));
    assert_eq!(
        rows.len(),
        (60_000 - FIRST_MS) as usize / FIX_MS as usize + 1
    );
    assert_eq!(rows[0].ms, FIRST_MS);
    for row in &rows {
        let report = &row.report;
        assert!(is_withheld(row), "{report:?}");
        assert_eq!(report.mode, Mode::Loose);
        assert_eq!(report.verdict.reason, Reason::NoRawData);
        assert_eq!(
            report.verdict.hpl,
            ProtectionLevel::Unavailable(NoBound::NoRawData)
        );
        assert!(report.used.is_empty() && report.verdict.excluded.is_empty());
        assert_eq!(report.n_observed, 14);
        let [e, n, u] = report.sigma_enu_m.unwrap();
        assert!(
            e.min(n).min(u) >= 0.99 * SIGMA_M && e.max(n).max(u) < 0.1,
            "{e} {n} {u}"
        );
        let [h, v] = row.error_m.unwrap();
        assert!(
            h < 5.0 * e.hypot(n) && v < 5.0 * u,
            "{} ms: {h} {v}",
            row.ms
        );
    }
    let running = rows.iter().filter(|row| is_running(row)).count();
    assert!(running + 8 > rows.len(), "{running} of {}", rows.len());
}

/// INT-117. Observations win from their first message on, whatever fixes come before, between and after.
#[test]
fn int_117_fixes_beside_observations_change_no_bit() {
    let with_fixes = |is_there: bool| {
        let mut inputs = Vec::new();
        for input in flight::flight().into_iter().take(60 * 101) {
            // A fix comes before the observations of its epoch, and may be the first of all.
            if let Input::Epoch(epoch) = &input
                && is_there
            {
                inputs.push(Input::Bytes(bytes(&fix(
                    ms_of(epoch.time),
                    [30.0, 0.0, 0.0],
                ))));
            }
            inputs.push(input);
        }
        run(&unit(COURSE), &inputs)
    };
    let (with, without) = (with_fixes(true), with_fixes(false));
    assert_eq!(with.len(), without.len());
    assert!(with.iter().any(|row| row.report.mode == Mode::Tight));
    for (a, b) in with.iter().zip(&without) {
        assert_eq!(a.report, b.report);
    }
}

/// INT-117. A loosely coupled filter ends with the first observations; the snapshot that was tested begins
/// the tightly coupled one, and nothing of the fixes is in it.
#[test]
fn int_117_observations_that_come_later_end_the_loosely_coupled_filter() {
    const SWITCH_MS: i64 = 40_000;
    let mut inputs = flight_of(40, Some);
    let ms_of_samples = |input: &Input| match input {
        Input::Imu(_) | Input::Epoch(_) => input.ms(),
        Input::Bytes(_) => 0,
    };
    for input in flight::flight() {
        let ms = ms_of_samples(&input);
        if ms > SWITCH_MS && ms <= 100_000 {
            // Fixes go on, far off.
            if matches!(input, Input::Epoch(_)) {
                inputs.push(Input::Bytes(bytes(&fix(ms, [100.0, 0.0, 0.0]))));
            }
            inputs.push(input);
        }
    }
    let rows = run(&unit(COURSE), &inputs);
    let last_loose = rows
        .iter()
        .rfind(|row| row.report.mode == Mode::Loose)
        .unwrap();
    assert!(last_loose.ms <= SWITCH_MS + 1000, "{}", last_loose.ms);
    let first = rows
        .iter()
        .find(|row| row.report.mode == Mode::Snapshot)
        .unwrap();
    assert_eq!(first.report.inertial, InertialStatus::Aligning);
    let tight: Vec<&Row> = rows
        .iter()
        .filter(|row| row.report.mode == Mode::Tight)
        .collect();
    assert!(tight.len() > 50, "{}", tight.len());
    for row in &tight {
        let [h, v] = row.error_m.unwrap();
        assert!(h < 3.0 && v < 4.0, "{} ms: {h} {v}", row.ms);
    }
    assert!(
        rows.iter()
            .any(|row| row.report.verdict.integrity.is_usable())
    );
}

/// INT-118. An outlier is refused and told; the filter does not follow it.
#[test]
fn int_118_an_outlier_is_refused_and_flagged() {
    let off = |from: i64, to: i64, off_enu_m: [f64; 3]| {
        flight_of(60, |honest| {
            let ms = ms_of(honest.time);
            Some(if (from..to).contains(&ms) {
                fix(ms, off_enu_m)
            } else {
                honest
            })
        })
    };
    for off_enu_m in [
        [50.0, 0.0, 0.0],
        [0.0, -2.0, 0.0],
        [0.0, 0.0, 30.0],
        [1e5, 1e5, 0.0],
    ] {
        let rows = run(&unit(COURSE), &off(30_000, 30_500, off_enu_m));
        let refused: Vec<i64> = rows
            .iter()
            .filter(|row| row.report.flags.fix_refused)
            .map(|row| row.ms)
            .collect();
        assert_eq!(refused, [30_000, 30_250], "{off_enu_m:?}");
        for row in rows.iter().filter(|row| row.ms > 8000) {
            let [h, v] = row.error_m.unwrap();
            assert!(
                is_running(row) && h < 0.3 && v < 0.2,
                "{} ms: {h} {v}",
                row.ms
            );
        }
    }
    // What lasts is believed: the filter cannot know which of the two is right.
    let rows = run(&unit(COURSE), &off(30_000, 60_001, [50.0, 0.0, 0.0]));
    let refused = rows
        .iter()
        .filter(|row| row.report.flags.fix_refused)
        .count();
    assert_eq!(refused, 3);
    let last = rows.last().unwrap();
    assert!((last.error_m.unwrap()[0] - 50.0).abs() < 0.3, "{last:?}");
    assert!(rows.iter().all(is_withheld));
}

/// INT-118. A filter whose attitude is wrong contradicts every fix; it is given up and begins again from the
/// course.
#[test]
fn int_118_a_wrong_attitude_is_given_up() {
    let [roll, pitch, heading] = attitude_rad(5.0);
    let wrong = AttitudeStart::Given {
        roll_pitch_heading_rad: [roll, pitch, heading + FRAC_PI_2],
    };
    let rows = run(&unit(wrong), &flight_of(60, Some));
    let lost = rows
        .iter()
        .find(|row| row.report.inertial == InertialStatus::Unhealthy)
        .expect("a wrong heading shows");
    assert!(lost.ms < 40_000, "{}", lost.ms);
    let last = rows.last().unwrap();
    let [.., heading_deg] = last.report.navigation.unwrap().roll_pitch_heading_deg;
    let [.., true_rad] = attitude_rad(60.0);
    let apart_deg = (heading_deg - true_rad.to_degrees() + 540.0).rem_euclid(360.0) - 180.0;
    assert!(apart_deg.abs() < 2.0, "{apart_deg}");
}

/// INT-119. Without fixes epochs go on at their rhythm, and the error stays within what is told of it.
#[test]
fn int_119_epochs_go_on_through_an_outage_and_the_sigma_grows_with_the_error() {
    let inputs = flight_of(70, |fix| {
        let ms = ms_of(fix.time);
        (!(40_000..50_000).contains(&ms)).then_some(fix)
    });
    let rows = run(&unit(COURSE), &inputs);
    let silent: Vec<&Row> = rows
        .iter()
        .filter(|row| (40_000..50_000).contains(&row.ms))
        .collect();
    assert_eq!(silent.len() as i64, 10_000 / FIX_MS);
    let mut sigma_m = 0.0;
    for row in &silent {
        let report = &row.report;
        assert_eq!(report.verdict.reason, Reason::ReceiverSilent);
        assert_eq!(report.mode, Mode::Loose);
        assert!(is_withheld(row) && is_running(row));
        let [e, n, u] = report.sigma_enu_m.unwrap();
        let [h, v] = row.error_m.unwrap();
        assert!(
            h < 4.0 * e.hypot(n) && v < 4.0 * u,
            "{} ms: {h} {v}",
            row.ms
        );
        assert!(e.hypot(n) > sigma_m);
        sigma_m = e.hypot(n);
    }
    let after = rows.iter().find(|row| row.ms == 52_000).unwrap();
    let [h, v] = after.error_m.unwrap();
    assert!(h < 0.2 && v < 0.1, "{h} {v}");
}

/// INT-119. A receiver that says it has no solution is an epoch too, at which the filter coasts.
#[test]
fn int_119_a_fix_without_a_solution_coasts() {
    let inputs = flight_of(60, |mut fix| {
        if (40_000..45_000).contains(&ms_of(fix.time)) {
            fix.solution = None;
        }
        Some(fix)
    });
    let rows = run(&unit(COURSE), &inputs);
    for row in rows.iter().filter(|row| (40_000..45_000).contains(&row.ms)) {
        assert_eq!(row.report.verdict.reason, Reason::NoRawData);
        assert!(is_withheld(row) && is_running(row));
        let [h, v] = row.error_m.unwrap();
        assert!(h < 1.0 && v < 1.0, "{} ms: {h} {v}", row.ms);
    }
    // Without a filter there is then no position at all.
    let never = flight_of(10, |mut fix| {
        fix.solution = None;
        Some(fix)
    });
    for row in run(&unit(COURSE), &never) {
        assert_eq!((row.report.mode, row.report.fix), (Mode::None, None));
        assert!(is_withheld(&row));
    }
}

/// Something done to a fix or to its frame.
#[derive(Clone, Debug)]
enum Damage {
    Byte {
        at: usize,
        flip: u8,
    },
    Shift {
        by_ms: i64,
    },
    Accuracy {
        horizontal_m: f64,
        speed_mps: f64,
    },
    Velocity {
        ned_mps: [f64; 3],
    },
    Place {
        lat_rad: f64,
        lon_rad: f64,
        height_m: f64,
    },
    Withhold,
}

fn damage() -> impl Strategy<Value = (usize, Damage)> {
    let any = prop_oneof![
        (0..110_usize, 1..=255_u8).prop_map(|(at, flip)| Damage::Byte { at, flip }),
        (-20_000..20_000_i64).prop_map(|by_ms| Damage::Shift { by_ms }),
        (1e-9..1e4_f64, 1e-9..1e4_f64).prop_map(|(horizontal_m, speed_mps)| Damage::Accuracy {
            horizontal_m,
            speed_mps
        }),
        [-2e3..2e3_f64, -2e3..2e3_f64, -2e3..2e3_f64]
            .prop_map(|ned_mps| Damage::Velocity { ned_mps }),
        (-1.57..1.57_f64, -3.0..3.0_f64, -1e5..1e5_f64).prop_map(|(lat_rad, lon_rad, height_m)| {
            Damage::Place {
                lat_rad,
                lon_rad,
                height_m,
            }
        }),
        Just(Damage::Withhold),
    ];
    (0..120_usize, any)
}

fn damaged(fix: &ReceiverFix, damage: &Damage) -> Vec<u8> {
    let mut fix = *fix;
    let mut flipped = None;
    match (damage, &mut fix.solution) {
        (Damage::Byte { at, flip }, _) => flipped = Some((*at, *flip)),
        (Damage::Shift { by_ms }, _) => fix.time = fix.time.plus_ns(by_ms * 1_000_000),
        (
            Damage::Accuracy {
                horizontal_m,
                speed_mps,
            },
            Some(solution),
        ) => {
            solution.horizontal_accuracy_m = *horizontal_m;
            solution.vertical_accuracy_m = *horizontal_m;
            if let Some(velocity) = &mut solution.velocity {
                velocity.accuracy_mps = *speed_mps;
            }
        }
        (Damage::Velocity { ned_mps }, Some(solution)) => {
            if let Some(velocity) = &mut solution.velocity {
                velocity.ned_mps = *ned_mps;
            }
        }
        (
            Damage::Place {
                lat_rad,
                lon_rad,
                height_m,
            },
            Some(solution),
        ) => {
            solution.llh = geodesy::Llh {
                lat_rad: *lat_rad,
                lon_rad: *lon_rad,
                height_m: *height_m,
            };
        }
        (Damage::Withhold, _) => return Vec::new(),
        (_, None) => {}
    }
    let mut bytes = bytes(&fix);
    if let Some((at, flip)) = flipped {
        let count = bytes.len();
        bytes[at % count] ^= flip;
    }
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..ProptestConfig::default() })]

    /// INT-116. Whatever becomes of fixes on their way: no panic, every number told is one, nothing is usable.
    #[test]
    fn int_116_no_damage_makes_a_fix_usable_or_a_number_none(
        damages in proptest::collection::vec(damage(), 1..12)
    ) {
        let mut count = 0;
        let inputs: Vec<Input> = flight_of(30, Some)
            .into_iter()
            .map(|input| {
                if !matches!(input, Input::Bytes(_)) {
                    return input;
                }
                let here = damages.iter().find(|(k, _)| *k == count);
                let honest = fix(FIX_MS * count as i64, [0.0; 3]);
                count += 1;
                match here {
                    Some((_, damage)) => Input::Bytes(damaged(&honest, damage)),
                    None => input,
                }
            })
            .collect();
        for row in flight::run_unchecked(&unit(COURSE), &inputs) {
            prop_assert!(is_withheld(&row), "{:?}", row.report);
            prop_assert!(row.is_finite(), "{:?}", row.report);
            let sigmas = row.report.sigma_enu_m.unwrap_or_default();
            prop_assert!(sigmas.iter().all(|sigma| sigma.is_finite()));
        }
    }
}
