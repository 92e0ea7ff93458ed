//! Levels where one row may hold an error that comes together with the fault of another.
//!
//! In: slopes of an epoch, the row that may be off, and by how much at the most. Out: the slope levels for one
//! faulty row beside it.
//!
//! | symbol | code      | unit | meaning                                                              |
//! |--------|-----------|------|----------------------------------------------------------------------|
//! | β      | `beta`    | 1    | largest error of row b over its sigma                                |
//! | S_bb   |           | 1    | its residual cofactor                                                |
//! | a_b    | leverage  | m    | shift of the position per sigma of it                                |
//!
//! Equations: with p = P_i f + P_b β' and abs(β') ≤ β a fault f of row i is missed with more than P_MD only while
//! abs(P_i f + P_b β') ≤ √λ, so √S_ii abs(f) ≤ √λ + √S_bb β, and the position is shifted by at most
//!
//! ```text
//! slope_i (√λ + √S_bb β) + |a_b| β
//! ```
//!
//! Derivation: docs/decisions/017-aids.md. It holds for a fault of row b itself, which β is then a part of.

use super::slope::{NoLevel, Sensitivity, SlopeLevels};

/// [`Sensitivity::levels`] where the error of `row` is up to `beta` of its sigmas beside one faulty row.
///
/// # Errors
/// [`NoLevel`], also where there is no such row.
pub fn levels(
    sensitivity: &Sensitivity,
    sqrt_noncentrality: f64,
    row: usize,
    beta: f64,
) -> Result<SlopeLevels, NoLevel> {
    let (Some(cofactor), Some([east, north, up])) = (
        sensitivity.residual_cofactor().get(row),
        sensitivity.leverage().get(row),
    ) else {
        return Err(NoLevel::Untestable { row });
    };
    // Rounding can leave a cofactor of nothing below nothing.
    let shown = libm::sqrt(if *cofactor < 0.0 { 0.0 } else { *cofactor });
    let mut levels = sensitivity.levels(sqrt_noncentrality + shown * beta)?;
    levels.hpl_m += beta * libm::sqrt(east * east + north * north);
    levels.vpl_m += beta * libm::fabs(*up);
    if levels.hpl_m.is_finite() && levels.vpl_m.is_finite() {
        Ok(levels)
    } else {
        Err(NoLevel::NotFinite)
    }
}
