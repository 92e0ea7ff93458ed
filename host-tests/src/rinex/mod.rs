//! Reading RINEX 3 and 4: observation and navigation files, plain, gzip, and Hatanaka-compressed.
//!
//! In: the bytes of a file. Out: [`ObservationReader`], which yields one
//! [`surefix_core::gnss::ObservationEpoch`] at a time, or [`NavigationFile`] with every usable
//! broadcast ephemeris. What a file is, its content says, never its name.
//!
//! Every number is the one the file prints, read once into an `f64`; only units and time scales
//! change (Doppler to range rate, BDT and GST to GPST). What a line has that cannot be read is
//! counted and skipped, never guessed.
//!
//! Source: [RINEX-3.05] and [RINEX-4.01]; the compression after [HATANAKA-2008]. Why this is not a
//! crate: docs/decisions/004-rinex.md.

mod crinex;
mod fields;
mod navigation;
mod observation;

use std::io::Read;
use std::path::Path;

use anyhow::Context;

pub use fields::calendar;
pub use navigation::{NavigationFile, TimedEphemeris};
pub use observation::{ObservationCounts, ObservationHeader, ObservationReader};

/// What stopped the reading of a whole file.
#[derive(Debug, thiserror::Error)]
pub enum RinexError {
    /// The file could not be read.
    #[error("cannot read {path}")]
    Io {
        /// Which file.
        path: String,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// The bytes are not RINEX.
    #[error("{0}")]
    NotRinex(String),
    /// RINEX, but of a kind or version that is not read.
    #[error("{0}")]
    Unsupported(String),
    /// RINEX with a header or a compression that cannot be followed.
    #[error("line {line}: {cause}")]
    Broken {
        /// Line of the text, from 1.
        line: usize,
        /// What is wrong there.
        cause: String,
    },
}

/// What a file turned out to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// RINEX 3 or 4 observations, already uncompressed.
    Observations,
    /// RINEX 3 or 4 navigation messages.
    Navigation,
}

/// Reads a file and takes off its gzip wrapping, if it has one.
pub fn read_unzipped(path: &Path) -> Result<Vec<u8>, RinexError> {
    let io = |source| RinexError::Io {
        path: path.display().to_string(),
        source,
    };
    let bytes = std::fs::read(path).map_err(io)?;
    if !bytes.starts_with(&[0x1f, 0x8b]) {
        return Ok(bytes);
    }
    let mut unzipped = Vec::with_capacity(bytes.len() * 6);
    flate2::read::MultiGzDecoder::new(bytes.as_slice())
        .read_to_end(&mut unzipped)
        .map_err(io)?;
    Ok(unzipped)
}

/// Reads a file that an argument of the command line names, as [`read_unzipped`].
///
/// # Errors
/// When it cannot be read; the message names the argument.
pub fn read_argument(flag: &str, what: &str, path: &Path) -> anyhow::Result<Vec<u8>> {
    read_unzipped(path)
        .with_context(|| format!("{flag} {}: give the path of {what}", path.display()))
}

/// Whether bytes begin as a RINEX or Compact RINEX file does.
pub fn looks_like_rinex(bytes: &[u8]) -> bool {
    let first = bytes.split(|b| *b == b'\n').next().unwrap_or_default();
    let label = first.get(60..).unwrap_or_default();
    label.starts_with(b"RINEX VERSION / TYPE") || label.starts_with(b"CRINEX VERS")
}

/// The text of a RINEX file, with Hatanaka compression undone, and what it holds.
pub fn text_of(bytes: Vec<u8>) -> Result<(String, Content), RinexError> {
    if !looks_like_rinex(&bytes) {
        return Err(RinexError::NotRinex(
            "the first line is no RINEX header (\"RINEX VERSION / TYPE\" in column 61)".into(),
        ));
    }
    // Comments may hold any encoding; no field that is read may.
    let text = match String::from_utf8(bytes) {
        Ok(text) => text,
        Err(error) => String::from_utf8_lossy(error.as_bytes()).into_owned(),
    };
    let text = if text.get(60..).is_some_and(|l| l.starts_with("CRINEX")) {
        crinex::expand(&text)?
    } else {
        text
    };
    let first = text.lines().next().unwrap_or_default();
    let version: f64 = fields::number(first, 0, 9).unwrap_or(0.0);
    if !(3.0..5.0).contains(&version) {
        return Err(RinexError::Unsupported(format!(
            "RINEX version {version}: versions 3 and 4 are read; convert the file (for example with gfzrnx -vo 3)"
        )));
    }
    match first.as_bytes().get(20) {
        Some(b'O') => Ok((text, Content::Observations)),
        Some(b'N') => Ok((text, Content::Navigation)),
        _ => Err(RinexError::Unsupported(format!(
            "RINEX file type \"{}\": observation (O) and navigation (N) files are read",
            first.get(20..40).unwrap_or_default().trim()
        ))),
    }
}
