//! The application: receiver bytes in, per epoch one report frame and its NMEA sentences out.
//!
//! | task | priority | what it does |
//! |---|---|---|
//! | `receive` | 2, interrupt of the receiver's UART | byte into the ring, wakes `work` |
//! | `work` | 1, pended by `receive` | ring to monitor; assesses epochs, sends their reports and sentences |
//! | `idle` | 0 | sends the log, sleeps |
//!
//! After an end-of-stream frame the counters and an end-of-stream frame go out; the application then
//! waits for more bytes; in real time on the emulated board it resets, which ends the emulator.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {}

#[cfg(target_os = "none")]
#[rtic::app(device = surefix_firmware::board, peripherals = false)]
mod app {
    use surefix_firmware::board::memory::{ARRIVED, Memory, RECEIVED};
    use surefix_firmware::board::{self, Interrupt, Ports, log};
    use surefix_firmware::fault;
    use surefix_firmware::worker::Worker;

    #[shared]
    struct Shared {}

    #[local]
    struct Local {
        receiver: board::Receiver,
        worker: Worker,
    }

    #[init]
    fn init(_: init::Context) -> (Shared, Local) {
        let Ports {
            receiver,
            output,
            acknowledge,
            cycles,
        } = board::start();
        defmt::info!("surefix {=str}", env!("CARGO_PKG_VERSION"));
        // `init` runs once, so the memory is there.
        let Some(memory) = Memory::take() else {
            fault::withdraw_output_and_reset()
        };
        let worker = Worker::new(memory, &RECEIVED, output, acknowledge, cycles);
        (Shared {}, Local { receiver, worker })
    }

    #[task(binds = RECEIVER, priority = 2, local = [receiver])]
    fn receive(context: receive::Context) {
        let receiver = context.local.receiver;
        if receiver.overrun() {
            RECEIVED.add_lost(1);
        }
        while let Some(byte) = receiver.take() {
            ARRIVED.note(RECEIVED.written(), RECEIVED.is_empty(), board::ticks);
            RECEIVED.push(byte);
        }
        rtic::pend(Interrupt::WORKER);
    }

    #[task(binds = WORKER, priority = 1, local = [worker])]
    fn work(context: work::Context) {
        context.local.worker.run();
    }

    #[idle]
    fn idle(_: idle::Context) -> ! {
        let mut log_sender = log::LogSender::start();
        loop {
            log_sender.drain();
            #[cfg(feature = "real-time")]
            if surefix_firmware::worker::has_ended() {
                cortex_m::peripheral::SCB::sys_reset();
            }
            // With interrupts masked one that comes after the check still ends the sleep.
            cortex_m::interrupt::free(|_| {
                if log::is_empty() {
                    cortex_m::asm::wfi();
                }
            });
        }
    }
}
