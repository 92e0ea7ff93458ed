//! Two satellites at fault, and whole constellations: `surefix campaign double-faults`, `constellation-faults`.
//!
//! GPS and BDS, each with its own clock, [`SATELLITES`] of them spread over the sky, a tactical unit, tests of
//! both axes, filters without a pair and without a constellation. Each fault is flown by two banks:
//! one that takes white noise for white, and the product's ([`BankModel::PRODUCT`]) under noise
//! correlated over 100 s. Nothing but this is asked of the monitor: no usable epoch with an error above
//! its level. Detection, exclusion and isolation are counted.

use anyhow::{Context, Result};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng};
use serde::{Deserialize, Serialize};
use surefix_core::gnss::{Satellite, System};
use surefix_core::mhss::bank::Explanation;

use super::binomial::percent;
use super::errors::{CommonFault, ConstellationFault, Correlation, NoiseModel};
use super::flown::{FlightPlan, Flown};
use super::outcome::{Campaign, Outcome};
use super::rig::{BankModel, Rig, RigSetup};
use super::sky;
use super::trial::{Scored, Trial, left_out};
use crate::faults::{FaultKind, FaultSpec};
use crate::simulate::inertial::motion::Motion;
use crate::simulate::inertial::sensors::Grade;
use crate::simulate::inertial::trajectory::Anchor;
use crate::simulate::noise::uniform;

/// Satellites used.
pub const SATELLITES: usize = 14;
/// Before the first fault, s.
pub const ONSET_S: usize = 90;
/// Length of a flight, s.
pub const DURATION_S: usize = 270;
/// Different flights.
pub const FLIGHTS: u64 = 8;
/// Noise of the offset between constellations, m²/s: the default of the product, half a centimetre over a
/// second. Group delays drift with temperature by decimetres over hours.
pub const INTER_SYSTEM_PSD: f64 = 2.5e-5;
/// True offset of BDS against GPS, m.
const OFFSET_M: f64 = 20.0;
/// Confidence of intervals.
pub const CONFIDENCE: f64 = 0.99;

/// The rig of two constellations.
pub type TwoClocks = Rig<3, 9>;

/// Banks and the noise they fly in.
pub const BANKS: [(BankModel, NoiseModel); 2] = [
    (BankModel::White, NoiseModel::WHITE),
    (
        BankModel::PRODUCT,
        NoiseModel::correlated(Correlation::GaussMarkov(100.0)),
    ),
];

/// A flight and its satellites.
#[derive(Debug)]
struct Place {
    flown: Flown,
    satellites: Vec<Satellite>,
}

/// A flight where each constellation has at least five satellites of those used.
fn place(random: &mut ChaCha8Rng) -> Place {
    let mut between = |low: f64, high: f64| low + (high - low) * uniform(random);
    loop {
        let turn_deg = between(-60.0, 60.0);
        let flown = Flown::new(&FlightPlan {
            motion: Motion::level(between(0.0, 360.0), between(60.0, 220.0))
                .turn(30.0, 60.0, turn_deg, 5.0)
                .turn(130.0, 170.0, -turn_deg, 5.0),
            anchor: Anchor {
                at_s: 0,
                latitude_deg: between(-60.0, 60.0),
                longitude_deg: between(-180.0, 180.0),
                height_m: between(500.0, 10_000.0),
            },
            tow_s: libm::floor(between(0.0, 500_000.0)) as i64,
            duration_s: DURATION_S as u32,
            rate_hz: 50,
        });
        let always = flown.always_seen();
        let satellites = sky::spread(&flown.epochs[ONSET_S], &always, SATELLITES);
        let of = |system| satellites.iter().filter(|s| s.system() == system).count();
        let is_full = satellites.len() == SATELLITES;
        if is_full && of(System::Gps) >= 5 && of(System::Bds) >= 5 {
            return Place { flown, satellites };
        }
    }
}

fn places(seed: u64, pieces: u64) -> Vec<Place> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (0..FLIGHTS.min(pieces))
        .map(|_| place(&mut random))
        .collect()
}

fn trial(place: &Place, bank: BankModel, noise: NoiseModel, seed: u64) -> Trial<'_> {
    let mut setup = RigSetup::seed(Grade::Tactical);
    setup.model = bank;
    setup.vertical = true;
    setup.constellations = true;
    setup.explain = true;
    setup.inter_system_psd = INTER_SYSTEM_PSD;
    let mut trial = Trial::new(&place.flown, &place.satellites, setup, seed);
    trial.noise = noise;
    trial.offset_m[System::Bds.index()] = OFFSET_M;
    trial
}

/// What became of a fault.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fate {
    /// From the first onset to the first failed test, s.
    pub detection_s: Option<usize>,
    /// Faulty satellites, and those of them excluded.
    pub faulty: [usize; 2],
    /// Healthy satellites excluded by themselves or in a pair.
    pub healthy_out: usize,
    /// Healthy satellites excluded with their constellation.
    pub healthy_out_with_constellation: usize,
    /// Satellites excluded.
    #[serde(skip)]
    out: Vec<Satellite>,
    /// Explanations that were acted on: one satellite, two, a constellation.
    pub explanations: [usize; 3],
    /// Epochs that were usable, and of those with an error above a level.
    pub usable: [u64; 2],
    /// Largest error over its level of a usable epoch.
    pub largest_ratio: f64,
    /// Largest horizontal and vertical error of a usable epoch, m.
    pub largest_error_m: [f64; 2],
    /// Epochs with a failed test that excluded nothing, and of those above the alerted levels.
    pub alerted: [u64; 2],
    /// Blind epochs after an exclusion.
    pub blind: u64,
    /// The last epoch was usable.
    pub ends_usable: bool,
    /// A test failed before the onset.
    pub false_alert: bool,
}

impl Fate {
    fn new(faulty: usize) -> Self {
        Self {
            detection_s: None,
            faulty: [faulty, 0],
            healthy_out: 0,
            healthy_out_with_constellation: 0,
            out: Vec::new(),
            explanations: [0; 3],
            usable: [0; 2],
            largest_ratio: 0.0,
            largest_error_m: [0.0; 2],
            alerted: [0; 2],
            blind: 0,
            ends_usable: false,
            false_alert: false,
        }
    }

    fn take(&mut self, epoch: &Scored, onset_s: usize, used: &[Satellite], faulty: &[Satellite]) {
        let is_usable = epoch.is_usable();
        if let Some(explanation) = epoch.excluded {
            let kind = match explanation {
                Explanation::One(_) => 0,
                Explanation::Two(_) => 1,
                Explanation::Constellation(_) => 2,
            };
            self.explanations[kind] += 1;
            for satellite in left_out(explanation, used) {
                if self.out.contains(&satellite) {
                    continue;
                }
                self.out.push(satellite);
                if epoch.t_s >= onset_s && faulty.contains(&satellite) {
                    self.faulty[1] += 1;
                } else if kind < 2 {
                    self.healthy_out += 1;
                } else {
                    self.healthy_out_with_constellation += 1;
                }
            }
        }
        let Some(since_s) = epoch.t_s.checked_sub(onset_s) else {
            self.false_alert |= !is_usable;
            return;
        };
        let is_detected = epoch.detected[0];
        if is_detected {
            self.detection_s.get_or_insert(since_s);
        }
        self.ends_usable = is_usable;
        let above = |levels: &[f64; 2]| (0..2).any(|k| !(epoch.error_m[k] <= levels[k]));
        if is_usable {
            self.usable[0] += 1;
            self.usable[1] += u64::from(above(&epoch.level_m));
            self.largest_ratio = self.largest_ratio.max(epoch.ratio(2));
            for (largest, error_m) in self.largest_error_m.iter_mut().zip(epoch.error_m) {
                *largest = largest.max(error_m);
            }
        } else if !is_detected {
            self.blind += 1;
        } else if epoch.excluded.is_none() {
            self.alerted[0] += 1;
            self.alerted[1] += u64::from(above(&epoch.alerted_level_m));
        }
    }
}

/// A pair's fault.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PairRecord {
    /// The bank.
    pub bank: BankModel,
    /// Step or ramp.
    pub kind: String,
    /// Sizes, m or m/s.
    pub magnitudes: [f64; 2],
    /// How much later the second began, s.
    pub later_s: usize,
    /// What became of it.
    pub fate: Fate,
}

/// Two satellites at fault.
pub struct DoubleFaults {
    seed: u64,
    places: Vec<Place>,
    rig: TwoClocks,
}

impl Campaign for DoubleFaults {
    const NAME: &'static str = "double-faults";
    const TRIALS: u64 = 100;
    type Record = PairRecord;

    fn prepare(seed: u64, trials: u64) -> Result<Self> {
        Ok(Self {
            seed,
            places: places(seed, trials),
            rig: Rig::new(),
        })
    }

    /// A pair, drawn; steps of 5 to 200 m and ramps of 0.1 to 5 m/s, evenly on a logarithmic scale, with
    /// signs; in every second pair at once, otherwise the second one up to a minute later.
    fn piece(&mut self, number: u64) -> Result<Vec<PairRecord>> {
        let place = &self.places[(number % FLIGHTS) as usize];
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(1 + number);
        let first = (random.next_u64() % SATELLITES as u64) as usize;
        let step = 1 + (random.next_u64() % (SATELLITES as u64 - 1)) as usize;
        let pair = [first, (first + step) % SATELLITES].map(|k| place.satellites[k]);
        let later_s = if number.is_multiple_of(2) {
            0
        } else {
            1 + (random.next_u64() % 60) as usize
        };
        let sizes = [(); 2].map(|()| uniform(&mut random));
        let signs = [(); 2].map(|()| {
            if random.next_u64() & 1 == 0 {
                1.0
            } else {
                -1.0
            }
        });
        let seed = random.next_u64();
        let mut records = Vec::new();
        for (kind, [least, largest]) in [
            (FaultKind::Step, [5.0, 200.0]),
            (FaultKind::Ramp, [0.1, 5.0]),
        ] {
            let magnitudes =
                [0, 1].map(|k| signs[k] * least * libm::pow(largest / least, sizes[k]));
            for (bank, noise) in BANKS {
                let mut trial = trial(place, bank, noise, seed);
                for k in 0..2 {
                    trial.faults.push(FaultSpec {
                        satellite: pair[k],
                        kind,
                        magnitude: magnitudes[k],
                        t0_s: (ONSET_S + k * later_s) as f64,
                        t1_s: f64::INFINITY,
                        on_range_rate: false,
                        period_s: 20.0,
                    });
                }
                let mut fate = Fate::new(2);
                trial.fly(&mut self.rig, DURATION_S, |epoch, _| {
                    fate.take(epoch, ONSET_S, &place.satellites, &pair);
                    true
                })?;
                records.push(PairRecord {
                    bank,
                    kind: format!("{kind:?}").to_lowercase(),
                    magnitudes,
                    later_s,
                    fate,
                });
            }
        }
        Ok(records)
    }

    fn report(outcome: &Outcome<PairRecord>) -> String {
        let mut text = format!(
            "{} pairs of satellites at fault, seed {}, {SATELLITES} satellites of GPS and BDS.\n\n\
             | bank | kind | second | faults | detected | both out | one out | none out | healthy out: singly, with their constellation | by one, two, constellation | usable epochs, above the level | largest error/level | alerted, above d + a | false alerts |\n\
             |---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
            outcome.trials, outcome.seed
        );
        for (bank, _) in BANKS {
            for kind in ["step", "ramp"] {
                for at_once in [true, false] {
                    let of = |r: &&PairRecord| {
                        r.bank == bank && r.kind == kind && (r.later_s == 0) == at_once
                    };
                    let fates: Vec<&Fate> = outcome.of().filter(of).map(|r| &r.fate).collect();
                    let out = |n: usize| fates.iter().filter(|f| f.faulty[1] == n).count();
                    text += &format!(
                        "| {} | {kind} | {} | {} | {} | {} | {} | {} | {}\n",
                        bank.name(),
                        if at_once { "at once" } else { "later" },
                        fates.len(),
                        fates.iter().filter(|f| f.detection_s.is_some()).count(),
                        out(2),
                        out(1),
                        out(0),
                        tail(&fates)
                    );
                }
            }
        }
        text += "\nTwo-satellite isolation rate: both excluded and nobody else, of the pairs detected.\n\n";
        for (bank, _) in BANKS {
            for kind in ["step", "ramp"] {
                let of = |r: &&PairRecord| r.bank == bank && r.kind == kind;
                let fates: Vec<&Fate> = outcome.of().filter(of).map(|r| &r.fate).collect();
                let detected = fates.iter().filter(|f| f.detection_s.is_some()).count();
                let isolated = |f: &&&Fate| {
                    f.faulty[1] == 2 && f.healthy_out + f.healthy_out_with_constellation == 0
                };
                let isolated = fates.iter().filter(isolated).count();
                text += &format!(
                    "- {}, {kind}: {isolated} of {detected}, {} %\n",
                    bank.name(),
                    percent(isolated as u64, detected as u64, CONFIDENCE)
                );
            }
        }
        text
    }
}

/// The last columns of a row.
fn tail(fates: &[&Fate]) -> String {
    let sum = |of: fn(&Fate) -> u64| fates.iter().map(|f| of(f)).sum::<u64>();
    let explanations = |k: usize| fates.iter().map(|f| f.explanations[k]).sum::<usize>();
    format!(
        "{}, {} | {}, {}, {} | {}, {} | {:.2} | {}, {} | {} |",
        fates.iter().map(|f| f.healthy_out).sum::<usize>(),
        fates
            .iter()
            .map(|f| f.healthy_out_with_constellation)
            .sum::<usize>(),
        explanations(0),
        explanations(1),
        explanations(2),
        sum(|f| f.usable[0]),
        sum(|f| f.usable[1]),
        fates.iter().map(|f| f.largest_ratio).fold(0.0, f64::max),
        sum(|f| f.alerted[0]),
        sum(|f| f.alerted[1]),
        fates.iter().filter(|f| f.false_alert).count(),
    )
}

/// Faults of constellations: ramps of time, and ephemerides turned about an axis.
pub fn constellation_faults() -> Vec<(System, ConstellationFault)> {
    let mut faults = Vec::new();
    for rate_mps in [0.05, 0.2, 1.0, 5.0] {
        for on_range_rate in [false, true] {
            let fault = ConstellationFault::Clock {
                rate_mps,
                on_range_rate,
            };
            faults.push((System::Bds, fault));
        }
    }
    for system in [System::Gps, System::Bds] {
        for (shift_m, growth_s) in [(10.0, 0.0), (50.0, 0.0), (50.0, 60.0), (300.0, 60.0)] {
            let fault = ConstellationFault::Rotation {
                shift_m,
                growth_s,
                axis_e: [0.3, 0.5, 0.8],
            };
            faults.push((system, fault));
        }
    }
    faults
}

/// For tables.
fn describe(system: System, fault: &ConstellationFault) -> String {
    match fault {
        ConstellationFault::Clock {
            rate_mps,
            on_range_rate,
        } => format!(
            "{system:?} time {rate_mps} m/s{}",
            if *on_range_rate {
                ", also on the range rates"
            } else {
                ""
            }
        ),
        ConstellationFault::Rotation {
            shift_m, growth_s, ..
        } => format!("{system:?} orbits turned by {shift_m} m within {growth_s} s"),
    }
}

/// A constellation's fault.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ConstellationRecord {
    /// The bank.
    pub bank: BankModel,
    /// What happened.
    pub fault: String,
    /// What became of it.
    pub fate: Fate,
}

/// A whole constellation at fault.
pub struct ConstellationFaults {
    seed: u64,
    places: Vec<Place>,
    rig: TwoClocks,
}

impl Campaign for ConstellationFaults {
    const NAME: &'static str = "constellation-faults";
    const TRIALS: u64 = 16;
    type Record = ConstellationRecord;

    fn prepare(seed: u64, trials: u64) -> Result<Self> {
        Ok(Self {
            seed,
            places: places(seed, trials),
            rig: Rig::new(),
        })
    }

    fn piece(&mut self, number: u64) -> Result<Vec<ConstellationRecord>> {
        let place = &self.places[(number % FLIGHTS) as usize];
        let mut records = Vec::new();
        for (system, fault) in constellation_faults() {
            let faulty: Vec<Satellite> = place
                .satellites
                .iter()
                .copied()
                .filter(|s| s.system() == system)
                .collect();
            faulty.first().context("no satellite to be faulty")?;
            for (bank, noise) in BANKS {
                let mut trial = trial(place, bank, noise, self.seed.wrapping_add(number));
                trial.common = Some(CommonFault {
                    system,
                    fault,
                    t0_s: ONSET_S as f64,
                });
                let mut fate = Fate::new(faulty.len());
                trial.fly(&mut self.rig, DURATION_S, |epoch, _| {
                    fate.take(epoch, ONSET_S, &place.satellites, &faulty);
                    true
                })?;
                records.push(ConstellationRecord {
                    bank,
                    fault: describe(system, &fault),
                    fate,
                });
            }
        }
        Ok(records)
    }

    fn report(outcome: &Outcome<ConstellationRecord>) -> String {
        let mut text = format!(
            "Faults of a constellation, {} flights each, seed {}, {SATELLITES} satellites of GPS and BDS, offset between them with {INTER_SYSTEM_PSD:e} m²/s.\n\n\
             | bank | fault | detected | constellation out | largest error of a usable epoch, horizontal, vertical, m | ends usable | healthy out: singly, with their constellation | by one, two, constellation | usable epochs, above the level | largest error/level | alerted, above d + a | false alerts |\n\
             |---|---|---|---|---|---|---|---|---|---|---|---|\n",
            outcome.trials, outcome.seed
        );
        for (bank, _) in BANKS {
            for (system, fault) in constellation_faults() {
                let fault = describe(system, &fault);
                let of = |r: &&ConstellationRecord| r.bank == bank && r.fault == fault;
                let fates: Vec<&Fate> = outcome.of().filter(of).map(|r| &r.fate).collect();
                let error = |k: usize| {
                    let errors = fates.iter().map(|f| f.largest_error_m[k]);
                    errors.fold(0.0, f64::max)
                };
                text += &format!(
                    "| {} | {fault} | {} of {} | {} | {:.2}, {:.2} | {} | {}\n",
                    bank.name(),
                    fates.iter().filter(|f| f.detection_s.is_some()).count(),
                    fates.len(),
                    fates.iter().filter(|f| f.faulty[0] == f.faulty[1]).count(),
                    error(0),
                    error(1),
                    fates.iter().filter(|f| f.ends_usable).count(),
                    tail(&fates)
                );
            }
        }
        text
    }
}
