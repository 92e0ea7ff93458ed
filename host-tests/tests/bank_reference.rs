//! The bank is a textbook's: every filter dense, on its own, updated with one measurement after the other of
//! the satellites it keeps, over random epochs in which satellites come, go, are held and are excluded.
//!
//! Differences are measured in a filter's own sigmas: |δP_ij| / √(P_ii P_jj) and |δx_i| / √P_ii. They are
//! counted as those of redundant epochs while every filter has always had more satellites than it needs:
//! what an epoch with fewer leaves in a filter stays there for a while.

mod flying;
mod skies;

use flying::{Flight, K, M, dense, dense_filter, scalars, vector};
use surefix_core::ekf::filter::PredictWorkspace;
use surefix_core::ekf::{EpochInformation, Filter, MeasurementRow, UpdateWorkspace};
use surefix_core::gnss::Satellite;
use surefix_core::mhss::{
    Bank, BankEpoch, BankRow, BankVerdict, Criterion, MAX_BANK, Secondaries, SeparationQuantiles,
    SubFilters,
};
use surefix_core::time::GpsTime;
use surefix_host_tests::reference;
use surefix_host_tests::reference::DenseFilter;
use surefix_host_tests::reference::bank::{Risks, Verdict};

const RISKS: Risks = Risks {
    p_fa: 3.33e-7,
    p_md: 1e-3,
    p_h0: 1e-7,
    vertical: true,
};

/// The bank of the core and that of the textbook, side by side.
struct Both {
    flight: Flight,
    t: i64,
    hold_s: i64,
    main: Filter<K, M>,
    bank: Box<Bank<K, M>>,
    sub: Box<SubFilters<K, M>>,
    secondaries: Box<Secondaries<K, M>>,
    information: EpochInformation<M>,
    quantiles: SeparationQuantiles,
    predict_workspace: PredictWorkspace,
    update_workspace: UpdateWorkspace<K, M>,
    expected: reference::Bank,
    /// No filter ever lacked satellites.
    always_redundant: bool,
}

/// Largest differences, and how often what was decided.
#[derive(Clone, Copy, Debug, Default)]
struct Largest {
    redundant: Difference,
    deficient: Difference,
    /// Of statistics, uncertainties and fault-free levels, m.
    tests_m: f64,
    /// Of squared thresholds, m²: the root of a small difference of covariances keeps half its digits.
    thresholds_m2: f64,
    /// Of levels, m.
    levels_m: f64,
    epochs: usize,
    filters: [usize; 2],
    members: usize,
    detections: usize,
    exclusions: usize,
    /// Satellites held, summed over epochs.
    held: usize,
}

/// Of filters: covariance and state in its sigmas.
#[derive(Clone, Copy, Debug, Default)]
struct Difference {
    covariance: f64,
    state: f64,
}

impl Difference {
    fn of(ours: &DenseFilter, theirs: &DenseFilter) -> Self {
        let sigma = theirs.p.diagonal().map(f64::sqrt);
        let (x, p) = (ours.x - theirs.x, ours.p - theirs.p);
        assert!(x.iter().chain(&p).all(|entry| entry.is_finite()));
        Self {
            covariance: p.component_div(&(sigma * sigma.transpose())).amax(),
            state: x.component_div(&sigma).amax(),
        }
    }

    fn take(&mut self, other: Self) {
        self.covariance = self.covariance.max(other.covariance);
        self.state = self.state.max(other.state);
    }
}

impl Both {
    fn new(seed: u64, satellites: usize, hold_s: i64) -> Self {
        let flight = Flight::new(seed, satellites);
        let main = flight.filter();
        let mut quantiles = SeparationQuantiles::EMPTY;
        quantiles.fill(RISKS.p_fa, RISKS.p_md, RISKS.p_h0).unwrap();
        Self {
            t: 0,
            hold_s,
            expected: reference::Bank::new(dense_filter(&main)),
            always_redundant: true,
            main,
            bank: Box::new(Bank::EMPTY),
            sub: Box::new(SubFilters::EMPTY),
            secondaries: Box::new(Secondaries::EMPTY),
            information: EpochInformation::ZERO,
            quantiles,
            predict_workspace: PredictWorkspace::EMPTY,
            update_workspace: UpdateWorkspace::EMPTY,
            flight,
        }
    }

    fn epoch(&mut self, largest: &mut Largest) {
        self.t += 1;
        let transition = self.flight.fly();
        let (phi, q) = dense(&transition);
        let rows = self.flight.measure();
        let kept: Vec<Satellite> = rows.iter().map(|(satellite, _)| *satellite).collect();

        self.expected.predict(&phi, &q);
        self.expected
            .admit(self.t as f64, &kept, self.hold_s as f64);
        let observed: Vec<_> = rows.iter().map(|(s, row)| (*s, scalars(row))).collect();
        self.expected.update(&observed);
        let c_enu_e = self.flight.c_enu_e();
        let expected = self.expected.test(&RISKS, &c_enu_e);

        let rows: Vec<BankRow<M>> = rows
            .into_iter()
            .map(|(satellite, row)| BankRow { satellite, row })
            .collect();
        let (sub, secondaries) = (&mut *self.sub, &mut *self.secondaries);
        self.main.predict(&transition, &mut self.predict_workspace);
        self.bank.predict(&transition, sub, secondaries);
        let epoch = BankEpoch {
            time: GpsTime::from_ns(self.t * 1_000_000_000),
            rows: &rows,
            hold_ns: self.hold_s * 1_000_000_000,
        };
        self.bank
            .admit(&epoch, &self.main, sub, secondaries, &mut self.information);
        self.main
            .update(&self.information, &mut self.update_workspace);
        self.bank.update(sub, secondaries);
        let criterion = Criterion {
            quantiles: &self.quantiles,
            vertical: RISKS.vertical,
            c_enu_e: &c_enu_e,
        };
        let verdict = self.bank.test(&criterion, &self.main, sub, secondaries);

        let taken: Vec<(Satellite, usize)> =
            observed.iter().map(|(s, rows)| (*s, rows.len())).collect();
        self.compare_filters(&taken, largest);
        self.compare_tests(&verdict, &expected, largest);
        let held = |s: &&Satellite| !kept.contains(s);
        largest.held += self.expected.members().iter().filter(held).count();
        let (sub, secondaries) = (&mut *self.sub, &mut *self.secondaries);
        if let Some(satellite) = verdict.isolated {
            assert!(
                self.bank
                    .exclude(satellite, &mut self.main, sub, secondaries)
            );
            self.expected.exclude(satellite);
            largest.exclusions += 1;
            self.compare_filters(&taken, largest);
        }
        let (sub, secondaries) = (&mut *self.sub, &mut *self.secondaries);
        let correction = *self.main.state();
        self.main.rereference(&correction);
        self.bank.rereference(&correction, sub, secondaries);
        self.expected.rereference(&vector(&correction));
        self.flight.correct(&vector(&correction));
    }

    /// `present` are the satellites of this epoch with their numbers of measurements.
    fn compare_filters(&mut self, present: &[(Satellite, usize)], largest: &mut Largest) {
        let members = self.expected.members();
        assert_eq!(self.bank.len(), members.len());
        assert!(members.iter().all(|s| self.bank.satellites().contains(*s)));
        assert_eq!(self.bank.excluded().len(), self.expected.excluded().len());
        let before = self.always_redundant;
        let mut always_redundant = before;
        let mut compare = |filter: &Filter<K, M>, without: &[Satellite]| {
            let taken = present
                .iter()
                .filter(|(s, _)| members.contains(s) && !without.contains(s));
            // Position and clock are four states, velocity and drift four more: with five satellites
            // that give pseudorange and range rate both are redundant.
            let is_redundant = before && taken.filter(|(_, rows)| *rows == 2).count() > 4;
            always_redundant &= is_redundant;
            let difference = Difference::of(&dense_filter(filter), self.expected.filter(without));
            if is_redundant {
                largest.redundant.take(difference);
            } else {
                largest.deficient.take(difference);
            }
            largest.filters[usize::from(!is_redundant)] += 1;
        };
        compare(&self.main, &[]);
        for (k, n) in members.iter().enumerate() {
            compare(self.bank.sub_filter(*n, &self.sub).unwrap(), &[*n]);
            for m in &members[k + 1..] {
                let filter = self.bank.secondary([*m, *n], &self.secondaries);
                compare(filter.unwrap(), &[*n, *m]);
            }
        }
        self.always_redundant = always_redundant;
        largest.members = largest.members.max(members.len());
    }

    fn compare_tests(&self, verdict: &BankVerdict, expected: &Verdict, largest: &mut Largest) {
        assert_eq!(verdict.detected, expected.detected);
        assert_eq!(verdict.isolated, expected.isolated);
        let compare = |largest: &mut f64, a: [f64; 2], b: [f64; 2]| {
            for (a, b) in a.into_iter().zip(b) {
                assert!((a - b).is_finite());
                *largest = largest.max((a - b).abs());
            }
        };
        compare(&mut largest.levels_m, verdict.level_m, expected.level);
        let fault_free = (verdict.fault_free_m, expected.fault_free);
        compare(&mut largest.tests_m, fault_free.0, fault_free.1);
        let ours: Vec<_> = self.bank.separations().collect();
        assert_eq!(ours.len(), expected.tests.len());
        let square = |values: [f64; 2]| values.map(|value| value * value);
        for ((satellite, ours), theirs) in ours.into_iter().zip(&expected.tests) {
            assert_eq!(satellite, theirs.satellite);
            compare(&mut largest.tests_m, ours.statistic_m, theirs.statistic);
            compare(&mut largest.tests_m, ours.uncertainty_m, theirs.uncertainty);
            let (ours, theirs) = (square(ours.threshold_m), square(theirs.threshold));
            compare(&mut largest.thresholds_m2, ours, theirs);
        }
        largest.detections += usize::from(verdict.detected);
        largest.epochs += 1;
    }

    /// Some satellites come and go; now and then most of them go, or one becomes faulty. In the first half of
    /// a run there are always enough, if there are so many at all.
    fn change_sky(&mut self) {
        let n = self.flight.sky.len();
        let is_rich = n >= 10 && self.t < 20;
        let draw = |both: &mut Self, one_in: usize| both.flight.random.integer(1, one_in) == 1;
        let outage = draw(self, 12) && !is_rich;
        for k in 0..n {
            let toggles = if self.flight.sky[k].in_view {
                let in_view = self.flight.sky.iter().filter(|s| s.in_view).count();
                let may_go = !is_rich || in_view > 9;
                may_go && draw(self, if outage { 1 } else { 15 }) && !(outage && draw(self, 6))
            } else {
                !outage && (self.t == 0 || draw(self, 2))
            };
            if toggles {
                self.flight.toggle(k);
            }
        }
        if n > 0 && draw(self, 10) {
            let k = self.flight.random.integer(0, n - 1);
            self.flight.sky[k].fault_m = 100.0 * self.flight.random.normal();
        }
    }
}

/// A thousand epochs, with none to as many satellites as the bank holds.
/// INT-024.
#[test]
fn the_bank_is_that_of_dense_filters() {
    let mut largest = Largest::default();
    for satellites in 0..=MAX_BANK {
        let hold_s = [12, 0, 3][satellites % 3];
        let mut both = Both::new(satellites as u64, satellites, hold_s);
        for _ in 0..40 {
            both.change_sky();
            both.epoch(&mut largest);
        }
    }
    println!("{largest:?}");
    assert!(largest.redundant.covariance < 1e-9);
    assert!(largest.redundant.state < 1e-9);
    assert!(largest.deficient.covariance < 1e-6);
    assert!(largest.deficient.state < 1e-6);
    assert!(largest.tests_m < 1e-6);
    assert!(largest.thresholds_m2 < 1e-6);
    assert!(largest.levels_m < 1e-3);
    // Everything that a bank does was seen.
    assert_eq!((largest.epochs, largest.members), (1000, MAX_BANK));
    assert!(largest.filters.iter().all(|n| *n > 1000));
    assert!(largest.held > 100 && largest.detections > largest.exclusions);
    assert!(largest.exclusions > 10);
}

/// Satellites of which some coordinates of the lines of sight fall almost on one line leave a small pivot
/// in the compressed epoch, and after it a pivot that is nothing but its rounding.
/// INT-024.
#[test]
fn a_small_pivot_leaves_the_update_right() {
    let mut flight = Flight::new(3, 8);
    let mut filter = flight.filter();
    let mut predict_workspace = PredictWorkspace::EMPTY;
    let mut workspace = UpdateWorkspace::EMPTY;
    let mut update = |filter: &mut Filter<K, M>, rows: &[MeasurementRow<M>]| {
        let mut information = EpochInformation::ZERO;
        rows.iter().for_each(|row| information.add_row(row));
        filter.update(&information, &mut workspace);
    };
    (0..8).for_each(|k| flight.toggle(k));
    for _ in 0..30 {
        let transition = flight.fly();
        filter.predict(&transition, &mut predict_workspace);
        let rows = flight.measure().into_iter().map(|(_, row)| row);
        update(&mut filter, &rows.collect::<Vec<_>>());
    }
    for _ in 0..20 {
        filter.predict(&flight.fly(), &mut predict_workspace);
    }
    let mut worst = Difference::default();
    for step in 0..200 {
        let offset = 10.0_f64.powf(-0.06 * f64::from(step));
        let lines = [
            (1.0, 0.1, 0.53),
            (-1.0, 0.4, 0.62),
            (1.0, -0.5, 0.35 + 0.5 * offset),
        ];
        let rows = lines.map(|(side, y, z)| {
            let e = [side * f64::sqrt(1.0 - y * y - z * z), y, z];
            let mut row = MeasurementRow::ZERO;
            row.pseudorange[..3].copy_from_slice(&e);
            row.pseudorange[6] = 1.0;
            row.range_rate[..3].copy_from_slice(&[1e-5 * y, -1e-4 * z, 3e-5 * e[0]]);
            row.range_rate[3..6].copy_from_slice(&e);
            row.range_rate[7] = 1.0;
            (row.weight, row.range_rate_weight) = (0.3, 400.0);
            (row.innovation_m, row.innovation_mps) = (2.0 * y, 0.05 * z);
            row
        });
        let (mut ours, mut theirs) = (filter.clone(), dense_filter(&filter));
        update(&mut ours, &rows);
        rows.iter()
            .flat_map(scalars)
            .for_each(|row| theirs.update(&row));
        worst.take(Difference::of(&dense_filter(&ours), &theirs));
    }
    println!("{worst:?}");
    assert!(worst.covariance < 1e-6);
    assert!(worst.state < 1e-5);
}
