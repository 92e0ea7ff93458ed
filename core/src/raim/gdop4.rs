//! Geometric dilution of precision of four satellites without inverting a matrix.
//!
//! In: the directions to four satellites of one clock, or the products of their pairs. Out: GDOP, or why
//! there is none.
//!
//! | symbol | code | shape | unit | meaning |
//! |--------|------|-------|------|---------|
//! | e_i    | `directions` | 3 | 1 | unit vector of satellite i, or its negative, in any frame |
//! | E_ij   | `pairs` | 6 | 1 | e_i·e_j + 1, the entries of H Hᵀ beside its diagonal of twos |
//! | a + b + 2c | `determinant` | 1 | 1 | det(H Hᵀ), the product of its eigenvalues |
//! | 16 + b + c | `triples` | 1 | 1 | sum of the products of three of its eigenvalues |
//!
//! Equations: [P4] (8) to (13), corrected. GDOP² = tr((HᵀH)⁻¹) is the sum of the inverse eigenvalues of
//! HᵀH, and of H Hᵀ too when H is square: `triples`/`determinant`. Keys: docs/references.md.
//! Departures: printed (8) has lost its root, (9) the square of its first term, and (11) the bracket
//! around both terms.
//! Assumes: four satellites, one clock. With a second clock, or a fifth satellite, this is no GDOP.

/// Smallest det(H Hᵀ) of a geometry. Rounding leaves some 1e-14 of one that is zero, so that GDOP has
/// four digits here; it is then some 10,000.
pub const LEAST_DETERMINANT: f64 = 1e-10;

/// Farthest a direction's squared length may be from 1.
const UNIT_TOLERANCE: f64 = 1e-9;

/// Why four satellites have no GDOP.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Gdop4Error {
    /// A direction that is not of length 1, or no number.
    NotUnit {
        /// Which of the four.
        index: usize,
    },
    /// The satellites leave a combination of position and clock undetermined (their directions end in
    /// one plane), or the products are no numbers.
    Degenerate {
        /// det(H Hᵀ), not above [`LEAST_DETERMINANT`].
        determinant: f64,
    },
}

/// E_ij of two directions. [P4] (12)
pub fn pair_product([ax, ay, az]: &[f64; 3], [bx, by, bz]: &[f64; 3]) -> f64 {
    ax * bx + ay * by + az * bz + 1.0
}

/// GDOP² from the products of the pairs 12, 13, 14, 23, 24, 34: what many subsets of one sky are compared
/// by, each product formed once. [P4] (8) to (11)
///
/// # Errors
/// [`Gdop4Error::Degenerate`].
pub fn gdop_squared(pairs: &[f64; 6]) -> Result<f64, Gdop4Error> {
    let [e12, e13, e14, e23, e24, e34] = *pairs;
    let (p, q, r) = (e12 * e34, e13 * e24, e14 * e23);
    let difference = p + q - r;
    let a = difference * difference - 4.0 * p * q;
    let squares = e12 * e12 + e13 * e13 + e14 * e14 + e23 * e23 + e24 * e24 + e34 * e34;
    let b = 16.0 - 4.0 * squares;
    let c = 2.0 * (e12 * (e13 * e23 + e14 * e24) + e34 * (e13 * e14 + e23 * e24));
    let determinant = a + b + 2.0 * c;
    let triples = 16.0 + b + c;
    // NaN is no geometry; the sum of products of eigenvalues is positive where the determinant is.
    if determinant > LEAST_DETERMINANT && triples > 0.0 {
        Ok(triples / determinant)
    } else {
        Err(Gdop4Error::Degenerate { determinant })
    }
}

/// GDOP of four directions. [P4] (8)
///
/// # Errors
/// [`Gdop4Error`].
pub fn gdop(directions: &[[f64; 3]; 4]) -> Result<f64, Gdop4Error> {
    for (index, direction) in directions.iter().enumerate() {
        let excess = pair_product(direction, direction) - 2.0;
        let is_unit = libm::fabs(excess) <= UNIT_TOLERANCE;
        if !is_unit {
            return Err(Gdop4Error::NotUnit { index });
        }
    }
    let [first, second, third, fourth] = directions;
    let squared = gdop_squared(&[
        pair_product(first, second),
        pair_product(first, third),
        pair_product(first, fourth),
        pair_product(second, third),
        pair_product(second, fourth),
        pair_product(third, fourth),
    ])?;
    Ok(libm::sqrt(squared))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three towards the horizon, one overhead.
    const TRIPOD: [[f64; 3]; 4] = [
        [1.0, 0.0, 0.0],
        [-0.5, 0.866_025_403_784_438_6, 0.0],
        [-0.5, -0.866_025_403_784_438_6, 0.0],
        [0.0, 0.0, 1.0],
    ];

    #[test]
    fn three_on_the_horizon_and_one_overhead_have_the_gdop_worked_out_by_hand() {
        // Horizontal: 2/3 each. The clock is the mean of the three, 1/3; height = overhead − clock,
        // 1 + 1/3.
        let expected = (2.0 / 3.0 + 2.0 / 3.0 + 1.0 / 3.0 + 4.0 / 3.0_f64).sqrt();
        assert!((gdop(&TRIPOD).unwrap() / expected - 1.0).abs() < 1e-14);
    }

    #[test]
    fn order_and_sign_of_the_directions_do_not_matter() {
        let expected = gdop(&TRIPOD).unwrap();
        let [a, b, c, d] = TRIPOD;
        for directions in [[d, c, b, a], [b, d, a, c], [c, a, d, b]] {
            assert!((gdop(&directions).unwrap() / expected - 1.0).abs() < 1e-14);
            let opposite = directions.map(|direction| direction.map(|entry| -entry));
            assert!((gdop(&opposite).unwrap() / expected - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn four_on_one_cone_are_degenerate() {
        for height in [0.0, 0.3, 0.6, 0.95_f64] {
            let across = (1.0 - height * height).sqrt();
            let cone = [0.1, 1.3, 2.9, 4.4_f64]
                .map(|azimuth| [across * azimuth.sin(), across * azimuth.cos(), height]);
            assert!(matches!(gdop(&cone), Err(Gdop4Error::Degenerate { .. })));
        }
        let [a, b, c, _] = TRIPOD;
        assert!(matches!(
            gdop(&[a, b, c, a]),
            Err(Gdop4Error::Degenerate { .. })
        ));
    }

    #[test]
    fn what_is_no_direction_is_refused_by_its_index() {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 2.0, 1e200] {
            for index in 0..4 {
                let mut directions = TRIPOD;
                directions[index] = [0.0, value, 0.0];
                assert_eq!(gdop(&directions), Err(Gdop4Error::NotUnit { index }));
            }
        }
    }

    #[test]
    fn products_that_are_no_numbers_are_refused() {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e200] {
            for place in 0..6 {
                let mut pairs = [1.0; 6];
                pairs[place] = value;
                assert!(gdop_squared(&pairs).is_err());
            }
        }
    }
}
