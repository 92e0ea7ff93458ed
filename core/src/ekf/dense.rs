//! The same filter as dense 17×17 matrices, for the unit tests beside it.

use nalgebra::{SMatrix, SVector};

use super::filter::{ErrorState, Filter};
use super::layout::BLOCKS;
use super::transition::{NavigationCovariance, NavigationTransition, Transition};
use crate::linalg::block3::full;

/// Clocks, joint block and states of the tests.
pub const K: usize = 2;
pub const M: usize = 8;
pub const N: usize = 17;
pub type Matrix = SMatrix<f64, N, N>;
pub type Vector = SVector<f64, N>;

/// Numbers between −½ and ½ that look random: a linear congruential generator with Knuth's constants.
pub struct Noise(pub u64);

impl Noise {
    pub fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    }
}

pub fn navigation(p: &NavigationCovariance) -> SMatrix<f64, 15, 15> {
    let mut m = SMatrix::<f64, 15, 15>::zeros();
    let mut off = p.off_diagonal.iter();
    for a in 0..BLOCKS {
        let d = full(&p.diagonal[a]);
        for i in 0..3 {
            for j in 0..3 {
                m[(3 * a + i, 3 * a + j)] = d[3 * i + j];
            }
        }
        for b in a + 1..BLOCKS {
            let o = off.next().unwrap();
            for i in 0..3 {
                for j in 0..3 {
                    m[(3 * a + i, 3 * b + j)] = o[3 * i + j];
                    m[(3 * b + j, 3 * a + i)] = o[3 * i + j];
                }
            }
        }
    }
    m
}

pub fn covariance(f: &Filter<K, M>) -> Matrix {
    let mut m = Matrix::zeros();
    m.fixed_view_mut::<15, 15>(0, 0)
        .copy_from(&navigation(&f.covariance));
    for (a, columns) in f.cross.iter().enumerate() {
        for (k, column) in columns.iter().enumerate() {
            for (i, entry) in column.iter().enumerate() {
                m[(3 * a + i, 15 + k)] = *entry;
                m[(15 + k, 3 * a + i)] = *entry;
            }
        }
    }
    for k in 0..K {
        for l in 0..K {
            m[(15 + k, 15 + l)] = f.clock[k][l];
        }
    }
    m
}

pub fn state(s: &ErrorState<K>) -> Vector {
    let mut v = Vector::zeros();
    for (i, entry) in s.navigation.iter().flatten().chain(&s.clock).enumerate() {
        v[i] = *entry;
    }
    v
}

pub fn transition(phi: &NavigationTransition) -> SMatrix<f64, 15, 15> {
    let mut m = SMatrix::<f64, 15, 15>::identity();
    let mut put = |a: usize, b: usize, block: &[f64; 9]| {
        for i in 0..3 {
            for j in 0..3 {
                m[(3 * a + i, 3 * b + j)] = block[3 * i + j];
            }
        }
    };
    for b in 0..BLOCKS {
        put(0, b, &phi.position[b]);
        put(1, b, &phi.velocity[b]);
    }
    put(2, 2, &phi.attitude[0]);
    put(2, 3, &phi.attitude[1]);
    m
}

pub fn whole_transition(t: &Transition) -> (Matrix, Matrix) {
    let mut phi = Matrix::identity();
    phi.fixed_view_mut::<15, 15>(0, 0)
        .copy_from(&transition(&t.phi));
    phi[(15, 16)] = t.clock.bias_per_drift_s;
    phi[(16, 16)] = t.clock.decay;
    let mut q = Matrix::zeros();
    q.fixed_view_mut::<15, 15>(0, 0)
        .copy_from(&navigation(&t.noise));
    q[(15, 15)] = t.clock.bias_var;
    q[(15, 16)] = t.clock.bias_drift_cov;
    q[(16, 15)] = t.clock.bias_drift_cov;
    q[(16, 16)] = t.clock.drift_var;
    (phi, q)
}

/// A filter with a full random covariance and state.
pub fn random_filter(noise: &mut Noise) -> Filter<K, M> {
    let a = Matrix::from_fn(|_, _| noise.next());
    let p = a * a.transpose() + Matrix::identity() * 0.1;
    let mut f = Filter::EMPTY;
    let mut off = 0;
    for a in 0..BLOCKS {
        let (mut at, r) = (0, 3 * a);
        for i in 0..3 {
            for j in i..3 {
                f.covariance.diagonal[a][at] = p[(r + i, r + j)];
                at += 1;
            }
        }
        for b in a + 1..BLOCKS {
            for i in 0..3 {
                for j in 0..3 {
                    f.covariance.off_diagonal[off][3 * i + j] = p[(r + i, 3 * b + j)];
                }
            }
            off += 1;
        }
        for k in 0..K {
            for i in 0..3 {
                f.cross[a][k][i] = p[(r + i, 15 + k)];
            }
        }
    }
    for k in 0..K {
        for l in 0..K {
            f.clock[k][l] = p[(15 + k, 15 + l)];
        }
        f.state.clock[k] = noise.next();
    }
    for entry in f.state.navigation.iter_mut().flatten() {
        *entry = noise.next();
    }
    f
}

pub fn random_block(noise: &mut Noise) -> [f64; 9] {
    core::array::from_fn(|_| noise.next())
}
