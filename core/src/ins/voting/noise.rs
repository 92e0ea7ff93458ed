//! Tests of how a unit's samples scatter, and of when they were measured.
//!
//! | symbol | code     | unit     | meaning                                                       |
//! |--------|----------|----------|---------------------------------------------------------------|
//! | e_k    |          | rad/s, m/s² | difference d_ij of cell k minus that of the cell before: free of biases |
//! | S      | `sums`   | (rad/s)², (m/s²)² | Σ e²; its expectation is the number of cells times σ_e²  |
//! | g      |          | rad/s²   | angular acceleration of the mid-value, over blocks of 0.1 s     |
//! | δ_ij   | `delay`  | s        | by how much unit i is later than j: −Σ d·g / Σ g·g              |
//!
//! S over its expectation is a chi-square variable over its ν degrees of freedom; differences of neighbours are
//! correlated by −1/2, which takes a third of them. Its quantile is that of Wilson and Hilferty, [AS] 26.4.17.
//! A delay makes d_ij = −δ g: linear regression. d is of one block and g of its neighbours on both sides,
//! so that the two have no noise in common.

use nalgebra::{Matrix3, Vector3};

use super::blocks::Block;
use super::grid::Channels;
use super::parity::{Motion, UnitModel, exceed, pairs};
use crate::ins::MAX_UNITS;

/// Data sheets are taken to be right to this factor on the variance.
const SHEET_FACTOR: f64 = 1.5;
/// What is kept of the sums of a regression from block to block: 30 s.
const KEEP: f64 = 1.0 - 1.0 / 300.0;
/// The angular accelerations must be this many times what noise makes of them, squared.
const MIN_MOTION: f64 = 10.0;

const ZERO: Channels = Channels::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0);

/// Sums of squares over a second.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scatter {
    before: [Option<Channels>; MAX_UNITS],
    sums: [Channels; MAX_UNITS],
    counts: [u32; MAX_UNITS],
}

impl Scatter {
    pub(super) const EMPTY: Self = Self {
        before: [None; MAX_UNITS],
        sums: [ZERO; MAX_UNITS],
        counts: [0; MAX_UNITS],
    };

    /// Takes the rates of a cell.
    pub(super) fn add(&mut self, units: &[Option<Channels>; MAX_UNITS]) {
        let all = self.before.iter_mut().zip(&mut self.sums);
        let all = all.zip(&mut self.counts).zip(pairs(units));
        for (((before, sum), count), pair) in all {
            let now = match pair {
                (Some(a), Some(b)) => Some(a - b),
                _ => None,
            };
            if let (Some(now), Some(before)) = (now, *before) {
                let step = now - before;
                *sum += step.component_mul(&step);
                *count = count.saturating_add(1);
            }
            *before = now;
        }
    }

    /// ρ² of every pair that was compared over half of `cells`, in units in which `quantile`² is the threshold.
    #[inline(never)]
    pub(super) fn squares(
        &mut self,
        models: &[UnitModel; MAX_UNITS],
        motion: &Motion,
        step: [f64; 2],
        cells: u32,
        quantile: f64,
    ) -> [Option<Channels>; MAX_UNITS] {
        let mut squares = [None; MAX_UNITS];
        let all = self.sums.iter().zip(&self.counts).zip(pairs(models));
        for (square, ((sum, count), (a, b))) in squares.iter_mut().zip(all) {
            if count.saturating_mul(2) < cells {
                continue;
            }
            let number = f64::from(*count);
            let spread = 2.0 / (9.0 * number * (2.0 / 3.0));
            let root = 1.0 - spread + quantile * libm::sqrt(spread);
            let rough = motion.roughness(&a, &b, step);
            let limit = motion.step_variance(&a, &b) * (SHEET_FACTOR * root * root * root)
                + rough.component_mul(&rough) * 2.0;
            *square = Some(sum.component_div(&(limit * number)) * (quantile * quantile));
        }
        self.sums = [ZERO; MAX_UNITS];
        self.counts = [0; MAX_UNITS];
        squares
    }
}

/// Sums of the regression on the angular acceleration.
#[derive(Clone, Copy, Debug)]
pub(super) struct Delay {
    /// Mid-values of the last block and the one before, rad/s.
    middles: [Option<Vector3<f64>>; 2],
    /// Differences of the pairs over the last block.
    differences: [Option<Vector3<f64>>; MAX_UNITS],
    products: [f64; MAX_UNITS],
    /// Σ g·g.
    accelerations: f64,
    /// What noise makes of it.
    noise: f64,
    /// Σ of the angular acceleration of one axis times the rate of each, and Σ of the former: what scale
    /// errors with misalignments, and biases, make of the products.
    rates: Matrix3<f64>,
    sum: Vector3<f64>,
}

fn turn(of: &Channels) -> Vector3<f64> {
    Vector3::new(of.x, of.y, of.z)
}

impl Delay {
    pub(super) const EMPTY: Self = Self {
        middles: [None; 2],
        differences: [None; MAX_UNITS],
        products: [0.0; MAX_UNITS],
        accelerations: 0.0,
        noise: 0.0,
        rates: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        sum: Vector3::new(0.0, 0.0, 0.0),
    };

    /// Takes a block of 0.1 s; `white` is the noisiest unit's.
    pub(super) fn add(
        &mut self,
        block: &Block,
        learned: &[Channels; MAX_UNITS],
        middle: &Channels,
        cell_s: f64,
        white: f64,
    ) {
        let length_s = f64::from(block.cells) * cell_s;
        let middle = turn(middle);
        let [last, before] = self.middles;
        if let (Some(last), Some(before)) = (last, before)
            && self.differences.iter().any(Option::is_some)
        {
            let g = (middle - before) / (2.0 * length_s);
            for (product, difference) in self.products.iter_mut().zip(&self.differences) {
                *product *= KEEP;
                if let Some(difference) = difference {
                    *product += difference.dot(&g);
                }
            }
            self.accelerations = self.accelerations * KEEP + g.norm_squared();
            // Three axes, two means of the noise of one unit at the most.
            self.noise = self.noise * KEEP + 1.5 * white / (length_s * length_s * length_s);
            self.rates = self.rates * KEEP + g * last.transpose();
            self.sum = self.sum * KEEP + g;
        }
        self.middles = [Some(middle), last];
        let means = block.means();
        let all = self.differences.iter_mut().zip(pairs(&means));
        for ((difference, mean), learned) in all.zip(pairs(learned)) {
            *difference = match (mean, learned) {
                ((Some(a), Some(b)), (of_a, of_b)) => Some(turn(&((a - of_a) - (b - of_b)))),
                _ => None,
            };
        }
    }

    /// A block that was not whole: what comes next has no neighbours.
    pub(super) fn interrupt(&mut self) {
        self.middles = [None; 2];
        self.differences = [None; MAX_UNITS];
    }

    /// ρ² of every pair's delay, in the first channel; none where the body hardly turns.
    pub(super) fn squares(
        &self,
        models: &[UnitModel; MAX_UNITS],
        spread: &[Channels; MAX_UNITS],
        block_s: f64,
    ) -> [Option<Channels>; MAX_UNITS] {
        let mut squares = [None; MAX_UNITS];
        let motion = self.accelerations;
        if !(motion > MIN_MOTION * self.noise) {
            return squares;
        }
        let all = squares.iter_mut().zip(&self.products);
        for (((square, product), (a, b)), (of_a, of_b)) in all.zip(pairs(models)).zip(pairs(spread))
        {
            let delay = -product / motion;
            let white = (a.white.x + b.white.x) / block_s * motion;
            let scale = a.scale_squared + b.scale_squared;
            let bias = of_a.x + of_b.x;
            let variance =
                (white + scale * self.rates.norm_squared() + bias * self.sum.norm_squared())
                    / (motion * motion);
            let mut one = ZERO;
            let mut bound = ZERO;
            one.x = delay;
            bound.x = a.timing_s + b.timing_s;
            *square = Some(exceed(&one, &bound, &Channels::repeat(variance)));
        }
        squares
    }
}
