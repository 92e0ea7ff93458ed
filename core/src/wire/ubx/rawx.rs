//! RXM-RAWX: what the receiver measured at one instant. [UBX-F9-HPG] UBX-RXM-RAWX
//! (version 1 of the message), [UBX-M8] UBX-RXM-RAWX (version 0)

use super::PayloadError;

/// Bytes before the first measurement.
pub const HEADER_LEN: usize = 16;
/// Bytes of a measurement.
pub const MEASUREMENT_LEN: usize = 32;

/// Offset of the number of measurements.
const COUNT_AT: usize = 11;

/// Bits of recStat.
const CLOCK_RESET: u8 = 1 << 1;

/// Bits of trkStat.
const PSEUDORANGE_VALID: u8 = 1 << 0;
const PHASE_VALID: u8 = 1 << 1;
const HALF_CYCLE_VALID: u8 = 1 << 2;

const SECONDS_PER_WEEK: f64 = 604_800.0;

/// Whether a length can be that of the message, as far as its content is there.
pub(super) fn length_is_possible(length: usize, content: &[u8]) -> bool {
    let Some(measurements) = length.checked_sub(HEADER_LEN) else {
        return false;
    };
    measurements.is_multiple_of(MEASUREMENT_LEN)
        && content
            .get(COUNT_AT)
            .is_none_or(|count| usize::from(*count) == measurements / MEASUREMENT_LEN)
}

/// One measurement of one signal; only legal numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurement {
    /// gnssId: 0 GPS, 1 SBAS, 2 Galileo, 3 BDS, 5 QZSS, 6 GLONASS, 7 NavIC.
    pub gnss_id: u8,
    /// svId: number of the satellite in its system, 255 where the receiver does not know it.
    pub sv_id: u8,
    /// sigId; 0 in version 0 of the message, which has the first signal of each system only.
    pub sig_id: u8,
    /// Pseudorange, m, where its validity bit is set.
    pub pseudorange_m: Option<f64>,
    /// Carrier phase, cycles, where its validity bit is set and its half cycle is resolved.
    pub carrier_phase_cycles: Option<f64>,
    /// Doppler, Hz, positive for a satellite that approaches.
    pub doppler_hz: Option<f32>,
    /// Carrier-to-noise density, dB-Hz; `None` for 0, which no tracked signal has.
    pub cn0_dbhz: Option<u8>,
}

/// The message: a view whose lengths, version and time were checked.
#[derive(Clone, Copy, Debug)]
pub struct Rawx<'a> {
    /// Receiver time, s of the GPS week. No whole number: the receiver's clock is not steered.
    pub tow_s: f64,
    /// GPS week, all of it.
    pub week: u16,
    /// The receiver reset its clock since the last epoch.
    pub clock_reset: bool,
    has_signals: bool,
    measurements: &'a [u8],
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

impl<'a> Rawx<'a> {
    /// Reads the head of the message.
    ///
    /// # Errors
    /// [`PayloadError`]; `WeekUnknown` while the receiver gives 0 for the week: its time is a count since
    /// power-on then.
    pub fn parse(payload: &'a [u8]) -> Result<Self, PayloadError> {
        let (head, measurements) = payload
            .split_first_chunk::<HEADER_LEN>()
            .ok_or(PayloadError::Length)?;
        let &[
            t0,
            t1,
            t2,
            t3,
            t4,
            t5,
            t6,
            t7,
            w0,
            w1,
            _leap,
            count,
            status,
            version,
            _,
            _,
        ] = head;
        if version > 1 {
            return Err(PayloadError::Version { version });
        }
        if measurements.len() != usize::from(count) * MEASUREMENT_LEN {
            return Err(PayloadError::Length);
        }
        let tow_s = f64::from_le_bytes([t0, t1, t2, t3, t4, t5, t6, t7]);
        // NaN is in no range. A clock ahead of the week's end by less than a second is as it is.
        if !(-1.0..=SECONDS_PER_WEEK + 1.0).contains(&tow_s) {
            return Err(PayloadError::TimeOfWeek { tow_s });
        }
        let week = u16::from_le_bytes([w0, w1]);
        if week == 0 {
            return Err(PayloadError::WeekUnknown);
        }
        Ok(Self {
            tow_s,
            week,
            clock_reset: status & CLOCK_RESET != 0,
            has_signals: version >= 1,
            measurements,
        })
    }

    /// Every measurement in the order of the message.
    pub fn measurements(&self) -> impl Iterator<Item = Measurement> + use<'a> {
        let has_signals = self.has_signals;
        self.measurements
            .as_chunks::<MEASUREMENT_LEN>()
            .0
            .iter()
            .map(move |bytes| measurement(bytes, has_signals))
    }
}

fn measurement(bytes: &[u8; MEASUREMENT_LEN], has_signals: bool) -> Measurement {
    let &[
        p0,
        p1,
        p2,
        p3,
        p4,
        p5,
        p6,
        p7, //
        c0,
        c1,
        c2,
        c3,
        c4,
        c5,
        c6,
        c7, //
        d0,
        d1,
        d2,
        d3,
        gnss_id,
        sv_id,
        sig_id,
        _freq_id, //
        _lock0,
        _lock1,
        cn0,
        _pr_dev,
        _cp_dev,
        _do_dev,
        tracking,
        _,
    ] = bytes;
    let is_set = |bits: u8| tracking & bits == bits;
    let pseudorange_m = finite(f64::from_le_bytes([p0, p1, p2, p3, p4, p5, p6, p7]));
    let phase = finite(f64::from_le_bytes([c0, c1, c2, c3, c4, c5, c6, c7]));
    let doppler_hz = f32::from_le_bytes([d0, d1, d2, d3]);
    Measurement {
        gnss_id,
        sv_id,
        sig_id: if has_signals { sig_id } else { 0 },
        pseudorange_m: pseudorange_m.filter(|_| is_set(PSEUDORANGE_VALID)),
        carrier_phase_cycles: phase.filter(|_| is_set(PHASE_VALID | HALF_CYCLE_VALID)),
        doppler_hz: doppler_hz.is_finite().then_some(doppler_hz),
        cn0_dbhz: (cn0 != 0).then_some(cn0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn message(week: u16, tow_s: f64, version: u8, tracking: u8) -> Vec<u8> {
        let mut bytes = tow_s.to_le_bytes().to_vec();
        bytes.extend(week.to_le_bytes());
        bytes.extend([18, 1, 2, version, 0, 0]);
        bytes.extend(22_345_678.125_f64.to_le_bytes());
        bytes.extend(117_000_000.25_f64.to_le_bytes());
        bytes.extend((-1234.5_f32).to_le_bytes());
        bytes.extend([2, 11, 6, 0, 0, 0, 44, 5, 1, 4, tracking, 0]);
        bytes
    }

    #[test]
    fn fields_are_where_the_interface_description_has_them() {
        let bytes = message(2244, 35_754.996, 1, 0b0111);
        let rawx = Rawx::parse(&bytes).unwrap();
        assert_eq!(
            (rawx.week, rawx.tow_s, rawx.clock_reset),
            (2244, 35_754.996, true)
        );
        let all: Vec<_> = rawx.measurements().collect();
        assert_eq!(
            all,
            [Measurement {
                gnss_id: 2,
                sv_id: 11,
                sig_id: 6,
                pseudorange_m: Some(22_345_678.125),
                carrier_phase_cycles: Some(117_000_000.25),
                doppler_hz: Some(-1234.5),
                cn0_dbhz: Some(44),
            }]
        );
    }

    #[test]
    fn validity_bits_are_honoured() {
        for tracking in 0..8 {
            let bytes = message(2244, 1.0, 1, tracking);
            let first = Rawx::parse(&bytes).unwrap().measurements().next().unwrap();
            assert_eq!(first.pseudorange_m.is_some(), tracking & 1 != 0);
            assert_eq!(first.carrier_phase_cycles.is_some(), tracking & 6 == 6);
        }
        let mut bytes = message(2244, 1.0, 1, 7);
        bytes[16..24].copy_from_slice(&f64::NAN.to_le_bytes());
        bytes[32..36].copy_from_slice(&f32::INFINITY.to_le_bytes());
        let first = Rawx::parse(&bytes).unwrap().measurements().next().unwrap();
        assert_eq!((first.pseudorange_m, first.doppler_hz), (None, None));
    }

    #[test]
    fn old_version_has_the_first_signal_only() {
        let bytes = message(2244, 1.0, 0, 7);
        let first = Rawx::parse(&bytes).unwrap().measurements().next().unwrap();
        assert_eq!(first.sig_id, 0);
        assert_eq!(
            Rawx::parse(&message(2244, 1.0, 2, 7)).unwrap_err(),
            PayloadError::Version { version: 2 }
        );
    }

    #[test]
    fn time_that_is_none_is_refused() {
        let refused = |week, tow_s| Rawx::parse(&message(week, tow_s, 1, 7)).unwrap_err();
        assert_eq!(refused(0, 18.0), PayloadError::WeekUnknown);
        assert!(matches!(
            refused(2244, f64::NAN),
            PayloadError::TimeOfWeek { .. }
        ));
        assert!(matches!(
            refused(2244, 604_900.0),
            PayloadError::TimeOfWeek { .. }
        ));
        let mut short = message(2244, 1.0, 1, 7);
        short.pop();
        assert_eq!(Rawx::parse(&short).unwrap_err(), PayloadError::Length);
        assert_eq!(Rawx::parse(&[0; 15]).unwrap_err(), PayloadError::Length);
    }
}
