//! Calls with arguments and results the optimiser cannot see through.

use core::hint::black_box;

/// Calls a function of one argument.
pub fn call1<A, R>(function: impl FnOnce(A) -> R, a: A) {
    black_box(function(black_box(a)));
}

/// Calls a function of two arguments.
pub fn call2<A, B, R>(function: impl FnOnce(A, B) -> R, a: A, b: B) {
    black_box(function(black_box(a), black_box(b)));
}

/// Calls a function of three arguments.
pub fn call3<A, B, C, R>(function: impl FnOnce(A, B, C) -> R, a: A, b: B, c: C) {
    black_box(function(black_box(a), black_box(b), black_box(c)));
}

/// Calls a function of four arguments.
pub fn call4<A, B, C, D, R>(function: impl FnOnce(A, B, C, D) -> R, a: A, b: B, c: C, d: D) {
    black_box(function(
        black_box(a),
        black_box(b),
        black_box(c),
        black_box(d),
    ));
}
