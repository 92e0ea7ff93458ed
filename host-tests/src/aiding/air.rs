//! The air around a track, and a barometer in it.

use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::SeedableRng;
use surefix_core::ins::PressureSample;
use surefix_core::time::{GpsTime, NS_PER_S};

use crate::simulate::noise::{GaussMarkov, normal};

/// Streams of random numbers that no other part of a simulation draws from.
const STREAM_AIR: u64 = (1 << 33) + 7;

/// How a day's air and a sensor differ from the standard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Air {
    /// Height of the standard pressure above the ellipsoid, m: weather and geoid together.
    pub bias_m: f64,
    /// How the bias wanders: one sigma of its rate, m/s, a Gauss-Markov process of [`Air::rate_tau_s`].
    pub rate_mps: f64,
    /// See [`Air::rate_mps`], s.
    pub rate_tau_s: f64,
    /// Geometric height differences are larger by this part.
    pub scale: f64,
    /// White noise of a sample, m.
    pub sigma_m: f64,
    /// Time constant of sensor and tubing, s.
    pub lag_s: f64,
    /// Samples per second.
    pub rate_hz: u32,
}

impl Air {
    /// An ordinary day and a good sensor, drawn by a seed.
    pub fn of_day(seed: u64) -> Self {
        let mut random = ChaCha20Rng::seed_from_u64(seed);
        random.set_stream(STREAM_AIR);
        Self {
            bias_m: 40.0 * normal(&mut random),
            rate_mps: 0.004,
            rate_tau_s: 600.0,
            scale: 0.03 * normal(&mut random),
            sigma_m: 0.25,
            lag_s: 0.2,
            rate_hz: 10,
        }
    }
}

/// What goes wrong with a barometer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BarometerFault {
    /// From a time on, s, all heights are off by so much, m.
    Step {
        /// From here on, s.
        from_s: f64,
        /// By so much, m.
        by_m: f64,
    },
    /// From a time on heights run away.
    Ramp {
        /// From here on, s.
        from_s: f64,
        /// So fast, m/s.
        by_mps: f64,
    },
    /// From a time on the height stays what it was, with its noise or without.
    Stuck {
        /// From here on, s.
        from_s: f64,
        /// The noise goes on.
        noisy: bool,
    },
}

/// Standard pressure of a pressure altitude below 11 km, Pa. [US-1976] (33a).
pub fn pressure_pa(height_m: f64) -> f64 {
    const EXPONENT: f64 = 9.806_65 * 0.028_964_4 / (8.314_32 * 6.5e-3);
    101_325.0 * libm::pow(1.0 - 6.5e-3 * height_m / 288.15, EXPONENT)
}

impl Air {
    /// What a barometer measures from t = 0 to `duration_s` where the antenna's height above the ellipsoid is
    /// `height_m` of the time since `start`, s.
    pub fn samples(
        &self,
        start: GpsTime,
        duration_s: f64,
        seed: u64,
        fault: Option<BarometerFault>,
        height_m: impl Fn(f64) -> f64,
    ) -> Vec<PressureSample> {
        let mut random = ChaCha20Rng::seed_from_u64(seed);
        random.set_stream(STREAM_AIR + 1);
        let step_s = 1.0 / f64::from(self.rate_hz);
        let mut rate = GaussMarkov::new(&mut random);
        let ground_m = height_m(0.0);
        let (mut wandered_m, mut sensed_m) = (0.0, None);
        let mut stuck_m = None;
        let count = (duration_s * f64::from(self.rate_hz)) as i64;
        (0..=count)
            .map(|k| {
                let t_s = k as f64 * step_s;
                wandered_m +=
                    self.rate_mps * rate.step(&mut random, step_s, self.rate_tau_s) * step_s;
                let true_m = ground_m + (height_m(t_s) - ground_m) / (1.0 + self.scale);
                let before_m = sensed_m.unwrap_or(true_m);
                let kept = libm::exp(-step_s / self.lag_s);
                let lagged_m = true_m + kept * (before_m - true_m);
                sensed_m = Some(lagged_m);
                let noise_m = self.sigma_m * normal(&mut random);
                let clean_m = lagged_m - self.bias_m + wandered_m;
                let measured_m = match fault {
                    Some(BarometerFault::Step { from_s, by_m }) if t_s >= from_s => {
                        clean_m + by_m + noise_m
                    }
                    Some(BarometerFault::Ramp { from_s, by_mps }) if t_s >= from_s => {
                        clean_m + by_mps * (t_s - from_s) + noise_m
                    }
                    Some(BarometerFault::Stuck { from_s, noisy }) if t_s >= from_s => {
                        let held_m = *stuck_m.get_or_insert(clean_m + noise_m);
                        held_m + if noisy { noise_m } else { 0.0 }
                    }
                    _ => clean_m + noise_m,
                };
                PressureSample {
                    time: start.plus_ns((t_s * NS_PER_S as f64).round() as i64),
                    pressure_pa: pressure_pa(measured_m),
                    temperature_c: 20.0,
                }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use surefix_core::ins::barometer::pressure_altitude_m;

    #[test]
    fn pressures_give_back_their_heights() {
        for height_m in [-300.0, 0.0, 1500.0, 9000.0] {
            let found_m = pressure_altitude_m(pressure_pa(height_m)).unwrap();
            assert!((found_m - height_m).abs() < 1e-6);
        }
    }

    #[test]
    fn a_barometer_follows_a_climb_with_its_errors() {
        let air = Air {
            scale: 0.0,
            rate_mps: 0.0,
            ..Air::of_day(3)
        };
        let start = GpsTime::from_week_tow_s(2244, 0);
        let samples = air.samples(start, 60.0, 1, None, |t_s| 100.0 + 5.0 * t_s);
        let heights: Vec<f64> = samples
            .iter()
            .map(|sample| pressure_altitude_m(sample.pressure_pa).unwrap())
            .collect();
        let climb_mps = (heights[600] - heights[100]) / 50.0;
        assert!((climb_mps - 5.0).abs() < 0.03, "{climb_mps}");
        let stuck = Some(BarometerFault::Stuck {
            from_s: 10.0,
            noisy: false,
        });
        let samples = air.samples(start, 60.0, 1, stuck, |t_s| 100.0 + 5.0 * t_s);
        assert_eq!(samples[150].pressure_pa, samples[600].pressure_pa);
    }
}
