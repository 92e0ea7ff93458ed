//! Random skies, and faults in them.

use std::f64::consts::TAU;

use rand_chacha::rand_core::Rng;
use surefix_core::gnss::solution::UsedRow;
use surefix_core::gnss::weights::RowSigma;
use surefix_core::gnss::{Satellite, System};
use surefix_core::linalg::LinearModel;

use crate::campaign::gps_hours::SkyEpoch;
use crate::simulate::inertial::measurements::sigma_pseudorange_m;
use crate::simulate::noise::uniform;

/// Sine of the mask, 5°.
const SIN_MASK: f64 = 0.087_155_742_747_658_17;

/// The constellations of a sky by their number.
const SYSTEMS: [&[System]; 3] = [
    &[System::Gps],
    &[System::Gps, System::Galileo],
    &[System::Gps, System::Galileo, System::Bds],
];

/// BDS satellites from this number on are not geostationary.
const FIRST_PRN: u8 = 6;

/// `n` satellites evenly over the sky above 5°, of 1 to 3 constellations in turn; sigmas are those of the
/// simulator, residuals zero.
pub fn sky(random: &mut impl Rng, n: usize, constellations: usize) -> SkyEpoch {
    let systems = SYSTEMS[constellations - 1];
    let mut model = LinearModel::EMPTY;
    (model.n, model.m) = (n, 3 + constellations);
    let mut rows = Vec::with_capacity(n);
    for row in 0..n {
        let clock = row % constellations;
        let sin_elevation = SIN_MASK + (1.0 - SIN_MASK) * uniform(random);
        let across = libm::sqrt(1.0 - sin_elevation * sin_elevation);
        let azimuth_rad = TAU * uniform(random);
        let elevation_rad = libm::asin(sin_elevation);
        let prn = FIRST_PRN + (row / constellations) as u8;
        let Some(satellite) = Satellite::new(systems[clock], prn) else {
            continue;
        };
        let sigma_m = sigma_pseudorange_m(satellite, elevation_rad);
        model.design[row][..3].copy_from_slice(&[
            -across * libm::sin(azimuth_rad),
            -across * libm::cos(azimuth_rad),
            -sin_elevation,
        ]);
        model.design[row][3 + clock] = 1.0;
        model.sigma_m[row] = sigma_m;
        rows.push(UsedRow {
            satellite,
            elevation_rad,
            azimuth_rad,
            sigma: RowSigma {
                independent_m: sigma_m,
                common_m: 0.0,
            },
        });
    }
    SkyEpoch {
        t_s: 0.0,
        model,
        rows,
    }
}

/// Different rows drawn at random.
pub fn drawn_rows(random: &mut impl Rng, n: usize, count: usize) -> Vec<usize> {
    let mut left: Vec<usize> = (0..n).collect();
    (0..count.min(n))
        .map(|_| left.swap_remove((uniform(random) * left.len() as f64) as usize))
        .collect()
}

/// A size within limits, of either sign.
pub fn signed_size_m(random: &mut impl Rng, [least_m, most_m]: [f64; 2]) -> f64 {
    let sign = if uniform(random) < 0.5 { -1.0 } else { 1.0 };
    sign * (least_m + (most_m - least_m) * uniform(random))
}
