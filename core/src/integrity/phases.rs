//! Phases of flight: alert limits, time to alert, and the risks a monitor may spend.
//!
//! | phase | HAL, m | VAL, m | time to alert, s | source |
//! |---|---|---|---|---|
//! | oceanic | 7408 (4 NM) | | 300 | [ICAO-A10] table 3.7.2.4-1 |
//! | en-route | 3704 (2 NM) | | 30 | [DO-229] table 2-1 for HAL; the stricter time to alert |
//! | terminal | 1852 (1 NM) | | 10 | [DO-229] table 2-1 |
//! | non-precision approach | 556 (0.3 NM) | | 10 | [DO-229] table 2-1 |
//! | LNAV/VNAV | 556 | 50 | 10 | [DO-229] 2.2.4 |
//! | APV-I, LPV | 40 | 50 | 10 (APV-I), 6 (LPV) | [ICAO-A10] table 3.7.2.4-1 |
//! | LPV-200 | 40 | 35 | 6 | [ICAO-A10] table 3.7.2.4-1, CAT I with VAL 35 m |
//! | APV-II | 40 | 20 | 6 | [ICAO-A10] table 3.7.2.4-1 |
//!
//! The snapshot monitor takes P_FA and P_MD per sample from [P0] section 2 and [DO-229] appendix on RAIM,
//! 3.3333e-7 and 1e-3, and a fault-free risk of 1e-7 per sample, which sets K_ff = 5.33, the K_V of [DO-229]
//! 2.2 and [P3] (15). The bank of filters spends risks per exposure:
//!
//! | phases | exposure | integrity risk | false alerts | source |
//! |---|---|---|---|---|
//! | oceanic to LNAV | 1 h | 1e-7 | 1e-5 | [ICAO-A10] table 3.7.2.4-1: 1e-7/h; [DO-229] RAIM: 1e-5/h |
//! | LNAV/VNAV to APV-II | 150 s | 1e-7 | 4e-5 | the same table: 2e-7 per approach, continuity 8e-6 per 15 s; half of each for satellites that fail and alerts without a fault, as [ARAIM-ADD] has it |
//!
//! Keys: docs/references.md.

/// A phase of flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Phase {
    /// Oceanic and remote.
    Oceanic = 0,
    /// En-route, domestic.
    EnRoute = 1,
    /// Terminal.
    Terminal = 2,
    /// Non-precision approach, LNAV.
    Npa = 3,
    /// LNAV/VNAV.
    LnavVnav = 4,
    /// Approach with vertical guidance, APV-I.
    Apv1 = 5,
    /// LPV to 250 ft.
    Lpv = 6,
    /// LPV to 200 ft.
    Lpv200 = 7,
    /// Approach with vertical guidance, APV-II.
    Apv2 = 8,
}

/// What a phase of flight asks of an integrity monitor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseRequirements {
    /// Horizontal alert limit, m.
    pub hal_m: f64,
    /// Vertical alert limit, m; `None` where the phase has no vertical guidance.
    pub val_m: Option<f64>,
    /// Time to alert, s.
    pub time_to_alert_s: f64,
    /// False-alert probability per independent sample.
    pub p_fa: f64,
    /// Missed-detection probability given a fault.
    pub p_md: f64,
    /// Fault-free integrity risk per sample, for the level that no fault explains.
    pub p_fault_free: f64,
    /// What the risks per exposure are counted over, s.
    pub exposure_s: f64,
    /// Probability, over the exposure, of an error above a level without an alert.
    pub p_integrity: f64,
    /// Probability, over the exposure, of an alert without a fault.
    pub p_false_alert: f64,
}

impl Phase {
    /// Every phase, from the loosest limits to the tightest.
    pub const ALL: [Self; 9] = [
        Self::Oceanic,
        Self::EnRoute,
        Self::Terminal,
        Self::Npa,
        Self::LnavVnav,
        Self::Apv1,
        Self::Lpv,
        Self::Lpv200,
        Self::Apv2,
    ];

    /// Name on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Oceanic => "oceanic",
            Self::EnRoute => "enroute",
            Self::Terminal => "terminal",
            Self::Npa => "npa",
            Self::LnavVnav => "lnav_vnav",
            Self::Apv1 => "apv1",
            Self::Lpv => "lpv",
            Self::Lpv200 => "lpv200",
            Self::Apv2 => "apv2",
        }
    }

    /// The phase of a number in a configuration frame.
    pub const fn from_u8(number: u8) -> Option<Self> {
        Some(match number {
            0 => Self::Oceanic,
            1 => Self::EnRoute,
            2 => Self::Terminal,
            3 => Self::Npa,
            4 => Self::LnavVnav,
            5 => Self::Apv1,
            6 => Self::Lpv,
            7 => Self::Lpv200,
            8 => Self::Apv2,
            _ => return None,
        })
    }

    /// The row of the table above.
    pub const fn requirements(self) -> PhaseRequirements {
        let (hal_m, val_m, time_to_alert_s) = match self {
            Self::Oceanic => (7408.0, None, 300.0),
            Self::EnRoute => (3704.0, None, 30.0),
            Self::Terminal => (1852.0, None, 10.0),
            Self::Npa => (556.0, None, 10.0),
            Self::LnavVnav => (556.0, Some(50.0), 10.0),
            Self::Apv1 => (40.0, Some(50.0), 10.0),
            Self::Lpv => (40.0, Some(50.0), 6.0),
            Self::Lpv200 => (40.0, Some(35.0), 6.0),
            Self::Apv2 => (40.0, Some(20.0), 6.0),
        };
        let (exposure_s, p_integrity, p_false_alert) = match self {
            Self::Oceanic | Self::EnRoute | Self::Terminal | Self::Npa => (3600.0, 1e-7, 1e-5),
            Self::LnavVnav | Self::Apv1 | Self::Lpv | Self::Lpv200 | Self::Apv2 => {
                (150.0, 1e-7, 4e-5)
            }
        };
        PhaseRequirements {
            hal_m,
            val_m,
            time_to_alert_s,
            p_fa: 3.3333e-7,
            p_md: 1e-3,
            p_fault_free: 1e-7,
            exposure_s,
            p_integrity,
            p_false_alert,
        }
    }
}
