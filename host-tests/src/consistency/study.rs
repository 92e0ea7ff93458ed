//! Many trials: averages of the normalised errors and innovations squared.
//!
//! Errors within a trial hang together from epoch to epoch, so an average is taken over trials, at one
//! epoch. Innovations of a consistent filter do not, so all of them are taken together.

use anyhow::{Result, anyhow};
use serde::Serialize;

use super::flight::Motion;
use super::sky::Sky;
use super::statistics::{Interval, chi_square_interval};
use super::trial::{Assessment, Grade, Setup, Trial};
use crate::reference::filter::at;

/// Epochs at which the errors are looked at, s: the transient, in between, settled.
pub const EPOCHS_S: [u32; 3] = [5, 30, 120];
/// Seeds of one grade and of the next lie this far apart.
const SEEDS_PER_GRADE: u64 = 10_000_000;

/// States whose errors are looked at together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Block {
    /// All 17.
    All,
    /// Position.
    Position,
    /// Velocity.
    Velocity,
    /// Attitude.
    Attitude,
    /// Biases of gyroscopes and accelerometers.
    Biases,
    /// Clock bias and drift.
    Clock,
}

impl Block {
    /// All blocks.
    pub const ALL: [Self; 6] = [
        Self::All,
        Self::Position,
        Self::Velocity,
        Self::Attitude,
        Self::Biases,
        Self::Clock,
    ];

    /// Number of states.
    pub const fn degrees(self) -> u32 {
        match self {
            Self::All => 17,
            Self::Position | Self::Velocity | Self::Attitude => 3,
            Self::Biases => 6,
            Self::Clock => 2,
        }
    }

    fn nees(self, assessment: &Assessment) -> Option<f64> {
        match self {
            Self::All => assessment.nees::<17>(0),
            Self::Position => assessment.nees::<3>(at::POS),
            Self::Velocity => assessment.nees::<3>(at::VEL),
            Self::Attitude => assessment.nees::<3>(at::ATT),
            Self::Biases => assessment.nees::<6>(at::BG),
            Self::Clock => assessment.nees::<2>(at::CLK_B),
        }
    }
}

/// An average normalised error squared.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Average {
    /// Epoch, s after the start.
    pub epoch_s: u32,
    /// States.
    pub block: Block,
    /// The average over the trials.
    pub nees: f64,
}

/// What a study gave.
#[derive(Clone, Debug, Serialize)]
pub struct Study {
    /// Grade of the unit.
    pub grade: &'static str,
    /// Trials.
    pub trials: u64,
    /// Averages over the trials.
    pub averages: Vec<Average>,
    /// Sum of the normalised innovations squared of all epochs of all trials.
    pub nis: f64,
    /// Its degrees of freedom: measurements.
    pub nis_degrees: u64,
}

impl Study {
    /// Where an average lies with a probability, if the filter is consistent.
    pub fn interval(&self, block: Block, confidence: f64) -> Interval {
        chi_square_interval(block.degrees().into(), self.trials as f64, confidence)
    }

    /// The same of [`Study::nis_ratio`].
    pub fn nis_interval(&self, confidence: f64) -> Interval {
        chi_square_interval(1.0, self.nis_degrees as f64, confidence)
    }

    /// Normalised innovations squared per measurement.
    pub fn nis_ratio(&self) -> f64 {
        self.nis / self.nis_degrees as f64
    }
}

/// The study of every grade of unit: manoeuvres under an open sky, samples at 100 Hz.
///
/// # Errors
/// As [`study`].
pub fn studies(seed: u64, trials: u64) -> Result<Vec<Study>> {
    let seeds = (0..).map(|number: u64| seed.wrapping_add(number * SEEDS_PER_GRADE));
    let grades = Grade::ALL.into_iter().zip(seeds);
    grades
        .map(|(grade, seed)| {
            let setup = Setup {
                grade,
                start: grade.start(),
                motion: Motion::Manoeuvres,
                rate_hz: 100,
            };
            study(setup, &Sky::OPEN, seed, trials, &EPOCHS_S)
        })
        .collect()
}

/// A table to read, with intervals of this confidence.
pub fn table(studies: &[Study], confidence: f64) -> String {
    let mut text = format!(
        "grade       epoch s  states    average  of  {} % interval\n",
        100.0 * confidence
    );
    for study in studies {
        for average in &study.averages {
            let interval = study.interval(average.block, confidence);
            text += &format!(
                "{:<10}  {:>7}  {:<8}  {:>7.3}  {:>2}  {:.3} to {:.3}\n",
                study.grade,
                average.epoch_s,
                format!("{:?}", average.block),
                average.nees,
                average.block.degrees(),
                interval.low,
                interval.high
            );
        }
        let interval = study.nis_interval(confidence);
        text += &format!(
            "{:<10}      all  innovat.  {:>7.4}   1  {:.4} to {:.4}, {} degrees of freedom\n",
            study.grade,
            study.nis_ratio(),
            interval.low,
            interval.high,
            study.nis_degrees
        );
    }
    text
}

/// Runs trials with seeds from `seed` on and looks at the errors at `epochs_s`, ascending.
///
/// # Errors
/// When a navigator does not start, or finds itself unhealthy, or a covariance is not positive
/// definite.
pub fn study(setup: Setup, sky: &Sky, seed: u64, trials: u64, epochs_s: &[u32]) -> Result<Study> {
    let mut averages: Vec<Average> = epochs_s
        .iter()
        .flat_map(|epoch_s| Block::ALL.map(|block| (*epoch_s, block)))
        .map(|(epoch_s, block)| Average {
            epoch_s,
            block,
            nees: 0.0,
        })
        .collect();
    let (mut nis, mut nis_degrees) = (0.0, 0);
    for number in 0..trials {
        let mut trial = Trial::new(setup, seed.wrapping_add(number))
            .map_err(|error| anyhow!("trial {number} does not start: {error:?}"))?;
        for epoch_s in 1..=epochs_s.last().copied().unwrap_or(0) {
            let assessment = trial
                .epoch(sky)
                .map_err(|error| anyhow!("trial {number} at {epoch_s} s: {error:?}"))?;
            nis += assessment.nis.0;
            nis_degrees += u64::from(assessment.nis.1);
            for average in averages.iter_mut().filter(|a| a.epoch_s == epoch_s) {
                let nees = average.block.nees(&assessment).ok_or_else(|| {
                    anyhow!("trial {number} at {epoch_s} s: covariance not positive definite")
                })?;
                average.nees += nees / trials as f64;
            }
        }
    }
    Ok(Study {
        grade: setup.grade.name,
        trials,
        averages,
        nis,
        nis_degrees,
    })
}
