//! The observation epoch: what the receiver measured at one instant.

use heapless::Vec;

use super::{Satellite, Signal};
use crate::consts::{MAX_SATELLITES, MAX_SIGNALS};
use crate::time::GpsTime;

/// One signal of one satellite at one epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignalObservation {
    /// Which signal.
    pub signal: Signal,
    /// Pseudorange as measured, m.
    pub pseudorange_m: Option<f64>,
    /// Carrier phase, cycles.
    pub carrier_phase_cycles: Option<f64>,
    /// Range rate from the Doppler, m/s, positive when the range grows: −λ·D of RINEX and UBX,
    /// the rate of MSM5 and MSM7 as it is.
    pub range_rate_mps: Option<f64>,
    /// Carrier-to-noise density, dB-Hz.
    pub cn0_dbhz: Option<f32>,
}

impl SignalObservation {
    /// A signal of which nothing was measured yet.
    pub const fn new(signal: Signal) -> Self {
        Self {
            signal,
            pseudorange_m: None,
            carrier_phase_cycles: None,
            range_rate_mps: None,
            cn0_dbhz: None,
        }
    }
}

/// One satellite at one epoch with all its signals, at most [`MAX_SIGNALS`].
#[derive(Clone, Debug, PartialEq)]
pub struct SatelliteObservation {
    /// Which satellite.
    pub satellite: Satellite,
    /// Its signals, in order of arrival, none twice.
    pub signals: Vec<SignalObservation, MAX_SIGNALS>,
}

/// What was lost or uncertain while an epoch was put together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct EpochFlags {
    /// The receiver announced more messages for the epoch than arrived.
    pub incomplete: bool,
    /// Satellites or signals did not fit [`MAX_SATELLITES`] or [`MAX_SIGNALS`] and were left out.
    pub overflow: bool,
    /// The week is not known: [`ObservationEpoch::time`] is right modulo one week only.
    pub week_unknown: bool,
    /// The receiver reset its clock, or a message says it was not steered at this epoch.
    pub clock_reset: bool,
}

/// All observations of one receiver epoch.
#[derive(Clone, Debug, PartialEq)]
pub struct ObservationEpoch {
    /// Receiver time of the epoch, GPST.
    pub time: GpsTime,
    /// Satellites in order of arrival, none twice.
    pub satellites: Vec<SatelliteObservation, MAX_SATELLITES>,
    /// What to know about its making.
    pub flags: EpochFlags,
}

/// Why an observation did not enter the epoch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotAdded {
    /// [`MAX_SATELLITES`] are there already.
    SatellitesFull,
    /// The satellite has [`MAX_SIGNALS`] already.
    SignalsFull,
    /// This signal of this satellite is there already.
    Duplicate,
}

impl ObservationEpoch {
    /// No observations, at GPST 0.
    pub const EMPTY: Self = Self {
        time: GpsTime::from_ns(0),
        satellites: Vec::new(),
        flags: EpochFlags {
            incomplete: false,
            overflow: false,
            week_unknown: false,
            clock_reset: false,
        },
    };

    /// Empties the epoch in place and gives it a time.
    pub fn restart(&mut self, time: GpsTime) {
        self.time = time;
        self.satellites.clear();
        self.flags = EpochFlags::default();
    }

    /// Adds one signal of one satellite. What does not fit sets [`EpochFlags::overflow`].
    pub fn add(
        &mut self,
        satellite: Satellite,
        observation: SignalObservation,
    ) -> Result<(), NotAdded> {
        let known = self
            .satellites
            .iter()
            .position(|s| s.satellite == satellite);
        let entry = match known {
            Some(index) => self.satellites.get_mut(index),
            None => {
                let fresh = SatelliteObservation {
                    satellite,
                    signals: Vec::new(),
                };
                if self.satellites.push(fresh).is_err() {
                    self.flags.overflow = true;
                    return Err(NotAdded::SatellitesFull);
                }
                self.satellites.last_mut()
            }
        };
        let Some(entry) = entry else {
            return Err(NotAdded::SatellitesFull);
        };
        if entry.signals.iter().any(|s| s.signal == observation.signal) {
            return Err(NotAdded::Duplicate);
        }
        entry.signals.push(observation).map_err(|_| {
            self.flags.overflow = true;
            NotAdded::SignalsFull
        })
    }

    /// The observations of one satellite.
    pub fn get(&self, satellite: Satellite) -> Option<&SatelliteObservation> {
        self.satellites.iter().find(|s| s.satellite == satellite)
    }
}

impl SatelliteObservation {
    /// The observation of one signal.
    pub fn signal(&self, signal: Signal) -> Option<&SignalObservation> {
        self.signals.iter().find(|s| s.signal == signal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::System;

    #[test]
    fn a_seventh_signal_is_refused_and_flagged() {
        let mut epoch = ObservationEpoch::EMPTY;
        let satellite = Satellite::new(System::Gps, 1).unwrap();
        for attribute in b'A'..b'A' + MAX_SIGNALS as u8 {
            let signal = Signal::new(b'1', attribute).unwrap();
            assert_eq!(epoch.add(satellite, SignalObservation::new(signal)), Ok(()));
        }
        assert!(!epoch.flags.overflow);
        let one_more = SignalObservation::new(Signal::new(b'1', b'Z').unwrap());
        assert_eq!(epoch.add(satellite, one_more), Err(NotAdded::SignalsFull));
        assert!(epoch.flags.overflow);
    }

    #[test]
    fn a_signal_given_twice_keeps_its_first_value() {
        let mut epoch = ObservationEpoch::EMPTY;
        let satellite = Satellite::new(System::Bds, 7).unwrap();
        let mut observation = SignalObservation::new(Signal::C2I);
        observation.pseudorange_m = Some(1.0);
        assert_eq!(epoch.add(satellite, observation), Ok(()));
        observation.pseudorange_m = Some(2.0);
        assert_eq!(epoch.add(satellite, observation), Err(NotAdded::Duplicate));
        let kept = epoch.get(satellite).and_then(|s| s.signal(Signal::C2I));
        assert_eq!(kept.and_then(|s| s.pseudorange_m), Some(1.0));
    }
}
