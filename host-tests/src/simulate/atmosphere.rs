//! What the atmosphere adds to a simulated pseudorange.
//!
//! Written from the sources and apart from the receiver's models: troposphere by Saastamoinen in the
//! standard atmosphere, ionosphere by the broadcast model of Klobuchar in its GPS and BDS forms.

use core::f64::consts::PI;

use surefix_core::consts::SPEED_OF_LIGHT_MPS;
use surefix_core::gnss::System;
use surefix_core::gnss::klobuchar::KlobucharParameters;
use surefix_core::gnss::signal::{FREQUENCY_B1I_HZ, FREQUENCY_L1_HZ};
use surefix_core::time::GpsTime;

/// Ionosphere parameters of the simulations, in the sizes of quiet days and on the grid of the
/// broadcast: powers of two times small integers. One set serves both forms of the model.
pub const ALPHA: [f64; 4] = [
    12.0 / 1_073_741_824.0,
    2.0 / 134_217_728.0,
    -1.0 / 16_777_216.0,
    -2.0 / 16_777_216.0,
];
/// As [`ALPHA`], of the period.
pub const BETA: [f64; 4] = [50.0 * 2048.0, 5.0 * 16384.0, -65536.0, -4.0 * 65536.0];

/// Which ionosphere lies over the simulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Ionosphere {
    /// None.
    None,
    /// The broadcast model of GPS, for every satellite.
    Klobuchar,
    /// The broadcast model of BDS, for every satellite.
    KlobucharBds,
}

impl Ionosphere {
    /// The parameters a receiver would take from the broadcast.
    pub fn parameters(self) -> Option<KlobucharParameters> {
        let system = match self {
            Self::None => return None,
            Self::Klobuchar => System::Gps,
            Self::KlobucharBds => System::Bds,
        };
        Some(KlobucharParameters {
            system,
            alpha: ALPHA,
            beta: BETA,
        })
    }
}

/// Where the signal crosses the atmosphere.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Latitude of the antenna, rad.
    pub latitude_rad: f64,
    /// Longitude of the antenna, rad.
    pub longitude_rad: f64,
    /// Ellipsoidal height of the antenna, m.
    pub height_m: f64,
    /// Azimuth of the satellite, rad, from north to east.
    pub azimuth_rad: f64,
    /// Elevation of the satellite, rad.
    pub elevation_rad: f64,
}

/// Tropospheric delay, m: Saastamoinen's zenith delay [SAASTAMOINEN-1972] in the standard atmosphere
/// with a relative humidity of 70 %, mapped to the ray by [DO-229] A.4.2.4.
pub fn troposphere_m(ray: &Ray) -> f64 {
    if ray.elevation_rad <= 0.0 {
        return 0.0;
    }
    let height_m = if ray.height_m > 0.0 {
        ray.height_m
    } else {
        0.0
    };
    let pressure_hpa = 1013.25 * libm::pow(1.0 - 2.2557e-5 * height_m, 5.2568);
    let temperature_k = 288.15 - 6.5e-3 * height_m;
    let vapour_hpa =
        6.108 * 0.7 * libm::exp((17.15 * temperature_k - 4684.0) / (temperature_k - 38.45));
    let gravity = 1.0 - 0.00266 * libm::cos(2.0 * ray.latitude_rad) - 0.00028 * height_m / 1000.0;
    let hydrostatic_m = 0.002_276_8 * pressure_hpa / gravity;
    let wet_m = 0.002_277 * (1255.0 / temperature_k + 0.05) * vapour_hpa;
    let sin_elevation = libm::sin(ray.elevation_rad);
    (hydrostatic_m + wet_m) * 1.001 / libm::sqrt(0.002_001 + sin_elevation * sin_elevation)
}

/// Delay of a pseudorange, m, on a carrier at an instant of GPST.
pub fn ionosphere_m(model: Ionosphere, ray: &Ray, time: GpsTime, frequency_hz: f64) -> f64 {
    let second_of_day = |shift_s: f64| (time.tow_s() - shift_s).rem_euclid(86_400.0);
    let (delay_m, reference_hz) = match model {
        Ionosphere::None => return 0.0,
        Ionosphere::Klobuchar => (klobuchar_gps_m(ray, second_of_day(0.0)), FREQUENCY_L1_HZ),
        Ionosphere::KlobucharBds => (klobuchar_bds_m(ray, second_of_day(14.0)), FREQUENCY_B1I_HZ),
    };
    delay_m * (reference_hz / frequency_hz) * (reference_hz / frequency_hz)
}

/// [IS-GPS-200] 20.3.3.5.2.5 and figure 20-4; angles of the algorithm are semicircles.
fn klobuchar_gps_m(ray: &Ray, second_of_day: f64) -> f64 {
    let elevation = ray.elevation_rad / PI;
    let earth_angle = 0.0137 / (elevation + 0.11) - 0.022;
    let mut latitude = ray.latitude_rad / PI + earth_angle * libm::cos(ray.azimuth_rad);
    latitude = latitude.clamp(-0.416, 0.416);
    let longitude = ray.longitude_rad / PI
        + earth_angle * libm::sin(ray.azimuth_rad) / libm::cos(latitude * PI);
    let magnetic = latitude + 0.064 * libm::cos((longitude - 1.617) * PI);
    let local_s = (43_200.0 * longitude + second_of_day).rem_euclid(86_400.0);
    let amplitude_s = polynomial(&ALPHA, magnetic).max(0.0);
    let period_s = polynomial(&BETA, magnetic).max(72_000.0);
    let phase = 2.0 * PI * (local_s - 50_400.0) / period_s;
    let obliquity = 1.0 + 16.0 * (0.53 - elevation) * (0.53 - elevation) * (0.53 - elevation);
    let vertical_s = if phase.abs() < 1.57 {
        let square = phase * phase;
        5e-9 + amplitude_s * (1.0 - square / 2.0 + square * square / 24.0)
    } else {
        5e-9
    };
    SPEED_OF_LIGHT_MPS * obliquity * vertical_s
}

/// [BDS-SIS-ICD-B1I] 5.2.4.7: geographic latitude, shell at 375 km, Earth radius 6378 km.
fn klobuchar_bds_m(ray: &Ray, second_of_day: f64) -> f64 {
    let ratio = 6378.0 / (6378.0 + 375.0);
    let sin_zenith = ratio * libm::cos(ray.elevation_rad);
    let earth_angle = PI / 2.0 - ray.elevation_rad - libm::asin(sin_zenith);
    let latitude = libm::asin(
        libm::sin(ray.latitude_rad) * libm::cos(earth_angle)
            + libm::cos(ray.latitude_rad) * libm::sin(earth_angle) * libm::cos(ray.azimuth_rad),
    );
    let longitude = ray.longitude_rad
        + libm::asin(libm::sin(earth_angle) * libm::sin(ray.azimuth_rad) / libm::cos(latitude));
    let local_s = (second_of_day + longitude / PI * 43_200.0).rem_euclid(86_400.0);
    let from_equator = (latitude / PI).abs();
    let amplitude_s = polynomial(&ALPHA, from_equator).max(0.0);
    let period_s = polynomial(&BETA, from_equator).clamp(72_000.0, 172_800.0);
    let from_peak_s = local_s - 50_400.0;
    let vertical_s = if from_peak_s.abs() < period_s / 4.0 {
        5e-9 + amplitude_s * libm::cos(2.0 * PI * from_peak_s / period_s)
    } else {
        5e-9
    };
    SPEED_OF_LIGHT_MPS * vertical_s / libm::sqrt(1.0 - sin_zenith * sin_zenith)
}

fn polynomial(coefficients: &[f64; 4], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ray(elevation_deg: f64) -> Ray {
        Ray {
            latitude_rad: 0.5,
            longitude_rad: 2.0,
            height_m: 100.0,
            azimuth_rad: 1.0,
            elevation_rad: elevation_deg.to_radians(),
        }
    }

    #[test]
    fn delays_have_the_sizes_of_the_atmosphere() {
        let zenith_m = troposphere_m(&ray(90.0));
        assert!((2.3..2.5).contains(&zenith_m), "{zenith_m}");
        assert!(troposphere_m(&ray(10.0)) > 5.0 * zenith_m);
        for model in [Ionosphere::Klobuchar, Ionosphere::KlobucharBds] {
            let at = |tow_s| {
                let time = GpsTime::from_week_tow_s(2420, tow_s);
                ionosphere_m(model, &ray(90.0), time, FREQUENCY_L1_HZ)
            };
            // 06:20 UTC is 14:00 local time, the peak; 18:00 UTC is night.
            let (peak_m, night_m) = (at(22_800), at(64_800));
            assert!((2.0..12.0).contains(&peak_m), "{model:?} {peak_m}");
            assert!((1.4..1.6).contains(&night_m), "{model:?} {night_m}");
        }
    }
}
