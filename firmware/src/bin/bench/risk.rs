//! What comes on top of the bank's filters: the bound for correlated errors, and levels from a budget of risk.

use super::bank::{Memory, Shared};
use super::measure::{Of, Row, require};
use core::hint::black_box;
use static_cell::ConstStaticCell;
use surefix_core::ekf::Filter;
use surefix_core::mhss::bank::{ExtraNoise, OwnVariances};
use surefix_core::mhss::correlated::{CorrelatedBound, CorrelatedRow};
use surefix_core::mhss::protection::{FaultPriors, LevelForm, RiskBudget, levels};
use surefix_core::mhss::separation::position_variances;

/// Passes per row.
const RUNS: usize = 5;

static BOUND: ConstStaticCell<CorrelatedBound> = ConstStaticCell::new(CorrelatedBound::NONE);

/// The bound's memory.
pub fn bound() -> &'static mut CorrelatedBound {
    BOUND.take()
}

impl<const K: usize, const M: usize> Memory<K, M> {
    /// An epoch of the bound for every filter of the bank, pairs included as when a fault is looked for; then
    /// the levels.
    pub fn risk_rows(&self, shared: &Shared<'_>, bound: &mut CorrelatedBound, of: &Of) {
        bound.start(1.0, [1.0; 2]);
        for (place, ..) in self.bank.present() {
            bound.begin(place);
        }
        let mut correlated = Row::new();
        for _ in 0..RUNS {
            let mut sum = 0.0;
            correlated.run(|| sum = self.correlated(black_box(shared), bound));
            require(sum > 0.0 && sum.is_finite(), "the bound bounds nothing");
        }
        correlated.print_of("bank/correlated", of);
        let form = LevelForm::Budget(RiskBudget {
            p_integrity: [1e-7; 2],
            samples: 1.0,
            unmonitored_share: 0.5,
        });
        let priors = FaultPriors::PRESET;
        let mut row = Row::new();
        for _ in 0..RUNS {
            let mut found = [None; 2];
            row.run(|| {
                found = levels(
                    black_box(&form),
                    [1.0; 2],
                    || self.bank.hypotheses(&priors),
                    self.bank.p_unmonitored(&priors),
                );
            });
            require(found.iter().all(Option::is_some), "the risk is spent");
        }
        row.print_of("bank/levels", of);
    }

    #[inline(never)]
    fn correlated(&self, shared: &Shared<'_>, bound: &mut CorrelatedBound) -> f64 {
        let c_enu_e = shared.criterion.c_enu_e;
        let rows = self
            .bank
            .present()
            .map(|(place, satellite, row)| CorrelatedRow {
                place,
                constellation: satellite.system().index(),
                row,
                common_m: 1.0,
            });
        bound.solve(rows, c_enu_e);
        let own = |filter: &Filter<K, M>| {
            let left = position_variances(filter, c_enu_e);
            OwnVariances { left, taken: left }
        };
        let [mut sum, _] = bound.main(&own(&self.main));
        for (place, satellite, _) in self.bank.present() {
            if let Some(filter) = self.bank.sub_filter(satellite, &self.sub) {
                let [[own, _], _] = bound.sub(place, &own(filter));
                sum += own;
            }
        }
        for (base, ..) in self.bank.present() {
            for (other, ..) in self.bank.present() {
                if base < other {
                    let [own, _] = bound.pair(base, other);
                    sum += own;
                }
            }
        }
        sum
    }
}
