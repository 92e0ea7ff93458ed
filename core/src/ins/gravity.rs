//! Gravity at a place, and how it changes with the place.
//!
//! In: a position in ECEF axes. Out: gravity there (gravitation and centrifugal acceleration of the
//! turning Earth), and its gradient.
//!
//! | symbol | code             | shape | unit  | frame | meaning                                     |
//! |--------|------------------|-------|-------|-------|---------------------------------------------|
//! | r      | `r_e`            | 3     | m     | e     | position from the centre of the Earth       |
//! | g      | `gravity_e`      | 3     | m/s²  | e     | gravitation + centrifugal                   |
//! | Γ      | `gravity_gradient_e` | 3 × 3 | 1/s² | e  | ∂g/∂r of a point mass, + centrifugal        |
//! | μ, J₂, a, ω | `WGS84_*`   |       |       |       | of the Earth: `consts.rs`                   |
//!
//! Equations: gravitation of the ellipsoid to J₂ [GROVES-2013] chapter 2 → [`gravity_e`]; [P0] (6) with
//! the full gradient of the point mass → [`gravity_gradient_e`]. Keys: docs/references.md.
//! Accuracy: 1.2e-4 m/s² of normal gravity (terms beyond J₂); the gradient leaves J₂ out, 0.3 % of itself.
//! Assumes: r is not within a metre of the centre; there the results are not finite.

use crate::consts::{OMEGA_EARTH_WGS84_RADPS, WGS84_A_M, WGS84_J2, WGS84_MU};
use nalgebra::{Matrix3, Vector3};

/// ω².
const OMEGA2: f64 = OMEGA_EARTH_WGS84_RADPS * OMEGA_EARTH_WGS84_RADPS;
/// 3/2 J₂ a², m².
const J2_A2_M2: f64 = 1.5 * WGS84_J2 * WGS84_A_M * WGS84_A_M;

/// Gravity, m/s². [GROVES-2013]
pub fn gravity_e(r_e: &Vector3<f64>) -> Vector3<f64> {
    let (x, y, z) = (r_e.x, r_e.y, r_e.z);
    let z2 = z * z;
    let inverse_r2 = 1.0 / (x * x + y * y + z2);
    let by_r3 = -WGS84_MU * inverse_r2 * libm::sqrt(inverse_r2);
    let j2 = J2_A2_M2 * inverse_r2;
    let five_sin2 = 5.0 * z2 * inverse_r2;
    let equatorial = by_r3 * (1.0 + j2 * (1.0 - five_sin2)) + OMEGA2;
    let polar = by_r3 * (1.0 + j2 * (3.0 - five_sin2));
    Vector3::new(equatorial * x, equatorial * y, polar * z)
}

/// Gradient of gravity, 1/s²: the point mass and the centrifugal part. [P0] (6)
pub fn gravity_gradient_e(r_e: &Vector3<f64>) -> Matrix3<f64> {
    let (x, y, z) = (r_e.x, r_e.y, r_e.z);
    let inverse_r2 = 1.0 / (x * x + y * y + z * z);
    let by_r3 = WGS84_MU * inverse_r2 * libm::sqrt(inverse_r2);
    let three = 3.0 * by_r3 * inverse_r2;
    let (xy, xz, yz) = (three * x * y, three * x * z, three * y * z);
    Matrix3::new(
        three * x * x - by_r3 + OMEGA2,
        xy,
        xz,
        xy,
        three * y * y - by_r3 + OMEGA2,
        yz,
        xz,
        yz,
        three * z * z - by_r3,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::geodesy::{Llh, c_enu_e, to_ecef};

    #[test]
    fn gravity_is_normal_gravity_on_the_ellipsoid() {
        // Somigliana with the constants of [NGA.STND.0036]: 9.7803253359 at the equator,
        // 9.8321849379 at the poles.
        for lat_deg in [0.0, 20.0, 45.0, 70.0, 90.0_f64] {
            let lat_rad = lat_deg.to_radians();
            let r_e = to_ecef(&Llh {
                lat_rad,
                lon_rad: 1.0,
                height_m: 0.0,
            });
            let sin2 = libm::sin(lat_rad) * libm::sin(lat_rad);
            let normal = 9.780_325_335_9 * (1.0 + 0.001_931_852_652_41 * sin2)
                / libm::sqrt(1.0 - 0.006_694_379_990_14 * sin2);
            let g_enu = c_enu_e(lat_rad, 1.0) * gravity_e(&r_e);
            std::println!("{lat_deg} deg: {:e} {:e}", g_enu.z + normal, g_enu.y);
            assert!((g_enu.z + normal).abs() < 1.3e-4);
            assert!(g_enu.x.abs() < 1e-12 && g_enu.y.abs() < 1.3e-4);
        }
    }

    #[test]
    fn gradient_is_the_derivative_but_for_the_flattening() {
        let r_e = Vector3::new(-2_161_838.0, 4_383_811.0, 4_083_887.0);
        let gradient = gravity_gradient_e(&r_e);
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            let step = 100.0 * axis;
            let slope = (gravity_e(&(r_e + step)) - gravity_e(&(r_e - step))) / 200.0;
            // μ/r³ is 1.5e-6 1/s²; J₂ adds less than a hundredth of it.
            assert!((gradient * axis - slope).norm() < 1.5e-8);
        }
        assert!((gradient.trace() - 2.0 * OMEGA2).abs() < 1e-20);
    }
}
