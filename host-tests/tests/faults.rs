//! Injected faults follow their models, and bad specifications are refused with the right form.

use surefix_core::gnss::{ObservationEpoch, Satellite, Signal, SignalObservation, System};
use surefix_core::time::GpsTime;
use surefix_host_tests::faults::{FaultInjector, FaultKind, FaultSpec};

const PSEUDORANGE_M: f64 = 22_000_000.0;

fn epoch() -> ObservationEpoch {
    let mut epoch = ObservationEpoch::EMPTY;
    epoch.restart(GpsTime::from_week_tow_s(2111, 345_600));
    for prn in [5, 6] {
        for signal in [Signal::C1C, Signal::new(b'2', b'W').unwrap()] {
            let mut observation = SignalObservation::new(signal);
            observation.pseudorange_m = Some(PSEUDORANGE_M);
            observation.range_rate_mps = Some(100.0);
            observation.carrier_phase_cycles = Some(1e8);
            let satellite = Satellite::new(System::Gps, prn).unwrap();
            epoch.add(satellite, observation).unwrap();
        }
    }
    epoch
}

/// Error in m and rate in m/s on G05 at each second of 0..n.
fn errors(spec: &str, seed: u64, n: usize) -> Vec<(f64, f64)> {
    let spec: FaultSpec = spec.parse().unwrap();
    let mut injector = FaultInjector::new(&[spec], seed);
    (0..n)
        .map(|t| {
            let mut epoch = epoch();
            injector.apply(&mut epoch, t as f64);
            let (g05, g06) = (&epoch.satellites[0], &epoch.satellites[1]);
            assert!(g06.signals.iter().all(|s| {
                s.pseudorange_m == Some(PSEUDORANGE_M) && s.range_rate_mps == Some(100.0)
            }));
            assert_eq!(g05.signals[0].pseudorange_m, g05.signals[1].pseudorange_m);
            assert_eq!(g05.signals[0].carrier_phase_cycles, Some(1e8));
            (
                g05.signals[0].pseudorange_m.unwrap() - PSEUDORANGE_M,
                g05.signals[0].range_rate_mps.unwrap() - 100.0,
            )
        })
        .collect()
}

#[test]
fn a_step_stands_from_t0_up_to_t1() {
    let errors = errors("G05:step:50:2:4:rr", 1, 6);
    let expected = [0.0, 0.0, 50.0, 50.0, 0.0, 0.0].map(|e| (e, 0.0));
    assert_eq!(errors, expected);
}

#[test]
fn a_ramp_grows_and_its_rate_is_on_the_range_rate_only_when_asked() {
    let with = errors("G05:ramp:0.5:2:9:rr", 1, 5);
    assert_eq!(
        with,
        [(0.0, 0.0), (0.0, 0.0), (0.0, 0.5), (0.5, 0.5), (1.0, 0.5)]
    );
    let without = errors("G05:ramp:0.5:2:9", 1, 5);
    assert!(without.iter().all(|(_, rate)| *rate == 0.0));
    assert_eq!(without[4].0, 1.0);
}

#[test]
fn an_oscillation_has_its_period_and_its_derivative() {
    let errors = errors("G05:osc:8:0:100:rr:40", 1, 41);
    assert!((errors[10].0 - 8.0).abs() < 1e-8 && errors[10].1.abs() < 1e-8);
    assert!((errors[30].0 + 8.0).abs() < 1e-8);
    let rate = 8.0 * core::f64::consts::TAU / 40.0;
    assert!((errors[0].1 - rate).abs() < 1e-8 && errors[0].0 == 0.0);
}

#[test]
fn noise_is_white_with_its_sigma_and_repeats_with_its_seed() {
    let n = 20_000;
    let noise = errors("G05:noise:3:0:1e9", 7, n);
    let mean = noise.iter().map(|e| e.0).sum::<f64>() / n as f64;
    let var = noise.iter().map(|e| e.0 * e.0).sum::<f64>() / n as f64;
    let lag = noise.windows(2).map(|w| w[0].0 * w[1].0).sum::<f64>() / n as f64 / var;
    // Five sigma of each estimate.
    assert!(mean.abs() < 0.11 && (var / 9.0 - 1.0).abs() < 0.05 && lag.abs() < 0.036);
    assert_eq!(noise, errors("G05:noise:3:0:1e9", 7, n));
    assert_ne!(noise, errors("G05:noise:3:0:1e9", 8, n));
}

#[test]
fn the_variance_of_a_walk_grows_with_time() {
    let ends: Vec<f64> = (0..2_000)
        .map(|seed| errors("G05:walk:2:0:1e9", seed, 26)[25].0)
        .collect();
    let var = ends.iter().map(|e| e * e).sum::<f64>() / ends.len() as f64;
    // 2² m²/s for 25 s; five sigma of a variance of 2,000 samples is 16 %.
    assert!((var / 100.0 - 1.0).abs() < 0.16, "{var}");
    assert_eq!(errors("G05:walk:2:0:1e9", 3, 1)[0].0, 0.0);
}

#[test]
fn specifications_are_read_or_refused_with_the_form() {
    let spec: FaultSpec = "C03:ramp:-0.63:11:140:rr".parse().unwrap();
    assert_eq!(spec.satellite, Satellite::new(System::Bds, 3).unwrap());
    assert_eq!((spec.kind, spec.magnitude), (FaultKind::Ramp, -0.63));
    assert!(spec.on_range_rate);
    for spec in [
        "C03:ramp:-0.63:11:140:rr",
        "G05:osc:8:0:100:rr:40",
        "E11:walk:2:0.5:9",
    ] {
        assert_eq!(spec.parse::<FaultSpec>().unwrap().to_string(), spec);
    }
    for bad in [
        "",
        "G05",
        "G05:step:50:0",
        "G5:step:50:0:1",
        "R05:step:50:0:1",
        "G33:step:50:0:1",
        "G05:jump:50:0:1",
        "G05:step:fifty:0:1",
        "G05:step:NaN:0:1",
        "G05:step:50:10:5",
        "G05:step:50:0:1:20",
        "G05:osc:50:0:1:0",
        "G05:step:50:0:1:rr:rr",
    ] {
        let message = bad.parse::<FaultSpec>().unwrap_err().to_string();
        assert!(message.contains("SAT:KIND:MAG:T0:T1"), "{message}");
    }
}
