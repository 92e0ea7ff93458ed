//! Smooth functions of time that change from one constant to the next.
//!
//! A change is the quintic S(u) = 10u³ − 15u⁴ + 6u⁵, u from 0 to 1: value, first and second derivative
//! are continuous everywhere. Integrals are exact.

/// A change of value.
#[derive(Clone, Copy, Debug)]
struct Change {
    from_s: f64,
    length_s: f64,
    before: f64,
    after: f64,
    /// Integral of the profile from 0 to `from_s`.
    integral: f64,
}

/// A function of time, s, constant before the first change and after the last.
#[derive(Clone, Debug)]
pub struct Profile {
    initial: f64,
    changes: Vec<Change>,
}

/// A value and its first derivative by time; operations carry both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moving {
    /// The value.
    pub value: f64,
    /// Its rate, 1/s.
    pub rate: f64,
}

impl Profile {
    /// A constant.
    pub const fn constant(value: f64) -> Self {
        Self {
            initial: value,
            changes: Vec::new(),
        }
    }

    /// Changes to `value` between two times, which must not lie before the end of the last change.
    pub fn change(&mut self, from_s: f64, to_s: f64, value: f64) {
        let end_s = self.changes.last().map_or(0.0, |c| c.from_s + c.length_s);
        assert!(
            from_s >= end_s && to_s > from_s,
            "a change from {from_s} s to {to_s} s after one that ends at {end_s} s"
        );
        let change = Change {
            from_s,
            length_s: to_s - from_s,
            before: self.at(from_s).value,
            after: value,
            integral: self.integral(from_s),
        };
        self.changes.push(change);
    }

    /// The last change that began, and how far it is, s.
    fn current(&self, t_s: f64) -> Option<(&Change, f64)> {
        let begun = self.changes.partition_point(|c| c.from_s <= t_s);
        let change = self.changes.get(begun.checked_sub(1)?)?;
        Some((change, t_s - change.from_s))
    }

    /// Value and rate.
    pub fn at(&self, t_s: f64) -> Moving {
        let Some((change, since_s)) = self.current(t_s) else {
            return Moving::constant(self.initial);
        };
        if since_s >= change.length_s {
            return Moving::constant(change.after);
        }
        let u = since_s / change.length_s;
        let rise = change.after - change.before;
        Moving {
            value: change.before + rise * (u * u * u * (10.0 + u * (-15.0 + 6.0 * u))),
            rate: rise / change.length_s * (30.0 * u * u * (1.0 - u) * (1.0 - u)),
        }
    }

    /// Integral from 0 to `t_s`.
    pub fn integral(&self, t_s: f64) -> f64 {
        let Some((change, since_s)) = self.current(t_s) else {
            return self.initial * t_s;
        };
        let rise = change.after - change.before;
        if since_s >= change.length_s {
            // The integral of S from 0 to 1 is one half.
            return change.integral + change.after * since_s - 0.5 * rise * change.length_s;
        }
        let u = since_s / change.length_s;
        let s_integral = u * u * u * u * (2.5 + u * (-3.0 + u));
        change.integral + change.before * since_s + rise * change.length_s * s_integral
    }
}

impl Moving {
    /// A value that does not change.
    pub const fn constant(value: f64) -> Self {
        Self { value, rate: 0.0 }
    }

    /// Its sine and cosine.
    pub fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = (libm::sin(self.value), libm::cos(self.value));
        (
            Self {
                value: sin,
                rate: cos * self.rate,
            },
            Self {
                value: cos,
                rate: -sin * self.rate,
            },
        )
    }

    /// Its arc tangent.
    pub fn atan(self) -> Self {
        Self {
            value: libm::atan(self.value),
            rate: self.rate / (1.0 + self.value * self.value),
        }
    }
}

impl core::ops::Add for Moving {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            rate: self.rate + other.rate,
        }
    }
}

impl core::ops::Mul for Moving {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            rate: self.rate * other.value + self.value * other.rate,
        }
    }
}

impl core::ops::Mul<f64> for Moving {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self {
            value: self.value * factor,
            rate: self.rate * factor,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Profile {
        let mut profile = Profile::constant(2.0);
        profile.change(3.0, 5.0, -1.0);
        profile.change(5.0, 6.0, 4.0);
        profile
    }

    #[test]
    fn rate_and_integral_belong_to_the_value() {
        let profile = example();
        let step_s = 1e-4;
        for k in 1..80 {
            let t_s = 0.1 * f64::from(k);
            let (before, after) = (profile.at(t_s - step_s), profile.at(t_s + step_s));
            let rate = (after.value - before.value) / (2.0 * step_s);
            assert!((profile.at(t_s).rate - rate).abs() < 1e-5, "rate at {t_s}");
            let slope =
                (profile.integral(t_s + step_s) - profile.integral(t_s - step_s)) / (2.0 * step_s);
            assert!((profile.at(t_s).value - slope).abs() < 1e-5, "at {t_s}");
        }
        assert_eq!(profile.at(9.0), Moving::constant(4.0));
    }

    #[test]
    fn second_derivatives_are_continuous() {
        let profile = example();
        let step_s = 1e-5;
        for knot_s in [3.0, 5.0, 6.0] {
            let bend = |t_s: f64| {
                (profile.at(t_s + step_s).rate - profile.at(t_s - step_s).rate) / (2.0 * step_s)
            };
            assert!((bend(knot_s - 2e-5) - bend(knot_s + 2e-5)).abs() < 0.02);
        }
    }

    #[test]
    fn moving_values_carry_the_rate_through_every_operation() {
        let at = |t: f64| {
            let x = Moving {
                value: 0.3 * t,
                rate: 0.3,
            };
            let (sin, cos) = x.sin_cos();
            (sin * cos + x * 2.0).atan()
        };
        let rate = (at(1.0 + 1e-6).value - at(1.0 - 1e-6).value) / 2e-6;
        assert!((at(1.0).rate - rate).abs() < 1e-9);
    }
}
