//! Φ and Q of an epoch, accumulated from the nominal trajectory while it is integrated.
//!
//! In: velocity increments and attitude of each strapdown step. Out: one [`Transition`] for all filters.
//!
//! | symbol | code           | shape | unit | frame | meaning                                       |
//! |--------|----------------|-------|------|-------|-----------------------------------------------|
//! | f      | force_e        | 3     | m/s² | e     | mean specific force of a substep              |
//! | C      | c_e_b          | 3×3   | 1    |       | attitude at the middle of a substep           |
//! | Γ      | gradient       | 3×3   | 1/s² | e     | gravity gradient with the centrifugal part    |
//! | Ω      | earth_rate     | 3×3   | 1/s  | e     | \[ω_ie ×\]                                    |
//! | l      | LeverState     | 3     | m    | e     | from the inertial unit to the antenna         |
//!
//! Equations: [P0] (6)-(8) corrected (docs/decisions/005-tight-filter.md):
//! δr' = δv; δv' = Γ δr − 2Ω δv − \[f×\] ψ + C δb_a + C w_a; ψ' = −Ω ψ + C δb_g + C w_g. Per substep of
//! 0.1 s, Φ = I + F h + F² h²/2 and the trapezoidal Q. The states are those of the antenna: with
//! δr_a = δr − \[l×\] ψ and δv_a = δv − \[l'×\] ψ − C \[l_b×\] δb_g, that is x_a = T x, the accumulated pair becomes
//! T₁ Φ T₀⁻¹ and T₁ Q T₁ᵀ. Measurements then need no attitude columns.
//! Departures: gyroscope noise that the lever arm turns into antenna velocity directly is left out
//! (0.5 mm/s at 0.65 m for a MEMS unit at 100 Hz, white).

#![expect(
    clippy::indexing_slicing,
    reason = "block numbers are constants; the no-panic image is the judge"
)]

use super::filter::{ErrorState, PredictWorkspace, propagate};
use super::layout::{ACCEL_BIAS, ATTITUDE, BLOCKS, GYRO_BIAS, POSITION, VELOCITY};
use super::transition::{ClockTransition, NavigationCovariance, NavigationTransition, Transition};
use crate::ins::{ClockNoise, InertialNoise};
use crate::linalg::block3::{
    Block, IDENTITY, Symmetric, ZERO, add_product, add_product_vector, add_scaled, product, skew,
};

/// Length of a substep, s.
pub const SUBSTEP_S: f64 = 0.1;
/// A substep is over when it is this near its end, s: a fraction of the shortest sample interval.
const SUBSTEP_SLACK_S: f64 = 1.0e-3;

/// The lever arm at an epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeverState {
    /// From the inertial unit to the antenna, ECEF, m.
    pub arm_e_m: [f64; 3],
    /// Velocity of the antenna against the unit, ECEF, m/s.
    pub arm_rate_e_mps: [f64; 3],
    /// C \[l_b×\], what a gyroscope bias does to that velocity, m.
    pub rate_per_bias: Block,
}

impl LeverState {
    /// Antenna and unit in one place.
    pub const ZERO: Self = Self {
        arm_e_m: [0.0; 3],
        arm_rate_e_mps: [0.0; 3],
        rate_per_bias: ZERO,
    };

    /// The lever arm `arm_b_m` at attitude `c_e_b` and angular rate `omega_ib_b` (against inertial
    /// space, rad/s).
    pub fn new(arm_b_m: [f64; 3], c_e_b: &Block, omega_ib_b: [f64; 3], earth_rate: f64) -> Self {
        let mut arm_e_m = [0.0; 3];
        add_product_vector(&mut arm_e_m, c_e_b, &arm_b_m);
        let mut rate_b = [0.0; 3];
        add_product_vector(&mut rate_b, &skew(omega_ib_b), &arm_b_m);
        // C (ω_ib × l) − ω_ie × (C l)
        let mut arm_rate_e_mps = [earth_rate * arm_e_m[1], -earth_rate * arm_e_m[0], 0.0];
        add_product_vector(&mut arm_rate_e_mps, c_e_b, &rate_b);
        Self {
            arm_e_m,
            arm_rate_e_mps,
            rate_per_bias: product(c_e_b, &skew(arm_b_m)),
        }
    }

    /// T: from the error of the unit to that of the antenna. The inverse has the signs of its
    /// off-diagonal blocks turned.
    fn antenna_from_unit(&self) -> NavigationTransition {
        let mut t = NavigationTransition::IDENTITY;
        add_scaled(&mut t.position[ATTITUDE], -1.0, &skew(self.arm_e_m));
        add_scaled(&mut t.velocity[ATTITUDE], -1.0, &skew(self.arm_rate_e_mps));
        add_scaled(&mut t.velocity[GYRO_BIAS], -1.0, &self.rate_per_bias);
        t
    }

    /// The error of the unit from that of the antenna: what feedback corrects the nominal with.
    pub fn error_of_unit<const K: usize>(&self, antenna: &ErrorState<K>) -> ErrorState<K> {
        let mut unit = *antenna;
        let attitude = antenna.navigation[ATTITUDE];
        add_product_vector(
            &mut unit.navigation[POSITION],
            &skew(self.arm_e_m),
            &attitude,
        );
        add_product_vector(
            &mut unit.navigation[VELOCITY],
            &skew(self.arm_rate_e_mps),
            &attitude,
        );
        add_product_vector(
            &mut unit.navigation[VELOCITY],
            &self.rate_per_bias,
            &antenna.navigation[GYRO_BIAS],
        );
        unit
    }
}

/// Accumulates the transition of an epoch. About 6 kB.
#[derive(Clone, Debug)]
pub struct ProcessAccumulator {
    noise: InertialNoise,
    clock: ClockNoise,
    earth_rate: f64,
    gradient: Block,
    transition: Transition,
    /// Of the substep under way.
    elapsed_s: f64,
    dv_e: [f64; 3],
    middle: Block,
    middle_is_set: bool,
    lever: LeverState,
    substep: NavigationTransition,
    workspace: PredictWorkspace,
}

impl ProcessAccumulator {
    /// Not started.
    pub const EMPTY: Self = Self {
        noise: InertialNoise {
            arw: 0.0,
            vrw: 0.0,
            gyro_bias_walk: 0.0,
            accel_bias_walk: 0.0,
        },
        clock: ClockNoise {
            bias_psd: 0.0,
            drift_psd: 0.0,
            drift_decay_per_s: 0.0,
            inter_system_psd: 0.0,
        },
        earth_rate: 0.0,
        gradient: ZERO,
        transition: Transition::IDENTITY,
        elapsed_s: 0.0,
        dv_e: [0.0; 3],
        middle: IDENTITY,
        middle_is_set: false,
        lever: LeverState::ZERO,
        substep: NavigationTransition::IDENTITY,
        workspace: PredictWorkspace::EMPTY,
    };

    /// Starts with this noise, at a lever arm; `earth_rate` in rad/s.
    pub fn start(
        &mut self,
        noise: &InertialNoise,
        clock: &ClockNoise,
        earth_rate: f64,
        lever: &LeverState,
    ) {
        self.noise = *noise;
        self.clock = *clock;
        self.earth_rate = earth_rate;
        self.lever = *lever;
        self.restart();
    }

    /// Begins an epoch; nothing has moved yet.
    fn restart(&mut self) {
        self.transition = Transition::IDENTITY;
        self.clear_substep();
    }

    fn clear_substep(&mut self) {
        self.elapsed_s = 0.0;
        self.dv_e = [0.0; 3];
        self.middle_is_set = false;
    }

    /// The gravity gradient of the place, to be given again when the place has moved by kilometres.
    pub fn set_gradient(&mut self, gradient: &Block) {
        self.gradient = *gradient;
    }

    /// The lever arm at the last epoch.
    pub const fn lever(&self) -> &LeverState {
        &self.lever
    }

    /// Adds a strapdown step: its length, the velocity it gained by specific force (ECEF, m/s), and
    /// the attitude at its end.
    pub fn add(&mut self, dt_s: f64, dv_e_mps: [f64; 3], c_e_b: &Block) {
        self.elapsed_s += dt_s;
        for (sum, dv) in self.dv_e.iter_mut().zip(dv_e_mps) {
            *sum += dv;
        }
        if !self.middle_is_set {
            self.middle = *c_e_b;
            self.middle_is_set = self.elapsed_s >= 0.5 * SUBSTEP_S - SUBSTEP_SLACK_S;
        }
        if self.elapsed_s >= SUBSTEP_S - SUBSTEP_SLACK_S {
            self.close_substep();
        }
    }

    /// Ends the epoch at a lever arm and gives its transition, valid until the next step is added.
    #[inline(never)]
    pub fn finish(&mut self, lever: &LeverState) -> &Transition {
        if self.elapsed_s > 0.0 {
            self.close_substep();
        }
        if *lever != LeverState::ZERO || self.lever != LeverState::ZERO {
            self.move_to_antenna(lever);
        }
        self.lever = *lever;
        &self.transition
    }

    /// Adds noise to a block of states, as for samples that were missing. It is carried on with the rest of
    /// the epoch.
    pub fn add_noise(&mut self, block: usize, by: &Symmetric) {
        if let Some(diagonal) = self.transition.noise.diagonal.get_mut(block) {
            for (entry, by) in diagonal.iter_mut().zip(by) {
                *entry += by;
            }
        }
    }

    /// The transition accumulated so far; whole after [`ProcessAccumulator::finish`].
    pub const fn transition(&self) -> &Transition {
        &self.transition
    }

    /// Begins the next epoch.
    pub fn begin(&mut self) {
        self.restart();
    }

    #[inline(never)]
    fn close_substep(&mut self) {
        let h = self.elapsed_s;
        self.fill_substep(h);
        let noise = [
            0.0,
            self.noise.vrw,
            self.noise.arw,
            self.noise.gyro_bias_walk,
            self.noise.accel_bias_walk,
        ];
        // Q ← Φ (Q + G h/2) Φᵀ + G h/2: the trapezoid of the noise before and after the substep.
        let add_noise = |q: &mut NavigationCovariance| {
            for (diagonal, density) in q.diagonal.iter_mut().zip(noise) {
                let half = 0.5 * h * density * density;
                diagonal[0] += half;
                diagonal[3] += half;
                diagonal[5] += half;
            }
        };
        add_noise(&mut self.transition.noise);
        propagate(
            &mut self.transition.noise,
            &self.substep,
            &NavigationCovariance::ZERO,
            &mut self.workspace,
        );
        add_noise(&mut self.transition.noise);
        self.multiply();
        accumulate_clock(&mut self.transition.clock, &self.clock, h);
        self.clear_substep();
    }

    /// Φ of the substep: I + F h + F² h²/2. The position does not depend on the gyroscope biases yet.
    #[inline(never)]
    fn fill_substep(&mut self, h: f64) {
        let half = 0.5 * h * h;
        let rate = self.earth_rate;
        let (c, gradient) = (&self.middle, &self.gradient);
        let [fx, fy, fz] = self.dv_e;
        let force = &skew([fx / h, fy / h, fz / h]);
        let omega = &skew([0.0, 0.0, rate]);
        let omega_omega = &earth_rate_times(rate, omega);
        let omega_c = &earth_rate_times(rate, c);
        let row = &mut self.substep.position;
        row[POSITION] = sum_of(1.0, [(half, gradient)]);
        row[VELOCITY] = sum_of(h, [(-2.0 * half, omega)]);
        row[ATTITUDE] = sum_of(0.0, [(-half, force)]);
        row[ACCEL_BIAS] = sum_of(0.0, [(half, c)]);
        let row = &mut self.substep.velocity;
        let omega_gradient = &earth_rate_times(rate, gradient);
        row[POSITION] = sum_of(0.0, [(h, gradient), (-2.0 * half, omega_gradient)]);
        row[VELOCITY] = sum_of(
            1.0,
            [
                (-2.0 * h, omega),
                (half, gradient),
                (4.0 * half, omega_omega),
            ],
        );
        let omega_force = &earth_rate_times(rate, force);
        let force_omega = &product(force, omega);
        row[ATTITUDE] = sum_of(
            0.0,
            [(-h, force), (2.0 * half, omega_force), (half, force_omega)],
        );
        row[GYRO_BIAS] = sum_of(0.0, [(-half, &product(force, c))]);
        row[ACCEL_BIAS] = sum_of(0.0, [(h, c), (-2.0 * half, omega_c)]);
        let [attitude, gyro] = &mut self.substep.attitude;
        *attitude = sum_of(1.0, [(-h, omega), (half, omega_omega)]);
        *gyro = sum_of(0.0, [(h, c), (-half, omega_c)]);
    }

    /// Φ ← Φ_substep Φ.
    #[inline(never)]
    fn multiply(&mut self) {
        let (phi, by) = (&mut self.transition.phi, &self.substep);
        multiply_column::<POSITION>(by, phi);
        multiply_column::<VELOCITY>(by, phi);
        multiply_column::<ATTITUDE>(by, phi);
        multiply_column::<GYRO_BIAS>(by, phi);
        multiply_column::<ACCEL_BIAS>(by, phi);
        let [attitude, gyro] = &mut phi.attitude;
        let mut new_gyro = by.attitude[1];
        add_product(&mut new_gyro, &by.attitude[0], gyro);
        *gyro = new_gyro;
        *attitude = product(&by.attitude[0], attitude);
    }

    /// T₁ Φ T₀⁻¹ and T₁ Q T₁ᵀ.
    #[inline(never)]
    fn move_to_antenna(&mut self, lever: &LeverState) {
        let t = lever.antenna_from_unit();
        propagate(
            &mut self.transition.noise,
            &t,
            &NavigationCovariance::ZERO,
            &mut self.workspace,
        );
        let phi = &mut self.transition.phi;
        let [attitude, gyro] = phi.attitude;
        add_product(
            &mut phi.position[ATTITUDE],
            &t.position[ATTITUDE],
            &attitude,
        );
        add_product(&mut phi.position[GYRO_BIAS], &t.position[ATTITUDE], &gyro);
        add_product(
            &mut phi.velocity[ATTITUDE],
            &t.velocity[ATTITUDE],
            &attitude,
        );
        add_product(&mut phi.velocity[GYRO_BIAS], &t.velocity[ATTITUDE], &gyro);
        add_scaled(&mut phi.velocity[GYRO_BIAS], 1.0, &t.velocity[GYRO_BIAS]);
        let before = self.lever.antenna_from_unit();
        for row in [&mut phi.position, &mut phi.velocity] {
            let [position, velocity, ..] = *row;
            let mut inverse = ZERO;
            add_product(&mut inverse, &position, &before.position[ATTITUDE]);
            add_product(&mut inverse, &velocity, &before.velocity[ATTITUDE]);
            add_scaled(&mut row[ATTITUDE], -1.0, &inverse);
            let inverse = product(&velocity, &before.velocity[GYRO_BIAS]);
            add_scaled(&mut row[GYRO_BIAS], -1.0, &inverse);
        }
    }
}

/// Column J of the position's and the velocity's rows of `by` Φ, in place: it needs no other column of
/// Φ. The biases' rows of Φ are those of the unit matrix.
#[inline(never)]
fn multiply_column<const J: usize>(by: &NavigationTransition, phi: &mut NavigationTransition) {
    let times_column = |row: &[Block; BLOCKS]| {
        let mut sum = if J >= GYRO_BIAS { row[J] } else { ZERO };
        add_product(&mut sum, &row[POSITION], &phi.position[J]);
        add_product(&mut sum, &row[VELOCITY], &phi.velocity[J]);
        if J == ATTITUDE || J == GYRO_BIAS {
            add_product(&mut sum, &row[ATTITUDE], &phi.attitude[J - ATTITUDE]);
        }
        sum
    };
    let (position, velocity) = (times_column(&by.position), times_column(&by.velocity));
    phi.position[J] = position;
    phi.velocity[J] = velocity;
}

/// `diagonal I + Σ factor block`.
#[inline(always)]
fn sum_of<const N: usize>(diagonal: f64, terms: [(f64, &Block); N]) -> Block {
    let mut sum = ZERO;
    add_scaled(&mut sum, diagonal, &IDENTITY);
    for (factor, block) in terms {
        add_scaled(&mut sum, factor, block);
    }
    sum
}

/// \[ω_ie ×\] l.
#[inline(always)]
fn earth_rate_times(rate: f64, l: &Block) -> Block {
    let [a, b, c, d, e, f, ..] = *l;
    [
        -rate * d,
        -rate * e,
        -rate * f,
        rate * a,
        rate * b,
        rate * c,
        0.0,
        0.0,
        0.0,
    ]
}

/// One substep of the clocks, in the same form as the navigation states'.
fn accumulate_clock(clock: &mut ClockTransition, noise: &ClockNoise, h: f64) {
    let beta_h = noise.drift_decay_per_s * h;
    let decay = 1.0 - beta_h + 0.5 * beta_h * beta_h;
    let step = h - 0.5 * h * beta_h;
    let (half_bias, half_drift) = (0.5 * h * noise.bias_psd, 0.5 * h * noise.drift_psd);
    let bias = clock.bias_var + half_bias;
    let drift = clock.drift_var + half_drift;
    let both = clock.bias_drift_cov;
    *clock = ClockTransition {
        bias_per_drift_s: clock.bias_per_drift_s + step * clock.decay,
        decay: decay * clock.decay,
        bias_var: bias + step * (2.0 * both + step * drift) + half_bias,
        bias_drift_cov: decay * (both + step * drift),
        drift_var: decay * decay * drift + half_drift,
        offset_var: clock.offset_var + h * noise.inter_system_psd,
    };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ekf::dense::{self, Noise, random_block};
    use nalgebra::{Matrix3, SMatrix};

    type Matrix = SMatrix<f64, 15, 15>;
    const EARTH_RATE: f64 = 7.292_115e-5;
    const NOISE: InertialNoise = InertialNoise {
        arw: 1e-3,
        vrw: 2e-2,
        gyro_bias_walk: 3e-4,
        accel_bias_walk: 4e-3,
    };
    const CLOCK: ClockNoise = ClockNoise {
        bias_psd: 0.009,
        drift_psd: 0.0355,
        drift_decay_per_s: 0.01,
        inter_system_psd: 1e-4,
    };

    fn matrix(b: &Block) -> Matrix3<f64> {
        Matrix3::from_row_slice(b)
    }

    fn put(m: &mut Matrix, row: usize, column: usize, b: Matrix3<f64>) {
        m.fixed_view_mut::<3, 3>(3 * row, 3 * column).copy_from(&b);
    }

    /// F of the model, written down from the equations of the head.
    fn dynamics(gradient: &Block, force: [f64; 3], c: &Block) -> Matrix {
        let omega = matrix(&skew([0.0, 0.0, EARTH_RATE]));
        let mut f = Matrix::zeros();
        put(&mut f, 0, 1, Matrix3::identity());
        put(&mut f, 1, 0, matrix(gradient));
        put(&mut f, 1, 1, -2.0 * omega);
        put(&mut f, 1, 2, -matrix(&skew(force)));
        put(&mut f, 1, 4, matrix(c));
        put(&mut f, 2, 2, -omega);
        put(&mut f, 2, 3, matrix(c));
        f
    }

    fn density() -> Matrix {
        let mut g = Matrix::zeros();
        let densities = [
            0.0,
            NOISE.vrw,
            NOISE.arw,
            NOISE.gyro_bias_walk,
            NOISE.accel_bias_walk,
        ];
        for (block, density) in densities.into_iter().enumerate() {
            put(
                &mut g,
                block,
                block,
                Matrix3::identity() * density * density,
            );
        }
        g
    }

    fn random_lever(noise: &mut Noise) -> LeverState {
        LeverState::new(
            [noise.next(), noise.next(), noise.next()],
            &random_block(noise),
            [noise.next(), noise.next(), noise.next()],
            EARTH_RATE,
        )
    }

    /// An epoch of 0.25 s at 100 Hz: two substeps and a half.
    fn accumulated(
        before: &LeverState,
        after: &LeverState,
        noise: &mut Noise,
    ) -> (Transition, Matrix, Matrix) {
        let gradient = random_block(noise).map(|entry| 1e-6 * entry);
        let mut process = ProcessAccumulator::EMPTY;
        process.start(&NOISE, &CLOCK, EARTH_RATE, before);
        process.set_gradient(&gradient);
        let (mut phi, mut q) = (Matrix::identity(), Matrix::zeros());
        let (mut dv_sum, mut middle) = ([0.0; 3], IDENTITY);
        let mut steps = 0;
        for sample in 1..=25 {
            let dv = [noise.next(), noise.next(), noise.next()];
            let c = random_block(noise);
            process.add(0.01, dv, &c);
            steps += 1;
            for (sum, dv) in dv_sum.iter_mut().zip(dv) {
                *sum += dv;
            }
            if steps <= 5 {
                middle = c;
            }
            if steps == 10 || sample == 25 {
                let h = 0.01 * f64::from(steps);
                let f = dynamics(&gradient, dv_sum.map(|dv| dv / h), &middle);
                let substep = Matrix::identity() + f * h + f * f * (0.5 * h * h);
                let half = density() * (0.5 * h);
                q = substep * (q + half) * substep.transpose() + half;
                phi = substep * phi;
                (dv_sum, steps) = ([0.0; 3], 0);
            }
        }
        (process.finish(after).clone(), phi, q)
    }

    #[test]
    fn an_epoch_is_the_product_of_its_substeps() {
        let mut noise = Noise(5);
        let (t, phi, q) = accumulated(&LeverState::ZERO, &LeverState::ZERO, &mut noise);
        assert!((dense::transition(&t.phi) - phi).amax() < 1e-13);
        assert!((dense::navigation(&t.noise) - q).amax() < 1e-15);
    }

    #[test]
    fn with_a_lever_arm_the_states_are_those_of_the_antenna() {
        let mut noise = Noise(6);
        let (before, after) = (random_lever(&mut noise), random_lever(&mut noise));
        let (t, phi, q) = accumulated(&before, &after, &mut noise);
        let antenna = |lever: &LeverState| {
            let mut t = Matrix::identity();
            put(&mut t, 0, 2, -matrix(&skew(lever.arm_e_m)));
            put(&mut t, 1, 2, -matrix(&skew(lever.arm_rate_e_mps)));
            put(&mut t, 1, 3, -matrix(&lever.rate_per_bias));
            t
        };
        let (t0, t1) = (antenna(&before), antenna(&after));
        let phi = t1 * phi * t0.try_inverse().unwrap();
        let q = t1 * q * t1.transpose();
        assert!((dense::transition(&t.phi) - phi).amax() < 1e-12);
        assert!((dense::navigation(&t.noise) - q).amax() < 1e-14);
        // And back: what feedback takes from the nominal of the unit.
        let mut state = ErrorState::<{ dense::K }>::ZERO;
        for entry in state.navigation.iter_mut().flatten() {
            *entry = noise.next();
        }
        let unit = after.error_of_unit(&state);
        let expected = t1.try_inverse().unwrap() * dense::state(&state).fixed_rows::<15>(0);
        assert!((dense::state(&unit).fixed_rows::<15>(0) - expected).amax() < 1e-14);
    }

    #[test]
    fn the_clock_of_an_epoch_is_near_its_closed_form() {
        let mut process = ProcessAccumulator::EMPTY;
        process.start(&NOISE, &CLOCK, EARTH_RATE, &LeverState::ZERO);
        for _ in 0..100 {
            process.add(0.01, [0.0; 3], &IDENTITY);
        }
        let clock = process.finish(&LeverState::ZERO).clock;
        let beta = CLOCK.drift_decay_per_s;
        let decay = libm::exp(-beta);
        let near = |value: f64, expected: f64, relative: f64| {
            assert!(
                (value / expected - 1.0).abs() < relative,
                "{value} {expected}"
            );
        };
        near(clock.decay, decay, 1e-7);
        near(clock.bias_per_drift_s, (1.0 - decay) / beta, 1e-6);
        near(
            clock.drift_var,
            CLOCK.drift_psd * (1.0 - decay * decay) / (2.0 * beta),
            1e-6,
        );
        near(clock.bias_var, CLOCK.bias_psd + CLOCK.drift_psd / 3.0, 0.01);
        near(clock.bias_drift_cov, CLOCK.drift_psd / 2.0, 0.01);
        near(clock.offset_var, CLOCK.inter_system_psd, 1e-12);
    }
}
