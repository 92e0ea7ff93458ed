//! Executed instructions and stack per stage, on the emulated board, for `cargo xtask bench`.
//!
//! QEMU runs with `-icount shift=6,sleep=off`: 64 ns of the board's time per instruction, so its
//! 25 MHz timer counts instructions exactly, the same in every run. Each row is the median and the
//! worst of several skies, one line over semihosting, `-` where there is nothing:
//!
//! `row stage n_sats n_states filters instr_median instr_worst stack_b ram_b pass`
//!
//! and `end` at last. `n_states` is the number of unknowns, three of position and one per constellation; `pass` counts
//! the measured pieces of work from 0 over all rows and names the median one.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod araim;
#[cfg(target_os = "none")]
mod bank;
#[cfg(target_os = "none")]
mod consensus;
#[cfg(target_os = "none")]
mod dense;
#[cfg(target_os = "none")]
mod dense_bank;
#[cfg(target_os = "none")]
mod filter;
#[cfg(target_os = "none")]
mod inertial;
#[cfg(target_os = "none")]
mod measure;
#[cfg(target_os = "none")]
mod messages;
#[cfg(target_os = "none")]
mod monitors;
#[cfg(target_os = "none")]
mod output;
#[cfg(target_os = "none")]
mod risk;
#[cfg(target_os = "none")]
mod robust;
#[cfg(target_os = "none")]
mod sensors;
#[cfg(target_os = "none")]
mod separation;
#[cfg(target_os = "none")]
mod sky;
#[cfg(target_os = "none")]
mod stages;
#[cfg(target_os = "none")]
mod subframes;

#[cfg(not(target_os = "none"))]
fn main() {}

#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    use cortex_m_semihosting::{debug, hprintln};

    hprintln!("executed instructions, and bytes of stack");
    surefix_firmware::board::start();
    stages::all();
    output::all();
    inertial::all();
    let transition = filter::all();
    bank::all(transition);
    araim::all();
    sensors::all();
    robust::all();
    monitors::all();
    separation::all();
    consensus::all();
    hprintln!("end");
    loop {
        debug::exit(debug::EXIT_SUCCESS);
    }
}
