//! An ephemeris as it was broadcast, whichever way it came: relayed by RTCM 3 or in the satellite's own words.
//!
//! Fields keep the units of the broadcast: angles in semicircles, times in the system's own week.
//! All scale factors are powers of two but those of the BDS group delays (0.1 ns), so every value is
//! exact.

use crate::time::SECONDS_PER_WEEK;

/// Which navigation message it was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Source {
    /// GPS LNAV.
    GpsLnav,
    /// BDS D1 or D2.
    BdsD1D2,
    /// Galileo F/NAV.
    GalileoFnav,
    /// Galileo I/NAV.
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

impl BroadcastEphemeris {
    pub(in crate::wire) const ZERO: Self = Self {
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

    /// What no ephemeris of any source may hold, as the value that stands there.
    pub(in crate::wire) fn illegal_value(&self) -> Option<u32> {
        // No orbit has a semi-major axis below 1 m; a message of zeros is none.
        let no_orbit = (self.sqrt_a < 1.0).then_some(0);
        [self.toe_s, self.toc_s]
            .into_iter()
            .find(|time_s| i64::from(*time_s) >= SECONDS_PER_WEEK)
            .or(no_orbit)
    }
}

/// Ionosphere parameters as a satellite broadcast them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BroadcastKlobuchar {
    /// Which message, and so which form of the model: GPS LNAV or BDS D1 and D2.
    pub source: Source,
    /// α0 to α3: s, s/semicircle, s/semicircle², s/semicircle³.
    pub alpha: [f64; 4],
    /// β0 to β3: s, s/semicircle, s/semicircle², s/semicircle³.
    pub beta: [f64; 4],
}
