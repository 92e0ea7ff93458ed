//! Strapdown mechanisation in ECEF: increments of a sample to position, velocity and attitude.
//!
//! In: angle and velocity increments in body axes, as the sensors integrated them over the sample.
//! Out: the state at the end of the sample, and what the filter's transition needs of it.
//!
//! | symbol | code       | shape | unit  | frame | meaning                                              |
//! |--------|------------|-------|-------|-------|------------------------------------------------------|
//! | r, v   | `r_eb_e`, `v_eb_e` | 3 | m, m/s | e  | position; velocity against the Earth                 |
//! | q      | `q_e_b`    | 4     | 1     |       | rotation from body to ECEF                           |
//! | b_g, b_a | `gyro_bias`, `accel_bias` | 3 | rad/s, m/s² | b | measured minus true                |
//! | Δθ, Δv | `dtheta`, `dv` | 3 | rad, m/s | b   | increments of the sample, biases taken out           |
//! | δα, δf | `dtheta_change`, `dv_change` | 3 | rad, m/s | b | change over the sample of the rate and of the specific force, times its length |
//! | φ      | `phi`      | 3     | rad   | b     | rotation vector of the sample                        |
//! | h      | `dt`       | 1     | s     |       | length of the sample                                 |
//! | ω      | `OMEGA_EARTH_WGS84_RADPS` | 1 | rad/s | e | rotation of the Earth about z                   |
//!
//! Within a sample rate and specific force are straight lines in time, whose slopes come from this and
//! the previous sample (of whatever lengths). Exact for those lines to second order in the angle:
//! coning δ = Δθ × δα / 12, sculling ½ Δθ × Δv + (Δθ × δf + Δv × δα) / 12, and their integral, the
//! scrolling; for samples of equal lengths the familiar 1/12 Δθ' × Δθ and 1/12 (Δθ' × Δv + Δv' × Δθ)
//! with the increments ' of the previous sample. Higher orders of the angle are those of a constant rate.
//!
//! Equations: coning [SAVAGE-1998-1], sculling and scrolling [SAVAGE-1998-2]; the ECEF form, Coriolis and
//! the turning of the frame [GROVES-2013] chapter 5 → [`Mechanisation::step`]. Keys: docs/references.md.
//! Departures: gravity and Coriolis acceleration are those of the middle of the sample.
//! Cost: 713 executed instructions on a Cortex-M7; more where one sample turns by over half a radian.
//! Assumes: increments are finite and the samples follow each other without a gap (`intake.rs`).

use super::InitialState;
use super::gravity::gravity_e;
use crate::consts::OMEGA_EARTH_WGS84_RADPS as OMEGA;
use crate::frames::rotation::{self, MAX_SERIES_ANGLE_SQUARED, Quaternion};
use nalgebra::{Matrix3, Vector3};

/// What the sensors integrated over a sample, in body axes; biases are still in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Increment {
    /// Integral of the angular rate against inertial space, rad.
    pub dtheta_b: Vector3<f64>,
    /// Integral of the specific force in the turning body axes, m/s.
    pub dv_b: Vector3<f64>,
    /// Length of the sample, s.
    pub dt_s: f64,
}

/// What one sample did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Velocity gained by the specific force over the sample, ECEF, m/s.
    pub dv_e: Vector3<f64>,
    /// Mean angular rate of the sample against inertial space, bias taken out, body axes, rad/s.
    pub omega_ib_b: Vector3<f64>,
    /// Rotation from body to ECEF at the end of the sample.
    pub c_e_b: Matrix3<f64>,
}

/// Why a state cannot be started from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StartError {
    /// A number that is not finite.
    NotFinite,
    /// The quaternion has no direction.
    NotARotation,
}

/// Mean rate and specific force of a sample, biases still in them.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Means {
    rate_b: Vector3<f64>,
    force_b: Vector3<f64>,
    dt_s: f64,
}

/// The state that inertial samples carry forward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mechanisation {
    /// Position, ECEF, m.
    pub r_eb_e: Vector3<f64>,
    /// Velocity against the Earth, ECEF, m/s.
    pub v_eb_e: Vector3<f64>,
    /// Rotation from body to ECEF, of unit length.
    pub q_e_b: Quaternion,
    /// Gyroscope bias, rad/s: measured minus true.
    pub gyro_bias: Vector3<f64>,
    /// Accelerometer bias, m/s²: measured minus true.
    pub accel_bias: Vector3<f64>,
    /// The previous sample; none at the start.
    previous: Option<Means>,
}

impl Mechanisation {
    /// At the centre of the Earth; to be started before the first step.
    pub const EMPTY: Self = Self {
        r_eb_e: ZERO,
        v_eb_e: ZERO,
        q_e_b: rotation::IDENTITY,
        gyro_bias: ZERO,
        accel_bias: ZERO,
        previous: None,
    };

    /// Starts from a state; there is no previous sample.
    ///
    /// # Errors
    /// [`StartError`]; the mechanisation is then as it was.
    pub fn start(&mut self, state: &InitialState) -> Result<(), StartError> {
        let vectors = [
            state.r_eb_e_m,
            state.v_eb_e_mps,
            state.gyro_bias_radps,
            state.accel_bias_mps2,
        ];
        if !vectors.iter().flatten().all(|part| part.is_finite()) {
            return Err(StartError::NotFinite);
        }
        let q_e_b = rotation::normalised(&state.q_e_b).ok_or(StartError::NotARotation)?;
        *self = Self {
            r_eb_e: state.r_eb_e_m.into(),
            v_eb_e: state.v_eb_e_mps.into(),
            q_e_b,
            gyro_bias: state.gyro_bias_radps.into(),
            accel_bias: state.accel_bias_mps2.into(),
            previous: None,
        };
        Ok(())
    }

    /// Carries the state over one sample. [SAVAGE-1998-1], [SAVAGE-1998-2], [GROVES-2013]
    ///
    /// A length that is not positive changes nothing.
    pub fn step(&mut self, increment: &Increment) -> Step {
        let dt = increment.dt_s;
        let c_before = rotation::to_matrix(&self.q_e_b);
        if !(dt > 0.0) {
            return Step {
                dv_e: ZERO,
                omega_ib_b: ZERO,
                c_e_b: c_before,
            };
        }
        let per_dt = 1.0 / dt;
        let means = Means {
            rate_b: increment.dtheta_b * per_dt,
            force_b: increment.dv_b * per_dt,
            dt_s: dt,
        };
        // Slopes times dt²: the biases are the same in both samples and drop out.
        let (dtheta_change, dv_change) = match &self.previous {
            Some(before) => {
                let slope = 2.0 * dt * dt / (dt + before.dt_s);
                (
                    (means.rate_b - before.rate_b) * slope,
                    (means.force_b - before.force_b) * slope,
                )
            }
            None => (ZERO, ZERO),
        };
        self.previous = Some(means);
        let dtheta = increment.dtheta_b - self.gyro_bias * dt;
        let dv = increment.dv_b - self.accel_bias * dt;

        let phi = dtheta + dtheta.cross(&dtheta_change) * (1.0 / 12.0);
        let turn = TurnFactors::of(&phi);

        // Velocity and position gained by the specific force, in the body axes of the beginning.
        let turned = phi.cross(&dv);
        let turned_twice = phi.cross(&turned);
        let gained_v_b = dv
            + turned * turn.first
            + turned_twice * turn.second
            + (dtheta.cross(&dv_change) + dv.cross(&dtheta_change)) * (1.0 / 12.0);
        let gained_r_b = (dv * 0.5 - dv_change * (1.0 / 12.0)
            + turned * turn.second
            + turned_twice * turn.third
            - dtheta_change.cross(&dv) * (1.0 / 24.0))
            * dt;

        // The frame turns under them: by half the angle on the mean for the velocity, a third for
        // the position.
        let earth = OMEGA * dt;
        let dv_e = turned_back(&(c_before * gained_v_b), 0.5 * earth);
        let dr_e = turned_back(&(c_before * gained_r_b), earth / 3.0);

        // Gravity and Coriolis acceleration in the middle of the sample.
        let v = self.v_eb_e;
        let gravity = gravity_e(&(self.r_eb_e + v * (0.5 * dt)));
        let v_middle = v + (dv_e + (gravity + coriolis(&v)) * dt) * 0.5;
        let acceleration = gravity + coriolis(&v_middle);

        self.r_eb_e += (v + acceleration * (0.5 * dt)) * dt + dr_e;
        self.v_eb_e = v + dv_e + acceleration * dt;

        // The frame turns by at most 1e-5 rad in any sample: two terms are exact.
        let half = 0.5 * earth;
        let q_earth = [1.0 - 0.5 * half * half, 0.0, 0.0, -half];
        let q_b = rotation::product(&self.q_e_b, &rotation::from_rotation_vector(&phi));
        self.q_e_b = rotation::renormalised(&rotation::product(&q_earth, &q_b));

        Step {
            dv_e,
            omega_ib_b: dtheta * per_dt,
            c_e_b: rotation::to_matrix(&self.q_e_b),
        }
    }

    /// Takes out errors that a filter found.
    ///
    /// `dr` (m), `dv` (m/s) and `psi` (rad, ECEF axes) are estimate minus truth, Ĉ = (I + [ψ×]) C;
    /// `gyro_bias` (rad/s) and `accel_bias` (m/s²) are truth minus estimate. [P0] (6), signs of
    /// docs/decisions/005-tight-filter.md.
    pub fn correct(
        &mut self,
        dr: &Vector3<f64>,
        dv: &Vector3<f64>,
        psi: &Vector3<f64>,
        gyro_bias: &Vector3<f64>,
        accel_bias: &Vector3<f64>,
    ) {
        self.r_eb_e -= dr;
        self.v_eb_e -= dv;
        let back = rotation::from_rotation_vector(&-psi);
        self.q_e_b = rotation::renormalised(&rotation::product(&back, &self.q_e_b));
        self.gyro_bias += gyro_bias;
        self.accel_bias += accel_bias;
    }
}

const ZERO: Vector3<f64> = Vector3::new(0.0, 0.0, 0.0);

/// Turns a vector about the z axis of the Earth by minus a small angle, first order.
fn turned_back(a: &Vector3<f64>, angle_rad: f64) -> Vector3<f64> {
    Vector3::new(a.x + angle_rad * a.y, a.y - angle_rad * a.x, a.z)
}

/// −2 ω × v.
fn coriolis(v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(2.0 * OMEGA * v.y, -2.0 * OMEGA * v.x, 0.0)
}

/// Factors of φ× and (φ×)² in the single and double integral of a constant specific force over a
/// rotation at constant rate: (1 − cos φ)/φ², (φ − sin φ)/φ³ and (φ²/2 − 1 + cos φ)/φ⁴.
struct TurnFactors {
    first: f64,
    second: f64,
    third: f64,
}

impl TurnFactors {
    fn of(phi: &Vector3<f64>) -> Self {
        let a2 = phi.x * phi.x + phi.y * phi.y + phi.z * phi.z;
        if a2 <= MAX_SERIES_ANGLE_SQUARED {
            // What is left out is below 1e-9 of a part of Δv at the bound, 1e-18 at 0.05 rad.
            Self {
                first: 0.5 - a2 / 24.0 * (1.0 - a2 / 30.0 * (1.0 - a2 / 56.0)),
                second: (1.0 - a2 / 20.0 * (1.0 - a2 / 42.0 * (1.0 - a2 / 72.0))) / 6.0,
                third: (1.0 - a2 / 30.0 * (1.0 - a2 / 56.0)) / 24.0,
            }
        } else {
            let angle = libm::sqrt(a2);
            let (sine, cosine) = libm::sincos(angle);
            Self {
                first: (1.0 - cosine) / a2,
                second: (angle - sine) / (a2 * angle),
                third: (0.5 * a2 - 1.0 + cosine) / (a2 * a2),
            }
        }
    }
}
