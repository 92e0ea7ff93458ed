//! Reading what `surefix replay` wrote: `epochs.csv` and, where they are there, `errors.csv` and
//! `satellites.csv`.
//!
//! Row by row: with the columns of a bank the file of a day is much larger than what is kept of it.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read as _};
use std::path::Path;

use anyhow::{Context, Result, anyhow, bail};

use super::satellites::Satellites;

/// One receiver epoch as a row of `epochs.csv` has it; `None` where the row has no value.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Seconds from the first epoch.
    pub t_s: f64,
    /// GPS week.
    pub week: Option<f64>,
    /// GPS time of week, s.
    pub tow_s: Option<f64>,
    /// Position, ECEF, m, where one was computed.
    pub r_e_m: Option<[f64; 3]>,
    /// Its latitude and longitude, degrees, and height, m.
    pub llh: Option<[f64; 3]>,
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
    /// Satellites in the bank of filters, where it ran.
    pub n_bank: Option<f64>,
    /// How its opinion and the snapshot's stand to each other; empty where there are not two.
    pub opinions: String,
    /// How far off the position may be while a fault is present, horizontal and vertical, m.
    pub uncertainty_m: [Option<f64>; 2],
    /// Tests of the bank.
    pub tests: Vec<Test>,
}

/// The test of one filter of the bank.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Test {
    /// Which satellite or constellation the filter leaves out, in [`Table::tested`].
    pub satellite: u16,
    /// Statistic over threshold, horizontal and vertical: NaN where there is nothing to test, infinite
    /// where one of the two is not finite, which fails the test.
    pub ratio: [f32; 2],
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
    /// Names that have columns of the bank, in the order of the columns.
    pub tested: Vec<String>,
    /// What `satellites.csv` says, where it is there.
    pub satellites: Option<Satellites>,
}

/// The first line of a CSV file without quoting, as surefix writes it.
pub struct Csv {
    columns: HashMap<String, usize>,
    /// As they stand.
    names: Vec<String>,
}

/// One of the other lines.
pub struct Line<'a> {
    csv: &'a Csv,
    /// Counted from 1.
    pub number: usize,
    fields: Vec<&'a str>,
}

impl Csv {
    /// Reads the first line, which must hold the columns of these names, and gives every other to `take`.
    pub fn read(
        mut from: impl BufRead,
        required: &[&str],
        take: &mut dyn FnMut(&Line<'_>) -> Result<()>,
    ) -> Result<Self> {
        let mut text = String::new();
        if from.read_line(&mut text)? == 0 {
            bail!("the file is empty");
        }
        let names: Vec<String> = text.split(',').map(|name| name.trim().to_owned()).collect();
        let columns = names.iter().cloned().zip(0..).collect();
        let csv = Self { columns, names };
        if let Some(name) = required
            .iter()
            .find(|name| !csv.columns.contains_key(**name))
        {
            bail!("there is no column `{name}`");
        }
        for number in 2.. {
            text.clear();
            if from.read_line(&mut text)? == 0 {
                break;
            }
            if text.trim().is_empty() {
                continue;
            }
            let fields: Vec<&str> = text.split(',').map(str::trim).collect();
            if fields.len() != csv.names.len() {
                bail!(
                    "line {number} has {} fields, the header {}",
                    fields.len(),
                    csv.names.len()
                );
            }
            take(&Line {
                csv: &csv,
                number,
                fields,
            })?;
        }
        Ok(csv)
    }
}

impl Line<'_> {
    /// The text of a column, empty where there is none.
    pub fn text(&self, name: &str) -> &str {
        self.csv.columns.get(name).map_or("", |k| self.fields[*k])
    }

    /// The number of a column, where it has a finite one.
    pub fn number(&self, name: &str) -> Result<Option<f64>> {
        match self.csv.columns.get(name) {
            Some(place) => Ok(self.number_at(*place)?.filter(|value| value.is_finite())),
            None => Ok(None),
        }
    }

    fn number_at(&self, place: usize) -> Result<Option<f64>> {
        let text = self.fields[place];
        if text.is_empty() {
            return Ok(None);
        }
        let value = text.parse().map_err(|_| {
            let (line, name) = (self.number, &self.csv.names[place]);
            anyhow!("line {line}, column {name}: `{text}` is no number")
        })?;
        Ok(Some(value))
    }

    /// The tests of the bank, whose columns stand in fours.
    fn tests(&self, places: &[[usize; 4]]) -> Result<Vec<Test>> {
        let mut tests = Vec::new();
        for (satellite, places) in (0..).zip(places) {
            if places.iter().all(|place| self.fields[*place].is_empty()) {
                continue;
            }
            let [d_h, t_h, d_v, t_v] = *places;
            let mut ratio = [f32::NAN; 2];
            for (ratio, (d, t)) in ratio.iter_mut().zip([(d_h, t_h), (d_v, t_v)]) {
                if let (Some(d), Some(t)) = (self.number_at(d)?, self.number_at(t)?) {
                    let is_finite = d.is_finite() && t.is_finite();
                    *ratio = if is_finite {
                        (d / t) as f32
                    } else {
                        f32::INFINITY
                    };
                }
            }
            tests.push(Test { satellite, ratio });
        }
        Ok(tests)
    }
}

/// Names of the satellites and letters of the constellations that have columns of the bank.
fn tested(first_line: &str) -> Vec<String> {
    let columns = first_line.split(',').map(str::trim);
    columns
        .filter_map(|column| column.strip_prefix("d_h_"))
        .map(str::to_owned)
        .collect()
}

/// All three, or none.
fn three(a: Option<f64>, b: Option<f64>, c: Option<f64>) -> Option<[f64; 3]> {
    Some([a?, b?, c?])
}

/// Satellites joined by `+`, or `-` for none.
fn satellites(text: &str) -> Vec<String> {
    text.split('+')
        .filter(|name| !name.is_empty() && *name != "-")
        .map(str::to_owned)
        .collect()
}

/// Time in whole microseconds, to find the row of another file that is of the same epoch.
pub fn time_key(t_s: f64) -> i64 {
    (t_s * 1e6).round() as i64
}

fn parse_epochs(mut from: impl BufRead) -> Result<Table> {
    // The line of names is needed before the rows.
    let mut first_line = String::new();
    from.read_line(&mut first_line)?;
    let tested = tested(&first_line);
    let mut places = Vec::new();
    for name in &tested {
        let mut of_name = [0; 4];
        for (place, column) in of_name.iter_mut().zip(["d_h_", "t_h_", "d_v_", "t_v_"]) {
            let wanted = format!("{column}{name}");
            *place = first_line
                .split(',')
                .position(|column| column.trim() == wanted)
                .ok_or_else(|| anyhow!("there is no column `{wanted}`"))?;
        }
        places.push(of_name);
    }
    let mut rows: Vec<Row> = Vec::new();
    let required = ["t_s", "integrity", "reason", "hpl_m", "vpl_m", "excluded"];
    let csv = Csv::read(first_line.as_bytes().chain(from), &required, &mut |line| {
        let number = |name: &str| line.number(name);
        let t_s = number("t_s")?.ok_or_else(|| anyhow!("line {}: no t_s", line.number))?;
        if rows.last().is_some_and(|before| t_s <= before.t_s) {
            bail!("line {}: t_s does not grow from row to row", line.number);
        }
        rows.push(Row {
            t_s,
            week: number("week")?,
            tow_s: number("tow_s")?,
            r_e_m: three(number("x_m")?, number("y_m")?, number("z_m")?),
            llh: three(number("lat_deg")?, number("lon_deg")?, number("h_m")?),
            n_sats: number("n_sats")?,
            n_visible: number("n_visible")?,
            integrity: line.text("integrity").to_owned(),
            reason: line.text("reason").to_owned(),
            hpl_m: number("hpl_m")?,
            vpl_m: number("vpl_m")?,
            hal_m: number("hal_m")?,
            val_m: number("val_m")?,
            excluded: satellites(line.text("excluded")),
            used: satellites(line.text("used")),
            stat: number("stat")?,
            threshold: number("threshold")?,
            error_enu_m: None,
            n_bank: number("n_bank")?,
            opinions: line.text("opinions").to_owned(),
            uncertainty_m: [number("uncertainty_h_m")?, number("uncertainty_v_m")?],
            tests: line.tests(&places)?,
        });
        Ok(())
    })?;
    Ok(Table {
        rows,
        has_errors: false,
        has_used: csv.columns.contains_key("used"),
        tested,
        satellites: None,
    })
}

fn add_errors(rows: &mut [Row], from: impl BufRead) -> Result<()> {
    let mut by_time = HashMap::new();
    Csv::read(from, &["t_s", "e_m", "n_m", "u_m"], &mut |line| {
        let number = |name: &str| line.number(name);
        let values = [number("e_m")?, number("n_m")?, number("u_m")?];
        if let (Some(t_s), [Some(e), Some(n), Some(u)]) = (number("t_s")?, values) {
            by_time.insert(time_key(t_s), [e, n, u]);
        }
        Ok(())
    })?;
    for row in rows {
        row.error_enu_m = by_time.get(&time_key(row.t_s)).copied();
    }
    Ok(())
}

impl Table {
    /// Reads `epochs.csv`, `errors.csv` and `satellites.csv` of a directory.
    ///
    /// # Errors
    /// When there is no `epochs.csv`, or one of the files is not of the form surefix writes.
    pub fn read(directory: &Path) -> Result<Self> {
        let path = directory.join("epochs.csv");
        let file = File::open(&path).with_context(|| {
            format!(
                "cannot read {}: run `surefix replay … --out {}` first",
                path.display(),
                directory.display()
            )
        })?;
        let mut table =
            parse_epochs(BufReader::new(file)).with_context(|| format!("{}", path.display()))?;
        let path = directory.join("errors.csv");
        table.has_errors = path.exists();
        if table.has_errors {
            let file =
                File::open(&path).with_context(|| format!("cannot read {}", path.display()))?;
            add_errors(&mut table.rows, BufReader::new(file))
                .with_context(|| format!("{}", path.display()))?;
        }
        let path = directory.join("satellites.csv");
        if path.exists() {
            let file =
                File::open(&path).with_context(|| format!("cannot read {}", path.display()))?;
            let satellites = Satellites::read(BufReader::new(file), &table.rows)
                .with_context(|| format!("{}", path.display()))?;
            table.satellites = Some(satellites);
        }
        Ok(table)
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
pub mod tests {
    use super::*;

    const HEADER: &str = "t_s,integrity,reason,hpl_m,vpl_m,excluded";

    /// Epochs of a run, one second apart.
    pub fn rows(count: usize) -> Vec<Row> {
        let lines: String = (0..count)
            .map(|k| format!("{k},nominal,none,5,9,-\n"))
            .collect();
        parse_epochs(format!("{HEADER}\n{lines}").as_bytes())
            .unwrap()
            .rows
    }

    #[test]
    fn a_row_without_values_is_still_an_epoch() {
        let text =
            format!("{HEADER}\n0,unavailable,too_few_satellites,,,-\n1,nominal,none,5,9,G05+C03\n");
        let table = parse_epochs(text.as_bytes()).unwrap();
        assert_eq!(table.rows.len(), 2);
        assert_eq!(table.rows[0].hpl_m, None);
        assert_eq!(table.rows[1].excluded, ["G05", "C03"]);
        assert!(!table.has_used);
    }

    #[test]
    fn errors_go_to_the_epoch_of_their_time() {
        let text = format!("{HEADER}\n0,nominal,none,5,9,-\n0.1,nominal,none,5,9,-\n");
        let mut rows = parse_epochs(text.as_bytes()).unwrap().rows;
        add_errors(&mut rows, &b"t_s,e_m,n_m,u_m\n0.1,3,4,-2\n"[..]).unwrap();
        assert_eq!(rows[0].error_enu_m, None);
        assert_eq!(rows[1].horizontal_error_m(), Some(5.0));
        assert_eq!(rows[1].vertical_error_m(), Some(2.0));
    }

    #[test]
    fn a_test_is_a_ratio_or_failed_or_nothing() {
        let bank = "n_bank,d_h_G05,t_h_G05,d_v_G05,t_v_G05,d_h_GPS,t_h_GPS,d_v_GPS,t_v_GPS";
        let text = format!(
            "{HEADER},{bank}\n0,nominal,none,5,9,-,1,1.5,3,,,nan,2,,\n1,nominal,none,5,9,-,,,,,,,,,\n"
        );
        let table = parse_epochs(text.as_bytes()).unwrap();
        assert_eq!(table.tested, ["G05", "GPS"]);
        let [first, second] = &table.rows[0].tests[..] else {
            panic!("{:?}", table.rows[0].tests);
        };
        assert_eq!((first.satellite, second.satellite), (0, 1));
        assert!(first.ratio[0] == 0.5 && first.ratio[1].is_nan());
        assert!(second.ratio[0] == f32::INFINITY && second.ratio[1].is_nan());
        assert!(table.rows[1].tests.is_empty());
        assert_eq!(table.rows[1].n_bank, None);
    }

    #[test]
    fn a_damaged_file_is_refused_with_its_place() {
        let text = format!("{HEADER}\n0,nominal,none,five,9,-\n");
        let message = parse_epochs(text.as_bytes()).unwrap_err().to_string();
        assert!(
            message.contains("line 2") && message.contains("hpl_m"),
            "{message}"
        );
        assert!(parse_epochs(&b"t_s,integrity\n0,nominal\n"[..]).is_err());
        assert!(parse_epochs(&b""[..]).is_err());
    }
}
