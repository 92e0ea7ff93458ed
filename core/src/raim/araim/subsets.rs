//! The position without some satellites, by rank-one updates of the position with all of them.
//!
//! In: satellites, their errors, a set to leave out. Out: [`SubsetSolution`], spreads and biases of that
//! solution and of its separation from the one with all satellites.
//!
//! | symbol | code | shape | unit | meaning |
//! |--------|------|-------|------|---------|
//! | W      | | n | 1/m² | inverse of C_int |
//! | A      | | n × 3 | 1/m | √W (G − mean of its constellation): the clocks are eliminated |
//! | P      | `covariance_m2` | 3 × 3 | m² | (AᵀA)⁻¹ |
//! | B      | `gain` | n × 3 | m | A P: a whitened pseudorange to the position |
//! | R      | `residual` | n × n | 1 | whitened pseudoranges to whitened residuals, clocks included |
//! | D      | `accuracy_ratio` | n | 1 | C_acc/C_int |
//!
//! Leaving out the satellites e₁ … e_r moves the solution by −Σ_k g_k (v_kᵀ z)/p_k, z the whitened
//! pseudoranges, where v_k is row e_k of R after the steps before it, p_k its own entry there (the pivot)
//! and g_k the row of B after the same steps. So, in each direction,
//! σ² = P + Σ g_k²/p_k, and the separation has the coefficients u = Σ (g_k/p_k) v_k on z:
//! σ_ss² = uᵀDu, bias = Σ |B − u| √W b_int, bias_ss = Σ |u| √W b_acc.
//! A pivot near zero means that what remains does not determine the position.
//!
//! Leaving out all of a constellation takes its clock away too: R has no rank for its last satellite. One
//! of them is kept in: alone it determines only its clock, and the position is the same.
//!
//! Source: [ARAIM-ADD] subset solutions; Sherman and Morrison [GOLUB-VANLOAN]; derivation:
//! docs/decisions/007-araim.md. Keys: docs/references.md.
//! Departure: updates instead of a solution per subset; equal to 1e-9 (tests).
//! Cost: about 60 instructions per satellite and mode, and as many per satellite left out.

use super::super::slope::MIN_RESIDUAL_COFACTOR;
use super::modes::SatelliteSet;
use super::{AraimError, AraimSatellite, MAX_ARAIM_SATELLITES, MAX_CONSTELLATIONS};

/// Least ratio of a pivot of AᵀA to the entry it started from: positions of 1e5 times the error of a
/// pseudorange are none.
const MIN_PIVOT_RATIO: f64 = 1e-10;

/// A solution and its separation from the one with all satellites; arrays are east, north, up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SubsetSolution {
    /// Satellites left out.
    pub excluded: SatelliteSet,
    /// Probability of its fault mode at a given instant; 1 for the fault-free one.
    pub p_instant: f64,
    /// Probability of its fault mode over the exposure.
    pub p_exposure: f64,
    /// Spread of the position error, for integrity, m.
    pub sigma_m: [f64; 3],
    /// Spread of the separation, for accuracy, m.
    pub sigma_separation_m: [f64; 3],
    /// Largest effect of nominal biases on the position, m.
    pub bias_m: [f64; 3],
    /// Effect of nominal biases on the separation, for accuracy, m.
    pub bias_separation_m: [f64; 3],
    /// The separation that is taken for a fault, m.
    pub threshold_m: [f64; 3],
}

impl SubsetSolution {
    pub(super) const EMPTY: Self = Self {
        excluded: SatelliteSet::EMPTY,
        p_instant: 0.0,
        p_exposure: 0.0,
        sigma_m: [0.0; 3],
        sigma_separation_m: [0.0; 3],
        bias_m: [0.0; 3],
        bias_separation_m: [0.0; 3],
        threshold_m: [0.0; 3],
    };
}

/// The geometry without the clocks, for one set of variances.
#[derive(Clone, Debug)]
struct Centred {
    /// W, 1/m²; zero for a satellite that is not in use.
    weights: [f64; MAX_ARAIM_SATELLITES],
    /// G minus the mean of its constellation.
    directions: [[f64; 3]; MAX_ARAIM_SATELLITES],
    /// Sum of W per constellation.
    weight_sums: [f64; MAX_CONSTELLATIONS],
    /// P.
    covariance_m2: [f64; 6],
}

impl Centred {
    const EMPTY: Self = Self {
        weights: [0.0; MAX_ARAIM_SATELLITES],
        directions: [[0.0; 3]; MAX_ARAIM_SATELLITES],
        weight_sums: [0.0; MAX_CONSTELLATIONS],
        covariance_m2: [0.0; 6],
    };

    fn form(
        &mut self,
        satellites: &[AraimSatellite],
        active: SatelliteSet,
        variance_m2: impl Fn(&AraimSatellite) -> f64,
    ) -> Result<(), AraimError> {
        *self = Self::EMPTY;
        let mut means = [[0.0; 3]; MAX_CONSTELLATIONS];
        for ((index, satellite), weight) in satellites.iter().enumerate().zip(&mut self.weights) {
            if !active.contains(index) {
                continue;
            }
            *weight = 1.0 / variance_m2(satellite);
            if let (Some(sum), Some(mean)) = (
                self.weight_sums.get_mut(satellite.constellation),
                means.get_mut(satellite.constellation),
            ) {
                *sum += *weight;
                for (mean, entry) in mean.iter_mut().zip(&satellite.design_enu) {
                    *mean += *weight * entry;
                }
            }
        }
        for (mean, sum) in means.iter_mut().zip(&self.weight_sums) {
            for entry in mean {
                *entry = if *sum > 0.0 { *entry / sum } else { 0.0 };
            }
        }
        let mut information = [0.0; 6];
        let places = self.directions.iter_mut().zip(&self.weights);
        for (satellite, (direction, weight)) in satellites.iter().zip(places) {
            let mean = means.get(satellite.constellation);
            let [mean_east, mean_north, mean_up] = mean.copied().unwrap_or_default();
            let [east, north, up] = satellite.design_enu;
            let [e, n, u] = [east - mean_east, north - mean_north, up - mean_up];
            let products = [e * e, e * n, e * u, n * n, n * u, u * u];
            for (sum, product) in information.iter_mut().zip(products) {
                *sum += weight * product;
            }
            *direction = [e, n, u];
        }
        self.covariance_m2 = inverse(&information).ok_or(AraimError::SingularGeometry)?;
        Ok(())
    }
}

/// What the solution with all satellites needs of each.
#[derive(Clone, Copy, Debug)]
struct Row {
    gain: [f64; 3],
    accuracy_ratio: f64,
    /// √W b_int and √W b_acc.
    bias_integrity: f64,
    bias_accuracy: f64,
}

impl Row {
    const EMPTY: Self = Self {
        gain: [0.0; 3],
        accuracy_ratio: 0.0,
        bias_integrity: 0.0,
        bias_accuracy: 0.0,
    };
}

/// The solution with all satellites in use.
#[derive(Clone, Debug)]
pub(super) struct AllInView {
    n: usize,
    unknowns: usize,
    active: SatelliteSet,
    constellations: [SatelliteSet; MAX_CONSTELLATIONS],
    integrity: Centred,
    accuracy: Centred,
    /// √W of the integrity variances.
    roots: [f64; MAX_ARAIM_SATELLITES],
    rows: [Row; MAX_ARAIM_SATELLITES],
    residual: [[f64; MAX_ARAIM_SATELLITES]; MAX_ARAIM_SATELLITES],
}

/// One rank-one update.
#[derive(Clone, Copy, Debug)]
struct Step {
    row: [f64; MAX_ARAIM_SATELLITES],
    gain: [f64; 3],
    inverse_pivot: f64,
}

impl Step {
    /// g_k/p_k.
    fn factors(&self) -> [f64; 3] {
        self.gain.map(|gain| gain * self.inverse_pivot)
    }
}

/// The rank-one updates that leave a set out.
#[derive(Clone, Debug)]
pub(super) struct LeaveOut {
    count: usize,
    steps: [Step; MAX_ARAIM_SATELLITES],
}

impl LeaveOut {
    pub(super) const EMPTY: Self = Self {
        count: 0,
        steps: [Step {
            row: [0.0; MAX_ARAIM_SATELLITES],
            gain: [0.0; 3],
            inverse_pivot: 0.0,
        }; MAX_ARAIM_SATELLITES],
    };

    /// By how much the redundancy shrinks.
    pub(super) fn rank(&self) -> usize {
        self.count
    }

    fn steps(&self) -> &[Step] {
        self.steps.get(..self.count).unwrap_or(&[])
    }
}

/// Position and residuals of measurements.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub position_enu_m: [f64; 3],
    /// Whitened.
    pub residual: [f64; MAX_ARAIM_SATELLITES],
    pub sum_of_squares: f64,
    /// Of the solution weighted by 1/C_acc instead of 1/C_int.
    pub sum_of_squares_accuracy: f64,
}

impl AllInView {
    pub(super) const EMPTY: Self = Self {
        n: 0,
        unknowns: 0,
        active: SatelliteSet::EMPTY,
        constellations: [SatelliteSet::EMPTY; MAX_CONSTELLATIONS],
        integrity: Centred::EMPTY,
        accuracy: Centred::EMPTY,
        roots: [0.0; MAX_ARAIM_SATELLITES],
        rows: [Row::EMPTY; MAX_ARAIM_SATELLITES],
        residual: [[0.0; MAX_ARAIM_SATELLITES]; MAX_ARAIM_SATELLITES],
    };

    /// Satellites given, used or not.
    pub(super) fn n(&self) -> usize {
        self.n
    }

    /// Satellites in use.
    pub(super) fn active(&self) -> SatelliteSet {
        self.active
    }

    /// Satellites in use minus unknowns.
    pub(super) fn redundancy(&self) -> usize {
        self.active.len().saturating_sub(self.unknowns)
    }

    /// Solves with the satellites `active`.
    ///
    /// # Errors
    /// [`AraimError::TooFewSatellites`], [`AraimError::SingularGeometry`].
    #[inline(never)]
    pub(super) fn form(
        &mut self,
        satellites: &[AraimSatellite],
        active: SatelliteSet,
    ) -> Result<(), AraimError> {
        self.n = satellites.len();
        self.active = active;
        self.constellations = [SatelliteSet::EMPTY; MAX_CONSTELLATIONS];
        for (index, satellite) in satellites.iter().enumerate() {
            if active.contains(index)
                && let Some(set) = self.constellations.get_mut(satellite.constellation)
            {
                *set = set.with(index);
            }
        }
        let clocks = self.constellations.iter().filter(|set| !set.is_empty());
        self.unknowns = 3 + clocks.count();
        if active.len() < self.unknowns {
            return Err(AraimError::TooFewSatellites {
                satellites: active.len(),
                unknowns: self.unknowns,
            });
        }
        self.integrity.form(satellites, active, |satellite| {
            satellite.variance_integrity_m2
        })?;
        self.accuracy.form(satellites, active, |satellite| {
            satellite.variance_accuracy_m2
        })?;

        self.rows = [Row::EMPTY; MAX_ARAIM_SATELLITES];
        self.roots = self.integrity.weights.map(libm::sqrt);
        let geometry = self.integrity.directions.iter().zip(&self.roots);
        for (satellite, (row, (direction, root))) in
            satellites.iter().zip(self.rows.iter_mut().zip(geometry))
        {
            let gain = times(&self.integrity.covariance_m2, direction);
            *row = Row {
                gain: gain.map(|entry| root * entry),
                accuracy_ratio: satellite.variance_accuracy_m2 / satellite.variance_integrity_m2,
                bias_integrity: root * satellite.bias_integrity_m,
                bias_accuracy: root * satellite.bias_accuracy_m,
            };
        }
        self.form_residual(satellites);
        Ok(())
    }

    /// R = I − √w √wᵀ/Σw within a constellation − A P Aᵀ.
    fn form_residual(&mut self, satellites: &[AraimSatellite]) {
        let places = self.residual.iter_mut().zip(&self.rows).zip(&self.roots);
        for ((index, satellite), ((residual, row), root)) in
            satellites.iter().enumerate().zip(places)
        {
            let sum = self.integrity.weight_sums.get(satellite.constellation);
            let scale = match sum {
                Some(sum) if *sum > 0.0 => root / sum,
                _ => 0.0,
            };
            let others = self.integrity.directions.iter().zip(&self.roots);
            let others = satellites.iter().zip(others).zip(residual.iter_mut());
            for ((other, (direction, other_root)), entry) in others {
                let clock = if other.constellation == satellite.constellation {
                    scale
                } else {
                    0.0
                };
                *entry = -other_root * (clock + dot(&row.gain, direction));
            }
            if let Some(entry) = residual.get_mut(index) {
                *entry += 1.0;
            }
        }
    }

    /// σ of the position error for accuracy: Σ (B D B), m.
    pub(super) fn sigma_accuracy_m(&self) -> [f64; 3] {
        let mut variance = [0.0; 3];
        for row in &self.rows {
            for (sum, gain) in variance.iter_mut().zip(&row.gain) {
                *sum += gain * gain * row.accuracy_ratio;
            }
        }
        variance.map(libm::sqrt)
    }

    /// Finds the updates that leave a set out; `false` if what remains does not determine the position.
    pub(super) fn leave_out(&self, excluded: SatelliteSet, work: &mut LeaveOut) -> bool {
        work.count = 0;
        let eliminated = self.without_one_of_each_whole_constellation(excluded);
        if self.active.len() < eliminated.len() + self.unknowns {
            // A pivot would vanish; this is the same answer sooner.
            return false;
        }
        for index in eliminated.iter() {
            let Some((done, rest)) = work.steps.split_at_mut_checked(work.count) else {
                return false;
            };
            let (Some(step), Some(row), Some(residual)) = (
                rest.first_mut(),
                self.rows.get(index),
                self.residual.get(index),
            ) else {
                return false;
            };
            step.row = *residual;
            step.gain = row.gain;
            for earlier in done.iter() {
                let factor = earlier.row.get(index).copied().unwrap_or(0.0) * earlier.inverse_pivot;
                for (entry, known) in step.row.iter_mut().zip(&earlier.row).take(self.n) {
                    *entry -= factor * known;
                }
                for (entry, known) in step.gain.iter_mut().zip(&earlier.gain) {
                    *entry -= factor * known;
                }
            }
            let pivot = step.row.get(index).copied().unwrap_or(0.0);
            // NaN is no pivot.
            if !(pivot >= MIN_RESIDUAL_COFACTOR) {
                return false;
            }
            step.inverse_pivot = 1.0 / pivot;
            work.count += 1;
        }
        true
    }

    /// What the elimination takes out for a set: one satellite of each constellation that goes as a whole
    /// stays, as the only one that sees its clock.
    fn without_one_of_each_whole_constellation(&self, excluded: SatelliteSet) -> SatelliteSet {
        let mut eliminated = excluded;
        for members in &self.constellations {
            if excluded.contains_all(*members)
                && let Some(last) = members.iter().last()
            {
                eliminated = eliminated.without(SatelliteSet::EMPTY.with(last));
            }
        }
        eliminated
    }

    /// Spreads and biases of the solution whose updates were found.
    pub(super) fn solution(&self, leave_out: &LeaveOut, solution: &mut SubsetSolution) {
        let [ee, _, _, nn, _, uu] = self.integrity.covariance_m2;
        let mut variance = [ee, nn, uu];
        for step in leave_out.steps() {
            for (sum, gain) in variance.iter_mut().zip(&step.gain) {
                *sum += gain * gain * step.inverse_pivot;
            }
        }
        solution.sigma_m = variance.map(libm::sqrt);
        // One or two steps are nearly all modes, and need no memory for u.
        match leave_out.steps() {
            [] => self.sum_up(core::iter::repeat([0.0; 3]), solution),
            [one] => {
                let [e, n, u] = one.factors();
                let coefficients = one.row.iter().map(|x| [e * x, n * x, u * x]);
                self.sum_up(coefficients, solution);
            }
            [one, two] => {
                let [e, n, u] = one.factors();
                let [f, o, v] = two.factors();
                let rows = one.row.iter().zip(&two.row);
                let coefficients = rows.map(|(x, y)| [e * x + f * y, n * x + o * y, u * x + v * y]);
                self.sum_up(coefficients, solution);
            }
            steps => {
                let mut coefficients = [[0.0; 3]; MAX_ARAIM_SATELLITES];
                for step in steps {
                    let [e, n, u] = step.factors();
                    for (coefficient, x) in coefficients.iter_mut().zip(&step.row).take(self.n) {
                        let [east, north, up] = coefficient;
                        *east += e * x;
                        *north += n * x;
                        *up += u * x;
                    }
                }
                self.sum_up(coefficients.iter().copied(), solution);
            }
        }
    }

    /// Spread of the separation with the coefficients u, and biases of it and of the solution. A satellite that
    /// is left out counts with B − u, which is zero but for rounding.
    fn sum_up(&self, coefficients: impl Iterator<Item = [f64; 3]>, solution: &mut SubsetSolution) {
        let mut separation = [0.0; 3];
        let mut bias = [0.0; 3];
        let mut bias_separation = [0.0; 3];
        for (row, u) in self.rows.iter().zip(coefficients).take(self.n) {
            for (sum, u) in separation.iter_mut().zip(&u) {
                *sum += u * u * row.accuracy_ratio;
            }
            for (sum, (gain, u)) in bias.iter_mut().zip(row.gain.iter().zip(&u)) {
                *sum += libm::fabs(gain - u) * row.bias_integrity;
            }
            for (sum, u) in bias_separation.iter_mut().zip(&u) {
                *sum += libm::fabs(*u) * row.bias_accuracy;
            }
        }
        solution.sigma_separation_m = separation.map(libm::sqrt);
        solution.bias_m = bias;
        solution.bias_separation_m = bias_separation;
    }

    /// Position and residuals of measurements minus predictions, one per satellite given.
    pub(super) fn fit(&self, residual_m: &[f64]) -> Fit {
        let mut whitened = [0.0; MAX_ARAIM_SATELLITES];
        let mut position_enu_m = [0.0; 3];
        let scaled = whitened.iter_mut().zip(residual_m.iter().zip(&self.roots));
        for ((entry, (given, root)), row) in scaled.zip(&self.rows) {
            *entry = given * root;
            for (sum, gain) in position_enu_m.iter_mut().zip(&row.gain) {
                *sum += gain * *entry;
            }
        }
        let mut fit = Fit {
            position_enu_m,
            residual: [0.0; MAX_ARAIM_SATELLITES],
            sum_of_squares: 0.0,
            sum_of_squares_accuracy: 0.0,
        };
        let rows = self.residual.iter().take(self.n).enumerate();
        for ((index, coefficients), entry) in rows.zip(&mut fit.residual) {
            if !self.active.contains(index) {
                continue;
            }
            let mut sum = 0.0;
            for (coefficient, value) in coefficients.iter().zip(&whitened) {
                sum += coefficient * value;
            }
            *entry = sum;
            fit.sum_of_squares += sum * sum;
        }
        fit.sum_of_squares_accuracy = self.sum_of_squares_accuracy(&fit.residual);
        fit
    }

    /// Least sum of squares with the weights for accuracy, from the residuals of the other solution.
    fn sum_of_squares_accuracy(&self, residual: &[f64; MAX_ARAIM_SATELLITES]) -> f64 {
        let accuracy = &self.accuracy;
        // In metres, then without the clocks.
        let mut centred_m = [0.0; MAX_ARAIM_SATELLITES];
        for ((entry, value), root) in centred_m.iter_mut().zip(residual).zip(&self.roots) {
            if *root > 0.0 {
                *entry = value / root;
            }
        }
        for (members, sum) in self.constellations.iter().zip(&accuracy.weight_sums) {
            let mut mean = 0.0;
            for (index, (entry, weight)) in centred_m.iter().zip(&accuracy.weights).enumerate() {
                if members.contains(index) {
                    mean += entry * weight;
                }
            }
            for (index, entry) in centred_m.iter_mut().enumerate() {
                if members.contains(index) {
                    *entry -= mean / sum;
                }
            }
        }
        let rows = || accuracy.directions.iter().zip(&accuracy.weights);
        let mut right = [0.0; 3];
        for (entry, (direction, weight)) in centred_m.iter().zip(rows()) {
            for (sum, component) in right.iter_mut().zip(direction) {
                *sum += weight * component * entry;
            }
        }
        let position = times(&accuracy.covariance_m2, &right);
        let mut sum = 0.0;
        for (entry, (direction, weight)) in centred_m.iter().zip(rows()) {
            let left = entry - dot(direction, &position);
            sum += weight * left * left;
        }
        sum
    }

    /// Solution of a subset minus solution with all, m, and by how much its sum of squares is smaller.
    pub(super) fn separation(&self, leave_out: &LeaveOut, fit: &Fit) -> ([f64; 3], f64) {
        let mut separation = [0.0; 3];
        let mut reduction = 0.0;
        for step in leave_out.steps() {
            // v_kᵀ z: v_k lies in the range of R, where z and its residual are the same.
            let mut value = 0.0;
            for (entry, residual) in step.row.iter().zip(&fit.residual) {
                value += entry * residual;
            }
            let scaled = value * step.inverse_pivot;
            for (sum, gain) in separation.iter_mut().zip(&step.gain) {
                *sum -= gain * scaled;
            }
            reduction += value * scaled;
        }
        (separation, reduction)
    }
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    let [ax, ay, az] = a;
    let [bx, by, bz] = b;
    ax * bx + ay * by + az * bz
}

/// Product of a symmetric matrix (xx, xy, xz, yy, yz, zz) and a vector.
fn times(m: &[f64; 6], v: &[f64; 3]) -> [f64; 3] {
    let [xx, xy, xz, yy, yz, zz] = *m;
    [
        dot(&[xx, xy, xz], v),
        dot(&[xy, yy, yz], v),
        dot(&[xz, yz, zz], v),
    ]
}

/// Inverse of a symmetric positive definite matrix (xx, xy, xz, yy, yz, zz) by its factors L D Lᵀ; `None`
/// when a pivot all but vanishes, or is NaN.
fn inverse(m: &[f64; 6]) -> Option<[f64; 6]> {
    let [xx, xy, xz, yy, yz, zz] = *m;
    if !(xx > 0.0) {
        return None;
    }
    let l_yx = xy / xx;
    let l_zx = xz / xx;
    let d_y = yy - l_yx * xy;
    if !(d_y > MIN_PIVOT_RATIO * yy) {
        return None;
    }
    let c_zy = yz - l_zx * xy;
    let l_zy = c_zy / d_y;
    let d_z = zz - l_zx * xz - l_zy * c_zy;
    if !(d_z > MIN_PIVOT_RATIO * zz) {
        return None;
    }
    // Rows of L⁻¹.
    let k_zx = l_yx * l_zy - l_zx;
    let (i_x, i_y, i_z) = (1.0 / xx, 1.0 / d_y, 1.0 / d_z);
    let inverse = [
        i_x + l_yx * l_yx * i_y + k_zx * k_zx * i_z,
        -l_yx * i_y - k_zx * l_zy * i_z,
        k_zx * i_z,
        i_y + l_zy * l_zy * i_z,
        -l_zy * i_z,
        i_z,
    ];
    inverse
        .iter()
        .all(|entry| entry.is_finite())
        .then_some(inverse)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_inverse_undoes_its_matrix_and_a_singular_one_has_none() {
        let m = [4.0, 1.0, -0.5, 3.0, 0.25, 2.0];
        let inverse = inverse(&m).unwrap();
        for (i, unit) in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
            .iter()
            .enumerate()
        {
            let back = times(&m, &times(&inverse, unit));
            for (j, entry) in back.iter().enumerate() {
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!((entry - expected).abs() < 1e-15);
            }
        }
        assert_eq!(super::inverse(&[1.0, 1.0, 0.0, 1.0, 0.0, 1.0]), None);
        assert_eq!(super::inverse(&[f64::NAN, 0.0, 0.0, 1.0, 0.0, 1.0]), None);
        assert_eq!(super::inverse(&[1.0, 0.0, 0.0, 1.0, 0.0, 0.0]), None);
    }
}
