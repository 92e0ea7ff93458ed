//! What goes wrong around a receiver beside the faults of satellites, as arguments ask for it.
//!
//! | argument | what | value |
//! |---|---|---|
//! | `--outage SAT:T0:T1`, `all:T0:T1` | nothing is tracked of a satellite, or of all, for T0 ≤ t < T1 | |
//! | `--clock-jump T:MS` | from T on the receiver's clock shows MS milliseconds more | c·MS on every code, phase |
//! | `--multipath SIGMA:TAU` | Gauss-Markov process of its own on the code of each signal | σ, e^(−Δt/τ) |
//! | `--ionosphere-error SIGMA:TAU` | one Gauss-Markov process in the zenith, for all satellites alike | F(E)·z·(f_L1/f)² |
//!
//! t in seconds from the first epoch. F(E) is the obliquity of a shell at 350 km, [DO-229] A.4.4.10.4, so
//! the error's covariance between satellites i and j is σ²·F_i·F_j. It delays the code and advances the
//! phase; range rates stay as they were: a Gauss-Markov process has no derivative.
//!
//! Every process has its own stream of random numbers, so that what is asked for beside it changes none.

use std::str::FromStr;

use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::SeedableRng;
use surefix_core::gnss::Satellite;
use surefix_core::gnss::signal::FREQUENCY_L1_HZ;

use super::noise::GaussMarkov;
use crate::faults::parse_satellite;

/// First stream of random numbers here; one per satellite, and one for the ionosphere before them.
const STREAM_IONOSPHERE: u64 = 2 << 32;
/// Most milliseconds that jumps may add up to: a pseudorange of MSM has 254 ms at most, a signal from
/// the farthest GEO takes 140 ms, and the next satellite's 65 ms must stay above 0.
const MAX_JUMP_MS: i32 = 60;
/// Radius of the Earth and height of the shell. [DO-229] A.4.4.10.4.
const EARTH_RADIUS_KM: f64 = 6378.1363;
const SHELL_KM: f64 = 350.0;

/// Why an argument is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DisturbanceError {
    /// A part is missing, too much or no number.
    #[error("\"{spec}\" is not of the form {form}, for example {example}")]
    Form {
        /// As given.
        spec: String,
        /// As it should be.
        form: &'static str,
        /// One that is right.
        example: &'static str,
    },
    /// No satellite of that name.
    #[error(
        "\"{0}\" is neither all nor a satellite of GPS (G01 to G32), Galileo (E01 to E36) or BDS (C01 to C63)"
    )]
    Satellite(String),
    /// A time before the first epoch, or an end before its start.
    #[error("\"{0}\": times are 0 s or later, and T1 is after T0")]
    Times(String),
    /// A jump of nothing or too much.
    #[error(
        "\"{0}\": a clock jumps by whole milliseconds, not 0, and by no more than {MAX_JUMP_MS} in all"
    )]
    Jump(String),
    /// A process that is none.
    #[error("\"{0}\": sigma is between 0 and 1000 m and the correlation time positive")]
    Process(String),
    /// Too late to do anything.
    #[error("\"{spec}\" begins after the last epoch, at {last_s} s")]
    TooLate {
        /// As given.
        spec: String,
        /// Time of the last epoch, s.
        last_s: f64,
    },
    /// An outage of a satellite that is not in view.
    #[error("outage \"{0}\" hides nothing: the satellite is not in view then")]
    NotInView(String),
}

/// Numbers between colons.
fn numbers<const N: usize>(parts: &str) -> Option<[f64; N]> {
    let values: Option<Vec<f64>> = parts
        .split(':')
        .map(|part| part.parse().ok().filter(|value: &f64| value.is_finite()))
        .collect();
    values?.try_into().ok()
}

/// A time without a satellite, or without any.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outage {
    /// Which; all if none is named.
    pub satellite: Option<Satellite>,
    /// Start, s from the first epoch.
    pub t0_s: f64,
    /// End, s from the first epoch; not part of it.
    pub t1_s: f64,
}

impl FromStr for Outage {
    type Err = DisturbanceError;

    fn from_str(spec: &str) -> Result<Self, Self::Err> {
        let form = || DisturbanceError::Form {
            spec: spec.to_owned(),
            form: "SAT:T0:T1 or all:T0:T1",
            example: "G05:60:90",
        };
        let (name, times) = spec.split_once(':').ok_or_else(form)?;
        let satellite = match name {
            "all" => None,
            name => Some(
                parse_satellite(name)
                    .ok_or_else(|| DisturbanceError::Satellite(name.to_owned()))?,
            ),
        };
        let [t0_s, t1_s] = numbers(times).ok_or_else(form)?;
        if t0_s < 0.0 || t1_s <= t0_s {
            return Err(DisturbanceError::Times(spec.to_owned()));
        }
        Ok(Self {
            satellite,
            t0_s,
            t1_s,
        })
    }
}

impl core::fmt::Display for Outage {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self.satellite {
            Some(satellite) => write!(f, "{satellite}")?,
            None => write!(f, "all")?,
        }
        write!(f, ":{}:{}", self.t0_s, self.t1_s)
    }
}

/// A step of the receiver's clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockJump {
    /// When, s from the first epoch.
    pub t_s: f64,
    /// By how much, ms.
    pub ms: i32,
}

impl FromStr for ClockJump {
    type Err = DisturbanceError;

    fn from_str(spec: &str) -> Result<Self, Self::Err> {
        let form = || DisturbanceError::Form {
            spec: spec.to_owned(),
            form: "T:MS",
            example: "60:1 or 60:-1",
        };
        let [t_s, ms] = numbers(spec).ok_or_else(form)?;
        if t_s < 0.0 {
            return Err(DisturbanceError::Times(spec.to_owned()));
        }
        // Casting saturates, and what is no whole number does not come back.
        let whole = ms as i32;
        if f64::from(whole) != ms || whole == 0 || whole.unsigned_abs() > MAX_JUMP_MS as u32 {
            return Err(DisturbanceError::Jump(spec.to_owned()));
        }
        Ok(Self { t_s, ms: whole })
    }
}

impl core::fmt::Display for ClockJump {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}:{}", self.t_s, self.ms)
    }
}

/// A first-order Gauss-Markov process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Process {
    /// Standard deviation, m.
    pub sigma_m: f64,
    /// Correlation time, s.
    pub tau_s: f64,
}

impl FromStr for Process {
    type Err = DisturbanceError;

    fn from_str(spec: &str) -> Result<Self, Self::Err> {
        let [sigma_m, tau_s] = numbers(spec).ok_or_else(|| DisturbanceError::Form {
            spec: spec.to_owned(),
            form: "SIGMA_M:TAU_S",
            example: "0.5:60",
        })?;
        if sigma_m <= 0.0 || sigma_m > 1000.0 || tau_s <= 0.0 {
            return Err(DisturbanceError::Process(spec.to_owned()));
        }
        Ok(Self { sigma_m, tau_s })
    }
}

impl core::fmt::Display for Process {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}:{}", self.sigma_m, self.tau_s)
    }
}

/// All that is asked for.
#[derive(Clone, Debug, Default, PartialEq, clap::Args)]
pub struct Disturbances {
    /// Time without a satellite, or without any: `SAT:T0:T1` or all:T0:T1 in s from the first epoch; may be
    /// given several times
    #[arg(long = "outage", value_name = "SPEC", allow_hyphen_values = true)]
    pub outages: Vec<Outage>,
    /// The receiver's clock steps by whole milliseconds: T:MS, for example 60:1; flagged in UBX; may be
    /// given several times
    #[arg(long = "clock-jump", value_name = "T:MS", allow_hyphen_values = true)]
    pub clock_jumps: Vec<ClockJump>,
    /// Multipath on every signal, correlated in time, for example 0.5:60. A receiver alone has it in place
    /// of its own by elevation, a flight with an inertial unit beside its noise; --noise-free leaves it in
    #[arg(long, value_name = "SIGMA_M:TAU_S", allow_hyphen_values = true)]
    pub multipath: Option<Process>,
    /// What a model of the ionosphere leaves over: a delay in the zenith on L1, correlated in time and
    /// common to all satellites by their obliquity, for example 1:1800; --noise-free leaves it in
    #[arg(long, value_name = "SIGMA_M:TAU_S", allow_hyphen_values = true)]
    pub ionosphere_error: Option<Process>,
}

impl Disturbances {
    /// Whether everything begins before the end, and the clock stays within its bounds.
    ///
    /// # Errors
    /// When not.
    pub fn check(&self, last_s: f64) -> Result<(), DisturbanceError> {
        let outages = self.outages.iter().map(|o| (o.to_string(), o.t0_s));
        let jumps = self.clock_jumps.iter().map(|j| (j.to_string(), j.t_s));
        for (spec, t_s) in outages.chain(jumps) {
            if t_s > last_s {
                return Err(DisturbanceError::TooLate { spec, last_s });
            }
        }
        for jump in &self.clock_jumps {
            // At most 60 each, and nobody gives millions.
            if self.jumped_ms(jump.t_s).unsigned_abs() > MAX_JUMP_MS as u32 {
                return Err(DisturbanceError::Jump(jump.to_string()));
            }
        }
        Ok(())
    }

    fn jumped_ms(&self, t_s: f64) -> i32 {
        let before = self.clock_jumps.iter().filter(|jump| jump.t_s <= t_s);
        before.fold(0, |sum, jump| sum + jump.ms)
    }

    /// What jumps up to and at `t_s` have put on the receiver's clock, s.
    pub fn jumped_s(&self, t_s: f64) -> f64 {
        f64::from(self.jumped_ms(t_s)) / 1000.0
    }

    /// Whether the clock was set between the epoch before, if there was one, and that at `t_s`.
    pub fn clock_was_set(&self, before_s: Option<f64>, t_s: f64) -> bool {
        self.clock_jumps
            .iter()
            .any(|jump| jump.t_s <= t_s && before_s.is_none_or(|before_s| jump.t_s > before_s))
    }

    /// Lines of a scenario file; none where nothing was asked for.
    pub fn scenario_lines(&self) -> String {
        let mut lines = String::new();
        let list = |name: &str, specs: Vec<String>, comment: &str| {
            format!("{name} = [\"{}\"]   # {comment}\n", specs.join("\", \""))
        };
        if !self.outages.is_empty() {
            let specs = self.outages.iter().map(Outage::to_string).collect();
            lines += &list("outages", specs, "SAT:T0:T1, s from the first epoch");
        }
        if !self.clock_jumps.is_empty() {
            let specs = self.clock_jumps.iter().map(ClockJump::to_string).collect();
            lines += &list("clock_jumps", specs, "T:MS, s from the first epoch, ms");
        }
        for (name, process, where_) in [
            ("multipath", self.multipath, "code of each signal"),
            (
                "ionosphere_error",
                self.ionosphere_error,
                "zenith on L1, all satellites alike",
            ),
        ] {
            if let Some(process) = process {
                lines += &format!(
                    "{name} = {{ sigma_m = {}, tau_s = {} }}   # Gauss-Markov, {where_}\n",
                    process.sigma_m, process.tau_s
                );
            }
        }
        lines
    }
}

/// Slant over vertical delay in the ionosphere.
pub fn obliquity(elevation_rad: f64) -> f64 {
    let sine = EARTH_RADIUS_KM / (EARTH_RADIUS_KM + SHELL_KM) * libm::cos(elevation_rad);
    1.0 / libm::sqrt(1.0 - sine * sine)
}

/// A process that runs.
struct Running {
    process: Process,
    random: ChaCha20Rng,
    values: Vec<GaussMarkov>,
    now_m: [f64; 2],
}

impl Running {
    fn new(process: Process, seed: u64, stream: u64, count: usize) -> Self {
        let mut random = ChaCha20Rng::seed_from_u64(seed);
        random.set_stream(stream);
        Self {
            process,
            values: (0..count).map(|_| GaussMarkov::new(&mut random)).collect(),
            random,
            now_m: [0.0; 2],
        }
    }

    fn step(&mut self, step_s: f64) {
        let Process { sigma_m, tau_s } = self.process;
        for (now_m, value) in self.now_m.iter_mut().zip(&mut self.values) {
            *now_m = sigma_m * value.step(&mut self.random, step_s, tau_s);
        }
    }
}

/// The processes of a receiver, and which outages did hide something.
pub struct Disturber {
    asked: Disturbances,
    multipath: Vec<(Satellite, Running)>,
    ionosphere: Option<Running>,
    hid: Vec<bool>,
}

impl Disturber {
    /// Draws how the processes of these satellites start.
    pub fn new(
        asked: &Disturbances,
        seed: u64,
        satellites: impl Iterator<Item = Satellite>,
    ) -> Self {
        let of_satellite = |satellite: Satellite| {
            let stream = STREAM_IONOSPHERE + 1 + satellite.index() as u64;
            let process = asked.multipath?;
            Some((satellite, Running::new(process, seed, stream, 2)))
        };
        Self {
            multipath: satellites.filter_map(of_satellite).collect(),
            ionosphere: asked
                .ionosphere_error
                .map(|process| Running::new(process, seed, STREAM_IONOSPHERE, 1)),
            hid: vec![false; asked.outages.len()],
            asked: asked.clone(),
        }
    }

    /// Moves on to the next epoch; once before the first one too.
    pub fn step(&mut self, step_s: f64) {
        for (_, running) in &mut self.multipath {
            running.step(step_s);
        }
        if let Some(running) = &mut self.ionosphere {
            running.step(step_s);
        }
    }

    /// Multipath of a satellite's two signals, m; `None` where none was asked for.
    pub fn multipath_m(&self, satellite: Satellite) -> Option<[f64; 2]> {
        let mut all = self.multipath.iter();
        all.find(|(known, _)| *known == satellite)
            .map(|(_, running)| running.now_m)
    }

    /// Error of the ionosphere on L1 at an elevation, m.
    pub fn ionosphere_m(&self, elevation_rad: f64) -> f64 {
        self.ionosphere
            .as_ref()
            .map_or(0.0, |running| obliquity(elevation_rad) * running.now_m[0])
    }

    /// Whether a satellite in view is hidden.
    pub fn hides(&mut self, t_s: f64, satellite: Satellite) -> bool {
        let mut hidden = false;
        for (outage, hid) in self.asked.outages.iter().zip(&mut self.hid) {
            let named = outage.satellite.is_none_or(|named| named == satellite);
            if named && (outage.t0_s..outage.t1_s).contains(&t_s) {
                *hid = true;
                hidden = true;
            }
        }
        hidden
    }

    /// After the last epoch.
    ///
    /// # Errors
    /// When an outage hid nothing.
    pub fn check(&self) -> Result<(), DisturbanceError> {
        let mut all = self.asked.outages.iter().zip(&self.hid);
        match all.find(|(_, hid)| !**hid) {
            Some((outage, _)) => Err(DisturbanceError::NotInView(outage.to_string())),
            None => Ok(()),
        }
    }
}

/// A delay on L1 as it is on another carrier, to first order.
pub fn on_carrier(delay_l1_m: f64, frequency_hz: f64) -> f64 {
    let ratio = FREQUENCY_L1_HZ / frequency_hz;
    delay_l1_m * (ratio * ratio)
}
