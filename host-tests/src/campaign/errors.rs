//! What is wrong with measurements: noise, white or correlated, and faults of satellites, of pairs, of
//! whole constellations.
//!
//! A pseudorange's error is σ (√w n + √(1 − w) g): n white, g of the [`Correlation`], both normal with
//! variance 1, w the white share of the variance. Range rates are white. Every satellite has a stream of
//! random numbers of its own, so that its noise does not depend on what else is in view.

use nalgebra::{Rotation3, Unit, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::{Deserialize, Serialize};
use surefix_core::gnss::{CorrectedMeasurement, Satellite, System};

use super::flown::Seen;
use crate::faults::{FaultInjector, FaultSpec};
use crate::simulate::noise::{GaussMarkov, normal};

/// How the part of an error that is not white hangs together in time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Correlation {
    /// Not at all.
    White,
    /// First-order Gauss-Markov with this correlation time, s.
    GaussMarkov(f64),
    /// The same for a whole run.
    Constant,
}

impl Correlation {
    /// For tables.
    pub fn name(self) -> String {
        match self {
            Self::White => "white".into(),
            Self::GaussMarkov(tau_s) => format!("{tau_s} s"),
            Self::Constant => "constant".into(),
        }
    }
}

/// Noise of the pseudoranges.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NoiseModel {
    /// Share of the variance that is white.
    pub white_share: f64,
    /// The rest.
    pub correlation: Correlation,
}

impl NoiseModel {
    /// All white.
    pub const WHITE: Self = Self {
        white_share: 1.0,
        correlation: Correlation::White,
    };

    /// All correlated.
    pub const fn correlated(correlation: Correlation) -> Self {
        Self {
            white_share: 0.0,
            correlation,
        }
    }
}

/// Noise of one satellite.
#[derive(Clone, Debug)]
struct Noise {
    satellite: Satellite,
    random: ChaCha8Rng,
    slow: GaussMarkov,
}

/// Noise of all satellites, epoch by epoch.
#[derive(Clone, Debug)]
pub struct Noises {
    model: NoiseModel,
    seed: u64,
    satellites: Vec<Noise>,
}

impl Noises {
    /// Nothing drawn.
    pub const fn new(model: NoiseModel, seed: u64) -> Self {
        Self {
            model,
            seed,
            satellites: Vec::new(),
        }
    }

    fn of(&mut self, satellite: Satellite) -> &mut Noise {
        let known = self
            .satellites
            .iter()
            .position(|noise| noise.satellite == satellite);
        let at = known.unwrap_or_else(|| {
            let mut random = ChaCha8Rng::seed_from_u64(self.seed);
            random.set_stream(1 + satellite.index() as u64);
            self.satellites.push(Noise {
                satellite,
                slow: GaussMarkov::new(&mut random),
                random,
            });
            self.satellites.len() - 1
        });
        &mut self.satellites[at]
    }

    /// Puts the noise of an epoch, a second after the one before, on a measurement.
    pub fn disturb(&mut self, measurement: &mut CorrectedMeasurement) {
        let NoiseModel {
            white_share,
            correlation,
        } = self.model;
        let noise = self.of(measurement.satellite);
        let white = normal(&mut noise.random);
        let slow = match correlation {
            Correlation::White => normal(&mut noise.random),
            Correlation::GaussMarkov(tau_s) => noise.slow.step(&mut noise.random, 1.0, tau_s),
            // The first value is that of a run.
            Correlation::Constant => noise.slow.step(&mut noise.random, 0.0, 1.0),
        };
        let error = libm::sqrt(white_share) * white + libm::sqrt(1.0 - white_share) * slow;
        measurement.pseudorange_m += measurement.sigma_pseudorange_m * error;
        if let Some((rate_mps, sigma_mps)) = &mut measurement.range_rate_mps {
            *rate_mps += *sigma_mps * normal(&mut noise.random);
        }
    }
}

/// A fault that a whole constellation has in common.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum ConstellationFault {
    /// Its time runs away: a ramp on all its pseudoranges.
    Clock {
        /// m/s.
        rate_mps: f64,
        /// Whether all its range rates have it too.
        on_range_rate: bool,
    },
    /// Its ephemerides are turned about an axis: a position on the ground moves by so much.
    Rotation {
        /// At the Earth's radius, m, once it has grown.
        shift_m: f64,
        /// How long it takes to grow, s; 0 for at once.
        growth_s: f64,
        /// Axis, ECEF.
        axis_e: [f64; 3],
    },
}

/// A constellation's fault with its onset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommonFault {
    /// Whose.
    pub system: System,
    /// What.
    pub fault: ConstellationFault,
    /// Since when, s.
    pub t0_s: f64,
}

/// A mean radius of the Earth, m.
const EARTH_RADIUS_M: f64 = 6.371e6;

impl CommonFault {
    fn put_on(&self, measurement: &mut CorrectedMeasurement, t_s: f64) {
        let since_s = t_s - self.t0_s;
        if measurement.satellite.system() != self.system || since_s < 0.0 {
            return;
        }
        match self.fault {
            ConstellationFault::Clock {
                rate_mps,
                on_range_rate,
            } => {
                measurement.pseudorange_m += rate_mps * since_s;
                if let Some((measured_mps, _)) = &mut measurement.range_rate_mps
                    && on_range_rate
                {
                    *measured_mps += rate_mps;
                }
            }
            ConstellationFault::Rotation {
                shift_m,
                growth_s,
                axis_e,
            } => {
                let grown = if growth_s > 0.0 {
                    (since_s / growth_s).min(1.0)
                } else {
                    1.0
                };
                let axis = Unit::new_normalize(Vector3::from(axis_e));
                let turn = Rotation3::from_axis_angle(&axis, shift_m * grown / EARTH_RADIUS_M);
                let turned = |v: [f64; 3]| -> [f64; 3] { (turn * Vector3::from(v)).into() };
                measurement.r_es_e_m = turned(measurement.r_es_e_m);
                measurement.v_es_e_mps = turned(measurement.v_es_e_mps);
            }
        }
    }
}

/// Everything that is put on the true ranges of a flight.
#[derive(Clone, Debug)]
pub struct Errors {
    noises: Noises,
    injector: FaultInjector,
    common: Option<CommonFault>,
    /// Added to all satellites of a constellation but the first, m, by its index.
    offset_m: [f64; System::ALL.len()],
}

impl Errors {
    /// For a trial; `offset_m` are the constellations' true times against the receiver's, m.
    pub fn new(
        model: NoiseModel,
        faults: &[FaultSpec],
        common: Option<CommonFault>,
        offset_m: [f64; System::ALL.len()],
        seed: u64,
    ) -> Self {
        Self {
            noises: Noises::new(model, seed),
            // A seed of its own: the streams of its random kinds are numbered as those of the noise.
            injector: FaultInjector::new(faults, !seed),
            common,
            offset_m,
        }
    }

    /// What a receiver with this clock (m, m/s) measures of satellites in view.
    pub fn measure<'a>(
        &mut self,
        t_s: f64,
        seen: impl Iterator<Item = &'a Seen>,
        clock: (f64, f64),
    ) -> Vec<CorrectedMeasurement> {
        let faults: Vec<_> = self.injector.values(t_s).collect();
        seen.map(|seen| {
            let mut measurement = seen.measurement;
            self.noises.disturb(&mut measurement);
            let offset_m = self.offset_m[measurement.satellite.system().index()];
            let mut add = |value_m: f64, rate_mps: f64| {
                measurement.pseudorange_m += value_m;
                if let Some((measured_mps, _)) = &mut measurement.range_rate_mps {
                    *measured_mps += rate_mps;
                }
            };
            add(clock.0 + offset_m, clock.1);
            for (satellite, value_m, rate_mps) in &faults {
                if *satellite == seen.measurement.satellite {
                    add(*value_m, *rate_mps);
                }
            }
            if let Some(common) = &self.common {
                common.put_on(&mut measurement, t_s);
            }
            measurement
        })
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measurement() -> CorrectedMeasurement {
        CorrectedMeasurement {
            satellite: Satellite::new(System::Bds, 30).unwrap(),
            r_es_e_m: [2.0e7, 1.0e7, 1.5e7],
            v_es_e_mps: [0.0; 3],
            pseudorange_m: 0.0,
            sigma_pseudorange_m: 2.0,
            range_rate_mps: Some((0.0, 0.1)),
        }
    }

    /// Mean square, and mean product with the error `lag` epochs before, of many runs.
    fn moments(model: NoiseModel, lag: usize) -> [f64; 2] {
        let (runs, epochs) = (400, 60);
        let mut sums = [0.0; 2];
        for seed in 0..runs {
            let mut noises = Noises::new(model, seed);
            let errors: Vec<f64> = (0..epochs)
                .map(|_| {
                    let mut m = measurement();
                    noises.disturb(&mut m);
                    m.pseudorange_m / m.sigma_pseudorange_m
                })
                .collect();
            let pairs = errors.iter().zip(&errors[lag..]);
            sums[0] += errors.iter().map(|e| e * e).sum::<f64>() / epochs as f64;
            sums[1] += pairs.map(|(a, b)| a * b).sum::<f64>() / (epochs - lag) as f64;
        }
        sums.map(|sum| sum / runs as f64)
    }

    #[test]
    fn noise_has_its_variance_and_its_correlation() {
        for (model, kept) in [
            (NoiseModel::WHITE, 0.0),
            (
                NoiseModel::correlated(Correlation::GaussMarkov(10.0)),
                (-0.5_f64).exp(),
            ),
            (NoiseModel::correlated(Correlation::Constant), 1.0),
            (
                NoiseModel {
                    white_share: 0.25,
                    correlation: Correlation::Constant,
                },
                0.75,
            ),
        ] {
            let [variance, product] = moments(model, 5);
            assert!((variance - 1.0).abs() < 0.15, "{model:?}: {variance}");
            assert!((product - kept).abs() < 0.15, "{model:?}: {product}");
        }
    }

    #[test]
    fn a_rotation_moves_the_ground_by_its_shift() {
        let common = CommonFault {
            system: System::Bds,
            fault: ConstellationFault::Rotation {
                shift_m: 100.0,
                growth_s: 50.0,
                axis_e: [0.0, 0.0, 1.0],
            },
            t0_s: 10.0,
        };
        let at = |t_s: f64| {
            let mut m = measurement();
            common.put_on(&mut m, t_s);
            let moved = Vector3::from(m.r_es_e_m) - Vector3::from(measurement().r_es_e_m);
            let lever = libm::hypot(m.r_es_e_m[0], m.r_es_e_m[1]);
            moved.norm() / lever * EARTH_RADIUS_M
        };
        assert_eq!(at(9.0), 0.0);
        assert!((at(35.0) - 50.0).abs() < 1e-3 && (at(99.0) - 100.0).abs() < 1e-3);
    }
}
