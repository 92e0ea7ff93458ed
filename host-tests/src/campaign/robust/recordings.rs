//! The recordings of `surefix campaign robust`, each epoch linearised at its solution without faults.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use surefix_core::config::Config;
use surefix_core::gnss::satellite::SystemSet;
use surefix_core::gnss::solution::UsedRow;
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
struct Place {
    name: &'static str,
    about: &'static str,
    gnss: &'static str,
    nav: &'static [&'static str],
    systems: [System; 2],
    /// Errors of the model's independent sigma are added: a simulator's pseudoranges have none.
    add_noise: bool,
}

const ESBC: Place = Place {
    name: "esbc",
    about: "static, 24 h, one epoch in 30 s, GPS and BDS",
    gnss: "esbc-2020-177/ESBC00DNK_R_20201770000_01D_30S_MO.crx.gz",
    nav: &["esbc-2020-177/ESBC00DNK_R_20201770000_01D_MN.rnx.gz"],
    systems: [System::Gps, System::Bds],
    add_noise: false,
};

const ESBC_FOUR_HOURS: Place = Place {
    about: "static, 4 h, one epoch in 30 s, GPS and BDS",
    gnss: "esbc-2020-177/ESBC_2020177_0000-0400.rnx",
    ..ESBC
};

const NAGOYA: Place = Place {
    name: "nagoya",
    about: "static, 5 min, 1 Hz, GPS and BDS",
    gnss: "matrtklib-static-2024/rover.obs",
    nav: &["matrtklib-static-2024/base.nav"],
    systems: [System::Gps, System::Bds],
    add_noise: false,
};

const FLIGHT: Place = Place {
    name: "spirent",
    about: "simulated flight, 10 min, 1 Hz, GPS and Galileo, noise of one sigma added",
    gnss: "instinct-spirent-dynamic-10min/iono-Klob_tropo-Saast/Rover-dynamic_MO_Spirent.obs",
    nav: &[
        "instinct-spirent-dynamic-10min/RINEX_GN_Spirent.23N",
        "instinct-spirent-dynamic-10min/RINEX_EN_Spirent.23L",
    ],
    systems: [System::Gps, System::Galileo],
    add_noise: true,
};

/// The recordings in a folder; `short` takes four hours of the day.
///
/// # Errors
/// When one is absent or unusable.
pub fn subjects(data: &Path, config: &Config, seed: u64, short: bool) -> Result<Vec<Subject>> {
    let static_truth = |folder: &Path| -> Result<Truth> {
        let path = folder.join("matrtklib-static-2024/rover_position.txt");
        let text = std::fs::read_to_string(&path)
            .with_context(|| format!("cannot read {}", path.display()))?;
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
    };
    let esbc = if short { ESBC_FOUR_HOURS } else { ESBC };
    let track = data.join("instinct-spirent-dynamic-10min/Rover-dynamic_PVA_Spirent.csv");
    Ok(vec![
        read(data, &esbc, config, None, seed)?,
        read(data, &NAGOYA, config, Some(static_truth(data)?), seed)?,
        read(data, &FLIGHT, config, Some(Truth::read(&track)?), seed)?,
    ])
}

fn read(
    data: &Path,
    place: &Place,
    config: &Config,
    truth: Option<Truth>,
    seed: u64,
) -> Result<Subject> {
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
    let truth = match (truth, &recording.info.station) {
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
    let Linearised {
        mut model, rows, ..
    } = linearised;
    for (sigma_m, row) in model.sigma_m.iter_mut().zip(&rows) {
        *sigma_m = row.sigma.total_m();
    }
    Some(Prepared {
        model,
        rows,
        at_enu_m,
    })
}
