//! The bytes a receiver sends: observation epochs, and ephemerides when they are due.
//!
//! RTCM 3 has whole ephemerides, all of them every 30 s and a satellite's own when it rises; UBX has
//! the subframes and pages of the navigation messages, each when its last bit was received.

use anyhow::{Result, bail};
use surefix_core::gnss::klobuchar::KlobucharParameters;
use surefix_core::gnss::{Ephemeris, Satellite, System};
use surefix_core::ingest::encode_klobuchar;
use surefix_core::time::{GpsTime, NS_PER_S};

use super::atmosphere::Ionosphere;
use super::receiver::Epoch;
use super::signal_path::{Channel, channels, channels_of_ubx};
use super::sky::{self, Sky, issue_at};
use crate::broadcast_encode::sent_between;
use crate::rtcm_encode::{encode_ephemeris, encode_epoch, encode_station};
use crate::ubx_encode;

/// Ephemerides are repeated this often, s; a satellite's own also when it rises or is updated.
const EPHEMERIS_INTERVAL_S: i64 = 30;
/// A navigation message has its next ephemeris this long before receivers turn to it, s: so it is
/// received whole, with 30 s for a cycle.
const MESSAGE_AHEAD_S: i64 = 120;
/// Labels of a u-blox receiver stand this far from whole seconds, ns; it moves them by milliseconds
/// to follow its clock.
const UBX_LABEL_OFFSET_NS: i64 = -2_000_000;

/// What the receiver writes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// receiver.rtcm3: MSM7, ephemerides 1019, 1042, 1045, 1046
    #[default]
    Rtcm3,
    /// receiver.ubx, as from a u-blox receiver: RXM-RAWX, and RXM-SFRBX with navigation messages: GPS
    /// gives positions after 20 s, the ionosphere comes once in 12.5 minutes
    Ubx,
}

impl Format {
    /// Name of the file.
    pub fn file(self) -> &'static str {
        match self {
            Self::Rtcm3 => "receiver.rtcm3",
            Self::Ubx => "receiver.ubx",
        }
    }

    /// What is in it.
    pub fn content(self) -> &'static str {
        match self {
            Self::Rtcm3 => "RTCM 3: MSM7, 1019, 1042, 1045, 1046, 1006",
            Self::Ubx => "UBX: RXM-RAWX, RXM-SFRBX of LNAV, I/NAV, D1, D2",
        }
    }

    /// How far the labels of epochs stand from whole seconds, ns.
    pub fn label_offset_ns(self) -> i64 {
        match self {
            Self::Rtcm3 => 0,
            Self::Ubx => UBX_LABEL_OFFSET_NS,
        }
    }

    /// The signals such a receiver tracks.
    pub fn channels(self, system: System, dual_frequency: bool) -> Vec<Channel> {
        match self {
            Self::Rtcm3 => channels(system, dual_frequency),
            Self::Ubx => channels_of_ubx(system, dual_frequency),
        }
    }
}

/// A receiver's output while it grows.
pub struct Stream {
    /// What was sent.
    pub bytes: Vec<u8>,
    ionosphere: Ionosphere,
    encoder: Encoder,
}

enum Encoder {
    Rtcm3(Rtcm3),
    Ubx(Ubx),
}

impl Stream {
    /// Nothing sent yet. A `fixed` antenna sends its position in RTCM 3.
    ///
    /// UBX has the navigation messages of the simulated sky.
    pub fn new(format: Format, ionosphere: Ionosphere, fixed: bool) -> Self {
        let encoder = match format {
            Format::Rtcm3 => Encoder::Rtcm3(Rtcm3 {
                fixed,
                start: None,
                sent: Vec::new(),
            }),
            Format::Ubx => Encoder::Ubx(Ubx {
                sky: Sky::new(),
                last: None,
                issues: Vec::new(),
            }),
        };
        Self {
            bytes: Vec::new(),
            ionosphere,
            encoder,
        }
    }

    /// Sends an epoch, and before it what is due.
    pub fn push(&mut self, epoch: &Epoch) -> Result<()> {
        let parameters = self.ionosphere.parameters();
        match &mut self.encoder {
            Encoder::Rtcm3(encoder) => encoder.push(&mut self.bytes, epoch, parameters),
            Encoder::Ubx(encoder) => encoder.push(&mut self.bytes, epoch, parameters),
        }
    }
}

/// How long a satellite of an epoch has been tracked, ms.
fn lock_ms(epoch: &Epoch, satellite: Satellite) -> u64 {
    let place = epoch
        .observations
        .satellites
        .iter()
        .position(|s| s.satellite == satellite);
    place
        .and_then(|k| epoch.lock_ms.get(k))
        .copied()
        .unwrap_or(0)
}

struct Rtcm3 {
    fixed: bool,
    start: Option<GpsTime>,
    sent: Vec<(Satellite, GpsTime)>,
}

impl Rtcm3 {
    fn push(
        &mut self,
        bytes: &mut Vec<u8>,
        epoch: &Epoch,
        parameters: Option<KlobucharParameters>,
    ) -> Result<()> {
        let time = epoch.observations.time;
        let start = *self.start.get_or_insert(time);
        let repeat = time.ns() - start.ns();
        let due = repeat % (EPHEMERIS_INTERVAL_S * NS_PER_S) == 0;
        if let Some(parameters) = parameters.filter(|_| due) {
            bytes.extend(klobuchar_frame(&parameters)?);
        }
        if due && self.fixed {
            let station = epoch.antenna.position_e_m;
            bytes.extend(encode_station(station.into())?);
        }
        send_ephemerides(bytes, epoch, due, &mut self.sent)?;
        bytes.extend(encode_epoch(&epoch.observations, |satellite| {
            lock_ms(epoch, satellite)
        })?);
        Ok(())
    }
}

struct Ubx {
    sky: Sky,
    /// Time of the epoch before.
    last: Option<GpsTime>,
    /// Last ephemeris of each satellite, and its number.
    issues: Vec<(Satellite, i64, Ephemeris)>,
}

impl Ubx {
    fn push(
        &mut self,
        bytes: &mut Vec<u8>,
        epoch: &Epoch,
        parameters: Option<KlobucharParameters>,
    ) -> Result<()> {
        let time = epoch.observations.time;
        let last = self.last.replace(time).unwrap_or(time);
        for (channel, observed) in epoch.observations.satellites.iter().enumerate() {
            let satellite = observed.satellite;
            let lock_ns = lock_ms(epoch, satellite) as i64 * 1_000_000;
            let sent = sent_between(
                satellite,
                ubx_encode::sent_by(last),
                ubx_encode::sent_by(time),
                parameters.as_ref(),
                |cycle| self.ephemeris(satellite, cycle),
            )?;
            // Only what was received from its first bit on.
            let tracked = ubx_encode::sent_by(time.plus_ns(-lock_ns));
            for message in sent.iter().filter(|sent| sent.start >= tracked) {
                bytes.extend(ubx_encode::sfrbx(satellite, channel as u8, &message.words)?);
            }
        }
        bytes.extend(ubx_encode::rawx(&epoch.observations, |satellite| {
            lock_ms(epoch, satellite)
        })?);
        Ok(())
    }

    /// What a satellite of the sky broadcasts in the cycle that begins at an instant.
    fn ephemeris(&mut self, satellite: Satellite, cycle: GpsTime) -> Result<Ephemeris> {
        let ahead = cycle.plus_ns(MESSAGE_AHEAD_S * NS_PER_S);
        let issue = issue_at(satellite.system(), ahead);
        let known = self.issues.iter().position(|(s, _, _)| *s == satellite);
        if let Some((_, _, ephemeris)) = known
            .and_then(|k| self.issues.get(k))
            .filter(|(_, number, _)| *number == issue)
        {
            return Ok(*ephemeris);
        }
        let mut slots = self.sky.slots().iter();
        let Some(slot) = slots.find(|slot| slot.satellite == satellite) else {
            bail!("{satellite} is not in the simulated sky");
        };
        let ephemeris = slot.broadcast(issue);
        if let Some(k) = known {
            self.issues.swap_remove(k);
        }
        self.issues.push((satellite, issue, ephemeris));
        Ok(ephemeris)
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
