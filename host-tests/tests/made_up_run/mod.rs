//! A run as `replay` writes it, made up: quick for a day, and with everything in it that a page can show.

use std::fmt::Write as _;
use std::path::PathBuf;

use nalgebra::Vector3;
use surefix_core::frames::geodesy::{self, Llh};

/// What a made-up run consists of.
pub struct Run {
    pub epochs: usize,
    pub truth: bool,
    pub used: bool,
    pub bank: bool,
    pub satellites: bool,
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

/// Around a block of three kilometres, up and down.
fn position(share: f64, k: usize) -> (Llh, Vector3<f64>) {
    let turn = share * core::f64::consts::TAU;
    let llh = Llh {
        lat_rad: 0.543 + 2.3e-4 * turn.sin() + 1e-7 * wobble(k, 11),
        lon_rad: 2.126 + 2.3e-4 * (2.0 * turn).cos() + 1e-7 * wobble(k, 12),
        height_m: 20.0 + 300.0 * (1.0 - turn.cos()) + wobble(k, 13),
    };
    (llh, geodesy::to_ecef(&llh))
}

/// The satellites of an epoch: those used, and C14 while it is excluded, going astray.
fn satellite_rows(text: &mut String, k: usize, share: f64, names: &[String], used: &[&String]) {
    for (s, name) in (0_u32..).zip(names) {
        let is_used = used.contains(&name);
        let astray = name == "C14" && (0.36..0.60).contains(&share);
        if !is_used && !astray {
            continue;
        }
        let azimuth_deg = (f64::from(s) * 47.0 + share * 130.0) % 360.0;
        let elevation_deg = 12.0 + f64::from(s * 17 % 60) + 15.0 * (share * 3.0).sin();
        let fault_m = if astray { (share - 0.36) * 250.0 } else { 0.0 };
        let residual_m = wobble(k, 40 + u64::from(s)) + fault_m;
        let cn0_dbhz = 34.0 + elevation_deg / 6.0 + wobble(k, 80 + u64::from(s));
        let fate = if is_used { "used" } else { "fault_excluded" };
        let _ = writeln!(
            text,
            "{k},{name},{fate},{azimuth_deg:.2},{elevation_deg:.2},{residual_m:.3},{cn0_dbhz:.2}"
        );
    }
}

/// A directory as `replay` writes it: a fault is excluded, then one is not, then satellites fail.
pub fn made_up(name: &str, run: &Run) -> PathBuf {
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
    let mut satellites =
        String::from("t_s,satellite,use,azimuth_deg,elevation_deg,residual_m,cn0_dbhz\n");
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
            let (llh, r_e) = position(share, k);
            let excluded = if faulty && !alert { "C14" } else { "-" };
            let levels = if alert {
                ",".to_owned()
            } else {
                format!("{},{}", level(6.5), level(11.0))
            };
            let _ = write!(
                epochs,
                "{k},2420,{tow_s},{},{},{},{},{},{},0,0,0,{},snapshot,{integrity},{reason},{levels},40,50,{excluded},{stat},{threshold}",
                r_e.x,
                r_e.y,
                r_e.z,
                llh.lat_rad.to_degrees(),
                llh.lon_rad.to_degrees(),
                llh.height_m,
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
        if run.satellites {
            satellite_rows(&mut satellites, k, share, &names, &used);
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
    let satellites_path = directory.join("satellites.csv");
    if run.satellites {
        std::fs::write(satellites_path, satellites).unwrap();
    } else {
        let _ = std::fs::remove_file(satellites_path);
    }
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
