//! A recorded track of an antenna, made smooth: position and velocity at any instant.
//!
//! The velocities a u-blox receiver gives are means over the time since its last epoch: regressed
//! against the positions they lag by 0.128 s (drive) and 0.134 s (walk) at four epochs a second, half
//! an epoch. So a row says where the antenna was, z with one sigma s, and how far it had moved since
//! the row before, T v with one sigma `STEP_SIGMA_M`. Per axis of ECEF the places p minimise
//!
//! ```text
//! Σ ((p_k − z_k)/s_k)² + Σ ((p_k − p_{k−1} − T v_k)/σ)²
//! ```
//!
//! and a natural cubic spline runs through them, so that velocity and acceleration have no jumps.
//!
//! | symbol | code         | unit | meaning                              |
//! |--------|--------------|------|--------------------------------------|
//! | p      | `Knot::r_e`  | m    | place at a row                       |
//! | p''    | `Knot::a_e`  | m/s² | second derivative of the spline there |

use std::path::Path;

use anyhow::{Context, Result, anyhow, bail};
use nalgebra::Vector3;
use surefix_core::frames::geodesy;
use surefix_core::time::GpsTime;

use crate::truth::rtklib_rows;

/// One sigma of the way from row to row, m: 15 mm/s over a quarter of a second, what position
/// differences and velocities of the drive differ by once the lag is out.
const STEP_SIGMA_M: f64 = 0.004;

/// A row, smoothed.
#[derive(Clone, Copy, Debug)]
struct Knot {
    time: GpsTime,
    r_e: Vector3<f64>,
    a_e: Vector3<f64>,
}

/// A row as recorded.
struct Row {
    time: GpsTime,
    r_e: Vector3<f64>,
    sigma_m: f64,
    /// Since the row before.
    step_e: Vector3<f64>,
}

/// A smooth track.
#[derive(Clone, Debug)]
pub struct Track {
    knots: Vec<Knot>,
}

impl Track {
    /// Reads an RTKLIB `.pos` file with velocities. `geoid_m` is added to its heights: the height of
    /// the geoid where they are above mean sea level, else 0.
    ///
    /// # Errors
    /// When it cannot be read, has no velocities, or a gap of more than a second.
    pub fn read(path: &Path, geoid_m: f64) -> Result<Self> {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("cannot read the track {}", path.display()))?;
        Self::from_rtklib(&text, geoid_m).with_context(|| path.display().to_string())
    }

    fn from_rtklib(text: &str, geoid_m: f64) -> Result<Self> {
        if !text.starts_with('%') || !text.contains("vn(m/s)") {
            bail!("this is no RTKLIB .pos file with velocities: write it with out-outvel=on");
        }
        let lines = text.lines().filter(|line| !line.starts_with('%'));
        let mut rows: Vec<Row> = Vec::new();
        for ((ns, r_e_m), line) in rtklib_rows(text)?.into_iter().zip(lines) {
            // After time and place: quality, satellites, six deviations, age, ratio, velocity.
            let fields: Vec<f64> = line
                .split_whitespace()
                .skip(7)
                .map_while(|field| field.parse().ok())
                .collect();
            let &[north_m, east_m, up_m, _, _, _, _, _, north, east, up, ..] = fields.as_slice()
            else {
                bail!("\"{line}\" has no velocity");
            };
            let mut llh = geodesy::to_llh(&Vector3::from(r_e_m))
                .map_err(|_| anyhow!("\"{line}\" is no place"))?;
            llh.height_m += geoid_m;
            let time = GpsTime::from_ns(ns);
            let elapsed_s = rows
                .last()
                .map_or(0.0, |last| time.seconds_since(last.time));
            let follows = elapsed_s > 0.0 && elapsed_s <= 1.0;
            if !(follows || rows.is_empty()) {
                bail!("rows {elapsed_s} s apart: up to 1 s, and in order, they make a track");
            }
            let c_enu_e = geodesy::c_enu_e(llh.lat_rad, llh.lon_rad);
            let square = north_m * north_m + east_m * east_m + up_m * up_m;
            rows.push(Row {
                time,
                r_e: geodesy::to_ecef(&llh),
                sigma_m: libm::sqrt(square / 3.0),
                step_e: c_enu_e.transpose() * Vector3::new(east, north, up) * elapsed_s,
            });
        }
        if rows.len() < 3 || rows.iter().any(|row| !(row.sigma_m > 0.0)) {
            bail!("a track takes three rows, each with its deviations");
        }
        Ok(Self::through(&rows))
    }

    fn through(rows: &[Row]) -> Self {
        let n = rows.len();
        let origin = rows[0].r_e;
        let g = 1.0 / (STEP_SIGMA_M * STEP_SIGMA_M);
        let mut normal = Tridiagonal::zero(n);
        for (k, row) in rows.iter().enumerate() {
            let w = 1.0 / (row.sigma_m * row.sigma_m);
            normal.diagonal[k] += w;
            normal.right[k] += (row.r_e - origin) * w;
            if k > 0 {
                normal.diagonal[k] += g;
                normal.diagonal[k - 1] += g;
                normal.beside[k - 1] = -g;
                normal.right[k] += row.step_e * g;
                normal.right[k - 1] -= row.step_e * g;
            }
        }
        let places = normal.solve();

        let step_s = |k: usize| rows[k + 1].time.seconds_since(rows[k].time);
        let slope = |k: usize| (places[k + 1] - places[k]) / step_s(k);
        let mut spline = Tridiagonal::zero(n);
        spline.diagonal[0] = 1.0;
        spline.diagonal[n - 1] = 1.0;
        for k in 1..n - 1 {
            spline.diagonal[k] = (step_s(k - 1) + step_s(k)) / 3.0;
            spline.right[k] = slope(k) - slope(k - 1);
            // The ends are zero, so that their neighbours need no entry and the matrix is symmetric.
            if k + 1 < n - 1 {
                spline.beside[k] = step_s(k) / 6.0;
            }
        }
        let accelerations = spline.solve();
        let knots = rows
            .iter()
            .zip(places)
            .zip(accelerations)
            .map(|((row, place), a_e)| Knot {
                time: row.time,
                r_e: origin + place,
                a_e,
            })
            .collect();
        Self { knots }
    }

    /// The same at another time.
    pub fn moved(&self, by_ns: i64) -> Self {
        let mut moved = self.clone();
        for knot in &mut moved.knots {
            knot.time = knot.time.plus_ns(by_ns);
        }
        moved
    }

    /// Time of the first row.
    pub fn first(&self) -> GpsTime {
        self.knots[0].time
    }

    /// Time from the first row to the last, s.
    pub fn duration_s(&self) -> f64 {
        let last = &self.knots[self.knots.len() - 1];
        last.time.seconds_since(self.first())
    }

    /// Position, m, and velocity, m/s, ECEF, some seconds after a time; beyond the ends the outermost
    /// pieces go on.
    pub fn state(&self, time: GpsTime, after_s: f64) -> (Vector3<f64>, Vector3<f64>) {
        let after_s = after_s + time.seconds_since(self.first());
        let s_of = |knot: &Knot| knot.time.seconds_since(self.first());
        let next = self.knots.partition_point(|knot| s_of(knot) <= after_s);
        let next = next.clamp(1, self.knots.len() - 1);
        let (a, b) = (&self.knots[next - 1], &self.knots[next]);
        let h = s_of(b) - s_of(a);
        let (t, left) = (after_s - s_of(a), s_of(b) - after_s);
        let (slope_a, slope_b) = (a.r_e / h - a.a_e * (h / 6.0), b.r_e / h - b.a_e * (h / 6.0));
        let r_e = (a.a_e * (left * left * left) + b.a_e * (t * t * t)) / (6.0 * h)
            + slope_a * left
            + slope_b * t;
        let v_e = (b.a_e * (t * t) - a.a_e * (left * left)) / (2.0 * h) + (b.r_e - a.r_e) / h
            - (b.a_e - a.a_e) * (h / 6.0);
        (r_e, v_e)
    }
}

/// A symmetric tridiagonal system for three axes at once.
struct Tridiagonal {
    diagonal: Vec<f64>,
    beside: Vec<f64>,
    right: Vec<Vector3<f64>>,
}

impl Tridiagonal {
    fn zero(n: usize) -> Self {
        Self {
            diagonal: vec![0.0; n],
            beside: vec![0.0; n - 1],
            right: vec![Vector3::zeros(); n],
        }
    }

    /// By elimination; the systems here are positive definite.
    fn solve(mut self) -> Vec<Vector3<f64>> {
        let n = self.diagonal.len();
        for k in 1..n {
            let factor = self.beside[k - 1] / self.diagonal[k - 1];
            self.diagonal[k] -= factor * self.beside[k - 1];
            let above = self.right[k - 1];
            self.right[k] -= above * factor;
        }
        for k in (0..n).rev() {
            if k + 1 < n {
                let below = self.right[k + 1];
                self.right[k] -= below * self.beside[k];
            }
            self.right[k] /= self.diagonal[k];
        }
        self.right
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A turn of 20 s at 10 m/s, four rows a second, velocities as means over the time before.
    fn rows(noise: impl Fn(usize) -> f64) -> Vec<Row> {
        let place = |t: f64| {
            let angle = core::f64::consts::TAU * t / 20.0;
            let radius = 10.0 * 20.0 / core::f64::consts::TAU;
            Vector3::new(radius * angle.sin(), radius * angle.cos(), 5.0e6)
        };
        (0..81)
            .map(|k| {
                let t = k as f64 * 0.25;
                Row {
                    time: GpsTime::from_ns(k * 250_000_000),
                    r_e: place(t) + Vector3::new(noise(k as usize), 0.0, 0.0),
                    sigma_m: 0.01,
                    step_e: place(t) - place(t - 0.25),
                }
            })
            .collect()
    }

    #[test]
    fn a_turn_is_followed_between_the_rows() {
        let track = Track::through(&rows(|_| 0.0));
        for k in 12..148 {
            let t = f64::from(k) * 0.125;
            let angle = core::f64::consts::TAU * t / 20.0;
            let (r_e, v_e) = track.state(track.first(), t);
            let radius = 10.0 * 20.0 / core::f64::consts::TAU;
            let place = Vector3::new(radius * angle.sin(), radius * angle.cos(), 5.0e6);
            let velocity = Vector3::new(10.0 * angle.cos(), -10.0 * angle.sin(), 0.0);
            assert!((r_e - place).norm() < 1e-4, "{t}: {}", (r_e - place).norm());
            assert!(
                (v_e - velocity).norm() < 3e-3,
                "{t}: {}",
                (v_e - velocity).norm()
            );
        }
    }

    #[test]
    fn velocities_smooth_the_positions() {
        let track = Track::through(&rows(|k| if k % 2 == 0 { 0.01 } else { -0.01 }));
        for k in 8..72 {
            let t = f64::from(k) * 0.25;
            let (_, v_e) = track.state(track.first(), t);
            // Positions alone would err by 0.1 m/s and more.
            assert!((v_e.norm() - 10.0).abs() < 0.02, "{t}: {}", v_e.norm());
        }
    }

    #[test]
    fn a_file_without_velocities_is_refused() {
        let text = "%  GPST  latitude(deg) longitude(deg) height(m)\n2244 1.0 50.0 8.0 100.0 1\n";
        let error = Track::from_rtklib(text, 0.0).unwrap_err().to_string();
        assert!(error.contains("velocities"), "{error}");
    }
}
