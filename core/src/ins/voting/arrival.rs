//! Samples as they come: what of them is believed, who is waited for, and who is out by what it shows itself.

use super::grid::{RING, cell_before};
use super::parity::pairs;
use super::{
    ALIVE_NS, ALIVE_SAMPLES, MAX_LEAP_NS, MAX_STRIKES, SILENT_NS, UnitFault, UnitState, Voting,
    WAIT_CELLS, WAIT_HALVES,
};
use crate::ins::{ImuSample, IntakeFault, MAX_UNITS, UnitSample};
use crate::time::GpsTime;

impl Voting {
    /// Takes a sample of a unit; then [`Voting::next_sample`] is to be called until it gives none.
    #[inline(never)]
    pub fn take(&mut self, number: usize, sample: &UnitSample) {
        let cell_ns = self.cell_ns;
        for (other, unit) in self.units.iter_mut().enumerate() {
            if other != number {
                unit.since = unit.since.saturating_add(1);
            }
        }
        let someone_is_alive = self.is_another_alive(number);
        let end = cell_before(sample.sample.time, cell_ns.max(1));
        let Some(unit) = self.units.get_mut(number) else {
            return;
        };
        if unit.model.is_none() {
            return;
        }
        let time_ns = sample.sample.time.ns();
        let ahead_of =
            |time: Option<GpsTime>| time.map_or(0, |time| time_ns.saturating_sub(time.ns()));
        let newest = self.newest.max(self.heard);
        let is_sound = unit.is_sound(sample.is_valid);
        if !sample.is_valid {
            // Time goes on when nobody measures; an isolated unit may have another.
            if is_sound && (1..=MAX_LEAP_NS).contains(&ahead_of(newest)) {
                self.heard = Some(sample.sample.time);
            }
            if !is_sound {
                self.isolate(number, UnitFault::Status);
            }
            return;
        }
        let leaps = ahead_of(unit.grid.end()) > MAX_LEAP_NS + unit.interval_ns
            && ahead_of(newest) > MAX_LEAP_NS;
        // Ahead of all others at once: its clock leapt, or there are no others any longer.
        let next = match self.next {
            Some(next) if !leaps && end < next.saturating_add(RING as i64) => next,
            Some(_) if someone_is_alive => {
                unit.leapt = true;
                return;
            }
            Some(next) if end < next.saturating_add(RING as i64) => next,
            last => {
                if last.is_some() {
                    self.restart_grid();
                }
                let first = sample
                    .sample
                    .time
                    .plus_ns(-i64::from(sample.sample.interval_ns));
                self.begun = Some(first);
                let next = cell_before(first.plus_ns(1), cell_ns);
                self.next = Some(next);
                next
            }
        };
        let Some(unit) = self.units.get_mut(number) else {
            return;
        };
        unit.since = 0;
        unit.leapt = false;
        unit.watch(&sample.sample);
        let before = unit.grid.end();
        match unit.grid.take(&sample.sample, next, cell_ns) {
            Ok(()) => {
                let end = unit.grid.end();
                if end > self.newest {
                    self.newest = end;
                }
            }
            Err(fault) => {
                // A pause that all units made is none of this one.
                let went_on_ns = match (before, self.newest) {
                    (Some(before), Some(newest)) => newest.ns().saturating_sub(before.ns()),
                    _ => 0,
                };
                let cause = match fault {
                    IntakeFault::Silent { .. } => UnitFault::Silent,
                    IntakeFault::NotFinite { .. } => UnitFault::NotFinite,
                    IntakeFault::Saturated { .. } => UnitFault::Saturated,
                    IntakeFault::Time { .. } => UnitFault::Time,
                };
                if cause != UnitFault::Silent || went_on_ns > SILENT_NS {
                    self.isolate(number, cause);
                }
            }
        }
    }

    fn is_another_alive(&self, number: usize) -> bool {
        let mut units = self.units.iter().enumerate();
        units.any(|(other, unit)| other != number && unit.since < ALIVE_SAMPLES)
    }

    /// The next sample of the output, if all have measured it that are worth waiting for. Cells that
    /// give no output are passed over.
    #[inline(never)]
    pub fn next_sample(&mut self) -> Option<ImuSample> {
        for _ in 0..RING {
            let index = self.next?;
            if !self.is_ready(index) {
                return None;
            }
            self.next = Some(index.saturating_add(1));
            let output = self.vote(index);
            if output.is_some() {
                return output;
            }
        }
        None
    }

    /// How far the units have come: the second of those that are there. One alone does not drive the
    /// others: its time stamps may be wrong.
    fn front(&self) -> Option<GpsTime> {
        let newest = self.newest?;
        let mut ends = [None; MAX_UNITS];
        for (end, unit) in ends.iter_mut().zip(&self.units) {
            let lag_ns = |end: &GpsTime| newest.ns().saturating_sub(end.ns());
            let most_ns = ALIVE_NS.saturating_add(unit.interval_ns);
            let there = unit.model.and(unit.grid.end());
            *end = there.filter(|end| lag_ns(end) <= most_ns);
        }
        let both = pairs(&ends).map(|(a, b)| a.zip(b).map(|(a, b)| a.min(b)));
        both.into_iter().max().flatten().or(Some(newest))
    }

    /// Nobody is waited for any longer, and someone has measured the cell.
    fn is_ready(&self, index: i64) -> bool {
        let (Some(front), Some(begun)) = (self.front(), self.begun) else {
            return false;
        };
        let end_ns = index.saturating_add(1).saturating_mul(self.cell_ns);
        if front.ns() < end_ns {
            return false;
        }
        self.units.iter().all(|unit| {
            let Some(unit_end) = unit.model.and(unit.grid.end().or(Some(begun))) else {
                return true;
            };
            let wait_ns =
                (unit.interval_ns * WAIT_HALVES / 2).min(self.cell_ns.saturating_mul(WAIT_CELLS));
            unit_end.ns() >= end_ns
                || front.ns().saturating_sub(unit_end.ns().max(begun.ns())) > wait_ns
        })
    }

    /// Isolates a unit. What it did to the others since a test could have seen it is taken back.
    pub(super) fn isolate(&mut self, number: usize, fault: UnitFault) {
        let all = self.units.iter_mut().zip(&mut self.spread);
        let Some((unit, spread)) = all.into_iter().nth(number) else {
            return;
        };
        unit.is_failing = true;
        unit.healthy_s = 0;
        let Some(model) = &unit.model else { return };
        if unit.is_used() {
            unit.strikes = unit.strikes.saturating_add(1).min(MAX_STRIKES + 1);
            unit.fault = fault;
            if fault.is_its_own() {
                // It may have been switched off: its bias is a new one.
                *spread = model.first;
                unit.age_s = 0.0;
            }
        }
        let was_used = unit.is_used();
        unit.state = if fault == UnitFault::Silent {
            UnitState::Silent
        } else {
            UnitState::Isolated
        };
        if was_used {
            self.begin_blocks();
            self.is_disturbed = true;
        }
    }

    /// What units show by themselves, at the end of a cell.
    pub(super) fn watch(&mut self, end_ns: i64) {
        let begun_ns = self.begun.map_or(end_ns, GpsTime::ns);
        let some_vary = self
            .units
            .iter()
            .any(|unit| unit.is_used() && unit.since < ALIVE_SAMPLES && !unit.is_stuck());
        for number in 0..MAX_UNITS {
            let Some(unit) = self.units.get_mut(number) else {
                continue;
            };
            if unit.model.is_none() {
                continue;
            }
            let unit_end_ns = unit
                .grid
                .end()
                .map_or(begun_ns, |end| end.ns().max(begun_ns));
            let counters = unit.grid.counters();
            let unusable = (counters.not_finite, counters.saturated);
            if end_ns.saturating_sub(unit_end_ns) > SILENT_NS.saturating_add(unit.interval_ns) {
                let cause = match unit.unusable {
                    _ if unit.leapt => UnitFault::Time,
                    _ if unit.invalid_ns > 0 => UnitFault::Status,
                    (not_finite, _) if not_finite != unusable.0 => UnitFault::NotFinite,
                    (_, saturated) if saturated != unusable.1 => UnitFault::Saturated,
                    _ => UnitFault::Silent,
                };
                self.isolate(number, cause);
            } else if unit_end_ns >= end_ns {
                unit.unusable = unusable;
                if unit.state == UnitState::Silent {
                    unit.state = UnitState::Isolated;
                }
                if some_vary && unit.is_stuck() {
                    self.isolate(number, UnitFault::Stuck);
                }
            }
        }
    }
}
