//! CSV tables with a header line, read so that an error tells file, line and column.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

/// A table in memory.
#[derive(Clone, Debug)]
pub struct Table {
    path: PathBuf,
    header: Vec<String>,
    text: String,
}

/// A row of a table.
#[derive(Clone, Debug)]
pub struct Row<'t> {
    table: &'t Table,
    line: usize,
    fields: Vec<&'t str>,
}

/// Where a column stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Column(usize);

impl Table {
    /// Reads a file.
    ///
    /// # Errors
    /// When the file cannot be read or is empty.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("cannot read {}", path.display()))?;
        Self::from_text(path, text)
    }

    /// Takes the text of a file; the path is for messages.
    ///
    /// # Errors
    /// When there is no header.
    pub fn from_text(path: &Path, text: String) -> Result<Self> {
        let header = text.lines().next().unwrap_or_default();
        if header.trim().is_empty() {
            bail!("{} has no header line", path.display());
        }
        let header = header.split(',').map(|name| name.trim().into()).collect();
        Ok(Self {
            path: path.into(),
            header,
            text,
        })
    }

    /// Names of the columns.
    pub fn header(&self) -> &[String] {
        &self.header
    }

    /// The column of a name.
    ///
    /// # Errors
    /// When there is none, or two.
    pub fn column(&self, name: &str) -> Result<Column> {
        let mut found = self.header.iter().enumerate().filter(|(_, h)| *h == name);
        match (found.next(), found.next()) {
            (Some((k, _)), None) => Ok(Column(k)),
            (Some(_), Some(_)) => bail!("{}: two columns are called {name}", self.path.display()),
            (None, _) => bail!(
                "{}: there is no column {name}; the header is \"{}\"",
                self.path.display(),
                self.header.join(",")
            ),
        }
    }

    /// The columns of several names.
    ///
    /// # Errors
    /// See [`Table::column`].
    pub fn columns<const N: usize>(&self, names: [&str; N]) -> Result<[Column; N]> {
        let mut columns = [Column(0); N];
        for (column, name) in columns.iter_mut().zip(names) {
            *column = self.column(name)?;
        }
        Ok(columns)
    }

    /// The rows, empty lines left out.
    pub fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        let lines = self.text.lines().enumerate().skip(1);
        lines
            .filter(|(_, text)| !text.trim().is_empty())
            .map(|(k, text)| Row {
                table: self,
                line: k + 1,
                fields: text.split(',').map(str::trim).collect(),
            })
    }
}

impl<'t> Row<'t> {
    /// The text of a field.
    ///
    /// # Errors
    /// When the row is too short.
    pub fn text(&self, column: Column) -> Result<&'t str> {
        match self.fields.get(column.0) {
            Some(text) => Ok(text),
            None => bail!(
                "{}: the line ends before it; the header has {} columns",
                self.place(column),
                self.table.header.len()
            ),
        }
    }

    /// A number; `nan` is one.
    ///
    /// # Errors
    /// When the field is missing or no number.
    pub fn any_number(&self, column: Column) -> Result<f64> {
        let text = self.text(column)?;
        match text.parse() {
            Ok(value) => Ok(value),
            Err(_) => bail!("{}: \"{text}\" is not a number", self.place(column)),
        }
    }

    /// A finite number.
    ///
    /// # Errors
    /// When the field is missing or no finite number.
    pub fn number(&self, column: Column) -> Result<f64> {
        let value = self.any_number(column)?;
        if !value.is_finite() {
            bail!("{}: \"{value}\" is not finite", self.place(column));
        }
        Ok(value)
    }

    /// A number above 0.
    ///
    /// # Errors
    /// When the field is missing or no such number.
    pub fn positive(&self, column: Column) -> Result<f64> {
        let value = self.number(column)?;
        if value <= 0.0 {
            bail!("{}: {value} is not above 0", self.place(column));
        }
        Ok(value)
    }

    /// Several finite numbers.
    ///
    /// # Errors
    /// See [`Row::number`].
    pub fn numbers<const N: usize>(&self, columns: [Column; N]) -> Result<[f64; N]> {
        let mut values = [0.0; N];
        for (value, column) in values.iter_mut().zip(columns) {
            *value = self.number(column)?;
        }
        Ok(values)
    }

    /// Several numbers; `nan` is one.
    ///
    /// # Errors
    /// See [`Row::any_number`].
    pub fn any_numbers<const N: usize>(&self, columns: [Column; N]) -> Result<[f64; N]> {
        let mut values = [0.0; N];
        for (value, column) in values.iter_mut().zip(columns) {
            *value = self.any_number(column)?;
        }
        Ok(values)
    }

    /// File, line and column, for messages.
    pub fn place(&self, column: Column) -> String {
        let name = self.table.header.get(column.0).map_or("?", String::as_str);
        format!(
            "{}, line {}, column {name}",
            self.table.path.display(),
            self.line
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> Result<Table> {
        Table::from_text(Path::new("x.csv"), text.into())
    }

    fn error<T: std::fmt::Debug>(result: Result<T>) -> String {
        result.unwrap_err().to_string()
    }

    #[test]
    fn an_error_tells_file_line_and_column() {
        let table = table("a,b\n1,2\n\n3,x\n4\n5,nan\n").unwrap();
        let b = table.column("b").unwrap();
        let rows: Vec<Row> = table.rows().collect();
        assert_eq!(rows[0].number(b).unwrap(), 2.0);
        let message = error(rows[1].number(b));
        assert_eq!(message, "x.csv, line 4, column b: \"x\" is not a number");
        assert!(error(rows[2].number(b)).starts_with("x.csv, line 5, column b: the line ends"));
        assert!(rows[3].any_number(b).unwrap().is_nan());
        assert!(error(rows[3].number(b)).contains("not finite"));
    }

    #[test]
    fn a_column_that_is_missing_or_doubled_is_named() {
        let table = table("a,b,b\n").unwrap();
        assert!(error(table.column("c")).contains("no column c"));
        assert!(error(table.column("b")).contains("two columns"));
    }

    #[test]
    fn a_file_without_a_header_is_refused() {
        assert!(error(table("")).contains("no header"));
    }
}
