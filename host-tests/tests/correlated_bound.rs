//! The bound for correlated errors against the exact covariance, for correlation times from a second to ever.
//!
//! Filters of a bank over a sky whose satellites come and go are run once; their gains then carry the exact
//! covariance of their errors along when every pseudorange error is a first-order Gauss-Markov process of the
//! filter's own sigma, no part of it white:
//!
//! ```text
//! e ← (I − K H) (Φ e + w) + K b,   b ← φ b + √(1 − φ²) σ ν
//! ```
//!
//! The bound says that the variance of each position, and of each separation from the main filter, is at most
//! what the filter says itself plus the correlated part (core/src/mhss/correlated.rs).

use nalgebra::{Matrix3, SMatrix, Vector3};
use surefix_core::ekf::filter::PredictWorkspace;
use surefix_core::ekf::layout::{
    ACCEL_BIAS, ATTITUDE, BLOCKS, GYRO_BIAS, JOINT_NAVIGATION, POSITION, VELOCITY,
};
use surefix_core::ekf::{
    EpochInformation, Filter, LeverState, MeasurementRow, ProcessAccumulator, Transition,
    UpdateWorkspace,
};
use surefix_core::frames::geodesy;
use surefix_core::gnss::{Satellite, System};
use surefix_core::ins::ClockNoise;
use surefix_core::ins::gravity::gravity_gradient_e;
use surefix_core::mhss::bank::{ExtraNoise, OwnVariances};
use surefix_core::mhss::{
    Bank, BankEpoch, BankRow, CorrelatedBound, CorrelatedRow, Criterion, Secondaries,
    SeparationQuantiles, SubFilters,
};
use surefix_core::time::GpsTime;
use surefix_host_tests::consistency::Grade;

const K: usize = 4;
const M: usize = 10;
const STATES: usize = 15 + K;
const SATELLITES: usize = 12;
type Dense = SMatrix<f64, STATES, STATES>;
type Gains = SMatrix<f64, STATES, SATELLITES>;
type Design = SMatrix<f64, SATELLITES, STATES>;

/// Azimuth and elevation, degrees; the first half is GPS, the second BDS.
const SKY: [[f64; 2]; SATELLITES] = [
    [10.0, 70.0],
    [75.0, 35.0],
    [140.0, 20.0],
    [200.0, 50.0],
    [265.0, 15.0],
    [320.0, 40.0],
    [40.0, 25.0],
    [100.0, 60.0],
    [170.0, 45.0],
    [230.0, 12.0],
    [290.0, 30.0],
    [350.0, 18.0],
];
const SIGMA_M: f64 = 1.5;
const SIGMA_MPS: f64 = 0.05;
const CORRELATION_TIMES_S: [f64; 6] = [1.0, 10.0, 30.0, 100.0, 300.0, 1e12];

/// How many satellites are seen from a second on; they are those of lowest numbers, both systems in turn.
struct Schedule {
    name: &'static str,
    steps: &'static [(usize, usize)],
    length_s: usize,
}

const SCHEDULES: [Schedule; 3] = [
    Schedule {
        name: "all",
        steps: &[(0, 12)],
        length_s: 400,
    },
    Schedule {
        name: "outages",
        steps: &[
            (0, 12),
            (200, 6),
            (260, 4),
            (320, 3),
            (380, 2),
            (440, 1),
            (500, 0),
            (560, 12),
        ],
        length_s: 700,
    },
    Schedule {
        name: "growing",
        steps: &[(0, 6), (150, 9), (300, 12)],
        length_s: 450,
    },
];

impl Schedule {
    /// Satellites at a second.
    fn seen(&self, t_s: usize) -> Vec<usize> {
        let (_, count) = self
            .steps
            .iter()
            .rev()
            .find(|(from, _)| *from <= t_s)
            .unwrap();
        (0..*count)
            .map(|k| k / 2 + (k % 2) * (SATELLITES / 2))
            .collect()
    }
}

fn satellite(number: usize) -> Satellite {
    let prn = (number % (SATELLITES / 2) + 1) as u8;
    let system = if number < SATELLITES / 2 {
        System::Gps
    } else {
        System::Bds
    };
    Satellite::new(system, prn + 5).unwrap()
}

fn place() -> (Vector3<f64>, Matrix3<f64>) {
    let llh = geodesy::Llh {
        lat_rad: 0.95,
        lon_rad: 0.2,
        height_m: 100.0,
    };
    (
        geodesy::to_ecef(&llh),
        geodesy::c_enu_e(llh.lat_rad, llh.lon_rad),
    )
}

fn row(number: usize, c_enu_e: &Matrix3<f64>) -> MeasurementRow<M> {
    let [azimuth, elevation] = SKY[number].map(f64::to_radians);
    let u_enu = Vector3::new(
        azimuth.sin() * elevation.cos(),
        azimuth.cos() * elevation.cos(),
        elevation.sin(),
    );
    let e = -(c_enu_e.transpose() * u_enu);
    let mut row = MeasurementRow::ZERO;
    let sigma_m = SIGMA_M / elevation.sin().sqrt();
    row.weight = 1.0 / (sigma_m * sigma_m);
    row.range_rate_weight = 1.0 / (SIGMA_MPS * SIGMA_MPS);
    for axis in 0..3 {
        row.pseudorange[axis] = e[axis];
        row.range_rate[3 + axis] = e[axis];
    }
    row.pseudorange[JOINT_NAVIGATION] = 1.0;
    row.range_rate[JOINT_NAVIGATION + 1] = 1.0;
    if number >= SATELLITES / 2 {
        row.pseudorange[JOINT_NAVIGATION + 2] = 1.0;
    }
    row
}

/// Where an entry of a measurement's joint block stands among the states.
fn state_of(joint: usize) -> usize {
    if joint < JOINT_NAVIGATION {
        joint
    } else {
        15 + joint - JOINT_NAVIGATION
    }
}

fn dense(transition: &Transition) -> (Dense, Dense) {
    let mut phi = Dense::identity();
    let mut q = Dense::zeros();
    let mut put = |row: usize, column: usize, block: &[f64; 9]| {
        phi.fixed_view_mut::<3, 3>(3 * row, 3 * column)
            .copy_from(&Matrix3::from_row_slice(block));
    };
    for column in 0..BLOCKS {
        put(POSITION, column, &transition.phi.position[column]);
        put(VELOCITY, column, &transition.phi.velocity[column]);
    }
    put(ATTITUDE, ATTITUDE, &transition.phi.attitude[0]);
    put(ATTITUDE, GYRO_BIAS, &transition.phi.attitude[1]);
    for block in 0..BLOCKS {
        let [xx, xy, xz, yy, yz, zz] = transition.noise.diagonal[block];
        let noise = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        q.fixed_view_mut::<3, 3>(3 * block, 3 * block)
            .copy_from(&noise);
    }
    let mut at = 0;
    for row in 0..BLOCKS {
        for column in row + 1..BLOCKS {
            let block = Matrix3::from_row_slice(&transition.noise.off_diagonal[at]);
            q.fixed_view_mut::<3, 3>(3 * row, 3 * column)
                .copy_from(&block);
            q.fixed_view_mut::<3, 3>(3 * column, 3 * row)
                .copy_from(&block.transpose());
            at += 1;
        }
    }
    let clock = &transition.clock;
    phi[(15, 16)] = clock.bias_per_drift_s;
    phi[(16, 16)] = clock.decay;
    q[(15, 15)] = clock.bias_var;
    q[(15, 16)] = clock.bias_drift_cov;
    q[(16, 15)] = clock.bias_drift_cov;
    q[(16, 16)] = clock.drift_var;
    for offset in 17..STATES {
        q[(offset, offset)] = clock.offset_var;
    }
    (phi, q)
}

fn covariance(filter: &Filter<K, M>) -> Dense {
    let mut p = Dense::zeros();
    for row in 0..BLOCKS {
        for column in 0..BLOCKS {
            let block = Matrix3::from_row_slice(&filter.cross_block(row, column));
            p.fixed_view_mut::<3, 3>(3 * row, 3 * column)
                .copy_from(&block);
        }
        for clock in 0..K {
            for (axis, entry) in filter.clock_cross(row, clock).into_iter().enumerate() {
                p[(3 * row + axis, 15 + clock)] = entry;
                p[(15 + clock, 3 * row + axis)] = entry;
            }
        }
    }
    for (a, row) in filter.clock_covariance().iter().enumerate() {
        for (b, entry) in row.iter().enumerate() {
            p[(15 + a, 15 + b)] = *entry;
        }
    }
    p
}

/// One filter's step: what its error is multiplied with, and its gains.
struct Step {
    /// (I − K H) Φ.
    carried: Dense,
    /// I − K H.
    kept: Dense,
    code: Gains,
    rate: Gains,
}

impl Step {
    fn new(filter: &Filter<K, M>, phi: &Dense, rows: &[Option<MeasurementRow<M>>]) -> Self {
        let p = covariance(filter);
        let (mut h_code, mut h_rate) = (Design::zeros(), Design::zeros());
        let (mut code, mut rate) = (Gains::zeros(), Gains::zeros());
        for (number, row) in rows.iter().enumerate() {
            let Some(row) = row else { continue };
            for joint in 0..M {
                h_code[(number, state_of(joint))] = row.pseudorange[joint];
                h_rate[(number, state_of(joint))] = row.range_rate[joint];
            }
            code.set_column(number, &(p * h_code.row(number).transpose() * row.weight));
            rate.set_column(
                number,
                &(p * h_rate.row(number).transpose() * row.range_rate_weight),
            );
        }
        let kept = Dense::identity() - code * h_code - rate * h_rate;
        Self {
            carried: kept * phi,
            kept,
            code,
            rate,
        }
    }
}

/// Exact covariance of the errors of the main filter and another one, for one correlation time.
struct Exact {
    phi: f64,
    code_var: SMatrix<f64, SATELLITES, SATELLITES>,
    rate_var: f64,
    errors: [[Dense; 2]; 2],
    with_noise: [Gains; 2],
}

impl Exact {
    fn new(tau_s: f64, start: &Dense, rows: &[MeasurementRow<M>]) -> Self {
        let mut code_var = SMatrix::zeros();
        for (number, row) in rows.iter().enumerate() {
            code_var[(number, number)] = 1.0 / row.weight;
        }
        Self {
            phi: (-1.0 / tau_s).exp(),
            code_var,
            rate_var: SIGMA_MPS * SIGMA_MPS,
            errors: [[*start; 2]; 2],
            with_noise: [Gains::zeros(); 2],
        }
    }

    fn step(&mut self, steps: [&Step; 2], q: &Dense) {
        let mut errors = [[Dense::zeros(); 2]; 2];
        for a in 0..2 {
            for b in 0..2 {
                let (of, by) = (steps[a], steps[b]);
                errors[a][b] = of.carried * self.errors[a][b] * by.carried.transpose()
                    + of.kept * q * by.kept.transpose()
                    + of.rate * by.rate.transpose() * self.rate_var
                    + of.carried * self.with_noise[a] * by.code.transpose()
                    + of.code * self.with_noise[b].transpose() * by.carried.transpose()
                    + of.code * self.code_var * by.code.transpose();
            }
        }
        self.errors = errors;
        for (with_noise, of) in self.with_noise.iter_mut().zip(steps) {
            *with_noise = (of.carried * *with_noise + of.code * self.code_var) * self.phi;
        }
    }

    /// Variances of the second filter's position and of the separation, m².
    fn variances(&self, c_enu_e: &Matrix3<f64>) -> [[f64; 2]; 2] {
        let [[main, cross], [cross_of_other, other]] = &self.errors;
        let separation = main + other - cross - cross_of_other;
        [other, &separation].map(|p| {
            let p = c_enu_e * p.fixed_view::<3, 3>(0, 0) * c_enu_e.transpose();
            let half = 0.5 * (p.m11 - p.m22);
            [0.5 * (p.m11 + p.m22) + half.hypot(p.m12), p.m33]
        })
    }
}

/// Notes what the bound says of each filter.
struct Recorder<'a> {
    bound: &'a mut CorrelatedBound,
    said: Vec<(usize, [f64; 2], [[f64; 2]; 2])>,
}

impl ExtraNoise for Recorder<'_> {
    fn main(&mut self, own: &OwnVariances) -> [f64; 2] {
        let extra = self.bound.main(own);
        self.said.push((usize::MAX, own.left, [extra, [0.0; 2]]));
        extra
    }

    fn sub(&mut self, place: usize, own: &OwnVariances) -> [[f64; 2]; 2] {
        let extra = self.bound.sub(place, own);
        self.said.push((place, own.left, extra));
        extra
    }

    fn constellation(&mut self, constellation: usize, own: &OwnVariances) -> [[f64; 2]; 2] {
        let extra = self.bound.constellation(constellation, own);
        self.said.push((100 + constellation, own.left, extra));
        extra
    }

    fn unaided(&mut self, own: &OwnVariances) -> [[f64; 2]; 2] {
        self.bound.unaided(own)
    }

    fn pair(&self, base: usize, other: usize) -> [f64; 2] {
        self.bound.pair(base, other)
    }
}

/// Largest ratio of exact to bound: position horizontal and vertical, separation horizontal and vertical,
/// each of one sigma.
type Ratios = [f64; 4];

fn worst(grade: &Grade, schedule: &Schedule, left_out: usize) -> Vec<(f64, Ratios)> {
    let (r_e, c_enu_e) = place();
    let rows: Vec<MeasurementRow<M>> = (0..SATELLITES).map(|n| row(n, &c_enu_e)).collect();
    let clock = ClockNoise {
        bias_psd: 0.01,
        drift_psd: 0.001,
        drift_decay_per_s: 0.0,
        inter_system_psd: 1e-6,
    };
    let mut process = ProcessAccumulator::EMPTY;
    process.start(&grade.noise, &clock, 7.292115e-5, &LeverState::ZERO);
    let gradient = gravity_gradient_e(&r_e);
    let mut block = [0.0; 9];
    block.copy_from_slice(gradient.transpose().as_slice());
    process.set_gradient(&block);
    let up = c_enu_e.row(2).transpose();

    let start = grade.start();
    let mut main: Filter<K, M> = Filter::EMPTY;
    let equal = |sigma: f64| {
        let var = sigma * sigma;
        [var, 0.0, 0.0, var, 0.0, var]
    };
    let mut blocks = [[0.0; 6]; BLOCKS];
    blocks[POSITION] = equal(start.position_m);
    blocks[VELOCITY] = equal(start.velocity_mps);
    blocks[ATTITUDE] = equal(start.attitude_rad[1]);
    blocks[GYRO_BIAS] = equal(grade.sigma_gyro_bias);
    blocks[ACCEL_BIAS] = equal(grade.sigma_accel_bias);
    main.start(&blocks, &[9e4, 100.0, 9e6, 9e6]);
    let start_p = covariance(&main);

    let mut bank: Box<Bank<K, M>> = Box::new(Bank::EMPTY);
    let mut sub: Box<SubFilters<K, M>> = Box::new(SubFilters::EMPTY);
    let mut secondaries: Box<Secondaries<K, M>> = Box::new(Secondaries::EMPTY);
    let mut bound = Box::new(CorrelatedBound::NONE);
    bound.start(1.0, [0.0; 2]);
    let mut quantiles = SeparationQuantiles::EMPTY;
    quantiles.fill(1e-7, 1e-3, 1e-7).unwrap();
    let mut information = EpochInformation::ZERO;
    let mut workspace = PredictWorkspace::EMPTY;
    let mut update_workspace = UpdateWorkspace::EMPTY;
    let mut exact: Vec<Exact> = CORRELATION_TIMES_S
        .iter()
        .map(|tau| Exact::new(*tau, &start_p, &rows))
        .collect();
    let mut ratios = vec![[0.0_f64; 4]; exact.len()];

    for t_s in 1..schedule.length_s {
        let c_e_b = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        for _ in 0..10 {
            process.add(0.1, (up * (9.8 * 0.1)).into(), &c_e_b);
        }
        let transition = process.finish(&LeverState::ZERO).clone();
        process.begin();
        let (phi, q) = dense(&transition);
        main.predict(&transition, &mut workspace);
        bank.predict(&transition, &mut sub, &mut secondaries);
        let seen = schedule.seen(t_s);
        let epoch: Vec<BankRow<M>> = seen
            .iter()
            .map(|number| BankRow {
                satellite: satellite(*number),
                row: rows[*number],
            })
            .collect();
        bank.admit(
            &BankEpoch {
                time: GpsTime::from_ns(t_s as i64 * 1_000_000_000),
                rows: &epoch,
                hold_ns: i64::MAX,
            },
            &main,
            &mut sub,
            &mut secondaries,
            &mut information,
        );
        for begun in bank.begun() {
            bound.begin(begun);
        }
        for (constellation, begins) in bank
            .monitor_constellations(&main, &mut sub)
            .into_iter()
            .enumerate()
        {
            if begins {
                bound.begin_constellation(constellation);
            }
        }
        bank.note_predictions(&main, &sub, &c_enu_e);
        main.update(&information, &mut update_workspace);
        bank.update_constellations(&mut sub);
        bank.update(&mut sub, &mut secondaries);
        bound.solve(
            bank.present().map(|(place, satellite, row)| CorrelatedRow {
                place,
                constellation: satellite.system().index(),
                row,
                common_m: 0.0,
            }),
            &c_enu_e,
        );
        let criterion = Criterion {
            quantiles: &quantiles,
            vertical: true,
            c_enu_e: &c_enu_e,
        };
        let mut recorder = Recorder {
            bound: &mut bound,
            said: Vec::new(),
        };
        bank.assess(&criterion, &mut recorder, &main, &sub, &secondaries);
        let said = recorder.said;

        // The filter that is looked at: the main one itself, without a satellite, without a constellation.
        let present = |keep: &dyn Fn(usize) -> bool| -> Vec<Option<MeasurementRow<M>>> {
            (0..SATELLITES)
                .map(|n| (seen.contains(&n) && keep(n)).then_some(rows[n]))
                .collect()
        };
        let all = present(&|_| true);
        let main_step = Step::new(&main, &phi, &all);
        let (other, other_rows, id) = match left_out {
            n if n < SATELLITES => {
                let Some(place) = bank.place(satellite(n)) else {
                    // Not born yet: as the main one.
                    for exact in &mut exact {
                        exact.step([&main_step, &main_step], &q);
                    }
                    continue;
                };
                let filter = bank.sub_filter(satellite(n), &sub).unwrap();
                (filter, present(&|k| k != n), place)
            }
            GPS => (
                sub.constellation(System::Gps).unwrap(),
                present(&|k| k >= SATELLITES / 2),
                100 + System::Gps.index(),
            ),
            _ => (&main, all.clone(), usize::MAX),
        };
        let other_step = Step::new(other, &phi, &other_rows);
        let (_, own, [extra, between]) = *said.iter().find(|(of, ..)| *of == id).unwrap();
        let white = {
            let p = covariance(other) - covariance(&main);
            let p = c_enu_e * p.fixed_view::<3, 3>(0, 0) * c_enu_e.transpose();
            let half = 0.5 * (p.m11 - p.m22);
            [0.5 * (p.m11 + p.m22) + half.hypot(p.m12), p.m33]
        };
        for (exact, ratios) in exact.iter_mut().zip(&mut ratios) {
            exact.step([&main_step, &other_step], &q);
            let [position, separation] = exact.variances(&c_enu_e);
            for axis in 0..2 {
                let of_position = (position[axis] / (own[axis] + extra[axis])).sqrt();
                ratios[axis] = ratios[axis].max(of_position);
                // A separation below a millimetre is rounding of the differences here.
                let of_separation = separation[axis].max(0.0).sqrt()
                    / (white[axis].max(0.0) + between[axis]).sqrt().max(1e-3);
                ratios[2 + axis] = ratios[2 + axis].max(of_separation);
            }
        }
    }
    CORRELATION_TIMES_S.into_iter().zip(ratios).collect()
}

/// Stands for the filter without GPS.
const GPS: usize = 100;
/// Stands for the main filter itself.
const MAIN: usize = 1000;

/// INT-029.
#[test]
fn the_bound_holds_for_every_correlation_time() {
    println!("one sigma, exact over bound: position H, V, separation H, V");
    for grade in Grade::ALL {
        for schedule in &SCHEDULES {
            for left_out in [MAIN, 0, 5, GPS] {
                let table = worst(&grade, schedule, left_out);
                let name = match left_out {
                    MAIN => "all".to_owned(),
                    GPS => "without GPS".to_owned(),
                    n => format!("without {}", satellite(n)),
                };
                for (tau_s, [h, v, dh, dv]) in &table {
                    println!(
                        "{:10} {:8} {name:12} tau {tau_s:7.0} s: {h:.3} {v:.3} {dh:.3} {dv:.3}",
                        grade.name, schedule.name
                    );

                    assert!(*h <= 1.0 && *v <= 1.0, "position");
                    // Thresholds only: a separation beyond its bound costs false alerts, not integrity.
                    assert!(*dh <= 3.0 && *dv <= 3.0, "separation");
                }
            }
        }
    }
}
