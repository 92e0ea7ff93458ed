//! What recordings ask of the bank: explanations by two satellites and constellations, places, holds.

use std::boxed::Box;
use std::vec::Vec;

use super::tests::{Fixture, K, M, marked, sat};
use super::*;
use crate::gnss::System;
use crate::mhss::protection::FaultPriors;
use crate::mhss::selection;
use crate::time::NS_PER_S;

/// Directions of satellites: rows of pseudoranges with one clock.
const DIRECTIONS: [[f64; 3]; 12] = [
    [0.8, 0.0, -0.6],
    [-0.8, 0.0, -0.6],
    [0.0, 0.8, -0.6],
    [0.0, -0.8, -0.6],
    [0.5, 0.5, -0.707],
    [-0.5, 0.5, -0.707],
    [0.3, -0.2, -0.933],
    [-0.6, -0.6, -0.53],
    [0.7, -0.5, -0.51],
    [-0.2, 0.3, -0.933],
    [0.1, 0.9, -0.424],
    [-0.7, 0.1, -0.707],
];

fn directed(satellite: Satellite, direction: [f64; 3], error_m: f64) -> BankRow<M> {
    let mut row = MeasurementRow::ZERO;
    row.pseudorange[..3].copy_from_slice(&direction);
    row.pseudorange[6] = 1.0;
    row.weight = 1.0;
    // An innovation is predicted minus measured.
    row.innovation_m = -error_m;
    BankRow { satellite, row }
}

/// An epoch in which every filter starts vague, so that it is the least squares of what it keeps.
struct Sky {
    fixture: Fixture,
    limits: PostfitLimits,
}

impl Sky {
    fn new(systems: &[System], errors_m: &[f64]) -> Self {
        Self::with_aid(systems, errors_m, &EpochInformation::ZERO)
    }

    fn with_aid(systems: &[System], errors_m: &[f64], aid: &EpochInformation<M>) -> Self {
        let mut fixture = Fixture::new();
        let mut vague = Filter::EMPTY;
        let block = [1e8, 0.0, 0.0, 1e8, 0.0, 1e8];
        vague.start(&[block; 5], &[1e8; K]);
        fixture.main = vague;
        let rows: Vec<_> = (0..systems.len())
            .map(|k| {
                let satellite = Satellite::new(systems[k], k as u8 + 6).unwrap();
                directed(satellite, DIRECTIONS[k], errors_m[k])
            })
            .collect();
        let epoch = BankEpoch {
            time: GpsTime::from_ns(0),
            rows: &rows,
            hold_ns: 0,
        };
        let (sub, secondaries) = (&mut *fixture.sub, &mut *fixture.secondaries);
        fixture.bank.aid(aid);
        fixture.bank.admit(
            &epoch,
            &fixture.main,
            sub,
            secondaries,
            &mut fixture.information,
        );
        fixture.bank.monitor_constellations(&fixture.main, sub);
        let begins = fixture.bank.monitor_aids(&fixture.main, sub);
        assert_eq!(begins, aid.rows() > 0);
        let mut workspace = UpdateWorkspace::EMPTY;
        fixture.main.update(&fixture.information, &mut workspace);
        fixture.bank.update_constellations(sub);
        fixture.bank.update_unaided(sub);
        fixture.bank.update(sub, secondaries);
        let mut limits = PostfitLimits::EMPTY;
        limits.fill(1e-3).unwrap();
        Self { fixture, limits }
    }

    fn explanation(&mut self) -> (BankVerdict, Option<Explanation>) {
        let verdict = self.fixture.test();
        let fixture = &self.fixture;
        let explanation =
            fixture
                .bank
                .explain(&self.limits, true, &fixture.sub, &fixture.secondaries);
        (verdict, explanation)
    }
}

fn satellite(k: usize) -> Satellite {
    Satellite::new(System::Gps, k as u8 + 6).unwrap()
}

#[test]
fn two_satellites_are_named_when_nothing_else_explains_them() {
    let mut errors_m = [0.0; 8];
    (errors_m[1], errors_m[4]) = (60.0, -85.0);
    let mut sky = Sky::new(&[System::Gps; 8], &errors_m);
    let (verdict, explanation) = sky.explanation();
    assert!(verdict.detected && verdict.isolated.is_none());
    let two = [satellite(1), satellite(4)];
    assert_eq!(explanation, Some(Explanation::Two(two)));
    let fixture = &mut sky.fixture;
    let clean = fixture
        .bank
        .secondary(two, &fixture.secondaries)
        .unwrap()
        .clone();
    let (sub, secondaries) = (&mut *fixture.sub, &mut *fixture.secondaries);
    let main = &mut fixture.main;
    assert!(fixture.bank.exclude_two(two, main, sub, secondaries));
    assert_eq!(*main, clean);
    assert_eq!(fixture.bank.len(), 6);
    for satellite in fixture.bank.satellites().iter() {
        assert_eq!(fixture.bank.sub_filter(satellite, sub), Some(&clean));
    }
    assert!(!fixture.bank.exclude_two(two, main, sub, secondaries));
}

#[test]
fn one_satellite_is_not_explained_by_two() {
    let mut errors_m = [0.0; 8];
    errors_m[3] = 70.0;
    let mut sky = Sky::new(&[System::Gps; 8], &errors_m);
    let (verdict, explanation) = sky.explanation();
    assert_eq!(verdict.isolated, Some(satellite(3)));
    assert_eq!(explanation, None);
    // Nor is anything when the filters of the pairs missed the epoch.
    sky.fixture.bank.drop_pairs();
    let (verdict, explanation) = sky.explanation();
    assert!(verdict.detected && verdict.isolated.is_none());
    assert_eq!(explanation, None);
}

#[test]
fn of_three_constellations_the_one_that_contradicts_is_named_and_of_two_none() {
    use System::{Bds, Galileo, Gps};
    // Its satellites are moved as if it had other orbits; a clock of its own it does not have here.
    let errors_m = |systems: &[System]| -> Vec<f64> {
        let errors = systems.iter().zip(&DIRECTIONS);
        errors
            .map(|(system, [x, ..])| {
                if *system == Bds {
                    100.0 * x + 100.0
                } else {
                    0.0
                }
            })
            .collect()
    };
    let three = [
        Bds, Gps, Galileo, Bds, Gps, Bds, Gps, Galileo, Gps, Galileo, Galileo, Bds,
    ];
    let mut sky = Sky::new(&three, &errors_m(&three));
    let (verdict, explanation) = sky.explanation();
    assert!(verdict.detected && verdict.isolated.is_none());
    assert_eq!(explanation, Some(Explanation::Constellation(Bds)));
    let two = three.map(|system| if system == Galileo { Bds } else { system });
    let mut sky = Sky::new(&two, &errors_m(&two));
    let (verdict, explanation) = sky.explanation();
    assert!(verdict.detected);
    assert_eq!(explanation, None);
}

#[test]
fn who_is_evicted_is_in_no_filter_and_called_nothing() {
    let mut fixture = Fixture::new();
    fixture.admit(0, &[1, 2, 3]);
    *fixture.sub(2) = marked(2.0);
    *fixture.secondary(2, 3) = marked(23.0);
    let (sub, secondaries) = (&mut *fixture.sub, &mut *fixture.secondaries);
    let main = &mut fixture.main;
    assert!(fixture.bank.evict(sat(2), main, sub, secondaries).is_some());
    assert_eq!(*main, marked(2.0));
    assert_eq!(*fixture.sub(3), marked(23.0));
    assert!(fixture.bank.excluded().is_empty() && !fixture.bank.has(sat(2)));
    let (sub, secondaries) = (&mut *fixture.sub, &mut *fixture.secondaries);
    let main = &mut fixture.main;
    assert_eq!(fixture.bank.evict(sat(2), main, sub, secondaries), None);
}

#[test]
fn a_held_satellite_is_held_on_while_its_threshold_is_worth_it() {
    let mut fixture = Fixture::with_fault(0, &[1]);
    fixture.test();
    let at = |t_s: i64| GpsTime::from_ns(t_s * NS_PER_S);
    // Held for ten seconds, see `admit`.
    fixture.admit(1, &[2, 3, 4]);
    fixture.bank.hold_on(at(11), 10 * NS_PER_S, 0.5);
    fixture.admit(11, &[2, 3, 4]);
    assert!(fixture.bank.has(sat(1)), "its threshold is metres");
    assert_eq!(fixture.bank.missing_longest(), Some((sat(1), at(11))));
    fixture.bank.hold_on(at(21), 10 * NS_PER_S, 100.0);
    fixture.admit(21, &[2, 3, 4]);
    assert!(!fixture.bank.has(sat(1)));
}

#[test]
fn who_comes_back_is_likelier_to_fail_again() {
    let priors = FaultPriors::PRESET;
    let mut fixture = Fixture::new();
    fixture.admit(0, &[1, 2, 3]);
    assert!(fixture.exclude(2));
    fixture.admit(1, &[1, 2, 3]);
    assert!(!fixture.bank.has(sat(2)));
    fixture.bank.readmit(sat(2));
    fixture.admit(2, &[1, 2, 3]);
    assert!(fixture.bank.has(sat(2)) && fixture.bank.excluded().is_empty());
    let probabilities: Vec<f64> = fixture
        .bank
        .hypotheses(&priors)
        .map(|hypothesis| hypothesis.probability)
        .collect();
    assert_eq!(
        probabilities,
        [priors.satellite, priors.satellite, priors.readmitted]
    );
    // Three pairs, two of them with the one that came back, and GPS alone.
    let expected = priors.satellite * (priors.satellite + 2.0 * priors.readmitted) + 1e-8;
    assert!((fixture.bank.p_unmonitored(&priors) - expected).abs() < 1e-16);
}

#[test]
fn places_go_to_those_the_position_would_miss() {
    let mut bank: Box<Bank<K, M>> = Box::new(Bank::EMPTY);
    let (mut sub, mut secondaries) = (Box::new(SubFilters::EMPTY), Box::new(Secondaries::EMPTY));
    let main = marked(0.0);
    let mut information = EpochInformation::ZERO;
    let at = |t_s: i64| GpsTime::from_ns(t_s * NS_PER_S);
    // 26 satellites overhead, nearly in one direction, and three towards the horizon.
    let overhead = |k: u8| {
        let tilt = 0.01 * f64::from(k);
        directed(sat(k), [tilt, 0.02 - tilt, -1.0], 0.0)
    };
    let low = [
        directed(sat(30), [1.0, 0.0, 0.0], 0.0),
        directed(sat(31), [-0.5, 0.87, 0.0], 0.0),
        directed(sat(32), [-0.5, -0.87, 0.0], 0.0),
    ];
    let mut epoch = |bank: &mut Bank<K, M>, t_s: i64, rows: Vec<BankRow<M>>, may_leave: bool| {
        let mut rows: heapless::Vec<_, 48> = rows.into_iter().collect();
        let mut main = main.clone();
        let leaving = selection::select(bank, &mut rows, at(t_s), may_leave);
        if let Some(leaving) = leaving {
            bank.evict(leaving, &mut main, &mut sub, &mut secondaries);
        }
        let epoch = BankEpoch {
            time: at(t_s),
            rows: &rows,
            hold_ns: 120 * NS_PER_S,
        };
        bank.admit(&epoch, &main, &mut sub, &mut secondaries, &mut information);
        leaving
    };
    // All at once: the three are worth most.
    let all: Vec<_> = (1..=26).map(overhead).chain(low).collect();
    assert_eq!(epoch(&mut bank, 0, all.clone(), true), None);
    assert_eq!(bank.len(), MAX_BANK);
    assert!([30, 31, 32].iter().all(|prn| bank.has(sat(*prn))));
    assert_eq!(bank.n_unmonitored(), 5);
    // Nobody outside is worth twice the least.
    assert_eq!(epoch(&mut bank, 1, all.clone(), true), None);
    // They come when the bank is full: one after the other takes a place, when swaps are allowed.
    bank.clear();
    let first: Vec<_> = (1..=26).map(overhead).collect();
    epoch(&mut bank, 2, first, true);
    assert_eq!(epoch(&mut bank, 3, all.clone(), false), None);
    for t_s in 4..7 {
        assert!(epoch(&mut bank, t_s, all.clone(), true).is_some());
    }
    assert!([30, 31, 32].iter().all(|prn| bank.has(sat(*prn))));
    assert_eq!(bank.len(), MAX_BANK);
    // One that is missing keeps its place for a minute, then gives way.
    let missing: Vec<_> = all
        .iter()
        .filter(|row| row.satellite != sat(30))
        .copied()
        .collect();
    for t_s in [10, 69] {
        assert_ne!(epoch(&mut bank, t_s, missing.clone(), true), Some(sat(30)));
    }
    // Not while the filters of the pairs are copies.
    assert_eq!(epoch(&mut bank, 70, missing.clone(), false), None);
    assert_eq!(epoch(&mut bank, 71, missing, true), Some(sat(30)));
}

/// An aid that says where the antenna is along the vertical, wrong by this much.
fn height(error_m: f64) -> EpochInformation<M> {
    let mut row = MeasurementRow::ZERO;
    row.pseudorange[2] = 1.0;
    row.weight = 4.0;
    row.innovation_m = -error_m;
    let mut information = EpochInformation::ZERO;
    information.add_row(&row);
    information
}

#[test]
fn what_an_aid_says_is_in_every_filter_once_but_in_the_one_without_aids() {
    let systems = [
        System::Gps,
        System::Gps,
        System::Gps,
        System::Bds,
        System::Bds,
        System::Bds,
    ];
    let errors_m = [1.0, -2.0, 0.5, 3.0, -1.0, 2.0];
    let aid = height(4.0);
    let sky = Sky::with_aid(&systems, &errors_m, &aid);
    let Sky { fixture, .. } = &sky;
    let of = |keeps: &dyn Fn(usize) -> bool, aid: Option<&EpochInformation<M>>| {
        let mut filter = Filter::EMPTY;
        let block = [1e8, 0.0, 0.0, 1e8, 0.0, 1e8];
        filter.start(&[block; 5], &[1e8; K]);
        let mut information = EpochInformation::ZERO;
        for k in (0..systems.len()).filter(|k| keeps(*k)) {
            let name = Satellite::new(systems[k], k as u8 + 6).unwrap();
            information.add_row(&directed(name, DIRECTIONS[k], errors_m[k]).row);
        }
        if let Some(aid) = aid {
            information.add(aid);
        }
        let mut workspace = UpdateWorkspace::EMPTY;
        filter.update(&information, &mut workspace);
        filter
    };
    let near = |a: &Filter<K, M>, b: &Filter<K, M>| {
        let (a, b) = (a.state().navigation[0], b.state().navigation[0]);
        assert!((0..3).all(|i| (a[i] - b[i]).abs() < 1e-6), "{a:?} {b:?}");
    };
    let name = |k: usize| Satellite::new(systems[k], k as u8 + 6).unwrap();
    near(&fixture.main, &of(&|_| true, Some(&aid)));
    near(fixture.sub.unaided(), &of(&|_| true, None));
    for k in 0..systems.len() {
        let own = fixture.bank.sub_filter(name(k), &fixture.sub).unwrap();
        near(own, &of(&|other| other != k, Some(&aid)));
        for l in 0..k {
            let two = [name(k), name(l)];
            let own = fixture.bank.secondary(two, &fixture.secondaries).unwrap();
            near(own, &of(&|other| other != k && other != l, Some(&aid)));
        }
    }
    for system in [System::Gps, System::Bds] {
        let own = fixture.sub.constellation(system).unwrap();
        near(own, &of(&|k| systems[k] != system, Some(&aid)));
    }
    // One more hypothesis, and its pairs with all others.
    let priors = FaultPriors::PRESET;
    let without = Sky::new(&systems, &errors_m).fixture;
    assert_eq!(
        fixture.bank.hypotheses(&priors).count(),
        without.bank.hypotheses(&priors).count() + 1
    );
    let pairs = fixture.bank.p_unmonitored(&priors) - without.bank.p_unmonitored(&priors);
    assert!(
        (pairs - 1e-5 * (6e-5 + 1e-4 + 1e-8)).abs() < 1e-15,
        "{pairs}"
    );
}

#[test]
fn aid_that_is_wrong_is_left_out_of_all_filters() {
    let mut sky = Sky::with_aid(&[System::Gps; 8], &[0.0; 8], &height(60.0));
    let verdict = sky.fixture.test();
    assert!(verdict.detected);
    let Sky { fixture, limits } = &mut sky;
    assert!(
        fixture
            .bank
            .aids_explain(limits, true, &fixture.main, &fixture.sub)
    );
    let clean = fixture.sub.unaided().clone();
    let (sub, secondaries) = (&mut *fixture.sub, &mut *fixture.secondaries);
    let main = &mut fixture.main;
    assert!(fixture.bank.exclude_aids(main, sub, secondaries));
    assert_eq!(*main, clean);
    for satellite in fixture.bank.satellites().iter() {
        assert_eq!(fixture.bank.sub_filter(satellite, sub), Some(&clean));
    }
    assert!(fixture.bank.unaided_separation().is_none());
    assert!(!fixture.bank.exclude_aids(main, sub, secondaries));
}

#[test]
fn aid_is_not_blamed_for_a_satellite() {
    for faulty in 0..8 {
        let mut errors_m = [0.0; 8];
        errors_m[faulty] = 200.0;
        let mut sky = Sky::with_aid(&[System::Gps; 8], &errors_m, &height(0.5));
        let verdict = sky.fixture.test();
        assert!(verdict.detected, "{faulty}");
        let fixture = &sky.fixture;
        let (main, sub) = (&fixture.main, &fixture.sub);
        assert!(!fixture.bank.aids_explain(&sky.limits, true, main, sub));
    }
}
