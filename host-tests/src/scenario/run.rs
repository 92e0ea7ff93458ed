//! `surefix scenario`: a folder through the monitor, on this machine or on the emulated board.
//!
//! ```text
//! folder ─► native frames ─► Executor ─► reports ─► result.csv
//! ```
//!
//! The clock of a scenario becomes GPS time by a fixed week, rounded to whole nanoseconds.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use surefix_core::bank_report::BankReport;
use surefix_core::config::Config;
use surefix_core::consts::MAX_SATELLITES;
use surefix_core::gnss::{CorrectedEpoch, CorrectedMeasurement};
use surefix_core::ingest::{
    IMU_FRAME_LENGTH, MAX_CORRECTED_EPOCH_BYTES, encode_configuration, encode_corrected_epoch,
    encode_end_of_stream, encode_imu, encode_inertial, encode_initial_state,
    encode_reference_model,
};
use surefix_core::ins::{
    AttitudeStart, ClockNoise, ImuSample, InertialConfig, InertialNoise, InitialSigma,
    InitialState, MeasurementFactors, ReferenceModel, SensorRange,
};
use surefix_core::report::EpochReport;
use surefix_core::time::{GpsTime, NS_PER_S, NS_PER_WEEK};
use surefix_core::wire::counters::Counters;
use surefix_core::wire::native::{self, MAX_FRAME};

use super::folder::{GnssEpoch, ImuRow, Init, SAME_TIME_S, Scenario};
use super::result::{ResultFile, ResultRow};
use crate::qemu::QemuExecutor;
use crate::replay::{self, Executor, HostExecutor, Machine, OutputReader};
use crate::source;

/// GPS week of t_s = 0.
const WEEK: i32 = 2400;
/// Ends of the sensors: far above anything, for a scenario does not tell them.
const NO_LIMIT: f64 = 1e6;

/// Runs a scenario folder through the monitor and writes result.csv
///
/// One row per epoch of gnss.csv: position, velocity, attitude and clock of the main filter, statistic
/// and threshold of every sub-filter, levels, and the satellites excluded.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// Scenario folder: imu.csv, gnss.csv and init.csv
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Where the monitor runs
    #[arg(long, value_enum, default_value = "host")]
    pub on: Machine,
    /// Directory to write result.csv to
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// What came out of a scenario.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// `result.csv`.
    pub result: ResultFile,
    /// One report per epoch.
    pub reports: Vec<EpochReport>,
    /// Epochs without a navigation solution: numbers of their rows are NaN.
    pub without_solution: usize,
    /// Lost input by cause.
    pub losses: Vec<(String, u64)>,
}

fn instant(t_s: f64) -> GpsTime {
    let ns = (t_s * NS_PER_S as f64).round() as i64;
    GpsTime::from_week_tow_ns(WEEK, ns)
}

/// What the monitor must know of the unit and the clock.
fn inertial_config(init: &Init) -> InertialConfig {
    InertialConfig {
        interval_ns: (init.imu_dt_s * NS_PER_S as f64).round() as u32,
        c_b_s: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        lever_arm_b_m: [0.0; 3],
        noise: InertialNoise {
            arw: init.arw,
            vrw: init.vrw,
            gyro_bias_walk: init.gyro_bias_walk,
            accel_bias_walk: init.accel_bias_walk,
        },
        clock: ClockNoise {
            bias_psd: init.clock_bias_psd,
            drift_psd: init.clock_drift_psd,
            drift_decay_per_s: init.clock_decay_per_s,
            inter_system_psd: 0.0,
        },
        measurement: MeasurementFactors::ONE,
        range: SensorRange {
            rate_radps: NO_LIMIT,
            specific_force_mps2: NO_LIMIT,
        },
        // The state that follows brings its own attitude.
        start: AttitudeStart::Given {
            roll_pitch_heading_rad: [0.0; 3],
        },
        sigma: InitialSigma {
            position_m: init.sigma_position_m,
            velocity_mps: init.sigma_velocity_mps,
            attitude_ned_rad: init.sigma_attitude_ned_rad,
            gyro_bias_radps: init.sigma_gyro_bias_radps,
            accel_bias_mps2: init.sigma_accel_bias_mps2,
            clock_bias_m: init.sigma_clock_bias_m,
            clock_drift_mps: init.sigma_clock_drift_mps,
        },
    }
}

fn initial_state(init: &Init) -> InitialState {
    InitialState {
        time: instant(init.t0_s),
        r_eb_e_m: init.r_eb_e_m,
        v_eb_e_mps: init.v_eb_e_mps,
        q_e_b: init.q_e_b,
        gyro_bias_radps: init.gyro_bias_radps,
        accel_bias_mps2: init.accel_bias_mps2,
        clock_bias_m: init.clock_bias_m,
        clock_drift_mps: init.clock_drift_mps,
    }
}

fn reference_model(init: &Init) -> Result<ReferenceModel> {
    let hold_ns = init.hold_s * NS_PER_S as f64;
    if hold_ns > NS_PER_WEEK as f64 {
        bail!("hold_s of init.csv is {} s: at most a week", init.hold_s);
    }
    Ok(ReferenceModel {
        p_fa: init.p_fa,
        p_md: init.p_md,
        p_h0: init.p_h0,
        hal_m: init.hal_m,
        val_m: init.val_m,
        detect_vertical: init.detect_vertical,
        exclude: init.exclude,
        hold_ns: hold_ns.round() as i64,
    })
}

fn imu_sample(row: &ImuRow, interval_ns: u32) -> ImuSample {
    ImuSample {
        time: instant(row.t_s),
        interval_ns,
        dtheta_is_s_rad: row.dtheta_ib_b_rad,
        dv_is_s_mps: row.dv_ib_b_mps,
    }
}

fn corrected_epoch(epoch: &GnssEpoch) -> Result<CorrectedEpoch> {
    let mut corrected = CorrectedEpoch::EMPTY;
    corrected.time = instant(epoch.t_s);
    for row in &epoch.rows {
        let measurement = CorrectedMeasurement {
            satellite: row.satellite,
            r_es_e_m: row.r_es_e_m,
            v_es_e_mps: row.v_es_e_mps,
            pseudorange_m: row.pseudorange_m,
            sigma_pseudorange_m: row.sigma_pseudorange_m,
            range_rate_mps: Some((row.range_rate_mps, row.sigma_range_rate_mps)),
        };
        if corrected.rows.push(measurement).is_err() {
            bail!(
                "gnss.csv has {} satellites at {} s: an epoch holds {MAX_SATELLITES}",
                epoch.rows.len(),
                epoch.t_s
            );
        }
    }
    Ok(corrected)
}

/// The bytes a board would be sent: what to know first, then samples and epochs in the order of time.
///
/// # Errors
/// When the folder holds more than the monitor takes, or numbers a frame has no room for.
pub fn stream(scenario: &Scenario) -> Result<Vec<u8>> {
    let init = &scenario.init;
    let config = inertial_config(init);
    if let Err(error) = config.check() {
        bail!("init.csv: the monitor does not take this inertial unit: {error:?}");
    }
    let mut bytes = Vec::with_capacity(scenario.imu.len() * IMU_FRAME_LENGTH);
    let mut buffer = vec![0; MAX_CORRECTED_EPOCH_BYTES.max(MAX_FRAME)];
    let mut put =
        |encode: &dyn Fn(&mut [u8]) -> Result<usize, native::Full>| match encode(&mut buffer) {
            Ok(length) => {
                bytes.extend_from_slice(&buffer[..length]);
                Ok(())
            }
            Err(native::Full) => bail!("a frame of the scenario does not fit its buffer"),
        };
    let model = reference_model(init)?;
    put(&|out| encode_configuration(&Config::PRESET, out))?;
    put(&|out| encode_reference_model(&model, out))?;
    put(&|out| encode_inertial(&config, out))?;
    put(&|out| encode_initial_state(&initial_state(init), out))?;
    let mut samples = scenario.imu.iter().peekable();
    for epoch in &scenario.epochs {
        while let Some(row) = samples.next_if(|row| row.t_s <= epoch.t_s + SAME_TIME_S) {
            put(&|out| encode_imu(&imu_sample(row, config.interval_ns), out))?;
        }
        let corrected = corrected_epoch(epoch)?;
        put(&|out| encode_corrected_epoch(&corrected, out))?;
    }
    put(&encode_end_of_stream)?;
    Ok(bytes)
}

/// Statistic and threshold of each satellite, NaN where it is not in the bank.
fn tests(bank: Option<&BankReport>, satellites: &[String]) -> Vec<[f64; 2]> {
    let of = |name: &String| {
        let test = bank?
            .tests
            .iter()
            .find(|test| test.satellite.to_string() == *name)?;
        let ([statistic_m, _], [threshold_m, _]) = (test.statistic_m, test.threshold_m);
        Some([statistic_m, threshold_m].map(|value| value.unwrap_or(f64::NAN)))
    };
    satellites
        .iter()
        .map(|name| of(name).unwrap_or([f64::NAN; 2]))
        .collect()
}

fn result_row(
    epoch: &GnssEpoch,
    report: Option<&EpochReport>,
    bank: Option<&BankReport>,
    excluded: &[String],
    satellites: &[String],
) -> ResultRow {
    let solution = report.and_then(|report| Some((report.fix?, report.navigation?)));
    let three = [f64::NAN; 3];
    let (r, v, q, clock, level) = match solution {
        Some((fix, navigation)) => (
            fix.r_e_m,
            navigation.v_e_mps,
            navigation.q_e_b,
            navigation.clock,
            navigation.fault_free_m[0],
        ),
        None => (three, three, [f64::NAN; 4], [f64::NAN; 2], f64::NAN),
    };
    let level_of_bank = |axis: usize| match bank {
        Some(bank) => bank.level_m[axis].unwrap_or(f64::INFINITY),
        None => f64::NAN,
    };
    ResultRow {
        t_s: epoch.t_s,
        r_eb_e_m: r,
        v_eb_e_mps: v,
        q_e_b: q,
        clock,
        hpl_m: level_of_bank(0),
        vpl_m: level_of_bank(1),
        hpl0_m: level,
        detected: bank.is_some_and(|bank| bank.detected),
        excluded: excluded.to_vec(),
        n_sats: report.map_or(0, |report| report.used.len()),
        tests: tests(bank, satellites),
    }
}

/// Runs a scenario; `progress` sees how many epochs were reported so far.
///
/// # Errors
/// When the scenario is unusable or the emulator cannot be run; the message tells what to do.
pub fn run(
    scenario: &Scenario,
    machine: Machine,
    progress: &mut dyn FnMut(usize),
) -> Result<Outcome> {
    let bytes = stream(scenario)?;
    let mut executor: Box<dyn Executor> = match machine {
        Machine::Host => Box::new(HostExecutor),
        Machine::Qemu => Box::new(QemuExecutor::build()?),
    };
    let mut reader = OutputReader::default();
    executor.run(&bytes, &mut |piece| {
        reader.push(piece);
        progress(reader.reports.len());
    })?;
    let mut losses: Vec<(String, u64)> = source::losses(&reader.counters.unwrap_or(Counters::ZERO))
        .into_iter()
        .collect();
    let epochs = scenario.epochs.len() as u64;
    let missing = epochs.saturating_sub(reader.reports.len() as u64);
    for (cause, count) in [
        ("output_damaged", reader.damaged),
        ("epochs_not_reported", missing),
    ] {
        if count > 0 {
            losses.push((cause.into(), count));
        }
    }
    let satellites = scenario.satellites();
    // In the order of their exclusion, which a set does not keep.
    let mut excluded: Vec<String> = Vec::new();
    let rows: Vec<ResultRow> = scenario
        .epochs
        .iter()
        .map(|epoch| {
            let time = instant(epoch.t_s);
            let report = reader.reports.iter().find(|report| report.time == time);
            let mut banks = reader.banks.iter().flatten();
            let bank = banks.find(|bank| bank.time == time).map(|bank| &**bank);
            for satellite in bank.iter().flat_map(|bank| bank.excluded.iter()) {
                let name = satellite.to_string();
                if !excluded.contains(&name) {
                    excluded.push(name);
                }
            }
            result_row(epoch, report, bank, &excluded, &satellites)
        })
        .collect();
    let without_solution = rows.iter().filter(|row| row.hpl0_m.is_nan()).count();
    Ok(Outcome {
        result: ResultFile { satellites, rows },
        reports: reader.reports,
        without_solution,
        losses,
    })
}

/// `surefix scenario`: writes `result.csv`, and gives what was done.
///
/// # Errors
/// When the folder or the directory is unusable; the message tells what to do.
pub fn run_command(args: &Args, progress: &mut dyn FnMut(usize, usize)) -> Result<Outcome> {
    let scenario = Scenario::read(&args.folder)?;
    // Before the run, which may take minutes.
    replay::make_directory(&args.out)?;
    let epochs = scenario.epochs.len();
    let outcome = run(&scenario, args.on, &mut |done| progress(done, epochs))?;
    write(&outcome.result, &args.out)?;
    Ok(outcome)
}

fn write(result: &ResultFile, directory: &Path) -> Result<()> {
    result
        .write(&directory.join("result.csv"))
        .context("give another --out")
}
