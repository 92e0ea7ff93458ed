//! RTCM 3 messages: multiple signal messages, ephemerides, station positions.
//!
//! [`Message::parse`] is the view: it checks the length once. What it gives out holds only legal
//! content; a field outside its range refuses the message. Layouts: [RTCM-3], tables 3.5-11 (1005,
//! 1006), 3.5-21 (1019), 3.5-78 to 3.5-100 (MSM), and the tables of 1042, 1045 and 1046.

pub mod ephemeris;
pub mod header;
pub mod msm;
pub mod signals;
pub mod station;

use super::bits::Bits;

pub use ephemeris::{BroadcastEphemeris, Source};
pub use header::MsmHeader;
pub use msm::{Cell, Msm};
pub use station::StationPosition;

/// Constellations that have multiple signal messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Constellation {
    /// GPS, 1071 to 1077.
    Gps,
    /// GLONASS, 1081 to 1087.
    Glonass,
    /// Galileo, 1091 to 1097.
    Galileo,
    /// SBAS, 1101 to 1107.
    Sbas,
    /// QZSS, 1111 to 1117.
    Qzss,
    /// BDS, 1121 to 1127.
    Bds,
    /// NavIC, 1131 to 1137.
    Navic,
}

/// Why a message of a right frame is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ContentError {
    /// No message number.
    Empty,
    /// Shorter than what it announces.
    Truncated {
        /// Message number.
        number: u16,
    },
    /// Masks that announce more than 64 cells. [RTCM-3] 3.5.16.1 (DF396)
    TooManyCells {
        /// Satellites announced.
        satellites: u32,
        /// Signals announced.
        signals: u32,
    },
    /// A field outside its range.
    IllegalValue {
        /// Message number.
        number: u16,
        /// The value found.
        value: u32,
    },
}

/// One message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Message<'a> {
    /// MSM4, 5, 6 or 7 of GPS, Galileo or BDS.
    Msm(Msm<'a>),
    /// Another MSM: its header tells whether the epoch goes on.
    MsmHeader(MsmHeader),
    /// 1019, 1042, 1045, 1046.
    Ephemeris(BroadcastEphemeris),
    /// 1005, 1006.
    Station(StationPosition),
    /// A message of the standard that is not used here.
    Unsupported {
        /// Message number.
        number: u16,
    },
    /// A number the standard does not assign.
    Unknown {
        /// Message number.
        number: u16,
    },
}

impl<'a> Message<'a> {
    /// The message in the content of a frame whose checksum is right.
    pub fn parse(content: &'a [u8]) -> Result<Self, ContentError> {
        let bits = Bits::new(content);
        let number = bits.unsigned(0, 12).ok_or(ContentError::Empty)? as u16;
        if let Some((constellation, variant)) = header::msm_kind(number) {
            let header = MsmHeader::parse(bits, number, constellation, variant)?;
            let is_used = matches!(
                constellation,
                Constellation::Gps | Constellation::Galileo | Constellation::Bds
            ) && variant >= 4;
            return if is_used {
                Msm::parse(bits, header).map(Self::Msm)
            } else {
                Ok(Self::MsmHeader(header))
            };
        }
        match number {
            1005 | 1006 => StationPosition::parse(bits)
                .map(Self::Station)
                .ok_or(ContentError::Truncated { number }),
            1019 | 1042 | 1045 | 1046 => {
                BroadcastEphemeris::parse(bits, number).map(Self::Ephemeris)
            }
            // [RTCM-3] table 3.4-1 and amendments: observations, stations, network, GLONASS bias,
            // transformations, ephemerides, state space, integrity, and proprietary messages.
            1001..=1068 | 1070..=1137 | 1230 | 1240..=1270 | 1300..=1305 | 4001..=4095 => {
                Ok(Self::Unsupported { number })
            }
            _ => Ok(Self::Unknown { number }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_told_apart() {
        let of = |number: u16| [(number >> 4) as u8, (number << 4) as u8];
        assert_eq!(Message::parse(&[]), Err(ContentError::Empty));
        assert_eq!(Message::parse(&[0xFF]), Err(ContentError::Empty));
        assert_eq!(
            Message::parse(&of(1004)),
            Ok(Message::Unsupported { number: 1004 })
        );
        assert_eq!(
            Message::parse(&of(1069)),
            Ok(Message::Unknown { number: 1069 })
        );
        for number in [1005, 1019, 1042, 1045, 1046, 1077, 1081] {
            assert_eq!(
                Message::parse(&of(number)),
                Err(ContentError::Truncated { number })
            );
        }
    }
}
