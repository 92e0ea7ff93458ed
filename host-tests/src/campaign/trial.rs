//! One flight of a trial, scored epoch by epoch.

use anyhow::Result;
use nalgebra::Vector3;
use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::SeedableRng;
use surefix_core::gnss::{Satellite, System};
use surefix_core::ins::InitialState;
use surefix_core::ins::mechanisation::Increment;
use surefix_core::mhss::BankVerdict;
use surefix_core::mhss::bank::Explanation;

use super::errors::{CommonFault, Errors, NoiseModel};
use super::flown::{Flown, Seen};
use super::rig::{Rig, RigSetup};
use crate::faults::FaultSpec;
use crate::simulate::inertial::clock::ReceiverClock;
use crate::simulate::inertial::sensors::{UnitErrors, normal3};
use crate::simulate::inertial::trajectory::{quaternion, rotation};
use crate::simulate::noise::normal;

/// Streams of random numbers of a trial; those of satellites begin at 1.
const STREAM_UNIT: u64 = 1 << 32;
const STREAM_INITIAL: u64 = (1 << 32) + 1;
const STREAM_CLOCK: u64 = (1 << 32) + 2;

/// A trial.
#[derive(Clone, Debug)]
pub struct Trial<'a> {
    /// The truth.
    pub flown: &'a Flown,
    /// Satellites the receiver uses.
    pub satellites: &'a [Satellite],
    /// The monitor.
    pub setup: RigSetup,
    /// Noise of the pseudoranges.
    pub noise: NoiseModel,
    /// Faults of satellites.
    pub faults: Vec<FaultSpec>,
    /// A fault of a constellation.
    pub common: Option<CommonFault>,
    /// True clock offsets of the constellations by their index, m.
    pub offset_m: [f64; System::ALL.len()],
    /// Draws everything random.
    pub seed: u64,
}

/// An epoch of a trial: horizontal first, vertical second.
#[derive(Clone, Debug)]
pub struct Scored {
    /// Since the start, s.
    pub t_s: usize,
    /// Error of the position, after an exclusion of the new one, m.
    pub error_m: [f64; 2],
    /// What bounds it while no test fails: max(HPL, hpl0) and the same vertically, m.
    pub level_m: [f64; 2],
    /// What is said to bound it while one does: the largest d + a, m.
    pub alerted_level_m: [f64; 2],
    /// Whether a test failed, by false-alert probability.
    pub detected: Vec<bool>,
    /// What was excluded at this epoch.
    pub excluded: Option<Explanation>,
    /// All filters are copies since an exclusion.
    pub blind: bool,
    /// All verdicts.
    pub verdicts: Vec<BankVerdict>,
}

impl Scored {
    /// Whether a user may take the position: there are tests and none failed. At the epoch of an exclusion
    /// one did.
    pub fn is_usable(&self) -> bool {
        !self.detected[0] && !self.blind
    }

    /// Largest error over its level, of the first `axes`.
    pub fn ratio(&self, axes: usize) -> f64 {
        (0..axes)
            .map(|axis| self.error_m[axis] / self.level_m[axis])
            .fold(0.0, f64::max)
    }
}

fn random(seed: u64, stream: u64) -> ChaCha20Rng {
    let mut random = ChaCha20Rng::seed_from_u64(seed);
    random.set_stream(stream);
    random
}

impl<'a> Trial<'a> {
    /// White noise, no fault.
    pub fn new(flown: &'a Flown, satellites: &'a [Satellite], setup: RigSetup, seed: u64) -> Self {
        Self {
            flown,
            satellites,
            setup,
            noise: NoiseModel::WHITE,
            faults: Vec::new(),
            common: None,
            offset_m: [0.0; System::ALL.len()],
            seed,
        }
    }

    /// The truth with a draw of the initial sigmas on it; biases are taken for zero.
    fn initial(&self, clock: (f64, f64)) -> InitialState {
        let mut random = random(self.seed, STREAM_INITIAL);
        let sigma = self.setup.sigma();
        let truth = &self.flown.epochs[0].state;
        let tilt_n = normal3(&mut random).component_mul(&Vector3::from(sigma.attitude_ned_rad));
        InitialState {
            time: self.flown.start,
            r_eb_e_m: (truth.r_eb_e + normal3(&mut random) * sigma.position_m).into(),
            v_eb_e_mps: (truth.v_eb_e + normal3(&mut random) * sigma.velocity_mps).into(),
            q_e_b: quaternion(&(rotation(&(truth.c_e_n * tilt_n)) * truth.c_e_b)),
            gyro_bias_radps: [0.0; 3],
            accel_bias_mps2: [0.0; 3],
            clock_bias_m: clock.0 + normal(&mut random) * sigma.clock_bias_m,
            clock_drift_mps: clock.1 + normal(&mut random) * sigma.clock_drift_mps,
        }
    }

    /// Flies for `duration_s`, or until `each` says no.
    ///
    /// # Errors
    /// When the navigator does not start or finds itself unhealthy.
    pub fn fly<const K: usize, const M: usize>(
        &self,
        rig: &mut Rig<K, M>,
        duration_s: usize,
        mut each: impl FnMut(&Scored, &Rig<K, M>) -> bool,
    ) -> Result<()> {
        let flown = self.flown;
        let rate_hz = flown.rate_hz as usize;
        let clock = ReceiverClock::new(random(self.seed, STREAM_CLOCK), 1.0, duration_s);
        let unit_random = random(self.seed, STREAM_UNIT);
        let mut unit = UnitErrors::new(self.setup.grade.noise(), false, unit_random);
        let mut errors = Errors::new(
            self.noise,
            &self.faults,
            self.common,
            self.offset_m,
            self.seed,
        );
        rig.start(&self.setup, flown.rate_hz, &self.initial(clock.at_step(0)))?;
        let dt_s = 1.0 / f64::from(flown.rate_hz);
        let interval_ns = 1_000_000_000 / i64::from(flown.rate_hz);
        for second in 1..=duration_s.min(flown.duration_s()) {
            for k in (second - 1) * rate_hz..second * rate_hz {
                let (dtheta, dv) = flown.increments[k];
                let (dtheta_b, dv_b) = unit.disturb(dt_s, dtheta, dv);
                let time = flown.start.plus_ns((k as i64 + 1) * interval_ns);
                rig.sample(
                    &Increment {
                        dtheta_b,
                        dv_b,
                        dt_s,
                    },
                    time,
                );
            }
            let truth = &flown.epochs[second];
            let used = |seen: &&Seen| self.satellites.contains(&seen.measurement.satellite);
            let measured = errors.measure(
                second as f64,
                truth.seen.iter().filter(used),
                clock.at_step(second),
            );
            let epoch = rig.epoch(flown.time(second), &measured)?;
            let error_n =
                truth.state.c_e_n.transpose() * (Vector3::from(epoch.r_e_m) - truth.state.r_eb_e);
            let first = &epoch.verdicts[0];
            let scored = Scored {
                t_s: second,
                error_m: [libm::hypot(error_n.x, error_n.y), error_n.z.abs()],
                level_m: [0, 1].map(|k| first.level_m[k].max(first.fault_free_m[k])),
                alerted_level_m: [0, 1]
                    .map(|k| first.alerted_level_m[k].max(first.fault_free_m[k])),
                detected: epoch.verdicts.iter().map(|v| v.detected).collect(),
                excluded: epoch.excluded,
                blind: epoch.blind,
                verdicts: epoch.verdicts,
            };
            if !each(&scored, rig) {
                break;
            }
        }
        Ok(())
    }
}

/// The satellites an explanation leaves out, of those used.
pub fn left_out(explanation: Explanation, used: &[Satellite]) -> Vec<Satellite> {
    match explanation {
        Explanation::One(satellite) => vec![satellite],
        Explanation::Two(two) => two.to_vec(),
        Explanation::Constellation(system) => {
            let of_it = used.iter().filter(|s| s.system() == system);
            of_it.copied().collect()
        }
    }
}
