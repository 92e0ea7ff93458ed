//! `inertial.csv`: one row per epoch, with what is known of the inertial side.

use std::fmt::Write as _;
use std::io;

use surefix_core::inertial_report::InertialReport;
use surefix_core::report::EpochReport;

use super::{field, t_s};

/// Columns of `inertial.csv`.
pub const INERTIAL_COLUMNS: &str = "t_s,status,alignment,sigma_north_deg,sigma_east_deg,\
    sigma_heading_deg,voting,unit_0,unit_1,unit_2,fault_0,fault_1,fault_2,lead_of_samples_s";

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
        let _ = write!(line, ",{}", inertial.voting.name());
        for unit in &inertial.units {
            let _ = write!(line, ",{}", unit.state.name());
        }
        for unit in &inertial.units {
            let _ = write!(line, ",{}", unit.fault.name());
        }
        let lead_ns = inertial.timing.lead_of_samples_ns;
        field(&mut line, lead_ns.map(|ns| ns as f64 / 1e9));
        writeln!(out, "{line}")?;
    }
    Ok(())
}
