//! The truth of a flight, computed once for all trials that fly it.
//!
//! In: a motion, a place, a start. Out: true increments of the inertial unit, and at every second the
//! true state with all satellites in view, ranges without noise. From the simulator's own code,
//! [`crate::simulate::inertial`].

use nalgebra::Vector3;
use surefix_core::gnss::{CorrectedMeasurement, Satellite};
use surefix_core::time::{GpsTime, NS_PER_S};

use crate::simulate::disturbances::Disturbances;
use crate::simulate::inertial::measurements::Measurer;
use crate::simulate::inertial::motion::Motion;
use crate::simulate::inertial::trajectory::{Anchor, State, Trajectory};
use crate::simulate::sky::WEEK;

/// A satellite in view.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// Range, range rate and one sigma of both; no clock, no noise.
    pub measurement: CorrectedMeasurement,
    /// Elevation, rad.
    pub elevation_rad: f64,
}

/// The truth at an epoch.
#[derive(Clone, Debug)]
pub struct TrueEpoch {
    /// Position, velocity, attitude.
    pub state: State,
    /// Satellites in view, in order of name.
    pub seen: Vec<Seen>,
}

/// A flight without chance.
#[derive(Clone, Debug)]
pub struct Flown {
    /// Time zero.
    pub start: GpsTime,
    /// Inertial samples per second, and per epoch.
    pub rate_hz: u32,
    /// Angular increment, rad, and velocity increment, m/s, of every sample.
    pub increments: Vec<(Vector3<f64>, Vector3<f64>)>,
    /// Every second from t = 0 on.
    pub epochs: Vec<TrueEpoch>,
}

/// What to fly, and when.
#[derive(Clone, Debug)]
pub struct FlightPlan {
    /// The motion.
    pub motion: Motion,
    /// A place on the way.
    pub anchor: Anchor,
    /// Time of week of t = 0, s.
    pub tow_s: i64,
    /// Length, s.
    pub duration_s: u32,
    /// Inertial samples per second; divides 1 s into whole nanoseconds.
    pub rate_hz: u32,
}

impl Flown {
    /// Flies a plan.
    pub fn new(plan: &FlightPlan) -> Self {
        let start = GpsTime::from_week_tow_s(WEEK, plan.tow_s);
        let trajectory = Trajectory::new(
            plan.motion.clone(),
            &plan.anchor,
            plan.duration_s,
            plan.rate_hz,
        );
        let samples = (plan.duration_s * plan.rate_hz) as usize;
        // Without noise: the seed is of no consequence.
        let mut measurer = Measurer::new(start, 0, true, false, &[], &[], &Disturbances::default());
        let epochs = (0..=plan.duration_s)
            .map(|second| {
                let t_s = f64::from(second);
                let state = trajectory.state(t_s);
                let epoch = measurer.measure(t_s, &state, (0.0, 0.0));
                let seen = epoch.rows.iter().map(|row| Seen {
                    measurement: row.measurement,
                    elevation_rad: row.elevation_rad,
                });
                TrueEpoch {
                    seen: seen.collect(),
                    state,
                }
            })
            .collect();
        Self {
            start,
            rate_hz: plan.rate_hz,
            increments: (1..=samples).map(|k| trajectory.increments(k)).collect(),
            epochs,
        }
    }

    /// Length, s.
    pub fn duration_s(&self) -> usize {
        self.epochs.len() - 1
    }

    /// Time of an epoch.
    pub fn time(&self, second: usize) -> GpsTime {
        self.start.plus_ns(second as i64 * NS_PER_S)
    }

    /// Satellites in view from the first epoch to the last, in order of name.
    pub fn always_seen(&self) -> Vec<Satellite> {
        let Some((first, rest)) = self.epochs.split_first() else {
            return Vec::new();
        };
        let names = first.seen.iter().map(|seen| seen.measurement.satellite);
        names
            .filter(|satellite| {
                rest.iter().all(|epoch| {
                    let mut seen = epoch.seen.iter();
                    seen.any(|seen| seen.measurement.satellite == *satellite)
                })
            })
            .collect()
    }
}
