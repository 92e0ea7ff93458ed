//! How deep the stack has been: cortex-m-rt paints it before `main`.

use core::ptr::{addr_of, read_volatile, write_volatile};
use cortex_m_rt::STACK_PAINT_VALUE;

unsafe extern "C" {
    static _stack_start: u32;
    static _stack_end: u32;
}

/// Bytes between the stack's start and the deepest word that no longer holds the paint.
pub fn peak_bytes() -> usize {
    let (mut word, start) = (addr_of!(_stack_end), addr_of!(_stack_start));
    // SAFETY: both symbols bound the stack region of the linker script, and reading painted or used
    // stack words disturbs nothing.
    while word < start && unsafe { read_volatile(word) } == STACK_PAINT_VALUE {
        word = word.wrapping_add(1);
    }
    start as usize - word as usize
}

/// Bytes of stack that `work` uses below its caller.
#[inline(never)]
pub fn bytes_used_by(work: impl FnOnce()) -> usize {
    let here = cortex_m::register::msp::read() as usize;
    let mut word = addr_of!(_stack_end).cast_mut();
    // A margin for the frames of this function and of what it calls before `work`.
    while (word as usize) < here - 256 {
        // SAFETY: the words lie in the stack region, below everything in use.
        unsafe { write_volatile(word, STACK_PAINT_VALUE) };
        word = word.wrapping_add(1);
    }
    work();
    here.saturating_sub(addr_of!(_stack_start) as usize - peak_bytes())
}
