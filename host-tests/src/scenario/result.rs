//! `result.csv`: one row per epoch, and how far two of them are apart.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context, Result, bail};

use super::folder::SAME_TIME_S;
use super::table::{Column, Table};

/// Columns before those of the satellites.
pub const COLUMNS: &str =
    "t_s,px,py,pz,vx,vy,vz,qw,qx,qy,qz,clk_b,clk_d,hpl,vpl,hpl0,detected,excluded,n_sats";

/// One epoch; NaN where there is no solution.
#[derive(Clone, Debug, PartialEq)]
pub struct ResultRow {
    /// Time, s.
    pub t_s: f64,
    /// Position, ECEF, m.
    pub r_eb_e_m: [f64; 3],
    /// Velocity against the Earth, m/s.
    pub v_eb_e_mps: [f64; 3],
    /// Rotation from body to ECEF, scalar first.
    pub q_e_b: [f64; 4],
    /// Clock bias, m, and drift, m/s.
    pub clock: [f64; 2],
    /// Horizontal level of the bank, m; 0 without one.
    pub hpl_m: f64,
    /// Vertical level of the bank, m; 0 without one.
    pub vpl_m: f64,
    /// Fault-free horizontal level, m.
    pub hpl0_m: f64,
    /// A test was exceeded.
    pub detected: bool,
    /// Satellites excluded so far, in order.
    pub excluded: Vec<String>,
    /// Satellites in the bank after the exclusion.
    pub n_sats: usize,
    /// Statistic and threshold of the filter without each satellite of [`ResultFile::satellites`];
    /// NaN where it is not in the bank.
    pub tests: Vec<[f64; 2]>,
}

/// A whole `result.csv`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ResultFile {
    /// Satellites with columns, sorted.
    pub satellites: Vec<String>,
    /// Epochs, times ascending.
    pub rows: Vec<ResultRow>,
}

/// Largest differences between two results.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Differences {
    /// Epochs compared.
    pub epochs: usize,
    /// Length of the difference of the positions, m.
    pub position_m: f64,
    /// Of the velocities, m/s.
    pub velocity_mps: f64,
    /// Angle between the attitudes, rad.
    pub attitude_rad: f64,
    /// Of the clock biases, m.
    pub clock_bias_m: f64,
    /// Of the clock drifts, m/s.
    pub clock_drift_mps: f64,
    /// Of the fault-free levels, relative.
    pub hpl0_relative: f64,
    /// Of the horizontal levels of the bank, relative.
    pub hpl_relative: f64,
    /// Of the vertical levels of the bank, relative.
    pub vpl_relative: f64,
    /// Of the statistics, m.
    pub statistic_m: f64,
    /// Of the thresholds, relative.
    pub threshold_relative: f64,
    /// Tests that only one of the two has.
    pub unmatched_tests: usize,
    /// Epochs with different numbers of satellites in the bank.
    pub counts: usize,
}

impl ResultFile {
    /// Reads a file; columns that are not of the form are ignored.
    ///
    /// # Errors
    /// When a column is missing or a field is not what it must be; the message tells where.
    pub fn read(path: &Path) -> Result<Self> {
        Self::from_table(&Table::read(path)?)
    }

    fn from_table(table: &Table) -> Result<Self> {
        let [time, detected, excluded, n_sats] =
            table.columns(["t_s", "detected", "excluded", "n_sats"])?;
        let position = table.columns(["px", "py", "pz"])?;
        let velocity = table.columns(["vx", "vy", "vz"])?;
        let attitude = table.columns(["qw", "qx", "qy", "qz"])?;
        let clock = table.columns(["clk_b", "clk_d"])?;
        let [hpl, vpl, hpl0] = table.columns(["hpl", "vpl", "hpl0"])?;
        let satellites: Vec<String> = table
            .header()
            .iter()
            .filter_map(|name| name.strip_prefix("d_"))
            .map(String::from)
            .collect();
        let tests: Result<Vec<[Column; 2]>> = satellites
            .iter()
            .map(|name| table.columns([&format!("d_{name}"), &format!("T_{name}")]))
            .collect();
        let tests = tests?;
        let mut rows: Vec<ResultRow> = Vec::new();
        for row in table.rows() {
            let t_s = row.number(time)?;
            if let Some(last) = rows.last().filter(|last| t_s <= last.t_s) {
                bail!(
                    "{}: {t_s} does not come after {}",
                    row.place(time),
                    last.t_s
                );
            }
            let pairs: Result<Vec<[f64; 2]>> = tests
                .iter()
                .map(|[d, t]| Ok([row.any_number(*d)?, row.any_number(*t)?]))
                .collect();
            rows.push(ResultRow {
                t_s,
                r_eb_e_m: row.any_numbers(position)?,
                v_eb_e_mps: row.any_numbers(velocity)?,
                q_e_b: row.any_numbers(attitude)?,
                clock: row.any_numbers(clock)?,
                hpl_m: row.any_number(hpl)?,
                vpl_m: row.any_number(vpl)?,
                hpl0_m: row.any_number(hpl0)?,
                detected: row.number(detected)? != 0.0,
                excluded: match row.text(excluded)? {
                    "-" => Vec::new(),
                    names => names.split('+').map(String::from).collect(),
                },
                n_sats: match row.text(n_sats)?.parse() {
                    Ok(count) => count,
                    Err(_) => bail!("{}: is not a count", row.place(n_sats)),
                },
                tests: pairs?,
            });
        }
        Ok(Self { satellites, rows })
    }

    /// The text of the file; numbers in their shortest form that reads back exactly.
    pub fn to_text(&self) -> String {
        let mut text = String::from(COLUMNS);
        for name in &self.satellites {
            let _ = write!(text, ",d_{name},T_{name}");
        }
        text.push('\n');
        for row in &self.rows {
            row.write(&mut text);
        }
        text
    }

    /// Writes the file.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        std::fs::write(path, self.to_text())
            .with_context(|| format!("cannot write {}", path.display()))
    }

    /// Largest differences from `other`, at every epoch of it.
    ///
    /// # Errors
    /// When an epoch or a satellite of `other` is missing here, or there is none to compare.
    pub fn compare(&self, other: &Self) -> Result<Differences> {
        let mut largest = Differences::default();
        let mut rows = self.rows.iter().peekable();
        for name in &other.satellites {
            if !self.satellites.contains(name) {
                bail!("there are no columns of the satellite {name}");
            }
        }
        for expected in &other.rows {
            while rows
                .next_if(|row| row.t_s < expected.t_s - SAME_TIME_S)
                .is_some()
            {}
            let row = rows.next_if(|row| row.t_s <= expected.t_s + SAME_TIME_S);
            let Some(row) = row else {
                bail!("there is no row for the epoch at {} s", expected.t_s);
            };
            let mut differences = row.differences(expected);
            for (name, test) in self.satellites.iter().zip(&row.tests) {
                let column = other.satellites.iter().position(|other| other == name);
                let expected = column.and_then(|column| expected.tests.get(column));
                differences.take_test(test, expected.unwrap_or(&[f64::NAN; 2]));
            }
            largest.take_larger(&differences);
        }
        if largest.epochs == 0 {
            bail!("there is no epoch to compare");
        }
        Ok(largest)
    }

    /// Number of the first epoch with a test that failed.
    pub fn first_detection(&self) -> Option<usize> {
        self.rows.iter().position(|row| row.detected)
    }

    /// Satellites excluded in their order, each with the number of its epoch.
    pub fn exclusions(&self) -> Vec<(usize, String)> {
        let mut before = 0;
        let mut exclusions = Vec::new();
        for (epoch, row) in self.rows.iter().enumerate() {
            let new = row.excluded.iter().skip(before);
            exclusions.extend(new.map(|name| (epoch, name.clone())));
            before = row.excluded.len();
        }
        exclusions
    }
}

/// Difference of two numbers as a part of the second; 0 when they are the same.
fn relative(a: f64, b: f64) -> f64 {
    if a == b { 0.0 } else { ((a - b) / b).abs() }
}

/// The larger of two; a NaN counts as larger than everything, so that no limit holds it.
fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() {
        f64::INFINITY
    } else {
        a.max(b)
    }
}

impl Differences {
    fn take_larger(&mut self, other: &Self) {
        self.epochs += other.epochs;
        self.position_m = larger(self.position_m, other.position_m);
        self.velocity_mps = larger(self.velocity_mps, other.velocity_mps);
        self.attitude_rad = larger(self.attitude_rad, other.attitude_rad);
        self.clock_bias_m = larger(self.clock_bias_m, other.clock_bias_m);
        self.clock_drift_mps = larger(self.clock_drift_mps, other.clock_drift_mps);
        self.hpl0_relative = larger(self.hpl0_relative, other.hpl0_relative);
        self.hpl_relative = larger(self.hpl_relative, other.hpl_relative);
        self.vpl_relative = larger(self.vpl_relative, other.vpl_relative);
        self.statistic_m = larger(self.statistic_m, other.statistic_m);
        self.threshold_relative = larger(self.threshold_relative, other.threshold_relative);
        self.unmatched_tests += other.unmatched_tests;
        self.counts += other.counts;
    }

    /// Takes a satellite's statistic and threshold; both NaN say that there is no test.
    fn take_test(&mut self, test: &[f64; 2], expected: &[f64; 2]) {
        let is_absent = |test: &[f64; 2]| test.iter().all(|value| value.is_nan());
        match (is_absent(test), is_absent(expected)) {
            (true, true) => {}
            (false, false) => {
                let statistic_m = (test[0] - expected[0]).abs();
                self.statistic_m = larger(self.statistic_m, statistic_m);
                let threshold = relative(test[1], expected[1]);
                self.threshold_relative = larger(self.threshold_relative, threshold);
            }
            _ => self.unmatched_tests += 1,
        }
    }
}

impl ResultRow {
    /// How far this epoch is from another, as [`Differences`] of one epoch, without those of the tests.
    pub fn differences(&self, other: &Self) -> Differences {
        let distance = |a: [f64; 3], b: [f64; 3]| {
            let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
            squares.sum::<f64>().sqrt()
        };
        let [a, b, c, d] = self.q_e_b;
        let [w, x, y, z] = other.q_e_b;
        // Vector part of the rotation from one to the other: sin of half the angle, which keeps its
        // digits where the cosine has lost them.
        let vector = [
            a * x - b * w - c * z + d * y,
            a * y + b * z - c * w - d * x,
            a * z - b * y + c * x - d * w,
        ];
        let scalar = a * w + b * x + c * y + d * z;
        let half = distance(vector, [0.0; 3]).atan2(scalar.abs());
        Differences {
            epochs: 1,
            position_m: distance(self.r_eb_e_m, other.r_eb_e_m),
            velocity_mps: distance(self.v_eb_e_mps, other.v_eb_e_mps),
            attitude_rad: 2.0 * half,
            clock_bias_m: (self.clock[0] - other.clock[0]).abs(),
            clock_drift_mps: (self.clock[1] - other.clock[1]).abs(),
            hpl0_relative: relative(self.hpl0_m, other.hpl0_m),
            hpl_relative: relative(self.hpl_m, other.hpl_m),
            vpl_relative: relative(self.vpl_m, other.vpl_m),
            counts: usize::from(self.n_sats != other.n_sats),
            ..Differences::default()
        }
    }

    fn write(&self, text: &mut String) {
        let _ = write!(text, "{}", self.t_s);
        let numbers = self
            .r_eb_e_m
            .iter()
            .chain(&self.v_eb_e_mps)
            .chain(&self.q_e_b)
            .chain(&self.clock)
            .chain([&self.hpl_m, &self.vpl_m, &self.hpl0_m]);
        for number in numbers {
            write_number(text, *number);
        }
        let excluded = if self.excluded.is_empty() {
            "-".into()
        } else {
            self.excluded.join("+")
        };
        let detected = u8::from(self.detected);
        let _ = write!(text, ",{detected},{excluded},{}", self.n_sats);
        for number in self.tests.iter().flatten() {
            write_number(text, *number);
        }
        text.push('\n');
    }
}

fn write_number(text: &mut String, number: f64) {
    if number.is_nan() {
        text.push_str(",nan");
    } else {
        let _ = write!(text, ",{number}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(rows: &str) -> ResultFile {
        let text = format!("{COLUMNS},d_G01,T_G01,hpl_ff\n{rows}");
        let table = Table::from_text(Path::new("result.csv"), text).unwrap();
        ResultFile::from_table(&table).unwrap()
    }

    fn row(t_s: u32, x: &str, excluded: &str) -> String {
        format!("{t_s},{x},0,0,0,0,0,1,0,0,0,5,0,0,0,2,0,{excluded},6,nan,nan,8\n")
    }

    #[test]
    fn a_comparison_goes_on_after_an_exclusion() {
        let ours = file(&(row(1, "1", "-") + &row(2, "2.5", "G07") + &row(3, "9", "G07+C01")));
        let other = file(&(row(1, "1", "-") + &row(2, "2", "-") + &row(3, "3", "G07+C01")));
        let largest = ours.compare(&other).unwrap();
        assert_eq!((largest.epochs, largest.position_m), (3, 6.0));
        assert_eq!(ours.exclusions(), [(1, "G07".into()), (2, "C01".into())]);
        assert_eq!(other.exclusions(), [(2, "G07".into()), (2, "C01".into())]);
    }

    #[test]
    fn tests_and_levels_are_compared_satellite_by_satellite() {
        let text = |columns: &str, row: &str| {
            let text = format!("{COLUMNS},{columns}\n1,0,0,0,0,0,0,1,0,0,0,0,0,{row}\n");
            let table = Table::from_text(Path::new("result.csv"), text).unwrap();
            ResultFile::from_table(&table).unwrap()
        };
        let expected = text("d_C01,T_C01,d_G07,T_G07", "10,20,5,1,-,2,1,2,3,4");
        let same = text("d_G07,T_G07,d_C01,T_C01", "10,20,5,1,-,2,3,4,1,2");
        let none = Differences {
            epochs: 1,
            ..Differences::default()
        };
        assert_eq!(same.compare(&expected).unwrap(), none);
        assert_eq!(same.first_detection(), Some(0));
        let other = text("d_C01,T_C01,d_G07,T_G07", "11,15,4,0,-,3,nan,nan,3.5,3");
        let differences = other.compare(&expected).unwrap();
        assert_eq!(
            differences,
            Differences {
                hpl_relative: 0.1,
                vpl_relative: 0.25,
                hpl0_relative: 0.2,
                statistic_m: 0.5,
                threshold_relative: 0.25,
                unmatched_tests: 1,
                counts: 1,
                ..none
            }
        );
        assert_eq!(other.first_detection(), None);
        let half = text("d_C01,T_C01,d_G07,T_G07", "10,20,5,1,-,2,1,nan,3,4");
        let threshold = half.compare(&expected).unwrap().threshold_relative;
        assert_eq!(threshold, f64::INFINITY);
        let fewer = text("d_C01,T_C01", "10,20,5,1,-,2,1,2");
        assert!(fewer.compare(&expected).is_err());
        assert_eq!(expected.compare(&fewer).unwrap().unmatched_tests, 1);
    }

    #[test]
    fn what_is_missing_is_no_agreement() {
        let expected = file(&(row(1, "1", "-") + &row(2, "2", "-")));
        let short = file(&row(1, "1", "-"));
        assert!(short.compare(&expected).is_err());
        let none = file(&(row(1, "nan", "-") + &row(2, "2", "-")));
        let largest = none.compare(&expected).unwrap();
        assert_eq!(largest.position_m, f64::INFINITY);
        assert!(short.compare(&file("")).is_err());
    }

    #[test]
    fn small_angles_and_the_other_sign_of_a_quaternion_are_seen_rightly() {
        let expected = file(&row(1, "1", "-")).rows.remove(0);
        let mut turned = expected.clone();
        turned.q_e_b = [-1.0, 0.0, -5e-9, 0.0];
        let angle = turned.differences(&expected).attitude_rad;
        assert!((angle - 1e-8).abs() < 1e-16, "{angle}");
    }
}
