//! Increments of a perfect unit lead back to the simulated track.
//!
//! Two integrators that share no code with the simulator: a slow one that fits the rates of four
//! samples by cubics and integrates the differential equations of strapdown navigation in ECEF, and
//! the core's mechanisation.

use clap::ValueEnum;
use nalgebra::{Matrix3, Vector3};
use surefix_core::frames::rotation;
use surefix_core::ins::{ImuSample, Increment, InitialState, Mechanisation};
use surefix_host_tests::simulate::flight::Flight;
use surefix_host_tests::simulate::inertial::trajectory::quaternion;
use surefix_host_tests::simulate::inertial::{Request, Scenario, TruthRow, fly};

/// Every flight with an inertial unit whose motion is its own.
fn flights() -> impl Iterator<Item = Flight> {
    Flight::value_variants().iter().copied().filter(|flight| {
        let same_motion = [
            Flight::Approach,
            Flight::StaticPerfect,
            Flight::NpaRamp,
            Flight::NpaStep,
            Flight::Lpv200Ramp,
            Flight::Lpv200Step,
        ];
        !same_motion.contains(flight)
    })
}

fn perfect(flight: Flight, imu_rate_hz: u32) -> Scenario {
    fly(&Request {
        noise_free: true,
        imu_rate_hz,
        ..Request::new(flight, 1)
    })
    .unwrap()
}

/// Errors of position, m, velocity, m/s, and attitude, rad.
fn errors(truth: &TruthRow, r: &Vector3<f64>, v: &Vector3<f64>, c: &Matrix3<f64>) -> [f64; 3] {
    let state = &truth.state;
    let turn = c * state.c_e_b.transpose();
    let angle = Vector3::new(
        turn[(2, 1)] - turn[(1, 2)],
        turn[(0, 2)] - turn[(2, 0)],
        turn[(1, 0)] - turn[(0, 1)],
    ) * 0.5;
    [
        (r - state.r_eb_e).norm(),
        (v - state.v_eb_e).norm(),
        angle.norm(),
    ]
}

fn largest(worst: [f64; 3], new: [f64; 3]) -> [f64; 3] {
    core::array::from_fn(|k| worst[k].max(new[k]))
}

const OMEGA: f64 = 7.292_115e-5;

/// J2 gravity and centrifugal acceleration, ECEF, m/s².
fn gravity(r: &Vector3<f64>) -> Vector3<f64> {
    let (mu, j2, a) = (3.986_004_418e14, 1.082_627e-3, 6_378_137.0_f64);
    let d = r.norm();
    let k = 1.5 * j2 * (a / d).powi(2);
    let s = 5.0 * (r.z / d).powi(2);
    let shape = Vector3::new(
        1.0 + k * (1.0 - s),
        1.0 + k * (1.0 - s),
        1.0 + k * (3.0 - s),
    );
    let turning = Vector3::new(r.x, r.y, 0.0) * (OMEGA * OMEGA);
    -r.component_mul(&shape) * (mu / d.powi(3)) + turning
}

/// Coefficients of the cubic whose integrals over four successive intervals of length 1, the second
/// beginning at 0, are given.
fn cubic(integrals: [Vector3<f64>; 4]) -> [Vector3<f64>; 4] {
    let row = |from: f64| {
        let to = from + 1.0;
        [1, 2, 3, 4].map(|n| (to.powi(n) - from.powi(n)) / f64::from(n))
    };
    let m = nalgebra::Matrix4::from_fn(|i, j| row(i as f64 - 1.0)[j]);
    let inverse = m.try_inverse().expect("the powers are independent");
    core::array::from_fn(|i| {
        (0..4)
            .map(|j| integrals[j] * inverse[(i, j)])
            .sum::<Vector3<f64>>()
    })
}

/// Rates of attitude, velocity and position in ECEF.
type State = (Matrix3<f64>, Vector3<f64>, Vector3<f64>);

fn rates((c, v, r): &State, omega_ib_b: Vector3<f64>, f_ib_b: Vector3<f64>) -> State {
    let earth = Vector3::new(0.0, 0.0, OMEGA);
    let turning = c * omega_ib_b.cross_matrix() - earth.cross_matrix() * c;
    (turning, c * f_ib_b + gravity(r) - earth.cross(v) * 2.0, *v)
}

fn moved(state: &State, rate: &State, dt: f64) -> State {
    (
        state.0 + rate.0 * dt,
        state.1 + rate.1 * dt,
        state.2 + rate.2 * dt,
    )
}

/// Integrates all samples; calls back after each.
fn integrate(start: State, samples: &[ImuSample], dt: f64, mut each: impl FnMut(usize, &State)) {
    let mut state = start;
    let at = |k: usize| &samples[k.min(samples.len() - 1)];
    for k in 0..samples.len() {
        // At the ends the four samples lie to one side.
        let first = k.saturating_sub(1).min(samples.len().saturating_sub(4));
        let shift = k as f64 - first as f64 - 1.0;
        let window = [0, 1, 2, 3].map(|j| at(first + j));
        let rate = cubic(window.map(|s| Vector3::from(s.dtheta_is_s_rad) / dt));
        let force = cubic(window.map(|s| Vector3::from(s.dv_is_s_mps) / dt));
        let value = |poly: &[Vector3<f64>; 4], u: f64| {
            let u = u + shift;
            poly[0] + (poly[1] + (poly[2] + poly[3] * u) * u) * u
        };
        let steps = 2;
        for step in 0..steps {
            let (u, du) = (f64::from(step) / f64::from(steps), 1.0 / f64::from(steps));
            let h = dt * du;
            let slope = |s: &State, u: f64| rates(s, value(&rate, u), value(&force, u));
            let k1 = slope(&state, u);
            let k2 = slope(&moved(&state, &k1, h / 2.0), u + du / 2.0);
            let k3 = slope(&moved(&state, &k2, h / 2.0), u + du / 2.0);
            let k4 = slope(&moved(&state, &k3, h), u + du);
            for (k, weight) in [(k1, 1.0), (k2, 2.0), (k3, 2.0), (k4, 1.0)] {
                state = moved(&state, &k, h * weight / 6.0);
            }
        }
        // One Newton step towards the nearest rotation.
        state.0 = (state.0 * 3.0 - state.0 * state.0.transpose() * state.0) * 0.5;
        each(k, &state);
    }
}

/// The slow integrator along a perfect flight: its largest errors.
fn integrated(scenario: &Scenario) -> [f64; 3] {
    let start = &scenario.truth[0].state;
    let rate = scenario.request.imu_rate_hz as usize;
    let mut worst = [0.0; 3];
    integrate(
        (start.c_e_b, start.v_eb_e, start.r_eb_e),
        &scenario.imu,
        1.0 / rate as f64,
        |k, (c, v, r)| {
            if (k + 1).is_multiple_of(rate) {
                worst = largest(worst, errors(&scenario.truth[(k + 1) / rate], r, v, c));
            }
        },
    );
    worst
}

/// The core's mechanisation along a perfect flight: its largest errors.
fn mechanised(scenario: &Scenario) -> [f64; 3] {
    let start = &scenario.truth[0].state;
    let mut core = Mechanisation::EMPTY;
    core.start(&InitialState {
        r_eb_e_m: start.r_eb_e.into(),
        v_eb_e_mps: start.v_eb_e.into(),
        q_e_b: quaternion(&start.c_e_b),
        ..scenario.initial
    })
    .unwrap();
    let rate = scenario.request.imu_rate_hz as usize;
    let mut worst = [0.0; 3];
    for (k, sample) in scenario.imu.iter().enumerate() {
        core.step(&Increment {
            dtheta_b: sample.dtheta_is_s_rad.into(),
            dv_b: sample.dv_is_s_mps.into(),
            dt_s: 1.0 / rate as f64,
        });
        if (k + 1) % rate == 0 {
            let c = rotation::to_matrix(&core.q_e_b);
            let truth = &scenario.truth[(k + 1) / rate];
            worst = largest(worst, errors(truth, &core.r_eb_e, &core.v_eb_e, &c));
        }
    }
    worst
}

fn line(what: &str, scenario: &Scenario, [r_m, v_mps, psi_rad]: [f64; 3]) {
    println!(
        "{} at {} Hz, {what}: {r_m:.1e} m, {v_mps:.1e} m/s, {psi_rad:.1e} rad",
        scenario.request.flight.name(),
        scenario.request.imu_rate_hz
    );
}

/// What is left belongs to the integrators: cubics between samples, and the mechanisation's straight
/// lines. Both are far below a centimetre but for the fast cone.
#[test]
fn increments_of_a_perfect_unit_lead_along_the_track() {
    for flight in flights() {
        let scenario = perfect(flight, 100);
        let slow = integrated(&scenario);
        line("differential equations", &scenario, slow);
        let core = mechanised(&scenario);
        line("mechanisation", &scenario, core);
        let (slow_m, core_m) = match flight {
            Flight::Coning => (1e-3, 0.1),
            _ => (1e-4, 5e-3),
        };
        assert!(slow[0] < slow_m, "{}: {slow:?}", flight.name());
        assert!(core[0] < core_m, "{}: {core:?}", flight.name());
    }
}

/// More samples bring the fast ones down too, so that nothing of it is the simulator's.
#[test]
fn four_times_the_samples_leave_less_than_a_millimetre() {
    for flight in [Flight::Coning, Flight::UavSurvey] {
        let scenario = perfect(flight, 400);
        let slow = integrated(&scenario);
        line("differential equations", &scenario, slow);
        let core = mechanised(&scenario);
        line("mechanisation", &scenario, core);
        assert!(slow[0] < 1e-4, "{}: {slow:?}", flight.name());
        assert!(core[0] < 1e-3, "{}: {core:?}", flight.name());
    }
}
