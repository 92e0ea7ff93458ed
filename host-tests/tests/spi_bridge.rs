//! Three inertial units on the bus of the emulated board, and a receiver on its line, in the board's own time.

use std::collections::VecDeque;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use surefix_core::ins::{UnitState, VotingMode};
use surefix_core::integrity::Mode;
use surefix_core::report::EpochReport;
use surefix_firmware::ring::Ring;
use surefix_firmware::sensors::{Next, next};
use surefix_host_tests::qemu::image;
use surefix_host_tests::real_time::{self, Args, OnBus, Outcome};
use surefix_host_tests::simulate::stream::Format;

/// A flight of some seconds through the board; `None`, said aloud, where there is no emulator.
fn fly(seconds: f64, args: &Args) -> Option<(Outcome, OnBus)> {
    if let Some(missing) = image::missing() {
        eprintln!("SKIPPED: {missing}");
        return None;
    }
    let args = Args {
        minutes: seconds / 60.0,
        units: 3,
        ..args.clone()
    };
    let outcome = real_time::fly(&args, &mut |_| {}).unwrap();
    println!("{outcome}\n{:#?}", outcome.log);
    let on_bus = outcome.on_bus.clone().unwrap();
    Some((outcome, on_bus))
}

/// INT-080. The short form of `surefix real-time --units 3`.
#[test]
fn three_units_and_a_receiver_give_the_bytes_of_a_replay_and_no_sample_is_invented() {
    let Some((outcome, on_bus)) = fly(8.0, &Args::default()) else {
        return;
    };
    assert!(outcome.holds());
    assert_eq!(outcome.bytes_lost, 0);
    let tight = |report: &&EpochReport| report.mode == Mode::Tight;
    assert!(outcome.reports.iter().filter(tight).count() > 50);

    // The vote has all three, to the end.
    let voted = outcome.inertial.iter().flatten().next_back().unwrap();
    assert_eq!(voted.voting, VotingMode::Three, "{voted:?}");

    // All that the units made since the first pulse and its epochs, but for what came before.
    assert_eq!(on_bus.compared.invalid, 0);
    assert!(on_bus.compared.samples > 6 * 800, "{:?}", on_bus.compared);
    // Until the second pulse the error of the board's clock is not known: 23 us after a second.
    assert!(
        on_bus.compared.worst_time_ns < 25_000,
        "{:?}",
        on_bus.compared
    );
    for unit in &on_bus.units {
        assert!(unit.is_running && unit.starts == 1, "{unit:?}");
        assert_eq!((unit.missed, unit.silent), (0, 0), "{unit:?}");
    }
    let told = on_bus.sensors;
    assert_eq!(
        (told.pulses_refused, told.contradicted, told.held_over),
        (0, 0, 0)
    );
}

/// INT-081, INT-082. A run repeats to the byte and to the tick; UBX on the line.
#[test]
fn a_run_repeats_and_faults_of_a_unit_show_in_its_counters() {
    let args = Args {
        format: Format::Ubx,
        unit_faults: ["0:silent:3:4", "2:stuck:3.5:4.5"]
            .map(|fault| fault.parse().unwrap())
            .to_vec(),
        ..Args::default()
    };
    let Some((outcome, on_bus)) = fly(6.0, &args) else {
        return;
    };
    assert!(outcome.holds());
    let [silent, healthy, stuck] = on_bus.units[..] else {
        panic!("{:?}", on_bus.units);
    };
    // A unit without readings is noticed, started again, and gives readings afterwards.
    assert!(silent.silent >= 5 && silent.starts >= 2, "{silent:?}");
    assert!(stuck.silent >= 1, "{stuck:?}");
    assert!(silent.is_running && stuck.is_running);
    let states = |unit: usize| {
        let reports = outcome.inertial.iter().flatten();
        reports.map(move |report| report.units[unit].state)
    };
    for unit in [0, 2] {
        assert!(states(unit).any(|state| state == UnitState::Used));
        assert!(states(unit).any(|state| state == UnitState::Silent));
    }
    assert!(states(1).next_back() == Some(UnitState::Used));
    assert_eq!((healthy.silent, healthy.missed, healthy.starts), (0, 0, 1));

    let Some((again, again_on_bus)) = fly(6.0, &args) else {
        return;
    };
    assert!(outcome.output == again.output);
    assert!(on_bus.recording == again_on_bus.recording);
    assert_eq!(outcome.ages_s, again.ages_s);
    assert_eq!(on_bus.transfers, again_on_bus.transfers);
}

/// INT-084. Interrupts bring bytes and samples at any time, also while the worker looks what comes next.
#[test]
fn bytes_and_samples_are_taken_in_the_order_of_their_lines_whatever_the_worker_does() {
    #[derive(Debug, PartialEq)]
    enum Event {
        Byte(u8),
        Sample(u32),
    }
    for seed in 0..200 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let ring = Ring::<1024>::empty();
        let mut arrivals = VecDeque::new();
        let (mut came, mut taken) = (Vec::new(), Vec::new());
        let mut interrupt = |arrivals: &mut VecDeque<(u32, u32)>| {
            for _ in 0..random.next_u32() % 6 {
                let number = came.len() as u32;
                if random.next_u32().is_multiple_of(3) {
                    arrivals.push_back((ring.written(), number));
                    came.push(Event::Sample(number));
                } else {
                    ring.push(number as u8);
                    came.push(Event::Byte(number as u8));
                }
            }
        };
        for turn in 0..400 {
            // The last turns empty both queues.
            if turn < 200 {
                interrupt(&mut arrivals);
            }
            let (read, written) = (ring.taken(), ring.written());
            if turn < 200 {
                interrupt(&mut arrivals);
            }
            match next(read, written, arrivals.front().map(|(place, _)| *place)) {
                Next::Nothing => {}
                Next::Bytes(most) => {
                    let mut bytes = [0; 256];
                    let count = ring.pop(&mut bytes[..most.min(256)]);
                    taken.extend(bytes[..count].iter().map(|byte| Event::Byte(*byte)));
                }
                Next::Arrival => {
                    let (_, number) = arrivals.pop_front().unwrap();
                    taken.push(Event::Sample(number));
                }
            }
        }
        assert_eq!(ring.lost(), 0);
        // As many turns as there are events empty the queues, or nearly.
        assert!(taken.len() > 300, "{}", taken.len());
        assert_eq!(taken, came[..taken.len()]);
    }
}
