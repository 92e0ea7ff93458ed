//! What is measured of the bank: a whole epoch of all its filters, the main one included, with the tests
//! and levels; usual ones, and those with births, held satellites, a failed test and an exclusion.

use super::dense::{self, PlainRow};
use super::dense_bank::{self, DenseBank};
use super::filter::{dense_covariance, dense_noise, dense_row, dense_transition};
use super::measure::{Of, Pass, Row, pass, require};
use super::risk;
use super::sky::{self, Random};
use core::hint::black_box;
use static_cell::ConstStaticCell;
use surefix_core::ekf::filter::PredictWorkspace;
use surefix_core::ekf::layout::{BLOCKS, FIRST_OFFSET};
use surefix_core::ekf::{EpochInformation, Filter, MeasurementRow, Transition, UpdateWorkspace};
use surefix_core::frames::geodesy;
use surefix_core::gnss::{CorrectedMeasurement, Satellite, System};
use surefix_core::linalg::block3::Symmetric;
use surefix_core::mhss::{
    Bank, BankEpoch, BankRow, BankVerdict, CorrelatedBound, Criterion, MAX_BANK, Secondaries,
    SeparationQuantiles, SubFilters,
};
use surefix_core::time::NS_PER_S;

/// Satellites of the rows.
const SATELLITES: [usize; 5] = [6, 8, 12, 16, 24];
/// Satellites of the rows with the monitor's four clocks.
const MONITOR_SATELLITES: [usize; 2] = [12, 24];
/// Satellites of the textbook's bank.
const PEER_SATELLITES: [usize; 2] = [6, dense_bank::MAX];
/// Epochs of it per row.
const PEER_RUNS: usize = 5;
/// Usual epochs per row: more than half of all, so that the median is one of them.
const USUAL: usize = 8;
/// Epochs per row of a stage.
const STAGE_RUNS: usize = 3;
/// Distance to a satellite, m.
const RANGE_M: f64 = 22_000e3;
/// A fault that every filter with the satellite shows at once, m.
const FAULT_M: f64 = 1e4;
/// A fault that grows by this much per epoch, m.
const RAMP_M: f64 = 2.0;

/// A bank with all its filters, and the epoch it is fed with.
pub struct Memory<const K: usize, const M: usize> {
    pub bank: Bank<K, M>,
    pub main: Filter<K, M>,
    pub sub: SubFilters<K, M>,
    secondaries: Secondaries<K, M>,
    information: EpochInformation<M>,
    predict_workspace: PredictWorkspace,
    update_workspace: UpdateWorkspace<K, M>,
    rows: [BankRow<M>; MAX_BANK],
    /// Where the satellites stand, ECEF, of unit length.
    sky: [[f64; 3]; MAX_BANK],
    epochs: i64,
}

/// Any satellite.
const FIRST: Satellite = match Satellite::new(System::Gps, 1) {
    Some(satellite) => satellite,
    None => panic!(),
};

impl<const K: usize, const M: usize> Memory<K, M> {
    const EMPTY: Self = Self {
        bank: Bank::EMPTY,
        main: Filter::EMPTY,
        sub: SubFilters::EMPTY,
        secondaries: Secondaries::EMPTY,
        information: EpochInformation::ZERO,
        predict_workspace: PredictWorkspace::EMPTY,
        update_workspace: UpdateWorkspace::EMPTY,
        rows: [BankRow {
            satellite: FIRST,
            row: MeasurementRow::ZERO,
        }; MAX_BANK],
        sky: [[0.0; 3]; MAX_BANK],
        epochs: 0,
    };
}

/// What all banks are run with.
pub struct Shared<'a> {
    pub transition: &'a Transition,
    pub criterion: Criterion<'a>,
}

// Statics, each built by the compiler: as values they would be ten times the stack.
static TWO_CLOCKS: ConstStaticCell<Memory<2, 8>> = ConstStaticCell::new(Memory::EMPTY);
static THREE_CLOCKS: ConstStaticCell<Memory<3, 9>> = ConstStaticCell::new(Memory::EMPTY);
static FOUR_CLOCKS: ConstStaticCell<Memory<4, 10>> = ConstStaticCell::new(Memory::EMPTY);
static DENSE: ConstStaticCell<DenseBank> = ConstStaticCell::new(DenseBank::EMPTY);

/// Measures the banks and prints their rows.
#[inline(never)]
pub fn all(transition: &Transition) {
    let mut quantiles = SeparationQuantiles::EMPTY;
    require(
        quantiles.fill(1e-6, 1e-3, 1e-7).is_ok(),
        "the risks were refused",
    );
    let llh = geodesy::to_llh(&sky::RECEIVER_E_M.into());
    let c_enu_e = llh.map(|llh| geodesy::c_enu_e(llh.lat_rad, llh.lon_rad));
    let Ok(c_enu_e) = c_enu_e else {
        return require(false, "the receiver is nowhere");
    };
    let shared = Shared {
        transition,
        criterion: Criterion {
            quantiles: &quantiles,
            vertical: true,
            c_enu_e: &c_enu_e,
        },
    };
    let mut random = Random::new(6);
    let (two, three, four) = (TWO_CLOCKS.take(), THREE_CLOCKS.take(), FOUR_CLOCKS.take());
    let bound = risk::bound();
    for n in SATELLITES {
        two.rows(&mut random, &shared, bound, n);
    }
    for n in SATELLITES {
        three.rows(&mut random, &shared, bound, n);
    }
    for n in MONITOR_SATELLITES {
        four.rows(&mut random, &shared, bound, n);
    }
    let dense = DENSE.take();
    for n in PEER_SATELLITES {
        peer(&mut random, &shared, two, dense, n);
    }
}

/// Starts with what a navigator starts with.
fn start<const K: usize, const M: usize>(filter: &mut Filter<K, M>) {
    let equal = |sigma: f64| -> Symmetric {
        let var = sigma * sigma;
        [var, 0.0, 0.0, var, 0.0, var]
    };
    let blocks = [10.0, 0.5, 0.01, 1e-4, 1e-2].map(equal);
    let mut clock_var = [100.0; K];
    clock_var[1] = 1.0;
    filter.start(&blocks, &clock_var);
}

impl<const K: usize, const M: usize> Memory<K, M> {
    const STATES: usize = 3 * BLOCKS + K;

    /// All rows with `n` satellites.
    #[inline(never)]
    fn rows(
        &mut self,
        random: &mut Random,
        shared: &Shared<'_>,
        bound: &mut CorrelatedBound,
        n: usize,
    ) {
        let filters = 1 + n + n * (n - 1) / 2;
        let of = Of {
            n_sats: Some(n),
            n_states: Some(Self::STATES),
            filters: Some(filters),
            ram_b: None,
        };
        let mut total = Row::new();
        let (mut birth, mut held, mut exclusion) = (Row::new(), Row::new(), Row::new());
        let also = |row: &mut Row, total: &mut Row, pass: Pass| {
            row.add(pass);
            total.add(pass);
        };

        // Everything at once: all satellites are new and the last of them is faulty.
        self.begin(random, shared);
        let (pass, verdict) = self.measured(random, shared, n, Some((n - 1, FAULT_M)));
        require(
            verdict.isolated == Some(self.rows[n - 1].satellite),
            "the faulty satellite was not isolated",
        );
        also(&mut exclusion, &mut total, pass);

        self.begin(random, shared);
        let (pass, _) = self.measured(random, shared, n, None);
        also(&mut birth, &mut total, pass);
        for _ in 0..USUAL {
            let (pass, verdict) = self.measured(random, shared, n, None);
            require(!verdict.detected, "a usual epoch has a fault");
            total.add(pass);
        }
        if n == MAX_BANK {
            self.stages(random, shared, &of);
        }
        self.risk_rows(shared, bound, &of);
        let (pass, _) = self.measured(random, shared, n / 2, None);
        also(&mut held, &mut total, pass);
        let (pass, _) = self.measured(random, shared, 0, None);
        also(&mut held, &mut total, pass);
        self.measured(random, shared, n, None);
        let (pass, verdict) = self.measured(random, shared, n, Some((n - 1, FAULT_M)));
        require(verdict.isolated.is_some(), "no satellite was isolated");
        also(&mut exclusion, &mut total, pass);
        require(self.is_healthy(n), "a filter fell ill");
        // A ramp: when it is found, every filter without one satellite still agrees with most of the pairs'.
        self.begin(random, shared);
        self.measured(random, shared, n, None);
        let mut fault_m = 0.0;
        let found = loop {
            fault_m += RAMP_M;
            let (pass, verdict) = self.measured(random, shared, n, Some((n - 1, fault_m)));
            if verdict.detected || fault_m > FAULT_M {
                require(verdict.detected, "the ramp was not found");
                break pass;
            }
        };
        also(&mut exclusion, &mut total, found);

        total.print_of(
            "bank/total",
            &Of {
                ram_b: Some(filters * size_of::<Filter<K, M>>()),
                ..of
            },
        );
        birth.print_of("bank/births", &of);
        held.print_of("bank/held", &of);
        exclusion.print_of("bank/exclusion", &of);
    }

    /// No satellite, a new sky and a filter that has just begun.
    fn begin(&mut self, random: &mut Random, shared: &Shared<'_>) {
        self.bank.clear();
        start(&mut self.main);
        for (index, (row, u_e)) in self.rows.iter_mut().zip(&mut self.sky).enumerate() {
            let u = shared.criterion.c_enu_e.transpose()
                * nalgebra::Vector3::from(sky::direction(random));
            *u_e = u.into();
            if let Some(satellite) = Satellite::new(System::Gps, 1 + index as u8) {
                row.satellite = satellite;
            }
        }
        self.epochs = 0;
    }

    /// An epoch with the first `n` satellites, one of them perhaps faulty; what it cost and what came of it.
    fn measured(
        &mut self,
        random: &mut Random,
        shared: &Shared<'_>,
        n: usize,
        faulty: Option<(usize, f64)>,
    ) -> (Pass, BankVerdict) {
        self.observe(random);
        if let Some((index, fault_m)) = faulty {
            self.rows[index].row.innovation_m += fault_m;
        }
        let mut verdict = None;
        let pass = pass(|| verdict = Some(self.epoch(black_box(shared), black_box(n))));
        let Some(verdict) = verdict else {
            unreachable!();
        };
        (pass, verdict)
    }

    /// Measurements of all satellites, of the constellations in turn.
    fn observe(&mut self, random: &mut Random) {
        for (index, (row, u_e)) in self.rows.iter_mut().zip(&self.sky).enumerate() {
            let mut r_es_e_m = sky::RECEIVER_E_M;
            for (r, u) in r_es_e_m.iter_mut().zip(u_e) {
                *r += RANGE_M * u;
            }
            let constellation = index % (K - 1);
            let offset = (constellation > 0).then_some(FIRST_OFFSET + constellation - 1);
            // Along the line of sight nothing moves; across it the satellite does.
            let v_es_e_mps = [3000.0 * u_e[1], -3000.0 * u_e[0], 0.0];
            let measurement = CorrectedMeasurement {
                satellite: row.satellite,
                r_es_e_m,
                v_es_e_mps,
                pseudorange_m: RANGE_M + 3.0 * random.normal(),
                sigma_pseudorange_m: 3.0,
                range_rate_mps: Some((0.1 * random.normal(), 0.1)),
            };
            let made =
                MeasurementRow::new(&measurement, sky::RECEIVER_E_M, [0.0; 3], &[0.0; K], offset);
            if let Some(made) = made {
                row.row = made;
            }
        }
    }

    /// The epoch, as the monitor runs it.
    #[inline(never)]
    fn epoch(&mut self, shared: &Shared<'_>, n: usize) -> BankVerdict {
        self.predict(shared);
        self.admit(n);
        self.update();
        let verdict = self.test(shared);
        self.correct();
        verdict
    }

    /// Usual epochs in their stages.
    #[inline(never)]
    fn stages(&mut self, random: &mut Random, shared: &Shared<'_>, of: &Of) {
        let [mut predict, mut admit, mut update] = [const { Row::new() }; 3];
        let (mut test, mut rereference) = (Row::new(), Row::new());
        for _ in 0..STAGE_RUNS {
            self.observe(random);
            predict.run(|| self.predict(black_box(shared)));
            admit.run(|| self.admit(black_box(MAX_BANK)));
            update.run(|| self.update());
            test.run(|| {
                black_box(self.test(black_box(shared)));
            });
            rereference.run(|| self.correct());
        }
        predict.print_of("bank/predict", of);
        admit.print_of("bank/admit", of);
        update.print_of("bank/update", of);
        test.print_of("bank/test", of);
        rereference.print_of("bank/rereference", of);
    }

    #[inline(never)]
    fn predict(&mut self, shared: &Shared<'_>) {
        self.main
            .predict(shared.transition, &mut self.predict_workspace);
        self.bank
            .predict(shared.transition, &mut self.sub, &mut self.secondaries);
    }

    /// Births and deaths, and the sums of the epoch with its first `n` satellites.
    #[inline(never)]
    fn admit(&mut self, n: usize) {
        self.epochs += 1;
        self.bank.admit(
            &BankEpoch {
                time: sky::TIME.plus_ns(self.epochs * NS_PER_S),
                rows: &self.rows[..n],
                hold_ns: 100 * NS_PER_S,
            },
            &self.main,
            &mut self.sub,
            &mut self.secondaries,
            &mut self.information,
        );
    }

    #[inline(never)]
    fn update(&mut self) {
        self.main
            .update(&self.information, &mut self.update_workspace);
        self.bank.update(&mut self.sub, &mut self.secondaries);
    }

    /// Tests and levels, isolation where a test fails, exclusion.
    #[inline(never)]
    fn test(&mut self, shared: &Shared<'_>) -> BankVerdict {
        let Self {
            bank,
            main,
            sub,
            secondaries,
            ..
        } = self;
        let verdict = bank.test(&shared.criterion, main, sub, secondaries);
        if let Some(satellite) = verdict.isolated {
            bank.exclude(satellite, main, sub, secondaries);
        }
        verdict
    }

    #[inline(never)]
    fn correct(&mut self) {
        let correction = *self.main.state();
        self.main.rereference(&correction);
        self.bank
            .rereference(&correction, &mut self.sub, &mut self.secondaries);
    }

    /// Whether every filter with the first `n` satellites is well.
    fn is_healthy(&self, n: usize) -> bool {
        let satellites = || self.rows.iter().take(n).map(|row| row.satellite);
        let well =
            |filter: Option<&Filter<K, M>>| filter.is_none_or(|filter| filter.check().is_ok());
        self.main.check().is_ok()
            && satellites().all(|one| {
                well(self.bank.sub_filter(one, &self.sub))
                    && satellites()
                        .all(|other| well(self.bank.secondary([one, other], &self.secondaries)))
            })
    }
}

/// The same epochs through the bank of dense filters, which must come to the same.
fn peer(
    random: &mut Random,
    shared: &Shared<'_>,
    ours: &mut Memory<2, 8>,
    dense: &mut DenseBank,
    n: usize,
) {
    let Criterion {
        quantiles, c_enu_e, ..
    } = shared.criterion;
    ours.begin(random, shared);
    dense.start(
        &dense_transition(shared.transition),
        &dense_noise(shared.transition, &mut ours.predict_workspace),
        &dense_covariance(&ours.main),
    );
    let mut row = Row::new();
    for _ in 0..PEER_RUNS {
        let (_, verdict) = ours.measured(random, shared, n, None);
        for (index, BankRow { row, .. }) in ours.rows.iter().take(n).enumerate() {
            let scalar = |design: &[f64; 8], innovation: f64, weight: f64| PlainRow {
                design: dense_row(design),
                innovation,
                variance: 1.0 / weight,
            };
            dense.set_rows(
                index,
                [
                    scalar(&row.pseudorange, row.innovation_m, row.weight),
                    scalar(&row.range_rate, row.innovation_mps, row.range_rate_weight),
                ],
            );
        }
        let mut levels_m = [0.0; 2];
        row.run(|| {
            let quantiles = [quantiles.detection(n), quantiles.missed()];
            levels_m = dense.epoch(black_box(n), black_box(c_enu_e), quantiles);
        });
        let satellite = |index: usize| ours.rows[index].satellite;
        let pair = ours
            .bank
            .secondary([satellite(n - 2), satellite(n - 1)], &ours.secondaries);
        let agree = dense.main().agrees_with(&dense_covariance(&ours.main))
            && pair.is_some_and(|pair| dense.last_pair(n).agrees_with(&dense_covariance(pair)))
            && levels_m
                .iter()
                .zip(verdict.level_m)
                .all(|(theirs, ours)| libm::fabs(theirs - ours) < 1e-6 * ours);
        require(agree, "the banks disagree");
    }
    let filters = 1 + n + n * (n - 1) / 2;
    row.print_of(
        "peer/dense_bank",
        &Of {
            n_sats: Some(n),
            n_states: Some(dense::STATES),
            filters: Some(filters),
            ram_b: Some(filters * size_of::<dense::PlainFilter>()),
        },
    );
}
