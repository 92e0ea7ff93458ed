//! What is told of every satellite of an epoch is what the report of the epoch says in sums, what was put on the
//! satellite, and where it stands.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use surefix_core::gnss::Satellite;
use surefix_core::gnss::measurement::SatelliteReason;
use surefix_core::integrity::Phase;
use surefix_core::satellite_report::{SatelliteRow, SatelliteUse};
use surefix_host_tests::output::{SATELLITE_COLUMNS, write_satellites};
use surefix_host_tests::replay::{self, ReplayOptions, ReplayResult};
use surefix_host_tests::simulate::disturbances::Disturbances;
use surefix_host_tests::simulate::stream::Format;
use surefix_host_tests::simulate::{Args, atmosphere::Ionosphere, flight::Flight, simulate};

const RAMP: &str = "G04:ramp:0.5:30:110";

/// An approach with a ramp on one satellite.
fn approach() -> ReplayResult {
    let args = Args {
        name: Flight::Approach,
        seed: 1,
        out: PathBuf::new(),
        rate_hz: 1.0,
        duration: Some(120.0),
        noise_free: false,
        dual_frequency: false,
        no_troposphere: false,
        ionosphere: Ionosphere::Klobuchar,
        faults: vec![RAMP.parse().unwrap()],
        receiver: Format::Rtcm3,
        disturbances: Disturbances::default(),
    };
    // One each: tests of this file run beside each other.
    static FOLDERS: AtomicU32 = AtomicU32::new(0);
    let name = format!("satellites-{}", FOLDERS.fetch_add(1, Ordering::Relaxed));
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).unwrap();
    let gnss = folder.join("receiver.rtcm3");
    std::fs::write(&gnss, simulate(&args).unwrap().receiver).unwrap();
    let mut options = ReplayOptions::new(gnss);
    options.config.phase = Phase::Lpv200;
    replay::run(&options, &mut |_, _| {}).unwrap()
}

fn rows(result: &ReplayResult, epoch: usize) -> &[SatelliteRow] {
    &result.satellites[epoch].as_ref().unwrap().rows
}

#[test]
fn satellites_are_those_of_the_report_with_the_same_fates() {
    let result = approach();
    assert_eq!(result.satellites.len(), result.reports.len());
    let mut left_out = 0;
    for (epoch, report) in result.reports.iter().enumerate() {
        let rows = rows(&result, epoch);
        assert_eq!(rows.len(), usize::from(report.n_observed));
        for row in rows {
            let is_used = row.fate == SatelliteUse::Used;
            assert_eq!(is_used, report.used.contains(row.satellite), "{row:?}");
            let excluded = row.fate == SatelliteUse::LeftOut(SatelliteReason::FaultExcluded);
            assert_eq!(excluded, report.verdict.excluded.contains(row.satellite));
            assert_eq!(row.residual_mm.is_some(), is_used || excluded, "{row:?}");
            assert!(
                row.cn0_quarter_dbhz
                    .is_some_and(|quarters| (100..240).contains(&quarters))
            );
            // The preset's mask is 10°.
            let (_, elevation_cdeg) = row.direction_cdeg.unwrap();
            let below = row.fate == SatelliteUse::LeftOut(SatelliteReason::BelowMask);
            assert_eq!(below, elevation_cdeg < 1000, "{row:?}");
        }
        for reason in SatelliteReason::ALL {
            let told = rows
                .iter()
                .filter(|row| row.fate == SatelliteUse::LeftOut(reason));
            let told = told.count();
            assert_eq!(
                told,
                usize::from(report.unused[reason as usize]),
                "{reason:?}"
            );
            left_out += told;
        }
    }
    assert!(left_out > 100, "{left_out}");
}

#[test]
fn the_residual_of_an_excluded_satellite_is_the_fault_and_others_are_small() {
    let result = approach();
    let faulty: Satellite = Satellite::new(surefix_core::gnss::System::Gps, 4).unwrap();
    let mut excluded = 0;
    for (epoch, report) in result.reports.iter().enumerate() {
        if !report.verdict.excluded.contains(faulty) {
            continue;
        }
        let t_s = report.since_first_ns as f64 * 1e-9;
        let fault_m = if t_s < 110.0 { 0.5 * (t_s - 30.0) } else { 0.0 };
        for row in rows(&result, epoch) {
            let Some(residual_mm) = row.residual_mm else {
                continue;
            };
            let residual_m = f64::from(residual_mm) * 1e-3;
            let expected_m = if row.satellite == faulty {
                fault_m
            } else {
                0.0
            };
            excluded += usize::from(row.satellite == faulty);
            assert!(
                (residual_m - expected_m).abs() < 4.0,
                "{t_s} s: {row:?}, fault {fault_m} m"
            );
        }
    }
    assert!(excluded > 20, "{excluded}");
}

/// Azimuth and elevation, degrees, of a satellite that stands over the equator, by spherical trigonometry.
fn stands_at(longitude_deg: f64, [lat_deg, lon_deg]: [f64; 2]) -> [f64; 2] {
    let (lat, east) = (lat_deg.to_radians(), (longitude_deg - lon_deg).to_radians());
    let azimuth = core::f64::consts::PI - (east.tan() / lat.sin()).atan();
    let cosine = lat.cos() * east.cos();
    // Radius of the Earth over that of the orbit.
    let elevation = ((cosine - 6378.0 / 42_164.0) / (1.0 - cosine * cosine).sqrt()).atan();
    [azimuth.to_degrees(), elevation.to_degrees()]
}

#[test]
fn geostationary_satellites_stand_where_their_longitudes_say() {
    let result = approach();
    let fix = result.reports[0].fix.unwrap();
    for (prn, longitude_deg) in [(59, 140.0), (60, 80.0), (61, 110.5)] {
        let row = rows(&result, 0)
            .iter()
            .find(|row| row.satellite.prn() == prn && row.satellite.is_bds_geo());
        let (azimuth_cdeg, elevation_cdeg) = row.unwrap().direction_cdeg.unwrap();
        let [azimuth_deg, elevation_deg] = stands_at(longitude_deg, [fix.lat_deg, fix.lon_deg]);
        // Their orbits are inclined a little, and the Earth is no sphere.
        assert!(
            (f64::from(azimuth_cdeg) / 100.0 - azimuth_deg).abs() < 2.0,
            "C{prn}: {azimuth_deg}, {row:?}"
        );
        assert!(
            (f64::from(elevation_cdeg) / 100.0 - elevation_deg).abs() < 2.0,
            "C{prn}: {elevation_deg}, {row:?}"
        );
    }
}

#[test]
fn the_file_has_a_row_for_every_satellite_of_every_epoch() {
    let result = approach();
    let mut file = Vec::new();
    write_satellites(&mut file, &result.reports, &result.satellites).unwrap();
    let text = String::from_utf8(file).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some(SATELLITE_COLUMNS));
    let observed: usize = result
        .reports
        .iter()
        .map(|r| usize::from(r.n_observed))
        .sum();
    let mut count = 0;
    for line in lines {
        let fields: Vec<&str> = line.split(',').collect();
        assert_eq!(fields.len(), SATELLITE_COLUMNS.split(',').count(), "{line}");
        let has_residual = ["used", "fault_excluded"].contains(&fields[2]);
        assert_eq!(fields[5].parse::<f64>().is_ok(), has_residual, "{line}");
        count += 1;
    }
    assert_eq!(count, observed);
}
