//! dP = P_0n − P_00: the covariance of the separation of two filters, where the first one's gain is optimal
//! and both started from one estimate, and only there.

mod common;
mod flying;
mod skies;

use flying::{Flight, K, M, dense, dense_filter, scalars};
use nalgebra::{SMatrix, SVector};
use serde_json::Value;
use surefix_core::ekf::filter::PredictWorkspace;
use surefix_core::ekf::{EpochInformation, Filter, UpdateWorkspace};
use surefix_core::gnss::Satellite;
use surefix_core::mhss::{Bank, BankEpoch, BankRow, Secondaries, SubFilters};
use surefix_core::time::GpsTime;
use surefix_host_tests::reference::bank::variances;
use surefix_host_tests::reference::separation::{Measurements, Nested};
use surefix_host_tests::reference::{Covariance, STATES};

fn matrix<const R: usize, const C: usize>(value: &Value) -> SMatrix<f64, R, C> {
    SMatrix::from_fn(|i, j| value[i][j].as_f64().unwrap())
}

/// Largest entry of a difference, in the scale of the larger one's largest.
fn apart<const N: usize>(a: &SMatrix<f64, N, N>, b: &SMatrix<f64, N, N>) -> f64 {
    (a - b).amax() / b.amax()
}

/// Nested filters of five states: gains optimal, a sub-filter started on its own, a robust main gain.
/// INT-025.
#[test]
fn the_golden_separations_are_reproduced() {
    let Some(path) = common::shared("golden/kf_separation.json") else {
        return;
    };
    let text = std::fs::read_to_string(path).unwrap();
    let golden: Value = serde_json::from_str(&text).unwrap();
    let (phi, q) = (matrix::<5, 5>(&golden["F"]), matrix::<5, 5>(&golden["Q"]));
    let p = matrix::<5, 5>(&golden["P0"]);
    let r = golden["R"].as_f64().unwrap();
    let mut seen = 0;
    for result in golden["results"].as_array().unwrap() {
        let excluded = result["excluded"].as_u64().unwrap() as usize;
        for case in ["nominal", "independent_init", "robust_main"] {
            let expected = &result[case];
            let mut epoch = Measurements {
                h: matrix::<6, 5>(&golden["H"]),
                variance: [r; 6],
                believed: [[Some(r); 6]; 2],
            };
            epoch.believed[1][excluded] = None;
            let mut nested = Nested::same(p);
            match case {
                "independent_init" => nested.cross.fill(0.0),
                "robust_main" => epoch.believed[0][0] = Some(25.0 * r),
                _ => {}
            }
            for _ in 0..golden["epochs"].as_u64().unwrap() {
                nested.predict(&phi, &q);
                nested.update(&epoch);
                // These filters know the covariance of their errors, whatever their gains.
                nested.believed = nested.actual;
            }
            for (name, ours) in [
                ("P00", nested.actual[0]),
                ("P0n", nested.actual[1]),
                ("Pcross", nested.cross),
                ("dP", nested.separation()),
            ] {
                let difference = apart(&ours, &matrix::<5, 5>(&expected[name]));
                assert!(difference < 1e-11, "{excluded} {case} {name}: {difference}");
            }
            let largest = |dp: SMatrix<f64, 5, 5>| {
                let block = dp.fixed_view::<3, 3>(0, 0).into_owned();
                variances(&block, &SMatrix::identity())[0]
            };
            for (name, ours) in [
                ("lambda_max_dP_EN", largest(nested.separation())),
                ("lambda_max_naive_EN", largest(nested.difference())),
            ] {
                let theirs = expected[name].as_f64().unwrap();
                assert!(
                    (ours / theirs - 1.0).abs() < 1e-9,
                    "{excluded} {case} {name}"
                );
            }
            let identity = (nested.separation() - nested.difference()).amax();
            if case == "nominal" {
                assert!(identity < 1e-12, "{excluded}: {identity}");
            } else {
                let theirs = expected["max_abs_dP_minus_naive"].as_f64().unwrap();
                assert!((identity / theirs - 1.0).abs() < 1e-9, "{excluded} {case}");
                assert!(identity > 0.1);
            }
            seen += 1;
        }
    }
    assert_eq!(seen, 18);
}

/// The bank of the core, and for every sub-filter the recursion that carries the cross-covariance along.
struct Bench {
    flight: Flight,
    main: Filter<K, M>,
    bank: Box<Bank<K, M>>,
    sub: Box<SubFilters<K, M>>,
    secondaries: Box<Secondaries<K, M>>,
    nested: Vec<(Satellite, Nested<STATES>)>,
    workspace: UpdateWorkspace<K, M>,
    t: i64,
}

/// The main filter takes the pseudoranges of this satellite for less than they are worth, as a robust
/// estimator does: it divides their weight by this.
const ROBUST: f64 = 25.0;

impl Bench {
    fn new(seed: u64, satellites: usize) -> Self {
        let mut flight = Flight::new(seed, satellites);
        (0..satellites).for_each(|k| flight.toggle(k));
        Self {
            main: flight.filter(),
            bank: Box::new(Bank::EMPTY),
            sub: Box::new(SubFilters::EMPTY),
            secondaries: Box::new(Secondaries::EMPTY),
            nested: Vec::new(),
            workspace: UpdateWorkspace::EMPTY,
            t: 0,
            flight,
        }
    }

    fn epoch(&mut self, robust: Option<Satellite>) {
        let transition = self.flight.fly();
        let (phi, q) = dense(&transition);
        let rows = self.flight.measure();
        let rows: Vec<_> = rows
            .into_iter()
            .map(|(satellite, row)| BankRow { satellite, row })
            .collect();
        let (sub, secondaries) = (&mut *self.sub, &mut *self.secondaries);
        let mut workspace = PredictWorkspace::EMPTY;
        self.main.predict(&transition, &mut workspace);
        self.bank.predict(&transition, sub, secondaries);
        for (_, nested) in &mut self.nested {
            nested.predict(&phi, &q);
        }
        let main = dense_filter(&self.main);
        for row in &rows {
            if !self.bank.satellites().contains(row.satellite) {
                self.nested.push((row.satellite, Nested::same(main.p)));
            }
        }
        let epoch = BankEpoch {
            time: GpsTime::from_ns(self.t * 1_000_000_000),
            rows: &rows,
            hold_ns: i64::MAX,
        };
        self.t += 1;
        let mut information = EpochInformation::ZERO;
        self.bank
            .admit(&epoch, &self.main, sub, secondaries, &mut information);
        if robust.is_some() {
            information.clear();
            for BankRow { satellite, row } in &rows {
                let mut row = *row;
                if Some(*satellite) == robust {
                    row.weight /= ROBUST;
                }
                information.add_row(&row);
            }
        }
        self.main.update(&information, &mut self.workspace);
        self.bank.update(sub, secondaries);
        for (without, nested) in &mut self.nested {
            for BankRow { satellite, row } in &rows {
                for (k, scalar) in scalars(row).iter().enumerate() {
                    let main = if k == 0 && Some(*satellite) == robust {
                        ROBUST * scalar.variance
                    } else {
                        scalar.variance
                    };
                    let sub = (satellite != without).then_some(scalar.variance);
                    nested.update(&Measurements {
                        h: scalar.h.transpose(),
                        variance: [scalar.variance],
                        believed: [[Some(main)], [sub]],
                    });
                }
            }
        }
    }

    /// Largest difference of dP by the two ways: of all states in the sub-filter's sigmas, and of the
    /// largest variance of the position in the horizontal plane as a part of itself.
    fn apart(&self) -> [f64; 2] {
        let p00 = dense_filter(&self.main).p;
        let mut largest = [0.0_f64; 2];
        for (without, nested) in &self.nested {
            let p0n = dense_filter(self.bank.sub_filter(*without, &self.sub).unwrap()).p;
            let (ours, theirs) = (p0n - p00, nested.separation());
            let sigma: SVector<f64, STATES> = p0n.diagonal().map(f64::sqrt);
            let scale: Covariance = sigma * sigma.transpose();
            let states = (ours - theirs).component_div(&scale).amax();
            let horizontal = |p: &Covariance| {
                let position = p.fixed_view::<3, 3>(0, 0).into_owned();
                variances(&position, &self.flight.c_enu_e())[0]
            };
            let position = (horizontal(&ours) / horizontal(&theirs) - 1.0).abs();
            largest = [largest[0].max(states), largest[1].max(position)];
        }
        largest
    }
}

/// Satellites appear at different times, so that sub-filters begin as copies, and some vanish and are held.
/// INT-025.
#[test]
fn the_difference_of_covariances_is_the_covariance_of_the_difference() {
    let mut largest = [0.0_f64; 2];
    for seed in 0..8 {
        let satellites = 6 + seed as usize;
        let mut bench = Bench::new(seed, satellites);
        bench.flight.toggle(satellites - 1);
        for epoch in 0..60 {
            if [7, 25, 40].contains(&epoch) {
                bench.flight.toggle(satellites - 1);
            }
            bench.epoch(None);
            let apart = bench.apart();
            largest = [largest[0].max(apart[0]), largest[1].max(apart[1])];
        }
        assert_eq!(bench.nested.len(), satellites);
    }
    println!("{largest:?}");
    assert!(largest[0] < 1e-9);
    assert!(largest[1] < 1e-9);
}

/// With a gain that is not optimal the cross-covariance cannot be left out.
/// INT-025.
#[test]
fn a_robust_gain_breaks_the_difference() {
    let mut bench = Bench::new(1, 7);
    let robust = Some(bench.flight.sky[0].satellite);
    for _ in 0..60 {
        bench.epoch(robust);
    }
    let [states, position] = bench.apart();
    println!("{states} {position}");
    assert!(states > 0.1 && position > 0.1);
}
