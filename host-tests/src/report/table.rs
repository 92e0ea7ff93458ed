//! Reading what `surefix replay` wrote: `epochs.csv` and, when truth was given, `errors.csv`.

use std::collections::HashMap;
use std::path::Path;

use anyhow::{Context, Result, anyhow, bail};

/// One receiver epoch as a row of `epochs.csv` has it; `None` where the row has no value.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Seconds from the first epoch.
    pub t_s: f64,
    /// GPS week.
    pub week: Option<f64>,
    /// GPS time of week, s.
    pub tow_s: Option<f64>,
    /// A position was computed.
    pub has_position: bool,
    /// Satellites used.
    pub n_sats: Option<f64>,
    /// Satellites received, where the file says so.
    pub n_visible: Option<f64>,
    /// nominal, excluded, alert or unavailable.
    pub integrity: String,
    /// Why.
    pub reason: String,
    /// Horizontal protection level, m.
    pub hpl_m: Option<f64>,
    /// Vertical protection level, m.
    pub vpl_m: Option<f64>,
    /// Horizontal alert limit, m.
    pub hal_m: Option<f64>,
    /// Vertical alert limit, m.
    pub val_m: Option<f64>,
    /// Satellites excluded as faulty.
    pub excluded: Vec<String>,
    /// Satellites used, where the file says so.
    pub used: Vec<String>,
    /// Test statistic.
    pub stat: Option<f64>,
    /// Its threshold.
    pub threshold: Option<f64>,
    /// Position error east, north, up, m.
    pub error_enu_m: Option<[f64; 3]>,
}

/// Everything the report shows, by epoch.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Rows in the order of time.
    pub rows: Vec<Row>,
    /// `errors.csv` was there.
    pub has_errors: bool,
    /// `epochs.csv` names the satellites used.
    pub has_used: bool,
}

/// A CSV file without quoting, as surefix writes it.
struct Csv<'a> {
    columns: HashMap<&'a str, usize>,
    lines: Vec<(usize, Vec<&'a str>)>,
}

impl<'a> Csv<'a> {
    fn parse(text: &'a str) -> Result<Self> {
        let mut lines = text.lines();
        let header = lines.next().ok_or_else(|| anyhow!("the file is empty"))?;
        let columns: HashMap<_, _> = header
            .split(',')
            .enumerate()
            .map(|(k, name)| (name.trim(), k))
            .collect();
        let lines: Vec<_> = lines
            .enumerate()
            .filter(|(_, line)| !line.trim().is_empty())
            .map(|(k, line)| (k + 2, line.split(',').map(str::trim).collect::<Vec<_>>()))
            .collect();
        if let Some((number, fields)) = lines.iter().find(|(_, f)| f.len() != columns.len()) {
            bail!(
                "line {number} has {} fields, the header {}",
                fields.len(),
                columns.len()
            );
        }
        Ok(Self { columns, lines })
    }

    fn require(&self, names: &[&str]) -> Result<()> {
        match names.iter().find(|name| !self.columns.contains_key(*name)) {
            Some(name) => bail!("there is no column `{name}`"),
            None => Ok(()),
        }
    }

    fn text(&self, fields: &[&'a str], name: &str) -> &'a str {
        self.columns.get(name).map_or("", |k| fields[*k])
    }

    fn number(&self, line: usize, fields: &[&'a str], name: &str) -> Result<Option<f64>> {
        let text = self.text(fields, name);
        if text.is_empty() {
            return Ok(None);
        }
        let value: f64 = text
            .parse()
            .map_err(|_| anyhow!("line {line}, column {name}: `{text}` is no number"))?;
        Ok(value.is_finite().then_some(value))
    }
}

/// Satellites joined by `+`, or `-` for none.
fn satellites(text: &str) -> Vec<String> {
    text.split('+')
        .filter(|name| !name.is_empty() && *name != "-")
        .map(str::to_owned)
        .collect()
}

/// Time in whole microseconds, to find the row of another file that is of the same epoch.
fn time_key(t_s: f64) -> i64 {
    (t_s * 1e6).round() as i64
}

fn parse_epochs(text: &str) -> Result<(Vec<Row>, bool)> {
    let csv = Csv::parse(text)?;
    csv.require(&["t_s", "integrity", "reason", "hpl_m", "vpl_m", "excluded"])?;
    let mut rows = Vec::with_capacity(csv.lines.len());
    for (line, fields) in &csv.lines {
        let number = |name: &str| csv.number(*line, fields, name);
        rows.push(Row {
            t_s: number("t_s")?.ok_or_else(|| anyhow!("line {line}: no t_s"))?,
            week: number("week")?,
            tow_s: number("tow_s")?,
            has_position: number("x_m")?.is_some(),
            n_sats: number("n_sats")?,
            n_visible: number("n_visible")?,
            integrity: csv.text(fields, "integrity").to_owned(),
            reason: csv.text(fields, "reason").to_owned(),
            hpl_m: number("hpl_m")?,
            vpl_m: number("vpl_m")?,
            hal_m: number("hal_m")?,
            val_m: number("val_m")?,
            excluded: satellites(csv.text(fields, "excluded")),
            used: satellites(csv.text(fields, "used")),
            stat: number("stat")?,
            threshold: number("threshold")?,
            error_enu_m: None,
        });
    }
    if rows.windows(2).any(|pair| pair[1].t_s <= pair[0].t_s) {
        bail!("t_s does not grow from row to row");
    }
    Ok((rows, csv.columns.contains_key("used")))
}

fn add_errors(rows: &mut [Row], text: &str) -> Result<()> {
    let csv = Csv::parse(text)?;
    csv.require(&["t_s", "e_m", "n_m", "u_m"])?;
    let mut by_time = HashMap::new();
    for (line, fields) in &csv.lines {
        let number = |name: &str| csv.number(*line, fields, name);
        let values = [number("e_m")?, number("n_m")?, number("u_m")?];
        if let (Some(t_s), [Some(e), Some(n), Some(u)]) = (number("t_s")?, values) {
            by_time.insert(time_key(t_s), [e, n, u]);
        }
    }
    for row in rows {
        row.error_enu_m = by_time.get(&time_key(row.t_s)).copied();
    }
    Ok(())
}

impl Table {
    /// Reads `epochs.csv` and `errors.csv` of a directory.
    ///
    /// # Errors
    /// When there is no `epochs.csv`, or one of the two is not of the form surefix writes.
    pub fn read(directory: &Path) -> Result<Self> {
        let path = directory.join("epochs.csv");
        let text = std::fs::read_to_string(&path).with_context(|| {
            format!(
                "cannot read {}: run `surefix replay … --out {}` first",
                path.display(),
                directory.display()
            )
        })?;
        let (mut rows, has_used) =
            parse_epochs(&text).with_context(|| format!("{}", path.display()))?;
        let path = directory.join("errors.csv");
        let has_errors = path.exists();
        if has_errors {
            let text = std::fs::read_to_string(&path)
                .with_context(|| format!("cannot read {}", path.display()))?;
            add_errors(&mut rows, &text).with_context(|| format!("{}", path.display()))?;
        }
        Ok(Self {
            rows,
            has_errors,
            has_used,
        })
    }
}

impl Row {
    /// Horizontal error, m.
    pub fn horizontal_error_m(&self) -> Option<f64> {
        self.error_enu_m.map(|[e, n, _]| e.hypot(n))
    }

    /// Size of the vertical error, m.
    pub fn vertical_error_m(&self) -> Option<f64> {
        self.error_enu_m.map(|[_, _, u]| u.abs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "t_s,integrity,reason,hpl_m,vpl_m,excluded";

    #[test]
    fn a_row_without_values_is_still_an_epoch() {
        let text =
            format!("{HEADER}\n0,unavailable,too_few_satellites,,,-\n1,nominal,none,5,9,G05+C03\n");
        let (rows, has_used) = parse_epochs(&text).unwrap();
        assert_eq!(rows.len(), 2);
        assert_eq!(rows[0].hpl_m, None);
        assert_eq!(rows[1].excluded, ["G05", "C03"]);
        assert!(!has_used);
    }

    #[test]
    fn errors_go_to_the_epoch_of_their_time() {
        let text = format!("{HEADER}\n0,nominal,none,5,9,-\n0.1,nominal,none,5,9,-\n");
        let (mut rows, _) = parse_epochs(&text).unwrap();
        add_errors(&mut rows, "t_s,e_m,n_m,u_m\n0.1,3,4,-2\n").unwrap();
        assert_eq!(rows[0].error_enu_m, None);
        assert_eq!(rows[1].horizontal_error_m(), Some(5.0));
        assert_eq!(rows[1].vertical_error_m(), Some(2.0));
    }

    #[test]
    fn a_damaged_file_is_refused_with_its_place() {
        let text = format!("{HEADER}\n0,nominal,none,five,9,-\n");
        let message = parse_epochs(&text).unwrap_err().to_string();
        assert!(
            message.contains("line 2") && message.contains("hpl_m"),
            "{message}"
        );
        assert!(parse_epochs("t_s,integrity\n0,nominal\n").is_err());
    }
}
