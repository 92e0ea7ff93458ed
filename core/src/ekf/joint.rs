//! The part of an update on the joint block: an epoch's information as at most M scalar measurements,
//! taken one after the other.
//!
//! | symbol | code        | shape | meaning                                                     |
//! |--------|-------------|-------|-------------------------------------------------------------|
//! | u_q    | design      | M     | scalar measurement q is of u_qᵀ x; entries 0..=q, the last 1 |
//! | e_q    | information | 1     | its 1/σ², 0 where rank is missing; may be negative      |
//! | G      | covariance  | M × M | of the joint block                                          |
//! | z_q    | combination | M     | v_q = P z_q for every row of P, entries 0..=q               |
//! | v_q    | direction   | M     | covariance of all states with measurement q when it is taken |
//! | 1/s_q  | precision   | 1     | P loses v_q v_qᵀ / s_q                                      |
//!
//! ```text
//! Λ = Σ_q e_q u_q u_qᵀ   (from the last pivot),   y = Σ_q u_q e_q η_q
//! z_q = u_q − Σ_{p<q} z_p (v_pᵀ u_q)/s_p,   v_q = G z_q,   1/s_q = e_q / (1 + e_q u_qᵀ v_q)
//! ```
//!
//! Derivation: docs/decisions/005-tight-filter.md. Cost: 2,100 instructions on a Cortex-M7 with M = 8.
//! The steps are functions apart so that each keeps its vector in the sixteen double registers.

#![expect(
    clippy::indexing_slicing,
    reason = "indices are below M by the loops' bounds; the no-panic image is the judge"
)]

use super::information::EpochInformation;
use super::layout::{CLOCK_BIAS, CLOCK_DRIFT, FIRST_OFFSET};
use crate::linalg::block3::together;

/// A pivot below this part of its diagonal entry is rounding: M sums of products of f64 carry about
/// 1e-15 of it.
const RANK_TOLERANCE: f64 = 1.0e-13;

/// A pivot that is small, but not by rounding alone, is uncertain by a part of itself, and what the states
/// before it have of that measurement with it. It comes back in a later pivot, with either sign: taken as
/// it is, the sum of all is Λ again. One that would more than double a variance, with 1 + e_q u_qᵀ v_q below
/// this, is not taken.
const MIN_SHRINKAGE: f64 = 0.5;

/// What is known of one scalar measurement.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scalar {
    /// e_q.
    information: f64,
    /// e_q η_q.
    weighted: f64,
    /// 1/s_q.
    pub precision: f64,
    /// ν_q / s_q, with the innovation ν_q = η_q − u_qᵀ x.
    pub step: f64,
}

/// v_q on the joint block, in the blocks of the filter.
#[derive(Clone, Debug)]
pub(super) struct Directions<const K: usize, const M: usize> {
    pub position: [[f64; 3]; M],
    pub velocity: [[f64; 3]; M],
    pub clock: [[f64; K]; M],
}

impl<const K: usize, const M: usize> Directions<K, M> {
    /// Entry s of v_q.
    #[inline(always)]
    const fn entry(&mut self, q: usize, s: usize) -> &mut f64 {
        if s < 3 {
            &mut self.position[q][s]
        } else if s == 3 {
            &mut self.clock[q][CLOCK_BIAS]
        } else if s < M - RATES {
            &mut self.clock[q][s - 4 + FIRST_OFFSET]
        } else if s < M - 1 {
            &mut self.velocity[q][s + RATES - M]
        } else {
            &mut self.clock[q][CLOCK_DRIFT]
        }
    }
}

/// The scalar measurements of an update. Rows and columns in the order position, bias, offsets; velocity,
/// drift: no entry couples a pseudorange's bias and offsets to what only range rates measure.
#[derive(Clone, Debug)]
pub(super) struct JointWorkspace<const K: usize, const M: usize> {
    /// u_q.
    design: [[f64; M]; M],
    pub scalar: [Scalar; M],
    /// G, filled by the caller.
    pub covariance: [[f64; M]; M],
    /// Error state of the joint block before the update, filled by the caller.
    pub state: [f64; M],
    /// z_q.
    pub combination: [[f64; M]; M],
    pub directions: Directions<K, M>,
    /// (v_pᵀ u_q)/s_p of the measurement q that is being taken.
    share: [f64; M],
}

/// Entries that only range rates measure: velocity and drift.
const RATES: usize = 4;

impl<const K: usize, const M: usize> JointWorkspace<K, M> {
    pub const EMPTY: Self = Self {
        design: [[0.0; M]; M],
        scalar: [Scalar {
            information: 0.0,
            weighted: 0.0,
            precision: 0.0,
            step: 0.0,
        }; M],
        covariance: [[0.0; M]; M],
        state: [0.0; M],
        combination: [[0.0; M]; M],
        directions: Directions {
            position: [[0.0; 3]; M],
            velocity: [[0.0; 3]; M],
            clock: [[0.0; K]; M],
        },
        share: [0.0; M],
    };

    /// Where a clock state stands in the joint block.
    pub const fn clock(k: usize) -> usize {
        match k {
            CLOCK_BIAS => 3,
            CLOCK_DRIFT => M - 1,
            offset => 4 + offset - FIRST_OFFSET,
        }
    }

    /// Where an axis of the velocity stands in the joint block.
    pub const fn velocity(axis: usize) -> usize {
        M - RATES + axis
    }

    /// Fills everything that the caller has not; returns νᵀ S⁻¹ ν of all measurements.
    pub fn take(&mut self, information: &EpochInformation<M>) -> f64 {
        let explained = self.factorise(information);
        let taken = self.take_all();
        let unexplained = information.weighted_square - explained;
        taken + if unexplained > 0.0 { unexplained } else { 0.0 }
    }

    /// Fills u_q, e_q and e_q η_q; returns Σ e_q η_q².
    #[inline(never)]
    fn factorise(&mut self, information: &EpochInformation<M>) -> f64 {
        let mut explained = 0.0;
        self.factorise_rate::<3>(information, &mut explained);
        self.factorise_rate::<2>(information, &mut explained);
        self.factorise_rate::<1>(information, &mut explained);
        self.factorise_rate::<0>(information, &mut explained);
        if M > 9 {
            self.factorise_range::<5>(information, &mut explained);
        }
        if M > 8 {
            self.factorise_range::<4>(information, &mut explained);
        }
        self.factorise_range::<3>(information, &mut explained);
        self.factorise_range::<2>(information, &mut explained);
        self.factorise_range::<1>(information, &mut explained);
        self.factorise_range::<0>(information, &mut explained);
        explained
    }

    /// Velocity and drift: row J of Λ less what the later measurements have of it, divided by its pivot.
    #[inline(always)]
    fn factorise_rate<const J: usize>(
        &mut self,
        information: &EpochInformation<M>,
        explained: &mut f64,
    ) {
        let (mut position, mut rates, mut weighted) = information.rate_row(J);
        let first = M - RATES;
        let whole = rates[J];
        for later in J + 1..RATES {
            let (row, scalar) = (&self.design[first + later], &self.scalar[first + later]);
            let u = row[first + J];
            let share = u * scalar.information;
            for s in 0..3 {
                position[s] -= share * row[s];
            }
            for s in 0..J {
                rates[s] -= share * row[first + s];
            }
            rates[J] -= share * u;
            weighted -= u * scalar.weighted;
        }
        let (scalar, inverse) = Scalar::of_pivot(rates[J], whole, weighted);
        let row = &mut self.design[first + J];
        for s in 0..3 {
            row[s] = position[s] * inverse;
        }
        for s in 0..J {
            row[first + s] = rates[s] * inverse;
        }
        *explained += scalar.weighted * scalar.weighted * inverse;
        self.scalar[first + J] = scalar;
    }

    /// The same of position, bias and offsets; those do not occur in the rows of velocity and drift.
    #[inline(always)]
    fn factorise_range<const Q: usize>(
        &mut self,
        information: &EpochInformation<M>,
        explained: &mut f64,
    ) {
        let (mut entries, mut weighted) = information.range_row(Q);
        let whole = entries[Q];
        let end = if Q < 3 { M } else { M - RATES };
        for later in Q + 1..end {
            let (row, scalar) = (&self.design[later], &self.scalar[later]);
            let u = row[Q];
            let share = u * scalar.information;
            for s in 0..Q {
                entries[s] -= share * row[s];
            }
            entries[Q] -= share * u;
            weighted -= u * scalar.weighted;
        }
        let (scalar, inverse) = Scalar::of_pivot(entries[Q], whole, weighted);
        let row = &mut self.design[Q];
        for s in 0..Q {
            row[s] = entries[s] * inverse;
        }
        *explained += scalar.weighted * scalar.weighted * inverse;
        self.scalar[Q] = scalar;
    }

    /// Fills the rest; returns Σ ν_q² / s_q.
    #[inline(never)]
    fn take_all(&mut self) -> f64 {
        let mut taken = 0.0;
        self.take_one::<0>(&mut taken);
        self.take_one::<1>(&mut taken);
        self.take_one::<2>(&mut taken);
        self.take_one::<3>(&mut taken);
        self.take_one::<4>(&mut taken);
        self.take_one::<5>(&mut taken);
        self.take_one::<6>(&mut taken);
        self.take_one::<7>(&mut taken);
        if M > 8 {
            self.take_one::<8>(&mut taken);
        }
        if M > 9 {
            self.take_one::<9>(&mut taken);
        }
        taken
    }

    #[inline(always)]
    fn take_one<const Q: usize>(&mut self, taken: &mut f64) {
        if Q >= M {
            return;
        }
        let u = &self.design[Q];
        let predicted = shares::<Q, K, M>(
            &mut self.directions,
            u,
            &self.state,
            &self.scalar,
            &mut self.share,
        );
        combine::<Q, M>(u, &self.share, &mut self.combination);
        let variance = direct::<Q, K, M>(
            &self.covariance,
            &self.combination[Q],
            u,
            &mut self.directions,
        );
        *taken += self.scalar[Q].take(variance, predicted);
    }
}

/// Whether u_q may have an entry s < q: those of velocity and drift have none of bias and offsets.
#[inline(always)]
const fn is_coupled<const M: usize>(q: usize, s: usize) -> bool {
    q < M - RATES || s < 3 || s >= M - RATES
}

/// (v_pᵀ u)/s_p of the measurements before; returns u_qᵀ x of the state as they have moved it.
#[inline(never)]
fn shares<const Q: usize, const K: usize, const M: usize>(
    directions: &mut Directions<K, M>,
    u: &[f64; M],
    state: &[f64; M],
    scalar: &[Scalar; M],
    share: &mut [f64; M],
) -> f64 {
    let mut predicted = state[Q];
    for s in 0..Q {
        if is_coupled::<M>(Q, s) {
            predicted += u[s] * state[s];
        }
    }
    for p in 0..Q {
        let mut along = *directions.entry(p, Q);
        for s in 0..Q {
            if is_coupled::<M>(Q, s) {
                along += *directions.entry(p, s) * u[s];
            }
        }
        predicted += along * scalar[p].step;
        share[p] = along * scalar[p].precision;
    }
    predicted
}

/// z_q.
#[inline(never)]
fn combine<const Q: usize, const M: usize>(
    u: &[f64; M],
    share: &[f64; M],
    combination: &mut [[f64; M]; M],
) {
    let mut z = [0.0; M];
    for s in 0..Q {
        if is_coupled::<M>(Q, s) {
            z[s] = u[s];
        }
    }
    for p in 0..Q {
        for s in 0..p {
            z[s] -= share[p] * combination[p][s];
        }
        z[p] -= share[p];
    }
    for s in 0..Q {
        combination[Q][s] = z[s];
    }
}

/// v_q; returns u_qᵀ v_q.
#[inline(never)]
fn direct<const Q: usize, const K: usize, const M: usize>(
    covariance: &[[f64; M]; M],
    z: &[f64; M],
    u: &[f64; M],
    directions: &mut Directions<K, M>,
) -> f64 {
    let mut v = covariance[Q];
    for p in 0..Q {
        together();
        for s in 0..M {
            v[s] += covariance[p][s] * z[p];
        }
    }
    let mut variance = v[Q];
    for s in 0..Q {
        if is_coupled::<M>(Q, s) {
            variance += u[s] * v[s];
        }
    }
    for s in 0..M {
        *directions.entry(Q, s) = v[s];
    }
    variance
}

impl Scalar {
    /// What a pivot of Λ says, and its inverse; nothing where rank is missing.
    #[inline(always)]
    fn of_pivot(pivot: f64, whole: f64, weighted: f64) -> (Self, f64) {
        let is_known = libm::fabs(pivot) > RANK_TOLERANCE * whole;
        let (information, weighted, inverse) = if is_known {
            (pivot, weighted, 1.0 / pivot)
        } else {
            (0.0, 0.0, 0.0)
        };
        let scalar = Self {
            information,
            weighted,
            precision: 0.0,
            step: 0.0,
        };
        (scalar, inverse)
    }

    /// Takes the measurement of this variance and prediction; returns ν_q² / s_q.
    #[inline(never)]
    fn take(&mut self, variance: f64, predicted: f64) -> f64 {
        let shrinks_by = 1.0 + self.information * variance;
        let mut scale = 1.0 / shrinks_by;
        if !(shrinks_by > MIN_SHRINKAGE) {
            scale = 0.0;
        }
        let innovation = self.weighted - self.information * predicted;
        self.precision = self.information * scale;
        self.step = innovation * scale;
        if self.information != 0.0 {
            innovation * self.step / self.information
        } else {
            0.0
        }
    }
}
