//! `surefix campaign alignment`: attitudes that core's alignment finds, against what it says of their errors.
//!
//! A trial is one start in each case: a unit of a grade, its biases and walks drawn, at a latitude of up to
//! 60° with an attitude drawn, at rest or in motion; the receiver's velocity with white noise; a
//! magnetometer whose calibrated field is off by a draw of its sigma, and a declination off by a draw of
//! its. A vehicle that moves slips sideways by a draw of the side-slip that is configured.
//!
//! | number | is |
//! |---|---|
//! | error | rotation vector from the true attitude to the one found, north, east, down |
//! | normalised | the same over the sigma told; were sigma right, normal with variance 1 |
//!
//! The mean square of n normalised errors is chi-square with n degrees of freedom over n where sigma is right: larger
//! when sigma is too small, smaller when it is too large. Truth and samples are made here, apart from core:
//! the Earth of [`crate::simulate::inertial::earth`], errors of [`UnitErrors`].

use std::fmt::Write as _;

use anyhow::Result;
use nalgebra::{Matrix3, Vector3};
use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::{Deserialize, Serialize};
use surefix_core::frames::rotation;
use surefix_core::ins::alignment::{Aligned, AlignmentEpoch, Magnetometer, NotAligned, Obstacle};
use surefix_core::ins::{
    AttitudeStart, ClockNoise, CoarseAlignment, Increment, InertialConfig, InitialSigma,
    MagneticSample, MeasurementFactors, SensorRange,
};
use surefix_core::time::{GpsTime, NS_PER_S};

use super::outcome::{Campaign, Outcome};
use crate::consistency::statistics::chi_square_interval;
use crate::simulate::inertial::earth::{OMEGA_IE_RADPS, frame, gravity_e};
use crate::simulate::inertial::sensors::{Grade, UnitErrors, normal3};
use crate::simulate::noise::normal;

/// Samples per second.
const RATE_HZ: i64 = 100;
/// One sigma of the receiver's velocity, east, north, up, m/s.
const SIGMA_ENU_MPS: [f64; 3] = [0.05, 0.05, 0.1];
/// One sigma of the side-slip of a vehicle, rad: 2°.
const SIDE_SLIP_RAD: f64 = 2.0 * core::f64::consts::PI / 180.0;
/// With the course roll and pitch are as good as the sensors: no vibration here.
const NO_VIBRATION_RAD: f64 = 1e-6;
/// Confidence of the intervals in the table.
const CONFIDENCE: f64 = 0.999;

/// How an attitude is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// At rest for so many seconds.
    Gyrocompass {
        /// How long, s.
        rest_s: i64,
    },
    /// At rest, with a magnetometer.
    FieldAtRest,
    /// In a turn, with a magnetometer.
    FieldInMotion,
    /// In a turn, by the course.
    Course,
}

/// A case: the method and the grade of the unit.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// Name in tables.
    pub name: &'static str,
    /// How.
    pub method: Method,
    /// With which unit.
    pub grade: Grade,
}

/// All cases.
pub const CASES: [Case; 10] = [
    case("gyrocompass, 60 s", 60, Grade::Navigation),
    case("gyrocompass, 300 s", 300, Grade::Navigation),
    case("gyrocompass, 60 s", 60, Grade::Tactical),
    case("gyrocompass, 300 s", 300, Grade::Tactical),
    case("gyrocompass, 60 s", 60, Grade::Mems),
    Case {
        name: "magnetic field, at rest",
        method: Method::FieldAtRest,
        grade: Grade::Tactical,
    },
    Case {
        name: "magnetic field, at rest",
        method: Method::FieldAtRest,
        grade: Grade::Mems,
    },
    Case {
        name: "magnetic field, in motion",
        method: Method::FieldInMotion,
        grade: Grade::Mems,
    },
    Case {
        name: "course",
        method: Method::Course,
        grade: Grade::Tactical,
    },
    Case {
        name: "course",
        method: Method::Course,
        grade: Grade::Mems,
    },
];

const fn case(name: &'static str, rest_s: i64, grade: Grade) -> Case {
    Case {
        name,
        method: Method::Gyrocompass { rest_s },
        grade,
    }
}

/// What a start gave.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Start {
    /// Place of the case in [`CASES`].
    pub case: usize,
    /// Errors and sigmas about north, east, down, rad; `None` where there is no attitude.
    pub found: Option<([f64; 3], [f64; 3])>,
    /// Why there is none.
    pub refused: String,
}

/// The campaign.
pub struct Alignment {
    seed: u64,
}

/// A number between two others.
fn between(random: &mut ChaCha20Rng, low: f64, high: f64) -> f64 {
    // A normal number's own distribution is uniform.
    let share = 0.5 * (1.0 + libm::erf(normal(random) / core::f64::consts::SQRT_2));
    low + (high - low) * share
}

/// Truth of a start: where, how it stands at the end, how it turns and gathers speed.
struct Truth {
    r_e: Vector3<f64>,
    c_e_n: Matrix3<f64>,
    angles: [f64; 3],
    turn_radps: f64,
    speed_mps: f64,
    thrust_mps2: f64,
    /// Heading minus course, rad.
    slip_rad: f64,
    end_s: f64,
}

impl Truth {
    fn draw(random: &mut ChaCha20Rng, method: Method) -> Self {
        let pi = core::f64::consts::PI;
        let latitude_rad = between(random, -pi / 3.0, pi / 3.0);
        let (r_e, c_e_n) = frame(latitude_rad, between(random, -pi, pi), 100.0);
        let angles = [
            between(random, -0.3, 0.3),
            between(random, -0.3, 0.3),
            between(random, -pi, pi),
        ];
        let moves = matches!(method, Method::Course | Method::FieldInMotion);
        let of = |value: f64| if moves { value } else { 0.0 };
        Self {
            r_e,
            c_e_n,
            angles,
            turn_radps: of(between(random, -0.2, 0.2)),
            speed_mps: of(between(random, 5.0, 25.0)),
            thrust_mps2: of(between(random, -1.0, 1.0)),
            slip_rad: of(SIDE_SLIP_RAD * normal(random)),
            end_s: match method {
                Method::Gyrocompass { rest_s } => rest_s as f64,
                Method::FieldAtRest => 3.0,
                Method::FieldInMotion | Method::Course => 1.0,
            },
        }
    }

    fn c_n_b(&self, t_s: f64) -> Matrix3<f64> {
        let [roll, pitch, heading] = self.angles;
        rotation::c_n_b(&[roll, pitch, heading + self.turn_radps * (t_s - self.end_s)])
    }

    fn v_n(&self, t_s: f64) -> Vector3<f64> {
        let [.., heading] = self.angles;
        let course = heading - self.slip_rad + self.turn_radps * (t_s - self.end_s);
        let speed = self.speed_mps + self.thrust_mps2 * (t_s - self.end_s);
        Vector3::new(libm::cos(course), libm::sin(course), 0.0) * speed
    }

    /// True increments over (from, to].
    fn increments(&self, from_s: f64, to_s: f64) -> (Vector3<f64>, Vector3<f64>) {
        let (dt_s, middle_s) = (to_s - from_s, 0.5 * (from_s + to_s));
        let c_b_n = self.c_n_b(middle_s).transpose();
        let earth_n = self.c_e_n.transpose() * Vector3::new(0.0, 0.0, OMEGA_IE_RADPS);
        let v_n = self.v_n(middle_s);
        let gravity_n = self.c_e_n.transpose() * gravity_e(&self.r_e);
        let dv_n = self.v_n(to_s) - self.v_n(from_s);
        let force_n = dv_n / dt_s + 2.0 * earth_n.cross(&v_n) - gravity_n;
        let rate_n = Vector3::new(0.0, 0.0, self.turn_radps) + earth_n;
        (c_b_n * rate_n * dt_s, c_b_n * force_n * dt_s)
    }

    fn epoch(&self, t_s: f64, random: &mut ChaCha20Rng) -> AlignmentEpoch {
        let v_n = self.v_n(t_s);
        let noise = normal3(random).component_mul(&Vector3::from(SIGMA_ENU_MPS));
        AlignmentEpoch {
            time: GpsTime::from_ns((t_s * 1e9).round() as i64),
            r_e: self.r_e,
            v_enu: Some(Vector3::new(v_n.y, v_n.x, -v_n.z) + noise),
            sigma_enu_mps: SIGMA_ENU_MPS,
        }
    }

    /// Rotation vector from the truth to what was found, north, east, down, rad.
    fn error(&self, aligned: &Aligned) -> [f64; 3] {
        let found_n_b = self.c_e_n.transpose() * rotation::to_matrix(&aligned.q_e_b);
        let [w, x, y, z] = rotation::from_matrix(&(found_n_b * self.c_n_b(self.end_s).transpose()))
            .unwrap_or([0.0; 4]);
        let v = Vector3::new(x, y, z);
        let sine = v.norm();
        let angle = 2.0 * libm::atan2(sine, w);
        (if sine > 0.0 { v * (angle / sine) } else { v }).into()
    }
}

fn unit(case: &Case) -> InertialConfig {
    let noise = case.grade.noise();
    let wide = core::f64::consts::FRAC_PI_8;
    InertialConfig {
        interval_ns: (NS_PER_S / RATE_HZ) as u32,
        c_b_s: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        lever_arm_b_m: [0.0; 3],
        noise: noise.density,
        clock: ClockNoise {
            bias_psd: 0.01,
            drift_psd: 0.04,
            drift_decay_per_s: 0.0,
            inter_system_psd: 0.0,
        },
        measurement: MeasurementFactors::ONE,
        range: SensorRange {
            rate_radps: 10.0,
            specific_force_mps2: 100.0,
        },
        start: match case.method {
            Method::Gyrocompass { .. } => AttitudeStart::Gyrocompass {
                max_heading_sigma_rad: wide,
            },
            Method::FieldAtRest | Method::FieldInMotion => AttitudeStart::MagneticField,
            Method::Course => AttitudeStart::Course { min_speed_mps: 2.0 },
        },
        sigma: InitialSigma {
            position_m: 10.0,
            velocity_mps: 0.5,
            attitude_ned_rad: [NO_VIBRATION_RAD, NO_VIBRATION_RAD, SIDE_SLIP_RAD],
            gyro_bias_radps: noise.gyro_bias_radps,
            accel_bias_mps2: noise.accel_bias_mps2,
            clock_bias_m: 30.0,
            clock_drift_mps: 1.0,
        },
    }
}

/// A magnetometer and what it reads.
struct Field {
    known: Magnetometer,
    true_n_ut: Vector3<f64>,
    /// What calibration left, body axes, µT.
    left_b_ut: Vector3<f64>,
}

impl Field {
    fn draw(random: &mut ChaCha20Rng) -> Self {
        let known = Magnetometer {
            hard_iron_s_ut: (normal3(random) * 20.0).into(),
            soft_iron_b_s: [[0.0, 1.05, 0.02], [-0.95, 0.0, 0.01], [0.0, 0.03, 1.0]],
            declination_rad: between(random, -0.3, 0.3),
            sigma_declination_rad: 0.01,
            declination_year: 1980.0,
            dip_rad: between(random, -1.2, 1.2),
            strength_ut: between(random, 30.0, 60.0),
            sigma_ut: 0.4,
        };
        let mut real = known;
        real.declination_rad += known.sigma_declination_rad * normal(random);
        Self {
            known,
            true_n_ut: real.field_n_ut(),
            left_b_ut: normal3(random) * known.sigma_ut,
        }
    }

    fn read(&self, c_n_b: &Matrix3<f64>) -> MagneticSample {
        let rows = self.known.soft_iron_b_s.map(nalgebra::RowVector3::from);
        let to_s = Matrix3::from_rows(&rows)
            .try_inverse()
            .unwrap_or_else(Matrix3::identity);
        let field_s = to_s * (c_n_b.transpose() * self.true_n_ut + self.left_b_ut);
        MagneticSample {
            time: GpsTime::from_ns(0),
            field_s_ut: (field_s + Vector3::from(self.known.hard_iron_s_ut)).into(),
        }
    }
}

/// One start of a case.
pub fn start(case: usize, random: &mut ChaCha20Rng) -> Start {
    let of = &CASES[case];
    let truth = Truth::draw(random, of.method);
    let field = Field::draw(random);
    let mut errors = UnitErrors::new(
        of.grade.noise(),
        false,
        ChaCha20Rng::from_seed(core::array::from_fn(|k| {
            (between(random, 0.0, 256.0) as u8).wrapping_add(k as u8)
        })),
    );
    let mut alignment = CoarseAlignment::EMPTY;
    alignment.configure(&unit(of));
    alignment.set_magnetometer(&field.known);
    let _ = alignment.epoch(&truth.epoch(0.0, random));
    let dt_s = 1.0 / RATE_HZ as f64;
    let mut outcome: Result<Aligned, NotAligned> = Err(NotAligned::Window);
    let seconds = truth.end_s as i64;
    for second in 1..=seconds {
        for k in (second - 1) * RATE_HZ..second * RATE_HZ {
            let (from_s, to_s) = (k as f64 * dt_s, (k + 1) as f64 * dt_s);
            let (dtheta, dv) = truth.increments(from_s, to_s);
            let (dtheta_b, dv_b) = errors.disturb(dt_s, dtheta, dv);
            alignment.accumulate(&Increment {
                dtheta_b,
                dv_b,
                dt_s,
            });
            if k % 2 == 0 {
                alignment.on_field(&field.read(&truth.c_n_b(to_s)));
            }
        }
        outcome = alignment.epoch(&truth.epoch(second as f64, random));
    }
    Start {
        case,
        found: outcome
            .ok()
            .map(|aligned| (truth.error(&aligned), aligned.sigma_ned_rad)),
        refused: outcome
            .err()
            .map_or("", |why| Obstacle::from(why).name())
            .into(),
    }
}

impl Campaign for Alignment {
    const NAME: &'static str = "alignment";
    const TRIALS: u64 = 100;
    type Record = Start;

    fn prepare(seed: u64, _trials: u64) -> Result<Self> {
        Ok(Self { seed })
    }

    fn piece(&mut self, number: u64) -> Result<Vec<Start>> {
        Ok((0..CASES.len())
            .map(|case| {
                let mut random = ChaCha20Rng::seed_from_u64(self.seed);
                random.set_stream(number * CASES.len() as u64 + case as u64);
                start(case, &mut random)
            })
            .collect())
    }

    fn report(outcome: &Outcome<Start>) -> String {
        let mut text = format!(
            "| mode | unit | starts | refused | roll, pitch: error rms | sigma rms, ° | mean square normalised | heading: error rms | sigma rms, ° | mean square normalised | interval, {} % |\n|---|---|---|---|---|---|---|---|---|---|---|\n",
            100.0 * CONFIDENCE
        );
        for figures in figures(outcome) {
            let of = &CASES[figures.case];
            let _ = write!(
                text,
                "| {} | {} | {} | {} ",
                of.name,
                of.grade.name(),
                figures.starts,
                if figures.refused == 0 {
                    "0".into()
                } else {
                    format!("{}: {}", figures.refused, figures.why)
                }
            );
            if figures.starts == figures.refused {
                text.push_str("| - | - | - | - | - | - | - |\n");
                continue;
            }
            let interval = figures.interval(CONFIDENCE);
            let _ = writeln!(
                text,
                "| {:.3} | {:.3} | {:.2} | {:.3} | {:.3} | {:.2} | {:.2} to {:.2} |",
                figures.level[0].to_degrees(),
                figures.level[1].to_degrees(),
                figures.level[2],
                figures.heading[0].to_degrees(),
                figures.heading[1].to_degrees(),
                figures.heading[2],
                interval[0],
                interval[1],
            );
        }
        text
    }
}

/// What the starts of a case say together.
#[derive(Clone, Debug)]
pub struct Figures {
    /// Place of the case in [`CASES`].
    pub case: usize,
    /// Starts.
    pub starts: usize,
    /// Those without an attitude.
    pub refused: usize,
    /// Why the first of them.
    pub why: String,
    /// About north and east: root mean square of errors and of sigmas, rad, mean square of normalised errors.
    pub level: [f64; 3],
    /// About down: the same.
    pub heading: [f64; 3],
}

impl Figures {
    /// Where the mean square of the normalised errors of the heading lies with this confidence if sigma is right.
    pub fn interval(&self, confidence: f64) -> [f64; 2] {
        let found = (self.starts - self.refused) as f64;
        let interval = chi_square_interval(1.0, found, confidence);
        [interval.low, interval.high]
    }
}

/// Figures of every case.
pub fn figures(outcome: &Outcome<Start>) -> Vec<Figures> {
    (0..CASES.len())
        .map(|case| {
            let of_case: Vec<&Start> = outcome.of().filter(|start| start.case == case).collect();
            let found: Vec<([f64; 3], [f64; 3])> =
                of_case.iter().filter_map(|start| start.found).collect();
            let over = |axes: &[usize]| {
                let count = (found.len() * axes.len()).max(1) as f64;
                let mean = |of: &dyn Fn(f64, f64) -> f64| {
                    let all = found
                        .iter()
                        .flat_map(|(error, sigma)| axes.iter().map(|k| of(error[*k], sigma[*k])));
                    all.sum::<f64>() / count
                };
                [
                    mean(&|error, _| error * error).sqrt(),
                    mean(&|_, sigma| sigma * sigma).sqrt(),
                    mean(&|error, sigma| (error / sigma) * (error / sigma)),
                ]
            };
            let refused = of_case.iter().find(|start| start.found.is_none());
            Figures {
                case,
                starts: of_case.len(),
                refused: of_case.len() - found.len(),
                why: refused.map_or(String::new(), |start| start.refused.clone()),
                level: over(&[0, 1]),
                heading: over(&[2]),
            }
        })
        .collect()
}
