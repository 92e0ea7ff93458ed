//! `mhss`.

use crate::call::{call1, call2, call3, call4};
use core::hint::black_box;
use nalgebra::Matrix3;
use surefix_core::ekf::{EpochInformation, ErrorState, Filter, MeasurementRow, Transition};
use surefix_core::frames::geodesy;
use surefix_core::gnss::{Satellite, System};
use surefix_core::mhss::bank::{ExtraNoise, OwnVariances, WhiteNoise};
use surefix_core::mhss::protection::{self, RiskBudget};
use surefix_core::mhss::{
    Bank, BankAllocation, BankEpoch, BankRow, CorrelatedBound, CorrelatedRow, Criterion,
    FaultPriors, LevelForm, PostfitLimits, Probation, Secondaries, Separation, SeparationQuantiles,
    SubFilters, probation, selection, separation,
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
    call2(separation::position_variances, &main, c_enu_e);
    call2(separation::sigmas_of, [0.0; 2], [0.0; 2]);
    call2(separation::widened, [0.0; 2], [0.0; 2]);
    call2(Separation::is_failed, &Separation::ZERO, true);
    correlated(c_enu_e);
    levels();
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
    places(&mut bank, main, &mut sub, &mut secondaries, criterion);
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

/// What a recording needs of the bank.
fn places(
    bank: &mut Bank<CLOCKS, JOINT>,
    main: &mut Filter<CLOCKS, JOINT>,
    sub: &mut SubFilters<CLOCKS, JOINT>,
    secondaries: &mut Secondaries<CLOCKS, JOINT>,
    criterion: &Criterion<'_>,
) {
    let now = GpsTime::from_ns(black_box(0));
    let mut limits = PostfitLimits::EMPTY;
    call2(PostfitLimits::fill, &mut limits, 1e-3);
    let mut correlated = CorrelatedBound::NONE;
    black_box(Bank::assess(
        black_box(bank),
        black_box(criterion),
        black_box(&mut correlated),
        black_box(main),
        black_box(sub),
        black_box(secondaries),
    ));
    black_box(Bank::explain(
        black_box(bank),
        black_box(&limits),
        black_box(true),
        black_box(sub),
        black_box(secondaries),
    ));
    call3(Bank::predict_sub, bank, &Transition::IDENTITY, sub);
    call3(Bank::monitor_constellations, bank, main, sub);
    call4(Bank::note_predictions, bank, main, sub, criterion.c_enu_e);
    call2(Bank::update_constellations, bank, sub);
    call2(Bank::update_sub, bank, sub);
    call1(Bank::drop_pairs, bank);
    call1(Bank::pairs_are_dropped, bank);
    call3(Bank::begin_pairs, bank, sub, secondaries);
    call1(Bank::pairs, bank);
    call1(Bank::filters, bank);
    call4(Bank::hold_on, bank, now, 0, 0.0);
    call1(Bank::missing_longest, bank);
    call1(Bank::readmitted, bank);
    call2(Bank::p_unmonitored, bank, &FaultPriors::PRESET);
    call1(
        |bank: &Bank<CLOCKS, JOINT>| Bank::hypotheses(bank, &FaultPriors::PRESET).count(),
        &*bank,
    );
    call1(
        |bank: &Bank<CLOCKS, JOINT>| Bank::begun(bank).count(),
        &*bank,
    );
    call1(
        |bank: &Bank<CLOCKS, JOINT>| Bank::present(bank).count(),
        &*bank,
    );
    call1(
        |bank: &Bank<CLOCKS, JOINT>| Bank::constellation_separations(bank).count(),
        &*bank,
    );
    Bank::for_each_filter(black_box(bank), sub, secondaries, |filter| {
        filter.widen_clock(0, black_box(1.0));
    });
    call2(SubFilters::constellation, sub, System::Gps);
    let mut rows = heapless::Vec::<BankRow<JOINT>, 48>::new();
    call4(selection::select, bank, &mut rows, now, true);
    if let Some(satellite) = Satellite::new(System::Gps, black_box(2)) {
        call2(Bank::has, bank, satellite);
        call2(Bank::place, bank, satellite);
        call2(Bank::readmit, bank, satellite);
        black_box(Bank::evict(bank, satellite, main, sub, secondaries));
        black_box(Bank::exclude_alone(bank, satellite, main, sub, secondaries));
        black_box(Bank::exclude_two(
            bank,
            [satellite; 2],
            main,
            sub,
            secondaries,
        ));
        black_box(Bank::exclude_constellation(
            bank,
            satellite.system(),
            main,
            sub,
            secondaries,
        ));
        let mut trial = Probation::EMPTY;
        black_box(Probation::observe(
            black_box(&mut trial),
            black_box(now),
            black_box(satellite),
            black_box(0.0),
            black_box(1.0),
        ));
        call1(Probation::clear, &mut trial);
        call2(probation::predicted_variance, &MeasurementRow::ZERO, main);
    }
}

fn correlated(c_enu_e: &Matrix3<f64>) {
    let mut bound = CorrelatedBound::NONE;
    call3(CorrelatedBound::start, &mut bound, 1.0, [0.0; 2]);
    call2(CorrelatedBound::begin, &mut bound, 0);
    call2(CorrelatedBound::begin_constellation, &mut bound, 0);
    let rows = [CorrelatedRow::<JOINT> {
        place: black_box(0),
        constellation: black_box(0),
        row: &MeasurementRow::ZERO,
        common_m: black_box(0.0),
    }];
    CorrelatedBound::solve(
        black_box(&mut bound),
        black_box(&rows).iter().copied(),
        black_box(c_enu_e),
    );
    let own = OwnVariances {
        left: [1.0; 2],
        taken: [0.0; 2],
    };
    call2(ExtraNoise::main, &mut bound, &own);
    call3(ExtraNoise::sub, &mut bound, 0, &own);
    call3(ExtraNoise::constellation, &mut bound, 0, &own);
    call3(ExtraNoise::pair, &bound, 0, 1);
    call2(ExtraNoise::main, &mut WhiteNoise, &own);
    call2(CorrelatedBound::exclude, &mut bound, 0);
    call2(CorrelatedBound::exclude_alone, &mut bound, 0);
    call3(CorrelatedBound::exclude_two, &mut bound, 0, 1);
    call2(CorrelatedBound::exclude_constellation, &mut bound, 0);
}

fn levels() {
    call4(BankAllocation::new, 3600.0, 1e-7, 1e-5, true);
    call2(FaultPriors::pairs, &FaultPriors::PRESET, 24);
    for form in [
        LevelForm::Fixed { k_fault_free: 5.0 },
        LevelForm::Budget(RiskBudget {
            p_integrity: [1e-7; 2],
            samples: 24.0,
            unmonitored_share: 1.0,
        }),
    ] {
        let bank = Bank::<CLOCKS, JOINT>::EMPTY;
        black_box(protection::levels(
            black_box(&form),
            black_box([1.0; 2]),
            || Bank::hypotheses(black_box(&bank), black_box(&FaultPriors::PRESET)),
            black_box(0.0),
        ));
    }
}
