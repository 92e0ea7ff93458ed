//! The stages of an epoch, what each may cost, and what happens when one costs more.
//!
//! Core has no clock. Whoever runs it hands in a [`CycleCounter`]: the DWT on silicon, a timer under
//! the emulator's instruction clock, [`NoCounter`] on a PC. An epoch in which a stage passes its budget
//! becomes `unavailable` with its reason and is counted. Counted is the work from the complete epoch
//! to the verdict; how long bytes wait before they are taken is the scheduler's to bound.

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
    /// The tightly coupled filter, where there is an inertial unit, and what its bank says: tests, isolation,
    /// levels.
    Filter = 5,
    /// Prediction and update of the bank's filters: 303 of 19 states for 24 satellites on three clocks.
    Bank = 6,
}

/// Number of stages.
pub const STAGE_COUNT: usize = 7;

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
/// Measured figures: `cargo xtask bench`. The search for three faults among 48 satellites looks at
/// twice the sets of the measured one for a single fault. The sum is less than a third of what a
/// 480 MHz Cortex-M7 executes in the 100 ms between two epochs at 10 Hz, at one instruction per cycle.
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
        budget: 4_000_000,
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
    StageBudget {
        stage: Stage::Filter,
        name: "filter",
        budget: 3_000_000,
    },
    StageBudget {
        stage: Stage::Bank,
        name: "bank",
        budget: 8_000_000,
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

    /// Ends an epoch: whether every stage kept its budget, and so the epoch [`EPOCH_BUDGET`].
    pub fn end_epoch(&mut self) -> bool {
        let kept = self
            .last
            .iter()
            .zip(&STAGES)
            .all(|(work, stage)| *work <= stage.budget);
        if !kept {
            self.miss();
        }
        kept
    }

    /// Counts an epoch whose answer came too late.
    pub(crate) fn miss(&mut self) {
        self.deadline_misses = self.deadline_misses.saturating_add(1);
    }

    /// Work of the last epoch, per stage in the order of [`STAGES`].
    pub const fn last(&self) -> [u32; STAGE_COUNT] {
        self.last
    }

    /// Most work any epoch took, per stage in the order of [`STAGES`].
    pub const fn worst(&self) -> [u32; STAGE_COUNT] {
        self.worst
    }

    /// Epochs in which a stage passed its budget.
    pub const fn deadline_misses(&self) -> u32 {
        self.deadline_misses
    }
}

/// Work of one filter of the bank before any has been measured.
const FIRST_FILTER_WORK: u32 = 20_000;

/// What the filters of the bank cost, and so whether those of the pairs can be afforded.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FilterCost {
    per_filter: u32,
}

impl FilterCost {
    /// Nothing measured yet.
    pub(crate) const UNKNOWN: Self = Self {
        per_filter: FIRST_FILTER_WORK,
    };

    /// Whether `filters` more fit into what `spent` has left of the epoch, and into their stage. Each time they
    /// do not, the cost is taken for a little less, so that one slow epoch does not end them for good.
    pub(crate) fn affords(&mut self, spent: u32, filters: u32) -> bool {
        let budget = STAGES
            .get(Stage::Bank as usize)
            .map_or(0, |stage| stage.budget);
        let work = self.per_filter.saturating_mul(filters);
        // Tests, levels and the filters without one satellite come on top.
        let rest = STAGES
            .get(Stage::Filter as usize)
            .map_or(0, |stage| stage.budget);
        let all = spent.saturating_add(work).saturating_add(rest);
        let fits = work <= budget && all <= EPOCH_BUDGET;
        if !fits {
            self.per_filter -= self.per_filter / 32;
        }
        fits
    }

    /// `filters` took this much work.
    pub(crate) const fn measured(&mut self, filters: u32, work: u32) {
        // A counter that stands still measures nothing.
        if let Some(per_filter) = work.checked_div(filters)
            && work > 0
        {
            self.per_filter = per_filter;
        }
    }
}

/// A counter within an epoch.
pub(crate) struct Meter<'a, C: CycleCounter> {
    counter: &'a mut C,
    begin: u32,
    /// Work of the filters of the bank.
    pub bank: u32,
}

impl<'a, C: CycleCounter> Meter<'a, C> {
    /// The epoch began at this count.
    pub(crate) const fn new(counter: &'a mut C, begin: u32) -> Self {
        Self {
            counter,
            begin,
            bank: 0,
        }
    }

    /// The count now.
    pub(crate) fn now(&mut self) -> u32 {
        self.counter.now()
    }

    /// Work since the epoch began.
    pub(crate) fn spent(&mut self) -> u32 {
        self.counter.now().wrapping_sub(self.begin)
    }

    /// Books what was done since `from` for the filters of the bank.
    pub(crate) fn bank_since(&mut self, from: u32) {
        self.bank = self
            .bank
            .saturating_add(self.counter.now().wrapping_sub(from));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// INT-008.
    #[test]
    fn a_stage_over_budget_is_a_miss_and_is_counted() {
        let mut ledger = Ledger::EMPTY;
        ledger.begin_epoch();
        for stage in &STAGES {
            ledger.charge(stage.stage, stage.budget);
        }
        assert!(ledger.end_epoch());
        for stage in &STAGES {
            ledger.begin_epoch();
            ledger.charge(stage.stage, stage.budget);
            ledger.charge(stage.stage, 1);
            assert!(!ledger.end_epoch());
        }
        assert_eq!(ledger.deadline_misses(), STAGE_COUNT as u32);
        assert_eq!(ledger.worst(), STAGES.map(|stage| stage.budget + 1));
    }

    /// INT-032.
    #[test]
    fn filters_of_pairs_are_shed_when_they_do_not_fit_and_tried_again() {
        let mut cost = FilterCost::UNKNOWN;
        assert!(cost.affords(0, 276));
        // Ten times slower: they cost more than the whole epoch has.
        cost.measured(304, 304 * 150_000);
        assert!(!cost.affords(0, 276));
        assert!(cost.affords(0, 10));
        let tries = (0..1000).find(|_| cost.affords(0, 276)).unwrap();
        assert!((20..200).contains(&tries), "{tries}");
        // What the epoch has spent before counts.
        cost.measured(304, 304 * 15_000);
        assert!(cost.affords(0, 276) && !cost.affords(EPOCH_BUDGET, 276));
        // A counter that stands still measures nothing.
        let before = cost.per_filter;
        cost.measured(304, 0);
        cost.measured(0, 17);
        assert_eq!(cost.per_filter, before);
    }
}
