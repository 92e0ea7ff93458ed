//! A simulated flight as the files of a scenario folder.
//!
//! Numbers have at most 15 significant digits, those of init.csv at most 17; all read back exactly.

use std::fmt::Write as _;

use super::clock::CLOCK_NOISE;
use super::trajectory::quaternion;
use super::{Scenario, fifteen_digits};
use crate::faults::FaultKind;
use crate::simulate::receiver::TRACKING_MASK_DEG;
use crate::simulate::stream::Format;

/// Shortest decimal that reads back as the number, with an exponent where it is small.
fn shortest(value: f64) -> String {
    if value != 0.0 && value.abs() < 1e-4 {
        format!("{value:e}")
    } else {
        format!("{value}")
    }
}

/// Appends a row of numbers of 15 digits.
fn row(csv: &mut String, values: impl IntoIterator<Item = f64>) {
    for (k, value) in values.into_iter().enumerate() {
        if k > 0 {
            csv.push(',');
        }
        csv.push_str(&shortest(fifteen_digits(value)));
    }
    csv.push('\n');
}

/// `imu.csv`.
pub fn imu_csv(scenario: &Scenario) -> String {
    let mut csv = "t_s,dth_x,dth_y,dth_z,dv_x,dv_y,dv_z\n".to_owned();
    for (k, sample) in scenario.imu.iter().enumerate() {
        let t_s = scenario.trajectory.time_s(k + 1);
        let increments = sample.dtheta_is_s_rad.into_iter().chain(sample.dv_is_s_mps);
        row(&mut csv, core::iter::once(t_s).chain(increments));
    }
    csv
}

/// `gnss.csv`; there is no epoch at t = 0.
pub fn gnss_csv(scenario: &Scenario) -> String {
    let mut csv = "t_s,sys,prn,sx,sy,sz,svx,svy,svz,pr,rr,sigma_pr,sigma_rr,el\n".to_owned();
    for epoch in scenario.epochs.iter().skip(1) {
        for satellite in &epoch.rows {
            let m = &satellite.measurement;
            let Some((rate_mps, sigma_mps)) = m.range_rate_mps else {
                continue;
            };
            let name = m.satellite;
            let t_s = shortest(fifteen_digits(epoch.t_s));
            let _ = write!(csv, "{t_s},{},{},", name.system().letter(), name.prn());
            let [sx, sy, sz] = m.r_es_e_m;
            let [svx, svy, svz] = m.v_es_e_mps;
            let measured = [m.pseudorange_m, rate_mps, m.sigma_pseudorange_m, sigma_mps];
            row(
                &mut csv,
                [sx, sy, sz, svx, svy, svz]
                    .into_iter()
                    .chain(measured)
                    .chain([satellite.elevation_rad]),
            );
        }
    }
    csv
}

/// `truth.csv`.
pub fn truth_csv(scenario: &Scenario) -> String {
    let mut csv =
        "t_s,px,py,pz,vx,vy,vz,qw,qx,qy,qz,clk_b,clk_d,bg_x,bg_y,bg_z,ba_x,ba_y,ba_z\n".to_owned();
    for truth in &scenario.truth {
        let state = &truth.state;
        row(
            &mut csv,
            [truth.t_s]
                .iter()
                .chain(&state.r_eb_e)
                .chain(&state.v_eb_e)
                .chain(&quaternion(&state.c_e_b))
                .chain(&[truth.clock.0, truth.clock.1])
                .chain(&truth.gyro_bias_radps)
                .chain(&truth.accel_bias_mps2)
                .copied(),
        );
    }
    csv
}

/// `init.csv`.
pub fn init_csv(scenario: &Scenario) -> String {
    let mut csv = "key,value\n".to_owned();
    let mut put = |key: &str, value: f64| {
        let _ = writeln!(csv, "{key},{}", shortest(value));
    };
    let (initial, sigma) = (&scenario.initial, &scenario.sigma);
    put("t0", 0.0);
    put("imu_dt", 1.0 / f64::from(scenario.request.imu_rate_hz));
    for (name, values) in [
        ("pos", initial.r_eb_e_m),
        ("vel", initial.v_eb_e_mps),
        ("bg", initial.gyro_bias_radps),
        ("ba", initial.accel_bias_mps2),
    ] {
        for (axis, value) in ["x", "y", "z"].iter().zip(values) {
            put(&format!("{name}_{axis}"), value);
        }
    }
    for (axis, value) in ["w", "x", "y", "z"].iter().zip(initial.q_e_b) {
        put(&format!("q_{axis}"), value);
    }
    put("clk_b", initial.clock_bias_m);
    put("clk_d", initial.clock_drift_mps);
    put("std_pos", sigma.position_m);
    put("std_vel", sigma.velocity_mps);
    for (axis, value) in ["n", "e", "d"].iter().zip(sigma.attitude_ned_rad) {
        put(&format!("std_att_{axis}"), value);
    }
    put("std_bg", sigma.gyro_bias_radps);
    put("std_ba", sigma.accel_bias_mps2);
    put("std_clk_b", sigma.clock_bias_m);
    put("std_clk_d", sigma.clock_drift_mps);
    let density = scenario.grade.noise().density;
    put("arw", density.arw);
    put("vrw", density.vrw);
    put("bg_rw", density.gyro_bias_walk);
    put("ba_rw", density.accel_bias_walk);
    put("clk_s_b", CLOCK_NOISE.bias_psd);
    put("clk_s_d", CLOCK_NOISE.drift_psd);
    put("clk_beta", CLOCK_NOISE.drift_decay_per_s);
    let reference = &scenario.reference;
    put("p_fa", reference.p_fa);
    put("p_md", reference.p_md);
    put("p_h0", reference.p_h0);
    put("hal", reference.hal_m);
    put("val", reference.val_m);
    let axes = if reference.detect_vertical { "hv" } else { "h" };
    let _ = writeln!(csv, "detect_axes,{axes}");
    let _ = writeln!(csv, "exclude,{}", u8::from(reference.exclude));
    let _ = writeln!(csv, "hold_s,{}", shortest(reference.hold_ns as f64 / 1e9));
    let _ = writeln!(csv, "mask_deg,{}", shortest(TRACKING_MASK_DEG));
    csv
}

/// `faults.csv`.
pub fn faults_csv(scenario: &Scenario) -> String {
    let mut csv = "sat,kind,mag,t0,t1,rr,period\n".to_owned();
    for fault in &scenario.faults {
        let kind = match fault.kind {
            FaultKind::Step => "step",
            FaultKind::Ramp => "ramp",
            FaultKind::Noise => "noise",
            FaultKind::Walk => "walk",
            FaultKind::Oscillation => "osc",
        };
        let _ = writeln!(
            csv,
            "{},{kind},{},{},{},{},{}",
            fault.satellite,
            fault.magnitude,
            fault.t0_s,
            fault.t1_s,
            u8::from(fault.on_range_rate),
            fault.period_s
        );
    }
    csv
}

/// `scenario.toml`: what was simulated, and when.
pub fn scenario_toml(scenario: &Scenario, format: Format) -> String {
    let density = scenario.grade.noise().density;
    let faults: Vec<String> = scenario.faults.iter().map(|f| format!("\"{f}\"")).collect();
    format!(
        "# Written by `surefix simulate`; the same arguments give the same files.\n\
         flight = \"{}\"\n\
         seed = {}\n\
         duration_s = {}\n\
         start = {{ week = {}, tow_s = {} }}   # GPST of t_s = 0\n\
         imu = \"{}\"\n\
         imu_rate_hz = {}\n\
         gnss_rate_hz = {}\n\
         noise_free = {}\n\
         arw = {:e}   # rad/sqrt(s)\n\
         vrw = {:e}   # m/s/sqrt(s)\n\
         gyro_bias_walk = {:e}   # rad/s/sqrt(s)\n\
         accel_bias_walk = {:e}   # m/s2/sqrt(s)\n\
         faults = [{}]   # SAT:KIND:MAG:T0:T1[:rr][:PERIOD], s from t_s = 0\n\
         {}\
         \n\
         [files]\n\
         scenario = [\"imu.csv\", \"gnss.csv\", \"init.csv\", \"truth.csv\", \"faults.csv\"]\n\
         receiver = \"{}\"   # {}\n\
         imu = \"imu.sfx\"   # native frames: what the unit is, and the samples of imu.csv\n",
        scenario.request.flight.name(),
        scenario.request.seed,
        scenario.duration_s,
        scenario.start.week(),
        scenario.start.tow_s(),
        scenario.grade.name(),
        scenario.request.imu_rate_hz,
        scenario.request.gnss_rate_hz,
        scenario.noise_free,
        density.arw,
        density.vrw,
        density.gyro_bias_walk,
        density.accel_bias_walk,
        faults.join(", "),
        scenario.request.disturbances.scenario_lines(),
        format.file(),
        match format {
            Format::Rtcm3 => "RTCM 3 from t_s = 0 on: MSM7, 1019, 1042",
            Format::Ubx => "UBX from 2 ms before t_s = 0 on: RXM-RAWX, RXM-SFRBX",
        },
    )
}

/// Every file of the folder but the byte streams.
pub fn files(scenario: &Scenario, format: Format) -> Vec<(&'static str, String)> {
    vec![
        ("imu.csv", imu_csv(scenario)),
        ("gnss.csv", gnss_csv(scenario)),
        ("init.csv", init_csv(scenario)),
        ("truth.csv", truth_csv(scenario)),
        ("faults.csv", faults_csv(scenario)),
        ("scenario.toml", scenario_toml(scenario, format)),
    ]
}
