//! How a satellite that was excluded proves itself.
//!
//! In: what each excluded satellite measures against what the main filter, which does not use it, predicts.
//! Out: a satellite that has agreed for [`PROOF_NS`] without a break. What it costs to take it back is its
//! prior probability in the levels (`FaultPriors::readmitted`): who failed once is likelier to fail again.

use heapless::Vec;

use crate::consts::MAX_SATELLITES;
use crate::ekf::layout::{JOINT_NAVIGATION, POSITION};
use crate::ekf::{Filter, MeasurementRow};
use crate::gnss::Satellite;
use crate::time::{GpsTime, NS_PER_S};

/// How long a satellite must agree, ns.
pub const PROOF_NS: i64 = 300 * NS_PER_S;
/// Longest break between two epochs with it, ns.
const MAX_BREAK_NS: i64 = 60 * NS_PER_S;
/// It agrees when its residual is within this many sigmas.
const MAX_SIGMAS: f64 = 3.0;

/// Who is on probation. Satellites that are not seen for long begin again when they come.
#[derive(Clone, Debug)]
pub struct Probation {
    records: Vec<Record, MAX_SATELLITES>,
}

#[derive(Clone, Copy, Debug)]
struct Record {
    satellite: Satellite,
    since: GpsTime,
    last: GpsTime,
}

impl Probation {
    /// Nobody.
    pub const EMPTY: Self = Self {
        records: Vec::new(),
    };

    /// Forgets everybody.
    pub fn clear(&mut self) {
        self.records.clear();
    }

    /// An excluded satellite was measured: `residual_m` against the main filter, with this variance if it is
    /// healthy. True when it has proved itself by now.
    pub fn observe(
        &mut self,
        now: GpsTime,
        satellite: Satellite,
        residual_m: f64,
        variance_m2: f64,
    ) -> bool {
        let agrees = residual_m * residual_m <= MAX_SIGMAS * MAX_SIGMAS * variance_m2;
        let found = self
            .records
            .iter_mut()
            .find(|record| record.satellite == satellite);
        let Some(record) = found else {
            if agrees {
                // More satellites than an epoch can hold are not on probation at once; one that finds no
                // room stays excluded.
                let _ = self.records.push(Record {
                    satellite,
                    since: now,
                    last: now,
                });
            }
            return false;
        };
        let is_broken = now.ns().saturating_sub(record.last.ns()) > MAX_BREAK_NS;
        if is_broken {
            record.since = now;
        }
        record.last = now;
        let proved = agrees && now.ns().saturating_sub(record.since.ns()) >= PROOF_NS;
        if proved || !agrees {
            self.records.retain(|record| record.satellite != satellite);
        }
        proved
    }
}

/// Variance of what a filter predicts for a pseudorange that it does not use, m².
pub fn predicted_variance<const K: usize, const M: usize>(
    row: &MeasurementRow<M>,
    filter: &Filter<K, M>,
) -> f64 {
    let [x, y, z, ..] = row.pseudorange.as_slice() else {
        return f64::NAN;
    };
    let [xx, xy, xz, yy, yz, zz] = filter.block(POSITION);
    let mut variance =
        x * x * xx + y * y * yy + z * z * zz + 2.0 * (x * y * xy + x * z * xz + y * z * yz);
    let clocks = || row.pseudorange.iter().skip(JOINT_NAVIGATION);
    for ((clock, h), covariances) in clocks().enumerate().zip(filter.clock_covariance()) {
        let [cx, cy, cz] = filter.clock_cross(POSITION, clock);
        let mut covariance = 2.0 * (x * cx + y * cy + z * cz);
        for (other, covariance_of) in clocks().zip(covariances) {
            covariance += other * covariance_of;
        }
        variance += h * covariance;
    }
    variance
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::System;

    /// INT-031.
    #[test]
    fn a_satellite_is_taken_back_after_it_agreed_without_a_break() {
        let satellite = Satellite::new(System::Gps, 4).unwrap();
        let at = |t_s: i64| GpsTime::from_ns(t_s * NS_PER_S);
        let mut probation = Probation::EMPTY;
        let proof_s = PROOF_NS / NS_PER_S;
        for t_s in 0..proof_s {
            assert!(!probation.observe(at(t_s), satellite, 2.9, 1.0));
        }
        // One disagreement begins it anew.
        assert!(!probation.observe(at(proof_s), satellite, -3.1, 1.0));
        for t_s in 0..proof_s {
            assert!(!probation.observe(at(1000 + t_s), satellite, 0.0, 1.0));
        }
        assert!(probation.observe(at(1000 + proof_s), satellite, 0.0, 1.0));
        // So does a break, and what is no number.
        assert!(!probation.observe(at(2000), satellite, 0.0, 1.0));
        assert!(!probation.observe(at(2000 + 2 * proof_s), satellite, 0.0, 1.0));
        assert!(!probation.observe(at(2001 + 2 * proof_s), satellite, f64::NAN, 1.0));
        assert!(!probation.observe(at(2002 + 2 * proof_s), satellite, 0.0, f64::NAN));
    }

    #[test]
    fn the_variance_of_a_prediction_is_the_quadratic_form() {
        let mut filter: Filter<2, 8> = Filter::EMPTY;
        let mut blocks = [[0.0; 6]; 5];
        blocks[POSITION] = [4.0, 1.0, 0.5, 3.0, -0.5, 2.0];
        filter.start(&blocks, &[9.0, 1.0]);
        let mut row = MeasurementRow::ZERO;
        row.pseudorange[..3].copy_from_slice(&[0.6, 0.0, 0.8]);
        row.pseudorange[JOINT_NAVIGATION] = 1.0;
        let expected = 0.36 * 4.0 + 0.64 * 2.0 + 2.0 * 0.48 * 0.5 + 9.0;
        assert!((predicted_variance(&row, &filter) - expected).abs() < 1e-12);
    }
}
