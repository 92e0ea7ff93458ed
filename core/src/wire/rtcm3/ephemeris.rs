//! Broadcast ephemerides: 1019 (GPS), 1042 (BDS), 1045 (Galileo F/NAV), 1046 (Galileo I/NAV).
//!
//! Fields keep the units of the broadcast: angles in semicircles, times in the system's own week.
//! All scale factors are powers of two but those of the BDS group delays (0.1 ns), so every value is
//! exact. [RTCM-3] table 3.5-21 and the tables of 1042, 1045 and 1046.

use super::ContentError;
use crate::wire::bits::{BitCursor, Bits};

/// Which navigation message was relayed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Source {
    /// GPS LNAV, 1019.
    GpsLnav,
    /// BDS D1 or D2, 1042.
    BdsD1D2,
    /// Galileo F/NAV, 1045.
    GalileoFnav,
    /// Galileo I/NAV, 1046.
    GalileoInav,
}

/// An ephemeris in the units of its broadcast.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BroadcastEphemeris {
    /// Which message.
    pub source: Source,
    /// Number of the satellite in its system.
    pub satellite: u8,
    /// Week of transmission: GPS modulo 1024, BDT, or GST modulo 4096.
    pub week: u16,
    /// toe, s of the system's week.
    pub toe_s: u32,
    /// toc, s of the system's week.
    pub toc_s: u32,
    /// IODE, AODE or IODnav.
    pub issue: u16,
    /// URA index, URAI or SISA index.
    pub accuracy_index: u8,
    /// GPS: six health bits. BDS: SatH1. Galileo as in RINEX: bit 0 E1-B data validity, 1 and 2 E1-B
    /// health, 3 E5a data validity, 4 and 5 E5a health, 6 E5b data validity, 7 and 8 E5b health.
    pub health: u16,
    /// √A, √m.
    pub sqrt_a: f64,
    /// e.
    pub eccentricity: f64,
    /// i0, semicircles.
    pub i0_sc: f64,
    /// di/dt, semicircles/s.
    pub idot_scps: f64,
    /// Ω0, semicircles.
    pub omega0_sc: f64,
    /// dΩ/dt, semicircles/s.
    pub omega_dot_scps: f64,
    /// ω, semicircles.
    pub argument_of_perigee_sc: f64,
    /// M0, semicircles.
    pub m0_sc: f64,
    /// Δn, semicircles/s.
    pub delta_n_scps: f64,
    /// Cuc, rad.
    pub cuc_rad: f64,
    /// Cus, rad.
    pub cus_rad: f64,
    /// Crc, m.
    pub crc_m: f64,
    /// Crs, m.
    pub crs_m: f64,
    /// Cic, rad.
    pub cic_rad: f64,
    /// Cis, rad.
    pub cis_rad: f64,
    /// af0, s.
    pub af0_s: f64,
    /// af1, s/s.
    pub af1_sps: f64,
    /// af2, s/s².
    pub af2_sps2: f64,
    /// TGD and 0; TGD1 and TGD2; BGD(E1,E5a) and BGD(E1,E5b), of which F/NAV has the first only; s.
    pub group_delay_s: [f64; 2],
}

/// 2 to the power −`exponent`, exact.
const fn two_to_minus(exponent: u32) -> f64 {
    1.0 / (1_u64 << (exponent & 63)) as f64
}

/// Reads fields in order; the first that is missing makes the rest missing.
struct Fields<'a> {
    cursor: BitCursor<'a>,
    is_complete: bool,
}

impl Fields<'_> {
    fn unsigned(&mut self, width: u32) -> u64 {
        let value = self.cursor.unsigned(width);
        self.is_complete &= value.is_some();
        value.unwrap_or(0)
    }

    fn signed(&mut self, width: u32) -> i64 {
        let value = self.cursor.signed(width);
        self.is_complete &= value.is_some();
        value.unwrap_or(0)
    }

    /// A signed field in units of 2 to the power −`exponent`.
    fn scaled(&mut self, width: u32, exponent: u32) -> f64 {
        self.signed(width) as f64 * two_to_minus(exponent)
    }

    /// An unsigned field in units of 2 to the power −`exponent`.
    fn scaled_unsigned(&mut self, width: u32, exponent: u32) -> f64 {
        self.unsigned(width) as f64 * two_to_minus(exponent)
    }
}

impl BroadcastEphemeris {
    const ZERO: Self = Self {
        source: Source::GpsLnav,
        satellite: 0,
        week: 0,
        toe_s: 0,
        toc_s: 0,
        issue: 0,
        accuracy_index: 0,
        health: 0,
        sqrt_a: 0.0,
        eccentricity: 0.0,
        i0_sc: 0.0,
        idot_scps: 0.0,
        omega0_sc: 0.0,
        omega_dot_scps: 0.0,
        argument_of_perigee_sc: 0.0,
        m0_sc: 0.0,
        delta_n_scps: 0.0,
        cuc_rad: 0.0,
        cus_rad: 0.0,
        crc_m: 0.0,
        crs_m: 0.0,
        cic_rad: 0.0,
        cis_rad: 0.0,
        af0_s: 0.0,
        af1_sps: 0.0,
        af2_sps2: 0.0,
        group_delay_s: [0.0; 2],
    };

    /// Reads message `number`: 1019, 1042, 1045 or 1046.
    #[inline(never)]
    pub fn parse(bits: Bits<'_>, number: u16) -> Result<Self, ContentError> {
        let mut f = Fields {
            cursor: BitCursor::new(bits, 12),
            is_complete: true,
        };
        let mut ephemeris = Self::ZERO;
        match number {
            1019 => ephemeris.read_gps(&mut f),
            1042 => ephemeris.read_bds(&mut f),
            1045 => ephemeris.read_galileo(&mut f, Source::GalileoFnav),
            1046 => ephemeris.read_galileo(&mut f, Source::GalileoInav),
            _ => f.is_complete = false,
        }
        if !f.is_complete {
            return Err(ContentError::Truncated { number });
        }
        for value in [ephemeris.toe_s, ephemeris.toc_s] {
            if value >= 604_800 {
                return Err(ContentError::IllegalValue { number, value });
            }
        }
        // No orbit has a semi-major axis below 1 m; a message of zeros is none.
        if ephemeris.sqrt_a < 1.0 {
            return Err(ContentError::IllegalValue { number, value: 0 });
        }
        Ok(ephemeris)
    }

    fn read_gps(&mut self, f: &mut Fields<'_>) {
        self.source = Source::GpsLnav;
        self.satellite = f.unsigned(6) as u8;
        self.week = f.unsigned(10) as u16;
        self.accuracy_index = f.unsigned(4) as u8;
        f.cursor.skip(2); // codes on L2
        self.idot_scps = f.scaled(14, 43);
        self.issue = f.unsigned(8) as u16;
        self.toc_s = f.unsigned(16) as u32 * 16;
        self.af2_sps2 = f.scaled(8, 55);
        self.af1_sps = f.scaled(16, 43);
        self.af0_s = f.scaled(22, 31);
        f.cursor.skip(10); // IODC
        self.crs_m = f.scaled(16, 5);
        self.delta_n_scps = f.scaled(16, 43);
        self.m0_sc = f.scaled(32, 31);
        self.cuc_rad = f.scaled(16, 29);
        self.eccentricity = f.scaled_unsigned(32, 33);
        self.cus_rad = f.scaled(16, 29);
        self.sqrt_a = f.scaled_unsigned(32, 19);
        self.toe_s = f.unsigned(16) as u32 * 16;
        self.cic_rad = f.scaled(16, 29);
        self.omega0_sc = f.scaled(32, 31);
        self.cis_rad = f.scaled(16, 29);
        self.i0_sc = f.scaled(32, 31);
        self.crc_m = f.scaled(16, 5);
        self.argument_of_perigee_sc = f.scaled(32, 31);
        self.omega_dot_scps = f.scaled(24, 43);
        self.group_delay_s = [f.scaled(8, 31), 0.0];
        self.health = f.unsigned(6) as u16;
        f.unsigned(2); // L2 P data flag, fit interval
    }

    fn read_bds(&mut self, f: &mut Fields<'_>) {
        self.source = Source::BdsD1D2;
        self.satellite = f.unsigned(6) as u8;
        self.week = f.unsigned(13) as u16;
        self.accuracy_index = f.unsigned(4) as u8;
        self.idot_scps = f.scaled(14, 43);
        self.issue = f.unsigned(5) as u16;
        self.toc_s = f.unsigned(17) as u32 * 8;
        // 2⁻⁶⁶ in two steps.
        self.af2_sps2 = f.scaled(11, 33) * two_to_minus(33);
        self.af1_sps = f.scaled(22, 50);
        self.af0_s = f.scaled(24, 33);
        f.cursor.skip(5); // AODC
        self.crs_m = f.scaled(18, 6);
        self.delta_n_scps = f.scaled(16, 43);
        self.m0_sc = f.scaled(32, 31);
        self.cuc_rad = f.scaled(18, 31);
        self.eccentricity = f.scaled_unsigned(32, 33);
        self.cus_rad = f.scaled(18, 31);
        self.sqrt_a = f.scaled_unsigned(32, 19);
        self.toe_s = f.unsigned(17) as u32 * 8;
        self.cic_rad = f.scaled(18, 31);
        self.omega0_sc = f.scaled(32, 31);
        self.cis_rad = f.scaled(18, 31);
        self.i0_sc = f.scaled(32, 31);
        self.crc_m = f.scaled(18, 6);
        self.argument_of_perigee_sc = f.scaled(32, 31);
        self.omega_dot_scps = f.scaled(24, 43);
        // Divided, not multiplied by 1e-10, so that the nearest f64 to the decimal comes out.
        self.group_delay_s = [f.signed(10) as f64 / 1e10, f.signed(10) as f64 / 1e10];
        self.health = f.unsigned(1) as u16;
    }

    fn read_galileo(&mut self, f: &mut Fields<'_>, source: Source) {
        self.source = source;
        self.satellite = f.unsigned(6) as u8;
        self.week = f.unsigned(12) as u16;
        self.issue = f.unsigned(10) as u16;
        self.accuracy_index = f.unsigned(8) as u8;
        self.idot_scps = f.scaled(14, 43);
        self.toc_s = f.unsigned(14) as u32 * 60;
        self.af2_sps2 = f.scaled(6, 59);
        self.af1_sps = f.scaled(21, 46);
        self.af0_s = f.scaled(31, 34);
        self.crs_m = f.scaled(16, 5);
        self.delta_n_scps = f.scaled(16, 43);
        self.m0_sc = f.scaled(32, 31);
        self.cuc_rad = f.scaled(16, 29);
        self.eccentricity = f.scaled_unsigned(32, 33);
        self.cus_rad = f.scaled(16, 29);
        self.sqrt_a = f.scaled_unsigned(32, 19);
        self.toe_s = f.unsigned(14) as u32 * 60;
        self.cic_rad = f.scaled(16, 29);
        self.omega0_sc = f.scaled(32, 31);
        self.cis_rad = f.scaled(16, 29);
        self.i0_sc = f.scaled(32, 31);
        self.crc_m = f.scaled(16, 5);
        self.argument_of_perigee_sc = f.scaled(32, 31);
        self.omega_dot_scps = f.scaled(24, 43);
        let bgd_e5a_s = f.scaled(10, 32);
        if let Source::GalileoInav = source {
            self.group_delay_s = [bgd_e5a_s, f.scaled(10, 32)];
            let (e5b_health, e5b_invalid) = (f.unsigned(2), f.unsigned(1));
            let (e1_health, e1_invalid) = (f.unsigned(2), f.unsigned(1));
            self.health = (e5b_health << 7 | e5b_invalid << 6 | e1_health << 1 | e1_invalid) as u16;
        } else {
            self.group_delay_s = [bgd_e5a_s, 0.0];
            let (e5a_health, e5a_invalid) = (f.unsigned(2), f.unsigned(1));
            self.health = (e5a_health << 4 | e5a_invalid << 3) as u16;
        }
    }
}
