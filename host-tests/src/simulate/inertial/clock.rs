//! The receiver clock of a simulated flight: bias and drift as random walks.
//!
//! Over a step T the pair (bias, drift) is disturbed with the covariance
//! [[S_b T + S_d T³/3, S_d T²/2], [S_d T²/2, S_d T]], exact for the white noises of the model
//! b' = d + w_b, d' = w_d. [P0] (7), (8) as corrected in docs/decisions/005-tight-filter.md, with no
//! decay of the drift.

use rand_chacha::ChaCha20Rng;
use surefix_core::consts::SPEED_OF_LIGHT_MPS;
use surefix_core::ins::sample::ClockNoise;

use crate::simulate::noise::{normal, uniform};

/// A crystal oscillator, as in the reference scenarios.
pub const CLOCK_NOISE: ClockNoise = ClockNoise {
    bias_psd: 0.009,
    drift_psd: 0.0355,
    drift_decay_per_s: 0.0,
    inter_system_psd: 0.0,
};

/// Bias, m, and drift, m/s, at every step from 0 on.
#[derive(Clone, Debug)]
pub struct ReceiverClock {
    interval_s: f64,
    states: Vec<(f64, f64)>,
}

impl ReceiverClock {
    /// Draws a clock for `steps` steps: within 1000 m and 10 m/s at the start.
    pub fn new(mut random: ChaCha20Rng, interval_s: f64, steps: usize) -> Self {
        let symmetric = |random: &mut ChaCha20Rng| 2.0 * uniform(random) - 1.0;
        let mut state = (
            1000.0 * symmetric(&mut random),
            10.0 * symmetric(&mut random),
        );
        let t = interval_s;
        let (s_b, s_d) = (CLOCK_NOISE.bias_psd, CLOCK_NOISE.drift_psd);
        let drift_step = libm::sqrt(s_d * t);
        // Cholesky factor: the part of the bias that follows the drift, and the rest.
        let together = drift_step * t / 2.0;
        let alone = libm::sqrt(s_b * t + s_d * t * t * t / 12.0);
        let mut states = vec![state];
        for _ in 0..steps {
            let (n_d, n_b) = (normal(&mut random), normal(&mut random));
            state.0 += state.1 * t + together * n_d + alone * n_b;
            state.1 += drift_step * n_d;
            states.push(state);
        }
        Self { interval_s, states }
    }

    /// Bias, m, and drift, m/s, at a step.
    pub fn at_step(&self, step: usize) -> (f64, f64) {
        self.states[step]
    }

    /// Receiver clock minus GPST, s, near a step: its drift carries it there.
    pub fn bias_s(&self, t_s: f64) -> f64 {
        let nearest = libm::round(t_s / self.interval_s);
        let step = (nearest as usize).min(self.states.len() - 1);
        let (bias_m, drift_mps) = self.states[step];
        (bias_m + drift_mps * (t_s - step as f64 * self.interval_s)) / SPEED_OF_LIGHT_MPS
    }
}
