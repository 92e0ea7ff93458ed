//! A height from elsewhere as one more satellite, at the centre of the Earth.
//!
//! In: a height of the antenna above the ellipsoid. Out: one row of the solution and its linear model.
//!
//! | symbol | code        | unit | frame | meaning                                       |
//! |--------|-------------|------|-------|-----------------------------------------------|
//! | n      | up          | 1    | e     | normal of the ellipsoid at the antenna        |
//! | h      | height_m    | m    |       | height measured                               |
//!
//! Equations: the satellite of [P0]'s introduction stands at the centre of the Earth and has no clock: its
//! line of sight is −n, so that its row is y = n·δr + error with y = h − h(r). The normal of the ellipsoid
//! takes the place of the radius, from which it is up to 0.2° away: that is what a height is measured along.
//!
//! It takes part only where the satellites leave a redundancy of one at the most: with more, they test
//! each other, and it is they that it is calibrated against (`snapshot/height.rs`).

use nalgebra::Vector3;

use super::{Normals, SnapshotWorkspace};
use crate::consts::MAX_UNKNOWNS;
use crate::frames::geodesy;

/// A height of the antenna.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeightRow {
    /// Above the ellipsoid, m.
    pub height_m: f64,
    /// One sigma, m.
    pub sigma_m: f64,
}

impl HeightRow {
    fn is_usable(&self) -> bool {
        self.height_m.is_finite() && self.sigma_m > 0.0 && self.sigma_m.is_finite()
    }
}

impl SnapshotWorkspace {
    /// Gives a height that may be used from now on, or none.
    pub fn offer_height(&mut self, height: Option<HeightRow>) {
        self.height = height.filter(HeightRow::is_usable);
    }

    /// Whether the last solution has a row of a height: the last of its linear model.
    pub const fn uses_height(&self) -> bool {
        self.uses_height
    }

    /// A start from the centre of the Earth has no use for a height.
    pub(super) fn choose_height(&mut self, masked: bool, satellites: u8, unknowns: u8) {
        self.uses_height = masked && self.height.is_some() && satellites <= unknowns + 1;
    }

    pub(super) fn add_height(&self, normals: &mut Normals, r_e: [f64; 3]) {
        if !self.uses_height {
            return;
        }
        let (Some(height), Ok(llh)) = (self.height, geodesy::to_llh(&Vector3::from(r_e))) else {
            return;
        };
        let up = geodesy::c_enu_e(llh.lat_rad, llh.lon_rad)
            .row(2)
            .transpose();
        normals.add_position(
            up.into(),
            height.height_m - llh.height_m,
            1.0 / (height.sigma_m * height.sigma_m),
        );
    }

    /// The last row of the linear model, after those of the satellites; the solution is at `height_m`.
    pub(super) fn write_height(&mut self, height_m: f64) {
        let Some(height) = self.height.filter(|_| self.uses_height) else {
            return;
        };
        let model = &mut self.model;
        let places = (
            model.design.get_mut(model.n),
            model.residual_m.get_mut(model.n),
            model.sigma_m.get_mut(model.n),
        );
        if let (Some(design), Some(residual_m), Some(sigma_m)) = places {
            *design = [0.0; MAX_UNKNOWNS];
            if let Some(up) = design.get_mut(2) {
                *up = 1.0;
            }
            *residual_m = height.height_m - height_m;
            *sigma_m = height.sigma_m;
            model.n += 1;
        }
    }
}
