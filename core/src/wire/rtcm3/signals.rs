//! Names of the signals in the masks of multiple signal messages.
//!
//! [RTCM-3] tables 3.5-91 (GPS), 3.5-99 (Galileo), 3.5-108 (BDS) with the amendments for B1C, B2a and
//! B2b; names as in [RINEX-3.05] tables 4 to 9.

use super::Constellation;

/// RINEX band and attribute of signal `number` (1 to 32), `None` where the standard assigns none.
pub const fn rinex_name(constellation: Constellation, number: u8) -> Option<[u8; 2]> {
    match constellation {
        Constellation::Gps => gps(number),
        Constellation::Galileo => galileo(number),
        Constellation::Bds => bds(number),
        _ => None,
    }
}

const fn gps(number: u8) -> Option<[u8; 2]> {
    Some(match number {
        2 => *b"1C",
        3 => *b"1P",
        4 => *b"1W",
        5 => *b"1Y",
        6 => *b"1M",
        8 => *b"2C",
        9 => *b"2P",
        10 => *b"2W",
        11 => *b"2Y",
        12 => *b"2M",
        15 => *b"2S",
        16 => *b"2L",
        17 => *b"2X",
        22 => *b"5I",
        23 => *b"5Q",
        24 => *b"5X",
        30 => *b"1S",
        31 => *b"1L",
        32 => *b"1X",
        _ => return None,
    })
}

const fn galileo(number: u8) -> Option<[u8; 2]> {
    Some(match number {
        2 => *b"1C",
        3 => *b"1A",
        4 => *b"1B",
        5 => *b"1X",
        6 => *b"1Z",
        8 => *b"6C",
        9 => *b"6A",
        10 => *b"6B",
        11 => *b"6X",
        12 => *b"6Z",
        14 => *b"7I",
        15 => *b"7Q",
        16 => *b"7X",
        18 => *b"8I",
        19 => *b"8Q",
        20 => *b"8X",
        22 => *b"5I",
        23 => *b"5Q",
        24 => *b"5X",
        _ => return None,
    })
}

const fn bds(number: u8) -> Option<[u8; 2]> {
    Some(match number {
        2 => *b"2I",
        3 => *b"2Q",
        4 => *b"2X",
        8 => *b"6I",
        9 => *b"6Q",
        10 => *b"6X",
        14 => *b"7I",
        15 => *b"7Q",
        16 => *b"7X",
        22 => *b"5D",
        23 => *b"5P",
        24 => *b"5X",
        25 => *b"7D",
        30 => *b"1D",
        31 => *b"1P",
        32 => *b"1X",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_names_of_the_standard() {
        assert_eq!(rinex_name(Constellation::Gps, 2), Some(*b"1C"));
        assert_eq!(rinex_name(Constellation::Galileo, 5), Some(*b"1X"));
        assert_eq!(rinex_name(Constellation::Bds, 2), Some(*b"2I"));
        assert_eq!(rinex_name(Constellation::Bds, 32), Some(*b"1X"));
        assert_eq!(rinex_name(Constellation::Gps, 0), None);
        assert_eq!(rinex_name(Constellation::Gps, 1), None);
        assert_eq!(rinex_name(Constellation::Gps, 33), None);
        assert_eq!(rinex_name(Constellation::Glonass, 2), None);
    }
}
