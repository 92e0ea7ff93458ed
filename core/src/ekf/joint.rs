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
//! Derivation: docs/decisions/005-tight-filter.md. Cost: 2,400 instructions on a Cortex-M7 with M = 8.
//! The steps are functions apart so that each keeps its vector in the sixteen double registers.

#![expect(
    clippy::indexing_slicing,
    reason = "indices are below M by the loops' bounds; the no-panic image is the judge"
)]

use super::information::EpochInformation;
use super::layout::JOINT_NAVIGATION;

/// A pivot below this part of its diagonal entry is rounding: M sums of products of f64 carry about
/// 1e-15 of it.
const RANK_TOLERANCE: f64 = 1.0e-13;

/// A pivot that is small, but not by rounding alone, is uncertain by a part of itself, and what the states
/// before it have of that measurement with it. It comes back in a later pivot, with either sign: taken as
/// it is, the sum of all is Λ again. One that would more than double a variance, with 1 + e_q u_qᵀ v_q below
/// this, is not taken.
const MIN_SHRINKAGE: f64 = 0.5;

/// Most entries of a joint block: position, velocity and four clock states.
pub(super) const MAX_JOINT: usize = 10;

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
    fn entry(&mut self, q: usize, s: usize) -> &mut f64 {
        match s {
            0..3 => &mut self.position[q][s],
            3..JOINT_NAVIGATION => &mut self.velocity[q][s - 3],
            _ => &mut self.clock[q][s - JOINT_NAVIGATION],
        }
    }
}

/// The scalar measurements of an update. Vectors by rows; entry q of u_q and z_q is 1 and not stored.
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
    /// Σ ν_q² / s_q.
    taken: f64,
    /// Σ e_q η_q².
    explained: f64,
}

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
        taken: 0.0,
        explained: 0.0,
    };

    /// Fills everything that the caller has not; returns νᵀ S⁻¹ ν of all measurements.
    pub fn take(&mut self, information: &EpochInformation<M>) -> f64 {
        (self.taken, self.explained) = (0.0, 0.0);
        factorise(information, self);
        take_all(self);
        let unexplained = information.weighted_square - self.explained;
        self.taken + if unexplained > 0.0 { unexplained } else { 0.0 }
    }
}

/// What is done once per row of a joint block or per scalar measurement. The number is a constant of the
/// compiler, so that loops up to it are unrolled and their entries stay in registers.
pub(super) trait PerRow {
    fn run<const Q: usize>(&mut self);
}

/// Runs for 0, 1, … M − 1.
#[inline(always)]
pub(super) fn for_each<const M: usize>(work: &mut impl PerRow) {
    const { assert!(8 <= M && M <= MAX_JOINT) };
    work.run::<0>();
    work.run::<1>();
    work.run::<2>();
    work.run::<3>();
    work.run::<4>();
    work.run::<5>();
    work.run::<6>();
    work.run::<7>();
    if M > 8 {
        work.run::<8>();
    }
    if M > 9 {
        work.run::<9>();
    }
}

struct Factorisation<'a, const K: usize, const M: usize> {
    information: &'a EpochInformation<M>,
    design: &'a mut [[f64; M]; M],
    scalar: &'a mut [Scalar; M],
    explained: &'a mut f64,
}

impl<const K: usize, const M: usize> PerRow for Factorisation<'_, K, M> {
    /// Row q of Λ less what the later measurements have of it, divided by its pivot.
    #[inline(always)]
    fn run<const BEFORE_LAST: usize>(&mut self) {
        let q = M - 1 - BEFORE_LAST;
        let mut row = self.information.matrix[q];
        let mut weighted = self.information.vector[q];
        for later in q + 1..M {
            let u = self.design[later][q];
            let share = u * self.scalar[later].information;
            for s in 0..q {
                row[s] -= share * self.design[later][s];
            }
            row[q] -= share * u;
            weighted -= u * self.scalar[later].weighted;
        }
        let mut pivot = row[q];
        let mut inverse = 1.0 / pivot;
        if !(libm::fabs(pivot) > RANK_TOLERANCE * self.information.matrix[q][q]) {
            (pivot, inverse, weighted) = (0.0, 0.0, 0.0);
        }
        for s in 0..q {
            self.design[q][s] = row[s] * inverse;
        }
        self.scalar[q].information = pivot;
        self.scalar[q].weighted = weighted;
        *self.explained += weighted * weighted * inverse;
    }
}

#[inline(never)]
fn factorise<const K: usize, const M: usize>(
    information: &EpochInformation<M>,
    joint: &mut JointWorkspace<K, M>,
) {
    for_each::<M>(&mut Factorisation::<K, M> {
        information,
        design: &mut joint.design,
        scalar: &mut joint.scalar,
        explained: &mut joint.explained,
    });
}

impl<const K: usize, const M: usize> PerRow for JointWorkspace<K, M> {
    #[inline(always)]
    fn run<const Q: usize>(&mut self) {
        if Q < M {
            take_one::<Q, K, M>(self);
        }
    }
}

#[inline(never)]
fn take_all<const K: usize, const M: usize>(joint: &mut JointWorkspace<K, M>) {
    for_each::<M>(joint);
}

#[inline(never)]
fn take_one<const Q: usize, const K: usize, const M: usize>(joint: &mut JointWorkspace<K, M>) {
    let u = &joint.design[Q];
    let mut predicted = joint.state[Q];
    for s in 0..Q {
        predicted += u[s] * joint.state[s];
    }
    predicted += shares::<Q, K, M>(&mut joint.directions, u, &joint.scalar, &mut joint.share);
    combine::<Q, M>(u, &joint.share, &mut joint.combination);
    let variance = direct::<Q, K, M>(
        &joint.covariance,
        &joint.combination[Q],
        u,
        &mut joint.directions,
    );
    let scalar = &mut joint.scalar[Q];
    let shrinks_by = 1.0 + scalar.information * variance;
    let mut scale = 1.0 / shrinks_by;
    if !(shrinks_by > MIN_SHRINKAGE) {
        scale = 0.0;
    }
    let innovation = scalar.weighted - scalar.information * predicted;
    scalar.precision = scalar.information * scale;
    scalar.step = innovation * scale;
    if scalar.information != 0.0 {
        joint.taken += innovation * scalar.step / scalar.information;
    }
}

/// (v_pᵀ u)/s_p; returns u_qᵀ of what the measurements before have moved the state by.
#[inline(never)]
fn shares<const Q: usize, const K: usize, const M: usize>(
    directions: &mut Directions<K, M>,
    u: &[f64; M],
    scalar: &[Scalar; M],
    share: &mut [f64; M],
) -> f64 {
    let mut moved = 0.0;
    for p in 0..Q {
        let mut along = *directions.entry(p, Q);
        for s in 0..Q {
            along += *directions.entry(p, s) * u[s];
        }
        moved += along * scalar[p].step;
        share[p] = along * scalar[p].precision;
    }
    moved
}

/// z_q.
#[inline(never)]
fn combine<const Q: usize, const M: usize>(
    u: &[f64; M],
    share: &[f64; M],
    combination: &mut [[f64; M]; M],
) {
    let mut z = *u;
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
        for s in 0..M {
            v[s] += covariance[p][s] * z[p];
        }
    }
    let mut variance = v[Q];
    for s in 0..Q {
        variance += u[s] * v[s];
    }
    for s in 0..M {
        *directions.entry(Q, s) = v[s];
    }
    variance
}
