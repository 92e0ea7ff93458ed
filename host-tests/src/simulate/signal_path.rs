//! The way of a signal from a simulated satellite to a receiver that moves and whose clock errs.
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
use surefix_core::consts::SPEED_OF_LIGHT_MPS;
use surefix_core::gnss::signal::{FREQUENCY_E5B_HZ, FREQUENCY_L1_HZ, FREQUENCY_L2_HZ};
use surefix_core::gnss::{Ephemeris, Signal, System};
use surefix_core::time::GpsTime;

use super::atmosphere::{Ray, troposphere_m};
use super::flight::{AntennaState, c_e_enu, geodetic_from_ecef};
use super::orbit::{clock_offset_s, position_frozen_e};

/// What carries the antenna and reads the receiver's clock; times in s from the start.
pub trait Platform {
    /// The antenna at a true time.
    fn antenna(&self, true_s: f64) -> AntennaState;
    /// Receiver clock minus GPST, s, when the receiver's clock shows `receiver_s`.
    fn clock_bias_s(&self, receiver_s: f64) -> f64;
}

/// A signal the receiver tracks: which, on what carrier, and how the group delays enter its code.
pub struct Channel {
    /// Which signal.
    pub signal: Signal,
    /// Its carrier, Hz.
    pub frequency_hz: f64,
    /// Code delay, s, to subtract from the broadcast clock.
    group_delay_s: fn(&Ephemeris) -> f64,
}

/// The signals of a system: one, or two on different carriers. The second of GPS is P(Y), which survey
/// receivers track without its code; u-blox receivers have [`channels_of_ubx`].
pub fn channels(system: System, dual_frequency: bool) -> Vec<Channel> {
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

/// As [`channels`], with L2C for the second signal of GPS, as late as P(Y).
pub fn channels_of_ubx(system: System, dual_frequency: bool) -> Vec<Channel> {
    let mut all = channels(system, dual_frequency);
    for channel in &mut all {
        if system == System::Gps && channel.signal.band() == b'2' {
            channel.signal = Signal::new(b'2', b'L').expect("a digit and a letter");
        }
    }
    all
}

/// Geometry of one satellite at one instant of reception.
pub struct Path {
    flight_s: f64,
    range_m: f64,
    /// Where it crosses the atmosphere.
    pub ray: Ray,
    troposphere_m: f64,
}

/// Signals towards one platform.
pub struct SignalPath<'a, P> {
    /// The platform.
    pub platform: &'a P,
    /// Its time zero.
    pub start: GpsTime,
    /// With the troposphere of Saastamoinen.
    pub troposphere: bool,
}

impl<P: Platform> SignalPath<'_, P> {
    /// The antenna when the receiver's clock shows `label` plus `after_s`.
    pub fn antenna(&self, label: GpsTime, after_s: f64) -> AntennaState {
        let receiver_s = label.seconds_since(self.start) + after_s;
        let true_s = receiver_s - self.platform.clock_bias_s(receiver_s);
        self.platform.antenna(true_s)
    }

    fn clock_bias_s(&self, label: GpsTime, after_s: f64) -> f64 {
        self.platform
            .clock_bias_s(label.seconds_since(self.start) + after_s)
    }

    /// Light path to the antenna, received when the receiver's clock shows `label` plus `after_s`.
    pub fn path(&self, ephemeris: &Ephemeris, label: GpsTime, after_s: f64) -> Path {
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
            if self.troposphere {
                path.troposphere_m = troposphere_m(&path.ray);
            }
            path.flight_s = (path.range_m + path.troposphere_m) / SPEED_OF_LIGHT_MPS;
        }
        path
    }

    /// Noise-free pseudorange without ionosphere, m.
    pub fn clean_range_m(
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
