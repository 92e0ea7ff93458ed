//! How far two filters are apart, by the recursion that holds for any two gains: [P0] (27).
//!
//! Two filters of the same process, the second without some of the measurements of the first. Beside the
//! covariance of each one's error that of both together is carried on; the covariance of their
//! separation is then P_0 + P_n − P_0n − P_0nᵀ.

use nalgebra::SMatrix;

/// Covariances of the errors of two filters.
#[derive(Clone, Debug, PartialEq)]
pub struct Nested<const N: usize> {
    /// What each filter computes its gain from.
    pub believed: [SMatrix<f64, N, N>; 2],
    /// Covariance of each one's error.
    pub actual: [SMatrix<f64, N, N>; 2],
    /// Covariance of the first one's error with the second one's.
    pub cross: SMatrix<f64, N, N>,
}

/// Measurements of an epoch.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurements<const M: usize, const N: usize> {
    /// Measurement matrix.
    pub h: SMatrix<f64, M, N>,
    /// Variances of the noise.
    pub variance: [f64; M],
    /// Variances that each filter takes them for; `None` where it does not take the measurement.
    pub believed: [[Option<f64>; M]; 2],
}

impl<const N: usize> Nested<N> {
    /// Both start from the same estimate.
    pub fn same(p: SMatrix<f64, N, N>) -> Self {
        Self {
            believed: [p; 2],
            actual: [p; 2],
            cross: p,
        }
    }

    /// P ← Φ P Φᵀ + Q for all of them: the process noise is common.
    pub fn predict(&mut self, phi: &SMatrix<f64, N, N>, q: &SMatrix<f64, N, N>) {
        let [b0, b1] = &mut self.believed;
        let [a0, a1] = &mut self.actual;
        for p in [b0, b1, a0, a1, &mut self.cross] {
            *p = phi * *p * phi.transpose() + q;
        }
    }

    /// Each filter takes its measurements, all at once.
    pub fn update<const M: usize>(&mut self, epoch: &Measurements<M, N>) {
        let noise = SMatrix::<f64, M, M>::from_diagonal(&epoch.variance.into());
        let mut gains = [SMatrix::<f64, N, M>::zeros(); 2];
        let mut keeps = [SMatrix::<f64, N, N>::identity(); 2];
        for k in 0..2 {
            let mut h = epoch.h;
            let mut r = SMatrix::<f64, M, M>::identity();
            for (row, variance) in epoch.believed[k].iter().enumerate() {
                match variance {
                    Some(variance) => r[(row, row)] = *variance,
                    None => h.row_mut(row).fill(0.0),
                }
            }
            let p = &self.believed[k];
            let s = h * p * h.transpose() + r;
            let inverse = s
                .try_inverse()
                .expect("a covariance with its noise is regular");
            let gain = p * h.transpose() * inverse;
            let keep = SMatrix::<f64, N, N>::identity() - gain * epoch.h;
            self.believed[k] = keep * p * keep.transpose() + gain * r * gain.transpose();
            self.actual[k] =
                keep * self.actual[k] * keep.transpose() + gain * noise * gain.transpose();
            gains[k] = gain;
            keeps[k] = keep;
        }
        self.cross =
            keeps[0] * self.cross * keeps[1].transpose() + gains[0] * noise * gains[1].transpose();
    }

    /// Covariance of the separation.
    pub fn separation(&self) -> SMatrix<f64, N, N> {
        self.actual[0] + self.actual[1] - self.cross - self.cross.transpose()
    }

    /// The same where the first gain is optimal and both started from one estimate.
    pub fn difference(&self) -> SMatrix<f64, N, N> {
        self.actual[1] - self.actual[0]
    }
}
