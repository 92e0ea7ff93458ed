//! Ionospheric delay from the broadcast Klobuchar parameters, GPS form and BDS form.
//!
//! In: eight parameters, the time, the receiver's latitude and longitude, the satellite's azimuth and
//! elevation. Out: the delay in seconds of the carrier the parameters are meant for.
//!
//! | symbol | code          | unit | meaning                                                    |
//! |--------|---------------|------|------------------------------------------------------------|
//! | ψ      | psi           | rad  | earth's central angle between receiver and pierce point    |
//! | φi, φM | pierce_lat    | rad  | latitude of the pierce point                               |
//! | λi, λM | pierce_lon    | rad  | longitude of the pierce point                              |
//! | φm     | geomagnetic_latitude | semicircle (GPS form), rad (returned) | geomagnetic latitude |
//! | AMP, A2| amplitude_s   | s    | height of the daytime cosine                               |
//! | PER, A4| period_s      | s    | its period                                                 |
//!
//! Equations: [IS-GPS-200] 20.3.3.5.2.5 → `gps_form()`; [BDS-SIS-ICD-B1I] 5.2.4.7 → `bds_form()`.
//! Not the same thing twice: BDS takes geographic latitude, a shell at 375 km, the absolute value of
//! the latitude in its polynomials, a period limited on both sides, a true cosine, and delays B1I.

use core::f64::consts::PI;

use super::System;
use super::signal::{FREQUENCY_B1I_HZ, FREQUENCY_L1_HZ};
use crate::time::{GPST_MINUS_BDT_S, GpsTime};

/// Broadcast ionosphere of one system.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KlobucharParameters {
    /// Who broadcast them, and so which form they belong to. Galileo broadcasts none.
    pub system: System,
    /// α0 to α3: s, s/semicircle, s/semicircle², s/semicircle³.
    pub alpha: [f64; 4],
    /// β0 to β3: s, s/semicircle, s/semicircle², s/semicircle³.
    pub beta: [f64; 4],
}

/// Where a delay is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyPoint {
    /// Geodetic latitude of the receiver, rad.
    pub lat_rad: f64,
    /// Longitude of the receiver, rad.
    pub lon_rad: f64,
    /// Azimuth of the satellite, clockwise from north, rad.
    pub azimuth_rad: f64,
    /// Elevation of the satellite, rad.
    pub elevation_rad: f64,
}

/// What was received of both systems' parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BroadcastIonosphere {
    /// From GPS.
    pub gps: Option<KlobucharParameters>,
    /// From BDS.
    pub bds: Option<KlobucharParameters>,
}

impl BroadcastIonosphere {
    /// Nothing received.
    pub const EMPTY: Self = Self {
        gps: None,
        bds: None,
    };

    /// Takes parameters in. Returns false, and keeps what it had, when a number is not finite or the
    /// system broadcasts no Klobuchar parameters.
    pub fn insert(&mut self, parameters: KlobucharParameters) -> bool {
        let all = parameters.alpha.iter().chain(&parameters.beta);
        if !all.clone().all(|value| value.is_finite()) {
            return false;
        }
        match parameters.system {
            System::Gps => self.gps = Some(parameters),
            System::Bds => self.bds = Some(parameters),
            System::Galileo => return false,
        }
        true
    }

    /// Parameters for every satellite of an epoch: those of GPS, else those of BDS.
    ///
    /// One model for all, not each system its own: where the two models differ, the difference
    /// would look like an elevation-dependent error of one constellation.
    pub fn parameters(&self) -> Option<&KlobucharParameters> {
        self.gps.as_ref().or(self.bds.as_ref())
    }
}

/// Seconds in a day.
const DAY_S: f64 = 86_400.0;
/// Shortest period of the daytime cosine, s. [IS-GPS-200] figure 20-4, [BDS-SIS-ICD-B1I] 5.2.4.7.
const MIN_PERIOD_S: f64 = 72_000.0;
/// Longest period of the daytime cosine, s. [BDS-SIS-ICD-B1I] 5.2.4.7.
const MAX_PERIOD_BDS_S: f64 = 172_800.0;
/// Local time of the largest delay, s. [IS-GPS-200] figure 20-4, [BDS-SIS-ICD-B1I] 5.2.4.7.
const NOON_S: f64 = 50_400.0;
/// Delay at night in the zenith, s. [IS-GPS-200] figure 20-4, [BDS-SIS-ICD-B1I] 5.2.4.7.
const NIGHT_S: f64 = 5.0e-9;
/// Earth radius of the BDS form, km. [BDS-SIS-ICD-B1I] 5.2.4.7.
const BDS_EARTH_RADIUS_KM: f64 = 6378.0;
/// Height of the BDS form's shell, km. [BDS-SIS-ICD-B1I] 5.2.4.7.
const BDS_SHELL_KM: f64 = 375.0;

impl KlobucharParameters {
    /// Delay of a carrier, s, positive; `None` when the arithmetic gives no finite number.
    pub fn delay_s(&self, time: GpsTime, at: &SkyPoint, frequency_hz: f64) -> Option<f64> {
        let (delay_s, reference_hz) = match self.system {
            System::Bds => (self.bds_form(time, at), FREQUENCY_B1I_HZ),
            System::Gps | System::Galileo => (self.gps_form(time, at), FREQUENCY_L1_HZ),
        };
        let ratio = reference_hz / frequency_hz;
        let scaled_s = delay_s * (ratio * ratio);
        scaled_s.is_finite().then_some(scaled_s)
    }

    /// [IS-GPS-200] 20.3.3.5.2.5: delay of L1, s.
    fn gps_form(&self, time: GpsTime, at: &SkyPoint) -> f64 {
        let elevation = at.elevation_rad / PI;
        let (_, longitude, geomagnetic_latitude) = gps_pierce_point(at);
        let local_s = wrap_day(0.5 * DAY_S * longitude + day_seconds(time.tow_ns()));
        let below_zenith = 0.53 - elevation;
        let obliquity = 1.0 + 16.0 * (below_zenith * below_zenith * below_zenith);
        let period_s = {
            let period_s = cubic(&self.beta, geomagnetic_latitude);
            if period_s > MIN_PERIOD_S {
                period_s
            } else {
                MIN_PERIOD_S
            }
        };
        let amplitude_s = {
            let amplitude_s = cubic(&self.alpha, geomagnetic_latitude);
            if amplitude_s > 0.0 { amplitude_s } else { 0.0 }
        };
        let phase = 2.0 * PI * (local_s - NOON_S) / period_s;
        let daytime_s = if libm::fabs(phase) < 1.57 {
            let square = phase * phase;
            amplitude_s * (1.0 - square / 2.0 + square * square / 24.0)
        } else {
            0.0
        };
        obliquity * (NIGHT_S + daytime_s)
    }

    /// [BDS-SIS-ICD-B1I] 5.2.4.7: delay of B1I, s.
    fn bds_form(&self, time: GpsTime, at: &SkyPoint) -> f64 {
        let ratio = BDS_EARTH_RADIUS_KM / (BDS_EARTH_RADIUS_KM + BDS_SHELL_KM);
        let shell_sine = ratio * libm::cos(at.elevation_rad);
        let psi = PI / 2.0 - at.elevation_rad - libm::asin(shell_sine);
        let (sin_psi, cos_psi) = libm::sincos(psi);
        let (sin_lat, cos_lat) = libm::sincos(at.lat_rad);
        let (sin_azimuth, cos_azimuth) = libm::sincos(at.azimuth_rad);
        let pierce_lat = libm::asin(sin_lat * cos_psi + cos_lat * sin_psi * cos_azimuth);
        let pierce_lon = at.lon_rad + libm::asin(sin_psi * sin_azimuth / libm::cos(pierce_lat));
        let bdt_tow_ns = time
            .plus_ns(-GPST_MINUS_BDT_S * crate::time::NS_PER_S)
            .tow_ns();
        let local_s = wrap_day(0.5 * DAY_S * pierce_lon / PI + day_seconds(bdt_tow_ns));
        let semicircles = libm::fabs(pierce_lat / PI);
        let amplitude_s = {
            let amplitude_s = cubic(&self.alpha, semicircles);
            if amplitude_s > 0.0 { amplitude_s } else { 0.0 }
        };
        let period_s = cubic(&self.beta, semicircles).clamp(MIN_PERIOD_S, MAX_PERIOD_BDS_S);
        let from_noon_s = local_s - NOON_S;
        let daytime_s = if libm::fabs(from_noon_s) < period_s / 4.0 {
            amplitude_s * libm::cos(2.0 * PI * from_noon_s / period_s)
        } else {
            0.0
        };
        (NIGHT_S + daytime_s) / libm::sqrt(1.0 - shell_sine * shell_sine)
    }
}

/// Latitude and longitude of the pierce point and its geomagnetic latitude, semicircles.
/// [IS-GPS-200] figure 20-4.
fn gps_pierce_point(at: &SkyPoint) -> (f64, f64, f64) {
    let psi = 0.0137 / (at.elevation_rad / PI + 0.11) - 0.022;
    let (sin_azimuth, cos_azimuth) = libm::sincos(at.azimuth_rad);
    let latitude = (at.lat_rad / PI + psi * cos_azimuth).clamp(-0.416, 0.416);
    let longitude = at.lon_rad / PI + psi * sin_azimuth / libm::cos(latitude * PI);
    let geomagnetic_latitude = latitude + 0.064 * libm::cos((longitude - 1.617) * PI);
    (latitude, longitude, geomagnetic_latitude)
}

/// Geomagnetic latitude of the pierce point, rad. [IS-GPS-200] figure 20-4.
pub fn geomagnetic_latitude_rad(at: &SkyPoint) -> f64 {
    gps_pierce_point(at).2 * PI
}

fn cubic(coefficients: &[f64; 4], x: f64) -> f64 {
    let [c0, c1, c2, c3] = *coefficients;
    c0 + x * (c1 + x * (c2 + x * c3))
}

fn day_seconds(tow_ns: i64) -> f64 {
    (tow_ns % (86_400 * crate::time::NS_PER_S)) as f64 / crate::time::NS_PER_S as f64
}

/// Seconds of a day from at most a day outside it.
fn wrap_day(seconds: f64) -> f64 {
    if seconds >= DAY_S {
        seconds - DAY_S
    } else if seconds < 0.0 {
        seconds + DAY_S
    } else {
        seconds
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn degrees(lat: f64, lon: f64, azimuth: f64, elevation: f64) -> SkyPoint {
        SkyPoint {
            lat_rad: lat.to_radians(),
            lon_rad: lon.to_radians(),
            azimuth_rad: azimuth.to_radians(),
            elevation_rad: elevation.to_radians(),
        }
    }

    #[test]
    fn night_in_the_zenith_is_five_nanoseconds() {
        for system in [System::Gps, System::Bds] {
            let parameters = KlobucharParameters {
                system,
                alpha: [1.0e-8, 0.0, 0.0, 0.0],
                beta: [9.0e4, 0.0, 0.0, 0.0],
            };
            // 01:00 local time.
            let at = degrees(45.0, 0.0, 0.0, 90.0);
            let time = GpsTime::from_week_tow_s(2200, 3600);
            let reference_hz = if system == System::Bds {
                FREQUENCY_B1I_HZ
            } else {
                FREQUENCY_L1_HZ
            };
            let delay_s = parameters.delay_s(time, &at, reference_hz).unwrap();
            // The GPS obliquity is 1.000432 at 90° of elevation, not 1.
            assert!((delay_s / NIGHT_S - 1.0).abs() < 5e-4, "{delay_s}");
        }
    }

    #[test]
    fn noon_adds_the_amplitude_and_a_lower_carrier_waits_longer() {
        for system in [System::Gps, System::Bds] {
            let parameters = KlobucharParameters {
                system,
                alpha: [2.0e-8, 0.0, 0.0, 0.0],
                beta: [9.0e4, 0.0, 0.0, 0.0],
            };
            let at = degrees(45.0, 0.0, 0.0, 90.0);
            let mut time = GpsTime::from_week_tow_s(2200, 50_400);
            let mut reference_hz = FREQUENCY_L1_HZ;
            if system == System::Bds {
                time = time.plus_ns(14 * crate::time::NS_PER_S);
                reference_hz = FREQUENCY_B1I_HZ;
            }
            let delay_s = parameters.delay_s(time, &at, reference_hz).unwrap();
            assert!((delay_s / 2.5e-8 - 1.0).abs() < 5e-4, "{delay_s}");
            let half = parameters.delay_s(time, &at, reference_hz / 2.0).unwrap();
            assert!((half / delay_s - 4.0).abs() < 1e-12);
        }
    }

    #[test]
    fn bds_form_uses_geographic_latitude_and_limits_the_period() {
        let mut parameters = KlobucharParameters {
            system: System::Bds,
            alpha: [0.0, 4.0e-8, 0.0, 0.0],
            beta: [1.0e7, 0.0, 0.0, 0.0],
        };
        let time = GpsTime::from_week_tow_s(2200, 14 + 50_400 + 21_600);
        let at = degrees(-45.0, 0.0, 0.0, 90.0);
        // A quarter of the longest period after noon is zero daytime delay; an eighth is cos 45°.
        // |φ/π| = 1/4: the southern hemisphere has the same amplitude as the northern.
        let delay_s = parameters.delay_s(time, &at, FREQUENCY_B1I_HZ).unwrap();
        let expected_s = NIGHT_S + 1.0e-8 * libm::sqrt(0.5);
        assert!(
            (delay_s - expected_s).abs() < 1e-15,
            "{delay_s} {expected_s}"
        );
        parameters.beta = [0.0; 4];
        // The shortest period ends 18,000 s after noon.
        let delay_s = parameters.delay_s(time, &at, FREQUENCY_B1I_HZ).unwrap();
        assert!((delay_s - NIGHT_S).abs() < 1e-15, "{delay_s}");
    }

    #[test]
    fn parameters_that_are_no_numbers_are_not_kept() {
        let mut ionosphere = BroadcastIonosphere::EMPTY;
        let mut parameters = KlobucharParameters {
            system: System::Gps,
            alpha: [0.0; 4],
            beta: [f64::NAN, 0.0, 0.0, 0.0],
        };
        assert!(!ionosphere.insert(parameters));
        assert_eq!(ionosphere.parameters(), None);
        parameters.beta = [0.0; 4];
        assert!(ionosphere.insert(parameters));
        assert_eq!(ionosphere.parameters(), Some(&parameters));
    }
}
