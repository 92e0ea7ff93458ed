//! Sums over blocks of cells: 0.1 s, 1 s, 10 s and 100 s, each of ten of those before.
//!
//! Short blocks find what is large at once, long ones what is small for long.

use nalgebra::Vector3;

use super::grid::Channels;
use super::parity::Motion;
use crate::ins::MAX_UNITS;

/// Levels of blocks.
pub(super) const LEVELS: usize = 4;

/// The largest of a block's second differences is so many sigmas of the noise without any motion.
const BEND_SIGMAS: f64 = 3.0;

const ZERO: Channels = Channels::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0);

/// What had been learned when a block began that is longer than learning takes: it is compared with that,
/// so that what grows within the block is not learned away.
#[derive(Clone, Copy, Debug)]
pub(super) struct Start {
    pub(super) learned: [Channels; MAX_UNITS],
    pub(super) spread: [Channels; MAX_UNITS],
}

impl Start {
    pub(super) const EMPTY: Self = Self {
        learned: [ZERO; MAX_UNITS],
        spread: [ZERO; MAX_UNITS],
    };
}

/// Sums of one block.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    /// Cells passed since it began.
    pub(super) elapsed: u32,
    /// Cells of it that every used unit measured.
    pub(super) cells: u32,
    /// The same of each unit.
    pub(super) counts: [u32; MAX_UNITS],
    sums: [Channels; MAX_UNITS],
    middle: Channels,
    least: Channels,
    most: Channels,
    bend: [f64; 2],
    pub(super) step: [f64; 2],
}

impl Block {
    pub(super) const EMPTY: Self = Self {
        elapsed: 0,
        cells: 0,
        counts: [0; MAX_UNITS],
        sums: [ZERO; MAX_UNITS],
        middle: ZERO,
        least: ZERO,
        most: ZERO,
        bend: [0.0; 2],
        step: [0.0; 2],
    };

    /// A cell that not every used unit measured.
    pub(super) fn skip(&mut self) {
        self.elapsed = self.elapsed.saturating_add(1);
    }

    pub(super) fn add(
        &mut self,
        units: &[Option<Channels>; MAX_UNITS],
        middle: &Channels,
        bend: [f64; 2],
        step: [f64; 2],
    ) {
        self.skip();
        let both = self.counts.iter_mut().zip(&mut self.sums);
        for ((count, sum), unit) in both.zip(units) {
            if let Some(rates) = unit {
                *count = count.saturating_add(1);
                *sum += rates;
            }
        }
        self.range(middle, middle);
        self.cells = self.cells.saturating_add(1);
        self.middle += middle;
        most_of(&mut self.bend, bend);
        most_of(&mut self.step, step);
    }

    fn range(&mut self, least: &Channels, most: &Channels) {
        if self.cells == 0 {
            (self.least, self.most) = (*least, *most);
        } else {
            self.least = self.least.zip_map(least, libm::fmin);
            self.most = self.most.zip_map(most, libm::fmax);
        }
    }

    /// Takes a shorter block whole.
    pub(super) fn merge(&mut self, part: &Self) {
        self.elapsed = self.elapsed.saturating_add(part.elapsed);
        if part.cells == 0 {
            return;
        }
        self.range(&part.least, &part.most);
        self.cells = self.cells.saturating_add(part.cells);
        self.middle += part.middle;
        for (count, more) in self.counts.iter_mut().zip(part.counts) {
            *count = count.saturating_add(more);
        }
        for (sum, more) in self.sums.iter_mut().zip(&part.sums) {
            *sum += more;
        }
        most_of(&mut self.bend, part.bend);
        most_of(&mut self.step, part.step);
    }

    /// Means of the units that measured every cell the used ones did.
    pub(super) fn means(&self) -> [Option<Channels>; MAX_UNITS] {
        let mut means = [None; MAX_UNITS];
        let all = self.counts.iter().zip(&self.sums);
        for (mean, (count, sum)) in means.iter_mut().zip(all) {
            if self.cells > 0 && *count == self.cells {
                *mean = Some(sum / f64::from(self.cells));
            }
        }
        means
    }

    /// Mean of the mid-value.
    pub(super) fn mean(&self) -> Channels {
        self.middle / f64::from(self.cells.max(1))
    }

    /// `noise` is what the noise of a cell makes of a second difference, one sigma.
    pub(super) fn motion(
        &self,
        learned_force: Vector3<f64>,
        cell_s: f64,
        noise: [f64; 2],
    ) -> Motion {
        let mut bend = self.bend;
        for (bend, noise) in bend.iter_mut().zip(noise) {
            *bend = libm::fmax(*bend - BEND_SIGMAS * noise, 0.0);
        }
        Motion {
            mean: self.mean(),
            least: self.least,
            most: self.most,
            bend,
            learned_force,
            cells: self.cells,
            cell_s,
        }
    }
}

fn most_of(most: &mut [f64; 2], of: [f64; 2]) {
    for (most, value) in most.iter_mut().zip(of) {
        *most = libm::fmax(*most, value);
    }
}
