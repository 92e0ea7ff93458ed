//! How long the errors of pseudoranges last: what the split into a white and a correlated part stands on
//! (docs/decisions/008-correlated-noise.md).
//!
//! Residuals of each satellite at a place that is known, with the clock of each system taken out of every epoch,
//! in sigmas of the independent part of the error model. Their correlation over a time is what is not white.
//!
//! ```text
//! cargo test -p surefix-host-tests --test error_correlation -- --nocapture
//! ```

mod common;

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Vector3;
use surefix_core::config::{Config, IonosphereModel};
use surefix_core::gnss::solution::SnapshotWorkspace;
use surefix_core::gnss::{
    BroadcastIonosphere, CorrectedEpoch, EphemerisStore, SatelliteSet, System,
};
use surefix_core::time::GpsTime;
use surefix_host_tests::replay::ReplayOptions;
use surefix_host_tests::settings::Settings;
use surefix_host_tests::source::{Item, Recording};
use surefix_host_tests::track::Track;

use common::shared;

/// Residuals by satellite: time, ns, and residual in sigmas.
type Series = BTreeMap<String, Vec<(i64, f64)>>;

fn residuals(options: &ReplayOptions, place: &dyn Fn(GpsTime) -> Vector3<f64>) -> Series {
    let recording = Recording::read(&options.gnss, &options.nav, &options.config).unwrap();
    let mut store = EphemerisStore::EMPTY;
    let mut ionosphere = BroadcastIonosphere::EMPTY;
    let mut workspace = Box::new(SnapshotWorkspace::EMPTY);
    let mut corrected = CorrectedEpoch::EMPTY;
    let mut series = Series::new();
    for item in &recording.items {
        let epoch = match item {
            Item::Ephemeris(ephemeris) => {
                let _ = store.insert(ephemeris);
                continue;
            }
            Item::Klobuchar(parameters) => {
                ionosphere.insert(*parameters);
                continue;
            }
            Item::Epoch(epoch) => epoch,
            _ => continue,
        };
        let r_e = place(epoch.time);
        workspace.prepare(epoch, &store, &ionosphere, &options.config);
        workspace
            .corrected(r_e.into(), [0.0; 3], SatelliteSet::EMPTY, &mut corrected)
            .unwrap();
        for system in System::ALL {
            let rows: Vec<(String, f64, f64)> = corrected
                .rows
                .iter()
                .filter(|row| row.satellite.system() == system)
                .map(|row| {
                    let range_m = (Vector3::from(row.r_es_e_m) - r_e).norm();
                    let sigma_m = workspace.sigma(row.satellite).unwrap().independent_m;
                    (
                        row.satellite.to_string(),
                        row.pseudorange_m - range_m,
                        sigma_m,
                    )
                })
                .collect();
            if rows.len() < 4 {
                continue;
            }
            let weights: f64 = rows.iter().map(|(_, _, sigma)| sigma.powi(-2)).sum();
            let mean_m: f64 = rows
                .iter()
                .map(|(_, r, sigma)| r * sigma.powi(-2))
                .sum::<f64>()
                / weights;
            for (name, residual_m, sigma_m) in rows {
                let of = series.entry(name).or_default();
                of.push((epoch.time.ns(), (residual_m - mean_m) / sigma_m));
            }
        }
    }
    series
}

/// Mean square, and correlations over these times: means over all satellites.
fn correlation(series: &Series, lags_s: &[f64]) -> (f64, Vec<f64>) {
    let all = || series.values().flatten();
    let mean_square = all().map(|(_, x)| x * x).sum::<f64>() / all().count() as f64;
    let of = |lag_s: &f64| {
        let lag_ns = (lag_s * 1e9) as i64;
        let (mut products, mut squares, mut count) = (0.0, 0.0, 0_u32);
        for satellite in series.values() {
            let at: BTreeMap<i64, f64> = satellite.iter().copied().collect();
            for (ns, x) in satellite {
                if let Some((_, y)) = at
                    .range(ns + lag_ns - 10_000_000..=ns + lag_ns + 10_000_000)
                    .next()
                {
                    products += x * y;
                    squares += 0.5 * (x * x + y * y);
                    count += 1;
                }
            }
        }
        assert!(count > 100, "{lag_s}: {count}");
        products / squares
    };
    (mean_square, lags_s.iter().map(of).collect())
}

#[test]
fn errors_of_a_day_are_not_white_and_within_the_model() {
    let folder = "data/esbc-2020-177/ESBC00DNK_R_20201770000_01D_";
    let (Some(gnss), Some(nav)) = (
        shared(&format!("{folder}30S_MO.crx.gz")),
        shared(&format!("{folder}MN.rnx.gz")),
    ) else {
        return;
    };
    for ionosphere in [IonosphereModel::Klobuchar, IonosphereModel::IonosphereFree] {
        let mut options = ReplayOptions::new(gnss.clone());
        options.nav.push(nav.clone());
        options.config = Config {
            ionosphere,
            ..Config::PRESET
        };
        let truth = Vector3::new(3582105.2910, 532589.7313, 5232754.8054);
        let series = residuals(&options, &|_| truth);
        let (mean_square, of) = correlation(&series, &[30.0, 300.0, 1800.0, 3600.0]);
        println!(
            "ESBC {ionosphere:?}: {} satellites, rms {:.2} sigma, correlation {:.2} at 30 s, {:.2} at 5 min, {:.2} at 30 min, {:.2} at 1 h",
            series.len(),
            mean_square.sqrt(),
            of[0],
            of[1],
            of[2],
            of[3]
        );
        // The whole of the model's variance covers the errors, and what is white of it is a small part.
        assert!(mean_square < 1.0, "{mean_square}");
        assert!(of[0] > 0.6 && of[3] > 0.2, "{of:?}");
    }
}

#[test]
fn errors_of_a_walk_last_for_seconds() {
    let folder = "data/walk0827-x20p-imu";
    let (Some(gnss), Some(nav), Some(track)) = (
        shared(&format!("{folder}/derived_convbin.obs")),
        shared(&format!("{folder}/derived_convbin.nav")),
        shared(&format!("{folder}/gnss_1730_sf.pos")),
    ) else {
        return;
    };
    let mut options = ReplayOptions::new(gnss);
    options.nav.push(nav);
    let example =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/examples/walk-adis16465.toml");
    options.config = Settings::read(&example).unwrap().config().unwrap();
    let track = Track::read(&track, -21.39).unwrap();
    let series = residuals(&options, &|time| track.state(time, 0.0).0);
    let (mean_square, of) = correlation(&series, &[0.25, 1.0, 5.0, 30.0]);
    println!(
        "walk: {} satellites, rms {:.2} sigma, correlation {:.2} at 0.25 s, {:.2} at 1 s, {:.2} at 5 s, {:.2} at 30 s",
        series.len(),
        mean_square.sqrt(),
        of[0],
        of[1],
        of[2],
        of[3]
    );
    assert!(of[0] > 0.5, "{of:?}");
    // The factor of the example covers it.
    assert!(mean_square.sqrt() < 3.0, "{mean_square}");
}
