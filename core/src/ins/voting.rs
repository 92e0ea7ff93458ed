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

mod arrival;
mod blocks;
mod config;
mod grid;
mod judging;
mod learning;
mod noise;
mod parity;
mod states;

pub use config::{UnitConfig, UnitTolerance};
pub use states::{UnitFault, UnitState, VotingMode};

use nalgebra::Vector3;

use super::{ImuSample, InertialConfigError, MAX_UNITS};
use crate::stats::{StatsError, normal};
use crate::time::GpsTime;
use blocks::{Block, LEVELS, Start};
use grid::{Channels, RING, UnitGrid, seconds};
use noise::{Delay, Scatter};
use parity::{UnitModel, middle};

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
/// So many valid samples make up for an invalid one.
const INVALID_PART: i64 = 8;
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
    /// Length of the samples that it called invalid, ns, less that of a part of the valid ones since.
    invalid_ns: i64,
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
        invalid_ns: 0,
        leapt: false,
        repeated: [0; 6],
        last: [0.0; 6],
        unusable: (0, 0),
        age_s: 0.0,
    };

    fn is_used(&self) -> bool {
        self.state == UnitState::Used
    }

    /// Notes what it says of its sample. Few invalid ones are missing ones, which the grid bridges; false when
    /// they are more than that, or it is out already.
    fn is_sound(&mut self, is_valid: bool) -> bool {
        if is_valid {
            self.invalid_ns = (self.invalid_ns - self.interval_ns / INVALID_PART).max(0);
            return true;
        }
        self.since = 0;
        self.invalid_ns = self
            .invalid_ns
            .saturating_add(self.interval_ns)
            .min(2 * SILENT_NS);
        self.is_used() && self.invalid_ns <= SILENT_NS
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
    /// Time of the newest sample that was called invalid.
    heard: Option<GpsTime>,
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
        heard: None,
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
        self.heard = None;
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
}

#[cfg(test)]
mod tests;
