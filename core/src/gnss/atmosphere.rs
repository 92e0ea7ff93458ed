//! Tropospheric delay, and the factors by which zenith delays grow towards the horizon.
//!
//! | symbol | code          | unit | meaning                                             |
//! |--------|---------------|------|-----------------------------------------------------|
//! | p, T, e| pressure_hpa, temperature_k, vapour_hpa | hPa, K, hPa | standard atmosphere at a height |
//! | m(E)   | troposphere_mapping | 1 | slant over zenith delay of the troposphere         |
//! | F_pp   | ionosphere_mapping  | 1 | slant over zenith delay of a thin ionosphere       |
//!
//! Equations: [SAASTAMOINEN-1972] zenith delay → `troposphere_zenith_m()`; [DO-229] A.4.2.4 mapping
//! (Black and Eisner) → `troposphere_mapping()`; [DO-229] A.4.4.10.4 → `ionosphere_mapping()`.
//! Departure: Saastamoinen's own 1/cos z mapping is 3 % too large at 10° of elevation, which is 40 cm;
//! the mapping of [DO-229] is good to 1 % down to 4°.

/// Heights the standard atmosphere is asked for, m: lowest land to the top of civil flight. Outside,
/// the value at the end stands; NaN stands for the lower end.
const HEIGHT_RANGE_M: [f64; 2] = [-500.0, 20_000.0];
/// Relative humidity assumed at every height, 1; the usual choice with this model.
const RELATIVE_HUMIDITY: f64 = 0.7;

/// Delay in the zenith, m, at a geodetic latitude and a height above the ellipsoid.
pub fn troposphere_zenith_m(lat_rad: f64, height_m: f64) -> f64 {
    let [lowest_m, highest_m] = HEIGHT_RANGE_M;
    let height_m = if height_m > lowest_m {
        if height_m < highest_m {
            height_m
        } else {
            highest_m
        }
    } else {
        lowest_m
    };
    // Standard atmosphere from 1013.25 hPa and 15 °C at sea level.
    let pressure_hpa = 1013.25 * libm::pow(1.0 - 2.2557e-5 * height_m, 5.2568);
    let temperature_k = 288.15 - 6.5e-3 * height_m;
    let vapour_hpa = 6.108
        * RELATIVE_HUMIDITY
        * libm::exp((17.15 * temperature_k - 4684.0) / (temperature_k - 38.45));
    let gravity = 1.0 - 0.00266 * libm::cos(2.0 * lat_rad) - 0.00028e-3 * height_m;
    let dry_m = 0.002_276_8 * pressure_hpa / gravity;
    let wet_m = 0.002_277 * (1255.0 / temperature_k + 0.05) * vapour_hpa;
    dry_m + wet_m
}

/// Slant over zenith delay of the troposphere; below the horizon its value there, 22.4.
pub fn troposphere_mapping(sin_elevation: f64) -> f64 {
    let sin_elevation = if sin_elevation > 0.0 {
        sin_elevation
    } else {
        0.0
    };
    1.001 / libm::sqrt(0.002_001 + sin_elevation * sin_elevation)
}

/// Slant over zenith delay of an ionosphere thought of as a shell at 350 km.
pub fn ionosphere_mapping(sin_elevation: f64) -> f64 {
    // Re / (Re + 350 km), Re = 6378.1363 km. [DO-229] A.4.4.10.4
    const RATIO: f64 = 6378.1363 / (6378.1363 + 350.0);
    let cos_squared = 1.0 - sin_elevation * sin_elevation;
    1.0 / libm::sqrt(1.0 - RATIO * RATIO * cos_squared)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zenith_delay_is_the_textbook_two_point_four_metres_at_sea_level() {
        // 2.307 m dry by [SAASTAMOINEN-1972] at 45° and 1013.25 hPa, about 0.12 m wet at 70 %.
        let zenith_m = troposphere_zenith_m(45.0_f64.to_radians(), 0.0);
        assert!(zenith_m > 2.40 && zenith_m < 2.46, "{zenith_m}");
        // A quarter of the air pressure at 10 km, and hardly any water.
        let zenith_m = troposphere_zenith_m(45.0_f64.to_radians(), 10_000.0);
        assert!(zenith_m > 0.58 && zenith_m < 0.63, "{zenith_m}");
    }

    #[test]
    fn heights_and_elevations_outside_the_models_stay_at_their_ends() {
        let at = |height_m| troposphere_zenith_m(0.5, height_m);
        assert_eq!(at(-6_371_000.0), at(-500.0));
        assert_eq!(at(1.0e9), at(20_000.0));
        assert_eq!(at(f64::NAN), at(-500.0));
        assert!(at(20_000.0) > 0.0);
        assert_eq!(troposphere_mapping(-1.0), troposphere_mapping(0.0));
        assert!(troposphere_mapping(f64::NAN) > 1.0);
    }

    #[test]
    fn mappings_are_one_in_the_zenith_and_known_at_ten_degrees() {
        let sin = 10.0_f64.to_radians().sin();
        assert!((troposphere_mapping(1.0) - 1.0).abs() < 1e-4);
        // Niell's dry mapping at 10° is 5.56 to 5.6.
        assert!((troposphere_mapping(sin) - 5.58).abs() < 0.03);
        assert!((ionosphere_mapping(1.0) - 1.0).abs() < 1e-15);
        assert!(
            (ionosphere_mapping(sin) - 2.79).abs() < 0.02,
            "{}",
            ionosphere_mapping(sin)
        );
    }
}
