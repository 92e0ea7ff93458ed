//! Gravity and the local level of WGS-84.

use nalgebra::{Matrix3, Vector3};

/// Rotation of the Earth, rad/s.
pub const OMEGA: f64 = 7.292115e-5;
/// Gravitational constant times mass, m³/s².
pub const MU: f64 = 3.986004418e14;
/// Second zonal harmonic, 1.
pub const J2: f64 = 1.082627e-3;
/// Semi-major axis, m.
pub const A: f64 = 6_378_137.0;
/// Flattening, 1.
pub const F: f64 = 1.0 / 298.257_223_563;

/// Angular rate of the Earth, ECEF, rad/s.
pub fn omega_ie() -> Vector3<f64> {
    Vector3::new(0.0, 0.0, OMEGA)
}

/// Gravitation of a flattened Earth and centrifugal acceleration, m/s².
pub fn gravity(r: &Vector3<f64>) -> Vector3<f64> {
    let range = r.norm();
    let c = 1.5 * J2 * (A / range).powi(2);
    let s = 5.0 * (r.z / range).powi(2);
    let flattened = Vector3::new(
        (1.0 + c * (1.0 - s)) * r.x,
        (1.0 + c * (1.0 - s)) * r.y,
        (1.0 + c * (3.0 - s)) * r.z,
    );
    -MU / range.powi(3) * flattened + OMEGA * OMEGA * Vector3::new(r.x, r.y, 0.0)
}

/// Gradient of gravity: of a round Earth, and centrifugal, 1/s².
pub fn gravity_gradient(r: &Vector3<f64>) -> Matrix3<f64> {
    let range = r.norm();
    let unit = r / range;
    -MU / range.powi(3) * (Matrix3::identity() - 3.0 * unit * unit.transpose())
        + OMEGA * OMEGA * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0))
}

/// Geodetic latitude and longitude, rad.
pub fn latitude_longitude(r: &Vector3<f64>) -> (f64, f64) {
    let e2 = F * (2.0 - F);
    let p = r.x.hypot(r.y);
    let mut latitude = r.z.atan2(p * (1.0 - e2));
    // Contracts by e² a step: far below a rounding error after twenty.
    for _ in 0..20 {
        let sine = latitude.sin();
        let normal = A / (1.0 - e2 * sine * sine).sqrt();
        latitude = (r.z + e2 * normal * sine).atan2(p);
    }
    (latitude, r.y.atan2(r.x))
}

/// Rotation from ECEF to east, north, up.
pub fn c_enu_e(r: &Vector3<f64>) -> Matrix3<f64> {
    let (latitude, longitude) = latitude_longitude(r);
    let (sp, cp) = latitude.sin_cos();
    let (sl, cl) = longitude.sin_cos();
    Matrix3::new(-sl, cl, 0.0, -sp * cl, -sp * sl, cp, cp * cl, cp * sl, sp)
}

/// Rotation from north, east, down to ECEF.
pub fn c_e_ned(r: &Vector3<f64>) -> Matrix3<f64> {
    let enu = c_enu_e(r);
    let (east, north, up) = (enu.row(0), enu.row(1), enu.row(2));
    Matrix3::from_columns(&[north.transpose(), east.transpose(), -up.transpose()])
}
