//! Satellite position and velocity from a broadcast ephemeris: GPS, Galileo and BDS with GEO.
//!
//! In: an [`Ephemeris`] and the time since its reference time. Out: position and velocity of the
//! antenna phase centre in the Earth-fixed frame of that instant.
//!
//! | symbol | code            | unit  | meaning                                        |
//! |--------|-----------------|-------|------------------------------------------------|
//! | tk     | since_toe_s     | s     | time of transmission − toe                     |
//! | E      | eccentric       | rad   | eccentric anomaly                              |
//! | φ      | argument        | rad   | argument of latitude before its correction     |
//! | u, r, i| latitude_argument, radius, inclination | rad, m, rad | after correction |
//! | Ω      | node            | rad   | longitude of the ascending node                |
//!
//! Equations: [IS-GPS-200] tables 20-IV and 30-II (velocity), [GAL-OS-SIS-ICD] 5.1.1,
//! [BDS-SIS-ICD-B1I] 5.2.4.12 → `position_velocity()`. The three differ in μ and Ωe, and a BDS GEO
//! satellite is computed in a frame tilted by 5° that does not turn.
//! Cost: 48 satellites a few hundred thousand instructions; computed once per epoch.
//! Assumes: the ephemeris passed [`check`].

use super::{Ephemeris, System};
use crate::consts::{
    MU_BDS, MU_GALILEO, MU_GPS, OMEGA_EARTH_BDS_RADPS, OMEGA_EARTH_RADPS, SPEED_OF_LIGHT_MPS,
};

/// Where a satellite is and how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrbitState {
    /// Position in the Earth-fixed frame, m.
    pub r_e_m: [f64; 3],
    /// Velocity relative to that frame, m/s.
    pub v_e_mps: [f64; 3],
    /// Relativistic part of the clock from the eccentricity, s.
    pub relativity_s: f64,
    /// Its rate, s/s.
    pub relativity_rate_sps: f64,
}

/// Why an ephemeris gives no orbit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum OrbitError {
    /// A number is not finite.
    NotFinite,
    /// The eccentricity is negative or [`MAX_ECCENTRICITY`] and more.
    Eccentricity,
    /// The semi-major axis belongs to no navigation satellite.
    SemiMajorAxis,
    /// Kepler's equation did not settle in [`MAX_KEPLER_ITERATIONS`].
    Kepler,
}

/// Largest eccentricity the messages can carry. [IS-GPS-200] table 20-III: 32 bits of 2⁻³³.
pub const MAX_ECCENTRICITY: f64 = 0.5;
/// √A of the lowest and the highest orbit accepted, √m: 16,000 km and 49,000 km. GPS is at 26,560 km,
/// the two eccentric Galileo satellites at 27,980 km, BDS GEO and IGSO at 42,160 km.
const SQRT_A_RANGE: core::ops::RangeInclusive<f64> = 4000.0..=7000.0;
/// Newton's iteration from E = M + e sin M: at e = 0.02 three steps reach the last bit, at e = 0.5 six.
pub const MAX_KEPLER_ITERATIONS: usize = 10;
/// A Newton step this small leaves an error of its square, below the last bit, rad.
const KEPLER_STEP_RAD: f64 = 1.0e-9;

/// sin and cos of −5°, the tilt of the frame of BDS GEO ephemerides. [BDS-SIS-ICD-B1I] 5.2.4.12.
const SIN_TILT: f64 = -0.087_155_742_747_658_17;
const COS_TILT: f64 = 0.996_194_698_091_745_5;

/// Whether an ephemeris can be computed with: finite numbers, an ellipse, a navigation orbit.
///
/// # Errors
/// [`OrbitError`] names the first thing that is wrong.
pub fn check(ephemeris: &Ephemeris) -> Result<(), OrbitError> {
    let e = ephemeris;
    let numbers = [
        e.toe_sow_s,
        e.sqrt_a,
        e.eccentricity,
        e.i0_rad,
        e.idot_radps,
        e.omega0_rad,
        e.omega_dot_radps,
        e.argument_of_perigee_rad,
        e.m0_rad,
        e.delta_n_radps,
        e.cuc_rad,
        e.cus_rad,
        e.crc_m,
        e.crs_m,
        e.cic_rad,
        e.cis_rad,
        e.af0_s,
        e.af1_sps,
        e.af2_sps2,
        e.group_delay_s[0],
        e.group_delay_s[1],
        e.sigma_ura_m.unwrap_or(0.0),
    ];
    if !numbers.iter().all(|number| number.is_finite()) {
        return Err(OrbitError::NotFinite);
    }
    if !(0.0..MAX_ECCENTRICITY).contains(&e.eccentricity) {
        return Err(OrbitError::Eccentricity);
    }
    if !SQRT_A_RANGE.contains(&e.sqrt_a) {
        return Err(OrbitError::SemiMajorAxis);
    }
    Ok(())
}

/// μ and Ωe of a system's ephemerides.
const fn constants(system: System) -> (f64, f64) {
    match system {
        System::Gps => (MU_GPS, OMEGA_EARTH_RADPS),
        System::Galileo => (MU_GALILEO, OMEGA_EARTH_RADPS),
        System::Bds => (MU_BDS, OMEGA_EARTH_BDS_RADPS),
    }
}

/// E of M = E − e sin E. Newton's iteration.
fn eccentric_anomaly(mean: f64, eccentricity: f64) -> Result<f64, OrbitError> {
    let mut eccentric = mean + eccentricity * libm::sin(mean);
    for _ in 0..MAX_KEPLER_ITERATIONS {
        let (sin, cos) = libm::sincos(eccentric);
        let step = (mean - (eccentric - eccentricity * sin)) / (1.0 - eccentricity * cos);
        eccentric += step;
        if libm::fabs(step) < KEPLER_STEP_RAD {
            return Ok(eccentric);
        }
    }
    Err(OrbitError::Kepler)
}

/// Position and velocity `since_toe_s` after the ephemeris' reference time.
///
/// # Errors
/// [`OrbitError::Kepler`] when Kepler's equation does not settle, which no checked ephemeris does;
/// what [`check`] refuses is refused here too.
pub fn position_velocity(
    ephemeris: &Ephemeris,
    since_toe_s: f64,
) -> Result<OrbitState, OrbitError> {
    check(ephemeris)?;
    let e = ephemeris;
    let (mu, omega_earth) = constants(e.satellite.system());
    let a_m = e.sqrt_a * e.sqrt_a;
    let mean_motion = libm::sqrt(mu) / (a_m * e.sqrt_a) + e.delta_n_radps;
    let eccentric = eccentric_anomaly(e.m0_rad + mean_motion * since_toe_s, e.eccentricity)?;
    let (sin_eccentric, cos_eccentric) = libm::sincos(eccentric);
    let one_minus_e_cos = 1.0 - e.eccentricity * cos_eccentric;
    let eccentric_rate = mean_motion / one_minus_e_cos;
    let minor = libm::sqrt(1.0 - e.eccentricity * e.eccentricity);

    let true_anomaly = libm::atan2(minor * sin_eccentric, cos_eccentric - e.eccentricity);
    let argument = true_anomaly + e.argument_of_perigee_rad;
    let argument_rate = eccentric_rate * minor / one_minus_e_cos;
    let (sin_2, cos_2) = libm::sincos(2.0 * argument);

    let latitude_argument = argument + e.cus_rad * sin_2 + e.cuc_rad * cos_2;
    let radius_m = a_m * one_minus_e_cos + e.crs_m * sin_2 + e.crc_m * cos_2;
    let inclination = e.i0_rad + e.idot_radps * since_toe_s + e.cis_rad * sin_2 + e.cic_rad * cos_2;
    let latitude_argument_rate =
        argument_rate * (1.0 + 2.0 * (e.cus_rad * cos_2 - e.cuc_rad * sin_2));
    let radius_rate = a_m * e.eccentricity * sin_eccentric * eccentric_rate
        + 2.0 * argument_rate * (e.crs_m * cos_2 - e.crc_m * sin_2);
    let inclination_rate =
        e.idot_radps + 2.0 * argument_rate * (e.cis_rad * cos_2 - e.cic_rad * sin_2);

    let (sin_u, cos_u) = libm::sincos(latitude_argument);
    let (sin_i, cos_i) = libm::sincos(inclination);
    let x_plane = radius_m * cos_u;
    let y_plane = radius_m * sin_u;
    let vx_plane = radius_rate * cos_u - y_plane * latitude_argument_rate;
    let vy_plane = radius_rate * sin_u + x_plane * latitude_argument_rate;

    // A GEO node is counted in a frame that stands still; the turn follows below.
    let geo = e.satellite.is_bds_geo();
    let node_rate = if geo {
        e.omega_dot_radps
    } else {
        e.omega_dot_radps - omega_earth
    };
    let node = e.omega0_rad + node_rate * since_toe_s - omega_earth * e.toe_sow_s;
    let (sin_node, cos_node) = libm::sincos(node);

    let r = [
        x_plane * cos_node - y_plane * cos_i * sin_node,
        x_plane * sin_node + y_plane * cos_i * cos_node,
        y_plane * sin_i,
    ];
    let across = vy_plane * cos_i - y_plane * sin_i * inclination_rate;
    let v = [
        vx_plane * cos_node - across * sin_node - r[1] * node_rate,
        vx_plane * sin_node + across * cos_node + r[0] * node_rate,
        vy_plane * sin_i + y_plane * cos_i * inclination_rate,
    ];
    let (r_e_m, v_e_mps) = if geo {
        geo_to_earth_fixed(r, v, omega_earth, since_toe_s)
    } else {
        (r, v)
    };

    // F e √A sin E, F = −2 √μ / c². [IS-GPS-200] 20.3.3.3.3.1
    let relativity = -2.0 * libm::sqrt(mu) / (SPEED_OF_LIGHT_MPS * SPEED_OF_LIGHT_MPS)
        * e.eccentricity
        * e.sqrt_a;
    Ok(OrbitState {
        r_e_m,
        v_e_mps,
        relativity_s: relativity * sin_eccentric,
        relativity_rate_sps: relativity * cos_eccentric * eccentric_rate,
    })
}

/// Rz(Ωe tk) Rx(−5°) and its derivative. [BDS-SIS-ICD-B1I] 5.2.4.12.
fn geo_to_earth_fixed(
    r: [f64; 3],
    v: [f64; 3],
    omega_earth: f64,
    since_toe_s: f64,
) -> ([f64; 3], [f64; 3]) {
    let untilt =
        |[x, y, z]: [f64; 3]| [x, y * COS_TILT + z * SIN_TILT, -y * SIN_TILT + z * COS_TILT];
    let (sin, cos) = libm::sincos(omega_earth * since_toe_s);
    let turn = |[x, y, z]: [f64; 3]| [x * cos + y * sin, -x * sin + y * cos, z];
    let r_e = turn(untilt(r));
    let [vx, vy, vz] = turn(untilt(v));
    (
        r_e,
        [vx + omega_earth * r_e[1], vy - omega_earth * r_e[0], vz],
    )
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::gnss::{NavMessage, Satellite};
    use crate::time::GpsTime;

    /// An orbit of plausible shape for any system.
    pub(crate) fn example(satellite: Satellite) -> Ephemeris {
        let (message, sqrt_a) = match satellite.system() {
            System::Gps => (NavMessage::GpsLnav, 5153.7),
            System::Galileo => (NavMessage::GalileoInav, 5440.6),
            System::Bds => (NavMessage::BdsD1D2, 6493.4),
        };
        Ephemeris {
            satellite,
            message,
            toe: GpsTime::from_week_tow_s(2200, 36_000),
            toc: GpsTime::from_week_tow_s(2200, 36_000),
            toe_sow_s: 36_000.0,
            issue: 7,
            sqrt_a,
            eccentricity: 0.012,
            i0_rad: 0.96,
            idot_radps: 2.0e-10,
            omega0_rad: -1.5,
            omega_dot_radps: -8.0e-9,
            argument_of_perigee_rad: 0.9,
            m0_rad: -0.95,
            delta_n_radps: 4.2e-9,
            cuc_rad: 2.0e-6,
            cus_rad: 1.0e-6,
            crc_m: 370.0,
            crs_m: 34.0,
            cic_rad: 1.2e-7,
            cis_rad: 2.7e-7,
            af0_s: 2.3e-4,
            af1_sps: -4.8e-12,
            af2_sps2: 1.0e-18,
            group_delay_s: [4.7e-9, 5.1e-9],
            sigma_ura_m: Some(2.0),
            health: 0,
        }
    }

    fn satellite(system: System, prn: u8) -> Satellite {
        Satellite::new(system, prn).unwrap()
    }

    #[test]
    fn velocity_is_the_derivative_of_position() {
        for satellite in [
            satellite(System::Gps, 3),
            satellite(System::Galileo, 3),
            satellite(System::Bds, 3),
            satellite(System::Bds, 8),
        ] {
            let ephemeris = example(satellite);
            for since_toe_s in [-7200.0, -1.0, 0.0, 3333.3] {
                let half_s = 0.05;
                let state = position_velocity(&ephemeris, since_toe_s).unwrap();
                let before = position_velocity(&ephemeris, since_toe_s - half_s).unwrap();
                let after = position_velocity(&ephemeris, since_toe_s + half_s).unwrap();
                for axis in 0..3 {
                    let slope = (after.r_e_m[axis] - before.r_e_m[axis]) / (2.0 * half_s);
                    assert!(
                        (slope - state.v_e_mps[axis]).abs() < 2e-7,
                        "{satellite} {axis} {slope} {}",
                        state.v_e_mps[axis]
                    );
                }
                let slope = (after.relativity_s - before.relativity_s) / (2.0 * half_s);
                assert!((slope - state.relativity_rate_sps).abs() < 1e-17);
            }
        }
    }

    #[test]
    fn kepler_settles_for_every_eccentricity_the_messages_carry() {
        for e_step in 0..100 {
            let eccentricity = f64::from(e_step) * 0.005;
            for m_step in -700..700 {
                let mean = f64::from(m_step) * 0.01;
                let eccentric = eccentric_anomaly(mean, eccentricity).unwrap();
                let back = eccentric - eccentricity * libm::sin(eccentric);
                assert!((back - mean).abs() < 4e-15, "{eccentricity} {mean}");
            }
        }
    }

    #[test]
    fn only_a_geo_is_untilted() {
        // Without inclination in the tilted frame a GEO's orbit is inclined by 5° to the equator.
        let mut ephemeris = example(satellite(System::Bds, 3));
        ephemeris.i0_rad = 0.0;
        ephemeris.cic_rad = 0.0;
        ephemeris.cis_rad = 0.0;
        ephemeris.idot_radps = 0.0;
        let inclination = |ephemeris: &Ephemeris| {
            let mut highest = 0.0_f64;
            for step in 0..200 {
                let state = position_velocity(ephemeris, f64::from(step) * 432.0).unwrap();
                let [x, y, z] = state.r_e_m;
                highest = highest.max((z / (x * x + y * y + z * z).sqrt()).asin());
            }
            highest.to_degrees()
        };
        assert!((inclination(&ephemeris) - 5.0).abs() < 0.01);
        ephemeris.satellite = satellite(System::Bds, 6);
        assert!(inclination(&ephemeris) < 1e-9);
    }

    #[test]
    fn what_is_no_orbit_is_refused() {
        let good = example(satellite(System::Gps, 1));
        assert_eq!(check(&good), Ok(()));
        let mut bad = good;
        bad.eccentricity = MAX_ECCENTRICITY;
        assert_eq!(check(&bad), Err(OrbitError::Eccentricity));
        bad = good;
        bad.sqrt_a = 0.0;
        assert_eq!(check(&bad), Err(OrbitError::SemiMajorAxis));
        bad = good;
        bad.cis_rad = f64::NAN;
        assert_eq!(position_velocity(&bad, 0.0), Err(OrbitError::NotFinite));
        assert!(position_velocity(&good, f64::INFINITY).is_err());
    }
}
