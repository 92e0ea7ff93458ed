//! Products of 3×3 blocks, the unit in which a navigation covariance is stored and multiplied.
//!
//! A [`Block`] is nine numbers by rows, a [`Symmetric`] the six of its upper triangle
//! (00 01 02 11 12 22). Every product adds to a sum of nine (or six) that stay in registers, three
//! multiplications deep per entry and operand: on a Cortex-M7 with sixteen double registers this is
//! what makes a filter fit (decision 005). Loops have constant bounds and are unrolled whole.

#![expect(
    clippy::indexing_slicing,
    reason = "indices are constants after unrolling; the no-panic image is the judge"
)]

/// Between two pieces of work on vectors or blocks: what each of them loads is not mixed with what the other
/// does, so that entries side by side are loaded together, by one instruction for several. It is none itself.
#[inline(always)]
pub(crate) fn together() {
    core::hint::black_box(());
}

/// A 3×3 matrix by rows.
pub type Block = [f64; 9];
/// The upper triangle of a symmetric 3×3 matrix by rows: 00 01 02 11 12 22.
pub type Symmetric = [f64; 6];

/// No matrix.
pub const ZERO: Block = [0.0; 9];
/// The unit matrix.
pub const IDENTITY: Block = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

/// Where the entry (i, j) of a symmetric matrix is stored.
pub(crate) const fn packed(i: usize, j: usize) -> usize {
    const PLACE: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];
    PLACE[i][j]
}

/// `l r`.
#[inline(always)]
pub(crate) fn product(l: &Block, r: &Block) -> Block {
    product_with(l, |k, j| r[3 * k + j])
}

/// `l s` with s symmetric.
#[inline(always)]
pub(crate) fn product_symmetric(l: &Block, s: &Symmetric) -> Block {
    product_with(l, |k, j| s[packed(k, j)])
}

/// The product with a matrix given by its entries, begun with the first terms and not with zero.
#[inline(always)]
fn product_with(l: &Block, r: impl Fn(usize, usize) -> f64) -> Block {
    let mut sum = ZERO;
    for i in 0..3 {
        for j in 0..3 {
            sum[3 * i + j] = l[3 * i] * r(0, j);
        }
    }
    for k in 1..3 {
        for i in 0..3 {
            for j in 0..3 {
                sum[3 * i + j] += l[3 * i + k] * r(k, j);
            }
        }
    }
    sum
}

/// `sum += l r`.
#[inline(always)]
pub(crate) fn add_product(sum: &mut Block, l: &Block, r: &Block) {
    for k in 0..3 {
        for i in 0..3 {
            for j in 0..3 {
                sum[3 * i + j] += l[3 * i + k] * r[3 * k + j];
            }
        }
    }
}

/// `sum += l rᵀ`.
#[inline(always)]
pub(crate) fn add_product_transposed(sum: &mut Block, l: &Block, r: &Block) {
    for k in 0..3 {
        for i in 0..3 {
            for j in 0..3 {
                sum[3 * i + j] += l[3 * i + k] * r[3 * j + k];
            }
        }
    }
}

/// `sum += l s` with s symmetric.
#[inline(always)]
pub(crate) fn add_product_symmetric(sum: &mut Block, l: &Block, s: &Symmetric) {
    for k in 0..3 {
        for i in 0..3 {
            for j in 0..3 {
                sum[3 * i + j] += l[3 * i + k] * s[packed(k, j)];
            }
        }
    }
}

/// Upper triangle of `sum += l rᵀ`, for a product that is known to be symmetric.
#[inline(always)]
pub(crate) fn add_symmetric_product(sum: &mut Symmetric, l: &Block, r: &Block) {
    for k in 0..3 {
        for i in 0..3 {
            for j in i..3 {
                sum[packed(i, j)] += l[3 * i + k] * r[3 * j + k];
            }
        }
    }
}

/// `sum += l v`.
#[inline(always)]
pub(crate) fn add_product_vector(sum: &mut [f64; 3], l: &Block, v: &[f64; 3]) {
    for i in 0..3 {
        for k in 0..3 {
            sum[i] += l[3 * i + k] * v[k];
        }
    }
}

/// `sum += factor l`.
#[inline(always)]
pub(crate) fn add_scaled(sum: &mut Block, factor: f64, l: &Block) {
    for (s, value) in sum.iter_mut().zip(l) {
        *s += factor * value;
    }
}

/// The matrix [v×] with `[v×] a = v × a`.
#[inline(always)]
pub(crate) fn skew(v: [f64; 3]) -> Block {
    let [x, y, z] = v;
    [0.0, -z, y, z, 0.0, -x, -y, x, 0.0]
}

/// The full matrix of a symmetric one.
#[inline(always)]
pub(crate) fn full(s: &Symmetric) -> Block {
    let [a, b, c, d, e, f] = *s;
    [a, b, c, b, d, e, c, e, f]
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    const L: Block = [1.0, 2.0, -3.0, 0.5, 5.0, 7.0, -11.0, 13.0, 17.0];
    const R: Block = [19.0, -23.0, 29.0, 31.0, 37.0, 0.25, 41.0, -43.0, 47.0];
    const S: Symmetric = [2.0, 3.0, 5.0, 7.0, 11.0, 13.0];

    fn matrix(b: &Block) -> Matrix3<f64> {
        Matrix3::from_row_slice(b)
    }

    #[test]
    fn products_are_those_of_matrices() {
        let mut sum = R;
        add_product(&mut sum, &L, &R);
        assert_eq!(matrix(&sum), matrix(&R) + matrix(&L) * matrix(&R));
        let mut sum = L;
        add_product_transposed(&mut sum, &L, &R);
        assert_eq!(
            matrix(&sum),
            matrix(&L) + matrix(&L) * matrix(&R).transpose()
        );
        let mut sum = L;
        add_product_symmetric(&mut sum, &R, &S);
        assert_eq!(matrix(&sum), matrix(&L) + matrix(&R) * matrix(&full(&S)));
        let mut sum = S;
        add_symmetric_product(&mut sum, &L, &L);
        assert_eq!(
            matrix(&full(&sum)),
            matrix(&full(&S)) + matrix(&L) * matrix(&L).transpose()
        );
        let mut sum = [1.0, 2.0, 3.0];
        add_product_vector(&mut sum, &L, &[4.0, 5.0, 6.0]);
        assert_eq!(sum, [1.0 - 4.0, 2.0 + 69.0, 3.0 + 123.0]);
        let s = skew([1.0, 2.0, 3.0]);
        let mut cross = [0.0; 3];
        add_product_vector(&mut cross, &s, &[4.0, 5.0, 6.0]);
        assert_eq!(cross, [-3.0, 6.0, -3.0]);
    }
}
