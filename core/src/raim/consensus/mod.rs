//! Range consensus: subsets that just determine position and clocks predict every other pseudorange.
//!
//! In: a linearised epoch. Out: of every subset, the prediction errors of the rows it does not use, each with
//! its own sigma. What is made of them: [`super::ranco`], [`super::s_ranco`], [`super::foim`].
//!
//! | symbol | code | shape | unit | meaning |
//! |--------|------|-------|------|---------|
//! | K, s   | `CLOCKS` | | 1 | clocks; a subset has s = 3 + K members, of each clock at least one |
//! | d_t, Δ_t | `differences` | 3 | 1, m | a member minus the first of its clock: direction, residual |
//! | g_t    | `inverse` | 3 | 1 | column of D⁻¹: what 1 m on Δ_t does to the position |
//! | w_t    | `weight` | 1 | 1 | d·g_t: what it does to the prediction of a row with difference d |
//! | r, σ_r² | `Prediction` | 1 | m, m² | measured minus predicted, and its variance |
//!
//! Equations: differences take the clocks out, x = Σ g_t Δ_t with g₁ = d₂ × d₃/(d₁·(d₂ × d₃)) and cyclically. The
//! prediction of a row is a linear combination of the members with the coefficients w_t, and 1 − Σ w_t on the
//! first member of its clock and −Σ w_t on those of the other clocks, sums over the differences of that clock. Its
//! variance has those squared, and the row's own: the sigma of the *prediction*, not that of the row
//! alone. Source of the method: [P4] 2.2, [SCHROTH-2008]. Keys: docs/references.md.
//!
//! A prediction whose sigma is above [`MAX_PREDICTION_RATIO`] times that of the row tells nothing and is
//! not counted; so that a subset of poor geometry, to which every row seems to agree, acquits nobody.
//!
//! **More than one constellation.** A subset of four satellites has one clock; what it says of another
//! constellation is off by the unknown offset of the clocks. Here a subset has one member more for each clock
//! more and determines them all, so that no offset is assumed, a constellation of two or three satellites is
//! tested with the others' position, and skies in which no constellation has four are tested at all.
//!
//! Assumes directions of unit length, errors independent between rows. Rows without a clock (a height) are refused.

pub(crate) mod subsets;
pub mod suspicion;

use super::exclusion::RowSet;
use super::gdop4::pair_product;
use crate::consts::{MAX_CLOCKS, MAX_SATELLITES, MAX_UNKNOWNS};
use crate::linalg::LinearModel;
use suspicion::Suspicions;

/// Members of the largest subset: as many as unknowns.
pub const MAX_MEMBERS: usize = MAX_UNKNOWNS;

/// Largest sigma of a prediction over that of the row it predicts.
pub const MAX_PREDICTION_RATIO: f64 = 4.0;

/// Smallest volume spanned by three differences of directions; below it rounding takes the digits of the
/// inverse, and no prediction is good enough to count.
const LEAST_VOLUME: f64 = 1e-6;

/// Farthest a direction's squared length may be from 1.
const UNIT_TOLERANCE: f64 = 1e-6;

/// Why an epoch cannot be taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConsensusError {
    /// No row beyond those of a subset, or more than there is room for.
    RowsOutOfRange {
        /// Rows given.
        n: usize,
    },
    /// Clocks not between 1 and [`MAX_CLOCKS`].
    ClocksOutOfRange {
        /// Unknowns given.
        m: usize,
    },
    /// A row without a clock or with several, a direction not of unit length, a sigma not positive, or no number.
    Row {
        /// Which.
        row: usize,
    },
}

/// A row as the subsets use it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    direction: [f64; 3],
    clock: usize,
    residual_m: f64,
    variance_m2: f64,
}

impl Row {
    const EMPTY: Self = Self {
        direction: [0.0; 3],
        clock: 0,
        residual_m: 0.0,
        variance_m2: 1.0,
    };
}

/// Memory of the algorithms, owned by the caller (21 kB).
#[derive(Clone, Debug)]
pub struct ConsensusWorkspace {
    rows: [Row; MAX_SATELLITES],
    n: usize,
    clocks: usize,
    left_out: RowSet,
    pub(super) suspicions: Suspicions,
    /// E_ij of every pair of rows (`gdop4.rs`).
    pub(super) pairs: [[f64; MAX_SATELLITES]; MAX_SATELLITES],
}

impl ConsensusWorkspace {
    /// No epoch.
    pub const EMPTY: Self = Self {
        rows: [Row::EMPTY; MAX_SATELLITES],
        n: 0,
        clocks: 0,
        left_out: RowSet::EMPTY,
        suspicions: Suspicions::EMPTY,
        pairs: [[0.0; MAX_SATELLITES]; MAX_SATELLITES],
    };

    /// Takes an epoch.
    ///
    /// # Errors
    /// [`ConsensusError`]; the workspace then holds none.
    pub fn load(&mut self, model: &LinearModel) -> Result<(), ConsensusError> {
        self.n = 0;
        self.clocks = 0;
        self.left_out = RowSet::EMPTY;
        self.suspicions.clear(0);
        let clocks = model.m.saturating_sub(3);
        if !(1..=MAX_CLOCKS).contains(&clocks) {
            return Err(ConsensusError::ClocksOutOfRange { m: model.m });
        }
        if model.n <= model.m || model.n > MAX_SATELLITES {
            return Err(ConsensusError::RowsOutOfRange { n: model.n });
        }
        let given = model
            .design
            .iter()
            .zip(model.residual_m.iter().zip(&model.sigma_m))
            .take(model.n);
        for ((index, (design, (residual_m, sigma_m))), place) in
            given.enumerate().zip(&mut self.rows)
        {
            *place = row(design, clocks, *residual_m, *sigma_m)
                .ok_or(ConsensusError::Row { row: index })?;
        }
        self.n = model.n;
        self.clocks = clocks;
        Ok(())
    }

    /// Leaves rows out of what is counted from now on, as members and as predicted rows.
    pub fn leave_out(&mut self, rows: RowSet) {
        self.left_out = rows;
    }

    /// Whether a subset has a member that is left out.
    #[inline]
    pub(super) fn is_left_out(&self, members: &[usize]) -> bool {
        !self.left_out.is_empty() && members.iter().any(|row| self.left_out.contains(*row))
    }

    /// Clocks of the epoch; 0 without one.
    pub const fn clocks(&self) -> usize {
        self.clocks
    }

    /// Members of a subset.
    pub const fn members(&self) -> usize {
        3 + self.clocks
    }

    /// What was counted last.
    pub const fn suspicions(&self) -> &Suspicions {
        &self.suspicions
    }

    pub(super) fn rows(&self) -> &[Row] {
        self.rows.get(..self.n).unwrap_or(&[])
    }

    /// Forms E_ij above the diagonal, where members ascend.
    pub(super) fn multiply_pairs(&mut self) {
        let mut rest = self.rows.get(..self.n).unwrap_or(&[]);
        for pairs in &mut self.pairs {
            let Some((row, following)) = rest.split_first() else {
                return;
            };
            let places = pairs.iter_mut().skip(self.n - following.len());
            for (place, other) in places.zip(following) {
                *place = pair_product(&row.direction, &other.direction);
            }
            rest = following;
        }
    }

    /// Books what the predictions of a subset make of the other rows.
    #[inline(always)]
    pub(super) fn suspect<const CLOCKS: usize>(
        &mut self,
        members: &[usize],
        minimal: &Minimal<CLOCKS>,
        factor_squared: f64,
    ) {
        let rows = self.rows.get(..self.n).unwrap_or(&[]);
        let suspicions = &mut self.suspicions;
        suspicions.subsets += 1;
        let left_out = self.left_out;
        minimal.each_other(rows, members, |row, prediction| {
            if left_out.is_empty() || !left_out.contains(row) {
                suspicions.book(row, prediction.is_outlier(factor_squared));
            }
        });
    }
}

/// A row that makes sense.
fn row(design: &[f64; MAX_UNKNOWNS], clocks: usize, residual_m: f64, sigma_m: f64) -> Option<Row> {
    let [east, north, up, ..] = *design;
    let mut clock = None;
    for (index, entry) in design.iter().skip(3).take(clocks).enumerate() {
        if *entry == 1.0 && clock.is_none() {
            clock = Some(index);
        } else if *entry != 0.0 {
            return None;
        }
    }
    let clock = clock?;
    let excess = east * east + north * north + up * up - 1.0;
    let variance_m2 = sigma_m * sigma_m;
    // Written so that NaN refuses. The square root of the largest number is far above any pseudorange.
    let is_sound = libm::fabs(excess) <= UNIT_TOLERANCE
        && libm::fabs(residual_m) < 1e100
        && sigma_m > 0.0
        && variance_m2 > 0.0
        && variance_m2 < 1e100;
    is_sound.then_some(Row {
        direction: [east, north, up],
        clock,
        residual_m,
        variance_m2,
    })
}

/// Measured minus predicted.
#[derive(Clone, Copy)]
pub(super) struct Prediction {
    pub(super) error_squared_m2: f64,
    pub(super) variance_m2: f64,
}

impl Prediction {
    /// Whether the error is beyond so many sigmas; NaN is.
    #[inline]
    pub(super) fn is_outlier(&self, factor_squared: f64) -> bool {
        let is_inlier = self.error_squared_m2 <= factor_squared * self.variance_m2;
        !is_inlier
    }
}

#[derive(Clone, Copy)]
struct Difference {
    direction: [f64; 3],
    residual_m: f64,
    inverse: [f64; 3],
    clock: usize,
    variance_m2: f64,
}

impl Difference {
    #[inline(always)]
    fn set(&mut self, row: &Row, reference: &Row, clock: usize) {
        self.direction = minus(&row.direction, &reference.direction);
        self.residual_m = row.residual_m - reference.residual_m;
        self.clock = clock;
        self.variance_m2 = row.variance_m2;
    }
}

/// The solution of a subset that has as many members as unknowns; filled in place, because it is made
/// thousands of times an epoch.
pub(super) struct Minimal<const CLOCKS: usize> {
    /// The first member of each clock.
    references: [Row; CLOCKS],
    differences: [Difference; 3],
    position_m: [f64; 3],
}

impl<const CLOCKS: usize> Minimal<CLOCKS> {
    /// Of no subset.
    pub(super) const EMPTY: Self = Self {
        references: [Row::EMPTY; CLOCKS],
        differences: [Difference {
            direction: [0.0; 3],
            residual_m: 0.0,
            inverse: [0.0; 3],
            clock: 0,
            variance_m2: 0.0,
        }; 3],
        position_m: [0.0; 3],
    };

    /// The clock of a row, which with one clock is known beforehand.
    #[inline(always)]
    const fn clock_of(clock: usize) -> usize {
        if CLOCKS == 1 { 0 } else { clock }
    }

    /// Solves a subset; false where it leaves an unknown undetermined.
    #[inline(always)]
    pub(super) fn solve(&mut self, rows: &[Row], members: &[usize]) -> bool {
        self.difference(rows, members).is_some() && self.invert()
    }

    /// Takes the members of each clock minus its first; `None` where a clock has none.
    #[inline(always)]
    fn difference(&mut self, rows: &[Row], members: &[usize]) -> Option<()> {
        if CLOCKS == 1 {
            let &[first, ref others @ ..] = members.first_chunk::<4>()?;
            let reference = rows.get(first)?;
            *self.references.first_mut()? = *reference;
            for (difference, member) in self.differences.iter_mut().zip(others) {
                difference.set(rows.get(*member)?, reference, 0);
            }
            return Some(());
        }
        let mut has_reference = [false; CLOCKS];
        let mut differences = self.differences.iter_mut();
        for member in members {
            let row = rows.get(*member)?;
            let reference = self.references.get_mut(row.clock)?;
            let has = has_reference.get_mut(row.clock)?;
            if *has {
                // With a clock missing there are four or more.
                differences.next()?.set(row, reference, row.clock);
            } else {
                *has = true;
                *reference = *row;
            }
        }
        differences.next().is_none().then_some(())
    }

    /// Inverts the three differences; false where they span nothing.
    #[inline(always)]
    fn invert(&mut self) -> bool {
        let [first, second, third] = &mut self.differences;
        first.inverse = cross(&second.direction, &third.direction);
        second.inverse = cross(&third.direction, &first.direction);
        third.inverse = cross(&first.direction, &second.direction);
        let volume = dot(&first.direction, &first.inverse);
        // Written so that NaN refuses.
        if !(libm::fabs(volume) > LEAST_VOLUME) {
            return false;
        }
        let scale = 1.0 / volume;
        let mut position_m = [0.0; 3];
        for difference in &mut self.differences {
            for (inverse, x) in difference.inverse.iter_mut().zip(&mut position_m) {
                *inverse *= scale;
                *x += *inverse * difference.residual_m;
            }
        }
        self.position_m = position_m;
        true
    }

    /// Squared position dilution: what independent errors of 1 m on all members do to the position.
    pub(super) fn position_dilution_squared(&self) -> f64 {
        let mut sum = 0.0;
        let mut of_references = [[0.0; 3]; CLOCKS];
        for difference in &self.differences {
            sum += dot(&difference.inverse, &difference.inverse);
            if let Some(total) = of_references.get_mut(Self::clock_of(difference.clock)) {
                for (entry, inverse) in total.iter_mut().zip(&difference.inverse) {
                    *entry += inverse;
                }
            }
        }
        for total in &of_references {
            sum += dot(total, total);
        }
        sum
    }

    /// The prediction of a row that is no member.
    #[inline(always)]
    fn predict(&self, row: &Row) -> Option<Prediction> {
        let clock = Self::clock_of(row.clock);
        let reference = self.references.get(clock)?;
        let direction = minus(&row.direction, &reference.direction);
        let error_m = row.residual_m - reference.residual_m - dot(&direction, &self.position_m);
        let mut variance_m2 = row.variance_m2;
        let mut of_references = [0.0; CLOCKS];
        *of_references.get_mut(clock)? = 1.0;
        for difference in &self.differences {
            let weight = dot(&direction, &difference.inverse);
            variance_m2 += weight * weight * difference.variance_m2;
            *of_references.get_mut(Self::clock_of(difference.clock))? -= weight;
        }
        for (weight, reference) in of_references.iter().zip(&self.references) {
            variance_m2 += weight * weight * reference.variance_m2;
        }
        Some(Prediction {
            error_squared_m2: error_m * error_m,
            variance_m2,
        })
    }

    /// Visits the predictions that are good enough to tell, of all rows but the members.
    #[inline(always)]
    pub(super) fn each_other(
        &self,
        rows: &[Row],
        members: &[usize],
        mut visit: impl FnMut(usize, Prediction),
    ) {
        let mut members = members.iter();
        let mut member = members.next();
        for (index, row) in rows.iter().enumerate() {
            if member == Some(&index) {
                member = members.next();
                continue;
            }
            if let Some(prediction) = self.predict(row)
                && prediction.variance_m2
                    <= MAX_PREDICTION_RATIO * MAX_PREDICTION_RATIO * row.variance_m2
            {
                visit(index, prediction);
            }
        }
    }
}

/// The members as a set.
pub(crate) fn set_of(members: &[usize]) -> RowSet {
    members.iter().copied().fold(RowSet::EMPTY, RowSet::with)
}

#[inline(always)]
fn minus([ax, ay, az]: &[f64; 3], [bx, by, bz]: &[f64; 3]) -> [f64; 3] {
    [ax - bx, ay - by, az - bz]
}

#[inline(always)]
fn dot([ax, ay, az]: &[f64; 3], [bx, by, bz]: &[f64; 3]) -> f64 {
    ax * bx + ay * by + az * bz
}

#[inline(always)]
fn cross([ax, ay, az]: &[f64; 3], [bx, by, bz]: &[f64; 3]) -> [f64; 3] {
    [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]
}
