//! What must be right before the first Rust statement: the memories that cortex-m-rt does not know.

use core::arch::global_asm;

// cortex-m-rt calls `__pre_init` after reset, before it fills .data and .bss. The sections' bounds are
// multiples of 8 (board-memory.x).
//
// SRAM1 to SRAM3 of domain D2 have no clock after reset; bits 29 to 31 of RCC_AHB2ENR give them one and
// keep the domain awake with the CPU. The clock runs by the time the register has been read back.
// RM0433 8.5.10, 8.5.11, RCC_AHB2ENR in 8.7.
global_asm!(
    ".section .text.__pre_init, \"ax\"",
    ".global __pre_init",
    ".type __pre_init,%function",
    ".thumb_func",
    "__pre_init:",
    "    ldr r0, =0x580244DC",
    "    ldr r1, [r0]",
    "    orr r1, r1, #0xE0000000",
    "    str r1, [r0]",
    "    ldr r1, [r0]",
    "    dsb",
    "    ldr r0, =__sd2sram",
    "    ldr r1, =__ed2sram",
    "    ldr r2, =__sid2sram",
    "0:  cmp r0, r1",
    "    beq 1f",
    "    ldm r2!, {{r3}}",
    "    stm r0!, {{r3}}",
    "    b 0b",
    "1:  ldr r0, =__saxisram",
    "    ldr r1, =__eaxisram",
    "    movs r2, #0",
    "2:  cmp r0, r1",
    "    beq 3f",
    "    stm r0!, {{r2}}",
    "    b 2b",
    "3:  bx lr",
    ".size __pre_init, . - __pre_init",
    ".pool",
);
