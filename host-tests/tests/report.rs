//! The report is one file that needs no other, holds every epoch, and stays small for a day.

mod made_up_run;

use std::path::PathBuf;

use made_up_run::{Run, made_up};
use surefix_host_tests::report;

#[test]
fn the_report_is_one_file_that_asks_for_no_other() {
    let directory = made_up(
        "report-approach",
        &Run {
            epochs: 241,
            truth: true,
            used: true,
            bank: true,
            satellites: true,
        },
    );
    let path = report::write(&directory).unwrap();
    let page = std::fs::read_to_string(path).unwrap();
    for asks in [
        "http://", "https://", "src=", "url(", "@import", "fetch(", "XMLHttp", "import(",
    ] {
        assert!(!page.contains(asks), "`{asks}` is in the page");
    }
    // The one link is the empty icon, which keeps a browser from asking for /favicon.ico.
    assert_eq!(page.matches("href=").count(), 1);
    assert!(page.contains("href=\"data:,\""));
    assert!(!page.contains("{{"), "a part was not filled in");
    assert!(page.contains("2026-05-27 04:10:00 GPST"));
}

#[test]
fn a_day_at_one_hertz_stays_below_eight_megabytes_with_every_epoch_in_it() {
    let directory = made_up(
        "report-day",
        &Run {
            epochs: 86_400,
            truth: true,
            used: true,
            bank: true,
            satellites: true,
        },
    );
    let rows = std::fs::read_to_string(directory.join("epochs.csv"))
        .unwrap()
        .lines()
        .count()
        - 1;
    let path = report::write(&directory).unwrap();
    let page = std::fs::read_to_string(path).unwrap();
    println!("{} bytes for {rows} epochs", page.len());
    assert!(page.len() < 8_000_000, "{} bytes", page.len());
    let start = page.find("application/json\">").unwrap() + "application/json\">".len();
    let data = &page[start..start + page[start..].find("</script>").unwrap()];
    let data: serde_json::Value = serde_json::from_str(data).unwrap();
    assert_eq!(data["n"].as_u64().unwrap() as usize, rows);
    // Every epoch that has a level and is not at alert is in a cell of the diagram, or has none.
    let diagram = &data["stanford"][0];
    let cells: Vec<u64> = diagram["cells"]
        .as_array()
        .unwrap()
        .iter()
        .skip(3)
        .step_by(4)
        .map(|count| count.as_u64().unwrap())
        .collect();
    let errors = std::fs::read_to_string(directory.join("errors.csv")).unwrap();
    let alerted = diagram["alerted"].as_u64().unwrap();
    assert!(alerted > 800, "{alerted}");
    assert_eq!(
        (cells.iter().sum::<u64>() + alerted) as usize,
        errors.lines().count() - 1
    );
    // The bank goes in bins, each with the largest ratio of its epochs.
    let bank = &data["bank"];
    let bins = bank["bins"].as_u64().unwrap();
    assert!((4096..=8192).contains(&bins), "{bins}");
    assert_eq!(bins, (rows as u64).div_ceil(bank["each"].as_u64().unwrap()));
    assert_eq!(bank["sats"].as_array().unwrap().len(), 35);
    // So do the satellites, each bin with the smallest and the largest of its epochs.
    let skies = &data["skies"];
    let bins = skies["bins"].as_u64().unwrap();
    assert!((2880..=3000).contains(&bins), "{bins}");
    assert_eq!(
        bins,
        (rows as u64).div_ceil(skies["each"].as_u64().unwrap())
    );
    let satellites = skies["sats"].as_array().unwrap();
    assert_eq!(satellites.len(), 35);
    assert!(
        satellites
            .iter()
            .all(|s| s["hi"].is_string() && s["d"].is_string())
    );
    assert_eq!(
        data["track"]["e"]["f"].as_str().unwrap().len(),
        (rows * 4).div_ceil(3) * 4
    );
    // Base64 of four bytes per epoch.
    assert_eq!(
        data["hpl"]["f"].as_str().unwrap().len(),
        (rows * 4).div_ceil(3) * 4
    );
}

#[test]
fn without_truth_the_report_says_so_and_shows_no_errors() {
    let directory = made_up(
        "report-no-truth",
        &Run {
            epochs: 300,
            truth: false,
            used: false,
            bank: false,
            satellites: false,
        },
    );
    let page = std::fs::read_to_string(report::write(&directory).unwrap()).unwrap();
    assert!(page.contains("No truth was given"));
    assert!(page.contains("\"bank\":null") && page.contains("\"stanford\":null"));
    assert!(page.contains("\"skies\":null"));
    assert!(!page.contains("error, 95 %"));
}

#[test]
fn a_directory_without_a_run_is_refused_with_what_to_do() {
    let directory = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("report-empty");
    std::fs::create_dir_all(&directory).unwrap();
    let message = format!("{:#}", report::write(&directory).unwrap_err());
    assert!(message.contains("surefix replay"), "{message}");
}
