//! The same filter as a textbook writes it, and as a matrix library's expressions: peers of core's.
//!
//! Both hold the whole 17×17 covariance and know nothing of its blocks. The plain one takes one row
//! after the other with the gain P hᵀ/(h P hᵀ + r), the expressions take all rows at once.

use nalgebra::{ArrayStorage, SMatrix, SVector};

/// States: 15 and two clocks.
pub const STATES: usize = 17;
/// Rows of an update: pseudorange and range rate of twelve satellites.
pub const ROWS: usize = 24;

/// By rows.
pub type Matrix = [[f64; STATES]; STATES];
/// No entries.
pub const ZERO: Matrix = [[0.0; STATES]; STATES];

type State = SVector<f64, STATES>;
type Square = SMatrix<f64, STATES, STATES>;
type Design = SMatrix<f64, ROWS, STATES>;

/// Both filters and what they are fed with.
pub struct Peers {
    phi: Matrix,
    noise: Matrix,
    design: [[f64; STATES]; ROWS],
    innovation: [f64; ROWS],
    variance: [f64; ROWS],
    covariance: Matrix,
    state: [f64; STATES],
    product: Matrix,
    expression_phi: Square,
    expression_noise: Square,
    expression_design: Design,
    expression_covariance: Square,
    expression_state: State,
}

impl Peers {
    /// Nothing set.
    pub const EMPTY: Self = Self {
        phi: ZERO,
        noise: ZERO,
        design: [[0.0; STATES]; ROWS],
        innovation: [0.0; ROWS],
        variance: [1.0; ROWS],
        covariance: ZERO,
        state: [0.0; STATES],
        product: ZERO,
        expression_phi: Square::from_array_storage(ArrayStorage(ZERO)),
        expression_noise: Square::from_array_storage(ArrayStorage(ZERO)),
        expression_design: Design::from_array_storage(ArrayStorage([[0.0; ROWS]; STATES])),
        expression_covariance: Square::from_array_storage(ArrayStorage(ZERO)),
        expression_state: State::from_array_storage(ArrayStorage([[0.0; STATES]])),
    };

    /// Φ and Q.
    pub fn set_transition(&mut self, phi: &Matrix, noise: &Matrix) {
        self.phi = *phi;
        self.noise = *noise;
        self.expression_phi = square(phi);
        self.expression_noise = square(noise);
    }

    /// Where both start from.
    pub fn set(&mut self, covariance: &Matrix, state: &[f64; STATES]) {
        self.covariance = *covariance;
        self.state = *state;
        self.expression_covariance = square(covariance);
        self.expression_state = State::from(*state);
    }

    /// A row of the next update; `weight` is 1/σ².
    pub fn set_row(&mut self, at: usize, h: &[f64; STATES], innovation: f64, weight: f64) {
        self.design[at] = *h;
        self.innovation[at] = innovation;
        self.variance[at] = 1.0 / weight;
        for (column, entry) in h.iter().enumerate() {
            self.expression_design[(at, column)] = *entry;
        }
    }

    /// Whether both hold this covariance, to a millionth of the sigmas.
    pub fn agree_with(&self, covariance: &Matrix) -> bool {
        (0..STATES).all(|i| {
            (0..STATES).all(|j| {
                let scale = libm::sqrt(covariance[i][i] * covariance[j][j]);
                let near = |value: f64| libm::fabs(value - covariance[i][j]) <= 1e-6 * scale;
                near(self.covariance[i][j]) && near(self.expression_covariance[(i, j)])
            })
        })
    }

    /// P ← Φ P Φᵀ + Q in plain loops.
    #[inline(never)]
    pub fn plain_predict(&mut self) {
        for i in 0..STATES {
            for j in 0..STATES {
                let mut sum = 0.0;
                for k in 0..STATES {
                    sum += self.phi[i][k] * self.covariance[k][j];
                }
                self.product[i][j] = sum;
            }
        }
        for i in 0..STATES {
            for j in 0..STATES {
                let mut sum = self.noise[i][j];
                for k in 0..STATES {
                    sum += self.product[i][k] * self.phi[j][k];
                }
                self.covariance[i][j] = sum;
            }
        }
        let before = self.state;
        for (row, entry) in self.phi.iter().zip(&mut self.state) {
            *entry = row.iter().zip(before).map(|(phi, x)| phi * x).sum();
        }
    }

    /// One row after the other, in plain loops.
    #[inline(never)]
    pub fn plain_update(&mut self) {
        let rows = self.design.iter().zip(self.innovation).zip(self.variance);
        for ((h, measured), variance) in rows {
            let mut cross = [0.0; STATES];
            for (entry, row) in cross.iter_mut().zip(&self.covariance) {
                *entry = row.iter().zip(h).map(|(p, h)| p * h).sum();
            }
            let mut scale = variance;
            let mut innovation = measured;
            for i in 0..STATES {
                scale += h[i] * cross[i];
                innovation -= h[i] * self.state[i];
            }
            for i in 0..STATES {
                let gain = cross[i] / scale;
                self.state[i] += gain * innovation;
                for j in 0..STATES {
                    self.covariance[i][j] -= gain * cross[j];
                }
            }
        }
    }

    /// P ← Φ P Φᵀ + Q as an expression.
    #[inline(never)]
    pub fn expression_predict(&mut self) {
        let phi = self.expression_phi;
        self.expression_covariance =
            phi * self.expression_covariance * phi.transpose() + self.expression_noise;
        self.expression_state = phi * self.expression_state;
    }

    /// All rows at once as expressions; false when S is not positive.
    #[inline(never)]
    pub fn expression_update(&mut self) -> bool {
        let h = self.expression_design;
        let r = SMatrix::<f64, ROWS, ROWS>::from_diagonal(&SVector::from(self.variance));
        let (p, x) = (self.expression_covariance, self.expression_state);
        let Some(s) = (h * p * h.transpose() + r).cholesky() else {
            return false;
        };
        let gain = p * h.transpose() * s.inverse();
        self.expression_state = x + gain * (SVector::from(self.innovation) - h * x);
        self.expression_covariance = (Square::identity() - gain * h) * p;
        true
    }
}

fn square(m: &Matrix) -> Square {
    Square::from_fn(|i, j| m[i][j])
}
