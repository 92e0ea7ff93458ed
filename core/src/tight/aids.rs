//! What a barometer and a standstill say of the velocity, for the filter and the bank alike.
//!
//! In: samples of the inertial unit and of the barometer, the nominal, the filter. Out: rows of the
//! antenna's velocity for an epoch, the same for every filter.
//!
//! | symbol | code        | unit | frame | meaning                                                   |
//! |--------|-------------|------|-------|-----------------------------------------------------------|
//! | D      | `Apart`     | m    |       | nominal height of the antenna minus pressure altitude, smoothed |
//! | T      |             | s    |       | time between two heights                                  |
//! | v̂      |             | m/s  | e     | nominal velocity of the antenna                           |
//! | σ, d, s, τ |         |      |       | noise, drift, scale, memory: `ins/aids.rs`                |
//!
//! ```text
//! climb:       up·δv = (D_2 − D_1)/T,   R = 2 σ²/T² + (d² + (s v_up)²)(1 + 2 τ/T) + (σ_a T/2)²
//! standstill:  δv = v̂ per axis,         R = σ² (1 + 2 τ_0/Δt)
//! ```
//!
//! The bias of a barometer is in neither height's difference: no state is needed for it, and no height of a
//! satellite stands behind it that could be wrong. T is long, for the noise of a height counts once per
//! T, and short enough for the velocity at its end to be that of its middle but for the error σ_a of the
//! acceleration. Both rows enter the joint block of position, velocity
//! and clocks as range rates do. Derivation, what is not done, who pays for an aid that is wrong:
//! docs/decisions/017-aids.md.

use nalgebra::Vector3;

use super::{CLOCKS, JOINT, TestedSolution, TightMonitor};
use crate::ekf::layout::{ACCEL_BIAS, VELOCITY};
use crate::ekf::{EpochInformation, ErrorState, MeasurementRow};
use crate::frames::geodesy;
use crate::ins::aiding::PressureSample;
use crate::ins::horizon::Aiding;
use crate::ins::{
    AidUse, AidsConfig, Barometer, BarometerModel, Increment, Stationarity, ZeroVelocityModel,
};
use crate::linalg::block3::Symmetric;
use crate::time::{GpsTime, NS_PER_S};

/// Shortest time between two heights of a barometer, s.
const CLIMB_S: f64 = 4.95;
/// Longest, s: with a longer one something was missing.
const MAX_CLIMB_S: f64 = 12.0;
/// Heights are smoothed over so long, s; the delay is that of both.
const SMOOTH_S: f64 = 0.5;
/// Samples of a barometer farther apart begin anew, s.
const MAX_PAUSE_S: f64 = 1.5;
/// Farthest that a sample of the barometer may be from where the nominal stands, ns.
const MAX_APART_NS: i64 = 150_000_000;
/// A climb farther from the filter's than so many sigmas is not taken: the barometer leapt or stands still.
const GATE_SIGMAS: f64 = 5.0;
/// Refused so often in a row it has to agree for a while first.
const MAX_REFUSED: u8 = 3;
/// How long it has to agree then, ns.
const PROBATION_NS: i64 = 60 * NS_PER_S;
/// After the filter without aids was right it has to agree for so long, ns.
const EXCLUSION_NS: i64 = 300 * NS_PER_S;
/// Fastest that a vehicle that stands may be by the nominal, m/s, whatever the filter's sigma.
const MAX_STILL_MPS: f64 = 1.0;
/// In sigmas of the filter and of the standstill.
const STILL_SIGMAS: f64 = 4.0;
/// Largest mean rate of a vehicle that stands, rad/s: the Earth's and the bias of a bad gyroscope.
const MAX_STILL_RATE_RADPS: f64 = 0.03;
/// Faster than this by the satellites it moves, m/s: five sigma of range rates among buildings.
const MOVING_MPS: f64 = 0.5;
/// What the satellites say of it holds so long, ns.
const SAID_NS: i64 = 2 * NS_PER_S;
/// What a standstill errs by, settling on its springs, lasts so long, s.
const STILL_MEMORY_S: f64 = 1.0;

/// A height of the barometer beside that of the nominal.
#[derive(Clone, Copy, Debug)]
struct Apart {
    time: GpsTime,
    /// Nominal height minus pressure altitude, m.
    height_m: f64,
}

/// The aids of the filter.
#[derive(Debug)]
pub(super) struct Aids {
    config: AidsConfig,
    stationarity: Stationarity,
    barometer: Barometer,
    /// The height that the next is compared with.
    first: Option<Apart>,
    latest: Option<Apart>,
    /// Refused in a row.
    refused: u8,
    /// Since when it has agreed, and for how long it has to.
    probation: Option<(GpsTime, i64)>,
    /// Standstills were wrong; none is believed until the vehicle has been seen to move.
    standstill_is_excluded: bool,
    /// Speed by the satellites, m/s, and when that was.
    speed: Option<(GpsTime, f64)>,
    last_standstill: Option<GpsTime>,
    climb_use: AidUse,
    standstill_use: AidUse,
    information: EpochInformation<JOINT>,
}

impl Aids {
    /// Not configured.
    pub(super) const EMPTY: Self = Self {
        config: AidsConfig::NONE,
        stationarity: Stationarity::EMPTY,
        barometer: Barometer::EMPTY,
        first: None,
        latest: None,
        refused: 0,
        probation: None,
        standstill_is_excluded: false,
        speed: None,
        last_standstill: None,
        climb_use: AidUse::Off,
        standstill_use: AidUse::Off,
        information: EpochInformation::ZERO,
    };

    /// The filter begins anew: what it was compared with is gone.
    pub(super) fn restart(&mut self) {
        self.stationarity.restart();
        self.first = None;
        self.latest = None;
        self.last_standstill = None;
        self.information.clear();
    }

    /// A sample of the inertial unit, as the nominal took it.
    pub(super) fn on_increment(&mut self, increment: &Increment) {
        if self.config.zero_velocity.is_some() {
            self.stationarity.add(increment);
        }
    }

    /// What the aids say of the epoch, for every filter.
    pub(super) const fn information(&self) -> &EpochInformation<JOINT> {
        &self.information
    }

    /// The nominal was corrected by this much along the vertical, m (estimate minus truth).
    fn rereference(&mut self, up_m: f64) {
        for apart in [&mut self.first, &mut self.latest].into_iter().flatten() {
            apart.height_m -= up_m;
        }
    }

    /// The filter without aids was right: what they said is out of all filters.
    pub(super) fn exclude(&mut self, now: GpsTime) {
        self.probation = Some((now, EXCLUSION_NS));
        self.standstill_is_excluded = true;
        self.first = None;
    }

    /// All times so far were wrong by this much, ns.
    pub(super) fn shift(&mut self, by_ns: i64) {
        self.barometer.shift(by_ns);
        for apart in [&mut self.first, &mut self.latest].into_iter().flatten() {
            apart.time = apart.time.plus_ns(by_ns);
        }
        self.probation = self
            .probation
            .map(|(since, long_ns)| (since.plus_ns(by_ns), long_ns));
        self.speed = self.speed.map(|(when, speed)| (when.plus_ns(by_ns), speed));
        self.last_standstill = self.last_standstill.map(|when| when.plus_ns(by_ns));
    }

    /// A climb that contradicts the filter, or one that agrees; whether it may be used.
    fn admit_climb(&mut self, now: GpsTime, agrees: bool) -> AidUse {
        if !agrees {
            self.refused = self.refused.saturating_add(1);
            if let Some((since, _)) = &mut self.probation {
                *since = now;
            } else if self.refused >= MAX_REFUSED {
                self.probation = Some((now, PROBATION_NS));
            }
            return match self.probation {
                Some(_) => AidUse::Excluded,
                None => AidUse::Refused,
            };
        }
        self.refused = 0;
        if let Some((since, long_ns)) = self.probation {
            if now.ns().saturating_sub(since.ns()) < long_ns {
                return AidUse::Excluded;
            }
            self.probation = None;
        }
        AidUse::Used
    }
}

/// Variance of a measurement whose error has a white part and one that lasts: with epochs `dt_s` apart an average
/// over an error with the memory τ is worth 1 + 2 τ/Δt times less.
fn lasting(variance: f64, memory_s: f64, dt_s: f64) -> f64 {
    variance * (1.0 + 2.0 * memory_s / dt_s)
}

/// The next height beside the nominal's.
fn smoothed(before: Option<Apart>, time: GpsTime, height_m: f64) -> Apart {
    let gain = before.map_or(1.0, |before| {
        let dt_s = time.seconds_since(before.time);
        if dt_s > 0.0 && dt_s < MAX_PAUSE_S {
            dt_s / (dt_s + SMOOTH_S)
        } else {
            1.0
        }
    });
    let from_m = before.map_or(height_m, |before| before.height_m);
    Apart {
        time,
        height_m: from_m + gain * (height_m - from_m),
    }
}

/// nᵀ P n.
fn along(p: &Symmetric, n: &Vector3<f64>) -> f64 {
    let [xx, xy, xz, yy, yz, zz] = *p;
    xx * n.x * n.x
        + yy * n.y * n.y
        + zz * n.z * n.z
        + 2.0 * (xy * n.x * n.y + xz * n.x * n.z + yz * n.y * n.z)
}

impl TightMonitor {
    /// The aids there are; before the first epoch.
    pub(crate) fn configure_aids(&mut self, config: &AidsConfig) {
        let waiting = |is_there: bool| {
            if is_there {
                AidUse::Waiting
            } else {
                AidUse::Off
            }
        };
        self.aids = Aids {
            config: *config,
            climb_use: waiting(config.barometer.is_some()),
            standstill_use: waiting(config.zero_velocity.is_some()),
            ..Aids::EMPTY
        };
    }

    /// What became of the standstill and of the barometer's climb at the last epoch.
    pub const fn aids_used(&self) -> [AidUse; 2] {
        [self.aids.standstill_use, self.aids.climb_use]
    }

    /// A sample of the barometer.
    pub(crate) fn on_pressure(&mut self, sample: &PressureSample) {
        if self.aids.config.barometer.is_some() {
            self.await_increments(Aiding::Pressure(*sample));
        }
    }

    /// A sample of the barometer whose time the nominal has come to.
    pub(super) fn take_pressure(&mut self, sample: &PressureSample) {
        let Some(height) = self.aids.barometer.take(sample) else {
            self.aids.latest = None;
            return;
        };
        if !self.is_running() {
            self.aids.latest = None;
            return;
        }
        // Of a barometer that is itself late, or after a gap of the inertial samples.
        let lead_ns = height.time.ns().wrapping_sub(self.navigator.time().ns());
        if !(-MAX_APART_NS..=MAX_APART_NS).contains(&lead_ns) {
            return;
        }
        let at = self.navigator.antenna(height.time);
        let before = self.aids.latest.take();
        self.aids.latest = geodesy::to_llh(&Vector3::from(at.r_e_m))
            .ok()
            .map(|llh| smoothed(before, height.time, llh.height_m - height.height_m));
        if self.aids.first.is_none() {
            self.aids.first = self.aids.latest;
        }
    }

    /// The speed by the satellites of an epoch, if they passed their test.
    pub(super) fn note_speed(&mut self, tested: Option<&TestedSolution<'_>>) {
        if let Some(v_enu_mps) = tested.and_then(|tested| tested.solution.velocity_enu_mps) {
            self.note_velocity(v_enu_mps);
        }
    }

    /// The speed by a velocity of the receiver, of whatever axes.
    pub(super) fn note_velocity(&mut self, velocity_mps: [f64; 3]) {
        let now = self.navigator.time();
        let velocity = Vector3::from(velocity_mps);
        let speed_mps = libm::sqrt(velocity.dot(&velocity));
        if speed_mps > MOVING_MPS {
            self.aids.standstill_is_excluded = false;
        }
        self.aids.speed = Some((now, speed_mps));
    }

    /// What the aids say of the epoch that has been predicted.
    #[inline(never)]
    pub(super) fn ask_aids(&mut self) {
        self.aids.information.clear();
        let AidsConfig {
            barometer,
            zero_velocity,
        } = self.aids.config;
        if let Some(model) = zero_velocity {
            self.aids.standstill_use = self.standstill(&model);
        }
        if let Some(model) = barometer {
            self.aids.climb_use = self.climb(&model);
        }
    }

    /// Three rows of no velocity, if the vehicle stands.
    fn standstill(&mut self, model: &ZeroVelocityModel) -> AidUse {
        let now = self.navigator.time();
        let is_still = self.aids.stationarity.scatter().is_some_and(|scatter| {
            scatter.force_mps2 <= model.force_spread_mps2
                && scatter.rate_radps <= model.rate_spread_radps
                && scatter.mean_rate_radps <= MAX_STILL_RATE_RADPS
        });
        let before = self.aids.last_standstill.take();
        if !is_still {
            return AidUse::Waiting;
        }
        let is_recent = |when: GpsTime| now.ns().saturating_sub(when.ns()) <= SAID_NS;
        let moves = self
            .aids
            .speed
            .is_some_and(|(when, speed_mps)| is_recent(when) && !(speed_mps <= MOVING_MPS));
        let v_e = Vector3::from(self.navigator.antenna(now).v_e_mps);
        let speed_mps = libm::sqrt(v_e.dot(&v_e));
        let [xx, _, _, yy, _, zz] = self.navigator.filter().block(VELOCITY);
        let sigma_mps = libm::sqrt(xx + yy + zz + 3.0 * model.sigma_mps * model.sigma_mps);
        // Constant velocity feels like rest: the estimate itself has to allow for it.
        let may_stand =
            !moves && speed_mps <= STILL_SIGMAS * sigma_mps && speed_mps <= MAX_STILL_MPS;
        if !may_stand {
            return AidUse::Refused;
        }
        if self.aids.standstill_is_excluded {
            return AidUse::Excluded;
        }
        let since_s = before.map_or(1.0, |before| now.seconds_since(before));
        let dt_s = if since_s > 0.01 && since_s < 1.0 {
            since_s
        } else {
            1.0
        };
        let variance = lasting(model.sigma_mps * model.sigma_mps, STILL_MEMORY_S, dt_s);
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        for (axis, innovation_mps) in axes.into_iter().zip(v_e.iter()) {
            let sigma_mps = libm::sqrt(variance);
            if let Some(row) = MeasurementRow::of_velocity(axis, *innovation_mps, sigma_mps) {
                self.aids.information.add_row(&row);
            }
        }
        self.aids.last_standstill = Some(now);
        AidUse::Used
    }

    /// A row of the vertical velocity, from two heights of the barometer.
    fn climb(&mut self, model: &BarometerModel) -> AidUse {
        let now = self.navigator.time();
        let Some(latest) = self.aids.latest else {
            self.aids.first = None;
            return AidUse::Waiting;
        };
        let first = *self.aids.first.get_or_insert(latest);
        let dt_s = latest.time.seconds_since(first.time);
        if dt_s < CLIMB_S {
            return if self.aids.probation.is_some() {
                AidUse::Excluded
            } else {
                AidUse::Waiting
            };
        }
        self.aids.first = Some(latest);
        let at = self.navigator.antenna(now);
        let Ok(llh) = geodesy::to_llh(&Vector3::from(at.r_e_m)) else {
            return AidUse::Waiting;
        };
        if dt_s > MAX_CLIMB_S {
            return AidUse::Waiting;
        }
        let c_enu_e = geodesy::c_enu_e(llh.lat_rad, llh.lon_rad);
        let up = c_enu_e.row(2).transpose();
        let climb_mps = up.dot(&Vector3::from(at.v_e_mps));
        let innovation_mps = (latest.height_m - first.height_m) / dt_s;
        let noise_mps = model.sigma_m / dt_s;
        let scale_mps = model.scale * climb_mps;
        let [xx, _, _, yy, _, zz] = self.navigator.filter().block(ACCEL_BIAS);
        let of_acceleration = (xx + yy + zz) / 3.0;
        let variance = 2.0 * noise_mps * noise_mps
            + lasting(
                model.drift_mps * model.drift_mps + scale_mps * scale_mps,
                model.memory_s,
                dt_s,
            )
            + 0.25 * dt_s * dt_s * of_acceleration;
        let of_filter = along(&self.navigator.filter().block(VELOCITY), &up);
        let square = innovation_mps * innovation_mps;
        let agrees = square <= GATE_SIGMAS * GATE_SIGMAS * (variance + of_filter);
        let verdict = self.aids.admit_climb(now, agrees);
        if verdict == AidUse::Used
            && let Some(row) =
                MeasurementRow::of_velocity(up.into(), innovation_mps, libm::sqrt(variance))
        {
            self.aids.information.add_row(&row);
        }
        verdict
    }

    /// The nominal was corrected: heights compared with it are now compared with the corrected one.
    pub(super) fn rereference_aids(&mut self, correction: &ErrorState<CLOCKS>) {
        if self.aids.first.is_none() && self.aids.latest.is_none() {
            return;
        }
        let r_e = self.navigator.mechanisation().r_eb_e;
        if let Ok(llh) = geodesy::to_llh(&r_e) {
            let up = geodesy::c_enu_e(llh.lat_rad, llh.lon_rad)
                .row(2)
                .transpose();
            let [position, ..] = correction.navigation;
            self.aids.rereference(up.dot(&Vector3::from(position)));
        }
    }
}
