//! An epoch of a scenario folder: the reference model, with the bank of filters.

use nalgebra::Vector3;

use super::{BankMemory, CLOCKS, JOINT, MonitorFastFilters, TightMonitor, TightSolution};
use crate::ekf::navigator::AntennaState;
use crate::ekf::{MeasurementRow, UpdateSummary};
use crate::frames::geodesy;
use crate::gnss::{CorrectedEpoch, System};
use crate::ins::ReferenceModel;
use crate::integrity::InertialStatus;
use crate::mhss::bank::{Bank, BankEpoch, BankRow, BankVerdict, Criterion};
use crate::time::GpsTime;

impl TightMonitor {
    /// An epoch of a scenario folder: with a memory for its filters through the bank, without one through
    /// the main filter alone.
    #[inline(never)]
    pub fn on_corrected(
        &mut self,
        epoch: &CorrectedEpoch,
        memory: Option<BankMemory<'_>>,
    ) -> Option<TightSolution> {
        self.meets(epoch.time)?;
        let reference = self.reference?;
        let at = self.navigator.predict(epoch.time);
        self.bank_verdict = None;
        let Some(memory) = memory else {
            self.corrected.time = epoch.time;
            self.corrected.rows.clone_from(&epoch.rows);
            return self.finish(&at);
        };
        self.rows.clear();
        for measurement in &epoch.rows {
            let row = MeasurementRow::new(measurement, at.r_e_m, at.v_e_mps, &at.clock, None);
            if let Some(row) = row {
                // As many rows as satellites in an epoch, so it fits.
                let _ = self.rows.push(BankRow {
                    satellite: measurement.satellite,
                    row,
                });
            }
        }
        let solution = self.run_bank(&at, &reference, memory).and_then(|summary| {
            let used = self.bank.satellites();
            let absent = [false; System::ALL.len()];
            let at = self.navigator.antenna(epoch.time);
            let mut solution = self.solution(&at, &summary, used, absent)?;
            // As the bank's levels: before an exclusion.
            if let Some((_, verdict)) = &self.bank_verdict {
                solution.navigation.fault_free_m = verdict.fault_free_m;
            }
            Some(solution)
        });
        if solution.is_none() {
            self.lose(InertialStatus::Unhealthy);
        }
        solution
    }

    /// All filters over the rows of an epoch, the tests, the exclusion, the feedback.
    pub(super) fn run_bank(
        &mut self,
        at: &AntennaState<CLOCKS>,
        reference: &ReferenceModel,
        memory: BankMemory<'_>,
    ) -> Option<UpdateSummary> {
        let llh = geodesy::to_llh(&Vector3::from(at.r_e_m)).ok()?;
        let c_enu_e = geodesy::c_enu_e(llh.lat_rad, llh.lon_rad);
        let BankMemory { fast, secondaries } = memory;
        let MonitorFastFilters { main, sub } = fast;
        let Self {
            bank, navigator, ..
        } = self;
        bank.predict(navigator.transition(), sub, secondaries);
        navigator.lend(main);
        bank.admit(
            &BankEpoch {
                time: at.time,
                rows: &self.rows,
                hold_ns: reference.hold_ns,
            },
            main,
            sub,
            secondaries,
            navigator.information_mut(),
        );
        let summary = navigator.update_lent(main);
        bank.update(sub, secondaries);
        let criterion = Criterion {
            quantiles: &self.quantiles,
            vertical: reference.detect_vertical,
            c_enu_e: &c_enu_e,
        };
        let verdict = bank.test(&criterion, main, sub, secondaries);
        if let Some(satellite) = verdict.isolated.filter(|_| reference.exclude) {
            bank.exclude(satellite, main, sub, secondaries);
        }
        self.bank_verdict = Some((at.time, verdict));
        navigator.take_back(main);
        let correction = navigator.finish().ok()?;
        bank.rereference(&correction, sub, secondaries);
        Some(summary)
    }

    /// The bank of filters: its satellites with their tests.
    pub const fn bank(&self) -> &Bank<CLOCKS, JOINT> {
        &self.bank
    }

    /// What the bank said of the last epoch.
    pub const fn bank_verdict(&self) -> Option<&(GpsTime, BankVerdict)> {
        self.bank_verdict.as_ref()
    }
}
