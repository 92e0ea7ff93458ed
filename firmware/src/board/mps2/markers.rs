//! Two functions that do nothing, for what looks at the emulated processor from outside: a QEMU plugin
//! counts between them (`cargo xtask bench`).

use core::sync::atomic::{Ordering, compiler_fence};

/// The measured work starts after this call.
// SAFETY: no other symbol has the name.
#[unsafe(no_mangle)]
#[inline(never)]
pub extern "C" fn bench_begin() {
    compiler_fence(Ordering::SeqCst);
}

/// The measured work has ended before this call.
// SAFETY: no other symbol has the name.
#[unsafe(no_mangle)]
#[inline(never)]
pub extern "C" fn bench_end() {
    // Unlike `bench_begin`, so that the two are not folded into one.
    cortex_m::asm::nop();
}
