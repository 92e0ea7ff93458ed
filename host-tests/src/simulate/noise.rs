//! Seeded random numbers that are the same on every machine.

use rand_chacha::rand_core::Rng;

/// Uniform between 0 and 1, with 53 random bits.
pub fn uniform(random: &mut impl Rng) -> f64 {
    (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

/// Normal with mean 0 and standard deviation 1, by Box and Muller.
pub fn normal(random: &mut impl Rng) -> f64 {
    // 1 − u lies above 0, so the logarithm is finite.
    let radius = libm::sqrt(-2.0 * libm::log(1.0 - uniform(random)));
    radius * libm::cos(core::f64::consts::TAU * uniform(random))
}

/// A first-order Gauss-Markov process with standard deviation 1.
#[derive(Clone, Copy, Debug)]
pub struct GaussMarkov {
    value: f64,
}

impl GaussMarkov {
    /// Started in its stationary state.
    pub fn new(random: &mut impl Rng) -> Self {
        Self {
            value: normal(random),
        }
    }

    /// One step: the value after `step_s` with correlation time `tau_s`.
    pub fn step(&mut self, random: &mut impl Rng, step_s: f64, tau_s: f64) -> f64 {
        let kept = libm::exp(-step_s / tau_s);
        self.value = kept * self.value + libm::sqrt(1.0 - kept * kept) * normal(random);
        self.value
    }
}
