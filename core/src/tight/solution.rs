//! What the filter knows, as a report takes it.

use nalgebra::{Matrix3, Vector3};

use super::{CLOCKS, TightMonitor, TightSolution};
use crate::ekf::UpdateSummary;
use crate::ekf::layout::{ATTITUDE, POSITION, VELOCITY};
use crate::ekf::navigator::AntennaState;
use crate::frames::{geodesy, rotation};
use crate::gnss::{SatelliteSet, System};
use crate::linalg::block3::Symmetric;
use crate::report::Navigation;

impl TightMonitor {
    pub(super) fn solution(
        &self,
        at: &AntennaState<CLOCKS>,
        summary: &UpdateSummary,
        used: SatelliteSet,
        present: [bool; System::ALL.len()],
    ) -> Option<TightSolution> {
        let llh = geodesy::to_llh(&Vector3::from(at.r_e_m)).ok()?;
        let c_enu_e = geodesy::c_enu_e(llh.lat_rad, llh.lon_rad);
        let c_e_b = rotation::to_matrix(&at.q_e_b);
        let c_n_b = rotation::c_e_n(llh.lat_rad, llh.lon_rad).transpose() * c_e_b;
        let filter = self.navigator.filter();
        let enu = |block: usize| -> [[f64; 3]; 3] {
            let p = symmetric(&filter.block(block));
            (c_enu_e * p * c_enu_e.transpose()).into()
        };
        let sigmas = |p: [[f64; 3]; 3]| -> [f64; 3] {
            let [[e, ..], [_, n, _], [.., u]] = p;
            [libm::sqrt(e), libm::sqrt(n), libm::sqrt(u)]
        };
        let position = enu(POSITION);
        let [[ee, en, _], [_, nn, _], [.., uu]] = position;
        let half = 0.5 * (ee - nn);
        let largest = 0.5 * (ee + nn) + libm::sqrt(half * half + en * en);
        let [bias, drift, ..] = at.clock;
        let mut clock_m = [None; System::ALL.len()];
        for ((clock_m, present), column) in clock_m.iter_mut().zip(present).zip(self.systems) {
            let offset_m = column
                .filter(|_| self.reference.is_none())
                .and_then(|column| at.clock.get(column));
            *clock_m = present.then_some(bias + offset_m.copied().unwrap_or(0.0));
        }
        Some(TightSolution {
            r_e_m: at.r_e_m,
            llh,
            velocity_enu_mps: (c_enu_e * Vector3::from(at.v_e_mps)).into(),
            clock_m,
            used,
            navigation: Navigation {
                v_e_mps: at.v_e_mps,
                q_e_b: at.q_e_b,
                roll_pitch_heading_deg: rotation::roll_pitch_heading(&c_n_b).map(f64::to_degrees),
                clock: [bias, drift],
                sigma_position_enu_m: sigmas(position),
                sigma_velocity_enu_mps: sigmas(enu(VELOCITY)),
                sigma_attitude_enu_deg: sigmas(enu(ATTITUDE)).map(f64::to_degrees),
                fault_free_m: [
                    self.k_fault_free * libm::sqrt(largest),
                    self.k_fault_free * libm::sqrt(uu),
                ],
                nis: summary.nis,
                nis_rows: u8::try_from(summary.rows).unwrap_or(u8::MAX),
            },
        })
    }
}

impl TightMonitor {
    /// One sigma of the attitude about local north, east, down, rad, while the filter runs.
    pub fn sigma_attitude_ned_rad(&self) -> Option<[f64; 3]> {
        if !self.is_running() {
            return None;
        }
        let r_e = self.navigator.mechanisation().r_eb_e;
        let llh = geodesy::to_llh(&r_e).ok()?;
        let c_e_n = rotation::c_e_n(llh.lat_rad, llh.lon_rad);
        let p = symmetric(&self.navigator.filter().block(ATTITUDE));
        let [[n, ..], [_, e, _], [.., d]] = (c_e_n.transpose() * p * c_e_n).into();
        Some([libm::sqrt(n), libm::sqrt(e), libm::sqrt(d)])
    }
}

pub(super) fn symmetric(s: &Symmetric) -> Matrix3<f64> {
    let [xx, xy, xz, yy, yz, zz] = *s;
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}
