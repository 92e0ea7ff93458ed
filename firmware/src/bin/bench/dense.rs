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
type Gain = SMatrix<f64, STATES, ROWS>;
type Innovations = SMatrix<f64, ROWS, ROWS>;

/// A filter in plain loops.
#[derive(Clone, Copy)]
pub struct PlainFilter {
    pub covariance: Matrix,
    pub state: [f64; STATES],
}

/// A scalar measurement.
#[derive(Clone, Copy)]
pub struct PlainRow {
    pub design: [f64; STATES],
    pub innovation: f64,
    pub variance: f64,
}

impl PlainRow {
    pub const NONE: Self = Self {
        design: [0.0; STATES],
        innovation: 0.0,
        variance: 1.0,
    };
}

impl PlainFilter {
    pub const EMPTY: Self = Self {
        covariance: ZERO,
        state: [0.0; STATES],
    };

    /// P ← Φ P Φᵀ + Q.
    #[inline(never)]
    pub fn predict(&mut self, phi: &Matrix, noise: &Matrix, product: &mut Matrix) {
        for i in 0..STATES {
            for j in 0..STATES {
                let mut sum = 0.0;
                for k in 0..STATES {
                    sum += phi[i][k] * self.covariance[k][j];
                }
                product[i][j] = sum;
            }
        }
        for i in 0..STATES {
            for j in 0..STATES {
                let mut sum = noise[i][j];
                for k in 0..STATES {
                    sum += product[i][k] * phi[j][k];
                }
                self.covariance[i][j] = sum;
            }
        }
        let before = self.state;
        for (row, entry) in phi.iter().zip(&mut self.state) {
            *entry = row.iter().zip(before).map(|(phi, x)| phi * x).sum();
        }
    }

    /// Whether it holds this covariance, to a millionth of the sigmas.
    pub fn agrees_with(&self, covariance: &Matrix) -> bool {
        agree(covariance, |i, j| self.covariance[i][j])
    }

    /// One row, with the gain P hᵀ/(h P hᵀ + r).
    #[inline(never)]
    pub fn take(&mut self, row: &PlainRow) {
        let h = &row.design;
        let mut cross = [0.0; STATES];
        for (entry, row) in cross.iter_mut().zip(&self.covariance) {
            *entry = row.iter().zip(h).map(|(p, h)| p * h).sum();
        }
        let mut scale = row.variance;
        let mut innovation = row.innovation;
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

/// Both filters and what they are fed with.
pub struct Peers {
    phi: Matrix,
    noise: Matrix,
    rows: [PlainRow; ROWS],
    plain: PlainFilter,
    product: Matrix,
    expression_phi: Square,
    expression_noise: Square,
    expression_design: Design,
    expression_covariance: Square,
    expression_state: State,
    expression_inverse: Innovations,
    expression_gain: Gain,
}

impl Peers {
    /// Nothing set.
    pub const EMPTY: Self = Self {
        phi: ZERO,
        noise: ZERO,
        rows: [PlainRow::NONE; ROWS],
        plain: PlainFilter::EMPTY,
        product: ZERO,
        expression_phi: Square::from_array_storage(ArrayStorage(ZERO)),
        expression_noise: Square::from_array_storage(ArrayStorage(ZERO)),
        expression_design: Design::from_array_storage(ArrayStorage([[0.0; ROWS]; STATES])),
        expression_covariance: Square::from_array_storage(ArrayStorage(ZERO)),
        expression_state: State::from_array_storage(ArrayStorage([[0.0; STATES]])),
        expression_inverse: Innovations::from_array_storage(ArrayStorage([[0.0; ROWS]; ROWS])),
        expression_gain: Gain::from_array_storage(ArrayStorage([[0.0; STATES]; ROWS])),
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
        self.plain = PlainFilter {
            covariance: *covariance,
            state: *state,
        };
        self.expression_covariance = square(covariance);
        self.expression_state = State::from(*state);
    }

    /// A row of the next update; `weight` is 1/σ².
    pub fn set_row(&mut self, at: usize, h: &[f64; STATES], innovation: f64, weight: f64) {
        self.rows[at] = PlainRow {
            design: *h,
            innovation,
            variance: 1.0 / weight,
        };
        for (column, entry) in h.iter().enumerate() {
            self.expression_design[(at, column)] = *entry;
        }
    }

    /// Whether both hold this covariance, to a millionth of the sigmas.
    pub fn agree_with(&self, covariance: &Matrix) -> bool {
        self.plain.agrees_with(covariance)
            && agree(covariance, |i, j| self.expression_covariance[(i, j)])
    }

    /// P ← Φ P Φᵀ + Q in plain loops.
    #[inline(never)]
    pub fn plain_predict(&mut self) {
        self.plain
            .predict(&self.phi, &self.noise, &mut self.product);
    }

    /// One row after the other, in plain loops.
    #[inline(never)]
    pub fn plain_update(&mut self) {
        for row in &self.rows {
            self.plain.take(row);
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

    /// All rows at once as expressions; false when S is not positive. In steps, because the values of all of
    /// them together are more than the board's stack holds.
    #[inline(never)]
    pub fn expression_update(&mut self) -> bool {
        if !self.invert() {
            return false;
        }
        self.compute_gain();
        self.correct();
        true
    }

    #[inline(never)]
    fn invert(&mut self) -> bool {
        let (h, p) = (&self.expression_design, &self.expression_covariance);
        let variances = SVector::from_fn(|row, _| self.rows[row].variance);
        let s = h * p * h.transpose() + Innovations::from_diagonal(&variances);
        let Some(s) = s.cholesky() else {
            return false;
        };
        self.expression_inverse = s.inverse();
        true
    }

    #[inline(never)]
    fn compute_gain(&mut self) {
        let (h, p) = (&self.expression_design, &self.expression_covariance);
        self.expression_gain = p * h.transpose() * self.expression_inverse;
    }

    #[inline(never)]
    fn correct(&mut self) {
        let (h, gain) = (&self.expression_design, &self.expression_gain);
        let innovations = SVector::<f64, ROWS>::from_fn(|row, _| self.rows[row].innovation);
        self.expression_state += gain * (innovations - h * self.expression_state);
        self.expression_covariance = (Square::identity() - gain * h) * self.expression_covariance;
    }
}

fn square(m: &Matrix) -> Square {
    Square::from_fn(|i, j| m[i][j])
}

/// Whether a covariance is this one, to a millionth of the sigmas.
fn agree(covariance: &Matrix, other: impl Fn(usize, usize) -> f64) -> bool {
    (0..STATES).all(|i| {
        (0..STATES).all(|j| {
            let scale = libm::sqrt(covariance[i][i] * covariance[j][j]);
            libm::fabs(other(i, j) - covariance[i][j]) <= 1e-6 * scale
        })
    })
}
