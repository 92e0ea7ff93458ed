//! Errors of a simulated flight have the sizes its scenario folder promises.
//!
//! Sums of squares of normalised errors are compared with chi-square quantiles; every comparison fails
//! by chance with a probability of 1e-6, the seeds are fixed. The errors are taken from what a reader
//! of the folder sees: measurement minus what the truth gives.

use nalgebra::Vector3;
use surefix_core::stats::normal;
use surefix_host_tests::simulate::flight::Flight;
use surefix_host_tests::simulate::inertial::clock::CLOCK_NOISE;
use surefix_host_tests::simulate::inertial::sensors::Grade;
use surefix_host_tests::simulate::inertial::trajectory::quaternion;
use surefix_host_tests::simulate::inertial::{Request, Scenario, fly};

const GRADES: [Grade; 3] = [Grade::Navigation, Grade::Tactical, Grade::Mems];
/// Chance that a correct simulator fails one comparison.
const RISK: f64 = 1e-6;

/// Normalised errors, squared and summed.
#[derive(Default)]
struct Squares {
    sum: f64,
    count: u32,
}

impl Squares {
    fn add(&mut self, error: f64, sigma: f64) {
        self.sum += (error / sigma) * (error / sigma);
        self.count += 1;
    }

    fn add3(&mut self, errors: Vector3<f64>, sigma: f64) {
        errors.iter().for_each(|error| self.add(*error, sigma));
    }

    /// Holds the sum against both tails of its distribution.
    fn check(&self, what: &str) {
        // Wilson and Hilferty: with hundreds of degrees of freedom good to a thousandth of the width.
        let n = f64::from(self.count);
        let z = normal::upper_quantile(RISK / 2.0).unwrap();
        let quantile = |z: f64| n * (1.0 - 2.0 / (9.0 * n) + z * (2.0 / (9.0 * n)).sqrt()).powi(3);
        let (low, high) = (quantile(-z), quantile(z));
        println!(
            "{what}: {} errors, mean square {:.4}, allowed {:.4} to {:.4}",
            self.count,
            self.sum / n,
            low / n,
            high / n
        );
        assert!(self.sum > low && self.sum < high, "{what}");
    }
}

fn flown(flight: Flight, grade: Grade, seed: u64, duration_s: u32) -> Scenario {
    fly(&Request {
        grade: Some(grade),
        duration_s: Some(duration_s),
        ..Request::new(flight, seed)
    })
    .unwrap()
}

/// What the errors of a unit did to each sample.
fn sample_errors(flown: &Scenario) -> Vec<(Vector3<f64>, Vector3<f64>)> {
    let samples = flown.imu.iter().enumerate();
    samples
        .map(|(k, sample)| {
            let (dtheta, dv) = flown.trajectory.increments(k + 1);
            (
                Vector3::from(sample.dtheta_is_s_rad) - dtheta,
                Vector3::from(sample.dv_is_s_mps) - dv,
            )
        })
        .collect()
}

/// Differences of pairs of samples: twice the variance of the noise, the bias drops out. Its walk over
/// 10 ms adds 1e-9 of it at the most.
#[test]
fn noise_of_increments_has_its_density() {
    for grade in GRADES {
        let flown = flown(Flight::EnrouteTurn, grade, 11, 300);
        let density = grade.noise().density;
        let (mut gyro, mut accel) = (Squares::default(), Squares::default());
        let sigma = (2.0 * 0.01_f64).sqrt();
        for pair in sample_errors(&flown).chunks_exact(2) {
            gyro.add3(pair[1].0 - pair[0].0, density.arw * sigma);
            accel.add3(pair[1].1 - pair[0].1, density.vrw * sigma);
        }
        gyro.check(&format!("{} angle random walk", grade.name()));
        accel.check(&format!("{} velocity random walk", grade.name()));
    }
}

/// Steps of the true biases, second by second, and that the samples carry just these biases.
#[test]
fn biases_walk_by_their_density_and_are_in_the_samples() {
    for grade in GRADES {
        let flown = flown(Flight::EnrouteTurn, grade, 12, 400);
        let density = grade.noise().density;
        let (mut gyro_walk, mut accel_walk) = (Squares::default(), Squares::default());
        let (mut gyro_mean, mut accel_mean) = (Squares::default(), Squares::default());
        let errors = sample_errors(&flown);
        for (seconds, samples) in flown.truth.windows(2).zip(errors.chunks_exact(100)) {
            let gyro = seconds[1].gyro_bias_radps - seconds[0].gyro_bias_radps;
            let accel = seconds[1].accel_bias_mps2 - seconds[0].accel_bias_mps2;
            gyro_walk.add3(gyro, density.gyro_bias_walk);
            accel_walk.add3(accel, density.accel_bias_walk);
            // A second's error is the bias and the noise of 1 s. The mean of a walk between known ends
            // is off the middle by its density over √12.
            let (dtheta, dv) = samples
                .iter()
                .fold((Vector3::zeros(), Vector3::zeros()), |sum, e| {
                    (sum.0 + e.0, sum.1 + e.1)
                });
            let middle = seconds[0].gyro_bias_radps + gyro * 0.5;
            let spread = density.arw.hypot(density.gyro_bias_walk / 12.0_f64.sqrt());
            gyro_mean.add3(dtheta - middle, spread);
            let middle = seconds[0].accel_bias_mps2 + accel * 0.5;
            let spread = density.vrw.hypot(density.accel_bias_walk / 12.0_f64.sqrt());
            accel_mean.add3(dv - middle, spread);
        }
        let name = grade.name();
        gyro_walk.check(&format!("{name} walk of the gyroscope bias"));
        accel_walk.check(&format!("{name} walk of the accelerometer bias"));
        gyro_mean.check(&format!("{name} gyroscope bias in the samples"));
        accel_mean.check(&format!("{name} accelerometer bias in the samples"));
    }
}

/// Over seeds: what a filter starts from is off by the sigmas of init.csv, and so are the true biases.
#[test]
fn a_filters_start_is_off_by_its_sigmas() {
    let mut position = Squares::default();
    let mut velocity = Squares::default();
    let mut attitude = [(); 3].map(|()| Squares::default());
    let mut biases = Squares::default();
    let mut clock = Squares::default();
    for seed in 0..200 {
        let flown = flown(Flight::Static, Grade::Tactical, seed, 1);
        let (initial, sigma, truth) = (&flown.initial, &flown.sigma, &flown.truth[0]);
        let state = &truth.state;
        position.add3(
            Vector3::from(initial.r_eb_e_m) - state.r_eb_e,
            sigma.position_m,
        );
        velocity.add3(
            Vector3::from(initial.v_eb_e_mps) - state.v_eb_e,
            sigma.velocity_mps,
        );
        // Ĉ = (I + [ψ×]) C, ψ from the vector parts of the quaternions' quotient.
        let ([a, b, c, d], [w, x, y, z]) = (initial.q_e_b, quaternion(&state.c_e_b));
        let (left, right) = (Vector3::new(b, c, d), Vector3::new(x, y, z));
        let vector = left * w - right * a - left.cross(&right);
        let psi_n = state.c_e_n.transpose() * vector * (2.0 * (a * w + left.dot(&right)).signum());
        for (k, axis) in attitude.iter_mut().enumerate() {
            axis.add(psi_n[k], sigma.attitude_ned_rad[k]);
        }
        biases.add3(truth.gyro_bias_radps, sigma.gyro_bias_radps);
        biases.add3(truth.accel_bias_mps2, sigma.accel_bias_mps2);
        clock.add(initial.clock_bias_m - truth.clock.0, sigma.clock_bias_m);
        clock.add(
            initial.clock_drift_mps - truth.clock.1,
            sigma.clock_drift_mps,
        );
    }
    position.check("initial position");
    velocity.check("initial velocity");
    for (axis, name) in attitude.iter().zip(["north", "east", "down"]) {
        axis.check(&format!("initial attitude about {name}"));
    }
    biases.check("initial biases");
    clock.check("initial clock");
}

/// Step by step: what the drift gains, and what the bias gains beside the mean drift.
#[test]
fn the_clock_walks_by_its_spectral_densities() {
    let (mut drift, mut bias) = (Squares::default(), Squares::default());
    for seed in 0..4 {
        let flown = flown(Flight::Static, Grade::Navigation, 100 + seed, 600);
        for pair in flown.truth.windows(2) {
            let ((b0, d0), (b1, d1)) = (pair[0].clock, pair[1].clock);
            drift.add(d1 - d0, CLOCK_NOISE.drift_psd.sqrt());
            // Given both drifts, the bias is off their mean by S_b + S_d/12.
            let left = b1 - b0 - 0.5 * (d0 + d1);
            bias.add(
                left,
                (CLOCK_NOISE.bias_psd + CLOCK_NOISE.drift_psd / 12.0).sqrt(),
            );
        }
    }
    drift.check("clock drift");
    bias.check("clock bias");
}

/// Measurements minus truth over their sigmas: the right size and white in time.
#[test]
fn measurements_are_off_by_their_sigmas_and_white() {
    let flown = flown(Flight::P4Flight, Grade::Mems, 21, 750);
    let (mut range, mut rate) = (Squares::default(), Squares::default());
    let (mut range_lag, mut rate_lag, mut pairs) = (0.0, 0.0, 0.0);
    let mut last: Vec<(surefix_core::gnss::Satellite, f64, f64)> = Vec::new();
    for (epoch, truth) in flown.epochs.iter().zip(&flown.truth).skip(1) {
        assert_eq!(epoch.t_s, truth.t_s);
        let mut now = Vec::new();
        for row in &epoch.rows {
            let m = &row.measurement;
            let line = Vector3::from(m.r_es_e_m) - truth.state.r_eb_e;
            let approach = Vector3::from(m.v_es_e_mps) - truth.state.v_eb_e;
            let (rate_mps, sigma_mps) = m.range_rate_mps.unwrap();
            let range_error = m.pseudorange_m - line.norm() - truth.clock.0;
            let rate_error = rate_mps - line.normalize().dot(&approach) - truth.clock.1;
            range.add(range_error, m.sigma_pseudorange_m);
            rate.add(rate_error, sigma_mps);
            let normalised = (range_error / m.sigma_pseudorange_m, rate_error / sigma_mps);
            if let Some(before) = last.iter().find(|l| l.0 == m.satellite) {
                range_lag += before.1 * normalised.0;
                rate_lag += before.2 * normalised.1;
                pairs += 1.0;
            }
            now.push((m.satellite, normalised.0, normalised.1));
        }
        last = now;
    }
    range.check("pseudoranges");
    rate.check("range rates");
    // A mean of products of independent normal numbers has one sigma 1/√n; 4.9 sigmas are 1e-6.
    for (what, sum) in [("pseudoranges", range_lag), ("range rates", rate_lag)] {
        let correlation: f64 = sum / pairs;
        println!("{what}: correlation over 1 s {correlation:.4}, {pairs} pairs");
        assert!(correlation.abs() < 4.9 / f64::sqrt(pairs), "{what}");
    }
}
