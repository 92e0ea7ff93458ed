//! Attitudes that the alignment finds, against the sigmas that it tells; the whole table:
//! `surefix campaign alignment`.

#[path = "tight_mode/flight.rs"]
mod flight;

use std::f64::consts::{FRAC_PI_2, PI};

use flight::{Input, Row, attitude_rad, ms_of, unit};
use nalgebra::Vector3;
use surefix_core::frames::rotation;
use surefix_core::ingest::{encode_magnetic_field, encode_magnetometer};
use surefix_core::ins::alignment::{AlignmentMode, Obstacle};
use surefix_core::ins::{AttitudeStart, MagneticSample, Magnetometer};
use surefix_core::integrity::{InertialStatus, Mode};
use surefix_core::wire::native;
use surefix_host_tests::campaign::alignment::{Alignment, CASES, Method, figures};
use surefix_host_tests::campaign::{outcome, wide_headings};
use surefix_host_tests::consistency::chi_square_interval;
use surefix_host_tests::simulate::inertial::sensors::Grade;

/// INT-095. Over seeded starts the errors of every mode are what its sigma says: neither larger nor much smaller.
///
/// Were they normal with that sigma, the mean squares of the 9 cases that give attitudes would all lie in
/// their intervals in 99.8 % of such tests.
#[test]
fn int_095_errors_of_an_alignment_are_what_its_sigma_says() {
    let outcome = outcome::run::<Alignment>(1, 100, (0, 1)).unwrap();
    let figures = figures(&outcome);
    assert_eq!(figures.len(), CASES.len());
    for figures in figures {
        let case = &CASES[figures.case];
        if case.grade == Grade::Mems && matches!(case.method, Method::Gyrocompass { .. }) {
            continue;
        }
        println!("{case:?}: {figures:?}");
        // A window of rest or a field in 10,000 is taken for none by chance.
        assert!(figures.refused <= 2, "{case:?}: {}", figures.why);
        let [low, high] = figures.interval(0.9998);
        for mean_square in [figures.heading[2], figures.level[2]] {
            assert!(
                (low..=high).contains(&mean_square),
                "{case:?}: {mean_square} not in {low} to {high}"
            );
        }
    }
}

/// INT-096. A unit that cannot feel the rotation of the Earth never gets a heading from it.
#[test]
fn int_096_no_heading_is_invented_for_a_mems_unit() {
    let outcome = outcome::run::<Alignment>(2, 20, (0, 1)).unwrap();
    for start in outcome.of() {
        let case = &CASES[start.case];
        if case.grade == Grade::Mems && matches!(case.method, Method::Gyrocompass { .. }) {
            assert!(start.found.is_none());
            assert_eq!(start.refused, "heading_too_uncertain");
        }
    }
}

const MAGNETOMETER: Magnetometer = Magnetometer {
    hard_iron_s_ut: [12.0, -7.0, 30.0],
    soft_iron_b_s: [[1.05, 0.0, 0.02], [0.0, 0.95, 0.01], [0.0, 0.03, 1.0]],
    declination_rad: 0.05,
    sigma_declination_rad: 0.01,
    declination_year: 2021.0,
    dip_rad: 1.1,
    strength_ut: 48.0,
    sigma_ut: 0.4,
};

fn frame(encode: impl FnOnce(&mut [u8]) -> Result<usize, native::Full>) -> Input {
    let mut out = vec![0; native::MAX_FRAME];
    let length = encode(&mut out).unwrap();
    out.truncate(length);
    Input::Bytes(out)
}

/// The flight with a magnetometer, ten times a second, whose field is turned about the vertical by an angle:
/// what iron nearby or a wrong declination does, and strength and dip do not show.
fn with_field(turned_rad: f64, sigma_ut: f64) -> Vec<Input> {
    let magnetometer = Magnetometer {
        sigma_ut,
        ..MAGNETOMETER
    };
    let rows = MAGNETOMETER.soft_iron_b_s.map(nalgebra::RowVector3::from);
    let to_s = nalgebra::Matrix3::from_rows(&rows).try_inverse().unwrap();
    let field_n = rotation::c_n_b(&[0.0, 0.0, turned_rad]) * MAGNETOMETER.field_n_ut();
    let mut inputs = vec![frame(|out| encode_magnetometer(&magnetometer, out))];
    for input in flight::flight() {
        let sampled = match &input {
            Input::Imu(sample) if ms_of(sample.time) % 100 == 0 => Some(sample.time),
            _ => None,
        };
        inputs.push(input);
        if let Some(time) = sampled {
            let c_n_b = rotation::c_n_b(&attitude_rad(ms_of(time) as f64 / 1000.0));
            let field_s: Vector3<f64> = to_s * c_n_b.transpose() * field_n;
            let sample = MagneticSample {
                time,
                field_s_ut: (field_s + Vector3::from(MAGNETOMETER.hard_iron_s_ut)).into(),
            };
            inputs.push(frame(|out| encode_magnetic_field(&sample, out)));
        }
    }
    inputs
}

fn is_tight(row: &Row) -> bool {
    row.report.mode == Mode::Tight
}

/// INT-097. A filter whose heading came from the magnetic field serves only after motion has confirmed it; with a
/// right field that takes seconds, and no usable error is above its level meanwhile or after.
#[test]
fn int_097_a_magnetic_heading_is_earned_by_motion() {
    let (rows, inertial) =
        flight::run_with_inertial(&unit(AttitudeStart::MagneticField), &with_field(0.0, 0.4));
    let first = rows.iter().position(is_tight).unwrap();
    println!("tight from epoch {first}");
    assert!((4..=30).contains(&first), "{first}");
    assert!(rows[first..].iter().all(is_tight));
    for (row, inertial) in rows.iter().zip(&inertial).skip(3).take(first - 3) {
        assert_eq!(row.report.inertial, InertialStatus::Aligning, "{}", row.ms);
        let alignment = inertial.unwrap().alignment;
        assert_eq!(alignment.mode, AlignmentMode::MagneticField);
        assert_eq!(alignment.obstacle, Obstacle::NotEarned);
    }
    let alignment = inertial[first].unwrap().alignment;
    assert_eq!(alignment.obstacle, Obstacle::None);
    assert!(alignment.sigma_ned_rad.unwrap().iter().all(|s| *s < 0.1));
}

/// INT-098. A field that points 90° or 180° wrong, with the right strength and dip, never serves a position: in a turn its
/// angle against the specific force refuses it; where that does not, motion refutes the filter, the field is not
/// asked again, and the course finds the right heading. No usable error is above its level.
#[test]
fn int_098_a_wrong_magnetic_heading_never_serves() {
    let mut refuted = 0;
    for (turned_rad, sigma_ut) in [FRAC_PI_2, -FRAC_PI_2, PI]
        .into_iter()
        .flat_map(|turned_rad| [0.4, 1.0, 3.0].map(|sigma_ut| (turned_rad, sigma_ut)))
    {
        let (rows, inertial) = flight::run_with_inertial(
            &unit(AttitudeStart::MagneticField),
            &with_field(turned_rad, sigma_ut),
        );
        let ended = rows
            .iter()
            .position(|row| row.report.inertial == InertialStatus::Unhealthy);
        let first = rows.iter().position(is_tight);
        println!("{turned_rad}, {sigma_ut} µT: ended at epoch {ended:?}, tight from {first:?}");
        for (row, inertial) in rows.iter().zip(&inertial).filter(|(row, _)| is_tight(row)) {
            let alignment = inertial.unwrap().alignment;
            assert_eq!(alignment.mode, AlignmentMode::Course, "{}", row.ms);
        }
        match (ended, first) {
            (Some(ended), Some(first)) => {
                assert!(ended < first && first <= ended + 5, "{ended} {first}");
                refuted += 1;
            }
            (None, None) => {
                let last = inertial.last().unwrap().unwrap().alignment;
                assert_eq!(last.obstacle, Obstacle::FieldMismatch);
            }
            other => panic!("{other:?}"),
        }
    }
    assert!(refuted >= 6, "{refuted}");
}

/// INT-099. Up to the sigma at which a filter is believed, 20°, the linear model holds: errors of position and velocity are
/// as large as the filter says; up to that at which it starts, 30°, no position error is beyond what levels are made for.
///
/// With right sigmas 18 means are all within their intervals in 99.8 % of such tests.
#[test]
fn int_099_the_filter_is_linear_up_to_the_sigma_at_which_it_is_believed() {
    let outcome = outcome::run::<wide_headings::WideHeadings>(1, 40, (0, 1)).unwrap();
    // Three degrees of freedom in each of 40 flights, over three.
    let interval = chi_square_interval(1.0, 120.0, 0.9999);
    for figures in wide_headings::figures(&outcome) {
        println!("{figures:?}");
        let sigma_deg = wide_headings::SIGMAS_DEG[figures.sigma];
        if sigma_deg <= 30.0 {
            assert_eq!(figures.beyond, 0, "{sigma_deg}");
        }
        if sigma_deg <= 20.0 {
            for [position, velocity, _] in figures.means {
                assert!(interval.contains(position), "{sigma_deg}: {position}");
                assert!(interval.contains(velocity), "{sigma_deg}: {velocity}");
            }
        }
    }
}
