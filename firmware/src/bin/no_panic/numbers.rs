//! `budget`, `config`, `frames`, `stats`, `time`.

use crate::call::{call1, call2, call3};
use surefix_core::budget::{Ledger, Stage};
use surefix_core::config::Config;
use surefix_core::frames::geodesy::{self, Llh};
use surefix_core::stats::{chi2, gamma, normal};
use surefix_core::time::{self, GpsTime};

pub fn all() {
    time_entries();
    statistics();
    frames();

    let mut ledger = Ledger::EMPTY;
    call1(Ledger::begin_epoch, &mut ledger);
    call3(Ledger::charge, &mut ledger, Stage::Verdict, 1);
    call1(Ledger::end_epoch, &mut ledger);
    call1(Ledger::last, &ledger);
    call1(Ledger::worst, &ledger);
    call1(Ledger::deadline_misses, &ledger);

    call1(Config::check, &Config::PRESET);
}

fn time_entries() {
    let t = GpsTime::from_ns(0);
    call1(GpsTime::from_ns, 0);
    call2(GpsTime::from_week_tow_ns, 0, 0);
    call2(GpsTime::from_week_tow_s, 0, 0);
    call2(GpsTime::from_bdt, 0, 0);
    call2(GpsTime::from_gst, 0, 0);
    call1(GpsTime::ns, t);
    call1(GpsTime::week, t);
    call1(GpsTime::tow_ns, t);
    call1(GpsTime::tow_s, t);
    call2(GpsTime::seconds_since, t, t);
    call2(GpsTime::plus_ns, t, 0);
    call2(GpsTime::nearest, 0, t);
    call3(time::resolve_week, 0, 0, 0);
    call1(time::leap_seconds, t);
    call1(time::utc, t);
    call3(time::start_of_day, 2025, 8, 28);
}

fn statistics() {
    call1(normal::density, 0.0);
    call1(normal::upper_tail, 0.0);
    call1(normal::upper_quantile, 0.0);
    call2(gamma::lower, 0, 0.0);
    call2(gamma::upper, 0, 0.0);
    call2(chi2::lower_tail, 0, 0.0);
    call2(chi2::upper_tail, 0, 0.0);
    call2(chi2::upper_quantile, 0, 0.0);
    call3(chi2::noncentral_lower_tail, 0, 0.0, 0.0);
    call3(chi2::noncentral_upper_tail, 0, 0.0, 0.0);
    call3(chi2::noncentral_upper_quantile, 0, 0.0, 0.0);
    call3(chi2::noncentrality, 0, 0.0, 0.0);
}

fn frames() {
    let llh = Llh {
        lat_rad: 0.0,
        lon_rad: 0.0,
        height_m: 0.0,
    };
    call1(geodesy::to_ecef, &llh);
    call1(geodesy::to_llh, &geodesy::to_ecef(&llh));
    call2(geodesy::c_enu_e, 0.0, 0.0);
    call1(geodesy::direction, &geodesy::to_ecef(&llh));
}
