//! `mhss`.

use crate::call::{call1, call2, call3, call4};
use core::hint::black_box;
use surefix_core::ekf::{EpochInformation, ErrorState, Filter, Transition};
use surefix_core::frames::geodesy;
use surefix_core::gnss::{Satellite, System};
use surefix_core::mhss::{
    Bank, BankEpoch, Criterion, Secondaries, Separation, SeparationQuantiles, SubFilters,
    separation,
};
use surefix_core::tight::{CLOCKS, JOINT};
use surefix_core::time::GpsTime;

pub fn all() {
    let c_enu_e = &geodesy::c_enu_e(0.0, 0.0);
    let mut quantiles = SeparationQuantiles::EMPTY;
    call4(SeparationQuantiles::fill, &mut quantiles, 1e-7, 1e-3, 1e-7);
    call2(SeparationQuantiles::detection, &quantiles, 0);
    call1(SeparationQuantiles::missed, &quantiles);
    call1(SeparationQuantiles::fault_free, &quantiles);
    call2(Separation::fails, &Separation::ZERO, 0);

    let mut main = Filter::<CLOCKS, JOINT>::EMPTY;
    call2(separation::sigmas_m, &main, c_enu_e);
    call3(separation::spread, &main, &main, c_enu_e);
    bank(
        &mut main,
        &Criterion {
            quantiles: &quantiles,
            vertical: true,
            c_enu_e,
        },
    );
}

fn bank(main: &mut Filter<CLOCKS, JOINT>, criterion: &Criterion<'_>) {
    let mut bank = Bank::<CLOCKS, JOINT>::EMPTY;
    let (mut sub, mut secondaries) = (SubFilters::EMPTY, Secondaries::EMPTY);
    let epoch = BankEpoch {
        time: GpsTime::from_ns(0),
        rows: black_box(&[]),
        hold_ns: 0,
    };
    let mut information = EpochInformation::ZERO;
    Bank::admit(
        black_box(&mut bank),
        black_box(&epoch),
        black_box(main),
        black_box(&mut sub),
        black_box(&mut secondaries),
        black_box(&mut information),
    );
    call4(
        Bank::predict,
        &mut bank,
        &Transition::IDENTITY,
        &mut sub,
        &mut secondaries,
    );
    call3(Bank::update, &mut bank, &mut sub, &mut secondaries);
    black_box(Bank::test(
        black_box(&mut bank),
        black_box(criterion),
        black_box(main),
        black_box(&sub),
        black_box(&secondaries),
    ));
    if let Some(satellite) = Satellite::new(System::Gps, black_box(1)) {
        call3(Bank::sub_filter, &bank, satellite, &sub);
        call3(Bank::secondary, &bank, [satellite; 2], &secondaries);
        black_box(Bank::exclude(
            black_box(&mut bank),
            black_box(satellite),
            black_box(main),
            black_box(&mut sub),
            black_box(&mut secondaries),
        ));
    }
    call4(
        Bank::rereference,
        &bank,
        &ErrorState::ZERO,
        &mut sub,
        &mut secondaries,
    );
    call1(Bank::satellites, &bank);
    call1(|bank| Bank::separations(bank).count(), &bank);
    call1(Bank::len, &bank);
    call1(Bank::is_empty, &bank);
    call1(Bank::excluded, &bank);
    call1(Bank::n_unmonitored, &bank);
    call1(Bank::clear, &mut bank);
}
