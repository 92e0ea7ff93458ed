//! A truth to fly along: smooth motion, and the increments perfect sensors would give.

use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::reference::earth::{OMEGA, c_e_ned, gravity, omega_ie};
use crate::reference::strapdown::{Increment, Nominal, Strapdown, rotation};

/// What a flight does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Stands still on the ground, level, nose north-east.
    Static,
    /// Turns slowly: 2 m/s, once around in ten minutes.
    Circling,
    /// Banked turns, climbs and changes of speed at about 80 m/s.
    Manoeuvres,
}

/// Velocity north, east, down (m/s) and roll, pitch, heading (rad) at a time.
fn profile(motion: Motion, t_s: f64) -> (Vector3<f64>, [f64; 3]) {
    let turns = |period_s: f64| std::f64::consts::TAU / period_s;
    match motion {
        Motion::Static => (Vector3::zeros(), [0.0, 0.0, 0.8]),
        Motion::Circling => {
            let heading = turns(600.0) * t_s;
            let v = 2.0 * Vector3::new(heading.cos(), heading.sin(), 0.0);
            (v, [0.0, 0.0, heading])
        }
        Motion::Manoeuvres => {
            let (a, b, c) = (turns(60.0), turns(45.0), turns(40.0));
            let heading = 0.8 * (a * t_s).sin();
            let heading_rate = 0.8 * a * (a * t_s).cos();
            let climb = 5.0 * (b * t_s).sin();
            let speed = 80.0 + 10.0 * (c * t_s).sin();
            let roll = (speed * heading_rate / 9.8).atan();
            let pitch = (climb / speed).atan();
            let v = Vector3::new(speed * heading.cos(), speed * heading.sin(), -climb);
            (v, [roll, pitch, heading])
        }
    }
}

fn c_ned_b([roll, pitch, heading]: [f64; 3]) -> Matrix3<f64> {
    Rotation3::from_euler_angles(roll, pitch, heading).into_inner()
}

/// The rotation vector of a small rotation matrix.
pub fn rotation_vector(c: &Matrix3<f64>) -> Vector3<f64> {
    let twice_sine = Vector3::new(
        c[(2, 1)] - c[(1, 2)],
        c[(0, 2)] - c[(2, 0)],
        c[(1, 0)] - c[(0, 1)],
    );
    let sine = twice_sine.norm() / 2.0;
    let angle = sine.atan2((c.trace() - 1.0) / 2.0);
    // The first term left out of the series is angle⁴ · 7/360.
    let stretch = if angle < 1e-3 {
        1.0 + angle * angle / 6.0
    } else {
        angle / sine
    };
    twice_sine * (stretch / 2.0)
}

/// A flight in progress.
#[derive(Clone, Debug)]
pub struct Flight {
    motion: Motion,
    strapdown: Strapdown,
    /// Time since the start, s.
    pub t_s: f64,
    frame: Matrix3<f64>,
    frame_t_s: f64,
}

/// Longest use of one local frame, s; in between it would turn by 1e-5 rad at most.
const FRAME_AGE_S: f64 = 1.0;

impl Flight {
    /// Starts at 40° north, 100 m high.
    pub fn new(motion: Motion) -> Self {
        let r = Vector3::new(3_000_000.0, 3_860_000.0, 4_080_000.0);
        let frame = c_e_ned(&r);
        let (v, angles) = profile(motion, 0.0);
        Self {
            motion,
            strapdown: Strapdown::new(Nominal {
                r,
                v: frame * v,
                c: frame * c_ned_b(angles),
                bg: Vector3::zeros(),
                ba: Vector3::zeros(),
                clock: [0.0; 2],
            }),
            t_s: 0.0,
            frame,
            frame_t_s: 0.0,
        }
    }

    /// Where it truly is; biases and clock are 0.
    pub fn truth(&self) -> &Nominal {
        &self.strapdown.nominal
    }

    /// Flies on for `dt`; what perfect sensors integrated over it. The truth is what the strapdown
    /// equations make of these increments, so that their form costs no error.
    pub fn step(&mut self, dt: f64) -> Increment {
        if self.t_s - self.frame_t_s >= FRAME_AGE_S {
            self.frame = c_e_ned(&self.strapdown.nominal.r);
            self.frame_t_s = self.t_s;
        }
        let now = &self.strapdown.nominal;
        let (v, angles) = profile(self.motion, self.t_s + dt);
        let wanted = self.frame * c_ned_b(angles);
        let turned = rotation(Vector3::new(0.0, 0.0, OMEGA * dt)) * wanted;
        let free = gravity(&now.r) - 2.0 * omega_ie().cross(&now.v);
        let increment = Increment {
            dtheta: rotation_vector(&(now.c.transpose() * turned)),
            dv: now.c.transpose() * (self.frame * v - now.v - free * dt),
            dt,
        };
        self.strapdown.step(&increment);
        self.t_s += dt;
        increment
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flight_keeps_to_its_profile() {
        for motion in [Motion::Static, Motion::Circling, Motion::Manoeuvres] {
            let mut flight = Flight::new(motion);
            for _ in 0..3000 {
                flight.step(0.01);
            }
            let truth = flight.truth();
            let frame = c_e_ned(&truth.r);
            let (v, angles) = profile(motion, flight.t_s);
            assert!((frame.transpose() * truth.v - v).norm() < 0.02);
            let error = frame.transpose() * truth.c * c_ned_b(angles).transpose();
            assert!(rotation_vector(&error).norm() < 1e-3, "{motion:?}");
        }
    }

    #[test]
    fn rotation_vectors_come_back() {
        for size in [1e-9, 1e-4, 0.9e-3, 1.1e-3, 0.3, 3.0] {
            let phi = Vector3::new(0.6, -0.64, 0.48) * size;
            assert!((rotation_vector(&rotation(phi)) - phi).norm() < 1e-13 * (1.0 + size));
        }
    }
}
