//! The measurement update: a whole epoch in at most M scalar steps, whatever the number of satellites.
//!
//! In: [`EpochInformation`]. Out: the filter's state and covariance after it, and what it says of the
//! innovations.
//!
//! The scalar measurements are found and taken one after the other on the joint block of the covariance
//! (`joint.rs`), which gives of each a combination z_q, a precision 1/s_q and an innovation ν_q; and then
//! once on everything else:
//!
//! ```text
//! v_q = P z_q,   P ← P − Σ_q v_q v_qᵀ / s_q,   x ← x + Σ_q v_q ν_q / s_q
//! ```
//!
//! No square root, no inverse, no branch on rank. Derivation and the comparison with other forms:
//! docs/decisions/005-tight-filter.md. Equations replaced: [P0] (11)-(13). Cost: about 6,000
//! instructions on a Cortex-M7 with M = 8.

#![expect(
    clippy::indexing_slicing,
    reason = "indices are below M by the loops' bounds; the no-panic image is the judge"
)]

use super::filter::Filter;
use super::information::EpochInformation;
use super::joint::{JointWorkspace, PerMeasurement, for_each};
use super::layout::{
    BLOCKS, CLOCK_BIAS, CLOCK_DRIFT, FIRST_OFFSET, JOINT_NAVIGATION, POSITION, VELOCITY, pair,
};
use crate::linalg::block3::{Block, Symmetric, full};

/// Vectors of one block of states, one per scalar measurement.
type BlockVectors<const M: usize> = [[f64; 3]; M];

/// What an update needs besides the filter; owned by the caller and shared by all filters.
#[derive(Clone, Debug)]
pub struct UpdateWorkspace<const K: usize, const M: usize> {
    joint: JointWorkspace<M>,
    /// v_q of each block of states.
    vectors: [BlockVectors<M>; BLOCKS],
    /// v_q/s_q of each block of states.
    gains: [BlockVectors<M>; BLOCKS],
    /// v_q/s_q of clock bias and drift, and −ν_q/s_q: the columns that every filter has.
    common: BlockVectors<M>,
    /// v_q/s_q of each clock state.
    clock_gains: [[f64; M]; K],
}

impl<const K: usize, const M: usize> UpdateWorkspace<K, M> {
    /// Ready.
    pub const EMPTY: Self = Self {
        joint: JointWorkspace::EMPTY,
        vectors: [[[0.0; 3]; M]; BLOCKS],
        gains: [[[0.0; 3]; M]; BLOCKS],
        common: [[0.0; 3]; M],
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
        self.fill_joint(&mut workspace.joint);
        let nis = workspace.joint.take(information);
        self.fill_vectors(workspace);
        self.downdate_clocks(workspace);
        self.downdate(workspace);
        UpdateSummary {
            nis,
            rows: information.rows,
        }
    }

    /// Covariance and state of position, velocity and clocks.
    #[inline(never)]
    fn fill_joint(&self, joint: &mut JointWorkspace<M>) {
        let position = full(&self.covariance.diagonal[POSITION]);
        let velocity = full(&self.covariance.diagonal[VELOCITY]);
        let both = &self.covariance.off_diagonal[pair(POSITION, VELOCITY)];
        let (covariance, state) = (&mut joint.covariance, &mut joint.state);
        for i in 0..3 {
            for j in 0..3 {
                covariance[i][j] = position[3 * i + j];
                covariance[i][3 + j] = both[3 * i + j];
                covariance[3 + j][i] = both[3 * i + j];
                covariance[3 + i][3 + j] = velocity[3 * i + j];
            }
            for k in 0..K {
                covariance[i][JOINT_NAVIGATION + k] = self.cross[POSITION][k][i];
                covariance[JOINT_NAVIGATION + k][i] = self.cross[POSITION][k][i];
                covariance[3 + i][JOINT_NAVIGATION + k] = self.cross[VELOCITY][k][i];
                covariance[JOINT_NAVIGATION + k][3 + i] = self.cross[VELOCITY][k][i];
            }
            state[i] = self.state.navigation[POSITION][i];
            state[3 + i] = self.state.navigation[VELOCITY][i];
        }
        for k in 0..K {
            for l in 0..K {
                covariance[JOINT_NAVIGATION + k][JOINT_NAVIGATION + l] = self.clock[k][l];
            }
            state[JOINT_NAVIGATION + k] = self.state.clock[k];
        }
    }

    /// v_q of all blocks of states.
    #[inline(never)]
    fn fill_vectors(&self, workspace: &mut UpdateWorkspace<K, M>) {
        let UpdateWorkspace { joint, vectors, .. } = workspace;
        let [position, velocity, rest @ ..] = vectors;
        for ((p, v), direction) in position.iter_mut().zip(velocity).zip(&joint.direction) {
            for i in 0..3 {
                p[i] = direction[i];
                v[i] = direction[3 + i];
            }
        }
        for (block, vectors) in (VELOCITY + 1..).zip(rest) {
            block_vectors(
                &self.covariance.off_diagonal[pair(POSITION, block)],
                &self.covariance.off_diagonal[pair(VELOCITY, block)],
                &self.cross[block],
                &joint.combination,
                vectors,
            );
        }
    }

    /// The update of the clock states, and what the other blocks need of it.
    #[inline(never)]
    fn downdate_clocks(&mut self, workspace: &mut UpdateWorkspace<K, M>) {
        let UpdateWorkspace {
            joint,
            common,
            clock_gains,
            ..
        } = workspace;
        for k in 0..K {
            let mut state = self.state.clock[k];
            for q in 0..M {
                let v = joint.direction[q][JOINT_NAVIGATION + k];
                clock_gains[k][q] = v * joint.precision[q];
                state += v * joint.step[q];
            }
            self.state.clock[k] = state;
        }
        for q in 0..M {
            common[q] = [
                clock_gains[CLOCK_BIAS][q],
                clock_gains[CLOCK_DRIFT][q],
                -joint.step[q],
            ];
        }
        for k in 0..K {
            for l in k..K {
                let mut sum = self.clock[k][l];
                for q in 0..M {
                    sum -= joint.direction[q][JOINT_NAVIGATION + k] * clock_gains[l][q];
                }
                self.clock[k][l] = sum;
                self.clock[l][k] = sum;
            }
        }
    }

    /// P ← P − Σ v_q v_qᵀ / s_q, x ← x + Σ v_q ν_q / s_q of all blocks of states.
    #[inline(never)]
    fn downdate(&mut self, workspace: &mut UpdateWorkspace<K, M>) {
        let UpdateWorkspace {
            joint,
            vectors,
            gains,
            common,
            clock_gains,
        } = workspace;
        let blocks = self.covariance.diagonal.iter_mut().zip(&mut self.cross);
        let states = self.state.navigation.iter_mut();
        for (((diagonal, columns), state), (vectors, gains)) in
            blocks.zip(states).zip(vectors.iter().zip(gains.iter_mut()))
        {
            subtract_symmetric(diagonal, vectors, &joint.precision, gains);
            let (clock, offsets) = columns.split_at_mut(FIRST_OFFSET);
            if let [bias, drift] = clock {
                subtract_columns([bias, drift, state], vectors, common);
            }
            for (offset, gain) in offsets.iter_mut().zip(&clock_gains[FIRST_OFFSET..]) {
                subtract_column(offset, vectors, gain);
            }
        }
        let mut off_diagonal = self.covariance.off_diagonal.iter_mut();
        for (row, vectors) in vectors.iter().enumerate() {
            for gains in &gains[row + 1..] {
                if let Some(block) = off_diagonal.next() {
                    subtract(block, vectors, gains);
                }
            }
        }
    }
}

/// v_q of a block of states that no measurement touches itself.
struct BlockCombination<'a, const K: usize, const M: usize> {
    /// Covariance of a state with the joint block.
    row: [f64; M],
    combination: &'a [[f64; M]; M],
    vectors: &'a mut BlockVectors<M>,
    /// Which state of the block.
    state: usize,
}

impl<const K: usize, const M: usize> PerMeasurement for BlockCombination<'_, K, M> {
    #[inline(always)]
    fn run<const Q: usize>(&mut self) {
        let mut sum = 0.0;
        for s in 0..=Q {
            sum += self.row[s] * self.combination[Q][s];
        }
        self.vectors[Q][self.state] = sum;
    }
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
    for state in 0..3 {
        let mut row = [0.0; M];
        for i in 0..3 {
            // The blocks are stored with the measured state first.
            row[i] = position[3 * i + state];
            row[3 + i] = velocity[3 * i + state];
        }
        for k in 0..K {
            row[JOINT_NAVIGATION + k] = clocks[k][state];
        }
        for_each::<M>(&mut BlockCombination::<K, M> {
            row,
            combination,
            vectors,
            state,
        });
    }
}

/// `p -= Σ v_q v_qᵀ / s_q`; fills the gains v_q/s_q on the way.
#[inline(never)]
fn subtract_symmetric<const M: usize>(
    p: &mut Symmetric,
    vectors: &BlockVectors<M>,
    precision: &[f64; M],
    gains: &mut BlockVectors<M>,
) {
    let [mut xx, mut xy, mut xz, mut yy, mut yz, mut zz] = *p;
    for (([x, y, z], precision), gain) in vectors.iter().zip(precision).zip(gains) {
        let (gx, gy, gz) = (x * precision, y * precision, z * precision);
        xx -= x * gx;
        xy -= x * gy;
        xz -= x * gz;
        yy -= y * gy;
        yz -= y * gz;
        zz -= z * gz;
        *gain = [gx, gy, gz];
    }
    *p = [xx, xy, xz, yy, yz, zz];
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

/// The same of three columns that lie apart.
#[inline(never)]
fn subtract_columns<const M: usize>(
    columns: [&mut [f64; 3]; 3],
    vectors: &BlockVectors<M>,
    gains: &BlockVectors<M>,
) {
    let [first, second, third] = columns;
    let (mut a, mut b, mut c) = (*first, *second, *third);
    for (v, [ga, gb, gc]) in vectors.iter().zip(gains) {
        for i in 0..3 {
            a[i] -= v[i] * ga;
            b[i] -= v[i] * gb;
            c[i] -= v[i] * gc;
        }
    }
    (*first, *second, *third) = (a, b, c);
}

/// The same of one column.
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
