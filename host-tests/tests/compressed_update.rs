//! The filter's compressed update is that of a textbook: one measurement after the other on a dense
//! covariance, in numbers of 32 digits.
//!
//! Skies are random, whole and squeezed into a narrow fan; priors start from a fix and have been through
//! random motion and updates, so that all covariances are full. Differences are measured in the scale
//! of the prior's own sigmas for what a rank-deficient epoch leaves, of the posterior's for what a
//! redundant one leaves: |δP_ij| / √(P_ii P_jj) and |δx_i| / √P_ii.

mod skies;

use std::f64::consts::TAU;

use proptest::prelude::*;
use skies::Random;
use surefix_core::ekf::filter::PredictWorkspace;
use surefix_core::ekf::layout::{BLOCKS, FIRST_OFFSET, JOINT_NAVIGATION};
use surefix_core::ekf::{
    EpochInformation, Filter, LeverState, MeasurementRow, ProcessAccumulator, UpdateWorkspace,
};
use surefix_core::gnss::{CorrectedMeasurement, Satellite, System};
use surefix_core::ins::{ClockNoise, InertialNoise};
use surefix_host_tests::reference::{self, double::Double};

/// A filter as dense arrays.
#[derive(Clone)]
struct Dense {
    p: Vec<Vec<Double>>,
    x: Vec<Double>,
    nis: Double,
}

impl Dense {
    /// Takes over a filter of the core, through what it shows of itself.
    fn of<const K: usize, const M: usize>(filter: &Filter<K, M>) -> Self {
        let n = 3 * BLOCKS + K;
        let mut p = vec![vec![Double::ZERO; n]; n];
        for a in 0..BLOCKS {
            for b in 0..BLOCKS {
                for (k, entry) in filter.cross_block(a, b).into_iter().enumerate() {
                    p[3 * a + k / 3][3 * b + k % 3] = entry.into();
                }
            }
            for k in 0..K {
                for (i, entry) in filter.clock_cross(a, k).into_iter().enumerate() {
                    p[3 * a + i][3 * BLOCKS + k] = entry.into();
                    p[3 * BLOCKS + k][3 * a + i] = entry.into();
                }
            }
        }
        for (k, row) in filter.clock_covariance().iter().enumerate() {
            for (l, entry) in row.iter().enumerate() {
                p[3 * BLOCKS + k][3 * BLOCKS + l] = (*entry).into();
            }
        }
        let state = filter.state();
        let x = state.navigation.iter().flatten().chain(&state.clock);
        Self {
            p,
            x: x.map(|entry| (*entry).into()).collect(),
            nis: Double::ZERO,
        }
    }

    /// One scalar measurement z = h x + noise of variance 1/weight, on all states.
    fn update(&mut self, h: &[Double], z: f64, weight: f64) {
        let dot = |a: &[Double]| {
            let products = a.iter().zip(h).map(|(a, h)| *a * *h);
            products.fold(Double::ZERO, |sum, term| sum + term)
        };
        let ph: Vec<Double> = self.p.iter().map(|row| dot(row)).collect();
        let s = dot(&ph) + Double::from(1.0) / weight.into();
        let innovation = Double::from(z) - dot(&self.x);
        self.nis = self.nis + innovation * innovation / s;
        for (row, v) in self.p.iter_mut().zip(&ph) {
            for (entry, w) in row.iter_mut().zip(&ph) {
                *entry = *entry - *v * *w / s;
            }
        }
        for (entry, v) in self.x.iter_mut().zip(&ph) {
            *entry = *entry + *v * innovation / s;
        }
    }

    fn take<const M: usize>(&mut self, row: &MeasurementRow<M>) {
        // Position and velocity stand first, the clocks last.
        let embed = |design: &[f64; M]| {
            let (navigation, clocks) = design.split_at(JOINT_NAVIGATION);
            let mut h = vec![Double::ZERO; self.x.len()];
            let places = (0..JOINT_NAVIGATION).chain(3 * BLOCKS..self.x.len());
            for (place, entry) in places.zip(navigation.iter().chain(clocks)) {
                h[place] = (*entry).into();
            }
            h
        };
        let (code, rate) = (embed(&row.pseudorange), embed(&row.range_rate));
        self.update(&code, row.innovation_m, row.weight);
        if row.range_rate_weight > 0.0 {
            self.update(&rate, row.innovation_mps, row.range_rate_weight);
        }
    }

    fn sigma(&self, i: usize) -> f64 {
        self.p[i][i].to_f64().sqrt()
    }
}

/// Where the antenna is believed to be and how it moves.
struct Place {
    r: [f64; 3],
    v: [f64; 3],
    east: [f64; 3],
    north: [f64; 3],
    up: [f64; 3],
}

impl Place {
    fn random(random: &mut Random) -> Self {
        let sine = 2.0 * random.uniform() - 1.0;
        let (cosine, longitude) = ((1.0 - sine * sine).sqrt(), TAU * random.uniform());
        let (sl, cl) = longitude.sin_cos();
        let up = [cosine * cl, cosine * sl, sine];
        Self {
            r: up.map(|u| u * (6.36e6 + 3e4 * random.uniform())),
            v: [0; 3].map(|_| 150.0 * random.normal()),
            east: [-sl, cl, 0.0],
            north: [-sine * cl, -sine * sl, cosine],
            up,
        }
    }
}

/// One epoch's rows. A narrow sky has all satellites within 20° of azimuth.
fn rows<const K: usize, const M: usize>(
    random: &mut Random,
    place: &Place,
    satellites: usize,
    with_rates: bool,
    narrow: bool,
) -> Vec<MeasurementRow<M>> {
    let mut rows = Vec::new();
    for i in 0..satellites {
        let sine = 0.087 + 0.9 * random.uniform();
        let cosine = (1.0 - sine * sine).sqrt();
        let azimuth = random.uniform() * if narrow { 0.35 } else { TAU };
        let range = 2e7 + 1.8e7 * random.uniform();
        let direction: [f64; 3] = std::array::from_fn(|k| {
            sine * place.up[k]
                + cosine * (azimuth.sin() * place.east[k] + azimuth.cos() * place.north[k])
        });
        let r_es_e_m: [f64; 3] = std::array::from_fn(|k| place.r[k] + range * direction[k]);
        let v_es_e_mps = [0; 3].map(|_| 2000.0 * random.normal());
        let along: f64 = (0..3)
            .map(|k| direction[k] * (v_es_e_mps[k] - place.v[k]))
            .sum();
        let sigma = 0.3 + 3.0 * random.uniform();
        // Constellations in turn; the first has no offset.
        let offset = Some(FIRST_OFFSET + i % (K - 1))
            .filter(|_| K > FIRST_OFFSET && i % (K - 1) != K - FIRST_OFFSET);
        let measurement = CorrectedMeasurement {
            satellite: Satellite::new(System::Gps, 1 + i as u8).unwrap(),
            r_es_e_m,
            v_es_e_mps,
            pseudorange_m: range + 3.0 * sigma * random.normal(),
            sigma_pseudorange_m: sigma,
            // One in five has no Doppler even where the receiver measures it.
            range_rate_mps: (with_rates && i % 5 != 4)
                .then(|| (along + 0.2 * random.normal(), 0.02 + 0.1 * random.uniform())),
        };
        let row = MeasurementRow::new(&measurement, place.r, place.v, &[0.0; K], offset);
        rows.push(row.unwrap());
    }
    rows
}

/// A filter that started from a fix and has been through some seconds of motion and measurements.
fn prior<const K: usize, const M: usize>(random: &mut Random, place: &Place) -> Filter<K, M> {
    let diagonal = |sigma: f64| {
        let variance = sigma * sigma;
        [variance, 0.0, 0.0, variance, 0.0, variance]
    };
    let grade = 10.0_f64.powf(3.0 * random.uniform());
    let mut clock_var = [100.0; K];
    clock_var[0] = (3.0 + 300.0 * random.uniform()).powi(2);
    clock_var[1] = 1.0;
    let mut filter = Filter::EMPTY;
    filter.start(
        &[
            diagonal(3.0 + 27.0 * random.uniform()),
            diagonal(0.1 + random.uniform()),
            diagonal(2e-3 * (1.0 + 20.0 * random.uniform())),
            diagonal(5e-8 * grade),
            diagonal(5e-4 * grade.sqrt()),
        ],
        &clock_var,
    );
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
            inter_system_psd: 1e-6,
        },
        7.292115e-5,
        &LeverState::ZERO,
    );
    let mut predict_workspace = PredictWorkspace::EMPTY;
    for _ in 0..random.integer(0, 20) {
        process.begin();
        let half = random.normal();
        let (s, c) = half.sin_cos();
        let attitude = [c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0];
        for _ in 0..100 {
            let dv: [f64; 3] =
                std::array::from_fn(|k| 0.01 * (9.8 * place.up[k] + random.normal()));
            process.add(0.01, dv, &attitude);
        }
        let transition = process.finish(&LeverState::ZERO);
        filter.predict(transition, &mut predict_workspace);
        let satellites = random.integer(0, 12);
        let with_rates = random.integer(0, 3) > 0;
        let mut information = EpochInformation::ZERO;
        for row in rows::<K, M>(random, place, satellites, with_rates, false) {
            information.add_row(&row);
        }
        filter.update(&information, &mut workspace());
    }
    filter
}

fn workspace<const K: usize, const M: usize>() -> UpdateWorkspace<K, M> {
    UpdateWorkspace::EMPTY
}

/// Largest differences of one update: covariance and state against the sigmas after it, against those
/// before it, and of the normalised innovation squared.
#[derive(Clone, Copy, Debug, Default)]
struct Largest {
    after: f64,
    before: f64,
    state: f64,
    nis: f64,
}

impl Largest {
    fn take(&mut self, other: &Self) {
        self.after = self.after.max(other.after);
        self.before = self.before.max(other.before);
        self.state = self.state.max(other.state);
        self.nis = self.nis.max(other.nis);
    }
}

fn differences<const K: usize, const M: usize>(
    seed: u64,
    satellites: usize,
    with_rates: bool,
    narrow: bool,
) -> Largest {
    let mut random = Random(seed);
    let place = Place::random(&mut random);
    let mut filter = prior::<K, M>(&mut random, &place);
    let before = Dense::of(&filter);
    let mut expected = before.clone();
    let mut information = EpochInformation::ZERO;
    for row in rows::<K, M>(&mut random, &place, satellites, with_rates, narrow) {
        information.add_row(&row);
        expected.take(&row);
    }
    let summary = filter.update(&information, &mut workspace());
    let after = Dense::of(&filter);
    let n = after.x.len();
    let mut largest = Largest::default();
    for i in 0..n {
        for j in 0..n {
            assert_eq!(after.p[i][j], after.p[j][i], "symmetric");
            let difference = (after.p[i][j] - expected.p[i][j]).to_f64().abs();
            largest.take(&Largest {
                after: difference / (expected.sigma(i) * expected.sigma(j)),
                before: difference / (before.sigma(i) * before.sigma(j)),
                ..Largest::default()
            });
        }
        let difference = (after.x[i] - expected.x[i]).to_f64().abs();
        largest.state = largest.state.max(difference / expected.sigma(i));
    }
    largest.nis = (summary.nis - expected.nis.to_f64()).abs() / (1.0 + expected.nis.to_f64());
    largest
}

/// A run of [`differences`] with its number of clock states fixed.
type Run = fn(u64, usize, bool, bool) -> Largest;

/// Runs by constellations, one first.
const RUNS: [Run; 3] = [
    differences::<2, 8>,
    differences::<3, 9>,
    differences::<4, 10>,
];

/// INT-023.
#[test]
fn every_number_of_satellites_gives_the_textbook_update() {
    let (mut redundant, mut deficient) = (Largest::default(), Largest::default());
    let cases = (0..=24).flat_map(|satellites| (0..240).map(move |seed| (satellites, seed)));
    for (satellites, seed) in cases {
        let (with_rates, narrow) = (seed % 2 == 0, seed / 2 % 2 == 0);
        let constellations = 1 + seed / 4 % 3;
        let run = RUNS[constellations - 1];
        let seed = (1000 * seed + satellites) as u64;
        let largest = run(seed, satellites, with_rates, narrow);
        let is_redundant = satellites > 3 + constellations;
        let (limit, state_limit) = if is_redundant {
            redundant.take(&largest);
            (1e-9, 1e-9)
        } else {
            deficient.take(&largest);
            (1e-6, 1e-5)
        };
        let case = format!("{satellites} satellites, {constellations} constellations, seed {seed}");
        assert!(largest.after <= limit, "{case}: {largest:?}");
        assert!(largest.before <= limit, "{case}: {largest:?}");
        assert!(largest.state <= state_limit, "{case}: {largest:?}");
        if is_redundant {
            assert!(largest.nis <= limit, "{case}: {largest:?}");
        }
    }
    println!("redundant: {redundant:?}");
    println!("rank-deficient: {deficient:?}");
}

/// The normalised innovation squared of few satellites loses digits where all measurements are almost
/// explained: it is there to be looked at, no decision hangs on it.
#[test]
fn nis_of_few_satellites_is_good_to_a_percent() {
    for seed in 0..200 {
        for satellites in 1..=6 {
            let largest = RUNS[seed % 3](seed as u64, satellites, true, true);
            assert!(largest.nis < 0.01, "{satellites} satellites: {largest:?}");
        }
    }
}

/// INT-023.
#[test]
fn rows_are_those_of_the_reference_model() {
    let mut random = Random(5);
    for _ in 0..200 {
        let place = Place::random(&mut random);
        let clock = [300.0 * random.normal(), random.normal()];
        let r_es_e_m = place.r.map(|r| -r + 2e7 * random.uniform());
        let measurement = CorrectedMeasurement {
            satellite: Satellite::new(System::Bds, 3).unwrap(),
            r_es_e_m,
            v_es_e_mps: [0; 3].map(|_| 2000.0 * random.normal()),
            pseudorange_m: 2.2e7,
            sigma_pseudorange_m: 1.0 + random.uniform(),
            range_rate_mps: Some((100.0, 0.05 + random.uniform())),
        };
        let row = MeasurementRow::<8>::new(&measurement, place.r, place.v, &clock, None).unwrap();
        let (range_rate, sigma_rate) = measurement.range_rate_mps.unwrap();
        let [code, rate] = reference::filter::rows(
            (&place.r.into(), &place.v.into()),
            clock,
            &reference::filter::Satellite {
                r: r_es_e_m.into(),
                v: measurement.v_es_e_mps.into(),
                pseudorange: measurement.pseudorange_m,
                range_rate,
                sigmas: [measurement.sigma_pseudorange_m, sigma_rate],
            },
        );
        for (ours, expected) in [(&row.pseudorange, code.h), (&row.range_rate, rate.h)] {
            let places = (0..JOINT_NAVIGATION).chain(3 * BLOCKS..);
            for (place, entry) in places.zip(ours) {
                let error = (entry - expected[place]).abs();
                assert!(error <= 1e-12 * expected[place].abs() + 1e-18);
            }
        }
        // A rounding error of a distance to a satellite is 4 nm.
        assert!((row.innovation_m - code.z).abs() < 1e-7);
        assert!((row.innovation_mps - rate.z).abs() < 1e-10);
        assert!((row.weight * code.variance - 1.0).abs() < 1e-14);
        assert!((row.range_rate_weight * rate.variance - 1.0).abs() < 1e-14);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever comes: the covariance stays symmetric, no variance grows, none is negative.
    /// INT-023.
    #[test]
    fn an_update_makes_nothing_more_uncertain(
        seed in any::<u64>(),
        satellites in 0_usize..=24,
        with_rates: bool,
        narrow: bool,
    ) {
        let mut random = Random(seed);
        let place = Place::random(&mut random);
        let mut filter = prior::<3, 9>(&mut random, &place);
        let before = Dense::of(&filter);
        let mut information = EpochInformation::ZERO;
        for row in rows::<3, 9>(&mut random, &place, satellites, with_rates, narrow) {
            information.add_row(&row);
        }
        filter.update(&information, &mut workspace());
        prop_assert!(filter.check().is_ok());
        let after = Dense::of(&filter);
        for i in 0..after.x.len() {
            prop_assert!(after.sigma(i) > 0.0);
            prop_assert!(after.sigma(i) <= before.sigma(i) * (1.0 + 1e-9));
        }
    }
}
