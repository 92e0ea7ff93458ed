//! Memory that nothing may write: region 0 of the MPU over all code addresses, 0 to 0x1FFF_FFFF.
//!
//! On both boards the stack is the lowest memory above them, so that an overflow is a write into the
//! region: a fault at once, by whatever runs on that stack, interrupts included. On silicon the
//! addresses below the stack answer no access anyway. QEMU lets such accesses pass on its mps2 boards
//! (writes vanish, reads give 0): unprotected, a stack that overflowed ran on down to the mirror of the
//! code memory at 0x0040_0000 and wrote over the program, its fault handlers first.
//!
//! Source: ARM DDI 0403 (ARMv7-M) B3.5.

use cortex_m::peripheral::MPU;

/// Base 0, taken as that of region 0.
const REGION_0_AT_0: u32 = 1 << 4;
/// Privileged and unprivileged code may read.
const READ_ONLY: u32 = 0b110 << 24;
/// Normal memory, write-through: what these addresses are without an MPU.
const NORMAL_WRITE_THROUGH: u32 = 1 << 17;
/// 2^(28 + 1) bytes.
const HALF_GIGABYTE: u32 = 28 << 1;
const ENABLE: u32 = 1 << 0;
/// Everywhere else the default memory map holds.
const DEFAULT_ELSEWHERE: u32 = 1 << 2;

/// Starts the protection. Handlers of HardFault and NMI are not subject to it.
pub(super) fn start(mpu: &mut MPU) {
    // SAFETY: nothing writes to code addresses, and reading and executing there stay as they were.
    unsafe {
        mpu.rbar.write(REGION_0_AT_0);
        mpu.rasr
            .write(READ_ONLY | NORMAL_WRITE_THROUGH | HALF_GIGABYTE | ENABLE);
        mpu.ctrl.write(DEFAULT_ELSEWHERE | ENABLE);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}
