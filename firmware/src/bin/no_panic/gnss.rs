//! `gnss`.

use crate::call::{call1, call2, call3, call4};
use surefix_core::gnss::klobuchar::{self, BroadcastIonosphere, KlobucharParameters, SkyPoint};
use surefix_core::gnss::satellite::SystemSet;
use surefix_core::gnss::{
    ObservationEpoch, Satellite, SatelliteObservation, SatelliteSet, Signal, SignalObservation,
    System,
};
use surefix_core::time::GpsTime;

const TIME: GpsTime = GpsTime::from_ns(0);

pub fn all() {
    satellites();
    observations();
    ionosphere();
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
    if let Some(satellite) = Satellite::from_index(core::hint::black_box(0)) {
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
    call1(Signal::band, Signal::C1C);
    call1(Signal::attribute, Signal::C1C);
    call2(Signal::frequency_hz, Signal::C1C, System::Gps);
    call1(SignalObservation::new, Signal::C1C);
    let mut epoch = ObservationEpoch::EMPTY;
    call2(ObservationEpoch::restart, &mut epoch, TIME);
    if let Some(satellite) = Satellite::from_index(core::hint::black_box(0)) {
        let observation = SignalObservation::new(Signal::C1C);
        call3(ObservationEpoch::add, &mut epoch, satellite, observation);
        call2(ObservationEpoch::get, &epoch, satellite);
    }
    if let Some(satellite) = epoch.satellites.first() {
        call2(SatelliteObservation::signal, satellite, Signal::C1C);
    }
}

fn ionosphere() {
    let parameters = KlobucharParameters {
        system: core::hint::black_box(System::Gps),
        alpha: [0.0; 4],
        beta: [0.0; 4],
    };
    let at = SkyPoint {
        lat_rad: 0.0,
        lon_rad: 0.0,
        azimuth_rad: 0.0,
        elevation_rad: 0.0,
    };
    call4(KlobucharParameters::delay_s, &parameters, TIME, &at, 1.0);
    call1(klobuchar::geomagnetic_latitude_rad, &at);
    let mut broadcast = BroadcastIonosphere::EMPTY;
    call2(BroadcastIonosphere::insert, &mut broadcast, parameters);
    call1(BroadcastIonosphere::parameters, &broadcast);
}
