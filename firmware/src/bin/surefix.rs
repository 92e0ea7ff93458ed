//! The application: receiver bytes in, one output frame per epoch out.
//!
//! | task | priority | what it does |
//! |---|---|---|
//! | `receive` | 2, interrupt of the receiver's UART | byte into the ring, wakes `work` |
//! | `work` | 1, pended by `receive` | ring to monitor, epochs processed, frames sent |
//! | `idle` | 0 | sends the log, sleeps |
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {}

#[cfg(target_os = "none")]
#[rtic::app(device = surefix_firmware::board, peripherals = false)]
mod app {
    use surefix_firmware::board::{self, Interrupt, Ports, log, memory::RECEIVED};

    #[shared]
    struct Shared {}

    #[local]
    struct Local {
        receiver: board::Receiver,
        output: board::Transmitter,
        acknowledge: board::Acknowledge,
    }

    #[init]
    fn init(_: init::Context) -> (Shared, Local) {
        let Ports {
            receiver,
            output,
            acknowledge,
            ..
        } = board::start();
        defmt::info!("surefix {=str}", env!("CARGO_PKG_VERSION"));
        (
            Shared {},
            Local {
                receiver,
                output,
                acknowledge,
            },
        )
    }

    #[task(binds = RECEIVER, priority = 2, local = [receiver])]
    fn receive(context: receive::Context) {
        let receiver = context.local.receiver;
        if receiver.overrun() {
            RECEIVED.add_lost(1);
        }
        while let Some(byte) = receiver.take() {
            RECEIVED.push(byte);
        }
        rtic::pend(Interrupt::WORKER);
    }

    #[task(binds = WORKER, priority = 1, local = [output, acknowledge, chunk: [u8; 256] = [0; 256]])]
    fn work(context: work::Context) {
        let work::LocalResources {
            output,
            acknowledge,
            chunk,
            ..
        } = context.local;
        loop {
            let count = RECEIVED.pop(chunk);
            if count == 0 {
                return;
            }
            output.send(chunk.get(..count).unwrap_or_default());
            acknowledge.taken(count);
        }
    }

    #[idle]
    fn idle(_: idle::Context) -> ! {
        let mut log_sender = log::LogSender::start();
        loop {
            log_sender.drain();
            // With interrupts masked one that comes after the check still ends the sleep.
            cortex_m::interrupt::free(|_| {
                if log::is_empty() {
                    cortex_m::asm::wfi();
                }
            });
        }
    }
}
