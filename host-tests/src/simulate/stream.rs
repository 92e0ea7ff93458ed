//! The bytes a receiver sends: observation epochs, and ephemerides when they are due.

use anyhow::{Result, bail};
use surefix_core::gnss::klobuchar::KlobucharParameters;
use surefix_core::gnss::{Satellite, System};
use surefix_core::ingest::encode_klobuchar;
use surefix_core::time::{GpsTime, NS_PER_S};

use super::atmosphere::Ionosphere;
use super::receiver::Epoch;
use super::sky;
use crate::rtcm_encode::{encode_ephemeris, encode_epoch, encode_station};

/// Ephemerides are repeated this often, s; a satellite's own also when it rises or is updated.
const EPHEMERIS_INTERVAL_S: i64 = 30;

/// A receiver's output while it grows.
pub struct Stream {
    /// What was sent.
    pub bytes: Vec<u8>,
    ionosphere: Ionosphere,
    fixed: bool,
    start: Option<GpsTime>,
    sent: Vec<(Satellite, GpsTime)>,
}

impl Stream {
    /// Nothing sent yet. A `fixed` antenna sends its position.
    pub fn new(ionosphere: Ionosphere, fixed: bool) -> Self {
        Self {
            bytes: Vec::new(),
            ionosphere,
            fixed,
            start: None,
            sent: Vec::new(),
        }
    }

    /// Sends an epoch, and before it what is due.
    pub fn push(&mut self, epoch: &Epoch) -> Result<()> {
        let time = epoch.observations.time;
        let start = *self.start.get_or_insert(time);
        let repeat = time.ns() - start.ns();
        let due = repeat % (EPHEMERIS_INTERVAL_S * NS_PER_S) == 0;
        if let Some(parameters) = self.ionosphere.parameters().filter(|_| due) {
            self.bytes.extend(klobuchar_frame(&parameters)?);
        }
        if due && self.fixed {
            let station = epoch.antenna.position_e_m;
            self.bytes.extend(encode_station(station.into())?);
        }
        send_ephemerides(&mut self.bytes, epoch, due, &mut self.sent)?;
        self.bytes
            .extend(encode_epoch(&epoch.observations, |satellite| {
                let place = epoch
                    .observations
                    .satellites
                    .iter()
                    .position(|s| s.satellite == satellite);
                place
                    .and_then(|k| epoch.lock_ms.get(k))
                    .copied()
                    .unwrap_or(0)
            })?);
        Ok(())
    }
}

/// Ionosphere parameters in surefix's own frame.
fn klobuchar_frame(parameters: &KlobucharParameters) -> Result<Vec<u8>> {
    let mut frame = [0; 256];
    match encode_klobuchar(parameters, &mut frame) {
        Ok(length) => Ok(frame[..length].to_vec()),
        Err(_) => bail!("the ionosphere parameters do not fit a frame of 256 bytes"),
    }
}

/// Sends the ephemerides of tracked satellites: all when `due`, otherwise only those not sent yet.
fn send_ephemerides(
    bytes: &mut Vec<u8>,
    epoch: &Epoch,
    due: bool,
    sent: &mut Vec<(Satellite, GpsTime)>,
) -> Result<()> {
    for ephemeris in &epoch.ephemerides {
        let key = (ephemeris.satellite, ephemeris.toe);
        if !due && sent.contains(&key) {
            continue;
        }
        bytes.extend(encode_ephemeris(ephemeris)?);
        if ephemeris.satellite.system() == System::Galileo {
            bytes.extend(encode_ephemeris(&sky::galileo_fnav(ephemeris))?);
        }
        if !sent.contains(&key) {
            sent.push(key);
        }
    }
    Ok(())
}
