//! Corrected pseudoranges and range rates of a flight, with noise and faults.
//!
//! In: the sky, the true track, the receiver clock. Out: one epoch per receiver interval as scenario
//! folders define it: satellite at transmission in the Earth-fixed axes of reception,
//! ρ = |r_s − r| + clock + noise + fault, ρ' = u·(v_s − v) + drift + noise + fault.
//!
//! One sigma by elevation E, fitted to the reference scenarios within 1.5 %:
//! σ_ρ² = σ_0²/sin E + (0.42 m·F(E))² + (0.36 m)², [P3] (3) with the residual ionosphere on the
//! obliquity factor F of a shell at 350 km and a constant for orbit, clock and troposphere; σ_0 is
//! 0.54 m for GPS, 0.74 m for BDS, 1.09 m for BDS GEO. σ_ρ' = 0.05 m/s / √sin E.

use anyhow::Result;
use nalgebra::Vector3;
use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::SeedableRng;
use surefix_core::consts::SPEED_OF_LIGHT_MPS;
use surefix_core::gnss::corrected::CorrectedMeasurement;
use surefix_core::gnss::{
    Ephemeris, ObservationEpoch, Satellite, Signal, SignalObservation, System,
};
use surefix_core::time::GpsTime;

use super::fifteen_digits;
use super::trajectory::State;
use crate::faults::{FaultCoverage, FaultInjector, FaultSpec};
use crate::simulate::disturbances::{Disturbances, Disturber};
use crate::simulate::noise::normal;
use crate::simulate::orbit::{earth_rate, position_frozen_e};
use crate::simulate::receiver::TRACKING_MASK_DEG;
use crate::simulate::sky::{Sky, Slot, issue_at};

/// A time without most satellites.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outage {
    /// Start, s.
    pub from_s: f64,
    /// End, s; not part of it.
    pub to_s: f64,
    /// How many stay, the first of [`spread`] when the first outage began.
    pub keep: usize,
}

/// One satellite at one epoch.
#[derive(Clone, Debug)]
pub struct Row {
    /// What a filter takes.
    pub measurement: CorrectedMeasurement,
    /// Elevation, rad.
    pub elevation_rad: f64,
    /// Noise of the pseudorange, m, and of the range rate, m/s.
    pub noise: (f64, f64),
    /// Fault on the pseudorange, m, and on the range rate, m/s.
    pub fault: (f64, f64),
    /// Multipath asked for on the code of the first and the second signal, m.
    pub multipath_m: [f64; 2],
    /// Error of the ionosphere asked for, on L1, m.
    pub ionosphere_error_m: f64,
    /// What the satellite broadcasts.
    pub ephemeris: Ephemeris,
}

impl Row {
    /// Puts noise and fault on the measurement and rounds to what scenario files hold.
    fn finish(&mut self) {
        let (noise, fault) = (self.noise, self.fault);
        let m = &mut self.measurement;
        m.r_es_e_m = m.r_es_e_m.map(fifteen_digits);
        m.v_es_e_mps = m.v_es_e_mps.map(fifteen_digits);
        let disturbed_m = m.pseudorange_m + self.multipath_m[0] + self.ionosphere_error_m;
        m.pseudorange_m = fifteen_digits(disturbed_m + noise.0 + fault.0);
        m.sigma_pseudorange_m = fifteen_digits(m.sigma_pseudorange_m);
        m.range_rate_mps = m.range_rate_mps.map(|(rate_mps, sigma_mps)| {
            (
                fifteen_digits(rate_mps + noise.1 + fault.1),
                fifteen_digits(sigma_mps),
            )
        });
        self.elevation_rad = fifteen_digits(self.elevation_rad);
    }
}

/// One epoch.
#[derive(Clone, Debug)]
pub struct Epoch {
    /// Since the start, s.
    pub t_s: f64,
    /// Satellites in view, in order of name.
    pub rows: Vec<Row>,
}

/// One sigma of a pseudorange, m.
pub fn sigma_pseudorange_m(satellite: Satellite, elevation_rad: f64) -> f64 {
    let sigma_0_m = match satellite.system() {
        System::Gps | System::Galileo => 0.54,
        System::Bds if satellite.is_bds_geo() => 1.09,
        System::Bds => 0.74,
    };
    let shell = 6371.0 / (6371.0 + 350.0) * libm::cos(elevation_rad);
    let ionosphere_m = 0.42 / libm::sqrt(1.0 - shell * shell);
    libm::sqrt(
        sigma_0_m * sigma_0_m / libm::sin(elevation_rad)
            + ionosphere_m * ionosphere_m
            + 0.36 * 0.36,
    )
}

/// One sigma of a range rate, m/s.
pub fn sigma_range_rate_mps(elevation_rad: f64) -> f64 {
    0.05 / libm::sqrt(libm::sin(elevation_rad))
}

/// Measures epoch by epoch.
pub struct Measurer {
    slots: Vec<(Slot, ChaCha20Rng)>,
    start: GpsTime,
    noise_free: bool,
    outages: Vec<Outage>,
    /// Who stays longest in the outages.
    ranking: Option<Vec<Satellite>>,
    injector: FaultInjector,
    faults: Vec<FaultSpec>,
    coverage: FaultCoverage,
    disturber: Disturber,
    /// Time of the epoch before, s.
    before_s: Option<f64>,
}

impl Measurer {
    /// GPS and BDS, and Galileo where it is wanted; every satellite has its own stream of random numbers,
    /// so that its noise does not depend on what else is in view.
    pub fn new(
        start: GpsTime,
        seed: u64,
        noise_free: bool,
        galileo: bool,
        outages: &[Outage],
        faults: &[FaultSpec],
        disturbances: &Disturbances,
    ) -> Self {
        let mut slots: Vec<_> = Sky::new()
            .slots()
            .iter()
            .filter(|slot| galileo || slot.satellite.system() != System::Galileo)
            .map(|slot| {
                let mut random = ChaCha20Rng::seed_from_u64(seed);
                random.set_stream(1 + slot.satellite.index() as u64);
                (slot.clone(), random)
            })
            .collect();
        slots.sort_by_key(|(slot, _)| (slot.satellite.system().letter(), slot.satellite.prn()));
        let satellites = slots.iter().map(|(slot, _)| slot.satellite);
        Self {
            disturber: Disturber::new(disturbances, seed, satellites),
            before_s: None,
            slots,
            start,
            noise_free,
            outages: outages.to_vec(),
            ranking: None,
            injector: FaultInjector::new(faults, seed),
            faults: faults.to_vec(),
            coverage: FaultCoverage::new(faults),
        }
    }

    /// The epoch at `t_s`; epochs must come in order of time.
    pub fn measure(&mut self, t_s: f64, truth: &State, clock: (f64, f64)) -> Epoch {
        let time = self.start.plus_ns(libm::round(t_s * 1e9) as i64);
        let scale = if self.noise_free { 0.0 } else { 1.0 };
        let up_e = -truth.c_e_n.column(2);
        // How long the first step is does not matter to processes in their stationary state.
        let step_s = self
            .before_s
            .replace(t_s)
            .map_or(1.0, |before_s| t_s - before_s);
        self.disturber.step(step_s);
        let mut rows = Vec::new();
        for (slot, random) in &mut self.slots {
            let (n_range, n_rate) = (normal(random), normal(random));
            let satellite = slot.satellite;
            let ephemeris = slot.broadcast(issue_at(satellite.system(), time));
            let (r_es_e, v_es_e) = at_transmission(&ephemeris, time, &truth.r_eb_e);
            let line = r_es_e - truth.r_eb_e;
            let range_m = line.norm();
            let elevation_rad = libm::asin(line.dot(&up_e) / range_m);
            if elevation_rad.to_degrees() < TRACKING_MASK_DEG {
                continue;
            }
            let sigma_m = sigma_pseudorange_m(satellite, elevation_rad);
            let sigma_mps = sigma_range_rate_mps(elevation_rad);
            let rate_mps = line.dot(&(v_es_e - truth.v_eb_e)) / range_m;
            rows.push(Row {
                measurement: CorrectedMeasurement {
                    satellite,
                    r_es_e_m: r_es_e.into(),
                    v_es_e_mps: v_es_e.into(),
                    pseudorange_m: range_m + clock.0,
                    sigma_pseudorange_m: sigma_m,
                    range_rate_mps: Some((rate_mps + clock.1, sigma_mps)),
                },
                elevation_rad,
                noise: (scale * sigma_m * n_range, scale * sigma_mps * n_rate),
                fault: (0.0, 0.0),
                multipath_m: self.disturber.multipath_m(satellite).unwrap_or_default(),
                ionosphere_error_m: self.disturber.ionosphere_m(elevation_rad),
                ephemeris,
            });
        }
        self.hide(t_s, &truth.r_eb_e, &mut rows);
        rows.retain(|row| !self.disturber.hides(t_s, row.measurement.satellite));
        self.fail(time, t_s, &mut rows);
        rows.iter_mut().for_each(Row::finish);
        Epoch { t_s, rows }
    }

    /// Takes away what an outage hides.
    fn hide(&mut self, t_s: f64, antenna_e: &Vector3<f64>, rows: &mut Vec<Row>) {
        let outage = self
            .outages
            .iter()
            .find(|o| t_s >= o.from_s && t_s < o.to_s);
        let Some(outage) = outage else {
            return;
        };
        let ranking = self.ranking.get_or_insert_with(|| spread(antenna_e, rows));
        let kept = &ranking[..outage.keep.min(ranking.len())];
        rows.retain(|row| kept.contains(&row.measurement.satellite));
    }

    /// Finds the faults. They go through the injector of recordings on observations of
    /// zero, so that a scenario and its byte stream have the same.
    fn fail(&mut self, time: GpsTime, t_s: f64, rows: &mut [Row]) {
        let mut zeros = ObservationEpoch::EMPTY;
        let mut seen = ObservationEpoch::EMPTY;
        let mut nothing = SignalObservation::new(Signal::C1C);
        nothing.pseudorange_m = Some(0.0);
        nothing.range_rate_mps = Some(0.0);
        zeros.restart(time);
        seen.restart(time);
        for fault in &self.faults {
            // A second fault on a satellite is on the observation of the first.
            let _ = zeros.add(fault.satellite, nothing);
        }
        for row in rows.iter() {
            // Fits: fewer satellites are above the mask than an epoch holds.
            let _ = seen.add(row.measurement.satellite, nothing);
        }
        self.injector.apply(&mut zeros, t_s);
        self.coverage.see(&seen, t_s);
        for observation in &zeros.satellites {
            let faulty = rows
                .iter_mut()
                .find(|row| row.measurement.satellite == observation.satellite);
            if let (Some(row), Some(signal)) = (faulty, observation.signals.first()) {
                row.fault = (
                    signal.pseudorange_m.unwrap_or(0.0),
                    signal.range_rate_mps.unwrap_or(0.0),
                );
            }
        }
    }

    /// After the last epoch.
    ///
    /// # Errors
    /// When a fault touched no epoch, or an outage hid nothing.
    pub fn check(&self) -> Result<()> {
        self.coverage.check()?;
        Ok(self.disturber.check()?)
    }
}

/// Satellites at 20° and higher in an order whose beginnings are spread over the sky: the highest, and
/// then always the one farthest from all before.
pub fn spread(antenna_e: &Vector3<f64>, rows: &[Row]) -> Vec<Satellite> {
    let mut left: Vec<(Satellite, Vector3<f64>, f64)> = rows
        .iter()
        .filter(|row| row.elevation_rad.to_degrees() >= 20.0)
        .map(|row| {
            let line = Vector3::from(row.measurement.r_es_e_m) - antenna_e;
            (
                row.measurement.satellite,
                line.normalize(),
                -row.elevation_rad,
            )
        })
        .collect();
    let mut order = Vec::new();
    // The third number decides: at first minus the elevation, then the cosine to the nearest before.
    while let Some(best) = (0..left.len()).min_by(|a, b| left[*a].2.total_cmp(&left[*b].2)) {
        let (satellite, direction, _) = left.remove(best);
        for other in &mut left {
            let cosine = other.1.dot(&direction);
            other.2 = if order.is_empty() {
                cosine
            } else {
                other.2.max(cosine)
            };
        }
        order.push(satellite);
    }
    order
}

/// Satellite at transmission in the Earth-fixed axes of reception, m, and its velocity over the Earth
/// there, m/s, for a signal through a vacuum.
fn at_transmission(
    ephemeris: &Ephemeris,
    reception: GpsTime,
    antenna_e: &Vector3<f64>,
) -> (Vector3<f64>, Vector3<f64>) {
    let reception_s = reception.seconds_since(ephemeris.toe);
    let mut flight_s = 0.075;
    let mut r_es_e = Vector3::zeros();
    // Each turn gains five digits: the satellite moves 1e-5 of the speed of light.
    for _ in 0..4 {
        r_es_e = position_frozen_e(ephemeris, reception_s - flight_s, reception_s);
        flight_s = (r_es_e - antenna_e).norm() / SPEED_OF_LIGHT_MPS;
    }
    let transmission_s = reception_s - flight_s;
    let fixed = |after_s: f64| {
        let t_s = transmission_s + after_s;
        position_frozen_e(ephemeris, t_s, t_s)
    };
    // Fourth-order difference quotient with steps of 1 s: exact to 1e-8 m/s.
    let v = ((fixed(1.0) - fixed(-1.0)) * 8.0 - (fixed(2.0) - fixed(-2.0))) / 12.0;
    let angle = earth_rate(ephemeris.satellite.system()) * flight_s;
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    let v_es_e = Vector3::new(cos * v.x + sin * v.y, -sin * v.x + cos * v.y, v.z);
    (r_es_e, v_es_e)
}
