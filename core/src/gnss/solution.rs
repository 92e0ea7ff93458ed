//! Position, clocks and velocity from one epoch by weighted least squares.
//!
//! In: an epoch, the ephemerides, the broadcast ionosphere, the configuration; then, as often as
//! asked, a set of satellites to leave out. Out: a [`SnapshotSolution`] and the linearised epoch at it.
//!
//! ```text
//! prepare()  satellite states, clocks, signals: once per epoch
//! solve()    [cold start, no atmosphere, all weights equal] ─► `sky.rs`: directions, atmosphere, mask, sigmas
//!            ─► Newton ─► moved far? directions again ─► velocity, linear model
//! ```
//!
//! | symbol | code                  | shape | unit | frame | meaning                               |
//! |--------|-----------------------|-------|------|-------|---------------------------------------|
//! | u      | line_of_sight_e       | 3     | 1    | e     | receiver to satellite                 |
//! | y      | residual_m            | n     | m    |       | measured − predicted, clocks left in  |
//! | w      | weight                | n     | 1/m² |       | 1 / independent sigma²                |
//! | b_k    | clock_m               | ≤ 3   | m    |       | receiver clock against each system    |
//!
//! Equations: y = −u·δr + b_k + error, Newton's iteration over `normals.rs`; velocity from the same
//! directions with range rates: `rates.rs`. Sagnac and transmission times: `measurement.rs`.
//! Weights hold the independent part of each error only (`weights.rs`); the common ionosphere is
//! handed on beside the model for whoever bounds the position.

use heapless::Vec;
use nalgebra::{Matrix3, Vector3};

use super::measurement::{Measurement, measure, range_geometry, rotated, satellite_range_rate};
use super::normals::{Estimate, Normals};
use super::sky::{Models, Sky};
use super::weights::{RowSigma, range_rate_sigma_mps};
use super::{
    BroadcastIonosphere, CorrectedEpoch, CorrectedMeasurement, EphemerisStore, ObservationEpoch,
    Satellite, SatelliteSet, System,
};
use crate::config::{Config, IonosphereModel};
use crate::consts::{MAX_CLOCKS, MAX_SATELLITES, MAX_UNKNOWNS};
use crate::frames::geodesy;
use crate::linalg::LinearModel;
use crate::time::GpsTime;

mod height;
mod rates;

pub use height::HeightRow;
pub use rates::{RangeRates, RateFit};

pub use super::measurement::{SATELLITE_REASONS, SatelliteReason};

/// Newton steps from the centre of the Earth: five to seven bring any place on it within a metre;
/// twelve leave room for bad geometry, and what has not settled by then circles.
const MAX_STEPS: usize = 12;
/// How often directions and atmosphere are computed anew because the position moved: once after a
/// cold start, once more to confirm; a fault of kilometres takes one more.
const MAX_ROUNDS: usize = 5;
/// A cold start has done its work when a step is this short, m.
const COLD_STEP_M: f64 = 10.0;
/// The position has settled when a step is this short, m; the error left is its square over the range.
const FINAL_STEP_M: f64 = 1.0e-3;
/// Farther than this from where the atmosphere was computed it is computed again, m. A quarter of a metre
/// of height is less than 0.1 mm of zenith delay and half a millimetre of position.
const SAME_PLACE_M: f64 = 0.25;
/// Heights above the ellipsoid a user of this monitor can be at, m: below the lowest land, to where
/// air begins.
const PLAUSIBLE_HEIGHT_M: core::ops::RangeInclusive<f64> = -10_000.0..=100_000.0;

/// Why there is no position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SnapshotError {
    /// Fewer satellites than unknowns.
    TooFewSatellites {
        /// Satellites that can be used.
        satellites: u8,
        /// Unknowns: three and one per constellation.
        unknowns: u8,
    },
    /// The directions leave one undetermined.
    BadGeometry,
    /// The iteration did not settle.
    NoConvergence,
    /// The position lies deep in the Earth or far outside it.
    ImplausiblePosition,
}

/// The solution of one epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SnapshotSolution {
    /// Position, ECEF, m.
    pub r_e_m: [f64; 3],
    /// The same in geodetic coordinates.
    pub llh: geodesy::Llh,
    /// Receiver clock minus each system's time, m, in the order of [`System::ALL`].
    pub clock_m: [Option<f64>; MAX_CLOCKS],
    /// Velocity east, north, up, m/s; `None` with fewer than four range rates.
    pub velocity_enu_mps: Option<[f64; 3]>,
    /// Receiver clock drift, m/s; `None` with fewer than four range rates.
    pub clock_drift_mps: Option<f64>,
    /// How well the range rates agree; `None` with fewer than five.
    pub rate_fit: Option<RateFit>,
    /// Satellites in it.
    pub used: SatelliteSet,
    /// Satellites observed.
    pub n_observed: u8,
    /// Satellites observed and not used, in the order of [`SatelliteReason`].
    pub unused: [u8; SATELLITE_REASONS],
    /// Klobuchar was asked for and no parameters were received: no correction, larger sigma.
    pub no_broadcast_ionosphere: bool,
    /// Newton steps taken, over all rounds.
    pub steps: u8,
}

/// A satellite of the linear model, beside its row there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UsedRow {
    /// Which satellite.
    pub satellite: Satellite,
    /// Above the horizon, rad.
    pub elevation_rad: f64,
    /// From north to east, rad.
    pub azimuth_rad: f64,
    /// One sigma of its pseudorange; the independent part is also in the model.
    pub sigma: RowSigma,
}

/// Whether a row takes part, and why not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum RowState {
    Used,
    Unused(SatelliteReason),
}

/// A satellite with a measurement.
#[derive(Clone, Copy, Debug)]
struct Row {
    measurement: Measurement,
    state: RowState,
    /// As seen from `SnapshotWorkspace::sky_at`.
    sky: Sky,
    /// From the last Newton step.
    line_of_sight_e: [f64; 3],
    residual_m: f64,
}

impl Row {
    fn described(&self) -> UsedRow {
        UsedRow {
            satellite: self.measurement.satellite,
            elevation_rad: self.sky.elevation_rad,
            azimuth_rad: self.sky.azimuth_rad,
            sigma: self.sky.sigma,
        }
    }
}

/// Everything between an epoch and its solutions. Large: keep it in a `static`.
pub struct SnapshotWorkspace {
    time: GpsTime,
    models: Models,
    rows: Vec<Row, MAX_SATELLITES>,
    n_observed: u8,
    /// Counts of what did not become a row.
    unused: [u8; SATELLITE_REASONS],
    /// What did not become a row, and why.
    refused: Vec<(Satellite, SatelliteReason), MAX_SATELLITES>,
    /// Where `Row::sky` was computed.
    sky_at: Option<[f64; 3]>,
    model: LinearModel,
    /// A height of the antenna from elsewhere.
    height: Option<HeightRow>,
    /// Whether it takes part in the solution.
    uses_height: bool,
}

fn length_m(r: Vector3<f64>) -> f64 {
    libm::sqrt(r.x * r.x + r.y * r.y + r.z * r.z)
}

fn distance_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    length_m(Vector3::from(a) - Vector3::from(b))
}

fn count(counts: &mut [u8; SATELLITE_REASONS], reason: SatelliteReason) {
    if let Some(count) = counts.get_mut(reason as usize) {
        *count = count.saturating_add(1);
    }
}

impl SnapshotWorkspace {
    /// No epoch.
    pub const EMPTY: Self = Self {
        time: GpsTime::from_ns(0),
        models: Models::NONE,
        rows: Vec::new(),
        n_observed: 0,
        unused: [0; SATELLITE_REASONS],
        refused: Vec::new(),
        sky_at: None,
        model: LinearModel::EMPTY,
        height: None,
        uses_height: false,
    };

    /// Takes in an epoch: chooses signals and ephemerides and computes every satellite once.
    #[inline(never)]
    pub fn prepare(
        &mut self,
        epoch: &ObservationEpoch,
        store: &EphemerisStore,
        ionosphere: &BroadcastIonosphere,
        config: &Config,
    ) {
        self.time = epoch.time;
        self.models = Models::new(config, ionosphere);
        self.rows.clear();
        self.n_observed = 0;
        self.unused = [0; SATELLITE_REASONS];
        self.refused.clear();
        self.sky_at = None;
        self.model.n = 0;
        self.model.m = 0;
        self.uses_height = false;
        let ionosphere_free = config.ionosphere == IonosphereModel::IonosphereFree;
        for observation in &epoch.satellites {
            self.n_observed = self.n_observed.saturating_add(1);
            if !config.systems.contains(observation.satellite.system()) {
                self.refuse(observation.satellite, SatelliteReason::SystemNotSelected);
                continue;
            }
            match measure(observation, epoch.time, store, ionosphere_free) {
                Ok(measurement) => {
                    // As many rows as satellites in an epoch, so it fits.
                    let _ = self.rows.push(Row {
                        measurement,
                        state: RowState::Unused(SatelliteReason::BelowMask),
                        sky: Sky::UNSEEN,
                        line_of_sight_e: [0.0; 3],
                        residual_m: 0.0,
                    });
                }
                Err(reason) => self.refuse(observation.satellite, reason),
            }
        }
    }

    fn refuse(&mut self, satellite: Satellite, reason: SatelliteReason) {
        count(&mut self.unused, reason);
        // As many as satellites in an epoch, so it fits.
        let _ = self.refused.push((satellite, reason));
    }

    /// Solves the epoch without the satellites in `excluded`, from `start` if given, else from the
    /// centre of the Earth. Called again with other satellites it computes no satellite anew, and
    /// directions only when the position moves.
    ///
    /// # Errors
    /// [`SnapshotError`]; the model then has no rows.
    #[inline(never)]
    pub fn solve(
        &mut self,
        excluded: SatelliteSet,
        start: Option<[f64; 3]>,
    ) -> Result<SnapshotSolution, SnapshotError> {
        self.model.n = 0;
        self.model.m = 0;
        if let Some(start) = start
            && let Ok(solution) = self.solve_from(excluded, start, 0)
        {
            return Ok(solution);
        }
        let mut r_e = [0.0; 3];
        self.sky_at = None;
        for row in &mut self.rows {
            row.sky = Sky::UNSEEN;
        }
        self.choose(excluded, false)?;
        let steps = self.newton(&mut r_e, COLD_STEP_M)?.steps;
        self.solve_from(excluded, r_e, steps)
    }

    /// Satellites of the epoch.
    pub const fn n_observed(&self) -> u8 {
        self.n_observed
    }

    /// Satellites that gave no row, in the order of [`SatelliteReason`]; a solution counts those it
    /// left out besides.
    pub const fn unused(&self) -> [u8; SATELLITE_REASONS] {
        self.unused
    }

    /// The linearised epoch of the last solution, in the order of [`SnapshotWorkspace::used_rows`].
    ///
    /// Its residuals are taken at the solution with the clocks out, so that a least-squares estimate
    /// from it is zero up to rounding.
    pub fn model(&self) -> &LinearModel {
        &self.model
    }

    /// The satellites of the linear model.
    pub fn used_rows(&self) -> impl Iterator<Item = UsedRow> + '_ {
        self.used().map(Row::described)
    }

    /// The satellites above the mask as a filter takes them, seen from an antenna whose position and
    /// velocity (ECEF) are known well; those in `excluded` are left out. The range rate's denominator
    /// (`measurement.rs`) is taken out with the velocity given. Sigmas are those of the whole error.
    ///
    /// # Errors
    /// [`SnapshotError::ImplausiblePosition`]; `out` is then empty.
    #[inline(never)]
    pub fn corrected(
        &mut self,
        r_e: [f64; 3],
        v_e: [f64; 3],
        excluded: SatelliteSet,
        out: &mut CorrectedEpoch,
    ) -> Result<(), SnapshotError> {
        out.time = self.time;
        out.rows.clear();
        self.look_from(r_e)?;
        for row in &self.rows {
            let measurement = &row.measurement;
            if excluded.contains(measurement.satellite) || !row.sky.above_mask {
                continue;
            }
            let geometry = range_geometry(measurement.r_e_m, r_e);
            let u = Vector3::from(geometry.line_of_sight_e);
            let v_es_e = rotated(geometry.angle, measurement.v_e_mps);
            let approaching = u.dot(&(Vector3::from(v_es_e) - Vector3::from(v_e)));
            let (_, factor) = satellite_range_rate(measurement, &geometry);
            let range_rate_mps = measurement.range_rate_mps.map(|rate_mps| {
                (
                    rate_mps + measurement.clock_drift_mps - (factor - 1.0) * approaching,
                    range_rate_sigma_mps(row.sky.sin_elevation),
                )
            });
            // As many rows as satellites in an epoch, so it fits.
            let _ = out.rows.push(CorrectedMeasurement {
                satellite: measurement.satellite,
                r_es_e_m: (Vector3::from(r_e) + u * geometry.range_m).into(),
                v_es_e_mps: v_es_e,
                pseudorange_m: measurement.pseudorange_m + measurement.clock_m - row.sky.delay_m,
                sigma_pseudorange_m: row.sky.sigma.total_m(),
                range_rate_mps,
            });
        }
        Ok(())
    }

    /// One sigma of a satellite's pseudorange, as of the last place looked from.
    pub fn sigma(&self, satellite: Satellite) -> Option<RowSigma> {
        self.row(satellite).map(|row| row.sky.sigma)
    }

    fn row(&self, satellite: Satellite) -> Option<&Row> {
        self.rows
            .iter()
            .find(|row| row.measurement.satellite == satellite)
    }

    /// Why a satellite of the epoch is not in the last solution; `None` where it is, or would be if there
    /// were one.
    pub fn why_left_out(&self, satellite: Satellite) -> Option<SatelliteReason> {
        match self.row(satellite).map(|row| row.state) {
            Some(RowState::Used) => None,
            Some(RowState::Unused(reason)) => Some(reason),
            None => self
                .refused
                .iter()
                .find(|(refused, _)| *refused == satellite)
                .map(|(_, reason)| *reason),
        }
    }

    /// Whether a satellite was not observed, or stands below the mask as seen from the last place looked from.
    pub fn is_out_of_view(&self, satellite: Satellite) -> bool {
        match self.row(satellite) {
            Some(row) => self.sky_at.is_some() && !row.sky.above_mask,
            None => true,
        }
    }

    /// Azimuth from north to east and elevation of a satellite, as of the last place looked from, rad.
    pub fn direction_rad(&self, satellite: Satellite) -> Option<[f64; 2]> {
        self.sky_at?;
        self.row(satellite)
            .map(|row| [row.sky.azimuth_rad, row.sky.elevation_rad])
    }

    /// Measured minus predicted pseudorange of a satellite at a position (ECEF), the receiver clock left
    /// in, m; delays are those of the last place looked from.
    pub fn range_residual_m(&self, satellite: Satellite, r_e_m: [f64; 3]) -> Option<f64> {
        self.sky_at?;
        let row = self.row(satellite)?;
        let measurement = &row.measurement;
        let range_m = range_geometry(measurement.r_e_m, r_e_m).range_m;
        Some(measurement.pseudorange_m + measurement.clock_m - row.sky.delay_m - range_m)
    }

    /// C/N0 of the signal that a satellite's pseudorange is of, the first of two, dB-Hz.
    pub fn cn0_dbhz(&self, satellite: Satellite) -> Option<f32> {
        self.row(satellite)?.measurement.cn0_dbhz
    }

    /// A satellite above the mask that a solution of this epoch left out, as a row of its linear model: the
    /// derivatives, measured minus predicted, m, and the sigma. `None` where the solution has no clock of its
    /// constellation.
    pub fn row_left_out(
        &self,
        satellite: Satellite,
        solution: &SnapshotSolution,
    ) -> Option<([f64; MAX_UNKNOWNS], f64, RowSigma)> {
        let row = self
            .rows
            .iter()
            .find(|row| row.measurement.satellite == satellite && row.sky.above_mask)?;
        let system = satellite.system().index();
        let clock_m = solution.clock_m.get(system).copied().flatten()?;
        let earlier = solution.clock_m.iter().take(system).flatten().count();
        let measurement = &row.measurement;
        let geometry = range_geometry(measurement.r_e_m, solution.r_e_m);
        let c_enu_e = geodesy::c_enu_e(solution.llh.lat_rad, solution.llh.lon_rad);
        let u_enu = c_enu_e * Vector3::from(geometry.line_of_sight_e);
        let mut design = [0.0; MAX_UNKNOWNS];
        for (entry, u) in design.iter_mut().zip(u_enu.iter()) {
            *entry = -u;
        }
        *design.get_mut(earlier.saturating_add(3))? = 1.0;
        let residual_m = measurement.pseudorange_m + measurement.clock_m
            - row.sky.delay_m
            - geometry.range_m
            - clock_m;
        Some((design, residual_m, row.sky.sigma))
    }

    fn used(&self) -> impl Iterator<Item = &Row> {
        self.rows.iter().filter(|row| row.state == RowState::Used)
    }

    fn solve_from(
        &mut self,
        excluded: SatelliteSet,
        start: [f64; 3],
        steps_before: u8,
    ) -> Result<SnapshotSolution, SnapshotError> {
        let mut r_e = start;
        let mut steps = steps_before;
        for _ in 0..MAX_ROUNDS {
            self.look_from(r_e)?;
            self.choose(excluded, true)?;
            let settled = self.newton(&mut r_e, FINAL_STEP_M)?;
            steps = steps.saturating_add(settled.steps);
            if self
                .sky_at
                .is_some_and(|sky_at| distance_m(sky_at, r_e) < SAME_PLACE_M)
            {
                return self.finish(r_e, &settled, steps);
            }
        }
        Err(SnapshotError::NoConvergence)
    }

    /// Computes directions, delays and sigmas of every row as seen from a place, unless they were
    /// computed near enough.
    #[inline(never)]
    fn look_from(&mut self, r_e: [f64; 3]) -> Result<(), SnapshotError> {
        if self
            .sky_at
            .is_some_and(|sky_at| distance_m(sky_at, r_e) < SAME_PLACE_M)
        {
            return Ok(());
        }
        let place = self.models.place(r_e, plausible(r_e)?);
        for row in &mut self.rows {
            row.sky = self.models.sky(self.time, &row.measurement, &place);
        }
        self.sky_at = Some(r_e);
        Ok(())
    }

    /// Decides which rows take part, and whether they are enough.
    fn choose(&mut self, excluded: SatelliteSet, masked: bool) -> Result<(), SnapshotError> {
        let mut in_system = [0_u8; System::ALL.len()];
        for row in &mut self.rows {
            let satellite = row.measurement.satellite;
            row.state = if excluded.contains(satellite) {
                RowState::Unused(SatelliteReason::FaultExcluded)
            } else if masked && !row.sky.above_mask {
                RowState::Unused(SatelliteReason::BelowMask)
            } else {
                if let Some(count) = in_system.get_mut(satellite.system().index()) {
                    *count += 1;
                }
                RowState::Used
            };
        }
        for row in &mut self.rows {
            let system = row.measurement.satellite.system().index();
            if row.state == RowState::Used && in_system.get(system).copied() == Some(1) {
                row.state = RowState::Unused(SatelliteReason::AloneInSystem);
            }
        }
        let (mut satellites, mut unknowns) = (0, 3);
        for count in in_system {
            if count > 1 {
                satellites += count;
                unknowns += 1;
            }
        }
        self.choose_height(masked, satellites, unknowns);
        if satellites + u8::from(self.uses_height) < unknowns || satellites == 0 {
            return Err(SnapshotError::TooFewSatellites {
                satellites,
                unknowns,
            });
        }
        Ok(())
    }

    /// Newton's iteration from `r_e` with the rows chosen, until a step is shorter than `enough_m`.
    #[inline(never)]
    fn newton(&mut self, r_e: &mut [f64; 3], enough_m: f64) -> Result<Settled, SnapshotError> {
        for step in 1..=MAX_STEPS {
            let mut normals = Normals::ZERO;
            for row in &mut self.rows {
                if row.state != RowState::Used {
                    continue;
                }
                let measurement = &row.measurement;
                let geometry = range_geometry(measurement.r_e_m, *r_e);
                row.line_of_sight_e = geometry.line_of_sight_e;
                row.residual_m = measurement.pseudorange_m + measurement.clock_m
                    - row.sky.delay_m
                    - geometry.range_m;
                let sigma_m = row.sky.sigma.independent_m;
                normals.add(
                    row.line_of_sight_e,
                    measurement.satellite.system().index(),
                    row.residual_m,
                    1.0 / (sigma_m * sigma_m),
                );
            }
            self.add_height(&mut normals, *r_e);
            let estimate = normals.solve().ok_or(SnapshotError::BadGeometry)?;
            for (coordinate, change) in r_e.iter_mut().zip(estimate.position) {
                *coordinate += change;
            }
            if length_m(Vector3::from(estimate.position)) < enough_m {
                return Ok(Settled {
                    last: estimate,
                    steps: step as u8,
                });
            }
        }
        Err(SnapshotError::NoConvergence)
    }

    #[inline(never)]
    fn finish(
        &mut self,
        r_e: [f64; 3],
        settled: &Settled,
        steps: u8,
    ) -> Result<SnapshotSolution, SnapshotError> {
        let llh = plausible(r_e)?;
        let c_enu_e = geodesy::c_enu_e(llh.lat_rad, llh.lon_rad);
        let mut used = SatelliteSet::EMPTY;
        let mut unused = self.unused;
        for row in &self.rows {
            match row.state {
                RowState::Used => used.insert(row.measurement.satellite),
                RowState::Unused(reason) => count(&mut unused, reason),
            }
        }
        self.write_model(&c_enu_e, &settled.last);
        self.write_height(llh.height_m);
        let velocity = self.velocity();
        Ok(SnapshotSolution {
            r_e_m: r_e,
            llh,
            clock_m: settled.last.clocks,
            velocity_enu_mps: velocity.as_ref().map(|v| (c_enu_e * v.v_e_mps).into()),
            clock_drift_mps: velocity.as_ref().map(|v| v.clock_drift_mps),
            rate_fit: velocity.and_then(|v| v.fit),
            used,
            n_observed: self.n_observed,
            unused,
            no_broadcast_ionosphere: self.models.no_broadcast_ionosphere(),
            steps,
        })
    }

    /// Rows of the linear model in east, north, up, clocks numbered among those present.
    fn write_model(&mut self, c_enu_e: &Matrix3<f64>, last: &Estimate) {
        let mut columns = [None; MAX_CLOCKS];
        let mut m = 3;
        for (column, clock_m) in columns.iter_mut().zip(last.clocks) {
            if let Some(clock_m) = clock_m {
                *column = Some((m, clock_m));
                m += 1;
            }
        }
        let step = Vector3::from(last.position);
        let model = &mut self.model;
        let rows = self.rows.iter().filter(|row| row.state == RowState::Used);
        let places = model
            .design
            .iter_mut()
            .zip(&mut model.residual_m)
            .zip(&mut model.sigma_m);
        let mut n = 0;
        for (row, ((design, residual_m), sigma_m)) in rows.zip(places) {
            let system = row.measurement.satellite.system().index();
            let Some((clock_column, clock_m)) = columns.get(system).copied().flatten() else {
                continue;
            };
            let u_e = Vector3::from(row.line_of_sight_e);
            let u_enu = c_enu_e * u_e;
            *design = [0.0; MAX_UNKNOWNS];
            for (entry, u) in design.iter_mut().zip(u_enu.iter()) {
                *entry = -u;
            }
            if let Some(entry) = design.get_mut(clock_column) {
                *entry = 1.0;
            }
            let [ux, uy, uz] = row.line_of_sight_e;
            *residual_m = row.residual_m + (ux * step.x + uy * step.y + uz * step.z) - clock_m;
            *sigma_m = row.sky.sigma.independent_m;
            n += 1;
        }
        model.n = n;
        model.m = m;
    }
}

/// A finished iteration: its last step, with the clocks, and how many it took.
struct Settled {
    last: Estimate,
    steps: u8,
}

/// Geodetic coordinates of a place a user can be at.
fn plausible(r_e: [f64; 3]) -> Result<geodesy::Llh, SnapshotError> {
    geodesy::to_llh(&Vector3::from(r_e))
        .ok()
        .filter(|llh| PLAUSIBLE_HEIGHT_M.contains(&llh.height_m))
        .ok_or(SnapshotError::ImplausiblePosition)
}
