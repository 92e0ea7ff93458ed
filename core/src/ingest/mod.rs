//! Checked messages to domain types with units. After this line raw integers do not exist.
//!
//! [`Ingest`] takes bytes and gives [`Event`]s: a configuration, an ephemeris, an epoch put together
//! from its messages, the end of the stream. An epoch is complete when a multiple signal message
//! says that none follows, or a native frame that it is the last; it ends incomplete, and flagged,
//! when a later one begins or the stream ends. Messages of an epoch that is over are dropped and
//! counted. Inertial samples pass between the messages of an epoch and leave it as it is.
//! Corrected epochs are put together by themselves. A receiver's own solutions count only where it sends
//! no observations. Layouts of native payloads: docs/native-frame.md.

mod aiding;
mod assembler;
mod convert;
mod corrected;
mod inertial;
mod latency;
mod magnetometer;
mod payload;
mod receiver_fix;
mod units;
mod week;

use assembler::{Assembler, Outcome};

pub use aiding::{
    UNIT_SAMPLE_FRAME_LENGTH, decode_aids, decode_magnetic_field, decode_pressure,
    decode_unit_sample, encode_aids, encode_magnetic_field, encode_pressure, encode_unit_sample,
};
pub use inertial::{
    CorrectedGroup, IMU_FRAME_LENGTH, MAX_CORRECTED_EPOCH_BYTES, decode_imu, decode_inertial,
    decode_initial_state, decode_reference_model, encode_corrected_epoch, encode_imu,
    encode_inertial, encode_initial_state, encode_reference_model,
};
pub use latency::{decode_receiver_latency, encode_receiver_latency};
pub use magnetometer::{decode_magnetometer, encode_magnetometer};
pub use payload::{
    MAX_EPOCH_BYTES, MAX_WEEK, ObservationGroup, PayloadError, decode_configuration,
    decode_ephemeris, decode_klobuchar, encode_configuration, encode_end_of_stream,
    encode_ephemeris, encode_klobuchar, encode_observations,
};
pub use receiver_fix::{
    RECEIVER_FIX_FRAME_LENGTH, decode_receiver_fix, encode_receiver_fix, receiver_fix,
};

pub use units::{UNIT_FRAME_LENGTH, decode_unit, encode_unit};

use crate::config::Config;
use crate::gnss::{CorrectedEpoch, Ephemeris, KlobucharParameters, ObservationEpoch, ReceiverFix};
use crate::ins::{
    AidsConfig, ImuSample, InertialConfig, InitialState, MagneticSample, Magnetometer,
    PressureSample, ReferenceModel, UnitConfig, UnitSample,
};
use crate::wire::{Counters, Scanner};

/// What bytes turned out to mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// All bytes given were used, and nothing is ready.
    Nothing,
    /// A configuration, checked. It changes nothing here until [`Ingest::configure`] is called with it.
    Configuration(Config),
    /// A broadcast ephemeris.
    Ephemeris(Ephemeris),
    /// Ionosphere parameters of a system.
    Klobuchar(KlobucharParameters),
    /// Position of the station's antenna reference point in ECEF, m.
    StationPosition([f64; 3]),
    /// Every time given before was wrong by this many weeks and is to be moved by them, those of
    /// stored ephemerides too. [`Ingest::epoch`] is moved already.
    WeekResolved {
        /// Weeks to add.
        shift_weeks: i32,
    },
    /// [`Ingest::epoch`] is ready, and stays so until the next call.
    EpochReady,
    /// What is known of the inertial unit, checked.
    Inertial(InertialConfig),
    /// An inertial sample. Its increments may be no numbers.
    Imu(ImuSample),
    /// What is known of the inertial unit of this number, checked.
    Unit {
        /// Number of the unit, below [`crate::ins::MAX_UNITS`].
        unit: u8,
        /// What is known of it.
        config: UnitConfig,
    },
    /// A sample of the inertial unit of this number. Its increments may be no numbers.
    UnitSample {
        /// Number of the unit, below [`crate::ins::MAX_UNITS`].
        unit: u8,
        /// The sample.
        sample: UnitSample,
    },
    /// The aids there are, checked.
    Aids(AidsConfig),
    /// A sample of a barometer.
    Pressure(PressureSample),
    /// A sample of a magnetometer.
    MagneticField(MagneticSample),
    /// How long after its instant an epoch arrives at the least, ns.
    ReceiverLatency(u32),
    /// What is known of a magnetometer, checked.
    Magnetometer(Magnetometer),
    /// A state to start from.
    InitialState(InitialState),
    /// The requirements of a scenario, to be run by the reference model.
    ReferenceModel(ReferenceModel),
    /// The receiver's own solution, of a receiver that sends no observations.
    ReceiverFix(ReceiverFix),
    /// [`Ingest::corrected_epoch`] is ready, and stays so until the next call.
    CorrectedEpochReady,
    /// The stream ended.
    EndOfStream,
}

/// Bytes to events: scanner, epoch assembler, week and counters. About 30 kB; lives in a static.
#[derive(Clone, Debug)]
pub struct Ingest {
    scanner: Scanner,
    assembler: Assembler,
    counters: Counters,
}

impl Ingest {
    /// Nothing received.
    pub const EMPTY: Self = Self {
        scanner: Scanner::EMPTY,
        assembler: Assembler::EMPTY,
        counters: Counters::ZERO,
    };

    /// Takes bytes until something happened or all are used; tells how many were used and what
    /// happened. To be called again with the rest until the answer is [`Event::Nothing`].
    pub fn push(&mut self, bytes: &[u8]) -> (usize, Event) {
        let mut used: usize = 0;
        // Each turn ends or uses a byte at least, so there are no more turns than bytes.
        loop {
            let event = self.next_event();
            let rest = bytes.get(used..).unwrap_or(&[]);
            if !matches!(event, Event::Nothing) || rest.is_empty() {
                return (used, event);
            }
            let fed = self.scanner.feed(rest);
            if fed == 0 {
                return (used, Event::Nothing);
            }
            used = used.saturating_add(fed);
        }
    }

    /// No more bytes will come: gives what is still to happen, one event per call, and
    /// [`Event::EndOfStream`] at last.
    pub fn finish(&mut self) -> Event {
        self.scanner.end();
        match self.next_event() {
            Event::Nothing => match self.assembler.close_next(&mut self.counters) {
                Some(event) => event,
                None => Event::EndOfStream,
            },
            event => event,
        }
    }

    /// The epoch that [`Event::EpochReady`] announced.
    pub const fn epoch(&self) -> &ObservationEpoch {
        self.assembler.epoch()
    }

    /// The epoch that [`Event::CorrectedEpochReady`] announced.
    pub const fn corrected_epoch(&self) -> &CorrectedEpoch {
        self.assembler.corrected_epoch()
    }

    /// Whether a group of [`Ingest::corrected_epoch`] did not arrive.
    pub const fn corrected_is_incomplete(&self) -> bool {
        self.assembler.corrected_is_incomplete()
    }

    /// What arrived and what was lost.
    pub const fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Bytes taken from which nothing has followed yet: the frame that is not complete.
    pub fn bytes_in_hand(&self) -> usize {
        self.scanner.bytes_in_hand()
    }

    /// Tells the week the user gave.
    pub fn configure(&mut self, config: &Config) {
        self.assembler.configure(config.reference_week);
    }

    fn next_event(&mut self) -> Event {
        while self.scanner.find(&mut self.counters) {
            let Some(frame) = self.scanner.frame() else {
                self.scanner.release();
                continue;
            };
            match self.assembler.take(frame, &mut self.counters) {
                Outcome::Used => self.scanner.release(),
                Outcome::UsedGives(event) => {
                    self.scanner.release();
                    return event;
                }
                // The same frame comes again, after what it brought to an end was taken.
                Outcome::FirstGives(event) => return event,
            }
        }
        Event::Nothing
    }
}
