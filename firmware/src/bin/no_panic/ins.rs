//! `frames::rotation`, `ins` but for its vocabulary.

use crate::call::{call1, call2, call3, call4};
use crate::facade::MAGNETOMETER;
use core::hint::black_box;
use surefix_core::frames::rotation;
use surefix_core::ins::alignment::{AlignmentEpoch, Obstacle};
use surefix_core::ins::{
    CoarseAlignment, ImuSample, Increment, InertialConfig, InitialState, Intake, MagneticSample,
    Magnetometer, Mechanisation, SampleClock, gravity,
};
use surefix_core::time::GpsTime;

pub fn all(config: &InertialConfig, state: &InitialState, sample: &ImuSample) {
    rotations();
    let vector = &[0.0; 3].into();
    call1(gravity::gravity_e, vector);
    call1(gravity::gravity_gradient_e, vector);

    let mut mechanisation = Mechanisation::EMPTY;
    let increment = Increment {
        dtheta_b: *vector,
        dv_b: *vector,
        dt_s: 0.0,
    };
    call2(Mechanisation::start, &mut mechanisation, state);
    call2(Mechanisation::step, &mut mechanisation, &increment);
    Mechanisation::correct(
        black_box(&mut mechanisation),
        black_box(vector),
        black_box(vector),
        black_box(vector),
        black_box(vector),
        black_box(vector),
    );

    sample_clock();

    let mut intake = Intake::EMPTY;
    call2(Intake::configure, &mut intake, config);
    call2(Intake::take, &mut intake, sample);
    call1(Intake::counters, &intake);
    call1(Intake::last_time, &intake);
    call2(Intake::shift, &mut intake, 0);

    coarse_alignment(config, &increment);
}

fn coarse_alignment(config: &InertialConfig, increment: &Increment) {
    let magnetometer = &MAGNETOMETER;
    let time = GpsTime::from_ns(0);
    call1(Magnetometer::check, magnetometer);
    call2(Magnetometer::calibrated, magnetometer, [0.0; 3]);
    call1(Magnetometer::field_n_ut, magnetometer);
    call2(Magnetometer::sigma_declination_rad, magnetometer, time);

    let mut alignment = CoarseAlignment::EMPTY;
    call2(CoarseAlignment::configure, &mut alignment, config);
    call2(
        CoarseAlignment::set_magnetometer,
        &mut alignment,
        magnetometer,
    );
    call2(CoarseAlignment::accumulate, &mut alignment, increment);
    let field = &MagneticSample {
        time,
        field_s_ut: [20.0, 0.0, 40.0],
    };
    call2(CoarseAlignment::on_field, &mut alignment, field);
    call1(CoarseAlignment::rest_s, &alignment);
    let epoch = &AlignmentEpoch {
        time,
        r_e: increment.dv_b,
        v_enu: Some(increment.dv_b),
        sigma_enu_mps: [0.1; 3],
    };
    call2(CoarseAlignment::epoch, &mut alignment, epoch);
    call1(Obstacle::from_u8, 1);
    call1(Obstacle::name, Obstacle::NoField);
    call4(
        CoarseAlignment::with_heading,
        &alignment,
        &epoch.r_e,
        0.0,
        0.1,
    );
    call2(CoarseAlignment::resume, &mut alignment, false);
    call1(CoarseAlignment::restart, &mut alignment);
}

fn sample_clock() {
    let mut clock = SampleClock::EMPTY;
    call2(SampleClock::pulse, &mut clock, 0);
    call2(SampleClock::pulse, &mut clock, 1_000_000_000);
    call3(SampleClock::epoch, &mut clock, GpsTime::from_ns(0), 0);
    call2(SampleClock::time, &mut clock, 0);
    call2(SampleClock::state, &clock, 0);
    call1(SampleClock::counters, &clock);
    call1(SampleClock::rate_error_ppm, &clock);
}

fn rotations() {
    let q = &rotation::IDENTITY;
    let c = &rotation::c_e_n(0.0, 0.0);
    let vector = &[0.0; 3].into();
    call2(rotation::product, q, q);
    call1(rotation::from_rotation_vector, vector);
    call1(rotation::normalised, q);
    call1(rotation::with_positive_scalar, q);
    call1(rotation::to_matrix, q);
    call1(rotation::from_matrix, c);
    call1(rotation::c_n_b, &[0.0; 3]);
    call1(rotation::roll_pitch_heading, c);
    call2(rotation::c_e_n, 0.0, 0.0);
}
