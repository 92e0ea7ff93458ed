//! Rotations: quaternions, matrices, and roll, pitch, heading.
//!
//! In and out: rotations in one of these forms. A quaternion is `[w, x, y, z]`, scalar first; q_to_from
//! and C_to_from take a vector of the axes `from` to the same vector in the axes `to`:
//! v_e = C(q_e_b) v_b. Turning twice multiplies in the same order, C(p q) = C(p) C(q).
//!
//! | symbol | code       | shape | unit | meaning                                                     |
//! |--------|------------|-------|------|-------------------------------------------------------------|
//! | q      | `q`        | 4     | 1    | unit quaternion (cos φ/2, sin φ/2 · axis)                   |
//! | φ      | `phi`      | 3     | rad  | rotation vector: the axis times the angle                   |
//! | C      | `c_to_from`| 3 × 3 | 1    | rotation matrix                                             |
//! | φ, θ, ψ|            | 3     | rad  | roll, pitch, heading: C_n_b = C_3(ψ)ᵀ C_2(θ)ᵀ C_1(φ)ᵀ       |
//!
//! Equations: quaternion, matrix and angles of attitude [GROVES-2013], chapter 2; the branch with the
//! largest divisor [SHEPPERD-1978] → [`from_matrix`]. Keys: docs/references.md.
//! Accuracy: the series of [`from_rotation_vector`] ends below the rounding of its sum.

use super::geodesy;
use nalgebra::{Matrix3, Vector3};

/// Quaternion, scalar first.
pub type Quaternion = [f64; 4];

/// No rotation.
pub const IDENTITY: Quaternion = [1.0, 0.0, 0.0, 0.0];

/// Square of the longest rotation vector whose sine and cosine are taken from the series, rad²: half
/// a radian, which one sample turns at 50 rad/s and 100 Hz. Beyond it libm is called.
pub(crate) const MAX_SERIES_ANGLE_SQUARED: f64 = 0.25;

/// The product p q: first q, then p.
pub fn product(p: &Quaternion, q: &Quaternion) -> Quaternion {
    let ([pw, px, py, pz], [qw, qx, qy, qz]) = (*p, *q);
    [
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    ]
}

/// The rotation about the axis of `phi` by its length, rad.
pub fn from_rotation_vector(phi: &Vector3<f64>) -> Quaternion {
    let angle_squared = phi.x * phi.x + phi.y * phi.y + phi.z * phi.z;
    let (cosine, sine_by_angle) = if angle_squared <= MAX_SERIES_ANGLE_SQUARED {
        // x is half the angle, at most 1/4: the first terms left out are below 1.3e-16 and 1e-17.
        let x2 = 0.25 * angle_squared;
        let cosine = 1.0
            - x2 / 2.0
                * (1.0 - x2 / 12.0 * (1.0 - x2 / 30.0 * (1.0 - x2 / 56.0 * (1.0 - x2 / 90.0))));
        let sinc = 1.0
            - x2 / 6.0
                * (1.0 - x2 / 20.0 * (1.0 - x2 / 42.0 * (1.0 - x2 / 72.0 * (1.0 - x2 / 110.0))));
        (cosine, 0.5 * sinc)
    } else {
        let angle = libm::sqrt(angle_squared);
        let (sine, cosine) = libm::sincos(0.5 * angle);
        (cosine, sine / angle)
    };
    [
        cosine,
        sine_by_angle * phi.x,
        sine_by_angle * phi.y,
        sine_by_angle * phi.z,
    ]
}

fn norm_squared(q: &Quaternion) -> f64 {
    let [w, x, y, z] = *q;
    w * w + x * x + y * y + z * z
}

fn scaled(q: &Quaternion, factor: f64) -> Quaternion {
    q.map(|part| part * factor)
}

/// Takes out of a quaternion what rounding added to its length: first order, for lengths within 1e-8
/// of 1.
pub(crate) fn renormalised(q: &Quaternion) -> Quaternion {
    scaled(q, 1.5 - 0.5 * norm_squared(q))
}

/// The quaternion of unit length in the same direction; `None` for one that is not finite or so short
/// or long that its direction is lost.
pub fn normalised(q: &Quaternion) -> Option<Quaternion> {
    let norm_squared = norm_squared(q);
    (norm_squared > 1e-12 && norm_squared < 1e12).then(|| scaled(q, 1.0 / libm::sqrt(norm_squared)))
}

/// The same rotation with a scalar part that is not negative.
pub fn with_positive_scalar(q: &Quaternion) -> Quaternion {
    let [w, ..] = *q;
    if w < 0.0 { q.map(|part| -part) } else { *q }
}

/// Matrix of a unit quaternion.
pub fn to_matrix(q: &Quaternion) -> Matrix3<f64> {
    let [w, x, y, z] = *q;
    let (x2, y2, z2) = (x + x, y + y, z + z);
    let (xx, yy, zz) = (x * x2, y * y2, z * z2);
    let (xy, xz, yz) = (x * y2, x * z2, y * z2);
    let (wx, wy, wz) = (w * x2, w * y2, w * z2);
    Matrix3::new(
        1.0 - (yy + zz),
        xy - wz,
        xz + wy,
        xy + wz,
        1.0 - (xx + zz),
        yz - wx,
        xz - wy,
        yz + wx,
        1.0 - (xx + yy),
    )
}

/// Unit quaternion of a rotation matrix, scalar part not negative. [SHEPPERD-1978]
///
/// The largest of the four parts is taken from the diagonal and divides the others, so that none
/// loses digits. A matrix that is a rotation only to rounding gives a quaternion of unit length; one
/// that is not finite gives `None`. That the matrix is a rotation is for the caller to know.
pub fn from_matrix(c: &Matrix3<f64>) -> Option<Quaternion> {
    let [
        [m11, m21, m31], // columns
        [m12, m22, m32],
        [m13, m23, m33],
    ] = c.data.0;
    let trace = m11 + m22 + m33;
    let q = if trace >= m11 && trace >= m22 && trace >= m33 {
        [1.0 + trace, m32 - m23, m13 - m31, m21 - m12]
    } else if m11 >= m22 && m11 >= m33 {
        [m32 - m23, 1.0 + m11 - m22 - m33, m12 + m21, m13 + m31]
    } else if m22 >= m33 {
        [m13 - m31, m12 + m21, 1.0 + m22 - m11 - m33, m23 + m32]
    } else {
        [m21 - m12, m13 + m31, m23 + m32, 1.0 + m33 - m11 - m22]
    };
    normalised(&q).map(|q| with_positive_scalar(&q))
}

/// Rotation from body to north, east, down axes of roll, pitch and heading, rad.
pub fn c_n_b(roll_pitch_heading_rad: &[f64; 3]) -> Matrix3<f64> {
    let [roll, pitch, heading] = *roll_pitch_heading_rad;
    let (sin_roll, cos_roll) = libm::sincos(roll);
    let (sin_pitch, cos_pitch) = libm::sincos(pitch);
    let (sin_heading, cos_heading) = libm::sincos(heading);
    Matrix3::new(
        cos_pitch * cos_heading,
        sin_roll * sin_pitch * cos_heading - cos_roll * sin_heading,
        cos_roll * sin_pitch * cos_heading + sin_roll * sin_heading,
        cos_pitch * sin_heading,
        sin_roll * sin_pitch * sin_heading + cos_roll * cos_heading,
        cos_roll * sin_pitch * sin_heading - sin_roll * cos_heading,
        -sin_pitch,
        sin_roll * cos_pitch,
        cos_roll * cos_pitch,
    )
}

/// Roll (−π to π), pitch (−π/2 to π/2) and heading (−π to π) of a rotation from body to north, east,
/// down axes, rad. With the nose straight up or down only their sum or difference means anything.
pub fn roll_pitch_heading(c_n_b: &Matrix3<f64>) -> [f64; 3] {
    let [[m11, m21, m31], [_, _, m32], [_, _, m33]] = c_n_b.data.0;
    [
        libm::atan2(m32, m33),
        libm::atan2(-m31, libm::sqrt(m11 * m11 + m21 * m21)),
        libm::atan2(m21, m11),
    ]
}

/// Rotation from north, east, down axes at this latitude and longitude to ECEF axes: its columns are
/// the three unit vectors in ECEF axes.
pub fn c_e_n(lat_rad: f64, lon_rad: f64) -> Matrix3<f64> {
    let [
        [e_x, n_x, u_x], // columns
        [e_y, n_y, u_y],
        [e_z, n_z, u_z],
    ] = geodesy::c_enu_e(lat_rad, lon_rad).data.0;
    Matrix3::new(n_x, e_x, -u_x, n_y, e_y, -u_y, n_z, e_z, -u_z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;

    fn vectors() -> [Vector3<f64>; 6] {
        [
            Vector3::new(1e-9, -2e-9, 3e-10),
            Vector3::new(0.01, 0.0, -0.02),
            Vector3::new(0.2, -0.3, 0.1),
            Vector3::new(-0.4, 0.2, 0.3),
            Vector3::new(1.0, -2.0, 0.5),
            Vector3::new(0.0, 0.0, 3.1),
        ]
    }

    /// exp([φ×]) by its power series.
    fn exponential(phi: &Vector3<f64>) -> Matrix3<f64> {
        let (mut sum, mut term) = (Matrix3::identity(), Matrix3::identity());
        for k in 1..40 {
            term = term * phi.cross_matrix() / f64::from(k);
            sum += term;
        }
        sum
    }

    #[test]
    fn quaternion_of_a_rotation_vector_is_the_matrix_exponential() {
        for phi in vectors() {
            let q = from_rotation_vector(&phi);
            assert!((norm_squared(&q) - 1.0).abs() < 4e-16, "{phi:?}");
            assert!((to_matrix(&q) - exponential(&phi)).norm() < 3e-15 * (1.0 + phi.norm()));
        }
    }

    #[test]
    fn series_and_libm_meet_at_the_bound_to_rounding() {
        for angle in [0.499_999_999, 0.3, 0.1, 0.5] {
            let axis = Vector3::new(0.6, -0.64, 0.48);
            let [w, x, ..] = from_rotation_vector(&(axis * angle));
            let (sine, cosine) = libm::sincos(0.5 * angle);
            assert!((w - cosine).abs() < 2.3e-16 && (x - 0.6 * sine).abs() < 6e-17);
        }
    }

    #[test]
    fn products_of_quaternions_and_of_matrices_agree() {
        for a in vectors() {
            for b in vectors() {
                let (p, q) = (from_rotation_vector(&a), from_rotation_vector(&b));
                let both = to_matrix(&product(&p, &q));
                assert!((both - to_matrix(&p) * to_matrix(&q)).norm() < 2e-15);
            }
        }
    }

    #[test]
    fn a_matrix_comes_back_from_every_branch() {
        let mut branches = [false; 4];
        for axis in [
            Vector3::x(),
            Vector3::y(),
            Vector3::z(),
            Vector3::new(0.6, 0.48, 0.64),
        ] {
            for angle in [0.0, 1e-8, 0.7, 2.0, 3.0, PI, 4.0, 6.0] {
                let q = with_positive_scalar(&from_rotation_vector(&(axis * angle)));
                let back = from_matrix(&to_matrix(&q)).unwrap();
                let largest = q.map(f64::abs).into_iter().fold(0.0, f64::max);
                branches[q.iter().position(|part| part.abs() == largest).unwrap()] = true;
                // At half a turn both signs are the same rotation.
                let dot: f64 = q.iter().zip(back).map(|(a, b)| a * b).sum();
                assert!((dot.abs() - 1.0).abs() < 1e-15, "{axis:?} {angle}");
                assert!((to_matrix(&back) - to_matrix(&q)).norm() < 2e-15);
                assert!(back[0] >= 0.0);
            }
        }
        assert_eq!(branches, [true; 4]);
        assert_eq!(from_matrix(&Matrix3::repeat(f64::NAN)), None);
    }

    #[test]
    fn normalised_refuses_what_has_no_direction() {
        for bad in [[0.0; 4], [f64::NAN, 1.0, 0.0, 0.0], [f64::INFINITY; 4]] {
            assert_eq!(normalised(&bad), None);
        }
        let q = normalised(&[3.0, 0.0, -4.0, 0.0]).unwrap();
        assert!((q[0] - 0.6).abs() < 2e-16 && (q[2] + 0.8).abs() < 2e-16);
        let near = renormalised(&scaled(&q, 1.0 + 1e-9));
        assert!((norm_squared(&near) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn nose_up_wing_down_and_east_have_their_signs() {
        // Heading east: forward is east, right is south.
        let east = c_n_b(&[0.0, 0.0, 0.5 * PI]);
        assert!((east * Vector3::x() - Vector3::y()).norm() < 1e-15);
        assert!((east * Vector3::y() + Vector3::x()).norm() < 1e-15);
        // Pitch positive: the nose points up, down is negative.
        assert!((c_n_b(&[0.0, 0.3, 0.0]) * Vector3::x()).z < -0.29);
        // Roll positive: the right wing points down.
        assert!((c_n_b(&[0.3, 0.0, 0.0]) * Vector3::y()).z > 0.29);
        let angles = [0.3, -1.2, 2.5];
        let back = roll_pitch_heading(&c_n_b(&angles));
        assert!(angles.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-15));
    }

    #[test]
    fn local_axes_are_those_of_geodesy() {
        let (lat, lon) = (0.7, -2.1);
        let c_enu_e = geodesy::c_enu_e(lat, lon);
        let c_e_n = c_e_n(lat, lon);
        assert_eq!(
            c_enu_e * c_e_n * Vector3::z(),
            -(c_enu_e * c_enu_e.transpose() * Vector3::z())
        );
        assert!((c_enu_e * c_e_n * Vector3::x() - Vector3::y()).norm() < 1e-15);
        assert!((c_enu_e * c_e_n * Vector3::y() - Vector3::x()).norm() < 1e-15);
        assert!((c_e_n.determinant() - 1.0).abs() < 1e-15);
    }
}
