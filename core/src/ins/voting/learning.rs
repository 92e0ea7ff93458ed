//! What healthy seconds teach: the biases of units against each other, and who may come back.

use super::blocks::Block;
use super::grid::Channels;
use super::parity::{Motion, UnitModel, force_of};
use super::{ALONE_S, CENTRING_S, FORCE_TAU_S, READMISSION_S, UnitFault, UnitState, Voting, ZERO};
use crate::ins::MAX_UNITS;

impl Voting {
    /// Learns the bias of every unit against the mean of the used from a second in which they agreed.
    #[inline(never)]
    pub(super) fn learn(
        &mut self,
        means: &[Option<Channels>; MAX_UNITS],
        motion: &Motion,
        models: &[UnitModel; MAX_UNITS],
    ) {
        let Some((mean, weights)) = self.weighted(means) else {
            return;
        };
        let count = self.units.iter().filter(|unit| unit.is_used()).count();
        if count < 2 {
            return;
        }
        let nothing = ZERO;
        let all = self.learned.iter_mut().zip(&mut self.spread).zip(models);
        for (((learned, spread), model), (unit_mean, unit)) in
            all.zip(means.iter().zip(&self.units))
        {
            let (Some(unit_mean), false) = (unit_mean, unit.is_failing) else {
                continue;
            };
            let mut still = *model;
            still.walk = nothing;
            // As of a pair of two such units: half.
            let bound = motion.bound(model, model);
            let measured =
                (motion.variance(&still, &still, &nothing) + bound.component_mul(&bound)) * 0.5;
            let parts = learned.iter_mut().zip(spread.iter_mut());
            for ((learned, spread), ((unit_mean, mean), measured)) in
                parts.zip(unit_mean.iter().zip(&mean).zip(&measured))
            {
                let gain = *spread / (*spread + measured);
                *learned += gain * (unit_mean - mean - *learned);
                *spread *= 1.0 - gain;
            }
        }
        if count == MAX_UNITS {
            let mut centre = ZERO;
            for (weight, learned) in weights.iter().zip(&self.learned) {
                centre += weight.component_mul(learned);
            }
            for learned in &mut self.learned {
                *learned -= centre / CENTRING_S;
            }
        }
        let force = force_of(&motion.mean);
        self.learned_force = Some(match self.learned_force {
            Some(before) => before + (force - before) / FORCE_TAU_S,
            None => force,
        });
    }

    /// Counts the seconds of health of units that are not used, and takes them back; true when it did.
    #[inline(never)]
    pub(super) fn count_health(&mut self, block: &Block, length_s: f64) -> bool {
        let used = self.units.iter().filter(|unit| unit.is_used()).count();
        let is_disturbed = core::mem::replace(&mut self.is_disturbed, false);
        if self.disagree && used >= 2 && !is_disturbed && block.cells > 0 {
            self.agreed_s = self.agreed_s.saturating_add(1);
            if self.agreed_s >= READMISSION_S {
                self.disagree = false;
            }
        } else {
            self.agreed_s = 0;
        }
        let mut has_changed = false;
        for (unit, count) in self.units.iter_mut().zip(block.counts) {
            unit.age_s += length_s;
            let is_failing = core::mem::replace(&mut unit.is_failing, false);
            if unit.state != UnitState::Isolated {
                continue;
            }
            let is_alone = used == 0 && unit.fault.is_its_own();
            let was_compared = used > 0 && count == block.cells && block.cells > 0;
            if is_failing || !(is_alone || was_compared) {
                unit.healthy_s = 0;
                continue;
            }
            unit.healthy_s = unit.healthy_s.saturating_add(1);
            let needed_s = if is_alone {
                ALONE_S
            } else {
                unit.readmission_s()
            };
            if unit.healthy_s >= needed_s {
                unit.state = UnitState::Used;
                unit.fault = UnitFault::None;
                unit.healthy_s = 0;
                has_changed = true;
            }
        }
        if has_changed {
            self.begin_blocks();
        }
        has_changed
    }
}
