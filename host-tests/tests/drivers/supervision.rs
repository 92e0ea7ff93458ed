//! Faults in a row, restarts and counts by themselves.

use surefix_firmware::drivers::supervision::{
    Due, FAULTS_IN_A_ROW, RETRY_NS, SILENT_INTERVALS, Soundness, Supervision,
};
use surefix_firmware::drivers::{Fault, Phase};

const INTERVAL_NS: u32 = 5_000_000;

fn running() -> Supervision {
    let mut supervision = Supervision::new(INTERVAL_NS);
    supervision.started(0);
    supervision
}

#[test]
fn a_step_is_due_when_the_wait_is_over() {
    let mut supervision = Supervision::new(INTERVAL_NS);
    assert_eq!(supervision.due(0), Due::Step(0));
    supervision.step_done(0, 0, 1000);
    assert_eq!(supervision.due(999), Due::Nothing);
    assert_eq!(supervision.due(1000), Due::Step(1));
    supervision.started(1000);
    assert_eq!(supervision.due(1000), Due::Reading);
    assert_eq!(supervision.counters().starts, 1);
}

#[test]
fn a_start_that_failed_is_tried_again_from_its_beginning() {
    let mut supervision = Supervision::new(INTERVAL_NS);
    supervision.step_done(0, 3, 0);
    supervision.fault(10, Fault::ResetNotDone);
    assert_eq!(supervision.phase(), Phase::Starting { step: 0 });
    assert_eq!(supervision.next_ns(), 10 + RETRY_NS);
    assert_eq!(supervision.counters().reset_not_done, 1);
}

#[test]
fn faults_in_a_row_start_the_part_again_and_a_sound_reading_between_does_not() {
    let mut supervision = running();
    for round in 0..3_u64 {
        for _ in 1..FAULTS_IN_A_ROW {
            supervision.fault(round, Fault::Repeated);
        }
        assert_eq!(supervision.phase(), Phase::Running);
        supervision.reading(round, Soundness::Doubtful, 0);
    }
    for _ in 0..FAULTS_IN_A_ROW {
        supervision.fault(3, Fault::Repeated);
    }
    assert_eq!(supervision.phase(), Phase::Starting { step: 0 });
    assert_eq!(supervision.due(3), Due::Step(0));
    assert_eq!(supervision.counters().invalid, 3);
}

#[test]
fn a_part_that_says_again_and_again_that_it_failed_is_started_again() {
    let mut supervision = running();
    for _ in 0..FAULTS_IN_A_ROW {
        supervision.reading(1, Soundness::Failing, 2);
    }
    assert_eq!(supervision.phase(), Phase::Starting { step: 0 });
    assert_eq!(supervision.counters().readings, 5);
    assert_eq!(supervision.counters().missed, 10);
}

#[test]
fn silence_is_a_fault_once_per_span() {
    let mut supervision = running();
    let span_ns = SILENT_INTERVALS * u64::from(INTERVAL_NS);
    assert_eq!(supervision.check_silence(span_ns - 1), Ok(()));
    let fault = supervision.check_silence(span_ns).unwrap_err();
    assert_eq!(fault, Fault::Silent { since_ns: span_ns });
    supervision.fault(span_ns, fault);
    assert_eq!(supervision.next_ns(), 2 * span_ns);
    assert_eq!(supervision.check_silence(span_ns + 1), Ok(()));
}

#[test]
fn a_fault_that_is_not_silence_does_not_put_silence_off() {
    let mut supervision = running();
    let next_ns = supervision.next_ns();
    supervision.fault(1, Fault::Repeated);
    assert_eq!(supervision.next_ns(), next_ns);
}

#[test]
fn times_at_the_end_of_their_numbers_do_not_overflow() {
    let mut supervision = Supervision::new(u32::MAX);
    supervision.started(u64::MAX);
    supervision.reading(u64::MAX, Soundness::Sound, u32::MAX);
    supervision.reading(u64::MAX, Soundness::Sound, u32::MAX);
    assert_eq!(supervision.counters().missed, u32::MAX);
    supervision.fault(u64::MAX, Fault::Overrun);
    supervision.step_done(u64::MAX, u8::MAX, u64::MAX);
    supervision.fault(u64::MAX, Fault::OutOfRange);
    assert_eq!(supervision.next_ns(), u64::MAX);
}
