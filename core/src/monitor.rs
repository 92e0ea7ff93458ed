//! The façade: bytes in, one report per epoch out. Owns all state.
//!
//! ```text
//! bytes ─ push() ─► ingest ─► ephemerides, ionosphere, ObservationEpoch
//!                                   │ Ready::Epoch
//!                     process() ◄───┘  snapshot monitor
//!                         └─► EpochReport
//! ```
//!
//! A `Monitor` is large (see `cargo xtask bench`): it lives in a `static` made from
//! [`Monitor::EMPTY`] and is configured in place.

use crate::budget::{CycleCounter, Ledger};
use crate::config::Config;
use crate::gnss::{BroadcastIonosphere, EphemerisStore};
use crate::ingest::{Event, Ingest};
use crate::integrity::{
    InertialStatus, Integrity, Mode, NoBound, ProtectionLevel, Reason, Verdict,
};
use crate::report::{EpochReport, Fix, ReportFlags};
use crate::snapshot::{Assessment, ConfigureError, SnapshotMonitor};
use crate::time::{GpsTime, NS_PER_WEEK};
use crate::wire::Counters;

/// What [`Monitor::push`] stopped for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ready {
    /// An observation epoch is complete: call [`Monitor::process`].
    Epoch,
    /// The sender says that no more bytes come.
    EndOfStream,
}

/// All state of surefix.
pub struct Monitor {
    ingest: Ingest,
    store: EphemerisStore,
    ionosphere: BroadcastIonosphere,
    snapshot: SnapshotMonitor,
    ledger: Ledger,
    first_epoch: Option<GpsTime>,
    refused_configurations: u32,
}

impl Monitor {
    /// Nothing configured, nothing received.
    pub const EMPTY: Self = Self {
        ingest: Ingest::EMPTY,
        store: EphemerisStore::EMPTY,
        ionosphere: BroadcastIonosphere::EMPTY,
        snapshot: SnapshotMonitor::EMPTY,
        ledger: Ledger::EMPTY,
        first_epoch: None,
        refused_configurations: 0,
    };

    /// Sets what a user chooses. A configuration frame in the stream does the same, until the first
    /// epoch; after it, a stream cannot change the configuration.
    ///
    /// # Errors
    /// [`ConfigureError`]; every epoch is then `unavailable` with
    /// [`crate::integrity::Reason::NotConfigured`].
    pub fn configure(&mut self, config: &Config) -> Result<(), ConfigureError> {
        self.snapshot.configure(config)?;
        self.ingest.configure(config);
        Ok(())
    }

    /// Takes bytes of the receiver until something is ready or all are used; tells how many were
    /// used. Call again with the rest.
    #[inline(never)]
    pub fn push(&mut self, bytes: &[u8]) -> (usize, Option<Ready>) {
        let mut used: usize = 0;
        // Every turn uses a byte or takes an event, of which one byte brings two at the most.
        loop {
            let rest = bytes.get(used..).unwrap_or(&[]);
            let (taken, event) = self.ingest.push(rest);
            used = used.saturating_add(taken);
            if event == Event::Nothing {
                return (used, None);
            }
            if let Some(ready) = self.take(event) {
                return (used, Some(ready));
            }
        }
    }

    /// No more bytes will come: gives an epoch that waited for more, then [`Ready::EndOfStream`].
    pub fn finish(&mut self) -> Ready {
        // One unfinished frame can bring a few events before the end; none brings a hundred.
        for _ in 0..100 {
            let event = self.ingest.finish();
            if let Some(ready) = self.take(event) {
                return ready;
            }
        }
        Ready::EndOfStream
    }

    fn take(&mut self, event: Event) -> Option<Ready> {
        match event {
            Event::Nothing
            | Event::StationPosition(_)
            | Event::Inertial(_)
            | Event::Imu(_)
            | Event::InitialState(_)
            | Event::ReferenceModel(_)
            | Event::CorrectedEpochReady => None,
            Event::Configuration(config) => {
                if self.first_epoch.is_some() || self.configure(&config).is_err() {
                    self.refused_configurations = self.refused_configurations.saturating_add(1);
                }
                None
            }
            Event::Ephemeris(ephemeris) => {
                // What is no orbit leaves its satellite without an ephemeris, a counted reason.
                let _ = self.store.insert(&ephemeris);
                None
            }
            Event::Klobuchar(parameters) => {
                self.ionosphere.insert(parameters);
                None
            }
            Event::WeekResolved { shift_weeks } => {
                self.store.shift_weeks(shift_weeks);
                let shift_ns = i64::from(shift_weeks).wrapping_mul(NS_PER_WEEK);
                self.first_epoch = self.first_epoch.map(|time| time.plus_ns(shift_ns));
                None
            }
            Event::EpochReady => Some(Ready::Epoch),
            Event::EndOfStream => Some(Ready::EndOfStream),
        }
    }

    /// Assesses the epoch that [`Ready::Epoch`] announced.
    #[inline(never)]
    pub fn process(&mut self, counter: &mut impl CycleCounter) -> EpochReport {
        let epoch = self.ingest.epoch();
        let first_epoch = *self.first_epoch.get_or_insert(epoch.time);
        self.ledger.begin_epoch();
        let mut assessment = self.snapshot.assess(
            epoch,
            &self.store,
            &self.ionosphere,
            &mut self.ledger,
            counter,
        );
        if !self.ledger.end_epoch() {
            withdraw(&mut assessment.verdict);
        }
        report_of(epoch, first_epoch, &assessment)
    }

    /// What arrived, what was lost, and why.
    pub const fn counters(&self) -> &Counters {
        self.ingest.counters()
    }

    /// What the stages of the epochs cost.
    pub const fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// Configuration frames that came after the first epoch or were not legal.
    pub const fn refused_configurations(&self) -> u32 {
        self.refused_configurations
    }

    /// Ephemerides held.
    pub const fn store(&self) -> &EphemerisStore {
        &self.store
    }
}

/// Takes back what came too late: levels that are not in time bound nothing. A fault that was found
/// stays an alert, with its own reason.
fn withdraw(verdict: &mut Verdict) {
    verdict.hpl = ProtectionLevel::Unavailable(NoBound::DeadlineMissed);
    verdict.vpl = ProtectionLevel::Unavailable(NoBound::DeadlineMissed);
    if verdict.integrity != Integrity::Alert {
        verdict.integrity = Integrity::Unavailable;
        verdict.reason = Reason::DeadlineMissed;
    }
}

fn report_of(
    epoch: &crate::gnss::ObservationEpoch,
    first_epoch: GpsTime,
    assessment: &Assessment,
) -> EpochReport {
    let fix = assessment.solution.map(|solution| Fix {
        r_e_m: solution.r_e_m,
        lat_deg: solution.llh.lat_rad.to_degrees(),
        lon_deg: solution.llh.lon_rad.to_degrees(),
        h_m: solution.llh.height_m,
        velocity_enu_mps: solution.velocity_enu_mps,
        clock_m: solution.clock_m,
    });
    EpochReport {
        time: epoch.time,
        since_first_ns: epoch.time.ns().wrapping_sub(first_epoch.ns()),
        mode: if fix.is_some() {
            Mode::Snapshot
        } else {
            Mode::None
        },
        fix,
        verdict: assessment.verdict,
        used: assessment
            .solution
            .map_or(crate::gnss::SatelliteSet::EMPTY, |solution| solution.used),
        n_observed: assessment.n_observed,
        unused: assessment.unused,
        flags: ReportFlags {
            incomplete: epoch.flags.incomplete,
            overflow: epoch.flags.overflow,
            week_unknown: epoch.flags.week_unknown,
            no_broadcast_ionosphere: assessment
                .solution
                .is_some_and(|solution| solution.no_broadcast_ionosphere),
            clock_reset: epoch.flags.clock_reset,
        },
        navigation: None,
        inertial: InertialStatus::Off,
    }
}
