//! An epoch's measurements as information about position, velocity and clocks together.
//!
//! In: linearised rows. Out: Λ = Σ hᵀ h / σ² and y = Σ hᵀ z / σ² over the joint block of M = 6 + K
//! states. Sums of these are exact for any set of satellites, so that leaving some out needs no
//! subtraction: the sums without them are added up instead.
//!
//! | symbol | code       | shape | meaning                                                     |
//! |--------|------------|-------|-------------------------------------------------------------|
//! | Λ      | position … | M × M | symmetric, without the entries that are zero for any satellite |
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

use super::layout::{CLOCK_BIAS, CLOCK_DRIFT, FIRST_OFFSET, JOINT_NAVIGATION, MAX_JOINT};
use crate::gnss::CorrectedMeasurement;
use crate::linalg::block3::Symmetric;

/// Shortest distance to a satellite that a row is made of, m.
const MIN_RANGE_M: f64 = 1.0e6;

/// Joint entry of the clock bias.
pub(super) const BIAS: usize = JOINT_NAVIGATION + CLOCK_BIAS;
/// Joint entry of the clock drift.
pub(super) const DRIFT: usize = JOINT_NAVIGATION + CLOCK_DRIFT;
/// First joint entry of an offset between systems.
pub(super) const OFFSETS: usize = JOINT_NAVIGATION + FIRST_OFFSET;
/// Most of them.
const MAX_OFFSETS: usize = MAX_JOINT - OFFSETS;

/// Linearised rows of one satellite. A pseudorange does not depend on velocity and drift, and on one
/// offset at most; a range rate not on bias and offsets: these entries are not read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasurementRow<const M: usize> {
    /// Derivatives of the pseudorange.
    pub pseudorange: [f64; M],
    /// Predicted minus measured pseudorange, m.
    pub innovation_m: f64,
    /// 1/σ², 1/m²; 0 where none was measured.
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

    /// A measurement of the antenna's velocity along a direction (ECEF, length 1), as an aid gives it:
    /// `innovation_mps` predicted minus measured. No pseudorange, no clock.
    ///
    /// `None` where a number is none or sigma is not positive.
    pub fn of_velocity(direction_e: [f64; 3], innovation_mps: f64, sigma_mps: f64) -> Option<Self> {
        let range_rate_weight = 1.0 / (sigma_mps * sigma_mps);
        let is_known = sigma_mps > 0.0
            && range_rate_weight > 0.0
            && range_rate_weight.is_finite()
            && innovation_mps.is_finite()
            && direction_e.iter().all(|entry| entry.is_finite());
        if !is_known {
            return None;
        }
        let mut row = Self {
            innovation_mps,
            range_rate_weight,
            ..Self::ZERO
        };
        row.range_rate[3..JOINT_NAVIGATION].copy_from_slice(&direction_e);
        Some(row)
    }
}

/// What an epoch says about the joint block of position, velocity and clocks.
#[derive(Clone, Debug, PartialEq)]
pub struct EpochInformation<const M: usize> {
    /// Λ of the position with every entry.
    position: [[f64; 3]; M],
    /// Λ of the velocity with itself; with bias and offsets it is zero.
    velocity: Symmetric,
    /// Λ of the velocity with the drift.
    velocity_drift: [f64; 3],
    /// Λ of the drift with itself; with bias and offsets it is zero.
    drift: f64,
    /// Λ of the bias with itself.
    bias: f64,
    /// Λ of the bias with each offset.
    bias_offset: [f64; MAX_OFFSETS],
    /// Λ of each offset with itself; with the others it is zero.
    offset: [f64; MAX_OFFSETS],
    /// y.
    pub(super) vector: [f64; M],
    /// zᵀ R⁻¹ z.
    pub(super) weighted_square: f64,
    pub(super) rows: u32,
}

impl<const M: usize> EpochInformation<M> {
    const SIZE_FITS: () = assert!(M >= OFFSETS && M <= MAX_JOINT);

    /// No measurement.
    pub const ZERO: Self = {
        let () = Self::SIZE_FITS;
        Self {
            position: [[0.0; 3]; M],
            velocity: [0.0; 6],
            velocity_drift: [0.0; 3],
            drift: 0.0,
            bias: 0.0,
            bias_offset: [0.0; MAX_OFFSETS],
            offset: [0.0; MAX_OFFSETS],
            vector: [0.0; M],
            weighted_square: 0.0,
            rows: 0,
        }
    };

    /// Forgets all measurements.
    pub fn clear(&mut self) {
        *self = Self::ZERO;
    }

    /// Adds a satellite.
    #[inline(never)]
    pub fn add_row(&mut self, row: &MeasurementRow<M>) {
        let (range, rate) = (&row.pseudorange, &row.range_rate);
        let (weight, rate_weight) = (row.weight, row.range_rate_weight);
        let weighted = [0, 1, 2].map(|i| weight * range[i]);
        let rate_weighted = [0, 1, 2].map(|i| rate_weight * rate[i]);
        let innovation = weight * row.innovation_m;
        let rate_innovation = rate_weight * row.innovation_mps;
        for s in 0..M {
            let of_range = s < 3 || s == BIAS || s >= OFFSETS;
            let of_rate = s < JOINT_NAVIGATION || s == DRIFT;
            for i in 0..3 {
                if of_range {
                    self.position[s][i] += weighted[i] * range[s];
                }
                if of_rate {
                    self.position[s][i] += rate_weighted[i] * rate[s];
                }
            }
            if of_range {
                self.vector[s] += innovation * range[s];
            }
            if of_rate {
                self.vector[s] += rate_innovation * rate[s];
            }
        }
        self.add_velocity(rate, rate_weight);
        let bias = weight * range[BIAS];
        self.bias += bias * range[BIAS];
        for k in 0..M - OFFSETS {
            let offset = range[OFFSETS + k];
            self.bias_offset[k] += bias * offset;
            self.offset[k] += weight * offset * offset;
        }
        self.weighted_square +=
            innovation * row.innovation_m + rate_innovation * row.innovation_mps;
        let rows = u32::from(weight > 0.0) + u32::from(rate_weight > 0.0);
        self.rows = self.rows.wrapping_add(rows);
    }

    /// A range rate's part of what velocity and drift know of themselves.
    #[inline(always)]
    fn add_velocity(&mut self, rate: &[f64; M], weight: f64) {
        let [x, y, z] = [3, 4, 5].map(|s| rate[s]);
        let (wx, wy, wz) = (weight * x, weight * y, weight * z);
        let entries = [wx * x, wx * y, wx * z, wy * y, wy * z, wz * z];
        for k in 0..6 {
            self.velocity[k] += entries[k];
        }
        let drift = rate[DRIFT];
        for (sum, weighted) in self.velocity_drift.iter_mut().zip([wx, wy, wz]) {
            *sum += weighted * drift;
        }
        self.drift += weight * drift * drift;
    }

    /// Becomes what two sets of satellites say together; they must not share any.
    #[inline(never)]
    pub fn set_sum(&mut self, a: &Self, b: &Self) {
        for s in 0..M {
            self.position[s] = sum_of(&a.position[s], &b.position[s]);
        }
        self.velocity = sum_of(&a.velocity, &b.velocity);
        self.velocity_drift = sum_of(&a.velocity_drift, &b.velocity_drift);
        self.drift = a.drift + b.drift;
        self.bias = a.bias + b.bias;
        for k in 0..M - OFFSETS {
            self.bias_offset[k] = a.bias_offset[k] + b.bias_offset[k];
            self.offset[k] = a.offset[k] + b.offset[k];
        }
        self.vector = sum_of(&a.vector, &b.vector);
        self.weighted_square = a.weighted_square + b.weighted_square;
        self.rows = a.rows.wrapping_add(b.rows);
    }

    /// Adds all that another set of satellites says; the sets must not share any.
    #[inline(never)]
    pub fn add(&mut self, other: &Self) {
        for s in 0..M {
            self.position[s] = sum_of(&self.position[s], &other.position[s]);
        }
        self.velocity = sum_of(&self.velocity, &other.velocity);
        self.velocity_drift = sum_of(&self.velocity_drift, &other.velocity_drift);
        self.drift += other.drift;
        self.bias += other.bias;
        for k in 0..M - OFFSETS {
            self.bias_offset[k] += other.bias_offset[k];
            self.offset[k] += other.offset[k];
        }
        self.vector = sum_of(&self.vector, &other.vector);
        self.weighted_square += other.weighted_square;
        self.rows = self.rows.wrapping_add(other.rows);
    }

    /// Row `j` of velocity and drift: of Λ with the position and with those up to itself, and of y.
    #[inline(always)]
    pub(super) fn rate_row(&self, j: usize) -> ([f64; 3], [f64; 4], f64) {
        let [xx, xy, xz, yy, yz, zz] = self.velocity;
        let [dx, dy, dz] = self.velocity_drift;
        let rows = [
            [xx, 0.0, 0.0, 0.0],
            [xy, yy, 0.0, 0.0],
            [xz, yz, zz, 0.0],
            [dx, dy, dz, self.drift],
        ];
        let at = if j < 3 { 3 + j } else { DRIFT };
        (self.position[at], rows[j], self.vector[at])
    }

    /// Row `q` of position, bias and offsets: of Λ up to itself, and of y.
    #[inline(always)]
    pub(super) fn range_row(&self, q: usize) -> ([f64; 3 + 1 + MAX_OFFSETS], f64) {
        let mut row = [0.0; 3 + 1 + MAX_OFFSETS];
        let at = match q {
            0..3 => q,
            3 => BIAS,
            _ => OFFSETS + q - 4,
        };
        let [x, y, z] = self.position[at];
        (row[0], row[1], row[2]) = (x, y, z);
        if q == 3 {
            row[3] = self.bias;
        } else if q > 3 {
            row[3] = self.bias_offset[q - 4];
            row[q] = self.offset[q - 4];
        }
        (row, self.vector[at])
    }

    /// Measurements in it: pseudoranges and range rates.
    pub const fn rows(&self) -> u32 {
        self.rows
    }
}

#[inline(always)]
fn sum_of<const N: usize>(a: &[f64; N], b: &[f64; N]) -> [f64; N] {
    let mut sum = *a;
    for (sum, b) in sum.iter_mut().zip(b) {
        *sum += b;
    }
    sum
}
