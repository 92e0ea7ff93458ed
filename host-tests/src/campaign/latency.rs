//! Receivers that are late, beside the same receivers that are not: `surefix campaign latency`.
//!
//! A trial is one seed: a car at 16 m/s and an aircraft at 100 m/s, receivers at 1, 4 and 10 Hz, samples at
//! 100 Hz, with the bank of filters and without, each with every latency of [`ARRIVALS`]. Told are the
//! errors of the epochs' positions and of the positions now, ten times in a second.

use std::fmt::Write as _;

use anyhow::Result;
use serde::{Deserialize, Serialize};

use super::outcome::{Campaign, Outcome};
use crate::latency::{Arrival, Course, LateFlight, Said, Setting, rms_and_worst};

/// Receivers, epochs per second.
pub const RATES_HZ: [u32; 3] = [1, 4, 10];
/// Length of a flight, s.
const DURATION_S: u32 = 90;

/// When epochs arrive, what the monitor is told of it in ms, and the name of it.
pub const ARRIVALS: [(Arrival, Option<u32>, &str); 7] = [
    (Arrival::After(0), None, "at once"),
    (Arrival::After(50), None, "50 ms"),
    (Arrival::After(120), None, "120 ms"),
    (Arrival::After(300), None, "300 ms"),
    (
        Arrival::Between(50, 300),
        Some(300),
        "50 to 300 ms, 300 configured",
    ),
    (Arrival::Growing(4), None, "growing by 4 ms/s to 356 ms"),
    (
        Arrival::Worse {
            ms: 50,
            span_s: (40, 50),
            worse_ms: 800,
        },
        None,
        "50 ms, for 10 s 800 ms",
    ),
];

/// One flight of one monitor.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LatencyRecord {
    /// The vehicle.
    pub course: Course,
    /// Epochs per second.
    pub gnss_hz: u32,
    /// With the bank of filters.
    pub with_bank: bool,
    /// Place in [`ARRIVALS`].
    pub arrival: usize,
    /// Reports.
    pub reports: usize,
    /// Reports that are not to the bit those of epochs that came at once.
    pub differ: usize,
    /// Epochs that came too late.
    pub too_late: u32,
    /// Root mean square and largest error of the epochs' positions in tight mode, m.
    pub at_epochs_m: [f64; 2],
    /// The same of the positions now, m.
    pub now_m: [f64; 2],
}

/// The campaign.
pub struct Latency {
    seed: u64,
}

impl LatencyRecord {
    fn new(
        flight: (Course, u32),
        setting: &Setting,
        arrival: usize,
        late: &Said,
        at_once: &Said,
    ) -> Self {
        let same = late
            .reports
            .iter()
            .zip(&at_once.reports)
            .filter(|(late, at_once)| late == at_once)
            .count();
        let timing = late.inertial.last().map(|inertial| inertial.timing);
        Self {
            course: flight.0,
            gnss_hz: flight.1,
            with_bank: setting.with_bank,
            arrival,
            reports: late.reports.len(),
            differ: late.reports.len() - same,
            too_late: timing.map_or(0, |timing| timing.horizon.too_late),
            at_epochs_m: rms_and_worst(&late.at_epochs),
            now_m: rms_and_worst(&late.now),
        }
    }
}

impl Campaign for Latency {
    const NAME: &'static str = "latency";
    const TRIALS: u64 = 5;
    type Record = LatencyRecord;

    fn prepare(seed: u64, _trials: u64) -> Result<Self> {
        Ok(Self { seed })
    }

    fn piece(&mut self, number: u64) -> Result<Vec<LatencyRecord>> {
        let mut records = Vec::new();
        for course in Course::ALL {
            for gnss_hz in RATES_HZ {
                let flight = LateFlight::new(course, DURATION_S, gnss_hz, 100, self.seed + number)?;
                for with_bank in [false, true] {
                    let mut at_once = None;
                    for (place, (arrival, known_ms, _)) in ARRIVALS.into_iter().enumerate() {
                        let setting = Setting {
                            arrival,
                            known_ms,
                            with_bank,
                        };
                        let said = flight.run(&setting)?;
                        let at_once = at_once.get_or_insert_with(|| said.clone());
                        records.push(LatencyRecord::new(
                            (course, gnss_hz),
                            &setting,
                            place,
                            &said,
                            at_once,
                        ));
                    }
                }
            }
        }
        Ok(records)
    }

    fn report(outcome: &Outcome<LatencyRecord>) -> String {
        let mut text = format!(
            "Flights of {DURATION_S} s, {} seeds from {} on, with the bank and without; root mean square over the seeds, largest in brackets, m, from 20 s on.\n",
            outcome.trials, outcome.seed
        );
        for course in Course::ALL {
            let _ = write!(
                text,
                "\n| {} | Hz | reports | not those of epochs at once | too late | position at epochs, m | position now, m | now at once, m |\n|---|---|---|---|---|---|---|---|\n",
                course.name()
            );
            for gnss_hz in RATES_HZ {
                for (place, (_, _, name)) in ARRIVALS.iter().enumerate() {
                    let of = |place: usize| {
                        outcome.of().filter(move |record| {
                            (record.course, record.gnss_hz, record.arrival)
                                == (course, gnss_hz, place)
                        })
                    };
                    let reports: usize = of(place).map(|record| record.reports).sum();
                    let differ: usize = of(place).map(|record| record.differ).sum();
                    let too_late: u32 = of(place).map(|record| record.too_late).sum();
                    let _ = writeln!(
                        text,
                        "| {name} | {gnss_hz} | {reports} | {differ} | {too_late} | {} | {} | {} |",
                        together(of(place).map(|record| record.at_epochs_m)),
                        together(of(place).map(|record| record.now_m)),
                        together(of(0).map(|record| record.now_m)),
                    );
                }
            }
        }
        text
    }
}

/// Root mean square of root mean squares, and the largest of all.
fn together(errors_m: impl Iterator<Item = [f64; 2]>) -> String {
    let (mut squares, mut count, mut largest_m) = (0.0, 0, 0.0_f64);
    for [rms_m, worst_m] in errors_m {
        squares += rms_m * rms_m;
        count += 1;
        largest_m = largest_m.max(worst_m);
    }
    let rms_m = (squares / f64::from(count.max(1))).sqrt();
    format!("{rms_m:.3} ({largest_m:.3})")
}
