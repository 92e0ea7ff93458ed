//! A scenario through strapdown navigation and the bank.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use super::bank::{Bank, Observed, Risks, Verdict};
use super::earth::{c_e_ned, c_enu_e};
use super::filter::{Covariance, DenseFilter, ErrorState, Satellite, at, rows};
use super::strapdown::{Increment, Nominal, Strapdown, rotation};
use super::transition::{Accumulator, Noise, dynamics};
use crate::scenario::folder::{GnssEpoch, Init, SAME_TIME_S, Scenario};
use crate::scenario::result::{ResultFile, ResultRow};

/// Substeps of Φ and Q between two epochs.
const SUBSTEPS: usize = 10;

/// Strapdown navigation with its main filter.
#[derive(Clone, Debug)]
pub struct Navigator {
    strapdown: Strapdown,
    /// The main filter.
    filter: DenseFilter,
    noise: Noise,
    /// Since the last epoch.
    steps: Vec<Sample>,
}

/// An interval: position of its middle, attitude of its start.
#[derive(Clone, Copy, Debug)]
struct Sample {
    r: Vector3<f64>,
    c: Matrix3<f64>,
    dv_e: Vector3<f64>,
    dt: f64,
}

/// The noise of a scenario.
pub fn noise(init: &Init) -> Noise {
    Noise {
        arw: init.arw,
        vrw: init.vrw,
        gyro_bias_walk: init.gyro_bias_walk,
        accel_bias_walk: init.accel_bias_walk,
        clock_psd: [init.clock_bias_psd, init.clock_drift_psd],
        clock_decay: init.clock_decay_per_s,
    }
}

/// The first estimates of a scenario.
pub fn nominal(init: &Init) -> Nominal {
    let [w, x, y, z] = init.q_e_b;
    let q = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    Nominal {
        r: init.r_eb_e_m.into(),
        v: init.v_eb_e_mps.into(),
        c: q.to_rotation_matrix().into_inner(),
        bg: init.gyro_bias_radps.into(),
        ba: init.accel_bias_mps2.into(),
        clock: [init.clock_bias_m, init.clock_drift_mps],
    }
}

/// The risks of a scenario.
pub fn risks(init: &Init) -> Risks {
    Risks {
        p_fa: init.p_fa,
        p_md: init.p_md,
        p_h0: init.p_h0,
        vertical: init.detect_vertical,
    }
}

/// The first covariance of a scenario.
pub fn covariance(init: &Init) -> Covariance {
    let mut p = Covariance::zeros();
    let triples = [
        (at::POS, init.sigma_position_m),
        (at::VEL, init.sigma_velocity_mps),
        (at::BG, init.sigma_gyro_bias_radps),
        (at::BA, init.sigma_accel_bias_mps2),
    ];
    for (start, sigma) in triples {
        for k in start..start + 3 {
            p[(k, k)] = sigma * sigma;
        }
    }
    let sigma = Vector3::from(init.sigma_attitude_ned_rad);
    let c = c_e_ned(&init.r_eb_e_m.into());
    let attitude = c * Matrix3::from_diagonal(&sigma.component_mul(&sigma)) * c.transpose();
    p.fixed_view_mut::<3, 3>(at::ATT, at::ATT)
        .copy_from(&attitude);
    p[(at::CLK_B, at::CLK_B)] = init.sigma_clock_bias_m.powi(2);
    p[(at::CLK_D, at::CLK_D)] = init.sigma_clock_drift_mps.powi(2);
    p
}

impl Navigator {
    /// Starts as `init.csv` says.
    pub fn new(init: &Init) -> Self {
        Self {
            strapdown: Strapdown::new(nominal(init)),
            filter: DenseFilter {
                x: ErrorState::zeros(),
                p: covariance(init),
            },
            noise: noise(init),
            steps: Vec::new(),
        }
    }

    /// The estimates.
    pub fn nominal(&self) -> &Nominal {
        &self.strapdown.nominal
    }

    /// Takes a sample.
    pub fn on_increment(&mut self, increment: &Increment) {
        let before = self.strapdown.nominal;
        let step = self.strapdown.step(increment);
        let after = &self.strapdown.nominal;
        self.steps.push(Sample {
            r: (before.r + after.r) / 2.0,
            c: step.c_before,
            dv_e: step.dv_e,
            dt: increment.dt,
        });
    }

    /// Φ and Q since the last epoch; brings the clock to the present.
    fn process(&mut self) -> Accumulator {
        let mut accumulator = Accumulator::identity();
        let density = self.noise.density();
        let n = self.steps.len();
        for k in 0..SUBSTEPS {
            let part = &self.steps[k * n / SUBSTEPS..(k + 1) * n / SUBSTEPS];
            let dt: f64 = part.iter().map(|s| s.dt).sum();
            let Some(middle) = part.get(part.len() / 2) else {
                continue;
            };
            let dv: Vector3<f64> = part.iter().map(|s| s.dv_e).sum();
            let f = dynamics(&middle.r, &middle.c, &(dv / dt), self.noise.clock_decay);
            accumulator.add(&f, &density, dt);
        }
        self.steps.clear();
        let phi = accumulator.phi;
        let clock = &mut self.strapdown.nominal.clock;
        clock[0] += phi[(at::CLK_B, at::CLK_D)] * clock[1];
        clock[1] *= phi[(at::CLK_D, at::CLK_D)];
        accumulator
    }

    /// Corrects the estimates by the error state, which is 0 afterwards; gives what it was.
    fn feed_back(&mut self) -> ErrorState {
        let x = std::mem::replace(&mut self.filter.x, ErrorState::zeros());
        let part = |start: usize| x.fixed_rows::<3>(start).into_owned();
        let n = &mut self.strapdown.nominal;
        n.r -= part(at::POS);
        n.v -= part(at::VEL);
        n.c = rotation(-part(at::ATT)) * n.c;
        n.bg += part(at::BG);
        n.ba += part(at::BA);
        n.clock[0] -= x[at::CLK_B];
        n.clock[1] -= x[at::CLK_D];
        x
    }

    /// Everything of an epoch with a bank, whose main filter then is this navigator's.
    fn epoch(&mut self, bank: &mut Bank, epoch: &GnssEpoch, init: &Init) -> Verdict {
        let process = self.process();
        bank.predict(&process.phi, &process.q);
        let n = self.strapdown.nominal;
        let names = epoch.rows.iter().map(|row| row.satellite);
        let observed: Vec<Observed> = names
            .zip(satellites(epoch))
            .map(|(name, satellite)| (name, rows((&n.r, &n.v), n.clock, &satellite).into()))
            .collect();
        let present: Vec<_> = observed.iter().map(|(name, _)| *name).collect();
        bank.admit(epoch.t_s, &present, init.hold_s);
        bank.update(&observed);
        let verdict = bank.test(&risks(init), &c_enu_e(&n.r));
        if let Some(satellite) = verdict.isolated.filter(|_| init.exclude) {
            bank.exclude(satellite);
        }
        self.filter = bank.filter(&[]).clone();
        let correction = self.feed_back();
        bank.rereference(&correction);
        verdict
    }
}

/// Upper tail quantile of the standard normal distribution, by bisection.
pub fn upper_quantile(p: f64) -> f64 {
    let (mut low, mut high) = (-40.0, 40.0);
    for _ in 0..200 {
        let middle = (low + high) / 2.0;
        if 0.5 * libm::erfc(middle / std::f64::consts::SQRT_2) > p {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// The satellites of an epoch as the filter takes them.
pub fn satellites(epoch: &GnssEpoch) -> Vec<Satellite> {
    let rows = epoch.rows.iter();
    rows.map(|row| Satellite {
        r: row.r_es_e_m.into(),
        v: row.v_es_e_mps.into(),
        pseudorange: row.pseudorange_m,
        range_rate: row.range_rate_mps,
        sigmas: [row.sigma_pseudorange_m, row.sigma_range_rate_mps],
    })
    .collect()
}

/// Runs a scenario.
pub fn run(scenario: &Scenario) -> ResultFile {
    let init = &scenario.init;
    let mut navigator = Navigator::new(init);
    let mut bank = Bank::new(navigator.filter.clone());
    let mut samples = scenario.imu.iter().peekable();
    let names = scenario.satellites();
    let mut rows = Vec::new();
    for epoch in &scenario.epochs {
        while let Some(sample) = samples.next_if(|s| s.t_s <= epoch.t_s + SAME_TIME_S) {
            navigator.on_increment(&Increment {
                dtheta: sample.dtheta_ib_b_rad.into(),
                dv: sample.dv_ib_b_mps.into(),
                dt: init.imu_dt_s,
            });
        }
        let verdict = navigator.epoch(&mut bank, epoch, init);
        let n = navigator.nominal();
        let q = UnitQuaternion::from_matrix(&n.c);
        let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
        let test = |name: &String| {
            let mut tests = verdict.tests.iter();
            tests
                .find(|test| test.satellite.to_string() == *name)
                .map_or([f64::NAN; 2], |test| [test.statistic[0], test.threshold[0]])
        };
        rows.push(ResultRow {
            t_s: epoch.t_s,
            r_eb_e_m: n.r.into(),
            v_eb_e_mps: n.v.into(),
            q_e_b: [sign * q.w, sign * q.i, sign * q.j, sign * q.k],
            clock: n.clock,
            hpl_m: verdict.level[0],
            vpl_m: verdict.level[1],
            hpl0_m: verdict.fault_free[0],
            detected: verdict.detected,
            excluded: bank.excluded().iter().map(ToString::to_string).collect(),
            n_sats: bank.members().len(),
            tests: names.iter().map(test).collect(),
        });
    }
    ResultFile {
        satellites: names,
        rows,
    }
}
