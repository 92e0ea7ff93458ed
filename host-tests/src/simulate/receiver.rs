//! What a receiver at the antenna would measure.
//!
//! In: the sky, the flight, what disturbs the signals. Out: observation epochs and the truth.
//!
//! The way of the signals is in `signal_path.rs`; here are the errors on it.

use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::SeedableRng;
use surefix_core::consts::SPEED_OF_LIGHT_MPS;
use surefix_core::gnss::{Ephemeris, ObservationEpoch, SignalObservation, System};
use surefix_core::time::GpsTime;

use super::atmosphere::{Ionosphere, ionosphere_m};
use super::disturbances::{DisturbanceError, Disturbances, Disturber, on_carrier};
use super::flight::{AntennaState, Track};
use super::noise::{GaussMarkov, normal, uniform};
use super::signal_path::{Platform, SignalPath};
use super::sky::{Sky, issue_at};
use super::stream::Format;

/// Satellites below this elevation are not tracked, degrees.
pub const TRACKING_MASK_DEG: f64 = 5.0;
/// Spread of a satellite's orbit and clock error over simulations, m.
pub const SIGNAL_IN_SPACE_SIGMA_M: f64 = 0.3;
/// Correlation time of multipath, s.
pub const MULTIPATH_TAU_S: f64 = 60.0;
/// Noise of range rates, m/s.
pub const RANGE_RATE_SIGMA_MPS: f64 = 0.03;
/// Noise of carrier phases, m.
pub const PHASE_SIGMA_M: f64 = 0.002;

/// What to simulate besides the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditions {
    /// Draws everything random.
    pub seed: u64,
    /// No noise, multipath or signal-in-space error.
    pub noise_free: bool,
    /// Two signals per satellite: L1 C/A and L2, E1 and E5b, B1I and B3I.
    pub dual_frequency: bool,
    /// The ionosphere.
    pub ionosphere: Ionosphere,
    /// The troposphere of Saastamoinen.
    pub troposphere: bool,
    /// What the receiver writes, and so which signals it tracks.
    pub format: Format,
}

/// One-sigma thermal noise of a pseudorange, m. [DO-229] J.2.4: 0.36 m at minimum signal level to
/// 0.15 m at maximum, here by elevation.
pub fn thermal_sigma_m(elevation_rad: f64) -> f64 {
    0.36 - 0.21 * libm::sin(elevation_rad)
}

/// One-sigma airframe multipath of a pseudorange, m. [DO-229] J.2.4, elevation in degrees.
pub fn multipath_sigma_m(elevation_rad: f64) -> f64 {
    0.13 + 0.53 * libm::exp(-elevation_rad.to_degrees() / 10.0)
}

/// Random state of one satellite's signals; advanced at every epoch whether it is in view or not, so
/// that its noise does not depend on what else is simulated.
struct Disturbance {
    random: ChaCha20Rng,
    signal_in_space_m: f64,
    multipath: [GaussMarkov; 2],
    /// Whole cycles between phase and code at the start of tracking, per channel.
    ambiguity_cycles: [f64; 2],
    tracked_since: Option<GpsTime>,
}

/// One epoch of the receiver.
pub struct Epoch {
    /// What it measured, labelled with the receiver's own time.
    pub observations: ObservationEpoch,
    /// Ephemerides of the tracked satellites, in the order of `observations.satellites`.
    pub ephemerides: Vec<Ephemeris>,
    /// How long each has been tracked, ms, in the same order.
    pub lock_ms: Vec<u64>,
    /// The antenna at the instant of measurement.
    pub antenna: AntennaState,
}

/// A track flown with a clock of constant drift.
struct Carrier {
    track: Track,
    duration_s: f64,
    clock_bias_s: f64,
    clock_drift: f64,
    /// What jumps have put on the clock at this epoch, s.
    jumped_s: f64,
}

impl Platform for Carrier {
    fn antenna(&self, true_s: f64) -> AntennaState {
        self.track.state(true_s, self.duration_s)
    }

    fn clock_bias_s(&self, receiver_s: f64) -> f64 {
        self.clock_bias_s + self.jumped_s + self.clock_drift * receiver_s
    }
}

/// A receiver that flies a path under the sky.
pub struct Receiver {
    sky: Sky,
    carrier: Carrier,
    conditions: Conditions,
    asked: Disturbances,
    disturber: Disturber,
    start: GpsTime,
    duration_s: f64,
    interval_ns: i64,
    next: u64,
    disturbances: Vec<Disturbance>,
    issues: Option<[i64; 3]>,
    /// What every satellite broadcasts now.
    broadcasts: Vec<Ephemeris>,
}

impl Receiver {
    /// A receiver switched on at `start`, giving an epoch every `interval_ns`.
    pub fn new(
        track: Track,
        conditions: Conditions,
        asked: &Disturbances,
        start: GpsTime,
        duration_s: f64,
        interval_ns: i64,
    ) -> Self {
        let sky = Sky::new();
        let disturbances = sky
            .slots()
            .iter()
            .map(|slot| {
                let mut random = ChaCha20Rng::seed_from_u64(conditions.seed);
                random.set_stream(1 + slot.satellite.index() as u64);
                Disturbance {
                    signal_in_space_m: SIGNAL_IN_SPACE_SIGMA_M * normal(&mut random),
                    multipath: [GaussMarkov::new(&mut random), GaussMarkov::new(&mut random)],
                    ambiguity_cycles: [0, 1].map(|_| libm::round(200.0 * uniform(&mut random))),
                    tracked_since: None,
                    random,
                }
            })
            .collect();
        let satellites = sky.slots().iter().map(|slot| slot.satellite);
        let disturber = Disturber::new(asked, conditions.seed, satellites);
        let mut random = ChaCha20Rng::seed_from_u64(conditions.seed);
        Self {
            sky,
            carrier: Carrier {
                track,
                duration_s,
                clock_bias_s: 2.0e-4 * (uniform(&mut random) - 0.5),
                clock_drift: 2.0e-8 * (uniform(&mut random) - 0.5),
                jumped_s: 0.0,
            },
            conditions,
            asked: asked.clone(),
            disturber,
            start,
            duration_s,
            interval_ns,
            next: 0,
            disturbances,
            issues: None,
            broadcasts: Vec::new(),
        }
    }

    /// After the last epoch.
    ///
    /// # Errors
    /// When an outage hid nothing.
    pub fn check(&self) -> Result<(), DisturbanceError> {
        self.disturber.check()
    }
}

impl Iterator for Receiver {
    type Item = Epoch;

    fn next(&mut self) -> Option<Epoch> {
        let since_start_ns = self.next as i64 * self.interval_ns;
        if since_start_ns as f64 / 1e9 > self.duration_s {
            return None;
        }
        let before_s = self.next.checked_sub(1).map(|k| {
            let since_start_ns = k as i64 * self.interval_ns;
            since_start_ns as f64 / 1e9
        });
        self.next += 1;
        let label = self.start.plus_ns(since_start_ns);
        let t_s = since_start_ns as f64 / 1e9;
        self.carrier.jumped_s = self.asked.jumped_s(t_s);
        self.disturber.step(self.interval_ns as f64 / 1e9);
        let way = SignalPath {
            platform: &self.carrier,
            start: self.start,
            troposphere: self.conditions.troposphere,
        };
        let mut epoch = Epoch {
            observations: ObservationEpoch::EMPTY,
            ephemerides: Vec::new(),
            lock_ms: Vec::new(),
            antenna: way.antenna(label, 0.0),
        };
        epoch.observations.restart(label);
        epoch.observations.flags.clock_reset = self.asked.clock_was_set(before_s, t_s);
        let issues = System::ALL.map(|system| issue_at(system, label));
        if self.issues != Some(issues) {
            self.issues = Some(issues);
            let of = |system: System| issues[system.index()];
            let slots = self.sky.slots().iter();
            self.broadcasts = slots
                .map(|slot| slot.broadcast(of(slot.satellite.system())))
                .collect();
        }

        let mut disturbances = core::mem::take(&mut self.disturbances);
        for (ephemeris, disturbance) in self.broadcasts.iter().zip(&mut disturbances) {
            let interval_s = self.interval_ns as f64 / 1e9;
            let random = &mut disturbance.random;
            let multipath = disturbance
                .multipath
                .each_mut()
                .map(|process| process.step(random, interval_s, MULTIPATH_TAU_S));
            let white = [0, 1].map(|_| [0, 1, 2].map(|_| normal(random)));

            let path = way.path(ephemeris, label, 0.0);
            if path.ray.elevation_rad.to_degrees() < TRACKING_MASK_DEG {
                disturbance.tracked_since = None;
                continue;
            }
            if self.disturber.hides(t_s, ephemeris.satellite) {
                disturbance.tracked_since = None;
                continue;
            }
            let tracked_since = *disturbance.tracked_since.get_or_insert(label);
            let system = ephemeris.satellite.system();
            let scale = if self.conditions.noise_free { 0.0 } else { 1.0 };
            let asked_multipath_m = self.disturber.multipath_m(ephemeris.satellite);
            let left_over_m = self.disturber.ionosphere_m(path.ray.elevation_rad);
            let Conditions {
                format,
                dual_frequency,
                ..
            } = self.conditions;
            for (k, channel) in format.channels(system, dual_frequency).iter().enumerate() {
                // Short, because an aircraft's acceleration jumps where the level segment ends.
                let step_s = 0.01;
                let clean_m = way.clean_range_m(ephemeris, channel, label, 0.0);
                let before_m = way.clean_range_m(ephemeris, channel, label, -step_s);
                let after_m = way.clean_range_m(ephemeris, channel, label, step_s);
                let model_m = ionosphere_m(
                    self.conditions.ionosphere,
                    &path.ray,
                    label,
                    channel.frequency_hz,
                );
                let ionosphere_m = model_m + on_carrier(left_over_m, channel.frequency_hz);
                let elevation_rad = path.ray.elevation_rad;
                let (own_multipath_m, asked_multipath_m) = match asked_multipath_m {
                    Some(asked) => (0.0, asked[k]),
                    None => (multipath_sigma_m(elevation_rad) * multipath[k], 0.0),
                };
                let error_m = disturbance.signal_in_space_m
                    + own_multipath_m
                    + thermal_sigma_m(elevation_rad) * white[k][0];
                let wavelength_m = SPEED_OF_LIGHT_MPS / channel.frequency_hz;
                let phase_m = clean_m - ionosphere_m
                    + scale * (disturbance.signal_in_space_m + PHASE_SIGMA_M * white[k][1]);

                let mut observation = SignalObservation::new(channel.signal);
                observation.pseudorange_m =
                    Some(clean_m + ionosphere_m + scale * error_m + asked_multipath_m);
                observation.carrier_phase_cycles =
                    Some(phase_m / wavelength_m + disturbance.ambiguity_cycles[k]);
                observation.range_rate_mps = Some(
                    (after_m - before_m) / (2.0 * step_s)
                        + scale * RANGE_RATE_SIGMA_MPS * white[k][2],
                );
                observation.cn0_dbhz = Some(cn0_dbhz(elevation_rad));
                // Fits: fewer satellites are above the mask than an epoch holds.
                let _ = epoch.observations.add(ephemeris.satellite, observation);
            }
            epoch.ephemerides.push(*ephemeris);
            let lock_ns = label.ns() - tracked_since.ns();
            epoch.lock_ms.push((lock_ns / 1_000_000) as u64);
        }
        self.disturbances = disturbances;
        Some(epoch)
    }
}

/// Carrier-to-noise density by elevation, dB-Hz, on the 1/16 dB grid of MSM7.
pub fn cn0_dbhz(elevation_rad: f64) -> f32 {
    let value = 36.0 + 13.0 * libm::sin(elevation_rad);
    (libm::round(value * 16.0) / 16.0) as f32
}
