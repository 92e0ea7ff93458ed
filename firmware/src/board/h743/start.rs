//! What must be right before the first Rust statement.

use core::arch::global_asm;

// cortex-m-rt calls `__pre_init` after reset, before it fills .data and .bss. The section's bounds are
// multiples of 8 (board-memory.x).
global_asm!(
    ".section .text.__pre_init, \"ax\"",
    ".global __pre_init",
    ".type __pre_init,%function",
    ".thumb_func",
    "__pre_init:",
    "    ldr r0, =__saxisram",
    "    ldr r1, =__eaxisram",
    "    ldr r2, =__siaxisram",
    "0:  cmp r0, r1",
    "    beq 1f",
    "    ldm r2!, {{r3}}",
    "    stm r0!, {{r3}}",
    "    b 0b",
    "1:  bx lr",
    ".size __pre_init, . - __pre_init",
    ".pool",
);
