//! `gnss`.

use crate::call::{call1, call2, call3, call4};
use core::hint::black_box;
use surefix_core::config::{Config, NoisePreset};
use surefix_core::gnss::klobuchar::{self, BroadcastIonosphere, KlobucharParameters, SkyPoint};
use surefix_core::gnss::measurement::SatelliteReason;
use surefix_core::gnss::satellite::SystemSet;
use surefix_core::gnss::solution::SnapshotWorkspace;
use surefix_core::gnss::weights::{IonosphereResidual, RowConditions, RowSigma};
use surefix_core::gnss::{Ephemeris, EphemerisStore, FixQuality, NavMessage};
use surefix_core::gnss::{
    ObservationEpoch, Satellite, SatelliteObservation, SatelliteSet, Signal, SignalObservation,
    System,
};
use surefix_core::gnss::{atmosphere, clock, measurement, orbit, store, weights};
use surefix_core::time::GpsTime;

const TIME: GpsTime = GpsTime::from_ns(0);

pub const PARAMETERS: KlobucharParameters = KlobucharParameters {
    system: System::Gps,
    alpha: [0.0; 4],
    beta: [0.0; 4],
};

pub const EPHEMERIS: Ephemeris = Ephemeris {
    satellite: match Satellite::new(System::Gps, 1) {
        Some(satellite) => satellite,
        None => panic!("G01 exists"),
    },
    message: NavMessage::GpsLnav,
    toe: TIME,
    toc: TIME,
    toe_sow_s: 0.0,
    issue: 0,
    sqrt_a: 0.0,
    eccentricity: 0.0,
    i0_rad: 0.0,
    idot_radps: 0.0,
    omega0_rad: 0.0,
    omega_dot_radps: 0.0,
    argument_of_perigee_rad: 0.0,
    m0_rad: 0.0,
    delta_n_radps: 0.0,
    cuc_rad: 0.0,
    cus_rad: 0.0,
    crc_m: 0.0,
    crs_m: 0.0,
    cic_rad: 0.0,
    cis_rad: 0.0,
    af0_s: 0.0,
    af1_sps: 0.0,
    af2_sps2: 0.0,
    group_delay_s: [0.0; 2],
    sigma_ura_m: None,
    health: 0,
};

pub fn all() {
    satellites();
    observations();
    ionosphere();
    ephemerides();
    measurements();
    solution();
}

fn satellites() {
    call1(System::letter, System::Gps);
    call1(System::from_letter, 'G');
    call1(System::index, System::Gps);
    call1(System::from_index, 0);
    call1(System::max_prn, System::Gps);
    call2(Satellite::new, System::Gps, 0);
    call1(Satellite::from_index, 0);
    let mut set = SatelliteSet::EMPTY;
    call1(SatelliteSet::from_masks, [0; 3]);
    if let Some(satellite) = Satellite::from_index(black_box(0)) {
        call1(Satellite::system, satellite);
        call1(Satellite::prn, satellite);
        call1(Satellite::index, satellite);
        call1(Satellite::is_bds_geo, satellite);
        call2(SatelliteSet::insert, &mut set, satellite);
        call2(SatelliteSet::remove, &mut set, satellite);
        call2(SatelliteSet::contains, &set, satellite);
    }
    call1(SatelliteSet::masks, &set);
    call1(SatelliteSet::len, &set);
    call1(SatelliteSet::is_empty, &set);
    call1(
        |set| SatelliteSet::iter(set).map(Satellite::index).sum::<usize>(),
        &set,
    );
    call1(SystemSet::from_bits, 0);
    call1(SystemSet::bits, SystemSet::ALL);
    call2(SystemSet::with, SystemSet::ALL, System::Gps);
    call2(SystemSet::contains, SystemSet::ALL, System::Gps);
    call1(SystemSet::len, SystemSet::ALL);
    call1(SystemSet::is_empty, SystemSet::ALL);
}

fn observations() {
    call2(Signal::new, b'1', b'C');
    call1(FixQuality::from_u8, 1);
    call1(Signal::band, Signal::C1C);
    call1(Signal::attribute, Signal::C1C);
    call2(Signal::frequency_hz, Signal::C1C, System::Gps);
    call1(SignalObservation::new, Signal::C1C);
    let mut epoch = ObservationEpoch::EMPTY;
    call2(ObservationEpoch::restart, &mut epoch, TIME);
    if let Some(satellite) = Satellite::from_index(black_box(0)) {
        let observation = SignalObservation::new(Signal::C1C);
        call3(ObservationEpoch::add, &mut epoch, satellite, observation);
        call2(ObservationEpoch::get, &epoch, satellite);
    }
    if let Some(satellite) = epoch.satellites.first() {
        call2(SatelliteObservation::signal, satellite, Signal::C1C);
    }
}

fn ionosphere() {
    let at = SkyPoint {
        lat_rad: 0.0,
        lon_rad: 0.0,
        azimuth_rad: 0.0,
        elevation_rad: 0.0,
    };
    let parameters = black_box(PARAMETERS);
    call4(KlobucharParameters::delay_s, &parameters, TIME, &at, 1.0);
    call1(klobuchar::geomagnetic_latitude_rad, &at);
    let mut broadcast = BroadcastIonosphere::EMPTY;
    call2(BroadcastIonosphere::insert, &mut broadcast, parameters);
    call1(BroadcastIonosphere::parameters, &broadcast);
    call2(atmosphere::troposphere_zenith_m, 0.0, 0.0);
    call1(atmosphere::troposphere_mapping, 0.0);
    call1(atmosphere::ionosphere_mapping, 0.0);
}

fn ephemerides() {
    let ephemeris = black_box(EPHEMERIS);
    let (satellite, message) = (ephemeris.satellite, ephemeris.message);
    call1(orbit::check, &ephemeris);
    call2(orbit::position_velocity, &ephemeris, 0.0);
    call2(clock::polynomial, &ephemeris, 0.0);
    call2(clock::group_delay_s, &ephemeris, Signal::C1C);
    call2(clock::ionosphere_free_factors, 1.0, 2.0);
    call1(store::max_age_ns, System::Gps);
    let mut store = EphemerisStore::EMPTY;
    call2(EphemerisStore::insert, &mut store, &ephemeris);
    call4(EphemerisStore::select, &store, satellite, message, TIME);
    let preference: &[NavMessage] = &[message];
    call4(
        EphemerisStore::select_preferred,
        &store,
        satellite,
        preference,
        TIME,
    );
    call2(EphemerisStore::shift_weeks, &mut store, 0);
    call1(EphemerisStore::len, &store);
    call1(EphemerisStore::is_empty, &store);
    call1(EphemerisStore::clear, &mut store);
}

fn measurements() {
    let store = EphemerisStore::EMPTY;
    let observation = SatelliteObservation {
        satellite: EPHEMERIS.satellite,
        signals: Default::default(),
    };
    call4(measurement::measure, &observation, TIME, &store, true);
    if let Ok(measured) =
        measurement::measure(black_box(&observation), TIME, black_box(&store), false)
    {
        let r_e = black_box([0.0; 3]);
        call2(measurement::range_geometry, measured.r_e_m, r_e);
        let geometry = measurement::range_geometry(measured.r_e_m, r_e);
        call2(measurement::satellite_range_rate, &measured, &geometry);
        call4(
            measurement::predicted_pseudorange_m,
            &measured,
            r_e,
            0.0,
            0.0,
        );
        call4(
            measurement::predicted_range_rate_mps,
            &measured,
            r_e,
            r_e,
            0.0,
        );
    }
    call1(SatelliteReason::name, SatelliteReason::BelowMask);
    let row = RowConditions {
        satellite: black_box(EPHEMERIS.satellite),
        elevation_rad: 0.0,
        sin_elevation: 0.0,
        sigma_ura_m: 0.0,
        noise_factor: 1.0,
        ionosphere_scale: 1.0,
        ionosphere: black_box(IonosphereResidual::None),
        geomagnetic_latitude_rad: 0.0,
        troposphere: true,
    };
    call1(weights::zenith_sigma_m, EPHEMERIS.satellite);
    call2(weights::pseudorange_sigma, NoisePreset::Airborne, &row);
    call1(
        RowSigma::total_m,
        weights::pseudorange_sigma(NoisePreset::Elevation, &row),
    );
    call1(weights::range_rate_sigma_mps, 0.0);
}

fn solution() {
    let mut workspace = SnapshotWorkspace::EMPTY;
    let (epoch, store) = (ObservationEpoch::EMPTY, EphemerisStore::EMPTY);
    let ionosphere = BroadcastIonosphere::EMPTY;
    SnapshotWorkspace::prepare(
        black_box(&mut workspace),
        black_box(&epoch),
        black_box(&store),
        black_box(&ionosphere),
        black_box(&Config::PRESET),
    );
    call3(
        SnapshotWorkspace::solve,
        &mut workspace,
        SatelliteSet::EMPTY,
        None,
    );
    call1(SnapshotWorkspace::velocity_sigma_enu_mps, &workspace);
    call1(SnapshotWorkspace::n_observed, &workspace);
    call1(SnapshotWorkspace::unused, &workspace);
    call1(SnapshotWorkspace::model, &workspace);
    call1(|w| SnapshotWorkspace::used_rows(w).count(), &workspace);
}
