//! Several inertial units aboard one flight: where they are, when they sample, what is wrong with them.
//!
//! In: the true track. Out: samples of each unit in its own axes, at its own rate and phase, with bias, noise,
//! scale factors, misalignments and faults of its own.
//!
//! A unit at r from the body point feels f + α × r + ω × (ω × r); over a sample the first term more is the
//! change of ω, the second a Gauss quadrature as in `trajectory.rs`.

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};
use rand_chacha::ChaCha20Rng;
use surefix_core::ins::{ImuSample, SensorRange, UnitConfig, UnitSample, UnitTolerance};
use surefix_core::time::{GpsTime, NS_PER_S};

use super::random;
use super::sensors::{Grade, UnitErrors, normal3};
use super::trajectory::Trajectory;
use super::unit_faults::{UnitFaultKind, UnitFaultSpec};
use crate::simulate::noise::normal;

/// Streams of random numbers of the units: errors, and extra noise.
const STREAM_UNITS: u64 = (1 << 32) + 16;
/// 500 °/s and 20 g.
const RANGE: SensorRange = SensorRange {
    rate_radps: 500.0 * core::f64::consts::PI / 180.0,
    specific_force_mps2: 20.0 * 9.806_65,
};
/// Most that time stamps are off by, as the vote is told, s.
const TIMING_S: f64 = 50e-6;

/// Where a unit is and when it samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitPlan {
    /// Samples per second; divides 1 s into whole nanoseconds.
    pub rate_hz: u32,
    /// First sample ends so much later than one interval after the start, ns.
    pub phase_ns: i64,
    /// Rotation from its axes to the body's.
    pub c_b_s: Matrix3<f64>,
    /// From the body point to it, body axes, m.
    pub arm_b_m: Vector3<f64>,
}

impl UnitPlan {
    /// Three units as a small aircraft may carry them: 100, 200 and 125 samples per second at times of their
    /// own, one turned left, one upside down, within 0.4 m.
    pub fn three() -> [Self; 3] {
        [
            Self {
                rate_hz: 100,
                phase_ns: 0,
                c_b_s: Matrix3::identity(),
                arm_b_m: Vector3::new(0.2, 0.0, 0.0),
            },
            Self {
                rate_hz: 200,
                phase_ns: 1_300_000,
                c_b_s: Matrix3::new(0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0),
                arm_b_m: Vector3::new(-0.15, 0.15, 0.1),
            },
            Self {
                rate_hz: 125,
                phase_ns: 3_700_000,
                c_b_s: Matrix3::new(1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0),
                arm_b_m: Vector3::new(0.0, -0.2, -0.1),
            },
        ]
    }

    fn interval_ns(&self) -> i64 {
        NS_PER_S / i64::from(self.rate_hz)
    }

    /// What the vote is told of it.
    pub fn config(&self, grade: Grade) -> UnitConfig {
        let noise = grade.noise();
        UnitConfig {
            interval_ns: self.interval_ns() as u32,
            c_b_s: self.c_b_s.transpose().into(),
            lever_arm_b_m: self.arm_b_m.into(),
            noise: noise.density,
            range: RANGE,
            tolerance: UnitTolerance {
                gyro_bias_radps: noise.gyro_bias_radps,
                accel_bias_mps2: noise.accel_bias_mps2,
                scale: grade.scale(),
                timing_s: TIMING_S,
            },
        }
    }
}

/// What a perfect unit there would measure.
#[derive(Clone, Debug)]
pub struct TrueUnit {
    trajectory: Arc<Trajectory>,
    plan: UnitPlan,
    /// Of every sample, unit's axes: angle, rad, and velocity, m/s.
    increments: Vec<(Vector3<f64>, Vector3<f64>)>,
}

impl TrueUnit {
    /// Measures a flight of `duration_s`.
    pub fn new(trajectory: &Arc<Trajectory>, plan: UnitPlan, duration_s: u32) -> Self {
        let mut unit = Self {
            trajectory: Arc::clone(trajectory),
            plan,
            increments: Vec::new(),
        };
        let count = (i64::from(duration_s) * NS_PER_S - plan.phase_ns) / plan.interval_ns();
        unit.increments = (1..=count).map(|k| unit.between(k, 0.0)).collect();
        unit
    }

    fn end_ns(&self, k: i64) -> i64 {
        k * self.plan.interval_ns() + self.plan.phase_ns
    }

    /// Increments of sample `k`, from 1 on, with what was `delay_s` before.
    fn between(&self, k: i64, delay_s: f64) -> (Vector3<f64>, Vector3<f64>) {
        let to_s = self.end_ns(k) as f64 / 1e9 - delay_s;
        let from_s = to_s - self.plan.interval_ns() as f64 / 1e9;
        let (dtheta, dv) =
            self.trajectory
                .increments_at(from_s.max(0.0), to_s.max(0.0), &self.plan.arm_b_m);
        let c_s_b = self.plan.c_b_s.transpose();
        (c_s_b * dtheta, c_s_b * dv)
    }
}

/// A unit in flight.
#[derive(Clone, Debug)]
pub struct FlyingUnit {
    truth: Arc<TrueUnit>,
    start: GpsTime,
    errors: UnitErrors,
    extra: ChaCha20Rng,
    density: [f64; 2],
    scale: [Matrix3<f64>; 2],
    number: usize,
    /// Its faults.
    pub faults: Vec<UnitFaultSpec>,
    next: i64,
    /// Rates of the last sample without a stuck axis.
    last: [f64; 6],
}

impl FlyingUnit {
    /// Draws the unit of a number.
    pub fn new(
        truth: &Arc<TrueUnit>,
        number: usize,
        grade: Grade,
        start: GpsTime,
        seed: u64,
    ) -> Self {
        let stream = STREAM_UNITS + 2 * number as u64;
        let mut extra = random(seed, stream + 1);
        let noise = grade.noise();
        let mut scale = || {
            let columns = [(); 3].map(|()| normal3(&mut extra) * grade.scale());
            Matrix3::identity() + Matrix3::from_columns(&columns)
        };
        Self {
            truth: Arc::clone(truth),
            start,
            errors: UnitErrors::new(noise, false, random(seed, stream)),
            density: [noise.density.arw, noise.density.vrw],
            scale: [scale(), scale()],
            extra,
            number,
            faults: Vec::new(),
            next: 1,
            last: [0.0; 6],
        }
    }

    /// End of the next sample since the start, ns; `None` after the last.
    pub fn next_end_ns(&self) -> Option<i64> {
        (self.next as usize <= self.truth.increments.len()).then(|| self.truth.end_ns(self.next))
    }

    /// The next sample; `None` when the unit is silent, or the flight is over.
    pub fn sample(&mut self) -> Option<UnitSample> {
        let end_ns = self.next_end_ns()?;
        let k = self.next;
        self.next += 1;
        let t_s = end_ns as f64 / 1e9;
        let interval_s = self.truth.plan.interval_ns() as f64 / 1e9;
        let faults: Vec<UnitFaultSpec> = self.faults.clone();
        let now = || {
            faults
                .iter()
                .filter(|fault| fault.unit == self.number && fault.is_at(t_s))
        };
        let delay = now().find(|fault| fault.kind == UnitFaultKind::Offset);
        let (dtheta, dv) = match delay {
            Some(fault) => self.truth.between(k, fault.magnitude),
            None => self.truth.increments[k as usize - 1],
        };
        let (dtheta, dv) =
            self.errors
                .disturb(interval_s, self.scale[0] * dtheta, self.scale[1] * dv);
        let mut all = [dtheta.x, dtheta.y, dtheta.z, dv.x, dv.y, dv.z];
        let mut is_silent = false;
        let mut stuck = [false; 6];
        for fault in now() {
            let axis = fault.axis;
            let since_s = t_s - fault.t0_s;
            match fault.kind {
                UnitFaultKind::Step => all[axis] += fault.magnitude * interval_s,
                UnitFaultKind::Drift => all[axis] += fault.magnitude * since_s * interval_s,
                UnitFaultKind::Scale => all[axis] *= 1.0 + fault.magnitude,
                UnitFaultKind::Stuck => stuck[axis] = true,
                UnitFaultKind::Noise => {
                    let more = libm::sqrt(fault.magnitude * fault.magnitude - 1.0);
                    let density = self.density[axis / 3];
                    all[axis] += more * density * libm::sqrt(interval_s) * normal(&mut self.extra);
                }
                UnitFaultKind::Silence => is_silent = true,
                UnitFaultKind::Offset => {}
            }
        }
        for ((value, last), stuck) in all.iter_mut().zip(&mut self.last).zip(stuck) {
            if stuck {
                *value = *last;
            } else {
                *last = *value;
            }
        }
        let [x, y, z, fx, fy, fz] = all;
        (!is_silent).then(|| UnitSample {
            sample: ImuSample {
                time: self.start.plus_ns(end_ns),
                interval_ns: self.truth.plan.interval_ns() as u32,
                dtheta_is_s_rad: [x, y, z],
                dv_is_s_mps: [fx, fy, fz],
            },
            is_valid: true,
            temperature_c: None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::motion::Motion;
    use super::super::trajectory::Anchor;
    use super::*;

    fn track() -> Arc<Trajectory> {
        let motion = Motion::level(70.0, 90.0)
            .turn(3.0, 23.0, 100.0, 4.0)
            .slope(5.0, 11.0, -8.0);
        let anchor = Anchor {
            at_s: 0,
            latitude_deg: 30.0,
            longitude_deg: 120.0,
            height_m: 900.0,
        };
        Arc::new(Trajectory::new(motion, &anchor, 30, 100))
    }

    #[test]
    fn a_unit_at_the_body_point_measures_what_the_body_does() {
        let track = track();
        let plan = UnitPlan {
            arm_b_m: Vector3::zeros(),
            ..UnitPlan::three()[0]
        };
        let unit = TrueUnit::new(&track, plan, 30);
        assert_eq!(unit.increments.len(), 3000);
        for k in [1, 700, 1500, 3000_usize] {
            let (dtheta, dv) = track.increments(k);
            let (own, own_dv) = unit.increments[k - 1];
            assert!((own - dtheta).norm() < 1e-13, "{k}");
            assert!((own_dv - dv).norm() < 1e-11, "{k}");
        }
    }

    /// Twice the velocity difference of two points of a turning body is what their accelerometers gather.
    #[test]
    fn a_lever_arm_adds_the_velocity_it_turns_with() {
        let track = track();
        let plan = UnitPlan::three()[1];
        let (here, there) = (
            TrueUnit::new(
                &track,
                UnitPlan {
                    arm_b_m: Vector3::zeros(),
                    ..plan
                },
                30,
            ),
            TrueUnit::new(&track, plan, 30),
        );
        // In the steady turn there is the centripetal force, and what the turning body sees of the Earth's rate.
        let k = 200 * 13;
        let (dtheta, dv) = here.increments[k];
        let (_, dv_there) = there.increments[k];
        let h = 1.0 / 200.0;
        let omega = plan.c_b_s * dtheta / h;
        let turned = here.increments[k + 1].0 - here.increments[k - 1].0;
        let alpha = plan.c_b_s * turned / (2.0 * h * h);
        let expected = omega.cross(&omega.cross(&plan.arm_b_m)) + alpha.cross(&plan.arm_b_m);
        let found = plan.c_b_s * (dv_there - dv) / h;
        assert!((found - expected).norm() < 1e-7, "{found} {expected}");
        assert!(expected.norm() > 1e-3);
    }

    #[test]
    fn each_fault_does_what_it_says_and_only_then() {
        let track = track();
        let truth = Arc::new(TrueUnit::new(&track, UnitPlan::three()[0], 30));
        let start = GpsTime::from_ns(0);
        let of = |spec: &str| {
            let mut unit = FlyingUnit::new(&truth, 0, Grade::Tactical, start, 3);
            unit.faults.push(spec.parse().unwrap());
            std::iter::from_fn(|| unit.next_end_ns().map(|_| unit.sample())).collect::<Vec<_>>()
        };
        let healthy = of("1:step:1:10:20");
        let rate = |sample: &Option<UnitSample>| sample.unwrap().sample.dtheta_is_s_rad[2] / 0.01;
        let step = of("0:step:1:10:20");
        let drift = of("0:drift:1:10:20");
        let scale = of("0:scale:0.5:10:20");
        let stuck = of("0:stuck:0:10:20");
        let silent = of("0:silence:0:10:20");
        let late = of("0:offset:0.05:10:20");
        assert_eq!(healthy[500], step[500]);
        assert_eq!(healthy[2500], late[2500]);
        let degree = 1_f64.to_radians();
        assert!((rate(&step[1500]) - rate(&healthy[1500]) - degree).abs() < 1e-12);
        let grown = rate(&drift[1499]) - rate(&healthy[1499]);
        assert!((grown - 5.0 * degree).abs() < 1e-9, "{grown}");
        assert!((rate(&scale[1500]) / rate(&healthy[1500]) - 1.5).abs() < 1e-9);
        assert_eq!(rate(&stuck[1500]), rate(&healthy[998]));
        assert!(silent[1500].is_none() && silent[500].is_some());
        assert_ne!(healthy[1200], late[1200]);
    }
}
