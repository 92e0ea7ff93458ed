//! An image that links only when no panic is reachable from any public function of surefix-core, nor from
//! the drivers of sensors.
//!
//! Its panic handler (`fault.rs`, feature `no-panic`) calls a function that exists nowhere. Each
//! module here calls the entries of a part of core with arguments the optimiser cannot see through;
//! `host-tests/tests/no_panic_entries.rs` fails when an entry is missing. The image is linked, never
//! run. With the feature `no-panic-control` one deliberate panic is added: that must not link.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod aids;
#[cfg(target_os = "none")]
mod araim;
#[cfg(target_os = "none")]
mod call;
#[cfg(target_os = "none")]
mod drivers;
#[cfg(target_os = "none")]
mod ekf;
#[cfg(target_os = "none")]
mod facade;
#[cfg(target_os = "none")]
mod gnss;
#[cfg(target_os = "none")]
mod ins;
#[cfg(target_os = "none")]
mod integrity;
#[cfg(target_os = "none")]
mod mhss;
#[cfg(target_os = "none")]
mod monitors;
#[cfg(target_os = "none")]
mod numbers;
#[cfg(target_os = "none")]
mod raim;
#[cfg(target_os = "none")]
mod wire;

#[cfg(not(target_os = "none"))]
fn main() {}

#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    use surefix_firmware as _; // the panic handler and the vectors

    numbers::all();
    wire::all();
    gnss::all();
    integrity::all();
    ins::all(&facade::UNIT, &facade::STATE, &facade::SAMPLE);
    ekf::all(&facade::UNIT, &facade::STATE, gnss::EPHEMERIS.satellite);
    mhss::all();
    raim::all();
    araim::all();
    drivers::all();
    aids::all();
    monitors::all();
    facade::all(&gnss::EPHEMERIS, &gnss::PARAMETERS);
    #[cfg(feature = "no-panic-control")]
    core::hint::black_box([1_u8, 2, 3][core::hint::black_box(3_usize)]);
    loop {
        cortex_m::asm::wfi();
    }
}
