use std::boxed::Box;
use std::vec::Vec;

use super::*;
use crate::ekf::layout::POSITION;
use crate::gnss::System;

pub(super) const K: usize = 2;
pub(super) const M: usize = 8;

pub(super) fn sat(prn: u8) -> Satellite {
    Satellite::new(System::Gps, prn).unwrap()
}

/// A filter with this error of the position and this variance of each axis, m and m².
fn filter(position: [f64; 3], variance: f64) -> Filter<K, M> {
    let mut filter = Filter::EMPTY;
    let block = [variance, 0.0, 0.0, variance, 0.0, variance];
    filter.start(&[block; 5], &[variance; K]);
    let mut moved = ErrorState::ZERO;
    moved.navigation[POSITION] = position.map(|x| -x);
    filter.rereference(&moved);
    filter
}

/// A filter to tell from others by its position.
pub(super) fn marked(x: f64) -> Filter<K, M> {
    filter([x, 0.0, 0.0], 1.0)
}

/// A satellite that measures the position's first axis with this weight.
fn row(prn: u8, weight: f64) -> BankRow<M> {
    let mut row = MeasurementRow::ZERO;
    row.pseudorange[0] = 1.0;
    row.weight = weight;
    BankRow {
        satellite: sat(prn),
        row,
    }
}

pub(super) struct Fixture {
    pub(super) bank: Box<Bank<K, M>>,
    pub(super) main: Filter<K, M>,
    pub(super) sub: Box<SubFilters<K, M>>,
    pub(super) secondaries: Box<Secondaries<K, M>>,
    pub(super) information: EpochInformation<M>,
    pub(super) quantiles: SeparationQuantiles,
    pub(super) vertical: bool,
}

impl Fixture {
    pub(super) fn new() -> Self {
        let mut quantiles = SeparationQuantiles::EMPTY;
        quantiles.fill(0.1, 1e-3, 1e-7).unwrap();
        Self {
            bank: Box::new(Bank::EMPTY),
            main: marked(1.0),
            sub: Box::new(SubFilters::EMPTY),
            secondaries: Box::new(Secondaries::EMPTY),
            information: EpochInformation::ZERO,
            quantiles,
            vertical: false,
        }
    }

    /// An epoch at `t_s` with these satellites, held for ten seconds.
    pub(super) fn admit(&mut self, t_s: i64, prns: &[u8]) {
        let rows: Vec<_> = prns.iter().map(|prn| row(*prn, f64::from(*prn))).collect();
        let epoch = BankEpoch {
            time: GpsTime::from_ns(t_s * 1_000_000_000),
            rows: &rows,
            hold_ns: 10_000_000_000,
        };
        let (sub, secondaries) = (&mut self.sub, &mut self.secondaries);
        self.bank
            .admit(&epoch, &self.main, sub, secondaries, &mut self.information);
    }

    pub(super) fn sub(&mut self, prn: u8) -> &mut Filter<K, M> {
        let place = self.bank.place_of(sat(prn)).unwrap();
        &mut self.sub.filters[place]
    }

    pub(super) fn secondary(&mut self, a: u8, b: u8) -> &mut Filter<K, M> {
        let [a, b] = [a, b].map(|prn| self.bank.place_of(sat(prn)).unwrap());
        &mut self.secondaries.filters[pair(a, b)]
    }

    pub(super) fn test(&mut self) -> BankVerdict {
        let criterion = Criterion {
            quantiles: &self.quantiles,
            vertical: self.vertical,
            c_enu_e: &Matrix3::identity(),
        };
        self.bank
            .test(&criterion, &self.main, &self.sub, &self.secondaries)
    }

    pub(super) fn exclude(&mut self, prn: u8) -> bool {
        let (sub, secondaries) = (&mut self.sub, &mut self.secondaries);
        self.bank
            .exclude(sat(prn), &mut self.main, sub, secondaries)
    }

    /// Satellites 1 to 4, each filter at 10 m but those that leave out one of `healthy`, which are at 0;
    /// a separation's sigma is 1 m on each axis.
    pub(super) fn with_fault(axis: usize, healthy_without: &[u8]) -> Self {
        let mut fixture = Self::new();
        fixture.admit(0, &[1, 2, 3, 4]);
        let at = |without: &[u8]| {
            let mut position = [0.0; 3];
            if !without.iter().any(|prn| healthy_without.contains(prn)) {
                position[axis] = 10.0;
            }
            filter(position, 1.0 + without.len() as f64)
        };
        fixture.main = at(&[]);
        for a in 1..=4 {
            *fixture.sub(a) = at(&[a]);
            for b in a + 1..=4 {
                *fixture.secondary(a, b) = at(&[a, b]);
            }
        }
        fixture
    }
}

#[test]
fn every_pair_of_places_has_one_place_of_its_own() {
    let mut seen = [false; MAX_PAIRS];
    for a in 0..MAX_BANK {
        for b in a + 1..MAX_BANK {
            assert_eq!(pair(a, b), pair(b, a));
            assert!(!std::mem::replace(&mut seen[pair(a, b)], true));
        }
    }
    assert!(seen.iter().all(|seen| *seen));
}

#[test]
fn births_copy_the_filters_with_the_same_satellites() {
    let mut fixture = Fixture::new();
    fixture.admit(0, &[7]);
    assert_eq!(*fixture.sub(7), marked(1.0));
    fixture.main = marked(2.0);
    *fixture.sub(7) = marked(3.0);
    fixture.admit(1, &[7, 9]);
    assert_eq!(*fixture.sub(9), marked(2.0));
    assert_eq!(*fixture.secondary(7, 9), marked(3.0));
    assert_eq!(*fixture.sub(7), marked(3.0), "it goes on as it was");
    *fixture.secondary(7, 9) = marked(4.0);
    fixture.main = marked(5.0);
    // Two in one epoch: the filter without both is as the main one, too.
    fixture.admit(2, &[3, 7, 9, 8]);
    assert_eq!(*fixture.secondary(3, 8), marked(5.0));
    assert_eq!(*fixture.secondary(3, 7), marked(3.0));
    assert_eq!(*fixture.secondary(9, 8), marked(2.0));
    assert_eq!(*fixture.secondary(7, 9), marked(4.0));
    let order: Vec<_> = fixture
        .bank
        .separations()
        .map(|(sat, _)| sat.prn())
        .collect();
    assert_eq!(order, [7, 9, 3, 8], "in the order of first use");
    assert_eq!(fixture.bank.len(), 4);
}

#[test]
fn every_filter_takes_the_satellites_it_keeps() {
    let mut fixture = Fixture::new();
    let prns = [4, 1, 6, 2, 5];
    fixture.admit(0, &prns);
    let (sub, secondaries) = (&mut fixture.sub, &mut fixture.secondaries);
    fixture.bank.update(sub, secondaries);
    // Before it the variance is 1, and the weight of a satellite is its number.
    let all: f64 = prns.iter().map(|prn| f64::from(*prn)).sum();
    assert_eq!(fixture.information.rows(), 5);
    let is_updated_without = |filter: &Filter<K, M>, weight: f64| {
        let [xx, ..] = filter.block(POSITION);
        assert!((xx * (1.0 + all - weight) - 1.0).abs() < 1e-14);
    };
    for a in prns {
        is_updated_without(fixture.sub(a), f64::from(a));
        for b in prns {
            if a != b {
                is_updated_without(fixture.secondary(a, b), f64::from(a + b));
            }
        }
    }
}

#[test]
fn a_satellite_that_vanished_is_held_and_then_dies() {
    let mut fixture = Fixture::new();
    fixture.admit(0, &[1, 2]);
    *fixture.sub(1) = marked(3.0);
    *fixture.secondary(1, 2) = marked(4.0);
    fixture.admit(1, &[2]);
    fixture.admit(10, &[2]);
    assert_eq!(fixture.bank.len(), 2, "missing for nine seconds");
    assert_eq!(fixture.information.rows(), 1);
    fixture.admit(11, &[1, 2]);
    assert_eq!(*fixture.sub(1), marked(3.0), "it returned in time");
    assert_eq!(*fixture.secondary(1, 2), marked(4.0));
    fixture.admit(12, &[2]);
    fixture.admit(21, &[2]);
    assert!(fixture.bank.satellites().contains(sat(1)), "counted anew");
    fixture.admit(22, &[2]);
    assert!(!fixture.bank.satellites().contains(sat(1)), "ten seconds");
    assert!(fixture.bank.sub_filter(sat(1), &fixture.sub).is_none());
    let both = [sat(1), sat(2)];
    assert!(fixture.bank.secondary(both, &fixture.secondaries).is_none());
    fixture.admit(23, &[1, 2]);
    assert_eq!(*fixture.sub(1), marked(1.0), "born again");
    let same = [sat(2); 2];
    assert!(fixture.bank.secondary(same, &fixture.secondaries).is_none());
}

#[test]
fn without_a_hold_a_satellite_dies_at_its_first_missing_epoch() {
    let mut fixture = Fixture::new();
    fixture.admit(0, &[1, 2]);
    let epoch = BankEpoch {
        time: GpsTime::from_ns(1),
        rows: &[row(2, 1.0)],
        hold_ns: 0,
    };
    let (sub, secondaries) = (&mut fixture.sub, &mut fixture.secondaries);
    let information = &mut fixture.information;
    let bank = &mut fixture.bank;
    bank.admit(&epoch, &fixture.main, sub, secondaries, information);
    assert_eq!((bank.len(), bank.is_empty()), (1, false));
    fixture.bank.clear();
    assert!(fixture.bank.is_empty());
}

#[test]
fn what_is_beyond_the_capacity_is_in_no_filter_and_counted() {
    let mut fixture = Fixture::new();
    let all: Vec<u8> = (1..=26).collect();
    fixture.admit(0, &all);
    assert_eq!(fixture.bank.len(), MAX_BANK);
    assert_eq!(fixture.bank.n_unmonitored(), 2);
    assert_eq!(fixture.information.rows() as usize, MAX_BANK);
    assert!(!fixture.bank.satellites().contains(sat(25)));
    // A held satellite keeps its place; one that is gone gives it to the next.
    fixture.admit(1, &all[1..]);
    assert_eq!(fixture.bank.n_unmonitored(), 2);
    fixture.admit(11, &all[1..]);
    assert_eq!(fixture.bank.n_unmonitored(), 1);
    assert!(fixture.bank.satellites().contains(sat(25)));
    assert_eq!(fixture.bank.len(), MAX_BANK);
    fixture.admit(12, &all[1..20]);
    assert_eq!(fixture.bank.n_unmonitored(), 0);
}

#[test]
fn an_exclusion_moves_every_filter_up() {
    let mut fixture = Fixture::new();
    fixture.admit(0, &[1, 2, 3, 4]);
    let number = |a: u8, b: u8| f64::from(10 * a.min(b) + a.max(b));
    for a in 1..=4 {
        *fixture.sub(a) = marked(f64::from(a));
        for b in a + 1..=4 {
            *fixture.secondary(a, b) = marked(number(a, b));
        }
    }
    assert!(!fixture.exclude(9));
    assert!(fixture.exclude(2));
    assert_eq!(fixture.main, marked(2.0));
    for a in [1, 3, 4] {
        assert_eq!(*fixture.sub(a), marked(number(a, 2)));
        for b in [1, 3, 4] {
            if a < b {
                assert_eq!(*fixture.secondary(a, b), marked(number(a, 2)));
            }
        }
    }
    assert!(fixture.bank.excluded().contains(sat(2)));
    // Its test is still told of this epoch, after the others.
    let order = |fixture: &Fixture| -> Vec<u8> {
        let tests = fixture.bank.separations();
        tests.map(|(satellite, _)| satellite.prn()).collect()
    };
    assert_eq!(order(&fixture), [1, 3, 4, 2]);
    fixture.admit(1, &[1, 2, 3, 4]);
    assert_eq!(order(&fixture), [1, 3, 4], "it does not come back");
    assert_eq!(fixture.information.rows(), 3);
    assert_eq!(fixture.bank.n_unmonitored(), 0);
    fixture.bank.clear();
    fixture.admit(2, &[2]);
    assert_eq!(order(&fixture), [2], "but for a new start");
}

#[test]
fn all_filters_follow_a_corrected_nominal() {
    let mut fixture = Fixture::new();
    fixture.admit(0, &[1, 2]);
    *fixture.sub(2) = marked(4.0);
    let mut correction = ErrorState::ZERO;
    correction.navigation[POSITION] = [0.5, 0.0, 0.0];
    let (sub, secondaries) = (&mut fixture.sub, &mut fixture.secondaries);
    fixture.bank.rereference(&correction, sub, secondaries);
    assert_eq!(*fixture.sub(1), marked(0.5));
    assert_eq!(*fixture.sub(2), marked(3.5));
    assert_eq!(*fixture.secondary(1, 2), marked(0.5));
}

#[test]
fn the_faulty_satellite_is_isolated() {
    for faulty in 1..=4 {
        let mut fixture = Fixture::with_fault(0, &[faulty]);
        let verdict = fixture.test();
        assert!(verdict.detected);
        assert_eq!(verdict.isolated, Some(sat(faulty)));
    }
    let quiet = Fixture::with_fault(0, &[]).test();
    assert_eq!((quiet.detected, quiet.isolated), (false, None));
}

#[test]
fn two_satellites_that_explain_it_leave_it_open() {
    let verdict = Fixture::with_fault(0, &[2, 3]).test();
    assert!(verdict.detected);
    assert_eq!(verdict.isolated, None);
}

#[test]
fn a_satellite_whose_own_test_passes_is_not_isolated() {
    // Without 1 all agree, but with the main filter as well; the filters without 2 stand apart.
    let mut fixture = Fixture::with_fault(0, &[]);
    *fixture.sub(2) = filter([0.0; 3], 2.0);
    for other in [3, 4] {
        *fixture.secondary(2, other) = filter([0.0; 3], 3.0);
    }
    let verdict = fixture.test();
    assert!(verdict.detected);
    assert_eq!(verdict.isolated, None);
    // If its own fails, it is.
    fixture.main = filter([0.0; 3], 1.0);
    assert_eq!(fixture.test().isolated, Some(sat(1)));
}

#[test]
fn without_a_set_of_filters_that_agrees_nothing_is_isolated() {
    let mut fixture = Fixture::with_fault(0, &[1]);
    *fixture.secondary(1, 3) = filter([-10.0, 0.0, 0.0], 3.0);
    let verdict = fixture.test();
    assert!(verdict.detected);
    assert_eq!(verdict.isolated, None);
}

#[test]
fn the_vertical_is_tested_where_it_is_asked_for() {
    let mut fixture = Fixture::with_fault(2, &[4]);
    assert!(!fixture.test().detected);
    fixture.vertical = true;
    assert!(fixture.test().detected);
    assert_eq!(fixture.test().isolated, Some(sat(4)));
}

/// Q⁻¹(P_FA / 2N) is 1.96 for the two tests of two satellites and 1.645 for the one of the isolation.
#[test]
fn the_false_alert_probability_is_split_over_the_tests() {
    let mut fixture = Fixture::new();
    fixture.admit(0, &[1, 2]);
    let mut isolated = |main: f64, between: f64| {
        fixture.main = filter([main, 0.0, 0.0], 1.0);
        *fixture.sub(1) = filter([0.0; 3], 2.0);
        *fixture.sub(2) = filter([main, 0.0, 0.0], 2.0);
        *fixture.secondary(1, 2) = filter([between, 0.0, 0.0], 3.0);
        let verdict = fixture.test();
        (verdict.detected, verdict.isolated)
    };
    assert_eq!(isolated(1.9, 0.0), (false, None));
    assert_eq!(isolated(2.0, 0.0), (true, Some(sat(1))));
    assert_eq!(isolated(10.0, 1.6), (true, Some(sat(1))));
    assert_eq!(isolated(10.0, 1.8), (true, None));
}

#[test]
fn filters_that_know_the_same_are_not_tested() {
    let mut fixture = Fixture::with_fault(0, &[1]);
    // As much as 5 m apart, and of almost one covariance, or a smaller one.
    for variance in [1.0 + 0.9e-10, 1.0, 0.5] {
        *fixture.sub(1) = filter([5.0, 0.0, 0.0], variance);
        let verdict = fixture.test();
        assert!(!verdict.detected);
        let (_, first) = fixture.bank.separations().next().unwrap();
        assert_eq!(first.threshold_m, [0.0; 2]);
        assert_eq!(first.statistic_m, [5.0, 0.0]);
    }
    *fixture.sub(1) = filter([5.0, 0.0, 0.0], 1.0 + 1.1e-10);
    assert!(fixture.test().detected);
}

#[test]
fn what_is_no_number_is_a_failed_test_and_no_level() {
    let mut fixture = Fixture::with_fault(0, &[]);
    *fixture.sub(3) = filter([f64::NAN, 0.0, 0.0], 2.0);
    let verdict = fixture.test();
    assert!(verdict.detected);
    assert_eq!(verdict.isolated, None);
    assert_eq!(verdict.alerted_level_m[0], f64::INFINITY);
    assert!(verdict.level_m[0].is_finite());
    let mut fixture = Fixture::with_fault(0, &[]);
    *fixture.sub(3) = filter([10.0, 0.0, 0.0], f64::NAN);
    let verdict = fixture.test();
    assert!(verdict.detected);
    assert_eq!(verdict.isolated, None);
    assert_eq!(verdict.level_m, [f64::INFINITY; 2]);
    let mut level = [1.0, 2.0];
    raise(&mut level, 0, &[f64::NAN; 2], &[1.0; 2]);
    raise(&mut level, 1, &[1.0; 2], &[0.5; 2]);
    assert_eq!(level, [f64::INFINITY, 2.0]);
}

#[test]
fn levels_are_the_largest_over_the_sub_filters() {
    let mut fixture = Fixture::with_fault(0, &[]);
    *fixture.sub(2) = filter([7.0, 0.0, 1.0], 10.0);
    let verdict = fixture.test();
    let quantiles = &fixture.quantiles;
    let (k_fa, k_md) = (quantiles.detection(4), quantiles.missed());
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
    // Of a variance of 10 m² and a difference of 9 m² to the main filter's 1 m².
    let a = 10.0_f64.sqrt() * k_md;
    near(verdict.level_m[0], 3.0 * k_fa + a);
    near(verdict.level_m[1], 3.0 * k_fa + a);
    near(verdict.alerted_level_m[0], 3.0 + a);
    near(verdict.alerted_level_m[1], 1.0 + a);
    near(verdict.fault_free_m[0], quantiles.fault_free());
    near(verdict.fault_free_m[1], quantiles.fault_free());
}

#[test]
fn an_empty_bank_has_no_level_but_the_fault_free_one() {
    let mut fixture = Fixture::new();
    fixture.admit(0, &[]);
    let verdict = fixture.test();
    assert_eq!((verdict.detected, verdict.isolated), (false, None));
    assert_eq!(verdict.level_m, [0.0; 2]);
    assert!(verdict.fault_free_m[0] > 5.0);
    assert_eq!(fixture.information.rows(), 0);
    // One satellite: there is nothing to isolate it with but its own test.
    fixture.admit(1, &[1]);
    fixture.main = marked(10.0);
    *fixture.sub(1) = filter([0.0; 3], 2.0);
    assert_eq!(fixture.test().isolated, Some(sat(1)));
}

/// The filter without a constellation had the satellite until now; so had the young filters of pairs.
#[test]
fn no_filter_keeps_what_an_excluded_satellite_did() {
    let two_constellations = || {
        let mut fixture = Fixture::new();
        let mut rows: Vec<_> = [1, 2, 3].map(|prn| row(prn, 1.0)).into();
        let bds = Satellite::new(System::Bds, 30).unwrap();
        rows.push(BankRow {
            satellite: bds,
            row: row(4, 1.0).row,
        });
        let epoch = BankEpoch {
            time: GpsTime::from_ns(0),
            rows: &rows,
            hold_ns: 0,
        };
        let (sub, secondaries) = (&mut *fixture.sub, &mut *fixture.secondaries);
        let information = &mut fixture.information;
        fixture
            .bank
            .admit(&epoch, &fixture.main, sub, secondaries, information);
        let begun = fixture.bank.monitor_constellations(&fixture.main, sub);
        assert_eq!(begun.iter().filter(|begins| **begins).count(), 2);
        for (place, filter) in sub.constellations.iter_mut().enumerate() {
            *filter = marked(20.0 + place as f64);
        }
        *fixture.sub(2) = marked(2.0);
        *fixture.secondary(1, 2) = marked(12.0);
        fixture
    };
    let systems = [System::Gps, System::Bds].map(System::index);
    let mut fixture = two_constellations();
    assert!(fixture.exclude(2));
    assert_eq!(fixture.main, marked(2.0));
    assert_eq!(*fixture.sub(1), marked(12.0));
    // The filter without its own constellation never had it.
    let [gps, bds] = systems;
    assert_eq!(fixture.sub.constellations[gps], marked(20.0 + gps as f64));
    assert_eq!(fixture.sub.constellations[bds], marked(2.0));
    let mut fixture = two_constellations();
    let (sub, secondaries) = (&mut *fixture.sub, &mut *fixture.secondaries);
    let main = &mut fixture.main;
    assert!(fixture.bank.exclude_alone(sat(2), main, sub, secondaries));
    assert!(!fixture.bank.exclude_alone(sat(2), main, sub, secondaries));
    assert_eq!(*fixture.sub(1), marked(2.0));
    assert_eq!(*fixture.secondary(1, 3), marked(2.0));
    for system in systems {
        assert_eq!(fixture.sub.constellations[system], marked(2.0));
    }
}
