//! `satellites.csv`: one row per epoch and satellite observed at it.

use std::fmt::Write as _;
use std::io;

use surefix_core::report::EpochReport;
use surefix_core::satellite_report::SatelliteReport;

use super::{field, t_s};

/// The satellites of each epoch, beside the reports; `None` where the receiver sent no observations.
pub type Satellites = [Option<Box<SatelliteReport>>];

/// Columns of `satellites.csv`.
pub const SATELLITE_COLUMNS: &str =
    "t_s,satellite,use,azimuth_deg,elevation_deg,residual_m,cn0_dbhz";

/// Writes `satellites.csv`.
///
/// # Errors
/// When `out` cannot be written to.
pub fn write_satellites(
    out: &mut impl io::Write,
    reports: &[EpochReport],
    satellites: &Satellites,
) -> io::Result<()> {
    writeln!(out, "{SATELLITE_COLUMNS}")?;
    let mut line = String::new();
    for (report, satellites) in reports.iter().zip(satellites) {
        for row in satellites.iter().flat_map(|satellites| &satellites.rows) {
            line.clear();
            let (t_s, name) = (t_s(report), row.fate.name());
            let _ = write!(line, "{t_s},{},{name}", row.satellite);
            let direction = row.direction_cdeg;
            field(
                &mut line,
                direction.map(|(azimuth, _)| f64::from(azimuth) / 100.0),
            );
            field(
                &mut line,
                direction.map(|(_, elevation)| f64::from(elevation) / 100.0),
            );
            field(&mut line, row.residual_mm.map(|mm| f64::from(mm) / 1000.0));
            field(
                &mut line,
                row.cn0_quarter_dbhz
                    .map(|quarters| f64::from(quarters) / 4.0),
            );
            writeln!(out, "{line}")?;
        }
    }
    Ok(())
}
