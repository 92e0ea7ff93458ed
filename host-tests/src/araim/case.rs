//! Reading an ARAIM case, and saying what is wrong with one.

use serde_json::{Map, Value};
use surefix_core::raim::araim::{
    AraimConstellation, AraimError, AraimParameters, AraimSatellite, MAX_ARAIM_SATELLITES,
    MAX_CONSTELLATIONS, MAX_MODES, ParameterField, SatelliteField,
};

/// Why a case has no result.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum CaseError {
    #[error("case {case}: not an object")]
    NotAnObject { case: String },
    #[error("case {case}: field {field} is missing")]
    Missing { case: String, field: String },
    #[error("case {case}: field {field} is {found}, not {expected}")]
    Illegal {
        case: String,
        field: String,
        found: String,
        expected: String,
    },
    #[error("case {case}: field {field}: {cause}")]
    Refused {
        case: String,
        field: String,
        cause: String,
    },
}

/// JSON knows no NaN and no infinity, but programs write them. As strings they cost only their case.
pub(super) fn quote_what_is_no_number(text: &str) -> String {
    let mut result = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let length = if first == '"' {
            string_length(rest)
        } else if first.is_ascii_alphanumeric() || first == '-' {
            rest.find(|c: char| !(c.is_ascii_alphanumeric() || "+-.".contains(c)))
                .unwrap_or(rest.len())
        } else {
            first.len_utf8()
        };
        let (token, after) = rest.split_at(length);
        rest = after;
        let is_no_number = first != '"' && token.parse::<f64>().is_ok_and(|x| !x.is_finite());
        if is_no_number {
            result.push('"');
            result.push_str(token);
            result.push('"');
        } else {
            result.push_str(token);
        }
    }
    result
}

/// Length of the JSON string a text starts with, quotes included.
fn string_length(text: &str) -> usize {
    let mut is_escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            _ if is_escaped => is_escaped = false,
            '\\' => is_escaped = true,
            '"' => return at + 1,
            _ => {}
        }
    }
    text.len()
}

/// The fields of a case, and its name for errors.
pub(super) struct Fields<'a> {
    pub case: String,
    pub json: &'a Map<String, Value>,
}

impl Fields<'_> {
    fn missing(&self, field: &str) -> CaseError {
        CaseError::Missing {
            case: self.case.clone(),
            field: field.to_owned(),
        }
    }

    pub fn illegal(&self, field: &str, found: &Value, expected: &str) -> CaseError {
        let mut found = found.to_string();
        if let Some((cut, _)) = found.char_indices().nth(40) {
            found.truncate(cut);
            found.push('…');
        }
        CaseError::Illegal {
            case: self.case.clone(),
            field: field.to_owned(),
            found,
            expected: expected.to_owned(),
        }
    }

    fn get(&self, field: &str) -> Result<&Value, CaseError> {
        self.json.get(field).ok_or_else(|| self.missing(field))
    }

    fn list(&self, field: &str, value: &Value, n: Option<usize>) -> Result<Vec<Value>, CaseError> {
        let list = value
            .as_array()
            .ok_or_else(|| self.illegal(field, value, "a list"))?;
        match n {
            Some(n) if list.len() != n => Err(CaseError::Illegal {
                case: self.case.clone(),
                field: field.to_owned(),
                found: format!("a list of {}", list.len()),
                expected: format!("of {n}"),
            }),
            _ => Ok(list.clone()),
        }
    }

    fn number(&self, field: &str, value: &Value) -> Result<f64, CaseError> {
        value
            .as_f64()
            .filter(|number| number.is_finite())
            .ok_or_else(|| self.illegal(field, value, "a finite number"))
    }

    pub fn number_list(
        &self,
        field: &str,
        value: &Value,
        n: Option<usize>,
    ) -> Result<Vec<f64>, CaseError> {
        self.list(field, value, n)?
            .iter()
            .enumerate()
            .map(|(index, value)| self.number(&format!("{field}[{index}]"), value))
            .collect()
    }

    fn numbers(&self, field: &str, n: usize) -> Result<Vec<f64>, CaseError> {
        self.number_list(field, self.get(field)?, Some(n))
    }

    fn parameter(&self, name: &str) -> Result<f64, CaseError> {
        let field = format!("params.{name}");
        let value = self
            .get("params")?
            .get(name)
            .ok_or_else(|| self.missing(&field))?;
        self.number(&field, value)
    }

    /// Names of the constellations.
    fn systems(&self) -> Result<Vec<String>, CaseError> {
        let mut names: Vec<String> = Vec::new();
        let systems = self.list("systems", self.get("systems")?, None)?;
        for (index, value) in systems.iter().enumerate() {
            let field = format!("systems[{index}]");
            let name = value
                .as_str()
                .ok_or_else(|| self.illegal(&field, value, "a name"))?;
            if names.iter().any(|known| known == name) {
                return Err(self.illegal(&field, value, "a name of its own"));
            }
            names.push(name.to_owned());
        }
        Ok(names)
    }

    /// A satellite given twice would count as two that agree.
    fn no_satellite_twice(&self, satellites: &[Value]) -> Result<(), CaseError> {
        let mut seen = Vec::new();
        for (index, satellite) in satellites.iter().enumerate() {
            let Some(prn) = satellite.get("prn") else {
                continue;
            };
            let field = format!("sats[{index}].prn");
            let number = prn
                .as_u64()
                .ok_or_else(|| self.illegal(&field, prn, "a whole number"))?;
            let name = (satellite.get("sys").and_then(Value::as_str), number);
            if seen.contains(&name) {
                return Err(self.illegal(&field, prn, "that of no other satellite of its system"));
            }
            seen.push(name);
        }
        Ok(())
    }

    /// The constellation of each satellite.
    fn constellations(&self, systems: &[String]) -> Result<Vec<usize>, CaseError> {
        let satellites = self.list("sats", self.get("sats")?, None)?;
        self.no_satellite_twice(&satellites)?;
        satellites
            .iter()
            .enumerate()
            .map(|(index, satellite)| {
                let field = format!("sats[{index}].sys");
                let value = satellite.get("sys").ok_or_else(|| self.missing(&field))?;
                systems
                    .iter()
                    .position(|name| value.as_str() == Some(name))
                    .ok_or_else(|| self.illegal(&field, value, "one of systems"))
            })
            .collect()
    }

    /// Directions of the design; its clock columns must say what `sats` says.
    fn design(&self, members: &[usize], systems: usize) -> Result<Vec<[f64; 3]>, CaseError> {
        let rows = self.list("G", self.get("G")?, Some(members.len()))?;
        let mut design = Vec::with_capacity(rows.len());
        for (index, (row, member)) in rows.iter().zip(members).enumerate() {
            let field = format!("G[{index}]");
            let numbers = self.number_list(&field, row, Some(3 + systems))?;
            let (direction, clocks) = numbers.split_at(3);
            for (system, clock) in clocks.iter().enumerate() {
                let expected = if system == *member { 1.0 } else { 0.0 };
                if *clock != expected {
                    return Err(CaseError::Illegal {
                        case: self.case.clone(),
                        field: format!("{field}[{}]", 3 + system),
                        found: clock.to_string(),
                        expected: format!("{expected}, the clock column of its constellation"),
                    });
                }
            }
            design.extend(<[f64; 3]>::try_from(direction));
        }
        Ok(design)
    }
}

/// A case as the algorithm takes it.
pub(super) struct Case<'a> {
    pub fields: Fields<'a>,
    pub satellites: Vec<AraimSatellite>,
    pub constellations: Vec<AraimConstellation>,
    pub parameters: AraimParameters,
}

impl<'a> Case<'a> {
    pub fn read(id: &str, case: &'a Value) -> Result<Self, CaseError> {
        let fields = Fields {
            case: id.to_owned(),
            json: case.as_object().ok_or_else(|| CaseError::NotAnObject {
                case: id.to_owned(),
            })?,
        };
        if !fields.get("id")?.is_string() {
            return Err(fields.illegal("id", fields.get("id")?, "a text"));
        }
        let systems = fields.systems()?;
        let members = fields.constellations(&systems)?;
        let n = members.len();
        let design = fields.design(&members, systems.len())?;
        let variance_integrity = fields.numbers("var_int", n)?;
        let variance_accuracy = fields.numbers("var_acc", n)?;
        let bias_integrity = fields.numbers("bnom_int", n)?;
        let bias_accuracy = fields.numbers("bnom_acc", n)?;
        let p_sat = fields.numbers("p_sat", n)?;
        let tau_sat = fields.numbers("tau_sat", n)?;
        let p_const = fields.numbers("p_const", systems.len())?;
        let tau_const = fields.numbers("tau_const", systems.len())?;
        let parameters = AraimParameters {
            phmi_vertical: fields.parameter("phmi_vert")?,
            phmi_horizontal: fields.parameter("phmi_hor")?,
            p_false_alert_vertical: fields.parameter("pfa_vert")?,
            p_false_alert_horizontal: fields.parameter("pfa_hor")?,
            p_threshold: fields.parameter("p_thres")?,
            p_emt: fields.parameter("p_emt")?,
            consolidation_share: fields.parameter("fc_thres")?,
            simultaneous_at_least: 2,
            samples_integrity: fields.parameter("n_es_int")?,
            samples_continuity: fields.parameter("n_es_cont")?,
        };
        // The ratios tau_sat and tau_const hold what it says; it is checked to be no nonsense.
        let t_exp = fields.parameter("t_exp")?;
        if t_exp < 0.0 {
            return Err(fields.illegal("params.t_exp", &t_exp.into(), "a duration"));
        }
        let max_pmd = fields.parameter("max_pmd")?;
        if max_pmd != 0.0 {
            let expected = "0: a cap on missed detection is not offered";
            return Err(fields.illegal("params.max_pmd", &max_pmd.into(), expected));
        }
        let mut satellites = Vec::with_capacity(n);
        for (index, (constellation, design_enu)) in members.iter().zip(design).enumerate() {
            satellites.push(AraimSatellite {
                design_enu,
                constellation: *constellation,
                variance_integrity_m2: variance_integrity[index],
                variance_accuracy_m2: variance_accuracy[index],
                bias_integrity_m: bias_integrity[index],
                bias_accuracy_m: bias_accuracy[index],
                p_fault: p_sat[index],
                exposure: tau_sat[index],
            });
        }
        let constellations = p_const
            .iter()
            .zip(&tau_const)
            .map(|(p_fault, exposure)| AraimConstellation {
                p_fault: *p_fault,
                exposure: *exposure,
            })
            .collect();
        Ok(Self {
            fields,
            satellites,
            constellations,
            parameters,
        })
    }

    /// An error of the algorithm in the names of the file.
    pub fn refused(&self, error: AraimError) -> CaseError {
        let field = match error {
            AraimError::Satellite { index, field, .. } => {
                let name = match field {
                    SatelliteField::Design => "G",
                    SatelliteField::Constellation => "sats",
                    SatelliteField::VarianceIntegrity => "var_int",
                    SatelliteField::VarianceAccuracy => "var_acc",
                    SatelliteField::BiasIntegrity => "bnom_int",
                    SatelliteField::BiasAccuracy => "bnom_acc",
                    SatelliteField::PFault => "p_sat",
                    SatelliteField::Exposure => "tau_sat",
                    SatelliteField::Residual => "y",
                };
                format!("{name}[{index}]")
            }
            AraimError::Constellation { index, .. } => {
                format!("p_const[{index}], tau_const[{index}]")
            }
            AraimError::Parameter { field, .. } => {
                let name = match field {
                    ParameterField::PhmiVertical => "phmi_vert",
                    ParameterField::PhmiHorizontal => "phmi_hor",
                    ParameterField::PFalseAlertVertical => "pfa_vert",
                    ParameterField::PFalseAlertHorizontal => "pfa_hor",
                    ParameterField::PThreshold => "p_thres",
                    ParameterField::PEmt => "p_emt",
                    ParameterField::ConsolidationShare => "fc_thres",
                    ParameterField::SimultaneousAtLeast => "simultaneous_at_least",
                    ParameterField::SamplesIntegrity => "n_es_int",
                    ParameterField::SamplesContinuity => "n_es_cont",
                };
                format!("params.{name}")
            }
            AraimError::SatellitesOutOfRange { .. } | AraimError::TooFewSatellites { .. } => {
                "sats".to_owned()
            }
            AraimError::ConstellationsOutOfRange { .. } => "systems".to_owned(),
            AraimError::SingularGeometry => "G".to_owned(),
            AraimError::ModesExceedCapacity
            | AraimError::FaultsTooLikely { .. }
            | AraimError::NoIntegrityBudget { .. } => "p_sat, p_const".to_owned(),
            AraimError::ResidualsMismatch { .. } => "y".to_owned(),
            AraimError::NoLevel { .. } | AraimError::Stats(_) => "params".to_owned(),
        };
        CaseError::Refused {
            case: self.fields.case.clone(),
            field,
            cause: explain(&error),
        }
    }
}

/// What is wrong, in words.
pub(super) fn explain(error: &AraimError) -> String {
    match error {
        AraimError::SatellitesOutOfRange { satellites } => {
            format!("{satellites} satellites; 1 to {MAX_ARAIM_SATELLITES} can be taken")
        }
        AraimError::ConstellationsOutOfRange { constellations } => {
            format!("{constellations} constellations; 1 to {MAX_CONSTELLATIONS} can be taken")
        }
        AraimError::Satellite { field, value, .. } => match field {
            SatelliteField::Design => format!("direction of length {value}, not 1"),
            SatelliteField::VarianceIntegrity | SatelliteField::VarianceAccuracy => {
                format!("variance {value} is not positive, or beyond 1e12 m²")
            }
            SatelliteField::PFault => {
                format!("{value} is no probability below 1, or not over the exposure")
            }
            SatelliteField::Exposure => format!("{value} is no ratio of times"),
            _ => format!("{value} is out of range"),
        },
        AraimError::Constellation { value, .. } => {
            format!("{value} is no probability below 1, or not over the exposure")
        }
        AraimError::Parameter { value, .. } => format!("{value} is out of range"),
        AraimError::ResidualsMismatch {
            residuals,
            satellites,
        } => format!("{residuals} measurements of {satellites} satellites"),
        AraimError::TooFewSatellites {
            satellites,
            unknowns,
        } => format!("{satellites} satellites for {unknowns} unknowns"),
        AraimError::SingularGeometry => "the satellites do not determine the position".to_owned(),
        AraimError::ModesExceedCapacity => {
            format!("so likely that more than {MAX_MODES} fault modes had to be monitored")
        }
        AraimError::FaultsTooLikely { p_not_monitored } => format!(
            "so likely that {p_not_monitored:e} stays unmonitored with three faults at a time"
        ),
        AraimError::NoIntegrityBudget { p_not_monitored } => format!(
            "unmonitored faults of probability {p_not_monitored:e} use the integrity risk up"
        ),
        AraimError::NoLevel { axis } => format!("no {axis:?} level was found"),
        AraimError::Stats(error) => format!("a quantile cannot be computed: {error:?}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nan_and_infinity_cost_only_their_place() {
        let text = r#"{"a": [NaN, -Infinity, 1e999, 1.5e-3, true], "NaN": "x \" NaN"}"#;
        let value: Value = serde_json::from_str(&quote_what_is_no_number(text)).unwrap();
        assert_eq!(value["a"][0], "NaN");
        assert_eq!(value["a"][1], "-Infinity");
        assert_eq!(value["a"][2], "1e999");
        assert_eq!(value["a"][3], 1.5e-3);
        assert_eq!(value["a"][4], true);
        assert_eq!(value["NaN"], "x \" NaN");
    }
}
