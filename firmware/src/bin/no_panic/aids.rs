//! The aids: `ins::aids`, `ins::barometer`, `ins::stationarity`, and what each part makes of them.

use crate::call::{call1, call2, call3, call4};
use core::hint::black_box;
use surefix_core::ekf::{EpochInformation, Filter, MeasurementRow};
use surefix_core::gnss::solution::SnapshotWorkspace;
use surefix_core::ingest;
use surefix_core::ins::{
    AidUse, AidsConfig, Barometer, BarometerModel, Increment, PressureSample, Stationarity,
    ZeroVelocityModel, barometer,
};
use surefix_core::mhss::bank::{ExtraNoise, OwnVariances};
use surefix_core::mhss::{Bank, CorrelatedBound, PostfitLimits, Secondaries, SubFilters};
use surefix_core::monitor::Monitor;
use surefix_core::raim::bounded;
use surefix_core::raim::slope::Sensitivity;
use surefix_core::snapshot::{HeightCalibration, SnapshotMonitor};
use surefix_core::tight::{CLOCKS, JOINT, TightMonitor};
use surefix_core::time::GpsTime;

const BOTH: AidsConfig = AidsConfig {
    barometer: Some(BarometerModel::PRESET),
    zero_velocity: Some(ZeroVelocityModel::PRESET),
};
const TIME: GpsTime = GpsTime::from_ns(0);
const SAMPLE: PressureSample = PressureSample {
    time: TIME,
    pressure_pa: 1e5,
    temperature_c: 20.0,
};

pub fn all() {
    let mut out = [0; 128];
    call1(AidsConfig::check, &BOTH);
    call1(AidUse::from_u8, 1);
    call1(AidUse::name, AidUse::Used);
    call2(ingest::encode_aids, &BOTH, &mut out);
    call1(ingest::decode_aids, &[0_u8; 57]);
    call1(barometer::pressure_altitude_m, 1e5);
    let mut barometer = Barometer::EMPTY;
    call2(Barometer::take, &mut barometer, &SAMPLE);
    call3(Barometer::latest, &barometer, TIME, 0);
    call2(Barometer::shift, &mut barometer, 0);

    let mut window = Stationarity::EMPTY;
    let increment = Increment {
        dtheta_b: [0.0; 3].into(),
        dv_b: [0.0; 3].into(),
        dt_s: 0.01,
    };
    call2(Stationarity::add, &mut window, &increment);
    call1(Stationarity::scatter, &window);
    call1(Stationarity::restart, &mut window);

    call4(bounded::levels, &Sensitivity::EMPTY, 1.0, 0, 1.0);
    snapshot();
    bank();
    let mut monitor = Monitor::EMPTY;
    call2(Monitor::configure_aids, &mut monitor, &BOTH);
    call1(TightMonitor::aids_used, monitor.tight());
}

fn snapshot() {
    let mut workspace = SnapshotWorkspace::EMPTY;
    call2(SnapshotWorkspace::offer_height, &mut workspace, None);
    call1(SnapshotWorkspace::uses_height, &workspace);
    let mut monitor = SnapshotMonitor::EMPTY;
    call1(SnapshotMonitor::height, &monitor);
    call1(SnapshotMonitor::height_use, &monitor);
    let height = SnapshotMonitor::height_mut(black_box(&mut monitor));
    call2(HeightCalibration::configure, height, BOTH.barometer);
    call2(HeightCalibration::on_pressure, height, &SAMPLE);
    call4(HeightCalibration::learn, height, TIME, 0.0, 10.0);
    call2(HeightCalibration::height, height, TIME);
    call1(HeightCalibration::bias_m, height);
    call1(HeightCalibration::is_on, height);
    call1(HeightCalibration::forget, height);
    call2(HeightCalibration::shift, height, 0);
}

fn bank() {
    call3(MeasurementRow::<JOINT>::of_velocity, [0.0; 3], 0.0, 1.0);
    let mut main = Filter::<CLOCKS, JOINT>::EMPTY;
    let mut bank = Bank::<CLOCKS, JOINT>::EMPTY;
    let (mut sub, mut secondaries) = (SubFilters::EMPTY, Secondaries::EMPTY);
    call2(Bank::aid, &mut bank, &EpochInformation::ZERO);
    call3(Bank::monitor_aids, &mut bank, &main, &mut sub);
    call2(Bank::update_unaided, &mut bank, &mut sub);
    call1(Bank::unaided_separation, &bank);
    call1(SubFilters::unaided, &sub);
    black_box(Bank::aids_explain(
        black_box(&bank),
        black_box(&PostfitLimits::EMPTY),
        black_box(true),
        black_box(&main),
        black_box(&sub),
    ));
    call4(
        Bank::exclude_aids,
        &mut bank,
        &mut main,
        &mut sub,
        &mut secondaries,
    );
    let mut bound = CorrelatedBound::NONE;
    let own = OwnVariances {
        left: [1.0; 2],
        taken: [0.0; 2],
    };
    call1(CorrelatedBound::begin_unaided, &mut bound);
    call2(ExtraNoise::unaided, &mut bound, &own);
    call1(CorrelatedBound::exclude_aids, &mut bound);
}
