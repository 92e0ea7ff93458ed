//! The mechanisation follows motions whose solution is known, and the reference trajectories.

mod common;

use std::f64::consts::PI;
use std::fs;
use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use surefix_core::consts::OMEGA_EARTH_WGS84_RADPS as OMEGA;
use surefix_core::frames::geodesy::{Llh, to_ecef};
use surefix_core::frames::rotation::{self, Quaternion};
use surefix_core::ins::gravity::gravity_e;
use surefix_core::ins::{Increment, InitialState, Mechanisation};
use surefix_core::time::GpsTime;

const LAT_RAD: f64 = 0.7;
const LON_RAD: f64 = 2.0;

fn place() -> Vector3<f64> {
    to_ecef(&Llh {
        lat_rad: LAT_RAD,
        lon_rad: LON_RAD,
        height_m: 500.0,
    })
}

/// Position, velocity, acceleration against the Earth.
type Point = [Vector3<f64>; 3];
/// Roll, pitch, heading against the axes of [`place`], and their rates.
type Angles = [[f64; 3]; 2];

/// A motion given as functions of time.
struct Motion {
    /// North, east, down from [`place`].
    point_n: fn(f64) -> Point,
    angles: fn(f64) -> Angles,
}

impl Motion {
    fn point_e(&self, t_s: f64) -> Point {
        let c_e_n = rotation::c_e_n(LAT_RAD, LON_RAD);
        let [r, v, a] = (self.point_n)(t_s).map(|x| c_e_n * x);
        [place() + r, v, a]
    }

    fn c_e_b(&self, t_s: f64) -> Matrix3<f64> {
        rotation::c_e_n(LAT_RAD, LON_RAD) * rotation::c_n_b(&(self.angles)(t_s)[0])
    }

    /// What perfect sensors measure: rate and specific force, body axes.
    fn sensed(&self, t_s: f64) -> [Vector3<f64>; 2] {
        let [[roll, pitch, _], [roll_rate, pitch_rate, heading_rate]] = (self.angles)(t_s);
        let c_b_e = self.c_e_b(t_s).transpose();
        let earth = Vector3::new(0.0, 0.0, OMEGA);
        let rate = Vector3::new(
            roll_rate - heading_rate * pitch.sin(),
            pitch_rate * roll.cos() + heading_rate * roll.sin() * pitch.cos(),
            -pitch_rate * roll.sin() + heading_rate * roll.cos() * pitch.cos(),
        );
        let [r, v, a] = self.point_e(t_s);
        [
            rate + c_b_e * earth,
            c_b_e * (a + 2.0 * earth.cross(&v) - gravity_e(&r)),
        ]
    }

    /// Increments over (t − dt, t]: five Gauss-Legendre points in each of four parts.
    fn increment(&self, t_s: f64, dt_s: f64) -> Increment {
        const NODES: [(f64, f64); 5] = [
            (0.0, 0.568_888_888_888_888_9),
            (-0.538_469_310_105_683, 0.478_628_670_499_366_5),
            (0.538_469_310_105_683, 0.478_628_670_499_366_5),
            (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
            (0.906_179_845_938_664, 0.236_926_885_056_189_1),
        ];
        let (mut dtheta_b, mut dv_b) = (Vector3::zeros(), Vector3::zeros());
        let part = dt_s / 4.0;
        for index in 0..4 {
            let middle = t_s - dt_s + (f64::from(index) + 0.5) * part;
            for (node, weight) in NODES {
                let [rate, force] = self.sensed(middle + 0.5 * part * node);
                dtheta_b += rate * (0.5 * part * weight);
                dv_b += force * (0.5 * part * weight);
            }
        }
        Increment {
            dtheta_b,
            dv_b,
            dt_s,
        }
    }

    fn start(&self) -> Mechanisation {
        let [r, v, _] = self.point_e(0.0);
        let mut mechanisation = Mechanisation::EMPTY;
        mechanisation
            .start(&InitialState {
                time: GpsTime::from_ns(0),
                r_eb_e_m: r.into(),
                v_eb_e_mps: v.into(),
                q_e_b: rotation::from_matrix(&self.c_e_b(0.0)).unwrap(),
                gyro_bias_radps: [0.0; 3],
                accel_bias_mps2: [0.0; 3],
                clock_bias_m: 0.0,
                clock_drift_mps: 0.0,
            })
            .unwrap();
        mechanisation
    }

    /// Errors of position (m), velocity (m/s) and attitude (rad).
    fn errors(&self, mechanisation: &Mechanisation, t_s: f64) -> [f64; 3] {
        let [r, v, _] = self.point_e(t_s);
        [
            (mechanisation.r_eb_e - r).norm(),
            (mechanisation.v_eb_e - v).norm(),
            angle_between(
                &mechanisation.q_e_b,
                &rotation::from_matrix(&self.c_e_b(t_s)).unwrap(),
            ),
        ]
    }

    fn run(&self, rate_hz: u32, seconds: u32) -> [f64; 3] {
        let mut mechanisation = self.start();
        let dt_s = 1.0 / f64::from(rate_hz);
        for k in 1..=rate_hz * seconds {
            mechanisation.step(&self.increment(f64::from(k) * dt_s, dt_s));
        }
        let errors = self.errors(&mechanisation, f64::from(seconds));
        println!("{rate_hz} Hz, {seconds} s: m, m/s, rad {errors:?}");
        errors
    }
}

fn angle_between(a: &Quaternion, b: &Quaternion) -> f64 {
    let [aw, ax, ay, az] = *a;
    let [_, x, y, z] = rotation::product(&[aw, -ax, -ay, -az], b);
    2.0 * (x * x + y * y + z * z).sqrt()
}

fn at_rest(_: f64) -> Point {
    [Vector3::zeros(); 3]
}

/// c·sin(w t + p) with its first and second derivative.
fn wave(c: f64, w: f64, p: f64, t: f64) -> [f64; 3] {
    let (s, co) = (w * t + p).sin_cos();
    [c * s, c * w * co, -c * w * w * s]
}

/// A vehicle that flies wide turns and shakes a little.
const FLIGHT: Motion = Motion {
    point_n: |t| {
        let (n, e, d) = (
            wave(800.0, 0.08, 0.0, t),
            wave(800.0, 0.08, PI / 2.0, t),
            wave(40.0, 0.11, 0.3, t),
        );
        let (sn, se, sd) = (
            wave(0.02, 9.0, 0.1, t),
            wave(0.02, 7.0, 1.0, t),
            wave(0.03, 11.0, 2.0, t),
        );
        let at = |i: usize| Vector3::new(n[i] + sn[i], e[i] + se[i], d[i] + sd[i]);
        [at(0), at(1), at(2)]
    },
    angles: |t| {
        let (roll, pitch) = (wave(0.5, 0.9, 0.2, t), wave(0.15, 1.3, 0.0, t));
        let (shake, heading) = (wave(0.005, 8.0, 0.0, t), wave(2.5, 0.16, 0.0, t));
        [
            [roll[0] + shake[0], pitch[0], heading[0]],
            [roll[1] + shake[1], pitch[1], heading[1]],
        ]
    },
};

/// INT-026.
#[test]
fn flight_is_followed_to_millimetres_at_every_rate() {
    for (rate_hz, bounds) in [
        (50, [2e-2, 3e-4, 2e-6]),
        (100, [1e-3, 2e-5, 1e-7]),
        (400, [1e-4, 2e-6, 1e-9]),
    ] {
        let errors = FLIGHT.run(rate_hz, 120);
        assert!(
            errors.iter().zip(bounds).all(|(e, bound)| *e < bound),
            "{rate_hz} Hz"
        );
    }
}

/// INT-026.
#[test]
fn body_at_rest_stays_where_it_is_for_an_hour() {
    let rest = Motion {
        point_n: at_rest,
        angles: |_| [[0.1, -0.2, 1.0], [0.0; 3]],
    };
    let mut mechanisation = rest.start();
    let increment = rest.increment(0.01, 0.01);
    for _ in 0..360_000 {
        mechanisation.step(&increment);
    }
    let errors = rest.errors(&mechanisation, 0.0);
    let length: f64 = mechanisation.q_e_b.iter().map(|x| x * x).sum();
    println!(
        "an hour: m, m/s, rad {errors:?}, length − 1 {:e}",
        length - 1.0
    );
    assert!(errors[0] < 1e-3 && errors[1] < 1e-6 && errors[2] < 1e-10);
    assert!((length - 1.0).abs() < 1e-15);
}

/// Turned through increments alone, without the compensation: what coning does to a naive integration.
fn turned_naively(motion: &Motion, rate_hz: u32, seconds: u32) -> f64 {
    let mut q_e_b = motion.start().q_e_b;
    let dt_s = 1.0 / f64::from(rate_hz);
    for k in 1..=rate_hz * seconds {
        let increment = motion.increment(f64::from(k) * dt_s, dt_s);
        let q_earth = rotation::from_rotation_vector(&Vector3::new(0.0, 0.0, -OMEGA * dt_s));
        let q_b = rotation::product(&q_e_b, &rotation::from_rotation_vector(&increment.dtheta_b));
        q_e_b = rotation::product(&q_earth, &q_b);
    }
    angle_between(
        &q_e_b,
        &rotation::from_matrix(&motion.c_e_b(f64::from(seconds))).unwrap(),
    )
}

/// INT-026.
#[test]
fn coning_is_compensated() {
    // Roll and pitch a quarter apart: the x and y axes describe cones, 1 degree at 5 Hz.
    let coning = Motion {
        point_n: at_rest,
        angles: |t| {
            let (roll, pitch) = (
                wave(0.017, 10.0 * PI, 0.0, t),
                wave(0.017, 10.0 * PI, PI / 2.0, t),
            );
            [[roll[0], pitch[0], 0.0], [roll[1], pitch[1], 0.0]]
        },
    };
    let naive = turned_naively(&coning, 100, 60);
    let [.., angle] = coning.run(100, 60);
    println!("coning: {naive:e} rad without, {angle:e} rad with compensation");
    // Drift per second, a amplitude, ω frequency, x = ωT turned in a sample: a²ω/2·(1 − sin(x)/x)
    // without; of that the compensation leaves x⁴/30.
    let a2w = 0.017 * 0.017 * 10.0 * PI;
    let turn = 0.1 * PI;
    let expected_naive = 60.0 * 0.5 * a2w * (1.0 - turn.sin() / turn);
    let expected = 60.0 * 0.5 * a2w * turn.powi(4) / 30.0;
    assert!((naive / expected_naive - 1.0).abs() < 0.01);
    assert!((angle / expected - 1.0).abs() < 0.1);
    let [.., angle_400] = coning.run(400, 60);
    assert!(angle_400 < naive / 8000.0);
}

/// Shakes to the right in step with the roll angle, 1 m/s² and 0.5 degrees at 5 Hz.
const SCULLING: Motion = Motion {
    point_n: |t| {
        let w = 10.0 * PI;
        wave(-1.0 / (w * w), w, PI / 2.0, t).map(|x| Vector3::new(0.0, x, 0.0))
    },
    angles: |t| {
        let roll = wave(0.009, 10.0 * PI, PI / 2.0, t);
        [[roll[0], 0.0, 0.0], [roll[1], 0.0, 0.0]]
    },
};

/// INT-026.
#[test]
fn sculling_is_compensated() {
    // The mechanisation with the previous sample forgotten: rotation of the sample only.
    let dt_s = 0.01;
    let mut naive = SCULLING.start();
    for k in 1..=6000 {
        let before = naive;
        let mut one = Mechanisation::EMPTY;
        one.start(&InitialState {
            time: GpsTime::from_ns(0),
            r_eb_e_m: before.r_eb_e.into(),
            v_eb_e_mps: before.v_eb_e.into(),
            q_e_b: before.q_e_b,
            gyro_bias_radps: [0.0; 3],
            accel_bias_mps2: [0.0; 3],
            clock_bias_m: 0.0,
            clock_drift_mps: 0.0,
        })
        .unwrap();
        one.step(&SCULLING.increment(f64::from(k) * dt_s, dt_s));
        naive = one;
    }
    let [naive_m, naive_mps, _] = SCULLING.errors(&naive, 60.0);
    let [position_m, velocity_mps, _] = SCULLING.run(100, 60);
    println!(
        "sculling: {naive_m:e} m, {naive_mps:e} m/s without; {position_m:e}, {velocity_mps:e} with"
    );
    assert!(velocity_mps < naive_mps / 50.0 && position_m < naive_m / 50.0);
    assert!(velocity_mps < 1e-3);
}

/// INT-026.
#[test]
fn samples_of_unequal_lengths_are_as_good() {
    let mut mechanisation = FLIGHT.start();
    let mut t_ms = 0;
    for k in 0..6000_i32 {
        let dt_ms = [10, 10, 20, 5, 10, 5][(k % 6) as usize];
        t_ms += dt_ms;
        let dt_s = f64::from(dt_ms) / 1e3;
        mechanisation.step(&FLIGHT.increment(f64::from(t_ms) / 1e3, dt_s));
    }
    let errors = FLIGHT.errors(&mechanisation, f64::from(t_ms) / 1e3);
    println!("unequal, {t_ms} ms: {errors:?}");
    assert!(errors[0] < 1e-2 && errors[1] < 2e-4 && errors[2] < 1e-6);
}

/// Increments over (t − dt, t] of a rate and a specific force that are straight lines in time.
fn straight_lines(t_s: f64, dt_s: f64) -> Increment {
    let middle = t_s - 0.5 * dt_s;
    Increment {
        dtheta_b: (Vector3::new(0.5, -0.4, 0.3) + Vector3::new(20.0, -10.0, 15.0) * middle) * dt_s,
        dv_b: (Vector3::new(5.0, -9.0, 3.0) + Vector3::new(-100.0, 200.0, 150.0) * middle) * dt_s,
        dt_s,
    }
}

/// INT-026.
#[test]
fn one_long_sample_is_as_good_as_many_short_ones() {
    // What lies before is the same; then 20 ms in one sample, or in 256.
    let mut long = FLIGHT.start();
    long.step(&straight_lines(0.0, 0.01));
    let mut short = long;
    long.step(&straight_lines(0.02, 0.02));
    let part = 0.02 / 256.0;
    for k in 1..=256 {
        short.step(&straight_lines(f64::from(k) * part, part));
    }
    let errors = [
        (long.r_eb_e - short.r_eb_e).norm(),
        (long.v_eb_e - short.v_eb_e).norm(),
        angle_between(&long.q_e_b, &short.q_e_b),
    ];
    println!("one sample of 20 ms: {errors:?}");
    // The terms beyond second order in the angle; without scrolling 1e-4 and 1e-6 m.
    assert!(errors[0] < 2e-7 && errors[1] < 4e-6 && errors[2] < 4e-9);
}

/// INT-026.
#[test]
fn a_level_error_swings_with_the_schuler_period() {
    let rest = Motion {
        point_n: at_rest,
        angles: |_| [[0.0; 3]; 2],
    };
    let mut mechanisation = rest.start();
    // One metre per second too fast to the north.
    let c_e_n = rotation::c_e_n(LAT_RAD, LON_RAD);
    let north = c_e_n * Vector3::x();
    mechanisation.v_eb_e = north;
    let dt_s = 0.02;
    let increment = rest.increment(dt_s, dt_s);
    // The Coriolis acceleration turns the plane of the swing (Foucault): its speed is what comes back.
    let (mut least, mut least_at) = (f64::INFINITY, 0.0);
    let mut farthest_m: f64 = 0.0;
    for k in 1..=180_000 {
        mechanisation.step(&increment);
        let t_s = f64::from(k) * dt_s;
        let v_n = c_e_n.transpose() * mechanisation.v_eb_e;
        let r_n = c_e_n.transpose() * (mechanisation.r_eb_e - place());
        let speed = v_n.x.hypot(v_n.y);
        farthest_m = farthest_m.max(r_n.x.hypot(r_n.y));
        if speed < least {
            (least, least_at) = (speed, t_s);
        }
    }
    let period_min = 4.0 * least_at / 60.0;
    println!("period {period_min} min, amplitude {farthest_m} m, least speed {least} m/s");
    assert!((period_min / 84.4 - 1.0).abs() < 0.015);
    assert!((farthest_m / 806.0 - 1.0).abs() < 0.02);
}

#[test]
fn an_error_put_in_is_taken_out() {
    let mut mechanisation = FLIGHT.start();
    let truth = mechanisation;
    let (dr, dv) = (Vector3::new(3.0, -4.0, 5.0), Vector3::new(0.3, 0.2, -0.1));
    let psi = Vector3::new(2e-4, -3e-4, 1e-4);
    let bias = Vector3::new(1e-5, 2e-5, -3e-5);
    mechanisation.r_eb_e += dr;
    mechanisation.v_eb_e += dv;
    // Ĉ = (I + [ψ×]) C.
    let c_hat = (Matrix3::identity() + psi.cross_matrix()) * rotation::to_matrix(&truth.q_e_b);
    mechanisation.q_e_b = rotation::from_matrix(&c_hat).unwrap();
    mechanisation.gyro_bias -= bias;
    mechanisation.accel_bias -= 2.0 * bias;
    mechanisation.correct(&dr, &dv, &psi, &bias, &(2.0 * bias));
    assert!((mechanisation.r_eb_e - truth.r_eb_e).norm() < 3e-9);
    assert!((mechanisation.v_eb_e - truth.v_eb_e).norm() < 1e-15);
    assert!(angle_between(&mechanisation.q_e_b, &truth.q_e_b) < psi.norm_squared());
    assert!(mechanisation.gyro_bias.norm() < 1e-20 && mechanisation.accel_bias.norm() < 1e-20);
}

#[test]
fn biases_are_taken_out_of_the_increments() {
    let (gyro, accel) = (
        Vector3::new(1e-3, -2e-3, 5e-4),
        Vector3::new(0.05, 0.02, -0.1),
    );
    let mut clean = FLIGHT.start();
    let mut biased = clean;
    biased.gyro_bias = gyro;
    biased.accel_bias = accel;
    for k in 1..=1000 {
        let increment = FLIGHT.increment(f64::from(k) * 0.01, 0.01);
        clean.step(&increment);
        biased.step(&Increment {
            dtheta_b: increment.dtheta_b + gyro * 0.01,
            dv_b: increment.dv_b + accel * 0.01,
            dt_s: 0.01,
        });
    }
    assert!((clean.r_eb_e - biased.r_eb_e).norm() < 1e-7);
    assert!(angle_between(&clean.q_e_b, &biased.q_e_b) < 1e-12);
}

fn rows(path: &Path) -> Vec<Vec<f64>> {
    fs::read_to_string(path)
        .unwrap()
        .lines()
        .skip(1)
        .map(|line| {
            line.split(',')
                .map(|x| x.parse().unwrap_or(f64::NAN))
                .collect()
        })
        .collect()
}

fn vector(row: &[f64], at: usize) -> Vector3<f64> {
    Vector3::new(row[at], row[at + 1], row[at + 2])
}

/// The motion and the increments of a scenario folder.
struct Recorded {
    truth: Vec<Vec<f64>>,
    imu: Vec<Vec<f64>>,
}

impl Recorded {
    fn scenario(name: &str) -> Option<Self> {
        let folder = common::shared(&format!("scenarios/{name}"))?;
        Some(Self {
            truth: rows(&folder.join("truth.csv")),
            imu: rows(&folder.join("imu.csv")),
        })
    }
}

/// Free inertial along a scenario from its true state at `from_s`; errors (m, m/s, rad) at each second.
fn coast(folder: &Recorded, from_s: usize, seconds: usize) -> Vec<[f64; 3]> {
    let Recorded { truth, imu } = folder;
    let row = &truth[from_s];
    let mut mechanisation = Mechanisation::EMPTY;
    mechanisation
        .start(&InitialState {
            time: GpsTime::from_ns(0),
            r_eb_e_m: vector(row, 1).into(),
            v_eb_e_mps: vector(row, 4).into(),
            q_e_b: [row[7], row[8], row[9], row[10]],
            gyro_bias_radps: vector(row, 13).into(),
            accel_bias_mps2: vector(row, 16).into(),
            clock_bias_m: 0.0,
            clock_drift_mps: 0.0,
        })
        .unwrap();
    let mut errors = Vec::new();
    for k in from_s * 100..(from_s + seconds) * 100 {
        mechanisation.step(&Increment {
            dtheta_b: vector(&imu[k], 1),
            dv_b: vector(&imu[k], 4),
            dt_s: 0.01,
        });
        if (k + 1) % 100 == 0 {
            let row = &truth[(k + 1) / 100];
            errors.push([
                (mechanisation.r_eb_e - vector(row, 1)).norm(),
                (mechanisation.v_eb_e - vector(row, 4)).norm(),
                angle_between(&mechanisation.q_e_b, &[row[7], row[8], row[9], row[10]]),
            ]);
        }
    }
    errors
}

/// INT-026.
#[test]
fn perfect_reference_is_followed_to_micrometres() {
    let Some(folder) = Recorded::scenario("static_perfect") else {
        return;
    };
    let errors = coast(&folder, 0, 100);
    println!("{:?}", errors.last());
    assert!(
        errors
            .iter()
            .all(|[m, mps, rad]| *m < 1e-6 && *mps < 1e-8 && *rad < 1e-10)
    );
}

/// INT-026.
#[test]
fn noisy_references_are_followed_within_the_noise_of_their_sensors() {
    // Free inertial for 10 s from the truth; one sigma per axis from the white noise: position
    // vrw √(t³/3) and what the attitude turns of gravity, velocity vrw √t, attitude arw √t. Biases
    // drift by less in so short a time.
    for (name, arw, vrw) in [
        ("flight004_nav", 5.8e-7, 9.8e-5),
        ("npa_tac_ramp", 2.9e-5, 4.9e-4),
        ("seed000_ramp_tac", 2.9e-5, 4.9e-4),
        ("flight004_mems_step", 8.7e-5, 2.0e-3),
    ] {
        let Some(folder) = Recorded::scenario(name) else {
            return;
        };
        let seconds = folder.truth.len() - 1;
        let (mut sums, mut windows) = ([0.0; 3], 0.0);
        let t: f64 = 10.0;
        let sigmas = [
            (vrw * (t.powi(3) / 3.0).sqrt()).hypot(9.8 * arw * (t.powi(5) / 20.0).sqrt()),
            (vrw * t.sqrt()).hypot(9.8 * arw * (t.powi(3) / 3.0).sqrt()),
            arw * t.sqrt(),
        ];
        for from_s in (0..seconds - 10).step_by(10) {
            let errors = coast(&folder, from_s, 10)[9];
            windows += 1.0;
            for ((sum, error), sigma) in sums.iter_mut().zip(errors).zip(sigmas) {
                *sum += (error / sigma).powi(2) / 3.0;
            }
        }
        let ratios = sums.map(|sum| sum / windows);
        println!("{name}: {windows} windows, ratios of variance {ratios:.3?}");
        // 1 when the errors are those of the sensors; less, since the vertical feels no tilt. 35 windows
        // of three axes leave them uncertain by 0.14.
        assert!(
            ratios.iter().all(|ratio| (0.5..1.5).contains(ratio)),
            "{name}"
        );
    }
}
