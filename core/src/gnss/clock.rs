//! Satellite clock and group delays: what to add to a pseudorange of which signal.
//!
//! In: an [`Ephemeris`], a signal or a pair. Out: satellite time minus system time as that signal
//! shows it, s.
//!
//! | symbol | code          | unit | meaning                                                      |
//! |--------|---------------|------|--------------------------------------------------------------|
//! | Δt_sv  | offset_s      | s    | clock polynomial, for the signal or pair the clock refers to |
//! | Δt_r   | relativity_s  | s    | F e √A sin E (not −2 r·v/c²), as control segments define it  |
//! | T_gd   | group delay   | s    | Δt_sv of the reference − Δt_sv of this signal                |
//! | γ      | gamma         | 1    | (f of the first signal / f of this signal)²                  |
//!
//! Equations: [IS-GPS-200] 20.3.3.3.3.1, 20.3.3.3.3.2; [GAL-OS-SIS-ICD] 5.1.3, 5.1.5;
//! [BDS-SIS-ICD-B1I] 5.2.4.8 to 5.2.4.10, [BDS-SIS-ICD-B3I] 5.2.4.8.
//! −2 r·v/c² contains the harmonic part of the radial velocity too and differs by up to 2 cm.
//!
//! Each signal's own delay is applied before signals are combined, so that a combination needs no
//! formula of its own: for (B1I, B3I) it gives −2.944 TGD1, for the pair a clock refers to it gives 0.

use super::signal::{
    FREQUENCY_B1I_HZ, FREQUENCY_B3I_HZ, FREQUENCY_E5B_HZ, FREQUENCY_L1_HZ, FREQUENCY_L2_HZ,
    FREQUENCY_L5_HZ,
};
use super::{Ephemeris, NavMessage, Signal};

/// Clock polynomial without relativity and group delay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockState {
    /// Satellite time minus system time, s.
    pub offset_s: f64,
    /// Its rate, s/s.
    pub rate_sps: f64,
}

/// The clock polynomial `since_toc_s` after its reference time.
pub fn polynomial(ephemeris: &Ephemeris, since_toc_s: f64) -> ClockState {
    let e = ephemeris;
    ClockState {
        offset_s: e.af0_s + since_toc_s * (e.af1_sps + since_toc_s * e.af2_sps2),
        rate_sps: e.af1_sps + 2.0 * since_toc_s * e.af2_sps2,
    }
}

const fn gamma(first_hz: f64, this_hz: f64) -> f64 {
    (first_hz / this_hz) * (first_hz / this_hz)
}

/// Group delay of one signal, s: what to take off the clock for a user of that signal alone;
/// `None` where the message does not tell, and then the signal is not used.
///
/// Not told: GPS L5 (LNAV has no inter-signal correction for it), Galileo E5b in F/NAV, E5 and E6,
/// BDS B1C, B2a and B2b. L2C is taken as L2 P(Y), L1C as L1 C/A: the corrections between them are in
/// CNAV only and below 1 ns.
pub fn group_delay_s(ephemeris: &Ephemeris, signal: Signal) -> Option<f64> {
    const GAMMA_L2: f64 = gamma(FREQUENCY_L1_HZ, FREQUENCY_L2_HZ);
    const GAMMA_E5A: f64 = gamma(FREQUENCY_L1_HZ, FREQUENCY_L5_HZ);
    const GAMMA_E5B: f64 = gamma(FREQUENCY_L1_HZ, FREQUENCY_E5B_HZ);
    let [first_s, second_s] = ephemeris.group_delay_s;
    match (ephemeris.message, signal.band()) {
        // TGD. [IS-GPS-200] 20.3.3.3.3.2
        (NavMessage::GpsLnav, b'1') => Some(first_s),
        (NavMessage::GpsLnav, b'2') => Some(GAMMA_L2 * first_s),
        // BGD(E1,E5a). [GAL-OS-SIS-ICD] 5.1.5
        (NavMessage::GalileoFnav, b'1') => Some(first_s),
        (NavMessage::GalileoFnav, b'5') => Some(GAMMA_E5A * first_s),
        // BGD(E1,E5b); I/NAV carries BGD(E1,E5a) too, and E5a differs from E1 by (γ − 1) of that.
        (NavMessage::GalileoInav, b'1') => Some(second_s),
        (NavMessage::GalileoInav, b'7') => Some(GAMMA_E5B * second_s),
        (NavMessage::GalileoInav, b'5') => Some(second_s + (GAMMA_E5A - 1.0) * first_s),
        // TGD1, TGD2; the clock is that of B3I. [BDS-SIS-ICD-B1I] 5.2.4.10
        (NavMessage::BdsD1D2, b'2') => Some(first_s),
        (NavMessage::BdsD1D2, b'7') if is_b2i(signal) => Some(second_s),
        (NavMessage::BdsD1D2, b'6') => Some(0.0),
        _ => None,
    }
}

/// B2I shares its band with B2b of BDS-3, which has other attributes. [RINEX-3.05] table 9.
const fn is_b2i(signal: Signal) -> bool {
    matches!(signal.attribute(), b'I' | b'Q' | b'X')
}

/// Factors of the ionosphere-free combination of two carriers, 1.
///
/// [IS-GPS-200] 20.3.3.3.3.3: (f1² P1 − f2² P2) / (f1² − f2²); the factors add up to 1.
pub fn ionosphere_free_factors(first_hz: f64, second_hz: f64) -> [f64; 2] {
    let first = first_hz * first_hz / (first_hz * first_hz - second_hz * second_hz);
    [first, 1.0 - first]
}

const _: () = {
    // The factor ERRATA derives for B1I in (B1I, B3I).
    let first = FREQUENCY_B1I_HZ * FREQUENCY_B1I_HZ
        / (FREQUENCY_B1I_HZ * FREQUENCY_B1I_HZ - FREQUENCY_B3I_HZ * FREQUENCY_B3I_HZ);
    assert!(first > 2.943 && first < 2.945);
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::orbit::tests::example;
    use crate::gnss::{Satellite, System};

    fn signal(name: &[u8; 2]) -> Signal {
        Signal::new(name[0], name[1]).unwrap()
    }

    fn ephemeris(system: System) -> Ephemeris {
        example(Satellite::new(system, 11).unwrap())
    }

    fn combined(ephemeris: &Ephemeris, first: &[u8; 2], second: &[u8; 2]) -> Option<f64> {
        let system = ephemeris.satellite.system();
        let factors = ionosphere_free_factors(
            signal(first).frequency_hz(system).unwrap(),
            signal(second).frequency_hz(system).unwrap(),
        );
        Some(
            factors[0] * group_delay_s(ephemeris, signal(first))?
                + factors[1] * group_delay_s(ephemeris, signal(second))?,
        )
    }

    #[test]
    fn the_pair_a_clock_refers_to_has_no_group_delay() {
        let gps = ephemeris(System::Gps);
        assert!(combined(&gps, b"1C", b"2W").unwrap().abs() < 1e-22);
        let mut galileo = ephemeris(System::Galileo);
        assert!(combined(&galileo, b"1C", b"7Q").unwrap().abs() < 1e-22);
        galileo.message = NavMessage::GalileoFnav;
        assert!(combined(&galileo, b"1C", b"5Q").unwrap().abs() < 1e-22);
        assert_eq!(combined(&galileo, b"1C", b"7Q"), None);
    }

    #[test]
    fn both_galileo_messages_tell_the_same_of_e1_and_e5a() {
        // Clocks of one satellite in two messages: each minus its delay is E1's own clock.
        let inav = ephemeris(System::Galileo);
        let [a_s, b_s] = inav.group_delay_s;
        let mut fnav = inav;
        fnav.message = NavMessage::GalileoFnav;
        fnav.af0_s = inav.af0_s - b_s + a_s;
        for name in [b"1C", b"5Q"] {
            let by_inav = inav.af0_s - group_delay_s(&inav, signal(name)).unwrap();
            let by_fnav = fnav.af0_s - group_delay_s(&fnav, signal(name)).unwrap();
            assert!((by_inav - by_fnav).abs() < 1e-18);
        }
    }

    #[test]
    fn bds_clock_is_that_of_b3i() {
        let bds = ephemeris(System::Bds);
        let [tgd1_s, tgd2_s] = bds.group_delay_s;
        assert_eq!(group_delay_s(&bds, signal(b"6I")), Some(0.0));
        assert_eq!(group_delay_s(&bds, signal(b"2I")), Some(tgd1_s));
        assert_eq!(group_delay_s(&bds, signal(b"7I")), Some(tgd2_s));
        assert_eq!(group_delay_s(&bds, signal(b"7D")), None);
        assert_eq!(group_delay_s(&bds, signal(b"1P")), None);
        let pair = combined(&bds, b"2I", b"6I").unwrap();
        assert!((pair - 2.944 * tgd1_s).abs() < 1e-3 * tgd1_s);
    }

    #[test]
    fn polynomial_and_its_rate_agree() {
        let gps = ephemeris(System::Gps);
        let at = polynomial(&gps, 1000.0);
        let slope = (polynomial(&gps, 1001.0).offset_s - polynomial(&gps, 999.0).offset_s) / 2.0;
        assert!((slope - at.rate_sps).abs() < 1e-18);
        assert!((at.offset_s - (2.3e-4 - 4.8e-9 + 1.0e-12)).abs() < 1e-18);
    }
}
