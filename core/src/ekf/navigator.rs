//! The tightly coupled navigator: one nominal trajectory and the filter that corrects it.
//!
//! ```text
//! Increment ─► mechanisation ─► process (Φ, Q)          at the rate of the inertial unit
//! epoch ─► predict ─► rows at the nominal ─► update ─► feedback       once per epoch
//! ```
//!
//! The nominal stands at the end of the last sample. An epoch in between is predicted from it by its
//! velocity and acceleration over the fraction of a sample that is missing; the error states are the
//! same there. Equations: `ins/mechanisation.rs`, `process.rs`, `filter.rs`, `update.rs`.

use nalgebra::{Matrix3, Vector3};

use super::filter::{ErrorState, Filter, PredictWorkspace, Unhealthy};
use super::information::{EpochInformation, MeasurementRow};
use super::layout::{
    ACCEL_BIAS, ATTITUDE, BLOCKS, CLOCK_BIAS, CLOCK_DRIFT, GYRO_BIAS, POSITION, VELOCITY,
};
use super::process::{LeverState, ProcessAccumulator};
use super::transition::Transition;
use super::update::{UpdateSummary, UpdateWorkspace};
use crate::consts::OMEGA_EARTH_WGS84_RADPS;
use crate::frames::{geodesy, rotation};
use crate::gnss::CorrectedMeasurement;
use crate::ins::gravity::gravity_gradient_e;
use crate::ins::mechanisation::{Increment, Mechanisation, StartError};
use crate::ins::{InertialConfig, InitialState};
use crate::linalg::block3::{Block, Symmetric, ZERO, add_product, add_symmetric_product};
use crate::time::GpsTime;

/// Where the antenna is, as the nominal has it at some instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AntennaState<const K: usize> {
    /// When.
    pub time: GpsTime,
    /// Position, ECEF, m.
    pub r_e_m: [f64; 3],
    /// Velocity against the Earth, ECEF, m/s.
    pub v_e_mps: [f64; 3],
    /// Rotation from body to ECEF, scalar first and not negative.
    pub q_e_b: [f64; 4],
    /// Clock bias (m), drift (m/s), offsets (m).
    pub clock: [f64; K],
}

/// One nominal trajectory, its process, its filter.
#[derive(Clone, Debug)]
pub struct Navigator<const K: usize, const M: usize> {
    lever_arm_b_m: [f64; 3],
    mechanisation: Mechanisation,
    process: ProcessAccumulator,
    filter: Filter<K, M>,
    clock: [f64; K],
    /// When `clock` holds: the nominal's time at the last epoch.
    clock_time: GpsTime,
    time: GpsTime,
    omega_ib_b: [f64; 3],
    /// Of the last sample, ECEF, m/s².
    acceleration_e: Vector3<f64>,
    information: EpochInformation<M>,
    predict_workspace: PredictWorkspace,
    update_workspace: UpdateWorkspace<K, M>,
}

fn block(m: &Matrix3<f64>) -> Block {
    let mut rows = ZERO;
    for (entry, value) in rows.iter_mut().zip(m.transpose().iter()) {
        *entry = *value;
    }
    rows
}

/// R diag(σ²) Rᵀ.
fn turned_variances(r: &Block, sigma: [f64; 3]) -> Symmetric {
    let [a, b, c] = sigma;
    let mut scaled = ZERO;
    add_product(
        &mut scaled,
        r,
        &[a * a, 0.0, 0.0, 0.0, b * b, 0.0, 0.0, 0.0, c * c],
    );
    let mut turned = [0.0; 6];
    add_symmetric_product(&mut turned, &scaled, r);
    turned
}

/// σ² I.
const fn equal(sigma: f64) -> Symmetric {
    let var = sigma * sigma;
    [var, 0.0, 0.0, var, 0.0, var]
}

impl<const K: usize, const M: usize> Navigator<K, M> {
    /// Not started.
    pub const EMPTY: Self = Self {
        lever_arm_b_m: [0.0; 3],
        mechanisation: Mechanisation::EMPTY,
        process: ProcessAccumulator::EMPTY,
        filter: Filter::EMPTY,
        clock: [0.0; K],
        clock_time: GpsTime::from_ns(0),
        time: GpsTime::from_ns(0),
        omega_ib_b: [0.0; 3],
        acceleration_e: Vector3::new(0.0, 0.0, 0.0),
        information: EpochInformation::ZERO,
        predict_workspace: PredictWorkspace::EMPTY,
        update_workspace: UpdateWorkspace::EMPTY,
    };

    /// Starts from a state of the inertial unit, with the uncertainties of the configuration.
    ///
    /// # Errors
    /// [`StartError`]; the navigator is then as it was.
    pub fn start(
        &mut self,
        config: &InertialConfig,
        state: &InitialState,
    ) -> Result<(), StartError> {
        self.mechanisation.start(state)?;
        self.lever_arm_b_m = config.lever_arm_b_m;
        self.time = state.time;
        self.clock_time = state.time;
        self.clock = [0.0; K];
        for (at, value) in [
            (CLOCK_BIAS, state.clock_bias_m),
            (CLOCK_DRIFT, state.clock_drift_mps),
        ] {
            if let Some(entry) = self.clock.get_mut(at) {
                *entry = value;
            }
        }
        self.omega_ib_b = [0.0; 3];
        self.acceleration_e = Vector3::zeros();
        let sigma = &config.sigma;
        let c_e_n = geodesy::to_llh(&self.mechanisation.r_eb_e).map_or_else(
            |_| Matrix3::identity(),
            |llh| rotation::c_e_n(llh.lat_rad, llh.lon_rad),
        );
        let mut blocks = [[0.0; 6]; BLOCKS];
        let all: [Symmetric; BLOCKS] = [
            equal(sigma.position_m),
            equal(sigma.velocity_mps),
            turned_variances(&block(&c_e_n), sigma.attitude_ned_rad),
            equal(sigma.gyro_bias_radps),
            equal(sigma.accel_bias_mps2),
        ];
        blocks.copy_from_slice(&all);
        let mut clock_var = [0.0; K];
        for (at, value) in [
            (CLOCK_BIAS, sigma.clock_bias_m),
            (CLOCK_DRIFT, sigma.clock_drift_mps),
        ] {
            if let Some(entry) = clock_var.get_mut(at) {
                *entry = value * value;
            }
        }
        self.filter.start(&blocks, &clock_var);
        let lever = self.lever();
        self.process.start(
            &config.noise,
            &config.clock,
            OMEGA_EARTH_WGS84_RADPS,
            &lever,
        );
        self.set_gradient();
        Ok(())
    }

    fn set_gradient(&mut self) {
        self.process
            .set_gradient(&block(&gravity_gradient_e(&self.mechanisation.r_eb_e)));
    }

    fn lever(&self) -> LeverState {
        self.lever_at(&self.mechanisation, self.omega_ib_b)
    }

    fn lever_at(&self, mechanisation: &Mechanisation, omega_ib_b: [f64; 3]) -> LeverState {
        if self.lever_arm_b_m == [0.0; 3] {
            return LeverState::ZERO;
        }
        LeverState::new(
            self.lever_arm_b_m,
            &block(&rotation::to_matrix(&mechanisation.q_e_b)),
            omega_ib_b,
            OMEGA_EARTH_WGS84_RADPS,
        )
    }

    /// Carries the nominal over one sample, which ends at `time`.
    #[inline(never)]
    pub fn step(&mut self, increment: &Increment, time: GpsTime) {
        let before = self.mechanisation.v_eb_e;
        let step = self.mechanisation.step(increment);
        if !(increment.dt_s > 0.0) {
            return;
        }
        self.acceleration_e = (self.mechanisation.v_eb_e - before) / increment.dt_s;
        self.omega_ib_b = step.omega_ib_b.into();
        self.time = time;
        self.process
            .add(increment.dt_s, step.dv_e.into(), &block(&step.c_e_b));
    }

    /// Notes that samples were missing: the nominal is less certain by this much, one sigma per axis.
    /// All filters that share the transition of this epoch are.
    pub fn add_uncertainty(&mut self, attitude_rad: f64, velocity_mps: f64) {
        self.process.add_noise(ATTITUDE, &equal(attitude_rad));
        self.process.add_noise(VELOCITY, &equal(velocity_mps));
    }

    /// Notes that the nominal is found to be wrong: its antenna is less certain by this much, one sigma per
    /// axis, from the next epoch on.
    pub fn widen(&mut self, position_m: f64, velocity_mps: f64) {
        self.process.add_noise(POSITION, &equal(position_m));
        self.process.add_noise(VELOCITY, &equal(velocity_mps));
    }

    /// All times so far were wrong by this much, ns, as when the week becomes known.
    pub fn shift(&mut self, by_ns: i64) {
        self.time = self.time.plus_ns(by_ns);
        self.clock_time = self.clock_time.plus_ns(by_ns);
    }

    /// When the nominal stands.
    pub const fn time(&self) -> GpsTime {
        self.time
    }

    /// The antenna at `time`, from the nominal by its velocity and acceleration; for times within a
    /// few samples of it.
    pub fn antenna(&self, time: GpsTime) -> AntennaState<K> {
        let dt = time.seconds_since(self.time);
        let lever = self.lever();
        let v = self.mechanisation.v_eb_e + Vector3::from(lever.arm_rate_e_mps);
        let r = self.mechanisation.r_eb_e
            + Vector3::from(lever.arm_e_m)
            + (v + self.acceleration_e * (0.5 * dt)) * dt;
        AntennaState {
            time,
            r_e_m: r.into(),
            v_e_mps: (v + self.acceleration_e * dt).into(),
            q_e_b: rotation::with_positive_scalar(&self.mechanisation.q_e_b),
            clock: self.clock_at(time),
        }
    }

    /// The antenna after these increments, each with its end, which follow those that the nominal was
    /// carried over. The nominal stays where it is.
    pub fn carried_over<'a>(
        &self,
        increments: impl Iterator<Item = (&'a Increment, GpsTime)>,
    ) -> AntennaState<K> {
        let mut mechanisation = self.mechanisation;
        let (mut time, mut omega_ib_b) = (self.time, self.omega_ib_b);
        for (increment, end) in increments {
            let step = mechanisation.step(increment);
            if increment.dt_s > 0.0 {
                omega_ib_b = step.omega_ib_b.into();
                time = end;
            }
        }
        let lever = self.lever_at(&mechanisation, omega_ib_b);
        AntennaState {
            time,
            r_e_m: (mechanisation.r_eb_e + Vector3::from(lever.arm_e_m)).into(),
            v_e_mps: (mechanisation.v_eb_e + Vector3::from(lever.arm_rate_e_mps)).into(),
            q_e_b: rotation::with_positive_scalar(&mechanisation.q_e_b),
            clock: self.clock_at(time),
        }
    }

    /// The clock states at a time near the nominal's: the bias by its drift.
    fn clock_at(&self, time: GpsTime) -> [f64; K] {
        let mut clock = self.clock;
        let drift = clock.get(CLOCK_DRIFT).copied().unwrap_or(0.0);
        if let Some(bias) = clock.get_mut(CLOCK_BIAS) {
            *bias += drift * time.seconds_since(self.clock_time);
        }
        clock
    }

    /// First half of an epoch: the filter and the clocks come to the time of the nominal. Gives the
    /// antenna at the epoch's time, where its rows are to be linearised.
    #[inline(never)]
    pub fn predict(&mut self, time: GpsTime) -> AntennaState<K> {
        let lever = self.lever();
        let transition = self.process.finish(&lever);
        self.filter.predict(transition, &mut self.predict_workspace);
        let clock = transition.clock;
        if let [bias, drift, ..] = self.clock.as_mut_slice() {
            *bias += clock.bias_per_drift_s * *drift;
            *drift *= clock.decay;
        }
        self.clock_time = self.time;
        self.information.clear();
        self.antenna(time)
    }

    /// What the last [`Navigator::predict`] carried the filter over, until the epoch is finished.
    pub const fn transition(&self) -> &Transition {
        self.process.transition()
    }

    /// Adds a satellite to the epoch, linearised at `at`; `offset` is the clock column of its
    /// constellation. False when no row comes of it.
    pub fn add(
        &mut self,
        measurement: &CorrectedMeasurement,
        at: &AntennaState<K>,
        offset: Option<usize>,
    ) -> bool {
        let row: Option<MeasurementRow<M>> =
            MeasurementRow::new(measurement, at.r_e_m, at.v_e_mps, &at.clock, offset);
        if let Some(row) = &row {
            self.information.add_row(row);
        }
        row.is_some()
    }

    /// Second half of an epoch: the filter takes the satellites added, and the nominal is corrected.
    ///
    /// # Errors
    /// [`Unhealthy`]: the navigator must be started again.
    #[inline(never)]
    pub fn update(&mut self) -> Result<UpdateSummary, Unhealthy> {
        let summary = self.update_filter();
        self.finish()?;
        Ok(summary)
    }

    /// The first part of [`Navigator::update`]: the filter takes the satellites added. A bank tests its
    /// other filters against it before [`Navigator::finish`].
    pub fn update_filter(&mut self) -> UpdateSummary {
        self.filter
            .update(&self.information, &mut self.update_workspace)
    }

    /// The second part: the nominal is corrected by the filter's state. Gives the correction, which every
    /// other filter is to be re-referenced by.
    ///
    /// # Errors
    /// [`Unhealthy`]: the navigator must be started again.
    pub fn finish(&mut self) -> Result<ErrorState<K>, Unhealthy> {
        self.filter.check()?;
        let correction = *self.filter.state();
        self.correct(&correction);
        self.filter.rereference(&correction);
        self.process.begin();
        self.set_gradient();
        Ok(correction)
    }

    /// What the epoch says, to be filled by a bank in place of [`Navigator::add`].
    pub const fn information_mut(&mut self) -> &mut EpochInformation<M> {
        &mut self.information
    }

    /// Copies the filter to where a bank works on it: `main`, for the time between
    /// [`Navigator::predict`] and [`Navigator::take_back`].
    pub fn lend(&self, main: &mut Filter<K, M>) {
        main.clone_from(&self.filter);
    }

    /// [`Navigator::update_filter`] of the filter that was lent.
    pub fn update_lent(&mut self, main: &mut Filter<K, M>) -> UpdateSummary {
        main.update(&self.information, &mut self.update_workspace)
    }

    /// The filter comes back from where it was lent to, or another in its place after an exclusion.
    pub fn take_back(&mut self, main: &Filter<K, M>) {
        self.filter.clone_from(main);
    }

    fn correct(&mut self, correction: &ErrorState<K>) {
        let unit = self.process.lever().error_of_unit(correction);
        let [dr, dv, psi, gyro, accel] = unit.navigation.map(Vector3::from);
        self.mechanisation.correct(&dr, &dv, &psi, &gyro, &accel);
        for (entry, by) in self.clock.iter_mut().zip(&correction.clock) {
            *entry -= by;
        }
    }

    /// The receiver clock jumped by `jump_m`: the nominal with it, and no filter notices. Where the
    /// size is not known exactly, `sigma_m` says how well.
    pub fn jump_clock(&mut self, jump_m: f64, sigma_m: f64) {
        if let Some(bias) = self.clock.get_mut(CLOCK_BIAS) {
            *bias += jump_m;
        }
        self.filter.widen_clock(CLOCK_BIAS, sigma_m * sigma_m);
    }

    /// Begins a clock state anew, as for a constellation that appears.
    pub fn reset_clock(&mut self, clock: usize, value: f64, sigma: f64) {
        if let Some(entry) = self.clock.get_mut(clock) {
            *entry = value;
            self.filter.reset_clock(clock, sigma * sigma);
        }
    }

    /// The filter.
    pub const fn filter(&self) -> &Filter<K, M> {
        &self.filter
    }

    /// The nominal of the inertial unit.
    pub const fn mechanisation(&self) -> &Mechanisation {
        &self.mechanisation
    }
}

const _: () = assert!(GYRO_BIAS == 3 && ACCEL_BIAS == 4);
