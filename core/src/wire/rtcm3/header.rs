//! The header of a multiple signal message. [RTCM-3] table 3.5-78

use super::{Constellation, ContentError};
use crate::wire::bits::{BitCursor, Bits};

/// Bits of the header before the cell mask.
const FIXED_LEN: usize = 169;
/// Most cells a message holds. [RTCM-3] DF396
pub const MAX_CELLS: u32 = 64;
/// Milliseconds in a week.
const MS_PER_WEEK: u32 = 604_800_000;

/// When a message says its epoch is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EpochTime {
    /// Milliseconds into the week of GPS time; Galileo and QZSS use it too.
    Gpst(u32),
    /// Milliseconds into the week of BDS time.
    Bdt(u32),
    /// GLONASS and NavIC count in other ways, and of SBAS some receivers write the time of day; not
    /// used.
    Other,
}

/// The header of a multiple signal message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MsmHeader {
    /// Message number.
    pub number: u16,
    /// Constellation of the satellites in it.
    pub constellation: Constellation,
    /// 1 to 7.
    pub variant: u8,
    /// Reference station. DF003
    pub station: u16,
    /// Time of the epoch.
    pub epoch: EpochTime,
    /// More messages of the same epoch follow. DF393
    pub more_follow: bool,
    /// Clock steering: 0 none, 1 steered, 2 unknown. DF411
    pub clock_steering: u8,
    /// Satellites, bit 63 for number 1. DF394
    pub satellites: u64,
    /// Signals, bit 31 for number 1. DF395
    pub signals: u32,
    /// Cells in use, row by row, bit 63 for the first signal of the first satellite. DF396
    pub cells: u64,
}

/// GPST − BDT, ms.
const GPST_MINUS_BDT_MS: u32 = 14_000;

/// Milliseconds into the BDT week. Receivers were seen that subtract 14 s from the GPST second and do
/// not return to the week before: the first 14 s of a GPS week then come as −14 s to 0 in 30 bits.
const fn in_bdt_week(epoch_ms: u32) -> u32 {
    let below_zero = (1 << 30) - epoch_ms;
    if below_zero <= GPST_MINUS_BDT_MS {
        MS_PER_WEEK - below_zero
    } else {
        epoch_ms
    }
}

/// Constellation and variant of an MSM's number, `None` for another message.
pub const fn msm_kind(number: u16) -> Option<(Constellation, u8)> {
    let variant = number % 10;
    if variant == 0 || variant > 7 {
        return None;
    }
    let constellation = match number / 10 {
        107 => Constellation::Gps,
        108 => Constellation::Glonass,
        109 => Constellation::Galileo,
        110 => Constellation::Sbas,
        111 => Constellation::Qzss,
        112 => Constellation::Bds,
        113 => Constellation::Navic,
        _ => return None,
    };
    Some((constellation, variant as u8))
}

impl MsmHeader {
    /// Reads the header of MSM `number`.
    pub fn parse(
        bits: Bits<'_>,
        number: u16,
        constellation: Constellation,
        variant: u8,
    ) -> Result<Self, ContentError> {
        let header = Self::fields(bits, number, constellation, variant)
            .ok_or(ContentError::Truncated { number })?;
        match header.epoch {
            EpochTime::Gpst(ms) | EpochTime::Bdt(ms) if ms >= MS_PER_WEEK => {
                Err(ContentError::IllegalValue { number, value: ms })
            }
            _ if header.cells_announced() > MAX_CELLS => Err(ContentError::TooManyCells {
                satellites: header.satellites.count_ones(),
                signals: header.signals.count_ones(),
            }),
            _ => Ok(Self {
                cells: header
                    .cell_mask(bits)
                    .ok_or(ContentError::Truncated { number })?,
                ..header
            }),
        }
    }

    fn fields(
        bits: Bits<'_>,
        number: u16,
        constellation: Constellation,
        variant: u8,
    ) -> Option<Self> {
        let mut cursor = BitCursor::new(bits, 12);
        let station = cursor.unsigned(12)? as u16;
        let epoch_ms = cursor.unsigned(30)? as u32;
        let more_follow = cursor.unsigned(1)? != 0;
        cursor.skip(3 + 7); // issue of data station, reserved
        let clock_steering = cursor.unsigned(2)? as u8;
        cursor.skip(2 + 1 + 3); // external clock, smoothing indicator and interval
        let satellites = cursor.unsigned(32)? << 32 | cursor.unsigned(32)?;
        let signals = cursor.unsigned(32)? as u32;
        let epoch = match constellation {
            Constellation::Gps | Constellation::Galileo | Constellation::Qzss => {
                EpochTime::Gpst(epoch_ms)
            }
            Constellation::Bds => EpochTime::Bdt(in_bdt_week(epoch_ms)),
            Constellation::Glonass | Constellation::Sbas | Constellation::Navic => EpochTime::Other,
        };
        Some(Self {
            number,
            constellation,
            variant,
            station,
            epoch,
            more_follow,
            clock_steering,
            satellites,
            signals,
            cells: 0,
        })
    }

    /// Width of the cell mask, bits.
    pub const fn cells_announced(&self) -> u32 {
        // At most 64 × 32.
        self.satellites.count_ones() * self.signals.count_ones()
    }

    /// The cell mask, its first bit highest.
    fn cell_mask(&self, bits: Bits<'_>) -> Option<u64> {
        let width = self.cells_announced();
        let first = if width > 32 { 32 } else { width };
        let mut mask = 0;
        if first > 0 {
            mask = bits.unsigned(FIXED_LEN, first)? << ((64 - first) & 63);
        }
        if width > 32 {
            mask |= bits.unsigned(FIXED_LEN + 32, width - 32)? << ((64 - width) & 63);
        }
        Some(mask)
    }

    /// Where the satellite data start, bit.
    pub const fn len_bits(&self) -> usize {
        FIXED_LEN + self.cells_announced() as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(satellites: u64, signals: u32, cells: &[u8]) -> Result<MsmHeader, ContentError> {
        // Fields by hand: 24 bits before the epoch, 30 bits of it, 19 bits up to the masks.
        let mut bits = std::string::String::new();
        bits += &std::format!("{:012b}{:012b}{:030b}", 1077, 5, 604_799_999);
        bits += "1";
        bits += &"0".repeat(10);
        bits += "01";
        bits += &"0".repeat(6);
        bits += &std::format!("{satellites:064b}{signals:032b}");
        for byte in cells {
            bits += &std::format!("{byte:08b}");
        }
        let bytes: std::vec::Vec<u8> = bits
            .as_bytes()
            .chunks(8)
            .map(|c| {
                let text = std::format!("{:0<8}", std::str::from_utf8(c).unwrap());
                u8::from_str_radix(&text, 2).unwrap()
            })
            .collect();
        MsmHeader::parse(Bits::new(&bytes), 1077, Constellation::Gps, 7)
    }

    #[test]
    fn fields_stand_where_the_standard_puts_them() {
        let header = header(1 << 63 | 1, 0b11 << 30, &[0b1010_0000]).unwrap();
        assert_eq!(header.station, 5);
        assert_eq!(header.epoch, EpochTime::Gpst(604_799_999));
        assert!(header.more_follow);
        assert_eq!(header.clock_steering, 1);
        assert_eq!(header.cells_announced(), 4);
        assert_eq!(header.cells, 0b1010 << 60);
        assert_eq!(header.len_bits(), 173);
    }

    #[test]
    fn bdt_below_zero_is_the_end_of_the_week_before() {
        assert_eq!(in_bdt_week((1 << 30) - 14_000), MS_PER_WEEK - 14_000);
        assert_eq!(in_bdt_week((1 << 30) - 1), MS_PER_WEEK - 1);
        assert_eq!(in_bdt_week(0), 0);
        assert_eq!(in_bdt_week(604_799_000), 604_799_000);
        assert!(
            in_bdt_week((1 << 30) - 14_001) > MS_PER_WEEK,
            "refused later"
        );
    }

    #[test]
    fn cell_mask_of_full_width_is_read_whole() {
        let mask = [0xA1, 2, 3, 4, 5, 6, 7, 0xB8];
        let header = header(0xFF, 0xFF, &mask).unwrap();
        assert_eq!(header.cells, u64::from_be_bytes(mask));
    }

    #[test]
    fn more_than_64_cells_are_refused() {
        assert_eq!(
            header(0x1FFF, 0b1_1111, &[0; 9]),
            Err(ContentError::TooManyCells {
                satellites: 13,
                signals: 5
            })
        );
        assert!(header(u64::MAX, u32::MAX, &[0; 300]).is_err());
    }
}
