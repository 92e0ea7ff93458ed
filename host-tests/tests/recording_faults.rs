//! Recordings with an inertial unit, as they are and with faults: no false alert, what has to be found is.
//!
//! A short form of `surefix campaign recording-faults`; tables: docs/recordings.md.

mod common;

use std::path::{Path, PathBuf};

use surefix_host_tests::campaign::recording_faults::{self, Folders, Run, Subject};

/// Faults of at least this size have to be found, m.
const HAS_TO_BE_FOUND_M: f64 = 30.0;

/// The folder of recordings, if all files of `names` are there.
fn data(names: &[&str]) -> Option<PathBuf> {
    for name in names {
        common::shared(&format!("data/{name}"))?;
    }
    common::shared("data")
}

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/examples")
}

fn work(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR"))
        .join("recording_faults")
        .join(name)
}

/// Replays and checks what holds for every recording. The first run is the clean one.
fn study(subject: &Subject, systems: &str, trials: u64) -> Vec<Run> {
    let runs = recording_faults::study(subject, systems, trials, 1, None).unwrap();
    println!("{}", recording_faults::table(&runs));
    let clean = &runs[0];
    assert_eq!((clean.alerts, clean.wrong), (0, 0), "{clean:?}");
    // From shortly after the start on, the bank runs at every epoch with a position.
    assert!(clean.with_bank * 10 > clean.epochs * 8, "{clean:?}");
    for run in &runs {
        assert_eq!((run.above_level, run.wrong), (0, 0), "{run:?}");
        for [_, _, misleading, both, hazardous] in run.stanford {
            assert_eq!((misleading, both, hazardous), (0, 0, 0), "{run:?}");
        }
    }
    let faults: Vec<_> = runs.iter().flat_map(|run| &run.faults).collect();
    assert!(!faults.is_empty());
    for fault in faults.iter().filter(|f| f.size_m >= HAS_TO_BE_FOUND_M) {
        assert!(fault.detected_s.is_some(), "{fault:?}");
    }
    runs
}

/// INT-050. More satellites than places with Galileo, fewer without.
#[test]
fn four_hours_at_esbjerg_with_a_unit_at_rest() {
    let Some(data) = data(&["esbc-2020-177"]) else {
        return;
    };
    let (examples, work) = (examples(), work("esbc"));
    let folders = Folders {
        data: &data,
        examples: &examples,
        work: &work,
    };
    let subject = recording_faults::esbc(&folders, 1).unwrap();
    let with_galileo = study(&subject, "GEC", 1);
    assert!(with_galileo[0].over_capacity > 100, "{:?}", with_galileo[0]);
    assert_eq!(with_galileo[0].usable, 480);
    let without = study(&subject, "GC", 1);
    assert_eq!(without[0].over_capacity, 0);
    assert_eq!(without[0].usable, 480);
    // A fixed antenna under an open sky: the right satellite is named.
    for run in [&with_galileo[1], &without[1]] {
        for fault in run.faults.iter().filter(|f| f.size_m >= HAS_TO_BE_FOUND_M) {
            assert!(fault.excluded_s.is_some(), "{fault:?}");
        }
    }
}

/// INT-050. Satellites rise and set, and what they have left in the filters outlasts them.
#[test]
fn a_day_at_esbjerg_with_a_unit_at_rest() {
    let Some(data) = data(&["esbc-2020-177"]) else {
        return;
    };
    let (examples, work) = (examples(), work("day"));
    let folders = Folders {
        data: &data,
        examples: &examples,
        work: &work,
    };
    let subject = recording_faults::esbc_day(&folders, 1).unwrap();
    let runs = recording_faults::study(&subject, "GC", 0, 1, None).unwrap();
    // Hundreds of megabytes of samples.
    std::fs::remove_dir_all(&work).unwrap();
    println!("{}", recording_faults::table(&runs));
    let [day] = &runs[..] else { panic!("{runs:?}") };
    assert_eq!((day.epochs, day.usable, day.with_bank), (2880, 2880, 2878));
    assert_eq!((day.alerts, day.wrong, day.above_level), (0, 0, 0));
}

/// INT-050.
#[test]
fn a_walk_among_obstructions() {
    let Some(data) = data(&["walk0827-x20p-imu"]) else {
        return;
    };
    let (examples, work) = (examples(), work("walk"));
    let folders = Folders {
        data: &data,
        examples: &examples,
        work: &work,
    };
    let subject = recording_faults::walk(&folders).unwrap();
    study(&subject, "GEC", 1);
}

/// INT-050.
#[test]
fn a_drive_under_real_orbits() {
    let Some(data) = data(&["drive0708-adis16465-rtk", "esbc-2020-177"]) else {
        return;
    };
    let (examples, work) = (examples(), work("drive"));
    let folders = Folders {
        data: &data,
        examples: &examples,
        work: &work,
    };
    let subject = recording_faults::drive(&folders, 1).unwrap();
    for systems in recording_faults::constellations(&subject) {
        let runs = study(&subject, systems, 1);
        assert_eq!(runs[0].usable, 550);
    }
}

/// INT-050. The snapshot has nothing to test: what is found, the bank has found.
#[test]
fn a_drive_with_six_satellites_of_three_constellations() {
    let Some(data) = data(&["drive0708-adis16465-rtk", "esbc-2020-177"]) else {
        return;
    };
    let (examples, work) = (examples(), work("few"));
    let folders = Folders {
        data: &data,
        examples: &examples,
        work: &work,
    };
    let subject = recording_faults::few(&folders, 1).unwrap();
    let runs = study(&subject, "GEC", 3);
    for fault in runs.iter().flat_map(|run| &run.faults) {
        assert!(fault.in_bank && fault.bank_detected, "{fault:?}");
    }
}
