//! A barometer on a PC: what it would have measured on a track, its recordings, and its place in the
//! stream of bytes a board would see.
//!
//! | file | what it does |
//! |---|---|
//! | `aiding/air.rs` | a height to the pressures that a barometer with errors and faults measures there |
//! | `aiding/run.rs` | a simulated flight with aids through the whole monitor |
//! | `aiding/settings.rs` | section `[aids]` of a configuration file |
//! | this | recordings as CSV, `week,tow_s,pressure_pa,temperature_c`; samples between the frames of a stream |

mod air;
mod run;
mod settings;

pub use air::{Air, BarometerFault, pressure_pa};
pub use run::{AidedRow, config, fly_aided, pressures};
pub use settings::AidsSettings;

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context, Result, bail};
use surefix_core::config::Config;
use surefix_core::ingest::{Event, Ingest, encode_aids, encode_pressure};
use surefix_core::ins::{AidsConfig, PressureSample};
use surefix_core::time::{GpsTime, NS_PER_S};
use surefix_core::wire::native;

use crate::imu;

/// First line of a recording.
pub const BAROMETER_COLUMNS: &str = "week,tow_s,pressure_pa,temperature_c";

/// A recording as CSV.
pub fn csv(samples: &[PressureSample]) -> String {
    let mut text = format!("{BAROMETER_COLUMNS}\n");
    for sample in samples {
        let time = sample.time;
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "{},{:.3},{:.3},{:.2}",
            time.week(),
            time.tow_s(),
            sample.pressure_pa,
            sample.temperature_c
        );
    }
    text
}

/// Reads a recording.
///
/// # Errors
/// When the file cannot be read or a line is none; the message names the line.
pub fn read(path: &Path) -> Result<Vec<PressureSample>> {
    let name = path.display();
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {name}"))?;
    let mut lines = text.lines().enumerate();
    match lines.next() {
        Some((_, first)) if first.trim() == BAROMETER_COLUMNS => {}
        _ => bail!("{name} does not begin with {BAROMETER_COLUMNS}"),
    }
    lines
        .filter(|(_, line)| !line.trim().is_empty())
        .map(|(number, line)| {
            sample(line)
                .with_context(|| format!("{name} line {}: not {BAROMETER_COLUMNS}", number + 1))
        })
        .collect()
}

fn sample(line: &str) -> Option<PressureSample> {
    let fields: Vec<f64> = line
        .split(',')
        .map(|field| field.trim().parse().ok())
        .collect::<Option<_>>()?;
    let &[week, tow_s, pressure_pa, temperature_c] = fields.as_slice() else {
        return None;
    };
    let is_week = (0.0..=65_535.0).contains(&week) && week.fract() == 0.0;
    let is_time = (0.0..=604_800.0).contains(&tow_s);
    (is_week && is_time && pressure_pa.is_finite() && temperature_c.is_finite()).then(|| {
        let tow_ns = (tow_s * NS_PER_S as f64).round() as i64;
        PressureSample {
            time: GpsTime::from_week_tow_ns(week as i32, tow_ns),
            pressure_pa,
            temperature_c,
        }
    })
}

/// A stream with the aids after its first frame, the configuration, and each sample of a barometer after the
/// inertial sample of its time, or, in a stream without any, before the frame that completes the first
/// epoch not earlier.
///
/// # Errors
/// When the stream does not begin with a frame.
pub fn with_aids(
    stream: &[u8],
    config: &Config,
    aids: &AidsConfig,
    samples: &[PressureSample],
) -> Result<Vec<u8>> {
    let frames = imu::frames(stream);
    let Some(first) = frames.first() else {
        bail!("the stream has no frame");
    };
    let mut out = stream[..first.end].to_vec();
    let mut frame = [0; native::MAX_FRAME];
    let length = encode_aids(aids, &mut frame)
        .map_err(|error| anyhow::anyhow!("the aids do not encode: {error:?}"))?;
    out.extend_from_slice(&frame[..length]);
    let mut ingest = Box::new(Ingest::EMPTY);
    ingest.configure(config);
    let mut rest = samples;
    let mut written = first.end;
    for range in frames.into_iter().skip(1) {
        let (mut after, mut before) = (None, None);
        let mut bytes = &stream[range.clone()];
        loop {
            let (used, event) = ingest.push(bytes);
            bytes = &bytes[used..];
            match event {
                Event::Nothing => break,
                Event::Imu(sample) => after = Some(sample.time),
                Event::UnitSample { sample, .. } => after = Some(sample.sample.time),
                Event::EpochReady => before = Some(ingest.epoch().time),
                Event::EndOfStream => break,
                _ => {}
            }
        }
        if let Some(time) = before {
            out.extend_from_slice(&stream[written..range.start]);
            written = range.start;
            release(&mut rest, time, &mut out);
        }
        if let Some(time) = after {
            out.extend_from_slice(&stream[written..range.end]);
            written = range.end;
            release(&mut rest, time, &mut out);
        }
    }
    out.extend_from_slice(&stream[written..]);
    Ok(out)
}

fn release(rest: &mut &[PressureSample], until: GpsTime, out: &mut Vec<u8>) {
    let mut frame = [0; native::MAX_FRAME];
    while let Some((sample, behind)) = rest.split_first() {
        if sample.time > until {
            return;
        }
        *rest = behind;
        // The longest frame holds a sample.
        if let Ok(length) = encode_pressure(sample, &mut frame) {
            out.extend_from_slice(&frame[..length]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_reads_back() {
        let samples = [17_i64, 117, 217].map(|ms| PressureSample {
            time: GpsTime::from_week_tow_ns(2244, ms * 1_000_000),
            pressure_pa: 101_325.125 + ms as f64,
            temperature_c: 21.5,
        });
        let path = std::env::temp_dir().join("surefix-barometer.csv");
        std::fs::write(&path, csv(&samples)).unwrap();
        assert_eq!(read(&path).unwrap(), samples);
        for wrong in ["1,2,3", "x,2,3,4", "1.5,2,3,4", "1,2,nan,4", "1,-2,3,4"] {
            std::fs::write(&path, format!("{BAROMETER_COLUMNS}\n{wrong}\n")).unwrap();
            let error = format!("{:#}", read(&path).unwrap_err());
            assert!(error.contains("line 2"), "{error}");
        }
        std::fs::remove_file(&path).unwrap();
    }
}
