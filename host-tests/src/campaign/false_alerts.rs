//! Are false alerts as rare as allocated, and do the levels bound the error, whatever the correlation of
//! the noise? `surefix campaign false-alerts`.
//!
//! A trial is a run of [`DURATION_S`] without a fault, nothing excluded; all runs together are
//! [`FLIGHTS`] flights at different places and times. The same run is tested with every probability of
//! [`P_FA`]. A failed test stays failed for many epochs, so rates are judged by the spread between runs,
//! [`Clustered`]. White noise with a bank that takes it for that is flown in every trial, the
//! other cases in every [`EVERY`]th.

use anyhow::{Context, Result};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::{Deserialize, Serialize};
use surefix_core::gnss::Satellite;

use super::binomial::Clustered;
use super::errors::{Correlation, NoiseModel};
use super::flown::{FlightPlan, Flown};
use super::outcome::{Campaign, Outcome};
use super::rig::{BankModel, Rig, RigSetup, Risks};
use super::sky;
use super::trial::Trial;
use crate::simulate::inertial::motion::Motion;
use crate::simulate::inertial::sensors::Grade;
use crate::simulate::inertial::trajectory::Anchor;
use crate::simulate::noise::uniform;

/// False-alert probabilities per sample; the first is the seed's, of the levels that are compared.
pub const P_FA: [f64; 4] = [3.33e-7, 1e-2, 1e-3, 1e-4];
/// Numbers of satellites.
pub const SATELLITES: [usize; 2] = [6, 14];
/// Length of a run, s.
pub const DURATION_S: usize = 300;
/// Epochs before this are not counted, s: the filters still know the same.
pub const SETTLED_S: usize = 10;
/// Different flights.
pub const FLIGHTS: u64 = 16;
/// Trials from one with all cases to the next; shares no factor with [`FLIGHTS`].
pub const EVERY: u64 = 11;
/// Confidence of the lower bound of a rate.
pub const CONFIDENCE: f64 = 0.99;

/// Noise of a run, and what the bank takes it for.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Case {
    /// Noise.
    pub noise: NoiseModel,
    /// Bank.
    pub bank: BankModel,
}

/// Correlation times of first-order Gauss-Markov noise, s.
pub const TAUS_S: [f64; 4] = [10.0, 30.0, 100.0, 3600.0];

/// What a trial flies: white as white first.
pub fn cases() -> Vec<Case> {
    let slow = TAUS_S
        .map(Correlation::GaussMarkov)
        .into_iter()
        .chain([Correlation::Constant]);
    let taken_for_white = slow.clone().map(|correlation| Case {
        noise: NoiseModel::correlated(correlation),
        bank: BankModel::White,
    });
    let bounded = core::iter::once(NoiseModel::WHITE)
        .chain(slow.map(NoiseModel::correlated))
        .map(|noise| Case {
            noise,
            bank: BankModel::PRODUCT,
        });
    let inflated = TAUS_S[..3].iter().map(|tau_s| Case {
        noise: NoiseModel::correlated(Correlation::GaussMarkov(*tau_s)),
        bank: BankModel::Inflated { tau_s: *tau_s },
    });
    let white = Case {
        noise: NoiseModel::WHITE,
        bank: BankModel::White,
    };
    core::iter::once(white)
        .chain(taken_for_white)
        .chain(inflated)
        .chain(bounded)
        .collect()
}

/// A run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunRecord {
    /// Satellites.
    pub n: usize,
    /// Noise and bank.
    pub case: Case,
    /// Epochs counted.
    pub epochs: u64,
    /// Epochs with a failed test, by [`P_FA`].
    pub alerts: [u64; P_FA.len()],
    /// Epochs whose tests passed with a horizontal error above the level, by [`P_FA`].
    pub above: [u64; P_FA.len()],
    /// Largest error over its level at the first probability, alerts or not.
    pub largest_ratio: f64,
    /// Sum of the horizontal levels at the first probability, m.
    pub sum_of_levels_m: f64,
    /// Sum of the squared horizontal errors, m².
    pub sum_of_squares_m2: f64,
}

/// A flight with its satellites.
#[derive(Debug)]
pub struct Place {
    /// The truth.
    pub flown: Flown,
    /// Of each number of satellites, spread over the sky.
    pub satellites: [Vec<Satellite>; SATELLITES.len()],
}

/// The campaign.
pub struct FalseAlerts {
    seed: u64,
    /// Where its runs fly.
    pub places: Vec<Place>,
    rig: Rig<2, 8>,
}

/// A flight somewhere between 60° south and 60° north, at some time of the week.
fn place(random: &mut ChaCha8Rng) -> Place {
    let mut between = |low: f64, high: f64| low + (high - low) * uniform(random);
    loop {
        let course_deg = between(0.0, 360.0);
        let turn_deg = between(-60.0, 60.0);
        let flown = Flown::new(&FlightPlan {
            motion: Motion::level(course_deg, between(60.0, 220.0))
                .turn(40.0, 90.0, turn_deg, 5.0)
                .turn(150.0, 200.0, -turn_deg, 5.0),
            anchor: Anchor {
                at_s: 0,
                latitude_deg: between(-60.0, 60.0),
                longitude_deg: between(-180.0, 180.0),
                height_m: between(500.0, 10_000.0),
            },
            tow_s: libm::floor(between(0.0, 500_000.0)) as i64,
            duration_s: DURATION_S as u32,
            rate_hz: 50,
        });
        let always = flown.always_seen();
        let satellites = SATELLITES.map(|n| sky::spread(&flown.epochs[0], &always, n));
        if satellites
            .iter()
            .zip(SATELLITES)
            .all(|(of, n)| of.len() == n)
        {
            return Place { flown, satellites };
        }
    }
}

impl FalseAlerts {
    /// The runs of a trial in some cases.
    ///
    /// # Errors
    /// As [`Trial::fly`].
    pub fn fly(&mut self, number: u64, cases: &[Case]) -> Result<Vec<RunRecord>> {
        let place = &self.places[(number % FLIGHTS) as usize];
        let mut records = Vec::new();
        for (satellites, n) in place.satellites.iter().zip(SATELLITES) {
            for case in cases {
                let mut setup = RigSetup::seed(Grade::Tactical);
                setup.exclude = false;
                setup.model = case.bank;
                setup.risks = Risks {
                    p_fa: P_FA.to_vec(),
                    ..Risks::seed()
                };
                let seed = self.seed.wrapping_add(number + 1);
                let mut trial = Trial::new(&place.flown, satellites, setup, seed);
                trial.noise = case.noise;
                records.push(run(&mut self.rig, &trial, n, case)?);
            }
        }
        Ok(records)
    }

    /// So many runs of some cases.
    ///
    /// # Errors
    /// As [`Trial::fly`].
    pub fn runs(seed: u64, trials: u64, cases: &[Case]) -> Result<Outcome<RunRecord>> {
        let mut campaign = Self::prepare(seed, trials)?;
        let mut records = Vec::new();
        for number in 0..trials {
            let of = campaign.fly(number, cases)?;
            records.extend(of.into_iter().map(|record| (number, record)));
        }
        Ok(Outcome {
            campaign: Self::NAME.into(),
            seed,
            trials,
            shards: vec![(0, 1)],
            records,
        })
    }
}

impl Campaign for FalseAlerts {
    const NAME: &'static str = "false-alerts";
    const TRIALS: u64 = 1200;
    type Record = RunRecord;

    fn prepare(seed: u64, trials: u64) -> Result<Self> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        Ok(Self {
            seed,
            places: (0..FLIGHTS.min(trials))
                .map(|_| place(&mut random))
                .collect(),
            rig: Rig::new(),
        })
    }

    fn piece(&mut self, number: u64) -> Result<Vec<RunRecord>> {
        let mut cases = cases();
        if !number.is_multiple_of(EVERY) {
            cases.truncate(1);
        }
        self.fly(number, &cases)
    }

    fn report(outcome: &Outcome<RunRecord>) -> String {
        report(outcome)
    }
}

fn run(rig: &mut Rig<2, 8>, trial: &Trial<'_>, n: usize, case: &Case) -> Result<RunRecord> {
    let mut record = RunRecord {
        n,
        case: *case,
        epochs: 0,
        alerts: [0; P_FA.len()],
        above: [0; P_FA.len()],
        largest_ratio: 0.0,
        sum_of_levels_m: 0.0,
        sum_of_squares_m2: 0.0,
    };
    trial.fly(rig, DURATION_S, |epoch, _| {
        if epoch.t_s < SETTLED_S {
            return true;
        }
        let error_m = epoch.error_m[0];
        record.epochs += 1;
        record.largest_ratio = record.largest_ratio.max(epoch.ratio(1));
        record.sum_of_levels_m += epoch.level_m[0];
        record.sum_of_squares_m2 += error_m * error_m;
        for (k, verdict) in epoch.verdicts.iter().enumerate() {
            let level_m = verdict.level_m[0].max(verdict.fault_free_m[0]);
            record.alerts[k] += u64::from(verdict.detected);
            record.above[k] += u64::from(!verdict.detected && !(error_m <= level_m));
        }
        true
    })?;
    Ok(record)
}

/// What all runs of a case with so many satellites gave at one probability.
#[derive(Clone, Copy, Debug)]
pub struct Rate {
    /// Probability allocated.
    pub p_fa: f64,
    /// Alerts per epoch.
    pub alerts: Clustered,
    /// Usable epochs above the level, per epoch.
    pub above: Clustered,
}

/// All rates of a case, in the order of [`P_FA`].
pub fn rates(outcome: &Outcome<RunRecord>, n: usize, case: &Case) -> Vec<Rate> {
    let of: Vec<&RunRecord> = runs(outcome, n, case);
    P_FA.iter()
        .enumerate()
        .map(|(k, p_fa)| Rate {
            p_fa: *p_fa,
            alerts: Clustered::new(of.iter().map(|r| (r.alerts[k], r.epochs))),
            above: Clustered::new(of.iter().map(|r| (r.above[k], r.epochs))),
        })
        .collect()
}

/// The runs of a case.
pub fn runs<'a>(outcome: &'a Outcome<RunRecord>, n: usize, case: &Case) -> Vec<&'a RunRecord> {
    outcome
        .of()
        .filter(|record| record.n == n && record.case == *case)
        .collect()
}

/// Mean horizontal level at the seed's probability, and root mean square error, m.
pub fn means(of: &[&RunRecord]) -> [f64; 2] {
    let epochs = of.iter().map(|r| r.epochs).sum::<u64>().max(1) as f64;
    let sum = |value: fn(&RunRecord) -> f64| of.iter().map(|r| value(r)).sum::<f64>();
    [
        sum(|r| r.sum_of_levels_m) / epochs,
        libm::sqrt(sum(|r| r.sum_of_squares_m2) / epochs),
    ]
}

fn report(outcome: &Outcome<RunRecord>) -> String {
    let mut text = format!(
        "Runs of {DURATION_S} s at {FLIGHTS} places and times, seed {}. Rate of epochs with a failed test ± standard error between runs, (lower {:.0} % bound); nominal at the head.\n\n\
         | N | noise | bank takes it for | runs | 1e-2 | 1e-3 | 1e-4 | usable epochs above the level at 1e-2, 1e-3, 1e-4, 3.33e-7 | largest error/level |\n\
         |---|---|---|---|---|---|---|---|---|\n",
        outcome.seed,
        100.0 * CONFIDENCE
    );
    let mut costs = format!(
        "\nWhat honesty costs: mean horizontal level max(HPL, hpl0) at P_FA = {:e}, seed {}.\n\n\
         | N | noise | bank takes it for | RMS horizontal error, m | mean level, m | against white taken for white |\n|---|---|---|---|---|---|\n",
        P_FA[0], outcome.seed
    );
    for n in SATELLITES {
        // Over the same flights.
        let mut with_all = outcome.clone();
        with_all
            .records
            .retain(|(number, _)| number.is_multiple_of(EVERY));
        let white = means(&runs(&with_all, n, &cases()[0]))[0];
        for case in cases() {
            let of = runs(outcome, n, &case);
            if of.is_empty() {
                continue;
            }
            let rates = rates(outcome, n, &case);
            let rate = |k: usize| {
                let alerts = &rates[k].alerts;
                format!(
                    "{:.2e} ± {:.1e} ({:.2e})",
                    alerts.rate,
                    alerts.standard_error,
                    alerts.lower_bound(CONFIDENCE)
                )
            };
            let above = |k: usize| rates[k].above.events;
            let largest = of.iter().map(|r| r.largest_ratio).fold(0.0, f64::max);
            let (noise, bank) = (case.noise.correlation.name(), case.bank.name());
            text += &format!(
                "| {n} | {noise} | {bank} | {} | {} | {} | {} | {}, {}, {}, {} of {} | {largest:.2} |\n",
                of.len(),
                rate(1),
                rate(2),
                rate(3),
                above(1),
                above(2),
                above(3),
                above(0),
                rates[0].above.epochs,
            );
            let [level_m, error_m] = means(&runs(&with_all, n, &case));
            costs += &format!(
                "| {n} | {noise} | {bank} | {error_m:.2} | {level_m:.2} | {:.2} |\n",
                level_m / white
            );
        }
    }
    text + &costs
}

/// Whether the rates of a case are within what is asked: the lower bound not above the nominal, and where
/// noise is what the bank takes it for, the rate at least half of it.
///
/// # Errors
/// With the rate that is not.
pub fn check(outcome: &Outcome<RunRecord>, n: usize, case: &Case, p_fa: &[f64]) -> Result<()> {
    for rate in rates(outcome, n, case) {
        if !p_fa.contains(&rate.p_fa) {
            continue;
        }
        let is_rare = rate.alerts.lower_bound(CONFIDENCE) <= rate.p_fa;
        let is_white = case.noise == NoiseModel::WHITE && case.bank == BankModel::White;
        let is_frequent = !is_white || rate.alerts.rate >= 0.5 * rate.p_fa;
        (is_rare && is_frequent && rate.above.events == 0)
            .then_some(())
            .with_context(|| format!("N = {n}, {case:?}: {rate:?}"))?;
    }
    Ok(())
}
