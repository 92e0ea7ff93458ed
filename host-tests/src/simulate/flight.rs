//! The flights by name, and the tracks of the two that carry no inertial unit: a fixed mast, and an
//! aircraft on a straight approach. Those with one are in `inertial/catalogue.rs`.
//!
//! Positions are in Earth-fixed axes, m; the approach is a straight line in the tangent plane of the
//! runway threshold, as a glide path is, with a parabola where the level segment meets it.

use clap::ValueEnum;
use nalgebra::{Matrix3, Vector3};
use surefix_core::consts::{WGS84_A_M, WGS84_F};

/// Threshold of the simulated runway and place of the fixed mast: latitude, longitude in degrees,
/// ellipsoidal height in m. On the coast of the East China Sea, where all three kinds of BDS orbit
/// are in view.
pub const THRESHOLD: (f64, f64, f64) = (31.143_4, 121.805_2, 16.0);
/// True heading of the runway, degrees.
pub const RUNWAY_HEADING_DEG: f64 = 347.0;
/// Glide path, degrees. [ICAO-A10] 3.1.5.1.2.1: 3°.
pub const GLIDE_PATH_DEG: f64 = 3.0;
/// Height of the glide path over the threshold, m (50 ft). [ICAO-A10] 3.1.5.6.1.
pub const THRESHOLD_CROSSING_M: f64 = 15.24;
/// Ground speed on the approach, m/s (136 kt).
const GROUND_SPEED_MPS: f64 = 70.0;
/// Time from leaving the level segment to the threshold, s.
const DESCENT_S: f64 = 180.0;
/// Time over which the level segment bends into the glide path, s.
const ROUNDING_S: f64 = 8.0;

/// A flight on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
#[clap(rename_all = "snake_case")]
pub enum Flight {
    /// A fixed antenna on a mast; with --imu, an inertial unit beside it
    Static,
    /// Receiver only: level at 660 m over the threshold, then a 3° glide path down to it at 70 m/s
    Approach,
    /// The mast, without any noise (navigation IMU)
    StaticPerfect,
    /// Airliner in cruise with turns; 3, 2, 1, 0 satellites for a minute each (navigation IMU)
    Coasting,
    /// Non-precision approach with a base turn, down to 150 m (tactical IMU)
    Npa,
    /// The same with a ramp of 1 m/s on G04
    NpaRamp,
    /// The same with a step of 30 m on G04
    NpaStep,
    /// LPV-200 approach on a 3° glide path with flare (tactical IMU)
    Lpv200,
    /// The same with a ramp of 0.5 m/s on G04
    Lpv200Ramp,
    /// The same with a step of 25 m on G04
    Lpv200Step,
    /// The manoeuvres of [P4] 3.1: standing, take-off, turns, climb, descent, landing (MEMS IMU)
    P4Flight,
    /// Drone surveying a field in parallel lines (MEMS IMU)
    UavSurvey,
    /// Vertical take-off, hover, transition, cruise, and back (MEMS IMU)
    Evtol,
    /// Airliner in cruise with two turns and a climb (navigation IMU)
    EnrouteTurn,
    /// LPV-200 approach broken off at 60 m, climb and turn (tactical IMU)
    GoAround,
    /// Body coning by 3° and heaving at 2 Hz during fast turns (tactical IMU)
    Coning,
    /// Car in a town: stops, corners, slopes (MEMS IMU)
    Drive,
}

/// A track of the antenna alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Track {
    /// A fixed antenna on a mast.
    Mast,
    /// The mast elsewhere, in whole degrees, at sea level.
    MastAt {
        /// Geodetic latitude, degrees.
        latitude_deg: i16,
        /// Longitude, degrees.
        longitude_deg: i16,
    },
    /// Level at 660 m over the threshold, then a 3° glide path down to it at 70 m/s.
    Approach,
}

/// Position and velocity of the antenna.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AntennaState {
    /// Position in Earth-fixed axes, m.
    pub position_e_m: Vector3<f64>,
    /// Velocity over the Earth in Earth-fixed axes, m/s.
    pub velocity_e_mps: Vector3<f64>,
}

impl Flight {
    /// Name on the command line and in files.
    pub fn name(self) -> String {
        self.to_possible_value()
            .map(|value| value.get_name().to_owned())
            .unwrap_or_default()
    }

    /// The track of a flight without an inertial unit.
    pub fn track(self) -> Option<Track> {
        match self {
            Self::Static => Some(Track::Mast),
            Self::Approach => Some(Track::Approach),
            _ => None,
        }
    }
}

impl Track {
    /// How long it lasts unless told otherwise, s.
    pub fn usual_duration_s(self) -> f64 {
        match self {
            Self::Mast | Self::MastAt { .. } => 600.0,
            Self::Approach => 240.0,
        }
    }

    /// The antenna `t_s` after the first epoch; `duration_s` is when the approach ends.
    pub fn state(self, t_s: f64, duration_s: f64) -> AntennaState {
        let (latitude_deg, longitude_deg, height_m) = THRESHOLD;
        let origin = ecef_from_geodetic(latitude_deg, longitude_deg, height_m);
        match self {
            Self::Mast => {
                // On the 0.1 mm grid of message 1006, so that the station sent is the truth.
                let on_grid = origin.map(|v| libm::round(v * 1e4) / 1e4);
                AntennaState {
                    position_e_m: on_grid,
                    velocity_e_mps: Vector3::zeros(),
                }
            }
            Self::MastAt {
                latitude_deg,
                longitude_deg,
            } => AntennaState {
                position_e_m: ecef_from_geodetic(
                    f64::from(latitude_deg),
                    f64::from(longitude_deg),
                    0.0,
                ),
                velocity_e_mps: Vector3::zeros(),
            },
            Self::Approach => {
                let to_go_s = duration_s - t_s;
                let heading = RUNWAY_HEADING_DEG.to_radians();
                let along = Vector3::new(libm::sin(heading), libm::cos(heading), 0.0);
                let up = Vector3::new(0.0, 0.0, 1.0);
                let (height_m, climb_mps) = approach_profile(to_go_s);
                let c_e_enu = c_e_enu(latitude_deg, longitude_deg);
                let offset_enu = along * (-GROUND_SPEED_MPS * to_go_s) + up * height_m;
                AntennaState {
                    position_e_m: origin + c_e_enu * offset_enu,
                    velocity_e_mps: c_e_enu * (along * GROUND_SPEED_MPS + up * climb_mps),
                }
            }
        }
    }
}

/// Height over the threshold, m, and vertical speed, m/s, `to_go_s` before the threshold.
fn approach_profile(to_go_s: f64) -> (f64, f64) {
    let sink_mps = GROUND_SPEED_MPS * libm::tan(GLIDE_PATH_DEG.to_radians());
    // The parabola is centred on the corner, so it meets both straight lines with their slope.
    let into_rounding_s = DESCENT_S + ROUNDING_S / 2.0 - to_go_s;
    if into_rounding_s <= 0.0 {
        (THRESHOLD_CROSSING_M + sink_mps * DESCENT_S, 0.0)
    } else if into_rounding_s < ROUNDING_S {
        let share = into_rounding_s / ROUNDING_S;
        let level_m = THRESHOLD_CROSSING_M + sink_mps * DESCENT_S;
        (
            level_m - 0.5 * sink_mps * share * into_rounding_s,
            -sink_mps * share,
        )
    } else {
        (THRESHOLD_CROSSING_M + sink_mps * to_go_s, -sink_mps)
    }
}

/// Earth-fixed position, m, of a geodetic one. [NGA.STND.0036] 4.14, prime vertical radius.
pub fn ecef_from_geodetic(latitude_deg: f64, longitude_deg: f64, height_m: f64) -> Vector3<f64> {
    let (latitude, longitude) = (latitude_deg.to_radians(), longitude_deg.to_radians());
    let e2 = WGS84_F * (2.0 - WGS84_F);
    let sin = libm::sin(latitude);
    let normal_m = WGS84_A_M / libm::sqrt(1.0 - e2 * sin * sin);
    Vector3::new(
        (normal_m + height_m) * libm::cos(latitude) * libm::cos(longitude),
        (normal_m + height_m) * libm::cos(latitude) * libm::sin(longitude),
        (normal_m * (1.0 - e2) + height_m) * sin,
    )
}

/// Geodetic latitude and longitude, rad, and height, m, by fixed-point iteration on the latitude.
pub fn geodetic_from_ecef(position_e_m: &Vector3<f64>) -> (f64, f64, f64) {
    let e2 = WGS84_F * (2.0 - WGS84_F);
    let axial_m = libm::hypot(position_e_m.x, position_e_m.y);
    let mut z_m = position_e_m.z;
    let mut normal_m = WGS84_A_M;
    for _ in 0..20 {
        let sin = z_m / libm::hypot(axial_m, z_m);
        normal_m = WGS84_A_M / libm::sqrt(1.0 - e2 * sin * sin);
        z_m = position_e_m.z + normal_m * e2 * sin;
    }
    let latitude = libm::atan2(z_m, axial_m);
    let longitude = libm::atan2(position_e_m.y, position_e_m.x);
    (latitude, longitude, libm::hypot(axial_m, z_m) - normal_m)
}

/// Rotation from east, north, up to Earth-fixed axes.
pub fn c_e_enu(latitude_deg: f64, longitude_deg: f64) -> Matrix3<f64> {
    let (latitude, longitude) = (latitude_deg.to_radians(), longitude_deg.to_radians());
    let (sin_lat, cos_lat) = (libm::sin(latitude), libm::cos(latitude));
    let (sin_lon, cos_lon) = (libm::sin(longitude), libm::cos(longitude));
    Matrix3::new(
        -sin_lon,
        -sin_lat * cos_lon,
        cos_lat * cos_lon,
        cos_lon,
        -sin_lat * sin_lon,
        cos_lat * sin_lon,
        0.0,
        cos_lat,
        sin_lat,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_approach_ends_on_the_glide_path_over_the_threshold() {
        let (latitude_deg, longitude_deg, height_m) = THRESHOLD;
        let end = Track::Approach.state(240.0, 240.0);
        let above =
            ecef_from_geodetic(latitude_deg, longitude_deg, height_m + THRESHOLD_CROSSING_M);
        assert!((end.position_e_m - above).norm() < 1e-6);
        let slope = -end.velocity_e_mps.dot(&above.normalize()) / GROUND_SPEED_MPS;
        assert!((slope.atan().to_degrees() - GLIDE_PATH_DEG).abs() < 0.2);
    }

    #[test]
    fn velocity_is_the_rate_of_position() {
        for track in [Track::Mast, Track::Approach] {
            for k in 1..240 {
                let t_s = f64::from(k);
                let before = track.state(t_s - 0.01, 240.0).position_e_m;
                let after = track.state(t_s + 0.01, 240.0).position_e_m;
                let velocity = track.state(t_s, 240.0).velocity_e_mps;
                let rate = (after - before) / 0.02;
                assert!((rate - velocity).norm() < 2e-3, "{track:?} at {t_s} s");
            }
        }
    }

    #[test]
    fn geodetic_coordinates_come_back() {
        let (latitude_deg, longitude_deg, height_m) = THRESHOLD;
        let p = ecef_from_geodetic(latitude_deg, longitude_deg, height_m);
        let (latitude, longitude, height) = geodetic_from_ecef(&p);
        assert!((latitude.to_degrees() - latitude_deg).abs() < 1e-12);
        assert!((longitude.to_degrees() - longitude_deg).abs() < 1e-12);
        assert!((height - height_m).abs() < 1e-7);
    }
}
