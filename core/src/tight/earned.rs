//! Whether a filter that was started may be believed: before, the snapshot serves.
//!
//! In: what the nominal predicted over an epoch, and the receiver's own velocities. Out: whether the filter's
//! position is told.
//!
//! | symbol | code                | shape | unit | frame | meaning                                          |
//! |--------|---------------------|-------|------|-------|--------------------------------------------------|
//! | a      | `by_unit_mps`       | 2     | m/s  | enu   | horizontal change of velocity over an epoch, from the samples by the filter's attitude |
//! | b      | `by_receiver_mps`   | 2     | m/s  | enu   | the same by the receiver alone                   |
//! | σ      | `sigma_mps`         |       | m/s  |       | error of a − b per axis                          |
//! | ψ̂      | `turned_rad`        |       | rad  |       | angle by which a is turned against b             |
//! | σ_ψ    | `sigma_turned_rad`  |       | rad  |       | its one sigma                                    |
//!
//! Two conditions. The attitude must be known to [`MAX_SIGMA_RAD`], within which the linear model of the filter holds
//! (docs/decisions/016-alignment.md has the measurement). And where the heading came from outside, from
//! a magnetic field that iron nearby or a wrong declination may turn as a whole, motion must have confirmed
//! it: a filter with a wrong heading turns every acceleration, and at rest shows nothing. Weighted sums
//! over the epochs since the start,
//!
//! ψ̂ = atan2(Σ (b × a)/σ², Σ (a·b)/σ²), σ_ψ² = 1/Σ (b·b)/σ²,
//!
//! are the least-squares turn between both. With σ_ψ below [`CONFIRMED_RAD`] the heading is confirmed when ψ̂ is within
//! [`SIGMAS`] of its sigma and the filter's, refuted otherwise. Derived here.

use nalgebra::Vector3;

use super::{TightMonitor, TightSolution};
use crate::frames::geodesy;
use crate::gnss::solution::SnapshotWorkspace;
use crate::ins::alignment::AlignmentMode;
use crate::integrity::InertialStatus;
use crate::time::GpsTime;

/// Largest one sigma of the attitude about any axis, rad: 20°.
const MAX_SIGMA_RAD: f64 = core::f64::consts::PI / 9.0;
/// One sigma of the turn below which it confirms or refutes, rad: 3°.
const CONFIRMED_RAD: f64 = 3.0 * core::f64::consts::PI / 180.0;
/// See [`CONFIRMED_RAD`].
const SIGMAS: f64 = 4.0;
/// What tilt and accelerometer bias do to a change of velocity in a second, one sigma, m/s².
const UNSEEN_MPS2: f64 = 0.1;
/// Longest step whose changes are compared, s.
const MAX_STEP_S: f64 = 2.5;

/// The end of an epoch.
#[derive(Clone, Copy, Debug)]
struct Last {
    time: GpsTime,
    /// Of the filter after its update, east and north, m/s.
    by_filter_mps: [f64; 2],
    /// Of the receiver alone.
    by_receiver_mps: [f64; 2],
}

/// What a filter has shown since it was started.
#[derive(Clone, Copy, Debug)]
pub(super) struct Earned {
    is_earned: bool,
    needs_motion: bool,
    /// Velocity that the nominal has before the update of the epoch, ECEF, m/s.
    predicted_v_e_mps: Option<[f64; 3]>,
    last: Option<Last>,
    /// Σ (b × a)/σ².
    across: f64,
    /// Σ (a·b)/σ².
    along: f64,
    /// Σ (b·b)/σ².
    weight: f64,
}

impl Earned {
    /// All times so far were wrong by this much, ns.
    pub(super) fn shift(&mut self, by_ns: i64) {
        if let Some(last) = &mut self.last {
            last.time = last.time.plus_ns(by_ns);
        }
    }

    /// Nothing.
    pub(super) const NOTHING: Self = Self {
        is_earned: false,
        needs_motion: false,
        predicted_v_e_mps: None,
        last: None,
        across: 0.0,
        along: 0.0,
        weight: 0.0,
    };

    /// A filter starts from an attitude of this origin and these sigmas.
    pub(super) fn start(mode: AlignmentMode, sigma_ned_rad: &[f64; 3]) -> Self {
        let needs_motion = mode == AlignmentMode::MagneticField;
        Self {
            is_earned: !needs_motion && is_linear(sigma_ned_rad),
            needs_motion,
            ..Self::NOTHING
        }
    }

    pub(super) const fn is_earned(&self) -> bool {
        self.is_earned
    }

    fn add(&mut self, by_unit_mps: [f64; 2], by_receiver_mps: [f64; 2], sigma_mps: f64) {
        let ([a_east, a_north], [b_east, b_north]) = (by_unit_mps, by_receiver_mps);
        let weight = 1.0 / (sigma_mps * sigma_mps);
        self.across += (b_east * a_north - b_north * a_east) * weight;
        self.along += (a_east * b_east + a_north * b_north) * weight;
        self.weight += (b_east * b_east + b_north * b_north) * weight;
    }

    /// True where motion has confirmed the heading, false where it has refuted it; `None` while it has done
    /// neither.
    fn is_confirmed(&self, sigma_heading_rad: f64) -> Option<bool> {
        let sigma_turned_rad = 1.0 / libm::sqrt(self.weight);
        if !(sigma_turned_rad <= CONFIRMED_RAD) {
            return None;
        }
        let turned_rad = libm::atan2(self.across, self.along);
        let limit_rad = SIGMAS * libm::hypot(sigma_turned_rad, sigma_heading_rad);
        Some(libm::fabs(turned_rad) <= limit_rad)
    }
}

fn is_linear(sigma_rad: &[f64; 3]) -> bool {
    sigma_rad.iter().all(|sigma| *sigma <= MAX_SIGMA_RAD)
}

/// Change of velocity, m/s.
fn change([east, north]: [f64; 2], from: [f64; 2]) -> [f64; 2] {
    let [from_east, from_north] = from;
    [east - from_east, north - from_north]
}

impl TightMonitor {
    /// Whether the filter's position is told: it runs, and has shown that it may be believed.
    pub const fn has_earned(&self) -> bool {
        self.is_running() && self.earned.is_earned()
    }

    /// One sigma of the receiver's velocity east, north, up, m/s: by the model times what the configuration knows
    /// of this receiver, or as configured where the receiver has no velocity. Zero when nobody asks.
    pub(crate) fn velocity_sigma_enu_mps(&self, workspace: &SnapshotWorkspace) -> [f64; 3] {
        match &self.config {
            Some(config) if !self.has_earned() => match workspace.velocity_sigma_enu_mps() {
                Some(sigma) => sigma.map(|sigma_mps| sigma_mps * config.measurement.range_rate),
                None => [config.sigma.velocity_mps; 3],
            },
            _ => [0.0; 3],
        }
    }

    /// Before an epoch: keeps what the nominal predicts for it.
    pub(crate) fn note_prediction(&mut self, time: GpsTime) {
        self.release(time);
        self.earned.predicted_v_e_mps = (self.is_running() && !self.earned.is_earned)
            .then(|| self.navigator.antenna(time).v_e_mps);
    }

    /// After an epoch: whether the filter's position is told. A filter whose heading motion has refuted is given up.
    pub(crate) fn earn(
        &mut self,
        time: GpsTime,
        solution: &TightSolution,
        velocity_enu_mps: Option<[f64; 3]>,
        sigma_velocity_enu_mps: &[f64; 3],
    ) -> bool {
        if self.earned.is_earned {
            return true;
        }
        let Some(sigma_ned_rad) = self.sigma_attitude_ned_rad() else {
            return false;
        };
        self.compare_changes(time, solution, velocity_enu_mps, sigma_velocity_enu_mps);
        let [.., sigma_heading_rad] = sigma_ned_rad;
        let is_confirmed = if self.earned.needs_motion {
            self.earned.is_confirmed(sigma_heading_rad)
        } else {
            Some(true)
        };
        if is_confirmed == Some(false) {
            self.lose(InertialStatus::Unhealthy);
            return false;
        }
        self.earned.is_earned = is_confirmed == Some(true) && is_linear(&sigma_ned_rad);
        self.earned.is_earned
    }

    fn compare_changes(
        &mut self,
        time: GpsTime,
        solution: &TightSolution,
        velocity_enu_mps: Option<[f64; 3]>,
        sigma_velocity_enu_mps: &[f64; 3],
    ) {
        let last = self.earned.last.take();
        let predicted = self.earned.predicted_v_e_mps.take();
        let Some([east, north, _]) = velocity_enu_mps else {
            return;
        };
        let [filter_east, filter_north, _] = solution.velocity_enu_mps;
        self.earned.last = Some(Last {
            time,
            by_filter_mps: [filter_east, filter_north],
            by_receiver_mps: [east, north],
        });
        let (Some(last), Some(predicted)) = (last, predicted) else {
            return;
        };
        let step_s = time.seconds_since(last.time);
        if !(step_s > 0.0 && step_s <= MAX_STEP_S) {
            return;
        }
        let c_enu_e = geodesy::c_enu_e(solution.llh.lat_rad, solution.llh.lon_rad);
        let predicted_enu = c_enu_e * Vector3::from(predicted);
        let [sigma_east, sigma_north, _] = *sigma_velocity_enu_mps;
        // Two velocities of the receiver, of the mean of its two directions.
        let receiver = sigma_east * sigma_east + sigma_north * sigma_north;
        let unseen_mps = UNSEEN_MPS2 * step_s;
        self.earned.add(
            change([predicted_enu.x, predicted_enu.y], last.by_filter_mps),
            change([east, north], last.by_receiver_mps),
            libm::sqrt(receiver + unseen_mps * unseen_mps),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(epochs: usize, turned_rad: f64) -> Earned {
        let mut earned = Earned::start(AlignmentMode::MagneticField, &[0.01, 0.01, 0.05]);
        for k in 0..epochs {
            let (sin, cos) = libm::sincos(k as f64);
            let (east, north) = (2.0 * sin, 2.0 * cos);
            let (s, c) = libm::sincos(turned_rad);
            let by_unit = [c * east - s * north, s * east + c * north];
            earned.add(by_unit, [east, north], 0.15);
        }
        earned
    }

    #[test]
    fn motion_confirms_a_right_heading_and_refutes_a_wrong_one() {
        assert_eq!(after(0, 0.0).is_confirmed(0.05), None);
        assert_eq!(after(1, 0.0).is_confirmed(0.05), None);
        assert_eq!(after(10, 0.0).is_confirmed(0.05), Some(true));
        for wrong_deg in [30.0, -30.0, 90.0, -90.0, 180.0_f64] {
            let earned = after(10, wrong_deg.to_radians());
            assert_eq!(earned.is_confirmed(0.05), Some(false), "{wrong_deg}");
            // What the filter itself does not know is no contradiction.
            let is_confirmed = earned.is_confirmed(1.0);
            assert_eq!(is_confirmed, Some(true), "{wrong_deg}");
        }
    }

    #[test]
    fn what_is_no_number_confirms_nothing() {
        let mut earned = after(10, 0.0);
        earned.add([f64::NAN; 2], [1.0, 0.0], 0.15);
        assert_eq!(earned.is_confirmed(0.05), Some(false));
        earned.add([1.0; 2], [f64::NAN; 2], 0.15);
        assert_eq!(earned.is_confirmed(0.05), None);
    }

    #[test]
    fn an_attitude_of_the_unit_itself_counts_at_once_where_the_filter_is_linear() {
        for mode in AlignmentMode::ALL {
            let good = Earned::start(mode, &[0.01, 0.01, 0.1]);
            assert_eq!(good.is_earned(), mode != AlignmentMode::MagneticField);
            assert!(!Earned::start(mode, &[0.01, 0.01, 0.6]).is_earned());
            assert!(!Earned::start(mode, &[0.6, 0.01, 0.1]).is_earned());
            assert!(!Earned::start(mode, &[0.01, 0.01, f64::NAN]).is_earned());
        }
    }
}
