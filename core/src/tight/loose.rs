//! The loosely coupled filter: a receiver's own position and velocity in place of pseudoranges.
//!
//! In: a receiver fix, the nominal at its time. Out: three rows of position and three of velocity for the
//! same filter, along east, north, up, or a refusal of the fix. Nominal, states, process, lever arm, start
//! and coasting are those of tight mode; the clocks have no measurement and are left out of it.
//!
//! | symbol | code               | unit   | meaning                                              |
//! |--------|--------------------|--------|------------------------------------------------------|
//! | σ      | `position_m`       | m      | receiver's own accuracy per axis, times the factor of the configuration |
//! | τ      | `correlation_s`    | s      | how long its error lasts, by what the fix is made of |
//! | ρ      | `rho`              | 1      | exp(−Δt/τ), of errors of fixes Δt apart              |
//! | R      | `Row::sigma`²      | m², m²/s² | variance that the filter takes                    |
//! | ν      | `innovation`       | m, m/s | predicted − measured                                 |
//!
//! Loosely coupled integration with lever arm: [GROVES-2013] chapter 14. Departures, derived in
//! docs/decisions/018-loosely-coupled.md: R = σ² (1 + ρ)/(1 − ρ) for positions, as errors that last are no
//! white noise; for velocities half of what the nominal changed since the last fix is added to the sigma, as a
//! receiver's velocity may be that of the instant or the mean since its last epoch.
//! Assumes: accuracies positive and finite, which `ingest` sees to.

use nalgebra::Vector3;

use super::solution::symmetric;
use super::{CLOCKS, JOINT, LEVEL_SIGMAS, TestedSolution, TightMonitor, TightSolution};
use crate::ekf::MeasurementRow;
use crate::ekf::layout::{JOINT_NAVIGATION, POSITION, VELOCITY};
use crate::ekf::navigator::AntennaState;
use crate::frames::geodesy;
use crate::gnss::solution::{SATELLITE_REASONS, SnapshotSolution};
use crate::gnss::{FixQuality, FixSolution, FixVelocity, ReceiverFix, SatelliteSet, System};
use crate::integrity::InertialStatus;
use crate::time::GpsTime;

/// An innovation beyond so many of its sigmas is an outlier. There is no redundancy in a fix to test it with;
/// this keeps out what no receiver means, and nothing finer.
const GATE_SIGMAS: f64 = 6.0;
/// Fixes refused in a row after which the filter is taken for wrong, not the receiver, and made as uncertain
/// as the two differ.
const MAX_REFUSED: u8 = 3;
/// So often without [`SETTLED`] fixes taken in a row between, and the filter is started anew.
const MAX_RESETS: u8 = 3;
/// Fixes taken in a row after which a reset is forgotten.
const SETTLED: u8 = 20;
/// One sigma of a clock state without a measurement, m, m/s: any, so that it stays a number for ever.
const UNUSED_CLOCK_SIGMA: f64 = 1.0;

/// Where the velocity begins in the joint block of a measurement.
const VELOCITY_AT: usize = JOINT_NAVIGATION / 2;

/// How long errors of a fix last, s: carrier phase multipath, ambiguities not fixed, code multipath and
/// atmosphere.
const fn correlation_s(quality: FixQuality) -> f64 {
    match quality {
        FixQuality::Fixed => 1.0,
        FixQuality::Float => 10.0,
        FixQuality::Differential | FixQuality::Code => 30.0,
    }
}

/// By how much more one sigma of a position is to be taken, `since_s` after the last one: errors that last are
/// averaged by that much slower. 1 for the first.
fn lasting(quality: FixQuality, since_s: Option<f64>) -> f64 {
    let rho = since_s
        .filter(|since_s| *since_s > 0.0)
        .map_or(0.0, |since_s| libm::exp(-since_s / correlation_s(quality)));
    libm::sqrt((1.0 + rho) / (1.0 - rho))
}

/// The last fix that was taken.
#[derive(Clone, Copy, Debug)]
struct LastFix {
    time: GpsTime,
    /// Velocity of the antenna, as the nominal had it.
    v_e_mps: [f64; 3],
    /// One sigma of the receiver's position, east, north, up, m.
    sigma_enu_m: [f64; 3],
}

/// What the loosely coupled filter holds besides the filter.
#[derive(Clone, Copy, Debug)]
pub(super) struct Loose {
    /// The receiver gives its own solutions and no observations.
    is_on: bool,
    last: Option<LastFix>,
    /// The fix of this epoch was refused.
    is_refused: bool,
    refused: u8,
    resets: u8,
    taken: u8,
}

impl Loose {
    pub(super) const OFF: Self = Self {
        is_on: false,
        last: None,
        is_refused: false,
        refused: 0,
        resets: 0,
        taken: 0,
    };

    /// The filter begins: nothing it took before counts.
    pub(super) const fn start(&mut self) {
        *self = Self {
            is_on: self.is_on,
            ..Self::OFF
        };
    }

    /// All times so far were wrong by this much, ns.
    pub(super) fn shift(&mut self, by_ns: i64) {
        if let Some(last) = &mut self.last {
            last.time = last.time.plus_ns(by_ns);
        }
    }
}

/// One component of a fix against the nominal.
#[derive(Clone, Copy, Debug)]
struct Row {
    /// Along it, ECEF.
    direction: [f64; 3],
    innovation: f64,
    sigma: f64,
    /// One sigma of the innovation.
    innovation_sigma: f64,
}

impl Row {
    const ZERO: Self = Self {
        direction: [0.0; 3],
        innovation: 0.0,
        sigma: 0.0,
        innovation_sigma: 0.0,
    };

    /// Whether the innovation is what the two sigmas let it be; NaN is not.
    fn is_credible(&self) -> bool {
        libm::fabs(self.innovation) <= GATE_SIGMAS * self.innovation_sigma
    }
}

/// Length of the innovation of three rows.
fn length(rows: &[Row; 3]) -> f64 {
    libm::sqrt(rows.iter().map(|row| row.innovation * row.innovation).sum())
}

impl TightMonitor {
    /// The receiver's own solution at an epoch without observations.
    ///
    /// `None` where the filter does not serve; [`TightMonitor::status`] says why.
    #[inline(never)]
    pub(crate) fn on_fix(&mut self, fix: &ReceiverFix) -> Option<TightSolution> {
        self.loose.is_on = true;
        self.loose.is_refused = false;
        self.meets(fix.time)?;
        let at = self.navigator.predict(fix.time);
        for clock in 0..CLOCKS {
            self.navigator.reset_clock(clock, 0.0, UNUSED_CLOCK_SIGMA);
        }
        self.corrected.rows.clear();
        let differ = fix
            .solution
            .as_ref()
            .and_then(|solution| self.take_fix(fix.time, solution, &at));
        let velocity = fix.solution.as_ref().and_then(|solution| solution.velocity);
        if let Some(velocity) = velocity.filter(|_| differ.is_none()) {
            self.note_velocity(velocity.ned_mps);
        }
        let told = self.finish(&at)?;
        if let Some(by) = differ {
            self.doubt(by)?;
        }
        Some(told)
    }

    /// Adds the rows of a fix, or refuses all of it: gives by how much it differs from the nominal, m and m/s.
    #[inline(never)]
    fn take_fix(
        &mut self,
        time: GpsTime,
        solution: &FixSolution,
        at: &AntennaState<CLOCKS>,
    ) -> Option<[f64; 2]> {
        let llh = solution.llh;
        let axes: [[f64; 3]; 3] = geodesy::c_enu_e(llh.lat_rad, llh.lon_rad)
            .transpose()
            .into();
        let factors = self.config.as_ref().map(|config| config.measurement);
        let (position_factor, velocity_factor) = factors.map_or((1.0, 1.0), |factors| {
            (factors.pseudorange, factors.range_rate)
        });
        let since_s = self.loose.last.map(|last| time.seconds_since(last.time));
        let lasting = lasting(solution.quality, since_s);
        let horizontal_m =
            position_factor * solution.horizontal_accuracy_m * core::f64::consts::FRAC_1_SQRT_2;
        let sigma_enu_m = [
            horizontal_m,
            horizontal_m,
            position_factor * solution.vertical_accuracy_m,
        ];
        let place = Vector3::from(at.r_e_m) - geodesy::to_ecef(&llh);
        let positions = self.rows_along(
            &axes,
            POSITION,
            &place,
            sigma_enu_m.map(|sigma| lasting * sigma),
        );
        let velocities = solution.velocity.map(|velocity| {
            let [north, east, down] = velocity.ned_mps;
            let measured = geodesy::c_enu_e(llh.lat_rad, llh.lon_rad).transpose()
                * Vector3::new(east, north, -down);
            let v_e = Vector3::from(at.v_e_mps);
            let changed = self
                .loose
                .last
                .map_or(Vector3::zeros(), |last| v_e - Vector3::from(last.v_e_mps));
            let stated_mps = velocity_factor * velocity.accuracy_mps;
            let sigma_enu_mps = axes.map(|axis| {
                let half_mps = 0.5 * Vector3::from(axis).dot(&changed);
                libm::sqrt(stated_mps * stated_mps + half_mps * half_mps)
            });
            self.rows_along(&axes, VELOCITY, &(v_e - measured), sigma_enu_mps)
        });
        let is_credible = positions
            .iter()
            .chain(velocities.iter().flatten())
            .all(Row::is_credible);
        if !is_credible {
            self.loose.is_refused = true;
            return Some([length(&positions), velocities.as_ref().map_or(0.0, length)]);
        }
        self.add_rows(&positions, velocities.as_ref());
        self.loose.refused = 0;
        self.loose.taken = self.loose.taken.saturating_add(1);
        if self.loose.taken >= SETTLED {
            self.loose.resets = 0;
        }
        self.loose.last = Some(LastFix {
            time,
            v_e_mps: at.v_e_mps,
            sigma_enu_m,
        });
        None
    }

    /// East, north, up of a difference, with its sigmas and those of the filter's states.
    fn rows_along(
        &self,
        axes: &[[f64; 3]; 3],
        block: usize,
        difference: &Vector3<f64>,
        sigma_enu: [f64; 3],
    ) -> [Row; 3] {
        let covariance = symmetric(&self.navigator.filter().block(block));
        let mut rows = [Row::ZERO; 3];
        for ((row, axis), sigma) in rows.iter_mut().zip(axes).zip(sigma_enu) {
            let along = Vector3::from(*axis);
            *row = Row {
                direction: *axis,
                innovation: along.dot(difference),
                sigma,
                innovation_sigma: libm::sqrt(along.dot(&(covariance * along)) + sigma * sigma),
            };
        }
        rows
    }

    /// The joint block of a measurement has room for a component of the position beside one of the velocity.
    fn add_rows(&mut self, positions: &[Row; 3], velocities: Option<&[Row; 3]>) {
        for (k, position) in positions.iter().enumerate() {
            let mut row = MeasurementRow::<JOINT>::ZERO;
            for (entry, along) in row.pseudorange.iter_mut().zip(position.direction) {
                *entry = along;
            }
            row.innovation_m = position.innovation;
            row.weight = 1.0 / (position.sigma * position.sigma);
            if let Some(velocity) = velocities.and_then(|rows| rows.get(k)) {
                let entries = row.range_rate.iter_mut().skip(VELOCITY_AT);
                for (entry, along) in entries.zip(velocity.direction) {
                    *entry = along;
                }
                row.innovation_mps = velocity.innovation;
                row.range_rate_weight = 1.0 / (velocity.sigma * velocity.sigma);
            }
            self.navigator.information_mut().add_row(&row);
        }
    }

    /// A fix was refused that differs by this much. After several in a row the filter is made as uncertain;
    /// where that has not helped it is given up: `None`.
    fn doubt(&mut self, [position_m, velocity_mps]: [f64; 2]) -> Option<()> {
        self.loose.taken = 0;
        self.loose.refused = self.loose.refused.saturating_add(1);
        if self.loose.refused < MAX_REFUSED {
            return Some(());
        }
        self.loose.refused = 0;
        self.loose.resets = self.loose.resets.saturating_add(1);
        if self.loose.resets >= MAX_RESETS {
            self.lose(InertialStatus::Unhealthy);
            return None;
        }
        self.navigator.widen(position_m, velocity_mps);
        Some(())
    }

    /// Tries to start the filter from a fix that it did not serve, as from a snapshot solution. Nothing has
    /// tested it; its levels are the receiver's own accuracies.
    #[inline(never)]
    pub(crate) fn align_with_fix(&mut self, fix: &ReceiverFix) {
        let (velocity_enu_mps, sigma_enu_mps) = self.velocity_of(fix);
        let Some(from) = &fix.solution else {
            self.align(fix.time, None, &sigma_enu_mps);
            return;
        };
        let solution = SnapshotSolution {
            r_e_m: geodesy::to_ecef(&from.llh).into(),
            llh: from.llh,
            clock_m: [Some(0.0); System::ALL.len()],
            velocity_enu_mps,
            clock_drift_mps: velocity_enu_mps.map(|_| 0.0),
            rate_fit: None,
            used: SatelliteSet::EMPTY,
            n_observed: fix.satellites,
            unused: [0; SATELLITE_REASONS],
            no_broadcast_ionosphere: false,
            steps: 0,
        };
        let tested = TestedSolution {
            solution: &solution,
            levels_m: [from.horizontal_accuracy_m, from.vertical_accuracy_m]
                .map(|accuracy_m| LEVEL_SIGMAS * accuracy_m),
        };
        self.align(fix.time, Some(&tested), &sigma_enu_mps);
    }

    /// After a fix: whether the filter's position is told.
    pub(crate) fn earn_with_fix(&mut self, fix: &ReceiverFix, solution: &TightSolution) -> bool {
        let (velocity_enu_mps, sigma_enu_mps) = self.velocity_of(fix);
        self.earn(fix.time, solution, velocity_enu_mps, &sigma_enu_mps)
    }

    /// Velocity of a fix, east, north, up, m/s, and one sigma of it, as stated times the factor of the configuration.
    fn velocity_of(&self, fix: &ReceiverFix) -> (Option<[f64; 3]>, [f64; 3]) {
        let velocity = fix
            .solution
            .as_ref()
            .and_then(|solution| solution.velocity.as_ref());
        let sigma_mps = self.config.as_ref().map_or(f64::INFINITY, |config| {
            velocity.map_or(config.sigma.velocity_mps, |velocity| {
                velocity.accuracy_mps * config.measurement.range_rate
            })
        });
        let velocity_enu_mps = velocity.map(
            |FixVelocity {
                 ned_mps: [north, east, down],
                 ..
             }| [*east, *north, -down],
        );
        (velocity_enu_mps, [sigma_mps; 3])
    }

    /// Observations have come: a loosely coupled filter gives way. Tight mode begins with the next solution
    /// that was tested, from the attitude as it was.
    pub(crate) fn end_loose(&mut self) {
        let was_on = core::mem::replace(&mut self.loose, Loose::OFF).is_on;
        if was_on && self.is_running() {
            self.lose(InertialStatus::Aligning);
        }
    }

    /// Whether the filter takes a receiver's own solutions.
    pub const fn is_loose(&self) -> bool {
        self.loose.is_on
    }

    /// Whether the last fix was too far from the filter to be taken.
    pub(crate) const fn fix_is_refused(&self) -> bool {
        self.loose.is_refused
    }

    /// One sigma of a position of the loosely coupled filter, east, north, up, m: its own, and that of the
    /// fixes it was held by, whose errors it follows.
    pub(crate) fn loose_sigma_enu_m(&self, own_enu_m: [f64; 3]) -> [f64; 3] {
        let mut sigma_enu_m = own_enu_m;
        if let Some(last) = &self.loose.last {
            for (sigma, fix) in sigma_enu_m.iter_mut().zip(last.sigma_enu_m) {
                *sigma = libm::sqrt(*sigma * *sigma + fix * fix);
            }
        }
        sigma_enu_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// INT-118. The mean of n errors e_k = ρ e_{k−1} + … has the variance σ²/n (1 + ρ)/(1 − ρ) for many: as a filter
    /// that takes them for white with `lasting` σ believes.
    #[test]
    fn int_118_errors_that_last_are_averaged_as_slowly_as_they_last() {
        let (n, since_s) = (4000_i32, 0.25);
        for quality in [FixQuality::Fixed, FixQuality::Float, FixQuality::Code] {
            let rho = libm::exp(-since_s / correlation_s(quality));
            // Σ over all pairs of ρ^|j − k|.
            let pairs: f64 = (1..n)
                .map(|apart| 2.0 * f64::from(n - apart) * libm::pow(rho, f64::from(apart)))
                .sum();
            let of_mean = (f64::from(n) + pairs) / f64::from(n).powi(2);
            let believed = lasting(quality, Some(since_s)).powi(2) / f64::from(n);
            assert!((believed / of_mean - 1.0).abs() < 0.04, "{quality:?}");
        }
    }

    #[test]
    fn a_fix_without_one_before_is_as_good_as_it_says() {
        for since_s in [None, Some(0.0), Some(-1.0), Some(f64::NAN), Some(1e9)] {
            assert_eq!(lasting(FixQuality::Code, since_s), 1.0, "{since_s:?}");
        }
    }

    /// INT-118. What is no number is refused.
    #[test]
    fn int_118_an_innovation_that_is_no_number_is_not_credible() {
        let row = |innovation, innovation_sigma| Row {
            innovation,
            innovation_sigma,
            ..Row::ZERO
        };
        assert!(row(5.9, 1.0).is_credible() && row(-5.9, 1.0).is_credible());
        assert!(!row(6.1, 1.0).is_credible() && !row(-6.1, 1.0).is_credible());
        assert!(!row(f64::NAN, 1.0).is_credible() && !row(0.0, f64::NAN).is_credible());
        assert!(!row(f64::INFINITY, 1.0).is_credible());
    }
}
