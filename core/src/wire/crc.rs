//! Checksums of the frames: CRC-24Q of RTCM 3 and CRC-32 of surefix's own frame.
//!
//! Both are table driven, one table of 256 words each, and run over whole slices.

use crc::{Algorithm, CRC_32_ISO_HDLC, Crc};

/// CRC-24Q. [RTCM-3] 4.2: generator 0x1864CFB, start value 0, no reflection.
const CRC_24Q: Algorithm<u32> = Algorithm {
    width: 24,
    poly: 0x86_4CFB,
    init: 0,
    refin: false,
    refout: false,
    xorout: 0,
    check: 0xCD_E703,
    residue: 0,
};

static CRC24Q: Crc<u32> = Crc::<u32>::new(&CRC_24Q);
static CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// CRC-24Q over `bytes`, in the low 24 bits.
#[inline(never)]
pub fn crc24q(bytes: &[u8]) -> u32 {
    CRC24Q.checksum(bytes)
}

/// CRC-32 (ISO HDLC, as in zlib) over `bytes`.
#[inline(never)]
pub fn crc32(bytes: &[u8]) -> u32 {
    CRC32.checksum(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checks_of_the_catalogue_come_out() {
        assert_eq!(crc24q(b"123456789"), 0xCD_E703);
        assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
    }

    #[test]
    fn example_frame_of_the_standard_passes() {
        // [RTCM-3] 4.2, the 1005 message printed as an example.
        let frame = [
            0xD3, 0x00, 0x13, 0x3E, 0xD7, 0xD3, 0x02, 0x02, 0x98, 0x0E, 0xDE, 0xEF, 0x34, 0xB4,
            0xBD, 0x62, 0xAC, 0x09, 0x41, 0x98, 0x6F, 0x33,
        ];
        assert_eq!(crc24q(&frame), 0x36_0B98);
        assert_eq!(
            crc24q(&[&frame[..], &[0x36, 0x0B, 0x98]].concat()),
            0,
            "a frame with its checksum leaves nothing"
        );
    }
}
