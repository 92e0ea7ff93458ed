//! `track.kml` and `track.gpx`: the positions for a globe and for a map.
//!
//! [KML] 2.2, [GPX] 1.1. Heights are above the ellipsoid of WGS 84, as everywhere here; both formats mean heights
//! above the sea, for which a model of the geoid would be needed. Both files say so.

use std::io;

use surefix_core::integrity::Integrity;
use surefix_core::report::{EpochReport, Fix};
use surefix_core::time::{GpsTime, NS_PER_S, leap_seconds};
use time::UtcDateTime;
use time::format_description::well_known::Rfc3339;

use super::t_s;
use super::xml::Document;

const HEIGHTS: &str = "Heights are above the WGS 84 ellipsoid, not above the sea.";

/// Seconds between the Unix epoch and that of GPS. [IS-GPS-200] 20.3.3.5.2.4 dates the latter 1980-01-06.
const GPS_EPOCH_UNIX_S: i64 = 315_964_800;

/// States in the order of their styles, with colour as KML writes it (alpha, blue, green, red) and width in
/// pixels. Hues as in the report.
const STYLES: [(Integrity, &str, &str); 4] = [
    (Integrity::Nominal, "ff557d2f", "3"),
    (Integrity::Excluded, "ff007fc7", "4"),
    (Integrity::Alert, "ff1f27c0", "6"),
    (Integrity::Unavailable, "ff8b8076", "4"),
];

/// UTC of an epoch as XML writes it; `None` while its week is not known, or far outside the calendar.
fn utc(report: &EpochReport) -> Option<String> {
    if report.flags.week_unknown {
        return None;
    }
    let time: GpsTime = report.time;
    let unix_ns = i128::from(time.ns())
        + i128::from(GPS_EPOCH_UNIX_S - leap_seconds(time)) * i128::from(NS_PER_S);
    UtcDateTime::from_unix_timestamp_nanos(unix_ns)
        .ok()?
        .format(&Rfc3339)
        .ok()
}

/// Whether an epoch follows the one before it without one missing: then a line may join the two.
fn follows(before: &EpochReport, report: &EpochReport, interval_s: f64) -> bool {
    t_s(report) - t_s(before) <= 1.6 * interval_s
}

/// The most frequent interval between epochs, s.
fn interval_s(reports: &[EpochReport]) -> f64 {
    let mut intervals_s: Vec<f64> = reports
        .windows(2)
        .map(|pair| t_s(&pair[1]) - t_s(&pair[0]))
        .collect();
    intervals_s.sort_by(f64::total_cmp);
    intervals_s
        .get(intervals_s.len() / 2)
        .copied()
        .unwrap_or(1.0)
}

/// Epochs with a position, one after the other, none missing.
fn stretches(reports: &[EpochReport]) -> Vec<Vec<(&EpochReport, &Fix)>> {
    let interval_s = interval_s(reports);
    let mut stretches: Vec<Vec<(&EpochReport, &Fix)>> = Vec::new();
    let mut before: Option<&EpochReport> = None;
    for report in reports {
        let Some(fix) = &report.fix else {
            before = None;
            continue;
        };
        match stretches.last_mut() {
            Some(stretch) if before.is_some_and(|b| follows(b, report, interval_s)) => {
                stretch.push((report, fix));
            }
            _ => stretches.push(vec![(report, fix)]),
        }
        before = Some(report);
    }
    stretches
}

/// Whether whoever flies may use the position.
fn is_usable(report: &EpochReport) -> bool {
    matches!(
        report.verdict.integrity,
        Integrity::Nominal | Integrity::Excluded
    )
}

/// Writes `track.kml`: a line for every stretch of epochs in one state, in the state's style.
///
/// # Errors
/// When `out` cannot be written to.
pub fn write_kml(out: impl io::Write, name: &str, reports: &[EpochReport]) -> io::Result<()> {
    let mut kml = Document::begin(out)?;
    kml.open("kml", &[("xmlns", "http://www.opengis.net/kml/2.2")])?;
    kml.open("Document", &[])?;
    kml.text("name", name)?;
    kml.text("description", HEIGHTS)?;
    for (state, colour, width) in STYLES {
        kml.open("Style", &[("id", state.name())])?;
        kml.open("IconStyle", &[])?;
        kml.text("color", colour)?;
        kml.text("scale", "0.5")?;
        kml.close()?;
        kml.open("LineStyle", &[])?;
        kml.text("color", colour)?;
        kml.text("width", width)?;
        kml.close()?;
        kml.close()?;
    }
    for stretch in stretches(reports) {
        let mut rest = stretch.as_slice();
        let mut joint: Option<&Fix> = None;
        while let Some((first, _)) = rest.first() {
            let verdict = (first.verdict.integrity, first.verdict.reason);
            let count = rest
                .iter()
                .take_while(|(r, _)| (r.verdict.integrity, r.verdict.reason) == verdict)
                .count();
            let (part, after) = rest.split_at(count);
            placemark(&mut kml, joint, part)?;
            joint = part.last().map(|(_, fix)| *fix);
            rest = after;
        }
    }
    kml.end()
}

/// Epochs of one state, from where those before ended.
fn placemark<W: io::Write>(
    kml: &mut Document<W>,
    joint: Option<&Fix>,
    part: &[(&EpochReport, &Fix)],
) -> io::Result<()> {
    let (Some((first, _)), Some((last, _))) = (part.first(), part.last()) else {
        return Ok(());
    };
    let fixes = || joint.into_iter().chain(part.iter().map(|(_, fix)| *fix));
    let state = first.verdict.integrity.name();
    kml.open("Placemark", &[])?;
    kml.text("name", state)?;
    kml.text(
        "description",
        &format!(
            "{} s to {} s, {} epochs, reason: {}",
            t_s(first),
            t_s(last),
            part.len(),
            first.verdict.reason.name()
        ),
    )?;
    if let (Some(begin), Some(end)) = (utc(first), utc(last)) {
        kml.open("TimeSpan", &[])?;
        kml.text("begin", &begin)?;
        kml.text("end", &end)?;
        kml.close()?;
    }
    kml.text("styleUrl", &format!("#{state}"))?;
    // A line has two points at least.
    let is_line = fixes().nth(1).is_some();
    kml.open(if is_line { "LineString" } else { "Point" }, &[])?;
    kml.text("altitudeMode", "absolute")?;
    let places: Vec<String> = fixes()
        .map(|fix| format!("{},{},{}", fix.lon_deg, fix.lat_deg, fix.h_m))
        .collect();
    kml.text("coordinates", &places.join(" "))?;
    kml.close()?;
    kml.close()
}

/// Writes `track.gpx`: every position, a segment for each stretch without a gap. `fix` is `3d` where the verdict
/// says that the position may be used, else `none`; state and levels are in extensions.
///
/// # Errors
/// When `out` cannot be written to.
pub fn write_gpx(out: impl io::Write, name: &str, reports: &[EpochReport]) -> io::Result<()> {
    let mut gpx = Document::begin(out)?;
    let creator = concat!("surefix ", env!("CARGO_PKG_VERSION"));
    gpx.open(
        "gpx",
        &[
            ("version", "1.1"),
            ("creator", creator),
            ("xmlns", "http://www.topografix.com/GPX/1/1"),
            ("xmlns:surefix", "urn:surefix:track:1"),
        ],
    )?;
    gpx.open("metadata", &[])?;
    gpx.text("name", name)?;
    gpx.text("desc", HEIGHTS)?;
    gpx.close()?;
    gpx.open("trk", &[])?;
    for stretch in stretches(reports) {
        gpx.open("trkseg", &[])?;
        for (report, fix) in stretch {
            let (lat, lon) = (fix.lat_deg.to_string(), fix.lon_deg.to_string());
            gpx.open("trkpt", &[("lat", &lat), ("lon", &lon)])?;
            gpx.text("ele", &fix.h_m.to_string())?;
            if let Some(time) = utc(report) {
                gpx.text("time", &time)?;
            }
            gpx.text("fix", if is_usable(report) { "3d" } else { "none" })?;
            gpx.text("sat", &report.used.len().to_string())?;
            gpx.open("extensions", &[])?;
            let verdict = &report.verdict;
            gpx.text("surefix:integrity", verdict.integrity.name())?;
            for (name, level) in [
                ("surefix:hpl_m", verdict.hpl),
                ("surefix:vpl_m", verdict.vpl),
            ] {
                if let Some(bound_m) = level.bound_m() {
                    gpx.text(name, &bound_m.to_string())?;
                }
            }
            gpx.close()?;
            gpx.close()?;
        }
        gpx.close()?;
    }
    gpx.end()
}

#[cfg(test)]
mod tests {
    use super::*;
    use quick_xml::Reader;
    use quick_xml::events::Event;
    use surefix_core::integrity::{InertialStatus, Mode, ProtectionLevel, Reason, Verdict};
    use surefix_core::report::ReportFlags;

    /// Seconds of a run and the state in each; a position but where there is none.
    fn reports(states: &[(i64, Option<Integrity>)]) -> Vec<EpochReport> {
        let report = |(t_s, state): &(i64, Option<Integrity>)| {
            let mut verdict = Verdict::unavailable(Reason::None, 40.0, None);
            verdict.integrity = state.unwrap_or(Integrity::Unavailable);
            verdict.hpl = ProtectionLevel::Bound(7.5);
            EpochReport {
                residual_rms_m: None,
                sigma_enu_m: None,
                suspect: None,
                time: GpsTime::from_week_tow_s(2420, 274_200 + t_s),
                since_first_ns: t_s * NS_PER_S,
                mode: Mode::Snapshot,
                fix: state.map(|_| Fix {
                    r_e_m: [0.0; 3],
                    lat_deg: 31.5 + *t_s as f64,
                    lon_deg: -121.25,
                    h_m: 20.5,
                    velocity_enu_mps: None,
                    clock_m: [None; 3],
                }),
                verdict,
                used: surefix_core::gnss::SatelliteSet::EMPTY,
                n_observed: 9,
                unused: [0; surefix_core::gnss::solution::SATELLITE_REASONS],
                flags: ReportFlags::default(),
                navigation: None,
                inertial: InertialStatus::Off,
            }
        };
        states.iter().map(report).collect()
    }

    /// Every element with the text in it, in order; panics where the document is not well formed.
    fn elements(document: &[u8]) -> Vec<(String, String)> {
        let mut reader = Reader::from_reader(document);
        let mut found: Vec<(String, String)> = Vec::new();
        let mut buffer = Vec::new();
        loop {
            match reader.read_event_into(&mut buffer).unwrap() {
                Event::Start(start) => {
                    let name = start.name().0.to_owned();
                    found.push((name, String::new()));
                }
                Event::Text(text) => {
                    if let Some((_, of)) = found.last_mut() {
                        of.push_str(text.trim());
                    }
                }
                Event::GeneralRef(entity) => {
                    let (_, of) = found.last_mut().unwrap();
                    of.push_str(&format!("[{}]", &*entity));
                }
                Event::Eof => return found,
                _ => {}
            }
            buffer.clear();
        }
    }

    fn texts<'a>(elements: &'a [(String, String)], name: &str) -> Vec<&'a str> {
        elements
            .iter()
            .filter(|(element, _)| element == name)
            .map(|(_, text)| text.as_str())
            .collect()
    }

    const FLIGHT: [(i64, Option<Integrity>); 7] = [
        (0, Some(Integrity::Nominal)),
        (1, Some(Integrity::Nominal)),
        (2, Some(Integrity::Alert)),
        (3, Some(Integrity::Excluded)),
        (4, None),
        (5, Some(Integrity::Nominal)),
        (9, Some(Integrity::Nominal)),
    ];

    #[test]
    fn a_globe_shows_each_state_in_its_style_and_joins_nothing_across_a_gap() {
        let mut out = Vec::new();
        write_kml(&mut out, "a<b&c", &reports(&FLIGHT)).unwrap();
        let elements = elements(&out);
        assert_eq!(texts(&elements, "name")[0], "a[lt]b[amp]c");
        assert_eq!(
            texts(&elements, "styleUrl"),
            ["#nominal", "#alert", "#excluded", "#nominal", "#nominal"]
        );
        assert_eq!(
            texts(&elements, "coordinates"),
            [
                "-121.25,31.5,20.5 -121.25,32.5,20.5",
                "-121.25,32.5,20.5 -121.25,33.5,20.5",
                "-121.25,33.5,20.5 -121.25,34.5,20.5",
                "-121.25,36.5,20.5",
                "-121.25,40.5,20.5",
            ]
        );
        assert_eq!(texts(&elements, "LineString").len(), 3);
        assert_eq!(texts(&elements, "Point").len(), 2);
        assert!(
            texts(&elements, "altitudeMode")
                .iter()
                .all(|mode| *mode == "absolute")
        );
        // 18 leap seconds.
        assert_eq!(texts(&elements, "begin")[0], "2026-05-27T04:09:42Z");
    }

    #[test]
    fn a_map_gets_every_position_and_a_fix_only_where_it_may_be_used() {
        let mut out = Vec::new();
        write_gpx(&mut out, "flight", &reports(&FLIGHT)).unwrap();
        let elements = elements(&out);
        assert_eq!(texts(&elements, "trkseg").len(), 3);
        assert_eq!(
            texts(&elements, "fix"),
            ["3d", "3d", "none", "3d", "3d", "3d"]
        );
        assert_eq!(texts(&elements, "surefix:hpl_m"), ["7.5"; 6]);
        assert!(texts(&elements, "surefix:vpl_m").is_empty());
        assert_eq!(texts(&elements, "time")[5], "2026-05-27T04:09:51Z");
        // The order of the schema.
        let point: Vec<&str> = elements
            .iter()
            .map(|(name, _)| name.as_str())
            .skip_while(|name| *name != "trkpt")
            .skip(1)
            .take_while(|name| *name != "trkpt" && !name.starts_with("surefix:"))
            .collect();
        assert_eq!(point, ["ele", "time", "fix", "sat", "extensions"]);
    }

    #[test]
    fn a_week_that_is_not_known_gives_no_date() {
        let mut reports = reports(&FLIGHT);
        for report in &mut reports {
            report.flags.week_unknown = true;
        }
        let (mut kml, mut gpx) = (Vec::new(), Vec::new());
        write_kml(&mut kml, "flight", &reports).unwrap();
        write_gpx(&mut gpx, "flight", &reports).unwrap();
        assert!(texts(&elements(&kml), "TimeSpan").is_empty());
        assert!(texts(&elements(&gpx), "time").is_empty());
    }
}
