//! The true track of a flight, and what a perfect inertial unit aboard would measure.
//!
//! In: the motion as a function of time, the place it passes at one instant. Out: the state at any
//! instant, and the integrals of angular rate and specific force over each sample interval.
//!
//! | symbol | code | unit | frame | meaning |
//! |---|---|---|---|---|
//! | L, λ, h | `Place` | rad, rad, m | | geodetic position |
//! | ω^b_ib | omega_ib_b | rad/s | b | angular rate against inertial space |
//! | f^b | f_ib_b | m/s² | b | specific force |
//!
//! Position: L' = v_N/(R_M + h), λ' = v_E/((R_N + h) cos L), h' = −v_D by fourth-order Runge-Kutta, one
//! step per sample. ω^b_ib = C^b_n (ω^n_ie + ω^n_en) + ω^b_nb and
//! f^b = C^b_n (v' + (2 ω^n_ie + ω^n_en) × v − g^n) are exact at an instant; their integrals are Gauss
//! quadratures with four nodes, exact to the seventh degree in time.

use nalgebra::{Matrix3, Vector3};

use super::earth::{OMEGA_IE_RADPS, frame, gravity_e, radii_m};
use super::motion::Motion;

/// Nodes and weights of Gauss-Legendre quadrature on (0, 1), four nodes. [AS] table 25.4.
const GAUSS: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// Latitude, longitude, rad, and ellipsoidal height, m.
pub type Place = Vector3<f64>;

/// Where a flight is at one instant.
#[derive(Clone, Copy, Debug)]
pub struct Anchor {
    /// When, s, a whole number.
    pub at_s: u32,
    /// Latitude, degrees.
    pub latitude_deg: f64,
    /// Longitude, degrees.
    pub longitude_deg: f64,
    /// Ellipsoidal height, m.
    pub height_m: f64,
}

/// True state at an instant, Earth-fixed axes.
#[derive(Clone, Copy, Debug)]
pub struct State {
    /// Position, m.
    pub r_eb_e: Vector3<f64>,
    /// Velocity over the Earth, m/s.
    pub v_eb_e: Vector3<f64>,
    /// Rotation from body to Earth-fixed axes.
    pub c_e_b: Matrix3<f64>,
    /// Rotation from north, east, down to Earth-fixed axes.
    pub c_e_n: Matrix3<f64>,
}

/// A flight's true track.
#[derive(Clone, Debug)]
pub struct Trajectory {
    motion: Motion,
    rate_hz: u32,
    /// At every sample instant, the first at 0.
    places: Vec<Place>,
}

impl Trajectory {
    /// Integrates the position from the anchor back to the start and on to `end_s`.
    pub fn new(motion: Motion, anchor: &Anchor, end_s: u32, rate_hz: u32) -> Self {
        let samples = (end_s.max(anchor.at_s) * rate_hz) as usize;
        let anchored = (anchor.at_s * rate_hz) as usize;
        let mut places = vec![Place::zeros(); samples + 1];
        places[anchored] = Place::new(
            anchor.latitude_deg.to_radians(),
            anchor.longitude_deg.to_radians(),
            anchor.height_m,
        );
        let time_s = |k: usize| k as f64 / f64::from(rate_hz);
        for k in (0..anchored).rev() {
            places[k] = advance(&motion, &places[k + 1], time_s(k + 1), time_s(k));
        }
        for k in anchored..samples {
            places[k + 1] = advance(&motion, &places[k], time_s(k), time_s(k + 1));
        }
        Self {
            motion,
            rate_hz,
            places,
        }
    }

    /// Instant of sample `k`, s.
    pub fn time_s(&self, k: usize) -> f64 {
        k as f64 / f64::from(self.rate_hz)
    }

    fn place(&self, t_s: f64) -> Place {
        let nearest = libm::round(t_s * f64::from(self.rate_hz));
        // Casting saturates at 0.
        let k = (nearest as usize).min(self.places.len() - 1);
        advance(&self.motion, &self.places[k], self.time_s(k), t_s)
    }

    /// The true state at `t_s`.
    pub fn state(&self, t_s: f64) -> State {
        let place = self.place(t_s);
        let (r_eb_e, c_e_n) = frame(place.x, place.y, place.z);
        let now = self.motion.at(t_s);
        State {
            r_eb_e,
            v_eb_e: c_e_n * now.v_eb_n,
            c_e_b: c_e_n * now.c_n_b,
            c_e_n,
        }
    }

    /// Integrals of angular rate, rad, and specific force, m/s, over the interval that ends at sample
    /// `k`, from 1 on; body axes, which turn.
    pub fn increments(&self, k: usize) -> (Vector3<f64>, Vector3<f64>) {
        let (from_s, interval_s) = (self.time_s(k - 1), 1.0 / f64::from(self.rate_hz));
        let (from, to) = (self.places[k - 1], self.places[k]);
        let (mut dtheta, mut dv) = (Vector3::zeros(), Vector3::zeros());
        for (node, weight) in GAUSS {
            // Between samples the place is needed for gravity and curvature only: a chord does.
            let place = from + (to - from) * node;
            let (omega_ib_b, f_ib_b) = self.sensed(from_s + node * interval_s, &place);
            dtheta += omega_ib_b * (weight * interval_s);
            dv += f_ib_b * (weight * interval_s);
        }
        (dtheta, dv)
    }

    /// The same between any two instants, for a unit at `arm_b_m` from the body point.
    pub fn increments_at(
        &self,
        from_s: f64,
        to_s: f64,
        arm_b_m: &Vector3<f64>,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let interval_s = to_s - from_s;
        let (from, to) = (self.place(from_s), self.place(to_s));
        let (mut dtheta, mut dv) = (Vector3::zeros(), Vector3::zeros());
        for (node, weight) in GAUSS {
            let place = from + (to - from) * node;
            let (omega_ib_b, f_ib_b) = self.sensed(from_s + node * interval_s, &place);
            let turning = omega_ib_b.cross(&omega_ib_b.cross(arm_b_m));
            dtheta += omega_ib_b * (weight * interval_s);
            dv += (f_ib_b + turning) * (weight * interval_s);
        }
        if arm_b_m.norm_squared() > 0.0 {
            let (before, _) = self.sensed(from_s, &from);
            let (after, _) = self.sensed(to_s, &to);
            dv += (after - before).cross(arm_b_m);
        }
        (dtheta, dv)
    }

    /// Angular rate against inertial space, rad/s, and specific force, m/s², body axes.
    fn sensed(&self, t_s: f64, place: &Place) -> (Vector3<f64>, Vector3<f64>) {
        let now = self.motion.at(t_s);
        let (r_e, c_e_n) = frame(place.x, place.y, place.z);
        let (sin_lat, cos_lat) = (libm::sin(place.x), libm::cos(place.x));
        let (meridian_m, normal_m) = radii_m(sin_lat);
        let v = now.v_eb_n;
        let omega_ie_n = Vector3::new(OMEGA_IE_RADPS * cos_lat, 0.0, -OMEGA_IE_RADPS * sin_lat);
        let east_rate = v.y / (normal_m + place.z);
        let omega_en_n = Vector3::new(
            east_rate,
            -v.x / (meridian_m + place.z),
            -east_rate * sin_lat / cos_lat,
        );
        let c_b_n = now.c_n_b.transpose();
        let gravity_n = c_e_n.transpose() * gravity_e(&r_e);
        let f_ib_n = now.v_eb_n_rate + (omega_ie_n * 2.0 + omega_en_n).cross(&v) - gravity_n;
        (
            c_b_n * (omega_ie_n + omega_en_n) + now.omega_nb_b,
            c_b_n * f_ib_n,
        )
    }
}

/// Rates of latitude, longitude and height.
fn place_rate(motion: &Motion, place: &Place, t_s: f64) -> Vector3<f64> {
    let v = motion.velocity_n(t_s);
    let (meridian_m, normal_m) = radii_m(libm::sin(place.x));
    Vector3::new(
        v.x / (meridian_m + place.z),
        v.y / ((normal_m + place.z) * libm::cos(place.x)),
        -v.z,
    )
}

/// One Runge-Kutta step of the position, forwards or backwards.
fn advance(motion: &Motion, place: &Place, from_s: f64, to_s: f64) -> Place {
    let step_s = to_s - from_s;
    let middle_s = from_s + step_s / 2.0;
    let k1 = place_rate(motion, place, from_s);
    let k2 = place_rate(motion, &(place + k1 * (step_s / 2.0)), middle_s);
    let k3 = place_rate(motion, &(place + k2 * (step_s / 2.0)), middle_s);
    let k4 = place_rate(motion, &(place + k3 * step_s), to_s);
    place + (k1 + (k2 + k3) * 2.0 + k4) * (step_s / 6.0)
}

/// The unit quaternion of a rotation, scalar first and not negative.
pub fn quaternion(c: &Matrix3<f64>) -> [f64; 4] {
    let trace = c.trace();
    // The largest of the four is found first, so that nothing is divided by a small number.
    let squares = [
        trace,
        2.0 * c[(0, 0)] - trace,
        2.0 * c[(1, 1)] - trace,
        2.0 * c[(2, 2)] - trace,
    ];
    let largest = (1..4).fold(
        0,
        |best, k| if squares[k] > squares[best] { k } else { best },
    );
    let root = libm::sqrt(1.0 + squares[largest]);
    let (own, other) = (root / 2.0, 0.5 / root);
    let differences = [
        c[(2, 1)] - c[(1, 2)],
        c[(0, 2)] - c[(2, 0)],
        c[(1, 0)] - c[(0, 1)],
    ];
    let mut q = [0.0; 4];
    q[largest] = own;
    if largest == 0 {
        for k in 0..3 {
            q[k + 1] = differences[k] * other;
        }
    } else {
        let i = largest - 1;
        q[0] = differences[i] * other;
        for k in (0..3).filter(|k| *k != i) {
            q[k + 1] = (c[(i, k)] + c[(k, i)]) * other;
        }
    }
    if q[0] < 0.0 { q.map(|v| -v) } else { q }
}

/// The rotation of a unit quaternion, scalar first.
pub fn matrix(q: &[f64; 4]) -> Matrix3<f64> {
    let [w, x, y, z] = *q;
    let skew = Vector3::new(x, y, z).cross_matrix();
    Matrix3::identity() + (skew * w + skew * skew) * 2.0
}

/// The rotation by a vector of angles, rad.
pub fn rotation(angle: &Vector3<f64>) -> Matrix3<f64> {
    let size = angle.norm();
    let skew = angle.cross_matrix();
    if size < 1e-12 {
        return Matrix3::identity() + skew;
    }
    let half = libm::sin(size / 2.0) / (size / 2.0);
    Matrix3::identity() + skew * (libm::sin(size) / size) + skew * skew * (0.5 * half * half)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example(rate_hz: u32) -> Trajectory {
        let motion = Motion::level(70.0, 90.0)
            .turn(3.0, 23.0, 100.0, 4.0)
            .slope(5.0, 11.0, -8.0);
        let anchor = Anchor {
            at_s: 20,
            latitude_deg: -41.0,
            longitude_deg: 174.8,
            height_m: 900.0,
        };
        Trajectory::new(motion, &anchor, 30, rate_hz)
    }

    #[test]
    fn the_track_passes_its_anchor_whatever_the_rate() {
        let (coarse, fine) = (example(50), example(400));
        let (r_e, _) = frame((-41.0_f64).to_radians(), 174.8_f64.to_radians(), 900.0);
        assert!((coarse.state(20.0).r_eb_e - r_e).norm() < 1e-8);
        for k in 0..300 {
            let t_s = 0.1 * f64::from(k) + 0.0123;
            let apart = coarse.state(t_s).r_eb_e - fine.state(t_s).r_eb_e;
            assert!(apart.norm() < 1e-6, "{} at {t_s}", apart.norm());
        }
    }

    #[test]
    fn velocity_is_the_rate_of_position() {
        let track = example(100);
        for k in 1..300 {
            let t_s = 0.1 * f64::from(k);
            let rate = (track.state(t_s + 0.001).r_eb_e - track.state(t_s - 0.001).r_eb_e) / 0.002;
            assert!((rate - track.state(t_s).v_eb_e).norm() < 1e-5);
        }
    }

    #[test]
    fn a_quaternion_turns_as_its_matrix() {
        for axis in [
            Vector3::new(0.1, 0.2, -0.3),
            Vector3::new(3.1, 0.2, 0.1),
            Vector3::new(-0.2, 3.0, 0.3),
            Vector3::new(0.3, -0.1, -3.1),
            Vector3::new(0.0, 0.0, 1e-14),
        ] {
            let c = rotation(&axis);
            assert!((c * c.transpose() - Matrix3::identity()).norm() < 1e-14);
            let [w, x, y, z] = quaternion(&c);
            assert!(w >= 0.0 && (w * w + x * x + y * y + z * z - 1.0).abs() < 1e-14);
            let v = Vector3::new(x, y, z);
            let probe = Vector3::new(0.3, -0.7, 1.9);
            let turned = probe + (v.cross(&probe) * w + v.cross(&v.cross(&probe))) * 2.0;
            assert!((turned - c * probe).norm() < 1e-14);
            assert!((matrix(&[w, x, y, z]) - c).norm() < 1e-14);
        }
    }

    /// Standing still, an inertial unit feels the turning Earth and its support.
    #[test]
    fn at_rest_the_unit_senses_earth_rate_and_gravity() {
        let anchor = Anchor {
            at_s: 0,
            latitude_deg: 31.0,
            longitude_deg: 121.0,
            height_m: 16.0,
        };
        let track = Trajectory::new(Motion::level(0.0, 0.0), &anchor, 1, 100);
        let (dtheta, dv) = track.increments(7);
        let latitude = 31.0_f64.to_radians();
        let omega = Vector3::new(latitude.cos(), 0.0, -latitude.sin()) * OMEGA_IE_RADPS;
        assert!((dtheta - omega * 0.01).norm() < 1e-18);
        assert!((dv.z + 0.0979).abs() < 1e-4 && dv.x.abs() < 1e-6 && dv.y.abs() < 1e-12);
    }
}
