//! Householder QR of a whitened epoch: the one factorization behind estimate, test and levels.
//!
//! In: a [`LinearModel`] of n rows and m unknowns. Out: its reflectors, R⁻¹, the estimate, the parity
//! vector, the thin Q and the residuals, each formed when asked for.
//!
//! | symbol | code        | shape    | unit | meaning                                             |
//! |--------|-------------|----------|------|-----------------------------------------------------|
//! | A, z   | `rows`      | n × m, n | 1    | design and residuals divided by sigma               |
//! | Q₁     | `thin_q`    | n × m    | 1    | orthonormal columns that span those of A            |
//! | R      |             | m × m    | 1/m  | upper triangle, A = Q₁ R                            |
//! | Qᵀz    | `rows`      | n        | 1    | first m: R x; the last n − m: the parity vector p   |
//! | v, β   | `rows`, `beta` |       |      | reflector H = I − β v vᵀ                            |
//!
//! Equations: reflectors and their backward accumulation [GOLUB-VANLOAN] 5.1, factorization 5.2; parity
//! vector [P1] (11) to (14). Keys: docs/references.md.
//! Departures: the residuals ride along as one more column; each pass over the rows applies one
//! reflector and gathers the inner products of the next. The row length is a compile-time constant.
//! Cost: (m + 1) passes for the factorization, m for Q₁, m square roots.

use super::LinearModel;
use crate::consts::{MAX_SATELLITES, MAX_UNKNOWNS};

/// Fewest unknowns: three of position and one clock.
pub const MIN_UNKNOWNS: usize = 4;

/// A row of the design and its residual.
const WIDTH: usize = MAX_UNKNOWNS + 1;
type Row = [f64; WIDTH];

/// Largest condition number ‖R‖·‖R⁻¹‖ (Frobenius) accepted. Rounding errors of 1e-16 are multiplied by
/// it, so that the estimate keeps nine digits; and a geometry this bad makes of 1 m of error in a
/// pseudorange some 100 km in the position.
pub const CONDITION_LIMIT: f64 = 1e6;

/// Why an epoch could not be factored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum QrError {
    /// Unknowns not between [`MIN_UNKNOWNS`] and [`MAX_UNKNOWNS`].
    UnknownsOutOfRange {
        /// Number of unknowns.
        m: usize,
    },
    /// Fewer rows than unknowns, or more than [`MAX_SATELLITES`].
    RowsOutOfRange {
        /// Number of rows.
        n: usize,
    },
    /// A sigma that is zero, negative, infinite or NaN.
    SigmaNotPositive {
        /// Its row.
        row: usize,
    },
    /// The rows leave a combination of the unknowns undetermined, or nearly so.
    BadGeometry {
        /// Condition number, above [`CONDITION_LIMIT`]; infinite when a pivot vanished.
        condition: f64,
    },
    /// A derivative or a residual is NaN or infinite, or overflowed.
    NotFinite,
}

/// The factored epoch, in memory the caller owns (5 kB).
///
/// [`WhitenedQr::factor`] fills everything but Q₁; [`WhitenedQr::form_thin_q`] adds that. After an
/// error all counts are zero, so that no stale number can be read.
#[derive(Clone, Debug)]
pub struct WhitenedQr {
    n: usize,
    m: usize,
    /// Below and on the diagonal the reflectors, above it R, in column m the vector Qᵀz.
    rows: [Row; MAX_SATELLITES],
    beta: [f64; MAX_UNKNOWNS],
    diagonal: [f64; MAX_UNKNOWNS],
    r_inverse: [[f64; MAX_UNKNOWNS]; MAX_UNKNOWNS],
    sum_of_squares: f64,
    condition_squared: f64,
    thin_q: [[f64; MAX_UNKNOWNS]; MAX_SATELLITES],
    has_thin_q: bool,
}

impl WhitenedQr {
    /// Nothing factored.
    pub const EMPTY: Self = Self {
        n: 0,
        m: 0,
        rows: [[0.0; WIDTH]; MAX_SATELLITES],
        beta: [0.0; MAX_UNKNOWNS],
        diagonal: [0.0; MAX_UNKNOWNS],
        r_inverse: [[0.0; MAX_UNKNOWNS]; MAX_UNKNOWNS],
        sum_of_squares: 0.0,
        condition_squared: 0.0,
        thin_q: [[0.0; MAX_UNKNOWNS]; MAX_SATELLITES],
        has_thin_q: false,
    };

    /// Divides the rows by their sigmas and factors them. n ≥ m is enough; n = m leaves no parity.
    ///
    /// # Errors
    /// [`QrError`]; a NaN anywhere refuses.
    #[inline(never)]
    pub fn factor(&mut self, model: &LinearModel) -> Result<(), QrError> {
        self.n = 0;
        self.m = 0;
        self.has_thin_q = false;
        let (n, m) = (model.n, model.m);
        if n < m || n > MAX_SATELLITES {
            return Err(QrError::RowsOutOfRange { n });
        }
        match m {
            4 => self.factor_fixed::<4>(model)?,
            5 => self.factor_fixed::<5>(model)?,
            6 => self.factor_fixed::<6>(model)?,
            _ => return Err(QrError::UnknownsOutOfRange { m }),
        }
        self.n = n;
        self.m = m;
        Ok(())
    }

    #[inline(never)]
    fn factor_fixed<const M: usize>(&mut self, model: &LinearModel) -> Result<(), QrError> {
        let rows = self
            .rows
            .get_mut(..model.n)
            .ok_or(QrError::RowsOutOfRange { n: model.n })?;
        let mut products = whiten::<M>(model, rows)?;
        let parts = (&mut self.beta, &mut self.diagonal);
        products = reflect::<M, 0>(rows, &products, parts.0, parts.1)?;
        products = reflect::<M, 1>(rows, &products, parts.0, parts.1)?;
        products = reflect::<M, 2>(rows, &products, parts.0, parts.1)?;
        products = reflect::<M, 3>(rows, &products, parts.0, parts.1)?;
        if M > 4 {
            products = reflect::<M, 4>(rows, &products, parts.0, parts.1)?;
        }
        if M > 5 {
            products = reflect::<M, 5>(rows, &products, parts.0, parts.1)?;
        }
        // After the last reflector the only product left is that of the parity vector with itself.
        let sum_of_squares = products.get(M).copied().unwrap_or(f64::NAN);
        if !sum_of_squares.is_finite() {
            return Err(QrError::NotFinite);
        }
        self.sum_of_squares = sum_of_squares;
        self.condition_squared = invert::<M>(rows, &self.diagonal, &mut self.r_inverse);
        // Written so that NaN refuses.
        if self.condition_squared <= CONDITION_LIMIT * CONDITION_LIMIT {
            Ok(())
        } else if self.condition_squared.is_nan() {
            Err(QrError::NotFinite)
        } else {
            Err(QrError::BadGeometry {
                condition: libm::sqrt(self.condition_squared),
            })
        }
    }

    /// Number of rows; 0 before a successful [`WhitenedQr::factor`].
    pub fn n(&self) -> usize {
        self.n
    }

    /// Number of unknowns.
    pub fn m(&self) -> usize {
        self.m
    }

    /// p·p, the weighted sum of squared residuals; 0 without redundancy.
    pub fn sum_of_squares(&self) -> f64 {
        self.sum_of_squares
    }

    /// Square of the condition number.
    pub fn condition_squared(&self) -> f64 {
        self.condition_squared
    }

    /// R⁻¹, m × m, upper triangle; what lies beyond is zero. (AᵀA)⁻¹ = R⁻¹R⁻ᵀ is the cofactor matrix
    /// of the unknowns.
    pub fn r_inverse(&self) -> &[[f64; MAX_UNKNOWNS]; MAX_UNKNOWNS] {
        &self.r_inverse
    }

    /// The parity vector p: the last n − m entries of Qᵀz. [P1] (14)
    pub fn parity(&self) -> impl Iterator<Item = f64> + '_ {
        let m = self.m;
        self.rows
            .iter()
            .take(self.n)
            .skip(m)
            .map(move |row| row.get(m).copied().unwrap_or(f64::NAN))
    }

    /// The weighted least-squares estimate R⁻¹ (Q₁ᵀz), m entries in the units of the unknowns; what
    /// lies beyond is zero.
    pub fn estimate(&self) -> [f64; MAX_UNKNOWNS] {
        let mut estimate = [0.0; MAX_UNKNOWNS];
        let m = self.m;
        for (x, inverse_row) in estimate.iter_mut().zip(&self.r_inverse).take(m) {
            for (factor, row) in inverse_row.iter().zip(&self.rows).take(m) {
                *x += factor * row.get(m).copied().unwrap_or(f64::NAN);
            }
        }
        estimate
    }

    /// Whitened residuals w = z − A x, n entries; what lies beyond is not touched. Formed as Q·(0, p),
    /// so that a large estimate costs them no digits.
    pub fn residuals(&self, residuals: &mut [f64; MAX_SATELLITES]) {
        let m = self.m;
        for (index, (residual, row)) in residuals
            .iter_mut()
            .zip(&self.rows)
            .take(self.n)
            .enumerate()
        {
            *residual = if index < m {
                0.0
            } else {
                row.get(m).copied().unwrap_or(f64::NAN)
            };
        }
        self.apply_q(residuals);
    }

    /// Row `index` of the parity matrix (index from 0 to n − m − 1), n entries; false and untouched when
    /// there is no such row. The rows are orthonormal and orthogonal to the columns of A. [P1] (13)
    pub fn parity_matrix_row(&self, index: usize, row: &mut [f64; MAX_SATELLITES]) -> bool {
        if index >= self.n.saturating_sub(self.m) {
            return false;
        }
        *row = [0.0; MAX_SATELLITES];
        if let Some(entry) = row.get_mut(self.m.saturating_add(index)) {
            *entry = 1.0;
        }
        self.apply_q(row);
        true
    }

    /// Replaces the first n entries by Q times them, one reflector after the other, last first.
    fn apply_q(&self, vector: &mut [f64; MAX_SATELLITES]) {
        for (k, beta) in self.beta.iter().enumerate().take(self.m).rev() {
            let reflector = || {
                self.rows
                    .iter()
                    .take(self.n)
                    .skip(k)
                    .map(|row| row.get(k).copied().unwrap_or(f64::NAN))
            };
            let product: f64 = vector
                .iter()
                .skip(k)
                .zip(reflector())
                .map(|(a, b)| a * b)
                .sum();
            let step = beta * product;
            for (entry, v) in vector.iter_mut().skip(k).zip(reflector()) {
                *entry -= step * v;
            }
        }
    }

    /// Forms Q₁ for [`WhitenedQr::thin_q`]; nothing happens before a successful
    /// [`WhitenedQr::factor`].
    #[inline(never)]
    pub fn form_thin_q(&mut self) {
        let n = self.n;
        if let (Some(rows), Some(thin_q)) = (self.rows.get(..n), self.thin_q.get_mut(..n)) {
            match self.m {
                4 => accumulate::<4>(rows, &self.beta, thin_q),
                5 => accumulate::<5>(rows, &self.beta, thin_q),
                6 => accumulate::<6>(rows, &self.beta, thin_q),
                _ => return,
            }
            self.has_thin_q = true;
        }
    }

    /// Q₁, n rows of m entries; what lies beyond an entry m is not defined. Empty before
    /// [`WhitenedQr::form_thin_q`]. I − Q₁Q₁ᵀ is the projector S onto the residuals, [P1] (5).
    pub fn thin_q(&self) -> &[[f64; MAX_UNKNOWNS]] {
        let n = if self.has_thin_q { self.n } else { 0 };
        self.thin_q.get(..n).unwrap_or(&[])
    }
}

/// Fills `rows` with the whitened design and residual; gives the products of column 0 with all.
#[expect(
    clippy::indexing_slicing,
    reason = "arrays of WIDTH entries, indices at most M < WIDTH"
)]
#[inline(always)]
fn whiten<const M: usize>(model: &LinearModel, rows: &mut [Row]) -> Result<Row, QrError> {
    let mut products = [0.0; WIDTH];
    let given = model
        .design
        .iter()
        .zip(&model.residual_m)
        .zip(&model.sigma_m);
    for (index, (row, ((design, residual_m), sigma_m))) in rows.iter_mut().zip(given).enumerate() {
        let weight = 1.0 / sigma_m;
        // An infinite sigma gives 0, a subnormal one infinity.
        if !(weight > 0.0 && weight < f64::INFINITY) {
            return Err(QrError::SigmaNotPositive { row: index });
        }
        for j in 0..M {
            row[j] = design[j] * weight;
        }
        row[M] = residual_m * weight;
        let lead = row[0];
        for j in 0..=M {
            products[j] += lead * row[j];
        }
    }
    Ok(products)
}

/// Makes column K zero below row K. `products` are those of column K with columns K to M, from row K
/// down; the products of column K + 1 from row K + 1 down come back.
#[expect(
    clippy::indexing_slicing,
    reason = "arrays of WIDTH and MAX_UNKNOWNS entries, indices at most M < WIDTH, K < M"
)]
#[inline(always)]
fn reflect<const M: usize, const K: usize>(
    rows: &mut [Row],
    products: &Row,
    beta: &mut [f64; MAX_UNKNOWNS],
    diagonal: &mut [f64; MAX_UNKNOWNS],
) -> Result<Row, QrError> {
    let missing = QrError::RowsOutOfRange { n: rows.len() };
    let (pivot, below) = rows
        .get_mut(K..)
        .and_then(<[Row]>::split_first_mut)
        .ok_or(missing)?;
    let length = libm::sqrt(products[K]);
    if !(length > 0.0 && length < f64::INFINITY) {
        return Err(if length == 0.0 {
            QrError::BadGeometry {
                condition: f64::INFINITY,
            }
        } else {
            QrError::NotFinite
        });
    }
    // The sign that does not cancel in v₀.
    let alpha = if pivot[K] > 0.0 { -length } else { length };
    let v0 = pivot[K] - alpha;
    let factor = -1.0 / (alpha * v0);
    let mut step = [0.0; WIDTH];
    for j in K + 1..=M {
        step[j] = factor * (products[j] - alpha * pivot[j]);
        pivot[j] -= step[j] * v0;
    }
    pivot[K] = v0;
    diagonal[K] = alpha;
    beta[K] = factor;

    let mut next = [0.0; WIDTH];
    for row in below {
        let v = row[K];
        for j in K + 1..=M {
            row[j] -= step[j] * v;
        }
        let lead = row[K + 1];
        for j in K + 1..=M {
            next[j] += lead * row[j];
        }
    }
    Ok(next)
}

/// Inverts R by back substitution; gives ‖R‖²‖R⁻¹‖².
#[expect(
    clippy::indexing_slicing,
    reason = "i ≤ k ≤ j < M ≤ MAX_UNKNOWNS; the loops unroll and the checks vanish"
)]
#[inline(always)]
fn invert<const M: usize>(
    rows: &[Row],
    diagonal: &[f64; MAX_UNKNOWNS],
    inverse: &mut [[f64; MAX_UNKNOWNS]; MAX_UNKNOWNS],
) -> f64 {
    let mut r = [[0.0; MAX_UNKNOWNS]; MAX_UNKNOWNS];
    let mut norm = 0.0;
    for ((i, target), row) in r.iter_mut().enumerate().zip(rows).take(M) {
        for j in 0..M {
            if j > i {
                target[j] = row[j];
                norm += row[j] * row[j];
            }
        }
        target[i] = diagonal[i];
        norm += diagonal[i] * diagonal[i];
    }
    *inverse = [[0.0; MAX_UNKNOWNS]; MAX_UNKNOWNS];
    let mut inverse_norm = 0.0;
    for j in 0..M {
        let mut column = [0.0; MAX_UNKNOWNS];
        column[j] = 1.0 / r[j][j];
        for i in (0..j).rev() {
            let mut sum = 0.0;
            for k in 0..M {
                if k > i && k <= j {
                    sum += r[i][k] * column[k];
                }
            }
            column[i] = -sum / r[i][i];
        }
        for i in 0..M {
            inverse[i][j] = column[i];
            inverse_norm += column[i] * column[i];
        }
    }
    norm * inverse_norm
}

/// Q₁ = H₀H₁…H₍ₘ₋₁₎ times the first m columns of the identity, last reflector first, so that each
/// touches only the columns from its own on. [GOLUB-VANLOAN] 5.1
#[inline(never)]
fn accumulate<const M: usize>(
    rows: &[Row],
    beta: &[f64; MAX_UNKNOWNS],
    thin_q: &mut [[f64; MAX_UNKNOWNS]],
) {
    let mut products = [0.0; MAX_UNKNOWNS];
    if M > 5 {
        products = accumulate_one::<M, 5>(rows, beta, &products, thin_q);
    }
    if M > 4 {
        products = accumulate_one::<M, 4>(rows, beta, &products, thin_q);
    }
    products = accumulate_one::<M, 3>(rows, beta, &products, thin_q);
    products = accumulate_one::<M, 2>(rows, beta, &products, thin_q);
    products = accumulate_one::<M, 1>(rows, beta, &products, thin_q);
    accumulate_one::<M, 0>(rows, beta, &products, thin_q);
}

/// Applies reflector K. `products` are those of its vector with columns K + 1 to M − 1 below row K; the
/// products of reflector K − 1 with columns K to M − 1 come back.
#[expect(
    clippy::indexing_slicing,
    reason = "arrays of MAX_UNKNOWNS and WIDTH entries, indices below M ≤ MAX_UNKNOWNS"
)]
#[inline(always)]
fn accumulate_one<const M: usize, const K: usize>(
    rows: &[Row],
    beta: &[f64; MAX_UNKNOWNS],
    products: &[f64; MAX_UNKNOWNS],
    thin_q: &mut [[f64; MAX_UNKNOWNS]],
) -> [f64; MAX_UNKNOWNS] {
    let mut next = [0.0; MAX_UNKNOWNS];
    let (Some((pivot, below)), Some((q_pivot, q_below))) = (
        rows.get(K..).and_then(<[Row]>::split_first),
        thin_q.get_mut(K..).and_then(<[_]>::split_first_mut),
    ) else {
        return next;
    };
    let before = K.saturating_sub(1);
    let v0 = pivot[K];
    let mut step = [0.0; MAX_UNKNOWNS];
    step[K] = beta[K] * v0;
    q_pivot[K] = 1.0 - step[K] * v0;
    for j in K + 1..M {
        step[j] = beta[K] * products[j];
        q_pivot[j] = -step[j] * v0;
    }
    for j in K..M {
        next[j] = pivot[before] * q_pivot[j];
    }
    for (row, q_row) in below.iter().zip(q_below) {
        let v = row[K];
        q_row[K] = -step[K] * v;
        for j in K + 1..M {
            q_row[j] -= step[j] * v;
        }
        let lead = row[before];
        for j in K..M {
            next[j] += lead * q_row[j];
        }
    }
    next
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sky of n satellites, clocks in turn, from a small generator of directions.
    fn model(n: usize, m: usize) -> LinearModel {
        let mut model = LinearModel::EMPTY;
        model.n = n;
        model.m = m;
        for i in 0..n {
            let azimuth = 2.4 * i as f64;
            let elevation = 0.2 + 0.9 * ((i * 7 % 11) as f64 / 11.0);
            model.design[i][0] = -libm::sin(azimuth) * libm::cos(elevation);
            model.design[i][1] = -libm::cos(azimuth) * libm::cos(elevation);
            model.design[i][2] = -libm::sin(elevation);
            model.design[i][3 + i % (m - 3)] = 1.0;
            model.sigma_m[i] = 1.0 + 0.1 * (i % 5) as f64;
            model.residual_m[i] = 30.0 * libm::sin(1.0 + 3.0 * i as f64);
        }
        model
    }

    #[test]
    fn thin_q_is_orthonormal_and_with_r_gives_the_model_back() {
        for (n, m) in [(4, 4), (5, 4), (24, 4), (9, 5), (48, 6), (13, 6)] {
            let model = model(n, m);
            let mut qr = WhitenedQr::EMPTY;
            qr.factor(&model).unwrap();
            assert!(qr.thin_q().is_empty());
            qr.form_thin_q();
            let q = qr.thin_q();
            for a in 0..m {
                for b in 0..m {
                    let product: f64 = q.iter().map(|row| row[a] * row[b]).sum();
                    let unit = if a == b { 1.0 } else { 0.0 };
                    assert!((product - unit).abs() < 1e-14, "{n} {m} {a} {b} {product}");
                    // A R⁻¹ = Q₁.
                    for (i, row) in q.iter().enumerate() {
                        let mut entry = 0.0;
                        for k in 0..m {
                            entry += model.design[i][k] / model.sigma_m[i] * qr.r_inverse()[k][a];
                        }
                        assert!((entry - row[a]).abs() < 1e-13);
                    }
                }
            }
        }
    }

    #[test]
    fn residuals_are_what_the_estimate_leaves() {
        for (n, m) in [(5, 4), (24, 4), (9, 5), (48, 6)] {
            let model = model(n, m);
            let mut qr = WhitenedQr::EMPTY;
            qr.factor(&model).unwrap();
            let x = qr.estimate();
            let mut w = [0.0; MAX_SATELLITES];
            qr.residuals(&mut w);
            let mut sum = 0.0;
            for (i, residual) in w.iter().enumerate().take(n) {
                let predicted: f64 = (0..m).map(|j| model.design[i][j] * x[j]).sum();
                let left = (model.residual_m[i] - predicted) / model.sigma_m[i];
                assert!((left - residual).abs() < 1e-12);
                sum += left * left;
            }
            assert!((sum / qr.sum_of_squares() - 1.0).abs() < 1e-12);
            let parity: f64 = qr.parity().map(|p| p * p).sum();
            assert!((parity / sum - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn what_cannot_be_solved_is_refused_by_cause() {
        let mut qr = WhitenedQr::EMPTY;
        let good = model(8, 5);

        let mut bad = good.clone();
        bad.m = 3;
        assert_eq!(qr.factor(&bad), Err(QrError::UnknownsOutOfRange { m: 3 }));
        bad.m = 7;
        assert_eq!(qr.factor(&bad), Err(QrError::UnknownsOutOfRange { m: 7 }));
        let mut bad = good.clone();
        bad.n = 4;
        assert_eq!(qr.factor(&bad), Err(QrError::RowsOutOfRange { n: 4 }));
        bad.n = MAX_SATELLITES + 1;
        assert!(qr.factor(&bad).is_err());
        for sigma_m in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let mut bad = good.clone();
            bad.sigma_m[6] = sigma_m;
            assert_eq!(qr.factor(&bad), Err(QrError::SigmaNotPositive { row: 6 }));
        }
        for value in [f64::NAN, f64::INFINITY, 1e200] {
            let mut bad = good.clone();
            bad.residual_m[7] = value;
            assert_eq!(qr.factor(&bad), Err(QrError::NotFinite));
            let mut bad = good.clone();
            bad.design[2][1] = value;
            assert!(qr.factor(&bad).is_err());
        }
        // A clock nobody sees.
        let mut bad = good.clone();
        for row in &mut bad.design {
            row[4] = 0.0;
        }
        assert!(matches!(qr.factor(&bad), Err(QrError::BadGeometry { .. })));
        // All satellites on one cone around the zenith: height and clock are one.
        let mut bad = good.clone();
        bad.m = 4;
        for row in &mut bad.design {
            row[2] = -0.5;
            row[3] = 1.0;
        }
        assert!(matches!(qr.factor(&bad), Err(QrError::BadGeometry { .. })));
        // Nothing of an earlier success is left to read.
        assert_eq!((qr.n(), qr.m()), (0, 0));
        assert_eq!(qr.parity().count(), 0);
        qr.form_thin_q();
        assert!(qr.thin_q().is_empty());
    }
}
