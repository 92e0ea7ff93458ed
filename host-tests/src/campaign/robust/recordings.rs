//! The recordings of `surefix campaign robust`, each epoch linearised at its solution without faults.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use surefix_core::config::Config;
use surefix_core::gnss::satellite::SystemSet;
use surefix_core::gnss::solution::{RangeRates, UsedRow};
use surefix_core::gnss::{Satellite, System};
use surefix_core::linalg::LinearModel;

use crate::linearised::{self, Linearised, Lineariser};
use crate::simulate::noise::normal;
use crate::source::Recording;
use crate::truth::Truth;

/// An epoch ready to be estimated.
pub struct Prepared {
    /// Linearised at the solution without faults, sigmas of the whole error.
    pub model: Box<LinearModel>,
    /// Its satellites.
    pub rows: Vec<UsedRow>,
    /// Error of the point of linearisation, east, north, up, m.
    pub at_enu_m: [f64; 3],
    /// True velocity east, north, up, m/s, where the truth goes on around the epoch.
    pub velocity_enu_mps: Option<[f64; 3]>,
    /// Range rates of the same satellites, taken at rest, m/s.
    pub rates: Box<RangeRates>,
}

impl Prepared {
    /// The row of a satellite.
    pub fn row_of(&self, satellite: Satellite) -> Option<usize> {
        linearised::row_of(&self.rows, satellite)
    }
}

/// A recording.
pub struct Subject {
    /// In the tables.
    pub name: &'static str,
    /// What it is.
    pub about: &'static str,
    /// Its epochs with a solution and a truth.
    pub epochs: Vec<Prepared>,
}

/// Where a recording is and what it is.
#[derive(Clone, Copy)]
pub struct Place {
    /// In the tables.
    pub name: &'static str,
    /// What it is, in words.
    pub about: &'static str,
    gnss: &'static str,
    nav: &'static [&'static str],
    truth: PlaceTruth,
    /// Constellations to use.
    pub systems: [System; 2],
    /// Errors of the model's independent sigma are added: a simulator's pseudoranges have none.
    add_noise: bool,
}

/// Where the antenna was.
#[derive(Clone, Copy)]
enum PlaceTruth {
    /// As the header of the observations says.
    Header,
    /// A file with latitude, longitude and height.
    Point(&'static str),
    /// A file with a track.
    Track(&'static str),
}

/// A day at Esbjerg.
pub const ESBC: Place = Place {
    name: "esbc",
    about: "static, 24 h, one epoch in 30 s, GPS and BDS",
    gnss: "esbc-2020-177/ESBC00DNK_R_20201770000_01D_30S_MO.crx.gz",
    nav: &["esbc-2020-177/ESBC00DNK_R_20201770000_01D_MN.rnx.gz"],
    truth: PlaceTruth::Header,
    systems: [System::Gps, System::Bds],
    add_noise: false,
};

/// Four hours of it.
pub const ESBC_FOUR_HOURS: Place = Place {
    about: "static, 4 h, one epoch in 30 s, GPS and BDS",
    gnss: "esbc-2020-177/ESBC_2020177_0000-0400.rnx",
    ..ESBC
};

/// Five minutes of a receiver at Nagoya.
pub const NAGOYA: Place = Place {
    name: "nagoya",
    about: "static, 5 min, 1 Hz, GPS and BDS",
    gnss: "matrtklib-static-2024/rover.obs",
    nav: &["matrtklib-static-2024/base.nav"],
    truth: PlaceTruth::Point("matrtklib-static-2024/rover_position.txt"),
    systems: [System::Gps, System::Bds],
    add_noise: false,
};

/// Ten minutes of a simulator's flight.
pub const FLIGHT: Place = Place {
    name: "spirent",
    about: "simulated flight, 10 min, 1 Hz, GPS and Galileo, noise of one sigma added",
    gnss: "instinct-spirent-dynamic-10min/iono-Klob_tropo-Saast/Rover-dynamic_MO_Spirent.obs",
    nav: &[
        "instinct-spirent-dynamic-10min/RINEX_GN_Spirent.23N",
        "instinct-spirent-dynamic-10min/RINEX_EN_Spirent.23L",
    ],
    truth: PlaceTruth::Track("instinct-spirent-dynamic-10min/Rover-dynamic_PVA_Spirent.csv"),
    systems: [System::Gps, System::Galileo],
    add_noise: true,
};

/// A walk of two minutes among buildings and trees.
pub const WALK: Place = Place {
    name: "walk",
    about: "on foot among obstructions, 134 s, 4 Hz, GPS and Galileo",
    gnss: "walk0827-x20p-imu/derived_convbin.obs",
    nav: &["walk0827-x20p-imu/derived_convbin.nav"],
    truth: PlaceTruth::Track("walk0827-x20p-imu/gnss_1730.ubx"),
    systems: [System::Gps, System::Galileo],
    add_noise: false,
};

/// The recordings in a folder; `short` takes four hours of the day.
///
/// # Errors
/// When one is absent or unusable.
pub fn subjects(data: &Path, config: &Config, seed: u64, short: bool) -> Result<Vec<Subject>> {
    let esbc = if short { ESBC_FOUR_HOURS } else { ESBC };
    [esbc, NAGOYA, FLIGHT]
        .iter()
        .map(|place| read(data, place, config, seed))
        .collect()
}

impl Place {
    /// As it was measured, with these constellations.
    pub fn as_measured(self, systems: [System; 2]) -> Self {
        Self {
            systems,
            add_noise: false,
            ..self
        }
    }

    /// Whether a simulator made it, without errors of its own.
    pub fn is_simulated(&self) -> bool {
        self.name == FLIGHT.name
    }

    /// `None` where the header of the observations has to say it.
    fn truth(&self, data: &Path) -> Result<Option<Truth>> {
        match self.truth {
            PlaceTruth::Header => Ok(None),
            PlaceTruth::Track(file) => Truth::read(&data.join(file)).map(Some),
            PlaceTruth::Point(file) => point(&data.join(file)).map(Some),
        }
    }
}

/// An antenna that stands where a file says.
fn point(path: &Path) -> Result<Truth> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let numbers: Vec<f64> = text
        .split_whitespace()
        .filter_map(|word| word.parse().ok())
        .collect();
    match numbers[..] {
        [lat_deg, lon_deg, height_m] => Ok(Truth::fixed_llh(
            [lat_deg, lon_deg, height_m],
            path.display().to_string(),
        )),
        _ => bail!(
            "{} does not hold latitude, longitude and height",
            path.display()
        ),
    }
}

/// The epochs of one recording, of the constellations of the place.
///
/// # Errors
/// When it is absent or unusable.
pub fn read(data: &Path, place: &Place, config: &Config, seed: u64) -> Result<Subject> {
    let mut config = *config;
    config.systems = place
        .systems
        .into_iter()
        .fold(SystemSet::EMPTY, SystemSet::with);
    let nav: Vec<PathBuf> = place.nav.iter().map(|file| data.join(file)).collect();
    let recording = Recording::read(&data.join(place.gnss), &nav, &config).with_context(|| {
        format!(
            "the recording {} is needed in {}: tell where its neighbour esbc-2020-177 is with --data",
            place.gnss,
            data.display()
        )
    })?;
    let truth = match (place.truth(data)?, &recording.info.station) {
        (Some(truth), _) => truth,
        (None, Some((r_e_m, source))) => Truth::fixed(*r_e_m, source.clone()),
        (None, None) => bail!("{} states no position of its antenna", place.gnss),
    };
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(u64::MAX);
    let mut lineariser = Lineariser::new(&config);
    let mut epochs = Vec::new();
    for item in &recording.items {
        let Some(Ok(linearised)) = lineariser.take(item) else {
            continue;
        };
        let Some(mut prepared) = prepare(linearised, &truth) else {
            continue;
        };
        if place.add_noise {
            for (residual_m, row) in prepared.model.residual_m.iter_mut().zip(&prepared.rows) {
                *residual_m += row.sigma.independent_m * normal(&mut random);
            }
        }
        epochs.push(prepared);
    }
    if epochs.len() < 100 {
        bail!(
            "{} has only {} epochs with a position and a truth",
            place.gnss,
            epochs.len()
        );
    }
    Ok(Subject {
        name: place.name,
        about: place.about,
        epochs,
    })
}

/// With the sigmas of the whole error, as [P3] (3) adds them up.
fn prepare(linearised: Linearised, truth: &Truth) -> Option<Prepared> {
    let at_enu_m = linearised.error_enu_m(truth)?;
    let velocity_enu_mps = linearised.true_velocity_enu_mps(truth);
    let Linearised {
        mut model,
        rows,
        rates,
        ..
    } = linearised;
    for (sigma_m, row) in model.sigma_m.iter_mut().zip(&rows) {
        *sigma_m = row.sigma.total_m();
    }
    Some(Prepared {
        model,
        rows,
        at_enu_m,
        velocity_enu_mps,
        rates,
    })
}
