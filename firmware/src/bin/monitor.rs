//! The application: receiver bytes in, per epoch one report frame and its NMEA sentences out.
//!
//! | task | priority | what it does |
//! |---|---|---|
//! | `stamp` | 4, interrupts of the sensors' lines | with sensors: when, and after how many bytes; wakes `sample` |
//! | `listen` | 3, interrupt of the system timer | wakes `work`, which asks whether an epoch is overdue |
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

#[cfg(all(target_os = "none", not(feature = "sensors")))]
#[rtic::app(device = surefix_firmware::board, peripherals = false)]
mod app {
    use surefix_firmware::board::memory::{Memory, RECEIVED};
    use surefix_firmware::board::{self, Interrupt, Ports};
    use surefix_firmware::fault;
    use surefix_firmware::worker::{self, Worker};

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

    #[task(binds = RECEIVER, priority = 3, local = [receiver])]
    fn receive(context: receive::Context) {
        worker::receive(context.local.receiver);
        rtic::pend(Interrupt::WORKER);
    }

    #[task(binds = SysTick, priority = 3)]
    fn listen(_: listen::Context) {
        worker::listen();
        rtic::pend(Interrupt::WORKER);
    }

    #[task(binds = WORKER, priority = 1, local = [worker])]
    fn work(context: work::Context) {
        context.local.worker.run();
    }

    #[idle]
    fn idle(_: idle::Context) -> ! {
        worker::idle()
    }
}

// A second application, and not parts of one that are left out: RTIC asks for the interrupts of all.
#[cfg(all(target_os = "none", feature = "sensors"))]
#[rtic::app(device = surefix_firmware::board, peripherals = false)]
mod app {
    use heapless::spsc::{Consumer, Producer, Queue};
    use surefix_firmware::board::memory::{Memory, RECEIVED};
    use surefix_firmware::board::{self, Interrupt, Ports};
    use surefix_firmware::fault;
    use surefix_firmware::worker::{self, Worker};
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
        edges: board::Edges,
        stamped: Producer<'static, Edge>,
        to_serve: Consumer<'static, Edge>,
        sampler: Sampler<'static>,
        alarm: board::Alarm,
        arrived: Producer<'static, Arrival>,
    }

    #[init(local = [
        edge_queue: Queue<Edge, EDGES> = Queue::new(),
        arrival_queue: Queue<Arrival, ARRIVALS> = Queue::new(),
    ])]
    fn init(context: init::Context) -> (Shared, Local) {
        let (stamped, to_serve) = context.local.edge_queue.split();
        let (arrived, arrivals) = context.local.arrival_queue.split();
        let Ports {
            receiver,
            output,
            acknowledge,
            cycles,
            edges,
            alarm,
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
            Samples::new(arrivals),
            output,
            acknowledge,
            cycles,
        );
        let local = Local {
            receiver,
            worker,
            edges,
            stamped,
            to_serve,
            sampler: Sampler::new(parts),
            alarm,
            arrived,
        };
        (Shared {}, local)
    }

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
        worker::receive(context.local.receiver);
        rtic::pend(Interrupt::WORKER);
    }

    #[task(binds = SysTick, priority = 3)]
    fn listen(_: listen::Context) {
        worker::listen();
        rtic::pend(Interrupt::WORKER);
    }

    #[task(binds = WORKER, priority = 1, local = [worker])]
    fn work(context: work::Context) {
        context.local.worker.run();
    }

    #[idle]
    fn idle(_: idle::Context) -> ! {
        worker::idle()
    }
}
