//! Signals, named as RINEX names observation codes: band digit and attribute letter.

use super::System;

/// One signal of a system: RINEX band ('1' … '9') and attribute ('A' … 'Z'), e.g. 1C for GPS L1 C/A.
///
/// The same two characters mean different carriers in different systems; frequency is a question to
/// [`Signal::frequency_hz`] with the system. [RINEX-3.05] tables 4 to 10.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Signal {
    band: u8,
    attribute: u8,
}

/// GPS L1, Galileo E1, BDS B1C carrier, Hz. [IS-GPS-200] 3.3.1.1, [GAL-OS-SIS-ICD] table 2, [BDS-SIS-ICD-B1C] 4.1.
pub const FREQUENCY_L1_HZ: f64 = 1_575.42e6;
/// GPS L2 carrier, Hz. [IS-GPS-200] 3.3.1.1.
pub const FREQUENCY_L2_HZ: f64 = 1_227.60e6;
/// GPS L5, Galileo E5a, BDS B2a carrier, Hz. [IS-GPS-705] 3.3.1.1.
pub const FREQUENCY_L5_HZ: f64 = 1_176.45e6;
/// Galileo E5b, BDS B2I and B2b carrier, Hz. [GAL-OS-SIS-ICD] table 2.
pub const FREQUENCY_E5B_HZ: f64 = 1_207.14e6;
/// Galileo E5 AltBOC carrier, Hz. [GAL-OS-SIS-ICD] table 2.
pub const FREQUENCY_E5_HZ: f64 = 1_191.795e6;
/// Galileo E6 carrier, Hz. [GAL-OS-SIS-ICD] table 2.
pub const FREQUENCY_E6_HZ: f64 = 1_278.75e6;
/// BDS B1I carrier, Hz. [BDS-SIS-ICD-B1I] 4.2.1.
pub const FREQUENCY_B1I_HZ: f64 = 1_561.098e6;
/// BDS B3I carrier, Hz. [BDS-SIS-ICD-B3I] 4.2.1.
pub const FREQUENCY_B3I_HZ: f64 = 1_268.52e6;

impl Signal {
    /// GPS L1 C/A, Galileo E1-C.
    pub const C1C: Self = Self::literal(b'1', b'C');
    /// Galileo E1 B+C.
    pub const C1X: Self = Self::literal(b'1', b'X');
    /// BDS B1I.
    pub const C2I: Self = Self::literal(b'2', b'I');

    const fn literal(band: u8, attribute: u8) -> Self {
        Self { band, attribute }
    }

    /// The signal of a RINEX band digit and attribute letter, `None` for other characters.
    pub const fn new(band: u8, attribute: u8) -> Option<Self> {
        if band >= b'1' && band <= b'9' && attribute >= b'A' && attribute <= b'Z' {
            Some(Self { band, attribute })
        } else {
            None
        }
    }

    /// RINEX band digit, ASCII.
    pub const fn band(self) -> u8 {
        self.band
    }

    /// RINEX attribute letter, ASCII.
    pub const fn attribute(self) -> u8 {
        self.attribute
    }

    /// Carrier frequency in `system`, Hz; `None` for a band the system does not have.
    pub const fn frequency_hz(self, system: System) -> Option<f64> {
        match (system, self.band) {
            (System::Gps | System::Galileo | System::Bds, b'1') => Some(FREQUENCY_L1_HZ),
            (System::Gps, b'2') => Some(FREQUENCY_L2_HZ),
            (System::Gps | System::Galileo | System::Bds, b'5') => Some(FREQUENCY_L5_HZ),
            (System::Galileo | System::Bds, b'7') => Some(FREQUENCY_E5B_HZ),
            (System::Galileo | System::Bds, b'8') => Some(FREQUENCY_E5_HZ),
            (System::Galileo, b'6') => Some(FREQUENCY_E6_HZ),
            (System::Bds, b'2') => Some(FREQUENCY_B1I_HZ),
            (System::Bds, b'6') => Some(FREQUENCY_B3I_HZ),
            _ => None,
        }
    }
}

impl core::fmt::Display for Signal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}{}", self.band as char, self.attribute as char)
    }
}
