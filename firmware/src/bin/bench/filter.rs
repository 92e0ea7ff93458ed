//! What is measured of the filter: an epoch's transition, prediction and update, beside what a
//! textbook and a matrix library take for the same.

use super::dense::{self, STATES};
use super::inertial::{SAMPLES_PER_EPOCH, UNIT};
use super::measure::{RUNS, Row, require};
use super::sky::{self, Random};
use core::hint::black_box;
use static_cell::ConstStaticCell;
use surefix_core::consts::OMEGA_EARTH_WGS84_RADPS;
use surefix_core::ekf::filter::PredictWorkspace;
use surefix_core::ekf::layout::{ATTITUDE, BLOCKS, GYRO_BIAS};
use surefix_core::ekf::{
    EpochInformation, Filter, LeverState, MeasurementRow, ProcessAccumulator, Transition,
    UpdateWorkspace,
};
use surefix_core::linalg::block3::{Block, Symmetric};

/// Satellites of the rows.
const SATELLITES: [usize; 5] = [6, 8, 12, 16, 24];
const MAX_SATELLITES: usize = 24;
/// Satellites of the peers.
const PEER_SATELLITES: usize = dense::ROWS / 2;

const SAMPLE_S: f64 = 0.01;

/// A filter and all that it is fed with.
struct Bank<const K: usize, const M: usize> {
    filter: Filter<K, M>,
    information: EpochInformation<M>,
    rows: [MeasurementRow<M>; MAX_SATELLITES],
    workspace: UpdateWorkspace<K, M>,
}

impl<const K: usize, const M: usize> Bank<K, M> {
    const EMPTY: Self = Self {
        filter: Filter::EMPTY,
        information: EpochInformation::ZERO,
        rows: [MeasurementRow::ZERO; MAX_SATELLITES],
        workspace: UpdateWorkspace::EMPTY,
    };
}

static PROCESS: ConstStaticCell<ProcessAccumulator> =
    ConstStaticCell::new(ProcessAccumulator::EMPTY);
static PREDICT: ConstStaticCell<PredictWorkspace> = ConstStaticCell::new(PredictWorkspace::EMPTY);
static TWO_CLOCKS: ConstStaticCell<Bank<2, 8>> = ConstStaticCell::new(Bank::EMPTY);
static THREE_CLOCKS: ConstStaticCell<Bank<3, 9>> = ConstStaticCell::new(Bank::EMPTY);
static FOUR_CLOCKS: ConstStaticCell<Bank<4, 10>> = ConstStaticCell::new(Bank::EMPTY);
static PEERS: ConstStaticCell<dense::Peers> = ConstStaticCell::new(dense::Peers::EMPTY);

/// Measures the filter and its peers and prints their rows; gives the transition they were carried over.
#[inline(never)]
pub fn all() -> &'static Transition {
    let (process, workspace) = (PROCESS.take(), PREDICT.take());
    let mut random = Random::new(4);
    let transition = epoch(&mut random, process);
    let two = TWO_CLOCKS.take();
    rows(&mut random, two, transition, workspace);
    rows(&mut random, THREE_CLOCKS.take(), transition, workspace);
    rows(&mut random, FOUR_CLOCKS.take(), transition, workspace);
    peers(&mut random, two, transition, workspace);
    transition
}

/// A second of samples in straight flight, with a lever arm.
#[inline(never)]
fn epoch<'a>(random: &mut Random, process: &'a mut ProcessAccumulator) -> &'a Transition {
    let c_e_b = sky::attitude(random);
    let lever = LeverState::new(
        UNIT.lever_arm_b_m,
        &c_e_b,
        [0.01, 0.02, 0.1],
        OMEGA_EARTH_WGS84_RADPS,
    );
    process.start(&UNIT.noise, &UNIT.clock, OMEGA_EARTH_WGS84_RADPS, &lever);
    process.set_gradient(&[1e-7, 8e-7, 2e-6, 8e-7, -1e-6, 5e-7, 2e-6, 5e-7, 1e-6]);
    let dv_e_mps = [0.065, 0.012, 0.073];
    let mut row = Row::new();
    for _ in 0..RUNS {
        process.begin();
        row.run(|| {
            for _ in 0..SAMPLES_PER_EPOCH {
                process.add(SAMPLE_S, black_box(dv_e_mps), black_box(&c_e_b));
            }
            black_box(process.finish(black_box(&lever)));
        });
    }
    row.print("ekf/process", None, None);
    process.finish(&lever)
}

/// Prediction, information and update with K clock states.
#[inline(never)]
fn rows<const K: usize, const M: usize>(
    random: &mut Random,
    bank: &mut Bank<K, M>,
    transition: &Transition,
    workspace: &mut PredictWorkspace,
) {
    let states = Some(3 * BLOCKS + K);
    let mut predict = Row::new();
    for _ in 0..RUNS {
        start(&mut bank.filter);
        bank.filter.predict(transition, workspace);
        take(random, bank, 12);
        predict.run(|| bank.filter.predict(black_box(transition), workspace));
        require(bank.filter.check().is_ok(), "the filter fell ill");
    }
    predict.print("ekf/predict", None, states);
    for n in SATELLITES {
        let (mut information, mut addition) = (Row::new(), Row::new());
        let (mut update, mut both) = (Row::new(), Row::new());
        for _ in 0..RUNS {
            start(&mut bank.filter);
            bank.filter.predict(transition, workspace);
            let Bank {
                filter,
                information: sum,
                rows,
                workspace: update_workspace,
            } = bank;
            fill(random, rows);
            information.run(|| {
                sum.clear();
                for row in rows.iter().take(black_box(n)) {
                    sum.add_row(row);
                }
            });
            let mut twice = EpochInformation::ZERO;
            addition.run(|| twice.set_sum(black_box(sum), black_box(sum)));
            update.run(|| {
                black_box(filter.update(black_box(sum), update_workspace));
            });
            fill(random, rows);
            both.run(|| {
                filter.predict(black_box(transition), workspace);
                black_box(filter.update(black_box(sum), update_workspace));
            });
            require(filter.check().is_ok(), "the filter fell ill");
        }
        information.print("ekf/information", Some(n), states);
        if n == 12 {
            addition.print("ekf/information+information", None, states);
        }
        update.print("ekf/update", Some(n), states);
        both.print("ekf/predict+update", Some(n), states);
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

/// Rows of satellites in random directions, of the constellations in turn.
fn fill<const M: usize>(random: &mut Random, rows: &mut [MeasurementRow<M>]) {
    for (index, row) in rows.iter_mut().enumerate() {
        *row = MeasurementRow::ZERO;
        let e = sky::direction(random);
        row.pseudorange[..3].copy_from_slice(&e);
        row.pseudorange[6] = 1.0;
        // The first constellation has no offset column.
        let constellation = index % (M - 7);
        if constellation > 0 {
            row.pseudorange[7 + constellation] = 1.0;
        }
        row.innovation_m = 3.0 * random.normal();
        row.weight = 1.0 / 9.0;
        for (entry, e) in row.range_rate.iter_mut().zip(e) {
            *entry = 1e-4 * e;
        }
        row.range_rate[3..6].copy_from_slice(&e);
        row.range_rate[7] = 1.0;
        row.innovation_mps = 0.1 * random.normal();
        row.range_rate_weight = 100.0;
    }
}

/// Updates with `n` satellites.
fn take<const K: usize, const M: usize>(random: &mut Random, bank: &mut Bank<K, M>, n: usize) {
    fill(random, &mut bank.rows);
    bank.information.clear();
    for row in bank.rows.iter().take(n) {
        bank.information.add_row(row);
    }
    bank.filter.update(&bank.information, &mut bank.workspace);
}

/// The same prediction and the same rows by other means.
#[inline(never)]
fn peers(
    random: &mut Random,
    bank: &mut Bank<2, 8>,
    transition: &Transition,
    workspace: &mut PredictWorkspace,
) {
    let peers = PEERS.take();
    peers.set_transition(
        &dense_transition(transition),
        &dense_noise(transition, workspace),
    );
    let (mut plain_predict, mut plain_update) = (Row::new(), Row::new());
    let (mut expression_predict, mut expression_update) = (Row::new(), Row::new());
    for _ in 0..RUNS {
        start(&mut bank.filter);
        bank.filter.predict(transition, workspace);
        take(random, bank, PEER_SATELLITES);
        peers.set(&dense_covariance(&bank.filter), &dense_state(&bank.filter));
        bank.filter.predict(transition, workspace);
        plain_predict.run(|| black_box(&mut *peers).plain_predict());
        expression_predict.run(|| black_box(&mut *peers).expression_predict());
        require(
            peers.agree_with(&dense_covariance(&bank.filter)),
            "the predictions disagree",
        );
        take(random, bank, PEER_SATELLITES);
        for (index, row) in bank.rows.iter().take(PEER_SATELLITES).enumerate() {
            peers.set_row(
                2 * index,
                &dense_row(&row.pseudorange),
                row.innovation_m,
                row.weight,
            );
            peers.set_row(
                2 * index + 1,
                &dense_row(&row.range_rate),
                row.innovation_mps,
                row.range_rate_weight,
            );
        }
        plain_update.run(|| black_box(&mut *peers).plain_update());
        let mut solved = false;
        expression_update.run(|| solved = black_box(&mut *peers).expression_update());
        require(
            solved && peers.agree_with(&dense_covariance(&bank.filter)),
            "the updates disagree",
        );
    }
    let (n, states) = (Some(PEER_SATELLITES), Some(STATES));
    plain_predict.print("peer/plain_predict", None, states);
    plain_update.print("peer/plain_update", n, states);
    expression_predict.print("peer/nalgebra_predict", None, states);
    expression_update.print("peer/nalgebra_update", n, states);
}

/// First clock state.
const CLOCKS: usize = 3 * BLOCKS;

fn put(m: &mut dense::Matrix, row: usize, column: usize, block: &Block) {
    for i in 0..3 {
        for j in 0..3 {
            m[3 * row + i][3 * column + j] = block[3 * i + j];
        }
    }
}

pub fn dense_transition(transition: &Transition) -> dense::Matrix {
    let mut m = dense::ZERO;
    for (i, row) in m.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    let phi = &transition.phi;
    for (column, (position, velocity)) in phi.position.iter().zip(&phi.velocity).enumerate() {
        put(&mut m, 0, column, position);
        put(&mut m, 1, column, velocity);
    }
    put(&mut m, ATTITUDE, ATTITUDE, &phi.attitude[0]);
    put(&mut m, ATTITUDE, GYRO_BIAS, &phi.attitude[1]);
    m[CLOCKS][CLOCKS + 1] = transition.clock.bias_per_drift_s;
    m[CLOCKS + 1][CLOCKS + 1] = transition.clock.decay;
    m
}

/// Q as the covariance of a filter that starts certain and is moved once.
pub fn dense_noise(transition: &Transition, workspace: &mut PredictWorkspace) -> dense::Matrix {
    let mut filter = Filter::<2, 8>::EMPTY;
    filter.predict(transition, workspace);
    dense_covariance(&filter)
}

pub fn dense_covariance(filter: &Filter<2, 8>) -> dense::Matrix {
    let mut m = dense::ZERO;
    for row in 0..BLOCKS {
        for column in 0..BLOCKS {
            put(&mut m, row, column, &filter.cross_block(row, column));
        }
        for clock in 0..2 {
            for (i, entry) in filter.clock_cross(row, clock).into_iter().enumerate() {
                m[3 * row + i][CLOCKS + clock] = entry;
                m[CLOCKS + clock][3 * row + i] = entry;
            }
        }
    }
    for (i, row) in filter.clock_covariance().iter().enumerate() {
        m[CLOCKS + i][CLOCKS..].copy_from_slice(row);
    }
    m
}

pub fn dense_state(filter: &Filter<2, 8>) -> [f64; STATES] {
    let state = filter.state();
    let mut x = [0.0; STATES];
    for (x, entry) in x
        .iter_mut()
        .zip(state.navigation.iter().flatten().chain(&state.clock))
    {
        *x = *entry;
    }
    x
}

pub fn dense_row(design: &[f64; 8]) -> [f64; STATES] {
    let mut h = [0.0; STATES];
    h[..6].copy_from_slice(&design[..6]);
    h[CLOCKS..].copy_from_slice(&design[6..]);
    h
}
