//! Advanced RAIM: levels and tests of one epoch against every fault that is likely enough to matter.
//!
//! In: for each satellite its row of the design, its error for integrity and for accuracy, and the
//! probability of its fault; the same probability for each constellation; the risks allowed. Out: HPL,
//! VPL, effective monitor threshold, accuracy, and for every fault mode the solution without the
//! satellites that it makes faulty.
//!
//! | symbol | code | shape | unit | meaning |
//! |--------|------|-------|------|---------|
//! | G      | `design_enu` | n × 3 | 1 | −u (east, north, up), u from user to satellite; one clock per constellation |
//! | C_int, C_acc | `variance_integrity_m2`, `variance_accuracy_m2` | n | m² | error of a pseudorange, for integrity (overbounding) and for accuracy |
//! | b_int, b_acc | `bias_integrity_m`, `bias_accuracy_m` | n | m | largest nominal bias |
//! | P_sat, P_const | `p_fault` | n, constellations | 1 | probability that a fault is there at an instant |
//! | T_exp/MFD | `exposure` | same | 1 | exposure over mean fault duration; 0: the instant alone (v3) |
//!
//! In reading order: [`support`] makes a satellite of the integrity support data, [`modes`] lists the
//! faults to monitor, [`subsets`] solves without them, [`levels`] bounds the error, [`detection`] tests
//! measurements, [`exclusion`] takes a fault out and bounds the error after it.
//!
//! Source: [ARAIM-ADD], [BLANCH-2015]. Conventions where they leave a choice, and why subsets are found by
//! rank-one updates: docs/decisions/007-araim.md. Keys: docs/references.md.
//! Cost: 1 to 3 thousand instructions per mode, and the root search of the levels.

pub mod detection;
pub mod exclusion;
pub mod levels;
pub mod modes;
pub mod subsets;
pub mod support;

use crate::stats::StatsError;
use levels::AraimLevels;
use modes::{ModeList, SatelliteSet};
use subsets::{AllInView, LeaveOut, SubsetSolution};

/// Most satellites. The caller chooses them where more are in view.
pub const MAX_ARAIM_SATELLITES: usize = 24;

/// Most constellations.
pub const MAX_CONSTELLATIONS: usize = 4;

/// Most fault modes, the fault-free one included: all single and double faults of
/// [`MAX_ARAIM_SATELLITES`] satellites and [`MAX_CONSTELLATIONS`] constellations are 407.
pub const MAX_MODES: usize = 512;

/// One satellite of the epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AraimSatellite {
    /// Derivatives of the pseudorange by east, north, up: −u, u the unit vector to the satellite.
    pub design_enu: [f64; 3],
    /// Its constellation, an index into the list of constellations.
    pub constellation: usize,
    /// Variance of the pseudorange error that bounds it for integrity, m², positive.
    pub variance_integrity_m2: f64,
    /// Variance for accuracy and continuity, m², positive.
    pub variance_accuracy_m2: f64,
    /// Largest nominal bias for integrity, m, not negative.
    pub bias_integrity_m: f64,
    /// Nominal bias for accuracy and continuity, m, not negative.
    pub bias_accuracy_m: f64,
    /// Probability that it is faulty at a given instant, in [0, 1).
    pub p_fault: f64,
    /// Exposure time over the mean duration of its faults, 1, not negative.
    pub exposure: f64,
}

impl AraimSatellite {
    /// Illegal until filled.
    pub const EMPTY: Self = Self {
        design_enu: [0.0; 3],
        constellation: 0,
        variance_integrity_m2: 0.0,
        variance_accuracy_m2: 0.0,
        bias_integrity_m: 0.0,
        bias_accuracy_m: 0.0,
        p_fault: 0.0,
        exposure: 0.0,
    };
}

/// What is known of a constellation as a whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AraimConstellation {
    /// Probability that a fault of the whole constellation is there at a given instant, in [0, 1).
    pub p_fault: f64,
    /// Exposure time over the mean duration of such faults, 1, not negative.
    pub exposure: f64,
}

/// Risks allowed, and how faults are monitored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AraimParameters {
    /// Integrity risk of the vertical and of the horizontal level over the exposure, PHMI.
    pub phmi_vertical: f64,
    /// As above, shared in half by east and north.
    pub phmi_horizontal: f64,
    /// False-alert probability of the vertical tests over the exposure.
    pub p_false_alert_vertical: f64,
    /// False-alert probability of the horizontal tests over the exposure.
    pub p_false_alert_horizontal: f64,
    /// Most probability of faults that no mode monitors, P_THRES.
    pub p_threshold: f64,
    /// Least probability of a mode that counts in the effective monitor threshold, P_EMT.
    pub p_emt: f64,
    /// A fault of several satellites of a constellation counts as a fault of all of it when it is no
    /// more likely than this share of the constellation's own fault, F_C.
    pub consolidation_share: f64,
    /// Faults at a time that are listed at least, 1 to [`modes::MAX_SIMULTANEOUS`]. From 2 on, what happens
    /// within a constellation together with its own fault is monitored with it.
    pub simultaneous_at_least: usize,
    /// Effective number of independent samples in the exposure, for integrity, at least 1.
    pub samples_integrity: f64,
    /// The same for continuity, at least 1.
    pub samples_continuity: f64,
}

impl AraimParameters {
    /// LPV-200 in the baseline algorithm, version 3, [BLANCH-2015].
    pub const LPV_200: Self = Self {
        phmi_vertical: 9.8e-8,
        phmi_horizontal: 2e-9,
        p_false_alert_vertical: 3.9e-6,
        p_false_alert_horizontal: 9e-8,
        p_threshold: 8e-8,
        p_emt: 1e-5,
        consolidation_share: 0.01,
        simultaneous_at_least: 2,
        samples_integrity: 1.0,
        samples_continuity: 1.0,
    };

    /// Both integrity risks together.
    fn phmi(&self) -> f64 {
        self.phmi_vertical + self.phmi_horizontal
    }

    fn check(&self) -> Result<(), AraimError> {
        use ParameterField as Field;
        let open = |value: f64| value > 0.0 && value < 1.0;
        let fields = [
            (
                Field::PhmiVertical,
                self.phmi_vertical,
                open(self.phmi_vertical),
            ),
            (
                Field::PhmiHorizontal,
                self.phmi_horizontal,
                open(self.phmi_horizontal),
            ),
            (
                Field::PFalseAlertVertical,
                self.p_false_alert_vertical,
                open(self.p_false_alert_vertical),
            ),
            (
                Field::PFalseAlertHorizontal,
                self.p_false_alert_horizontal,
                open(self.p_false_alert_horizontal),
            ),
            (Field::PThreshold, self.p_threshold, open(self.p_threshold)),
            (Field::PEmt, self.p_emt, open(self.p_emt)),
            (
                Field::ConsolidationShare,
                self.consolidation_share,
                self.consolidation_share >= 0.0 && self.consolidation_share <= 1.0,
            ),
            (
                Field::SimultaneousAtLeast,
                self.simultaneous_at_least as f64,
                (1..=modes::MAX_SIMULTANEOUS).contains(&self.simultaneous_at_least),
            ),
            (
                Field::SamplesIntegrity,
                self.samples_integrity,
                self.samples_integrity >= 1.0 && self.samples_integrity.is_finite(),
            ),
            (
                Field::SamplesContinuity,
                self.samples_continuity,
                self.samples_continuity >= 1.0 && self.samples_continuity.is_finite(),
            ),
        ];
        for (field, value, is_legal) in fields {
            if !is_legal {
                return Err(AraimError::Parameter { field, value });
            }
        }
        Ok(())
    }
}

/// A number of [`AraimSatellite`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SatelliteField {
    /// `design_enu`.
    Design,
    /// `constellation`.
    Constellation,
    /// `variance_integrity_m2`.
    VarianceIntegrity,
    /// `variance_accuracy_m2`.
    VarianceAccuracy,
    /// `bias_integrity_m`.
    BiasIntegrity,
    /// `bias_accuracy_m`.
    BiasAccuracy,
    /// `p_fault`, at the instant and over the exposure.
    PFault,
    /// `exposure`.
    Exposure,
    /// A pseudorange residual handed to the test.
    Residual,
}

/// A number of [`AraimParameters`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterField {
    /// `phmi_vertical`.
    PhmiVertical,
    /// `phmi_horizontal`.
    PhmiHorizontal,
    /// `p_false_alert_vertical`.
    PFalseAlertVertical,
    /// `p_false_alert_horizontal`.
    PFalseAlertHorizontal,
    /// `p_threshold`.
    PThreshold,
    /// `p_emt`.
    PEmt,
    /// `consolidation_share`.
    ConsolidationShare,
    /// `simultaneous_at_least`.
    SimultaneousAtLeast,
    /// `samples_integrity`.
    SamplesIntegrity,
    /// `samples_continuity`.
    SamplesContinuity,
}

/// A direction of the position error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// East.
    East,
    /// North.
    North,
    /// Up.
    Up,
}

impl Axis {
    /// East, north, up.
    pub const ALL: [Self; 3] = [Self::East, Self::North, Self::Up];

    /// The component of a vector in east, north, up.
    fn of(self, enu: &[f64; 3]) -> f64 {
        let [east, north, up] = *enu;
        match self {
            Self::East => east,
            Self::North => north,
            Self::Up => up,
        }
    }
}

/// Why there are no levels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AraimError {
    /// No satellite, or more than [`MAX_ARAIM_SATELLITES`].
    SatellitesOutOfRange {
        /// How many.
        satellites: usize,
    },
    /// No constellation, or more than [`MAX_CONSTELLATIONS`].
    ConstellationsOutOfRange {
        /// How many.
        constellations: usize,
    },
    /// A number of a satellite is out of its range, or NaN.
    Satellite {
        /// Its index.
        index: usize,
        /// Which number.
        field: SatelliteField,
        /// Its value.
        value: f64,
    },
    /// The fault probability of a constellation, at the instant or over the exposure, is out of range.
    Constellation {
        /// Its index.
        index: usize,
        /// The value.
        value: f64,
    },
    /// A parameter is out of its range, or NaN.
    Parameter {
        /// Which.
        field: ParameterField,
        /// Its value.
        value: f64,
    },
    /// Not as many residuals as satellites.
    ResidualsMismatch {
        /// How many residuals.
        residuals: usize,
        /// How many satellites.
        satellites: usize,
    },
    /// Fewer satellites than unknowns.
    TooFewSatellites {
        /// Satellites.
        satellites: usize,
        /// Unknowns: three, and a clock per constellation in view.
        unknowns: usize,
    },
    /// The satellites do not determine the position.
    SingularGeometry,
    /// The faults likely enough to be monitored are more than [`MAX_MODES`].
    ModesExceedCapacity,
    /// Faults of up to [`modes::MAX_SIMULTANEOUS`] at a time do not bring the unmonitored probability down
    /// to P_THRES.
    FaultsTooLikely {
        /// What remains unmonitored.
        p_not_monitored: f64,
    },
    /// The unmonitored probability uses the integrity risk up.
    NoIntegrityBudget {
        /// The probability.
        p_not_monitored: f64,
    },
    /// The root search found no level in this direction.
    NoLevel {
        /// The direction.
        axis: Axis,
    },
    /// A quantile could not be computed.
    Stats(StatsError),
}

impl From<StatsError> for AraimError {
    fn from(error: StatsError) -> Self {
        Self::Stats(error)
    }
}

/// ARAIM of one epoch: the modes, their solutions and the memory to find them (100 kB; belongs into
/// a `static`).
#[derive(Clone, Debug)]
pub struct Araim {
    all_in_view: AllInView,
    modes: ModeList,
    leave_out: LeaveOut,
    p_not_monitored: f64,
    count: usize,
    subsets: [SubsetSolution; MAX_MODES],
}

const _: () = assert!(size_of::<Araim>() <= 100_000);

impl Araim {
    /// Nothing evaluated.
    pub const EMPTY: Self = Self {
        all_in_view: AllInView::EMPTY,
        modes: ModeList::EMPTY,
        leave_out: LeaveOut::EMPTY,
        p_not_monitored: 1.0,
        count: 0,
        subsets: [SubsetSolution::EMPTY; MAX_MODES],
    };

    /// Lists the faults, solves without them, and bounds the position error of a receiver that
    /// detects faults and excludes none.
    ///
    /// # Errors
    /// [`AraimError`].
    #[inline(never)]
    pub fn evaluate(
        &mut self,
        satellites: &[AraimSatellite],
        constellations: &[AraimConstellation],
        parameters: &AraimParameters,
    ) -> Result<AraimLevels, AraimError> {
        self.solve(satellites, constellations, parameters)?;
        self.bound(parameters, self.p_not_monitored, 1.0)
    }

    /// The part of [`Araim::evaluate`] before thresholds and levels: modes and their solutions.
    ///
    /// # Errors
    /// [`AraimError`].
    #[inline(never)]
    pub fn solve(
        &mut self,
        satellites: &[AraimSatellite],
        constellations: &[AraimConstellation],
        parameters: &AraimParameters,
    ) -> Result<(), AraimError> {
        self.count = 0;
        check(satellites, constellations)?;
        parameters.check()?;
        let everything = SatelliteSet::first(satellites.len());
        self.all_in_view.form(satellites, everything)?;
        self.modes
            .enumerate(satellites, constellations, parameters)?;
        let p_unmonitorable = self.solve_modes();
        self.p_not_monitored = self.modes.p_not_monitored() + p_unmonitorable;
        Ok(())
    }

    /// The solutions of the evaluated epoch: all satellites first, then one per monitored mode.
    pub fn subsets(&self) -> &[SubsetSolution] {
        self.subsets.get(..self.count).unwrap_or(&[])
    }

    /// Solves every listed mode; the probability of those that leave no solution.
    fn solve_modes(&mut self) -> f64 {
        let mut p_unmonitorable = 0.0;
        let mut count = 0;
        let mut free = self.subsets.iter_mut();
        let mut slot = free.next();
        for mode in self.modes.modes_mut() {
            let Some(solution) = slot.take() else {
                break;
            };
            mode.is_monitored = self
                .all_in_view
                .leave_out(mode.excluded, &mut self.leave_out);
            if mode.is_monitored {
                self.all_in_view.solution(&self.leave_out, solution);
                solution.excluded = mode.excluded;
                solution.p_instant = mode.p_instant;
                solution.p_exposure = mode.p_exposure;
                count += 1;
                slot = free.next();
            } else {
                p_unmonitorable += mode.p_exposure;
                slot = Some(solution);
            }
        }
        self.count = count;
        p_unmonitorable
    }

    /// Thresholds and levels of the solved modes. The integrity risk is shared by `outcomes` equally.
    fn bound(
        &mut self,
        parameters: &AraimParameters,
        p_not_monitored: f64,
        outcomes: f64,
    ) -> Result<AraimLevels, AraimError> {
        let enumerated = self.modes.modes().len();
        let subsets = self.subsets.get_mut(..self.count).unwrap_or(&mut []);
        let [k_horizontal, k_vertical] = levels::set_thresholds(subsets, parameters)?;
        // NaN has no budget.
        let share = (1.0 - p_not_monitored / parameters.phmi()) / outcomes;
        if !(share > 0.0) {
            return Err(AraimError::NoIntegrityBudget { p_not_monitored });
        }
        let per_sample = share / parameters.samples_integrity;
        let level = |axis, phmi: f64| levels::protection_level(subsets, axis, phmi * per_sample);
        let east = level(Axis::East, 0.5 * parameters.phmi_horizontal)?;
        let north = level(Axis::North, 0.5 * parameters.phmi_horizontal)?;
        let up = level(Axis::Up, parameters.phmi_vertical)?;
        Ok(AraimLevels {
            vpl_m: up,
            hpl_m: libm::sqrt(east * east + north * north),
            level_east_m: east,
            level_north_m: north,
            emt_m: levels::effective_monitor_threshold(subsets, parameters.p_emt),
            emt_prior_tolerant_m: levels::effective_monitor_threshold(
                subsets,
                parameters.p_emt * levels::EMT_PRIOR_TOLERANCE,
            ),
            sigma_accuracy_enu_m: self.all_in_view.sigma_accuracy_m(),
            p_not_monitored,
            k_false_alert_horizontal: k_horizontal,
            k_false_alert_vertical: k_vertical,
            modes_enumerated: enumerated,
            modes_monitored: self.count,
        })
    }
}

/// Refuses what is no satellite or constellation.
fn check(
    satellites: &[AraimSatellite],
    constellations: &[AraimConstellation],
) -> Result<(), AraimError> {
    use SatelliteField as Field;
    if satellites.is_empty() || satellites.len() > MAX_ARAIM_SATELLITES {
        return Err(AraimError::SatellitesOutOfRange {
            satellites: satellites.len(),
        });
    }
    if constellations.is_empty() || constellations.len() > MAX_CONSTELLATIONS {
        return Err(AraimError::ConstellationsOutOfRange {
            constellations: constellations.len(),
        });
    }
    for (index, satellite) in satellites.iter().enumerate() {
        let refuse = |field, value| {
            Err(AraimError::Satellite {
                index,
                field,
                value,
            })
        };
        let [east, north, up] = satellite.design_enu;
        let squared = east * east + north * north + up * up;
        // Printed directions have a few digits; anything else is no direction. NaN is none.
        if !(squared > 0.98 && squared < 1.02) {
            return refuse(Field::Design, libm::sqrt(squared));
        }
        if satellite.constellation >= constellations.len() {
            return refuse(Field::Constellation, satellite.constellation as f64);
        }
        let is_variance = |value: f64| (1e-12..=1e12).contains(&value);
        if !is_variance(satellite.variance_integrity_m2) {
            return refuse(Field::VarianceIntegrity, satellite.variance_integrity_m2);
        }
        if !is_variance(satellite.variance_accuracy_m2) {
            return refuse(Field::VarianceAccuracy, satellite.variance_accuracy_m2);
        }
        let is_bias = |value: f64| (0.0..=1e6).contains(&value);
        if !is_bias(satellite.bias_integrity_m) {
            return refuse(Field::BiasIntegrity, satellite.bias_integrity_m);
        }
        if !is_bias(satellite.bias_accuracy_m) {
            return refuse(Field::BiasAccuracy, satellite.bias_accuracy_m);
        }
        if !is_exposure(satellite.exposure) {
            return refuse(Field::Exposure, satellite.exposure);
        }
        if !is_fault_probability(satellite.p_fault, satellite.exposure) {
            return refuse(Field::PFault, satellite.p_fault);
        }
    }
    for (index, constellation) in constellations.iter().enumerate() {
        if !is_exposure(constellation.exposure) {
            let value = constellation.exposure;
            return Err(AraimError::Constellation { index, value });
        }
        if !is_fault_probability(constellation.p_fault, constellation.exposure) {
            let value = constellation.p_fault;
            return Err(AraimError::Constellation { index, value });
        }
    }
    Ok(())
}

/// Whether this is an exposure over a mean duration; NaN is none.
fn is_exposure(exposure: f64) -> bool {
    (0.0..=1e9).contains(&exposure)
}

/// Whether P and P (1 + T_exp/MFD) are probabilities of something that need not happen.
fn is_fault_probability(p_fault: f64, exposure: f64) -> bool {
    p_fault >= 0.0 && p_fault * (1.0 + exposure) < 1.0
}
