//! The report is one file that needs no other, holds every epoch, and stays small for a day.

use std::fmt::Write as _;
use std::path::PathBuf;

use surefix_host_tests::report;

/// What a made-up run consists of.
struct Run {
    epochs: usize,
    truth: bool,
    used: bool,
    bank: bool,
}

/// A number between −1 and 1 that looks random and is the same every time.
fn wobble(k: usize, salt: u64) -> f64 {
    let mut x =
        (k as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ salt.wrapping_mul(0xd1b5_4a32_d192_ed03);
    x = (x ^ (x >> 31)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x >> 11) as f64 / (1_u64 << 52) as f64) - 1.0
}

/// Columns of the bank: C14 and the first of the other satellites used are in it, 24 at most. The filter without C14 leaves the others
/// before C14 is excluded.
fn bank_columns(line: &mut String, k: usize, share: f64, names: &[String], used: &[&String]) {
    let mut in_bank: Vec<&&String> = used.iter().collect();
    in_bank.sort_by_key(|name| **name != "C14");
    in_bank.truncate(24);
    let alert = (0.40..0.41).contains(&share);
    let _ = write!(line, ",{},{}", in_bank.len(), used.len() - in_bank.len());
    line.push_str(if alert { ",21.5,33" } else { ",," });
    for (s, name) in (0..).zip(names) {
        if !in_bank.contains(&&name) {
            line.push_str(",,,,");
            continue;
        }
        let fault = if name == "C14" && (0.36..0.41).contains(&share) {
            (share - 0.36) * 22.0
        } else {
            0.0
        };
        let slow = (k as f64 / (60.0 + s as f64)).sin() * (k as f64 / 917.0 + s as f64).cos();
        for (axis, threshold) in [(0, 3.5), (1, 5.25)] {
            let d = threshold * (0.25 * slow.abs() + 0.08 * wobble(k, s + 20 + axis).abs() + fault);
            // Nothing to test at first, and once not finite.
            match (k, s) {
                (0, _) => line.push_str(",,"),
                (90, 7) => line.push_str(",nan,3.5"),
                _ => {
                    let _ = write!(line, ",{d:.4},{threshold}");
                }
            }
        }
    }
}

/// A directory as `replay` writes it: a fault is excluded, then one is not, then satellites fail.
fn made_up(name: &str, run: &Run) -> PathBuf {
    let directory = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&directory).unwrap();
    let names: Vec<String> = [('G', 12), ('E', 9), ('C', 14)]
        .iter()
        .flat_map(|(letter, count)| (1..=*count).map(move |k| format!("{letter}{:02}", 2 * k)))
        .collect();
    let mut epochs = String::from(
        "t_s,week,tow_s,x_m,y_m,z_m,lat_deg,lon_deg,h_m,ve_mps,vn_mps,vu_mps,n_sats,mode,integrity,\
         reason,hpl_m,vpl_m,hal_m,val_m,excluded,stat,threshold",
    );
    epochs.push_str(if run.used { ",used" } else { "" });
    if run.bank {
        epochs.push_str(",n_bank,n_unmonitored,uncertainty_h_m,uncertainty_v_m");
        for name in &names {
            let _ = write!(epochs, ",d_h_{name},t_h_{name},d_v_{name},t_v_{name}");
        }
    }
    epochs.push('\n');
    let mut errors = String::from("t_s,e_m,n_m,u_m\n");
    for k in 0..run.epochs {
        let share = k as f64 / run.epochs as f64;
        let missing = (0.30..0.32).contains(&share);
        if (0.62..0.63).contains(&share) {
            continue; // epochs that never arrived
        }
        let faulty = (0.40..0.60).contains(&share);
        let alert = (0.40..0.41).contains(&share);
        let (integrity, reason) = match (missing, alert, faulty) {
            (true, _, _) => ("unavailable", "too_few_satellites"),
            (_, true, _) => ("alert", "fault_not_isolated"),
            (_, _, true) => ("excluded", "none"),
            _ => ("nominal", "none"),
        };
        let used: Vec<&String> = names
            .iter()
            .enumerate()
            .filter(|(s, name)| {
                let rise = wobble(*s, 9) * 0.6;
                let up = (rise..rise + 1.1).contains(&share);
                up && !missing && !(faulty && *name == "C14")
            })
            .map(|(_, name)| name)
            .collect();
        let slow = (k as f64 / 40.0).sin();
        let threshold = 60.0 + used.len() as f64;
        let stat = (used.len() as f64 - 6.0) * (1.0 + 0.3 * wobble(k, 3))
            + if alert { 180.0 } else { 0.0 };
        let level = |base: f64| base + 0.8 * slow + 0.1 * wobble(k, 4);
        let joined: Vec<&str> = used.iter().map(|s| s.as_str()).collect();
        let tow_s = 274_200.0 + k as f64;
        if missing {
            let _ = write!(
                epochs,
                "{k},2420,{tow_s},,,,,,,,,,{},none,{integrity},{reason},,,40,50,-,,",
                used.len()
            );
        } else {
            let excluded = if faulty && !alert { "C14" } else { "-" };
            let levels = if alert {
                ",".to_owned()
            } else {
                format!("{},{}", level(6.5), level(11.0))
            };
            let _ = write!(
                epochs,
                "{k},2420,{tow_s},1,2,3,31.1,121.8,20,0,0,0,{},snapshot,{integrity},{reason},{levels},40,50,{excluded},{stat},{threshold}",
                used.len(),
            );
            let bias = if alert { 9.0 } else { 0.0 };
            let _ = writeln!(
                errors,
                "{k},{},{},{}",
                0.4 * wobble(k, 5) + 0.5 * slow + bias,
                0.4 * wobble(k, 6),
                0.9 * wobble(k, 7) - 0.4 * slow
            );
        }
        if run.used {
            let _ = write!(epochs, ",{}", joined.join("+"));
        }
        if run.bank {
            bank_columns(&mut epochs, k, share, &names, &used);
        }
        epochs.push('\n');
    }
    std::fs::write(directory.join("epochs.csv"), epochs).unwrap();
    let errors_path = directory.join("errors.csv");
    if run.truth {
        std::fs::write(errors_path, errors).unwrap();
    } else {
        let _ = std::fs::remove_file(errors_path);
    }
    std::fs::write(
        directory.join("summary.json"),
        r#"{"epochs":240,"h95_m":0.8312,"bad_frames":{"crc":0,"length":3},"exclusions":[{"satellite":"C14","from_s":99}]}"#,
    )
    .unwrap();
    directory
}

#[test]
fn the_report_is_one_file_that_asks_for_no_other() {
    let directory = made_up(
        "report-approach",
        &Run {
            epochs: 241,
            truth: true,
            used: true,
            bank: true,
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
        },
    );
    let page = std::fs::read_to_string(report::write(&directory).unwrap()).unwrap();
    assert!(page.contains("No truth was given"));
    assert!(page.contains("\"bank\":null") && page.contains("\"stanford\":null"));
    assert!(!page.contains("error, 95 %"));
}

#[test]
fn a_directory_without_a_run_is_refused_with_what_to_do() {
    let directory = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("report-empty");
    std::fs::create_dir_all(&directory).unwrap();
    let message = format!("{:#}", report::write(&directory).unwrap_err());
    assert!(message.contains("surefix replay"), "{message}");
}
