//! The receiver clock and those of the constellations at an epoch: jumps, and what is new.

use super::jump::{COMMON_M, common_jump, median};
use super::{
    CLOCKS, CODE_LOCK_M, JOINT, MILLISECOND_M, NEW_OFFSET_SIGMA_M, SEEN_JUMP_M, SEEN_JUMP_SIGMAS,
    TestedSolution, TightMonitor,
};
use crate::ekf::layout::{CLOCK_BIAS, FIRST_OFFSET};
use crate::ekf::navigator::AntennaState;
use crate::ekf::{Filter, MeasurementRow};
use crate::gnss::solution::SnapshotSolution;
use crate::gnss::{CorrectedMeasurement, System};

/// What was done to the clocks of the main filter, to be done to all others alike.
#[derive(Clone, Copy, Debug)]
pub(super) struct ClockChange {
    /// Added to the variance of the clock, m².
    widened_m2: f64,
    /// Offsets that begin anew, with their variances, m².
    begun_m2: [Option<f64>; CLOCKS],
}

impl ClockChange {
    const NONE: Self = Self {
        widened_m2: 0.0,
        begun_m2: [None; CLOCKS],
    };

    /// Whether there is anything to do.
    pub(super) fn is_none(&self) -> bool {
        self.widened_m2 == 0.0 && self.begun_m2.iter().all(Option::is_none)
    }

    /// Does the same to another filter.
    pub(super) fn apply(&self, filter: &mut Filter<CLOCKS, JOINT>) {
        if self.widened_m2 > 0.0 {
            filter.widen_clock(CLOCK_BIAS, self.widened_m2);
        }
        for (clock, variance) in self.begun_m2.iter().enumerate() {
            if let Some(variance) = variance {
                filter.reset_clock(clock, *variance);
            }
        }
    }
}

impl TightMonitor {
    /// Brings the clocks of the nominal up to the epoch before any row is made: follows a jump of the
    /// receiver clock, and gives constellations that are new their offset. Then drops what is no
    /// measurement.
    pub(super) fn prepare_clocks(
        &mut self,
        at: &mut AntennaState<CLOCKS>,
        tested: Option<&TestedSolution<'_>>,
    ) -> ClockChange {
        let mut change = ClockChange::NONE;
        let known = self.offset_is_known;
        let is_known = |column: Option<usize>| {
            column.is_none_or(|column| known.get(column).copied().unwrap_or(false))
        };
        let seen = tested.and_then(|tested| self.seen_jump(at, tested.solution));
        if let Some(jump_m) = seen.or_else(|| self.innovations(at, is_known).and_then(common_jump))
        {
            let whole_m = libm::round(jump_m / MILLISECOND_M) * MILLISECOND_M;
            let rest_m = libm::fabs(jump_m - whole_m);
            // Clocks that are steered by whole milliseconds do it exactly; what is left over beyond the
            // measurements' noise is not known to be noise.
            let (jump_m, sigma_m) = if whole_m == 0.0 || rest_m > COMMON_M {
                (jump_m, COMMON_M)
            } else if rest_m > SEEN_JUMP_M {
                (whole_m, rest_m)
            } else {
                (whole_m, 0.0)
            };
            self.navigator.jump_clock(jump_m, sigma_m);
            change.widened_m2 = sigma_m * sigma_m;
            if let Some(bias) = at.clock.get_mut(CLOCK_BIAS) {
                *bias += jump_m;
            }
        }
        for column in FIRST_OFFSET..CLOCKS {
            if known.get(column).copied().unwrap_or(true) {
                continue;
            }
            let innovation_m = self
                .innovations(at, |of| of == Some(column))
                .and_then(median);
            let (Some(innovation_m), Some(offset)) = (innovation_m, at.clock.get_mut(column))
            else {
                continue;
            };
            *offset -= innovation_m;
            self.navigator
                .reset_clock(column, *offset, NEW_OFFSET_SIGMA_M);
            if let Some(known) = self.offset_is_known.get_mut(column) {
                *known = true;
            }
            if let Some(begun) = change.begun_m2.get_mut(column) {
                *begun = Some(NEW_OFFSET_SIGMA_M * NEW_OFFSET_SIGMA_M);
            }
        }
        let systems = self.systems;
        self.corrected.rows.retain(|measurement| {
            let offset = offset_of(&systems, measurement.satellite.system());
            innovation_m(measurement, at, offset)
                .is_some_and(|innovation_m| libm::fabs(innovation_m) <= CODE_LOCK_M)
        });
        change
    }

    /// How far the clock jumped by the snapshot solution, which knows no earlier clock.
    pub(super) fn seen_jump(
        &self,
        at: &AntennaState<CLOCKS>,
        solution: &SnapshotSolution,
    ) -> Option<f64> {
        let clock_m = (*solution.clock_m.get(self.reference_system)?)?;
        let jump_m = clock_m - at.clock.get(CLOCK_BIAS)?;
        let covariance = self.navigator.filter().clock_covariance();
        let sigma_m = libm::sqrt(*covariance.get(CLOCK_BIAS)?.get(CLOCK_BIAS)?);
        let size_m = libm::fabs(jump_m);
        (size_m > SEEN_JUMP_M && size_m > SEEN_JUMP_SIGMAS * sigma_m).then_some(jump_m)
    }

    /// Innovations of the satellites whose clock column is `wanted`; `None` without any.
    pub(super) fn innovations(
        &mut self,
        at: &AntennaState<CLOCKS>,
        wanted: impl Fn(Option<usize>) -> bool,
    ) -> Option<&mut [f64]> {
        let systems = self.systems;
        let found = self.corrected.rows.iter().filter_map(|measurement| {
            let offset = offset_of(&systems, measurement.satellite.system());
            wanted(offset)
                .then(|| innovation_m(measurement, at, offset))
                .flatten()
        });
        let mut n = 0;
        for (place, value) in self.innovations_m.iter_mut().zip(found) {
            *place = value;
            n += 1;
        }
        self.innovations_m
            .get_mut(..n)
            .filter(|found| !found.is_empty())
    }
}

/// Clock column of a constellation's offset against the first, if it has one.
pub(super) fn offset_of(
    systems: &[Option<usize>; System::ALL.len()],
    system: System,
) -> Option<usize> {
    systems.get(system.index()).copied().flatten()
}

/// Predicted minus measured pseudorange, m.
pub(super) fn innovation_m(
    measurement: &CorrectedMeasurement,
    at: &AntennaState<CLOCKS>,
    offset: Option<usize>,
) -> Option<f64> {
    MeasurementRow::<JOINT>::new(measurement, at.r_e_m, at.v_e_mps, &at.clock, offset)
        .map(|row| row.innovation_m)
}
