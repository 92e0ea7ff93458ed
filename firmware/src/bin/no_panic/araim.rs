//! `raim::araim`.

use crate::call::{call1, call2, call4};
use core::hint::black_box;
use surefix_core::gnss::System;
use surefix_core::raim::araim::detection::Detection;
use surefix_core::raim::araim::modes::SatelliteSet;
use surefix_core::raim::araim::support::{self, FaultRate, IntegritySupport};
use surefix_core::raim::araim::{
    Araim, AraimConstellation, AraimParameters, AraimSatellite, MAX_ARAIM_SATELLITES,
};

pub fn all() {
    let satellites = [AraimSatellite::EMPTY; MAX_ARAIM_SATELLITES];
    let satellites = black_box(&satellites[..]);
    let rate = FaultRate::from_rate(black_box(1e-8), black_box(3600.0));
    call2(FaultRate::from_rate, 1e-8, 3600.0);
    let support = IntegritySupport {
        ura_m: 1.0,
        ure_m: 1.0,
        b_nom_m: 0.0,
        satellite: rate,
        constellation: rate,
    };
    let constellations = [IntegritySupport::constellation(&support, black_box(0.0))];
    let constellations: &[AraimConstellation] = black_box(&constellations);
    call2(IntegritySupport::constellation, &support, 0.0);
    call2(
        |support, elevation_rad| {
            IntegritySupport::satellite(support, 0, [0.0; 3], elevation_rad, 1.0, 0.0)
        },
        &support,
        1.0,
    );
    call1(support::troposphere_sigma_m, 1.0);
    call1(support::gps_user_sigma_m, 1.0);
    call1(support::galileo_user_sigma_m, 1.0);
    call1(support::bds_user_sigma_m, 1.0);
    call2(support::user_sigma_m, System::Bds, 1.0);

    let parameters = black_box(&AraimParameters::LPV_200);
    let mut araim = Araim::EMPTY;
    let mut scratch = Araim::EMPTY;
    call4(
        Araim::solve,
        &mut araim,
        satellites,
        constellations,
        parameters,
    );
    call4(
        Araim::evaluate,
        &mut araim,
        satellites,
        constellations,
        parameters,
    );
    call4(
        Araim::evaluate_with_exclusion,
        &mut araim,
        satellites,
        constellations,
        parameters,
    );
    call1(|araim| Araim::subsets(araim).len(), &araim);
    let residual_m = black_box(&[0.0; MAX_ARAIM_SATELLITES][..]);
    let detection = Araim::test(&mut araim, residual_m, |index, enu| {
        black_box((index, enu));
    });
    if let Ok(detection) = black_box(detection) {
        call1(Detection::separations_fail, &detection);
        call1(Detection::chi_square_fails, &detection);
        call1(Detection::is_detected, &detection);
    }
    call4(
        |araim, satellites, parameters, scratch| {
            Araim::exclude(araim, satellites, parameters, residual_m, scratch)
        },
        &mut araim,
        satellites,
        parameters,
        &mut scratch,
    );
    sets();
}

fn sets() {
    let set = SatelliteSet::first(black_box(3));
    call1(SatelliteSet::first, 3);
    call2(SatelliteSet::with, set, 3);
    call2(SatelliteSet::union, set, set);
    call2(SatelliteSet::without, set, set);
    call2(SatelliteSet::contains, set, 3);
    call2(SatelliteSet::contains_all, set, set);
    call1(SatelliteSet::len, set);
    call1(SatelliteSet::is_empty, set);
    call1(|set| SatelliteSet::iter(set).sum::<usize>(), set);
}
