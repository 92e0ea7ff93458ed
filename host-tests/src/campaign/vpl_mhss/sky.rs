//! GPS skies of `surefix campaign vpl-mhss`: directions from a place, no measurements.

use std::path::Path;

use anyhow::{Context, Result, bail};
use surefix_core::gnss::{Ephemeris, NavMessage, System};
use surefix_core::linalg::LinearModel;
use surefix_core::time::{GpsTime, NS_PER_S, start_of_day};

use crate::rinex::{NavigationFile, read_unzipped, text_of};
use crate::simulate::flight::{c_e_enu, ecef_from_geodetic};
use crate::simulate::orbit::position_frozen_e;
use crate::simulate::sky::{Sky, UPDATE_S, WEEK};

/// Length of the experiment, s. [P4] 3.2
pub const DURATION_S: i64 = 6 * 3600;
/// Start within the day, s.
const START_S: i64 = 4 * 3600;
/// Navigation file of the real sky, beside the recordings.
const BROADCASTS: &str = "esbc-2020-177/ESBC00DNK_R_20201770000_01D_MN.rnx.gz";

/// Latitude and longitude, degrees, height, m.
pub type Place = [f64; 3];

/// Where [P4] 3.1 begins its track; what it flies in ten minutes moves no direction.
pub const PLACE: Place = [40.0687, 116.2497, 100.0];

/// The orbits of a constellation over six hours.
pub struct GpsSky {
    /// In the tables.
    pub name: &'static str,
    /// What it is.
    pub about: String,
    start: GpsTime,
    /// By satellite.
    orbits: Vec<Vec<Ephemeris>>,
}

impl GpsSky {
    /// The 24 slots that every simulation flies under.
    pub fn simulated() -> Self {
        let start = GpsTime::from_week_tow_s(WEEK, START_S);
        let issues = START_S / UPDATE_S..=(START_S + DURATION_S) / UPDATE_S + 1;
        let orbits = Sky::new()
            .slots()
            .iter()
            .filter(|slot| slot.satellite.system() == System::Gps)
            .map(|slot| issues.clone().map(|issue| slot.broadcast(issue)).collect())
            .collect();
        Self::new(
            "24 slots",
            "the nominal constellation of the simulator",
            start,
            orbits,
        )
    }

    /// What GPS broadcast on 25 June 2020, from the folder of the recordings.
    ///
    /// # Errors
    /// When the file is absent or unusable.
    pub fn broadcast(data: &Path) -> Result<Self> {
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
        let day = start_of_day(2020, 6, 25).context("no such day")?;
        if orbits.is_empty() {
            bail!("{} holds no GPS ephemeris", path.display());
        }
        let start = day.plus_ns(START_S * NS_PER_S);
        let about = "what GPS broadcast on 25 June 2020";
        Ok(Self::new("broadcast", about, start, orbits))
    }

    fn new(name: &'static str, about: &str, start: GpsTime, orbits: Vec<Vec<Ephemeris>>) -> Self {
        let about = format!("{about}, {} satellites", orbits.len());
        Self {
            name,
            about,
            start,
            orbits,
        }
    }

    /// The rows of an epoch `since_s` after the start, all of one sigma, residuals zero.
    pub fn model(&self, since_s: i64, place: Place, mask_deg: f64, sigma_m: f64) -> LinearModel {
        let [latitude_deg, longitude_deg, height_m] = place;
        let time = self.start.plus_ns(since_s * NS_PER_S);
        let r_e_m = ecef_from_geodetic(latitude_deg, longitude_deg, height_m);
        let c_enu_e = c_e_enu(latitude_deg, longitude_deg).transpose();
        let mut model = LinearModel::EMPTY;
        model.m = 4;
        model.sigma_m = [sigma_m; surefix_core::consts::MAX_SATELLITES];
        for orbit in &self.orbits {
            let age = |ephemeris: &Ephemeris| time.seconds_since(ephemeris.toe).abs();
            let Some(nearest) = orbit.iter().min_by(|a, b| age(a).total_cmp(&age(b))) else {
                continue;
            };
            let since_toe_s = time.seconds_since(nearest.toe);
            let r_es_e_m = position_frozen_e(nearest, since_toe_s, since_toe_s);
            let direction = c_enu_e * (r_es_e_m - r_e_m).normalize();
            if direction.z < mask_deg.to_radians().sin() {
                continue;
            }
            let row = &mut model.design[model.n];
            row[..4].copy_from_slice(&[-direction.x, -direction.y, -direction.z, 1.0]);
            model.n += 1;
        }
        model
    }
}
