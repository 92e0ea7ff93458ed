//! `surefix campaign wide-headings`: how uncertain a heading may be for a filter to start from it.
//!
//! The filter is linear in its errors, and a heading that is off by tens of degrees is not. A trial is a
//! flight of a minute with manoeuvres ([`Trial`]) with each sigma of the heading at the start, from which
//! the true error is drawn. Normalised errors squared over their degrees of freedom are 1 in the mean
//! where the filter knows how wrong it is; what matters for levels is the position.

use std::fmt::Write as _;

use anyhow::{Result, anyhow};
use serde::{Deserialize, Serialize};

use super::outcome::{Campaign, Outcome};
use crate::consistency::flight::Motion;
use crate::consistency::sky::Sky;
use crate::consistency::trial::{Grade, Setup, Start, Trial};
use crate::reference::filter::at;

/// One sigma of the heading at the start, degrees.
pub const SIGMAS_DEG: [f64; 6] = [2.0, 10.0, 20.0, 30.0, 45.0, 60.0];
/// Epochs after the start at which errors are looked at, s.
pub const EPOCHS_S: [u32; 3] = [3, 10, 60];
/// A position error beyond this many of its sigmas is one that levels are made for, and no chance.
const BEYOND_SIGMAS: f64 = 5.33;

/// One flight.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Flight {
    /// Place of its sigma in [`SIGMAS_DEG`].
    pub sigma: usize,
    /// At each epoch normalised errors squared over degrees of freedom: position, velocity, attitude; infinite
    /// where the filter had given up.
    pub nees: Vec<[f64; 3]>,
    /// Epochs with a position error of an axis beyond 5.33 sigmas.
    pub beyond: u32,
    /// Innovations squared per row, the largest.
    pub largest_nis: f64,
}

/// The campaign.
pub struct WideHeadings {
    seed: u64,
}

/// A flight from a heading of this sigma.
fn fly(sigma: usize, seed: u64) -> Result<Flight> {
    let grade = Grade::MEMS;
    let mut start: Start = grade.start();
    start.attitude_rad[1] = SIGMAS_DEG[sigma].to_radians();
    let setup = Setup {
        grade,
        start,
        motion: Motion::Manoeuvres,
        rate_hz: 100,
    };
    let mut trial =
        Trial::new(setup, seed).map_err(|error| anyhow!("the start is no state: {error:?}"))?;
    let mut flight = Flight {
        sigma,
        nees: Vec::new(),
        beyond: 0,
        largest_nis: 0.0,
    };
    let last = EPOCHS_S.into_iter().max().unwrap_or(0);
    for epoch_s in 1..=last {
        let Ok(assessment) = trial.epoch(&Sky::OPEN) else {
            break;
        };
        let (nis, rows) = assessment.nis;
        flight.largest_nis = flight.largest_nis.max(nis / f64::from(rows.max(1)));
        let is_beyond = (at::POS..at::POS + 3).any(|k| {
            let sigma_m = assessment.covariance[(k, k)].sqrt();
            !(assessment.error[k].abs() <= BEYOND_SIGMAS * sigma_m)
        });
        flight.beyond += u32::from(is_beyond);
        if EPOCHS_S.contains(&epoch_s) {
            flight.nees.push(
                [at::POS, at::VEL, at::ATT]
                    .map(|block| assessment.nees::<3>(block).unwrap_or(f64::INFINITY) / 3.0),
            );
        }
    }
    flight.nees.resize(EPOCHS_S.len(), [f64::INFINITY; 3]);
    Ok(flight)
}

impl Campaign for WideHeadings {
    const NAME: &'static str = "wide-headings";
    const TRIALS: u64 = 200;
    type Record = Flight;

    fn prepare(seed: u64, _trials: u64) -> Result<Self> {
        Ok(Self { seed })
    }

    fn piece(&mut self, number: u64) -> Result<Vec<Flight>> {
        (0..SIGMAS_DEG.len())
            .map(|sigma| {
                // The same flight and the same draws for every sigma.
                fly(
                    sigma,
                    self.seed.wrapping_mul(1_000_003).wrapping_add(number),
                )
            })
            .collect()
    }

    fn report(outcome: &Outcome<Flight>) -> String {
        let mut text = String::from(
            "| heading, one sigma, ° | flights | position after 3 s | 10 s | 60 s | velocity 3 s | 10 s | 60 s | attitude 3 s | 10 s | 60 s | epochs with a position error beyond 5.33 sigmas | innovations squared per row, largest |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
        );
        for figures in figures(outcome) {
            let _ = write!(
                text,
                "| {} | {} ",
                SIGMAS_DEG[figures.sigma], figures.flights
            );
            for block in 0..3 {
                for mean in &figures.means {
                    let _ = write!(text, "| {:.2} ", mean[block]);
                }
            }
            let _ = writeln!(
                text,
                "| {} of {} | {:.1} |",
                figures.beyond,
                figures.flights * u64::from(EPOCHS_S[2]),
                figures.largest_nis
            );
        }
        text
    }
}

/// What the flights from headings of one sigma say together.
#[derive(Clone, Debug)]
pub struct Figures {
    /// Place of the sigma in [`SIGMAS_DEG`].
    pub sigma: usize,
    /// Flights.
    pub flights: u64,
    /// Means of the normalised errors squared over degrees of freedom, at each epoch: position, velocity, attitude.
    pub means: Vec<[f64; 3]>,
    /// Epochs with a position error of an axis beyond 5.33 sigmas.
    pub beyond: u32,
    /// Innovations squared per row, the largest of all flights.
    pub largest_nis: f64,
}

/// Figures of every sigma.
pub fn figures(outcome: &Outcome<Flight>) -> Vec<Figures> {
    (0..SIGMAS_DEG.len())
        .map(|sigma| {
            let of: Vec<&Flight> = outcome.of().filter(|f| f.sigma == sigma).collect();
            let count = of.len().max(1) as f64;
            Figures {
                sigma,
                flights: of.len() as u64,
                means: (0..EPOCHS_S.len())
                    .map(|epoch| {
                        [0, 1, 2].map(|block| {
                            of.iter().map(|f| f.nees[epoch][block]).sum::<f64>() / count
                        })
                    })
                    .collect(),
                beyond: of.iter().map(|f| f.beyond).sum(),
                largest_nis: of.iter().map(|f| f.largest_nis).fold(0.0, f64::max),
            }
        })
        .collect()
}
