//! Broadcast ephemerides: 1019 (GPS), 1042 (BDS), 1045 (Galileo F/NAV), 1046 (Galileo I/NAV).
//!
//! [RTCM-3] table 3.5-21 and the tables of 1042, 1045 and 1046.

use super::ContentError;
use crate::wire::bits::Bits;
use crate::wire::broadcast::fields::{Fields, two_to_minus};

pub use crate::wire::broadcast::{BroadcastEphemeris, Source};

impl BroadcastEphemeris {
    /// Reads message `number`: 1019, 1042, 1045 or 1046.
    #[inline(never)]
    pub fn parse(bits: Bits<'_>, number: u16) -> Result<Self, ContentError> {
        let mut f = Fields::new(bits, 12);
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
        match ephemeris.illegal_value() {
            Some(value) => Err(ContentError::IllegalValue { number, value }),
            None => Ok(ephemeris),
        }
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
