//! Protection levels of the bank: what risk is left for which error.
//!
//! In: the tests of the bank, prior probabilities of faults, the risks of the phase of flight. Out: the
//! horizontal and the vertical level, or that the risk is spent.
//!
//! | symbol | code                  | unit | meaning                                                       |
//! |--------|-----------------------|------|---------------------------------------------------------------|
//! | T_k    | threshold_m           | m    | largest separation of hypothesis k that its test lets pass     |
//! | σ_k    | sigma_m               | m    | one sigma of the filter that hypothesis k leaves fault-free    |
//! | p_k    | probability           | 1    | prior probability that hypothesis k is true during the exposure|
//! | n      | `samples`             | 1    | independent samples of noise in the exposure                  |
//! | P      | `p_integrity`         | 1    | integrity risk of the axis over the exposure                  |
//!
//! Two forms, one interface ([`LevelForm`]):
//!
//! * fixed, [P0] (30)-(32): max(max_k (T_k + σ_k Q⁻¹(P_MD)), σ_0 Q⁻¹(P_H0/2));
//! * risk budget, after the reference algorithm of [ARAIM-ADD]: the least L with
//!   n (R(L/σ_0) + Σ_k p_k R((L − T_k)/σ_k)) ≤ P − P_unmonitored, where R(x) = 2 Q(x) vertically and
//!   exp(−x²/2) horizontally, which bounds the probability that a horizontal error of at most σ in every
//!   direction is longer than xσ.
//!
//! Hypotheses without a filter of their own (pairs of satellites, constellations when there is only one,
//! hypotheses that were dropped) are charged to P_unmonitored. Allocation and sources: `integrity/phases.rs`,
//! [`FaultPriors`]; docs/decisions/009-risk.md.

use super::separation::Separation;
use crate::consts::MAX_CLOCKS;
use crate::gnss::System;
use crate::stats::normal;

/// Halvings of the interval of the level: a five-thousandth of it is left.
const HALVINGS: usize = 12;

/// Prior probabilities of faults.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultPriors {
    /// That a satellite is faulty at an instant: 1e-5 per hour [GPS-SPS-PS] 3.5.1 for an hour.
    pub satellite: f64,
    /// That a satellite that was excluded once and taken back is: ten times as likely, by choice.
    pub readmitted: f64,
    /// That a constellation is, by its number. [ARAIM-ADD] suggests 1e-4 for those without a commitment, 1e-8 for
    /// GPS.
    pub constellation: [f64; MAX_CLOCKS],
    /// That an aid (a barometer, a standstill that was none) is wrong beyond its sigma: as a satellite, by
    /// choice (docs/decisions/017-aids.md).
    pub aids: f64,
}

impl FaultPriors {
    /// What the monitor reckons with.
    pub const PRESET: Self = Self {
        satellite: 1e-5,
        readmitted: 1e-4,
        constellation: {
            let mut priors = [1e-4; MAX_CLOCKS];
            priors[System::Gps.index()] = 1e-8;
            priors
        },
        aids: 1e-5,
    };
}

/// How a level is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LevelForm {
    /// Fixed quantiles, with those in [`Separation`] taken as they are.
    Fixed {
        /// Q⁻¹(P_H0/2).
        k_fault_free: f64,
    },
    /// A budget of risk.
    Budget(RiskBudget),
}

/// A budget of risk over an exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RiskBudget {
    /// Integrity risk, horizontal and vertical.
    pub p_integrity: [f64; 2],
    /// Independent samples of noise in the exposure, at least 1.
    pub samples: f64,
    /// Part of the risk without a filter that each axis is charged: all where one axis counts, half of it
    /// where both do.
    pub unmonitored_share: f64,
}

/// Part of the false alerts that the snapshot's opinion may raise; the rest is the bank's.
pub const SNAPSHOT_FALSE_ALERT_SHARE: f64 = 0.5;
/// Statistics of the bank this far apart are counted as independent, s. They remember for the time constant of
/// the filters, some ten seconds and more, at any rate of epochs.
pub const INDEPENDENT_STATISTIC_S: f64 = 10.0;
/// Position errors this far apart are counted as independent, s: the errors of pseudoranges last for minutes
/// to hours (docs/decisions/008-correlated-noise.md).
pub const INDEPENDENT_ERROR_S: f64 = 150.0;

/// The bank's share of the risks of a phase of flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BankAllocation {
    /// False-alert probability of all tests of one axis at one epoch.
    pub p_false_alert: f64,
    /// What the levels may spend.
    pub budget: RiskBudget,
}

impl BankAllocation {
    /// Splits what may happen in an exposure of `exposure_s`: false alerts between the two opinions, the
    /// independent samples and the two axes; integrity risk between the axes where both have a limit.
    pub fn new(
        exposure_s: f64,
        p_integrity: f64,
        p_false_alert: f64,
        both_axes_have_limits: bool,
    ) -> Self {
        let samples = |apart_s: f64| {
            let samples = exposure_s / apart_s;
            if samples > 1.0 { samples } else { 1.0 }
        };
        let axis_share = if both_axes_have_limits { 0.5 } else { 1.0 };
        Self {
            p_false_alert: p_false_alert * (1.0 - SNAPSHOT_FALSE_ALERT_SHARE) * 0.5
                / samples(INDEPENDENT_STATISTIC_S),
            budget: RiskBudget {
                p_integrity: [p_integrity * axis_share; 2],
                samples: samples(INDEPENDENT_ERROR_S),
                unmonitored_share: axis_share,
            },
        }
    }
}

/// One hypothesis that has a filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hypothesis<'a> {
    /// Its test.
    pub separation: &'a Separation,
    /// Its prior probability.
    pub probability: f64,
}

/// Horizontal and vertical level, m; `None` where the risk is spent or a number is none.
pub fn levels<'a, I: Iterator<Item = Hypothesis<'a>>>(
    form: &LevelForm,
    sigma_m: [f64; 2],
    hypotheses: impl Fn() -> I,
    p_unmonitored: f64,
) -> [Option<f64>; 2] {
    match form {
        LevelForm::Fixed { k_fault_free } => {
            let mut levels_m = sigma_m.map(|sigma| sigma * k_fault_free);
            for hypothesis in hypotheses() {
                let Separation {
                    threshold_m,
                    uncertainty_m,
                    ..
                } = *hypothesis.separation;
                let bounds = threshold_m.iter().zip(&uncertainty_m);
                for (level_m, (threshold_m, uncertainty_m)) in levels_m.iter_mut().zip(bounds) {
                    let bound_m = threshold_m + uncertainty_m;
                    if !(bound_m <= *level_m) {
                        *level_m = bound_m;
                    }
                }
            }
            levels_m.map(|level_m| level_m.is_finite().then_some(level_m))
        }
        LevelForm::Budget(budget) => {
            let [p_horizontal, p_vertical] = budget.p_integrity;
            let charged = p_unmonitored * budget.unmonitored_share;
            let [sigma_h, sigma_v] = sigma_m;
            let of_axis = |axis: usize| {
                hypotheses().map(move |hypothesis| {
                    let at = |of: &[f64; 2]| of.get(axis).copied().unwrap_or(f64::NAN);
                    Mode {
                        threshold_m: at(&hypothesis.separation.threshold_m),
                        sigma_m: at(&hypothesis.separation.sigma_m),
                        probability: hypothesis.probability,
                    }
                })
            };
            [
                solve(
                    (p_horizontal - charged) / budget.samples,
                    sigma_h,
                    || of_axis(0),
                    horizontal_tail,
                ),
                solve(
                    (p_vertical - charged) / budget.samples,
                    sigma_v,
                    || of_axis(1),
                    vertical_tail,
                ),
            ]
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Mode {
    threshold_m: f64,
    sigma_m: f64,
    probability: f64,
}

/// Bound on the probability that a horizontal error of at most one sigma in every direction is longer than
/// x sigma.
fn horizontal_tail(x: f64) -> f64 {
    if x > 0.0 {
        libm::exp(-0.5 * x * x)
    } else {
        1.0
    }
}

/// Probability that a vertical error is beyond x sigma.
fn vertical_tail(x: f64) -> f64 {
    if x > 0.0 {
        normal::upper_tail(x).map_or(1.0, |tail| 2.0 * tail)
    } else {
        1.0
    }
}

/// The least level whose risk is within the budget, rounded up.
#[inline(never)]
fn solve<I: Iterator<Item = Mode>>(
    budget: f64,
    sigma_m: f64,
    modes: impl Fn() -> I,
    tail: impl Fn(f64) -> f64,
) -> Option<f64> {
    if !(budget > 0.0) {
        return None;
    }
    let exceeds = |level_m: f64| {
        let mut risk = tail(level_m / sigma_m);
        for mode in modes() {
            risk += mode.probability * tail((level_m - mode.threshold_m) / mode.sigma_m);
        }
        !(risk <= budget)
    };
    // With an equal share for each hypothesis every one is within its own: that is enough. Below x² = −2 ln p
    // both tails are above p.
    let count = f64::from(u32::try_from(modes().count()).unwrap_or(u32::MAX)) + 1.0;
    let farthest = |probability: f64| {
        let share = budget / (count * probability);
        if share < 1.0 {
            libm::sqrt(-2.0 * libm::log(share))
        } else {
            0.0
        }
    };
    let mut high = sigma_m * farthest(1.0);
    for mode in modes() {
        let bound = mode.threshold_m + mode.sigma_m * farthest(mode.probability);
        if !(bound <= high) {
            high = bound;
        }
    }
    // Without hypotheses it is the root itself, up to rounding.
    high *= 1.0 + 1.0e-9;
    if !high.is_finite() || exceeds(high) {
        return None;
    }
    let mut low = 0.0;
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if exceeds(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn separation(threshold_m: f64, sigma_m: f64) -> Separation {
        Separation {
            threshold_m: [threshold_m; 2],
            sigma_m: [sigma_m; 2],
            uncertainty_m: [3.09 * sigma_m; 2],
            ..Separation::ZERO
        }
    }

    fn budget(p: f64, samples: f64) -> LevelForm {
        LevelForm::Budget(RiskBudget {
            p_integrity: [p; 2],
            samples,
            unmonitored_share: 1.0,
        })
    }

    fn of(
        form: &LevelForm,
        sigma_m: f64,
        modes: &[(f64, f64, f64)],
        p_unmonitored: f64,
    ) -> [Option<f64>; 2] {
        let separations: Vec<(Separation, f64)> = modes
            .iter()
            .map(|(threshold, sigma, p)| (separation(*threshold, *sigma), *p))
            .collect();
        levels(
            form,
            [sigma_m; 2],
            || {
                separations
                    .iter()
                    .map(|(separation, probability)| Hypothesis {
                        separation,
                        probability: *probability,
                    })
            },
            p_unmonitored,
        )
    }

    #[test]
    fn without_hypotheses_the_level_is_the_fault_free_one() {
        let [h, v] = of(&budget(1e-7, 1.0), 2.0, &[], 0.0);
        // exp(−x²/2) = 1e-7 at 5.678, 2 Q(x) = 1e-7 at 5.327.
        assert!((h.unwrap() - 2.0 * 5.678).abs() < 0.01);
        assert!((v.unwrap() - 2.0 * 5.327).abs() < 0.01);
    }

    /// INT-030.
    #[test]
    fn the_risk_of_a_level_is_within_the_budget_and_near_it() {
        let modes = [(4.0, 1.5, 1e-5), (7.0, 1.2, 1e-5), (3.0, 4.0, 1e-4)];
        for (p, samples) in [(1e-7, 1.0), (1e-7, 24.0), (2e-6, 1.0)] {
            let [h, v] = of(&budget(p, samples), 1.0, &modes, 0.0);
            for (level, tail) in [
                (h.unwrap(), &horizontal_tail as &dyn Fn(f64) -> f64),
                (v.unwrap(), &vertical_tail),
            ] {
                let risk = |level: f64| {
                    let faults: f64 = modes
                        .iter()
                        .map(|(t, sigma, p)| p * tail((level - t) / sigma))
                        .sum();
                    samples * (tail(level) + faults)
                };
                assert!(risk(level) <= p);
                assert!(risk(0.998 * level) > p, "{level}");
            }
        }
    }

    #[test]
    fn more_risk_never_widens_a_level() {
        let modes = [(4.0, 1.5, 1e-5), (7.0, 1.2, 1e-5)];
        let mut last = [f64::INFINITY; 2];
        for p in [1e-9, 1e-8, 1e-7, 1e-6, 1e-5] {
            let levels = of(&budget(p, 1.0), 1.0, &modes, 0.0).map(Option::unwrap);
            assert!(levels[0] <= last[0] && levels[1] <= last[1]);
            last = levels;
        }
    }

    #[test]
    fn a_hypothesis_within_the_budget_by_itself_does_not_widen_a_level_without_end() {
        let [h, _] = of(&budget(1e-7, 1.0), 1.0, &[(50.0, 1e3, 1e-8)], 0.0);
        assert!(h.unwrap() < 6.0);
    }

    #[test]
    fn a_level_without_hypotheses_is_never_lost_to_rounding() {
        for k in 1..2000 {
            let levels = of(&budget(1e-7, 24.0), 0.003 * f64::from(k), &[], 0.0);
            assert!(levels.iter().all(Option::is_some), "{k}");
        }
    }

    /// INT-030.
    #[test]
    fn a_budget_that_is_spent_gives_no_level() {
        assert_eq!(of(&budget(1e-7, 1.0), 1.0, &[], 1e-7), [None; 2]);
        assert_eq!(of(&budget(1e-7, 1.0), 1.0, &[], f64::NAN), [None; 2]);
        let nan = [(f64::NAN, 1.0, 1e-5)];
        assert_eq!(of(&budget(1e-7, 1.0), 1.0, &nan, 0.0), [None; 2]);
        assert_eq!(of(&budget(1e-7, 1.0), f64::INFINITY, &[], 0.0), [None; 2]);
    }

    #[test]
    fn the_fixed_form_is_the_largest_of_its_parts() {
        let fixed = LevelForm::Fixed { k_fault_free: 5.0 };
        assert_eq!(of(&fixed, 3.0, &[(1.0, 1.0, 0.0)], 0.0), [Some(15.0); 2]);
        let [h, _] = of(&fixed, 1.0, &[(1.0, 1.0, 0.0), (4.0, 2.0, 0.0)], 0.0);
        assert!((h.unwrap() - (4.0 + 2.0 * 3.09)).abs() < 1e-12);
        assert_eq!(of(&fixed, 1.0, &[(f64::NAN, 1.0, 0.0)], 0.0), [None; 2]);
    }
}
