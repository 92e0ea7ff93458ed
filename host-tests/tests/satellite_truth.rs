//! Satellite positions, clocks and predicted pseudoranges against two signal simulators.
//!
//! Neither simulator is ours: what they wrote is evidence. Reads `../shared/data` and skips, saying
//! so, where it is absent.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use surefix_core::consts::SPEED_OF_LIGHT_MPS;
use surefix_core::gnss::klobuchar::SkyPoint;
use surefix_core::gnss::measurement::{measure, predicted_pseudorange_m, predicted_range_rate_mps};
use surefix_core::gnss::orbit::position_velocity;
use surefix_core::gnss::signal::FREQUENCY_L1_HZ;
use surefix_core::gnss::{
    Ephemeris, EphemerisStore, KlobucharParameters, ObservationEpoch, Satellite, System,
};
use surefix_core::time::{GpsTime, NS_PER_S};
use surefix_host_tests::rinex::{
    Content, NavigationFile, ObservationReader, read_unzipped, text_of,
};

/// The folder of a recording, or `None` with a note where it is absent.
fn recording(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../shared/data")
        .join(name);
    if path.is_dir() {
        return Some(path);
    }
    eprintln!("SKIPPED: {name}: ../shared is absent");
    None
}

/// Broadcast records of a navigation file.
fn read_navigation(path: &Path) -> Vec<Ephemeris> {
    let (text, content) = text_of(read_unzipped(path).unwrap()).unwrap();
    assert_eq!(content, Content::Navigation);
    let file = NavigationFile::parse(&text).unwrap();
    assert_eq!(file.bad_records, 0);
    file.ephemerides
        .iter()
        .map(|timed| timed.ephemeris)
        .collect()
}

/// Epochs of an observation file.
fn read_observations(path: &Path) -> Vec<ObservationEpoch> {
    let (text, content) = text_of(read_unzipped(path).unwrap()).unwrap();
    assert_eq!(content, Content::Observations);
    let mut reader = ObservationReader::new(&text).unwrap();
    let mut epoch = ObservationEpoch::EMPTY;
    let mut epochs = Vec::new();
    while reader.next_epoch(&mut epoch) {
        epochs.push(epoch.clone());
    }
    epochs
}

/// Columns of a CSV file with a header line.
fn read_columns(path: &Path, names: &[&str]) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let places: Vec<usize> = names
        .iter()
        .map(|name| header.iter().position(|column| column == name).unwrap())
        .collect();
    lines
        .map(|line| {
            let fields: Vec<&str> = line.split(',').collect();
            places
                .iter()
                .map(|place| fields[*place].parse().unwrap())
                .collect()
        })
        .collect()
}

fn store_of(ephemerides: &[Ephemeris]) -> Box<EphemerisStore> {
    let mut store = Box::new(EphemerisStore::EMPTY);
    for ephemeris in ephemerides {
        store.insert(ephemeris).unwrap();
    }
    store
}

fn quantile(sorted: &[f64], share: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * share) as usize]
}

#[test]
fn predicted_pseudoranges_agree_with_a_simulator_to_two_millimetres() {
    let Some(folder) = recording("instinct-spirent-dynamic-10min") else {
        return;
    };
    let mut ephemerides = read_navigation(&folder.join("RINEX_GN_Spirent.23N"));
    ephemerides.extend(read_navigation(&folder.join("RINEX_EN_Spirent.23L")));
    let store = store_of(&ephemerides);
    let truth: HashMap<i64, Vec<f64>> = read_columns(
        &folder.join("Rover-dynamic_PVA_Spirent.csv"),
        &[
            "GpsToW [s]",
            "Pos ECEF X [m]",
            "Pos ECEF Y [m]",
            "Pos ECEF Z [m]",
            "Vel ECEF X [m/s]",
            "Vel ECEF Y [m/s]",
            "Vel ECEF Z [m/s]",
        ],
    )
    .into_iter()
    .map(|row| ((row[0] * 10.0).round() as i64, row))
    .collect();
    let epochs =
        read_observations(&folder.join("iono-none_tropo-none/Rover-dynamic_MO_Spirent.obs"));
    assert_eq!(epochs.len(), 601);
    let mut rows = [0_usize; 3];
    let mut worst_m = [0.0_f64; 3];
    let mut worst_mps = [0.0_f64; 3];
    for epoch in &epochs {
        let row = &truth[&(epoch.time.tow_ns() / (NS_PER_S / 10))];
        let r_eb_e = [row[1], row[2], row[3]];
        let v_eb_e = [row[4], row[5], row[6]];
        for observation in &epoch.satellites {
            let system = observation.satellite.system().index();
            let measurement = measure(observation, epoch.time, &store, false).unwrap();
            let predicted_m = predicted_pseudorange_m(&measurement, r_eb_e, 0.0, 0.0);
            let difference_m = predicted_m - measurement.pseudorange_m;
            worst_m[system] = worst_m[system].max(difference_m.abs());
            let rate_mps = predicted_range_rate_mps(&measurement, r_eb_e, v_eb_e, 0.0);
            let difference_mps = rate_mps - measurement.range_rate_mps.unwrap();
            worst_mps[system] = worst_mps[system].max(difference_mps.abs());
            rows[system] += 1;
        }
    }
    println!("rows {rows:?}, worst pseudorange {worst_m:?} m, worst range rate {worst_mps:?} m/s");
    assert_eq!(rows, [6579, 4808, 0]);
    for system in [System::Gps, System::Galileo] {
        assert!(worst_m[system.index()] <= 0.002, "{system:?}");
        assert!(worst_mps[system.index()] <= 0.002, "{system:?}");
    }
}

/// The simulator's own table of one satellite.
struct SatelliteTable {
    satellite: Satellite,
    rows: Vec<Vec<f64>>,
}

const TABLE_COLUMNS: [&str; 9] = [
    "ECEF X (m)",
    "ECEF Y (m)",
    "ECEF Z (m)",
    "Elapsed Time (ms)",
    "PSR satellite time (ms)",
    "Body Azimuth (rad)",
    "Body Elevation (rad)",
    "Iono Correction (m)",
    "Clock Correction (s)",
];

fn skydel_tables(folder: &Path, atmosphere: &str) -> Vec<SatelliteTable> {
    let mut tables = Vec::new();
    let mut entries: Vec<_> = fs::read_dir(folder.join(atmosphere).join("sat_data"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    entries.sort();
    for path in entries {
        let stem = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let Some((signal, prn)) = stem.split_once(' ') else {
            continue;
        };
        let system = match signal {
            "L1CA" => System::Gps,
            "E1" => System::Galileo,
            "B1" => System::Bds,
            _ => continue,
        };
        tables.push(SatelliteTable {
            satellite: Satellite::new(system, prn.parse().unwrap()).unwrap(),
            rows: read_columns(&path, &TABLE_COLUMNS),
        });
    }
    tables
}

/// What the simulator broadcast: GPS every two hours, Galileo every ten minutes, BDS every hour.
fn skydel_ephemerides(folder: &Path) -> Vec<Ephemeris> {
    ["7200S_GN", "600S_EN", "3600S_CN"]
        .iter()
        .flat_map(|name| {
            read_navigation(&folder.join(format!("SkydelRINEX_S_20238959_{name}.rnx")))
        })
        .collect()
}

/// Elapsed 60 s is 10:00:00 GPST of 2023-01-08, week 2244. In ns of a millisecond count.
fn skydel_time(milliseconds: f64) -> (GpsTime, f64) {
    let whole = milliseconds.floor();
    let time = GpsTime::from_week_tow_ns(2244, (36_000 - 60) * NS_PER_S + whole as i64 * 1_000_000);
    (time, (milliseconds - whole) / 1000.0)
}

/// Position by the last ephemeris before `time`, moved as the simulator moves it: from one issue to the
/// next it glides in a straight line, so that at the next toe it arrives where the next issue says.
/// GPS, Galileo and the MEO and IGSO of BDS keep one orbit through all issues of these files and
/// glide nowhere; the GEO are recorded ones and jump by decimetres.
fn gliding_position(
    ephemerides: &[Ephemeris],
    satellite: Satellite,
    time: GpsTime,
    after_s: f64,
) -> [f64; 3] {
    let at = |ephemeris: &Ephemeris, time: GpsTime, after_s: f64| {
        let since_toe_s = time.seconds_since(ephemeris.toe) + after_s;
        position_velocity(ephemeris, since_toe_s).unwrap().r_e_m
    };
    let issues = || ephemerides.iter().filter(|e| e.satellite == satellite);
    let last = issues()
        .filter(|e| e.toe <= time)
        .max_by_key(|e| e.toe)
        .unwrap_or_else(|| issues().min_by_key(|e| e.toe).unwrap());
    let mut position = at(last, time, after_s);
    if let Some(next) = issues().filter(|e| e.toe > last.toe).min_by_key(|e| e.toe) {
        let share = time.seconds_since(last.toe) / next.toe.seconds_since(last.toe);
        let (arrival, departure) = (at(next, next.toe, 0.0), at(last, next.toe, 0.0));
        for axis in 0..3 {
            position[axis] += share * (arrival[axis] - departure[axis]);
        }
    }
    position
}

/// How far two issues may differ where one hands over to the other and still say the same, m.
const SAME_ORBIT_M: f64 = 0.01;
/// A row this near to a toe is at the moment at which the simulator arrives at that issue: the rows are
/// 300 s apart and the toe of BDS, full hours of its own time, are 14 s past a row. Of a jump of
/// a decimetre between issues an hour apart, 14 s leave 0.4 mm to glide.
const AT_TOE_S: f64 = 15.0;

/// Position by the ephemeris of the nearest toe alone, where the simulator is not between two issues:
/// at a toe, or where the issues before and after are of one orbit.
fn resting_position(
    ephemerides: &[Ephemeris],
    satellite: Satellite,
    time: GpsTime,
    after_s: f64,
) -> Option<[f64; 3]> {
    let issues = || ephemerides.iter().filter(|e| e.satellite == satellite);
    let at = |ephemeris: &Ephemeris, time: GpsTime, after_s: f64| {
        let since_toe_s = time.seconds_since(ephemeris.toe) + after_s;
        position_velocity(ephemeris, since_toe_s).unwrap().r_e_m
    };
    let nearest = issues().min_by(|a, b| {
        let away_s = |e: &Ephemeris| time.seconds_since(e.toe).abs();
        away_s(a).total_cmp(&away_s(b))
    })?;
    let is_at_toe = time.seconds_since(nearest.toe).abs() <= AT_TOE_S;
    let before = issues().filter(|e| e.toe <= time).max_by_key(|e| e.toe);
    let after = issues().filter(|e| e.toe > time).min_by_key(|e| e.toe);
    let is_one_orbit = before.zip(after).is_some_and(|(before, after)| {
        distance_m(at(before, after.toe, 0.0), at(after, after.toe, 0.0)) <= SAME_ORBIT_M
    });
    (is_at_toe || is_one_orbit).then(|| at(nearest, time, after_s))
}

fn distance_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b).powi(2));
    squares.sum::<f64>().sqrt()
}

/// The orbits alone, without [`gliding_position`]: what is compared is one issue and nothing between.
#[test]
fn satellite_positions_agree_with_a_simulator_where_it_follows_one_issue() {
    let Some(folder) = recording("instinct-skydel-static-4h-truth") else {
        return;
    };
    let ephemerides = skydel_ephemerides(&folder);
    let names = ["GPS", "Galileo", "BDS MEO and IGSO", "BDS GEO"];
    let mut resting_m: [Vec<f64>; 4] = Default::default();
    let mut gliding_m: [Vec<f64>; 4] = Default::default();
    let mut rows = [0_usize; 4];
    for table in skydel_tables(&folder, "Iono-none_tropo-none") {
        let satellite = table.satellite;
        let group = satellite.system().index() + usize::from(satellite.is_bds_geo());
        for row in &table.rows {
            rows[group] += 1;
            let (time, reading_s) = skydel_time(row[4]);
            let after_s = reading_s - row[8];
            let theirs = [row[0], row[1], row[2]];
            let resting = resting_position(&ephemerides, satellite, time, after_s);
            let Some(resting) = resting else { continue };
            resting_m[group].push(distance_m(resting, theirs));
            let gliding = gliding_position(&ephemerides, satellite, time, after_s);
            gliding_m[group].push(distance_m(gliding, theirs));
        }
    }
    for (group, name) in names.iter().enumerate() {
        resting_m[group].sort_by(f64::total_cmp);
        gliding_m[group].sort_by(f64::total_cmp);
        let (one_issue_m, gliding_m) = (&resting_m[group], &gliding_m[group]);
        let p95_m = quantile(one_issue_m, 0.95);
        println!(
            "{name}: {} of {} positions; one issue: median {:.5} m, 95 % {p95_m:.5} m, largest {:.5} m; \
             glided, the same rows: 95 % {:.5} m, largest {:.5} m",
            one_issue_m.len(),
            rows[group],
            quantile(one_issue_m, 0.5),
            quantile(one_issue_m, 1.0),
            quantile(gliding_m, 0.95),
            quantile(gliding_m, 1.0),
        );
        assert!(one_issue_m.len() >= 30, "{name}");
        assert!(p95_m <= 0.005, "{name}: {p95_m}");
    }
}

#[test]
fn satellite_positions_agree_with_a_simulator_to_five_millimetres() {
    let Some(folder) = recording("instinct-skydel-static-4h-truth") else {
        return;
    };
    let ephemerides = skydel_ephemerides(&folder);
    let mut differences_m: [Vec<f64>; 3] = Default::default();
    let mut geo_m = Vec::new();
    for table in skydel_tables(&folder, "Iono-none_tropo-none") {
        for row in &table.rows {
            // The satellite's own clock reading; its clock correction makes it system time.
            let (time, reading_s) = skydel_time(row[4]);
            let after_s = reading_s - row[8];
            let ours = gliding_position(&ephemerides, table.satellite, time, after_s);
            let squares = ours
                .iter()
                .zip(row)
                .map(|(ours, theirs)| (ours - theirs).powi(2));
            let difference_m = squares.sum::<f64>().sqrt();
            differences_m[table.satellite.system().index()].push(difference_m);
            if table.satellite.is_bds_geo() {
                geo_m.push(difference_m);
            }
        }
    }
    let systems = System::ALL.iter().map(|system| format!("{system:?}"));
    let named = systems.chain([String::from("BDS GEO alone")]);
    let series = differences_m.into_iter().chain([geo_m]);
    for (name, mut differences_m) in named.zip(series) {
        differences_m.sort_by(f64::total_cmp);
        let p95_m = quantile(&differences_m, 0.95);
        println!(
            "{name}: {} positions, median {:.5} m, 95 % {:.5} m, largest {:.5} m",
            differences_m.len(),
            quantile(&differences_m, 0.5),
            p95_m,
            quantile(&differences_m, 1.0),
        );
        assert!(differences_m.len() > 200, "{name}");
        assert!(p95_m <= 0.005, "{name}: {p95_m}");
    }
}

#[test]
fn ionospheric_delay_agrees_with_a_simulator() {
    let Some(folder) = recording("instinct-skydel-static-4h-truth") else {
        return;
    };
    // The header of its navigation files; the receiver stands at 30° N, 95° E.
    let parameters = KlobucharParameters {
        system: System::Gps,
        alpha: [4.6570e-9, 1.4900e-8, -5.9600e-8, -1.1920e-7],
        beta: [8.1920e4, 8.1920e4, -6.5540e4, -5.2430e5],
    };
    let mut differences_m = Vec::new();
    for table in skydel_tables(&folder, "Iono-Klob_tropo-Saast") {
        for row in &table.rows {
            let at = SkyPoint {
                lat_rad: 30.0_f64.to_radians(),
                lon_rad: 95.0_f64.to_radians(),
                azimuth_rad: row[5],
                elevation_rad: row[6],
            };
            let (time, _) = skydel_time(row[3]);
            // The simulator delays B1I as if it were on the carrier of L1.
            let delay_s = parameters.delay_s(time, &at, FREQUENCY_L1_HZ).unwrap();
            differences_m.push(delay_s * SPEED_OF_LIGHT_MPS - row[7]);
        }
    }
    differences_m.sort_by(f64::total_cmp);
    let (lowest_m, highest_m) = (differences_m[0], differences_m[differences_m.len() - 1]);
    println!(
        "{} delays, difference {lowest_m:.4} to {highest_m:.4} m, median {:.4} m",
        differences_m.len(),
        quantile(&differences_m, 0.5)
    );
    // The simulator takes a cosine where [IS-GPS-200] takes 1 − x²/2 + x⁴/24, which is larger by up
    // to x⁶/720 at x = 1.57: 2 % of the amplitude, 8 cm here. Never smaller.
    assert!(lowest_m > -0.001 && highest_m < 0.09);
    assert!(
        differences_m
            .iter()
            .filter(|difference_m| difference_m.abs() < 0.001)
            .count()
            > 200
    );
}
