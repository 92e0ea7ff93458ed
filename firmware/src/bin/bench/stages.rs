//! What is measured.

use super::measure::{RUNS, Row, require};
use super::messages;
use super::sky::{self, Random};
use super::subframes;
use core::hint::black_box;
use static_cell::ConstStaticCell;
use surefix_core::budget::{Ledger, NoCounter};
use surefix_core::config::{Config, IonosphereModel, TroposphereModel};
use surefix_core::gnss::solution::SnapshotWorkspace;
use surefix_core::gnss::{BroadcastIonosphere, EphemerisStore, ObservationEpoch, SatelliteSet};
use surefix_core::ingest::{Event, Ingest};
use surefix_core::linalg::LinearModel;
use surefix_core::linalg::qr::WhitenedQr;
use surefix_core::raim::exclusion::{self, ExclusionWorkspace};
use surefix_core::raim::ls::{self, LeastSquaresWorkspace};
use surefix_core::raim::parity;
use surefix_core::raim::slope::Sensitivity;
use surefix_core::raim::thresholds::RaimTable;
use surefix_core::snapshot::SnapshotMonitor;
use surefix_core::wire::broadcast::{Collector, Subframe};

/// Satellites and constellations of the rows.
const SKIES: [(usize, usize); 7] = [(6, 1), (8, 1), (12, 1), (16, 1), (24, 1), (24, 3), (48, 3)];

/// A correction-free configuration, for pseudoranges that hold no atmosphere.
const CONFIG: Config = Config {
    ionosphere: IonosphereModel::None,
    troposphere: TroposphereModel::None,
    mask_rad: 0.1,
    ..Config::PRESET
};

static INGEST: ConstStaticCell<Ingest> = ConstStaticCell::new(Ingest::EMPTY);
static COLLECTOR: ConstStaticCell<Collector> = ConstStaticCell::new(Collector::EMPTY);
static STORE: ConstStaticCell<EphemerisStore> = ConstStaticCell::new(EphemerisStore::EMPTY);
static EPOCH: ConstStaticCell<ObservationEpoch> = ConstStaticCell::new(ObservationEpoch::EMPTY);
static SNAPSHOT: ConstStaticCell<SnapshotWorkspace> =
    ConstStaticCell::new(SnapshotWorkspace::EMPTY);
static MONITOR: ConstStaticCell<SnapshotMonitor> = ConstStaticCell::new(SnapshotMonitor::EMPTY);
static MODEL: ConstStaticCell<LinearModel> = ConstStaticCell::new(LinearModel::EMPTY);
static QR: ConstStaticCell<WhitenedQr> = ConstStaticCell::new(WhitenedQr::EMPTY);
static LS: ConstStaticCell<LeastSquaresWorkspace> =
    ConstStaticCell::new(LeastSquaresWorkspace::EMPTY);
static SENSITIVITY: ConstStaticCell<Sensitivity> = ConstStaticCell::new(Sensitivity::EMPTY);
static EXCLUSION: ConstStaticCell<ExclusionWorkspace> =
    ConstStaticCell::new(ExclusionWorkspace::EMPTY);
static TABLE: ConstStaticCell<RaimTable> = ConstStaticCell::new(RaimTable::EMPTY);

/// Measures every stage and prints its rows. Its frame must not lie below the filter's peers.
#[inline(never)]
pub fn all() {
    decode();
    decode_subframes();
    solution();
    raim();
}

/// From the first byte of a frame to the event it brings.
#[inline(never)]
fn decode() {
    let ingest = INGEST.take();
    ingest.configure(&Config {
        reference_week: Some(2200),
        ..Config::PRESET
    });
    let mut random = Random::new(1);
    let mut bytes = [0; messages::CAPACITY];

    let mut row = Row::new();
    for run in 0..RUNS {
        let length = messages::gps_ephemeris(&mut random, 1 + run as u8, &mut bytes);
        let mut decoded = false;
        row.run(|| {
            let (_, event) = ingest.push(black_box(&bytes[..length]));
            decoded = matches!(event, Event::Ephemeris(_));
        });
        require(decoded, "the ephemeris was refused");
    }
    row.print("decode/ephemeris", None, None);

    let mut tow_ms = 345_600_000;
    for (n, clocks) in SKIES {
        if clocks > 1 {
            continue;
        }
        let mut row = Row::new();
        for _ in 0..RUNS {
            tow_ms += 1000;
            let length = messages::msm7(&mut random, n, tow_ms, &mut bytes);
            let mut used = 0;
            let mut event = Event::Nothing;
            row.run(|| (used, event) = ingest.push(black_box(&bytes[..length])));
            require(
                event == Event::EpochReady && ingest.epoch().satellites.len() == n,
                "the epoch was refused",
            );
        }
        row.print("decode/msm7", Some(n), None);
    }
    decode_ubx(ingest, &mut random);
}

/// The same of a u-blox receiver. By its own time, later than that of the MSM by more than those of one
/// source keep another one silent.
#[inline(never)]
fn decode_ubx(ingest: &mut Ingest, random: &mut Random) {
    let mut bytes = [0; messages::UBX_CAPACITY];
    let mut tow_s = 346_000.996;
    for (n, clocks) in SKIES {
        if clocks > 1 && n < 48 {
            continue;
        }
        let mut row = Row::new();
        for _ in 0..RUNS {
            tow_s += 1.0;
            let length = messages::rawx(random, n, tow_s, &mut bytes);
            let mut event = Event::Nothing;
            row.run(|| (_, event) = ingest.push(black_box(&bytes[..length])));
            require(
                event == Event::EpochReady && ingest.epoch().satellites.len() == n,
                "the epoch was refused",
            );
        }
        row.print("decode/rawx", Some(n), None);
    }
}

/// The subframe or page that completes an ephemeris, of a satellite after another.
#[inline(never)]
fn decode_subframes() {
    let collector = COLLECTOR.take();
    let mut random = Random::new(4);
    let mut words = [0; 40];
    let mut take = |prn: usize, gnss_id: u8, sig_id: u8, words: &[u8], row: Option<&mut Row>| {
        let subframe = Subframe {
            gnss_id,
            sv_id: 1 + prn as u8,
            sig_id,
            words,
        };
        let mut taken = None;
        let mut work = || taken = collector.take(black_box(&subframe)).ok();
        match row {
            Some(row) => row.run(work),
            None => work(),
        }
        require(taken.is_some(), "a subframe was refused");
        taken.is_some_and(|collected| collected.ephemeris.is_some())
    };

    let mut row = Row::new();
    for prn in 0..RUNS {
        let mut given = false;
        for number in 1..=3 {
            subframes::lnav(&mut random, number, &mut words);
            given = take(prn, 0, 0, &words, (number == 3).then_some(&mut row));
        }
        require(given, "an ephemeris is missing");
    }
    row.print("decode/sfrbx_lnav", None, None);

    let mut row = Row::new();
    for prn in 0..RUNS {
        let mut given = false;
        for number in 1..=5 {
            subframes::inav(&mut random, number, 1 + prn as u8, &mut words);
            let page = &words[..subframes::PAGE];
            given = take(prn, 2, 1, page, (number == 5).then_some(&mut row));
        }
        require(given, "an ephemeris is missing");
    }
    row.print("decode/sfrbx_inav", None, None);

    let mut row = Row::new();
    for prn in 0..RUNS {
        let mut given = false;
        for pass in 0..2 {
            // The same content in both passes.
            let mut random = Random::new(5 + prn as u64);
            for number in 1..=3 {
                subframes::d1(&mut random, number, pass, &mut words);
                let is_last = (pass, number) == (1, 3);
                given = take(prn, 3, 0, &words, is_last.then_some(&mut row));
            }
        }
        require(given, "an ephemeris is missing");
    }
    row.print("decode/sfrbx_d1", None, None);
}

/// From an epoch to a position, and the whole monitor of an epoch.
#[inline(never)]
fn solution() {
    let (store, epoch) = (STORE.take(), EPOCH.take());
    let (workspace, monitor) = (SNAPSHOT.take(), MONITOR.take());
    let ionosphere = BroadcastIonosphere::EMPTY;
    let mut configured = false;
    let mut row = Row::new();
    row.run(|| configured = monitor.configure(black_box(&CONFIG)).is_ok());
    require(configured, "the configuration was refused");
    row.print("configure", None, None);
    let mut ledger = Ledger::EMPTY;
    let mut random = Random::new(2);
    for (n, clocks) in SKIES {
        let (mut satellites, mut first, mut next) = (Row::new(), Row::new(), Row::new());
        let (mut whole, mut faulted) = (Row::new(), Row::new());
        for _ in 0..RUNS {
            sky::observed(&mut random, n, clocks, store, epoch);
            require(epoch.satellites.len() == n, "a satellite is missing");
            satellites.run(|| {
                workspace.prepare(black_box(epoch), store, &ionosphere, black_box(&CONFIG));
            });
            let mut solved = 0;
            first.run(|| {
                let solution = workspace.solve(SatelliteSet::EMPTY, black_box(None));
                solved += solution.map_or(0, |solution| solution.used.len());
            });
            next.run(|| {
                let near = sky::RECEIVER_E_M.map(|x| x + 10.0);
                let solution = workspace.solve(SatelliteSet::EMPTY, black_box(Some(near)));
                solved += solution.map_or(0, |solution| solution.used.len());
            });
            require(solved == 2 * n, "a position is missing");
            whole.run(|| {
                black_box(monitor.assess(epoch, store, &ionosphere, &mut ledger, &mut NoCounter));
            });
            let faulty = epoch.satellites.get_mut(n / 2);
            if let Some(signal) = faulty.and_then(|satellite| satellite.signals.first_mut()) {
                signal.pseudorange_m = signal.pseudorange_m.map(|m| m + 300.0);
            }
            faulted.run(|| {
                black_box(monitor.assess(epoch, store, &ionosphere, &mut ledger, &mut NoCounter));
            });
        }
        let unknowns = Some(3 + clocks);
        satellites.print("solution/satellites", Some(n), unknowns);
        first.print("solution/first_fix", Some(n), unknowns);
        next.print("solution/next_fix", Some(n), unknowns);
        whole.print("epoch/total", Some(n), unknowns);
        faulted.print("epoch/with_fault", Some(n), unknowns);
    }
}

/// The tests on a linear model.
#[inline(never)]
fn raim() {
    let (model, qr, table) = (MODEL.take(), QR.take(), TABLE.take());
    let (least_squares, sensitivity, search) = (LS.take(), SENSITIVITY.take(), EXCLUSION.take());
    require(
        table.fill(3.3333e-7, 1e-3).is_ok(),
        "the risks were refused",
    );
    let mut random = Random::new(3);
    for (n, clocks) in SKIES {
        let (mut test, mut with_levels, mut textbook) = (Row::new(), Row::new(), Row::new());
        let mut excluding = Row::new();
        for _ in 0..RUNS {
            sky::model(&mut random, n, clocks, model);
            let mut statistics = [0.0; 2];
            test.run(|| {
                black_box(parity::test(black_box(model), qr).is_ok());
            });
            with_levels.run(|| {
                if let Ok(statistic) = parity::test(black_box(model), qr) {
                    statistics[0] = statistic.sum_of_squares;
                    sensitivity.fill(qr);
                    let lambda = table.sqrt_noncentrality(n - 3 - clocks).unwrap_or_default();
                    black_box(sensitivity.levels(lambda).is_ok());
                }
            });
            textbook.run(|| {
                if let Ok(statistic) = ls::test(black_box(model), least_squares) {
                    statistics[1] = statistic.sum_of_squares;
                }
            });
            let [parity, ls] = statistics;
            require(
                parity > 0.0 && libm::fabs(parity - ls) < 1e-6 * parity,
                "the two tests disagree",
            );
            // One fault far outside the noise: what an alarm costs.
            if let Some(residual_m) = model.residual_m.get_mut(n / 2) {
                *residual_m += 300.0;
            }
            if parity::test(model, qr).is_ok() {
                excluding.run(|| {
                    sensitivity.fill(qr);
                    black_box(exclusion::identify(qr, table, 3, search).is_ok());
                });
            }
        }
        let unknowns = Some(3 + clocks);
        test.print("raim/parity_test", Some(n), unknowns);
        with_levels.print("raim/parity", Some(n), unknowns);
        textbook.print("raim/ls", Some(n), unknowns);
        excluding.print("raim/exclusion", Some(n), unknowns);
    }
}
