//! Claims: on any sky the subset solutions are those of a new solution per subset; a level keeps its risk
//! and no smaller one does; what no mode monitors is charged; excluded satellites are the faulty ones;
//! errors above a level without an alert are rarer than the risk, with and without exclusion; bad cases
//! are named and the others run.

mod skies;

use serde_json::{Value, json};
use skies::{Random, sky};
use std::process::Command;
use surefix_core::raim::araim::exclusion::NotExcluded;
use surefix_core::raim::araim::{
    Araim, AraimConstellation, AraimError, AraimParameters, AraimSatellite, SatelliteField,
};

/// Satellites of a random sky, variances for accuracy and biases of their own.
fn satellites(
    random: &mut Random,
    n: usize,
    constellations: usize,
    p_fault: f64,
) -> Vec<AraimSatellite> {
    let model = sky(random, n, constellations);
    (0..n)
        .map(|i| {
            let clocks = &model.design[i][3..3 + constellations];
            let variance = model.sigma_m[i] * model.sigma_m[i];
            AraimSatellite {
                design_enu: [model.design[i][0], model.design[i][1], model.design[i][2]],
                constellation: clocks.iter().position(|c| *c == 1.0).unwrap(),
                variance_integrity_m2: variance,
                variance_accuracy_m2: variance * (0.3 + 0.7 * random.uniform()),
                bias_integrity_m: random.uniform(),
                bias_accuracy_m: 0.2 * random.uniform(),
                p_fault,
                exposure: random.uniform(),
            }
        })
        .collect()
}

fn constellations(count: usize, p_fault: f64) -> Vec<AraimConstellation> {
    vec![
        AraimConstellation {
            p_fault,
            exposure: 0.5
        };
        count
    ]
}

fn araim() -> Box<Araim> {
    Box::new(Araim::EMPTY)
}

/// A x = b by elimination with row exchange; `None` if singular.
fn solve(mut a: Vec<Vec<f64>>, mut b: Vec<Vec<f64>>) -> Option<Vec<Vec<f64>>> {
    let n = a.len();
    for k in 0..n {
        let best = (k..n).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs()))?;
        a.swap(k, best);
        b.swap(k, best);
        if a[k][k].abs() < 1e-12 {
            return None;
        }
        for i in 0..n {
            if i == k {
                continue;
            }
            let factor = a[i][k] / a[k][k];
            for j in 0..n {
                a[i][j] -= factor * a[k][j];
            }
            for j in 0..b[i].len() {
                b[i][j] -= factor * b[k][j];
            }
        }
    }
    Some(
        (0..n)
            .map(|i| b[i].iter().map(|x| x / a[i][i]).collect())
            .collect(),
    )
}

/// East, north and up rows of (GᵀWG)⁻¹GᵀW of the satellites in use, a clock per constellation in use.
fn solution(satellites: &[AraimSatellite], uses: &[bool]) -> Option<Vec<Vec<f64>>> {
    let n = satellites.len();
    let mut clocks: Vec<usize> = (0..n)
        .filter(|i| uses[*i])
        .map(|i| satellites[i].constellation)
        .collect();
    clocks.sort_unstable();
    clocks.dedup();
    let m = 3 + clocks.len();
    let row = |i: usize| {
        let mut row = satellites[i].design_enu.to_vec();
        row.extend(
            clocks
                .iter()
                .map(|c| f64::from(u8::from(*c == satellites[i].constellation))),
        );
        row
    };
    let weight = |i: usize| f64::from(u8::from(uses[i])) / satellites[i].variance_integrity_m2;
    let mut normal = vec![vec![0.0; m]; m];
    let mut right = vec![vec![0.0; n]; m];
    for i in 0..n {
        let row = row(i);
        for a in 0..m {
            right[a][i] = row[a] * weight(i);
            for b in 0..m {
                normal[a][b] += row[a] * row[b] * weight(i);
            }
        }
    }
    solve(normal, right).map(|mut s| {
        s.truncate(3);
        s
    })
}

#[test]
fn subset_solutions_are_those_of_a_new_solution_per_subset() {
    let mut random = Random(7);
    let mut araim = araim();
    let (mut modes, mut worst) = (0, 0.0_f64);
    for trial in 0..300 {
        let systems = random.integer(1, 3);
        let n = random.integer(4 + systems, 24);
        let satellites = satellites(&mut random, n, systems, 1e-4);
        let parameters = AraimParameters {
            p_threshold: 9e-8,
            phmi_vertical: 0.4,
            phmi_horizontal: 0.4,
            simultaneous_at_least: if trial % 2 == 0 { 2 } else { 3 },
            ..AraimParameters::LPV_200
        };
        let evaluated = araim.evaluate(&satellites, &constellations(systems, 1e-5), &parameters);
        if matches!(
            evaluated,
            Err(AraimError::ModesExceedCapacity | AraimError::SingularGeometry)
        ) {
            continue;
        }
        let levels = evaluated.unwrap_or_else(|error| panic!("{trial}: {error:?}"));
        assert!(levels.vpl_m > 0.0 && levels.hpl_m.is_finite());
        let all = solution(&satellites, &vec![true; n]).unwrap();
        for subset in araim.subsets() {
            let uses: Vec<bool> = (0..n).map(|i| !subset.excluded.contains(i)).collect();
            let s = solution(&satellites, &uses).unwrap();
            for axis in 0..3 {
                let sum = |term: &dyn Fn(usize) -> f64| (0..n).map(term).sum::<f64>();
                let (s, all) = (&s[axis], &all[axis]);
                let expected = [
                    sum(&|i| s[i] * s[i] * satellites[i].variance_integrity_m2).sqrt(),
                    sum(&|i| (s[i] - all[i]).powi(2) * satellites[i].variance_accuracy_m2).sqrt(),
                    sum(&|i| s[i].abs() * satellites[i].bias_integrity_m),
                    sum(&|i| (s[i] - all[i]).abs() * satellites[i].bias_accuracy_m),
                ];
                let got = [
                    subset.sigma_m[axis],
                    subset.sigma_separation_m[axis],
                    subset.bias_m[axis],
                    subset.bias_separation_m[axis],
                ];
                for (got, expected) in got.iter().zip(expected) {
                    // Both solutions lose digits as the geometry gets poor.
                    let scale = 1.0 + expected + subset.sigma_m.iter().sum::<f64>();
                    worst = worst.max((got - expected).abs() / scale);
                }
            }
            modes += 1;
        }
    }
    println!("{modes} modes, largest difference {worst:.1e}");
    assert!(modes > 10_000, "{modes}");
    assert!(worst < 1e-9, "{worst}");
}

#[test]
fn listed_and_unmonitored_probabilities_are_everything() {
    let mut random = Random(8);
    let mut araim = araim();
    for _ in 0..200 {
        let n = random.integer(9, 24);
        let satellites = satellites(&mut random, n, 2, 1e-5);
        let systems = constellations(2, 1e-5);
        let Ok(levels) = araim.evaluate(&satellites, &systems, &AraimParameters::LPV_200) else {
            continue;
        };
        let listed: f64 = araim.subsets().iter().map(|subset| subset.p_exposure).sum();
        assert!((listed + levels.p_not_monitored - 1.0).abs() < 1e-14);
        // What must be monitored is.
        for i in 0..n {
            let is_alone = |subset: &&surefix_core::raim::araim::subsets::SubsetSolution| {
                subset.excluded.len() == 1 && subset.excluded.contains(i)
            };
            assert!(
                araim
                    .subsets()
                    .iter()
                    .find(is_alone)
                    .is_some_and(|s| s.p_instant > 9e-6)
            );
        }
    }
}

/// Risk at a level, term by term.
fn risk(araim: &Araim, axis: usize, level: f64) -> f64 {
    let terms = araim.subsets().iter().enumerate().map(|(k, subset)| {
        let argument =
            (level - subset.threshold_m[axis] - subset.bias_m[axis]) / subset.sigma_m[axis];
        let tail = 0.5 * libm::erfc(argument / std::f64::consts::SQRT_2);
        match k {
            0 => 2.0 * tail,
            _ if argument < 0.0 => subset.p_instant,
            _ => subset.p_instant * tail,
        }
    });
    terms.sum()
}

#[test]
fn a_level_keeps_its_risk_and_none_a_micrometre_lower_does() {
    let mut random = Random(9);
    let mut araim = araim();
    let mut seen = 0;
    for _ in 0..300 {
        let n = random.integer(7, 24);
        let satellites = satellites(&mut random, n, 2, 1e-5);
        let mut parameters = AraimParameters::LPV_200;
        // Up to the plateaus of the faults, where Q̄ jumps.
        let scale = 10.0_f64.powf(4.5 * random.uniform());
        parameters.phmi_vertical *= scale;
        parameters.phmi_horizontal *= scale;
        let Ok(levels) = araim.evaluate(&satellites, &constellations(2, 1e-4), &parameters) else {
            continue;
        };
        seen += 1;
        let phmi = parameters.phmi_vertical + parameters.phmi_horizontal;
        let share = 1.0 - levels.p_not_monitored / phmi;
        for (axis, level, phmi) in [
            (0, levels.level_east_m, 0.5 * parameters.phmi_horizontal),
            (1, levels.level_north_m, 0.5 * parameters.phmi_horizontal),
            (2, levels.vpl_m, parameters.phmi_vertical),
        ] {
            let target = phmi * share;
            assert!(risk(&araim, axis, level) <= target * (1.0 + 1e-12));
            assert!(risk(&araim, axis, level - 2e-6) > target, "{axis} {level}");
        }
    }
    assert!(seen > 250, "{seen}");
}

#[test]
fn more_risk_or_smaller_errors_never_widen_a_level() {
    let mut random = Random(10);
    let mut araim = araim();
    for _ in 0..100 {
        let n = random.integer(9, 24);
        let satellites = satellites(&mut random, n, 2, 1e-5);
        let systems = constellations(2, 1e-6);
        let strict = AraimParameters::LPV_200;
        let lenient = AraimParameters {
            phmi_vertical: 2.0 * strict.phmi_vertical,
            phmi_horizontal: 2.0 * strict.phmi_horizontal,
            ..strict
        };
        let (Ok(a), Ok(b)) = (
            araim.evaluate(&satellites, &systems, &strict),
            araim.evaluate(&satellites, &systems, &lenient),
        ) else {
            continue;
        };
        assert!(b.vpl_m <= a.vpl_m && b.hpl_m <= a.hpl_m);
        let mut better = satellites.clone();
        for satellite in &mut better {
            satellite.variance_integrity_m2 *= 0.8;
            satellite.variance_accuracy_m2 *= 0.8;
            satellite.bias_integrity_m *= 0.8;
            satellite.bias_accuracy_m *= 0.8;
        }
        let c = araim.evaluate(&better, &systems, &strict).unwrap();
        assert!(c.vpl_m < a.vpl_m && c.hpl_m < a.hpl_m);
    }
}

#[test]
fn a_mode_that_leaves_no_position_is_charged() {
    let mut random = Random(11);
    let mut araim = araim();
    // Five satellites of one constellation: without any one of four of them, the others stand in a plane
    // cone with the clock.
    let mut satellites = satellites(&mut random, 5, 1, 1e-9);
    for (satellite, azimuth) in satellites.iter_mut().zip([0.1_f64, 1.6, 3.2, 4.8]) {
        satellite.design_enu = [-0.8 * azimuth.sin(), -0.8 * azimuth.cos(), -0.6];
    }
    satellites[4].design_enu = [0.0, 0.0, -1.0];
    satellites[4].p_fault = 2e-8;
    let none = constellations(1, 0.0);
    let levels = araim
        .evaluate(&satellites, &none, &AraimParameters::LPV_200)
        .unwrap();
    assert_eq!(
        levels.modes_monitored, levels.modes_enumerated,
        "{levels:?}"
    );
    // More likely than P_THRES it must be monitored, and cannot.
    satellites[4].p_fault = 9e-8 / (1.0 + satellites[4].exposure);
    let levels = araim
        .evaluate(&satellites, &none, &AraimParameters::LPV_200)
        .unwrap();
    assert_eq!(
        levels.modes_monitored + 1,
        levels.modes_enumerated,
        "{levels:?}"
    );
    assert!(levels.p_not_monitored > 9e-8);
    satellites[4].p_fault = 1e-5;
    assert!(matches!(
        araim.evaluate(&satellites, &none, &AraimParameters::LPV_200),
        Err(AraimError::NoIntegrityBudget { p_not_monitored }) if p_not_monitored > 9e-6
    ));
}

#[test]
fn poor_geometry_and_wrong_numbers_are_errors_of_their_own() {
    let mut random = Random(12);
    let mut araim = araim();
    let good = satellites(&mut random, 10, 2, 1e-5);
    let systems = constellations(2, 1e-5);
    let parameters = AraimParameters::LPV_200;
    let mut run = |satellites: &[AraimSatellite]| araim.evaluate(satellites, &systems, &parameters);
    assert_eq!(
        run(&[]),
        Err(AraimError::SatellitesOutOfRange { satellites: 0 })
    );
    let many: Vec<_> = good.iter().cycle().take(25).copied().collect();
    assert_eq!(
        run(&many),
        Err(AraimError::SatellitesOutOfRange { satellites: 25 })
    );
    assert!(matches!(
        run(&good[..4]),
        Err(AraimError::TooFewSatellites {
            satellites: 4,
            unknowns: 5
        })
    ));
    let one_place = vec![good[0]; 8];
    assert_eq!(run(&one_place), Err(AraimError::SingularGeometry));
    let spoil = |field: SatelliteField, value: f64| {
        let mut satellite = good[3];
        match field {
            SatelliteField::Design => satellite.design_enu[1] = value,
            SatelliteField::VarianceIntegrity => satellite.variance_integrity_m2 = value,
            SatelliteField::VarianceAccuracy => satellite.variance_accuracy_m2 = value,
            SatelliteField::BiasIntegrity => satellite.bias_integrity_m = value,
            SatelliteField::BiasAccuracy => satellite.bias_accuracy_m = value,
            SatelliteField::PFault => satellite.p_fault = value,
            SatelliteField::Exposure => satellite.exposure = value,
            SatelliteField::Constellation | SatelliteField::Residual => unreachable!(),
        }
        satellite
    };
    for (wanted, values) in [
        (SatelliteField::Design, &[f64::NAN, 3.0, f64::INFINITY][..]),
        (
            SatelliteField::VarianceIntegrity,
            &[0.0, -1.0, f64::NAN, f64::INFINITY],
        ),
        (SatelliteField::VarianceAccuracy, &[0.0, -1.0, f64::NAN]),
        (SatelliteField::BiasIntegrity, &[-1.0, f64::NAN]),
        (SatelliteField::BiasAccuracy, &[-1.0, f64::NAN]),
        (SatelliteField::PFault, &[-1e-9, 1.0, f64::NAN]),
        (SatelliteField::Exposure, &[-1.0, f64::NAN, f64::INFINITY]),
    ] {
        for value in values {
            let mut bad = good.clone();
            bad[3] = spoil(wanted, *value);
            let error = run(&bad).unwrap_err();
            assert!(
                matches!(error, AraimError::Satellite { index: 3, field, .. } if field == wanted),
                "{wanted:?} {value}: {error:?}"
            );
        }
    }
    assert!(run(&good).is_ok() || matches!(run(&good), Err(AraimError::NoIntegrityBudget { .. })));
    assert!(matches!(
        araim.evaluate(
            &good,
            &systems,
            &AraimParameters {
                p_emt: f64::NAN,
                ..parameters
            }
        ),
        Err(AraimError::Parameter { .. })
    ));
    // Nothing evaluated: nothing to test.
    assert_eq!(
        araim.test(&[0.0; 10], |_, _| {}).unwrap_err(),
        AraimError::SingularGeometry
    );
}

/// Noise of the satellites' accuracy, biases within the nominal ones.
fn noise(random: &mut Random, satellites: &[AraimSatellite]) -> Vec<f64> {
    satellites
        .iter()
        .map(|s| {
            s.variance_accuracy_m2.sqrt() * random.normal()
                + s.bias_accuracy_m * (2.0 * random.uniform() - 1.0)
        })
        .collect()
}

#[test]
fn the_satellites_excluded_are_the_faulty_ones() {
    let mut random = Random(13);
    let (mut first, mut scratch) = (araim(), araim());
    let (mut excluded, mut wrong, mut kept) = (0, 0, 0);
    for _ in 0..300 {
        let n = random.integer(12, 20);
        let satellites = satellites(&mut random, n, 2, 1e-5);
        let parameters = AraimParameters::LPV_200;
        let systems = constellations(2, 1e-4);
        if first
            .evaluate_with_exclusion(&satellites, &systems, &parameters)
            .is_err()
        {
            continue;
        }
        let mut y = noise(&mut random, &satellites);
        assert_eq!(
            first.exclude(&satellites, &parameters, &y, &mut scratch),
            Err(NotExcluded::NoFault)
        );
        // One satellite, or every satellite of a constellation in its own way.
        let is_wide = random.uniform() < 0.3;
        let victim = random.integer(0, n - 1);
        let is_faulty = |i: usize| match is_wide {
            true => satellites[i].constellation == satellites[victim].constellation,
            false => i == victim,
        };
        for (i, y) in y.iter_mut().enumerate() {
            if is_faulty(i) {
                *y += if is_wide {
                    60.0 * random.normal()
                } else {
                    60.0
                };
            }
        }
        match first.exclude(&satellites, &parameters, &y, &mut scratch) {
            Ok(exclusion) => {
                excluded += 1;
                let misses = (0..n).any(|i| is_faulty(i) && !exclusion.excluded.contains(i));
                wrong += usize::from(misses);
                let [east, north, up] = exclusion.remaining.position_enu_m;
                assert!(up.abs() < exclusion.levels.vpl_m);
                assert!(east.hypot(north) < exclusion.levels.hpl_m);
            }
            Err(_) => kept += 1,
        }
    }
    println!("{excluded} excluded, {wrong} of them wrong, {kept} not");
    assert!(excluded > 150, "{excluded}");
    assert!(wrong * 100 <= excluded, "{wrong} of {excluded}");
}

/// With risks large enough to be seen. Faults are drawn from their priors, many of them just about detected
/// in one direction, the worst size. 80,000 epochs; the limit is the allowed count plus four of its spreads.
#[test]
fn errors_above_a_level_without_an_alert_are_rarer_than_the_risk() {
    let mut random = Random(14);
    let (mut first, mut scratch) = (araim(), araim());
    let parameters = AraimParameters {
        phmi_vertical: 5e-3,
        phmi_horizontal: 5e-3,
        p_false_alert_vertical: 1e-2,
        p_false_alert_horizontal: 1e-2,
        p_threshold: 3e-3,
        ..AraimParameters::LPV_200
    };
    for with_exclusion in [false, true] {
        let (mut epochs, mut exclusions, mut hazards) = (0, 0, 0);
        for _ in 0..100 {
            let n = random.integer(8, 12);
            let mut satellites = satellites(&mut random, n, 2, 0.01);
            for satellite in &mut satellites {
                // Noise as large as it is counted for and no biases, so that nothing hides in a margin.
                satellite.variance_accuracy_m2 = satellite.variance_integrity_m2;
                satellite.bias_integrity_m = 0.0;
                satellite.bias_accuracy_m = 0.0;
                satellite.exposure = 0.0;
            }
            let systems = constellations(2, 1e-4);
            let evaluated = if with_exclusion {
                first.evaluate_with_exclusion(&satellites, &systems, &parameters)
            } else {
                first.evaluate(&satellites, &systems, &parameters)
            };
            let Ok(levels) = evaluated else { continue };
            let critical = critical_sizes(&mut first, n);
            for _ in 0..400 {
                let mut y = noise(&mut random, &satellites);
                for (i, y) in y.iter_mut().enumerate() {
                    if random.uniform() < satellites[i].p_fault {
                        let size = critical[i][random.integer(0, 2)];
                        *y += size * (0.6 + 0.8 * random.uniform());
                    }
                }
                epochs += 1;
                let detection = first.test(&y, |_, _| {}).unwrap();
                let usable = if !detection.is_detected() {
                    Some((detection.position_enu_m, levels))
                } else if with_exclusion {
                    let excluded = first.exclude(&satellites, &parameters, &y, &mut scratch);
                    excluded.ok().map(|exclusion| {
                        exclusions += 1;
                        (exclusion.remaining.position_enu_m, exclusion.levels)
                    })
                } else {
                    None
                };
                if let Some(([east, north, up], levels)) = usable {
                    let is_above = up.abs() > levels.vpl_m
                        || east.abs() > levels.level_east_m
                        || north.abs() > levels.level_north_m;
                    hazards += usize::from(is_above);
                }
            }
        }
        let allowed = 1e-2 * f64::from(epochs);
        println!("{epochs} epochs, {exclusions} exclusions, {hazards} hazards, {allowed} allowed");
        assert!(epochs > 20_000);
        assert!(hazards as f64 <= allowed + 4.0 * allowed.sqrt());
    }
}

/// For each satellite the fault that moves its own separation to the threshold, east, north and up.
fn critical_sizes(araim: &mut Araim, n: usize) -> Vec<[f64; 3]> {
    (0..n)
        .map(|i| {
            let mut unit = vec![0.0; n];
            unit[i] = 1.0;
            let mut moved = Vec::new();
            araim.test(&unit, |_, enu| moved.push(*enu)).unwrap();
            let own = araim
                .subsets()
                .iter()
                .position(|s| s.excluded.len() == 1 && s.excluded.contains(i))
                .unwrap();
            let threshold = araim.subsets()[own].threshold_m;
            std::array::from_fn(|axis| (threshold[axis] / moved[own][axis].abs()).min(1e3))
        })
        .collect()
}

/// A case that runs, in the form of the golden file.
fn case(id: &str, n: usize) -> Value {
    let mut random = Random(15);
    let sky = sky(&mut random, n.max(2), 2);
    let rows: Vec<Vec<f64>> = (0..n).map(|i| sky.design[i][..5].to_vec()).collect();
    let system = |(i, row): (usize, &Vec<f64>)| json!({"sys": if row[3] == 1.0 { "GPS" } else { "GAL" }, "prn": i + 1});
    json!({
        "id": id,
        "systems": ["GPS", "GAL"],
        "sats": rows.iter().enumerate().map(system).collect::<Vec<_>>(),
        "G": rows,
        "var_int": vec![1.5; n], "var_acc": vec![1.0; n],
        "bnom_int": vec![0.75; n], "bnom_acc": vec![0.0; n],
        "p_sat": vec![1e-5; n], "p_const": [1e-8, 1e-4],
        "tau_sat": vec![0.0; n], "tau_const": [0.0, 0.0],
        "params": {"t_exp": 0.0, "n_es_int": 1, "n_es_cont": 1, "phmi_vert": 9.8e-8,
            "phmi_hor": 2e-9, "p_thres": 8e-8, "pfa_vert": 3.9e-6, "pfa_hor": 9e-8,
            "p_emt": 1e-5, "fc_thres": 0.01, "max_pmd": 0},
    })
}

/// Runs the command; its exit code, its message, its output.
fn command(name: &str, text: &str) -> (Option<i32>, String, Option<Value>) {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let (input, out) = (folder.join("cases.json"), folder.join("out.json"));
    std::fs::write(&input, text).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_surefix"))
        .arg("araim")
        .arg(&input)
        .arg("--out")
        .arg(&out)
        .output()
        .unwrap();
    let written = std::fs::read_to_string(&out).ok();
    (
        output.status.code(),
        String::from_utf8(output.stderr).unwrap(),
        written.map(|text| serde_json::from_str(&text).unwrap()),
    )
}

#[test]
fn bad_cases_are_named_with_their_field_and_the_others_run() {
    let mut cases = vec![case("first", 16)];
    let mut wanted = Vec::new();
    let fields: Vec<String> = cases[0].as_object().unwrap().keys().cloned().collect();
    for field in &fields {
        let mut bad = case(&format!("without {field}"), 16);
        bad.as_object_mut().unwrap().remove(field);
        cases.push(bad);
        wanted.push((cases.len() - 1, format!("field {field} is missing")));
    }
    let parameters: Vec<String> = cases[0]["params"]
        .as_object()
        .unwrap()
        .keys()
        .cloned()
        .collect();
    for field in &parameters {
        let mut bad = case(&format!("without params.{field}"), 16);
        bad["params"].as_object_mut().unwrap().remove(field);
        cases.push(bad);
        wanted.push((cases.len() - 1, format!("params.{field}")));
        let mut bad = case(&format!("negative params.{field}"), 16);
        bad["params"][field] = json!(-1.0);
        cases.push(bad);
        wanted.push((cases.len() - 1, format!("params.{field}")));
    }
    for field in [
        "var_int", "var_acc", "bnom_int", "bnom_acc", "p_sat", "tau_sat",
    ] {
        for value in [
            json!(-1.0),
            json!(null),
            json!("1"),
            json!("@NaN"),
            json!("@1e999"),
        ] {
            let mut bad = case(&format!("{field} {value}"), 16);
            bad[field][7] = value;
            cases.push(bad);
            wanted.push((cases.len() - 1, format!("{field}[7]")));
        }
        let mut bad = case(&format!("short {field}"), 16);
        bad[field].as_array_mut().unwrap().pop();
        cases.push(bad);
        wanted.push((cases.len() - 1, field.to_owned()));
    }
    for field in ["var_int", "var_acc"] {
        let mut bad = case(&format!("zero {field}"), 16);
        bad[field][0] = json!(0.0);
        cases.push(bad);
        wanted.push((cases.len() - 1, format!("{field}[0]")));
    }
    for n in 0..=40 {
        cases.push(case(&format!("{n} satellites"), n));
        if !(5..=24).contains(&n) {
            wanted.push((cases.len() - 1, "sats".to_owned()));
        }
    }
    let mut singular = case("one place", 16);
    let direction = singular["G"][0].clone();
    for row in singular["G"].as_array_mut().unwrap() {
        row.as_array_mut().unwrap()[..3].clone_from_slice(&direction.as_array().unwrap()[..3]);
    }
    cases.push(singular);
    wanted.push((cases.len() - 1, "field G".to_owned()));
    let mut wrong_clock = case("wrong clock", 16);
    wrong_clock["G"][2][3] = json!(0.5);
    cases.push(wrong_clock);
    wanted.push((cases.len() - 1, "G[2][3]".to_owned()));
    let mut unknown = case("unknown system", 16);
    unknown["sats"][1]["sys"] = json!("XYZ");
    cases.push(unknown);
    wanted.push((cases.len() - 1, "sats[1].sys".to_owned()));
    let mut twice = case("a satellite twice", 16);
    twice["sats"][9] = twice["sats"][4].clone();
    cases.push(twice);
    wanted.push((cases.len() - 1, "sats[9].prn".to_owned()));
    cases.push(case("first", 12));
    wanted.push((cases.len() - 1, "field id is \"first\"".to_owned()));
    for value in [json!(null), json!(3), json!([]), json!("text"), json!({})] {
        cases.push(value);
        wanted.push((cases.len() - 1, format!("#{}", cases.len() - 1)));
    }
    let mut measured = case("short y", 16);
    measured["measurement_tests"] = json!([{"kind": "nominal", "y": [1.0]}]);
    cases.push(measured);
    let measured = cases.len() - 1;
    cases.push(case("last", 16));

    let text = json!({ "cases": cases }).to_string();
    let text = text
        .replace("\"@NaN\"", "NaN")
        .replace("\"@1e999\"", "1e999");
    let (code, message, output) = command("araim-bad", &text);
    assert_eq!(code, Some(1), "{message}");
    let output = output.unwrap();
    let outcomes = output["cases"].as_array().unwrap();
    assert_eq!(outcomes.len(), cases.len());
    for (index, words) in &wanted {
        let error = outcomes[*index]["error"].as_str().unwrap_or_default();
        assert!(
            error.contains(words.as_str()),
            "{}: {error}",
            outcomes[*index]["id"]
        );
        let id = cases[*index]
            .get("id")
            .and_then(Value::as_str)
            .filter(|id| *index == 0 || *id != "first")
            .unwrap_or("#");
        assert!(error.starts_with(&format!("case {id}")), "{error}");
        assert!(message.contains(error));
        assert_eq!(outcomes[*index].get("result"), None);
    }
    // Whatever a number of satellites does, it is a result or an error.
    for outcome in outcomes {
        assert!(outcome.get("result").is_some() != outcome.get("error").is_some());
    }
    assert_eq!(
        outcomes[0]["result"],
        outcomes[outcomes.len() - 1]["result"]
    );
    assert!(outcomes[0]["result"]["vpl"].as_f64().unwrap() > 1.0);
    let test = &outcomes[measured]["measurement_tests"][0];
    assert!(
        test["error"]
            .as_str()
            .unwrap()
            .contains("measurement_tests[0].y"),
        "{test}"
    );
    assert!(outcomes[measured]["result"]["vpl"].is_number());
}

#[test]
fn good_cases_end_with_code_0_and_no_cases_with_code_2() {
    let text = json!({"cases": [case("good", 16)]}).to_string();
    let (code, message, output) = command("araim-good", &text);
    assert_eq!(code, Some(0), "{message}");
    assert_eq!(output.unwrap()["cases"][0]["id"], "good");
    for (name, text) in [
        ("no-json", "{"),
        ("no-cases", "{\"case\": []}"),
        ("list", "[]"),
    ] {
        let (code, message, output) = command(&format!("araim-{name}"), text);
        assert_eq!(code, Some(2), "{name}");
        assert!(message.contains("{\"cases\": [...]}"), "{message}");
        assert!(output.is_none());
    }
    // No text at all, and a file that is not there.
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("araim-unreadable");
    std::fs::create_dir_all(&folder).unwrap();
    let binary = folder.join("binary.json");
    std::fs::write(&binary, [0xff, 0xfe, 0x00]).unwrap();
    for path in [binary, folder.join("absent.json"), folder.clone()] {
        let output = Command::new(env!("CARGO_BIN_EXE_surefix"))
            .arg("araim")
            .arg(&path)
            .arg("--out")
            .arg(folder.join("out.json"))
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(2));
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(message.contains(&path.display().to_string()), "{message}");
        assert!(message.contains("give a file of ARAIM cases"), "{message}");
    }
}
