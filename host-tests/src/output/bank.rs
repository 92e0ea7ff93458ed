//! Columns of `epochs.csv` that hold what the bank of filters found.
//!
//! Which satellites were ever in the bank is known at the end only, so that the header is made from all
//! epochs and the rows are written one by one after it.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use serde::Serialize;
use surefix_core::bank_report::BankReport;
use surefix_core::gnss::{Satellite, System};
use surefix_core::integrity::Integrity;
use surefix_core::report::EpochReport;

use super::field;

/// Columns of every file; those of the satellites follow.
pub const FIXED_COLUMNS: &str =
    ",n_bank,n_unmonitored,uncertainty_h_m,uncertainty_v_m,opinions,p_unmonitored,pairs_dropped";

/// What the bank found at each epoch, beside the reports; `None` where it did not run.
pub type Banks = [Option<Box<BankReport>>];

/// What the bank did over all epochs, for `summary.json`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct BankSummary {
    /// Epochs in which it ran.
    pub epochs: usize,
    /// Epochs in which a test failed.
    pub epochs_with_failed_test: usize,
    /// Epochs with more satellites than it has places for.
    pub epochs_over_capacity: usize,
    /// Fewest satellites in it.
    pub fewest_satellites: Option<usize>,
    /// Most satellites in it.
    pub most_satellites: Option<usize>,
    /// Epochs without time for the filters of the pairs.
    pub epochs_without_pairs: usize,
    /// Epochs by how its opinion and the snapshot's stand to each other.
    pub opinions: BTreeMap<&'static str, usize>,
}

impl BankSummary {
    /// Counts.
    pub fn new(banks: &Banks) -> Self {
        let ran = || banks.iter().flatten();
        let satellites = || ran().map(|bank| bank.tests.len());
        let mut opinions: BTreeMap<_, usize> = BTreeMap::new();
        for both in ran().filter_map(|bank| bank.opinions) {
            *opinions.entry(both.name()).or_default() += 1;
        }
        Self {
            epochs: ran().count(),
            epochs_with_failed_test: ran().filter(|bank| bank.detected).count(),
            epochs_over_capacity: ran().filter(|bank| bank.n_unmonitored > 0).count(),
            fewest_satellites: satellites().min(),
            most_satellites: satellites().max(),
            epochs_without_pairs: ran().filter(|bank| bank.pairs_dropped).count(),
            opinions,
        }
    }
}

/// The satellites and constellations that have columns.
#[derive(Clone, Debug)]
pub struct BankColumns {
    /// Sorted by name.
    satellites: Vec<(String, Satellite)>,
    /// Sorted by letter.
    constellations: Vec<System>,
}

impl BankColumns {
    /// Those that were in the bank at some epoch.
    pub fn new(banks: &Banks) -> Self {
        let mut is_there = [false; Satellite::COUNT];
        let tests = banks.iter().flatten().flat_map(|bank| &bank.tests);
        for test in tests {
            if let Some(slot) = is_there.get_mut(test.satellite.index()) {
                *slot = true;
            }
        }
        let mut satellites: Vec<(String, Satellite)> = is_there
            .iter()
            .enumerate()
            .filter(|(_, is_there)| **is_there)
            .filter_map(|(index, _)| Satellite::from_index(index))
            .map(|satellite| (satellite.to_string(), satellite))
            .collect();
        satellites.sort();
        let mut constellations: Vec<System> = Vec::new();
        for test in banks.iter().flatten().flat_map(|b| &b.constellations) {
            if !constellations.contains(&test.system) {
                constellations.push(test.system);
            }
        }
        constellations.sort_by_key(|system| system.letter());
        Self {
            satellites,
            constellations,
        }
    }

    /// Names of all columns, each with a comma before it.
    pub fn header(&self) -> String {
        let mut text = FIXED_COLUMNS.to_owned();
        let satellites = self.satellites.iter().map(|(name, _)| name.clone());
        let constellations = self.constellations.iter().map(|s| s.letter().to_string());
        for name in satellites.chain(constellations) {
            let _ = write!(text, ",d_h_{name},t_h_{name},d_v_{name},t_v_{name}");
        }
        text
    }

    /// Fields of an epoch, each with a comma before it.
    pub fn row(&self, line: &mut String, report: &EpochReport, bank: Option<&BankReport>) {
        field(line, bank.map(|bank| bank.tests.len() as f64));
        field(line, bank.map(|bank| bank.n_unmonitored.into()));
        let is_alert = report.verdict.integrity == Integrity::Alert;
        for axis in 0..2 {
            let bank = bank.filter(|_| is_alert);
            field(line, bank.and_then(|bank| bank.alerted_level_m[axis]));
        }
        let opinions = bank.and_then(|bank| bank.opinions);
        let _ = write!(line, ",{}", opinions.map_or("", |opinions| opinions.name()));
        field(line, bank.map(|bank| bank.p_unmonitored));
        field(
            line,
            bank.map(|bank| f64::from(u8::from(bank.pairs_dropped))),
        );
        for (_, satellite) in &self.satellites {
            let mut tests = bank.iter().flat_map(|bank| &bank.tests);
            let test = tests.find(|test| test.satellite == *satellite);
            four(line, test.map(|test| (test.statistic_m, test.threshold_m)));
        }
        for system in &self.constellations {
            let mut tests = bank.iter().flat_map(|bank| &bank.constellations);
            let test = tests.find(|test| test.system == *system);
            four(line, test.map(|test| (test.statistic_m, test.threshold_m)));
        }
    }
}

/// Statistic and threshold, horizontal and vertical.
type Pair = ([Option<f64>; 2], [Option<f64>; 2]);

/// Horizontal statistic and threshold, then vertical; empty where there is nothing to test.
fn four(line: &mut String, test: Option<Pair>) {
    for axis in 0..2 {
        match test {
            Some((d, t)) if t[axis] != Some(0.0) || d[axis].is_none() => {
                number(line, d[axis]);
                number(line, t[axis]);
            }
            _ => line.push_str(",,"),
        }
    }
}

/// What is not finite fails its test, and has to be seen.
fn number(line: &mut String, value: Option<f64>) {
    match value {
        Some(_) => field(line, value),
        None => line.push_str(",nan"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use surefix_core::bank_report::{BankTest, ConstellationTest};
    use surefix_core::integrity::Opinions;

    fn test(system: System, prn: u8, d: [Option<f64>; 2], t: [Option<f64>; 2]) -> BankTest {
        BankTest {
            satellite: Satellite::new(system, prn).unwrap(),
            statistic_m: d,
            threshold_m: t,
        }
    }

    fn bank(tests: &[BankTest]) -> Option<Box<BankReport>> {
        let mut bank = Box::new(BankReport::EMPTY);
        bank.n_unmonitored = 2;
        bank.alerted_level_m = [Some(0.1 + 0.2), None];
        bank.tests.extend(tests.iter().copied());
        Some(bank)
    }

    #[test]
    fn satellites_ever_in_the_bank_have_columns_in_the_order_of_their_names() {
        let (one, two) = ([Some(1.0), Some(2.0)], [Some(3.0), Some(0.0)]);
        let mut banks = [
            bank(&[
                test(System::Gps, 5, one, two),
                test(System::Bds, 30, one, two),
            ]),
            None,
            bank(&[test(System::Gps, 2, [None, Some(0.5)], [Some(4.0), None])]),
        ];
        let last = banks[2].as_mut().unwrap();
        last.opinions = Some(Opinions::BankOnly);
        last.p_unmonitored = 1e-9;
        last.pairs_dropped = true;
        let _ = last.constellations.push(ConstellationTest {
            system: System::Bds,
            statistic_m: one,
            threshold_m: two,
        });
        let columns = BankColumns::new(&banks);
        let header = columns.header();
        assert_eq!(
            header,
            format!(
                "{FIXED_COLUMNS},d_h_C30,t_h_C30,d_v_C30,t_v_C30,d_h_G02,t_h_G02,d_v_G02,t_v_G02,\
                 d_h_G05,t_h_G05,d_v_G05,t_v_G05,d_h_C,t_h_C,d_v_C,t_v_C"
            )
        );
        let mut report = super::super::tests::no_position();
        let mut row = |k: usize, integrity| {
            report.verdict.integrity = integrity;
            let mut line = String::new();
            columns.row(&mut line, &report, banks[k].as_deref());
            assert_eq!(line.matches(',').count(), header.matches(',').count());
            line
        };
        // A threshold of 0 says that there is nothing to test.
        assert_eq!(
            row(0, Integrity::Nominal),
            ",2,2,,,,0,0,1,3,,,,,,,1,3,,,,,,"
        );
        let alerted = row(2, Integrity::Alert);
        assert!(
            alerted.starts_with(",1,2,0.30000000000000004,,"),
            "{alerted}"
        );
        assert!(
            alerted.ends_with(",,,,,nan,4,0.5,nan,,,,,1,3,,"),
            "{alerted}"
        );
        assert_eq!(row(1, Integrity::Alert), ",".repeat(23));
    }
}
