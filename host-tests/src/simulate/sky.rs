//! The simulated sky: GPS, Galileo and BDS in their nominal constellations.
//!
//! Slots come from the performance standards; eccentricities, corrections and clocks are drawn once
//! from a fixed seed in the sizes real broadcasts have, so every simulation flies under the same
//! sky. The slots stand at the start of the simulated week as their sources give them for their
//! reference epochs: a sky of the right kind, not the sky of a date.
//!
//! | constellation | slots | source |
//! |---|---|---|
//! | GPS | 24, six planes, 55°, 26,559.7 km | [GPS-SPS-PS] table 3.2-1 |
//! | Galileo | Walker 24/3/1, 56°, 29,599.8 km | [GAL-OS-SDD] annex on the constellation |
//! | BDS MEO | Walker 24/3/1, 55°, 27,906 km | [BDS-OS-PS] on the space segment |
//! | BDS IGSO | three, 55°, nodes 120° apart, ground track about 118° E | [BDS-OS-PS] |
//! | BDS GEO | 80°, 110.5°, 140° E | [BDS-OS-PS] |

use core::f64::consts::{PI, TAU};

use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::SeedableRng;
use surefix_core::gnss::{Ephemeris, NavMessage, Satellite, System};
use surefix_core::time::{BDT_WEEK_OFFSET, GpsTime, NS_PER_S};

use super::noise::uniform;
use super::orbit::{earth_rate, gravitational_constant};
use crate::rtcm_encode::quantise;

/// GPS week of the simulations.
pub const WEEK: i32 = 2420;
/// Time between ephemerides, s; each is used an hour to either side of its toe.
pub const UPDATE_S: i64 = 7200;

/// Seed of the sky, apart from the seed of a simulation.
const SKY_SEED: u64 = 0x5359_4b59;

/// Slots of [GPS-SPS-PS] table 3.2-1: right ascension of the node and argument of latitude, degrees.
const GPS_SLOTS: [(f64, [f64; 4]); 6] = [
    (272.847, [268.126, 161.786, 11.676, 41.806]),
    (332.847, [80.956, 173.336, 309.976, 204.376]),
    (32.847, [111.876, 11.796, 339.666, 241.556]),
    (92.847, [135.226, 265.446, 35.156, 167.356]),
    (152.847, [197.046, 302.596, 66.066, 333.686]),
    (212.847, [238.886, 345.226, 105.206, 135.346]),
];
/// Sidereal angle of Greenwich at the reference epoch of that table, 18 h 36 min 14.4 s, degrees.
const GPS_SLOTS_GREENWICH_DEG: f64 = 279.06;
const GPS_AXIS_M: f64 = 26_559_710.0;
const GALILEO_AXIS_M: f64 = 29_599_800.0;
const BDS_MEO_AXIS_M: f64 = 27_906_100.0;
/// Semi-major axis of one sidereal day, m.
const SYNCHRONOUS_AXIS_M: f64 = 42_164_170.0;
/// PRNs of the 24 MEO of BDS-3.
const BDS_MEO_PRNS: [u8; 24] = [
    19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 32, 33, 34, 35, 36, 37, 41, 42, 43, 44, 45, 46,
];
const BDS_IGSO_PRNS: [u8; 3] = [38, 39, 40];
const BDS_IGSO_LONGITUDE_DEG: f64 = 118.0;
const BDS_GEO: [(u8, f64); 3] = [(59, 140.0), (60, 80.0), (61, 110.5)];

/// One satellite's place in the constellation, and what its broadcasts look like.
#[derive(Clone, Debug)]
pub struct Slot {
    /// Which satellite.
    pub satellite: Satellite,
    /// Elements at toe = start of the week; `toe_sow_s` and the times are set per broadcast.
    elements: Ephemeris,
    /// Node in Earth-fixed axes at the start of the week, rad.
    node_rad: f64,
}

/// Every satellite of the simulated sky.
#[derive(Clone, Debug)]
pub struct Sky {
    slots: Vec<Slot>,
}

impl Default for Sky {
    fn default() -> Self {
        Self::new()
    }
}

impl Sky {
    /// The sky: always the same.
    pub fn new() -> Self {
        let mut places = Vec::new();
        for (plane, (node_deg, arguments)) in GPS_SLOTS.iter().enumerate() {
            for (k, argument_deg) in arguments.iter().enumerate() {
                let prn = (4 * plane + k + 1) as u8;
                let node_deg = node_deg - GPS_SLOTS_GREENWICH_DEG;
                places.push((System::Gps, prn, GPS_AXIS_M, 55.0, node_deg, *argument_deg));
            }
        }
        for k in 0..24_u8 {
            let (node, argument) = walker_24_3_1(k);
            places.push((System::Galileo, k + 1, GALILEO_AXIS_M, 56.0, node, argument));
            let prn = BDS_MEO_PRNS[usize::from(k)];
            places.push((
                System::Bds,
                prn,
                BDS_MEO_AXIS_M,
                55.0,
                node + 40.0,
                argument,
            ));
        }
        for (k, prn) in BDS_IGSO_PRNS.into_iter().enumerate() {
            // Nodes 120° apart and phased against them: all three cross the same longitude.
            let turn = 120.0 * k as f64;
            let node = BDS_IGSO_LONGITUDE_DEG + turn;
            places.push((System::Bds, prn, SYNCHRONOUS_AXIS_M, 55.0, node, -turn));
        }
        for (prn, longitude) in BDS_GEO {
            // In the tilted frame the equator is inclined by 5° with its node at 180°.
            let argument = longitude + 180.0;
            places.push((System::Bds, prn, SYNCHRONOUS_AXIS_M, 5.0, 180.0, argument));
        }
        let slots = places
            .into_iter()
            .filter_map(|(system, prn, axis_m, inclination, node, argument)| {
                let satellite = Satellite::new(system, prn)?;
                Some(Slot::new(satellite, axis_m, inclination, node, argument))
            })
            .collect();
        Self { slots }
    }

    /// Every satellite's slot.
    pub fn slots(&self) -> &[Slot] {
        &self.slots
    }
}

/// Node and argument of latitude, degrees, of satellite `k` of a Walker 24/3/1 constellation.
fn walker_24_3_1(k: u8) -> (f64, f64) {
    let (plane, place) = (f64::from(k / 8), f64::from(k % 8));
    (120.0 * plane, 45.0 * place + 15.0 * plane)
}

/// Number of the ephemeris in use at an instant: the one whose toe is nearest.
pub fn issue_at(system: System, time: GpsTime) -> i64 {
    let since_first_s = time.seconds_since(toe(system, 0));
    libm::floor(since_first_s / UPDATE_S as f64 + 0.5) as i64
}

/// Reference time of ephemeris `issue` of the week.
fn toe(system: System, issue: i64) -> GpsTime {
    match system {
        System::Gps | System::Galileo => GpsTime::from_week_tow_s(WEEK, issue * UPDATE_S),
        System::Bds => GpsTime::from_bdt(WEEK - BDT_WEEK_OFFSET, issue * UPDATE_S),
    }
}

impl Slot {
    fn new(
        satellite: Satellite,
        axis_m: f64,
        inclination_deg: f64,
        node_deg: f64,
        argument_deg: f64,
    ) -> Self {
        let system = satellite.system();
        let mut random = ChaCha20Rng::seed_from_u64(SKY_SEED);
        random.set_stream(satellite.index() as u64);
        let mut within = |size: f64| size * (2.0 * uniform(&mut random) - 1.0);

        let synchronous = axis_m > 40.0e6;
        // A geostationary orbit is equatorial in the tilted frame of every toe.
        let tilting = if satellite.is_bds_geo() { 1.0e-3 } else { 1.0 };
        let eccentricity = match (system, synchronous) {
            (System::Gps, _) => 0.006 + within(0.005),
            (System::Galileo, _) => 2.5e-4 + within(1.5e-4),
            (System::Bds, false) => 8.0e-4 + within(6.0e-4),
            (System::Bds, true) => 5.0e-4 + within(3.0e-4),
        };
        let perigee_rad = within(PI);
        let group_delay_s = match system {
            System::Gps => [within(1.2e-8), 0.0],
            System::Galileo | System::Bds => [within(8.0e-9), within(8.0e-9)],
        };
        let message = match system {
            System::Gps => NavMessage::GpsLnav,
            System::Galileo => NavMessage::GalileoInav,
            System::Bds => NavMessage::BdsD1D2,
        };
        let elements = Ephemeris {
            satellite,
            message,
            toe: GpsTime::from_week_tow_s(WEEK, 0),
            toc: GpsTime::from_week_tow_s(WEEK, 0),
            toe_sow_s: 0.0,
            issue: 0,
            sqrt_a: libm::sqrt(axis_m),
            eccentricity,
            i0_rad: inclination_deg.to_radians() + within(0.003 * tilting),
            idot_radps: within(4.0e-10 * tilting),
            omega0_rad: 0.0,
            omega_dot_radps: if synchronous {
                within(1.0e-10)
            } else {
                -7.5e-9 + within(6.0e-10)
            },
            argument_of_perigee_rad: perigee_rad,
            m0_rad: argument_deg.to_radians() - perigee_rad,
            delta_n_radps: if synchronous {
                within(8.0e-10)
            } else {
                3.8e-9 + within(1.0e-9)
            },
            cuc_rad: within(6.0e-6),
            cus_rad: within(9.0e-6),
            crc_m: 220.0 + within(120.0),
            crs_m: within(110.0),
            cic_rad: within(1.5e-7),
            cis_rad: within(1.5e-7),
            af0_s: within(4.0e-4),
            af1_sps: within(8.0e-12),
            af2_sps2: 0.0,
            group_delay_s,
            sigma_ura_m: None,
            health: 0,
        };
        Self {
            satellite,
            elements,
            node_rad: node_deg.to_radians(),
        }
    }

    /// Ephemeris number `issue` of the week as the satellite broadcasts it: every field is exactly
    /// what its bits hold. For Galileo this is the I/NAV message.
    pub fn broadcast(&self, issue: i64) -> Ephemeris {
        let mut ephemeris = self.elements;
        let system = self.satellite.system();
        ephemeris.toe = toe(system, issue);
        ephemeris.toc = ephemeris.toe;
        let bdt_shift_ns = match system {
            System::Gps | System::Galileo => 0,
            System::Bds => 14 * NS_PER_S,
        };
        let own_time = ephemeris.toe.plus_ns(-bdt_shift_ns);
        ephemeris.toe_sow_s = own_time.tow_s();
        ephemeris.issue = issue.rem_euclid(match system {
            System::Gps => 240,
            System::Galileo => 1024,
            System::Bds => 24,
        }) as u16;

        let since_week_s = ephemeris.toe.seconds_since(self.elements.toe);
        let axis_m = ephemeris.sqrt_a * ephemeris.sqrt_a;
        let mean_motion = libm::sqrt(gravitational_constant(system) / axis_m) / axis_m;
        let rate = earth_rate(system);
        if self.satellite.is_bds_geo() {
            // The tilted frame starts anew at every toe; over one frame the satellite keeps its
            // longitude when its motion along the orbit is the Earth's.
            ephemeris.delta_n_radps = rate - mean_motion - ephemeris.omega_dot_radps;
            ephemeris.m0_rad += rate * since_week_s;
            ephemeris.argument_of_perigee_rad =
                within_half_turn(ephemeris.argument_of_perigee_rad - rate * since_week_s);
            ephemeris.omega0_rad = self.node_rad + rate * ephemeris.toe_sow_s;
        } else {
            ephemeris.m0_rad += (mean_motion + ephemeris.delta_n_radps) * since_week_s;
            let node_rad = self.node_rad + (ephemeris.omega_dot_radps - rate) * since_week_s;
            ephemeris.omega0_rad = node_rad + rate * ephemeris.toe_sow_s;
        }
        ephemeris.m0_rad = within_half_turn(ephemeris.m0_rad);
        ephemeris.omega0_rad = within_half_turn(ephemeris.omega0_rad);
        ephemeris.i0_rad += ephemeris.idot_radps * since_week_s;
        ephemeris.af0_s += ephemeris.af1_sps * since_week_s;
        quantise(&ephemeris)
    }
}

/// The angle minus whole turns, rad, from −π up to π.
fn within_half_turn(angle_rad: f64) -> f64 {
    angle_rad - TAU * libm::floor((angle_rad + PI) / TAU)
}

/// The F/NAV message of a Galileo satellite whose I/NAV message is given: the same orbit, and the
/// clock of the (E1, E5a) combination, so that both give the same E1 code.
pub fn galileo_fnav(inav: &Ephemeris) -> Ephemeris {
    let mut fnav = *inav;
    let [bgd_e5a_s, bgd_e5b_s] = inav.group_delay_s;
    fnav.message = NavMessage::GalileoFnav;
    // Exact: af0 resolves 2^-34 s and BGD 2^-32 s.
    fnav.af0_s = inav.af0_s - bgd_e5b_s + bgd_e5a_s;
    quantise(&fnav)
}
