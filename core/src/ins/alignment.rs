//! Coarse initial attitude: given, or from the specific force and the course over ground.
//!
//! In: increments as they come, and at an epoch the receiver's position and velocity. Out: the
//! rotation from body to ECEF, or why it is not known yet.
//!
//! | symbol | code          | shape | unit | frame | meaning                                          |
//! |--------|---------------|-------|------|-------|--------------------------------------------------|
//! | f      | `force_b`     | 3     | m/s² | b     | mean specific force of the window, in the body axes of its end |
//! | f      | `force_h`     | 3     | m/s² | h     | the same by the receiver: v̇ + 2ω×v − g           |
//! | h      |               |       |      |       | forward (along the course), right, down; level   |
//! | φ, θ, ψ| `roll`, `pitch`, `heading` | | rad |   | ψ is the course over ground                      |
//!
//! The window is the time between two epochs at least [`MIN_WINDOW_NS`] apart. Turning within it is
//! followed by the gyroscopes, so that the vehicle may manoeuvre. With ψ known, f_b = C_1(φ) C_2(θ) f_h
//! has two unknowns: its first row gives θ, the other two give φ. Standing still this is levelling,
//! [GROVES-2013] chapter 5; the accelerated form is derived here. Keys: docs/references.md.
//! Accuracy, one sigma: roll and pitch, the accelerometer's bias over g and the receiver's velocity
//! noise · √2 / (9.8 m/s² · window): 5 mrad for 5 mg, 7 mrad for 0.05 m/s and a second; heading, the
//! velocity noise across the course over the speed (10 mrad at 5 m/s) plus the angle of drift or
//! sideslip, which a course does not show. Gyroscope biases matter little: 0.01 rad/s turns half of
//! 0.01 rad in a second.
//! Assumes: the vehicle moves where it points.

use super::{AttitudeStart, Increment};
use crate::consts::OMEGA_EARTH_WGS84_RADPS as OMEGA;
use crate::frames::geodesy::{GeodesyError, to_llh};
use crate::frames::rotation::{self, Quaternion};
use crate::ins::gravity::gravity_e;
use crate::time::{GpsTime, NS_PER_S};
use nalgebra::{Matrix3, Vector3};

/// Shortest window, ns: less than a second, for receivers whose epochs jitter.
pub const MIN_WINDOW_NS: i64 = NS_PER_S - NS_PER_S / 20;
/// Longest window, ns: what is longer has a gap in it.
pub const MAX_WINDOW_NS: i64 = 5 * NS_PER_S / 2;
/// Increments may cover the window but for this part of it.
const MAX_UNCOVERED: f64 = 0.05;
/// The two specific forces may differ in length by this, m/s²: a tenth of gravity.
pub const MAX_FORCE_DIFFERENCE_MPS2: f64 = 1.0;

/// Where an attitude came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum AlignmentMode {
    /// There is none.
    None = 0,
    /// It was given.
    Given = 1,
    /// Roll and pitch from the specific force, heading from the course over ground.
    Course = 2,
    /// Kept from before tight mode ended.
    Kept = 3,
}

impl AlignmentMode {
    /// All, in the order of their numbers.
    pub const ALL: [Self; 4] = [Self::None, Self::Given, Self::Course, Self::Kept];

    /// The mode of a number in a frame.
    pub fn from_u8(number: u8) -> Option<Self> {
        Self::ALL.get(usize::from(number)).copied()
    }

    /// Name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Given => "given",
            Self::Course => "course",
            Self::Kept => "kept",
        }
    }
}

/// Why there is no attitude yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NotAligned {
    /// Too little time between epochs with velocity, or too much.
    Window,
    /// The samples do not cover the window.
    SamplesMissing {
        /// What they cover, s.
        covered_s: f64,
    },
    /// Too slow for a course.
    TooSlow {
        /// Horizontal speed, m/s.
        speed_mps: f64,
    },
    /// The accelerometers and the receiver do not feel the same force.
    ForceMismatch {
        /// Length of the one minus that of the other, m/s².
        difference_mps2: f64,
    },
    /// No local horizontal there.
    Position(GeodesyError),
    /// The attitude is no rotation: a number was not finite.
    NotFinite,
}

/// An epoch that begins a window.
#[derive(Clone, Copy, Debug)]
struct Begin {
    time: GpsTime,
    v_e: Vector3<f64>,
}

/// Sums since the window began.
#[derive(Clone, Copy, Debug)]
pub struct CoarseAlignment {
    start: AttitudeStart,
    begin: Option<Begin>,
    /// Integral of the specific force, in the body axes of now.
    dv_b: Vector3<f64>,
    covered_s: f64,
}

const ZERO: Vector3<f64> = Vector3::new(0.0, 0.0, 0.0);

impl CoarseAlignment {
    /// Never finds an attitude until it is configured.
    pub const EMPTY: Self = Self {
        start: AttitudeStart::Course {
            min_speed_mps: f64::INFINITY,
        },
        begin: None,
        dv_b: ZERO,
        covered_s: 0.0,
    };

    /// Where its attitudes come from.
    pub const fn mode(&self) -> AlignmentMode {
        match self.start {
            AttitudeStart::Course { .. } => AlignmentMode::Course,
            AttitudeStart::Given { .. } => AlignmentMode::Given,
        }
    }

    /// Begins anew.
    pub fn configure(&mut self, start: &AttitudeStart) {
        *self = Self {
            start: *start,
            ..Self::EMPTY
        };
    }

    /// Forgets the window: the increments do not follow each other, or begin anew.
    pub fn restart(&mut self) {
        self.begin = None;
    }

    /// Takes the increments of a sample, or of a bridged gap.
    pub fn accumulate(&mut self, increment: &Increment) {
        // Into the axes of the end of the sample; of its own velocity, half the turn.
        let phi = increment.dtheta_b;
        let back = rotation::to_matrix(&rotation::from_rotation_vector(&-phi));
        self.dv_b = back * self.dv_b + increment.dv_b - phi.cross(&increment.dv_b) * 0.5;
        self.covered_s += increment.dt_s;
    }

    /// The attitude at an epoch: position (m) in ECEF, velocity (m/s) in east, north, up there; `None`
    /// where the receiver has no velocity.
    ///
    /// # Errors
    /// [`NotAligned`]; the next epochs may have more.
    pub fn epoch(
        &mut self,
        time: GpsTime,
        r_e: &Vector3<f64>,
        v_enu: Option<&Vector3<f64>>,
    ) -> Result<Quaternion, NotAligned> {
        let place = to_llh(r_e).map_err(NotAligned::Position)?;
        let c_e_n = rotation::c_e_n(place.lat_rad, place.lon_rad);
        let min_speed_mps = match &self.start {
            AttitudeStart::Given {
                roll_pitch_heading_rad,
            } => return quaternion(&(c_e_n * rotation::c_n_b(roll_pitch_heading_rad))),
            AttitudeStart::Course { min_speed_mps } => *min_speed_mps,
        };
        let Some(v_enu) = v_enu else {
            self.begin = None;
            return Err(NotAligned::Window);
        };
        let v_n = Vector3::new(v_enu.y, v_enu.x, -v_enu.z);
        let v_e = c_e_n * v_n;
        let elapsed_ns = self
            .begin
            .map(|begin| time.ns().saturating_sub(begin.time.ns()));
        if elapsed_ns.is_some_and(|ns| (0..MIN_WINDOW_NS).contains(&ns)) {
            return Err(NotAligned::Window);
        }
        let (dv_b, covered_s) = (self.dv_b, self.covered_s);
        let begin = self.begin.replace(Begin { time, v_e });
        (self.dv_b, self.covered_s) = (ZERO, 0.0);
        let begin = begin
            .filter(|_| elapsed_ns.is_some_and(|ns| (MIN_WINDOW_NS..=MAX_WINDOW_NS).contains(&ns)))
            .ok_or(NotAligned::Window)?;
        let window_s = time.seconds_since(begin.time);
        if !(libm::fabs(covered_s - window_s) <= MAX_UNCOVERED * window_s) {
            return Err(NotAligned::SamplesMissing { covered_s });
        }
        let speed_mps = libm::sqrt(v_n.x * v_n.x + v_n.y * v_n.y);
        if !(speed_mps >= min_speed_mps && speed_mps > 0.0) {
            return Err(NotAligned::TooSlow { speed_mps });
        }

        let v_mean = (v_e + begin.v_e) * 0.5;
        let coriolis = Vector3::new(-2.0 * OMEGA * v_mean.y, 2.0 * OMEGA * v_mean.x, 0.0);
        let force_e = (v_e - begin.v_e) / window_s + coriolis - gravity_e(r_e);
        let heading = libm::atan2(v_n.y, v_n.x);
        let c_h_n = rotation::c_n_b(&[0.0, 0.0, heading]).transpose();
        let force_h = c_h_n * (c_e_n.transpose() * force_e);
        let [roll, pitch] = roll_and_pitch(&(dv_b / covered_s), &force_h)?;
        quaternion(&(c_e_n * rotation::c_n_b(&[roll, pitch, heading])))
    }
}

/// Roll and pitch that take `force_h` (level axes along the heading) to `force_b`, rad.
fn roll_and_pitch(force_b: &Vector3<f64>, force_h: &Vector3<f64>) -> Result<[f64; 2], NotAligned> {
    let difference_mps2 = length(force_b) - length(force_h);
    if !(libm::fabs(difference_mps2) <= MAX_FORCE_DIFFERENCE_MPS2) {
        return Err(NotAligned::ForceMismatch { difference_mps2 });
    }
    // f_b,x = f_h,x cos θ − f_h,z sin θ = R sin(θ + α).
    let in_plane = libm::sqrt(force_h.x * force_h.x + force_h.z * force_h.z);
    let sine = force_b.x / in_plane;
    // Noise may make it a little longer than the whole: nose up or down then.
    let sine = if sine > 1.0 {
        1.0
    } else if sine < -1.0 {
        -1.0
    } else {
        sine
    };
    let pitch = libm::asin(sine) - libm::atan2(force_h.x, -force_h.z);
    let (sin_pitch, cos_pitch) = libm::sincos(pitch);
    let down = force_h.x * sin_pitch + force_h.z * cos_pitch;
    let roll = libm::atan2(down, force_h.y) - libm::atan2(force_b.z, force_b.y);
    Ok([roll, pitch])
}

fn length(a: &Vector3<f64>) -> f64 {
    libm::sqrt(a.x * a.x + a.y * a.y + a.z * a.z)
}

fn quaternion(c_e_b: &Matrix3<f64>) -> Result<Quaternion, NotAligned> {
    rotation::from_matrix(c_e_b).ok_or(NotAligned::NotFinite)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::geodesy::{Llh, to_ecef};
    use core::f64::consts::PI;

    const COURSE: AttitudeStart = AttitudeStart::Course { min_speed_mps: 3.0 };

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
            let force_e =
                c_e_n * (dv_n / dt_s) + 2.0 * earth.cross(&v_e) - gravity_e(&Self::place());
            let rate_n = Vector3::new(0.0, 0.0, self.turn_radps) + c_e_n.transpose() * earth;
            Increment {
                dtheta_b: c_n_b.transpose() * rate_n * dt_s,
                dv_b: self.c_e_b(middle_s).transpose() * force_e * dt_s,
                dt_s,
            }
        }

        /// Two epochs a second apart; the accelerometers have a bias, the first `lost` samples are.
        fn align(&self, bias: Vector3<f64>, lost: i32) -> Result<Quaternion, NotAligned> {
            let mut alignment = CoarseAlignment::EMPTY;
            alignment.configure(&COURSE);
            let enu = |t_s| {
                let v = self.velocity_n(t_s);
                Vector3::new(v.y, v.x, -v.z)
            };
            let (first, second) = (GpsTime::from_ns(0), GpsTime::from_ns(NS_PER_S));
            let begin = alignment.epoch(first, &Self::place(), Some(&enu(0.0)));
            assert_eq!(begin, Err(NotAligned::Window));
            for k in lost + 1..=1000 {
                let mut increment = self.increment(f64::from(k) * 1e-3);
                increment.dv_b += bias * increment.dt_s;
                alignment.accumulate(&increment);
            }
            alignment.epoch(second, &Self::place(), Some(&enu(1.0)))
        }

        /// Errors about body axes, rad.
        fn error(&self, q_e_b: &Quaternion) -> Vector3<f64> {
            let difference = self.c_e_b(1.0).transpose() * rotation::to_matrix(q_e_b);
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
        let place = Vehicle::place();
        let refused = alignment.epoch(GpsTime::from_ns(0), &place, None);
        assert_eq!(refused, Err(NotAligned::Window));
        let angles = [0.1, -0.4, 3.0];
        alignment.configure(&AttitudeStart::Given {
            roll_pitch_heading_rad: angles,
        });
        let q_e_b = alignment.epoch(GpsTime::from_ns(0), &place, None).unwrap();
        let c_n_b = rotation::c_e_n(0.8, 0.3).transpose() * rotation::to_matrix(&q_e_b);
        let back = rotation::roll_pitch_heading(&c_n_b);
        assert!(angles.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-9));
        let nowhere = alignment.epoch(GpsTime::from_ns(0), &ZERO, None);
        assert!(matches!(nowhere, Err(NotAligned::Position(_))));
        alignment.configure(&AttitudeStart::Given {
            roll_pitch_heading_rad: [f64::NAN, 0.0, PI],
        });
        let nothing = alignment.epoch(GpsTime::from_ns(0), &place, None);
        assert_eq!(nothing, Err(NotAligned::NotFinite));
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
        let mut alignment = CoarseAlignment::EMPTY;
        alignment.configure(&COURSE);
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
                if alignment
                    .epoch(time, &Vehicle::place(), Some(&v_enu))
                    .is_ok()
                {
                    found.push(k);
                }
            }
        }
        assert_eq!(found, [1000, 2000]);
    }
}
