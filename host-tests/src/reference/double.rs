//! Numbers of two f64, about 32 decimal digits: what a result of f64 is compared with where cancellation
//! may have cost digits.
//!
//! Sum and product without rounding error: [DEKKER-1971].

use std::ops::{Add, Div, Mul, Neg, Sub};

/// The unevaluated sum of two f64.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Double {
    high: f64,
    low: f64,
}

impl Double {
    /// 0.
    pub const ZERO: Self = Self {
        high: 0.0,
        low: 0.0,
    };

    /// The nearest f64.
    pub fn to_f64(self) -> f64 {
        self.high
    }
}

impl From<f64> for Double {
    fn from(high: f64) -> Self {
        Self { high, low: 0.0 }
    }
}

/// a + b and its rounding error.
fn two_sum(a: f64, b: f64) -> Double {
    let high = a + b;
    let of_b = high - a;
    let low = (a - (high - of_b)) + (b - of_b);
    Double { high, low }
}

/// The same where |a| ≥ |b|.
fn quick_two_sum(a: f64, b: f64) -> Double {
    let high = a + b;
    Double {
        high,
        low: b - (high - a),
    }
}

/// The two halves of a number's digits.
fn split(a: f64) -> (f64, f64) {
    let t = 134_217_729.0 * a;
    let high = t - (t - a);
    (high, a - high)
}

/// a b and its rounding error.
fn two_product(a: f64, b: f64) -> Double {
    let high = a * b;
    let ((ah, al), (bh, bl)) = (split(a), split(b));
    let low = ((ah * bh - high) + ah * bl + al * bh) + al * bl;
    Double { high, low }
}

impl Neg for Double {
    type Output = Self;
    fn neg(self) -> Self {
        Self {
            high: -self.high,
            low: -self.low,
        }
    }
}

impl Add for Double {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let s = two_sum(self.high, other.high);
        let t = two_sum(self.low, other.low);
        let s = quick_two_sum(s.high, s.low + t.high);
        quick_two_sum(s.high, s.low + t.low)
    }
}

impl Sub for Double {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Double {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let p = two_product(self.high, other.high);
        let cross = self.high * other.low + self.low * other.high;
        quick_two_sum(p.high, p.low + cross)
    }
}

impl Div for Double {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let first = self.high / other.high;
        let rest = self - other * first.into();
        let second = rest.high / other.high;
        let rest = rest - other * second.into();
        quick_two_sum(first, second) + (rest.high / other.high).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn double(value: f64) -> Double {
        value.into()
    }

    #[test]
    fn digits_below_those_of_f64_survive() {
        let small = double(1e-25);
        let sum = double(1.0) + small;
        assert_eq!((sum - double(1.0)).to_f64(), 1e-25);
        // (1 + 2⁻⁴⁰)² = 1 + 2⁻³⁹ + 2⁻⁸⁰
        let e = 2.0_f64.powi(-40);
        let square = double(1.0 + e) * double(1.0 + e);
        assert_eq!((square - double(1.0 + 2.0 * e)).to_f64(), e * e);
    }

    #[test]
    fn a_quotient_times_its_divisor_is_the_dividend() {
        let third = double(1.0) / double(3.0);
        let rest = third * double(3.0) - double(1.0);
        assert!(rest.to_f64().abs() < 1e-31);
        let q = double(2.0) / (double(7.0) + double(1e-20));
        let rest = q * (double(7.0) + double(1e-20)) - double(2.0);
        assert!(rest.to_f64().abs() < 1e-30);
    }
}
