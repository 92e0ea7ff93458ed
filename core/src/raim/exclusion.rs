//! Which rows are faulty, if the epoch tells it beyond doubt.
//!
//! In: a factored epoch whose test failed, thresholds, and how many simultaneous faults to reckon
//! with. Out: the rows to leave out, or why none can be named.
//!
//! | symbol | code        | shape | unit | meaning                                                   |
//! |--------|-------------|-------|------|-----------------------------------------------------------|
//! | K      | `RowSet`    |       |      | a set of rows supposed faulty, everything else healthy    |
//! | S_KK   |             | k × k | 1    | its block of the projector S = I − Q₁Q₁ᵀ                  |
//! | w_K    | `residual`  | k     | 1    | its whitened residuals                                    |
//! | ΔSSE   | `reduction` | 1     | 1    | w_Kᵀ S_KK⁻¹ w_K: what the statistic loses without K      |
//! | r_K    | `rank`      | 1     | 1    | rank of S_KK: what the redundancy loses without K         |
//!
//! Equations: ΔSSE is the generalised likelihood ratio of K against no fault [BAARDA-1968]
//! [TEUNISSEN-2018]; for one row it is the squared normalised residual w²/S_ii. S_KK is eliminated one row
//! after the other; a direction in which it is singular adds nothing to either, because there a
//! fault of K shows in no residual. Keys: docs/references.md.
//!
//! **The rule.** K *explains* the epoch when the test passes without it: SSE − ΔSSE_K ≤ T(redundancy −
//! r_K). The candidate is the smallest set that explains the epoch and leaves a redundancy to test
//! what remains; of several of that size the one with the largest ΔSSE. It is excluded only if no rival
//! is left: every other set of at most the given number of rows that neither contains it nor is
//! contained in it must fail to explain the epoch, and be less likely than the candidate by
//! [`ISOLATION_ODDS`]. Otherwise the answer is [`NotIsolated::Ambiguous`].
//!
//! Why rivals of every size: three equal faults on three of a constellation's four satellites are, up
//! to a shift of its clock, one fault on the fourth. The single fault explains the epoch perfectly and
//! is the smallest set, and excluding it takes the one healthy satellite out and leaves the faulty
//! ones in. The set of the true faults always explains the epoch, except with the false-alarm
//! probability of the test; so the rule excludes a healthy row and keeps a faulty one no more often than
//! that, as long as the faults are no more than it reckons with. The price is redundancy: k rows
//! explain anything when k is the whole redundancy, so that reckoning with k faults needs one of k + 1 and
//! more where the sky is poor. A receiver with few satellites must reckon with fewer faults or live
//! with alerts.
//!
//! Cost: C(n, 1) + C(n, 2) + C(n, 3) sets of about 50 instructions, searched at most four times; only after
//! a failed test.

use super::slope::MIN_RESIDUAL_COFACTOR;
use super::thresholds::RaimTable;
use super::{TestStatistic, parity};
use crate::consts::{MAX_SATELLITES, MAX_UNKNOWNS};
use crate::linalg::qr::WhitenedQr;

/// Most rows excluded, and most simultaneous faults reckoned with.
pub const MAX_FAULTS: usize = 3;

/// The likelihood of the candidate over that of each rival, at least. With equal prior
/// probabilities these are posterior odds: one wrong exclusion in a million epochs with a fault.
pub const ISOLATION_ODDS: f64 = 1e6;

/// 2 ln([`ISOLATION_ODDS`]): for normal errors the log-likelihood of a set is −(SSE − ΔSSE)/2, so that the
/// statistics of candidate and rival must lie this far apart.
const MARGIN: f64 = 27.631_021_115_928_547;

const _: () = assert!(MAX_SATELLITES <= 64, "a row set is a 64-bit mask");

/// A set of rows of an epoch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RowSet {
    bits: u64,
}

impl RowSet {
    /// No row.
    pub const EMPTY: Self = Self { bits: 0 };

    /// This set and the row; rows from 64 on change nothing.
    #[must_use]
    pub const fn with(self, row: usize) -> Self {
        Self {
            bits: if row < 64 {
                self.bits | 1 << row
            } else {
                self.bits
            },
        }
    }

    /// Whether the row is in the set.
    pub fn contains(self, row: usize) -> bool {
        row < 64 && self.bits & (1 << row) != 0
    }

    /// Whether every row of the other set is in this one.
    pub fn contains_all(self, other: Self) -> bool {
        self.bits & other.bits == other.bits
    }

    /// Number of rows.
    pub fn len(self) -> usize {
        self.bits.count_ones() as usize
    }

    /// Whether there is none.
    pub fn is_empty(self) -> bool {
        self.bits == 0
    }

    /// The rows, ascending.
    pub fn iter(self) -> impl Iterator<Item = usize> {
        (0..64).filter(move |row| self.contains(*row))
    }
}

/// The rows that are faulty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exclusion {
    /// Rows to leave out, 1 to [`MAX_FAULTS`].
    pub rows: RowSet,
    /// The statistic of what remains, which passes its threshold. The caller solves and tests again:
    /// this one stands on the linearisation that still had the faulty rows in it.
    pub remaining: TestStatistic,
}

/// Why no row can be named.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NotIsolated {
    /// Nothing is factored, the thin Q is not formed, there is no redundancy, or the table is empty.
    NotTestable,
    /// The test passes: there is nothing to exclude.
    NoFault,
    /// The number of faults to reckon with is 0 or above [`MAX_FAULTS`].
    FaultsOutOfRange {
        /// The number given.
        max_faults: usize,
    },
    /// No set of that many rows explains the epoch and leaves something to test.
    Unexplained,
    /// Two sets explain the epoch, and excluding either could leave a faulty row in.
    Ambiguous {
        /// The most likely set of the smallest size.
        candidate: RowSet,
        /// A set that contradicts it.
        rival: RowSet,
    },
}

/// One row of the search.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    /// Its row of the thin Q, zero beyond the unknowns.
    q: [f64; MAX_UNKNOWNS],
    /// S_ii, and after one row has been eliminated.
    cofactor: f64,
    cofactor_reduced: f64,
    /// w_i, and after one row has been eliminated.
    residual: f64,
    residual_reduced: f64,
    /// S_ij with the eliminated row.
    coupling: f64,
}

/// Memory of the search, owned by the caller (5 kB).
#[derive(Clone, Debug)]
pub struct ExclusionWorkspace {
    residuals: [f64; MAX_SATELLITES],
    candidates: [Candidate; MAX_SATELLITES],
}

impl ExclusionWorkspace {
    /// Nothing searched.
    pub const EMPTY: Self = Self {
        residuals: [0.0; MAX_SATELLITES],
        candidates: [Candidate {
            q: [0.0; MAX_UNKNOWNS],
            cofactor: 0.0,
            cofactor_reduced: 0.0,
            residual: 0.0,
            residual_reduced: 0.0,
            coupling: 0.0,
        }; MAX_SATELLITES],
    };
}

/// A set of rows supposed faulty, and what the epoch loses without it.
#[derive(Clone, Copy)]
struct Hypothesis {
    rows: RowSet,
    reduction: f64,
    rank: usize,
}

/// Finds the faulty rows of an epoch whose test failed, reckoning with at most `max_faults` at a time,
/// which are also the most it excludes. The thin Q must have been formed
/// ([`super::slope::Sensitivity::fill`] does).
///
/// # Errors
/// [`NotIsolated`]: the epoch stays in alert.
#[inline(never)]
pub fn identify(
    qr: &WhitenedQr,
    table: &RaimTable,
    max_faults: usize,
    workspace: &mut ExclusionWorkspace,
) -> Result<Exclusion, NotIsolated> {
    let total = parity::statistic(qr).map_err(|_| NotIsolated::NotTestable)?;
    let threshold = table
        .threshold(total.redundancy)
        .ok_or(NotIsolated::NotTestable)?;
    if qr.thin_q().is_empty() {
        return Err(NotIsolated::NotTestable);
    }
    if total.passes(threshold) {
        return Err(NotIsolated::NoFault);
    }
    if max_faults == 0 || max_faults > MAX_FAULTS {
        return Err(NotIsolated::FaultsOutOfRange { max_faults });
    }
    // Threshold by rank taken out; what takes all redundancy out explains anything.
    let mut limits = [f64::INFINITY; MAX_FAULTS + 1];
    for (rank, limit) in limits.iter_mut().enumerate() {
        if let Some(redundancy) = total.redundancy.checked_sub(rank)
            && redundancy > 0
        {
            *limit = table
                .threshold(redundancy)
                .ok_or(NotIsolated::NotTestable)?;
        }
    }
    // An infinite limit where the rank is out of range doubts, too.
    let limit_of = |rank: usize| limits.get(rank).copied().unwrap_or(f64::INFINITY);

    qr.residuals(&mut workspace.residuals);
    let candidates = prepare(qr, workspace);

    let mut best: Option<Hypothesis> = None;
    for size in 1..=max_faults {
        for_each_set(candidates, size, &mut |hypothesis| {
            let is_candidate = hypothesis.rows.len() == size
                && hypothesis.rank == size
                && size < total.redundancy
                && total.sum_of_squares - hypothesis.reduction <= limit_of(size);
            if is_candidate && best.is_none_or(|best| hypothesis.reduction > best.reduction) {
                best = Some(hypothesis);
            }
        });
        if best.is_some() {
            break;
        }
    }
    let best = best.ok_or(NotIsolated::Unexplained)?;
    let left = total.sum_of_squares - best.reduction;

    let mut rival = None;
    for_each_set(candidates, max_faults, &mut |hypothesis| {
        let rows = hypothesis.rows;
        if rows.contains_all(best.rows) || best.rows.contains_all(rows) {
            return;
        }
        let limit = limit_of(hypothesis.rank);
        let required = if limit > left + MARGIN {
            limit
        } else {
            left + MARGIN
        };
        // NaN is a rival.
        let is_ruled_out = total.sum_of_squares - hypothesis.reduction > required;
        if !is_ruled_out {
            rival = Some(rows);
        }
    });
    match rival {
        Some(rival) => Err(NotIsolated::Ambiguous {
            candidate: best.rows,
            rival,
        }),
        None => Ok(Exclusion {
            rows: best.rows,
            remaining: TestStatistic {
                // Rounding can leave a perfect explanation just below zero.
                sum_of_squares: if left > 0.0 { left } else { 0.0 },
                redundancy: total.redundancy - best.rank,
            },
        }),
    }
}

/// Copies what the search needs of each row.
fn prepare<'a>(qr: &WhitenedQr, workspace: &'a mut ExclusionWorkspace) -> &'a mut [Candidate] {
    let m = qr.m();
    let rows = workspace
        .candidates
        .iter_mut()
        .zip(qr.thin_q())
        .zip(&workspace.residuals);
    for ((candidate, q), residual) in rows {
        candidate.q = [0.0; MAX_UNKNOWNS];
        for (entry, given) in candidate.q.iter_mut().zip(q).take(m) {
            *entry = *given;
        }
        candidate.cofactor = 1.0 - dot(&candidate.q, &candidate.q);
        candidate.residual = *residual;
    }
    workspace
        .candidates
        .get_mut(..qr.thin_q().len())
        .unwrap_or(&mut [])
}

fn dot(a: &[f64; MAX_UNKNOWNS], b: &[f64; MAX_UNKNOWNS]) -> f64 {
    let mut sum = 0.0;
    for (x, y) in a.iter().zip(b) {
        sum += x * y;
    }
    sum
}

/// The inverse of a pivot, and the rank it adds; zero where the direction shows in no residual.
fn pivot(cofactor: f64) -> (f64, usize) {
    if cofactor >= MIN_RESIDUAL_COFACTOR {
        (1.0 / cofactor, 1)
    } else {
        (0.0, 0)
    }
}

/// Visits every set of 1 to `size` rows (at most three), by eliminating one row of S after the other.
fn for_each_set(candidates: &mut [Candidate], size: usize, visit: &mut impl FnMut(Hypothesis)) {
    for first in 0..candidates.len() {
        let Some((one, rest)) = candidates
            .get_mut(first..)
            .and_then(<[Candidate]>::split_first_mut)
        else {
            return;
        };
        let (inverse_one, rank_one) = pivot(one.cofactor);
        let with_one = Hypothesis {
            rows: RowSet::EMPTY.with(first),
            reduction: one.residual * one.residual * inverse_one,
            rank: rank_one,
        };
        visit(with_one);
        if size < 2 {
            continue;
        }
        for other in rest.iter_mut() {
            other.coupling = -dot(&one.q, &other.q);
            let scaled = other.coupling * inverse_one;
            other.cofactor_reduced = other.cofactor - other.coupling * scaled;
            other.residual_reduced = other.residual - one.residual * scaled;
        }
        let mut remaining = &*rest;
        let mut second = first;
        while let Some((two, rest)) = remaining.split_first() {
            remaining = rest;
            second += 1;
            let (inverse_two, rank_two) = pivot(two.cofactor_reduced);
            let with_two = Hypothesis {
                rows: with_one.rows.with(second),
                reduction: with_one.reduction
                    + two.residual_reduced * two.residual_reduced * inverse_two,
                rank: rank_one + rank_two,
            };
            visit(with_two);
            if size < 3 {
                continue;
            }
            let scaled_coupling = two.coupling * inverse_one;
            for (third, three) in (second + 1..).zip(rest) {
                let coupling = -dot(&two.q, &three.q) - scaled_coupling * three.coupling;
                let scaled = coupling * inverse_two;
                let (inverse_three, rank_three) = pivot(three.cofactor_reduced - coupling * scaled);
                let residual = three.residual_reduced - two.residual_reduced * scaled;
                visit(Hypothesis {
                    rows: with_two.rows.with(third),
                    reduction: with_two.reduction + residual * residual * inverse_three,
                    rank: with_two.rank + rank_three,
                });
            }
        }
    }
}
