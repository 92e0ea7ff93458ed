//! Epochs that arrive late: the nominal lags behind the samples, so that it stands at an epoch's instant
//! when the epoch is taken.
//!
//! ```text
//! intake, magnetometer, barometer ─► held samples ──up to the horizon──► nominal, alignment
//!                                          └─────── all of them ───────► navigation now
//! ```
//!
//! With an epoch that comes in time the filter does what it would have done had it come at once, to the
//! bit. The rule of the horizon stands in `ins/horizon.rs`; docs/decisions/019-latency.md.

use super::{CLOCKS, TightMonitor, UNSEEN_FORCE_MPS2, UNSEEN_RATE_RADPS};
use crate::ekf::navigator::AntennaState;
use crate::ins::Taken;
use crate::ins::horizon::{Aiding, CAPACITY, Held, HorizonState, Limit};
use crate::time::GpsTime;

impl TightMonitor {
    /// When the next epoch is due, as far as that is known; to be told when it changes. From the first such
    /// call on samples wait for epochs.
    pub(crate) fn expect(&mut self, due: Option<GpsTime>) {
        // The epochs of a scenario folder are where its samples are.
        self.horizon.set_limit(match due {
            _ if self.reference.is_some() => Limit::None,
            Some(due) => Limit::Due(due),
            None => Limit::Unknown,
        });
    }

    /// Takes increments that follow those before; carries on what need not wait.
    pub(super) fn hold(&mut self, taken: &Taken) {
        for held in Held::of(taken).into_iter().flatten() {
            if let Some(oldest) = self.horizon.put(held) {
                self.carry(&oldest);
            }
        }
        self.release(self.horizon.passable(taken.time));
    }

    /// Carries on what ends at `until` or before.
    pub(super) fn release(&mut self, until: GpsTime) {
        for _ in 0..CAPACITY {
            let Some(held) = self.horizon.pass(until) else {
                return;
            };
            self.carry(&held);
        }
    }

    /// Carries on everything: what comes does not follow from it.
    pub(super) fn release_all(&mut self) {
        self.release(GpsTime::from_ns(i64::MAX));
    }

    fn carry(&mut self, held: &Held) {
        self.step(&held.increment, held.time);
        for _ in 0..CAPACITY {
            let Some(aiding) = self.horizon.pass_aiding() else {
                break;
            };
            self.take_aiding(&aiding);
        }
        if !held.is_bridge {
            if let Some(due) = self.horizon.due() {
                self.remember(due);
            }
        } else if self.is_running() {
            let gap_s = held.increment.dt_s;
            self.navigator
                .add_uncertainty(UNSEEN_RATE_RADPS * gap_s, UNSEEN_FORCE_MPS2 * gap_s);
        }
    }

    /// A sample of another sensor: taken when the increments up to its time have been carried on.
    pub(super) fn await_increments(&mut self, aiding: Aiding) {
        if let Some(aiding) = self.horizon.put_aiding(aiding) {
            self.take_aiding(&aiding);
        }
    }

    fn take_aiding(&mut self, aiding: &Aiding) {
        match aiding {
            Aiding::Field(sample) => {
                if !self.is_running() {
                    self.alignment.on_field(sample);
                }
            }
            Aiding::Pressure(sample) => self.take_pressure(sample),
        }
    }

    /// The antenna at the end of the newest sample, as the nominal has it when the samples that wait are
    /// carried on too: for a consumer that needs it now and not at the instant of the last epoch. No
    /// monitor has tested it, and no level bounds it. `None` while the filter does not run.
    ///
    /// Takes as long as the samples that wait: at most 168 steps of the mechanisation.
    pub fn navigation_now(&self) -> Option<AntennaState<CLOCKS>> {
        if !self.is_running() {
            return None;
        }
        let held = self.horizon.held();
        Some(
            self.navigator
                .carried_over(held.map(|held| (&held.increment, held.time))),
        )
    }

    /// What waits for an epoch, and how many epochs came too late.
    pub fn horizon(&self) -> HorizonState {
        self.horizon.state()
    }
}
