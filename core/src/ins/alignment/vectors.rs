//! Attitude from two directions known in both axes, and how well.
//!
//! In: the specific force f and a second vector a (rotation of the Earth, magnetic field) as measured in
//! body axes and as they are in north, east, down. Out: the rotation from body to north, east, down, and
//! one sigma about each of these.
//!
//! | symbol | code          | shape | unit | frame | meaning                                            |
//! |--------|---------------|-------|------|-------|----------------------------------------------------|
//! | f      | `force_*`     | 3     | m/s² | b, n  | specific force; up when at rest                    |
//! | a      | `second_*`    | 3     | any  | b, n  | second vector                                      |
//! | u      | `u`           | 3     | 1    | n     | f over its length                                  |
//! | a_∥, a_⊥ | `along`, `across` | 1 | as a |      | parts of a along u and across it                   |
//! | σ_l    | `sigma_level_rad` | 1 | rad  |       | error of the direction of f about any axis across u |
//! | σ_a    | `sigma_second`    | 1 | as a |       | error of a, per axis                               |
//! | σ_u    | `sigma_about_u`   | 1 | rad  |       | error about u: of the heading when u is vertical   |
//!
//! f is taken to be exact, and a turns the body about it: the triad u, u×a, u×(u×a) in both axes
//! (the method known as TRIAD, [BLACK-1964]). What a says beside its direction about u is not used
//! for the attitude, but is what tells whether a is what it is taken for. Errors, derived here: an error of a
//! across u and across a_⊥ turns by σ_a/a_⊥; a tilt about the direction of a_⊥ turns a_∥ into it, by
//! a_∥/a_⊥ of the tilt:
//!
//! σ_u² = (σ_a/a_⊥)² + (a_∥/a_⊥)² σ_l²; about axis i of n: σ_i² = σ_l² (1 − u_i²) + σ_u² u_i².
//!
//! With the rotation of the Earth a_⊥ = Ω cos φ and a_∥/a_⊥ = tan φ: gyrocompassing.

use nalgebra::{Matrix3, Vector3};

/// A pair of vectors, each as measured and as it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pairs {
    pub force_b: Vector3<f64>,
    pub force_n: Vector3<f64>,
    pub sigma_level_rad: f64,
    pub second_b: Vector3<f64>,
    pub second_n: Vector3<f64>,
    pub sigma_second: f64,
}

/// How far the second vector is from what it is taken for: both are zero but for errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mismatch {
    /// Length as measured minus as it is, over one sigma.
    pub length_sigmas: f64,
    /// The angle between both vectors, as measured minus as it is, over one sigma.
    pub angle_sigmas: f64,
}

impl Mismatch {
    /// Whether both are within so many sigmas; what is no number is not.
    pub(super) fn is_within(&self, sigmas: f64) -> bool {
        libm::fabs(self.length_sigmas) <= sigmas && libm::fabs(self.angle_sigmas) <= sigmas
    }
}

/// Axes along the first, across both, and across these; `None` where the two are of one direction.
fn triad(first: &Vector3<f64>, second: &Vector3<f64>) -> Option<Matrix3<f64>> {
    let x = first / first.norm();
    let across = first.cross(second);
    let length = across.norm();
    if !(length > 1e-9 * first.norm() * second.norm()) {
        return None;
    }
    let y = across / length;
    Some(Matrix3::from_columns(&[x, y, x.cross(&y)]))
}

impl Pairs {
    /// C^n_b; `None` where the vectors have no directions, or one.
    pub(super) fn c_n_b(&self) -> Option<Matrix3<f64>> {
        let in_n = triad(&self.force_n, &self.second_n)?;
        let in_b = triad(&self.force_b, &self.second_b)?;
        Some(in_n * in_b.transpose())
    }

    fn along_and_across(&self) -> (f64, f64) {
        let u = self.force_n / self.force_n.norm();
        let along = self.second_n.dot(&u);
        (along, (self.second_n - u * along).norm())
    }

    /// One sigma about the specific force, rad: of the heading, near enough.
    pub(super) fn sigma_about_force_rad(&self) -> f64 {
        let (along, across) = self.along_and_across();
        libm::hypot(self.sigma_second, along * self.sigma_level_rad) / across
    }

    /// What the second vector says beside its direction about the first.
    pub(super) fn mismatch(&self) -> Mismatch {
        let length = self.second_n.norm();
        let angle = |f: &Vector3<f64>, a: &Vector3<f64>| libm::atan2(f.cross(a).norm(), f.dot(a));
        let angle_rad = angle(&self.force_b, &self.second_b) - angle(&self.force_n, &self.second_n);
        let sigma_angle_rad = libm::hypot(self.sigma_second / length, self.sigma_level_rad);
        Mismatch {
            length_sigmas: (self.second_b.norm() - length) / self.sigma_second,
            angle_sigmas: angle_rad / sigma_angle_rad,
        }
    }
}

/// One sigma about north, east, down from those about axes across a direction, and about it.
pub(super) fn sigma_ned_rad(
    force_n: &Vector3<f64>,
    sigma_level_rad: f64,
    sigma_about_u: f64,
) -> [f64; 3] {
    let u = force_n / force_n.norm();
    let of = |part: f64| {
        let share = part * part;
        libm::sqrt(
            sigma_level_rad * sigma_level_rad * (1.0 - share)
                + sigma_about_u * sigma_about_u * share,
        )
    };
    [of(u.x), of(u.y), of(u.z)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::rotation;

    fn pairs(angles: [f64; 3]) -> Pairs {
        let c_b_n = rotation::c_n_b(&angles).transpose();
        let force_n = Vector3::new(0.0, 0.0, -9.8);
        let second_n = Vector3::new(20.0, 1.0, 40.0);
        Pairs {
            force_b: c_b_n * force_n,
            force_n,
            sigma_level_rad: 0.01,
            second_b: c_b_n * second_n,
            second_n,
            sigma_second: 0.3,
        }
    }

    fn error_n(pairs: &Pairs, angles: [f64; 3]) -> Vector3<f64> {
        let c = pairs.c_n_b().unwrap() * rotation::c_n_b(&angles).transpose();
        let [_, x, y, z] = rotation::from_matrix(&c).unwrap();
        Vector3::new(2.0 * x, 2.0 * y, 2.0 * z)
    }

    const ATTITUDES: [[f64; 3]; 4] = [
        [0.0, 0.0, 0.0],
        [0.3, -0.2, 2.0],
        [3.0, 1.5, -1.0],
        [-1.0, -1.55, 0.1],
    ];

    #[test]
    fn two_directions_give_any_attitude() {
        for angles in ATTITUDES {
            assert!(error_n(&pairs(angles), angles).norm() < 1e-12);
        }
    }

    /// The errors by which sigmas are said to turn the attitude do turn it.
    #[test]
    fn sigmas_are_what_errors_do() {
        for angles in ATTITUDES {
            let right = pairs(angles);
            let c_b_n = rotation::c_n_b(&angles).transpose();
            let across_n: Vector3<f64> = Vector3::new(20.0, 1.0, 0.0);
            let sideways_n = Vector3::new(-1.0, 20.0, 0.0).normalize();
            let mut wrong = right;
            wrong.second_b += c_b_n * sideways_n * 1e-3;
            let by_second = error_n(&wrong, angles);
            assert!((by_second.norm() * across_n.norm() / 1e-3 - 1.0).abs() < 1e-3);
            let mut wrong = right;
            // A force off along `sideways` is a tilt about the direction of the field's level part.
            wrong.force_b += c_b_n * sideways_n * 9.8e-4;
            let by_tilt = error_n(&wrong, angles);
            let expected = 1e-4 * 40.0 / across_n.norm();
            assert!((by_tilt.z.abs() / expected - 1.0).abs() < 1e-3, "{by_tilt}");
            let sigma = right.sigma_about_force_rad();
            let (a, b) = (0.3 / across_n.norm(), 0.01 * 40.0 / across_n.norm());
            assert!((sigma - a.hypot(b)).abs() < 1e-12);
        }
    }

    #[test]
    fn a_vector_of_another_length_or_angle_does_not_match() {
        let right = pairs([0.1, 0.2, 0.3]).mismatch();
        assert!(right.length_sigmas.abs() < 1e-9 && right.angle_sigmas.abs() < 1e-9);
        let mut longer = pairs([0.1, 0.2, 0.3]);
        longer.second_b *= 1.1;
        assert!(longer.mismatch().length_sigmas > 10.0);
        assert!(longer.mismatch().angle_sigmas.abs() < 1e-9);
        let mut steeper = pairs([0.1, 0.2, 0.3]);
        steeper.second_n.z -= 10.0;
        assert!(steeper.mismatch().angle_sigmas.abs() > 5.0);
    }

    #[test]
    fn directions_that_are_none_give_no_attitude() {
        for spoilt in [f64::NAN, f64::INFINITY, 0.0] {
            let mut pairs = pairs([0.1, 0.2, 0.3]);
            pairs.second_b *= spoilt;
            assert!(pairs.c_n_b().is_none(), "{spoilt}");
        }
        let mut one = pairs([0.0; 3]);
        one.second_n = one.force_n * 3.0;
        assert!(one.c_n_b().is_none());
    }

    #[test]
    fn sigmas_turn_with_the_force() {
        let level = sigma_ned_rad(&Vector3::new(0.0, 0.0, -9.8), 0.01, 0.1);
        assert!((level[0] - 0.01).abs() < 1e-15 && (level[2] - 0.1).abs() < 1e-15);
        let banked = sigma_ned_rad(&Vector3::new(0.0, 9.8, -9.8), 0.01, 0.1);
        assert!((banked[1] - banked[2]).abs() < 1e-15 && banked[1] > 0.07);
    }
}
