//! The snapshot solution on simulated skies without noise: exact where it can be, refusing where not.

use proptest::prelude::*;
use surefix_core::config::{Config, IonosphereModel, NoisePreset, TroposphereModel};
use surefix_core::consts::SPEED_OF_LIGHT_MPS;
use surefix_core::frames::geodesy::{self, Llh};
use surefix_core::gnss::atmosphere::{troposphere_mapping, troposphere_zenith_m};
use surefix_core::gnss::clock::group_delay_s;
use surefix_core::gnss::klobuchar::SkyPoint;
use surefix_core::gnss::measurement::{
    Measurement, measure, predicted_pseudorange_m, predicted_range_rate_mps, range_geometry,
};
use surefix_core::gnss::satellite::SystemSet;
use surefix_core::gnss::signal::FREQUENCY_L1_HZ;
use surefix_core::gnss::solution::{
    SatelliteReason, SnapshotError, SnapshotSolution, SnapshotWorkspace,
};
use surefix_core::gnss::{
    BroadcastIonosphere, Ephemeris, EphemerisStore, KlobucharParameters, NavMessage,
    ObservationEpoch, Satellite, SatelliteObservation, SatelliteSet, Signal, SignalObservation,
    System,
};
use surefix_core::raim::monitors::doppler::{DopplerConfig, DopplerMonitor};
use surefix_core::raim::monitors::{EpochMonitor, Outcome};
use surefix_core::time::GpsTime;

const TIME: GpsTime = GpsTime::from_week_tow_s(2300, 200_000);

fn satellite(system: System, prn: u8) -> Satellite {
    Satellite::new(system, prn).unwrap()
}

fn signal(name: &str) -> Signal {
    let bytes = name.as_bytes();
    Signal::new(bytes[0], bytes[1]).unwrap()
}

/// Sixteen satellites per system, evenly over four planes; group delays and clocks differ.
fn constellation() -> Vec<Ephemeris> {
    let mut ephemerides = Vec::new();
    for system in System::ALL {
        for place in 0..16_u8 {
            // PRN from 11: BDS MEO, no GEO.
            let satellite = satellite(system, 11 + place);
            let (plane, slot) = (f64::from(place / 4), f64::from(place % 4));
            let (message, sqrt_a) = match system {
                System::Gps => (NavMessage::GpsLnav, 5153.7),
                System::Galileo => (NavMessage::GalileoInav, 5440.6),
                System::Bds => (NavMessage::BdsD1D2, 5282.6),
            };
            let quarter = std::f64::consts::FRAC_PI_2;
            ephemerides.push(Ephemeris {
                satellite,
                message,
                toe: TIME.plus_ns(-600_000_000_000),
                toc: TIME.plus_ns(-600_000_000_000),
                toe_sow_s: 199_400.0,
                issue: 1,
                sqrt_a,
                eccentricity: 0.001 * (1.0 + slot),
                i0_rad: 0.96,
                idot_radps: 1.0e-10,
                omega0_rad: quarter * plane + 0.3 * system.index() as f64,
                omega_dot_radps: -8.0e-9,
                argument_of_perigee_rad: 0.5,
                m0_rad: quarter * slot + 0.4 * plane + 0.7 * system.index() as f64,
                delta_n_radps: 4.0e-9,
                cuc_rad: 1.0e-6,
                cus_rad: 2.0e-6,
                crc_m: 200.0,
                crs_m: 50.0,
                cic_rad: 1.0e-7,
                cis_rad: 1.0e-7,
                af0_s: 1.0e-5 * (f64::from(place) - 7.5),
                af1_sps: 1.0e-12,
                af2_sps2: 0.0,
                group_delay_s: [3.0e-9 + 1.0e-10 * slot, -4.0e-9 + 1.0e-10 * plane],
                sigma_ura_m: Some(2.0),
                health: 0,
            });
        }
    }
    ephemerides
}

const KLOBUCHAR: KlobucharParameters = KlobucharParameters {
    system: System::Gps,
    alpha: [1.0e-8, 1.5e-8, -6.0e-8, -6.0e-8],
    beta: [8.0e4, 6.5e4, -6.5e4, -3.9e5],
};

/// A receiver and its sky.
struct Scene {
    truth: Llh,
    r_e: [f64; 3],
    v_e: [f64; 3],
    clock_m: [f64; 3],
    drift_mps: f64,
    config: Config,
    store: Box<EphemerisStore>,
    ionosphere: BroadcastIonosphere,
    epoch: ObservationEpoch,
    workspace: Box<SnapshotWorkspace>,
}

impl Scene {
    fn at(lat_deg: f64, lon_deg: f64, height_m: f64, config: Config) -> Self {
        let truth = Llh {
            lat_rad: lat_deg.to_radians(),
            lon_rad: lon_deg.to_radians(),
            height_m,
        };
        let mut store = Box::new(EphemerisStore::EMPTY);
        for ephemeris in constellation() {
            store.insert(&ephemeris).unwrap();
        }
        let mut ionosphere = BroadcastIonosphere::EMPTY;
        assert!(ionosphere.insert(KLOBUCHAR));
        let mut scene = Self {
            truth,
            r_e: geodesy::to_ecef(&truth).into(),
            v_e: [120.0, -80.0, 35.0],
            clock_m: [12_345.0, 12_340.0, 12_380.0],
            drift_mps: 45.0,
            config,
            store,
            ionosphere,
            epoch: ObservationEpoch::EMPTY,
            workspace: Box::new(SnapshotWorkspace::EMPTY),
        };
        scene.observe();
        scene
    }

    /// What a perfect receiver measures of every satellite above the horizon.
    fn observe(&mut self) {
        self.epoch.restart(TIME);
        for ephemeris in constellation() {
            let satellite = ephemeris.satellite;
            let (first, second) = match satellite.system() {
                System::Gps => ("1W", "2W"),
                System::Galileo => ("1C", "7Q"),
                System::Bds => ("2I", "6I"),
            };
            // GPS has both L1 signals, with the same delay.
            let names = if satellite.system() == System::Gps {
                vec!["1C", first, second]
            } else {
                vec![first, second]
            };
            let Some((measurement, pseudorange_m, delay_l1_m)) =
                self.pseudorange(&ephemeris, names[0])
            else {
                continue;
            };
            let rate_mps =
                predicted_range_rate_mps(&measurement, self.r_e, self.v_e, self.drift_mps);
            let delay = |name: &str| {
                let frequency_hz = signal(name).frequency_hz(satellite.system()).unwrap();
                delay_l1_m * (FREQUENCY_L1_HZ / frequency_hz).powi(2)
                    + SPEED_OF_LIGHT_MPS * group_delay_s(&ephemeris, signal(name)).unwrap()
            };
            for name in &names {
                let mut observation = SignalObservation::new(signal(name));
                observation.pseudorange_m = Some(pseudorange_m + delay(name) - delay(names[0]));
                observation.range_rate_mps = Some(rate_mps);
                self.epoch.add(satellite, observation).unwrap();
            }
        }
    }

    /// Measurement, pseudorange and ionospheric delay on L1 of one signal; `None` below the horizon.
    fn pseudorange(&self, ephemeris: &Ephemeris, name: &str) -> Option<(Measurement, f64, f64)> {
        let mut observation = SatelliteObservation {
            satellite: ephemeris.satellite,
            signals: Default::default(),
        };
        observation
            .signals
            .push(SignalObservation::new(signal(name)))
            .ok()?;
        let mut pseudorange_m = 2.2e7;
        let clock_m = self.clock_m[ephemeris.satellite.system().index()];
        let mut found = None;
        // The time of transmission depends on the pseudorange, by 10⁻⁵ of it.
        for _ in 0..6 {
            observation.signals[0].pseudorange_m = Some(pseudorange_m);
            let measurement = measure(&observation, TIME, &self.store, false).unwrap();
            let u_e = range_geometry(measurement.r_e_m, self.r_e).line_of_sight_e;
            let rotation = geodesy::c_enu_e(self.truth.lat_rad, self.truth.lon_rad);
            let direction = geodesy::direction(&(rotation * nalgebra::Vector3::from(u_e)));
            if direction.elevation_rad < 0.0 {
                return None;
            }
            let at = SkyPoint {
                lat_rad: self.truth.lat_rad,
                lon_rad: self.truth.lon_rad,
                azimuth_rad: direction.azimuth_rad,
                elevation_rad: direction.elevation_rad,
            };
            let ionosphere_m = match self.config.ionosphere {
                IonosphereModel::None => 0.0,
                IonosphereModel::Klobuchar => {
                    KLOBUCHAR.delay_s(TIME, &at, FREQUENCY_L1_HZ).unwrap() * SPEED_OF_LIGHT_MPS
                }
                // Larger than any model: it must go away entirely.
                IonosphereModel::IonosphereFree => 30.0 / direction.elevation_rad.sin().max(0.1),
            };
            let troposphere_m = match self.config.troposphere {
                TroposphereModel::None => 0.0,
                TroposphereModel::Saastamoinen => {
                    troposphere_zenith_m(self.truth.lat_rad, self.truth.height_m)
                        * troposphere_mapping(direction.elevation_rad.sin())
                }
            };
            let delay_m = ionosphere_m * measurement.ionosphere_scale + troposphere_m;
            pseudorange_m = predicted_pseudorange_m(&measurement, self.r_e, clock_m, delay_m);
            found = Some((measurement, pseudorange_m, ionosphere_m));
        }
        found
    }

    fn solve(&mut self, start: Option<[f64; 3]>) -> Result<SnapshotSolution, SnapshotError> {
        self.solve_without(SatelliteSet::EMPTY, start)
    }

    fn solve_without(
        &mut self,
        excluded: SatelliteSet,
        start: Option<[f64; 3]>,
    ) -> Result<SnapshotSolution, SnapshotError> {
        self.workspace
            .prepare(&self.epoch, &self.store, &self.ionosphere, &self.config);
        self.workspace.solve(excluded, start)
    }

    fn error_m(&self, solution: &SnapshotSolution) -> f64 {
        distance_m(solution.r_e_m, self.r_e)
    }

    /// Changes the pseudoranges of one observed satellite.
    fn spoil(&mut self, index: usize, value_m: f64) -> Satellite {
        let count = self.epoch.satellites.len();
        let observation = &mut self.epoch.satellites[index % count];
        for signal in &mut observation.signals {
            signal.pseudorange_m = Some(value_m);
        }
        observation.satellite
    }

    fn keep(&mut self, wanted: impl Fn(Satellite) -> bool) {
        let all = self.epoch.clone();
        self.epoch.restart(TIME);
        for observation in &all.satellites {
            if wanted(observation.satellite) {
                for signal in &observation.signals {
                    self.epoch.add(observation.satellite, *signal).unwrap();
                }
            }
        }
    }
}

fn distance_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).powi(2))
        .sum::<f64>()
        .sqrt()
}

fn config(ionosphere: IonosphereModel) -> Config {
    Config {
        ionosphere,
        ..Config::PRESET
    }
}

fn unused(solution: &SnapshotSolution, reason: SatelliteReason) -> u8 {
    solution.unused[reason as usize]
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 64,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn a_sky_without_noise_solves_to_a_millimetre(
        lat_deg in -89.9..89.9_f64,
        lon_deg in -180.0..180.0_f64,
        height_m in -400.0..15_000.0_f64,
        model in 0..3_usize,
        airborne in any::<bool>(),
    ) {
        let models = [IonosphereModel::None, IonosphereModel::Klobuchar, IonosphereModel::IonosphereFree];
        let mut config = config(models[model]);
        if airborne {
            config.noise = NoisePreset::Airborne;
        }
        let mut scene = Scene::at(lat_deg, lon_deg, height_m, config);
        let cold = scene.solve(None).unwrap();
        prop_assert!(scene.error_m(&cold) < 1e-3, "{}", scene.error_m(&cold));
        for (found_m, truth_m) in cold.clock_m.iter().zip(scene.clock_m) {
            prop_assert!((found_m.unwrap() - truth_m).abs() < 1e-3);
        }
        let v_enu = geodesy::c_enu_e(cold.llh.lat_rad, cold.llh.lon_rad)
            * nalgebra::Vector3::from(scene.v_e);
        prop_assert!(distance_m(cold.velocity_enu_mps.unwrap(), v_enu.into()) < 2e-3);
        prop_assert!((cold.clock_drift_mps.unwrap() - scene.drift_mps).abs() < 2e-3);
        // The model is linearised at the solution: its residuals are those of a perfect epoch.
        let model = scene.workspace.model();
        prop_assert_eq!(model.n, cold.used.len());
        prop_assert_eq!(model.m, 6);
        prop_assert!(model.residual_m[..model.n].iter().all(|r| r.abs() < 1e-3));
        // From a place within reach, and from the other side of the Earth, it is the same place.
        for start in [scene.r_e.map(|x| x + 3_000.0), scene.r_e.map(|x| -x)] {
            let warm = scene.solve(Some(start)).unwrap();
            prop_assert!(distance_m(warm.r_e_m, cold.r_e_m) < 1e-3);
            prop_assert_eq!(warm.used, cold.used);
        }
        let counted: u32 = cold.unused.iter().map(|count| u32::from(*count)).sum();
        prop_assert_eq!(counted as usize + cold.used.len(), usize::from(cold.n_observed));
    }

    #[test]
    fn numbers_that_are_no_distance_are_left_out_and_counted(
        index in any::<usize>(),
        value_m in prop_oneof![
            Just(f64::NAN), Just(f64::INFINITY), Just(f64::NEG_INFINITY), Just(0.0), Just(-2.2e7),
            Just(1.0e300), 1.0e8..1.0e12_f64, 0.0..9.0e6_f64,
        ],
    ) {
        let mut scene = Scene::at(47.0, 9.0, 400.0, config(IonosphereModel::Klobuchar));
        let spoiled = scene.spoil(index, value_m);
        let solution = scene.solve(None).unwrap();
        prop_assert!(!solution.used.contains(spoiled));
        prop_assert_eq!(unused(&solution, SatelliteReason::ImplausiblePseudorange), 1);
        prop_assert!(scene.error_m(&solution) < 1e-3);
    }

    /// INT-004.
    #[test]
    fn any_pseudoranges_end_in_a_place_on_earth_or_in_a_reason(
        values_m in prop::collection::vec(1.0e7..6.0e7_f64, 48),
        spoiled in prop::collection::vec(any::<bool>(), 48),
        with_start in any::<bool>(),
    ) {
        let mut scene = Scene::at(-20.0, 130.0, 100.0, config(IonosphereModel::Klobuchar));
        for index in 0..scene.epoch.satellites.len() {
            if spoiled[index] {
                scene.spoil(index, values_m[index]);
            }
        }
        let start = with_start.then_some(scene.r_e);
        match scene.solve(start) {
            Ok(solution) => {
                prop_assert!((-10_000.0..=100_000.0).contains(&solution.llh.height_m));
                let model = scene.workspace.model();
                prop_assert!(model.residual_m[..model.n].iter().all(|r| r.is_finite()));
                prop_assert!(model.sigma_m[..model.n].iter().all(|s| *s > 0.0 && s.is_finite()));
            }
            Err(_) => prop_assert_eq!(scene.workspace.model().n, 0),
        }
    }

    #[test]
    fn solving_again_without_satellites_is_solving_an_epoch_without_them(
        left_out in prop::collection::vec(any::<usize>(), 1..4),
    ) {
        let mut scene = Scene::at(60.0, -150.0, 50.0, config(IonosphereModel::Klobuchar));
        // Noise, so that leaving a satellite out moves the position.
        for (index, observation) in scene.epoch.satellites.iter_mut().enumerate() {
            for signal in &mut observation.signals {
                signal.pseudorange_m = signal.pseudorange_m.map(|p| p + 3.0 * (index as f64).sin());
            }
        }
        let all = scene.solve(None).unwrap();
        let mut excluded = SatelliteSet::EMPTY;
        for index in left_out {
            let count = all.used.len();
            excluded.insert(all.used.iter().nth(index % count).unwrap());
        }
        let again = scene.workspace.solve(excluded, Some(all.r_e_m)).unwrap();
        prop_assert_eq!(usize::from(unused(&again, SatelliteReason::FaultExcluded)), excluded.len());
        prop_assert!(distance_m(again.r_e_m, all.r_e_m) > 1e-3);
        scene.keep(|satellite| !excluded.contains(satellite));
        let fresh = scene.solve(None).unwrap();
        prop_assert_eq!(fresh.used, again.used);
        prop_assert!(distance_m(fresh.r_e_m, again.r_e_m) < 2e-3);
    }
}

/// INT-004.
#[test]
fn fewer_satellites_than_unknowns_are_refused() {
    let mut scene = Scene::at(47.0, 9.0, 400.0, config(IonosphereModel::Klobuchar));
    let full = scene.solve(None).unwrap();
    let gps: Vec<Satellite> = full
        .used
        .iter()
        .filter(|satellite| satellite.system() == System::Gps)
        .collect();
    let bds: Vec<Satellite> = full
        .used
        .iter()
        .filter(|satellite| satellite.system() == System::Bds)
        .collect();
    let mut with = |wanted: &[Satellite]| {
        scene.observe();
        scene.keep(|satellite| wanted.contains(&satellite));
        scene.solve(None)
    };
    assert_eq!(
        with(&gps[..3]),
        Err(SnapshotError::TooFewSatellites {
            satellites: 3,
            unknowns: 4
        })
    );
    assert_eq!(
        with(&[]),
        Err(SnapshotError::TooFewSatellites {
            satellites: 0,
            unknowns: 3
        })
    );
    // Two and two are four rows for five unknowns.
    let two_and_two = [gps[0], gps[1], bds[0], bds[1]];
    assert_eq!(
        with(&two_and_two),
        Err(SnapshotError::TooFewSatellites {
            satellites: 4,
            unknowns: 5
        })
    );
    // A satellite alone in its system gives its clock and no position: it stays out.
    let mut alone = gps[..4].to_vec();
    alone.push(bds[0]);
    let solution = with(&alone).unwrap();
    assert_eq!(solution.used.len(), 4);
    assert_eq!(unused(&solution, SatelliteReason::AloneInSystem), 1);
    assert_eq!(solution.clock_m[System::Bds.index()], None);
    assert_eq!(scene.workspace.model().m, 4);
}

/// INT-004.
#[test]
fn satellites_that_stand_in_one_place_are_bad_geometry() {
    let mut scene = Scene::at(47.0, 9.0, 400.0, config(IonosphereModel::None));
    let template = scene.epoch.satellites[0].clone();
    let place = constellation()
        .into_iter()
        .find(|ephemeris| ephemeris.satellite == template.satellite)
        .unwrap();
    scene.epoch.restart(TIME);
    for prn in 1..=8 {
        let satellite = satellite(System::Gps, prn);
        scene
            .store
            .insert(&Ephemeris { satellite, ..place })
            .unwrap();
        for signal in &template.signals {
            scene.epoch.add(satellite, *signal).unwrap();
        }
    }
    assert_eq!(scene.solve(None), Err(SnapshotError::BadGeometry));
    let start = scene.r_e;
    assert_eq!(scene.solve(Some(start)), Err(SnapshotError::BadGeometry));
}

#[test]
fn without_four_range_rates_there_is_no_velocity() {
    let mut scene = Scene::at(47.0, 9.0, 400.0, config(IonosphereModel::Klobuchar));
    let used: Vec<Satellite> = scene.solve(None).unwrap().used.iter().collect();
    for (with_rate, expected) in [(0, false), (3, false), (5, true)] {
        scene.observe();
        let mut left = with_rate;
        for observation in &mut scene.epoch.satellites {
            let keep = left > 0 && used.contains(&observation.satellite);
            if keep {
                left -= 1;
                continue;
            }
            for signal in &mut observation.signals {
                signal.range_rate_mps = None;
            }
        }
        let solution = scene.solve(None).unwrap();
        assert_eq!(solution.velocity_enu_mps.is_some(), expected, "{with_rate}");
        assert_eq!(solution.clock_drift_mps.is_some(), expected);
        assert!(scene.error_m(&solution) < 1e-3);
    }
}

/// INT-009.
#[test]
fn every_reason_for_leaving_a_satellite_out_is_counted() {
    let mut scene = Scene::at(47.0, 9.0, 400.0, config(IonosphereModel::Klobuchar));
    let full = scene.solve(None).unwrap();
    let below = unused(&full, SatelliteReason::BelowMask);
    let find = |satellite: Satellite| {
        constellation()
            .into_iter()
            .find(|ephemeris| ephemeris.satellite == satellite)
            .unwrap()
    };
    let used: Vec<Satellite> = full.used.iter().collect();
    let mut store = Box::new(EphemerisStore::EMPTY);
    for ephemeris in constellation() {
        let satellite = ephemeris.satellite;
        if satellite == used[0] {
            continue;
        }
        let mut changed = find(satellite);
        if satellite == used[1] {
            changed.health = 1;
        } else if satellite == used[2] {
            changed.toe = changed.toe.plus_ns(-8 * 3_600_000_000_000);
        } else if satellite == used[3] {
            changed.sigma_ura_m = None;
        }
        store.insert(&changed).unwrap();
    }
    scene.store = store;
    for observation in &mut scene.epoch.satellites {
        if observation.satellite == used[4] {
            for signal in &mut observation.signals {
                signal.pseudorange_m = None;
            }
        }
    }
    let solution = scene.solve(None).unwrap();
    for (reason, expected) in [
        (SatelliteReason::NoEphemeris, 1),
        (SatelliteReason::Unhealthy, 1),
        (SatelliteReason::StaleEphemeris, 1),
        (SatelliteReason::NoAccuracy, 1),
        (SatelliteReason::NoPseudorange, 1),
        (SatelliteReason::BelowMask, below),
    ] {
        assert_eq!(unused(&solution, reason), expected, "{}", reason.name());
    }
    assert_eq!(solution.used.len() + 5, full.used.len());
    scene.config.systems = SystemSet::EMPTY.with(System::Galileo);
    let galileo = scene.solve(None).unwrap();
    assert!(unused(&galileo, SatelliteReason::SystemNotSelected) > 5);
    assert!(
        galileo
            .used
            .iter()
            .all(|satellite| satellite.system() == System::Galileo)
    );
    scene.config = config(IonosphereModel::IonosphereFree);
    for observation in &mut scene.epoch.satellites {
        if observation.satellite == used[5] {
            observation.signals.pop();
        }
    }
    let pairs = scene.solve(None).unwrap();
    assert_eq!(unused(&pairs, SatelliteReason::NoSignalPair), 1);
}

#[test]
fn without_ionosphere_parameters_there_is_a_flag_and_a_larger_sigma() {
    let mut scene = Scene::at(47.0, 9.0, 400.0, config(IonosphereModel::Klobuchar));
    let with = scene.solve(None).unwrap();
    let sigmas = |scene: &Scene| -> Vec<f64> {
        scene
            .workspace
            .used_rows()
            .map(|row| row.sigma.total_m())
            .collect()
    };
    let corrected = sigmas(&scene);
    scene.ionosphere = BroadcastIonosphere::EMPTY;
    let without = scene.solve(None).unwrap();
    assert!(!with.no_broadcast_ionosphere && without.no_broadcast_ionosphere);
    assert_eq!(with.used, without.used);
    for (uncorrected_m, corrected_m) in sigmas(&scene).iter().zip(&corrected) {
        assert!(uncorrected_m > corrected_m);
    }
    scene.config = config(IonosphereModel::IonosphereFree);
    assert!(!scene.solve(None).unwrap().no_broadcast_ionosphere);
    assert!(
        scene
            .workspace
            .used_rows()
            .all(|row| row.sigma.common_m == 0.0)
    );
}

/// INT-145. Every satellite's range rate in turn is wrong by 10 m/s while its pseudorange is right: the position does
/// not know, the fit of the solution tells, and the monitor names the satellite and gives the velocity without it.
#[test]
fn int_145_a_wrong_range_rate_is_named_and_the_velocity_is_that_of_the_others() {
    let mut scene = Scene::at(47.0, 9.0, 400.0, config(IonosphereModel::Klobuchar));
    let mut monitor = Box::new(DopplerMonitor::EMPTY);
    monitor.configure(&DopplerConfig::FREE_SKY).unwrap();
    let healthy = scene.solve(None).unwrap();
    let true_mps: [f64; 3] = (geodesy::c_enu_e(scene.truth.lat_rad, scene.truth.lon_rad)
        * nalgebra::Vector3::from(scene.v_e))
    .into();
    let fit = healthy.rate_fit.unwrap();
    assert_eq!(fit.redundancy, healthy.used.len() - 4);
    assert!(fit.sum_of_squares.abs() < 0.1, "{fit:?}");
    let verdict = monitor.assess_velocity(&scene.workspace);
    assert_eq!(verdict.outcome, Outcome::Passed);
    let velocity_mps = verdict.position_enu_m.unwrap();
    // East, north, up of where the sky was computed, up to 0.25 m away.
    assert!(distance_m(velocity_mps, healthy.velocity_enu_mps.unwrap()) < 1e-4);
    assert!((verdict.statistic.unwrap() - fit.sum_of_squares).abs() < 1e-4);
    for faulty in healthy.used.iter() {
        scene.observe();
        for observation in &mut scene.epoch.satellites {
            for signal in &mut observation.signals {
                if observation.satellite == faulty
                    && let Some(rate_mps) = &mut signal.range_rate_mps
                {
                    *rate_mps += 10.0;
                }
            }
        }
        let solution = scene.solve(None).unwrap();
        assert!(scene.error_m(&solution) < 1e-3);
        let fit = solution.rate_fit.unwrap();
        let verdict = monitor.assess_velocity(&scene.workspace);
        assert!(fit.sum_of_squares > verdict.threshold.unwrap(), "{fit:?}");
        assert_eq!(verdict.outcome, Outcome::Excluded, "{faulty:?}");
        let named = monitor.satellites(verdict.excluded);
        assert!(named.contains(faulty) && named.len() == 1, "{faulty:?}");
        assert!(distance_m(verdict.position_enu_m.unwrap(), true_mps) < 2e-3);
        assert!(distance_m(solution.velocity_enu_mps.unwrap(), true_mps) > 0.01);
    }
}
