//! `ekf`.

use crate::call::{call1, call2, call3, call4};
use core::hint::black_box;
use surefix_core::ekf::filter::PredictWorkspace;
use surefix_core::ekf::navigator::Navigator;
use surefix_core::ekf::{
    EpochInformation, ErrorState, Filter, LeverState, MeasurementRow, ProcessAccumulator,
    Transition, UpdateWorkspace,
};
use surefix_core::gnss::{CorrectedMeasurement, Satellite};
use surefix_core::ins::{Increment, InertialConfig, InitialState};
use surefix_core::tight::{CLOCKS, JOINT};
use surefix_core::time::GpsTime;

pub fn all(config: &InertialConfig, state: &InitialState, satellite: Satellite) {
    let measurement = CorrectedMeasurement {
        satellite,
        r_es_e_m: [0.0; 3],
        v_es_e_mps: [0.0; 3],
        pseudorange_m: 0.0,
        sigma_pseudorange_m: 1.0,
        range_rate_mps: Some((0.0, 1.0)),
    };
    process(config);
    // The smallest and the largest number of clock states.
    filter::<2, 8>(&measurement);
    filter::<CLOCKS, JOINT>(&measurement);
    navigator(config, state, &measurement);
}

fn process(config: &InertialConfig) {
    let block = &[0.0; 9];
    call4(LeverState::new, [0.0; 3], block, [0.0; 3], 0.0);
    let lever = LeverState::ZERO;
    call2(
        LeverState::error_of_unit::<CLOCKS>,
        &lever,
        &ErrorState::ZERO,
    );
    let mut process = ProcessAccumulator::EMPTY;
    ProcessAccumulator::start(
        black_box(&mut process),
        black_box(&config.noise),
        black_box(&config.clock),
        black_box(0.0),
        black_box(&lever),
    );
    call2(ProcessAccumulator::set_gradient, &mut process, block);
    call3(ProcessAccumulator::add_noise, &mut process, 0, &[0.0; 6]);
    call4(ProcessAccumulator::add, &mut process, 0.01, [0.0; 3], block);
    black_box(ProcessAccumulator::finish(
        black_box(&mut process),
        black_box(&lever),
    ));
    call1(ProcessAccumulator::transition, &process);
    call1(ProcessAccumulator::lever, &process);
    call1(ProcessAccumulator::begin, &mut process);
}

fn filter<const K: usize, const M: usize>(measurement: &CorrectedMeasurement) {
    let mut information = EpochInformation::<M>::ZERO;
    let row: Option<MeasurementRow<M>> = MeasurementRow::new::<K>(
        black_box(measurement),
        black_box([0.0; 3]),
        black_box([0.0; 3]),
        black_box(&[0.0; K]),
        black_box(Some(2)),
    );
    if let Some(row) = &row {
        call2(EpochInformation::add_row, &mut information, row);
    }
    call2(
        EpochInformation::add,
        &mut information,
        &EpochInformation::ZERO,
    );
    call3(
        EpochInformation::set_sum,
        &mut information,
        &EpochInformation::ZERO,
        &EpochInformation::ZERO,
    );
    call1(EpochInformation::rows, &information);

    let mut filter = Filter::<K, M>::EMPTY;
    call3(Filter::start, &mut filter, &[[0.0; 6]; 5], &[0.0; K]);
    call3(
        Filter::predict,
        &mut filter,
        &Transition::IDENTITY,
        &mut black_box(PredictWorkspace::EMPTY),
    );
    call3(
        Filter::update,
        &mut filter,
        &information,
        &mut black_box(UpdateWorkspace::EMPTY),
    );
    call1(EpochInformation::clear, &mut information);
    call1(Filter::state, &filter);
    call2(Filter::rereference, &mut filter, &ErrorState::ZERO);
    call2(Filter::block, &filter, 0);
    call3(Filter::cross_block, &filter, 0, 0);
    call3(Filter::clock_cross, &filter, 0, 0);
    call1(Filter::clock_covariance, &filter);
    call3(Filter::widen_clock, &mut filter, 0, 0.0);
    call3(Filter::reset_clock, &mut filter, 0, 0.0);
    call1(Filter::check, &filter);
}

fn navigator(config: &InertialConfig, state: &InitialState, measurement: &CorrectedMeasurement) {
    let time = GpsTime::from_ns(0);
    let mut navigator = Navigator::<CLOCKS, JOINT>::EMPTY;
    call3(Navigator::start, &mut navigator, config, state);
    let increment = Increment {
        dtheta_b: [0.0; 3].into(),
        dv_b: [0.0; 3].into(),
        dt_s: 0.01,
    };
    call3(Navigator::step, &mut navigator, &increment, time);
    call3(Navigator::add_uncertainty, &mut navigator, 0.0, 0.0);
    call3(Navigator::widen, &mut navigator, 0.0, 0.0);
    call1(Navigator::time, &navigator);
    call2(Navigator::shift, &mut navigator, 0);
    call2(Navigator::antenna, &navigator, time);
    call2(
        Navigator::carried_over,
        &navigator,
        core::iter::once((&increment, time)),
    );
    let at = Navigator::predict(black_box(&mut navigator), black_box(time));
    call1(Navigator::transition, &navigator);
    call4(Navigator::add, &mut navigator, measurement, &at, Some(2));
    call1(Navigator::update, &mut navigator);
    call1(Navigator::update_filter, &mut navigator);
    call1(Navigator::finish, &mut navigator);
    black_box(Navigator::information_mut(black_box(&mut navigator)));
    let mut lent = Filter::EMPTY;
    call2(Navigator::lend, &navigator, &mut lent);
    call2(Navigator::update_lent, &mut navigator, &mut lent);
    call2(Navigator::take_back, &mut navigator, &lent);
    call3(Navigator::jump_clock, &mut navigator, 0.0, 0.0);
    call4(Navigator::reset_clock, &mut navigator, 0, 0.0, 0.0);
    call1(Navigator::filter, &navigator);
    call1(Navigator::mechanisation, &navigator);
}
