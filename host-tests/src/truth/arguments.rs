//! Where the truth comes from, as it is said on the command line.

use std::path::PathBuf;

use anyhow::{Result, bail};

use super::Truth;
use crate::replay::TruthChoice;
use crate::static_imu::triple;

/// The true track or position of the antenna.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct TruthArguments {
    /// True track: surefix truth.csv, Spirent position/velocity/attitude CSV, RTKLIB .pos,
    /// or UBX with NAV-PVT of resolved carrier-phase ambiguities. Without
    /// this, --at and --at-llh the position that the recording states for itself is the truth, if its
    /// antenna was fixed: not with inertial samples, and not when more than a quarter of the positions
    /// lie farther than 10 m from it
    #[arg(long, value_name = "FILE", conflicts_with_all = ["at", "at_llh"])]
    pub truth: Option<PathBuf>,
    /// True position of a fixed antenna, ECEF, m
    #[arg(
        long,
        value_name = "X,Y,Z",
        allow_hyphen_values = true,
        conflicts_with = "at_llh"
    )]
    pub at: Option<String>,
    /// True position of a fixed antenna, degrees and metres above WGS-84
    #[arg(long, value_name = "LAT,LON,H", allow_hyphen_values = true)]
    pub at_llh: Option<String>,
}

impl TruthArguments {
    /// What they choose.
    ///
    /// # Errors
    /// When a file or a position cannot be read.
    pub fn choice(&self) -> Result<TruthChoice> {
        Ok(match (&self.truth, &self.at, &self.at_llh) {
            (Some(path), _, _) => TruthChoice::Given(Truth::read(path)?),
            (_, Some(text), _) => TruthChoice::Given(Truth::fixed(triple("--at", text)?, "--at")),
            (_, _, Some(text)) => {
                let [lat, lon, height] = triple("--at-llh", text)?;
                if lat.abs() > 90.0 || lon.abs() > 360.0 {
                    bail!("--at-llh \"{text}\" is not latitude, longitude in degrees and height");
                }
                TruthChoice::Given(Truth::fixed_llh([lat, lon, height], "--at-llh"))
            }
            (None, None, None) => TruthChoice::FromRecording,
        })
    }
}
