//! `inertial.csv`: one row per epoch, with what is known of the inertial side.

use std::fmt::Write as _;
use std::io;

use surefix_core::inertial_report::InertialReport;
use surefix_core::ins::HorizonState;
use surefix_core::report::EpochReport;

use super::{field, t_s};

/// Columns of `inertial.csv`.
pub const INERTIAL_COLUMNS: &str = "t_s,status,alignment,sigma_north_deg,sigma_east_deg,\
    sigma_heading_deg,obstacle,voting,unit_0,unit_1,unit_2,fault_0,fault_1,fault_2,lead_of_samples_s,\
    latency_s,held_samples,epochs_too_late,now_t_s,now_x_m,now_y_m,now_z_m,now_vx_mps,now_vy_mps,now_vz_mps,\
    standstill,climb,height,height_bias_m";

/// Writes `inertial.csv`; `inertial` is beside the reports.
///
/// # Errors
/// When `out` cannot be written to.
pub fn write_inertial(
    out: &mut impl io::Write,
    reports: &[EpochReport],
    inertial: &[Option<InertialReport>],
) -> io::Result<()> {
    writeln!(out, "{INERTIAL_COLUMNS}")?;
    let mut line = String::new();
    for (report, inertial) in reports.iter().zip(inertial) {
        let Some(inertial) = inertial else { continue };
        line.clear();
        let (t_s, status) = (t_s(report), report.inertial.name());
        let _ = write!(line, "{t_s},{status},{}", inertial.alignment.mode.name());
        for axis in 0..3 {
            let sigma_rad = inertial.alignment.sigma_ned_rad.map(|sigma| sigma[axis]);
            field(&mut line, sigma_rad.map(f64::to_degrees));
        }
        let _ = write!(line, ",{}", inertial.alignment.obstacle.name());
        let _ = write!(line, ",{}", inertial.voting.name());
        for unit in &inertial.units {
            let _ = write!(line, ",{}", unit.state.name());
        }
        for unit in &inertial.units {
            let _ = write!(line, ",{}", unit.fault.name());
        }
        let lead_ns = inertial.timing.lead_of_samples_ns;
        field(&mut line, lead_ns.map(|ns| ns as f64 / 1e9));
        let timing = &inertial.timing;
        field(&mut line, Some(timing.latency_ns as f64 / 1e9));
        let HorizonState { held, too_late } = timing.horizon;
        let _ = write!(line, ",{held},{too_late}");
        let now_s = timing
            .now
            .map(|now| t_s + now.time.seconds_since(inertial.time));
        field(&mut line, now_s);
        for axis in 0..3 {
            field(&mut line, timing.now.map(|now| now.r_e_m[axis]));
        }
        for axis in 0..3 {
            field(&mut line, timing.now.map(|now| now.v_e_mps[axis]));
        }
        let aids = &inertial.aids;
        for aid in [aids.standstill, aids.climb, aids.height] {
            let _ = write!(line, ",{}", aid.name());
        }
        field(&mut line, aids.height_bias_m);
        writeln!(out, "{line}")?;
    }
    Ok(())
}
