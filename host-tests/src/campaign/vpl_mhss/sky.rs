//! What GPS broadcast on a day, as a sky: directions from any place, no measurements.

use std::path::Path;

use anyhow::{Context, Result, bail};
use surefix_core::gnss::solution::UsedRow;
use surefix_core::gnss::weights::RowSigma;
use surefix_core::gnss::{Ephemeris, NavMessage};
use surefix_core::linalg::LinearModel;
use surefix_core::time::{GpsTime, NS_PER_S, start_of_day};

use crate::campaign::gps_hours::SkyEpoch;
use crate::rinex::{NavigationFile, read_unzipped, text_of};
use crate::simulate::flight::{c_e_enu, ecef_from_geodetic};
use crate::simulate::orbit::position_frozen_e;

/// Start within the day, s.
const START_S: i64 = 4 * 3600;
/// Navigation file of the sky, beside the recordings.
const BROADCASTS: &str = "esbc-2020-177/ESBC00DNK_R_20201770000_01D_MN.rnx.gz";

/// The orbits of the GPS satellites on 25 June 2020.
pub struct BroadcastSky {
    start: GpsTime,
    /// By satellite.
    orbits: Vec<Vec<Ephemeris>>,
}

impl BroadcastSky {
    /// Reads them from the folder of the recordings.
    ///
    /// # Errors
    /// When the file is absent or unusable.
    pub fn read(data: &Path) -> Result<Self> {
        let path = data.join(BROADCASTS);
        let bytes = read_unzipped(&path).with_context(|| {
            format!("{BROADCASTS} is needed: tell where esbc-2020-177 is with --data")
        })?;
        let file = NavigationFile::parse(&text_of(bytes)?.0)?;
        let mut orbits: Vec<Vec<Ephemeris>> = Vec::new();
        for timed in &file.ephemerides {
            let ephemeris = timed.ephemeris;
            if ephemeris.message != NavMessage::GpsLnav || ephemeris.health != 0 {
                continue;
            }
            let mut known = orbits.iter_mut();
            match known.find(|orbit| orbit[0].satellite == ephemeris.satellite) {
                Some(orbit) => orbit.push(ephemeris),
                None => orbits.push(vec![ephemeris]),
            }
        }
        if orbits.is_empty() {
            bail!("{} holds no GPS ephemeris", path.display());
        }
        let day = start_of_day(2020, 6, 25).context("no such day")?;
        Ok(Self {
            start: day.plus_ns(START_S * NS_PER_S),
            orbits,
        })
    }

    /// Satellites in it.
    pub fn satellites(&self) -> usize {
        self.orbits.len()
    }

    /// What is seen above a mask from a latitude and longitude, degrees, and a height, m, with sigmas by the sine
    /// of the elevation, m.
    pub fn epoch(
        &self,
        t_s: f64,
        (latitude_deg, longitude_deg, height_m): (f64, f64, f64),
        mask_deg: f64,
        sigma_m: impl Fn(f64) -> f64,
    ) -> SkyEpoch {
        let time = self.start.plus_ns(libm::round(t_s * 1e9) as i64);
        let r_e_m = ecef_from_geodetic(latitude_deg, longitude_deg, height_m);
        let c_enu_e = c_e_enu(latitude_deg, longitude_deg).transpose();
        let mut model = LinearModel::EMPTY;
        model.m = 4;
        let mut rows = Vec::new();
        for orbit in &self.orbits {
            let age_s = |ephemeris: &Ephemeris| time.seconds_since(ephemeris.toe).abs();
            let Some(nearest) = orbit.iter().min_by(|a, b| age_s(a).total_cmp(&age_s(b))) else {
                continue;
            };
            let since_toe_s = time.seconds_since(nearest.toe);
            let r_es_e_m = position_frozen_e(nearest, since_toe_s, since_toe_s);
            let [east, north, up] = (c_enu_e * (r_es_e_m - r_e_m).normalize()).into();
            if up < mask_deg.to_radians().sin() {
                continue;
            }
            model.design[model.n][..4].copy_from_slice(&[-east, -north, -up, 1.0]);
            model.sigma_m[model.n] = sigma_m(up);
            rows.push(UsedRow {
                satellite: nearest.satellite,
                elevation_rad: libm::asin(up),
                azimuth_rad: libm::atan2(east, north),
                sigma: RowSigma {
                    independent_m: model.sigma_m[model.n],
                    common_m: 0.0,
                },
            });
            model.n += 1;
        }
        SkyEpoch { t_s, model, rows }
    }
}
