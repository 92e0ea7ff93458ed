//! What goes out besides frames.

use super::measure::{RUNS, Row, require};
use super::sky::Random;
use core::hint::black_box;
use surefix_core::gnss::solution::SATELLITE_REASONS;
use surefix_core::gnss::{Satellite, SatelliteSet, System};
use surefix_core::integrity::{InertialStatus, Integrity, Mode, Reason, Suspect, Verdict};
use surefix_core::report::{EpochReport, Fix, ReportFlags};
use surefix_core::sentences::{self, MAX_SENTENCES_BYTES};
use surefix_core::time::GpsTime;

/// The NMEA sentences of a report with everything in it.
#[inline(never)]
pub fn all() {
    let mut random = Random::new(7);
    let mut out = [0; MAX_SENTENCES_BYTES];
    let mut row = Row::new();
    for run in 0..RUNS {
        let report = sentence_report(&mut random, run as u8);
        let mut length = 0;
        row.run(|| length = sentences::encode(black_box(&report), &mut out).unwrap_or(0));
        require(length > 250, "the sentences are too short");
    }
    row.print("output/sentences", None, None);
}

fn sentence_report(random: &mut Random, run: u8) -> EpochReport {
    let mut verdict = Verdict::unavailable(Reason::None, 40.0, None);
    verdict.integrity = Integrity::Excluded;
    let suspect = Satellite::new(System::Galileo, 1 + run).map(|satellite| Suspect {
        satellite,
        bias_m: 200.0 * random.unit() - 100.0,
        sigma_m: 1.0 + random.unit(),
        p_md: 1e-3,
    });
    EpochReport {
        time: GpsTime::from_week_tow_s(2420, 274_200 + i64::from(run)),
        since_first_ns: 0,
        mode: Mode::Snapshot,
        fix: Some(Fix {
            r_e_m: [0.0; 3],
            lat_deg: 180.0 * random.unit() - 90.0,
            lon_deg: 360.0 * random.unit() - 180.0,
            h_m: 3000.0 * random.unit(),
            velocity_enu_mps: Some([0.0; 3].map(|_| 10.0 + 200.0 * random.unit())),
            clock_m: [None; 3],
        }),
        verdict,
        used: SatelliteSet::from_masks([0xfff, 0, 0xff]),
        n_observed: 20,
        unused: [0; SATELLITE_REASONS],
        flags: ReportFlags::default(),
        residual_rms_m: Some(random.unit()),
        sigma_enu_m: Some([0.0; 3].map(|_| random.unit())),
        suspect,
        navigation: None,
        inertial: InertialStatus::Off,
    }
}
