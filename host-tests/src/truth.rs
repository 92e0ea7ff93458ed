//! Where the antenna really was, to compute errors against.
//!
//! | file | columns |
//! |---|---|
//! | surefix's own `truth.csv` | `t_s` or `week,tow_s`; `x_m,y_m,z_m` or `px,py,pz`; of velocities, if there, `vx_mps,vy_mps,vz_mps` |
//! | Spirent position, velocity, attitude | `GpsCycle,GpsWeek,GpsToW [s],Pos ECEF X [m],…` |
//! | RTKLIB `.pos` | GPST as date and time or week and seconds; latitude, longitude, height or ECEF |
//! | u-blox UBX | NAV-PVT with carrier-phase ambiguities resolved, height above the ellipsoid |
//!
//! Between rows at most 0.25 s apart a track is interpolated linearly: at 1 g that errs by
//! 8 cm; rows farther apart answer only at their own times.

mod arguments;
mod ubx;

use std::path::Path;

use anyhow::{Context, Result, anyhow, bail};
use nalgebra::Vector3;
use surefix_core::frames::geodesy::{self, Llh};
use surefix_core::time::{GpsTime, NS_PER_S};

pub use arguments::TruthArguments;

/// Longest gap that is interpolated, s.
const MAX_GAP_S: f64 = 0.25;
/// Two times nearer than this are the same, ns.
const SAME_TIME_NS: i64 = 1_000_000;

/// True positions of the antenna.
#[derive(Clone, Debug)]
pub struct Truth {
    /// Where it is from, in words.
    pub source: String,
    path: TruthPath,
}

/// A time in ns and a position, ECEF, m; or a velocity, m/s.
pub(crate) type TrackRow = (i64, [f64; 3]);

#[derive(Clone, Debug)]
enum TruthPath {
    Fixed([f64; 3]),
    Track(Track),
}

/// Rows in ascending order of their times.
#[derive(Clone, Debug)]
struct Track {
    /// Times are GPST; otherwise since the first epoch.
    is_gps_time: bool,
    positions: Vec<TrackRow>,
    /// Empty where the file has none.
    velocities: Vec<TrackRow>,
}

impl Track {
    const fn of_positions(positions: Vec<TrackRow>) -> Self {
        Self {
            is_gps_time: true,
            positions,
            velocities: Vec::new(),
        }
    }

    fn now_ns(&self, time: GpsTime, since_first_ns: i64) -> i64 {
        if self.is_gps_time {
            time.ns()
        } else {
            since_first_ns
        }
    }
}

impl Truth {
    /// An antenna that does not move, ECEF, m.
    pub fn fixed(r_e_m: [f64; 3], source: impl Into<String>) -> Self {
        Self {
            source: source.into(),
            path: TruthPath::Fixed(r_e_m),
        }
    }

    /// An antenna that does not move, degrees and metres above the WGS-84 ellipsoid.
    pub fn fixed_llh([lat_deg, lon_deg, height_m]: [f64; 3], source: impl Into<String>) -> Self {
        let r_e = geodesy::to_ecef(&Llh {
            lat_rad: lat_deg.to_radians(),
            lon_rad: lon_deg.to_radians(),
            height_m,
        });
        Self::fixed(r_e.into(), source)
    }

    /// Reads a track.
    ///
    /// # Errors
    /// When the file cannot be read or is of none of the forms above.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = crate::rinex::read_unzipped(path)
            .with_context(|| format!("cannot read the truth file {}", path.display()))?;
        let mut track = if ubx::looks_like_ubx(&bytes) {
            Track::of_positions(ubx::rows(&bytes)?)
        } else {
            let text = String::from_utf8(bytes)
                .with_context(|| format!("the truth file {} is no text", path.display()))?;
            if text.starts_with('%') {
                Track::of_positions(rtklib_rows(&text)?)
            } else {
                csv_track(&text)?
            }
        };
        if track.positions.is_empty() {
            bail!("{} holds no position", path.display());
        }
        track.positions.sort_by_key(|row| row.0);
        track.velocities.sort_by_key(|row| row.0);
        Ok(Self {
            source: path.display().to_string(),
            path: TruthPath::Track(track),
        })
    }

    /// Position at an epoch, ECEF, m; `None` where the track has none.
    pub fn at(&self, time: GpsTime, since_first_ns: i64) -> Option<[f64; 3]> {
        match &self.path {
            TruthPath::Fixed(r_e_m) => Some(*r_e_m),
            TruthPath::Track(track) => {
                look_up(&track.positions, track.now_ns(time, since_first_ns))
            }
        }
    }

    /// Velocity that the track itself states at an epoch, east, north, up, m/s; `None` where it states none.
    pub fn velocity_enu_mps(&self, time: GpsTime, since_first_ns: i64) -> Option<[f64; 3]> {
        let TruthPath::Track(track) = &self.path else {
            return None;
        };
        let now_ns = track.now_ns(time, since_first_ns);
        let v_e_mps = look_up(&track.velocities, now_ns)?;
        enu(look_up(&track.positions, now_ns)?, v_e_mps.into())
    }

    /// Error of a position east, north, up at the true position, m.
    pub fn error_enu_m(true_e_m: [f64; 3], r_e_m: [f64; 3]) -> Option<[f64; 3]> {
        enu(true_e_m, Vector3::from(r_e_m) - Vector3::from(true_e_m))
    }
}

/// A vector in Earth-fixed axes, east, north, up at a position.
fn enu(at_e_m: [f64; 3], vector_e: Vector3<f64>) -> Option<[f64; 3]> {
    let llh = geodesy::to_llh(&at_e_m.into()).ok()?;
    Some((geodesy::c_enu_e(llh.lat_rad, llh.lon_rad) * vector_e).into())
}

/// The row of a time, or between two rows that are near enough to each other.
fn look_up(rows: &[TrackRow], now_ns: i64) -> Option<[f64; 3]> {
    let after = rows.partition_point(|row| row.0 < now_ns);
    let same = [after.checked_sub(1), Some(after)]
        .into_iter()
        .flatten()
        .filter_map(|k| rows.get(k))
        .find(|row| (row.0 - now_ns).abs() <= SAME_TIME_NS);
    if let Some(row) = same {
        return Some(row.1);
    }
    let (before, next) = (rows.get(after.checked_sub(1)?)?, rows.get(after)?);
    let gap_s = (next.0 - before.0) as f64 / NS_PER_S as f64;
    if gap_s > MAX_GAP_S {
        return None;
    }
    let share = (now_ns - before.0) as f64 / (next.0 - before.0) as f64;
    Some(core::array::from_fn(|k| {
        before.1[k] + share * (next.1[k] - before.1[k])
    }))
}

fn csv_track(text: &str) -> Result<Track> {
    let mut lines = text.lines();
    let header: Vec<&str> = lines
        .next()
        .unwrap_or_default()
        .split(',')
        .map(str::trim)
        .collect();
    let find = |names: &[&str]| {
        names
            .iter()
            .find_map(|name| header.iter().position(|column| column == name))
    };
    let position = [
        find(&["x_m", "px", "Pos ECEF X [m]"]),
        find(&["y_m", "py", "Pos ECEF Y [m]"]),
        find(&["z_m", "pz", "Pos ECEF Z [m]"]),
    ];
    let [Some(x), Some(y), Some(z)] = position else {
        bail!(
            "the truth file has no columns x_m,y_m,z_m (or px,py,pz, or Pos ECEF X [m],…): its header is \"{}\"",
            header.join(",")
        );
    };
    let velocity = ["vx_mps", "vy_mps", "vz_mps"].map(|name| find(&[name]));
    let week = find(&["week", "GpsWeek"]).zip(find(&["tow_s", "GpsToW [s]"]));
    let cycle = find(&["GpsCycle"]);
    let since_first = find(&["t_s"]);
    if week.is_none() && since_first.is_none() {
        bail!("the truth file has neither t_s nor week and tow_s");
    }
    let mut track = Track {
        is_gps_time: week.is_some(),
        ..Track::of_positions(Vec::new())
    };
    for (number, line) in lines.enumerate().filter(|(_, l)| !l.trim().is_empty()) {
        let fields: Vec<&str> = line.split(',').map(str::trim).collect();
        let value = |column: usize| -> Result<f64> {
            fields
                .get(column)
                .and_then(|text| text.parse::<f64>().ok())
                .filter(|value| value.is_finite())
                .ok_or_else(|| {
                    anyhow!(
                        "line {} of the truth file: no number in column {}",
                        number + 2,
                        column + 1
                    )
                })
        };
        let ns = match (week, since_first) {
            (Some((week, tow)), _) => {
                let cycles = cycle.map_or(Ok(0.0), value)?;
                let week = (value(week)? + 1024.0 * cycles) as i32;
                GpsTime::from_week_tow_ns(week, seconds_to_ns(value(tow)?)).ns()
            }
            (None, Some(column)) => seconds_to_ns(value(column)?),
            (None, None) => 0,
        };
        track
            .positions
            .push((ns, [value(x)?, value(y)?, value(z)?]));
        if let [Some(x), Some(y), Some(z)] = velocity {
            track
                .velocities
                .push((ns, [value(x)?, value(y)?, value(z)?]));
        }
    }
    Ok(track)
}

fn seconds_to_ns(seconds: f64) -> i64 {
    (seconds * NS_PER_S as f64).round() as i64
}

pub(crate) fn rtklib_rows(text: &str) -> Result<Vec<TrackRow>> {
    let header = text
        .lines()
        .filter(|line| line.starts_with('%'))
        .find(|line| line.contains("latitude(deg)") || line.contains("x-ecef(m)"))
        .ok_or_else(|| anyhow!("the .pos file has no line that names its columns in degrees or ECEF: write it with RTKLIB's \"Lat/Lon/Height ddd.ddd\" or \"X/Y/Z-ECEF\""))?;
    if !header.contains("GPST") {
        bail!("the .pos file is not in GPS time: write it with RTKLIB's time system GPST");
    }
    let is_ecef = header.contains("x-ecef(m)");
    let mut rows = Vec::new();
    for line in text.lines().filter(|l| !l.starts_with('%')) {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let &[day, second, a, b, c, ..] = fields.as_slice() else {
            continue;
        };
        let time = rtklib_time(day, second).ok_or_else(|| anyhow!("\"{line}\" has no time"))?;
        let numbers: Option<Vec<f64>> = [a, b, c].iter().map(|t| t.parse().ok()).collect();
        let numbers = numbers.ok_or_else(|| anyhow!("\"{line}\" has no position"))?;
        let position = [numbers[0], numbers[1], numbers[2]];
        let truth = if is_ecef {
            Truth::fixed(position, "")
        } else {
            Truth::fixed_llh(position, "")
        };
        if let TruthPath::Fixed(r_e_m) = truth.path {
            rows.push((time.ns(), r_e_m));
        }
    }
    Ok(rows)
}

pub(crate) fn rtklib_time(day: &str, second: &str) -> Option<GpsTime> {
    let Some((year, rest)) = day.split_once('/') else {
        let week = day.parse().ok()?;
        return Some(GpsTime::from_week_tow_ns(
            week,
            seconds_to_ns(second.parse().ok()?),
        ));
    };
    let (month, day) = rest.split_once('/')?;
    let mut clock = second.split(':');
    crate::rinex::calendar(
        year.parse().ok()?,
        month.parse().ok()?,
        day.parse().ok()?,
        clock.next()?.parse().ok()?,
        clock.next()?.parse().ok()?,
        clock.next()?,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(text: &str) -> Truth {
        let track = if text.starts_with('%') {
            Track::of_positions(rtklib_rows(text).unwrap())
        } else {
            csv_track(text).unwrap()
        };
        Truth {
            source: String::new(),
            path: TruthPath::Track(track),
        }
    }

    #[test]
    fn a_track_answers_at_its_times_and_in_short_gaps() {
        let truth = track("t_s,x_m,y_m,z_m\n0,1,2,3\n0.2,3,2,1\n1.2,5,5,5\n");
        let at = |ns| truth.at(GpsTime::from_ns(0), ns);
        assert_eq!(at(0), Some([1.0, 2.0, 3.0]));
        assert_eq!(at(100_000_000), Some([2.0, 2.0, 2.0]));
        assert_eq!(at(700_000_000), None);
        assert_eq!(at(1_200_000_000), Some([5.0, 5.0, 5.0]));
        assert_eq!(at(2_000_000_000), None);
    }

    #[test]
    fn a_velocity_is_the_one_of_its_row_and_east_north_up() {
        // On the equator at longitude 0 up is x, east is y.
        let truth = track(
            "t_s,x_m,y_m,z_m,vx_mps,vy_mps,vz_mps\n0,6378137,0,0,3,1,2\n1,6378140,1,2,5,5,5\n",
        );
        let at = |ns| truth.velocity_enu_mps(GpsTime::from_ns(0), ns);
        assert_eq!(at(0), Some([1.0, 2.0, 3.0]));
        assert_eq!(at(500_000_000), None);
        let without = track("t_s,x_m,y_m,z_m\n0,6378137,0,0\n");
        assert_eq!(without.velocity_enu_mps(GpsTime::from_ns(0), 0), None);
    }

    #[test]
    fn spirent_and_rtklib_times_are_gps_times() {
        let spirent = track(
            "Time [s],GpsCycle,GpsWeek,GpsToW [s],Pos ECEF X [m],Pos ECEF Y [m],Pos ECEF Z [m]\n0,2,196,36000,1,2,3\n",
        );
        let time = GpsTime::from_week_tow_s(2244, 36_000);
        assert_eq!(spirent.at(time, 5), Some([1.0, 2.0, 3.0]));
        let rtklib = track(
            "%  GPST  x-ecef(m)  y-ecef(m)  z-ecef(m)\n2023/01/08 10:00:00.000 4.0 5.0 6.0 1\n2244 36001.0 7.0 8.0 9.0 1\n",
        );
        assert_eq!(rtklib.at(time, 5), Some([4.0, 5.0, 6.0]));
        assert_eq!(rtklib.at(time.plus_ns(NS_PER_S), 5), Some([7.0, 8.0, 9.0]));
    }

    #[test]
    fn the_error_is_east_north_up_at_the_truth() {
        let a = geodesy::to_ecef(&Llh {
            lat_rad: 0.0,
            lon_rad: 0.0,
            height_m: 0.0,
        });
        let error = Truth::error_enu_m(a.into(), [a.x + 3.0, a.y + 1.0, a.z + 2.0]).unwrap();
        assert_eq!(error, [1.0, 2.0, 3.0]);
    }
}
