//! Integrity support data and airborne errors to the satellite of an epoch.
//!
//! In: what a ground system broadcasts about a constellation, the elevation of a satellite. Out: its
//! [`AraimSatellite`].
//!
//! | symbol | code | unit | meaning |
//! |--------|------|------|---------|
//! | σ_URA, σ_URE | `ura_m`, `ure_m` | m | orbit and clock error for integrity, for accuracy |
//! | b_nom  | `b_nom_m` | m | largest nominal bias, for integrity |
//! | R, MFD | `fault_rate_per_s`, `mean_duration_s` | 1/s, s | onsets of faults and how long they last; P = R MFD |
//! | σ_tropo | [`troposphere_sigma_m`] | m | error of the troposphere's correction [DO-229] |
//! | σ_user | [`gps_user_sigma_m`], [`galileo_user_sigma_m`] | m | smoothed multipath and noise, ionosphere-free |
//!
//! C_int = σ_URA² + σ_tropo² + σ_user², C_acc = σ_URE² + σ_tropo² + σ_user².
//! [`IntegritySupport::BASELINE`] and [`IntegritySupport::COMMITTED`] are presets of three constellations.
//! Source: [BLANCH-2015] pseudorange covariances and Galileo table, [ARAIM-ADD] rates and exposure.
//! Keys: docs/references.md.

use super::{AraimConstellation, AraimSatellite};
use crate::consts::MAX_CLOCKS;
use crate::gnss::System;
use core::f64::consts::PI;

/// How often something fails, and for how long.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultRate {
    /// Probability that a fault is there at a given instant.
    pub p_instant: f64,
    /// Mean duration of a fault, s, positive.
    pub mean_duration_s: f64,
}

impl FaultRate {
    /// From the rate of onsets: P = R MFD.
    pub fn from_rate(fault_rate_per_s: f64, mean_duration_s: f64) -> Self {
        Self {
            p_instant: fault_rate_per_s * mean_duration_s,
            mean_duration_s,
        }
    }

    /// Exposure over mean duration. Without exposure, as in version 3, it is 0 whatever the duration.
    fn exposure(&self, exposure_s: f64) -> f64 {
        if exposure_s == 0.0 {
            0.0
        } else {
            exposure_s / self.mean_duration_s
        }
    }
}

/// The integrity support data of a constellation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntegritySupport {
    /// σ_URA, m.
    pub ura_m: f64,
    /// σ_URE, m.
    pub ure_m: f64,
    /// b_nom, m.
    pub b_nom_m: f64,
    /// Faults of one satellite.
    pub satellite: FaultRate,
    /// Faults of the constellation.
    pub constellation: FaultRate,
}

const HOUR_S: f64 = 3600.0;

/// A probability and a mean duration in hours.
const fn lasting(p_instant: f64, hours: f64) -> FaultRate {
    FaultRate {
        p_instant,
        mean_duration_s: hours * HOUR_S,
    }
}

impl IntegritySupport {
    /// GPS, Galileo and BDS as the studies of LPV-200 with version 3 assume them [BLANCH-2015]: what ARAIM is
    /// designed for, better than what is committed. The source has GPS and Galileo only: BDS is that of
    /// [`IntegritySupport::COMMITTED`] with the source's bias.
    pub const BASELINE: [Self; MAX_CLOCKS] = [
        Self::baseline(1e-8),
        Self::baseline(1e-4),
        Self {
            b_nom_m: 0.75,
            ..Self::BDS
        },
    ];

    /// GPS, Galileo and BDS with the fault probabilities that their operators commit to: GPS [GPS-SPS-PS],
    /// Galileo [GAL-OS-SDD], BDS [BDS-OS-PS]. URA and URE of GPS and Galileo for vertical guidance are those of the
    /// studies with version 4.2 [ARAIM-ADD]; for BDS see [`IntegritySupport::BDS`].
    pub const COMMITTED: [Self; MAX_CLOCKS] = [
        Self {
            ura_m: 2.0,
            ure_m: 1.0,
            b_nom_m: 0.0,
            satellite: lasting(1e-5, 1.0),
            constellation: lasting(1e-8, 1.0),
        },
        Self {
            ura_m: 3.0,
            ure_m: 1.0,
            b_nom_m: 0.0,
            satellite: lasting(3e-5, 1.5),
            constellation: lasting(2e-4, 2.0),
        },
        Self::BDS,
    ];

    /// BDS with satellites of its second generation among them. σ_URA bounds the worst of BDS-3 from 2020 to 2022
    /// [BDS-ISD-2025]; σ_URE is the 2.5 m at 95 % of [BDS-OS-PS], 1.3 m, and something for the code biases of
    /// the second generation, which recordings of 2020 and 2024 show.
    pub const BDS: Self = Self {
        ura_m: 4.0,
        ure_m: 1.5,
        b_nom_m: 0.0,
        satellite: lasting(1e-5, 1.0),
        constellation: lasting(6e-5, 1.0),
    };

    const fn baseline(p_constellation: f64) -> Self {
        Self {
            ura_m: 0.75,
            ure_m: 0.5,
            b_nom_m: 0.75,
            satellite: lasting(1e-5, 1.0),
            constellation: lasting(p_constellation, 1.0),
        }
    }

    /// A satellite of this constellation, number `constellation` of the epoch. The ranges are checked by
    /// [`super::Araim::evaluate`].
    pub fn satellite(
        &self,
        constellation: usize,
        design_enu: [f64; 3],
        elevation_rad: f64,
        user_sigma_m: f64,
        exposure_s: f64,
    ) -> AraimSatellite {
        let troposphere = troposphere_sigma_m(elevation_rad);
        let local = troposphere * troposphere + user_sigma_m * user_sigma_m;
        AraimSatellite {
            design_enu,
            constellation,
            variance_integrity_m2: self.ura_m * self.ura_m + local,
            variance_accuracy_m2: self.ure_m * self.ure_m + local,
            bias_integrity_m: self.b_nom_m,
            bias_accuracy_m: 0.0,
            p_fault: self.satellite.p_instant,
            exposure: self.satellite.exposure(exposure_s),
        }
    }

    /// The constellation itself.
    pub fn constellation(&self, exposure_s: f64) -> AraimConstellation {
        AraimConstellation {
            p_fault: self.constellation.p_instant,
            exposure: self.constellation.exposure(exposure_s),
        }
    }
}

/// σ_tropo, m: 0.12 m at the zenith, mapped to the elevation. [DO-229]
pub fn troposphere_sigma_m(elevation_rad: f64) -> f64 {
    let sine = libm::sin(elevation_rad);
    0.12 * 1.001 / libm::sqrt(0.002_001 + sine * sine)
}

/// σ_user of GPS, m: multipath and noise of [DO-229] models, times the gain of the ionosphere-free
/// combination of L1 and L5. [BLANCH-2015]
pub fn gps_user_sigma_m(elevation_rad: f64) -> f64 {
    // Over 10.23 MHz.
    airborne_sigma_m(elevation_rad, 154.0, 115.0)
}

/// σ_user of BDS, m: the models of GPS, ionosphere-free B1I and B3I. None is published for it.
pub fn bds_user_sigma_m(elevation_rad: f64) -> f64 {
    // Over 2.046 MHz.
    airborne_sigma_m(elevation_rad, 763.0, 620.0)
}

/// σ_user of a satellite of a system, m.
pub fn user_sigma_m(system: System, elevation_rad: f64) -> f64 {
    match system {
        System::Gps => gps_user_sigma_m(elevation_rad),
        System::Galileo => galileo_user_sigma_m(elevation_rad),
        System::Bds => bds_user_sigma_m(elevation_rad),
    }
}

/// Multipath and noise of one signal [DO-229], m, in the combination of two frequencies of this ratio.
fn airborne_sigma_m(elevation_rad: f64, first: f64, second: f64) -> f64 {
    let elevation_deg = elevation_rad * (180.0 / PI);
    let multipath = 0.13 + 0.53 * libm::exp(elevation_deg / -10.0);
    let noise = 0.15 + 0.43 * libm::exp(elevation_deg / -6.9);
    let (first, second) = (first * first, second * second);
    let gain = libm::sqrt(first * first + second * second) / (first - second);
    gain * libm::sqrt(multipath * multipath + noise * noise)
}

/// σ_user of Galileo, m, ionosphere-free E1 and E5a: table of [BLANCH-2015], linear between its entries, its
/// first entry below 5°.
pub fn galileo_user_sigma_m(elevation_rad: f64) -> f64 {
    /// At 5°, 10°, … 90°, m.
    const TABLE: [f64; 18] = [
        0.4529, 0.3553, 0.3063, 0.2638, 0.2593, 0.2555, 0.2504, 0.2438, 0.2396, 0.2359, 0.2339,
        0.2302, 0.2295, 0.2278, 0.2297, 0.2310, 0.2274, 0.2277,
    ];
    let position = elevation_rad * (180.0 / PI) / 5.0 - 1.0;
    let [first, .., last] = TABLE;
    let mut value = if position < 0.0 { first } else { last };
    for (index, (left, right)) in TABLE.iter().zip(TABLE.iter().skip(1)).enumerate() {
        let along = position - index as f64;
        if (0.0..=1.0).contains(&along) {
            value = left + (right - left) * along;
            break;
        }
    }
    // NaN in, NaN out.
    if position.is_nan() { position } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_grow_towards_the_horizon_and_nan_stays_nan() {
        for model in [gps_user_sigma_m, bds_user_sigma_m, troposphere_sigma_m] {
            for degree in 1..90 {
                let low = f64::from(degree).to_radians();
                assert!(model(low) > model(low + 0.01));
            }
        }
        assert_eq!(galileo_user_sigma_m(0.0), 0.4529);
        assert_eq!(galileo_user_sigma_m(10.0_f64.to_radians()), 0.3553);
        assert!((galileo_user_sigma_m(12.5_f64.to_radians()) - 0.3308).abs() < 1e-12);
        assert_eq!(galileo_user_sigma_m(PI / 2.0), 0.2277);
        assert!(galileo_user_sigma_m(f64::NAN).is_nan());
        assert!((gps_user_sigma_m(PI / 2.0) / 0.513_8 - 1.0).abs() < 1e-3);
    }

    #[test]
    fn each_system_has_its_own_user_error() {
        let at = 0.7;
        assert_eq!(user_sigma_m(System::Gps, at), gps_user_sigma_m(at));
        assert_eq!(user_sigma_m(System::Galileo, at), galileo_user_sigma_m(at));
        // B1I and B3I lie nearer to each other than L1 and L5: 3.53 against 2.59 times the noise of one.
        let ratio = user_sigma_m(System::Bds, at) / gps_user_sigma_m(at);
        assert!((ratio - 3.528 / 2.588).abs() < 2e-3, "{ratio}");
    }

    #[test]
    fn rate_and_duration_give_probability_and_exposure() {
        let rate = FaultRate::from_rate(1e-5 / 3600.0, 3600.0);
        assert!((rate.p_instant - 1e-5).abs() < 1e-20);
        assert_eq!(rate.exposure(0.0), 0.0);
        assert!((rate.exposure(150.0) - 150.0 / 3600.0).abs() < 1e-15);
    }
}
