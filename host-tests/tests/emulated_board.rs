//! The firmware on the emulated Cortex-M7 says what the monitor says on this machine, byte for byte,
//! and fails loudly.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use surefix_core::budget::NoCounter;
use surefix_core::config::Config;
use surefix_core::ingest;
use surefix_core::monitor::{Monitor, Ready};
use surefix_core::report;
use surefix_core::sentences::{self, MAX_SENTENCES_BYTES};
use surefix_core::wire::Counters;
use surefix_core::wire::native::{self, Frame, Kind};
use surefix_host_tests::qemu::{self, Options, Outcome, QemuError, image};
use surefix_host_tests::simulate::{self, flight::Flight, stream::Format};

/// Builds an image; `None`, said aloud, where the chip's target or QEMU is missing.
fn board(features: &[&str]) -> Option<PathBuf> {
    if let Some(missing) = image::missing() {
        eprintln!("SKIPPED: {missing}");
        return None;
    }
    Some(image::build("monitor", features).unwrap())
}

fn native(fill: impl FnOnce(&mut [u8]) -> Result<usize, native::Full>) -> Vec<u8> {
    let mut out = [0; native::MAX_FRAME];
    let length = fill(&mut out).unwrap();
    out[..length].to_vec()
}

/// A whole stream: configuration, `content`, end.
fn stream(content: &[u8]) -> Vec<u8> {
    let config = Config {
        reference_week: Some(simulate::sky::WEEK as u16),
        ..Config::PRESET
    };
    [
        native(|out| ingest::encode_configuration(&config, out)),
        content.to_vec(),
        native(ingest::encode_end_of_stream),
    ]
    .concat()
}

/// A minute of a fixed receiver under a full sky, as RTCM 3.
fn simulated() -> Vec<u8> {
    let simulation = simulate::simulate(&simulate::Args {
        name: Flight::Static,
        seed: 7,
        out: PathBuf::new(),
        rate_hz: 1.0,
        duration: Some(60.0),
        noise_free: false,
        dual_frequency: false,
        no_troposphere: false,
        ionosphere: simulate::atmosphere::Ionosphere::None,
        receiver: Format::Rtcm3,
        faults: Vec::new(),
        disturbances: simulate::disturbances::Disturbances::default(),
    })
    .unwrap();
    simulation.receiver
}

/// The report frames of the monitor on this machine, and its counters.
fn on_this_machine(stream: &[u8]) -> (Vec<Vec<u8>>, Counters) {
    let mut monitor = Box::new(Monitor::EMPTY);
    let mut reports = Vec::new();
    let mut rest = stream;
    loop {
        let (used, ready) = monitor.push(rest);
        rest = &rest[used..];
        match ready {
            Some(Ready::Epoch) => {
                let report = monitor.process(&mut NoCounter);
                reports.push(native(|out| report::encode(&report, out)));
            }
            Some(Ready::EndOfStream) => return (reports, monitor.counters()),
            None => assert!(!rest.is_empty(), "the stream has no end"),
        }
    }
}

struct BoardRun {
    reports: Vec<Vec<u8>>,
    /// Behind each report, and before the next.
    sentences: Vec<Vec<u8>>,
    counters: Option<Counters>,
    withdrawn: bool,
    result: Result<Outcome, QemuError>,
}

fn on_the_board(elf: &Path, stream: &[u8], options: Options) -> BoardRun {
    let mut reports = Vec::new();
    let mut sentences: Vec<Vec<u8>> = Vec::new();
    let mut counters = None;
    let mut withdrawn = false;
    let result = qemu::run(elf, stream, options, &mut |bytes| {
        if bytes.starts_with(b"$") {
            sentences.last_mut().unwrap().extend_from_slice(bytes);
            return;
        }
        let (frame, _) = Frame::parse(bytes).unwrap();
        match frame.kind() {
            Some(Kind::Report) => {
                reports.push(bytes.to_vec());
                sentences.push(Vec::new());
            }
            Some(Kind::Counters) => counters = Some(Counters::decode(frame.payload()).unwrap()),
            Some(Kind::OutputInvalid) => withdrawn = true,
            _ => {}
        }
    });
    BoardRun {
        reports,
        sentences,
        counters,
        withdrawn,
        result,
    }
}

/// INT-007.
#[test]
fn reports_and_counters_equal_those_of_this_machine() {
    let Some(elf) = board(&[]) else { return };
    let stream = stream(&simulated());
    let (expected, expected_counters) = on_this_machine(&stream);
    assert!(expected.len() >= 60, "{} reports", expected.len());
    let board = on_the_board(&elf, &stream, Options::default());
    let outcome = board.result.unwrap();
    println!(
        "{} bytes in {:.2} s, log: {:#?}",
        stream.len(),
        outcome.elapsed.as_secs_f64(),
        outcome.log
    );
    assert_eq!(outcome.stray_bytes, 0);
    assert_eq!(board.reports.len(), expected.len());
    for (index, (ours, theirs)) in expected.iter().zip(&board.reports).enumerate() {
        assert_eq!(ours, theirs, "report {index}");
    }
    for (report, sentences) in board.reports.iter().zip(&board.sentences) {
        let (frame, _) = Frame::parse(report).unwrap();
        let report = report::decode(frame.payload()).unwrap();
        let mut expected = [0; MAX_SENTENCES_BYTES];
        let length = sentences::encode(&report, &mut expected).unwrap();
        assert_eq!(expected[..length], sentences[..]);
    }
    assert_eq!(board.counters, Some(expected_counters));
    assert!(
        outcome
            .log
            .iter()
            .any(|line| line.contains("nominal") || line.contains("Nominal"))
    );
}

#[test]
fn noise_gives_counters_and_no_report() {
    let Some(elf) = board(&[]) else { return };
    // A linear congruential generator's high bytes.
    let mut state = 1_u64;
    let noise: Vec<u8> = (0..40_000)
        .map(|_| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 56) as u8
        })
        .collect();
    let stream = stream(&noise);
    let (_, expected) = on_this_machine(&stream);
    assert!(expected.noise_bytes > 35_000, "{expected:?}");
    let board = on_the_board(&elf, &stream, Options::default());
    board.result.unwrap();
    assert!(board.reports.is_empty());
    // Every byte arrived, whatever its value.
    assert_eq!(board.counters, Some(expected));
}

#[test]
fn a_full_ring_is_counted_and_the_decoder_finds_its_way_back() {
    let Some(elf) = board(&["slow-worker"]) else {
        return;
    };
    let whole = stream(&simulated());
    // Without flow control the ring fills while the worker dawdles.
    let options = Options {
        flow_control: false,
        ..Options::default()
    };
    let end = native(ingest::encode_end_of_stream);
    let flood = [&whole[..whole.len() - end.len()], &end.repeat(6000)].concat();
    let board = on_the_board(&elf, &flood, options);
    board.result.unwrap();
    let counters = board.counters.unwrap();
    println!(
        "lost {} of {} bytes",
        counters.receiver_bytes_lost,
        flood.len()
    );
    assert!(counters.receiver_bytes_lost > 0, "{counters:?}");
    assert!(counters.rtcm_frames > 0, "{counters:?}");
}

/// The memory protection stopped the stack at its end: the status of the fault is one of its four, and
/// the address, where there is one, is close below. Stacking for an interrupt gives no address.
fn assert_overflow(line: &str) {
    let number_after = |name: &str| {
        let (_, rest) = line.split_once(name).unwrap();
        let digits = rest.trim_start_matches("0x").split([',', ' ']).next();
        u32::from_str_radix(digits.unwrap(), 16).unwrap()
    };
    assert_ne!(number_after("status ") & 0x3a, 0, "{line}");
    let address = number_after("address ");
    assert!(
        address == 0 || (0x1fff_fc00..0x2000_0000).contains(&address),
        "{line}"
    );
}

#[test]
fn a_failing_firmware_withdraws_its_output_and_resets() {
    let Some(elf) = board(&["deliberate-fault"]) else {
        return;
    };
    let content = simulated();
    for (request, said) in [
        (b"!PAN", "panic at"),
        (b"!FLT", "hard fault"),
        (b"!STK", "hard fault"),
    ] {
        let half = [
            &stream(&content)[..content.len() / 2],
            request,
            &content[..],
        ]
        .concat();
        let started = Instant::now();
        let board = on_the_board(&elf, &half, Options::default());
        assert!(board.withdrawn, "{:?}", board.result);
        match board.result {
            Err(QemuError::Withdrawn { log, status, .. }) => {
                let line = log.iter().find(|line| line.contains(said));
                let line = line.unwrap_or_else(|| panic!("{log:#?}"));
                if request == b"!STK" {
                    assert_overflow(line);
                }
                // QEMU runs with -no-reboot: only a reset of the chip ends it by itself.
                assert!(status.contains("exit status: 0"), "{status}");
            }
            other => panic!("{other:?}"),
        }
        assert!(!board.reports.is_empty(), "it worked before");
        assert!(started.elapsed() < Duration::from_secs(60));
    }
}

#[test]
fn an_image_that_does_not_answer_is_named_silent() {
    let Some(elf) = board(&[]) else { return };
    let options = Options {
        silence: Duration::from_secs(1),
        ..Options::default()
    };
    // No end of stream: the firmware waits for more, rightly.
    let board = on_the_board(&elf, &[0; 1000], options);
    let error = board.result.unwrap_err();
    assert!(matches!(error, QemuError::Silent { .. }), "{error}");
    assert!(error.to_string().contains("of 1000 input bytes"), "{error}");
}
