//! A table of a run, read back.

use crate::error::{Error, Result};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Cells by row, with the names of the columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    path: PathBuf,
    columns: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Sheet {
    /// Reads `<folder>/<name>.csv`; `None` where there is no such table, or not even its header. A last row without its end
    /// belongs to a frame that a kill cut short, and is left out.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::DamagedRun`] where a row is not as long as the header.
    pub fn find(folder: &Path, name: &str) -> Result<Option<Sheet>> {
        let path = folder.join(format!("{name}.csv"));
        match std::fs::read_to_string(&path) {
            Ok(text) => {
                let whole = text.rfind('\n').map_or(0, |end| end + 1);
                if whole == 0 { Ok(None) } else { Sheet::parse(path, &text[..whole]).map(Some) }
            }
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) if error.kind() == ErrorKind::InvalidData => {
                Err(Error::DamagedRun { path, message: error.to_string().into() })
            }
            Err(source) => Err(Error::Io { action: "read", path, source }),
        }
    }

    /// From the text of a file.
    ///
    /// # Errors
    /// [`Error::DamagedRun`].
    pub fn parse(path: PathBuf, text: &str) -> Result<Sheet> {
        let mut reader = csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(text.as_bytes());
        let rows: std::result::Result<Vec<Vec<String>>, _> = reader.deserialize().collect();
        let mut rows = match rows {
            Ok(rows) => rows,
            Err(error) => return Err(Error::DamagedRun { path, message: error.to_string().into() }),
        };
        let columns = if rows.is_empty() { Vec::new() } else { rows.remove(0) };
        if let Some(at) = rows.iter().position(|row| row.len() != columns.len()) {
            let message = format!("row {} has {} cells, the header has {}", at + 2, rows[at].len(), columns.len());
            return Err(Error::DamagedRun { path, message: message.into() });
        }
        Ok(Sheet { path, columns, rows })
    }

    /// The names of the columns.
    pub fn columns(&self) -> &[String] {
        &self.columns
    }

    /// The number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// A column that must be there.
    ///
    /// # Errors
    /// [`Error::DamagedRun`].
    pub fn column(&self, name: &str) -> Result<usize> {
        self.columns
            .iter()
            .position(|column| column == name)
            .ok_or_else(|| self.damaged(format!("it has no column `{name}`")))
    }

    /// A cell.
    pub fn text(&self, row: usize, column: usize) -> &str {
        &self.rows[row][column]
    }

    /// A cell as a number; `None` where it is empty.
    ///
    /// # Errors
    /// [`Error::DamagedRun`] where it is something else.
    pub fn number(&self, row: usize, column: usize) -> Result<Option<f64>> {
        let text = self.text(row, column);
        if text.is_empty() {
            return Ok(None);
        }
        text.parse().map(Some).map_err(|_| self.bad(row, column))
    }

    /// A cell as a finite number; `None` where it is empty.
    ///
    /// # Errors
    /// [`Error::DamagedRun`] where it is something else.
    pub fn finite(&self, row: usize, column: usize) -> Result<Option<f64>> {
        match self.number(row, column)? {
            Some(number) if !number.is_finite() => Err(self.bad(row, column)),
            number => Ok(number),
        }
    }

    /// A cell that must hold a finite number.
    ///
    /// # Errors
    /// [`Error::DamagedRun`].
    pub fn known(&self, row: usize, column: usize) -> Result<f64> {
        self.finite(row, column)?.ok_or_else(|| self.bad(row, column))
    }

    /// A cell that counts something.
    ///
    /// # Errors
    /// [`Error::DamagedRun`].
    pub fn count(&self, row: usize, column: usize) -> Result<usize> {
        self.text(row, column).parse().map_err(|_| self.bad(row, column))
    }

    fn bad(&self, row: usize, column: usize) -> Error {
        let (name, text) = (&self.columns[column], self.text(row, column));
        self.damaged(format!("row {}: `{text}` in column `{name}` is no number", row + 2))
    }

    /// That the table is not as a run wrote it.
    pub(super) fn damaged(&self, message: String) -> Error {
        Error::DamagedRun { path: self.path.clone(), message: message.into() }
    }
}
