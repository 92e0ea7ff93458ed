//! Geodetic coordinates on the WGS-84 ellipsoid, and the local horizontal.
//!
//! In: a position in ECEF axes, or latitude, longitude and height. Out: the other; the rotation to
//! east, north, up; elevation and azimuth of a direction.
//!
//! | symbol | code      | unit | frame | meaning                                       |
//! |--------|-----------|------|-------|-----------------------------------------------|
//! | r      | `r_e`     | m    | e     | position from the centre of the Earth         |
//! | φ, λ   | `lat_rad`, `lon_rad` | rad | | geodetic latitude, longitude              |
//! | h      | `height_m`| m    |       | height above the ellipsoid                    |
//! | β      |           |      |       | parametric latitude, tan β = (1 − f) tan φ    |
//! | C      | `c_enu_e` | 3 × 3 |      | takes a vector from e axes to enu axes        |
//!
//! Equations: Bowring's iteration [BOWRING-1976] → [`to_llh`]; the ellipsoid's parametric form
//! [NGA.STND.0036] → [`to_ecef`]. Keys: docs/references.md.
//! Accuracy: a round trip stays within four roundings of the radius (4e-9 m at the ground, 3e-8 m at
//! 40,000 km) from 5,000 km below the surface up, the poles included.

use crate::consts::{WGS84_A_M, WGS84_F};
use nalgebra::{Matrix3, Vector3};

/// Semi-minor axis, m.
const B_M: f64 = WGS84_A_M * (1.0 - WGS84_F);
/// First eccentricity squared.
const E2: f64 = WGS84_F * (2.0 - WGS84_F);
/// Second eccentricity squared, times the semi-minor axis, m.
const SECOND_E2_B_M: f64 = E2 / ((1.0 - WGS84_F) * (1.0 - WGS84_F)) * B_M;

/// Nearer to the centre no horizontal is defined that a user of satellites could mean, and the
/// iteration is not shown to converge.
pub const MIN_RADIUS_M: f64 = 1_000_000.0;

/// Steps of Bowring's iteration. From its usual start each step divides the error by more than 100;
/// one is good to 1e-7 rad everywhere above, four reach rounding.
const BOWRING_STEPS: usize = 4;

/// Geodetic latitude, longitude and height on WGS-84.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Llh {
    /// Geodetic latitude, north positive, −π/2 to π/2.
    pub lat_rad: f64,
    /// Longitude, east positive, −π to π; 0 on the axis of the Earth.
    pub lon_rad: f64,
    /// Height above the ellipsoid.
    pub height_m: f64,
}

/// Why a position has no geodetic coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GeodesyError {
    /// A coordinate is NaN or infinite.
    NotFinite,
    /// The position lies within [`MIN_RADIUS_M`] of the centre of the Earth.
    NearCentre {
        /// Distance from the centre.
        radius_m: f64,
    },
}

/// Direction of a satellite seen from a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction {
    /// Angle above the local horizontal, −π/2 to π/2.
    pub elevation_rad: f64,
    /// Angle from north towards east, 0 to 2π.
    pub azimuth_rad: f64,
}

/// Geodetic coordinates of a position in ECEF axes. [BOWRING-1976]
///
/// # Errors
/// [`GeodesyError`]; NaN refuses.
pub fn to_llh(r_e: &Vector3<f64>) -> Result<Llh, GeodesyError> {
    let (x, y, z) = (r_e.x, r_e.y, r_e.z);
    let p2 = x * x + y * y;
    let radius_m = libm::sqrt(p2 + z * z);
    if !radius_m.is_finite() {
        return Err(GeodesyError::NotFinite);
    }
    if radius_m < MIN_RADIUS_M {
        return Err(GeodesyError::NearCentre { radius_m });
    }
    let p = libm::sqrt(p2);

    // Directions are kept as (cosine, sine): no trigonometry inside, and the poles are ordinary.
    // Start: tan β = (1 − f) (z/p) (1 + e'² b/r).
    let (mut cos_beta, mut sin_beta) =
        unit(p, (1.0 - WGS84_F) * z * (1.0 + SECOND_E2_B_M / radius_m));
    let (mut cos_phi, mut sin_phi) = (1.0, 0.0);
    for _ in 0..BOWRING_STEPS {
        (cos_phi, sin_phi) = unit(
            p - E2 * WGS84_A_M * cos_beta * cos_beta * cos_beta,
            z + SECOND_E2_B_M * sin_beta * sin_beta * sin_beta,
        );
        (cos_beta, sin_beta) = unit(cos_phi, (1.0 - WGS84_F) * sin_phi);
    }
    Ok(Llh {
        lat_rad: libm::atan2(sin_phi, cos_phi),
        lon_rad: libm::atan2(y, x),
        // Distance to the tangent of the ellipsoid at φ: an error of φ enters only squared.
        height_m: p * cos_phi + z * sin_phi - WGS84_A_M * libm::sqrt(1.0 - E2 * sin_phi * sin_phi),
    })
}

/// (cosine, sine) of the angle of a vector that is not zero.
fn unit(x: f64, y: f64) -> (f64, f64) {
    let inverse = 1.0 / libm::sqrt(x * x + y * y);
    (x * inverse, y * inverse)
}

/// Position in ECEF axes of geodetic coordinates, m. [NGA.STND.0036]
pub fn to_ecef(llh: &Llh) -> Vector3<f64> {
    let (sin_phi, cos_phi) = libm::sincos(llh.lat_rad);
    let (sin_lambda, cos_lambda) = libm::sincos(llh.lon_rad);
    let normal_m = WGS84_A_M / libm::sqrt(1.0 - E2 * sin_phi * sin_phi);
    let p = (normal_m + llh.height_m) * cos_phi;
    Vector3::new(
        p * cos_lambda,
        p * sin_lambda,
        ((1.0 - E2) * normal_m + llh.height_m) * sin_phi,
    )
}

/// Rotation from ECEF axes to east, north, up at this latitude and longitude: its rows are the
/// three unit vectors in ECEF axes.
pub fn c_enu_e(lat_rad: f64, lon_rad: f64) -> Matrix3<f64> {
    let (sin_phi, cos_phi) = libm::sincos(lat_rad);
    let (sin_lambda, cos_lambda) = libm::sincos(lon_rad);
    Matrix3::new(
        -sin_lambda,
        cos_lambda,
        0.0,
        -sin_phi * cos_lambda,
        -sin_phi * sin_lambda,
        cos_phi,
        cos_phi * cos_lambda,
        cos_phi * sin_lambda,
        sin_phi,
    )
}

/// Elevation and azimuth of a direction in east, north, up axes, of any length but zero.
///
/// The elevation comes from an arc tangent, so that it keeps its digits at the zenith.
pub fn direction(line_of_sight_enu: &Vector3<f64>) -> Direction {
    let (east, north, up) = (
        line_of_sight_enu.x,
        line_of_sight_enu.y,
        line_of_sight_enu.z,
    );
    let azimuth_rad = libm::atan2(east, north);
    Direction {
        elevation_rad: libm::atan2(up, libm::sqrt(east * east + north * north)),
        azimuth_rad: if azimuth_rad < 0.0 {
            azimuth_rad + 2.0 * core::f64::consts::PI
        } else {
            azimuth_rad
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::{FRAC_PI_2, FRAC_PI_4};

    #[test]
    fn round_trip_from_deep_below_to_geostationary_height() {
        for height_m in [-5.0e6, -1.0e6, -1.0e4, 0.0, 9.0e3, 5.0e5, 2.02e7, 4.0e7] {
            let mut worst_m: f64 = 0.0;
            for step in -900..=900 {
                let lat_rad = f64::from(step) * 0.1_f64.to_radians();
                let llh = Llh {
                    lat_rad,
                    lon_rad: 0.7 * f64::from(step % 4),
                    height_m,
                };
                let r_e = to_ecef(&llh);
                let back = to_llh(&r_e).unwrap();
                worst_m = worst_m.max((to_ecef(&back) - r_e).norm());
                worst_m = worst_m.max((back.height_m - height_m).abs());
                worst_m = worst_m.max((back.lat_rad - lat_rad).abs() * (WGS84_A_M + height_m));
            }
            std::println!("height {height_m} m: worst {worst_m:e} m");
            // Four roundings of the longest coordinate.
            let radius_m = WGS84_A_M + height_m.max(0.0);
            assert!(worst_m < 4.0 * f64::EPSILON * radius_m);
        }
    }

    #[test]
    fn poles_and_equator_have_their_known_coordinates() {
        let north = to_llh(&Vector3::new(0.0, 0.0, B_M + 100.0)).unwrap();
        assert!((north.lat_rad - FRAC_PI_2).abs() < 1e-15);
        assert!((north.height_m - 100.0).abs() < 2e-9);
        assert_eq!(north.lon_rad, 0.0);
        let south = to_llh(&Vector3::new(0.0, 0.0, -B_M)).unwrap();
        assert!((south.lat_rad + FRAC_PI_2).abs() < 1e-15);
        let west = to_llh(&Vector3::new(0.0, -WGS84_A_M, 0.0)).unwrap();
        assert_eq!((west.lat_rad, west.lon_rad), (0.0, -FRAC_PI_2));
        assert!(west.height_m.abs() < 2e-9);
    }

    #[test]
    fn centre_and_nonsense_are_refused() {
        for r_e in [Vector3::zeros(), Vector3::new(1e3, 5e5, -1e5)] {
            assert!(matches!(to_llh(&r_e), Err(GeodesyError::NearCentre { .. })));
        }
        for bad in [f64::NAN, f64::INFINITY, 1e200] {
            assert_eq!(
                to_llh(&Vector3::new(7e6, bad, 0.0)),
                Err(GeodesyError::NotFinite)
            );
        }
    }

    #[test]
    fn local_axes_are_derivatives_of_the_position() {
        let here = Llh {
            lat_rad: 0.8,
            lon_rad: -2.0,
            height_m: 300.0,
        };
        let rotation = c_enu_e(here.lat_rad, here.lon_rad);
        let r_e = to_ecef(&here);
        let up = to_ecef(&Llh {
            height_m: 1300.0,
            ..here
        });
        assert!((rotation * (up - r_e) - Vector3::new(0.0, 0.0, 1000.0)).norm() < 1e-8);
        let east = rotation
            * (to_ecef(&Llh {
                lon_rad: here.lon_rad + 1e-6,
                ..here
            }) - r_e);
        assert!(east.x > 4.0 && east.y.abs() < 1e-5 && east.z.abs() < 1e-5);
        let north = rotation
            * (to_ecef(&Llh {
                lat_rad: here.lat_rad + 1e-6,
                ..here
            }) - r_e);
        assert!(north.y > 6.0 && north.x.abs() < 1e-5 && north.z.abs() < 1e-5);
        assert!((rotation * rotation.transpose() - Matrix3::identity()).norm() < 1e-15);
    }

    #[test]
    fn elevation_and_azimuth_turn_from_north_to_east() {
        let north_east = direction(&Vector3::new(1.0, 1.0, 0.0));
        assert!((north_east.azimuth_rad - FRAC_PI_4).abs() < 1e-15);
        assert_eq!(north_east.elevation_rad, 0.0);
        let west = direction(&Vector3::new(-5.0, 0.0, 5.0));
        assert!((west.azimuth_rad - 3.0 * FRAC_PI_2).abs() < 1e-15);
        assert!((west.elevation_rad - FRAC_PI_4).abs() < 1e-15);
        assert_eq!(
            direction(&Vector3::new(0.0, 0.0, 2.0)).elevation_rad,
            FRAC_PI_2
        );
    }
}
