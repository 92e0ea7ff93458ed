//! `ingest`, `report`, `snapshot`, `monitor`.

use crate::call::{call1, call2, call3};
use core::hint::black_box;
use surefix_core::bank_report::BankReport;
use surefix_core::budget::{CycleCounter, Ledger, NoCounter};
use surefix_core::config::Config;
use surefix_core::gnss::solution::SnapshotWorkspace;
use surefix_core::gnss::{
    BroadcastIonosphere, CorrectedEpoch, EphemerisStore, KlobucharParameters, ObservationEpoch,
    Satellite, SatelliteSet, System,
};
use surefix_core::inertial_report::InertialReport;
use surefix_core::ingest::{self, CorrectedGroup, Ingest, ObservationGroup};
use surefix_core::ins::alignment::AlignmentMode;
use surefix_core::ins::{
    AttitudeStart, ClockNoise, ImuSample, InertialConfig, InertialNoise, InitialSigma,
    InitialState, MagneticSample, Magnetometer, MeasurementFactors, PressureSample, ReferenceModel,
    SensorRange, UnitConfig, UnitFault, UnitSample, UnitState, UnitTolerance, Voting, VotingMode,
};
use surefix_core::monitor::Monitor;
use surefix_core::report::{self, ReportFlags};
use surefix_core::satellite_report::{SatelliteReport, SatelliteUse};
use surefix_core::sentences;
use surefix_core::snapshot::SnapshotMonitor;
use surefix_core::tight::{BankMemory, MonitorFastFilters, MonitorSecondaries, TightMonitor};
use surefix_core::time::GpsTime;

pub fn all(ephemeris: &surefix_core::gnss::Ephemeris, parameters: &KlobucharParameters) {
    let bytes: &[u8] = &[0; 64];
    let mut out = [0; 1100];
    let mut epoch = ObservationEpoch::EMPTY;

    call2(ingest::encode_observations, &epoch, &mut out);
    call2(ingest::encode_ephemeris, ephemeris, &mut out);
    call2(ingest::encode_klobuchar, parameters, &mut out);
    call2(ingest::encode_configuration, &Config::PRESET, &mut out);
    call1(ingest::encode_end_of_stream, &mut out);
    call1(ingest::decode_ephemeris, bytes);
    call1(ingest::decode_klobuchar, bytes);
    call1(ingest::decode_configuration, bytes);
    call1(ingest::decode_receiver_fix, bytes);
    if let Ok(fix) = ingest::decode_receiver_fix(black_box(bytes)) {
        call2(ingest::encode_receiver_fix, &fix, &mut out);
    }
    call1(ObservationGroup::decode, bytes);
    if let Ok(group) = ObservationGroup::decode(black_box(bytes)) {
        let refused = |why| {
            black_box(why);
        };
        call3(ObservationGroup::add_to, &group, &mut epoch, refused);
    }

    inertial(bytes, &mut out);

    let mut ingest = Ingest::EMPTY;
    call2(Ingest::configure, &mut ingest, &Config::PRESET);
    call2(Ingest::push, &mut ingest, bytes);
    call1(Ingest::bytes_in_hand, &ingest);
    call1(Ingest::finish, &mut ingest);
    call1(Ingest::epoch, &ingest);
    call1(Ingest::corrected_epoch, &ingest);
    call1(Ingest::corrected_is_incomplete, &ingest);
    call1(Ingest::counters, &ingest);

    snapshot(&epoch);
    tight();
    monitor(bytes, &mut out);
    call1(ReportFlags::bits, ReportFlags::default());
    call1(ReportFlags::from_bits, 0);
    call1(report::decode, bytes);
    call1(CycleCounter::now, &mut NoCounter);
}

pub const SAMPLE: ImuSample = ImuSample {
    time: GpsTime::from_ns(0),
    interval_ns: 10_000_000,
    dtheta_is_s_rad: [0.0; 3],
    dv_is_s_mps: [0.0; 3],
};
pub const STATE: InitialState = InitialState {
    time: GpsTime::from_ns(0),
    r_eb_e_m: [0.0; 3],
    v_eb_e_mps: [0.0; 3],
    q_e_b: [1.0, 0.0, 0.0, 0.0],
    gyro_bias_radps: [0.0; 3],
    accel_bias_mps2: [0.0; 3],
    clock_bias_m: 0.0,
    clock_drift_mps: 0.0,
};
const MODEL: ReferenceModel = ReferenceModel {
    p_fa: 3.33e-7,
    p_md: 1e-3,
    p_h0: 1e-7,
    hal_m: 556.0,
    val_m: 50.0,
    detect_vertical: false,
    exclude: true,
    hold_ns: 0,
};
pub const UNIT: InertialConfig = InertialConfig {
    interval_ns: 10_000_000,
    c_b_s: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    lever_arm_b_m: [0.0; 3],
    noise: InertialNoise {
        arw: 1e-4,
        vrw: 1e-3,
        gyro_bias_walk: 1e-6,
        accel_bias_walk: 1e-5,
    },
    clock: ClockNoise {
        bias_psd: 0.01,
        drift_psd: 0.04,
        drift_decay_per_s: 0.0,
        inter_system_psd: 0.0,
    },
    measurement: MeasurementFactors::ONE,
    range: SensorRange {
        rate_radps: 10.0,
        specific_force_mps2: 100.0,
    },
    start: AttitudeStart::Course { min_speed_mps: 2.0 },
    sigma: InitialSigma {
        position_m: 10.0,
        velocity_mps: 0.5,
        attitude_ned_rad: [0.01; 3],
        gyro_bias_radps: 1e-4,
        accel_bias_mps2: 0.01,
        clock_bias_m: 30.0,
        clock_drift_mps: 1.0,
    },
};

pub const MAGNETOMETER: Magnetometer = Magnetometer {
    hard_iron_s_ut: [10.0, 0.0, 0.0],
    soft_iron_b_s: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    declination_rad: 0.1,
    sigma_declination_rad: 0.01,
    declination_year: 2026.0,
    dip_rad: 1.0,
    strength_ut: 50.0,
    sigma_ut: 0.5,
};

const VOTER: UnitConfig = UnitConfig {
    interval_ns: UNIT.interval_ns,
    c_b_s: UNIT.c_b_s,
    lever_arm_b_m: [0.1, 0.0, 0.0],
    noise: UNIT.noise,
    range: UNIT.range,
    tolerance: UnitTolerance {
        gyro_bias_radps: 1e-4,
        accel_bias_mps2: 0.01,
        scale: 1e-3,
        timing_s: 1e-4,
    },
};

fn inertial(bytes: &[u8], out: &mut [u8]) {
    call2(ingest::encode_magnetometer, &MAGNETOMETER, &mut *out);
    call1(ingest::decode_magnetometer, bytes);
    call1(InertialConfig::check, &UNIT);
    call2(ingest::encode_imu, &SAMPLE, &mut *out);
    call2(ingest::encode_inertial, &UNIT, &mut *out);
    call2(ingest::encode_initial_state, &STATE, &mut *out);
    call2(ingest::encode_reference_model, &MODEL, &mut *out);
    call2(
        ingest::encode_corrected_epoch,
        &CorrectedEpoch::EMPTY,
        &mut *out,
    );
    call1(ingest::decode_imu, bytes);
    call1(ingest::decode_inertial, bytes);
    call1(ingest::decode_initial_state, bytes);
    call1(ingest::decode_reference_model, bytes);
    call1(CorrectedGroup::decode, bytes);
    if let Ok(group) = CorrectedGroup::decode(black_box(bytes)) {
        call2(CorrectedGroup::for_each, &group, |row| {
            black_box(row);
        });
    }
}

fn snapshot(epoch: &ObservationEpoch) {
    let mut monitor = SnapshotMonitor::EMPTY;
    let (store, ionosphere) = (EphemerisStore::EMPTY, BroadcastIonosphere::EMPTY);
    let mut ledger = Ledger::EMPTY;
    call2(SnapshotMonitor::configure, &mut monitor, &Config::PRESET);
    call1(SnapshotMonitor::config, &monitor);
    call1(SnapshotMonitor::workspace, &monitor);
    call2(SnapshotMonitor::share_false_alerts, &mut monitor, 0.5);
    call2(
        SnapshotMonitor::leave_out,
        &mut monitor,
        SatelliteSet::EMPTY,
    );
    black_box(SnapshotMonitor::workspace_mut(black_box(&mut monitor)));
    let assessment = SnapshotMonitor::assess(
        black_box(&mut monitor),
        black_box(epoch),
        black_box(&store),
        black_box(&ionosphere),
        black_box(&mut ledger),
        &mut NoCounter,
    );
    let verdict = assessment.verdict;
    call3(SnapshotMonitor::suspect, &monitor, &assessment, &verdict);
    if let (Some(solution), Some(satellite)) = (
        black_box(assessment).solution,
        Satellite::from_index(black_box(0)),
    ) {
        let workspace = monitor.workspace();
        call3(
            SnapshotWorkspace::row_left_out,
            workspace,
            satellite,
            &solution,
        );
        call3(
            SnapshotMonitor::disagreement,
            &monitor,
            satellite,
            &solution,
        );
    }
}

fn monitor(bytes: &[u8], out: &mut [u8]) {
    let mut monitor = Monitor::EMPTY;
    call2(Monitor::configure, &mut monitor, &Config::PRESET);
    call2(Monitor::push, &mut monitor, bytes);
    call1(Monitor::bytes_in_hand, &monitor);
    call1(Monitor::finish, &mut monitor);
    call2(Monitor::tick, &mut monitor, GpsTime::from_ns(0));
    call1(Monitor::counters, &monitor);
    call1(Monitor::ledger, &monitor);
    call1(Monitor::refused_configurations, &monitor);
    call1(Monitor::store, &monitor);
    call2(Monitor::configure_inertial, &mut monitor, &UNIT);
    call2(Monitor::configure_receiver_latency, &mut monitor, 0);
    call1(Monitor::navigation_now, &monitor);
    call2(Monitor::configure_magnetometer, &mut monitor, &MAGNETOMETER);
    call1(Monitor::tight, &monitor);
    call1(Monitor::opinions, &monitor);
    call1(Monitor::alert_state, &monitor);
    call1(Monitor::epoch_interval_ns, &monitor);
    let mut report = Monitor::process(black_box(&mut monitor), &mut NoCounter);
    call2(Monitor::miss_deadline, &mut monitor, &mut report);
    call2(report::encode, &report, &mut *out);
    call2(sentences::encode, &report, &mut *out);
    let (mut fast, mut secondaries) = (MonitorFastFilters::EMPTY, MonitorSecondaries::EMPTY);
    let report = Monitor::process_with(
        black_box(&mut monitor),
        &mut NoCounter,
        black_box(Some(BankMemory {
            fast: &mut fast,
            secondaries: &mut secondaries,
        })),
    );
    call2(report::encode, &report, out);

    let mut report = BankReport::EMPTY;
    call2(Monitor::bank_report, &monitor, &mut report);
    if let Some((time, verdict)) = Monitor::tight(&monitor).bank_verdict() {
        BankReport::fill(
            black_box(&mut report),
            black_box(*time),
            black_box(verdict),
            black_box(Monitor::tight(&monitor).bank()),
            black_box(0.0),
            black_box(None),
        );
    }
    call2(BankReport::encode, &report, out);
    call1(BankReport::decode, bytes);

    let report = Monitor::process(black_box(&mut monitor), &mut NoCounter);
    let inertial = Monitor::inertial_report(black_box(&monitor), black_box(&report));
    if let Some(inertial) = inertial {
        call2(InertialReport::encode, &inertial, out);
        call1(AlignmentMode::name, inertial.alignment.mode);
        if let Some(unit) = inertial.units.first() {
            call1(UnitState::name, unit.state);
            call1(UnitFault::name, unit.fault);
        }
        call1(VotingMode::name, inertial.voting);
    }
    call1(InertialReport::decode, bytes);
    call1(AlignmentMode::from_u8, 1);
    call1(UnitState::from_u8, 1);
    call1(UnitFault::from_u8, 1);
    call1(VotingMode::from_u8, 1);
    let sample = UnitSample {
        sample: SAMPLE,
        is_valid: true,
        temperature_c: None,
    };
    call3(Monitor::configure_unit, &mut monitor, 0, &VOTER);
    call3(Monitor::on_unit_sample, &mut monitor, 0, &sample);
    call1(Monitor::voting, &monitor);
    call3(ingest::encode_unit, 0, &VOTER, out);
    call1(ingest::decode_unit, bytes);
    voting(&sample);
    let time = SAMPLE.time;
    let pressure = PressureSample {
        time,
        pressure_pa: 1e5,
        temperature_c: 20.0,
    };
    call2(Monitor::on_pressure, &mut monitor, &pressure);
    let field = MagneticSample {
        time,
        field_s_ut: [20.0, 0.0, 40.0],
    };
    call2(Monitor::on_magnetic_field, &mut monitor, &field);
    call3(ingest::encode_unit_sample, 0, &sample, out);
    call2(ingest::encode_pressure, &pressure, out);
    call2(ingest::encode_magnetic_field, &field, out);
    call1(ingest::decode_unit_sample, bytes);
    call2(ingest::encode_receiver_latency, 120_000_000, out);
    call1(ingest::decode_receiver_latency, bytes);
    call1(ingest::decode_pressure, bytes);
    call1(ingest::decode_magnetic_field, bytes);

    let mut satellites = SatelliteReport::EMPTY;
    call3(
        Monitor::satellite_report,
        &monitor,
        &report,
        &mut satellites,
    );
    call3(
        |satellites: &mut SatelliteReport, workspace, report| {
            SatelliteReport::fill(satellites, &ObservationEpoch::EMPTY, workspace, report);
        },
        &mut satellites,
        &SnapshotWorkspace::EMPTY,
        &report,
    );
    call2(SatelliteReport::encode, &satellites, out);
    if let Ok(satellites) = SatelliteReport::decode(black_box(bytes))
        && let Some(row) = satellites.rows.first()
    {
        call1(SatelliteUse::name, row.fate);
    }
}

fn voting(sample: &UnitSample) {
    let mut voting = Voting::EMPTY;
    call2(Voting::begin, &mut voting, 10_000_000);
    call3(Voting::add, &mut voting, 0, &VOTER);
    call3(Voting::take, &mut voting, 0, sample);
    call1(Voting::next_sample, &mut voting);
    call2(Voting::shift, &mut voting, 0);
    call1(Voting::is_configured, &voting);
    call1(Voting::interval_ns, &voting);
    call2(Voting::unit, &voting, 0);
    call1(Voting::mode, &voting);
    call1(UnitConfig::check, &VOTER);
}

fn tight() {
    let mut tight = TightMonitor::EMPTY;
    call3(
        TightMonitor::configure,
        &mut tight,
        &UNIT,
        &surefix_core::integrity::Phase::Npa.requirements(),
    );
    call2(TightMonitor::on_sample, &mut tight, &SAMPLE);
    call3(
        TightMonitor::on_corrected,
        &mut tight,
        &CorrectedEpoch::EMPTY,
        None,
    );
    call1(TightMonitor::status, &tight);
    call1(TightMonitor::is_running, &tight);
    call1(TightMonitor::is_loose, &tight);
    call2(
        TightMonitor::configure_magnetometer,
        &mut tight,
        &MAGNETOMETER,
    );
    call1(TightMonitor::has_earned, &tight);
    call1(TightMonitor::obstacle, &tight);
    call1(TightMonitor::alignment_mode, &tight);
    call1(TightMonitor::navigation_now, &tight);
    call1(TightMonitor::horizon, &tight);
    call1(TightMonitor::sigma_attitude_ned_rad, &tight);
    call1(TightMonitor::intake, &tight);
    call1(TightMonitor::navigator, &tight);
    call1(TightMonitor::bank, &tight);
    call1(TightMonitor::bank_verdict, &tight);
    call1(TightMonitor::opinion, &tight);
    call1(TightMonitor::p_unmonitored, &tight);

    let mut workspace = SnapshotWorkspace::EMPTY;
    if let Some(satellite) = Satellite::new(System::Gps, black_box(1)) {
        call2(SnapshotWorkspace::sigma, &workspace, satellite);
        call2(SnapshotWorkspace::is_out_of_view, &workspace, satellite);
        call2(SnapshotWorkspace::why_left_out, &workspace, satellite);
        call2(SnapshotWorkspace::direction_rad, &workspace, satellite);
        call2(SnapshotWorkspace::cn0_dbhz, &workspace, satellite);
        call3(
            SnapshotWorkspace::range_residual_m,
            &workspace,
            satellite,
            [0.0; 3],
        );
        let solution = SnapshotWorkspace::solve(&mut workspace, SatelliteSet::EMPTY, None);
        if let Ok(solution) = solution {
            call3(
                SnapshotWorkspace::row_left_out,
                &workspace,
                satellite,
                &solution,
            );
        }
    }
    let corrected = SnapshotWorkspace::corrected(
        black_box(&mut workspace),
        black_box([0.0; 3]),
        black_box([0.0; 3]),
        black_box(SatelliteSet::EMPTY),
        black_box(&mut CorrectedEpoch::EMPTY.clone()),
    );
    black_box(corrected.is_ok());
}
