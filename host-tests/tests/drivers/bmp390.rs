//! BMP390.

use proptest::prelude::*;
use surefix_firmware::drivers::bmp390::Bmp390;
use surefix_firmware::drivers::{Fault, PressureReading};
use surefix_host_tests::parts::{self, Bus, Motion};

use crate::rig::{
    Rig, check_each_bus_error, check_each_turned_bit, check_stuck_line, check_wires_at_a_start,
    check_wires_while_running, readings_under_turned_bits,
};

type BmpRig = Rig<Bmp390<Bus<parts::bmp390::Bmp390>>, parts::bmp390::Bmp390>;

fn rig() -> BmpRig {
    Rig::new(parts::bmp390::Bmp390::new(), Bmp390::new)
}

fn is_same(one: &PressureReading, other: &PressureReading) -> bool {
    one.pressure_pa == other.pressure_pa && one.temperature_c == other.temperature_c
}

/// INT-070.
#[test]
fn pressure_and_temperature_read_within_a_step_over_the_whole_range() {
    let mut rig = rig().started();
    for pressure_pa in [31_000.0, 54_020.0, 89_875.0, 101_325.0, 124_000.0] {
        for temperature_c in [-39.0, -5.5, 25.0, 84.0] {
            rig.motion = Motion {
                pressure_pa,
                temperature_c,
                ..Motion::REST
            };
            rig.run_ns(20_000_000);
            rig.run_ns(200_000_000);
            assert_eq!(rig.readings.len(), 10);
            let step_pa = parts::bmp390::Bmp390::resolution_pa(&rig.motion);
            for reading in &rig.readings {
                assert!((reading.pressure_pa - pressure_pa).abs() <= 0.51 * step_pa);
                assert!((reading.temperature_c - temperature_c).abs() < 1e-5);
            }
        }
    }
    assert_eq!(rig.faults, []);
}

/// Coefficients and numbers of a real part (a BMP388, whose compensation is the same) with what another
/// program made of them: elixir-sensors/bmp3xx, test/bmp3xx/bmp388/calibration_test.exs.
#[test]
fn a_real_part_s_numbers_are_compensated_as_another_program_does() {
    let trimming = [
        0x23, 0x6b, 0x58, 0x49, 0xf6, 0x5c, 0xff, 0xce, 0xf4, 0x23, 0x00, 0xea, 0x63, 0x6e, 0x79,
        0xf3, 0xf6, 0xaa, 0x43, 0x12, 0xc4,
    ];
    let part = parts::bmp390::Bmp390::with_trimming(trimming);
    let mut rig: BmpRig = Rig::new(part, Bmp390::new);
    rig.run_ns(40_000_000);
    assert!(rig.is_running());
    rig.sleep_ns(20_000_000);
    for (place, value) in [0x97, 0x9f, 0x6d, 0x73, 0xd8, 0x85].into_iter().enumerate() {
        rig.part().upset(0x04 + place as u8, value);
    }
    let now_ns = rig.now_ns;
    rig.readings.clear();
    rig.serve(Some(now_ns));
    let reading = rig.readings[0];
    assert!((reading.pressure_pa - 100_876.006_346_921_99).abs() < 1e-6);
    assert!((reading.temperature_c - 30.499_314_453_874_284).abs() < 1e-9);
}

/// INT-071.
#[test]
fn a_start_with_something_wrong_is_told_and_tried_again() {
    use parts::Fault as Wrong;
    rig().check_start_fault(Wrong::WrongId, |fault| {
        fault == Fault::WrongIdentity { read: 0x50 }
    });
    check_wires_at_a_start(rig);
    rig().check_start_fault(Wrong::ResetStuck, |fault| fault == Fault::ResetNotDone);
    rig().check_start_fault(Wrong::SelfTestFails, |fault| {
        fault == Fault::SelfTest { status: 1 }
    });
    rig().check_start_fault(
        Wrong::BadTrimming,
        |fault| matches!(fault, Fault::Checksum { computed, received } if computed == received ^ 4),
    );
    rig().check_start_fault(Wrong::RegisterStuck { address: 0x1b }, |fault| {
        fault
            == Fault::Configuration {
                register: 0x1b,
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
        Wrong::Failing,
        |fault| fault == Fault::Malformed { word: 1 },
        |counters| counters.malformed,
    );
    rig().started().check_running_fault(
        Wrong::NoNumber,
        |fault| fault == Fault::Malformed { word: 0x8000 },
        |counters| counters.malformed,
    );
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
fn what_is_outside_the_range_of_the_part_is_not_given() {
    let mut rig = rig().started();
    for (pressure_pa, temperature_c) in [
        (101_325.0, 90.0),
        (101_325.0, -41.0),
        (20_000.0, 20.0),
        (126_000.0, 20.0),
    ] {
        rig.motion.pressure_pa = 101_325.0;
        rig.motion.temperature_c = 20.0;
        rig.run_ns(40_000_000);
        rig.motion.pressure_pa = pressure_pa;
        rig.motion.temperature_c = temperature_c;
        rig.run_ns(20_000_000);
        rig.run_ns(40_000_000);
        assert_eq!(rig.faults, [Fault::OutOfRange; 2]);
        assert!(rig.readings.is_empty());
    }
}

#[test]
fn a_pressure_that_happens_to_be_the_number_of_none_is_read() {
    let mut rig = rig().started();
    rig.sleep_ns(20_000_000);
    for (address, value) in [(0x04, 0x00), (0x05, 0x00), (0x06, 0x80)] {
        rig.part().upset(address, value);
    }
    let now_ns = rig.now_ns;
    rig.readings.clear();
    rig.serve(Some(now_ns));
    assert_eq!(rig.readings.len() + rig.faults.len(), 1);
    assert!(!rig.faults.contains(&Fault::Malformed { word: 0x8000 }));
}

#[test]
fn an_error_of_the_bus_at_any_transfer_is_told_and_got_over() {
    check_each_bus_error(rig, 40);
}

/// INT-076.
#[test]
fn a_register_that_changes_by_itself_is_noticed_and_the_part_configured_again() {
    let mut rig = rig().started();
    rig.part().upset(0x1f, 0x04);
    rig.run_ns(200_000_000);
    assert!(rig.readings.len() <= 5, "{}", rig.readings.len());
    assert_eq!(rig.counters().configuration, 5);
    rig.run_ns(1_000_000_000);
    assert_eq!(rig.counters().starts, 2);
    assert!(rig.is_running());
}

/// INT-075.
#[test]
fn no_single_turned_bit_of_a_call_gives_a_wrong_reading() {
    let told = check_each_turned_bit(rig().started(), [(0, 10), (1, 8)], is_same);
    // Twice 48 bits of data, ten of errors and news.
    assert_eq!(told, 2 * 48 + 8 + 2);
}

/// A bit is wrong unseen when it turns in both transfers: at one in a thousand 48 · 10⁻⁶ of readings.
#[test]
fn random_turned_bits_give_hardly_a_wrong_reading() {
    let (all, wrong) = readings_under_turned_bits(rig().started(), 72, is_same);
    assert!(all > 10_000);
    // 20 000 readings, one expected.
    assert!(wrong <= 6, "{wrong}");
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
