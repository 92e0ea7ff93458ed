//! A satellite as seen from a place: direction, atmospheric delay, sigma.
//!
//! In: where the satellite was, where the receiver is, the models chosen. Out: [`Sky`], all of a row
//! that depends on the direction, and so hardly on the position: computed once or twice per solution,
//! not once per Newton step.
//!
//! Equations: `klobuchar.rs`, `atmosphere.rs`, `weights.rs`; directions in `frames/geodesy.rs`.

use nalgebra::{Matrix3, Vector3};

use super::atmosphere::{troposphere_mapping, troposphere_zenith_m};
use super::klobuchar::{SkyPoint, geomagnetic_latitude_rad};
use super::measurement::{Measurement, range_geometry};
use super::signal::FREQUENCY_L1_HZ;
use super::weights::{IonosphereResidual, RowConditions, RowSigma, pseudorange_sigma};
use super::{BroadcastIonosphere, KlobucharParameters};
use crate::config::{Config, IonosphereModel, NoisePreset, TroposphereModel};
use crate::consts::SPEED_OF_LIGHT_MPS;
use crate::frames::geodesy;
use crate::time::GpsTime;

/// What depends on the direction only, and so hardly on the position.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sky {
    pub elevation_rad: f64,
    pub azimuth_rad: f64,
    pub sin_elevation: f64,
    /// Above the mask, and with a delay and a sigma that are numbers.
    pub above_mask: bool,
    /// Ionosphere and troposphere as the pseudorange has them, m.
    pub delay_m: f64,
    pub sigma: RowSigma,
}

impl Sky {
    /// Not looked at: no delay, and the weight of any other satellite.
    pub const UNSEEN: Self = Self {
        elevation_rad: 0.0,
        azimuth_rad: 0.0,
        sin_elevation: 0.0,
        above_mask: false,
        delay_m: 0.0,
        sigma: RowSigma {
            independent_m: 1.0,
            common_m: 0.0,
        },
    };
}

/// The part of the configuration a sky needs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Models {
    mask_rad: f64,
    ionosphere: IonosphereModel,
    troposphere: TroposphereModel,
    noise: NoisePreset,
    parameters: Option<KlobucharParameters>,
}

/// Where the receiver is, with what all satellites of the place share.
pub(super) struct Place {
    r_e: [f64; 3],
    llh: geodesy::Llh,
    c_enu_e: Matrix3<f64>,
    /// Delay of the troposphere in the zenith, m; `None` where none is modelled.
    zenith_m: Option<f64>,
}

impl Models {
    /// Before the first epoch.
    pub const NONE: Self = Self {
        mask_rad: 0.0,
        ionosphere: IonosphereModel::None,
        troposphere: TroposphereModel::None,
        noise: NoisePreset::Elevation,
        parameters: None,
    };

    pub fn new(config: &Config, ionosphere: &BroadcastIonosphere) -> Self {
        Self {
            mask_rad: config.mask_rad,
            ionosphere: config.ionosphere,
            troposphere: config.troposphere,
            noise: config.noise,
            parameters: ionosphere.parameters().copied(),
        }
    }

    /// Whether a correction is asked for that nothing was received for.
    pub fn no_broadcast_ionosphere(&self) -> bool {
        self.ionosphere == IonosphereModel::Klobuchar && self.parameters.is_none()
    }

    pub fn place(&self, r_e: [f64; 3], llh: geodesy::Llh) -> Place {
        Place {
            r_e,
            llh,
            c_enu_e: geodesy::c_enu_e(llh.lat_rad, llh.lon_rad),
            zenith_m: match self.troposphere {
                TroposphereModel::None => None,
                TroposphereModel::Saastamoinen => {
                    Some(troposphere_zenith_m(llh.lat_rad, llh.height_m))
                }
            },
        }
    }

    /// One satellite seen from one place.
    pub fn sky(&self, time: GpsTime, measurement: &Measurement, place: &Place) -> Sky {
        let geometry = range_geometry(measurement.r_e_m, place.r_e);
        let u_enu = place.c_enu_e * Vector3::from(geometry.line_of_sight_e);
        let direction = geodesy::direction(&u_enu);
        let mut sky = Sky {
            elevation_rad: direction.elevation_rad,
            azimuth_rad: direction.azimuth_rad,
            sin_elevation: u_enu.z,
            above_mask: direction.elevation_rad >= self.mask_rad,
            ..Sky::UNSEEN
        };
        if !sky.above_mask {
            return sky;
        }
        let at = SkyPoint {
            lat_rad: place.llh.lat_rad,
            lon_rad: place.llh.lon_rad,
            azimuth_rad: sky.azimuth_rad,
            elevation_rad: sky.elevation_rad,
        };
        let mut residual = IonosphereResidual::None;
        if self.ionosphere == IonosphereModel::Klobuchar {
            residual = IonosphereResidual::Uncorrected;
            let delay_s = self
                .parameters
                .and_then(|parameters| parameters.delay_s(time, &at, FREQUENCY_L1_HZ));
            if let Some(delay_s) = delay_s {
                let slant_m = delay_s * SPEED_OF_LIGHT_MPS;
                sky.delay_m += slant_m * measurement.ionosphere_scale;
                residual = IonosphereResidual::Corrected { slant_m };
            }
        }
        if let Some(zenith_m) = place.zenith_m {
            sky.delay_m += zenith_m * troposphere_mapping(sky.sin_elevation);
        }
        sky.sigma = pseudorange_sigma(
            self.noise,
            &RowConditions {
                satellite: measurement.satellite,
                elevation_rad: sky.elevation_rad,
                sin_elevation: sky.sin_elevation,
                sigma_ura_m: measurement.sigma_ura_m,
                noise_factor: measurement.noise_factor,
                ionosphere_scale: measurement.ionosphere_scale,
                ionosphere: residual,
                geomagnetic_latitude_rad: match self.noise {
                    NoisePreset::Elevation => 0.0,
                    NoisePreset::Airborne => geomagnetic_latitude_rad(&at),
                },
                troposphere: place.zenith_m.is_some(),
            },
        );
        // A sigma that is no number would carry the whole solution away.
        let usable = sky.sigma.independent_m > 0.0
            && sky.sigma.independent_m.is_finite()
            && sky.delay_m.is_finite();
        sky.above_mask = usable;
        sky
    }
}
