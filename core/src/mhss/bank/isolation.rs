//! What explains a failed test when no single satellite does: two satellites, or a constellation.
//!
//! In: the rows of the epoch, the filters without two satellites or without a constellation. Out: the
//! [`Explanation`], if there is one and no rival.
//!
//! | symbol | code             | unit | meaning                                                       |
//! |--------|------------------|------|---------------------------------------------------------------|
//! | SSE_H  | `sum_of_squares` | 1    | Σ (z_i − h_i x_H)²/σ_i² of the pseudoranges that filter H has |
//!
//! A filter without the faulty satellites agrees with all it has; every other filter has a faulty one in it
//! and disagrees with some of it. There are no filters without three, so that the test of a single
//! satellite, by what happens when a second one is left out too, cannot be made of pairs. The rule is that of
//! the snapshot's exclusion (docs/decisions/002): the hypothesis must fit, SSE_H within the chi-square limit
//! of its rows, must leave a redundancy that can tell, and be more likely than every rival by
//! a million to one.

use super::{Bank, MAX_BANK, Secondaries, SubFilters, pair};
use crate::consts::MAX_CLOCKS;
use crate::ekf::layout::{JOINT_NAVIGATION, POSITION};
use crate::ekf::{Filter, MeasurementRow};
use crate::gnss::{Satellite, System};
use crate::stats::{StatsError, chi2};

/// 2 ln of the odds by which a hypothesis must be more likely than its rivals.
const MARGIN: f64 = 27.631_021_115_928_547;
/// Redundancy that a hypothesis must leave: one more than what any two rows could explain.
const MIN_REDUNDANCY: usize = 2;

/// What explains a detected fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Explanation {
    /// A satellite.
    One(Satellite),
    /// Two satellites at once.
    Two([Satellite; 2]),
    /// A whole constellation.
    Constellation(System),
}

/// Chi-square limits of post-fit residuals by the number of rows, computed once.
#[derive(Clone, Debug)]
pub struct PostfitLimits {
    limits: [f64; MAX_BANK],
}

impl PostfitLimits {
    /// Not computed: nothing fits.
    pub const EMPTY: Self = Self {
        limits: [0.0; MAX_BANK],
    };

    /// For a probability that rows without a fault do not fit.
    ///
    /// # Errors
    /// [`StatsError`] when it is no probability; nothing has changed then.
    pub fn fill(&mut self, probability: f64) -> Result<(), StatsError> {
        let mut filled = Self::EMPTY;
        for (rows, limit) in (1_u32..).zip(&mut filled.limits) {
            *limit = chi2::upper_quantile(rows, probability)?;
        }
        *self = filled;
        Ok(())
    }

    fn fits(&self, sum_of_squares: f64, rows: usize) -> bool {
        let limit = self.limits.get(rows.wrapping_sub(1));
        limit.is_some_and(|limit| sum_of_squares <= *limit)
    }
}

/// How well a filter fits the rows it has.
#[derive(Clone, Copy, Debug)]
struct Fit {
    sum_of_squares: f64,
    rows: usize,
    clocks: usize,
}

impl Fit {
    fn can_tell(&self) -> bool {
        self.rows >= 3 + self.clocks + MIN_REDUNDANCY
    }
}

impl<const K: usize, const M: usize> Bank<K, M> {
    /// What explains the epoch's failed test when no single satellite does.
    #[inline(never)]
    pub fn explain(
        &self,
        limits: &PostfitLimits,
        vertical: bool,
        sub: &SubFilters<K, M>,
        secondaries: &Secondaries<K, M>,
    ) -> Option<Explanation> {
        self.two(limits, vertical, sub, secondaries)
            .map(Explanation::Two)
            .or_else(|| {
                self.constellation(limits, vertical, sub)
                    .map(Explanation::Constellation)
            })
    }

    /// Whether the aids explain the epoch's failed test: the filter without them fits all satellites, its own
    /// test failed, and no filter that has the aids fits the satellites it has. To be asked before
    /// satellites are blamed: a filter that an aid has drawn away disagrees with many of them.
    #[inline(never)]
    pub fn aids_explain(
        &self,
        limits: &PostfitLimits,
        vertical: bool,
        main: &Filter<K, M>,
        sub: &SubFilters<K, M>,
    ) -> bool {
        if !self.unaided.is_some_and(|own| own.is_failed(vertical)) {
            return false;
        }
        let fits = |fit: Fit| limits.fits(fit.sum_of_squares, fit.rows);
        let unaided = self.fit(&sub.unaided, |_| true);
        // Without a satellite there is nothing that could speak for or against it.
        if !fits(unaided) {
            return false;
        }
        let aided = self.fit(main, |_| true);
        if !(aided.sum_of_squares > unaided.sum_of_squares + MARGIN) {
            return false;
        }
        self.members.iter().all(|member| {
            let filter = sub.filters.get(member.place);
            filter.is_some_and(|filter| {
                let fit = self.fit(filter, |satellite| satellite != member.satellite);
                fit.sum_of_squares > unaided.sum_of_squares + MARGIN
            })
        })
    }

    /// Two satellites without which everything fits, if no other two and no single one come near.
    fn two(
        &self,
        limits: &PostfitLimits,
        vertical: bool,
        sub: &SubFilters<K, M>,
        secondaries: &Secondaries<K, M>,
    ) -> Option<[Satellite; 2]> {
        if self.pairs_are_dropped {
            return None;
        }
        let mut best: Option<(f64, [Satellite; 2])> = None;
        // The sum of squares of the likeliest rival.
        let mut rival = f64::INFINITY;
        for (at, member) in self.members.iter().enumerate() {
            let single = sub.filters.get(member.place)?;
            let fit = self.fit(single, |satellite| satellite != member.satellite);
            if !(fit.sum_of_squares >= rival) {
                rival = fit.sum_of_squares;
            }
            for other in self.members.iter().skip(at + 1) {
                let without = [member.satellite, other.satellite];
                let filter = secondaries.filters.get(pair(member.place, other.place))?;
                let fit = self.fit(filter, |satellite| !without.contains(&satellite));
                let fits = fit.can_tell()
                    && limits.fits(fit.sum_of_squares, fit.rows)
                    && (member.separation.is_failed(vertical)
                        || other.separation.is_failed(vertical));
                let is_best = fits && best.is_none_or(|(least, _)| fit.sum_of_squares < least);
                let beaten = if is_best {
                    let (before, _) = best.unwrap_or((f64::INFINITY, without));
                    best = Some((fit.sum_of_squares, without));
                    before
                } else {
                    fit.sum_of_squares
                };
                if !(beaten >= rival) {
                    rival = beaten;
                }
            }
        }
        let (sum_of_squares, without) = best?;
        (rival > sum_of_squares + MARGIN).then_some(without)
    }

    /// The one constellation without which everything fits, and whose own test failed. Two constellations that
    /// are each consistent in themselves leave it open: which of them the main filter follows, and whose
    /// test therefore passes, is a matter of their numbers, not of their health.
    fn constellation(
        &self,
        limits: &PostfitLimits,
        vertical: bool,
        sub: &SubFilters<K, M>,
    ) -> Option<System> {
        let mut found = None;
        for ((system, place), filter) in System::ALL
            .into_iter()
            .zip(&self.constellations)
            .zip(&sub.constellations)
        {
            let Some(separation) = place else {
                continue;
            };
            let fit = self.fit(filter, |satellite| satellite.system() != system);
            if !limits.fits(fit.sum_of_squares, fit.rows) {
                continue;
            }
            // One that cannot be told from it leaves it open.
            if found.is_some() || !fit.can_tell() {
                return None;
            }
            found = Some((system, separation.is_failed(vertical)));
        }
        found.and_then(|(system, is_failed)| is_failed.then_some(system))
    }

    /// Post-fit residuals of the pseudoranges that a filter has.
    #[inline(never)]
    fn fit(&self, filter: &Filter<K, M>, has: impl Fn(Satellite) -> bool) -> Fit {
        let mut fit = Fit {
            sum_of_squares: 0.0,
            rows: 0,
            clocks: 0,
        };
        let mut systems = [false; MAX_CLOCKS];
        for (_, satellite, row) in self.present() {
            if !has(satellite) {
                continue;
            }
            let residual_m = residual(row, filter);
            fit.sum_of_squares += row.weight * (residual_m * residual_m);
            fit.rows += 1;
            if let Some(system) = systems.get_mut(satellite.system().index()) {
                *system = true;
            }
        }
        fit.clocks = systems.iter().filter(|is_there| **is_there).count();
        fit
    }
}

/// Innovation of a pseudorange that is left after a filter's correction, m.
pub(crate) fn residual<const K: usize, const M: usize>(
    row: &MeasurementRow<M>,
    filter: &Filter<K, M>,
) -> f64 {
    let state = filter.state();
    let [position, ..] = state.navigation;
    let mut residual_m = row.innovation_m;
    for (design, error) in row.pseudorange.iter().zip(&position) {
        residual_m -= design * error;
    }
    let clocks = row.pseudorange.iter().skip(JOINT_NAVIGATION);
    for (design, error) in clocks.zip(&state.clock) {
        residual_m -= design * error;
    }
    residual_m
}

const _: () = assert!(POSITION == 0);
