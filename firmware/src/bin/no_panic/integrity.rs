//! `integrity`.

use crate::call::{call1, call2, call3, call4};
use surefix_core::gnss::SatelliteSet;
use surefix_core::integrity::{
    AlertEvent, AlertState, Alerts, BankOpinion, InertialStatus, Integrity, Mode, NoBound,
    Opinions, Phase, ProtectionLevel, Reason, Verdict, opinion,
};
use surefix_core::time::GpsTime;

pub fn all() {
    call1(Phase::name, Phase::Npa);
    call1(Phase::from_u8, 0);
    call1(Phase::requirements, Phase::Npa);
    call1(Integrity::name, Integrity::Nominal);
    call1(Integrity::from_u8, 0);
    call1(Integrity::is_usable, Integrity::Nominal);
    call1(Mode::name, Mode::None);
    call1(Mode::from_u8, 0);
    call1(NoBound::from_u8, 0);
    call1(InertialStatus::name, InertialStatus::Off);
    call1(InertialStatus::from_u8, 0);
    call1(Reason::name, Reason::None);
    call1(Reason::from_u8, 0);
    let level = ProtectionLevel::Bound(0.0);
    call1(ProtectionLevel::from_bound, 0.0);
    call2(ProtectionLevel::is_within, level, 0.0);
    call1(ProtectionLevel::bound_m, level);
    call3(Verdict::unavailable, Reason::None, 0.0, None);
    let verdict = Verdict::unavailable(Reason::None, 0.0, None);
    call2(Verdict::moved_by, &verdict, [0.0; 2]);
    let bank = BankOpinion {
        is_alerted: false,
        excluded: SatelliteSet::EMPTY,
        levels_m: [Some(1.0); 2],
    };
    call3(opinion::combine, &verdict, &bank, Some([0.0; 2]));
    call1(Opinions::name, Opinions::Agree);
    call1(Opinions::from_u8, 0);
    call4(
        AlertState::after,
        AlertState::Starting,
        AlertEvent::Passed,
        0,
        0,
    );
    let mut alerts = Alerts::STARTING;
    let requirements = Phase::requirements(Phase::Npa);
    call2(Alerts::configure, &mut alerts, &requirements);
    call2(Alerts::shift, &mut alerts, 0);
    let mut verdict = verdict;
    call3(Alerts::step, &mut alerts, &mut verdict, GpsTime::from_ns(0));
    call1(Alerts::miss, &mut alerts);
    call1(Alerts::state, &alerts);
}
