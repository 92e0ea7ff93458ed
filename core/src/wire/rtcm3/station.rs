//! Position of a reference station, messages 1005 and 1006. [RTCM-3] table 3.5-11

use crate::wire::bits::{BitCursor, Bits};

/// Antenna reference point of a station.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StationPosition {
    /// Reference station. DF003
    pub station: u16,
    /// ECEF coordinates, m.
    pub r_ea_e_m: [f64; 3],
    /// Height of the antenna above its reference point's marker, m; 1006 only. DF028
    pub antenna_height_m: Option<f64>,
}

impl StationPosition {
    /// Reads 1005 or 1006; `None` where it ends too early.
    pub fn parse(bits: Bits<'_>) -> Option<Self> {
        let number = bits.unsigned(0, 12)?;
        let mut cursor = BitCursor::new(bits, 12);
        let station = cursor.unsigned(12)? as u16;
        cursor.skip(6 + 3 + 1); // realisation year, systems, station indicator
        let x = cursor.signed(38)?;
        cursor.skip(1 + 1); // oscillator indicator, reserved
        let y = cursor.signed(38)?;
        cursor.skip(2); // quarter-cycle indicator
        let z = cursor.signed(38)?;
        let height = if number == 1006 {
            Some(cursor.unsigned(16)? as f64 / 1e4)
        } else {
            None
        };
        Some(Self {
            station,
            r_ea_e_m: [x as f64 / 1e4, y as f64 / 1e4, z as f64 / 1e4],
            antenna_height_m: height,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn example_of_the_standard() {
        // [RTCM-3] 4.2 prints this 1005 with its coordinates.
        let content = [
            0x3E, 0xD7, 0xD3, 0x02, 0x02, 0x98, 0x0E, 0xDE, 0xEF, 0x34, 0xB4, 0xBD, 0x62, 0xAC,
            0x09, 0x41, 0x98, 0x6F, 0x33,
        ];
        let station = StationPosition::parse(Bits::new(&content)).unwrap();
        assert_eq!(station.station, 2003);
        assert_eq!(
            station.r_ea_e_m,
            [1_114_104.599_9, -4_850_729.710_8, 3_975_521.464_3]
        );
        assert_eq!(station.antenna_height_m, None);
        assert_eq!(StationPosition::parse(Bits::new(&content[..18])), None);
    }
}
