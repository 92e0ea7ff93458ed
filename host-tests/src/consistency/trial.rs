//! One trial: a flight, imperfect sensors, the navigator, and its errors against its covariance.

use nalgebra::{Matrix3, Quaternion, SMatrix, UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use surefix_core::ekf::layout::BLOCKS;
use surefix_core::ekf::{Filter, Navigator, Unhealthy};
use surefix_core::gnss::{CorrectedMeasurement, Satellite, System};
use surefix_core::ins::mechanisation::{Increment, StartError};
use surefix_core::ins::{
    AttitudeStart, ClockNoise, InertialConfig, InertialNoise, InitialSigma, InitialState,
    MeasurementFactors, SensorRange,
};
use surefix_core::time::GpsTime;

use super::flight::{Flight, Motion, rotation_vector};
use super::sky::Sky;
use crate::reference::earth::c_e_ned;
use crate::reference::strapdown::{Nominal, rotation};
use crate::reference::{Covariance, ErrorState, filter::at};
use crate::simulate::noise::normal;

/// The navigator of the trials: one constellation.
pub type Navigator2 = Navigator<2, 8>;

/// A class of inertial units: noise, and how uncertain its start is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grade {
    /// Name.
    pub name: &'static str,
    /// Noise.
    pub noise: InertialNoise,
    /// One sigma of the gyroscope bias, rad/s.
    pub sigma_gyro_bias: f64,
    /// One sigma of the accelerometer bias, m/s².
    pub sigma_accel_bias: f64,
}

const DEGREE: f64 = std::f64::consts::PI / 180.0;
const DEGREE_PER_HOUR: f64 = DEGREE / 3600.0;
const G: f64 = 9.80665;

impl Grade {
    /// 0.01°/h, 50 µg.
    pub const NAVIGATION: Self = Self {
        name: "navigation",
        noise: InertialNoise {
            arw: 0.002 * DEGREE / 60.0,
            vrw: 1e-5 * G,
            gyro_bias_walk: 8e-11,
            accel_bias_walk: 5e-8 * G,
        },
        sigma_gyro_bias: 0.01 * DEGREE_PER_HOUR,
        sigma_accel_bias: 5e-5 * G,
    };
    /// 1°/h, 1 mg.
    pub const TACTICAL: Self = Self {
        name: "tactical",
        noise: InertialNoise {
            arw: 0.1 * DEGREE / 60.0,
            vrw: 5e-5 * G,
            gyro_bias_walk: 8.4e-8,
            accel_bias_walk: 2.9e-6 * G,
        },
        sigma_gyro_bias: DEGREE_PER_HOUR,
        sigma_accel_bias: 1e-3 * G,
    };
    /// 50°/h, 5 mg.
    pub const MEMS: Self = Self {
        name: "mems",
        noise: InertialNoise {
            arw: 0.3 * DEGREE / 60.0,
            vrw: 2e-4 * G,
            gyro_bias_walk: 2.8e-6,
            accel_bias_walk: 1.7e-5 * G,
        },
        sigma_gyro_bias: 50.0 * DEGREE_PER_HOUR,
        sigma_accel_bias: 5e-3 * G,
    };
    /// All three.
    pub const ALL: [Self; 3] = [Self::NAVIGATION, Self::TACTICAL, Self::MEMS];

    /// A start from a fix, with the attitude a unit of this grade can be aligned to.
    pub fn start(&self) -> Start {
        let attitude_deg = if *self == Self::NAVIGATION {
            [0.02, 0.1]
        } else if *self == Self::TACTICAL {
            [0.1, 0.5]
        } else {
            [0.5, 2.0]
        };
        Start {
            position_m: 10.0,
            velocity_mps: 0.5,
            attitude_rad: attitude_deg.map(|degrees| degrees * DEGREE),
        }
    }
}

/// How uncertain a start is, one sigma.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Position, per axis, m.
    pub position_m: f64,
    /// Velocity, per axis, m/s.
    pub velocity_mps: f64,
    /// Tilts and heading, rad.
    pub attitude_rad: [f64; 2],
}

/// What a trial is made of.
#[derive(Clone, Copy, Debug)]
pub struct Setup {
    /// The unit.
    pub grade: Grade,
    /// The start.
    pub start: Start,
    /// The flight.
    pub motion: Motion,
    /// Samples per second.
    pub rate_hz: u32,
}

/// Noise of the receiver clock: a temperature-compensated crystal.
pub const CLOCK: ClockNoise = ClockNoise {
    bias_psd: 0.009,
    drift_psd: 0.0355,
    drift_decay_per_s: 0.0,
    inter_system_psd: 0.0,
};
const SIGMA_CLOCK: [f64; 2] = [30.0, 1.0];
/// Start of the trials' time.
const START: GpsTime = GpsTime::from_week_tow_s(2400, 0);

/// What an epoch gave.
#[derive(Clone, Copy, Debug)]
pub struct Assessment {
    /// Normalised innovation squared, and its degrees of freedom.
    pub nis: (f64, u32),
    /// Error of the state, in the order and with the signs of the reference model.
    pub error: ErrorState,
    /// What the filter believes of it.
    pub covariance: Covariance,
}

impl Assessment {
    /// Normalised error squared of states `start..start + N`; `None` where their covariance is not
    /// positive definite.
    pub fn nees<const N: usize>(&self, start: usize) -> Option<f64> {
        let error = self.error.fixed_rows::<N>(start).into_owned();
        let p: SMatrix<f64, N, N> = self
            .covariance
            .fixed_view::<N, N>(start, start)
            .into_owned();
        let scale = p.diagonal().map(|variance| 1.0 / variance.sqrt());
        let d = SMatrix::<f64, N, N>::from_diagonal(&scale);
        let scaled = error.component_mul(&scale);
        (d * p * d)
            .cholesky()
            .map(|c| scaled.dot(&c.solve(&scaled)))
    }
}

/// A trial in progress.
pub struct Trial {
    random: ChaCha8Rng,
    setup: Setup,
    flight: Flight,
    navigator: Box<Navigator2>,
    gyro_bias: Vector3<f64>,
    accel_bias: Vector3<f64>,
    clock: [f64; 2],
    samples: i64,
    epoch_s: f64,
}

fn three(random: &mut ChaCha8Rng, sigma: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| sigma * normal(random))
}

/// The covariance of a filter, dense.
pub fn covariance(filter: &Filter<2, 8>) -> Covariance {
    let mut p = Covariance::zeros();
    for a in 0..BLOCKS {
        for b in 0..BLOCKS {
            let block = Matrix3::from_row_slice(&filter.cross_block(a, b));
            p.fixed_view_mut::<3, 3>(3 * a, 3 * b).copy_from(&block);
        }
        for k in 0..2 {
            for (i, entry) in filter.clock_cross(a, k).into_iter().enumerate() {
                p[(3 * a + i, at::CLK_B + k)] = entry;
                p[(at::CLK_B + k, 3 * a + i)] = entry;
            }
        }
    }
    for (k, row) in filter.clock_covariance().iter().enumerate() {
        for (l, entry) in row.iter().enumerate() {
            p[(at::CLK_B + k, at::CLK_B + l)] = *entry;
        }
    }
    p
}

impl Trial {
    /// Draws everything a start is uncertain of.
    ///
    /// # Errors
    /// When the navigator does not take the start.
    pub fn new(setup: Setup, seed: u64) -> Result<Self, StartError> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let flight = Flight::new(setup.motion);
        let grade = setup.grade;
        let Start {
            position_m,
            velocity_mps,
            attitude_rad: [tilt, heading],
        } = setup.start;
        let truth = *flight.truth();
        let psi_ned = Vector3::new(
            tilt * normal(&mut random),
            tilt * normal(&mut random),
            heading * normal(&mut random),
        );
        let c = rotation(c_e_ned(&truth.r) * psi_ned) * truth.c;
        let q = UnitQuaternion::from_matrix(&c);
        let clock = [1000.0, 3.0];
        let state = InitialState {
            time: START,
            r_eb_e_m: (truth.r + three(&mut random, position_m)).into(),
            v_eb_e_mps: (truth.v + three(&mut random, velocity_mps)).into(),
            q_e_b: [q.w, q.i, q.j, q.k],
            gyro_bias_radps: [0.0; 3],
            accel_bias_mps2: [0.0; 3],
            clock_bias_m: clock[0] + SIGMA_CLOCK[0] * normal(&mut random),
            clock_drift_mps: clock[1] + SIGMA_CLOCK[1] * normal(&mut random),
        };
        let config = InertialConfig {
            interval_ns: 1_000_000_000 / setup.rate_hz,
            c_b_s: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            lever_arm_b_m: [0.0; 3],
            noise: grade.noise,
            clock: CLOCK,
            measurement: MeasurementFactors::ONE,
            range: SensorRange {
                rate_radps: 1e3,
                specific_force_mps2: 1e3,
            },
            start: AttitudeStart::Given {
                roll_pitch_heading_rad: [0.0; 3],
            },
            sigma: InitialSigma {
                position_m,
                velocity_mps,
                attitude_ned_rad: [tilt, tilt, heading],
                gyro_bias_radps: grade.sigma_gyro_bias,
                accel_bias_mps2: grade.sigma_accel_bias,
                clock_bias_m: SIGMA_CLOCK[0],
                clock_drift_mps: SIGMA_CLOCK[1],
            },
        };
        let mut navigator = Box::new(Navigator2::EMPTY);
        navigator.start(&config, &state)?;
        Ok(Self {
            gyro_bias: three(&mut random, grade.sigma_gyro_bias),
            accel_bias: three(&mut random, grade.sigma_accel_bias),
            random,
            setup,
            flight,
            navigator,
            clock,
            samples: 0,
            epoch_s: 0.0,
        })
    }

    /// The navigator.
    pub fn navigator(&self) -> &Navigator2 {
        &self.navigator
    }

    /// Where it truly is; biases and clock are not in it.
    pub fn truth(&self) -> &Nominal {
        self.flight.truth()
    }

    fn now(&self) -> GpsTime {
        START.plus_ns(self.samples * i64::from(1_000_000_000 / self.setup.rate_hz))
    }

    /// Flies to the next epoch, a second later.
    fn fly(&mut self) {
        let dt = 1.0 / f64::from(self.setup.rate_hz);
        let noise = self.setup.grade.noise;
        for _ in 0..self.setup.rate_hz {
            let perfect = self.flight.step(dt);
            let root = dt.sqrt();
            // The bias is the mean of its ends over the sample.
            let gyro_walk = three(&mut self.random, noise.gyro_bias_walk * root);
            let accel_walk = three(&mut self.random, noise.accel_bias_walk * root);
            let gyro_bias = self.gyro_bias + gyro_walk / 2.0;
            let accel_bias = self.accel_bias + accel_walk / 2.0;
            self.gyro_bias += gyro_walk;
            self.accel_bias += accel_walk;
            let white = three(&mut self.random, noise.arw * root);
            let white_force = three(&mut self.random, noise.vrw * root);
            let increment = Increment {
                dtheta_b: perfect.dtheta + gyro_bias * dt + white,
                dv_b: perfect.dv + accel_bias * dt + white_force,
                dt_s: dt,
            };
            self.samples += 1;
            let time = self.now();
            self.navigator.step(&increment, time);
        }
        // The clock over a second, exactly: the bias takes the mean of the drift's walk.
        let steps = CLOCK.drift_psd.sqrt() * normal(&mut self.random);
        let apart = (CLOCK.drift_psd / 12.0).sqrt() * normal(&mut self.random);
        let bias = CLOCK.bias_psd.sqrt() * normal(&mut self.random);
        self.clock[0] += self.clock[1] + steps / 2.0 + apart + bias;
        self.clock[1] += steps;
        self.epoch_s += 1.0;
    }

    /// Flies a second and takes an epoch.
    ///
    /// # Errors
    /// When the filter finds itself unhealthy.
    pub fn epoch(&mut self, sky: &Sky) -> Result<Assessment, Unhealthy> {
        self.fly();
        let time = self.now();
        let at = self.navigator.predict(time);
        let truth = *self.flight.truth();
        for seen in sky.seen(self.epoch_s, &truth.r) {
            let Some(satellite) = Satellite::new(System::Gps, seen.number) else {
                continue;
            };
            let difference = seen.r - truth.r;
            let range = difference.norm();
            let rate = difference.dot(&(seen.v - truth.v)) / range;
            let sigma = 0.5 + 0.5 / seen.sine;
            let sigma_rate = 0.03 + 0.02 / seen.sine;
            let measurement = CorrectedMeasurement {
                satellite,
                r_es_e_m: seen.r.into(),
                v_es_e_mps: seen.v.into(),
                pseudorange_m: range + self.clock[0] + sigma * normal(&mut self.random),
                sigma_pseudorange_m: sigma,
                range_rate_mps: Some((
                    rate + self.clock[1] + sigma_rate * normal(&mut self.random),
                    sigma_rate,
                )),
            };
            self.navigator.add(&measurement, &at, None);
        }
        let summary = self.navigator.update()?;
        Ok(Assessment {
            nis: (summary.nis, summary.rows),
            error: self.error(),
            covariance: covariance(self.navigator.filter()),
        })
    }

    /// Estimate minus truth; of the biases truth minus estimate.
    fn error(&self) -> ErrorState {
        let truth = self.flight.truth();
        let nominal = self.navigator.mechanisation();
        let state = self.navigator.antenna(self.now());
        let [w, x, y, z] = state.q_e_b;
        let c = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)).to_rotation_matrix();
        let parts = [
            (at::POS, nominal.r_eb_e - truth.r),
            (at::VEL, nominal.v_eb_e - truth.v),
            (
                at::ATT,
                rotation_vector(&(c.matrix() * truth.c.transpose())),
            ),
            (at::BG, self.gyro_bias - nominal.gyro_bias),
            (at::BA, self.accel_bias - nominal.accel_bias),
        ];
        let mut error = ErrorState::zeros();
        for (start, part) in parts {
            error.fixed_rows_mut::<3>(start).copy_from(&part);
        }
        error[at::CLK_B] = state.clock[0] - self.clock[0];
        error[at::CLK_D] = state.clock[1] - self.clock[1];
        error
    }
}
