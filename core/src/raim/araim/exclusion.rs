//! Taking a fault out, and the levels of what remains.
//!
//! In: an evaluated epoch whose tests failed, its measurements. Out: [`AraimExclusion`], the mode taken out,
//! the position without it, and levels that count the risk of having taken out the wrong one.
//!
//! Candidates are the monitored modes, the most likely first: by the sum of squares that remains, the prior,
//! and a penalty for each degree of freedom that a mode takes (a constellation explains almost
//! anything). The first is taken out whose remaining satellites pass all their own tests: separations
//! against the modes that are still possible, and the sum of squares. The order decides what is available,
//! not what is safe.
//!
//! Risk. A receiver that may exclude has J + 1 outcomes, J monitored fault modes: nothing excluded, or one of
//! them. Each gets an equal share 1/(J + 1) of the integrity risk. In the outcome "j excluded" the remaining
//! satellites have passed tests against every mode that touches them, the true one included, whether j was
//! the right choice or not; their level keeps the share of j. The outcomes cannot happen together, so the
//! shares add up to the risk. Faults that no mode monitors are the same in all outcomes and are charged
//! once. Modes that the remaining satellites cannot monitor are charged to the share of that outcome. No
//! prior is used for which mode is likely to be excluded. Derivation: docs/decisions/007-araim.md.
//!
//! Source: [ARAIM-ADD] fault exclusion (candidates, tests of what remains); the split of the risk is ours.

use super::detection::Detection;
use super::levels::AraimLevels;
use super::modes::SatelliteSet;
use super::{Araim, AraimConstellation, AraimError, AraimParameters, AraimSatellite};

/// Most candidates tried.
pub const MAX_CANDIDATES: usize = 8;

/// Twice the logarithm of 100: a fault of unknown size, spread over a hundred sigmas, per degree.
const PENALTY_PER_DEGREE: f64 = 9.210_340_371_976_184;

/// A fault taken out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AraimExclusion {
    /// The satellites that are not used any more.
    pub excluded: SatelliteSet,
    /// Tests of the others; the position is theirs.
    pub remaining: Detection,
    /// Levels of the others, the risk of a wrong exclusion included.
    pub levels: AraimLevels,
}

/// Why nothing was excluded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NotExcluded {
    /// The epoch could not be tested.
    Error(AraimError),
    /// Its tests pass.
    NoFault,
    /// No candidate leaves satellites that agree and have levels.
    Unexplained,
}

impl From<AraimError> for NotExcluded {
    fn from(error: AraimError) -> Self {
        Self::Error(error)
    }
}

/// A mode and how likely it is: minus twice the logarithm, up to a constant.
#[derive(Clone, Copy)]
struct Candidate {
    excluded: SatelliteSet,
    score: f64,
}

impl Araim {
    /// As [`Araim::evaluate`], for a receiver that also excludes: the levels hold while nothing is
    /// excluded, with the share of the risk that this outcome has.
    ///
    /// # Errors
    /// [`AraimError`].
    pub fn evaluate_with_exclusion(
        &mut self,
        satellites: &[AraimSatellite],
        constellations: &[AraimConstellation],
        parameters: &AraimParameters,
    ) -> Result<AraimLevels, AraimError> {
        self.solve(satellites, constellations, parameters)?;
        let outcomes = self.outcomes();
        self.bound(parameters, self.p_not_monitored, outcomes)
    }

    /// What can come out of an epoch: nothing excluded, or one of the monitored fault modes.
    fn outcomes(&self) -> f64 {
        self.count as f64
    }

    /// Takes out the fault that made the tests of the evaluated epoch fail. `scratch` holds the remaining
    /// satellites afterwards.
    ///
    /// # Errors
    /// [`NotExcluded`]: the epoch stays in alert, or has none.
    #[inline(never)]
    pub fn exclude(
        &mut self,
        satellites: &[AraimSatellite],
        parameters: &AraimParameters,
        residual_m: &[f64],
        scratch: &mut Self,
    ) -> Result<AraimExclusion, NotExcluded> {
        parameters.check()?;
        if satellites.len() != self.all_in_view.n() {
            return Err(NotExcluded::Error(AraimError::ResidualsMismatch {
                residuals: residual_m.len(),
                satellites: self.all_in_view.n(),
            }));
        }
        let detection = self.test(residual_m, |_, _| {})?;
        if !detection.is_detected() {
            return Err(NotExcluded::NoFault);
        }
        let candidates = self.candidates(residual_m)?;
        for candidate in candidates.iter().flatten() {
            let excluded = candidate.excluded;
            let Ok(levels) = scratch.evaluate_without(self, satellites, parameters, excluded)
            else {
                continue;
            };
            let Ok(remaining) = scratch.test(residual_m, |_, _| {}) else {
                continue;
            };
            // Without redundancy nothing has been tested.
            if remaining.redundancy > 0 && !remaining.is_detected() {
                return Ok(AraimExclusion {
                    excluded,
                    remaining,
                    levels,
                });
            }
        }
        Err(NotExcluded::Unexplained)
    }

    /// The modes most likely to be there, best first.
    fn candidates(
        &mut self,
        residual_m: &[f64],
    ) -> Result<[Option<Candidate>; MAX_CANDIDATES], AraimError> {
        let fit = self.fit(residual_m)?;
        let mut best: [Option<Candidate>; MAX_CANDIDATES] = [None; MAX_CANDIDATES];
        let subsets = self.subsets.get(1..self.count).unwrap_or(&[]);
        for subset in subsets {
            let excluded = subset.excluded;
            if !self.all_in_view.leave_out(excluded, &mut self.leave_out) {
                continue;
            }
            let (_, reduction) = self.all_in_view.separation(&self.leave_out, &fit);
            let rank = self.leave_out.rank();
            if self.all_in_view.redundancy() <= rank {
                continue;
            }
            let mut entry = Some(Candidate {
                excluded,
                score: PENALTY_PER_DEGREE * rank as f64
                    - reduction
                    - 2.0 * libm::log(subset.p_instant),
            });
            for place in &mut best {
                let is_better = match (&entry, &place) {
                    (Some(new), Some(old)) => new.score < old.score,
                    (new, _) => new.is_some(),
                };
                if is_better {
                    core::mem::swap(place, &mut entry);
                }
            }
        }
        Ok(best)
    }

    /// Levels without the satellites `excluded`, in one of the outcomes of `whole`.
    fn evaluate_without(
        &mut self,
        whole: &Self,
        satellites: &[AraimSatellite],
        parameters: &AraimParameters,
        excluded: SatelliteSet,
    ) -> Result<AraimLevels, AraimError> {
        self.count = 0;
        let active = whole.all_in_view.active().without(excluded);
        self.all_in_view.form(satellites, active)?;
        self.modes.restrict(&whole.modes, excluded);
        let p_unmonitorable = self.solve_modes();
        // bound() divides by the outcomes: what only this one cannot monitor weighs in full.
        let outcomes = whole.outcomes();
        let charged = whole.p_not_monitored + p_unmonitorable * outcomes;
        let levels = self.bound(parameters, charged, outcomes)?;
        self.p_not_monitored = whole.p_not_monitored + p_unmonitorable;
        Ok(AraimLevels {
            p_not_monitored: self.p_not_monitored,
            ..levels
        })
    }
}
