//! Epochs of a recording as a monitor of one epoch takes them: linearised at their own solution.
//!
//! In: what a recording holds, item by item. Out: of each epoch its rows with satellite, direction and sigmas, the
//! point they were linearised at, and the range rates of the same satellites. The sigmas of the model are those of the independent errors, as the product's
//! own snapshot weights its rows; the whole error of a row is in its [`UsedRow::sigma`].

use surefix_core::config::Config;
use surefix_core::gnss::solution::{RangeRates, SnapshotError, SnapshotWorkspace, UsedRow};
use surefix_core::gnss::{BroadcastIonosphere, EphemerisStore, Satellite, SatelliteSet};
use surefix_core::linalg::LinearModel;
use surefix_core::time::{GpsTime, NS_PER_S};

use crate::source::Item;
use crate::truth::Truth;

/// Where the truth states none, the true velocity is that from so long before an epoch to so long after it, ns.
const BESIDE_NS: i64 = 100_000_000;

/// An epoch, linearised.
#[derive(Clone, Debug)]
pub struct Linearised {
    /// Its time.
    pub time: GpsTime,
    /// Since the first epoch of the recording, ns.
    pub since_first_ns: i64,
    /// Its rows.
    pub model: Box<LinearModel>,
    /// What is known of each row.
    pub rows: Vec<UsedRow>,
    /// The point of linearisation, ECEF, m.
    pub r_e_m: [f64; 3],
    /// Range rates of the same satellites, taken at rest, m/s.
    pub rates: Box<RangeRates>,
}

impl Linearised {
    /// Since the first epoch of the recording, s.
    pub fn t_s(&self) -> f64 {
        self.since_first_ns as f64 / NS_PER_S as f64
    }

    /// Error of the point of linearisation, east, north, up, m; `None` where the truth has no position.
    pub fn error_enu_m(&self, truth: &Truth) -> Option<[f64; 3]> {
        Truth::error_enu_m(truth.at(self.time, self.since_first_ns)?, self.r_e_m)
    }

    /// True velocity east, north, up, m/s; `None` where the truth neither states it nor goes on around the epoch.
    pub fn true_velocity_enu_mps(&self, truth: &Truth) -> Option<[f64; 3]> {
        if let Some(stated) = truth.velocity_enu_mps(self.time, self.since_first_ns) {
            return Some(stated);
        }
        let beside = |by_ns: i64| truth.at(self.time.plus_ns(by_ns), self.since_first_ns + by_ns);
        let moved_m = Truth::error_enu_m(beside(-BESIDE_NS)?, beside(BESIDE_NS)?)?;
        Some(moved_m.map(|m| m * NS_PER_S as f64 / (2 * BESIDE_NS) as f64))
    }
}

/// The row of a satellite.
pub fn row_of(rows: &[UsedRow], satellite: Satellite) -> Option<usize> {
    rows.iter().position(|row| row.satellite == satellite)
}

/// Solves epochs one after the other and linearises each at its solution.
pub struct Lineariser {
    config: Config,
    store: Box<EphemerisStore>,
    ionosphere: BroadcastIonosphere,
    workspace: Box<SnapshotWorkspace>,
    start: Option<[f64; 3]>,
    first: Option<GpsTime>,
}

impl Lineariser {
    /// Before the first item.
    pub fn new(config: &Config) -> Self {
        Self {
            config: *config,
            store: Box::new(EphemerisStore::EMPTY),
            ionosphere: BroadcastIonosphere::EMPTY,
            workspace: Box::new(SnapshotWorkspace::EMPTY),
            start: None,
            first: None,
        }
    }

    /// Takes the next item; `None` where it is no epoch.
    pub fn take(&mut self, item: &Item) -> Option<Result<Linearised, SnapshotError>> {
        let epoch = match item {
            Item::Ephemeris(ephemeris) => {
                let _ = self.store.insert(ephemeris);
                return None;
            }
            Item::Klobuchar(parameters) => {
                self.ionosphere.insert(*parameters);
                return None;
            }
            Item::ForFilter(_) => return None,
            Item::Epoch(epoch) => epoch,
        };
        let first = *self.first.get_or_insert(epoch.time);
        self.workspace
            .prepare(epoch, &self.store, &self.ionosphere, &self.config);
        let solution = match self.workspace.solve(SatelliteSet::EMPTY, self.start) {
            Ok(solution) => solution,
            Err(error) => return Some(Err(error)),
        };
        self.start = Some(solution.r_e_m);
        let mut model = Box::new(LinearModel::EMPTY);
        (*model).clone_from(self.workspace.model());
        let mut rates = Box::new(RangeRates::EMPTY);
        self.workspace.range_rates(&mut rates);
        Some(Ok(Linearised {
            time: epoch.time,
            since_first_ns: epoch.time.ns() - first.ns(),
            model,
            rows: self.workspace.used_rows().collect(),
            r_e_m: solution.r_e_m,
            rates,
        }))
    }
}
