//! Skies to measure under: orbits, observations, linear models. Repeatable, from a generator of our
//! own; plausible, not accurate.

use core::f64::consts::PI;
use surefix_core::consts::{MAX_UNKNOWNS, MU_GPS};
use surefix_core::gnss::{
    Ephemeris, EphemerisStore, NavMessage, ObservationEpoch, Satellite, Signal, SignalObservation,
    System, measurement, orbit,
};
use surefix_core::linalg::LinearModel;
use surefix_core::time::GpsTime;

/// Time of every epoch.
pub const TIME: GpsTime = GpsTime::from_week_tow_s(2200, 345_600);
/// The receiver, ECEF, m: 48° north, 11° east.
pub const RECEIVER_E_M: [f64; 3] = [4_197_500.0, 815_900.0, 4_717_000.0];

/// [KNUTH-2] 3.3.4, the multiplier of MMIX.
pub struct Random(u64);

impl Random {
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Even between 0 and 1.
    pub fn unit(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// About normal, one sigma 1: the sum of twelve.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }
}

/// `n` satellites of `clocks` constellations in random directions above 10°, sigmas by elevation.
pub fn model(random: &mut Random, n: usize, clocks: usize, model: &mut LinearModel) {
    *model = LinearModel::EMPTY;
    model.n = n;
    model.m = 3 + clocks;
    let rows = model
        .design
        .iter_mut()
        .zip(model.residual_m.iter_mut().zip(model.sigma_m.iter_mut()));
    for (index, (row, (residual_m, sigma_m))) in rows.take(n).enumerate() {
        let sin_elevation = 0.17 + 0.82 * random.unit();
        let cos_elevation = libm::sqrt(1.0 - sin_elevation * sin_elevation);
        let azimuth_rad = 2.0 * PI * random.unit();
        *row = [0.0; MAX_UNKNOWNS];
        row[0] = -cos_elevation * libm::sin(azimuth_rad);
        row[1] = -cos_elevation * libm::cos(azimuth_rad);
        row[2] = -sin_elevation;
        row[3 + index % clocks] = 1.0;
        *sigma_m = 0.5 + 1.0 / sin_elevation;
        *residual_m = *sigma_m * random.normal();
    }
}

/// A random direction above 10°, of unit length.
pub fn direction(random: &mut Random) -> [f64; 3] {
    let up = 0.17 + 0.82 * random.unit();
    let level = libm::sqrt(1.0 - up * up);
    let azimuth_rad = 2.0 * PI * random.unit();
    [
        level * libm::sin(azimuth_rad),
        level * libm::cos(azimuth_rad),
        up,
    ]
}

/// A random turn about one axis, by rows.
pub fn attitude(random: &mut Random) -> [f64; 9] {
    let angle_rad = 2.0 * PI * random.unit();
    let (sin, cos) = (libm::sin(angle_rad), libm::cos(angle_rad));
    [cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0]
}

fn ephemeris(satellite: Satellite, omega0_rad: f64, m0_rad: f64) -> Ephemeris {
    let (message, semi_major_m, i0_rad) = match satellite.system() {
        System::Gps => (NavMessage::GpsLnav, 26_560e3, 0.96),
        System::Galileo => (NavMessage::GalileoInav, 29_600e3, 0.98),
        System::Bds => (NavMessage::BdsD1D2, 27_906e3, 0.96),
    };
    Ephemeris {
        satellite,
        message,
        toe: TIME,
        toc: TIME,
        toe_sow_s: TIME.tow_s(),
        issue: 1,
        sqrt_a: libm::sqrt(semi_major_m),
        eccentricity: 0.008,
        i0_rad,
        idot_radps: 1e-10,
        omega0_rad,
        omega_dot_radps: -8e-9,
        argument_of_perigee_rad: 0.7,
        m0_rad,
        delta_n_radps: 4e-9,
        cuc_rad: 1e-6,
        cus_rad: 8e-6,
        crc_m: 200.0,
        crs_m: 20.0,
        cic_rad: 1e-7,
        cis_rad: 1e-7,
        af0_s: 1e-4,
        af1_sps: 1e-12,
        af2_sps2: 0.0,
        group_delay_s: [-1e-8, 0.0],
        sigma_ura_m: Some(2.0),
        health: 0,
    }
}

/// Sine of the elevation at the receiver, taking the Earth for a sphere.
fn sin_elevation(r_es_e: [f64; 3]) -> f64 {
    let mut along = 0.0;
    let mut range_squared = 0.0;
    let mut radius_squared = 0.0;
    for (satellite, receiver) in r_es_e.iter().zip(RECEIVER_E_M) {
        let step = satellite - receiver;
        along += step * receiver;
        range_squared += step * step;
        radius_squared += receiver * receiver;
    }
    along / libm::sqrt(range_squared * radius_squared)
}

/// Fills store and epoch with `n` satellites above 15°, of the first `clocks` constellations in turn.
pub fn observed(
    random: &mut Random,
    n: usize,
    clocks: usize,
    store: &mut EphemerisStore,
    epoch: &mut ObservationEpoch,
) {
    const _: () = assert!(MU_GPS > 0.0);
    store.clear();
    epoch.restart(TIME);
    let clock_m = 1000.0 * random.normal();
    for index in 0..n {
        let Some(&system) = System::ALL.get(index % clocks) else {
            continue;
        };
        // BDS from C06: the first five are geostationary.
        let first = if system == System::Bds { 6 } else { 1 };
        let Some(satellite) = Satellite::new(system, first + (index / clocks) as u8) else {
            continue;
        };
        for _ in 0..200 {
            let candidate = ephemeris(
                satellite,
                2.0 * PI * random.unit() - PI,
                2.0 * PI * random.unit() - PI,
            );
            let Ok(state) = orbit::position_velocity(&candidate, 0.0) else {
                continue;
            };
            if sin_elevation(state.r_e_m) > 0.26 && store.insert(&candidate).is_ok() {
                observe(random, satellite, clock_m, store, epoch);
                break;
            }
        }
    }
}

/// Adds the observation that the model predicts, and noise.
fn observe(
    random: &mut Random,
    satellite: Satellite,
    clock_m: f64,
    store: &EphemerisStore,
    epoch: &mut ObservationEpoch,
) {
    let mut observation = SignalObservation::new(match satellite.system() {
        System::Bds => Signal::C2I,
        System::Gps | System::Galileo => Signal::C1C,
    });
    let mut pseudorange_m = 22_000e3;
    let mut alone = ObservationEpoch::EMPTY;
    for _ in 0..5 {
        alone.restart(TIME);
        observation.pseudorange_m = Some(pseudorange_m);
        observation.range_rate_mps = Some(0.0);
        let _ = alone.add(satellite, observation);
        let Some(seen) = alone.get(satellite) else {
            return;
        };
        let Ok(measured) = measurement::measure(seen, TIME, store, false) else {
            return;
        };
        let predicted_m =
            measurement::predicted_pseudorange_m(&measured, RECEIVER_E_M, clock_m, 0.0);
        pseudorange_m += predicted_m - measured.pseudorange_m;
        observation.range_rate_mps = Some(measurement::predicted_range_rate_mps(
            &measured,
            RECEIVER_E_M,
            [0.0; 3],
            0.0,
        ));
    }
    observation.pseudorange_m = Some(pseudorange_m + random.normal());
    let _ = epoch.add(satellite, observation);
}
