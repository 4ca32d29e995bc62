//! A table of a run, read back.

use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// Cells by row, with the names of the columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    path: PathBuf,
    columns: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Sheet {
    /// Reads `<folder>/<name>.csv`; `None` where there is no such table.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::DamagedRun`] where a row is not as long as the header.
    pub fn find(folder: &Path, name: &str) -> Result<Option<Sheet>> {
        let path = folder.join(format!("{name}.csv"));
        match std::fs::read_to_string(&path) {
            Ok(text) => Sheet::parse(path, &text).map(Some),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(source) => Err(Error::Io { action: "read", path, source }),
        }
    }

    /// From the text of a file.
    ///
    /// # Errors
    /// [`Error::DamagedRun`].
    pub fn parse(path: PathBuf, text: &str) -> Result<Sheet> {
        let mut rows = records(text);
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
        self.columns.iter().position(|column| column == name).ok_or_else(|| Error::DamagedRun {
            path: self.path.clone(),
            message: format!("it has no column `{name}`").into(),
        })
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

    /// A cell that must hold a number.
    ///
    /// # Errors
    /// [`Error::DamagedRun`].
    pub fn known(&self, row: usize, column: usize) -> Result<f64> {
        self.number(row, column)?.ok_or_else(|| self.bad(row, column))
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
        let message = format!("row {}: `{text}` in column `{name}` is no number", row + 2).into();
        Error::DamagedRun { path: self.path.clone(), message }
    }
}

/// Records of RFC 4180: cells in quotes may hold commas, quotes and line ends.
fn records(text: &str) -> Vec<Vec<String>> {
    let (mut rows, mut row, mut cell, mut quoted) = (Vec::new(), Vec::new(), String::new(), false);
    let mut characters = text.chars().peekable();
    while let Some(character) = characters.next() {
        match character {
            '"' if quoted && characters.peek() == Some(&'"') => cell.extend(characters.next()),
            '"' => quoted = !quoted,
            ',' if !quoted => row.push(std::mem::take(&mut cell)),
            '\n' if !quoted => {
                row.push(std::mem::take(&mut cell));
                rows.push(std::mem::take(&mut row));
            }
            '\r' if !quoted => {}
            other => cell.push(other),
        }
    }
    if !row.is_empty() || !cell.is_empty() {
        row.push(cell);
        rows.push(row);
    }
    rows
}
