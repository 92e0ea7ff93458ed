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
//! docs/decisions/005-tight-filter.md. Equations replaced: [P0] (11)-(13). Cost: 5,700 instructions on
//! a Cortex-M7 with M = 8, `joint.rs` included.

#![expect(
    clippy::indexing_slicing,
    reason = "indices are below M by the loops' bounds; the no-panic image is the judge"
)]

use super::filter::Filter;
use super::information::EpochInformation;
use super::joint::{JointWorkspace, Scalar};
use super::layout::{
    BLOCKS, CLOCK_BIAS, CLOCK_DRIFT, FIRST_OFFSET, MAX_JOINT, POSITION, VELOCITY, pair,
};
use crate::linalg::block3::{Block, Symmetric, full, together};

/// Vectors of one block of states, one per scalar measurement.
type BlockVectors<const M: usize> = [[f64; 3]; M];

/// What an update needs besides the filter; owned by the caller and shared by all filters.
#[derive(Clone, Debug)]
pub struct UpdateWorkspace<const K: usize, const M: usize> {
    joint: JointWorkspace<K, M>,
    /// v_q of the blocks of states behind the joint block.
    vectors: [BlockVectors<M>; BLOCKS - 2],
    /// v_q/s_q of each block of states.
    gains: [BlockVectors<M>; BLOCKS],
    /// v_q/s_q of the clock states.
    clock_gains: [ClockGain<K>; M],
}

/// What the covariance with the clock states and the state itself lose by a scalar measurement, per entry
/// of v_q.
#[derive(Clone, Copy, Debug)]
struct ClockGain<const K: usize> {
    clock: [f64; K],
    /// −ν_q/s_q.
    state: f64,
}

impl<const K: usize, const M: usize> UpdateWorkspace<K, M> {
    /// Ready.
    pub const EMPTY: Self = Self {
        joint: JointWorkspace::EMPTY,
        vectors: [[[0.0; 3]; M]; BLOCKS - 2],
        gains: [[[0.0; 3]; M]; BLOCKS],
        clock_gains: [ClockGain {
            clock: [0.0; K],
            state: 0.0,
        }; M],
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
        for (block, vectors) in (VELOCITY + 1..BLOCKS).zip(&mut workspace.vectors) {
            block_vectors(
                &self.covariance.off_diagonal[pair(POSITION, block)],
                &self.covariance.off_diagonal[pair(VELOCITY, block)],
                &self.cross[block],
                &workspace.joint.combination,
                vectors,
            );
        }
        self.downdate_clocks(workspace);
        self.downdate(workspace);
        UpdateSummary {
            nis,
            rows: information.rows,
        }
    }

    /// Covariance and state of position, velocity and clocks.
    #[inline(never)]
    fn fill_joint(&self, joint: &mut JointWorkspace<K, M>) {
        let position = full(&self.covariance.diagonal[POSITION]);
        let velocity = full(&self.covariance.diagonal[VELOCITY]);
        let both = &self.covariance.off_diagonal[pair(POSITION, VELOCITY)];
        let (covariance, state) = (&mut joint.covariance, &mut joint.state);
        let velocity_at = JointWorkspace::<K, M>::velocity;
        let clock_at = JointWorkspace::<K, M>::clock;
        for i in 0..3 {
            for j in 0..3 {
                covariance[i][j] = position[3 * i + j];
                covariance[i][velocity_at(j)] = both[3 * i + j];
                covariance[velocity_at(j)][i] = both[3 * i + j];
                covariance[velocity_at(i)][velocity_at(j)] = velocity[3 * i + j];
            }
            for k in 0..K {
                covariance[i][clock_at(k)] = self.cross[POSITION][k][i];
                covariance[clock_at(k)][i] = self.cross[POSITION][k][i];
                covariance[velocity_at(i)][clock_at(k)] = self.cross[VELOCITY][k][i];
                covariance[clock_at(k)][velocity_at(i)] = self.cross[VELOCITY][k][i];
            }
            state[i] = self.state.navigation[POSITION][i];
            state[velocity_at(i)] = self.state.navigation[VELOCITY][i];
        }
        for k in 0..K {
            for l in 0..K {
                covariance[clock_at(k)][clock_at(l)] = self.clock[k][l];
            }
            state[clock_at(k)] = self.state.clock[k];
        }
    }

    /// The update of the clock states, and what the other blocks need of it.
    #[inline(never)]
    fn downdate_clocks(&mut self, workspace: &mut UpdateWorkspace<K, M>) {
        let UpdateWorkspace {
            joint, clock_gains, ..
        } = workspace;
        let mut work = ClockSubtraction {
            covariance: self.clock,
            state: self.state.clock,
            directions: &joint.directions.clock,
            scalar: &joint.scalar,
            gains: clock_gains,
        };
        for q in 0..M {
            work.run(q);
        }
        let (mut covariance, state) = (work.covariance, work.state);
        for k in 0..K {
            for l in 0..k {
                covariance[l][k] = covariance[k][l];
            }
        }
        (self.clock, self.state.clock) = (covariance, state);
    }

    /// P ← P − Σ v_q v_qᵀ / s_q, x ← x + Σ v_q ν_q / s_q of all blocks of states.
    #[inline(never)]
    fn downdate(&mut self, workspace: &mut UpdateWorkspace<K, M>) {
        let UpdateWorkspace {
            joint,
            vectors,
            gains,
            clock_gains,
        } = workspace;
        let directions = &joint.directions;
        let [attitude, gyro, accel] = vectors;
        let vectors = [
            &directions.position,
            &directions.velocity,
            attitude,
            gyro,
            accel,
        ];
        for (block, vectors) in vectors.into_iter().enumerate() {
            subtract_symmetric(
                &mut self.covariance.diagonal[block],
                vectors,
                &joint.scalar,
                &mut gains[block],
            );
            let (columns, state) = (&mut self.cross[block], &mut self.state.navigation[block]);
            subtract_columns(columns, state, vectors, clock_gains);
        }
        let mut off_diagonal = self.covariance.off_diagonal.iter_mut();
        for (row, vectors) in vectors.into_iter().enumerate() {
            for gains in &gains[row + 1..] {
                if let Some(block) = off_diagonal.next() {
                    subtract(block, vectors, gains);
                }
            }
        }
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
    // The blocks are stored with the measured state first; the order is that of the joint block.
    let column = |s: usize| {
        if s < 3 {
            [position[3 * s], position[3 * s + 1], position[3 * s + 2]]
        } else if s == 3 {
            clocks[CLOCK_BIAS]
        } else if s == M - 1 {
            clocks[CLOCK_DRIFT]
        } else if s < M - 4 {
            clocks[s - 4 + FIRST_OFFSET]
        } else {
            let at = 3 * (s + 4 - M);
            [velocity[at], velocity[at + 1], velocity[at + 2]]
        }
    };
    vectors_from::<0, M>(column, combination, vectors);
    vectors_from::<3, M>(column, combination, vectors);
    vectors_from::<6, M>(column, combination, vectors);
    vectors_from::<9, M>(column, combination, vectors);
}

/// v_q of three measurements, so that each column of the covariance is read once for all three.
#[inline(always)]
fn vectors_from<const FIRST: usize, const M: usize>(
    column: impl Fn(usize) -> [f64; 3],
    combination: &[[f64; M]; M],
    vectors: &mut BlockVectors<M>,
) {
    if FIRST >= M {
        return;
    }
    let mut sums = [[0.0; 3]; 3];
    for s in 0..FIRST + 3 {
        if s < M {
            let column = column(s);
            for j in 0..3 {
                let q = FIRST + j;
                if s <= q && q < M {
                    for i in 0..3 {
                        // Entry q of z_q is 1.
                        let part = if s == q {
                            column[i]
                        } else {
                            column[i] * combination[q][s]
                        };
                        sums[j][i] = if s == 0 { part } else { sums[j][i] + part };
                    }
                }
            }
        }
    }
    for j in 0..3 {
        if FIRST + j < M {
            vectors[FIRST + j] = sums[j];
        }
    }
}

/// `p -= Σ v_q v_qᵀ / s_q`; fills the gains v_q/s_q on the way.
#[inline(never)]
fn subtract_symmetric<const M: usize>(
    p: &mut Symmetric,
    vectors: &BlockVectors<M>,
    scalar: &[Scalar; M],
    gains: &mut BlockVectors<M>,
) {
    let mut work = SymmetricSubtraction {
        sum: *p,
        vectors,
        scalar,
        gains,
    };
    for_each::<M>(&mut work);
    *p = work.sum;
}

struct SymmetricSubtraction<'a, const M: usize> {
    sum: Symmetric,
    vectors: &'a BlockVectors<M>,
    scalar: &'a [Scalar; M],
    gains: &'a mut BlockVectors<M>,
}

impl<const M: usize> PerScalar for SymmetricSubtraction<'_, M> {
    #[inline(always)]
    fn run<const Q: usize>(&mut self) {
        let [x, y, z] = self.vectors[Q];
        let precision = self.scalar[Q].precision;
        let (gx, gy, gz) = (x * precision, y * precision, z * precision);
        let [xx, xy, xz, yy, yz, zz] = &mut self.sum;
        *xx -= x * gx;
        *xy -= x * gy;
        *xz -= x * gz;
        *yy -= y * gy;
        *yz -= y * gz;
        *zz -= z * gz;
        self.gains[Q] = [gx, gy, gz];
    }
}

/// `p -= Σ v_q g_qᵀ`.
#[inline(never)]
fn subtract<const M: usize>(p: &mut Block, vectors: &BlockVectors<M>, gains: &BlockVectors<M>) {
    let mut work = Subtraction {
        sum: *p,
        vectors,
        gains,
    };
    for_each::<M>(&mut work);
    *p = work.sum;
}

struct Subtraction<'a, const M: usize> {
    sum: Block,
    vectors: &'a BlockVectors<M>,
    gains: &'a BlockVectors<M>,
}

impl<const M: usize> PerScalar for Subtraction<'_, M> {
    #[inline(always)]
    fn run<const Q: usize>(&mut self) {
        let (v, g) = (&self.vectors[Q], &self.gains[Q]);
        for i in 0..3 {
            for j in 0..3 {
                self.sum[3 * i + j] -= v[i] * g[j];
            }
        }
    }
}

/// What is done once per scalar measurement.
trait PerScalar {
    fn run<const Q: usize>(&mut self);
}

/// Runs for 0, 1, … M − 1. Nothing is moved from one to the next, so that the three entries of a vector are
/// loaded together, by one instruction.
#[inline(always)]
fn for_each<const M: usize>(work: &mut impl PerScalar) {
    const { assert!(8 <= M && M <= MAX_JOINT) };
    work.run::<0>();
    together();
    work.run::<1>();
    together();
    work.run::<2>();
    together();
    work.run::<3>();
    together();
    work.run::<4>();
    together();
    work.run::<5>();
    together();
    work.run::<6>();
    together();
    work.run::<7>();
    if M > 8 {
        together();
        work.run::<8>();
    }
    if M > 9 {
        together();
        work.run::<9>();
    }
}

struct ClockSubtraction<'a, const K: usize, const M: usize> {
    covariance: [[f64; K]; K],
    state: [f64; K],
    directions: &'a [[f64; K]; M],
    scalar: &'a [Scalar; M],
    gains: &'a mut [ClockGain<K>; M],
}

impl<const K: usize, const M: usize> ClockSubtraction<'_, K, M> {
    #[inline(always)]
    fn run(&mut self, q: usize) {
        let (v, scalar) = (&self.directions[q], &self.scalar[q]);
        let gain = v.map(|entry| entry * scalar.precision);
        for k in 0..K {
            for l in 0..=k {
                self.covariance[k][l] -= v[k] * gain[l];
            }
            self.state[k] += v[k] * scalar.step;
        }
        self.gains[q] = ClockGain {
            clock: gain,
            state: -scalar.step,
        };
    }
}

/// The same of the covariance with the clock states, and of the state. Three clocks are what the registers
/// hold beside it.
fn subtract_columns<const K: usize, const M: usize>(
    columns: &mut [[f64; 3]; K],
    state: &mut [f64; 3],
    vectors: &BlockVectors<M>,
    gains: &[ClockGain<K>; M],
) {
    if let Some((three, rest)) = columns.split_first_chunk_mut::<3>() {
        subtract_first_columns(three, state, vectors, gains);
        for (column, k) in rest.iter_mut().zip(3..) {
            subtract_column(column, vectors, gains, k);
        }
    } else if let Some(two) = columns.first_chunk_mut::<2>() {
        subtract_first_columns(two, state, vectors, gains);
    }
}

#[inline(never)]
fn subtract_first_columns<const C: usize, const K: usize, const M: usize>(
    columns: &mut [[f64; 3]; C],
    state: &mut [f64; 3],
    vectors: &BlockVectors<M>,
    gains: &[ClockGain<K>; M],
) {
    let mut work = ColumnSubtraction {
        columns: *columns,
        state: *state,
        vectors,
        gains,
    };
    for_each::<M>(&mut work);
    (*columns, *state) = (work.columns, work.state);
}

struct ColumnSubtraction<'a, const C: usize, const K: usize, const M: usize> {
    columns: [[f64; 3]; C],
    state: [f64; 3],
    vectors: &'a BlockVectors<M>,
    gains: &'a [ClockGain<K>; M],
}

impl<const C: usize, const K: usize, const M: usize> PerScalar for ColumnSubtraction<'_, C, K, M> {
    #[inline(always)]
    fn run<const Q: usize>(&mut self) {
        let (v, gain) = (&self.vectors[Q], &self.gains[Q]);
        for (column, gain) in self.columns.iter_mut().zip(&gain.clock) {
            for i in 0..3 {
                column[i] -= v[i] * gain;
            }
        }
        for i in 0..3 {
            self.state[i] -= v[i] * gain.state;
        }
    }
}

#[inline(never)]
fn subtract_column<const K: usize, const M: usize>(
    column: &mut [f64; 3],
    vectors: &BlockVectors<M>,
    gains: &[ClockGain<K>; M],
    k: usize,
) {
    let mut sum = *column;
    for (v, gain) in vectors.iter().zip(gains) {
        for i in 0..3 {
            sum[i] -= v[i] * gain.clock[k];
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
        let mut row = MeasurementRow {
            pseudorange: core::array::from_fn(|_| noise.next()),
            innovation_m: noise.next(),
            weight,
            range_rate: core::array::from_fn(|_| noise.next()),
            innovation_mps: noise.next(),
            range_rate_weight: 0.5 * weight,
        };
        row.pseudorange[3..6].fill(0.0);
        row.pseudorange[6 + CLOCK_DRIFT] = 0.0;
        row.range_rate[6 + CLOCK_BIAS] = 0.0;
        row
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
        let mut workspace = UpdateWorkspace::<K, M>::EMPTY;
        let mut apart = random_filter(&mut noise);
        let mut together = apart.clone();
        let nis = apart.update(&sum, &mut workspace).nis;
        assert!((together.update(&whole, &mut workspace).nis - nis).abs() < 1e-12);
        let difference = dense::covariance(&apart) - dense::covariance(&together);
        assert!(difference.amax() < 1e-14);
        assert_eq!(sum.rows(), 16);
    }
}
