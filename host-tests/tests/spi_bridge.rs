//! Three inertial units on the bus of the emulated board, and a receiver on its line, in the board's own time.

use surefix_core::integrity::Mode;
use surefix_core::report::EpochReport;
use surefix_host_tests::qemu::image;
use surefix_host_tests::real_time::{self, Args, OnBus, Outcome};
use surefix_host_tests::simulate::stream::Format;

/// A flight through the board; `None`, said aloud, where there is no emulator.
fn fly(args: &Args) -> Option<(Outcome, OnBus)> {
    if let Some(missing) = image::missing() {
        eprintln!("SKIPPED: {missing}");
        return None;
    }
    let outcome = real_time::fly(args, &mut |_| {}).unwrap();
    println!("{outcome}\n{:#?}", outcome.log);
    let on_bus = outcome.on_bus.clone().unwrap();
    Some((outcome, on_bus))
}

/// INT-080, INT-007. The short form of `surefix real-time --units 3`.
#[test]
fn three_units_and_a_receiver_give_the_bytes_of_a_replay_and_no_sample_is_invented() {
    let Some((outcome, on_bus)) = fly(&Args {
        minutes: 0.2,
        units: 3,
        ..Args::default()
    }) else {
        return;
    };
    assert!(outcome.holds());
    let tight = |report: &&EpochReport| report.mode == Mode::Tight;
    assert!(outcome.reports.iter().filter(tight).count() > 60);
    assert!(on_bus.compared.samples > 8000);
}
