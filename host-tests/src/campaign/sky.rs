//! Which satellites a trial uses, and which of them is the hardest to test.
//!
//! | symbol | code | meaning |
//! |---|---|---|
//! | GDOP | [`gdop`] | root of the trace of (GᵀG)⁻¹, rows of G: unit vectors east, north, up and 1 |
//! | slope | [`hardest`] | horizontal shift per bias, over how many sigmas of its residual the bias is: √(S_E² + S_N²) σ/√(1 − H_ii), weighted least squares |
//!
//! [P0] 2.3 takes the six satellites of the largest GDOP "that meet the requirements" and puts the
//! fault on the satellite that is hardest to test. Here the requirement is that any five of the six still
//! have a GDOP of [`MAX_GDOP_OF_FIVE`]; with nothing required the worst six can be on one cone with
//! any GDOP. Slopes: [BROWN-1992].

use nalgebra::{Matrix4, Vector4};
use surefix_core::gnss::Satellite;

use super::flown::{Seen, TrueEpoch};

/// Largest GDOP of five of six satellites; 17 in the reference scenarios `seed000`.
pub const MAX_GDOP_OF_FIVE: f64 = 20.0;

/// Line of sight east, north, up, and 1 for the clock; one sigma of the pseudorange.
type Line = (Satellite, Vector4<f64>, f64);

fn lines(epoch: &TrueEpoch, of: &[Satellite]) -> Vec<Line> {
    let c_n_e = epoch.state.c_e_n.transpose();
    let line = |seen: &Seen| {
        let m = &seen.measurement;
        let [north, east, down] =
            (c_n_e * (nalgebra::Vector3::from(m.r_es_e_m) - epoch.state.r_eb_e).normalize()).into();
        let row = Vector4::new(east, north, -down, 1.0);
        (m.satellite, row, m.sigma_pseudorange_m)
    };
    epoch
        .seen
        .iter()
        .filter(|seen| of.contains(&seen.measurement.satellite))
        .map(line)
        .collect()
}

fn inverse_of_normals<'a>(
    rows: impl Iterator<Item = (&'a Vector4<f64>, f64)>,
) -> Option<Matrix4<f64>> {
    let normals = rows.fold(Matrix4::zeros(), |sum, (row, weight)| {
        sum + row * row.transpose() * weight
    });
    normals.cholesky().map(|factors| factors.inverse())
}

fn gdop_of<'a>(rows: impl Iterator<Item = &'a Line>) -> f64 {
    let rows = rows.map(|(_, row, _)| (row, 1.0));
    inverse_of_normals(rows).map_or(f64::INFINITY, |q| libm::sqrt(q.trace()))
}

/// GDOP of some satellites; infinite where they do not give a position.
pub fn gdop(epoch: &TrueEpoch, of: &[Satellite]) -> f64 {
    gdop_of(lines(epoch, of).iter())
}

/// The six of the largest GDOP of which any five have at most [`MAX_GDOP_OF_FIVE`], in order of name.
pub fn worst_six(epoch: &TrueEpoch, candidates: &[Satellite]) -> Option<Vec<Satellite>> {
    let lines = lines(epoch, candidates);
    let mut worst: Option<(f64, Vec<Satellite>)> = None;
    let mut chosen = Vec::with_capacity(6);
    each_six(&lines, &mut chosen, &mut |six| {
        let gdop = gdop_of(six.iter().copied());
        if worst.as_ref().is_some_and(|(largest, _)| gdop <= *largest) {
            return;
        }
        let is_testable = (0..six.len()).all(|left_out| {
            let five = six.iter().enumerate().filter(|(k, _)| *k != left_out);
            gdop_of(five.map(|(_, line)| *line)) <= MAX_GDOP_OF_FIVE
        });
        if is_testable {
            worst = Some((gdop, six.iter().map(|line| line.0).collect()));
        }
    });
    worst.map(|(_, six)| six)
}

fn each_six<'a>(lines: &'a [Line], chosen: &mut Vec<&'a Line>, each: &mut dyn FnMut(&[&Line])) {
    if chosen.len() == 6 {
        each(chosen);
        return;
    }
    for (at, line) in lines.iter().enumerate() {
        chosen.push(line);
        each_six(&lines[at + 1..], chosen, each);
        chosen.pop();
    }
}

/// The satellite with the largest horizontal slope.
pub fn hardest(epoch: &TrueEpoch, of: &[Satellite]) -> Option<Satellite> {
    let lines = lines(epoch, of);
    let weighted = lines.iter().map(|(_, row, s)| (row, 1.0 / (s * s)));
    let q = inverse_of_normals(weighted)?;
    let slope = |(_, row, sigma): &Line| {
        let shift = q * row / (sigma * sigma);
        let seen = 1.0 - row.dot(&shift);
        libm::hypot(shift.x, shift.y) * sigma / libm::sqrt(seen)
    };
    let hardest = lines.iter().max_by(|a, b| slope(a).total_cmp(&slope(b)));
    hardest.map(|line| line.0)
}

/// `most` of the candidates, spread over the sky: the highest, then always the one farthest from all
/// before. In order of name.
pub fn spread(epoch: &TrueEpoch, candidates: &[Satellite], most: usize) -> Vec<Satellite> {
    let mut left = lines(epoch, candidates);
    let mut chosen: Vec<Line> = Vec::new();
    let cosine = |a: &Line, b: &Line| a.1.xyz().dot(&b.1.xyz());
    while chosen.len() < most && !left.is_empty() {
        let nearness = |line: &Line| {
            if chosen.is_empty() {
                -line.1.z
            } else {
                chosen.iter().map(|c| cosine(c, line)).fold(-1.0, f64::max)
            }
        };
        let best =
            (0..left.len()).min_by(|a, b| nearness(&left[*a]).total_cmp(&nearness(&left[*b])));
        chosen.push(left.remove(best.unwrap_or(0)));
    }
    let mut names: Vec<Satellite> = chosen.into_iter().map(|line| line.0).collect();
    names.sort_by_key(|satellite| satellite.index());
    names
}
