//! A receiver's own solutions as input: RTKLIB `.pos` files become frames of surefix's own, and fixes can be
//! withheld, as an outage of the receiver would.
//!
//! | column of `.pos` | becomes |
//! |---|---|
//! | GPST | time of the fix |
//! | latitude, longitude, height | the same, the height of the geoid added where the user gives it |
//! | Q | 1 fixed, 2 and 6 float, 3 and 4 differential, 5 code |
//! | sdn, sde, sdu | horizontal accuracy √(sdn² + sde²), vertical accuracy |
//! | vn, ve, vu, sdvn, sdve, sdvu | velocity, if there; its accuracy is the largest of the three |

use std::path::Path;
use std::str::FromStr;

use anyhow::{Context, Result, anyhow, bail};
use surefix_core::config::Config;
use surefix_core::frames::geodesy::Llh;
use surefix_core::gnss::{FixQuality, FixSolution, FixVelocity, ReceiverFix};
use surefix_core::ingest::{
    Event, Ingest, RECEIVER_FIX_FRAME_LENGTH, decode_receiver_fix, encode_receiver_fix,
    receiver_fix,
};
use surefix_core::time::GpsTime;
use surefix_core::wire::native::{self, Kind};
use surefix_core::wire::ubx::{self, NavPvt};

use crate::imu::frames;
use crate::rinex;
use crate::truth::rtklib_time;

/// A time without fixes, seconds from the first epoch, its end not included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outage {
    /// From here on, s.
    pub from_s: f64,
    /// Up to here, s.
    pub to_s: f64,
}

impl FromStr for Outage {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> Result<Self> {
        let wrong = || anyhow!("\"{text}\" is not T0:T1 in seconds, for example 100:110");
        let (from, to) = text.split_once(':').ok_or_else(wrong)?;
        let outage = Self {
            from_s: from.parse().map_err(|_| wrong())?,
            to_s: to.parse().map_err(|_| wrong())?,
        };
        if outage.from_s < outage.to_s {
            Ok(outage)
        } else {
            Err(wrong())
        }
    }
}

/// What a user may say about fixes.
#[derive(Clone, Debug, Default)]
pub struct FixOptions {
    /// Height of the geoid above the ellipsoid, m, where the heights of a `.pos` file are above the sea.
    pub geoid_m: Option<f64>,
    /// Times for which fixes are withheld.
    pub outages: Vec<Outage>,
}

/// Whether a text is an RTKLIB solution.
pub(crate) fn looks_like_pos(bytes: &[u8]) -> bool {
    bytes.starts_with(b"%") && {
        let head = String::from_utf8_lossy(&bytes[..bytes.len().min(10_000)]);
        head.contains("latitude(deg)") || head.contains("x-ecef(m)")
    }
}

/// Reads a recording; one of fixes becomes frames, without those that are withheld.
///
/// # Errors
/// When it cannot be read, and when fixes are to be withheld and it holds none that counts.
pub(crate) fn read(path: &Path, config: &Config, options: &FixOptions) -> Result<Vec<u8>> {
    let mut bytes = rinex::read_argument("--gnss", "a recording of a receiver", path)?;
    if looks_like_pos(&bytes) {
        let text = String::from_utf8_lossy(&bytes);
        bytes = pos_frames(&text, options.geoid_m).with_context(|| path.display().to_string())?;
    } else if options.geoid_m.is_some() {
        bail!(
            "--geoid is for the heights of an RTKLIB .pos file, and {} is none",
            path.display()
        );
    }
    if options.outages.is_empty() {
        return Ok(bytes);
    }
    let first = first_fix(&bytes, config).ok_or_else(|| {
        anyhow!(
            "--outage withholds a receiver's own solutions: {} has none, or observations, beside which they \
             do not count",
            path.display()
        )
    })?;
    Ok(withhold(&bytes, first, &options.outages))
}

/// Fixes of a `.pos` file.
///
/// # Errors
/// When it has other columns than expected, or a line that cannot be read.
pub fn pos_fixes(text: &str, geoid_m: Option<f64>) -> Result<Vec<ReceiverFix>> {
    let mut header = text.lines().take_while(|line| line.starts_with('%'));
    let columns = header
        .clone()
        .find(|line| line.contains("latitude(deg)"))
        .ok_or_else(|| anyhow!("the .pos file has no latitude and longitude in degrees: write it with RTKLIB's \"Lat/Lon/Height ddd.ddd\""))?;
    if !columns.contains("GPST") {
        bail!("the .pos file is not in GPS time: write it with RTKLIB's time system GPST");
    }
    if geoid_m.is_none() && header.any(|line| line.contains("/geodetic")) {
        bail!(
            "the heights of the .pos file are above the sea: give the height of the geoid with --geoid"
        );
    }
    let has_velocity = columns.contains("vn(m/s)");
    let lines = text
        .lines()
        .filter(|line| !line.starts_with('%') && !line.trim().is_empty());
    lines
        .map(|line| {
            pos_fix(line, has_velocity, geoid_m.unwrap_or(0.0))
                .ok_or_else(|| anyhow!("\"{line}\" is no solution with standard deviations"))
        })
        .collect()
}

fn pos_fix(line: &str, has_velocity: bool, geoid_m: f64) -> Option<ReceiverFix> {
    let mut words = line.split_whitespace();
    let time = rtklib_time(words.next()?, words.next()?)?;
    let numbers: Option<Vec<f64>> = words.map(|word| word.parse().ok()).collect();
    let numbers = numbers?;
    let &[
        lat_deg,
        lon_deg,
        height_m,
        q,
        ns,
        sdn,
        sde,
        sdu,
        _,
        _,
        _,
        _,
        _,
        ref rest @ ..,
    ] = numbers.as_slice()
    else {
        return None;
    };
    let quality = match q as u8 {
        1 => FixQuality::Fixed,
        2 | 6 => FixQuality::Float,
        3 | 4 => FixQuality::Differential,
        5 => FixQuality::Code,
        _ => return None,
    };
    let velocity = match *rest {
        [vn, ve, vu, sdvn, sdve, sdvu, ..] if has_velocity => Some(FixVelocity {
            ned_mps: [vn, ve, -vu],
            accuracy_mps: sdvn.max(sdve).max(sdvu),
        }),
        _ => None,
    };
    Some(ReceiverFix {
        time,
        satellites: ns as u8,
        solution: Some(FixSolution {
            quality,
            llh: Llh {
                lat_rad: lat_deg.to_radians(),
                lon_rad: lon_deg.to_radians(),
                height_m: height_m + geoid_m,
            },
            horizontal_accuracy_m: sdn.hypot(sde),
            vertical_accuracy_m: sdu,
            velocity,
        }),
    })
}

/// The same as frames that a monitor takes.
fn pos_frames(text: &str, geoid_m: Option<f64>) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut frame = [0; RECEIVER_FIX_FRAME_LENGTH];
    for fix in pos_fixes(text, geoid_m)? {
        let length = encode_receiver_fix(&fix, &mut frame)
            .map_err(|native::Full| anyhow!("a fix does not fit its frame"))?;
        bytes.extend_from_slice(&frame[..length]);
    }
    if bytes.is_empty() {
        bail!("the .pos file holds no solution");
    }
    Ok(bytes)
}

/// When the first fix counts.
fn first_fix(bytes: &[u8], config: &Config) -> Option<GpsTime> {
    let mut ingest = Box::new(Ingest::EMPTY);
    ingest.configure(config);
    let (mut rest, mut first) = (bytes, None);
    loop {
        let (used, event) = ingest.push(rest);
        rest = &rest[used..];
        match event {
            Event::ReceiverFix(fix) => {
                first.get_or_insert(fix.time);
            }
            Event::EpochReady => return None,
            Event::Nothing if rest.is_empty() => return first,
            _ => {}
        }
    }
}

/// The time of a frame with a fix.
fn fix_time(frame: &[u8]) -> Option<GpsTime> {
    if let Ok((frame, _)) = ubx::Frame::parse(frame) {
        let pvt = (frame.message == ubx::NAV_PVT).then(|| NavPvt::parse(frame.payload));
        return receiver_fix(&pvt?.ok()?).ok().map(|fix| fix.time);
    }
    let (frame, _) = native::Frame::parse(frame).ok()?;
    (frame.kind() == Some(Kind::ReceiverFix))
        .then(|| decode_receiver_fix(frame.payload()).ok())?
        .map(|fix| fix.time)
}

fn withhold(bytes: &[u8], first: GpsTime, outages: &[Outage]) -> Vec<u8> {
    let is_withheld = |frame: &[u8]| {
        fix_time(frame).is_some_and(|time| {
            let t_s = time.seconds_since(first);
            outages
                .iter()
                .any(|outage| (outage.from_s..outage.to_s).contains(&t_s))
        })
    };
    let (mut kept, mut from) = (Vec::with_capacity(bytes.len()), 0);
    for frame in frames(bytes) {
        if is_withheld(&bytes[frame.clone()]) {
            kept.extend_from_slice(&bytes[from..frame.start]);
            from = frame.end;
        }
    }
    kept.extend_from_slice(&bytes[from..]);
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "%  GPST  latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) \
sdeu(m) sdun(m) age(s) ratio vn(m/s) ve(m/s) vu(m/s) sdvn sdve sdvu sdvne sdveu sdvun\n";
    const LINE: &str = "2025/07/08 19:34:18.500 40.0 -105.0 1601.5 2 21 0.3 0.4 0.7 0 0 0 0 0 1.0 -2.0 0.5 0.05 0.06 \
0.04 0 0 0\n";

    #[test]
    fn a_line_of_pos_becomes_a_fix() {
        let fixes = pos_fixes(&format!("{HEADER}{LINE}"), Some(-16.0)).unwrap();
        let &[
            ReceiverFix {
                time,
                satellites: 21,
                solution: Some(solution),
            },
        ] = fixes.as_slice()
        else {
            panic!("{fixes:?}");
        };
        assert_eq!(time.week(), 2374);
        assert_eq!(solution.quality, FixQuality::Float);
        assert_eq!(solution.llh.height_m, 1585.5);
        assert_eq!(solution.horizontal_accuracy_m, 0.5);
        let velocity = solution.velocity.unwrap();
        assert_eq!(velocity.ned_mps, [1.0, -2.0, -0.5]);
        assert_eq!(velocity.accuracy_mps, 0.06);
    }

    #[test]
    fn heights_above_the_sea_ask_for_the_geoid() {
        let geodetic = format!("% (lat/lon/height=WGS84/geodetic,Q=1:fix)\n{HEADER}{LINE}");
        assert!(pos_fixes(&geodetic, None).is_err());
        assert!(pos_fixes(&geodetic, Some(0.0)).is_ok());
        let utc = HEADER.replace("GPST", "UTC");
        assert!(pos_fixes(&format!("{utc}{LINE}"), None).is_err());
        assert!(pos_fixes(&format!("{HEADER}2025/07/08 19:34:18.5 40 -105 1\n"), None).is_err());
    }

    #[test]
    fn an_outage_takes_its_fixes_and_no_other_byte() {
        let text: String = (0..40)
            .map(|k| LINE.replace("18.500", &format!("{}.500", 18 + k)))
            .collect();
        let bytes = pos_frames(&format!("{HEADER}{text}"), None).unwrap();
        let first = first_fix(&bytes, &Config::PRESET).unwrap();
        // Held back for five seconds.
        let left = withhold(
            &bytes,
            first,
            &[Outage {
                from_s: 10.0,
                to_s: 20.0,
            }],
        );
        let times = |bytes: &[u8]| -> Vec<f64> {
            frames(bytes)
                .into_iter()
                .filter_map(|frame| fix_time(&bytes[frame]))
                .map(|time| time.seconds_since(first))
                .collect()
        };
        let all = times(&bytes);
        assert_eq!((all.len(), all[0]), (40, -5.0));
        let kept: Vec<f64> = all
            .iter()
            .copied()
            .filter(|t| !(10.0..20.0).contains(t))
            .collect();
        assert_eq!(times(&left), kept);
        assert!("1:2".parse::<Outage>().is_ok());
        for wrong in ["", "5", "2:1", "a:b", "1:nan"] {
            assert!(wrong.parse::<Outage>().is_err(), "{wrong}");
        }
    }
}
