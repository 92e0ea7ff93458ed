//! Standard deviations of pseudoranges and range rates: named presets, each number with its source.
//!
//! A pseudorange error has two parts. The *independent* part differs from satellite to satellite and
//! weighs the rows: the covariance is diagonal. The *common* part is the residual ionosphere of
//! single-frequency use, one vertical error seen through each satellite's mapping: its covariance is
//! c cᵀ, with one factor c_i per satellite. Whole covariance: diag(independent²) + c cᵀ.
//!
//! | symbol | code                | unit | meaning                                        |
//! |--------|---------------------|------|------------------------------------------------|
//! | σ0     | zenith_sigma_m      | m    | code noise and multipath in the zenith         |
//! | σ_iv   | vertical_m          | m    | residual vertical ionospheric delay            |
//! | m(E)   | troposphere_mapping | 1    | see `atmosphere.rs`                            |
//! | F_pp   | ionosphere_mapping  | 1    | see `atmosphere.rs`                            |
//!
//! Equations: [P3] (3) → `elevation_model()`; [DO-229] J.2.3 to J.2.5 → `airborne_model()`.

use core::f64::consts::PI;

use super::atmosphere::{ionosphere_mapping, troposphere_mapping};
use super::{Satellite, System};
use crate::config::NoisePreset;

/// How the noise of [P3] (3) grows towards the horizon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SinePower {
    /// σ0² / sin E, as printed in [P3] (3).
    One,
    /// σ0² / sin² E, as other authors have it.
    Two,
}

/// The power [`NoisePreset::Elevation`] uses.
pub const ELEVATION_SINE_POWER: SinePower = SinePower::One;

/// σ0 of [P3] (3), m: GPS 0.3, BDS MEO and IGSO 0.6, BDS GEO 1.0. The paper gives no Galileo; its E1
/// signal has the bandwidth and power of GPS L1 C/A and better, so it gets the value of GPS.
pub const fn zenith_sigma_m(satellite: Satellite) -> f64 {
    match satellite.system() {
        System::Gps | System::Galileo => 0.3,
        System::Bds if satellite.is_bds_geo() => 1.0,
        System::Bds => 0.6,
    }
}

/// Share of the broadcast accuracy that [`NoisePreset::Elevation`] takes for one sigma.
///
/// URA and SISA are bounds: index 0 of GPS and BDS stands for everything up to 2.4 m
/// [IS-GPS-200] 20.3.3.3.1.3, of which the middle is half. [`NoisePreset::Airborne`] takes them whole.
pub const ELEVATION_URA_SHARE: f64 = 0.5;

/// Residual troposphere in the zenith, m. [DO-229] A.4.2.4.
pub const SIGMA_TROPOSPHERE_ZENITH_M: f64 = 0.12;

/// Share of the Klobuchar delay that remains as error in [`NoisePreset::Elevation`]. The model takes
/// out half of the delay, root mean square: [IS-GPS-200] 20.3.3.5.2.5.
pub const KLOBUCHAR_RESIDUAL_SHARE: f64 = 0.5;
/// Least residual of a Klobuchar correction in [`NoisePreset::Elevation`], vertical, m: half the
/// delay of 5 ns the model has at night.
pub const KLOBUCHAR_RESIDUAL_FLOOR_M: f64 = 0.75;
/// Vertical delay left in [`NoisePreset::Elevation`] when none is taken out, m: 30 TEC units, middle
/// latitudes by day at moderate solar activity.
pub const UNCORRECTED_VERTICAL_M: f64 = 5.0;
/// By how much more than after a Klobuchar correction the ionosphere is trusted less without one in
/// [`NoisePreset::Airborne`]: the correction halves the error, see [`KLOBUCHAR_RESIDUAL_SHARE`].
pub const UNCORRECTED_AIRBORNE_FACTOR: f64 = 2.0;

/// Share of the variance of the residual ionosphere that is common to all satellites. The rest is
/// how the residual differs between pierce points some hundred kilometres apart.
pub const IONOSPHERE_COMMON_SHARE: f64 = 0.9;

/// Receiver noise at the lowest signal level, m: accuracy designator A. [DO-229] 2.1.4.1.4, J.2.4.
pub const SIGMA_AIRBORNE_NOISE_M: f64 = 0.36;

/// Range-rate error in the zenith, m/s: tracking-loop noise of a moving receiver with the 3 mm/s of
/// the satellite's own clock and orbit [GPS-SPS-PS] 3.4.2. Grows with 1/√sin E as σ0 does.
pub const SIGMA_RANGE_RATE_ZENITH_MPS: f64 = 0.03;

/// What is left of the ionosphere in a pseudorange.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum IonosphereResidual {
    /// Nothing: combined away, or a simulation without one.
    None,
    /// What a Klobuchar correction leaves; its slant delay on L1, m.
    Corrected {
        /// The delay taken out, m.
        slant_m: f64,
    },
    /// All of it: no parameters were received.
    Uncorrected,
}

/// What the models ask of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowConditions {
    /// Which satellite.
    pub satellite: Satellite,
    /// Its elevation, rad.
    pub elevation_rad: f64,
    /// Sine of it.
    pub sin_elevation: f64,
    /// One sigma of the signal in space as broadcast, m.
    pub sigma_ura_m: f64,
    /// By how much a combination of signals multiplies noise and multipath, 1 for a single signal.
    pub noise_factor: f64,
    /// (f of L1 / f of the signal)².
    pub ionosphere_scale: f64,
    /// What is left of the ionosphere.
    pub ionosphere: IonosphereResidual,
    /// Geomagnetic latitude of the pierce point, rad.
    pub geomagnetic_latitude_rad: f64,
    /// Whether there is a troposphere.
    pub troposphere: bool,
}

/// One sigma of a pseudorange in its two parts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RowSigma {
    /// Differs between satellites, m.
    pub independent_m: f64,
    /// The same vertical error for all, as this satellite sees it, m.
    pub common_m: f64,
}

impl RowSigma {
    /// Root of the sum of the squares, m.
    pub fn total_m(self) -> f64 {
        libm::sqrt(self.independent_m * self.independent_m + self.common_m * self.common_m)
    }
}

/// One sigma of a pseudorange by a preset.
pub fn pseudorange_sigma(preset: NoisePreset, row: &RowConditions) -> RowSigma {
    match preset {
        NoisePreset::Elevation => elevation_model(row),
        NoisePreset::Airborne => airborne_model(row),
    }
}

/// 1 / sin E, or its square; below 2° what it is at 2°.
fn noise_growth(sin_elevation: f64, power: SinePower) -> f64 {
    const SIN_LOWEST: f64 = 0.034_899_496_702_500_97;
    let sin_elevation = if sin_elevation > SIN_LOWEST {
        sin_elevation
    } else {
        SIN_LOWEST
    };
    match power {
        SinePower::One => 1.0 / sin_elevation,
        SinePower::Two => 1.0 / (sin_elevation * sin_elevation),
    }
}

/// [P3] (3) with the broadcast accuracy, whose sum the paper leaves in σ0.
fn elevation_model(row: &RowConditions) -> RowSigma {
    let noise_m = zenith_sigma_m(row.satellite) * row.noise_factor;
    let var_noise = noise_m * noise_m * noise_growth(row.sin_elevation, ELEVATION_SINE_POWER);
    let ura_m = ELEVATION_URA_SHARE * row.sigma_ura_m;
    let mapping = ionosphere_mapping(row.sin_elevation);
    let slant_sigma_m = match row.ionosphere {
        IonosphereResidual::None => 0.0,
        IonosphereResidual::Corrected { slant_m } => {
            let residual_m = KLOBUCHAR_RESIDUAL_SHARE * slant_m;
            let floor_m = KLOBUCHAR_RESIDUAL_FLOOR_M * mapping;
            if residual_m > floor_m {
                residual_m
            } else {
                floor_m
            }
        }
        IonosphereResidual::Uncorrected => UNCORRECTED_VERTICAL_M * mapping,
    };
    combine(row, var_noise + ura_m * ura_m, slant_sigma_m)
}

/// [DO-229] J.2.4: noise and multipath of airborne equipment; J.2.3: ionosphere; J.2.5: troposphere;
/// URA as broadcast.
fn airborne_model(row: &RowConditions) -> RowSigma {
    let multipath_m = 0.13 + 0.53 * libm::exp(-row.elevation_rad * (18.0 / PI));
    let var_air = (multipath_m * multipath_m + SIGMA_AIRBORNE_NOISE_M * SIGMA_AIRBORNE_NOISE_M)
        * (row.noise_factor * row.noise_factor);
    let vertical_m = {
        let latitude = libm::fabs(row.geomagnetic_latitude_rad);
        if latitude <= 20.0 * PI / 180.0 {
            9.0
        } else if latitude <= 55.0 * PI / 180.0 {
            4.5
        } else {
            6.0
        }
    };
    let mapped_m = ionosphere_mapping(row.sin_elevation) * vertical_m;
    let slant_sigma_m = match row.ionosphere {
        IonosphereResidual::None => 0.0,
        IonosphereResidual::Corrected { slant_m } => {
            let fifth_m = slant_m / 5.0;
            if fifth_m > mapped_m {
                fifth_m
            } else {
                mapped_m
            }
        }
        IonosphereResidual::Uncorrected => UNCORRECTED_AIRBORNE_FACTOR * mapped_m,
    };
    combine(
        row,
        var_air + row.sigma_ura_m * row.sigma_ura_m,
        slant_sigma_m,
    )
}

/// Adds the troposphere to a variance and splits the ionosphere into its two parts.
fn combine(row: &RowConditions, variance: f64, slant_sigma_m: f64) -> RowSigma {
    let troposphere_m = if row.troposphere {
        SIGMA_TROPOSPHERE_ZENITH_M * troposphere_mapping(row.sin_elevation)
    } else {
        0.0
    };
    let slant_sigma_m = slant_sigma_m * row.ionosphere_scale;
    let var_ionosphere = slant_sigma_m * slant_sigma_m;
    let independent =
        variance + troposphere_m * troposphere_m + (1.0 - IONOSPHERE_COMMON_SHARE) * var_ionosphere;
    RowSigma {
        independent_m: libm::sqrt(independent),
        common_m: libm::sqrt(IONOSPHERE_COMMON_SHARE * var_ionosphere),
    }
}

/// One sigma of a range rate, m/s.
pub fn range_rate_sigma_mps(sin_elevation: f64) -> f64 {
    SIGMA_RANGE_RATE_ZENITH_MPS * libm::sqrt(noise_growth(sin_elevation, SinePower::One))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(system: System, prn: u8, elevation_deg: f64) -> RowConditions {
        let elevation_rad = elevation_deg.to_radians();
        RowConditions {
            satellite: Satellite::new(system, prn).unwrap(),
            elevation_rad,
            sin_elevation: elevation_rad.sin(),
            sigma_ura_m: 0.0,
            noise_factor: 1.0,
            ionosphere_scale: 1.0,
            ionosphere: IonosphereResidual::None,
            geomagnetic_latitude_rad: 0.0,
            troposphere: false,
        }
    }

    #[test]
    fn elevation_model_without_atmosphere_is_the_printed_one() {
        for (system, prn, sigma0_m) in [
            (System::Gps, 1, 0.3),
            (System::Bds, 6, 0.6),
            (System::Bds, 21, 0.6),
            (System::Bds, 3, 1.0),
            (System::Bds, 60, 1.0),
        ] {
            let sigma = pseudorange_sigma(NoisePreset::Elevation, &row(system, prn, 30.0));
            assert!((sigma.independent_m - sigma0_m * 2.0_f64.sqrt()).abs() < 1e-12);
            assert_eq!(sigma.common_m, 0.0);
        }
    }

    #[test]
    fn airborne_model_gives_the_figures_of_the_standard() {
        let mut airborne = row(System::Gps, 1, 10.0);
        let sigma = pseudorange_sigma(NoisePreset::Airborne, &airborne);
        let multipath_m = 0.13 + 0.53 / core::f64::consts::E;
        assert!((sigma.independent_m - multipath_m.hypot(0.36)).abs() < 1e-12);
        airborne.troposphere = true;
        let sigma = pseudorange_sigma(NoisePreset::Airborne, &airborne);
        assert!((sigma.independent_m - multipath_m.hypot(0.36).hypot(0.67)).abs() < 1e-3);
        airborne.elevation_rad = PI / 2.0;
        airborne.sin_elevation = 1.0;
        for (latitude_deg, vertical_m) in [(-10.0_f64, 9.0), (40.0, 4.5), (-70.0, 6.0)] {
            airborne.geomagnetic_latitude_rad = latitude_deg.to_radians();
            airborne.ionosphere = IonosphereResidual::Corrected { slant_m: 10.0 };
            let sigma = pseudorange_sigma(NoisePreset::Airborne, &airborne);
            assert!((sigma.common_m - vertical_m * IONOSPHERE_COMMON_SHARE.sqrt()).abs() < 1e-12);
            airborne.ionosphere = IonosphereResidual::Corrected { slant_m: 100.0 };
            let sigma = pseudorange_sigma(NoisePreset::Airborne, &airborne);
            assert!((sigma.common_m - 20.0 * IONOSPHERE_COMMON_SHARE.sqrt()).abs() < 1e-12);
        }
    }

    #[test]
    fn no_correction_is_never_trusted_more_than_a_correction() {
        for preset in [NoisePreset::Elevation, NoisePreset::Airborne] {
            for elevation_deg in [5.0, 10.0, 45.0, 90.0] {
                let mut conditions = row(System::Galileo, 1, elevation_deg);
                conditions.ionosphere = IonosphereResidual::Corrected {
                    slant_m: 3.0 * ionosphere_mapping(conditions.sin_elevation),
                };
                let corrected = pseudorange_sigma(preset, &conditions);
                conditions.ionosphere = IonosphereResidual::Uncorrected;
                let uncorrected = pseudorange_sigma(preset, &conditions);
                assert!(uncorrected.common_m > corrected.common_m);
                assert!(uncorrected.independent_m > corrected.independent_m);
            }
        }
    }

    #[test]
    fn sigmas_grow_towards_the_horizon_and_stay_finite_below_it() {
        for preset in [NoisePreset::Elevation, NoisePreset::Airborne] {
            let mut last_m = 0.0;
            for elevation_deg in [90.0, 60.0, 30.0, 10.0, 2.5] {
                let mut conditions = row(System::Gps, 9, elevation_deg);
                conditions.troposphere = true;
                conditions.sigma_ura_m = 2.0;
                conditions.ionosphere = IonosphereResidual::Uncorrected;
                let sigma = pseudorange_sigma(preset, &conditions);
                assert!(sigma.total_m() > last_m);
                last_m = sigma.total_m();
            }
            let sigma = pseudorange_sigma(preset, &row(System::Gps, 9, -5.0));
            assert!(sigma.total_m().is_finite());
        }
        assert!(range_rate_sigma_mps(0.1) > range_rate_sigma_mps(1.0));
        assert!(range_rate_sigma_mps(f64::NAN).is_finite());
    }
}
