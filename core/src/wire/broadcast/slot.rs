//! What was kept of one satellite's message.

use core::ops::Range;

use super::LONGEST_SILENCE_S;
use crate::time::SECONDS_PER_WEEK;

/// Bytes for the parts of a message: ten pages of nine bytes (D2); 3 × 24 (LNAV, D1), 5 × 16 (I/NAV).
const PARTS_BYTES: usize = 90;

/// Which message a slot is for; a satellite sends one of D1 and D2, but a slot never takes both.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Lnav,
    Inav,
    D1,
    D2,
}

impl Kind {
    /// Bytes of a part.
    const fn part_len(self) -> usize {
        match self {
            Self::Lnav | Self::D1 => 24,
            Self::Inav => 16,
            Self::D2 => 9,
        }
    }

    /// A bit for each part an ephemeris needs.
    pub(super) const fn all_parts(self) -> u16 {
        match self {
            Self::Lnav | Self::D1 => 0b111,
            Self::Inav => 0b1_1111,
            // Page 2 is the ionosphere.
            Self::D2 => 0b11_1111_1101,
        }
    }
}

/// The parts of one satellite's message.
#[derive(Clone, Debug)]
pub(super) struct Slot {
    /// Whose; `None` when the slot is free.
    pub(super) owner: Option<(Kind, u8)>,
    /// When it was last heard, on the collector's count of subframes.
    pub(super) heard: u32,
    /// Time of week that the satellite told last, s; of BDS the beginning of the pass.
    pub(super) time_s: Option<u32>,
    /// Issue of the last of Galileo's words 1 to 4 since the last word 5.
    pub(super) issue_since: Option<u16>,
    /// Issue the kept word 5 was sent with.
    pub(super) issue_of_word_5: u16,
    /// Parts that were heard, one bit each.
    pub(super) kept: u16,
    /// Parts that were heard twice alike.
    pub(super) confirmed: u16,
    /// Parts heard in the pass that began at `time_s`.
    pub(super) in_pass: u16,
    /// The alert flag of GPS.
    pub(super) is_alert: bool,
    parts: [u8; PARTS_BYTES],
}

impl Slot {
    pub(super) const FREE: Self = Self {
        owner: None,
        heard: 0,
        time_s: None,
        issue_since: None,
        issue_of_word_5: 0,
        kept: 0,
        confirmed: 0,
        in_pass: 0,
        is_alert: false,
        parts: [0; PARTS_BYTES],
    };

    /// Makes the slot that of a satellite of which nothing was heard. The parts stay, nobody reads them.
    pub(super) fn begin(&mut self, kind: Kind, satellite: u8) {
        self.owner = Some((kind, satellite));
        self.forget();
    }

    /// Forgets every part.
    pub(super) fn forget(&mut self) {
        self.time_s = None;
        self.issue_since = None;
        self.kept = 0;
        self.confirmed = 0;
        self.in_pass = 0;
        self.is_alert = false;
    }

    /// Notes the time a satellite tells; after a jump of hours issues may have come back.
    pub(super) fn set_time(&mut self, time_s: u32) {
        if self.time_s.is_some_and(|before_s| {
            let apart_s = i64::from(time_s.abs_diff(before_s));
            let around_s = SECONDS_PER_WEEK - apart_s;
            let least_s = if apart_s < around_s {
                apart_s
            } else {
                around_s
            };
            least_s > i64::from(LONGEST_SILENCE_S)
        }) {
            self.forget();
        }
        self.time_s = Some(time_s);
    }

    /// Notes that a part was heard in the pass that began at `begin_s`, and which were heard before.
    pub(super) fn hear_in_pass(&mut self, index: u32, begin_s: u32) {
        if self.time_s != Some(begin_s) {
            self.time_s = Some(begin_s);
            self.in_pass = 0;
        }
        self.in_pass |= bit(index);
    }

    /// Whether a part was heard twice alike.
    pub(super) const fn is_confirmed(&self, index: u32) -> bool {
        self.confirmed & bit(index) != 0
    }

    /// Forgets one part.
    pub(super) const fn drop_part(&mut self, index: u32) {
        self.kept &= !bit(index);
    }

    /// Where the bytes of part `index` are, counted from 0; nowhere for one that the message does not have.
    fn range(&self, index: u32) -> Range<usize> {
        let len = self.owner.map_or(0, |(kind, _)| kind.part_len());
        let begin = len.saturating_mul(index as usize);
        begin..begin.saturating_add(len)
    }

    /// The bytes of part `index`; empty for one that the message does not have.
    pub(super) fn part(&self, index: u32) -> &[u8] {
        self.parts.get(self.range(index)).unwrap_or(&[])
    }

    /// Keeps a part and tells whether it is another than before.
    pub(super) fn keep(&mut self, index: u32, bytes: &[u8]) -> bool {
        let range = self.range(index);
        let Some(part) = self.parts.get_mut(range) else {
            return false;
        };
        let is_known = self.kept & bit(index) != 0 && part.iter().eq(bytes.iter());
        if is_known {
            self.confirmed |= bit(index);
        } else {
            part.iter_mut()
                .zip(bytes)
                .for_each(|(to, byte)| *to = *byte);
            self.confirmed &= !bit(index);
        }
        self.kept |= bit(index);
        !is_known
    }
}

/// The bit of a part.
const fn bit(index: u32) -> u16 {
    1 << (index & 15)
}
