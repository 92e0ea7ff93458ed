//! A nominal trajectory with errors, in a sky whose satellites come and go, without an end: what a bank of
//! filters sees, and the same as dense matrices.

#![allow(
    dead_code,
    reason = "each test that includes this module uses its part of it"
)]

use std::f64::consts::TAU;

use nalgebra::SVector;
use surefix_core::ekf::layout::{BLOCKS, JOINT_NAVIGATION};
use surefix_core::ekf::{
    ErrorState, Filter, LeverState, MeasurementRow, ProcessAccumulator, Transition,
};
use surefix_core::gnss::{CorrectedMeasurement, Satellite, System};
use surefix_core::ins::{ClockNoise, InertialNoise};
use surefix_core::linalg::block3::{Block, Symmetric};
use surefix_host_tests::reference::{Covariance, DenseFilter, Row, STATES};

use crate::skies::Random;

/// Clock states.
pub const K: usize = 2;
/// Joint block.
pub const M: usize = JOINT_NAVIGATION + K;
pub type Vector = SVector<f64, STATES>;

/// A satellite of the sky, in view or not.
#[derive(Clone, Copy)]
pub struct InView {
    pub satellite: Satellite,
    pub in_view: bool,
    /// Sine of the elevation, azimuth, distance.
    sine: f64,
    azimuth: f64,
    range: f64,
    v: [f64; 3],
    /// One sigma of pseudorange and range rate.
    pub sigmas: [f64; 2],
    pub has_rate: bool,
    /// On its pseudorange, m.
    pub fault_m: f64,
}

pub struct Flight {
    pub random: Random,
    pub sky: Vec<InView>,
    /// Error of the nominal.
    pub error: Vector,
    r: [f64; 3],
    v: [f64; 3],
    east: [f64; 3],
    north: [f64; 3],
    up: [f64; 3],
    heading: f64,
    process: ProcessAccumulator,
    /// One sigma of the first errors: blocks of navigation states, clock states.
    first: ([f64; BLOCKS], [f64; K]),
}

fn name(number: usize) -> Satellite {
    Satellite::new(System::Gps, 1 + number as u8).unwrap()
}

impl Flight {
    /// `satellites` in the sky, none of them in view; a unit of navigation to automotive grade.
    pub fn new(seed: u64, satellites: usize) -> Self {
        let mut random = Random(seed);
        let sine = 2.0 * random.uniform() - 1.0;
        let (cosine, longitude) = ((1.0 - sine * sine).sqrt(), TAU * random.uniform());
        let (sl, cl) = longitude.sin_cos();
        let up = [cosine * cl, cosine * sl, sine];
        let grade = 10.0_f64.powf(3.0 * random.uniform());
        let mut process = ProcessAccumulator::EMPTY;
        process.start(
            &InertialNoise {
                arw: 6e-7 * grade,
                vrw: 1e-4 * grade.sqrt(),
                gyro_bias_walk: 8e-11 * grade,
                accel_bias_walk: 5e-7 * grade,
            },
            &ClockNoise {
                bias_psd: 0.009,
                drift_psd: 0.0355,
                drift_decay_per_s: 0.0,
                inter_system_psd: 0.0,
            },
            7.292115e-5,
            &LeverState::ZERO,
        );
        let first = (
            [10.0, 0.5, 5e-3, 5e-8 * grade, 5e-4 * grade.sqrt()],
            [30.0, 1.0],
        );
        let mut error = Vector::zeros();
        for (k, entry) in error.iter_mut().enumerate() {
            let sigma = if k < 15 {
                first.0[k / 3]
            } else {
                first.1[k - 15]
            };
            *entry = sigma * random.normal();
        }
        let mut flight = Self {
            sky: Vec::new(),
            error,
            r: up.map(|u| u * (6.36e6 + 3e4 * random.uniform())),
            v: [0; 3].map(|_| 150.0 * random.normal()),
            east: [-sl, cl, 0.0],
            north: [-sine * cl, -sine * sl, cosine],
            up,
            heading: TAU * random.uniform(),
            process,
            first,
            random,
        };
        flight.sky = (0..satellites).map(|k| flight.anywhere(name(k))).collect();
        flight
    }

    fn anywhere(&mut self, satellite: Satellite) -> InView {
        let random = &mut self.random;
        InView {
            satellite,
            in_view: false,
            sine: 0.087 + 0.9 * random.uniform(),
            azimuth: TAU * random.uniform(),
            range: 2e7 + 1.8e7 * random.uniform(),
            v: [0; 3].map(|_| 2000.0 * random.normal()),
            sigmas: [0.3 + 3.0 * random.uniform(), 0.02 + 0.1 * random.uniform()],
            has_rate: random.integer(0, 9) > 0,
            fault_m: 0.0,
        }
    }

    /// A satellite comes into view, from anywhere, or leaves it.
    pub fn toggle(&mut self, number: usize) {
        let in_view = !self.sky[number].in_view;
        if in_view {
            self.sky[number] = self.anywhere(self.sky[number].satellite);
        }
        self.sky[number].in_view = in_view;
    }

    /// The filter at the start.
    pub fn filter(&self) -> Filter<K, M> {
        let (blocks, clocks) = self.first;
        let mut filter = Filter::EMPTY;
        let equal = |sigma: f64| [sigma * sigma, 0.0, 0.0, sigma * sigma, 0.0, sigma * sigma];
        filter.start(&blocks.map(equal), &clocks.map(|sigma| sigma * sigma));
        filter
    }

    /// Rotation from ECEF to east, north, up.
    pub fn c_enu_e(&self) -> nalgebra::Matrix3<f64> {
        nalgebra::Matrix3::from_fn(|i, j| [self.east, self.north, self.up][i][j])
    }

    /// A second of motion with its turn and accelerations; the errors move along.
    pub fn fly(&mut self) -> Transition {
        self.process.begin();
        self.heading += 0.3 * self.random.normal();
        let (s, c) = self.heading.sin_cos();
        let attitude = [c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0];
        let mean: [f64; 3] = std::array::from_fn(|k| 9.8 * self.up[k] + self.random.normal());
        for _ in 0..100 {
            let dv = mean.map(|f| 0.01 * (f + 0.1 * self.random.normal()));
            self.process.add(0.01, dv, &attitude);
        }
        let transition = self.process.finish(&LeverState::ZERO).clone();
        let (phi, q) = dense(&transition);
        self.error = phi * self.error;
        for k in 0..STATES {
            self.error[k] += q[(k, k)].sqrt() * self.random.normal();
        }
        transition
    }

    /// Rows of the satellites in view.
    pub fn measure(&mut self) -> Vec<(Satellite, MeasurementRow<M>)> {
        let mut rows = Vec::new();
        for k in 0..self.sky.len() {
            let s = self.sky[k];
            if !s.in_view {
                continue;
            }
            let cosine = (1.0 - s.sine * s.sine).sqrt();
            let (sa, ca) = s.azimuth.sin_cos();
            let direction: [f64; 3] = std::array::from_fn(|k| {
                s.sine * self.up[k] + cosine * (sa * self.east[k] + ca * self.north[k])
            });
            let measurement = CorrectedMeasurement {
                satellite: s.satellite,
                r_es_e_m: std::array::from_fn(|k| self.r[k] + s.range * direction[k]),
                v_es_e_mps: s.v,
                pseudorange_m: s.range,
                sigma_pseudorange_m: s.sigmas[0],
                range_rate_mps: s.has_rate.then_some((0.0, s.sigmas[1])),
            };
            let row = MeasurementRow::new(&measurement, self.r, self.v, &[0.0; K], None);
            let mut row: MeasurementRow<M> = row.unwrap();
            let [code, rate] =
                [&row.pseudorange, &row.range_rate].map(|h| embed(h).dot(&self.error));
            row.innovation_m = code + s.sigmas[0] * self.random.normal() - s.fault_m;
            if s.has_rate {
                row.innovation_mps = rate + s.sigmas[1] * self.random.normal();
            }
            rows.push((s.satellite, row));
        }
        rows
    }

    /// The nominal is corrected.
    pub fn correct(&mut self, by: &Vector) {
        self.error -= by;
    }
}

/// A row of the joint block as one of all states.
fn embed(design: &[f64; M]) -> Vector {
    let mut h = Vector::zeros();
    let places = (0..JOINT_NAVIGATION).chain(3 * BLOCKS..STATES);
    for (place, entry) in places.zip(design) {
        h[place] = *entry;
    }
    h
}

/// The scalar measurements of a row.
pub fn scalars(row: &MeasurementRow<M>) -> Vec<Row> {
    let mut rows = vec![Row {
        h: embed(&row.pseudorange),
        z: row.innovation_m,
        variance: 1.0 / row.weight,
    }];
    if row.range_rate_weight > 0.0 {
        rows.push(Row {
            h: embed(&row.range_rate),
            z: row.innovation_mps,
            variance: 1.0 / row.range_rate_weight,
        });
    }
    rows
}

fn put(m: &mut Covariance, a: usize, b: usize, block: &Block) {
    for (k, entry) in block.iter().enumerate() {
        m[(3 * a + k / 3, 3 * b + k % 3)] = *entry;
    }
}

fn full([xx, xy, xz, yy, yz, zz]: Symmetric) -> Block {
    [xx, xy, xz, xy, yy, yz, xz, yz, zz]
}

/// Φ and Q.
pub fn dense(t: &Transition) -> (Covariance, Covariance) {
    let (mut phi, mut q) = (Covariance::identity(), Covariance::zeros());
    for b in 0..BLOCKS {
        put(&mut phi, 0, b, &t.phi.position[b]);
        put(&mut phi, 1, b, &t.phi.velocity[b]);
    }
    put(&mut phi, 2, 2, &t.phi.attitude[0]);
    put(&mut phi, 2, 3, &t.phi.attitude[1]);
    phi[(15, 16)] = t.clock.bias_per_drift_s;
    phi[(16, 16)] = t.clock.decay;
    let mut off_diagonal = t.noise.off_diagonal.iter();
    for a in 0..BLOCKS {
        put(&mut q, a, a, &full(t.noise.diagonal[a]));
        for b in a + 1..BLOCKS {
            let block = off_diagonal.next().unwrap();
            put(&mut q, a, b, block);
            let [a0, b0, c0, d, e, f, g, h, i] = *block;
            put(&mut q, b, a, &[a0, d, g, b0, e, h, c0, f, i]);
        }
    }
    q[(15, 15)] = t.clock.bias_var;
    q[(15, 16)] = t.clock.bias_drift_cov;
    q[(16, 15)] = t.clock.bias_drift_cov;
    q[(16, 16)] = t.clock.drift_var;
    (phi, q)
}

/// An error state as a vector.
pub fn vector(state: &ErrorState<K>) -> Vector {
    let entries = state.navigation.iter().flatten().chain(&state.clock);
    Vector::from_iterator(entries.copied())
}

/// A filter of the core as a dense one.
pub fn dense_filter(filter: &Filter<K, M>) -> DenseFilter {
    let mut p = Covariance::zeros();
    for a in 0..BLOCKS {
        for b in 0..BLOCKS {
            put(&mut p, a, b, &filter.cross_block(a, b));
        }
        for k in 0..K {
            for (i, entry) in filter.clock_cross(a, k).into_iter().enumerate() {
                p[(3 * a + i, 15 + k)] = entry;
                p[(15 + k, 3 * a + i)] = entry;
            }
        }
    }
    for (k, row) in filter.clock_covariance().iter().enumerate() {
        for (l, entry) in row.iter().enumerate() {
            p[(15 + k, 15 + l)] = *entry;
        }
    }
    let x = vector(filter.state());
    DenseFilter { x, p }
}
