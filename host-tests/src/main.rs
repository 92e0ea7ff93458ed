//! The `surefix` command.
//!
//! Exit code 0: done. 1: finished, but the input had errors that cost epochs. 2: unusable input or
//! arguments; the message says what to do.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::{Parser, Subcommand};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use surefix_core::ins::BarometerModel;
use surefix_host_tests::faults::FaultSpec;
use surefix_host_tests::fixes::{FixOptions, Outage};
use surefix_host_tests::replay::{self, Machine, ReplayOptions, ReplayResult};
use surefix_host_tests::settings::Settings;
use surefix_host_tests::static_imu;
use surefix_host_tests::truth::TruthArguments;
use surefix_host_tests::{
    araim, calibrate, campaign, compare, hybrid, mutate, output, real_time, report, scenario,
    simulate,
};

#[derive(Parser)]
#[command(
    name = "surefix",
    version,
    about = "GNSS integrity monitor: replay, simulation, campaigns, reports"
)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Run a recording through the monitor
    Replay(Box<ReplayArguments>),
    Scenario(scenario::run::Args),
    Araim(araim::Args),
    Compare(Box<compare::Args>),
    /// Simulate a flight: the bytes a receiver would send, and the truth
    Simulate(simulate::Command),
    /// A recorded inertial unit and the receiver its antenna's track would have had, under real orbits
    Hybrid(hybrid::Args),
    /// Samples of an inertial unit at rest beside the fixed antenna of a recording, and its settings
    StaticImu(static_imu::Args),
    /// Hard and soft iron of a magnetometer, from readings all around
    CalibrateMagnetometer(calibrate::Args),
    /// Many trials of one question, counted
    Campaign(Box<campaign::Args>),
    RealTime(real_time::Args),
    Mutate(mutate::Args),
    /// One self-contained HTML page of a replay
    Report(report::Args),
}

#[derive(clap::Args)]
struct ReplayArguments {
    /// u-blox UBX (RXM-RAWX, RXM-SFRBX), RTCM 3, or RINEX 3 or 4 observations, also .gz and .crx; of a receiver
    /// without observations UBX with NAV-PVT, or an RTKLIB .pos; recognised by content
    #[arg(long, value_name = "FILE")]
    gnss: PathBuf,
    /// RINEX 3 or 4 navigation file; may be given several times
    #[arg(long, value_name = "FILE")]
    nav: Vec<PathBuf>,
    /// Recording of an inertial unit: CSV as described in section `[imu]` of the file of --config, or
    /// surefix's own frames; given two or three times, CSV of as many units that vote, described in sections
    /// `[[imu.unit]]`
    #[arg(long, value_name = "FILE")]
    imu: Vec<PathBuf>,
    /// Recording of a barometer: CSV with the columns week, tow_s, pressure_pa, temperature_c; makes it an aid,
    /// as section `[aids.barometer]` of the file of --config does with numbers of its own
    #[arg(long, value_name = "FILE")]
    barometer: Option<PathBuf>,
    #[command(flatten)]
    truth: TruthArguments,
    #[command(flatten)]
    settings: Settings,
    /// Fault to put on a satellite: `SAT:KIND:MAG:T0:T1[:rr][:PERIOD]`, KIND one of step, ramp, noise,
    /// walk, osc; may be given several times
    #[arg(long, value_name = "SPEC", allow_hyphen_values = true)]
    fault: Vec<String>,
    /// Withholds a receiver's own solutions from T0 to T1, seconds from the first epoch; may be given several
    /// times
    #[arg(long, value_name = "T0:T1")]
    outage: Vec<Outage>,
    /// Height of the geoid, m, to add to the heights of an RTKLIB .pos file given as --gnss
    #[arg(long, value_name = "METRES", allow_hyphen_values = true)]
    geoid: Option<f64>,
    /// Seed of random faults
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Settings in TOML; flags win over it
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Where the monitor runs
    #[arg(long, value_enum, default_value = "host")]
    on: Machine,
    /// Which verdicts to print as they come
    #[arg(long, value_enum, default_value = "changes")]
    print: Print,
    /// Directory to write epochs.csv, satellites.csv, sentences.nmea, errors.csv, summary.json, track.kml, track.gpx and report.html to
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum Print {
    /// None
    Nothing,
    /// The first, and each that differs from the one before
    Changes,
    /// Each
    Epochs,
}

impl ReplayArguments {
    fn options(&self) -> Result<ReplayOptions> {
        let faults: Result<Vec<FaultSpec>, _> = self.fault.iter().map(|s| s.parse()).collect();
        let settings = self.settings.clone().over_file(self.config.as_ref())?;
        let mut aids = settings.aids.unwrap_or_default().config()?;
        if self.barometer.is_some() {
            aids.barometer.get_or_insert(BarometerModel::PRESET);
        }
        Ok(ReplayOptions {
            gnss: self.gnss.clone(),
            nav: self.nav.clone(),
            truth: self.truth.choice()?,
            config: settings.config()?,
            imu: self.imu.clone(),
            imu_settings: settings.imu,
            aids,
            barometer: self.barometer.clone(),
            faults: faults?,
            fixes: FixOptions {
                geoid_m: self.geoid,
                outages: self.outage.clone(),
            },
            seed: self.seed,
            machine: self.on,
        })
    }
}

fn progress_bar() -> Result<ProgressBar> {
    // The default draw target hides itself where stderr is no terminal.
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    bar.set_style(
        ProgressStyle::with_template("{bar:40} {pos}/{len} epochs, {eta} left")
            .context("progress bar")?,
    );
    Ok(bar)
}

fn run_scenario(arguments: &scenario::run::Args) -> Result<ExitCode> {
    let bar = progress_bar()?;
    let outcome = scenario::run::run_command(arguments, &mut |done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    })?;
    bar.finish_and_clear();
    println!("{} epochs", outcome.result.rows.len());
    for (cause, count) in &outcome.losses {
        println!("input: {cause} {count}");
    }
    println!("result: {}", arguments.out.join("result.csv").display());
    if outcome.without_solution == 0 {
        return Ok(ExitCode::SUCCESS);
    }
    let why = outcome
        .reports
        .iter()
        .find(|report| report.navigation.is_none())
        .map_or("not reported", |report| report.inertial.name());
    eprintln!(
        "surefix: {} epochs have no solution, the first because: {why}; their numbers are nan",
        outcome.without_solution
    );
    Ok(ExitCode::from(1))
}

fn run_compare(arguments: &compare::Args) -> Result<ExitCode> {
    let bar = progress_bar()?;
    let comparison = compare::run(arguments, &mut |done, all| {
        bar.set_length(all);
        bar.set_position(done);
    })?;
    bar.finish_and_clear();
    print!("{}", compare::report::tables(&comparison));
    println!("written: {}", arguments.out.join("comparison.md").display());
    Ok(ExitCode::SUCCESS)
}

fn replay(arguments: &ReplayArguments) -> Result<ExitCode> {
    let options = arguments.options()?;
    // Before the replay, which may take minutes.
    replay::make_directory(&arguments.out)?;
    let bar = progress_bar()?;
    let mut printed = 0;
    let mut last = None;
    let result = replay::run(&options, &mut |reports, all| {
        bar.set_length(all);
        bar.set_position(reports.len() as u64);
        for report in reports.get(printed..).unwrap_or_default() {
            let state = (
                report.verdict.integrity,
                report.verdict.reason,
                report.verdict.excluded,
            );
            let wanted = match arguments.print {
                Print::Nothing => false,
                Print::Changes => last != Some(state),
                Print::Epochs => true,
            };
            last = Some(state);
            if wanted {
                bar.suspend(|| println!("{}", output::epoch_line(report)));
            }
        }
        printed = reports.len();
    })?;
    bar.finish_and_clear();
    replay::write(&options, &result, &arguments.out)?;
    print_summary(&result, arguments);
    if result.reports.is_empty() {
        eprintln!(
            "surefix: {} holds no observation epoch surefix can use; summary.json counts what it holds. Record MSM4 to MSM7 messages of GPS, Galileo or BDS; of a u-blox receiver RXM-RAWX and RXM-SFRBX (u-center: View, Messages View, RXM, Enable Message); or give RINEX observations",
            arguments.gnss.display()
        );
    }
    Ok(if result.lost_epochs() {
        ExitCode::from(1)
    } else {
        ExitCode::SUCCESS
    })
}

fn print_summary(result: &ReplayResult, arguments: &ReplayArguments) {
    let summary = &result.summary;
    let metres = |value: Option<f64>| value.map_or("-".into(), |m| format!("{m:.2} m"));
    let ratio = |value: Option<f64>| value.map_or("-".into(), |r| format!("{r:.2}"));
    println!(
        "{}: {} epochs, {} with a position",
        result.info.format, summary.epochs, summary.epochs_with_position
    );
    let states: Vec<String> = summary
        .integrity
        .iter()
        .map(|(state, count)| format!("{state} {count}"))
        .collect();
    println!("verdicts: {}", states.join(", "));
    println!(
        "levels: median HPL {}, VPL {}",
        metres(summary.median_hpl_m),
        metres(summary.median_vpl_m)
    );
    let bank = &summary.bank;
    if let (Some(fewest), Some(most)) = (bank.fewest_satellites, bank.most_satellites) {
        println!(
            "bank: {} epochs, {fewest} to {most} satellites; a test failed in {}, no place for a satellite in {}",
            bank.epochs, bank.epochs_with_failed_test, bank.epochs_over_capacity
        );
    }
    match &summary.truth {
        Some(source) => {
            let errors = &summary.errors;
            println!(
                "errors against {source}: H95 {}, V95 {}, largest {} and {}; above a level in {} epochs, largest error over HPL {}, over VPL {}",
                metres(errors.h95_m),
                metres(errors.v95_m),
                metres(errors.max_error_h_m),
                metres(errors.max_error_v_m),
                errors.epochs_with_error_above_level,
                ratio(errors.largest_error_over_hpl),
                ratio(errors.largest_error_over_vpl)
            );
        }
        None => {
            let why = result.truth_unused.as_deref();
            let why = why.unwrap_or("no truth known");
            println!("errors: {why}; give --truth, --at or --at-llh");
        }
    }
    for interval in &summary.exclusions {
        println!(
            "excluded: {} from {} s to {} s, {} epochs",
            interval.satellite.as_deref().unwrap_or("-"),
            interval.from_s,
            interval.to_s,
            interval.epochs
        );
    }
    for (cause, count) in &result.losses {
        println!("input: {cause} {count}");
    }
    println!("report: {}", arguments.out.join("report.html").display());
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let outcome = match &arguments.command {
        Command::Replay(arguments) => replay(arguments),
        Command::Scenario(arguments) => run_scenario(arguments),
        Command::Araim(arguments) => araim::run(arguments).map(|failed| match failed {
            0 => ExitCode::SUCCESS,
            _ => ExitCode::from(1),
        }),
        Command::Compare(arguments) => run_compare(arguments),
        Command::Simulate(arguments) => arguments.run().map(|()| ExitCode::SUCCESS),
        Command::Hybrid(arguments) => hybrid::run(arguments).map(|()| ExitCode::SUCCESS),
        Command::RealTime(arguments) => arguments.run().map(|holds| match holds {
            true => ExitCode::SUCCESS,
            false => ExitCode::from(1),
        }),
        Command::CalibrateMagnetometer(arguments) => {
            calibrate::run(arguments).map(|()| ExitCode::SUCCESS)
        }
        Command::StaticImu(arguments) => static_imu::run(arguments).map(|()| ExitCode::SUCCESS),
        Command::Campaign(arguments) => campaign::run(arguments).map(|()| ExitCode::SUCCESS),
        Command::Mutate(arguments) => mutate::run(arguments).map(|()| ExitCode::SUCCESS),
        Command::Report(arguments) => report::run(arguments).map(|()| ExitCode::SUCCESS),
    };
    outcome.unwrap_or_else(|error| {
        eprintln!("surefix: {error:#}");
        ExitCode::from(2)
    })
}
