//! Aids of the inertial unit through the whole monitor, by bytes: what a barometer and a standstill are
//! worth, and that neither, however wrong, makes a position usable whose error is above its level.

use nalgebra::{Matrix4, Vector3};
use proptest::prelude::*;
use surefix_core::gnss::{Satellite, System};
use surefix_core::ingest::{decode_aids, encode_aids};
use surefix_core::ins::{AidUse, AidsConfig, BarometerModel, ZeroVelocityModel};
use surefix_core::integrity::{Integrity, Phase, Reason};
use surefix_core::wire::native::Frame;
use surefix_host_tests::aiding::{AidedRow, Air, BarometerFault, fly_aided, pressures};
use surefix_host_tests::campaign::aids::{Aid, CASES, run_case};
use surefix_host_tests::simulate::flight::Flight;
use surefix_host_tests::simulate::inertial::sensors::Grade;
use surefix_host_tests::simulate::inertial::{Request, Scenario, fly};

fn flown(flight: Flight, grade: Grade, duration_s: u32, seed: u64) -> Scenario {
    let mut request = Request::new(flight, seed);
    request.grade = Some(grade);
    request.duration_s = Some(duration_s);
    fly(&request).unwrap()
}

/// The satellites of one epoch well above the mask, with their directions from the antenna.
fn directions(scenario: &Scenario, t_s: f64) -> Vec<(Satellite, Vector3<f64>)> {
    let epoch = scenario.epochs.iter().find(|e| e.t_s == t_s).unwrap();
    let antenna = scenario.trajectory.state(t_s).r_eb_e;
    let high = epoch.rows.iter().filter(|row| row.elevation_rad > 0.25);
    let rows = high.map(|row| {
        let way = Vector3::from(row.measurement.r_es_e_m) - antenna;
        (row.measurement.satellite, way.normalize())
    });
    rows.collect()
}

/// The four GPS satellites of the least dilution of precision.
fn best_four(scenario: &Scenario, t_s: f64) -> Vec<Satellite> {
    let seen: Vec<_> = directions(scenario, t_s)
        .into_iter()
        .filter(|(satellite, _)| satellite.system() == System::Gps)
        .collect();
    let mut best = (f64::INFINITY, Vec::new());
    let n = seen.len();
    for (a, b, c, d) in (0..n).flat_map(|a| {
        (a + 1..n)
            .flat_map(move |b| (b + 1..n).flat_map(move |c| (c + 1..n).map(move |d| (a, b, c, d))))
    }) {
        let four = [a, b, c, d];
        let design = Matrix4::from_fn(|i, j| if j < 3 { seen[four[i]].1[j] } else { 1.0 });
        let Some(inverse) = (design.transpose() * design).try_inverse() else {
            continue;
        };
        if inverse.trace() < best.0 {
            best = (inverse.trace(), four.map(|k| seen[k].0).to_vec());
        }
    }
    best.1
}

/// From `from_s` on only these satellites are received.
fn keep(scenario: &mut Scenario, from_s: f64, to_s: f64, kept: &[Satellite]) {
    for epoch in &mut scenario.epochs {
        if (from_s..to_s).contains(&epoch.t_s) {
            epoch
                .rows
                .retain(|row| kept.contains(&row.measurement.satellite));
        }
    }
}

/// Puts an error on a satellite's pseudorange.
fn fault(scenario: &mut Scenario, satellite: Satellite, error_m: impl Fn(f64) -> f64) {
    for epoch in &mut scenario.epochs {
        for row in &mut epoch.rows {
            if row.measurement.satellite == satellite {
                row.fault.0 += error_m(epoch.t_s);
            }
        }
    }
}

fn barometer() -> AidsConfig {
    Aid::Barometer.config()
}

fn aided(scenario: &Scenario, with_unit: bool, faulty: Option<BarometerFault>) -> Vec<AidedRow> {
    let samples = pressures(scenario, &Air::of_day(7), 7, faulty);
    fly_aided(scenario, Phase::Npa, with_unit, &barometer(), &samples).unwrap()
}

fn is_usable(row: &AidedRow) -> bool {
    row.report.verdict.integrity.is_usable()
}

fn between(rows: &[AidedRow], from_s: f64, to_s: f64) -> impl Iterator<Item = &AidedRow> {
    rows.iter()
        .filter(move |row| (from_s..to_s).contains(&row.t_s))
}

fn assert_bounded(rows: &[AidedRow], what: &str) {
    for row in rows {
        let verdict = &row.report.verdict;
        assert!(
            !row.misleads(),
            "{what}, {} s: {:?} against {:?} and {:?}",
            row.t_s,
            row.error_enu_m,
            verdict.hpl,
            verdict.vpl
        );
    }
}

/// INT-106.
#[test]
fn four_satellites_and_a_height_are_tested() {
    let mut scenario = flown(Flight::UavSurvey, Grade::Mems, 240, 3);
    let four = best_four(&scenario, 150.0);
    keep(&mut scenario, 120.0, 300.0, &four);
    let without = fly_aided(&scenario, Phase::Npa, false, &AidsConfig::NONE, &[]).unwrap();
    for row in between(&without, 120.0, 240.0) {
        assert_eq!(row.report.verdict.reason, Reason::NoRedundancy);
    }
    let with = aided(&scenario, false, None);
    assert_bounded(&with, "healthy");
    let usable = between(&with, 120.0, 240.0)
        .filter(|row| is_usable(row))
        .count();
    assert!(usable >= 115, "{usable} of 120");
}

/// INT-106. The fault begins when the fifth satellite has gone.
#[test]
fn fault_on_one_of_four_satellites_is_found_with_a_height() {
    let mut scenario = flown(Flight::UavSurvey, Grade::Mems, 240, 3);
    let four = best_four(&scenario, 150.0);
    keep(&mut scenario, 120.0, 300.0, &four);
    for satellite in &four {
        let mut faulty = flown(Flight::UavSurvey, Grade::Mems, 240, 3);
        keep(&mut faulty, 120.0, 300.0, &four);
        fault(&mut faulty, *satellite, |t_s| {
            if t_s >= 150.0 {
                10.0 * (t_s - 150.0)
            } else {
                0.0
            }
        });
        let rows = aided(&faulty, false, None);
        assert_bounded(&rows, &format!("{satellite}"));
        let alerts = between(&rows, 150.0, 240.0)
            .filter(|row| row.report.verdict.integrity == Integrity::Alert)
            .count();
        assert!(alerts > 40, "{satellite}: {alerts}");
    }
}

/// INT-107. A ramp that the full sky has not yet found when the sky goes is in the height too.
#[test]
fn height_that_a_faulty_satellite_calibrated_does_not_vouch_for_it() {
    for slope_mps in [0.05, 0.15, 0.4] {
        for number in 0..4 {
            let mut scenario = flown(Flight::UavSurvey, Grade::Mems, 200, 3);
            let four = best_four(&scenario, 150.0);
            keep(&mut scenario, 120.0, 300.0, &four);
            fault(&mut scenario, four[number], |t_s| {
                if t_s >= 20.0 {
                    slope_mps * (t_s - 20.0)
                } else {
                    0.0
                }
            });
            let rows = aided(&scenario, number == 0, None);
            assert_bounded(&rows, &format!("{slope_mps} m/s on {}", four[number]));
        }
    }
}

fn barometer_faults(from_s: f64) -> Vec<BarometerFault> {
    let mut faults: Vec<BarometerFault> = [-300.0, -30.0, 5.0, 60.0]
        .map(|by_m| BarometerFault::Step { from_s, by_m })
        .to_vec();
    faults.extend([-5.0, -0.5, 0.1, 1.0].map(|by_mps| BarometerFault::Ramp { from_s, by_mps }));
    faults.extend([true, false].map(|noisy| BarometerFault::Stuck { from_s, noisy }));
    faults
}

/// INT-105.
#[test]
fn barometer_that_is_wrong_leaves_no_usable_epoch_above_its_level() {
    // A climb of 2 m/s in the full sky, with four satellites, three, none; and back.
    for (number, fault) in barometer_faults(150.0).into_iter().enumerate() {
        let mut scenario = flown(Flight::Evtol, Grade::Mems, 240, 5);
        let four = best_four(&scenario, 180.0);
        keep(&mut scenario, 160.0, 185.0, &four);
        keep(&mut scenario, 185.0, 200.0, &four[..3]);
        scenario
            .epochs
            .retain(|epoch| !(200.0..215.0).contains(&epoch.t_s));
        let rows = aided(&scenario, true, Some(fault));
        assert_bounded(&rows, &format!("{fault:?}"));
        // With all satellites back nothing of it is left.
        let [e, n, u] = rows.last().unwrap().error_enu_m.unwrap();
        assert!(e.hypot(n) < 5.0 && u.abs() < 8.0, "{fault:?}: {e} {n} {u}");
        if number % 3 == 0 {
            let rows = aided(&scenario, false, Some(fault));
            assert_bounded(&rows, &format!("{fault:?}, snapshot"));
        }
    }
}

/// INT-105. In the full sky a barometer that runs away is told, and moves no position.
#[test]
fn barometer_that_contradicts_the_satellites_is_told() {
    let scenario = flown(Flight::UavSurvey, Grade::Mems, 200, 5);
    let fault = BarometerFault::Ramp {
        from_s: 100.0,
        by_mps: 3.0,
    };
    let rows = aided(&scenario, true, Some(fault));
    let healthy = aided(&scenario, true, None);
    let climb = |row: &AidedRow| row.inertial.unwrap().aids.climb;
    assert!(between(&healthy, 60.0, 200.0).any(|row| climb(row) == AidUse::Used));
    assert!(between(&healthy, 20.0, 200.0).all(|row| climb(row) != AidUse::Excluded));
    assert!(between(&rows, 125.0, 200.0).all(|row| climb(row) == AidUse::Excluded));
    assert!(
        rows.iter()
            .all(|row| row.report.verdict.integrity != Integrity::Alert)
    );
    for (with, without) in rows.iter().zip(&healthy) {
        if let (Some(a), Some(b)) = (with.error_enu_m, without.error_enu_m) {
            assert!((a[2] - b[2]).abs() < 0.1, "{} s", with.t_s);
        }
    }
}

/// INT-108. Straight flight at 70 m/s down the glide path, 1,140 windows of a second per grade, half of them
/// without a satellite.
#[test]
fn smooth_cruise_is_never_taken_for_a_standstill() {
    let aids = Aid::ZeroVelocity.config();
    for grade in [Grade::Navigation, Grade::Tactical, Grade::Mems] {
        let (mut windows, mut felt_still) = (0, 0);
        for seed in 0..6 {
            let mut scenario = flown(Flight::Lpv200, grade, 290, 100 + seed);
            if seed % 2 == 1 {
                scenario.epochs.retain(|epoch| epoch.t_s < 110.0);
            }
            let rows = fly_aided(&scenario, Phase::Npa, true, &aids, &[]).unwrap();
            assert_bounded(&rows, grade.name());
            for row in between(&rows, 100.0, 290.0) {
                let standstill = row.inertial.unwrap().aids.standstill;
                assert_ne!(
                    standstill,
                    AidUse::Used,
                    "{} at {} s",
                    grade.name(),
                    row.t_s
                );
                windows += 1;
                felt_still += usize::from(standstill == AidUse::Refused);
            }
        }
        assert!(windows >= 1000, "{windows}");
        // The samples alone would have said so: it is the velocity that refuses.
        assert!(
            felt_still > windows * 9 / 10,
            "{}: {felt_still} of {windows}",
            grade.name()
        );
    }
}

/// INT-109.
#[test]
fn vehicle_that_stands_stays_where_it_is_without_satellites() {
    for case in CASES.iter().filter(|case| case.aid == Aid::ZeroVelocity) {
        let result = run_case(case, 41, 2).unwrap();
        assert_eq!(result.misleading, 0, "{case:?}");
        let last = result.errors.last().unwrap();
        let [h, v] = last.largest_with_m;
        assert!(h < 0.6 && v < 0.6, "{case:?}: {h} {v}");
        assert!(last.rms_with_m[0] < last.rms_without_m[0], "{case:?}");
    }
}

/// INT-110.
#[test]
fn barometer_holds_the_height_through_an_outage() {
    let (mut with_m2, mut without_m2) = (0.0, 0.0);
    for case in CASES.iter().filter(|case| case.aid == Aid::Barometer) {
        let result = run_case(case, 41, 2).unwrap();
        assert_eq!(result.misleading, 0, "{case:?}");
        let last = result.errors.last().unwrap();
        with_m2 += last.rms_with_m[1] * last.rms_with_m[1];
        without_m2 += last.rms_without_m[1] * last.rms_without_m[1];
        assert!(last.rms_with_m[1] < 1.1 * last.rms_without_m[1], "{case:?}");
        assert!(last.vertical_over_sigma < 3.0, "{case:?}");
    }
    assert!(with_m2 < 0.7 * without_m2, "{with_m2} {without_m2}");
}

const BOTH: AidsConfig = AidsConfig {
    barometer: Some(BarometerModel::PRESET),
    zero_velocity: Some(ZeroVelocityModel::PRESET),
};

fn payload(aids: &AidsConfig) -> Vec<u8> {
    let mut out = [0; 128];
    let length = encode_aids(aids, &mut out).unwrap();
    let (frame, _) = Frame::parse(&out[..length]).unwrap();
    frame.payload().to_vec()
}

#[test]
fn aids_that_are_written_read_back_and_illegal_ones_are_refused() {
    let none = AidsConfig::NONE;
    for aids in [none, barometer(), Aid::ZeroVelocity.config(), BOTH] {
        assert_eq!(decode_aids(&payload(&aids)), Ok(aids));
        assert!(decode_aids(&payload(&aids)[1..]).is_err());
    }
    let mut wrong = BOTH;
    wrong.barometer = Some(BarometerModel {
        sigma_m: f64::NAN,
        ..BarometerModel::PRESET
    });
    assert!(decode_aids(&payload(&wrong)).is_err());
    // Numbers of an aid that is not there.
    let mut bytes = payload(&BOTH);
    bytes[0] = 1;
    assert!(decode_aids(&bytes).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn any_bytes_are_legal_aids_or_refused(bytes in prop::collection::vec(any::<u8>(), 57)) {
        if let Ok(aids) = decode_aids(&bytes) {
            prop_assert!(aids.check().is_ok());
        }
    }
}
