//! How much input was used, how much was lost, and why.

use super::native::{self, Full, Kind, ReadError, Reader};

/// Declares the counters once, so that no list of them can differ from another.
macro_rules! counters {
    ($($(#[doc = $doc:literal])+ $name:ident,)+) => {
        /// Counts of everything that arrived; each saturates at its largest value.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub struct Counters {
            $($(#[doc = $doc])+ pub $name: u32,)+
        }

        impl Counters {
            /// Nothing counted.
            pub const ZERO: Self = Self { $($name: 0,)+ };
            /// Number of counters.
            pub const COUNT: usize = [$(stringify!($name)),+].len();

            /// Name and value of every counter; the names serve as JSON keys.
            pub fn rows(&self) -> impl Iterator<Item = (&'static str, u32)> + use<> {
                [$((stringify!($name), self.$name)),+].into_iter()
            }

            /// Reads counters from the payload of a [`Kind::Counters`] frame.
            pub fn decode(payload: &[u8]) -> Result<Self, ReadError> {
                let mut r = Reader::new(payload);
                let counters = Self { $($name: r.u32()?,)+ };
                if r.left() == 0 {
                    Ok(counters)
                } else {
                    Err(ReadError::Truncated)
                }
            }
        }
    };
}

counters! {
    /// RTCM 3 frames with a right checksum.
    rtcm_frames,
    /// Native frames with a right checksum.
    native_frames,
    /// UBX frames with a right checksum.
    ubx_frames,
    /// NMEA lines passed over.
    nmea_lines,
    /// Bytes that belong to no frame and no NMEA line.
    noise_bytes,
    /// RTCM 3 preambles whose six reserved bits are not zero.
    rtcm_reserved_bits,
    /// RTCM 3 frames with a wrong checksum.
    rtcm_bad_crc,
    /// Native frames with a wrong checksum.
    native_bad_crc,
    /// Native preambles of another version.
    native_other_version,
    /// Native preambles whose length field is too large.
    native_too_long,
    /// UBX frames with a wrong checksum.
    ubx_bad_checksum,
    /// UBX preambles whose length field says more than any message has.
    ubx_too_long,
    /// UBX preambles whose length field cannot be that of their message.
    ubx_bad_length,
    /// Frames that the end of the stream cut off.
    cut_off_frames,
    /// RTCM 3 frames without content.
    rtcm_empty,
    /// RTCM 3 messages whose number the standard does not assign.
    rtcm_unknown,
    /// RTCM 3 messages of the standard that are not used here.
    rtcm_unsupported,
    /// RTCM 3 messages shorter than what they announce.
    rtcm_truncated,
    /// MSM whose masks announce more than 64 cells.
    rtcm_too_many_cells,
    /// RTCM 3 messages with a field outside its range.
    rtcm_illegal_value,
    /// Native frames of a kind not known here or not meant for a monitor.
    native_unknown_kind,
    /// Native frames whose payload was refused.
    native_refused,
    /// UBX messages that are not used here.
    ubx_unsupported,
    /// UBX messages refused for their version, their length or a time that is none.
    ubx_refused,
    /// RXM-RAWX from before the receiver knew the week: no epochs.
    rawx_without_week,
    /// RXM-RAWX that gave an epoch.
    rawx_used,
    /// Words of navigation messages that are not used here, or of other systems.
    subframes_unsupported,
    /// Words of navigation messages whose parity, checksum or preamble is wrong.
    subframes_refused,
    /// Words of navigation messages used.
    subframes_used,
    /// MSM of systems surefix navigates with.
    msm_used,
    /// MSM of other systems, or without pseudoranges to the millimetre: read for the end of the epoch.
    msm_skipped,
    /// Ephemerides decoded.
    ephemerides,
    /// Ephemerides whose week differs by more than one from the time of the observations.
    ephemerides_of_another_week,
    /// Inertial samples decoded.
    imu_samples,
    /// Observations of satellites that do not exist in their system.
    unknown_satellites,
    /// Observations of signals that have no name in RINEX.
    unknown_signals,
    /// Observations marked invalid by the receiver.
    invalid_pseudoranges,
    /// Observations of a satellite and signal the epoch has already.
    duplicate_observations,
    /// Observations of satellites an epoch had no place for.
    satellites_lost,
    /// Observations of signals a satellite had no place for.
    signals_lost,
    /// Observations of systems surefix does not navigate with, by a receiver that sends all in one message.
    observations_of_other_systems,
    /// Messages with observations by another means than those the epochs are made from.
    observations_of_another_source,
    /// The receiver's own solutions that gave an epoch, where it sends no observations.
    fixes_used,
    /// The same, while it is not yet known that it sends none.
    fixes_held_back,
    /// The same, beside observations: not used.
    fixes_beside_observations,
    /// The same, from before the receiver knew the date: not used.
    fixes_without_date,
    /// Epochs put together.
    epochs,
    /// Epochs of these that lack messages.
    epochs_incomplete,
    /// Messages dropped because their epoch is over.
    messages_too_late,
    /// BDS messages dropped because their time is 14 s ahead of the epoch they belong to.
    bds_time_contradicted,
    /// Times the receiver went back in time for good.
    time_restarts,
    /// Bytes of the receiver that found no room on the board before they were looked at.
    receiver_bytes_lost,
    /// Inertial samples used.
    imu_used,
    /// Inertial samples that came twice: dropped.
    imu_repeated,
    /// Inertial samples older than the last used one: dropped.
    imu_late,
    /// Inertial samples that never came or were of no use, and were bridged.
    imu_missing,
    /// Inertial samples used whose increments were stretched or shrunk by more than a hundredth.
    imu_stretched,
    /// Inertial samples with a number that is not finite: not used.
    imu_not_finite,
    /// Inertial samples at the end of the sensors' range: not used.
    imu_saturated,
    /// Inertial samples with an interval that cannot be: not used.
    imu_bad_interval,
    /// Inertial samples that showed a fault: the new beginning, whose increments were not used.
    imu_begun,
}

/// Adds one, and stays at the largest value.
pub(crate) fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

impl Counters {
    /// Writes the counters as a frame.
    pub fn encode(&self, out: &mut [u8]) -> Result<usize, Full> {
        native::encode(Kind::Counters, out, |w| {
            self.rows().try_for_each(|(_, value)| w.put_u32(value))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counters_come_back_from_their_frame() {
        let mut counters = Counters::ZERO;
        counters.rtcm_frames = 7;
        counters.time_restarts = u32::MAX;
        count(&mut counters.time_restarts);
        let mut out = [0; native::MAX_FRAME];
        let len = counters.encode(&mut out).unwrap();
        let (frame, _) = native::Frame::parse(&out[..len]).unwrap();
        assert_eq!(Counters::decode(frame.payload()), Ok(counters));
        assert!(Counters::decode(&frame.payload()[1..]).is_err());
        assert_eq!(counters.rows().count(), Counters::COUNT);
        assert!(counters.rows().any(|row| row == ("rtcm_frames", 7)));
    }
}
