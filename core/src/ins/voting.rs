//! Three inertial units vote: the one that lies is isolated, the healthy are averaged.
//!
//! In: samples of up to three units, each at its own rate and times, mounted in its own way. Out: samples
//! of one unit at the body point, in body axes, at the configured interval; a state for each unit.
//!
//! ```text
//! UnitSample ─► grid (body axes, cells of T) ─► lever arms ─► cell, 0.1, 1, 10, 100 s: pairs differ?
//!                                                  └────────► weighted mean of those used ─► ImuSample
//! ```
//!
//! | symbol | code       | unit        | frame | meaning                                             |
//! |--------|------------|-------------|-------|-----------------------------------------------------|
//! | T      | `cell_ns`  | ns          |       | interval of the output                               |
//! | r_i    | `arm_b_m`  | m           | b     | from the body point to unit i                        |
//! | β_i    | `learned`  | rad/s, m/s² | b     | bias of unit i against the weighted mean of all      |
//! | P_i    | `spread`   | squares     |       | its variance                                         |
//! | w_i    | `weights`  | 1           |       | N_i⁻¹ / Σ N_j⁻¹ over those used, N the noise's square |
//!
//! Force at the body point: f = f_i − α × r_i − ω × (ω × r_i), [GROVES-2013]; ω the mid-value and α its second-order
//! backward difference. Output: Σ w_i (m_i − β_i) T. With all units used Σ w_i β_i = 0, and the output is
//! the weighted mean; when one is isolated, the learned β_i of the others keep the output's bias what
//! it was. β_i is learned by a scalar Kalman filter per channel from means over a second, from the first bias on
//! (sigma of the configuration), with the walk of the data sheet. Whatever else moves it is a fault: a
//! test over 10 s and 100 s compares with what was learned before, and the learned differences must stay
//! within what first biases and walks make likely. Tests: `parity.rs`, `noise.rs`; why so, and the
//! smallest fault that is seen: docs/decisions/015-voting.md.

mod blocks;
mod config;
mod grid;
mod noise;
mod parity;
mod states;

pub use config::{UnitConfig, UnitTolerance};
pub use states::{UnitFault, UnitState, VotingMode};

use nalgebra::Vector3;

use super::{ImuSample, InertialConfigError, IntakeFault, MAX_UNITS, UnitSample};
use crate::stats::{StatsError, normal};
use crate::time::GpsTime;
use blocks::{Block, LEVELS, Start};
use grid::{Channels, RING, UnitGrid, cell_before, seconds};
use noise::{Delay, Scatter};
use parity::{Decision, Motion, UnitModel, decide, exceed, largest, middle, pairs};

/// False isolations per hour that all tests together allow, with healthy units whose noise is as told.
const FALSE_ISOLATIONS_PER_H: f64 = 1e-5;
/// Tests that share it: of cells, of four levels of blocks, of noise, of delay, of what was learned.
const SHARES: f64 = 8.0;
/// Length of the shortest block, ns; each further level is ten times as long.
const BLOCK_NS: i64 = 100_000_000;
/// Level that learns, watches noise and counts health: 1 s.
const LEARNING_LEVEL: usize = 1;
/// First level whose finding is called a drift: 10 s.
const DRIFT_LEVEL: usize = 2;
/// A unit is not waited for longer than this many of its intervals, in halves.
const WAIT_HALVES: i64 = 5;
/// Nor for longer than this many cells.
const WAIT_CELLS: i64 = RING as i64 - 4;
/// A unit that is behind by more than this and its own interval is silent, ns: what an intake bridges.
const SILENT_NS: i64 = 50_000_000;
/// A unit that is behind by no more than this and its own interval is there, ns.
const ALIVE_NS: i64 = 30_000_000;
/// Time that leaps ahead of all others by more than this is not believed, ns.
const MAX_LEAP_NS: i64 = 25_000_000;
/// Samples of others after which a unit no longer counts as alive.
const ALIVE_SAMPLES: u8 = 16;
/// An axis that repeats itself so often is stuck.
const STUCK_SAMPLES: u16 = 25;
/// Rates nearer than this are the same, as a ratio: what rounding makes of the same number.
const SAME: f64 = 1e-12;
/// Healthy seconds before an isolated unit is used again, doubled with every isolation up to four times.
const READMISSION_S: u16 = 60;
/// The same where it is the only one.
const ALONE_S: u16 = 10;
const MAX_STRIKES: u8 = 4;
/// Cells in a row without a decision before the units count as disagreeing.
const MAX_WITHHELD: u8 = 3;
/// Blocks in a row of one level without a decision before they do.
const MAX_UNDETERMINED: u8 = 2;
/// Over so many seconds the mean force is taken, at which biases of accelerometers are learned.
const FORCE_TAU_S: f64 = 60.0;
/// Over so many seconds the learned biases are brought back to a weighted mean of zero.
const CENTRING_S: f64 = 32.0;

const ZERO: Channels = Channels::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0);

/// Why a vote could not be configured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum VotingConfigureError {
    /// A value of a unit is out of its range.
    Config(InertialConfigError),
    /// A probability gives no quantile.
    Stats(StatsError),
}

/// Quantiles of all tests.
#[derive(Clone, Copy, Debug)]
struct Quantiles {
    cell: f64,
    blocks: [f64; LEVELS],
}

impl Quantiles {
    const EMPTY: Self = Self {
        cell: 0.0,
        blocks: [0.0; LEVELS],
    };

    /// For a test every so many seconds of every channel of three pairs, to both sides.
    fn of(every_s: f64) -> Result<f64, StatsError> {
        let tests_per_h = 3600.0 / every_s * 18.0 * 2.0;
        normal::upper_quantile(FALSE_ISOLATIONS_PER_H / SHARES / tests_per_h)
    }

    /// Quantile of the tests that are made once a second.
    fn second(&self) -> f64 {
        self.blocks.get(LEARNING_LEVEL).copied().unwrap_or(f64::NAN)
    }
}

/// One unit.
#[derive(Clone, Debug)]
struct Unit {
    model: Option<UnitModel>,
    grid: UnitGrid,
    interval_ns: i64,
    state: UnitState,
    fault: UnitFault,
    /// How often it was isolated, up to [`MAX_STRIKES`].
    strikes: u8,
    healthy_s: u16,
    /// Something was wrong with it since the last second ended.
    is_failing: bool,
    /// Samples of others since its last.
    since: u8,
    /// A sample was refused because its time lay too far ahead.
    leapt: bool,
    /// Samples in a row in which each axis gave the same, and what.
    repeated: [u16; 6],
    last: [f64; 6],
    /// Samples that were no numbers or saturated when it was last whole.
    unusable: (u32, u32),
    /// Since its first bias, s.
    age_s: f64,
}

impl Unit {
    const EMPTY: Self = Self {
        model: None,
        grid: UnitGrid::EMPTY,
        interval_ns: 0,
        state: UnitState::Absent,
        fault: UnitFault::None,
        strikes: 0,
        healthy_s: 0,
        is_failing: false,
        since: ALIVE_SAMPLES,
        leapt: false,
        repeated: [0; 6],
        last: [0.0; 6],
        unusable: (0, 0),
        age_s: 0.0,
    };

    fn is_used(&self) -> bool {
        self.state == UnitState::Used
    }

    /// Counts how often each axis gave the same.
    fn watch(&mut self, sample: &ImuSample) {
        let per_s = 1e9 / f64::from(sample.interval_ns.max(1));
        let rates = sample.dtheta_is_s_rad.iter().chain(&sample.dv_is_s_mps);
        let all = self.repeated.iter_mut().zip(&mut self.last).zip(rates);
        for ((repeated, last), part) in all {
            let rate = part * per_s;
            *repeated = if libm::fabs(rate - *last) <= SAME * libm::fabs(rate) {
                repeated.saturating_add(1)
            } else {
                0
            };
            *last = rate;
        }
    }

    fn is_stuck(&self) -> bool {
        self.repeated.iter().any(|count| *count >= STUCK_SAMPLES)
    }

    /// Healthy seconds before it is used again.
    fn readmission_s(&self) -> u16 {
        READMISSION_S << u16::from(self.strikes.saturating_sub(1).min(MAX_STRIKES))
    }
}

/// The vote. About 8 kB; lives in a static.
#[derive(Clone, Debug)]
pub struct Voting {
    units: [Unit; MAX_UNITS],
    cell_ns: i64,
    cell_s: f64,
    /// The next cell of the output.
    next: Option<i64>,
    newest: Option<GpsTime>,
    /// When the grid began.
    begun: Option<GpsTime>,
    lengths: [u32; LEVELS],
    quantiles: Quantiles,
    blocks: [Block; LEVELS],
    /// Of the blocks from [`DRIFT_LEVEL`] on.
    starts: [Start; LEVELS - DRIFT_LEVEL],
    undetermined: [u8; LEVELS],
    scatter: Scatter,
    delay: Delay,
    learned: [Channels; MAX_UNITS],
    spread: [Channels; MAX_UNITS],
    learned_force: Option<Vector3<f64>>,
    /// Mid-values of the last two cells, the newer first.
    history: [Option<Channels>; 2],
    withheld: u8,
    disagree: bool,
    agreed_s: u16,
    /// A pair differed or could not be compared since the last second ended.
    is_disturbed: bool,
}

impl Voting {
    /// No units.
    pub const EMPTY: Self = Self {
        units: [Unit::EMPTY; MAX_UNITS],
        cell_ns: 0,
        cell_s: 0.0,
        next: None,
        newest: None,
        begun: None,
        lengths: [0; LEVELS],
        quantiles: Quantiles::EMPTY,
        blocks: [Block::EMPTY; LEVELS],
        starts: [Start::EMPTY; LEVELS - DRIFT_LEVEL],
        undetermined: [0; LEVELS],
        scatter: Scatter::EMPTY,
        delay: Delay::EMPTY,
        learned: [ZERO; MAX_UNITS],
        spread: [ZERO; MAX_UNITS],
        learned_force: None,
        history: [None; 2],
        withheld: 0,
        disagree: false,
        agreed_s: 0,
        is_disturbed: false,
    };

    /// Begins without units; the output has a sample every `interval_ns`, 2.5 to 20 ms.
    ///
    /// # Errors
    /// [`VotingConfigureError`]; the vote then stays as it was.
    pub fn begin(&mut self, interval_ns: u32) -> Result<(), VotingConfigureError> {
        if !super::sample::INTERVAL_NS.contains(&interval_ns) {
            return Err(VotingConfigureError::Config(
                InertialConfigError::Interval { interval_ns },
            ));
        }
        let cell_ns = i64::from(interval_ns);
        let cell_s = seconds(cell_ns);
        let quantile = |every_s| Quantiles::of(every_s).map_err(VotingConfigureError::Stats);
        let mut quantiles = Quantiles {
            cell: quantile(cell_s)?,
            blocks: [0.0; LEVELS],
        };
        let mut lengths = [0; LEVELS];
        // Rounded up, so that the shortest block has five cells at least.
        let mut cells = u32::try_from(BLOCK_NS.saturating_add(cell_ns - 1) / cell_ns).unwrap_or(1);
        for (length, block) in lengths.iter_mut().zip(&mut quantiles.blocks) {
            *length = cells;
            *block = quantile(f64::from(cells) * cell_s)?;
            cells = cells.saturating_mul(10);
        }
        self.clear();
        (self.cell_ns, self.cell_s) = (cell_ns, cell_s);
        (self.lengths, self.quantiles) = (lengths, quantiles);
        Ok(())
    }

    /// Adds the unit of a number, after [`Voting::begin`], or takes another for it. All learning begins anew.
    ///
    /// # Errors
    /// [`VotingConfigureError`]; the vote then stays as it was. No unit has the number: an interval of 0.
    pub fn add(&mut self, number: u8, config: &UnitConfig) -> Result<(), VotingConfigureError> {
        config.check().map_err(VotingConfigureError::Config)?;
        let number = usize::from(number);
        if number >= MAX_UNITS || self.cell_ns == 0 {
            return Err(VotingConfigureError::Config(
                InertialConfigError::Interval { interval_ns: 0 },
            ));
        }
        let all = self.units.iter_mut().zip(&mut self.spread).enumerate();
        for (place, (unit, spread)) in all {
            if place == number {
                let model = UnitModel::new(config, self.cell_ns);
                unit.model = Some(model);
                unit.interval_ns = config.interval_ns.into();
                unit.state = UnitState::Used;
                unit.fault = UnitFault::None;
                unit.grid.configure(config);
            }
            if let Some(model) = &unit.model {
                *spread = model.first;
            }
            unit.age_s = 0.0;
        }
        self.learned = [ZERO; MAX_UNITS];
        self.learned_force = None;
        self.restart_grid();
        self.begin_blocks();
        Ok(())
    }

    /// In place, part by part: the whole is too large for a stack.
    fn clear(&mut self) {
        for unit in &mut self.units {
            unit.model = None;
            unit.state = UnitState::Absent;
            unit.fault = UnitFault::None;
            (unit.strikes, unit.healthy_s, unit.since) = (0, 0, ALIVE_SAMPLES);
            (unit.is_failing, unit.leapt) = (false, false);
            (unit.repeated, unit.unusable, unit.age_s) = ([0; 6], (0, 0), 0.0);
        }
        self.learned = [ZERO; MAX_UNITS];
        self.spread = [ZERO; MAX_UNITS];
        self.learned_force = None;
        (self.disagree, self.agreed_s, self.is_disturbed) = (false, 0, false);
        self.restart_grid();
    }

    /// The next sample begins a new grid.
    fn restart_grid(&mut self) {
        (self.next, self.newest, self.begun) = (None, None, None);
        self.history = [None; 2];
        self.withheld = 0;
        for unit in &mut self.units {
            unit.grid.clear();
        }
    }

    fn begin_blocks(&mut self) {
        for level in 0..LEVELS {
            self.begin_block(level);
        }
        self.undetermined = [0; LEVELS];
        self.scatter = Scatter::EMPTY;
        self.delay = Delay::EMPTY;
    }

    fn begin_block(&mut self, level: usize) {
        if let Some(block) = self.blocks.get_mut(level) {
            *block = Block::EMPTY;
        }
        let start = level.checked_sub(DRIFT_LEVEL);
        if let Some(start) = start.and_then(|place| self.starts.get_mut(place)) {
            *start = Start {
                learned: self.learned,
                spread: self.spread,
            };
        }
    }

    /// What had been learned when the block of a level began.
    fn start_of(&self, level: usize) -> Start {
        let place = level.checked_sub(DRIFT_LEVEL);
        let start = place.and_then(|place| self.starts.get(place)).copied();
        // Nothing is learned within a shorter one.
        start.unwrap_or(Start {
            learned: self.learned,
            spread: self.spread,
        })
    }

    /// All times so far were wrong by this much, ns: the week became known.
    pub fn shift(&mut self, by_ns: i64) {
        for unit in &mut self.units {
            unit.grid.shift(by_ns);
        }
        self.restart_grid();
    }

    /// Whether there are units to vote.
    pub fn is_configured(&self) -> bool {
        self.units.iter().any(|unit| unit.model.is_some())
    }

    /// Interval of the output, ns; 0 before [`Voting::begin`].
    pub fn interval_ns(&self) -> u32 {
        u32::try_from(self.cell_ns).unwrap_or(0)
    }

    /// State of a unit, and why it is not used.
    pub fn unit(&self, number: usize) -> (UnitState, UnitFault) {
        self.units
            .get(number)
            .map_or((UnitState::Absent, UnitFault::None), |unit| {
                (unit.state, unit.fault)
            })
    }

    /// How many units the output rests on.
    pub fn mode(&self) -> VotingMode {
        if !self.is_configured() {
            return VotingMode::Off;
        }
        if self.disagree {
            return VotingMode::Disagree;
        }
        match self.units.iter().filter(|unit| unit.is_used()).count() {
            0 => VotingMode::NoUnit,
            1 => VotingMode::One,
            2 => VotingMode::Two,
            _ => VotingMode::Three,
        }
    }

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
        if !sample.is_valid {
            unit.since = 0;
            self.isolate(number, UnitFault::Status);
            return;
        }
        let time_ns = sample.sample.time.ns();
        let ahead_of =
            |time: Option<GpsTime>| time.map_or(0, |time| time_ns.saturating_sub(time.ns()));
        let leaps = ahead_of(unit.grid.end()) > MAX_LEAP_NS + unit.interval_ns
            && ahead_of(self.newest) > MAX_LEAP_NS;
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
    fn isolate(&mut self, number: usize, fault: UnitFault) {
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
    fn watch(&mut self, end_ns: i64) {
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

    /// Tests a cell and gives its output.
    fn vote(&mut self, index: i64) -> Option<ImuSample> {
        let end_ns = index.saturating_add(1).saturating_mul(self.cell_ns);
        self.watch(end_ns);
        let mut rates = [None; MAX_UNITS];
        for (rates, unit) in rates.iter_mut().zip(&self.units) {
            if unit.model.is_some() {
                *rates = unit.grid.rates(index, self.cell_ns);
            }
        }
        let mid = self.at_body_point(&mut rates);
        let Some(mid) = mid else {
            self.pause();
            return None;
        };
        let may_compare = self.compare(&rates, &mid);
        self.history = [Some(mid), self.history.first().copied().flatten()];
        if !may_compare || self.disagree {
            return None;
        }
        self.mean(&rates, end_ns)
    }

    /// A cell that no used unit measured.
    fn pause(&mut self) {
        self.history = [None; 2];
        self.delay.interrupt();
        self.scatter = Scatter::EMPTY;
        self.is_disturbed = true;
        self.skip();
    }

    /// Rates of used units, learned biases taken out.
    fn used(&self, rates: &[Option<Channels>; MAX_UNITS]) -> [Option<Channels>; MAX_UNITS] {
        let mut used = [None; MAX_UNITS];
        let all = used.iter_mut().zip(rates).zip(&self.learned);
        for (((used, rates), learned), unit) in all.zip(&self.units) {
            if unit.is_used() {
                *used = rates.map(|rates| rates - learned);
            }
        }
        used
    }

    /// Takes the forces from the units to the body point, and gives the mid-value there.
    fn at_body_point(&self, rates: &mut [Option<Channels>; MAX_UNITS]) -> Option<Channels> {
        let mid = middle(&self.used(rates))?;
        let omega = Vector3::new(mid.x, mid.y, mid.z);
        let [last, before] = self.history;
        let alpha = match (last, before) {
            (Some(last), Some(before)) => {
                let change = mid * 3.0 - last * 4.0 + before;
                Vector3::new(change.x, change.y, change.z) / (2.0 * self.cell_s)
            }
            _ => Vector3::zeros(),
        };
        for (rates, unit) in rates.iter_mut().zip(&self.units) {
            if let (Some(rates), Some(model)) = (rates, &unit.model) {
                let arm = model.arm_b_m;
                let force = alpha.cross(&arm) + omega.cross(&omega.cross(&arm));
                rates.w -= force.x;
                rates.a -= force.y;
                rates.b -= force.z;
            }
        }
        middle(&self.used(rates))
    }

    /// Models of all three, the absent as the first that is there: no pair with them is compared.
    fn models(&self) -> Option<[UnitModel; MAX_UNITS]> {
        let some = self.units.iter().find_map(|unit| unit.model)?;
        let mut models = [some; MAX_UNITS];
        for (model, unit) in models.iter_mut().zip(&self.units) {
            *model = unit.model.unwrap_or(some);
        }
        Some(models)
    }

    /// All tests that end with this cell; false when it may not be used.
    fn compare(&mut self, rates: &[Option<Channels>; MAX_UNITS], mid: &Channels) -> bool {
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
    fn skip(&mut self) {
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

    /// Weights of the used units, per channel; they add up to one.
    fn weights(&self, of: &[Option<Channels>; MAX_UNITS]) -> Option<[Channels; MAX_UNITS]> {
        let mut weights = [ZERO; MAX_UNITS];
        let mut sum = ZERO;
        let all = weights.iter_mut().zip(of).zip(&self.units);
        for ((weight, there), unit) in all {
            if let (Some(model), Some(_), true) = (&unit.model, there, unit.is_used()) {
                *weight = model.white.map(|white| 1.0 / white);
                sum += *weight;
            }
        }
        if !sum.iter().all(|part| *part > 0.0) {
            return None;
        }
        for weight in &mut weights {
            weight.component_div_assign(&sum);
        }
        Some(weights)
    }

    /// Weighted mean of the used units, learned biases taken out, and the weights.
    fn weighted(
        &self,
        of: &[Option<Channels>; MAX_UNITS],
    ) -> Option<(Channels, [Channels; MAX_UNITS])> {
        let weights = self.weights(of)?;
        let mut sum = ZERO;
        for ((weight, rates), learned) in weights.iter().zip(of).zip(&self.learned) {
            if let Some(rates) = rates {
                sum += weight.component_mul(&(rates - learned));
            }
        }
        Some((sum, weights))
    }

    fn mean(&self, rates: &[Option<Channels>; MAX_UNITS], end_ns: i64) -> Option<ImuSample> {
        let (mean, _) = self.weighted(rates)?;
        let m = mean * self.cell_s;
        Some(ImuSample {
            time: GpsTime::from_ns(end_ns),
            interval_ns: u32::try_from(self.cell_ns).unwrap_or(u32::MAX),
            dtheta_is_s_rad: [m.x, m.y, m.z],
            dv_is_s_mps: [m.w, m.a, m.b],
        })
    }

    /// Learns the bias of every unit against the mean of the used from a second in which they agreed.
    fn learn(
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
    fn count_health(&mut self, block: &Block, length_s: f64) -> bool {
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

fn force_of(rates: &Channels) -> Vector3<f64> {
    Vector3::new(rates.w, rates.a, rates.b)
}

/// ρ² of every pair that can be compared.
fn differences(
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

#[cfg(test)]
mod tests;
