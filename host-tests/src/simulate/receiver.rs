//! What a receiver at the antenna would measure.
//!
//! In: the sky, the flight, what disturbs the signals. Out: observation epochs and the truth.
//!
//! A pseudorange is the receiver's reading of reception minus the satellite's reading of
//! transmission, times the speed of light. Transmission is found by iterating on the time of flight
//! in axes frozen at reception (`orbit.rs`), so nothing is linearised and no correction of the
//! receiver's algorithm is used backwards.
//!
//! | symbol | code        | unit | meaning                                              |
//! |--------|-------------|------|------------------------------------------------------|
//! | τ      | flight_s    | s    | time of flight, atmosphere included                  |
//! | Δt_r   | bias_s      | s    | receiver clock minus GPST                            |
//! | Δt_s   | satellite_s | s    | code of this signal minus GPST at transmission       |

use nalgebra::Vector3;
use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::SeedableRng;
use surefix_core::consts::SPEED_OF_LIGHT_MPS;
use surefix_core::gnss::signal::{FREQUENCY_E5B_HZ, FREQUENCY_L1_HZ, FREQUENCY_L2_HZ};
use surefix_core::gnss::{Ephemeris, ObservationEpoch, Signal, SignalObservation, System};
use surefix_core::time::GpsTime;

use super::atmosphere::{Ionosphere, Ray, ionosphere_m, troposphere_m};
use super::flight::{AntennaState, Flight, c_e_enu, geodetic_from_ecef};
use super::noise::{GaussMarkov, normal, uniform};
use super::orbit::{clock_offset_s, position_frozen_e};
use super::sky::{Sky, issue_at};

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

/// A signal the receiver tracks: which, on what carrier, and how the group delays enter its code.
struct Channel {
    signal: Signal,
    frequency_hz: f64,
    /// Code delay, s, to subtract from the broadcast clock.
    group_delay_s: fn(&Ephemeris) -> f64,
}

fn channels(system: System, dual_frequency: bool) -> Vec<Channel> {
    let signal = |band, attribute| Signal::new(band, attribute).expect("letters and digits");
    let mut all = match system {
        System::Gps => vec![
            Channel {
                signal: Signal::C1C,
                frequency_hz: FREQUENCY_L1_HZ,
                group_delay_s: |e| e.group_delay_s[0],
            },
            Channel {
                signal: signal(b'2', b'W'),
                frequency_hz: FREQUENCY_L2_HZ,
                // [IS-GPS-200] 20.3.3.3.3.2: (77/60)².
                group_delay_s: |e| e.group_delay_s[0] * (77.0 * 77.0) / (60.0 * 60.0),
            },
        ],
        System::Galileo => vec![
            Channel {
                signal: Signal::C1C,
                frequency_hz: FREQUENCY_L1_HZ,
                group_delay_s: |e| e.group_delay_s[1],
            },
            Channel {
                signal: signal(b'7', b'Q'),
                frequency_hz: FREQUENCY_E5B_HZ,
                // [GAL-OS-SIS-ICD] 5.1.5, carriers 1540 and 1180 times 1.023 MHz.
                group_delay_s: |e| e.group_delay_s[1] * (1540.0 * 1540.0) / (1180.0 * 1180.0),
            },
        ],
        System::Bds => vec![
            Channel {
                signal: Signal::C2I,
                frequency_hz: 1_561.098e6,
                group_delay_s: |e| e.group_delay_s[0],
            },
            Channel {
                signal: signal(b'6', b'I'),
                frequency_hz: 1_268.52e6,
                group_delay_s: |_| 0.0,
            },
        ],
    };
    all.truncate(if dual_frequency { 2 } else { 1 });
    all
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

/// A receiver that flies a path under the sky.
pub struct Receiver {
    sky: Sky,
    flight: Flight,
    conditions: Conditions,
    start: GpsTime,
    duration_s: f64,
    interval_ns: i64,
    next: u64,
    clock_bias_s: f64,
    clock_drift: f64,
    disturbances: Vec<Disturbance>,
    issues: Option<[i64; 3]>,
    /// What every satellite broadcasts now.
    broadcasts: Vec<Ephemeris>,
}

/// Geometry of one satellite at one instant of reception.
struct Path {
    flight_s: f64,
    range_m: f64,
    ray: Ray,
    troposphere_m: f64,
}

impl Receiver {
    /// A receiver switched on at `start`, giving an epoch every `interval_ns`.
    pub fn new(
        flight: Flight,
        conditions: Conditions,
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
        let mut random = ChaCha20Rng::seed_from_u64(conditions.seed);
        Self {
            sky,
            flight,
            conditions,
            start,
            duration_s,
            interval_ns,
            next: 0,
            clock_bias_s: 2.0e-4 * (uniform(&mut random) - 0.5),
            clock_drift: 2.0e-8 * (uniform(&mut random) - 0.5),
            disturbances,
            issues: None,
            broadcasts: Vec::new(),
        }
    }

    /// Receiver clock minus GPST when the receiver's clock shows `label` plus `after_s`.
    fn clock_bias_s(&self, label: GpsTime, after_s: f64) -> f64 {
        self.clock_bias_s + self.clock_drift * (label.seconds_since(self.start) + after_s)
    }

    fn antenna(&self, label: GpsTime, after_s: f64) -> AntennaState {
        let true_s = label.seconds_since(self.start) + after_s - self.clock_bias_s(label, after_s);
        self.flight.state(true_s, self.duration_s)
    }

    /// Light path to the antenna, received when the receiver's clock shows `label` plus `after_s`.
    fn path(&self, ephemeris: &Ephemeris, label: GpsTime, after_s: f64) -> Path {
        let bias_s = self.clock_bias_s(label, after_s);
        let antenna = self.antenna(label, after_s);
        let reception_s = label.seconds_since(ephemeris.toe) + after_s - bias_s;
        let (latitude_rad, longitude_rad, height_m) = geodetic_from_ecef(&antenna.position_e_m);
        let to_enu = c_e_enu(latitude_rad.to_degrees(), longitude_rad.to_degrees()).transpose();
        let mut path = Path {
            flight_s: 0.075,
            range_m: 0.0,
            ray: Ray {
                latitude_rad,
                longitude_rad,
                height_m,
                azimuth_rad: 0.0,
                elevation_rad: 0.0,
            },
            troposphere_m: 0.0,
        };
        // Each turn gains five digits: the satellite moves 1e-5 of the speed of light.
        for _ in 0..5 {
            let satellite = position_frozen_e(ephemeris, reception_s - path.flight_s, reception_s);
            let line: Vector3<f64> = satellite - antenna.position_e_m;
            let enu = to_enu * line;
            path.range_m = line.norm();
            path.ray.azimuth_rad = libm::atan2(enu.x, enu.y);
            path.ray.elevation_rad = libm::asin(enu.z / path.range_m);
            if self.conditions.troposphere {
                path.troposphere_m = troposphere_m(&path.ray);
            }
            path.flight_s = (path.range_m + path.troposphere_m) / SPEED_OF_LIGHT_MPS;
        }
        path
    }

    /// Noise-free pseudorange without ionosphere, m.
    fn clean_range_m(
        &self,
        ephemeris: &Ephemeris,
        channel: &Channel,
        label: GpsTime,
        after_s: f64,
    ) -> f64 {
        let path = self.path(ephemeris, label, after_s);
        let bias_s = self.clock_bias_s(label, after_s);
        let sent_s = after_s - bias_s - path.flight_s;
        let satellite_s = clock_offset_s(
            ephemeris,
            label.seconds_since(ephemeris.toc) + sent_s,
            label.seconds_since(ephemeris.toe) + sent_s,
        ) - (channel.group_delay_s)(ephemeris);
        SPEED_OF_LIGHT_MPS * (path.flight_s + (bias_s - satellite_s))
    }
}

impl Iterator for Receiver {
    type Item = Epoch;

    fn next(&mut self) -> Option<Epoch> {
        let since_start_ns = self.next as i64 * self.interval_ns;
        if since_start_ns as f64 / 1e9 > self.duration_s {
            return None;
        }
        self.next += 1;
        let label = self.start.plus_ns(since_start_ns);
        let mut epoch = Epoch {
            observations: ObservationEpoch::EMPTY,
            ephemerides: Vec::new(),
            lock_ms: Vec::new(),
            antenna: self.antenna(label, 0.0),
        };
        epoch.observations.restart(label);
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

            let path = self.path(ephemeris, label, 0.0);
            if path.ray.elevation_rad.to_degrees() < TRACKING_MASK_DEG {
                disturbance.tracked_since = None;
                continue;
            }
            let tracked_since = *disturbance.tracked_since.get_or_insert(label);
            let system = ephemeris.satellite.system();
            let scale = if self.conditions.noise_free { 0.0 } else { 1.0 };
            for (k, channel) in channels(system, self.conditions.dual_frequency)
                .iter()
                .enumerate()
            {
                // Short, because an aircraft's acceleration jumps where the level segment ends.
                let step_s = 0.01;
                let clean_m = self.clean_range_m(ephemeris, channel, label, 0.0);
                let before_m = self.clean_range_m(ephemeris, channel, label, -step_s);
                let after_m = self.clean_range_m(ephemeris, channel, label, step_s);
                let ionosphere_m = ionosphere_m(
                    self.conditions.ionosphere,
                    &path.ray,
                    label,
                    channel.frequency_hz,
                );
                let elevation_rad = path.ray.elevation_rad;
                let error_m = disturbance.signal_in_space_m
                    + multipath_sigma_m(elevation_rad) * multipath[k]
                    + thermal_sigma_m(elevation_rad) * white[k][0];
                let wavelength_m = SPEED_OF_LIGHT_MPS / channel.frequency_hz;
                let phase_m = clean_m - ionosphere_m
                    + scale * (disturbance.signal_in_space_m + PHASE_SIGMA_M * white[k][1]);

                let mut observation = SignalObservation::new(channel.signal);
                observation.pseudorange_m = Some(clean_m + ionosphere_m + scale * error_m);
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
fn cn0_dbhz(elevation_rad: f64) -> f32 {
    let value = 36.0 + 13.0 * libm::sin(elevation_rad);
    (libm::round(value * 16.0) / 16.0) as f32
}
