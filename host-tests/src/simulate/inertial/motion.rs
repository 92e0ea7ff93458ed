//! How a vehicle moves: speed, slope, turns, and the attitude that goes with them.
//!
//! Everything is a function of time alone, so that velocity, acceleration, attitude and angular rate
//! are exact; only the position has to be integrated (`trajectory.rs`). Speed and attitude have two
//! continuous derivatives.
//!
//! | symbol | code | unit | meaning |
//! |---|---|---|---|
//! | V, γ, χ | speed, slope, course | m/s, rad, rad | velocity along the path, its slope, its direction from north |
//! | φ, θ, ψ | roll, pitch, heading | rad | attitude of the body against north, east, down |
//!
//! The nose points along the path; in a turn a winged vehicle banks by φ = atan(V cos γ · χ'/g), so
//! that the specific force stays in its plane of symmetry.

use core::f64::consts::TAU;

use nalgebra::{Matrix3, Vector3};

use super::profile::{Moving, Profile};

/// Gravity of the bank angle, m/s².
const GRAVITY_MPS2: f64 = 9.806_65;

/// Oscillation of the body: a cone of roll and pitch, and heaving in step with the roll.
#[derive(Clone, Debug)]
pub struct Shake {
    /// Cycles per second.
    pub frequency_hz: f64,
    /// Half angle of the cone, rad.
    pub cone_rad: f64,
    /// Amplitude of the vertical speed, m/s.
    pub heave_mps: f64,
    /// Share of these amplitudes by time.
    pub envelope: Profile,
}

/// The motion of a vehicle.
#[derive(Clone, Debug)]
pub struct Motion {
    speed_mps: f64,
    course_rad: f64,
    acceleration: Profile,
    slope: Profile,
    turn_rate: Profile,
    climb: Profile,
    pitch: Profile,
    banks: bool,
    shake: Option<Shake>,
}

/// Velocity and attitude at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Kinematics {
    /// Velocity over the Earth, north, east, down, m/s.
    pub v_eb_n: Vector3<f64>,
    /// Time derivative of those components, m/s².
    pub v_eb_n_rate: Vector3<f64>,
    /// Rotation from body to north, east, down.
    pub c_n_b: Matrix3<f64>,
    /// Angular rate of the body against north, east, down, body axes, rad/s.
    pub omega_nb_b: Vector3<f64>,
}

impl Motion {
    /// Straight and level at a constant speed.
    pub fn level(course_deg: f64, speed_mps: f64) -> Self {
        Self {
            speed_mps,
            course_rad: course_deg.to_radians(),
            acceleration: Profile::constant(0.0),
            slope: Profile::constant(0.0),
            turn_rate: Profile::constant(0.0),
            climb: Profile::constant(0.0),
            pitch: Profile::constant(0.0),
            banks: true,
            shake: None,
        }
    }

    /// Does not bank in turns.
    pub fn without_bank(mut self) -> Self {
        self.banks = false;
        self
    }

    /// Oscillates.
    pub fn shaken(mut self, shake: Shake) -> Self {
        self.shake = Some(shake);
        self
    }

    /// Gains `gain_mps` between two times; the acceleration sets in and ends over `onset_s`.
    pub fn accelerate(mut self, from_s: f64, to_s: f64, gain_mps: f64, onset_s: f64) -> Self {
        let acceleration = gain_mps / (to_s - from_s - onset_s);
        pulse(&mut self.acceleration, from_s, to_s, acceleration, onset_s);
        self
    }

    /// Turns by `angle_deg`, positive right, between two times; the turn sets in and ends over
    /// `onset_s`.
    pub fn turn(mut self, from_s: f64, to_s: f64, angle_deg: f64, onset_s: f64) -> Self {
        let rate = angle_deg.to_radians() / (to_s - from_s - onset_s);
        pulse(&mut self.turn_rate, from_s, to_s, rate, onset_s);
        self
    }

    /// Changes the slope of the path to `slope_deg`, positive up, and the nose with it.
    pub fn slope(mut self, from_s: f64, to_s: f64, slope_deg: f64) -> Self {
        self.slope.change(from_s, to_s, slope_deg.to_radians());
        self
    }

    /// Changes the vertical speed beside the path's own to `climb_mps`, the nose staying level.
    pub fn climb(mut self, from_s: f64, to_s: f64, climb_mps: f64) -> Self {
        self.climb.change(from_s, to_s, climb_mps);
        self
    }

    /// Changes the angle of the nose over the path to `pitch_deg`.
    pub fn pitch(mut self, from_s: f64, to_s: f64, pitch_deg: f64) -> Self {
        self.pitch.change(from_s, to_s, pitch_deg.to_radians());
        self
    }

    /// Velocity, north, east, down, m/s, with its rate.
    fn velocity(&self, t_s: f64) -> [Moving; 3] {
        let speed = Moving {
            value: self.speed_mps + self.acceleration.integral(t_s),
            rate: self.acceleration.at(t_s).value,
        };
        let course = Moving {
            value: self.course_rad + self.turn_rate.integral(t_s),
            rate: self.turn_rate.at(t_s).value,
        };
        let (sin_slope, cos_slope) = self.slope.at(t_s).sin_cos();
        let (sin_course, cos_course) = course.sin_cos();
        let horizontal = speed * cos_slope;
        let mut up = speed * sin_slope + self.climb.at(t_s);
        if let Some(shake) = &self.shake {
            let (sin, _) = shake.angle(t_s).sin_cos();
            up = up + shake.envelope.at(t_s) * sin * shake.heave_mps;
        }
        [horizontal * cos_course, horizontal * sin_course, up * -1.0]
    }

    /// Velocity, north, east, down, m/s.
    pub fn velocity_n(&self, t_s: f64) -> Vector3<f64> {
        Vector3::from(self.velocity(t_s).map(|v| v.value))
    }

    /// Velocity, attitude and their rates.
    pub fn at(&self, t_s: f64) -> Kinematics {
        let velocity = self.velocity(t_s);
        let turn_rate = self.turn_rate.at(t_s);
        let heading = Moving {
            value: self.course_rad + self.turn_rate.integral(t_s),
            rate: turn_rate.value,
        };
        let slope = self.slope.at(t_s);
        let mut pitch = slope + self.pitch.at(t_s);
        let mut roll = Moving::constant(0.0);
        if self.banks {
            let speed = Moving {
                value: self.speed_mps + self.acceleration.integral(t_s),
                rate: self.acceleration.at(t_s).value,
            };
            let (_, cos_slope) = slope.sin_cos();
            roll = (speed * cos_slope * turn_rate * (1.0 / GRAVITY_MPS2)).atan();
        }
        if let Some(shake) = &self.shake {
            let (sin, cos) = shake.angle(t_s).sin_cos();
            let amplitude = shake.envelope.at(t_s) * shake.cone_rad;
            roll = roll + amplitude * sin;
            pitch = pitch + amplitude * cos;
        }
        let (sin_roll, cos_roll) = (libm::sin(roll.value), libm::cos(roll.value));
        let (sin_pitch, cos_pitch) = (libm::sin(pitch.value), libm::cos(pitch.value));
        let (sin_heading, cos_heading) = (libm::sin(heading.value), libm::cos(heading.value));
        Kinematics {
            v_eb_n: Vector3::from(velocity.map(|v| v.value)),
            v_eb_n_rate: Vector3::from(velocity.map(|v| v.rate)),
            c_n_b: Matrix3::new(
                cos_pitch * cos_heading,
                sin_roll * sin_pitch * cos_heading - cos_roll * sin_heading,
                cos_roll * sin_pitch * cos_heading + sin_roll * sin_heading,
                cos_pitch * sin_heading,
                sin_roll * sin_pitch * sin_heading + cos_roll * cos_heading,
                cos_roll * sin_pitch * sin_heading - sin_roll * cos_heading,
                -sin_pitch,
                sin_roll * cos_pitch,
                cos_roll * cos_pitch,
            ),
            omega_nb_b: Vector3::new(
                roll.rate - heading.rate * sin_pitch,
                pitch.rate * cos_roll + heading.rate * cos_pitch * sin_roll,
                -pitch.rate * sin_roll + heading.rate * cos_pitch * cos_roll,
            ),
        }
    }
}

impl Shake {
    fn angle(&self, t_s: f64) -> Moving {
        let rate = TAU * self.frequency_hz;
        Moving {
            value: rate * t_s,
            rate,
        }
    }
}

/// Raises a profile to `value` and takes it back to zero.
fn pulse(profile: &mut Profile, from_s: f64, to_s: f64, value: f64, onset_s: f64) {
    profile.change(from_s, from_s + onset_s, value);
    profile.change(to_s - onset_s, to_s, 0.0);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Motion {
        Motion::level(30.0, 60.0)
            .accelerate(2.0, 12.0, 25.0, 3.0)
            .turn(4.0, 20.0, -100.0, 4.0)
            .slope(6.0, 10.0, 12.0)
            .climb(1.0, 5.0, -2.0)
            .pitch(3.0, 6.0, 4.0)
            .shaken(Shake {
                frequency_hz: 2.0,
                cone_rad: 0.05,
                heave_mps: 0.7,
                envelope: Profile::constant(1.0),
            })
    }

    #[test]
    fn rates_belong_to_velocity_and_attitude() {
        let motion = example();
        let step_s = 1e-5;
        for k in 0..230 {
            let t_s = 0.1 * f64::from(k) + 0.05;
            let (before, now, after) = (
                motion.at(t_s - step_s),
                motion.at(t_s),
                motion.at(t_s + step_s),
            );
            let acceleration = (after.v_eb_n - before.v_eb_n) / (2.0 * step_s);
            assert!((acceleration - now.v_eb_n_rate).norm() < 1e-6, "{t_s}");
            // C' = C [ω×]
            let turning = now.c_n_b.transpose() * (after.c_n_b - before.c_n_b) / (2.0 * step_s);
            let omega = Vector3::new(turning[(2, 1)], turning[(0, 2)], turning[(1, 0)]);
            assert!((omega - now.omega_nb_b).norm() < 1e-7, "{t_s}");
            assert!((now.c_n_b.determinant() - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn manoeuvres_end_where_they_should() {
        let motion = example();
        let end = motion.velocity_n(30.0) + Vector3::z() * 0.7 * libm::sin(TAU * 60.0);
        let (speed, slope, course) = (85.0, 12.0_f64.to_radians(), (-70.0_f64).to_radians());
        let expected = Vector3::new(
            speed * slope.cos() * course.cos(),
            speed * slope.cos() * course.sin(),
            2.0 - speed * slope.sin(),
        );
        assert!((end - expected).norm() < 1e-9, "{end}");
    }

    #[test]
    fn a_turn_is_coordinated() {
        let motion = Motion::level(0.0, 100.0).turn(0.0, 40.0, 90.0, 10.0);
        let now = motion.at(20.0);
        let force_n = now.v_eb_n_rate - Vector3::z() * GRAVITY_MPS2;
        let force_b = now.c_n_b.transpose() * force_n;
        assert!(force_b.y.abs() < 1e-12, "{force_b}");
        assert!(libm::atan2(now.c_n_b[(2, 1)], now.c_n_b[(2, 2)]) > 0.4);
    }
}
