//! The simulator's bytes are genuine RTCM 3, say what was simulated, and repeat with their seed.

use std::collections::BTreeSet;

use rtcm_rs::Message;
use rtcm_rs::prelude::MsgFrameIter;
use surefix_core::budget::NoCounter;
use surefix_core::config::{Config, IonosphereModel, TroposphereModel};
use surefix_core::consts::SPEED_OF_LIGHT_MPS;
use surefix_core::gnss::orbit::position_velocity;
use surefix_core::gnss::{NavMessage, Satellite, SignalObservation, System};
use surefix_core::ingest::{Event, Ingest};
use surefix_core::integrity::Integrity;
use surefix_core::monitor::{Monitor, Ready};
use surefix_core::report::EpochReport;
use surefix_host_tests::rtcm_encode::{ephemeris_of, observations_of, quantise};
use surefix_host_tests::simulate::atmosphere::Ionosphere;
use surefix_host_tests::simulate::disturbances::Disturbances;
use surefix_host_tests::simulate::flight::{Flight, c_e_enu};
use surefix_host_tests::simulate::orbit::{clock_offset_s, position_frozen_e};
use surefix_host_tests::simulate::sky::{Sky, WEEK, galileo_fnav};
use surefix_host_tests::simulate::stream::Format;
use surefix_host_tests::simulate::{Args, epochs, simulate};

fn args(name: Flight, seed: u64) -> Args {
    Args {
        name,
        seed,
        out: "unused".into(),
        rate_hz: 1.0,
        duration: None,
        noise_free: false,
        dual_frequency: true,
        no_troposphere: false,
        ionosphere: Ionosphere::None,
        receiver: Format::Rtcm3,
        faults: Vec::new(),
        disturbances: Disturbances::default(),
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_seed_others() {
    let mut short = args(Flight::Approach, 7);
    short.duration = Some(20.0);
    let first = simulate(&short).unwrap();
    assert_eq!(first, simulate(&short).unwrap());
    short.seed = 8;
    let other = simulate(&short).unwrap();
    assert_ne!(first.receiver, other.receiver);
}

/// Fowler, Noll and Vo's hash 1a of 64 bits.
fn fnv1a(bytes: &[u8]) -> u64 {
    let start = 0xcbf2_9ce4_8422_2325;
    bytes.iter().fold(start, |hash: u64, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// Campaigns and figures rest on these bytes: a change has to be meant.
#[test]
fn the_bytes_of_a_simulation_stay_what_they_were() {
    let simulated = simulate(&Args {
        dual_frequency: false,
        ..args(Flight::Approach, 3)
    })
    .unwrap();
    assert_eq!(fnv1a(&simulated.receiver), 0xa18e_8e07_556a_c48b);
    assert_eq!(fnv1a(simulated.truth_csv.as_bytes()), 0x8c30_d920_022e_8924);
}

#[test]
fn ephemerides_of_the_sky_are_what_their_bits_hold() {
    for slot in Sky::new().slots() {
        for issue in [0, 1, 38, 83] {
            let ephemeris = slot.broadcast(issue);
            assert_eq!(quantise(&ephemeris), ephemeris, "{}", slot.satellite);
            if slot.satellite.system() == System::Galileo {
                let fnav = galileo_fnav(&ephemeris);
                let [bgd_e5a_s, bgd_e5b_s] = ephemeris.group_delay_s;
                assert_eq!(
                    fnav.af0_s - fnav.group_delay_s[0],
                    ephemeris.af0_s - bgd_e5b_s
                );
                assert_eq!(fnav.group_delay_s[0], bgd_e5a_s);
            }
        }
    }
}

/// Acceptance 8: bytes decode in rtcm-rs to the same observables, within half a step of MSM7.
#[test]
fn simulated_bytes_decode_to_the_simulated_observables() {
    for flight in [Flight::Approach, Flight::Static] {
        let args = args(flight, 3);
        let bytes = simulate(&args).unwrap().receiver;
        let mut iterator = MsgFrameIter::new(&bytes);
        let mut frames = &mut iterator;
        let mut compared = 0;
        for epoch in epochs(&args).unwrap() {
            let mut decoded: Vec<(Satellite, SignalObservation)> = Vec::new();
            for frame in frames.by_ref() {
                let message = frame.get_message();
                if let Some(ephemeris) = ephemeris_of(&message, WEEK) {
                    let simulated = epoch
                        .ephemerides
                        .iter()
                        .find(|e| e.satellite == ephemeris.satellite)
                        .unwrap();
                    assert!(ephemeris == *simulated || ephemeris == galileo_fnav(simulated));
                }
                if let Message::Msg1006(station) = &message {
                    let truth = epoch.antenna.position_e_m;
                    assert!((station.antenna_ref_point_ecef_x_m - truth.x).abs() < 1e-8);
                    assert!((station.antenna_ref_point_ecef_y_m - truth.y).abs() < 1e-8);
                    assert!((station.antenna_ref_point_ecef_z_m - truth.z).abs() < 1e-8);
                }
                if let Some(msm) = observations_of(&message) {
                    assert_eq!(msm.tow_ns, epoch.observations.time.tow_ns());
                    decoded.extend(msm.observations);
                    if !msm.more {
                        break;
                    }
                }
            }
            let simulated: Vec<_> = epoch
                .observations
                .satellites
                .iter()
                .flat_map(|s| s.signals.iter().map(|signal| (s.satellite, *signal)))
                .collect();
            assert_eq!(decoded.len(), simulated.len());
            let light_ms_m = SPEED_OF_LIGHT_MPS / 1000.0;
            for (satellite, s) in simulated {
                let (_, d) = decoded
                    .iter()
                    .find(|(other, d)| *other == satellite && d.signal == s.signal)
                    .unwrap();
                let range_step_m = light_ms_m / f64::from(1 << 29);
                let range_m = d.pseudorange_m.unwrap() - s.pseudorange_m.unwrap();
                assert!(
                    range_m.abs() <= 0.51 * range_step_m,
                    "{satellite} {range_m}"
                );
                let wavelength_m =
                    SPEED_OF_LIGHT_MPS / s.signal.frequency_hz(satellite.system()).unwrap();
                let phase_step_m = light_ms_m / f64::from(1_u32 << 31);
                let phase_m = wavelength_m
                    * (d.carrier_phase_cycles.unwrap() - s.carrier_phase_cycles.unwrap());
                assert!(
                    phase_m.abs() <= 0.51 * phase_step_m,
                    "{satellite} {phase_m}"
                );
                let rate_mps = d.range_rate_mps.unwrap() - s.range_rate_mps.unwrap();
                assert!(rate_mps.abs() <= 0.51e-4, "{satellite} {rate_mps}");
                assert_eq!(d.cn0_dbhz, s.cn0_dbhz);
                compared += 1;
            }
        }
        assert!(frames.next().is_none());
        println!("{}: {compared} observations compared", flight.name());
        assert!(compared > 10_000);
    }
}

#[test]
fn a_fault_is_on_its_satellite_and_on_no_other() {
    let mut args = args(Flight::Approach, 5);
    args.duration = Some(30.0);
    let clean: Vec<_> = epochs(&args).unwrap().collect();
    args.faults = vec!["C22:step:50:10:20".parse().unwrap()];
    let faulty: Vec<_> = epochs(&args).unwrap().collect();
    let mut touched = 0;
    for (t_s, (clean, faulty)) in clean.iter().zip(&faulty).enumerate() {
        for (a, b) in clean
            .observations
            .satellites
            .iter()
            .zip(&faulty.observations.satellites)
        {
            for (a_signal, b_signal) in a.signals.iter().zip(&b.signals) {
                let difference_m =
                    b_signal.pseudorange_m.unwrap() - a_signal.pseudorange_m.unwrap();
                let due = a.satellite.to_string() == "C22" && (10..20).contains(&t_s);
                assert!((difference_m - if due { 50.0 } else { 0.0 }).abs() < 1e-6);
                touched += usize::from(due);
            }
        }
    }
    assert_eq!(
        touched, 20,
        "C22 is in view of the approach with two signals"
    );
}

#[test]
fn a_fault_that_touches_nothing_is_refused_with_the_satellites_in_view() {
    let mut args = args(Flight::Approach, 5);
    args.duration = Some(20.0);
    for spec in ["G05:step:50:0:10", "C22:step:50:60:100"] {
        args.faults = vec![spec.parse().unwrap()];
        let message = simulate(&args).unwrap_err().to_string();
        assert!(message.contains("in view are G03"), "{message}");
    }
}

#[test]
fn a_scenario_file_says_what_was_simulated() {
    let mut args = args(Flight::Approach, 5);
    args.duration = Some(12.0);
    args.faults = vec!["C22:ramp:0.5:10:20:rr".parse().unwrap()];
    let text = simulate(&args).unwrap().scenario_toml;
    let scenario: toml::Table = text.parse().unwrap();
    assert_eq!(scenario["epochs"].as_integer(), Some(13));
    assert_eq!(scenario["faults"][0]["satellite"].as_str(), Some("C22"));
    assert_eq!(
        scenario["faults"][0]["magnitude_mps"]
            .as_float()
            .or(Some(0.5)),
        Some(0.5)
    );
}

/// Every report of the monitor on these bytes.
fn reports(bytes: &[u8], config: &Config) -> Vec<EpochReport> {
    let mut monitor = Box::new(Monitor::EMPTY);
    monitor.configure(config).unwrap();
    let mut reports = Vec::new();
    let mut rest = bytes;
    while !rest.is_empty() {
        let (used, ready) = monitor.push(rest);
        rest = &rest[used..];
        if ready == Some(Ready::Epoch) {
            reports.push(monitor.process(&mut NoCounter));
        }
    }
    while monitor.finish() == Ready::Epoch {
        reports.push(monitor.process(&mut NoCounter));
    }
    reports
}

/// A configuration that takes out what the simulation puts in.
fn config_for(args: &Args) -> Config {
    Config {
        ionosphere: match (args.dual_frequency, args.ionosphere) {
            (true, _) => IonosphereModel::IonosphereFree,
            (false, Ionosphere::None) => IonosphereModel::None,
            (false, _) => IonosphereModel::Klobuchar,
        },
        troposphere: if args.no_troposphere {
            TroposphereModel::None
        } else {
            TroposphereModel::Saastamoinen
        },
        ..Config::PRESET
    }
}

/// Acceptance 8: through the whole byte path of the receiver a noise-free fix is within 1 cm.
#[test]
fn a_noise_free_fix_is_within_a_centimetre() {
    for flight in [Flight::Approach, Flight::Static] {
        for (dual_frequency, ionosphere, no_troposphere) in [
            (false, Ionosphere::None, true),
            (false, Ionosphere::None, false),
            (false, Ionosphere::Klobuchar, false),
            (false, Ionosphere::KlobucharBds, false),
            (true, Ionosphere::Klobuchar, false),
        ] {
            let args = Args {
                noise_free: true,
                dual_frequency,
                ionosphere,
                no_troposphere,
                duration: (flight == Flight::Static).then_some(60.0),
                ..args(flight, 11)
            };
            let bytes = simulate(&args).unwrap().receiver;
            let reports = reports(&bytes, &config_for(&args));
            let truth: Vec<_> = epochs(&args).unwrap().collect();
            assert_eq!(reports.len(), truth.len());
            let (mut worst_m, mut worst_mps): (f64, f64) = (0.0, 0.0);
            for (report, truth) in reports.iter().zip(&truth) {
                assert_eq!(report.time, truth.observations.time);
                assert_eq!(report.verdict.integrity, Integrity::Nominal);
                let fix = report.fix.expect("a full sky gives a position");
                let error = nalgebra::Vector3::from(fix.r_e_m) - truth.antenna.position_e_m;
                worst_m = worst_m.max(error.norm());
                let to_enu = c_e_enu(fix.lat_deg, fix.lon_deg).transpose();
                let velocity_enu = to_enu * truth.antenna.velocity_e_mps;
                let error = nalgebra::Vector3::from(fix.velocity_enu_mps.unwrap()) - velocity_enu;
                worst_mps = worst_mps.max(error.norm());
            }
            println!(
                "{} {} {ionosphere:?} troposphere {}: position {:.2} mm, velocity {:.3} mm/s",
                flight.name(),
                if dual_frequency {
                    "ionosphere-free"
                } else {
                    "single"
                },
                !no_troposphere,
                1e3 * worst_m,
                1e3 * worst_mps
            );
            assert!(worst_m < 0.01, "{worst_m} m");
            assert!(worst_mps < 0.01, "{worst_mps} m/s");
        }
    }
}

/// Over three hours every satellite changes its ephemeris twice; receiver and simulator change it at
/// the same epoch, also BDS, whose toe lies 14 s later.
#[test]
fn a_change_of_ephemeris_does_not_move_a_noise_free_fix() {
    let args = Args {
        noise_free: true,
        rate_hz: 0.05,
        duration: Some(10_800.0),
        ..args(Flight::Static, 4)
    };
    let reports = reports(&simulate(&args).unwrap().receiver, &config_for(&args));
    let truth: Vec<_> = epochs(&args).unwrap().collect();
    let issues: BTreeSet<_> = truth
        .iter()
        .flat_map(|epoch| &epoch.ephemerides)
        .map(|ephemeris| ephemeris.toe)
        .collect();
    // Three reference times, each of BDS 14 s after those of the others.
    assert_eq!(issues.len(), 6);
    assert_eq!(reports.len(), truth.len());
    for (report, truth) in reports.iter().zip(&truth) {
        let fix = report.fix.expect("a full sky gives a position");
        let error = nalgebra::Vector3::from(fix.r_e_m) - truth.antenna.position_e_m;
        assert!(error.norm() < 0.01, "{} at {:?}", error.norm(), report.time);
    }
}

/// The receiver's own decoder gives back the simulated ephemerides to the last bit.
#[test]
fn decoded_ephemerides_are_the_simulated_ones() {
    let mut args = args(Flight::Static, 2);
    args.duration = Some(0.5);
    let simulated = &epochs(&args).unwrap().next().unwrap().ephemerides;
    let bytes = simulate(&args).unwrap().receiver;
    let mut ingest = Box::new(Ingest::EMPTY);
    let mut rest = &bytes[..];
    let mut decoded = 0;
    loop {
        let (used, event) = ingest.push(rest);
        rest = &rest[used..];
        match event {
            Event::Ephemeris(ephemeris) => {
                let own = simulated
                    .iter()
                    .find(|e| e.satellite == ephemeris.satellite)
                    .unwrap();
                // The week of GPS is known modulo 1024 until a system with the full week tells it.
                let weeks = (own.toe.week() - ephemeris.toe.week()) % 1024;
                assert_eq!(weeks, 0);
                let shift_ns = own.toe.ns() - ephemeris.toe.ns();
                let mut ephemeris = ephemeris;
                if ephemeris.satellite.system() == System::Gps {
                    ephemeris.toe = ephemeris.toe.plus_ns(shift_ns);
                    ephemeris.toc = ephemeris.toc.plus_ns(shift_ns);
                }
                if ephemeris.message == NavMessage::GalileoFnav {
                    assert_eq!(ephemeris, galileo_fnav(own));
                } else {
                    assert_eq!(ephemeris, *own);
                }
                decoded += 1;
            }
            Event::Nothing if rest.is_empty() => break,
            _ => {}
        }
    }
    let galileo = simulated
        .iter()
        .filter(|e| e.satellite.system() == System::Galileo)
        .count();
    assert_eq!(decoded, simulated.len() + galileo);
}

/// Two evaluations of the same elements that share no code: the receiver's in rotating axes at
/// transmission, the simulator's in axes frozen at reception.
#[test]
fn the_receivers_orbits_are_the_simulators() {
    let mut worst_m: f64 = 0.0;
    for slot in Sky::new().slots() {
        for issue in [0, 38, 83] {
            let ephemeris = slot.broadcast(issue);
            for since_toe_s in [-3600.0, -612.5, 0.0, 1234.567, 3600.0] {
                let core = position_velocity(&ephemeris, since_toe_s).unwrap();
                let reference = position_frozen_e(&ephemeris, since_toe_s, since_toe_s);
                let difference = reference - nalgebra::Vector3::from(core.r_e_m);
                worst_m = worst_m.max(difference.norm());
                let clock_s = clock_offset_s(&ephemeris, since_toe_s, since_toe_s);
                let polynomial_s = ephemeris.af0_s + ephemeris.af1_sps * since_toe_s;
                let core_s = polynomial_s + core.relativity_s;
                assert!((clock_s - core_s).abs() < 1e-15, "{}", slot.satellite);
            }
        }
    }
    println!("largest difference of two orbit evaluations: {worst_m:.2e} m");
    assert!(worst_m < 1e-6, "{worst_m}");
}
