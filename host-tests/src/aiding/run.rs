//! A simulated flight with aids through the whole monitor, by bytes.

use anyhow::{Result, bail};
use surefix_core::config::{Config, IonosphereModel};
use surefix_core::inertial_report::InertialReport;
use surefix_core::ingest::{encode_configuration, encode_end_of_stream, encode_inertial};
use surefix_core::ins::{AidsConfig, PressureSample};
use surefix_core::integrity::Phase;
use surefix_core::report::EpochReport;
use surefix_core::wire::native;

use super::{Air, BarometerFault, with_aids};
use crate::imu::{Pending, interleave};
use crate::replay::{Executor, HostExecutor, OutputReader};
use crate::simulate::atmosphere::Ionosphere;
use crate::simulate::flight::geodetic_from_ecef;
use crate::simulate::inertial::Scenario;
use crate::simulate::inertial::board::{Radio, receiver_bytes, unit};
use crate::simulate::sky::WEEK;
use crate::simulate::stream::Format;
use crate::truth::Truth;

const RADIO: Radio = Radio {
    dual_frequency: false,
    ionosphere: Ionosphere::None,
    troposphere: true,
    format: Format::Rtcm3,
};

/// An epoch of the monitor beside the truth.
#[derive(Clone, Debug)]
pub struct AidedRow {
    /// Since the start, s.
    pub t_s: f64,
    /// East, north, up, m.
    pub error_enu_m: Option<[f64; 3]>,
    /// What the monitor said.
    pub report: EpochReport,
    /// What it said of its inertial side.
    pub inertial: Option<InertialReport>,
}

impl AidedRow {
    /// Whether a usable position is off by more than one of its levels.
    pub fn misleads(&self) -> bool {
        let verdict = &self.report.verdict;
        let (Some([e, n, u]), true) = (self.error_enu_m, verdict.integrity.is_usable()) else {
            return false;
        };
        let within = |error_m: f64, bound_m: Option<f64>| bound_m.is_some_and(|m| error_m <= m);
        !(within(e.hypot(n), verdict.hpl.bound_m()) && within(u.abs(), verdict.vpl.bound_m()))
    }
}

/// What a barometer on a flight measures.
pub fn pressures(
    scenario: &Scenario,
    air: &Air,
    seed: u64,
    fault: Option<BarometerFault>,
) -> Vec<PressureSample> {
    air.samples(
        scenario.start,
        f64::from(scenario.duration_s),
        seed,
        fault,
        |t_s| geodetic_from_ecef(&scenario.trajectory.state(t_s).r_eb_e).2,
    )
}

/// The configuration of such flights.
pub fn config(phase: Phase) -> Config {
    Config {
        phase,
        ionosphere: IonosphereModel::None,
        reference_week: u16::try_from(WEEK).ok(),
        ..Config::PRESET
    }
}

/// Flies a scenario; without `with_unit` its inertial unit stays on the ground.
///
/// # Errors
/// When a frame does not encode or the monitor cannot be run to the end.
pub fn fly_aided(
    scenario: &Scenario,
    phase: Phase,
    with_unit: bool,
    aids: &AidsConfig,
    pressures: &[PressureSample],
) -> Result<Vec<AidedRow>> {
    let config = config(phase);
    let mut stream = frame(|out| encode_configuration(&config, out))?;
    let receiver = receiver_bytes(scenario, &RADIO)?;
    if with_unit {
        stream.extend(frame(|out| encode_inertial(&unit(scenario), out))?);
        interleave(
            &receiver,
            &config,
            Pending::new(&scenario.imu),
            |_| 0,
            &mut stream,
        )?;
    } else {
        stream.extend(receiver);
    }
    stream.extend(frame(encode_end_of_stream)?);
    let bytes = if *aids == AidsConfig::NONE {
        stream
    } else {
        with_aids(&stream, &config, aids, pressures)?
    };
    let mut reader = OutputReader::default();
    HostExecutor.run(&bytes, &mut |piece| reader.push(piece))?;
    if reader.damaged > 0 {
        bail!("{} frames of the monitor could not be read", reader.damaged);
    }
    let rows = reader.reports.into_iter().zip(reader.inertial);
    Ok(rows
        .map(|(report, inertial)| {
            let t_s = report.time.seconds_since(scenario.start);
            let true_e_m = scenario.trajectory.state(t_s).r_eb_e.into();
            let error_enu_m = report
                .fix
                .and_then(|fix| Truth::error_enu_m(true_e_m, fix.r_e_m));
            AidedRow {
                t_s,
                error_enu_m,
                report,
                inertial,
            }
        })
        .collect())
}

fn frame(encode: impl FnOnce(&mut [u8]) -> Result<usize, native::Full>) -> Result<Vec<u8>> {
    let mut out = vec![0; native::MAX_FRAME];
    match encode(&mut out) {
        Ok(length) => {
            out.truncate(length);
            Ok(out)
        }
        Err(native::Full) => bail!("a frame does not fit"),
    }
}
