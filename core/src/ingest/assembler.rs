//! Messages to epochs.

use super::aiding::{decode_aids, decode_magnetic_field, decode_pressure, decode_unit_sample};
use super::convert::{self, NoObservation};
use super::corrected::CorrectedAssembler;
use super::inertial::{
    CorrectedGroup, decode_imu, decode_inertial, decode_initial_state, decode_reference_model,
};
use super::latency::decode_receiver_latency;
use super::magnetometer::decode_magnetometer;
use super::payload::{
    ObservationGroup, decode_configuration, decode_end_of_stream, decode_ephemeris,
    decode_klobuchar,
};
use super::receiver_fix::{decode_receiver_fix, receiver_fix};
use super::units::decode_unit;
use super::week::WeekResolver;
use super::{Event, PayloadError};
use crate::gnss::observation::NotAdded;
use crate::gnss::{CorrectedEpoch, NavMessage, ObservationEpoch, ReceiverFix};
use crate::time::{GPST_MINUS_BDT_S, GpsTime, NS_PER_S, NS_PER_WEEK};
use crate::wire::broadcast::{Collected, Collector, Subframe, SubframeError};
use crate::wire::counters::count;
use crate::wire::native::{Frame, Kind};
use crate::wire::rtcm3::header::EpochTime;
use crate::wire::rtcm3::{BroadcastEphemeris, ContentError, Message, Msm, MsmHeader};
use crate::wire::ubx::{self, NavPvt, Rawx};
use crate::wire::{Counters, Scanned};

/// So many epochs before the last one, each later than the one before it and none on time between
/// them, and the receiver is followed back: the time of the last one was wrong, or the receiver has
/// set its clock back. Repeated messages and those of an epoch or two delivered late stay below it.
/// One wrong time silences the output for so many epochs at most, 3 s at 1 Hz; a time to alert is
/// longer.
const LATE_EPOCHS_FOLLOWED: u8 = 3;

/// A receiver that has given its own solutions for so long and no observations sends none, ns.
const NO_OBSERVATIONS_AFTER_NS: i64 = 5 * NS_PER_S;

const NS_PER_MS: i64 = 1_000_000;

/// What became of a frame.
pub(super) enum Outcome {
    /// Done with it.
    Used,
    /// Done with it, and this happened.
    UsedGives(Event),
    /// This happened first; the frame is to be given again.
    FirstGives(Event),
}

/// Where a message stands to the epoch being put together.
enum Place {
    /// Its epoch is open now.
    Inside,
    /// A later epoch has to be given out first.
    After,
    /// Its epoch is over.
    Before,
}

/// The epochs being put together, and the week.
#[derive(Clone, Debug)]
pub(super) struct Assembler {
    epoch: ObservationEpoch,
    /// More messages of `epoch` are expected.
    is_open: bool,
    /// The time of `epoch` is one that was received.
    has_time: bool,
    /// Group of a native epoch that comes next.
    next_group: u8,
    late: LateEpochs,
    weeks: WeekResolver,
    corrected: CorrectedAssembler,
    /// An RXM-RAWX has come. It is the receiver's own; MSM beside it may be the same once more, or a reference
    /// station's, with another clock and from another place, and gives no epoch any more: not while the
    /// receiver does not know the week, and not when it falls silent.
    has_rawx: bool,
    /// Observations have come, of whatever kind: the receiver's own solutions are not used any more.
    has_observations: bool,
    fixes: FixTimes,
    /// Parts of navigation messages.
    subframes: Collector,
    /// The ephemeris of a frame that will be given again.
    held: Option<BroadcastEphemeris>,
}

/// When the receiver gave its own solutions.
#[derive(Clone, Copy, Debug)]
struct FixTimes {
    first: Option<GpsTime>,
    last: Option<GpsTime>,
    late: LateEpochs,
}

impl FixTimes {
    const NONE: Self = Self {
        first: None,
        last: None,
        late: LateEpochs::NONE,
    };
}

/// Epochs that came after a later one, in a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct LateEpochs {
    /// Time of the last message of them.
    last: Option<GpsTime>,
    /// Different times, in ascending order.
    times: u8,
}

impl LateEpochs {
    pub(super) const NONE: Self = Self {
        last: None,
        times: 0,
    };

    /// Notes a message of an epoch at `time`; tells whether to follow the receiver there.
    pub(super) fn note(&mut self, time: GpsTime) -> bool {
        self.times = match self.last {
            Some(last) if time == last => self.times,
            Some(last) if time > last => self.times.saturating_add(1),
            // The first, or back again: not how a clock goes.
            _ => 1,
        };
        self.last = Some(time);
        self.times >= LATE_EPOCHS_FOLLOWED
    }
}

impl Assembler {
    pub(super) const EMPTY: Self = Self {
        epoch: ObservationEpoch::EMPTY,
        is_open: false,
        has_time: false,
        next_group: 0,
        late: LateEpochs::NONE,
        weeks: WeekResolver::EMPTY,
        corrected: CorrectedAssembler::EMPTY,
        has_rawx: false,
        has_observations: false,
        fixes: FixTimes::NONE,
        subframes: Collector::EMPTY,
        held: None,
    };

    pub(super) const fn epoch(&self) -> &ObservationEpoch {
        &self.epoch
    }

    pub(super) const fn corrected_epoch(&self) -> &CorrectedEpoch {
        self.corrected.epoch()
    }

    pub(super) const fn corrected_is_incomplete(&self) -> bool {
        self.corrected.is_incomplete()
    }

    /// Ends one epoch that waits for more, and gives it.
    pub(super) fn close_next(&mut self, counters: &mut Counters) -> Option<Event> {
        if self.close_incomplete(counters) {
            Some(Event::EpochReady)
        } else if self.corrected.close_incomplete(counters) {
            Some(Event::CorrectedEpochReady)
        } else {
            None
        }
    }

    pub(super) fn configure(&mut self, reference_week: Option<u16>) {
        self.weeks.configure(reference_week);
    }

    /// Ends an epoch that waits for more; tells whether there was one.
    fn close_incomplete(&mut self, counters: &mut Counters) -> bool {
        if !self.is_open {
            return false;
        }
        self.epoch.flags.incomplete = true;
        self.close(counters);
        true
    }

    fn close(&mut self, counters: &mut Counters) {
        self.is_open = false;
        count(&mut counters.epochs);
        if self.epoch.flags.incomplete {
            count(&mut counters.epochs_incomplete);
        }
    }

    pub(super) fn take(&mut self, frame: Scanned<'_>, counters: &mut Counters) -> Outcome {
        match frame {
            Scanned::Rtcm3(content) => match Message::parse(content) {
                Ok(message) => self.take_rtcm3(&message, counters),
                Err(error) => {
                    count(match error {
                        ContentError::Empty => &mut counters.rtcm_empty,
                        ContentError::Truncated { .. } => &mut counters.rtcm_truncated,
                        ContentError::TooManyCells { .. } => &mut counters.rtcm_too_many_cells,
                        ContentError::IllegalValue { .. } => &mut counters.rtcm_illegal_value,
                    });
                    Outcome::Used
                }
            },
            Scanned::Native(frame) => match self.take_native(&frame, counters) {
                Ok(outcome) => outcome,
                Err(_) => {
                    count(&mut counters.native_refused);
                    Outcome::Used
                }
            },
            Scanned::Ubx(frame) => match self.take_ubx(&frame, counters) {
                Ok(outcome) => outcome,
                Err(error) => {
                    count(match error {
                        ubx::PayloadError::WeekUnknown => &mut counters.rawx_without_week,
                        ubx::PayloadError::Length
                        | ubx::PayloadError::Version { .. }
                        | ubx::PayloadError::OutOfRange
                        | ubx::PayloadError::TimeOfWeek { .. } => &mut counters.ubx_refused,
                    });
                    Outcome::Used
                }
            },
        }
    }

    /// Epochs are made from RXM-RAWX from now on; one begun with MSM is dropped.
    fn follow_rawx(&mut self) {
        self.has_observations = true;
        if !self.has_rawx {
            self.has_rawx = true;
            self.is_open = false;
            self.has_time = false;
            self.late = LateEpochs::NONE;
        }
    }

    fn take_ubx(
        &mut self,
        frame: &ubx::Frame<'_>,
        counters: &mut Counters,
    ) -> Result<Outcome, ubx::PayloadError> {
        match frame.message {
            ubx::RXM_RAWX if !frame.payload.is_empty() => {
                self.follow_rawx();
                Ok(self.take_rawx(&Rawx::parse(frame.payload)?, counters))
            }
            // Empty, it asks for the message.
            ubx::NAV_PVT if !frame.payload.is_empty() => {
                if self.has_observations {
                    count(&mut counters.fixes_beside_observations);
                    return Ok(Outcome::Used);
                }
                match receiver_fix(&NavPvt::parse(frame.payload)?) {
                    Ok(fix) => Ok(self.take_fix(&fix, counters)),
                    Err(ubx::PayloadError::WeekUnknown) => {
                        count(&mut counters.fixes_without_date);
                        Ok(Outcome::Used)
                    }
                    Err(error) => Err(error),
                }
            }
            ubx::RXM_SFRBX if !frame.payload.is_empty() => {
                Ok(self.take_subframe(&ubx::sfrbx::parse(frame.payload)?, counters))
            }
            _ => {
                count(&mut counters.ubx_unsupported);
                Ok(Outcome::Used)
            }
        }
    }

    /// A receiver's own solution, which gives an epoch once it is known that no observations come.
    fn take_fix(&mut self, fix: &ReceiverFix, counters: &mut Counters) -> Outcome {
        if self.has_observations {
            count(&mut counters.fixes_beside_observations);
            return Outcome::Used;
        }
        let time = fix.time;
        if self.fixes.last.is_some_and(|last| time <= last) {
            if self.fixes.last == Some(time) || !self.fixes.late.note(time) {
                count(&mut counters.messages_too_late);
                return Outcome::Used;
            }
            count(&mut counters.time_restarts);
        }
        let shift_weeks = self.weeks.learn_epoch(time);
        if let Some(event) = self.week_learnt(shift_weeks) {
            return Outcome::FirstGives(event);
        }
        self.fixes.late = LateEpochs::NONE;
        self.fixes.last = Some(time);
        self.weeks.at_epoch(time);
        let first = *self.fixes.first.get_or_insert(time);
        let waited_ns = time.ns().saturating_sub(first.ns());
        if waited_ns < 0 {
            self.fixes.first = Some(time);
        }
        if waited_ns < NO_OBSERVATIONS_AFTER_NS {
            count(&mut counters.fixes_held_back);
            return Outcome::Used;
        }
        count(&mut counters.fixes_used);
        Outcome::UsedGives(Event::ReceiverFix(*fix))
    }

    fn take_subframe(&mut self, subframe: &Subframe<'_>, counters: &mut Counters) -> Outcome {
        // The frame comes again after an event that its ephemeris waits for: its words are counted once.
        if let Some(broadcast) = self.held.take() {
            return self.take_collected(&broadcast, counters);
        }
        let Collected {
            ephemeris,
            klobuchar,
        } = match self.subframes.take(subframe) {
            Ok(collected) => collected,
            Err(error) => {
                count(match error {
                    SubframeError::Unsupported => &mut counters.subframes_unsupported,
                    SubframeError::Satellite
                    | SubframeError::Length
                    | SubframeError::Parity
                    | SubframeError::Checksum
                    | SubframeError::Preamble
                    | SubframeError::Number
                    | SubframeError::Time
                    | SubframeError::IllegalValue => &mut counters.subframes_refused,
                });
                return Outcome::Used;
            }
        };
        count(&mut counters.subframes_used);
        let klobuchar = klobuchar
            .as_ref()
            .map(convert::klobuchar)
            .map(Event::Klobuchar);
        match (ephemeris, klobuchar) {
            (None, None) => Outcome::Used,
            (None, Some(event)) => Outcome::UsedGives(event),
            (Some(broadcast), None) => self.take_collected(&broadcast, counters),
            (Some(broadcast), Some(event)) => {
                self.held = Some(broadcast);
                Outcome::FirstGives(event)
            }
        }
    }

    fn take_collected(
        &mut self,
        broadcast: &BroadcastEphemeris,
        counters: &mut Counters,
    ) -> Outcome {
        let outcome = self.take_broadcast(broadcast, counters);
        if matches!(outcome, Outcome::FirstGives(_)) {
            self.held = Some(*broadcast);
        }
        outcome
    }

    fn take_rawx(&mut self, rawx: &Rawx<'_>, counters: &mut Counters) -> Outcome {
        let time = convert::ubx_time(rawx);
        let shift_weeks = self.weeks.learn_epoch(time);
        if let Some(event) = self.week_learnt(shift_weeks) {
            return Outcome::FirstGives(event);
        }
        match self.place(time, counters) {
            Place::After => return Outcome::FirstGives(Event::EpochReady),
            Place::Before => return Outcome::Used,
            Place::Inside => {}
        }
        count(&mut counters.rawx_used);
        self.epoch.flags.clock_reset = rawx.clock_reset;
        for measurement in rawx.measurements() {
            match convert::ubx_observation(&measurement) {
                Ok((satellite, observation)) => {
                    if let Err(reason) = self.epoch.add(satellite, observation) {
                        count_not_added(reason, counters);
                    }
                }
                Err(reason) => count_no_observation(reason, counters),
            }
        }
        self.close(counters);
        Outcome::UsedGives(Event::EpochReady)
    }

    fn take_rtcm3(&mut self, message: &Message<'_>, counters: &mut Counters) -> Outcome {
        match message {
            Message::Msm(msm) => self.take_msm(msm, counters),
            Message::MsmHeader(header) => self.take_header(header, counters),
            Message::Ephemeris(broadcast) => self.take_broadcast(broadcast, counters),
            Message::Station(station) => {
                Outcome::UsedGives(Event::StationPosition(station.r_ea_e_m))
            }
            Message::Unsupported { .. } => {
                count(&mut counters.rtcm_unsupported);
                Outcome::Used
            }
            Message::Unknown { .. } => {
                count(&mut counters.rtcm_unknown);
                Outcome::Used
            }
        }
    }

    /// GPST of an MSM's epoch.
    fn time_of(&self, epoch: EpochTime) -> Option<GpsTime> {
        let (ms, offset_s) = match epoch {
            EpochTime::Gpst(ms) => (ms, 0),
            EpochTime::Bdt(ms) => (ms, GPST_MINUS_BDT_S),
            EpochTime::Other => return None,
        };
        let tow_ns = i64::from(ms) * NS_PER_MS + offset_s * NS_PER_S;
        Some(self.weeks.resolve(tow_ns))
    }

    fn take_msm(&mut self, msm: &Msm<'_>, counters: &mut Counters) -> Outcome {
        let header = msm.header();
        let (Some(time), Some(system)) = (
            self.time_of(header.epoch),
            convert::system_of(msm.constellation()),
        ) else {
            return Outcome::Used;
        };
        if self.has_rawx {
            count(&mut counters.observations_of_another_source);
            return Outcome::Used;
        }
        self.has_observations = true;
        // A sender from before the standard gives GPST where BDT belongs. Its time must not be
        // believed, nor may it break the epoch in two.
        let is_bdt = matches!(header.epoch, EpochTime::Bdt(_));
        let ahead_by_offset = self.epoch.time.plus_ns(GPST_MINUS_BDT_S * NS_PER_S);
        if is_bdt && self.is_open && time == ahead_by_offset {
            count(&mut counters.bds_time_contradicted);
            self.epoch.flags.incomplete = true;
            return self.end_unless(header.more_follow, counters);
        }
        match self.place(time, counters) {
            Place::After => return Outcome::FirstGives(Event::EpochReady),
            Place::Before => return Outcome::Used,
            Place::Inside => {}
        }
        count(&mut counters.msm_used);
        let epoch = &mut self.epoch;
        msm.for_each_cell(
            |cell| match convert::observation(system, msm.constellation(), &cell) {
                Ok((satellite, observation)) => {
                    if let Err(reason) = epoch.add(satellite, observation) {
                        count_not_added(reason, counters);
                    }
                }
                Err(reason) => count_no_observation(reason, counters),
            },
        );
        self.end_unless(header.more_follow, counters)
    }

    /// An MSM of which only the header is used: it may be the last of the epoch.
    fn take_header(&mut self, header: &MsmHeader, counters: &mut Counters) -> Outcome {
        count(&mut counters.msm_skipped);
        if !self.is_open {
            return Outcome::Used;
        }
        match self.time_of(header.epoch) {
            Some(time) if time < self.epoch.time => Outcome::Used,
            Some(time) if time > self.epoch.time => {
                self.close_incomplete(counters);
                Outcome::UsedGives(Event::EpochReady)
            }
            // A time that cannot be compared (GLONASS, SBAS, NavIC) is taken for the epoch's.
            _ => self.end_unless(header.more_follow, counters),
        }
    }

    fn end_unless(&mut self, more_follow: bool, counters: &mut Counters) -> Outcome {
        if more_follow {
            Outcome::Used
        } else {
            self.close(counters);
            Outcome::UsedGives(Event::EpochReady)
        }
    }

    /// Where a message of an epoch at `time` belongs; opens the epoch if it is a new one.
    fn place(&mut self, time: GpsTime, counters: &mut Counters) -> Place {
        if self.is_open && time == self.epoch.time {
            self.late = LateEpochs::NONE;
            return Place::Inside;
        }
        if self.has_time && time <= self.epoch.time {
            // A repetition of the last epoch tells nothing about the receiver's clock.
            if time == self.epoch.time || !self.late.note(time) {
                count(&mut counters.messages_too_late);
                return Place::Before;
            }
            if !self.is_open {
                count(&mut counters.time_restarts);
            }
        }
        if self.close_incomplete(counters) {
            return Place::After;
        }
        self.late = LateEpochs::NONE;
        self.epoch.restart(time);
        self.epoch.flags.week_unknown = self.weeks.is_unknown();
        self.is_open = true;
        self.has_time = true;
        self.next_group = 0;
        self.weeks.at_epoch(time);
        Place::Inside
    }

    fn take_broadcast(
        &mut self,
        broadcast: &BroadcastEphemeris,
        counters: &mut Counters,
    ) -> Outcome {
        let Some((satellite, message)) = convert::satellite_of(broadcast) else {
            count(&mut counters.unknown_satellites);
            return Outcome::Used;
        };
        let shift_weeks = convert::learn_week(broadcast, satellite, &mut self.weeks);
        if let Some(event) = self.week_learnt(shift_weeks) {
            return Outcome::FirstGives(event);
        }
        let ephemeris = convert::ephemeris(broadcast, satellite, message, &self.weeks);
        self.count_ephemeris(ephemeris.toe, counters);
        Outcome::UsedGives(Event::Ephemeris(ephemeris))
    }

    fn count_ephemeris(&self, toe: GpsTime, counters: &mut Counters) {
        count(&mut counters.ephemerides);
        if let Some(reference) = self.weeks.reference() {
            let apart_ns = toe.ns().wrapping_sub(reference.ns()).unsigned_abs();
            if apart_ns > NS_PER_WEEK.unsigned_abs() {
                count(&mut counters.ephemerides_of_another_week);
            }
        }
    }

    /// Moves what is held here when the week became known, and says so.
    fn week_learnt(&mut self, shift_weeks: i32) -> Option<Event> {
        self.epoch.flags.week_unknown &= self.weeks.is_unknown();
        if shift_weeks == 0 {
            return None;
        }
        let shift_ns = i64::from(shift_weeks).wrapping_mul(NS_PER_WEEK);
        self.epoch.time = self.epoch.time.plus_ns(shift_ns);
        self.late = LateEpochs::NONE;
        Some(Event::WeekResolved { shift_weeks })
    }

    fn take_native(
        &mut self,
        frame: &Frame<'_>,
        counters: &mut Counters,
    ) -> Result<Outcome, PayloadError> {
        Ok(match frame.kind() {
            Some(Kind::Configuration) => {
                // Whoever takes the event decides whether it counts, and configures then.
                Outcome::UsedGives(Event::Configuration(decode_configuration(frame.payload())?))
            }
            Some(Kind::Observations) => {
                self.take_group(&ObservationGroup::decode(frame.payload())?, counters)
            }
            Some(Kind::Ephemeris) => {
                let ephemeris = decode_ephemeris(frame.payload())?;
                let is_modulo_1024 = ephemeris.message == NavMessage::GpsLnav;
                let shift_weeks = self.weeks.learn_native_ephemeris(
                    ephemeris.satellite,
                    ephemeris.toe,
                    is_modulo_1024,
                );
                if let Some(event) = self.week_learnt(shift_weeks) {
                    return Ok(Outcome::FirstGives(event));
                }
                self.count_ephemeris(ephemeris.toe, counters);
                Outcome::UsedGives(Event::Ephemeris(ephemeris))
            }
            Some(Kind::Klobuchar) => {
                Outcome::UsedGives(Event::Klobuchar(decode_klobuchar(frame.payload())?))
            }
            Some(Kind::EndOfStream) => {
                decode_end_of_stream(frame.payload())?;
                match self.close_next(counters) {
                    Some(event) => Outcome::FirstGives(event),
                    None => Outcome::UsedGives(Event::EndOfStream),
                }
            }
            Some(Kind::Inertial) => {
                Outcome::UsedGives(Event::Inertial(decode_inertial(frame.payload())?))
            }
            Some(Kind::Imu) => {
                let mut sample = decode_imu(frame.payload())?;
                count(&mut counters.imu_samples);
                sample.time = self.weeks.resolve_sample(sample.time);
                Outcome::UsedGives(Event::Imu(sample))
            }
            Some(Kind::Unit) => {
                let (unit, config) = decode_unit(frame.payload())?;
                Outcome::UsedGives(Event::Unit { unit, config })
            }
            Some(Kind::UnitSample) => {
                let (unit, mut sample) = decode_unit_sample(frame.payload())?;
                count(&mut counters.imu_samples);
                sample.sample.time = self.weeks.resolve_sample(sample.sample.time);
                Outcome::UsedGives(Event::UnitSample { unit, sample })
            }
            Some(Kind::Pressure) => {
                let mut sample = decode_pressure(frame.payload())?;
                sample.time = self.weeks.resolve_sample(sample.time);
                Outcome::UsedGives(Event::Pressure(sample))
            }
            Some(Kind::MagneticField) => {
                let mut sample = decode_magnetic_field(frame.payload())?;
                sample.time = self.weeks.resolve_sample(sample.time);
                Outcome::UsedGives(Event::MagneticField(sample))
            }
            Some(Kind::Aids) => Outcome::UsedGives(Event::Aids(decode_aids(frame.payload())?)),
            Some(Kind::ReceiverLatency) => Outcome::UsedGives(Event::ReceiverLatency(
                decode_receiver_latency(frame.payload())?,
            )),
            Some(Kind::Magnetometer) => {
                Outcome::UsedGives(Event::Magnetometer(decode_magnetometer(frame.payload())?))
            }
            Some(Kind::InitialState) => {
                Outcome::UsedGives(Event::InitialState(decode_initial_state(frame.payload())?))
            }
            Some(Kind::CorrectedObservations) => {
                let group = CorrectedGroup::decode(frame.payload())?;
                self.has_observations = true;
                self.corrected.take(&group, counters)
            }
            Some(Kind::ReceiverFix) => {
                self.take_fix(&decode_receiver_fix(frame.payload())?, counters)
            }
            Some(Kind::ReferenceModel) => Outcome::UsedGives(Event::ReferenceModel(
                decode_reference_model(frame.payload())?,
            )),
            Some(
                Kind::Report
                | Kind::Counters
                | Kind::OutputInvalid
                | Kind::Bank
                | Kind::Satellites
                | Kind::InertialReport,
            )
            | None => {
                count(&mut counters.native_unknown_kind);
                Outcome::Used
            }
        })
    }

    fn take_group(&mut self, group: &ObservationGroup<'_>, counters: &mut Counters) -> Outcome {
        self.has_observations = true;
        let time = if group.flags.week_unknown {
            self.weeks.resolve_provisional(group.time)
        } else {
            let shift_weeks = self.weeks.learn_epoch(group.time);
            if let Some(event) = self.week_learnt(shift_weeks) {
                return Outcome::FirstGives(event);
            }
            group.time
        };
        match self.place(time, counters) {
            Place::After => return Outcome::FirstGives(Event::EpochReady),
            Place::Before => return Outcome::Used,
            Place::Inside => {}
        }
        if group.group < self.next_group {
            count(&mut counters.messages_too_late);
            return Outcome::Used;
        }
        let flags = &mut self.epoch.flags;
        flags.incomplete |= group.flags.incomplete || group.group > self.next_group;
        flags.overflow |= group.flags.overflow;
        flags.clock_reset |= group.flags.clock_reset;
        self.next_group = group.group.saturating_add(1);
        group.add_to(&mut self.epoch, |reason| count_not_added(reason, counters));
        self.end_unless(self.next_group < group.groups, counters)
    }
}

fn count_no_observation(reason: NoObservation, counters: &mut Counters) {
    count(match reason {
        NoObservation::UnknownSatellite => &mut counters.unknown_satellites,
        NoObservation::UnknownSignal => &mut counters.unknown_signals,
        NoObservation::InvalidPseudorange => &mut counters.invalid_pseudoranges,
        NoObservation::OtherSystem => &mut counters.observations_of_other_systems,
    });
}

fn count_not_added(reason: NotAdded, counters: &mut Counters) {
    count(match reason {
        NotAdded::SatellitesFull => &mut counters.satellites_lost,
        NotAdded::SignalsFull => &mut counters.signals_lost,
        NotAdded::Duplicate => &mut counters.duplicate_observations,
    });
}
