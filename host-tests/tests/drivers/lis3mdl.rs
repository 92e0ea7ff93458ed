//! LIS3MDL.

use proptest::prelude::*;
use surefix_firmware::drivers::lis3mdl::Lis3mdl;
use surefix_firmware::drivers::{Fault, MagneticReading};
use surefix_host_tests::parts::{self, Bus};

use crate::rig::{
    Rig, check_each_bus_error, check_each_turned_bit, check_stuck_line, check_test_made_once,
    check_wires_at_a_start, check_wires_while_running, readings_under_turned_bits,
};

type LisRig = Rig<Lis3mdl<Bus<parts::lis3mdl::Lis3mdl>>, parts::lis3mdl::Lis3mdl>;

fn rig() -> LisRig {
    Rig::new(parts::lis3mdl::Lis3mdl::new(), Lis3mdl::new)
}

fn is_same(one: &MagneticReading, other: &MagneticReading) -> bool {
    one.field_s_ut == other.field_s_ut
}

/// INT-070.
#[test]
fn the_field_reads_within_half_a_step() {
    let mut rig = rig().started();
    for field in [
        [20.0, -3.3, 44.4],
        [-61.2, 0.0, 250.0],
        [399.0, -399.0, 0.007],
    ] {
        rig.motion.field_s_ut = field;
        rig.run_ns(12_500_000);
        rig.run_ns(1_000_000_000);
        assert_eq!(rig.readings.len(), 80);
        for reading in &rig.readings {
            for axis in 0..3 {
                let error_ut = reading.field_s_ut[axis] - field[axis];
                assert!(error_ut.abs() <= 0.5 * 100.0 / 6842.0 * (1.0 + 1e-6));
            }
        }
    }
    assert_eq!(rig.faults, []);
}

/// INT-071.
#[test]
fn a_start_with_something_wrong_is_told_and_tried_again() {
    use parts::Fault as Wrong;
    rig().check_start_fault(Wrong::WrongId, |fault| {
        fault == Fault::WrongIdentity { read: 0x40 }
    });
    check_wires_at_a_start(rig);
    rig().check_start_fault(Wrong::ResetStuck, |fault| fault == Fault::ResetNotDone);
    // The y axis.
    rig().check_start_fault(Wrong::SelfTestFails, |fault| {
        fault == Fault::SelfTest { status: 1 << 1 }
    });
    rig().check_start_fault(Wrong::SelfTestTooStrong, |fault| {
        fault == Fault::SelfTest { status: 0b111 }
    });
    rig().check_start_fault(Wrong::RegisterStuck { address: 0x24 }, |fault| {
        fault
            == Fault::Configuration {
                register: 0x24,
                read: 0,
            }
    });
}

/// INT-072.
#[test]
fn what_goes_wrong_gives_no_reading_and_starts_the_part_again() {
    use parts::Fault as Wrong;
    check_wires_while_running(rig);
    rig().started().check_running_fault(
        Wrong::Saturated,
        |fault| fault == Fault::OutOfRange,
        |counters| counters.out_of_range,
    );
}

#[test]
fn a_line_that_stays_active_repeats_nothing() {
    check_stuck_line(rig().started(), |reading| reading.time_ns);
}

#[test]
fn numbers_that_were_written_over_are_counted() {
    let mut rig = rig().started();
    rig.sleep_ns(12_500_000);
    rig.one_interval();
    assert_eq!(rig.readings.len(), 1);
    assert_eq!(rig.counters().overrun, 1);
    rig.break_with(parts::Fault::Overrun);
    rig.run_ns(125_000_000);
    assert_eq!(rig.counters().overrun, 11);
    assert_eq!(rig.readings.len(), 10);
}

#[test]
fn a_test_of_the_sensor_that_was_passed_is_not_repeated() {
    check_test_made_once(rig().started());
}

#[test]
fn an_error_of_the_bus_at_any_transfer_is_told_and_got_over() {
    check_each_bus_error(rig, 40);
}

/// INT-076.
#[test]
fn a_register_that_changes_by_itself_is_noticed_and_the_part_configured_again() {
    let mut rig = rig().started();
    // Twice the range, half the numbers.
    rig.part().upset(0x21, 0x20);
    rig.run_ns(125_000_000);
    assert!(rig.readings.len() <= 5, "{}", rig.readings.len());
    assert_eq!(rig.counters().configuration, 5);
    rig.run_ns(1_000_000_000);
    assert_eq!(rig.counters().starts, 2);
    assert!(rig.is_running());
}

/// INT-075.
#[test]
fn no_single_turned_bit_of_a_call_gives_a_wrong_reading() {
    let told = check_each_turned_bit(rig().started(), [(0, 8), (1, 7)], is_same);
    // Twice 48 bits of data and the one of news.
    assert_eq!(told, 2 * 48 + 1);
}

/// A bit is wrong unseen when it turns in both transfers: at one in a thousand 48 · 10⁻⁶ of readings.
#[test]
fn random_turned_bits_give_hardly_a_wrong_reading() {
    let (all, wrong) = readings_under_turned_bits(rig().started(), 73, is_same);
    assert!(all > 20_000);
    // 32 000 readings, 1.5 expected.
    assert!(wrong <= 8, "{wrong}");
}

proptest! {
    #![proptest_config(ProptestConfig {
        failure_persistence: None,
        ..ProptestConfig::with_cases(48)
    })]

    #[test]
    fn noise_on_the_line_gives_no_reading(seed in any::<u64>()) {
        let mut rig = rig().started();
        rig.break_with(parts::Fault::FlipBits { probability: 0.5, seed });
        rig.run_ns(1_000_000_000);
        prop_assert!(rig.readings.is_empty());
    }
}
