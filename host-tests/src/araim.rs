//! `surefix araim`: levels, thresholds and tests of ARAIM cases in JSON.
//!
//! A case that cannot be evaluated gets an error that names the case and the field; the others still run.

mod case;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use case::{Case, CaseError, explain, quote_what_is_no_number};
use serde::Serialize;
use serde_json::Value;
use surefix_core::raim::araim::detection::Detection;
use surefix_core::raim::araim::exclusion::{AraimExclusion, NotExcluded};
use surefix_core::raim::araim::levels::AraimLevels;
use surefix_core::raim::araim::modes::SatelliteSet;
use surefix_core::raim::araim::subsets::SubsetSolution;
use surefix_core::raim::araim::{Araim, AraimError};

/// ARAIM of given geometries: levels, effective monitor threshold, every subset solution
#[derive(clap::Args)]
pub struct Args {
    /// Cases: geometry, error model, fault probabilities, risks
    #[arg(value_name = "CASES.json")]
    pub cases: PathBuf,
    /// Results: one entry per case, in their order
    #[arg(long, value_name = "FILE.json")]
    pub out: PathBuf,
}

/// One entry of the output.
#[derive(Debug, Serialize)]
pub struct CaseOutcome {
    /// `id` of the case, or `#` and its number from 0.
    id: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    result: Option<CaseResult>,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
    /// Tests of the case's measurements, if it has some.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    measurement_tests: Vec<TestOutcome>,
}

impl CaseOutcome {
    fn empty(id: String) -> Self {
        Self {
            id,
            result: None,
            error: None,
            measurement_tests: Vec::new(),
        }
    }
}

/// Levels of a case, m; names as in the cases' own `expected`.
#[derive(Debug, Serialize)]
struct CaseResult {
    vpl: f64,
    hpl: f64,
    pl_e: f64,
    pl_n: f64,
    emt: f64,
    emt_prior_tolerant: f64,
    sig_acc_v: f64,
    sigma_acc_enu: [f64; 3],
    p_not_monitored: f64,
    k_fa_h: f64,
    k_fa_v: f64,
    n_subsets: usize,
    n_monitorable: usize,
    subsets: Vec<SubsetResult>,
}

/// One fault mode.
#[derive(Debug, Serialize)]
struct SubsetResult {
    excluded: Vec<usize>,
    p_fault_inst: f64,
    p_fault_exp: f64,
    sigma: [f64; 3],
    sigma_ss: [f64; 3],
    bias: [f64; 3],
    bias_ss: [f64; 3],
    threshold: [f64; 3],
}

/// Tests of one set of measurements.
#[derive(Debug, Default, Serialize)]
struct TestOutcome {
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
    #[serde(flatten)]
    result: Option<TestResult>,
}

#[derive(Debug, Serialize)]
struct TestResult {
    x0: [f64; 3],
    separation: Vec<[f64; 3]>,
    max_test_ratio: f64,
    argmax_subset: usize,
    /// A separation exceeds its threshold.
    detected: bool,
    wsse_int: f64,
    wsse_acc_weighted: f64,
    chi2_threshold_1e_8: Option<f64>,
    dof: usize,
    /// The sum of squares exceeds its threshold.
    chi2_exceeded: bool,
    /// What was done about a detected fault.
    #[serde(skip_serializing_if = "Option::is_none")]
    exclusion: Option<ExclusionResult>,
}

/// The fault taken out and the levels without it, or why none was.
#[derive(Debug, Serialize)]
struct ExclusionResult {
    excluded: Vec<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<&'static str>,
    x: Option<[f64; 3]>,
    vpl: Option<f64>,
    hpl: Option<f64>,
}

#[derive(Serialize)]
struct Output<'a> {
    cases: &'a [CaseOutcome],
}

/// Reads the cases, runs them and writes the results; how many could not be evaluated.
///
/// # Errors
/// When the file of cases cannot be read or is none, or the results cannot be written.
pub fn run(args: &Args) -> Result<usize> {
    let outcomes = evaluate_file(&args.cases)?;
    let text = serde_json::to_string_pretty(&Output { cases: &outcomes })?;
    fs::write(&args.out, text + "\n")
        .with_context(|| format!("cannot write {}; give another --out", args.out.display()))?;
    let mut failed = 0;
    for outcome in &outcomes {
        let tests = outcome.measurement_tests.iter();
        let errors = outcome.error.iter();
        let mut has_error = false;
        for error in errors.chain(tests.filter_map(|test| test.error.as_ref())) {
            eprintln!("surefix: {error}");
            has_error = true;
        }
        failed += usize::from(has_error);
    }
    println!(
        "{} cases, {} with errors: {}",
        outcomes.len(),
        failed,
        args.out.display()
    );
    if failed > 0 {
        eprintln!(
            "surefix: {failed} of {} cases have errors: correct the fields named above and run them again; the others are done",
            outcomes.len()
        );
    }
    Ok(failed)
}

fn evaluate_file(path: &Path) -> Result<Vec<CaseOutcome>> {
    let text = fs::read_to_string(path)
        .with_context(|| format!("cannot read {}; give a file of ARAIM cases", path.display()))?;
    evaluate_text(&text).with_context(|| path.display().to_string())
}

/// Runs the cases of a JSON text.
///
/// # Errors
/// When it is no JSON, or has no list `cases`.
pub fn evaluate_text(text: &str) -> Result<Vec<CaseOutcome>> {
    let document: Value = serde_json::from_str(&quote_what_is_no_number(text))
        .context("not JSON; a file of ARAIM cases is {\"cases\": [...]}")?;
    let Some(cases) = document.get("cases").and_then(Value::as_array) else {
        bail!("has no list \"cases\"; a file of ARAIM cases is {{\"cases\": [...]}}");
    };
    let mut evaluator = Evaluator::new();
    let mut outcomes: Vec<CaseOutcome> = Vec::with_capacity(cases.len());
    for (number, case) in cases.iter().enumerate() {
        let outcome = match case.get("id").and_then(Value::as_str) {
            Some(id) if outcomes.iter().any(|earlier| earlier.id == id) => {
                let error = CaseError::Illegal {
                    case: format!("#{number}"),
                    field: "id".to_owned(),
                    found: format!("\"{id}\""),
                    expected: "that of no other case".to_owned(),
                };
                CaseOutcome {
                    error: Some(error.to_string()),
                    ..CaseOutcome::empty(format!("#{number}"))
                }
            }
            _ => evaluator.outcome(number, case),
        };
        outcomes.push(outcome);
    }
    Ok(outcomes)
}

/// The memory of the algorithm, used case after case.
struct Evaluator {
    araim: Box<Araim>,
    scratch: Box<Araim>,
}

impl Evaluator {
    fn new() -> Self {
        Self {
            araim: Box::new(Araim::EMPTY),
            scratch: Box::new(Araim::EMPTY),
        }
    }

    fn outcome(&mut self, number: usize, case: &Value) -> CaseOutcome {
        let id = match case.get("id") {
            Some(Value::String(id)) => id.clone(),
            _ => format!("#{number}"),
        };
        let mut outcome = CaseOutcome::empty(id);
        let evaluated = Case::read(&outcome.id, case).and_then(|case| {
            let result = self.evaluate(&case)?;
            Ok((case, result))
        });
        match evaluated {
            Ok((case, result)) => {
                outcome.result = Some(result);
                outcome.measurement_tests = self.tests(&case);
            }
            Err(error) => outcome.error = Some(error.to_string()),
        }
        outcome
    }

    fn evaluate(&mut self, case: &Case) -> Result<CaseResult, CaseError> {
        let levels = self
            .araim
            .evaluate(&case.satellites, &case.constellations, &case.parameters)
            .map_err(|error| case.refused(error))?;
        Ok(result(&levels, self.araim.subsets()))
    }

    fn tests(&mut self, case: &Case) -> Vec<TestOutcome> {
        let Some(tests) = case.fields.json.get("measurement_tests") else {
            return Vec::new();
        };
        let Some(tests) = tests.as_array() else {
            let illegal = case.fields.illegal("measurement_tests", tests, "a list");
            return vec![TestOutcome {
                error: Some(illegal.to_string()),
                result: None,
            }];
        };
        let outcomes = tests.iter().enumerate().map(|(number, test)| {
            match self.test(case, &format!("measurement_tests[{number}].y"), test) {
                Ok(result) => TestOutcome {
                    error: None,
                    result: Some(result),
                },
                Err(error) => TestOutcome {
                    error: Some(error.to_string()),
                    result: None,
                },
            }
        });
        outcomes.collect()
    }

    fn test(&mut self, case: &Case, field: &str, test: &Value) -> Result<TestResult, CaseError> {
        let refused = |cause: AraimError| CaseError::Refused {
            case: case.fields.case.clone(),
            field: match cause {
                AraimError::Satellite { index, .. } => format!("{field}[{index}]"),
                _ => field.to_owned(),
            },
            cause: explain(&cause),
        };
        let value = test.get("y").ok_or_else(|| CaseError::Missing {
            case: case.fields.case.clone(),
            field: field.to_owned(),
        })?;
        let y = case
            .fields
            .number_list(field, value, Some(case.satellites.len()))?;
        let mut separation = Vec::new();
        let detection = self
            .araim
            .test(&y, |_, enu| separation.push(*enu))
            .map_err(refused)?;
        let exclusion = detection.is_detected().then(|| {
            let excluded =
                self.araim
                    .exclude(&case.satellites, &case.parameters, &y, &mut self.scratch);
            exclusion_result(&excluded)
        });
        Ok(test_result(&detection, separation, exclusion))
    }
}

fn indices(set: SatelliteSet) -> Vec<usize> {
    set.iter().collect()
}

fn result(levels: &AraimLevels, subsets: &[SubsetSolution]) -> CaseResult {
    let [_, _, sig_acc_v] = levels.sigma_accuracy_enu_m;
    CaseResult {
        vpl: levels.vpl_m,
        hpl: levels.hpl_m,
        pl_e: levels.level_east_m,
        pl_n: levels.level_north_m,
        emt: levels.emt_m,
        emt_prior_tolerant: levels.emt_prior_tolerant_m,
        sig_acc_v,
        sigma_acc_enu: levels.sigma_accuracy_enu_m,
        p_not_monitored: levels.p_not_monitored,
        k_fa_h: levels.k_false_alert_horizontal,
        k_fa_v: levels.k_false_alert_vertical,
        n_subsets: levels.modes_enumerated,
        n_monitorable: levels.modes_monitored,
        subsets: subsets
            .iter()
            .map(|subset| SubsetResult {
                excluded: indices(subset.excluded),
                p_fault_inst: subset.p_instant,
                p_fault_exp: subset.p_exposure,
                sigma: subset.sigma_m,
                sigma_ss: subset.sigma_separation_m,
                bias: subset.bias_m,
                bias_ss: subset.bias_separation_m,
                threshold: subset.threshold_m,
            })
            .collect(),
    }
}

fn test_result(
    detection: &Detection,
    separation: Vec<[f64; 3]>,
    exclusion: Option<ExclusionResult>,
) -> TestResult {
    TestResult {
        x0: detection.position_enu_m,
        separation,
        max_test_ratio: detection.test_ratio,
        argmax_subset: detection.largest,
        detected: detection.separations_fail(),
        wsse_int: detection.sum_of_squares,
        wsse_acc_weighted: detection.sum_of_squares_accuracy,
        chi2_threshold_1e_8: detection.chi_square_threshold,
        dof: detection.redundancy,
        chi2_exceeded: detection.chi_square_fails(),
        exclusion,
    }
}

fn exclusion_result(excluded: &Result<AraimExclusion, NotExcluded>) -> ExclusionResult {
    match excluded {
        Ok(exclusion) => ExclusionResult {
            excluded: indices(exclusion.excluded),
            reason: None,
            x: Some(exclusion.remaining.position_enu_m),
            vpl: Some(exclusion.levels.vpl_m),
            hpl: Some(exclusion.levels.hpl_m),
        },
        Err(why) => ExclusionResult {
            excluded: Vec::new(),
            reason: Some(match why {
                NotExcluded::Unexplained => {
                    "no exclusion leaves satellites that agree and have levels"
                }
                NotExcluded::NoFault => "the tests pass",
                NotExcluded::Error(_) => "the epoch cannot be tested",
            }),
            x: None,
            vpl: None,
            hpl: None,
        },
    }
}
