//! Roll, pitch and heading of a vehicle that moves where it points, from its course over ground.
//!
//! In: mean specific force in body axes and by the receiver, over a window. Out: roll and pitch.
//!
//! | symbol | code          | shape | unit | frame | meaning                                          |
//! |--------|---------------|-------|------|-------|--------------------------------------------------|
//! | f      | `force_b`     | 3     | m/s² | b     | mean specific force of the window, in the body axes of its end |
//! | f      | `force_h`     | 3     | m/s² | h     | the same by the receiver: v̇ + 2ω×v − g           |
//! | h      |               |       |      |       | forward (along the course), right, down; level   |
//! | φ, θ, ψ| `roll`, `pitch`, `heading` | | rad |   | ψ is the course over ground                      |
//!
//! With ψ known, f_b = C_1(φ) C_2(θ) f_h has two unknowns: its first row gives θ, the other two give φ.
//! Standing still this is levelling, [GROVES-2013] chapter 5; the accelerated form is derived here. Keys:
//! docs/references.md.
//! Assumes: the vehicle moves where it points, but for the side-slip that is configured.

use super::NotAligned;
use nalgebra::Vector3;

/// The two specific forces may differ in length by this, m/s²: a tenth of gravity.
pub(super) const MAX_FORCE_DIFFERENCE_MPS2: f64 = 1.0;

/// Roll and pitch that take `force_h` (level axes along the heading) to `force_b`, rad.
pub(super) fn roll_and_pitch(
    force_b: &Vector3<f64>,
    force_h: &Vector3<f64>,
) -> Result<[f64; 2], NotAligned> {
    let difference_mps2 = force_b.norm() - force_h.norm();
    if !(libm::fabs(difference_mps2) <= MAX_FORCE_DIFFERENCE_MPS2) {
        return Err(NotAligned::ForceMismatch { difference_mps2 });
    }
    // f_b,x = f_h,x cos θ − f_h,z sin θ = R sin(θ + α).
    let in_plane = libm::sqrt(force_h.x * force_h.x + force_h.z * force_h.z);
    let sine = force_b.x / in_plane;
    // Noise may make it a little longer than the whole: nose up or down then.
    let sine = if sine > 1.0 {
        1.0
    } else if sine < -1.0 {
        -1.0
    } else {
        sine
    };
    let pitch = libm::asin(sine) - libm::atan2(force_h.x, -force_h.z);
    let (sin_pitch, cos_pitch) = libm::sincos(pitch);
    let down = force_h.x * sin_pitch + force_h.z * cos_pitch;
    let roll = libm::atan2(down, force_h.y) - libm::atan2(force_b.z, force_b.y);
    Ok([roll, pitch])
}
