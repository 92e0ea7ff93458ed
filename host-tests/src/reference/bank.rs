//! The bank by the textbook: each filter dense, on its own, updated with one measurement after the other
//! of the satellites it keeps.
//!
//! A filter is named by the satellites it leaves out: none, one or two of them.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, SMatrix, SVector};
use surefix_core::gnss::Satellite;

use super::filter::{DenseFilter, Row, STATES};
use super::navigator::upper_quantile;
use crate::scenario::folder::SAME_TIME_S;

/// Variance of a separation below which there is nothing to test, m².
pub const MIN_VARIANCE: f64 = 1e-10;

/// A satellite of an epoch and its measurements in their order.
pub type Observed<const N: usize = STATES> = (Satellite, Vec<Row<N>>);

/// Probabilities of the tests and levels, see `init.csv`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Risks {
    /// False alert per sample.
    pub p_fa: f64,
    /// Missed detection.
    pub p_md: f64,
    /// Fault-free integrity risk.
    pub p_h0: f64,
    /// Test the vertical separation too.
    pub vertical: bool,
}

/// The test of one satellite, horizontal and vertical, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Test {
    /// Which.
    pub satellite: Satellite,
    /// d.
    pub statistic: [f64; 2],
    /// T; 0 where there is nothing to test.
    pub threshold: [f64; 2],
    /// a.
    pub uncertainty: [f64; 2],
}

/// All tests of an epoch and what follows from them.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// In the order of first use.
    pub tests: Vec<Test>,
    /// A test failed.
    pub detected: bool,
    /// The satellite singled out.
    pub isolated: Option<Satellite>,
    /// max (T + a), horizontal and vertical, m.
    pub level: [f64; 2],
    /// Fault-free level, m.
    pub fault_free: [f64; 2],
}

/// The bank.
#[derive(Clone, Debug)]
pub struct Bank<const N: usize = STATES> {
    /// By the satellites left out, in ascending order.
    filters: BTreeMap<Vec<Satellite>, DenseFilter<N>>,
    /// In the order of first use, with the first epoch missed.
    members: Vec<(Satellite, Option<f64>)>,
    excluded: Vec<Satellite>,
}

/// The name of the filter without some satellites and one more.
fn and(without: &[Satellite], more: Satellite) -> Vec<Satellite> {
    let mut name = without.to_vec();
    name.push(more);
    name.sort();
    name
}

/// Largest variance in the horizontal plane, and the vertical one.
pub fn variances(p_e: &Matrix3<f64>, c_enu_e: &Matrix3<f64>) -> [f64; 2] {
    let enu = c_enu_e * p_e * c_enu_e.transpose();
    let mean = (enu[(0, 0)] + enu[(1, 1)]) / 2.0;
    let half = (enu[(0, 0)] - enu[(1, 1)]) / 2.0;
    [mean + half.hypot(enu[(0, 1)]), enu[(2, 2)]]
}

fn position<const N: usize>(p: &SMatrix<f64, N, N>) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| p[(i, j)])
}

fn sigma(variance: f64) -> f64 {
    if variance > MIN_VARIANCE {
        variance.sqrt()
    } else {
        0.0
    }
}

impl<const N: usize> Bank<N> {
    /// One filter and no satellite.
    pub fn new(main: DenseFilter<N>) -> Self {
        Self {
            filters: BTreeMap::from([(Vec::new(), main)]),
            members: Vec::new(),
            excluded: Vec::new(),
        }
    }

    /// The filter without these satellites, in any order.
    ///
    /// # Panics
    /// When the bank has none.
    pub fn filter(&self, without: &[Satellite]) -> &DenseFilter<N> {
        let mut name = without.to_vec();
        name.sort();
        &self.filters[&name]
    }

    /// Satellites in the order of first use.
    pub fn members(&self) -> Vec<Satellite> {
        self.members
            .iter()
            .map(|(satellite, _)| *satellite)
            .collect()
    }

    /// Satellites excluded, in their order.
    pub fn excluded(&self) -> &[Satellite] {
        &self.excluded
    }

    /// Predicts every filter.
    pub fn predict(&mut self, phi: &SMatrix<f64, N, N>, q: &SMatrix<f64, N, N>) {
        for filter in self.filters.values_mut() {
            filter.predict(phi, q);
        }
    }

    /// Births and deaths of an epoch.
    pub fn admit(&mut self, t: f64, present: &[Satellite], hold: f64) {
        for (satellite, missing) in &mut self.members {
            if present.contains(satellite) {
                *missing = None;
            } else {
                missing.get_or_insert(t);
            }
        }
        let dies = |since: &Option<f64>| since.is_some_and(|since| t - since >= hold - SAME_TIME_S);
        let dead = self.members.iter().filter(|(_, since)| dies(since));
        let dead: Vec<Satellite> = dead.map(|(satellite, _)| *satellite).collect();
        self.members
            .retain(|(satellite, _)| !dead.contains(satellite));
        self.filters
            .retain(|without, _| without.iter().all(|satellite| !dead.contains(satellite)));
        for satellite in present {
            if self.excluded.contains(satellite) || self.members().contains(satellite) {
                continue;
            }
            let copies: Vec<_> = self
                .filters
                .iter()
                .filter(|(without, _)| without.len() < 2)
                .map(|(without, filter)| (and(without, *satellite), filter.clone()))
                .collect();
            self.filters.extend(copies);
            self.members.push((*satellite, None));
        }
    }

    /// Updates every filter with the satellites it keeps.
    pub fn update(&mut self, observed: &[Observed<N>]) {
        for (without, filter) in &mut self.filters {
            for (satellite, rows) in observed {
                if without.contains(satellite) || self.excluded.contains(satellite) {
                    continue;
                }
                for row in rows {
                    filter.update(row);
                }
            }
        }
    }

    fn test_of(
        &self,
        of: &[Satellite],
        more: Satellite,
        k: [f64; 2],
        c_enu_e: &Matrix3<f64>,
    ) -> Test {
        let (all, less) = (self.filter(of), self.filter(&and(of, more)));
        let d = all.x - less.x;
        let d = c_enu_e * nalgebra::Vector3::new(d[0], d[1], d[2]);
        let dp = variances(&position(&(less.p - all.p)), c_enu_e);
        let p = variances(&position(&less.p), c_enu_e);
        Test {
            satellite: more,
            statistic: [d.x.hypot(d.y), d.z.abs()],
            threshold: dp.map(|variance| sigma(variance) * k[0]),
            uncertainty: p.map(|variance| variance.sqrt() * k[1]),
        }
    }

    /// Tests and levels of the filters as they are.
    pub fn test(&self, risks: &Risks, c_enu_e: &Matrix3<f64>) -> Verdict {
        let members = self.members();
        let n = members.len() as f64;
        let axes = if risks.vertical { 2 } else { 1 };
        let fails = |test: &Test| {
            (0..axes).any(|axis| {
                test.threshold[axis] > 0.0 && test.statistic[axis] > test.threshold[axis]
            })
        };
        let k_md = upper_quantile(risks.p_md);
        let k_fa = upper_quantile(risks.p_fa / (2.0 * n));
        let tests: Vec<Test> = members
            .iter()
            .map(|satellite| self.test_of(&[], *satellite, [k_fa, k_md], c_enu_e))
            .collect();
        let level = [0, 1].map(|axis| {
            let levels = tests
                .iter()
                .map(|t| t.threshold[axis] + t.uncertainty[axis]);
            levels.fold(0.0, f64::max)
        });
        let detected = tests.iter().any(fails);
        let k_fa = upper_quantile(risks.p_fa / (2.0 * (n - 1.0)));
        let mut quiet = members.iter().filter(|r| {
            detected
                && members
                    .iter()
                    .filter(|m| m != r)
                    .all(|m| !fails(&self.test_of(&[**r], *m, [k_fa, 0.0], c_enu_e)))
        });
        let isolated = match (quiet.next(), quiet.next()) {
            (Some(only), None) => {
                let own = tests.iter().find(|test| test.satellite == *only);
                own.filter(|test| fails(test)).map(|test| test.satellite)
            }
            _ => None,
        };
        let k_h0 = upper_quantile(risks.p_h0 / 2.0);
        let main = position(&self.filter(&[]).p);
        Verdict {
            tests,
            detected,
            isolated,
            level,
            fault_free: variances(&main, c_enu_e).map(|variance| variance.sqrt() * k_h0),
        }
    }

    /// Leaves a satellite out from now on.
    pub fn exclude(&mut self, satellite: Satellite) {
        self.members.retain(|(member, _)| *member != satellite);
        self.excluded.push(satellite);
        let before = std::mem::take(&mut self.filters);
        let members = self.members();
        let mut put = |without: &[Satellite], like: &[Satellite]| {
            let mut name = without.to_vec();
            name.sort();
            self.filters.insert(name, before[like].clone());
        };
        put(&[], &[satellite]);
        for (k, n) in members.iter().enumerate() {
            put(&[*n], &and(&[satellite], *n));
            // The new secondaries are copies of the new sub-filters.
            for m in &members[k + 1..] {
                put(&[*n, *m], &and(&[satellite], *n));
            }
        }
    }

    /// The nominal was corrected by this much.
    pub fn rereference(&mut self, correction: &SVector<f64, N>) {
        for filter in self.filters.values_mut() {
            filter.x -= correction;
        }
    }
}
