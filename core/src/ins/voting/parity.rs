//! Differences between units, and which unit explains them.
//!
//! In: mean rates of up to three units over the same time. Out: nothing wrong, the unit that differs
//! from both others while those agree, or a difference without such a unit.
//!
//! | symbol | code        | unit         | meaning                                                     |
//! |--------|-------------|--------------|-------------------------------------------------------------|
//! | d_ij   |             | rad/s, m/s²  | mean of unit i minus that of unit j, less what was learned   |
//! | τ      | `length_s`  | s            | length of the mean                                          |
//! | N      | `white`     | rad²/s, m²/s³ | density of the white noise, squared                        |
//! | P      | `spread`    | (rad/s)², (m/s²)² | variance of the learned bias                           |
//! | q      | `walk`      | (rad/s)²/s, (m/s²)²/s | density of the walk of the bias, squared           |
//! | s      | `scale`     | 1            | one sigma of scale factor and misalignment                  |
//! | ρ²     |             | 1            | (|d| − bound)² / σ²                                         |
//!
//! σ² = (N_i + N_j)/τ + P_i + P_j + (q_i + q_j) τ + (s_i² + s_j²) |m|², for accelerometers with the noise that
//! the lever arms add. The bound is what time stamps, interpolation and lever arms can make of the motion:
//! time stamps that are off by δ move the integral over τ by δ times what the rate changed.
//!
//! Mid-value: with three units the misfit of the hypothesis that unit k lies is ρ² of the other two, the
//! parity without it. Isolated is the one whose misfit is the least by [`MARGIN`] and passes itself.
//! The voting of three inertial systems: [P0] introduction; parity space as in `raim/parity.rs`.

use nalgebra::Vector3;

use super::config::UnitConfig;
use super::grid::{Channels, seconds};
use crate::ins::MAX_UNITS;

/// A hypothesis is taken when it is likelier than any other by exp(MARGIN/2), 150 times.
const MARGIN: f64 = 10.0;
/// Places of units are known this well, m.
const PLACE_M: f64 = 0.01;
/// Variance of the angular acceleration of a cell over that of a rate of a cell and its length squared:
/// (3² + 4² + 1²)/4.
const ACCELERATION_NOISE: f64 = 6.5;
/// The same for the change over several cells, of which the ends are left: 2 (1.5² + 0.5²).
const CHANGE_NOISE: f64 = 5.0;
/// Standard gravity, m/s²: what a scale error of an accelerometer makes a first bias of.
const GRAVITY_MPS2: f64 = 9.806_65;

/// The three pairs: 0 and 1, 0 and 2, 1 and 2.
pub(super) fn pairs<T: Copy>(of: &[T; MAX_UNITS]) -> [(T, T); MAX_UNITS] {
    let [a, b, c] = *of;
    [(a, b), (a, c), (b, c)]
}

/// Gyroscopes and accelerometers of one number each, in all axes.
pub(super) fn sensors(gyro: f64, accel: f64) -> Channels {
    Channels::new(gyro, gyro, gyro, accel, accel, accel)
}

/// What the thresholds have to know of a unit.
#[derive(Clone, Copy, Debug)]
pub(super) struct UnitModel {
    pub(super) white: Channels,
    pub(super) walk: Channels,
    /// Variance of the first bias; of accelerometers with a scale error of 1 g.
    pub(super) first: Channels,
    pub(super) scale_squared: f64,
    pub(super) timing_s: f64,
    interval_s: f64,
    /// Error of a rate by interpolation, over the second difference of the rate between cells.
    interpolation: f64,
    pub(super) arm_b_m: Vector3<f64>,
}

impl UnitModel {
    pub(super) fn new(unit: &UnitConfig, cell_ns: i64) -> Self {
        let square = |x: f64| x * x;
        let (noise, tolerance) = (&unit.noise, &unit.tolerance);
        let interval_ns = i64::from(unit.interval_ns);
        let cells = interval_ns as f64 / cell_ns as f64;
        Self {
            white: sensors(square(noise.arw), square(noise.vrw)),
            walk: sensors(square(noise.gyro_bias_walk), square(noise.accel_bias_walk)),
            first: sensors(
                square(tolerance.gyro_bias_radps),
                square(tolerance.accel_bias_mps2) + square(tolerance.scale * GRAVITY_MPS2),
            ),
            scale_squared: square(tolerance.scale),
            timing_s: tolerance.timing_s,
            interval_s: seconds(interval_ns),
            // A line through the last two samples errs by h³ of the second derivative over 16 in an
            // integral, at both ends of the cell; within one long sample, by h² over 3 in the rate.
            interpolation: libm::fmin(cells * cells * cells / 8.0, cells * cells / 3.0),
            arm_b_m: Vector3::from(unit.lever_arm_b_m),
        }
    }
}

/// How the body moved over a time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    /// Mean of the mid-value.
    pub(super) mean: Channels,
    /// Least and most of it.
    pub(super) least: Channels,
    pub(super) most: Channels,
    /// Largest second difference between cells, of gyroscopes and accelerometers.
    pub(super) bend: [f64; 2],
    /// The specific force at which the biases were learned, m/s².
    pub(super) learned_force: Vector3<f64>,
    pub(super) cells: u32,
    pub(super) cell_s: f64,
}

/// Largest part of each sensor's vector.
pub(super) fn largest(of: &Channels) -> [f64; 2] {
    let three = |from: usize| {
        let parts = of.iter().skip(from).take(3);
        parts.fold(0.0, |most, part| libm::fmax(most, libm::fabs(*part)))
    };
    [three(0), three(3)]
}

fn norm2(x: f64, y: f64, z: f64) -> f64 {
    x * x + y * y + z * z
}

impl Motion {
    fn length_s(&self) -> f64 {
        f64::from(self.cells) * self.cell_s
    }

    /// σ² of the difference of a pair; `spread` is that of what was learned of both.
    pub(super) fn variance(&self, a: &UnitModel, b: &UnitModel, spread: &Channels) -> Channels {
        let length_s = self.length_s();
        // A sample that is longer than the mean has the noise of its own length.
        let over = |unit: &UnitModel| unit.white / libm::fmax(length_s, unit.interval_s);
        let m = &self.mean;
        let force = Vector3::new(m.w, m.a, m.b) - self.learned_force;
        let turned = norm2(m.x, m.y, m.z);
        let scale =
            (a.scale_squared + b.scale_squared) * sensors(turned, norm2(force.x, force.y, force.z));
        over(a) + over(b) + spread + (a.walk + b.walk) * length_s + scale + self.lever_noise(a, b)
    }

    /// What the angular acceleration's noise makes of the distance between two units.
    fn lever_noise(&self, a: &UnitModel, b: &UnitModel) -> Channels {
        let apart_m = a.arm_b_m - b.arm_b_m;
        let gyro = libm::fmax(a.white.x, b.white.x) / self.cell_s;
        let factor = if self.cells > 1 {
            let length_s = self.length_s();
            CHANGE_NOISE / (length_s * length_s)
        } else {
            ACCELERATION_NOISE / (self.cell_s * self.cell_s)
        };
        sensors(0.0, apart_m.norm_squared() * gyro * factor)
    }

    /// What a difference may be besides, at the most.
    pub(super) fn bound(&self, a: &UnitModel, b: &UnitModel) -> Channels {
        let length_s = self.length_s();
        let range = self.most - self.least;
        let ends = if self.cells > 1 {
            2.0 / f64::from(self.cells)
        } else {
            1.0
        };
        let [bend_gyro, bend_accel] = self.bend;
        let bend = (a.interpolation + b.interpolation) * ends;
        let turn2 = libm::fmax(
            norm2(self.least.x, self.least.y, self.least.z),
            norm2(self.most.x, self.most.y, self.most.z),
        );
        let turn_change = libm::sqrt(norm2(range.x, range.y, range.z));
        range * ((a.timing_s + b.timing_s) / length_s)
            + sensors(
                bend * bend_gyro,
                bend * bend_accel + PLACE_M * (turn2 + turn_change / length_s),
            )
    }

    /// What the differences between cells may be made of by the motion, beside noise.
    pub(super) fn roughness(&self, a: &UnitModel, b: &UnitModel, step: [f64; 2]) -> Channels {
        let bend =
            (a.timing_s + b.timing_s) / self.cell_s + 4.0 * (a.interpolation + b.interpolation);
        let scale = libm::sqrt(a.scale_squared + b.scale_squared);
        let ([bend_gyro, bend_accel], [step_gyro, step_accel]) = (self.bend, step);
        sensors(
            bend * bend_gyro + scale * step_gyro,
            bend * bend_accel
                + scale * step_accel
                + PLACE_M * (bend_gyro / self.cell_s + 2.0 * step_gyro),
        )
    }

    /// Variance of the difference between the differences of two cells that follow each other.
    pub(super) fn step_variance(&self, a: &UnitModel, b: &UnitModel) -> Channels {
        let one = Self { cells: 1, ..*self };
        (a.white + b.white) * (2.0 / self.cell_s) + one.lever_noise(a, b) * 4.0
    }
}

/// ρ² of every channel.
pub(super) fn exceed(difference: &Channels, bound: &Channels, variance: &Channels) -> Channels {
    let mut squares = Channels::zeros();
    let all = difference.iter().zip(bound).zip(variance);
    for (square, ((difference, bound), variance)) in squares.iter_mut().zip(all) {
        let beyond = libm::fabs(*difference) - bound;
        *square = if beyond > 0.0 {
            beyond * beyond / variance
        } else {
            0.0
        };
    }
    squares
}

/// What differences say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Decision {
    /// No pair differs.
    Agree,
    /// This unit differs from both others, which agree.
    Isolate(usize),
    /// Some pair differs, and no unit explains it.
    Undetermined,
}

/// Decides from ρ² of the pairs that were compared, over the threshold's square.
pub(super) fn decide(pairs: &[Option<Channels>; MAX_UNITS], threshold2: f64) -> Decision {
    let [first, second, third] = pairs;
    let of = |pair: &Option<Channels>, channel: usize| {
        pair.as_ref()
            .and_then(|squares| squares.get(channel).copied())
    };
    let mut worst = threshold2;
    let mut decision = Decision::Agree;
    for channel in 0..6 {
        let squares = [first, second, third].map(|pair| of(pair, channel));
        let mut largest = worst;
        let mut differs = false;
        for square in squares.iter().flatten() {
            // What is no number is a difference, and is not hidden by one that is.
            if !(*square <= largest) {
                differs = true;
                largest = if square.is_nan() {
                    f64::INFINITY
                } else {
                    *square
                };
            }
        }
        if !differs {
            continue;
        }
        worst = largest;
        // The misfit of unit k is what the pair without it differs by.
        decision = match squares {
            [Some(without_2), Some(without_1), Some(without_0)] => {
                alone([without_0, without_1, without_2], threshold2)
            }
            _ => Decision::Undetermined,
        };
    }
    decision
}

/// The unit whose hypothesis fits, and no other's.
fn alone(misfit: [f64; MAX_UNITS], threshold2: f64) -> Decision {
    for (unit, own) in misfit.iter().enumerate() {
        let mut others = misfit
            .iter()
            .enumerate()
            .filter(|(other, _)| *other != unit);
        if *own <= threshold2 && others.all(|(_, other)| *other >= own + MARGIN) {
            return Decision::Isolate(unit);
        }
    }
    Decision::Undetermined
}

/// The accelerometers' part.
pub(super) fn force_of(rates: &Channels) -> Vector3<f64> {
    Vector3::new(rates.w, rates.a, rates.b)
}

/// ρ² of every pair that can be compared.
#[inline(never)]
pub(super) fn differences(
    rates: &[Option<Channels>; MAX_UNITS],
    learned: &[Channels; MAX_UNITS],
    spread: &[Channels; MAX_UNITS],
    models: &[UnitModel; MAX_UNITS],
    motion: &Motion,
) -> [Option<Channels>; MAX_UNITS] {
    let mut squares = [None; MAX_UNITS];
    let all = squares.iter_mut().zip(pairs(rates)).zip(pairs(learned));
    for (((square, rates), (of_a, of_b)), ((a, b), (spread_a, spread_b))) in
        all.zip(pairs(models).into_iter().zip(pairs(spread)))
    {
        let (Some(rates_a), Some(rates_b)) = rates else {
            continue;
        };
        let difference = (rates_a - of_a) - (rates_b - of_b);
        let variance = motion.variance(&a, &b, &(spread_a + spread_b));
        *square = Some(exceed(&difference, &motion.bound(&a, &b), &variance));
    }
    squares
}

/// The mid-value of three, the mean of two, per channel.
pub(super) fn middle(of: &[Option<Channels>; MAX_UNITS]) -> Option<Channels> {
    match *of {
        [Some(a), Some(b), Some(c)] => {
            let mut mid = Channels::zeros();
            let all = a.iter().zip(&b).zip(&c);
            for (mid, ((a, b), c)) in mid.iter_mut().zip(all) {
                let (low, high) = (libm::fmin(*a, *b), libm::fmax(*a, *b));
                *mid = libm::fmax(low, libm::fmin(high, *c));
            }
            Some(mid)
        }
        [Some(a), Some(b), None] | [Some(a), None, Some(b)] | [None, Some(a), Some(b)] => {
            Some((a + b) * 0.5)
        }
        [Some(a), None, None] | [None, Some(a), None] | [None, None, Some(a)] => Some(a),
        [None, None, None] => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(value: f64) -> Option<Channels> {
        Some(Channels::repeat(value))
    }

    #[test]
    fn the_unit_that_differs_from_both_others_is_isolated() {
        // Pairs 01, 02, 12.
        assert_eq!(
            decide(&[all(50.0), all(60.0), all(1.0)], 36.0),
            Decision::Isolate(0)
        );
        assert_eq!(
            decide(&[all(50.0), all(1.0), all(60.0)], 36.0),
            Decision::Isolate(1)
        );
        assert_eq!(
            decide(&[all(1.0), all(50.0), all(60.0)], 36.0),
            Decision::Isolate(2)
        );
        assert_eq!(
            decide(&[all(1.0), all(20.0), all(36.0)], 36.0),
            Decision::Agree
        );
    }

    #[test]
    fn a_difference_without_a_culprit_is_told_as_such() {
        let undetermined = [
            [all(50.0), all(50.0), all(50.0)],
            // Two hypotheses fit about as well.
            [all(40.0), all(9.0), all(11.0)],
            [all(50.0), None, None],
            [all(f64::NAN), all(1.0), all(1.0)],
        ];
        for pairs in undetermined {
            assert_eq!(decide(&pairs, 36.0), Decision::Undetermined, "{pairs:?}");
        }
        assert_eq!(decide(&[all(30.0), None, None], 36.0), Decision::Agree);
    }

    #[test]
    fn one_axis_of_one_sensor_is_enough() {
        let mut one = Channels::zeros();
        one.b = 100.0;
        let pairs = [Some(one), all(0.5), Some(one)];
        assert_eq!(decide(&pairs, 36.0), Decision::Isolate(1));
    }

    #[test]
    fn the_mid_value_is_never_that_of_the_one_that_lies() {
        let value = |x| Some(Channels::repeat(x));
        for wrong in [-1e9, 1e9] {
            for units in [
                [value(wrong), value(1.0), value(1.1)],
                [value(1.0), value(wrong), value(1.1)],
                [value(1.1), value(1.0), value(wrong)],
            ] {
                let mid = middle(&units).unwrap();
                assert!(mid.iter().all(|x| (1.0..=1.1).contains(x)), "{mid}");
            }
        }
    }
}
