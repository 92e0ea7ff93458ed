//! From the ring through the monitor to the output: what the `work` task does.

use crate::board::memory::Memory;
use crate::board::{self, stack};
use crate::ring::Ring;
use surefix_core::bank_report::BankReport;
use surefix_core::config::Config;
use surefix_core::integrity::{Integrity, Reason};
use surefix_core::monitor::{Monitor, Ready};
use surefix_core::tight::{BankMemory, MonitorFastFilters, MonitorSecondaries};
use surefix_core::wire::native::MAX_FRAME;
use surefix_core::{ingest, report};

/// Bytes taken from the ring at a time.
const CHUNK: usize = 256;

/// The monitor with its input and output. Its memory is handed in or static.
pub struct Worker {
    monitor: &'static mut Monitor,
    fast: &'static mut MonitorFastFilters,
    secondaries: &'static mut MonitorSecondaries,
    bank: &'static mut BankReport,
    received: &'static Ring<{ board::memory::RECEIVED_CAPACITY }>,
    output: board::Transmitter,
    acknowledge: board::Acknowledge,
    cycles: board::Cycles,
    frame: [u8; MAX_FRAME],
    state: Option<(Integrity, Reason)>,
    lost_logged: u32,
}

impl Worker {
    /// Puts the parts together.
    pub fn new(
        memory: Memory,
        received: &'static Ring<{ board::memory::RECEIVED_CAPACITY }>,
        output: board::Transmitter,
        acknowledge: board::Acknowledge,
        cycles: board::Cycles,
    ) -> Self {
        let Memory {
            monitor,
            fast,
            secondaries,
            bank,
        } = memory;
        // In force until a configuration frame comes before the first epoch.
        if monitor.configure(&Config::PRESET).is_err() {
            defmt::error!("the preset is not legal: every epoch will be unavailable");
        }
        Self {
            monitor,
            fast,
            secondaries,
            bank,
            received,
            output,
            acknowledge,
            cycles,
            frame: [0; MAX_FRAME],
            state: None,
            lost_logged: 0,
        }
    }

    /// Works until the ring is empty.
    pub fn run(&mut self) {
        let mut chunk = [0; CHUNK];
        loop {
            let count = self.received.pop(&mut chunk);
            if count == 0 {
                return;
            }
            let bytes = chunk.get(..count).unwrap_or_default();
            self.take(bytes);
            self.acknowledge.taken(count);
            #[cfg(feature = "slow-worker")]
            cortex_m::asm::delay(2_000_000);
            #[cfg(feature = "deliberate-fault")]
            crate::fault::deliberate::on_request(bytes);
        }
    }

    fn take(&mut self, mut bytes: &[u8]) {
        loop {
            let (used, ready) = self.monitor.push(bytes);
            bytes = bytes.get(used..).unwrap_or_default();
            match ready {
                Some(Ready::Epoch) => self.epoch(),
                Some(Ready::EndOfStream) => self.end(),
                // An epoch may be waiting behind the last byte; nothing ready means there is none.
                None if bytes.is_empty() || used == 0 => return,
                None => {}
            }
        }
    }

    #[inline(never)]
    fn epoch(&mut self) {
        let memory = BankMemory {
            fast: self.fast,
            secondaries: self.secondaries,
        };
        let report = self.monitor.process_with(&mut self.cycles, Some(memory));
        if self.monitor.bank_report(self.bank)
            && let Ok(length) = self.bank.encode(&mut self.frame)
        {
            self.send(length);
        }
        if let Ok(length) = report::encode(&report, &mut self.frame) {
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
    }

    fn send(&mut self, length: usize) {
        self.output
            .send(self.frame.get(..length).unwrap_or_default());
    }
}
