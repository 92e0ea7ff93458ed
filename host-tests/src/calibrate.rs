//! `surefix calibrate-magnetometer`: hard and soft iron of a magnetometer from readings all around.
//!
//! In: a CSV of readings while the vehicle, or the magnetometer with all that is fixed to it, was turned
//! through as many attitudes as possible in one place. Out: the section `[imu.magnetometer]`, but for what a
//! map of the Earth's field says.
//!
//! | symbol | code | shape | unit | meaning |
//! |---|---|---|---|---|
//! | m | reading | 3 | µT | axes of the magnetometer |
//! | o | `hard_iron_ut` | 3 | µT | centre of the ellipsoid |
//! | A, b | | 3×3, 3 | | mᵀ A m + bᵀ m = 1, by least squares over the readings |
//! | S | `soft_iron` | 3×3 | 1 | symmetric, turned by the mounting |
//!
//! Readings of one field in all attitudes lie on an ellipsoid; S (m − o) lies on a sphere of the field's
//! strength F: o = −A⁻¹ b/2, S² = F² A/(1 + oᵀ A o). A rotation of S leaves the sphere what it is, so
//! that readings alone do not tell how the magnetometer is mounted: that is given. Derived here.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use crate::imu::mounting_c_b_s;
use crate::static_imu::triple;

/// Fewest readings to fit nine numbers to.
const MIN_READINGS: usize = 30;
/// Readings that see less of the sphere than this determine no ellipsoid: least eigenvalue of the normal
/// equations over the largest, readings in units of their size.
const MIN_COVERAGE: f64 = 1.0e-3;

/// Arguments of `surefix calibrate-magnetometer`.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// CSV with three columns: the field in the axes of the magnetometer, µT; a first line of names is skipped
    pub file: PathBuf,
    /// Strength of the Earth's field there, µT, from a map or a model of it
    #[arg(long, value_name = "MICROTESLA")]
    pub strength_ut: f64,
    /// How the magnetometer is mounted, degrees: as in section [imu.mounting]
    #[arg(
        long,
        value_name = "ROLL,PITCH,YAW",
        default_value = "0,0,0",
        allow_hyphen_values = true
    )]
    pub mounting: String,
}

/// What readings say of a magnetometer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// What it reads where there is no field, µT.
    pub hard_iron_ut: Vector3<f64>,
    /// Takes the rest to a sphere of the field's strength; symmetric.
    pub soft_iron: Matrix3<f64>,
    /// Root mean square of what is left of the length, µT.
    pub sigma_ut: f64,
}

/// Fits an ellipsoid to readings of a field of this strength.
///
/// # Errors
/// When the readings are too few, or of too few attitudes; the message tells what to do.
pub fn fit(readings: &[Vector3<f64>], strength_ut: f64) -> Result<Calibration> {
    if readings.len() < MIN_READINGS {
        bail!(
            "{} readings are too few: give {MIN_READINGS} at least, of attitudes all around",
            readings.len()
        );
    }
    // About their mean and in units of their size, so that all coefficients are of one size.
    let count = readings.len() as f64;
    let mean = readings.iter().sum::<Vector3<f64>>() / count;
    let squares: f64 = readings.iter().map(|m| (m - mean).norm_squared()).sum();
    let size = (squares / count).sqrt();
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    let mut right = SVector::<f64, 9>::zeros();
    for reading in readings {
        let m = (reading - mean) / size;
        let (x, y, z) = (m.x, m.y, m.z);
        let row = SVector::<f64, 9>::from([
            x * x,
            y * y,
            z * z,
            2.0 * x * y,
            2.0 * x * z,
            2.0 * y * z,
            x,
            y,
            z,
        ]);
        normal += row * row.transpose() / count;
        right += row / count;
    }
    let eigenvalues = normal.symmetric_eigenvalues();
    if !(eigenvalues.min() > MIN_COVERAGE * eigenvalues.max()) {
        bail!(
            "the readings are of too few attitudes to tell hard and soft iron apart: turn the magnetometer about all its axes"
        );
    }
    let solved = normal
        .cholesky()
        .context("the readings determine no ellipsoid")?
        .solve(&right);
    let a = Matrix3::new(
        solved[0], solved[3], solved[4], solved[3], solved[1], solved[5], solved[4], solved[5],
        solved[2],
    );
    let b = Vector3::new(solved[6], solved[7], solved[8]);
    let centre = a
        .try_inverse()
        .map(|inverse| inverse * b * -0.5)
        .context("the readings determine no ellipsoid")?;
    let scale = 1.0 + centre.dot(&(a * centre));
    let shape = (a / scale).symmetric_eigen();
    if !(scale > 0.0 && shape.eigenvalues.min() > 0.0) {
        bail!(
            "the readings lie on no ellipsoid: the field around must be the same for all of them"
        );
    }
    let roots = shape.eigenvalues.map(f64::sqrt);
    let root = shape.eigenvectors * Matrix3::from_diagonal(&roots) * shape.eigenvectors.transpose();
    let soft_iron = root * (strength_ut / size);
    let hard_iron_ut = mean + centre * size;
    let left: f64 = readings
        .iter()
        .map(|m| ((soft_iron * (m - hard_iron_ut)).norm() - strength_ut).powi(2))
        .sum();
    Ok(Calibration {
        hard_iron_ut,
        soft_iron,
        sigma_ut: (left / count).sqrt(),
    })
}

/// Reads the readings of a CSV.
///
/// # Errors
/// When it cannot be read or a line is no reading.
pub fn read(path: &Path) -> Result<Vec<Vector3<f64>>> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let mut readings = Vec::new();
    for (number, line) in text.lines().enumerate() {
        match triple("the reading", line) {
            Ok(reading) => readings.push(Vector3::from(reading)),
            Err(_) if number == 0 || line.trim().is_empty() => {}
            Err(error) => {
                return Err(error.context(format!("{}, line {}", path.display(), number + 1)));
            }
        }
    }
    Ok(readings)
}

/// Section `[imu.magnetometer]`, with what a map of the field has to say left to be filled in.
pub fn section(calibration: &Calibration, mounting_deg: [f64; 3], strength_ut: f64) -> String {
    let rows = mounting_c_b_s(mounting_deg).map(nalgebra::RowVector3::from);
    let m = Matrix3::from_rows(&rows) * calibration.soft_iron;
    let [x, y, z]: [f64; 3] = calibration.hard_iron_ut.into();
    let row = |k: usize| format!("[{:.5}, {:.5}, {:.5}]", m[(k, 0)], m[(k, 1)], m[(k, 2)]);
    format!(
        "[imu.magnetometer]\n\
         hard_iron_ut = [{x:.3}, {y:.3}, {z:.3}]\n\
         soft_iron = [{}, {}, {}]\n\
         strength_ut = {strength_ut}\n\
         # What is left of the length; surroundings where it is used may add to it.\n\
         sigma_ut = {:.3}\n\
         # From a map or a model of the Earth's field, for the place and the year of use:\n\
         # declination_deg, sigma_declination_deg, declination_year, dip_deg\n",
        row(0),
        row(1),
        row(2),
        calibration.sigma_ut
    )
}

/// Runs `surefix calibrate-magnetometer`.
///
/// # Errors
/// When the arguments or the file are unusable; the message tells what to do.
pub fn run(args: &Args) -> Result<()> {
    if !(10.0..=1000.0).contains(&args.strength_ut) {
        bail!(
            "--strength-ut {} is not between 10 and 1000: the Earth's field has 22 to 67",
            args.strength_ut
        );
    }
    let mounting_deg = triple("--mounting", &args.mounting)?;
    let readings = read(&args.file)?;
    let calibration = fit(&readings, args.strength_ut)?;
    println!("# {} readings", readings.len());
    print!("{}", section(&calibration, mounting_deg, args.strength_ut));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha20Rng;
    use rand_chacha::rand_core::SeedableRng;

    use crate::simulate::inertial::sensors::normal3;

    /// Readings of a field of 48 µT in random directions.
    fn readings(noise_ut: f64, flat: bool) -> (Vec<Vector3<f64>>, Vector3<f64>, Matrix3<f64>) {
        let mut random = ChaCha20Rng::seed_from_u64(5);
        let hard = Vector3::new(20.0, -35.0, 60.0);
        let soft = Matrix3::new(1.1, 0.05, -0.02, 0.05, 0.9, 0.03, -0.02, 0.03, 1.0);
        let inverse = soft.try_inverse().unwrap();
        let all = (0..400)
            .map(|_| {
                let mut direction = normal3(&mut random);
                if flat {
                    direction.z = 0.02 * direction.norm();
                }
                let field = direction.normalize() * 48.0;
                inverse * field + hard + normal3(&mut random) * noise_ut
            })
            .collect();
        (all, hard, soft)
    }

    #[test]
    fn iron_is_what_it_was() {
        let (exact, hard, soft) = readings(0.0, false);
        let found = fit(&exact, 48.0).unwrap();
        assert!((found.hard_iron_ut - hard).norm() < 1e-8);
        assert!((found.soft_iron - soft).norm() < 1e-10);
        assert!(found.sigma_ut < 1e-8);
        let (noisy, ..) = readings(0.3, false);
        let found = fit(&noisy, 48.0).unwrap();
        assert!((found.hard_iron_ut - hard).norm() < 0.3, "{found:?}");
        assert!((found.soft_iron - soft).norm() < 0.01, "{found:?}");
        assert!((found.sigma_ut - 0.3).abs() < 0.05, "{found:?}");
    }

    #[test]
    fn readings_that_do_not_tell_are_refused() {
        let (flat, ..) = readings(0.1, true);
        let error = fit(&flat, 48.0).unwrap_err().to_string();
        assert!(error.contains("too few attitudes"), "{error}");
        let (few, ..) = readings(0.1, false);
        assert!(fit(&few[..20], 48.0).is_err());
        let mut spoilt = few.clone();
        spoilt[7].x = f64::NAN;
        assert!(fit(&spoilt, 48.0).is_err());
    }

    #[test]
    fn the_section_is_one_of_a_configuration() {
        let (exact, ..) = readings(0.3, false);
        let text = section(&fit(&exact, 48.0).unwrap(), [180.0, 0.0, 90.0], 48.0);
        let filled = text
            + "declination_deg = 4\nsigma_declination_deg = 0.5\ndeclination_year = 2026.5\ndip_deg = 67\n";
        let value: toml::Table = toml::from_str(&filled).unwrap();
        let settings = value["imu"]["magnetometer"].as_table().unwrap();
        assert_eq!(settings["soft_iron"].as_array().unwrap().len(), 3);
    }
}
