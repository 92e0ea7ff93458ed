//! The stages of an epoch, what each may cost, and what happens when one costs more.
//!
//! Core has no clock. Whoever runs it hands in a [`CycleCounter`]: the DWT on silicon, a timer under
//! the emulator's instruction clock, [`NoCounter`] on a PC. An epoch that passes [`EPOCH_BUDGET`]
//! becomes `unavailable` with its reason and is counted: a late answer never looks like a timely one.

/// A free-running count of work, in executed instructions or cycles; wraps.
pub trait CycleCounter {
    /// The count now.
    fn now(&mut self) -> u32;
}

/// No clock: every stage costs nothing. For a PC, where time is not part of the claim.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoCounter;

impl CycleCounter for NoCounter {
    fn now(&mut self) -> u32 {
        0
    }
}

/// The stages of an epoch in the order in which they run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Stage {
    /// Satellite states, corrections, and the least-squares position and velocity.
    Solution = 0,
    /// The consistency test of the position.
    Detection = 1,
    /// The search for the satellites that explain a failed test, and the position without them.
    Exclusion = 2,
    /// Protection levels.
    Levels = 3,
    /// Limits of the phase of flight.
    Verdict = 4,
}

/// Number of stages.
pub const STAGE_COUNT: usize = 5;

/// A stage and the work it may take.
#[derive(Clone, Copy, Debug)]
pub struct StageBudget {
    /// Which stage.
    pub stage: Stage,
    /// Name in the benchmark and in logs.
    pub name: &'static str,
    /// Work allowed per epoch, executed instructions.
    pub budget: u32,
}

/// The stages and their budgets, worst case of 48 satellites on three clocks with three exclusions.
///
/// Measured figures: `cargo xtask bench`. The sum is a tenth of what a 480 MHz Cortex-M7 executes in
/// the 100 ms between two epochs at 10 Hz, at one instruction per cycle.
pub const STAGES: [StageBudget; STAGE_COUNT] = [
    StageBudget {
        stage: Stage::Solution,
        name: "solution",
        budget: 1_500_000,
    },
    StageBudget {
        stage: Stage::Detection,
        name: "detection",
        budget: 200_000,
    },
    StageBudget {
        stage: Stage::Exclusion,
        name: "exclusion",
        budget: 2_900_000,
    },
    StageBudget {
        stage: Stage::Levels,
        name: "levels",
        budget: 150_000,
    },
    StageBudget {
        stage: Stage::Verdict,
        name: "verdict",
        budget: 50_000,
    },
];

/// Work allowed for a whole epoch, executed instructions.
pub const EPOCH_BUDGET: u32 = {
    let mut sum = 0;
    let mut i = 0;
    while i < STAGE_COUNT {
        sum += STAGES[i].budget;
        i += 1;
    }
    sum
};

const _: () = {
    let mut i = 0;
    while i < STAGE_COUNT {
        assert!(STAGES[i].stage as usize == i);
        i += 1;
    }
};

/// What the stages cost so far.
#[derive(Clone, Copy, Debug)]
pub struct Ledger {
    last: [u32; STAGE_COUNT],
    worst: [u32; STAGE_COUNT],
    deadline_misses: u32,
}

impl Ledger {
    /// Nothing ran yet.
    pub const EMPTY: Self = Self {
        last: [0; STAGE_COUNT],
        worst: [0; STAGE_COUNT],
        deadline_misses: 0,
    };

    /// Starts an epoch.
    pub fn begin_epoch(&mut self) {
        self.last = [0; STAGE_COUNT];
    }

    /// Books the work of a stage.
    pub fn charge(&mut self, stage: Stage, work: u32) {
        if let Some(last) = self.last.get_mut(stage as usize) {
            *last = last.saturating_add(work);
            let total = *last;
            if let Some(worst) = self.worst.get_mut(stage as usize)
                && total > *worst
            {
                *worst = total;
            }
        }
    }

    /// Ends an epoch: whether it kept [`EPOCH_BUDGET`].
    pub fn end_epoch(&mut self) -> bool {
        let total = self
            .last
            .iter()
            .fold(0_u32, |sum, work| sum.saturating_add(*work));
        let kept = total <= EPOCH_BUDGET;
        if !kept {
            self.deadline_misses = self.deadline_misses.saturating_add(1);
        }
        kept
    }

    /// Work of the last epoch, per stage in the order of [`STAGES`].
    pub const fn last(&self) -> [u32; STAGE_COUNT] {
        self.last
    }

    /// Most work any epoch took, per stage in the order of [`STAGES`].
    pub const fn worst(&self) -> [u32; STAGE_COUNT] {
        self.worst
    }

    /// Epochs that took longer than [`EPOCH_BUDGET`].
    pub const fn deadline_misses(&self) -> u32 {
        self.deadline_misses
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_epoch_over_budget_is_a_miss_and_is_counted() {
        let mut ledger = Ledger::EMPTY;
        ledger.begin_epoch();
        ledger.charge(Stage::Solution, EPOCH_BUDGET);
        assert!(ledger.end_epoch());
        ledger.begin_epoch();
        ledger.charge(Stage::Solution, EPOCH_BUDGET);
        ledger.charge(Stage::Verdict, 1);
        assert!(!ledger.end_epoch());
        assert_eq!(ledger.deadline_misses(), 1);
        assert_eq!(ledger.worst(), [EPOCH_BUDGET, 0, 0, 0, 1]);
    }
}
