//! Ephemerides as satellites broadcast them: the value, and how it is collected from their own words.
//!
//! In: the words of one subframe or page, as u-blox receivers give them in RXM-SFRBX ([`Subframe`]).
//! Out: an ephemeris when the last part of one has come, the ionosphere when it is sent.
//!
//! | gnssId | sigId | message | checked | parts |
//! |---|---|---|---|---|
//! | 0 GPS | 0 L1 C/A | LNAV | parity of every word | subframes 1 to 3; 4, page 18 |
//! | 2 Galileo | 1 E1-B, 5 E5b-I | I/NAV | CRC-24Q of every page | words 1 to 5 |
//! | 3 BDS | 0 B1I, 2 B2I, 4 B3I | D1 | BCH of every word, heard twice | subframes 1 to 3 |
//! | 3 BDS | 1 B1I, 3 B2I, 10 B3I | D2 | BCH of every word, heard twice | subframe 1, pages 1 to 10 |
//!
//! Parts of different issues are never put together:
//!
//! - GPS: the low byte of IODC and both IODE are equal. [IS-GPS-200] 20.3.4.4
//! - Galileo: IODnav of words 1 to 4 is equal. Word 5 has none; it counts for the issue of the word 1
//!   to 4 heard last before it, and for none when there was none since the last word 5. Both signals
//!   send the same message in another order, and their words are put together.
//! - BDS: AODE and AODC do not change with every message, so the parts must be of one pass, by their times:
//!   6 s from subframe to subframe, 3 s from page to page. And each must have been heard twice alike
//!   (in two passes or on two signals): BCH does not detect two errors in a word. That
//!   costs a pass of 30 s when a satellite rises or changes its message.
//!
//! Issues come back after hours: a satellite of GPS or Galileo whose times jump by more than
//! [`LONGEST_SILENCE_S`] begins anew.
//!
//! An ephemeris is given as soon as it is complete, and again with every repetition of its last part
//! (subframe 3, word 5, page 10), as RTCM 3 gives it: whoever lost it, or could not use it yet because the
//! week was not known, gets it again within 30 s, and nothing has to be remembered here.

pub mod ephemeris;
pub(in crate::wire) mod fields;

mod d1d2;
mod inav;
mod lnav;
mod slot;
#[cfg(test)]
mod tests;

use crate::time::SECONDS_PER_WEEK;
use d1d2::D1D2;
use fields::Fields;
use inav::Inav;
use lnav::Lnav;
use slot::{Kind, Slot};

pub use ephemeris::{BroadcastEphemeris, BroadcastKlobuchar, Source};

/// Satellites whose messages are collected at a time; the one heard least recently gives way.
///
/// More than are above any horizon of three constellations.
pub const MAX_COLLECTED: usize = 48;

/// A satellite of GPS or Galileo that was silent for longer begins anew, s.
///
/// Far below the six hours in which no issue comes back. [IS-GPS-200] 20.3.4.4
pub const LONGEST_SILENCE_S: u32 = 3600;

/// Words of one subframe or page: the content of RXM-SFRBX. [UBX-F9] 5.15.6
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Subframe<'a> {
    /// Constellation, `gnssId`.
    pub gnss_id: u8,
    /// Satellite in its constellation, `svId`.
    pub sv_id: u8,
    /// Signal, `sigId`.
    pub sig_id: u8,
    /// `dwrd`: words of four bytes, least significant byte first.
    pub words: &'a [u8],
}

impl Subframe<'_> {
    fn dwords(&self) -> impl Iterator<Item = u32> {
        let (words, _) = self.words.as_chunks::<4>();
        words.iter().map(|word| u32::from_le_bytes(*word))
    }
}

/// Why a subframe was not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SubframeError {
    /// Another constellation, or a signal with another message.
    Unsupported,
    /// A satellite number that the constellation does not have, or another one than the message names.
    Satellite,
    /// Not as many words as the message has.
    Length,
    /// Parity of a word of GPS or code of a word of BDS.
    Parity,
    /// CRC of a page of Galileo.
    Checksum,
    /// No preamble; of Galileo: the halves of a page are not in order.
    Preamble,
    /// A number of a subframe or page that does not exist.
    Number,
    /// A time beyond the week.
    Time,
    /// The complete ephemeris has a value that none may have.
    IllegalValue,
}

/// What a subframe completed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Collected {
    /// An ephemeris, new or repeated.
    pub ephemeris: Option<BroadcastEphemeris>,
    /// Parameters of the ionosphere, new or repeated.
    pub klobuchar: Option<BroadcastKlobuchar>,
}

impl Collected {
    /// Nothing was completed.
    pub const NOTHING: Self = Self {
        ephemeris: None,
        klobuchar: None,
    };
}

/// Collects the parts of messages, satellite by satellite. 5.8 kB.
#[derive(Clone, Debug)]
pub struct Collector {
    slots: [Slot; MAX_COLLECTED],
    /// Subframes so far, modulo 2³².
    n_heard: u32,
}

const _: () = assert!(size_of::<Collector>() <= 5764);

impl Collector {
    /// Nothing collected.
    pub const EMPTY: Self = Self {
        slots: [const { Slot::FREE }; MAX_COLLECTED],
        n_heard: 0,
    };

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.slots.iter_mut().for_each(|slot| slot.owner = None);
    }

    /// Takes a subframe or page.
    ///
    /// # Errors
    /// [`SubframeError`]; what was collected before stays as it was, but for an ephemeris that is complete
    /// and [`SubframeError::IllegalValue`].
    pub fn take(&mut self, subframe: &Subframe<'_>) -> Result<Collected, SubframeError> {
        let (kind, n_satellites) = match (subframe.gnss_id, subframe.sig_id) {
            (0, 0) => (Kind::Lnav, 32),
            (2, 1 | 5) => (Kind::Inav, 36),
            (3, 0 | 2 | 4) => (Kind::D1, 63),
            (3, 1 | 3 | 10) => (Kind::D2, 63),
            _ => return Err(SubframeError::Unsupported),
        };
        if !(1..=n_satellites).contains(&subframe.sv_id) {
            return Err(SubframeError::Satellite);
        }
        self.n_heard = self.n_heard.wrapping_add(1);
        match kind {
            Kind::Lnav => self.take_lnav(subframe),
            Kind::Inav => self.take_inav(subframe),
            Kind::D1 | Kind::D2 => self.take_bds(subframe, kind),
        }
    }

    fn take_lnav(&mut self, subframe: &Subframe<'_>) -> Result<Collected, SubframeError> {
        let lnav = Lnav::parse(subframe)?;
        if lnav.number > 3 {
            let mut ephemeris = None;
            if let Some(slot) = self.known(Kind::Lnav, subframe.sv_id) {
                slot.set_time(lnav.tow_s);
                if slot.is_alert != lnav.is_alert {
                    // Told at once: half a minute would be longer than a time to alert.
                    slot.is_alert = lnav.is_alert;
                    if slot.kept == Kind::Lnav.all_parts() {
                        ephemeris = lnav::ephemeris(slot, subframe.sv_id);
                    }
                }
            }
            return give(ephemeris, lnav.klobuchar());
        }
        let Some(slot) = self.claim(Kind::Lnav, subframe.sv_id) else {
            return Ok(Collected::NOTHING);
        };
        slot.set_time(lnav.tow_s);
        let is_other_alert = slot.is_alert != lnav.is_alert;
        slot.is_alert = lnav.is_alert;
        let is_new = slot.keep(lnav.number - 1, &lnav.data) || is_other_alert;
        let is_due = slot.kept == Kind::Lnav.all_parts() && (is_new || lnav.number == 3);
        give(
            is_due
                .then(|| lnav::ephemeris(slot, subframe.sv_id))
                .flatten(),
            None,
        )
    }

    fn take_inav(&mut self, subframe: &Subframe<'_>) -> Result<Collected, SubframeError> {
        let Some(inav) = Inav::parse(subframe)? else {
            return Ok(Collected::NOTHING);
        };
        if inav
            .satellite()
            .is_some_and(|satellite| satellite != subframe.sv_id)
        {
            return Err(SubframeError::Satellite);
        }
        let slot = match inav.number {
            1..=5 => self.claim(Kind::Inav, subframe.sv_id),
            _ => self.known(Kind::Inav, subframe.sv_id),
        };
        let Some(slot) = slot else {
            return Ok(Collected::NOTHING);
        };
        if let Some(tow_s) = inav.tow_s {
            slot.set_time(tow_s);
        }
        let is_due = match inav.number {
            1..=4 => {
                slot.issue_since = inav.issue();
                slot.keep(inav.number - 1, &inav.data)
            }
            5 => {
                match slot.issue_since.take() {
                    Some(issue) => {
                        slot.issue_of_word_5 = issue;
                        slot.keep(4, &inav.data);
                    }
                    None => slot.drop_part(4),
                }
                true
            }
            _ => false,
        } && slot.kept == Kind::Inav.all_parts();
        give(
            is_due
                .then(|| inav::ephemeris(slot, subframe.sv_id))
                .flatten(),
            None,
        )
    }

    fn take_bds(
        &mut self,
        subframe: &Subframe<'_>,
        kind: Kind,
    ) -> Result<Collected, SubframeError> {
        let part = D1D2::parse(subframe)?;
        let (index, interval_s, page);
        let data: &[u8] = match (kind, part.number) {
            (Kind::D2, 1) => {
                let number;
                (number, page) = part.page()?;
                (index, interval_s) = (number - 1, 3);
                &page
            }
            (Kind::D1, 1..=3) => {
                (index, interval_s) = (part.number - 1, 6);
                &part.data
            }
            _ => return Ok(Collected::NOTHING),
        };
        let Some(slot) = self.claim(kind, subframe.sv_id) else {
            return Ok(Collected::NOTHING);
        };
        let week_s = SECONDS_PER_WEEK as u32;
        slot.hear_in_pass(index, (part.sow_s + week_s - index * interval_s) % week_s);
        slot.keep(index, data);

        let all = kind.all_parts();
        let is_due = slot.is_confirmed(index) && slot.in_pass & slot.confirmed & all == all;
        let klobuchar = match (kind, index) {
            (Kind::D1, 0) if slot.is_confirmed(0) => Some(d1d2::klobuchar_d1(slot)),
            (Kind::D2, 1) if slot.is_confirmed(1) => {
                return give(None, Some(d1d2::klobuchar_d2(slot)));
            }
            _ => None,
        };
        let ephemeris = match kind {
            Kind::D1 if is_due => d1d2::ephemeris_d1(slot, subframe.sv_id),
            Kind::D2 if is_due => d1d2::ephemeris_d2(slot, subframe.sv_id),
            _ => None,
        };
        give(ephemeris, klobuchar)
    }

    /// The slot of a satellite that has one.
    fn known(&mut self, kind: Kind, satellite: u8) -> Option<&mut Slot> {
        let n_heard = self.n_heard;
        let slot = self
            .slots
            .iter_mut()
            .find(|slot| slot.owner == Some((kind, satellite)))?;
        slot.heard = n_heard;
        Some(slot)
    }

    /// The slot of a satellite; without one a free slot, else the one heard least recently.
    fn claim(&mut self, kind: Kind, satellite: u8) -> Option<&mut Slot> {
        let (n_heard, owner) = (self.n_heard, Some((kind, satellite)));
        let slot = self.slots.iter_mut().max_by_key(|slot| {
            let age = u64::from(n_heard.wrapping_sub(slot.heard));
            match slot.owner {
                None => u64::MAX - 1,
                _ if slot.owner == owner => u64::MAX,
                Some(_) => age,
            }
        })?;
        if slot.owner != owner {
            slot.begin(kind, satellite);
        }
        slot.heard = n_heard;
        Some(slot)
    }
}

/// What was completed, unless it holds what none may hold.
fn give(
    ephemeris: Option<BroadcastEphemeris>,
    klobuchar: Option<BroadcastKlobuchar>,
) -> Result<Collected, SubframeError> {
    if ephemeris
        .as_ref()
        .is_some_and(|e| e.illegal_value().is_some())
    {
        return Err(SubframeError::IllegalValue);
    }
    Ok(Collected {
        ephemeris,
        klobuchar,
    })
}

/// A time of week.
fn check_time(time_s: u32) -> Result<u32, SubframeError> {
    if i64::from(time_s) < SECONDS_PER_WEEK {
        Ok(time_s)
    } else {
        Err(SubframeError::Time)
    }
}

/// α and β, eight bits each, with the scales that GPS and BDS share.
/// [IS-GPS-200] table 20-X, [BDS-SIS-ICD-B1I] 5.2.4.7
fn klobuchar(f: &mut Fields<'_>, source: Source) -> BroadcastKlobuchar {
    BroadcastKlobuchar {
        source,
        alpha: [30, 27, 24, 24].map(|exponent| f.scaled(8, exponent)),
        beta: [11, 14, 16, 16].map(|exponent| (f.signed(8) << exponent) as f64),
    }
}
