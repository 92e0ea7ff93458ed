//! Alignment epoch by epoch; over seeded starts: host-tests/tests/alignment.rs.

use super::*;
use crate::frames::geodesy::{Llh, to_ecef};
use crate::ins::{ClockNoise, InitialSigma, MeasurementFactors, SensorRange};
use core::f64::consts::PI;

const COURSE: AttitudeStart = AttitudeStart::Course { min_speed_mps: 3.0 };

/// A tactical unit; the errors its sigmas tell of are put in one by one.
fn unit(start: AttitudeStart) -> InertialConfig {
    InertialConfig {
        interval_ns: 10_000_000,
        c_b_s: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        lever_arm_b_m: [0.0; 3],
        noise: InertialNoise {
            arw: 2.9e-5,
            vrw: 4.9e-4,
            gyro_bias_walk: 0.0,
            accel_bias_walk: 0.0,
        },
        clock: ClockNoise {
            bias_psd: 0.1,
            drift_psd: 0.1,
            drift_decay_per_s: 0.0,
            inter_system_psd: 0.0,
        },
        measurement: MeasurementFactors::ONE,
        range: SensorRange {
            rate_radps: 10.0,
            specific_force_mps2: 100.0,
        },
        start,
        sigma: InitialSigma {
            position_m: 1.0,
            velocity_mps: 0.1,
            attitude_ned_rad: [0.01, 0.01, 0.05],
            gyro_bias_radps: 4.85e-6,
            accel_bias_mps2: 0.0098,
            clock_bias_m: 1.0,
            clock_drift_mps: 0.1,
        },
    }
}

fn configured(start: AttitudeStart) -> CoarseAlignment {
    let mut alignment = CoarseAlignment::EMPTY;
    alignment.configure(&unit(start));
    alignment
}

/// An epoch at the vehicle's place.
fn at(time: GpsTime, v_enu: Option<Vector3<f64>>) -> AlignmentEpoch {
    AlignmentEpoch {
        time,
        r_e: Vehicle::place(),
        v_enu,
        sigma_enu_mps: [0.05; 3],
    }
}

/// Turns and gathers speed with a constant bank and pitch.
struct Vehicle {
    roll: f64,
    pitch: f64,
    turn_radps: f64,
    thrust_mps2: f64,
}

impl Vehicle {
    fn place() -> Vector3<f64> {
        to_ecef(&Llh {
            lat_rad: 0.8,
            lon_rad: 0.3,
            height_m: 200.0,
        })
    }

    fn angles(&self, t_s: f64) -> [f64; 3] {
        [self.roll, self.pitch, 2.5 + self.turn_radps * t_s]
    }

    fn velocity_n(&self, t_s: f64) -> Vector3<f64> {
        let speed = 10.0 + self.thrust_mps2 * t_s;
        let [.., heading] = self.angles(t_s);
        Vector3::new(speed * libm::cos(heading), speed * libm::sin(heading), 0.0)
    }

    fn c_e_b(&self, t_s: f64) -> Matrix3<f64> {
        rotation::c_e_n(0.8, 0.3) * rotation::c_n_b(&self.angles(t_s))
    }

    /// Rates and forces of the middle of a sample of a millisecond.
    fn increment(&self, end_s: f64) -> Increment {
        let (dt_s, middle_s) = (1e-3, end_s - 5e-4);
        let c_n_b = rotation::c_n_b(&self.angles(middle_s));
        let c_e_n = rotation::c_e_n(0.8, 0.3);
        let earth = Vector3::new(0.0, 0.0, OMEGA);
        let v_e = c_e_n * self.velocity_n(middle_s);
        let dv_n = self.velocity_n(end_s) - self.velocity_n(end_s - dt_s);
        let force_e = c_e_n * (dv_n / dt_s) + 2.0 * earth.cross(&v_e) - gravity_e(&Self::place());
        let rate_n = Vector3::new(0.0, 0.0, self.turn_radps) + c_e_n.transpose() * earth;
        Increment {
            dtheta_b: c_n_b.transpose() * rate_n * dt_s,
            dv_b: self.c_e_b(middle_s).transpose() * force_e * dt_s,
            dt_s,
        }
    }

    /// Two epochs a second apart; the accelerometers have a bias, the first `lost` samples are.
    fn align(&self, bias: Vector3<f64>, lost: i32) -> Result<Aligned, NotAligned> {
        let mut alignment = configured(COURSE);
        let enu = |t_s| {
            let v = self.velocity_n(t_s);
            Vector3::new(v.y, v.x, -v.z)
        };
        let (first, second) = (GpsTime::from_ns(0), GpsTime::from_ns(NS_PER_S));
        let begin = alignment.epoch(&at(first, Some(enu(0.0))));
        assert_eq!(begin, Err(NotAligned::Window));
        for k in lost + 1..=1000 {
            let mut increment = self.increment(f64::from(k) * 1e-3);
            increment.dv_b += bias * increment.dt_s;
            alignment.accumulate(&increment);
        }
        alignment.epoch(&at(second, Some(enu(1.0))))
    }

    /// Errors about body axes, rad.
    fn error(&self, aligned: &Aligned) -> Vector3<f64> {
        let difference = self.c_e_b(1.0).transpose() * rotation::to_matrix(&aligned.q_e_b);
        let [_, x, y, z] = rotation::from_matrix(&difference).unwrap();
        Vector3::new(2.0 * x, 2.0 * y, 2.0 * z)
    }
}

const MOTIONS: [Vehicle; 4] = [
    Vehicle {
        roll: 0.02,
        pitch: -0.03,
        turn_radps: 0.0,
        thrust_mps2: 0.0,
    },
    Vehicle {
        roll: 0.5,
        pitch: 0.1,
        turn_radps: 0.4,
        thrust_mps2: 0.0,
    },
    Vehicle {
        roll: -0.1,
        pitch: 0.3,
        turn_radps: -0.3,
        thrust_mps2: 3.0,
    },
    Vehicle {
        roll: 2.8,
        pitch: -1.2,
        turn_radps: 0.1,
        thrust_mps2: -2.0,
    },
];

#[test]
fn attitude_is_found_while_turning_and_accelerating() {
    for motion in MOTIONS {
        let error = motion.error(&motion.align(ZERO, 0).unwrap());
        std::println!("{error:?}");
        // What is left: the mean over a second of a turn against its chord.
        assert!(error.norm() < 1e-4);
    }
}

#[test]
fn accelerometer_bias_tilts_by_its_part_of_gravity() {
    let [motion, ..] = &MOTIONS;
    let q_e_b = motion.align(Vector3::new(0.05, 0.05, 0.0), 0).unwrap();
    let error = motion.error(&q_e_b);
    assert!((error.x.abs() - 0.0051).abs() < 2e-4 && (error.y.abs() - 0.0051).abs() < 2e-4);
    assert!(error.z.abs() < 5e-4);
}

#[test]
fn given_angles_are_those_at_the_place() {
    let mut alignment = CoarseAlignment::EMPTY;
    let epoch = at(GpsTime::from_ns(0), None);
    assert_eq!(alignment.epoch(&epoch), Err(NotAligned::Window));
    let angles = [0.1, -0.4, 3.0];
    alignment = configured(AttitudeStart::Given {
        roll_pitch_heading_rad: angles,
    });
    let aligned = alignment.epoch(&epoch).unwrap();
    let c_n_b = rotation::c_e_n(0.8, 0.3).transpose() * rotation::to_matrix(&aligned.q_e_b);
    let back = rotation::roll_pitch_heading(&c_n_b);
    assert!(angles.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-9));
    assert_eq!(aligned.sigma_ned_rad, [0.01, 0.01, 0.05]);
    assert_eq!(aligned.mode, AlignmentMode::Given);
    let nowhere = alignment.epoch(&AlignmentEpoch { r_e: ZERO, ..epoch });
    assert!(matches!(nowhere, Err(NotAligned::Position(_))));
    // Lost, it is given no more.
    alignment.resume(true);
    assert_eq!(alignment.epoch(&epoch), Err(NotAligned::Window));
    alignment = configured(AttitudeStart::Given {
        roll_pitch_heading_rad: [f64::NAN, 0.0, PI],
    });
    assert_eq!(alignment.epoch(&epoch), Err(NotAligned::NotFinite));
}

#[test]
fn what_cannot_be_aligned_says_why() {
    let [motion, ..] = &MOTIONS;
    assert!(matches!(
        motion.align(ZERO, 100),
        Err(NotAligned::SamplesMissing { .. })
    ));
    assert!(matches!(
        motion.align(Vector3::new(0.0, 0.0, -1.5), 0),
        Err(NotAligned::ForceMismatch { .. })
    ));
    assert!(matches!(
        motion.align(Vector3::repeat(f64::NAN), 0),
        Err(NotAligned::ForceMismatch { .. })
    ));
    let braking = Vehicle {
        thrust_mps2: -8.0,
        ..MOTIONS[0]
    };
    assert!(matches!(
        braking.align(ZERO, 0),
        Err(NotAligned::TooSlow { .. })
    ));
}

#[test]
fn ten_epochs_a_second_make_one_window() {
    let [.., motion, _] = &MOTIONS;
    let mut alignment = configured(COURSE);
    let mut found = std::vec::Vec::new();
    for k in 0..=2000_i32 {
        let t_s = f64::from(k) * 1e-3;
        if k > 0 {
            alignment.accumulate(&motion.increment(t_s));
        }
        if k % 100 == 0 {
            let v = motion.velocity_n(t_s);
            let v_enu = Vector3::new(v.y, v.x, -v.z);
            let time = GpsTime::from_ns(i64::from(k) * 1_000_000);
            if alignment.epoch(&at(time, Some(v_enu))).is_ok() {
                found.push(k);
            }
        }
    }
    assert_eq!(found, [1000, 2000]);
}

#[test]
fn a_course_is_as_uncertain_as_velocity_speed_and_side_slip_make_it() {
    let [motion, ..] = &MOTIONS;
    let aligned = motion.align(ZERO, 0).unwrap();
    let [north, east, heading] = aligned.sigma_ned_rad;
    // 0.05 m/s at 10 m/s beside the side-slip configured.
    assert!((heading - 0.005_f64.hypot(0.05)).abs() < 1e-6, "{heading}");
    let level = (0.0098_f64.powi(2) + 4.9e-4_f64.powi(2) + 2.0 * 0.05_f64.powi(2)).sqrt() / 9.81;
    let level = level.hypot(0.01);
    assert!((north / level - 1.0).abs() < 1e-3 && (east / level - 1.0).abs() < 1e-3);
    // Gathering speed turns the level with the heading.
    let [.., fast, _] = &MOTIONS;
    let [north, ..] = fast.align(ZERO, 0).unwrap().sigma_ned_rad;
    assert!(north > 1.1 * level, "{north}");
    let mut slow = configured(AttitudeStart::Course { min_speed_mps: 0.0 });
    let crawl = Vector3::new(0.05, 0.0, 0.0);
    let _ = slow.epoch(&at(GpsTime::from_ns(0), Some(crawl)));
    feed(&mut slow, &standing([0.0; 3]), 100);
    let refused = slow.epoch(&at(GpsTime::from_ns(NS_PER_S), Some(crawl)));
    assert!(matches!(
        refused,
        Err(NotAligned::HeadingTooUncertain { .. })
    ));
}

/// A unit at rest at 10 ms with this attitude.
fn standing(angles: [f64; 3]) -> Increment {
    let c_b_n = rotation::c_n_b(&angles).transpose();
    let c_n_e = rotation::c_e_n(0.8, 0.3).transpose();
    Increment {
        dtheta_b: c_b_n * c_n_e * Vector3::new(0.0, 0.0, OMEGA) * 0.01,
        dv_b: c_b_n * c_n_e * -gravity_e(&Vehicle::place()) * 0.01,
        dt_s: 0.01,
    }
}

fn feed(alignment: &mut CoarseAlignment, increment: &Increment, count: usize) {
    for _ in 0..count {
        alignment.accumulate(increment);
    }
}

/// Errors about north, east, down of an attitude of a unit at rest, rad.
fn error_n(aligned: &Aligned, angles: [f64; 3]) -> Vector3<f64> {
    let c_n_e = rotation::c_e_n(0.8, 0.3).transpose();
    let c = c_n_e * rotation::to_matrix(&aligned.q_e_b) * rotation::c_n_b(&angles).transpose();
    let [_, x, y, z] = rotation::from_matrix(&c).unwrap();
    Vector3::new(2.0 * x, 2.0 * y, 2.0 * z)
}

const GYROCOMPASS: AttitudeStart = AttitudeStart::Gyrocompass {
    max_heading_sigma_rad: 0.2,
};

fn still(seconds: i64) -> AlignmentEpoch {
    at(GpsTime::from_ns(seconds * NS_PER_S), Some(ZERO))
}

#[test]
fn a_unit_at_rest_finds_north_by_the_rotation_of_the_earth() {
    for angles in [[0.0, 0.0, 0.0], [0.3, -0.5, 2.5], [3.0, 1.2, -2.0]] {
        let mut alignment = configured(GYROCOMPASS);
        let increment = standing(angles);
        feed(&mut alignment, &increment, 5_900);
        let early = alignment.epoch(&still(59));
        assert!(matches!(early, Err(NotAligned::RestTooShort { .. })));
        feed(&mut alignment, &increment, 200);
        let aligned = alignment.epoch(&still(61)).unwrap();
        assert_eq!(aligned.mode, AlignmentMode::Gyrocompass);
        assert!(error_n(&aligned, angles).norm() < 1e-6);
        // 1 °/h of bias and 0.1 °/√h over 61 s against 15.04 °/h cos 45.8°.
        let [north, _, heading] = aligned.sigma_ned_rad;
        let rate =
            (4.85e-6_f64.powi(2) + 2.9e-5_f64.powi(2) / 61.0).sqrt() / OMEGA / libm::cos(0.8);
        assert!((heading / rate.hypot(north * libm::tan(0.8)) - 1.0).abs() < 1e-3);
        assert!((north / (0.0098 / 9.81) - 1.0).abs() < 0.01);
    }
}

#[test]
fn a_bias_turns_the_gyrocompass_by_its_part_of_the_rotation_of_the_earth() {
    let mut alignment = configured(GYROCOMPASS);
    let mut increment = standing([0.0; 3]);
    increment.dtheta_b += Vector3::new(0.0, 4.85e-6, 0.0) * 0.01;
    feed(&mut alignment, &increment, 6_100);
    let aligned = alignment.epoch(&still(61)).unwrap();
    let error = error_n(&aligned, [0.0; 3]);
    let expected = 4.85e-6 / (OMEGA * libm::cos(0.8));
    assert!((error.z.abs() / expected - 1.0).abs() < 0.01, "{error}");
}

#[test]
fn a_unit_that_cannot_feel_the_rotation_of_the_earth_is_told_so_at_once() {
    let mut config = unit(GYROCOMPASS);
    config.sigma.gyro_bias_radps = 2.4e-4;
    let mut alignment = CoarseAlignment::EMPTY;
    alignment.configure(&config);
    feed(&mut alignment, &standing([0.0; 3]), 300);
    let refused = alignment.epoch(&still(3));
    assert!(
        matches!(refused, Err(NotAligned::HeadingTooUncertain { sigma_rad }) if sigma_rad > 4.0),
        "{refused:?}"
    );
}

#[test]
fn a_platform_that_turns_is_not_compassed() {
    // Slower than a bias, which hides it from the detection of rest, but not of the length of the Earth's.
    let mut increment = standing([0.0; 3]);
    increment.dtheta_b += Vector3::new(0.0, 0.0, 3e-4) * 0.01;
    let mut alignment = configured(GYROCOMPASS);
    feed(&mut alignment, &increment, 6_100);
    let refused = alignment.epoch(&still(61));
    assert!(
        matches!(refused, Err(NotAligned::EarthRateMismatch { .. })),
        "{refused:?}"
    );
    // The receiver says that it moves: no rest, however quiet the samples are.
    let mut alignment = configured(GYROCOMPASS);
    feed(&mut alignment, &standing([0.0; 3]), 6_100);
    let cruising = at(
        GpsTime::from_ns(61 * NS_PER_S),
        Some(Vector3::new(70.0, 0.0, 0.0)),
    );
    assert_eq!(alignment.epoch(&cruising), Err(NotAligned::Window));
    let refused = alignment.epoch(&still(62));
    assert!(refused.is_err(), "{refused:?}");
}

const MAGNETOMETER: Magnetometer = Magnetometer {
    hard_iron_s_ut: [12.0, -7.0, 30.0],
    soft_iron_b_s: [[0.0, 1.1, 0.0], [-0.9, 0.0, 0.02], [0.0, 0.03, 1.0]],
    declination_rad: 0.05,
    sigma_declination_rad: 0.005,
    declination_year: 1980.0,
    dip_rad: 1.1,
    strength_ut: 48.0,
    sigma_ut: 0.5,
};

/// What the magnetometer reads where the field is this, north, east, down, µT.
fn reading(field_n_ut: Vector3<f64>, angles: [f64; 3]) -> MagneticSample {
    let [a, b, c] = MAGNETOMETER.soft_iron_b_s.map(nalgebra::RowVector3::from);
    let to_s = Matrix3::from_rows(&[a, b, c]).try_inverse().unwrap();
    let field_s = to_s * rotation::c_n_b(&angles).transpose() * field_n_ut;
    MagneticSample {
        time: GpsTime::from_ns(0),
        field_s_ut: (field_s + Vector3::from(MAGNETOMETER.hard_iron_s_ut)).into(),
    }
}

fn magnetic() -> CoarseAlignment {
    let mut alignment = configured(AttitudeStart::MagneticField);
    alignment.set_magnetometer(&MAGNETOMETER);
    alignment
}

#[test]
fn the_magnetic_field_gives_a_heading_at_rest() {
    for angles in [[0.0, 0.0, 0.0], [0.3, -0.5, 2.5], [3.0, 1.2, -2.0]] {
        let mut alignment = magnetic();
        feed(&mut alignment, &standing(angles), 300);
        assert_eq!(alignment.epoch(&still(3)), Err(NotAligned::NoField));
        alignment.on_field(&reading(MAGNETOMETER.field_n_ut(), angles));
        let aligned = alignment.epoch(&still(3)).unwrap();
        assert_eq!(aligned.mode, AlignmentMode::MagneticField);
        assert!(error_n(&aligned, angles).norm() < 1e-6);
        let [north, _, heading] = aligned.sigma_ned_rad;
        let by_field = 0.5 / (48.0 * libm::cos(1.1));
        let expected = by_field.hypot(north * libm::tan(1.1)).hypot(0.005);
        assert!(
            (heading / expected - 1.0).abs() < 1e-3,
            "{heading} {expected}"
        );
    }
}

#[test]
fn the_magnetic_field_gives_a_heading_in_a_turn() {
    let [_, turn, ..] = &MOTIONS;
    let mut alignment = magnetic();
    let v = |t_s| {
        let v = turn.velocity_n(t_s);
        Some(Vector3::new(v.y, v.x, -v.z))
    };
    let _ = alignment.epoch(&at(GpsTime::from_ns(0), v(0.0)));
    for k in 1..=1000 {
        let t_s = f64::from(k) * 1e-3;
        alignment.accumulate(&turn.increment(t_s));
        if k % 20 == 0 {
            alignment.on_field(&reading(MAGNETOMETER.field_n_ut(), turn.angles(t_s)));
        }
    }
    let aligned = alignment
        .epoch(&at(GpsTime::from_ns(NS_PER_S), v(1.0)))
        .unwrap();
    assert!(turn.error(&aligned).norm() < 2e-4);
}

#[test]
fn a_field_that_is_not_the_earths_is_refused() {
    let right = MAGNETOMETER.field_n_ut();
    let steep = Vector3::new(right.x + 8.0, right.y, right.z - 2.0);
    for (field, why) in [(right * 1.1, "strength"), (steep, "dip"), (ZERO, "none")] {
        let mut alignment = magnetic();
        feed(&mut alignment, &standing([0.0; 3]), 300);
        alignment.on_field(&reading(field, [0.0; 3]));
        let refused = alignment.epoch(&still(3));
        assert!(
            matches!(refused, Err(NotAligned::FieldMismatch { .. })),
            "{why}: {refused:?}"
        );
    }
    // What is no number is not taken; what was found wrong is not asked again.
    let mut alignment = magnetic();
    feed(&mut alignment, &standing([0.0; 3]), 300);
    alignment.on_field(&reading(Vector3::repeat(f64::NAN), [0.0; 3]));
    assert_eq!(alignment.epoch(&still(3)), Err(NotAligned::NoField));
    alignment.resume(false);
    feed(&mut alignment, &standing([0.0; 3]), 300);
    alignment.on_field(&reading(right, [0.0; 3]));
    assert!(alignment.epoch(&still(6)).is_err());
}

#[test]
fn automatic_takes_the_first_that_has_an_answer() {
    let automatic = AttitudeStart::Automatic {
        min_speed_mps: 3.0,
        max_heading_sigma_rad: 0.2,
    };
    let mut alignment = configured(automatic);
    alignment.set_magnetometer(&MAGNETOMETER);
    feed(&mut alignment, &standing([0.0; 3]), 300);
    // Too short a rest for the one, no sample for the other.
    assert_eq!(alignment.epoch(&still(3)), Err(NotAligned::NoField));
    alignment.on_field(&reading(MAGNETOMETER.field_n_ut(), [0.0; 3]));
    let by_field = alignment.epoch(&still(3)).unwrap();
    assert_eq!(by_field.mode, AlignmentMode::MagneticField);
    feed(&mut alignment, &standing([0.0; 3]), 6_000);
    let by_rotation = alignment.epoch(&still(63)).unwrap();
    assert_eq!(by_rotation.mode, AlignmentMode::Gyrocompass);
}

#[test]
fn a_heading_that_is_known_is_levelled_at_rest_only() {
    let angles = [0.3, -0.5, 2.5];
    let mut alignment = configured(COURSE);
    let place = Vehicle::place();
    let moving = alignment.with_heading(&place, 2.5, 0.3);
    assert_eq!(moving, Err(NotAligned::Moving));
    feed(&mut alignment, &standing(angles), 200);
    let kept = alignment.with_heading(&place, 2.5, 0.3).unwrap();
    assert!(error_n(&kept, angles).norm() < 1e-6);
    assert!((kept.sigma_ned_rad[2] - 0.3).abs() < 1e-9);
    let no_number = alignment.with_heading(&place, f64::NAN, 0.3);
    assert!(no_number.is_err());
}
