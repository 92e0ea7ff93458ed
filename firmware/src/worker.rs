//! From the ring through the monitor to the output: what the `work` task does.

use crate::board::memory::{ARRIVED, Memory, RECEIVED};
use crate::board::{self, stack};
use crate::ring::Ring;
#[cfg(feature = "sensors")]
use crate::samples::{self, Samples, Timed};
use crate::sensors::{self, Next};
use core::sync::atomic::{AtomicBool, Ordering};
use surefix_core::bank_report::BankReport;
use surefix_core::config::Config;
use surefix_core::integrity::{Integrity, Reason};
use surefix_core::monitor::{Monitor, Ready};
use surefix_core::report::REPORT_FRAME_LENGTH;
use surefix_core::satellite_report::SatelliteReport;
use surefix_core::sentences::{self, MAX_SENTENCES_BYTES};
use surefix_core::tight::{BankMemory, MonitorFastFilters, MonitorSecondaries};
use surefix_core::time::GpsTime;
use surefix_core::wire::native::MAX_FRAME;
use surefix_core::{ingest, report};

/// Bytes taken from the ring at a time.
const CHUNK: usize = 256;

/// Taken for the interval between two epochs until the receiver has shown its own, ns.
const SHORTEST_INTERVAL_NS: i64 = 100_000_000;

/// The monitor with its input and output. Its memory is handed in or static.
pub struct Worker {
    monitor: &'static mut Monitor,
    fast: &'static mut MonitorFastFilters,
    secondaries: &'static mut MonitorSecondaries,
    bank: &'static mut BankReport,
    satellites: &'static mut SatelliteReport,
    received: &'static Ring<{ board::memory::RECEIVED_CAPACITY }>,
    #[cfg(feature = "sensors")]
    samples: Samples,
    #[cfg(feature = "spi-bridge")]
    recording: &'static mut crate::recording::Recording,
    output: board::Transmitter,
    acknowledge: board::Acknowledge,
    cycles: board::Cycles,
    frame: [u8; MAX_FRAME],
    state: Option<(Integrity, Reason)>,
    lost_logged: u32,
    /// Bytes taken by the monitor, modulo 2³².
    taken: u32,
    /// Interval between two epochs, ns.
    interval_ns: Option<i64>,
    /// GNSS time by the board's clock, and where its ticks stood then; `None` before the first epoch.
    clock: Option<(GpsTime, u32)>,
    #[cfg(feature = "real-time")]
    observed: Observed,
}

/// In the receiver's interrupt: takes what has come.
pub fn receive(receiver: &mut board::Receiver) {
    if receiver.overrun() {
        RECEIVED.add_lost(1);
    }
    while let Some(byte) = receiver.take() {
        ARRIVED.note(RECEIVED.written(), RECEIVED.is_empty(), board::ticks);
        RECEIVED.push(byte);
    }
}

/// The board's clock has gone on, and the worker shall look at it.
static LISTEN: AtomicBool = AtomicBool::new(false);

/// In the interrupt of the system timer.
pub fn listen() {
    LISTEN.store(true, Ordering::Relaxed);
}

/// When there is nothing else to do: sends the log, sleeps.
pub fn idle() -> ! {
    let mut log_sender = board::log::LogSender::start();
    loop {
        log_sender.drain();
        #[cfg(feature = "real-time")]
        if has_ended() {
            cortex_m::peripheral::SCB::sys_reset();
        }
        // With interrupts masked one that comes after the check still ends the sleep.
        cortex_m::interrupt::free(|_| {
            if board::log::is_empty() {
                cortex_m::asm::wfi();
            }
        });
    }
}

/// What is told at the end of a run in real time.
#[cfg(feature = "real-time")]
#[derive(Default)]
struct Observed {
    /// Ticks spent in [`Worker::run`].
    busy: u64,
    /// Most bytes that waited in the ring.
    most_waiting: u32,
    /// The stream has ended, and that was not told yet.
    is_over: bool,
}

/// Whether the stream has ended and all was told.
#[cfg(feature = "real-time")]
static ENDED: AtomicBool = AtomicBool::new(false);

/// Whether the stream has ended and all but the log has been sent.
#[cfg(feature = "real-time")]
pub fn has_ended() -> bool {
    ENDED.load(Ordering::Relaxed)
}

const _: () = assert!(MAX_SENTENCES_BYTES <= MAX_FRAME);

impl Worker {
    /// Puts the parts together.
    pub fn new(
        memory: Memory,
        received: &'static Ring<{ board::memory::RECEIVED_CAPACITY }>,
        #[cfg(feature = "sensors")] samples: Samples,
        output: board::Transmitter,
        acknowledge: board::Acknowledge,
        cycles: board::Cycles,
    ) -> Self {
        let Memory {
            monitor,
            fast,
            secondaries,
            bank,
            satellites,
            #[cfg(feature = "spi-bridge")]
            recording,
        } = memory;
        #[cfg(feature = "spi-bridge")]
        recording.start(board::recording());
        // In force until a configuration frame comes before the first epoch.
        if monitor.configure(&Config::PRESET).is_err() {
            defmt::error!("the preset is not legal: every epoch will be unavailable");
        }
        Self {
            monitor,
            fast,
            secondaries,
            bank,
            satellites,
            received,
            #[cfg(feature = "sensors")]
            samples,
            #[cfg(feature = "spi-bridge")]
            recording,
            output,
            acknowledge,
            cycles,
            frame: [0; MAX_FRAME],
            state: None,
            lost_logged: 0,
            taken: 0,
            interval_ns: None,
            clock: None,
            #[cfg(feature = "real-time")]
            observed: Observed::default(),
        }
    }

    /// Works until there is nothing to take.
    pub fn run(&mut self) {
        #[cfg(feature = "real-time")]
        let begin = board::ticks();
        self.work();
        #[cfg(feature = "real-time")]
        {
            self.observed.busy += u64::from(board::ticks().wrapping_sub(begin));
        }
    }

    fn work(&mut self) {
        let mut chunk = [0; CHUNK];
        loop {
            #[cfg(feature = "real-time")]
            {
                let waiting = self.received.waiting();
                self.observed.most_waiting = self.observed.most_waiting.max(waiting);
            }
            let most = match self.next() {
                Next::Nothing if LISTEN.swap(false, Ordering::Relaxed) => {
                    self.hear_nothing();
                    return;
                }
                Next::Nothing => return,
                Next::Bytes(most) => most.min(CHUNK),
                Next::Arrival => {
                    #[cfg(feature = "sensors")]
                    self.sample();
                    continue;
                }
            };
            let count = self.received.pop(chunk.get_mut(..most).unwrap_or_default());
            let bytes = chunk.get(..count).unwrap_or_default();
            self.take(bytes);
            #[cfg(feature = "spi-bridge")]
            self.recording.bytes(bytes, self.monitor.bytes_in_hand());
            #[cfg(feature = "real-time")]
            if core::mem::take(&mut self.observed.is_over) {
                self.tell_all();
            }
            self.acknowledge.taken(count);
            #[cfg(feature = "slow-worker")]
            cortex_m::asm::delay(2_000_000);
            #[cfg(feature = "deliberate-fault")]
            crate::fault::deliberate::on_request(bytes);
        }
    }

    /// Bytes of the receiver or a sample, whichever came first.
    fn next(&mut self) -> Next {
        let (taken, written) = (self.received.taken(), self.received.written());
        #[cfg(feature = "sensors")]
        let arrival = self.samples.first_place();
        #[cfg(not(feature = "sensors"))]
        let arrival = None;
        sensors::next(taken, written, arrival)
    }

    #[cfg(feature = "sensors")]
    fn sample(&mut self) {
        let ready = match self.samples.take() {
            None => return,
            Some(Timed::Unit(unit, sample, ready_ns)) => {
                #[cfg(feature = "spi-bridge")]
                self.recording.unit(unit, &sample);
                let ready = self.monitor.on_unit_sample(unit, &sample);
                ready.map(|ready| (ready, ready_ns))
            }
            Some(Timed::Pressure(sample)) => {
                #[cfg(feature = "spi-bridge")]
                self.recording.pressure(&sample);
                self.monitor.on_pressure(&sample);
                None
            }
            Some(Timed::MagneticField(sample)) => {
                #[cfg(feature = "spi-bridge")]
                self.recording.magnetic_field(&sample);
                self.monitor.on_magnetic_field(&sample);
                None
            }
        };
        // A sample can show that an epoch is overdue.
        if let Some((Ready::Epoch, ready_ns)) = ready {
            self.epoch(samples::ticks_at(ready_ns));
        }
    }

    /// With all taken that came: whether an epoch is overdue by the board's own clock. The last epoch set it, at
    /// its last byte, so that it is behind by what the receiver took to send it; a fast crystal takes a few parts in a million of
    /// the silence from that.
    fn hear_nothing(&mut self) {
        let (Some(rate), Some((time, then))) = (board::ticks_per_second(), self.clock) else {
            return;
        };
        let ticks = board::ticks();
        // Asked for much more often than the ticks wrap.
        let since = i64::from(ticks.wrapping_sub(then));
        let now = time.plus_ns(since * 1_000_000_000 / i64::from(rate.max(1)));
        self.clock = Some((now, ticks));
        if let Some(Ready::Epoch) = self.monitor.tick(now) {
            self.epoch(ticks);
        }
    }

    fn take(&mut self, mut bytes: &[u8]) {
        loop {
            let (used, ready) = self.monitor.push(bytes);
            bytes = bytes.get(used..).unwrap_or_default();
            self.taken = self.taken.wrapping_add(used as u32);
            match ready {
                // The last byte that the monitor took completed the epoch.
                Some(Ready::Epoch) => self.epoch(ARRIVED.time_of(self.taken.wrapping_sub(1))),
                Some(Ready::EndOfStream) => self.end(),
                // An epoch may be waiting behind the last byte; nothing ready means there is none.
                None if bytes.is_empty() || used == 0 => return,
                None => {}
            }
        }
    }

    /// Whether a report on an epoch whose bytes came then, sent from now on, would be there only when the
    /// next epoch is. Never where no time is kept.
    fn is_overdue(&mut self, came: u32) -> bool {
        let Some(rate) = board::ticks_per_second() else {
            return false;
        };
        // What the bytes and the answer take on their lines, or wait there.
        let answer = (REPORT_FRAME_LENGTH + MAX_SENTENCES_BYTES) as i64;
        let bytes = answer + i64::from(board::RECEIVE_DELAY);
        let rate = i64::from(rate);
        // The shortest that was ever known: epochs that were lost are no slower receiver.
        let known_ns = self.monitor.epoch_interval_ns();
        self.interval_ns = match (self.interval_ns, known_ns) {
            (Some(before), Some(now)) => Some(before.min(now)),
            (before, now) => before.or(now),
        };
        let interval_ns = self.interval_ns.unwrap_or(SHORTEST_INTERVAL_NS);
        let interval = rate * interval_ns / 1_000_000_000;
        let on_lines = rate * 10 * bytes / i64::from(board::BAUD);
        i64::from(board::ticks().wrapping_sub(came)) > interval - on_lines
    }

    /// An epoch is ready since the ticks stood at `came`.
    #[inline(never)]
    fn epoch(&mut self, came: u32) {
        #[cfg(feature = "real-time")]
        let begin = board::ticks();
        let memory = BankMemory {
            fast: self.fast,
            secondaries: self.secondaries,
        };
        let mut report =
            board::undisturbed(|| self.monitor.process_with(&mut self.cycles, Some(memory)));
        // Not one that was missed.
        if report.n_observed > 0 {
            self.clock = Some((report.time, came));
        }
        #[cfg(feature = "sensors")]
        // One that ended incomplete was ended by the next, a second later.
        if report.n_observed > 0 && !report.flags.incomplete {
            self.samples.epoch(report.time, samples::at_ticks(came));
        }
        if self.monitor.bank_report(self.bank)
            && let Ok(length) = self.bank.encode(&mut self.frame)
        {
            self.send(length);
        }
        if self.is_overdue(came) {
            self.monitor.miss_deadline(&mut report);
        }
        if let Ok(length) = report::encode(&report, &mut self.frame) {
            self.send(length);
        }
        if let Ok(length) = sentences::encode(&report, &mut self.frame) {
            self.send(length);
        }
        #[cfg(feature = "real-time")]
        self.acknowledge
            .tell(b'E', &[self.taken, came, begin, board::ticks()]);
        // Last: nobody waits for them.
        if let Some(inertial) = self.monitor.inertial_report(&report)
            && let Ok(length) = inertial.encode(&mut self.frame)
        {
            self.send(length);
        }
        if self.monitor.satellite_report(&report, self.satellites)
            && let Ok(length) = self.satellites.encode(&mut self.frame)
        {
            self.send(length);
        }
        let state = (report.verdict.integrity, report.verdict.reason);
        if self.state != Some(state) {
            self.state = Some(state);
            let tow_s = report.time.tow_ns() / 1_000_000_000;
            defmt::info!("{=i64} s of week: {}, {}", tow_s, state.0, state.1);
        }
        let lost = self.received.lost();
        if lost != self.lost_logged {
            self.lost_logged = lost;
            defmt::warn!("the ring was full: {=u32} bytes lost so far", lost);
        }
    }

    #[inline(never)]
    fn end(&mut self) {
        // What comes after the end is no silence.
        self.clock = None;
        let mut counters = self.monitor.counters();
        counters.receiver_bytes_lost = self.received.lost();
        if let Ok(length) = counters.encode(&mut self.frame) {
            self.send(length);
        }
        if let Ok(length) = ingest::encode_end_of_stream(&mut self.frame) {
            self.send(length);
        }
        defmt::info!(
            "end of stream: {=u32} epochs, most instructions per stage {}, stack {=usize} bytes",
            counters.epochs,
            self.monitor.ledger().worst(),
            stack::peak_bytes()
        );
        #[cfg(feature = "real-time")]
        {
            self.observed.is_over = true;
        }
    }

    /// What a run in real time was like, and that it is over.
    #[cfg(feature = "real-time")]
    fn tell_all(&mut self) {
        let ledger = self.monitor.ledger();
        self.acknowledge.tell(b'W', &ledger.worst());
        let Observed {
            busy, most_waiting, ..
        } = self.observed;
        let numbers = [
            ledger.deadline_misses(),
            stack::peak_bytes() as u32,
            most_waiting,
            busy as u32,
            (busy >> 32) as u32,
        ];
        #[cfg(feature = "sensors")]
        self.tell_sensors();
        self.acknowledge.tell(b'T', &numbers);
        ENDED.store(true, Ordering::Relaxed);
    }

    /// What became of the lines, the time and the units.
    #[cfg(all(feature = "sensors", feature = "real-time"))]
    fn tell_sensors(&mut self) {
        let (edges, arrivals) = samples::LOST.counts();
        let clock = self.samples.clock();
        #[cfg(feature = "spi-bridge")]
        let is_recorded = self.recording.finish();
        #[cfg(not(feature = "spi-bridge"))]
        let is_recorded = false;
        let numbers = [
            edges,
            arrivals,
            self.samples.most_waiting(),
            u32::from(is_recorded),
            clock.pulses,
            clock.missing,
            clock.refused,
            clock.restarts,
            clock.contradicted,
            clock.numbered,
            clock.held_over,
            clock.without_time,
        ];
        self.acknowledge.tell(b'S', &numbers);
        let units = cortex_m::interrupt::free(|token| samples::UNITS.borrow(token).get());
        for (unit, state) in units.iter().enumerate() {
            let Some((phase, counters)) = state else {
                continue;
            };
            let is_running = *phase == crate::drivers::Phase::Running;
            let numbers = [
                unit as u32,
                u32::from(is_running),
                counters.readings,
                counters.invalid,
                counters.missed,
                counters.silent,
                counters.starts,
            ];
            self.acknowledge.tell(b'U', &numbers);
        }
    }

    fn send(&mut self, length: usize) {
        self.output
            .send(self.frame.get(..length).unwrap_or_default());
    }
}
