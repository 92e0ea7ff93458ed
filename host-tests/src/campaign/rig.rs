//! The code under test: core's navigator and bank, driven without bytes.
//!
//! What the monitor does with an epoch of a scenario folder (`core/src/tight/scenario.rs`), with the
//! clocks, the risks and the bank's noise model as arguments. Several false-alert probabilities can be
//! tested at once; the first decides what is excluded.

use anyhow::{Context, Result, anyhow};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use surefix_core::ekf::layout::FIRST_OFFSET;
use surefix_core::ekf::{AntennaState, Filter, MeasurementRow, Navigator};
use surefix_core::frames::geodesy;
use surefix_core::gnss::{CorrectedMeasurement, Satellite, System};
use surefix_core::ins::mechanisation::Increment;
use surefix_core::ins::{
    AttitudeStart, ClockNoise, InertialConfig, InitialSigma, InitialState, MeasurementFactors,
    SensorRange,
};
use surefix_core::mhss::bank::{Explanation, PostfitLimits};
use surefix_core::mhss::correlated::{CorrelatedBound, CorrelatedRow};
use surefix_core::mhss::{
    Bank, BankEpoch, BankRow, BankVerdict, Criterion, Secondaries, SeparationQuantiles, SubFilters,
};
use surefix_core::time::{GpsTime, NS_PER_S};

use crate::simulate::inertial::clock::CLOCK_NOISE;
use crate::simulate::inertial::sensors::Grade;

/// First sigma of the clock offset of a further constellation, m.
const SIGMA_OFFSET_M: f64 = 3000.0;

/// How long filters that began as copies hold the same, ns: as the product has it.
const BLIND_NS: i64 = 120 * NS_PER_S;

/// Probability that the residuals of rows without a fault do not fit.
const P_POSTFIT: f64 = 1e-3;

/// What the bank takes pseudorange errors for.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BankModel {
    /// White, of the sigma given.
    White,
    /// White, of a variance 1 + 2τ/Δt times as large: what errors correlated over τ seconds amount to in
    /// an average.
    Inflated {
        /// Correlation time assumed, s.
        tau_s: f64,
    },
    /// A white part, and one that is correlated over any time: core's [`CorrelatedBound`].
    Bounded {
        /// Variance taken for white, over that of the sigma given.
        white: f64,
        /// Variance taken for correlated, over the same.
        correlated: f64,
    },
}

impl BankModel {
    /// What the product takes them for: the whole variance both white and correlated.
    pub const PRODUCT: Self = Self::Bounded {
        white: 1.0,
        correlated: 1.0,
    };

    /// For tables.
    pub fn name(self) -> String {
        match self {
            Self::White => "white".into(),
            Self::Inflated { tau_s } => format!("R (1 + 2 {tau_s} s/1 s)"),
            Self::Bounded { white, correlated } => {
                format!("white {white} σ², bounded {correlated} σ²")
            }
        }
    }

    /// Factor on the sigma of a pseudorange, with epochs a second apart.
    fn factor(self) -> f64 {
        match self {
            Self::White => 1.0,
            Self::Inflated { tau_s } => libm::sqrt(1.0 + 2.0 * tau_s),
            Self::Bounded { white, .. } => libm::sqrt(white),
        }
    }

    /// Variance of the correlated part over that of the white one, where there is a bound.
    fn ratio(self) -> Option<f64> {
        match self {
            Self::White | Self::Inflated { .. } => None,
            Self::Bounded { white, correlated } => Some(correlated / white),
        }
    }
}

/// Risks per sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Risks {
    /// False alert; the first is what the bank acts on.
    pub p_fa: Vec<f64>,
    /// Missed detection.
    pub p_md: f64,
    /// Fault-free.
    pub p_h0: f64,
}

impl Risks {
    /// Those of [P0] and the reference scenarios.
    pub fn seed() -> Self {
        Self {
            p_fa: vec![3.33e-7],
            p_md: 1e-3,
            p_h0: 1e-7,
        }
    }
}

/// How the monitor is set up.
#[derive(Clone, Debug)]
pub struct RigSetup {
    /// The inertial unit.
    pub grade: Grade,
    /// The risks.
    pub risks: Risks,
    /// Test the vertical separations too.
    pub vertical: bool,
    /// Exclude what is isolated.
    pub exclude: bool,
    /// How long filters of a vanished satellite are kept, s.
    pub hold_s: i64,
    /// What the bank takes errors for.
    pub model: BankModel,
    /// Spectral density of the offsets between constellations, m²/s.
    pub inter_system_psd: f64,
    /// Have a filter without each constellation.
    pub constellations: bool,
    /// Look for two satellites or a constellation where no single satellite explains a failed test, and mind
    /// filters of pairs that are young, as the product does.
    pub explain: bool,
}

impl RigSetup {
    /// The reference scenarios' monitor: horizontal tests, exclusion.
    pub fn seed(grade: Grade) -> Self {
        Self {
            grade,
            risks: Risks::seed(),
            vertical: false,
            exclude: true,
            hold_s: 0,
            model: BankModel::White,
            inter_system_psd: 0.0,
            constellations: false,
            explain: false,
        }
    }

    /// How far a start may be off, one sigma.
    pub fn sigma(&self) -> InitialSigma {
        let noise = self.grade.noise();
        InitialSigma {
            position_m: 10.0,
            velocity_mps: 0.5,
            attitude_ned_rad: noise.attitude_ned_rad,
            gyro_bias_radps: noise.gyro_bias_radps,
            accel_bias_mps2: noise.accel_bias_mps2,
            clock_bias_m: 30.0,
            clock_drift_mps: 1.0,
        }
    }

    fn config(&self, rate_hz: u32) -> InertialConfig {
        InertialConfig {
            interval_ns: NS_PER_S as u32 / rate_hz,
            c_b_s: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            lever_arm_b_m: [0.0; 3],
            noise: self.grade.noise().density,
            clock: ClockNoise {
                inter_system_psd: self.inter_system_psd,
                ..CLOCK_NOISE
            },
            measurement: MeasurementFactors::ONE,
            range: SensorRange {
                rate_radps: 1e3,
                specific_force_mps2: 1e3,
            },
            start: AttitudeStart::Given {
                roll_pitch_heading_rad: [0.0; 3],
            },
            sigma: self.sigma(),
        }
    }
}

/// What an epoch gave.
#[derive(Clone, Debug)]
pub struct RigEpoch {
    /// One verdict per false-alert probability, all before the exclusion.
    pub verdicts: Vec<BankVerdict>,
    /// Excluded at this epoch.
    pub excluded: Option<Explanation>,
    /// All filters are copies since an exclusion: no separation tests anything.
    pub blind: bool,
    /// Where the antenna is believed to be, after it.
    pub r_e_m: [f64; 3],
}

/// Navigator and bank with K clock states: two for one clock, one more per further constellation.
pub struct Rig<const K: usize, const M: usize> {
    navigator: Box<Navigator<K, M>>,
    bank: Box<Bank<K, M>>,
    sub: Box<SubFilters<K, M>>,
    secondaries: Box<Secondaries<K, M>>,
    main: Box<Filter<K, M>>,
    bound: Box<CorrelatedBound>,
    quantiles: Vec<SeparationQuantiles>,
    limits: PostfitLimits,
    setup: Option<RigSetup>,
    pairs_since: Option<GpsTime>,
    blind_since: Option<GpsTime>,
}

/// The clock column of a constellation: GPS has none of its own.
fn offset_of<const K: usize>(system: System) -> Option<usize> {
    let column = match system {
        System::Gps => return None,
        System::Bds => FIRST_OFFSET,
        System::Galileo => FIRST_OFFSET + 1,
    };
    (column < K).then_some(column)
}

impl<const K: usize, const M: usize> Default for Rig<K, M> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const K: usize, const M: usize> Rig<K, M> {
    /// Not started.
    pub fn new() -> Self {
        Self {
            navigator: Box::new(Navigator::EMPTY),
            bank: Box::new(Bank::EMPTY),
            sub: Box::new(SubFilters::EMPTY),
            secondaries: Box::new(Secondaries::EMPTY),
            main: Box::new(Filter::EMPTY),
            bound: Box::new(CorrelatedBound::NONE),
            quantiles: Vec::new(),
            limits: PostfitLimits::EMPTY,
            setup: None,
            pairs_since: None,
            blind_since: None,
        }
    }

    /// Starts anew; offsets of further constellations are unknown.
    ///
    /// # Errors
    /// When a risk is no probability, or the navigator does not take the state.
    pub fn start(&mut self, setup: &RigSetup, rate_hz: u32, state: &InitialState) -> Result<()> {
        let fill = |p_fa: &f64| {
            let mut quantiles = SeparationQuantiles::EMPTY;
            quantiles
                .fill(*p_fa, setup.risks.p_md, setup.risks.p_h0)
                .map(|()| quantiles)
        };
        let quantiles: Result<Vec<_>, _> = setup.risks.p_fa.iter().map(fill).collect();
        self.quantiles =
            quantiles.map_err(|error| anyhow!("the risks give no quantile: {error:?}"))?;
        self.limits
            .fill(P_POSTFIT)
            .map_err(|error| anyhow!("no limits of residuals: {error:?}"))?;
        self.setup = Some(setup.clone());
        // What the start is off by is not of the satellites.
        self.bound
            .start(setup.model.ratio().unwrap_or(0.0), [0.0; 2]);
        self.navigator
            .start(&setup.config(rate_hz), state)
            .map_err(|error| anyhow!("the navigator does not start: {error:?}"))?;
        for column in FIRST_OFFSET..K {
            self.navigator.reset_clock(column, 0.0, SIGMA_OFFSET_M);
        }
        self.bank.clear();
        self.pairs_since = None;
        self.blind_since = None;
        Ok(())
    }

    /// A sample of the inertial unit.
    pub fn sample(&mut self, increment: &Increment, time: GpsTime) {
        self.navigator.step(increment, time);
    }

    /// An epoch of the receiver.
    ///
    /// # Errors
    /// When the rig is not started, the position is none, or a filter finds itself unhealthy.
    pub fn epoch(&mut self, time: GpsTime, measured: &[CorrectedMeasurement]) -> Result<RigEpoch> {
        let Self {
            navigator,
            bank,
            sub,
            secondaries,
            main,
            bound,
            quantiles,
            limits,
            setup,
            pairs_since,
            blind_since,
        } = self;
        let setup = setup.as_ref().context("the rig is not started")?;
        let at = navigator.predict(time);
        let rows = rows(setup, measured, &at);
        let llh = geodesy::to_llh(&Vector3::from(at.r_e_m))
            .map_err(|error| anyhow!("no position: {error:?}"))?;
        let c_enu_e = geodesy::c_enu_e(llh.lat_rad, llh.lon_rad);
        bank.predict(navigator.transition(), sub, secondaries);
        navigator.lend(main);
        let epoch = BankEpoch {
            time,
            rows: &rows,
            hold_ns: setup.hold_s * NS_PER_S,
        };
        bank.admit(&epoch, main, sub, secondaries, navigator.information_mut());
        for place in bank.begun() {
            bound.begin(place);
        }
        if setup.constellations {
            let begun = bank.monitor_constellations(main, sub);
            for (constellation, _) in begun.iter().enumerate().filter(|(_, begins)| **begins) {
                bound.begin_constellation(constellation);
            }
        }
        bank.note_predictions(main, sub, &c_enu_e);
        navigator.update_lent(main);
        bank.update(sub, secondaries);
        if setup.constellations {
            bank.update_constellations(sub);
        }
        let is_bounded = setup.model.ratio().is_some();
        if is_bounded {
            solve(bound, bank, &c_enu_e);
        }
        // The first comes last: what the bank keeps of the tests is of the one that is acted on. The bound
        // goes on by each assessment; only the last counts.
        let before = bound.clone();
        let mut verdicts: Vec<BankVerdict> = Vec::new();
        for quantiles in quantiles.iter().rev() {
            let criterion = Criterion {
                quantiles,
                vertical: setup.vertical,
                c_enu_e: &c_enu_e,
            };
            verdicts.push(if is_bounded {
                bound.clone_from(&before);
                bank.assess(&criterion, &mut **bound, main, sub, secondaries)
            } else {
                bank.test(&criterion, main, sub, secondaries)
            });
        }
        verdicts.reverse();
        let first = verdicts.first().context("no false-alert probability")?;
        let is_recent =
            |since: &Option<GpsTime>| since.is_some_and(|since| time.ns() - since.ns() < BLIND_NS);
        let young = setup.explain && is_recent(pairs_since);
        let mut excluded = first.isolated.map(Explanation::One);
        if setup.explain && first.detected && excluded.is_none() {
            let explanation = bank.explain(limits, setup.vertical, sub, secondaries);
            let is_known = |e: &Explanation| !(young && matches!(e, Explanation::Constellation(_)));
            excluded = explanation.filter(is_known);
        }
        let excluded = excluded.filter(|_| setup.exclude);
        if let Some(explanation) = excluded {
            *pairs_since = Some(time);
            if young || !matches!(explanation, Explanation::One(_)) {
                *blind_since = Some(time);
            }
            leave_out(explanation, young, bound, bank);
            match explanation {
                Explanation::One(satellite) if young => {
                    bank.exclude_alone(satellite, main, sub, secondaries)
                }
                Explanation::One(satellite) => bank.exclude(satellite, main, sub, secondaries),
                Explanation::Two(two) => bank.exclude_two(two, main, sub, secondaries),
                Explanation::Constellation(system) => {
                    bank.exclude_constellation(system, main, sub, secondaries)
                }
            };
        }
        navigator.take_back(main);
        let correction = navigator
            .finish()
            .map_err(|error| anyhow!("the filter is unhealthy: {error:?}"))?;
        bank.rereference(&correction, sub, secondaries);
        Ok(RigEpoch {
            verdicts,
            excluded,
            blind: is_recent(blind_since),
            r_e_m: navigator.antenna(time).r_e_m,
        })
    }

    /// The bank, with the tests of the last epoch.
    pub fn bank(&self) -> &Bank<K, M> {
        &self.bank
    }
}

fn rows<const K: usize, const M: usize>(
    setup: &RigSetup,
    measured: &[CorrectedMeasurement],
    at: &AntennaState<K>,
) -> Vec<BankRow<M>> {
    let factor = setup.model.factor();
    let row = |measurement: &CorrectedMeasurement| {
        let mut measurement = *measurement;
        measurement.sigma_pseudorange_m *= factor;
        let satellite = measurement.satellite;
        let offset = offset_of::<K>(satellite.system());
        MeasurementRow::new(&measurement, at.r_e_m, at.v_e_mps, &at.clock, offset)
            .map(|row| BankRow { satellite, row })
    };
    measured.iter().filter_map(row).collect()
}

/// The least squares of the satellites present.
fn solve<const K: usize, const M: usize>(
    bound: &mut CorrelatedBound,
    bank: &Bank<K, M>,
    c_enu_e: &Matrix3<f64>,
) {
    let rows = bank.present().map(|(place, satellite, row)| CorrelatedRow {
        place,
        constellation: satellite.system().index(),
        row,
        common_m: 0.0,
    });
    bound.solve(rows, c_enu_e);
}

/// The bound follows an exclusion that the bank has yet to make.
fn leave_out<const K: usize, const M: usize>(
    explanation: Explanation,
    young: bool,
    bound: &mut CorrelatedBound,
    bank: &Bank<K, M>,
) {
    let place_of = |satellite: Satellite| bank.place(satellite);
    match explanation {
        Explanation::One(satellite) => {
            if let Some(place) = place_of(satellite) {
                if young {
                    bound.exclude_alone(place);
                } else {
                    bound.exclude(place);
                }
            }
        }
        Explanation::Two([one, other]) => {
            if let (Some(first), Some(second)) = (place_of(one), place_of(other)) {
                bound.exclude_two(first, second);
            }
        }
        Explanation::Constellation(system) => bound.exclude_constellation(system.index()),
    }
}
