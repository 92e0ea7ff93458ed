//! An epoch of a recording or of a flight through the bank of filters: the product's model.
//!
//! ```text
//! rows of the snapshot's satellites ─► places ─► predict, update all ─► correlated part ─► tests
//!   ─► one satellite, two, a constellation excluded │ alert ─► levels ─► opinion
//! ```
//!
//! A scenario folder is run by `scenario.rs` instead: white noise, no rule of places, no re-admission.
//! Choices: docs/decisions/006-filter-bank.md, 008-correlated-noise.md, 009-risk.md.

use heapless::Vec;
use nalgebra::{Matrix3, Vector3};

use super::clocks::offset_of;
use super::{
    BankMemory, CLOCKS, JOINT, MAX_LEAD_NS, MonitorFastFilters, TestedSolution, TightMonitor,
    TightSolution,
};
use crate::budget::{CycleCounter, FilterCost, Meter};
use crate::consts::MAX_SATELLITES;
use crate::ekf::navigator::AntennaState;
use crate::ekf::{Filter, MeasurementRow, UpdateSummary};
use crate::frames::geodesy;
use crate::gnss::solution::SnapshotWorkspace;
use crate::gnss::{Satellite, SatelliteSet, System};
use crate::integrity::{BankOpinion, InertialStatus, PhaseRequirements};
use crate::mhss::bank::{self, BankEpoch, BankRow, BankVerdict, Criterion};
use crate::mhss::probation::predicted_variance;
use crate::mhss::protection::{self, BankAllocation, FaultPriors};
use crate::mhss::{
    CorrelatedBound, CorrelatedRow, Explanation, LevelForm, PostfitLimits, Probation, selection,
};
use crate::stats::{StatsError, normal};
use crate::time::{GpsTime, NS_PER_S};

/// How long the filters of a satellite that vanished are kept at least, ns.
const HOLD_NS: i64 = 120 * NS_PER_S;
/// They are kept on as long as their threshold is above this, m: what the satellite may have left in the
/// main filter unseen.
const HOLD_WORTH_M: f64 = 0.5;
/// Filters that begin as copies are blind for what their originals hold; by then they have forgotten, ns of
/// epochs with a position by the satellites alone. After a fault of two satellites or a constellation these are all
/// filters, after an exclusion or an eviction those of the pairs.
const BLIND_NS: i64 = 120 * NS_PER_S;
/// An alert that nothing explains for this long ends tight mode, ns: a filter with a fault in it does not
/// get rid of it by itself.
const MAX_ALERT_NS: i64 = 60 * NS_PER_S;
/// Farther than this from where the main filter expects it, in sigmas, a pseudorange is grossly wrong.
const GROSS_SIGMAS: f64 = 10.0;
/// Probability that satellites without a fault do not fit after an exclusion of two or of a constellation.
const P_POSTFIT: f64 = 1.0e-3;
/// Variance of the correlated part of a pseudorange error over the variance that the filters take for white:
/// both are the whole of the independent error (docs/decisions/008-correlated-noise.md).
const CORRELATED_RATIO: f64 = 1.0;

/// What the bank needs on recordings, besides its filters.
#[derive(Debug)]
pub(super) struct RecordingBank {
    correlated: CorrelatedBound,
    form: LevelForm,
    priors: FaultPriors,
    postfit: PostfitLimits,
    probation: Probation,
    last_epoch: Option<GpsTime>,
    /// How long the filters of the pairs, which began as copies, still hold what their originals did, ns.
    young_ns: i64,
    /// The same of all filters, ns.
    blind_ns: i64,
    /// How long there has been an alert, ns.
    pub(super) alert_ns: i64,
    /// What an error common to the satellites of the epoch does to each, m.
    common_m: Vec<(Satellite, f64), MAX_SATELLITES>,
    /// Satellites of this epoch were kept from all filters as grossly wrong.
    withheld: bool,
    /// Satellites that the snapshot found faulty at this epoch.
    named: SatelliteSet,
    opinion: Option<BankOpinion>,
    cost: FilterCost,
}

impl RecordingBank {
    /// Not configured.
    pub(super) const EMPTY: Self = Self {
        correlated: CorrelatedBound::NONE,
        form: LevelForm::Fixed {
            k_fault_free: f64::INFINITY,
        },
        priors: FaultPriors::PRESET,
        postfit: PostfitLimits::EMPTY,
        probation: Probation::EMPTY,
        last_epoch: None,
        young_ns: 0,
        blind_ns: 0,
        alert_ns: 0,
        common_m: Vec::new(),
        withheld: false,
        named: SatelliteSet::EMPTY,
        opinion: None,
        cost: FilterCost::UNKNOWN,
    };

    /// The filters begin anew.
    pub(super) fn start(&mut self) {
        self.young_ns = 0;
        self.blind_ns = 0;
        self.last_epoch = None;
        self.correlated.start(CORRELATED_RATIO, [0.0; 2]);
        self.probation.clear();
        self.alert_ns = 0;
        self.opinion = None;
    }

    /// Time passes; filters forget only while the satellites give a position by themselves.
    fn pass(&mut self, now: GpsTime) {
        let last = self.last_epoch.replace(now);
        let elapsed_ns = last.map_or(0, |last| now.ns().saturating_sub(last.ns()));
        if self.correlated.is_solved() && elapsed_ns > 0 {
            let less = |left_ns: i64| (left_ns - elapsed_ns).max(0);
            self.young_ns = less(self.young_ns);
            self.blind_ns = less(self.blind_ns);
        }
        if self.opinion.is_some_and(|opinion| opinion.is_alerted) {
            self.alert_ns = self.alert_ns.saturating_add(elapsed_ns);
        } else {
            self.alert_ns = 0;
        }
    }

    /// Leaves one satellite out. While the filters of the pairs are young, or have been dropped, all filters begin
    /// as copies of the one without it.
    fn exclude_one(
        &mut self,
        bank: &mut bank::Bank<CLOCKS, JOINT>,
        satellite: Satellite,
        main: &mut Filter<CLOCKS, JOINT>,
        sub: &mut bank::SubFilters<CLOCKS, JOINT>,
        secondaries: &mut bank::Secondaries<CLOCKS, JOINT>,
    ) {
        let Some(left) = bank.place(satellite) else {
            return;
        };
        if self.young_ns > 0 || bank.pairs_are_dropped() {
            bank.exclude_alone(satellite, main, sub, secondaries);
            self.correlated.exclude_alone(left);
            self.blind_ns = BLIND_NS;
        } else {
            bank.exclude(satellite, main, sub, secondaries);
            self.correlated.exclude(left);
        }
        self.young_ns = BLIND_NS;
    }

    /// Leaves two satellites out: all filters begin as copies of the one without both. Where there is no such filter
    /// to be had, one after the other.
    fn exclude_two(
        &mut self,
        bank: &mut bank::Bank<CLOCKS, JOINT>,
        satellites: [Satellite; 2],
        main: &mut Filter<CLOCKS, JOINT>,
        sub: &mut bank::SubFilters<CLOCKS, JOINT>,
        secondaries: &mut bank::Secondaries<CLOCKS, JOINT>,
    ) {
        let [one, other] = satellites.map(|satellite| bank.place(satellite));
        let (Some(one), Some(other)) = (one, other) else {
            return;
        };
        // Where the filters of the pairs are young the one without both has had the other until it began as a copy, and
        // not since: no filter knows less of it.
        if bank.pairs_are_dropped() {
            for satellite in satellites {
                self.exclude_one(bank, satellite, main, sub, secondaries);
            }
            return;
        }
        bank.exclude_two(satellites, main, sub, secondaries);
        self.correlated.exclude_two(one, other);
        self.blind_ns = BLIND_NS;
        self.young_ns = BLIND_NS;
    }

    /// All times so far were wrong by this much, ns.
    pub(super) fn shift(&mut self, by_ns: i64) {
        self.last_epoch = self.last_epoch.map(|last| last.plus_ns(by_ns));
        self.probation.clear();
    }
}

/// What an error common to the satellites does to one of them, m.
fn of_satellite(common_m: &[(Satellite, f64)], satellite: Satellite) -> f64 {
    let found = common_m.iter().find(|(of, _)| *of == satellite);
    found.map_or(0.0, |(_, common_m)| *common_m)
}

/// What an epoch of the bank is made of, besides the filters.
struct EpochPlace {
    time: GpsTime,
    c_enu_e: Matrix3<f64>,
}

impl TightMonitor {
    /// Takes the risks of a phase of flight apart.
    pub(super) fn allocate(&mut self, requirements: &PhaseRequirements) -> Result<(), StatsError> {
        let PhaseRequirements {
            val_m,
            p_md,
            p_fault_free,
            exposure_s,
            p_integrity,
            p_false_alert,
            ..
        } = *requirements;
        let allocation =
            BankAllocation::new(exposure_s, p_integrity, p_false_alert, val_m.is_some());
        self.quantiles
            .fill(allocation.p_false_alert, p_md, p_fault_free)?;
        self.recording.postfit.fill(P_POSTFIT)?;
        self.recording.form = LevelForm::Budget(allocation.budget);
        self.k_fault_free = normal::upper_quantile(0.5 * p_fault_free)?;
        Ok(())
    }

    /// Satellites that the bank has excluded: no opinion uses them, once its filters are believed.
    pub(crate) fn excluded(&self) -> SatelliteSet {
        if self.has_earned() {
            self.bank.excluded()
        } else {
            SatelliteSet::EMPTY
        }
    }

    /// Probability of the faults that no filter of the bank stands for.
    pub fn p_unmonitored(&self) -> f64 {
        self.bank.p_unmonitored(&self.recording.priors)
    }

    /// What the bank said of the last epoch of a recording, if it ran.
    pub fn opinion(&self) -> Option<&BankOpinion> {
        self.recording.opinion.as_ref()
    }

    /// An epoch of the receiver, with the bank. `named` are satellites that the snapshot excluded at this
    /// epoch: they are excluded from all filters.
    ///
    /// `None` where the snapshot solution serves alone; [`TightMonitor::status`] says why.
    #[inline(never)]
    pub(crate) fn on_epoch_with_bank(
        &mut self,
        time: GpsTime,
        workspace: &mut SnapshotWorkspace,
        named: SatelliteSet,
        tested: Option<&TestedSolution<'_>>,
        memory: BankMemory<'_>,
        meter: &mut Meter<'_, impl CycleCounter>,
    ) -> Option<TightSolution> {
        self.recording.opinion = None;
        self.bank_verdict = None;
        self.meets(time)?;
        let mut at = self.navigator.predict(time);
        let BankMemory { fast, secondaries } = memory;
        self.predict_bank(BankMemory { fast, secondaries }, meter);
        // A place that is no place for a receiver shows in the rows: there are none.
        if workspace
            .corrected(
                at.r_e_m,
                at.v_e_mps,
                SatelliteSet::EMPTY,
                &mut self.corrected,
            )
            .is_err()
        {
            self.corrected.rows.clear();
        }
        self.take_sigmas(workspace);
        let change = self.prepare_clocks(&mut at, tested);
        if !change.is_none() {
            self.bank
                .for_each_filter(&mut fast.sub, secondaries, |filter| change.apply(filter));
        }
        self.note_speed(tested);
        self.make_rows(&at);
        self.recording.named = named;
        self.recording.withheld = self.withhold_unexplainable();
        let is_tested = tested.is_some();
        self.finish_with_bank(&at, BankMemory { fast, secondaries }, is_tested, meter)
    }

    /// Satellites that the snapshot has named faulty are taken out of all filters, with what they did before.
    fn exclude_named(
        &mut self,
        main: &mut Filter<CLOCKS, JOINT>,
        sub: &mut bank::SubFilters<CLOCKS, JOINT>,
        secondaries: &mut bank::Secondaries<CLOCKS, JOINT>,
    ) {
        let Self {
            bank, recording, ..
        } = self;
        let mut members = recording.named.iter().filter(|named| bank.has(*named));
        let (first, second) = (members.next(), members.next());
        let mut others = SatelliteSet::EMPTY;
        for named in members {
            others.insert(named);
        }
        for named in recording.named.iter() {
            bank.note_excluded(named);
        }
        match (first, second) {
            (Some(one), Some(other)) => {
                recording.exclude_two(bank, [one, other], main, sub, secondaries);
            }
            (Some(one), None) => recording.exclude_one(bank, one, main, sub, secondaries),
            (None, _) => {}
        }
        for satellite in others.iter() {
            recording.exclude_one(bank, satellite, main, sub, secondaries);
        }
    }

    /// All filters of the bank come to the epoch; those of the pairs only when there is time for them.
    fn predict_bank(&mut self, memory: BankMemory<'_>, meter: &mut Meter<'_, impl CycleCounter>) {
        let BankMemory { fast, secondaries } = memory;
        let Self {
            bank,
            navigator,
            recording,
            ..
        } = self;
        let transition = navigator.transition();
        let affords = recording.cost.affords(meter.spent(), bank.pairs());
        let begin = meter.now();
        if !affords {
            bank.drop_pairs();
            bank.predict_sub(transition, &mut fast.sub);
        } else if bank.pairs_are_dropped() {
            bank.predict_sub(transition, &mut fast.sub);
            bank.begin_pairs(&fast.sub, secondaries);
            recording.young_ns = BLIND_NS;
        } else {
            bank.predict(transition, &mut fast.sub, secondaries);
        }
        meter.bank_since(begin);
    }

    /// Three satellites of different constellations far from where the main filter expects them are no fault
    /// that a hypothesis of the bank stands for: they enter no filter. True where that is so.
    fn withhold_unexplainable(&mut self) -> bool {
        let Self {
            navigator,
            recording,
            rows,
            bank,
            ..
        } = self;
        let is_out = |satellite: Satellite| {
            bank.excluded().contains(satellite) || recording.named.contains(satellite)
        };
        let is_gross = |of: &BankRow<JOINT>| {
            if is_out(of.satellite) {
                return false;
            }
            let common_m = of_satellite(&recording.common_m, of.satellite);
            let variance_m2 = predicted_variance(&of.row, navigator.filter())
                + (1.0 + CORRELATED_RATIO) / of.row.weight
                + common_m * common_m;
            let square_m2 = of.row.innovation_m * of.row.innovation_m;
            !(square_m2 <= GROSS_SIGMAS * GROSS_SIGMAS * variance_m2)
        };
        let mut gross = [0_usize; System::ALL.len()];
        let mut seen = [0_usize; System::ALL.len()];
        for row in rows.iter() {
            let system = row.satellite.system().index();
            if let (Some(gross), Some(seen)) = (gross.get_mut(system), seen.get_mut(system)) {
                *seen += 1;
                *gross += usize::from(is_gross(row));
            }
        }
        let count: usize = gross.iter().sum();
        let systems = |counts: &[usize]| counts.iter().filter(|count| **count > 0).count();
        // All from one of several constellations: that has a filter.
        if count < 3 || systems(&gross) == 1 && systems(&seen) > 1 {
            return false;
        }
        rows.retain(|row| !is_gross(row));
        true
    }

    /// An epoch was due at `due` and the receiver gave none: all filters go on without it.
    #[inline(never)]
    pub(crate) fn on_silence_with_bank(
        &mut self,
        due: GpsTime,
        until: GpsTime,
        memory: BankMemory<'_>,
        meter: &mut Meter<'_, impl CycleCounter>,
    ) -> Option<TightSolution> {
        self.recording.opinion = None;
        self.bank_verdict = None;
        self.release(until);
        let at = self.remembered.take().filter(|at| at.time == due)?;
        if !self.is_running() {
            return None;
        }
        self.navigator.predict(self.navigator.time());
        let BankMemory { fast, secondaries } = memory;
        self.predict_bank(BankMemory { fast, secondaries }, meter);
        self.rows.clear();
        self.recording.withheld = false;
        self.recording.named = SatelliteSet::EMPTY;
        self.finish_with_bank(&at, BankMemory { fast, secondaries }, false, meter)
    }

    /// The filters take the independent part of each error; the common one goes into the bound.
    fn take_sigmas(&mut self, workspace: &SnapshotWorkspace) {
        let factors = self.config.as_ref().map(|config| config.measurement);
        let factor = factors.map_or(1.0, |factors| factors.pseudorange);
        let range_rate_factor = factors.map_or(1.0, |factors| factors.range_rate);
        let common_m = &mut self.recording.common_m;
        common_m.clear();
        for row in &mut self.corrected.rows {
            if let Some(sigma) = workspace.sigma(row.satellite) {
                row.sigma_pseudorange_m = sigma.independent_m;
                // As many as rows.
                let _ = common_m.push((row.satellite, factor * sigma.common_m));
            }
        }
        self.corrected.scale_sigmas(factor, range_rate_factor);
    }

    fn make_rows(&mut self, at: &AntennaState<CLOCKS>) {
        self.rows.clear();
        for measurement in &self.corrected.rows {
            let offset = offset_of(&self.systems, measurement.satellite.system());
            let row = MeasurementRow::new(measurement, at.r_e_m, at.v_e_mps, &at.clock, offset);
            if let Some(row) = row {
                // As many rows as satellites in an epoch, so it fits.
                let _ = self.rows.push(BankRow {
                    satellite: measurement.satellite,
                    row,
                });
            }
        }
    }

    /// Rows through all filters, tests, exclusion, levels, feedback; then the solution.
    fn finish_with_bank(
        &mut self,
        at: &AntennaState<CLOCKS>,
        memory: BankMemory<'_>,
        is_tested: bool,
        meter: &mut Meter<'_, impl CycleCounter>,
    ) -> Option<TightSolution> {
        let solution = self.run_recording(at, memory, meter).and_then(|summary| {
            let mut used = SatelliteSet::EMPTY;
            let mut present = [false; System::ALL.len()];
            for (_, satellite, _) in self.bank.present() {
                used.insert(satellite);
                if let Some(present) = present.get_mut(satellite.system().index()) {
                    *present = true;
                }
            }
            let passed_ns = self.navigator.time().ns().wrapping_sub(at.time.ns());
            let told = if passed_ns > MAX_LEAD_NS {
                *at
            } else {
                self.navigator.antenna(at.time)
            };
            self.solution(&told, &summary, used, present)
        });
        if solution.is_none() {
            self.recording.opinion = None;
            self.lose(InertialStatus::Unhealthy);
            return None;
        }
        self.recording.pass(at.time);
        self.end_long_alert(is_tested);
        solution
    }

    /// An alert that nothing explains, while the snapshot passes its tests, ends tight mode after a while.
    pub(super) fn end_long_alert(&mut self, is_tested: bool) {
        if is_tested && self.recording.alert_ns >= MAX_ALERT_NS {
            // Its attitude is not what is wrong with it, if it was ever earned.
            let attitude = (self.navigator.mechanisation().q_e_b, self.navigator.time());
            let is_earned = self.earned.is_earned();
            self.lose(InertialStatus::Unhealthy);
            if is_earned {
                self.last_attitude = Some(attitude);
            }
        }
    }

    fn run_recording(
        &mut self,
        at: &AntennaState<CLOCKS>,
        memory: BankMemory<'_>,
        meter: &mut Meter<'_, impl CycleCounter>,
    ) -> Option<UpdateSummary> {
        let llh = geodesy::to_llh(&Vector3::from(at.r_e_m)).ok()?;
        let place = EpochPlace {
            time: at.time,
            c_enu_e: geodesy::c_enu_e(llh.lat_rad, llh.lon_rad),
        };
        let BankMemory { fast, secondaries } = memory;
        let MonitorFastFilters { main, sub } = fast;
        self.navigator.lend(main);
        self.exclude_named(main, sub, secondaries);
        self.ask_aids();
        self.bank.aid(self.aids.information());
        self.give_places(&place, main, sub, secondaries);
        let Self {
            bank,
            navigator,
            recording,
            ..
        } = self;
        let summary = navigator.update_lent(main);
        let begin = meter.now();
        bank.update_constellations(sub);
        bank.update_unaided(sub);
        if bank.pairs_are_dropped() {
            bank.update_sub(sub);
        } else {
            bank.update(sub, secondaries);
        }
        meter.bank_since(begin);
        recording.cost.measured(bank.filters(), meter.bank);
        solve_correlated(bank, recording, &place.c_enu_e);
        self.judge(&place, main, sub, secondaries);
        self.observe_excluded(place.time, main);
        self.navigator.take_back(main);
        let correction = self.navigator.finish().ok()?;
        self.rereference_aids(&correction);
        self.bank.rereference(&correction, sub, secondaries);
        Some(summary)
    }

    /// Selection, eviction, births, deaths.
    fn give_places(
        &mut self,
        place: &EpochPlace,
        main: &mut Filter<CLOCKS, JOINT>,
        sub: &mut bank::SubFilters<CLOCKS, JOINT>,
        secondaries: &mut bank::Secondaries<CLOCKS, JOINT>,
    ) {
        let Self {
            bank,
            navigator,
            recording,
            rows,
            ..
        } = self;
        // A filter of a pair that began as a copy holds what its original did: it can be no sub-filter yet.
        let may_leave = recording.young_ns == 0;
        if let Some(leaving) = selection::select(bank, rows, place.time, may_leave)
            && let Some(left) = bank.evict(leaving, main, sub, secondaries)
        {
            recording.correlated.exclude(left);
            recording.young_ns = BLIND_NS;
        }
        bank.hold_on(place.time, HOLD_NS, HOLD_WORTH_M);
        bank.admit(
            &BankEpoch {
                time: place.time,
                rows,
                hold_ns: HOLD_NS,
            },
            main,
            sub,
            secondaries,
            navigator.information_mut(),
        );
        for begun in bank.begun() {
            recording.correlated.begin(begun);
        }
        let begun = bank.monitor_constellations(main, sub);
        for (constellation, begins) in begun.into_iter().enumerate() {
            if begins {
                recording.correlated.begin_constellation(constellation);
            }
        }
        if bank.monitor_aids(main, sub) {
            recording.correlated.begin_unaided();
        }
        bank.note_predictions(main, sub, &place.c_enu_e);
    }

    /// Tests, explanation, exclusion, levels.
    fn judge(
        &mut self,
        place: &EpochPlace,
        main: &mut Filter<CLOCKS, JOINT>,
        sub: &mut bank::SubFilters<CLOCKS, JOINT>,
        secondaries: &mut bank::Secondaries<CLOCKS, JOINT>,
    ) {
        let Self {
            bank,
            recording,
            quantiles,
            bank_verdict,
            aids,
            ..
        } = self;
        let criterion = Criterion {
            quantiles,
            vertical: true,
            c_enu_e: &place.c_enu_e,
        };
        let mut verdict = bank.assess(
            &criterion,
            &mut recording.correlated,
            main,
            sub,
            secondaries,
        );
        let is_young = recording.young_ns > 0;
        let aids_were_wrong =
            verdict.detected && bank.aids_explain(&recording.postfit, true, main, sub);
        if aids_were_wrong && bank.exclude_aids(main, sub, secondaries) {
            aids.exclude(place.time);
            recording.correlated.exclude_aids();
            recording.blind_ns = BLIND_NS;
            recording.young_ns = BLIND_NS;
            verdict.isolated = None;
        }
        let explanation = verdict.isolated.map(Explanation::One).or_else(|| {
            let explains = verdict.detected && !aids_were_wrong;
            let explanation =
                explains.then(|| bank.explain(&recording.postfit, true, sub, secondaries))??;
            // A young filter without a constellation still holds what that did.
            let is_known = !(is_young && matches!(explanation, Explanation::Constellation(_)));
            is_known.then_some(explanation)
        });
        let mut still_fails = verdict.detected;
        match explanation {
            None => {}
            Some(Explanation::One(satellite)) => {
                recording.exclude_one(bank, satellite, main, sub, secondaries);
            }
            Some(Explanation::Two(satellites)) => {
                recording.exclude_two(bank, satellites, main, sub, secondaries);
            }
            Some(Explanation::Constellation(system)) => {
                bank.exclude_constellation(system, main, sub, secondaries);
                recording.correlated.exclude_constellation(system.index());
                recording.blind_ns = BLIND_NS;
                recording.young_ns = BLIND_NS;
            }
        }
        if explanation.is_some() || aids_were_wrong {
            // What is left is tested as it is now; its levels are those after the exclusion.
            solve_correlated(bank, recording, &place.c_enu_e);
            let after = bank.assess(
                &criterion,
                &mut recording.correlated,
                main,
                sub,
                secondaries,
            );
            still_fails = after.detected;
            verdict = BankVerdict {
                detected: true,
                isolated: verdict.isolated,
                ..after
            };
        }
        let is_blind = recording.blind_ns > 0;
        let is_alerted = still_fails || recording.withheld;
        let levels_m = if is_alerted || is_blind {
            [None; 2]
        } else {
            protection::levels(
                &recording.form,
                verdict.sigma_m,
                || bank.hypotheses(&recording.priors),
                bank.p_unmonitored(&recording.priors),
            )
        };
        recording.opinion = Some(BankOpinion {
            is_alerted,
            excluded: bank.excluded(),
            levels_m,
        });
        *bank_verdict = Some((place.time, verdict));
    }

    /// Who was excluded may prove itself.
    fn observe_excluded(&mut self, now: GpsTime, main: &Filter<CLOCKS, JOINT>) {
        let Self {
            bank,
            recording,
            rows,
            ..
        } = self;
        let is_believed =
            recording.blind_ns == 0 && recording.opinion.is_some_and(|opinion| !opinion.is_alerted);
        let mut proved = SatelliteSet::EMPTY;
        for BankRow { satellite, row } in rows.iter() {
            if !bank.excluded().contains(*satellite) {
                continue;
            }
            let common_m = of_satellite(&recording.common_m, *satellite);
            let own_m2 = (1.0 + CORRELATED_RATIO) / row.weight + common_m * common_m;
            let predicted_m2 = predicted_variance(row, main);
            // Nothing is proved against a filter that does not know, or that is not to be believed.
            let is_proof = predicted_m2 <= own_m2 && is_believed;
            let variance_m2 = if is_proof {
                predicted_m2 + own_m2
            } else {
                f64::NAN
            };
            let residual_m = bank::residual(row, main);
            if recording
                .probation
                .observe(now, *satellite, residual_m, variance_m2)
            {
                proved.insert(*satellite);
            }
        }
        for satellite in proved.iter() {
            bank.readmit(satellite);
        }
    }
}

/// The least squares of the satellites that have a place.
fn solve_correlated(
    bank: &bank::Bank<CLOCKS, JOINT>,
    recording: &mut RecordingBank,
    c_enu_e: &Matrix3<f64>,
) {
    let RecordingBank {
        correlated,
        common_m,
        ..
    } = recording;
    correlated.solve(
        bank.present().map(|(place, satellite, row)| CorrelatedRow {
            place,
            constellation: satellite.system().index(),
            row,
            common_m: of_satellite(common_m, satellite),
        }),
        c_enu_e,
    );
}
