//! How the filter starts from a snapshot solution and an attitude.

use nalgebra::Vector3;

use super::{
    LEVEL_SIGMAS, MAX_ATTITUDE_AGE_NS, NEW_OFFSET_SIGMA_M, RESTART_SIGMA_NED_RAD, TestedSolution,
    TightMonitor,
};
use crate::frames::{geodesy, rotation};
use crate::ins::InitialState;
use crate::ins::alignment::{AlignmentMode, NotAligned};
use crate::integrity::InertialStatus;
use crate::time::GpsTime;

impl TightMonitor {
    /// Tries to start the filter at an epoch that it did not serve, from a snapshot solution that a fault
    /// would have been seen in.
    #[inline(never)]
    pub(crate) fn align(&mut self, time: GpsTime, tested: Option<&TestedSolution<'_>>) {
        let Some(config) = self.config else {
            return;
        };
        if self.reference.is_some() || self.is_running() {
            return;
        }
        if let Some(missing) = self.missing {
            self.status = missing;
            self.alignment.restart();
            return;
        }
        let Some(last) = self.horizon.reached() else {
            return;
        };
        self.status = InertialStatus::Aligning;
        let Some(TestedSolution { solution, levels_m }) = tested else {
            return;
        };
        let r_e = Vector3::from(solution.r_e_m);
        let v_enu = solution.velocity_enu_mps.map(Vector3::from);
        let mut config = config;
        let mut mode = self.alignment.mode();
        let q_e_b = match self.alignment.epoch(time, &r_e, v_enu.as_ref()) {
            Ok(q_e_b) => q_e_b,
            // Standing or nearly so: the attitude is about what it was.
            Err(NotAligned::TooSlow { .. }) => {
                let Some(q_e_b) = self.recent_attitude(time) else {
                    return;
                };
                config.sigma.attitude_ned_rad = RESTART_SIGMA_NED_RAD;
                mode = AlignmentMode::Kept;
                q_e_b
            }
            Err(_) => return,
        };
        let (Some(v_enu), Some(drift_mps)) = (v_enu, solution.clock_drift_mps) else {
            return;
        };
        let c_enu_e = geodesy::c_enu_e(solution.llh.lat_rad, solution.llh.lon_rad);
        let v_e = c_enu_e.transpose() * v_enu;
        let lead_s = time.seconds_since(last);
        let arm_e = rotation::to_matrix(&q_e_b) * Vector3::from(config.lever_arm_b_m);
        let reference_clock = solution
            .clock_m
            .get(self.reference_system)
            .copied()
            .flatten();
        let clock_m = solution.clock_m.iter().copied().flatten().next();
        let Some(clock_bias_m) = reference_clock.or(clock_m) else {
            return;
        };
        if reference_clock.is_none() {
            config.sigma.clock_bias_m = NEW_OFFSET_SIGMA_M;
        }
        for level_m in levels_m {
            if *level_m > LEVEL_SIGMAS * config.sigma.position_m {
                config.sigma.position_m = level_m / LEVEL_SIGMAS;
            }
        }
        self.alignment_mode = mode;
        self.start_with(
            &config,
            &InitialState {
                time: last,
                r_eb_e_m: (r_e - arm_e - v_e * lead_s).into(),
                v_eb_e_mps: v_e.into(),
                q_e_b,
                gyro_bias_radps: [0.0; 3],
                accel_bias_mps2: [0.0; 3],
                clock_bias_m: clock_bias_m - drift_mps * lead_s,
                clock_drift_mps: drift_mps,
            },
        );
    }

    /// The attitude of when tight mode ended, if that was not long before `time`.
    pub(super) fn recent_attitude(&self, time: GpsTime) -> Option<[f64; 4]> {
        let (q_e_b, when) = self.last_attitude?;
        let age_ns = time.ns().saturating_sub(when.ns());
        (0..=MAX_ATTITUDE_AGE_NS).contains(&age_ns).then_some(q_e_b)
    }
}
