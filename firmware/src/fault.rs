//! The end of a run that went wrong: the output says that it is invalid, then the chip resets.
//!
//! Nothing here trusts the state of the program. The frame is a constant, the UART is set up anew,
//! interrupts stay masked, and the stack is given back before the HardFault handler uses it.

use crate::board;
use crate::board::log::LogSender;
use cortex_m::peripheral::SCB;
use cortex_m_rt::exception;
use crc::{CRC_32_ISO_HDLC, Crc};
use surefix_core::wire::native::{HEADER_LEN, Kind, PREAMBLE_1, PREAMBLE_2, TRAILER_LEN, VERSION};

/// The frame that withdraws the output, checksum included.
const INVALID: [u8; HEADER_LEN + TRAILER_LEN] = {
    let covered = [VERSION, Kind::OutputInvalid as u8, 0, 0];
    let crc = Crc::<u32>::new(&CRC_32_ISO_HDLC)
        .checksum(&covered)
        .to_le_bytes();
    let [version, kind, length_low, length_high] = covered;
    [
        PREAMBLE_1,
        PREAMBLE_2,
        version,
        kind,
        length_low,
        length_high,
        crc[0],
        crc[1],
        crc[2],
        crc[3],
    ]
};

/// Sends the frame that withdraws the output, then what is left of the log, then resets.
pub fn withdraw_output_and_reset() -> ! {
    cortex_m::interrupt::disable();
    let mut output = board::emergency_output();
    output.send(&INVALID);
    output.flush();
    LogSender::start().drain();
    SCB::sys_reset()
}

/// In the image that proves no panic reachable: linking fails where this handler is needed.
#[cfg(feature = "no-panic")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    unsafe extern "C" {
        // Defined nowhere.
        safe fn a_panic_is_reachable_from_surefix_core() -> !;
    }
    a_panic_is_reachable_from_surefix_core()
}

#[cfg(not(feature = "no-panic"))]
#[panic_handler]
fn panic(info: &core::panic::PanicInfo) -> ! {
    match info.location() {
        Some(at) => defmt::error!("panic at {=str}:{=u32}", at.file(), at.line()),
        None => defmt::error!("panic"),
    }
    withdraw_output_and_reset()
}

/// Where a fault begins: takes the stack from the start again, because its overflow may be what brought
/// us here, and goes on in [`hard_fault`]. Naked, because anything a compiler puts before the first
/// statement would use the stack as it is, and a fault in here is the end (a lockup, no reset).
///
/// Floating-point registers of the interrupted program that wait to be saved are given up: the place
/// reserved for them is on that stack, and the first floating-point instruction of the handler would
/// write there. ARM DDI 0403 B1.5.7; FPCCR is at 0xE000_EF34, its bit 0 is LSPACT.
// SAFETY: the name is the one in cortex-m-rt's vector table.
#[unsafe(no_mangle)]
#[unsafe(naked)]
extern "C" fn HardFault() -> ! {
    core::arch::naked_asm!(
        "movw r0, #:lower16:_stack_start",
        "movt r0, #:upper16:_stack_start",
        "msr msp, r0",
        "movw r0, #0xEF34",
        "movt r0, #0xE000",
        "ldr r1, [r0]",
        "bic r1, r1, #1",
        "str r1, [r0]",
        "dsb",
        "isb",
        "b {handler}",
        handler = sym hard_fault,
    )
}

extern "C" fn hard_fault() -> ! {
    // SAFETY: reading these registers has no side effect.
    let (status, memory_address, bus_address) = unsafe {
        let scb = &*SCB::PTR;
        (scb.cfsr.read(), scb.mmfar.read(), scb.bfar.read())
    };
    let address = if status & MEMORY_ADDRESS_VALID != 0 {
        memory_address
    } else if status & BUS_ADDRESS_VALID != 0 {
        bus_address
    } else {
        0
    };
    defmt::error!(
        "hard fault, status {=u32:#010x}, address {=u32:#010x}",
        status,
        address
    );
    withdraw_output_and_reset()
}

/// Bits of the fault status that say which address register holds. ARM DDI 0403 B3.2.15.
const MEMORY_ADDRESS_VALID: u32 = 1 << 7;
/// See [`MEMORY_ADDRESS_VALID`].
const BUS_ADDRESS_VALID: u32 = 1 << 15;

#[exception]
unsafe fn DefaultHandler(number: i16) -> ! {
    defmt::error!("interrupt {=i16} has no handler", number);
    withdraw_output_and_reset()
}

/// Failures on request, for the tests of this file on the emulated board.
#[cfg(feature = "deliberate-fault")]
pub mod deliberate {
    use core::sync::atomic::{AtomicU32, Ordering};

    /// The last four bytes of the stream.
    static LAST: AtomicU32 = AtomicU32::new(0);

    /// Fails when the stream says so.
    pub fn on_request(bytes: &[u8]) {
        for byte in bytes {
            let last = LAST.load(Ordering::Relaxed) << 8 | u32::from(*byte);
            LAST.store(last, Ordering::Relaxed);
            match &last.to_be_bytes() {
                b"!PAN" => panic!("deliberate"),
                b"!FLT" => cortex_m::asm::udf(),
                b"!STK" => drop(overflow(u32::from(*byte))),
                _ => {}
            }
        }
    }

    #[inline(never)]
    fn overflow(depth: u32) -> u32 {
        let frame = core::hint::black_box([depth; 64]);
        if depth == 0 {
            return 0;
        }
        overflow(depth.wrapping_add(2)).wrapping_add(core::hint::black_box(frame)[1])
    }
}
