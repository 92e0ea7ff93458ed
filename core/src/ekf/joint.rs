//! The part of an update on the joint block: an epoch's information as at most M scalar measurements,
//! taken one after the other.
//!
//! | symbol | code        | shape | meaning                                                     |
//! |--------|-------------|-------|-------------------------------------------------------------|
//! | u_q    | design      | M     | scalar measurement q is of u_qᵀ x; entries 0..=q, the last 1 |
//! | e_q    | information | 1     | its 1/σ², 0 where rank is missing                           |
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
//! Derivation: docs/decisions/005-tight-filter.md. Cost: about 2,000 instructions on a Cortex-M7 with
//! M = 8.

#![expect(
    clippy::indexing_slicing,
    reason = "indices are below M by the loops' bounds; the no-panic image is the judge"
)]

use super::information::EpochInformation;

/// A pivot below this part of its diagonal entry is rounding: M sums of products of f64 carry about
/// 1e-15 of it.
const RANK_TOLERANCE: f64 = 1.0e-13;

/// Most entries of a joint block: position, velocity and four clock states.
pub(super) const MAX_JOINT: usize = 10;

/// The scalar measurements of an update, vectors by rows.
#[derive(Clone, Debug)]
pub(super) struct JointWorkspace<const M: usize> {
    design: [[f64; M]; M],
    information: [f64; M],
    /// e_q η_q.
    weighted: [f64; M],
    /// G, filled by the caller.
    pub covariance: [[f64; M]; M],
    /// Error state of the joint block before the update, filled by the caller.
    pub state: [f64; M],
    pub combination: [[f64; M]; M],
    pub direction: [[f64; M]; M],
    pub precision: [f64; M],
    /// ν_q / s_q, with the innovation ν_q = η_q − u_qᵀ x.
    pub step: [f64; M],
    /// Σ ν_q² / s_q.
    taken: f64,
    /// Σ e_q η_q².
    explained: f64,
}

impl<const M: usize> JointWorkspace<M> {
    pub const EMPTY: Self = Self {
        design: [[0.0; M]; M],
        information: [0.0; M],
        weighted: [0.0; M],
        covariance: [[0.0; M]; M],
        state: [0.0; M],
        combination: [[0.0; M]; M],
        direction: [[0.0; M]; M],
        precision: [0.0; M],
        step: [0.0; M],
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

/// What is done once per scalar measurement. Its number is a constant of the compiler, so that loops up
/// to it are unrolled and their entries stay in registers.
pub(super) trait PerMeasurement {
    fn run<const Q: usize>(&mut self);
}

/// Runs for 0, 1, … M − 1.
#[inline(always)]
pub(super) fn for_each<const M: usize>(work: &mut impl PerMeasurement) {
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

struct Factorisation<'a, const M: usize> {
    information: &'a EpochInformation<M>,
    joint: &'a mut JointWorkspace<M>,
}

impl<const M: usize> PerMeasurement for Factorisation<'_, M> {
    /// Row q of Λ less what the later measurements have of it, divided by its pivot.
    #[inline(always)]
    fn run<const BEFORE_LAST: usize>(&mut self) {
        let q = M - 1 - BEFORE_LAST;
        let joint = &mut *self.joint;
        let mut row = self.information.matrix[q];
        let mut weighted = self.information.vector[q];
        for later in q + 1..M {
            let u = joint.design[later][q];
            let share = u * joint.information[later];
            for s in 0..=q {
                row[s] -= share * joint.design[later][s];
            }
            weighted -= u * joint.weighted[later];
        }
        let mut pivot = row[q];
        let mut inverse = 1.0 / pivot;
        if !(pivot > RANK_TOLERANCE * self.information.matrix[q][q]) {
            (pivot, inverse, weighted) = (0.0, 0.0, 0.0);
        }
        for s in 0..q {
            joint.design[q][s] = row[s] * inverse;
        }
        joint.design[q][q] = 1.0;
        joint.information[q] = pivot;
        joint.weighted[q] = weighted;
        joint.explained += weighted * weighted * inverse;
    }
}

#[inline(never)]
fn factorise<const M: usize>(information: &EpochInformation<M>, joint: &mut JointWorkspace<M>) {
    for_each::<M>(&mut Factorisation { information, joint });
}

impl<const M: usize> PerMeasurement for JointWorkspace<M> {
    #[inline(always)]
    fn run<const Q: usize>(&mut self) {
        if Q < M {
            take_one::<Q, M>(self);
        }
    }
}

#[inline(never)]
fn take_all<const M: usize>(joint: &mut JointWorkspace<M>) {
    for_each::<M>(joint);
}

#[inline(never)]
fn take_one<const Q: usize, const M: usize>(joint: &mut JointWorkspace<M>) {
    let u = &joint.design[Q];
    let mut predicted = 0.0;
    for s in 0..=Q {
        predicted += u[s] * joint.state[s];
    }
    let mut parts = [0.0; Q];
    for p in 0..Q {
        let mut along = 0.0;
        for s in 0..=Q {
            along += joint.direction[p][s] * u[s];
        }
        predicted += along * joint.step[p];
        parts[p] = along * joint.precision[p];
    }
    let mut z = *u;
    for p in 0..Q {
        for s in 0..=p {
            z[s] -= parts[p] * joint.combination[p][s];
        }
    }
    let mut v = [0.0; M];
    for p in 0..=Q {
        for s in 0..M {
            v[s] += joint.covariance[p][s] * z[p];
        }
    }
    let mut variance = 0.0;
    for s in 0..=Q {
        variance += joint.design[Q][s] * v[s];
    }
    let information = joint.information[Q];
    let scale = 1.0 / (1.0 + information * variance);
    let innovation = joint.weighted[Q] - information * predicted;
    joint.precision[Q] = information * scale;
    joint.step[Q] = innovation * scale;
    if information > 0.0 {
        joint.taken += innovation * innovation * scale / information;
    }
    joint.combination[Q] = z;
    joint.direction[Q] = v;
}
