//! Random skies for property tests: a fixed seed gives the same sky on every machine.

#![allow(
    dead_code,
    reason = "each test that includes this module uses its part of it"
)]

use surefix_core::gnss::solution::UsedRow;
use surefix_core::gnss::weights::RowSigma;
use surefix_core::gnss::{Satellite, System};
use surefix_core::linalg::LinearModel;

/// SplitMix64 (Steele, Lea, Flood 2014) with uniform and normal numbers on top.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    pub fn uniform(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// In low..=high.
    pub fn integer(&mut self, low: usize, high: usize) -> usize {
        low + (self.next() % (high - low + 1) as u64) as usize
    }

    /// Standard normal (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// n satellites above 5°, uniform on the hemisphere, of `clocks` constellations with at least one
/// satellite each; sigmas between 1 and 4 m, growing towards the horizon; residuals zero.
pub fn sky(random: &mut Random, n: usize, clocks: usize) -> LinearModel {
    let mut model = LinearModel::EMPTY;
    model.n = n;
    model.m = 3 + clocks;
    for i in 0..n {
        let azimuth = std::f64::consts::TAU * random.uniform();
        let sine = 0.087 + (1.0 - 0.087) * random.uniform();
        let cosine = (1.0 - sine * sine).sqrt();
        model.design[i][0] = -azimuth.sin() * cosine;
        model.design[i][1] = -azimuth.cos() * cosine;
        model.design[i][2] = -sine;
        let clock = if i < clocks {
            i
        } else {
            random.integer(0, clocks - 1)
        };
        model.design[i][3 + clock] = 1.0;
        model.sigma_m[i] = (0.7 + 0.3 / sine).min(4.0);
    }
    model
}

/// Residuals of an estimate error of kilometres and of errors of one sigma.
pub fn add_noise(random: &mut Random, model: &mut LinearModel) {
    let shift: Vec<f64> = (0..model.m).map(|_| 1e3 * random.normal()).collect();
    for i in 0..model.n {
        model.residual_m[i] = model.sigma_m[i] * random.normal()
            + (0..model.m)
                .map(|j| model.design[i][j] * shift[j])
                .sum::<f64>();
    }
}

/// What the rows of a random sky belong to.
pub fn rows_of(model: &LinearModel) -> Vec<UsedRow> {
    (0..model.n)
        .map(|row| {
            let clock = (3..model.m)
                .find(|column| model.design[row][*column] != 0.0)
                .unwrap();
            UsedRow {
                satellite: Satellite::new(System::ALL[clock - 3], row as u8 + 1).unwrap(),
                elevation_rad: (-model.design[row][2]).asin(),
                azimuth_rad: (-model.design[row][0]).atan2(-model.design[row][1]),
                sigma: RowSigma {
                    independent_m: model.sigma_m[row],
                    common_m: 0.0,
                },
            }
        })
        .collect()
}
