//! `ingest`, `report`, `snapshot`, `monitor`.

use crate::call::{call1, call2, call3};
use core::hint::black_box;
use surefix_core::budget::{CycleCounter, Ledger, NoCounter};
use surefix_core::config::Config;
use surefix_core::gnss::{
    BroadcastIonosphere, EphemerisStore, KlobucharParameters, ObservationEpoch,
};
use surefix_core::ingest::{self, Ingest, ObservationGroup};
use surefix_core::monitor::Monitor;
use surefix_core::report::{self, ReportFlags};
use surefix_core::snapshot::SnapshotMonitor;

pub fn all(ephemeris: &surefix_core::gnss::Ephemeris, parameters: &KlobucharParameters) {
    let bytes: &[u8] = &[0; 64];
    let mut out = [0; 1100];
    let mut epoch = ObservationEpoch::EMPTY;

    call2(ingest::encode_observations, &epoch, &mut out);
    call2(ingest::encode_ephemeris, ephemeris, &mut out);
    call2(ingest::encode_klobuchar, parameters, &mut out);
    call2(ingest::encode_configuration, &Config::PRESET, &mut out);
    call1(ingest::encode_end_of_stream, &mut out);
    call1(ingest::decode_ephemeris, bytes);
    call1(ingest::decode_klobuchar, bytes);
    call1(ingest::decode_configuration, bytes);
    call1(ObservationGroup::decode, bytes);
    if let Ok(group) = ObservationGroup::decode(black_box(bytes)) {
        let refused = |why| {
            black_box(why);
        };
        call3(ObservationGroup::add_to, &group, &mut epoch, refused);
    }

    let mut ingest = Ingest::EMPTY;
    call2(Ingest::configure, &mut ingest, &Config::PRESET);
    call2(Ingest::push, &mut ingest, bytes);
    call1(Ingest::finish, &mut ingest);
    call1(Ingest::epoch, &ingest);
    call1(Ingest::counters, &ingest);

    snapshot(&epoch);
    monitor(bytes, &mut out);
    call1(ReportFlags::bits, ReportFlags::default());
    call1(ReportFlags::from_bits, 0);
    call1(report::decode, bytes);
    call1(CycleCounter::now, &mut NoCounter);
}

fn snapshot(epoch: &ObservationEpoch) {
    let mut monitor = SnapshotMonitor::EMPTY;
    let (store, ionosphere) = (EphemerisStore::EMPTY, BroadcastIonosphere::EMPTY);
    let mut ledger = Ledger::EMPTY;
    call2(SnapshotMonitor::configure, &mut monitor, &Config::PRESET);
    call1(SnapshotMonitor::config, &monitor);
    call1(SnapshotMonitor::workspace, &monitor);
    black_box(SnapshotMonitor::assess(
        black_box(&mut monitor),
        black_box(epoch),
        black_box(&store),
        black_box(&ionosphere),
        black_box(&mut ledger),
        &mut NoCounter,
    ));
}

fn monitor(bytes: &[u8], out: &mut [u8]) {
    let mut monitor = Monitor::EMPTY;
    call2(Monitor::configure, &mut monitor, &Config::PRESET);
    call2(Monitor::push, &mut monitor, bytes);
    call1(Monitor::finish, &mut monitor);
    call1(Monitor::counters, &monitor);
    call1(Monitor::ledger, &monitor);
    call1(Monitor::refused_configurations, &monitor);
    call1(Monitor::store, &monitor);
    let report = Monitor::process(black_box(&mut monitor), &mut NoCounter);
    call2(report::encode, &report, out);
}
