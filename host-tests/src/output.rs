//! What a replay writes: `epochs.csv`, `satellites.csv`, `errors.csv`, `summary.json`, tracks.
//!
//! `epochs.csv` holds what the monitor said and nothing else, so that it is the same file whether a PC
//! or a board ran it; errors against the truth go to `errors.csv`. Numbers are printed in their
//! shortest form that reads back exactly.

mod bank;
mod inertial;
mod satellites;
mod track;
mod xml;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io;

use serde::Serialize;
use surefix_core::gnss::measurement::SatelliteReason;
use surefix_core::gnss::{SatelliteSet, System};
use surefix_core::integrity::{Integrity, Phase, ProtectionLevel, Reason};
use surefix_core::report::{EpochReport, ReportFlags};
use surefix_core::time::NS_PER_S;

use crate::truth::Truth;

pub use bank::{BankColumns, BankSummary, Banks};
pub use inertial::{INERTIAL_COLUMNS, write_inertial};
pub use satellites::{SATELLITE_COLUMNS, Satellites, write_satellites};
pub use track::{write_gpx, write_kml};

/// Columns of `epochs.csv`: those of the contract, then more; those of the bank follow ([`BankColumns`]).
pub const EPOCH_COLUMNS: &str = "t_s,week,tow_s,x_m,y_m,z_m,lat_deg,lon_deg,h_m,ve_mps,vn_mps,vu_mps,\
n_sats,mode,integrity,reason,hpl_m,vpl_m,hal_m,val_m,excluded,stat,threshold,\
n_visible,used,clock_g_m,clock_e_m,clock_c_m,flags,unused,\
roll_deg,pitch_deg,heading_deg,inertial,sigma_e_m,sigma_n_m,sigma_u_m,\
sigma_ve_mps,sigma_vn_mps,sigma_vu_mps,nis,nis_rows,\
residual_rms_m,suspect,bias_m,sigma_bias_m,p_md";

/// Seconds since the first epoch.
pub fn t_s(report: &EpochReport) -> f64 {
    report.since_first_ns as f64 / NS_PER_S as f64
}

fn satellites(set: &SatelliteSet) -> String {
    let names: Vec<String> = set.iter().map(|s| s.to_string()).collect();
    if names.is_empty() {
        "-".into()
    } else {
        names.join("+")
    }
}

fn flags(flags: ReportFlags) -> String {
    let bits = flags.bits();
    let names: Vec<&str> = ReportFlags::NAMES
        .iter()
        .enumerate()
        .filter(|(k, _)| bits & 1 << k != 0)
        .map(|(_, name)| *name)
        .collect();
    if names.is_empty() {
        "-".into()
    } else {
        names.join("+")
    }
}

/// Satellites observed and not used, by reason: `below_mask:3+unhealthy:1`.
fn unused(counts: &[u8]) -> String {
    let reasons: Vec<String> = SatelliteReason::ALL
        .iter()
        .zip(counts)
        .filter(|(_, count)| **count > 0)
        .map(|(reason, count)| format!("{}:{count}", reason.name()))
        .collect();
    if reasons.is_empty() {
        "-".into()
    } else {
        reasons.join("+")
    }
}

/// A field that may be empty.
fn field(line: &mut String, value: Option<f64>) {
    line.push(',');
    if let Some(value) = value {
        let _ = write!(line, "{value}");
    }
}

/// One row of `epochs.csv`, without the line end.
pub fn epoch_row(report: &EpochReport) -> String {
    let verdict = &report.verdict;
    let fix = report.fix.as_ref();
    let mut line = format!("{}", t_s(report));
    let week = (!report.flags.week_unknown).then(|| f64::from(report.time.week()));
    field(&mut line, week);
    field(&mut line, Some(report.time.tow_s()));
    for k in 0..3 {
        field(&mut line, fix.map(|fix| fix.r_e_m[k]));
    }
    field(&mut line, fix.map(|fix| fix.lat_deg));
    field(&mut line, fix.map(|fix| fix.lon_deg));
    field(&mut line, fix.map(|fix| fix.h_m));
    for k in 0..3 {
        let velocity = fix.and_then(|fix| fix.velocity_enu_mps);
        field(&mut line, velocity.map(|velocity| velocity[k]));
    }
    let _ = write!(
        line,
        ",{},{},{},{}",
        report.used.len(),
        report.mode.name(),
        verdict.integrity.name(),
        verdict.reason.name()
    );
    field(&mut line, verdict.hpl.bound_m());
    field(&mut line, verdict.vpl.bound_m());
    field(&mut line, Some(verdict.hal_m));
    field(&mut line, verdict.val_m);
    let _ = write!(line, ",{}", satellites(&verdict.excluded));
    field(&mut line, verdict.statistic);
    field(&mut line, verdict.threshold);
    let _ = write!(line, ",{},{}", report.n_observed, satellites(&report.used));
    for system in System::ALL {
        let clock = fix.and_then(|fix| fix.clock_m[system.index()]);
        field(&mut line, clock);
    }
    let _ = write!(line, ",{},{}", flags(report.flags), unused(&report.unused));
    let navigation = report.navigation.as_ref();
    for k in 0..3 {
        field(&mut line, navigation.map(|n| n.roll_pitch_heading_deg[k]));
    }
    let _ = write!(line, ",{}", report.inertial.name());
    for k in 0..3 {
        field(&mut line, report.sigma_enu_m.map(|sigma_m| sigma_m[k]));
    }
    for k in 0..3 {
        field(&mut line, navigation.map(|n| n.sigma_velocity_enu_mps[k]));
    }
    field(&mut line, navigation.map(|n| n.nis));
    field(&mut line, navigation.map(|n| n.nis_rows.into()));
    field(&mut line, report.residual_rms_m);
    let suspect = report.suspect.as_ref();
    let _ = match suspect {
        Some(suspect) => write!(line, ",{}", suspect.satellite),
        None => write!(line, ",-"),
    };
    field(&mut line, suspect.map(|s| s.bias_m));
    field(&mut line, suspect.map(|s| s.sigma_m));
    field(&mut line, suspect.map(|s| s.p_md));
    line
}

/// One epoch as a line to read while it happens.
pub fn epoch_line(report: &EpochReport) -> String {
    let verdict = &report.verdict;
    let level = |level: ProtectionLevel| {
        level
            .bound_m()
            .map_or("      -".into(), |bound_m| format!("{bound_m:5.1} m"))
    };
    let mut line = format!(
        "t {:8.1} s  {:11}  HPL {}  VPL {}  {:2} satellites",
        t_s(report),
        verdict.integrity.name(),
        level(verdict.hpl),
        level(verdict.vpl),
        report.used.len(),
    );
    if !verdict.excluded.is_empty() {
        let names: Vec<String> = verdict.excluded.iter().map(|s| s.to_string()).collect();
        line += &format!("  without {}", names.join("+"));
    }
    if verdict.reason != Reason::None {
        line += &format!("  {}", verdict.reason.name());
    }
    line
}

/// Writes `epochs.csv` row by row: a day with the columns of a bank is larger than its reports.
///
/// # Errors
/// When `out` cannot be written to.
pub fn write_epochs(
    out: &mut impl io::Write,
    reports: &[EpochReport],
    banks: &Banks,
) -> io::Result<()> {
    let columns = BankColumns::new(banks);
    writeln!(out, "{EPOCH_COLUMNS}{}", columns.header())?;
    for (k, report) in reports.iter().enumerate() {
        let mut line = epoch_row(report);
        columns.row(
            &mut line,
            report,
            banks.get(k).and_then(|bank| bank.as_deref()),
        );
        writeln!(out, "{line}")?;
    }
    Ok(())
}

/// `epochs.csv` in memory, to compare.
pub fn epochs_csv(reports: &[EpochReport], banks: &Banks) -> String {
    let mut bytes = Vec::new();
    // A vector takes everything, and numbers and names are ASCII.
    let _ = write_epochs(&mut bytes, reports, banks);
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Error east, north, up of each epoch that has a position and a truth, m.
pub fn errors_enu_m(reports: &[EpochReport], truth: Option<&Truth>) -> Vec<Option<[f64; 3]>> {
    reports
        .iter()
        .map(|report| {
            let true_e_m = truth?.at(report.time, report.since_first_ns)?;
            Truth::error_enu_m(true_e_m, report.fix?.r_e_m)
        })
        .collect()
}

/// `errors.csv`: `t_s,e_m,n_m,u_m` of the epochs that have an error.
pub fn errors_csv(reports: &[EpochReport], errors: &[Option<[f64; 3]>]) -> String {
    let mut text = String::from("t_s,e_m,n_m,u_m\n");
    for (report, error) in reports.iter().zip(errors) {
        if let Some([e, n, u]) = error {
            let _ = writeln!(text, "{},{e},{n},{u}", t_s(report));
        }
    }
    text
}

/// A run of consecutive epochs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// Satellite, where the interval is of one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub satellite: Option<String>,
    /// First epoch, s from the first of the stream.
    pub from_s: f64,
    /// Last epoch.
    pub to_s: f64,
    /// Number of epochs.
    pub epochs: usize,
}

/// Statistics of the position error.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ErrorStatistics {
    /// Epochs with an error.
    pub epochs_with_error: usize,
    /// 95 % of the horizontal errors are at most this, m.
    pub h95_m: Option<f64>,
    /// 95 % of the vertical errors are at most this, m.
    pub v95_m: Option<f64>,
    /// Largest horizontal error, m.
    pub max_error_h_m: Option<f64>,
    /// Largest vertical error, m.
    pub max_error_v_m: Option<f64>,
    /// Mean error east, north, up, m.
    pub mean_error_enu_m: Option<[f64; 3]>,
    /// Epochs whose horizontal or vertical error exceeds its level.
    pub epochs_with_error_above_level: usize,
    /// Of these, epochs whose verdict said the position may be used.
    pub epochs_with_error_above_level_and_usable: usize,
    /// Largest horizontal error over its level.
    pub largest_error_over_hpl: Option<f64>,
    /// Largest vertical error over its level.
    pub largest_error_over_vpl: Option<f64>,
}

/// `summary.json`, without what belongs to the input.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Epochs.
    pub epochs: usize,
    /// Epochs with a position.
    pub epochs_with_position: usize,
    /// Where the truth is from; `null` without one.
    pub truth: Option<String>,
    /// Errors against the truth.
    #[serde(flatten)]
    pub errors: ErrorStatistics,
    /// Median horizontal level, m.
    pub median_hpl_m: Option<f64>,
    /// Median vertical level, m.
    pub median_vpl_m: Option<f64>,
    /// Epochs by where the position comes from.
    pub modes: BTreeMap<&'static str, usize>,
    /// Epochs by what the inertial side does.
    pub inertial: BTreeMap<&'static str, usize>,
    /// What the bank of filters did.
    pub bank: BankSummary,
    /// Epochs by verdict.
    pub integrity: BTreeMap<&'static str, usize>,
    /// Epochs by reason.
    pub reasons: BTreeMap<&'static str, usize>,
    /// Epochs with an alert.
    pub alerts: usize,
    /// When.
    pub alert_intervals: Vec<Interval>,
    /// Satellites excluded, and when.
    pub exclusions: Vec<Interval>,
    /// Share of the epochs with a position, without an alert, and with levels within the limits of
    /// each phase of flight.
    pub availability: BTreeMap<&'static str, f64>,
    /// Epochs by flag.
    pub flags: BTreeMap<&'static str, usize>,
    /// Satellites observed and not used, summed over the epochs, by reason.
    pub unused: BTreeMap<&'static str, usize>,
}

/// The value that `share` of the values do not exceed, nearest rank.
pub fn quantile(values: &mut [f64], share: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let rank = (share * values.len() as f64).ceil() as usize;
    values.get(rank.max(1) - 1).copied()
}

fn error_over_level(error_m: f64, level: ProtectionLevel) -> Option<f64> {
    level.bound_m().map(|bound_m| error_m / bound_m)
}

fn error_statistics(reports: &[EpochReport], errors: &[Option<[f64; 3]>]) -> ErrorStatistics {
    let mut statistics = ErrorStatistics::default();
    let (mut horizontal, mut vertical, mut sum) = (Vec::new(), Vec::new(), [0.0; 3]);
    let largest = |slot: &mut Option<f64>, value: Option<f64>| {
        if let Some(value) = value
            && slot.is_none_or(|largest| value > largest)
        {
            *slot = Some(value);
        }
    };
    for (report, error) in reports.iter().zip(errors) {
        let Some([e, n, u]) = *error else { continue };
        let (h, v) = (e.hypot(n), u.abs());
        horizontal.push(h);
        vertical.push(v);
        for (sum, value) in sum.iter_mut().zip([e, n, u]) {
            *sum += value;
        }
        largest(&mut statistics.max_error_h_m, Some(h));
        largest(&mut statistics.max_error_v_m, Some(v));
        let h_ratio = error_over_level(h, report.verdict.hpl);
        let v_ratio = error_over_level(v, report.verdict.vpl);
        largest(&mut statistics.largest_error_over_hpl, h_ratio);
        largest(&mut statistics.largest_error_over_vpl, v_ratio);
        if h_ratio.is_some_and(|r| r > 1.0) || v_ratio.is_some_and(|r| r > 1.0) {
            statistics.epochs_with_error_above_level += 1;
            if report.verdict.integrity.is_usable() {
                statistics.epochs_with_error_above_level_and_usable += 1;
            }
        }
    }
    statistics.epochs_with_error = horizontal.len();
    if !horizontal.is_empty() {
        statistics.mean_error_enu_m = Some(sum.map(|total| total / horizontal.len() as f64));
    }
    statistics.h95_m = quantile(&mut horizontal, 0.95);
    statistics.v95_m = quantile(&mut vertical, 0.95);
    statistics
}

/// Runs of consecutive epochs for which `is_in` holds.
fn intervals(
    reports: &[EpochReport],
    satellite: Option<String>,
    is_in: impl Fn(&EpochReport) -> bool,
) -> Vec<Interval> {
    let mut found: Vec<Interval> = Vec::new();
    let mut open = false;
    for report in reports {
        let now_in = is_in(report);
        match found.last_mut() {
            Some(last) if open && now_in => {
                last.to_s = t_s(report);
                last.epochs += 1;
            }
            _ if now_in => found.push(Interval {
                satellite: satellite.clone(),
                from_s: t_s(report),
                to_s: t_s(report),
                epochs: 1,
            }),
            _ => {}
        }
        open = now_in;
    }
    found
}

/// Whether the levels of an epoch lie within the limits of a phase.
fn is_available(report: &EpochReport, phase: Phase) -> bool {
    let limits = phase.requirements();
    let verdict = &report.verdict;
    report.fix.is_some()
        && verdict.integrity != Integrity::Alert
        && verdict.hpl.is_within(limits.hal_m)
        && limits
            .val_m
            .is_none_or(|val_m| verdict.vpl.is_within(val_m))
}

/// Everything `summary.json` says of the epochs.
pub fn summarize(
    reports: &[EpochReport],
    banks: &Banks,
    errors: &[Option<[f64; 3]>],
    truth: Option<&Truth>,
) -> Summary {
    let mut modes: BTreeMap<_, usize> = BTreeMap::new();
    let mut inertial: BTreeMap<_, usize> = BTreeMap::new();
    let mut integrity: BTreeMap<_, usize> = BTreeMap::new();
    let mut reasons: BTreeMap<_, usize> = BTreeMap::new();
    let mut flags: BTreeMap<_, usize> = BTreeMap::new();
    let mut unused: BTreeMap<_, usize> = BTreeMap::new();
    let mut excluded = SatelliteSet::EMPTY;
    for report in reports {
        for (reason, count) in SatelliteReason::ALL.iter().zip(report.unused) {
            if count > 0 {
                *unused.entry(reason.name()).or_default() += usize::from(count);
            }
        }
        *modes.entry(report.mode.name()).or_default() += 1;
        *inertial.entry(report.inertial.name()).or_default() += 1;
        *integrity
            .entry(report.verdict.integrity.name())
            .or_default() += 1;
        if report.verdict.reason != Reason::None {
            *reasons.entry(report.verdict.reason.name()).or_default() += 1;
        }
        for (k, name) in ReportFlags::NAMES.iter().enumerate() {
            if report.flags.bits() & 1 << k != 0 {
                *flags.entry(*name).or_default() += 1;
            }
        }
        for satellite in report.verdict.excluded.iter() {
            excluded.insert(satellite);
        }
    }
    let median = |level: fn(&EpochReport) -> ProtectionLevel| {
        let mut bounds: Vec<f64> = reports.iter().filter_map(|r| level(r).bound_m()).collect();
        quantile(&mut bounds, 0.5)
    };
    let count = reports.len().max(1) as f64;
    Summary {
        epochs: reports.len(),
        epochs_with_position: reports.iter().filter(|r| r.fix.is_some()).count(),
        truth: truth.map(|truth| truth.source.clone()),
        errors: error_statistics(reports, errors),
        median_hpl_m: median(|r| r.verdict.hpl),
        median_vpl_m: median(|r| r.verdict.vpl),
        modes,
        inertial,
        bank: BankSummary::new(banks),
        integrity,
        reasons,
        alerts: reports
            .iter()
            .filter(|r| r.verdict.integrity == Integrity::Alert)
            .count(),
        alert_intervals: intervals(reports, None, |r| r.verdict.integrity == Integrity::Alert),
        exclusions: excluded
            .iter()
            .flat_map(|satellite| {
                intervals(reports, Some(satellite.to_string()), |r| {
                    r.verdict.excluded.contains(satellite)
                })
            })
            .collect(),
        availability: Phase::ALL
            .iter()
            .map(|phase| {
                let available = reports.iter().filter(|r| is_available(r, *phase)).count();
                (phase.name(), available as f64 / count)
            })
            .collect(),
        flags,
        unused,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use surefix_core::gnss::Satellite;
    use surefix_core::gnss::solution::SATELLITE_REASONS;
    use surefix_core::integrity::{InertialStatus, Mode, Suspect, Verdict};
    use surefix_core::report::Navigation;
    use surefix_core::time::GpsTime;

    pub(super) fn no_position() -> EpochReport {
        EpochReport {
            time: GpsTime::from_week_tow_s(2010, 100),
            since_first_ns: 0,
            mode: Mode::None,
            fix: None,
            verdict: Verdict::unavailable(Reason::TooFewSatellites, 556.0, None),
            used: SatelliteSet::EMPTY,
            n_observed: 0,
            unused: [0; SATELLITE_REASONS],
            flags: ReportFlags::default(),
            residual_rms_m: None,
            sigma_enu_m: None,
            suspect: None,
            navigation: None,
            inertial: InertialStatus::Off,
        }
    }

    #[test]
    fn a_row_has_a_field_for_every_column_and_numbers_that_read_back_exactly() {
        let mut report = no_position();
        let value = |row: &str, name: &str| {
            let place = EPOCH_COLUMNS.split(',').position(|column| column == name);
            row.split(',').nth(place.unwrap()).unwrap().to_owned()
        };
        let columns = EPOCH_COLUMNS.split(',').count();
        let row = epoch_row(&report);
        assert_eq!(row.split(',').count(), columns);
        assert_eq!(
            (
                value(&row, "roll_deg").as_str(),
                value(&row, "inertial").as_str(),
                value(&row, "suspect").as_str()
            ),
            ("", "off", "-")
        );

        report.inertial = InertialStatus::Running;
        report.residual_rms_m = Some(0.7);
        report.sigma_enu_m = Some([0.4, 0.5, 0.6]);
        report.suspect = Some(Suspect {
            satellite: Satellite::new(System::Gps, 4).unwrap(),
            bias_m: -41.25,
            sigma_m: 3.1,
            p_md: 1e-3,
        });
        report.navigation = Some(Navigation {
            v_e_mps: [0.0; 3],
            q_e_b: [1.0, 0.0, 0.0, 0.0],
            roll_pitch_heading_deg: [0.1 + 0.2, -2.0, 359.5],
            clock: [0.0; 2],
            sigma_position_enu_m: [0.4, 0.5, 0.6],
            sigma_velocity_enu_mps: [0.07, 0.08, 0.09],
            sigma_attitude_enu_deg: [0.0; 3],
            fault_free_m: [0.0; 2],
            nis: 1.0 / 3.0,
            nis_rows: 24,
        });
        let row = epoch_row(&report);
        assert_eq!(row.split(',').count(), columns);
        for (name, expected) in [
            ("roll_deg", 0.1 + 0.2),
            ("pitch_deg", -2.0),
            ("heading_deg", 359.5),
            ("sigma_e_m", 0.4),
            ("sigma_n_m", 0.5),
            ("sigma_u_m", 0.6),
            ("sigma_ve_mps", 0.07),
            ("sigma_vn_mps", 0.08),
            ("sigma_vu_mps", 0.09),
            ("nis", 1.0 / 3.0),
            ("nis_rows", 24.0),
            ("residual_rms_m", 0.7),
            ("bias_m", -41.25),
            ("sigma_bias_m", 3.1),
            ("p_md", 1e-3),
        ] {
            assert_eq!(value(&row, name).parse(), Ok(expected), "{name}");
        }
        assert_eq!(value(&row, "inertial"), "running");
        assert_eq!(value(&row, "suspect"), "G04");
    }

    #[test]
    fn quantiles_are_values_that_occurred() {
        let mut values: Vec<f64> = (1..=20).rev().map(f64::from).collect();
        assert_eq!(quantile(&mut values, 0.95), Some(19.0));
        assert_eq!(quantile(&mut values, 0.5), Some(10.0));
        assert_eq!(quantile(&mut [7.0], 0.95), Some(7.0));
        assert_eq!(quantile(&mut [], 0.95), None);
    }
}
