//! Measurements with everything taken out that does not depend on the receiver: what a filter takes.
//!
//! A pseudorange here is ρ = |r_s − r| + clock, a range rate ρ' = u·(v_s − v) + drift with
//! u = (r_s − r)/|r_s − r|: the satellite stands where it was at transmission, in the Earth-fixed frame
//! of reception, and its clock and the atmosphere are corrected. [P0] (14), (17) with the signs of
//! docs/decisions/005-tight-filter.md.

use heapless::Vec;

use super::Satellite;
use crate::consts::MAX_SATELLITES;
use crate::time::GpsTime;

/// One satellite of a corrected epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorrectedMeasurement {
    /// Which satellite.
    pub satellite: Satellite,
    /// Satellite at transmission, ECEF of reception, m.
    pub r_es_e_m: [f64; 3],
    /// Its velocity against the Earth, m/s.
    pub v_es_e_mps: [f64; 3],
    /// Pseudorange, m.
    pub pseudorange_m: f64,
    /// One sigma of it, m.
    pub sigma_pseudorange_m: f64,
    /// Range rate, m/s, and one sigma of it; `None` where no Doppler was measured.
    pub range_rate_mps: Option<(f64, f64)>,
}

/// An epoch of corrected measurements.
#[derive(Clone, Debug)]
pub struct CorrectedEpoch {
    /// Time of the measurements.
    pub time: GpsTime,
    /// The satellites, in the order in which they were given.
    pub rows: Vec<CorrectedMeasurement, MAX_SATELLITES>,
}

impl CorrectedEpoch {
    /// No epoch.
    pub const EMPTY: Self = Self {
        time: GpsTime::from_ns(0),
        rows: Vec::new(),
    };

    /// Multiplies one sigma of every pseudorange and of every range rate.
    pub(crate) fn scale_sigmas(&mut self, pseudorange: f64, range_rate: f64) {
        for row in &mut self.rows {
            row.sigma_pseudorange_m *= pseudorange;
            if let Some((_, sigma_mps)) = &mut row.range_rate_mps {
                *sigma_mps *= range_rate;
            }
        }
    }
}
