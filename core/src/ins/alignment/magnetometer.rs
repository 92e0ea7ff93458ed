//! A magnetometer: its calibration, and the field it should find.
//!
//! In: the field in the magnetometer's axes. Out: the same in body axes without hard and soft iron.
//!
//! | symbol | code           | shape | unit | frame | meaning                                          |
//! |--------|----------------|-------|------|-------|--------------------------------------------------|
//! | o      | `hard_iron_s_ut` | 3   | µT   | s     | what the magnetometer reads where there is no field |
//! | M      | `soft_iron_b_s`  | 3×3 | 1    | s → b | takes away soft iron, scale and skew, and turns into body axes |
//! | D, I   | `declination_rad`, `dip_rad` | | rad |  | field east of north, and below the horizontal    |
//! | F      | `strength_ut`    | 1   | µT   |       | length of the field                              |
//! | σ_m    | `sigma_ut`       | 1   | µT   | b     | what calibration and surroundings leave, per axis |
//!
//! m_b = M (m_s − o); m_n = F (cos I cos D, cos I sin D, sin I).
//! D, I and F are configured, from a map or a model of the main field at the place and time of use, and
//! hold for some tens of kilometres. D changes with time: its sigma grows by [`DECLINATION_CHANGE_RAD_PER_Y`]
//! since `declination_year`.
//! Assumes: magnetised parts turn with the magnetometer and have not changed since it was calibrated.

use crate::time::GpsTime;
use nalgebra::{Matrix3, Vector3};

/// What is known of a magnetometer and of the field where it is used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Magnetometer {
    /// Hard iron, µT, axes of the magnetometer.
    pub hard_iron_s_ut: [f64; 3],
    /// Soft iron and mounting: from the magnetometer's axes to the body's, rows.
    pub soft_iron_b_s: [[f64; 3]; 3],
    /// Declination, rad: positive where the field points east of north.
    pub declination_rad: f64,
    /// One sigma of it, rad.
    pub sigma_declination_rad: f64,
    /// When it was so, decimal year.
    pub declination_year: f64,
    /// Dip, rad: positive where the field points down.
    pub dip_rad: f64,
    /// Strength, µT.
    pub strength_ut: f64,
    /// One sigma of the calibrated field per axis, µT.
    pub sigma_ut: f64,
}

/// Why a magnetometer cannot be used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MagnetometerError {
    /// A number that cannot be.
    OutOfRange {
        /// The number given.
        value: f64,
    },
    /// The matrix loses a direction, or mirrors.
    SoftIron {
        /// Its determinant.
        determinant: f64,
    },
}

/// Strongest main field on the ground is below 70 µT; with hard iron a sensor reads more.
const MAX_FIELD_UT: f64 = 1_000.0;
/// How far a soft-iron matrix may be from a rotation: factors on the determinant.
const DETERMINANT: core::ops::RangeInclusive<f64> = 0.1..=10.0;
/// Weakest strength that can be configured, µT: the main field is nowhere below 20.
const MIN_STRENGTH_UT: f64 = 10.0;
/// How fast declination changes, one sigma, rad per year: 0.2°.
pub const DECLINATION_CHANGE_RAD_PER_Y: f64 = 0.2 * core::f64::consts::PI / 180.0;
/// Years a declination may be from.
const YEARS: core::ops::RangeInclusive<f64> = 1900.0..=2200.0;
/// 6 January 1980, when GPS time began.
const GPS_EPOCH_YEAR: f64 = 1980.0 + 5.0 / 366.0;
/// Length of a mean Gregorian year, ns.
const NS_PER_YEAR: f64 = 365.2425 * 86_400.0e9;

impl Magnetometer {
    /// Checks every range.
    ///
    /// # Errors
    /// [`MagnetometerError`], the first found.
    pub fn check(&self) -> Result<(), MagnetometerError> {
        use core::f64::consts::{FRAC_PI_2, PI};
        let within = |value: f64, low: f64, high: f64| {
            if value >= low && value <= high {
                Ok(())
            } else {
                Err(MagnetometerError::OutOfRange { value })
            }
        };
        for value in self.hard_iron_s_ut {
            within(value, -MAX_FIELD_UT, MAX_FIELD_UT)?;
        }
        for value in self.soft_iron_b_s.iter().flatten() {
            within(*value, -10.0, 10.0)?;
        }
        within(self.declination_rad, -PI, PI)?;
        within(self.sigma_declination_rad, 0.0, 1.0)?;
        within(self.declination_year, *YEARS.start(), *YEARS.end())?;
        within(self.dip_rad, -FRAC_PI_2, FRAC_PI_2)?;
        within(self.strength_ut, MIN_STRENGTH_UT, MAX_FIELD_UT)?;
        within(self.sigma_ut, 1e-6, MAX_FIELD_UT)?;
        let determinant = self.matrix().determinant();
        if DETERMINANT.contains(&determinant) {
            Ok(())
        } else {
            Err(MagnetometerError::SoftIron { determinant })
        }
    }

    fn matrix(&self) -> Matrix3<f64> {
        let [[a, b, c], [d, e, f], [g, h, i]] = self.soft_iron_b_s;
        Matrix3::new(a, b, c, d, e, f, g, h, i)
    }

    /// The field in body axes, µT.
    pub fn calibrated(&self, field_s_ut: [f64; 3]) -> Vector3<f64> {
        self.matrix() * (Vector3::from(field_s_ut) - Vector3::from(self.hard_iron_s_ut))
    }

    /// The field as it should be, north, east, down, µT.
    pub fn field_n_ut(&self) -> Vector3<f64> {
        let (sin_dip, cos_dip) = libm::sincos(self.dip_rad);
        let (sin_d, cos_d) = libm::sincos(self.declination_rad);
        Vector3::new(cos_dip * cos_d, cos_dip * sin_d, sin_dip) * self.strength_ut
    }

    /// One sigma of the declination at `time`, rad.
    pub fn sigma_declination_rad(&self, time: GpsTime) -> f64 {
        let year = GPS_EPOCH_YEAR + time.ns() as f64 / NS_PER_YEAR;
        libm::hypot(
            self.sigma_declination_rad,
            (year - self.declination_year) * DECLINATION_CHANGE_RAD_PER_Y,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(crate) const CALIBRATED: Magnetometer = Magnetometer {
        hard_iron_s_ut: [12.0, -7.0, 30.0],
        soft_iron_b_s: [[0.0, 1.1, 0.0], [-0.9, 0.0, 0.02], [0.0, 0.03, 1.0]],
        declination_rad: 0.05,
        sigma_declination_rad: 0.005,
        declination_year: 2026.0,
        dip_rad: 1.1,
        strength_ut: 48.0,
        sigma_ut: 0.5,
    };

    #[test]
    fn iron_is_taken_off_and_the_axes_are_the_bodys() {
        let field_b = CALIBRATED.calibrated([12.0, -7.0, 30.0]);
        assert_eq!(field_b, Vector3::zeros());
        let field_b = CALIBRATED.calibrated([13.0, -7.0, 30.0]);
        assert_eq!(field_b, Vector3::new(0.0, -0.9, 0.0));
    }

    #[test]
    fn the_field_points_north_by_its_declination_and_down_by_its_dip() {
        let field = CALIBRATED.field_n_ut();
        assert!((field.norm() - 48.0).abs() < 1e-12);
        assert!((libm::atan2(field.y, field.x) - 0.05).abs() < 1e-15);
        assert!((libm::asin(field.z / 48.0) - 1.1).abs() < 1e-12);
    }

    #[test]
    fn a_declination_grows_old() {
        let at = |year: f64| GpsTime::from_ns(((year - GPS_EPOCH_YEAR) * NS_PER_YEAR) as i64);
        let now = CALIBRATED.sigma_declination_rad(at(2026.0));
        assert!((now - 0.005).abs() < 1e-9);
        let later = CALIBRATED.sigma_declination_rad(at(2036.0));
        assert!((later.to_degrees() - 2.02).abs() < 0.01);
        assert!((CALIBRATED.sigma_declination_rad(at(2016.0)) - later).abs() < 1e-9);
    }

    #[test]
    fn what_cannot_be_is_refused() {
        assert_eq!(CALIBRATED.check(), Ok(()));
        type Spoil = fn(&mut Magnetometer);
        let spoilt: [Spoil; 9] = [
            |m| m.hard_iron_s_ut[1] = f64::NAN,
            |m| m.soft_iron_b_s[2][2] = f64::INFINITY,
            |m| m.soft_iron_b_s[2] = [0.0; 3],
            |m| m.soft_iron_b_s[2][2] = -1.0,
            |m| m.declination_rad = 4.0,
            |m| m.sigma_declination_rad = -0.1,
            |m| m.dip_rad = 1.6,
            |m| m.strength_ut = 0.0,
            |m| m.sigma_ut = 0.0,
        ];
        for spoil in spoilt {
            let mut magnetometer = CALIBRATED;
            spoil(&mut magnetometer);
            assert!(magnetometer.check().is_err(), "{magnetometer:?}");
        }
        let mut old = CALIBRATED;
        old.declination_year = f64::NAN;
        assert!(old.check().is_err());
    }
}
