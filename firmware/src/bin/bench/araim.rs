//! What is measured of ARAIM: modes with their solutions, the levels on top, the tests of an epoch, and
//! beside them the peer, a new solution per subset.

use super::measure::{RUNS, Row, require};
use super::sky::Random;
use core::hint::black_box;
use static_cell::ConstStaticCell;
use surefix_core::raim::araim::{
    Araim, AraimConstellation, AraimParameters, AraimSatellite, MAX_ARAIM_SATELLITES, MAX_MODES,
};

/// Unknowns of the peer: position and two clocks at most.
const UNKNOWNS: usize = 5;

/// Satellites, constellations, modes, P_sat, P_const of the first constellation, P_THRES.
const ROWS: [(usize, usize, usize, f64, f64, f64); 4] = [
    (12, 1, 13, 1e-5, 0.0, 8e-8),
    (12, 1, 79, 1e-4, 0.0, 5e-9),
    (24, 2, 26, 1e-5, 1e-4, 8e-8),
    (24, 2, 301, 1e-4, 0.0, 5e-9),
];

static ARAIM: ConstStaticCell<Araim> = ConstStaticCell::new(Araim::EMPTY);
static PEER: ConstStaticCell<[[f64; 9]; MAX_MODES]> = ConstStaticCell::new([[0.0; 9]; MAX_MODES]);

/// Measures every row and prints it. The number of modes is in the name of the stage.
#[inline(never)]
pub fn all() {
    let (araim, peer) = (ARAIM.take(), PEER.take());
    let mut random = Random::new(7);
    for (n, clocks, modes, p_sat, p_const, p_threshold) in ROWS {
        let (mut solve, mut whole) = (Row::new(), Row::new());
        let (mut test, mut anew) = (Row::new(), Row::new());
        let parameters = AraimParameters {
            p_threshold,
            ..AraimParameters::LPV_200
        };
        let constellations = [p_const, 0.0].map(|p_fault| AraimConstellation {
            p_fault,
            exposure: 0.0,
        });
        for _ in 0..RUNS {
            let satellites = sky(&mut random, n, clocks, p_sat);
            let satellites = &satellites[..n];
            let constellations = &constellations[..clocks];
            let mut done = false;
            solve.run(|| {
                done = araim
                    .solve(black_box(satellites), constellations, &parameters)
                    .is_ok();
            });
            require(done && araim.subsets().len() == modes, "other modes");
            whole.run(|| {
                done = araim
                    .evaluate(black_box(satellites), constellations, &parameters)
                    .is_ok();
            });
            require(done, "no levels");
            let residual_m = [0.5; MAX_ARAIM_SATELLITES];
            test.run(|| {
                done = araim
                    .test(black_box(&residual_m[..n]), |_, enu| {
                        black_box(enu);
                    })
                    .is_ok();
            });
            require(done, "no test");
            let subsets = araim.subsets();
            anew.run(|| {
                let mut reference = [[0.0; MAX_ARAIM_SATELLITES]; 3];
                for (subset, result) in subsets.iter().zip(peer.iter_mut()) {
                    solve_anew(
                        black_box(satellites),
                        |i| subset.excluded.contains(i),
                        subset.excluded.is_empty(),
                        &mut reference,
                        result,
                    );
                }
            });
            for (subset, result) in subsets.iter().zip(peer.iter()) {
                let same = result
                    .iter()
                    .zip(
                        subset
                            .sigma_m
                            .iter()
                            .chain(&subset.sigma_separation_m)
                            .chain(&subset.bias_m),
                    )
                    .all(|(a, b)| (a - b).abs() < 1e-6 * (1.0 + b));
                require(same, "the peer finds another solution");
            }
        }
        let [a, b, c, d] = match modes {
            13 => [
                "araim13/solve",
                "araim13/evaluate",
                "araim13/test",
                "araim13/peer",
            ],
            79 => [
                "araim79/solve",
                "araim79/evaluate",
                "araim79/test",
                "araim79/peer",
            ],
            26 => [
                "araim26/solve",
                "araim26/evaluate",
                "araim26/test",
                "araim26/peer",
            ],
            _ => [
                "araim301/solve",
                "araim301/evaluate",
                "araim301/test",
                "araim301/peer",
            ],
        };
        let unknowns = Some(3 + clocks);
        solve.print(a, Some(n), unknowns);
        whole.print(b, Some(n), unknowns);
        test.print(c, Some(n), unknowns);
        anew.print(d, Some(n), unknowns);
    }
}

/// Satellites evenly around and irregularly high, of alternating constellations.
fn sky(
    random: &mut Random,
    n: usize,
    clocks: usize,
    p_fault: f64,
) -> [AraimSatellite; MAX_ARAIM_SATELLITES] {
    let mut satellites = [AraimSatellite::EMPTY; MAX_ARAIM_SATELLITES];
    for (i, satellite) in satellites.iter_mut().take(n).enumerate() {
        let azimuth = core::f64::consts::TAU * (i as f64 * 0.381_966 + 0.02 * random.normal());
        let sine = 0.1 + 0.88 * ((i as f64 + 0.5) / n as f64);
        let cosine = libm::sqrt(1.0 - sine * sine);
        let variance = 1.0 + 0.3 / sine;
        *satellite = AraimSatellite {
            design_enu: [
                -libm::sin(azimuth) * cosine,
                -libm::cos(azimuth) * cosine,
                -sine,
            ],
            constellation: i % clocks,
            variance_integrity_m2: variance,
            variance_accuracy_m2: 0.7 * variance,
            bias_integrity_m: 0.75,
            bias_accuracy_m: 0.0,
            p_fault,
            exposure: 0.0,
        };
    }
    satellites
}

/// σ, σ_ss and b of east, north, up of one subset from its own normal equations.
#[inline(never)]
#[allow(
    clippy::needless_range_loop,
    reason = "matrices are written by the formula's indices"
)]
fn solve_anew(
    satellites: &[AraimSatellite],
    is_excluded: impl Fn(usize) -> bool,
    is_whole: bool,
    reference: &mut [[f64; MAX_ARAIM_SATELLITES]; 3],
    result: &mut [f64; 9],
) {
    let row = |satellite: &AraimSatellite| {
        let [east, north, up] = satellite.design_enu;
        let mut row = [east, north, up, 0.0, 0.0];
        row[3 + (satellite.constellation & 1)] = 1.0;
        row
    };
    let mut normal = [[0.0; UNKNOWNS]; UNKNOWNS];
    for (i, satellite) in satellites.iter().enumerate() {
        if is_excluded(i) {
            continue;
        }
        let weight = 1.0 / satellite.variance_integrity_m2;
        let row = row(satellite);
        for a in 0..UNKNOWNS {
            for b in 0..=a {
                normal[a][b] += weight * row[a] * row[b];
            }
        }
    }
    // Cholesky; a clock that no satellite sees is taken out by a diagonal of one.
    for k in 3..UNKNOWNS {
        if normal[k][k] == 0.0 {
            normal[k][k] = 1.0;
        }
    }
    for k in 0..UNKNOWNS {
        for a in k..UNKNOWNS {
            let mut sum = normal[a][k];
            for b in 0..k {
                sum -= normal[a][b] * normal[k][b];
            }
            normal[a][k] = if a == k {
                libm::sqrt(sum)
            } else {
                sum / normal[k][k]
            };
        }
    }
    *result = [0.0; 9];
    for (i, satellite) in satellites.iter().enumerate() {
        let mut s = row(satellite);
        if is_excluded(i) {
            s = [0.0; UNKNOWNS];
        } else {
            for a in 0..UNKNOWNS {
                for b in 0..a {
                    s[a] -= normal[a][b] * s[b];
                }
                s[a] /= normal[a][a];
            }
            for a in (0..UNKNOWNS).rev() {
                for b in a + 1..UNKNOWNS {
                    s[a] -= normal[b][a] * s[b];
                }
                s[a] /= normal[a][a];
            }
        }
        for axis in 0..3 {
            let s = s[axis] / satellite.variance_integrity_m2;
            if is_whole {
                reference[axis][i] = s;
            }
            let separation = s - reference[axis][i];
            result[axis] += s * s * satellite.variance_integrity_m2;
            result[3 + axis] += separation * separation * satellite.variance_accuracy_m2;
            result[6 + axis] += s.abs() * satellite.bias_integrity_m;
        }
    }
    for value in &mut result[..6] {
        *value = libm::sqrt(*value);
    }
}
