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

/// Takes the stack from the start again, because its overflow may be what brought us here, and
/// goes on in [`hard_fault`].
#[exception(trampoline = false)]
unsafe fn HardFault() -> ! {
    // SAFETY: nothing of the interrupted program is used again: `hard_fault` never returns.
    unsafe {
        core::arch::asm!(
            "movw r0, #:lower16:_stack_start",
            "movt r0, #:upper16:_stack_start",
            "msr msp, r0",
            "b {handler}",
            handler = sym hard_fault,
            options(noreturn)
        )
    }
}

extern "C" fn hard_fault() -> ! {
    defmt::error!("hard fault");
    withdraw_output_and_reset()
}

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
