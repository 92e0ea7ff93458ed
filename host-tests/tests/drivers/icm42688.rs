//! ICM-42688-P.

use std::f64::consts::PI;

use proptest::prelude::*;
use surefix_firmware::drivers::icm42688::{AccelRange, Config, GyroRange, Icm42688, Rate};
use surefix_firmware::drivers::{Fault, InertialReading};
use surefix_host_tests::parts::{self, Bus, Motion, Part};

use crate::rig::{
    Rig, check_each_bus_error, check_stuck_line, check_test_made_once, check_wires_at_a_start,
    check_wires_while_running,
};

type IcmRig = Rig<Icm42688<Bus<parts::icm42688::Icm42688>>, parts::icm42688::Icm42688>;

const CONFIG: Config = Config {
    gyro: GyroRange::Dps500,
    accel: AccelRange::G8,
    rate: Rate::Hz200,
};

const MOVING: Motion = Motion {
    omega_is_s_radps: [0.123_456, -0.98765, 0.321],
    f_is_s_mps2: [0.5432, -3.21, -9.8765],
    temperature_c: 31.4,
    ..Motion::REST
};

fn rig_of(config: Config) -> IcmRig {
    Rig::new(parts::icm42688::Icm42688::new(), |bus| {
        Icm42688::new(bus, config)
    })
}

fn rig() -> IcmRig {
    rig_of(CONFIG)
}

fn is_same(left: &InertialReading, right: &InertialReading) -> bool {
    left.omega_is_s_radps == right.omega_is_s_radps && left.f_is_s_mps2 == right.f_is_s_mps2
}

/// INT-070.
#[test]
fn every_range_and_rate_reads_within_half_a_step() {
    let gyros = [
        (GyroRange::Dps2000, 2000.0),
        (GyroRange::Dps1000, 1000.0),
        (GyroRange::Dps500, 500.0),
        (GyroRange::Dps250, 250.0),
        (GyroRange::Dps125, 125.0),
    ];
    let accels = [
        (AccelRange::G16, 16.0),
        (AccelRange::G8, 8.0),
        (AccelRange::G4, 4.0),
        (AccelRange::G2, 2.0),
    ];
    let rates = [(Rate::Hz100, 100), (Rate::Hz200, 200), (Rate::Hz500, 500)];
    for (gyro, dps) in gyros {
        for (accel, g) in accels {
            for (rate, hz) in rates {
                let mut rig = rig_of(Config { gyro, accel, rate });
                rig.motion = MOVING;
                let mut rig = rig.started();
                rig.run_ns(500_000_000);
                assert_eq!(rig.readings.len(), hz / 2, "{gyro:?} {accel:?} {rate:?}");
                assert_eq!(rig.faults, []);
                for reading in &rig.readings {
                    assert!(reading.is_valid);
                    assert_eq!(reading.missed, 0);
                    assert_eq!(reading.interval_ns as usize, 1_000_000_000 / hz);
                    for axis in 0..3 {
                        let rate = reading.omega_is_s_radps[axis] - MOVING.omega_is_s_radps[axis];
                        let force = reading.f_is_s_mps2[axis] - MOVING.f_is_s_mps2[axis];
                        let half = 0.5 / 32_768.0 * (1.0 + 1e-6);
                        assert!(rate.abs() <= half * dps * PI / 180.0);
                        assert!(force.abs() <= half * g * 9.806_65);
                    }
                    let temperature_c = f64::from(reading.temperature_c.unwrap());
                    assert!((temperature_c - 31.4).abs() < 0.25);
                }
            }
        }
    }
}

/// INT-071.
#[test]
fn a_start_with_something_wrong_is_told_and_tried_again() {
    use parts::Fault as Wrong;
    rig().check_start_fault(Wrong::WrongId, |fault| {
        fault == Fault::WrongIdentity { read: 0x44 }
    });
    check_wires_at_a_start(rig);
    // The x gyroscope.
    rig().check_start_fault(Wrong::SelfTestFails, |fault| {
        fault == Fault::SelfTest { status: 1 << 3 }
    });
    // The x accelerometer.
    rig().check_start_fault(Wrong::SelfTestTooStrong, |fault| {
        fault == Fault::SelfTest { status: 1 << 0 }
    });
    for (address, read) in [(0x4c, 0x30), (0x4f, 0x06), (0x5f, 0x00), (0x64, 0x10)] {
        // GYRO_CONFIG0 that takes no write spoils the test of the gyroscopes first.
        rig().check_start_fault(Wrong::RegisterStuck { address }, |fault| {
            fault
                == Fault::Configuration {
                    register: address,
                    read,
                }
                || address == 0x4f && matches!(fault, Fault::SelfTest { .. })
        });
    }
}

#[test]
fn a_reset_that_does_not_end_is_told() {
    let mut rig = rig();
    // The first reset clears nothing: RESET_DONE of power-up has been read by another master.
    rig.sleep_ns(1_000_000);
    let mut answer = [0; 2];
    rig.part().transfer(&[0x80 | 0x2d, 0], &mut answer);
    assert_eq!(answer[1] & 0x10, 0x10);
    rig.check_start_fault(parts::Fault::ResetStuck, |fault| {
        fault == Fault::ResetNotDone
    });
}

#[test]
fn a_part_without_the_factory_s_codes_is_held_to_the_absolute_limits() {
    let rig: IcmRig = Rig::new(parts::icm42688::Icm42688::without_codes(), |bus| {
        Icm42688::new(bus, CONFIG)
    });
    rig.started();
    let failing: IcmRig = Rig::new(parts::icm42688::Icm42688::without_codes(), |bus| {
        Icm42688::new(bus, CONFIG)
    });
    failing.check_start_fault(parts::Fault::SelfTestFails, |fault| {
        fault == Fault::SelfTest { status: 1 << 3 }
    });
    let strong: IcmRig = Rig::new(parts::icm42688::Icm42688::without_codes(), |bus| {
        Icm42688::new(bus, CONFIG)
    });
    strong.check_start_fault(parts::Fault::SelfTestTooStrong, |fault| {
        fault == Fault::SelfTest { status: 1 << 0 }
    });
}

/// INT-072.
#[test]
fn what_goes_wrong_on_the_wires_gives_no_reading_and_starts_the_part_again() {
    use parts::Fault as Wrong;
    check_wires_while_running(rig);
    rig().started().check_running_fault(
        Wrong::StuckDataReady { active: false },
        |fault| matches!(fault, Fault::Silent { .. }),
        |counters| counters.silent,
    );
    rig().started().check_running_fault(
        Wrong::NoNumber,
        |fault| fault == Fault::Malformed { word: 0x8000 },
        |counters| counters.malformed,
    );
}

#[test]
fn a_line_that_stays_active_repeats_nothing() {
    check_stuck_line(rig().started(), |reading| reading.time_ns);
}

#[test]
fn an_error_of_the_bus_at_any_transfer_is_told_and_got_over() {
    check_each_bus_error(rig, 70);
    let mut rig = rig().started();
    rig.break_with(parts::Fault::BusErrorOnce { transfer: 2 });
    rig.run_ns(10_000_000);
    assert_eq!(rig.readings.len(), 1);
    // The first was refused for want of a confirmation.
    assert_eq!(rig.readings[0].missed, 1);
    // While the FIFO overflows: the count of what was lost; while nothing is new: the identity.
    for (transfer, is_full) in [(1, true), (1, false)] {
        rig.run_ns(100_000_000);
        if is_full {
            rig.sleep_ns(1_000_000_000);
        }
        rig.break_with(parts::Fault::BusErrorOnce { transfer });
        rig.faults.clear();
        let now_ns = rig.now_ns;
        rig.serve(Some(now_ns));
        assert!(
            matches!(rig.faults[..], [Fault::Bus(_)]),
            "{:?}",
            rig.faults
        );
        rig.mend();
    }
}

/// INT-073.
#[test]
fn a_time_stamp_that_stays_skips_or_leaps_is_told() {
    let mut stays = rig().started();
    stays.break_with(parts::Fault::RepeatCounter);
    stays.run_ns(25_000_000);
    assert_eq!(stays.faults, [Fault::Repeated; 5]);
    assert!(stays.readings.is_empty());

    let mut skips = rig().started();
    skips.break_with(parts::Fault::SkipCounter { by: 2 });
    skips.run_ns(50_000_000);
    assert_eq!(skips.faults, []);
    assert!(skips.readings.iter().all(|reading| reading.missed == 2));
}

#[test]
fn a_time_stamp_between_intervals_is_told() {
    // Bits 10 and 11 of the stamp: 2 ms of an interval of 5 ms. The third transfer would be the second
    // packet's; the second is the packet, with a byte of command first.
    let mut rig = rig().started();
    rig.mend();
    let stamp = 8 * (1 + 14);
    for bit in [stamp + 4, stamp + 5] {
        rig.part()
            .faults()
            .set(parts::Fault::FlipOnce { transfer: 1, bit });
    }
    rig.one_interval();
    assert!(
        matches!(rig.faults[..], [Fault::Counter { .. }]),
        "{:?}",
        rig.faults
    );
    assert!(rig.readings.is_empty());
    assert_eq!(rig.counters().counter, 1);
}

#[test]
fn a_late_call_gives_all_readings_with_their_times_but_only_the_newest_as_valid() {
    let mut rig = rig().started();
    rig.sleep_ns(15_000_000);
    rig.one_interval();
    assert_eq!(rig.faults, []);
    let valid: Vec<bool> = rig
        .readings
        .iter()
        .map(|reading| reading.is_valid)
        .collect();
    assert_eq!(valid, [false, false, false, true]);
    for pair in rig.readings.windows(2) {
        assert_eq!(pair[1].time_ns - pair[0].time_ns, 5_000_000);
        assert_eq!(pair[1].missed, 0);
    }
}

#[test]
fn a_full_fifo_is_an_overrun_and_what_was_lost_is_counted() {
    let mut rig = rig().started();
    rig.sleep_ns(1_000_000_000);
    rig.readings.clear();
    let ready_ns = rig.part().data_ready_ns();
    rig.serve(ready_ns);
    assert_eq!(rig.faults, []);
    assert_eq!(rig.readings.len(), 16);
    // 200 were made, 128 are there.
    assert_eq!(rig.readings[0].missed, 72);
    assert_eq!(rig.counters().overrun, 1);
    assert!(rig.readings[1..].iter().all(|reading| reading.missed == 0));
    rig.run_ns(100_000_000);
    rig.run_ns(1_000_000_000);
    assert_eq!(rig.readings.len(), 200);
    assert!(rig.readings.iter().all(|reading| reading.is_valid));
}

#[test]
fn numbers_at_their_end_are_not_valid_and_no_reason_to_start_again() {
    let mut rig = rig().started();
    rig.break_with(parts::Fault::Saturated);
    rig.run_ns(1_000_000_000);
    assert_eq!(rig.readings.len(), 200);
    assert!(rig.readings.iter().all(|reading| !reading.is_valid));
    assert!(rig.is_running());
}

#[test]
fn a_test_of_the_sensors_that_was_passed_is_not_repeated() {
    check_test_made_once(rig().started());
}

/// INT-076.
#[test]
fn a_register_that_changes_by_itself_is_noticed_and_the_part_configured_again() {
    let mut rig = rig().started();
    // Half the range, twice the numbers.
    rig.part().upset(0x4f, 3 << 5 | 0x07);
    rig.run_ns(100_000_000);
    // Eleven registers, one each reading.
    assert!(rig.readings.len() <= 11, "{}", rig.readings.len());
    assert_eq!(rig.counters().configuration, 5);
    rig.run_ns(1_000_000_000);
    rig.run_ns(1_000_000_000);
    assert_eq!(rig.counters().starts, 2);
    assert_eq!(rig.readings.len(), 200);
}

/// INT-075.
#[test]
fn no_single_turned_bit_of_a_call_gives_a_wrong_reading() {
    let mut rig = rig();
    rig.motion = MOVING;
    let mut rig = rig.started();
    rig.one_interval();
    let truth = rig.readings[0];
    let mut told = 0;
    // Status and count, packet, data registers: with the byte of the command.
    for (transfer, bytes) in [(0, 4), (1, 17), (2, 15)] {
        for bit in 0..8 * bytes {
            rig.mend();
            // What a wrong count left in the FIFO goes first.
            rig.run_ns(20_000_000);
            rig.mend();
            rig.part()
                .faults()
                .set(parts::Fault::FlipOnce { transfer, bit });
            rig.one_interval();
            for reading in rig.readings.iter().filter(|reading| reading.is_valid) {
                assert!(is_same(reading, &truth), "transfer {transfer} bit {bit}");
                let read_c = f64::from(reading.temperature_c.unwrap());
                assert!((read_c - 31.4).abs() < 2.0);
            }
            told += rig.faults.len();
        }
    }
    println!("288 turned bits, {told} faults told");
    // All of twice 96 bits of data, at least.
    assert!(told >= 192, "{told}");
}

/// A bit is wrong unseen when it turns in both transfers: at one in a thousand 96 · 10⁻⁶ of readings.
#[test]
fn random_turned_bits_give_hardly_a_wrong_reading() {
    let mut rig = rig();
    rig.motion = MOVING;
    let mut rig = rig.started();
    rig.one_interval();
    let truth = rig.readings[0];
    rig.break_with(parts::Fault::FlipBits {
        probability: 1e-3,
        seed: 71,
    });
    let (mut valid, mut wrong) = (0, 0);
    for _ in 0..200 {
        rig.run_ns(1_000_000_000);
        for reading in rig.readings.iter().filter(|reading| reading.is_valid) {
            valid += 1;
            wrong += u32::from(!is_same(reading, &truth));
        }
    }
    println!("turned bits 1e-3: {valid} valid readings, {wrong} of them wrong");
    assert!(valid > 20_000);
    // 40 000 readings, 4 expected; 5 sigma.
    assert!(wrong <= 14, "{wrong}");
}

proptest! {
    #![proptest_config(ProptestConfig {
        failure_persistence: None,
        ..ProptestConfig::with_cases(48)
    })]

    #[test]
    fn any_motion_is_read_as_it_is_or_is_not_valid(
        rates in prop::array::uniform3(-12.0..12.0_f64),
        forces in prop::array::uniform3(-90.0..90.0_f64),
        temperature_c in -35.0..85.0_f64,
    ) {
        let mut rig = rig().started();
        rig.motion = Motion { omega_is_s_radps: rates, f_is_s_mps2: forces, temperature_c, ..Motion::REST };
        rig.one_interval();
        prop_assert_eq!(rig.readings.len(), 1);
        let reading = rig.readings[0];
        if reading.is_valid {
            for axis in 0..3 {
                prop_assert!((reading.omega_is_s_radps[axis] - rates[axis]).abs() < 1.4e-4);
                prop_assert!((reading.f_is_s_mps2[axis] - forces[axis]).abs() < 1.2e-3);
            }
        } else {
            let beyond = |values: [f64; 3], end: f64| values.iter().any(|value| value.abs() > end);
            prop_assert!(beyond(rates, 499.9_f64.to_radians()) || beyond(forces, 78.4));
        }
    }

    /// Each bit that comes is thrown: nothing agrees with anything.
    #[test]
    fn noise_on_the_line_gives_no_valid_reading(seed in any::<u64>()) {
        let mut rig = rig().started();
        rig.break_with(parts::Fault::FlipBits { probability: 0.5, seed });
        rig.run_ns(500_000_000);
        prop_assert!(rig.readings.iter().all(|reading| !reading.is_valid));
    }
}
