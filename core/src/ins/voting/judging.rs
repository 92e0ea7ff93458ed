//! The tests that end with a cell: who differs, for how long, and what follows.

use nalgebra::Vector3;

use super::blocks::Block;
use super::grid::Channels;
use super::parity::{Decision, Motion, UnitModel, decide, differences, exceed, largest, pairs};
use super::{
    DRIFT_LEVEL, LEARNING_LEVEL, LEVELS, MAX_UNDETERMINED, MAX_WITHHELD, Unit, UnitFault, Voting,
    ZERO,
};
use crate::ins::MAX_UNITS;

impl Voting {
    /// All tests that end with this cell; false when it may not be used.
    #[inline(never)]
    pub(super) fn compare(
        &mut self,
        rates: &[Option<Channels>; MAX_UNITS],
        mid: &Channels,
    ) -> bool {
        let Some(models) = self.models() else {
            return false;
        };
        let [Some(last), Some(before)] = self.history else {
            self.skip();
            return true;
        };
        let step = mid - last;
        let bend = largest(&(mid - last * 2.0 + before));
        let motion = Motion {
            mean: *mid,
            least: mid.zip_map(&last, libm::fmin),
            most: mid.zip_map(&last, libm::fmax),
            bend,
            learned_force: self.learned_force(mid),
            cells: 1,
            cell_s: self.cell_s,
        };
        let quantile = self.quantiles.cell;
        let (learned, spread) = (self.learned, self.spread);
        let squares = differences(rates, &learned, &spread, &models, &motion);
        match self.judge(&squares, quantile, UnitFault::Difference) {
            Decision::Agree => self.withheld = 0,
            Decision::Isolate(_) => {
                self.withheld = 0;
                return true;
            }
            Decision::Undetermined => {
                self.is_disturbed = true;
                self.withheld = self.withheld.saturating_add(1);
                if self.withheld >= MAX_WITHHELD {
                    self.fall_out();
                }
                self.skip();
                return false;
            }
        }
        let mut used = self.units.iter().zip(rates);
        if used.any(|(unit, rates)| unit.is_used() && rates.is_none()) {
            self.skip();
            return true;
        }
        if let Some(block) = self.blocks.first_mut() {
            block.add(rates, mid, bend, largest(&step));
        }
        self.scatter.add(rates);
        self.end_blocks(&models);
        true
    }

    /// A cell that cannot be compared.
    pub(super) fn skip(&mut self) {
        if let Some(block) = self.blocks.first_mut() {
            block.skip();
        }
        if let Some(models) = self.models() {
            self.end_blocks(&models);
        }
    }

    fn learned_force(&self, mid: &Channels) -> Vector3<f64> {
        self.learned_force
            .unwrap_or(Vector3::new(mid.w, mid.a, mid.b))
    }

    /// Decides between the used units; marks those of the others that differ from them.
    #[inline(never)]
    fn judge(
        &mut self,
        squares: &[Option<Channels>; MAX_UNITS],
        quantile: f64,
        fault: UnitFault,
    ) -> Decision {
        let limit = quantile * quantile;
        let [first, second, third] = &self.units;
        let is_used = [first, second, third].map(Unit::is_used);
        let mut of_used = [None; MAX_UNITS];
        let mut differs = [false; MAX_UNITS];
        let numbers = pairs(&[0_usize, 1, 2]);
        let all = of_used
            .iter_mut()
            .zip(squares)
            .zip(numbers)
            .zip(pairs(&is_used));
        for (((of_used, square), (a, b)), (a_is_used, b_is_used)) in all {
            let Some(square) = square else { continue };
            if a_is_used && b_is_used {
                *of_used = Some(*square);
            } else if a_is_used != b_is_used && !square.iter().all(|square| *square <= limit) {
                let other = if a_is_used { b } else { a };
                if let Some(differs) = differs.get_mut(other) {
                    *differs = true;
                }
            }
        }
        for (unit, differs) in self.units.iter_mut().zip(differs) {
            unit.is_failing |= differs;
        }
        let decision = decide(&of_used, limit);
        if let Decision::Isolate(number) = decision {
            let fault = if fault == UnitFault::Difference && self.is_delayed(number) {
                UnitFault::Delay
            } else {
                fault
            };
            self.isolate(number, fault);
        }
        decision
    }

    /// Whether a delay of this unit is seen too.
    fn is_delayed(&self, number: usize) -> bool {
        let Some(models) = self.models() else {
            return false;
        };
        let squares = self.delay.squares(&models, &self.spread, self.block_s());
        let quantile = self.quantiles.second();
        decide(&squares, quantile * quantile) == Decision::Isolate(number)
    }

    /// One sigma of what the noise of a cell makes of a second difference: √(1 + 4 + 1) of its own.
    fn bend_noise(&self, models: &[UnitModel; MAX_UNITS]) -> [f64; 2] {
        let most = |of: fn(&UnitModel) -> f64| {
            let white = models.iter().fold(0.0, |most, m| libm::fmax(most, of(m)));
            libm::sqrt(6.0 * white / self.cell_s)
        };
        [most(|model| model.white.x), most(|model| model.white.w)]
    }

    /// Length of the shortest block, s.
    fn block_s(&self) -> f64 {
        f64::from(self.lengths.first().copied().unwrap_or(1)) * self.cell_s
    }

    /// Units differ and none explains it.
    fn fall_out(&mut self) {
        self.disagree = true;
        self.agreed_s = 0;
    }

    /// Tests the blocks that end here.
    fn end_blocks(&mut self, models: &[UnitModel; MAX_UNITS]) {
        for level in 0..LEVELS {
            let (Some(block), Some(length)) = (self.blocks.get(level), self.lengths.get(level))
            else {
                return;
            };
            if block.elapsed < *length {
                return;
            }
            let (block, length) = (*block, *length);
            let isolated = self.end_block(level, &block, length, models);
            if isolated {
                return;
            }
            if let Some(longer) = self.blocks.get_mut(level + 1) {
                longer.merge(&block);
            }
            self.begin_block(level);
        }
    }

    /// Tests one block; true when a unit was isolated.
    #[inline(never)]
    fn end_block(
        &mut self,
        level: usize,
        block: &Block,
        length: u32,
        models: &[UnitModel; MAX_UNITS],
    ) -> bool {
        let is_whole = block.cells.saturating_mul(2) >= length;
        let means = block.means();
        let learned_force = self.learned_force(&block.mean());
        let motion = block.motion(learned_force, self.cell_s, self.bend_noise(models));
        let start = self.start_of(level);
        let mut decision = Decision::Agree;
        if is_whole {
            let quantile = self.quantiles.blocks.get(level).copied().unwrap_or(0.0);
            let squares = differences(&means, &start.learned, &start.spread, models, &motion);
            let fault = if level >= DRIFT_LEVEL {
                UnitFault::Drift
            } else {
                UnitFault::Difference
            };
            decision = self.judge(&squares, quantile, fault);
            if matches!(decision, Decision::Isolate(_)) {
                // What was learned while the fault was there, of whatever unit, is forgotten.
                (self.learned, self.spread) = (start.learned, start.spread);
                self.grow(models, f64::from(length) * self.cell_s);
                self.begin_blocks();
                return true;
            }
            if level == 0 {
                let white = models
                    .iter()
                    .fold(0.0, |most, m| libm::fmax(most, m.white.x));
                self.delay
                    .add(block, &self.learned, &motion.mean, self.cell_s, white);
            }
        } else if level == 0 {
            self.delay.interrupt();
        }
        if let Some(count) = self.undetermined.get_mut(level) {
            if decision == Decision::Undetermined {
                *count = count.saturating_add(1);
                self.is_disturbed = true;
                if *count >= MAX_UNDETERMINED {
                    self.fall_out();
                }
            } else {
                *count = 0;
            }
        }
        if level == LEARNING_LEVEL {
            return self.end_second(block, is_whole, &means, &motion, models, length);
        }
        false
    }

    /// Variances of the learned biases after so many seconds in which nothing was learned.
    fn grow(&mut self, models: &[UnitModel; MAX_UNITS], length_s: f64) {
        for (spread, model) in self.spread.iter_mut().zip(models) {
            *spread += model.walk * length_s;
        }
    }

    /// Once a second: noise, delays, what is learned, who comes back.
    #[inline(never)]
    fn end_second(
        &mut self,
        block: &Block,
        is_whole: bool,
        means: &[Option<Channels>; MAX_UNITS],
        motion: &Motion,
        models: &[UnitModel; MAX_UNITS],
        length: u32,
    ) -> bool {
        let length_s = f64::from(length) * self.cell_s;
        self.grow(models, length_s);
        let quantile = self.quantiles.second();
        let squares = self
            .scatter
            .squares(models, motion, block.step, length, quantile);
        let noise = self.judge(&squares, quantile, UnitFault::Noise);
        let squares = self.delay.squares(models, &self.spread, self.block_s());
        let delay = self.judge(&squares, quantile, UnitFault::Delay);
        let squares = self.far_apart(models);
        let apart = self.judge(&squares, quantile, UnitFault::Drift);
        for number in 0..MAX_UNITS {
            let is_delayed = self.is_delayed(number);
            if let Some(unit) = self.units.get_mut(number)
                && is_delayed
                && matches!(unit.fault, UnitFault::Difference | UnitFault::Drift)
            {
                unit.fault = UnitFault::Delay;
            }
        }
        let decisions = [noise, delay, apart];
        if decisions.iter().any(|d| matches!(d, Decision::Isolate(_))) {
            // Rolled back as far as any level remembers.
            self.learned = self.start_of(LEVELS - 1).learned;
            self.begin_blocks();
            return true;
        }
        if decisions.contains(&Decision::Undetermined) {
            self.is_disturbed = true;
            self.fall_out();
        }
        if is_whole && !self.is_disturbed && !self.disagree {
            self.learn(means, motion, models);
        }
        self.count_health(block, length_s)
    }

    /// ρ² of the learned differences against what first biases and walks make likely.
    #[inline(never)]
    fn far_apart(&self, models: &[UnitModel; MAX_UNITS]) -> [Option<Channels>; MAX_UNITS] {
        let [first, second, third] = &self.units;
        let ages = [first, second, third].map(|unit| unit.model.is_some().then_some(unit.age_s));
        let mut squares = [None; MAX_UNITS];
        let all = squares.iter_mut().zip(pairs(models)).zip(pairs(&ages));
        for (((square, (a, b)), ages), (of_a, of_b)) in all.zip(pairs(&self.learned)) {
            if let (Some(age_a), Some(age_b)) = ages {
                let variance = a.first + b.first + a.walk * age_a + b.walk * age_b;
                *square = Some(exceed(&(of_a - of_b), &ZERO, &variance));
            }
        }
        squares
    }
}
