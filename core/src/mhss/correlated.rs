//! A bound on what time-correlated pseudorange errors do to the filters, for every correlation time.
//!
//! A filter takes the errors of its measurements for white. Errors that last for minutes move it almost
//! as the weighted least squares of the same satellites: a constant error of the pseudoranges moves it
//! exactly so, in the end, and one that changes moves it less. The variance of each filter is therefore
//! bounded by what it says itself, for the white part, and that of the least squares, for the correlated
//! part. No state is needed for it. Measured against the exact covariance:
//! `host-tests/tests/correlated_bound.rs`; derivation: docs/decisions/008-correlated-noise.md.
//!
//! | symbol | code            | shape | unit | frame | meaning                                                |
//! |--------|-----------------|-------|------|-------|--------------------------------------------------------|
//! | a_i    | `Row::design`   | D     |      |       | pseudorange row over its sigma: position, clocks       |
//! | G      | `Subset::cofactor` | 3 × 3 | m² | enu  | (Σ a_i a_iᵀ)⁻¹ of the position                         |
//! | u_i    | `Row::gain`     | D     | m    | e     | G a_i                                                  |
//! | q_i    | `Row::left`     | 1     | 1    |       | 1 − a_iᵀ u_i: redundancy of row i                      |
//! | c      | `Row::common`   | 1     | 1    |       | error common to the satellites as row i sees it, over σ|
//! | x_c    | `Subset::common`| 3     | m    | enu   | what c does to the position                            |
//! | ρ²     | `ratio`         | 1     | 1    |       | correlated variance over that which the filter assumes |
//! | κ      |                 | 1     | 1    |       | share of the way to the least squares in one epoch     |
//!
//! Leaving out row n: G_n = G + u_n u_nᵀ/q_n, x_n = x − u_n e_n/q_n with the residual e_n of c; leaving out
//! two the same twice. The separation of the two solutions has the variance
//! (ρ²/q_n + (e_n/q_n)²) u_n u_nᵀ.
//!
//! A filter does not follow the least squares at once: per epoch it goes the share κ = P/P_wls of the
//! way, its posterior variance over that of the least squares with the same weights, which is its gain. So
//! does the bound, faster upwards (2 κ) than downwards (about κ/2, the root of what is left of the variance).
//! Where the least squares has no solution there
//! is no way to go, and yet some satellites may move the filter: by K b per epoch, whose variance is at most
//! ρ² times what the update takes from the filter's own, K S Kᵀ. Four times that much the bound grows, for what
//! the velocity then does. Without any
//! satellite it is held.

#![expect(
    clippy::indexing_slicing,
    reason = "indices are below the fixed sizes by the loops' bounds; the no-panic image is the judge"
)]

use nalgebra::{Matrix3, Vector3};

use super::bank::{ExtraNoise, MAX_BANK, OwnVariances};
use super::least_squares::{MIN_LEFT, Normals, POSITION, UNKNOWNS, dot, whitened};
use super::separation::Variances;
use crate::consts::MAX_CLOCKS;
use crate::ekf::MeasurementRow;

/// The bound goes up by this many times the filter's gain.
const UPWARDS: f64 = 2.0;
/// Without a least-squares solution the bound grows by this many times what the update takes: what moves the
/// position moves the velocity too.
const GROWTH: f64 = 4.0;
/// A separation that has begun is not taken for less than this, m. What correlated errors have put into velocity,
/// attitude and biases comes back into the position for longer than its own variance says: over a day of
/// recording the filter without a satellite that had set stayed 5 cm away while the bound went down to 1 cm.
const LEAST_SEPARATION_M: f64 = 0.05;
/// Least ratio of the horizontal to the vertical part of a separation, and the other way round.
const LEAST_PART: f64 = 0.2;

/// A satellite of the epoch in least squares.
#[derive(Clone, Copy, Debug)]
struct Row {
    design: [f64; UNKNOWNS],
    gain: [f64; UNKNOWNS],
    /// The position part of the gain, east, north, up.
    gain_enu: [f64; 3],
    common: f64,
    /// Residual of the common error.
    residual: f64,
    left: f64,
}

impl Row {
    const ZERO: Self = Self {
        design: [0.0; UNKNOWNS],
        gain: [0.0; UNKNOWNS],
        gain_enu: [0.0; 3],
        common: 0.0,
        residual: 0.0,
        left: 0.0,
    };
}

/// A least-squares solution.
#[derive(Clone, Copy, Debug)]
struct Subset {
    /// East-east, east-north, north-north, up-up.
    cofactor: [f64; 4],
    /// East, north, up.
    common: [f64; 3],
}

impl Subset {
    /// Variances of the correlated part.
    fn variances(&self, ratio: f64) -> Variances {
        let [ee, en, nn, uu] = self.cofactor;
        let [e, n, u] = self.common;
        [
            largest(ratio * ee + e * e, ratio * en + e * n, ratio * nn + n * n),
            ratio * uu + u * u,
        ]
    }

    /// Variances with the weights of the filter.
    fn own(&self) -> Variances {
        let [ee, en, nn, uu] = self.cofactor;
        [largest(ee, en, nn), uu]
    }

    /// Without a row of the same redundancy `left`, gain and residual.
    fn without(&self, gain: &[f64; 3], left: f64, residual: f64) -> Self {
        let [e, n, u] = *gain;
        let [ee, en, nn, uu] = self.cofactor;
        let share = residual / left;
        Self {
            cofactor: [
                ee + e * e / left,
                en + e * n / left,
                nn + n * n / left,
                uu + u * u / left,
            ],
            common: [
                self.common[0] - e * share,
                self.common[1] - n * share,
                self.common[2] - u * share,
            ],
        }
    }
}

/// Largest eigenvalue of a symmetric 2 × 2 matrix.
fn largest(xx: f64, xy: f64, yy: f64) -> f64 {
    let half = 0.5 * (xx - yy);
    0.5 * (xx + yy) + libm::sqrt(half * half + xy * xy)
}

/// What the bound remembers of one filter: one sigma of the correlated part, horizontal and vertical, m.
type Sigmas = [f64; 2];

/// The bound of all filters of a bank. A few kilobytes.
#[derive(Clone, Debug)]
pub struct CorrelatedBound {
    ratio: f64,
    main: Sigmas,
    sub: [Sigmas; MAX_BANK],
    separation: [Sigmas; MAX_BANK],
    constellation: [Sigmas; MAX_CLOCKS],
    constellation_separation: [Sigmas; MAX_CLOCKS],
    unaided: Sigmas,
    /// Satellites of the epoch, by their places in the bank.
    rows: [Option<Row>; MAX_BANK],
    whole: Option<Subset>,
    without_constellation: [Option<Subset>; MAX_CLOCKS],
    normals: Normals,
}

/// A satellite of an epoch, as the bound takes it.
#[derive(Clone, Copy, Debug)]
pub struct CorrelatedRow<'a, const M: usize> {
    /// Its place in the bank.
    pub place: usize,
    /// Number of its constellation.
    pub constellation: usize,
    /// Its linearised measurements.
    pub row: &'a MeasurementRow<M>,
    /// What an error common to all satellites does to it, one sigma, m.
    pub common_m: f64,
}

impl CorrelatedBound {
    /// Nothing is correlated.
    pub const NONE: Self = Self {
        ratio: 0.0,
        main: [0.0; 2],
        sub: [[0.0; 2]; MAX_BANK],
        separation: [[0.0; 2]; MAX_BANK],
        constellation: [[0.0; 2]; MAX_CLOCKS],
        constellation_separation: [[0.0; 2]; MAX_CLOCKS],
        unaided: [0.0; 2],
        rows: [None; MAX_BANK],
        whole: None,
        without_constellation: [None; MAX_CLOCKS],
        normals: Normals::ZERO,
    };

    /// Begins anew: `ratio` is the variance of the correlated part over the variance the filters take for
    /// white. `start_m` is one sigma of what the start of the filters holds of it already, horizontal and
    /// vertical.
    pub fn start(&mut self, ratio: f64, start_m: [f64; 2]) {
        self.ratio = ratio;
        self.main = start_m;
        self.sub = [start_m; MAX_BANK];
        self.separation = [[0.0; 2]; MAX_BANK];
        self.constellation = [start_m; MAX_CLOCKS];
        self.constellation_separation = [[0.0; 2]; MAX_CLOCKS];
        self.unaided = start_m;
        self.rows = [None; MAX_BANK];
        self.whole = None;
        self.without_constellation = [None; MAX_CLOCKS];
    }

    /// Whether the satellites of the epoch give a position by themselves.
    pub const fn is_solved(&self) -> bool {
        self.whole.is_some()
    }

    /// A satellite takes a place: its filter begins as a copy of the main one.
    pub fn begin(&mut self, place: usize) {
        if let Some(sub) = self.sub.get_mut(place) {
            *sub = self.main;
        }
        if let Some(separation) = self.separation.get_mut(place) {
            *separation = [0.0; 2];
        }
    }

    /// A constellation's filter begins as a copy of the main one.
    pub fn begin_constellation(&mut self, constellation: usize) {
        if let Some(sub) = self.constellation.get_mut(constellation) {
            *sub = self.main;
        }
        if let Some(separation) = self.constellation_separation.get_mut(constellation) {
            *separation = [0.0; 2];
        }
    }

    /// The filter without aids begins as a copy of the main one.
    pub const fn begin_unaided(&mut self) {
        self.unaided = self.main;
    }

    /// The aids are excluded: the filter without them is the main one, and all others begin as copies of it.
    pub fn exclude_aids(&mut self) {
        self.begin_all(self.unaided);
    }

    /// The satellite of a place is excluded: its filter is the main one from now on, and the filters without
    /// one satellite are those that were without both. To be followed by [`CorrelatedBound::solve`] without it.
    pub fn exclude(&mut self, place: usize) {
        let Some(base) = self.sub.get(place).copied() else {
            return;
        };
        for other in 0..MAX_BANK {
            let pair = self.pair_variances(place, other);
            let (Some(sub), Some(separation)) =
                (self.sub.get_mut(other), self.separation.get_mut(other))
            else {
                continue;
            };
            match pair {
                Some((own, between)) => {
                    // What the filters it follows remember of a worse sky is not forgotten.
                    *sub = maximum(own.map(root), maximum(*sub, base));
                    *separation = between;
                }
                None => {
                    *sub = sum(*sub, base);
                    *separation = sum(*sub, base);
                }
            }
        }
        self.main = base;
        // The filters without a constellation begin as copies of the main one, or stay.
        for constellation in &mut self.constellation {
            *constellation = maximum(*constellation, base);
        }
        self.unaided = maximum(self.unaided, base);
        if let Some(row) = self.rows.get_mut(place) {
            *row = None;
        }
    }

    /// The same where all filters begin as copies of the new main one.
    pub fn exclude_alone(&mut self, place: usize) {
        if let Some(base) = self.sub.get(place).copied() {
            self.begin_all(base);
        }
    }

    /// Two satellites are excluded: the filter without both is the main one, and all others begin as copies of it.
    pub fn exclude_two(&mut self, one: usize, other: usize) {
        let base = match self.pair_variances(one, other) {
            Some((own, _)) => maximum(own.map(root), maximum(self.sigmas(one), self.sigmas(other))),
            None => sum(self.sigmas(one), self.sigmas(other)),
        };
        self.begin_all(base);
    }

    fn begin_all(&mut self, base: Sigmas) {
        self.main = base;
        self.sub = [base; MAX_BANK];
        self.separation = [[0.0; 2]; MAX_BANK];
        self.constellation = [base; MAX_CLOCKS];
        self.constellation_separation = [[0.0; 2]; MAX_CLOCKS];
        self.unaided = base;
    }

    /// A constellation is excluded: its filter is the main one, and all others begin as copies of it.
    pub fn exclude_constellation(&mut self, constellation: usize) {
        if let Some(base) = self.constellation.get(constellation).copied() {
            self.begin_all(base);
        }
    }

    /// Solves the least squares of an epoch, of all satellites, without each constellation, and prepares
    /// for leaving out one or two.
    #[inline(never)]
    pub fn solve<'a, const M: usize>(
        &mut self,
        rows: impl Iterator<Item = CorrelatedRow<'a, M>>,
        c_enu_e: &Matrix3<f64>,
    ) {
        let mut constellations = [None; MAX_BANK];
        self.rows = [None; MAX_BANK];
        for row in rows {
            let places = self
                .rows
                .get_mut(row.place)
                .zip(constellations.get_mut(row.place));
            if let Some((place, constellation)) = places
                && let Some(design) = whitened(row.row)
                && row.common_m.is_finite()
            {
                *place = Some(Row {
                    design,
                    common: row.common_m * libm::sqrt(row.row.weight),
                    ..Row::ZERO
                });
                *constellation = Some(row.constellation);
            }
        }
        for (constellation, subset) in self.without_constellation.iter_mut().enumerate() {
            let rows = || {
                let of = self.rows.iter().zip(&constellations);
                of.filter(move |(_, of)| **of != Some(constellation))
                    .filter_map(|(row, _)| row.as_ref())
            };
            // The same as the whole where the constellation is not there.
            let is_there = constellations.contains(&Some(constellation));
            *subset = if is_there {
                solved(&mut self.normals, rows, c_enu_e).map(|(subset, _)| subset)
            } else {
                None
            };
        }
        let whole = solved(
            &mut self.normals,
            || self.rows.iter().filter_map(Option::as_ref),
            c_enu_e,
        );
        self.whole = whole.map(|(subset, _)| subset);
        let Some((_, common)) = whole else {
            return;
        };
        for row in self.rows.iter_mut().flatten() {
            row.gain = self.normals.solve(&row.design);
            let [.., x, y, z] = row.gain;
            row.gain_enu = (c_enu_e * Vector3::new(x, y, z)).into();
            row.left = 1.0 - dot(&row.design, &row.gain);
            row.residual = row.common - dot(&row.design, &common);
        }
    }

    fn sigmas(&self, place: usize) -> Sigmas {
        self.sub.get(place).copied().unwrap_or([f64::INFINITY; 2])
    }

    fn row(&self, place: usize) -> Option<&Row> {
        self.rows.get(place)?.as_ref()
    }

    fn without(&self, place: usize) -> Option<Subset> {
        let whole = self.whole?;
        match self.row(place) {
            None => Some(whole),
            Some(row) if row.left > MIN_LEFT => {
                Some(whole.without(&row.gain_enu, row.left, row.residual))
            }
            Some(_) => None,
        }
    }

    /// Variances of the least squares without two satellites, and of its separation from that without the
    /// first alone.
    fn pair_variances(&self, base: usize, other: usize) -> Option<(Variances, Sigmas)> {
        let without_base = self.without(base)?;
        let Some(row) = self.row(other) else {
            return Some((without_base.variances(self.ratio), [0.0; 2]));
        };
        let (mut gain, mut left, mut residual) = (row.gain_enu, row.left, row.residual);
        if let Some(first) = self.row(base) {
            let coupling = dot(&first.design, &row.gain);
            let share = coupling / first.left;
            for (entry, of_first) in gain.iter_mut().zip(&first.gain_enu) {
                *entry += of_first * share;
            }
            left -= coupling * share;
            residual += first.residual * share;
        }
        if !(left > MIN_LEFT) {
            return None;
        }
        Some((
            without_base
                .without(&gain, left, residual)
                .variances(self.ratio),
            between(&gain, left, residual, self.ratio),
        ))
    }
}

impl ExtraNoise for CorrelatedBound {
    /// The main filter's variance of the correlated part at this epoch; `own` is its posterior variance.
    fn main(&mut self, own: &OwnVariances) -> Variances {
        self.main = advanced(self.main, self.whole.as_ref(), self.ratio, own);
        squares(self.main)
    }

    /// The same of the filter without the satellite of a place, and of its separation from the main one,
    /// which has been advanced.
    fn sub(&mut self, place: usize, own: &OwnVariances) -> [Variances; 2] {
        let without = self.without(place);
        let row = self.rows.get(place).copied().flatten();
        let (Some(sub), Some(separation)) =
            (self.sub.get_mut(place), self.separation.get_mut(place))
        else {
            return [[f64::NAN; 2]; 2];
        };
        *sub = advanced(*sub, without.as_ref(), self.ratio, own);
        let limit = sum(self.main, *sub);
        let target = match row {
            // Both filters have the same satellites now.
            None => [0.0; 2],
            Some(row) if row.left > MIN_LEFT => {
                between(&row.gain_enu, row.left, row.residual, self.ratio)
            }
            Some(_) => limit,
        };
        *separation = separated(
            *separation,
            target,
            limit,
            self.whole.as_ref(),
            self.ratio,
            own,
        );
        [squares(*sub), squares(*separation)]
    }

    /// The same of the filter without a constellation.
    fn constellation(&mut self, constellation: usize, own: &OwnVariances) -> [Variances; 2] {
        let without = self
            .without_constellation
            .get(constellation)
            .copied()
            .flatten();
        let (Some(sub), Some(separation)) = (
            self.constellation.get_mut(constellation),
            self.constellation_separation.get_mut(constellation),
        ) else {
            return [[f64::NAN; 2]; 2];
        };
        *sub = advanced(*sub, without.as_ref(), self.ratio, own);
        let limit = sum(self.main, *sub);
        let target = match (without, self.whole) {
            (Some(less), Some(all)) => {
                let mut difference = less;
                for (entry, of_all) in difference.cofactor.iter_mut().zip(&all.cofactor) {
                    *entry -= of_all;
                }
                for (entry, of_all) in difference.common.iter_mut().zip(&all.common) {
                    *entry -= of_all;
                }
                difference.variances(self.ratio).map(root)
            }
            _ => limit,
        };
        *separation = separated(
            *separation,
            target,
            limit,
            self.whole.as_ref(),
            self.ratio,
            own,
        );
        [squares(*sub), squares(*separation)]
    }

    /// The same of the filter without aids, which has the same satellites as the main one and follows their
    /// errors faster: the separation is what the main filter smooths away of them, no more than all.
    fn unaided(&mut self, own: &OwnVariances) -> [Variances; 2] {
        self.unaided = advanced(self.unaided, self.whole.as_ref(), self.ratio, own);
        [squares(self.unaided); 2]
    }

    /// Variance of the correlated part of the separation between the filter without the satellite of one
    /// place and that without both; as that of the second's alone where one of them is not seen.
    fn pair(&self, base: usize, other: usize) -> Variances {
        self.pair_variances(base, other).map_or_else(
            || {
                let [h, v] = sum(self.sigmas(base), self.sigmas(other));
                [h * h, v * v]
            },
            |(_, between)| squares(between),
        )
    }
}

/// The least squares of some rows, and the common error of all unknowns; `normals` holds the factors then.
fn solved<'a, I: Iterator<Item = &'a Row>>(
    normals: &mut Normals,
    rows: impl Fn() -> I,
    c_enu_e: &Matrix3<f64>,
) -> Option<(Subset, [f64; UNKNOWNS])> {
    *normals = Normals::ZERO;
    let mut right = [0.0; UNKNOWNS];
    for row in rows() {
        normals.add(&row.design);
        for (entry, a) in right.iter_mut().zip(&row.design) {
            *entry += a * row.common;
        }
    }
    if !normals.factor() {
        return None;
    }
    let common = normals.solve(&right);
    let [.., x, y, z] = common;
    let common_enu = c_enu_e * Vector3::new(x, y, z);
    let mut cofactor = Matrix3::zeros();
    for axis in 0..3 {
        let mut unit = [0.0; UNKNOWNS];
        unit[POSITION + axis] = 1.0;
        let [.., x, y, z] = normals.solve(&unit);
        cofactor.set_column(axis, &Vector3::new(x, y, z));
    }
    let enu = c_enu_e * cofactor * c_enu_e.transpose();
    Some((
        Subset {
            cofactor: [enu.m11, enu.m12, enu.m22, enu.m33],
            common: common_enu.into(),
        },
        common,
    ))
}

/// One sigma of the separation of two least squares, one without a row of this gain, redundancy, residual.
/// Filters on the way to them are apart in other directions too: neither axis has less than a part of the
/// other.
fn between(gain: &[f64; 3], left: f64, residual: f64, ratio: f64) -> Sigmas {
    let [e, n, u] = *gain;
    let share = residual / left;
    let scale = libm::sqrt(ratio / left + share * share);
    let (h, v) = (scale * libm::sqrt(e * e + n * n), scale * libm::fabs(u));
    [
        if h > LEAST_PART * v {
            h
        } else {
            LEAST_PART * v
        },
        if v > LEAST_PART * h {
            v
        } else {
            LEAST_PART * h
        },
    ]
}

/// One epoch of the bound: towards the least squares by the filter's own gain, and upwards by no less than
/// what the update can have moved the position.
fn advanced(from: Sigmas, to: Option<&Subset>, ratio: f64, own: &OwnVariances) -> Sigmas {
    let steps = steps(ratio, own);
    let Some(to) = to else {
        return sum(from, steps);
    };
    let least_squares = to.own();
    let targets = to.variances(ratio);
    core::array::from_fn(|axis| {
        let (from, target) = (from[axis], root(targets[axis]));
        if !(target > from) {
            return target + kept(own, axis) * (from - target);
        }
        let gain = UPWARDS * own.left[axis] / least_squares[axis];
        let mut step = if gain < 1.0 {
            gain * (target - from)
        } else {
            target - from
        };
        if step < steps[axis] {
            step = steps[axis];
        }
        if from + step > target {
            target
        } else {
            from + step
        }
    })
}

/// What an update leaves of an error that was in the position before, at most: the root of what it leaves of
/// the variance.
fn kept(own: &OwnVariances, axis: usize) -> f64 {
    let (left, taken) = (own.left[axis], own.taken[axis]);
    let share = left / (left + taken);
    if share < 1.0 { root(share) } else { 1.0 }
}

/// What an update may move a position by, whatever the satellites, m.
fn steps(ratio: f64, own: &OwnVariances) -> Sigmas {
    own.taken.map(|taken| GROWTH * libm::sqrt(ratio * taken))
}

/// The separation of two filters: at once up to the least squares, and down as the filters forget; never
/// more than the correlated parts of both together.
fn separated(
    from: Sigmas,
    target: Sigmas,
    limit: Sigmas,
    whole: Option<&Subset>,
    ratio: f64,
    own: &OwnVariances,
) -> Sigmas {
    let steps = steps(ratio, own);
    core::array::from_fn(|axis| {
        let (from, target) = (from[axis], target[axis]);
        let moved = match whole {
            _ if target >= from => target,
            Some(_) => target + kept(own, axis) * (from - target),
            // Some satellites move both filters, not alike.
            None => from + steps[axis],
        };
        let moved = if moved < LEAST_SEPARATION_M {
            LEAST_SEPARATION_M
        } else {
            moved
        };
        if moved > limit[axis] {
            limit[axis]
        } else {
            moved
        }
    })
}

/// Square root of a variance that rounding may have made negative.
fn root(variance: f64) -> f64 {
    if variance < 0.0 {
        0.0
    } else {
        libm::sqrt(variance)
    }
}

fn sum(a: Sigmas, b: Sigmas) -> Sigmas {
    let ([a_h, a_v], [b_h, b_v]) = (a, b);
    [a_h + b_h, a_v + b_v]
}

fn maximum(a: Sigmas, b: Sigmas) -> Sigmas {
    let ([a_h, a_v], [b_h, b_v]) = (a, b);
    [
        if a_h > b_h { a_h } else { b_h },
        if a_v > b_v { a_v } else { b_v },
    ]
}

fn squares(sigmas: Sigmas) -> Variances {
    sigmas.map(|sigma| sigma * sigma)
}
