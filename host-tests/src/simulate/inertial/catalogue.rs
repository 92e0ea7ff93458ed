//! The flights that carry an inertial unit.
//!
//! Times in s, angles in degrees, speeds in m/s. All manoeuvres begin and end at whole seconds, so that
//! no inertial sample straddles one.

use anyhow::Result;
use surefix_core::ins::sample::ReferenceModel;
use surefix_core::integrity::Phase;

use super::measurements::Outage;
use super::motion::{Motion, Shake};
use super::profile::Profile;
use super::sensors::Grade;
use super::trajectory::Anchor;
use crate::faults::FaultSpec;
use crate::simulate::flight::{
    Flight, GLIDE_PATH_DEG, RUNWAY_HEADING_DEG, THRESHOLD, THRESHOLD_CROSSING_M,
};

/// Vertical alert limit where the phase of flight has none: it is written, not tested.
const UNTESTED_VAL_M: f64 = 50.0;

/// All there is to a flight but chance.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Length, s.
    pub duration_s: u32,
    /// The motion.
    pub motion: Motion,
    /// A place on the way.
    pub anchor: Anchor,
    /// Grade of the inertial unit unless told otherwise.
    pub grade: Grade,
    /// No noise.
    pub noise_free: bool,
    /// Requirements.
    pub reference: ReferenceModel,
    /// Times without most satellites.
    pub outages: Vec<Outage>,
    /// Faults that belong to the flight.
    pub faults: Vec<FaultSpec>,
}

impl Plan {
    pub(crate) fn new(
        duration_s: u32,
        grade: Grade,
        phase: Phase,
        motion: Motion,
        anchor: Anchor,
    ) -> Self {
        let requirements = phase.requirements();
        Self {
            duration_s,
            motion,
            anchor,
            grade,
            noise_free: false,
            reference: ReferenceModel {
                p_fa: 3.33e-7,
                p_md: requirements.p_md,
                p_h0: requirements.p_fault_free,
                hal_m: requirements.hal_m,
                val_m: requirements.val_m.unwrap_or(UNTESTED_VAL_M),
                detect_vertical: requirements.val_m.is_some(),
                exclude: true,
                hold_ns: 0,
            },
            outages: Vec::new(),
            faults: Vec::new(),
        }
    }

    fn with_fault(mut self, spec: &str) -> Result<Self> {
        self.faults.push(spec.parse()?);
        Ok(self)
    }
}

/// The plan of a flight; `None` for the one that is a receiver only.
pub fn plan(flight: Flight) -> Result<Option<Plan>> {
    Ok(Some(match flight {
        Flight::Approach => return Ok(None),
        Flight::Static => mast(600),
        Flight::StaticPerfect => Plan {
            noise_free: true,
            ..mast(120)
        },
        Flight::Coasting => coasting(),
        Flight::Npa => npa(),
        Flight::NpaRamp => npa().with_fault("G04:ramp:1:300:500")?,
        Flight::NpaStep => npa().with_fault("G04:step:30:300:500")?,
        Flight::Lpv200 => lpv200(),
        Flight::Lpv200Ramp => lpv200().with_fault("G04:ramp:0.5:120:270")?,
        Flight::Lpv200Step => lpv200().with_fault("G04:step:25:120:270")?,
        Flight::P4Flight => p4_flight(),
        Flight::UavSurvey => uav_survey(),
        Flight::Evtol => evtol(),
        Flight::EnrouteTurn => enroute_turn(),
        Flight::GoAround => go_around(),
        Flight::Coning => coning(),
        Flight::Drive => drive(),
    }))
}

/// A place over the threshold of the simulated runway.
pub(crate) fn over_threshold(at_s: u32, above_m: f64) -> Anchor {
    let (latitude_deg, longitude_deg, height_m) = THRESHOLD;
    Anchor {
        at_s,
        latitude_deg,
        longitude_deg,
        height_m: height_m + above_m,
    }
}

/// Bolted to the mast.
fn mast(duration_s: u32) -> Plan {
    Plan::new(
        duration_s,
        Grade::Navigation,
        Phase::Npa,
        Motion::level(60.0, 0.0),
        over_threshold(0, 0.0),
    )
}

/// Cruise at 9000 m and 220 m/s; turns before, in and after the outages.
fn coasting() -> Plan {
    let motion = Motion::level(28.0, 220.0)
        .turn(60.0, 95.0, 45.0, 5.0)
        .turn(200.0, 230.0, -40.0, 5.0)
        .turn(330.0, 360.0, 30.0, 5.0)
        .turn(480.0, 510.0, -35.0, 5.0);
    let outage = |from_s: f64, keep: usize| Outage {
        from_s,
        to_s: from_s + 60.0,
        keep,
    };
    let mut plan = Plan::new(
        600,
        Grade::Navigation,
        Phase::Npa,
        motion,
        over_threshold(0, 9000.0),
    );
    plan.outages = vec![
        outage(180.0, 3),
        outage(240.0, 2),
        outage(300.0, 1),
        outage(360.0, 0),
    ];
    plan.reference.hold_ns = 120_000_000_000;
    plan
}

/// Base turn, intercept, descent from about 1000 m to a minimum of 150 m, level to the threshold.
fn npa() -> Plan {
    let motion = Motion::level(RUNWAY_HEADING_DEG - 120.0, 110.0)
        .accelerate(60.0, 100.0, -20.0, 5.0)
        .turn(120.0, 150.0, 60.0, 5.0)
        .turn(220.0, 250.0, 60.0, 5.0)
        .accelerate(290.0, 315.0, -15.0, 5.0)
        .slope(320.0, 328.0, -GLIDE_PATH_DEG)
        .slope(550.0, 558.0, 0.0);
    Plan::new(
        600,
        Grade::Tactical,
        Phase::Npa,
        motion,
        over_threshold(600, 150.0),
    )
}

/// Up to the decision height: intercept of the localiser, then of the glide path.
fn towards_threshold() -> Motion {
    Motion::level(RUNWAY_HEADING_DEG - 30.0, 75.0)
        .turn(20.0, 40.0, 30.0, 4.0)
        .accelerate(60.0, 80.0, -5.0, 4.0)
        .slope(90.0, 98.0, -GLIDE_PATH_DEG)
}

/// Over the threshold at 15 m after 290 s, flare.
fn lpv200() -> Plan {
    Plan::new(
        300,
        Grade::Tactical,
        Phase::Lpv200,
        towards_threshold().slope(290.0, 298.0, 0.0),
        over_threshold(290, THRESHOLD_CROSSING_M),
    )
}

/// As the approach before, but up again from about 60 m above the threshold.
fn go_around() -> Plan {
    let motion = towards_threshold()
        .slope(270.0, 277.0, 6.0)
        .accelerate(272.0, 300.0, 20.0, 4.0)
        .turn(320.0, 355.0, -90.0, 5.0)
        .slope(380.0, 388.0, 0.0);
    let (speed_mps, to_go_s) = (70.0, 12.0);
    let (heading, glide) = (RUNWAY_HEADING_DEG.to_radians(), GLIDE_PATH_DEG.to_radians());
    let mut before = over_threshold(
        270,
        THRESHOLD_CROSSING_M + to_go_s * speed_mps * libm::sin(glide),
    );
    // Degrees of the meridian and the parallel, m; a metre more or less does not matter here.
    let latitude = before.latitude_deg.to_radians();
    let (degree_m, to_go_m) = (110_900.0, to_go_s * speed_mps * libm::cos(glide));
    before.latitude_deg -= to_go_m * libm::cos(heading) / degree_m;
    before.longitude_deg -= to_go_m * libm::sin(heading) / (degree_m * libm::cos(latitude));
    Plan::new(420, Grade::Tactical, Phase::Lpv200, motion, before)
}

/// [P4] 3.1: 100 s standing at 40.0687° N, 116.2497° E, 100 m; 5 m/s² for 20 s; 100 s; 90° right;
/// 100 s; nose up 20° and 50 s of climb; 100 s; 90° left; 100 s; nose down 20° and 50 s of descent to
/// the first level; −5 m/s² for 20 s to a stand. The paper's corners are rounded: times are those of
/// the steady parts.
fn p4_flight() -> Plan {
    let motion = Motion::level(0.0, 0.0)
        .accelerate(100.0, 121.0, 100.0, 1.0)
        .turn(221.0, 254.0, 90.0, 3.0)
        .slope(354.0, 362.0, 20.0)
        .slope(412.0, 420.0, 0.0)
        .turn(520.0, 553.0, -90.0, 3.0)
        .slope(653.0, 661.0, -20.0)
        .slope(711.0, 719.0, 0.0)
        .accelerate(719.0, 740.0, -100.0, 1.0);
    let anchor = Anchor {
        at_s: 0,
        latitude_deg: 40.0687,
        longitude_deg: 116.2497,
        height_m: 100.0,
    };
    Plan::new(750, Grade::Mems, Phase::Npa, motion, anchor)
}

/// Lines of 20 s at 20 m/s, 120 m above the field, joined by half turns of alternating sense.
fn uav_survey() -> Plan {
    let mut motion = Motion::level(10.0, 20.0);
    for line in 0..18 {
        let end_s = f64::from(20 + 33 * line);
        let angle_deg = if line % 2 == 0 { 180.0 } else { -180.0 };
        motion = motion.turn(end_s, end_s + 13.0, angle_deg, 2.0);
    }
    Plan::new(
        600,
        Grade::Mems,
        Phase::Apv1,
        motion,
        over_threshold(0, 120.0),
    )
}

/// Up to 81 m, a turn on the spot, transition with the nose down, cruise, and the same back.
fn evtol() -> Plan {
    let motion = Motion::level(200.0, 0.0)
        .climb(20.0, 28.0, 3.0)
        .climb(48.0, 54.0, 0.0)
        .turn(58.0, 72.0, 90.0, 4.0)
        .pitch(76.0, 80.0, -9.0)
        .accelerate(78.0, 112.0, 55.0, 4.0)
        .pitch(110.0, 114.0, 3.0)
        .turn(140.0, 175.0, 120.0, 5.0)
        .slope(180.0, 184.0, 2.0)
        .slope(200.0, 204.0, -2.0)
        .slope(220.0, 224.0, 0.0)
        .pitch(246.0, 250.0, 7.0)
        .accelerate(248.0, 288.0, -55.0, 4.0)
        .pitch(286.0, 290.0, 0.0)
        .climb(310.0, 316.0, -2.7)
        .climb(340.0, 346.0, 0.0);
    Plan::new(
        360,
        Grade::Mems,
        Phase::Apv1,
        motion,
        over_threshold(0, 0.0),
    )
}

/// Cruise at 10 km and 230 m/s with turns of half the standard rate, and a step climb.
fn enroute_turn() -> Plan {
    let motion = Motion::level(250.0, 230.0)
        .turn(60.0, 100.0, 45.0, 8.0)
        .turn(180.0, 240.0, -80.0, 8.0)
        .slope(300.0, 310.0, 2.0)
        .slope(390.0, 400.0, 0.0)
        .accelerate(410.0, 440.0, 10.0, 5.0);
    Plan::new(
        480,
        Grade::Navigation,
        Phase::EnRoute,
        motion,
        over_threshold(0, 10_000.0),
    )
}

/// A cone of 3° and heaving of ±0.8 m/s at 2 Hz, through turns of 30 °/s. At 100 samples per second
/// coning compensation from two samples still leaves some centimetres over the flight.
fn coning() -> Plan {
    let mut envelope = Profile::constant(0.0);
    envelope.change(20.0, 24.0, 1.0);
    envelope.change(160.0, 164.0, 0.0);
    let motion = Motion::level(0.0, 40.0)
        .turn(40.0, 54.0, 360.0, 2.0)
        .turn(60.0, 74.0, -360.0, 2.0)
        .slope(80.0, 84.0, 30.0)
        .slope(88.0, 92.0, -30.0)
        .slope(96.0, 100.0, 0.0)
        .turn(110.0, 117.0, 150.0, 2.0)
        .shaken(Shake {
            frequency_hz: 2.0,
            cone_rad: 3.0_f64.to_radians(),
            heave_mps: 0.8,
            envelope,
        });
    Plan::new(
        180,
        Grade::Tactical,
        Phase::Npa,
        motion,
        over_threshold(0, 500.0),
    )
}

/// A town: corners at walking pace to 10 m/s, stops at lights, a bridge, a fast stretch.
fn drive() -> Plan {
    let motion = Motion::level(RUNWAY_HEADING_DEG, 0.0)
        .accelerate(15.0, 25.0, 12.0, 2.0)
        .accelerate(40.0, 46.0, -6.0, 2.0)
        .turn(46.0, 54.0, 90.0, 2.0)
        .accelerate(54.0, 62.0, 8.0, 2.0)
        .slope(70.0, 74.0, 3.0)
        .slope(82.0, 88.0, -3.0)
        .slope(96.0, 100.0, 0.0)
        .accelerate(110.0, 120.0, -14.0, 2.0)
        .accelerate(150.0, 158.0, 8.0, 2.0)
        .turn(160.0, 168.0, -90.0, 2.0)
        .accelerate(170.0, 190.0, 17.0, 3.0)
        .turn(200.0, 230.0, 40.0, 5.0)
        .turn(240.0, 270.0, -60.0, 5.0)
        .accelerate(290.0, 310.0, -18.0, 3.0)
        .turn(312.0, 320.0, 90.0, 2.0)
        .turn(330.0, 338.0, 90.0, 2.0)
        .accelerate(350.0, 360.0, -7.0, 2.0)
        .without_bank();
    Plan::new(420, Grade::Mems, Phase::Npa, motion, over_threshold(0, 1.5))
}
