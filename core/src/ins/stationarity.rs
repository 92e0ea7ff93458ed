//! Whether a unit is at rest, as far as its own samples can tell.
//!
//! In: the increments of the unit. Out: how much specific force and angular rate scattered over the last
//! second, and the mean rate.
//!
//! | symbol | code       | unit        | meaning                                        |
//! |--------|------------|-------------|------------------------------------------------|
//! | f_k    |            | m/s²        | mean specific force of sample k, body axes     |
//! | ω_k    |            | rad/s       | mean angular rate of sample k, body axes       |
//! | S      | `spread`   | (as above)² | Σ abs(x_k)²/n − abs(Σ x_k/n)²                  |
//!
//! Equations: variances of the window as in the stance tests of [SKOG-2010] (the moving variance of the
//! accelerometers and the energy of the gyroscopes, with the mean removed from that too).
//! What it cannot tell: a unit that moves at constant velocity in smooth air senses exactly what one at rest
//! does. It is one of several conditions, never the only one: `tight/aids.rs`.
//! Cost: 16 additions and as many products per sample.

use nalgebra::Vector3;

use super::mechanisation::Increment;

/// Length of a block, s.
const BLOCK_S: f64 = 0.1;
/// Blocks of the window that are complete; with them counts the one that is not.
const BLOCKS: usize = 9;

#[derive(Clone, Copy, Debug)]
struct Block {
    n: f64,
    dt_s: f64,
    force: [f64; 3],
    force_square: f64,
    rate: [f64; 3],
    rate_square: f64,
}

impl Block {
    const EMPTY: Self = Self {
        n: 0.0,
        dt_s: 0.0,
        force: [0.0; 3],
        force_square: 0.0,
        rate: [0.0; 3],
        rate_square: 0.0,
    };

    fn add(&mut self, other: &Self) {
        self.n += other.n;
        self.dt_s += other.dt_s;
        self.force_square += other.force_square;
        self.rate_square += other.rate_square;
        for (sum, part) in self.force.iter_mut().zip(&other.force) {
            *sum += part;
        }
        for (sum, part) in self.rate.iter_mut().zip(&other.rate) {
            *sum += part;
        }
    }
}

/// What the samples of the last second say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    /// Standard deviation of the specific force, all axes together, m/s².
    pub force_mps2: f64,
    /// Standard deviation of the angular rate, all axes together, rad/s.
    pub rate_radps: f64,
    /// Length of the mean angular rate, rad/s.
    pub mean_rate_radps: f64,
}

/// The samples of the last second, summed up.
#[derive(Clone, Debug)]
pub struct Stationarity {
    blocks: [Block; BLOCKS],
    /// Where the next complete block goes.
    next: usize,
    complete: usize,
    current: Block,
}

impl Stationarity {
    /// No sample.
    pub const EMPTY: Self = Self {
        blocks: [Block::EMPTY; BLOCKS],
        next: 0,
        complete: 0,
        current: Block::EMPTY,
    };

    /// Forgets all, as after a gap.
    pub fn restart(&mut self) {
        self.complete = 0;
        self.next = 0;
        self.current = Block::EMPTY;
    }

    /// Takes a sample; one without a length counts as a gap.
    pub fn add(&mut self, increment: &Increment) {
        let dt_s = increment.dt_s;
        if !(dt_s > 0.0) {
            self.restart();
            return;
        }
        let mean = |v: &Vector3<f64>| [v.x / dt_s, v.y / dt_s, v.z / dt_s];
        let square = |v: &[f64; 3]| v.iter().map(|part| part * part).sum::<f64>();
        let (force, rate) = (mean(&increment.dv_b), mean(&increment.dtheta_b));
        self.current.add(&Block {
            n: 1.0,
            dt_s,
            force,
            force_square: square(&force),
            rate,
            rate_square: square(&rate),
        });
        // Half a sample of tolerance: the lengths of ten samples are not exactly a block.
        if self.current.dt_s + 0.5 * dt_s >= BLOCK_S {
            if let Some(place) = self.blocks.get_mut(self.next) {
                *place = self.current;
            }
            self.next = (self.next + 1) % BLOCKS;
            self.complete = if self.complete < BLOCKS {
                self.complete + 1
            } else {
                BLOCKS
            };
            self.current = Block::EMPTY;
        }
    }

    /// What the last second says; `None` before it is complete, or where a sum is no number.
    pub fn scatter(&self) -> Option<Scatter> {
        if self.complete < BLOCKS {
            return None;
        }
        let mut all = self.current;
        for block in &self.blocks {
            all.add(block);
        }
        let spread = |square: f64, sum: &[f64; 3]| {
            let mean = sum.map(|part| part / all.n);
            let of_mean: f64 = mean.iter().map(|part| part * part).sum();
            let variance = square / all.n - of_mean;
            // Rounding can leave a variance of nothing below nothing.
            let root = libm::sqrt(if variance < 0.0 { 0.0 } else { variance });
            (root, libm::sqrt(of_mean))
        };
        let (force_mps2, _) = spread(all.force_square, &all.force);
        let (rate_radps, mean_rate_radps) = spread(all.rate_square, &all.rate);
        let scatter = Scatter {
            force_mps2,
            rate_radps,
            mean_rate_radps,
        };
        [force_mps2, rate_radps, mean_rate_radps]
            .iter()
            .all(|value| value.is_finite())
            .then_some(scatter)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn increment(force: [f64; 3], rate: [f64; 3]) -> Increment {
        Increment {
            dtheta_b: Vector3::from(rate) * 0.01,
            dv_b: Vector3::from(force) * 0.01,
            dt_s: 0.01,
        }
    }

    fn after(samples: impl Iterator<Item = Increment>) -> Option<Scatter> {
        let mut window = Stationarity::EMPTY;
        samples.for_each(|sample| window.add(&sample));
        window.scatter()
    }

    #[test]
    fn scatter_is_the_standard_deviation_of_the_last_second() {
        // The seconds before are of no consequence.
        let samples = (0..300).map(|k| {
            let part = if k < 150 { 50.0 } else { f64::from(k % 2) };
            increment([0.0, 0.2 * part, -9.8], [0.0, 0.0, 0.01 * part])
        });
        let scatter = after(samples).unwrap();
        assert!((scatter.force_mps2 - 0.1).abs() < 1e-3, "{scatter:?}");
        assert!((scatter.rate_radps - 0.005).abs() < 1e-4, "{scatter:?}");
        assert!((scatter.mean_rate_radps - 0.005).abs() < 1e-4);
    }

    #[test]
    fn before_a_second_is_complete_nothing_is_said() {
        let samples = |n| (0..n).map(|_| increment([0.0, 0.0, -9.8], [0.0; 3]));
        assert_eq!(after(samples(85)), None);
        assert!(after(samples(101)).is_some());
        let with_gap = samples(120).chain([Increment {
            dt_s: 0.0,
            ..increment([0.0; 3], [0.0; 3])
        }]);
        assert_eq!(after(with_gap), None);
    }

    #[test]
    fn samples_that_are_no_numbers_are_no_rest() {
        let samples = (0..120).map(|k| {
            let force = if k == 100 { f64::NAN } else { 9.8 };
            increment([0.0, 0.0, force], [0.0; 3])
        });
        assert_eq!(after(samples), None);
    }
}
