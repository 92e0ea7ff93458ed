//! Ramps on the hardest satellite in each phase of flight: `surefix campaign time-to-alert`.
//!
//! A trial is a fixed receiver at a place, time and seed drawn anew, with GPS, GPS and BDS, or all three, without an
//! ionosphere. In each phase of flight a ramp begins [`ONSET_S`] after the first epoch on the satellite that
//! is hardest to test there. Its rate is drawn so that the position of all satellites passes an alert limit after 5
//! to 100 s: about 0.3 to 10 m/s with limits of 20 to 50 m, but 100 m/s and more with the kilometres of oceanic
//! and en-route flight, which no satellite does; a slower ramp is found at the same size, only farther from
//! the limit. The snapshot monitor tests each epoch by itself, so that nothing in it depends on the rate but by how
//! much the fault grows from one epoch to the next.
//!
//! The bytes of the receiver go through [`Monitor`], once with exclusion and once without: only without does the
//! position follow the fault on past the limit, and shows what an alert would have been worth.
//!
//! | symbol | code | meaning |
//! |---|---|---|
//! | S | rows of (GᵀWG)⁻¹GᵀW | shift of the position per pseudorange error |
//! | slope | `Hardest` | shift over how many sigmas of its residual the error is, k σ/√(1 − H_ii) [BROWN-1992], over the alert limit, the larger of horizontal and vertical |
//!
//! Time to alert is from the first epoch whose error passes its limit to the first that may not be used.

use anyhow::{Context, Result, bail};
use nalgebra::SMatrix;
use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};
use surefix_core::budget::{Ledger, NoCounter};
use surefix_core::config::{Config, IonosphereModel};
use surefix_core::consts::MAX_UNKNOWNS;
use surefix_core::gnss::satellite::SystemSet;
use surefix_core::gnss::{BroadcastIonosphere, EphemerisStore, Satellite, System};
use surefix_core::integrity::{Integrity, Phase, PhaseRequirements};
use surefix_core::monitor::{Monitor, Ready};
use surefix_core::report::EpochReport;
use surefix_core::snapshot::SnapshotMonitor;
use surefix_core::time::GpsTime;

use super::binomial::{clopper_pearson, percent};
use super::figure::{Curve, Panel, page};
use super::outcome::{Campaign, Outcome};
use crate::faults::{FaultInjector, FaultKind, FaultSpec};
use crate::output;
use crate::simulate::atmosphere::Ionosphere;
use crate::simulate::disturbances::Disturbances;
use crate::simulate::flight::Track;
use crate::simulate::noise::uniform;
use crate::simulate::receiver::{Conditions, Epoch, Receiver};
use crate::simulate::sky;
use crate::simulate::stream::{Format, Stream};
use crate::truth::Truth;

/// When the ramp begins, s after the first epoch.
pub const ONSET_S: f64 = 5.0;
/// Time after which the position of all satellites passes the limit, s.
const PASSES_AFTER_S: [f64; 2] = [5.0, 100.0];
/// Watched for so much longer than that, and so many seconds more.
const WATCHED: (f64, f64) = (1.2, 4.0);
/// Of the intervals in the tables.
pub const CONFIDENCE: f64 = 0.99;
/// Below this part of its residual left a satellite cannot be tested at all.
const MIN_COFACTOR: f64 = 1e-6;

/// One ramp in one phase of flight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Phase of flight.
    pub phase: String,
    /// Whether the monitor may exclude.
    pub excludes: bool,
    /// Letters of the constellations.
    pub systems: String,
    /// Satellites in the position before the fault.
    pub satellites: usize,
    /// Which one is faulty.
    pub satellite: String,
    /// Rate of the ramp, m/s.
    pub rate_mps: f64,
    /// When the error of the position of all satellites is to pass its limit, s after the onset.
    pub passes_s: f64,
    /// Every epoch before the onset was usable.
    pub available: bool,
    /// An alert or an exclusion before the onset.
    pub false_alert: bool,
    /// First epoch at which the fault was told, by an alert, unavailability or the exclusion of the satellite, s after
    /// the onset.
    pub told_s: Option<f64>,
    /// First epoch that may not be used, s after the onset.
    pub unusable_s: Option<f64>,
    /// First epoch whose error passes an alert limit, s after the onset.
    pub passed_s: Option<f64>,
    /// Largest error over its limit of a usable epoch since the onset.
    pub largest_usable: f64,
    /// Longest time that a position above its limit was usable, from the first such epoch to the first epoch that was
    /// not, s: the time to alert. None where no error passed its limit.
    pub time_to_alert_s: Option<f64>,
    /// Usable epochs with an error above a level.
    pub above_level: usize,
    /// A healthy satellite was excluded.
    pub wrong: bool,
}

impl Record {
    /// Nothing has happened yet.
    fn begun() -> Self {
        Self {
            phase: String::new(),
            excludes: false,
            systems: String::new(),
            satellites: 0,
            satellite: String::new(),
            rate_mps: 0.0,
            passes_s: 0.0,
            available: true,
            false_alert: false,
            told_s: None,
            unusable_s: None,
            passed_s: None,
            largest_usable: 0.0,
            time_to_alert_s: None,
            above_level: 0,
            wrong: false,
        }
    }
}

/// The satellite whose fault is the largest part of an alert limit before it is seen.
#[derive(Clone, Copy, Debug)]
struct Hardest {
    satellite: Satellite,
    /// Part of its limit by which the position moves per metre, the larger of horizontal and vertical, 1/m.
    part_per_m: f64,
    satellites: usize,
}

/// Ramps in all phases of flight.
pub struct TimeToAlert {
    seed: u64,
    monitor: Box<Monitor>,
    snapshot: Box<SnapshotMonitor>,
    store: Box<EphemerisStore>,
}

fn config(phase: Phase, systems: &[System], excludes: bool) -> Config {
    let systems = systems
        .iter()
        .fold(SystemSet::EMPTY, |set, system| set.with(*system));
    Config {
        phase,
        systems,
        ionosphere: IonosphereModel::None,
        max_exclusions: if excludes {
            Config::PRESET.max_exclusions
        } else {
            0
        },
        ..Config::PRESET
    }
}

impl TimeToAlert {
    /// The hardest satellite of each phase at an epoch; `None` where there is no position or nothing to test.
    fn hardest(
        &mut self,
        epoch: &Epoch,
        systems: &[System],
        requirements: &PhaseRequirements,
    ) -> Result<Option<Hardest>> {
        let snapshot = &mut self.snapshot;
        if let Err(error) = snapshot.configure(&config(Phase::Npa, systems, false)) {
            bail!("the configuration is not legal: {error:?}");
        }
        let mut ledger = Ledger::EMPTY;
        let assessment = snapshot.assess(
            &epoch.observations,
            &self.store,
            &BroadcastIonosphere::EMPTY,
            &mut ledger,
            &mut NoCounter,
        );
        if assessment.solution.is_none() {
            return Ok(None);
        }
        let model = snapshot.workspace().model();
        let rows = || model.design.iter().zip(&model.sigma_m).take(model.n);
        // Unknowns that are not there get an equation of their own.
        let mut normals = SMatrix::<f64, MAX_UNKNOWNS, MAX_UNKNOWNS>::zeros();
        for (g, sigma_m) in rows() {
            let g = SMatrix::<f64, MAX_UNKNOWNS, 1>::from_column_slice(g);
            normals += g * g.transpose() / (sigma_m * sigma_m);
        }
        for unknown in model.m..MAX_UNKNOWNS {
            normals[(unknown, unknown)] = 1.0;
        }
        let Some(inverse) = normals.cholesky().map(|factors| factors.inverse()) else {
            return Ok(None);
        };
        let mut hardest: Option<(f64, Hardest)> = None;
        for (used, (g, sigma_m)) in snapshot.workspace().used_rows().zip(rows()) {
            let g = SMatrix::<f64, MAX_UNKNOWNS, 1>::from_column_slice(g);
            let shift = inverse * g / (sigma_m * sigma_m);
            let left = 1.0 - g.dot(&shift);
            if left < MIN_COFACTOR {
                continue;
            }
            let horizontal = shift[0].hypot(shift[1]) / requirements.hal_m;
            let vertical = requirements
                .val_m
                .map_or(0.0, |val_m| shift[2].abs() / val_m);
            let part_per_m = horizontal.max(vertical);
            let slope = part_per_m * sigma_m / left.sqrt();
            if hardest.is_none_or(|(largest, _)| slope > largest) {
                let satellite = Hardest {
                    satellite: used.satellite,
                    part_per_m,
                    satellites: model.n,
                };
                hardest = Some((slope, satellite));
            }
        }
        Ok(hardest.map(|(_, hardest)| hardest))
    }

    /// The reports on a stream, one for each epoch.
    fn reports(&mut self, config: &Config, bytes: &[u8]) -> Result<Vec<EpochReport>> {
        *self.monitor = Monitor::EMPTY;
        if let Err(error) = self.monitor.configure(config) {
            bail!("the configuration is not legal: {error:?}");
        }
        let mut reports = Vec::new();
        let mut rest = bytes;
        while !rest.is_empty() {
            let (used, ready) = self.monitor.push(rest);
            rest = &rest[used..];
            if ready == Some(Ready::Epoch) {
                reports.push(self.monitor.process(&mut NoCounter));
            }
        }
        while self.monitor.finish() == Ready::Epoch {
            reports.push(self.monitor.process(&mut NoCounter));
        }
        Ok(reports)
    }
}

/// What became of a ramp.
fn judge(
    mut record: Record,
    faulty: Satellite,
    epochs: &[Epoch],
    reports: &[EpochReport],
) -> Record {
    let mut since_s: Option<f64> = None;
    let mut longest_s: f64 = 0.0;
    let mut last_s = 0.0;
    for (epoch, report) in epochs.iter().zip(reports) {
        let t_s = output::t_s(report) - ONSET_S;
        let verdict = &report.verdict;
        let usable = verdict.integrity.is_usable();
        let healthy_out = verdict.excluded.iter().any(|out| out != faulty);
        if t_s <= 0.0 {
            // The first epoch of a ramp has no fault yet.
            record.available &= usable;
            record.false_alert |=
                verdict.integrity == Integrity::Alert || !verdict.excluded.is_empty();
            continue;
        }
        last_s = t_s;
        record.wrong |= healthy_out;
        if !usable || verdict.excluded.contains(faulty) {
            record.told_s.get_or_insert(t_s);
        }
        if !usable {
            record.unusable_s.get_or_insert(t_s);
        }
        let error = report
            .fix
            .and_then(|fix| Truth::error_enu_m(epoch.antenna.position_e_m.into(), fix.r_e_m));
        let part = error.map_or(0.0, |[east, north, up]| {
            let vertical = verdict.val_m.map_or(0.0, |val_m| up.abs() / val_m);
            vertical.max(east.hypot(north) / verdict.hal_m)
        });
        if part > 1.0 {
            record.passed_s.get_or_insert(t_s);
        }
        if usable {
            record.largest_usable = record.largest_usable.max(part);
            let above = |level: Option<f64>, error: f64| level.is_none_or(|level| error > level);
            let is_above = error.is_none_or(|[east, north, up]| {
                above(verdict.hpl.bound_m(), east.hypot(north))
                    || above(verdict.vpl.bound_m(), up.abs())
            });
            record.above_level += usize::from(is_above);
        }
        if usable && part > 1.0 {
            since_s.get_or_insert(t_s);
        } else if let Some(since_s) = since_s.take() {
            longest_s = longest_s.max(t_s - since_s);
        }
    }
    if let Some(since_s) = since_s {
        // Not told by the end: at least so long.
        longest_s = longest_s.max(last_s + 1.0 - since_s);
    }
    record.time_to_alert_s = record.passed_s.map(|_| longest_s);
    record
}

impl Campaign for TimeToAlert {
    const NAME: &'static str = "time-to-alert";
    // In the phase with the tightest limits seven of ten are available before the ramp: 1,000 ramps in each.
    const TRIALS: u64 = 1500;
    type Record = Record;

    fn prepare(seed: u64, _: u64) -> Result<Self> {
        Ok(Self {
            seed,
            monitor: Box::new(Monitor::EMPTY),
            snapshot: Box::new(SnapshotMonitor::EMPTY),
            store: Box::new(EphemerisStore::EMPTY),
        })
    }

    fn piece(&mut self, number: u64) -> Result<Vec<Record>> {
        let mut random = ChaCha20Rng::seed_from_u64(self.seed);
        random.set_stream(number);
        let latitude_deg = uniform(&mut random).mul_add(2.0, -1.0).asin().to_degrees();
        let longitude_deg = 360.0 * uniform(&mut random) - 180.0;
        let tow_s = (uniform(&mut random) * 600_000.0) as i64;
        let systems: &[System] = match random.next_u64() % 3 {
            0 => &[System::Gps],
            1 => &[System::Gps, System::Bds],
            _ => &System::ALL,
        };
        let conditions = Conditions {
            format: Format::Rtcm3,
            seed: random.next_u64(),
            noise_free: false,
            dual_frequency: false,
            ionosphere: Ionosphere::None,
            troposphere: true,
        };
        let track = Track::MastAt {
            latitude_deg: latitude_deg as i16,
            longitude_deg: longitude_deg as i16,
        };
        let longest_s = ONSET_S + WATCHED.0 * PASSES_AFTER_S[1] + WATCHED.1;
        let start = GpsTime::from_week_tow_s(sky::WEEK, tow_s);
        let calm = Disturbances::default();
        let mut epochs: Vec<Epoch> =
            Receiver::new(track, conditions, &calm, start, longest_s, 1_000_000_000).collect();
        // A phase does not follow a ramp of kilometres in the fields of a message.
        for epoch in &mut epochs {
            let satellites = epoch.observations.satellites.iter_mut();
            for signal in satellites.flat_map(|observed| &mut observed.signals) {
                signal.carrier_phase_cycles = None;
            }
        }
        *self.store = EphemerisStore::EMPTY;
        let first = epochs.first().context("no epoch")?;
        for ephemeris in &first.ephemerides {
            let _ = self.store.insert(ephemeris);
        }

        let mut records = Vec::new();
        for phase in Phase::ALL {
            let requirements = phase.requirements();
            let [least_s, most_s] = PASSES_AFTER_S;
            let passes_s = least_s * (uniform(&mut random) * (most_s / least_s).ln()).exp();
            let sign = if random.next_u64() & 1 == 0 {
                1.0
            } else {
                -1.0
            };
            let Some(hardest) = self.hardest(&epochs[0], systems, &requirements)? else {
                continue;
            };
            let fault = FaultSpec {
                satellite: hardest.satellite,
                kind: FaultKind::Ramp,
                magnitude: sign / (hardest.part_per_m * passes_s),
                t0_s: ONSET_S,
                t1_s: f64::INFINITY,
                on_range_rate: false,
                period_s: 20.0,
            };
            let n = (ONSET_S + WATCHED.0 * passes_s + WATCHED.1) as usize;
            let mut injector = FaultInjector::new(std::slice::from_ref(&fault), self.seed);
            let mut stream = Stream::new(Format::Rtcm3, Ionosphere::None, false);
            for (k, epoch) in epochs.iter_mut().take(n).enumerate() {
                let clean = epoch.observations.clone();
                injector.apply(&mut epoch.observations, k as f64);
                stream.push(epoch)?;
                epoch.observations = clean;
            }
            for excludes in [true, false] {
                let config = config(phase, systems, excludes);
                let reports = self.reports(&config, &stream.bytes)?;
                if reports.len() != n {
                    bail!("{} reports of {n} epochs", reports.len());
                }
                let record = Record {
                    phase: phase.name().to_owned(),
                    excludes,
                    systems: systems.iter().map(|system| system.letter()).collect(),
                    satellites: hardest.satellites,
                    satellite: hardest.satellite.to_string(),
                    rate_mps: fault.magnitude,
                    passes_s,
                    ..Record::begun()
                };
                records.push(judge(record, hardest.satellite, &epochs, &reports));
            }
        }
        Ok(records)
    }

    fn report(outcome: &Outcome<Record>) -> String {
        let mut text = format!(
            "{} places and times, seed {}, ramps on the hardest satellite, each with and without exclusion; epochs of 1 s. Ramps that began where the phase was available.\n\n\
             | phase | limit h, v, m; to alert, s | exclusion | ramps | ramp, m/s, least, median, largest | told after, s, median, largest | told ahead of the limit, s, least, median | largest usable error / limit, median, largest | limit passed | time to alert, s, median, 99 %, largest | late, missed | late, at most, {} % | wrongly out | above a level | false alerts |\n\
             |---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
            outcome.trials,
            outcome.seed,
            100.0 * CONFIDENCE,
        );
        for phase in Phase::ALL {
            for excludes in [true, false] {
                text += &row(outcome, phase, excludes);
            }
        }
        let of: Vec<&Record> = outcome.of().collect();
        let available = of.iter().filter(|record| record.available).count();
        text += &format!(
            "\nLate: a usable epoch with an error above its limit; missed: for longer than the time to alert. Told ahead: before the epoch at which the error of the position of all satellites passes the limit. Available before the ramp: {} of {}, {} %.\n",
            available,
            of.len(),
            percent(available as u64, of.len() as u64, CONFIDENCE)
        );
        text
    }

    fn figures(outcome: &Outcome<Record>) -> Result<Vec<(&'static str, String)>> {
        let panel = |phase: Phase| {
            let requirements = phase.requirements();
            let curve = |excludes: bool, name: &str, colour| {
                let mut ahead: Vec<f64> = of(outcome, phase, excludes).map(ahead_s).collect();
                ahead.sort_by(f64::total_cmp);
                let n = ahead.len().max(1) as f64;
                // As fine as a line can show.
                let step = (ahead.len() / 200).max(1);
                let points = ahead.iter().enumerate().step_by(step);
                Curve {
                    name: name.into(),
                    points: points
                        .map(|(k, s)| (*s, 100.0 * (k + 1) as f64 / n))
                        .collect(),
                    colour,
                    dashed: excludes,
                }
            };
            Panel {
                title: format!(
                    "{}: {} s to alert",
                    phase.name(),
                    requirements.time_to_alert_s
                ),
                x_label: "told before the error passes its limit, s".into(),
                y_label: "ramps, %".into(),
                curves: vec![
                    curve(false, "without exclusion", "#b03a2e"),
                    curve(true, "with exclusion", "#2e6da4"),
                ],
                marks: vec![(0.0, "limit passed".into())],
                ..Panel::default()
            }
        };
        let panels: Vec<Panel> = Phase::ALL.into_iter().map(panel).collect();
        let title = format!(
            "Ramps on the hardest satellite, {} trials, seed {}",
            outcome.trials, outcome.seed
        );
        Ok(vec![("ahead", page(&title, &panels, 3))])
    }
}

/// Ramps of a phase that began where it was available.
fn of(
    outcome: &Outcome<Record>,
    phase: Phase,
    excludes: bool,
) -> impl Iterator<Item = &Record> + Clone {
    outcome.of().filter(move |record| {
        record.phase == phase.name() && record.excludes == excludes && record.available
    })
}

/// How long before the error passes its limit a ramp was told, s; negative after it. Where an exclusion keeps it from
/// ever passing, before it would have.
fn ahead_s(record: &Record) -> f64 {
    let passes_s = if record.excludes {
        record.passes_s
    } else {
        record.passed_s.unwrap_or(record.passes_s)
    };
    record
        .told_s
        .map_or(f64::NEG_INFINITY, |told_s| passes_s - told_s)
}

/// Whether a position above its limit was usable, and for longer than the time to alert.
pub fn is_late(record: &Record, limit_s: f64) -> [bool; 2] {
    let s = record.time_to_alert_s.unwrap_or(0.0);
    [s > 0.0, s > limit_s]
}

/// The value that a part of the sorted values do not exceed.
fn quantile(values: &[f64], part: f64) -> f64 {
    let rank = (part * values.len() as f64).ceil() as usize;
    let index = rank.clamp(1, values.len().max(1)) - 1;
    values.get(index).copied().unwrap_or(f64::NAN)
}

fn row(outcome: &Outcome<Record>, phase: Phase, excludes: bool) -> String {
    let PhaseRequirements {
        hal_m,
        val_m,
        time_to_alert_s,
        ..
    } = phase.requirements();
    let records = || of(outcome, phase, excludes);
    let sorted = |value: &dyn Fn(&Record) -> Option<f64>| {
        let mut values: Vec<f64> = records().filter_map(value).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let ramps = records().count() as u64;
    let rates = sorted(&|record| Some(record.rate_mps.abs()));
    let told = sorted(&|record| record.told_s);
    let ahead = sorted(&|record| Some(ahead_s(record)));
    let errors = sorted(&|record| Some(record.largest_usable));
    let times = sorted(&|record| record.time_to_alert_s);
    let count = |is: &dyn Fn(&Record) -> bool| records().filter(|record| is(record)).count() as u64;
    let late = count(&|record| is_late(record, time_to_alert_s)[0]);
    let missed = count(&|record| is_late(record, time_to_alert_s)[1]);
    format!(
        "| {} | {hal_m}, {}; {time_to_alert_s} | {} | {ramps} | {:.2}, {:.2}, {:.2} | {:.0}, {:.0} | {:.1}, {:.1} | {:.2}, {:.2} | {} | {} | {late}, {missed} | {:.2} % | {} | {} | {} |\n",
        phase.name(),
        val_m.map_or("-".to_owned(), |val_m| val_m.to_string()),
        if excludes { "yes" } else { "no" },
        quantile(&rates, 0.0),
        quantile(&rates, 0.5),
        quantile(&rates, 1.0),
        quantile(&told, 0.5),
        quantile(&told, 1.0),
        quantile(&ahead, 0.0),
        quantile(&ahead, 0.5),
        quantile(&errors, 0.5),
        quantile(&errors, 1.0),
        times.len(),
        if times.is_empty() {
            "-".to_owned()
        } else {
            [0.5, 0.99, 1.0]
                .map(|part| format!("{:.0}", quantile(&times, part)))
                .join(", ")
        },
        100.0 * clopper_pearson(late, ramps, CONFIDENCE)[1],
        count(&|record| record.wrong),
        records().map(|record| record.above_level).sum::<usize>(),
        count(&|record| record.false_alert),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ramp on a receiver, and what is told once an alert has been forgotten for so many epochs.
    fn forgetful(forgets: usize) -> Record {
        let track = Track::MastAt {
            latitude_deg: 31,
            longitude_deg: 122,
        };
        let conditions = Conditions {
            seed: 1,
            noise_free: false,
            dual_frequency: false,
            ionosphere: Ionosphere::None,
            troposphere: true,
            format: Format::Rtcm3,
        };
        let start = GpsTime::from_week_tow_s(sky::WEEK, 274_200);
        let mut epochs: Vec<Epoch> = Receiver::new(
            track,
            conditions,
            &Disturbances::default(),
            start,
            60.0,
            1_000_000_000,
        )
        .collect();
        let faulty = epochs[0].ephemerides[0].satellite;
        let fault: FaultSpec = format!("{faulty}:ramp:20:{ONSET_S}:100").parse().unwrap();
        let mut injector = FaultInjector::new(&[fault], 1);
        let mut stream = Stream::new(Format::Rtcm3, Ionosphere::None, false);
        for (k, epoch) in epochs.iter_mut().enumerate() {
            for observed in &mut epoch.observations.satellites {
                for signal in &mut observed.signals {
                    signal.carrier_phase_cycles = None;
                }
            }
            injector.apply(&mut epoch.observations, k as f64);
            stream.push(epoch).unwrap();
        }
        let mut campaign = TimeToAlert::prepare(1, 1).unwrap();
        let config = config(Phase::Lpv200, &System::ALL, false);
        let mut reports = campaign.reports(&config, &stream.bytes).unwrap();
        let alerts = reports
            .iter_mut()
            .filter(|report| report.verdict.integrity == Integrity::Alert);
        for report in alerts.take(forgets) {
            report.verdict.integrity = Integrity::Nominal;
        }
        judge(Record::begun(), faulty, &epochs, &reports)
    }

    #[test]
    fn an_alert_that_comes_late_is_seen_to() {
        let limit_s = Phase::Lpv200.requirements().time_to_alert_s;
        let timely = forgetful(0);
        let passed_s = timely.passed_s.unwrap();
        assert_eq!(timely.time_to_alert_s, Some(0.0));
        let told_s = timely.told_s.unwrap();
        assert!(told_s < passed_s);
        assert_eq!(is_late(&timely, limit_s), [false; 2]);
        let until_passed = (passed_s - told_s) as usize;
        for (late_s, is) in [(3, [true, false]), (7, [true, true]), (100, [true, true])] {
            let late = forgetful(until_passed + late_s);
            assert_eq!(is_late(&late, limit_s), is, "{late:?}");
            assert!(late.largest_usable > 1.0);
            if late_s < 10 {
                assert_eq!(late.time_to_alert_s, Some(late_s as f64));
            }
        }
    }

    #[test]
    fn the_value_that_a_part_does_not_exceed() {
        let values = [1.0, 2.0, 3.0, 4.0];
        assert_eq!(
            [0.0, 0.25, 0.26, 1.0].map(|p| quantile(&values, p)),
            [1.0, 1.0, 2.0, 4.0]
        );
        assert!(quantile(&[], 0.5).is_nan());
    }
}
