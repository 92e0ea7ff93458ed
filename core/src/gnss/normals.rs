//! Normal equations of a position or velocity with one clock per constellation.
//!
//! Rows y = −u·x + b_k + error, weight w; u is the line of sight, k the row's clock.
//!
//! | symbol  | code       | shape  | meaning                                          |
//! |---------|------------|--------|--------------------------------------------------|
//! | A       | position   | 3 × 3  | Σ w u uᵀ                                         |
//! | c_k     | coupling   | 3      | −Σ w u over the rows of clock k                  |
//! | s_k     | weight     | 1      | Σ w over the rows of clock k                     |
//!
//! Each clock is eliminated by hand (it is in its own rows only), which leaves three equations; these
//! are solved by L D Lᵀ, without a square root. Why not a QR of the rows: the unknowns are few and of
//! one unit, a usable geometry has a condition number below 10³, and what rounding leaves after one
//! Newton step the next takes out. A third of the instructions of QR. Equations: [GOLUB-VANLOAN] 4.1.

use crate::consts::MAX_CLOCKS;

/// Sums over the rows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Normals {
    /// xx, xy, xz, yy, yz, zz.
    position: [f64; 6],
    position_right: [f64; 3],
    clocks: [ClockSums; MAX_CLOCKS],
}

#[derive(Clone, Copy, Debug)]
struct ClockSums {
    coupling: [f64; 3],
    weight: f64,
    right: f64,
}

/// What the rows say together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Estimate {
    /// x.
    pub position: [f64; 3],
    /// b_k of the clocks that have rows.
    pub clocks: [Option<f64>; MAX_CLOCKS],
}

/// Least pivot against the sum of weights. Reached at a dilution of precision of some thousands;
/// rounding leaves 10⁻¹⁵ of a direction the rows do not determine.
const LEAST_PIVOT: f64 = 1.0e-9;

impl Normals {
    pub const ZERO: Self = Self {
        position: [0.0; 6],
        position_right: [0.0; 3],
        clocks: [ClockSums {
            coupling: [0.0; 3],
            weight: 0.0,
            right: 0.0,
        }; MAX_CLOCKS],
    };

    /// Adds a row: line of sight, number of its clock, value, weight.
    pub fn add(&mut self, [ux, uy, uz]: [f64; 3], clock: usize, value: f64, weight: f64) {
        let Some(sums) = self.clocks.get_mut(clock) else {
            return;
        };
        let [wx, wy, wz] = [weight * ux, weight * uy, weight * uz];
        let [xx, xy, xz, yy, yz, zz] = &mut self.position;
        *xx += wx * ux;
        *xy += wx * uy;
        *xz += wx * uz;
        *yy += wy * uy;
        *yz += wy * uz;
        *zz += wz * uz;
        for ((right, coupling), weighted) in self
            .position_right
            .iter_mut()
            .zip(&mut sums.coupling)
            .zip([wx, wy, wz])
        {
            *right -= weighted * value;
            *coupling -= weighted;
        }
        sums.weight += weight;
        sums.right += weight * value;
    }

    /// Adds a row without a clock: value = direction·x + error.
    pub fn add_position(&mut self, [dx, dy, dz]: [f64; 3], value: f64, weight: f64) {
        let [wx, wy, wz] = [weight * dx, weight * dy, weight * dz];
        let [xx, xy, xz, yy, yz, zz] = &mut self.position;
        *xx += wx * dx;
        *xy += wx * dy;
        *xz += wx * dz;
        *yy += wy * dy;
        *yz += wy * dz;
        *zz += wz * dz;
        for (right, weighted) in self.position_right.iter_mut().zip([wx, wy, wz]) {
            *right += weighted * value;
        }
    }

    /// The weighted least-squares estimate, or `None` when the rows leave a direction undetermined.
    pub fn solve(&self) -> Option<Estimate> {
        let [mut xx, mut xy, mut xz, mut yy, mut yz, mut zz] = self.position;
        let [mut bx, mut by, mut bz] = self.position_right;
        let least = LEAST_PIVOT * (xx + yy + zz);
        for sums in &self.clocks {
            if sums.weight > 0.0 {
                let [cx, cy, cz] = sums.coupling;
                let inverse = 1.0 / sums.weight;
                let mean = sums.right * inverse;
                let (mx, my, mz) = (cx * inverse, cy * inverse, cz * inverse);
                xx -= mx * cx;
                xy -= mx * cy;
                xz -= mx * cz;
                yy -= my * cy;
                yz -= my * cz;
                zz -= mz * cz;
                bx -= cx * mean;
                by -= cy * mean;
                bz -= cz * mean;
            }
        }
        // L D Lᵀ; written so that NaN refuses.
        let (lyx, lzx) = (xy / xx, xz / xx);
        let dy = yy - lyx * xy;
        let below = yz - lzx * xy;
        let lzy = below / dy;
        let dz = zz - lzx * xz - lzy * below;
        if !(xx > least && dy > least && dz > least) {
            return None;
        }
        let vy = by - lyx * bx;
        let vz = bz - lzx * bx - lzy * vy;
        let z = vz / dz;
        let y = vy / dy - lzy * z;
        let x = bx / xx - lyx * y - lzx * z;
        if !(x.is_finite() && y.is_finite() && z.is_finite()) {
            return None;
        }
        Some(Estimate {
            position: [x, y, z],
            clocks: self.clocks.map(|sums| {
                let [cx, cy, cz] = sums.coupling;
                (sums.weight > 0.0).then(|| (sums.right - cx * x - cy * y - cz * z) / sums.weight)
            }),
        })
    }

    /// By how much an estimate of these rows reduces their sum of weighted squares.
    pub fn explained(&self, estimate: &Estimate) -> f64 {
        let position = estimate.position.iter().zip(&self.position_right);
        let clocks = estimate.clocks.iter().flatten();
        let of_clocks = clocks.zip(self.clocks.iter().filter(|sums| sums.weight > 0.0));
        position.map(|(x, right)| x * right).sum::<f64>()
            + of_clocks.map(|(b, sums)| b * sums.right).sum::<f64>()
    }

    /// Covariance of the position, or the velocity, in the units of the weights: the solutions for unit
    /// right-hand sides. `None` as with [`Normals::solve`].
    pub fn covariance(&self) -> Option<[[f64; 3]; 3]> {
        let mut unit = *self;
        for sums in &mut unit.clocks {
            sums.right = 0.0;
        }
        let mut columns = [[0.0; 3]; 3];
        for (axis, column) in columns.iter_mut().enumerate() {
            unit.position_right = [0.0; 3];
            if let Some(right) = unit.position_right.get_mut(axis) {
                *right = 1.0;
            }
            *column = unit.solve()?.position;
        }
        Some(columns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DIRECTIONS: [([f64; 3], usize); 7] = [
        ([0.6, 0.0, 0.8], 0),
        ([-0.6, 0.0, 0.8], 0),
        ([0.0, 0.8, 0.6], 0),
        ([0.0, -0.8, 0.6], 2),
        ([0.48, 0.64, 0.6], 2),
        ([0.0, 0.0, 1.0], 2),
        ([0.28, -0.96, 0.0], 0),
    ];

    fn row_value(u: [f64; 3], clock: usize, x: [f64; 3], b: [f64; 3]) -> f64 {
        b[clock] - u[0] * x[0] - u[1] * x[1] - u[2] * x[2]
    }

    #[test]
    fn rows_without_error_give_back_what_made_them() {
        let (x, b) = ([120.0, -33.0, 7.5], [3.0e5, 0.0, 2.9e5]);
        let mut normals = Normals::ZERO;
        for (step, (u, clock)) in DIRECTIONS.into_iter().enumerate() {
            normals.add(u, clock, row_value(u, clock, x, b), 1.0 + step as f64);
        }
        let estimate = normals.solve().unwrap();
        for (found, put_in) in estimate.position.iter().zip(x) {
            assert!((found - put_in).abs() < 1e-8);
        }
        assert!((estimate.clocks[0].unwrap() - b[0]).abs() < 1e-8);
        let values = DIRECTIONS.into_iter().enumerate();
        let sum_of_squares: f64 = values
            .map(|(step, (u, clock))| {
                let value = row_value(u, clock, x, b);
                (1.0 + step as f64) * value * value
            })
            .sum();
        let left = sum_of_squares - normals.explained(&estimate);
        assert!(left.abs() < 1e-14 * sum_of_squares, "{left}");
        assert_eq!(estimate.clocks[1], None);
        assert!((estimate.clocks[2].unwrap() - b[2]).abs() < 1e-8);
    }

    #[test]
    fn a_height_takes_the_place_of_a_satellite() {
        let (x, b) = ([120.0, -33.0, 7.5], [3.0e5, 0.0, 0.0]);
        let mut normals = Normals::ZERO;
        for (u, _) in DIRECTIONS.into_iter().take(3) {
            normals.add(u, 0, row_value(u, 0, x, b), 1.0);
        }
        assert_eq!(normals.solve(), None);
        normals.add_position([0.0, 0.0, 1.0], x[2], 0.5);
        let estimate = normals.solve().unwrap();
        for (found, put_in) in estimate.position.iter().zip(x) {
            assert!((found - put_in).abs() < 1e-8);
        }
        assert!((estimate.clocks[0].unwrap() - b[0]).abs() < 1e-8);
    }

    #[test]
    fn the_estimate_minimises_the_weighted_squares() {
        let mut normals = Normals::ZERO;
        let values = [1.0, -2.0, 0.5, 3.0, -1.0, 0.25, 2.0];
        let rows = || {
            DIRECTIONS
                .into_iter()
                .zip(values)
                .zip([1.0, 0.2, 3.0, 1.0, 0.5, 2.0, 1.0])
        };
        for (((u, clock), value), weight) in rows() {
            normals.add(u, clock, value, weight);
        }
        let best = normals.solve().unwrap();
        // The gradient of the squares vanishes at the minimum.
        let mut gradient = [0.0; 6];
        let b = best.clocks.map(|clock| clock.unwrap_or(0.0));
        for (((u, clock), value), weight) in rows() {
            let residual = weight * (value - row_value(u, clock, best.position, b));
            for axis in 0..3 {
                gradient[axis] += residual * u[axis];
            }
            gradient[3 + clock] += residual;
        }
        assert!(
            gradient.iter().all(|slope| slope.abs() < 1e-12),
            "{gradient:?}"
        );
    }

    #[test]
    fn directions_that_leave_one_undetermined_are_refused() {
        let mut normals = Normals::ZERO;
        for _ in 0..8 {
            normals.add([0.6, 0.0, 0.8], 0, 1.0, 1.0);
        }
        assert_eq!(normals.solve(), None);
        // All on one cone around the zenith: up and the clock cannot be told apart.
        let mut normals = Normals::ZERO;
        for step in 0..8 {
            let azimuth = f64::from(step);
            normals.add([0.6 * azimuth.sin(), 0.6 * azimuth.cos(), 0.8], 0, 1.0, 1.0);
        }
        assert_eq!(normals.solve(), None);
        normals.add([f64::NAN, 0.0, 1.0], 0, 1.0, 1.0);
        assert_eq!(normals.solve(), None);
        assert_eq!(Normals::ZERO.solve(), None);
    }
}
