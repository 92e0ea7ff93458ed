//! Broadcast ephemerides: one type for GPS, Galileo and BDS.

use super::Satellite;
use crate::time::GpsTime;

/// Which navigation message an ephemeris came in, and so what its clock refers to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum NavMessage {
    /// GPS LNAV: clock of the L1 P(Y) and L2 P(Y) combination.
    GpsLnav = 0,
    /// Galileo I/NAV: clock of the E1 and E5b combination; goes with BGD(E1,E5b).
    GalileoInav = 1,
    /// Galileo F/NAV: clock of the E1 and E5a combination; goes with BGD(E1,E5a).
    GalileoFnav = 2,
    /// BDS D1 or D2: clock of B3I.
    BdsD1D2 = 3,
}

/// Orbit, clock, group delays and health of one satellite as broadcast, in SI units and radians.
///
/// Symbols of [IS-GPS-200] table 20-III, [GAL-OS-SIS-ICD] table 61, [BDS-SIS-ICD-B1I] table 5-10;
/// angles in radians, not semicircles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ephemeris {
    /// Which satellite.
    pub satellite: Satellite,
    /// Which message.
    pub message: NavMessage,
    /// Reference time of the orbit, GPST.
    pub toe: GpsTime,
    /// Reference time of the clock, GPST.
    pub toc: GpsTime,
    /// Reference time of the orbit in seconds of the system's own week (BDT for BDS), for Ω.
    pub toe_sow_s: f64,
    /// Issue of data: IODE (GPS), IODnav (Galileo), AODE (BDS).
    pub issue: u16,
    /// √A, √m.
    pub sqrt_a: f64,
    /// e.
    pub eccentricity: f64,
    /// i0, rad.
    pub i0_rad: f64,
    /// di/dt, rad/s.
    pub idot_radps: f64,
    /// Ω0, rad.
    pub omega0_rad: f64,
    /// dΩ/dt, rad/s.
    pub omega_dot_radps: f64,
    /// ω, rad.
    pub argument_of_perigee_rad: f64,
    /// M0, rad.
    pub m0_rad: f64,
    /// Δn, rad/s.
    pub delta_n_radps: f64,
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
    /// af0 or a0, s.
    pub af0_s: f64,
    /// af1 or a1, s/s.
    pub af1_sps: f64,
    /// af2 or a2, s/s².
    pub af2_sps2: f64,
    /// Group delays, s: TGD and 0 (GPS); BGD(E1,E5a), BGD(E1,E5b) (Galileo); TGD1, TGD2 (BDS).
    pub group_delay_s: [f64; 2],
    /// One sigma of the signal in space, m, from URA or SISA; `None` where the broadcaster gives no
    /// prediction of accuracy, which excludes the satellite.
    pub sigma_ura_m: Option<f64>,
    /// Health word as broadcast, all bits; anything but 0 excludes the satellite.
    pub health: u16,
}
