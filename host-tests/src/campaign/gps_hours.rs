//! The GPS sky of [P4] 3.1: six hours over Beijing, each epoch linearised at the true place, without errors.
//!
//! The paper gives the place (40.0687° N, 116.2497° E, 100 m), six hours and 11 satellites on average, and
//! neither almanac nor date. Here the sky is the simulator's ([`crate::simulate::sky`], 24 slots of GPS) from
//! the start of its week on, and sigmas are the simulator's by elevation.

use nalgebra::{Matrix3, Vector3};
use rand_chacha::rand_core::Rng;
use surefix_core::gnss::System;
use surefix_core::gnss::solution::UsedRow;
use surefix_core::gnss::weights::RowSigma;
use surefix_core::linalg::LinearModel;
use surefix_core::time::GpsTime;

use crate::simulate::disturbances::Disturbances;
use crate::simulate::inertial::earth;
use crate::simulate::inertial::measurements::Measurer;
use crate::simulate::inertial::trajectory::State;
use crate::simulate::noise::normal;
use crate::simulate::sky::WEEK;

/// Latitude and longitude, degrees, and height, m. [P4] 3.1
pub const PLACE: (f64, f64, f64) = (40.0687, 116.2497, 100.0);
/// Length, s. [P4] 3.2
pub const DURATION_S: u32 = 6 * 3600;

/// What a monitor of one epoch takes.
#[derive(Clone, Debug)]
pub struct SkyEpoch {
    /// Since the start, s.
    pub t_s: f64,
    /// Residuals zero, sigmas of the whole error.
    pub model: LinearModel,
    /// Its rows.
    pub rows: Vec<UsedRow>,
}

impl SkyEpoch {
    /// The model with an error of one sigma on each row.
    pub fn noisy(&self, random: &mut impl Rng) -> LinearModel {
        let mut model = self.model.clone();
        let rows = model.residual_m.iter_mut().zip(&model.sigma_m);
        for (residual_m, sigma_m) in rows.take(model.n) {
            *residual_m += sigma_m * normal(random);
        }
        model
    }
}

/// The GPS satellites above a mask, from the first second on in steps.
pub fn epochs(mask_deg: f64, step_s: u32) -> Vec<SkyEpoch> {
    let (latitude_deg, longitude_deg, height_m) = PLACE;
    let (r_eb_e, c_e_n) = earth::frame(
        latitude_deg.to_radians(),
        longitude_deg.to_radians(),
        height_m,
    );
    let state = State {
        r_eb_e,
        v_eb_e: Vector3::zeros(),
        c_e_b: c_e_n,
        c_e_n,
    };
    let start = GpsTime::from_week_tow_s(WEEK, 0);
    // Without noise: the seed is of no consequence.
    let mut measurer = Measurer::new(start, 0, true, false, &[], &[], &Disturbances::default());
    (0..DURATION_S)
        .step_by(step_s as usize)
        .map(|second| epoch(&mut measurer, f64::from(second), &state, mask_deg))
        .collect()
}

fn epoch(measurer: &mut Measurer, t_s: f64, state: &State, mask_deg: f64) -> SkyEpoch {
    let to_enu: Matrix3<f64> = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
    let mut model = LinearModel::EMPTY;
    model.m = 4;
    let mut rows = Vec::new();
    for row in measurer.measure(t_s, state, (0.0, 0.0)).rows {
        let seen = &row.measurement;
        let is_taken =
            seen.satellite.system() == System::Gps && row.elevation_rad >= mask_deg.to_radians();
        if !is_taken {
            continue;
        }
        let line_e = (Vector3::from(seen.r_es_e_m) - state.r_eb_e).normalize();
        let line_enu = to_enu * state.c_e_n.transpose() * line_e;
        let [east, north, up] = line_enu.into();
        model.design[model.n][..4].copy_from_slice(&[-east, -north, -up, 1.0]);
        model.sigma_m[model.n] = seen.sigma_pseudorange_m;
        model.n += 1;
        rows.push(UsedRow {
            satellite: seen.satellite,
            elevation_rad: row.elevation_rad,
            azimuth_rad: libm::atan2(east, north),
            sigma: RowSigma {
                independent_m: seen.sigma_pseudorange_m,
                common_m: 0.0,
            },
        });
    }
    SkyEpoch { t_s, model, rows }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn six_hours_have_about_as_many_satellites_as_the_paper_and_directions_of_unit_length() {
        let epochs = epochs(5.0, 300);
        assert_eq!(epochs.len(), 72);
        let mean = epochs.iter().map(|epoch| epoch.model.n as f64).sum::<f64>() / 72.0;
        assert!((7.0..12.0).contains(&mean), "{mean}");
        for epoch in &epochs {
            for (design, row) in epoch.model.design.iter().zip(&epoch.rows) {
                let [east, north, up, clock, ..] = *design;
                let length = (east * east + north * north + up * up).sqrt();
                assert!((length - 1.0).abs() < 1e-12 && clock == 1.0);
                // The simulator takes the elevation over the true horizon to fifteen digits.
                assert!((-up - row.elevation_rad.sin()).abs() < 1e-9);
                assert!(row.elevation_rad >= 5.0_f64.to_radians());
            }
        }
        let higher = super::epochs(10.0, 300);
        assert!(
            higher
                .iter()
                .zip(&epochs)
                .all(|(a, b)| a.model.n <= b.model.n)
        );
    }
}
