//! One filter: an error state and its covariance, and how an epoch's motion changes them.
//!
//! In: the shared [`Transition`]. Out: P ← Φ P Φᵀ + Q, x ← Φ x. The measurement update is in
//! `update.rs`. Cost: 4,900 instructions on a Cortex-M7 with two clock states.
//!
//! | symbol | code                       | shape   | meaning                               |
//! |--------|----------------------------|---------|---------------------------------------|
//! | P      | covariance, cross, clock   | 15+K    | symmetric, in 3×3 blocks and K columns|
//! | x      | state, clock_state         | 15+K    | error of the nominal, see `layout.rs` |
//!
//! Equations: [P0] (9), (10). K is the number of clock states, M = 6 + K the size of the joint block
//! of a measurement; the compiler checks that they fit each other.

#![expect(
    clippy::indexing_slicing,
    reason = "block numbers are constants after unrolling; the no-panic image is the judge"
)]

use super::layout::{
    ACCEL_BIAS, ATTITUDE, BLOCKS, CLOCK_BIAS, CLOCK_DRIFT, FIRST_OFFSET, GYRO_BIAS,
    JOINT_NAVIGATION, PAIRS, POSITION, VELOCITY, pair,
};
use super::transition::{ClockTransition, NavigationCovariance, NavigationTransition, Transition};
use crate::linalg::block3::{
    Block, Symmetric, ZERO, add_product, add_product_symmetric, add_product_transposed,
    add_product_vector, add_symmetric_product, full, product, product_symmetric, together,
};

/// Error of the nominal trajectory; signs in `layout.rs`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorState<const K: usize> {
    /// Position, velocity, attitude, gyroscope biases, accelerometer biases.
    pub navigation: [[f64; 3]; BLOCKS],
    /// Clock bias, drift, offsets.
    pub clock: [f64; K],
}

impl<const K: usize> ErrorState<K> {
    /// No error.
    pub const ZERO: Self = Self {
        navigation: [[0.0; 3]; BLOCKS],
        clock: [0.0; K],
    };
}

/// What is wrong with a filter that cannot be used any longer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unhealthy {
    /// A variance is negative, not finite, or too small for its covariances.
    Variance {
        /// Number of the state.
        state: u8,
        /// Its variance.
        variance: f64,
    },
    /// A covariance of different states is not finite.
    Covariance,
    /// An entry of the error state is not finite.
    State {
        /// Number of the state.
        state: u8,
    },
}

/// An error-state Kalman filter with 15 navigation states and K clock states.
#[derive(Debug, PartialEq)]
pub struct Filter<const K: usize, const M: usize> {
    pub(super) covariance: NavigationCovariance,
    /// Covariance of each block with each clock state.
    pub(super) cross: [[[f64; 3]; K]; BLOCKS],
    /// Covariance of the clock states, full and symmetric.
    pub(super) clock: [[f64; K]; K],
    pub(super) state: ErrorState<K>,
}

impl<const K: usize, const M: usize> Clone for Filter<K, M> {
    fn clone(&self) -> Self {
        Self {
            covariance: self.covariance.clone(),
            cross: self.cross,
            clock: self.clock,
            state: self.state,
        }
    }

    /// A few entries after the other, small enough to go through registers: a quarter of the instructions of
    /// the copying of bytes that it would be otherwise.
    #[inline(never)]
    fn clone_from(&mut self, source: &Self) {
        let (own, other) = (&mut self.covariance, &source.covariance);
        copy_each(&mut own.diagonal, &other.diagonal);
        copy_each(
            own.off_diagonal.as_flattened_mut().as_chunks_mut::<6>().0,
            other.off_diagonal.as_flattened().as_chunks::<6>().0,
        );
        copy_each(self.cross.as_flattened_mut(), source.cross.as_flattened());
        copy_each(&mut self.clock, &source.clock);
        copy_each(&mut self.state.navigation, &source.state.navigation);
        self.state.clock = source.state.clock;
    }
}

const _: () = assert!((PAIRS * size_of::<Block>()).is_multiple_of(6 * size_of::<f64>()));

fn copy_each<T: Copy>(to: &mut [T], from: &[T]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = *from;
        together();
    }
}

/// What a prediction needs besides the filter; owned by the caller and shared by all filters.
#[derive(Clone, Debug)]
pub struct PredictWorkspace {
    position: [Block; BLOCKS],
    velocity: [Block; BLOCKS],
    attitude: [Block; 2],
    columns: [Columns; 3],
}

impl PredictWorkspace {
    /// Ready.
    pub const EMPTY: Self = Self {
        position: [ZERO; BLOCKS],
        velocity: [ZERO; BLOCKS],
        attitude: [ZERO; 2],
        columns: [[[0.0; 3]; 3]; 3],
    };
}

impl<const K: usize, const M: usize> Filter<K, M> {
    const SIZES_FIT: () = assert!(M == JOINT_NAVIGATION + K && K >= FIRST_OFFSET);

    /// Nothing known, nothing uncertain.
    pub const EMPTY: Self = {
        let () = Self::SIZES_FIT;
        Self {
            covariance: NavigationCovariance::ZERO,
            cross: [[[0.0; 3]; K]; BLOCKS],
            clock: [[0.0; K]; K],
            state: ErrorState::ZERO,
        }
    };

    /// Starts from no error and these uncertainties: one covariance block per block of states, one
    /// variance per clock state.
    pub fn start(&mut self, blocks: &[Symmetric; BLOCKS], clock_var: &[f64; K]) {
        self.covariance.diagonal = *blocks;
        self.covariance.off_diagonal.fill(ZERO);
        self.cross = [[[0.0; 3]; K]; BLOCKS];
        self.clock = [[0.0; K]; K];
        for (k, variance) in clock_var.iter().enumerate() {
            self.clock[k][k] = *variance;
        }
        self.state = ErrorState::ZERO;
    }

    /// P ← Φ P Φᵀ + Q, x ← Φ x.
    #[inline(never)]
    pub fn predict(&mut self, transition: &Transition, workspace: &mut PredictWorkspace) {
        propagate(
            &mut self.covariance,
            &transition.phi,
            &transition.noise,
            workspace,
        );
        let (state, phi) = (&mut self.state.navigation, &transition.phi);
        propagate_columns(&mut self.cross, state, phi, &mut workspace.columns);
        for offset in FIRST_OFFSET..K {
            propagate_offset(&mut self.cross, offset, phi);
        }
        self.propagate_clocks(&transition.clock);
    }

    fn propagate_clocks(&mut self, clock: &ClockTransition) {
        let (step, decay) = (clock.bias_per_drift_s, clock.decay);
        for columns in &mut self.cross {
            for i in 0..3 {
                columns[CLOCK_BIAS][i] += step * columns[CLOCK_DRIFT][i];
                columns[CLOCK_DRIFT][i] *= decay;
            }
        }
        let bias_var = self.clock[CLOCK_BIAS][CLOCK_BIAS];
        let cov = self.clock[CLOCK_BIAS][CLOCK_DRIFT];
        let drift_var = self.clock[CLOCK_DRIFT][CLOCK_DRIFT];
        self.clock[CLOCK_BIAS][CLOCK_BIAS] =
            bias_var + step * (2.0 * cov + step * drift_var) + clock.bias_var;
        let cov = decay * (cov + step * drift_var) + clock.bias_drift_cov;
        self.clock[CLOCK_BIAS][CLOCK_DRIFT] = cov;
        self.clock[CLOCK_DRIFT][CLOCK_BIAS] = cov;
        self.clock[CLOCK_DRIFT][CLOCK_DRIFT] = decay * decay * drift_var + clock.drift_var;
        for offset in FIRST_OFFSET..K {
            let drift_cov = self.clock[CLOCK_DRIFT][offset];
            let bias_cov = self.clock[CLOCK_BIAS][offset] + step * drift_cov;
            self.clock[CLOCK_BIAS][offset] = bias_cov;
            self.clock[offset][CLOCK_BIAS] = bias_cov;
            self.clock[CLOCK_DRIFT][offset] = decay * drift_cov;
            self.clock[offset][CLOCK_DRIFT] = decay * drift_cov;
            self.clock[offset][offset] += clock.offset_var;
        }
        self.state.clock[CLOCK_BIAS] += step * self.state.clock[CLOCK_DRIFT];
        self.state.clock[CLOCK_DRIFT] *= decay;
    }

    /// The error state.
    pub const fn state(&self) -> &ErrorState<K> {
        &self.state
    }

    /// Takes the nominal trajectory to be corrected by `correction`: the state is now the error of the
    /// corrected nominal.
    #[inline(never)]
    pub fn rereference(&mut self, correction: &ErrorState<K>) {
        for (block, by) in self.state.navigation.iter_mut().zip(&correction.navigation) {
            for (entry, by) in block.iter_mut().zip(by) {
                *entry -= by;
            }
        }
        for (entry, by) in self.state.clock.iter_mut().zip(&correction.clock) {
            *entry -= by;
        }
    }

    /// Covariance of a block of states: [`POSITION`] to [`ACCEL_BIAS`].
    pub fn block(&self, block: usize) -> Symmetric {
        self.covariance
            .diagonal
            .get(block)
            .copied()
            .unwrap_or([0.0; 6])
    }

    /// Covariance of two blocks of states.
    pub fn cross_block(&self, row: usize, column: usize) -> Block {
        if row == column {
            return full(&self.block(row));
        }
        let place = pair(row.min(column), row.max(column));
        let block = self
            .covariance
            .off_diagonal
            .get(place)
            .copied()
            .unwrap_or(ZERO);
        if row < column {
            block
        } else {
            let [a, b, c, d, e, f, g, h, i] = block;
            [a, d, g, b, e, h, c, f, i]
        }
    }

    /// Covariance of a block of states with a clock state.
    pub fn clock_cross(&self, block: usize, clock: usize) -> [f64; 3] {
        self.cross
            .get(block)
            .and_then(|columns| columns.get(clock))
            .copied()
            .unwrap_or([0.0; 3])
    }

    /// Covariance of the clock states.
    pub const fn clock_covariance(&self) -> &[[f64; K]; K] {
        &self.clock
    }

    /// Adds to the variance of a clock state, as after a jump of the receiver clock of unknown size.
    pub fn widen_clock(&mut self, clock: usize, variance: f64) {
        if let Some(entry) = self.clock.get_mut(clock).and_then(|row| row.get_mut(clock)) {
            *entry += variance;
        }
    }

    /// Forgets a clock state: no covariance with any other, and this variance.
    pub fn reset_clock(&mut self, clock: usize, variance: f64) {
        if clock >= K {
            return;
        }
        for columns in &mut self.cross {
            columns[clock] = [0.0; 3];
        }
        for k in 0..K {
            self.clock[clock][k] = 0.0;
            self.clock[k][clock] = 0.0;
        }
        self.clock[clock][clock] = variance;
        self.state.clock[clock] = 0.0;
    }

    /// Whether all is finite, no variance is negative and no correlation within a block of states is
    /// beyond one.
    ///
    /// # Errors
    /// [`Unhealthy`], the first found. A filter that is not healthy must be started again.
    pub fn check(&self) -> Result<(), Unhealthy> {
        let mut state: u8 = 0;
        for (block, navigation) in self.covariance.diagonal.iter().zip(&self.state.navigation) {
            let [xx, _, _, yy, _, zz] = *block;
            for (variance, entry) in [xx, yy, zz].into_iter().zip(navigation) {
                if !(variance >= 0.0 && variance.is_finite()) {
                    return Err(Unhealthy::Variance { state, variance });
                }
                if !entry.is_finite() {
                    return Err(Unhealthy::State { state });
                }
                state = state.wrapping_add(1);
            }
            let [xx, xy, xz, yy, yz, zz] = *block;
            // Correlations beyond one: the two-state minors are negative.
            for (a, b, c) in [(xx, yy, xy), (xx, zz, xz), (yy, zz, yz)] {
                if !(c * c <= a * b * (1.0 + 1e-9)) {
                    return Err(Unhealthy::Variance {
                        state: state.wrapping_sub(1),
                        variance: a * b - c * c,
                    });
                }
            }
        }
        for (k, entry) in self.state.clock.iter().enumerate() {
            let variance = self.clock[k][k];
            if !(variance >= 0.0 && variance.is_finite()) {
                return Err(Unhealthy::Variance { state, variance });
            }
            if !entry.is_finite() {
                return Err(Unhealthy::State { state });
            }
            state = state.wrapping_add(1);
        }
        let blocks = self.covariance.off_diagonal.iter().flatten();
        let crosses = self.cross.iter().flatten().flatten();
        let clocks = self.clock.iter().flatten();
        if blocks
            .chain(crosses)
            .chain(clocks)
            .all(|entry| entry.is_finite())
        {
            Ok(())
        } else {
            Err(Unhealthy::Covariance)
        }
    }
}

/// Column J of a row of Φ times P.
#[inline(never)]
fn row_times_column<const J: usize>(
    row: &[Block; BLOCKS],
    p: &NavigationCovariance,
    out: &mut Block,
) {
    let mut sum = product_symmetric(&row[J], &p.diagonal[J]);
    for k in 0..J {
        add_product(&mut sum, &row[k], &p.off_diagonal[pair(k, J)]);
    }
    for k in J + 1..BLOCKS {
        add_product_transposed(&mut sum, &row[k], &p.off_diagonal[pair(J, k)]);
    }
    *out = sum;
}

/// A row of Φ times P.
fn row_times(row: &[Block; BLOCKS], p: &NavigationCovariance, out: &mut [Block; BLOCKS]) {
    let [position, velocity, attitude, gyro, accel] = out;
    row_times_column::<POSITION>(row, p, position);
    row_times_column::<VELOCITY>(row, p, velocity);
    row_times_column::<ATTITUDE>(row, p, attitude);
    row_times_column::<GYRO_BIAS>(row, p, gyro);
    row_times_column::<ACCEL_BIAS>(row, p, accel);
}

/// The attitude's row of Φ times the attitude and gyroscope columns of P, and the accelerometer's
/// column in place, which nothing else reads later.
#[inline(never)]
fn attitude_times(row: &[Block; 2], p: &mut NavigationCovariance, out: &mut [Block; 2]) {
    let [attitude, gyro] = row;
    let off_diagonal = &p.off_diagonal[pair(ATTITUDE, GYRO_BIAS)];
    let mut sum = product_symmetric(attitude, &p.diagonal[ATTITUDE]);
    add_product_transposed(&mut sum, gyro, off_diagonal);
    out[0] = sum;
    let mut sum = product(attitude, off_diagonal);
    add_product_symmetric(&mut sum, gyro, &p.diagonal[GYRO_BIAS]);
    out[1] = sum;
}

/// `out = init + Σ a_k b_kᵀ`, the block of Φ P Φᵀ + Q of two full rows.
#[inline(never)]
fn tile(init: &Block, a: &[Block; BLOCKS], b: &[Block; BLOCKS], out: &mut Block) {
    let mut sum = *init;
    for (l, r) in a.iter().zip(b) {
        add_product_transposed(&mut sum, l, r);
    }
    *out = sum;
}

/// The same of a full row and the attitude's.
#[inline(never)]
fn tile_attitude(init: &Block, a: &[Block; BLOCKS], b: &[Block; 2], out: &mut Block) {
    let mut sum = *init;
    add_product_transposed(&mut sum, &a[ATTITUDE], &b[0]);
    add_product_transposed(&mut sum, &a[GYRO_BIAS], &b[1]);
    *out = sum;
}

/// The same of a row with itself.
#[inline(never)]
fn tile_symmetric<const N: usize>(
    init: &Symmetric,
    a: &[Block; N],
    b: &[Block; N],
    out: &mut Symmetric,
) {
    let mut sum = *init;
    for (l, r) in a.iter().zip(b) {
        add_symmetric_product(&mut sum, l, r);
    }
    *out = sum;
}

#[inline(never)]
fn sum_of(a: &Block, b: &Block, out: &mut Block) {
    for (out, (a, b)) in out.iter_mut().zip(a.iter().zip(b)) {
        *out = a + b;
    }
}

/// P ← Φ P Φᵀ + Q of the navigation states.
#[inline(never)]
pub(super) fn propagate(
    p: &mut NavigationCovariance,
    phi: &NavigationTransition,
    noise: &NavigationCovariance,
    workspace: &mut PredictWorkspace,
) {
    let PredictWorkspace {
        position,
        velocity,
        attitude,
        ..
    } = workspace;
    // First all rows of Φ P, then the blocks of (Φ P) Φᵀ in place.
    row_times(&phi.position, p, position);
    row_times(&phi.velocity, p, velocity);
    attitude_times(&phi.attitude, p, attitude);
    let q = &noise.off_diagonal;
    let (d, o) = (&mut p.diagonal, &mut p.off_diagonal);
    let mut accel = q[pair(ATTITUDE, ACCEL_BIAS)];
    add_product(&mut accel, &phi.attitude[0], &o[pair(ATTITUDE, ACCEL_BIAS)]);
    add_product(
        &mut accel,
        &phi.attitude[1],
        &o[pair(GYRO_BIAS, ACCEL_BIAS)],
    );
    o[pair(ATTITUDE, ACCEL_BIAS)] = accel;
    tile_symmetric(
        &noise.diagonal[POSITION],
        position,
        &phi.position,
        &mut d[POSITION],
    );
    let at = pair(POSITION, VELOCITY);
    tile(&q[at], position, &phi.velocity, &mut o[at]);
    let at = pair(POSITION, ATTITUDE);
    tile_attitude(&q[at], position, &phi.attitude, &mut o[at]);
    let at = pair(POSITION, GYRO_BIAS);
    sum_of(&position[GYRO_BIAS], &q[at], &mut o[at]);
    let at = pair(POSITION, ACCEL_BIAS);
    sum_of(&position[ACCEL_BIAS], &q[at], &mut o[at]);
    tile_symmetric(
        &noise.diagonal[VELOCITY],
        velocity,
        &phi.velocity,
        &mut d[VELOCITY],
    );
    let at = pair(VELOCITY, ATTITUDE);
    tile_attitude(&q[at], velocity, &phi.attitude, &mut o[at]);
    let at = pair(VELOCITY, GYRO_BIAS);
    sum_of(&velocity[GYRO_BIAS], &q[at], &mut o[at]);
    let at = pair(VELOCITY, ACCEL_BIAS);
    sum_of(&velocity[ACCEL_BIAS], &q[at], &mut o[at]);
    tile_symmetric(
        &noise.diagonal[ATTITUDE],
        attitude,
        &phi.attitude,
        &mut d[ATTITUDE],
    );
    let at = pair(ATTITUDE, GYRO_BIAS);
    sum_of(&attitude[1], &q[at], &mut o[at]);
    for (block, q) in d.iter_mut().zip(&noise.diagonal).skip(GYRO_BIAS) {
        for (entry, q) in block.iter_mut().zip(q) {
            *entry += q;
        }
    }
}

/// Columns that every filter has besides the navigation covariance, as many as the registers hold: clock
/// bias, clock drift, error state.
type Columns = [[f64; 3]; 3];

/// A row of Φ, whose N blocks begin at block FIRST, times these columns.
#[inline(never)]
fn row_times_columns<const FIRST: usize, const N: usize, const K: usize>(
    row: &[Block; N],
    cross: &[[[f64; 3]; K]; BLOCKS],
    state: &[[f64; 3]; BLOCKS],
    out: &mut Columns,
) {
    let [mut bias, mut drift, mut error] = [[0.0; 3]; 3];
    for (at, block) in row.iter().enumerate() {
        let (columns, entry) = (&cross[FIRST + at], &state[FIRST + at]);
        for k in 0..3 {
            for i in 0..3 {
                let phi = block[3 * i + k];
                bias[i] += phi * columns[CLOCK_BIAS][k];
                drift[i] += phi * columns[CLOCK_DRIFT][k];
                error[i] += phi * entry[k];
            }
        }
    }
    *out = [bias, drift, error];
}

/// Φ times these columns.
fn propagate_columns<const K: usize>(
    cross: &mut [[[f64; 3]; K]; BLOCKS],
    state: &mut [[f64; 3]; BLOCKS],
    phi: &NavigationTransition,
    rows: &mut [Columns; 3],
) {
    let [position, velocity, attitude] = &mut *rows;
    row_times_columns::<POSITION, BLOCKS, K>(&phi.position, cross, state, position);
    row_times_columns::<POSITION, BLOCKS, K>(&phi.velocity, cross, state, velocity);
    row_times_columns::<ATTITUDE, 2, K>(&phi.attitude, cross, state, attitude);
    for ((columns, error), row) in cross.iter_mut().zip(state).zip(rows) {
        [columns[CLOCK_BIAS], columns[CLOCK_DRIFT], *error] = *row;
    }
}

/// Φ times the covariance with a clock offset.
#[inline(never)]
fn propagate_offset<const K: usize>(
    cross: &mut [[[f64; 3]; K]; BLOCKS],
    offset: usize,
    phi: &NavigationTransition,
) {
    let mut position = [0.0; 3];
    let mut velocity = [0.0; 3];
    for ((columns, p), v) in cross.iter().zip(&phi.position).zip(&phi.velocity) {
        add_product_vector(&mut position, p, &columns[offset]);
        add_product_vector(&mut velocity, v, &columns[offset]);
    }
    let mut attitude = [0.0; 3];
    add_product_vector(&mut attitude, &phi.attitude[0], &cross[ATTITUDE][offset]);
    add_product_vector(&mut attitude, &phi.attitude[1], &cross[GYRO_BIAS][offset]);
    for (columns, entry) in cross.iter_mut().zip([position, velocity, attitude]) {
        columns[offset] = entry;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ekf::dense::{self, Noise, random_block, random_filter};

    /// A transition with every stored block at random.
    fn random_transition(noise: &mut Noise) -> Transition {
        let mut t = Transition::IDENTITY;
        for block in t
            .phi
            .position
            .iter_mut()
            .chain(&mut t.phi.velocity)
            .chain(&mut t.phi.attitude)
        {
            *block = random_block(noise);
        }
        for (at, block) in t.noise.off_diagonal.iter_mut().enumerate() {
            if at != pair(GYRO_BIAS, ACCEL_BIAS) {
                *block = random_block(noise);
            }
        }
        for block in &mut t.noise.diagonal {
            *block = core::array::from_fn(|_| noise.next());
        }
        t.clock = ClockTransition {
            bias_per_drift_s: 0.7,
            decay: 0.9,
            bias_var: 0.2,
            bias_drift_cov: -0.1,
            drift_var: 0.3,
            offset_var: 0.0,
        };
        t
    }

    #[test]
    fn a_prediction_is_that_of_dense_matrices() {
        let mut noise = Noise(1);
        for _ in 0..20 {
            let mut filter = random_filter(&mut noise);
            let t = random_transition(&mut noise);
            let (phi, q) = dense::whole_transition(&t);
            let p = phi * dense::covariance(&filter) * phi.transpose() + q;
            let x = phi * dense::state(filter.state());
            let mut workspace = PredictWorkspace::EMPTY;
            filter.predict(&t, &mut workspace);
            assert!((dense::covariance(&filter) - p).amax() < 1e-13);
            assert!((dense::state(filter.state()) - x).amax() < 1e-14);
        }
    }

    #[test]
    fn a_filter_that_lost_a_variance_is_unhealthy() {
        let mut filter = random_filter(&mut Noise(2));
        assert_eq!(filter.check(), Ok(()));
        for bad in [-1e-9, f64::NAN, f64::INFINITY] {
            let mut broken = filter.clone();
            broken.covariance.diagonal[ATTITUDE][3] = bad;
            assert!(matches!(
                broken.check(),
                Err(Unhealthy::Variance { state: 7, .. })
            ));
        }
        let mut broken = filter.clone();
        broken.cross[GYRO_BIAS][1][2] = f64::NAN;
        assert_eq!(broken.check(), Err(Unhealthy::Covariance));
        let mut broken = filter.clone();
        broken.covariance.off_diagonal[pair(ATTITUDE, ACCEL_BIAS)][4] = f64::INFINITY;
        assert_eq!(broken.check(), Err(Unhealthy::Covariance));
        filter.state.clock[1] = f64::NAN;
        assert_eq!(filter.check(), Err(Unhealthy::State { state: 16 }));
    }
}
