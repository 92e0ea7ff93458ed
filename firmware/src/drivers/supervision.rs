//! Faults in a row, restarts and counters: what all drivers share.
//!
//! ```text
//! Starting --last step done--> Running --FAULTS_IN_A_ROW--> Starting
//!    |                            |
//!    '--a step fails: from its    '--no reading for SILENT_INTERVALS: a fault
//!       first step again, RETRY_NS later
//! ```
//! A start that fails is tried again for ever, once every [`RETRY_NS`]: a part that comes back after an
//! hour is of use. Nothing is read before a start has succeeded whole.

use super::Fault;

/// Calls in a row that failed after which a part is started again.
pub const FAULTS_IN_A_ROW: u8 = 5;
/// A part without a reading for so many of its intervals is silent.
pub const SILENT_INTERVALS: u64 = 4;
/// From a start that failed to the next, ns.
pub const RETRY_NS: u64 = 1_000_000_000;

/// Whether a driver gives readings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Not yet, or not any more: at this step of its start.
    Starting {
        /// The step that is next.
        step: u8,
    },
    /// It does.
    Running,
}

/// What a call has to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Due {
    /// This step of the start.
    Step(u8),
    /// Nothing: the part needs more time for the last step.
    Nothing,
    /// To read, when a reading is ready.
    Reading,
}

/// What the part thinks of a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Soundness {
    /// Nothing against it.
    Sound,
    /// An axis is at the end of its numbers, or the reading could not be confirmed. Says nothing of the
    /// next one.
    Doubtful,
    /// The part says that something of it failed.
    Failing,
}

/// What became of readings and starts. Counts stop at their largest value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct DriverCounters {
    /// Readings given.
    pub readings: u32,
    /// Of these, those that the part does not hold for sound.
    pub invalid: u32,
    /// Readings that the part made and that were not given, by its own counter.
    pub missed: u32,
    /// Errors of the bus.
    pub bus: u32,
    /// Transfers of nothing but ones or nothing but zeros.
    pub stuck: u32,
    /// Transfers whose sum does not match.
    pub checksum: u32,
    /// Readings that came a second time.
    pub repeated: u32,
    /// Readings whose counter moved by other than the time allows: not given.
    pub counter: u32,
    /// Readings that came differently when read again: not given.
    pub unconfirmed: u32,
    /// Transfers that have not the form of a reading.
    pub malformed: u32,
    /// Times that the part had no room.
    pub overrun: u32,
    /// Times without a reading for too long.
    pub silent: u32,
    /// Readings outside the part's range: not given.
    pub out_of_range: u32,
    /// Starts that succeeded.
    pub starts: u32,
    /// Starts at which another part answered, or none.
    pub wrong_identity: u32,
    /// Starts at which the reset did not end.
    pub reset_not_done: u32,
    /// Starts at which the part's test of itself failed.
    pub self_test: u32,
    /// Times that a register or a constant was not as it must be, at a start or while running.
    pub configuration: u32,
}

impl DriverCounters {
    /// Nothing has happened.
    pub const ZERO: Self = Self {
        readings: 0,
        invalid: 0,
        missed: 0,
        bus: 0,
        stuck: 0,
        checksum: 0,
        repeated: 0,
        counter: 0,
        unconfirmed: 0,
        malformed: 0,
        overrun: 0,
        silent: 0,
        out_of_range: 0,
        starts: 0,
        wrong_identity: 0,
        reset_not_done: 0,
        self_test: 0,
        configuration: 0,
    };

    /// The count of a fault.
    fn of(&mut self, fault: Fault) -> &mut u32 {
        match fault {
            Fault::Bus(_) => &mut self.bus,
            Fault::Stuck { .. } => &mut self.stuck,
            Fault::WrongIdentity { .. } => &mut self.wrong_identity,
            Fault::ResetNotDone => &mut self.reset_not_done,
            Fault::SelfTest { .. } => &mut self.self_test,
            Fault::Configuration { .. } => &mut self.configuration,
            Fault::Checksum { .. } => &mut self.checksum,
            Fault::Repeated => &mut self.repeated,
            Fault::Counter { .. } => &mut self.counter,
            Fault::Unconfirmed => &mut self.unconfirmed,
            Fault::Malformed { .. } => &mut self.malformed,
            Fault::Overrun => &mut self.overrun,
            Fault::Silent { .. } => &mut self.silent,
            Fault::OutOfRange => &mut self.out_of_range,
        }
    }
}

/// The state that a driver keeps beside its bus.
#[derive(Clone, Copy, Debug)]
pub struct Supervision {
    phase: Phase,
    /// Nothing is due before, ns.
    next_ns: u64,
    /// When the last reading, or the end of the start, was, ns.
    last_ns: u64,
    interval_ns: u32,
    faults_in_a_row: u8,
    /// Checks of the configuration since the start.
    checks: usize,
    counters: DriverCounters,
}

impl Supervision {
    /// Of a part that is to be started as soon as it is called.
    pub const fn new(interval_ns: u32) -> Self {
        Self {
            phase: Phase::Starting { step: 0 },
            next_ns: 0,
            last_ns: 0,
            interval_ns,
            faults_in_a_row: 0,
            checks: 0,
            counters: DriverCounters::ZERO,
        }
    }

    /// Whether the driver gives readings.
    pub const fn phase(&self) -> Phase {
        self.phase
    }

    /// When the driver must be called at the latest, ns.
    pub const fn next_ns(&self) -> u64 {
        self.next_ns
    }

    /// The counts.
    pub const fn counters(&self) -> DriverCounters {
        self.counters
    }

    /// Interval between readings, ns.
    pub const fn interval_ns(&self) -> u32 {
        self.interval_ns
    }

    /// What is to be done now.
    pub fn due(&self, now_ns: u64) -> Due {
        match self.phase {
            Phase::Starting { step } if now_ns >= self.next_ns => Due::Step(step),
            Phase::Starting { .. } => Due::Nothing,
            Phase::Running => Due::Reading,
        }
    }

    /// A step of the start went well: the next is due after `wait_ns`.
    pub fn step_done(&mut self, now_ns: u64, step: u8, wait_ns: u64) {
        self.phase = Phase::Starting {
            step: step.saturating_add(1),
        };
        self.next_ns = now_ns.saturating_add(wait_ns);
    }

    /// The start has succeeded.
    pub fn started(&mut self, now_ns: u64) {
        self.phase = Phase::Running;
        self.faults_in_a_row = 0;
        self.checks = 0;
        count(&mut self.counters.starts, 1);
        self.heard(now_ns);
    }

    /// A reading is given. A part that says again and again that it failed is started again.
    pub fn reading(&mut self, now_ns: u64, soundness: Soundness, missed: u32) {
        count(&mut self.counters.readings, 1);
        count(&mut self.counters.missed, missed);
        self.heard(now_ns);
        if soundness != Soundness::Sound {
            count(&mut self.counters.invalid, 1);
        }
        if soundness == Soundness::Failing {
            self.again(now_ns);
        } else {
            self.faults_in_a_row = 0;
        }
    }

    /// Counts what went wrong without a reading being lost for it now.
    pub fn note(&mut self, fault: Fault) {
        count(self.counters.of(fault), 1);
    }

    /// The register of a configuration whose turn it is to be read back while running, and what it must hold.
    pub fn to_check<A: Copy, const N: usize>(&self, configuration: &[A; N]) -> A {
        const { assert!(N > 0) };
        configuration[self.checks % N]
    }

    /// It holds what it must: the next one's turn.
    pub fn checked(&mut self) {
        self.checks = self.checks.wrapping_add(1);
    }

    /// Whether no reading came for too long. Each further such span is another fault.
    ///
    /// # Errors
    /// [`Fault::Silent`], not yet counted.
    pub fn check_silence(&self, now_ns: u64) -> Result<(), Fault> {
        if now_ns >= self.next_ns {
            let since_ns = now_ns.saturating_sub(self.last_ns);
            return Err(Fault::Silent { since_ns });
        }
        Ok(())
    }

    /// Counts a fault and decides what follows from it.
    pub fn fault(&mut self, now_ns: u64, fault: Fault) -> Fault {
        self.note(fault);
        match self.phase {
            Phase::Starting { .. } => {
                self.phase = Phase::Starting { step: 0 };
                self.next_ns = now_ns.saturating_add(RETRY_NS);
            }
            Phase::Running => {
                if now_ns >= self.next_ns {
                    self.next_ns = now_ns.saturating_add(self.silence_ns());
                }
                self.again(now_ns);
            }
        }
        fault
    }

    /// One more fault in a row while running.
    fn again(&mut self, now_ns: u64) {
        self.faults_in_a_row = self.faults_in_a_row.saturating_add(1);
        if self.faults_in_a_row >= FAULTS_IN_A_ROW {
            self.phase = Phase::Starting { step: 0 };
            self.next_ns = now_ns;
        }
    }

    fn heard(&mut self, now_ns: u64) {
        self.last_ns = now_ns;
        self.next_ns = now_ns.saturating_add(self.silence_ns());
    }

    fn silence_ns(&self) -> u64 {
        SILENT_INTERVALS.saturating_mul(u64::from(self.interval_ns))
    }
}

fn count(counter: &mut u32, by: u32) {
    *counter = counter.saturating_add(by);
}
