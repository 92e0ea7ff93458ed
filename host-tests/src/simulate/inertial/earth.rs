//! The Earth under a simulated flight: ellipsoid, rotation, gravity.
//!
//! Written apart from the receiver's own geodesy and gravity, from the same sources: the ellipsoid of
//! [NGA.STND.0036], gravity with J2 and centrifugal acceleration as scenario folders define it.

use nalgebra::{Matrix3, Vector3};
use surefix_core::consts::{WGS84_A_M, WGS84_F};

/// Rotation of the Earth in scenario folders, rad/s.
pub const OMEGA_IE_RADPS: f64 = 7.292_115e-5;
/// Gravitational constant of the Earth in scenario folders, m³/s².
const MU: f64 = 3.986_004_418e14;
/// Its oblateness.
const J2: f64 = 1.082_627e-3;

/// Radii of curvature in the meridian and the prime vertical, m.
pub fn radii_m(sin_latitude: f64) -> (f64, f64) {
    let e2 = WGS84_F * (2.0 - WGS84_F);
    let w2 = 1.0 - e2 * sin_latitude * sin_latitude;
    let normal_m = WGS84_A_M / libm::sqrt(w2);
    (normal_m * (1.0 - e2) / w2, normal_m)
}

/// Position in Earth-fixed axes, m, and the rotation from north, east, down to them.
pub fn frame(latitude_rad: f64, longitude_rad: f64, height_m: f64) -> (Vector3<f64>, Matrix3<f64>) {
    let (sin_lat, cos_lat) = (libm::sin(latitude_rad), libm::cos(latitude_rad));
    let (sin_lon, cos_lon) = (libm::sin(longitude_rad), libm::cos(longitude_rad));
    let (_, normal_m) = radii_m(sin_lat);
    let e2 = WGS84_F * (2.0 - WGS84_F);
    let axial_m = (normal_m + height_m) * cos_lat;
    let r_e = Vector3::new(
        axial_m * cos_lon,
        axial_m * sin_lon,
        (normal_m * (1.0 - e2) + height_m) * sin_lat,
    );
    let c_e_n = Matrix3::new(
        -sin_lat * cos_lon,
        -sin_lon,
        -cos_lat * cos_lon,
        -sin_lat * sin_lon,
        cos_lon,
        -cos_lat * sin_lon,
        cos_lat,
        0.0,
        -sin_lat,
    );
    (r_e, c_e_n)
}

/// Gravity, centrifugal acceleration included, Earth-fixed axes, m/s².
pub fn gravity_e(r_e: &Vector3<f64>) -> Vector3<f64> {
    let r2 = r_e.norm_squared();
    let r = libm::sqrt(r2);
    let oblate = 1.5 * J2 * (WGS84_A_M * WGS84_A_M / r2);
    let polar = 5.0 * r_e.z * r_e.z / r2;
    let central = MU / (r2 * r);
    let equatorial = -central * (1.0 + oblate * (1.0 - polar)) + OMEGA_IE_RADPS * OMEGA_IE_RADPS;
    let axial = -central * (1.0 + oblate * (3.0 - polar));
    Vector3::new(equatorial * r_e.x, equatorial * r_e.y, axial * r_e.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::flight::{c_e_enu, ecef_from_geodetic};

    #[test]
    fn positions_and_axes_are_those_of_the_other_simulations() {
        for (latitude_deg, longitude_deg, height_m) in
            [(31.1, 121.8, 16.0), (-70.0, -3.0, 9000.0), (0.0, 0.0, 0.0)]
        {
            let (latitude, longitude): (f64, f64) = (latitude_deg, longitude_deg);
            let (r_e, c_e_n) = frame(latitude.to_radians(), longitude.to_radians(), height_m);
            let other = ecef_from_geodetic(latitude_deg, longitude_deg, height_m);
            assert!((r_e - other).norm() < 1e-8);
            let enu = c_e_enu(latitude_deg, longitude_deg);
            assert!((c_e_n.column(0) - enu.column(1)).norm() < 1e-15);
            assert!((c_e_n.column(1) - enu.column(0)).norm() < 1e-15);
            assert!((c_e_n.column(2) + enu.column(2)).norm() < 1e-15);
        }
    }

    /// Normal gravity of the ellipsoid, [NGA.STND.0036]: 9.7803253359 m/s² at the equator,
    /// 9.8321849379 m/s² at the poles. J2 alone leaves the next zonal out, 1.2e-5 of it there.
    #[test]
    fn gravity_is_normal_gravity_to_the_size_of_j4() {
        let (equator, _) = frame(0.0, 0.3, 0.0);
        assert!((gravity_e(&equator).norm() - 9.780_325_335_9).abs() < 1e-4);
        let (pole, _) = frame(core::f64::consts::FRAC_PI_2, 0.0, 0.0);
        assert!((gravity_e(&pole).norm() - 9.832_184_937_9).abs() < 1.5e-4);
    }
}
