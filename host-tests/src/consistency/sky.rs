//! Satellites on circular orbits: six planes of five, as high as GPS.

use nalgebra::Vector3;

use crate::reference::earth::{MU, OMEGA};

/// Radius of the orbits, m.
const RADIUS_M: f64 = 26_560_000.0;
/// Their inclination, rad.
const INCLINATION_RAD: f64 = 0.96;
/// Planes, and satellites in each.
const PLANES: (usize, usize) = (6, 5);

/// A satellite as a receiver at a place sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Number, from 1.
    pub number: u8,
    /// Position, ECEF, m.
    pub r: Vector3<f64>,
    /// Velocity against the Earth, m/s.
    pub v: Vector3<f64>,
    /// Sine of the elevation above the geocentric horizon, 1.
    pub sine: f64,
}

/// Which of them a receiver sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    /// Sine of the elevation mask.
    pub mask_sine: f64,
    /// Most satellites: the first by number.
    pub most: usize,
}

impl Sky {
    /// All above 5°.
    pub const OPEN: Self = Self {
        mask_sine: 0.087,
        most: usize::MAX,
    };

    /// The satellites seen from `r` at a time.
    pub fn seen(&self, t_s: f64, r: &Vector3<f64>) -> Vec<Seen> {
        let (planes, each) = PLANES;
        let numbers = (0..planes).flat_map(|plane| (0..each).map(move |place| (plane, place)));
        numbers
            .map(|(plane, place)| satellite(t_s, plane, place))
            .map(|(number, at, v)| Seen {
                number,
                r: at,
                v,
                sine: (at - r).normalize().dot(&r.normalize()),
            })
            .filter(|seen| seen.sine > self.mask_sine)
            .take(self.most)
            .collect()
    }
}

fn satellite(t_s: f64, plane: usize, place: usize) -> (u8, Vector3<f64>, Vector3<f64>) {
    let (planes, each) = PLANES;
    let turn = std::f64::consts::TAU;
    let rate = (MU / RADIUS_M.powi(3)).sqrt();
    let (sine, cosine) =
        (turn * (place as f64 / each as f64 + plane as f64 / 15.0) + rate * t_s).sin_cos();
    let (sn, cn) = (turn * plane as f64 / planes as f64 - OMEGA * t_s).sin_cos();
    let (si, ci) = INCLINATION_RAD.sin_cos();
    let into_earth =
        |x: f64, y: f64| Vector3::new(x * cn - y * ci * sn, x * sn + y * ci * cn, y * si);
    let r = into_earth(RADIUS_M * cosine, RADIUS_M * sine);
    let v = into_earth(-RADIUS_M * rate * sine, RADIUS_M * rate * cosine)
        - Vector3::new(0.0, 0.0, OMEGA).cross(&r);
    ((plane * each + place + 1) as u8, r, v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn velocities_are_the_change_of_positions() {
        let place = Vector3::new(3_000_000.0, 3_860_000.0, 4_080_000.0);
        let (before, after) = (
            Sky::OPEN.seen(999.5, &place),
            Sky::OPEN.seen(1000.5, &place),
        );
        let now = Sky::OPEN.seen(1000.0, &place);
        assert!(now.len() >= 7);
        for ((before, after), now) in before.iter().zip(&after).zip(&now) {
            assert!((after.r - before.r - now.v).norm() < 1e-3);
        }
    }
}
