//! The façade: bytes in, one report per epoch out. Owns all state.
//!
//! ```text
//! bytes ─ push() ─► ingest ─► ephemerides, ionosphere, ObservationEpoch, ImuSample ─► tight: nominal
//!                                   │ Ready::Epoch
//!                     process() ◄───┘  snapshot monitor, then the filter
//!                         └─► EpochReport
//! ```
//!
//! A `Monitor` is large (see `cargo xtask bench`): it lives in a `static` made from
//! [`Monitor::EMPTY`] and is configured in place.

use nalgebra::Vector3;

use crate::bank_report::BankReport;
use crate::budget::{CycleCounter, Ledger, Meter, Stage};
use crate::config::Config;
use crate::frames::geodesy;
use crate::gnss::solution::SATELLITE_REASONS;
use crate::gnss::{
    BroadcastIonosphere, EphemerisStore, FixSolution, FixVelocity, ObservationEpoch, ReceiverFix,
    SatelliteSet, System,
};
use crate::inertial_report::{
    AidsPart, AlignmentPart, InertialReport, NavigationNow, TimingPart, UnitPart,
};
use crate::ingest::{Event, Ingest};
use crate::ins::alignment::MagnetometerError;
use crate::ins::{
    AidsConfig, AidsConfigError, InertialConfig, InertialConfigError, IntakeCounters,
    MAX_LATENCY_NS, MAX_UNITS, MagneticSample, Magnetometer, PressureSample, UnitConfig, UnitFault,
    UnitSample, UnitState, Voting, VotingConfigureError, VotingMode,
};
use crate::integrity::{
    AlertState, Alerts, InertialStatus, Integrity, Mode, NoBound, Opinions, ProtectionLevel,
    Reason, Verdict, opinion,
};
use crate::mhss::protection::SNAPSHOT_FALSE_ALERT_SHARE;
use crate::readmission::{self, Readmission};
use crate::report::{EpochReport, Fix, ReportFlags};
use crate::rhythm::Rhythm;
use crate::satellite_report::SatelliteReport;
use crate::snapshot::{Assessment, ConfigureError, SnapshotMonitor};
use crate::tight::{BankMemory, TestedSolution, TightConfigureError, TightMonitor, TightSolution};
use crate::time::{GpsTime, NS_PER_WEEK};
use crate::wire::Counters;

/// Of what is in body axes already.
const NO_MOUNTING: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// What [`Monitor::push`] stopped for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ready {
    /// An observation epoch is complete: call [`Monitor::process`].
    Epoch,
    /// The sender says that no more bytes come.
    EndOfStream,
}

/// A receiver's latency beyond [`MAX_LATENCY_NS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LatencyTooLong {
    /// The latency given, ns.
    pub latency_ns: u32,
}

/// What [`Ready::Epoch`] announced.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Pending {
    /// Observations of the receiver.
    Observations,
    /// Corrected measurements of a scenario folder.
    Corrected,
    /// The receiver's own solution, of a receiver without observations.
    Fix(ReceiverFix),
    /// Nothing: an epoch was due and the receiver is silent. The filter goes on without it, to `until`.
    Silence { time: GpsTime, until: GpsTime },
}

/// All state of surefix.
pub struct Monitor {
    ingest: Ingest,
    store: EphemerisStore,
    ionosphere: BroadcastIonosphere,
    snapshot: SnapshotMonitor,
    voting: Voting,
    tight: TightMonitor,
    ledger: Ledger,
    pending: Pending,
    rhythm: Rhythm,
    first_epoch: Option<GpsTime>,
    refused_configurations: u32,
    alerts: Alerts,
    readmission: Readmission,
    /// How the two opinions on the last epoch stand to each other, where there were two.
    opinions: Option<Opinions>,
}

impl Monitor {
    /// Nothing configured, nothing received.
    pub const EMPTY: Self = Self {
        ingest: Ingest::EMPTY,
        store: EphemerisStore::EMPTY,
        ionosphere: BroadcastIonosphere::EMPTY,
        snapshot: SnapshotMonitor::EMPTY,
        voting: Voting::EMPTY,
        tight: TightMonitor::EMPTY,
        ledger: Ledger::EMPTY,
        pending: Pending::Observations,
        rhythm: Rhythm::UNKNOWN,
        first_epoch: None,
        refused_configurations: 0,
        alerts: Alerts::STARTING,
        readmission: Readmission::NOBODY,
        opinions: None,
    };

    /// Sets what a user chooses. A configuration frame in the stream does the same, until the first
    /// epoch; after it, a stream cannot change the configuration.
    ///
    /// # Errors
    /// [`ConfigureError`]; every epoch is then `unavailable` with
    /// [`crate::integrity::Reason::NotConfigured`].
    pub fn configure(&mut self, config: &Config) -> Result<(), ConfigureError> {
        self.snapshot.configure(config)?;
        self.ingest.configure(config);
        self.tight.choose_systems(config);
        let requirements = config.phase.requirements();
        self.alerts.configure(&requirements);
        if self
            .tight
            .reallocate(&requirements)
            .map_err(ConfigureError::Stats)?
        {
            self.snapshot
                .share_false_alerts(SNAPSHOT_FALSE_ALERT_SHARE)
                .map_err(ConfigureError::Stats)?;
        }
        Ok(())
    }

    /// Adds an inertial unit, after [`Monitor::configure`]. A frame in the stream does the same, until
    /// the first epoch.
    ///
    /// # Errors
    /// [`TightConfigureError`]; there is then no tight mode. With units that vote, of which it says what the
    /// vote gives, it may neither turn the axes nor change the interval.
    pub fn configure_inertial(
        &mut self,
        inertial: &InertialConfig,
    ) -> Result<(), TightConfigureError> {
        if self.voting.is_configured() {
            let interval_ns = inertial.interval_ns;
            if inertial.c_b_s != NO_MOUNTING {
                return Err(TightConfigureError::Config(InertialConfigError::Mounting));
            }
            if interval_ns != self.voting.interval_ns() {
                let error = InertialConfigError::Interval { interval_ns };
                return Err(TightConfigureError::Config(error));
            }
        }
        let phase = self
            .snapshot
            .config()
            .map_or(Config::PRESET.phase, |config| config.phase);
        self.tight.configure(inertial, &phase.requirements())?;
        self.tight.expect(self.rhythm.due());
        self.snapshot
            .share_false_alerts(SNAPSHOT_FALSE_ALERT_SHARE)
            .map_err(TightConfigureError::Stats)
    }

    /// Adds the aids: a barometer, standstills. A frame in the stream does the same, until the first epoch.
    ///
    /// # Errors
    /// [`AidsConfigError`]; the aids are then those of before.
    pub fn configure_aids(&mut self, aids: &AidsConfig) -> Result<(), AidsConfigError> {
        aids.check()?;
        self.snapshot.height_mut().configure(aids.barometer);
        self.tight.configure_aids(aids);
        Ok(())
    }

    /// Says how long after its instant an epoch of the receiver arrives at the least, ns. Without it the
    /// monitor learns it from the epochs that come: it is what a missing epoch is waited for, besides half an
    /// interval. A frame in the stream does the same, until the first epoch.
    ///
    /// # Errors
    /// [`LatencyTooLong`] when the filter's history does not reach back so far; nothing is changed then.
    pub fn configure_receiver_latency(&mut self, latency_ns: u32) -> Result<(), LatencyTooLong> {
        if i64::from(latency_ns) > MAX_LATENCY_NS {
            return Err(LatencyTooLong { latency_ns });
        }
        self.rhythm.know_latency(latency_ns.into());
        Ok(())
    }

    /// Adds a magnetometer, whose field gives a heading. A frame in the stream does the same, until the first
    /// epoch.
    ///
    /// # Errors
    /// [`MagnetometerError`]; there is then none.
    pub fn configure_magnetometer(
        &mut self,
        magnetometer: &Magnetometer,
    ) -> Result<(), MagnetometerError> {
        self.tight.configure_magnetometer(magnetometer)
    }

    /// Adds the unit of a number, below [`MAX_UNITS`], to those that vote, after
    /// [`Monitor::configure_inertial`], which says what the vote gives: its interval, the way from the body
    /// point to the antenna, noise, and no mounting. A frame in the stream does the same, until the first
    /// epoch.
    ///
    /// # Errors
    /// [`VotingConfigureError`]; the units are then as they were.
    pub fn configure_unit(
        &mut self,
        unit: u8,
        config: &UnitConfig,
    ) -> Result<(), VotingConfigureError> {
        let Some(voted) = self.tight.config() else {
            return Err(VotingConfigureError::Config(
                InertialConfigError::Interval { interval_ns: 0 },
            ));
        };
        // The vote gives body axes.
        if voted.c_b_s != NO_MOUNTING {
            return Err(VotingConfigureError::Config(InertialConfigError::Mounting));
        }
        let interval_ns = voted.interval_ns;
        if !self.voting.is_configured() || self.voting.interval_ns() != interval_ns {
            self.voting.begin(interval_ns)?;
        }
        self.voting.add(unit, config)
    }

    /// Takes bytes of the receiver until something is ready or all are used; tells how many were
    /// used. Call again with the rest.
    #[inline(never)]
    pub fn push(&mut self, bytes: &[u8]) -> (usize, Option<Ready>) {
        let mut used: usize = 0;
        // Every turn uses a byte or takes an event, of which one byte brings two at the most.
        loop {
            let rest = bytes.get(used..).unwrap_or(&[]);
            let (taken, event) = self.ingest.push(rest);
            used = used.saturating_add(taken);
            if event == Event::Nothing {
                return (used, None);
            }
            if let Some(ready) = self.take(event) {
                return (used, Some(ready));
            }
        }
    }

    /// Bytes given to [`Monitor::push`] from which nothing has followed yet: the frame that is not complete.
    /// A sample handed in now takes effect before them.
    pub fn bytes_in_hand(&self) -> usize {
        self.ingest.bytes_in_hand()
    }

    /// No more bytes will come: gives an epoch that waited for more, then [`Ready::EndOfStream`].
    pub fn finish(&mut self) -> Ready {
        // One unfinished frame can bring a few events before the end; none brings a hundred.
        for _ in 0..100 {
            let event = self.ingest.finish();
            if let Some(ready) = self.take(event) {
                return ready;
            }
        }
        Ready::EndOfStream
    }

    fn take(&mut self, event: Event) -> Option<Ready> {
        match event {
            Event::Nothing | Event::StationPosition(_) => None,
            Event::Configuration(config) => {
                let is_early = self.first_epoch.is_none();
                let is_accepted = is_early && self.configure(&config).is_ok();
                self.note_refusal(is_accepted);
                None
            }
            Event::Inertial(config) => {
                let is_early = self.first_epoch.is_none();
                let is_accepted = is_early && self.configure_inertial(&config).is_ok();
                self.note_refusal(is_accepted);
                None
            }
            Event::Aids(aids) => {
                let is_early = self.first_epoch.is_none();
                let is_accepted = is_early && self.configure_aids(&aids).is_ok();
                self.note_refusal(is_accepted);
                None
            }
            Event::ReceiverLatency(latency_ns) => {
                let is_early = self.first_epoch.is_none();
                let is_accepted = is_early && self.configure_receiver_latency(latency_ns).is_ok();
                self.note_refusal(is_accepted);
                None
            }
            Event::Magnetometer(magnetometer) => {
                let is_early = self.first_epoch.is_none();
                let is_accepted = is_early && self.configure_magnetometer(&magnetometer).is_ok();
                self.note_refusal(is_accepted);
                None
            }
            Event::ReferenceModel(model) => {
                let is_early = self.first_epoch.is_none();
                let is_accepted = is_early && self.tight.follow(&model).is_ok();
                self.note_refusal(is_accepted);
                None
            }
            Event::InitialState(state) => {
                // A filter that runs is not moved by what a stream says.
                let is_accepted = self.first_epoch.is_none() || !self.tight.is_running();
                if is_accepted {
                    self.tight.start(&state);
                }
                self.note_refusal(is_accepted);
                None
            }
            Event::Imu(sample) if self.voting.is_configured() => {
                // Whoever does not say which unit means the first.
                let sample = UnitSample {
                    sample,
                    is_valid: true,
                    temperature_c: None,
                };
                self.on_unit_sample(0, &sample)
            }
            Event::Imu(sample) => {
                self.tight.on_sample(&sample);
                self.expect_epoch(sample.time)
            }
            Event::Unit { unit, config } => {
                let is_early = self.first_epoch.is_none();
                let is_accepted = is_early && self.configure_unit(unit, &config).is_ok();
                self.note_refusal(is_accepted);
                None
            }
            Event::UnitSample { unit, sample } => self.on_unit_sample(unit, &sample),
            Event::Pressure(sample) => {
                self.on_pressure(&sample);
                None
            }
            Event::MagneticField(sample) => {
                self.on_magnetic_field(&sample);
                None
            }
            Event::Ephemeris(ephemeris) => {
                // What is no orbit leaves its satellite without an ephemeris, a counted reason.
                let _ = self.store.insert(&ephemeris);
                None
            }
            Event::Klobuchar(parameters) => {
                self.ionosphere.insert(parameters);
                None
            }
            Event::WeekResolved { shift_weeks } => {
                self.store.shift_weeks(shift_weeks);
                let shift_ns = i64::from(shift_weeks).wrapping_mul(NS_PER_WEEK);
                self.first_epoch = self.first_epoch.map(|time| time.plus_ns(shift_ns));
                self.rhythm.shift(shift_ns);
                self.alerts.shift(shift_ns);
                self.readmission.shift();
                self.voting.shift(shift_ns);
                self.tight.shift(shift_ns);
                self.snapshot.height_mut().shift(shift_ns);
                None
            }
            Event::EpochReady => {
                self.pending = Pending::Observations;
                self.rhythm.epoch(self.ingest.epoch().time);
                self.tight.expect(self.rhythm.due());
                Some(Ready::Epoch)
            }
            Event::ReceiverFix(fix) => {
                self.pending = Pending::Fix(fix);
                self.rhythm.epoch(fix.time);
                self.tight.expect(self.rhythm.due());
                Some(Ready::Epoch)
            }
            Event::CorrectedEpochReady => {
                self.pending = Pending::Corrected;
                Some(Ready::Epoch)
            }
            Event::EndOfStream => Some(Ready::EndOfStream),
        }
    }

    /// Takes a sample of the inertial unit of this number; [`Ready::Epoch`] when the receiver has missed an
    /// epoch by it: call [`Monitor::process`]. Where no units vote the first's are used, and
    /// the others' are not.
    #[must_use = "an epoch that the receiver missed is to be processed"]
    pub fn on_unit_sample(&mut self, unit: u8, sample: &UnitSample) -> Option<Ready> {
        if !self.voting.is_configured() {
            if unit != 0 || !sample.is_valid {
                return None;
            }
            self.tight.on_sample(&sample.sample);
            return self.expect_epoch(sample.sample.time);
        }
        self.voting.take(unit.into(), sample);
        // No more than the vote holds back; what an epoch interrupts comes with the next sample.
        let mut ready = None;
        while ready.is_none()
            && let Some(voted) = self.voting.next_sample()
        {
            self.tight.on_sample(&voted);
            ready = self.expect_epoch(voted.time);
        }
        if self.voting.mode() == VotingMode::Disagree {
            self.tight.distrust();
        }
        ready
    }

    /// Takes a sample of a barometer; without [`Monitor::configure_aids`] nothing comes of it.
    pub fn on_pressure(&mut self, sample: &PressureSample) {
        self.snapshot.height_mut().on_pressure(sample);
        self.tight.on_pressure(sample);
    }

    /// Takes a sample of a magnetometer.
    pub fn on_magnetic_field(&mut self, sample: &MagneticSample) {
        self.tight.on_field(sample);
    }

    fn note_refusal(&mut self, is_accepted: bool) {
        if !is_accepted {
            self.refused_configurations = self.refused_configurations.saturating_add(1);
        }
    }

    /// Samples go on and the receiver does not: that is an epoch too.
    fn expect_epoch(&mut self, now: GpsTime) -> Option<Ready> {
        if self.tight.status() == InertialStatus::Off {
            return None;
        }
        self.tight.expect(self.rhythm.due());
        let time = self.rhythm.sample(now)?;
        Some(self.miss(time, now))
    }

    /// The epoch due at `time` has not come by `now`. Those after it may still be on their way.
    fn miss(&mut self, time: GpsTime, now: GpsTime) -> Ready {
        let until = now.plus_ns(-self.rhythm.latency_ns());
        self.pending = Pending::Silence { time, until };
        Ready::Epoch
    }

    /// Asks whether an epoch is overdue at `now`, by a clock of whoever runs the monitor: with receiver and
    /// inertial unit both silent no byte comes that could say so. [`Ready::Epoch`] when one is, half an
    /// interval after it should have arrived: [`Monitor::process`] then reports the silence. Core has no clock of
    /// its own; without this call nothing is said until bytes come again.
    pub fn tick(&mut self, now: GpsTime) -> Option<Ready> {
        let time = self.rhythm.missed(now)?;
        self.tight.hear_nothing(now);
        Some(self.miss(time, now))
    }

    /// Assesses the epoch that [`Ready::Epoch`] announced.
    pub fn process(&mut self, counter: &mut impl CycleCounter) -> EpochReport {
        self.process_with(counter, None)
    }

    /// The same with a memory for the filters of the bank.
    #[inline(never)]
    pub fn process_with(
        &mut self,
        counter: &mut impl CycleCounter,
        memory: Option<BankMemory<'_>>,
    ) -> EpochReport {
        self.ledger.begin_epoch();
        self.opinions = None;
        let mut report = match self.pending {
            Pending::Observations => self.process_observations(counter, memory),
            Pending::Corrected => self.process_corrected(counter, memory),
            Pending::Fix(fix) => self.process_fix(&fix, counter),
            Pending::Silence { time, until } => self.process_silence(time, until, counter, memory),
        };
        let first_epoch = *self.first_epoch.get_or_insert(report.time);
        report.since_first_ns = report.time.ns().wrapping_sub(first_epoch.ns());
        if !self.ledger.end_epoch() {
            withdraw(&mut report.verdict);
        }
        // A scenario folder says of each epoch what the filters say, and nothing of those before.
        if self.pending != Pending::Corrected {
            self.alerts.step(&mut report.verdict, report.time);
        }
        if self.pending == Pending::Observations {
            self.name_those_in_view(&mut report.verdict);
        }
        report
    }

    /// A satellite stays excluded while it is out of view; told are those that would be used otherwise.
    fn name_those_in_view(&self, verdict: &mut Verdict) {
        let all = verdict.excluded;
        for satellite in all.iter() {
            if self.snapshot.workspace().is_out_of_view(satellite) {
                verdict.excluded.remove(satellite);
            }
        }
        if verdict.excluded.is_empty() && verdict.integrity == Integrity::Excluded {
            verdict.integrity = Integrity::Nominal;
        }
    }

    fn process_observations(
        &mut self,
        counter: &mut impl CycleCounter,
        memory: Option<BankMemory<'_>>,
    ) -> EpochReport {
        let epoch_begin = counter.now();
        self.tight.end_loose();
        let epoch = self.ingest.epoch();
        let with_bank = memory.is_some();
        let of_bank = if with_bank {
            self.tight.excluded()
        } else {
            SatelliteSet::EMPTY
        };
        let of_snapshot = self.readmission.excluded();
        self.snapshot
            .leave_out(readmission::union(of_snapshot, of_bank));
        let assessment = self.snapshot.assess(
            epoch,
            &self.store,
            &self.ionosphere,
            &mut self.ledger,
            counter,
        );
        self.readmission
            .observe(epoch.time, &assessment, &self.snapshot);
        // With those excluded before the bank ran.
        let named = readmission::union(
            readmission::without(of_snapshot, of_bank),
            assessment.excluded_here,
        );
        let mut report = report_of(epoch, &assessment);
        let begin = counter.now();
        let verdict = assessment.verdict;
        let tested = TestedSolution::new(&assessment);
        let mut meter = Meter::new(counter, epoch_begin);
        self.tight.note_prediction(epoch.time);
        let tight = match memory {
            Some(memory) => self.tight.on_epoch_with_bank(
                epoch.time,
                self.snapshot.workspace_mut(),
                named,
                tested.as_ref(),
                memory,
                &mut meter,
            ),
            None => self.tight.on_epoch(
                epoch.time,
                self.snapshot.workspace_mut(),
                verdict.excluded,
                verdict.integrity != Integrity::Alert,
                tested.as_ref(),
            ),
        };
        let sigma_velocity_enu_mps = self.tight.velocity_sigma_enu_mps(self.snapshot.workspace());
        if with_bank && tight.is_some() && self.tight.has_earned() {
            self.readmission
                .adopt(readmission::union(self.tight.excluded(), named));
        }
        match &tight {
            Some(tight) => {
                let separation_m = assessment
                    .solution
                    .map(|solution| separation_m(&tight.llh, tight.r_e_m, solution.r_e_m));
                let serves = match (separation_m, &tested) {
                    (Some(separation_m), Some(tested)) => {
                        self.tight.compare(separation_m, tested.levels_m, tight)
                    }
                    _ => true,
                };
                let is_told = serves
                    && self.tight.earn(
                        epoch.time,
                        tight,
                        tested.and_then(|tested| tested.solution.velocity_enu_mps),
                        &sigma_velocity_enu_mps,
                    );
                if is_told {
                    let opinion = self.tight.opinion().filter(|_| with_bank);
                    report.verdict = match opinion {
                        Some(bank) => {
                            let (combined, opinions) =
                                opinion::combine(&verdict, bank, separation_m);
                            self.opinions = Some(opinions);
                            combined
                        }
                        None => verdict.moved_by(separation_m.unwrap_or([0.0; 2])),
                    };
                    serve(&mut report, tight);
                }
            }
            None => self
                .tight
                .align(epoch.time, tested.as_ref(), &sigma_velocity_enu_mps),
        }
        report.inertial = self.tight.tell();
        report.suspect = self.snapshot.suspect(&assessment, &report.verdict);
        let work = meter.now().wrapping_sub(begin);
        self.ledger.charge(Stage::Bank, meter.bank);
        self.ledger
            .charge(Stage::Filter, work.wrapping_sub(meter.bank));
        report
    }

    fn process_corrected(
        &mut self,
        counter: &mut impl CycleCounter,
        memory: Option<BankMemory<'_>>,
    ) -> EpochReport {
        let begin = counter.now();
        let epoch = self.ingest.corrected_epoch();
        let mut report = empty_report(epoch.time, Reason::NotMonitored);
        if let Some(model) = self.tight.reference() {
            report.verdict.hal_m = model.hal_m;
            report.verdict.val_m = Some(model.val_m);
        }
        report.n_observed = u8::try_from(epoch.rows.len()).unwrap_or(u8::MAX);
        report.flags.incomplete = self.ingest.corrected_is_incomplete();
        if let Some(tight) = self.tight.on_corrected(epoch, memory) {
            serve(&mut report, &tight);
        }
        report.inertial = self.tight.tell();
        self.ledger
            .charge(Stage::Bank, counter.now().wrapping_sub(begin));
        report
    }

    /// A position that nothing here can test: `unavailable` at every epoch, whatever the receiver says of it.
    fn process_fix(&mut self, fix: &ReceiverFix, counter: &mut impl CycleCounter) -> EpochReport {
        let begin = counter.now();
        let Some(config) = self.snapshot.config() else {
            return empty_report(fix.time, Reason::NotConfigured);
        };
        let requirements = config.phase.requirements();
        let mut report = empty_report(fix.time, Reason::NoRawData);
        report.verdict.hal_m = requirements.hal_m;
        report.verdict.val_m = requirements.val_m;
        report.n_observed = fix.satellites;
        if let Some(solution) = &fix.solution {
            take_over(&mut report, solution);
        }
        self.tight.note_prediction(fix.time);
        match self.tight.on_fix(fix) {
            Some(solution) if self.tight.earn_with_fix(fix, &solution) => {
                self.serve_loose(&mut report, &solution);
            }
            Some(_) => {}
            None => self.tight.align_with_fix(fix),
        }
        report.flags.fix_refused = self.tight.fix_is_refused();
        report.inertial = self.tight.tell();
        self.ledger
            .charge(Stage::Filter, counter.now().wrapping_sub(begin));
        report
    }

    /// The loosely coupled filter's solution takes the place of the receiver's.
    fn serve_loose(&self, report: &mut EpochReport, solution: &TightSolution) {
        serve(report, solution);
        report.mode = Mode::Loose;
        let own_enu_m = solution.navigation.sigma_position_enu_m;
        report.sigma_enu_m = Some(self.tight.loose_sigma_enu_m(own_enu_m));
        untested(&mut report.verdict);
    }

    fn process_silence(
        &mut self,
        time: GpsTime,
        until: GpsTime,
        counter: &mut impl CycleCounter,
        memory: Option<BankMemory<'_>>,
    ) -> EpochReport {
        let begin = counter.now();
        let mut report = empty_report(time, Reason::ReceiverSilent);
        if let Some(config) = self.snapshot.config() {
            let requirements = config.phase.requirements();
            report.verdict.hal_m = requirements.hal_m;
            report.verdict.val_m = requirements.val_m;
        }
        let mut meter = Meter::new(counter, begin);
        let is_loose = self.tight.is_loose();
        let tight = match memory {
            Some(memory) if !is_loose => self
                .tight
                .on_silence_with_bank(time, until, memory, &mut meter),
            _ => self.tight.on_silence(time, until),
        };
        match tight.filter(|_| self.tight.has_earned()) {
            Some(solution) if is_loose => self.serve_loose(&mut report, &solution),
            Some(tight) => serve(&mut report, &tight),
            None => {}
        }
        report.inertial = self.tight.tell();
        let work = meter.now().wrapping_sub(begin);
        self.ledger.charge(Stage::Bank, meter.bank);
        self.ledger
            .charge(Stage::Filter, work.wrapping_sub(meter.bank));
        report
    }

    /// What arrived, what was lost, and why; of the inertial samples since their unit was configured.
    pub fn counters(&self) -> Counters {
        let IntakeCounters {
            used,
            repeated,
            late,
            missing,
            stretched,
            not_finite,
            saturated,
            bad_interval,
            begun,
        } = self.tight.intake().counters();
        Counters {
            imu_used: used,
            imu_repeated: repeated,
            imu_late: late,
            imu_missing: missing,
            imu_stretched: stretched,
            imu_not_finite: not_finite,
            imu_saturated: saturated,
            imu_bad_interval: bad_interval,
            imu_begun: begun,
            ..*self.ingest.counters()
        }
    }

    /// The interval between epochs of the receiver, ns, as far as it is known: an answer to one is of use
    /// until the next.
    pub fn epoch_interval_ns(&self) -> Option<i64> {
        self.rhythm.interval_ns()
    }

    /// Takes back a report that whoever runs the monitor cannot send in time, for a cause that core does
    /// not see: its bytes had to wait. Levels are gone, the miss is counted; an alert stays one.
    pub fn miss_deadline(&mut self, report: &mut EpochReport) {
        if report.verdict.hpl != ProtectionLevel::Unavailable(NoBound::DeadlineMissed) {
            self.ledger.miss();
            self.alerts.miss();
        }
        withdraw(&mut report.verdict);
    }

    /// What the stages of the epochs cost.
    pub const fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// Configuration frames that came after the first epoch or were not legal.
    pub const fn refused_configurations(&self) -> u32 {
        self.refused_configurations
    }

    /// Ephemerides held.
    pub const fn store(&self) -> &EphemerisStore {
        &self.store
    }

    /// What the bank of filters said of the last epoch, if it ran: fills `report`.
    pub fn bank_report(&self, report: &mut BankReport) -> bool {
        let Some((time, verdict)) = self.tight.bank_verdict() else {
            return false;
        };
        report.fill(
            *time,
            verdict,
            self.tight.bank(),
            self.tight.p_unmonitored(),
            self.opinions,
        );
        if let Some(opinion) = self.tight.opinion() {
            report.level_m = opinion.levels_m;
        }
        true
    }

    /// What the user has been told by now.
    pub const fn alert_state(&self) -> AlertState {
        self.alerts.state()
    }

    /// The satellites of the last epoch, of which `report` tells, if the receiver sent observations of it:
    /// fills `satellites`.
    pub fn satellite_report(&self, report: &EpochReport, satellites: &mut SatelliteReport) -> bool {
        let epoch = self.ingest.epoch();
        if self.pending != Pending::Observations || epoch.time != report.time {
            return false;
        }
        satellites.fill(epoch, self.snapshot.workspace(), report);
        true
    }

    /// The inertial side at the last epoch, of which `report` tells; `None` without an inertial unit, and
    /// in a scenario folder.
    pub fn inertial_report(&self, report: &EpochReport) -> Option<InertialReport> {
        let status = self.tight.status();
        if status == InertialStatus::Off || self.pending == Pending::Corrected {
            return None;
        }
        let newest = self.tight.intake().last_time();
        let mut units = [UnitPart::ABSENT; MAX_UNITS];
        let mode = self.voting.mode();
        if mode == VotingMode::Off {
            if let Some(first) = units.first_mut() {
                first.state = match status {
                    InertialStatus::NoSample | InertialStatus::ImuSilent => UnitState::Silent,
                    _ => UnitState::Used,
                };
            }
        } else {
            for (number, unit) in units.iter_mut().enumerate() {
                let (state, fault): (UnitState, UnitFault) = self.voting.unit(number);
                *unit = UnitPart { state, fault };
            }
        }
        Some(InertialReport {
            time: report.time,
            alignment: AlignmentPart {
                mode: self.tight.alignment_mode(),
                sigma_ned_rad: self.tight.sigma_attitude_ned_rad(),
                obstacle: self.tight.obstacle(),
            },
            voting: mode,
            units,
            timing: TimingPart {
                lead_of_samples_ns: newest
                    .map(|newest| newest.ns().saturating_sub(report.time.ns())),
                latency_ns: self.rhythm.latency_ns(),
                horizon: self.tight.horizon(),
                now: self.navigation_now(),
            },
            aids: self.aids_part(),
        })
    }

    fn aids_part(&self) -> AidsPart {
        let [standstill, climb] = self.tight.aids_used();
        AidsPart {
            standstill,
            climb,
            height: self.snapshot.height_use(),
            height_bias_m: self.snapshot.height().bias_m(),
        }
    }

    /// Where the antenna is now, which is the end of the newest inertial sample: the filter's nominal carried
    /// over the samples that wait for their epoch. Nothing has tested it and no level bounds it; it
    /// is for a consumer that must act at once. `None` while the filter does not run.
    pub fn navigation_now(&self) -> Option<NavigationNow> {
        let at = self.tight.navigation_now()?;
        Some(NavigationNow {
            time: at.time,
            r_e_m: at.r_e_m,
            v_e_mps: at.v_e_mps,
            q_e_b: at.q_e_b,
        })
    }

    /// How the two opinions on the last epoch, the snapshot's and the bank's, stand to each other.
    pub const fn opinions(&self) -> Option<Opinions> {
        self.opinions
    }

    /// The vote between several inertial units.
    pub const fn voting(&self) -> &Voting {
        &self.voting
    }

    /// Tight mode.
    pub const fn tight(&self) -> &TightMonitor {
        &self.tight
    }
}

/// Horizontal and vertical way from one position (ECEF, m) to another, m.
fn separation_m(llh: &geodesy::Llh, to: [f64; 3], from: [f64; 3]) -> [f64; 2] {
    let way =
        geodesy::c_enu_e(llh.lat_rad, llh.lon_rad) * (Vector3::from(to) - Vector3::from(from));
    [libm::sqrt(way.x * way.x + way.y * way.y), libm::fabs(way.z)]
}

/// The filter's solution takes the place of the snapshot's.
fn serve(report: &mut EpochReport, tight: &TightSolution) {
    report.mode = Mode::Tight;
    report.fix = Some(Fix {
        r_e_m: tight.r_e_m,
        lat_deg: tight.llh.lat_rad.to_degrees(),
        lon_deg: tight.llh.lon_rad.to_degrees(),
        h_m: tight.llh.height_m,
        velocity_enu_mps: Some(tight.velocity_enu_mps),
        clock_m: tight.clock_m,
    });
    report.used = tight.used;
    report.sigma_enu_m = Some(tight.navigation.sigma_position_enu_m);
    report.navigation = Some(tight.navigation);
}

/// The receiver's own solution, with one sigma by its own accuracy.
fn take_over(report: &mut EpochReport, solution: &FixSolution) {
    let FixSolution {
        llh,
        horizontal_accuracy_m,
        vertical_accuracy_m,
        velocity,
        ..
    } = solution;
    let enu = |velocity: &FixVelocity| {
        let [north, east, down] = velocity.ned_mps;
        [east, north, -down]
    };
    let axis_m = horizontal_accuracy_m * core::f64::consts::FRAC_1_SQRT_2;
    report.mode = Mode::Loose;
    report.fix = Some(Fix {
        r_e_m: geodesy::to_ecef(llh).into(),
        lat_deg: llh.lat_rad.to_degrees(),
        lon_deg: llh.lon_rad.to_degrees(),
        h_m: llh.height_m,
        velocity_enu_mps: velocity.as_ref().map(enu),
        clock_m: [None; System::ALL.len()],
    });
    report.sigma_enu_m = Some([axis_m, axis_m, *vertical_accuracy_m]);
    untested(&mut report.verdict);
}

/// There is a position, and nothing to bound it by.
const fn untested(verdict: &mut Verdict) {
    verdict.hpl = ProtectionLevel::Unavailable(NoBound::NoRawData);
    verdict.vpl = ProtectionLevel::Unavailable(NoBound::NoRawData);
}

/// An epoch without observations.
fn empty_report(time: GpsTime, reason: Reason) -> EpochReport {
    EpochReport {
        time,
        since_first_ns: 0,
        mode: Mode::None,
        fix: None,
        verdict: Verdict::unavailable(reason, 0.0, None),
        used: SatelliteSet::EMPTY,
        n_observed: 0,
        unused: [0; SATELLITE_REASONS],
        flags: ReportFlags::default(),
        residual_rms_m: None,
        sigma_enu_m: None,
        suspect: None,
        navigation: None,
        inertial: InertialStatus::Off,
    }
}

/// Takes back what came too late: levels that are not in time bound nothing. A fault that was found
/// stays an alert, with its own reason.
fn withdraw(verdict: &mut Verdict) {
    verdict.hpl = ProtectionLevel::Unavailable(NoBound::DeadlineMissed);
    verdict.vpl = ProtectionLevel::Unavailable(NoBound::DeadlineMissed);
    if verdict.integrity != Integrity::Alert {
        verdict.integrity = Integrity::Unavailable;
        verdict.reason = Reason::DeadlineMissed;
    }
}

fn report_of(epoch: &ObservationEpoch, assessment: &Assessment) -> EpochReport {
    let fix = assessment.solution.map(|solution| Fix {
        r_e_m: solution.r_e_m,
        lat_deg: solution.llh.lat_rad.to_degrees(),
        lon_deg: solution.llh.lon_rad.to_degrees(),
        h_m: solution.llh.height_m,
        velocity_enu_mps: solution.velocity_enu_mps,
        clock_m: solution.clock_m,
    });
    EpochReport {
        time: epoch.time,
        since_first_ns: 0,
        mode: if fix.is_some() {
            Mode::Snapshot
        } else {
            Mode::None
        },
        fix,
        verdict: assessment.verdict,
        used: assessment
            .solution
            .map_or(SatelliteSet::EMPTY, |solution| solution.used),
        n_observed: assessment.n_observed,
        unused: assessment.unused,
        flags: ReportFlags {
            incomplete: epoch.flags.incomplete,
            overflow: epoch.flags.overflow,
            week_unknown: epoch.flags.week_unknown,
            no_broadcast_ionosphere: assessment
                .solution
                .is_some_and(|solution| solution.no_broadcast_ionosphere),
            clock_reset: epoch.flags.clock_reset,
            fix_refused: false,
            range_rates_disagree: assessment.range_rates_disagree,
        },
        residual_rms_m: assessment.residual_rms_m,
        sigma_enu_m: assessment.sigma_enu_m,
        suspect: None,
        navigation: None,
        inertial: InertialStatus::Off,
    }
}
