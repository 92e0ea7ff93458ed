//! Claims: exclusion never takes a healthy satellite out and leaves a faulty one in; where it cannot tell
//! it says so; with redundancy it does exclude; its statistic is that of a new solution without the rows.

#![expect(
    clippy::needless_range_loop,
    reason = "matrices are handled by the formula's indices"
)]

mod skies;

use skies::{Random, add_noise, sky};
use surefix_core::linalg::LinearModel;
use surefix_core::linalg::qr::WhitenedQr;
use surefix_core::raim::exclusion::{Exclusion, ExclusionWorkspace, NotIsolated, RowSet, identify};
use surefix_core::raim::slope::{Sensitivity, semi_major_axis_m};
use surefix_core::raim::thresholds::RaimTable;
use surefix_core::raim::{TestStatistic, parity};

/// Everything a monitor would hold in a static.
struct Bench {
    table: RaimTable,
    qr: WhitenedQr,
    sensitivity: Sensitivity,
    workspace: ExclusionWorkspace,
}

impl Bench {
    fn new() -> Self {
        let mut table = RaimTable::EMPTY;
        table.fill(3.3333e-7, 1e-3).unwrap();
        Self {
            table,
            qr: WhitenedQr::EMPTY,
            sensitivity: Sensitivity::EMPTY,
            workspace: ExclusionWorkspace::EMPTY,
        }
    }

    fn test(&mut self, model: &LinearModel) -> Option<TestStatistic> {
        let statistic = parity::test(model, &mut self.qr).ok()?;
        self.sensitivity.fill(&mut self.qr);
        Some(statistic)
    }

    fn passes(&self, statistic: &TestStatistic) -> bool {
        statistic.passes(self.table.threshold(statistic.redundancy).unwrap())
    }

    fn identify(
        &mut self,
        model: &LinearModel,
        max_faults: usize,
    ) -> Result<Exclusion, NotIsolated> {
        self.test(model).unwrap();
        identify(&self.qr, &self.table, max_faults, &mut self.workspace)
    }
}

/// The model without these rows; clocks nobody sees any more go too.
fn without(model: &LinearModel, rows: RowSet) -> LinearModel {
    let mut left = LinearModel::EMPTY;
    for i in (0..model.n).filter(|i| !rows.contains(*i)) {
        left.design[left.n] = model.design[i];
        left.residual_m[left.n] = model.residual_m[i];
        left.sigma_m[left.n] = model.sigma_m[i];
        left.n += 1;
    }
    left.m = 3;
    for j in 3..model.m {
        if (0..left.n).any(|i| left.design[i][j] != 0.0) {
            for i in 0..left.n {
                left.design[i][left.m] = left.design[i][j];
                if j > left.m {
                    left.design[i][j] = 0.0;
                }
            }
            left.m += 1;
        }
    }
    left
}

fn distinct_rows(random: &mut Random, count: usize, n: usize) -> Vec<usize> {
    let mut rows = Vec::new();
    while rows.len() < count {
        let row = random.integer(0, n - 1);
        if !rows.contains(&row) {
            rows.push(row);
        }
    }
    rows
}

/// Residuals of a settled solution about the truth, so that the estimate is the position error.
fn add_errors(random: &mut Random, model: &mut LinearModel, faults: &[(usize, f64)]) {
    for i in 0..model.n {
        model.residual_m[i] = model.sigma_m[i] * random.normal();
    }
    for (row, size_m) in faults {
        model.residual_m[*row] += size_m;
    }
}

/// Whether the horizontal error exceeds the level: the slope-based part and 5.33 sigma (1e-7) of what
/// noise alone does. No level is not beyond it.
fn is_beyond_level(bench: &Bench, model: &LinearModel, statistic: &TestStatistic) -> bool {
    let sqrt_lambda = bench
        .table
        .sqrt_noncentrality(statistic.redundancy)
        .unwrap();
    let Ok(levels) = bench.sensitivity.levels(sqrt_lambda) else {
        return false;
    };
    let covariance = bench
        .sensitivity
        .position_covariance(model, &model.sigma_m, &[]);
    let estimate = bench.qr.estimate();
    let error_m = (estimate[0].powi(2) + estimate[1].powi(2)).sqrt();
    error_m > levels.hpl_m + 5.33 * semi_major_axis_m(&covariance)
}

#[derive(Default, Debug, Clone, Copy)]
struct Counts {
    trials: usize,
    undetected: usize,
    undetected_beyond_level: usize,
    exactly_excluded: usize,
    partly_excluded: usize,
    too_many_excluded: usize,
    wrongly_excluded: usize,
    beyond_level_after_exclusion: usize,
    not_isolated: usize,
}

fn count(bench: &mut Bench, model: &LinearModel, faulty: &[usize], counts: &mut Counts) {
    let Some(statistic) = bench.test(model) else {
        return;
    };
    counts.trials += 1;
    if bench.passes(&statistic) {
        counts.undetected += 1;
        if is_beyond_level(bench, model, &statistic) {
            counts.undetected_beyond_level += 1;
        }
        return;
    }
    match identify(&bench.qr, &bench.table, 3, &mut bench.workspace) {
        Err(NotIsolated::Unexplained | NotIsolated::Ambiguous { .. }) => counts.not_isolated += 1,
        Err(other) => panic!("{other:?}"),
        Ok(exclusion) => {
            let out: Vec<usize> = exclusion.rows.iter().collect();
            let healthy_out = out.iter().any(|row| !faulty.contains(row));
            let faulty_in = faulty.iter().any(|row| !out.contains(row));
            match (healthy_out, faulty_in) {
                (false, false) => counts.exactly_excluded += 1,
                (false, true) => counts.partly_excluded += 1,
                (true, false) => counts.too_many_excluded += 1,
                (true, true) => {
                    counts.wrongly_excluded += 1;
                    println!("wrong: faulty {faulty:?}, out {out:?}");
                }
            }
            let left = without(model, exclusion.rows);
            let statistic = bench.test(&left).unwrap();
            if bench.passes(&statistic) && is_beyond_level(bench, &left, &statistic) {
                counts.beyond_level_after_exclusion += 1;
            }
        }
    }
}

/// INT-003.
#[test]
fn no_healthy_satellite_goes_while_a_faulty_one_stays() {
    let mut random = Random(5);
    let mut bench = Bench::new();
    let mut open_sky = [Counts::default(); 4];
    println!("faults, clocks, satellites: counts");
    for faults in 1..=3 {
        for clocks in 1..=3 {
            for satellites in [8..=10, 11..=14, 15..=19, 20..=24] {
                let mut counts = Counts::default();
                for _ in 0..1500 {
                    let n = random.integer(*satellites.start(), *satellites.end());
                    let mut model = sky(&mut random, n, clocks);
                    let faulty = distinct_rows(&mut random, faults, n);
                    // Half of the time all alike, which is what a clock shift hides best.
                    let are_alike = random.uniform() < 0.5;
                    let common_m = 100.0 + 200.0 * random.uniform();
                    let sized: Vec<(usize, f64)> = faulty
                        .iter()
                        .map(|row| {
                            let own_m = 100.0 + 200.0 * random.uniform();
                            let sign = if random.uniform() < 0.5 { -1.0 } else { 1.0 };
                            (*row, if are_alike { common_m } else { sign * own_m })
                        })
                        .collect();
                    add_errors(&mut random, &mut model, &sized);
                    count(&mut bench, &model, &faulty, &mut counts);
                }
                println!("{faults}, {clocks}, {satellites:?}: {counts:?}");
                assert!(counts.trials > 1450);
                assert_eq!(counts.wrongly_excluded, 0);
                // The level bounds one fault; several may hide each other where redundancy is small.
                if faults == 1 || *satellites.start() > 10 {
                    assert_eq!(counts.undetected_beyond_level, 0);
                    assert_eq!(counts.beyond_level_after_exclusion, 0);
                }
                if *satellites.start() == 20 {
                    open_sky[faults].trials += counts.trials;
                    open_sky[faults].exactly_excluded += counts.exactly_excluded;
                }
            }
        }
    }
    // It would be no use if it never dared.
    for counts in &open_sky[1..] {
        let share = counts.exactly_excluded as f64 / counts.trials as f64;
        println!("20 to 24 satellites: {share:.4} excluded exactly");
        assert!(share > 0.95);
    }
}

#[test]
fn what_remains_is_what_a_new_solution_finds() {
    let mut random = Random(6);
    let mut bench = Bench::new();
    let mut compared = 0;
    for trial in 0..600 {
        let clocks = random.integer(1, 3);
        let n = random.integer(14, 40);
        let mut model = sky(&mut random, n, clocks);
        add_noise(&mut random, &mut model);
        for row in distinct_rows(&mut random, 1 + trial % 3, n) {
            model.residual_m[row] += 200.0;
        }
        let Ok(exclusion) = bench.identify(&model, 3) else {
            continue;
        };
        let again = bench.test(&without(&model, exclusion.rows)).unwrap();
        assert_eq!(again.redundancy, exclusion.remaining.redundancy);
        let relative = again.sum_of_squares / exclusion.remaining.sum_of_squares - 1.0;
        assert!(relative.abs() < 1e-7, "{relative:e}");
        compared += 1;
    }
    assert!(compared > 500, "{compared}");
}

/// Nine satellites of one constellation, `others` of another, which come last.
fn two_constellations(random: &mut Random, others: usize) -> LinearModel {
    let mut model = sky(random, 9 + others, 1);
    model.m = 5;
    for i in 9..model.n {
        model.design[i][3] = 0.0;
        model.design[i][4] = 1.0;
    }
    model
}

/// INT-003.
#[test]
fn three_of_four_equal_faults_do_not_condemn_the_healthy_fourth() {
    let mut random = Random(7);
    let mut bench = Bench::new();
    let mut deceived = 0;
    for _ in 0..300 {
        let mut model = two_constellations(&mut random, 4);
        let faults = [(9, 150.0), (10, 150.0), (11, 150.0)];
        add_errors(&mut random, &mut model, &faults);
        // Who reckons with one fault only is deceived, whenever he answers at all.
        if let Ok(exclusion) = bench.identify(&model, 1) {
            assert_eq!(exclusion.rows.iter().collect::<Vec<_>>(), [12]);
            deceived += 1;
        }
        let answer = bench.identify(&model, 3);
        assert!(
            matches!(answer, Err(NotIsolated::Ambiguous { .. })),
            "{answer:?}"
        );
    }
    assert!(deceived > 250, "{deceived}");
}

/// INT-002.
#[test]
fn two_satellites_of_a_constellation_cannot_accuse_each_other() {
    let mut random = Random(8);
    let mut bench = Bench::new();
    for max_faults in 1..=3 {
        let mut model = two_constellations(&mut random, 2);
        add_errors(&mut random, &mut model, &[(9, 200.0)]);
        let answer = bench.identify(&model, max_faults);
        assert!(
            matches!(answer, Err(NotIsolated::Ambiguous { .. })),
            "{answer:?}"
        );
    }
    // One that is alone is no rival to anybody: no fault of it shows.
    let mut model = two_constellations(&mut random, 1);
    add_errors(&mut random, &mut model, &[(3, 200.0), (9, 500.0)]);
    let exclusion = bench.identify(&model, 1).unwrap();
    assert_eq!(exclusion.rows.iter().collect::<Vec<_>>(), [3]);
}

/// INT-002.
#[test]
fn without_the_redundancy_to_tell_faults_apart_nothing_is_excluded() {
    let mut random = Random(9);
    let mut bench = Bench::new();
    for (n, max_faults) in [(5, 1), (5, 3), (6, 2), (7, 3)] {
        for _ in 0..100 {
            let mut model = sky(&mut random, n, 1);
            add_errors(&mut random, &mut model, &[(2, 500.0)]);
            match bench.identify(&model, max_faults) {
                Err(
                    NotIsolated::Ambiguous { .. } | NotIsolated::Unexplained | NotIsolated::NoFault,
                ) => {}
                other => panic!("{n} satellites, {max_faults} faults: {other:?}"),
            }
        }
    }
}

#[test]
fn the_search_says_why_it_does_not_answer() {
    let mut random = Random(10);
    let mut bench = Bench::new();
    let empty = identify(&bench.qr, &bench.table, 3, &mut bench.workspace);
    assert_eq!(empty, Err(NotIsolated::NotTestable));

    let mut model = sky(&mut random, 12, 1);
    add_errors(&mut random, &mut model, &[]);
    assert_eq!(bench.identify(&model, 3), Err(NotIsolated::NoFault));

    add_errors(&mut random, &mut model, &[(4, 300.0)]);
    for max_faults in [0, 4] {
        assert_eq!(
            bench.identify(&model, max_faults),
            Err(NotIsolated::FaultsOutOfRange { max_faults })
        );
    }
    let exclusion = bench.identify(&model, 3).unwrap();
    assert!(exclusion.rows.contains(4) && exclusion.rows.len() == 1);
    assert_eq!(exclusion.remaining.redundancy, 7);

    let empty_table = identify(&bench.qr, &RaimTable::EMPTY, 3, &mut bench.workspace);
    assert_eq!(empty_table, Err(NotIsolated::NotTestable));

    // Five faults are more than any three rows explain.
    let faults = [(0, 300.0), (3, -250.0), (5, 180.0), (7, 270.0), (9, -150.0)];
    add_errors(&mut random, &mut model, &faults);
    assert_eq!(bench.identify(&model, 3), Err(NotIsolated::Unexplained));
}
