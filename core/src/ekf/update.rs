//! The measurement update: a whole epoch in at most M scalar steps, whatever the number of satellites.
//!
//! In: [`EpochInformation`]. Out: the filter's state and covariance after it, and what it says of the
//! innovations.
//!
//! Λ = Σ_q e_q u_q u_qᵀ is factored from the last pivot (u_q has entries 0..=q, the last is 1), y likewise
//! into Σ_q u_q η_q: M independent scalar measurements of u_qᵀx with information e_q. Where rank is
//! missing a pivot is zero and its measurement says nothing. They are taken one after the other on the
//! joint block G of the covariance,
//!
//! ```text
//! v_q = P_q u_q = P z_q,   z_q = u_q − Σ_{p<q} z_p (v_pᵀ u_q)/s_p,   1/s_q = e_q / (1 + e_q u_qᵀ v_q)
//! ```
//!
//! and then once on everything else: P ← P − Σ_q v_q v_qᵀ / s_q, x ← x + Σ_q v_q ν_q / s_q. No square
//! root, no inverse, no branch on rank in the second half. Derivation and the comparison with other
//! forms: docs/decisions/005-tight-filter.md. Equations replaced: [P0] (11)-(13). Cost: about 7,000
//! instructions on a Cortex-M7 with M = 8.

#![expect(
    clippy::indexing_slicing,
    reason = "indices are below M by the loops' bounds; the no-panic image is the judge"
)]

use super::filter::Filter;
use super::information::EpochInformation;
use super::layout::{BLOCKS, JOINT_NAVIGATION, POSITION, VELOCITY, pair};
use crate::linalg::block3::{Block, Symmetric, full};

/// A pivot below this part of its diagonal entry is rounding: M sums of products of f64 carry about
/// 1e-15 of it.
const RANK_TOLERANCE: f64 = 1.0e-13;

/// Vectors of one block of states, one per scalar measurement.
type BlockVectors<const M: usize> = [[f64; 3]; M];

/// What an update needs besides the filter; owned by the caller and shared by all filters.
#[derive(Clone, Debug)]
pub struct UpdateWorkspace<const K: usize, const M: usize> {
    /// Λ, then its factor: column q holds u_q.
    factor: [[f64; M]; M],
    /// e_q.
    information: [f64; M],
    /// e_q times the scalar measurement, later ν_q/s_q.
    weighted: [f64; M],
    /// G by rows.
    joint: [[f64; M]; M],
    /// z_q by rows.
    combination: [[f64; M]; M],
    /// v_q by rows, on the joint block.
    direction: [[f64; M]; M],
    /// 1/s_q.
    precision: [f64; M],
    /// v_q of each block of states.
    vectors: [BlockVectors<M>; BLOCKS],
    /// v_q/s_q of each block of states.
    gains: [BlockVectors<M>; BLOCKS],
    /// v_q/s_q of each clock state.
    clock_gains: [[f64; M]; K],
}

impl<const K: usize, const M: usize> UpdateWorkspace<K, M> {
    /// Ready.
    pub const EMPTY: Self = Self {
        factor: [[0.0; M]; M],
        information: [0.0; M],
        weighted: [0.0; M],
        joint: [[0.0; M]; M],
        combination: [[0.0; M]; M],
        direction: [[0.0; M]; M],
        precision: [0.0; M],
        vectors: [[[0.0; 3]; M]; BLOCKS],
        gains: [[[0.0; 3]; M]; BLOCKS],
        clock_gains: [[0.0; M]; K],
    };
}

/// What an update says of the measurements it took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UpdateSummary {
    /// Normalised innovation squared: νᵀ S⁻¹ ν of all rows, 1. Chi-square with `rows` degrees of freedom
    /// for a consistent filter.
    pub nis: f64,
    /// Measurements taken.
    pub rows: u32,
}

impl<const K: usize, const M: usize> Filter<K, M> {
    /// Takes an epoch's measurements.
    #[inline(never)]
    pub fn update(
        &mut self,
        information: &EpochInformation<M>,
        workspace: &mut UpdateWorkspace<K, M>,
    ) -> UpdateSummary {
        let explained = factorise(information, workspace);
        self.joint_block(&mut workspace.joint);
        let joint_state = self.joint_state();
        let taken = combine(workspace, joint_state);
        self.downdate(workspace);
        let unexplained = information.weighted_square - explained;
        UpdateSummary {
            nis: taken + if unexplained > 0.0 { unexplained } else { 0.0 },
            rows: information.rows,
        }
    }

    /// G: the covariance of position, velocity and clocks.
    #[inline(never)]
    fn joint_block(&self, joint: &mut [[f64; M]; M]) {
        let position = full(&self.covariance.diagonal[POSITION]);
        let velocity = full(&self.covariance.diagonal[VELOCITY]);
        let both = &self.covariance.off_diagonal[pair(POSITION, VELOCITY)];
        for i in 0..3 {
            for j in 0..3 {
                joint[i][j] = position[3 * i + j];
                joint[i][3 + j] = both[3 * i + j];
                joint[3 + j][i] = both[3 * i + j];
                joint[3 + i][3 + j] = velocity[3 * i + j];
            }
            for k in 0..K {
                joint[i][JOINT_NAVIGATION + k] = self.cross[POSITION][k][i];
                joint[JOINT_NAVIGATION + k][i] = self.cross[POSITION][k][i];
                joint[3 + i][JOINT_NAVIGATION + k] = self.cross[VELOCITY][k][i];
                joint[JOINT_NAVIGATION + k][3 + i] = self.cross[VELOCITY][k][i];
            }
        }
        for k in 0..K {
            for l in 0..K {
                joint[JOINT_NAVIGATION + k][JOINT_NAVIGATION + l] = self.clock[k][l];
            }
        }
    }

    fn joint_state(&self) -> [f64; M] {
        let mut state = [0.0; M];
        for i in 0..3 {
            state[i] = self.state.navigation[POSITION][i];
            state[3 + i] = self.state.navigation[VELOCITY][i];
        }
        for k in 0..K {
            state[JOINT_NAVIGATION + k] = self.state.clock[k];
        }
        state
    }

    /// P ← P − Σ v_q v_qᵀ / s_q, x ← x + Σ v_q ν_q / s_q.
    #[inline(never)]
    fn downdate(&mut self, workspace: &mut UpdateWorkspace<K, M>) {
        let UpdateWorkspace {
            combination,
            direction,
            precision,
            weighted,
            vectors,
            gains,
            clock_gains,
            ..
        } = workspace;
        for block in 0..BLOCKS {
            if block <= VELOCITY {
                for q in 0..M {
                    for i in 0..3 {
                        vectors[block][q][i] = direction[q][3 * block + i];
                    }
                }
            } else {
                block_vectors(
                    &self.covariance.off_diagonal[pair(POSITION, block)],
                    &self.covariance.off_diagonal[pair(VELOCITY, block)],
                    &self.cross[block],
                    combination,
                    &mut vectors[block],
                );
            }
            scale(&vectors[block], precision, &mut gains[block]);
            add_weighted(&vectors[block], weighted, &mut self.state.navigation[block]);
        }
        for k in 0..K {
            for q in 0..M {
                let v = direction[q][JOINT_NAVIGATION + k];
                clock_gains[k][q] = v * precision[q];
                self.state.clock[k] += v * weighted[q];
            }
        }
        for a in 0..BLOCKS {
            subtract_symmetric(&mut self.covariance.diagonal[a], &vectors[a], &gains[a]);
            for b in a + 1..BLOCKS {
                subtract(
                    &mut self.covariance.off_diagonal[pair(a, b)],
                    &vectors[a],
                    &gains[b],
                );
            }
            for (column, gain) in self.cross[a].iter_mut().zip(clock_gains.iter()) {
                subtract_column(column, &vectors[a], gain);
            }
        }
        for k in 0..K {
            for l in k..K {
                let mut sum = self.clock[k][l];
                for q in 0..M {
                    sum -= direction[q][JOINT_NAVIGATION + k] * clock_gains[l][q];
                }
                self.clock[k][l] = sum;
                self.clock[l][k] = sum;
            }
        }
    }
}

/// Factors Λ and y into scalar measurements; returns how much of zᵀ R⁻¹ z they explain.
#[inline(never)]
fn factorise<const K: usize, const M: usize>(
    information: &EpochInformation<M>,
    workspace: &mut UpdateWorkspace<K, M>,
) -> f64 {
    let UpdateWorkspace {
        factor,
        information: pivots,
        weighted,
        ..
    } = workspace;
    *factor = information.matrix;
    *weighted = information.vector;
    let mut explained = 0.0;
    for q in (0..M).rev() {
        let pivot = factor[q][q];
        factor[q][q] = 1.0;
        if !(pivot > RANK_TOLERANCE * information.matrix[q][q]) {
            pivots[q] = 0.0;
            weighted[q] = 0.0;
            continue;
        }
        pivots[q] = pivot;
        let inverse = 1.0 / pivot;
        explained += weighted[q] * weighted[q] * inverse;
        for p in 0..q {
            let u = factor[p][q] * inverse;
            for s in 0..=p {
                factor[s][p] -= u * factor[s][q];
            }
            weighted[p] -= u * weighted[q];
        }
        for p in 0..q {
            factor[p][q] *= inverse;
        }
    }
    explained
}

/// Takes the scalar measurements on the joint block: fills z_q, v_q, 1/s_q, ν_q/s_q. Returns
/// Σ ν_q² / s_q.
#[inline(never)]
fn combine<const K: usize, const M: usize>(
    workspace: &mut UpdateWorkspace<K, M>,
    mut state: [f64; M],
) -> f64 {
    let UpdateWorkspace {
        factor,
        information,
        weighted,
        joint,
        combination,
        direction,
        precision,
        ..
    } = workspace;
    let mut taken = 0.0;
    for q in 0..M {
        let mut z = [0.0; M];
        for p in 0..=q {
            z[p] = factor[p][q];
        }
        for p in 0..q {
            let mut along = 0.0;
            for s in 0..=q {
                along += direction[p][s] * factor[s][q];
            }
            let part = along * precision[p];
            for s in 0..=p {
                z[s] -= part * combination[p][s];
            }
        }
        let mut v = [0.0; M];
        for p in 0..=q {
            for s in 0..M {
                v[s] += joint[p][s] * z[p];
            }
        }
        let mut variance = 0.0;
        let mut predicted = 0.0;
        for s in 0..=q {
            variance += factor[s][q] * v[s];
            predicted += factor[s][q] * state[s];
        }
        let scale = 1.0 / (1.0 + information[q] * variance);
        let innovation = weighted[q] - information[q] * predicted;
        precision[q] = information[q] * scale;
        weighted[q] = innovation * scale;
        if information[q] > 0.0 {
            taken += innovation * weighted[q] / information[q];
        }
        for s in 0..M {
            state[s] += v[s] * weighted[q];
        }
        combination[q] = z;
        direction[q] = v;
    }
    taken
}

/// v_q of a block of states that no measurement touches itself.
#[inline(never)]
fn block_vectors<const K: usize, const M: usize>(
    position: &Block,
    velocity: &Block,
    clocks: &[[f64; 3]; K],
    combination: &[[f64; M]; M],
    vectors: &mut BlockVectors<M>,
) {
    for (q, vector) in vectors.iter_mut().enumerate() {
        let z = &combination[q];
        let mut sum = [0.0; 3];
        for p in 0..3 {
            for i in 0..3 {
                // The blocks are stored with the measured state first.
                sum[i] += position[3 * p + i] * z[p];
            }
        }
        if q >= 3 {
            for p in 0..3 {
                for i in 0..3 {
                    sum[i] += velocity[3 * p + i] * z[3 + p];
                }
            }
        }
        if q >= JOINT_NAVIGATION {
            for k in 0..K {
                for i in 0..3 {
                    sum[i] += clocks[k][i] * z[JOINT_NAVIGATION + k];
                }
            }
        }
        *vector = sum;
    }
}

#[inline(never)]
fn scale<const M: usize>(
    vectors: &BlockVectors<M>,
    precision: &[f64; M],
    gains: &mut BlockVectors<M>,
) {
    for ((gain, vector), precision) in gains.iter_mut().zip(vectors).zip(precision) {
        for (gain, entry) in gain.iter_mut().zip(vector) {
            *gain = entry * precision;
        }
    }
}

#[inline(never)]
fn add_weighted<const M: usize>(
    vectors: &BlockVectors<M>,
    weighted: &[f64; M],
    state: &mut [f64; 3],
) {
    let mut sum = *state;
    for (vector, weight) in vectors.iter().zip(weighted) {
        for i in 0..3 {
            sum[i] += vector[i] * weight;
        }
    }
    *state = sum;
}

/// `p -= Σ v_q g_qᵀ`.
#[inline(never)]
fn subtract<const M: usize>(p: &mut Block, vectors: &BlockVectors<M>, gains: &BlockVectors<M>) {
    let mut sum = *p;
    for (v, g) in vectors.iter().zip(gains) {
        for i in 0..3 {
            for j in 0..3 {
                sum[3 * i + j] -= v[i] * g[j];
            }
        }
    }
    *p = sum;
}

#[inline(never)]
fn subtract_symmetric<const M: usize>(
    p: &mut Symmetric,
    vectors: &BlockVectors<M>,
    gains: &BlockVectors<M>,
) {
    let [mut xx, mut xy, mut xz, mut yy, mut yz, mut zz] = *p;
    for ([x, y, z], [gx, gy, gz]) in vectors.iter().zip(gains) {
        xx -= x * gx;
        xy -= x * gy;
        xz -= x * gz;
        yy -= y * gy;
        yz -= y * gz;
        zz -= z * gz;
    }
    *p = [xx, xy, xz, yy, yz, zz];
}

#[inline(never)]
fn subtract_column<const M: usize>(
    column: &mut [f64; 3],
    vectors: &BlockVectors<M>,
    gain: &[f64; M],
) {
    let mut sum = *column;
    for (vector, gain) in vectors.iter().zip(gain) {
        for i in 0..3 {
            sum[i] -= vector[i] * gain;
        }
    }
    *column = sum;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ekf::dense::{self, K, M, Matrix, Noise, Vector, random_filter};
    use crate::ekf::information::MeasurementRow;

    fn random_row(noise: &mut Noise, weight: f64) -> MeasurementRow<M> {
        MeasurementRow {
            pseudorange: core::array::from_fn(|_| noise.next()),
            innovation_m: noise.next(),
            weight,
            range_rate: core::array::from_fn(|_| noise.next()),
            innovation_mps: noise.next(),
            range_rate_weight: 0.5 * weight,
        }
    }

    /// One scalar update after the other with the textbook's gain, and its NIS.
    fn textbook(p: &mut Matrix, x: &mut Vector, row: &MeasurementRow<M>) -> f64 {
        let mut nis = 0.0;
        for (design, z, weight) in [
            (&row.pseudorange, row.innovation_m, row.weight),
            (&row.range_rate, row.innovation_mps, row.range_rate_weight),
        ] {
            let mut h = Vector::zeros();
            for i in 0..6 {
                h[i] = design[i];
            }
            for k in 0..K {
                h[15 + k] = design[6 + k];
            }
            let s = (h.transpose() * *p * h)[0] + 1.0 / weight;
            let gain = *p * h / s;
            let innovation = z - h.dot(x);
            *x += gain * innovation;
            *p -= gain * h.transpose() * *p;
            nis += innovation * innovation / s;
        }
        nis
    }

    #[test]
    fn an_update_is_that_of_one_measurement_after_the_other() {
        let mut noise = Noise(3);
        for satellites in 0..=12 {
            let mut filter = random_filter(&mut noise);
            let (mut p, mut x) = (dense::covariance(&filter), dense::state(filter.state()));
            let mut information = EpochInformation::ZERO;
            let mut nis = 0.0;
            for _ in 0..satellites {
                let row = random_row(&mut noise, 3.0);
                information.add_row(&row);
                nis += textbook(&mut p, &mut x, &row);
            }
            let mut workspace = UpdateWorkspace::<K, M>::EMPTY;
            let summary = filter.update(&information, &mut workspace);
            assert!((dense::covariance(&filter) - p).amax() < 1e-12);
            assert!((dense::state(filter.state()) - x).amax() < 1e-12);
            assert!((summary.nis - nis).abs() < 1e-10, "{satellites}");
            assert_eq!(summary.rows, 2 * satellites);
        }
    }

    #[test]
    fn sums_of_satellites_are_the_epoch() {
        let mut noise = Noise(4);
        let mut parts = [EpochInformation::<M>::ZERO, EpochInformation::ZERO];
        let mut whole = EpochInformation::ZERO;
        for i in 0..8 {
            let row = random_row(&mut noise, 1.0 + i as f64);
            parts[i % 2].add_row(&row);
            whole.add_row(&row);
        }
        let [mut sum, odd] = parts;
        sum.add(&odd);
        for (a, b) in sum
            .matrix
            .iter()
            .flatten()
            .zip(whole.matrix.iter().flatten())
        {
            assert!((a - b).abs() < 1e-14);
        }
        assert_eq!(sum.rows(), 16);
    }
}
