//! Static pressure to height, and what is wrong with a barometer that always says the same.
//!
//! In: samples of a barometer. Out: pressure altitude, or the reason there is none.
//!
//! | symbol | code              | unit | meaning                                      |
//! |--------|-------------------|------|----------------------------------------------|
//! | p      | `pressure_pa`     | Pa   | static pressure                              |
//! | p₀     | `SEA_LEVEL_PA`    | Pa   | standard pressure at sea level               |
//! | T₀, L  | `SEA_LEVEL_K`, `LAPSE_K_PER_M` | K, K/m | standard temperature and its lapse |
//! | h      |                   | m    | geopotential height in the standard atmosphere |
//!
//! Equations: [US-1976] (33a), (33b) solved for the height: below 11 km h = (T₀/L)(1 − (p/p₀)^(R L/g M)),
//! from there to 20 km h = h₁ + (R T₁/g M) ln(p₁/p).
//! Assumes nothing of the day's weather: the difference to the height above the ellipsoid is the bias, which
//! whoever uses the height has to find. Geopotential is taken for geometric, 0.03 % at 2 km, part of the
//! scale error. The temperature of the sensor is not that of the air and is not used.

use super::aiding::PressureSample;
use crate::time::GpsTime;

/// p₀. [US-1976] table 2.
const SEA_LEVEL_PA: f64 = 101_325.0;
/// T₀. [US-1976] table 2.
const SEA_LEVEL_K: f64 = 288.15;
/// L, downwards positive. [US-1976] table 4.
const LAPSE_K_PER_M: f64 = 6.5e-3;
/// R/(g M): gas constant 8.31432 J/(mol K), 9.80665 m/s², 0.0289644 kg/mol. [US-1976] table 2.
const GAS_M_PER_K: f64 = 8.314_32 / (9.806_65 * 0.028_964_4);
/// h₁, where the tropopause begins. [US-1976] table 4.
const TROPOPAUSE_M: f64 = 11_000.0;
/// T₁.
const TROPOPAUSE_K: f64 = SEA_LEVEL_K - LAPSE_K_PER_M * TROPOPAUSE_M;
/// p₁. [US-1976] table I.
const TROPOPAUSE_PA: f64 = 22_632.06;
/// Pressures that a height is made of, Pa: 20 km, and 1.5 km below the sea.
const PRESSURE_PA: core::ops::RangeInclusive<f64> = 5_475.0..=120_000.0;

/// Pressure altitude, m; `None` for a pressure beyond −1.5 to 20 km, and for NaN.
pub fn pressure_altitude_m(pressure_pa: f64) -> Option<f64> {
    if !PRESSURE_PA.contains(&pressure_pa) {
        return None;
    }
    Some(if pressure_pa > TROPOPAUSE_PA {
        let ratio = libm::pow(pressure_pa / SEA_LEVEL_PA, GAS_M_PER_K * LAPSE_K_PER_M);
        SEA_LEVEL_K / LAPSE_K_PER_M * (1.0 - ratio)
    } else {
        TROPOPAUSE_M + GAS_M_PER_K * TROPOPAUSE_K * libm::log(TROPOPAUSE_PA / pressure_pa)
    })
}

/// The same pressure to the last bit in so many samples one after the other: the sensor has stopped
/// converting. The finest of them resolves less than its own noise.
pub const STUCK_SAMPLES: u8 = 20;

/// A height of the barometer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PressureHeight {
    /// When.
    pub time: GpsTime,
    /// Pressure altitude, m.
    pub height_m: f64,
}

/// The latest height of a barometer, if it can be one.
#[derive(Clone, Debug)]
pub struct Barometer {
    last: Option<PressureHeight>,
    last_pa: f64,
    repeats: u8,
}

impl Barometer {
    /// No sample yet.
    pub const EMPTY: Self = Self {
        last: None,
        last_pa: 0.0,
        repeats: 0,
    };

    /// Takes a sample; gives its height unless the pressure is none, the time does not go on, or the
    /// sensor is stuck.
    pub fn take(&mut self, sample: &PressureSample) -> Option<PressureHeight> {
        let goes_on = self
            .last
            .is_none_or(|last| sample.time.ns() > last.time.ns());
        if !goes_on {
            return None;
        }
        if sample.pressure_pa == self.last_pa {
            self.repeats = self.repeats.saturating_add(1);
        } else {
            self.repeats = 0;
        }
        self.last_pa = sample.pressure_pa;
        let height_m = pressure_altitude_m(sample.pressure_pa)?;
        let height = PressureHeight {
            time: sample.time,
            height_m,
        };
        self.last = Some(height);
        (self.repeats < STUCK_SAMPLES).then_some(height)
    }

    /// The latest height, not older than `max_age_ns` at `now`.
    pub fn latest(&self, now: GpsTime, max_age_ns: i64) -> Option<PressureHeight> {
        let age_ns = |height: &PressureHeight| now.ns().wrapping_sub(height.time.ns());
        self.last
            .filter(|height| (-max_age_ns..=max_age_ns).contains(&age_ns(height)))
            .filter(|_| self.repeats < STUCK_SAMPLES)
    }

    /// All times so far were wrong by this much, ns.
    pub fn shift(&mut self, by_ns: i64) {
        if let Some(last) = &mut self.last {
            last.time = last.time.plus_ns(by_ns);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_are_those_of_the_standard_atmosphere() {
        // [US-1976] table I, geopotential heights.
        for (height_m, pressure_pa) in [
            (-1000.0, 113_929.0),
            (0.0, 101_325.0),
            (1000.0, 89_874.5),
            (5000.0, 54_019.9),
            (11_000.0, 22_632.06),
            (15_000.0, 12_044.5),
            (20_000.0, 5_474.88),
        ] {
            let found_m = pressure_altitude_m(pressure_pa).unwrap_or(20_000.0);
            assert!((found_m - height_m).abs() < 0.2, "{found_m} for {height_m}");
        }
        let (below, above) = (TROPOPAUSE_PA * 1.000_001, TROPOPAUSE_PA * 0.999_999);
        let step_m = pressure_altitude_m(above).unwrap() - pressure_altitude_m(below).unwrap();
        assert!((0.0..0.1).contains(&step_m), "{step_m}");
    }

    #[test]
    fn pressures_that_are_none_give_no_height() {
        for pressure_pa in [f64::NAN, 0.0, -1.0, 5_000.0, 130_000.0, f64::INFINITY] {
            assert_eq!(pressure_altitude_m(pressure_pa), None);
        }
    }

    #[test]
    fn sensor_that_repeats_itself_gives_no_height() {
        let mut barometer = Barometer::EMPTY;
        let sample = |k: i64, pressure_pa| PressureSample {
            time: GpsTime::from_ns(k * 100_000_000),
            pressure_pa,
            temperature_c: 20.0,
        };
        for k in 0..=i64::from(STUCK_SAMPLES) {
            assert_eq!(barometer.take(&sample(k, 1e5)).is_some(), k < 20, "{k}");
        }
        assert_eq!(
            barometer.latest(GpsTime::from_ns(2_000_000_000), 1_000_000_000),
            None
        );
        assert!(barometer.take(&sample(30, 99_999.0)).is_some());
        // A time that does not go on is no sample.
        assert!(barometer.take(&sample(30, 99_998.0)).is_none());
        assert!(barometer.take(&sample(29, 99_998.0)).is_none());
    }
}
