//! What a stream says was sent.

use std::collections::BTreeSet;

use anyhow::{Result, bail};
use surefix_core::gnss::{Ephemeris, SignalObservation, System};
use surefix_core::ingest::{Event, Ingest};
use surefix_core::time::GpsTime;
use surefix_core::wire::Counters;
use ublox::proto27::{PacketRef, Proto27};
use ublox::rxm_rawx::TrkStatFlags;
use ublox::{ParserBuilder, UbxPacket};

/// One thing that was sent. Times are without their week, which a damaged stream may not tell.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Sent {
    /// A pseudorange and a range rate of a signal.
    Observation {
        /// Time of week, ns.
        tow_ns: i64,
        /// System and number.
        satellite: (u8, u8),
        /// Carrier, Hz.
        frequency_hz: u64,
        /// Bits of the number in m.
        pseudorange: Option<u64>,
        /// Range rate in 0.1 mm/s.
        range_rate: Option<i64>,
        /// Bits of the number in dB-Hz.
        cn0: Option<u32>,
    },
    /// An ephemeris.
    Ephemeris {
        /// System and number.
        satellite: (u8, u8),
        /// Everything else that does not depend on the week, as text.
        content: String,
    },
}

fn observation(time: GpsTime, satellite: (System, u8), o: &SignalObservation) -> Sent {
    let (system, prn) = satellite;
    Sent::Observation {
        tow_ns: time.tow_ns(),
        satellite: (system as u8, prn),
        frequency_hz: o.signal.frequency_hz(system).unwrap_or(0.0) as u64,
        pseudorange: o.pseudorange_m.map(f64::to_bits),
        range_rate: o.range_rate_mps.map(|rate| (rate * 1e4).round() as i64),
        cn0: o.cn0_dbhz.map(f32::to_bits),
    }
}

fn ephemeris(e: &Ephemeris) -> Sent {
    let origin = GpsTime::from_ns(0);
    let timeless = Ephemeris {
        toe: origin.plus_ns(e.toe.tow_ns()),
        toc: origin.plus_ns(e.toc.tow_ns()),
        ..*e
    };
    Sent::Ephemeris {
        satellite: (e.satellite.system() as u8, e.satellite.prn()),
        content: format!("{timeless:?}"),
    }
}

/// Notes what an event says was sent.
pub fn note(event: &Event, ingest: &Ingest, sent: &mut Vec<Sent>) {
    match event {
        Event::EpochReady => {
            let epoch = ingest.epoch();
            for satellite in &epoch.satellites {
                let name = (satellite.satellite.system(), satellite.satellite.prn());
                for signal in &satellite.signals {
                    sent.push(observation(epoch.time, name, signal));
                }
            }
        }
        Event::Ephemeris(e) => sent.push(ephemeris(e)),
        _ => {}
    }
}

impl Sent {
    /// Numbers that no domain type may hold.
    ///
    /// # Errors
    /// Names the number.
    pub fn check_legal(&self) -> Result<()> {
        match self {
            Self::Observation {
                pseudorange,
                frequency_hz,
                ..
            } => {
                let range = pseudorange.map_or(1.0, f64::from_bits);
                if !(range > -1e10 && range < 1e10) || *frequency_hz == 0 {
                    bail!("a pseudorange of {range} m");
                }
            }
            Self::Ephemeris { content, .. } => {
                if content.contains("NaN") || content.contains("inf") {
                    bail!("an ephemeris with a number that is none: {content}");
                }
            }
        }
        Ok(())
    }

    /// Whether it is an observation of BDS.
    pub fn is_of_bds(&self) -> bool {
        matches!(self, Self::Observation { satellite: (system, _), .. } if *system == System::Bds as u8)
    }

    /// Whether it can only be from RXM-RAWX, in a stream with these counts.
    pub fn is_of_rawx(&self, counters: &Counters) -> bool {
        matches!(self, Self::Observation { .. })
            && counters.msm_used == 0
            && counters.native_frames == 0
    }
}

/// What a stream says was sent, to look up.
#[derive(Clone, Debug, Default)]
pub struct Known(BTreeSet<Sent>);

impl Known {
    /// By core's own decoders: of an undamaged stream.
    pub fn of(stream: &[u8]) -> Self {
        Self(super::decode(stream, &[stream.len()]).map_or_else(
            |_| BTreeSet::new(),
            |decoded| decoded.sent.into_iter().collect(),
        ))
    }

    /// What the `ublox` crate reads in every RXM-RAWX whose sum is right, wherever it begins.
    pub fn of_frames_with_a_right_sum(stream: &[u8]) -> Self {
        let mut sent = BTreeSet::new();
        for start in 0..stream.len() {
            let Some([0xB5, 0x62, 0x02, 0x15, low, high]) = stream.get(start..start + 6) else {
                continue;
            };
            let end = start + 8 + usize::from(u16::from_le_bytes([*low, *high]));
            if let Some(frame) = stream.get(start..end) {
                rawx(frame, &mut sent);
            }
        }
        Self(sent)
    }

    /// Adds what another stream says.
    pub fn extend(&mut self, other: Self) {
        self.0.extend(other.0);
    }

    /// Whether it was sent.
    pub fn contains(&self, sent: &Sent) -> bool {
        self.0.contains(sent)
    }

    /// The observations.
    pub fn observations(&self) -> impl Iterator<Item = &Sent> {
        self.0
            .iter()
            .filter(|sent| matches!(sent, Sent::Observation { .. }))
    }

    /// How many observations and ephemerides there are.
    pub fn counts(&self) -> [usize; 2] {
        let ephemerides = self
            .0
            .iter()
            .filter(|sent| matches!(sent, Sent::Ephemeris { .. }))
            .count();
        [self.0.len() - ephemerides, ephemerides]
    }
}

/// Carrier of a signal by gnssId and sigId. [UBX-F9-HPG] 1.5.4
fn carrier(gnss_id: u8, sig_id: u8) -> Option<(System, u64)> {
    Some(match (gnss_id, sig_id) {
        (0, 0) => (System::Gps, 1_575_420_000),
        (0, 3 | 4) => (System::Gps, 1_227_600_000),
        (0, 6 | 7) => (System::Gps, 1_176_450_000),
        (2, 0 | 1) => (System::Galileo, 1_575_420_000),
        (2, 3 | 4) => (System::Galileo, 1_176_450_000),
        (2, 5 | 6) => (System::Galileo, 1_207_140_000),
        (2, 8..=10) => (System::Galileo, 1_278_750_000),
        (3, 0 | 1) => (System::Bds, 1_561_098_000),
        (3, 2 | 3) => (System::Bds, 1_207_140_000),
        (3, 4 | 10) => (System::Bds, 1_268_520_000),
        (3, 5 | 6) => (System::Bds, 1_575_420_000),
        (3, 7 | 8) => (System::Bds, 1_176_450_000),
        _ => return None,
    })
}

/// The `ublox` crate, version 0.10, reads sigId as a reserved byte.
fn rawx(frame: &[u8], sent: &mut BTreeSet<Sent>) {
    let mut parser = ParserBuilder::new()
        .with_protocol::<Proto27>()
        .with_vec_buffer();
    let mut packets = parser.consume_ubx(frame);
    let Some(Ok(UbxPacket::Proto27(PacketRef::RxmRawx(message)))) = packets.next() else {
        return;
    };
    let tow_ns = (message.rcv_tow() * 1e9).round_ties_even() as i64;
    let time = GpsTime::from_week_tow_ns(message.week().into(), tow_ns);
    for m in message.measurements() {
        let sig_id = if message.version() == 0 {
            0
        } else {
            m.reserved2()
        };
        let Some((system, frequency_hz)) = carrier(m.gnss_id(), sig_id) else {
            continue;
        };
        if !m.trk_stat().contains(TrkStatFlags::PR_VALID) {
            continue;
        }
        let wavelength_m = 299_792_458.0 / frequency_hz as f64;
        let rate_mps = -f64::from(m.do_mes()) * wavelength_m;
        sent.insert(Sent::Observation {
            tow_ns: time.tow_ns(),
            satellite: (system as u8, m.sv_id()),
            frequency_hz,
            pseudorange: Some(m.pr_mes().to_bits()),
            range_rate: (rate_mps.abs() <= 1e6).then(|| (rate_mps * 1e4).round() as i64),
            cn0: (1..=100)
                .contains(&m.cno())
                .then(|| f32::from(m.cno()).to_bits()),
        });
    }
}
