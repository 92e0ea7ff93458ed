//! Where a satellite of the simulated sky is: broadcast elements evaluated in an inertial frame.
//!
//! In: a broadcast ephemeris, the instant of reception, the signal's time of flight.
//! Out: the satellite at transmission, resolved in the Earth-fixed axes frozen at reception.
//!
//! This is the reference path of the simulator and shares no code with the receiver's: the orbit
//! plane stands in inertial space and the Earth's rotation enters once, in the longitude of the
//! node at *reception*, so that no range has to be corrected for it. (The user algorithm of the
//! interface documents works in rotating axes at transmission and rotates the result.) Kepler's
//! equation is solved by Newton's method, the true anomaly comes from half angles, and the position
//! from the unit vectors of the orbit plane.
//!
//! | symbol | code          | unit | meaning                                          |
//! |--------|---------------|------|--------------------------------------------------|
//! | t_k    | since_toe_s   | s    | transmission minus toe                           |
//! | E      | eccentric     | rad  | eccentric anomaly                                |
//! | u      | latitude_arg  | rad  | argument of latitude, corrected                  |
//! | Ω_I    | node_rad      | rad  | node in the axes frozen at reception             |
//!
//! Equations: elements and corrections as in [IS-GPS-200] table 20-IV, [GAL-OS-SIS-ICD] table 58,
//! [BDS-SIS-ICD-B1I] table 5-11, rearranged; −5° tilt of the BDS GEO frame in the last.

use nalgebra::Vector3;
use surefix_core::consts::{
    MU_BDS, MU_GALILEO, MU_GPS, OMEGA_EARTH_BDS_RADPS, OMEGA_EARTH_RADPS, SPEED_OF_LIGHT_MPS,
};
use surefix_core::gnss::{Ephemeris, System};

/// Tilt of the frame in which BDS GEO elements are given, rad. [BDS-SIS-ICD-B1I] table 5-11.
const GEO_TILT_RAD: f64 = -5.0 * core::f64::consts::PI / 180.0;

/// Gravitational constant of a system's ephemerides, m³/s².
pub fn gravitational_constant(system: System) -> f64 {
    match system {
        System::Gps => MU_GPS,
        System::Galileo => MU_GALILEO,
        System::Bds => MU_BDS,
    }
}

/// Rotation rate of the Earth of a system's ephemerides, rad/s.
pub fn earth_rate(system: System) -> f64 {
    match system {
        System::Gps | System::Galileo => OMEGA_EARTH_RADPS,
        System::Bds => OMEGA_EARTH_BDS_RADPS,
    }
}

/// Eccentric anomaly, rad, `since_toe_s` after toe.
fn eccentric_anomaly(ephemeris: &Ephemeris, since_toe_s: f64) -> f64 {
    let axis_m = ephemeris.sqrt_a * ephemeris.sqrt_a;
    let mean_motion =
        libm::sqrt(gravitational_constant(ephemeris.satellite.system()) / axis_m) / axis_m;
    let mean = ephemeris.m0_rad + (mean_motion + ephemeris.delta_n_radps) * since_toe_s;
    let e = ephemeris.eccentricity;
    let mut eccentric = mean + e * libm::sin(mean);
    for _ in 0..12 {
        let slope = 1.0 - e * libm::cos(eccentric);
        eccentric -= (eccentric - e * libm::sin(eccentric) - mean) / slope;
    }
    eccentric
}

/// Satellite position `since_toe_s` after toe, m, in the Earth-fixed axes frozen at
/// `reception_since_toe_s` after toe.
pub fn position_frozen_e(
    ephemeris: &Ephemeris,
    since_toe_s: f64,
    reception_since_toe_s: f64,
) -> Vector3<f64> {
    let e = ephemeris.eccentricity;
    let eccentric = eccentric_anomaly(ephemeris, since_toe_s);
    let half = eccentric / 2.0;
    let true_anomaly = 2.0
        * libm::atan2(
            libm::sqrt(1.0 + e) * libm::sin(half),
            libm::sqrt(1.0 - e) * libm::cos(half),
        );
    let uncorrected = true_anomaly + ephemeris.argument_of_perigee_rad;
    let (sin2, cos2) = (libm::sin(2.0 * uncorrected), libm::cos(2.0 * uncorrected));
    let latitude_arg = uncorrected + ephemeris.cus_rad * sin2 + ephemeris.cuc_rad * cos2;
    let radius_m = ephemeris.sqrt_a * ephemeris.sqrt_a * (1.0 - e * libm::cos(eccentric))
        + ephemeris.crs_m * sin2
        + ephemeris.crc_m * cos2;
    let inclination = ephemeris.i0_rad
        + ephemeris.idot_radps * since_toe_s
        + ephemeris.cis_rad * sin2
        + ephemeris.cic_rad * cos2;

    let rate = earth_rate(ephemeris.satellite.system());
    let node_at_toe_frame =
        ephemeris.omega0_rad + ephemeris.omega_dot_radps * since_toe_s - rate * ephemeris.toe_sow_s;
    let geostationary = ephemeris.satellite.is_bds_geo();
    let node_rad = if geostationary {
        node_at_toe_frame
    } else {
        node_at_toe_frame - rate * reception_since_toe_s
    };
    let in_plane = plane_position(node_rad, inclination, latitude_arg, radius_m);
    if geostationary {
        // Tilt to the equator of the Earth-fixed axes at toe, then turn with the Earth to reception.
        let (sin, cos) = (libm::sin(GEO_TILT_RAD), libm::cos(GEO_TILT_RAD));
        let level = Vector3::new(
            in_plane.x,
            cos * in_plane.y + sin * in_plane.z,
            -sin * in_plane.y + cos * in_plane.z,
        );
        turn(&level, rate * reception_since_toe_s)
    } else {
        in_plane
    }
}

/// A point of an orbit plane from its node, inclination, argument of latitude and radius.
fn plane_position(node: f64, inclination: f64, latitude_arg: f64, radius_m: f64) -> Vector3<f64> {
    let to_node = Vector3::new(libm::cos(node), libm::sin(node), 0.0);
    let normal = Vector3::new(
        libm::sin(node) * libm::sin(inclination),
        -libm::cos(node) * libm::sin(inclination),
        libm::cos(inclination),
    );
    let ahead = normal.cross(&to_node);
    (to_node * libm::cos(latitude_arg) + ahead * libm::sin(latitude_arg)) * radius_m
}

/// The same vector in axes turned about z by `angle_rad`.
fn turn(v: &Vector3<f64>, angle_rad: f64) -> Vector3<f64> {
    let (sin, cos) = (libm::sin(angle_rad), libm::cos(angle_rad));
    Vector3::new(cos * v.x + sin * v.y, -sin * v.x + cos * v.y, v.z)
}

/// Satellite clock minus GPST `since_toc_s` after toc, s, for the combination of signals the
/// broadcast clock refers to, relativity included.
pub fn clock_offset_s(ephemeris: &Ephemeris, since_toc_s: f64, since_toe_s: f64) -> f64 {
    let polynomial =
        ephemeris.af0_s + since_toc_s * (ephemeris.af1_sps + since_toc_s * ephemeris.af2_sps2);
    let mu = gravitational_constant(ephemeris.satellite.system());
    let relativity = -2.0 * libm::sqrt(mu) / (SPEED_OF_LIGHT_MPS * SPEED_OF_LIGHT_MPS)
        * ephemeris.eccentricity
        * ephemeris.sqrt_a
        * libm::sin(eccentric_anomaly(ephemeris, since_toe_s));
    polynomial + relativity
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_equatorial_geo_stays_over_its_longitude() {
        let sky = crate::simulate::sky::Sky::new();
        let slot = sky
            .slots()
            .iter()
            .find(|s| s.satellite.is_bds_geo())
            .unwrap();
        for index in [20, 21, 25] {
            let ephemeris = slot.broadcast(index);
            for since_toe_s in [-3600.0, 0.0, 3600.0] {
                let p = position_frozen_e(&ephemeris, since_toe_s, since_toe_s);
                let longitude_deg = p.y.atan2(p.x).to_degrees();
                assert!((longitude_deg - 140.0).abs() < 0.2, "{longitude_deg}");
                assert!((p.norm() - 42_164e3).abs() < 100e3);
                assert!((p.z / p.norm()).abs() < 0.01);
            }
        }
    }

    #[test]
    fn successive_ephemerides_describe_nearly_the_same_orbit() {
        let sky = crate::simulate::sky::Sky::new();
        for slot in sky.slots() {
            let (now, next) = (slot.broadcast(30), slot.broadcast(31));
            let step_s = next.toe.seconds_since(now.toe);
            let a = position_frozen_e(&now, step_s / 2.0, step_s / 2.0);
            let b = position_frozen_e(&next, -step_s / 2.0, -step_s / 2.0);
            // A geostationary satellite's corrections start anew with the tilted frame of each toe.
            let bound_m = if now.satellite.is_bds_geo() {
                1000.0
            } else {
                10.0
            };
            assert!(
                (a - b).norm() < bound_m,
                "{} {}",
                now.satellite,
                (a - b).norm()
            );
        }
    }
}
