//! The tight mode: inertial samples and corrected epochs to a navigation solution, and when not.
//!
//! ```text
//! ImuSample ─► intake ─► alignment ──started──► navigator (nominal, filter)
//! epoch ─► corrected rows ─► clock jumps, new constellations ─► predict, update ─► Navigation
//! ```
//!
//! The filter serves when it has been started and its samples are whole. Otherwise the snapshot
//! solution serves alone, and [`InertialStatus`] says why. What ends tight mode also begins the next
//! alignment, so that it comes back by itself. Choices: docs/decisions/005-tight-filter.md.

use heapless::Vec;

use crate::config::Config;
use crate::consts::{MAX_SATELLITES, SPEED_OF_LIGHT_MPS};
use crate::ekf::Filter;
use crate::ekf::layout::FIRST_OFFSET;
use crate::ekf::navigator::{AntennaState, Navigator};
use crate::frames::geodesy;
use crate::gnss::solution::{SnapshotSolution, SnapshotWorkspace};
use crate::gnss::{CorrectedEpoch, SatelliteSet, System};
use crate::ins::alignment::{
    AlignmentMode, CoarseAlignment, Magnetometer, MagnetometerError, Obstacle,
};
use crate::ins::horizon::{Aiding, Horizon};
use crate::ins::intake::{Intake, IntakeCounters, IntakeFault};
use crate::ins::mechanisation::Increment;
use crate::ins::{
    ImuSample, InertialConfig, InertialConfigError, InitialState, MagneticSample, ReferenceModel,
};
use crate::integrity::{InertialStatus, PhaseRequirements};
use crate::mhss::bank::{Bank, BankRow, BankVerdict, Secondaries, SubFilters};
use crate::mhss::separation::SeparationQuantiles;
use crate::report::Navigation;
use crate::snapshot::Assessment;
use crate::stats::StatsError;
use crate::time::{GpsTime, NS_PER_S};

mod aids;
mod clocks;
mod earned;
mod horizon;
mod jump;
mod loose;
mod recording;
mod scenario;
mod solution;
mod start;

use aids::Aids;
use clocks::offset_of;
use earned::Earned;
use loose::Loose;
use recording::RecordingBank;

/// Clock states of the monitor: bias, drift, and an offset for each further constellation.
pub const CLOCKS: usize = 4;
/// Size of the joint block of a measurement.
pub const JOINT: usize = 6 + CLOCKS;

/// The secondary filters of the monitor: half a megabyte, in a memory of its own.
pub type MonitorSecondaries = Secondaries<CLOCKS, JOINT>;

/// The filters that every test of an epoch reads: F00 while the bank runs, and those without one satellite
/// or one constellation. Small enough for a microcontroller's fastest memory.
#[derive(Clone, Debug)]
pub struct MonitorFastFilters {
    pub(crate) main: Filter<CLOCKS, JOINT>,
    pub(crate) sub: SubFilters<CLOCKS, JOINT>,
}

impl MonitorFastFilters {
    /// Empty: all bytes are zero.
    pub const EMPTY: Self = Self {
        main: Filter::EMPTY,
        sub: SubFilters::EMPTY,
    };
}

/// Where the bank's filters lie. Two memories, so that a board can put each where it has room. What
/// they hold belongs to the monitor that was given them: the same two must come with every epoch.
#[derive(Debug)]
pub struct BankMemory<'a> {
    /// F00 and F0n.
    pub fast: &'a mut MonitorFastFilters,
    /// Fnm.
    pub secondaries: &'a mut MonitorSecondaries,
}

/// A receiver clock that jumps does so by whole milliseconds, m.
const MILLISECOND_M: f64 = 1.0e-3 * SPEED_OF_LIGHT_MPS;
/// With a snapshot solution its clock tells a jump, from this on, m, and from this many sigmas of the
/// filter's clock on.
const SEEN_JUMP_M: f64 = 30.0;
/// See [`SEEN_JUMP_M`].
const SEEN_JUMP_SIGMAS: f64 = 6.0;
/// Farther off than this no code loop was locked, m; such a pseudorange is no monitored fault but no
/// measurement, for all filters alike.
const CODE_LOCK_M: f64 = 1.0e4;
/// One sigma of the offset of a constellation that was not there before, m: what
/// `snapshot::MAX_INTER_SYSTEM_M` lets pass.
const NEW_OFFSET_SIGMA_M: f64 = 3.0e3;
/// Epochs in a row in which the filter contradicts a snapshot solution that passed its test, before it
/// is started anew.
const MAX_DIVERGED: u8 = 3;
/// A filter whose innovations, normalised and squared, are this many times what they should be
/// contradicts satellites that agree with each other. A wrong attitude shows here long before it
/// shows in the position, which the satellites hold. A unit carried by hand with the satellites of a
/// town exceeds 37 in one epoch of twenty, for their errors are larger and longer than the model's.
const MAX_NIS_RATIO: f64 = 100.0;
/// Longest time without a sample that the nominal is carried over to an epoch, ns: what the intake
/// bridges.
const MAX_LEAD_NS: i64 = 50_000_000;
/// Epochs in a row that may come too late for the filter, before it, which takes none of them, is given up:
/// so many at least, and for this long, ns.
const MAX_LATE: u8 = 3;
/// See [`MAX_LATE`].
const MAX_LATE_NS: i64 = NS_PER_S;
/// An epoch that lies farther back than this is not late but of another time, ns.
const OF_ANOTHER_TIME_NS: i64 = 10 * NS_PER_S;
/// Longest time for which a lost attitude is still about what it was, ns.
const MAX_ATTITUDE_AGE_NS: i64 = 10 * NS_PER_S;
/// A protection level is at least this many sigmas of the position.
const LEVEL_SIGMAS: f64 = 4.0;
/// One sigma of an attitude kept from before, about north, east, down, rad.
const RESTART_SIGMA_NED_RAD: [f64; 3] = [0.1, 0.1, 0.3];
/// What a rate may do unseen during a bridged sample, one sigma, rad/s, and a specific force, m/s².
const UNSEEN_RATE_RADPS: f64 = 0.2;
/// See [`UNSEEN_RATE_RADPS`].
const UNSEEN_FORCE_MPS2: f64 = 2.0;

/// Why tight mode could not be configured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TightConfigureError {
    /// A value is out of its range.
    Config(InertialConfigError),
    /// A risk gives no quantile.
    Stats(StatsError),
}

/// What tight mode has to say of an epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TightSolution {
    /// Antenna, ECEF, m.
    pub r_e_m: [f64; 3],
    /// The same in geodetic coordinates.
    pub llh: geodesy::Llh,
    /// Velocity east, north, up, m/s.
    pub velocity_enu_mps: [f64; 3],
    /// Receiver clock minus each system's time, m, in the order of [`System::ALL`].
    pub clock_m: [Option<f64>; System::ALL.len()],
    /// Satellites taken.
    pub used: SatelliteSet,
    /// Everything else.
    pub navigation: Navigation,
}

/// A snapshot solution that passed its test, with its levels: good enough to start a filter from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TestedSolution<'a> {
    /// The solution.
    pub solution: &'a SnapshotSolution,
    /// Horizontal and vertical level, m.
    pub levels_m: [f64; 2],
}

impl<'a> TestedSolution<'a> {
    /// The solution of an assessment, if a fault in it would have been seen.
    pub(crate) fn new(assessment: &'a Assessment) -> Option<Self> {
        Some(Self {
            solution: assessment.solution.as_ref()?,
            levels_m: [
                assessment.verdict.hpl.bound_m()?,
                assessment.verdict.vpl.bound_m()?,
            ],
        })
    }
}

/// Everything tight mode needs, the filters of the bank apart. About 60 kB; lives in a static.
pub struct TightMonitor {
    config: Option<InertialConfig>,
    reference: Option<ReferenceModel>,
    k_fault_free: f64,
    /// The constellation whose clock is the clock; the others have offsets against it.
    reference_system: usize,
    systems: [Option<usize>; System::ALL.len()],
    offset_is_known: [bool; CLOCKS],
    intake: Intake,
    horizon: Horizon,
    alignment: CoarseAlignment,
    navigator: Navigator<CLOCKS, JOINT>,
    status: InertialStatus,
    corrected: CorrectedEpoch,
    innovations_m: [f64; MAX_SATELLITES],
    diverged: u8,
    bank: Bank<CLOCKS, JOINT>,
    rows: Vec<BankRow<JOINT>, MAX_SATELLITES>,
    quantiles: SeparationQuantiles,
    bank_verdict: Option<(GpsTime, BankVerdict)>,
    recording: RecordingBank,
    /// Epochs in a row that came too late for the filter, and the first of them.
    late: u8,
    late_since: GpsTime,
    /// Attitude when tight mode ended, and when that was.
    last_attitude: Option<([f64; 4], GpsTime)>,
    /// Counters of the intake at the last epoch.
    counted: Option<IntakeCounters>,
    last_epoch: Option<GpsTime>,
    /// Why there are no samples to serve the last epoch with.
    missing: Option<InertialStatus>,
    /// Why tight mode ended, until an epoch has told it.
    untold: Option<InertialStatus>,
    /// The antenna when the next epoch is due.
    remembered: Option<AntennaState<CLOCKS>>,
    /// Where the attitude that the filter started from came from.
    alignment_mode: AlignmentMode,
    aids: Aids,
    /// Why there is no attitude.
    obstacle: Obstacle,
    /// Whether the filter is believed.
    earned: Earned,
    loose: Loose,
}

impl TightMonitor {
    /// No inertial unit.
    pub const EMPTY: Self = Self {
        config: None,
        reference: None,
        k_fault_free: 0.0,
        reference_system: 0,
        systems: [None; System::ALL.len()],
        offset_is_known: [false; CLOCKS],
        intake: Intake::EMPTY,
        horizon: Horizon::EMPTY,
        alignment: CoarseAlignment::EMPTY,
        navigator: Navigator::EMPTY,
        status: InertialStatus::Off,
        corrected: CorrectedEpoch::EMPTY,
        innovations_m: [0.0; MAX_SATELLITES],
        diverged: 0,
        bank: Bank::EMPTY,
        rows: Vec::new(),
        quantiles: SeparationQuantiles::EMPTY,
        bank_verdict: None,
        recording: RecordingBank::EMPTY,
        late: 0,
        late_since: GpsTime::from_ns(0),
        last_attitude: None,
        counted: None,
        last_epoch: None,
        missing: None,
        untold: None,
        remembered: None,
        alignment_mode: AlignmentMode::None,
        aids: Aids::EMPTY,
        obstacle: Obstacle::None,
        earned: Earned::NOTHING,
        loose: Loose::OFF,
    };

    /// An inertial unit is there, in a phase of flight with these requirements.
    ///
    /// # Errors
    /// [`TightConfigureError`]; tight mode then stays as it was.
    pub fn configure(
        &mut self,
        inertial: &InertialConfig,
        requirements: &PhaseRequirements,
    ) -> Result<(), TightConfigureError> {
        inertial.check().map_err(TightConfigureError::Config)?;
        if self.reference.is_none() {
            self.allocate(requirements)
                .map_err(TightConfigureError::Stats)?;
        }
        self.intake.configure(inertial);
        self.horizon.restart();
        self.alignment.configure(inertial);
        self.last_attitude = None;
        self.counted = None;
        self.last_epoch = None;
        self.missing = None;
        self.untold = None;
        self.remembered = None;
        self.config = Some(*inertial);
        self.status = InertialStatus::NoSample;
        Ok(())
    }

    /// The phase of flight has changed after the unit was configured: its risks are taken apart again. False
    /// without a unit, or where a scenario folder is run.
    pub(crate) fn reallocate(
        &mut self,
        requirements: &PhaseRequirements,
    ) -> Result<bool, StatsError> {
        let is_asked = self.config.is_some() && self.reference.is_none();
        if is_asked {
            self.allocate(requirements)?;
        }
        Ok(is_asked)
    }

    /// Which constellations are used; the first has the clock the others' offsets are against.
    pub(crate) fn choose_systems(&mut self, config: &Config) {
        self.systems = [None; System::ALL.len()];
        let mut column = None;
        for (place, system) in self.systems.iter_mut().zip(System::ALL) {
            if !config.systems.contains(system) {
                continue;
            }
            *place = column;
            column = match column {
                None => {
                    self.reference_system = system.index();
                    Some(FIRST_OFFSET)
                }
                Some(column) => Some(column + 1),
            };
        }
    }

    /// From here on by the reference model of a scenario folder: corrected epochs only, one clock for
    /// all constellations, no gate, no snapshot.
    ///
    /// # Errors
    /// [`TightConfigureError`] when a risk gives no quantile.
    pub(crate) fn follow(&mut self, reference: &ReferenceModel) -> Result<(), TightConfigureError> {
        self.quantiles
            .fill(reference.p_fa, reference.p_md, reference.p_h0)
            .map_err(TightConfigureError::Stats)?;
        self.k_fault_free = self.quantiles.fault_free();
        self.reference = Some(*reference);
        self.expect(None);
        Ok(())
    }

    /// The reference model, if a scenario is run.
    pub(crate) const fn reference(&self) -> Option<&ReferenceModel> {
        self.reference.as_ref()
    }

    /// What the inertial side does.
    pub const fn status(&self) -> InertialStatus {
        self.status
    }

    /// The same for the report of an epoch: the first to be made after tight mode ended says why it
    /// did, whatever has become of it since. A filter that is not believed yet still aligns.
    pub(crate) fn tell(&mut self) -> InertialStatus {
        let status = match self.status {
            InertialStatus::Running if !self.earned.is_earned() => InertialStatus::Aligning,
            status => status,
        };
        self.untold.take().unwrap_or(status)
    }

    /// There is a magnetometer.
    ///
    /// # Errors
    /// [`MagnetometerError`]; there is then none.
    pub fn configure_magnetometer(
        &mut self,
        magnetometer: &Magnetometer,
    ) -> Result<(), MagnetometerError> {
        magnetometer.check()?;
        self.alignment.set_magnetometer(magnetometer);
        Ok(())
    }

    /// A sample of the magnetometer.
    pub(crate) fn on_field(&mut self, sample: &MagneticSample) {
        self.await_increments(Aiding::Field(*sample));
    }

    /// Why there is no attitude, or why the filter that has one is not believed.
    pub const fn obstacle(&self) -> Obstacle {
        match (self.is_running(), self.earned.is_earned()) {
            (true, true) => Obstacle::None,
            (true, false) => Obstacle::NotEarned,
            (false, _) => self.obstacle,
        }
    }

    /// Where the attitude that the filter started from came from.
    pub const fn alignment_mode(&self) -> AlignmentMode {
        if self.is_running() {
            self.alignment_mode
        } else {
            AlignmentMode::None
        }
    }

    /// The intake, with its counters.
    pub const fn intake(&self) -> &Intake {
        &self.intake
    }

    /// The filter and its nominal.
    pub const fn navigator(&self) -> &Navigator<CLOCKS, JOINT> {
        &self.navigator
    }

    /// Starts from a state that is given. Without a configured unit nothing happens.
    pub(crate) fn start(&mut self, state: &InitialState) {
        if let Some(config) = self.config {
            self.untold = None;
            // What ends before the state is not carried on from it.
            self.release(state.time);
            self.alignment_mode = AlignmentMode::Given;
            self.start_with(&config, state);
            self.earned = Earned::start(AlignmentMode::Given, &[0.0; 3]);
        }
    }

    fn start_with(&mut self, config: &InertialConfig, state: &InitialState) {
        self.offset_is_known = [false; CLOCKS];
        self.diverged = 0;
        self.bank.restart();
        self.bank_verdict = None;
        self.recording.start();
        self.aids.restart();
        self.late = 0;
        self.remembered = None;
        self.loose.start();
        if self.navigator.start(config, state).is_ok() {
            self.status = InertialStatus::Running;
        }
    }
}

impl TightMonitor {
    /// An epoch of the receiver, after `workspace` and `tested` of the snapshot monitor. `excluded` are
    /// the satellites it left out as faulty; `take` is false while a fault is present that is not
    /// excluded: the filter then coasts.
    ///
    /// `None` where the snapshot solution serves alone; [`TightMonitor::status`] says why.
    #[inline(never)]
    pub(crate) fn on_epoch(
        &mut self,
        time: GpsTime,
        workspace: &mut SnapshotWorkspace,
        excluded: SatelliteSet,
        take: bool,
        tested: Option<&TestedSolution<'_>>,
    ) -> Option<TightSolution> {
        self.meets(time)?;
        let mut at = self.navigator.predict(time);
        // A place that is no place for a receiver shows in the rows: there are none.
        if !take
            || workspace
                .corrected(at.r_e_m, at.v_e_mps, excluded, &mut self.corrected)
                .is_err()
        {
            self.corrected.rows.clear();
        }
        if let Some(config) = &self.config {
            let factors = config.measurement;
            self.corrected
                .scale_sigmas(factors.pseudorange, factors.range_rate);
        }
        let _ = self.prepare_clocks(&mut at, tested);
        self.note_speed(tested);
        self.finish(&at)
    }

    /// An epoch was due at `due` and the receiver gave none. The filter goes on without it, to `until`.
    #[inline(never)]
    pub(crate) fn on_silence(&mut self, due: GpsTime, until: GpsTime) -> Option<TightSolution> {
        self.release(until);
        let at = self.remembered.take().filter(|at| at.time == due)?;
        if !self.is_running() {
            return None;
        }
        // The filter comes to where the nominal is now; without rows nothing changes but its spread.
        self.navigator.predict(self.navigator.time());
        self.corrected.rows.clear();
        self.finish(&at)
    }

    /// Keeps where the antenna was when an epoch was due, for [`TightMonitor::on_silence`]; to be called
    /// after every step.
    fn remember(&mut self, due: GpsTime) {
        let passed_ns = self.navigator.time().ns().wrapping_sub(due.ns());
        if self.is_running()
            && (0..=MAX_LEAD_NS).contains(&passed_ns)
            && self.remembered.is_none_or(|at| at.time != due)
        {
            self.remembered = Some(self.navigator.antenna(due));
        }
    }

    /// Whether the nominal can be taken to an epoch.
    fn meets(&mut self, time: GpsTime) -> Option<()> {
        self.release(time);
        self.look(time)?;
        if !self.is_running() {
            return None;
        }
        match self.missing {
            None => {
                self.late = 0;
                self.status = InertialStatus::Running;
                Some(())
            }
            Some(InertialStatus::EpochLate) => {
                if self.may_be_late(time) {
                    self.status = InertialStatus::EpochLate;
                    return None;
                }
                // Without a filter to be late for, the two are of different times.
                self.missing = Some(InertialStatus::ImuTime);
                self.lose(InertialStatus::ImuTime);
                None
            }
            Some(cause) => {
                self.lose(cause);
                None
            }
        }
    }

    /// Counts an epoch that came too late; false when they have been too many for too long.
    fn may_be_late(&mut self, time: GpsTime) -> bool {
        if self.late == 0 {
            self.late_since = time;
        }
        let since_ns = time.ns().saturating_sub(self.late_since.ns());
        let is_allowed = self.late < MAX_LATE || (0..MAX_LATE_NS).contains(&since_ns);
        self.late = self.late.saturating_add(1);
        is_allowed
    }

    /// Whether there are samples up to an epoch, and why not. `None` without an inertial unit.
    fn look(&mut self, time: GpsTime) -> Option<()> {
        let interval_ns = i64::from(self.config.as_ref()?.interval_ns);
        let now = self.intake.counters();
        let before = self.counted.replace(now);
        let last_epoch = self.last_epoch.replace(time);
        let newest = if self.is_running() {
            Some(self.navigator.time())
        } else {
            self.horizon.reached()
        };
        let lead_ns = newest.map(|newest| time.ns().saturating_sub(newest.ns()));
        let since_epoch_ns = last_epoch.map(|last| time.ns().saturating_sub(last.ns()));
        let used = before.map_or(0, |before| now.used.saturating_sub(before.used));
        let goes_on = since_epoch_ns.is_some_and(|ns| {
            let used_ns = i64::from(used).saturating_mul(interval_ns);
            used_ns > ns / 2 && lead_ns.is_some_and(|lead_ns| lead_ns > ns / 2)
        });
        if lead_ns.is_some_and(|lead_ns| (-OF_ANOTHER_TIME_NS..-2 * interval_ns).contains(&lead_ns))
        {
            self.horizon.note_too_late();
        }
        self.missing = match lead_ns {
            Some(lead_ns) if lead_ns < -2 * interval_ns && self.is_running() => {
                Some(InertialStatus::EpochLate)
            }
            Some(lead_ns) if lead_ns < -2 * interval_ns => Some(InertialStatus::ImuTime),
            Some(lead_ns) if lead_ns <= MAX_LEAD_NS => None,
            // All samples so far are of later instants, and wait for the next epoch.
            None if self.horizon.held().next().is_some() => Some(InertialStatus::NoSample),
            // Most samples came, and are too old for the time that passed.
            _ if goes_on => Some(InertialStatus::ImuTime),
            _ => Some(silence(before, now)),
        };
        Some(())
    }

    /// Compares with a snapshot solution that passed its test: horizontal and vertical separation, m, and
    /// its levels, m. A filter that for several epochs lies farther from it than both levels together,
    /// or contradicts its satellites by far, is started anew; false when it has come to that.
    pub(crate) fn compare(
        &mut self,
        separation_m: [f64; 2],
        levels_m: [f64; 2],
        solution: &TightSolution,
    ) -> bool {
        let [fault_free_h, fault_free_v] = solution.navigation.fault_free_m;
        let [h, v] = separation_m;
        let [hpl, vpl] = levels_m;
        let Navigation { nis, nis_rows, .. } = solution.navigation;
        let within = h <= hpl + fault_free_h
            && v <= vpl + fault_free_v
            && nis <= MAX_NIS_RATIO * f64::from(nis_rows);
        self.diverged = if within {
            0
        } else {
            self.diverged.saturating_add(1)
        };
        let serves = self.diverged < MAX_DIVERGED;
        if !serves {
            self.lose(InertialStatus::Unhealthy);
        }
        serves
    }

    /// It is `now` by a clock beside the samples': samples that are too old by it have stopped.
    pub(crate) fn hear_nothing(&mut self, now: GpsTime) {
        let nominal = self.navigator.time();
        let newest = self
            .intake
            .last_time()
            .map_or(nominal, |last| last.max(nominal));
        let lead_ns = now.ns().saturating_sub(newest.ns());
        if self.is_running() && lead_ns > MAX_LEAD_NS {
            self.missing = Some(InertialStatus::ImuSilent);
            self.lose(InertialStatus::ImuSilent);
        }
    }

    /// All times so far were wrong by this much, ns: the week of the receiver became known.
    pub(crate) fn shift(&mut self, by_ns: i64) {
        let shifted = |time: GpsTime| time.plus_ns(by_ns);
        self.intake.shift(by_ns);
        self.horizon.shift(by_ns);
        self.navigator.shift(by_ns);
        self.bank.shift(by_ns);
        self.recording.shift(by_ns);
        self.aids.shift(by_ns);
        self.loose.shift(by_ns);
        self.earned.shift(by_ns);
        self.late_since = shifted(self.late_since);
        self.bank_verdict = None;
        self.alignment.restart();
        self.last_epoch = self.last_epoch.map(shifted);
        self.last_attitude = self
            .last_attitude
            .map(|(attitude, when)| (attitude, shifted(when)));
        self.remembered = None;
    }

    /// Whether the filter serves.
    pub const fn is_running(&self) -> bool {
        matches!(
            self.status,
            InertialStatus::Running | InertialStatus::EpochLate
        )
    }

    /// Ends tight mode; the next alignment begins. An attitude that was given holds for the first start
    /// only.
    fn lose(&mut self, status: InertialStatus) {
        if self.is_running() {
            // The attitude of a filter that went wrong is what may be wrong with it, and that of one that
            // was not believed yet is none to keep.
            let is_unhealthy = status == InertialStatus::Unhealthy;
            self.last_attitude = (!is_unhealthy && self.earned.is_earned())
                .then_some((self.navigator.mechanisation().q_e_b, self.navigator.time()));
            let by_field = self.alignment_mode == AlignmentMode::MagneticField;
            self.alignment.resume(!(is_unhealthy && by_field));
        } else {
            self.alignment.restart();
        }
        self.status = status;
        self.untold.get_or_insert(status);
        self.diverged = 0;
        self.late = 0;
        self.obstacle = Obstacle::None;
        self.earned = Earned::NOTHING;
    }

    /// The units differ and nobody knows who is right: what rests on them ends.
    pub(crate) fn distrust(&mut self) {
        if self.config.is_some() {
            self.lose(InertialStatus::ImuDisagree);
        }
    }

    /// What is known of the unit.
    pub(crate) const fn config(&self) -> Option<&InertialConfig> {
        self.config.as_ref()
    }

    /// A sample of the inertial unit.
    #[inline(never)]
    pub fn on_sample(&mut self, sample: &ImuSample) {
        if self.config.is_none() {
            return;
        }
        match self.intake.take(sample) {
            Ok(None) => {}
            Ok(Some(taken)) => {
                if self.status == InertialStatus::NoSample {
                    self.status = InertialStatus::Aligning;
                }
                self.hold(&taken);
            }
            Err(fault) => {
                self.release_all();
                self.lose(match fault {
                    IntakeFault::Silent { .. } => InertialStatus::ImuSilent,
                    IntakeFault::NotFinite { .. } => InertialStatus::ImuNotFinite,
                    IntakeFault::Saturated { .. } => InertialStatus::ImuSaturated,
                    IntakeFault::Time { .. } => InertialStatus::ImuTime,
                });
                self.horizon.begin_at(self.intake.last_time());
            }
        }
    }

    fn step(&mut self, increment: &Increment, time: GpsTime) {
        self.aids.on_increment(increment);
        if self.is_running() {
            self.navigator.step(increment, time);
        } else {
            self.alignment.accumulate(increment);
        }
    }

    /// Rows, update, feedback; then the solution.
    /// For an epoch that the nominal has long passed `at` is also what is told.
    fn finish(&mut self, at: &AntennaState<CLOCKS>) -> Option<TightSolution> {
        let systems = if self.reference.is_some() {
            [None; System::ALL.len()]
        } else {
            self.systems
        };
        let mut used = SatelliteSet::EMPTY;
        let mut present = [false; System::ALL.len()];
        for measurement in &self.corrected.rows {
            let system = measurement.satellite.system();
            if self
                .navigator
                .add(measurement, at, offset_of(&systems, system))
            {
                used.insert(measurement.satellite);
                if let Some(present) = present.get_mut(system.index()) {
                    *present = true;
                }
            }
        }
        if self.reference.is_none() {
            self.ask_aids();
            if self.aids.information().rows() > 0 {
                self.navigator
                    .information_mut()
                    .add(self.aids.information());
            }
        }
        let summary = self.navigator.update_filter();
        let correction = self.navigator.finish().ok();
        if let Some(correction) = &correction {
            self.rereference_aids(correction);
        }
        let solution = correction.and_then(|_| {
            let passed_ns = self.navigator.time().ns().wrapping_sub(at.time.ns());
            let told = if passed_ns > MAX_LEAD_NS {
                *at
            } else {
                self.navigator.antenna(at.time)
            };
            self.solution(&told, &summary, used, present)
        });
        if solution.is_none() {
            self.lose(InertialStatus::Unhealthy);
        }
        solution
    }
}

/// Why no sample came that could be used since the counters were as `before`.
fn silence(before: Option<IntakeCounters>, now: IntakeCounters) -> InertialStatus {
    let since = |count: fn(&IntakeCounters) -> u32| count(&now) != before.as_ref().map_or(0, count);
    if since(|counters| counters.saturated) {
        InertialStatus::ImuSaturated
    } else if since(|counters| counters.not_finite) {
        InertialStatus::ImuNotFinite
    } else if since(|counters| counters.late) || since(|counters| counters.bad_interval) {
        InertialStatus::ImuTime
    } else if now == IntakeCounters::ZERO {
        InertialStatus::NoSample
    } else {
        InertialStatus::ImuSilent
    }
}

#[cfg(test)]
mod tests;
