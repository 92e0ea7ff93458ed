//! An epoch's measurements as information about position, velocity and clocks together.
//!
//! In: linearised rows. Out: Λ = Σ hᵀ h / σ² and y = Σ hᵀ z / σ² over the joint block of M = 6 + K
//! states. Sums of these are exact for any set of satellites, so that leaving some out needs no
//! subtraction: the sums without them are added up instead.
//!
//! | symbol | code       | shape | meaning                                                     |
//! |--------|------------|-------|-------------------------------------------------------------|
//! | Λ      | matrix     | M × M | lower triangle                                              |
//! | y      | vector     | M     |                                                             |
//! | z      | innovation | 1     | predicted − measured, m or m/s                              |
//! | h      | design     | M     | derivative of the measurement by the states                 |
//!
//! Equations: [P0] (14)-(24); rows as docs/decisions/005-tight-filter.md, with the position term of the
//! range rate: pseudorange [e, 0, 1 and the offset's 1], range rate [(w − (e·w) e)/ρ, e, drift's 1] with
//! e = (r − r_s)/ρ, w = v − v_s.

#![expect(
    clippy::indexing_slicing,
    reason = "indices are below M by the loops' bounds; the no-panic image is the judge"
)]

use super::joint::{PerRow, for_each};
use super::layout::{CLOCK_BIAS, CLOCK_DRIFT, FIRST_OFFSET, JOINT_NAVIGATION};
use crate::gnss::CorrectedMeasurement;

/// Shortest distance to a satellite that a row is made of, m.
const MIN_RANGE_M: f64 = 1.0e6;

/// Linearised rows of one satellite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasurementRow<const M: usize> {
    /// Derivatives of the pseudorange.
    pub pseudorange: [f64; M],
    /// Predicted minus measured pseudorange, m.
    pub innovation_m: f64,
    /// 1/σ², 1/m².
    pub weight: f64,
    /// Derivatives of the range rate.
    pub range_rate: [f64; M],
    /// Predicted minus measured range rate, m/s; 0 where none was measured.
    pub innovation_mps: f64,
    /// 1/σ², s²/m²; 0 where no range rate was measured.
    pub range_rate_weight: f64,
}

impl<const M: usize> MeasurementRow<M> {
    /// No information.
    pub const ZERO: Self = Self {
        pseudorange: [0.0; M],
        innovation_m: 0.0,
        weight: 0.0,
        range_rate: [0.0; M],
        innovation_mps: 0.0,
        range_rate_weight: 0.0,
    };

    /// Linearises a measurement at an antenna position, velocity (ECEF) and clock; `offset` is the
    /// clock column of the satellite's constellation, if it has one of its own.
    ///
    /// `None` when no row comes of it: a sigma that is not positive, a number that is not one, a
    /// satellite nearer than 1000 km, a column that does not exist.
    pub fn new<const K: usize>(
        measurement: &CorrectedMeasurement,
        r_e_m: [f64; 3],
        v_e_mps: [f64; 3],
        clock: &[f64; K],
        offset: Option<usize>,
    ) -> Option<Self> {
        const { assert!(M == JOINT_NAVIGATION + K && K >= FIRST_OFFSET) };
        let [rx, ry, rz] = r_e_m;
        let [sx, sy, sz] = measurement.r_es_e_m;
        let d = [rx - sx, ry - sy, rz - sz];
        let range = libm::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        let sigma = measurement.sigma_pseudorange_m;
        if !(range > MIN_RANGE_M && range.is_finite() && sigma > 0.0 && sigma.is_finite()) {
            return None;
        }
        let e = [d[0] / range, d[1] / range, d[2] / range];
        let mut row = Self::ZERO;
        let mut predicted_m = range + clock[CLOCK_BIAS];
        row.pseudorange[..3].copy_from_slice(&e);
        row.pseudorange[JOINT_NAVIGATION + CLOCK_BIAS] = 1.0;
        if let Some(offset) = offset {
            if !(FIRST_OFFSET..K).contains(&offset) {
                return None;
            }
            predicted_m += clock[offset];
            row.pseudorange[JOINT_NAVIGATION + offset] = 1.0;
        }
        row.innovation_m = predicted_m - measurement.pseudorange_m;
        row.weight = 1.0 / (sigma * sigma);
        if !(row.innovation_m.is_finite() && row.weight.is_finite()) {
            return None;
        }
        if let Some((range_rate_mps, sigma)) = measurement.range_rate_mps {
            let [vx, vy, vz] = v_e_mps;
            let [ux, uy, uz] = measurement.v_es_e_mps;
            let w = [vx - ux, vy - uy, vz - uz];
            let along = e[0] * w[0] + e[1] * w[1] + e[2] * w[2];
            let innovation = along + clock[CLOCK_DRIFT] - range_rate_mps;
            let weight = 1.0 / (sigma * sigma);
            if !(sigma > 0.0 && weight.is_finite() && innovation.is_finite()) {
                return None;
            }
            for i in 0..3 {
                row.range_rate[i] = (w[i] - along * e[i]) / range;
                row.range_rate[3 + i] = e[i];
            }
            row.range_rate[JOINT_NAVIGATION + CLOCK_DRIFT] = 1.0;
            row.innovation_mps = innovation;
            row.range_rate_weight = weight;
        }
        Some(row)
    }
}

/// What an epoch says about the joint block of position, velocity and clocks.
#[derive(Clone, Debug, PartialEq)]
pub struct EpochInformation<const M: usize> {
    /// Λ, its lower triangle by rows.
    pub(super) matrix: [[f64; M]; M],
    /// y.
    pub(super) vector: [f64; M],
    /// zᵀ R⁻¹ z.
    pub(super) weighted_square: f64,
    pub(super) rows: u32,
}

impl<const M: usize> EpochInformation<M> {
    /// No measurement.
    pub const ZERO: Self = Self {
        matrix: [[0.0; M]; M],
        vector: [0.0; M],
        weighted_square: 0.0,
        rows: 0,
    };

    /// Forgets all measurements.
    pub fn clear(&mut self) {
        self.matrix = [[0.0; M]; M];
        self.vector = [0.0; M];
        self.weighted_square = 0.0;
        self.rows = 0;
    }

    /// Adds a satellite.
    #[inline(never)]
    pub fn add_row(&mut self, row: &MeasurementRow<M>) {
        self.add_scalar(&row.pseudorange, row.innovation_m, row.weight);
        if row.range_rate_weight > 0.0 {
            self.add_scalar(&row.range_rate, row.innovation_mps, row.range_rate_weight);
        }
    }

    #[inline(never)]
    fn add_scalar(&mut self, design: &[f64; M], innovation: f64, weight: f64) {
        for_each::<M>(&mut Scalar {
            matrix: &mut self.matrix,
            vector: &mut self.vector,
            design,
            weight,
            innovation,
        });
        self.weighted_square += weight * innovation * innovation;
        self.rows = self.rows.wrapping_add(1);
    }

    /// Adds all that another set of satellites says; the sets must not share any.
    #[inline(never)]
    pub fn add(&mut self, other: &Self) {
        for_each::<M>(&mut Sum { into: self, other });
        self.weighted_square += other.weighted_square;
        self.rows = self.rows.wrapping_add(other.rows);
    }

    /// Measurements in it: pseudoranges and range rates.
    pub const fn rows(&self) -> u32 {
        self.rows
    }
}

/// A scalar measurement that is added.
struct Scalar<'a, const M: usize> {
    matrix: &'a mut [[f64; M]; M],
    vector: &'a mut [f64; M],
    design: &'a [f64; M],
    weight: f64,
    innovation: f64,
}

impl<const M: usize> PerRow for Scalar<'_, M> {
    #[inline(always)]
    fn run<const I: usize>(&mut self) {
        let weighted = self.weight * self.design[I];
        for j in 0..I {
            self.matrix[I][j] += weighted * self.design[j];
        }
        self.matrix[I][I] += weighted * self.design[I];
        self.vector[I] += weighted * self.innovation;
    }
}

/// Another set of satellites that is added.
struct Sum<'a, const M: usize> {
    into: &'a mut EpochInformation<M>,
    other: &'a EpochInformation<M>,
}

impl<const M: usize> PerRow for Sum<'_, M> {
    #[inline(always)]
    fn run<const I: usize>(&mut self) {
        for j in 0..I {
            self.into.matrix[I][j] += self.other.matrix[I][j];
        }
        self.into.matrix[I][I] += self.other.matrix[I][I];
        self.into.vector[I] += self.other.vector[I];
    }
}
