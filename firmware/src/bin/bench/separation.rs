//! What is measured of vertical levels by solution separation, and of the dilution of precision of four
//! satellites in closed form, beside an inverse of their matrix.

use super::measure::{RUNS, Row, require};
use super::robust::SKIES;
use super::sky::{Random, direction, model};
use core::hint::black_box;
use nalgebra::{Matrix4, Vector4};
use static_cell::ConstStaticCell;
use surefix_core::linalg::LinearModel;
use surefix_core::raim::gdop4;
use surefix_core::raim::monitors::vpl_mhss::VplConfig;
use surefix_core::raim::vpl_mhss::VplSeparation;

/// On the first row, m.
const FAULT_M: f64 = 100.0;

static MODEL: ConstStaticCell<LinearModel> = ConstStaticCell::new(LinearModel::EMPTY);
static SEPARATION: ConstStaticCell<VplSeparation> = ConstStaticCell::new(VplSeparation::EMPTY);

/// Measures every row and prints it.
#[inline(never)]
pub fn all() {
    let mut random = Random::new(21);
    four_satellites(&mut random);
    let (rows, separation) = (MODEL.take(), SEPARATION.take());
    let VplConfig {
        p_level,
        p_false_alarm,
    } = VplConfig::PRESET;
    let configured = separation.configure(p_level, p_false_alarm);
    require(configured.is_ok(), "no factors");
    for (n, clocks) in SKIES {
        let (mut healthy, mut faulted) = (Row::new(), Row::new());
        for _ in 0..RUNS {
            model(&mut random, n, clocks, rows);
            healthy.run(|| {
                black_box(bounded(black_box(rows), separation));
            });
            if let Some(residual_m) = rows.residual_m.first_mut() {
                *residual_m += FAULT_M;
            }
            faulted.run(|| {
                black_box(bounded(black_box(rows), separation));
            });
        }
        let unknowns = Some(3 + clocks);
        healthy.print("vpl_mhss/healthy", Some(n), unknowns);
        faulted.print("vpl_mhss/fault", Some(n), unknowns);
    }
}

/// Horizontal level of what is left, after the test; `None` where there is no test.
#[inline(never)]
fn bounded(model: &LinearModel, separation: &mut VplSeparation) -> Option<f64> {
    let test = separation.test(model).ok()?;
    Some(separation.hpl_m(test.excluded()))
}

fn four_satellites(random: &mut Random) {
    let mut closed = Row::new();
    let mut of_pairs = Row::new();
    let mut inverse = Row::new();
    for _ in 0..RUNS {
        let directions = [(); 4].map(|()| direction(random));
        closed.run(|| {
            black_box(closed_form(black_box(&directions)));
        });
        let [a, b, c, d] = &directions;
        let pairs = [(a, b), (a, c), (a, d), (b, c), (b, d), (c, d)]
            .map(|(first, second)| gdop4::pair_product(first, second));
        of_pairs.run(|| {
            black_box(from_pairs(black_box(&pairs)));
        });
        inverse.run(|| {
            black_box(by_inverse(black_box(&directions)));
        });
    }
    closed.print("gdop/closed", Some(4), Some(4));
    of_pairs.print("gdop/squared_of_pairs", Some(4), Some(4));
    inverse.print("gdop/inverse", Some(4), Some(4));
}

#[inline(never)]
fn closed_form(directions: &[[f64; 3]; 4]) -> Option<f64> {
    gdop4::gdop(directions).ok()
}

#[inline(never)]
fn from_pairs(pairs: &[f64; 6]) -> Option<f64> {
    gdop4::gdop_squared(pairs).ok()
}

/// The textbook's way: the root of the trace of (HᵀH)⁻¹.
#[inline(never)]
fn by_inverse(directions: &[[f64; 3]; 4]) -> Option<f64> {
    let mut normals = Matrix4::zeros();
    for [east, north, up] in directions {
        let row = Vector4::new(*east, *north, *up, 1.0);
        normals += row * row.transpose();
    }
    let inverted = invert(&mut normals);
    inverted.then(|| libm::sqrt(normals.trace()))
}

/// All of the inverse: on its own, so that the compiler does not drop what the trace does not need.
#[inline(never)]
fn invert(matrix: &mut Matrix4<f64>) -> bool {
    matrix.try_inverse_mut()
}
