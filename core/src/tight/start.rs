//! How the filter starts from a snapshot solution and an attitude.

use nalgebra::Vector3;

use super::earned::Earned;
use super::{
    LEVEL_SIGMAS, MAX_ATTITUDE_AGE_NS, NEW_OFFSET_SIGMA_M, RESTART_SIGMA_NED_RAD, TestedSolution,
    TightMonitor,
};
use crate::frames::{geodesy, rotation};
use crate::ins::alignment::{
    Aligned, AlignmentEpoch, AlignmentMode, NotAligned, Obstacle, is_slow,
};
use crate::ins::{AttitudeStart, InertialConfig, InitialState};
use crate::integrity::InertialStatus;
use crate::time::GpsTime;

impl TightMonitor {
    /// Tries to start the filter at an epoch that it did not serve, from a snapshot solution that a fault
    /// would have been seen in; with one sigma of its velocity.
    #[inline(never)]
    pub(crate) fn align(
        &mut self,
        time: GpsTime,
        tested: Option<&TestedSolution<'_>>,
        sigma_enu_mps: &[f64; 3],
    ) {
        let Some(config) = self.config else {
            return;
        };
        if self.reference.is_some() || self.is_running() {
            return;
        }
        let v_enu = tested
            .and_then(|tested| tested.solution.velocity_enu_mps)
            .map(Vector3::from);
        self.keep_attitude(time, &config, v_enu.as_ref(), sigma_enu_mps);
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
            self.obstacle = Obstacle::NoTestedPosition;
            return;
        };
        let r_e = Vector3::from(solution.r_e_m);
        let mut config = config;
        let found = self.alignment.epoch(&AlignmentEpoch {
            time,
            r_e,
            v_enu,
            sigma_enu_mps: *sigma_enu_mps,
        });
        let found = found.or_else(|why| self.kept(time, &r_e, why).ok_or(why));
        let Aligned {
            q_e_b,
            sigma_ned_rad,
            mode,
        } = match found {
            Ok(aligned) => aligned,
            Err(why) => {
                self.obstacle = why.into();
                return;
            }
        };
        config.sigma.attitude_ned_rad = sigma_ned_rad;
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
        self.earned = Earned::start(mode, &sigma_ned_rad);
    }

    /// While the unit stands, the attitude of when tight mode ended stays what it is. That a unit stands the receiver
    /// says, and its own samples; where they are missing nobody sees whether it turns on the spot, but one
    /// whose attitude was given is mounted on what does not.
    fn keep_attitude(
        &mut self,
        time: GpsTime,
        config: &InertialConfig,
        v_enu: Option<&Vector3<f64>>,
        sigma_enu_mps: &[f64; 3],
    ) {
        let stands =
            self.alignment.rest_s() > 0.0 || matches!(config.start, AttitudeStart::Given { .. });
        if let Some(v_enu) = v_enu
            && stands
            && is_slow(v_enu, sigma_enu_mps)
            && let Some(q_e_b) = self.recent_attitude(time)
        {
            self.last_attitude = Some((q_e_b, time));
        }
    }

    /// The attitude of before, where there is none of now: levelled by a unit that stands, as it was by one that
    /// nearly does.
    fn kept(&self, time: GpsTime, r_e: &Vector3<f64>, why: NotAligned) -> Option<Aligned> {
        let q_e_b = self.recent_attitude(time)?;
        let llh = geodesy::to_llh(r_e).ok()?;
        let c_e_n = rotation::c_e_n(llh.lat_rad, llh.lon_rad);
        let c_n_b = c_e_n.transpose() * rotation::to_matrix(&q_e_b);
        let [.., heading_rad] = rotation::roll_pitch_heading(&c_n_b);
        let [.., sigma_heading_rad] = RESTART_SIGMA_NED_RAD;
        if let Ok(levelled) = self
            .alignment
            .with_heading(r_e, heading_rad, sigma_heading_rad)
        {
            return Some(levelled);
        }
        matches!(why, NotAligned::TooSlow { .. }).then_some(Aligned {
            q_e_b,
            sigma_ned_rad: RESTART_SIGMA_NED_RAD,
            mode: AlignmentMode::Kept,
        })
    }

    /// The attitude of when tight mode ended, if that was not long before `time`.
    pub(super) fn recent_attitude(&self, time: GpsTime) -> Option<[f64; 4]> {
        let (q_e_b, when) = self.last_attitude?;
        let age_ns = time.ns().saturating_sub(when.ns());
        (0..=MAX_ATTITUDE_AGE_NS).contains(&age_ns).then_some(q_e_b)
    }
}
