//! A flight with three units: the vote, and navigators on what it gives and on each unit alone.
//!
//! [`Flight`] is cloned where a fault begins, so that every fault begins from the same healthy flight, with
//! the same noise.

use std::sync::Arc;

use anyhow::{Context, Result, anyhow};
use nalgebra::{Matrix3, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use surefix_core::ekf::Navigator;
use surefix_core::gnss::System;
use surefix_core::ins::mechanisation::Increment;
use surefix_core::ins::{
    AttitudeStart, ImuSample, InertialConfig, MAX_UNITS, MeasurementFactors, UnitFault, UnitState,
    Voting, VotingMode,
};
use surefix_core::time::NS_PER_S;

use crate::campaign::flown::{FlightPlan, Flown, TrueEpoch};
use crate::simulate::START_TOW_S;
use crate::simulate::flight::Flight as Name;
use crate::simulate::inertial::clock::CLOCK_NOISE;
use crate::simulate::inertial::sensors::Grade;
use crate::simulate::inertial::trajectory::Trajectory;
use crate::simulate::inertial::unit_faults::UnitFaultSpec;
use crate::simulate::inertial::units::{FlyingUnit, TrueUnit, UnitPlan};
use crate::simulate::inertial::{TruthRow, catalogue, initial_sigma, initial_state};
use crate::simulate::noise::normal;

/// Interval of what the vote gives, ns.
pub const INTERVAL_NS: u32 = 10_000_000;

/// The navigator of a campaign: one constellation.
type Navigator2 = Navigator<2, 8>;

/// The truth of a flight with one grade of units.
#[derive(Debug)]
pub struct Scene {
    /// The grade.
    pub grade: Grade,
    /// Length, s.
    pub duration_s: u32,
    flown: Flown,
    units: [Arc<TrueUnit>; MAX_UNITS],
}

impl Scene {
    /// The flight on which units of a grade are usual: a cruise with turns, an approach, a survey.
    ///
    /// # Errors
    /// When the catalogue has none.
    pub fn of(grade: Grade) -> Result<Arc<Self>> {
        let name = match grade {
            Grade::Navigation => Name::EnrouteTurn,
            Grade::Tactical => Name::Npa,
            Grade::Mems => Name::UavSurvey,
        };
        let plan = catalogue::plan(name)?.context("a flight without inertial units")?;
        let duration_s = plan.duration_s;
        let flown = Flown::new(&FlightPlan {
            motion: plan.motion.clone(),
            anchor: plan.anchor,
            tow_s: START_TOW_S,
            duration_s,
            rate_hz: 50,
        });
        let trajectory = Arc::new(Trajectory::new(plan.motion, &plan.anchor, duration_s, 200));
        let units =
            UnitPlan::three().map(|plan| Arc::new(TrueUnit::new(&trajectory, plan, duration_s)));
        Ok(Arc::new(Self {
            grade,
            duration_s,
            flown,
            units,
        }))
    }

    fn inertial_config(&self) -> InertialConfig {
        InertialConfig {
            interval_ns: INTERVAL_NS,
            c_b_s: Matrix3::identity().into(),
            lever_arm_b_m: [0.0; 3],
            noise: self.grade.noise().density,
            clock: CLOCK_NOISE,
            measurement: MeasurementFactors::ONE,
            range: UnitPlan::three()[0].config(self.grade).range,
            start: AttitudeStart::Given {
                roll_pitch_heading_rad: [0.0; 3],
            },
            sigma: initial_sigma(self.grade),
        }
    }
}

/// A vote over some of the units, and two navigators on it: one with satellites, and one without once
/// [`Chain::coast`] was called.
#[derive(Clone, Debug)]
pub struct Chain {
    /// The vote.
    pub voting: Box<Voting>,
    aided: Box<Navigator2>,
    coasting: Option<Box<Navigator2>>,
    /// Largest position error, m, of the first and the second since [`Chain::coast`].
    pub worst_m: [f64; 2],
}

impl Chain {
    fn new(scene: &Scene, units: &[usize], seed: u64) -> Result<Self> {
        let mut voting = Box::new(Voting::EMPTY);
        let failed = |error| anyhow!("{error:?}");
        voting.begin(INTERVAL_NS).map_err(failed)?;
        let plans = UnitPlan::three();
        for unit in units {
            let config = plans[*unit].config(scene.grade);
            voting.add(*unit as u8, &config).map_err(failed)?;
        }
        let config = scene.inertial_config();
        let truth = TruthRow {
            t_s: 0.0,
            state: scene.flown.epochs[0].state,
            clock: (0.0, 0.0),
            gyro_bias_radps: Vector3::zeros(),
            accel_bias_mps2: Vector3::zeros(),
        };
        let state = initial_state(scene.flown.start, &truth, &config.sigma, seed);
        let mut aided = Box::new(Navigator2::EMPTY);
        aided
            .start(&config, &state)
            .map_err(|error| anyhow!("{error:?}"))?;
        Ok(Self {
            voting,
            aided,
            coasting: None,
            worst_m: [0.0; 2],
        })
    }

    /// From here on a second navigator does without satellites, and errors count.
    pub fn coast(&mut self) {
        self.coasting = Some(self.aided.clone());
        self.worst_m = [0.0; 2];
    }

    fn step(&mut self, sample: &ImuSample) {
        let increment = Increment {
            dtheta_b: sample.dtheta_is_s_rad.into(),
            dv_b: sample.dv_is_s_mps.into(),
            dt_s: f64::from(sample.interval_ns) / 1e9,
        };
        self.aided.step(&increment, sample.time);
        if let Some(coasting) = &mut self.coasting {
            coasting.step(&increment, sample.time);
        }
    }

    /// An epoch: `noise` is drawn from the seed and its number, so that all chains have the same.
    fn epoch(&mut self, epoch: &TrueEpoch, sample: &ImuSample, noise: u64) -> Result<()> {
        let mut random = ChaCha8Rng::seed_from_u64(noise);
        let at = self.aided.predict(sample.time);
        for seen in &epoch.seen {
            let mut measurement = seen.measurement;
            let draws = (normal(&mut random), normal(&mut random));
            if measurement.satellite.system() != System::Gps {
                continue;
            }
            measurement.pseudorange_m += draws.0 * measurement.sigma_pseudorange_m;
            if let Some((rate, sigma)) = &mut measurement.range_rate_mps {
                *rate += draws.1 * *sigma;
            }
            self.aided.add(&measurement, &at, None);
        }
        self.aided
            .update()
            .map_err(|error| anyhow!("the navigator gave up: {error:?}"))?;
        if let Some(coasting) = &mut self.coasting {
            let r = &epoch.state.r_eb_e;
            let error_m = |navigator: &Navigator2| (navigator.mechanisation().r_eb_e - r).norm();
            let errors = [error_m(&self.aided), error_m(coasting)];
            for (worst, error) in self.worst_m.iter_mut().zip(errors) {
                *worst = worst.max(error);
            }
        }
        Ok(())
    }
}

/// A flight in progress.
#[derive(Clone, Debug)]
pub struct Flight {
    scene: Arc<Scene>,
    seed: u64,
    units: [FlyingUnit; MAX_UNITS],
    /// With the voted units, and, where asked for, with each alone.
    pub voted: Chain,
    /// See [`Flight::voted`].
    pub alone: Vec<Chain>,
    /// Whether navigators run.
    pub navigates: bool,
    /// End of the last sample since the start, ns.
    now_ns: i64,
}

/// What a vote has to say of faults.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finding {
    /// When, s.
    pub t_s: f64,
    /// State and fault of each unit.
    pub units: [(UnitState, UnitFault); MAX_UNITS],
    /// How many are left.
    pub mode: VotingMode,
}

impl Flight {
    /// Begins; with `navigates` navigators run on the vote and on each unit alone.
    ///
    /// # Errors
    /// When a configuration is refused.
    pub fn new(scene: &Arc<Scene>, seed: u64, navigates: bool) -> Result<Self> {
        let mut number = 0;
        let units = scene.units.each_ref().map(|truth| {
            let unit = FlyingUnit::new(truth, number, scene.grade, scene.flown.start, seed);
            number += 1;
            unit
        });
        let alone: Result<Vec<Chain>> = (0..MAX_UNITS)
            .filter(|_| navigates)
            .map(|unit| Chain::new(scene, &[unit], seed))
            .collect();
        Ok(Self {
            voted: Chain::new(scene, &[0, 1, 2], seed)?,
            alone: alone?,
            scene: Arc::clone(scene),
            seed,
            units,
            navigates,
            now_ns: 0,
        })
    }

    /// Time since the start, s.
    pub fn t_s(&self) -> f64 {
        self.now_ns as f64 / 1e9
    }

    /// Puts a fault on a unit.
    pub fn fail(&mut self, fault: UnitFaultSpec) {
        self.units[fault.unit].faults.push(fault);
    }

    /// From here on navigators coast too.
    pub fn coast(&mut self) {
        self.voted.coast();
        self.alone.iter_mut().for_each(Chain::coast);
    }

    /// What the vote says now.
    pub fn finding(&self) -> Finding {
        Finding {
            t_s: self.t_s(),
            units: [0, 1, 2].map(|unit| self.voted.voting.unit(unit)),
            mode: self.voted.voting.mode(),
        }
    }

    /// Flies on until a time, or until `stop` says so of what the vote found; true when it did.
    ///
    /// # Errors
    /// When a navigator gives up.
    pub fn fly(&mut self, to_s: f64, mut stop: impl FnMut(&Finding) -> bool) -> Result<bool> {
        let to_ns = (to_s * 1e9).round() as i64;
        loop {
            let ends = self.units.each_ref().map(FlyingUnit::next_end_ns);
            let next = (0..MAX_UNITS)
                .filter_map(|unit| Some((ends[unit]?, unit)))
                .min();
            let Some((end_ns, unit)) = next.filter(|(end_ns, _)| *end_ns <= to_ns) else {
                self.now_ns = to_ns;
                return Ok(false);
            };
            self.now_ns = end_ns;
            let Some(sample) = self.units[unit].sample() else {
                continue;
            };
            let is_new = take(
                &mut self.voted,
                unit,
                &sample,
                &self.scene,
                self.seed,
                self.navigates,
            )?;
            if self.navigates
                && let Some(alone) = self.alone.get_mut(unit)
            {
                take(alone, unit, &sample, &self.scene, self.seed, true)?;
            }
            if is_new && stop(&self.finding()) {
                return Ok(true);
            }
        }
    }
}

/// Gives a sample to a chain; true when the vote gave something.
fn take(
    chain: &mut Chain,
    unit: usize,
    sample: &surefix_core::ins::UnitSample,
    scene: &Scene,
    seed: u64,
    navigates: bool,
) -> Result<bool> {
    chain.voting.take(unit, sample);
    let mut is_new = chain.voting.mode() != VotingMode::Three;
    while let Some(voted) = chain.voting.next_sample() {
        is_new = true;
        if !navigates {
            continue;
        }
        chain.step(&voted);
        let since_ns = voted.time.ns() - scene.flown.start.ns();
        if since_ns % NS_PER_S == 0
            && let Some(epoch) = scene.flown.epochs.get((since_ns / NS_PER_S) as usize)
        {
            let noise = seed.wrapping_mul(1 << 20) + (since_ns / NS_PER_S) as u64;
            chain.epoch(epoch, &voted, noise)?;
        }
    }
    Ok(is_new)
}
