//! Range consensus (RANCO), suggestion range consensus (S-RANCO) and fast optimal subset selection (FOIM) [P4] 2.2 through the common face.
//!
//! In: an epoch. A row's sigma is that of its whole error, taken as independent. Out: a verdict without levels. The
//! algorithms: [`crate::raim::ranco`], [`crate::raim::s_ranco`], [`crate::raim::foim`].
//!
//! | symbol | code | meaning |
//! |--------|------|---------|
//! | P_FA | `p_false_alarm` | of an epoch; half of it for the suspicions, half for the parity test |
//! | m | `max_faults` | most simultaneous faults reckoned with |
//!
//! **The rule.** An epoch passes when no row is suspected and all agree by the parity test. Otherwise the row of the
//! largest share above T_SV is the first candidate; then the subsets without it are counted again, and the row of the
//! largest share joins it, up to m rows. RANCO's only candidate is the set of its outliers. The first candidate of k
//! rows without which the rest passes the parity test is excluded, if the redundancy is at
//! least k + m, and if it has no rival: no other k rows may leave a rest that passes as well. If none is, the fault is
//! detected and in. With less redundancy there are errors of k rows and of m others that leave the same parity vector,
//! and healthy rows could be taken for faulty ones.
//! [P4] excludes what is above T_SV and looks no further; these conditions are departures, because with
//! few satellites or several faults a count often puts a healthy row first.
//!
//! There are no levels: a share of suspicions has no missed-detection probability. Derivations, and what is
//! done with several constellations: docs/decisions/022-consensus.md. Keys: docs/references.md.

use super::agreement::Agreement;
use super::{
    ConfigureError, EpochMonitor, MonitorEpoch, MonitorVerdict, NoLevels, NotTested, Outcome,
    with_whole_sigmas,
};
use crate::linalg::LinearModel;
use crate::raim::consensus::subsets::Subsets;
use crate::raim::consensus::suspicion::{Suspicions, outlier_factor, suspicion_threshold};
use crate::raim::consensus::{ConsensusError, ConsensusWorkspace, set_of};
use crate::raim::exclusion::{MAX_FAULTS, RowSet};
use crate::raim::{foim, ranco, s_ranco};
use crate::stats::StatsError;

/// How rows come under suspicion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ConsensusRule {
    /// By the subset that most others agree with.
    Ranco,
    /// By a share of all subsets.
    SRanco,
    /// By a share of the subsets of good geometry.
    Foim {
        /// Largest GDOP of a subset, more than 1.
        gdop_limit: f64,
    },
}

/// What a consensus monitor is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConsensusConfig {
    /// The algorithm.
    pub rule: ConsensusRule,
    /// False-alarm probability of an epoch.
    pub p_false_alarm: f64,
    /// Most simultaneous faults reckoned with, and most rows excluded, 1 to [`MAX_FAULTS`].
    pub max_faults: usize,
}

/// The missed-detection probability that the table of thresholds is filled with; no level uses it.
const P_MISSED_DETECTION: f64 = 1e-3;

/// A consensus monitor, and its memory (33 kB).
#[derive(Clone, Debug)]
pub struct ConsensusMonitor {
    config: Option<ConsensusConfig>,
    model: LinearModel,
    agreement: Agreement,
    workspace: ConsensusWorkspace,
}

/// What the subsets say of an epoch.
struct Suspected {
    /// The share that was largest, and the one from which on a row is suspected.
    share: f64,
    threshold: f64,
    /// Beyond how many sigmas of its prediction a row was an outlier.
    factor: f64,
    /// What may be left out first; empty where nothing is suspected.
    candidate: RowSet,
    /// Whether any row was predicted.
    is_tested: bool,
}

impl ConsensusMonitor {
    /// Not configured.
    pub const EMPTY: Self = Self {
        config: None,
        model: LinearModel::EMPTY,
        agreement: Agreement::EMPTY,
        workspace: ConsensusWorkspace::EMPTY,
    };

    /// What S-RANCO or FOIM counted last: of the last epoch, without the rows that were the first candidates.
    pub const fn suspicions(&self) -> &Suspicions {
        self.workspace.suspicions()
    }

    fn suspect(&mut self, config: &ConsensusConfig) -> Result<Suspected, StatsError> {
        let n = self.model.n;
        let members = self.workspace.members();
        let p_suspected = 0.5 * config.p_false_alarm;
        if config.rule == ConsensusRule::Ranco {
            let factor = outlier_factor(p_suspected, n.saturating_sub(members), 1.0)?;
            let found = ranco::consensus(&self.workspace, factor);
            let outliers = found.map_or(RowSet::EMPTY, |found| found.outliers);
            let others = found.map_or(0, |found| found.inliers + found.outliers.len());
            return Ok(Suspected {
                share: outliers.len() as f64 / others.max(1) as f64,
                threshold: 0.0,
                factor,
                candidate: outliers,
                is_tested: found.is_some(),
            });
        }
        let threshold = suspicion_threshold(n, members);
        let factor = outlier_factor(p_suspected, n, threshold)?;
        self.count(config.rule, factor);
        let suspicions = self.workspace.suspicions();
        Ok(Suspected {
            share: suspicions.largest_share(),
            threshold,
            factor,
            candidate: self.joined_by_most_suspected(RowSet::EMPTY),
            is_tested: suspicions.is_tested(),
        })
    }

    fn count(&mut self, rule: ConsensusRule, factor: f64) {
        match rule {
            // Counts nothing.
            ConsensusRule::Ranco => {}
            ConsensusRule::SRanco => s_ranco::count(&mut self.workspace, factor),
            ConsensusRule::Foim { gdop_limit } => {
                foim::count(&mut self.workspace, factor, gdop_limit);
            }
        }
    }

    /// The rows and the one that is most suspected beside them; empty where none is.
    fn joined_by_most_suspected(&self, rows: RowSet) -> RowSet {
        let n = self.model.n.saturating_sub(rows.len());
        let threshold = suspicion_threshold(n, self.workspace.members());
        let most = self.workspace.suspicions().most_suspected(threshold, rows);
        most.map_or(RowSet::EMPTY, |row| rows.with(row))
    }

    /// What is left out together with a candidate that does not explain the epoch; empty where there is no more.
    fn following(&mut self, rule: ConsensusRule, factor: f64, candidate: RowSet) -> RowSet {
        if rule == ConsensusRule::Ranco {
            return RowSet::EMPTY;
        }
        self.workspace.leave_out(candidate);
        self.count(rule, factor);
        self.joined_by_most_suspected(candidate)
    }

    /// Whether the rows that are not left out pass the parity test.
    fn agree_without(&mut self, left_out: RowSet) -> bool {
        let tested = self.agreement.test(&self.model, left_out);
        tested.is_ok_and(|(statistic, limit)| statistic.passes(limit))
    }

    /// Whether without another set of as many rows the rest passes as well, or cannot be tested.
    fn has_rival(&mut self, candidate: RowSet) -> bool {
        let mut sets = Subsets::new(self.model.n, candidate.len());
        while let Some(rows) = sets.next() {
            let rival = set_of(rows);
            if rival == candidate {
                continue;
            }
            let tested = self.agreement.test(&self.model, rival);
            // What cannot be tested is not ruled out.
            let is_ruled_out =
                tested.is_ok_and(|(statistic, limit)| statistic.sum_of_squares > limit);
            if !is_ruled_out {
                return true;
            }
        }
        false
    }
}

fn why_not(error: ConsensusError) -> NotTested {
    match error {
        ConsensusError::RowsOutOfRange { n } => NotTested::RowsOutOfRange { n },
        ConsensusError::ClocksOutOfRange { .. } | ConsensusError::Row { .. } => NotTested::Number,
    }
}

impl EpochMonitor for ConsensusMonitor {
    type Config = ConsensusConfig;

    fn configure(&mut self, config: &ConsensusConfig) -> Result<(), ConfigureError> {
        self.config = None;
        if !(1..=MAX_FAULTS).contains(&config.max_faults) {
            return Err(ConfigureError::OutOfRange {
                name: "max_faults",
                value: config.max_faults as f64,
            });
        }
        // Written so that NaN refuses; of half of it the quantiles would take 1 and more.
        if !(config.p_false_alarm > 0.0 && config.p_false_alarm < 1.0) {
            return Err(ConfigureError::OutOfRange {
                name: "p_false_alarm",
                value: config.p_false_alarm,
            });
        }
        if let ConsensusRule::Foim { gdop_limit } = config.rule
            && !(gdop_limit > 1.0 && gdop_limit.is_finite())
        {
            return Err(ConfigureError::OutOfRange {
                name: "gdop_limit",
                value: gdop_limit,
            });
        }
        self.agreement
            .configure(0.5 * config.p_false_alarm, P_MISSED_DETECTION)?;
        self.config = Some(*config);
        Ok(())
    }

    #[inline(never)]
    fn assess(&mut self, epoch: &MonitorEpoch<'_>) -> MonitorVerdict {
        let Some(config) = self.config else {
            return MonitorVerdict::not_tested(NotTested::NotConfigured);
        };
        with_whole_sigmas(epoch, &mut self.model);
        let (statistic, limit) = match self.agreement.test(&self.model, RowSet::EMPTY) {
            Ok(tested) => tested,
            Err(why) => return MonitorVerdict::not_tested(why),
        };
        let position_enu_m = self.agreement.position_enu_m();
        if let Err(error) = self.workspace.load(&self.model) {
            return MonitorVerdict::not_tested(why_not(error));
        }
        let suspected = match self.suspect(&config) {
            Ok(suspected) => suspected,
            Err(error) => return MonitorVerdict::not_tested(NotTested::Stats(error)),
        };
        let agree = statistic.passes(limit);
        let is_suspected = !suspected.candidate.is_empty();
        let mut verdict = MonitorVerdict {
            outcome: Outcome::Passed,
            excluded: RowSet::EMPTY,
            position_enu_m: Some(position_enu_m),
            levels: Err(NoLevels::NotOffered),
            statistic: Some(suspected.share),
            threshold: Some(suspected.threshold),
        };
        if agree && !is_suspected {
            if !suspected.is_tested {
                verdict.outcome = Outcome::NotTested(NotTested::NoRedundancy { n: self.model.n });
            }
            return verdict;
        }
        if !is_suspected {
            verdict.statistic = Some(statistic.sum_of_squares);
            verdict.threshold = Some(limit);
        }
        verdict.outcome = Outcome::Detected;
        let mut candidate = suspected.candidate;
        for _ in 0..config.max_faults {
            let is_allowed = (1..=config.max_faults).contains(&candidate.len())
                && statistic.redundancy >= candidate.len() + config.max_faults;
            if !is_allowed {
                break;
            }
            if self.agree_without(candidate) {
                // Before the rivals are factored in its place.
                let position_enu_m = self.agreement.position_enu_m();
                if !self.has_rival(candidate) {
                    verdict.outcome = Outcome::Excluded;
                    verdict.excluded = candidate;
                    verdict.position_enu_m = Some(position_enu_m);
                }
                break;
            }
            if candidate.len() < config.max_faults {
                candidate = self.following(config.rule, suspected.factor, candidate);
            }
        }
        verdict
    }
}
