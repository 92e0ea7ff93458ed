//! What a monitor said of many epochs, counted against what was true.
//!
//! | word | of an epoch |
//! |---|---|
//! | not in use | every satellite at fault is one that the monitor has no room for: it can be neither detected nor missed |
//! | detected | a fault was seen, taken out or not |
//! | rightly | what was taken out is what was faulted, no more and no less |
//! | partly | some of what was faulted was taken out, and nothing healthy |
//! | wrongly | something healthy was taken out, whatever else was |
//! | still held | something was out that was faulted earlier and is not now, by what remembers; it is neither right nor wrong, and no detection |
//! | false alert | an epoch without a fault on which one was seen |
//! | served | the monitor passed the epoch or what it left of it: the position is given to the user |
//! | above a level | a served position whose error is larger than its level |

use std::collections::BTreeMap;

use serde::Serialize;
use surefix_core::gnss::solution::UsedRow;
use surefix_core::gnss::{Satellite, SatelliteSet};
use surefix_core::integrity::PhaseRequirements;
use surefix_core::raim::monitors::{MonitorLevels, MonitorVerdict, NoLevels, NotTested, Outcome};

use crate::campaign::binomial::clopper_pearson;
use crate::output::quantile;
use crate::report::Region;

/// Confidence of the intervals of probabilities.
pub const CONFIDENCE: f64 = 0.95;

/// What came of an epoch's test, for whoever tested.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// Nothing was tested; why, in a word of the files.
    NotTested(&'static str),
    /// No fault seen.
    Passed,
    /// A fault was seen and taken out.
    Excluded,
    /// A fault was seen and the position is not to be used.
    Detected,
}

impl Answer {
    /// In files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotTested(_) => "not_tested",
            Self::Passed => "passed",
            Self::Excluded => "excluded",
            Self::Detected => "detected",
        }
    }
}

/// What a monitor said of an epoch, in terms of satellites.
#[derive(Clone, Debug, PartialEq)]
pub struct Said {
    /// What came of the test.
    pub answer: Answer,
    /// Satellites taken out.
    pub excluded: SatelliteSet,
    /// Satellites of the epoch that the monitor has no room for.
    pub not_in_use: SatelliteSet,
    /// Error of the position that is left, east, north, up, m; `None` without a position or a truth.
    pub error_enu_m: Option<[f64; 3]>,
    /// Levels, or why there are none, in a word of the files.
    pub levels: Result<MonitorLevels, &'static str>,
}

impl Said {
    /// The verdict on rows whose point of linearisation has this error.
    pub fn new(verdict: &MonitorVerdict, rows: &[UsedRow], at_enu_m: Option<[f64; 3]>) -> Self {
        let mut excluded = SatelliteSet::EMPTY;
        for (row, used) in rows.iter().enumerate() {
            if verdict.excluded.contains(row) {
                excluded.insert(used.satellite);
            }
        }
        let error_enu_m = verdict
            .position_enu_m
            .zip(at_enu_m)
            .map(|(by, at)| core::array::from_fn(|k| at[k] + by[k]));
        Self {
            answer: match verdict.outcome {
                Outcome::NotTested(why) => Answer::NotTested(not_tested(why)),
                Outcome::Passed => Answer::Passed,
                Outcome::Excluded => Answer::Excluded,
                Outcome::Detected => Answer::Detected,
            },
            excluded,
            not_in_use: SatelliteSet::EMPTY,
            error_enu_m,
            levels: verdict.levels.map_err(no_levels),
        }
    }

    /// Nothing, and why.
    pub const fn nothing(why: &'static str) -> Self {
        Self {
            answer: Answer::NotTested(why),
            excluded: SatelliteSet::EMPTY,
            not_in_use: SatelliteSet::EMPTY,
            error_enu_m: None,
            levels: Err(why),
        }
    }

    /// Whether a fault was seen.
    pub const fn is_detected(&self) -> bool {
        matches!(self.answer, Answer::Excluded | Answer::Detected)
    }

    /// Whether the position is given to the user.
    pub const fn is_served(&self) -> bool {
        matches!(self.answer, Answer::Passed | Answer::Excluded)
    }
}

/// Horizontal and vertical part of an error, m.
pub fn horizontal_vertical([east, north, up]: [f64; 3]) -> [f64; 2] {
    [east.hypot(north), up.abs()]
}

const fn not_tested(why: NotTested) -> &'static str {
    match why {
        NotTested::NotConfigured => "not_configured",
        NotTested::RowsMismatch { .. } => "rows_mismatch",
        NotTested::Factor(_) => "geometry",
        NotTested::NoRedundancy { .. } => "no_redundancy",
        NotTested::RowsOutOfRange { .. } => "number_of_satellites",
        NotTested::NotConverged => "not_converged",
        NotTested::Number => "number",
        NotTested::Stats(_) => "no_threshold",
        NotTested::FaultsNotMonitored => "faults_not_monitored",
    }
}

const fn no_levels(why: NoLevels) -> &'static str {
    match why {
        NoLevels::NotTested => "not_tested",
        NoLevels::FaultPresent => "fault_present",
        NoLevels::Untestable { .. } => "untestable",
        NoLevels::NoRedundancy => "no_redundancy",
        NoLevels::NoIntegrityBudget => "no_integrity_budget",
        NoLevels::NotFinite => "not_finite",
        NoLevels::NotOffered => "not_offered",
    }
}

/// What is at fault at an epoch.
#[derive(Clone, Copy, Debug)]
pub struct AtFault {
    /// Satellites faulted.
    pub now: SatelliteSet,
    /// Satellites that were faulted earlier, for what remembers them; none for a monitor of one epoch alone.
    pub before: SatelliteSet,
}

impl AtFault {
    /// For a monitor that knows nothing of earlier epochs.
    pub const fn now(now: SatelliteSet) -> Self {
        Self {
            now,
            before: SatelliteSet::EMPTY,
        }
    }
}

/// Counts while they grow.
#[derive(Clone, Debug, Default)]
pub struct Counts {
    epochs: u64,
    not_tested: BTreeMap<&'static str, u64>,
    not_in_use: u64,
    detected: u64,
    excluded: u64,
    rightly: u64,
    partly: u64,
    wrongly: u64,
    held: u64,
    served: u64,
    no_levels: BTreeMap<&'static str, u64>,
    hpl_m: Vec<f64>,
    vpl_m: Vec<f64>,
    compared: u64,
    above_hpl: u64,
    above_vpl: u64,
    above_level: u64,
    horizontal: [u64; 5],
    vertical: [u64; 5],
    error_h_m: Vec<f64>,
    error_v_m: Vec<f64>,
}

impl Counts {
    /// Takes what a monitor said of an epoch with these satellites faulted.
    pub fn book(&mut self, said: &Said, at_fault: &AtFault, limits: &PhaseRequirements) {
        self.epochs += 1;
        if let Answer::NotTested(why) = said.answer {
            *self.not_tested.entry(why).or_default() += 1;
        }
        let AtFault { now, before } = at_fault;
        let out = |is_counted: &dyn Fn(Satellite) -> bool| {
            said.excluded.iter().filter(|s| is_counted(*s)).count()
        };
        let at_work = now.iter().filter(|s| !said.not_in_use.contains(*s)).count();
        let is_not_in_use = at_work == 0 && !now.is_empty();
        self.not_in_use += u64::from(is_not_in_use);
        let found = out(&|s| now.contains(s));
        let held = out(&|s| !now.contains(s) && before.contains(s));
        let healthy = out(&|s| !now.contains(s) && !before.contains(s));
        self.held += u64::from(held > 0);
        self.wrongly += u64::from(healthy > 0);
        let is_excluded = said.answer == Answer::Excluded;
        let only_held = is_excluded && held > 0 && found + healthy == 0;
        self.detected += u64::from(said.is_detected() && !only_held && !is_not_in_use);
        self.excluded += u64::from(is_excluded && !only_held);
        if is_excluded && found > 0 && healthy == 0 {
            let all = found == at_work;
            self.rightly += u64::from(all);
            self.partly += u64::from(!all);
        }
        self.served += u64::from(said.is_served());
        match said.levels {
            Ok(levels) => {
                self.hpl_m.push(levels.hpl_m);
                self.vpl_m.push(levels.vpl_m);
            }
            Err(why) => *self.no_levels.entry(why).or_default() += 1,
        }
        let Some(error) = said.error_enu_m.filter(|_| said.is_served()) else {
            return;
        };
        let [error_h_m, error_v_m] = horizontal_vertical(error);
        self.error_h_m.push(error_h_m);
        self.error_v_m.push(error_v_m);
        if let Ok(levels) = said.levels {
            // Written so that NaN counts as above.
            let h = !(error_h_m <= levels.hpl_m);
            let v = !(error_v_m <= levels.vpl_m);
            self.compared += 1;
            self.above_hpl += u64::from(h);
            self.above_vpl += u64::from(v);
            self.above_level += u64::from(h || v);
            let place = Region::of(error_h_m, levels.hpl_m, Some(limits.hal_m)) as usize;
            self.horizontal[place] += 1;
            let place = Region::of(error_v_m, levels.vpl_m, limits.val_m) as usize;
            self.vertical[place] += 1;
        }
    }

    /// What they come to; `None` is a number of nothing.
    pub fn summary(mut self) -> Summary {
        let largest = |values: &mut Vec<f64>| LevelSummary {
            mean_m: mean(values),
            p95_m: quantile(values, 0.95),
            max_m: quantile(values, 1.0),
        };
        let not_tested: u64 = self.not_tested.values().sum();
        let in_use = self.epochs - self.not_in_use;
        Summary {
            epochs: self.epochs,
            tested: self.epochs - not_tested,
            not_tested: self.not_tested,
            not_in_use: self.not_in_use,
            in_use,
            detected: self.detected,
            detection_rate: Rate::new(self.detected, in_use),
            excluded: self.excluded,
            excluded_rightly: self.rightly,
            excluded_partly: self.partly,
            excluded_wrongly: self.wrongly,
            still_held: self.held,
            served: self.served,
            hpl: largest(&mut self.hpl_m),
            vpl: largest(&mut self.vpl_m),
            with_levels: self.hpl_m.len() as u64,
            without_levels: self.no_levels,
            compared: self.compared,
            above_hpl: self.above_hpl,
            above_vpl: self.above_vpl,
            above_level: self.above_level,
            stanford_horizontal: self.horizontal,
            stanford_vertical: self.vertical,
            error_h95_m: quantile(&mut self.error_h_m, 0.95),
            error_v95_m: quantile(&mut self.error_v_m, 0.95),
        }
    }
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// A share of epochs with its interval, for epochs that are independent of each other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Rate {
    /// Events over epochs; `None` of no epoch.
    pub rate: Option<f64>,
    /// The interval of Clopper and Pearson at [`CONFIDENCE`].
    pub interval: [f64; 2],
}

impl Rate {
    fn new(events: u64, of: u64) -> Self {
        Self {
            rate: (of > 0).then(|| events as f64 / of as f64),
            interval: clopper_pearson(events, of, CONFIDENCE),
        }
    }
}

/// Levels of one axis over the epochs that have some, m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LevelSummary {
    /// Mean.
    pub mean_m: Option<f64>,
    /// 95 % are at most this.
    pub p95_m: Option<f64>,
    /// Largest.
    pub max_m: Option<f64>,
}

/// Counts of a monitor over epochs of one kind.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Epochs given to it.
    pub epochs: u64,
    /// Epochs it tested.
    pub tested: u64,
    /// Why it did not test the others.
    pub not_tested: BTreeMap<&'static str, u64>,
    /// Epochs on which every satellite at fault is one that it has no room for.
    pub not_in_use: u64,
    /// The other epochs.
    pub in_use: u64,
    /// Of these, epochs on which it saw a fault.
    pub detected: u64,
    /// Of these, tested or not; without a fault the rate of false alerts.
    pub detection_rate: Rate,
    /// Epochs on which it took something out and went on.
    pub excluded: u64,
    /// Exactly what was faulted.
    pub excluded_rightly: u64,
    /// A part of what was faulted, and nothing healthy.
    pub excluded_partly: u64,
    /// Something healthy.
    pub excluded_wrongly: u64,
    /// Something out that was faulted earlier and is not now.
    pub still_held: u64,
    /// Positions given to the user.
    pub served: u64,
    /// Horizontal levels.
    pub hpl: LevelSummary,
    /// Vertical levels.
    pub vpl: LevelSummary,
    /// Epochs with levels.
    pub with_levels: u64,
    /// Why the others have none.
    pub without_levels: BTreeMap<&'static str, u64>,
    /// Served positions with levels and a truth.
    pub compared: u64,
    /// Of these, horizontal error above its level.
    pub above_hpl: u64,
    /// Vertical error above its level.
    pub above_vpl: u64,
    /// Either.
    pub above_level: u64,
    /// The same epochs in the parts of the Stanford diagram, against the alert limits of the phase: normal, unavailable,
    /// misleading, unavailable and misleading, hazardous.
    pub stanford_horizontal: [u64; 5],
    /// Vertical.
    pub stanford_vertical: [u64; 5],
    /// 95 % of the horizontal errors of served positions are at most this, m.
    pub error_h95_m: Option<f64>,
    /// 95 % of the vertical errors of served positions are at most this, m.
    pub error_v95_m: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use surefix_core::gnss::System;
    use surefix_core::integrity::Phase;

    fn set(prns: &[u8]) -> SatelliteSet {
        let mut set = SatelliteSet::EMPTY;
        for prn in prns {
            set.insert(Satellite::new(System::Gps, *prn).unwrap());
        }
        set
    }

    fn said(answer: Answer, excluded: &[u8], up_m: f64) -> Said {
        Said {
            answer,
            excluded: set(excluded),
            not_in_use: SatelliteSet::EMPTY,
            error_enu_m: Some([0.0, 1.0, up_m]),
            levels: Ok(MonitorLevels {
                hpl_m: 5.0,
                vpl_m: 10.0,
            }),
        }
    }

    fn counted(answers: &[Said], faulted: &[u8]) -> Summary {
        counted_after(answers, faulted, &[])
    }

    fn counted_after(answers: &[Said], faulted: &[u8], before: &[u8]) -> Summary {
        let at_fault = AtFault {
            now: set(faulted),
            before: set(before),
        };
        let mut counts = Counts::default();
        for said in answers {
            counts.book(said, &at_fault, &Phase::Lpv200.requirements());
        }
        counts.summary()
    }

    #[test]
    fn a_fault_on_a_satellite_that_is_not_in_use_is_neither_detected_nor_missed() {
        let without = |answer, excluded: &[u8]| Said {
            not_in_use: set(&[1]),
            ..said(answer, excluded, 0.0)
        };
        let summary = counted(&[without(Answer::Passed, &[])], &[1]);
        assert_eq!((summary.epochs, summary.not_in_use), (1, 1));
        assert_eq!(summary.detection_rate.rate, None);
        // Beside one that is, that one is all there is to find.
        let summary = counted(&[without(Answer::Excluded, &[2])], &[1, 2]);
        assert_eq!((summary.not_in_use, summary.excluded_rightly), (0, 1));
        assert_eq!(summary.detection_rate.rate, Some(1.0));
    }

    #[test]
    fn what_is_still_held_after_its_fault_is_neither_wrong_nor_a_detection() {
        let answers = [
            said(Answer::Excluded, &[1], 0.0),
            said(Answer::Excluded, &[1, 2], 0.0),
            said(Answer::Excluded, &[1, 3], 0.0),
            said(Answer::Detected, &[1], 0.0),
        ];
        let summary = counted_after(&answers, &[2], &[1]);
        assert_eq!((summary.still_held, summary.excluded_wrongly), (4, 1));
        assert_eq!((summary.excluded_rightly, summary.excluded_partly), (1, 0));
        assert_eq!((summary.excluded, summary.detected), (2, 3));
        let forgetful = counted(&answers, &[2]);
        assert_eq!((forgetful.still_held, forgetful.excluded_wrongly), (0, 4));
    }

    #[test]
    fn an_exclusion_is_right_partial_or_wrong_by_the_satellites_it_takes() {
        let summary = counted(
            &[
                said(Answer::Excluded, &[1, 2], 0.0),
                said(Answer::Excluded, &[2], 0.0),
                said(Answer::Excluded, &[1, 3], 0.0),
                said(Answer::Detected, &[], 0.0),
                said(Answer::Passed, &[], 0.0),
                said(Answer::NotTested("geometry"), &[], 0.0),
            ],
            &[1, 2],
        );
        assert_eq!(
            (summary.epochs, summary.tested, summary.detected),
            (6, 5, 4)
        );
        assert_eq!(
            (
                summary.excluded,
                summary.excluded_rightly,
                summary.excluded_partly,
                summary.excluded_wrongly
            ),
            (3, 1, 1, 1)
        );
        assert_eq!(summary.not_tested["geometry"], 1);
        assert_eq!(summary.served, 4);
    }

    #[test]
    fn only_a_position_that_is_served_can_be_above_its_level() {
        let misled = [
            said(Answer::Passed, &[], 11.0),
            said(Answer::Passed, &[], f64::NAN),
            said(Answer::Detected, &[], 11.0),
            said(Answer::Passed, &[], 40.0),
        ];
        let summary = counted(&misled, &[]);
        assert_eq!((summary.above_vpl, summary.above_hpl), (3, 0));
        assert_eq!((summary.compared, summary.above_level), (3, 3));
        // Within the limit of 35 m, no number, beyond it.
        assert_eq!(summary.stanford_vertical, [0, 0, 1, 0, 2]);
    }
}
