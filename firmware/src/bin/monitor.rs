//! The application: receiver bytes in, per epoch one report frame and its NMEA sentences out.
//!
//! | task | priority | what it does |
//! |---|---|---|
//! | `stamp` | 4, interrupts of the sensors' lines | with sensors: when, and after how many bytes; wakes `sample` |
//! | `receive` | 3, interrupt of the receiver's UART | byte into the ring, wakes `work` |
//! | `sample` | 2, pended by `stamp` and by an alarm | with sensors: serves their drivers, wakes `work` |
//! | `work` | 1, pended by the others | ring and samples to monitor; assesses epochs, sends their reports and sentences |
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
    #[cfg(feature = "sensors")]
    use heapless::spsc::{Consumer, Producer, Queue};
    use surefix_firmware::board::memory::{ARRIVED, Memory, RECEIVED};
    use surefix_firmware::board::{self, Interrupt, Ports, log};
    use surefix_firmware::fault;
    use surefix_firmware::worker::Worker;
    #[cfg(feature = "sensors")]
    use surefix_firmware::{
        samples::{LOST, Samples, UNITS},
        sensors::{ARRIVALS, Arrival, EDGES, Edge, Sampler},
    };

    #[shared]
    struct Shared {}

    #[local]
    struct Local {
        receiver: board::Receiver,
        worker: Worker,
        #[cfg(feature = "sensors")]
        edges: board::Edges,
        #[cfg(feature = "sensors")]
        stamped: Producer<'static, Edge>,
        #[cfg(feature = "sensors")]
        to_serve: Consumer<'static, Edge>,
        #[cfg(feature = "sensors")]
        sampler: Sampler<'static>,
        #[cfg(feature = "sensors")]
        alarm: board::Alarm,
        #[cfg(feature = "sensors")]
        arrived: Producer<'static, Arrival>,
    }

    #[init(local = [
        #[cfg(feature = "sensors")]
        edge_queue: Queue<Edge, EDGES> = Queue::new(),
        #[cfg(feature = "sensors")]
        arrival_queue: Queue<Arrival, ARRIVALS> = Queue::new(),
    ])]
    fn init(context: init::Context) -> (Shared, Local) {
        #[cfg(feature = "sensors")]
        let (stamped, to_serve) = context.local.edge_queue.split();
        #[cfg(feature = "sensors")]
        let (arrived, arrivals) = context.local.arrival_queue.split();
        let Ports {
            receiver,
            output,
            acknowledge,
            cycles,
            #[cfg(feature = "sensors")]
            edges,
            #[cfg(feature = "sensors")]
            alarm,
            #[cfg(feature = "sensors")]
            parts,
        } = board::start();
        defmt::info!("surefix {=str}", env!("CARGO_PKG_VERSION"));
        // `init` runs once, so the memory is there.
        let Some(memory) = Memory::take() else {
            fault::withdraw_output_and_reset()
        };
        let worker = Worker::new(
            memory,
            &RECEIVED,
            #[cfg(feature = "sensors")]
            Samples::new(arrivals),
            output,
            acknowledge,
            cycles,
        );
        let local = Local {
            receiver,
            worker,
            #[cfg(feature = "sensors")]
            edges,
            #[cfg(feature = "sensors")]
            stamped,
            #[cfg(feature = "sensors")]
            to_serve,
            #[cfg(feature = "sensors")]
            sampler: Sampler::new(parts),
            #[cfg(feature = "sensors")]
            alarm,
            #[cfg(feature = "sensors")]
            arrived,
        };
        (Shared {}, local)
    }

    #[cfg(feature = "sensors")]
    #[task(binds = SENSORS, priority = 4, local = [edges, stamped])]
    fn stamp(context: stamp::Context) {
        let time_ns = board::now_ns();
        while let Some(line) = context.local.edges.take() {
            let edge = Edge {
                line,
                time_ns,
                place: RECEIVED.written(),
            };
            if context.local.stamped.enqueue(edge).is_err() {
                LOST.add_edge();
            }
        }
        rtic::pend(Interrupt::SAMPLER);
    }

    #[cfg(feature = "sensors")]
    #[task(binds = SAMPLER, priority = 2, local = [to_serve, sampler, alarm, arrived])]
    fn sample(context: sample::Context) {
        let sampler = context.local.sampler;
        let mut give = |arrival| {
            if context.local.arrived.enqueue(arrival).is_err() {
                LOST.add_arrival();
            }
        };
        while let Some(edge) = context.local.to_serve.dequeue() {
            sampler.take(&edge, board::now_ns(), &mut give);
        }
        sampler.look_after(RECEIVED.written(), board::now_ns(), &mut give);
        if let Some(next_ns) = sampler.next_ns() {
            context.local.alarm.set(next_ns);
        }
        cortex_m::interrupt::free(|token| UNITS.borrow(token).set(sampler.units()));
        rtic::pend(Interrupt::WORKER);
    }

    #[task(binds = RECEIVER, priority = 3, local = [receiver])]
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
