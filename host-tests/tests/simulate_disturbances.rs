//! Outages, clock jumps, multipath and the error of the ionosphere are what their arguments ask for.
//!
//! What was put on is the difference of two simulations without noise, with it and without, so its size
//! is known to a micrometre. Sigmas and correlations are estimated from values that are independent or as
//! good as, and held against the bounds that a right simulator misses with a chance of 1e-6; the seeds
//! are fixed.

use std::collections::{BTreeMap, BTreeSet};

use rtcm_rs::prelude::MsgFrameIter;
use surefix_core::budget::NoCounter;
use surefix_core::config::{Config, IonosphereModel};
use surefix_core::consts::SPEED_OF_LIGHT_MPS;
use surefix_core::gnss::signal::FREQUENCY_L1_HZ;
use surefix_core::gnss::{ObservationEpoch, Satellite, SignalObservation};
use surefix_core::ingest::{Event, Ingest};
use surefix_core::monitor::{Monitor, Ready};
use surefix_host_tests::rtcm_encode::observations_of;
use surefix_host_tests::simulate::atmosphere::Ionosphere;
use surefix_host_tests::simulate::disturbances::{
    ClockJump, DisturbanceError, Disturbances, Outage, Process,
};
use surefix_host_tests::simulate::flight::Flight;
use surefix_host_tests::simulate::inertial::board::{Radio, receiver_bytes};
use surefix_host_tests::simulate::inertial::{Request, Scenario, fly};
use surefix_host_tests::simulate::receiver::Epoch;
use surefix_host_tests::simulate::stream::Format;
use surefix_host_tests::simulate::{Args, epochs, simulate};

/// Normal quantile of 5e-7: both tails together are 1e-6.
const BOUND: f64 = 4.9;

fn args(name: Flight, duration_s: f64, disturbances: Disturbances) -> Args {
    Args {
        name,
        seed: 5,
        out: "unused".into(),
        rate_hz: 1.0,
        duration: Some(duration_s),
        noise_free: true,
        dual_frequency: true,
        no_troposphere: false,
        ionosphere: Ionosphere::None,
        receiver: Format::Rtcm3,
        faults: Vec::new(),
        disturbances,
    }
}

fn outages(specs: &[&str]) -> Disturbances {
    Disturbances {
        outages: specs.iter().map(|spec| spec.parse().unwrap()).collect(),
        ..Disturbances::default()
    }
}

fn jumps(specs: &[&str]) -> Disturbances {
    Disturbances {
        clock_jumps: specs.iter().map(|spec| spec.parse().unwrap()).collect(),
        ..Disturbances::default()
    }
}

fn multipath(spec: &str) -> Disturbances {
    Disturbances {
        multipath: Some(spec.parse().unwrap()),
        ..Disturbances::default()
    }
}

fn ionosphere_error(spec: &str) -> Disturbances {
    Disturbances {
        ionosphere_error: Some(spec.parse().unwrap()),
        ..Disturbances::default()
    }
}

fn run(args: &Args) -> Vec<Epoch> {
    epochs(args).unwrap().collect()
}

fn calm(args: &Args) -> Vec<Epoch> {
    run(&Args {
        disturbances: Disturbances::default(),
        ..args.clone()
    })
}

fn satellites(epoch: &ObservationEpoch) -> BTreeSet<Satellite> {
    epoch.satellites.iter().map(|s| s.satellite).collect()
}

/// Pairs of the same signal in two epochs, the second without disturbances.
fn pairs<'a>(
    disturbed: &'a ObservationEpoch,
    calm: &'a ObservationEpoch,
) -> impl Iterator<Item = (Satellite, &'a SignalObservation, &'a SignalObservation)> {
    disturbed.satellites.iter().flat_map(|of_satellite| {
        let other = calm.get(of_satellite.satellite).unwrap();
        of_satellite.signals.iter().map(|signal| {
            let same = other.signal(signal.signal).unwrap();
            (of_satellite.satellite, signal, same)
        })
    })
}

fn code_error_m(a: &SignalObservation, b: &SignalObservation) -> f64 {
    a.pseudorange_m.unwrap() - b.pseudorange_m.unwrap()
}

/// Sigma by chi-square, correlation by the mean product, of independent pairs of normalised values.
fn check_process(what: &str, pairs: &[(f64, f64)], correlation: f64) {
    let n = pairs.len() as f64;
    let square = pairs.iter().map(|(a, _)| a * a).sum::<f64>() / n;
    let product = pairs.iter().map(|(a, b)| a * b).sum::<f64>() / n;
    let square_bound = BOUND * (2.0 / n).sqrt();
    let product_bound = BOUND * ((1.0 + correlation * correlation) / n).sqrt();
    println!(
        "{what}: {n} values, variance {square:.3} ± {square_bound:.3}, correlation {product:.3}, {correlation:.3} ± {product_bound:.3} due"
    );
    assert!(n >= 500.0, "{what}");
    assert!((square - 1.0).abs() < square_bound, "{what}");
    assert!((product - correlation).abs() < product_bound, "{what}");
}

#[test]
fn arguments_that_make_no_sense_are_refused_by_kind() {
    let outage = |spec: &str| spec.parse::<Outage>().unwrap_err();
    let jump = |spec: &str| spec.parse::<ClockJump>().unwrap_err();
    let process = |spec: &str| spec.parse::<Process>().unwrap_err();
    for spec in [
        "",
        "G05",
        "G05:1",
        "G05:1:x",
        "G05:1:nan",
        "G05:1:2:3",
        "all:1:inf",
    ] {
        assert!(
            matches!(outage(spec), DisturbanceError::Form { .. }),
            "{spec}"
        );
    }
    for spec in ["X05:1:2", "G33:1:2", "G00:1:2", ":1:2"] {
        assert!(
            matches!(outage(spec), DisturbanceError::Satellite(_)),
            "{spec}"
        );
    }
    for spec in ["G05:2:2", "G05:3:2", "all:-1:2"] {
        assert!(matches!(outage(spec), DisturbanceError::Times(_)), "{spec}");
    }
    for spec in ["", "5", "5:x", "5:1:1", "nan:1"] {
        assert!(
            matches!(jump(spec), DisturbanceError::Form { .. }),
            "{spec}"
        );
    }
    for spec in ["5:0", "5:0.5", "5:61", "5:-61", "5:1e12"] {
        assert!(matches!(jump(spec), DisturbanceError::Jump(_)), "{spec}");
    }
    assert!(matches!(jump("-5:1"), DisturbanceError::Times(_)));
    for spec in ["", "1", "1:x", "1:2:3", "inf:5"] {
        assert!(
            matches!(process(spec), DisturbanceError::Form { .. }),
            "{spec}"
        );
    }
    for spec in ["0:60", "-1:60", "1:0", "1:-60", "1001:60"] {
        assert!(
            matches!(process(spec), DisturbanceError::Process(_)),
            "{spec}"
        );
    }
    for spec in ["G05:1:2.5", "all:0:2"] {
        assert_eq!(spec.parse::<Outage>().unwrap().to_string(), spec);
    }
    assert_eq!(
        "30.5:-2".parse::<ClockJump>().unwrap().to_string(),
        "30.5:-2"
    );
}

#[test]
fn what_would_do_nothing_is_refused() {
    for (asked, word) in [
        (outages(&["all:21:30"]), "after the last epoch"),
        (jumps(&["20.5:1"]), "after the last epoch"),
        (jumps(&["1:40", "2:40"]), "60"),
        (outages(&["G05:1:9"]), "hides nothing"),
        (outages(&["G03:1.2:1.8"]), "hides nothing"),
    ] {
        let refused = simulate(&args(Flight::Static, 20.0, asked.clone())).unwrap_err();
        assert!(refused.to_string().contains(word), "{refused}");
        let refused = fly(&Request {
            duration_s: Some(20),
            disturbances: asked,
            ..Request::new(Flight::Npa, 1)
        });
        let refused = refused.err().unwrap().to_string();
        // G05 may be in view of another place.
        assert!(refused.contains(word), "{refused}");
    }
}

#[test]
fn an_outage_hides_its_satellite_and_no_other_and_tracking_begins_anew() {
    let args = args(Flight::Approach, 30.0, outages(&["G03:5:12", "all:20:23"]));
    let g03: Satellite = surefix_host_tests::faults::parse_satellite("G03").unwrap();
    for (t_s, (epoch, calm)) in run(&args).iter().zip(&calm(&args)).enumerate() {
        let mut due = satellites(&calm.observations);
        if (5..12).contains(&t_s) {
            assert!(due.remove(&g03), "in view of the approach");
        }
        if (20..23).contains(&t_s) {
            due.clear();
        }
        assert_eq!(satellites(&epoch.observations), due, "{t_s} s");
        for (_, a, b) in pairs(&epoch.observations, &calm.observations) {
            assert_eq!(a, b);
        }
        for (of_satellite, lock_ms) in epoch.observations.satellites.iter().zip(&epoch.lock_ms) {
            let since_s = match t_s {
                23.. => t_s - 23,
                12.. if of_satellite.satellite == g03 => t_s - 12,
                _ => t_s,
            };
            assert_eq!(*lock_ms, 1000 * since_s as u64);
        }
    }
}

#[test]
fn an_outage_of_a_flight_is_in_its_folder_and_its_stream() {
    let flown = fly(&Request {
        duration_s: Some(20),
        disturbances: outages(&["G04:5:12", "all:15:17"]),
        ..Request::new(Flight::Npa, 1)
    })
    .unwrap();
    let stream = decoded(&flown);
    assert_eq!(stream.len(), 21);
    for (epoch, sent) in flown.epochs.iter().zip(&stream) {
        let rows: BTreeSet<_> = epoch.rows.iter().map(|r| r.measurement.satellite).collect();
        let has_g04 = rows.iter().any(|s| s.to_string() == "G04");
        let silent = (15.0..17.0).contains(&epoch.t_s);
        assert_eq!(has_g04, !(5.0..12.0).contains(&epoch.t_s) && !silent);
        assert_eq!(rows.is_empty(), silent);
        assert_eq!(satellites(sent), rows);
    }
}

/// Epochs of a flight's UBX stream as core reads them.
fn decoded(flown: &Scenario) -> Vec<ObservationEpoch> {
    let radio = Radio {
        dual_frequency: true,
        ionosphere: Ionosphere::None,
        troposphere: true,
        format: Format::Ubx,
    };
    let bytes = receiver_bytes(flown, &radio).unwrap();
    let mut ingest = Box::new(Ingest::EMPTY);
    let mut rest = &bytes[..];
    let mut all = Vec::new();
    loop {
        let (used, event) = ingest.push(rest);
        rest = &rest[used..];
        match event {
            Event::EpochReady => all.push(ingest.epoch().clone()),
            Event::Nothing if rest.is_empty() => return all,
            _ => {}
        }
    }
}

/// A jump of n ms adds n light milliseconds; as the receiver measures that much earlier or later, also what
/// ranges and satellite clocks change by in n ms: under 1 m each.
#[test]
fn a_clock_jump_is_whole_milliseconds_on_all_and_flagged_once() {
    let args = args(Flight::Approach, 12.0, jumps(&["4:1", "8:-3"]));
    for (t_s, (epoch, calm)) in run(&args).iter().zip(&calm(&args)).enumerate() {
        let due_ms = match t_s {
            0..4 => 0.0,
            4..8 => 1.0,
            _ => -2.0,
        };
        for (_, a, b) in pairs(&epoch.observations, &calm.observations) {
            let left_m = code_error_m(a, b) - due_ms * 1e-3 * SPEED_OF_LIGHT_MPS;
            assert!(left_m.abs() <= 1.1 * f64::abs(due_ms), "{left_m} m");
            let rate_mps = a.range_rate_mps.unwrap() - b.range_rate_mps.unwrap();
            assert!(rate_mps.abs() < 1e-2, "{rate_mps} m/s");
        }
        assert_eq!(epoch.observations.flags.clock_reset, t_s == 4 || t_s == 8);
    }
}

/// Both formats carry the jumps, UBX its flag, and a fix without noise stays where it is.
#[test]
fn core_rides_over_clock_jumps_of_both_formats() {
    for format in [Format::Rtcm3, Format::Ubx] {
        let args = Args {
            receiver: format,
            ..args(Flight::Static, 70.0, jumps(&["50:1", "60:-2"]))
        };
        let bytes = simulate(&args).unwrap().receiver;
        let config = Config {
            ionosphere: IonosphereModel::IonosphereFree,
            ..Config::PRESET
        };
        let mut monitor = Box::new(Monitor::EMPTY);
        monitor.configure(&config).unwrap();
        let mut rest = &bytes[..];
        let (mut fixes, mut worst_m): (_, f64) = (0, 0.0);
        let truth = run(&args)[0].antenna.position_e_m;
        let mut take = |monitor: &mut Monitor| {
            if let Some(fix) = monitor.process(&mut NoCounter).fix {
                worst_m = worst_m.max((nalgebra::Vector3::from(fix.r_e_m) - truth).norm());
                fixes += 1;
            }
        };
        while !rest.is_empty() {
            let (used, ready) = monitor.push(rest);
            rest = &rest[used..];
            if ready == Some(Ready::Epoch) {
                take(&mut monitor);
            }
        }
        while monitor.finish() == Ready::Epoch {
            take(&mut monitor);
        }
        println!("{format:?}: {fixes} fixes, {:.2} mm", 1e3 * worst_m);
        assert!(fixes > 45 && worst_m < 0.01, "{worst_m}");
        if format == Format::Ubx {
            let flagged: Vec<f64> = reset_times(&bytes);
            assert_eq!(flagged, [274_249.998, 274_259.998]);
        }
    }
}

/// Times of RXM-RAWX whose clock was reset, by the ublox crate.
fn reset_times(bytes: &[u8]) -> Vec<f64> {
    use ublox::proto27::{PacketRef, Proto27};
    let mut parser = ublox::ParserBuilder::new()
        .with_protocol::<Proto27>()
        .with_vec_buffer();
    let mut packets = parser.consume_ubx(bytes);
    let mut times = Vec::new();
    while let Some(packet) = packets.next() {
        if let Ok(ublox::UbxPacket::Proto27(PacketRef::RxmRawx(rawx))) = packet
            && rawx.rec_stat().bits() & 2 != 0
        {
            times.push(rawx.rcv_tow());
        }
    }
    times
}

/// In the folder of a flight too: pseudoranges and the true clock.
#[test]
fn a_clock_jump_of_a_flight_is_in_its_truth_and_its_stream() {
    let request = Request {
        duration_s: Some(12),
        ..Request::new(Flight::Npa, 1)
    };
    let calm = fly(&request).unwrap();
    let flown = fly(&Request {
        disturbances: jumps(&["5:2"]),
        ..request
    })
    .unwrap();
    let light_ms_m = SPEED_OF_LIGHT_MPS / 1000.0;
    for (a, b) in flown.truth.iter().zip(&calm.truth) {
        let due_m = if a.t_s < 5.0 { 0.0 } else { 2.0 * light_ms_m };
        assert!((a.clock.0 - b.clock.0 - due_m).abs() < 1e-6);
    }
    for (a, b) in flown.epochs.iter().zip(&calm.epochs) {
        let due_m = if a.t_s < 5.0 { 0.0 } else { 2.0 * light_ms_m };
        for (a, b) in a.rows.iter().zip(&b.rows) {
            let jumped_m = a.measurement.pseudorange_m - b.measurement.pseudorange_m;
            assert!((jumped_m - due_m).abs() < 1e-5, "{jumped_m}");
        }
    }
    for (k, (a, b)) in decoded(&flown).iter().zip(&decoded(&calm)).enumerate() {
        let due_m = if k < 5 { 0.0 } else { 2.0 * light_ms_m };
        assert_eq!(a.flags.clock_reset, k == 5);
        for (_, a, b) in pairs(a, b) {
            assert!((code_error_m(a, b) - due_m).abs() < 2.2);
        }
    }
}

/// Errors of every signal, epoch by epoch, of a receiver on the move.
fn multipath_errors(seed: u64, spec: &str) -> Vec<BTreeMap<(Satellite, String), f64>> {
    let args = Args {
        seed,
        ..args(Flight::Approach, 240.0, multipath(spec))
    };
    let of_epoch = |(epoch, calm): (&Epoch, &Epoch)| {
        pairs(&epoch.observations, &calm.observations)
            .map(|(satellite, a, b)| {
                assert_eq!(a.carrier_phase_cycles, b.carrier_phase_cycles);
                assert_eq!(a.range_rate_mps, b.range_rate_mps);
                ((satellite, a.signal.to_string()), code_error_m(a, b))
            })
            .collect()
    };
    run(&args).iter().zip(&calm(&args)).map(of_epoch).collect()
}

/// Values 30 s apart are independent to e⁻⁵.
#[test]
fn multipath_has_its_sigma_and_correlation_on_every_signal_apart() {
    let flights: Vec<_> = (0..4).map(|seed| multipath_errors(seed, "0.8:6")).collect();
    let starts = || (0..230).step_by(30);
    for lag in [1, 6, 9] {
        let mut values = Vec::new();
        for errors in &flights {
            for start in starts() {
                for (key, value) in &errors[start] {
                    let later = errors[start + lag].get(key);
                    values.extend(later.map(|later| (value / 0.8, later / 0.8)));
                }
            }
        }
        let correlation = (-(lag as f64) / 6.0).exp();
        check_process(&format!("multipath over {lag} s"), &values, correlation);
    }
    // Two signals of a satellite, and two satellites, have nothing in common.
    let mut between = Vec::new();
    for errors in &flights {
        for start in starts() {
            let values: Vec<f64> = errors[start].values().copied().collect();
            between.extend(values.windows(2).map(|pair| (pair[0] / 0.8, pair[1] / 0.8)));
        }
    }
    check_process("multipath between signals", &between, 0.0);
}

/// In a flight with an inertial unit the folder and the stream have the same.
#[test]
fn multipath_of_a_flight_is_in_its_folder_and_its_stream() {
    let request = Request {
        duration_s: Some(400),
        noise_free: true,
        galileo: true,
        ..Request::new(Flight::P4Flight, 3)
    };
    let calm = fly(&request).unwrap();
    let flown = fly(&Request {
        disturbances: multipath("1.5:4"),
        ..request
    })
    .unwrap();
    let mut errors: Vec<BTreeMap<Satellite, f64>> = Vec::new();
    for (a, b) in flown.epochs.iter().zip(&calm.epochs) {
        let rows = a.rows.iter().zip(&b.rows);
        errors.push(
            rows.map(|(a, b)| {
                let (a, b) = (&a.measurement, &b.measurement);
                assert_eq!(a.satellite, b.satellite);
                (a.satellite, a.pseudorange_m - b.pseudorange_m)
            })
            .collect(),
        );
    }
    let mut values = Vec::new();
    for start in (0..390).step_by(20) {
        for (satellite, value) in &errors[start] {
            let later = errors[start + 4].get(satellite);
            values.extend(later.map(|later| (value / 1.5, later / 1.5)));
        }
    }
    check_process("multipath of a flight over 4 s", &values, (-1.0_f64).exp());
    let (mut seconds, mut alike) = (0, 0);
    for ((a, b), folder) in decoded(&flown).iter().zip(&decoded(&calm)).zip(&errors) {
        for (satellite, a_signal, b_signal) in pairs(a, b) {
            let error_m = code_error_m(a_signal, b_signal);
            let first = a.get(satellite).unwrap().signals[0].signal == a_signal.signal;
            let same = (error_m - folder[&satellite]).abs() < 1e-4;
            if first {
                assert!(same, "{satellite}");
            } else {
                seconds += 1;
                alike += usize::from(same);
            }
        }
    }
    // The second signal has multipath of its own, which agrees to 0.1 mm by chance in 2e-5 of cases.
    assert!(seconds > 5000 && alike < 10, "{alike} of {seconds}");
}

/// Obliquity of a thin shell, by the sine of the zenith angle at the pierce point.
fn obliquity(elevation_rad: f64) -> f64 {
    let at_shell = (6378.1363 * elevation_rad.cos() / (6378.1363 + 350.0)).asin();
    1.0 / at_shell.cos()
}

/// Elevation of a satellite by core's own orbit.
fn elevation_rad(epoch: &Epoch, satellite: Satellite) -> f64 {
    let ephemeris = epoch
        .ephemerides
        .iter()
        .find(|e| e.satellite == satellite)
        .unwrap();
    let sent_s = epoch.observations.time.seconds_since(ephemeris.toe) - 0.08;
    let at = surefix_core::gnss::orbit::position_velocity(ephemeris, sent_s).unwrap();
    let antenna = epoch.antenna.position_e_m;
    let line = (nalgebra::Vector3::from(at.r_e_m) - antenna).normalize();
    // Up of the ellipsoid: 0.2° off the direction from the centre at most.
    let (lat, lon, _) = surefix_host_tests::simulate::flight::geodetic_from_ecef(&antenna);
    let up = nalgebra::Vector3::new(lat.cos() * lon.cos(), lat.cos() * lon.sin(), lat.sin());
    line.dot(&up).asin()
}

/// One number in the zenith explains the error of every satellite and signal, so that the covariance of
/// two is σ²·F_i·F_j; the code is delayed and the phase advanced.
#[test]
fn the_error_of_the_ionosphere_is_common_to_all_satellites() {
    let args = args(Flight::Approach, 30.0, ionosphere_error("2:100"));
    let mut compared = 0;
    for (epoch, calm) in run(&args).iter().zip(&calm(&args)) {
        let mut zenith_m = None;
        for (satellite, a, b) in pairs(&epoch.observations, &calm.observations) {
            let frequency = a.signal.frequency_hz(satellite.system()).unwrap();
            let on_l1 = (frequency / FREQUENCY_L1_HZ).powi(2);
            let slant_m = code_error_m(a, b) * on_l1;
            let here_m = slant_m / obliquity(elevation_rad(epoch, satellite));
            let zenith_m: f64 = *zenith_m.get_or_insert(here_m);
            // The elevation is that of 80 ms before: 1e-5 rad.
            assert!(
                (here_m / zenith_m - 1.0).abs() < 1e-3,
                "{here_m} {zenith_m}"
            );
            let wavelength_m = SPEED_OF_LIGHT_MPS / frequency;
            let advance_m =
                wavelength_m * (b.carrier_phase_cycles.unwrap() - a.carrier_phase_cycles.unwrap());
            assert!((advance_m * on_l1 - slant_m).abs() < 1e-5);
            assert_eq!(a.range_rate_mps, b.range_rate_mps);
            compared += 1;
        }
    }
    assert!(compared > 1000);
}

/// One value of the zenith at a time; values 100 s apart are independent to e⁻⁵.
#[test]
fn the_error_of_the_ionosphere_has_its_sigma_and_correlation() {
    let mut values = Vec::new();
    for seed in 0..75 {
        let args = Args {
            seed,
            rate_hz: 0.05,
            dual_frequency: false,
            ..args(Flight::Static, 800.0, ionosphere_error("1.2:20"))
        };
        let of_epoch = |(epoch, calm): (&Epoch, &Epoch)| {
            let (satellite, a, b) = pairs(&epoch.observations, &calm.observations)
                .find(|(_, a, _)| a.signal.band() == b'1')
                .unwrap();
            code_error_m(a, b) / obliquity(elevation_rad(epoch, satellite)) / 1.2
        };
        let zenith: Vec<f64> = run(&args).iter().zip(&calm(&args)).map(of_epoch).collect();
        values.extend(zenith.chunks_exact(5).map(|five| (five[0], five[1])));
    }
    check_process("ionosphere over 20 s", &values, (-1.0_f64).exp());
}

#[test]
fn the_error_of_the_ionosphere_of_a_flight_is_in_its_folder_and_its_stream() {
    let request = Request {
        duration_s: Some(20),
        noise_free: true,
        ..Request::new(Flight::Npa, 3)
    };
    let calm = fly(&request).unwrap();
    let flown = fly(&Request {
        disturbances: ionosphere_error("3:600"),
        ..request
    })
    .unwrap();
    let stream = decoded(&flown);
    let calm_stream = decoded(&calm);
    let mut largest_m: f64 = 0.0;
    for (k, (a, b)) in flown.epochs.iter().zip(&calm.epochs).enumerate() {
        let mut zenith_m = None;
        for (a, b) in a.rows.iter().zip(&b.rows) {
            let satellite = a.measurement.satellite;
            let slant_m = a.measurement.pseudorange_m - b.measurement.pseudorange_m;
            let here_m = slant_m / obliquity(a.elevation_rad);
            let zenith_m: f64 = *zenith_m.get_or_insert(here_m);
            assert!((here_m - zenith_m).abs() < 1e-6);
            largest_m = largest_m.max(slant_m.abs());
            let (sent, calm_sent) = (&stream[k], &calm_stream[k]);
            for signal in &sent.get(satellite).unwrap().signals {
                let same = calm_sent.get(satellite).unwrap().signal(signal.signal);
                let frequency = signal.signal.frequency_hz(satellite.system()).unwrap();
                let due_m = slant_m * (FREQUENCY_L1_HZ / frequency).powi(2);
                assert!((code_error_m(signal, same.unwrap()) - due_m).abs() < 1e-4);
            }
        }
    }
    assert!(largest_m > 0.1, "{largest_m}");
}

/// What is asked for is the same for the same seed, and changes nothing else; the bytes carry it.
#[test]
fn disturbances_repeat_with_their_seed_and_change_no_other_error() {
    let all = Disturbances {
        multipath: Some("0.5:30".parse().unwrap()),
        ..ionosphere_error("1:300")
    };
    let mut args = args(Flight::Approach, 15.0, all);
    args.noise_free = false;
    let first = simulate(&args).unwrap();
    assert_eq!(first, simulate(&args).unwrap());
    let text: toml::Table = first.scenario_toml.parse().unwrap();
    assert_eq!(text["multipath"]["tau_s"].as_integer(), Some(30));
    assert_eq!(text["ionosphere_error"]["sigma_m"].as_integer(), Some(1));
    assert!(
        !text.contains_key("multipath_tau_s"),
        "that of DO-229 is replaced"
    );

    // Of the white noise and the rest nothing changed: without noise it is the same difference.
    let with_both = run(&args);
    args.disturbances.ionosphere_error = None;
    let with_multipath = run(&args);
    args.noise_free = true;
    let multipath_alone = run(&args);
    args.disturbances.ionosphere_error = Some("1:300".parse().unwrap());
    let both_alone = run(&args);
    for k in 0..with_both.len() {
        let noisy = pairs(&with_both[k].observations, &with_multipath[k].observations);
        let silent = pairs(
            &both_alone[k].observations,
            &multipath_alone[k].observations,
        );
        for ((_, a, b), (_, c, d)) in noisy.zip(silent) {
            assert!((code_error_m(a, b) - code_error_m(c, d)).abs() < 1e-6);
        }
    }

    // MSM7 says what was simulated, within half a step.
    let mut frames = MsgFrameIter::new(&first.receiver);
    let mut iterator = &mut frames;
    for epoch in &with_both {
        let mut sent = Vec::new();
        for frame in iterator.by_ref() {
            if let Some(msm) = observations_of(&frame.get_message()) {
                sent.extend(msm.observations);
                if !msm.more {
                    break;
                }
            }
        }
        for of_satellite in &epoch.observations.satellites {
            for signal in &of_satellite.signals {
                let (_, read) = sent
                    .iter()
                    .find(|(s, read)| *s == of_satellite.satellite && read.signal == signal.signal)
                    .unwrap();
                assert!(code_error_m(read, signal).abs() < 3e-4);
            }
        }
    }
}

/// Every kind of fault goes through the simulator, on its own satellite of a moving receiver.
#[test]
fn five_kinds_of_faults_are_on_a_simulated_receiver() {
    let mut args = args(Flight::Approach, 60.0, Disturbances::default());
    let calm = run(&args);
    let satellites: Vec<Satellite> = satellites(&calm[0].observations).into_iter().collect();
    let kinds = ["step:50", "ramp:2", "noise:3", "walk:4", "osc:5"];
    for (kind, satellite) in kinds.iter().zip(&satellites) {
        let period = if *kind == "osc:5" { ":20" } else { "" };
        let spec = format!("{satellite}:{kind}:10:50{period}");
        args.faults.push(spec.parse().unwrap());
    }
    let mut errors = vec![Vec::new(); satellites.len()];
    for (epoch, calm) in run(&args).iter().zip(&calm) {
        for (satellite, a, b) in pairs(&epoch.observations, &calm.observations) {
            if a.signal.band() == b'1' || a.signal.to_string() == "2I" {
                let place = satellites.iter().position(|s| *s == satellite);
                errors[place.unwrap()].push(code_error_m(a, b));
            }
        }
    }
    for (k, errors) in errors.iter().enumerate() {
        assert_eq!(errors.len(), 61);
        for (t_s, error_m) in errors.iter().enumerate() {
            let since_s = t_s as f64 - 10.0;
            let due_m = match k {
                _ if !(10..50).contains(&t_s) => Some(0.0),
                0 => Some(50.0),
                1 => Some(2.0 * since_s),
                4 => Some(5.0 * (core::f64::consts::TAU * since_s / 20.0).sin()),
                2 | 3 => None,
                _ => Some(0.0),
            };
            assert!(due_m.is_none_or(|due_m| (error_m - due_m).abs() < 1e-6));
        }
        let at_fault = &errors[10..50];
        let mean_square =
            |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64;
        // Chi-square of 40 degrees: within a factor of 3 with more than 1 - 1e-6.
        if k == 2 {
            assert!((3.0..27.0).contains(&mean_square(at_fault)), "noise");
        }
        if k == 3 {
            let steps: Vec<f64> = at_fault.windows(2).map(|w| w[1] - w[0]).collect();
            assert!((16.0 / 3.0..48.0).contains(&mean_square(&steps)), "walk");
        }
    }
}
