//! Range consensus (RANCO), suggestion range consensus (S-RANCO) and fast optimal subset selection (FOIM) [P4] 2.2 through the common face.
//!
//! In: an epoch. A row's sigma is that of its whole error, taken as independent. Out: a verdict without levels. The
//! algorithms: [`crate::raim::ranco`], [`crate::raim::s_ranco`], [`crate::raim::foim`].
//!
//! | symbol | code | meaning |
//! |--------|------|---------|
//! | P_FA | `p_false_alarm` | of an epoch; half of it for the suspicions, half for the parity test |
//! | m | `faults` | simultaneous faults reckoned with, from one on |
//!
//! **The rule.** An epoch passes when no row is suspected and all agree by the parity test. Otherwise, with one fault
//! to reckon with, then two, then three: the rows suspected with T_SV(n, m) are excluded if they are m or
//! fewer and the rest passes the parity test. The first such set is taken. If there is none the fault is detected and in.
//! RANCO names one set, which is treated alike. Source of exclusion without a further test: [P4]; that the rest
//! has to agree is a departure, because a count does not tell whether what remains is sound.
//!
//! There are no levels: a share of suspicions has no missed-detection probability. Derivations, and what is
//! done with several constellations: docs/decisions/022-consensus.md. Keys: docs/references.md.

use super::agreement::Agreement;
use super::{
    ConfigureError, EpochMonitor, MonitorEpoch, MonitorVerdict, NoLevels, NotTested, Outcome,
};
use crate::linalg::LinearModel;
use crate::raim::consensus::suspicion::{Suspicions, contaminated_share, outlier_factor};
use crate::raim::consensus::{ConsensusError, ConsensusWorkspace};
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
    /// Most rows excluded, 1 to [`MAX_FAULTS`].
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
    /// The rows to leave out by number of faults reckoned with, from one on.
    rows: [RowSet; MAX_FAULTS],
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

    /// What S-RANCO or FOIM counted in the last epoch.
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
                rows: [outliers; MAX_FAULTS],
                is_tested: found.is_some(),
            });
        }
        let threshold = contaminated_share(n, members, 1);
        let factor = outlier_factor(p_suspected, n, threshold)?;
        if let ConsensusRule::Foim { gdop_limit } = config.rule {
            foim::count(&mut self.workspace, factor, gdop_limit);
        } else {
            s_ranco::count(&mut self.workspace, factor);
        }
        let suspicions = self.workspace.suspicions();
        let mut rows = [RowSet::EMPTY; MAX_FAULTS];
        for (faults, rows) in (1..).zip(&mut rows) {
            *rows = suspicions.above(contaminated_share(n, members, faults));
        }
        Ok(Suspected {
            share: suspicions.largest_share(),
            threshold,
            rows,
            is_tested: suspicions.is_tested(),
        })
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
        self.model.clone_from(epoch.model());
        for (sigma_m, row) in self.model.sigma_m.iter_mut().zip(epoch.rows()) {
            *sigma_m = row.sigma.total_m();
        }
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
        let [first, ..] = suspected.rows;
        let is_suspected = !first.is_empty();
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
        for (faults, rows) in (1..=config.max_faults).zip(suspected.rows) {
            if (1..=faults).contains(&rows.len())
                && let Ok((statistic, limit)) = self.agreement.test(&self.model, rows)
                && statistic.passes(limit)
            {
                verdict.outcome = Outcome::Excluded;
                verdict.excluded = rows;
                verdict.position_enu_m = Some(self.agreement.position_enu_m());
                break;
            }
        }
        verdict
    }
}
