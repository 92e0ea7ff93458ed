//! The height that a barometer gives to a sky with too few satellites.
//!
//! In: heights of the barometer; heights and vertical levels of positions that satellites with redundancy
//! gave and that passed their test. Out: a height of the antenna with its sigma, and a bound on what a
//! satellite that was faulty all the while can have put into it.
//!
//! | symbol | code       | unit | meaning                                                              |
//! |--------|------------|------|----------------------------------------------------------------------|
//! | b      | `bias_m`   | m    | height of the antenna minus pressure altitude, a running mean        |
//! | B      | `bound_m`  | m    | the same mean of the vertical levels                                 |
//! | h̄      | `mean_m`   | m    | the same mean of the pressure altitudes                              |
//! | K      |            | 1    | quantile that a level is above a sigma at least                      |
//!
//! | m      | `moved_m`  | m    | what the height has changed since the sample, by its last rate       |
//!
//! ```text
//! σ² = (B/K)² + σ_b² + (d (age + T))² + (s (h − h̄))² + m²
//! ```
//!
//! The height of an epoch is that of the last sample at its instant or before, also when later ones have come
//! because the epoch is late. In the mean m is part of B.
//!
//! **Why B.** b comes from the satellites, and one of them may have been faulty and stayed unnoticed. A height
//! from a faulty satellite must not vouch for it. But each height that b is a mean of was within its level
//! of the truth, but for the risk that the level itself has; so b is within B of it. B is therefore
//! handed on beside the height, and whoever tests with it takes it for an error of up to B that comes
//! *together* with any fault (`raim/bounded.rs`). Derivation: docs/decisions/017-aids.md.

use heapless::Deque;

use crate::gnss::solution::HeightRow;
use crate::ins::aiding::PressureSample;
use crate::ins::barometer::PressureHeight;
use crate::ins::{Barometer, BarometerModel};
use crate::time::{GpsTime, NS_PER_S};

/// The bias is a mean over so long, s: longer than the noise of barometers and the motion of multipath, shorter
/// than the weather.
const AVERAGE_S: f64 = 60.0;
/// It is used from so long on, s.
const LEAST_S: f64 = 30.0;
/// So long after the last position it was learned from it is not used any longer, ns.
const MAX_AGE_NS: i64 = 1800 * NS_PER_S;
/// Without a position for so long it is learned anew, ns.
const MAX_PAUSE_NS: i64 = 120 * NS_PER_S;
/// Age of a sample of the barometer at an epoch, ns.
const MAX_SAMPLE_AGE_NS: i64 = NS_PER_S;
/// Heights kept for epochs that are late: 0.6 s at 50 Hz.
const KEPT: usize = 32;
/// A level is at least so many sigmas: Q⁻¹(0.5e-7).
const LEVEL_SIGMAS: f64 = 5.33;
/// A position farther from the mean than its level and so many sigmas says that the barometer leapt.
const LEAP_SIGMAS: f64 = 4.0;

/// A height with what it may hide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibratedHeight {
    /// As a row of the solution.
    pub row: HeightRow,
    /// Largest error that a satellite faulty at its calibration can have left in it, m.
    pub bound_m: f64,
}

/// A barometer and its bias.
#[derive(Clone, Debug)]
pub struct HeightCalibration {
    model: Option<BarometerModel>,
    barometer: Barometer,
    /// The last heights, in the order of their times.
    heights: Deque<PressureHeight, KEPT>,
    bias_m: f64,
    bound_m: f64,
    mean_m: f64,
    learned_s: f64,
    last: Option<GpsTime>,
}

impl HeightCalibration {
    /// No barometer.
    pub const EMPTY: Self = Self {
        model: None,
        barometer: Barometer::EMPTY,
        heights: Deque::new(),
        bias_m: 0.0,
        bound_m: 0.0,
        mean_m: 0.0,
        learned_s: 0.0,
        last: None,
    };

    /// A barometer of this kind, or none.
    pub fn configure(&mut self, model: Option<BarometerModel>) {
        *self = Self {
            model,
            ..Self::EMPTY
        };
    }

    /// A sample of the barometer.
    pub fn on_pressure(&mut self, sample: &PressureSample) {
        if self.model.is_none() {
            return;
        }
        if let Some(height) = self.barometer.take(sample) {
            if self.heights.is_full() {
                let _ = self.heights.pop_front();
            }
            // There is room now.
            let _ = self.heights.push_back(height);
        }
    }

    /// Pressure altitude at an instant, and what it may have changed since its sample, m.
    fn height_at(&self, time: GpsTime) -> Option<(f64, f64)> {
        // One that is stuck has none, whatever it said before.
        self.barometer.latest(time, MAX_SAMPLE_AGE_NS)?;
        let mut until = self
            .heights
            .iter()
            .rev()
            .skip_while(|height| height.time > time);
        let now = until.next()?;
        let age_ns = time.ns().saturating_sub(now.time.ns());
        if age_ns == 0 {
            return Some((now.height_m, 0.0));
        }
        let before = until.next()?;
        let interval_ns = now.time.ns().saturating_sub(before.time.ns());
        if age_ns > MAX_SAMPLE_AGE_NS || !(1..=MAX_SAMPLE_AGE_NS).contains(&interval_ns) {
            return None;
        }
        let moved_m = (now.height_m - before.height_m) * age_ns as f64 / interval_ns as f64;
        Some((now.height_m, libm::fabs(moved_m)))
    }

    /// The bias is not known any longer.
    pub fn forget(&mut self) {
        self.learned_s = 0.0;
        self.last = None;
    }

    /// All times so far were wrong by this much, ns.
    pub fn shift(&mut self, by_ns: i64) {
        self.barometer.shift(by_ns);
        for height in self.heights.iter_mut() {
            height.time = height.time.plus_ns(by_ns);
        }
        self.last = self.last.map(|last| last.plus_ns(by_ns));
    }

    /// Whether there is a barometer.
    pub const fn is_on(&self) -> bool {
        self.model.is_some()
    }

    /// Height of the antenna minus pressure altitude, m, once it is known.
    pub fn bias_m(&self) -> Option<f64> {
        (self.learned_s >= LEAST_S).then_some(self.bias_m)
    }

    /// A position of satellites that tested each other: height above the ellipsoid, m, and its vertical level.
    pub fn learn(&mut self, time: GpsTime, height_m: f64, vpl_m: f64) {
        let Some(model) = self.model else {
            return;
        };
        let Some((now_m, moved_m)) = self.height_at(time) else {
            return;
        };
        let vpl_m = vpl_m + moved_m;
        let offset_m = height_m - now_m;
        if !(offset_m.is_finite() && vpl_m.is_finite()) {
            return;
        }
        let since_ns = self.last.map(|last| time.ns().saturating_sub(last.ns()));
        let goes_on = since_ns.is_some_and(|ns| (1..=MAX_PAUSE_NS).contains(&ns));
        let away_m = libm::fabs(offset_m - self.bias_m);
        let expected_m = self.bound_m + vpl_m + LEAP_SIGMAS * self.own_sigma_m(&model, 0.0, now_m);
        if !(goes_on && away_m <= expected_m) {
            self.forget();
        }
        let elapsed_s = match since_ns {
            Some(ns) if self.last.is_some() => ns as f64 / NS_PER_S as f64,
            _ => 0.0,
        };
        self.last = Some(time);
        self.learned_s += elapsed_s;
        if self.learned_s > AVERAGE_S {
            self.learned_s = AVERAGE_S;
        }
        // The first one begins the mean.
        let gain = if self.learned_s > 0.0 {
            elapsed_s / self.learned_s
        } else {
            1.0
        };
        let gain = if gain < 1.0 { gain } else { 1.0 };
        self.bias_m += gain * (offset_m - self.bias_m);
        self.bound_m += gain * (vpl_m - self.bound_m);
        self.mean_m += gain * (now_m - self.mean_m);
    }

    /// Sigma of the barometer itself against its mean, m.
    fn own_sigma_m(&self, model: &BarometerModel, age_s: f64, height_m: f64) -> f64 {
        let drift_m = model.drift_mps * (age_s + AVERAGE_S);
        let scale_m = model.scale * (height_m - self.mean_m);
        libm::sqrt(model.sigma_m * model.sigma_m + drift_m * drift_m + scale_m * scale_m)
    }

    /// The height of the antenna at an epoch.
    pub fn height(&self, time: GpsTime) -> Option<CalibratedHeight> {
        let model = self.model?;
        self.bias_m()?;
        let age_ns = time.ns().saturating_sub(self.last?.ns());
        if !(0..=MAX_AGE_NS).contains(&age_ns) {
            return None;
        }
        let (now_m, moved_m) = self.height_at(time)?;
        let own_m = self.own_sigma_m(&model, age_ns as f64 / NS_PER_S as f64, now_m);
        let of_satellites_m = self.bound_m / LEVEL_SIGMAS;
        Some(CalibratedHeight {
            row: HeightRow {
                height_m: now_m + self.bias_m,
                sigma_m: libm::sqrt(
                    own_m * own_m + of_satellites_m * of_satellites_m + moved_m * moved_m,
                ),
            },
            bound_m: self.bound_m,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(second: i64) -> GpsTime {
        GpsTime::from_week_tow_s(2244, 1000 + second)
    }

    fn sample(second: i64, pressure_pa: f64) -> PressureSample {
        PressureSample {
            time: at(second),
            pressure_pa: pressure_pa + 0.01 * (second % 2) as f64,
            temperature_c: 15.0,
        }
    }

    fn learned(seconds: i64) -> HeightCalibration {
        let mut calibration = HeightCalibration::EMPTY;
        calibration.configure(Some(BarometerModel::PRESET));
        for second in 0..seconds {
            calibration.on_pressure(&sample(second, 101_325.0));
            calibration.learn(at(second), 45.0, 16.0);
        }
        calibration
    }

    #[test]
    fn bias_is_the_mean_difference_and_known_after_half_a_minute() {
        assert_eq!(learned(30).height(at(30)), None);
        let calibration = learned(100);
        let height = calibration.height(at(99)).unwrap();
        assert!((height.row.height_m - 45.0).abs() < 0.01);
        assert!((height.bound_m - 16.0).abs() < 1e-9);
        // A level that is five sigma of the satellites, the noise and the drift of a minute.
        let expected_m = ((16.0_f64 / 5.33).powi(2) + 0.09 + 0.09).sqrt();
        assert!((height.row.sigma_m - expected_m).abs() < 1e-3);
    }

    #[test]
    fn height_is_that_of_the_instant_however_late_the_epoch() {
        let mut calibration = learned(100);
        let after = |milliseconds: i64| at(100).plus_ns(milliseconds * 1_000_000);
        // A climb of 20 m/s, samples at 20 Hz.
        let mut climb = |from: i64, to: i64| {
            for milliseconds in (from..to).step_by(50) {
                calibration.on_pressure(&PressureSample {
                    time: after(milliseconds),
                    pressure_pa: 101_325.0 - 0.24 * milliseconds as f64,
                    temperature_c: 15.0,
                });
            }
            [after(1000), after(1020)].map(|time| calibration.height(time).unwrap().row)
        };
        let at_once = climb(0, 1001);
        let late = climb(1050, 1401);
        assert_eq!(at_once, late);
        let [on, between] = late;
        assert!((on.height_m - 45.0 - 20.0).abs() < 0.1, "{on:?}");
        // 20 ms at 20 m/s.
        let moved_m = (between.sigma_m.powi(2) - on.sigma_m.powi(2)).sqrt();
        assert!((moved_m - 0.4).abs() < 0.01, "{moved_m}");
        let next = calibration.height(after(1400)).unwrap().row;
        assert!((next.height_m - 45.0 - 28.0).abs() < 0.1, "{next:?}");
    }

    #[test]
    fn sigma_grows_with_age_and_with_the_way_up() {
        let mut calibration = learned(100);
        let sigma_m = |calibration: &HeightCalibration, second| {
            calibration
                .height(at(second))
                .map(|height| height.row.sigma_m)
        };
        calibration.on_pressure(&sample(700, 101_325.0));
        let old_m = sigma_m(&calibration, 700).unwrap();
        assert!((old_m * old_m - 9.0 - 0.09 - (0.005_f64 * 661.0).powi(2)).abs() < 0.1);
        // 1,000 m higher.
        calibration.on_pressure(&sample(701, 89_874.5));
        assert!(sigma_m(&calibration, 701).unwrap() > 50.0);
        calibration.on_pressure(&sample(2000, 101_325.0));
        assert_eq!(sigma_m(&calibration, 2000), None);
    }

    #[test]
    fn height_that_leaps_is_learned_anew() {
        let mut calibration = learned(100);
        calibration.on_pressure(&sample(100, 100_000.0));
        calibration.learn(at(100), 45.0, 16.0);
        assert_eq!(calibration.height(at(100)), None);
        let mut calibration = learned(100);
        calibration.forget();
        assert_eq!(calibration.height(at(99)), None);
    }

    #[test]
    fn numbers_that_are_none_are_not_learned() {
        let mut calibration = learned(100);
        let before = calibration.height(at(99));
        calibration.learn(at(99), f64::NAN, 16.0);
        calibration.learn(at(99), 45.0, f64::INFINITY);
        assert_eq!(calibration.height(at(99)), before);
    }
}
